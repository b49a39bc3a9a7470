//! All corners of the robot over the floor: which may touch during a step, and what they do to their bodies.

use wide::f64x2;

use super::LARGEST_FRICTION;
use super::contact::{Corners, Grip, Law, Touch};
use super::recursion::{Arms, Rung, Spatials};
use crate::model::{Extensions, StickSlip, VISCOUS_REACH};

/// Corners of which one may touch in the step at hand.
#[derive(Debug, Clone, Copy)]
pub(super) struct Near {
    /// Twice the rung, and 1 more at the bodies' other ends.
    place: usize,
    corners: Corners,
}

impl Near {
    fn rung(&self) -> usize {
        self.place / 2
    }
}

/// The floor and the corners near it.
#[derive(Debug, Default)]
pub(super) struct Floor {
    /// Of each rung.
    grips: Vec<Grip>,
    surface: Option<Surface>,
    half_thickness: f64,
    /// Place after place, and those of the step before.
    near: Vec<Near>,
    before: Vec<Near>,
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

    /// Friction at the sliding speeds that the step begins with.
    fn grip(&self, plain: Grip, speed: f64x2) -> Grip {
        let [a, b] = plain.friction();
        let [u, v] = speed.to_array();
        let friction = [self.stick_slip.friction(a, u), self.stick_slip.friction(b, v)];
        Grip::new(f64x2::new(friction.map(|friction| friction.min(LARGEST_FRICTION))))
    }
}

impl Floor {
    /// Corners with the coefficients of friction of both bodies of each rung, under boxes of twice `half_thickness` (cm).
    pub(super) fn new(frictions: &[[f64; 2]], half_thickness: f64, surface: Option<Surface>) -> Self {
        let places = 2 * frictions.len();
        Self {
            grips: frictions.iter().map(|pair| Grip::new(f64x2::new(*pair))).collect(),
            surface,
            half_thickness,
            near: Vec::with_capacity(places),
            before: Vec::with_capacity(places),
        }
    }

    /// Looks which corners may touch, with the root's reference point at `height` (cm) over the ground that the centre line rests on and
    /// moving with `velocity` (cm/s); whether any does. Lanes without mass have no corners.
    pub(super) fn find(&mut self, rungs: &[Rung], height: f64, velocity: [f64; 2], law: &Law) -> bool {
        std::mem::swap(&mut self.near, &mut self.before);
        self.near.clear();
        let mut before = self.before.iter().peekable();
        let (step, reach) = law.reach();
        let (step, reach) = (f64x2::splat(step), f64x2::splat(reach));
        let half = f64x2::splat(self.half_thickness);
        let mut at = f64x2::splat(height + self.half_thickness);
        let mut moving = velocity.map(f64x2::splat);
        for (k, (rung, grip)) in rungs.iter().zip(&self.grips).enumerate() {
            let rate = rung.motion[0];
            // The side of the box that looks down: its corners are as much aside and below the centre line as the box turns.
            let down = half.copysign(rung.along[0]);
            let offset = [down * rung.along[1], -down * rung.along[0]];
            for end in 0..2 {
                let arm = if end == 0 { offset } else { [rung.across[0] + offset[0], rung.across[1] + offset[1]] };
                let gap = at + arm[1];
                let vertical = moving[1] + rate * arm[0];
                let near = gap.simd_lt(reach - step * vertical) & rung.mass.simd_gt(f64x2::ZERO);
                if !near.any() {
                    continue;
                }
                let place = 2 * k + end;
                while before.next_if(|before| before.place < place).is_some() {}
                let touch =
                    before.next_if(|before| before.place == place).map_or_else(Touch::default, |before| before.corners.touch());
                let velocity = [moving[0] - rate * arm[1], vertical];
                let corners = match &self.surface {
                    None => Corners::new(near, touch, arm, gap, velocity, *grip, law),
                    Some(surface) => {
                        let grip = surface.grip(*grip, velocity[0]);
                        let mut corners = Corners::new(near, touch, arm, gap, velocity, grip, law);
                        corners.bounce(gap, vertical, surface.restitution, law);
                        corners
                    }
                };
                self.near.push(Near { place, corners });
            }
            at = next(at, rung.across[1], k);
            moving = [next(moving[0], -rate * rung.across[1], k), next(moving[1], rate * rung.across[0], k)];
        }
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

    /// The corners that may touch, rung after rung.
    pub(super) fn corners(&self) -> &[Near] {
        &self.near
    }

    /// Calls `each` with all near corners and the mean motions of their bodies.
    #[inline(always)]
    pub(super) fn near(&mut self, rungs: &[Rung], mut each: impl FnMut(&mut Corners, &Spatials)) {
        for near in &mut self.near {
            let mean = &rungs[near.rung()].mean;
            each(&mut near.corners, mean);
        }
    }

    /// The sums of `of` over the near corners, one after the other.
    #[inline(always)]
    pub(super) fn sum(&self, of: impl Fn(&Corners) -> [f64x2; 2]) -> [f64; 2] {
        self.near.iter().fold([0.0; 2], |sum, near| {
            let [a, b] = of(&near.corners).map(f64x2::to_array);
            [sum[0] + a[0] + a[1], sum[1] + b[0] + b[1]]
        })
    }

    /// Arm (cm) and impulse (dyn·s) of the near corners of one body: at its reference point and at its other end.
    pub(super) fn of_body(&self, rung: usize, lane: usize, law: &Law) -> impl Iterator<Item = [[f64; 2]; 2]> {
        let first = self.near.partition_point(|near| near.rung() < rung);
        let of_rung = self.near[first..].iter().take_while(move |near| near.rung() == rung);
        of_rung.map(move |near| [near.corners.arm.map(|part| part.to_array()[lane]), near.corners.impulse(lane, law)])
    }

    /// Sets friction to zero, or back to what it is.
    pub(super) fn swap_grips(&mut self, other: &mut Vec<Grip>) {
        std::mem::swap(&mut self.grips, other);
    }

    /// Forgets all contact.
    pub(super) fn clear(&mut self) {
        self.near.clear();
    }

    /// The states of all corners as numbers for storing: four per rung, at the reference points and at the other ends.
    pub(super) fn saved(&self) -> Vec<f64> {
        let mut states = vec![Touch::default().saved(); 2 * self.grips.len()];
        for near in &self.near {
            states[near.place] = near.corners.touch().saved();
        }
        states.into_iter().flatten().collect()
    }

    /// Takes the states up again: all but the open ones were near.
    pub(super) fn restore(&mut self, saved: &[f64]) {
        let touches = saved.chunks_exact(2).map(|pair| Touch::restored([pair[0], pair[1]]));
        let touching = touches.enumerate().filter(|(_, touch)| !touch.is_open());
        self.near.clear();
        self.near.extend(touching.map(|(place, touch)| Near { place, corners: Corners::restored(touch) }));
    }
}

/// Takes the corners of `rung`, which are the last ones of `near`, off that, and returns what they add to the inertia and force of its bodies;
/// none if all are open.
#[inline(always)]
pub(super) fn take_last(near: &mut &[Near], rung: usize, law: &Law) -> Option<Arms> {
    if near.last().is_none_or(|last| last.rung() != rung) {
        return None;
    }
    let (mut bodies, mut touch) = (Arms::default(), false);
    while let [rest @ .., last] = *near
        && last.rung() == rung
    {
        *near = rest;
        if !last.corners.touch().is_open() {
            last.corners.add_to(&mut bodies, law);
            touch = true;
        }
    }
    touch.then_some(bodies)
}

/// From a rung's reference points to the next one's: along each arm; from the root, lane 0 stays and lane 1 goes to the root's other end.
pub(super) fn next(at: f64x2, across: f64x2, rung: usize) -> f64x2 {
    if rung > 0 {
        return at + across;
    }
    let [at, across] = [at.to_array()[0], across.to_array()[0]];
    f64x2::new([at, at + across])
}
