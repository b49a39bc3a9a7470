//! The extended model as an experiment file with its drive, and the residuals of all runs.
//!
//! The experiment has the time steps of the fit, so that `sfers run` reproduces the prediction: rows that fall on steps are recorded, the others lie
//! between recorded steps.

use super::dataset::{Dataset, Start};
use super::fit::sum_of_squares;
use super::pipeline::Outcome;
use super::plant::{Model, Plant};
use super::robot::RobotPlant;
use super::track::{NUMERICAL_DAMPING, ON_STEP};
use crate::effects::{self, View};
use crate::experiment::{DriveConfig, EffectConfig, SimulationConfig, StepConfig};
use crate::model::Mount;

/// Most numbers in a recording of the experiment (160 MB).
const MOST_RECORDED: f64 = 2e7;

/// The texts of the files.
#[derive(Debug)]
pub struct Files {
    /// `extended.toml`: an experiment for `sfers run`.
    pub experiment: String,
    /// `drive.csv`: the voltages of the experiment.
    pub drive: String,
    /// `residuals.csv`: measured and predicted values of all runs.
    pub residuals: String,
}

impl Files {
    /// The extended model under the drive of the run with the largest residuals of re-tuned constants.
    pub fn new(dataset: &Dataset, plant: &RobotPlant, outcome: &Outcome) -> Self {
        let chi2 = |run: &usize| sum_of_squares(&outcome.calibrated.residuals[*run]);
        let all = outcome.split.all();
        // A run in time, if there is one.
        let of_time = |run: &usize| dataset.runs[*run].times.len() > 1;
        let run = all.iter().copied().max_by(|a, b| of_time(a).cmp(&of_time(b)).then(chi2(a).total_cmp(&chi2(b)))).unwrap_or(0);
        let (experiment, drive) = experiment(dataset, plant, outcome.extended.model(), run, &outcome.nuisances[run].shares);
        Self { experiment, drive, residuals: residuals(plant, outcome, "_mm", &|run| plant.start(run)) }
    }
}

/// The experiment file (TOML) of a model under the drive of a run, and the file of that drive, `drive.csv`. `nuisances` (0 to 1) are the run's.
pub fn experiment(dataset: &Dataset, plant: &RobotPlant, model: &Model, run: usize, nuisances: &[f64]) -> (String, String) {
    let table = plant.command(run).table(nuisances, 0.0);
    let n = plant.robot().actuators;
    let names = std::iter::once("t_s".to_owned()).chain((1..=n).map(|a| format!("v{a}_v"))).collect();
    let rows = table.times().iter().enumerate();
    let drive = csv_text(
        std::iter::once(names)
            .chain(rows.map(|(row, t)| std::iter::once(t).chain(table.row(row)).map(|x| format!("{x:?}")).collect())),
    );

    let measured = &dataset.runs[run];
    let mut config = measured.nominal.clone();
    // The table's positive voltages include the gain.
    config.robot.positive_gain = None;
    config.drive = DriveConfig { waveform: Some("csv".into()), file: Some("drive.csv".into()), ..DriveConfig::default() };
    let mut applied_effects = Vec::new();
    if model.resolution as usize != plant.robot().motors_per_actuator {
        let discretisation =
            effects::find("discretisation").map(|effect| EffectConfig::new(effect, [("motors_per_actuator", model.resolution)]));
        config.effect.extend(discretisation);
    }
    for term in &model.terms {
        let Ok(applied) = plant.applied_in(term, run) else { continue };
        let pairs = applied.effect.parameters.iter().zip(&applied.values);
        let parameters = pairs.filter(|(_, v)| v.is_finite()).map(|(p, v)| (p.name, *v));
        config.effect.push(EffectConfig::new(applied.effect, parameters));
        applied_effects.push(applied);
    }
    let step = plant.step(run) * if model.fine { 0.5 } else { 1.0 };
    let steps = plant.steps_of(run, step);
    // A camera's delay needs positions between rows, so every step is recorded.
    let late = View::new(&applied_effects).delay > 0.0;
    let every = if late { 1 } else { interval(&plant.signals()[run].times, step).unwrap_or(1) };
    let values = 10.0 * model.resolution * n as f64 + 13.0;
    let every = every.max((steps as f64 * values / MOST_RECORDED).ceil() as u64).clamp(1, steps);
    let mount = plant.robot().mount;
    config.simulation = SimulationConfig {
        engine: Some("planar".into()),
        start: Some(if matches!(measured.start, Start::Level { .. }) { "flat" } else { "settled" }.into()),
        numerical_damping_per_s: (mount == Mount::Clamped).then_some(NUMERICAL_DAMPING),
        time_step_s: Some(StepConfig::Seconds(step)),
        steps: Some(steps),
        record_every_steps: Some(every),
        record_from_step: Some(0),
        ..SimulationConfig::default()
    };
    let toml = toml::to_string(&config).unwrap_or_else(|error| format!("# cannot be written: {error}\n"));
    // Names may hold line breaks, comments may not.
    let other_start = match measured.start {
        Start::Hung(_) | Start::Held { .. } => {
            "# The run is released from another shape; an experiment starts in equilibrium or flat.\n"
        }
        Start::Level { height } if height > 0.0 => "# The run is dropped; an experiment starts on the floor.\n",
        Start::Settled | Start::Level { .. } => "",
    };
    let head = format!(
        "# The nominal model of {} with what its diagnosis found, under the drive of run {}.\n# Its time 0 is t_s = {:?} of the run.\n{other_start}",
        dataset.name.escape_debug(),
        plant.signals()[run].id.escape_debug(),
        plant.start(run)
    );
    (head + &toml, drive)
}

/// The largest number of steps of which all times are multiples; none if one lies between steps.
fn interval(times: &[f64], step: f64) -> Option<u64> {
    let mut common = 0_u64;
    for t in times {
        let at = (t / step).round();
        if (t / step - at).abs() > ON_STEP {
            return None;
        }
        let (mut a, mut b) = (common, at as u64);
        while b > 0 {
            (a, b) = (b, a % b);
        }
        common = a;
    }
    (common > 0).then_some(common)
}

/// Rows as CSV.
fn csv_text(rows: impl Iterator<Item = Vec<String>>) -> String {
    let mut table = csv::Writer::from_writer(Vec::new());
    for row in rows {
        // Writing to a vector does not fail.
        let _ = table.write_record(&row);
    }
    String::from_utf8_lossy(&table.into_inner().unwrap_or_default()).into_owned()
}

/// All measured and predicted values (CSV), in digits that restore the same bits. `unit` ends the names of their columns; `start` is the time (s) of a
/// run's time 0.
pub fn residuals(plant: &dyn Plant, outcome: &Outcome, unit: &str, start: &dyn Fn(usize) -> f64) -> String {
    let channels = plant.channels();
    let values = ["measured", "nominal", "calibrated", "extended"].map(|of| format!("{of}{unit}"));
    let head = ["run", "role", "channel", "t_s"].map(str::to_owned).into_iter().chain(values).chain(["used".into()]).collect();
    let rows = (0..plant.signals().len()).flat_map(|run| {
        let signal = &plant.signals()[run];
        let role = outcome.split.role(run);
        let channels = &channels;
        (0..signal.values.len()).map(move |i| {
            let used = outcome.used[run][i];
            let predicted = [&outcome.nominal, &outcome.calibrated, &outcome.extended].map(|scored| {
                // Masked values have no residuals.
                let value = signal.values[i] - scored.plain[run][i] * signal.sigmas[i];
                if used { format!("{value:?}") } else { String::new() }
            });
            let named = [&signal.id, role, &channels[signal.channels[i]]].map(str::to_owned);
            let numbers = [signal.times[i] + start(run), signal.values[i]].map(|x| format!("{x:?}"));
            named.into_iter().chain(numbers).chain(predicted).chain([u8::from(used).to_string()]).collect()
        })
    });
    csv_text(std::iter::once(head).chain(rows))
}
