//! The runs and sweeps of studies.

use std::cell::RefCell;
use std::collections::HashMap;
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};

use super::{Effort, StudyError};
use crate::experiment::{self, Control, Experiment, Run, Source, presets};
use crate::sweep::{self, Row as Point, Shard, Sweep};

/// Settings and cached runs of studies.
pub struct Bench<'a> {
    /// Accuracy of the results.
    pub effort: Effort,
    /// Number of threads.
    pub jobs: usize,
    /// Folder of the sweeps' rows, from which an interrupted study resumes.
    pub folder: &'a Path,
    /// Stops the study when true.
    pub stop: &'a AtomicBool,
    /// Runs by preset and settings, which several studies share.
    done: RefCell<HashMap<String, (Experiment, Run)>>,
}

impl<'a> Bench<'a> {
    /// A bench without runs.
    pub fn new(effort: Effort, jobs: usize, folder: &'a Path, stop: &'a AtomicBool) -> Self {
        Self { effort, jobs, folder, stop, done: RefCell::default() }
    }

    /// Runs a preset with settings on the planar engine, with steps that adapt to the `measure` or to the path of all nodes.
    pub(super) fn run(&self, preset: &str, measure: Option<&str>, settings: &[&str]) -> Result<(Experiment, Run), StudyError> {
        let error = format!("simulation.step_error={:e}", self.effort.step_error());
        let measure = measure.map(|name| format!("simulation.step_measure={name}"));
        let adaptive = ["simulation.engine=planar", "simulation.time_step_s=auto", &error];
        self.run_as(preset, &[settings, &adaptive, measure.as_deref().as_slice()].concat())
    }

    /// Runs a preset with settings on Bullet at the preset's time step.
    pub(super) fn run_on_bullet(&self, preset: &str, settings: &[&str]) -> Result<(Experiment, Run), StudyError> {
        self.run_as(preset, &[settings, &["simulation.engine=bullet"]].concat())
    }

    fn run_as(&self, preset: &str, settings: &[&str]) -> Result<(Experiment, Run), StudyError> {
        let name = format!("{preset} {}", settings.join(" "));
        if let Some(done) = self.done.borrow().get(&name) {
            return Ok(done.clone());
        }
        let text = presets::find(preset).map_or("", |preset| preset.text);
        let mut source = Source::from_text(preset, text);
        for setting in settings {
            source.set(setting)?;
        }
        let experiment = experiment::experiment(&source)?;
        let observe = |_| if self.stop.load(Ordering::Relaxed) { Control::Stop } else { Control::Continue };
        let run = experiment::run(&experiment, experiment.engine()?.as_mut(), observe)?;
        if run.interrupted {
            return Err(StudyError::Interrupted);
        }
        match run.trouble(&experiment).pop() {
            Some(trouble) => Err(StudyError::Trouble(trouble)),
            None => {
                self.done.borrow_mut().insert(name, (experiment.clone(), run.clone()));
                Ok((experiment, run))
            }
        }
    }

    /// Runs a built-in sweep with settings of its experiment; the points are in the grid's order.
    pub(super) fn sweep(&self, id: &str, preset: &str, settings: &[&str]) -> Result<(Sweep, Vec<Point>), StudyError> {
        let settings: Vec<String> = settings.iter().map(|setting| (*setting).to_owned()).collect();
        self.points(id, Sweep::open(Path::new(&format!("preset:{preset}")), &settings)?)
    }

    /// Runs a sweep to the accuracy of the effort; the points are in the grid's order.
    pub(super) fn points(&self, id: &str, mut sweep: Sweep) -> Result<(Sweep, Vec<Point>), StudyError> {
        fix(&mut sweep, STEP_ERROR, self.effort.step_error());
        self.compute(id, sweep)
    }

    /// The first measure of a planar sweep on Bullet with time step `step` (s), at these `values` of the last axis.
    pub(super) fn spots(&self, id: &str, sweep: &Sweep, step: f64, values: &[f64]) -> Result<Vec<(f64, f64)>, StudyError> {
        let mut sweep = sweep.clone();
        sweep.source.set("simulation.engine=bullet")?;
        sweep.axes.retain(|axis| ![STEP_ERROR, STEP_MEASURE].contains(&axis.key.as_str()));
        fix(&mut sweep, TIME_STEP, step);
        if let Some(axis) = sweep.axes.last_mut() {
            axis.values = values.iter().map(|value| (*value).into()).collect();
        }
        let last = sweep.axes.len() - 1;
        let (sweep, points) = self.compute(&format!("{id}-bullet"), sweep)?;
        Ok(curve(&sweep, &points, last, 0))
    }

    fn compute(&self, id: &str, sweep: Sweep) -> Result<(Sweep, Vec<Point>), StudyError> {
        let folder = self.folder.join(id);
        let outcome = sweep::run(&sweep, &folder, Shard::ALL, self.jobs, self.stop, |_, _| {}, |_| {})?;
        if outcome.interrupted {
            return Err(StudyError::Interrupted);
        }
        sweep::merge(&folder, &sweep, |_| {})?;
        let points = sweep::rows(&folder, &sweep)?;
        Ok((sweep, points))
    }
}

const TIME_STEP: &str = "simulation.time_step_s";
const STEP_ERROR: &str = "simulation.step_error";
const STEP_MEASURE: &str = "simulation.step_measure";

/// Reduces an axis of a sweep to one value.
fn fix(sweep: &mut Sweep, key: &str, value: f64) {
    for axis in sweep.axes.iter_mut().filter(|axis| axis.key == key) {
        axis.values = vec![value.into()];
    }
}

/// Pairs of an axis's value and a measure, NaN where there is none.
pub(super) fn curve(sweep: &Sweep, points: &[Point], axis: usize, measure: usize) -> Vec<(f64, f64)> {
    let value = |point: &Point| {
        let value = sweep.point(point.index)[axis];
        value.as_float().or_else(|| value.as_integer().map(|i| i as f64)).unwrap_or(f64::NAN)
    };
    points.iter().map(|point| (value(point), point.measures[measure].unwrap_or(f64::NAN))).collect()
}
