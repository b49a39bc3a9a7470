//! Equilibrium without time stepping.
//!
//! The energy Σ k (θ − θ_V)²/2 + Σ m g z, with the corners above the floor, is lowered by Newton steps that leave out how gravity's and the
//! floor's lever arms change: then a step is the same O(n) problem as a step in time, with displacements for velocities, k for the
//! implicit terms and a frictionless floor. What is left out is small beside k, so the steps shrink by a constant factor. Without
//! friction the equilibrium of a robot on the floor does not depend on how it got there; the centre of mass keeps its x.

use super::contact::{Grip, Law};
use super::recursion::solve;
use super::{Corner, EngineError, PlanarEngine};
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
        let weight = (self.mass * self.gravity).max(f64::MIN_POSITIVE);
        let law = Law::statics(weight / GIVE);
        let dynamic: Vec<(f64, f64, f64)> = self.links.iter().map(|link| (link.mass, link.inertia, link.implicit)).collect();
        for link in &mut self.links {
            link.implicit = self.joint.stiffness;
            link.mass *= HOLD;
            link.inertia *= HOLD;
        }
        self.motions.fill([0.0; 3]);
        self.velocity = [0.0; 2];
        let grips = std::mem::replace(&mut self.grips, vec![Grip::new(0.0); self.links.len()]);
        let settled = self.settle_in_steps(voltages, &law, &dynamic);
        for (link, (mass, inertia, implicit)) in self.links.iter_mut().zip(dynamic) {
            (link.mass, link.inertia, link.implicit) = (mass, inertia, implicit);
        }
        self.grips = grips;
        for corner in &mut self.corners {
            *corner = Corner::default();
        }
        match settled? {
            true => Ok(()),
            false => none("the steps towards it do not end"),
        }
    }

    fn settle_in_steps(&mut self, voltages: &[f64], law: &Law, bodies: &[(f64, f64, f64)]) -> Result<bool, EngineError> {
        let m = self.motors_per_actuator;
        for _ in 0..LARGEST_STEPS {
            for (link, angle) in self.links.iter_mut().zip(&self.angles) {
                link.along = [angle.cos(), angle.sin()];
            }
            self.posed.copy_from_slice(&self.angles);
            for (link, body) in self.links.iter_mut().zip(bodies) {
                link.momentum = [0.0, body.0 * self.pull[0], body.0 * self.pull[1]];
            }
            for i in 0..self.angles.len() - 1 {
                let angle = self.angles[i] - self.angles[i + 1];
                let torque = self.joint.torque(angle, 0.0, voltages[i / m] / m as f64);
                if i < self.root {
                    self.links[i].torque = torque;
                } else {
                    self.links[i + 1].torque = -torque;
                }
            }
            if self.find_corners(law) {
                self.solve_contact(law)?;
            } else {
                solve(&mut self.links, self.root, self.mount == Mount::Clamped, &[], law);
            }
            let largest = self.links.iter().map(|link| link.mean[0].abs()).fold(0.0, f64::max);
            let share = (LARGEST_TURN / largest).min(1.0);
            let mut rise = [0.0; 2];
            for ((link, angle), body) in self.links.iter().zip(&mut self.angles).zip(bodies) {
                let mean = link.mean_of_centre();
                *angle += share * mean[0];
                rise[0] += body.0 * mean[1];
                rise[1] += body.0 * mean[2];
            }
            if self.mount != Mount::Clamped {
                self.centre[1] += share * rise[1] / self.mass;
            }
            if !largest.is_finite() {
                return Ok(false);
            }
            if largest <= SETTLED && rise[1].abs() <= SETTLED * self.mass {
                return Ok(true);
            }
        }
        Ok(false)
    }
}
