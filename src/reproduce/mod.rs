//! The paper's results beside this program's: one id each, a table and a figure each, one page for all.
//!
//! The runs are those of the planar engine; in every study some of them are repeated on Bullet.

mod cantilever;
mod jumping;
mod page;
mod walking;

pub use page::{page, table};

use std::cell::RefCell;
use std::collections::HashMap;
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};

use serde::Serialize;
use thiserror::Error;

use crate::engine::EngineError;
use crate::experiment::{self, ConfigError, Control, Experiment, Run, Source, presets};
use crate::sweep::{self, Row as Point, RowError, Rows, Sweep};
use crate::view::{Figure, Mark, fixed, signed};

/// Colour of lines that stand for published values.
const PUBLISHED: &str = "#777777";

/// How carefully a study is done.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Effort {
    /// Every result to 1 %.
    Quick,
    /// To 0.1 %.
    Full,
}

impl Effort {
    /// What a tighter tolerance of the adaptive steps may change of a result, as a share of it.
    pub const fn step_error(self) -> f64 {
        match self {
            Self::Quick => 1e-2,
            Self::Full => 1e-3,
        }
    }
}

/// A study that cannot be finished.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum StudyError {
    /// A built-in experiment is wrong, which is a fault of this program.
    #[error("{0}; please report this")]
    Config(#[from] ConfigError),
    /// A simulation failed.
    #[error("{0}")]
    Engine(#[from] EngineError),
    /// A run went wrong in a way that makes its numbers worthless.
    #[error("{0}")]
    Trouble(String),
    /// Results could not be kept.
    #[error("{0}")]
    Rows(#[from] RowError),
    /// The user stopped it.
    #[error("interrupted")]
    Interrupted,
}

/// One published result beside ours.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize)]
pub struct Comparison {
    /// What is compared.
    pub quantity: String,
    /// As published, and how it was had; empty for what was not published.
    pub published: String,
    /// As simulated here, on the planar engine.
    pub ours: String,
    /// What that differs from the published value by.
    pub difference: String,
    /// The same on Bullet, and what the planar engine differs from it by: a spot check, empty where none was made.
    pub bullet: String,
    /// What explains the difference, or what is not specified.
    pub explanation: String,
}

/// How a published value was had.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Origin {
    /// In an experiment.
    Measured,
    /// By the authors' simulation.
    Simulated,
}

/// A published value as it stands in a study's figure, in the units of its axes.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Published {
    /// Its name in the legend.
    pub label: String,
    /// How it was had.
    pub origin: Origin,
    /// Where it stands along x; absent for a value of y alone, drawn as a line across.
    pub x: Option<f64>,
    /// Where it stands along y; absent for a value of x alone, drawn as a line up.
    pub y: Option<f64>,
    /// ± of y, where the source gives it.
    pub plus_minus: Option<f64>,
}

/// What a study found.
#[derive(Debug, Clone, Default)]
pub struct Findings {
    /// The table.
    pub comparisons: Vec<Comparison>,
    /// Published values that the figure shows.
    pub published: Vec<Published>,
    /// Which engine did what, by which time steps.
    pub engines: String,
    /// The figure, as SVG.
    pub figure: String,
    /// What the figure shows, in a sentence or two.
    pub caption: String,
}

impl Findings {
    fn compare(
        &mut self,
        quantity: &str,
        published: &str,
        ours: impl Into<String>,
        difference: impl Into<String>,
        explanation: &str,
    ) {
        self.comparisons.push(Comparison {
            quantity: quantity.into(),
            published: published.into(),
            ours: ours.into(),
            difference: difference.into(),
            bullet: String::new(),
            explanation: explanation.into(),
        });
    }

    /// A spot check of the last comparison: its number on the planar engine and on Bullet.
    fn check_on_bullet(&mut self, unit: &str, planar: f64, bullet: f64) {
        let Some(last) = self.comparisons.last_mut() else { return };
        let (digits, unit) = match unit {
            "" | "°" => (0, unit.to_owned()),
            _ => (2, format!(" {unit}")),
        };
        last.bullet = match (bullet.is_finite(), planar.is_finite()) {
            (true, true) => format!("{}{unit} (planar {})", fixed(bullet, digits), signed(planar - bullet, digits)),
            (true, false) => format!("{}{unit}", fixed(bullet, digits)),
            (false, _) => "none: its contact makes energy, or it limits a velocity".into(),
        };
    }

    /// Says which frequencies of a scan gave no result, and why.
    fn without_result(&mut self, points: &[(f64, f64)]) {
        let lost: Vec<String> = points.iter().filter(|p| !p.1.is_finite()).map(|p| format!("{}", p.0)).collect();
        if !lost.is_empty() {
            self.compare("frequencies without a result", "", format!("{} Hz", lost.join(", ")), "", "The rows on disk say why.");
        }
    }

    /// Draws published points, with their ±.
    fn publish(&mut self, figure: &mut Figure, label: &str, origin: Origin, points: &[(f64, f64)], plus_minus: Option<f64>) {
        figure.series(label, points.iter().copied(), Mark::Points);
        for &(x, y) in points {
            if let Some(spread) = plus_minus {
                figure.line("", [(x, y - spread), (x, y + spread)], PUBLISHED, 1.0);
            }
            self.published.push(Published { label: label.into(), origin, x: Some(x), y: Some(y), plus_minus });
        }
    }

    /// Draws published values of y as lines across from one x to another.
    fn publish_across(&mut self, figure: &mut Figure, label: &str, origin: Origin, values: &[f64], [from, to]: [f64; 2]) {
        for (index, &y) in values.iter().enumerate() {
            figure.line(if index == 0 { label } else { "" }, [(from, y), (to, y)], PUBLISHED, 1.0);
            self.published.push(Published { label: label.into(), origin, x: None, y: Some(y), plus_minus: None });
        }
    }

    /// Draws a published value of x as a line up from one y to another.
    fn publish_up(&mut self, figure: &mut Figure, label: &str, origin: Origin, x: f64, [from, to]: [f64; 2]) {
        figure.line("", [(x, from), (x, to)], PUBLISHED, 1.0).note(x, to, label);
        self.published.push(Published { label: label.into(), origin, x: Some(x), y: None, plus_minus: None });
    }

    /// Says which engines did the runs: ours with steps that adapt, and Bullet with a time step (s).
    fn done_on(&mut self, effort: Effort, bullet: f64) {
        let micros = 1e6 * bullet;
        let digits = if (micros - micros.round()).abs() < 1e-6 { 0 } else { 2 };
        self.engines = format!(
            "Ours: planar engine, steps that adapt to {} % of the result. Spot checks: Bullet, time step {} µs.",
            100.0 * effort.step_error(),
            fixed(micros, digits)
        );
    }
}

/// One result of the paper.
#[derive(Clone, Copy)]
pub struct Study {
    /// Name on the command line.
    pub id: &'static str,
    /// What it is.
    pub title: &'static str,
    /// Where it stands in the paper.
    pub section: &'static str,
    /// Processor time (s) of the quick study and of the full one, as measured; most of it is Bullet's.
    pub cost_s: [f64; 2],
    run: fn(&Bench) -> Result<Findings, StudyError>,
}

impl Study {
    /// Does the study.
    ///
    /// # Errors
    /// [`StudyError`].
    pub fn run(&self, bench: &Bench) -> Result<Findings, StudyError> {
        (self.run)(bench)
    }
}

/// All of them, in the paper's order.
pub const STUDIES: [Study; 10] = [
    Study {
        id: "cantilever-shapes",
        title: "Static shapes of the cantilever",
        section: "III-A",
        cost_s: [1.0, 1.0],
        run: cantilever::shapes,
    },
    Study {
        id: "cantilever-response",
        title: "Frequency response of the cantilever",
        section: "III-A",
        cost_s: [8.0, 11.0],
        run: cantilever::response,
    },
    Study {
        id: "cantilever-damping",
        title: "Damping from the step response",
        section: "III-A",
        cost_s: [1.0, 1.0],
        run: cantilever::damping,
    },
    Study {
        id: "robot-shapes",
        title: "Static shapes of the five-actuator robot",
        section: "III-B",
        cost_s: [4.0, 4.0],
        run: walking::shapes,
    },
    Study {
        id: "inchworm",
        title: "Inchworm motion over five cycles",
        section: "III-B",
        cost_s: [27.0, 27.0],
        run: walking::inchworm,
    },
    Study { id: "jump-14hz", title: "In-place jumping at 14 Hz", section: "III-C", cost_s: [3.0, 3.0], run: jumping::at_14_hz },
    Study {
        id: "key-shapes-14hz",
        title: "The three key shapes at 14 Hz",
        section: "III-C",
        cost_s: [3.0, 3.0],
        run: jumping::key_shapes,
    },
    Study {
        id: "jump-frequency",
        title: "Jump height against frequency",
        section: "III-C",
        cost_s: [9.0, 10.0],
        run: jumping::over_frequency,
    },
    Study {
        id: "jump-on-time",
        title: "Jump height against on-time",
        section: "authors' notebook",
        cost_s: [15.0, 15.0],
        run: jumping::over_on_time,
    },
    Study { id: "speed", title: "Speed against frequency", section: "IV", cost_s: [54.0, 58.0], run: walking::speed },
];

/// Where studies are done: threads, folder, effort.
pub struct Bench<'a> {
    /// How carefully.
    pub effort: Effort,
    /// Threads.
    pub jobs: usize,
    /// Where sweeps keep their rows, so that an interrupted study goes on where it stopped.
    pub folder: &'a Path,
    /// Set to stop.
    pub stop: &'a AtomicBool,
    /// Runs by preset and settings: an experiment that several studies speak of is done once.
    done: RefCell<HashMap<String, (Experiment, Run)>>,
}

impl<'a> Bench<'a> {
    /// A bench on which nothing has been done.
    pub fn new(effort: Effort, jobs: usize, folder: &'a Path, stop: &'a AtomicBool) -> Self {
        Self { effort, jobs, folder, stop, done: RefCell::default() }
    }

    /// Runs a preset with settings on the planar engine: the measure, or the path of all nodes, to what the effort allows.
    fn run(&self, preset: &str, measure: Option<&str>, settings: &[&str]) -> Result<(Experiment, Run), StudyError> {
        let error = format!("simulation.step_error={:e}", self.effort.step_error());
        let measure = measure.map(|name| format!("simulation.step_measure={name}"));
        let adaptive = ["simulation.engine=planar", "simulation.time_step_s=auto", &error];
        self.run_as(preset, &[settings, &adaptive, measure.as_deref().as_slice()].concat())
    }

    /// The same on Bullet at the preset's time step.
    fn run_on_bullet(&self, preset: &str, settings: &[&str]) -> Result<(Experiment, Run), StudyError> {
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

    /// Runs a built-in sweep with settings of its experiment, and returns its points in the grid's order.
    fn sweep(&self, id: &str, preset: &str, settings: &[&str]) -> Result<(Sweep, Vec<Point>), StudyError> {
        let settings: Vec<String> = settings.iter().map(|setting| (*setting).to_owned()).collect();
        self.points(id, Sweep::open(Path::new(&format!("preset:{preset}")), &settings)?)
    }

    /// The same of a sweep that was changed.
    fn points(&self, id: &str, mut sweep: Sweep) -> Result<(Sweep, Vec<Point>), StudyError> {
        fix(&mut sweep, STEP_ERROR, self.effort.step_error());
        self.compute(id, sweep)
    }

    /// Some points of a planar sweep on Bullet, by `step` (s): the first measure against those `values` of the last axis.
    fn spots(&self, id: &str, sweep: &Sweep, step: f64, values: &[f64]) -> Result<Vec<(f64, f64)>, StudyError> {
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
        let outcome = sweep::run(&sweep, &folder, (1, 1), self.jobs, self.stop, |_, _| {}, |_| {})?;
        if outcome.interrupted {
            return Err(StudyError::Interrupted);
        }
        sweep::merge(&folder, &sweep)?;
        let points = Rows::open(&folder, &sweep, 1, 1)?.done().values().cloned().collect();
        Ok((sweep, points))
    }
}

const TIME_STEP: &str = "simulation.time_step_s";
const STEP_ERROR: &str = "simulation.step_error";
const STEP_MEASURE: &str = "simulation.step_measure";

/// Gives an axis of a sweep one value.
fn fix(sweep: &mut Sweep, key: &str, value: f64) {
    for axis in sweep.axes.iter_mut().filter(|axis| axis.key == key) {
        axis.values = vec![value.into()];
    }
}

/// The first measure of each point against the value of one axis.
fn curve(sweep: &Sweep, points: &[Point], axis: usize, measure: usize) -> Vec<(f64, f64)> {
    let value = |point: &Point| {
        let value = sweep.point(point.index)[axis];
        value.as_float().or_else(|| value.as_integer().map(|i| i as f64)).unwrap_or(f64::NAN)
    };
    points.iter().map(|point| (value(point), point.measures[measure].unwrap_or(f64::NAN))).collect()
}
