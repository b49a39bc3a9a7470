//! Effects as candidate causes: their fitted parameters, coordinates and starts.

use super::plant::{Candidate, Free};
use crate::effects::{EFFECTS, Kind, Parameter};
use crate::model::{Mount, Robot};

/// The coordinate of a parameter: 1/value if its off value is infinite.
fn free(p: &'static Parameter) -> Free {
    let inverse = p.off.is_some_and(f64::is_infinite);
    let [low, high] = p.bounds;
    let bounds = match (inverse, low < 0.0) {
        (false, _) => [low, high],
        // Limits of at least 100 V or 100 V/s.
        (true, false) => [0.0, 1.0 / low.max(100.0)],
        (true, true) => [1.0 / high.min(-100.0), 0.0],
    };
    let off = if inverse { Some(0.0) } else { p.off };
    Free { name: p.name, unit: p.unit, off, bounds, scale: 0.0, inverse }
}

/// The candidates for a robot with a number of `markers`.
pub(super) fn candidates(robot: &Robot, markers: usize) -> Vec<Candidate> {
    let clamped = robot.mount == Mount::Clamped;
    let ground = robot.mount == Mount::Ground;
    let mut all = Vec::new();
    for effect in EFFECTS.iter().copied() {
        let is_applicable = match effect.id {
            "discretisation" => false,
            "clamp-compliance" => clamped,
            // With one actuator it is the actuation gain.
            "weak-actuator" => robot.actuators > 1,
            // The tip alone cannot tell it from the actuation gain.
            "passive-margin" => robot.actuators > 1 || markers > 1,
            _ => effect.kind != Kind::Ground || ground,
        };
        if !is_applicable {
            continue;
        }
        // Fitted parameters with their scales; starts; given parameters.
        type Form = (Vec<(&'static str, f64)>, Vec<Vec<f64>>, Vec<(&'static str, f64)>);
        let one = |name: &'static str, scale: f64, starts: &[f64]| -> Form {
            (vec![(name, scale)], starts.iter().map(|x| vec![*x]).collect(), Vec::new())
        };
        let forms: Vec<Form> = match effect.id {
            "stiffness" | "actuation-gain" | "areal-mass" => vec![one("scale", 0.1, &[1.05])],
            "damping" => vec![one("scale", 0.3, &[1.5, 4.0])],
            "clamp-compliance" => vec![one("compliance_rad_per_n_m", 0.5, &[0.2, 1.0])],
            "tip-mass" => vec![one("mass_g", 0.1, &[0.05, 0.2])],
            "initial-curvature" => vec![one("curvature_per_m", 0.2, &[0.1])],
            "stiffness-softening" => vec![one("softening_mm2", 500.0, &[500.0, -300.0])],
            "dry-friction" => vec![one("moment_mn_m", 0.1, &[0.05, 0.3])],
            "structural-damping" => vec![one("loss_factor", 0.02, &[0.02])],
            "air-drag" => vec![one("drag_coefficient", 1.0, &[1.0, 4.0])],
            "time-delay" => vec![one("delay_s", 2e-3, &[1e-3, 5e-3])],
            "saturation" => vec![
                one("min_v", 2e-4, &[-1.0 / 1300.0, -1.0 / 1000.0, -1.0 / 700.0]),
                one("max_v", 2e-4, &[1.0 / 1300.0, 1.0 / 800.0, 1.0 / 400.0, 1.0 / 200.0]),
            ],
            "slew-limit" => vec![one("rate_v_per_s", 2e-6, &[1.5e-6, 3e-6, 6e-6, 1.2e-5, 2.5e-5])],
            "driver-lag" => vec![one("time_constant_s", 2e-3, &[1e-3, 5e-3])],
            "hysteresis" => vec![
                (
                    vec![("width", 0.05), ("slope_loss", 0.2), ("asymmetry", 0.3)],
                    vec![vec![0.05, 0.2, 0.0], vec![0.2, 0.6, 0.0]],
                    vec![("exponent", 1.0), ("plays", 0.0), ("pinned", 1.0)],
                ),
                (
                    vec![("width", 0.05), ("shape", 0.5), ("decay_per_kv", 2.0)],
                    vec![vec![0.05, 0.0, 1.0], vec![0.2, 0.5, 1.0]],
                    vec![("plays", 1.0), ("from_zero", 0.0), ("pinned", 1.0)],
                ),
                (
                    vec![("width", 0.05), ("shape", 0.5), ("decay_per_kv", 2.0)],
                    vec![vec![0.05, 0.0, 1.0]],
                    vec![("plays", 1.0), ("from_zero", 1.0), ("pinned", 1.0)],
                ),
            ],
            "creep" => {
                let chain = |per_decade: f64| -> Form {
                    (vec![("per_decade", 0.02), ("power", 0.2)], vec![vec![0.02, 0.0]], vec![("rungs_per_decade", per_decade)])
                };
                let single: Form = (
                    vec![("per_decade", 0.02), ("fastest_s", 0.3)],
                    vec![vec![0.02, 0.3], vec![0.02, 3.0]],
                    vec![("rungs_per_decade", 0.0)],
                );
                vec![chain(1.0), chain(2.0), single]
            }
            "field-dependent-gain" => {
                vec![(vec![("slope_per_kv", 0.05), ("curvature_per_kv2", 0.03)], vec![vec![0.05, 0.0]], Vec::new())]
            }
            "polarity-asymmetry" => vec![one("ratio", 0.2, &[1.2])],
            "weak-actuator" => {
                (1..=robot.actuators).map(|j| (vec![("gain", 0.1)], vec![vec![0.95]], vec![("actuator", j as f64)])).collect()
            }
            "passive-margin" => vec![one("fraction", 0.05, &[0.08])],
            "ground-friction" => vec![one("scale", 0.2, &[0.8, 1.25])],
            "stick-slip" => vec![one("static_ratio", 0.2, &[1.2])],
            "contact-restitution" => vec![one("restitution", 0.1, &[0.1, 0.4])],
            "ground-slope" => vec![one("angle_deg", 0.5, &[0.5])],
            "sensor-scale" => vec![one("scale", 0.02, &[1.02])],
            "sensor-offset" => {
                vec![(vec![("x_mm", 0.2), ("z_mm", 0.2)], vec![vec![0.1, 0.1]], Vec::new())]
            }
            "sensor-delay" => vec![one("delay_s", 2e-3, &[1e-3, 5e-3])],
            "camera-tilt" => vec![one("angle_deg", 0.5, &[0.3])],
            _ => Vec::new(),
        };
        for (fitted, starts, fixed) in forms {
            let parameters = fitted.iter().filter_map(|(name, scale)| {
                let p = effect.parameters.iter().find(|p| p.name == *name)?;
                Some(Free { scale: *scale, ..free(p) })
            });
            all.push(Candidate {
                id: effect.id,
                kind: effect.kind.name(),
                cause: effect.cause,
                is_constant: effect.kind == Kind::Calibration,
                parameters: parameters.collect(),
                fixed,
                starts,
            });
        }
    }
    all
}
