//! Newton's method over the contact modes: each step solves for the present modes, then takes those that the solution requires.

use std::ops::Range;

use fearless_simd::{Level, Simd, dispatch, prelude::*};

use super::lanes::{Four, Lanes, Two, fma, inner};
use super::law::{ContactLaw, FrictionModel};
use super::path::Start;
use super::quad::{Motions, Quad};
use super::recursion::{Articulated, BLOCK, BaseJoint, ContactTerms, Distal, solve};
use super::{EngineError, PlanarEngine};
use crate::model::Mount;

/// Newton steps after which a contact problem is an error: this many, and more per body. The paper's robots need up to 33, a chain of 961 bodies that is set
/// in motion at once 94; steps in parts are not counted.
pub(super) const LARGEST_STEPS: u32 = 100;
pub(super) const MORE_PER_BODY: u32 = 4;
/// Full Newton steps before the first line search.
const WHOLE: u32 = 3;
/// A line search ends where the slope of the cost is this fraction of the first one.
const SEARCH_ENOUGH: f64 = 0.1;
/// Most steps of a line search; it ends much earlier.
const LARGEST_SEARCH: u32 = 60;
/// In chains of more tree levels than this, the parts where modes change are solved first (docs/performance.md).
pub(super) const LONGEST_WHOLE: usize = 40;
/// Rounds over these parts, and Newton steps in each.
const ROUNDS: u32 = 3;
const STEPS_IN_PART: u32 = 30;
/// A Newton step is the last if the cost falls by less than these fractions of m (g h)² and, per body, of the kinetic energy: a velocity of 10⁻⁶ of what
/// gravity gives in a step, and rounding (3·10⁻²⁰ for 16 bodies and for 961).
const DONE_OF_GRAVITY: f64 = 1e-12;
const DONE_OF_KINETIC: f64 = 1e-18;

/// Under Coulomb's law, which has no cost to lower, Newton's method may cycle. After this many steps a path is followed instead ([`path`](super::path)).
const BEFORE_PATH: u32 = 2;
/// How often contact is made more compliant in an instant that is not solved.
const SOFTENINGS: u32 = 2;
/// Newton steps after which a part of a long chain is left, for no path goes through parts.
const COULOMB_STEPS_IN_PART: u32 = 8;
/// A mismatch of impulses below this fraction of the robot's weight over the step, or of the largest impulse, is rounding.
const MISMATCH: f64 = 1e-7;
/// Rounding of velocities, as a fraction of the largest: 1024 units in the last place.
const ROUNDING: f64 = 1024.0 * f64::EPSILON;

/// How a line search ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Search {
    /// The cost cannot fall any more.
    Done,
    /// The lowest cost is at the end of the step.
    Whole,
    /// It is in between.
    Part,
}

/// [`solve`] with tapes or cables at the sheet. Out of line, for few robots have them; so it is compiled for the machine's instructions here.
#[inline(never)]
fn solve_attached(
    level: Level,
    skew: bool,
    quads: &mut [Quad],
    levels: Range<usize>,
    base_joint: &BaseJoint,
    contact: impl ContactTerms,
    distal: &mut [Distal],
) -> Articulated {
    dispatch!(level, simd => simd.vectorize(
        #[inline(always)]
        || {
            if skew {
                solve::<true>(quads, levels, base_joint, contact, distal)
            } else {
                solve::<false>(quads, levels, base_joint, contact, distal)
            }
        },
    ))
}

impl PlanarEngine {
    /// Finds the contact candidates of the step.
    #[inline(always)]
    pub(super) fn find_corners<S: Simd>(&mut self, simd: S, law: &ContactLaw) {
        if self.mount == Mount::Ground {
            let (height, motion) = self.root_over_floor(simd);
            self.floor.find(&self.quads, self.levels, height, motion, law);
        }
    }

    /// Solves for the step's mean motion with the candidates found.
    #[inline(always)]
    pub(super) fn solve_on_floor<S: Simd>(&mut self, simd: S, law: &ContactLaw) -> Result<(), EngineError> {
        let iterations = self.newton(simd, law)?;
        if !self.floor.all().is_empty() {
            self.iterations += iterations;
        }
        Ok(())
    }

    /// Solves the contact problem; returns the number of Newton steps.
    #[inline(always)]
    fn newton<S: Simd>(&mut self, simd: S, law: &ContactLaw) -> Result<u64, EngineError> {
        let mut steps = 0;
        if !self.distal.is_empty() {
            let (in_parts, done) = self.newton_in_parts(simd, law);
            if done {
                return Ok(in_parts);
            }
            steps = in_parts;
        }
        let (largest, mut law) = (self.largest_steps, *law);
        for _ in 0..=SOFTENINGS {
            let (whole, done) = self.newton_steps(simd, 0..self.levels, self.floor.all(), largest, &law);
            steps += whole;
            if done {
                return Ok(steps);
            }
            if law.friction == FrictionModel::Convex || !law.is_instant {
                break;
            }
            // Impulses may be so small that rounding hides the compliance. In longer steps a softer contact would change the result.
            law.soften();
        }
        let time = self.step as f64 * self.time_step;
        Err(EngineError::NotConverged { iterations: largest, step: self.step, time })
    }

    /// Mode changes act locally. Solving each cluster of changed blocks on its own, after a step for the whole chain, keeps one hard cluster from holding up
    /// the rest. Returns the number of steps, and true if the whole chain is solved. Out of line, for short chains never come here.
    #[inline(never)]
    fn newton_in_parts<S: Simd>(&mut self, simd: S, law: &ContactLaw) -> (u64, bool) {
        simd.vectorize(
            #[inline(always)]
            || self.newton_rounds(simd, law),
        )
    }

    #[inline(always)]
    fn newton_rounds<S: Simd>(&mut self, simd: S, law: &ContactLaw) -> (u64, bool) {
        let mut steps = 0;
        for _ in 0..ROUNDS {
            let (whole, among) = (0..self.levels, self.floor.all());
            let mut blocks_with_changed_modes = std::mem::take(&mut self.blocks_with_changed_modes);
            blocks_with_changed_modes.fill(false);
            self.solve_and_update_active_set(&whole, &among, law, |level, agrees| {
                blocks_with_changed_modes[level / BLOCK] |= !agrees
            });
            self.blocks_with_changed_modes = blocks_with_changed_modes;
            steps += 1;
            if !self.blocks_with_changed_modes.contains(&true) {
                return (steps, true);
            }
            self.accept(&whole, &among);
            let mut end = self.blocks_with_changed_modes.len();
            while let Some(last) = self.blocks_with_changed_modes[..end].iter().rposition(|changed| *changed) {
                // A cluster of changed blocks, with its proximal neighbour.
                end = self.blocks_with_changed_modes[..last].iter().rposition(|changed| !*changed).unwrap_or(0);
                let part = BLOCK * end..self.levels.min(BLOCK * (last + 1));
                let among = self.floor.among(&part);
                steps += self.newton_steps(simd, part, among, STEPS_IN_PART, law).0;
            }
        }
        (steps, false)
    }

    /// Solves for the present modes, evaluates which modes the solution requires, and calls `each` with tree level and whether these are the present ones.
    #[inline(always)]
    pub(super) fn solve_and_update_active_set(
        &mut self,
        levels: &Range<usize>,
        among: &Range<usize>,
        law: &ContactLaw,
        mut each: impl FnMut(usize, bool),
    ) -> Articulated {
        let at_root = self.solve_with_modes(levels, among, law);
        self.floor.near(among, &self.quads, |level, corners, mean| each(level, corners.agrees(mean, law)));
        at_root
    }

    /// Solves for the present contact modes.
    #[inline(always)]
    pub(super) fn solve_with_modes(&mut self, levels: &Range<usize>, among: &Range<usize>, law: &ContactLaw) -> Articulated {
        // Distal articulated inertias stored from other solves may be unsymmetric, so parts are always solved as such under Coulomb's law.
        let skew = law.friction == FrictionModel::Coulomb && (!self.distal.is_empty() || self.floor.slides());
        let floor = self.floor.tip_to_base(among, law);
        if let Some(attachments) = &self.attachments {
            let contact = attachments.with(floor);
            return solve_attached(
                self.level,
                skew,
                &mut self.quads,
                levels.clone(),
                &self.base_joint,
                contact,
                &mut self.distal,
            );
        }
        if skew {
            solve::<true>(&mut self.quads, levels.clone(), &self.base_joint, floor, &mut self.distal)
        } else {
            solve::<false>(&mut self.quads, levels.clone(), &self.base_joint, floor, &mut self.distal)
        }
    }

    /// Newton's method for `levels`, whose candidates are `among`; returns the number of steps, at most `largest`, and true if they ended in a solution.
    ///
    /// With the convex model the cost ½ uᵀAu − uᵀb + Σ R/2 |λ|² has a piecewise linear gradient. A Newton step solves for the linear pieces of the iterate; if
    /// the solution lies on the same pieces it is exact, otherwise a line search lowers the cost towards it.
    #[inline(always)]
    fn newton_steps<S: Simd>(
        &mut self,
        simd: S,
        levels: Range<usize>,
        among: Range<usize>,
        largest: u32,
        law: &ContactLaw,
    ) -> (u64, bool) {
        for step in 1..=largest {
            let mut agrees = true;
            let at_root = self.solve_and_update_active_set(&levels, &among, law, |_, agree| agrees &= agree);
            if agrees {
                return (step.into(), true);
            }
            if law.friction == FrictionModel::Coulomb {
                if step > BEFORE_PATH && levels.len() == self.levels {
                    let solved = self.is_rounding(&among, law)
                        || self.follow_path(simd, Start::Present, law)
                        || self.follow_path(simd, Start::Open, law);
                    return (step.into(), solved);
                }
                if step == COULOMB_STEPS_IN_PART {
                    return (step.into(), false);
                }
                self.floor.near(&among, &self.quads, |_, corners, _| corners.adopt_required_modes());
                continue;
            }
            match if step <= WHOLE { Search::Whole } else { self.search(simd, &levels, &among, &at_root, law) } {
                Search::Done => return (step.into(), true),
                Search::Part => {}
                Search::Whole => self.accept(&levels, &among),
            }
        }
        (largest.into(), false)
    }

    /// True if the newest solution has the modes that it requires, but for rounding.
    pub(super) fn is_solved(&mut self, among: &Range<usize>, law: &ContactLaw) -> bool {
        let mut agrees = true;
        self.floor.near(among, &self.quads, |_, corners, mean| agrees &= corners.agrees(mean, law));
        agrees || self.is_rounding(among, law)
    }

    /// True if the impulses of the newest solution are the law's but for rounding, which contact stiffness multiplies.
    fn is_rounding(&mut self, among: &Range<usize>, law: &ContactLaw) -> bool {
        let (mut mismatch, mut largest, mut speed) = (0.0_f64, self.mass * self.gravity * self.time_step, 0.0_f64);
        self.floor.near(among, &self.quads, |_, corners, mean| {
            mismatch = mismatch.max(corners.mismatch(mean, law));
            largest = largest.max(corners.largest_impulse());
            speed = mean[1..].iter().flat_map(|part| part.abs().to_array()).fold(speed, f64::max);
        });
        mismatch <= MISMATCH * largest + ROUNDING * speed * law.stiffness
    }

    /// Makes the newest solution the iterate.
    #[inline(always)]
    fn accept(&mut self, levels: &Range<usize>, among: &Range<usize>) {
        self.floor.near(among, &self.quads, |_, corners, mean| corners.accept(mean));
        let quads = quads_of(levels);
        for (iterate, quad) in self.iterate[quads.clone()].iter_mut().zip(&self.quads[quads]) {
            *iterate = quad.mean;
        }
    }

    /// dᵀAd, with the search direction d from the iterate to the mean motion of `levels` and the matrix A that it was solved with; and twice the kinetic
    /// energy of the mean motion (erg).
    #[inline(always)]
    fn measure<S: Simd>(&self, simd: S, levels: &Range<usize>, at_root: &Articulated) -> [f64; 2] {
        let zero = Four::splat(simd, 0.0);
        let (mut metric, mut kinetic) = (zero, zero);
        let mut before = Two::splat(simd, 0.0);
        let quads = quads_of(levels);
        for (quad, iterate) in self.quads[quads.clone()].iter().zip(&self.iterate[quads]) {
            let d: Motions<S> = std::array::from_fn(|i| quad.mean[i].on(simd) - iterate[i].on(simd));
            let (inner, last) = inner(d[0], before);
            before = last;
            metric += quad.metric(d, inner);
            let [turn, x, z] = quad.mean_of_centre(simd);
            kinetic += quad.mass.on(simd) * fma(x, x, z * z) + quad.inertia.on(simd) * turn * turn;
        }
        let root = [0, 1, 2].map(|i| self.quads[0].mean[i].lane(0) - self.iterate[0][i].lane(0));
        [Lanes::from(metric).sum() + at_root.metric(root), Lanes::from(kinetic).sum()]
    }

    /// Line search: lowers the cost between the iterate and the mean motion of `levels`, and moves the iterate there.
    ///
    /// With the search direction d and the matrix A of the mean motion, f'(t) = −(1 − t) dᵀAd as long as all corners stay on the
    /// iterate's pieces. For those that leave theirs, the piece's terms are replaced by the law at t.
    #[inline(always)]
    fn search<S: Simd>(
        &mut self,
        simd: S,
        levels: &Range<usize>,
        among: &Range<usize>,
        at_root: &Articulated,
        law: &ContactLaw,
    ) -> Search {
        let [metric, kinetic] = self.measure(simd, levels, at_root);
        let weight = self.gravity * self.time_step;
        if metric <= DONE_OF_GRAVITY * self.mass * weight * weight + DONE_OF_KINETIC * kinetic * self.count as f64 {
            return Search::Done;
        }
        let [end, changing] = self.floor.aim(among, &self.quads, law);
        let stays = metric - changing;
        let slope_at = |t: f64| {
            let [along, slope] = self.floor.search(t, law);
            (end - along - (1.0 - t) * stays, stays - slope)
        };
        let (mut low, mut high, mut t) = (0.0, 1.0, 1.0);
        let mut found = 1.0;
        for _ in 0..LARGEST_SEARCH {
            let (first, second) = slope_at(t);
            found = t;
            if first.abs() <= SEARCH_ENOUGH * metric || (t == 1.0 && first < 0.0) {
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
        let quads = quads_of(levels);
        for (iterate, quad) in self.iterate[quads.clone()].iter_mut().zip(&self.quads[quads]) {
            for (from, to) in iterate.iter_mut().zip(&quad.mean) {
                let start = from.on(simd);
                *from = fma(to.on(simd) - start, Four::splat(simd, found), start).into();
            }
        }
        self.floor.near(among, &self.quads, |_, corners, _| corners.go(found, law));
        Search::Part
    }
}

/// The quads of `levels`.
fn quads_of(levels: &Range<usize>) -> Range<usize> {
    levels.start / 2..levels.end.div_ceil(2)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::drive::Means;
    use crate::engine::Engine;
    use crate::experiment::{self, Experiment, Source};

    /// A robot of 30 actuators, which is solved in parts: in every group of five the inner three go on and off.
    fn long(friction: FrictionModel) -> (Experiment, PlanarEngine) {
        let on = "0, 520, -1500, 520, 0, ".repeat(6);
        let off = "0, ".repeat(30);
        let text = format!(
            "[robot]\nactuators = 30\n[robot.friction]\nlow = 1.0\nfilm = \"none\"\n[drive]\nwaveform = \"sequence\"\nperiod_s = 0.07\n\
             phases = [{{ until = 0.5, voltages_v = [{off}] }}, {{ until = 1.0, voltages_v = [{on}] }}]\n\
             [simulation]\nengine = \"planar\"\ntime_step_s = 1e-4\nsteps = 1000\nrecord_every_steps = 1000\n"
        );
        let experiment = experiment::experiment(&Source::from_text("long", &text)).unwrap();
        let mut engine = PlanarEngine::new(&experiment.robot, 1e-4).unwrap();
        engine.set_friction_model(friction);
        assert!(engine.levels > LONGEST_WHOLE && engine.distal.len() > 2);
        (experiment, engine)
    }

    fn try_step(experiment: &Experiment, engine: &mut PlanarEngine) -> Result<(), EngineError> {
        let time = engine.step as f64 * 1e-4;
        let mut voltages = [0.0; 30];
        Means::new(&experiment.drive, 30, time).over(time, time + 1e-4, &mut voltages);
        engine.prepare(&voltages)?;
        engine.advance()
    }

    fn step(experiment: &Experiment, engine: &mut PlanarEngine) {
        try_step(experiment, engine).unwrap();
    }

    /// The robot after a step in which it landed and corners changed.
    fn landing() -> PlanarEngine {
        let (experiment, mut engine) = long(FrictionModel::Convex);
        for _ in 0..900 {
            let before = engine.iterations();
            step(&experiment, &mut engine);
            if engine.step > 500 && engine.iterations() > before + 5 {
                return engine;
            }
        }
        panic!("no step with changes");
    }

    fn solve_part(engine: &mut PlanarEngine, levels: Range<usize>) -> Articulated {
        let (law, among) = (engine.law, engine.floor.among(&levels));
        engine.solve_with_modes(&levels, &among, &law)
    }

    fn means(engine: &PlanarEngine) -> Vec<[Lanes; 3]> {
        engine.quads.iter().map(|quad| quad.mean).collect()
    }

    /// Largest difference of velocities (cm/s) of the bodies of `quads`.
    fn apart(a: &[[Lanes; 3]], b: &[[Lanes; 3]], quads: Range<usize>) -> f64 {
        let differences = quads.flat_map(|k| (1..3).flat_map(move |i| (a[k][i] - b[k][i]).to_array()));
        differences.fold(0.0, |largest, difference| largest.max(difference.abs()))
    }

    #[test]
    fn a_part_that_is_solved_again_stays_as_it_is() {
        let mut engine = landing();
        let levels = engine.levels;
        solve_part(&mut engine, 0..levels);
        let before = means(&engine);
        for start in (0..levels).step_by(BLOCK) {
            solve_part(&mut engine, start..levels.min(start + BLOCK));
            assert_eq!(means(&engine), before, "{start}");
        }
        // A torque on the root's block gives the motion there that solving the whole chain gives: the rest is in the distal inertia.
        engine.quads[1].torque = engine.quads[1].torque.map(|torque| torque + 1.0);
        solve_part(&mut engine, 0..BLOCK);
        let part = means(&engine);
        solve_part(&mut engine, 0..levels);
        let whole = means(&engine);
        assert_eq!(part[..BLOCK / 2], whole[..BLOCK / 2]);
        assert!(apart(&whole, &before, 0..BLOCK / 2) > 1e-3, "the torque acts");
    }

    #[test]
    fn the_metric_of_a_search_direction_is_the_work_of_what_caused_it() {
        let mut engine = landing();
        let levels = engine.levels;
        for part in [0..levels, BLOCK..3 * BLOCK] {
            solve_part(&mut engine, 0..levels);
            for (iterate, quad) in engine.iterate.iter_mut().zip(&engine.quads) {
                *iterate = quad.mean;
            }
            // A d is what is added to the right side.
            let (torque, force) = (1.0, 10.0);
            engine.quads[5].torque = engine.quads[5].torque.map(|before| before + torque);
            engine.quads[7].momentum[2] = engine.quads[7].momentum[2].map(|before| before + force);
            let at_root = solve_part(&mut engine, part.clone());
            let [found, _] = dispatch!(engine.level, simd => engine.measure(simd, &part, &at_root));
            let d = |k: usize, i: usize| engine.quads[k].mean[i] - engine.iterate[k][i];
            let turns = d(5, 0) - d(5, 0).inner(d(4, 0).level(1));
            let expected = torque * turns.sum() + force * d(7, 2).sum();
            // Contact stiffness multiplies the rounding of velocities: 3e-12.
            assert!((found - expected).abs() < 1e-10 * expected, "{found} {expected}");
        }
    }

    #[test]
    fn parts_lead_to_what_the_whole_chain_does() {
        let (experiment, mut engine) = long(FrictionModel::Convex);
        let (_, mut whole) = long(FrictionModel::Convex);
        whole.distal.clear();
        let mut worst = 0.0_f64;
        for _ in 0..900 {
            whole.load(engine.step, &engine.save().unwrap()).unwrap();
            step(&experiment, &mut engine);
            step(&experiment, &mut whole);
            let velocities = |engine: &PlanarEngine| engine.quads.iter().map(|quad| quad.motion).collect::<Vec<_>>();
            worst = worst.max(apart(&velocities(&engine), &velocities(&whole), 0..engine.quads.len()));
        }
        // Both end where no more than a velocity of 10⁻⁶ of g h is left to gain for the whole robot, 10⁻⁵ of it if one body in a hundred has it
        // all: 10⁻⁶ cm/s. Seen: none at all, for they end in the same states.
        assert!(worst < 1e-6, "{worst}");
        // Seen: 1442 steps, most of them of parts, and 1225 of the whole chain. Parts that mislead end in as many of the whole chain besides.
        let (parts, alone) = (engine.iterations(), whole.iterations());
        assert!(alone < parts && parts < alone * 5 / 4, "{parts} {alone}");
    }

    /// Landing takes more than two steps of Newton's method.
    #[test]
    fn too_many_steps_are_a_failure_with_step_and_time() {
        let (experiment, mut engine) = long(FrictionModel::Convex);
        engine.distal.clear();
        engine.largest_steps = 2;
        let error = (0..900).find_map(|_| try_step(&experiment, &mut engine).err()).expect("no failure").to_string();
        let (step, time) = (engine.step, engine.step as f64 * 1e-4);
        assert!(error.contains(&format!("step {step}")) && error.contains(&time.to_string()), "{error}: {step} {time}");
    }

    #[test]
    fn parts_have_the_same_bits_in_all_registers() {
        let after = |level: Level| {
            let (experiment, mut engine) = long(FrictionModel::Convex);
            engine.level = level;
            (0..900).for_each(|_| step(&experiment, &mut engine));
            engine.save().unwrap().into_iter().map(f64::to_bits).collect::<Vec<_>>()
        };
        assert_eq!(after(Level::new()), after(Level::baseline()));
    }
}
