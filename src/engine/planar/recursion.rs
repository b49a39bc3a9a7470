//! The articulated-body recursion in the plane, two arms at a time.
//!
//! The chain hangs on its root: the first body if it is clamped, the one in the middle otherwise. The bodies at the same distance from the
//! root stand on one [`Rung`], the left arm's in lane 0 and the right arm's in lane 1, and both arms are walked in the same instructions. The
//! root has rung 0, lane 0. Where an arm is shorter its lane holds a body without mass, which changes nothing.
//!
//! A spatial vector is (turn, x, z): of a motion (ω, v) of a body's reference point, of a force (moment about it, f). Turns count
//! anticlockwise. A body's reference point is its end towards the root; the root's is its left end.

use wide::f64x2;

use super::contact::Law;
use super::floor::Inwards;

/// Turn, x, z.
type Spatial = [f64; 3];
/// The same of two bodies.
pub(super) type Spatials = [f64x2; 3];

/// The largest turn (rad) for which the series in [`turned`] are exact to the last digit: the first term left out is 6·10⁻¹⁷ of the turn.
const LARGEST_SERIES: f64 = 0.03;

/// Two bodies: what stays, their state, and what the step at hand needs.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Rung {
    pub(super) mass: f64x2,
    /// Share of the robot's mass.
    pub(super) share: f64x2,
    /// How far the centre of mass of the robot, seen from the root, lies along the links (cm): it is the sum of lever · along.
    pub(super) lever: f64x2,
    /// About the centre of mass and about the reference point (g·cm²).
    pub(super) inertia: f64x2,
    pub(super) inertia_at_reference: f64x2,
    /// From the reference point to the other end (cm), negative on the left arm.
    pub(super) reach: f64x2,
    /// Of the joint at the reference point (dyn·cm/rad); none where there is no body.
    pub(super) stiffness: f64x2,
    /// What spring and damper of the joint at the reference point add to that joint's inertia.
    pub(super) implicit: f64x2,
    /// Where the centre of mass lies between the reference point (0) and the other end (1).
    pub(super) middle: f64x2,
    /// Angle above the x axis (rad), counted anticlockwise.
    pub(super) angle: f64x2,
    /// Rate (rad/s) and velocity of the centre of mass (cm/s).
    pub(super) motion: Spatials,
    /// Voltage on the joint as seen from the root: negative on the right arm (V).
    pub(super) volts: f64x2,
    /// Angle at which the joint's spring is at rest, body towards the root to this one (rad).
    pub(super) rest_angle: f64x2,
    /// The angle that `along`, the direction from left end to right one, is of, and the other end less the reference point (cm).
    pub(super) posed: f64x2,
    pub(super) along: [f64x2; 2],
    pub(super) across: [f64x2; 2],
    /// The centres of mass less the reference points (cm).
    half: [f64x2; 2],
    /// Momentum about the reference point that the mean motion is to have, and the joint's part of it.
    pub(super) momentum: Spatials,
    pub(super) torque: f64x2,
    /// Of the walk to the root: the mean rate is `own` + `carried` · (turn, −x, −z) of the inner body at the reference point.
    carried: Spatials,
    own: f64x2,
    /// Mean motion of the reference point over the step.
    pub(super) mean: Spatials,
}

impl Rung {
    /// Bodies without mass, whose joints do nothing.
    pub(super) fn empty() -> Self {
        Self { implicit: f64x2::ONE, middle: f64x2::HALF, along: [f64x2::ONE, f64x2::ZERO], ..Self::default() }
    }

    /// Puts the links where `along` says that they point.
    #[inline(always)]
    pub(super) fn lay(&mut self) {
        self.across = self.along.map(|along| self.reach * along);
        self.half = self.across.map(|part| part * self.middle);
    }

    /// Turns the links to the angles `to` (rad), on from where they were by the series of sine and cosine, which is several times faster than
    /// computing both anew, unless they shall be `exact` or turn far.
    #[inline(always)]
    pub(super) fn turn_to(&mut self, to: f64x2, exact: bool) {
        let by = to - self.posed;
        self.posed = to;
        let far = by.abs().simd_gt(f64x2::splat(LARGEST_SERIES)).any();
        self.along = if far || exact { direction(to) } else { turned(self.along, by) };
        self.lay();
    }

    /// Sets the joints' parts of the step's right side, −`share` (s) of their torques at the angles as they are, with the bodies towards the
    /// root at `inner` (rad). The implicit part adds what the mean rate makes.
    #[inline(always)]
    pub(super) fn load_torque(&mut self, share: f64x2, inner: f64x2) {
        self.torque = share * self.stiffness * (self.angle - inner - self.rest_angle);
    }

    /// Mean motion of the centres of mass.
    #[inline(always)]
    pub(super) fn mean_of_centre(&self) -> Spatials {
        self.of_centre(self.mean)
    }

    /// The motion of the centres of mass where that of the reference points is `motion`.
    #[inline(always)]
    pub(super) fn of_centre(&self, motion: Spatials) -> Spatials {
        let [turn, x, z] = motion;
        let half = self.half;
        [turn, x - turn * half[1], z + turn * half[0]]
    }

    /// Puts the momentum `about_centre` about the reference point.
    #[inline(always)]
    pub(super) fn load(&mut self, about_centre: Spatials) {
        let [turn, x, z] = about_centre;
        let half = self.half;
        self.momentum = [turn + half[0] * z - half[1] * x, x, z];
    }
}

/// Directions of two angles.
pub(super) fn direction(angle: f64x2) -> [f64x2; 2] {
    let angle = angle.to_array();
    [f64x2::new(angle.map(f64::cos)), f64x2::new(angle.map(f64::sin))]
}

/// Two directions turned by small angles (rad): with t the tangent of half an angle, sin = 2 t/(1 + t²) and cos = 1 − t sin.
#[inline(always)]
fn turned([x, z]: [f64x2; 2], by: f64x2) -> [f64x2; 2] {
    let c = f64x2::splat;
    let s = by * by;
    let t = by * (c(0.5) + s * (c(1.0 / 24.0) + s * (c(1.0 / 240.0) + s * c(17.0 / 40320.0))));
    let sin = (t + t) / (c(1.0) + t * t);
    [x - sin * (z + t * x), z + sin * (x - t * z)]
}

/// Inertia (00, 01, 02, 11, 12, 22) and force at a point of both arms.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Arms {
    pub(super) inertia: [f64x2; 6],
    pub(super) force: Spatials,
}

/// The same of one body.
#[derive(Debug, Clone, Copy, Default)]
struct Articulated {
    inertia: [f64; 6],
    force: Spatial,
}

impl Arms {
    /// Moves from a rung's other ends to its reference points and adds the rung itself.
    ///
    /// What comes in is added last: a rung waits for the one before as short as can be.
    #[inline(always)]
    fn take(&mut self, rung: &Rung) {
        let Self { inertia, force } = self;
        let [wx, wz] = [-rung.across[1], rung.across[0]];
        let [i00, i01, i02, i11, i12, i22] = *inertia;
        let (two_x, two_z) = (wx + wx, wz + wz);
        let [mx, mz] = rung.half.map(|half| rung.mass * half);
        let squares = (wx * wx) * i11 + (wz * wz) * i22;
        let rest = (i00 + rung.inertia_at_reference) + (two_x * wz) * i12;
        inertia[0] = (squares + rest) + (two_x * i01 + two_z * i02);
        inertia[1] = (i01 - mz) + (wx * i11 + wz * i12);
        inertia[2] = (i02 + mx) + (wx * i12 + wz * i22);
        inertia[3] += rung.mass;
        inertia[5] += rung.mass;
        force[0] = (force[0] + rung.momentum[0]) + (wx * force[1] + wz * force[2]);
        force[1] += rung.momentum[1];
        force[2] += rung.momentum[2];
    }

    /// Adds what corners do to the bodies of a rung.
    #[inline(always)]
    fn touch(&mut self, by: &Self) {
        (0..6).for_each(|k| self.inertia[k] += by.inertia[k]);
        (0..3).for_each(|k| self.force[k] += by.force[k]);
    }

    /// What of it is felt through the joints at the rung's reference points.
    ///
    /// With D = I₀₀ + implicit, 1 − I₀₀/D is implicit/D: nothing is lost where a joint is soft.
    #[inline(always)]
    fn through_joints(&mut self, rung: &mut Rung) {
        let Self { inertia, force } = self;
        let c = [inertia[0], inertia[1], inertia[2]];
        let inverse = f64x2::ONE / (c[0] + rung.implicit);
        rung.carried = [rung.implicit * inverse, c[1] * inverse, c[2] * inverse];
        rung.own = (rung.torque + force[0]) * inverse;
        for k in 0..3 {
            force[k] -= c[k] * rung.own;
            inertia[k] = c[k] * rung.carried[0];
        }
        // These are waited for most: their products do not wait for the division.
        inertia[3] -= (c[1] * c[1]) * inverse;
        inertia[4] -= (c[1] * c[2]) * inverse;
        inertia[5] -= (c[2] * c[2]) * inverse;
    }

    /// The whole chain at the root's reference point: the right arm hangs on the root's other end, the left arm on the point itself.
    fn at_root(&self, root: &Rung) -> Articulated {
        let lane = |value: f64x2, lane: usize| value.as_array()[lane];
        let mut right = *self;
        right.inertia.iter_mut().chain(&mut right.force).for_each(|value| *value = f64x2::splat(lane(*value, 1)));
        right.take(root);
        let both = |left: f64x2, right: f64x2| lane(left, 0) + lane(right, 0);
        Articulated {
            inertia: std::array::from_fn(|k| both(self.inertia[k], right.inertia[k])),
            force: std::array::from_fn(|k| both(self.force[k], right.force[k])),
        }
    }
}

impl Articulated {
    /// The motion x of a free body: inertia · x = force. Translation is eliminated first, for a long chain's turn is badly conditioned;
    /// without fractions, so that no division waits for another.
    fn motion(&self) -> Spatial {
        let [i00, i01, i02, i11, i12, i22] = self.inertia;
        let [turn, x, z] = self.force;
        let (a, b, c) = (i00 * i22 - i02 * i02, i01 * i22 - i12 * i02, i11 * i22 - i12 * i12);
        let (turn, x) = (turn * i22 - i02 * z, x * i22 - i12 * z);
        let spin = (turn * c - b * x) / (a * c - b * b);
        let along = x * (1.0 / c) - spin * (b / c);
        let fall = 1.0 / i22;
        [spin, along, z * fall - spin * (i02 * fall) - along * (i12 * fall)]
    }
}

/// What the root hangs on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Hold {
    /// Nothing.
    Free,
    /// The world.
    Clamped,
    /// A hinge at its reference point, with the rung's own torque and implicit terms.
    Hinged,
}

/// Mean motions u of the whole chain: (Σ Jᵀ M J + implicit + contact) u = Σ Jᵀ p + torques. Corners touch the `floor` as
/// their states say.
pub(super) fn solve(rungs: &mut [Rung], hold: Hold, mut floor: Inwards, law: &Law) {
    let Some((root, arms)) = rungs.split_first_mut() else { return };
    let mut chain = Arms::default();
    let mut k = arms.len();
    for rung in arms.iter_mut().rev() {
        chain.take(rung);
        if let Some(by) = floor.take(k, law) {
            chain.touch(&by);
        }
        k -= 1;
        chain.through_joints(rung);
    }
    let motion = if hold == Hold::Clamped {
        [0.0; 3]
    } else if hold == Hold::Hinged {
        let whole = chain.at_root(root);
        let [torque, implicit] = [root.torque, root.implicit].map(|value| value.to_array()[0]);
        [(whole.force[0] + torque) / (whole.inertia[0] + implicit), 0.0, 0.0]
    } else {
        let mut whole = chain.at_root(root);
        if let Some(by) = floor.take(0, law) {
            (0..6).for_each(|k| whole.inertia[k] += by.inertia[k].to_array()[0]);
            (0..3).for_each(|k| whole.force[k] += by.force[k].to_array()[0]);
        }
        whole.motion()
    };
    let [mut turn, mut x, mut z] = motion.map(f64x2::splat);
    root.mean = [turn, x, z];
    // Lane 0 goes on from the root's reference point, lane 1 from its other end.
    let mut across = root.across.map(|part| f64x2::new([0.0, part.to_array()[0]]));
    for rung in arms {
        let [a, b, c] = rung.carried;
        let carried = a + (b * across[1] - c * across[0]);
        let on = carried * turn + (rung.own - (b * x + c * z));
        (x, z) = (x - turn * across[1], z + turn * across[0]);
        turn = on;
        rung.mean = [turn, x, z];
        across = rung.across;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn turning_by_the_half_angle_is_exact_to_the_last_digits() {
        for k in -1000..=1000 {
            let (by, from) = (LARGEST_SERIES * f64::from(k) / 1000.0, 0.7 * f64::from(k));
            let found = turned(direction(f64x2::splat(from)), f64x2::splat(by)).map(|part| part.to_array()[0]);
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
        let mut along = direction(f64x2::ZERO);
        for _ in 0..super::super::EXACT_EVERY {
            along = turned(along, f64x2::splat(by));
        }
        let [x, z] = along.map(|part| part.to_array()[0]);
        let exact = super::super::EXACT_EVERY as f64 * by;
        let lost = x * exact.sin() - z * exact.cos();
        // Seen: 1.0e-15 rad, and a length of 1 within 4.4e-16.
        assert!(lost.abs() < 1e-14 && (x.hypot(z) - 1.0).abs() < 1e-14, "{lost} {}", x.hypot(z) - 1.0);
    }
}
