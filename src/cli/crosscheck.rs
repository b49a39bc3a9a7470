//! `sfers crosscheck`: bitwise comparison with the reference.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use rayon::prelude::*;
use serde_json::json;

use super::{Failure, Options, print, say};
use crate::crosscheck::{self, BUILTIN, EngineReport, EngineVerdict, PARTED, Quantity, Report, compare};
use crate::experiment::{self, Control, Experiment, Source};
use crate::recording::{Recording, npz};

/// Compare with the reference: a recording, a live PyBullet, or the authors' own classes.
///
/// Joint angles, rates and torques must have equal bits, node positions agree within 1e-5 cm. Without experiments a built-in set
/// of fourteen is used; without --against, --pybullet or --sfers it is compared with recordings of the authors' code on PyBullet
/// 3.2.7 that are built in. Exit code 0 if all agree, 1 if not.
///
/// With --engines the planar engine is compared with Bullet instead, by their measures; without experiments on a built-in set of ten. Each engine
/// also runs with twice its step, for the step errors of the measures. Tips and resonances must agree within 0.1 %,
/// heights within 1 % and strides within 3 %, beyond both errors. Where an engine gives no measures, or an error is above 10 %, there is no verdict,
/// and the exit code is 1.
///
/// Example: sfers crosscheck jump.toml --pybullet .venv/bin/python
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Experiment files, `-` for standard input, or preset:NAME (or NAME where there is no such file) for built-in ones.
    experiments: Vec<PathBuf>,
    /// Override a key in every experiment given. May be repeated.
    #[arg(long = "set", value_name = "KEY=VALUE", requires = "experiments")]
    settings: Vec<String>,
    /// A recording to compare the one experiment with.
    #[arg(long, value_name = "FILE.npz", requires = "experiments", conflicts_with_all = ["pybullet", "sfers"])]
    against: Option<PathBuf>,
    /// A Python with pybullet 3.2.7 and numpy: builds and steps the same robot there.
    #[arg(long, value_name = "PYTHON")]
    pybullet: Option<PathBuf>,
    /// A checkout of the authors' package, or the folder src in it: runs their classes, with the Python of --pybullet or else python3.
    #[arg(long, value_name = "DIR")]
    sfers: Option<PathBuf>,
    /// Compare this program's two engines, Bullet at the experiment's time step and the planar one at --planar-step.
    #[arg(long, conflicts_with_all = ["against", "pybullet", "sfers"])]
    engines: bool,
    /// Time step of the planar engine (s).
    #[arg(long, value_name = "SECONDS", default_value_t = 2e-6, requires = "engines")]
    planar_step: f64,
}

/// One experiment to compare.
struct Item {
    name: String,
    experiment: Experiment,
    recording: Option<Recording>,
}

/// One comparison made.
struct Outcome {
    name: String,
    against: String,
    report: Report,
}

pub fn run(args: &Args, options: Options) -> Result<ExitCode, Failure> {
    if args.engines {
        return engines(args, options);
    }
    let items = items(args)?;
    let outcomes = items.into_par_iter().map(|item| check(item, args)).collect::<Result<Vec<_>, _>>()?;
    let passes = outcomes.iter().all(|outcome| outcome.report.passes);
    if options.json {
        let comparisons: Vec<_> =
            outcomes.iter().map(|o| json!({"experiment": o.name, "against": o.against, "report": o.report})).collect();
        print(&format!("{}\n", json!({"schema": 1, "passes": passes, "comparisons": comparisons})))?;
    } else {
        let mut text: String = outcomes.iter().map(describe).collect();
        let good = outcomes.iter().filter(|outcome| outcome.report.passes).count();
        let verdict = if passes { "one-to-one" } else { "NOT one-to-one" };
        text += &format!("{good} of {} agree: {verdict}\n", outcomes.len());
        print(&text)?;
    }
    Ok(if passes { ExitCode::SUCCESS } else { ExitCode::from(1) })
}

fn engines(args: &Args, options: Options) -> Result<ExitCode, Failure> {
    if !(args.planar_step.is_finite() && args.planar_step > 0.0) {
        return Err(Failure::Usage(format!("--planar-step {}: a number of seconds above 0 is needed", args.planar_step)));
    }
    let mut sources = Vec::new();
    for path in &args.experiments {
        sources.push(super::run::source(path, &args.settings)?);
    }
    if sources.is_empty() {
        let preset = |name: &&str| experiment::presets::find(name).map(|preset| Source::from_text(preset.name, preset.text));
        sources.extend(crosscheck::ENGINE_SET.iter().filter_map(preset));
    }
    let mut reports = Vec::new();
    for source in sources {
        let mut source = source;
        source.set("simulation.engine=bullet")?;
        let experiment = experiment::experiment(&source)?;
        reports.push((source.name, crosscheck::compare_engines(&experiment, [experiment.time_step, args.planar_step])?));
    }
    let passes = reports.iter().all(|(_, report)| report.passes);
    if options.json {
        let list: Vec<_> = reports.iter().map(|(name, report)| json!({"experiment": name, "report": report})).collect();
        print(&format!("{}\n", json!({"schema": 1, "passes": passes, "comparisons": list})))?;
    } else {
        print(&reports.iter().map(|(name, report)| describe_engines(name, report)).collect::<String>())?;
    }
    Ok(if passes { ExitCode::SUCCESS } else { ExitCode::from(1) })
}

fn describe_engines(name: &str, report: &EngineReport) -> String {
    let verdict = match report.verdict {
        EngineVerdict::Agree => "agree",
        EngineVerdict::Differ => "DIFFER",
        EngineVerdict::None => "no verdict",
    };
    let parting = report.parting.map_or_else(
        || format!("never further apart than {:.4} mm", report.largest_mm),
        |p| {
            format!(
                "{:.1} mm apart first at t = {:.4} s, node {}; at most {:.2} mm",
                10.0 * PARTED,
                p.time_s,
                p.node,
                report.largest_mm
            )
        },
    );
    let [bullet, planar] = report.time_steps_s;
    let mut text = format!(
        "{name}: {verdict}; Bullet at {bullet:.1e} s, planar at {planar:.1e} s, {:.0} times faster; {parting}\n",
        report.wall_s[0] / report.wall_s[1]
    );
    for (engine, warnings) in ["Bullet", "planar"].iter().zip(&report.warnings) {
        warnings.iter().for_each(|warning| text += &format!("  warning, {engine}: {warning}\n"));
    }
    if let Some(reason) = &report.reason {
        text += &format!("  no verdict: {reason}\n");
    }
    if !report.too_small.is_empty() {
        text += &format!("  not judged, below 2 % of the largest travel: {}\n", report.too_small.join(", "));
    }
    for pair in &report.measures {
        let mark = if pair.passes { "" } else { "  <-- TOO FAR" };
        text += &format!(
            "  {:20} {:>12.5} {:>12.5}  {:+.2e}  allowed {:.1e}; errors of the steps {:.1e}, {:.1e}{mark}\n",
            pair.name,
            pair.bullet,
            pair.planar,
            pair.planar - pair.bullet,
            pair.allowed,
            pair.step_errors[0],
            pair.step_errors[1]
        );
    }
    text
}

fn items(args: &Args) -> Result<Vec<Item>, Failure> {
    if args.experiments.is_empty() {
        return BUILTIN
            .iter()
            .map(|builtin| {
                Ok(Item {
                    name: builtin.name.into(),
                    experiment: experiment::experiment(&Source::from_text(builtin.name, builtin.experiment))?,
                    recording: Some(npz::read(builtin.recording, Path::new(builtin.name))?),
                })
            })
            .collect();
    }
    let live = args.pybullet.is_some() || args.sfers.is_some();
    if args.against.is_none() && !live {
        return Err(Failure::Usage("give --against FILE.npz, --pybullet PYTHON or --sfers DIR to compare with".into()));
    }
    if args.against.is_some() && args.experiments.len() > 1 {
        return Err(Failure::Usage("--against takes one experiment".into()));
    }
    let mut items = Vec::new();
    for path in &args.experiments {
        let source = super::run::source(path, &args.settings)?;
        let recording = args.against.as_deref().map(npz::read_file).transpose()?;
        items.push(Item { name: source.name.clone(), experiment: experiment::experiment(&source)?, recording });
    }
    Ok(items)
}

/// Runs both sides and compares.
fn check(item: Item, args: &Args) -> Result<Outcome, Failure> {
    let Item { name, experiment, recording } = item;
    let (theirs, against) = match (&args.sfers, &args.pybullet, recording) {
        (Some(sfers), python, _) => {
            let python = python.as_deref().unwrap_or(Path::new("python3"));
            let (theirs, versions) = crosscheck::run_authors(&experiment, python, sfers)?;
            (theirs, format!("the authors' classes on PyBullet {}", versions.pybullet))
        }
        (None, Some(python), _) => {
            let (theirs, versions) = crosscheck::run_pybullet(&experiment, python)?;
            (theirs, format!("PyBullet {}", versions.pybullet))
        }
        (None, None, Some(recording)) => {
            let source =
                args.against.as_ref().map_or("the recording of PyBullet 3.2.7".into(), |path| path.display().to_string());
            (recording, source)
        }
        (None, None, None) => return Err(Failure::Usage("there is nothing to compare with".into())),
    };
    let run = experiment::run(&experiment, experiment.engine()?.as_mut(), |_| Control::Continue)?;
    // A failed run is compared too.
    run.trouble(&experiment).iter().for_each(|trouble| say(&format!("warning: {name}: {trouble}")));
    Ok(Outcome { name, against, report: compare(&run.recording, &theirs) })
}

fn describe(outcome: &Outcome) -> String {
    let Outcome { name, against, report } = outcome;
    let mut text = format!("{name}, against {against}: {}\n", if report.passes { "agrees" } else { "DIFFERS" });
    for mismatch in &report.mismatch {
        text += &format!("  {mismatch}\n");
    }
    for Quantity { name, unit, values, tolerance, difference, passes } in &report.quantities {
        let finding = difference.as_ref().map_or_else(
            || "equal bits".to_owned(),
            |d| {
                let size = if d.largest.is_nan() {
                    "one side is not a number".to_owned()
                } else {
                    format!("at most by {:.1e} {unit}{}", d.largest, last_place(d.largest_ulp))
                };
                let allowed = if *tolerance == 0.0 { "equal bits".into() } else { format!("{tolerance:.0e} {unit}") };
                let mark = if *passes { "" } else { "  <-- TOO FAR" };
                let place = place(name, d.first_place);
                format!("{} differ, {size}, first at step {}, {place}; allowed: {allowed}{mark}", d.values, d.first_step)
            },
        );
        text += &format!("  {name:16} {values:>8} values  {finding}\n");
    }
    text
}

/// A small difference in units in the last place; empty for large ones.
fn last_place(ulp: Option<u64>) -> String {
    match ulp {
        Some(1) => " (1 unit in the last place)".into(),
        Some(count @ 2..1_000_000) => format!(" ({count} units in the last place)"),
        _ => String::new(),
    }
}

fn place(quantity: &str, index: usize) -> String {
    if quantity.starts_with("node") { format!("node {index}") } else { format!("joint {index}") }
}
