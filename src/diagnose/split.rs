//! Three kinds of runs: those that parameters are fitted to, those that causes are selected on, and those that judge the result, once.

use super::dataset::Role;
use super::plant::{Plant, Signal};

/// Fewest runs of which some are kept to judge by. Of fewer, each may be the only one that shows a cause, so they are judged by cross-validation.
const LEAST_FOR_THREE_KINDS: usize = 12;
/// Most folds of a cross-validation.
const FOLDS: usize = 4;

/// Runs by what they are for, by index.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Split {
    /// Parameters are fitted to them.
    pub fit: Vec<usize>,
    /// Causes are selected on them: no parameter is fitted to them, but what is adopted depends on them.
    pub select: Vec<usize>,
    /// The final model is judged on them: neither parameters nor selection see them.
    pub judge: Vec<usize>,
}

impl Split {
    /// The runs that the search sees, in order.
    pub fn all(&self) -> Vec<usize> {
        let mut all = [self.fit.as_slice(), &self.select].concat();
        all.sort_unstable();
        all
    }

    /// The folds of a cross-validation, which leave out every run once; none where there are runs that judge.
    pub(super) fn folds(&self) -> Vec<Vec<usize>> {
        let all = self.all();
        let count = if self.judge.is_empty() { all.len().min(FOLDS) } else { 0 };
        (0..count).map(|first| all.iter().copied().skip(first).step_by(count).collect()).collect()
    }

    /// What a run is for: `fit`, `select` or `judge`.
    pub fn role(&self, run: usize) -> &'static str {
        match run {
            run if self.judge.contains(&run) => "judge",
            run if self.select.contains(&run) => "select",
            _ => "fit",
        }
    }
}

/// Splits runs by what they are for; given roles are kept, and of several given `held-out` runs every other one judges.
///
/// The others are split in the same way among runs with jumps of the input and among those without: in order of the input's speed, one of every
/// three neighbours is selected on, in turn the one with the largest and the one with the smallest range; the slowest and the fastest never are. Of two
/// or three runs in all, the last or middle one is. Of twelve runs or more, of the other two of the three the one that moves less judges:
/// what only large motions show is left to the fit.
pub fn split(plant: &dyn Plant, roles: &[Role]) -> Split {
    let signals = plant.signals();
    let (mut fit, mut select, mut judge, mut held_out) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
    let mut kinds: [Vec<Pace>; 2] = [Vec::new(), Vec::new()];
    for (run, signal) in signals.iter().enumerate() {
        match roles.get(run).copied().unwrap_or_default() {
            Role::Fit => fit.push(run),
            Role::HeldOut => held_out.push(run),
            Role::Auto => {
                let pace = Pace::of(run, signal);
                kinds[usize::from(pace.jumps)].push(pace);
            }
        }
    }
    for (index, run) in held_out.iter().enumerate() {
        if index % 2 == 0 { select.push(*run) } else { judge.push(*run) }
    }
    let has_judges = held_out.is_empty() && signals.len() >= LEAST_FOR_THREE_KINDS;
    for mut order in kinds {
        order.sort_by(|a, b| a.speed.total_cmp(&b.speed).then(a.range.total_cmp(&b.range)));
        let count = order.len();
        let inner = if count < 3 { 0..0 } else { 1..count - 1 };
        for (index, group) in order[inner].chunks(3).enumerate() {
            let sign = if index % 2 == 0 { 1.0 } else { -1.0 };
            let by_range = |a: &&Pace, b: &&Pace| (sign * a.range).total_cmp(&(sign * b.range));
            select.extend(group.iter().max_by(by_range).map(|pace| pace.run));
            if has_judges && group.len() == 3 {
                let others = group.iter().filter(|pace| !select.contains(&pace.run));
                judge.extend(others.min_by(|a, b| a.swing.total_cmp(&b.swing)).map(|pace| pace.run));
            }
        }
        fit.extend(order.iter().map(|pace| pace.run).filter(|run| !select.contains(run) && !judge.contains(run)));
    }
    [&mut fit, &mut select, &mut judge].into_iter().for_each(|runs| runs.sort_unstable());
    if fit.is_empty() {
        std::mem::swap(&mut fit, &mut select);
    }
    if select.is_empty() && fit.len() >= 2 && roles.iter().all(|role| *role == Role::Auto) {
        select.extend(fit.pop());
    }
    Split { fit, select, judge }
}

/// Speed and range of a run's input.
struct Pace {
    run: usize,
    /// Path of the input over its range, per second.
    speed: f64,
    /// Largest less smallest input.
    range: f64,
    /// Standard deviation of the signal within its channels, in the plant's unit.
    swing: f64,
    /// True if the input jumps between two rows.
    jumps: bool,
}

impl Pace {
    fn of(run: usize, signal: &Signal) -> Self {
        let (low, high) =
            signal.inputs.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), u| (low.min(*u), high.max(*u)));
        let range = (high - low).max(1e-9);
        let (mut path, mut time, mut largest) = (0.0, 0.0, 0.0_f64);
        for (u, t) in signal.inputs.windows(2).zip(signal.times.windows(2)).filter(|(_, t)| t[1] > t[0]) {
            path += (u[1] - u[0]).abs();
            largest = largest.max((u[1] - u[0]).abs());
            time += t[1] - t[0];
        }
        let rows = signal.inputs.len().max(1) as f64;
        // A smooth input changes by π/2 times its mean change at most, a triangle by its mean.
        let jumps = largest > 6.0 * path / rows && largest > 0.05 * range;
        Self { run, speed: path / range / f64::max(time, 1e-9), range, swing: swing(signal), jumps }
    }
}

fn swing(signal: &Signal) -> f64 {
    let channels = signal.channels.iter().max().map_or(0, |last| last + 1);
    let mut sums = vec![[0.0; 3]; channels];
    for (value, channel) in signal.values.iter().zip(&signal.channels) {
        sums[*channel].iter_mut().zip([1.0, *value, value * value]).for_each(|(sum, term)| *sum += term);
    }
    let squares: f64 = sums.iter().filter(|[n, ..]| *n > 0.0).map(|[n, v, vv]| vv - v * v / n).sum();
    (squares / signal.values.len().max(1) as f64).max(0.0).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnose::DiagnoseError;
    use crate::diagnose::plant::{Candidate, Model, Nuisance};

    struct Runs(Vec<Signal>);

    impl Plant for Runs {
        fn signals(&self) -> &[Signal] {
            &self.0
        }

        fn channels(&self) -> Vec<String> {
            vec!["y".into()]
        }

        fn unit(&self) -> &'static str {
            ""
        }

        fn candidates(&self) -> &[Candidate] {
            &[]
        }

        fn predict(&self, _: &Model, run: usize, _: &Nuisance) -> Result<Vec<f64>, DiagnoseError> {
            Ok(self.0[run].values.clone())
        }
    }

    /// Sines of a frequency (Hz) and an amplitude; the signal is the input times a gain.
    fn runs(all: &[(f64, f64, f64)]) -> Runs {
        let signal = |(hertz, amplitude, gain): &(f64, f64, f64)| {
            let times: Vec<f64> = (0..400).map(|row| f64::from(row) / 400.0).collect();
            let inputs: Vec<f64> = times.iter().map(|t| amplitude * (std::f64::consts::TAU * hertz * t).sin()).collect();
            let values = inputs.iter().map(|u| gain * u).collect();
            Signal { values, sigmas: vec![1.0; 400], times, channels: vec![0; 400], inputs, ..Signal::default() }
        };
        Runs(all.iter().map(signal).collect())
    }

    const TWELVE: [(f64, f64, f64); 12] = [
        (1.0, 10.0, 1.0),
        (2.0, 4.0, 1.0),
        (2.0, 10.0, 1.0),
        (3.0, 4.0, 1.0),
        (4.0, 10.0, 1.0),
        (5.0, 4.0, 5.0),
        (5.0, 8.0, 5.0),
        (6.0, 5.0, 1.0),
        (6.0, 6.0, 1.0),
        (6.0, 7.0, 1.0),
        (7.0, 1.0, 1.0),
        (9.0, 10.0, 1.0),
    ];

    #[test]
    fn the_largest_motion_of_three_neighbours_is_never_kept_from_fit_and_selection() {
        let split = split(&runs(&TWELVE), &[Role::Auto; 12]);
        // Of 2, 2 and 3 Hz the largest input is selected on, of 4, 5 and 5 Hz the smallest, of 6 Hz the largest, and 7 Hz, which has no neighbours left; of
        // the others of three those that move less judge.
        assert_eq!(split, Split { fit: vec![0, 3, 6, 8, 11], select: vec![2, 5, 9, 10], judge: vec![1, 4, 7] });
        assert_eq!(split.all(), [0, 2, 3, 5, 6, 8, 9, 10, 11]);
        assert_eq!([0, 2, 4].map(|run| split.role(run)), ["fit", "select", "judge"]);
        assert!(split.folds().is_empty());
    }

    #[test]
    fn few_runs_have_no_judges_and_given_roles_are_kept() {
        let eleven = split(&runs(&TWELVE[..11]), &[Role::Auto; 11]);
        assert!(eleven.judge.is_empty() && !eleven.select.is_empty());
        assert_eq!(eleven.folds(), [vec![0, 4, 8], vec![1, 5, 9], vec![2, 6, 10], vec![3, 7]]);
        let mut roles = [Role::Fit; 8];
        [3, 5, 6].into_iter().for_each(|run| roles[run] = Role::HeldOut);
        assert_eq!(split(&runs(&TWELVE[..8]), &roles), Split { fit: vec![0, 1, 2, 4, 7], select: vec![3, 6], judge: vec![5] });
        let two = split(&runs(&TWELVE[..2]), &[Role::Auto; 2]);
        assert_eq!((two.fit.len(), two.select.len(), two.folds().len()), (1, 1, 2));
    }
}
