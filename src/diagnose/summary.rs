//! The verdict of a diagnosis in a sentence.

use super::combinations::Combination;
use super::diagnosis::{Adopted, JudgedBy, Part, Verdict};
use super::names;
use super::residual_tests::ResidualTest;

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

/// A place whose law has no name here: the place, and the nearest names with what they leave.
fn located(effect: &Adopted, place_in_words: &dyn Fn(&str) -> String) -> String {
    let near: Vec<String> = effect
        .nearest
        .iter()
        .take(2)
        .map(|near| format!("{} leaves {:.0} % of it", names::cause(&near.id), 100.0 * near.left))
        .collect();
    let near = if near.is_empty() { String::new() } else { format!(" ({})", near.join(", ")) };
    let curve = if effect.curve.is_some() { ", shown as a curve" } else { "" };
    format!("another law of {}{curve}{near}", place_in_words(&effect.place))
}

/// What the sentence is about.
pub(super) struct Findings<'a> {
    /// All adopted causes.
    pub(super) effects: &'a [Adopted],
    /// What causes determine together.
    pub(super) combinations: &'a [Combination],
    /// Names of places in a sentence.
    pub(super) place_in_words: &'a dyn Fn(&str) -> String,
    /// The unexplained fraction.
    pub(super) left: f64,
    /// True if that is more than chance and a small share.
    pub(super) has_rest: bool,
    /// Why the data are insufficient, if so.
    pub(super) insufficient: Option<&'a str>,
    /// Joints per actuator.
    pub(super) resolution: f64,
    /// True if the data need more joints than the nominal model has.
    pub(super) refined: bool,
    /// The result of [`failing`] for the extended model.
    pub(super) failing: Option<&'a str>,
    /// How the extended model predicts runs that were left out, if worse than re-tuned constants do.
    pub(super) unseen: Option<&'a str>,
    /// What judges the models.
    pub(super) judged_by: JudgedBy,
    /// Number of runs.
    pub(super) runs: usize,
}

/// The sentence, with how gains are known where there are too few runs to keep some for judging; one that says that the data are insufficient says it.
fn with_few_runs(main: String, findings: &Findings) -> String {
    if findings.judged_by == JudgedBy::JudgeRuns || findings.insufficient.is_some() {
        return main;
    }
    let judged = "are too few to keep some for judging alone: gains are by nested cross-validation";
    format!("{} ({} runs {judged}).", main.strip_suffix('.').unwrap_or(&main), findings.runs)
}

/// What the data cannot tell apart, and what of it they determine; empty for nothing.
fn ties(causes: &[&Adopted], combinations: &[Combination]) -> String {
    let tied = causes.iter().filter(|effect| !effect.tied_with.is_empty()).map(|effect| {
        let others: Vec<String> = effect.tied_with.iter().map(|id| names::cause(id)).collect();
        format!("{} cannot be told from {}", names::cause(&effect.id), others.join(", "))
    });
    let tied: Vec<String> = tied.collect();
    if tied.is_empty() {
        return String::new();
    }
    let known: String = combinations.iter().map(|combination| format!("; {}", combination.words())).collect();
    format!("; in these data {}{known}", tied.join("; "))
}

/// The verdict in a sentence.
pub(super) fn summary(verdict: Verdict, findings: &Findings) -> String {
    let Findings {
        effects,
        combinations,
        place_in_words,
        left,
        has_rest,
        insufficient,
        resolution,
        refined,
        failing,
        unseen,
        ..
    } = *findings;
    let finely = if refined { format!(", with {resolution} joints per actuator,") } else { String::new() };
    let but: Vec<&str> = unseen.into_iter().chain(failing).collect();
    let but = if but.is_empty() { String::new() } else { format!(", but {}", but.join("; ")) };
    // Its place is known by a name, not by a free form.
    let is_by_name = verdict == Verdict::Located && effects.iter().all(|effect| effect.curve.is_none());
    let name = |effect: &Adopted| {
        if effect.curve.is_some() || is_by_name {
            return located(effect, place_in_words);
        }
        let parameters: Vec<_> = effect.parameters.iter().map(|p| names::words(&effect.id, p)).collect();
        format!("{} ({})", names::with_form(&effect.id, &names::form_of(effect)), parameters.join("; "))
    };
    let (physics, minor): (Vec<&Adopted>, Vec<&Adopted>) =
        effects.iter().filter(|effect| effect.id != "discretisation").partition(|effect| effect.role == Part::Cause);
    let named = physics.iter().map(|effect| name(effect)).collect::<Vec<_>>().join("; ");
    let main = match verdict {
        Verdict::None => match (insufficient, failing) {
            (Some(insufficient), _) => format!("Nothing stands out, but {insufficient}{}.", but.replacen(", but", ", and", 1)),
            (None, None) => format!("Nothing is missing: the nominal model{finely} explains the data to the noise."),
            (None, Some(failing)) => format!(
                "No cause in the library is needed: the nominal model{finely} leaves residuals of the size of the noise, but {failing}."
            ),
        },
        Verdict::Named | Verdict::Located | Verdict::Tied => {
            let rest = if has_rest { format!(", and {:.1} % of the misfit is left", 100.0 * left) } else { String::new() };
            let tied = ties(&physics, combinations);
            format!("The simulation lacks: {named}{rest}{tied}{but}.")
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
                "{named} explains a part, but {:.1} % of the misfit is left, which no cause in the library explains{}.",
                100.0 * left,
                but.replacen(", but", ", and", 1)
            ),
        },
    };
    let main = with_few_runs(main, findings);
    if minor.is_empty() {
        return main;
    }
    let names: Vec<String> = minor.iter().map(|effect| names::cause(&effect.id)).collect();
    format!(
        "{main} A rest goes with {}; that is no cause, but within half the noise, 2 % of the misfit or what the discretisation and other laws leave open.",
        names.join(", ")
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    const NOTHING: Findings = Findings {
        effects: &[],
        combinations: &[],
        place_in_words: &str::to_owned,
        left: 0.0,
        has_rest: false,
        insufficient: None,
        resolution: 3.0,
        refined: false,
        failing: None,
        unseen: None,
        judged_by: JudgedBy::JudgeRuns,
        runs: 11,
    };

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
    fn a_named_cause_says_what_cannot_be_told_from_it() {
        let alone = [Adopted::of_test("tip-mass", &[])];
        let beside = [Adopted::of_test("tip-mass", &["damping+tip-mass"])];
        let of = |effects| summary(Verdict::Named, &Findings { effects, ..NOTHING });
        assert!(!of(&alone).contains("told"), "{}", of(&alone));
        assert!(
            of(&beside).contains("; in these data tip mass cannot be told from damping time with tip mass"),
            "{}",
            of(&beside)
        );
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
    fn a_model_that_predicts_worse_than_constants_says_so_first() {
        let found =
            summary(Verdict::Named, &Findings { unseen: Some("it predicts worse"), failing: Some("two tests fail"), ..NOTHING });
        assert!(found.contains(", but it predicts worse; two tests fail"), "{found}");
    }

    #[test]
    fn the_first_sentence_of_every_verdict_names_tests_that_fail_beyond_chance() {
        let words = failing(&tests(80, 3)).unwrap();
        assert_eq!(words, "3 of 80 residual tests still fail, more than chance explains (drift in log time 2, loop area 1)");
        for verdict in [Verdict::None, Verdict::Named, Verdict::Tied, Verdict::Unexplained] {
            for insufficient in [None, Some("one run is too little")] {
                let first = |failing| {
                    summary(verdict, &Findings { left: 0.3, insufficient, resolution: 10.0, refined: true, failing, ..NOTHING })
                };
                assert!(first(Some(words.as_str())).split(". ").next().unwrap().contains(&words), "{verdict:?}");
                assert!(!first(None).contains("residual tests"));
            }
        }
        let honest = summary(Verdict::None, &Findings { failing: Some(&words), ..NOTHING });
        assert!(!honest.contains("explains the data"), "{honest}");
    }
}
