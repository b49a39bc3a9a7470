//! Values that are a matter of convention beside other causes.

use super::search::{LEAST_GAIN, VISIBLE};
use crate::effects::{Action, Applied, secants};

/// True if a gain is no cause of its own among `effects` that leave `left` (χ² per value above 1).
///
/// What slope of a loop is called its gain is a convention: that of a steady full stroke, as here, or that of the first one from rest, each within the opening of
/// the loop. So is the time at which creep begins to count where its law leaves more than half the noise, within a decade of it.
pub(super) fn is_gain_a_convention(effects: &[Applied], left: f64) -> bool {
    let find = |id: &str| effects.iter().find(|applied| applied.effect.id == id);
    let Some(scale) = find("actuation-gain").and_then(|gain| gain.get("scale")) else { return false };
    let is_of_loop = |hysteresis: &Applied| {
        let open = hysteresis.get("width").unwrap_or_default();
        let [first, steady] = secants(hysteresis);
        (1.0f64.min(steady / first) - open..=1.0f64.max(steady / first) + open).contains(&scale)
    };
    let decade = find("creep").filter(|_| left > VISIBLE).and_then(|creep| creep.get("per_decade"));
    find("hysteresis").is_some_and(is_of_loop) || decade.is_some_and(|decade| (scale - 1.0).abs() < decade)
}

/// Least voltage whose gain counts (V), and the full stroke.
const STROKES: [f64; 2] = [150.0, 1500.0];
/// By how much the slope of a loop may depend on its stroke, in openings of the full one.
const OPENINGS: f64 = 2.0;

/// True if a gain that depends on the voltage is no cause of its own among `effects` that leave `left` (χ² per value above 1).
///
/// How the slope of a loop depends on its stroke is a matter of its law: not at all, or, by Rayleigh's law s(E) = α + R·E with an opening of R·E² halfway, by twice the
/// opening over the full stroke. So a curve that changes the gain by no more is what the law lacks, if the data contradict that law.
pub(super) fn is_curve_a_convention(effects: &[Applied], left: f64) -> bool {
    let find = |id: &str| effects.iter().find(|applied| applied.effect.id == id);
    let (Some(hysteresis), Some(curve)) = (find("hysteresis"), find("field-dependent-gain")) else { return false };
    let Action::Voltages(stage) = curve.effect.action else { return false };
    let gain = |volts: f64| {
        let mut out = [volts];
        stage(&curve.values, 1, 0.0).settle(&mut out);
        out[0] / volts
    };
    let [least, most] = STROKES;
    let along = (0..=10).map(|k| gain(least + 0.1 * f64::from(k) * (most - least)) / gain(most));
    let [low, high] = along.fold([1.0f64, 1.0f64], |[low, high], g| [low.min(g), high.max(g)]);
    left > LEAST_GAIN && high - low <= OPENINGS * hysteresis.get("width").unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effects;

    #[test]
    fn a_gain_within_a_loop_or_a_decade_of_creep_that_is_not_followed_is_a_convention() {
        let with = |id: &str, values: &[(&str, f64)]| effects::find(id).unwrap().with(values.iter().copied()).unwrap();
        // Plays of equal weights per volt, as in Rayleigh's law: the first stroke is longer than a steady one by about twice the opening.
        let rayleigh = &[("width", 0.05), ("plays", 1.0), ("shape", 1.0), ("pinned", 1.0)];
        let narrow = &[("width", 0.05), ("plays", 1.0), ("shape", 0.0), ("decay_per_kv", 20.0), ("pinned", 1.0)];
        for (other, left, lowest) in [
            (with("hysteresis", rayleigh), 0.0, 0.86),
            (with("hysteresis", narrow), 0.0, 0.92),
            (with("hysteresis", &[("width", 0.05), ("pinned", 1.0)]), 0.0, 0.92),
            (with("creep", &[("per_decade", 0.05)]), 0.0, 1.0),
            (with("creep", &[("per_decade", 0.05)]), 0.3, 0.95),
            (with("tip-mass", &[("mass_g", 0.05)]), 0.3, 1.0),
        ] {
            let is_convention =
                |scale: f64| is_gain_a_convention(&[with("actuation-gain", &[("scale", scale)]), other.clone()], left);
            let is_one = lowest < 1.0;
            let found = [lowest - 0.01, lowest + 0.01, 1.04, 1.06].map(is_convention);
            assert_eq!(found, [false, is_one, is_one, false], "{} {left}", other.effect.id);
        }
    }

    #[test]
    fn a_curve_of_the_gain_within_what_rayleigh_s_law_does_is_a_convention_where_the_loop_is_not_followed() {
        let with = |id: &str, values: &[(&str, f64)]| effects::find(id).unwrap().with(values.iter().copied()).unwrap();
        let hysteresis = || with("hysteresis", &[("width", 0.05), ("pinned", 1.0)]);
        let is_convention =
            |curve: &[(&str, f64)], left| is_curve_a_convention(&[hysteresis(), with("field-dependent-gain", curve)], left);
        // From 150 to 1500 V the gain changes by 1.35 b / (1 + 1.5 b), and by 10^−p − 1.
        for (curve, within) in [
            ([("slope_per_kv", 0.08)], true),
            ([("slope_per_kv", 0.09)], false),
            ([("exponent", -0.04)], true),
            ([("exponent", -0.05)], false),
        ] {
            assert_eq!(is_convention(&curve, 0.1), within, "{curve:?}");
            assert!(!is_convention(&curve, 0.01));
        }
        assert!(!is_curve_a_convention(&[with("field-dependent-gain", &[("slope_per_kv", 0.01)])], 0.1));
    }
}
