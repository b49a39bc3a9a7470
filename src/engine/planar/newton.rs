//! Newton's method over the states of the corners.

use wide::f64x2;

use super::contact::Law;
use super::floor::Floor;
use super::recursion::{Hold, Spatials, solve};
use super::{EngineError, FrictionModel, PlanarEngine};

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
    /// Solves the step's mean motion with the floor; false, and nothing done, if no corner is near it.
    pub(super) fn solve_on_floor(&mut self, law: &Law) -> Result<bool, EngineError> {
        let Some(mut floor) = self.floor.take() else { return Ok(false) };
        let solved = self.solve_with(&mut floor, law);
        self.floor = Some(floor);
        solved
    }

    fn solve_with(&mut self, floor: &mut Floor, law: &Law) -> Result<bool, EngineError> {
        let (height, velocity) = self.root_over_floor();
        if !floor.find(&self.rungs, height, velocity, law) {
            return Ok(false);
        }
        self.newton(floor, law)?;
        if self.friction == FrictionModel::Coulomb {
            for _ in 0..LARGEST_LIFTS {
                let mut changed = 0.0_f64;
                floor.near(&self.rungs, |corners, mean| changed = changed.max(corners.take_off_lift(mean, law)));
                if changed < LIFT_ENOUGH {
                    break;
                }
                self.newton(floor, law)?;
            }
        }
        Ok(true)
    }

    /// Newton's method for the corners as they are placed.
    ///
    /// The cost ½ uᵀAu − uᵀb + Σ R/2 |λ|² is convex with piecewise linear gradient. A Newton step solves for the linear pieces of the
    /// iterate; if the solution lies on the same pieces it is exact, otherwise the cost is lowered along the way there.
    fn newton(&mut self, floor: &mut Floor, law: &Law) -> Result<(), EngineError> {
        let largest = LARGEST_ITERATIONS + MORE_PER_BODY * self.count as u32;
        for iteration in 1..=largest {
            self.iterations += 1;
            solve(&mut self.rungs, Hold::Free, floor.inwards(), law);
            let mut agrees = true;
            floor.near(&self.rungs, |corners, mean| agrees &= corners.agrees(mean, law));
            if agrees {
                return Ok(());
            }
            match if iteration <= WHOLE { Search::Whole } else { self.search(floor, law) } {
                Search::Done => return Ok(()),
                Search::Part => {}
                Search::Whole => {
                    // The first states were a guess: any motion will do for an iterate.
                    floor.near(&self.rungs, |corners, mean| corners.accept(mean));
                    for (iterate, rung) in self.iterate.iter_mut().zip(&self.rungs) {
                        *iterate = rung.mean;
                    }
                }
            }
        }
        let time = self.step as f64 * self.time_step;
        Err(EngineError::NotConverged { iterations: largest, step: self.step, time })
    }

    /// Lowers the cost between the iterate and the rungs' mean motion, and moves the iterate there.
    ///
    /// With d the way, f'(t) = λ₁·d − (1 − t) dᵀAd − λ(t)·d, where λ₁ is the impulse at the end by the iterate's linear pieces.
    fn search(&mut self, floor: &mut Floor, law: &Law) -> Search {
        let (mut metric, mut kinetic) = (f64x2::ZERO, f64x2::ZERO);
        let mut inner = f64x2::ZERO;
        for (k, (rung, iterate)) in self.rungs.iter().zip(&self.iterate).enumerate() {
            let way: Spatials = std::array::from_fn(|i| rung.mean[i] - iterate[i]);
            let [turn, x, z] = rung.of_centre(way);
            metric += rung.mass * (x * x + z * z) + rung.inertia * turn * turn;
            if k > 0 {
                let rate = turn - inner;
                // Lanes without mass follow their inner neighbours: their joints do not turn.
                metric += rung.implicit * rate * rate;
            }
            inner = if k > 0 { turn } else { f64x2::splat(turn.to_array()[0]) };
            let [turn, x, z] = rung.mean_of_centre();
            kinetic += rung.mass * (x * x + z * z) + rung.inertia * turn * turn;
        }
        let (metric, kinetic) = (metric.reduce_add(), kinetic.reduce_add());
        let mut end = 0.0;
        floor.near(&self.rungs, |corners, mean| {
            let [a, b] = corners.aim(mean, law).to_array();
            end = end + a + b;
        });
        let slope_at = |t: f64| {
            let [along, slope] = floor.sum(|corners| corners.search(t, law));
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
        let share = f64x2::splat(found);
        for (iterate, rung) in self.iterate.iter_mut().zip(&self.rungs) {
            for (from, to) in iterate.iter_mut().zip(&rung.mean) {
                *from += share * (*to - *from);
            }
        }
        floor.near(&self.rungs, |corners, _| corners.go(found, law));
        Search::Part
    }
}
