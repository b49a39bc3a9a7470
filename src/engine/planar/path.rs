//! A step's contact problem solved along a path, one change of a contact mode at a time, where Newton's method cycles.
//!
//! In the plane (x, z) of a corner's excess e = w − w* each mode of Coulomb's law is a cone: open z > 0, sticking |x| ≤ −μ z, sliding what is left of
//! z ≤ 0 on either side. The cones fill the plane and the impulse λ(e) is continuous where they meet. So the contact problem,
//!
//! ```text
//! e − W λ(e) − q = 0
//! ```
//!
//! with the Delassus matrix W (velocities per impulse) and the excess q without impulses, is continuous, and linear for each choice of modes. The path begins
//! at some e in the cones of the present modes, where the left side is r, and follows left side = t r with t falling from 1: straight towards the solution for
//! these modes, which one solve of the recursion gives, until a first corner reaches the border of its cone. This corner changes its mode, and the path goes on
//! towards the solution for the new modes, or away from it (t grows) where only that leads across the border. It ends where a solution lies in the cones of
//! its modes.
//!
//! From the last modes of Newton's method the path is short, but may go to infinity. From open corners with r > 0 along z it is Lemke's, and ends. For
//! by the law λᵀe ≤ −R |λ_n|², while λᵀe = λᵀWλ + λᵀ(q + t r) ≥ λᵀ(q + t r): where t is large this is positive unless all corners are open, and
//! elsewhere R |λ_n|² ≤ −λᵀ(q + t r) bounds λ. Where corners reach borders at the same time, rounding decides the order. Of several solutions
//! (Painlevé) it gives the one at the path's end.
//!
//! C. E. Lemke, Management Science 11 (1965); D. E. Stewart and J. C. Trinkle, Int. J. Numer. Meth. Eng. 39 (1996); D. Ralph, Math. Oper. Res. 19 (1994)
//! and S. P. Dirkse and M. C. Ferris, Optim. Methods Softw. 5 (1995) (paths of piecewise linear equations).

use fearless_simd::Simd;
use wide::f64x2;

use super::PlanarEngine;
use super::contact::{Corners, OPEN, PUSHED_FORWARD, STICKS};
use super::lanes::fma;
use super::law::ContactLaw;

/// Mode changes per pair of candidates after which a path is given up; up to 11 were needed.
const MOST_CHANGES: usize = 16;
/// Excess velocity (cm/s), above the floor or beside the border to sticking, at which a corner begins that is not in its mode's cone.
const OFF_THE_BORDER: f64 = 1.0;
/// Fraction by which these first velocities differ among open corners, so that few reach borders at the same time.
const UNEVEN: f64 = 0.5;

/// Golden ratio: fractional parts of its multiples fill [0, 1] evenly.
const GOLDEN: f64 = 0.618_033_988_749_895;

/// Where a path begins.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Start {
    /// With the modes of the newest solution.
    Present,
    /// With all corners open.
    Open,
}

/// Two corners on the path.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Pair {
    place: usize,
    near: [bool; 2],
    friction: [f64; 2],
    modes: [f64; 2],
    /// Normals a of the cones' borders a·e ≥ 0; zero where there is none.
    borders: [[f64x2; 2]; 2],
    /// Excess velocities (cm/s) on the path, and in the solution for the modes.
    at: [f64x2; 2],
    to: [f64x2; 2],
}

#[inline(always)]
fn dot(a: [f64x2; 2], b: [f64x2; 2]) -> f64x2 {
    fma(a[0], b[0], a[1] * b[1])
}

#[inline(always)]
fn set_lane(of: &mut f64x2, lane: usize, to: f64) {
    let mut both = of.to_array();
    both[lane] = to;
    *of = f64x2::new(both);
}

impl Pair {
    /// Corners with these excess velocities (cm/s) in the newest solution. The path begins there, except for corners outside their mode's cone: they begin
    /// in it, pressed down by `pressed` (cm/s).
    #[inline(always)]
    fn new(place: usize, corners: &Corners, excess: [f64x2; 2], pressed: f64) -> Self {
        let modes = corners.modes();
        let mut pair = Self { place, modes, at: excess, to: excess, ..Self::default() };
        let agree = corners.agree();
        for lane in 0..2 {
            let Some((_, friction)) = corners.near(lane) else { continue };
            (pair.near[lane], pair.friction[lane]) = (true, friction);
            pair.enter(lane, modes[lane]);
            if agree[lane] {
                continue;
            }
            let [x, z] = excess.map(|part| part.to_array()[lane]);
            let [x, z] = if modes[lane] == OPEN {
                [x, OFF_THE_BORDER]
            } else if modes[lane] == STICKS {
                [0.0, -pressed]
            } else {
                let (z, sign) = (z.min(-pressed), -modes[lane].signum());
                let least = -friction * z;
                [if x * sign > least { x } else { sign * (least + OFF_THE_BORDER) }, z]
            };
            set_lane(&mut pair.at[0], lane, x);
            set_lane(&mut pair.at[1], lane, z);
        }
        pair
    }

    /// Begins with open corners, which have these excess velocities (cm/s) while open. `index` makes them differ from others.
    #[inline(always)]
    fn open(&mut self, excess: [f64x2; 2], index: usize) {
        self.to = excess;
        let height = |lane: usize| OFF_THE_BORDER * (1.0 + UNEVEN * ((2 * index + lane) as f64 * GOLDEN).fract());
        self.at = [excess[0], excess[1].fast_max(f64x2::ZERO) + f64x2::new([height(0), height(1)])];
        for lane in 0..2 {
            if self.near[lane] {
                self.enter(lane, OPEN);
            }
        }
    }

    /// Sets a corner's mode.
    #[inline(always)]
    fn enter(&mut self, lane: usize, mode: f64) {
        self.modes[lane] = mode;
        let friction = self.friction[lane];
        let borders = if mode == OPEN {
            [[0.0, 1.0], [0.0, 0.0]]
        } else if mode == STICKS {
            [[-1.0, -friction], [1.0, -friction]]
        } else {
            [[0.0, -1.0], [-mode.signum(), friction]]
        };
        for (border, numbers) in self.borders.iter_mut().zip(borders) {
            (0..2).for_each(|k| set_lane(&mut border[k], lane, numbers[k]));
        }
    }

    /// The mode beyond a border of a corner's cone.
    #[inline(always)]
    fn mode_beyond(&self, lane: usize, border: usize) -> f64 {
        let mode = self.modes[lane];
        if mode == OPEN {
            PUSHED_FORWARD.copysign(-self.at[0].to_array()[lane])
        } else if mode == STICKS {
            if border == 0 { -PUSHED_FORWARD } else { PUSHED_FORWARD }
        } else if border == 0 {
            OPEN
        } else {
            STICKS
        }
    }

    /// Where a corner reaches a border before the fraction `first` of the way to the solution, backward if `direction` is −1: fraction, lane and border.
    #[inline(always)]
    fn leaves_before(&self, first: f64, direction: f64x2) -> Option<(f64, usize, usize)> {
        let step = [0, 1].map(|k| (self.to[k] - self.at[k]) * direction);
        let fall = self.borders.map(|border| -dot(border, step));
        let left = self.borders.map(|border| dot(border, self.at).fast_max(f64x2::ZERO));
        let before = [0, 1].map(|k| fall[k].simd_gt(f64x2::ZERO) & left[k].simd_lt(fall[k] * f64x2::splat(first)));
        // Most corners do not.
        if !(before[0] | before[1]).any() {
            return None;
        }
        let (mut share, mut found) = (first, None);
        for (border, lane) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
            let [fall, left] = [fall[border], left[border]].map(|of| of.to_array()[lane]);
            if fall > 0.0 && left < fall * share {
                share = left / fall;
                found = Some((share, lane, border));
            }
        }
        found
    }

    /// Moves along the path by a fraction of the way to the solution.
    #[inline(always)]
    fn go(&mut self, share: f64x2) {
        (0..2).for_each(|k| self.at[k] = fma(share, self.to[k] - self.at[k], self.at[k]));
    }

    /// Changes the mode of a corner at a border, and returns that border.
    #[inline(always)]
    fn cross(&mut self, lane: usize, border: usize) -> [f64; 2] {
        let crossed = self.borders[border].map(|part| part.to_array()[lane]);
        self.enter(lane, self.mode_beyond(lane, border));
        crossed
    }

    /// True if towards the solution a corner moves further across the border by which it came into its mode.
    #[inline(always)]
    fn goes_across(&self, lane: usize, border: [f64; 2]) -> bool {
        let [x, z] = [0, 1].map(|k| (self.to[k] - self.at[k]).to_array()[lane]);
        border[0] * x + border[1] * z <= 0.0
    }
}

impl PlanarEngine {
    /// Follows a path; true if it ends in a solution of the whole chain's contact. Out of line, for few steps come here.
    #[inline(never)]
    pub(super) fn follow_path<S: Simd>(&mut self, simd: S, start: Start, law: &ContactLaw) -> bool {
        self.paths += 1;
        let mut pairs = std::mem::take(&mut self.path);
        let solved = simd.vectorize(
            #[inline(always)]
            || {
                self.go_along_path(&mut pairs, start, law);
                self.is_solved(&self.floor.all(), law)
            },
        );
        self.path = pairs;
        solved
    }

    /// Follows the path to its end, or until it is lost: to infinity, or by rounding in a cycle about a point where several modes change.
    #[inline(always)]
    fn go_along_path(&mut self, pairs: &mut Vec<Pair>, start: Start, law: &ContactLaw) {
        let (levels, all) = (0..self.levels, self.floor.all());
        // A body's mass at 1 cm/s as impulse.
        let pressed = self.mass / self.count as f64 / law.stiffness;
        pairs.clear();
        let listed = self.floor.listed();
        pairs.extend(listed.map(|(place, corners)| Pair::new(place, corners, self.floor.excess(place, &self.quads), pressed)));
        if start == Start::Open {
            pairs.iter().for_each(|pair| self.floor.set_modes(pair.place, [OPEN; 2]));
            self.solve_with_modes(&levels, &all, law);
            for (k, pair) in pairs.iter_mut().enumerate() {
                pair.open(self.floor.excess(pair.place, &self.quads), k);
            }
        }
        let mut direction = 1.0;
        for _ in 0..MOST_CHANGES * pairs.len() {
            let (mut first, mut changes) = (f64::INFINITY, None);
            for (k, pair) in pairs.iter().enumerate() {
                if let Some((share, lane, border)) = pair.leaves_before(first, f64x2::splat(direction)) {
                    (first, changes) = (share, Some((k, lane, border)));
                }
            }
            if direction > 0.0 && first >= 1.0 {
                return;
            }
            let Some((k, lane, border)) = changes else { return };
            pairs.iter_mut().for_each(|pair| pair.go(f64x2::splat(direction * first)));
            let crossed = pairs[k].cross(lane, border);
            self.floor.set_modes(pairs[k].place, pairs[k].modes);
            self.solve_with_modes(&levels, &all, law);
            pairs.iter_mut().for_each(|pair| pair.to = self.floor.excess(pair.place, &self.quads));
            direction = if pairs[k].goes_across(lane, crossed) { 1.0 } else { -1.0 };
        }
    }
}

#[cfg(test)]
mod tests {
    use fearless_simd::dispatch;

    use super::*;
    use crate::drive::Means;
    use crate::engine::Engine;
    use crate::experiment::{self, Source};

    /// In every step, on smooth and on rough ground, the path from open corners leads to a solution, and so do nearly all that begin with the modes of the
    /// step before. At low friction the solution is unique, so it is that of Newton's method.
    #[test]
    fn every_path_leads_to_a_solution() {
        for (low, high, film_fraction) in [(0.3_f64, 0.3, 0.0), (0.2, 4.0, 0.667), (8.0, 0.1, 0.25)] {
            let text = format!(
                "[robot]\nactuators = 5\nmotors_per_actuator = 3\n\
                 friction = {{ low = {low}, high = {high}, film_fraction = {film_fraction} }}\n\
                 [drive]\nwaveform = \"sequence\"\nfrequency_hz = 14.0\n\
                 phases = [{{ until = 0.5, voltages_v = [520, -1500, 0, -1500, 520] }}, \
                 {{ until = 1.0, voltages_v = [0, 520, 0, -1500, 520] }}]\n\
                 [simulation]\nengine = \"planar\"\ntime_step_s = 1e-4\nsteps = 5000\n"
            );
            let experiment = experiment::experiment(&Source::from_text("rough", &text)).unwrap();
            let mut engine = PlanarEngine::new(&experiment.robot, 1e-4).unwrap();
            let (law, whole) = (engine.law, 0..engine.levels);
            let (mut voltages, mut touched, mut lost) = ([0.0; 5], 0, 0);
            for step in 0..experiment.steps {
                let time = step as f64 * 1e-4;
                Means::new(&experiment.drive, 5, time).over(time, time + 1e-4, &mut voltages);
                engine.prepare(&voltages).unwrap();
                let start = engine.save().unwrap();
                let mut means = |solve: &mut dyn FnMut(&mut PlanarEngine)| {
                    dispatch!(engine.level, simd => engine.begin_step(simd));
                    solve(&mut engine);
                    let found: Vec<_> = engine.quads.iter().flat_map(|quad| [quad.mean[1], quad.mean[2]]).collect();
                    touched += usize::from(!engine.floor.all().is_empty());
                    engine.load(step, &start).unwrap();
                    found
                };
                let newton = means(&mut |engine| dispatch!(engine.level, simd => engine.solve_on_floor(simd, &law)).unwrap());
                for begin in [Start::Present, Start::Open] {
                    let mut solved = false;
                    let path = means(&mut |engine| {
                        let all = engine.floor.all();
                        solved = dispatch!(engine.level, simd => {
                            engine.solve_and_update_active_set(&whole, &all, &law, |_, _| ());
                            engine.follow_path(simd, begin, &law)
                        });
                    });
                    if !solved && begin == Start::Present {
                        lost += 1;
                        continue;
                    }
                    assert!(solved, "friction {low}, {high}: step {step}");
                    let apart = newton.iter().zip(path).flat_map(|(a, b)| (*a - b).abs().to_array()).fold(0.0, f64::max);
                    // Of rounding.
                    assert!(apart < 1e-6 || low.max(high) > 1.0, "friction {low}: step {step}, {begin:?}: {apart} cm/s");
                }
                engine.advance().unwrap();
            }
            // Seen: 1 of 12,700, of films of 4 on 0.2.
            assert!(touched > 10_000 && lost < 10, "friction {low}, {high}: {lost} of {touched}");
        }
    }
}
