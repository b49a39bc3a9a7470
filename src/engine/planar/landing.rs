//! Corners that land, and steps that are cut there.
//!
//! An uncut step would stop a landing corner in two stages, by its own end and in the next step, in proportions that depend on when in the step it lands. Where
//! other corners touch, plastic impacts with friction in one stage and in two have different results, so that finer steps would not converge. Therefore
//! a step is cut a little before the first landing, and a short part with the landing in its middle takes the whole impact (Moreau's law): the midpoint
//! rule moves the corner by the mean of its velocities before and after, to the floor and not further. Corners that would land within the rest of the step are
//! stopped with it, so that simultaneous landings, as of symmetric robots, stay simultaneous in spite of rounding. Then the step goes on.
//!
//! Slow landings do not cut a step. Nor do any after `MOST_IMPACTS` in one step, as of a body that rocks to rest.
//!
//! J. J. Moreau, in *Nonsmooth Mechanics and Applications* (1988), on impacts; V. Acary, B. Brogliato, *Numerical Methods for Nonsmooth Dynamical
//! Systems* (2008), chapter 8, on steps that end at events.

use fearless_simd::{Simd, prelude::*};

use super::lanes::{Four, Lanes, fma};
use super::law::{Ahead, FrictionModel};
use super::step::{set_implicit, weight_of};
use super::{EngineError, PlanarEngine};

/// Landings slower than this acceleration (cm/s²) times the step do not cut it.
const LEAST_ACCELERATION: f64 = 1e5;
/// Shortest and longest half of an impact's part (s); in a longer one the curvature of a corner's path would count.
const SHORTEST_IMPACT: f64 = 1e-10;
const LONGEST_IMPACT: f64 = 1e-6;
/// Impacts in one step, after which it is cut no more.
const MOST_IMPACTS: u32 = 32;
/// Look-ahead of fast corners per square of the step (1/s). A corner at radius r of a body that turns at ω falls below its tangent by ω² r h²/2 in a step h; at
/// vertical velocity v that is a time of ω² r h²/(2 v), with up to 100 /s for ω² r/(2 v) in the robots' landings.
const ARC: f64 = 100.0;
/// A step is cut this fraction of the impact's longest part before the predicted landing, which comes a little earlier or later.
const BEFORE: f64 = 0.8;

/// Look-ahead of a step of this length (s) without impact. Fast corners are stopped by their impacts only, but must not be below the floor before: the
/// curvature of their paths makes that an effect of the step's square.
pub(super) fn ahead(time_step: f64) -> Ahead {
    let fast = ARC * time_step * time_step;
    Ahead { slow: 0.5 * time_step, fast, landing: fast }
}

impl PlanarEngine {
    /// The speed (cm/s) from which on landings cut steps of the engine's length.
    pub(super) fn landing_speed(&self) -> f64 {
        match self.law.friction {
            FrictionModel::Coulomb => LEAST_ACCELERATION * self.time_step,
            // The convex model's impacts depend on the length of the step.
            FrictionModel::Convex => f64::INFINITY,
        }
    }

    /// Sets the length of the coming steps (s), as [`ContactLaw::set_time_step`](super::law::ContactLaw::set_time_step).
    pub(super) fn set_length(&mut self, time_step: f64, ahead: Ahead) {
        self.weight = weight_of(self.numerical_damping, time_step);
        self.law.set_time_step(time_step, self.weight, ahead);
        if time_step.to_bits() == self.time_step.to_bits() {
            return;
        }
        self.time_step = time_step;
        set_implicit(&mut self.quads, &self.joint, &mut self.base_joint, self.weight, time_step);
        if let Some(extensions) = &mut self.extensions {
            extensions.set_time_step(time_step, &self.quads);
        }
    }

    /// Takes a step that was begun in parts. Out of line, for few steps come here.
    #[inline(never)]
    pub(super) fn advance_in_parts<S: Simd>(&mut self, simd: S) -> Result<(), EngineError> {
        let whole = self.time_step;
        let result = simd.vectorize(
            #[inline(always)]
            || self.take_parts(simd),
        );
        self.set_length(whole, ahead(whole));
        result
    }

    #[inline(always)]
    fn take_parts<S: Simd>(&mut self, simd: S) -> Result<(), EngineError> {
        let whole = self.time_step;
        let (mut left, mut impacts) = (whole, 0);
        self.floor.begin_parts();
        loop {
            let first = self.floor.first_landing();
            if first >= left || impacts == MOST_IMPACTS {
                self.end_step(simd)?;
                self.floor.end_part(&self.law);
                return Ok(());
            }
            // Half the impact's part at most.
            let most = LONGEST_IMPACT.min(left - first).max(SHORTEST_IMPACT);
            let length = if first <= most {
                impacts += 1;
                let half = first.max(SHORTEST_IMPACT);
                // Corners that would land later in this step are stopped as well.
                self.set_length((2.0 * half).min(left), Ahead { slow: half, fast: 0.0, landing: whole });
                2.0 * half
            } else {
                let length = first - BEFORE * most;
                self.set_length(length, ahead(length));
                length
            };
            self.begin_step(simd);
            self.end_step(simd)?;
            self.floor.end_part(&self.law);
            left -= length;
            if left < SHORTEST_IMPACT {
                return Ok(());
            }
            self.set_length(left, ahead(left));
            self.begin_step(simd);
        }
    }

    /// Time (s) until the first of the corners that come down faster than `least` (cm/s) lands, at constant velocities.
    #[inline(always)]
    pub(super) fn landing_here<S: Simd>(&mut self, simd: S, least: f64) -> f64 {
        let zero = Four::splat(simd, 0.0);
        let (mut moment, mut speed) = (zero, zero);
        for (quad, along) in self.quads.iter().zip(&mut self.scratch) {
            let [x, z] = quad.along_now(simd);
            let lever = quad.lever.on(simd);
            moment = fma(lever, z, moment);
            speed = fma(lever * x, quad.motion[0].on(simd), speed);
            *along = [x.into(), z.into()];
        }
        let height = self.centre[1] - Lanes::from(moment).sum();
        self.floor.landing(&self.quads, &self.scratch, self.levels, [height, self.velocity[1] - Lanes::from(speed).sum()], least)
    }
}
