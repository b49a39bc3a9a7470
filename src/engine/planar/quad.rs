//! Four bodies of the chain in lanes, and the spatial vectors that they are described by.
//!
//! The chain hangs on its root: the first body if it is clamped, the one in the middle otherwise. A body's tree level is its distance from the root. The two
//! bodies of a level stand side by side, the left arm's in lane 0 and the right arm's in lane 1; the root has level 0, lane 0. Two levels make a [`Quad`].
//! Where an arm is shorter, and in the last quad if the number of levels is odd, lanes are padding: bodies without mass, which change nothing.
//!
//! A spatial vector is (turn, x, z): of a motion (ω, v) of a body's reference point, of a force (moment about it, f). Turns count
//! anticlockwise. A body's reference point is its end towards the root; the root's is its left end.

use fearless_simd::{Simd, prelude::*};
use wide::f64x2;

use super::lanes::{Four, Lanes, fma, on};

/// A spatial vector (turn, x, z).
pub(super) type Spatial = [f64; 3];
/// Those of two bodies.
pub(super) type Spatials = [f64x2; 3];
/// Those of four bodies, in registers.
pub(super) type Motions<S> = [Four<S>; 3];

/// Largest turn (rad) for which the series in [`turned`] are exact to rounding: the first term left out is 6·10⁻¹⁷ of the turn.
const LARGEST_SERIES: f64 = 0.03;

/// Four bodies: constants, state, and quantities of the current step.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Quad {
    pub(super) mass: Lanes,
    /// Fraction of the robot's mass.
    pub(super) share: Lanes,
    /// Lever (cm): from the root's reference point to the robot's centre of mass is the sum of lever · along over all bodies.
    pub(super) lever: Lanes,
    /// Moment of inertia about the centre of mass and about the reference point (g·cm²).
    pub(super) inertia: Lanes,
    pub(super) inertia_at_reference: Lanes,
    /// From the reference point to the far end (cm), negative on the left arm.
    pub(super) reach: Lanes,
    /// Stiffness of the joint at the reference point (dyn·cm/rad); zero in padding lanes.
    pub(super) stiffness: Lanes,
    /// What spring and damper of the joint at the reference point add to its articulated inertia.
    pub(super) implicit: Lanes,
    /// Position of the centre of mass between the reference point (0) and the far end (1).
    pub(super) middle: Lanes,
    /// Angle above the x axis (rad), counted anticlockwise.
    pub(super) angle: Lanes,
    /// Rate (rad/s) and velocity of the centre of mass (cm/s).
    pub(super) motion: [Lanes; 3],
    /// Voltage on the joint (V), in the sense of rotation from the root outwards: negative on the right arm.
    pub(super) volts: Lanes,
    /// Rest angle of the joint's spring (rad), from the proximal body to this one.
    pub(super) rest_angle: Lanes,
    /// Angle at which the directions are taken (rad), the unit vector from left to right end, and the vector from reference point to far end (cm).
    pub(super) posed: Lanes,
    pub(super) along: [Lanes; 2],
    pub(super) across: [Lanes; 2],
    /// Vector from the reference point to the centre of mass (cm).
    pub(super) half: [Lanes; 2],
    /// Right side of the step about the reference point: momentum, and the joint's angular impulse.
    pub(super) momentum: [Lanes; 3],
    pub(super) torque: Lanes,
    /// Result of the tip-to-base pass: the mean rate is `own` + `carried` · (turn, −x, −z) of the proximal body at the reference point.
    pub(super) carried: [Lanes; 3],
    pub(super) own: Lanes,
    /// D: articulated inertia about the joint's axis plus the implicit part. Unused for the root.
    pub(super) pivot: Lanes,
    /// Mean motion of the reference point over the step.
    pub(super) mean: [Lanes; 3],
}

impl Quad {
    /// Padding.
    pub(super) fn empty() -> Self {
        let one = Lanes::splat(1.0);
        Self { implicit: one, middle: Lanes::splat(0.5), along: [one, Lanes::ZERO], ..Self::default() }
    }

    /// Sets the links' vectors from their directions.
    #[inline(always)]
    pub(super) fn lay<S: Simd>(&mut self, simd: S) {
        let (reach, middle) = (self.reach.on(simd), self.middle.on(simd));
        for (k, along) in self.along.iter().enumerate() {
            let across = reach * along.on(simd);
            (self.across[k], self.half[k]) = (across.into(), (across * middle).into());
        }
    }

    /// Turns the links to the angles `to` (rad): by series of sine and cosine of the turn, which is several times faster than computing both anew, unless
    /// `exact` or the turn is large.
    #[inline(always)]
    pub(super) fn turn_to<S: Simd>(&mut self, to: Four<S>, exact: bool) {
        let simd = to.simd;
        let by = to - self.posed.on(simd);
        self.posed = to.into();
        let far = by.abs().simd_gt(LARGEST_SERIES).any_true();
        if far || exact {
            self.along = direction(self.posed);
        } else {
            let [x, z] = turned(on(simd, &self.along), by);
            self.along = [x.into(), z.into()];
        }
        self.lay(simd);
    }

    /// Directions at the present angles; nothing is changed.
    #[inline(always)]
    pub(super) fn along_now<S: Simd>(&self, simd: S) -> [Four<S>; 2] {
        let by = self.angle.on(simd) - self.posed.on(simd);
        if by.abs().simd_gt(LARGEST_SERIES).any_true() {
            on(simd, &direction(self.angle))
        } else {
            turned(on(simd, &self.along), by)
        }
    }

    /// Sets the joints' part of the step's right side, −`share` (s) times their torques at the present angles, with the proximal bodies at `inner` (rad).
    /// The implicit part adds the effect of the mean rate.
    #[inline(always)]
    pub(super) fn load_torque<S: Simd>(&mut self, share: f64, inner: Four<S>) {
        let simd = inner.simd;
        self.torque = (self.stiffness.on(simd) * share * (self.angle.on(simd) - inner - self.rest_angle.on(simd))).into();
    }

    /// Mean motion of the centres of mass.
    #[inline(always)]
    pub(super) fn mean_of_centre<S: Simd>(&self, simd: S) -> Motions<S> {
        self.of_centre(on(simd, &self.mean))
    }

    /// What these bodies add to dᵀAd, with the search direction `d` and the matrix A of the newest solution: for each joint D times the square of its own
    /// turn, for the recursion factorises A. `inner` are the rates of the proximal bodies.
    #[inline(always)]
    pub(super) fn metric<S: Simd>(&self, d: Motions<S>, inner: Four<S>) -> Four<S> {
        let [turn, x, z] = d;
        let [a, b, c] = on(inner.simd, &self.carried);
        let own = fma(-a, inner, turn) + fma(b, x, c * z);
        self.pivot.on(inner.simd) * own * own
    }

    /// Motion of the centres of mass, from that of the reference points.
    #[inline(always)]
    pub(super) fn of_centre<S: Simd>(&self, motion: Motions<S>) -> Motions<S> {
        let [turn, x, z] = motion;
        let [half_x, half_z] = on(turn.simd, &self.half);
        [turn, fma(-turn, half_z, x), fma(turn, half_x, z)]
    }

    /// Sets the momentum about the reference point from that about the centre of mass.
    #[inline(always)]
    pub(super) fn load<S: Simd>(&mut self, about_centre: Motions<S>) {
        let [turn, x, z] = about_centre;
        let [half_x, half_z] = on(turn.simd, &self.half);
        self.momentum = [fma(half_x, z, fma(-half_z, x, turn)).into(), x.into(), z.into()];
    }
}

/// Unit vectors at angles (rad).
pub(super) fn direction(angle: Lanes) -> [Lanes; 2] {
    [angle.map(f64::cos), angle.map(f64::sin)]
}

/// Unit vectors turned by small angles (rad): with t = tan(angle/2), sin = 2 t/(1 + t²) and cos = 1 − t sin.
#[inline(always)]
fn turned<S: Simd>([x, z]: [Four<S>; 2], by: Four<S>) -> [Four<S>; 2] {
    let c = |value: f64| Four::splat(by.simd, value);
    let s = by * by;
    let t = by * fma(s, fma(s, fma(s, c(17.0 / 40320.0), c(1.0 / 240.0)), c(1.0 / 24.0)), c(0.5));
    let sin = (t + t) / fma(t, t, c(1.0));
    [fma(-sin, fma(t, x, z), x), fma(sin, fma(-t, z, x), z)]
}

/// Articulated inertia (00, 01, 02, 11, 12, 22) and bias force of both arms at a point. `lower` are the entries 10, 20, 21, which differ from the upper ones
/// where corners slide by Coulomb's law; they are zero and not read where none does.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Arms {
    pub(super) inertia: [f64x2; 6],
    pub(super) lower: [f64x2; 3],
    pub(super) force: Spatials,
}

#[cfg(test)]
mod tests {
    use fearless_simd::{Level, dispatch};

    use super::*;

    fn turned_by(along: [Lanes; 2], by: f64) -> [Lanes; 2] {
        dispatch!(Level::new(), simd => turned(on(simd, &along), Four::splat(simd, by)).map(Lanes::from))
    }

    #[test]
    fn turning_by_the_half_angle_is_exact_to_the_last_digits() {
        for k in -1000..=1000 {
            let (by, from) = (LARGEST_SERIES * f64::from(k) / 1000.0, 0.7 * f64::from(k));
            let found = turned_by(direction(Lanes::splat(from)), by).map(|part| part.lane(3));
            let exact = [(from + by).cos(), (from + by).sin()];
            // The sum of the angles is rounded too: half a last digit of 700 is 6e-14.
            let allowed = 4.0 * f64::EPSILON + f64::EPSILON * from.abs();
            assert!((0..2).all(|i| (found[i] - exact[i]).abs() <= allowed), "{from} {by} {found:?} {exact:?}");
            // The length stays one, whatever the angles.
            let length = found[0].hypot(found[1]);
            assert!((length - 1.0).abs() <= 3.0 * f64::EPSILON, "{from} {by} {length}");
        }
    }

    #[test]
    fn turning_on_loses_next_to_nothing_before_directions_are_made_anew() {
        let by = 0.9 * LARGEST_SERIES;
        let mut along = direction(Lanes::ZERO);
        for _ in 0..super::super::step::EXACT_EVERY {
            along = turned_by(along, by);
        }
        let [x, z] = along.map(|part| part.lane(0));
        let exact = super::super::step::EXACT_EVERY as f64 * by;
        let lost = x * exact.sin() - z * exact.cos();
        // Seen: 1.0e-15 rad, and a length of 1 within 4.4e-16.
        assert!(lost.abs() < 1e-14 && (x.hypot(z) - 1.0).abs() < 1e-14, "{lost} {}", x.hypot(z) - 1.0);
    }
}
