//! A step of the scheme ([`super`]): from the state to the contact problem's right side, and from its solution to the new state.

use fearless_simd::{Simd, prelude::*};

use super::joint_extensions::LARGEST_REPETITIONS;
use super::lanes::{Four, Lanes, Two, fma, inner, on};
use super::quad::{Motions, Quad};
use super::recursion::{BaseJoint, Turn};
use super::{EngineError, LARGEST_COORDINATE, PlanarEngine};
use crate::actuator::PiezoJoint;

/// The links' directions are computed anew after this many steps: each turn may lose a unit in the last place.
pub(super) const EXACT_EVERY: u64 = 256;

impl PlanarEngine {
    /// One step, cut where corners land.
    #[inline(always)]
    pub(super) fn advance_here<S: Simd>(&mut self, simd: S) -> Result<(), EngineError> {
        self.begin_step(simd);
        self.floor.begin_whole();
        if self.floor.first_landing() < self.time_step {
            self.advance_in_parts(simd)?;
        } else {
            self.end_step(simd)?;
        }
        self.step += 1;
        Ok(())
    }

    /// Turns the links to the middle of the step at the present rates, sets the step's right side there (momenta, gravity, drag, joint torques), and finds the
    /// contact candidates.
    #[inline(always)]
    pub(super) fn begin_step<S: Simd>(&mut self, simd: S) {
        let share = self.weight * self.time_step;
        let ahead = Four::splat(simd, 0.5 * self.time_step);
        let exact = self.step.is_multiple_of(EXACT_EVERY);
        let [pull_x, pull_z] = self.gravity_vector.map(|part| share * part);
        let drag = self.extensions.as_ref().filter(|extensions| extensions.has_drag());
        let mut before = Two::splat(simd, 0.0);
        for quad in &mut self.quads {
            let (angle, mass) = (quad.angle.on(simd), quad.mass.on(simd));
            let [rate, x, z] = on(simd, &quad.motion);
            quad.turn_to(fma(ahead, rate, angle), exact);
            let (inner, last) = inner(angle, before);
            quad.load_torque(-share, inner);
            before = last;
            let mut momentum = [quad.inertia.on(simd) * rate, mass * (x + pull_x), mass * (z + pull_z)];
            if let Some(extensions) = drag {
                let drag = extensions.drag(quad);
                (0..3).for_each(|k| momentum[k] += drag[k].on(simd) * share);
            }
            quad.load(momentum);
        }
        if let Some(slide) = self.base_joint.slide() {
            slide.impulse = -share * slide.stiffness * self.centre[1];
        }
        if self.floor.is_viscous() {
            let (height, _) = self.root_over_floor(simd);
            self.floor.push_viscous(&mut self.quads, height, share);
        }
        let law = self.law;
        self.find_corners(simd, &law);
    }

    /// Solves for the step's mean motion; repeatedly where joints have dry friction.
    #[inline(always)]
    pub(super) fn solve_step<S: Simd>(&mut self, simd: S, share: f64) -> Result<(), EngineError> {
        if self.attachments.is_some() {
            return self.solve_attached(simd, share);
        }
        let law = self.law;
        let Some(mut extensions) = self.extensions.take() else { return self.solve_on_floor(simd, &law) };
        extensions.begin(&self.quads);
        let mut result = Ok(());
        for repetition in 1..=LARGEST_REPETITIONS {
            extensions.load(&mut self.quads, share);
            result = self.solve_on_floor(simd, &law);
            if result.is_err() || extensions.accept(&self.quads) || !extensions.is_repeated() {
                break;
            }
            if repetition == LARGEST_REPETITIONS {
                let time = self.step as f64 * self.time_step;
                result = Err(EngineError::NotConverged { iterations: repetition, step: self.step, time });
            }
        }
        extensions.end();
        self.extensions = Some(extensions);
        result
    }

    /// [`solve_step`](Self::solve_step) with tapes or cables at the sheet; repeatedly where they have friction, too. Out of line, for few robots have them.
    #[inline(never)]
    fn solve_attached<S: Simd>(&mut self, simd: S, share: f64) -> Result<(), EngineError> {
        simd.vectorize(
            #[inline(always)]
            || self.solve_with_attachments(simd, share),
        )
    }

    #[inline(always)]
    fn solve_with_attachments<S: Simd>(&mut self, simd: S, share: f64) -> Result<(), EngineError> {
        let (law, half) = (self.law, 0.5 * self.time_step);
        let (mut extensions, height) = (self.extensions.take(), self.root_height(simd));
        let Some(attachments) = &mut self.attachments else { return Ok(()) };
        attachments.begin(&self.quads, height);
        let is_repeated = attachments.is_repeated() || extensions.as_ref().is_some_and(|joints| joints.is_repeated());
        if let Some(extensions) = &mut extensions {
            extensions.begin(&self.quads);
        }
        let mut result = Ok(());
        for repetition in 1..=LARGEST_REPETITIONS {
            if let Some(extensions) = &mut extensions {
                extensions.load(&mut self.quads, share);
            }
            if let Some(attachments) = &mut self.attachments {
                attachments.load(half, share);
            }
            result = self.solve_on_floor(simd, &law);
            if result.is_err() {
                break;
            }
            let joints_agree = extensions.as_mut().is_none_or(|extensions| extensions.accept(&self.quads));
            let points_agree = self.attachments.as_mut().is_none_or(|attachments| attachments.accept(&self.quads));
            if (joints_agree && points_agree) || !is_repeated {
                break;
            }
            if repetition == LARGEST_REPETITIONS {
                let time = self.step as f64 * self.time_step;
                result = Err(EngineError::NotConverged { iterations: repetition, step: self.step, time });
            }
        }
        if let Some(extensions) = &mut extensions {
            extensions.end();
        }
        self.extensions = extensions;
        result
    }

    /// Height of the root's reference point (cm) in the middle of the step.
    #[inline(always)]
    fn root_height<S: Simd>(&self, simd: S) -> f64 {
        if self.clamped() { self.centre[1] + 0.5 * self.time_step * self.slide_velocity() } else { self.root_over_floor(simd).0 }
    }

    /// Solves the step that was begun, and updates the state.
    #[inline(always)]
    pub(super) fn end_step<S: Simd>(&mut self, simd: S) -> Result<(), EngineError> {
        let h = self.time_step;
        self.solve_step(simd, self.weight * h)?;
        let [step, per_weight, zero] = [h, 1.0 / self.weight, 0.0].map(|value| Four::splat(simd, value));
        let (mut momentum, mut changed) = ([zero; 2], zero);
        let (mut before, mut turns) = (None, [zero; 2]);
        for quad in &mut self.quads {
            let mean = quad.mean_of_centre(simd);
            let start = quad.angle.on(simd);
            let end = fma(step, mean[0], start);
            quad.angle = end.into();
            // The root has no joint.
            let (inner_start, inner_end) = before.unwrap_or((start.split().0, end.split().0));
            let ((inner_start, last_start), (inner_end, last_end)) = (inner(start, inner_start), inner(end, inner_end));
            let turn = (end - inner_end) - (start - inner_start);
            before = Some((last_start, last_end));
            turns = [fma(quad.volts.on(simd), turn, turns[0]), fma(turn, turn, turns[1])];
            let motion = on(simd, &quad.motion);
            let change: Motions<S> = std::array::from_fn(|k| mean[k] - motion[k]);
            let after: Motions<S> = std::array::from_fn(|k| fma(change[k], per_weight, motion[k]));
            (0..3).for_each(|k| quad.motion[k] = after[k].into());
            let [turn, x, z] = change;
            let (mass, share) = (quad.mass.on(simd), quad.share.on(simd));
            changed = fma(quad.inertia.on(simd) * turn, turn, fma(mass, fma(x, x, z * z), changed));
            momentum = [fma(share, after[1], momentum[0]), fma(share, after[2], momentum[1])];
        }
        if self.base_joint.slides() {
            self.centre[1] += h * self.quads[0].mean[2].lane(0);
        }
        let changed = Lanes::from(changed).sum();
        self.finite = changed < LARGEST_COORDINATE;
        self.numerical_loss += (self.weight - 0.5) / (self.weight * self.weight) * changed;
        if !self.clamped() {
            for (k, share) in momentum.into_iter().enumerate() {
                let after = Lanes::from(share).sum();
                self.centre[k] += h * (self.velocity[k] + self.weight * (after - self.velocity[k]));
                self.velocity[k] = after;
            }
        }
        let [volts, squares] = turns.map(|turns| Lanes::from(turns).sum());
        self.work_sums = [self.work_sums[0] + volts, self.work_sums[1] + squares * self.law.per_step()];
        Ok(())
    }

    /// Position (cm), velocity (cm/s) and acceleration at constant rates (cm/s²) of the root's reference point, in the present pose of the links.
    #[inline(always)]
    pub(super) fn root_motion<S: Simd>(&self, simd: S) -> [[f64; 2]; 3] {
        if self.clamped() {
            return [self.centre, [0.0, self.slide_velocity()], [0.0; 2]];
        }
        let zero = Four::splat(simd, 0.0);
        let (mut position, mut velocity, mut acceleration) = ([zero; 2], [zero; 2], [zero; 2]);
        for quad in &self.quads {
            let (lever, rate) = (quad.lever.on(simd), quad.motion[0].on(simd));
            let [x, z] = on(simd, &quad.along).map(|along| lever * along);
            position = [position[0] + x, position[1] + z];
            let turned = [rate * z, rate * x];
            velocity = [velocity[0] - turned[0], velocity[1] + turned[1]];
            acceleration = [fma(rate, turned[1], acceleration[0]), fma(rate, turned[0], acceleration[1])];
        }
        let less = |of: [Four<S>; 2], from: [f64; 2]| [0, 1].map(|k| from[k] - Lanes::from(of[k]).sum());
        [less(position, self.centre), less(velocity, self.velocity), acceleration.map(|part| Lanes::from(part).sum())]
    }

    /// Height of a free robot's root (cm) in the middle of the step, and its velocity and acceleration at the start.
    #[inline(always)]
    pub(super) fn root_over_floor<S: Simd>(&self, simd: S) -> (f64, [[f64; 2]; 2]) {
        let [[_, height], velocity, acceleration] = self.root_motion(simd);
        (height + 0.5 * self.time_step * self.velocity[1], [velocity, acceleration])
    }
}

/// Weight of a step's end, for a step (s) and numerical damping (1/s).
pub(super) fn weight_of(damping: f64, time_step: f64) -> f64 {
    (0.5 + damping * time_step).min(1.0)
}

/// Sets what springs and dampers add to the joints' articulated inertia in a step of `time_step` (s).
pub(super) fn set_implicit(quads: &mut [Quad], joint: &PiezoJoint, base_joint: &mut BaseJoint, weight: f64, time_step: f64) {
    let [share, lag] = [weight * time_step, joint.damping_time + 0.5 * time_step].map(Lanes::splat);
    for quad in quads.iter_mut() {
        let implicit = share * quad.stiffness * lag;
        quad.implicit = implicit.where_positive(quad.mass, Lanes::splat(1.0));
    }
    match base_joint.turn() {
        Some(Turn::Hinged { damping_time }) => {
            let stiffness = quads[0].stiffness.lane(0);
            quads[0].implicit.set_lane(0, weight * time_step * stiffness * (*damping_time + 0.5 * time_step));
        }
        Some(Turn::Curved { damping_time, ahead, share, .. }) => {
            (*ahead, *share) = (*damping_time + 0.5 * time_step, weight * time_step);
        }
        _ => {}
    }
    if let Some(slide) = base_joint.slide() {
        slide.implicit = weight * time_step * slide.stiffness * (slide.damping_time + 0.5 * time_step);
    }
}
