//! Closed-form results that the program, its tests and its documents compare with.

use nalgebra::DMatrix;

use crate::model::{Laminate, Mount, Robot};

/// First natural frequency (Hz) of a clamped Euler-Bernoulli beam, the limit of the cantilever for many joints.
///
/// ```text
/// f₁ = 3.5160/(2π L²) · √(EI/μ)
/// ```
///
/// EI per unit width, μ mass per area, L the beam's length (the robot's, if it has several actuators).
///
/// # References
/// Any text on vibrations; also the reference's `model_resonant_frequencies`.
pub fn cantilever_frequency(robot: &Robot) -> f64 {
    let laminate = Laminate::new(&robot.material);
    let length = robot.material.actuator_length * robot.actuators as f64;
    3.5160 * (laminate.flexural_rigidity / laminate.areal_density).sqrt() / length.powi(2) / (2.0 * std::f64::consts::PI)
}

/// The first `count` natural frequencies (Hz) of the same beam.
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

/// Phase velocity (cm/s) of bending waves of frequency `frequency` (Hz) along the sheet.
///
/// ```text
/// c = (EI ω²/μ)^(1/4),    EI per unit width, μ mass per area
/// ```
///
/// # References
/// Any text on waves in beams; also the reference's `get_phase_velocity`.
pub fn phase_velocity(robot: &Robot, frequency: f64) -> f64 {
    let laminate = Laminate::new(&robot.material);
    let omega = 2.0 * std::f64::consts::PI * frequency;
    (laminate.flexural_rigidity * omega.powi(2) / laminate.areal_density).powf(0.25)
}

/// Largest angular frequency ω (rad/s) at which the flat robot's joints vibrate against their springs, without contact.
///
/// ```text
/// det(K − ω² M) = 0,   K = k·1,   M the mass matrix of the joints, the base held or eliminated
/// ```
pub fn highest_joint_frequency(robot: &Robot) -> f64 {
    let joints = robot.joints();
    let segments = robot.segments();
    let thickness = robot.collision_thickness;
    // Coordinates: height and pitch of the left end, then the joints. Each segment's centre moves in z by its distance to every
    // turning point before it; x motion is of second order in a flat chain.
    let size = joints + 2;
    let mut mass = DMatrix::<f64>::zeros(size, size);
    let mut left = 0.0;
    let mut pivots: Vec<f64> = vec![0.0];
    for segment in &segments {
        let centre = left + 0.5 * segment.length;
        let mut lift = vec![1.0];
        lift.extend(pivots.iter().map(|pivot| -(centre - pivot)));
        let mut turn = vec![0.0];
        turn.extend(pivots.iter().map(|_| 1.0));
        let inertia = segment.mass / 12.0 * (segment.length.powi(2) + thickness.powi(2));
        for row in 0..lift.len() {
            for column in 0..lift.len() {
                mass[(row, column)] += segment.mass * lift[row] * lift[column] + inertia * turn[row] * turn[column];
            }
        }
        left += segment.length;
        pivots.push(left);
    }
    let joint_block = mass.view((2, 2), (joints, joints)).into_owned();
    let reduced = if robot.mount == Mount::Clamped {
        joint_block
    } else {
        let base = mass.view((0, 0), (2, 2)).into_owned();
        let coupling = mass.view((0, 2), (2, joints)).into_owned();
        match base.try_inverse() {
            Some(inverse) => joint_block - coupling.transpose() * inverse * coupling,
            None => joint_block,
        }
    };
    // K is a multiple of the unit matrix: the largest ω² is k over the smallest eigenvalue of the mass matrix.
    let smallest = reduced.symmetric_eigen().eigenvalues.min();
    (robot.joint().stiffness / smallest).sqrt()
}

/// Largest time step (s) for which the torque law, evaluated at the start of each step, is stable.
///
/// A mode of frequency ω and damping rate c = ηω², stepped by semi-implicit Euler with explicit damping, has the characteristic
/// polynomial λ² − (2 − hc − h²ω²)λ + (1 − hc). Its roots stay inside the unit circle while 4 − 2hc − h²ω² > 0:
///
/// ```text
/// h < (√(c² + 4ω²) − c)/ω²        which tends to 2/(ηω²) for strong damping
/// ```
///
/// Evaluated for the highest joint mode. Contact can require less.
pub fn stable_step(robot: &Robot) -> f64 {
    let omega = highest_joint_frequency(robot);
    let c = robot.damping.time() * omega * omega;
    // √(c² + 4ω²) − c without cancellation.
    4.0 / ((c * c + 4.0 * omega * omega).sqrt() + c)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::{Damping, Extensions, Film, Friction, Material};

    fn robot(actuators: usize, motors: usize, mount: Mount, damping: f64) -> Robot {
        Robot {
            material: Material::PARAMETER_2,
            actuators,
            motors_per_actuator: motors,
            mount,
            damping: Damping::Eta(damping),
            collision_thickness: 0.1,
            positive_gain: 1.0,
            friction: Friction { ground: 1.0, low: 1.0, high: 1.0, film: Film::None, film_fraction: 0.5 },
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

    #[test]
    fn one_joint_is_a_pendulum_on_a_spring() {
        let robot = robot(1, 1, Mount::Clamped, 0.0);
        // One box of half length and half mass behind the joint: I = M/2 (l²/3 + t²/12), l = L/2.
        let mass = Laminate::new(&robot.material).actuator_mass / 2.0;
        let inertia = mass * (25.0 / 3.0 + 0.01 / 12.0);
        let omega = (robot.joint().stiffness / inertia).sqrt();
        assert!((highest_joint_frequency(&robot) / omega - 1.0).abs() < 1e-12);
    }

    #[test]
    fn the_stable_step_has_its_limits_without_and_with_strong_damping() {
        let free = robot(1, 3, Mount::Clamped, 0.0);
        let omega = highest_joint_frequency(&free);
        assert!((stable_step(&free) * omega - 2.0).abs() < 1e-12);
        let damped = robot(1, 3, Mount::Clamped, 100.0);
        assert!((stable_step(&damped) * damped.damping.time() * omega * omega - 2.0).abs() < 1e-3);
    }
}
