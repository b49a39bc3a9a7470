//! Effects as candidate causes: their fitted parameters and coordinates.

use super::plant::{Candidate, Free};
use super::visited::Visited;
use crate::effects::{Bench, EFFECTS, Effect, Fitting, Form, Kind, Parameter};

/// The coordinate of a parameter: 1/value if its off value is infinite.
fn free(p: &'static Parameter, scale: f64) -> Free {
    let inverse = p.off.is_some_and(f64::is_infinite);
    let [low, high] = p.bounds;
    let bounds = match (inverse, low < 0.0) {
        (false, _) => [low, high],
        // Limits of at least 100 V or 100 V/s.
        (true, false) => [0.0, 1.0 / low.max(100.0)],
        (true, true) => [1.0 / high.min(-100.0), 0.0],
    };
    let off = if inverse { Some(0.0) } else { p.off };
    Free { name: p.name, unit: p.unit, off, bounds, scale, inverse }
}

/// The candidates on a bench whose data visit `visited`.
pub(super) fn candidates(bench: &Bench, visited: &Visited) -> Vec<Candidate> {
    let mut all = Vec::new();
    for effect in EFFECTS.iter().copied() {
        let Fitting::Candidate { on, forms, variants } = &effect.fitting else { continue };
        if on(bench) {
            let both = forms.iter().map(|form| (form, false)).chain(variants.iter().map(|form| (form, true)));
            both.for_each(|(form, is_variant)| push(&mut all, effect, form, is_variant, bench, visited));
        }
    }
    all
}

/// Adds a form of an effect; once for each actuator if it is of one.
fn push(
    all: &mut Vec<Candidate>,
    effect: &'static Effect,
    form: &'static Form,
    is_variant: bool,
    bench: &Bench,
    visited: &Visited,
) {
    let fitted = |name: &str| form.fitted.iter().position(|(fitted, _)| *fitted == name);
    let is_left_out = |at: usize| visited.is_beyond(effect, form.fitted[at].0);
    let kept: Vec<usize> = (0..form.fitted.len()).filter(|at| !is_left_out(*at)).collect();
    let parameters: Vec<Free> = kept
        .iter()
        .filter_map(|at| {
            let (name, scale) = form.fitted[*at];
            effect.parameters.iter().find(|p| p.name == name).map(|p| free(p, scale))
        })
        .collect();
    if parameters.is_empty() {
        return;
    }
    let off = |at: usize| parameters[at].off == Some(0.0);
    let of_kept = |start: &&[f64]| -> Vec<f64> { kept.iter().map(|at| start[*at]).collect() };
    // A start at the off value is none.
    let starts: Vec<Vec<f64>> = form
        .starts
        .iter()
        .map(of_kept)
        .filter(|start| effect.shape.is_none() || start.iter().enumerate().any(|(at, x)| !off(at) || *x != 0.0))
        .collect();
    let of_data = effect.parameters.iter().filter_map(|p| Some((p.name, visited.given(p.name)?)));
    let given: Vec<(&'static str, f64)> = form.given.iter().copied().chain(of_data).collect();
    let is_of_one_actuator =
        effect.parameters.iter().any(|p| p.name == "actuator" && p.default.is_none()) && fitted("actuator").is_none();
    let actuators = if is_of_one_actuator { 1..=bench.actuators } else { 0..=0 };
    for actuator in actuators {
        let which = (actuator > 0).then_some(("actuator", actuator as f64));
        all.push(Candidate {
            id: effect.id,
            kind: effect.kind.name(),
            cause: effect.cause,
            places: effect.places.iter().map(|place| place.name()).collect(),
            is_free_form: effect.shape.is_some(),
            is_variant,
            is_constant: effect.kind == Kind::Calibration,
            parameters: parameters.clone(),
            fixed: given.iter().copied().chain(which).collect(),
            starts: starts.clone(),
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effects::Place;

    const BENCH: Bench = Bench { is_clamped: true, is_on_floor: true, actuators: 5, markers: 3, runs: 5 };
    const VISITED: Visited = Visited {
        volts: [-1500.0, 400.0],
        curvature: 5.0,
        bend: 8.0,
        rate: 300.0,
        root_moment: 3.0,
        slip_speed: 100.0,
        coordinate: 50.0,
        axes: [true; 2],
        longest: 10.0,
    };

    #[test]
    fn creep_has_the_same_time_constants_in_runs_of_all_lengths() {
        let all = candidates(&BENCH, &VISITED);
        let mut creeps = all.iter().filter(|candidate| candidate.id == "creep").peekable();
        assert!(creeps.peek().is_some() && creeps.all(|creep| creep.fixed.contains(&("slowest_s", 3.0 * VISITED.longest))));
    }

    #[test]
    fn every_effect_is_a_candidate_or_excluded_for_a_reason() {
        let all = candidates(&BENCH, &VISITED);
        for effect in EFFECTS {
            let own: Vec<&Candidate> = all.iter().filter(|c| c.id == effect.id).collect();
            match &effect.fitting {
                Fitting::Excluded(reason) => assert!(own.is_empty() && !reason.is_empty(), "{}", effect.id),
                Fitting::Candidate { forms, variants, .. } => {
                    assert!(own.len() >= forms.len() + variants.len(), "{}", effect.id);
                }
            }
            for c in own {
                assert!(!c.starts.is_empty() && c.parameters.iter().all(|p| p.scale > 0.0), "{}", c.id);
                assert!(c.starts.iter().all(|start| start.len() == c.parameters.len()), "{}", c.id);
                let known = |name: &str| effect.parameters.iter().any(|p| p.name == name);
                assert!(c.fixed.iter().all(|(name, _)| known(name)), "{}: {:?}", c.id, c.fixed);
                for (p, x) in c.starts.iter().flat_map(|start| c.parameters.iter().zip(start)) {
                    assert!((p.bounds[0]..=p.bounds[1]).contains(x), "{} starts with {} = {x}", c.id, p.name);
                }
            }
        }
    }

    #[test]
    fn every_form_lists_parameters_of_its_effect_and_every_free_form_has_a_named_rival() {
        for effect in EFFECTS {
            let Fitting::Candidate { forms, variants, .. } = &effect.fitting else { continue };
            for (name, _) in forms.iter().chain(*variants).flat_map(|form| form.fitted) {
                assert!(effect.parameters.iter().any(|p| p.name == *name), "{}: {name}", effect.id);
            }
            let is_rival = |other: &&&Effect| other.shape.is_none() && other.places.contains(&effect.places[0]);
            assert!(effect.shape.is_none() || EFFECTS.iter().any(|other| is_rival(&other)), "{}", effect.id);
            assert!(effect.places.iter().all(|place| Place::ALL.contains(place)), "{}", effect.id);
        }
    }

    #[test]
    fn a_side_of_a_curve_that_no_voltage_reaches_is_not_fitted() {
        let one_sided = Visited { volts: [-1500.0, 0.0], ..VISITED };
        let of = |visited: &Visited| {
            let all = candidates(&BENCH, visited);
            all.into_iter().find(|c| c.id == "free-voltage-curve").map(|c| c.parameters.len())
        };
        assert_eq!((of(&VISITED), of(&one_sided)), (Some(16), Some(8)));
    }

    #[test]
    fn an_axis_that_is_not_measured_is_not_fitted() {
        for (axes, count) in [([true; 2], 12), ([false, true], 6), ([true, false], 6)] {
            let all = candidates(&BENCH, &Visited { axes, ..VISITED });
            let picture = all.into_iter().find(|c| c.id == "free-picture").unwrap();
            let of_x = picture.parameters.iter().filter(|p| p.name.starts_with("x_")).count();
            assert_eq!((picture.parameters.len(), of_x), (count, if axes[0] { 6 } else { 0 }));
            assert_eq!(picture.starts.len(), count);
        }
    }
}
