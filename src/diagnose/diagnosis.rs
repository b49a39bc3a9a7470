//! What a diagnosis says: the content of diagnosis.json, and its sentence.

use serde::Serialize;

use super::names;
use super::residual_tests::ResidualTest;

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
    pub rmse_sigma: f64,
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
    /// Which form of it, for causes that have several.
    #[serde(skip_serializing_if = "String::is_empty")]
    pub form: String,
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

/// Share of tests that noise alone fails.
const FAILED_BY_CHANCE: f64 = 1e-3;
/// More tests fail than chance explains if noise alone fails as many in less than this share of cases.
const BEYOND_CHANCE: f64 = 1e-3;

/// Which residual tests fail, in words, if more do than noise alone would.
pub fn failing(tests: &[ResidualTest]) -> Option<String> {
    let failed: Vec<&ResidualTest> = tests.iter().filter(|test| !test.passed).collect();
    let (count, n) = (failed.len(), tests.len() as f64);
    // The chance of fewer failures, from the binomial distribution.
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

/// The verdict in a sentence. `failing` is what [`failing`] says of the extended model.
pub(super) fn summary(
    verdict: Verdict,
    effects: &[Adopted],
    left: f64,
    poor: Option<&str>,
    resolution: f64,
    refined: bool,
    failing: Option<&str>,
) -> String {
    let finely = if refined { format!(", with {resolution} joints per actuator,") } else { String::new() };
    let but = failing.map_or_else(String::new, |failing| format!(", but {failing}"));
    let name = |effect: &Adopted| {
        let numbers: Vec<_> = effect.parameters.iter().map(|p| names::words(&effect.id, p)).collect();
        format!("{} ({})", names::with_form(&effect.id, &names::form_of(effect)), numbers.join("; "))
    };
    let physics: Vec<&Adopted> = effects.iter().filter(|effect| effect.id != "discretisation").collect();
    let named = physics.iter().map(|effect| name(effect)).collect::<Vec<_>>().join("; ");
    match verdict {
        Verdict::None => match (poor, failing) {
            (Some(poor), _) => format!("Nothing stands out, but {poor}{}.", but.replacen(", but", ", and", 1)),
            (None, None) => format!("Nothing is missing: the nominal model{finely} explains the data to the noise."),
            (None, Some(failing)) => format!(
                "Nothing that the library knows is missing, and the nominal model{finely} leaves no more than the size of the noise, but {failing}."
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
        Verdict::Unexplained => match (poor, physics.is_empty()) {
            (Some(poor), _) => {
                format!("The nominal model does not explain the data, and {poor}{}.", but.replacen(", but", ", and", 1))
            }
            (None, true) => format!("Something is wrong that nothing in the library explains{}.", but.replacen(", but", ":", 1)),
            (None, false) => format!(
                "{named} explains a part, but {:.0} % of the misfit is left that nothing in the library explains{}.",
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
            for poor in [None, Some("one run is too little")] {
                let first = |failing| summary(verdict, &[], 0.3, poor, 10.0, true, failing);
                assert!(first(Some(words.as_str())).split(". ").next().unwrap().contains(&words), "{verdict:?}");
                assert!(!first(None).contains("residual tests"));
            }
        }
        let honest = summary(Verdict::None, &[], 0.0, None, 3.0, false, Some(&words));
        assert!(!honest.contains("explains the data"), "{honest}");
    }
}
