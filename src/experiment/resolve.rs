//! From a config to an experiment that can be run: defaults filled in, units converted, everything checked.

use std::path::Path;

use super::config::{Config, ConfigError, DriveConfig, EffectConfig, Fault, PhaseConfig, Source, StepConfig};
use super::{EngineKind, Experiment, Start, auto, drive_csv};
use crate::drive::gait::{self, Parameter};
use crate::drive::{Drive, Waveform};
use crate::effects::{self, Applied, EffectError};
use crate::engine::FrictionModel;
use crate::model::units::{
    ba_from_gpa, cm_from_mm, cm_from_um, cm_per_v_from_pm_per_v, cm_s2_from_m_s2, v_per_cm_from_kv_per_mm,
};
use crate::model::{Damping, Extensions, Film, Friction, Material, ModelError, Mount, Robot, Segment};
use crate::recording::MAX_VALUES;
use crate::words::{not_one_of, number};

/// The reference's `dampingEta` where a file gives no damping.
const DEFAULT_DAMPING_ETA: f64 = 0.045;
/// Most steps of a run: up to here times are whole multiples of the step to a part in ten.
const MAX_STEPS: f64 = 1e15;
/// Most effects of one experiment; factors on one number stay finite together.
const MAX_EFFECTS: usize = 100;
/// Time steps (s) that times of up to `MAX_STEPS` of them are distinct and drawn for.
const MIN_TIME_STEP: f64 = 1e-12;
const MAX_TIME_STEP: f64 = 1e3;
const DEFAULT_ON_VOLTAGES: [f64; 5] = [520.0, 520.0, -1500.0, 520.0, 520.0];

/// What may go wrong on the way: a value, or a file that a value names.
pub(super) enum Trouble {
    Fault(Fault),
    Config(ConfigError),
}

impl From<Fault> for Trouble {
    fn from(fault: Fault) -> Self {
        Self::Fault(fault)
    }
}

/// Reads an experiment from its source.
///
/// # Errors
/// [`ConfigError`] with file, line and key.
pub fn experiment(source: &Source) -> Result<Experiment, ConfigError> {
    read(source, None)
}

/// Reads an experiment of a robot whose `bodies` come from elsewhere, as [`export::bodies`](crate::export::bodies) reads them.
///
/// # Errors
/// As [`experiment()`].
pub fn with_bodies(source: &Source, bodies: &[Segment]) -> Result<Experiment, ConfigError> {
    read(source, Some(bodies))
}

fn read(source: &Source, bodies: Option<&[Segment]>) -> Result<Experiment, ConfigError> {
    let config = source.parse()?;
    resolve(&config, &source.folder, bodies).map_err(|trouble| match trouble {
        Trouble::Fault(fault) => source.locate(fault),
        Trouble::Config(error) => error,
    })
}

fn resolve(config: &Config, folder: &Path, bodies: Option<&[Segment]>) -> Result<Experiment, Trouble> {
    let mut robot = robot(config)?;
    let effects = effects(config)?;
    if let Some(joints) = effects::joints(&effects) {
        robot.motors_per_actuator = joints;
    }
    robot.check().map_err(|ModelError::Value { key, value, needed }| {
        Fault::new(key, format!("is {}, but must be {needed}", number(value)))
    })?;
    let engines = [("bullet", EngineKind::Bullet), ("planar", EngineKind::Planar)];
    let engine = choose("simulation.engine", config.simulation.engine.as_deref(), EngineKind::Bullet, &engines)?;
    let starts = [("flat", Start::Flat), ("settled", Start::Settled)];
    let start = choose("simulation.start", config.simulation.start.as_deref(), Start::Flat, &starts)?;
    if start == Start::Settled && engine == EngineKind::Bullet {
        return Err(Fault::new("simulation.start", "settled needs engine = \"planar\"; the reference starts flat").into());
    }
    let models = [("coulomb", FrictionModel::Coulomb), ("convex", FrictionModel::Convex)];
    let friction = choose("simulation.friction", config.simulation.friction.as_deref(), FrictionModel::default(), &models)?;
    if config.simulation.friction.is_some() && engine == EngineKind::Bullet {
        return Err(Fault::new("simulation.friction", "belongs to engine = \"planar\"; Bullet has a model of its own").into());
    }
    let s = &config.simulation;
    if let Some(damping) = s.numerical_damping_per_s {
        let key = "simulation.numerical_damping_per_s";
        if engine == EngineKind::Bullet {
            return Err(Fault::new(key, "belongs to engine = \"planar\"; Bullet has none").into());
        }
        if !(damping.is_finite() && damping >= 0.0) {
            return Err(Fault::new(key, format!("is {}, but must be zero or more", number(damping))).into());
        }
    }
    if let Some(StepConfig::Word(word)) = &s.time_step_s {
        if word != "auto" {
            return Err(
                Fault::new("simulation.time_step_s", format!("{word:?} is neither a number of seconds nor \"auto\"")).into()
            );
        }
        if engine == EngineKind::Bullet {
            return Err(Fault::new("simulation.time_step_s", "auto needs engine = \"planar\"").into());
        }
        return auto::resolve(config, |config| resolve(config, folder, bodies));
    }
    for (key, given) in [("step_error", s.step_error.is_some()), ("step_measure", s.step_measure.is_some())] {
        if given {
            return Err(Fault::new(format!("simulation.{key}"), "belongs to time_step_s = \"auto\"").into());
        }
    }
    let (time_step, steps, record_every) = simulation(config, &robot, effects::time_step_scale(&effects))?;
    let record_from = s.record_from_step.unwrap_or(record_every - 1);
    if record_from >= steps {
        return Err(Fault::new("simulation.record_from_step", format!("is {record_from}, but the run has {steps} steps")).into());
    }
    // The reference is at 0 V in its first two steps.
    let first = if engine == EngineKind::Bullet { 2.0 * time_step } else { 0.0 };
    let waveform = waveform(&config.drive, &robot, first, folder)?;
    let mut drive = Drive { waveform, positive_gain: robot.positive_gain, delay: 0.0 };
    effects::apply(&effects, &mut robot, &mut drive).map_err(|error| Fault::new("effect", error.to_string()))?;
    robot.bodies = bodies.map(<[Segment]>::to_vec);
    Ok(Experiment {
        robot,
        drive,
        time_step,
        accuracy: None,
        steps,
        record_every,
        record_from,
        engine,
        start,
        friction,
        numerical_damping: config.simulation.numerical_damping_per_s,
        effects,
        config: config.clone(),
    })
}

/// The `[[effect]]` tables with their values checked; those at their off values are left out.
fn effects(config: &Config) -> Result<Vec<Applied>, Fault> {
    if config.effect.len() > MAX_EFFECTS {
        return Err(Fault::new("effect", format!("has {} tables; at most {MAX_EFFECTS} are possible", config.effect.len())));
    }
    let read = |table: &EffectConfig| {
        let effect = effects::find(&table.id).ok_or_else(|| EffectError::Unknown(table.id.clone()))?;
        effect.with(table.parameters.iter().map(|(name, value)| (name.as_str(), *value)))
    };
    let place =
        |(index, table)| read(table).map_err(|error: EffectError| Fault::new("effect", format!("table {}: {error}", index + 1)));
    let mut effects: Vec<_> = config.effect.iter().enumerate().map(place).collect::<Result<_, _>>()?;
    effects.retain(|applied| !applied.is_off());
    Ok(effects)
}

fn choose<T: Copy>(key: &str, value: Option<&str>, default: T, choices: &[(&str, T)]) -> Result<T, Fault> {
    let Some(value) = value else { return Ok(default) };
    choices.iter().find(|(name, _)| *name == value).map(|&(_, choice)| choice).ok_or_else(|| {
        let names: Vec<_> = choices.iter().map(|(name, _)| *name).collect();
        Fault::new(key, not_one_of(value, &names))
    })
}

fn robot(config: &Config) -> Result<Robot, Fault> {
    let m = &config.material;
    let mut material = choose(
        "material.preset",
        m.preset.as_deref(),
        Material::PARAMETER_2,
        &[("parameter-2", Material::PARAMETER_2), ("parameter-4", Material::PARAMETER_4)],
    )?;
    let same = |value: f64| value;
    type Override<'a> = (&'a mut f64, Option<f64>, fn(f64) -> f64);
    let overrides: [Override; 18] = [
        (&mut material.actuator_length, m.actuator_length_mm, cm_from_mm),
        (&mut material.width, m.width_mm, cm_from_mm),
        (&mut material.gravity, m.gravity_m_s2, cm_s2_from_m_s2),
        (&mut material.piezo_modulus, m.piezo_modulus_gpa, ba_from_gpa),
        (&mut material.piezo_poisson, m.piezo_poisson, same),
        (&mut material.piezo_thickness, m.piezo_thickness_um, cm_from_um),
        (&mut material.piezo_density, m.piezo_density_g_cm3, same),
        (&mut material.d33, m.d33_pm_per_v, cm_per_v_from_pm_per_v),
        (&mut material.electrode_pitch, m.electrode_pitch_mm, cm_from_mm),
        (&mut material.substrate_modulus, m.substrate_modulus_gpa, ba_from_gpa),
        (&mut material.substrate_poisson, m.substrate_poisson, same),
        (&mut material.substrate_thickness, m.substrate_thickness_um, cm_from_um),
        (&mut material.substrate_density, m.substrate_density_g_cm3, same),
        (&mut material.adhesive_modulus, m.adhesive_modulus_gpa, ba_from_gpa),
        (&mut material.adhesive_thickness, m.adhesive_thickness_um, cm_from_um),
        (&mut material.adhesive_density, m.adhesive_density_g_cm3, same),
        (&mut material.max_field, m.max_field_kv_mm, v_per_cm_from_kv_per_mm),
        (&mut material.max_strain, m.max_strain, same),
    ];
    for (slot, value, convert) in overrides {
        if let Some(value) = value {
            *slot = convert(value);
        }
    }
    let r = &config.robot;
    let damping = match (r.damping_eta, r.damping_time_s) {
        (Some(_), Some(_)) => {
            return Err(Fault::new("robot.damping_time_s", "damping_eta is given as well; keep one of the two"));
        }
        (None, Some(time)) => Damping::Time(time),
        (eta, None) => Damping::Eta(eta.unwrap_or(DEFAULT_DAMPING_ETA)),
    };
    let f = &r.friction;
    let mounts = [("ground", Mount::Ground), ("clamped", Mount::Clamped), ("free", Mount::Free)];
    let films = [("both-ends", Film::BothEnds), ("right-end", Film::RightEnd), ("none", Film::None)];
    Ok(Robot {
        material,
        actuators: r.actuators.unwrap_or(5),
        motors_per_actuator: r.motors_per_actuator.unwrap_or(3),
        mount: choose("robot.mount", r.mount.as_deref(), Mount::Ground, &mounts)?,
        damping,
        collision_thickness: r.collision_thickness_mm.map_or(0.1, cm_from_mm),
        positive_gain: r.positive_gain.unwrap_or(1.0),
        friction: Friction {
            ground: f.ground.unwrap_or(1.0),
            low: f.low.unwrap_or(0.2),
            high: f.high.unwrap_or(4.0),
            film: choose("robot.friction.film", f.film.as_deref(), Film::BothEnds, &films)?,
            film_fraction: f.film_fraction.unwrap_or(0.5),
        },
        bodies: None,
        extensions: Extensions::default(),
    })
}

/// Time step (s), number of steps, and steps between records.
fn simulation(config: &Config, robot: &Robot, scale: f64) -> Result<(f64, u64, u64), Fault> {
    let s = &config.simulation;
    let positive = |key: &str, value: f64| {
        if value.is_finite() && value > 0.0 {
            Ok(value)
        } else {
            Err(Fault::new(key, format!("is {}, but must be positive", number(value))))
        }
    };
    let Some(StepConfig::Seconds(time_step)) = s.time_step_s else {
        return Err(Fault::new("simulation.time_step_s", "is missing"));
    };
    let time_step = positive("simulation.time_step_s", time_step)? * scale;
    if !(MIN_TIME_STEP..=MAX_TIME_STEP).contains(&time_step) {
        let message = format!("is {} s; between {MIN_TIME_STEP:e} and {MAX_TIME_STEP:e} s are possible", number(time_step));
        return Err(Fault::new("simulation.time_step_s", message));
    }
    let in_steps = |key: &str, seconds: f64| {
        let steps = (positive(key, seconds)? / time_step).round();
        if (1.0..=MAX_STEPS).contains(&steps) {
            Ok(steps as u64)
        } else {
            Err(Fault::new(
                key,
                format!("is {} time steps of {} s; between 1 and {MAX_STEPS:e} are possible", number(steps), number(time_step)),
            ))
        }
    };
    let steps = match (s.steps, s.duration_s) {
        (Some(_), Some(_)) => {
            return Err(Fault::new("simulation.duration_s", "steps is given as well; keep one of the two"));
        }
        (None, None) => return Err(Fault::new("simulation.duration_s", "is missing; give duration_s or steps")),
        (Some(0), None) => return Err(Fault::new("simulation.steps", "is 0, but at least one step is needed")),
        (Some(steps), None) if steps as f64 > MAX_STEPS => {
            return Err(Fault::new("simulation.steps", format!("is {steps}; between 1 and {MAX_STEPS:e} are possible")));
        }
        (Some(steps), None) => steps,
        (None, Some(duration)) => in_steps("simulation.duration_s", duration)?,
    };
    let (record_key, record_every) = match (s.record_every_steps, s.record_every_s) {
        (Some(_), Some(_)) => {
            return Err(Fault::new("simulation.record_every_s", "record_every_steps is given as well; keep one of the two"));
        }
        (Some(every), None) => ("simulation.record_every_steps", every),
        (None, Some(seconds)) => ("simulation.record_every_s", in_steps("simulation.record_every_s", seconds)?),
        // About a thousand records.
        (None, None) => ("simulation.record_every_steps", (steps / 1000).max(1)),
    };
    if record_every == 0 || record_every > steps {
        return Err(Fault::new(record_key, format!("is {record_every} steps, but the run has {steps}")));
    }
    let values = (steps / record_every + 2) as f64 * (13.0 * robot.joints() as f64 + 19.0);
    if values > MAX_VALUES {
        let least = (record_every as f64 * values / MAX_VALUES).ceil();
        return Err(Fault::new(
            record_key,
            format!("{values:.1e} numbers would be recorded; record at most every {least:.0} steps"),
        ));
    }
    Ok((time_step, steps, record_every))
}

/// The keys of `[drive]` that are present, for finding those that do not belong to the waveform.
fn present(d: &DriveConfig) -> Vec<&'static str> {
    [
        ("gait", d.gait.is_some()),
        ("period_s", d.period_s.is_some()),
        ("frequency_hz", d.frequency_hz.is_some()),
        ("delay_s", d.delay_s.is_some()),
        ("on_time_s", d.on_time_s.is_some()),
        ("on_voltages_v", d.on_voltages_v.is_some()),
        ("voltages_v", d.voltages_v.is_some()),
        ("amplitude_v", d.amplitude_v.is_some()),
        ("amplitudes_v", d.amplitudes_v.is_some()),
        ("at_s", d.at_s.is_some()),
        ("phases", d.phases.is_some()),
        ("file", d.file.is_some()),
    ]
    .into_iter()
    .filter_map(|(key, present)| present.then_some(key))
    .collect()
}

fn only(d: &DriveConfig, whose: &str, allowed: &[&str]) -> Result<(), Fault> {
    match present(d).into_iter().find(|key| !allowed.contains(key)) {
        Some(key) => {
            Err(Fault::new(format!("drive.{key}"), format!("does not belong to {whose}; it takes {}", allowed.join(", "))))
        }
        None => Ok(()),
    }
}

fn needed<'a, T>(key: &str, value: Option<&'a T>) -> Result<&'a T, Fault> {
    value.ok_or_else(|| Fault::new(key, "is missing"))
}

fn finite(key: &str, value: f64) -> Result<f64, Fault> {
    if value.is_finite() { Ok(value) } else { Err(Fault::new(key, format!("is {}, but must be a finite number", number(value)))) }
}

fn positive(key: &str, value: f64) -> Result<f64, Fault> {
    if finite(key, value)? > 0.0 {
        Ok(value)
    } else {
        Err(Fault::new(key, format!("is {}, but must be positive", number(value))))
    }
}

/// Checks that a voltage is a number that the material bears.
fn voltage(key: &str, value: f64, robot: &Robot) -> Result<f64, Fault> {
    robot.check_voltage(finite(key, value)?).map_err(|reason| Fault::new(key, reason))?;
    Ok(value)
}

/// Checks that there is one voltage per actuator, and each of them.
fn voltages(key: &str, values: &[f64], robot: &Robot) -> Result<Vec<f64>, Fault> {
    if values.len() != robot.actuators {
        return Err(Fault::new(key, format!("has {} values for {} actuators", values.len(), robot.actuators)));
    }
    values.iter().try_for_each(|&value| voltage(key, value, robot).map(drop))?;
    Ok(values.to_vec())
}

fn period(d: &DriveConfig) -> Result<Option<f64>, Fault> {
    match (d.period_s, d.frequency_hz) {
        (Some(_), Some(_)) => Err(Fault::new("drive.frequency_hz", "period_s is given as well; keep one of the two")),
        (Some(period), None) => positive("drive.period_s", period).map(Some),
        (None, Some(frequency)) => positive("drive.period_s", 1.0 / positive("drive.frequency_hz", frequency)?).map(Some),
        (None, None) => Ok(None),
    }
}

fn waveform(d: &DriveConfig, robot: &Robot, first: f64, folder: &Path) -> Result<Waveform, Trouble> {
    let name = needed("drive.waveform", d.waveform.as_ref())?;
    let own = format!("waveform {name}");
    Ok(match name.as_str() {
        "gait" => gait_waveform(d, robot)?,
        "dc" => {
            only(d, &own, &["voltages_v"])?;
            Waveform::Dc(voltages("drive.voltages_v", needed("drive.voltages_v", d.voltages_v.as_ref())?, robot)?)
        }
        "sine" => {
            only(d, &own, &["amplitude_v", "amplitudes_v", "frequency_hz"])?;
            let amplitudes = match (d.amplitude_v, &d.amplitudes_v) {
                (Some(_), Some(_)) => {
                    return Err(Fault::new("drive.amplitudes_v", "amplitude_v is given as well; keep one of the two").into());
                }
                (Some(amplitude), None) => vec![voltage("drive.amplitude_v", amplitude, robot)?; robot.actuators],
                (None, Some(amplitudes)) => voltages("drive.amplitudes_v", amplitudes, robot)?,
                (None, None) => return Err(Fault::new("drive.amplitude_v", "is missing").into()),
            };
            let frequency = positive("drive.frequency_hz", *needed("drive.frequency_hz", d.frequency_hz.as_ref())?)?;
            Waveform::Sine { amplitudes, frequency }
        }
        "step" => {
            only(d, &own, &["voltages_v", "at_s"])?;
            let at = finite("drive.at_s", d.at_s.unwrap_or(0.0))?;
            let values = needed("drive.voltages_v", d.voltages_v.as_ref())?;
            // The reference holds 0 V for the first two steps.
            Waveform::Step { voltages: voltages("drive.voltages_v", values, robot)?, at: at.max(first) }
        }
        "sequence" => sequence(d, robot)?,
        "csv" => {
            only(d, &own, &["file"])?;
            let path = folder.join(needed("drive.file", d.file.as_ref())?);
            Waveform::Table(drive_csv::read(&path, robot).map_err(Trouble::Config)?)
        }
        other => {
            let waveforms = ["gait", "dc", "sine", "step", "sequence", "csv"];
            return Err(Fault::new("drive.waveform", not_one_of(other, &waveforms)).into());
        }
    })
}

fn gait_waveform(d: &DriveConfig, robot: &Robot) -> Result<Waveform, Fault> {
    let name = needed("drive.gait", d.gait.as_ref())?;
    let gait = gait::find(name).ok_or_else(|| {
        let names: Vec<_> = gait::GAITS.iter().map(|gait| gait.name).collect();
        Fault::new("drive.gait", not_one_of(name, &names))
    })?;
    if robot.actuators != 5 {
        let message =
            format!("gaits are written for 5 actuators, but robot.actuators is {}; use waveform sequence", robot.actuators);
        return Err(Fault::new("drive.gait", message));
    }
    let own = format!("gait {name}");
    let mut allowed = vec!["gait", "on_voltages_v"];
    match gait.parameter {
        Parameter::Nothing => {}
        Parameter::Period => allowed.extend(["period_s", "frequency_hz"]),
        Parameter::Delay => allowed.push("delay_s"),
        Parameter::OnTime => allowed.push("on_time_s"),
    }
    only(d, &own, &allowed)?;
    let key = format!("drive.{}", gait.parameter.key());
    let given = match gait.parameter {
        Parameter::Nothing => Some(0.0),
        Parameter::Period => period(d)?,
        Parameter::Delay => d.delay_s,
        Parameter::OnTime => d.on_time_s,
    };
    let parameter =
        given.or(gait.default_parameter).ok_or_else(|| Fault::new(&key, format!("is missing; gait {name} needs it")))?;
    finite(&key, parameter)?;
    if parameter < 0.0 && gait.once_if_negative.is_empty() {
        return Err(Fault::new(&key, format!("is {}, but must not be negative for gait {name}", number(parameter))));
    }
    let on_voltages = voltages("drive.on_voltages_v", d.on_voltages_v.as_deref().unwrap_or(&DEFAULT_ON_VOLTAGES), robot)?;
    Ok(Waveform::Gait { gait, parameter, on_voltages })
}

fn sequence(d: &DriveConfig, robot: &Robot) -> Result<Waveform, Fault> {
    only(d, "waveform sequence", &["period_s", "frequency_hz", "phases", "on_voltages_v"])?;
    let period = period(d)?;
    let phases = needed("drive.phases", d.phases.as_ref())?;
    if phases.is_empty() {
        return Err(Fault::new("drive.phases", "is empty"));
    }
    let on_voltages = match &d.on_voltages_v {
        Some(values) => Some(voltages("drive.on_voltages_v", values, robot)?),
        None if robot.actuators == DEFAULT_ON_VOLTAGES.len() && phases.iter().any(|phase| phase.on.is_some()) => {
            Some(voltages("drive.on_voltages_v", &DEFAULT_ON_VOLTAGES, robot)?)
        }
        None => None,
    };
    let mut last = 0.0;
    let mut resolved = Vec::new();
    for (index, phase) in phases.iter().enumerate() {
        let fault = |message: String| Fault::new("drive.phases", format!("phase {}: {message}", index + 1));
        let until = phase_end(phase, period, index + 1 == phases.len()).map_err(fault)?;
        if until.is_nan() || until <= last {
            return Err(fault(format!("ends at {} s, but must end after {} s", number(until), number(last))));
        }
        last = until;
        resolved.push((until, phase_voltages(phase, on_voltages.as_deref(), robot).map_err(fault)?));
    }
    Ok(Waveform::Sequence { period, phases: resolved })
}

/// End of a phase (s). The last phase may go without: it holds.
fn phase_end(phase: &PhaseConfig, period: Option<f64>, last: bool) -> Result<f64, String> {
    match (phase.until, phase.until_s, period) {
        (Some(_), Some(_), _) => Err("until and until_s are both given; keep one of the two".into()),
        (Some(share), None, Some(period)) => Ok(share * period),
        (Some(_), None, None) => Err("until is a share of the period, but there is no period_s; use until_s".into()),
        (None, Some(seconds), _) => Ok(seconds),
        (None, None, _) if last => Ok(f64::INFINITY),
        (None, None, _) => Err("until or until_s is missing".into()),
    }
}

fn phase_voltages(phase: &PhaseConfig, on: Option<&[f64]>, robot: &Robot) -> Result<Vec<f64>, String> {
    match (&phase.on, &phase.voltages_v) {
        (None, Some(values)) => voltages("voltages_v", values, robot).map_err(|fault| format!("voltages_v {}", fault.message)),
        (Some(mask), None) => {
            if mask.len() != robot.actuators || mask.bytes().any(|b| b != b'0' && b != b'1') {
                return Err(format!("on = {mask:?} is not a mask of {} times 0 or 1", robot.actuators));
            }
            let on = on.ok_or("on needs drive.on_voltages_v for a robot that has not 5 actuators")?;
            Ok(mask.bytes().zip(on).map(|(bit, &v)| if bit == b'1' { v } else { 0.0 }).collect())
        }
        _ => Err("give either on or voltages_v".into()),
    }
}
