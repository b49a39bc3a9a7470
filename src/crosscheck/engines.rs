//! The planar engine judged by Bullet: the same experiment on both, and where they part.

use serde::Serialize;

use crate::engine::{Engine, EngineError};
use crate::experiment::{Control, EngineKind, Experiment, Run, run};
use crate::model::Mount;
use crate::model::units::mm_from_cm;
use crate::recording::Recording;

/// Experiments of the built-in set: presets by name.
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

/// Records of a comparison.
const RECORDS: u64 = 1000;
/// Nodes further apart than this have parted (cm).
pub const PARTED: f64 = 0.01;
/// A step error above this share of a measure tells nothing: the engine has not converged on it.
const CONVERGED: f64 = 0.1;
/// Heights and strides below this share of the nodes' largest travel are not judged: they are those of robots that stay where they are.
const SMALL: f64 = 0.02;
/// Share of the nodes' largest travel that heights and strides may differ by in any case. Bullet's robots creep: with steps of 2·10⁻⁵ to
/// 2.5·10⁻⁶ s the inchworm's sum of displacements is 0.60, 0.60, 0.67 and 0.54 mm.
const CREEP: f64 = 0.002;

/// One measure on both engines.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct MeasurePair {
    /// Its name, with the unit.
    pub name: String,
    /// On Bullet.
    pub bullet: f64,
    /// On the planar engine.
    pub planar: f64,
    /// How much each changes from a run with another step: twice the step, or half of it where that goes wrong; Bullet first.
    pub step_errors: [f64; 2],
    /// How far they may differ.
    pub allowed: f64,
    /// Whether they do not differ further.
    pub passes: bool,
}

/// What a comparison says.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub enum EngineVerdict {
    /// All judged measures agree.
    #[serde(rename = "agree")]
    Agree,
    /// One does not.
    #[serde(rename = "differ")]
    Differ,
    /// The measures cannot be judged.
    #[serde(rename = "no verdict")]
    None,
}

/// Where and when nodes are further apart than [`PARTED`] for the first time.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Parting {
    /// When (s).
    pub time_s: f64,
    /// Which node, from 0 at the left end.
    pub node: usize,
}

/// An experiment on both engines.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct EngineReport {
    /// Time steps of Bullet and of the planar engine (s).
    pub time_steps_s: [f64; 2],
    /// Wall times of both (s).
    pub wall_s: [f64; 2],
    /// Largest distance of a node on one engine from the same on the other (mm).
    pub largest_mm: f64,
    /// Where they part first, if they do.
    pub parting: Option<Parting>,
    /// The measures that are judged.
    pub measures: Vec<MeasurePair>,
    /// Names of those that are too small to be judged.
    pub too_small: Vec<String>,
    /// What went wrong on Bullet and on the planar engine.
    pub warnings: [Vec<String>; 2],
    /// What the comparison says.
    pub verdict: EngineVerdict,
    /// Why there is no verdict.
    pub reason: Option<String>,
    /// Whether all measures agree.
    pub passes: bool,
}

/// How a measure is judged.
#[derive(Debug, Clone, Copy)]
struct Rule {
    /// Share of the measure that it may differ by beyond the errors of both steps.
    share: f64,
    /// Whether it is compared with the nodes' travel before it is judged.
    travels: bool,
}

/// How a measure is judged: `None` for those that are not.
///
/// Tips and resonances within 0.1 %, heights within 1 %. Strides and sums of displacements within 3 %, for Bullet's scatter with the step by more
/// than twice the step tells: from 2·10⁻⁵ to 2.5·10⁻⁶ s those of the built-in set move by 2 to 3 %, and those of the planar engine's two friction
/// models are 1 to 4 % apart. Periods are the same. Where a cantilever swings for ever its last height is not judged: Bullet's voltages come a
/// step late, and the tip moves by 0.05 mm in one. Motion on the floor depends on every impact, so paths may part while these still agree.
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

/// One engine's runs: the one that is judged, its wall time (s), and the measures of one with another step.
struct Side {
    run: Run,
    wall: f64,
    warnings: Vec<String>,
    other_step: Option<Vec<(String, f64)>>,
}

/// Height of the highest node in the records: what shows the shape of a robot that comes to rest.
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

/// Runs an experiment on Bullet and on the planar engine, each with its own time step (s) and with twice that for its step's error.
///
/// # Errors
/// [`EngineError`] if one of them fails.
pub fn compare_engines(experiment: &Experiment, steps: [f64; 2]) -> Result<EngineReport, EngineError> {
    let duration = experiment.steps as f64 * experiment.time_step;
    let with = |engine: EngineKind, step: f64| {
        // The same records for both: a whole number of steps between them, as near as the step allows.
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
        // Records as far apart as the step allow no longer one.
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

/// Compares the measures of both sides, Bullet first, beside the nodes' largest `travel` (mm); why there is no verdict.
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
            return Some(format!("{name} cannot be had from all runs"));
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

/// Largest distance of a node from where it was in the first record (cm).
fn travel(recording: &Recording) -> f64 {
    let far = |record: usize, node: usize| {
        let (p, q) = (recording.node(record, node), recording.node(0, node));
        (p[0] - q[0]).hypot(p[2] - q[2])
    };
    (0..recording.len())
        .flat_map(|record| (0..recording.nodes()).map(move |node| (record, node)))
        .fold(0.0, |most, (r, n)| far(r, n).max(most))
}

/// Largest distance of nodes (cm), and where it first exceeds [`PARTED`]. Records are matched by number; their times differ by a step,
/// for a state is recorded before its step.
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
