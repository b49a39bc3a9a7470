//! The CSV file of a measured run.

use std::collections::BTreeMap;
use std::path::Path;

use super::dataset::{AXES, Column, DataError, Marker};
use super::quality::median_interval;
use crate::model::Robot;
use crate::words;

/// Largest time (s), voltage (V) and position (mm): beyond these a column has another unit, since MFC actuators take 1.5 kV and no robot is a
/// hundred metres long.
const MOST_SECONDS: f64 = 1e7;
const MOST_VOLTS: f64 = 1e4;
const MOST_MM: f64 = 1e5;
/// Least interval between rows (s): a voltage jump between two rows is given a width of 10⁻⁹ s.
const LEAST_SECONDS: f64 = 1e-8;

/// The rows of a run. Missing values are NaN.
#[derive(Debug)]
pub(super) struct Rows {
    /// Times (s).
    pub times: Vec<f64>,
    /// Voltages (V), rows × actuators.
    pub voltages: Vec<f64>,
    /// Channels × rows (mm): x and z of every marker, in order; a channel without a column is empty.
    pub channels: Vec<Vec<f64>>,
    /// Remarks on the data, in words.
    pub remarks: Vec<String>,
}

/// Where a file's voltages come from.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Voltages {
    /// From a column for each actuator.
    Needed,
    /// As above; 0 V without any such column.
    NoneIsZero,
    /// From another file: this one must have none.
    Elsewhere,
}

/// What a file should have.
#[derive(Clone, Copy)]
pub(super) struct Wanted<'a> {
    pub robot: &'a Robot,
    /// Factor on positive voltages (–).
    pub positive_gain: f64,
    /// The tracked points; none in a file of voltages.
    pub markers: &'a [Marker],
    /// The file's names and units of columns where they are not those of this program.
    pub columns: &'a BTreeMap<String, Column>,
    pub voltages: Voltages,
    /// Rate (V/s) at which the voltages of a file without times change.
    pub ramp: Option<f64>,
    /// Frames per second, for a column `frame` in place of `t_s`.
    pub frame_rate: Option<f64>,
}

/// Reads a file.
///
/// # Errors
/// [`DataError`] with line and column.
pub(super) fn read(path: &Path, wanted: &Wanted) -> Result<Rows, DataError> {
    let bytes =
        crate::files::read(path).map_err(|error| DataError::Unreadable { path: path.into(), reason: error.to_string() })?;
    parse(&bytes, wanted).map_err(|Wrong { line, column, reason }| match line {
        0 => DataError::Unreadable { path: path.into(), reason },
        _ => DataError::Content { path: path.into(), line, column, reason },
    })
}

/// The columns x and z of every marker, in order.
fn marker_columns(markers: &[Marker]) -> Vec<String> {
    markers.iter().flat_map(|marker| AXES.map(|axis| format!("{}_{axis}_mm", marker.name))).collect()
}

/// Checks `[columns]`.
///
/// # Errors
/// The wrong key, and why.
pub(super) fn check_columns(
    columns: &BTreeMap<String, Column>,
    robot: &Robot,
    markers: &[Marker],
) -> Result<(), (String, String)> {
    let voltages = (1..=robot.actuators).map(|n| format!("v{n}_v"));
    let known: Vec<String> =
        ["t_s".to_owned(), "frame".to_owned()].into_iter().chain(voltages).chain(marker_columns(markers)).collect();
    let mut taken: Vec<&str> = Vec::new();
    for (key, Column { from, factor, offset }) in columns {
        let wrong = |reason: String| Err((key.clone(), reason));
        if !known.contains(key) {
            let hint = words::did_you_mean(key, known.iter().map(String::as_str));
            return wrong(format!("is no column of a run: t_s, v1_v, ..., or NAME_x_mm or NAME_z_mm of a marker{hint}"));
        }
        if taken.contains(&from.as_str()) {
            return wrong(format!("is a second one from the column {from:?}"));
        }
        taken.push(from);
        if !(factor.is_finite() && *factor != 0.0 && offset.is_finite()) {
            return wrong("needs a factor other than 0 and an offset that are numbers".into());
        }
    }
    Ok(())
}

/// What is wrong in a run's file.
#[derive(Debug)]
struct Wrong {
    /// Line, from 1; 0 for the whole file.
    line: u64,
    /// Column, from 1; 0 for a whole line.
    column: usize,
    reason: String,
}

/// Parses a file.
fn parse(bytes: &[u8], wanted: &Wanted) -> Result<Rows, Wrong> {
    let Wanted { robot, markers, .. } = *wanted;
    let actuators = robot.actuators;
    let wrong = |line: u64, column: usize, reason: String| Wrong { line, column, reason };
    if bytes.is_empty() {
        return Err(wrong(0, 0, "is empty".into()));
    }
    let mut reader = csv::ReaderBuilder::new().trim(csv::Trim::All).from_reader(bytes);
    let headers = reader.headers().map_err(|error| wrong(1, 0, error.to_string()))?.clone();
    let names = marker_columns(markers);
    let mut time_column = None;
    let mut volt_columns = vec![None; actuators];
    let mut columns = vec![None; names.len()];
    // Factor and offset of every column.
    let mut units = vec![(1.0, 0.0); headers.len()];
    for (at, written) in headers.iter().enumerate() {
        let renamed = wanted.columns.iter().find(|(_, column)| column.from == written);
        let header = renamed.map_or(written, |(key, column)| {
            units[at] = (column.factor, column.offset);
            key.as_str()
        });
        let voltage = header.strip_prefix('v').and_then(|rest| rest.strip_suffix("_v")).and_then(|n| n.parse::<usize>().ok());
        let slot = if header == "t_s" || header == "frame" {
            if wanted.ramp.is_some() {
                let reason =
                    format!("{written} stands beside rate_v_per_s, which makes times of voltages: take one of the two away");
                return Err(wrong(1, at + 1, reason));
            }
            if header == "frame" {
                let missing = "frame numbers are no times without frame_rate_hz in [camera]";
                let rate = wanted.frame_rate.ok_or_else(|| wrong(1, at + 1, missing.into()))?;
                units[at] = (units[at].0 / rate, units[at].1 / rate);
            }
            &mut time_column
        } else if let Some(n) = voltage {
            if wanted.voltages == Voltages::Elsewhere {
                let reason = format!("{written} stands beside voltage_file: take the voltage from one of the two files");
                return Err(wrong(1, at + 1, reason));
            }
            let reason =
                format!("there is a voltage {header}, but the robot has {actuators} actuators; is this a run of another robot?");
            n.checked_sub(1).and_then(|n| volt_columns.get_mut(n)).ok_or_else(|| wrong(1, at + 1, reason))?
        } else if let Some(n) = names.iter().position(|name| name == header) {
            &mut columns[n]
        } else if markers.is_empty() {
            let reason = format!("{written:?} is neither t_s nor a voltage v1_v, ...; positions belong to the run's file");
            return Err(wrong(1, at + 1, reason));
        } else {
            let known = markers.iter().map(|marker| marker.name.as_str()).collect::<Vec<_>>().join(", ");
            let reason = format!(
                "{written:?} is neither t_s, a voltage v1_v, ..., nor NAME_x_mm or NAME_z_mm of a marker ({known}), nor the from of a key of \
                 [columns]"
            );
            return Err(wrong(1, at + 1, reason));
        };
        if slot.replace(at).is_some() {
            return Err(wrong(1, at + 1, format!("a second column {header}")));
        }
    }
    let called =
        |key: &str| wanted.columns.get(key).map_or_else(String::new, |column| format!(", {:?} in [columns],", column.from));
    if time_column.is_none() && wanted.ramp.is_none() {
        let remedy = match (wanted.voltages, markers.is_empty()) {
            (Voltages::Needed, false) => "; of a slow loop without times, give rate_v_per_s",
            _ => "",
        };
        return Err(wrong(1, 0, format!("the column t_s{} is missing{remedy}", called("t_s"))));
    }
    let has_voltages = volt_columns.iter().any(Option::is_some) || wanted.voltages == Voltages::Needed;
    let need_voltage = |(i, column): (usize, Option<usize>)| {
        column.ok_or_else(|| {
            let key = format!("v{}_v", i + 1);
            let remedy = match (wanted.voltages, markers.is_empty()) {
                (Voltages::Needed, false) => "; if the voltage is in a file of its own, name it as voltage_file",
                _ => "",
            };
            let called = called(&key);
            wrong(1, 0, format!("the column {key}{called} is missing; the robot has {actuators} actuators{remedy}"))
        })
    };
    let volt_columns: Vec<usize> =
        if has_voltages { volt_columns.into_iter().enumerate().map(need_voltage).collect::<Result<_, _>>()? } else { Vec::new() };
    if columns.iter().all(Option::is_none) && !markers.is_empty() {
        return Err(wrong(1, 0, "there is no column of a marker".into()));
    }

    let (mut times, mut voltages): (Vec<f64>, Vec<f64>) = (Vec::new(), Vec::new());
    let mut channels: Vec<Vec<f64>> = vec![Vec::new(); columns.len()];
    for record in reader.records() {
        let record = record.map_err(|error| {
            let line = error.position().map_or(0, csv::Position::line);
            wrong(line.max(1), 0, error.to_string())
        })?;
        let line = record.position().map_or(0, csv::Position::line);
        let number = |column: usize| {
            let text = record.get(column).unwrap_or_default();
            let (factor, offset) = units[column];
            let value = text.parse::<f64>().ok().map(|value| factor * value + offset).filter(|value| value.is_finite());
            value.ok_or_else(|| {
                wrong(line, column + 1, format!("{}: {text:?} is not a number", headers.get(column).unwrap_or_default()))
            })
        };
        let within = |column: usize, most: f64, unit: &str| {
            let value = number(column)?;
            if value.abs() <= most {
                return Ok(value);
            }
            let name = headers.get(column).unwrap_or_default();
            Err(wrong(line, column + 1, format!("{name} is {}, beyond {most:.0} {unit}; is it in {unit}?", words::number(value))))
        };
        let mut now = Vec::with_capacity(actuators);
        for &column in &volt_columns {
            let voltage = within(column, MOST_VOLTS, "V")?;
            robot
                .check_voltage(voltage, wanted.positive_gain)
                .map_err(|reason| wrong(line, column + 1, format!("{} {reason}", headers.get(column).unwrap_or_default())))?;
            now.push(voltage);
        }
        if !has_voltages && wanted.voltages == Voltages::NoneIsZero {
            now.resize(actuators, 0.0);
        }
        let time = match (time_column, wanted.ramp, times.last()) {
            (Some(column), ..) => within(column, MOST_SECONDS, "s")?,
            (None, Some(rate), Some(last)) => {
                let before = &voltages[voltages.len() - actuators..];
                let change = now.iter().zip(before).map(|(a, b): (&f64, &f64)| (a - b).abs()).fold(0.0, f64::max);
                if change / rate < LEAST_SECONDS {
                    let reason = "the voltage is that of the row before, so that rate_v_per_s gives it no time: keep one of the two rows, or give t_s";
                    return Err(wrong(line, 0, reason.into()));
                }
                last + change / rate
            }
            _ => 0.0,
        };
        if let Some(last) = times.last().filter(|last| time - **last < LEAST_SECONDS) {
            return Err(wrong(
                line,
                time_column.map_or(0, |column| column + 1),
                format!(
                    "t_s is {} after {}; times must rise, by {LEAST_SECONDS:e} s at least",
                    words::number(time),
                    words::number(*last)
                ),
            ));
        }
        times.push(time);
        voltages.extend(now);
        for (channel, column) in channels.iter_mut().zip(&columns) {
            if let Some(column) = *column {
                let empty = record.get(column).unwrap_or_default().is_empty();
                channel.push(if empty { f64::NAN } else { within(column, MOST_MM, "mm")? });
            }
        }
    }
    if times.is_empty() {
        return Err(wrong(1, 0, "there are no rows below the header".into()));
    }
    if times.len() == 1 {
        return Err(wrong(2, 0, "there is one row; a run needs two at least".into()));
    }
    if !markers.is_empty() && channels.iter().flatten().all(|value| value.is_nan()) {
        return Err(wrong(2, 0, "all values of all markers are missing".into()));
    }
    let mut remarks = Vec::new();
    let missing = channels.iter().flatten().filter(|value| value.is_nan()).count();
    if missing > 0 {
        remarks.push(format!("{missing} values are missing"));
    }
    let largest = times.windows(2).map(|pair| pair[1] - pair[0]).fold(0.0, f64::max);
    if let Some(median) = median_interval(&times).filter(|median| largest > 5.0 * median) {
        remarks.push(format!("the largest gap between rows is {largest:.4} s, the usual step {median:.4} s"));
    }
    Ok(Rows { times, voltages, channels, remarks })
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// A file of a robot of one actuator with a marker `tip`.
    fn parsed(bytes: &[u8], voltages: Voltages, columns: &[(&str, &str, f64)]) -> Result<Rows, Wrong> {
        let robot = Robot::crawler().with_actuators(1);
        let markers = [Marker { name: "tip".into(), position: 10.0 }];
        let columns = columns
            .iter()
            .map(|(key, from, factor)| ((*key).into(), Column { from: (*from).into(), factor: *factor, offset: 0.5 }));
        parse(
            bytes,
            &Wanted {
                robot: &robot,
                positive_gain: 1.0,
                markers: &markers,
                columns: &columns.collect(),
                voltages,
                ramp: None,
                frame_rate: Some(50.0),
            },
        )
    }

    #[test]
    fn columns_may_stand_in_any_order_and_cells_may_be_empty() {
        let text = b"tip_z_mm, v1_v, t_s\n1.5, 10, 0\n, 20, 0.1\n";
        let Rows { times, voltages, channels, remarks } = parsed(text, Voltages::Needed, &[]).unwrap();
        assert_eq!((times, voltages), (vec![0.0, 0.1], vec![10.0, 20.0]));
        assert!(channels[0].is_empty() && channels[1][0] == 1.5 && channels[1][1].is_nan());
        assert_eq!(remarks.len(), 1);
    }

    #[test]
    fn what_is_wrong_is_named_with_line_and_column() {
        for (text, line, column, words) in [
            ("", 0, 0, "is empty"),
            ("t_s,v1_v,tip_z_mm\n", 1, 0, "no rows"),
            ("t_s,tip_z_mm\n0,1\n", 1, 0, "v1_v is missing"),
            ("t_s,v1_v,v2_v,tip_z_mm\n0,1,1,1\n", 1, 3, "another robot"),
            ("t_s,v1_v,nose_z_mm\n0,1,1\n", 1, 3, "nose_z_mm"),
            ("t_s,v1_v,tip_z_mm\n0,1,1\n0,1,1\n", 3, 1, "times must rise"),
            ("t_s,v1_v,tip_z_mm\n0,1,one\n", 2, 3, "\"one\" is not a number"),
            ("t_s,v1_v,tip_z_mm\n0,,1\n", 2, 2, "is not a number"),
            ("t_s,v1_v,tip_z_mm\n0,1,\n1,1,\n", 2, 0, "all values"),
            ("t_s,v1_v\n0,1\n", 1, 0, "no column of a marker"),
            ("t_s,v1_v,tip_z_mm\n0,1\n", 2, 0, "fields"),
        ] {
            let error = parsed(text.as_bytes(), Voltages::Needed, &[]).unwrap_err();
            assert!(error.reason.contains(words) && (error.line, error.column) == (line, column), "{text:?}: {error:?}");
        }
    }

    #[test]
    fn columns_of_other_names_and_units_are_converted_and_voltages_may_be_elsewhere_or_zero() {
        let tracker = [("t_s", "t", 1.0), ("tip_z_mm", "y", 1000.0)];
        let rows = parsed(b"t,y\n0,-0.02\n0.1,-0.03\n", Voltages::NoneIsZero, &tracker).unwrap();
        assert_eq!((rows.times, rows.voltages), (vec![0.5, 0.6], vec![0.0, 0.0]));
        assert!((rows.channels[1][1] + 29.5).abs() < 1e-12);
        let error = parsed(b"t,y\n0,-0.02\n0.1,-0.03\n", Voltages::Needed, &tracker).unwrap_err();
        assert!(error.reason.contains("voltage_file"), "{error:?}");
        let error = parsed(b"x,y\n0,1\n", Voltages::NoneIsZero, &tracker).unwrap_err();
        assert!(error.reason.contains("\"x\"") && error.reason.contains("[columns]"), "{error:?}");
        let rows = parsed(b"t_s,tip_z_mm\n0,1\n1,1\n", Voltages::Elsewhere, &[]).unwrap();
        assert!(rows.voltages.is_empty());
        let error = parsed(b"t_s,tip_z_mm,v1_v\n0,1,5\n", Voltages::Elsewhere, &[]).unwrap_err();
        assert!(error.column == 3 && error.reason.contains("voltage_file"), "{error:?}");
    }

    proptest! {
        #[test]
        fn any_bytes_are_a_run_or_an_error_but_never_a_panic(bytes in prop::collection::vec(any::<u8>(), 0..300), head in any::<bool>()) {
            let mut text = if head { b"t_s,v1_v,tip_z_mm\n".to_vec() } else { Vec::new() };
            text.extend(bytes);
            let _ = parsed(&text, Voltages::NoneIsZero, &[("tip_z_mm", "z", 1e300)]);
        }
    }
}
