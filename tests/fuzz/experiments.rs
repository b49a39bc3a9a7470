//! Experiment files, settings, and what is exported of experiments.

use std::fmt::Write;
use std::path::Path;

use serde_json::Value;
use sfers::effects::EFFECTS;
use sfers::engine::Engine;
use sfers::experiment::{self, Control, EngineKind, Experiment, SavedState, Source, StepConfig, presets::PRESETS};
use sfers::export;
use sfers::model::Segment;
use sfers::recording::measures::Measures;
use sfers::recording::{csv, npz};
use sfers::view::{self, Kind};
use toml::Table;

use crate::kinds::{Fate, Input, Outcome, failed, refused};
use crate::outputs;
use crate::random::Random;

/// Keys of `spec()` that are null where they do not apply.
const OPTIONAL: &[&str] = &["damping_eta", "damping_time", "period"];

/// A small experiment that makes sense as a rule, with all of the file format in it at times.
pub fn sensible(random: &mut Random) -> String {
    let mut out = String::new();
    let actuators = if random.once_in(3) { 5 } else { 1 + random.below(6) };
    let gait = actuators == 5 && random.once_in(3);
    if random.once_in(2) {
        let _ = writeln!(out, "[material]\npreset = \"parameter-{}\"", random.pick(&[2, 4]));
        for (key, value) in [
            ("actuator_length_mm", 100.0),
            ("width_mm", 20.0),
            ("gravity_m_s2", 9.81),
            ("piezo_modulus_gpa", 30.0),
            ("piezo_poisson", 0.31),
            ("piezo_thickness_um", 300.0),
            ("piezo_density_g_cm3", 5.4),
            ("d33_pm_per_v", 400.0),
            ("electrode_pitch_mm", 0.5),
            ("substrate_modulus_gpa", 4.0),
            ("substrate_thickness_um", 50.0),
            ("adhesive_thickness_um", 20.0),
        ] {
            if random.once_in(4) {
                let number = value * random.scale(0.5, 2.0);
                let _ = writeln!(out, "{key} = {:?}", random.wild(number));
            }
        }
    }
    let mount = *random.pick(&["ground", "ground", "clamped", "free"]);
    let _ = writeln!(out, "[robot]\nactuators = {actuators}\nmotors_per_actuator = {}\nmount = \"{mount}\"", 1 + random.below(4));
    if random.once_in(2) {
        let damping = random.scale(1e-3, 0.2);
        let _ = writeln!(out, "{} = {:?}", random.pick(&["damping_eta", "damping_time_s"]), random.wild(damping));
    }
    for (key, value) in [("collision_thickness_mm", 1.0), ("positive_gain", 1.7)] {
        if random.once_in(5) {
            let _ = writeln!(out, "{key} = {:?}", random.wild(value));
        }
    }
    if random.once_in(2) {
        let film = random.pick(&["both-ends", "right-end", "none"]);
        let _ = writeln!(out, "[robot.friction]\nlow = {:?}\nfilm = \"{film}\"", random.between(0.0, 5.0));
    }
    let _ = writeln!(out, "[drive]\n{}", if gait { gait_drive(random) } else { drive(random, actuators) });
    let planar = !random.once_in(3);
    let _ = writeln!(out, "[simulation]\nengine = \"{}\"", if planar { "planar" } else { "bullet" });
    if planar {
        if random.once_in(4) {
            out.push_str("start = \"settled\"\n");
        }
        if random.once_in(3) {
            out.push_str("friction = \"coulomb\"\n");
        }
    }
    if planar && random.once_in(40) {
        let _ = writeln!(
            out,
            "time_step_s = \"auto\"\nduration_s = {:?}\nstep_error = {:?}",
            random.scale(1e-4, 5e-3),
            random.scale(1e-4, 0.5)
        );
    } else {
        let step = random.scale(1e-6, 1e-3);
        let _ = writeln!(out, "time_step_s = {:?}\nsteps = {}", random.wild(step), 1 + random.below(60));
        if random.once_in(2) {
            let _ = writeln!(out, "record_every_steps = {}", 1 + random.below(8));
        }
    }
    for _ in 0..random.below(9) / 4 {
        effect(random, &mut out);
    }
    out
}

pub fn volts(random: &mut Random, count: usize) -> String {
    let values: Vec<String> = (0..count)
        .map(|_| {
            let volts = random.between(-2000.0, 1500.0);
            format!("{:?}", random.wild(volts))
        })
        .collect();
    format!("[{}]", values.join(", "))
}

fn drive(random: &mut Random, n: usize) -> String {
    let frequency = random.scale(0.1, 1e4);
    match random.below(4) {
        0 => format!("waveform = \"dc\"\nvoltages_v = {}", volts(random, n)),
        1 => format!("waveform = \"step\"\nvoltages_v = {}\nat_s = {:?}", volts(random, n), random.between(0.0, 0.01)),
        2 => format!("waveform = \"sine\"\namplitudes_v = {}\nfrequency_hz = {:?}", volts(random, n), random.wild(frequency)),
        _ => {
            let mut text = String::from("waveform = \"sequence\"\n");
            let periodic = random.once_in(2);
            if periodic {
                let _ = writeln!(text, "period_s = {:?}", random.wild(1.0 / frequency));
            }
            let (key, count) = (if periodic { "until" } else { "until_s" }, 1 + random.below(4));
            let phases: Vec<String> = (1..=count)
                .map(|i| format!("{{ {key} = {:?}, voltages_v = {} }}", i as f64 / count as f64, volts(random, n)))
                .collect();
            text + &format!("phases = [{}]", phases.join(", "))
        }
    }
}

fn gait_drive(random: &mut Random) -> String {
    let gait = random.pick(&sfers::drive::gait::GAITS);
    let key = gait.parameter.key();
    let value =
        if key == "(none)" || random.once_in(10) { String::new() } else { format!("{key} = {:?}\n", random.scale(1e-3, 1.0)) };
    let on = if random.once_in(2) { format!("on_voltages_v = {}\n", volts(random, 5)) } else { String::new() };
    format!("waveform = \"gait\"\ngait = \"{}\"\n{value}{on}", gait.name)
}

fn effect(random: &mut Random, out: &mut String) {
    let effect = random.pick(EFFECTS);
    let _ = writeln!(out, "[[effect]]\nid = \"{}\"", effect.id);
    for p in effect.parameters {
        if p.default.is_some() && random.once_in(2) {
            continue;
        }
        let [low, high] = p.bounds;
        let value = match random.below(6) {
            0 => low,
            1 => high,
            _ => random.between(low, high),
        };
        let value = if ["actuator", "motors_per_actuator"].contains(&p.name) { (1 + random.below(5)) as f64 } else { value };
        let _ = writeln!(out, "{} = {value:?}", p.name);
    }
}

/// A preset, the experiment of a recording, or one made up.
pub fn sample(random: &mut Random) -> String {
    match random.below(4) {
        0 => random.pick(PRESETS).text.to_owned(),
        1 => random.pick(sfers::crosscheck::BUILTIN).experiment.to_owned(),
        _ => sensible(random),
    }
}

/// An experiment file, sound or damaged as a text or as a table.
pub fn make(random: &mut Random) -> Input {
    let text = sample(random);
    Input::file("experiment.toml", damaged(random, text))
}

/// Leaves a third of TOML texts as they are and damages the others, as tables or as texts.
pub fn damaged(random: &mut Random, text: String) -> Vec<u8> {
    match (random.below(6), text.parse::<Table>()) {
        (0 | 1, _) => text.into_bytes(),
        (2..=4, Ok(mut table)) => {
            random.damage_table(&mut table);
            random.table_text(&table)
        }
        _ => {
            let mut bytes = text.into_bytes();
            random.damage(&mut bytes);
            bytes
        }
    }
}

fn source(input: &Input) -> Result<Source, String> {
    let mut source = Source::from_text("experiment.toml", input.text());
    input.words.iter().try_for_each(|setting| source.set(setting)).map_err(|error| error.to_string())?;
    Ok(source)
}

/// Reads an experiment and runs its beginning.
pub fn give(input: &Input, folder: &Path, random: &mut Random) -> Outcome {
    let mut source = match source(input) {
        Ok(source) => source,
        Err(error) => return refused(&error),
    };
    source.folder = folder.into();
    match experiment::experiment(&source) {
        Err(error) => refused(&error),
        // As long as the file says, and several times: only short ones are run here.
        Ok(checked) if is_auto(&checked) && (checked.steps as f64 * checked.time_step > 5e-3 || checked.robot.joints() > 12) => {
            Ok(Fate::Accepted)
        }
        Ok(checked) => run(&checked, random),
    }
}

pub fn is_auto(experiment: &Experiment) -> bool {
    matches!(experiment.config.simulation.time_step_s, Some(StepConfig::Word(_)))
}

/// Longest robots (joints) whose steps are taken; longer ones are built only. Bullet's work per step grows with the third power of the
/// number of bodies that touch the floor: 300 joints take half a second.
pub fn longest(engine: EngineKind) -> usize {
    match engine {
        EngineKind::Bullet => 100,
        EngineKind::Planar => 10_000,
    }
}

/// Cuts an experiment down to some steps: the number of steps is the user's business, what a step does is ours.
fn shortened(experiment: &Experiment) -> Experiment {
    let mut short = experiment.clone();
    let most = match experiment.engine {
        EngineKind::Bullet => 60,
        EngineKind::Planar => 120,
    };
    short.steps = short.steps.min((most / (1 + experiment.robot.joints() / 8)).max(2) as u64);
    short.record_every = short.record_every.min(short.steps);
    short
}

/// Runs the beginning of an experiment and looks at everything that can be had from it.
pub fn run(experiment: &Experiment, random: &mut Random) -> Outcome {
    outputs::json("spec", &experiment.spec(), OPTIONAL)?;
    let short = shortened(experiment);
    // Built for the whole length, run for the beginning.
    let mut engine = match experiment.engine() {
        Ok(engine) => engine,
        Err(error) => return failed(&error),
    };
    if experiment.robot.joints() > longest(experiment.engine) {
        return Ok(Fate::Accepted);
    }
    run_on(&short, engine.as_mut(), random)
}

/// The same on an engine that may be in the middle of a run.
pub fn run_on(short: &Experiment, engine: &mut dyn Engine, random: &mut Random) -> Outcome {
    let run = match experiment::run(short, engine, |_| Control::Continue) {
        Ok(run) => run,
        Err(error) => return failed(&error),
    };
    outputs::recording(&run.recording)?;
    let trouble = run.trouble(short);
    let energy = serde_json::to_value(run.energy).map_err(|error| error.to_string())?;
    outputs::json("energy", &energy, &["fault", "link"])?;
    if trouble.is_empty() {
        for (name, value) in Measures::of(&run.recording, short.robot.mount, short.drive.period()).named() {
            outputs::finite(&name, &[value])?;
        }
        outputs::finite("energy_error", &[run.energy.error()])?;
    }
    let path = Path::new("fuzz");
    if random.once_in(4) {
        let mut bytes = Vec::new();
        csv::write(&run.recording, &mut bytes, path).map_err(|error| format!("CSV: {error}"))?;
        outputs::table("CSV", &bytes, false)?;
    }
    if random.once_in(8) {
        let mut bytes = Vec::new();
        npz::write(&run.recording, &mut bytes, path).map_err(|error| format!("NPZ: {error}"))?;
        let back = npz::read(&bytes, path).map_err(|error| format!("NPZ is not read back: {error}"))?;
        if back.positions != run.recording.positions || back.angles != run.recording.angles {
            return Err("NPZ comes back with other numbers".into());
        }
    }
    if random.once_in(8) && !run.recording.is_empty() {
        outputs::svg(&random.pick(&[Kind::Shapes, Kind::Traces, Kind::Spectrum]).figure(&run.recording).svg())?;
        outputs::player(&view::player("fuzz", &run.recording, None))?;
    }
    if random.once_in(8) {
        saved(short, engine)?;
    }
    Ok(Fate::Accepted)
}

/// A state goes through its text into another engine.
fn saved(short: &Experiment, engine: &dyn Engine) -> Result<(), String> {
    let state = SavedState::of(short, engine).map_err(|error| format!("state: {error}"))?;
    let value = serde_json::to_value(&state).map_err(|error| error.to_string())?;
    outputs::json("state", &value, OPTIONAL)?;
    let read = match SavedState::parse(&value.to_string(), short) {
        // A run from a state at the limit may end beyond it.
        Err(error) if error.contains("no robot comes into such a state") => return Ok(()),
        read => read.map_err(|error| format!("state is not read back: {error}"))?,
    };
    let mut other = short.engine().map_err(|error| error.to_string())?;
    read.load_into(other.as_mut()).map_err(|error| format!("state is not taken back: {error}"))
}

/// Exports an experiment's robot; what is written has to be read again, with the same bodies, unless masses are fixed to them.
pub fn give_export(input: &Input, _: &Path, _: &mut Random) -> Outcome {
    let source = source(input)?;
    let experiment = match experiment::experiment(&source) {
        Ok(experiment) => experiment,
        Err(error) => return refused(&error),
    };
    if experiment.robot.joints() > 500 {
        return Ok(Fate::Accepted);
    }
    if let Err(error) = experiment.robot.check() {
        return refused(&error);
    }
    let names = ["name", "link"];
    let urdf = export::urdf(&experiment, "sfers urdf --set a--b=<&>");
    outputs::xml("URDF", &urdf, &names)?;
    outputs::xml("MJCF", &export::mjcf(&experiment, "sfers mjcf --"), &names)?;
    let sidecar: Value = export::sidecar(&experiment, "sfers urdf");
    outputs::json("sidecar", &sidecar, &["floor", "period"])?;
    let (segments, bodies) = (experiment.robot.segments(), experiment.robot.rigid_bodies());
    // A body with a mass fixed to it is no even box, which reading refuses unless the mass is lost in rounding.
    let is_loaded = bodies.iter().zip(&segments).any(|(body, segment)| body.mass != segment.mass);
    let written: Vec<Segment> = bodies.iter().zip(segments).map(|(body, s)| Segment { mass: body.mass, ..s }).collect();
    match export::bodies(&urdf, &experiment.robot) {
        Err(export::UrdfError::Element { .. }) if is_loaded => {}
        Err(error) => return Err(format!("URDF is not read back: {error}")),
        Ok(read) if read != written => return Err("URDF comes back with other bodies".into()),
        Ok(_) => {}
    }
    Ok(Fate::Accepted)
}
