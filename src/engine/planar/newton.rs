//! Newton's method over the states of the corners.

use fearless_simd::{Simd, prelude::*};

use super::contact::Law;
use super::lanes::{Four, Lanes, fma, inner};
use super::recursion::{Motions, solve};
use super::{EngineError, FrictionModel, PlanarEngine};
use crate::model::Mount;

/// Newton steps after which a contact problem is given up, and more of them per body of the chain. Measured with one [`WHOLE`] step: 41 in the paper's robots; when a
/// whole chain of 961 bodies is set in motion at once, 799.
const LARGEST_ITERATIONS: u32 = 100;
const MORE_PER_BODY: u32 = 4;
/// Newton steps that are taken whole before the way is searched for the lowest cost. Measured: within 1 % as many steps in all as with one.
const WHOLE: u32 = 3;
/// The search ends where the slope of the cost is this share of the one it began with.
const SEARCH_ENOUGH: f64 = 0.1;
/// Steps of the search along one Newton step; it ends much earlier.
const LARGEST_SEARCH: u32 = 60;
/// A Newton step is the last if the cost falls by less than these shares of m (g h)² and, per body, of the kinetic energy: the first is a
/// velocity of 10⁻⁶ of what gravity gives in a step, the second what rounding leaves (measured: 3·10⁻²⁰ for 16 bodies and for 961).
const DONE_OF_GRAVITY: f64 = 1e-12;
const DONE_OF_KINETIC: f64 = 1e-18;

/// Fixed-point iterations towards Coulomb's friction end when no lift changes by more than this (cm/s), or after so many: then the last one
/// stands. Measured at 5 Hz: a hundredth of this changes speeds of the paper's sequence by 1 % on films of friction 4 and by 3 to 6 % on films of 1.
const LIFT_ENOUGH: f64 = 0.1;
const LARGEST_LIFTS: u32 = 100;

/// How a search along a Newton step ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Search {
    /// The cost cannot fall any more.
    Done,
    /// The lowest cost is at the end of the step.
    Whole,
    /// It is on the way.
    Part,
}

impl PlanarEngine {
    /// Solves the step's mean motion, with the floor.
    #[inline(always)]
    pub(super) fn solve_on_floor<S: Simd>(&mut self, simd: S, law: &Law) -> Result<(), EngineError> {
        let near = self.mount == Mount::Ground && {
            let (height, velocity) = self.root_over_floor(simd);
            self.floor.find(&self.quads, self.rungs, height, velocity, law)
        };
        for lifts in 0..=LARGEST_LIFTS {
            let iterations = self.newton(simd, law)?;
            if !near {
                break;
            }
            self.iterations += iterations;
            if self.friction == FrictionModel::Convex || lifts == LARGEST_LIFTS {
                break;
            }
            let mut changed = 0.0_f64;
            self.floor.near(&self.quads, |corners, mean| changed = changed.max(corners.take_off_lift(mean, law)));
            if changed < LIFT_ENOUGH {
                break;
            }
        }
        Ok(())
    }

    /// Newton's method for the corners as they are placed.
    ///
    /// The cost ½ uᵀAu − uᵀb + Σ R/2 |λ|² is convex with piecewise linear gradient. A Newton step solves for the linear pieces of the
    /// iterate; if the solution lies on the same pieces it is exact, otherwise the cost is lowered along the way there.
    #[inline(always)]
    fn newton<S: Simd>(&mut self, simd: S, law: &Law) -> Result<u64, EngineError> {
        let largest = LARGEST_ITERATIONS + MORE_PER_BODY * self.count as u32;
        for iteration in 1..=largest {
            solve(&mut self.quads, self.rungs, self.hold, self.floor.inwards(), law);
            let mut agrees = true;
            self.floor.near(&self.quads, |corners, mean| agrees &= corners.agrees(mean, law));
            if agrees {
                return Ok(iteration.into());
            }
            match if iteration <= WHOLE { Search::Whole } else { self.search(simd, law) } {
                Search::Done => return Ok(iteration.into()),
                Search::Part => {}
                Search::Whole => {
                    // The first states were a guess: any motion will do for an iterate.
                    self.floor.near(&self.quads, |corners, mean| corners.accept(mean));
                    for (iterate, quad) in self.iterate.iter_mut().zip(&self.quads) {
                        *iterate = quad.mean;
                    }
                }
            }
        }
        let time = self.step as f64 * self.time_step;
        Err(EngineError::NotConverged { iterations: largest, step: self.step, time })
    }

    /// Lowers the cost between the iterate and the rungs' mean motion, and moves the iterate there.
    ///
    /// With d the way, f'(t) = λ₁·d − (1 − t) dᵀAd − λ(t)·d, where λ₁ is the impulse at the end by the iterate's linear pieces. Of corners
    /// that stay on their pieces λ₁·d − λ(t)·d is linear in 1 − t, and goes into dᵀAd.
    #[inline(always)]
    fn search<S: Simd>(&mut self, simd: S, law: &Law) -> Search {
        let zero = Four::splat(simd, 0.0);
        let (mut metric, mut kinetic) = (zero, zero);
        let mut before = None;
        for (quad, iterate) in self.quads.iter().zip(&self.iterate) {
            let (mass, inertia) = (quad.mass.on(simd), quad.inertia.on(simd));
            let way: Motions<S> = std::array::from_fn(|i| quad.mean[i].on(simd) - iterate[i].on(simd));
            let [turn, x, z] = quad.of_centre(way);
            metric += mass * fma(x, x, z * z) + inertia * turn * turn;
            // The root has no joint. Lanes without mass follow their inner neighbours: their joints do not turn.
            let (inner, last) = inner(turn, before.unwrap_or(turn.split().0));
            let rate = turn - inner;
            metric += quad.implicit.on(simd) * rate * rate;
            before = Some(last);
            let [turn, x, z] = quad.mean_of_centre(simd);
            kinetic += mass * fma(x, x, z * z) + inertia * turn * turn;
        }
        let (metric, kinetic) = (Lanes::from(metric).sum(), Lanes::from(kinetic).sum());
        let [fall, end] = self.floor.aim(&self.quads, law);
        let metric = metric + fall;
        let slope_at = |t: f64| {
            let [along, slope] = self.floor.search(t, law);
            (end - (1.0 - t) * metric - along, metric - slope)
        };
        let start = -slope_at(0.0).0;
        let weight = self.gravity * self.time_step;
        if start <= DONE_OF_GRAVITY * self.mass * weight * weight + DONE_OF_KINETIC * kinetic * self.count as f64 {
            return Search::Done;
        }
        let (mut low, mut high, mut t) = (0.0, 1.0, 1.0);
        let mut found = 1.0;
        for _ in 0..LARGEST_SEARCH {
            let (first, second) = slope_at(t);
            found = t;
            if first.abs() <= SEARCH_ENOUGH * start || (t == 1.0 && first < 0.0) {
                break;
            }
            if first > 0.0 {
                high = t;
            } else {
                low = t;
            }
            let next = t - first / second;
            t = if next > low && next < high { next } else { 0.5 * (low + high) };
            if t == found || high - low <= f64::EPSILON * high {
                break;
            }
        }
        if found == 1.0 {
            return Search::Whole;
        }
        for (iterate, quad) in self.iterate.iter_mut().zip(&self.quads) {
            for (from, to) in iterate.iter_mut().zip(&quad.mean) {
                let start = from.on(simd);
                *from = fma(to.on(simd) - start, Four::splat(simd, found), start).into();
            }
        }
        self.floor.near(&self.quads, |corners, _| corners.go(found, law));
        Search::Part
    }
}
