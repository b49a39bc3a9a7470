//! From a config to an experiment that can be run: defaults filled in, units converted, everything checked.

mod drive;
mod drive_csv;
mod driven;
mod steps;

#[cfg(test)]
pub(crate) use steps::DEFAULT_STEP_ERROR;

use std::path::Path;

use self::driven::Driven;
use self::steps::Steps;
use super::config::{Config, ConfigError, EffectConfig, EffectValue, Fault, Source};
use super::{EngineKind, Experiment, Start};
use crate::drive::{Drive, check_positive_gain};
use crate::effects::{self, Applied, EffectError, Given};
use crate::engine::FrictionModel;
use crate::model::units::{
    ba_from_gpa, cm_from_mm, cm_from_um, cm_per_v_from_pm_per_v, cm_s2_from_m_s2, v_per_cm_from_kv_per_mm,
};
use crate::model::{Damping, Film, Friction, Material, ModelError, Mount, PointMass, Robot, Segment};
use crate::words::{not_one_of, number};

/// Bullet's own limit on velocities (cm/s, rad/s).
const VELOCITY_LIMIT: f64 = 100.0;
/// Most effects of one experiment; factors on one number stay finite together.
const MAX_EFFECTS: usize = 100;

/// Reads an experiment from its source.
///
/// # Errors
/// [`ConfigError`] with file, line and key.
pub fn experiment(source: &Source) -> Result<Experiment, ConfigError> {
    Experiment::from_config(&source.parse()?, &source.folder).map_err(|error| source.locate(error))
}

/// Reads an experiment of a robot whose `bodies` come from elsewhere, as [`export::bodies`](crate::export::bodies) reads them.
///
/// # Errors
/// As [`experiment()`].
pub fn with_bodies(source: &Source, bodies: &[Segment]) -> Result<Experiment, ConfigError> {
    resolve(&source.parse()?, &source.folder, Some(bodies)).map_err(|error| source.locate(error))
}

impl Experiment {
    /// Checks a config and fills in its defaults; relative paths in it start from `folder`.
    ///
    /// # Errors
    /// [`ConfigError::Value`] with the key, [`ConfigError::Data`] for a damaged file that the config names.
    ///
    /// # Examples
    /// ```
    /// use std::path::Path;
    /// use sfers::experiment::{Config, Experiment, StepConfig};
    /// let mut config = Config::default();
    /// config.robot.actuators = Some(2);
    /// config.drive.waveform = Some("dc".into());
    /// config.drive.voltages_v = Some(vec![0.0, -1000.0]);
    /// config.simulation.time_step_s = Some(StepConfig::Seconds(1e-5));
    /// config.simulation.duration_s = Some(0.1);
    /// let experiment = Experiment::from_config(&config, Path::new("."))?;
    /// assert_eq!((experiment.robot.joints(), experiment.steps), (6, 10_000));
    /// # Ok::<(), sfers::experiment::ConfigError>(())
    /// ```
    pub fn from_config(config: &Config, folder: &Path) -> Result<Self, ConfigError> {
        resolve(config, folder, None)
    }
}

fn resolve(config: &Config, folder: &Path, bodies: Option<&[Segment]>) -> Result<Experiment, ConfigError> {
    let mut robot = robot(config)?;
    let effects = effects(config)?;
    if let Some(joints) = effects::joints(&effects) {
        robot.motors_per_actuator = joints;
    }
    let positive_gain = config.robot.positive_gain.unwrap_or(1.0);
    robot.check().and_then(|()| check_positive_gain(positive_gain)).map_err(|ModelError::Value { key, value, needed }| {
        Fault::new(key, format!("is {}, but must be {needed}", number(value)))
    })?;
    let engines = [("bullet", EngineKind::Bullet), ("planar", EngineKind::Planar)];
    let s = &config.simulation;
    let engine = choose("simulation.engine", s.engine.as_deref(), EngineKind::Bullet, &engines)?;
    let starts = [("flat", Start::Flat), ("settled", Start::Settled)];
    let start = choose("simulation.start", s.start.as_deref(), Start::Flat, &starts)?;
    if start == Start::Settled && engine == EngineKind::Bullet {
        return Err(Fault::new("simulation.start", "settled needs engine = \"planar\"; the reference starts flat").into());
    }
    let models = [("coulomb", FrictionModel::Coulomb), ("convex", FrictionModel::Convex)];
    let friction = choose("simulation.friction", s.friction.as_deref(), FrictionModel::default(), &models)?;
    if s.friction.is_some() && engine == EngineKind::Bullet {
        return Err(Fault::new("simulation.friction", "belongs to engine = \"planar\"; Bullet has a model of its own").into());
    }
    if let Some(limit) = s.velocity_limit {
        let key = "simulation.velocity_limit";
        if engine == EngineKind::Planar {
            return Err(Fault::new(key, "belongs to engine = \"bullet\"; the planar engine limits no velocity").into());
        }
        if !(limit.is_finite() && limit > 0.0) {
            return Err(Fault::new(key, format!("is {}, but must be positive", number(limit))).into());
        }
    }
    let joint_angles = s.joint_angles_rad.clone().unwrap_or_default();
    check_joint_angles(s.joint_angles_rad.as_deref(), start, robot.joints())?;
    if let Some(damping) = s.numerical_damping_per_s {
        let key = "simulation.numerical_damping_per_s";
        if engine == EngineKind::Bullet {
            return Err(Fault::new(key, "belongs to engine = \"planar\"; Bullet has none").into());
        }
        if !(damping.is_finite() && damping >= 0.0) {
            return Err(Fault::new(key, format!("is {}, but must be zero or more", number(damping))).into());
        }
    }
    let accuracy = steps::accuracy(s, engine)?;
    let scale = effects::time_step_scale(&effects);
    let Steps { time_step, steps, record_every, record_from } = steps::steps(s, &robot, scale, accuracy.is_some())?;
    // The reference is at 0 V in its first two steps.
    let first = if engine == EngineKind::Bullet { 2.0 * time_step } else { 0.0 };
    let waveform = drive::waveform(&config.drive, &Driven::new(&robot, positive_gain), first, folder)?;
    let mut drive = Drive::new(waveform).with_positive_gain(positive_gain);
    effects::apply(&effects, &mut robot, &mut drive).map_err(|error| Fault::new("effect", error.to_string()))?;
    robot.bodies = bodies.map(<[Segment]>::to_vec);
    if accuracy.is_some() {
        steps::check_adaptive(&robot, friction, scale)?;
    }
    Ok(Experiment {
        robot,
        drive,
        time_step,
        accuracy,
        steps,
        record_every,
        record_from,
        engine,
        start,
        friction,
        numerical_damping: s.numerical_damping_per_s,
        velocity_limit: s.velocity_limit.filter(|limit| *limit != VELOCITY_LIMIT),
        joint_angles,
        effects,
        config: config.clone(),
    })
}

/// Checks the angles (rad) from which `joints` joints start.
fn check_joint_angles(angles: Option<&[f64]>, start: Start, joints: usize) -> Result<(), Fault> {
    let Some(angles) = angles else { return Ok(()) };
    let fault = |message: String| Err(Fault::new("simulation.joint_angles_rad", message));
    if start == Start::Settled {
        return fault("belongs to start = \"flat\"; a settled robot has the angles of its equilibrium".into());
    }
    if angles.len() != joints {
        return fault(format!("has {} angles, but the robot has {joints} joints", angles.len()));
    }
    match angles.iter().find(|angle| !(angle.is_finite() && angle.abs() <= std::f64::consts::FRAC_PI_2)) {
        Some(angle) => fault(format!("holds {}, but angles must lie within a right angle", number(*angle))),
        None => Ok(()),
    }
}

/// The `[[effect]]` tables with their values checked; those at their off values are left out.
fn effects(config: &Config) -> Result<Vec<Applied>, Fault> {
    if config.effect.len() > MAX_EFFECTS {
        return Err(Fault::new("effect", format!("has {} tables; at most {MAX_EFFECTS} are possible", config.effect.len())));
    }
    let mut effects = Vec::with_capacity(config.effect.len());
    for (index, table) in config.effect.iter().enumerate() {
        effects.push(effect(index, table)?);
    }
    effects.retain(|applied| !applied.is_off());
    Ok(effects)
}

/// The effect of table `index` (from 0).
fn effect(index: usize, table: &EffectConfig) -> Result<Applied, Fault> {
    let of_table = |error: EffectError| Fault::new("effect", format!("table {}: {error}", index + 1));
    let effect = effects::find(&table.id).ok_or_else(|| of_table(EffectError::Unknown(table.id.clone())))?;
    let mut parameters: Vec<(&str, f64)> = Vec::new();
    let mut lists: Vec<(&str, &str)> = Vec::new();
    for (name, value) in &table.parameters {
        let of_key = |message: String| Fault::new(format!("effect.{index}.{name}"), message);
        let given = match value {
            EffectValue::Number(value) => Given::Number(*value),
            EffectValue::Numbers(values) => Given::Numbers(values),
            EffectValue::Other(value) => {
                let found = value.type_str();
                return Err(of_key(format!(
                    "effect {} takes numbers, and lists of numbers, but this is of the type {found}",
                    table.id
                )));
            }
        };
        let expanded = effect.expanded(name, given).map_err(|error| of_key(error.to_string()))?;
        if matches!(value, EffectValue::Numbers(_)) {
            lists.extend(expanded.iter().map(|(parameter, _)| (*parameter, name.as_str())));
        }
        parameters.extend(expanded);
    }
    for p in effect.parameters {
        if table.parameters.contains_key(p.name)
            && let Some((_, list)) = lists.iter().find(|(name, list)| *name == p.name && *list != p.name)
        {
            let twice = EffectError::Twice { id: effect.id, name: p.name, list: (*list).to_owned() };
            return Err(Fault::new(format!("effect.{index}.{}", p.name), twice.to_string()));
        }
    }
    effect.with(parameters).map_err(of_table)
}

fn choose<T: Copy>(key: &str, value: Option<&str>, default: T, choices: &[(&str, T)]) -> Result<T, Fault> {
    let Some(value) = value else { return Ok(default) };
    choices.iter().find(|(name, _)| *name == value).map(|&(_, choice)| choice).ok_or_else(|| {
        let names: Vec<_> = choices.iter().map(|(name, _)| *name).collect();
        Fault::new(key, not_one_of(value, &names))
    })
}

fn robot(config: &Config) -> Result<Robot, Fault> {
    let default = Robot::crawler();
    let m = &config.material;
    let mut material = choose(
        "material.preset",
        m.preset.as_deref(),
        default.material,
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
        (eta, None) => eta.map_or(default.damping, Damping::Eta),
    };
    let f = &r.friction;
    let mounts = Mount::ALL.map(|mount| (mount.name(), mount));
    let masses = r.mass.iter().map(|mass| PointMass { mass: mass.mass_g, position: cm_from_mm(mass.position_mm) });
    let films = [("both-ends", Film::BothEnds), ("right-end", Film::RightEnd), ("none", Film::None)];
    Ok(Robot {
        material,
        actuators: r.actuators.unwrap_or(default.actuators),
        motors_per_actuator: r.motors_per_actuator.unwrap_or(default.motors_per_actuator),
        mount: choose("robot.mount", r.mount.as_deref(), default.mount, &mounts)?,
        damping,
        collision_thickness: r.collision_thickness_mm.map_or(default.collision_thickness, cm_from_mm),
        friction: Friction {
            ground: f.ground.unwrap_or(default.friction.ground),
            low: f.low.unwrap_or(default.friction.low),
            high: f.high.unwrap_or(default.friction.high),
            film: choose("robot.friction.film", f.film.as_deref(), default.friction.film, &films)?,
            film_fraction: f.film_fraction.unwrap_or(default.friction.film_fraction),
        },
        masses: masses.collect(),
        ..default
    })
}
