//! Where bodies and nodes are.

use fearless_simd::{Simd, dispatch, prelude::*};

use super::PlanarEngine;
use super::lanes::{Four, Lanes, fma};
use super::quad::direction;

impl PlanarEngine {
    /// Calls `read` with the links in their present pose instead of that of the last step's middle.
    pub(super) fn with_present_pose<T>(&mut self, read: impl FnOnce(&Self) -> T) -> T {
        for (quad, kept) in self.quads.iter_mut().zip(&mut self.scratch) {
            *kept = quad.along;
            quad.along = direction(quad.angle);
            dispatch!(self.level, simd => quad.lay(simd));
        }
        let result = read(self);
        for (quad, kept) in self.quads.iter_mut().zip(&self.scratch) {
            quad.along = *kept;
            dispatch!(self.level, simd => quad.lay(simd));
        }
        result
    }

    /// Position (cm) and velocity (cm/s) of the chain's left end, in the links' present pose.
    pub(super) fn left_end(&self) -> ([f64; 2], [f64; 2]) {
        let [mut position, mut velocity, _] = dispatch!(self.level, simd => self.root_motion(simd));
        // On the left arm the far ends are left ends.
        for i in (0..self.root).rev() {
            let [x, z] = [0, 1].map(|k| self.of_body(i, |quad| quad.across[k]));
            let rate = self.of_body(i, |quad| quad.motion[0]);
            position = [position[0] + x, position[1] + z];
            velocity = [velocity[0] - rate * z, velocity[1] + rate * x];
        }
        (position, velocity)
    }

    /// Vector of body `i` from its left end to its right end (cm).
    pub(super) fn body_vector(&self, i: usize) -> [f64; 2] {
        [0, 1].map(|k| self.lengths[i] * self.of_body(i, |quad| quad.along[k]))
    }

    /// The nodes' x and z (cm), at a small fraction of a step's cost: the links' directions are turned on from those of the last step's middle.
    #[inline(always)]
    pub(super) fn places_here<S: Simd>(&mut self, simd: S, nodes: &mut [[f64; 2]]) {
        let zero = Four::splat(simd, 0.0);
        let mut moment = [zero; 2];
        for (quad, vectors) in self.quads.iter().zip(&mut self.scratch) {
            let [x, z] = quad.along_now(simd);
            let (lever, reach) = (quad.lever.on(simd), quad.reach.on(simd));
            moment = [fma(lever, x, moment[0]), fma(lever, z, moment[1])];
            *vectors = [(reach * x).into(), (reach * z).into()];
        }
        let mut left = self.centre;
        if !self.clamped() {
            let [x, z] = moment;
            left = [left[0] - Lanes::from(x).sum(), left[1] - Lanes::from(z).sum()];
        }
        let step = |at: [f64; 2], lane: usize, of: &[Lanes; 2]| [at[0] + of[0].lane(lane), at[1] + of[1].lane(lane)];
        let mut right = step(left, 0, &self.scratch[0]);
        (nodes[self.root], nodes[self.root + 1]) = (left, right);
        // The far ends of the two bodies of each tree level, base to tip.
        for level in 1..self.levels {
            let (of, lane) = (&self.scratch[level / 2], 2 * (level % 2));
            if level <= self.root {
                left = step(left, lane, of);
                nodes[self.root - level] = left;
            }
            if self.root + level < self.count {
                right = step(right, lane + 1, of);
                nodes[self.root + level + 1] = right;
            }
        }
    }
}
