//! Recordings as CSV, with the unit in every column's name.

use std::io::Write;
use std::path::Path;

use super::{Recording, RecordingError};
use crate::model::units::mm_from_cm;

/// Writes a recording: time, then angle, rate, torque and voltage of each joint, then x and z of each node. y is left out.
///
/// Numbers are written with as many digits as bring back the same bits.
///
/// # Errors
/// [`RecordingError::Unwritable`], with `path` as its name, if the writer fails.
pub fn write(recording: &Recording, writer: impl Write, path: &Path) -> Result<(), RecordingError> {
    let mut table = csv::Writer::from_writer(writer);
    let result = rows(recording, &mut table).and_then(|()| table.flush().map_err(csv::Error::from));
    result.map_err(|error| RecordingError::Unwritable { path: path.into(), reason: error.to_string() })
}

fn rows<W: Write>(recording: &Recording, table: &mut csv::Writer<W>) -> csv::Result<()> {
    let (joints, nodes) = (recording.joints(), recording.nodes());
    let columns: [(&str, &str, &[f64]); 4] = [
        ("theta", "rad", &recording.angles),
        ("rate", "rad_s", &recording.rates),
        ("torque", "dyn_cm", &recording.torques),
        ("motor_voltage", "v", &recording.motor_voltages),
    ];
    table.write_field("t_s")?;
    for (name, unit, _) in columns {
        for joint in 1..=joints {
            table.write_field(format!("{name}{joint}_{unit}"))?;
        }
    }
    for node in 0..nodes {
        table.write_field(format!("node{node}_x_mm"))?;
        table.write_field(format!("node{node}_z_mm"))?;
    }
    table.write_record(None::<&[u8]>)?;
    for (record, time) in recording.time.iter().enumerate() {
        table.write_field(number(*time))?;
        for (_, _, values) in columns {
            for value in &values[record * joints..(record + 1) * joints] {
                table.write_field(number(*value))?;
            }
        }
        for node in 0..nodes {
            let [x, _, z] = recording.node(record, node);
            table.write_field(number(mm_from_cm(x)))?;
            table.write_field(number(mm_from_cm(z)))?;
        }
        table.write_record(None::<&[u8]>)?;
    }
    Ok(())
}

/// The shortest decimal that reads back as the same number, with an exponent where that is shorter.
fn number(value: f64) -> String {
    format!("{value:?}")
}

#[cfg(test)]
mod tests {
    use super::super::Meta;
    use super::*;

    #[test]
    fn the_header_carries_units_and_the_numbers_come_back_exactly() {
        let third = 1.0 / 3.0;
        let recording = Recording {
            meta: Meta { actuators: 1, motors_per_actuator: 1, ..Meta::default() },
            time: vec![third],
            angles: vec![third],
            rates: vec![-1e-300],
            torques: vec![1e20],
            motor_voltages: vec![0.0],
            positions: vec![0.0, 9.0, 0.1, 1.0, 9.0, 0.2, 2.0, 9.0, 0.3],
            velocities: vec![0.0; 9],
        };
        let mut out = Vec::new();
        write(&recording, &mut out, Path::new("x.csv")).unwrap();
        let mut reader = csv::Reader::from_reader(out.as_slice());
        assert_eq!(
            reader.headers().unwrap().iter().collect::<Vec<_>>().join(","),
            "t_s,theta1_rad,rate1_rad_s,torque1_dyn_cm,motor_voltage1_v,node0_x_mm,node0_z_mm,node1_x_mm,node1_z_mm,node2_x_mm,node2_z_mm"
        );
        let row: Vec<f64> = reader.records().next().unwrap().unwrap().iter().map(|f| f.parse().unwrap()).collect();
        assert_eq!(row, [third, third, -1e-300, 1e20, 0.0, 0.0, 1.0, 10.0, 2.0, 20.0, 3.0]);
    }
}
