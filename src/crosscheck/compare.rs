//! Bitwise comparison of two recordings.

use serde::Serialize;

use super::{POSITION_TOLERANCE, VELOCITY_TOLERANCE};
use crate::recording::Recording;

/// Share of a quantity's largest value from which differences are counted in units in the last place.
pub const FAR: f64 = 1e-3;

/// Difference of a quantity between two recordings.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Difference {
    /// Number of values with different bits.
    pub values: usize,
    /// Largest difference in units in the last place, of pairs that both exceed [`FAR`] of the quantity's largest value: closer to zero the count is
    /// meaningless. `None` if no such pair differs.
    pub largest_ulp: Option<u64>,
    /// Largest difference in the quantity's unit; NaN if one side is not a number.
    pub largest: f64,
    /// Step of the first difference, counting from 0.
    pub first_step: u64,
    /// Joint or node of the first difference: joints count from 1, nodes from 0; 0 for the time.
    pub first_place: usize,
}

/// The comparison of one quantity.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Quantity {
    /// Name.
    pub name: &'static str,
    /// Unit.
    pub unit: &'static str,
    /// Number of values compared.
    pub values: usize,
    /// Largest allowed difference, in the quantity's unit; 0 for equal bits.
    pub tolerance: f64,
    /// The difference, if the bits are not all equal.
    pub difference: Option<Difference>,
    /// True if the difference is within the tolerance.
    pub passes: bool,
}

/// The comparison of two recordings.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Report {
    /// True if all quantities pass.
    pub passes: bool,
    /// Sizes or settings that differ, which prevents a comparison of values.
    pub mismatch: Vec<String>,
    /// The quantities.
    pub quantities: Vec<Quantity>,
}

/// Compares `ours` with `theirs`.
pub fn compare(ours: &Recording, theirs: &Recording) -> Report {
    let mismatch = mismatch(ours, theirs);
    if !mismatch.is_empty() {
        return Report { passes: false, mismatch, quantities: Vec::new() };
    }
    let joints = ours.joints();
    let nodes = 3 * ours.nodes();
    let step = |record: usize| ((ours.time[record] / ours.meta.time_step).round()) as u64;
    let length = ours.meta.actuators as f64 * ours.meta.actuator_length;
    let position_tolerance = POSITION_TOLERANCE * (length / 50.0).max(1.0);
    let quantity = |name, unit, tolerance, width: usize, per_place: usize, first_number, a: &[f64], b: &[f64]| {
        let difference = difference(a, b).map(|(mut difference, index)| {
            difference.first_step = step(index / width);
            difference.first_place = (index % width) / per_place + first_number;
            difference
        });
        let passes = difference.as_ref().is_none_or(|d| d.largest <= tolerance);
        Quantity { name, unit, values: a.len(), tolerance, difference, passes }
    };
    let quantities = vec![
        quantity("time", "s", 0.0, 1, 1, 0, &ours.time, &theirs.time),
        quantity("joint angles", "rad", 0.0, joints, 1, 1, &ours.angles, &theirs.angles),
        quantity("joint rates", "rad/s", 0.0, joints, 1, 1, &ours.rates, &theirs.rates),
        quantity("joint torques", "dyn cm", 0.0, joints, 1, 1, &ours.torques, &theirs.torques),
        quantity("motor voltages", "V", 0.0, joints, 1, 1, &ours.motor_voltages, &theirs.motor_voltages),
        quantity("node positions", "cm", position_tolerance, nodes, 3, 0, &ours.positions, &theirs.positions),
        quantity("node velocities", "cm/s", VELOCITY_TOLERANCE, nodes, 3, 0, &ours.velocities, &theirs.velocities),
    ];
    Report { passes: quantities.iter().all(|q| q.passes), mismatch, quantities }
}

/// Sizes and settings that differ.
fn mismatch(ours: &Recording, theirs: &Recording) -> Vec<String> {
    let (a, b) = (&ours.meta, &theirs.meta);
    let mut found = Vec::new();
    let mut check = |what: &str, ours: String, theirs: String| {
        if ours != theirs {
            found.push(format!("{what}: {ours} here, {theirs} there"));
        }
    };
    check("actuators (N)", a.actuators.to_string(), b.actuators.to_string());
    check("motors per actuator (m)", a.motors_per_actuator.to_string(), b.motors_per_actuator.to_string());
    check("time step (s)", format!("{:?}", a.time_step), format!("{:?}", b.time_step));
    check("steps", a.steps.to_string(), b.steps.to_string());
    check("steps between records", a.record_every.to_string(), b.record_every.to_string());
    check("records", ours.len().to_string(), theirs.len().to_string());
    found
}

/// Difference of two arrays of equal length, with its first index. +0 and −0 are equal, as in numpy; PyBullet does not keep the sign of zero.
fn difference(a: &[f64], b: &[f64]) -> Option<(Difference, usize)> {
    let mut found: Option<(Difference, usize)> = None;
    let far = FAR * a.iter().chain(b).fold(0.0_f64, |most, value| most.max(value.abs()));
    for (index, (&a, &b)) in a.iter().zip(b).enumerate() {
        if a.to_bits() == b.to_bits() || a == b {
            continue;
        }
        let (difference, _) = found
            .get_or_insert((Difference { values: 0, largest_ulp: None, largest: 0.0, first_step: 0, first_place: 0 }, index));
        difference.values += 1;
        if a.abs() >= far && b.abs() >= far {
            difference.largest_ulp = difference.largest_ulp.max(Some(ulps(a, b)));
        }
        let size = (a - b).abs();
        // max() would drop a NaN.
        if size.is_nan() || difference.largest.is_nan() {
            difference.largest = f64::NAN;
        } else {
            difference.largest = difference.largest.max(size);
        }
    }
    found
}

/// Number of representable numbers from `a` to `b`.
fn ulps(a: f64, b: f64) -> u64 {
    // Order-preserving map of floats to integers.
    let order = |x: f64| {
        let bits = x.to_bits().cast_signed();
        if bits < 0 { i64::MIN - bits } else { bits }
    };
    order(a).abs_diff(order(b))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::recording::Meta;

    fn recording() -> Recording {
        Recording {
            meta: Meta { time_step: 0.5, steps: 4, record_every: 2, actuators: 1, motors_per_actuator: 2, ..Meta::default() },
            time: vec![0.0, 0.5, 1.5],
            angles: vec![0.1, 0.2, 0.3, 0.4, 0.5, 0.6],
            rates: vec![0.0; 6],
            torques: vec![0.0; 6],
            motor_voltages: vec![0.0; 6],
            positions: vec![0.0; 36],
            velocities: vec![0.0; 36],
            node_velocities: Vec::new(),
        }
    }

    #[test]
    fn ulps_count_representable_numbers_across_zero() {
        assert_eq!(ulps(1.0, 1.0 + f64::EPSILON), 1);
        assert_eq!(ulps(-f64::from_bits(1), f64::from_bits(2)), 3);
    }

    #[test]
    fn one_bit_in_one_angle_fails_and_is_located() {
        let mut other = recording();
        assert!(compare(&recording(), &other).passes);
        other.angles[5] = f64::from_bits(other.angles[5].to_bits() + 1);
        let report = compare(&recording(), &other);
        assert!(!report.passes);
        let d = report.quantities.iter().find(|q| q.name == "joint angles").unwrap().difference.clone().unwrap();
        assert_eq!((d.values, d.largest_ulp, d.first_step, d.first_place), (1, Some(1), 3, 2));
    }

    #[test]
    fn near_zero_no_units_in_the_last_place_are_counted() {
        let mut other = recording();
        // 1e-12 is 4·10¹⁸ units from zero; the largest angle is 0.6.
        other.angles[0] = 1e-12;
        let angles = |other: &Recording| compare(&recording(), other).quantities[1].difference.clone().unwrap();
        assert_eq!((angles(&other).values, angles(&other).largest_ulp), (1, None));
        other.angles[4] += f64::EPSILON;
        assert_eq!((angles(&other).values, angles(&other).largest_ulp), (2, Some(2)));
        other.angles[4] = f64::NAN;
        assert!(angles(&other).largest.is_nan() && angles(&other).largest_ulp.is_none());
    }

    #[test]
    fn positions_pass_within_their_tolerance_and_nan_never_does() {
        let mut other = recording();
        other.positions[7] = 9e-6;
        assert!(compare(&recording(), &other).passes);
        other.positions[7] = 1.1e-5;
        assert!(!compare(&recording(), &other).passes);
        other.positions[7] = f64::NAN;
        assert!(!compare(&recording(), &other).passes);
    }

    #[test]
    fn other_sizes_or_settings_are_named_instead_of_compared() {
        let mut other = recording();
        other.meta.time_step = 0.25;
        let report = compare(&recording(), &other);
        assert!(!report.passes && report.mismatch[0].contains("time step"));
    }
}
