//! CSV files of recordings, with units in the column names.

use std::io::{Read, Write};
use std::path::Path;

use serde_json::Value;

use super::{GroundMeta, MAX_VALUES, Meta, Recording, RecordingError, check_values};
use crate::files;
use crate::model::units::{cm_from_mm, mm_from_cm};

/// Writes a recording: time; angles, rates, torques and voltages of the joints; x and z of the nodes; velocities of the nodes, if known. y is
/// omitted.
///
/// Numbers have as many digits as restore the same bits.
///
/// # Errors
/// [`RecordingError::Unwritable`], with `path` as its name, if the writer fails.
pub fn write(recording: &Recording, writer: impl Write, path: &Path) -> Result<(), RecordingError> {
    let mut table = csv::Writer::from_writer(writer);
    let result = rows(recording, &mut table).and_then(|()| table.flush().map_err(csv::Error::from));
    result.map_err(|error| RecordingError::Unwritable { path: path.into(), reason: error.to_string() })
}

/// Names and units of the joint quantities, in the order of the columns.
const OF_JOINTS: [(&str, &str); 4] = [("theta", "rad"), ("rate", "rad_s"), ("torque", "dyn_cm"), ("motor_voltage", "v")];

/// Column names for a number of joints, with or without the nodes' velocities.
fn header(joints: usize, velocities: bool) -> Vec<String> {
    let of_joints = OF_JOINTS.iter().flat_map(|(name, unit)| (1..=joints).map(move |joint| format!("{name}{joint}_{unit}")));
    let of_nodes = (0..joints + 2).flat_map(|node| ["x", "z"].map(|axis| format!("node{node}_{axis}_mm")));
    let nodes = if velocities { joints + 2 } else { 0 };
    let moving = (0..nodes).flat_map(|node| ["x", "z"].map(|axis| format!("node{node}_velocity_{axis}_mm_s")));
    std::iter::once("t_s".to_owned()).chain(of_joints).chain(of_nodes).chain(moving).collect()
}

/// True if a file begins with the columns of a recording, unlike other tables of this program.
pub fn is_recording(path: &Path) -> bool {
    let mut start = Vec::new();
    let read = std::fs::File::open(path).and_then(|file| file.take(16).read_to_end(&mut start));
    read.is_ok() && start.starts_with(b"t_s,theta1_rad,")
}

/// Reads a recording written by [`write()`], also of an older version without the nodes' velocities. y and [`Recording::velocities`], which a CSV
/// lacks, are NaN. The manifest beside it gives joints per actuator and mount; without one every joint counts as an actuator, and a warning is
/// returned.
///
/// # Errors
/// [`RecordingError::Unreadable`] with the line, if the file is not such a recording.
pub fn read_file(path: &Path) -> Result<(Recording, Option<String>), RecordingError> {
    let unreadable = |reason: String| RecordingError::Unreadable { path: path.into(), reason };
    let bytes = files::read(path).map_err(|error| unreadable(error.to_string()))?;
    let mut recording = parse(&bytes).map_err(unreadable)?;
    let joints = recording.joints();
    let manifest = files::with_suffix(path, ".manifest.json");
    let found = files::read_text(&manifest).ok().and_then(|text| serde_json::from_str::<Value>(&text).ok());
    if let Some(meta) =
        found.and_then(|found| meta(&found["resolved_cgs"])).filter(|m| m.actuators * m.motors_per_actuator == joints)
    {
        recording.meta = meta;
        return Ok((recording, None));
    }
    let words = format!(
        "{} is missing or does not fit: every joint counts as an actuator, voltages are those of single motors, and no floor is drawn",
        manifest.display()
    );
    Ok((recording, Some(words)))
}

/// The metadata of a recording from an experiment's [`spec`](crate::experiment::Experiment::spec).
fn meta(spec: &Value) -> Option<Meta> {
    let count = |key: &str| spec[key].as_u64().and_then(|count| usize::try_from(count).ok());
    let ground = (spec["mount"].as_str()? == "ground").then(|| GroundMeta {
        friction_low: spec["friction"]["low"].as_f64().unwrap_or(f64::NAN),
        friction_high: spec["friction"]["high"].as_f64().unwrap_or(f64::NAN),
        period: 0.0,
        date_time: String::new(),
    });
    Some(Meta {
        time_step: spec["time_step"].as_f64()?,
        steps: spec["steps"].as_u64()?,
        record_every: spec["record_every_steps"].as_u64()?,
        actuators: count("actuators").filter(|n| *n <= MAX_VALUES as usize)?,
        motors_per_actuator: count("motors_per_actuator").filter(|m| *m <= MAX_VALUES as usize)?,
        actuator_length: spec["material"]["actuator_length"].as_f64()?,
        driven_frequency: 1.0,
        damping_eta: spec["damping_eta"].as_f64().unwrap_or(f64::NAN),
        ground,
    })
}

fn parse(bytes: &[u8]) -> Result<Recording, String> {
    let mut reader = csv::Reader::from_reader(bytes);
    let found = reader.headers().map_err(|error| error.to_string())?.clone();
    let velocities = found.iter().any(|name| name.contains("_velocity_"));
    let joints = if velocities { found.len().saturating_sub(9) / 8 } else { found.len().saturating_sub(5) / 6 };
    let wanted = header(joints, velocities);
    if joints == 0 || found.len() != wanted.len() {
        return Err(format!("line 1: {} columns are not those of a recording", found.len()));
    }
    if let Some((at, (found, wanted))) = found.iter().zip(&wanted).enumerate().find(|(_, (found, wanted))| found != wanted) {
        return Err(format!("line 1, column {}: {found:?} instead of {wanted}", at + 1));
    }
    let mut recording =
        Recording { meta: Meta { actuators: joints, motors_per_actuator: 1, ..Meta::default() }, ..Recording::default() };
    for record in reader.records() {
        let record = record.map_err(|error| error.to_string())?;
        let line = record.position().map_or(0, csv::Position::line);
        let numbers = record
            .iter()
            .zip(&wanted)
            .map(|(text, name)| {
                let value = text.parse::<f64>().map_err(|_| format!("line {line}: {name}: {text:?} is not a number"))?;
                check_values(&[value]).map_err(|_| format!("line {line}: {name}: {text:?} is out of range"))?;
                Ok(value)
            })
            .collect::<Result<Vec<_>, String>>()?;
        if recording.time.last().is_some_and(|last| numbers[0] <= *last) {
            return Err(format!("line {line}: t_s is {}, but times must rise", numbers[0]));
        }
        recording.time.push(numbers[0]);
        let (of_joints, of_nodes) = numbers[1..].split_at(4 * joints);
        let columns = [&mut recording.angles, &mut recording.rates, &mut recording.torques, &mut recording.motor_voltages];
        for (column, values) in columns.into_iter().zip(of_joints.chunks_exact(joints)) {
            column.extend(values);
        }
        let (places, moving) = of_nodes.split_at(2 * (joints + 2));
        for velocity in moving.chunks_exact(2) {
            recording.node_velocities.extend([cm_from_mm(velocity[0]), f64::NAN, cm_from_mm(velocity[1])]);
        }
        for node in places.chunks_exact(2) {
            recording.positions.extend([cm_from_mm(node[0]), f64::NAN, cm_from_mm(node[1])]);
            recording.velocities.extend([f64::NAN; 3]);
        }
    }
    Ok(recording)
}

fn rows<W: Write>(recording: &Recording, table: &mut csv::Writer<W>) -> csv::Result<()> {
    let (joints, nodes) = (recording.joints(), recording.nodes());
    let columns = [&recording.angles, &recording.rates, &recording.torques, &recording.motor_voltages];
    let velocities = &recording.node_velocities;
    table.write_record(header(joints, !velocities.is_empty()))?;
    for (record, time) in recording.time.iter().enumerate() {
        table.write_field(number(*time))?;
        for values in columns {
            for value in &values[record * joints..(record + 1) * joints] {
                table.write_field(number(*value))?;
            }
        }
        for node in 0..nodes {
            let [x, _, z] = recording.node(record, node);
            table.write_field(number(mm_from_cm(x)))?;
            table.write_field(number(mm_from_cm(z)))?;
        }
        if !velocities.is_empty() {
            for velocity in velocities[3 * nodes * record..3 * nodes * (record + 1)].chunks_exact(3) {
                table.write_field(number(mm_from_cm(velocity[0])))?;
                table.write_field(number(mm_from_cm(velocity[2])))?;
            }
        }
        table.write_record(None::<&[u8]>)?;
    }
    Ok(())
}

/// The shortest decimal that restores the same bits, with an exponent if that is shorter.
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
            node_velocities: vec![0.0, 9.0, 0.4, 1.0, 9.0, 0.5, 2.0, 9.0, 0.6],
        };
        let mut out = Vec::new();
        write(&recording, &mut out, Path::new("x.csv")).unwrap();
        let mut reader = csv::Reader::from_reader(out.as_slice());
        assert_eq!(
            reader.headers().unwrap().iter().collect::<Vec<_>>().join(","),
            "t_s,theta1_rad,rate1_rad_s,torque1_dyn_cm,motor_voltage1_v,node0_x_mm,node0_z_mm,node1_x_mm,node1_z_mm,node2_x_mm,node2_z_mm,\
             node0_velocity_x_mm_s,node0_velocity_z_mm_s,node1_velocity_x_mm_s,node1_velocity_z_mm_s,\
             node2_velocity_x_mm_s,node2_velocity_z_mm_s"
        );
        let back = parse(&out).unwrap();
        assert_eq!((&back.time, &back.angles, &back.torques), (&recording.time, &recording.angles, &recording.torques));
        let places: Vec<f64> = (0..3).flat_map(|node| [back.node(0, node)[0], back.node(0, node)[2]]).collect();
        assert_eq!(places, [0.0, 0.1, 1.0, 0.2, 2.0, 0.3]);
        let moving: Vec<f64> = back.node_velocities.chunks(3).flat_map(|v| [v[0], v[2]]).collect();
        assert_eq!(moving, [0.0, 0.4, 1.0, 0.5, 2.0, 0.6]);
        // As older versions wrote it.
        let mut older = Vec::new();
        write(&Recording { node_velocities: Vec::new(), ..recording.clone() }, &mut older, Path::new("x.csv")).unwrap();
        let older = parse(&older).unwrap();
        assert_eq!((older.angles, older.node_velocities), (recording.angles.clone(), Vec::new()));
        let row: Vec<f64> = reader.records().next().unwrap().unwrap().iter().map(|f| f.parse().unwrap()).collect();
        assert_eq!(row, [third, third, -1e-300, 1e20, 0.0, 0.0, 1.0, 10.0, 2.0, 20.0, 3.0, 0.0, 4.0, 10.0, 5.0, 20.0, 6.0]);
    }

    #[test]
    fn what_is_no_recording_is_refused_with_its_line() {
        let header = header(1, false).join(",");
        for (text, words) in [
            ("a,b\n1,2\n".to_owned(), "line 1: 2 columns"),
            (header.replace("rate1_rad_s", "rate1_deg_s"), "line 1, column 3: \"rate1_deg_s\" instead of rate1_rad_s"),
            (format!("{header}\n0,0,0,0,0,0,0,0,0,0,x\n"), "line 2: node2_z_mm: \"x\" is not a number"),
            (format!("{header}\n0,0,0,0,0,0,0,0,0,0,inf\n"), "line 2: node2_z_mm"),
            (format!("{header}\n0,0,0\n"), "line: 2"),
            (format!("{header}\n1,0,0,0,0,0,0,0,0,0,0\n1,0,0,0,0,0,0,0,0,0,0\n"), "line 3: t_s is 1, but times must rise"),
        ] {
            let error = parse(text.as_bytes()).unwrap_err();
            assert!(error.contains(words), "{text}: {error}");
        }
    }
}
