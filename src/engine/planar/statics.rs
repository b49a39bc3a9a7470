//! Equilibrium without time stepping.
//!
//! The energy Σ k (θ − θ_V)²/2 + Σ m g z, with the corners above the floor, is lowered by Newton steps that leave out how gravity's and the
//! floor's lever arms change: then a step is the same O(n) problem as a step in time, with displacements for velocities, k for the
//! implicit terms and a frictionless floor. What is left out is small beside k, so the steps shrink by a constant factor. Without
//! friction the equilibrium of a robot on the floor does not depend on how it got there; the centre of mass keeps its x.

use wide::f64x2;

use super::contact::{Grip, Law};
use super::floor::{Floor, Inwards};
use super::recursion::{Rung, direction, solve};
use super::{Engine, EngineError, PlanarEngine, outwards};
use crate::model::Mount;

/// Rigid motions that cost no energy are held by this share of the inertia (1/s²).
const HOLD: f64 = 0.1;
/// Give of the floor under the whole weight (cm).
const GIVE: f64 = 1e-7;
/// Largest turn of a body in a step (rad), so that the arms stay what they were.
const LARGEST_TURN: f64 = 0.2;
/// The last step turns no body by more than this (rad).
const SETTLED: f64 = 1e-13;
const LARGEST_STEPS: u32 = 2000;

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
        let dynamic = self.rungs.clone();
        let mut grips = vec![Grip::new(f64x2::ZERO); dynamic.len()];
        if let Some(floor) = &mut self.floor {
            floor.swap_grips(&mut grips);
        }
        for rung in &mut self.rungs {
            rung.implicit = rung.stiffness.fast_max(f64x2::ONE);
            rung.mass *= f64x2::splat(HOLD);
            rung.inertia *= f64x2::splat(HOLD);
            rung.inertia_at_reference *= f64x2::splat(HOLD);
            rung.motion = Default::default();
        }
        self.velocity = [0.0; 2];
        self.finite = false;
        let settled = self.settle_in_steps(&dynamic);
        for (rung, real) in self.rungs.iter_mut().zip(&dynamic) {
            (rung.mass, rung.inertia, rung.implicit) = (real.mass, real.inertia, real.implicit);
            rung.inertia_at_reference = real.inertia_at_reference;
        }
        if let Some(floor) = &mut self.floor {
            floor.swap_grips(&mut grips);
            Floor::clear(floor);
        }
        match settled? {
            true => Ok(()),
            false => none("the steps towards it do not end"),
        }
    }

    fn settle_in_steps(&mut self, bodies: &[Rung]) -> Result<bool, EngineError> {
        let weight = (self.mass * self.gravity).max(f64::MIN_POSITIVE);
        let law = Law::statics(weight / GIVE);
        let pull = self.pull.map(f64x2::splat);
        for _ in 0..LARGEST_STEPS {
            for (rung, body) in self.rungs.iter_mut().zip(bodies) {
                rung.posed = rung.angle;
                rung.along = direction(rung.angle);
                rung.lay();
                rung.load([f64x2::ZERO, body.mass * pull[0], body.mass * pull[1]]);
            }
            let mut inner = f64x2::ZERO;
            for (k, rung) in self.rungs.iter_mut().enumerate() {
                rung.load_torque(-f64x2::ONE, inner);
                inner = outwards(rung.angle, k);
            }
            if let Some(beyond) = &self.beyond {
                let mut inner = f64x2::splat(self.rungs[0].angle.to_array()[0]);
                for rung in self.rungs.iter_mut().skip(1) {
                    rung.torque += beyond.at_rest(rung, rung.angle - inner - rung.rest_angle);
                    inner = rung.angle;
                }
            }
            if !self.solve_on_floor(&law)? {
                solve(&mut self.rungs, self.hold, Inwards::default(), &law);
            }
            let turns = self.rungs.iter().flat_map(|rung| rung.mean[0].to_array());
            let largest = turns.map(f64::abs).fold(0.0, f64::max);
            if !largest.is_finite() {
                return Ok(false);
            }
            let share = (LARGEST_TURN / largest).min(1.0);
            let mut rise = f64x2::ZERO;
            for rung in &mut self.rungs {
                let mean = rung.mean_of_centre();
                rung.angle += f64x2::splat(share) * mean[0];
                rise += rung.share * mean[2];
            }
            let rise = rise.reduce_add();
            if self.mount != Mount::Clamped {
                self.centre[1] += share * rise;
            }
            if largest <= SETTLED && rise.abs() <= SETTLED {
                return Ok(true);
            }
        }
        Ok(false)
    }
}
