//! Interpolation of sampled commands: cubic splines where rows are smooth, straight lines elsewhere, and jumps.
//!
//! A sine joined by straight lines loses (π f Δt)²/3 of its amplitude, eight times a camera's noise at 25 Hz and 2 ms. A jump happened at an unknown
//! time between two rows: [`Command::jumps`] lists these, and their times are nuisance parameters of the run.

use super::quality::median_interval;
use crate::drive::Table;
use crate::experiment::hermite_at;

/// A change between two rows is a jump if it exceeds the neighbouring changes by this factor and by this voltage (V).
const JUMP_RATIO: f64 = 5.0;
const JUMP_LEAST: f64 = 5.0;
/// A bend at a row is a kink if it exceeds the bends two rows away by this factor.
const KINK_RATIO: f64 = 8.0;
/// Least bend of a curved row (V): commands are rounded to about 0.01 V.
const STRAIGHT: f64 = 0.05;
/// Points of a spline between two rows.
const BETWEEN: usize = 8;

/// A run's sampled command.
#[derive(Debug, Clone)]
pub struct Command {
    times: Vec<f64>,
    /// Rows × actuators (V).
    volts: Vec<f64>,
    actuators: usize,
    /// Rows after which some voltage jumps.
    jumps: Vec<usize>,
}

impl Command {
    /// A command of rising `times` (s) and `volts` (V), rows × actuators.
    pub fn new(times: &[f64], volts: &[f64], actuators: usize) -> Self {
        let rows = times.len();
        let change =
            |row: usize, actuator: usize| (volts[(row + 1) * actuators + actuator] - volts[row * actuators + actuator]).abs();
        let is_jump = |row: usize| {
            (0..actuators).any(|a| {
                let before = if row > 0 { change(row - 1, a) } else { 0.0 };
                let after = if row + 2 < rows { change(row + 1, a) } else { 0.0 };
                change(row, a) > JUMP_LEAST + JUMP_RATIO * before.max(after)
            })
        };
        let jumps = (0..rows.saturating_sub(1)).filter(|row| is_jump(*row)).collect();
        Self { times: times.to_vec(), volts: volts.to_vec(), actuators, jumps }
    }

    /// The rows after which there is a jump.
    pub fn jumps(&self) -> &[usize] {
        &self.jumps
    }

    /// The interval (s) in which jump `index` took place.
    pub fn jump_interval(&self, index: usize) -> [f64; 2] {
        let row = self.jumps[index];
        [self.times[row], self.times[row + 1]]
    }

    /// The interpolated command times 1 + `gain`, with each jump after the given share (0 to 1) of its interval.
    pub fn table(&self, shares: &[f64], gain: f64) -> Table {
        let (mut times, mut volts) = (Vec::new(), Vec::new());
        let mut first = 0;
        let ends = self.jumps.iter().copied().chain([self.times.len() - 1]);
        for (piece, last) in ends.enumerate() {
            // Each piece between two jumps is extended to them by its end values.
            if piece > 0 {
                let [from, to] = self.jump_interval(piece - 1);
                let at = (from + shares[piece - 1].clamp(0.0, 1.0) * (to - from)).max(from + 2e-9);
                let held: Vec<f64> = volts[volts.len() - self.actuators..].to_vec();
                times.push(at - 1e-9);
                volts.extend(held);
                if at < self.times[first] - 1e-9 {
                    times.push(at);
                    volts.extend_from_slice(&self.volts[first * self.actuators..][..self.actuators]);
                }
            }
            self.smooth(first, last, &mut times, &mut volts);
            first = last + 1;
        }
        if gain != 0.0 {
            volts.iter_mut().for_each(|v| *v *= 1.0 + gain);
        }
        Table::new(times, volts, self.actuators).unwrap_or_else(|_| {
            // Rows closer than a jump's width: the rows without it rise.
            Table::new(self.times.clone(), self.volts.clone(), self.actuators).unwrap_or_else(|_| unreachable!("rows rise"))
        })
    }

    /// Appends the rows `first..=last`, with points of a spline between curved ones.
    fn smooth(&self, first: usize, last: usize, times: &mut Vec<f64>, volts: &mut Vec<f64>) {
        let curved: Vec<Vec<Option<f64>>> = (0..self.actuators).map(|a| self.slopes(first, last, a)).collect();
        for row in first..=last {
            times.push(self.times[row]);
            volts.extend_from_slice(&self.volts[row * self.actuators..][..self.actuators]);
            if row == last {
                break;
            }
            let at = row - first;
            if curved.iter().all(|slopes| slopes[2 * at].is_none()) {
                continue;
            }
            let [t0, t1] = [self.times[row], self.times[row + 1]];
            for k in 1..=BETWEEN {
                let s = k as f64 / (BETWEEN + 1) as f64;
                times.push(t0 + s * (t1 - t0));
                for (a, slopes) in curved.iter().enumerate() {
                    let [v0, v1] = [row, row + 1].map(|row| self.volts[row * self.actuators + a]);
                    let value = match (slopes[2 * at], slopes[2 * at + 1]) {
                        (Some(m0), Some(m1)) => hermite_at(s, t1 - t0, [v0, m0], [v1, m1]),
                        _ => v0 + s * (v1 - v0),
                    };
                    volts.push(value);
                }
            }
        }
    }

    /// Slopes (V/s) of the spline at both ends of every interval between rows `first` and `last`; none for straight rows. Splines end at kinks.
    fn slopes(&self, first: usize, last: usize, actuator: usize) -> Vec<Option<f64>> {
        let n = last - first;
        let t: Vec<f64> = self.times[first..=last].to_vec();
        let v: Vec<f64> = (first..=last).map(|row| self.volts[row * self.actuators + actuator]).collect();
        // Distance of a row from the line through its neighbours (V).
        let bend = |i: usize| {
            if i == 0 || i >= n {
                return 0.0;
            }
            let s = (t[i] - t[i - 1]) / (t[i + 1] - t[i - 1]);
            (v[i] - v[i - 1] - s * (v[i + 1] - v[i - 1])).abs()
        };
        let mut slopes = vec![None; 2 * n];
        let is_kink = |i: usize| {
            let neighbours = bend(i.saturating_sub(2)).max(bend(i + 2));
            bend(i) > STRAIGHT && bend(i) > KINK_RATIO * neighbours
        };
        let mut from = 0;
        for i in 1..=n {
            if i < n && !is_kink(i) {
                continue;
            }
            if i - from >= 3 && (from + 1..i).any(|k| bend(k) > 0.2 * STRAIGHT) {
                let m = spline(&t[from..=i], &v[from..=i]);
                for k in from..i {
                    (slopes[2 * k], slopes[2 * k + 1]) = (Some(m[k - from]), Some(m[k + 1 - from]));
                }
            }
            from = i;
        }
        slopes
    }
}

/// Slopes (V/s) of the cubic spline through the rows, by Thomas's algorithm. At its ends it follows the parabolas through the first and last three
/// rows, which keeps the curvature of a sine that begins at its turning point.
fn spline(t: &[f64], v: &[f64]) -> Vec<f64> {
    let n = t.len();
    let (h, d): (Vec<f64>, Vec<f64>) = (1..n).map(|i| (t[i] - t[i - 1], (v[i] - v[i - 1]) / (t[i] - t[i - 1]))).unzip();
    let (mut diagonal, mut upper, mut right) = (vec![1.0; n], vec![0.0; n], vec![0.0; n]);
    let mut lower = vec![0.0; n];
    right[0] = d[0] - h[0] * (d[1] - d[0]) / (h[0] + h[1]);
    right[n - 1] = d[n - 2] + h[n - 2] * (d[n - 2] - d[n - 3]) / (h[n - 2] + h[n - 3]);
    for i in 1..n - 1 {
        lower[i] = h[i];
        diagonal[i] = 2.0 * (h[i - 1] + h[i]);
        upper[i] = h[i - 1];
        right[i] = 3.0 * (h[i] * d[i - 1] + h[i - 1] * d[i]);
    }
    for i in 1..n {
        let factor = lower[i] / diagonal[i - 1];
        diagonal[i] -= factor * upper[i - 1];
        right[i] -= factor * right[i - 1];
    }
    let mut slopes = right;
    slopes[n - 1] /= diagonal[n - 1];
    for i in (0..n - 1).rev() {
        slopes[i] = (slopes[i] - upper[i] * slopes[i + 1]) / diagonal[i];
    }
    slopes
}

/// A row is unpredictable if the cubic through its four neighbours misses it by this share of their range, as with a sine of fewer than five rows per
/// period.
const MISSED: f64 = 0.15;
/// Least range of five neighbouring rows, as a share of the run's, that counts as motion.
const MOVING: f64 = 0.1;
/// Most unpredictable rows among [`TOGETHER`] successive ones: a corner or edge costs one to three.
const MOST_MISSED: usize = 8;
const TOGETHER: usize = 20;
/// A gap exceeds the median interval by this factor; ...
const GAP: f64 = 3.0;
/// ... within it the voltage may change by this share of the run's range.
const WITHIN_GAP: f64 = 0.5;

/// Why the voltages `volts` (V, rows × actuators) are not known between rows at `times` (s), if so: they change too much from row to row, or across a
/// gap.
pub fn too_coarse(times: &[f64], volts: &[f64], actuators: usize) -> Option<String> {
    let command = Command::new(times, volts, actuators);
    let rows = times.len();
    let usual = median_interval(times)?;
    let needed = "record the voltage at least ten times per period of the drive";
    for actuator in 0..actuators {
        let v: Vec<f64> = volts.iter().skip(actuator).step_by(actuators).copied().collect();
        let swing = |part: &[f64]| {
            let (low, high) = part.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| (low.min(*v), high.max(*v)));
            high - low
        };
        let range = swing(&v);
        let is_missed = |i: usize| {
            let stencil = i - 2..i + 3;
            let moved = swing(&v[stencil.clone()]);
            if moved < (MOVING * range).max(JUMP_LEAST) || command.jumps.iter().any(|row| (i - 2..i + 2).contains(row)) {
                return false;
            }
            // Lagrange's cubic through the four neighbours, at their own times.
            let neighbours = stencil.filter(|k| *k != i);
            let cubic: f64 = neighbours
                .clone()
                .map(|k| {
                    v[k] * neighbours
                        .clone()
                        .filter(|j| *j != k)
                        .map(|j| (times[i] - times[j]) / (times[k] - times[j]))
                        .product::<f64>()
                })
                .sum();
            (v[i] - cubic).abs() > MISSED * moved
        };
        let missed: Vec<usize> = (2..rows.saturating_sub(2)).filter(|i| is_missed(*i)).collect();
        if let Some(from) =
            missed.windows(MOST_MISSED).find(|some| some[MOST_MISSED - 1] - some[0] < TOGETHER).map(|some| some[0])
        {
            return Some(format!(
                "v{}_v changes too much from row to row to be known between them, from t_s = {} on, at {:.1} rows per second; {needed}, or it may be \
                 taken for a slower one",
                actuator + 1,
                times[from],
                1.0 / usual
            ));
        }
        for row in 1..rows.saturating_sub(2) {
            let slope = |k: usize| ((v[k + 1] - v[k]) / (times[k + 1] - times[k])).abs();
            let gap = times[row + 1] - times[row];
            if gap > GAP * usual && range > JUMP_LEAST && slope(row - 1).max(slope(row + 1)) * gap > WITHIN_GAP * range {
                return Some(format!(
                    "v{}_v moves while there is no row from t_s = {} to {}, against {:.1} rows per second elsewhere, and is not known there; {needed}, or split the \
                     run at the gap",
                    actuator + 1,
                    times[row],
                    times[row + 1],
                    1.0 / usual
                ));
            }
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::PI;

    fn sampled(n: usize, dt: f64, v: impl Fn(f64) -> f64) -> Command {
        let times: Vec<f64> = (0..n).map(|i| i as f64 * dt).collect();
        let volts: Vec<f64> = times.iter().map(|t| (100.0 * v(*t)).round() / 100.0).collect();
        Command::new(&times, &volts, 1)
    }

    fn at(table: &Table, t: f64) -> f64 {
        let mut out = [0.0];
        table.at(t, &mut out);
        out[0]
    }

    #[test]
    fn a_sine_keeps_its_amplitude_between_rows() {
        let v = |t: f64| -750.0 * (1.0 - (2.0 * PI * 25.0 * t).cos());
        let command = sampled(200, 2e-3, v);
        assert!(command.jumps().is_empty());
        let table = command.table(&[], 0.0);
        for i in 0..3900 {
            let t = i as f64 * 1e-4;
            // Straight lines between rows would be off by 9 V. Near the start the spline's end condition costs more.
            let allowed = if t < 0.01 { 3.0 } else { 0.5 };
            assert!((at(&table, t) - v(t)).abs() < allowed, "{t}: {} {}", at(&table, t), v(t));
        }
    }

    #[test]
    fn a_voltage_that_is_not_known_between_its_rows_is_refused_and_others_are_not() {
        let refused = |rate: f64, uneven: f64, v: &dyn Fn(f64) -> f64| {
            let times: Vec<f64> = (0..240).map(|i| (f64::from(i) + uneven * (f64::from(i) * 7.3).sin()) / rate).collect();
            let volts: Vec<f64> = times.iter().map(|t| v(*t)).collect();
            too_coarse(&times, &volts, 1)
        };
        let sine = |f: f64| move |t: f64| -750.0 * (1.0 - (2.0 * PI * f * t).cos());
        let square = |f: f64| move |t: f64| if (f * t).fract() < 0.5 { 0.0 } else { -900.0 };
        let triangle = |f: f64| move |t: f64| 1500.0 * ((f * t).fract() - 0.5).abs();
        for uneven in [0.0, 0.3] {
            for (rate, f) in [(30.0, 18.0), (30.0, 12.0), (40.0, 18.0), (80.0, 18.0), (30.0, 14.9)] {
                let found = refused(rate, uneven, &sine(f)).unwrap_or_else(|| panic!("{rate} {f} {uneven}"));
                assert!(found.contains("rows per second"), "{found}");
            }
            for (rate, f) in [(500.0, 25.0), (180.0, 18.0), (120.0, 18.0), (500.0, 0.1), (200.0, 0.0)] {
                assert_eq!(refused(rate, uneven, &sine(f)), None, "{rate} {f} {uneven}");
            }
            for f in [0.1, 1.0, 7.0] {
                assert_eq!(
                    (refused(200.0, uneven, &square(f)), refused(200.0, uneven, &triangle(f))),
                    (None, None),
                    "{f} {uneven}"
                );
            }
        }
        // A driver's log of a square wave, rounded by a lag of a row, and a log of a constant voltage with noise.
        let lagged = |t: f64| -900.0 * (1.0 - (-(200.0 * t % 40.0)).exp()) * if (2.5 * t).fract() < 0.5 { 1.0 } else { 0.0 };
        assert_eq!(refused(200.0, 0.0, &lagged), None);
        assert_eq!(refused(200.0, 0.0, &|t| 1.5 * (1e5 * t * t).sin()), None);
        // A gap while the voltage moves, and one while it rests.
        let with_gap = |from: usize, to: usize, v: &dyn Fn(f64) -> f64| {
            let times: Vec<f64> = (0..200).filter(|i| *i < from || *i > to).map(|i| f64::from(i as u32) / 200.0).collect();
            let volts: Vec<f64> = times.iter().map(|t| v(*t)).collect();
            too_coarse(&times, &volts, 1)
        };
        assert!(with_gap(50, 80, &sine(5.0)).unwrap().contains("no row from"));
        assert_eq!(with_gap(50, 53, &sine(1.0)), None);
        assert_eq!(with_gap(50, 80, &|t| if t < 0.1 { 0.0 } else { -900.0 }), None);
    }

    #[test]
    fn a_triangle_stays_straight_up_to_its_corners() {
        let v = |t: f64| 975.0 * (1.0 - (t - 1.0).abs());
        let command = sampled(101, 0.02, v);
        assert!(command.jumps().is_empty());
        let table = command.table(&[], 0.0);
        for i in 0..2000 {
            let t = i as f64 * 1e-3;
            assert!((at(&table, t) - v(t)).abs() < 0.01, "{t}");
        }
    }

    #[test]
    fn a_jump_takes_place_at_once_where_it_is_put() {
        let command = sampled(20, 0.01, |t| if t < 0.095 { 0.0 } else { -900.0 });
        assert_eq!(command.jumps(), [9]);
        for share in [0.0, 0.3, 1.0] {
            let table = command.table(&[share], 0.0);
            let moment = 0.09 + 0.01 * share;
            assert_eq!((at(&table, moment - 1e-5), at(&table, moment + 1e-5)), (0.0, -900.0), "{share}");
        }
    }
}
