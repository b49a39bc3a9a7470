//! Extensions of the model: what a linear torque law leaves out, one file per effect, in folders by where it acts.
//!
//! An [`Effect`] is a fixed description: cause, equation, parameters with bounds and the value at which it vanishes. An [`Applied`] effect has
//! values. Where an effect acts is its [`Action`]: it changes the robot or the drive before a run, passes voltages on during the run
//! ([`Voltages`]), or changes what is seen of the run ([`View`]). An effect at its off value is left out, so the bits are those of the plain model.
//!
//! Voltages pass the effects in the order of [`EFFECTS`], whatever the order in the file: the driver's first, then the actuators'.

mod actuation;
mod calibration;
mod driver;
mod ground;
mod measurement;
mod numerics;
mod signal_chain;
mod structure;
mod view;

pub use signal_chain::{SignalChain, SignalStage};
pub use view::View;

use serde::Serialize;
use thiserror::Error;

use crate::drive::Drive;
use crate::model::Robot;
use crate::words::{did_you_mean, number};

/// Where an effect acts.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize)]
pub enum Kind {
    /// A constant of the nominal model is off.
    #[serde(rename = "calibration")]
    Calibration,
    /// Finite joints and steps.
    #[serde(rename = "numerics")]
    Numerics,
    /// Mounting and structure.
    #[serde(rename = "mounting/structure")]
    Structure,
    /// Between voltage and strain.
    #[serde(rename = "actuation")]
    Actuation,
    /// Between the commanded and the applied voltage.
    #[serde(rename = "driver")]
    Driver,
    /// Between robot and floor.
    #[serde(rename = "ground")]
    Ground,
    /// Between the robot and what is recorded of it.
    #[serde(rename = "measurement")]
    Measurement,
}

impl Kind {
    /// Its name in files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Calibration => "calibration",
            Self::Numerics => "numerics",
            Self::Structure => "mounting/structure",
            Self::Actuation => "actuation",
            Self::Driver => "driver",
            Self::Ground => "ground",
            Self::Measurement => "measurement",
        }
    }
}

/// A number of an effect.
#[derive(Debug, PartialEq)]
pub struct Parameter {
    /// Key in `[[effect]]` tables.
    pub name: &'static str,
    /// Unit, empty for plain numbers.
    pub unit: &'static str,
    /// Range.
    pub bounds: [f64; 2],
    /// The value at which the effect vanishes; none for a parameter that cannot switch it off by itself.
    pub off: Option<f64>,
    /// The value where a file gives none; none if it must be given.
    pub default: Option<f64>,
    /// What it is.
    pub about: &'static str,
}

impl Parameter {
    /// A factor, 1 where it changes nothing.
    const fn scale(bounds: [f64; 2], about: &'static str) -> Self {
        Self { name: "scale", unit: "", bounds, off: Some(1.0), default: None, about }
    }
}

/// Where and how an effect acts. All functions take the parameters in the order of the description, in the units of files.
#[derive(Debug, Clone, Copy)]
pub enum Action {
    /// Changes the robot.
    Robot(fn(&[f64], &mut Robot)),
    /// Changes the drive.
    Drive(fn(&[f64], &mut Drive)),
    /// Passes on the voltages of so many actuators in a run of so many seconds.
    Voltages(fn(&[f64], usize, f64) -> Box<dyn SignalStage>),
    /// Changes what is seen.
    View(fn(&[f64], &mut View)),
    /// Changes joints per actuator, and the time step by a factor.
    Discretisation,
}

/// A description of an effect.
#[derive(Debug)]
pub struct Effect {
    /// Its name in files.
    pub id: &'static str,
    /// Where it acts.
    pub kind: Kind,
    /// Its cause in a sentence.
    pub cause: &'static str,
    /// Its equation, in CGS units.
    pub equation: &'static str,
    /// Where the equation comes from.
    pub source: &'static str,
    /// Its numbers.
    pub parameters: &'static [Parameter],
    /// What it does.
    pub action: Action,
}

/// All effects, in the order in which they act.
pub static EFFECTS: &[&Effect] = &[
    &calibration::STIFFNESS,
    &calibration::ACTUATION_GAIN,
    &calibration::DAMPING,
    &calibration::AREAL_MASS,
    &numerics::DISCRETISATION,
    &structure::CLAMP_COMPLIANCE,
    &structure::TIP_MASS,
    &structure::INITIAL_CURVATURE,
    &structure::STIFFNESS_SOFTENING,
    &structure::DRY_FRICTION,
    &structure::STRUCTURAL_DAMPING,
    &structure::AIR_DRAG,
    &driver::TIME_DELAY,
    &driver::SATURATION,
    &driver::SLEW_LIMIT,
    &driver::DRIVER_LAG,
    &actuation::HYSTERESIS,
    &actuation::CREEP,
    &actuation::FIELD_DEPENDENT_GAIN,
    &actuation::POLARITY_ASYMMETRY,
    &actuation::WEAK_ACTUATOR,
    &actuation::PASSIVE_MARGIN,
    &ground::GROUND_FRICTION,
    &ground::STICK_SLIP,
    &ground::CONTACT_RESTITUTION,
    &ground::GROUND_SLOPE,
    &measurement::SENSOR_SCALE,
    &measurement::SENSOR_OFFSET,
    &measurement::SENSOR_DELAY,
    &measurement::CAMERA_TILT,
];

/// The effect of that name.
pub fn find(id: &str) -> Option<&'static Effect> {
    EFFECTS.iter().copied().find(|effect| effect.id == id)
}

/// An effect that cannot be applied as it is written.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum EffectError {
    /// No such effect.
    #[error("there is no effect {0:?}{hint}; `sfers effects` lists them", hint = did_you_mean(.0, EFFECTS.iter().map(|effect| effect.id)))]
    Unknown(String),
    /// A key that is no parameter of it.
    #[error("effect {id} has no parameter {name:?}; it takes {known}{hint}", hint = did_you_mean(.name, .known.split(", ")))]
    UnknownParameter {
        /// The effect.
        id: &'static str,
        /// The key.
        name: String,
        /// Its parameters.
        known: String,
    },
    /// A parameter without default is missing.
    #[error("effect {id} needs {name}")]
    Missing {
        /// The effect.
        id: &'static str,
        /// The parameter.
        name: &'static str,
    },
    /// A value out of range.
    #[error("effect {id}: {name} is {}, but must lie between {} and {}", number(*.value), number(*.low), number(*.high))]
    Range {
        /// The effect.
        id: &'static str,
        /// The parameter.
        name: &'static str,
        /// Its value.
        value: f64,
        /// Least value.
        low: f64,
        /// Largest value.
        high: f64,
    },
    /// A value that does not fit the robot.
    #[error("effect {id}: {message}")]
    Robot {
        /// The effect.
        id: &'static str,
        /// What is wrong.
        message: String,
    },
}

/// An effect with values, in the units of files.
#[derive(Debug, Clone)]
pub struct Applied {
    /// What it is.
    pub effect: &'static Effect,
    /// One value per parameter.
    pub values: Vec<f64>,
}

impl PartialEq for Applied {
    fn eq(&self, other: &Self) -> bool {
        self.effect.id == other.effect.id && self.values == other.values
    }
}

impl Effect {
    /// The effect at its defaults and off values.
    pub fn off(&'static self) -> Applied {
        let values = self.parameters.iter().map(|p| p.off.or(p.default).unwrap_or(p.bounds[0])).collect();
        Applied { effect: self, values }
    }

    /// The effect with the values given; the others are at their defaults.
    ///
    /// # Errors
    /// [`EffectError`] names the parameter.
    pub fn with<'a>(&'static self, given: impl IntoIterator<Item = (&'a str, f64)>) -> Result<Applied, EffectError> {
        let mut values: Vec<Option<f64>> = self.parameters.iter().map(|p| p.default).collect();
        for (name, value) in given {
            let Some(index) = self.parameters.iter().position(|p| p.name == name) else {
                let known: Vec<_> = self.parameters.iter().map(|p| p.name).collect();
                return Err(EffectError::UnknownParameter { id: self.id, name: name.into(), known: known.join(", ") });
            };
            let p = &self.parameters[index];
            // An infinite value that stands for none lies outside the bounds of what can be fitted.
            if !(p.bounds[0]..=p.bounds[1]).contains(&value) && ![p.off, p.default].contains(&Some(value)) {
                let [low, high] = p.bounds;
                return Err(EffectError::Range { id: self.id, name: p.name, value, low, high });
            }
            values[index] = Some(value);
        }
        let fill = |(value, p): (Option<f64>, &Parameter)| value.ok_or(EffectError::Missing { id: self.id, name: p.name });
        let values = values.into_iter().zip(self.parameters).map(fill).collect::<Result<_, _>>()?;
        Ok(Applied { effect: self, values })
    }
}

impl Applied {
    /// Whether it does nothing: all parameters that can switch it off do.
    pub fn is_off(&self) -> bool {
        self.effect.parameters.iter().zip(&self.values).all(|(p, value)| p.off.is_none_or(|off| *value == off))
    }

    /// The value of a parameter.
    pub fn get(&self, name: &str) -> Option<f64> {
        let index = self.effect.parameters.iter().position(|p| p.name == name)?;
        self.values.get(index).copied()
    }

    fn check(&self, robot: &Robot) -> Result<(), EffectError> {
        let wrong = |message: String| Err(EffectError::Robot { id: self.effect.id, message });
        if let Some(actuator) = self.get("actuator")
            && (actuator.fract() != 0.0 || actuator > robot.actuators as f64)
        {
            return wrong(format!("actuator is {}, but the robot has {} actuators", number(actuator), robot.actuators));
        }
        if let Some(position) = self.get("position_mm")
            && position.is_finite()
            && position > 10.0 * robot.material.actuator_length * robot.actuators as f64
        {
            return wrong(format!("position_mm is {}, beyond the robot's end", number(position)));
        }
        if let Some(m) = self.get("motors_per_actuator")
            && m.fract() != 0.0
        {
            return wrong(format!("motors_per_actuator is {}, but must be a whole number", number(m)));
        }
        Ok(())
    }
}

/// Puts effects into a robot and its drive.
///
/// # Errors
/// [`EffectError::Robot`] if one does not fit the robot.
pub fn apply(effects: &[Applied], robot: &mut Robot, drive: &mut Drive) -> Result<(), EffectError> {
    effects.iter().try_for_each(|applied| applied.check(robot))?;
    // The number of joints first: others have a value per joint.
    if let Some(joints) = joints(effects) {
        robot.motors_per_actuator = joints;
    }
    for applied in effects.iter().filter(|applied| !applied.is_off()) {
        match applied.effect.action {
            Action::Robot(change) => change(&applied.values, robot),
            Action::Drive(change) => change(&applied.values, drive),
            _ => {}
        }
    }
    Ok(())
}

/// Joints per actuator that effects ask for.
pub fn joints(effects: &[Applied]) -> Option<usize> {
    let joints = effects.iter().filter_map(|applied| applied.get("motors_per_actuator")).find(|joints| *joints > 0.0);
    joints.map(|joints| joints as usize)
}

/// Factor on the time step that effects ask for.
pub fn time_step_scale(effects: &[Applied]) -> f64 {
    effects.iter().filter_map(|applied| applied.get("time_step_scale")).product()
}
