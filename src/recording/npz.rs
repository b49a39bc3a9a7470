//! NPZ files with the reference's keys and shapes.
//!
//! Written: `dataTime` (T), `dataTheta`, `dataAngularVelocities`, `dataTor`, `dataMotorVoltages` (T, J), `dataPositions`,
//! `dataPositionVelocities` (T, J+2, 3), and as scalars `timeStep`, `simCycles`, `recordStepInterval`, `N`, `m`, `actuatorLength`,
//! `drivenFrequency`, `dampingEta`; for robots on the ground also `dateTime`, `frictionLow`, `frictionHigh`, `period`.
//! CGS units, as in the reference. Extension: `nodes_velocity` (T, J+2, 3), the velocities of the nodes, which `dataPositionVelocities` holds
//! for the planar engine only (see [`Recording::velocities`]). On reading, `dateTime` and other keys are ignored; `dampingEta`, `nodes_velocity` and
//! the keys of robots on the ground may be missing.

use std::io::{Cursor, Read, Seek, Write};
use std::path::Path;

use ndarray::{ArrayView, IxDyn, arr0};
use ndarray_npy::{NpzWriter, WritableElement, WriteDataError, WriteNpzError};
use py_literal::Value;
use zip::ZipArchive;
use zip::result::ZipError;

use super::npy::{self, Array};
use super::{GroundMeta, MAX_VALUES, Meta, Recording, RecordingError, check_values};
use crate::words::number;

/// Length of `MM_DD_YYYY_HH_MM`.
const DATE_LENGTH: usize = 16;

/// The reference's `dateTime`: a numpy string of 16 characters.
struct DateTime([u32; DATE_LENGTH]);

impl WritableElement for DateTime {
    fn type_descriptor() -> Value {
        Value::String(format!("<U{DATE_LENGTH}"))
    }

    fn write<W: Write>(&self, mut writer: W) -> Result<(), WriteDataError> {
        for code in self.0 {
            writer.write_all(&code.to_le_bytes())?;
        }
        Ok(())
    }

    fn write_slice<W: Write>(slice: &[Self], mut writer: W) -> Result<(), WriteDataError> {
        slice.iter().try_for_each(|value| value.write(&mut writer))
    }
}

/// Writes a recording.
///
/// # Errors
/// [`RecordingError::Unwritable`], with `path` for the message, if the writer fails.
pub fn write(recording: &Recording, writer: impl Write, path: &Path) -> Result<(), RecordingError> {
    let unwritable = |error: &dyn std::fmt::Display| RecordingError::Unwritable { path: path.into(), reason: error.to_string() };
    // The zip format needs to seek, so the archive is built in memory.
    let mut archive = NpzWriter::new_compressed(Cursor::new(Vec::new()));
    let bytes = fill(recording, &mut archive).and_then(|()| archive.finish()).map_err(|error| unwritable(&error))?;
    let mut writer = writer;
    writer.write_all(bytes.get_ref()).and_then(|()| writer.flush()).map_err(|error| unwritable(&error))
}

fn fill<W: Write + Seek>(recording: &Recording, archive: &mut NpzWriter<W>) -> Result<(), WriteNpzError> {
    let (t, j) = (recording.len(), recording.joints());
    let mut add = |name: &str, shape: &[usize], values: &[f64]| {
        let view = ArrayView::from_shape(IxDyn(shape), values).expect("a recording's arrays have its shape");
        archive.add_array(name, &view)
    };
    add("dataTime", &[t], &recording.time)?;
    add("dataTheta", &[t, j], &recording.angles)?;
    add("dataAngularVelocities", &[t, j], &recording.rates)?;
    add("dataTor", &[t, j], &recording.torques)?;
    add("dataMotorVoltages", &[t, j], &recording.motor_voltages)?;
    add("dataPositions", &[t, j + 2, 3], &recording.positions)?;
    add("dataPositionVelocities", &[t, j + 2, 3], &recording.velocities)?;
    if !recording.node_velocities.is_empty() {
        add("nodes_velocity", &[t, j + 2, 3], &recording.node_velocities)?;
    }
    let meta = &recording.meta;
    for (name, value) in [
        ("timeStep", meta.time_step),
        ("actuatorLength", meta.actuator_length),
        ("drivenFrequency", meta.driven_frequency),
        ("dampingEta", meta.damping_eta),
    ] {
        add(name, &[], &[value])?;
    }
    for (name, value) in [
        ("simCycles", meta.steps),
        ("recordStepInterval", meta.record_every),
        ("N", meta.actuators as u64),
        ("m", meta.motors_per_actuator as u64),
    ] {
        archive.add_array(name, &arr0(value.cast_signed()))?;
    }
    if let Some(ground) = &meta.ground {
        let mut date = DateTime([0; DATE_LENGTH]);
        for (code, character) in date.0.iter_mut().zip(ground.date_time.chars()) {
            *code = character.into();
        }
        archive.add_array("dateTime", &arr0(date))?;
        for (name, value) in
            [("frictionLow", ground.friction_low), ("frictionHigh", ground.friction_high), ("period", ground.period)]
        {
            archive.add_array(name, &arr0(value))?;
        }
    }
    Ok(())
}

/// Parses a recording of this program or of the reference.
///
/// # Errors
/// [`RecordingError::Unreadable`], with `path` for the message, if the archive is damaged, a key is missing or a shape does not fit.
pub fn read(bytes: &[u8], path: &Path) -> Result<Recording, RecordingError> {
    parse(bytes).map_err(|reason| RecordingError::Unreadable { path: path.into(), reason })
}

/// Reads a recording from a file.
///
/// # Errors
/// As [`read`], and if the file cannot be opened.
pub fn read_file(path: &Path) -> Result<Recording, RecordingError> {
    let bytes =
        crate::files::read(path).map_err(|error| RecordingError::Unreadable { path: path.into(), reason: error.to_string() })?;
    read(&bytes, path)
}

/// The archive's arrays, by key.
struct Arrays<R: Read + Seek>(ZipArchive<R>);

impl<R: Read + Seek> Arrays<R> {
    /// An array whose header and content agree.
    fn array(&mut self, key: &str) -> Result<Array, String> {
        let name = format!("{key}.npy");
        let name = if self.0.index_for_name(&name).is_some() { name.as_str() } else { key };
        let bad = |reason: String| format!("key {key}: {reason}");
        let mut entry = self.0.by_name(name).map_err(|error| bad(plain(&error)))?;
        npy::read(&mut entry, MAX_VALUES as usize).map_err(bad)
    }

    /// The values of a float array of the given shape.
    fn values(&mut self, key: &str, shape: &[usize]) -> Result<Vec<f64>, String> {
        let array = self.array(key)?;
        if array.shape != shape {
            return Err(format!("key {key}: the shape is {:?}, but the other keys make it {shape:?}", array.shape));
        }
        check_values(&array.values).map_err(|reason| format!("key {key}: {reason}"))?;
        Ok(array.values)
    }

    /// The values of a float array of the given shape; empty if the key is missing.
    fn values_if_there(&mut self, key: &str, shape: &[usize]) -> Result<Vec<f64>, String> {
        let there = self.0.file_names().any(|name| name.strip_suffix(".npy").unwrap_or(name) == key);
        if there { self.values(key, shape) } else { Ok(Vec::new()) }
    }

    /// A scalar, float or integer.
    fn number(&mut self, key: &str) -> Result<f64, String> {
        match self.array(key)?.values[..] {
            [value] => Ok(value),
            _ => Err(format!("key {key}: a single number is needed")),
        }
    }

    /// A whole number between `least` and 10⁹.
    fn count(&mut self, key: &str, least: f64) -> Result<u64, String> {
        let value = self.number(key)?;
        if value.fract() == 0.0 && (least..=1e9).contains(&value) {
            Ok(value as u64)
        } else {
            Err(format!("key {key}: {} is not a whole number from {least} to 1e9", number(value)))
        }
    }
}

/// The zip reader's error in plain words.
fn plain(error: &ZipError) -> String {
    match error {
        ZipError::FileNotFound => "is missing".into(),
        other if other.to_string().contains("EOCD") => "there is no zip directory at its end".into(),
        other => format!("its zip archive is damaged ({other})"),
    }
}

fn parse(bytes: &[u8]) -> Result<Recording, String> {
    let archive =
        ZipArchive::new(Cursor::new(bytes)).map_err(|error| format!("not an NPZ file, or cut short: {}", plain(&error)))?;
    let mut arrays = Arrays(archive);
    let actuators = arrays.count("N", 1.0)?;
    let motors_per_actuator = arrays.count("m", 1.0)?;
    let joints = usize::try_from(actuators * motors_per_actuator).map_err(|error| error.to_string())?;
    let Array { shape, values: time } = arrays.array("dataTime")?;
    let [t] = shape[..] else { return Err(format!("key dataTime: the shape is {shape:?}, but one axis is needed")) };
    check_values(&time).map_err(|reason| format!("key dataTime: {reason}"))?;
    let values = t as f64 * (10.0 * joints as f64 + 13.0);
    if values > MAX_VALUES {
        return Err(format!("{t} records of {joints} joints are {values:.1e} numbers, more than {MAX_VALUES:.0e}"));
    }
    let ground = match (arrays.number("frictionLow"), arrays.number("frictionHigh")) {
        (Ok(friction_low), Ok(friction_high)) => Some(GroundMeta {
            friction_low,
            friction_high,
            period: arrays.number("period").unwrap_or(0.0),
            date_time: String::new(),
        }),
        _ => None,
    };
    let recording = Recording {
        meta: Meta {
            time_step: arrays.number("timeStep")?,
            steps: arrays.count("simCycles", 0.0)?,
            record_every: arrays.count("recordStepInterval", 1.0)?,
            actuators: actuators as usize,
            motors_per_actuator: motors_per_actuator as usize,
            actuator_length: arrays.number("actuatorLength")?,
            driven_frequency: arrays.number("drivenFrequency")?,
            damping_eta: arrays.number("dampingEta").unwrap_or(f64::NAN),
            ground,
        },
        angles: arrays.values("dataTheta", &[t, joints])?,
        rates: arrays.values("dataAngularVelocities", &[t, joints])?,
        torques: arrays.values("dataTor", &[t, joints])?,
        motor_voltages: arrays.values("dataMotorVoltages", &[t, joints])?,
        positions: arrays.values("dataPositions", &[t, joints + 2, 3])?,
        velocities: arrays.values("dataPositionVelocities", &[t, joints + 2, 3])?,
        time,
        node_velocities: arrays.values_if_there("nodes_velocity", &[t, joints + 2, 3])?,
    };
    let time = &recording.time;
    match time.windows(2).position(|pair| pair[1] <= pair[0]) {
        Some(at) => Err(format!("key dataTime: {} follows {}, but times must rise", time[at + 1], time[at])),
        None => Ok(recording),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn sample(records: usize) -> Recording {
        let numbers = |count: usize| (0..count).map(|i| (i as f64).sin() / 3.0).collect::<Vec<_>>();
        Recording {
            meta: Meta {
                time_step: 1e-5,
                steps: 10,
                record_every: 5,
                actuators: 2,
                motors_per_actuator: 1,
                actuator_length: 10.0,
                driven_frequency: 1.0,
                damping_eta: 0.045,
                ground: Some(GroundMeta { friction_low: 0.2, friction_high: 4.0, period: 0.1, date_time: String::new() }),
            },
            time: numbers(records),
            angles: numbers(2 * records),
            rates: numbers(2 * records),
            torques: numbers(2 * records),
            motor_voltages: numbers(2 * records),
            positions: numbers(12 * records),
            velocities: numbers(12 * records),
            node_velocities: numbers(12 * records).iter().map(|value| 2.0 * value).collect(),
        }
    }

    fn bytes(recording: &Recording) -> Vec<u8> {
        let mut out = Vec::new();
        write(recording, &mut out, Path::new("sample.npz")).unwrap();
        out
    }

    #[test]
    fn a_recording_comes_back_with_its_bits() {
        for records in [0, 1, 3] {
            let recording = sample(records);
            assert_eq!(read(&bytes(&recording), Path::new("sample.npz")).unwrap(), recording);
            // As in files of the reference.
            let without = Recording { node_velocities: Vec::new(), ..recording };
            assert_eq!(read(&bytes(&without), Path::new("sample.npz")).unwrap(), without);
        }
    }

    #[test]
    fn a_wrong_shape_is_named_by_its_key() {
        let mut recording = sample(3);
        recording.meta.motors_per_actuator = 2;
        recording.angles.extend([0.0; 6]);
        recording.rates.truncate(0);
        // This module cannot write inconsistent shapes, so the archive is built by hand.
        let mut archive = NpzWriter::new(Cursor::new(Vec::new()));
        for (key, value) in [("N", 1_i64), ("m", 2)] {
            archive.add_array(key, &arr0(value)).unwrap();
        }
        archive.add_array("dataTime", &ndarray::Array1::<f64>::zeros(3)).unwrap();
        archive.add_array("dataTheta", &ndarray::Array2::<f64>::zeros((3, 5))).unwrap();
        for key in ["timeStep", "simCycles", "recordStepInterval", "actuatorLength", "drivenFrequency"] {
            archive.add_array(key, &arr0(1.0)).unwrap();
        }
        let bytes = archive.finish().unwrap().into_inner();
        let error = read(&bytes, Path::new("odd.npz")).unwrap_err().to_string();
        assert!(error.contains("odd.npz") && error.contains("dataTheta") && error.contains("[3, 5]"), "{error}");
    }

    #[test]
    fn what_is_no_archive_or_lacks_a_key_is_said_in_plain_words() {
        let said = |bytes: &[u8]| read(bytes, Path::new("a.npz")).unwrap_err().to_string();
        let whole = bytes(&sample(3));
        for text in [said(b"t_s,v1_v"), said(b""), said(&whole[..whole.len() / 2])] {
            assert!(text.contains("not an NPZ file, or cut short: there is no zip directory"), "{text}");
        }
        let mut archive = NpzWriter::new(Cursor::new(Vec::new()));
        archive.add_array("N", &arr0(1_i64)).unwrap();
        assert!(said(archive.finish().unwrap().get_ref()).ends_with("key m: is missing"));
        let mut archive = NpzWriter::new(Cursor::new(Vec::new()));
        archive.add_array("N", &arr0(1e300)).unwrap();
        let text = said(archive.finish().unwrap().get_ref());
        assert!(text.ends_with("key N: 1e300 is not a whole number from 1 to 1e9"), "{text}");
    }

    /// An archive with one damaged array: N, m and `dataTime` as given, deflated.
    fn with_time(npy: &[u8]) -> Vec<u8> {
        use zip::write::{SimpleFileOptions, ZipWriter};
        let mut archive = ZipWriter::new(Cursor::new(Vec::new()));
        for (key, value) in [("N", 1_i64), ("m", 1)] {
            let mut bytes = Vec::new();
            ndarray_npy::WriteNpyExt::write_npy(&arr0(value), &mut bytes).unwrap();
            archive.start_file(format!("{key}.npy"), SimpleFileOptions::default()).unwrap();
            archive.write_all(&bytes).unwrap();
        }
        archive.start_file("dataTime.npy", SimpleFileOptions::default()).unwrap();
        archive.write_all(npy).unwrap();
        archive.finish().unwrap().into_inner()
    }

    fn npy_of(shape: &str, data: &[u8]) -> Vec<u8> {
        let header = format!("{{'descr': '<f8', 'fortran_order': False, 'shape': {shape}, }}\n");
        let length = u16::try_from(header.len()).unwrap().to_le_bytes();
        [b"\x93NUMPY\x01\x00", &length[..], header.as_bytes(), data].concat()
    }

    #[test]
    fn a_header_that_claims_more_than_there_is_is_refused_before_memory_is_taken() {
        for (shape, data, words) in [
            ("(1000000000000000,)", 8, "[1000000000000000]"),
            ("(18446744073709551615, 18446744073709551615)", 8, "more numbers"),
            ("(99999999999999999999999999,)", 8, "shape"),
            ("(100000000,)", 16, "cut short"),
            ("(2,)", 24, "more bytes"),
        ] {
            let error = read(&with_time(&npy_of(shape, &vec![0; data])), Path::new("claim.npz")).unwrap_err().to_string();
            assert!(error.contains("claim.npz") && error.contains("dataTime") && error.contains(words), "{shape}: {error}");
        }
    }

    #[test]
    fn values_out_of_range_and_times_that_do_not_rise_are_refused_by_their_key() {
        for (bad, words) in [(f64::NAN, "value 2 is NaN"), (f64::INFINITY, "inf"), (-1e200, "-1")] {
            let mut recording = sample(3);
            recording.rates[1] = bad;
            let error = read(&bytes(&recording), Path::new("bad.npz")).unwrap_err().to_string();
            assert!(error.contains("dataAngularVelocities") && error.contains(words), "{error}");
        }
        let mut recording = sample(3);
        recording.time[2] = recording.time[1];
        let error = read(&bytes(&recording), Path::new("bad.npz")).unwrap_err().to_string();
        assert!(error.contains("dataTime") && error.contains("must rise"), "{error}");
    }

    #[test]
    fn an_entry_that_inflates_without_end_is_cut_off_at_its_header() {
        // 200 MB of zeros, deflated to 200 kB, behind a header that speaks of two numbers.
        let bomb = with_time(&npy_of("(2,)", &vec![0; 200_000_000]));
        assert!(bomb.len() < 1_000_000, "{}", bomb.len());
        let error = read(&bomb, Path::new("bomb.npz")).unwrap_err().to_string();
        assert!(error.contains("more bytes"), "{error}");
    }

    proptest! {
        #[test]
        fn a_damaged_archive_is_an_error_or_a_recording_but_never_a_panic(cut in 0usize..4000, flip in 0usize..4000, bit in 0u8..8) {
            let mut bytes = bytes(&sample(3));
            let flip = flip % bytes.len();
            bytes[flip] ^= 1 << bit;
            let _ = read(&bytes, Path::new("damaged.npz"));
            bytes.truncate(cut % bytes.len());
            prop_assert!(read(&bytes, Path::new("damaged.npz")).is_err());
        }
    }
}
