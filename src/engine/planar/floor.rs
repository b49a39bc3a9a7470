//! All corners of the robot over the floor: contact detection, and contact terms of the bodies.

use std::ops::Range;

use wide::f64x2;

use super::contact::{Candidates, ContactMode, Corners, FrictionCone};
use super::lanes::{Lanes, fma, pair};
use super::law::ContactLaw;
use super::quad::{Arms, Quad, Spatials};
use super::recursion::ContactTerms;
use crate::engine::LARGEST_FRICTION;
use crate::model::{Extensions, FrictionCurve, StickSlip, VISCOUS_REACH};

/// The corners of all bodies, and the contact candidates of the current step.
#[derive(Debug, Default)]
pub(super) struct Floor {
    /// Two places per tree level: at the reference points, then at the far ends.
    corners: Vec<Corners>,
    /// Of each tree level.
    cones: Vec<FrictionCone>,
    surface: Option<Surface>,
    half_thickness: f64,
    /// Places with contact candidates, in increasing order.
    near: Vec<usize>,
    /// Those of them whose modes change in a line search.
    changing: Vec<usize>,
    /// Number of contact-detection passes so far.
    detection_pass: u64,
    /// See [`first_landing`](Self::first_landing).
    landing: f64,
    /// Sums over the parts of a step that was cut of all corners' impulses (dyn·s); empty for other steps.
    of_parts: Vec<[f64x2; 2]>,
}

/// Kinematics of a tree level's reference points: height above the floor with half a thickness (cm), velocity (cm/s), rates of the bodies (rad/s).
struct Reference {
    gap: f64x2,
    velocity: [f64x2; 2],
    /// At constant rates (cm/s²).
    acceleration: [f64x2; 2],
    rate: f64x2,
    /// Mask of the lanes that are not padding.
    there: f64x2,
}

/// A floor with restitution, or whose friction depends on speed.
#[derive(Debug, Clone, Copy)]
pub(super) struct Surface {
    restitution: f64,
    stick_slip: StickSlip,
    of_speed: FrictionCurve,
}

impl Surface {
    /// `None` for a plain floor.
    pub(super) fn new(extensions: &Extensions) -> Option<Self> {
        let Extensions { restitution, stick_slip, friction_of_speed: of_speed, .. } = *extensions;
        let is_plain = restitution == 0.0 && !extensions.has_friction_of_speed();
        (!is_plain).then_some(Self { restitution, stick_slip, of_speed })
    }

    /// Friction at the sliding speeds of the step's start (cm/s).
    fn cone(&self, plain: FrictionCone, speed: f64x2) -> FrictionCone {
        let [a, b] = plain.friction();
        let [u, v] = speed.to_array();
        let at = |plain: f64, speed: f64| self.of_speed.friction(self.stick_slip.friction(plain, speed), speed);
        let friction = [at(a, u), at(b, v)];
        FrictionCone::new(f64x2::new(friction.map(|friction| friction.min(LARGEST_FRICTION))))
    }
}

impl Floor {
    /// A floor under boxes of twice `half_thickness` (cm), with the coefficients of friction of both bodies of each tree level.
    pub(super) fn new(frictions: &[[f64; 2]], half_thickness: f64, surface: Option<Surface>) -> Self {
        let cones: Vec<FrictionCone> = frictions.iter().map(|pair| FrictionCone::new(f64x2::new(*pair))).collect();
        let corners: Vec<Corners> = cones.iter().flat_map(|cone| [Corners::new(*cone); 2]).collect();
        let places = || Vec::with_capacity(corners.len());
        Self {
            near: places(),
            changing: places(),
            of_parts: Vec::with_capacity(corners.len()),
            corners,
            cones,
            surface,
            half_thickness,
            detection_pass: 0,
            landing: f64::INFINITY,
        }
    }

    /// The contact-detection pass. The root's reference point is at `height` (cm) above that of a flat robot on the floor, with the velocity (cm/s) and
    /// acceleration at constant rates (cm/s²) in `root`.
    #[inline(always)]
    pub(super) fn find(&mut self, quads: &[Quad], levels: usize, height: f64, root: [[f64; 2]; 2], law: &ContactLaw) {
        self.near.clear();
        self.detection_pass += 1;
        self.landing = f64::INFINITY;
        let (step, reach) = law.reach();
        let (step, reach) = (f64x2::splat(step), f64x2::splat(reach));
        let half = f64x2::splat(self.half_thickness);
        let mut at = f64x2::splat(height + self.half_thickness);
        let [mut moving, mut bending] = root.map(|part| part.map(f64x2::splat));
        // Accelerations are needed at candidates only, so they are carried along no further than these.
        let mut carried = 0;
        for k in 0..levels {
            let quad = &quads[k / 2];
            let (along, across) = (pair(&quad.along, k % 2), pair(&quad.across, k % 2));
            let rate = quad.motion[0].level(k % 2);
            // The corners of the box's lower side, from the centre line.
            let down = half.copysign(along[0]);
            let (x, z) = (down * along[1], -down * along[0]);
            let (outer_x, outer_z) = (across[0] + x, across[1] + z);
            let near = |x: f64x2, z: f64x2| (at + z).simd_lt(fma(-step, fma(rate, x, moving[1]), reach));
            let (inner, outer) = (near(x, z), near(outer_x, outer_z));
            if (inner | outer).any() {
                for level in carried..k {
                    let (across, rate) = (pair(&quads[level / 2].across, level % 2), quads[level / 2].motion[0].level(level % 2));
                    bending = [0, 1].map(|axis| next(bending[axis], -rate * (rate * across[axis]), level));
                }
                carried = k;
                let from = Reference {
                    gap: at,
                    velocity: moving,
                    acceleration: bending,
                    rate,
                    there: quad.mass.level(k % 2).simd_gt(f64x2::ZERO),
                };
                self.place(2 * k, inner, [x, z], &from, law);
                self.place(2 * k + 1, outer, [outer_x, outer_z], &from, law);
            }
            at = next(at, across[1], k);
            moving = [next(moving[0], -(rate * across[1]), k), next(moving[1], rate * across[0], k)];
        }
    }

    /// Time (s) until the first of the corners that come down faster than `least` (cm/s) lands, at constant velocities. The links point `along`, and the root's
    /// reference point has this height (cm, as in [`find`](Self::find)) and vertical velocity (cm/s).
    #[inline(always)]
    pub(super) fn landing(
        &self,
        quads: &[Quad],
        along: &[[Lanes; 2]],
        levels: usize,
        [height, speed]: [f64; 2],
        least: f64,
    ) -> f64 {
        let half = f64x2::splat(self.half_thickness);
        let (least, never) = (f64x2::splat(-least), f64x2::splat(f64::INFINITY));
        let mut at = f64x2::splat(height + self.half_thickness);
        let mut moving = f64x2::splat(speed);
        let mut first = never;
        for k in 0..levels {
            let quad = &quads[k / 2];
            let [x, z] = pair(&along[k / 2], k % 2);
            let (rate, reach) = (quad.motion[0].level(k % 2), quad.reach.level(k % 2));
            let there = quad.mass.level(k % 2).simd_gt(f64x2::ZERO);
            let corner = [half.copysign(x) * z, -half * x.abs()];
            for along in [f64x2::ZERO, reach] {
                let (arm_x, arm_z) = (fma(along, x, corner[0]), fma(along, z, corner[1]));
                let down = fma(rate, arm_x, moving);
                let time = (at + arm_z).fast_max(f64x2::ZERO) / -down;
                first = first.fast_min((there & down.simd_lt(least)).select(time, never));
            }
            at = next(at, reach * z, k);
            moving = next(moving, rate * reach * x, k);
        }
        let [a, b] = first.to_array();
        a.min(b)
    }

    /// Makes the corners of a place, at `arm` (cm) from their bodies' reference points, candidates where the mask `near` says so.
    #[inline(always)]
    fn place(&mut self, place: usize, near: f64x2, arm: [f64x2; 2], from: &Reference, law: &ContactLaw) {
        let near = near & from.there;
        if !near.any() {
            return;
        }
        let rate = from.rate;
        let half_step = f64x2::splat(0.5 * law.reach().0);
        let curve = [0, 1].map(|k| fma(-rate * rate, arm[k], from.acceleration[k]) * half_step);
        let gap = fma(curve[1], f64x2::splat(-0.25 * law.reach().0), from.gap + arm[1]);
        let velocity = [fma(-rate, arm[1], from.velocity[0]) - curve[0], fma(rate, arm[0], from.velocity[1]) - curve[1]];
        self.corners[place].place(self.detection_pass, near, &Candidates { arm, gap, velocity, curve }, law);
        if self.surface.is_some() {
            self.apply_surface(place, gap, velocity, law);
        }
        self.near.push(place);
        let comes = near & self.corners[place].open() & law.cuts(gap, velocity[1]);
        if comes.any() {
            // The gap is that in the step's middle.
            let time = gap / -velocity[1] + f64x2::splat(0.5 * law.reach().0);
            let time = comes.select(time.fast_max(f64x2::ZERO), f64x2::splat(f64::INFINITY));
            self.landing = time.to_array().into_iter().fold(self.landing, f64::min);
        }
    }

    /// Time from the step's start until the first landing that cuts it (s); infinite if none does.
    #[inline(always)]
    pub(super) fn first_landing(&self) -> f64 {
        self.landing
    }

    /// Begins to sum the impulses of a step that is cut.
    pub(super) fn begin_parts(&mut self) {
        self.of_parts.clear();
        self.of_parts.resize(self.corners.len(), [f64x2::ZERO; 2]);
    }

    /// Begins a step that is not cut.
    #[inline(always)]
    pub(super) fn begin_whole(&mut self) {
        self.of_parts.clear();
    }

    /// Adds the impulses of a part of a step.
    pub(super) fn end_part(&mut self, law: &ContactLaw) {
        for (sum, corners) in self.of_parts.iter_mut().zip(&self.corners) {
            let impulses = corners.impulses(self.detection_pass, law);
            *sum = [0, 1].map(|k| sum[k] + impulses[k]);
        }
    }

    /// Applies restitution and speed-dependent friction to candidates.
    #[inline(never)]
    fn apply_surface(&mut self, place: usize, gap: f64x2, velocity: [f64x2; 2], law: &ContactLaw) {
        let Some(surface) = &self.surface else { return };
        let corners = &mut self.corners[place];
        corners.set_cone(surface.cone(self.cones[place / 2], velocity[0]));
        corners.bounce(gap, velocity[1], surface.restitution, law);
    }

    /// Viscous friction per link on the floor (dyn·s/cm).
    fn viscous(&self) -> f64 {
        self.surface.map_or(0.0, |surface| surface.stick_slip.viscous)
    }

    pub(super) fn is_viscous(&self) -> bool {
        self.viscous() != 0.0
    }

    /// Adds viscous friction over the time `share` (s) to the momentum of the bodies on the floor, with the root's reference point as in
    /// [`find`](Self::find). It is a force per body and no part of μ, for which corner bears a flat robot's weight changes from step to step.
    pub(super) fn push_viscous(&self, quads: &mut [Quad], height: f64, share: f64) {
        let push = f64x2::splat(-share * self.viscous());
        let half = f64x2::splat(self.half_thickness);
        let mut at = f64x2::splat(height + self.half_thickness);
        for k in 0..2 * quads.len() {
            let (quad, level) = (&mut quads[k / 2], k % 2);
            let across = quad.across[1].level(level);
            // Height of the lowest edge, from the reference point.
            let edge = across.fast_min(f64x2::ZERO) - half * quad.along[0].level(level).abs();
            let speed = quad.motion[1].level(level) - quad.motion[0].level(level) * (edge - quad.middle.level(level) * across);
            let near = (at + edge).simd_lt(f64x2::splat(VISCOUS_REACH)) & quad.mass.level(level).simd_gt(f64x2::ZERO);
            let impulse = near.select(push * speed, f64x2::ZERO);
            let [turn, x] = [0, 1].map(|part| quad.momentum[part].level(level));
            quad.momentum[0].set_level(level, turn - edge * impulse);
            quad.momentum[1].set_level(level, x + impulse);
            at = next(at, across, k);
        }
    }

    /// Indices of all candidates.
    pub(super) fn all(&self) -> Range<usize> {
        0..self.near.len()
    }

    /// Indices of the candidates of `levels`.
    pub(super) fn among(&self, levels: &Range<usize>) -> Range<usize> {
        let [start, end] = [levels.start, levels.end].map(|level| self.near.partition_point(|place| *place < 2 * level));
        start..end
    }

    /// True if a candidate slides.
    #[inline(always)]
    pub(super) fn slides(&self) -> bool {
        self.near.iter().any(|place| self.corners[*place].slides())
    }

    /// All candidates with their places.
    pub(super) fn listed(&self) -> impl Iterator<Item = (usize, &Corners)> {
        self.near.iter().map(|place| (*place, &self.corners[*place]))
    }

    /// Excess velocities (cm/s) of the corners of a place.
    #[inline(always)]
    pub(super) fn excess(&self, place: usize, quads: &[Quad]) -> [f64x2; 2] {
        self.corners[place].excess(&mean_at(place, quads))
    }

    /// Sets the modes of the corners of a place.
    #[inline(always)]
    pub(super) fn set_modes(&mut self, place: usize, modes: [f64; 2]) {
        self.corners[place].set_modes(modes);
    }

    /// Candidates, for the tip-to-base pass.
    #[inline(always)]
    pub(super) fn tip_to_base<'a>(&'a self, among: &Range<usize>, law: &'a ContactLaw) -> TipToBase<'a> {
        TipToBase { corners: &self.corners, near: &self.near[among.clone()], law }
    }

    /// Calls `each` with tree level, corners and the bodies' mean motions of the candidates `among`.
    #[inline(always)]
    pub(super) fn near(&mut self, among: &Range<usize>, quads: &[Quad], mut each: impl FnMut(usize, &mut Corners, &Spatials)) {
        for &place in &self.near[among.clone()] {
            each(place / 2, &mut self.corners[place], &mean_at(place, quads));
        }
    }

    /// Prepares a line search; returns the sums of [`Corners::aim`].
    #[inline(always)]
    pub(super) fn aim(&mut self, among: &Range<usize>, quads: &[Quad], law: &ContactLaw) -> [f64; 2] {
        self.changing.clear();
        let mut sums = [0.0; 2];
        for &place in &self.near[among.clone()] {
            if let Some(changing) = self.corners[place].aim(&mean_at(place, quads), law) {
                sums = [0, 1].map(|k| sums[k] + changing[k]);
                self.changing.push(place);
            }
        }
        sums
    }

    /// Impulse along the search direction and its slope at the fraction `t` of a line search, summed over the corners whose mode changes.
    #[inline(always)]
    pub(super) fn search(&self, t: f64, law: &ContactLaw) -> [f64; 2] {
        self.changing.iter().fold([0.0; 2], |sum, &place| {
            let [along, slope] = self.corners[place].search(t, law);
            [sum[0] + along.reduce_add(), sum[1] + slope.reduce_add()]
        })
    }

    /// Impulses on the corners of one body over the step (dyn·s): at its reference point and at its far end.
    pub(super) fn impulses_on(&self, level: usize, lane: usize, law: &ContactLaw) -> [[f64; 2]; 2] {
        [2 * level, 2 * level + 1].map(|place| {
            let of_parts = self.of_parts.get(place).copied();
            of_parts.unwrap_or_else(|| self.corners[place].impulses(self.detection_pass, law)).map(|part| part.to_array()[lane])
        })
    }

    /// Half the thickness of the boxes (cm).
    pub(super) fn half_thickness(&self) -> f64 {
        self.half_thickness
    }

    /// Exchanges the friction of all corners with `other`.
    pub(super) fn swap_cones(&mut self, other: &mut Vec<FrictionCone>) {
        std::mem::swap(&mut self.cones, other);
        for (place, corners) in self.corners.iter_mut().enumerate() {
            corners.set_cone(self.cones[place / 2]);
        }
    }

    /// Clears candidates and modes.
    pub(super) fn clear(&mut self) {
        self.near.clear();
        self.detection_pass += 1;
    }

    /// The modes of all corners as numbers for storing: four per tree level, at the reference points and at the far ends.
    pub(super) fn saved(&self) -> impl Iterator<Item = f64> + '_ {
        self.corners.iter().flat_map(|corners| corners.mode(self.detection_pass).saved())
    }

    /// Restores stored modes.
    pub(super) fn restore(&mut self, saved: &[f64]) {
        for (corners, saved) in self.corners.iter_mut().zip(saved.as_chunks().0) {
            corners.restore(ContactMode::restored(*saved), self.detection_pass);
        }
    }
}

/// Candidates in the order of the tip-to-base pass.
#[derive(Debug, Clone, Copy)]
pub(super) struct TipToBase<'a> {
    corners: &'a [Corners],
    near: &'a [usize],
    law: &'a ContactLaw,
}

impl ContactTerms for TipToBase<'_> {
    #[inline(always)]
    fn take(&mut self, level: usize) -> Option<Arms> {
        if self.near.last().is_none_or(|place| place / 2 != level) {
            return None;
        }
        let (mut bodies, mut touches) = (Arms::default(), false);
        while let [rest @ .., place] = self.near
            && place / 2 == level
        {
            self.near = rest;
            let corners = &self.corners[*place];
            if !corners.is_open() {
                corners.add_to(&mut bodies, self.law);
                touches = true;
            }
        }
        touches.then_some(bodies)
    }
}

/// Mean motion of a place's bodies.
#[inline(always)]
fn mean_at(place: usize, quads: &[Quad]) -> Spatials {
    pair(&quads[place / 4].mean, place / 2 % 2)
}

/// From a tree level's reference points to the next one's. From the root, lane 0 stays and lane 1 goes to the root's far end.
#[inline(always)]
pub(super) fn next(at: f64x2, across: f64x2, level: usize) -> f64x2 {
    if level > 0 {
        return at + across;
    }
    let [at, across] = [at.to_array()[0], across.to_array()[0]];
    f64x2::new([at, at + across])
}
