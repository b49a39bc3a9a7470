//! A step's contact by Lemke's method, for the corners over whose states Newton's method goes round in circles.
//!
//! With W the corners' velocities per impulse, the law's compliance among them, and q what is left of gaps and sliding without these impulses,
//! each corner's normal impulse λ, tangential impulse β₊ − β₋ and sliding speed γ solve
//!
//! ```text
//! 0 ≤ W_nn λ + W_nt (β₊ − β₋) + q_n              ⊥  λ  ≥ 0
//! 0 ≤ ±(W_tn λ + W_tt (β₊ − β₋) + q_t) + γ       ⊥  β± ≥ 0
//! 0 ≤ μ λ − β₊ − β₋                              ⊥  γ  ≥ 0
//! ```
//!
//! Glocker's form of the same with three unknowns per corner takes half the time and is tried first: 99.6 % of the problems of a mover are solved by it.
//!
//! The other corners stay in their states. Those for which that is wrong join, and if there is no solution more join, in the end all: then W is
//! positive definite and the matrix copositive, so that Lemke's method with lexicographic pivots ends in a solution. There may be several: this is
//! the one that its path from open corners comes to.
//!
//! D. E. Stewart and J. C. Trinkle, Int. J. Numer. Meth. Eng. 39 (1996); M. Anitescu and F. A. Potra, Nonlinear Dynamics 14 (1997); R. W. Cottle,
//! J.-S. Pang and R. E. Stone, *The Linear Complementarity Problem* (1992), section 4.4; Ch. Glocker, *Set-Valued Force Laws* (2001), chapter 9.

use fearless_simd::{Simd, prelude::*};

use super::PlanarEngine;
use super::contact::{Law, OPEN, PUSHED_FORWARD, STICKS};
use super::lanes::{Four, Lanes, fma};

/// Pivots per unknown after which rounding must have led in circles. Seen: up to one per unknown.
const LARGEST_PIVOTS: usize = 3;
/// Most corners of a problem, whose work grows with the third power of their number: some seconds for these. Seen: 32 for the paper's robots.
const LARGEST_PROBLEM: usize = 400;
/// Entries of a column below this share of its largest are zero.
const ZERO: f64 = 1e-11;
/// What is left of the artificial velocity that counts as none, as a share of what it begins with: corners side by side leave up to 1.5·10⁻¹⁰.
const DONE: f64 = 1e-8;

/// Velocities off the law by less than this share of the robot's speed, and of what gravity gives in a step, are rounding. Seen: up to 10⁻⁸.
const OFF_THE_LAW: f64 = 1e-7;

/// A corner of the problem.
struct Corner {
    place: usize,
    lane: usize,
    arm: [f64; 2],
    friction: f64,
}

/// Room for the problems, kept from step to step.
#[derive(Default)]
pub(super) struct Workspace {
    corners: Vec<Corner>,
    solution: Vec<Solved>,
    momenta: Vec<[Lanes; 3]>,
    free: Vec<[f64; 2]>,
    w: Vec<f64>,
    matrix: Vec<f64>,
    right: Vec<f64>,
    lemke: Lemke,
}

/// What a corner does in a solution: its state and the floor's impulse on it (dyn·s).
struct Solved {
    state: f64,
    impulse: [f64; 2],
}

impl PlanarEngine {
    /// Solves the step's contact where Newton's method has left corners unsettled; whether it is solved. Not in long chains where more than
    /// [`LARGEST_PROBLEM`] are. Out of line, for few steps come here.
    #[inline(never)]
    pub(super) fn solve_unsettled<S: Simd>(&mut self, simd: S, law: &Law) -> bool {
        self.pivoted += 1;
        // More corners where there is no solution for those at hand: that slide, that touch, all.
        let more: [fn(f64) -> bool; 3] = [|state| state.abs() == PUSHED_FORWARD, |state| state != OPEN, |_| true];
        let mut more = more.into_iter();
        let mut room = std::mem::take(&mut self.pivoting);
        let solved = loop {
            self.list_unsettled(&mut room.corners);
            if room.corners.len() > LARGEST_PROBLEM {
                break false;
            }
            let mut is_solved_by = |form: Form| {
                let pivoted = simd.vectorize(
                    #[inline(always)]
                    || self.pivot(simd, &mut room, form, law),
                );
                pivoted && self.push(&mut room, law)
            };
            if is_solved_by(Form::Reduced) || is_solved_by(Form::Whole) {
                if !self.floor.unsettle_changed(&self.quads, law) {
                    break true;
                }
            } else {
                let Some(which) = more.next() else { break false };
                self.floor.unsettle(which);
            }
        };
        self.pivoting = room;
        solved
    }

    fn list_unsettled(&self, into: &mut Vec<Corner>) {
        into.clear();
        for (place, corners) in self.floor.listed() {
            let unsettled = corners.unsettled();
            for lane in (0..2).filter(|lane| unsettled[*lane]) {
                into.extend(corners.near(lane).map(|(arm, friction)| Corner { place, lane, arm, friction }));
            }
        }
    }

    /// Moves the robot by the floor's impulses on `corners`, which are open to the recursion meanwhile: their states alone may make it nearly singular.
    /// Whether that keeps the law.
    fn push(&mut self, room: &mut Workspace, law: &Law) -> bool {
        let (rungs, all) = (0..self.rungs, self.floor.all());
        let Workspace { corners, solution, momenta, .. } = room;
        momenta.clear();
        momenta.extend(self.quads.iter().map(|quad| quad.momentum));
        for (corner, solved) in corners.iter().zip(&*solution) {
            self.add_impulse(corner, solved.impulse);
        }
        self.solve_with_modes(&rungs, &all, law);
        for (quad, momentum) in self.quads.iter_mut().zip(momenta) {
            quad.momentum = *momentum;
        }
        let speeds = self.quads.iter().flat_map(|quad| quad.mean[1..].iter().flat_map(|part| part.to_array()));
        let speed = speeds.fold(0.0_f64, |largest, part| largest.max(part.abs()));
        let allowed = OFF_THE_LAW * (speed + self.gravity * self.time_step);
        corners.iter().zip(&*solution).all(|(corner, solved)| {
            let left = self.floor.excess(corner.place, corner.lane, &self.quads);
            let [x, z] = [0, 1].map(|k| left[k] + solved.impulse[k] / law.stiffness());
            self.floor.set_solved(corner.place, corner.lane, solved.state, solved.impulse);
            let off = match solved.state {
                OPEN => -z,
                STICKS => z.abs().max(x.abs()),
                // Slides against the impulse.
                pushed => z.abs().max(x * pushed.signum()),
            };
            off <= allowed
        })
    }

    /// Adds an impulse along x and z (dyn·s) on a corner to the momentum of its body.
    fn add_impulse(&mut self, corner: &Corner, [x, z]: [f64; 2]) {
        let (quad, lane) = (corner.place / 4, 2 * (corner.place / 2 % 2) + corner.lane);
        let [ax, az] = corner.arm;
        for (momentum, part) in self.quads[quad].momentum.iter_mut().zip([ax * z - az * x, x, z]) {
            momentum.set_lane(lane, momentum.lane(lane) + part);
        }
    }

    /// Finds a solution for the workspace's corners with all others in their states, and opens these corners; whether Lemke's method finds one.
    #[inline(always)]
    fn pivot<S: Simd>(&mut self, simd: S, room: &mut Workspace, form: Form, law: &Law) -> bool {
        let (rungs, among) = (0..self.rungs, self.floor.all());
        let Workspace { corners, solution: into, free, w, matrix, right, lemke, .. } = room;
        let count = corners.len();
        corners.iter().for_each(|corner| self.floor.set_solved(corner.place, corner.lane, OPEN, [0.0; 2]));
        self.solve_with_modes(&rungs, &among, law);
        free.clear();
        free.extend(corners.iter().map(|corner| self.floor.excess(corner.place, corner.lane, &self.quads)));
        // Impulses in units of a body's mass: the matrix is of order one then. By rows, of x and z of each corner.
        let unit = self.mass / self.count as f64;
        let give = unit / law.stiffness();
        cleared(w, 4 * count * count);
        for (j, corner) in corners.iter().enumerate() {
            for (direction, impulse) in [[unit, 0.0], [0.0, unit]].into_iter().enumerate() {
                let quad = corner.place / 4;
                let before = self.quads[quad].momentum;
                self.add_impulse(corner, impulse);
                self.solve_with_modes(&rungs, &among, law);
                self.quads[quad].momentum = before;
                for (i, (corner, free)) in corners.iter().zip(&*free).enumerate() {
                    let with = self.floor.excess(corner.place, corner.lane, &self.quads);
                    (0..2).for_each(|k| w[2 * count * (2 * i + k) + 2 * j + direction] = with[k] - free[k]);
                }
                w[(2 * count + 1) * (2 * j + direction)] += give;
            }
        }
        into.clear();
        let problem = Problem { w, free, corners, unit };
        match form {
            Form::Reduced => problem.load_reduced(matrix, right),
            Form::Whole => problem.load_whole(matrix, right),
        }
        let solved = lemke.solve(simd, matrix, right);
        if solved {
            into.extend((0..count).map(|i| match form {
                Form::Reduced => problem.read_reduced(&lemke.solution, i),
                Form::Whole => problem.read_whole(&lemke.solution, i),
            }));
        }
        solved
    }
}

/// How the problem is put: with three unknowns per corner, or with four, which is solved whenever there is a solution.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Form {
    Reduced,
    Whole,
}

/// The complementarity problem of some corners, in units of a body's mass.
struct Problem<'a> {
    /// Velocities per impulse, by rows, of x and z of each corner.
    w: &'a [f64],
    /// Velocities without these corners' impulses (cm/s).
    free: &'a [[f64; 2]],
    corners: &'a [Corner],
    unit: f64,
}

impl Problem<'_> {
    /// Velocity of corner `i` per impulse on corner `j`: along x by x and by z, along z by x and by z.
    #[inline(always)]
    fn response(&self, i: usize, j: usize) -> [[f64; 2]; 2] {
        let count = self.corners.len();
        [0, 1].map(|a| [0, 1].map(|b| self.w[2 * count * (2 * i + a) + 2 * j + b]))
    }

    /// With σ₊ = μλ + t for unknown, of which μλ − t is what is left of 2μλ, and the slip backward for another: three unknowns per corner, λ of all first.
    #[inline(always)]
    fn load_reduced(&self, matrix: &mut Vec<f64>, right: &mut Vec<f64>) {
        let count = self.corners.len();
        let [normal, plus, slip] = [0, 1, 2].map(|block| block * count);
        let n = 3 * count;
        cleared(matrix, n * n);
        cleared(right, n);
        for i in 0..count {
            for (j, corner) in self.corners.iter().enumerate() {
                let [[tt, tn], [nt, nn]] = self.response(i, j);
                matrix[n * (normal + i) + normal + j] = nn - nt * corner.friction;
                matrix[n * (normal + i) + plus + j] = nt;
                matrix[n * (plus + i) + normal + j] = tn - tt * corner.friction;
                matrix[n * (plus + i) + plus + j] = tt;
            }
            matrix[n * (plus + i) + slip + i] = 1.0;
            matrix[n * (slip + i) + normal + i] = 2.0 * self.corners[i].friction;
            matrix[n * (slip + i) + plus + i] = -1.0;
            (right[normal + i], right[plus + i]) = (self.free[i][1], self.free[i][0]);
        }
    }

    fn read_reduced(&self, solution: &[f64], i: usize) -> Solved {
        let count = self.corners.len();
        let [pressed, pushed, back] = [0, 1, 2].map(|block| solution[block * count + i]);
        let most = self.corners[i].friction * pressed;
        let (state, along) = if pressed <= 0.0 {
            (OPEN, 0.0)
        } else if pushed <= 0.0 {
            (-PUSHED_FORWARD, -most)
        } else if back > 0.0 || pushed >= 2.0 * most {
            (PUSHED_FORWARD, most)
        } else {
            (STICKS, pushed - most)
        };
        Solved { state, impulse: [along, pressed].map(|part| self.unit * part) }
    }

    /// The problem of the module's head: λ of all corners, then β₊, β₋ and γ.
    fn load_whole(&self, matrix: &mut Vec<f64>, right: &mut Vec<f64>) {
        let count = self.corners.len();
        let [normal, plus, minus, speed] = [0, 1, 2, 3].map(|block| block * count);
        let n = 4 * count;
        cleared(matrix, n * n);
        cleared(right, n);
        for i in 0..count {
            for j in 0..count {
                let [[tt, tn], [nt, nn]] = self.response(i, j);
                for (row, [on_normal, on_plus]) in [(normal, [nn, nt]), (plus, [tn, tt]), (minus, [-tn, -tt])] {
                    for (column, value) in [(normal, on_normal), (plus, on_plus), (minus, -on_plus)] {
                        matrix[n * (row + i) + column + j] = value;
                    }
                }
            }
            for (row, column, value) in [
                (plus, speed, 1.0),
                (minus, speed, 1.0),
                (speed, normal, self.corners[i].friction),
                (speed, plus, -1.0),
                (speed, minus, -1.0),
            ] {
                matrix[n * (row + i) + column + i] = value;
            }
            (right[normal + i], right[plus + i], right[minus + i]) = (self.free[i][1], self.free[i][0], -self.free[i][0]);
        }
    }

    fn read_whole(&self, solution: &[f64], i: usize) -> Solved {
        let count = self.corners.len();
        let [pressed, plus, minus, slip] = [0, 1, 2, 3].map(|block| solution[block * count + i]);
        let state = match (pressed > 0.0, slip > 0.0) {
            (false, _) => OPEN,
            (true, false) => STICKS,
            (true, true) if plus >= minus => PUSHED_FORWARD,
            (true, true) => -PUSHED_FORWARD,
        };
        Solved { state, impulse: [plus - minus, pressed].map(|part| self.unit * part) }
    }
}

/// Sets a vector to so many zeros.
fn cleared<T: Clone + Default>(vector: &mut Vec<T>, length: usize) {
    vector.clear();
    vector.resize(length, T::default());
}

/// Lemke's method and its room.
#[derive(Default)]
struct Lemke {
    /// Rows of the dictionary, of so many wide parts each, without the end of each.
    rows: Vec<Lanes>,
    wide: usize,
    ends: Vec<f64>,
    /// The entering column, and the leaving row by its entry there.
    column: Vec<f64>,
    scaled: Vec<Lanes>,
    ratios: Vec<f64>,
    /// Variables of the rows and of the columns, and in which column each stands, or [`BASIC`].
    basic: Vec<usize>,
    others: Vec<usize>,
    columns: Vec<usize>,
    solution: Vec<f64>,
}

const BASIC: usize = usize::MAX;
/// Numbers of a part of a row.
const WIDE: usize = 4;

impl Lemke {
    /// Finds a solution z of 0 ≤ w = M z + q ⊥ z ≥ 0, with M by rows; whether there is one, or the path ends on a ray.
    ///
    /// Variables are w (0 to n), z (n to 2n) and z₀ (2n) with w = M z + z₀ + q. Each row: a basic one is the row's end less the row times the others.
    #[inline(always)]
    fn solve<S: Simd>(&mut self, simd: S, matrix: &[f64], right: &[f64]) -> bool {
        let n = right.len();
        let largest = -right.iter().copied().fold(0.0, f64::min);
        cleared(&mut self.solution, n);
        if largest == 0.0 {
            return true;
        }
        self.begin(matrix, right);
        let artificial = 2 * n;
        // All rows hold z₀, which enters first.
        let mut entering = n;
        self.column.fill(-1.0);
        let mut leaving = (0..n).fold(0, |first, row| if self.before(row, first, |_| 1.0, &self.ends) { row } else { first });
        for _ in 0..LARGEST_PIVOTS * n {
            let left = self.exchange(simd, leaving, entering);
            // Other variables may reach zero together with the artificial one.
            let row = self.basic.iter().position(|variable| *variable == artificial);
            if row.is_none_or(|row| self.ends[row] <= DONE * largest) {
                for (end, variable) in
                    self.ends.iter().zip(&self.basic).filter(|(_, variable)| (n..artificial).contains(variable))
                {
                    self.solution[variable - n] = end.max(0.0);
                }
                return true;
            }
            let complement = if left < n { left + n } else { left - n };
            entering = self.columns[complement];
            let Some(first) = self.first_row(entering) else { return false };
            leaving = first;
        }
        false
    }

    #[inline(always)]
    fn begin(&mut self, matrix: &[f64], right: &[f64]) {
        let n = right.len();
        self.wide = (n + 1).div_ceil(WIDE);
        cleared(&mut self.rows, n * self.wide);
        for (row, from) in self.rows.chunks_exact_mut(self.wide).zip(matrix.chunks_exact(n)) {
            for (to, from) in row.iter_mut().zip(from.chunks(WIDE)) {
                *to = Lanes::new(std::array::from_fn(|lane| from.get(lane).map_or(0.0, |entry| -entry)));
            }
            row[n / WIDE].set_lane(n % WIDE, -1.0);
        }
        self.ends.clear();
        self.ends.extend_from_slice(right);
        self.basic.clear();
        self.basic.extend(0..n);
        self.others.clear();
        self.others.extend(n..=2 * n);
        self.columns.clear();
        self.columns.extend((0..n).map(|_| BASIC).chain(0..=n));
        cleared(&mut self.column, n);
        cleared(&mut self.ratios, n);
        cleared(&mut self.scaled, self.wide);
    }

    /// Exchanges the leaving row's basic variable, which is returned, for that of the entering column.
    #[inline(always)]
    fn exchange<S: Simd>(&mut self, simd: S, leaving: usize, entering: usize) -> usize {
        let Self { rows, wide, ends, column, scaled, .. } = self;
        let inverse = 1.0 / column[leaving];
        let own = *wide * leaving..*wide * (leaving + 1);
        for (to, from) in scaled.iter_mut().zip(&rows[own.clone()]) {
            *to = (from.on(simd) * inverse).into();
        }
        let end = ends[leaving] * inverse;
        column[leaving] = 0.0;
        for ((row, factor), row_end) in rows.chunks_exact_mut(*wide).zip(&*column).zip(&mut *ends) {
            if *factor != 0.0 {
                let less = Four::splat(simd, -factor);
                for (to, by) in row.iter_mut().zip(&*scaled) {
                    *to = fma(less, by.on(simd), to.on(simd)).into();
                }
                row[entering / WIDE].set_lane(entering % WIDE, -factor * inverse);
                *row_end -= factor * end;
            }
        }
        scaled[entering / WIDE].set_lane(entering % WIDE, inverse);
        rows[own].copy_from_slice(scaled);
        ends[leaving] = end;
        let (left, entered) = (self.basic[leaving], self.others[entering]);
        (self.basic[leaving], self.others[entering]) = (entered, left);
        (self.columns[left], self.columns[entered]) = (entering, BASIC);
        left
    }

    /// Loads the entering column and finds the row that reaches zero first; none if the variable can grow for ever.
    #[inline(always)]
    fn first_row(&mut self, entering: usize) -> Option<usize> {
        for (to, row) in self.column.iter_mut().zip(self.rows.chunks_exact(self.wide)) {
            *to = row[entering / WIDE].lane(entering % WIDE);
        }
        let zero = ZERO * self.column.iter().fold(0.0_f64, |scale, entry| if entry.abs() > scale { entry.abs() } else { scale });
        for (ratio, (end, entry)) in self.ratios.iter_mut().zip(self.ends.iter().zip(&self.column)) {
            *ratio = if *entry > zero { end / entry } else { f64::INFINITY };
        }
        let mut first = None;
        for row in (0..self.ratios.len()).filter(|row| self.ratios[*row] < f64::INFINITY) {
            if first.is_none_or(|first| self.before(row, first, |row| self.column[row], &self.ratios)) {
                first = Some(row);
            }
        }
        first
    }

    /// Whether row `a` reaches zero before row `b`; where both do at once, whose row of the inverse basis per entry is first in lexicographic order.
    #[inline(always)]
    fn before(&self, a: usize, b: usize, entry: impl Fn(usize) -> f64, ratios: &[f64]) -> bool {
        let order = ratios[a].total_cmp(&ratios[b]);
        if order.is_ne() {
            return order.is_lt();
        }
        // The inverse basis stands in the columns of w, those of basic ones being unit vectors.
        let inverse = |row: usize, w: usize| match self.columns[w] {
            BASIC => f64::from(u8::from(self.basic[row] == w)),
            column => self.rows[self.wide * row + column / WIDE].lane(column % WIDE),
        };
        let (by_a, by_b) = (entry(a), entry(b));
        let tied = (0..self.ends.len()).map(|w| (inverse(a, w) / by_a).total_cmp(&(inverse(b, w) / by_b)));
        tied.into_iter().find(|order| order.is_ne()).is_some_and(|order| order.is_lt())
    }
}

#[cfg(test)]
mod tests {
    use fearless_simd::{Level, dispatch};

    use super::*;

    fn lemke(matrix: &[f64], right: &[f64]) -> Option<Vec<f64>> {
        let mut method = Lemke::default();
        dispatch!(Level::new(), simd => method.solve(simd, matrix, right)).then_some(method.solution)
    }

    /// Contacts of a body that bends with a floor, some of them side by side: as in [`PlanarEngine::pivot`].
    fn contacts(seed: u64, count: usize, close: f64) -> (Vec<f64>, Vec<f64>) {
        let mut state = seed;
        let mut random = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 11) as f64 / (1_u64 << 53) as f64
        };
        // Rows of x and z of a point to a body's height, turn and travel and a bending; every second point close to the one before.
        let mut points: Vec<[f64; 4]> = Vec::new();
        for i in 0..count {
            let fresh: [f64; 4] = std::array::from_fn(|_| 2.0 * random() - 1.0);
            let before = if i % 2 == 1 { Some(points[i - 1]) } else { None };
            points.push(before.map_or(fresh, |before| std::array::from_fn(|k| before[k] + close * fresh[k])));
        }
        let rows: Vec<[f64; 4]> = points.iter().flat_map(|[x, z, a, b]| [[0.0, -z, 1.0, *a], [1.0, *x, 0.0, *b]]).collect();
        let w = |a: usize, b: usize| {
            let product: f64 = rows[a].iter().zip(&rows[b]).map(|(a, b)| a * b).sum();
            product + if a == b { 6e-7 } else { 0.0 }
        };
        let n = 4 * count;
        let (mut matrix, mut right) = (vec![0.0; n * n], vec![0.0; n]);
        for i in 0..count {
            for j in 0..count {
                let [tt, tn, nt, nn] = [w(2 * i, 2 * j), w(2 * i, 2 * j + 1), w(2 * i + 1, 2 * j), w(2 * i + 1, 2 * j + 1)];
                for (row, values) in [[nn, nt, -nt], [tn, tt, -tt], [-tn, -tt, tt]].into_iter().enumerate() {
                    (0..3).for_each(|column| matrix[n * (row * count + i) + column * count + j] = values[column]);
                }
            }
            let friction = if random() < 0.2 { 0.0 } else { 0.1 * 100.0_f64.powf(random()) };
            let last = 3 * count + i;
            for (row, column, value) in [
                (count + i, last, 1.0),
                (2 * count + i, last, 1.0),
                (last, i, friction),
                (last, count + i, -1.0),
                (last, 2 * count + i, -1.0),
            ] {
                matrix[n * row + column] = value;
            }
            let [fall, slide] = [20.0 * random() - 15.0, 40.0 * random() - 20.0];
            (right[i], right[count + i], right[2 * count + i]) = (fall, slide, -slide);
        }
        (matrix, right)
    }

    #[test]
    fn every_contact_problem_has_a_solution_and_it_is_found() {
        let mut with_impulses = 0;
        for seed in 0..2000 {
            let count = 1 + seed as usize % 10;
            let (matrix, right) = contacts(seed, count, [1.0, 1e-2, 1e-4][seed as usize % 3]);
            let z = lemke(&matrix, &right).unwrap_or_else(|| panic!("seed {seed}: a ray"));
            with_impulses += u32::from(z.iter().any(|part| *part > 0.0));
            let n = right.len();
            let size = z.iter().fold(20.0_f64, |size, part| size.max(part.abs()));
            for i in 0..n {
                let w = right[i] + (0..n).map(|j| matrix[n * i + j] * z[j]).sum::<f64>();
                // Impulses of corners side by side are large and cancel. Seen: 2e-9 of the largest.
                assert!(z[i] >= 0.0 && w > -1e-7 * size && w.min(z[i]) < 1e-7 * size, "seed {seed}, {i}: {w} {}", z[i]);
            }
        }
        assert!(with_impulses > 1500, "{with_impulses}");
    }

    #[test]
    fn nothing_is_done_where_nothing_touches() {
        assert_eq!(lemke(&[1.0], &[0.5]), Some(vec![0.0]));
        assert_eq!(lemke(&[2.0], &[-1.0]), Some(vec![0.5]));
        // No z makes −z − 1 positive.
        assert_eq!(lemke(&[-1.0], &[-1.0]), None);
    }
}
