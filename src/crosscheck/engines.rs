//! The planar engine judged by Bullet: the same experiment on both, and where they part.

use serde::Serialize;

use crate::engine::EngineError;
use crate::experiment::{Control, EngineKind, Experiment, Run, run};
use crate::recording::Recording;
use crate::recording::measures::Measures;

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

/// One measure on both engines.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct MeasurePair {
    /// Its name, with the unit.
    pub name: String,
    /// On Bullet.
    pub bullet: f64,
    /// On the planar engine.
    pub planar: f64,
    /// How far they may differ.
    pub allowed: f64,
    /// Whether they do not differ further.
    pub passes: bool,
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
    /// Whether all measures agree.
    pub passes: bool,
}

/// How far a measure may differ on the two engines, both within the errors of their steps: `None` for those that are not judged.
///
/// Tips within 0.1 % or 0.01 mm, heights within 0.1 mm, strides within 3 % or 0.1 mm, sums of displacements within 3 % or 0.2 mm (Bullet's
/// robots creep a little while they jump in place), the same period. Where a cantilever swings for ever its last height is not judged:
/// Bullet's voltages come a step late, and the tip moves by 0.05 mm in one. Motion on the floor depends on every impact, so paths may part while these still agree.
fn allowed(name: &str, bullet: f64, swings: bool) -> Option<f64> {
    match name {
        "tip_deflection_mm" if swings => None,
        "tip_deflection_mm" | "tip_amplitude_mm" => Some((1e-3 * bullet.abs()).max(0.01)),
        "resonance_hz" => Some(1e-3 * bullet.abs()),
        "jump_height_mm" => Some(0.1),
        "stride_mm" => Some((0.03 * bullet.abs()).max(0.1)),
        "displacement_sum_mm" => Some((0.03 * bullet.abs()).max(0.2)),
        "period_ratio" => Some(0.0),
        _ => None,
    }
}

/// Runs an experiment on Bullet and on the planar engine, each with its own time step (s).
///
/// # Errors
/// [`EngineError`] if one of them fails.
pub fn compare_engines(experiment: &Experiment, steps: [f64; 2]) -> Result<EngineReport, EngineError> {
    let duration = experiment.steps as f64 * experiment.time_step;
    let on = |engine: EngineKind, step: f64| -> Result<(Run, f64), EngineError> {
        // The same records for both: a whole number of steps between them, as near as the step allows.
        let every = (duration / RECORDS as f64 / step).round().max(1.0);
        let time_step = duration / RECORDS as f64 / every;
        let records_every = every as u64;
        let mut experiment = experiment.clone();
        (experiment.engine, experiment.time_step) = (engine, time_step);
        (experiment.steps, experiment.record_every) = (RECORDS * records_every, records_every);
        let start = std::time::Instant::now();
        let run = run(&experiment, experiment.engine()?.as_mut(), |_| Control::Continue)?;
        Ok((run, start.elapsed().as_secs_f64()))
    };
    let (bullet, bullet_wall) = on(EngineKind::Bullet, steps[0])?;
    let (planar, planar_wall) = on(EngineKind::Planar, steps[1])?;
    let step = |run: &Run| run.recording.meta.time_step;
    let (largest, parting) = distance(&bullet.recording, &planar.recording);
    let of = |run: &Run| Measures::of(&run.recording, experiment.robot.mount, experiment.drive.period());
    let theirs = of(&planar);
    let measures: Vec<MeasurePair> = of(&bullet)
        .named()
        .into_iter()
        .filter_map(|(name, bullet)| {
            let (allowed, planar) = (allowed(&name, bullet, experiment.drive.period().is_some())?, theirs.get(&name)?);
            Some(MeasurePair { name, bullet, planar, allowed, passes: (bullet - planar).abs() <= allowed })
        })
        .collect();
    Ok(EngineReport {
        time_steps_s: [step(&bullet), step(&planar)],
        wall_s: [bullet_wall, planar_wall],
        largest_mm: 10.0 * largest,
        parting,
        passes: measures.iter().all(|pair| pair.passes) && !measures.is_empty(),
        measures,
    })
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
