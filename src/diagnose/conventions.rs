//! Values that are a matter of convention beside other causes.

use super::search::VISIBLE;
use crate::effects::{Applied, secants};

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
}
