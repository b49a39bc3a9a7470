//! From a place to a name: the named causes of a place in the stead of its free form.
//!
//! The search adopts a free form where it is worth more than any name: then the place is known and the misfit is taken, whatever the law. Afterwards
//! each named cause of the place is fitted instead. A name stands if it takes at least [`LEAST_TAKEN`] of what the free form takes on runs that no
//! parameter was fitted to (detection, localisation, characterisation: Kerschen, Worden, Vakakis, Golinval 2006).

use super::DiagnoseError;
use super::diagnosis::Nearest;
use super::plant::{Model, Term};
use super::search::{PROMISING_IN_PLACE, Scored, Search};

/// A name stands if it takes this share of what the free form takes on held-out runs.
const LEAST_TAKEN: f64 = 0.95;
/// Named candidates that are fitted in the stead of a free form.
const MOST_NAMES: usize = 5;

/// A model with names where they stand, and the names tried for its free forms, nearest first.
pub struct Naming {
    /// The model.
    pub best: Scored,
    /// The places of every free form, and the names that were tried in its stead, nearest first.
    pub nearest: Vec<(Vec<&'static str>, Vec<Nearest>)>,
}

/// Tries the named causes of every free form's place in its stead.
///
/// # Errors
/// [`DiagnoseError`] if a model without one of its terms cannot be simulated.
pub fn name(search: &mut Search, open: Scored) -> Result<Naming, DiagnoseError> {
    let mut best = open;
    let mut nearest = Vec::new();
    let frees: Vec<Term> = best.model().terms.iter().filter(|term| search.candidate(term).is_free_form).cloned().collect();
    for free in &frees {
        let Some(index) = best.model().terms.iter().position(|term| term.candidate == free.candidate) else { continue };
        let (named, tried) = names(search, &best, index)?;
        nearest.push((search.candidate(free).places.clone(), tried));
        best = named.unwrap_or(best);
    }
    if !frees.is_empty() {
        best = search.settle(best)?;
    }
    Ok(Naming { best, nearest })
}

/// The model with the best name in the stead of term `index`, if one stands, and all that were tried, nearest first.
///
/// Named causes of the same place beside the free form are tried without it, and give way to a single name.
fn names(search: &Search, best: &Scored, index: usize) -> Result<(Option<Scored>, Vec<Nearest>), DiagnoseError> {
    let free = &best.model().terms[index];
    let (id, places) = (search.candidate(free).id, &search.candidate(free).places);
    let of_place = |term: &Term| search.candidate(term).places.iter().any(|place| places.contains(place));
    let is_companion = |term: &Term| term != free && of_place(term) && !search.candidate(term).is_constant;
    let only = |keep: &dyn Fn(&Term) -> bool| {
        let mut model = best.model().clone();
        model.terms.retain(keep);
        model
    };
    let bare = search.fitted(&only(&|term| term != free && !is_companion(term)))?;
    let taken = |scored: &Scored| search.judged(&bare) - search.judged(scored);
    let whole = taken(best).max(f64::MIN_POSITIVE);
    let mut tried: Vec<(f64, &str, Scored)> = Vec::new();
    let mut attempt = |name: &'static str, model: Model| {
        (search.progress)(&format!("{name} in the stead of {id}"));
        // With the model's own constants, then with all.
        for model in [model.clone(), search.with_constants(&model)] {
            let Ok(scored) = search.fitted(&model) else { continue };
            let share = taken(&scored) / whole;
            tried.push((share, name, scored));
            if share >= LEAST_TAKEN {
                break;
            }
        }
    };
    let is_rival = |model: &Model| model.terms.last().is_some_and(|term| !search.candidate(term).is_free_form && of_place(term));
    let screened = search.screen(&bare)?.ranked;
    let own = PROMISING_IN_PLACE * (bare.total() - best.total());
    let rivals: Vec<&(f64, Model)> = screened.iter().filter(|(_, model)| is_rival(model)).collect();
    // The nearest one is shown even if it is far.
    let promising = rivals.iter().enumerate().filter(|(at, (gain, _))| *at == 0 || *gain >= own).map(|(_, rival)| *rival);
    for model in search.finalists(promising, MOST_NAMES) {
        if let Some(term) = model.terms.last() {
            attempt(search.candidate(term).id, model.clone());
        }
    }
    if let Some(companion) = best.model().terms.iter().find(|term| is_companion(term)) {
        attempt(search.candidate(companion).id, only(&|term| term != free));
    }
    tried.sort_by(|a, b| b.0.total_cmp(&a.0));
    let mut nearest: Vec<Nearest> = Vec::new();
    for (share, name, _) in &tried {
        if nearest.iter().all(|other| other.id != *name) {
            nearest.push(Nearest { id: (*name).into(), left: (1.0 - share).clamp(0.0, 1.0) });
        }
    }
    // Of those that stand, and that the runs do not tell from the best of them, the one with the fewest parameters.
    let mut standing: Vec<Scored> =
        tried.into_iter().filter(|(share, ..)| *share >= LEAST_TAKEN).map(|(.., scored)| scored).collect();
    if let Some(least) = standing.iter().min_by(|a, b| a.total().total_cmp(&b.total())).cloned() {
        standing.retain(|other| search.is_tied(&least, other));
    }
    let named = standing.into_iter().min_by_key(Scored::freedom);
    if named.is_some() || !best.model().terms.iter().any(is_companion) {
        return Ok((named, nearest));
    }
    let alone = search.fitted(&only(&|term| !is_companion(term)))?;
    Ok((Some(alone).filter(|alone| taken(alone) >= LEAST_TAKEN * whole), nearest))
}
