//! NPZ files with the reference's keys and shapes.
//!
//! Written: `dataTime` (T), `dataTheta`, `dataAngularVelocities`, `dataTor`, `dataMotorVoltages` (T, J), `dataPositions`,
//! `dataPositionVelocities` (T, J+2, 3), and as scalars `timeStep`, `simCycles`, `recordStepInterval`, `N`, `m`, `actuatorLength`,
//! `drivenFrequency`, `dampingEta`; for robots on the ground also `dateTime`, `frictionLow`, `frictionHigh`, `period`.
//! CGS units, as the reference. Read: the same; `dateTime` and keys that are not listed are ignored, `dampingEta` and the keys of
//! robots may be missing.

use std::io::{Cursor, Read, Seek, Write};
use std::path::Path;

use ndarray::{ArrayD, ArrayView, IxDyn, arr0};
use ndarray_npy::{
    NpzReader, NpzWriter, ReadNpyError, ReadNpzError, ReadableElement, WritableElement, WriteDataError, WriteNpzError,
};
use py_literal::Value;

use super::{GroundMeta, Meta, Recording, RecordingError};
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
/// [`RecordingError::Unwritable`], with `path` as its name, if the writer fails.
pub fn write(recording: &Recording, writer: impl Write, path: &Path) -> Result<(), RecordingError> {
    let unwritable = |error: &dyn std::fmt::Display| RecordingError::Unwritable { path: path.into(), reason: error.to_string() };
    // The zip format needs to seek, so the archive is made in memory.
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

/// Reads a recording, one of this program's or of the reference's.
///
/// # Errors
/// [`RecordingError::Unreadable`], with `path` as its name, if the archive is damaged, a key is missing or a shape does not fit.
pub fn read(bytes: &[u8], path: &Path) -> Result<Recording, RecordingError> {
    parse(bytes).map_err(|reason| RecordingError::Unreadable { path: path.into(), reason })
}

/// Reads a recording from a file.
///
/// # Errors
/// As [`read`], and if the file cannot be opened.
pub fn read_file(path: &Path) -> Result<Recording, RecordingError> {
    let bytes =
        std::fs::read(path).map_err(|error| RecordingError::Unreadable { path: path.into(), reason: error.to_string() })?;
    read(&bytes, path)
}

/// The archive's arrays, by key.
struct Arrays<R: Read + Seek>(NpzReader<R>);

impl<R: Read + Seek> Arrays<R> {
    fn array<T: ReadableElement>(&mut self, key: &str) -> Result<ArrayD<T>, String> {
        self.0
            .by_name(&format!("{key}.npy"))
            .or_else(|_| self.0.by_name(key))
            .map_err(|error| format!("key {key}: {}", plain(&error)))
    }

    /// The values of a float array of the given shape.
    fn values(&mut self, key: &str, shape: &[usize]) -> Result<Vec<f64>, String> {
        let array: ArrayD<f64> = self.array(key)?;
        if array.shape() != shape {
            return Err(format!("key {key}: the shape is {:?}, but the other keys make it {shape:?}", array.shape()));
        }
        // Not into_raw_vec: a Fortran-ordered array would come out transposed.
        Ok(array.iter().copied().collect())
    }

    /// A scalar, stored as a float or an integer.
    fn number(&mut self, key: &str) -> Result<f64, String> {
        let single = |shape: &[usize]| -> Result<(), String> {
            if shape.iter().product::<usize>() == 1 { Ok(()) } else { Err(format!("key {key}: a single number is needed")) }
        };
        if let Ok(array) = self.array::<f64>(key) {
            single(array.shape())?;
            return Ok(array.iter().copied().next().unwrap_or(f64::NAN));
        }
        let array = self.array::<i64>(key)?;
        single(array.shape())?;
        Ok(array.iter().next().map_or(f64::NAN, |&value| value as f64))
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

/// What the zip and npy readers say, in plain words.
fn plain(error: &ReadNpzError) -> String {
    let text = error.to_string();
    match error {
        ReadNpzError::Npy(ReadNpyError::WrongDescriptor(found)) => {
            format!("holds numbers of type {found}, which is not the one needed")
        }
        ReadNpzError::Zip(_) if text.contains("EOCD") => "there is no zip directory at its end".into(),
        ReadNpzError::Zip(_) if text.contains("file not found") => "is missing".into(),
        ReadNpzError::Zip(_) => format!("its zip archive is damaged ({text})"),
        ReadNpzError::Npy(_) => format!("its array is damaged ({text})"),
    }
}

fn parse(bytes: &[u8]) -> Result<Recording, String> {
    let reader =
        NpzReader::new(Cursor::new(bytes)).map_err(|error| format!("not an NPZ file, or cut short: {}", plain(&error)))?;
    let mut arrays = Arrays(reader);
    let actuators = arrays.count("N", 1.0)?;
    let motors_per_actuator = arrays.count("m", 1.0)?;
    let joints = usize::try_from(actuators * motors_per_actuator).map_err(|error| error.to_string())?;
    let time: ArrayD<f64> = arrays.array("dataTime")?;
    if time.ndim() != 1 {
        return Err(format!("key dataTime: the shape is {:?}, but one axis is needed", time.shape()));
    }
    let t = time.len();
    let ground = match (arrays.number("frictionLow"), arrays.number("frictionHigh")) {
        (Ok(friction_low), Ok(friction_high)) => Some(GroundMeta {
            friction_low,
            friction_high,
            period: arrays.number("period").unwrap_or(0.0),
            date_time: String::new(),
        }),
        _ => None,
    };
    Ok(Recording {
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
        time: time.iter().copied().collect(),
    })
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
        }
    }

    #[test]
    fn a_wrong_shape_is_named_by_its_key() {
        let mut recording = sample(3);
        recording.meta.motors_per_actuator = 2;
        recording.angles.extend([0.0; 6]);
        recording.rates.truncate(0);
        // Shapes that contradict each other cannot be written through this module, so an archive is put together by hand.
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
