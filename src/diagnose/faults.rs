//! What was found of the bench and of the noise, as parts of a diagnosis.

use super::DiagnoseError;
use super::bench::{KINDS, Spread};
use super::diagnosis::{BenchFault, BenchFound, RunFault};
use super::fit::Estimator;
use super::noise::Noise;
use super::plant::{Model, Plant};
use crate::number::significant;

/// Name of each kind, its unit if that is not the plant's, and the factor from the unit of the estimate.
const NAMES: [(&str, &str, f64); KINDS] = [
    ("clock offset", "ms", 1e3),
    ("clock rate", "", 1.0),
    ("gain", "", 1.0),
    ("scale", "", 1.0),
    ("zero", "*", 1.0),
    ("drift", "*/s", 1.0),
];

/// The faults of the bench under `model` that are not off.
pub(super) fn found(estimator: &Estimator, model: &Model) -> Result<BenchFound, DiagnoseError> {
    let plant = estimator.plant;
    let channels = plant.channels();
    let runs = estimator.found_faults(model)?;
    let given = plant.bench();
    let of = |kind: usize| {
        let (id, unit, factor) = NAMES[kind];
        let mut all = Vec::new();
        let signals = plant.signals().iter().zip(&runs).enumerate().filter(|(run, _)| plant.has_fault(*run, kind));
        for (_, (signal, faults)) in signals {
            all.extend(faults.iter().filter(|fault| fault.kind == kind).map(|fault| RunFault {
                run: signal.id.clone(),
                channel: fault.channel.and_then(|channel| channels.get(channel).cloned()),
                value: factor * fault.value,
                sd: factor * fault.sd,
            }));
        }
        BenchFault {
            id,
            unit: unit.replace('*', plant.unit()),
            spread: factor * model.spread.of[kind],
            given: given[kind].is_some(),
            runs: all,
        }
    };
    let spread = |kind: usize| NAMES[kind].2 * model.spread.of[kind];
    Ok(BenchFound {
        clock_ms: spread(Spread::CLOCK),
        zero_mm: spread(Spread::ZERO),
        gain: spread(Spread::GAIN),
        drift_mm_per_s: spread(Spread::DRIFT),
        noise_correlation_s: if estimator.noise.correlated > 0.0 { estimator.noise.time_s } else { 0.0 },
        faults: (0..KINDS).filter(|kind| model.spread.of[*kind] > 0.0).map(of).collect(),
    })
}

/// Remarks on the bench and the noise, in words.
pub(super) fn remarks(bench: &[BenchFault], noise: &Noise, plant: &dyn Plant) -> Vec<String> {
    let mut remarks: Vec<String> = bench
        .iter()
        .map(|fault| {
            let spread = significant(if fault.unit.is_empty() { 100.0 * fault.spread } else { fault.spread }, 2);
            let unit = if fault.unit.is_empty() { "%" } else { &fault.unit };
            let what = match fault.id {
                "clock offset" => "clocks differ",
                "clock rate" => "the clock of the rows and that of the inputs run at rates that differ",
                "gain" => "gains differ",
                "scale" => "scales of the picture differ",
                "zero" => "zeros differ",
                _ => "drifts differ",
            };
            let by = if fault.given { "(given)" } else { "(estimated)" };
            format!("{what} from run to run by {spread} {unit} {by}")
        })
        .collect();
    let channels = plant.channels();
    for (channel, factor) in noise.factors.iter().enumerate().filter(|(_, factor)| factor.ln().abs() > 0.2) {
        let name = channels.get(channel).map_or("a channel", String::as_str);
        remarks.push(format!(
            "what does not repeat of {name} scatters {} times as far as the noise assumed at first; that was taken",
            significant(*factor, 2)
        ));
    }
    if noise.correlated > 0.0 {
        remarks.push(format!(
            "{} % of the noise's variance is correlated, over {} ms",
            significant(100.0 * noise.correlated, 2),
            significant(1e3 * noise.time_s, 2)
        ));
    }
    remarks
}
