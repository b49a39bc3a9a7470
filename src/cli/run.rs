//! `sfers run`: simulate one experiment, or its ensemble, and print its measures.

mod ensemble;

use std::io::IsTerminal;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

use indicatif::{ProgressBar, ProgressStyle};
use serde_json::json;

use super::output::{Output, finish, manifest, pending, unwritable};
use super::{Failure, INTERRUPTED, Options, print, say};
use crate::date::now;
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
    /// The engine: bullet (bit for bit the reference) or planar (the fast one). Short for --set simulation.engine=NAME.
    #[arg(long, value_name = "NAME")]
    engine: Option<String>,
    /// Take the bodies from a URDF: a chain of boxes with hinges about +y. `-` is standard input.
    #[arg(long, value_name = "FILE.urdf")]
    robot: Option<PathBuf>,
    /// Save the recording: FILE.npz (the reference's keys, CGS; nodes_velocity holds the nodes' own velocities, which dataPositionVelocities
    /// does not on Bullet) or FILE.csv (units in the header, the nodes' own velocities); `-` is CSV on standard output.
    /// Of an experiment with [ensemble]: FILE.csv, with a row of measures for each member.
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Save the final state, from which another run can continue.
    #[arg(long, value_name = "FILE")]
    save_state: Option<PathBuf>,
    /// Continue from a saved state of the same robot; the steps of the experiment count from its beginning.
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

/// The experiment of the arguments, with the engine of `--engine` and the bodies of `--robot`.
fn experiment_of(args: &Args) -> Result<(Source, Experiment), Failure> {
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
    let Some(path) = &args.robot else {
        let experiment = experiment::experiment(&source)?;
        return Ok((source, experiment));
    };
    if path == Path::new("-") && args.experiment == path.as_path() {
        return Err(Failure::Usage("the experiment and the robot cannot both be standard input".into()));
    }
    let bad = |reason: String| Failure::Data(format!("{}: {reason}", path.display()));
    let text = read(path).map_err(|error| bad(error.to_string()))?;
    let bodies = export::bodies(&text, &experiment::experiment(&source)?.robot).map_err(|error| bad(error.to_string()))?;
    let experiment = experiment::with_bodies(&source, &bodies)?;
    Ok((source, experiment))
}

pub fn run(args: &Args, options: Options) -> Result<ExitCode, Failure> {
    let (source, experiment) = experiment_of(args)?;
    if experiment.config.ensemble.is_some() {
        return ensemble::run(args, &source, options);
    }
    let output = args.out.as_deref().map(Output::open).transpose()?;
    let state_file = args.save_state.as_deref().map(pending).transpose()?;
    let mut engine = experiment.engine()?;
    if let Some(path) = &args.load_state {
        load_state(path, &experiment, engine.as_mut())?;
    }
    // A warning before the run, which may be long; the run repeats it and gives no measures.
    if let Some(stable) = experiment::unstable(&experiment, 0.0) {
        options.remark(&format!("warning: {}", experiment::step_too_long(experiment.time_step, stable)));
    }
    let first_step = engine.step();
    let (mut run, wall) = simulate(&experiment, engine.as_mut(), options)?;
    let warnings = warn(&experiment, &mut run, output.is_some(), options);
    if let Some(ground) = &mut run.recording.meta.ground {
        ground.date_time = now().of_the_reference();
    }
    let saved = output.as_ref().and_then(Output::path).map(Path::to_owned);
    let text = describe(&experiment, &run, first_step, wall, &warnings, saved.as_deref(), options);
    // Measures before files, so that a full disk does not lose them; a closed pipe does not lose the files.
    let printed = if output.as_ref().is_some_and(Output::is_stdout) {
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
        output.write(&run.recording, &manifest(&experiment, run.step_choice.as_ref(), wall, run.interrupted))?;
    }
    if let Some(path) = saved {
        options.remark(&format!("saved to {}", path.display()));
    }
    printed?;
    Ok(if run.interrupted { ExitCode::from(INTERRUPTED) } else { ExitCode::SUCCESS })
}

/// Runs the experiment with a progress bar until its end or Ctrl-C; returns the run and its wall time (s).
fn simulate(experiment: &Experiment, engine: &mut dyn Engine, options: Options) -> Result<(Run, f64), Failure> {
    // Fails for a second handler in the same process; Ctrl-C then ends the process.
    let _ = ctrlc::set_handler(|| INTERRUPT.store(true, Ordering::Relaxed));
    let bar = progress(experiment, options);
    let start = Instant::now();
    let mut remaining = Remaining::new(experiment, engine.step());
    let result = experiment::run(experiment, engine, |done| {
        bar.set_position(done);
        if let Some(text) = remaining.after(done, start.elapsed().as_secs_f64()) {
            bar.suspend(|| options.remark(&text));
        }
        if INTERRUPT.load(Ordering::Relaxed) { Control::Stop } else { Control::Continue }
    });
    let wall = start.elapsed().as_secs_f64();
    bar.finish_and_clear();
    Ok((result?, wall))
}

/// Reports what is wrong with a run on stderr and returns it; removes the measures of a run that went wrong.
fn warn(experiment: &Experiment, run: &mut Run, has_output: bool, options: Options) -> Vec<String> {
    if let Some(choice) = &run.step_choice {
        options.remark(&format!(
            "steps of {:.1e} to {:.1e} s, local error {:.0e} cm: the {} changes by {:.1e} (allowed {:.0e}) from a ten times larger one",
            choice.shortest_step_s, choice.longest_step_s, choice.tolerance_cm, choice.measure, choice.change, choice.asked
        ));
    }
    let mut warnings = Vec::new();
    let trouble = run.trouble(experiment);
    for problem in &trouble {
        // Also with --quiet: the result is not the one wanted.
        say(&format!("warning: {problem}; no measures are given"));
    }
    let remarks = run.warnings(experiment);
    remarks.iter().for_each(|warning| say(&format!("warning: {warning}")));
    if run.interrupted {
        let kept = if has_output { "kept" } else { "not saved, because there is no --out" };
        let steps = run.recording.meta.steps;
        let message = format!("interrupted after {steps} of {} steps; what was recorded until then is {kept}", experiment.steps);
        say(&message);
        warnings.push(message);
    }
    if !trouble.is_empty() {
        run.measures = Measures { energy_error: run.measures.energy_error, ..Measures::default() };
    }
    warnings.extend(trouble.into_iter().chain(remarks));
    warnings
}

/// The measures as text, or the JSON object of `--json`.
fn describe(
    experiment: &Experiment,
    run: &Run,
    first_step: u64,
    wall: f64,
    warnings: &[String],
    saved: Option<&Path>,
    options: Options,
) -> String {
    let (steps, records) = (run.recording.meta.steps, run.recording.len());
    let steps_per_s = (steps - first_step) as f64 / wall.max(1e-9);
    if options.json {
        let object = json!({
            "schema": 1,
            "measures": run.measures,
            "energy": run.audited.then_some(run.energy),
            "time_step_s": experiment.time_step,
            "step_choice": run.step_choice,
            "steps": steps,
            "records": records,
            "simulated_s": steps as f64 * experiment.time_step,
            "interrupted": run.interrupted,
            "warnings": warnings,
            "out": saved,
            "wall_s": wall,
            "steps_per_s": steps_per_s,
        });
        return format!("{object}\n");
    }
    options.remark(&format!(
        "{steps} steps of {:e} s in {wall:.2} s ({steps_per_s:.0} steps/s), {records} records",
        experiment.time_step
    ));
    run.measures.named().into_iter().map(|(name, value)| format!("{name} = {}\n", six_digits(value))).collect()
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

/// Wall time of the first message about the remaining time (s), and the least remaining time for one (s).
const TOLD_AFTER: f64 = 3.0;
const WORTH_TELLING: f64 = 60.0;

/// Estimates the remaining time of a long run: once if stderr is a terminal with a bar, otherwise each time the wall time has doubled.
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

    /// The message due after `done` steps and `elapsed` wall time (s).
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

/// A value with six digits after the point; zero has no minus sign.
fn six_digits(value: f64) -> String {
    let text = format!("{value:.6}");
    if text == "-0.000000" { "0.000000".into() } else { text }
}

/// A progress bar on stderr; indicatif hides it if stderr is no terminal.
fn progress(experiment: &Experiment, options: Options) -> ProgressBar {
    if options.quiet {
        return ProgressBar::hidden();
    }
    let style = ProgressStyle::with_template("{bar:40} {percent:>3} %  {per_sec}  {eta} left");
    ProgressBar::new(experiment.steps).with_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()))
}
