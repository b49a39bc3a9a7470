//! A robot of this crate as a plant: the planar engine with effects, and the markers of a data set.

use rayon::prelude::*;

use super::DiagnoseError;
use super::bench::{self, Spread};
use super::candidates::candidates;
use super::conventions::{is_curve_a_convention, is_gain_a_convention};
use super::dataset::{Bench, Dataset, MeasuredRun, Response, Start};
use super::kept::Kept;
use super::plant::{Candidate, Free, FreeCurve, Model, Nuisance, Plant, Signal, Term};
use super::quality;
use super::response::Sine;
use super::track::{ON_STEP, track};
use super::visited::{Visit, Visited, visited};
use super::voltage::Command;
use crate::analytic;
use crate::drive::{Drive, Table, Waveform};
use crate::effects::{self, Action, Applied, EffectError, Kind, SignalChain, View};
use crate::model::{Mount, PointMass, Robot};

/// Joints per actuator that are tried; more change a cantilever's first frequency by less than 0.06 %.
const JOINTS: [usize; 12] = [1, 2, 3, 4, 5, 6, 8, 10, 12, 14, 16, 20];
/// Most joints per actuator on the ground, where the error of contact exceeds that of the joints.
const JOINTS_ON_THE_FLOOR: usize = 8;
/// Time steps of a clamped robot per period of its first mode.
const STEPS_PER_PERIOD: f64 = 220.0;
/// Time step of a robot on the ground (s), short enough for impacts.
const GROUND_STEP: f64 = 1e-4;
/// Kinds of effects that do nothing at 0 V.
const ON_VOLTAGES: [Kind; 2] = [Kind::Driver, Kind::Actuation];

/// True for causes with which the joints' steps are repeated until friction agrees with its law; a cable that drags is not counted so.
fn has_repeated_steps(candidate: &Candidate) -> bool {
    matches!(candidate.id, "dry-friction" | "free-joint-friction")
}

/// True for a law of the joints' deviation that costs half as much as the motion: with a power that is fitted, or a curve.
fn is_elastic_law(candidate: &Candidate) -> bool {
    candidate.id == "free-moment-of-deviation" || (candidate.id == "stiffness-softening" && candidate.is_variant)
}

/// True for a limit of the voltage's rate that is approached softly: where it rounds the voltage, it is followed in parts of a time step.
fn is_soft_limit(candidate: &Candidate) -> bool {
    candidate.id == "slew-limit" && candidate.parameters.iter().any(|free| free.name == "linear_s")
}

/// Time steps in a period of a frequency response.
const ROWS_PER_PERIOD: f64 = 40.0;
/// Nodes and weights of Gauss's rule for the mean over an interval of length 1 about 0: exact for a motion of fifth degree in time.
const OF_EXPOSURE: [[f64; 2]; 3] =
    [[-0.387_298_334_620_741_7, 5.0 / 18.0], [0.0, 8.0 / 18.0], [0.387_298_334_620_741_7, 5.0 / 18.0]];
/// Largest change of a run's prediction by a longer time step (rms, in σ).
const LARGEST_CHANGE: f64 = 0.15;

/// An experiment that could be made.
pub struct Scene {
    /// The voltages (V) in time.
    pub drive: Table,
    /// Length (s).
    pub duration: f64,
    /// A mass (g) at the right end that is released at t = 0.
    pub hung: f64,
    /// A known mass (g) at the right end.
    pub added: f64,
    /// True if the sheet is turned over, so that gravity changes sign in its frame.
    pub turned_over: bool,
    /// Marker positions along the robot (cm).
    pub markers: Vec<f64>,
}

/// A run to be simulated.
struct Run {
    robot: Robot,
    /// Marker positions along the robot (cm).
    markers: Vec<f64>,
    command: Command,
    start: Start,
    /// Time at which it starts (s).
    origin: f64,
    /// Times (s) of the rows that count, ascending, which all channels share.
    times: Vec<f64>,
    /// Time from there to its last row (s).
    duration: f64,
    /// Time step (s).
    step: f64,
    /// Factor on positive voltages (–).
    positive_gain: f64,
    /// False where times were made of voltages: rows then have no clock that could be off.
    has_clock: bool,
    /// The frequency response that it is, if it is none in time.
    response: Option<Response>,
}

/// A data set with its robot.
pub struct RobotPlant {
    robot: Robot,
    /// Marker positions along the robot (cm).
    markers: Vec<f64>,
    channels: Vec<String>,
    runs: Vec<Run>,
    signals: Vec<Signal>,
    candidates: Vec<Candidate>,
    bench: Bench,
    /// Time over which a frame takes the mean of the motion (s).
    exposure: f64,
    /// True if there is no voltage in any run.
    without_voltage: bool,
    /// Positions as a camera without errors sees them.
    seen: Kept,
}

impl RobotPlant {
    /// The plant of a data set, with the noise and masks that [`quality::check`] returned for it.
    pub fn new(dataset: &Dataset, checked: &quality::Checked) -> Self {
        let n = dataset.robot.actuators;
        let (mut runs, mut signals) = (Vec::new(), Vec::new());
        let responses = dataset.response_channels();
        for (run, masks) in dataset.runs.iter().zip(&checked.runs) {
            let robot = run.robot.clone();
            let gain = run.nominal.robot.positive_gain.unwrap_or(1.0);
            let times: Vec<f64> = run.times.iter().map(|t| t - run.origin).collect();
            let (command_times, volts) = run.command();
            let command_times: Vec<f64> = command_times.iter().map(|t| t - run.origin).collect();
            let volts: Vec<f64> = volts.iter().map(|v| if *v > 0.0 { v * gain } else { *v }).collect();
            let command = Command::new(&command_times, &volts, n);
            let mut signal = Signal { id: run.id.clone(), is_spectrum: run.response.is_some(), ..Signal::default() };
            for (channel, (column, usable)) in run.channels.iter().zip(masks).enumerate() {
                for (row, value) in column.iter().enumerate().filter(|(row, _)| usable[*row]) {
                    signal.values.push(*value);
                    signal.sigmas.push(run.sigma.unwrap_or(checked.noise[channel]));
                    signal.times.push(times[row]);
                    signal.channels.push(channel);
                    signal.inputs.push(run.voltages[row * n]);
                }
            }
            let mut longest = step(&robot, &times);
            if let Some(Response { frequencies, channel, amplitude, parts, .. }) = &run.response {
                // In-phase and quadrature parts are channels of their own, with frequencies for times.
                let first = 2 * dataset.markers.len() + 2 * responses.iter().take_while(|other| *other < channel).count();
                for (part, (frequency, values)) in
                    [0, 1].into_iter().flat_map(|k| frequencies.iter().zip(parts).map(move |row| (k, row)))
                {
                    signal.values.push(values[part]);
                    signal.sigmas.push(run.sigma.unwrap_or(checked.noise[*channel]));
                    signal.times.push(*frequency);
                    signal.channels.push(first + part);
                    signal.inputs.push(*amplitude);
                }
                longest = longest.min(1.0 / (ROWS_PER_PERIOD * frequencies[frequencies.len() - 1]));
            }
            let mut counted = signal.times.clone();
            counted.sort_by(f64::total_cmp);
            counted.dedup();
            signals.push(signal);
            runs.push(Run {
                times: counted,
                step: longest,
                robot,
                markers: run.positions.clone(),
                command,
                start: run.start,
                origin: run.origin,
                duration: times[times.len() - 1],
                positive_gain: gain,
                has_clock: run.has_clock,
                response: run.response.clone(),
            });
        }
        let is_at_zero = |run: &MeasuredRun| run.response.is_none() && run.command().1.iter().all(|v| *v == 0.0);
        let without_voltage = dataset.runs.iter().all(is_at_zero);
        let mut channels = dataset.channel_names();
        for channel in responses {
            channels.extend(["in phase", "in quadrature"].map(|part| format!("{} {part}", channels[channel])));
        }
        let plant = Self {
            robot: dataset.robot.clone(),
            markers: dataset.markers.iter().map(|marker| marker.position).collect(),
            channels,
            runs,
            signals,
            candidates: Vec::new(),
            bench: dataset.bench,
            exposure: 1e-3 * dataset.camera.exposure_ms.unwrap_or(0.0),
            without_voltage,
            seen: Kept::default(),
        };
        plant.with_chosen_steps().with_candidates()
    }

    /// Sets the candidates, free forms on the ranges that the runs visit.
    fn with_candidates(mut self) -> Self {
        let visit = |run: usize| {
            let Run { robot, start, command, step, .. } = &self.runs[run];
            let drive = command.table(&vec![1.0; self.nuisances(run)], 0.0);
            Visit { robot, start, drive, step: *step, steps: self.steps_of(run, *step) }
        };
        let visits: Vec<_> = (0..self.runs.len()).map(visit).collect();
        let bench = effects::Bench::new(&self.robot, self.markers.len(), self.runs.len());
        // A nominal model that cannot be simulated is reported by the first prediction.
        let mut all = visited(&visits).map_or(Vec::new(), |visited| {
            let (coordinate, axes) = self.seen();
            candidates(&bench, &Visited { coordinate, axes, ..visited })
        });
        if self.without_voltage {
            // What acts on voltages does nothing without any.
            all.retain(|c| {
                effects::find(c.id).is_none_or(|effect| !ON_VOLTAGES.contains(&effect.kind)) && c.id != "actuation-gain"
            });
        }
        self.candidates = all;
        self
    }

    /// The largest coordinate of a marker (mm), measured or on the flat robot, and whether x and z are measured. A frequency response has no positions, only an axis.
    fn seen(&self) -> (f64, [bool; 2]) {
        let (mut coordinate, mut axes) = (0.0_f64, [false; 2]);
        for (run, signal) in self.runs.iter().zip(&self.signals) {
            if let Some(response) = &run.response {
                axes[response.channel % 2] = true;
                continue;
            }
            for (value, channel) in signal.values.iter().zip(&signal.channels) {
                axes[channel % 2] = true;
                coordinate = coordinate.max(value.abs());
            }
        }
        // Where a place is not measured, or badly, it is that of the flat robot.
        (self.markers.iter().fold(coordinate, |most, position| most.max(10.0 * position)), axes)
    }

    /// Sets each run's time step to the longest that keeps its prediction within [`LARGEST_CHANGE`].
    fn with_chosen_steps(mut self) -> Self {
        let steps: Vec<f64> = (0..self.runs.len()).into_par_iter().map(|run| self.longest_step(run)).collect();
        self.runs.iter_mut().zip(steps).for_each(|(run, step)| run.step = step);
        self
    }

    fn longest_step(&self, run: usize) -> f64 {
        let Run { robot, step: finest, .. } = &self.runs[run];
        let finest = *finest;
        let limit = 0.09 / (analytic::cantilever_frequency(robot) * (robot.actuators as f64).powi(2));
        let ends = Nuisance { shares: vec![1.0; self.nuisances(run)], ..Nuisance::default() };
        let with = |step: f64| self.predict_with(&[], self.robot.motors_per_actuator as f64, run, &ends, step).ok();
        let (Some(fine), Mount::Clamped) = (with(finest), self.robot.mount) else { return finest };
        let sigmas = &self.signals[run].sigmas;
        let mut best = finest;
        for factor in [2.0, 4.0, 8.0] {
            let step = factor * finest;
            let Some(coarse) = with(step).filter(|_| step < limit) else { break };
            let chi2: f64 = fine.iter().zip(&coarse).zip(sigmas).map(|((a, b), s)| ((a - b) / s).powi(2)).sum();
            if (chi2 / fine.len().max(1) as f64).sqrt() > LARGEST_CHANGE {
                break;
            }
            best = step;
        }
        best
    }

    /// The time step (s) of a run.
    pub fn step(&self, run: usize) -> f64 {
        self.runs[run].step
    }

    /// The time (s) at which a run starts, on the clock of its file.
    pub fn start(&self, run: usize) -> f64 {
        self.runs[run].origin
    }

    /// The number of steps of `step` (s) that a run takes: one beyond its last row, so that the state there is recorded.
    pub fn steps_of(&self, run: usize, step: f64) -> u64 {
        (self.runs[run].duration / step - ON_STEP).ceil().max(0.0) as u64 + 1
    }

    /// The command of a run.
    pub fn command(&self, run: usize) -> &Command {
        &self.runs[run].command
    }

    /// Marker positions along the robot (cm).
    pub fn markers(&self) -> &[f64] {
        &self.markers
    }

    /// The mean standard deviation of the noise (mm).
    pub fn noise(&self) -> f64 {
        let sigmas: Vec<f64> = self.signals.iter().flat_map(|signal| signal.sigmas.iter().copied()).collect();
        sigmas.iter().sum::<f64>() / sigmas.len().max(1) as f64
    }

    /// Positions (mm) of a scene's markers under `model`: x and z of each marker in each of `rows` rows.
    ///
    /// # Errors
    /// [`DiagnoseError`] if the scene cannot be simulated.
    pub fn simulate(&self, model: &Model, scene: &Scene, rows: usize) -> Result<Vec<f64>, DiagnoseError> {
        let mut robot = self.robot.clone();
        if scene.turned_over {
            robot.material.gravity *= -1.0;
        }
        if scene.added > 0.0 {
            let position = robot.material.actuator_length * robot.actuators as f64;
            robot.extensions.point_masses.push(PointMass { mass: scene.added, position });
        }
        let effects = model.terms.iter().map(|term| self.applied(term)).collect::<Result<Vec<_>, _>>()?;
        let Setup { robot, drive, chain, view } = setup(robot, &effects, model.resolution, scene.drive.clone(), scene.duration)?;
        let times: Vec<f64> = (0..rows).map(|row| (scene.duration * row as f64 / rows as f64 - view.delay).max(0.0)).collect();
        let step = self.runs.iter().map(|run| run.step).fold(1e-3, f64::min);
        let start = if scene.hung > 0.0 { Start::Hung(scene.hung) } else { Start::Settled };
        let tracks = track(&robot, &start, &drive, chain, step, &scene.markers, &times)?;
        Ok(tracks.into_iter().flat_map(|at| view.of(at).map(|x| 10.0 * x)).collect())
    }

    /// The nominal robot.
    pub fn robot(&self) -> &Robot {
        &self.robot
    }

    /// The effect of a term, with the values of its coordinates.
    ///
    /// # Errors
    /// [`DiagnoseError::Effect`] if a value is out of the effect's range.
    pub fn applied(&self, term: &Term) -> Result<Applied, DiagnoseError> {
        let candidate = &self.candidates[term.candidate];
        let effect = effects::find(candidate.id).ok_or_else(|| EffectError::Unknown(candidate.id.into()))?;
        // Limits beyond the range that files may give limit nothing: a fit comes near to where the effect vanishes, at infinity.
        let within = |name: &str, value: f64| {
            let known = effect.parameters.iter().find(|p| p.name == name)?;
            let is_beyond = known.off.is_some_and(f64::is_infinite) && !(known.bounds[0]..=known.bounds[1]).contains(&value);
            if is_beyond { known.off } else { Some(value) }
        };
        let value = |(p, x): (&Free, &f64)| (p.name, within(p.name, p.value(*x)).unwrap_or(p.value(*x)));
        let free = candidate.parameters.iter().zip(&term.x).map(value);
        Ok(effect.with(free.chain(candidate.fixed.iter().copied()))?)
    }

    /// The effect of a term in a run: what drifts from run to run does so in the order of the data set, about the mean of all runs.
    ///
    /// # Errors
    /// As [`applied`](Self::applied).
    pub fn applied_in(&self, term: &Term, run: usize) -> Result<Applied, DiagnoseError> {
        Ok(self.applied(term)?.in_run(run as f64 - 0.5 * (self.runs.len() as f64 - 1.0)))
    }
}

/// Frequency of the first mode of a clamped robot (Hz).
fn first_frequency(robot: &Robot) -> f64 {
    analytic::cantilever_frequency(robot) / (robot.actuators as f64).powi(2)
}

/// A time step (s) that divides the median interval of the rows at `times` (s).
pub(super) fn step(robot: &Robot, times: &[f64]) -> f64 {
    let longest = match robot.mount {
        Mount::Clamped => 1.0 / (STEPS_PER_PERIOD * analytic::cantilever_frequency(robot) / (robot.actuators as f64).powi(2)),
        _ => GROUND_STEP,
    };
    quality::median_interval(times).map_or(longest, |interval| interval / (interval / longest).ceil())
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

    /// Joints per actuator: the nominal number, then the larger ones of `JOINTS`.
    fn resolutions(&self) -> Vec<f64> {
        let nominal = self.robot.motors_per_actuator;
        let most = if self.robot.mount == Mount::Ground { JOINTS_ON_THE_FLOOR } else { usize::MAX };
        let finer = JOINTS.into_iter().filter(|m| *m > nominal && *m <= most);
        std::iter::once(nominal).chain(finer).map(|m| m as f64).collect()
    }

    fn nuisances(&self, run: usize) -> usize {
        self.runs[run].command.jumps().len()
    }

    /// Time steps, times joints and what a step costs without any (in joints), times repetitions of a step.
    fn work(&self, model: &Model, run: usize) -> u64 {
        // Estimated from a profile at 40 joints.
        const OF_STEP: f64 = 16.0;
        // A set with friction took 47 simulations a second where one without took 117.
        const REPETITIONS: f64 = 2.5;
        // A search among elastic laws took 15.6 ms a simulation, one among others 10.3 ms.
        const ELASTIC_LAW: f64 = 1.5;
        // In a search with one it took 39 % of the time; a quarter since it has three transcendental functions, so that this is more than it costs.
        const SOFT_LIMIT: f64 = 1.6;
        let Run { robot, response, step, .. } = &self.runs[run];
        let steps = match response {
            Some(response) => {
                let first = first_frequency(robot);
                let durations = response.frequencies.iter().map(|frequency| Sine::duration_of(*frequency, robot, first));
                (durations.sum::<f64>() / step).ceil() as u64
            }
            None => self.steps_of(run, *step),
        };
        let of_step = OF_STEP + robot.actuators as f64 * model.resolution;
        let has = |is_such: fn(&Candidate) -> bool| model.terms.iter().any(|term| is_such(&self.candidates[term.candidate]));
        // Half the time step in the final refit.
        let factors = [
            (has(has_repeated_steps), REPETITIONS),
            (has(is_elastic_law), ELASTIC_LAW),
            (has(is_soft_limit), SOFT_LIMIT),
            (model.fine, 2.0),
        ];
        let factor: f64 = factors.into_iter().filter(|(applies, _)| *applies).map(|(_, factor)| factor).product();
        (steps as f64 * of_step * factor) as u64
    }

    fn moves_unaided(&self, run: usize) -> bool {
        self.runs[run].start != Start::Settled || self.runs[run].response.is_some()
    }

    fn bench(&self) -> [Option<f64>; bench::KINDS] {
        let Bench { clock_ms, zero_mm, gain, drift_mm_per_s } = self.bench;
        let clock = clock_ms.map(|ms| 1e-3 * ms);
        let mut given = if self.without_voltage {
            // There is no gain, and no second clock: its offset is that of the release.
            [clock, Some(0.0), Some(0.0), gain, zero_mm, drift_mm_per_s]
        } else {
            // A given gain is that of the voltage; the camera's scale then has none of its own.
            [clock, None, gain, gain.map(|_| 0.0), zero_mm, drift_mm_per_s]
        };
        for (kind, given) in given.iter_mut().enumerate() {
            if !(0..self.runs.len()).any(|run| self.has_fault(run, kind)) {
                *given = Some(0.0);
            }
        }
        given
    }

    fn has_fault(&self, run: usize, kind: usize) -> bool {
        let Run { response, has_clock, duration, .. } = &self.runs[run];
        match kind {
            // An analyser takes its sines out of zero and drift, on one clock, with one scale.
            _ if response.is_some() => kind == Spread::GAIN,
            Spread::CLOCK | Spread::RATE | Spread::DRIFT => *has_clock && *duration > 0.0,
            _ => true,
        }
    }

    /// A constant counts only beyond the error of the discretisation: 1/(2m²) of the stiffness for m joints, six times that of the damping, and
    /// 0.5 % of the actuation gain, which does not depend on m.
    fn is_credible(&self, term: &Term, resolution: f64) -> bool {
        let candidate = &self.candidates[term.candidate];
        let tolerance = match candidate.id {
            "damping" => 3.0 / (resolution * resolution),
            "actuation-gain" => 0.005,
            _ => 0.5 / (resolution * resolution),
        };
        !candidate.is_constant || term.x.iter().any(|x| (x - 1.0).abs() > tolerance)
    }

    fn is_convention(&self, terms: &[Term], index: usize, left: f64) -> bool {
        let effects: Result<Vec<Applied>, _> = terms.iter().map(|term| self.applied(term)).collect();
        effects.is_ok_and(|effects| match self.candidates[terms[index].candidate].id {
            "actuation-gain" => is_gain_a_convention(&effects, left),
            "field-dependent-gain" => is_curve_a_convention(&effects, left),
            _ => false,
        })
    }

    fn curve(&self, term: &Term) -> Option<FreeCurve> {
        let Applied { effect, values } = self.applied(term).ok()?;
        let shape = effect.shape.as_ref()?;
        Some(FreeCurve { x: [shape.x, shape.x_unit], y: [shape.y, shape.y_unit], points: (shape.points)(&values) })
    }

    fn place_in_words(&self, place: &str) -> String {
        effects::Place::ALL
            .iter()
            .find(|known| known.name() == place)
            .map_or_else(|| place.to_owned(), |known| known.words().into())
    }

    fn predict(&self, model: &Model, run: usize, nuisance: &Nuisance) -> Result<Vec<f64>, DiagnoseError> {
        let step = self.step(run) * if model.fine { 0.5 } else { 1.0 };
        self.predict_with(&model.terms, model.resolution, run, nuisance, step)
    }
}

/// The bits of all that the motion of a run depends on, and the times at which it is seen.
fn motion_key<'t>(terms: impl Iterator<Item = &'t Term>, numbers: [f64; 3], run: usize, nuisance: &Nuisance) -> Vec<u64> {
    let nuisance = nuisance.shares.iter().chain(&nuisance.base).chain(&numbers).map(|x| x.to_bits());
    std::iter::once(run as u64).chain(nuisance).chain(terms.flat_map(Term::bits)).collect()
}

/// A model made ready to run.
struct Setup {
    robot: Robot,
    drive: Drive,
    chain: SignalChain,
    view: View,
}

/// The robot with `effects` and a number of joints, driven by `command` for `duration` (s).
fn setup(mut robot: Robot, effects: &[Applied], resolution: f64, command: Table, duration: f64) -> Result<Setup, DiagnoseError> {
    robot.motors_per_actuator = resolution as usize;
    let mut drive = Drive { waveform: Waveform::Table(command), positive_gain: 1.0, delay: 0.0 };
    effects::apply(effects, &mut robot, &mut drive)?;
    let chain = SignalChain::new(effects, robot.actuators, duration);
    Ok(Setup { robot, drive, chain, view: View::new(effects) })
}

impl RobotPlant {
    fn predict_with(
        &self,
        terms: &[Term],
        resolution: f64,
        run: usize,
        nuisance: &Nuisance,
        step: f64,
    ) -> Result<Vec<f64>, DiagnoseError> {
        let Run { response, times, markers, .. } = &self.runs[run];
        let effects = terms.iter().map(|term| self.applied_in(term, run)).collect::<Result<Vec<_>, _>>()?;
        if let Some(response) = response {
            return self.respond(response, &self.runs[run], &effects, resolution, nuisance, step);
        }
        // Only its delay changes what the camera sees; the rest is what it makes of it.
        let view = View::new(&effects);
        let is_moving = |applied: &Applied| !matches!(applied.effect.action, Action::View(_));
        let moving = terms.iter().zip(&effects).filter(|(_, applied)| is_moving(applied));
        let key = motion_key(moving.map(|(term, _)| term), [resolution, step, view.delay], run, nuisance);
        let moving: Vec<Applied> = effects.into_iter().filter(is_moving).collect();
        let positions = self.seen.get_or(key, || self.positions(&moving, resolution, run, nuisance, (step, view.delay)))?;
        let signal = &self.signals[run];
        let at = |(t, channel): (&f64, &usize)| {
            let row = times.partition_point(|time| time < t);
            let first = 2 * (row * markers.len() + channel / 2);
            10.0 * view.of([positions[first], positions[first + 1]])[channel % 2]
        };
        Ok(signal.times.iter().zip(&signal.channels).map(at).collect())
    }

    /// Positions of a run's markers (cm) at its times, x and z of each, as a camera sees them that is late by `delay` (s) and has no other error.
    fn positions(
        &self,
        effects: &[Applied],
        resolution: f64,
        run: usize,
        nuisance: &Nuisance,
        (step, delay): (f64, f64),
    ) -> Result<Vec<f64>, DiagnoseError> {
        let Run { robot, markers, command, start, has_clock, times, .. } = &self.runs[run];
        let table = command.table(&nuisance.shares, nuisance.base[Spread::GAIN]);
        let Setup { robot, drive, chain, .. } =
            setup(robot.clone(), effects, resolution, table, self.steps_of(run, step) as f64 * step)?;
        let rule: &[[f64; 2]] = if self.exposure > 0.0 { &OF_EXPOSURE } else { &[[0.0, 1.0]] };
        // Times at which positions are needed, with their rows and weights.
        let at_row = |(row, t): (usize, &f64)| {
            let middle = if *has_clock { nuisance.time(*t) } else { *t } - delay;
            rule.iter().map(move |[node, weight]| ((middle + node * self.exposure).max(0.0), row, *weight))
        };
        let mut seen: Vec<(f64, usize, f64)> = times.iter().enumerate().flat_map(at_row).collect();
        // Frames may overlap where rows are closer than an exposure.
        seen.sort_by(|a, b| a.0.total_cmp(&b.0));
        let tracks = track(&robot, start, &drive, chain, step, markers, &seen.iter().map(|(t, ..)| *t).collect::<Vec<_>>())?;
        let n = markers.len();
        let mut positions = vec![0.0; 2 * times.len() * n];
        for ((_, row, weight), at) in seen.iter().zip(tracks.chunks_exact(n)) {
            for (mean, position) in positions[2 * row * n..].iter_mut().zip(at.iter().flatten()) {
                *mean += weight * position;
            }
        }
        Ok(positions)
    }

    /// The values of a frequency response. An analyser has one clock and one gain, so only the gain of the inputs differs from run to run.
    fn respond(
        &self,
        response: &Response,
        run: &Run,
        effects: &[Applied],
        resolution: f64,
        nuisance: &Nuisance,
        step: f64,
    ) -> Result<Vec<f64>, DiagnoseError> {
        let first = first_frequency(&run.robot);
        let marker = &run.markers[response.channel / 2..][..1];
        let of = |frequency: &f64| -> Result<[f64; 2], DiagnoseError> {
            let applied = |v: f64| (1.0 + nuisance.base[Spread::GAIN]) * if v > 0.0 { run.positive_gain * v } else { v };
            let sine = Sine::new(response, *frequency, &run.robot, first, applied);
            let duration = sine.duration();
            let Setup { robot, drive, chain, view } =
                setup(run.robot.clone(), effects, resolution, sine.table.clone(), duration)?;
            let tracks = track(&robot, &run.start, &drive, chain, step, marker, &sine.times(-view.delay))?;
            let samples: Vec<f64> = tracks.into_iter().map(|at| 10.0 * view.of(at)[response.channel % 2]).collect();
            Ok(sine.parts(&samples, self.exposure))
        };
        let parts: Vec<[f64; 2]> = response.frequencies.par_iter().map(of).collect::<Result<_, _>>()?;
        Ok([0, 1].into_iter().flat_map(|part| parts.iter().map(move |parts| parts[part])).collect())
    }
}
