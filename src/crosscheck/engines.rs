//! Comparison of the planar engine with Bullet on the same experiments.

use serde::Serialize;

use crate::engine::{Engine, EngineError};
use crate::experiment::{Control, EngineKind, Experiment, Run, run};
use crate::model::Mount;
use crate::model::units::mm_from_cm;
use crate::recording::Recording;

/// Presets of the built-in set.
pub const ENGINE_SET: [&str; 10] = [
    "cantilever-dc",
    "cantilever-step",
    "cantilever-ac",
    "static-shape",
    "jump-on-time",
    "jump-14hz",
    "inchworm",
    "full-frictional-inchworm",
    "frog-v2",
    "mover-three-phase",
];

/// Number of records of a run.
const RECORDS: u64 = 1000;
/// Distance above which the paths of a node have diverged (cm).
pub const PARTED: f64 = 0.01;
/// Step error, relative to the measure, above which an engine has not converged.
const CONVERGED: f64 = 0.1;
/// Share of the nodes' largest travel below which heights and strides are not judged: the robot stays in place.
const SMALL: f64 = 0.02;
/// Share of the nodes' largest travel by which heights and strides may always differ: resting robots creep on Bullet, depending on the step.
const CREEP: f64 = 0.002;

/// One measure on both engines.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct MeasurePair {
    /// Name with the unit.
    pub name: String,
    /// Value on Bullet.
    pub bullet: f64,
    /// Value on the planar engine.
    pub planar: f64,
    /// Change with twice the step, or half of it if that fails; Bullet first.
    pub step_errors: [f64; 2],
    /// Largest allowed difference.
    pub allowed: f64,
    /// True if the difference is allowed.
    pub passes: bool,
}

/// Verdict of a comparison.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub enum EngineVerdict {
    /// All judged measures agree.
    #[serde(rename = "agree")]
    Agree,
    /// A measure differs.
    #[serde(rename = "differ")]
    Differ,
    /// The measures cannot be judged.
    #[serde(rename = "no verdict")]
    None,
}

/// First time and node with a distance above [`PARTED`].
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Parting {
    /// Time (s).
    pub time_s: f64,
    /// Node, from 0 at the left end.
    pub node: usize,
}

/// An experiment on both engines.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct EngineReport {
    /// Time steps of Bullet and of the planar engine (s).
    pub time_steps_s: [f64; 2],
    /// Wall times of both (s).
    pub wall_s: [f64; 2],
    /// Largest distance of a node between the engines (mm).
    pub largest_mm: f64,
    /// First divergence of the paths, if any.
    pub parting: Option<Parting>,
    /// Judged measures.
    pub measures: Vec<MeasurePair>,
    /// Names of measures that are too small to be judged.
    pub too_small: Vec<String>,
    /// Warnings of Bullet and of the planar engine.
    pub warnings: [Vec<String>; 2],
    /// Verdict.
    pub verdict: EngineVerdict,
    /// Reason for a missing verdict.
    pub reason: Option<String>,
    /// True if all judged measures agree.
    pub passes: bool,
}

/// Tolerance of a measure.
#[derive(Debug, Clone, Copy)]
struct Rule {
    /// Allowed relative difference, in addition to the errors of both steps.
    share: f64,
    /// True if the measure is judged only if it is large enough against the nodes' travel.
    travels: bool,
}

/// Tolerance of a measure; `None` if it is not judged.
///
/// Tips and resonances 0.1 %, heights 1 %; strides and sums of displacements 3 %, because on Bullet they scatter with the step by 2 to 3 %. Periods
/// are equal. The last height of a periodically driven cantilever is not judged: Bullet applies voltages one step late, in which the tip moves by
/// 0.05 mm. Motion on the floor is sensitive to every impact, so paths may diverge while measures agree.
fn rule(name: &str, swings: bool) -> Option<Rule> {
    let (share, travels) = match name {
        "tip_deflection_mm" if swings => return None,
        "tip_deflection_mm" | "tip_amplitude_mm" | "resonance_hz" => (1e-3, false),
        "jump_height_mm" | HIGHEST => (0.01, true),
        "stride_mm" | "displacement_sum_mm" => (0.03, true),
        "period_ratio" => (0.0, false),
        _ => return None,
    };
    Some(Rule { share, travels })
}

/// Runs on one engine: the judged run with its wall time (s), and the measures with another step.
struct Side {
    run: Run,
    wall: f64,
    warnings: Vec<String>,
    other_step: Option<Vec<(String, f64)>>,
}

/// Height of the highest node in the records, a measure of the shape of a robot at rest.
const HIGHEST: &str = "recorded_highest_point_mm";

/// The measures of a run by name.
fn named(run: &Run, rests: bool) -> Vec<(String, f64)> {
    let mut named = run.measures.named();
    if rests {
        let heights = run.recording.positions.chunks_exact(3).map(|node| mm_from_cm(node[2]));
        named.push((HIGHEST.into(), heights.fold(f64::NEG_INFINITY, f64::max)));
    }
    named
}

/// Runs an experiment on Bullet and on the planar engine, with their time `steps` (s) and with twice these for the step errors.
///
/// # Errors
/// [`EngineError`] if a run fails.
pub fn compare_engines(experiment: &Experiment, steps: [f64; 2]) -> Result<EngineReport, EngineError> {
    let duration = experiment.steps as f64 * experiment.time_step;
    let with = |engine: EngineKind, step: f64| {
        // Equal record times on both engines: a whole number of steps between records.
        let every = (duration / RECORDS as f64 / step).round().max(1.0);
        let mut experiment = experiment.clone();
        (experiment.engine, experiment.time_step) = (engine, duration / RECORDS as f64 / every);
        (experiment.steps, experiment.record_every) = (RECORDS * every as u64, every as u64);
        experiment.record_from = experiment.record_every - 1;
        experiment.accuracy = None;
        experiment
    };
    let swings = experiment.drive.period().is_some();
    let rests = !swings && experiment.robot.mount != Mount::Clamped;
    let on = |engine: EngineKind, step: f64| -> Result<Side, EngineError> {
        let experiment = with(engine, step);
        let start = std::time::Instant::now();
        let run = run(&experiment, experiment.engine()?.as_mut(), |_| Control::Continue)?;
        let wall = start.elapsed().as_secs_f64();
        let warnings = run.trouble(&experiment);
        let other = |step: f64| {
            let experiment = with(engine, step);
            let run = experiment.engine().and_then(|mut robot| run_quietly(&experiment, robot.as_mut())).ok()?;
            run.trouble(&experiment).is_empty().then(|| named(&run, rests))
        };
        let h = experiment.time_step;
        // The record interval limits the step.
        let longer = (with(engine, 2.0 * h).time_step > 1.5 * h).then_some(2.0 * h);
        let other_step = if warnings.is_empty() { longer.and_then(other).or_else(|| other(0.5 * h)) } else { None };
        Ok(Side { run, wall, warnings, other_step })
    };
    let (bullet, planar) = (on(EngineKind::Bullet, steps[0])?, on(EngineKind::Planar, steps[1])?);
    let [a, b] = [&bullet.run.recording, &planar.run.recording];
    let (largest, parting) = distance(a, b);
    let travel = mm_from_cm(travel(a).max(travel(b)));
    let mut report = EngineReport {
        time_steps_s: [a.meta.time_step, b.meta.time_step],
        wall_s: [bullet.wall, planar.wall],
        largest_mm: 10.0 * largest,
        parting,
        measures: Vec::new(),
        too_small: Vec::new(),
        warnings: [bullet.warnings.clone(), planar.warnings.clone()],
        verdict: EngineVerdict::None,
        reason: None,
        passes: false,
    };
    report.reason = judge(&mut report, [&bullet, &planar], travel, swings, rests);
    if report.reason.is_none() {
        report.passes = report.measures.iter().all(|pair| pair.passes);
        report.verdict = if report.passes { EngineVerdict::Agree } else { EngineVerdict::Differ };
    }
    Ok(report)
}

fn run_quietly(experiment: &Experiment, engine: &mut dyn Engine) -> Result<Run, EngineError> {
    run(experiment, engine, |_| Control::Continue)
}

/// Compares the measures of both sides, Bullet first, given the nodes' largest `travel` (mm); returns the reason for a missing verdict.
fn judge(report: &mut EngineReport, sides: [&Side; 2], travel: f64, swings: bool, rests: bool) -> Option<String> {
    let names = ["Bullet", "the planar engine"];
    for (side, name) in sides.iter().zip(names) {
        if let Some(warning) = side.warnings.first() {
            return Some(format!("{name} gives no measures: {warning}"));
        }
    }
    let others = match sides.map(|side| side.other_step.as_ref()) {
        [Some(bullet), Some(planar)] => [bullet, planar],
        [bullet, _] => {
            let name = names[usize::from(bullet.is_some())];
            return Some(format!(
                "{name} gives no measures at twice nor at half its step, so that the error of its step is unknown"
            ));
        }
    };
    let [ours, theirs] = sides.map(|side| named(&side.run, rests));
    for (name, bullet) in ours {
        let Some(rule) = rule(&name, swings) else { continue };
        let of = |list: &[(String, f64)]| list.iter().find(|(found, _)| *found == name).map(|(_, value)| *value);
        let (Some(planar), [Some(a), Some(b)]) = (of(&theirs), others.map(|other| of(other))) else {
            return Some(format!("{name} is not a measure of all runs"));
        };
        if rule.travels && bullet.abs().max(planar.abs()) < SMALL * travel {
            report.too_small.push(name);
            continue;
        }
        let (size, step_errors) = (bullet.abs().max(planar.abs()), [(bullet - a).abs(), (planar - b).abs()]);
        if let Some(k) = (0..2).find(|&k| step_errors[k] > CONVERGED * size) {
            let share = 100.0 * step_errors[k] / size;
            return Some(format!("{name} changes by {share:.0} % on {} with another step; try a smaller one", names[k]));
        }
        let creep = if rule.travels { CREEP * travel } else { 0.0 };
        let allowed = rule.share * size + step_errors[0] + step_errors[1] + creep;
        report.measures.push(MeasurePair {
            name,
            bullet,
            planar,
            step_errors,
            allowed,
            passes: (bullet - planar).abs() <= allowed,
        });
    }
    report.measures.is_empty().then(|| "no measure of this experiment is large enough to be judged".into())
}

/// Largest distance of a node from its position in the first record (cm).
fn travel(recording: &Recording) -> f64 {
    let far = |record: usize, node: usize| {
        let (p, q) = (recording.node(record, node), recording.node(0, node));
        (p[0] - q[0]).hypot(p[2] - q[2])
    };
    (0..recording.len())
        .flat_map(|record| (0..recording.nodes()).map(move |node| (record, node)))
        .fold(0.0, |most, (r, n)| far(r, n).max(most))
}

/// Largest distance of a node between two recordings (cm), and where it first exceeds [`PARTED`]. Records are matched by index; their times differ
/// by a step.
fn distance(a: &Recording, b: &Recording) -> (f64, Option<Parting>) {
    let (mut largest, mut parting) = (0.0_f64, None);
    for record in 0..a.len().min(b.len()) {
        for node in 0..a.nodes() {
            let (p, q) = (a.node(record, node), b.node(record, node));
            let apart = (p[0] - q[0]).hypot(p[2] - q[2]);
            largest = largest.max(apart);
            if apart > PARTED && parting.is_none() {
                parting = Some(Parting { time_s: a.time[record], node });
            }
        }
    }
    (largest, parting)
}
