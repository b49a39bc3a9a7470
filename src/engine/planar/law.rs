//! The law of contact as all corners share it in a step: friction model, step, look-ahead and compliance.

use wide::f64x2;

use super::lanes::fma;

/// The law of friction.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum FrictionModel {
    /// Coulomb's law, solved to rounding in every step.
    #[default]
    Coulomb,
    /// Anitescu's convex relaxation. Sliding lifts a corner by μ·h·|v_t|, so that results over films of friction 2 to 4 are 10 % and more off
    /// at steps of 10⁻⁴ s, and may need 10⁻⁶ s.
    Convex,
}

/// Compliance of contact in units of a body's inverse mass, for impacts and for steps of `STEP_OF_SOFTNESS` (s); otherwise in inverse proportion to the step,
/// so that a corner gives way by the same speed at any step: 3·10⁻⁸ cm/s under half a body's weight. It decides on which of many corners a robot rests
/// (docs/validation.md).
const SOFTNESS: f64 = 6e-7;
const STEP_OF_SOFTNESS: f64 = 1e-4;
/// Steps up to this length (s) count as an instant: an impact, or the rest of a step beside one.
const INSTANT: f64 = 2e-8;
/// Largest change of a corner's vertical velocity in a step (cm/s) for which contact candidates are found: more than the robots fall with.
const LARGEST_CHANGE: f64 = 150.0;
/// Share of a penetration that is pushed out per step.
const PUSH_OUT: f64 = 0.1;
/// Landings slower than this fraction of [`ContactLaw::landing_speed`] never cut a step.
const SLOW: f64 = 0.01;
/// Largest push-out rate (1/s), where steps differ in length.
const FASTEST_PUSH_OUT: f64 = 1e3;

/// Look-ahead (s): how long after a step no corner may pass the floor.
#[derive(Debug, Clone, Copy)]
pub(super) struct Ahead {
    /// For corners slower than [`ContactLaw::landing_speed`].
    pub(super) slow: f64,
    /// For faster corners.
    pub(super) fast: f64,
    /// For faster corners that land within [`ContactLaw::at_once`].
    pub(super) landing: f64,
}

impl Ahead {
    /// One look-ahead for all.
    pub(super) fn all(ahead: f64) -> Self {
        Self { slow: ahead, fast: ahead, landing: ahead }
    }
}

/// The law of contact in a step.
#[derive(Debug, Clone, Copy)]
pub(super) struct ContactLaw {
    time_step: f64,
    /// Steps per second.
    per_step: f64,
    /// One over [`Ahead::slow`], counted from the middle of the step (1/s).
    per_ahead: f64,
    /// One over [`Ahead::fast`], counted from the middle of the step (1/s).
    per_ahead_fast: f64,
    /// One over [`Ahead::landing`], counted from the middle of the step (1/s).
    per_ahead_landing: f64,
    /// Fraction of a penetration that is pushed out per second.
    pub(super) push_out: f64,
    /// Corners that come down faster (cm/s) cut the step at their landing.
    pub(super) landing_speed: f64,
    /// Fast corners that land within this time (s) of an impact are stopped with it.
    pub(super) at_once: f64,
    /// Weight of the step's end in the mean motion.
    pub(super) weight: f64,
    /// 1/R (g).
    pub(super) stiffness: f64,
    stiffness_of_impacts: f64,
    /// True if the step is an instant.
    pub(super) is_instant: bool,
    pub(super) frictionless: bool,
    pub(super) friction: FrictionModel,
}

impl ContactLaw {
    /// Step (s), and the largest gap (cm) that a corner at rest may close in it.
    pub(super) fn reach(&self) -> (f64, f64) {
        (self.time_step, LARGEST_CHANGE * self.time_step)
    }

    /// Steps per second.
    pub(super) fn per_step(&self) -> f64 {
        self.per_step
    }

    /// Sets the length (s), the end's weight and the look-ahead of the coming steps.
    pub(super) fn set_time_step(&mut self, time_step: f64, weight: f64, ahead: Ahead) {
        (self.time_step, self.per_step, self.weight) = (time_step, 1.0 / time_step, weight);
        let Ahead { slow, fast, landing } = ahead;
        [self.per_ahead, self.per_ahead_fast, self.per_ahead_landing] =
            [slow, fast, landing].map(|ahead| 1.0 / (0.5 * time_step + ahead));
        self.push_out = (PUSH_OUT / time_step).min(FASTEST_PUSH_OUT);
        self.is_instant = fast == 0.0 || time_step <= INSTANT;
        self.stiffness = self.stiffness_of_impacts * if self.is_instant { 1.0 } else { time_step / STEP_OF_SOFTNESS };
    }

    /// Mask of open corners, with these gaps in the step's middle (cm) and velocities along z (cm/s), that cut the step at their landing: fast ones, and others
    /// that would be below the floor before the look-ahead stops them.
    #[inline(always)]
    pub(super) fn cuts(&self, gap: f64x2, velocity: f64x2) -> f64x2 {
        let fast = velocity.simd_lt(f64x2::splat(-self.landing_speed));
        fast | (velocity.simd_lt(f64x2::splat(-SLOW * self.landing_speed)) & gap.simd_lt(f64x2::ZERO))
    }

    /// One over the look-ahead (1/s) of corners, by gap (cm) and velocity along z (cm/s).
    #[inline(always)]
    pub(super) fn per_ahead(&self, gap: f64x2, velocity: f64x2) -> f64x2 {
        let fast = velocity.simd_lt(f64x2::splat(-self.landing_speed));
        if !fast.any() {
            return f64x2::splat(self.per_ahead);
        }
        let lands = fma(velocity, f64x2::splat(self.at_once), gap).simd_lt(f64x2::ZERO);
        let of_fast = lands.select(f64x2::splat(self.per_ahead_landing), f64x2::splat(self.per_ahead_fast));
        fast.select(of_fast, f64x2::splat(self.per_ahead))
    }

    /// Makes contact a hundred times more compliant.
    pub(super) fn soften(&mut self) {
        self.stiffness *= 0.01;
    }

    pub(super) fn new(time_step: f64, weight: f64, body_mass: f64, friction: FrictionModel) -> Self {
        Self {
            time_step,
            per_step: 1.0 / time_step,
            per_ahead: 1.0 / time_step,
            per_ahead_fast: 1.0 / time_step,
            per_ahead_landing: 1.0 / time_step,
            push_out: PUSH_OUT / time_step,
            landing_speed: f64::INFINITY,
            at_once: 0.0,
            weight,
            stiffness: body_mass / SOFTNESS,
            stiffness_of_impacts: body_mass / SOFTNESS,
            is_instant: false,
            frictionless: false,
            friction,
        }
    }

    /// A frictionless floor for displacements, as statics needs it.
    pub(super) fn statics(stiffness: f64) -> Self {
        let friction = FrictionModel::Convex;
        Self {
            time_step: 1.0,
            per_step: 1.0,
            per_ahead: 1.0,
            per_ahead_fast: 1.0,
            per_ahead_landing: 1.0,
            push_out: 0.0,
            landing_speed: f64::INFINITY,
            at_once: 0.0,
            weight: 1.0,
            stiffness,
            stiffness_of_impacts: stiffness,
            is_instant: false,
            frictionless: true,
            friction,
        }
    }
}
