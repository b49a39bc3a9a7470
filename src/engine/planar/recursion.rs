//! The articulated-body algorithm in the plane, both arms of the chain at a time ([`quad`](super::quad)).
//!
//! A tip-to-base pass gathers articulated inertias and bias forces at the reference points, a base-to-tip pass gives the mean motions.
//!
//! R. Featherstone, *Rigid Body Dynamics Algorithms*, chapter 7.

use std::ops::Range;

use wide::f64x2;

use super::lanes::{fma, pair};
use super::quad::{Arms, Quad, Spatial, Spatials};
use crate::model::ClampCurve;

/// What contact adds to the articulated inertia on the way from the tips to the base.
pub(super) trait ContactTerms {
    /// The terms of the bodies of `level`, if any of them touches. Levels are asked for from the outermost to the root, each once.
    fn take(&mut self, level: usize) -> Option<Arms>;
}

/// Articulated inertia and bias force at one point.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Articulated {
    inertia: [f64; 6],
    lower: [f64; 3],
    force: Spatial,
}

/// The joints of two bodies, as the proximal bodies need them; the default transmits nothing.
#[derive(Debug, Clone, Copy, Default)]
struct Joints {
    /// 1/D, with D = I₀₀ + implicit.
    inverse: f64x2,
    implicit: f64x2,
    own: f64x2,
}

impl Arms {
    /// Transmits the distal articulated inertia through its joints, shifts it from a level's far ends to its reference points, and adds the level itself.
    ///
    /// With c the first column of the distal inertia I, I − c cᵀ/D is transmitted. Its first column is computed as c · implicit/D, without
    /// cancellation where a joint is soft. What does not need 1/D comes first, to hide the division's latency.
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
        let transmitted = fma(implicit, c0 + (moved + moved), -(moved * moved));
        self.inertia = [
            fma(transmitted, inverse, inertia + squares),
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

    /// [`take`](Self::take) for an inertia that is not symmetric: with its first row r, I − c rᵀ/D is transmitted.
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
        let transmitted = fma(implicit, c0 + (row + column), -(row * column));
        self.inertia = [
            fma(transmitted, inverse, inertia + squares),
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

    /// Adds the contact terms of a level.
    #[inline(always)]
    fn add<const SKEW: bool>(&mut self, by: &Self) {
        (0..6).for_each(|k| self.inertia[k] += by.inertia[k]);
        if SKEW {
            (0..3).for_each(|k| self.lower[k] += by.lower[k]);
        }
        (0..3).for_each(|k| self.force[k] += by.force[k]);
    }

    /// Eliminates the joints at the level's reference points.
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

    /// The whole chain at the root's reference point: the left arm hangs there, the right arm on the root's far end.
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

/// Where the arms hang on the root, from its reference point (cm).
#[inline(always)]
fn root_ends(root: &Quad) -> [f64x2; 2] {
    [0, 1].map(|k| f64x2::new([0.0, root.across[k].lane(0)]))
}

impl Articulated {
    /// dᵀ · inertia · d.
    #[inline(always)]
    pub(super) fn metric(&self, [turn, x, z]: Spatial) -> f64 {
        let [i00, i01, i02, i11, i12, i22] = self.inertia;
        turn * (i00 * turn + 2.0 * (i01 * x + i02 * z)) + x * (i11 * x + 2.0 * i12 * z) + z * i22 * z
    }

    /// The motion of a free body, from inertia · motion = force. Translation is eliminated first, for a long chain's turn is badly conditioned; without
    /// fractions, so that no division waits for another.
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

/// How the root is joined to the world.
#[derive(Debug, Clone, Copy)]
pub(super) enum BaseJoint {
    /// Not at all.
    Free,
    /// By a clamp at its reference point.
    Clamped(Clamp),
}

/// What a clamp lets the root do; both are independent of each other.
#[derive(Debug, Clone, Copy)]
pub(super) struct Clamp {
    /// The turn.
    pub(super) turn: Turn,
    /// The shift in z, if there is one.
    pub(super) slide: Option<Slide>,
}

/// How a clamped root turns with the moment on it.
#[derive(Debug, Clone, Copy)]
pub(super) enum Turn {
    /// Not at all.
    Rigid,
    /// As a hinge with the level's own torque and implicit terms.
    Hinged {
        /// Damping over stiffness (s).
        damping_time: f64,
    },
    /// As a curve says.
    Curved {
        curve: ClampCurve,
        /// Damping over stiffness (s).
        damping_time: f64,
        /// Turn at which the moment acts over the mean rate, from the start of the step (s), with the damping.
        ahead: f64,
        /// Time over which the moment acts (s).
        share: f64,
    },
}

/// A spring and a damper between the world and the root's reference point, in z.
#[derive(Debug, Clone, Copy)]
pub(super) struct Slide {
    /// Stiffness (dyn/cm), and damping over it (s).
    pub(super) stiffness: f64,
    pub(super) damping_time: f64,
    /// What they add to the articulated inertia in a step (g), and their impulse at its start (dyn·s).
    pub(super) implicit: f64,
    pub(super) impulse: f64,
}

impl BaseJoint {
    /// The turn, of a clamp.
    pub(super) fn turn(&mut self) -> Option<&mut Turn> {
        match self {
            Self::Free => None,
            Self::Clamped(clamp) => Some(&mut clamp.turn),
        }
    }

    /// The shift in z, of a clamp that gives there.
    pub(super) fn slide(&mut self) -> Option<&mut Slide> {
        match self {
            Self::Free => None,
            Self::Clamped(clamp) => clamp.slide.as_mut(),
        }
    }

    /// Whether it shifts in z as a clamp gives.
    pub(super) fn slides(&self) -> bool {
        matches!(self, Self::Clamped(Clamp { slide: Some(_), .. }))
    }
}

impl Clamp {
    /// Mean motion of the root under the whole chain.
    fn motion(&self, whole: &Articulated, root: &Quad) -> Spatial {
        let [turning, _, coupling, .., sinking] = whole.inertia;
        let [moment, _, down] = whole.force;
        let Some(slide) = &self.slide else { return [self.turn.rate(turning, moment, root), 0.0, 0.0] };
        let (sinking, down) = (sinking + slide.implicit, down + slide.impulse);
        // The shift is eliminated first: what is left turns as under a clamp that does not shift.
        let turn = self.turn.rate(turning - coupling * coupling / sinking, moment - coupling * down / sinking, root);
        [turn, 0.0, (down - coupling * turn) / sinking]
    }
}

impl Turn {
    /// Mean rate of the root (rad/s), under an inertia that only turns and the moment's impulse.
    fn rate(&self, inertia: f64, moment: f64, root: &Quad) -> f64 {
        match self {
            Self::Rigid => 0.0,
            Self::Hinged { .. } => (moment + root.torque.lane(0)) / (inertia + root.implicit.lane(0)),
            Self::Curved { curve, ahead, share, .. } => {
                // I u = F − share·M with φ + ahead·u = φ(M), exactly: the root is the last to be eliminated.
                let held = curve.moment(root.angle.lane(0) + ahead * moment / inertia, ahead * share / inertia);
                (moment - share * held) / inertia
            }
        }
    }
}

/// Tree levels of a block; an even number. A part of a long chain is a run of blocks.
pub(super) const BLOCK: usize = 8;

/// Distal articulated inertia and bias force at a block's far end; the default is none.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Distal {
    arms: Arms,
    through: Joints,
}

/// Articulated inertia and bias force of the whole chain at the root, and the root's motion.
#[inline(always)]
fn root_motion<const SKEW: bool>(
    chain: Arms,
    through: &Joints,
    root: &Quad,
    base_joint: &BaseJoint,
    mut contact: impl ContactTerms,
) -> (Articulated, Spatial) {
    if matches!(base_joint, BaseJoint::Clamped(Clamp { turn: Turn::Rigid, slide: None })) {
        return Default::default();
    }
    let mut whole = chain.at_root::<SKEW>(through, root);
    if let Some(by) = contact.take(0) {
        (0..6).for_each(|k| whole.inertia[k] += by.inertia[k].to_array()[0]);
        (0..3).for_each(|k| whole.lower[k] += by.lower[k].to_array()[0]);
        (0..3).for_each(|k| whole.force[k] += by.force[k].to_array()[0]);
    }
    let motion = match base_joint {
        BaseJoint::Free => whole.motion::<SKEW>(),
        BaseJoint::Clamped(clamp) => clamp.motion(&whole, root),
    };
    (whole, motion)
}

/// Solves (Σ Jᵀ M J + implicit + contact) u = Σ Jᵀ p + torques for the mean motions u, with `contact` in its present modes.
///
/// Only for `levels`, a run of blocks: proximal bodies keep their motion, and distal ones act through the inertia and force stored in `distal`, which is
/// updated block by block unless it is empty. Returns the whole chain at the root, if that is among `levels`.
#[inline(always)]
pub(super) fn solve<const SKEW: bool>(
    quads: &mut [Quad],
    levels: Range<usize>,
    base_joint: &BaseJoint,
    mut contact: impl ContactTerms,
    distal: &mut [Distal],
) -> Articulated {
    let block_of = |end: usize| (end - 1) / BLOCK;
    let mut end = levels.end;
    let Distal { arms: mut chain, mut through } = distal.get(block_of(end)).copied().unwrap_or_default();
    while end > levels.start {
        let mut start = levels.start;
        if let Some(distal) = distal.get_mut(block_of(end)) {
            *distal = Distal { arms: chain, through };
            start = BLOCK * block_of(end);
        }
        for k in (start.max(1)..end).rev() {
            let (quad, level) = (&mut quads[k / 2], k % 2);
            chain.take::<SKEW>(&through, pair(&quad.across, level), quad, level);
            if let Some(by) = contact.take(k) {
                chain.add::<SKEW>(&by);
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
        (whole, motion) = root_motion::<SKEW>(chain, &through, root, base_joint, contact);
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
        // Padding moves with its proximal neighbour.
        set(&mut quads[levels.end / 2], 1, [turn, x, z]);
    }
    whole
}
