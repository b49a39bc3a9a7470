//! The result of a diagnosis: the content of diagnosis.json, and the verdict in a sentence.

use serde::Serialize;

use super::names;
use super::residual_tests::ResidualTest;

/// Result of a diagnosis in a word.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Verdict {
    /// The nominal model, with a fine enough discretisation, explains the data to the noise.
    None,
    /// The causes are identified.
    Named,
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

/// An adopted cause.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Adopted {
    /// Its name.
    pub id: String,
    /// Where it acts.
    pub kind: String,
    /// The cause in a sentence.
    pub cause: String,
    /// Its parameters.
    pub parameters: Vec<Estimate>,
    /// Causes that the data cannot tell from it.
    pub tied_with: Vec<String>,
    /// Share of the held-out χ² above the noise that it removes (0 to 1).
    pub gain_heldout: f64,
    /// Parameters that were given: name and value.
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
    /// Root mean square residual of the held-out runs (mm).
    pub rmse_heldout_mm: f64,
    /// Its 95 % confidence interval (mm), by a jackknife over held-out runs.
    pub rmse_heldout_ci95_mm: [f64; 2],
    /// Errors of each run.
    pub runs: Vec<RunError>,
    /// Residual tests.
    pub residual_tests: Vec<ResidualTest>,
    /// Fitted parameters.
    pub parameters: Vec<Estimate>,
}

/// A candidate on top of re-tuned constants.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Ranked {
    /// The candidate.
    pub id: String,
    /// Its form, for causes with several.
    #[serde(skip_serializing_if = "String::is_empty")]
    pub form: String,
    /// Root mean square residual of the held-out runs with it (mm).
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

/// The result of a diagnosis.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Diagnosis {
    /// Version of this schema.
    pub schema: u32,
    /// Name of the data set.
    pub dataset: String,
    /// The verdict.
    pub verdict: Verdict,
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
    /// The nominal model.
    pub baseline: Stage,
    /// The nominal model with re-tuned constants and refined discretisation.
    pub calibrated: Stage,
    /// The model with all adopted causes.
    pub extended: Stage,
    /// Candidates on top of re-tuned constants, best first.
    pub candidates: Vec<Ranked>,
    /// Nearly collinear parameters.
    pub correlations: Vec<Correlation>,
    /// Condition number of the scaled information of the extended model.
    pub condition: f64,
    /// The next measurement, where causes are tied or data insufficient.
    pub next_experiment: Option<String>,
    /// Remarks on the data.
    pub data_quality: Vec<String>,
    /// Remarks on the analysis.
    pub remarks: Vec<String>,
}

/// Share of tests that noise alone fails.
const FAILED_BY_CHANCE: f64 = 1e-3;
/// Failures are beyond chance if noise alone causes as many in a smaller share of cases.
const BEYOND_CHANCE: f64 = 1e-3;

/// The failed residual tests in words, if they are more than chance explains.
pub fn failing(tests: &[ResidualTest]) -> Option<String> {
    let failed: Vec<&ResidualTest> = tests.iter().filter(|test| !test.passed).collect();
    let (count, n) = (failed.len(), tests.len() as f64);
    // Probability of fewer failures, binomial.
    let mut term = (1.0 - FAILED_BY_CHANCE).powf(n);
    let mut fewer = 0.0;
    for k in 0..count {
        fewer += term;
        term *= (n - k as f64) / (k as f64 + 1.0) * FAILED_BY_CHANCE / (1.0 - FAILED_BY_CHANCE);
    }
    if 1.0 - fewer >= BEYOND_CHANCE {
        return None;
    }
    let mut names: Vec<(&str, usize)> = Vec::new();
    for test in failed {
        match names.iter_mut().find(|(name, _)| *name == test.name) {
            Some((_, times)) => *times += 1,
            None => names.push((&test.name, 1)),
        }
    }
    names.sort_by_key(|(_, times)| std::cmp::Reverse(*times));
    let list: Vec<String> = names.iter().map(|(name, times)| format!("{name} {times}")).collect();
    let verb = if count == 1 { "fails" } else { "fail" };
    Some(format!("{count} of {} residual tests still {verb}, more than chance explains ({})", tests.len(), list.join(", ")))
}

/// The verdict in a sentence. `left` is the unexplained fraction, `insufficient` why the data are insufficient, `failing` the result of [`failing`]
/// for the extended model.
pub(super) fn summary(
    verdict: Verdict,
    effects: &[Adopted],
    left: f64,
    insufficient: Option<&str>,
    resolution: f64,
    refined: bool,
    failing: Option<&str>,
) -> String {
    let finely = if refined { format!(", with {resolution} joints per actuator,") } else { String::new() };
    let but = failing.map_or_else(String::new, |failing| format!(", but {failing}"));
    let name = |effect: &Adopted| {
        let parameters: Vec<_> = effect.parameters.iter().map(|p| names::words(&effect.id, p)).collect();
        format!("{} ({})", names::with_form(&effect.id, &names::form_of(effect)), parameters.join("; "))
    };
    let physics: Vec<&Adopted> = effects.iter().filter(|effect| effect.id != "discretisation").collect();
    let named = physics.iter().map(|effect| name(effect)).collect::<Vec<_>>().join("; ");
    match verdict {
        Verdict::None => match (insufficient, failing) {
            (Some(insufficient), _) => format!("Nothing stands out, but {insufficient}{}.", but.replacen(", but", ", and", 1)),
            (None, None) => format!("Nothing is missing: the nominal model{finely} explains the data to the noise."),
            (None, Some(failing)) => format!(
                "No cause in the library is needed: the nominal model{finely} leaves residuals of the size of the noise, but {failing}."
            ),
        },
        Verdict::Named => format!("The simulation lacks: {named}{but}."),
        Verdict::Tied => {
            let ties: Vec<_> = physics
                .iter()
                .filter(|effect| !effect.tied_with.is_empty())
                .map(|effect| {
                    let others: Vec<String> = effect.tied_with.iter().map(|id| names::cause(id)).collect();
                    format!("{} cannot be told from {}", names::cause(&effect.id), others.join(", "))
                })
                .collect();
            format!("The simulation lacks: {named}; in these data {}{but}.", ties.join("; "))
        }
        Verdict::Unexplained => match (insufficient, physics.is_empty()) {
            (Some(insufficient), _) => {
                format!("The nominal model does not explain the data, and {insufficient}{}.", but.replacen(", but", ", and", 1))
            }
            (None, true) => format!(
                "The nominal model does not explain the data, and no cause in the library does{}.",
                but.replacen(", but", ":", 1)
            ),
            (None, false) => format!(
                "{named} explains a part, but {:.0} % of the misfit is left, which no cause in the library explains{}.",
                100.0 * left,
                but.replacen(", but", ", and", 1)
            ),
        },
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tests(count: usize, failed: usize) -> Vec<ResidualTest> {
        let test = |index: usize| ResidualTest {
            name: if index == 0 { "loop area" } else { "drift in log time" }.into(),
            run: index.to_string(),
            statistic: 1.0,
            limit: 0.5,
            passed: index >= failed,
            meaning: String::new(),
        };
        (0..count).map(test).collect()
    }

    #[test]
    fn tests_that_fail_by_chance_are_not_counted_against_a_model() {
        // Of 80 tests noise alone fails two or more in 0.3 % of cases, three or more in 0.008 %.
        assert_eq!(failing(&tests(80, 0)), None);
        assert_eq!(failing(&tests(80, 2)), None);
        assert!(failing(&tests(80, 3)).is_some() && failing(&tests(5, 2)).is_some());
        assert!(failing(&tests(1000, 3)).is_none());
    }

    #[test]
    fn the_first_sentence_of_every_verdict_names_tests_that_fail_beyond_chance() {
        let words = failing(&tests(80, 3)).unwrap();
        assert_eq!(words, "3 of 80 residual tests still fail, more than chance explains (drift in log time 2, loop area 1)");
        for verdict in [Verdict::None, Verdict::Named, Verdict::Tied, Verdict::Unexplained] {
            for insufficient in [None, Some("one run is too little")] {
                let first = |failing| summary(verdict, &[], 0.3, insufficient, 10.0, true, failing);
                assert!(first(Some(words.as_str())).split(". ").next().unwrap().contains(&words), "{verdict:?}");
                assert!(!first(None).contains("residual tests"));
            }
        }
        let honest = summary(Verdict::None, &[], 0.0, None, 3.0, false, Some(&words));
        assert!(!honest.contains("explains the data"), "{honest}");
    }
}
