//! Voltages from a CSV file: `t_s`, then `v1_v` to `vN_v`.

use std::path::Path;

use super::super::config::ConfigError;
use super::driven::Driven;
use crate::drive::{Table, TableError};

/// Reads the table for a robot whose material must bear the voltages. Columns may stand in any order; others are ignored.
///
/// # Errors
/// [`ConfigError::Data`] names the file and the line: a missing column, a cell that is no number or too high a voltage, times that do not rise.
pub fn read(path: &Path, robot: &Driven) -> Result<Table, ConfigError> {
    let bytes = crate::files::read(path).map_err(|error| ConfigError::Data { path: path.into(), reason: error.to_string() })?;
    parse(&bytes, robot.actuators, |voltage| robot.check_voltage(voltage))
        .map_err(|reason| ConfigError::Data { path: path.into(), reason })
}

fn parse(bytes: &[u8], actuators: usize, bears: impl Fn(f64) -> Result<(), String>) -> Result<Table, String> {
    let mut reader = csv::ReaderBuilder::new().trim(csv::Trim::All).from_reader(bytes);
    let headers = reader.headers().map_err(|error| error.to_string())?.clone();
    let column = |name: &str| {
        headers.iter().position(|header| header == name).ok_or_else(|| format!("line 1: the column {name} is missing"))
    };
    let time_column = column("t_s")?;
    let voltage_columns = (1..=actuators).map(|i| column(&format!("v{i}_v"))).collect::<Result<Vec<_>, _>>()?;

    let (mut times, mut voltages, mut lines) = (Vec::new(), Vec::new(), Vec::new());
    for record in reader.records() {
        let record = record.map_err(|error| error.to_string())?;
        let line = record.position().map_or(0, csv::Position::line);
        let number = |column: usize| {
            let text = record.get(column).unwrap_or_default();
            let name = headers.get(column).unwrap_or_default();
            text.parse::<f64>().map_err(|_| format!("line {line}: column {name}: {text:?} is not a number"))
        };
        times.push(number(time_column)?);
        for &column in &voltage_columns {
            let voltage = number(column)?;
            // What is not finite is said with the table.
            if voltage.is_finite() {
                bears(voltage)
                    .map_err(|reason| format!("line {line}: column {}: {reason}", headers.get(column).unwrap_or_default()))?;
            }
            voltages.push(voltage);
        }
        lines.push(line);
    }
    Table::new(times, voltages, actuators).map_err(|error| match error {
        TableError::Empty => "there are no rows".into(),
        TableError::Row(row) => format!("line {}: times must rise from row to row, and all values must be finite", lines[row]),
        other => other.to_string(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn columns_may_stand_in_any_order_beside_others() {
        let table = parse(b"note, v2_v, t_s, v1_v\nx, 2, 0, 1\ny, 4, 0.5, 3\n", 2, |_| Ok(())).unwrap();
        assert_eq!(table.times(), [0.0, 0.5]);
        assert_eq!(table.row(1), [3.0, 4.0]);
    }

    #[test]
    fn what_is_wrong_is_named_with_its_line() {
        for (text, words) in [
            ("t_s,v1_v\n0,1\n", "v2_v is missing"),
            ("t_s,v1_v,v2_v\n0,1,2\n0,1,2\n", "line 3: times must rise"),
            ("t_s,v1_v,v2_v\n1,1,2\n0,1,2\n", "line 3: times must rise"),
            ("t_s,v1_v,v2_v\n0,1,x\n", "line 2: column v2_v: \"x\" is not a number"),
            ("t_s,v1_v,v2_v\n0,nan,1\n", "line 2"),
            ("t_s,v1_v,v2_v\n0,1\n", "line: 2"),
            ("t_s,v1_v,v2_v\n", "no rows"),
        ] {
            let error = parse(text.as_bytes(), 2, |_| Ok(())).unwrap_err();
            assert!(error.contains(words), "{text:?}: {error}");
        }
    }

    proptest! {
        #[test]
        fn any_bytes_are_a_table_or_an_error_but_never_a_panic(bytes in prop::collection::vec(any::<u8>(), 0..300), head in any::<bool>()) {
            let mut text = if head { b"t_s,v1_v\n".to_vec() } else { Vec::new() };
            text.extend(bytes);
            let _ = parse(&text, 1, |_| Ok(()));
        }

        #[test]
        fn any_table_of_numbers_comes_back_exactly(steps in prop::collection::vec((1e-9f64..1e3, -2e3f64..2e3), 1..20)) {
            let mut t = 0.0;
            let mut text = "t_s,v1_v\n".to_owned();
            let rows: Vec<_> = steps.iter().map(|&(dt, v)| { t += dt; (t, v) }).collect();
            for (t, v) in &rows {
                text += &format!("{t},{v}\n");
            }
            let table = parse(text.as_bytes(), 1, |_| Ok(())).unwrap();
            for (i, (t, v)) in rows.iter().enumerate() {
                prop_assert_eq!((table.times()[i], table.row(i)[0]), (*t, *v));
            }
        }
    }
}
