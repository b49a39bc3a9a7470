//! All corners of the robot over the floor: which may touch during a step, and what they do to their bodies.

use wide::f64x2;

use super::contact::{Corner, Grip, Law};
use super::recursion::{Articulated, Rung, Spatial};

/// The corners of all bodies. Those that may touch in the step at hand are listed.
#[derive(Debug, Default)]
pub(super) struct Floor {
    /// Per rung: at the reference points, then at the other ends, of lane 0 and lane 1 each.
    corners: Vec<[Corner; 4]>,
    grips: Vec<[Grip; 2]>,
    half_thickness: f64,
    near: Vec<(usize, usize)>,
    near_before: Vec<(usize, usize)>,
    is_near: Vec<[bool; 4]>,
    /// Whether any corner of the rung is not open.
    touching: Vec<bool>,
}

impl Floor {
    /// Corners with the coefficients of friction of both bodies of each rung, under boxes of twice `half_thickness` (cm).
    pub(super) fn new(frictions: &[[f64; 2]], half_thickness: f64) -> Self {
        let count = frictions.len();
        Self {
            corners: vec![[Corner::default(); 4]; count],
            grips: frictions.iter().map(|pair| pair.map(Grip::new)).collect(),
            half_thickness,
            near: Vec::with_capacity(4 * count),
            near_before: Vec::with_capacity(4 * count),
            is_near: vec![[false; 4]; count],
            touching: vec![false; count],
        }
    }

    /// Looks which corners may touch, with the root's reference point at `height` (cm) over the ground that the centre line rests on;
    /// whether any does. Lanes without mass have no corners.
    pub(super) fn find(&mut self, rungs: &[Rung], height: f64, law: &Law) -> bool {
        std::mem::swap(&mut self.near, &mut self.near_before);
        self.near.clear();
        for &(rung, slot) in &self.near_before {
            self.is_near[rung][slot] = false;
        }
        let reach = law.reach();
        let half = f64x2::splat(self.half_thickness);
        let mut at = f64x2::splat(height + self.half_thickness);
        for (k, rung) in rungs.iter().enumerate() {
            // The side of the box that looks down: its corners are as much aside and below the centre line as the box turns.
            let down = half.copysign(rung.along[0]);
            let drop = -down * rung.along[0];
            let first = at + drop;
            let ends = [first, first + rung.across[1]];
            if ends[0].fast_min(ends[1]).to_array().iter().any(|gap| *gap < reach) {
                let side = down * rung.along[1];
                for (end, gaps) in ends.iter().enumerate() {
                    let far = if end == 0 { [f64x2::ZERO; 2] } else { rung.across };
                    let (x, z) = ((far[0] + side).to_array(), (far[1] + drop).to_array());
                    for (lane, gap) in gaps.to_array().into_iter().enumerate() {
                        if gap < reach && rung.mass.as_array()[lane] > 0.0 {
                            let slot = 2 * end + lane;
                            self.corners[k][slot].place([x[lane], z[lane]], gap, self.grips[k][lane], law);
                            self.is_near[k][slot] = true;
                            self.near.push((k, slot));
                        }
                    }
                }
            }
            at = next(at, rung.across[1], k);
        }
        for &(rung, slot) in &self.near_before {
            if !self.is_near[rung][slot] {
                self.corners[rung][slot].open();
            }
        }
        !self.near.is_empty()
    }

    /// Gives the near corners their velocities before the step, with the root's reference point at `velocity` (cm/s).
    pub(super) fn begin(&mut self, rungs: &[Rung], velocity: [f64; 2], law: &Law) {
        let mut near = self.near.iter().peekable();
        let mut at = velocity.map(f64x2::splat);
        for (k, rung) in rungs.iter().enumerate() {
            let rate = rung.motion[0].to_array();
            let [x, z] = at.map(|v| v.to_array());
            while let Some(&(_, slot)) = near.next_if(|entry| entry.0 == k) {
                let corner = &mut self.corners[k][slot];
                let lane = slot % 2;
                corner.begin([x[lane] - rate[lane] * corner.arm[1], z[lane] + rate[lane] * corner.arm[0]], law);
            }
            at = [next(at[0], -rung.motion[0] * rung.across[1], k), next(at[1], rung.motion[0] * rung.across[0], k)];
        }
        self.mark();
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
