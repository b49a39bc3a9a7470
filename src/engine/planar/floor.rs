//! All corners of the robot over the floor: which may touch during a step, and what they do to their bodies.

use wide::f64x2;

use super::LARGEST_FRICTION;
use super::contact::{Corner, Grip, Law};
use super::recursion::{Articulated, Rung, Spatial};
use crate::model::{Extensions, StickSlip, VISCOUS_REACH};

/// The corners of all bodies. Those that may touch in the step at hand are listed.
#[derive(Debug, Default)]
pub(super) struct Floor {
    /// Per rung: at the reference points, then at the other ends, of lane 0 and lane 1 each.
    corners: Vec<[Corner; 4]>,
    grips: Vec<[Grip; 2]>,
    surface: Option<Surface>,
    half_thickness: f64,
    near: Vec<(usize, usize)>,
    near_before: Vec<(usize, usize)>,
    is_near: Vec<[bool; 4]>,
    /// Whether any corner of the rung is not open.
    touching: Vec<bool>,
}

/// A floor that returns some of an impact, or whose friction depends on speed.
#[derive(Debug, Clone, Copy)]
pub(super) struct Surface {
    restitution: f64,
    stick_slip: StickSlip,
}

impl Surface {
    /// None for a plain floor.
    pub(super) fn new(extensions: &Extensions) -> Option<Self> {
        let Extensions { restitution, stick_slip, .. } = *extensions;
        (restitution != 0.0 || stick_slip != StickSlip::OFF).then_some(Self { restitution, stick_slip })
    }

    /// Friction at the sliding speed that the step begins with.
    fn grip(&self, plain: Grip, speed: f64) -> Grip {
        Grip::new(self.stick_slip.friction(plain.friction(), speed).min(LARGEST_FRICTION))
    }
}

impl Floor {
    /// Corners with the coefficients of friction of both bodies of each rung, under boxes of twice `half_thickness` (cm).
    pub(super) fn new(frictions: &[[f64; 2]], half_thickness: f64, surface: Option<Surface>) -> Self {
        let count = frictions.len();
        Self {
            corners: vec![[Corner::default(); 4]; count],
            grips: frictions.iter().map(|pair| pair.map(Grip::new)).collect(),
            surface,
            half_thickness,
            near: Vec::with_capacity(4 * count),
            near_before: Vec::with_capacity(4 * count),
            is_near: vec![[false; 4]; count],
            touching: vec![false; count],
        }
    }

    /// Looks which corners may touch, with the root's reference point at `height` (cm) over the ground that the centre line rests on and
    /// moving with `velocity` (cm/s); whether any does. Lanes without mass have no corners.
    pub(super) fn find(&mut self, rungs: &[Rung], height: f64, velocity: [f64; 2], law: &Law) -> bool {
        std::mem::swap(&mut self.near, &mut self.near_before);
        self.near.clear();
        for &(rung, slot) in &self.near_before {
            self.is_near[rung][slot] = false;
        }
        let (step, reach) = law.reach();
        let (step, reach) = (f64x2::splat(step), f64x2::splat(reach));
        let half = f64x2::splat(self.half_thickness);
        let mut at = f64x2::splat(height + self.half_thickness);
        let mut moving = velocity.map(f64x2::splat);
        for (k, rung) in rungs.iter().enumerate() {
            let rate = rung.motion[0];
            // The side of the box that looks down: its corners are as much aside and below the centre line as the box turns.
            let down = half.copysign(rung.along[0]);
            let offset = [down * rung.along[1], -down * rung.along[0]];
            for end in 0..2 {
                let arm = if end == 0 { offset } else { [rung.across[0] + offset[0], rung.across[1] + offset[1]] };
                let gap = at + arm[1];
                let vertical = moving[1] + rate * arm[0];
                let near = gap.simd_lt(reach - step * vertical);
                if near.none() {
                    continue;
                }
                let before = [(moving[0] - rate * arm[1]).to_array(), vertical.to_array()];
                let (near, gap, [x, z]) = (near.to_bitmask(), gap.to_array(), arm.map(|part| part.to_array()));
                for lane in 0..2 {
                    if near & (1 << lane) != 0 && rung.mass.as_array()[lane] > 0.0 {
                        let slot = 2 * end + lane;
                        let before = [before[0][lane], before[1][lane]];
                        let corner = &mut self.corners[k][slot];
                        let (gap, mut grip) = (gap[lane], self.grips[k][lane]);
                        if let Some(surface) = &self.surface {
                            grip = surface.grip(grip, before[0]);
                        }
                        corner.place([x[lane], z[lane]], gap, before, grip, law);
                        if let Some(surface) = &self.surface {
                            corner.bounce(gap, before[1], surface.restitution, law);
                        }
                        self.is_near[k][slot] = true;
                        self.near.push((k, slot));
                    }
                }
            }
            at = next(at, rung.across[1], k);
            moving = [next(moving[0], -rate * rung.across[1], k), next(moving[1], rate * rung.across[0], k)];
        }
        for &(rung, slot) in &self.near_before {
            if !self.is_near[rung][slot] {
                self.corners[rung][slot].open();
            }
        }
        self.mark();
        !self.near.is_empty()
    }

    /// Force per sliding speed and link on the floor (dyn·s/cm).
    fn viscous(&self) -> f64 {
        self.surface.map_or(0.0, |surface| surface.stick_slip.viscous)
    }

    pub(super) fn is_viscous(&self) -> bool {
        self.viscous() != 0.0
    }

    /// Adds viscous friction over the time `share` (s) to the momentum of the bodies on the floor, with the root's reference point as in
    /// [`find`](Self::find). A force of its own and not a part of the coefficient: which corner bears the weight of a flat robot changes
    /// from step to step, and with it what a coefficient would have to be.
    pub(super) fn push_viscous(&self, rungs: &mut [Rung], height: f64, share: f64) {
        let push = f64x2::splat(-share * self.viscous());
        let half = f64x2::splat(self.half_thickness);
        let mut at = f64x2::splat(height + self.half_thickness);
        for (k, rung) in rungs.iter_mut().enumerate() {
            let across = rung.across[1];
            // The lowest edge, from the reference point.
            let edge = across.fast_min(f64x2::ZERO) - half * rung.along[0].abs();
            let speed = rung.motion[1] - rung.motion[0] * (edge - rung.middle * across);
            let near = (at + edge).simd_lt(f64x2::splat(VISCOUS_REACH)) & rung.mass.simd_gt(f64x2::ZERO);
            let impulse = near.select(push * speed, f64x2::ZERO);
            rung.momentum[0] -= edge * impulse;
            rung.momentum[1] += impulse;
            at = next(at, across, k);
        }
    }

    /// Notes which rungs have corners that are not open.
    pub(super) fn mark(&mut self) {
        self.touching.fill(false);
        for &(rung, slot) in &self.near {
            self.touching[rung] |= !self.corners[rung][slot].is_open();
        }
    }

    pub(super) fn touches(&self, rung: usize) -> bool {
        self.touching[rung]
    }

    /// What the corners of a rung add to the inertia and force of its bodies.
    pub(super) fn of_rung(&self, rung: usize, law: &Law) -> [Articulated; 2] {
        let mut bodies = [Articulated::default(); 2];
        for (slot, corner) in self.corners[rung].iter().enumerate() {
            corner.add_to(&mut bodies[slot % 2], law);
        }
        bodies
    }

    /// Calls `each` with every near corner and the mean motion of its body.
    pub(super) fn near(&mut self, rungs: &[Rung], mut each: impl FnMut(&mut Corner, &Spatial)) {
        for &(rung, slot) in &self.near {
            let mean = rungs[rung].mean.map(|part| part.as_array()[slot % 2]);
            each(&mut self.corners[rung][slot], &mean);
        }
    }

    /// The sum of `of` over the near corners.
    pub(super) fn sum(&self, of: impl Fn(&Corner) -> (f64, f64)) -> (f64, f64) {
        self.near.iter().fold((0.0, 0.0), |sum, &(rung, slot)| {
            let (a, b) = of(&self.corners[rung][slot]);
            (sum.0 + a, sum.1 + b)
        })
    }

    /// The corners of one body: at its reference point and at its other end.
    pub(super) fn of_body(&self, rung: usize, lane: usize) -> [&Corner; 2] {
        [&self.corners[rung][lane], &self.corners[rung][2 + lane]]
    }

    /// Sets friction to zero, or back to what it is.
    pub(super) fn swap_grips(&mut self, other: &mut Vec<[Grip; 2]>) {
        std::mem::swap(&mut self.grips, other);
    }

    /// Forgets all contact.
    pub(super) fn clear(&mut self) {
        self.corners.iter_mut().flatten().for_each(|corner| *corner = Corner::default());
        self.near.clear();
    }

    /// The states of all corners as numbers for storing.
    pub(super) fn saved(&self) -> impl Iterator<Item = f64> + '_ {
        self.corners.iter().flatten().map(Corner::saved)
    }

    /// Takes the states up again: all but the open ones were near.
    pub(super) fn restore(&mut self, saved: &[f64]) {
        self.near.clear();
        for (k, (corners, saved)) in self.corners.iter_mut().zip(saved.chunks_exact(4)).enumerate() {
            for (slot, (corner, saved)) in corners.iter_mut().zip(saved).enumerate() {
                corner.restore(*saved);
                if !corner.is_open() {
                    self.near.push((k, slot));
                }
            }
        }
    }
}

/// From a rung's reference points to the next one's: along each arm; from the root, lane 0 stays and lane 1 goes to the root's other end.
pub(super) fn next(at: f64x2, across: f64x2, rung: usize) -> f64x2 {
    if rung > 0 {
        return at + across;
    }
    let [at, across] = [at.to_array()[0], across.to_array()[0]];
    f64x2::new([at, at + across])
}
