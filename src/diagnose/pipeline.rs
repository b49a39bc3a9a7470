//! The diagnosis of a plant, from its measured runs to a [`Diagnosis`].

use super::DiagnoseError;
use super::combinations::combinations;
use super::curve::curve;
use super::dataset::Role;
use super::diagnosis::{Adopted, Diagnosis, Estimate, Nearest, Part, Ranked, RunError, Stage, Verdict};
use super::faults;
use super::fit::{BLOCK, Estimator, Residuals, sum_of_squares};
use super::intervals::{Intervals, intervals_of, numerics};
use super::names;
use super::naming::{self, Naming};
use super::plant::{Model, Plant, Signal, Term};
use super::residual_tests::residual_tests;
use super::search::{SOUGHT, Scored, Search, Split, Trial, split};
use super::stability::{Standing, standing};
use super::summary::{Findings, failing, summary};

/// Discretisation of the search, or the next finer one of the plant; re-tuned constants absorb the change with finer ones.
const SEARCH_RESOLUTION: f64 = 10.0;
/// Structure is left if χ² per value exceeds 1 by this (a misfit of σ/2), ...
const LEFT_OVER: f64 = 0.25;
/// ... and the verdict is unexplained if it is also by this share of what the refined nominal model leaves: a name stands with 95 % of what its place
/// takes. For n causes, three or more, the share is divided by n − 1: many causes that still leave structure stand in for one that is not in the library.
const LEFT_SHARE: f64 = 0.05;
/// Causes are minor that together remove no more than this share, ...
const MINOR_SHARE: f64 = 0.02;
/// ... and those that remove less than this of χ² per value: half the noise.
const MINOR_MISFIT: f64 = 0.25;
/// No cause is named if a larger share is left.
const NOTHING_NAMED: f64 = 0.5;
/// Replacements are refitted like the best model if their χ² exceeds its own by no more than this.
const NEAR_TIE: f64 = 500.0;
/// 95 % quantiles of χ² of one to four degrees of freedom.
const CHI2_95: [f64; 4] = [3.841, 5.991, 7.815, 9.488];
/// A model selected without the bench's faults counts if its cost, with ln N for each coordinate, is lower by this.
const LEAST_COST: f64 = 10.0;
/// Fewest values to fit and to judge by, in whole blocks of correlated residuals.
const LEAST_FITTED: usize = 2 * BLOCK;
const LEAST_HELD: usize = BLOCK;
/// The next experiment where the data are insufficient.
const MORE_RUNS: &str = "measure three runs or more under voltages of different size and speed, with a hundred rows each or more";

/// The diagnosis with its models, for figures and for the extended experiment.
pub struct Outcome {
    /// The diagnosis.
    pub diagnosis: Diagnosis,
    /// The nominal model.
    pub nominal: Scored,
    /// The nominal model with re-tuned constants and refined discretisation.
    pub calibrated: Scored,
    /// The model with all adopted causes.
    pub extended: Scored,
    /// Models that the data cannot tell from the extended one.
    pub tied: Vec<Scored>,
    /// Fit and held-out runs.
    pub split: Split,
    /// Fitted nuisance parameters.
    pub nuisances: super::fit::Nuisances,
    /// True for the values that counted, runs × values.
    pub used: Vec<Vec<bool>>,
}

/// Diagnoses a plant's measured runs.
///
/// `name` and `quality` (remarks on the data) are passed on to the diagnosis; `roles` fix the roles of runs; `progress` receives the current task in
/// words; `separate` proposes the next measurement for tied models.
///
/// # Errors
/// [`DiagnoseError`] if the nominal model cannot be simulated.
pub fn diagnose(
    plant: &dyn Plant,
    name: &str,
    roles: &[Role],
    quality: Vec<String>,
    progress: &(dyn Fn(&str) + Sync),
    separate: &dyn Fn(&[Model]) -> Option<String>,
) -> Result<Outcome, DiagnoseError> {
    let split = split(plant, roles);
    let mut remarks = Vec::new();
    let resolutions = plant.resolutions();
    let nominal_resolution = resolutions.first().copied().unwrap_or(1.0);
    let start = resolutions.iter().copied().find(|r| *r >= SEARCH_RESOLUTION).unwrap_or(nominal_resolution);
    let mut search = Search { estimator: Estimator::new(plant), split, progress, unexplained: 0.0, limit: f64::INFINITY };

    progress("the nominal model");
    let nominal = search.fitted(&Model::new(Vec::new(), nominal_resolution, true))?;
    progress("constants of the nominal model");
    let mut calibrated = search.calibrated(start)?;
    let spikes = search.estimator.leave_out_spikes(calibrated.model())?;
    if spikes > 0 {
        calibrated = search.calibrated(start)?;
    }
    progress("the noise");
    if search.measure_noise(&calibrated)? {
        calibrated = search.calibrated(start)?;
    }
    let insufficient = insufficient_data(plant, &search.split);
    let Causes { best, trials, replaced, coarse_total, spikes: more, open, nearest, .. } =
        find(&mut search, &calibrated, insufficient.is_some())?;
    if spikes + more > 0 {
        remarks.push(format!("{} single values far off their neighbours' residuals were left out", spikes + more));
    }

    // The refined nominal model: its misfit is what the causes have to explain.
    let bare = search.fitted_at_its_spread(&Model { terms: Vec::new(), ..best.model().clone() })?;
    let mut judged = judge(&search, best, &bare, open, nominal_resolution)?;
    remarks.extend(judged.remark.take());
    // A cause whose interval contains its off value is not named.
    let (mut doubts, mut dropped) = (Vec::new(), None);
    while let Some((index, words)) = doubtful(&search, &judged)? {
        let mut model = judged.best.model().clone();
        dropped = Some(judged.best.model().clone());
        model.terms.remove(index);
        doubts.push(words);
        judged = judge(&search, search.fitted(&model)?, &bare, f64::INFINITY, nominal_resolution)?;
    }
    remarks.extend(doubts.iter().cloned());
    let Judged { best, coarse, refined, left, unexplained_fraction, is_unexplained, intervals, remark: _ } = judged;
    let above = |scored: &Scored| scored.above(search.estimator.count(&search.split.all()));
    progress("tied causes");
    let tied = ties(&search, &best, &replaced, coarse_total);
    let others: Vec<&Term> = tied.iter().filter_map(|(_, trial)| trial.scored.model().terms.last()).collect();
    let combinations = combinations(&search, &best, &others)?;
    let mut effects = Vec::new();
    if refined {
        effects.push(discretisation(&search, &best, &coarse));
    }
    let whole = whole_misfit(&search, &best, &bare)?;
    for (index, term) in best.model().terms.iter().enumerate() {
        effects.push(adopted(&search, &best, index, term, &intervals, &tied)?);
    }
    for effect in &mut effects {
        let is_of = |tried: &Nearest| tried.id == effect.id || effect.curve.is_some();
        let own = nearest.iter().find(|(places, tried)| places.contains(&effect.place.as_str()) && tried.iter().any(is_of));
        effect.nearest = own.map(|(_, tried)| tried.clone()).unwrap_or_default();
    }
    set_roles(&mut effects, whole);
    let physics = effects.iter().filter(|effect| effect.role == Part::Cause && effect.id != "discretisation").count();
    let insufficient = insufficient.or_else(|| if physics == 0 { doubts.first().cloned() } else { None });
    let verdict = match () {
        () if is_unexplained => Verdict::Unexplained,
        () if physics == 0 && insufficient.is_some() && above(&best) > LEFT_OVER => Verdict::Unexplained,
        () if physics == 0 => Verdict::None,
        () if effects.iter().any(|effect| effect.role == Part::Cause && effect.curve.is_some()) => Verdict::Located,
        () if effects.iter().any(|effect| effect.role == Part::Cause && !effect.tied_with.is_empty()) => Verdict::Tied,
        () => Verdict::Named,
    };
    if let Some(insufficient) = insufficient.as_ref().filter(|insufficient| !remarks.contains(insufficient)) {
        remarks.push(insufficient.clone());
    }
    let models: Vec<Model> =
        std::iter::once(best.model().clone()).chain(tied.iter().map(|(_, t)| t.scored.model().clone())).collect();
    let next_experiment = match (verdict, dropped, &insufficient) {
        (Verdict::Tied, ..) => separate(&models),
        // With and without the last cause that was dropped.
        (_, Some(dropped), _) => separate(&[best.model().clone(), dropped]),
        (_, None, Some(_)) => Some(MORE_RUNS.to_owned()),
        _ => None,
    };
    let has_rest = left > LEFT_OVER && unexplained_fraction > SOUGHT;
    let unexplained = if is_unexplained || has_rest {
        super::residual_tests::describe(plant, &search.split, &search.estimator.used, &best.residuals)
    } else {
        Vec::new()
    };

    let stage =
        |scored: &Scored, parameters: Vec<Estimate>| stage(plant, &search.split, &search.estimator.used, scored, parameters);
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
        rmse_heldout_mm: rmse(plant, &search.estimator.used, &trial.scored.plain, &search.split.held),
        delta_bic: trial.scored.bic() - calibrated.bic(),
    };
    let noise = &search.estimator.noise;
    let factor = |channel: usize| noise.factors.get(channel).copied().unwrap_or(1.0);
    let of = |signal: &Signal| -> Vec<f64> { signal.sigmas.iter().zip(&signal.channels).map(|(s, c)| s * factor(*c)).collect() };
    let sigmas: Vec<f64> = plant.signals().iter().flat_map(of).collect();
    let bench = faults::found(&search.estimator, best.model())?;
    let mut quality = quality;
    quality.extend(faults::remarks(&bench, noise, plant));
    let extended = stage(&best, parameters(&best, &intervals));
    let failed = failing(&extended.residual_tests);
    let diagnosis = Diagnosis {
        schema: 2,
        dataset: name.to_owned(),
        verdict,
        complete: verdict != Verdict::Unexplained && failed.is_none() && !has_rest,
        summary: summary(
            verdict,
            &Findings {
                effects: &effects,
                combinations: &combinations,
                place_in_words: &|place| plant.place_in_words(place),
                left: unexplained_fraction,
                has_rest,
                insufficient: insufficient.as_deref(),
                resolution: best.model().resolution,
                refined,
                failing: failed.as_deref(),
            },
        ),
        // Where no structure is left, the share of a small misfit is meaningless: it is limited to the share of the noise.
        unexplained_fraction: if is_unexplained || has_rest {
            unexplained_fraction
        } else {
            unexplained_fraction.min(left.min(1.0))
        },
        unexplained,
        noise_mm: sigmas.iter().sum::<f64>() / sigmas.len().max(1) as f64,
        noise_correlated: noise.correlated,
        noise_correlation_time_s: noise.time_s,
        bench,
        baseline: stage(&nominal, Vec::new()),
        calibrated: stage(&calibrated, parameters(&calibrated, &constants)),
        extended,
        candidates: trials.iter().map(ranked).collect(),
        correlations: intervals.correlations.clone(),
        combinations,
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
        nuisances: search.estimator.nuisances.clone(),
        used: search.estimator.used.clone(),
        split: search.split,
    })
}

/// A model with all causes, and the misfit that it leaves.
struct Judged {
    best: Scored,
    /// The same with the nominal discretisation.
    coarse: Scored,
    /// True if the data need another discretisation than the nominal one.
    refined: bool,
    /// χ² per value above 1.
    left: f64,
    /// The same as a share of the refined nominal model's, at most 1.
    unexplained_fraction: f64,
    /// True if structure is left.
    is_unexplained: bool,
    intervals: Intervals,
    /// The remark that no cause is named, if so.
    remark: Option<String>,
}

/// Judges `best` against `bare`, the refined nominal model: the misfit left, the need of refinement, and the intervals of the causes. `open` is what
/// the model with free forms left (χ² per value above 1): what a name leaves beyond that is known to belong to its place.
fn judge(search: &Search, mut best: Scored, bare: &Scored, open: f64, nominal_resolution: f64) -> Result<Judged, DiagnoseError> {
    let plant = search.estimator.plant;
    let count = search.estimator.count(&search.split.all());
    let above = |scored: &Scored| scored.above(count);
    let (left, whole) = (above(&best), above(bare));
    let unexplained_fraction = if whole > 0.0 { (left / whole).min(1.0) } else { 0.0 };
    let is_cause = |term: &&Term| !plant.candidates()[term.candidate].is_constant;
    let cause_count = best.model().terms.iter().filter(is_cause).count().max(2) as f64 - 1.0;
    let least = left.min(open);
    let is_unexplained = least > LEFT_OVER && least > LEFT_SHARE / cause_count * whole;
    let unnamed = is_unexplained && unexplained_fraction > NOTHING_NAMED;
    let mut remark = None;
    if unnamed && !best.model().terms.is_empty() {
        let names: Vec<_> = best.model().terms.iter().map(|term| search.id(term.candidate)).collect();
        remark = Some(format!(
            "no cause is named: the best model, with {}, leaves {:.0} % of the misfit",
            names.join(" and "),
            100.0 * unexplained_fraction
        ));
        best = bare.clone();
    }

    // The nominal discretisation is kept unless the data need another.
    let coarse = search.fitted(&Model { resolution: nominal_resolution, ..best.model().clone() })?;
    let refined = best.model().resolution != nominal_resolution && search.is_worth(&best, &coarse);
    if best.model().resolution != nominal_resolution && !refined && above(&coarse) <= above(&best) + 0.01 {
        best = coarse.clone();
    }

    let mut numerics = numerics(search, &best)?;
    // Unexplained structure may bias the coordinates, at most by its share of what the causes explain.
    let free = best.model().terms.iter().flat_map(|term| {
        let parameters = &plant.candidates()[term.candidate].parameters;
        term.x.iter().zip(parameters).map(|(x, p)| x - p.off.unwrap_or(*x))
    });
    for (numerics, distance) in numerics.iter_mut().zip(free) {
        *numerics = numerics.hypot(distance * unexplained_fraction.sqrt());
    }
    let intervals = intervals_of(search, &best, &numerics)?;
    Ok(Judged { best, coarse, refined, left, unexplained_fraction, is_unexplained, intervals, remark })
}

/// A term that the data do not tell from its absence, the least certain one if there are several, with a remark in words.
///
/// The 95 % intervals of all its parameters with an off value contain that value. Several such parameters may compensate each other, so χ² without the
/// term has to agree.
fn doubtful(search: &Search, judged: &Judged) -> Result<Option<(usize, String)>, DiagnoseError> {
    let Judged { best, intervals, .. } = judged;
    let mut first = 0;
    let mut found: Option<(f64, usize, String)> = None;
    for (index, term) in best.model().terms.iter().enumerate() {
        let own = first..first + term.x.len();
        first = own.end;
        let candidate = &search.estimator.plant.candidates()[term.candidate];
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
            "the data are insufficient to name a cause: they are explained as well without {} ({}), whose interval contains the value at which it has \
             no effect",
            names::cause(candidate.id),
            numbers.join("; ")
        );
        if found.as_ref().is_none_or(|(least, ..)| gain < *least) {
            found = Some((gain, index, words));
        }
    }
    Ok(found.map(|(_, index, words)| (index, words)))
}

/// Result of the search.
struct Causes {
    /// The model with all causes, after the final refit.
    best: Scored,
    /// The candidates on top of re-tuned constants, best first.
    trials: Vec<Trial>,
    /// Replacements of every cause: the index of the term, and the trial.
    replaced: Vec<(usize, Trial)>,
    /// χ² of the best model before the final refit, with which replacements are compared.
    coarse_total: f64,
    /// Number of single values that were masked.
    spikes: usize,
    /// Share of what re-tuned constants leave that the causes leave before faults of the bench.
    share_left: f64,
    /// χ² per value above 1 of the model with free forms; infinite without any.
    open: f64,
    /// The places of every free form, and the names that were tried in its stead.
    nearest: Vec<(Vec<&'static str>, Vec<Nearest>)>,
}

/// The causes, after the final refit; none where the data are insufficient.
///
/// A cause that differs from run to run, such as a gain that depends on the voltage, looks like a fault of the bench, and many small faults look like a
/// cause. So causes are selected first without the bench's faults in the way. If faults are left after that, they are selected again with faults in
/// the way, and the less costly model counts.
fn find(search: &mut Search, calibrated: &Scored, is_insufficient: bool) -> Result<Causes, DiagnoseError> {
    let before = (search.estimator.state(), search.split.clone());
    let without = search.estimator.given_spread();
    let has_faults = calibrated.model().spread != without;
    search.estimator.held_spread = has_faults.then_some(without);
    let start = if has_faults {
        search.settle(search.fitted(&Model { spread: without, ..calibrated.model().clone() })?)?
    } else {
        calibrated.clone()
    };
    search.set_unexplained(&start);
    // Two causes that cost more than the bench's faults alone are not what is missing where these leave next to nothing.
    let may_be_all = has_faults && search.share_left(calibrated) <= LEFT_SHARE;
    search.limit = if may_be_all { search.cost(calibrated) } else { f64::INFINITY };
    let mut causes = select(search, &start, is_insufficient)?;
    search.limit = f64::INFINITY;
    // Causes that leave next to nothing without any fault are no faults.
    let may_be_faults = has_faults && causes.share_left > SOUGHT;
    if may_be_faults && (causes.best.model().spread != without || search.cost(&causes.best) > search.cost(calibrated)) {
        (search.progress)("causes with faults of the bench in the way");
        let plain = search.cost(&causes.best);
        let after = (search.estimator.state(), search.split.clone());
        search.estimator.restore(before.0);
        search.split = before.1;
        search.set_unexplained(calibrated);
        let other = select(search, calibrated, is_insufficient)?;
        if search.cost(&other.best) <= plain + LEAST_COST {
            causes = other;
        } else {
            search.estimator.restore(after.0);
            search.split = after.1;
            search.set_unexplained(&start);
        }
    }
    // What a name leaves, and what a cause takes, is no fault of the bench.
    search.estimator.held_spread = Some(causes.best.model().spread);
    name_causes(search, &mut causes)?;

    (search.progress)("the final refit");
    let mut best = search.fitted(&Model { fine: true, ..causes.best.model().clone() })?;
    best = search.resolve(best);
    best = search.backward(best)?;
    causes.best = search.settle(best)?;
    Ok(causes)
}

/// Puts names in the stead of free forms where they stand.
fn name_causes(search: &mut Search, causes: &mut Causes) -> Result<(), DiagnoseError> {
    let has_free_forms =
        |search: &Search, scored: &Scored| scored.model().terms.iter().any(|term| search.candidate(term).is_free_form);
    if !has_free_forms(search, &causes.best) {
        return Ok(());
    }
    causes.open = causes.best.above(search.estimator.count(&search.split.all()));
    let before = causes.best.model().clone();
    let Naming { best, nearest } = naming::name(search, causes.best.clone())?;
    causes.nearest = nearest;
    causes.best = search.backward(best)?;
    let ids = |model: &Model| -> Vec<usize> { model.terms.iter().map(|term| term.candidate).collect() };
    if ids(causes.best.model()) != ids(&before) {
        causes.replaced = search.replacements(&causes.best, 4)?;
    }
    causes.coarse_total = causes.best.total();
    Ok(())
}

/// Forward selection, backward elimination and replacement; no causes where the data are insufficient.
fn select(search: &mut Search, calibrated: &Scored, is_insufficient: bool) -> Result<Causes, DiagnoseError> {
    let (mut best, trials) = if is_insufficient {
        (search.fitted(&Model { terms: Vec::new(), ..calibrated.model().clone() })?, Vec::new())
    } else {
        search.forward(calibrated.clone())?
    };
    if search.is_given_up(&best) {
        search.estimator.held_spread = None;
        return Ok(Causes {
            coarse_total: best.total(),
            best,
            trials,
            replaced: Vec::new(),
            spikes: 0,
            share_left: 1.0,
            open: f64::INFINITY,
            nearest: Vec::new(),
        });
    }
    let spikes = search.estimator.leave_out_spikes(best.model())?;
    if spikes > 0 {
        best = search.settle(best)?;
    }
    best = search.resolve(best);
    best = search.backward(best)?;
    best = search.resolve(best);
    let share_left = search.share_left(&best);
    // Faults of the bench could stand in for causes that leave next to nothing without them: they come last then.
    if share_left > SOUGHT && search.estimator.held_spread.take().is_some() {
        best = search.settle(best)?;
        best = search.backward(best)?;
    }

    let mut replaced: Vec<(usize, Trial)> = Vec::new();
    for _ in 0..2 {
        if is_insufficient || best.model().terms.is_empty() {
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
        // A cause in a constant's place lets the constant stay free beside it.
        best = search.with_significant_constants(best)?;
    }
    let faults_come_last = search.estimator.held_spread.take().is_some();
    if search.measure_noise(&best)? || faults_come_last {
        best = search.settle(best)?;
    }
    let coarse_total = best.total();
    Ok(Causes { best, trials, replaced, coarse_total, spikes, share_left, open: f64::INFINITY, nearest: Vec::new() })
}

/// Why the data are insufficient to tell causes apart, if so.
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
    let is_constant = |run: &usize| {
        let inputs = &signals[*run].inputs;
        !plant.moves_unaided(*run) && inputs.iter().all(|u| (u - inputs[0]).abs() < 1e-9)
    };
    let levels: Vec<f64> = signals.iter().filter_map(|signal| signal.inputs.first().copied()).collect();
    if split.all().iter().all(is_constant) && levels.iter().all(|level| (level - levels[0]).abs() < 1e-9) {
        return Some("the voltage is constant and the same in all runs: these data determine no more than an offset".into());
    }
    None
}

/// The parameters of term `index` with their intervals.
fn estimates(search: &Search, index: usize, term: &Term, found: &Intervals) -> Vec<Estimate> {
    let candidate = &search.estimator.plant.candidates()[term.candidate];
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

/// The adopted cause of term `index`, with what it gains on held-out runs.
fn adopted(
    search: &Search,
    best: &Scored,
    index: usize,
    term: &Term,
    found: &Intervals,
    tied: &[(usize, Trial)],
) -> Result<Adopted, DiagnoseError> {
    let candidate = &search.estimator.plant.candidates()[term.candidate];
    (search.progress)(&format!("the gain of {}", candidate.id));
    let mut without = best.model().clone();
    without.terms.remove(index);
    let without = search.fitted_at_its_spread(&without)?;
    let mut tied_with: Vec<String> =
        tied.iter().filter(|(at, _)| *at == index).map(|(_, trial)| search.id(trial.candidate).to_owned()).collect();
    tied_with.sort();
    tied_with.dedup();
    tied_with.retain(|id| id != candidate.id);
    // The actuator was found by trying all of them; other given parameters are the form of the equation.
    let (found_by_trying, form): (Vec<_>, Vec<_>) = candidate.fixed.iter().copied().partition(|(name, _)| *name == "actuator");
    let which = found_by_trying.into_iter().map(|(name, value)| Estimate {
        name: name.to_owned(),
        value,
        unit: String::new(),
        ci95: [Some(value); 2],
        at_bound: false,
    });
    let Standing { stability, is_left_by_law } = standing(search, best, &without, index)?;
    Ok(Adopted {
        id: candidate.id.to_owned(),
        kind: candidate.kind.to_owned(),
        place: candidate.places.first().copied().unwrap_or(candidate.kind).to_owned(),
        cause: candidate.cause.to_owned(),
        parameters: which.chain(estimates(search, index, term, found)).collect(),
        tied_with,
        share: (chi2(&without) - chi2(best)).max(0.0) / search.estimator.count(&search.split.all()) as f64,
        role: if is_left_by_law { Part::Minor } else { Part::Cause },
        stability,
        curve: curve(search, best, index, found),
        nearest: Vec::new(),
        gain_heldout: gain(search, best, &without),
        fixed: form.into_iter().map(|(name, value)| (name.to_owned(), value)).collect(),
    })
}

/// χ² of all runs.
fn chi2(scored: &Scored) -> f64 {
    scored.residuals.iter().map(|r| sum_of_squares(r)).sum()
}

/// χ² per value that all causes together remove from the refined nominal model: with re-tuned constants, or as it is where these are the causes.
fn whole_misfit(search: &Search, best: &Scored, bare: &Scored) -> Result<f64, DiagnoseError> {
    let count = search.estimator.count(&search.split.all()) as f64;
    let is_constant = |term: &Term| search.estimator.plant.candidates()[term.candidate].is_constant;
    if best.model().terms.iter().any(is_constant) {
        return Ok((chi2(bare) - chi2(best)) / count);
    }
    let tuned = search.with_constants(&Model { terms: Vec::new(), ..best.model().clone() });
    Ok((chi2(&search.fitted_at_its_spread(&tuned)?) - chi2(best)) / count)
}

/// Sets the roles of causes, and their shares of `whole`, both χ² per value at first.
fn set_roles(effects: &mut [Adopted], whole: f64) {
    let own: Vec<f64> = effects.iter().map(|effect| effect.share).collect();
    for effect in effects.iter_mut() {
        effect.share = if whole > 0.0 { (effect.share / whole).min(1.0) } else { 0.0 };
    }
    let mut order: Vec<usize> = (0..effects.len()).filter(|k| effects[*k].id != "discretisation").collect();
    order.sort_by(|a, b| effects[*a].share.total_cmp(&effects[*b].share));
    let mut sum = 0.0;
    // What slope of a loop is called its gain is a convention: within the opening of the loop a gain is no cause of its own.
    let value = |id: &str, name: &str| {
        let effect = effects.iter().find(|effect| effect.id == id)?;
        effect.parameters.iter().find(|p| p.name == name).map(|p| p.value)
    };
    let is_convention = match (value("hysteresis", "width"), value("actuation-gain", "scale")) {
        (Some(width), Some(scale)) => (scale - 1.0).abs() < width,
        _ => false,
    };
    for k in order {
        sum += effects[k].share;
        let effect = &mut effects[k];
        if sum <= MINOR_SHARE || own[k] < MINOR_MISFIT || (is_convention && effect.id == "actuation-gain") {
            effect.role = Part::Minor;
        }
    }
}

/// Share of the held-out χ² above the noise that `best` removes from `without`.
fn gain(search: &Search, best: &Scored, without: &Scored) -> f64 {
    let count = search.estimator.count(&search.split.held) as f64;
    let above = without.held - count;
    if above > 0.0 { ((without.held - best.held) / above).clamp(0.0, 1.0) } else { 0.0 }
}

/// The refinement as an adopted cause.
fn discretisation(search: &Search, best: &Scored, coarse: &Scored) -> Adopted {
    let resolutions = search.estimator.plant.resolutions();
    let at = resolutions.iter().position(|r| *r == best.model().resolution).unwrap_or(0);
    let neighbours = [at.saturating_sub(1), (at + 1).min(resolutions.len() - 1)].map(|k| Some(resolutions[k]));
    Adopted {
        id: "discretisation".into(),
        kind: "numerics".into(),
        place: "discretisation".into(),
        cause: "Finitely many joints and a finite time step stand for a continuum.".into(),
        parameters: vec![Estimate {
            name: "motors_per_actuator".into(),
            value: best.model().resolution,
            unit: String::new(),
            ci95: neighbours,
            at_bound: at + 1 == resolutions.len(),
        }],
        tied_with: Vec::new(),
        share: 0.0,
        role: Part::Cause,
        stability: None,
        curve: None,
        nearest: Vec::new(),
        gain_heldout: gain(search, best, coarse),
        fixed: Vec::new(),
    }
}

/// Replacements that the data cannot tell from the cause they replace.
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

/// Root mean square residual of runs, in the plant's unit.
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

/// Errors and residual tests of a model.
fn stage(plant: &dyn Plant, split: &Split, used: &[Vec<bool>], scored: &Scored, parameters: Vec<Estimate>) -> Stage {
    let all = split.all();
    let runs = all.iter().map(|&run| {
        let r = &scored.plain[run];
        let count = used[run].iter().filter(|used| **used).count().max(1) as f64;
        RunError {
            id: plant.signals()[run].id.clone(),
            role: if split.held.contains(&run) { "held-out" } else { "fit" },
            rmse_mm: rmse(plant, used, &scored.plain, &[run]),
            rmse_sigma: (r.iter().map(|r| r * r).sum::<f64>() / count).sqrt(),
        }
    });
    // Jackknife over runs.
    let held = rmse(plant, used, &scored.plain, &split.held);
    let without: Vec<f64> = split
        .held
        .iter()
        .map(|out| rmse(plant, used, &scored.plain, &split.held.iter().copied().filter(|run| run != out).collect::<Vec<_>>()))
        .collect();
    let n = without.len() as f64;
    let mean = without.iter().sum::<f64>() / n.max(1.0);
    let error = ((n - 1.0).max(0.0) / n.max(1.0) * without.iter().map(|value| (value - mean).powi(2)).sum::<f64>()).sqrt();
    Stage {
        rmse_mm: rmse(plant, used, &scored.plain, &all),
        rmse_heldout_mm: held,
        rmse_heldout_ci95_mm: [(held - 1.96 * error).max(0.0), held + 1.96 * error],
        runs: runs.collect(),
        residual_tests: residual_tests(plant, split, used, &scored.residuals),
        parameters,
    }
}
