//! Where the nodes are, at a small share of a step's cost.

use fearless_simd::{Simd, prelude::*};

use super::PlanarEngine;
use super::lanes::{Four, Lanes, fma};

impl PlanarEngine {
    /// The nodes' x and z (cm). The links' directions are turned on from the middle of the last step, whose directions are known.
    #[inline(always)]
    pub(super) fn places_here<S: Simd>(&mut self, simd: S, nodes: &mut [[f64; 2]]) {
        let zero = Four::splat(simd, 0.0);
        let mut moment = [zero; 2];
        for (quad, vectors) in self.quads.iter().zip(&mut self.kept) {
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
        let mut right = step(left, 0, &self.kept[0]);
        (nodes[self.root], nodes[self.root + 1]) = (left, right);
        // Outwards from the root on both sides: the far ends of the two bodies of each tree level.
        for level in 1..self.levels {
            let (of, lane) = (&self.kept[level / 2], 2 * (level % 2));
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
