//! A cache of what was simulated, in two generations. Fits begin where others ended, and the camera's errors change no motion, so much is asked for twice.

use std::collections::HashMap;
use std::sync::{Arc, Mutex, PoisonError};

/// Values in each of the two generations.
const MOST: usize = 2_000_000;

/// Lists of values by the bits of all that they depend on.
#[derive(Default)]
pub struct Kept {
    generations: Mutex<Generations>,
}

#[derive(Default)]
struct Generations {
    recent: HashMap<Vec<u64>, Arc<Vec<f64>>>,
    older: HashMap<Vec<u64>, Arc<Vec<f64>>>,
    /// Number of values in `recent`.
    values: usize,
}

impl Kept {
    /// The values of `key`, computed if they are not known.
    ///
    /// # Errors
    /// Those of `compute`; nothing is kept then.
    pub fn get_or<E>(&self, key: Vec<u64>, compute: impl FnOnce() -> Result<Vec<f64>, E>) -> Result<Arc<Vec<f64>>, E> {
        let generations = || self.generations.lock().unwrap_or_else(PoisonError::into_inner);
        let known = generations().get(&key);
        if let Some(known) = known {
            return Ok(known);
        }
        let values = Arc::new(compute()?);
        generations().put(key, &values);
        Ok(values)
    }
}

impl Generations {
    fn get(&self, key: &[u64]) -> Option<Arc<Vec<f64>>> {
        self.recent.get(key).or_else(|| self.older.get(key)).cloned()
    }

    fn put(&mut self, key: Vec<u64>, values: &Arc<Vec<f64>>) {
        if self.values > MOST {
            self.older = std::mem::take(&mut self.recent);
            self.values = 0;
        }
        self.values += values.len();
        self.recent.insert(key, values.clone());
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_are_computed_once_and_forgotten_after_two_generations() {
        let kept = Kept::default();
        let is_known = |key: u64| kept.get_or(vec![key], || Err(())).is_ok();
        let put =
            |key: u64, count: usize| assert_eq!(kept.get_or(vec![key], || Ok::<_, ()>(vec![0.0; count])).unwrap().len(), count);
        assert!(!is_known(1));
        put(1, 3);
        assert!(is_known(1) && !is_known(2));
        for key in [2, 3] {
            put(key, MOST);
            assert!(is_known(1), "{key}");
        }
        put(4, MOST);
        assert!(is_known(1));
        put(5, 1);
        assert!(!is_known(1) && is_known(4) && is_known(5));
    }
}
