//! The articulated-body recursion in the plane.
//!
//! A spatial vector is (turn, x, z): of a motion (ω, v) of a body's reference point, of a force (moment about it, f). Turns count
//! anticlockwise.
//!
//! The chain hangs on its root: the first body if it is clamped, the one in the middle otherwise, so that two arms are walked side by side
//! and the processor works on both at once. A body's reference point is its end towards the root; the root's is its left end.

use super::contact::{Corner, Law};

/// Turn, x, z.
pub(super) type Spatial = [f64; 3];

/// One body: what stays and what the step at hand needs.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Link {
    pub(super) mass: f64,
    /// About the centre of mass (g·cm²).
    pub(super) inertia: f64,
    /// From the reference point to the other end (cm), negative on the left arm.
    pub(super) reach: f64,
    /// What spring and damper of the joint at the reference point add to that joint's inertia.
    pub(super) implicit: f64,
    /// Direction of the body, from its left end to its right one.
    pub(super) along: [f64; 2],
    /// Momentum (about the centre of mass) that the mean motion is to have, and the joint's part of it.
    pub(super) momentum: Spatial,
    pub(super) torque: f64,
    // Of the walk to the root: inertia·S, 1/D, the joint's own part.
    column: Spatial,
    inverse: f64,
    rest: f64,
    /// Mean motion of the reference point over the step.
    pub(super) mean: Spatial,
}

impl Link {
    /// A body of `length` and `mass` (g) and its joint; `side` is −1 on the left arm.
    pub(super) fn new(length: f64, side: f64, mass: f64, inertia: f64, implicit: f64) -> Self {
        Self { reach: side * length, mass, inertia, implicit, along: [1.0, 0.0], ..Self::default() }
    }

    /// The other end's velocity less the reference point's, for a unit turn.
    fn across(&self) -> [f64; 2] {
        [-self.reach * self.along[1], self.reach * self.along[0]]
    }

    /// Mean motion of the other end.
    fn mean_of_end(&self) -> Spatial {
        let [turn, x, z] = self.mean;
        let [wx, wz] = self.across();
        [turn, x + turn * wx, z + turn * wz]
    }

    /// Mean motion of the centre of mass.
    pub(super) fn mean_of_centre(&self) -> Spatial {
        let [turn, x, z] = self.mean;
        let [wx, wz] = self.across();
        let half = 0.5 * turn;
        [turn, x + half * wx, z + half * wz]
    }
}

/// Inertia (00, 01, 02, 11, 12, 22) and force at a point.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Articulated {
    pub(super) inertia: [f64; 6],
    pub(super) force: Spatial,
}

impl Articulated {
    /// Moves from a link's other end to its reference point and adds the link and its corners.
    #[inline(always)]
    fn take(&mut self, link: &Link, corners: &[Corner], law: &Law) {
        let [wx, wz] = link.across();
        let Self { inertia, force } = self;
        let [_, i01, i02, i11, i12, i22] = *inertia;
        let (bx, bz) = (i11 * wx + i12 * wz, i12 * wx + i22 * wz);
        // The body: its centre of mass lies half way.
        let (hx, hz) = (0.5 * wx, 0.5 * wz);
        inertia[0] += 2.0 * (wx * i01 + wz * i02) + wx * bx + wz * bz + link.inertia + link.mass * (hx * hx + hz * hz);
        inertia[1] += bx + link.mass * hx;
        inertia[2] += bz + link.mass * hz;
        inertia[3] += link.mass;
        inertia[5] += link.mass;
        let [turn, x, z] = link.momentum;
        force[0] += wx * force[1] + wz * force[2] + turn + hx * x + hz * z;
        force[1] += x;
        force[2] += z;
        for corner in corners {
            corner.add_to(self, law);
        }
    }

    /// What of it is felt through the joint at the link's reference point.
    #[inline(always)]
    fn through_joint(&mut self, link: &mut Link) {
        let Self { inertia, force } = self;
        let c = [inertia[0], inertia[1], inertia[2]];
        let inverse = 1.0 / (c[0] + link.implicit);
        let rest = link.torque + force[0];
        (link.column, link.inverse, link.rest) = (c, inverse, rest);
        // The products do not wait for the division.
        for k in 0..3 {
            force[k] -= c[k] * rest * inverse;
        }
        inertia[0] -= c[0] * c[0] * inverse;
        inertia[1] -= c[0] * c[1] * inverse;
        inertia[2] -= c[0] * c[2] * inverse;
        inertia[3] -= c[1] * c[1] * inverse;
        inertia[4] -= c[1] * c[2] * inverse;
        inertia[5] -= c[2] * c[2] * inverse;
    }

    /// The motion x of a free body: inertia · x = force. Translation is eliminated first, for a long chain's turn is badly conditioned.
    fn motion(&self) -> Spatial {
        let [i00, i01, i02, i11, i12, i22] = self.inertia;
        let [turn, x, z] = self.force;
        let a = 1.0 / i22;
        let (b, c) = (i12 * a, i02 * a);
        let d = 1.0 / (i11 - b * i12);
        let cross = i01 - b * i02;
        let e = cross * d;
        let pull = x - b * z;
        let spin = (turn - c * z - e * pull) / (i00 - c * i02 - e * cross);
        let along = d * pull - e * spin;
        [spin, along, a * z - b * along - c * spin]
    }
}

/// Motion of a link whose reference point moves with `base`.
#[inline(always)]
fn follow(link: &mut Link, base: Spatial) {
    let [turn, x, z] = base;
    let c = link.column;
    let rate = link.inverse * (link.rest - (c[0] * turn + c[1] * x + c[2] * z));
    link.mean = [turn + rate, x, z];
}

/// Mean motions u of the whole chain: (Σ Jᵀ M J + implicit + contact) u = Σ Jᵀ p + torques.
pub(super) fn solve(links: &mut [Link], root: usize, clamped: bool, corners: &[Corner], law: &Law) {
    let of = |i: usize| corners.get(2 * i..2 * i + 2).unwrap_or_default();
    let last = links.len() - 1;
    let (left, rest) = links.split_at_mut(root);
    let (base, right) = rest.split_first_mut().expect("the root is one of the links");
    let (mut from_left, mut from_right) = (Articulated::default(), Articulated::default());
    // Both arms in one loop: neither waits for the other.
    for k in 0..left.len().max(right.len()) {
        if let Some(link) = left.get_mut(k) {
            from_left.take(link, of(k), law);
            from_left.through_joint(link);
        }
        if let Some(link) = right.len().checked_sub(k + 1).and_then(|i| right.get_mut(i)) {
            from_right.take(link, of(last - k), law);
            from_right.through_joint(link);
        }
    }
    base.mean = if clamped {
        [0.0; 3]
    } else {
        from_right.take(base, of(root), law);
        for k in 0..6 {
            from_right.inertia[k] += from_left.inertia[k];
        }
        for k in 0..3 {
            from_right.force[k] += from_left.force[k];
        }
        from_right.motion()
    };
    let (mut to_left, mut to_right) = (base.mean, base.mean_of_end());
    for k in 0..left.len().max(right.len()) {
        if let Some(link) = left.len().checked_sub(k + 1).and_then(|i| left.get_mut(i)) {
            follow(link, to_left);
            to_left = link.mean_of_end();
        }
        if let Some(link) = right.get_mut(k) {
            follow(link, to_right);
            to_right = link.mean_of_end();
        }
    }
}
