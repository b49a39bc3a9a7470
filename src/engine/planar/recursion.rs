//! The articulated-body recursion in the plane, two arms at a time.
//!
//! The chain hangs on its root: the first body if it is clamped, the one in the middle otherwise. The bodies at the same distance from the
//! root stand on one level, the left arm's in lane 0 and the right arm's in lane 1, and both arms are walked in the same instructions. The
//! root has level 0, lane 0. Where an arm is shorter its lane holds a body without mass, which changes nothing. Two levels make a [`Quad`], for
//! what is done to each body for itself; if their number is odd, the last has bodies without mass.
//!
//! A spatial vector is (turn, x, z): of a motion (ω, v) of a body's reference point, of a force (moment about it, f). Turns count
//! anticlockwise. A body's reference point is its end towards the root; the root's is its left end.

use std::ops::Range;

use fearless_simd::{Simd, prelude::*};
use wide::f64x2;

use super::contact::Law;
use super::floor::Inwards;
use super::lanes::{Four, Lanes, fma, on, pair};

/// Turn, x, z.
type Spatial = [f64; 3];
/// The same of two bodies.
pub(super) type Spatials = [f64x2; 3];
/// The same of four.
pub(super) type Motions<S> = [Four<S>; 3];

/// The largest turn (rad) for which the series in [`turned`] are exact to the last digit: the first term left out is 6·10⁻¹⁷ of the turn.
const LARGEST_SERIES: f64 = 0.03;

/// Four bodies: what stays, their state, and what the step at hand needs.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Quad {
    pub(super) mass: Lanes,
    /// Share of the robot's mass.
    pub(super) share: Lanes,
    /// How far the centre of mass of the robot, seen from the root, lies along the links (cm): it is the sum of lever · along.
    pub(super) lever: Lanes,
    /// About the centre of mass and about the reference point (g·cm²).
    pub(super) inertia: Lanes,
    pub(super) inertia_at_reference: Lanes,
    /// From the reference point to the other end (cm), negative on the left arm.
    pub(super) reach: Lanes,
    /// Of the joint at the reference point (dyn·cm/rad); none where there is no body.
    pub(super) stiffness: Lanes,
    /// What spring and damper of the joint at the reference point add to that joint's inertia.
    pub(super) implicit: Lanes,
    /// Where the centre of mass lies between the reference point (0) and the other end (1).
    pub(super) middle: Lanes,
    /// Angle above the x axis (rad), counted anticlockwise.
    pub(super) angle: Lanes,
    /// Rate (rad/s) and velocity of the centre of mass (cm/s).
    pub(super) motion: [Lanes; 3],
    /// Voltage on the joint as seen from the root: negative on the right arm (V).
    pub(super) volts: Lanes,
    /// Angle at which the joint's spring is at rest, body towards the root to this one (rad).
    pub(super) rest_angle: Lanes,
    /// The angle that `along`, the direction from left end to right one, is of, and the other end less the reference point (cm).
    pub(super) posed: Lanes,
    pub(super) along: [Lanes; 2],
    pub(super) across: [Lanes; 2],
    /// The centres of mass less the reference points (cm).
    half: [Lanes; 2],
    /// Momentum about the reference point that the mean motion is to have, and the joint's part of it.
    pub(super) momentum: [Lanes; 3],
    pub(super) torque: Lanes,
    /// Of the walk to the root: the mean rate is `own` + `carried` · (turn, −x, −z) of the inner body at the reference point.
    carried: [Lanes; 3],
    own: Lanes,
    /// What the joint's rate is accelerated by: its articulated inertia and the implicit part. None for the root.
    pivot: Lanes,
    /// Mean motion of the reference point over the step.
    pub(super) mean: [Lanes; 3],
}

impl Quad {
    /// Bodies without mass, whose joints do nothing.
    pub(super) fn empty() -> Self {
        let one = Lanes::splat(1.0);
        Self { implicit: one, middle: Lanes::splat(0.5), along: [one, Lanes::ZERO], ..Self::default() }
    }

    /// Puts the links where `along` says that they point.
    #[inline(always)]
    pub(super) fn lay<S: Simd>(&mut self, simd: S) {
        let (reach, middle) = (self.reach.on(simd), self.middle.on(simd));
        for (k, along) in self.along.iter().enumerate() {
            let across = reach * along.on(simd);
            (self.across[k], self.half[k]) = (across.into(), (across * middle).into());
        }
    }

    /// Turns the links to the angles `to` (rad), on from where they were by the series of sine and cosine, which is several times faster than
    /// computing both anew, unless they shall be `exact` or turn far.
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

    /// Where the links point at their angles of now, with what `along` is known to be of; nothing is changed.
    #[inline(always)]
    pub(super) fn along_now<S: Simd>(&self, simd: S) -> [Four<S>; 2] {
        let by = self.angle.on(simd) - self.posed.on(simd);
        if by.abs().simd_gt(LARGEST_SERIES).any_true() {
            on(simd, &direction(self.angle))
        } else {
            turned(on(simd, &self.along), by)
        }
    }

    /// Sets the joints' parts of the step's right side, −`share` (s) of their torques at the angles as they are, with the bodies towards the
    /// root at `inner` (rad). The implicit part adds what the mean rate makes.
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

    /// What the way of these bodies adds to way · matrix · way of the newest solution: by each joint, its pivot times the square of what it
    /// turns by itself, for the recursion makes the matrix diagonal. With the `inner` ones' rates.
    #[inline(always)]
    pub(super) fn metric<S: Simd>(&self, way: Motions<S>, inner: Four<S>) -> Four<S> {
        let [turn, x, z] = way;
        let [a, b, c] = on(inner.simd, &self.carried);
        let own = fma(-a, inner, turn) + fma(b, x, c * z);
        self.pivot.on(inner.simd) * own * own
    }

    /// The motion of the centres of mass where that of the reference points is `motion`.
    #[inline(always)]
    pub(super) fn of_centre<S: Simd>(&self, motion: Motions<S>) -> Motions<S> {
        let [turn, x, z] = motion;
        let [half_x, half_z] = on(turn.simd, &self.half);
        [turn, fma(-turn, half_z, x), fma(turn, half_x, z)]
    }

    /// Puts the momentum `about_centre` about the reference point.
    #[inline(always)]
    pub(super) fn load<S: Simd>(&mut self, about_centre: Motions<S>) {
        let [turn, x, z] = about_centre;
        let [half_x, half_z] = on(turn.simd, &self.half);
        self.momentum = [fma(half_x, z, fma(-half_z, x, turn)).into(), x.into(), z.into()];
    }
}

/// Directions of angles.
pub(super) fn direction(angle: Lanes) -> [Lanes; 2] {
    [angle.map(f64::cos), angle.map(f64::sin)]
}

/// Directions turned by small angles (rad): with t the tangent of half an angle, sin = 2 t/(1 + t²) and cos = 1 − t sin.
#[inline(always)]
fn turned<S: Simd>([x, z]: [Four<S>; 2], by: Four<S>) -> [Four<S>; 2] {
    let c = |value: f64| Four::splat(by.simd, value);
    let s = by * by;
    let t = by * fma(s, fma(s, fma(s, c(17.0 / 40320.0), c(1.0 / 240.0)), c(1.0 / 24.0)), c(0.5));
    let sin = (t + t) / fma(t, t, c(1.0));
    [fma(-sin, fma(t, x, z), x), fma(sin, fma(-t, z, x), z)]
}

/// Inertia (00, 01, 02, 11, 12, 22) and force at a point of both arms; and the inertia's entries 10, 20, 21 where corners slide by Coulomb's
/// law, whose impulse is not along what it depends on. They are zero and not read where none does.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Arms {
    pub(super) inertia: [f64x2; 6],
    pub(super) lower: [f64x2; 3],
    pub(super) force: Spatials,
}

/// The same of one body.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Articulated {
    inertia: [f64; 6],
    lower: [f64; 3],
    force: Spatial,
}

/// The joints of two bodies as those towards the root feel them; the default lets nothing through.
#[derive(Debug, Clone, Copy, Default)]
struct Joints {
    /// 1/D with D = I₀₀ + implicit.
    inverse: f64x2,
    implicit: f64x2,
    own: f64x2,
}

impl Arms {
    /// Goes through the joints of the bodies outside, moves from a level's other ends to its reference points, and adds the level itself.
    ///
    /// With c the first column of the inertia I outside, what is felt of it is I − c cᵀ/D, of which the first column is c · implicit/D:
    /// nothing is lost where a joint is soft. All that can be made of I before 1/D is known is made apart, for 1/D is waited for.
    #[inline(always)]
    fn take<const SKEW: bool>(&mut self, through: &Joints, across: [f64x2; 2], quad: &Quad, level: usize) {
        if SKEW {
            return self.take_skew(through, across, quad, level);
        }
        let Joints { inverse, implicit, own } = *through;
        let [wx, wz] = [-across[1], across[0]];
        let [c0, c1, c2, i11, i12, i22] = self.inertia;
        let [half_x, half_z] = pair(&quad.half, level);
        let (mass, inertia) = (quad.mass.level(level), quad.inertia_at_reference.level(level));
        let momentum = pair(&quad.momentum, level);
        let [ux, uz] = [fma(wx, i11, wz * i12), fma(wx, i12, wz * i22)];
        let squares = fma(wx * wx, i11, fma(wz * wz, i22, (wx + wx) * wz * i12));
        let moved = fma(wx, c1, wz * c2);
        let soft = implicit - moved;
        let felt = fma(implicit, c0 + (moved + moved), -(moved * moved));
        self.inertia = [
            fma(felt, inverse, inertia + squares),
            fma(c1 * soft, inverse, fma(-mass, half_z, ux)),
            fma(c2 * soft, inverse, fma(mass, half_x, uz)),
            fma(-c1 * c1, inverse, i11 + mass),
            fma(-c1 * c2, inverse, i12),
            fma(-c2 * c2, inverse, i22 + mass),
        ];
        let [turn, x, z] = self.force;
        self.force = [
            fma(-(c0 + moved), own, momentum[0] + fma(wx, x, fma(wz, z, turn))),
            fma(-c1, own, momentum[1] + x),
            fma(-c2, own, momentum[2] + z),
        ];
    }

    /// The same where the inertia is not symmetric: with its first row r, what is felt of it is I − c rᵀ/D.
    #[inline(always)]
    fn take_skew(&mut self, through: &Joints, across: [f64x2; 2], quad: &Quad, level: usize) {
        let Joints { inverse, implicit, own } = *through;
        let [wx, wz] = [-across[1], across[0]];
        let ([c0, r1, r2, i11, i12, i22], [c1, c2, i21]) = (self.inertia, self.lower);
        let [half_x, half_z] = pair(&quad.half, level);
        let (mass, inertia) = (quad.mass.level(level), quad.inertia_at_reference.level(level));
        let momentum = pair(&quad.momentum, level);
        let squares = fma(wx * wx, i11, fma(wz * wz, i22, wx * wz * (i12 + i21)));
        let [row, column] = [fma(wx, r1, wz * r2), fma(wx, c1, wz * c2)];
        let [soft_row, soft_column] = [implicit - row, implicit - column];
        let felt = fma(implicit, c0 + (row + column), -(row * column));
        self.inertia = [
            fma(felt, inverse, inertia + squares),
            fma(r1 * soft_column, inverse, fma(-mass, half_z, fma(wx, i11, wz * i21))),
            fma(r2 * soft_column, inverse, fma(mass, half_x, fma(wx, i12, wz * i22))),
            fma(-c1 * r1, inverse, i11 + mass),
            fma(-c1 * r2, inverse, i12),
            fma(-c2 * r2, inverse, i22 + mass),
        ];
        self.lower = [
            fma(c1 * soft_row, inverse, fma(-mass, half_z, fma(wx, i11, wz * i12))),
            fma(c2 * soft_row, inverse, fma(mass, half_x, fma(wx, i21, wz * i22))),
            fma(-c2 * r1, inverse, i21),
        ];
        let [turn, x, z] = self.force;
        self.force = [
            fma(-(c0 + column), own, momentum[0] + fma(wx, x, fma(wz, z, turn))),
            fma(-c1, own, momentum[1] + x),
            fma(-c2, own, momentum[2] + z),
        ];
    }

    /// Adds what corners do to the bodies of a level.
    #[inline(always)]
    fn touch<const SKEW: bool>(&mut self, by: &Self) {
        (0..6).for_each(|k| self.inertia[k] += by.inertia[k]);
        if SKEW {
            (0..3).for_each(|k| self.lower[k] += by.lower[k]);
        }
        (0..3).for_each(|k| self.force[k] += by.force[k]);
    }

    /// Solves the joints at the level's reference points.
    #[inline(always)]
    fn joints(&self, quad: &mut Quad, level: usize) -> Joints {
        let implicit = quad.implicit.level(level);
        let pivot = self.inertia[0] + implicit;
        let inverse = f64x2::ONE / pivot;
        let own = (quad.torque.level(level) + self.force[0]) * inverse;
        quad.carried[0].set_level(level, implicit * inverse);
        quad.carried[1].set_level(level, self.inertia[1] * inverse);
        quad.carried[2].set_level(level, self.inertia[2] * inverse);
        quad.own.set_level(level, own);
        quad.pivot.set_level(level, pivot);
        Joints { inverse, implicit, own }
    }

    /// The whole chain at the root's reference point: the right arm hangs on the root's other end, the left arm on the point itself.
    #[inline(always)]
    fn at_root<const SKEW: bool>(mut self, through: &Joints, root: &Quad) -> Articulated {
        self.take::<SKEW>(through, root_ends(root), root, 0);
        Articulated {
            inertia: std::array::from_fn(|k| self.inertia[k].reduce_add()),
            lower: if SKEW { std::array::from_fn(|k| self.lower[k].reduce_add()) } else { [0.0; 3] },
            force: std::array::from_fn(|k| self.force[k].reduce_add()),
        }
    }
}

/// Where the arms hang on the root, from its reference point (cm): the left one on the point itself, the right one on the other end.
#[inline(always)]
fn root_ends(root: &Quad) -> [f64x2; 2] {
    [0, 1].map(|k| f64x2::new([0.0, root.across[k].lane(0)]))
}

impl Articulated {
    /// way · inertia · way.
    #[inline(always)]
    pub(super) fn metric(&self, [turn, x, z]: Spatial) -> f64 {
        let [i00, i01, i02, i11, i12, i22] = self.inertia;
        turn * (i00 * turn + 2.0 * (i01 * x + i02 * z)) + x * (i11 * x + 2.0 * i12 * z) + z * i22 * z
    }

    /// The motion x of a free body: inertia · x = force. Translation is eliminated first, for a long chain's turn is badly conditioned;
    /// without fractions, so that no division waits for another.
    #[inline(always)]
    fn motion<const SKEW: bool>(&self) -> Spatial {
        let [i00, i01, i02, i11, i12, i22] = self.inertia;
        let [i10, i20, i21] = if SKEW { self.lower } else { [i01, i02, i12] };
        let [turn, x, z] = self.force;
        // a·b − c·d.
        let less = |a: f64, b: f64, c: f64, d: f64| a.mul_add(b, -(c * d));
        let (a, b, c) = (less(i00, i22, i02, i20), less(i01, i22, i02, i21), less(i11, i22, i12, i21));
        let d = if SKEW { less(i10, i22, i12, i20) } else { b };
        let (turn, x) = (less(turn, i22, i02, z), less(x, i22, i12, z));
        let spin = less(turn, c, b, x) / less(a, c, b, d);
        let along = less(x, 1.0 / c, spin, d / c);
        let fall = 1.0 / i22;
        [spin, along, less(z, fall, spin, i20 * fall) - along * (i21 * fall)]
    }
}

/// What the root hangs on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum BaseJoint {
    /// Nothing.
    Free,
    /// The world.
    Clamped,
    /// A hinge at its reference point, with the level's own torque and implicit terms.
    Hinged,
}

/// Levels of a block, of which a part of a long chain is made; an even number.
pub(super) const BLOCK: usize = 8;

/// What is felt at the outer end of a block of all that is further out; the default is nothing.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Outside {
    arms: Arms,
    through: Joints,
}

/// The chain as it is felt at the root, which is all of it, and the root's motion.
#[inline(always)]
fn root_motion<const SKEW: bool>(
    chain: Arms,
    through: &Joints,
    root: &Quad,
    hold: BaseJoint,
    mut floor: Inwards,
    law: &Law,
) -> (Articulated, Spatial) {
    if hold == BaseJoint::Clamped {
        return Default::default();
    }
    let mut whole = chain.at_root::<SKEW>(through, root);
    if hold == BaseJoint::Hinged {
        let turn = (whole.force[0] + root.torque.lane(0)) / (whole.inertia[0] + root.implicit.lane(0));
        return (whole, [turn, 0.0, 0.0]);
    }
    if let Some(by) = floor.take(0, law) {
        (0..6).for_each(|k| whole.inertia[k] += by.inertia[k].to_array()[0]);
        (0..3).for_each(|k| whole.lower[k] += by.lower[k].to_array()[0]);
        (0..3).for_each(|k| whole.force[k] += by.force[k].to_array()[0]);
    }
    (whole, whole.motion::<SKEW>())
}

/// Mean motions u of the chain: (Σ Jᵀ M J + implicit + contact) u = Σ Jᵀ p + torques. Corners touch the `floor` as their states say.
///
/// Of the `levels` of some blocks only: bodies further in move as they did, and those further out are felt as they last were. What is
/// felt goes to `outside`, by block, unless it is empty. Returns the chain as it is felt at the root, if that is among `levels`.
#[inline(always)]
pub(super) fn solve<const SKEW: bool>(
    quads: &mut [Quad],
    levels: Range<usize>,
    hold: BaseJoint,
    mut floor: Inwards,
    law: &Law,
    outside: &mut [Outside],
) -> Articulated {
    let block_of = |end: usize| (end - 1) / BLOCK;
    let mut end = levels.end;
    let Outside { arms: mut chain, mut through } = outside.get(block_of(end)).copied().unwrap_or_default();
    while end > levels.start {
        let mut start = levels.start;
        if let Some(outside) = outside.get_mut(block_of(end)) {
            *outside = Outside { arms: chain, through };
            start = BLOCK * block_of(end);
        }
        for k in (start.max(1)..end).rev() {
            let (quad, level) = (&mut quads[k / 2], k % 2);
            chain.take::<SKEW>(&through, pair(&quad.across, level), quad, level);
            if let Some(by) = floor.take(k, law) {
                chain.touch::<SKEW>(&by);
            }
            through = chain.joints(quad, level);
        }
        end = start;
    }
    let mut whole = Articulated::default();
    let set = |quad: &mut Quad, level: usize, mean: Spatials| (0..3).for_each(|k| quad.mean[k].set_level(level, mean[k]));
    let ([mut turn, mut x, mut z], mut across);
    if let Some(inner) = levels.start.checked_sub(1) {
        let quad = &quads[inner / 2];
        ([turn, x, z], across) = (pair(&quad.mean, inner % 2), pair(&quad.across, inner % 2));
    } else {
        let root = &mut quads[0];
        let motion;
        (whole, motion) = root_motion::<SKEW>(chain, &through, root, hold, floor, law);
        [turn, x, z] = motion.map(f64x2::splat);
        set(root, 0, [turn, x, z]);
        across = root_ends(root);
    }
    for k in levels.start.max(1)..levels.end {
        let (quad, level) = (&mut quads[k / 2], k % 2);
        let [a, b, c] = pair(&quad.carried, level);
        let carried = fma(b, across[1], fma(-c, across[0], a));
        let on = fma(carried, turn, fma(-b, x, fma(-c, z, quad.own.level(level))));
        (x, z) = (fma(-turn, across[1], x), fma(turn, across[0], z));
        turn = on;
        set(quad, level, [turn, x, z]);
        across = pair(&quad.across, level);
    }
    if levels.end % 2 == 1 {
        // Bodies without mass outside of the last follow it.
        set(&mut quads[levels.end / 2], 1, [turn, x, z]);
    }
    whole
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
        for _ in 0..super::super::EXACT_EVERY {
            along = turned_by(along, by);
        }
        let [x, z] = along.map(|part| part.lane(0));
        let exact = super::super::EXACT_EVERY as f64 * by;
        let lost = x * exact.sin() - z * exact.cos();
        // Seen: 1.0e-15 rad, and a length of 1 within 4.4e-16.
        assert!(lost.abs() < 1e-14 && (x.hypot(z) - 1.0).abs() < 1e-14, "{lost} {}", x.hypot(z) - 1.0);
    }
}
