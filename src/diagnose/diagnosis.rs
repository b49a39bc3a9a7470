//! What a diagnosis says: the content of diagnosis.json, and its sentence.

use serde::Serialize;

use super::tests::ResidualTest;

/// What the data say.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Verdict {
    /// The nominal model, finely enough discretised, explains the data to the noise.
    None,
    /// The causes are named.
    Named,
    /// Two or more causes that these data cannot tell apart.
    Tied,
    /// Structure is left that nothing in the library explains.
    Unexplained,
}

/// A parameter of an adopted cause.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Estimate {
    /// Its name in `[[effect]]` tables.
    pub name: String,
    /// The value.
    pub value: f64,
    /// Its unit.
    pub unit: String,
    /// The range that holds the true value in 95 % of cases; an end may be missing where the data say nothing.
    pub ci95: [Option<f64>; 2],
    /// Whether it stands at the end of its range.
    pub at_bound: bool,
}

impl Estimate {
    /// Name, value, range and unit.
    pub(super) fn words(&self) -> String {
        let range = match self.ci95 {
            [Some(low), Some(high)] if low == high => return format!("{} = {}", self.name, self.value),
            [Some(low), Some(high)] => format!(" ({low:.4} to {high:.4})"),
            _ => String::new(),
        };
        format!("{} = {:.4}{range}{}{}", self.name, self.value, if self.unit.is_empty() { "" } else { " " }, self.unit)
    }
}

/// A cause that the data ask for.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Adopted {
    /// Its name.
    pub id: String,
    /// Where it acts.
    pub kind: String,
    /// What it is, in a sentence.
    pub cause: String,
    /// Its numbers.
    pub parameters: Vec<Estimate>,
    /// Causes that would do as well.
    pub tied_with: Vec<String>,
    /// Share of the held-out squared error above the noise that it removes.
    pub gain_heldout: f64,
    /// What is given of it: parameters that were not fitted.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub fixed: Vec<(String, f64)>,
}

/// Error of a model on one run.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct RunError {
    /// The run.
    pub id: String,
    /// `fit` or `held-out`.
    pub role: &'static str,
    /// Root of the mean squared residual.
    pub rmse_mm: f64,
    /// The same in multiples of the noise.
    pub rmse_noises: f64,
}

/// A model beside the data.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Stage {
    /// Over all runs.
    pub rmse_mm: f64,
    /// Over the held-out runs.
    pub rmse_heldout_mm: f64,
    /// The range of that, by leaving out held-out runs one at a time.
    pub rmse_heldout_ci95_mm: [f64; 2],
    /// Run by run.
    pub runs: Vec<RunError>,
    /// What the residuals look like.
    pub residual_tests: Vec<ResidualTest>,
    /// Fitted numbers.
    pub parameters: Vec<Estimate>,
}

/// How well a candidate does on top of re-tuned constants.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Ranked {
    /// The candidate.
    pub id: String,
    /// Error of the held-out runs with it.
    pub rmse_heldout_mm: f64,
    /// Change of Bayes's information criterion against re-tuned constants alone; negative is better.
    pub delta_bic: f64,
}

/// Two constants that the data hardly tell apart.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Correlation {
    /// The two, as cause and parameter.
    pub between: [String; 2],
    /// Coefficient of correlation (–).
    pub coefficient: f64,
}

/// What was found.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Diagnosis {
    /// Of this object.
    pub schema: u32,
    /// The data's name.
    pub dataset: String,
    /// In a word.
    pub verdict: Verdict,
    /// In a sentence.
    pub summary: String,
    /// Every cause adopted, numerics and constants included.
    pub effects: Vec<Adopted>,
    /// Share of the squared error above the noise that is left of the refined nominal model's.
    pub unexplained_fraction: f64,
    /// What is left looks like this.
    pub unexplained: Vec<String>,
    /// One standard deviation, the mean over channels.
    pub noise_mm: f64,
    /// The nominal model.
    pub baseline: Stage,
    /// With re-tuned constants and refined discretisation.
    pub calibrated: Stage,
    /// With all causes adopted.
    pub extended: Stage,
    /// Candidates on top of re-tuned constants, best first.
    pub candidates: Vec<Ranked>,
    /// Constants that hardly differ in what they do.
    pub correlations: Vec<Correlation>,
    /// Ratio of the largest to the smallest eigenvalue of the scaled information of the extended model.
    pub condition: f64,
    /// What to measure to tell tied causes apart.
    pub next_experiment: Option<String>,
    /// What was noticed about the data.
    pub data_quality: Vec<String>,
    /// What was noticed about the analysis.
    pub remarks: Vec<String>,
}

/// The verdict in a sentence.
pub(super) fn summary(
    verdict: Verdict,
    effects: &[Adopted],
    left: f64,
    poor: Option<&str>,
    resolution: f64,
    refined: bool,
) -> String {
    let finely = if refined { format!(", with {resolution} joints per actuator,") } else { String::new() };
    let name = |effect: &Adopted| {
        let numbers: Vec<_> = effect.parameters.iter().map(Estimate::words).collect();
        format!("{} ({})", effect.id, numbers.join(", "))
    };
    let physics: Vec<&Adopted> = effects.iter().filter(|effect| effect.id != "discretisation").collect();
    let names = physics.iter().map(|effect| name(effect)).collect::<Vec<_>>().join("; ");
    match verdict {
        Verdict::None => match poor {
            Some(poor) => format!("Nothing stands out, but {poor}."),
            None => format!("Nothing is missing: the nominal model{finely} explains the data to the noise."),
        },
        Verdict::Named => format!("The simulation lacks {names}."),
        Verdict::Tied => {
            let ties: Vec<_> = physics
                .iter()
                .filter(|effect| !effect.tied_with.is_empty())
                .map(|effect| format!("{} cannot be told from {}", effect.id, effect.tied_with.join(", ")))
                .collect();
            format!("The simulation lacks {names}; in these data {}.", ties.join("; "))
        }
        Verdict::Unexplained => match (poor, physics.is_empty()) {
            (Some(poor), _) => format!("The nominal model does not explain the data, and {poor}."),
            (None, true) => "Something is wrong that nothing in the library explains.".into(),
            (None, false) => format!(
                "{names} explains a part, but {:.0} % of the misfit is left that nothing in the library explains.",
                100.0 * left
            ),
        },
    }
}
