//! Reading a `[[run]]` with its files.

use std::path::Path;

use super::super::run_csv::{self, Rows, Voltages, Wanted};
use super::super::{robot, voltage};
use super::read::{Reader, beyond, check_effects, line_of, resolved_robot, value_error};
use super::{DataError, Log, MOST_STEPS, MeasuredRun, Release, RunEntry, Start};
use crate::analytic;
use crate::experiment::{Config, MaterialConfig, RobotConfig};
use crate::model::{Mount, Robot};
use crate::words::{self, number};

/// Largest hung mass (g).
const MOST_GRAMS: f64 = 1e3;
/// Largest height (mm) from which a robot is dropped.
const HIGHEST_MM: f64 = 1e3;
/// Rows this near to the end of a stretch (s) belong to it.
const SAME_TIME: f64 = 1e-9;
const SHAPES: &str = "hung_g = ... (a mass at the right end), level = true (from height_mm on the floor), or held = \"MARKER\" with held_z_mm = ...";

/// A config with the keys of `[robot]` and `[material]` that are given anew.
///
/// # Errors
/// Why the tables cannot be put together.
pub(in crate::diagnose) fn overridden(
    nominal: &Config,
    robot: &RobotConfig,
    material: &MaterialConfig,
) -> Result<Config, String> {
    fn merged<T: serde::Serialize + serde::de::DeserializeOwned>(own: &T, over: &T) -> Result<T, String> {
        let table = |of: &T| toml::Table::try_from(of).map_err(|error| error.to_string());
        let mut own = table(own)?;
        own.extend(table(over)?);
        own.try_into().map_err(|error: toml::de::Error| error.to_string())
    }
    Ok(Config { robot: merged(&nominal.robot, robot)?, material: merged(&nominal.material, material)?, ..nominal.clone() })
}

/// A run's file is wrong as a whole.
fn bad(path: &Path, entry: &RunEntry, reason: String) -> DataError {
    DataError::Unreadable { path: path.into(), reason: format!("run {}: {reason}", entry.id) }
}

impl Reader<'_> {
    /// Reads the run with a number `index`.
    ///
    /// # Errors
    /// [`DataError`] with the file, and the line of the description or of the run's file.
    pub(super) fn run(&self, index: usize, entry: &RunEntry) -> Result<MeasuredRun, DataError> {
        let (nominal, robot) = self.own_robot(index, entry)?;
        let positions = self.positions(index, entry, &robot)?;
        let start = self.start(index, entry, &robot, &positions)?;
        let at = entry.release.as_ref().and_then(|release| release.at_s);

        let folder = self.path.parent().unwrap_or(Path::new(""));
        let path = folder.join(&entry.file);
        let gain = nominal.robot.positive_gain.unwrap_or(1.0);
        let voltages = match (&entry.voltage_file, start) {
            (Some(_), _) => Voltages::Elsewhere,
            (None, Start::Settled) => Voltages::Needed,
            (None, _) => Voltages::NoneIsZero,
        };
        if let Some(rate) = entry.rate_v_per_s {
            if !(rate > 0.0 && rate.is_finite()) {
                return Err(self.wrong(index, entry, &["rate_v_per_s"], format!("is {}, but must be positive", number(rate))));
            }
            if entry.voltage_file.is_some() || start != Start::Settled {
                let reason = "belongs to a file of voltages and positions without time, which starts at rest: take voltage_file and start away";
                return Err(self.wrong(index, entry, &["rate_v_per_s"], reason));
            }
        }
        let wanted = Wanted {
            robot: &robot,
            positive_gain: gain,
            markers: self.markers,
            columns: self.columns,
            voltages,
            ramp: entry.rate_v_per_s,
            frame_rate: self.camera.frame_rate_hz,
        };
        let mut rows = run_csv::read(&path, &wanted)?;
        let mut log = None;
        if let Some(file) = &entry.voltage_file {
            let file = folder.join(file);
            let Rows { times, voltages, .. } =
                run_csv::read(&file, &Wanted { markers: &[], voltages: Voltages::Needed, frame_rate: None, ..wanted })?;
            let ends = [times[0], times[times.len() - 1]];
            let seen = [rows.times[0], rows.times[rows.times.len() - 1]];
            let left_out = keep(&mut rows, robot.actuators, ends);
            let [a, b, c, d] = [seen[0], seen[1], ends[0], ends[1]].map(number);
            let clocks = format!("t_s goes from {a} to {b} s in {} and from {c} to {d} s in {}", path.display(), file.display());
            match (left_out, rows.times.len()) {
                (0, _) => {}
                (_, 0 | 1) => {
                    let advice = "give both the same zero to within some seconds; smaller offsets are found ([bench], clock_ms)";
                    let number = index.to_string();
                    return Err(DataError::Content {
                        path: self.path.into(),
                        line: line_of(self.text, &["run", &number, "voltage_file"]),
                        column: 0,
                        reason: format!(
                            "run {}: voltage_file: its clock does not overlap that of the positions: {clocks}; {advice}",
                            entry.id
                        ),
                    });
                }
                (left_out, _) => {
                    rows.remarks.push(format!("{left_out} rows without a known voltage are left out: {clocks}"));
                }
            }
            rows.voltages = interpolated(&times, &voltages, &rows.times, robot.actuators);
            log = Some((file, Log { times, voltages }));
        }
        if let Some(at) = at {
            let (first, last) = (rows.times[0], rows.times[rows.times.len() - 1]);
            let left_out = keep(&mut rows, robot.actuators, [at, f64::INFINITY]);
            let log_starts = log.as_ref().map_or(f64::NEG_INFINITY, |(_, log)| log.times[0]);
            if rows.times.len() < 2 || at < log_starts {
                let [at, first, last] = [at, first.max(log_starts), last].map(number);
                let reason = format!("is {at}, but the run goes from {first} to {last} s; give a time of its own clock");
                return Err(self.wrong(index, entry, &["release", "at_s"], reason));
            }
            if left_out > 0 {
                rows.remarks.push(format!("{left_out} rows before the release at {} s are left out", number(at)));
            }
        }
        let origin = match (at, start, &log) {
            (Some(at), ..) => at,
            (None, Start::Settled, Some((_, log))) => log.times[0],
            _ => rows.times[0],
        };
        let Rows { times, voltages, channels, remarks } = rows;
        let (log_path, log) = log.unzip();
        let command_path = log_path.unwrap_or_else(|| path.clone());
        let run = MeasuredRun {
            id: entry.id.clone(),
            path,
            role: entry.role,
            times,
            voltages,
            log,
            origin,
            start,
            has_clock: entry.rate_v_per_s.is_none(),
            nominal,
            robot,
            positions,
            sigma: None,
            response: None,
            channels,
            remarks,
        };
        checked(run, entry, &command_path)
    }

    /// A wrong value of a run's key.
    fn wrong(&self, index: usize, entry: &RunEntry, keys: &[&str], message: impl Into<String>) -> DataError {
        let number = index.to_string();
        let parts: Vec<&str> = ["run", &number].into_iter().chain(keys.iter().copied()).collect();
        value_error(self.path, self.text, &parts, &format!("run {}: {}", entry.id, keys.join(".")), message)
    }

    /// The nominal config and robot of a run.
    fn own_robot(&self, index: usize, entry: &RunEntry) -> Result<(super::Config, Robot), DataError> {
        let wrong = |keys: &[&str], message: String| self.wrong(index, entry, keys, message);
        check_effects(&entry.effect).map_err(|(at, reason)| wrong(&["effect", &at.to_string()], reason))?;
        if entry.robot == RobotConfig::default() && entry.material == MaterialConfig::default() && entry.effect.is_empty() {
            return Ok((self.nominal.clone(), self.robot.clone()));
        }
        let mut nominal = overridden(self.nominal, &entry.robot, &entry.material).map_err(|reason| wrong(&["robot"], reason))?;
        nominal.effect.extend(entry.effect.iter().cloned());
        let robot = resolved_robot(self.path, self.text, &nominal, &["run", &index.to_string()])?;
        for (key, differs) in [
            ("actuators", robot.actuators != self.robot.actuators),
            ("motors_per_actuator", robot.motors_per_actuator != self.robot.motors_per_actuator),
            ("mount", robot.mount != self.robot.mount),
        ] {
            if differs {
                let reason =
                    "differs from [robot]; all runs of a data set have it in common, so describe this run in a file of its own";
                return Err(wrong(&["robot", key], reason.into()));
            }
        }
        Ok((nominal, robot))
    }

    /// Positions of the markers (cm) along the robot of a run.
    fn positions(&self, index: usize, entry: &RunEntry, robot: &Robot) -> Result<Vec<f64>, DataError> {
        let wrong = |keys: &[&str], message: String| self.wrong(index, entry, keys, message);
        let names = || self.markers.iter().map(|marker| marker.name.as_str());
        if let Some(name) = entry.markers.keys().find(|name| !names().any(|known| known == *name)) {
            return Err(wrong(&["markers", name], format!("is no marker of [markers]{}", words::did_you_mean(name, names()))));
        }
        let length = robot.material.actuator_length * robot.actuators as f64;
        let own = |marker: &super::Marker| {
            let position = entry.markers.get(&marker.name).copied().unwrap_or(10.0 * marker.position);
            if (0.0..=10.0 * length + 1e-9).contains(&position) {
                return Ok(0.1 * position);
            }
            let reason = format!("{}; give its position on this robot in [run.markers]", beyond(&marker.name, position, length));
            Err(wrong(&["markers", &marker.name], reason))
        };
        self.markers.iter().map(own).collect()
    }

    /// The state at a run's start.
    fn start(&self, index: usize, entry: &RunEntry, robot: &Robot, positions: &[f64]) -> Result<Start, DataError> {
        let wrong = |keys: &[&str], message: String| Err(self.wrong(index, entry, keys, message));
        let release = match (entry.start.as_deref(), &entry.release) {
            (None | Some("settled"), None) => return Ok(Start::Settled),
            (None | Some("settled"), Some(_)) => {
                return wrong(&["release"], "belongs to start = \"released\": add that to the run".into());
            }
            (Some("released"), None) => {
                return wrong(&["start"], format!("is \"released\" without a shape: add [run.release] with {SHAPES}"));
            }
            (Some("released"), Some(release)) => release,
            (Some(other), _) => return wrong(&["start"], words::not_one_of(other, &["settled", "released"])),
        };
        if let Some(at) = release.at_s.filter(|at| !at.is_finite()) {
            return wrong(&["release", "at_s"], format!("is {at}, but must be a number"));
        }
        let clamped = robot.mount == Mount::Clamped;
        let height = release.height_mm.unwrap_or(0.0);
        if release.height_mm.is_some() && (robot.mount != Mount::Ground || release.level != Some(true)) {
            return wrong(&["release", "height_mm"], "needs level = true and mount = \"ground\"".into());
        }
        if !(0.0..=HIGHEST_MM).contains(&height) {
            let reason = format!("is {}, but must be from 0 to {HIGHEST_MM} mm", number(height));
            return wrong(&["release", "height_mm"], reason);
        }
        match release {
            Release { hung_g: Some(hung), level: None, held: None, held_z_mm: None, .. } => {
                if !(*hung > 0.0 && *hung <= MOST_GRAMS) {
                    let reason = format!("is {}, but must be above 0 and at most {MOST_GRAMS} g", number(*hung));
                    return wrong(&["release", "hung_g"], reason);
                }
                if !clamped {
                    return wrong(&["release", "hung_g"], "needs mount = \"clamped\"".into());
                }
                Ok(Start::Hung(*hung))
            }
            Release { hung_g: None, level: Some(true), held: None, held_z_mm: None, .. } => {
                Ok(Start::Level { height: 0.1 * height })
            }
            Release { hung_g: None, level: None, held: Some(name), held_z_mm: Some(z), .. } => {
                let names: Vec<&str> = self.markers.iter().map(|marker| marker.name.as_str()).collect();
                let Some(at) = names.iter().position(|known| known == name) else {
                    return wrong(&["release", "held"], words::not_one_of(name, &names));
                };
                if !clamped {
                    return wrong(&["release", "held"], "needs mount = \"clamped\"".into());
                }
                let (position, z) = (positions[at], 0.1 * z);
                // Beyond, the sheet hangs almost straight down, or would have to be stretched.
                if z.is_nan() || z.abs() >= 0.9 * position {
                    let reason = format!("is {}, but must be within {} mm", number(10.0 * z), number(9.0 * position));
                    return wrong(&["release", "held_z_mm"], reason);
                }
                Ok(Start::Held { position, z })
            }
            _ => wrong(&["release"], format!("has no shape, or more than one: it needs one of {SHAPES}")),
        }
    }
}

/// Keeps the rows from `ends[0]` to `ends[1]` (s); returns the number of others.
fn keep(rows: &mut Rows, actuators: usize, ends: [f64; 2]) -> usize {
    let first = rows.times.partition_point(|t| *t < ends[0] - SAME_TIME);
    let last = rows.times.partition_point(|t| *t <= ends[1] + SAME_TIME).max(first);
    let count = rows.times.len();
    rows.times = rows.times[first..last].to_vec();
    if !rows.voltages.is_empty() {
        rows.voltages = rows.voltages[first * actuators..last * actuators].to_vec();
    }
    for channel in rows.channels.iter_mut().filter(|channel| !channel.is_empty()) {
        *channel = channel[first..last].to_vec();
    }
    count - (last - first)
}

/// Voltages (V) at rising times `at` (s) within those of the log.
fn interpolated(times: &[f64], voltages: &[f64], at: &[f64], actuators: usize) -> Vec<f64> {
    let mut out = Vec::with_capacity(at.len() * actuators);
    for t in at {
        let next = times.partition_point(|time| time <= t).clamp(1, times.len() - 1);
        let [t0, t1] = [times[next - 1], times[next]];
        let share = ((t - t0) / (t1 - t0)).clamp(0.0, 1.0);
        out.extend((0..actuators).map(|a| {
            let [v0, v1] = [next - 1, next].map(|row| voltages[row * actuators + a]);
            v0 + share * (v1 - v0)
        }));
    }
    out
}

/// The run, if it is short enough to be simulated and its voltages, of the file `command_path`, are known between rows.
fn checked(mut run: MeasuredRun, entry: &RunEntry, command_path: &Path) -> Result<MeasuredRun, DataError> {
    let robot = &run.robot;
    let duration = run.times[run.times.len() - 1] - run.origin;
    let steps = duration / robot::step(robot, &run.times);
    if steps > MOST_STEPS {
        let reason = format!(
            "{duration} s in steps that suit the robot and the rows are {steps:.1e} steps, more than {MOST_STEPS:.0e}; is t_s in seconds?"
        );
        return Err(bad(&run.path, entry, reason));
    }
    let (times, voltages) = run.command();
    if let Some(reason) = voltage::too_coarse(times, voltages, robot.actuators) {
        return Err(bad(command_path, entry, reason));
    }
    let rate = (times.len() - 1) as f64 / (times[times.len() - 1] - times[0]);
    let is_driven = entry.rate_v_per_s.is_none() && (run.start == Start::Settled || voltages.iter().any(|v| *v != voltages[0]));
    let first = analytic::cantilever_frequency(robot) / (robot.actuators as f64).powi(2);
    if is_driven && robot.mount == Mount::Clamped && rate < 2.0 * first {
        run.remarks.push(format!(
            "{rate:.1} rows per second show a drive of more than {:.1} Hz as a slower one, and the robot's first mode is at {first:.1} Hz; if it was \
             driven that fast, record the voltage ten times per period",
            0.5 * rate
        ));
    }
    Ok(run)
}
