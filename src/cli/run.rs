//! `sfers run`: simulate one experiment and print its measures.

use std::io::IsTerminal;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

use indicatif::{ProgressBar, ProgressStyle};
use serde_json::json;

use super::output::{Output, finish, manifest, now, pending, unwritable};
use super::{Failure, INTERRUPTED, Options, print, say};
use crate::engine::Engine;
use crate::experiment::{self, Control, Experiment, Run, SavedState, Setting, Source};
use crate::export;
use crate::files;
use crate::recording::measures::Measures;

/// Simulate an experiment and print its measures.
///
/// Example: sfers preset jump-14hz | sfers run - --set drive.frequency_hz=12 --out jump.npz
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The experiment file, `-` for standard input, or preset:NAME (or NAME where there is no such file) for a built-in one.
    experiment: PathBuf,
    /// Override a key, for example robot.damping_eta=0.03. May be repeated.
    #[arg(long = "set", value_name = "KEY=VALUE")]
    settings: Vec<String>,
    /// What steps the robot: bullet (bit for bit the reference) or planar (the fast one). Short for --set simulation.engine=NAME.
    #[arg(long, value_name = "NAME")]
    engine: Option<String>,
    /// Take the bodies from a URDF: a chain of boxes with hinges about +y. `-` is standard input.
    #[arg(long, value_name = "FILE.urdf")]
    robot: Option<PathBuf>,
    /// Save the recording: FILE.npz (the reference's keys, CGS; nodes_velocity holds the nodes' own velocities, which dataPositionVelocities
    /// does not on Bullet) or FILE.csv (units in the header, the nodes' own velocities); `-` is CSV on standard output.
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Save the state at the end, for another run to go on from.
    #[arg(long, value_name = "FILE")]
    save_state: Option<PathBuf>,
    /// Go on from a saved state of the same robot: the experiment's steps count from its beginning.
    #[arg(long, value_name = "FILE")]
    load_state: Option<PathBuf>,
}

static INTERRUPT: AtomicBool = AtomicBool::new(false);

/// Reads a file, or standard input for `-`.
fn read(path: &Path) -> std::io::Result<String> {
    if path == Path::new("-") { files::read_stdin() } else { files::read_text(path) }
}

/// Reads an experiment from a file, standard input or the built-in ones, with settings.
pub fn source(path: &Path, settings: &[String]) -> Result<Source, Failure> {
    let mut source = if path == Path::new("-") {
        let text = files::read_stdin().map_err(|error| Failure::Usage(format!("standard input: {error}")))?;
        Source::from_text("standard input", text)
    } else {
        Source::open(path)?
    };
    for setting in settings {
        source.set(setting)?;
    }
    Ok(source)
}

pub fn run(args: &Args, options: Options) -> Result<ExitCode, Failure> {
    let mut source = source(&args.experiment, &args.settings)?;
    if let Some(engine) = &args.engine {
        let key = "simulation.engine";
        let set = source.settings().iter().rev().find(|setting| setting.key == key);
        if let Some(other) = set.filter(|setting| setting.toml().as_str() != Some(engine)) {
            return Err(Failure::Usage(format!(
                "--engine {engine} and {} contradict each other; give one of the two",
                other.place
            )));
        }
        source.push(Setting { key: key.into(), value: engine.clone(), place: format!("--engine {engine}") });
    }
    let experiment = match &args.robot {
        None => experiment::experiment(&source)?,
        Some(path) => {
            if path == Path::new("-") && args.experiment == path.as_path() {
                return Err(Failure::Usage("the experiment and the robot cannot both be standard input".into()));
            }
            let bad = |reason: String| Failure::Data(format!("{}: {reason}", path.display()));
            let text = read(path).map_err(|error| bad(error.to_string()))?;
            let bodies =
                export::bodies(&text, &experiment::experiment(&source)?.robot).map_err(|error| bad(error.to_string()))?;
            experiment::with_bodies(&source, &bodies)?
        }
    };
    let output = args.out.as_deref().map(Output::open).transpose()?;
    let state_file = args.save_state.as_deref().map(pending).transpose()?;
    let mut engine = experiment.engine()?;
    if let Some(path) = &args.load_state {
        load_state(path, &experiment, engine.as_mut())?;
    }

    let mut warnings = Vec::new();
    // Said before the run, which may take long; the run itself says it again, with its measures left out.
    if let Some(stable) = experiment::unstable(&experiment, 0.0) {
        options.remark(&format!("warning: {}", experiment::step_too_long(experiment.time_step, stable)));
    }
    // The first Ctrl-C ends the run in good order; without a handler (a second one in this process) it ends at once.
    let _ = ctrlc::set_handler(|| INTERRUPT.store(true, Ordering::Relaxed));

    let first_step = engine.step();
    let bar = progress(&experiment, options);
    let start = Instant::now();
    let mut remaining = Remaining::new(&experiment, first_step);
    let result = experiment::run(&experiment, engine.as_mut(), |done| {
        bar.set_position(done);
        if let Some(text) = remaining.after(done, start.elapsed().as_secs_f64()) {
            bar.suspend(|| options.remark(&text));
        }
        if INTERRUPT.load(Ordering::Relaxed) { Control::Stop } else { Control::Continue }
    });
    let wall = start.elapsed().as_secs_f64();
    bar.finish_and_clear();
    let run = result?;
    if let Some(choice) = &run.step_choice {
        options.remark(&format!(
            "steps of {:.1e} to {:.1e} s, local error {:.0e} cm: the {} changes by {:.1e} (allowed {:.0e}) from a ten times larger one",
            choice.shortest_step_s, choice.longest_step_s, choice.tolerance_cm, choice.measure, choice.change, choice.asked
        ));
    }
    let trouble = run.trouble(&experiment);
    for problem in &trouble {
        // Even when quiet: the result is not what was asked for.
        say(&format!("warning: {problem}; no measures are given"));
    }
    let remarks = run.warnings(&experiment);
    remarks.iter().for_each(|warning| say(&format!("warning: {warning}")));
    let Run { mut recording, measures, interrupted, energy, audited, step_choice, .. } = run;
    let steps = recording.meta.steps;
    if interrupted {
        let kept = if output.is_some() { "kept" } else { "not saved, for there is no --out" };
        let message = format!("interrupted after {steps} of {} steps; what was recorded until then is {kept}", experiment.steps);
        say(&message);
        warnings.push(message);
    }
    if let Some(ground) = &mut recording.meta.ground {
        ground.date_time = now().of_the_reference();
    }

    let measures =
        if trouble.is_empty() { measures } else { Measures { energy_error: measures.energy_error, ..Measures::default() } };
    warnings.extend(trouble.into_iter().chain(remarks));
    let steps_per_s = (steps - first_step) as f64 / wall.max(1e-9);
    let to_stdout = output.as_ref().is_some_and(Output::is_stdout);
    let saved = output.as_ref().and_then(Output::path).map(Path::to_owned);
    let text = if options.json {
        let object = json!({
            "schema": 1,
            "measures": measures,
            "energy": audited.then_some(energy),
            "time_step_s": experiment.time_step,
            "step_choice": step_choice,
            "steps": steps,
            "records": recording.len(),
            "simulated_s": steps as f64 * experiment.time_step,
            "interrupted": interrupted,
            "warnings": warnings,
            "out": saved,
            "wall_s": wall,
            "steps_per_s": steps_per_s,
        });
        format!("{object}\n")
    } else {
        let measures: String =
            measures.named().into_iter().map(|(name, value)| format!("{name} = {}\n", six_digits(value))).collect();
        options.remark(&format!(
            "{steps} steps of {:e} s in {wall:.2} s ({steps_per_s:.0} steps/s), {} records",
            experiment.time_step,
            recording.len()
        ));
        measures
    };
    // The measures come before the files, so that a full disk does not take them along; and a closed pipe takes no file along.
    let printed = if to_stdout {
        options.remark(text.trim_end());
        Ok(())
    } else {
        print(&text)
    };
    if let Some(file) = state_file {
        let state = SavedState::of(&experiment, engine.as_ref())?;
        let text = serde_json::to_string(&state).map_err(|error| unwritable(file.path(), &error))?;
        finish(file, text.as_bytes())?;
    }
    if let Some(output) = output {
        output.write(&recording, &manifest(&experiment, step_choice.as_ref(), wall, interrupted))?;
    }
    if let Some(path) = saved {
        options.remark(&format!("saved to {}", path.display()));
    }
    printed?;
    Ok(if interrupted { ExitCode::from(INTERRUPTED) } else { ExitCode::SUCCESS })
}

fn load_state(path: &Path, experiment: &Experiment, engine: &mut dyn Engine) -> Result<(), Failure> {
    let bad = |reason: String| Failure::Data(format!("{}: {reason}", path.display()));
    let text = files::read_text(path).map_err(|error| bad(error.to_string()))?;
    let state = SavedState::parse(&text, experiment).map_err(bad)?;
    if state.step >= experiment.steps {
        return Err(bad(format!(
            "is at step {}, and the experiment ends at step {}; set simulation.steps higher",
            state.step, experiment.steps
        )));
    }
    state.load_into(engine).map_err(|error| bad(error.to_string()))
}

/// First time at which the time left is told (s), and how much must be left for it.
const TOLD_AFTER: f64 = 3.0;
const WORTH_TELLING: f64 = 60.0;

/// Tells how long a long run will take: once where stderr is a terminal with a bar, and otherwise again whenever the run has taken twice as long.
struct Remaining {
    joints: usize,
    first: u64,
    steps: u64,
    next: f64,
    repeats: bool,
}

impl Remaining {
    fn new(experiment: &Experiment, first: u64) -> Self {
        let repeats = !std::io::stderr().is_terminal();
        Self { joints: experiment.robot.joints(), first, steps: experiment.steps, next: TOLD_AFTER, repeats }
    }

    /// What there is to say after `done` steps and so many seconds.
    fn after(&mut self, done: u64, elapsed: f64) -> Option<String> {
        if elapsed < self.next || done <= self.first {
            return None;
        }
        self.next = if self.repeats { 2.0 * elapsed } else { f64::INFINITY };
        let rate = (done - self.first) as f64 / elapsed;
        let left = (self.steps - done) as f64 / rate;
        (left > WORTH_TELLING).then(|| {
            format!(
                "{done} of {} steps of {} joints done, {rate:.0} steps/s: about {} left; Ctrl-C ends the run and keeps what is recorded",
                self.steps,
                self.joints,
                spoken(left)
            )
        })
    }
}

/// A time (s) in its largest unit.
fn spoken(seconds: f64) -> String {
    let (value, unit) = match seconds {
        s if s < 120.0 => (s, "s"),
        s if s < 7200.0 => (s / 60.0, "min"),
        s if s < 172_800.0 => (s / 3600.0, "h"),
        s => (s / 86400.0, "days"),
    };
    format!("{value:.0} {unit}")
}

/// A value with six digits behind the point, and no minus sign before zeros.
fn six_digits(value: f64) -> String {
    let text = format!("{value:.6}");
    if text == "-0.000000" { "0.000000".into() } else { text }
}

/// A bar on stderr; indicatif hides it where stderr is no terminal.
fn progress(experiment: &Experiment, options: Options) -> ProgressBar {
    if options.quiet {
        return ProgressBar::hidden();
    }
    let style = ProgressStyle::with_template("{bar:40} {percent:>3} %  {per_sec}  {eta} left");
    ProgressBar::new(experiment.steps).with_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()))
}
