//! What joints and bodies do beyond eq. 1: softening, dry friction, the loss ladder, and drag in air.
//!
//! The step stays one problem that is linear in the mean rates u: a joint's extra torque e is put as e* − s (u − u*), about the rate u* of the
//! step before. For softening s is the tangent, which errs by the square of what changes in a step. For dry friction, τ_c tanh(u/ω), the step
//! is repeated with the new u until nothing changes: with the tangent where a joint slides fast and goes on in its direction (Newton), otherwise
//! with the secant −e*/u*, for the quadratic that it stands for lies above the friction's potential and touches it, so that a repetition can
//! only lower the whole (majorisation). The loss ladder is linear and exact over a step.

use wide::f64x2;

use super::Rung;
use crate::model::{AIR_DENSITY, DRY_FRICTION_RATE, Extensions, LEAST_STIFFNESS, LOSS_TIMES};

/// Repetitions end when no torque of friction changes by more than this share of its moment, or fail after so many.
const FRICTION_ENOUGH: f64 = 1e-3;
/// A joint slides fast at this multiple of the rate at which friction has 76 % of its moment.
const FAST: f64 = 3.0;
pub(super) const LARGEST_REPETITIONS: u32 = 200;
/// Points of Gauss along a body, from −1 to 1, with their weights: exact for the square of a linear speed of one sign.
pub(in crate::engine) const GAUSS: [(f64, f64); 3] =
    [(-0.774_596_669_241_483_4, 5.0 / 9.0), (0.0, 8.0 / 9.0), (0.774_596_669_241_483_4, 5.0 / 9.0)];

/// One robot's extra torques, with their memory.
#[derive(Debug, Clone)]
pub(super) struct Beyond {
    softening: f64,
    friction: f64,
    /// ξ.
    loss: f64,
    /// Per unit of the loss ladder's memory: what is left after a step, what a rate adds, and the means over the step of both.
    ladder: [[f64; 4]; LOSS_TIMES.len()],
    half_step: f64,
    /// ½ ρ C_d w (g/cm²).
    drag: f64,
    /// Implicit terms of the plain joints.
    implicit: Vec<f64x2>,
    /// Torque terms of the plain joints in this step.
    torque: Vec<f64x2>,
    /// 1 where there is a joint.
    joint: Vec<f64x2>,
    /// Mean rates of the joints in the last step (rad/s).
    rates: Vec<f64x2>,
    /// Whether a joint has turned back in this step's repetitions.
    turned_back: Vec<[bool; 2]>,
    /// q_j of the loss ladder (rad).
    memory: Vec<[f64x2; LOSS_TIMES.len()]>,
}

impl Beyond {
    /// None if the robot has nothing of it.
    pub(super) fn new(extensions: &Extensions, width: f64, link: f64, step: f64, rungs: &[Rung]) -> Option<Self> {
        if !extensions.bends_torque_law() && extensions.drag == 0.0 {
            return None;
        }
        let ladder = LOSS_TIMES.map(|time| {
            let gone = -(-step / time).exp_m1();
            let mean = gone * time / step;
            [1.0 - gone, time * gone, mean, time * (1.0 - mean)]
        });
        let count = rungs.len();
        let joint = rungs.iter().enumerate().map(|(k, rung)| {
            let there = |lane: usize| if k > 0 && rung.mass.to_array()[lane] > 0.0 { 1.0 } else { 0.0 };
            f64x2::new([there(0), there(1)])
        });
        Some(Self {
            softening: extensions.softening / (link * link),
            friction: extensions.dry_friction,
            loss: extensions.loss,
            ladder,
            half_step: 0.5 * step,
            drag: 0.5 * AIR_DENSITY * extensions.drag * width,
            implicit: rungs.iter().map(|rung| rung.implicit).collect(),
            torque: vec![f64x2::ZERO; count],
            joint: joint.collect(),
            rates: vec![f64x2::ZERO; count],
            turned_back: vec![[false; 2]; count],
            memory: vec![Default::default(); count],
        })
    }

    pub(super) fn is_repeated(&self) -> bool {
        self.friction != 0.0
    }

    /// Elastic torque of softening and its slope, at the elastic angle δ.
    fn softened(&self, stiffness: f64x2, delta: f64x2) -> (f64x2, f64x2) {
        let most = 1.0 - LEAST_STIFFNESS;
        let [torque, slope]: [[f64; 2]; 2] = {
            let pairs = delta.to_array().map(|delta| {
                let share = self.softening * delta * delta;
                if share < most { [share * delta, 3.0 * share] } else { [most * delta, most] }
            });
            [pairs.map(|pair| pair[0]), pairs.map(|pair| pair[1])]
        };
        (stiffness * f64x2::new(torque), stiffness * f64x2::new(slope))
    }

    /// Extra torques of a joint at rest, for statics, seen from the root.
    pub(super) fn at_rest(&self, rung: &Rung, delta: f64x2) -> f64x2 {
        if self.softening == 0.0 { f64x2::ZERO } else { self.softened(rung.stiffness, delta).0 }
    }

    /// Extra torques at elastic angle and rate, seen from the root: what is recorded.
    pub(super) fn now(&self, k: usize, rung: &Rung, delta: f64x2, rate: f64x2) -> f64x2 {
        let friction = f64x2::new(rate.to_array().map(|rate| self.friction * (rate / DRY_FRICTION_RATE).tanh()));
        let stored = self.memory[k].iter().fold(f64x2::ZERO, |sum, q| sum + *q);
        self.joint[k] * (self.at_rest(rung, delta) - friction) - rung.stiffness * f64x2::splat(self.loss) * stored
    }

    /// Begins a step: keeps the plain torques that `rungs` carry.
    pub(super) fn begin(&mut self, rungs: &[Rung]) {
        for (torque, rung) in self.torque.iter_mut().zip(rungs) {
            *torque = rung.torque;
        }
        self.turned_back.fill([false; 2]);
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

    /// Puts the extra torques, linear about the last rates, into the joints: `share` (s) of them.
    pub(super) fn load(&self, rungs: &mut [Rung], share: f64) {
        let share = f64x2::splat(share);
        let half = f64x2::splat(self.half_step);
        let mut inner = f64x2::splat(rungs[0].angle.to_array()[0]);
        for (k, rung) in rungs.iter_mut().enumerate().skip(1) {
            let rate = self.rates[k];
            let (mut torque, mut slope) = (f64x2::ZERO, f64x2::ZERO);
            if self.softening != 0.0 {
                let (soft, tangent) = self.softened(rung.stiffness, rung.angle - inner - rung.rest_angle + half * rate);
                torque += soft - half * tangent * rate;
                slope -= half * tangent;
            }
            if self.friction != 0.0 {
                let [a, b] = rate.to_array();
                let [left, right] = [self.friction(a, self.turned_back[k][0]), self.friction(b, self.turned_back[k][1])];
                slope += self.joint[k] * f64x2::new([left.0, right.0]);
                torque += self.joint[k] * f64x2::new([left.1, right.1]);
            }
            if self.loss != 0.0 {
                let stiffness = rung.stiffness * f64x2::splat(self.loss);
                for ([_, _, kept, added], q) in self.ladder.iter().zip(&self.memory[k]) {
                    torque -= stiffness * f64x2::splat(*kept) * *q;
                    slope += stiffness * f64x2::splat(*added);
                }
            }
            rung.torque = self.torque[k] + share * torque;
            rung.implicit = self.implicit[k] + share * slope;
            inner = rung.angle;
        }
    }

    /// Takes the joints' mean rates of a solution; whether friction is as it was put.
    pub(super) fn accept(&mut self, rungs: &[Rung]) -> bool {
        let mut inner = f64x2::splat(rungs[0].mean[0].to_array()[0]);
        let mut changed = 0.0_f64;
        for (k, rung) in rungs.iter().enumerate().skip(1) {
            let rate = self.joint[k] * (rung.mean[0] - inner);
            inner = rung.mean[0];
            if self.friction != 0.0 {
                let pairs = rate.to_array().into_iter().zip(self.rates[k].to_array());
                for (lane, (now, before)) in pairs.enumerate() {
                    // What was put, against what it should have been.
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

    /// Ends a step: the ladder remembers.
    pub(super) fn end(&mut self) {
        if self.loss == 0.0 {
            return;
        }
        for (memory, rate) in self.memory.iter_mut().zip(&self.rates) {
            for (q, [left, added, ..]) in memory.iter_mut().zip(&self.ladder) {
                *q = f64x2::splat(*left) * *q + f64x2::splat(*added) * *rate;
            }
        }
    }

    /// Drag on the bodies of a rung: moment about the centre of mass (dyn·cm) and force (dyn).
    pub(super) fn drag(&self, rung: &Rung) -> [f64x2; 3] {
        let [rate, x, z] = rung.motion;
        let normal = [-rung.along[1], rung.along[0]];
        let speed = x * normal[0] + z * normal[1];
        let (mut force, mut moment) = (f64x2::ZERO, f64x2::ZERO);
        for (at, weight) in GAUSS {
            let arm = (f64x2::splat(0.5 + 0.5 * at) - rung.middle) * rung.reach;
            let speed = speed + rate * arm;
            let part = f64x2::splat(-0.5 * weight * self.drag) * rung.reach.abs() * speed * speed.abs();
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
        for (slot, pair) in slots.zip(saved.chunks_exact(2)) {
            *slot = f64x2::new([pair[0], pair[1]]);
        }
    }
}
