//! Recordings (NPZ), robots (URDF) and saved states (JSON).

use std::path::Path;
use std::sync::LazyLock;

use sfers::crosscheck::{BUILTIN, compare};
use sfers::experiment::{self, Control, Experiment, SavedState, Source};
use sfers::export;
use sfers::model::Mount;
use sfers::recording::measures::Measures;
use sfers::recording::{Recording, csv, npz};
use sfers::view::{self, Kind};

use crate::experiments;
use crate::kinds::{Fate, Input, Outcome, failed, refused};
use crate::outputs;
use crate::random::Random;

/// A small experiment of either engine.
fn small(engine: &str, more: &str) -> Experiment {
    let text = format!(
        "[robot]\nactuators = 2\nmotors_per_actuator = 2\n[drive]\nwaveform = \"sine\"\namplitude_v = -500.0\nfrequency_hz = 100.0\n\
         [simulation]\nengine = \"{engine}\"\ntime_step_s = 1e-4\nsteps = 40\nrecord_every_steps = 4\n{more}"
    );
    experiment::experiment(&Source::from_text("small", text)).expect("the small experiment is sound")
}

static SMALL: LazyLock<[Experiment; 4]> = LazyLock::new(|| {
    let memory = "[[effect]]\nid = \"hysteresis\"\nwidth = 0.2\n[[effect]]\nid = \"creep\"\nper_decade = 0.1\n";
    [small("bullet", ""), small("planar", ""), small("planar", memory), small("bullet", memory)]
});

static RECORDED: LazyLock<Recording> = LazyLock::new(|| {
    let mut engine = SMALL[1].engine().expect("the small robot can be built");
    experiment::run(&SMALL[1], engine.as_mut(), |_| Control::Continue).expect("the small experiment runs").recording
});

/// One entry of an archive: name, header without its frame, and the numbers.
struct Array {
    name: String,
    header: String,
    data: Vec<u8>,
}

fn array(name: &str, shape: &[usize], values: &[f64]) -> Array {
    let sizes: String = shape.iter().map(|n| format!("{n}, ")).collect();
    Array {
        name: name.into(),
        header: format!("{{'descr': '<f8', 'fortran_order': False, 'shape': ({sizes}), }}"),
        data: values.iter().flat_map(|value| value.to_le_bytes()).collect(),
    }
}

fn whole(name: &str, value: i64) -> Array {
    let header = "{'descr': '<i8', 'fortran_order': False, 'shape': (), }".into();
    Array { name: name.into(), header, data: value.to_le_bytes().to_vec() }
}

/// The arrays of a recording, as the module `npz` documents them.
fn arrays(r: &Recording) -> Vec<Array> {
    let (t, j) = (r.len(), r.joints());
    vec![
        whole("N", r.meta.actuators as i64),
        whole("m", r.meta.motors_per_actuator as i64),
        whole("simCycles", r.meta.steps as i64),
        whole("recordStepInterval", r.meta.record_every as i64),
        array("dataTime", &[t], &r.time),
        array("dataTheta", &[t, j], &r.angles),
        array("dataAngularVelocities", &[t, j], &r.rates),
        array("dataTor", &[t, j], &r.torques),
        array("dataMotorVoltages", &[t, j], &r.motor_voltages),
        array("dataPositions", &[t, j + 2, 3], &r.positions),
        array("dataPositionVelocities", &[t, j + 2, 3], &r.velocities),
        array("timeStep", &[], &[r.meta.time_step]),
        array("actuatorLength", &[], &[r.meta.actuator_length]),
        array("drivenFrequency", &[], &[r.meta.driven_frequency]),
        array("dampingEta", &[], &[r.meta.damping_eta]),
        array("frictionLow", &[], &[0.2]),
        array("frictionHigh", &[], &[4.0]),
        array("period", &[], &[0.1]),
    ]
}

/// The NPY format, version 1: magic, length of the header, header, data.
fn npy(array: &Array) -> Vec<u8> {
    let mut out = b"\x93NUMPY\x01\x00".to_vec();
    let header = format!("{}\n", array.header);
    out.extend((header.len() as u16).to_le_bytes());
    out.extend(header.bytes());
    out.extend(&array.data);
    out
}

fn crc32(bytes: &[u8]) -> u32 {
    !bytes
        .iter()
        .fold(!0_u32, |crc, b| (0..8).fold(crc ^ u32::from(*b), |crc, _| (crc >> 1) ^ if crc & 1 == 1 { 0xedb8_8320 } else { 0 }))
}

/// A ZIP archive without compression (PKWARE's APPNOTE, 4.3: local headers, central directory, its end).
fn zip(entries: &[(String, Vec<u8>)]) -> Vec<u8> {
    let (mut out, mut directory) = (Vec::new(), Vec::new());
    for (name, bytes) in entries {
        let start = out.len() as u32;
        let mut common = vec![20, 0, 0, 0, 0, 0, 0, 0, 0x21, 0];
        for number in [crc32(bytes), bytes.len() as u32, bytes.len() as u32] {
            common.extend(number.to_le_bytes());
        }
        common.extend((name.len() as u16).to_le_bytes());
        common.extend([0, 0]);
        out.extend(b"PK\x03\x04");
        out.extend(&common);
        out.extend(name.bytes());
        out.extend(bytes);
        directory.extend(b"PK\x01\x02\x14\x00");
        directory.extend(&common);
        directory.extend([0; 10]);
        directory.extend(start.to_le_bytes());
        directory.extend(name.bytes());
    }
    let (start, size, count) = (out.len() as u32, directory.len() as u32, (entries.len() as u16).to_le_bytes());
    out.extend(directory);
    out.extend(b"PK\x05\x06\0\0\0\0");
    out.extend([count, count].concat());
    out.extend(size.to_le_bytes());
    out.extend(start.to_le_bytes());
    out.extend([0, 0]);
    out
}

/// An archive of the reference or of this program, damaged as bytes, or put together from arrays of which some are odd.
pub fn make_recording(random: &mut Random) -> Input {
    let mut bytes = match random.below(40) {
        0 => BUILTIN[0].recording.to_vec(),
        1..=9 => {
            let mut bytes = Vec::new();
            npz::write(&RECORDED, &mut bytes, Path::new("fuzz")).expect("a sound recording can be written");
            bytes
        }
        _ => {
            let mut arrays = arrays(&RECORDED);
            for _ in 0..random.below(3) {
                odd_array(random, &mut arrays);
            }
            zip(&arrays.iter().map(|array| (format!("{}.npy", array.name), npy(array))).collect::<Vec<_>>())
        }
    };
    if random.once_in(4) {
        random.damage(&mut bytes);
    }
    Input::file("recording.npz", bytes)
}

fn odd_array(random: &mut Random, arrays: &mut Vec<Array>) {
    let at = random.below(arrays.len());
    let other = random.below(arrays.len());
    match random.below(10) {
        0 => drop(arrays.remove(at)),
        1 => arrays[at].name = arrays[other].name.clone(),
        2 => {
            let mut header = std::mem::take(&mut arrays[at].header).into_bytes();
            random.damage(&mut header);
            arrays[at].header = String::from_utf8_lossy(&header).into_owned();
        }
        3 => {
            let sizes = format!("({}, {}, ", random.number(), random.number());
            arrays[at].header = arrays[at].header.replacen('(', &sizes, 1);
        }
        4 => {
            let kind = *random.pick(&["<f4", "<i8", "<u8", "|b1", "<U16", "|O", ">f8", "<c16", "|V8"]);
            arrays[at].header = arrays[at].header.replace("<f8", kind).replace("<i8", kind);
        }
        5 => arrays[at].header = arrays[at].header.replace("False", "True"),
        6 => random.damage(&mut arrays[at].data),
        _ => {
            // A number of the data becomes extreme.
            let extreme = random.number().parse::<f64>().unwrap_or(f64::NAN);
            let data = &mut arrays[at].data;
            let places = data.len() / 8;
            if places > 0 {
                let place = 8 * random.below(places);
                let integer = arrays[at].header.contains("<i8");
                let bytes = if integer { (extreme as i64).to_le_bytes() } else { extreme.to_le_bytes() };
                arrays[at].data[place..place + 8].copy_from_slice(&bytes);
            }
        }
    }
}

/// Reads a recording and makes of it whatever the program makes of recordings.
pub fn give_recording(input: &Input, _: &Path, random: &mut Random) -> Outcome {
    match npz::read(input.bytes(), Path::new("recording.npz")) {
        Ok(recording) if recording.is_empty() => refused(&"holds no records"),
        Ok(recording) => {
            outputs::recording(&recording)?;
            seen(&recording, random)?;
            let mut bytes = Vec::new();
            csv::write(&recording, &mut bytes, Path::new("fuzz")).map_err(|error| format!("CSV: {error}"))?;
            outputs::table("CSV", &bytes, false)?;
            if random.once_in(4) {
                let report = serde_json::to_value(compare(&RECORDED, &recording)).map_err(|error| error.to_string())?;
                outputs::json("report", &report, &["difference", "largest_ulp"])?;
            }
            Ok(Fate::Accepted)
        }
        Err(error) => refused(&error),
    }
}

/// A recording as CSV, sound or damaged, at times with its manifest.
pub fn make_table(random: &mut Random) -> Input {
    let mut bytes = Vec::new();
    csv::write(&RECORDED, &mut bytes, Path::new("fuzz")).expect("a sound recording can be written");
    if !random.once_in(5) {
        random.damage(&mut bytes);
    }
    let mut input = Input::file("recording.csv", bytes);
    if random.once_in(2) {
        let mut manifest = serde_json::json!({"schema": 1, "resolved_cgs": SMALL[1].spec()}).to_string().into_bytes();
        if random.once_in(2) {
            random.damage(&mut manifest);
        }
        input.files.push(("recording.csv.manifest.json".into(), manifest));
    }
    input
}

/// Reads a recording from CSV and makes of it whatever the program makes of recordings.
pub fn give_table(input: &Input, folder: &Path, random: &mut Random) -> Outcome {
    input.write(folder)?;
    match csv::read_file(&folder.join("recording.csv")) {
        Ok((recording, _)) if recording.is_empty() => refused(&"holds no records"),
        Ok((recording, _)) => seen(&recording, random).map(|()| Fate::Accepted),
        Err(error) => refused(&error),
    }
}

/// Figures, page, film and measures of a recording.
fn seen(recording: &Recording, random: &mut Random) -> Result<(), String> {
    outputs::svg(&random.pick(&[Kind::Shapes, Kind::Traces, Kind::Spectrum]).figure(recording).svg())?;
    if random.once_in(4) {
        outputs::player(&view::player("a < b", recording, None))?;
    }
    if random.once_in(20) {
        // A film at a speed that makes a frame or two of it.
        let speed = recording.time.last().map(|t| t * 20.0).filter(|speed| *speed > 0.0 && speed.is_finite());
        let gif = view::gif(recording, speed.or(Some(1e9))).map_err(|error| format!("GIF: {error}"))?;
        if !gif.starts_with(b"GIF89a") {
            return Err("GIF: not one".into());
        }
    }
    let mount = *random.pick(&[Mount::Ground, Mount::Clamped, Mount::Free]);
    let period = recording.meta.ground.as_ref().map(|ground| ground.period).filter(|period| period.is_finite());
    let measures = Measures::of(recording, mount, period).named();
    measures.into_iter().try_for_each(|(name, value)| outputs::finite(&name, &[value]))
}

/// A robot as it is exported, sound or damaged.
pub fn make_urdf(random: &mut Random) -> Input {
    let mut bytes = export::urdf(&SMALL[random.below(2)], "sfers urdf small.toml").into_bytes();
    if !random.once_in(5) {
        random.damage(&mut bytes);
    }
    Input::file("robot.urdf", bytes)
}

/// Runs an experiment on the bodies of a URDF.
pub fn give_urdf(input: &Input, _: &Path, random: &mut Random) -> Outcome {
    let mut experiment = SMALL[random.below(4)].clone();
    match export::bodies(&input.text(), &experiment.robot) {
        Ok(bodies) => experiment.robot.bodies = Some(bodies),
        Err(error) => return refused(&error),
    }
    experiments::run(&experiment, random)
}

/// A state of a run, sound or damaged. The word says of which experiment.
pub fn make_state(random: &mut Random) -> Input {
    let which = random.below(4);
    let experiment = &SMALL[which];
    let mut engine = experiment.engine().expect("the small robot can be built");
    let mut begin = experiment.clone();
    begin.steps = 1 + random.below(20) as u64;
    begin.record_every = begin.record_every.min(begin.steps);
    experiment::run(&begin, engine.as_mut(), |_| Control::Continue).expect("the small experiment runs");
    let state = SavedState::of(experiment, engine.as_ref()).expect("a state can be saved");
    let mut value = serde_json::to_value(&state).expect("a state is JSON");
    if random.once_in(2)
        && let Some(numbers) = value["state"].as_array_mut()
    {
        for _ in 0..1 + random.below(3) {
            let at = random.below(numbers.len());
            numbers[at] = random.number().parse::<f64>().map_or(serde_json::Value::Null, |number| number.into());
        }
        if random.once_in(8) {
            numbers.truncate(random.below(numbers.len()));
        }
        if random.once_in(8) {
            value["step"] = random.number().parse::<u64>().unwrap_or(7).into();
        }
    }
    let mut bytes = value.to_string().into_bytes();
    if random.once_in(3) {
        random.damage(&mut bytes);
    }
    Input { files: vec![("state.json".into(), bytes)], words: vec![which.to_string()] }
}

/// Goes on from a state.
pub fn give_state(input: &Input, _: &Path, random: &mut Random) -> Outcome {
    let which: usize = input.words[0].parse().map_err(|_| "harness: no number")?;
    let experiment = &SMALL[which];
    let state = match SavedState::parse(&input.text(), experiment) {
        Ok(state) => state,
        Err(error) => return refused(&error),
    };
    if state.step >= experiment.steps {
        return refused(&"the state is behind the end");
    }
    let mut engine = experiment.engine().map_err(|error| error.to_string())?;
    match state.load_into(engine.as_mut()) {
        Ok(()) => experiments::run_on(experiment, engine.as_mut(), random),
        Err(error) => failed(&error),
    }
}
