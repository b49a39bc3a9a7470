//! A voltage table: straight lines between rows, held at both ends.

use thiserror::Error;

/// Rows that make no [`Table`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum TableError {
    /// No rows, or no actuators.
    #[error("the table has no voltages")]
    Empty,
    /// Not one voltage per actuator and row.
    #[error("{voltages} voltages for {rows} rows of {actuators} actuators")]
    Length {
        /// How many voltages there are.
        voltages: usize,
        /// How many times.
        rows: usize,
        /// Voltages per row.
        actuators: usize,
    },
    /// A time that does not rise, or a value that is not finite.
    #[error("row {0} (counting from 0): times must rise from row to row, and all values must be finite")]
    Row(usize),
}

/// Voltages of all actuators at given times.
#[derive(Debug, Clone, PartialEq)]
pub struct Table {
    times: Vec<f64>,
    /// Row after row, one value per actuator.
    voltages: Vec<f64>,
    /// Integrals of the voltages from the first row to every row (V·s).
    integrals: Vec<f64>,
    actuators: usize,
}

/// A time that the mean voltages of successive stretches have reached.
#[derive(Debug, Clone, Default)]
pub(super) struct Reached {
    /// The time (s); none at the beginning.
    time: Option<f64>,
    /// The last row up to it, or the first.
    row: usize,
    /// Integrals of the voltages from the first row to it (V·s).
    integrals: Vec<f64>,
}

impl Table {
    /// Voltages (V), rows × actuators.
    pub fn volts(&self) -> &[f64] {
        &self.voltages
    }

    /// A table of `times.len()` rows of `actuators` voltages (V) each. Times (s) must rise strictly.
    ///
    /// # Errors
    /// [`TableError`] unless there is a row, each with one voltage per actuator, times rise and all values are finite.
    pub fn new(times: Vec<f64>, voltages: Vec<f64>, actuators: usize) -> Result<Self, TableError> {
        if times.is_empty() || actuators == 0 {
            return Err(TableError::Empty);
        }
        if times.len().checked_mul(actuators) != Some(voltages.len()) {
            return Err(TableError::Length { voltages: voltages.len(), rows: times.len(), actuators });
        }
        for (row, (time, values)) in times.iter().zip(voltages.chunks_exact(actuators)).enumerate() {
            let rises = row == 0 || times[row - 1] < *time;
            if !rises || !time.is_finite() || values.iter().any(|v| !v.is_finite()) {
                return Err(TableError::Row(row));
            }
        }
        let mut integrals = vec![0.0; voltages.len()];
        for row in 1..times.len() {
            for a in 0..actuators {
                let (before, at) = ((row - 1) * actuators + a, row * actuators + a);
                let mean = 0.5 * (voltages[before] + voltages[at]);
                integrals[at] = integrals[before] + mean * (times[row] - times[row - 1]);
            }
        }
        Ok(Self { times, voltages, integrals, actuators })
    }

    /// The rows' times (s).
    pub fn times(&self) -> &[f64] {
        &self.times
    }

    /// The voltages (V) of row `row`.
    pub fn row(&self, row: usize) -> &[f64] {
        &self.voltages[row * self.actuators..][..self.actuators]
    }

    /// Writes the mean voltages (V) from `from` to `to` (s) to `out`.
    pub fn mean(&self, from: f64, to: f64, out: &mut [f64]) {
        let ends = [from, to].map(|t| self.integral(t));
        for (a, out) in out.iter_mut().enumerate() {
            *out = (ends[1](a) - ends[0](a)) / (to - from);
        }
    }

    /// [`mean`](Self::mean) for stretches that follow on each other: what was found for the end of the last one is kept in `reached`.
    pub(super) fn mean_onwards(&self, from: f64, to: f64, reached: &mut Reached, out: &mut [f64]) {
        let Reached { time, row, integrals } = reached;
        if *time != Some(from) {
            *row = self.rows_until(from).saturating_sub(1);
            *integrals = (0..self.actuators).map(self.integral_after(*row, from)).collect();
        }
        while self.times.get(*row + 1).is_some_and(|next| *next <= to) {
            *row += 1;
        }
        let end = self.integral_after(*row, to);
        for (a, (out, integral)) in out.iter_mut().zip(integrals).enumerate() {
            let start = std::mem::replace(integral, end(a));
            *out = (*integral - start) / (to - from);
        }
        *time = Some(to);
    }

    /// Number of rows up to time `t` (s): at once for times at equal distances.
    fn rows_until(&self, t: f64) -> usize {
        let last = self.times.len() - 1;
        let share = (t - self.times[0]) / (self.times[last] - self.times[0]);
        let row = ((share * last as f64) as usize).min(last);
        if self.times[row] <= t && self.times.get(row + 1).is_none_or(|next| t < *next) {
            return row + 1;
        }
        self.times.partition_point(|&time| time <= t)
    }

    /// The integral of an actuator's voltage from the first row to `t` (V·s).
    fn integral(&self, t: f64) -> impl Fn(usize) -> f64 + '_ {
        self.integral_after(self.rows_until(t).saturating_sub(1), t)
    }

    /// [`integral`](Self::integral) with the last row up to `t` (s), or the first.
    fn integral_after(&self, row: usize, t: f64) -> impl Fn(usize) -> f64 + '_ {
        let past = t - self.times[row];
        move |a| {
            let at = row * self.actuators + a;
            let next = at + self.actuators;
            // Held before the first and after the last row.
            let slope = match self.voltages.get(next) {
                Some(end) if past > 0.0 => (end - self.voltages[at]) / (self.times[row + 1] - self.times[row]),
                _ => 0.0,
            };
            self.integrals[at] + past * (self.voltages[at] + 0.5 * past * slope)
        }
    }

    /// Writes the voltages (V) at time `t` (s) to `out`.
    pub fn at(&self, t: f64, out: &mut [f64]) {
        let after = self.rows_until(t);
        if after == 0 {
            out.copy_from_slice(self.row(0));
        } else if after == self.times.len() {
            out.copy_from_slice(self.row(after - 1));
        } else {
            let (t0, t1) = (self.times[after - 1], self.times[after]);
            let share = (t - t0) / (t1 - t0);
            for ((out, &v0), &v1) in out.iter_mut().zip(self.row(after - 1)).zip(self.row(after)) {
                *out = v0 + share * (v1 - v0);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_table_is_linear_between_rows_and_held_at_the_ends() {
        let table = Table::new(vec![1.0, 2.0, 4.0], vec![0.0, 10.0, 100.0, 20.0, -100.0, 0.0], 2).unwrap();
        let mut out = [0.0; 2];
        for (t, expected) in
            [(0.0, [0.0, 10.0]), (1.5, [50.0, 15.0]), (2.0, [100.0, 20.0]), (3.0, [0.0, 10.0]), (9.0, [-100.0, 0.0])]
        {
            table.at(t, &mut out);
            assert_eq!(out, expected, "at {t}");
        }
    }

    #[test]
    fn the_mean_is_that_of_the_lines_and_jumps_between() {
        let table = Table::new(vec![0.0, 1.0, 1.0 + 1e-9, 2.0], vec![0.0, 10.0, -10.0, -10.0], 1).unwrap();
        let mut out = [0.0];
        for (from, to, mean) in [(0.0, 1.0, 5.0), (0.5, 1.0, 7.5), (0.9, 1.1, -0.25), (-1.0, 1.0, 2.5), (1.5, 4.0, -10.0)] {
            table.mean(from, to, &mut out);
            assert!((out[0] - mean).abs() < 1e-6, "{from} {to}: {}", out[0]);
        }
    }

    #[test]
    fn means_of_successive_stretches_are_those_of_each() {
        let times: Vec<f64> = (0..40).map(|k| 0.1 * f64::from(k) + 1e-3 * f64::from(k * k)).collect();
        let volts = (0..80).map(|k| 100.0 * f64::from(k).sin()).collect();
        let table = Table::new(times, volts, 2).unwrap();
        for width in [0.01, 0.1, 0.37, 2.0] {
            let (mut reached, mut onwards, mut mean) = (Reached::default(), [0.0; 2], [0.0; 2]);
            for k in -3..700 {
                // Now and then a stretch is left out.
                let [from, to] = [k, k + 1].map(|k| width * f64::from(k));
                if k % 7 != 0 {
                    table.mean_onwards(from, to, &mut reached, &mut onwards);
                    table.mean(from, to, &mut mean);
                    assert_eq!(onwards, mean, "{from} {to}");
                }
            }
        }
    }

    #[test]
    fn a_row_is_found_at_once_or_by_search_alike() {
        let even: Vec<f64> = (0..101).map(|k| 0.1 * f64::from(k)).collect();
        let uneven: Vec<f64> = (0..101).map(|k| (0.07 * f64::from(k)).exp()).collect();
        for times in [even, uneven, vec![2.0]] {
            let table = Table::new(times.clone(), vec![0.0; times.len()], 1).unwrap();
            let between = (-50..5000).map(|k| 0.25 * f64::from(k));
            for t in times.iter().flat_map(|t| [t.next_down(), *t, t.next_up()]).chain(between) {
                assert_eq!(table.rows_until(t), times.iter().filter(|time| **time <= t).count(), "{t}");
            }
        }
    }

    #[test]
    fn rows_out_of_order_or_not_finite_are_refused_by_number() {
        assert_eq!(Table::new(vec![0.0, 0.0], vec![1.0, 2.0], 1), Err(TableError::Row(1)));
        assert_eq!(Table::new(vec![0.0, f64::NAN], vec![1.0, 2.0], 1), Err(TableError::Row(1)));
        assert_eq!(Table::new(vec![0.0, 1.0], vec![f64::INFINITY, 2.0], 1), Err(TableError::Row(0)));
    }

    #[test]
    fn tables_without_rows_or_of_wrong_length_are_refused() {
        assert_eq!(Table::new(Vec::new(), Vec::new(), 1), Err(TableError::Empty));
        assert_eq!(Table::new(vec![0.0], Vec::new(), 0), Err(TableError::Empty));
        let error = Table::new(vec![0.0, 1.0], vec![1.0, 2.0, 3.0], 2).unwrap_err();
        assert_eq!(error.to_string(), "3 voltages for 2 rows of 2 actuators");
    }
}
