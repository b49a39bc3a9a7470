//! The plant: a clamped chain of thin rods in absolute angles, and its integrator.
//!
//! Coordinates are the absolute angles of the moving rods (positive about +y: the far end goes down), the equations are
//! `M(q) a + h(q, v) = Q(q, v, t)` with a dense mass matrix, and a step is the three-stage, third-order, L-stable singly diagonal
//! implicit Runge-Kutta method of Alexander with Newton's method on the accelerations of each stage.

use super::effects::Nature;
use super::moments::{MEMORY, Memory, Moment, Motion};
use super::protocol::Drive;

pub const LENGTH: f64 = 10.0;
const WIDTH: f64 = 2.0;
const THICKNESS: f64 = 0.1;
const RIGIDITY: f64 = WIDTH * 2519089.378622151;
const BETA: f64 = 3.6327811654911875e-4;
const MASS: f64 = 4.80436;
const GRAVITY: f64 = 980.0;
const ETA: f64 = 0.008 / (2.0 * std::f64::consts::PI);
const AIR: f64 = 1.2e-3;
/// Angular speed over which dry friction turns, rad/s.
const FRICTION_SPEED: f64 = 0.02;
/// Time constants of the lossy branches, s: half a decade apart.
pub const BRANCHES: [f64; 9] = [1e-4, 3.1623e-4, 1e-3, 3.1623e-3, 1e-2, 3.1623e-2, 1e-1, 3.1623e-1, 1.0];
const SIZE: usize = 16;

/// Numerics: joints of the actuator, and the longest step in s.
#[derive(Clone, Copy)]
pub struct Grid {
    pub joints: usize,
    pub step: f64,
}

type Vector = [f64; SIZE];
type Branches = [[f64; BRANCHES.len()]; SIZE];
type Memories = [Memory; SIZE];

#[derive(Clone)]
struct State {
    angle: Vector,
    rate: Vector,
    acceleration: Vector,
    branches: Branches,
    memories: Memories,
}

struct Joint {
    stiffness: f64,
    damping: f64,
    gain: f64,
    rest: f64,
    softening: f64,
    friction: f64,
    loss: f64,
    pitch: f64,
    other: Option<Moment>,
}

struct Rod {
    length: f64,
    mass: f64,
}

/// Torque of a joint and what it adds to stiffness and damping.
struct Torque {
    value: f64,
    stiffness: f64,
    damping: f64,
}

pub struct Chain<'a> {
    nature: &'a Nature,
    rods: Vec<Rod>,
    joints: Vec<Joint>,
    root: f64,
    inertia: [Vector; SIZE],
    weight: Vector,
    step: f64,
}

impl<'a> Chain<'a> {
    pub fn new(nature: &'a Nature, grid: Grid) -> Self {
        let n = grid.joints;
        let pitch = LENGTH / n as f64;
        let per_length = MASS * nature.areal_mass / LENGTH;
        let soft_clamp = nature.clamp_rad_per_dyn_cm > 0.0;
        let (mut rods, mut joints) = (Vec::new(), Vec::new());
        if soft_clamp {
            rods.push(Rod { length: 0.5 * pitch, mass: 0.5 * pitch * per_length });
            joints.push(Joint::spring(1.0 / nature.clamp_rad_per_dyn_cm, nature.other.clamp));
        }
        for i in 0..n {
            let length = if i + 1 == n { 0.5 * pitch } else { pitch };
            rods.push(Rod { length, mass: length * per_length });
            joints.push(Joint::of_sheet(nature, i, n));
        }
        let root = if soft_clamp { 0.0 } else { 0.5 * pitch };
        let mut chain = Chain { nature, rods, joints, root, inertia: [[0.0; SIZE]; SIZE], weight: [0.0; SIZE], step: grid.step };
        chain.set_inertia();
        chain
    }

    fn count(&self) -> usize {
        self.rods.len()
    }

    fn freedoms(&self) -> usize {
        self.count() + usize::from(self.nature.fixture.is_some())
    }

    /// The constant coefficients of the mass matrix, and the first moments of all that hangs on each rod.
    fn set_inertia(&mut self) {
        let n = self.count();
        for k in 0..n {
            let (length, mass) = (self.rods[k].length, self.rods[k].mass);
            self.add_point(k, 0.5 * length, mass);
            self.inertia[k][k] += mass * (length * length + THICKNESS * THICKNESS) / 12.0;
        }
        if self.nature.tip_mass_g > 0.0 {
            self.add_point(n - 1, self.rods[n - 1].length, self.nature.tip_mass_g);
        }
    }

    fn add_point(&mut self, rod: usize, distance: f64, mass: f64) {
        let arm = |i: usize| if i < rod { self.rods[i].length } else { distance };
        let arms: Vec<f64> = (0..=rod).map(arm).collect();
        for i in 0..=rod {
            self.weight[i] += mass * arms[i];
            for j in 0..=rod {
                self.inertia[i][j] += mass * arms[i] * arms[j];
            }
        }
    }

    /// Settles under the first voltage, then calls `record` with the markers `[x, z, x, z]` in mm at every time asked for.
    pub fn run(&self, drive: &Drive, times: &[f64], arcs: [f64; 2], mut record: impl FnMut([f64; 4])) {
        let mut state = self.settled(drive.first());
        let mut next = 0;
        while next < times.len() && times[next] <= 0.0 {
            record(self.markers(&state, arcs));
            next += 1;
        }
        for (index, segment) in drive.segments.iter().enumerate() {
            let mut now = segment.start;
            let end = segment.end();
            while now < end - 1e-12 {
                let target = if next < times.len() && times[next] < end { times[next] } else { end };
                let steps = ((target - now) / self.step - 1e-6).ceil().max(1.0);
                let step = (target - now) / steps;
                for k in 0..steps as usize {
                    self.advance(&mut state, drive, index, now + k as f64 * step, step);
                }
                now = target;
                while next < times.len() && times[next] <= now + 1e-12 {
                    record(self.markers(&state, arcs));
                    next += 1;
                }
            }
        }
    }

    fn settled(&self, volts: f64) -> State {
        let zero = [0.0; SIZE];
        let (branches, memories) = ([[0.0; BRANCHES.len()]; SIZE], [[0.0; MEMORY]; SIZE]);
        let mut state = State { angle: zero, rate: zero, acceleration: zero, branches, memories };
        for _ in 0..200 {
            let mut force = zero;
            let mut matrix = [[0.0; SIZE]; SIZE];
            self.forces(&state.angle, &zero, volts, None, &mut force, &mut matrix, [1.0, 0.0]);
            solve(&mut matrix, &mut force, self.freedoms());
            let change = force.iter().fold(0.0f64, |a, b| a.max(b.abs()));
            (0..self.freedoms()).for_each(|i| state.angle[i] += force[i]);
            if change < 1e-14 {
                break;
            }
        }
        state
    }

    fn advance(&self, state: &mut State, drive: &Drive, segment: usize, time: f64, h: f64) {
        const G: f64 = 0.435_866_521_508_459;
        let b1 = -(6.0 * G * G - 16.0 * G + 1.0) / 4.0;
        let b2 = (6.0 * G * G - 20.0 * G + 5.0) / 4.0;
        let table = [[0.0, 0.0], [0.5 * (1.0 - G), 0.0], [b1, b2]];
        let nodes = [G, 0.5 * (1.0 + G), 1.0];
        let d = self.freedoms();
        let lossy = self.nature.loss > 0.0;
        let other = &self.nature.other;
        let remembers = [other.joint, other.clamp].into_iter().flatten().any(|law| law.remembers());
        let (mut rates, mut accelerations) = ([[0.0; SIZE]; 2], [[0.0; SIZE]; 2]);
        let mut slopes = [[[0.0; BRANCHES.len()]; SIZE]; 2];
        let mut changes = [[[0.0; MEMORY]; SIZE]; 2];
        let start = state.clone();
        for stage in 0..3 {
            let mut known = start.clone();
            for j in 0..stage {
                let weight = h * table[stage][j];
                for i in 0..d {
                    known.angle[i] += weight * rates[j][i];
                    known.rate[i] += weight * accelerations[j][i];
                }
                if lossy {
                    add(&mut known.branches, weight, &slopes[j]);
                }
                if remembers {
                    add(&mut known.memories, weight, &changes[j]);
                }
            }
            known.acceleration = state.acceleration;
            let volts = drive.at(segment, time + nodes[stage] * h);
            *state = self.stage(&known, volts, h * G);
            if lossy {
                self.relax(state, &known, h * G);
            }
            if remembers {
                self.remember(state, &known, h * G);
            }
            if stage < 2 {
                rates[stage] = state.rate;
                accelerations[stage] = state.acceleration;
                if lossy {
                    add(&mut slopes[stage], 1.0 / (h * G), &state.branches);
                    add(&mut slopes[stage], -1.0 / (h * G), &known.branches);
                }
                if remembers {
                    add(&mut changes[stage], 1.0 / (h * G), &state.memories);
                    add(&mut changes[stage], -1.0 / (h * G), &known.memories);
                }
            }
        }
    }

    /// The implicit part of a stage: Newton's method on the accelerations.
    fn stage(&self, known: &State, volts: f64, g: f64) -> State {
        let d = self.freedoms();
        let mut state = known.clone();
        for _ in 0..60 {
            for i in 0..d {
                state.rate[i] = known.rate[i] + g * state.acceleration[i];
                state.angle[i] = known.angle[i] + g * state.rate[i];
            }
            let mut force = [0.0; SIZE];
            let mut matrix = [[0.0; SIZE]; SIZE];
            self.forces(&state.angle, &state.rate, volts, Some((known, g)), &mut force, &mut matrix, [g * g, g]);
            self.inertial(&state, &mut force, &mut matrix);
            solve(&mut matrix, &mut force, d);
            let change = force[..d].iter().fold(0.0f64, |a, b| a.max(b.abs()));
            (0..d).for_each(|i| state.acceleration[i] += force[i]);
            if change * g * g < 1e-10 {
                break;
            }
        }
        for i in 0..d {
            state.rate[i] = known.rate[i] + g * state.acceleration[i];
            state.angle[i] = known.angle[i] + g * state.rate[i];
        }
        state
    }

    /// The branches at the end of a stage: implicit Euler of `q' = theta' - q/T`.
    fn relax(&self, state: &mut State, known: &State, g: f64) {
        for i in 0..self.count() {
            let rate = state.rate[i] - if i > 0 { state.rate[i - 1] } else { 0.0 };
            for (b, time) in BRANCHES.iter().enumerate() {
                state.branches[i][b] = (known.branches[i][b] + g * rate) / (1.0 + g / time);
            }
        }
    }

    /// The memories at the end of a stage.
    fn remember(&self, state: &mut State, known: &State, g: f64) {
        for i in 0..self.count() {
            let speed = state.rate[i] - if i > 0 { state.rate[i - 1] } else { 0.0 };
            if let Some(law) = &self.joints[i].other {
                state.memories[i] = law.next(&known.memories[i], g, speed);
            }
        }
    }

    /// Takes `M a + h` from the forces and adds `M` to the matrix.
    fn inertial(&self, state: &State, force: &mut Vector, matrix: &mut [Vector; SIZE]) {
        let n = self.count();
        let (mut sine, mut cosine) = ([0.0; SIZE], [0.0; SIZE]);
        (0..n).for_each(|i| (sine[i], cosine[i]) = state.angle[i].sin_cos());
        for i in 0..n {
            for j in 0..n {
                let m = self.inertia[i][j] * (cosine[i] * cosine[j] + sine[i] * sine[j]);
                let c = self.inertia[i][j] * (sine[i] * cosine[j] - cosine[i] * sine[j]);
                matrix[i][j] += m;
                force[i] -= m * state.acceleration[j] + c * state.rate[j] * state.rate[j];
            }
        }
        if let Some(fixture) = &self.nature.fixture {
            let all = fixture.mass_g + self.rods.iter().map(|r| r.mass).sum::<f64>() + self.nature.tip_mass_g;
            matrix[n][n] += all;
            force[n] -= all * state.acceleration[n];
            for i in 0..n {
                let m = -cosine[i] * self.weight[i];
                matrix[i][n] += m;
                matrix[n][i] += m;
                force[i] -= m * state.acceleration[n];
                force[n] -= m * state.acceleration[i] + self.weight[i] * sine[i] * state.rate[i] * state.rate[i];
            }
        }
    }

    /// All forces on the absolute angles, and `scale[0]` times stiffness plus `scale[1]` times damping.
    #[allow(clippy::too_many_arguments)]
    fn forces(
        &self,
        angle: &Vector,
        rate: &Vector,
        volts: f64,
        known: Option<(&State, f64)>,
        force: &mut Vector,
        matrix: &mut [Vector; SIZE],
        scale: [f64; 2],
    ) {
        let n = self.count();
        for i in 0..n {
            force[i] += GRAVITY * angle[i].cos() * self.weight[i];
            let (bend, speed) = if i == 0 { (angle[0], rate[0]) } else { (angle[i] - angle[i - 1], rate[i] - rate[i - 1]) };
            let mut torque = self.joints[i].torque(bend, speed, volts, known.map(|(k, g)| (&k.branches[i], g)));
            self.joints[i].add_other(&mut torque, bend, speed, volts, known.map(|(k, g)| (&k.memories[i], g)));
            let slope = scale[0] * torque.stiffness + scale[1] * torque.damping;
            force[i] += torque.value;
            matrix[i][i] += slope;
            if i > 0 {
                force[i - 1] -= torque.value;
                matrix[i - 1][i - 1] += slope;
                matrix[i][i - 1] -= slope;
                matrix[i - 1][i] -= slope;
            }
        }
        if self.nature.drag > 0.0 || self.nature.other.air.is_some() {
            self.add_drag(angle, rate, force);
        }
        self.add_cable(angle, rate, force);
        if let Some(fixture) = &self.nature.fixture {
            force[n] -= fixture.stiffness * angle[n] + fixture.damping * rate[n];
            matrix[n][n] += scale[0] * fixture.stiffness + scale[1] * fixture.damping;
        }
    }

    /// Quadratic drag, by three Gauss points on each rod.
    fn add_drag(&self, angle: &Vector, rate: &Vector, force: &mut Vector) {
        const POINTS: [(f64, f64); 3] =
            [(0.112_701_665_379_258_3, 5.0 / 18.0), (0.5, 8.0 / 18.0), (0.887_298_334_620_741_7, 5.0 / 18.0)];
        let n = self.count();
        let (factor, other) = (0.5 * AIR * self.nature.drag * WIDTH, self.nature.other.air);
        let mut arc = self.root;
        let mut origin = [0.0, if self.nature.fixture.is_some() { rate[n] } else { 0.0 }];
        let (mut totals, mut normals) = ([[0.0; 2]; SIZE], [[0.0; 2]; SIZE]);
        for i in 0..n {
            let (sine, cosine) = angle[i].sin_cos();
            let normal = [-sine, -cosine];
            let length = self.rods[i].length;
            let base = origin[0] * normal[0] + origin[1] * normal[1];
            for (place, weight) in POINTS {
                let speed = base + place * length * rate[i];
                let mut push = -factor * speed * speed.abs() * weight * length;
                if let Some(air) = &other {
                    push -= 0.5 * AIR * WIDTH * air.drag(speed, arc + place * length) * weight * length;
                }
                force[i] += push * place * length;
                totals[i][0] += push * normal[0];
                totals[i][1] += push * normal[1];
            }
            normals[i] = normal;
            arc += length;
            origin = [origin[0] + length * rate[i] * normal[0], origin[1] + length * rate[i] * normal[1]];
        }
        let mut beyond = [0.0; 2];
        for i in (0..n).rev() {
            force[i] += self.rods[i].length * (beyond[0] * normals[i][0] + beyond[1] * normals[i][1]);
            beyond = [beyond[0] + totals[i][0], beyond[1] + totals[i][1]];
        }
        if self.nature.fixture.is_some() {
            force[n] += beyond[1];
        }
    }

    /// A cable under the tip: it pushes back only while the tip is below its level.
    fn add_cable(&self, angle: &Vector, rate: &Vector, force: &mut Vector) {
        let Some(cable) = &self.nature.cable else { return };
        let n = self.count();
        let (mut z, mut speed) = (0.0, 0.0);
        for i in 0..n {
            z -= self.rods[i].length * angle[i].sin();
            speed -= self.rods[i].length * angle[i].cos() * rate[i];
        }
        let depth = cable.level_cm - z;
        if depth > 0.0 {
            let touch = 1.0 - (-depth / 0.2).exp();
            let push = cable.stiffness * depth + touch * (cable.force - cable.damping * speed);
            for i in 0..n {
                force[i] -= push * self.rods[i].length * angle[i].cos();
            }
        }
    }

    fn markers(&self, state: &State, arcs: [f64; 2]) -> [f64; 4] {
        let [first, second] = arcs.map(|arc| self.point(state, arc));
        [first[0], first[1], second[0], second[1]]
    }

    /// A point of the centre line at an arc length in cm from the left end, in mm.
    fn point(&self, state: &State, arc: f64) -> [f64; 2] {
        let n = self.count();
        let lift = if self.nature.fixture.is_some() { state.angle[n] } else { 0.0 };
        let mut place = [self.root.min(arc), lift];
        let mut rest = arc - self.root;
        for i in 0..n {
            let part = if i + 1 == n { rest } else { rest.min(self.rods[i].length) };
            if part <= 0.0 {
                break;
            }
            place = [place[0] + part * state.angle[i].cos(), place[1] - part * state.angle[i].sin()];
            rest -= part;
        }
        [10.0 * place[0], 10.0 * place[1]]
    }
}

impl Joint {
    fn spring(stiffness: f64, other: Option<Moment>) -> Joint {
        Joint { stiffness, damping: 0.0, gain: 0.0, rest: 0.0, softening: 0.0, friction: 0.0, loss: 0.0, pitch: 1.0, other }
    }

    fn of_sheet(nature: &Nature, index: usize, n: usize) -> Joint {
        let pitch = LENGTH / n as f64;
        let stiffness = nature.stiffness * RIGIDITY / pitch;
        let (from, to) = (index as f64 * pitch, (index + 1) as f64 * pitch);
        let margin = 0.5 * nature.margin * LENGTH;
        let active = (to.min(LENGTH - margin) - from.max(margin)).max(0.0) / pitch;
        Joint {
            stiffness,
            damping: stiffness * ETA * nature.damping,
            gain: -active * nature.gain * BETA / n as f64,
            rest: nature.curvature_per_cm * pitch,
            softening: nature.softening_cm2 / (pitch * pitch),
            friction: nature.friction_dyn_cm,
            loss: nature.loss,
            pitch,
            other: nature.other.joint,
        }
    }

    fn torque(&self, bend: f64, speed: f64, volts: f64, known: Option<(&[f64; BRANCHES.len()], f64)>) -> Torque {
        let stretch = bend - self.gain * volts - self.rest;
        let bracket = (1.0 - self.softening * stretch * stretch).max(0.5);
        let mut value = -self.stiffness * stretch * bracket - self.damping * speed;
        let mut damping = self.damping;
        if self.friction > 0.0 {
            let ratio = speed / FRICTION_SPEED;
            let drag = self.friction * std::f64::consts::FRAC_2_PI * ratio.atan();
            value -= drag;
            let chord =
                if ratio.abs() < 1e-6 { self.friction * std::f64::consts::FRAC_2_PI / FRICTION_SPEED } else { drag / speed };
            damping += chord;
        }
        if let (Some((branches, g)), true) = (known, self.loss > 0.0) {
            for (q, time) in branches.iter().zip(BRANCHES) {
                value -= self.stiffness * self.loss * (q + g * speed) / (1.0 + g / time);
                damping += self.stiffness * self.loss * g / (1.0 + g / time);
            }
        }
        Torque { value, stiffness: self.stiffness * bracket, damping }
    }

    /// Adds another law, where there is one.
    fn add_other(&self, torque: &mut Torque, bend: f64, speed: f64, volts: f64, before: Option<(&Memory, f64)>) {
        let Some(law) = &self.other else { return };
        let stretch = bend - self.gain * volts - self.rest;
        let more = law.of(&Motion { stiffness: self.stiffness, pitch_cm: self.pitch, stretch, bend, speed, before });
        torque.value += more.moment;
        torque.stiffness += more.stiffness;
        torque.damping += more.damping;
    }
}

/// Adds a multiple of the branches or memories of all joints.
fn add<const N: usize>(to: &mut [[f64; N]; SIZE], factor: f64, from: &[[f64; N]; SIZE]) {
    to.iter_mut().flatten().zip(from.iter().flatten()).for_each(|(a, b)| *a += factor * b);
}

/// Solves a symmetric positive definite system in place, by Cholesky factors.
fn solve(matrix: &mut [Vector; SIZE], right: &mut Vector, n: usize) {
    for j in 0..n {
        for k in 0..j {
            matrix[j][j] -= matrix[j][k] * matrix[j][k];
        }
        matrix[j][j] = matrix[j][j].sqrt();
        for i in j + 1..n {
            for k in 0..j {
                matrix[i][j] -= matrix[i][k] * matrix[j][k];
            }
            matrix[i][j] /= matrix[j][j];
        }
    }
    for i in 0..n {
        for k in 0..i {
            right[i] -= matrix[i][k] * right[k];
        }
        right[i] /= matrix[i][i];
    }
    for i in (0..n).rev() {
        for k in i + 1..n {
            right[i] -= matrix[k][i] * right[k];
        }
        right[i] /= matrix[i][i];
    }
}
