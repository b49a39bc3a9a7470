//! From a place to a name: the named causes of a place in the stead of its free form.
//!
//! The search adopts a free form where it is worth more than any name: then the place is known and the misfit is taken, whatever the law. Afterwards
//! each named cause of the place is fitted instead. A name stands if it takes at least [`LEAST_TAKEN`] of what the free form takes on runs that no
//! parameter was fitted to (detection, localisation, characterisation: Kerschen, Worden, Vakakis, Golinval 2006).

use super::DiagnoseError;
use super::diagnosis::Nearest;
use super::plant::Model;
use super::search::{Scored, Search};

/// A name stands if it takes this share of what the free form takes on held-out runs.
const LEAST_TAKEN: f64 = 0.95;
/// Named candidates that are fitted in the stead of a free form.
const MOST_NAMES: usize = 5;

/// A model with names where they stand, and the names tried for its free forms, nearest first.
pub struct Naming {
    /// The model.
    pub best: Scored,
    /// For each term, the names that were tried in the stead of its free form; none for a term that never was one.
    pub nearest: Vec<Vec<Nearest>>,
}

/// Tries the named causes of every free form's place in its stead.
///
/// # Errors
/// [`DiagnoseError`] if a model without one of its terms cannot be simulated.
pub fn name(search: &mut Search, open: Scored) -> Result<Naming, DiagnoseError> {
    let mut best = open;
    let mut nearest = vec![Vec::new(); best.model().terms.len()];
    let mut changed = false;
    for index in 0..best.model().terms.len() {
        if !search.candidate(&best.model().terms[index]).is_free_form {
            continue;
        }
        let (named, tried) = names(search, &best, index)?;
        nearest[index] = tried;
        if let Some(named) = named {
            best = named;
            changed = true;
        }
    }
    if changed {
        best = search.settle(best)?;
    }
    Ok(Naming { best, nearest })
}

/// The best name in the stead of term `index`, if one stands, and all that were tried, nearest first.
fn names(search: &Search, best: &Scored, index: usize) -> Result<(Option<Scored>, Vec<Nearest>), DiagnoseError> {
    let free = &best.model().terms[index];
    let (id, places) = (search.candidate(free).id, &search.candidate(free).places);
    let mut model = best.model().clone();
    model.terms.remove(index);
    let without = search.fitted(&model)?;
    let taken = |scored: &Scored| search.judged(&without) - search.judged(scored);
    let whole = taken(best);
    let screened = search.screen(&without)?.ranked;
    let is_rival = |model: &Model| {
        let last = model.terms.last().map(|term| search.candidate(term));
        last.is_some_and(|c| !c.is_free_form && c.places.iter().any(|place| places.contains(place)))
    };
    let mut tried: Vec<(f64, &str, Scored)> = Vec::new();
    for start in search.finalists(screened.iter().filter(|(_, model)| is_rival(model)), MOST_NAMES) {
        let mut model = start;
        let Some(term) = model.terms.pop() else { continue };
        let name = search.candidate(&term).id;
        (search.progress)(&format!("{name} in the stead of {id}"));
        model.terms.insert(index, term);
        // With the model's own constants, then with all.
        for model in [model.clone(), search.with_constants(&model)] {
            let Ok(scored) = search.fitted(&model) else { continue };
            let share = taken(&scored) / whole.max(f64::MIN_POSITIVE);
            tried.push((share, name, scored));
            if share >= LEAST_TAKEN {
                break;
            }
        }
    }
    tried.sort_by(|a, b| b.0.total_cmp(&a.0));
    let mut nearest: Vec<Nearest> = Vec::new();
    for (share, name, _) in &tried {
        if nearest.iter().all(|other| other.id != *name) {
            nearest.push(Nearest { id: (*name).into(), left: (1.0 - share).clamp(0.0, 1.0) });
        }
    }
    let stands = tried.into_iter().next().filter(|(share, ..)| *share >= LEAST_TAKEN);
    Ok((stands.map(|(.., scored)| scored), nearest))
}
