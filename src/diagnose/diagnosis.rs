//! The result of a diagnosis: the content of diagnosis.json.

use serde::Serialize;

use super::combinations::Combination;
use super::residual_tests::ResidualTest;

/// Result of a diagnosis in a word.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Verdict {
    /// The nominal model, with a fine enough discretisation, explains the data to the noise.
    None,
    /// The causes are identified.
    Named,
    /// It is known where something is missing, but no named law of that place suits: its curve is shown, or what the nearest name leaves.
    Located,
    /// Some causes cannot be told apart by these data.
    Tied,
    /// Structure is left that no cause in the library explains.
    Unexplained,
}

/// A parameter of an adopted cause.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Estimate {
    /// Its name in `[[effect]]` tables.
    pub name: String,
    /// The fitted or given value, in `unit`.
    pub value: f64,
    /// Its unit; empty for dimensionless ones.
    pub unit: String,
    /// 95 % confidence interval, in `unit`; an end is missing where it is unbounded.
    pub ci95: [Option<f64>; 2],
    /// True if the value is at a bound of the fit.
    pub at_bound: bool,
}

/// What judges the models: the runs behind every figure of a gain and of a held-out error.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum JudgedBy {
    /// Runs that neither fit nor selection saw.
    JudgeRuns,
    /// Each of four folds of the runs in turn, left out of selection and fit: there are too few runs to keep some.
    CrossValidation,
}

/// What an adopted cause counts for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Part {
    /// A cause of the misfit.
    Cause,
    /// One of those that together remove the last 2 % of the misfit, or one that removes less than half the noise: every bench leaves such a rest.
    Minor,
}

/// An adopted cause.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Adopted {
    /// Its name.
    pub id: String,
    /// Kind of cause.
    pub kind: String,
    /// The part of the equations in which it acts.
    pub place: String,
    /// The cause in a sentence.
    pub cause: String,
    /// Its parameters.
    pub parameters: Vec<Estimate>,
    /// Causes, or sets of two with a plus sign, that the data cannot tell from it.
    pub tied_with: Vec<String>,
    /// Share of the misfit of the refined, re-tuned nominal model that comes back without it (0 to 1).
    pub share: f64,
    /// What it counts for.
    pub role: Part,
    /// Share of resamples that leave out one or two runs in which it is chosen, by linear estimates (0 to 1); none with few runs.
    pub stability: Option<f64>,
    /// The curve of a free form.
    pub curve: Option<Curve>,
    /// The named causes that were tried in the stead of the place's free form, nearest first; the cause itself, with the share of the misfit that it leaves, where its
    /// place is known by it.
    pub nearest: Vec<Nearest>,
    /// Share of χ² above the noise that it removes from the runs that judge (0 to 1).
    pub gain_heldout: f64,
    /// Parameters that were given: name and value.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub fixed: Vec<(String, f64)>,
}

impl Adopted {
    /// True if something else may stand in its place. A set that holds the cause itself leaves open only what is beside it.
    pub fn is_tied(&self) -> bool {
        self.tied_with.iter().any(|set| set.split('+').all(|id| id != self.id))
    }
}

#[cfg(test)]
impl Adopted {
    /// A cause that takes everything, for tests.
    pub(super) fn of_test(id: &str, tied_with: &[&str]) -> Self {
        Self {
            id: id.into(),
            kind: "test".into(),
            place: "test".into(),
            cause: String::new(),
            parameters: Vec::new(),
            tied_with: tied_with.iter().map(|id| (*id).to_owned()).collect(),
            share: 1.0,
            role: Part::Cause,
            stability: None,
            curve: None,
            nearest: Vec::new(),
            gain_heldout: 0.0,
            fixed: Vec::new(),
        }
    }
}

/// The curve of a free form, with its pointwise 95 % band.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Curve {
    /// Name of the abscissa.
    pub x_name: String,
    /// Its unit; empty for dimensionless ones.
    pub x_unit: String,
    /// Name of the ordinate.
    pub y_name: String,
    /// Its unit; empty for dimensionless ones.
    pub y_unit: String,
    /// Abscissas.
    pub x: Vec<f64>,
    /// Ordinates.
    pub y: Vec<f64>,
    /// Lower and upper ends of the band.
    pub ci95: Vec<[f64; 2]>,
}

/// A named cause that was tried in the stead of a free form.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Nearest {
    /// Its name.
    pub id: String,
    /// Share of what the free form takes on select runs that it leaves (0 to 1).
    pub left: f64,
}

/// Error of a model on one run.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct RunError {
    /// The run.
    pub id: String,
    /// `fit`, `select` or `judge`.
    pub role: &'static str,
    /// Root mean square residual (mm).
    pub rmse_mm: f64,
    /// Root mean square residual (σ).
    pub rmse_sigma: f64,
}

/// A model compared with the data.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Stage {
    /// Root mean square residual of all runs (mm).
    pub rmse_mm: f64,
    /// Root mean square residual of the runs that judge, or of the folds of the cross-validation (mm).
    pub rmse_heldout_mm: f64,
    /// Its 95 % confidence interval (mm), by a jackknife over these runs.
    pub rmse_heldout_ci95_mm: [f64; 2],
    /// Errors of each run.
    pub runs: Vec<RunError>,
    /// Residual tests.
    pub residual_tests: Vec<ResidualTest>,
    /// Fitted parameters.
    pub parameters: Vec<Estimate>,
}

/// How far a value of a new run may be from the extended model.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Prediction {
    /// Half the width of the interval that holds 95 % of the values of new runs like those that judge (mm).
    pub half_width_mm: f64,
    /// Standard deviation of the noise in it (mm).
    pub noise_mm: f64,
    /// Root mean square of what the model missed in a run beyond the noise (mm).
    pub discrepancy_mm: f64,
    /// Number of runs that it was measured on.
    pub runs: usize,
}

/// A candidate on top of re-tuned constants.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Ranked {
    /// The candidate.
    pub id: String,
    /// Its form, for causes with several.
    #[serde(skip_serializing_if = "String::is_empty")]
    pub form: String,
    /// Root mean square residual of the select runs with it (mm).
    pub rmse_heldout_mm: f64,
    /// Change of BIC against re-tuned constants alone; negative is better.
    pub delta_bic: f64,
}

/// Two nearly collinear parameters.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Correlation {
    /// The two, as cause and parameter.
    pub between: [String; 2],
    /// Correlation coefficient (–).
    pub coefficient: f64,
}

/// A fault of the bench in one run.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct RunFault {
    /// The run.
    pub run: String,
    /// The channel; none if the fault is of all.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub channel: Option<String>,
    /// The estimate, in the fault's unit.
    pub value: f64,
    /// Its standard deviation.
    pub sd: f64,
}

/// What was found of the bench: standard deviations between runs, 0 for a fault that is off.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct BenchFound {
    /// Of the clock of the rows against that of the voltages (ms).
    pub clock_ms: f64,
    /// Of the zero of each channel (mm).
    pub zero_mm: f64,
    /// Of the gain of the inputs (–).
    pub gain: f64,
    /// Of the drift of each channel (mm/s).
    pub drift_mm_per_s: f64,
    /// Correlation time of the noise (s); 0 for white noise.
    pub noise_correlation_s: f64,
    /// Every fault that is not off, run by run.
    pub faults: Vec<BenchFault>,
}

/// A fault of the bench that differs from run to run.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct BenchFault {
    /// `clock offset`, `clock rate`, `gain` of the inputs, `scale` of the signals, `zero` or `drift`.
    pub id: &'static str,
    /// Unit of the values; empty for shares.
    pub unit: String,
    /// Standard deviation between runs.
    pub spread: f64,
    /// True if that was given, false if it was estimated.
    pub given: bool,
    /// The estimates of all runs.
    pub runs: Vec<RunFault>,
}

/// The result of a diagnosis.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Diagnosis {
    /// Version of this schema.
    pub schema: u32,
    /// Name of the data set.
    pub dataset: String,
    /// The verdict.
    pub verdict: Verdict,
    /// True if no structure is left and no more residual tests fail than chance explains.
    pub complete: bool,
    /// The verdict in a sentence.
    pub summary: String,
    /// All adopted causes, discretisation and constants included.
    pub effects: Vec<Adopted>,
    /// Share of the refined nominal model's χ² above the noise that is left (0 to 1).
    pub unexplained_fraction: f64,
    /// Description of the residuals that are left.
    pub unexplained: Vec<String>,
    /// Standard deviation of the noise (mm), averaged over all values.
    pub noise_mm: f64,
    /// Share of the noise's variance that is correlated from row to row (–).
    pub noise_correlated: f64,
    /// What judges the models: behind `gain_heldout` and `rmse_heldout_mm`; none of single numbers.
    pub judged_by: Option<JudgedBy>,
    /// Faults of the bench that differ from run to run, as far as the data ask for them.
    pub bench: BenchFound,
    /// The nominal model.
    pub baseline: Stage,
    /// The nominal model with re-tuned constants and refined discretisation.
    pub calibrated: Stage,
    /// The model with all adopted causes.
    pub extended: Stage,
    /// The interval of a new run about the extended model; none with fewer than two runs that judge.
    pub prediction: Option<Prediction>,
    /// Candidates on top of re-tuned constants, best first.
    pub candidates: Vec<Ranked>,
    /// Nearly collinear parameters.
    pub correlations: Vec<Correlation>,
    /// What correlated or tied parameters determine together.
    pub combinations: Vec<Combination>,
    /// Condition number of the scaled information of the extended model.
    pub condition: f64,
    /// The next measurement, where causes are tied or data insufficient.
    pub next_experiment: Option<String>,
    /// Remarks on the data.
    pub data_quality: Vec<String>,
    /// Remarks on the analysis.
    pub remarks: Vec<String>,
}
