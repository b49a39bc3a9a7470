//! Analytic results: beam frequencies, bending waves, stable time steps.

mod stability;

pub use stability::{highest_joint_frequency, stable_step, stable_step_at};

use crate::model::{Laminate, Robot};

/// First natural frequency (Hz) of a clamped Euler-Bernoulli beam, the limit of the cantilever with many joints.
///
/// ```text
/// f₁ = 3.5160/(2π L²) · √(EI/μ)
/// ```
///
/// EI: flexural rigidity per unit width, μ: mass per area, L: length of the robot.
///
/// # References
/// Any text on vibrations; also the reference's `model_resonant_frequencies`.
pub fn cantilever_frequency(robot: &Robot) -> f64 {
    let laminate = Laminate::new(&robot.material);
    let length = robot.material.actuator_length * robot.actuators as f64;
    3.5160 * (laminate.flexural_rigidity / laminate.areal_density).sqrt() / length.powi(2) / (2.0 * std::f64::consts::PI)
}

/// The first `count` natural frequencies (Hz) of a clamped Euler-Bernoulli beam as long as the robot.
///
/// ```text
/// f_i = (λ_i L)²/(2π L²) · √(EI/μ),    cos x cosh x = −1 at x = λ_i L
/// ```
///
/// # References
/// S. S. Rao, *Mechanical Vibrations*, section 8.5 (transverse vibration of beams, fixed-free).
pub fn cantilever_frequencies(robot: &Robot, count: usize) -> Vec<f64> {
    let laminate = Laminate::new(&robot.material);
    let length = robot.material.actuator_length * robot.actuators as f64;
    let scale = (laminate.flexural_rigidity / laminate.areal_density).sqrt() / length.powi(2) / (2.0 * std::f64::consts::PI);
    (0..count)
        .map(|i| {
            // cos x + 1/cosh x has one root between iπ and (i + 1)π.
            let (mut low, mut high) = (i as f64 * std::f64::consts::PI, (i + 1) as f64 * std::f64::consts::PI);
            let value = |x: f64| x.cos() + 1.0 / x.cosh();
            let sign = value(low).signum();
            for _ in 0..60 {
                let middle = 0.5 * (low + high);
                if value(middle).signum() == sign { low = middle } else { high = middle }
            }
            low.powi(2) * scale
        })
        .collect()
}

/// Phase velocity (cm/s) of bending waves of `frequency` (Hz) along the sheet.
///
/// ```text
/// c = (EI ω²/μ)^(1/4),    EI: flexural rigidity per unit width, μ: mass per area
/// ```
///
/// # References
/// Any text on waves in beams; also the reference's `get_phase_velocity`.
pub fn phase_velocity(robot: &Robot, frequency: f64) -> f64 {
    let laminate = Laminate::new(&robot.material);
    let omega = 2.0 * std::f64::consts::PI * frequency;
    (laminate.flexural_rigidity * omega.powi(2) / laminate.areal_density).powf(0.25)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::{Damping, Extensions, Film, Friction, Material, Mount};

    pub(super) fn robot(actuators: usize, motors: usize, mount: Mount, damping: f64) -> Robot {
        Robot {
            material: Material::PARAMETER_2,
            actuators,
            motors_per_actuator: motors,
            mount,
            damping: Damping::Eta(damping),
            collision_thickness: 0.1,
            friction: Friction { ground: 1.0, low: 1.0, high: 1.0, film: Film::None, film_fraction: 0.5 },
            masses: Vec::new(),
            bodies: None,
            extensions: Extensions::default(),
        }
    }

    #[test]
    fn the_cantilever_of_parameter_set_2_vibrates_at_the_published_frequency() {
        // physics: 18.12 Hz for set 2.
        assert!((cantilever_frequency(&robot(1, 3, Mount::Clamped, 0.0)) - 18.12).abs() < 0.005);
    }

    #[test]
    fn the_beam_has_its_textbook_roots_and_waves() {
        let robot = robot(1, 3, Mount::Clamped, 0.0);
        let f = cantilever_frequencies(&robot, 3);
        // λL = 1.875104, 4.694091, 7.854757.
        assert!((f[0] / cantilever_frequency(&robot) - 1.0).abs() < 1e-5);
        assert!((f[1] / f[0] - (4.694091_f64 / 1.875104).powi(2)).abs() < 1e-5);
        assert!((f[2] / f[0] - (7.854757_f64 / 1.875104).powi(2)).abs() < 1e-4);
        // A wave of c = ω/λ with the beam's first λ has the beam's first frequency.
        assert!((phase_velocity(&robot, f[0]) / (2.0 * std::f64::consts::PI * f[0] / (1.875104 / 10.0)) - 1.0).abs() < 1e-5);
    }
}
