//! The whole loop, from a plant to a [`Diagnosis`].

use super::dataset::Role;
use super::diagnosis::{Adopted, Diagnosis, Estimate, Ranked, RunError, Stage, Verdict, failing, summary};
use super::fit::{BLOCK, Bench, Residuals};
use super::intervals::{Intervals, intervals_of, numerics};
use super::names;
use super::plant::{Model, Plant, Term};
use super::residual_tests::residual_tests;
use super::search::{Scored, Search, Split, Trial, split};

/// Joints per actuator that the search begins with, if the plant has so many: what finer ones change, re-tuned constants take up.
const SEARCH_RESOLUTION: f64 = 10.0;
/// Structure is left if χ² per value is above 1 by so much (a misfit of half the noise), ...
const LEFT_OVER: f64 = 0.25;
/// ... and by so much of what the refined nominal model leaves: true causes in other equations than the library's left 0.6 % at most. With three or
/// more causes it takes less, in inverse proportion to one less than their number: a handful of causes that still leave something are the shadow
/// of one that is not in the library.
const LEFT_SHARE: f64 = 0.02;
/// Above this share nothing is named at all.
const NOTHING_NAMED: f64 = 0.5;
/// Replacements are looked at again, at the full precision, if their χ² is above the best one's by no more than this.
const NEAR_TIE: f64 = 500.0;
/// χ² of one, two, ... degrees of freedom that noise exceeds in 5 % of cases.
const CHI2_95: [f64; 4] = [3.841, 5.991, 7.815, 9.488];
/// Fewest values to fit and to judge by: two blocks and one of those that structure of the residuals may extend over.
const LEAST_FITTED: usize = 2 * BLOCK;
const LEAST_HELD: usize = BLOCK;
/// What to measure where there is too little.
const MORE_RUNS: &str = "measure three runs or more under voltages of different size and speed, with a hundred rows each or more";

/// The diagnosis with the models behind it, for figures and for going on.
pub struct Outcome {
    /// What was found.
    pub diagnosis: Diagnosis,
    /// The nominal model as it was given.
    pub nominal: Scored,
    /// Re-tuned constants, refined discretisation.
    pub calibrated: Scored,
    /// All causes.
    pub extended: Scored,
    /// Models that do as well as the extended one.
    pub tied: Vec<Scored>,
    /// The runs.
    pub split: Split,
    /// Moments of jumps as they were found.
    pub nuisances: super::fit::Nuisances,
    /// Which values counted.
    pub used: Vec<Vec<bool>>,
}

/// Diagnoses a plant's measured runs. `name` and `quality` are passed on; `roles` say what runs are for; `progress` is told what is tried;
/// `separate` proposes what to measure next, given the models that are tied.
///
/// # Errors
/// If the nominal model cannot be simulated, in words.
pub fn diagnose(
    plant: &dyn Plant,
    name: &str,
    roles: &[Role],
    quality: Vec<String>,
    progress: &(dyn Fn(&str) + Sync),
    separate: &dyn Fn(&[Model]) -> Option<String>,
) -> Result<Outcome, String> {
    let split = split(plant, roles);
    let mut remarks = Vec::new();
    let ladder = plant.resolutions();
    let nominal_resolution = ladder.first().copied().unwrap_or(1.0);
    let start = ladder.iter().copied().find(|r| *r >= SEARCH_RESOLUTION).unwrap_or(nominal_resolution);
    let mut search = Search { bench: Bench::new(plant), split, progress, unexplained: 0.0 };

    progress("the nominal model");
    let nominal = search.fitted(&Model { terms: Vec::new(), resolution: nominal_resolution, fine: true })?;
    progress("constants of the nominal model");
    let mut calibrated = search.calibrated(start)?;
    let spikes = search.bench.leave_out_spikes(calibrated.model())?;
    if spikes > 0 {
        calibrated = search.calibrated(start)?;
    }
    let poor = insufficient_data(plant, &search.split);
    let Causes { best, trials, replaced, coarse_total, spikes: more } = find(&mut search, &calibrated, poor.is_some())?;
    if spikes + more > 0 {
        remarks.push(format!("{} single values far off their neighbours' residuals were left out", spikes + more));
    }

    // Refined, but without any cause: what the causes have to explain.
    let bare = search.fitted(&Model { terms: Vec::new(), resolution: best.model().resolution, fine: true })?;
    let mut judged = judge(&search, best, &bare, nominal_resolution)?;
    remarks.extend(judged.remark.take());
    // A cause whose range holds the value at which it does nothing is not named.
    let (mut doubts, mut dropped) = (Vec::new(), None);
    while let Some((index, words)) = doubtful(&search, &judged)? {
        let mut model = judged.best.model().clone();
        dropped = Some(judged.best.model().clone());
        model.terms.remove(index);
        doubts.push(words);
        judged = judge(&search, search.fitted(&model)?, &bare, nominal_resolution)?;
    }
    remarks.extend(doubts.iter().cloned());
    let Judged { best, coarse, refined, left, unexplained_fraction, is_unexplained, intervals, remark: _ } = judged;
    let above = |scored: &Scored| scored.above(search.bench.count(&search.split.all()));
    progress("what could stand in the place of what was found");
    let tied = ties(&search, &best, &replaced, coarse_total);
    let mut effects = Vec::new();
    if refined {
        effects.push(discretisation(&search, &best, &coarse));
    }
    for (index, term) in best.model().terms.iter().enumerate() {
        effects.push(adopted(&search, &best, index, term, &intervals, &tied)?);
    }
    let physics = best.model().terms.len();
    let poor = poor.or_else(|| if physics == 0 { doubts.first().cloned() } else { None });
    let verdict = match () {
        () if is_unexplained => Verdict::Unexplained,
        () if physics == 0 && poor.is_some() && above(&best) > LEFT_OVER => Verdict::Unexplained,
        () if physics == 0 => Verdict::None,
        () if effects.iter().any(|effect| !effect.tied_with.is_empty()) => Verdict::Tied,
        () => Verdict::Named,
    };
    if let Some(poor) = poor.as_ref().filter(|poor| !remarks.contains(poor)) {
        remarks.push(poor.clone());
    }
    let models: Vec<Model> =
        std::iter::once(best.model().clone()).chain(tied.iter().map(|(_, t)| t.scored.model().clone())).collect();
    let next_experiment = match (verdict, dropped, &poor) {
        (Verdict::Tied, ..) => separate(&models),
        // With what was dropped and without it.
        (_, Some(dropped), _) => separate(&[best.model().clone(), dropped]),
        (_, None, Some(_)) => Some(MORE_RUNS.to_owned()),
        _ => None,
    };
    let unexplained = if is_unexplained {
        super::residual_tests::describe(plant, &search.split, &search.bench.used, &best.residuals)
    } else {
        Vec::new()
    };

    let stage = |scored: &Scored, parameters: Vec<Estimate>| stage(plant, &search.split, &search.bench.used, scored, parameters);
    let constants = intervals_of(&search, &calibrated, &[])?;
    let parameters = |scored: &Scored, found: &Intervals| -> Vec<Estimate> {
        let terms = scored.model().terms.iter().enumerate();
        terms.flat_map(|(index, term)| estimates(&search, index, term, found)).collect()
    };
    let form = |candidate: usize| {
        let candidate = &plant.candidates()[candidate];
        names::form(candidate.id, &candidate.fixed, candidate.parameters.iter().map(|p| p.name))
    };
    let ranked = |trial: &Trial| Ranked {
        id: search.id(trial.candidate).to_owned(),
        form: form(trial.candidate),
        rmse_heldout_mm: rmse(plant, &search.bench.used, &trial.scored.residuals, &search.split.held),
        delta_bic: trial.scored.bic() - calibrated.bic(),
    };
    let sigmas: Vec<f64> = plant.signals().iter().flat_map(|signal| signal.sigmas.iter().copied()).collect();
    let extended = stage(&best, parameters(&best, &intervals));
    let failed = failing(&extended.residual_tests);
    let diagnosis = Diagnosis {
        schema: 1,
        dataset: name.to_owned(),
        verdict,
        summary: summary(
            verdict,
            &effects,
            unexplained_fraction,
            poor.as_deref(),
            best.model().resolution,
            refined,
            failed.as_deref(),
        ),
        // Where what is left is no more than noise, its share of a small misfit says nothing: it is given as a share of the noise then.
        unexplained_fraction: if is_unexplained { unexplained_fraction } else { unexplained_fraction.min(left.min(1.0)) },
        unexplained,
        noise_mm: sigmas.iter().sum::<f64>() / sigmas.len().max(1) as f64,
        baseline: stage(&nominal, Vec::new()),
        calibrated: stage(&calibrated, parameters(&calibrated, &constants)),
        extended,
        candidates: trials.iter().map(ranked).collect(),
        correlations: intervals.correlations.clone(),
        condition: intervals.condition,
        effects,
        next_experiment,
        data_quality: quality,
        remarks,
    };
    Ok(Outcome {
        diagnosis,
        nominal,
        calibrated,
        extended: best,
        tied: tied.into_iter().map(|(_, trial)| trial.scored).collect(),
        nuisances: search.bench.nuisances.clone(),
        used: search.bench.used.clone(),
        split: search.split,
    })
}

/// A model with all causes beside what it has to explain.
struct Judged {
    best: Scored,
    /// With the nominal number of joints.
    coarse: Scored,
    /// Whether the data ask for another number of joints than the nominal one.
    refined: bool,
    /// χ² per value above 1.
    left: f64,
    unexplained_fraction: f64,
    is_unexplained: bool,
    intervals: Intervals,
    /// That nothing is named, if so.
    remark: Option<String>,
}

/// Looks at what `best` leaves of what `bare`, without any cause, leaves, whether the discretisation matters, and how far the data leave the causes open.
fn judge(search: &Search, mut best: Scored, bare: &Scored, nominal_resolution: f64) -> Result<Judged, String> {
    let plant = search.bench.plant;
    let count = search.bench.count(&search.split.all());
    let above = |scored: &Scored| scored.above(count);
    let (left, whole) = (above(&best), above(bare));
    let unexplained_fraction = if whole > 0.0 { (left / whole).min(1.0) } else { 0.0 };
    let cause_count = best.model().terms.len().max(2) as f64 - 1.0;
    let is_unexplained = left > LEFT_OVER && unexplained_fraction > LEFT_SHARE / cause_count;
    let unnamed = is_unexplained && unexplained_fraction > NOTHING_NAMED;
    let mut remark = None;
    if unnamed && !best.model().terms.is_empty() {
        let names: Vec<_> = best.model().terms.iter().map(|term| search.id(term.candidate)).collect();
        remark = Some(format!(
            "nothing is named: the nearest, {}, leaves {:.0} % of the misfit",
            names.join(" with "),
            100.0 * unexplained_fraction
        ));
        best = bare.clone();
    }

    // Is it the discretisation?
    let coarse = search.fitted(&Model { resolution: nominal_resolution, ..best.model().clone() })?;
    let refined = best.model().resolution != nominal_resolution && search.is_worth(&best, &coarse);
    if best.model().resolution != nominal_resolution && !refined && above(&coarse) <= above(&best) + 0.01 {
        best = coarse.clone();
    }

    let mut numerics = numerics(search, &best)?;
    // What is left may pull at the causes: by no more than its share of what they explain.
    let free = best.model().terms.iter().flat_map(|term| {
        let parameters = &plant.candidates()[term.candidate].parameters;
        term.x.iter().zip(parameters).map(|(x, p)| x - p.off.unwrap_or(*x))
    });
    for (numerics, reach) in numerics.iter_mut().zip(free) {
        *numerics = numerics.hypot(reach * unexplained_fraction.sqrt());
    }
    let intervals = intervals_of(search, &best, &numerics)?;
    Ok(Judged { best, coarse, refined, left, unexplained_fraction, is_unexplained, intervals, remark })
}

/// A cause of the model that the data do not tell from none, the least certain if there are several, and how to say so: the 95 % ranges of all its
/// parameters that can switch it off hold the value where they do. Of several such parameters, which may make up for one another, χ² without the cause decides as
/// well.
fn doubtful(search: &Search, judged: &Judged) -> Result<Option<(usize, String)>, String> {
    let Judged { best, intervals, .. } = judged;
    let mut first = 0;
    let mut found: Option<(f64, usize, String)> = None;
    for (index, term) in best.model().terms.iter().enumerate() {
        let own = first..first + term.x.len();
        first = own.end;
        let candidate = &search.bench.plant.candidates()[term.candidate];
        let switches: Vec<(usize, f64)> =
            own.clone().zip(&candidate.parameters).filter_map(|(k, free)| Some((k, free.off?))).collect();
        let holds = |(k, off): &(usize, f64)| (intervals.ends[*k][0]..=intervals.ends[*k][1]).contains(off);
        if switches.is_empty() || !switches.iter().all(holds) {
            continue;
        }
        let mut without = best.model().clone();
        without.terms.remove(index);
        let inflation = own.map(|k| intervals.inflation[k]).fold(1.0, f64::max);
        let gain = (search.fitted(&without)?.fitted - best.fitted) / inflation;
        let needed = CHI2_95[(term.x.len() - 1).min(CHI2_95.len() - 1)];
        if switches.len() > 1 && gain > needed {
            continue;
        }
        let numbers: Vec<String> =
            estimates(search, index, term, intervals).iter().map(|e| names::words(candidate.id, e)).collect();
        let words = format!(
            "the data are insufficient to name a cause: with {} ({}) they would be explained as well as without it, for the range reaches the value at \
             which it does nothing",
            names::cause(candidate.id),
            numbers.join("; ")
        );
        if found.as_ref().is_none_or(|(least, ..)| gain < *least) {
            found = Some((gain, index, words));
        }
    }
    Ok(found.map(|(_, index, words)| (index, words)))
}

/// What the search comes to.
struct Causes {
    /// The model with all causes that the data ask for, to the last digits.
    best: Scored,
    /// The candidates on top of re-tuned constants, best first.
    trials: Vec<Trial>,
    /// What could stand in the place of every cause.
    replaced: Vec<(usize, Trial)>,
    /// χ² of the best model before the last digits, beside which those were judged.
    coarse_total: f64,
    /// Single values that were left out.
    spikes: usize,
}

/// Adds causes to re-tuned constants, takes out what is not needed, tries others in the place of each. Data that are too `poor` to tell causes apart
/// get none.
fn find(search: &mut Search, calibrated: &Scored, poor: bool) -> Result<Causes, String> {
    let (mut best, trials) = if poor {
        (search.fitted(&Model { terms: Vec::new(), ..calibrated.model().clone() })?, Vec::new())
    } else {
        search.forward(calibrated.clone())?
    };
    let spikes = search.bench.leave_out_spikes(best.model())?;
    if spikes > 0 {
        best = search.settle(best)?;
    }
    best = search.resolve(best)?;
    best = search.backward(best)?;
    best = search.resolve(best)?;

    let mut replaced: Vec<(usize, Trial)> = Vec::new();
    for _ in 0..2 {
        if poor || best.model().terms.is_empty() {
            break;
        }
        replaced = search.replacements(&best, 4)?;
        let better = replaced
            .iter()
            .filter(|(_, trial)| {
                let other = &trial.scored;
                let simpler = other.freedom() < best.freedom() && search.is_tied(&best, other);
                simpler || (other.total() < best.total() && !search.is_tied(other, &best))
            })
            .min_by(|a, b| a.1.scored.total().total_cmp(&b.1.scored.total()))
            .map(|(_, trial)| trial.scored.clone());
        let Some(better) = better else { break };
        best = search.settle(better)?;
        best = search.backward(best)?;
    }
    let coarse_total = best.total();
    (search.progress)("the last digits");
    best = search.fitted(&Model { fine: true, ..best.model().clone() })?;
    best = search.resolve(best)?;
    best = search.backward(best)?;
    best = search.settle(best)?;
    Ok(Causes { best, trials, replaced, coarse_total, spikes })
}

/// Why the data cannot decide, if so.
fn insufficient_data(plant: &dyn Plant, split: &Split) -> Option<String> {
    let signals = plant.signals();
    if signals.len() < 2 || split.held.is_empty() {
        return Some(format!(
            "{} run is too little to tell causes apart: a cause has to be judged on a run that it was not fitted to",
            signals.len()
        ));
    }
    let values = |runs: &[usize]| runs.iter().map(|run| signals[*run].values.len()).sum::<usize>();
    let (fitted, held) = (values(&split.fit), values(&split.held));
    if fitted < LEAST_FITTED || held < LEAST_HELD {
        return Some(format!(
            "{fitted} values to fit and {held} to judge by are too little to tell causes apart: {LEAST_FITTED} and {LEAST_HELD} are needed at least"
        ));
    }
    let still = |run: &usize| {
        let inputs = &signals[*run].inputs;
        inputs.iter().all(|u| (u - inputs[0]).abs() < 1e-9)
    };
    let levels: Vec<f64> = signals.iter().filter_map(|signal| signal.inputs.first().copied()).collect();
    if split.all().iter().all(still) && levels.iter().all(|level| (level - levels[0]).abs() < 1e-9) {
        return Some("the voltage never changes: nothing can be told from these data but an offset".into());
    }
    None
}

fn estimates(search: &Search, index: usize, term: &Term, found: &Intervals) -> Vec<Estimate> {
    let candidate = &search.bench.plant.candidates()[term.candidate];
    let first: usize = found.sizes[..index].iter().sum();
    candidate
        .parameters
        .iter()
        .enumerate()
        .map(|(k, free)| {
            let x = term.x[k];
            let [low, high] = found.ends.get(first + k).copied().unwrap_or([x, x]);
            let mut ends = [free.value(low), free.value(high)];
            ends.sort_by(f64::total_cmp);
            Estimate {
                name: free.name.to_owned(),
                value: free.value(x),
                unit: free.unit.to_owned(),
                ci95: ends.map(|end| end.is_finite().then_some(end)),
                at_bound: x <= free.bounds[0] || x >= free.bounds[1],
            }
        })
        .collect()
}

fn adopted(
    search: &Search,
    best: &Scored,
    index: usize,
    term: &Term,
    found: &Intervals,
    tied: &[(usize, Trial)],
) -> Result<Adopted, String> {
    let candidate = &search.bench.plant.candidates()[term.candidate];
    (search.progress)(&format!("what {} is worth", candidate.id));
    let mut without = best.model().clone();
    without.terms.remove(index);
    let without = search.fitted(&without)?;
    let mut tied_with: Vec<String> =
        tied.iter().filter(|(at, _)| *at == index).map(|(_, trial)| search.id(trial.candidate).to_owned()).collect();
    tied_with.sort();
    tied_with.dedup();
    tied_with.retain(|id| id != candidate.id);
    // Which actuator it is was found by trying all of them; other given numbers tell the form of the equation.
    let (found_by_trying, form): (Vec<_>, Vec<_>) = candidate.fixed.iter().copied().partition(|(name, _)| *name == "actuator");
    let which = found_by_trying.into_iter().map(|(name, value)| Estimate {
        name: name.to_owned(),
        value,
        unit: String::new(),
        ci95: [Some(value); 2],
        at_bound: false,
    });
    Ok(Adopted {
        id: candidate.id.to_owned(),
        kind: candidate.kind.to_owned(),
        cause: candidate.cause.to_owned(),
        parameters: which.chain(estimates(search, index, term, found)).collect(),
        tied_with,
        gain_heldout: gain(search, best, &without),
        fixed: form.into_iter().map(|(name, value)| (name.to_owned(), value)).collect(),
    })
}

/// Share of the held-out χ² above the noise that `best` removes from `without`.
fn gain(search: &Search, best: &Scored, without: &Scored) -> f64 {
    let count = search.bench.count(&search.split.held) as f64;
    let above = without.held - count;
    if above > 0.0 { ((without.held - best.held) / above).clamp(0.0, 1.0) } else { 0.0 }
}

fn discretisation(search: &Search, best: &Scored, coarse: &Scored) -> Adopted {
    let ladder = search.bench.plant.resolutions();
    let at = ladder.iter().position(|r| *r == best.model().resolution).unwrap_or(0);
    let beside = [at.saturating_sub(1), (at + 1).min(ladder.len() - 1)].map(|k| Some(ladder[k]));
    Adopted {
        id: "discretisation".into(),
        kind: "numerics".into(),
        cause: "Finitely many joints and a finite time step stand for a continuum.".into(),
        parameters: vec![Estimate {
            name: "motors_per_actuator".into(),
            value: best.model().resolution,
            unit: String::new(),
            ci95: beside,
            at_bound: at + 1 == ladder.len(),
        }],
        tied_with: Vec::new(),
        gain_heldout: gain(search, best, coarse),
        fixed: Vec::new(),
    }
}

/// Replacements that do as well as the cause they replace.
fn ties(search: &Search, best: &Scored, replaced: &[(usize, Trial)], coarse_total: f64) -> Vec<(usize, Trial)> {
    let near = |(index, trial): &&(usize, Trial)| {
        best.model().terms.get(*index).is_some_and(|term| search.id(term.candidate) != search.id(trial.candidate))
            && trial.scored.freedom() <= best.freedom()
            && trial.scored.total() < coarse_total + NEAR_TIE
    };
    let again = |(index, trial): &(usize, Trial)| {
        let Model { resolution, fine, .. } = *best.model();
        let scored = search.fitted(&Model { resolution, fine, ..trial.scored.model().clone() }).ok()?;
        search.is_tied(best, &scored).then_some((*index, Trial { scored, ..trial.clone() }))
    };
    replaced.iter().filter(near).filter_map(again).collect()
}

fn rmse(plant: &dyn Plant, used: &[Vec<bool>], residuals: &[Residuals], runs: &[usize]) -> f64 {
    let (mut sum, mut count) = (0.0, 0.0);
    for &run in runs {
        for ((r, sigma), used) in residuals[run].iter().zip(&plant.signals()[run].sigmas).zip(&used[run]) {
            if *used {
                sum += (r * sigma) * (r * sigma);
                count += 1.0;
            }
        }
    }
    if count > 0.0 { f64::sqrt(sum / count) } else { 0.0 }
}

fn stage(plant: &dyn Plant, split: &Split, used: &[Vec<bool>], scored: &Scored, parameters: Vec<Estimate>) -> Stage {
    let all = split.all();
    let runs = all.iter().map(|&run| {
        let r = &scored.residuals[run];
        let count = used[run].iter().filter(|used| **used).count().max(1) as f64;
        RunError {
            id: plant.signals()[run].id.clone(),
            role: if split.held.contains(&run) { "held-out" } else { "fit" },
            rmse_mm: rmse(plant, used, &scored.residuals, &[run]),
            rmse_sigma: (r.iter().map(|r| r * r).sum::<f64>() / count).sqrt(),
        }
    });
    // Jackknife over runs.
    let held = rmse(plant, used, &scored.residuals, &split.held);
    let without: Vec<f64> = split
        .held
        .iter()
        .map(|out| rmse(plant, used, &scored.residuals, &split.held.iter().copied().filter(|run| run != out).collect::<Vec<_>>()))
        .collect();
    let n = without.len() as f64;
    let mean = without.iter().sum::<f64>() / n.max(1.0);
    let error = ((n - 1.0).max(0.0) / n.max(1.0) * without.iter().map(|value| (value - mean).powi(2)).sum::<f64>()).sqrt();
    Stage {
        rmse_mm: rmse(plant, used, &scored.residuals, &all),
        rmse_heldout_mm: held,
        rmse_heldout_ci95_mm: [(held - 1.96 * error).max(0.0), held + 1.96 * error],
        runs: runs.collect(),
        residual_tests: residual_tests(plant, split, used, &scored.residuals),
        parameters,
    }
}
