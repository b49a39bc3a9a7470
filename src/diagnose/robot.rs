//! Our robots as a plant: the planar engine, the effects, and the markers of a data set.

use rayon::prelude::*;

use super::dataset::Dataset;
use super::plant::{Candidate, Free, Model, Plant, Signal, Term};
use super::quality;
use super::voltage::Command;
use crate::analytic;
use crate::drive::{Drive, Means, Table, Waveform};
use crate::effects::{self, Applied, EFFECTS, Kind, Parameter, SignalChain, View};
use crate::engine::{Engine, EngineError, PlanarEngine};
use crate::experiment::hermite;
use crate::model::{Mount, PointMass, Robot};

/// Joints per actuator that are tried: what lies beyond changes a cantilever's frequency by less than 0.06 %.
const JOINTS: [usize; 12] = [1, 2, 3, 4, 5, 6, 8, 10, 12, 14, 16, 20];
/// On the floor contact leaves more open than joints beyond these do.
const JOINTS_ON_THE_FLOOR: usize = 8;
/// Time steps of a clamped robot follow its slowest mode and the rows; those of a robot on the ground follow impacts.
const STEPS_PER_PERIOD: f64 = 220.0;
const GROUND_STEP: f64 = 1e-4;
/// A longer step may change a run's prediction by this share of the noise (rms).
const LARGEST_CHANGE: f64 = 0.15;
/// Of a clamped robot (1/s): a tenth of the engine's own, which at resonance would take 0.2 % of the amplitude.
pub(super) const NUMERICAL_DAMPING: f64 = 5.0;

/// Rows so near to a step, as a share of its length, take its state.
pub(super) const ON_STEP: f64 = 1e-6;

/// An experiment that could be made.
pub struct Scene {
    /// The voltages.
    pub drive: Table,
    /// Length (s).
    pub duration: f64,
    /// A mass (g) that hangs at the end until the beginning.
    pub hung: f64,
    /// A known mass (g) at the end.
    pub added: f64,
    /// Whether gravity pulls the other way in the sheet's frame.
    pub turned_over: bool,
    /// Where it is looked at (cm).
    pub markers: Vec<f64>,
}

/// A data set with its robot.
pub struct RobotPlant {
    robot: Robot,
    /// Marker positions (cm).
    markers: Vec<f64>,
    channels: Vec<String>,
    commands: Vec<Command>,
    signals: Vec<Signal>,
    /// Per run: the time (s) at which its rows begin, and its time step (s).
    starts: Vec<f64>,
    durations: Vec<f64>,
    steps: Vec<f64>,
    candidates: Vec<Candidate>,
}

impl RobotPlant {
    /// The plant of a data set whose values have passed [`quality`].
    pub fn new(dataset: &Dataset, values: &quality::Checked) -> Self {
        let robot = dataset.robot.clone();
        let gain = dataset.nominal.robot.positive_gain.unwrap_or(1.0);
        let (mut commands, mut signals, mut starts, mut steps) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
        for (run, checked) in dataset.runs.iter().zip(&values.runs) {
            let n = robot.actuators;
            let start = run.times[0];
            let times: Vec<f64> = run.times.iter().map(|t| t - start).collect();
            let volts: Vec<f64> = run.voltages.iter().map(|v| if *v > 0.0 { v * gain } else { *v }).collect();
            commands.push(Command::new(&times, &volts, n));
            let mut signal = Signal {
                id: run.id.clone(),
                values: Vec::new(),
                sigmas: Vec::new(),
                times: Vec::new(),
                channels: Vec::new(),
                inputs: Vec::new(),
            };
            for (channel, (column, good)) in run.channels.iter().zip(checked).enumerate() {
                for (row, value) in column.iter().enumerate().filter(|(row, _)| good[*row]) {
                    signal.values.push(*value);
                    signal.sigmas.push(values.noise[channel]);
                    signal.times.push(times[row]);
                    signal.channels.push(channel);
                    signal.inputs.push(run.voltages[row * n]);
                }
            }
            signals.push(signal);
            starts.push(start);
            steps.push(step(&robot, &times));
        }
        let candidates = candidates(&robot, dataset.markers.len());
        let plant = Self {
            markers: dataset.markers.iter().map(|marker| marker.position).collect(),
            channels: dataset.channel_names(),
            robot,
            commands,
            signals,
            starts,
            durations: dataset.runs.iter().map(|run| run.times[run.times.len() - 1] - run.times[0]).collect(),
            steps,
            candidates,
        };
        plant.with_chosen_steps()
    }

    /// Takes the longest time step for each run that changes its prediction by less than a share of the noise.
    fn with_chosen_steps(mut self) -> Self {
        let runs = 0..self.signals.len();
        self.steps = runs.into_par_iter().map(|run| self.longest_step(run)).collect();
        self
    }

    fn longest_step(&self, run: usize) -> f64 {
        let finest = self.steps[run];
        let limit = 0.09 / (analytic::cantilever_frequency(&self.robot) * (self.robot.actuators as f64).powi(2));
        let ends = vec![1.0; self.nuisances(run)];
        let with = |step: f64| self.predict_with(&[], self.robot.motors_per_actuator as f64, run, &ends, step).ok();
        let (Some(fine), Mount::Clamped) = (with(finest), self.robot.mount) else { return finest };
        let sigmas = &self.signals[run].sigmas;
        let mut best = finest;
        for factor in [2.0, 4.0, 8.0] {
            let step = factor * finest;
            let Some(coarse) = with(step).filter(|_| step < limit) else { break };
            let apart: f64 = fine.iter().zip(&coarse).zip(sigmas).map(|((a, b), s)| ((a - b) / s).powi(2)).sum();
            if (apart / fine.len().max(1) as f64).sqrt() > LARGEST_CHANGE {
                break;
            }
            best = step;
        }
        best
    }

    /// The time step (s) of a run.
    pub fn step(&self, run: usize) -> f64 {
        self.steps[run]
    }

    /// The time (s) at which a run's rows begin.
    pub fn start(&self, run: usize) -> f64 {
        self.starts[run]
    }

    /// The number of steps of `step` (s) that a run takes: one more than to its last row, so that the state there is a record.
    pub fn steps_of(&self, run: usize, step: f64) -> u64 {
        (self.durations[run] / step - ON_STEP).ceil().max(0.0) as u64 + 1
    }

    /// The command of a run.
    pub fn command(&self, run: usize) -> &Command {
        &self.commands[run]
    }

    /// Marker positions (cm).
    pub fn markers(&self) -> &[f64] {
        &self.markers
    }

    /// The mean of the noise (mm).
    pub fn noise(&self) -> f64 {
        let sigmas: Vec<f64> = self.signals.iter().flat_map(|signal| signal.sigmas.iter().copied()).collect();
        sigmas.iter().sum::<f64>() / sigmas.len().max(1) as f64
    }

    /// Positions (mm) of a scene's markers as `model` has them, x and z of each in `rows` rows.
    ///
    /// # Errors
    /// Why they cannot be simulated.
    pub fn play(&self, model: &Model, scene: &Scene, rows: usize) -> Result<Vec<f64>, String> {
        let mut robot = self.robot.clone();
        if scene.turned_over {
            robot.material.gravity *= -1.0;
        }
        if scene.added > 0.0 {
            let position = robot.material.actuator_length * robot.actuators as f64;
            robot.extensions.point_masses.push(PointMass { mass: scene.added, position });
        }
        let Staged { robot, drive, chain, view } =
            self.staged(robot, &model.terms, model.resolution, scene.drive.clone(), scene.duration)?;
        let times: Vec<f64> = (0..rows).map(|row| (scene.duration * row as f64 / rows as f64 - view.delay).max(0.0)).collect();
        let step = self.steps.iter().copied().fold(1e-3, f64::min);
        let tracks =
            track_from(&robot, scene.hung, &drive, chain, step, &scene.markers, &times).map_err(|error| error.to_string())?;
        Ok(tracks.into_iter().flat_map(|at| view.of(at).map(|x| 10.0 * x)).collect())
    }

    /// The nominal robot.
    pub fn robot(&self) -> &Robot {
        &self.robot
    }

    /// A candidate's coordinates as an effect with values.
    pub fn applied(&self, term: &Term) -> Result<Applied, String> {
        let candidate = &self.candidates[term.candidate];
        let effect = effects::find(candidate.id).ok_or("no such effect")?;
        let free = candidate.parameters.iter().zip(&term.x).map(|(p, x)| (p.name, p.value(*x)));
        effect.with(free.chain(candidate.fixed.iter().copied())).map_err(|error| error.to_string())
    }
}

/// A step that fits whole into the rows' interval, if they are even.
pub(super) fn step(robot: &Robot, times: &[f64]) -> f64 {
    let longest = match robot.mount {
        Mount::Clamped => 1.0 / (STEPS_PER_PERIOD * analytic::cantilever_frequency(robot) / (robot.actuators as f64).powi(2)),
        _ => GROUND_STEP,
    };
    let mut gaps: Vec<f64> = times.windows(2).map(|pair| pair[1] - pair[0]).collect();
    gaps.sort_by(f64::total_cmp);
    match gaps.get(gaps.len() / 2) {
        Some(gap) => gap / (gap / longest).ceil(),
        None => longest,
    }
}

/// Coordinates of a parameter: 1/value where off is infinite.
fn free(p: &'static Parameter) -> Free {
    let inverse = p.off.is_some_and(f64::is_infinite);
    let [low, high] = p.bounds;
    let bounds = match (inverse, low < 0.0) {
        (false, _) => [low, high],
        // The least limits that are worth a thought: 100 V, 100 V/s.
        (true, false) => [0.0, 1.0 / low.max(100.0)],
        (true, true) => [1.0 / high.min(-100.0), 0.0],
    };
    let off = if inverse { Some(0.0) } else { p.off };
    Free { name: p.name, unit: p.unit, off, bounds, scale: 0.0, inverse }
}

/// The effects that make sense for a robot, with what is fitted of them, its usual size, and where to start.
pub(super) fn candidates(robot: &Robot, markers: usize) -> Vec<Candidate> {
    let clamped = robot.mount == Mount::Clamped;
    let ground = robot.mount == Mount::Ground;
    let mut all = Vec::new();
    for effect in EFFECTS.iter().copied() {
        let fits = match effect.id {
            "discretisation" => false,
            "clamp-compliance" => clamped,
            // Of a single actuator it is the gain.
            "weak-actuator" => robot.actuators > 1,
            // The tip alone cannot tell it from the gain.
            "passive-margin" => robot.actuators > 1 || markers > 1,
            _ => effect.kind != Kind::Ground || ground,
        };
        if !fits {
            continue;
        }
        // What is fitted: name and scale; starts; what is given.
        type Form = (Vec<(&'static str, f64)>, Vec<Vec<f64>>, Vec<(&'static str, f64)>);
        let one = |name: &'static str, scale: f64, starts: &[f64]| -> Form {
            (vec![(name, scale)], starts.iter().map(|x| vec![*x]).collect(), Vec::new())
        };
        let forms: Vec<Form> = match effect.id {
            "stiffness" | "actuation-gain" | "areal-mass" => vec![one("scale", 0.1, &[1.05])],
            "damping" => vec![one("scale", 0.3, &[1.5, 4.0])],
            "clamp-compliance" => vec![one("compliance_rad_per_n_m", 0.5, &[0.2, 1.0])],
            "tip-mass" => vec![one("mass_g", 0.1, &[0.05, 0.2])],
            "initial-curvature" => vec![one("curvature_per_m", 0.2, &[0.1])],
            "stiffness-softening" => vec![one("softening_mm2", 500.0, &[500.0, -300.0])],
            "dry-friction" => vec![one("moment_mn_m", 0.1, &[0.05, 0.3])],
            "structural-damping" => vec![one("loss_factor", 0.02, &[0.02])],
            "air-drag" => vec![one("drag_coefficient", 1.0, &[1.0, 4.0])],
            "time-delay" => vec![one("delay_s", 2e-3, &[1e-3, 5e-3])],
            "saturation" => vec![
                one("min_v", 2e-4, &[-1.0 / 1300.0, -1.0 / 1000.0, -1.0 / 700.0]),
                one("max_v", 2e-4, &[1.0 / 1300.0, 1.0 / 800.0, 1.0 / 400.0, 1.0 / 200.0]),
            ],
            "slew-limit" => vec![one("rate_v_per_s", 2e-6, &[1.5e-6, 3e-6, 6e-6, 1.2e-5, 2.5e-5])],
            "driver-lag" => vec![one("time_constant_s", 2e-3, &[1e-3, 5e-3])],
            "hysteresis" => vec![
                (
                    vec![("width", 0.05), ("slope_loss", 0.2), ("asymmetry", 0.3), ("gain", 0.1)],
                    vec![vec![0.05, 0.2, 0.0, 1.0], vec![0.2, 0.6, 0.0, 1.0]],
                    vec![("exponent", 1.0), ("plays", 0.0)],
                ),
                (
                    vec![("width", 0.05), ("shape", 0.5), ("gain", 0.1), ("decay_per_kv", 2.0)],
                    vec![vec![0.05, 0.0, 1.0, 1.0], vec![0.2, 0.5, 1.0, 1.0]],
                    vec![("plays", 1.0), ("from_zero", 0.0)],
                ),
                (
                    vec![("width", 0.05), ("shape", 0.5), ("gain", 0.1), ("decay_per_kv", 2.0)],
                    vec![vec![0.05, 0.0, 1.0, 1.0]],
                    vec![("plays", 1.0), ("from_zero", 1.0)],
                ),
            ],
            "creep" => {
                let ladder = |rungs: f64| -> Form {
                    (vec![("per_decade", 0.02), ("power", 0.2)], vec![vec![0.02, 0.0]], vec![("rungs_per_decade", rungs)])
                };
                let single: Form = (
                    vec![("per_decade", 0.02), ("fastest_s", 0.3)],
                    vec![vec![0.02, 0.3], vec![0.02, 3.0]],
                    vec![("rungs_per_decade", 0.0)],
                );
                vec![ladder(1.0), ladder(2.0), single]
            }
            "field-dependent-gain" => {
                vec![(vec![("slope_per_kv", 0.05), ("curvature_per_kv2", 0.03)], vec![vec![0.05, 0.0]], Vec::new())]
            }
            "polarity-asymmetry" => vec![one("ratio", 0.2, &[1.2])],
            "weak-actuator" => {
                (1..=robot.actuators).map(|j| (vec![("gain", 0.1)], vec![vec![0.95]], vec![("actuator", j as f64)])).collect()
            }
            "passive-margin" => vec![one("fraction", 0.05, &[0.08])],
            "ground-friction" => vec![one("scale", 0.2, &[0.8, 1.25])],
            "stick-slip" => vec![one("static_ratio", 0.2, &[1.2])],
            "contact-restitution" => vec![one("restitution", 0.1, &[0.1, 0.4])],
            "ground-slope" => vec![one("angle_deg", 0.5, &[0.5])],
            "sensor-scale" => vec![one("scale", 0.02, &[1.02])],
            "sensor-offset" => {
                vec![(vec![("x_mm", 0.2), ("z_mm", 0.2)], vec![vec![0.1, 0.1]], Vec::new())]
            }
            "sensor-delay" => vec![one("delay_s", 2e-3, &[1e-3, 5e-3])],
            "camera-tilt" => vec![one("angle_deg", 0.5, &[0.3])],
            _ => Vec::new(),
        };
        for (fitted, starts, fixed) in forms {
            let parameters = fitted.iter().filter_map(|(name, scale)| {
                let p = effect.parameters.iter().find(|p| p.name == *name)?;
                Some(Free { scale: *scale, ..free(p) })
            });
            all.push(Candidate {
                id: effect.id,
                kind: effect.kind.name(),
                cause: effect.cause,
                is_constant: effect.kind == Kind::Calibration,
                parameters: parameters.collect(),
                fixed,
                starts,
            });
        }
    }
    all
}

impl Plant for RobotPlant {
    fn signals(&self) -> &[Signal] {
        &self.signals
    }

    fn channels(&self) -> Vec<String> {
        self.channels.clone()
    }

    fn unit(&self) -> &'static str {
        "mm"
    }

    fn candidates(&self) -> &[Candidate] {
        &self.candidates
    }

    /// Joints per actuator: the nominal number, then every finer one of a fixed ladder.
    fn resolutions(&self) -> Vec<f64> {
        let nominal = self.robot.motors_per_actuator;
        let most = if self.robot.mount == Mount::Ground { JOINTS_ON_THE_FLOOR } else { usize::MAX };
        let finer = JOINTS.into_iter().filter(|m| *m > nominal && *m <= most);
        std::iter::once(nominal).chain(finer).map(|m| m as f64).collect()
    }

    fn nuisances(&self, run: usize) -> usize {
        self.commands[run].jumps().len()
    }

    /// A chain of m joints differs from a continuum by 1/(2m²) of its stiffness, and damping is known less well to begin with: six times that. How far
    /// voltage bends a chain slowly does not depend on m, but half a per cent of it is not worth a name.
    fn is_credible(&self, term: &Term, resolution: f64) -> bool {
        let candidate = &self.candidates[term.candidate];
        let open = match candidate.id {
            "damping" => 3.0 / (resolution * resolution),
            "actuation-gain" => 0.005,
            _ => 0.5 / (resolution * resolution),
        };
        !candidate.is_constant || term.x.iter().any(|x| (x - 1.0).abs() > open)
    }

    fn predict(&self, model: &Model, run: usize, nuisances: &[f64]) -> Result<Vec<f64>, String> {
        let step = self.step(run) * if model.fine { 0.5 } else { 1.0 };
        self.predict_with(&model.terms, model.resolution, run, nuisances, step)
    }
}

/// Everything that a run needs.
struct Staged {
    robot: Robot,
    drive: Drive,
    chain: SignalChain,
    view: View,
}

impl RobotPlant {
    /// A robot with causes and joints of a model, before a command.
    fn staged(&self, mut robot: Robot, terms: &[Term], resolution: f64, command: Table, duration: f64) -> Result<Staged, String> {
        let effects = terms.iter().map(|term| self.applied(term)).collect::<Result<Vec<_>, _>>()?;
        robot.motors_per_actuator = resolution as usize;
        let mut drive = Drive { waveform: Waveform::Table(command), positive_gain: 1.0, delay: 0.0 };
        effects::apply(&effects, &mut robot, &mut drive).map_err(|error| error.to_string())?;
        let chain = SignalChain::new(&effects, robot.actuators, duration);
        Ok(Staged { robot, drive, chain, view: View::new(&effects) })
    }

    fn predict_with(
        &self,
        terms: &[Term],
        resolution: f64,
        run: usize,
        nuisances: &[f64],
        step: f64,
    ) -> Result<Vec<f64>, String> {
        let table = self.commands[run].table(nuisances);
        let Staged { robot, drive, chain, view } =
            self.staged(self.robot.clone(), terms, resolution, table, self.steps_of(run, step) as f64 * step)?;
        let signal = &self.signals[run];
        // Rows at the same time stand in several channels.
        let mut times = signal.times.clone();
        times.sort_by(f64::total_cmp);
        times.dedup();
        let seen: Vec<f64> = times.iter().map(|t| (t - view.delay).max(0.0)).collect();
        let tracks = track(&robot, &drive, chain, step, &self.markers, &seen).map_err(|error| error.to_string())?;
        let n = self.markers.len();
        let at = |(t, channel): (&f64, &usize)| {
            let row = times.partition_point(|time| time < t);
            let seen = view.of(tracks[row * n + channel / 2]);
            10.0 * seen[channel % 2]
        };
        Ok(signal.times.iter().zip(&signal.channels).map(at).collect())
    }
}

/// Follows markers (cm along the robot) at rising `times` (s), from rest at the drive's first voltages: x and z (cm) of every marker, row after
/// row, from where the left end of the flat robot is.
///
/// # Errors
/// Whatever the engine reports.
pub fn track(
    robot: &Robot,
    drive: &Drive,
    chain: SignalChain,
    step: f64,
    markers: &[f64],
    times: &[f64],
) -> Result<Vec<[f64; 2]>, EngineError> {
    track_from(robot, 0.0, drive, chain, step, markers, times)
}

/// The same from rest with a mass `hung` (g) at the end that is gone at the beginning.
fn track_from(
    robot: &Robot,
    hung: f64,
    drive: &Drive,
    mut chain: SignalChain,
    h: f64,
    markers: &[f64],
    times: &[f64],
) -> Result<Vec<[f64; 2]>, EngineError> {
    let build = |robot: &Robot| match robot.mount {
        Mount::Clamped => PlanarEngine::with_numerical_damping(robot, h, NUMERICAL_DAMPING),
        _ => PlanarEngine::new(robot, h),
    };
    let mut engine = build(robot)?;
    let n = robot.actuators;
    let mut means = Means::new(drive, n, 0.0);
    let mut volts = vec![0.0; n];
    drive.voltages(0.0, &mut volts);
    chain.settle(&mut volts);
    if hung > 0.0 {
        let mut loaded = robot.clone();
        let position = robot.material.actuator_length * robot.actuators as f64;
        loaded.extensions.point_masses.push(PointMass { mass: hung, position });
        let mut loaded = build(&loaded)?;
        loaded.settle(&volts)?;
        engine.load(0, &loaded.save()?)?;
    } else {
        engine.settle(&volts)?;
    }

    let segments = robot.segments();
    let origin = -0.5 * segments[0].length;
    // Body and share of it where each marker sits.
    let mut places = Vec::new();
    for marker in markers {
        let (mut body, mut left) = (0, 0.0);
        while body + 1 < segments.len() && left + segments[body].length < *marker {
            left += segments[body].length;
            body += 1;
        }
        places.push((body, (marker - left) / segments[body].length));
    }
    let nodes = robot.joints() + 2;
    let (mut positions, mut velocities) = (vec![0.0; 3 * nodes], vec![0.0; 3 * nodes]);
    let mut look = |engine: &mut PlanarEngine, out: &mut Vec<[f64; 4]>| -> Result<(), EngineError> {
        engine.nodes(&mut positions, &mut velocities)?;
        out.clear();
        for (body, share) in &places {
            let between = |of: &[f64], axis: usize| {
                let (a, b) = (of[3 * body + axis], of[3 * body + 3 + axis]);
                a + share * (b - a)
            };
            out.push([between(&positions, 0) - origin, between(&positions, 2), between(&velocities, 0), between(&velocities, 2)]);
        }
        Ok(())
    };
    let (mut before, mut after): (Vec<[f64; 4]>, Vec<[f64; 4]>) = (Vec::new(), Vec::new());
    let mut tracks = Vec::with_capacity(times.len() * markers.len());
    let (parts, mut piece) = (chain.parts(), vec![0.0; n]);
    let (mut step, mut next) = (0_u64, 0);
    while next < times.len() {
        let (from, to) = (step as f64 * h, (step + 1) as f64 * h);
        // Rows that fall on a step take its state; the others lie between two.
        let here = |t: f64| t <= from + ON_STEP * h;
        let due = times[next] < to - ON_STEP * h;
        if due {
            look(&mut engine, &mut before)?;
            while next < times.len() && here(times[next]) {
                tracks.extend(before.iter().map(|[x, z, ..]| [*x, *z]));
                next += 1;
            }
            if next == times.len() {
                break;
            }
        }
        if parts == 1 {
            means.over(from, to, &mut volts);
            chain.pass(h, &mut volts);
        } else {
            volts.fill(0.0);
            for part in 0..parts {
                let [a, b] = [part, part + 1].map(|k| from + h * k as f64 / parts as f64);
                means.over(a, b, &mut piece);
                chain.pass(h / parts as f64, &mut piece);
                volts.iter_mut().zip(&piece).for_each(|(sum, v)| *sum += v / parts as f64);
            }
        }
        engine.prepare(&volts)?;
        engine.advance()?;
        step += 1;
        if times[next] < to - ON_STEP * h {
            look(&mut engine, &mut after)?;
            while next < times.len() && times[next] < to - ON_STEP * h {
                let t = times[next];
                tracks.extend(before.iter().zip(&after).map(|([x0, z0, u0, w0], [x1, z1, u1, w1])| {
                    [hermite(t, [from, to], [*x0, *u0], [*x1, *u1]), hermite(t, [from, to], [*z0, *w0], [*z1, *w1])]
                }));
                next += 1;
            }
        }
    }
    if tracks.iter().flatten().all(|value| value.is_finite()) {
        Ok(tracks)
    } else {
        Err(EngineError::NotFinite { what: "a marker".into(), value: f64::NAN, step, time: step as f64 * h, stable_step: None })
    }
}
