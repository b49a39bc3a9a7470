//! Names of causes, their forms and parameters in texts and reports. Files keep the ids of [`effects`](crate::effects).

use super::diagnosis::{Adopted, Estimate};
use crate::model::{Laminate, Robot};
use crate::number::{digits_for, fixed};

/// The name of a cause, or of a set of causes with plus signs between them.
pub fn cause(id: &str) -> String {
    if let Some((first, rest)) = id.split_once('+') {
        return format!("{} with {}", cause(first), cause(rest));
    }
    match id {
        "stiffness" => "bending stiffness".into(),
        "actuation-gain" => "curvature per volt".into(),
        "damping" => "damping time".into(),
        "areal-mass" => "mass per area".into(),
        "discretisation" => "number of joints".into(),
        "clamp-compliance" => "compliance of the clamp".into(),
        "stiffness-softening" => "softening of the stiffness".into(),
        "clamp-shift" => "shift of the clamp".into(),
        "stiffness-drift" => "drift of the stiffness".into(),
        "gain-drift" => "drift of the curvature per volt".into(),
        _ => id.replace('-', " "),
    }
}

/// The form of a cause that has several, from its given (`fixed`) and fitted parameters; empty for the others.
pub fn form<'a>(id: &str, fixed: &[(impl AsRef<str>, f64)], mut fitted: impl Iterator<Item = &'a str>) -> String {
    let given = |name: &str| fixed.iter().find(|(key, _)| key.as_ref() == name).map(|(_, value)| *value);
    match id {
        "hysteresis" => match (given("plays"), given("from_zero")) {
            (Some(0.0), _) => "Bouc–Wen".into(),
            (Some(_), Some(1.0)) => "plays that come from 0 V (Prandtl–Ishlinskii)".into(),
            (Some(_), _) => "plays at rest at the first voltage (Prandtl–Ishlinskii)".into(),
            _ => String::new(),
        },
        "creep" => match (given("rungs_per_decade"), fitted.nth(2)) {
            (Some(0.0), Some("activation_v")) => "with an activated rate".into(),
            (Some(0.0), _) => "one time constant".into(),
            (Some(_), Some("fastest_s")) => "from a time on that is fitted".into(),
            (Some(_), Some("voltage_exponent")) => "that grows faster than the voltage".into(),
            (Some(1.0), _) if given("fastest_s").is_some() => "one time constant in a decade, from 10 ms on".into(),
            (Some(1.0), _) => "one time constant in a decade".into(),
            (Some(count), _) => format!("{count} time constants in a decade"),
            (None, _) => String::new(),
        },
        "saturation" => match (fitted.next(), fitted.next()) {
            (Some("min_v"), None) => "of negative voltages".into(),
            (Some("max_v"), None) => "of positive voltages".into(),
            (Some("min_v"), _) => "soft, of negative voltages".into(),
            (Some("max_v"), _) => "soft, of positive voltages".into(),
            _ => String::new(),
        },
        "field-dependent-gain" => fitted.find(|name| *name == "exponent").map_or("", |_| "as a power").into(),
        "driver-lag" => match fitted.nth(1) {
            Some("rising") => "with another time constant of rising voltages".into(),
            Some("growth_per_kv") => "of a capacitance that grows".into(),
            Some(_) => "of second order".into(),
            None => String::new(),
        },
        "slew-limit" => match fitted.nth(1) {
            Some("rising") => "with another rate of rising voltages".into(),
            Some(_) => "approached softly".into(),
            None => String::new(),
        },
        "structural-damping" => match (fitted.next(), fitted.next()) {
            (Some("bending_loss_factor"), _) => "in proportion to the bending".into(),
            (_, Some(_)) => "with an exponent".into(),
            _ => String::new(),
        },
        "air-drag" => match fitted.nth(1) {
            Some("linear_m_per_s") => "with a part in proportion to the speed".into(),
            Some(_) => "with an exponent".into(),
            None => String::new(),
        },
        "stiffness-softening" | "polarity-asymmetry" => fitted.nth(1).map_or("", |_| "with an exponent").into(),
        "remanence" => fitted.nth(2).map_or("", |_| "that saturates").into(),
        "dry-friction" => fitted.nth(1).map_or("", |_| "with presliding").into(),
        "cable-drag" => {
            let side = if given("below") == Some(1.0) { "taut below a level" } else { "taut above a level" };
            match fitted.nth(2) {
                Some("drag_mn") => format!("{side}, with friction"),
                Some(_) => format!("{side}, with a damper"),
                None => side.into(),
            }
        }
        "clamp-shift" => fitted.nth(1).map_or("", |_| "with a damper").into(),
        "clamp-compliance" => match fitted.nth(1) {
            Some("hardening_per_rad") => "that hardens".into(),
            Some("asymmetry") => "with unlike sides".into(),
            Some(_) => "with a damper".into(),
            None => String::new(),
        },
        "weak-actuator" => given("actuator").map_or_else(String::new, |number| format!("number {number}")),
        _ => String::new(),
    }
}

/// The name of a cause with its form.
pub fn with_form(id: &str, form: &str) -> String {
    if form.is_empty() { cause(id) } else { format!("{}, {form}", cause(id)) }
}

/// The form of an adopted cause.
pub fn form_of(effect: &Adopted) -> String {
    form(&effect.id, &effect.fixed, effect.parameters.iter().map(|p| p.name.as_str()))
}

/// The name of a parameter of a cause, without its unit.
pub fn parameter(id: &str, name: &str) -> String {
    match (id, name) {
        (_, "scale") => cause(id),
        ("discretisation", "motors_per_actuator") => "joints per actuator".into(),
        ("clamp-compliance", "compliance_rad_per_n_m") => "turn of the clamp per moment".into(),
        ("initial-curvature", "curvature_per_m") => "curvature without voltage".into(),
        ("stiffness-softening", "softening_mm2") => "softening coefficient".into(),
        ("dry-friction", "presliding_per_m") => "curvature from which it slides".into(),
        ("dry-friction", _) => "moment of friction in every joint".into(),
        ("tip-mass", "position_mm") => "distance from the left end".into(),
        ("hysteresis", "width") => "opening of the loop, share of a 1500 V stroke".into(),
        ("hysteresis", "slope_loss") => "loss of gain at a turning point".into(),
        ("hysteresis", "shape") => "power of the plays' weights".into(),
        ("hysteresis", "decay_per_kv") => "decay of the plays' weights".into(),
        ("hysteresis" | "polarity-asymmetry" | "weak-actuator", "gain" | "ratio") => "gain".into(),
        ("creep", "per_decade") => "growth in a decade of time".into(),
        ("creep", "fastest_s") => "fastest time constant".into(),
        ("creep", "power") => "exponent of the growth".into(),
        ("creep", "activation_v") => "distance from which the rate grows exponentially".into(),
        ("creep", "voltage_exponent") => "exponent of the voltage above 1".into(),
        ("remanence", "share") => "share of the voltage that stays".into(),
        ("remanence", "coercive_v") => "coercive voltage".into(),
        ("remanence", "saturation_v") => "largest offset".into(),
        ("clamp-shift", "compliance_mm_per_n") => "shift of the clamp per force".into(),
        ("cable-drag", "stiffness_n_per_m") => "stiffness of the cable".into(),
        ("cable-drag", "drag_mn") => "friction of the cable".into(),
        ("cable-drag", "damping_s") => "damping time of the cable".into(),
        ("cable-drag", "level_mm") => "height from which on it is taut".into(),
        ("cable-drag", "position_mm") => "distance from the left end".into(),
        ("wake-up", "change") => "change of the gain at the start".into(),
        ("wake-up", "path_kv") => "path of the voltage to 1/e of it".into(),
        (_, "per_run") => "change from run to run".into(),
        ("passive-margin", _) => "passive share of an actuator".into(),
        ("field-dependent-gain", "slope_per_kv") => "slope of the gain".into(),
        ("field-dependent-gain", "curvature_per_kv2") => "curvature of the gain".into(),
        ("saturation", "min_v") => "least voltage".into(),
        ("saturation", "max_v") => "largest voltage".into(),
        ("slew-limit", "rising") => "largest rate of rising voltages over that of falling ones".into(),
        ("slew-limit", "linear_s") => "time constant of small changes".into(),
        ("slew-limit", _) => "largest rate".into(),
        ("driver-lag", "inertia") => "inertia of the driver".into(),
        ("driver-lag", "growth_per_kv") => "growth of the capacitance with the voltage".into(),
        ("air-drag", "linear_m_per_s") => "speed of equal linear and quadratic drag".into(),
        ("driver-lag", "rising") => "time constant of rising voltages over that of falling ones".into(),
        ("field-dependent-gain", "reference_v") => "voltage of nominal gain".into(),
        ("ground-friction", _) => "factor on the friction".into(),
        ("sensor-scale", _) => "scale of the camera".into(),
        _ => {
            let units = ["_rad_per_n_m", "_per_m", "_mm_s", "_v_per_s", "_mm2", "_mm", "_deg", "_mn_m", "_g", "_s", "_v"];
            units.iter().find_map(|unit| name.strip_suffix(unit)).unwrap_or(name).replace('_', " ")
        }
    }
}

/// A parameter in words: name, value, interval and unit.
pub fn words(id: &str, p: &Estimate) -> String {
    let what = if p.name == "scale" { "times the nominal".into() } else { parameter(id, &p.name) };
    let unit = if p.unit.is_empty() { String::new() } else { format!(" {}", p.unit) };
    match p.ci95 {
        [Some(low), Some(high)] if low == high => format!("{what} {}", p.value),
        [Some(low), Some(high)] => {
            let digits = digits_for(high - low);
            format!("{what} {:.digits$}{unit}, {low:.digits$} to {high:.digits$}", p.value)
        }
        _ => format!("{what} {:.4}{unit}", p.value),
    }
}

/// The constants of the nominal model that calibration scales: id, value, unit.
pub fn constants(robot: &Robot) -> [(&'static str, f64, &'static str); 4] {
    let laminate = Laminate::new(&robot.material);
    [
        // dyn·cm² to N·mm², 1/(cm·V) to 1/(m·kV), s to ms, g/cm² to kg/m².
        ("stiffness", 1e-3 * laminate.flexural_rigidity * robot.material.width, "N·mm²"),
        ("actuation-gain", 1e5 * laminate.curvature_per_volt, "1/(m·kV)"),
        ("damping", 1e3 * robot.damping.time(), "ms"),
        ("areal-mass", 10.0 * laminate.areal_density, "kg/m²"),
    ]
}

/// A parameter as shown in a report.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Shown {
    /// Its name.
    pub name: String,
    /// Its value, with the digits that its interval justifies.
    pub value: String,
    /// Its 95 % confidence interval.
    pub range: String,
    /// Its unit; a dash for dimensionless ones.
    pub unit: String,
    /// A remark: a constant relative to its nominal value, or a value at a bound.
    pub note: String,
}

/// An estimate of a parameter of cause `id`; scales of [`constants`] in the constants' own units.
pub fn shown(id: &str, estimate: &Estimate, constants: &[(&str, f64, &str)]) -> Shown {
    let constant = constants.iter().find(|(of, ..)| *of == id && estimate.name == "scale");
    let (factor, unit) = constant.map_or((1.0, estimate.unit.as_str()), |(_, nominal, unit)| (*nominal, *unit));
    let ends = estimate.ci95.map(|end| end.map(|end| factor * end));
    let is_given = matches!(ends, [Some(low), Some(high)] if low == high);
    let digits = match ends {
        _ if estimate.value.fract() == 0.0 && factor == 1.0 && (is_given || id == "discretisation") => 0,
        [Some(low), Some(high)] if high > low => digits_for(high - low),
        _ => digits_for(0.01 * factor * estimate.value.abs()),
    };
    let end = |end: Option<f64>| end.map_or_else(|| "open".into(), |end| fixed(end, digits));
    let mut notes = Vec::new();
    if let Some((_, nominal, _)) = constant {
        notes.push(format!("{} × the nominal {}", fixed(estimate.value, 3), fixed(*nominal, digits)));
    }
    if estimate.at_bound {
        notes.push("at a bound of the fit".into());
    }
    Shown {
        name: parameter(id, &estimate.name),
        value: fixed(factor * estimate.value, digits),
        range: if is_given { "found by trying".into() } else { format!("{} to {}", end(ends[0]), end(ends[1])) },
        unit: if unit.is_empty() { "–".into() } else { unit.into() },
        note: notes.join("; "),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnose::candidates::candidates;
    use crate::diagnose::visited::Visited;
    use crate::effects::{Bench, EFFECTS};
    use crate::experiment::{self, Source, presets};

    fn robot(preset: &str) -> Robot {
        experiment::experiment(&Source::from_text(preset, presets::find(preset).unwrap().text)).unwrap().robot
    }

    #[test]
    fn every_form_of_a_cause_has_a_label_of_its_own() {
        for preset in ["cantilever-dc", "static-shape"] {
            let mut labels: Vec<String> = candidates(&Bench::new(&robot(preset), 2, 5), &Visited::NOTHING)
                .iter()
                .map(|c| with_form(c.id, &form(c.id, &c.fixed, c.parameters.iter().map(|p| p.name))))
                .collect();
            let count = labels.len();
            labels.sort();
            labels.dedup();
            assert_eq!(labels.len(), count, "{labels:?}");
        }
    }

    #[test]
    fn numbers_have_names_without_underscores_and_constants_have_units() {
        for effect in EFFECTS {
            for p in effect.parameters {
                let name = parameter(effect.id, p.name);
                assert!(!name.contains('_') && name != "scale" && !name.is_empty(), "{} {}", effect.id, p.name);
            }
        }
        let scale =
            Estimate { name: "scale".into(), value: 0.5, unit: String::new(), ci95: [Some(0.49), Some(0.52)], at_bound: false };
        let constants = constants(&robot("cantilever-dc"));
        for (id, nominal, unit) in constants {
            let shown = shown(id, &scale, &constants);
            let value: f64 = shown.value.parse().unwrap();
            assert!((value / (0.5 * nominal) - 1.0).abs() < 0.05, "{shown:?}");
            assert!(shown.unit == unit && shown.note.starts_with("0.500 × the nominal"), "{shown:?}");
        }
    }
}
