//! What a diagnosis leaves for going on: the extended model as an experiment, its drive, and all residuals.

use std::fmt::Write;

use super::dataset::Dataset;
use super::plant::Plant;
use super::robot::RobotPlant;
use super::verdict::Outcome;
use crate::experiment::{DriveConfig, EffectConfig, SimulationConfig, StepConfig};

/// The files' texts.
pub struct Files {
    /// `extended.toml`: an experiment that `sfers run` takes.
    pub experiment: String,
    /// `drive.csv`: the voltages of its run, beside it.
    pub drive: String,
    /// `residuals.csv`.
    pub residuals: String,
}

impl Files {
    /// The extended model under the drive of the run that the re-tuned nominal model explains worst.
    pub fn new(dataset: &Dataset, plant: &RobotPlant, outcome: &Outcome) -> Self {
        let square = |run: &usize| outcome.calibrated.residuals[*run].iter().map(|r| r * r).sum::<f64>();
        let all = outcome.split.all();
        let run = all.iter().copied().max_by(|a, b| square(a).total_cmp(&square(b))).unwrap_or(0);
        let table = plant.command(run).table(&outcome.unknowns[run]);
        let n = plant.robot().actuators;
        let mut drive = String::from("t_s");
        (1..=n).for_each(|a| drive += &format!(",v{a}_v"));
        drive.push('\n');
        for (row, t) in table.times().iter().enumerate() {
            let _ = write!(drive, "{t:?}");
            table.row(row).iter().for_each(|v| drive += &format!(",{v:?}"));
            drive.push('\n');
        }

        let mut config = dataset.nominal.clone();
        // The drive's positive voltages have their gain already.
        config.robot.positive_gain = None;
        config.drive = DriveConfig { waveform: Some("csv".into()), file: Some("drive.csv".into()), ..DriveConfig::default() };
        let step = 0.5 * plant.step(run);
        let duration = table.times().last().copied().unwrap_or(1.0).max(step);
        config.simulation = SimulationConfig {
            engine: Some("planar".into()),
            start: Some("settled".into()),
            time_step_s: Some(StepConfig::Seconds(step)),
            duration_s: Some(duration),
            record_every_s: Some((step * (1e-3 / step).ceil()).min(duration)),
            ..SimulationConfig::default()
        };
        let model = outcome.extended.model();
        if model.resolution as usize != plant.robot().motors_per_actuator {
            let parameters = [("motors_per_actuator".to_owned(), model.resolution)].into();
            config.effect.push(EffectConfig { id: "discretisation".into(), parameters });
        }
        for term in &model.terms {
            let Ok(applied) = plant.applied(term) else { continue };
            let pairs = applied.effect.parameters.iter().zip(&applied.values);
            let parameters = pairs.filter(|(_, v)| v.is_finite()).map(|(p, v)| (p.name.to_owned(), *v)).collect();
            config.effect.push(EffectConfig { id: applied.effect.id.into(), parameters });
        }
        let toml = toml::to_string(&config).unwrap_or_else(|error| format!("# cannot be written: {error}\n"));
        let head = format!(
            "# The nominal model of {} with what its diagnosis found, under the drive of run {}.\n",
            dataset.name,
            plant.signals()[run].id
        );
        Self { experiment: head + &toml, drive, residuals: residuals(plant, outcome) }
    }
}

/// Every measured value beside what the models say.
fn residuals(plant: &RobotPlant, outcome: &Outcome) -> String {
    let channels = plant.channels();
    let mut out = String::from("run,role,channel,t_s,measured_mm,nominal_mm,calibrated_mm,extended_mm,used\n");
    for run in outcome.split.all() {
        let signal = &plant.signals()[run];
        let role = if outcome.split.held.contains(&run) { "held-out" } else { "fit" };
        for i in 0..signal.values.len() {
            let of = |residuals: &[Vec<f64>]| signal.values[i] - residuals[run][i] * signal.sigmas[i];
            let used = outcome.used[run][i];
            let predicted = [&outcome.nominal, &outcome.calibrated, &outcome.extended].map(|scored| {
                // Residuals of values left out are not kept.
                if used { format!("{:.5}", of(&scored.residuals)) } else { String::new() }
            });
            let _ = writeln!(
                out,
                "{},{role},{},{:.6},{},{},{},{},{}",
                signal.id,
                channels[signal.channels[i]],
                signal.times[i] + plant.start(run),
                signal.values[i],
                predicted[0],
                predicted[1],
                predicted[2],
                u8::from(used)
            );
        }
    }
    out
}
