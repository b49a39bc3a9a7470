//! Contact points, two in lanes: the bottom corners of the boxes, the law of contact, and its linear pieces, which the contact modes select.
//!
//! Per corner, with compliance R, velocity w, target w* and p = (w* − w)/R:
//!
//! ```text
//! Coulomb:   λ_n = max(p_n, 0),  λ_t = p_t limited to |λ_t| ≤ μ λ_n
//! convex:    λ = projection of p onto the cone |λ_t| ≤ μ λ_n
//! ```
//!
//! Both are piecewise linear with four pieces. The convex law is −1 times the gradient of the convex function R/2 |λ(w)|²; Coulomb's has no potential.

use wide::f64x2;

use super::lanes::fma;
use super::law::{ContactLaw, FrictionModel};
use super::quad::{Arms, Spatials};

/// Largest speed at which a penetration is pushed out (cm/s): so slow that the energy made is negligible.
const PUSH_OUT_SPEED: f64 = 0.01;
/// Penetrations below this (cm) stay: pushing them out against the robot's weight would gain energy.
const LEAST_DEPTH: f64 = 1e-5;
/// Approach speed (cm/s) below which nothing bounces, as in Bullet.
const LEAST_BOUNCE: f64 = 0.2;

/// Contact modes, one per linear piece of the law. A corner that slides forward is pushed backward: −[`PUSHED_FORWARD`].
pub(super) const OPEN: f64 = 0.0;
pub(super) const STICKS: f64 = 1.0;
pub(super) const PUSHED_FORWARD: f64 = 2.0;

/// The contact modes of two corners.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct ContactMode(f64x2);

impl ContactMode {
    #[inline(always)]
    fn new(sticks: f64x2, slides: f64x2, direction: f64x2) -> Self {
        Self((sticks & f64x2::ONE) | (slides & f64x2::splat(2.0).copysign(direction)))
    }

    /// These modes in the lanes of the mask `these`, open in the others.
    #[inline(always)]
    fn of(self, these: f64x2) -> Self {
        Self(self.0 & these)
    }

    #[inline(always)]
    fn sticks(self) -> f64x2 {
        self.0.simd_eq(f64x2::ONE)
    }

    #[inline(always)]
    fn slides(self) -> f64x2 {
        self.0.abs().simd_eq(f64x2::splat(2.0))
    }

    #[inline(always)]
    fn is_open(self) -> bool {
        !self.0.simd_ne(f64x2::ZERO).any()
    }

    /// As non-negative numbers for storing.
    pub(super) fn saved(self) -> [f64; 2] {
        self.0.to_array().map(|state| if state == -2.0 { 3.0 } else { state })
    }

    pub(super) fn restored(saved: [f64; 2]) -> Self {
        Self(f64x2::new(saved.map(|state| match state as u8 {
            1 => 1.0,
            2 => 2.0,
            3 => -2.0,
            _ => 0.0,
        })))
    }
}

/// Friction cones of two corners: coefficients μ, and what the law needs of them.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct FrictionCone {
    friction: f64x2,
    /// 1/(1 + μ²).
    share: f64x2,
    /// (μ, 1)/√(1 + μ²): direction of the impulse on a corner that is pushed forward.
    slide: [f64x2; 2],
}

impl FrictionCone {
    pub(super) fn new(friction: f64x2) -> Self {
        let share = f64x2::ONE / (f64x2::ONE + friction * friction);
        Self { friction, share, slide: [friction * share.sqrt(), share.sqrt()] }
    }

    pub(super) fn friction(&self) -> [f64; 2] {
        self.friction.to_array()
    }
}

/// The bottom corners of a tree level's two bodies: those at the bodies' reference points (the proximal ends), or those at the far ends.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Corners {
    /// From the bodies' reference points (cm).
    arm: [f64x2; 2],
    /// The last contact-detection pass that found a candidate among them, and the mask of candidates.
    pass: u64,
    near: f64x2,
    mode: ContactMode,
    /// The modes that the newest solution requires.
    required: ContactMode,
    cone: FrictionCone,
    /// Mean velocity w* that stops them on the floor at the step's end (cm/s).
    target: [f64x2; 2],
    /// Mean velocity of the iterate (cm/s).
    velocity: [f64x2; 2],
    /// Mean velocity of the newest solution, less the iterate's.
    step: [f64x2; 2],
    /// Impulse of the floor (dyn·s), times the weight.
    impulse: [f64x2; 2],
}

/// Kinematics of two contact candidates.
#[derive(Debug, Clone, Copy)]
pub(super) struct Candidates {
    /// From their bodies' reference points in the middle of the step (cm).
    pub(super) arm: [f64x2; 2],
    /// Above the floor (cm) in the middle of the step, if they go straight on.
    pub(super) gap: f64x2,
    /// Velocity at the start of the step (cm/s), and its change in half a step at constant rates.
    pub(super) velocity: [f64x2; 2],
    pub(super) curve: [f64x2; 2],
}

#[inline(always)]
fn dot(a: [f64x2; 2], b: [f64x2; 2]) -> f64x2 {
    fma(a[0], b[0], a[1] * b[1])
}

impl Corners {
    pub(super) fn new(cone: FrictionCone) -> Self {
        Self { cone, ..Self::default() }
    }

    /// Sets the friction.
    pub(super) fn set_cone(&mut self, cone: FrictionCone) {
        self.cone = cone;
    }

    /// Prepares the candidates of the mask `near` in detection pass `pass`: sets the mean velocity that stops them on the floor at the step's end. Modes are kept
    /// from the pass before.
    ///
    /// With velocity v at the start and v⁺ at the end, the mean velocity in the pose of the middle is w v⁺ + (1 − w) v + (1 − 2 w) curve.
    #[inline(always)]
    pub(super) fn place(&mut self, pass: u64, near: f64x2, candidates: &Candidates, law: &ContactLaw) {
        let Candidates { arm, gap, velocity: before, curve } = *candidates;
        let weight = f64x2::splat(law.weight);
        let ahead = gap * -law.per_ahead(gap, before[1]);
        let end = if law.frictionless {
            ahead
        } else {
            let deep = (-gap - f64x2::splat(LEAST_DEPTH)).fast_max(f64x2::ZERO);
            let out = (deep * f64x2::splat(law.push_out)).fast_min(f64x2::splat(PUSH_OUT_SPEED));
            gap.simd_gt(f64x2::ZERO).select(ahead, out)
        };
        self.mode = self.mode(pass - 1).of(near);
        self.pass = pass;
        self.near = near;
        self.arm = arm;
        let uneven = f64x2::ONE - weight - weight;
        self.target = [before[0] * (f64x2::ONE - weight), fma(weight, end - before[1], before[1])];
        (0..2).for_each(|k| self.target[k] = fma(uneven, curve[k], self.target[k]));
    }

    /// Restores stored modes.
    pub(super) fn restore(&mut self, mode: ContactMode, pass: u64) {
        (self.mode, self.pass) = (mode, pass);
        self.impulse = [f64x2::ZERO; 2];
    }

    /// Lets corners that reach the floor in this step leave it with the fraction `restitution` of their approach speed (cm/s).
    #[inline(always)]
    pub(super) fn bounce(&mut self, gap: f64x2, speed: f64x2, restitution: f64, law: &ContactLaw) {
        if restitution <= 0.0 {
            return;
        }
        let reach = fma(gap, law.per_ahead(gap, speed), speed).simd_le(f64x2::ZERO);
        let fast = speed.simd_lt(f64x2::splat(-LEAST_BOUNCE));
        let bounced = speed + f64x2::splat(law.weight) * (f64x2::splat(-restitution) * speed - speed);
        self.target[1] = (reach & fast).select(bounced, self.target[1]);
    }

    /// True if both are open.
    #[inline(always)]
    pub(super) fn is_open(&self) -> bool {
        self.mode.is_open()
    }

    /// Mask of the open ones.
    #[inline(always)]
    pub(super) fn open(&self) -> f64x2 {
        self.mode.0.simd_eq(f64x2::ZERO)
    }

    /// The modes as of detection pass `pass`.
    pub(super) fn mode(&self, pass: u64) -> ContactMode {
        if self.pass == pass { self.mode } else { ContactMode::default() }
    }

    /// Impulses of the floor over the step (dyn·s) as of detection pass `pass`.
    pub(super) fn impulses(&self, pass: u64, law: &ContactLaw) -> [f64x2; 2] {
        if self.pass == pass { self.impulse.map(|part| part / f64x2::splat(law.weight)) } else { [f64x2::ZERO; 2] }
    }

    /// The law: modes and impulses at the mean velocities `v`.
    #[inline(always)]
    fn law(&self, v: [f64x2; 2], law: &ContactLaw) -> (ContactMode, [f64x2; 2]) {
        let stiffness = f64x2::splat(law.stiffness);
        let pull = [(self.target[0] - v[0]) * stiffness, (self.target[1] - v[1]) * stiffness];
        let mu = self.cone.friction;
        let sideways = pull[0].abs();
        let coulomb = law.friction == FrictionModel::Coulomb;
        let pressed = if coulomb { pull[1] } else { fma(mu, sideways, pull[1]) };
        let touches = pressed.simd_gt(f64x2::ZERO) & self.near;
        if !touches.any() {
            // The most frequent case.
            return Default::default();
        }
        let sticks = sideways.simd_le(mu * pull[1]) & touches;
        let slides = touches & !sticks;
        let normal = if coulomb { pressed } else { pressed * self.cone.share };
        let push = (mu * normal).copysign(pull[0]);
        let impulse = [(sticks & pull[0]) | (slides & push), (sticks & pull[1]) | (slides & normal)];
        (ContactMode::new(sticks, slides, pull[0]), impulse)
    }

    /// Direction of the impulses of sliding corners.
    #[inline(always)]
    fn slide(&self, mode: ContactMode) -> [f64x2; 2] {
        [self.cone.slide[0].copysign(mode.0), self.cone.slide[1]]
    }

    /// aᵀ (−dλ/dw) b on the mode's piece of the law: stiffness times nothing, everything, or the part along the slide.
    #[inline(always)]
    fn product(&self, mode: ContactMode, a: [f64x2; 2], b: [f64x2; 2], law: &ContactLaw) -> f64x2 {
        let d = self.slide(mode);
        let along = dot(a, d) * dot(b, d);
        f64x2::splat(law.stiffness) * ((mode.sticks() & dot(a, b)) | (mode.slides() & along))
    }

    /// Adds the corners' terms to their bodies' inertia and force.
    #[inline(always)]
    pub(super) fn add_to(&self, bodies: &mut Arms, law: &ContactLaw) {
        let stiffness = f64x2::splat(law.stiffness);
        let [ax, az] = self.arm;
        let [tx, tz] = self.target;
        let Arms { inertia, lower, force } = bodies;
        let sticks = self.mode.sticks();
        if sticks.any() {
            let k = sticks & stiffness;
            inertia[0] = fma(k, dot([ax, az], [ax, az]), inertia[0]);
            inertia[1] = fma(-k, az, inertia[1]);
            inertia[2] = fma(k, ax, inertia[2]);
            inertia[3] += k;
            inertia[5] += k;
            lower[0] = fma(-k, az, lower[0]);
            lower[1] = fma(k, ax, lower[1]);
            force[0] = fma(k, fma(ax, tz, -(az * tx)), force[0]);
            force[1] = fma(k, tx, force[1]);
            force[2] = fma(k, tz, force[2]);
        }
        let slides = self.mode.slides();
        if slides.any() && law.friction == FrictionModel::Coulomb {
            // The impulse (±μ, 1) λ_n, with λ_n by the velocity across the floor alone.
            let k = slides & stiffness;
            let along = self.cone.friction.copysign(self.mode.0);
            let by = [fma(-az, along, ax), along, f64x2::ONE].map(|part| k * part);
            inertia[0] = fma(by[0], ax, inertia[0]);
            inertia[2] += by[0];
            inertia[4] += by[1];
            inertia[5] += by[2];
            lower[0] = fma(by[1], ax, lower[0]);
            lower[1] = fma(by[2], ax, lower[1]);
            for i in 0..3 {
                force[i] = fma(by[i], tz, force[i]);
            }
        } else if slides.any() {
            let k = slides & stiffness;
            let [dx, dz] = self.slide(self.mode);
            // Velocity of the corner along d is row · (ω, v).
            let row = [fma(dz, ax, -(dx * az)), dx, dz];
            let stiff = row.map(|part| k * part);
            let wanted = dot([dx, dz], [tx, tz]);
            for (k, [i, j]) in [[0, 0], [0, 1], [0, 2], [1, 1], [1, 2], [2, 2]].into_iter().enumerate() {
                inertia[k] = fma(stiff[i], row[j], inertia[k]);
            }
            for i in 0..3 {
                force[i] = fma(stiff[i], wanted, force[i]);
            }
        }
    }

    #[inline(always)]
    fn velocity_in(&self, mean: &Spatials) -> [f64x2; 2] {
        [fma(-mean[0], self.arm[1], mean[1]), fma(mean[0], self.arm[0], mean[2])]
    }

    /// Evaluates the law at the bodies' motion `mean`; true if it requires the modes that `mean` was solved with.
    #[inline(always)]
    pub(super) fn agrees(&mut self, mean: &Spatials, law: &ContactLaw) -> bool {
        (self.required, self.impulse) = self.law(self.velocity_in(mean), law);
        self.modes_agree()
    }

    fn modes_agree(&self) -> bool {
        !self.required.0.simd_ne(self.mode.0).any()
    }

    /// Largest difference (dyn·s) between the impulses that `mean` was solved with and the law's. After [`agrees`](Self::agrees) for the same `mean`.
    pub(super) fn mismatch(&self, mean: &Spatials, law: &ContactLaw) -> f64 {
        let v = self.velocity_in(mean);
        let stiffness = f64x2::splat(law.stiffness);
        let pull = [(self.target[0] - v[0]) * stiffness, (self.target[1] - v[1]) * stiffness];
        let (sticks, slides) = (self.mode.sticks(), self.mode.slides());
        let push = (self.cone.friction * pull[1]).copysign(self.mode.0);
        let piece = [(sticks & pull[0]) | (slides & push), (sticks | slides) & pull[1]];
        (0..2).flat_map(|k| (piece[k] - self.impulse[k]).abs().to_array()).fold(0.0, f64::max)
    }

    /// The largest part of the law's impulses (dyn·s).
    pub(super) fn largest_impulse(&self) -> f64 {
        self.impulse.iter().flat_map(|part| part.abs().to_array()).fold(0.0, f64::max)
    }

    /// Excess velocity w − w* (cm/s).
    #[inline(always)]
    pub(super) fn excess(&self, mean: &Spatials) -> [f64x2; 2] {
        let v = self.velocity_in(mean);
        [v[0] - self.target[0], v[1] - self.target[1]]
    }

    /// Arm (cm) and coefficient of friction of the corner in a lane, if it is a candidate.
    pub(super) fn near(&self, lane: usize) -> Option<([f64; 2], f64)> {
        let is_near = self.near.to_array()[lane].to_bits() != 0;
        is_near.then(|| (self.arm.map(|part| part.to_array()[lane]), self.cone.friction.to_array()[lane]))
    }

    /// The modes.
    pub(super) fn modes(&self) -> [f64; 2] {
        self.mode.0.to_array()
    }

    /// True for the corners whose mode the newest solution keeps.
    pub(super) fn agree(&self) -> [bool; 2] {
        let (required, modes) = (self.required.0.to_array(), self.modes());
        [0, 1].map(|lane| required[lane] == modes[lane])
    }

    /// Sets the modes.
    #[inline(always)]
    pub(super) fn set_modes(&mut self, modes: [f64; 2]) {
        self.mode = ContactMode(f64x2::new(modes));
    }

    /// True if one of them slides.
    #[inline(always)]
    pub(super) fn slides(&self) -> bool {
        self.mode.slides().any()
    }

    /// Makes `mean` the iterate. After [`agrees`](Self::agrees) for the same `mean`.
    #[inline(always)]
    pub(super) fn accept(&mut self, mean: &Spatials) {
        self.velocity = self.velocity_in(mean);
        self.mode = self.required;
    }

    /// Takes the modes that the newest solution requires, under Coulomb's law. A corner whose sliding would reverse sticks first: the piece in between is so
    /// narrow that Newton's method would step over it.
    #[inline(always)]
    pub(super) fn adopt_required_modes(&mut self) {
        let turned = self.required.slides() & self.required.0.simd_eq(-self.mode.0);
        self.mode = ContactMode(turned.select(f64x2::ONE, self.required.0));
    }

    /// Prepares a line search from the iterate to `mean`. After [`agrees`](Self::agrees) for the same `mean`.
    ///
    /// Returns, for corners whose mode changes: the impulse along the search direction at the search's end, if the corners kept the iterate's modes, and by how
    /// much it fell since its start. Other corners stay on one linear piece, for the pieces are convex.
    #[inline(always)]
    pub(super) fn aim(&mut self, mean: &Spatials, law: &ContactLaw) -> Option<[f64; 2]> {
        let to = self.velocity_in(mean);
        self.step = [to[0] - self.velocity[0], to[1] - self.velocity[1]];
        if self.modes_agree() {
            return None;
        }
        let left = [self.target[0] - to[0], self.target[1] - to[1]];
        Some([left, self.step].map(|of| self.product(self.mode, of, self.step, law).reduce_add()))
    }

    /// Velocity at the fraction `t` of the line search (cm/s).
    #[inline(always)]
    fn velocity_at(&self, t: f64) -> [f64x2; 2] {
        let t = f64x2::splat(t);
        [fma(t, self.step[0], self.velocity[0]), fma(t, self.step[1], self.velocity[1])]
    }

    /// impulse·step and its slope at the fraction `t` of the line search.
    #[inline(always)]
    pub(super) fn search(&self, t: f64, law: &ContactLaw) -> [f64x2; 2] {
        let (mode, impulse) = self.law(self.velocity_at(t), law);
        [dot(impulse, self.step), -self.product(mode, self.step, self.step, law)]
    }

    /// Moves the iterate by the fraction `t` of the line search.
    #[inline(always)]
    pub(super) fn go(&mut self, t: f64, law: &ContactLaw) {
        self.velocity = self.velocity_at(t);
        (self.mode, self.impulse) = self.law(self.velocity, law);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A line search accounts for corners whose mode changes between two velocities. The others must be linear in between.
    #[test]
    fn corners_that_keep_their_mode_are_linear_along_a_search() {
        let law = ContactLaw::new(1e-4, 0.5, 1.0, FrictionModel::Convex);
        let near = f64x2::ZERO.simd_eq(f64x2::ZERO);
        let start = Corners { near, ..Corners::new(FrictionCone::new(f64x2::splat(0.5))) };
        let (mut stay, mut change) = (0, 0);
        // Velocities about the tip of the law's cones: sticking, sliding both ways, open.
        let around = |k: i32| [f64::from(k % 5) - 2.0, f64::from(k / 5) - 2.0].map(|part| f64x2::new([part, 0.4 * part - 0.1]));
        for (from, to) in (0..25).flat_map(|from| (0..25).map(move |to| (from, to))) {
            let mut corners = start;
            let still = |v: [f64x2; 2]| [f64x2::ZERO, v[0], v[1]];
            corners.agrees(&still(around(from)), &law);
            corners.accept(&still(around(from)));
            corners.agrees(&still(around(to)), &law);
            let told = corners.aim(&still(around(to)), &law);
            let along = [0.0, 0.3, 1.0].map(|t| corners.search(t, &law)[0].reduce_add());
            // Of rounding: velocities and ways are of order one.
            let same = |a: f64, b: f64| assert!((a - b).abs() <= 1e-14 * law.stiffness, "{from} {to}: {a} {b}");
            if let Some([end, fall]) = told {
                change += 1;
                same(along[0], end + fall);
            } else {
                stay += 1;
                let fall = -corners.search(0.3, &law)[1].reduce_add();
                same(along[0] - along[1], 0.3 * fall);
                same(along[0] - along[2], fall);
            }
        }
        assert!(stay > 50 && change > 50, "{stay} {change}");
    }

    /// |0| ≤ 0 · (−1) must not hold a corner down that leaves a floor without friction.
    #[test]
    fn a_corner_that_leaves_the_floor_is_not_held() {
        let near = f64x2::ZERO.simd_eq(f64x2::ZERO);
        for friction in [0.0, 0.5] {
            let corners = Corners { near, ..Corners::new(FrictionCone::new(f64x2::splat(friction))) };
            let (mode, impulse) = corners.law([f64x2::ZERO, f64x2::ONE], &ContactLaw::new(1e-4, 0.5, 1.0, FrictionModel::Convex));
            assert_eq!((mode.0.to_array(), impulse.map(f64x2::to_array)), ([0.0; 2], [[0.0; 2]; 2]), "{friction}");
        }
    }
}
