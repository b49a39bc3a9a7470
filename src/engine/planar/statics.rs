//! Equilibrium without time stepping.
//!
//! Newton steps minimise the energy Σ k (θ − θ_V)²/2 + Σ m g z with the corners above the floor. They leave out how the lever arms of gravity and floor
//! change, so a step is the same O(n) problem as a step in time, with displacements for velocities, k for the implicit terms and a frictionless floor. What is
//! left out is mostly small beside k, so the steps converge linearly; where it is not they overshoot and are shortened. Without friction the equilibrium on
//! the floor does not depend on how it is reached; the centre of mass keeps its x.

use fearless_simd::{Simd, dispatch, prelude::*};
use wide::f64x2;

use super::contact::FrictionCone;
use super::lanes::{Four, Lanes, Two, inner};
use super::law::ContactLaw;
use super::quad::{Quad, direction};
use super::recursion::Turn;
use super::{Engine, EngineError, PlanarEngine};
use crate::model::Mount;

/// Fraction of the inertia (1/s²) that regularises rigid motions without energy.
const HOLD: f64 = 0.1;
/// Compression of the floor under the whole weight (cm).
const GIVE: f64 = 1e-7;
/// Largest turn of a body in a step (rad), so that lever arms change little.
const LARGEST_TURN: f64 = 0.2;
/// A step that turns no body by more than this (rad) is the last.
const SETTLED: f64 = 1e-13;
const LARGEST_STEPS: u32 = 2000;
/// After this many steps without progress the next ones are half as long: where weights bend the robot more than its stiffness bears, whole ones overshoot.
const STEPS_TO_PROGRESS: u32 = 100;

impl PlanarEngine {
    /// Puts the robot at rest into its equilibrium under constant `voltages` (V, one per actuator), gravity and the floor.
    ///
    /// # Errors
    /// [`EngineError::NoEquilibrium`] for a free robot in gravity, and if the steps do not end.
    pub fn settle(&mut self, voltages: &[f64]) -> Result<(), EngineError> {
        let none = |reason: &str| Err(EngineError::NoEquilibrium { reason: reason.into() });
        if self.mount == Mount::Free && self.gravity != 0.0 {
            return none("a free robot falls");
        }
        self.prepare(voltages)?;
        let dynamic = self.quads.clone();
        let mut cones = vec![FrictionCone::new(f64x2::ZERO); self.levels];
        self.floor.swap_cones(&mut cones);
        let hold = Lanes::splat(HOLD);
        for quad in &mut self.quads {
            quad.implicit = quad.stiffness.map(|stiffness| stiffness.max(1.0));
            quad.mass = quad.mass * hold;
            quad.inertia = quad.inertia * hold;
            quad.inertia_at_reference = quad.inertia_at_reference * hold;
            quad.motion = Default::default();
        }
        self.velocity = [0.0; 2];
        self.finite = false;
        let base_joint = self.base_joint;
        if let Some(Turn::Curved { ahead, share, .. }) = self.base_joint.turn() {
            // Displacements for velocities.
            (*ahead, *share) = (1.0, 1.0);
        }
        if let Some(slide) = self.base_joint.slide() {
            slide.implicit = slide.stiffness;
        }
        let settled = dispatch!(self.level, simd => self.settle_in_steps(simd, &dynamic));
        self.base_joint = base_joint;
        for (quad, real) in self.quads.iter_mut().zip(&dynamic) {
            (quad.mass, quad.inertia, quad.implicit) = (real.mass, real.inertia, real.implicit);
            quad.inertia_at_reference = real.inertia_at_reference;
        }
        self.floor.swap_cones(&mut cones);
        self.floor.clear();
        match settled? {
            true => Ok(()),
            false => none("the steps towards it do not end"),
        }
    }

    #[inline(always)]
    fn settle_in_steps<S: Simd>(&mut self, simd: S, bodies: &[Quad]) -> Result<bool, EngineError> {
        let weight = (self.mass * self.gravity).max(f64::MIN_POSITIVE);
        let law = ContactLaw::statics(weight / GIVE);
        let zero = Four::splat(simd, 0.0);
        let (mut relaxation, mut least_turn) = (1.0, f64::INFINITY);
        for step in 1..=LARGEST_STEPS {
            let mut before = Two::splat(simd, 0.0);
            for (k, (quad, body)) in self.quads.iter_mut().zip(bodies).enumerate() {
                quad.posed = quad.angle;
                quad.along = direction(quad.angle);
                quad.lay(simd);
                let mass = body.mass.on(simd);
                quad.load([zero, mass * self.gravity_vector[0], mass * self.gravity_vector[1]]);
                let (inner, last) = inner(quad.angle.on(simd), before);
                quad.load_torque(-1.0, inner);
                if let Some(extensions) = &self.extensions {
                    quad.torque += extensions.at_rest(k, quad, quad.angle - inner.into() - quad.rest_angle);
                    if let Some(stiffness) = extensions.clamp_stiffness(k, quad) {
                        quad.implicit.set_lane(0, stiffness);
                    }
                }
                before = last;
            }
            if let Some(slide) = self.base_joint.slide() {
                slide.impulse = -slide.stiffness * self.centre[1];
            }
            let height = if self.clamped() { self.centre[1] } else { self.root_motion(simd)[0][1] };
            if let Some(attachments) = &mut self.attachments {
                attachments.begin(&self.quads, height);
                attachments.load_at_rest();
            }
            self.find_corners(simd, &law);
            self.solve_on_floor(simd, &law)?;
            let turns = self.quads.iter().flat_map(|quad| quad.mean[0].to_array());
            let largest = turns.map(f64::abs).fold(0.0, f64::max);
            if !largest.is_finite() {
                return Ok(false);
            }
            if step % STEPS_TO_PROGRESS == 0 {
                relaxation *= if largest < least_turn { 1.0 } else { 0.5 };
                least_turn = largest;
            }
            let share = relaxation * (LARGEST_TURN / largest).min(1.0);
            let mut rise = zero;
            for quad in &mut self.quads {
                let [turn, _, z] = quad.mean_of_centre(simd);
                quad.angle = (quad.angle.on(simd) + turn * share).into();
                rise += quad.share.on(simd) * z;
            }
            let rise = Lanes::from(rise).sum();
            if self.mount != Mount::Clamped {
                self.centre[1] += share * rise;
            } else if self.base_joint.slides() {
                self.centre[1] += share * self.quads[0].mean[2].lane(0);
            }
            if largest <= SETTLED && rise.abs() <= SETTLED {
                return Ok(true);
            }
        }
        Ok(false)
    }
}
