//! Joint torques beyond eq. 1 (softening, dry friction, a generalised Maxwell or Prony chain), and drag in air.
//!
//! The step stays one problem that is linear in the mean rates u: a joint's extra torque e is put as e* − s (u − u*), about the rate u* of the
//! step before. For softening s is the tangent, which errs by the square of what changes in a step. For dry friction, τ_c tanh(u/ω), the step
//! is repeated with the new u until nothing changes: with the tangent where a joint slides fast and goes on in its direction (Newton), otherwise
//! with the secant −e*/u*, whose quadratic potential majorises that of friction, so that a repetition can only lower the cost. The Prony chain is linear and
//! exact over a step.

use wide::f64x2;

use super::lanes::Lanes;
use super::quad::Quad;
use crate::engine::GAUSS;
use crate::model::{AIR_DENSITY, DRY_FRICTION_RATE, Extensions, LEAST_STIFFNESS, LOSS_TIMES};

/// Repetitions end when no friction torque changes by more than this fraction of its moment; after `LARGEST_REPETITIONS` they fail.
const FRICTION_ENOUGH: f64 = 1e-3;
/// A joint slides fast at this multiple of the rate at which friction has 76 % of its moment.
const FAST: f64 = 3.0;
pub(super) const LARGEST_REPETITIONS: u32 = 200;

/// Extra torques of one robot, with their memory.
#[derive(Debug, Clone)]
pub(super) struct JointExtensions {
    softening: f64,
    friction: f64,
    /// ξ.
    loss: f64,
    /// Per unit of the Prony chain: remainder after a step, gain per rate, and the means of both over the step.
    prony: [[f64; 4]; LOSS_TIMES.len()],
    half_step: f64,
    /// ½ ρ C_d w (g/cm²).
    drag: f64,
    /// Implicit terms of the plain joints.
    implicit: Vec<Lanes>,
    /// Torque terms of the plain joints in this step.
    torque: Vec<Lanes>,
    /// 1 where there is a joint.
    joint: Vec<Lanes>,
    /// Mean rates of the joints in the last step (rad/s).
    rates: Vec<Lanes>,
    /// True for joints whose rate changed sign in this step's repetitions.
    turned_back: Vec<[bool; 4]>,
    /// q_j of the Prony chain (rad).
    memory: Vec<[Lanes; LOSS_TIMES.len()]>,
}

impl JointExtensions {
    /// `None` for the plain model.
    pub(super) fn new(extensions: &Extensions, width: f64, link: f64, step: f64, quads: &[Quad]) -> Option<Self> {
        if !extensions.bends_torque_law() && extensions.drag == 0.0 {
            return None;
        }
        let count = quads.len();
        let joint = quads.iter().enumerate().map(|(k, quad)| {
            // The root, in the first lane, has none.
            let there = |lane: usize| if k + lane > 0 && quad.mass.lane(lane) > 0.0 { 1.0 } else { 0.0 };
            Lanes::new(std::array::from_fn(there))
        });
        Some(Self {
            softening: extensions.softening / (link * link),
            friction: extensions.dry_friction,
            loss: extensions.loss,
            prony: prony(step),
            half_step: 0.5 * step,
            drag: 0.5 * AIR_DENSITY * extensions.drag * width,
            implicit: quads.iter().map(|quad| quad.implicit).collect(),
            torque: vec![Lanes::ZERO; count],
            joint: joint.collect(),
            rates: vec![Lanes::ZERO; count],
            turned_back: vec![[false; 4]; count],
            memory: vec![Default::default(); count],
        })
    }

    pub(super) fn set_time_step(&mut self, step: f64, quads: &[Quad]) {
        self.half_step = 0.5 * step;
        if self.loss != 0.0 {
            self.prony = prony(step);
        }
        self.implicit.iter_mut().zip(quads).for_each(|(implicit, quad)| *implicit = quad.implicit);
    }

    pub(super) fn is_repeated(&self) -> bool {
        self.friction != 0.0
    }

    /// Elastic torque of softening and its slope, at the elastic angle δ.
    fn softened(&self, stiffness: Lanes, delta: Lanes) -> (Lanes, Lanes) {
        let most = 1.0 - LEAST_STIFFNESS;
        let share = |delta: f64| self.softening * delta * delta;
        let torque = delta.map(|delta| share(delta).min(most) * delta);
        let slope = delta.map(|delta| if share(delta) < most { 3.0 * share(delta) } else { most });
        (stiffness * torque, stiffness * slope)
    }

    /// Extra torques (dyn·cm) of joints at rest, for statics, in the sense of rotation from the root outwards.
    pub(super) fn at_rest(&self, k: usize, quad: &Quad, delta: Lanes) -> Lanes {
        if self.softening == 0.0 { Lanes::ZERO } else { self.softened(self.joint[k] * quad.stiffness, delta).0 }
    }

    /// Extra torques (dyn·cm) at elastic angle (rad) and rate (rad/s), for records, in the same sense.
    pub(super) fn now(&self, k: usize, quad: &Quad, delta: Lanes, rate: Lanes) -> Lanes {
        let friction = rate.map(|rate| self.friction * (rate / DRY_FRICTION_RATE).tanh());
        let stored = self.memory[k].iter().fold(Lanes::ZERO, |sum, q| sum + *q);
        self.at_rest(k, quad, delta) - self.joint[k] * friction - quad.stiffness * Lanes::splat(self.loss) * stored
    }

    /// Begins a step: stores the plain model's torques.
    pub(super) fn begin(&mut self, quads: &[Quad]) {
        for (torque, quad) in self.torque.iter_mut().zip(quads) {
            *torque = quad.torque;
        }
        self.turned_back.fill([false; 4]);
    }

    /// Slope s and constant part e* + s u* of friction about the rate `u` of a joint.
    fn friction(&self, u: f64, turned_back: bool) -> (f64, f64) {
        let ratio = u / DRY_FRICTION_RATE;
        let share = ratio.tanh();
        if ratio.abs() > FAST && !turned_back {
            let slope = self.friction / DRY_FRICTION_RATE * (1.0 - share * share);
            (slope, slope * u - self.friction * share)
        } else {
            let secant = if ratio.abs() < 1e-6 { 1.0 } else { share / ratio };
            (self.friction / DRY_FRICTION_RATE * secant, 0.0)
        }
    }

    /// Adds the extra torques, linearised about the last rates, to the joints: their impulses over `share` (s).
    pub(super) fn load(&self, quads: &mut [Quad], share: f64) {
        let share = Lanes::splat(share);
        let half = Lanes::splat(self.half_step);
        let mut before = f64x2::ZERO;
        for (k, quad) in quads.iter_mut().enumerate() {
            let (rate, joint) = (self.rates[k], self.joint[k]);
            let stiffness = joint * quad.stiffness;
            let (mut torque, mut slope) = (Lanes::ZERO, Lanes::ZERO);
            if self.softening != 0.0 {
                let delta = quad.angle - quad.angle.inner(before) - quad.rest_angle;
                let (soft, tangent) = self.softened(stiffness, delta + half * rate);
                torque += soft - half * tangent * rate;
                slope += -(half * tangent);
            }
            if self.friction != 0.0 {
                let of: [_; 4] = std::array::from_fn(|lane| self.friction(rate.lane(lane), self.turned_back[k][lane]));
                slope += joint * Lanes::new(of.map(|(slope, _)| slope));
                torque += joint * Lanes::new(of.map(|(_, rest)| rest));
            }
            if self.loss != 0.0 {
                let stiffness = stiffness * Lanes::splat(self.loss);
                for ([_, _, kept, added], q) in self.prony.iter().zip(&self.memory[k]) {
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
    pub(super) fn accept(&mut self, quads: &[Quad]) -> bool {
        let mut before = f64x2::ZERO;
        let mut changed = 0.0_f64;
        for (k, quad) in quads.iter().enumerate() {
            let rate = self.joint[k] * (quad.mean[0] - quad.mean[0].inner(before));
            before = quad.mean[0].level(1);
            if self.friction != 0.0 {
                for lane in 0..4 {
                    let (now, before) = (rate.lane(lane), self.rates[k].lane(lane));
                    let (slope, rest) = self.friction(before, self.turned_back[k][lane]);
                    let put = slope * now - rest;
                    changed = changed.max((put / self.friction - (now / DRY_FRICTION_RATE).tanh()).abs());
                    self.turned_back[k][lane] |= now * before < 0.0;
                }
            }
            self.rates[k] = rate;
        }
        changed <= FRICTION_ENOUGH
    }

    /// Ends a step: advances the Prony chain.
    pub(super) fn end(&mut self) {
        if self.loss == 0.0 {
            return;
        }
        for (memory, rate) in self.memory.iter_mut().zip(&self.rates) {
            for (q, [left, added, ..]) in memory.iter_mut().zip(&self.prony) {
                *q = Lanes::splat(*left) * *q + Lanes::splat(*added) * *rate;
            }
        }
    }

    /// Drag on the bodies: moment about the centre of mass (dyn·cm) and force (dyn).
    pub(super) fn drag(&self, quad: &Quad) -> [Lanes; 3] {
        let [rate, x, z] = quad.motion;
        let normal = [-quad.along[1], quad.along[0]];
        let speed = x * normal[0] + z * normal[1];
        let (mut force, mut moment) = (Lanes::ZERO, Lanes::ZERO);
        for (at, weight) in GAUSS {
            let arm = (Lanes::splat(0.5 + 0.5 * at) - quad.middle) * quad.reach;
            let speed = speed + rate * arm;
            let part = Lanes::splat(-0.5 * weight * self.drag) * quad.reach.abs() * speed * speed.abs();
            force += part;
            moment += part * arm;
        }
        [moment, force * normal[0], force * normal[1]]
    }

    pub(super) fn has_drag(&self) -> bool {
        self.drag != 0.0
    }

    /// Rates and memory as numbers for storing.
    pub(super) fn saved(&self) -> impl Iterator<Item = f64> + '_ {
        let memory = self.memory.iter().flatten();
        self.rates.iter().chain(memory).flat_map(|lanes| lanes.to_array())
    }

    pub(super) fn restore(&mut self, saved: &[f64]) {
        let slots = self.rates.iter_mut().chain(self.memory.iter_mut().flatten());
        for (slot, values) in slots.zip(saved.as_chunks().0) {
            *slot = Lanes::new(*values);
        }
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
