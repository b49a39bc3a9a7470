//! Joint torques beyond eq. 1 (softening, dry friction, curves of deviation and rate, springs with a limit, a generalised Maxwell or Prony chain),
//! and drag in air.
//!
//! The step stays one problem that is linear in the mean rates u: a joint's extra torque e is put as e* − s (u − u*), about the rate u* of the
//! step before. For softening, curves and springs with a limit s is the tangent, which errs by the square of what changes in a step. For dry friction,
//! τ_c tanh(u/ω), the step is repeated with the new u until nothing changes: with the tangent at u (Newton), or at rest where u has changed its sign, since
//! from there Newton's method goes up to the solution without passing it. Where joints hinder each other in that, after [`NEWTON`] repetitions, the secant
//! −e*/u* takes over, whose quadratic potential majorises that of friction, so that a repetition can only lower the cost. The Prony chain is linear and
//! exact over a step.

use wide::f64x2;

use super::lanes::Lanes;
use super::quad::Quad;
use crate::engine::GAUSS;
use crate::model::{
    AIR_DENSITY, DRAG_SPEED, DRY_FRICTION_RATE, Extensions, LEAST_DRAG_RATIO, LEAST_STIFFNESS, LOSS_TIMES, SOFTENING_CURVATURE,
};

/// Repetitions end when no friction torque changes by more than this fraction of its moment; after `LARGEST_REPETITIONS` they fail.
const FRICTION_ENOUGH: f64 = 1e-3;
/// Repetitions by Newton's method.
const NEWTON: u32 = 20;
pub(super) const LARGEST_REPETITIONS: u32 = 200;

/// Extra torques of one robot, with their memory.
#[derive(Debug, Clone)]
pub(super) struct JointExtensions {
    extensions: Extensions,
    /// Length of sheet that a joint stands for (cm).
    link: f64,
    softening: f64,
    /// Square of the clamp's hardening (1/rad²).
    hardening: f64,
    /// Mean rate of the root in the last step where the clamp hardens (rad/s).
    root_rate: f64,
    /// Largest moment of friction and of the curve of the rate (dyn·cm).
    friction: f64,
    /// Moment of dry friction in this step (dyn·cm).
    dry: Vec<Lanes>,
    /// Per unit of the Prony chain: remainder after a step, gain per rate, and the means of both over the step.
    prony: [[f64; 4]; LOSS_TIMES.len()],
    half_step: f64,
    /// Width of the sheet (cm).
    width: f64,
    /// Implicit terms of the plain joints.
    implicit: Vec<Lanes>,
    /// Torque terms of the plain joints in this step.
    torque: Vec<Lanes>,
    /// 1 where there is a joint.
    joint: Vec<Lanes>,
    /// Mean rates of the joints in the last step (rad/s), and the moment against them with its derivative.
    rates: Vec<Lanes>,
    resisting: Vec<[Lanes; 2]>,
    /// The derivative at rest.
    at_rest_slope: Vec<Lanes>,
    /// Slope s and constant part e* + s u* of friction in the last repetition.
    friction_put: Vec<[Lanes; 2]>,
    /// 1 for joints whose rate changed its sign in the last repetition.
    turned: Vec<Lanes>,
    /// Repetitions of this step.
    repetitions: u32,
    /// q_j of the Prony chain (rad).
    memory: Vec<[Lanes; LOSS_TIMES.len()]>,
    /// Elastic angles of the springs with a limit (rad), quads × springs.
    slips: Vec<Lanes>,
}

impl JointExtensions {
    /// `None` for the plain model.
    pub(super) fn new(extensions: &Extensions, width: f64, link: f64, step: f64, quads: &[Quad]) -> Option<Box<Self>> {
        let hardening = extensions.clamp_hardening.powi(2);
        if !extensions.bends_torque_law() && !extensions.has_drag() && hardening == 0.0 {
            return None;
        }
        let count = quads.len();
        let joint = quads.iter().enumerate().map(|(k, quad)| {
            // The root, in the first lane, has none.
            let there = |lane: usize| if k + lane > 0 && quad.mass.lane(lane) > 0.0 { 1.0 } else { 0.0 };
            Lanes::new(std::array::from_fn(there))
        });
        let mut new = Self {
            softening: extensions.softening / (link * link),
            hardening,
            root_rate: 0.0,
            friction: extensions.dry_friction + extensions.moment_of_rate.largest(),
            dry: vec![Lanes::splat(extensions.dry_friction); count],
            prony: prony(step),
            half_step: 0.5 * step,
            width,
            implicit: quads.iter().map(|quad| quad.implicit).collect(),
            torque: vec![Lanes::ZERO; count],
            joint: joint.collect(),
            rates: vec![Lanes::ZERO; count],
            resisting: vec![[Lanes::ZERO; 2]; count],
            at_rest_slope: vec![Lanes::ZERO; count],
            friction_put: vec![[Lanes::ZERO; 2]; count],
            turned: vec![Lanes::ZERO; count],
            repetitions: 0,
            memory: vec![Default::default(); count],
            slips: vec![Lanes::ZERO; count * extensions.slips.len()],
            extensions: extensions.clone(),
            link,
        };
        new.resist();
        Some(Box::new(new))
    }

    /// Sets the moments against the present rates, and their derivatives at rest.
    #[inline(always)]
    fn resist(&mut self) {
        if self.friction == 0.0 {
            return;
        }
        for k in 0..self.rates.len() {
            self.resisting[k] = self.resisting_at(k, self.dry[k], self.rates[k]);
            self.at_rest_slope[k] = self.resisting_with(k, self.dry[k], Lanes::ZERO, Lanes::ZERO)[1];
        }
    }

    /// Sets the moments of dry friction for a step, which depend on the angles in its middle by the last rates.
    #[inline(always)]
    fn set_dry_friction(&mut self, quads: &[Quad]) {
        let half = Lanes::splat(self.half_step);
        let mut before = f64x2::ZERO;
        let mut largest = 0.0_f64;
        for (k, quad) in quads.iter().enumerate() {
            let angle = quad.angle - quad.angle.inner(before);
            before = quad.angle.level(1);
            self.dry[k] = self.dry_moment(k, quad, angle + half * self.rates[k]);
            largest = self.dry[k].to_array().into_iter().fold(largest, f64::max);
        }
        self.friction = largest + self.extensions.moment_of_rate.largest();
        self.resist();
    }

    /// Moment of dry friction (dyn·cm) at the angles of quad `k`'s joints.
    fn dry_moment(&self, k: usize, quad: &Quad, angle: Lanes) -> Lanes {
        if !self.extensions.has_friction_of_bending() {
            return Lanes::splat(self.extensions.dry_friction);
        }
        let of = |lane: usize| [self.extensions.dry_moment(quad.stiffness.lane(lane), self.link, angle.lane(lane)), 0.0];
        self.of_joints(k, of)[0]
    }

    /// Moment against the rates (rad/s) of quad `k`'s joints, and its derivative, for moments of dry friction `dry`.
    #[inline(always)]
    fn resisting_at(&self, k: usize, dry: Lanes, rate: Lanes) -> [Lanes; 2] {
        let share = if self.is_repeated() { (Lanes::splat(1.0 / DRY_FRICTION_RATE) * rate).tanh() } else { Lanes::ZERO };
        self.resisting_with(k, dry, rate, share)
    }

    /// [`resisting_at`](Self::resisting_at) for a known `share` of the dry friction, 0 at rest.
    #[inline(always)]
    fn resisting_with(&self, k: usize, dry: Lanes, rate: Lanes, share: Lanes) -> [Lanes; 2] {
        // As `Extensions::friction`.
        let moment_of_rate = &self.extensions.moment_of_rate;
        let moment = dry * share;
        let slope = Lanes::splat(1.0 / DRY_FRICTION_RATE) * dry * (Lanes::splat(1.0) - share * share);
        if moment_of_rate.is_zero() {
            return [moment, slope].map(|of| self.joint[k] * of);
        }
        let [more, steeper] = self.of_joints(k, |lane| {
            let [moment, slope] = moment_of_rate.at(sense(lane) * rate.lane(lane) / self.link);
            [sense(lane) * moment, slope / self.link]
        });
        [self.joint[k] * moment + more, self.joint[k] * slope + steeper]
    }

    pub(super) fn set_time_step(&mut self, step: f64, quads: &[Quad]) {
        self.half_step = 0.5 * step;
        if self.extensions.has_loss() {
            self.prony = prony(step);
        }
        self.implicit.iter_mut().zip(quads).for_each(|(implicit, quad)| *implicit = quad.implicit);
    }

    pub(super) fn is_repeated(&self) -> bool {
        self.extensions.has_dry_friction()
    }

    /// Whether the torque depends on the elastic deviation alone.
    fn is_elastic(&self) -> bool {
        self.softening != 0.0 || !self.extensions.moment_of_curvature.is_zero()
    }

    /// Two numbers of each joint of quad `k`; 0 where there is none.
    fn of_joints(&self, k: usize, of: impl Fn(usize) -> [f64; 2]) -> [Lanes; 2] {
        let of: [[f64; 2]; 4] = std::array::from_fn(|lane| if self.joint[k].lane(lane) > 0.0 { of(lane) } else { [0.0; 2] });
        [0, 1].map(|number| Lanes::new(of.map(|numbers| numbers[number])))
    }

    /// Elastic torque of softening and of the curve of the deviation, and its slope, at the elastic angle δ of quad `k`.
    fn elastic(&self, k: usize, quad: &Quad, delta: Lanes) -> (Lanes, Lanes) {
        let (mut torque, mut slope) = (Lanes::ZERO, Lanes::ZERO);
        if self.softening != 0.0 {
            // As `Extensions::softened`.
            let most = Lanes::splat(1.0 - LEAST_STIFFNESS);
            let exponent = self.extensions.softening_exponent;
            let power = match exponent {
                2.0 => delta * delta,
                _ => {
                    let unit = self.link * SOFTENING_CURVATURE;
                    let relative = (Lanes::splat(1.0 / unit) * delta.abs()).at_least(f64::MIN_POSITIVE);
                    Lanes::splat(unit * unit) * relative.powf(exponent)
                }
            };
            let share = Lanes::splat(self.softening) * power;
            let is_free = most - share;
            let stiffness = self.joint[k] * quad.stiffness;
            torque = stiffness * share.where_positive(is_free, most) * delta;
            slope = stiffness * (Lanes::splat(exponent + 1.0) * share).where_positive(is_free, most);
        }
        let curve = &self.extensions.moment_of_curvature;
        if !curve.is_zero() {
            // Joints that point to the left turn the other way.
            let [moment, tangent] = self.of_joints(k, |lane| {
                let sign = sense(lane);
                let [moment, tangent] = curve.at(sign * delta.lane(lane) / self.link);
                [sign * moment, tangent / self.link]
            });
            torque += -moment;
            slope += -tangent;
        }
        (torque, slope)
    }

    /// Torque of the clamp's hardening, and its slope, at the root's angle.
    fn clamp(&self, root: &Quad, angle: f64) -> [f64; 2] {
        let per_angle = -root.stiffness.lane(0) * self.hardening * angle * angle;
        [per_angle * angle, 3.0 * per_angle]
    }

    /// Slope of a hardening clamp's moment against the root's angle (dyn·cm/rad); none for other quads and clamps.
    pub(super) fn clamp_stiffness(&self, k: usize, quad: &Quad) -> Option<f64> {
        let hardens = self.hardening != 0.0 && k == 0;
        hardens.then(|| quad.stiffness.lane(0) - self.clamp(quad, quad.angle.lane(0))[1])
    }

    /// Extra torques (dyn·cm) of joints at rest, for statics, in the sense of rotation from the root outwards.
    pub(super) fn at_rest(&self, k: usize, quad: &Quad, delta: Lanes) -> Lanes {
        let mut torque = if self.is_elastic() { self.elastic(k, quad, delta).0 } else { Lanes::ZERO };
        if self.hardening != 0.0 && k == 0 {
            torque.set_lane(0, self.clamp(quad, delta.lane(0))[0]);
        }
        torque
    }

    /// Extra torques (dyn·cm) at elastic angle (rad) and rate (rad/s), for records, in the same sense.
    pub(super) fn now(&self, k: usize, quad: &Quad, delta: Lanes, rate: Lanes) -> Lanes {
        let [friction, _] = self.resisting_at(k, self.dry_moment(k, quad, delta + quad.rest_angle), rate);
        let stored = self.memory[k].iter().zip(&self.extensions.loss);
        let stored = stored.fold(Lanes::ZERO, |sum, (q, share)| sum + Lanes::splat(*share) * *q);
        let slips = self.slips_of(k).fold(Lanes::ZERO, |sum, (elastic, [per_angle, _])| sum + Lanes::splat(per_angle) * *elastic);
        self.at_rest(k, quad, delta) - (friction + self.joint[k] * slips) - quad.stiffness * stored
    }

    /// Elastic angles of the springs with a limit of quad `k`, each with its stiffness (dyn·cm/rad) and its limit (rad).
    fn slips_of(&self, k: usize) -> impl Iterator<Item = (&Lanes, [f64; 2])> {
        let slips = &self.extensions.slips;
        let own = &self.slips[k * slips.len()..(k + 1) * slips.len()];
        own.iter().zip(slips).map(|(elastic, slip)| {
            let limit = slip.curvature * self.link;
            (elastic, [slip.moment / limit, limit])
        })
    }

    /// Begins a step: stores the plain model's torques.
    #[inline(always)]
    pub(super) fn begin(&mut self, quads: &[Quad]) {
        for (torque, quad) in self.torque.iter_mut().zip(quads) {
            *torque = quad.torque;
        }
        self.turned.fill(Lanes::ZERO);
        self.repetitions = 0;
        if self.extensions.has_friction_of_bending() {
            self.set_dry_friction(quads);
        }
    }

    /// Slope s and constant part e* + s u* of friction about the last rates of quad `k`'s joints.
    #[inline(always)]
    fn friction(&self, k: usize) -> [Lanes; 2] {
        let ([moment, slope], rate) = (self.resisting[k], self.rates[k]);
        // A curve of the rate alone is smooth.
        if self.repetitions < NEWTON || !self.is_repeated() {
            // A curve of the rate is 0 at rest, too.
            let turned = Lanes::splat(0.5) - self.turned[k];
            return [
                slope.where_positive(turned, self.at_rest_slope[k]),
                (slope * rate - moment).where_positive(turned, Lanes::ZERO),
            ];
        }
        let moves = rate.abs() - Lanes::splat(1e-6 * DRY_FRICTION_RATE);
        [(moment / rate).where_positive(moves, slope), Lanes::ZERO]
    }

    /// Adds the extra torques, linearised about the last rates, to the joints: their impulses over `share` (s).
    #[inline(always)]
    pub(super) fn load(&mut self, quads: &mut [Quad], share: f64) {
        let share = Lanes::splat(share);
        let half = Lanes::splat(self.half_step);
        let mut before = f64x2::ZERO;
        for (k, quad) in quads.iter_mut().enumerate() {
            let (rate, joint) = (self.rates[k], self.joint[k]);
            let stiffness = joint * quad.stiffness;
            let (mut torque, mut slope) = (Lanes::ZERO, Lanes::ZERO);
            if self.is_elastic() {
                let delta = quad.angle - quad.angle.inner(before) - quad.rest_angle;
                let (elastic, tangent) = self.elastic(k, quad, delta + half * rate);
                torque += elastic - half * tangent * rate;
                slope += -(half * tangent);
            }
            if self.hardening != 0.0 && k == 0 {
                let [clamp, tangent] = self.clamp(quad, quad.angle.lane(0) + self.half_step * self.root_rate);
                torque.set_lane(0, clamp - self.half_step * tangent * self.root_rate);
                slope.set_lane(0, -self.half_step * tangent);
            }
            for (elastic, [per_angle, limit]) in self.slips_of(k) {
                let middle = *elastic + half * rate;
                let held = middle.map(|angle| if angle.abs() < limit { per_angle } else { 0.0 });
                torque += joint * (half * held * rate - Lanes::splat(per_angle) * middle.map(|angle| angle.clamp(-limit, limit)));
                slope += joint * (half * held);
            }
            if self.friction != 0.0 {
                let [tangent, rest] = self.friction(k);
                self.friction_put[k] = [tangent, rest];
                slope += tangent;
                torque += rest;
            }
            if self.extensions.has_loss() {
                for (([_, _, kept, added], q), share) in self.prony.iter().zip(&self.memory[k]).zip(&self.extensions.loss) {
                    let stiffness = stiffness * Lanes::splat(*share);
                    torque += -(stiffness * Lanes::splat(*kept) * *q);
                    slope += stiffness * Lanes::splat(*added);
                }
            }
            quad.torque = self.torque[k] + share * torque;
            quad.implicit = self.implicit[k] + share * slope;
            before = quad.angle.level(1);
        }
    }

    /// Takes the joints' mean rates of a solution; true if the linearised friction agrees with the law there.
    #[inline(always)]
    pub(super) fn accept(&mut self, quads: &[Quad]) -> bool {
        let mut before = f64x2::ZERO;
        let mut changed = 0.0_f64;
        if self.hardening != 0.0 {
            self.root_rate = quads[0].mean[0].lane(0);
        }
        for (k, quad) in quads.iter().enumerate() {
            let rate = self.joint[k] * (quad.mean[0] - quad.mean[0].inner(before));
            before = quad.mean[0].level(1);
            if self.friction != 0.0 {
                let [slope, rest] = self.friction_put[k];
                let resisting = self.resisting_at(k, self.dry[k], rate);
                let missed = (slope * rate - rest - resisting[0]).abs();
                changed = missed.to_array().into_iter().fold(changed, f64::max);
                self.turned[k] = Lanes::splat(1.0).where_positive(-(rate * self.rates[k]), Lanes::ZERO);
                self.resisting[k] = resisting;
            }
            self.rates[k] = rate;
        }
        self.repetitions += 1;
        changed <= FRICTION_ENOUGH * self.friction
    }

    /// Ends a step: advances the memory.
    #[inline(always)]
    pub(super) fn end(&mut self) {
        if self.extensions.has_loss() {
            for (memory, rate) in self.memory.iter_mut().zip(&self.rates) {
                for (q, [left, added, ..]) in memory.iter_mut().zip(&self.prony) {
                    *q = Lanes::splat(*left) * *q + Lanes::splat(*added) * *rate;
                }
            }
        }
        let slips = &self.extensions.slips;
        let step = Lanes::splat(2.0 * self.half_step);
        for (own, rate) in self.slips.chunks_exact_mut(slips.len().max(1)).zip(&self.rates) {
            for (elastic, slip) in own.iter_mut().zip(slips) {
                let limit = slip.curvature * self.link;
                *elastic = (*elastic + step * *rate).map(|angle| angle.clamp(-limit, limit));
            }
        }
    }

    /// Drag on the bodies: moment about the centre of mass (dyn·cm) and force (dyn).
    #[inline(always)]
    pub(super) fn drag(&self, quad: &Quad) -> [Lanes; 3] {
        let [rate, x, z] = quad.motion;
        let normal = [-quad.along[1], quad.along[0]];
        let speed = x * normal[0] + z * normal[1];
        let Extensions { drag: [linear, quadratic, cubic], drag_of_power: [coefficient, power], .. } = self.extensions;
        let [linear, quadratic, cubic] = [linear, quadratic, cubic].map(Lanes::splat);
        let whole = Lanes::splat(-0.5 * 0.5 * AIR_DENSITY * self.width * DRAG_SPEED) * quad.reach.abs();
        let (mut force, mut moment) = (Lanes::ZERO, Lanes::ZERO);
        for (at, weight) in GAUSS {
            let arm = (Lanes::splat(0.5 + 0.5 * at) - quad.middle) * quad.reach;
            let speed = speed + rate * arm;
            // As `Extensions::drag_per_speed`.
            let ratio = Lanes::splat(1.0 / DRAG_SPEED) * speed.abs();
            let mut per_speed = linear + ratio * (quadratic + ratio * cubic);
            if coefficient != 0.0 {
                per_speed += Lanes::splat(coefficient) * ratio.at_least(LEAST_DRAG_RATIO).powf(power - 1.0);
            }
            let part = Lanes::splat(weight) * whole * per_speed * speed;
            force += part;
            moment += part * arm;
        }
        [moment, force * normal[0], force * normal[1]]
    }

    pub(super) fn has_drag(&self) -> bool {
        self.extensions.has_drag()
    }

    /// Rates and memory as numbers for storing.
    pub(super) fn saved(&self) -> impl Iterator<Item = f64> + '_ {
        let memory = self.memory.iter().flatten();
        let of_lanes = self.rates.iter().chain(memory).chain(&self.slips).flat_map(|lanes| lanes.to_array());
        of_lanes.chain((self.hardening != 0.0).then_some(self.root_rate))
    }

    pub(super) fn restore(&mut self, saved: &[f64]) {
        if self.hardening != 0.0 {
            self.root_rate = saved.last().copied().unwrap_or(0.0);
        }
        let slots = self.rates.iter_mut().chain(self.memory.iter_mut().flatten()).chain(&mut self.slips);
        for (slot, values) in slots.zip(saved.as_chunks().0) {
            *slot = Lanes::new(*values);
        }
        self.resist();
    }
}

/// Per unit of the Prony chain: remainder after a `step` (s), gain per rate (s), and the means of both over the step.
fn prony(step: f64) -> [[f64; 4]; LOSS_TIMES.len()] {
    LOSS_TIMES.map(|time| {
        let gone = -(-step / time).exp_m1();
        let mean = gone * time / step;
        [1.0 - gone, time * gone, mean, time * (1.0 - mean)]
    })
}

/// The sign of a joint's angle in a lane: angles count outwards from the root, and on the right arm that is the opposite sense.
fn sense(lane: usize) -> f64 {
    if lane.is_multiple_of(2) { 1.0 } else { -1.0 }
}
