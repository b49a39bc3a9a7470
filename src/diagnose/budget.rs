//! How much a search may simulate: where no law follows the data it would try others without end.
//!
//! The unit is a simulation of all runs at the discretisation that a search begins with, so that the budget does not depend on the length of the data, and what is
//! spent does not depend on the machine or on the number of threads: a prediction that a fit or a screening asks for counts, even if it is known already. What runs left
//! out and the bench's faults need is not counted.

use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

use super::plant::{Model, Plant};

/// Discretisation of the search, or the next finer one of the plant; re-tuned constants absorb the change with finer ones.
const SEARCH_RESOLUTION: f64 = 10.0;

/// A phase of the search, which begins nothing new once so many simulations of all runs are done since the search began.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Phase {
    /// Causes without faults of the bench in the way.
    Plain,
    /// Causes with them in the way.
    WithFaults,
    /// Names in the stead of free forms.
    Naming,
    /// Causes by names only.
    ByNames,
}

impl Phase {
    /// Number of simulations: the slowest set of the tests' simulator takes less than three minutes on two cores with these.
    fn end(self) -> f64 {
        match self {
            Self::Plain => 4000.0,
            Self::WithFaults => 6000.0,
            Self::Naming => 8000.0,
            Self::ByNames => 11500.0,
        }
    }

    /// The phase that causes are replaced in after this one's selection: replacements also say what a cause is tied with, and have what the next phase may take.
    pub(super) fn of_replacements(self) -> Self {
        match self {
            Self::Plain => Self::WithFaults,
            Self::WithFaults => Self::Naming,
            last => last,
        }
    }
}

/// What a search has spent.
pub(super) struct Budget {
    /// Work of one simulation of all runs.
    unit: f64,
    spent: AtomicU64,
    is_cut: AtomicBool,
}

impl Budget {
    pub(super) fn new(plant: &dyn Plant) -> Self {
        let model = Model::new(Vec::new(), first_resolution(plant), false);
        let unit = (0..plant.signals().len()).map(|run| plant.work(&model, run)).sum::<u64>() as f64;
        Self { unit: unit.max(1.0), spent: AtomicU64::new(0), is_cut: AtomicBool::new(false) }
    }

    /// Counts `times` predictions of a run.
    pub(super) fn spend(&self, plant: &dyn Plant, model: &Model, run: usize, times: usize) {
        self.spent.fetch_add(plant.work(model, run) * times as u64, Ordering::Relaxed);
    }

    /// True if a phase of the search may begin something new; otherwise it is cut short from now on.
    pub(super) fn allows(&self, phase: Phase) -> bool {
        let is_left = (self.spent.load(Ordering::Relaxed) as f64) < phase.end() * self.unit;
        if !is_left {
            self.is_cut.store(true, Ordering::Relaxed);
        }
        is_left
    }

    /// True if something was not begun.
    pub(super) fn is_cut(&self) -> bool {
        self.is_cut.load(Ordering::Relaxed)
    }
}

/// The discretisation that a search begins with.
pub(super) fn first_resolution(plant: &dyn Plant) -> f64 {
    let resolutions = plant.resolutions();
    let nominal = resolutions.first().copied().unwrap_or(1.0);
    resolutions.into_iter().find(|r| *r >= SEARCH_RESOLUTION).unwrap_or(nominal)
}

#[cfg(test)]
mod tests {
    use crate::diagnose::dataset::Role;
    use crate::diagnose::diagnosis::Verdict;
    use crate::diagnose::pipeline::diagnose;
    use crate::diagnose::plant::{Model, Term};
    use crate::diagnose::waves::{Waves, search};

    #[test]
    fn a_fit_s_predictions_count_whether_they_are_known_already_or_not() {
        let mut plant = Waves::new(&[("other", 3.0)]);
        plant.work = 3;
        let search = search(&plant);
        let spent = || search.estimator.budget.spent.load(super::Ordering::Relaxed);
        let model = |terms| Model::new(terms, 1.0, false);
        let bare = model(Vec::new());
        let one = model(vec![Term { candidate: 0, x: vec![1.0] }]);
        for (model, expected) in [(&bare, 2), (&one, 8), (&one, 14)] {
            search.estimator.residuals_of(model, &[0, 1]).unwrap();
            assert_eq!(spent(), expected);
        }
        // The residuals and one derivative.
        search.estimator.information(&one, &[0, 1, 2]).unwrap();
        assert_eq!(spent(), 14 + 2 * 3 * 3);
    }

    #[test]
    fn a_search_without_budget_says_that_it_was_ended() {
        // With the second number any cause costs more than a search may spend.
        for (work, is_cut) in [(1, false), (10_000, true)] {
            let mut plant = Waves::new(&[("other", 3.0), ("first", 3.0)]);
            plant.work = work;
            let found = diagnose(&plant, "waves", &[Role::Auto; 6], Vec::new(), &|_| {}, &|_| None).unwrap().diagnosis;
            let is_said = found.remarks.iter().any(|remark| remark.contains("as many simulations as it may take"));
            assert_eq!((is_said, found.complete), (is_cut, !is_cut), "{:?}", found.remarks);
            assert_eq!(found.verdict == Verdict::Unexplained, is_cut, "{}", found.summary);
        }
    }
}
