//! The table of a sweep's results, `results.csv`.

use std::collections::BTreeSet;

use super::{ResultsError, equals, short};
use crate::experiment::Spread;

/// Largest number of panels of a figure.
const PANELS: usize = 20;

/// The rows of `results.csv` with the columns of keys and of measures.
pub(super) struct Table {
    pub(super) header: Vec<String>,
    pub(super) rows: Vec<csv::StringRecord>,
    pub(super) keys: Vec<usize>,
    /// Those of an ensemble by their mean alone; see [`band`](Table::band).
    pub(super) measures: Vec<usize>,
}

impl Table {
    /// Parses `results.csv`.
    pub(super) fn read(text: &str) -> Result<Self, ResultsError> {
        let wrong = |reason: String| ResultsError::Table(reason);
        let mut reader = csv::Reader::from_reader(text.as_bytes());
        let header: Vec<String> = reader.headers().map_err(|error| wrong(error.to_string()))?.iter().map(String::from).collect();
        if header.last().map(String::as_str) != Some("status") {
            return Err(wrong("the last column is not `status`: these are not the results of a sweep".into()));
        }
        let rows = reader.records().collect::<Result<Vec<_>, _>>().map_err(|error| wrong(error.to_string()))?;
        if rows.is_empty() {
            return Err(wrong("there are no rows".into()));
        }
        let (keys, mut measures): (Vec<usize>, Vec<usize>) = (0..header.len() - 1).partition(|&i| header[i].contains('.'));
        let mean = Spread::PREFIXES[0];
        let is_beside_mean = |&column: &usize| {
            let of_spread =
                |prefix: &&str| header[column].strip_prefix(prefix).is_some_and(|name| header.contains(&format!("{mean}{name}")));
            Spread::PREFIXES[1..].iter().any(of_spread)
        };
        measures.retain(|column| !is_beside_mean(column));
        Ok(Self { header, rows, keys, measures })
    }

    /// The columns of the quantiles of 5 and 95 % of a mean.
    pub(super) fn band(&self, measure: usize) -> Option<[usize; 2]> {
        let [mean, _, low, _, high] = Spread::PREFIXES;
        let name = self.header[measure].strip_prefix(mean)?;
        let column = |prefix: &str| self.header.iter().position(|other| *other == format!("{prefix}{name}"));
        Some([column(low)?, column(high)?])
    }

    /// Distinct values of a column: numbers by size, texts in order of appearance.
    pub(super) fn values(&self, column: usize) -> Vec<String> {
        let mut seen = BTreeSet::new();
        let mut values: Vec<_> = self.rows.iter().map(|r| r[column].to_owned()).filter(|v| seen.insert(v.clone())).collect();
        if self.numeric(column) {
            values.sort_by(|a, b| f64::total_cmp(&a.parse().unwrap_or(f64::NAN), &b.parse().unwrap_or(f64::NAN)));
        }
        values
    }

    /// True if every row has a number in the column.
    fn numeric(&self, column: usize) -> bool {
        self.rows.iter().all(|r| number_in(r, column).is_some())
    }

    /// Distinct texts of a column; empty if all are numbers.
    pub(super) fn texts(&self, column: usize) -> Vec<String> {
        if self.numeric(column) { Vec::new() } else { self.values(column) }
    }

    /// Column of a key by its name, or by an unambiguous end of its name.
    fn key(&self, name: &str) -> Result<usize, ResultsError> {
        let exact = self.keys.iter().copied().find(|&key| self.header[key] == name);
        let end = format!(".{name}");
        let mut ends = self.keys.iter().copied().filter(|&key| self.header[key].ends_with(&end));
        let only = match (ends.next(), ends.next()) {
            (Some(key), None) => Some(key),
            _ => None,
        };
        exact.or(only).ok_or_else(|| {
            let keys: Vec<_> = self.keys.iter().map(|&key| self.header[key].as_str()).collect();
            ResultsError::Choice(format!("there is no key {name}; choose from {}", keys.join(", ")))
        })
    }

    /// Keeps the rows with these values of these keys.
    pub(super) fn keep(&mut self, only: &[(String, String)]) -> Result<(), ResultsError> {
        for (name, value) in only {
            let key = self.key(name)?;
            let wanted = value.parse::<f64>().ok();
            let same = |r: &csv::StringRecord| {
                r[key] == *value || wanted.zip(number_in(r, key)).is_some_and(|(a, b)| (a - b).abs() <= 1e-9 * a.abs())
            };
            if !self.rows.iter().any(same) {
                let values = listed(&self.values(key));
                return Err(ResultsError::Choice(format!("no row has {} = {value}; there are {values}", self.header[key])));
            }
            self.rows.retain(same);
        }
        Ok(())
    }

    /// Column of a measure; the first without a name.
    pub(super) fn measure(&self, name: Option<&str>) -> Result<usize, ResultsError> {
        match name {
            None => self.measures.first().copied().ok_or_else(|| ResultsError::Table("there is no measure".into())),
            Some(name) => self.named(name).ok_or_else(|| {
                let names: Vec<_> = self.measures.iter().map(|&i| self.header[i].as_str()).collect();
                ResultsError::Choice(format!("there is no measure {name}; choose from {}", names.join(", ")))
            }),
        }
    }

    /// Column of a measure, of its mean, or of another part of its spread.
    fn named(&self, name: &str) -> Option<usize> {
        let mean = format!("{}{name}", Spread::PREFIXES[0]);
        let all = || (0..self.header.len() - 1).filter(|i| !self.keys.contains(i));
        all().find(|&i| self.header[i] == name).or_else(|| all().find(|&i| self.header[i] == mean))
    }

    /// Keys with a panel for each value: those `asked` for, then those with the fewest values until two are left.
    pub(super) fn panels(&self, varied: &[usize], asked: &[String]) -> Result<Vec<usize>, ResultsError> {
        let mut by = Vec::new();
        for name in asked {
            let key = self.key(name)?;
            if !varied.contains(&key) {
                return Err(ResultsError::Choice(format!("{} has one value only", self.header[key])));
            }
            if !by.contains(&key) {
                by.push(key);
            }
        }
        let left = |by: &[usize]| varied.iter().copied().filter(|key| !by.contains(key)).collect::<Vec<_>>();
        while left(&by).len() > 2 {
            by.extend(left(&by).into_iter().min_by_key(|&key| self.values(key).len()));
        }
        let count: usize = by.iter().map(|&key| self.values(key).len()).product();
        if count > PANELS {
            let axes: Vec<_> =
                varied.iter().map(|&key| format!("{} ({})", self.header[key], listed(&self.values(key)))).collect();
            return Err(ResultsError::Choice(format!(
                "{} keys vary, which takes {count} panels, and a figure has {PANELS} at most: {}; choose rows by --where KEY=VALUE, or \
                 the key of the panels by --by KEY",
                varied.len(),
                axes.join(", ")
            )));
        }
        Ok(by)
    }

    /// Values of a measure over the key `x`, by rising x; texts stand at their index.
    pub(super) fn curve(&self, rows: &[&csv::StringRecord], x: usize, measure: usize) -> Vec<(f64, f64)> {
        let texts = self.texts(x);
        let place = |r: &csv::StringRecord| {
            let of_text = texts.iter().position(|text| *text == r[x]).map(|i| i as f64);
            of_text.or_else(|| number_in(r, x)).unwrap_or(f64::NAN)
        };
        let mut points: Vec<_> = rows.iter().map(|r| (place(r), number_in(r, measure).unwrap_or(f64::NAN))).collect();
        points.sort_by(|a, b| a.0.total_cmp(&b.0));
        points
    }

    /// The keys that do not vary, and the number of missing values.
    pub(super) fn setting(&self, fixed: &[usize], measures: &[usize]) -> String {
        let mut parts: Vec<String> = fixed.iter().map(|&key| equals(&self.header[key], &self.rows[0][key])).collect();
        let lacks = |r: &&csv::StringRecord| measures.iter().any(|&m| number_in(r, m).is_none());
        let missing = self.rows.iter().filter(lacks).count();
        if missing > 0 {
            parts.push(format!("{missing} of {} runs without a value", self.rows.len()));
        }
        parts.join(", ")
    }
}

/// The number in a column; `None` for other texts and for numbers beyond 1e100.
pub(super) fn number_in(record: &csv::StringRecord, column: usize) -> Option<f64> {
    // Beyond 1e100, as in curves, values cannot be scaled to the page.
    record.get(column).and_then(|text| text.parse::<f64>().ok()).filter(|value| value.abs() < 1e100)
}

/// The first values of a list, and their number if there are more.
fn listed(values: &[String]) -> String {
    const MOST: usize = 12;
    let some: Vec<_> = values.iter().take(MOST).map(|v| short(v)).collect();
    if values.len() > MOST { format!("{}, … {} in all", some.join(", "), values.len()) } else { some.join(", ") }
}
