//! One corner on the floor: the law of contact and the linear piece of it that a state stands for.
//!
//! Per corner, with the cone K = {|x| ≤ μ z}, compliance R, velocity w and target w*:
//!
//! ```text
//! λ = P_K((w* − w)/R)         the gradient of  −R/2 |λ|²  in w: convex, with four linear pieces
//! ```

use super::recursion::{Articulated, Spatial};

/// Softness of contact as a share of a body's inverse mass: under half its weight a corner gives way by 3·10⁻⁸ cm/s at steps of 10⁻⁴ s.
/// Ten times stiffer contact changes heights and strides by 10⁻⁴ of them and takes a tenth more iterations.
const SOFTNESS: f64 = 6e-7;
/// Largest change of a corner's vertical velocity in a step (cm/s) that is looked ahead for: more than the robots fall with.
const LARGEST_CHANGE: f64 = 150.0;
/// Share of a penetration that is pushed out per step, and the largest speed of it (cm/s): so slow that it makes no energy to speak of.
const PUSH_OUT: f64 = 0.1;
const PUSH_OUT_SPEED: f64 = 0.01;

/// Approach speed (cm/s) below which nothing bounces, as in Bullet.
const LEAST_BOUNCE: f64 = 0.2;

/// What all corners share.
#[derive(Debug, Clone, Copy)]
pub(super) struct Law {
    time_step: f64,
    /// Share of the step's end in the mean motion.
    weight: f64,
    /// 1/R (g).
    stiffness: f64,
    frictionless: bool,
}

impl Law {
    /// Step (s), and the gap (cm) that a corner at rest may close in it.
    pub(super) fn reach(&self) -> (f64, f64) {
        (self.time_step, LARGEST_CHANGE * self.time_step)
    }

    pub(super) fn new(time_step: f64, weight: f64, body_mass: f64) -> Self {
        Self { time_step, weight, stiffness: body_mass / SOFTNESS, frictionless: false }
    }

    /// A frictionless floor for displacements: no velocity before, everything near.
    pub(super) fn statics(stiffness: f64) -> Self {
        Self { time_step: 1.0, weight: 1.0, stiffness, frictionless: true }
    }
}

/// State of a corner: the linear piece of the law.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) enum Touch {
    #[default]
    Open,
    Stick,
    /// Pushed by the floor towards +x.
    SlideForward,
    /// Pushed by the floor towards −x.
    SlideBackward,
}

/// A coefficient of friction μ, and what the law needs of it.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Grip {
    friction: f64,
    /// 1/(1 + μ²).
    share: f64,
    /// (μ, 1)/√(1 + μ²): direction of the impulse on a corner that is pushed forward.
    slide: [f64; 2],
}

impl Grip {
    pub(super) fn new(friction: f64) -> Self {
        let share = 1.0 / (1.0 + friction * friction);
        Self { friction, share, slide: [friction * share.sqrt(), share.sqrt()] }
    }

    pub(super) fn friction(&self) -> f64 {
        self.friction
    }
}

/// One bottom corner.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Corner {
    /// From the body's reference point (cm).
    pub(super) arm: [f64; 2],
    touch: Touch,
    /// Vertical velocity that has been taken off the target's end (cm/s).
    lift: f64,
    grip: Grip,
    /// Mean velocity w* that stops it on the floor at the end (cm/s).
    target: [f64; 2],
    /// Mean velocity of the iterate (cm/s).
    velocity: [f64; 2],
    /// Mean velocity of the newest solution, less the iterate's.
    step: [f64; 2],
    /// Impulse of the floor on it (dyn·s), times the weight.
    impulse: [f64; 2],
}

impl Corner {
    /// A corner at `arm` from its body's reference point, `gap` (cm) above the floor, that moves with `before` (cm/s): what mean velocity
    /// stops it on the floor at the step's end.
    pub(super) fn place(&mut self, arm: [f64; 2], gap: f64, before: [f64; 2], grip: Grip, law: &Law) {
        self.arm = arm;
        self.grip = grip;
        self.lift = 0.0;
        let ahead = -gap / law.time_step;
        let end = if gap > 0.0 || law.frictionless { ahead } else { (PUSH_OUT * ahead).min(PUSH_OUT_SPEED) };
        self.target = [before[0] * (1.0 - law.weight), before[1] + law.weight * (end - before[1])];
    }

    /// Lets a corner that reaches the floor in this step leave it with the share `restitution` of the speed it comes with (cm/s).
    pub(super) fn bounce(&mut self, gap: f64, speed: f64, restitution: f64, law: &Law) {
        let reaches = gap + law.time_step * speed <= 0.0;
        if restitution > 0.0 && reaches && speed < -LEAST_BOUNCE {
            self.target[1] = speed + law.weight * (-restitution * speed - speed);
        }
    }

    /// Takes off the lift that the convex model gives a corner which slides with the body's motion `mean` (De Saxcé's correction), by a step
    /// of the fixed-point iteration that is damped by 1/(1 + μ); returns how far the lift changed (cm/s).
    pub(super) fn take_off_lift(&mut self, mean: &Spatial, law: &Law) -> f64 {
        if self.touch == Touch::Open {
            return 0.0;
        }
        let mu = self.grip.friction;
        let sliding = (self.velocity_in(mean)[0] - self.target[0]) / law.weight;
        let by = (mu * sliding.abs() - self.lift) / (1.0 + mu);
        self.lift += by;
        self.target[1] -= law.weight * by;
        by.abs()
    }

    /// A corner that nothing touches.
    pub(super) fn open(&mut self) {
        self.touch = Touch::Open;
        self.impulse = [0.0; 2];
    }

    pub(super) fn is_open(&self) -> bool {
        self.touch == Touch::Open
    }

    /// Impulse of the floor on it over the step (dyn·s).
    pub(super) fn impulse(&self, law: &Law) -> [f64; 2] {
        self.impulse.map(|part| part / law.weight)
    }

    /// The law: state and impulse at the mean velocity `v`.
    fn law(&self, v: [f64; 2], law: &Law) -> (Touch, [f64; 2]) {
        let pull = [0, 1].map(|k| (self.target[k] - v[k]) * law.stiffness);
        let mu = self.grip.friction;
        if pull[0].abs() <= mu * pull[1] {
            (Touch::Stick, pull)
        } else if pull[1] + mu * pull[0].abs() <= 0.0 {
            (Touch::Open, [0.0; 2])
        } else {
            let normal = (pull[1] + mu * pull[0].abs()) * self.grip.share;
            (if pull[0] > 0.0 { Touch::SlideForward } else { Touch::SlideBackward }, [mu * normal * pull[0].signum(), normal])
        }
    }

    /// Direction of the impulse of a sliding corner.
    fn slide(&self, touch: Touch) -> [f64; 2] {
        let [x, z] = self.grip.slide;
        [if touch == Touch::SlideForward { x } else { -x }, z]
    }

    /// a·b through the law's piece: −dλ/dw = stiffness · (0, all, or the part along the slide).
    fn product(&self, touch: Touch, a: [f64; 2], b: [f64; 2], law: &Law) -> f64 {
        let dot = |u: [f64; 2], v: [f64; 2]| u[0] * v[0] + u[1] * v[1];
        law.stiffness
            * match touch {
                Touch::Open => 0.0,
                Touch::Stick => dot(a, b),
                Touch::SlideForward | Touch::SlideBackward => {
                    let d = self.slide(touch);
                    dot(a, d) * dot(b, d)
                }
            }
    }

    /// Adds the corner's terms to its body's inertia and force.
    #[inline(always)]
    pub(super) fn add_to(&self, body: &mut Articulated, law: &Law) {
        let k = law.stiffness;
        let [ax, az] = self.arm;
        let [tx, tz] = self.target;
        let Articulated { inertia, force } = body;
        match self.touch {
            Touch::Open => {}
            Touch::Stick => {
                inertia[0] += k * (ax * ax + az * az);
                inertia[1] -= k * az;
                inertia[2] += k * ax;
                inertia[3] += k;
                inertia[5] += k;
                force[0] += k * (ax * tz - az * tx);
                force[1] += k * tx;
                force[2] += k * tz;
            }
            Touch::SlideForward | Touch::SlideBackward => {
                let [dx, dz] = self.slide(self.touch);
                // Velocity of the corner along d is row · (ω, v).
                let row = [dz * ax - dx * az, dx, dz];
                let stiff = row.map(|part| k * part);
                let wanted = dx * tx + dz * tz;
                inertia[0] += stiff[0] * row[0];
                inertia[1] += stiff[0] * row[1];
                inertia[2] += stiff[0] * row[2];
                inertia[3] += stiff[1] * row[1];
                inertia[4] += stiff[1] * row[2];
                inertia[5] += stiff[2] * row[2];
                for i in 0..3 {
                    force[i] += stiff[i] * wanted;
                }
            }
        }
    }

    fn velocity_in(&self, mean: &Spatial) -> [f64; 2] {
        [mean[1] - mean[0] * self.arm[1], mean[2] + mean[0] * self.arm[0]]
    }

    /// Whether the body's motion `mean` asks for the state that it was solved with; the impulse belongs to it then.
    pub(super) fn agrees(&mut self, mean: &Spatial, law: &Law) -> bool {
        let (touch, impulse) = self.law(self.velocity_in(mean), law);
        self.impulse = impulse;
        touch == self.touch
    }

    /// Takes the body's motion `mean` as iterate.
    pub(super) fn accept(&mut self, mean: &Spatial, law: &Law) {
        self.velocity = self.velocity_in(mean);
        (self.touch, self.impulse) = self.law(self.velocity, law);
    }

    /// Prepares a search from the iterate to `mean`; returns impulse·step at the iterate as the piece extends it to the end.
    pub(super) fn aim(&mut self, mean: &Spatial, law: &Law) -> f64 {
        let to = self.velocity_in(mean);
        self.step = [0, 1].map(|k| to[k] - self.velocity[k]);
        self.product(self.touch, [0, 1].map(|k| self.target[k] - to[k]), self.step, law)
    }

    /// impulse·step and its slope at the share `t` of the search.
    pub(super) fn search(&self, t: f64, law: &Law) -> (f64, f64) {
        let v = [0, 1].map(|k| self.velocity[k] + t * self.step[k]);
        let (touch, impulse) = self.law(v, law);
        (impulse[0] * self.step[0] + impulse[1] * self.step[1], -self.product(touch, self.step, self.step, law))
    }

    /// Goes the share `t` of the search.
    pub(super) fn go(&mut self, t: f64, law: &Law) {
        self.velocity = [0, 1].map(|k| self.velocity[k] + t * self.step[k]);
        (self.touch, self.impulse) = self.law(self.velocity, law);
    }

    /// The state as a number for storing.
    pub(super) fn saved(&self) -> f64 {
        f64::from(self.touch as u8)
    }

    pub(super) fn restore(&mut self, saved: f64) {
        self.impulse = [0.0; 2];
        self.touch = match saved as u8 {
            1 => Touch::Stick,
            2 => Touch::SlideForward,
            3 => Touch::SlideBackward,
            _ => Touch::Open,
        };
    }
}
