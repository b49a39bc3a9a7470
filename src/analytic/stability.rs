//! The largest stable time step of torques evaluated at the start of a step, in O(n) for n joints.
//!
//! A step or frequency is bisected; each trial factorises the mass matrix with its springs and dampers by the articulated-body recursion, O(n), and
//! checks the pivots (Sylvester's law of inertia).

use nalgebra::SMatrix;

use crate::model::{ATTACHMENT_RATE, Attachment, DRY_FRICTION_RATE, LOSS_TIMES, Mount, Robot};

/// Relative width at which a bisection ends.
const PRECISION: f64 = 1e-15;
/// Number of frequencies at which a robot with material loss (a generalised Maxwell chain) is tested, and the lowest relative to the highest.
const FREQUENCIES: u32 = 24;
const LOWEST_SHARE: f64 = 1e-4;
/// Growth per step that is attributed to rounding.
const GROWTH: f64 = 1e-9;
/// Squarings of the step matrix: a norm of 1e30 of a stable matrix then adds less than 1e-10 per step.
const SQUARINGS: u32 = 40;

/// A body in the vertical plane: mass (g), first moment about its left end (g·cm), inertia about its left end (g·cm²).
#[derive(Debug, Clone, Copy, Default)]
struct Inertia {
    mass: f64,
    moment: f64,
    about_end: f64,
}

/// The flat chain for small motion across it: coordinates are height and pitch of the left end, then the joints.
struct Chain {
    bodies: Vec<Inertia>,
    lengths: Vec<f64>,
    mount: Mount,
    /// Stiffness of a compliant clamp (dyn·cm/rad).
    clamp: Option<f64>,
    /// Stiffness of a clamp that shifts (dyn/cm).
    slide: Option<f64>,
    /// What is fixed to the sheet.
    points: Vec<Point>,
}

/// A tape or cable: its body, the lever from the body's left end (cm), and its steepest stiffness and damping (dyn/cm, dyn·s/cm).
struct Point {
    body: usize,
    lever: f64,
    stiffness: f64,
    damping: f64,
}

impl Chain {
    fn new(robot: &Robot) -> Self {
        let lengths: Vec<f64> = robot.segments().iter().map(|segment| segment.length).collect();
        let bodies = robot.rigid_bodies();
        // Of a curve, the largest: the softest clamp holds least.
        let compliance = robot.extensions.clamp_compliance + robot.extensions.clamp_curve.largest();
        let inertia = |(body, length): (&crate::model::RigidBody, &f64)| {
            let arm = body.middle * length;
            Inertia { mass: body.mass, moment: body.mass * arm, about_end: body.inertia + body.mass * arm * arm }
        };
        let point = |law: &Attachment| {
            let (body, share) = robot.body_at(law.position);
            let damping = law.stiffness * law.damping + law.friction / ATTACHMENT_RATE;
            Point { body, lever: share * lengths[body], stiffness: law.stiffness, damping }
        };
        Self {
            points: robot.extensions.attachments.iter().map(point).collect(),
            bodies: bodies.iter().zip(&lengths).map(inertia).collect(),
            lengths,
            mount: robot.mount,
            slide: (robot.mount == Mount::Clamped && robot.extensions.clamp_shift > 0.0)
                .then(|| 1.0 / robot.extensions.clamp_shift),
            clamp: (robot.mount == Mount::Clamped && compliance > 0.0).then(|| 1.0 / compliance),
        }
    }

    /// True if `scale`·M − `drag`·A + `joint`·1 + `clamp`·E − 2 h C − h² K is positive definite, with A the unit matrix of the bodies' angles, 1 that of
    /// the joints, E that of the clamp, h the `step` (s), and C and K of what is fixed to the sheet: all pivots of the articulated-body recursion, tip to base,
    /// are positive.
    fn is_positive(&self, scale: f64, drag: f64, joint: f64, clamp: f64, step: f64) -> bool {
        let mut outboard = Inertia::default();
        for (i, (body, length)) in self.bodies.iter().zip(&self.lengths).enumerate().rev() {
            // Articulated inertia of the outboard bodies and this one, about its left end.
            let Inertia { mass, moment, about_end } = outboard;
            let mut articulated = Inertia {
                mass: scale * body.mass + mass,
                moment: scale * body.moment + moment + mass * length,
                about_end: scale * body.about_end - drag + about_end + length * (2.0 * moment + mass * length),
            };
            for point in self.points.iter().filter(|point| point.body == i) {
                let taken = step * (2.0 * point.damping + step * point.stiffness);
                articulated.mass -= taken;
                articulated.moment -= taken * point.lever;
                articulated.about_end -= taken * point.lever * point.lever;
            }
            if i == 0 {
                return match self.mount {
                    Mount::Clamped => {
                        let turning = articulated.about_end + clamp;
                        let sinking = articulated.mass + step * step * self.slide.unwrap_or(0.0);
                        let coupling = if self.clamp.is_some() { articulated.moment } else { 0.0 };
                        (self.clamp.is_none() || turning > 0.0)
                            && (self.slide.is_none()
                                || (sinking > 0.0 && (self.clamp.is_none() || sinking * turning > coupling * coupling)))
                    }
                    _ => {
                        articulated.mass > 0.0
                            && articulated.mass * articulated.about_end - articulated.moment * articulated.moment > 0.0
                    }
                };
            }
            let pivot = articulated.about_end + joint;
            if pivot.is_nan() || pivot <= 0.0 {
                return false;
            }
            outboard = Inertia {
                mass: articulated.mass - articulated.moment * articulated.moment / pivot,
                moment: articulated.moment * joint / pivot,
                about_end: articulated.about_end * joint / pivot,
            };
        }
        true
    }

    /// Inertia of the last body about its joint (g·cm²): an upper bound of the smallest eigenvalue of the joints' mass matrix.
    fn last(&self) -> f64 {
        self.bodies.last().map_or(0.0, |body| body.about_end)
    }
}

/// The largest x up to `high` for which `holds(x)`, if `holds` is true below some x and false above.
fn largest(high: f64, holds: impl Fn(f64) -> bool) -> f64 {
    if holds(high) {
        return high;
    }
    let (mut low, mut high) = (0.0, high);
    while high - low > PRECISION * high && high > f64::MIN_POSITIVE {
        let middle = 0.5 * (low + high);
        if middle <= low || middle >= high {
            break;
        }
        if holds(middle) { low = middle } else { high = middle }
    }
    low
}

/// Largest natural frequency ω (rad/s) of the flat robot's joints on their springs, without contact.
///
/// ```text
/// det(K − ω² M) = 0,   K = k·1,   M: mass matrix of the joints with the base fixed or eliminated
/// ```
///
/// A compliant clamp counts as a hinge; where joints differ in stiffness, all count as the stiffest, for an upper bound. O(n) for n joints; relative error below 1e-10 against the dense eigenvalue problem.
pub fn highest_joint_frequency(robot: &Robot) -> f64 {
    let chain = Chain::new(robot);
    // K is a multiple of the unit matrix: the largest ω² is k over the smallest eigenvalue of M.
    let smallest = largest(chain.last(), |eigenvalue| chain.is_positive(1.0, 0.0, -eigenvalue, 0.0, 0.0));
    (robot.joint().stiffness * stiffest(robot) / smallest).sqrt()
}

/// The largest factor on a joint's stiffness (–).
fn stiffest(robot: &Robot) -> f64 {
    let factors = &robot.extensions.joint_stiffness;
    if factors.is_empty() { 1.0 } else { factors.iter().copied().fold(0.0, f64::max) }
}

/// Largest time step (s) at which the torque law, evaluated at the start of each step, is stable.
///
/// Semi-implicit Euler with explicit damping, `M (v⁺ − v) = −h (C v + K θ)`, `θ⁺ = θ + h v⁺`, is stable as long as
///
/// ```text
/// 4 M − 2 h C − h² K    is positive definite
/// ```
///
/// At the limit a mode alternates from step to step with constant amplitude. For one mode of frequency ω with c = ηω² the limit is
/// `h < (√(c² + 4ω²) − c)/ω²`, which tends to 2/(ηω²) for strong damping. Contact can require a smaller step.
///
/// The robot's extensions are included: factors on stiffness, damping and mass (the stiffest joint counts, a lower bound of the limit); point masses; a clamp that turns or shifts (implicit, so it adds `h²/c` at the
/// base); dry friction of the joints with its slope at rest; curves of their moment with their steepest slope; springs with a limit; tapes and cables, taut and at rest; viscous friction on the floor (an upper bound); material loss, by the spectral radius
/// of a step at frequencies up to the highest. Hardening is left to [`stable_step_at`]. Air drag is neglected: its rate is below 1 % of 1/h at all
/// speeds that Bullet allows.
///
/// O(n) for n joints. Without viscous friction and loss, where the limit is exact, its relative error is below 1e-10 against dense eigenvalues.
pub fn stable_step(robot: &Robot) -> f64 {
    stable_step_at(robot, 0.0)
}

/// As [`stable_step`] (s), for joints bent elastically by `curvature` (1/cm), where hardening may make them stiffer.
pub fn stable_step_at(robot: &Robot, curvature: f64) -> f64 {
    let (chain, mut joint, extensions) = (Chain::new(robot), robot.joint(), &robot.extensions);
    joint.stiffness *= stiffest(robot);
    // The slope of k δ (1 − a κ₀² (|δ|/(ℓ κ₀))^p).
    let hardening = 1.0 + (extensions.softening_exponent + 1.0) * (-extensions.softened(curvature)).max(0.0);
    let link = robot.link_length();
    let slips: f64 = extensions.slips.iter().map(|slip| slip.moment / slip.curvature).sum();
    let stiffness = joint.stiffness * hardening + (extensions.moment_of_curvature.steepest() + slips) / link;
    let dry = extensions.dry_moment(joint.stiffness, link, curvature * link);
    let dry = dry.max(extensions.dry_friction + extensions.friction_of_curvature.largest());
    let damping = joint.stiffness * joint.damping_time + dry / DRY_FRICTION_RATE + extensions.moment_of_rate.steepest() / link;
    let viscous = if robot.mount == Mount::Ground { extensions.stick_slip.viscous } else { 0.0 };
    let below = 0.5 * robot.collision_thickness;
    let mass: f64 = chain.bodies.iter().map(|body| body.mass).sum();
    let holds = |h: f64| {
        // The floor's force −F_v (v + ω b) has at most the power −2 F_v (v² + ω² b²); the flat chain is rigid along its length.
        4.0 * mass > 4.0 * h * viscous * chain.bodies.len() as f64
            && chain.is_positive(
                4.0,
                4.0 * h * viscous * below * below,
                -h * (2.0 * damping + h * stiffness),
                h * h * chain.clamp.unwrap_or(0.0),
                h,
            )
    };
    // Limit of the last body alone: √(c² + 4ω²) − c without cancellation.
    let (omega2, c) = (stiffness / chain.last(), damping / chain.last());
    let step = largest(4.0 / ((c * c + 4.0 * omega2).sqrt() + c), holds);
    if !extensions.has_loss() {
        return step;
    }
    let highest = highest_joint_frequency(robot).powi(2) * stiffness / joint.stiffness;
    let share = |n: u32| LOWEST_SHARE.powf(2.0 * f64::from(n) / f64::from(FREQUENCIES));
    largest(step.min(2.0 * LOSS_TIMES[0]), |h| {
        (0..=FREQUENCIES).all(|n| maxwell_chain_is_stable(highest * share(n), damping / stiffness, extensions.loss, h))
    })
}

/// True if a mode with squared frequency `omega2` (1/s²) and damping time `damping` (s) does not grow at step `h` (s) with the generalised Maxwell
/// chain, which the Bullet engine integrates explicitly.
fn maxwell_chain_is_stable(omega2: f64, damping: f64, loss: [f64; LOSS_TIMES.len()], h: f64) -> bool {
    // States: rate times h, angle, q of each branch.
    let mut step = SMatrix::<f64, 7, 7>::identity();
    let kick = h * h * omega2;
    step[(0, 0)] -= h * damping * omega2;
    step[(0, 1)] = -kick;
    (2..7).for_each(|level| step[(0, level)] = -kick * loss[level - 2]);
    let rate = step.row(0).into_owned();
    let angle = step.row(1) + rate;
    step.set_row(1, &angle);
    for (level, time) in LOSS_TIMES.iter().enumerate() {
        step[(level + 2, 0)] = 1.0;
        step[(level + 2, level + 2)] = 1.0 - h / time;
    }
    spectral_radius(step) <= 1.0 + GROWTH
}

/// Spectral radius by Gelfand's formula `lim ‖Aⁿ‖^(1/n)` (‖·‖: largest entry), n doubled [`SQUARINGS`] times. Unlike a QR iteration it ends for
/// matrices of any scale.
fn spectral_radius(mut power: SMatrix<f64, 7, 7>) -> f64 {
    // Logarithm of the norm, per step.
    let (mut logarithm, mut share) = (0.0, 1.0);
    for _ in 0..SQUARINGS {
        let norm = power.amax();
        if norm == 0.0 {
            return 0.0;
        }
        logarithm += share * norm.ln();
        power /= norm;
        power *= power;
        share *= 0.5;
    }
    logarithm.exp()
}

#[cfg(test)]
mod tests {
    use nalgebra::DMatrix;

    use super::super::tests::robot;
    use super::*;
    use crate::model::{Damping, Extensions, Laminate, PointMass, StickSlip};

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

    /// Eigenvalues of the dense mass matrix for all mounts, with point masses.
    #[test]
    fn the_highest_frequency_and_the_stable_step_are_those_of_the_dense_mass_matrix() {
        for mount in [Mount::Clamped, Mount::Free, Mount::Ground] {
            for points in [vec![], vec![PointMass { mass: 0.7, position: 13.0 }, PointMass { mass: 0.2, position: 20.0 }]] {
                let mut robot = robot(2, 4, mount, 0.0);
                robot.extensions.point_masses = points;
                let (bodies, segments, joints) = (robot.rigid_bodies(), robot.segments(), robot.joints());
                let mut mass = DMatrix::<f64>::zeros(joints + 2, joints + 2);
                let (mut left, mut pivots) = (0.0, vec![0.0]);
                for (body, segment) in bodies.iter().zip(&segments) {
                    let centre = left + body.middle * segment.length;
                    let mut lift = vec![1.0];
                    lift.extend(pivots.iter().map(|pivot| centre - pivot));
                    for row in 0..lift.len() {
                        for column in 0..lift.len() {
                            let turn = if row > 0 && column > 0 { body.inertia } else { 0.0 };
                            mass[(row, column)] += body.mass * lift[row] * lift[column] + turn;
                        }
                    }
                    left += segment.length;
                    pivots.push(left);
                }
                let own = mass.view((2, 2), (joints, joints)).into_owned();
                let coupling = mass.view((0, 2), (2, joints)).into_owned();
                let base = mass.view((0, 0), (2, 2)).into_owned().try_inverse().unwrap();
                let reduced = if mount == Mount::Clamped { own } else { own - coupling.transpose() * base * coupling };
                let omega = (robot.joint().stiffness / reduced.symmetric_eigen().eigenvalues.min()).sqrt();
                // The dense eigenvalue has lost four digits.
                assert!((highest_joint_frequency(&robot) / omega - 1.0).abs() < 1e-10, "{mount:?}");
                for eta in [0.0, 0.045, 10.0] {
                    robot.damping = Damping::Eta(eta);
                    let c = robot.joint().damping_time * omega * omega;
                    let exact = 4.0 / ((c * c + 4.0 * omega * omega).sqrt() + c);
                    assert!((stable_step(&robot) / exact - 1.0).abs() < 1e-10, "{mount:?}, {eta}");
                }
            }
        }
    }

    #[test]
    fn the_spectral_radius_is_the_largest_eigenvalue() {
        let rotation = |radius: f64| {
            let mut matrix = SMatrix::<f64, 7, 7>::from_diagonal_element(0.5 * radius);
            // A pair of complex eigenvalues, coupled to the others.
            let (sin, cos) = 0.3_f64.sin_cos();
            for (at, value) in [((0, 0), cos), ((0, 1), -sin), ((1, 0), sin), ((1, 1), cos), ((2, 3), 1e6), ((0, 5), 3.0)] {
                matrix[at] = radius * value;
            }
            spectral_radius(matrix)
        };
        for radius in [1e-200, 0.9, 1.0 - 1e-9, 1.0, 1.0 + 1e-9, 1e200] {
            assert!((rotation(radius) / radius - 1.0).abs() < 1e-10, "{radius}: {}", rotation(radius));
        }
        assert_eq!(spectral_radius(SMatrix::zeros()), 0.0);
    }

    /// A QR iteration for the same eigenvalues did not end for these.
    #[test]
    fn the_stable_step_with_material_loss_is_found_for_damping_and_sizes_of_any_scale() {
        for (damping, thickness) in [(65536.0, 1.0), (0.05, 1e4), (0.0, 1e-6), (1e12, 1e-3)] {
            let mut robot = robot(5, 3, Mount::Clamped, 0.0);
            robot.damping = Damping::Time(damping);
            robot.material.piezo_thickness *= thickness;
            let without = stable_step(&robot);
            robot.extensions.loss = [0.1; LOSS_TIMES.len()];
            let step = stable_step(&robot);
            assert!(step > 0.0 && step <= without, "{damping}, {thickness}: {step} of {without}");
        }
    }

    #[cfg(feature = "bullet")]
    /// Largest rate (rad/s) later than a tenth of `steps` steps after a kick by the voltages of the first step.
    fn later_rate(robot: &Robot, h: f64, steps: usize) -> f64 {
        use crate::engine::{BulletEngine, Engine};

        let mut engine = BulletEngine::new(robot, h).unwrap();
        let on: Vec<f64> = (0..robot.actuators).map(|i| 1e-3 * (1.0 - 2.0 * (i % 2) as f64)).collect();
        let mut largest = 0.0_f64;
        for step in 0..steps {
            let zeros = vec![0.0; robot.actuators];
            if engine.prepare(if step == 0 { &on } else { &zeros }).is_err() {
                return f64::INFINITY;
            }
            if step > steps / 10 {
                largest = engine.joints().rates.iter().fold(largest, |largest, rate| largest.max(rate.abs()));
            }
            engine.advance().unwrap();
        }
        largest
    }

    /// With each effect a kick decays at 3 % below the limit and grows at 3 % above it, up to Bullet's limit of 100 rad/s.
    #[cfg(feature = "bullet")]
    #[test]
    fn bullet_is_stable_just_below_the_stable_step_and_not_above_it_with_every_effect() {
        let base = Extensions::default();
        // Two that pull against each other, both taut.
        let pair = |damping: f64| {
            let cable = |side: f64| Attachment { position: 9.0, level: -side, side, stiffness: 3e6, damping, friction: 0.0 };
            [cable(1.0), cable(-1.0)]
        };
        let cases = [
            ("plain", base.clone()),
            ("damping", Extensions { damping_scale: 8.889, ..base.clone() }),
            ("stiffness", Extensions { stiffness_scale: 3.0, ..base.clone() }),
            ("mass", Extensions { mass_scale: 0.25, ..base.clone() }),
            ("tip mass", Extensions { point_masses: vec![PointMass { mass: 5.0, position: 9.0 }], ..base.clone() }),
            ("dry friction", Extensions { dry_friction: 100.0, ..base.clone() }),
            ("loss", Extensions { loss: [0.2; LOSS_TIMES.len()], ..base.clone() }),
            ("clamp", Extensions { clamp_compliance: 1e-6, ..base.clone() }),
            ("clamp that shifts", Extensions { clamp_shift: 1e-5, ..base.clone() }),
            ("cables", Extensions { attachments: pair(0.0).to_vec(), ..base.clone() }),
            ("cables with dampers", Extensions { attachments: pair(1e-3).to_vec(), ..base }),
        ];
        for (name, extensions) in cases {
            let mut robot = robot(1, 3, Mount::Clamped, 0.02);
            robot.material.gravity = 0.0;
            robot.extensions = extensions;
            let h = stable_step(&robot);
            let (below, above) = (later_rate(&robot, 0.97 * h, 3000), later_rate(&robot, 1.03 * h, 3000));
            println!("{name}: {h:e} s, {below:e} rad/s below, {above:e} above");
            // The clamp's constraint is solved to a residual of 1e-7, which leaves rates of 8e-4 rad/s.
            // Dry friction is steep only at rest, so its alternation ends near its own rate.
            let grown = if name == "dry friction" { 5e-3 } else { 10.0 };
            assert!(below < 2e-3 && above > grown, "{name}: {below} {above} rad/s");
        }
    }

    #[test]
    fn hardening_shortens_the_step_with_bending_and_viscous_friction_only_on_the_floor() {
        let mut bent = robot(1, 3, Mount::Clamped, 0.0);
        bent.extensions.softening = -200.0;
        // ω grows by √(1 + 3·200·0.05²).
        assert!((stable_step(&bent) / stable_step_at(&bent, 0.05) - 2.5_f64.sqrt()).abs() < 1e-12);
        let on = |mount: Mount, viscous: f64| {
            let mut robot = robot(1, 3, mount, 0.0);
            robot.extensions.stick_slip = StickSlip { viscous, ..StickSlip::OFF };
            stable_step(&robot)
        };
        assert_eq!(on(Mount::Free, 1e7), on(Mount::Free, 0.0));
        assert!(on(Mount::Ground, 1e7) < 0.1 * on(Mount::Ground, 0.0));
    }

    #[test]
    fn ten_thousand_joints_take_no_longer_than_a_thousand_times_ten() {
        let robot = robot(50, 200, Mount::Free, 0.045);
        let start = std::time::Instant::now();
        let h = stable_step(&robot);
        // The eigenvalues of the dense matrix take minutes.
        assert!(start.elapsed().as_secs_f64() < 2.0 && h > 0.0, "{:?}", start.elapsed());
    }
}
