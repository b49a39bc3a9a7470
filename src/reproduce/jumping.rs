//! Jumping in place: section III-C.

use super::{Bench, Findings, StudyError, curve};
use crate::model::Mount;
use crate::recording::Recording;
use crate::recording::measures::{ContactState, Measures, contact_states};
use crate::view::{Figure, Mark, shape};

/// The authors' own simulated curve, read off their published plot to ±0.03 mm.
const ON_TIME: &str = include_str!("jump_height_vs_on_time.csv");
/// The voltages of the real robot, and the gain that turns them into the code's.
const REAL: [&str; 2] = ["drive.on_voltages_v=[300,300,-1500,300,300]", "robot.positive_gain=1.733"];
const PERIOD: f64 = 1.0 / 14.0;
/// Frequencies (Hz) at which Bullet is asked as well.
const SPOTS_HZ: [f64; 3] = [7.0, 14.0, 20.0];
/// Bullet's step for the authors' curve (s): a hundred of the authors' own.
const ON_TIME_STEP: f64 = 2e-3 / 240.0;
/// Time between the authors' records (s): 12,500 of their steps. They do not say it; of all spacings this one puts Bullet's heights
/// within the accuracy of reading on all of their points, where records without gaps would be up to 0.2 mm higher.
const ON_TIME_RECORDS: &str = "simulation.record_every_s=1.0416666666666667e-3";

/// 1.2 s at 14 Hz, and its measures.
fn jump(bench: &Bench, bullet: bool) -> Result<(Recording, Measures), StudyError> {
    let settings = [REAL[0], REAL[1], "simulation.duration_s=1.2", "simulation.record_every_s=5e-4"];
    let (_, run) = if bullet { bench.run_on_bullet("jump-14hz", &settings)? } else { bench.run("jump-14hz", &settings)? };
    let measures = Measures::of(&run.recording, Mount::Ground, Some(PERIOD));
    Ok((run.recording, measures))
}

/// The states of contact over the last two periods, one after the other, with their lengths (s). Those shorter than 2 ms are rebounds
/// and belong to the one before.
fn steps(recording: &Recording) -> Vec<(ContactState, f64)> {
    let end = recording.time[recording.len() - 1];
    let from = recording.time.partition_point(|&t| t < end - 2.0 * PERIOD).max(1);
    let lengths = recording.time.windows(2).map(|pair| pair[1] - pair[0]);
    let samples = contact_states(recording).into_iter().skip(1).zip(lengths).skip(from - 1);
    let join = |steps: &mut Vec<(ContactState, f64)>, state: ContactState, length: f64, shortest: f64| match steps.last_mut() {
        Some((last, whole)) if *last == state || length < shortest => *whole += length,
        _ => steps.push((state, length)),
    };
    let mut all: Vec<(ContactState, f64)> = Vec::new();
    samples.for_each(|(state, length)| join(&mut all, state, length, 0.0));
    let mut steps = Vec::new();
    // Where the cut leaves less than that at the beginning, it is left out.
    all.into_iter().skip_while(|step| step.1 < 2e-3).for_each(|(state, length)| join(&mut steps, state, length, 2e-3));
    steps
}

fn name(state: ContactState) -> &'static str {
    match state {
        ContactState::BodyTouching => "body touching",
        ContactState::EndTouching => "end touching",
        ContactState::Aerial => "aerial",
    }
}

pub fn at_14_hz(bench: &Bench) -> Result<Findings, StudyError> {
    let (recording, measures) = jump(bench, false)?;
    let mut findings = Findings::default();
    let height = measures.jump_height_mm.unwrap_or(f64::NAN);
    let difference = if (7.5..=8.5).contains(&height) { "within".into() } else { format!("{:+.1} mm of 7.5 mm", height - 7.5) };
    findings.compare(
        "height of the lowest point",
        "at least 7.5 mm, about 8 mm (measured)",
        format!("{height:.2} mm"),
        difference,
        "Friction of the film and damping are those of the authors' notebooks (1.0, dampingEta 0.045).",
    );
    let spot = jump(bench, true)?.1;
    findings.check_on_bullet("height of the lowest point", "mm", height, spot.jump_height_mm.unwrap_or(f64::NAN));
    let ratio = measures.period_ratio.unwrap_or(f64::NAN);
    findings.compare(
        "period of the motion over that of the voltage",
        "2 (measured)",
        format!("{ratio:.0}"),
        if ratio == 2.0 { "none" } else { "differs" },
        "0 would stand for no period.",
    );
    let phase = measures.mid_end_phase_deg.unwrap_or(f64::NAN);
    findings.compare("midpoint against ends at 14 Hz", "out of phase (measured)", format!("{phase:.0}°"), "", "The paper gives no number. Heights above the floor are compared; the flight of the whole robot, which moves both alike, takes part in them.");
    let list: Vec<String> =
        steps(&recording).into_iter().map(|(state, length)| format!("{} {:.0} ms", name(state), 1e3 * length)).collect();
    findings.compare(
        "steps of one motion (two periods)",
        "four steps, of body touching, end touching and aerial shapes",
        list.join(", "),
        "",
        "Where the motion is cut open is arbitrary, so the first and last may be parts of one.",
    );

    let end = recording.time[recording.len() - 1];
    let from = recording.time.partition_point(|&t| t < end - 4.0 * PERIOD);
    let mut figure = Figure::new("In-place jumping at 14 Hz", "time (ms)", "height z (mm)");
    let node = |node: usize| {
        (from..recording.len()).map(|i| (1e3 * recording.time[i], 10.0 * recording.node(i, node)[2])).collect::<Vec<_>>()
    };
    let lowest = |i: usize| (0..recording.nodes()).map(|n| recording.node(i, n)[2]).fold(f64::INFINITY, f64::min);
    figure.series("midpoint", node(recording.nodes() / 2), Mark::Line);
    figure.series("left end", node(0), Mark::Line);
    figure.series("lowest point", (from..recording.len()).map(|i| (1e3 * recording.time[i], 10.0 * lowest(i))), Mark::Line);
    let volts = |i: usize| recording.motor_voltages[i * recording.joints() + recording.joints() / 2];
    figure.series(
        "drive (−3: on, −4: off)",
        (from..recording.len()).map(|i| (1e3 * recording.time[i], if volts(i) < 0.0 { -3.0 } else { -4.0 })),
        Mark::Line,
    );
    findings.figure = figure.svg();
    findings.caption = "The last four periods of 1.2 s. The robot repeats its motion after two periods of the voltage.".into();
    Ok(findings)
}

pub fn key_shapes(bench: &Bench) -> Result<Findings, StudyError> {
    let (recording, measures) = jump(bench, false)?;
    let mut findings = Findings::default();
    let states = contact_states(&recording);
    let end = recording.time[recording.len() - 1];
    let from = recording.time.partition_point(|&t| t < end - 2.0 * PERIOD);
    let z = |i: usize, node: usize| recording.node(i, node)[2];
    let middle = recording.nodes() / 2;
    let lowest = |i: usize| (0..recording.nodes()).map(|n| z(i, n)).fold(f64::INFINITY, f64::min);
    // Of each state the record that shows it best: ends highest, middle highest, lowest point highest.
    let best = |state: ContactState, score: &dyn Fn(usize) -> f64| {
        (from..recording.len()).filter(|&i| states[i] == state).max_by(|&a, &b| score(a).total_cmp(&score(b)))
    };
    let found = [
        (ContactState::BodyTouching, best(ContactState::BodyTouching, &|i| z(i, 0))),
        (ContactState::EndTouching, best(ContactState::EndTouching, &|i| z(i, middle))),
        (ContactState::Aerial, best(ContactState::Aerial, &lowest)),
    ];
    let mut figure = Figure::new("Key shapes at 14 Hz", "x (mm)", "z (mm)");
    figure.equal_aspect().without_y_numbers();
    for (row, (state, record)) in found.iter().enumerate() {
        let floor = -60.0 * row as f64;
        figure.horizontal(floor);
        let Some(i) = *record else {
            findings.compare(name(*state), "shown", "does not occur", "differs", "");
            continue;
        };
        figure.line("", shape(&recording, i).into_iter().map(|(x, z)| (x, z + floor)), "#0072b2", 3.0);
        figure.note(0.0, floor + 34.0, &format!("{}, {:.1} ms", name(*state), 1e3 * recording.time[i]));
        let ours =
            format!("ends {:.1} mm, midpoint {:.1} mm, lowest {:.1} mm", 10.0 * z(i, 0), 10.0 * z(i, middle), 10.0 * lowest(i));
        findings.compare(name(*state), "shown, without numbers", ours, "", "The figure's points are not published as numbers.");
    }
    let spot = jump(bench, true)?.1;
    let share = |measures: &Measures| 100.0 * measures.aerial.unwrap_or(f64::NAN);
    findings.check_on_bullet("share of the time in the air", "%", share(&measures), share(&spot));
    findings.figure = figure.svg();
    findings.caption = "Of each kind the moment in the last two periods that shows it best, each on a floor of its own.".into();
    Ok(findings)
}

pub fn over_frequency(bench: &Bench) -> Result<Findings, StudyError> {
    let (sweep, points) = bench.sweep("jump-frequency", "jump-frequency-scan", &REAL)?;
    let heights = curve(&sweep, &points, sweep.axes.len() - 1, 0);
    let mut findings = Findings::default();
    let best =
        heights.iter().copied().filter(|p| p.1.is_finite()).max_by(|a, b| a.1.total_cmp(&b.1)).unwrap_or((f64::NAN, f64::NAN));
    let at_14 = heights.iter().find(|p| p.0 == 14.0).map_or(f64::NAN, |p| p.1);
    findings.compare(
        "frequency of the highest jump",
        "14 Hz (chosen for the measurements)",
        format!("{:.0} Hz, {:.2} mm", best.0, best.1),
        format!("{:+.0} Hz", best.0 - 14.0),
        "The paper does not say that 14 Hz is the optimum of the height.",
    );
    findings.compare(
        "height at 14 Hz",
        "at least 7.5 mm, about 8 mm (measured)",
        format!("{at_14:.2} mm"),
        format!("{:+.2} mm of 7.5 mm", at_14 - 7.5),
        "",
    );
    findings.without_result(&heights);
    let bullet = bench.spots("jump-frequency", &sweep, 1e-5, &SPOTS_HZ)?;
    for &(f, height) in &bullet {
        let planar = heights.iter().find(|p| p.0 == f).map_or(f64::NAN, |p| p.1);
        findings.check_on_bullet(&format!("height at {f} Hz"), "mm", planar, height);
    }
    let mut figure = Figure::new("In-place jumping", "frequency (Hz)", "jump height (mm)");
    figure.series("simulated", heights, Mark::Both);
    figure.series("Bullet", bullet, Mark::Points);
    figure.series("measured, 14 Hz", [(14.0, 7.5), (14.0, 8.0)], Mark::Both);
    findings.figure = figure.svg();
    findings.caption = "Largest height of the lowest point in 1.2 s.".into();
    Ok(findings)
}

pub fn over_on_time(bench: &Bench) -> Result<Findings, StudyError> {
    let (sweep, points) = bench.sweep("jump-on-time", "jump-on-time-scan", &[ON_TIME_RECORDS])?;
    let ours = curve(&sweep, &points, sweep.axes.len() - 1, 0);
    let (dense_sweep, dense) = bench.sweep("jump-on-time-dense", "jump-on-time-scan", &[])?;
    let dense = curve(&dense_sweep, &dense, dense_sweep.axes.len() - 1, 0);
    let theirs: Vec<(f64, f64)> = ON_TIME
        .lines()
        .filter_map(|line| line.split_once(','))
        .filter_map(|(t, z)| Some((t.parse().ok()?, z.parse().ok()?)))
        .collect();
    let times: Vec<f64> = theirs.iter().map(|p| p.0).collect();
    let bullet = bench.spots("jump-on-time", &sweep, ON_TIME_STEP, &times)?;
    let beside = |curve: &[(f64, f64)]| -> Vec<(f64, f64, f64)> {
        theirs.iter().filter_map(|&(t, z)| curve.iter().find(|p| (p.0 - t).abs() < 1e-9).map(|p| (t, z, p.1))).collect()
    };
    let rms = |curve: &[(f64, f64)]| {
        let pairs = beside(curve);
        (pairs.iter().map(|(_, a, b)| (a - b).powi(2)).sum::<f64>() / pairs.len() as f64).sqrt()
    };
    let common = beside(&ours);
    let worst = common.iter().copied().max_by(|a, b| (a.1 - a.2).abs().total_cmp(&(b.1 - b.2).abs())).unwrap_or_default();
    let top = |points: &mut dyn Iterator<Item = (f64, f64)>| {
        points.filter(|p| p.1.is_finite()).max_by(|a, b| a.1.total_cmp(&b.1)).unwrap_or((f64::NAN, f64::NAN))
    };
    let (their_top, our_top) = (top(&mut theirs.iter().copied()), top(&mut common.iter().map(|&(t, _, z)| (t, z))));
    let fine_top = top(&mut ours.iter().copied());
    let mut findings = Findings::default();
    findings.compare(
        &format!("height over on-time, {} of {} points", common.len(), theirs.len()),
        "the authors' simulated curve, read off to ±0.03 mm",
        format!("{:.3} mm rms apart", rms(&ours)),
        format!("largest {:+.2} mm at {:.0} ms", worst.2 - worst.1, 1e3 * worst.0),
        "Records every 1.04 ms, which is 12,500 of the authors' steps: the lowest point of a vibrating robot peaks sharply, and their curve carries the gaps between their records.",
    );
    findings.compare(
        "the same on Bullet",
        "spot check",
        format!("{:.3} mm rms apart", rms(&bullet)),
        "",
        "All points, with the same records, by 8.3·10⁻⁶ s.",
    );
    findings.compare(
        "the same with records without gaps",
        "",
        format!("{:.3} mm rms apart", rms(&dense)),
        "",
        "What is seen if every peak is caught.",
    );
    findings.compare(
        "best on-time on the authors' points",
        &format!("{:.0} ms, {:.2} mm", 1e3 * their_top.0, their_top.1),
        format!("{:.0} ms, {:.2} mm", 1e3 * our_top.0, our_top.1),
        format!("{:+.0} ms, {:+.2} mm", 1e3 * (our_top.0 - their_top.0), our_top.1 - their_top.1),
        &format!(
            "On our finer grid the best is {:.0} ms with {:.2} mm; the authors have no point between 24 and 32 ms.",
            1e3 * fine_top.0,
            fine_top.1
        ),
    );
    let ms = |points: &[(f64, f64)]| points.iter().map(|p| (1e3 * p.0, p.1)).collect::<Vec<_>>();
    let mut figure = Figure::new("A single jump", "on-time (ms)", "jump height (mm)");
    figure.series("this program", ms(&ours), Mark::Both);
    figure.series("Bullet", ms(&bullet), Mark::Points);
    figure.series("authors' simulation", ms(&theirs), Mark::Points);
    findings.figure = figure.svg();
    findings.caption = "The middle three actuators are on until the on-time, then all are off.".into();
    Ok(findings)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_authors_curve_is_there() {
        assert_eq!(ON_TIME.lines().filter(|line| line.starts_with("0.")).count(), 11);
    }
}
