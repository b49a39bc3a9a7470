//! Effects that extend the nominal model, one file each, in folders by where they act.
//!
//! An [`Effect`] is a description: cause, equation, source, and parameters with bounds and off values, at which it vanishes. An [`Applied`] effect has
//! values. Its [`Action`] changes the robot or the drive before a run, filters voltages during the run ([`SignalStage`]), or changes the recorded
//! positions ([`View`]). An effect at its off values is skipped, so the bits are those of the nominal model.
//!
//! Voltages pass the effects in the order of [`EFFECTS`], not in that of the file: drivers first, then actuators.

mod actuation;
mod calibration;
mod curve;
mod driver;
mod fitting;
mod ground;
mod groups;
mod measurement;
mod numerics;
mod signal_chain;
mod structure;
mod view;

pub(crate) use actuation::secants;
pub use fitting::{Bench, Fitting, Form, Place, Shape, fits};
pub use groups::Given;
pub use signal_chain::{SignalChain, SignalStage};
pub use view::View;

use serde::Serialize;
use thiserror::Error;

use crate::drive::Drive;
use crate::model::Robot;
use crate::words::{did_you_mean, number};

/// The part of the system on which an effect acts.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize)]
pub enum Kind {
    /// Constants of the nominal model.
    #[serde(rename = "calibration")]
    Calibration,
    /// Discretisation: number of joints and time step.
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
    /// Contact between robot and ground.
    #[serde(rename = "ground")]
    Ground,
    /// Between the robot and its record.
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

/// A parameter of an effect.
#[derive(Debug, PartialEq)]
pub struct Parameter {
    /// Key in `[[effect]]` tables.
    pub name: &'static str,
    /// Unit; empty for dimensionless ones.
    pub unit: &'static str,
    /// Least and largest value, in `unit`.
    pub bounds: [f64; 2],
    /// The value at which the effect vanishes, in `unit`; none if the parameter cannot switch it off.
    pub off: Option<f64>,
    /// The default value, in `unit`; none if the parameter is required.
    pub default: Option<f64>,
    /// Its description.
    pub about: &'static str,
}

impl Parameter {
    /// A factor, with the off value 1.
    const fn scale(bounds: [f64; 2], about: &'static str) -> Self {
        Self { name: "scale", unit: "", bounds, off: Some(1.0), default: None, about }
    }

    /// The place of a run in the order of measurement, which a diagnosis sets ([`Applied::in_run`]).
    const fn run() -> Self {
        let about = "place n of the run from the mean of all";
        Self { name: "run", unit: "", bounds: [-1e6, 1e6], off: None, default: Some(0.0), about }
    }
}

/// How an effect acts. All functions take the parameters in the order of [`Effect::parameters`], in their units.
#[derive(Debug, Clone, Copy)]
pub enum Action {
    /// Changes the robot.
    Robot(fn(&[f64], &mut Robot)),
    /// Changes the drive.
    Drive(fn(&[f64], &mut Drive)),
    /// Filters voltages: makes a stage for a number of actuators and a duration (s).
    Voltages(fn(&[f64], usize, f64) -> Box<dyn SignalStage>),
    /// Changes the recorded positions.
    View(fn(&[f64], &mut View)),
    /// Changes the number of joints per actuator and the time step.
    Discretisation,
}

/// A description of an effect.
#[derive(Debug)]
pub struct Effect {
    /// Its id in files.
    pub id: &'static str,
    /// The part on which it acts.
    pub kind: Kind,
    /// Its cause in a sentence.
    pub cause: &'static str,
    /// Its equation, in CGS units.
    pub equation: &'static str,
    /// The source of the equation.
    pub source: &'static str,
    /// Its parameters.
    pub parameters: &'static [Parameter],
    /// Where it acts in the equations: first where it is at home, then the places whose free form it may be mistaken for.
    pub places: &'static [Place],
    /// How it is fitted to measured data.
    pub fitting: Fitting,
    /// The curve that a free form stands for; none of a named one.
    pub shape: Option<Shape>,
    /// Its action.
    pub action: Action,
}

/// All effects, in the order of their action.
pub static EFFECTS: &[&Effect] = &[
    &calibration::STIFFNESS,
    &calibration::ACTUATION_GAIN,
    &calibration::DAMPING,
    &calibration::AREAL_MASS,
    &numerics::DISCRETISATION,
    &structure::STIFFNESS_DRIFT,
    &structure::CLAMP_COMPLIANCE,
    &structure::FREE_CLAMP,
    &structure::CLAMP_SHIFT,
    &structure::TIP_MASS,
    &structure::INITIAL_CURVATURE,
    &structure::STIFFNESS_SOFTENING,
    &structure::DRY_FRICTION,
    &structure::STRUCTURAL_DAMPING,
    &structure::AIR_DRAG,
    &structure::CABLE_DRAG,
    &structure::FREE_MOMENT_OF_DEVIATION,
    &structure::FREE_MOMENT_OF_RATE,
    &structure::FREE_JOINT_MEMORY,
    &structure::FREE_JOINT_FRICTION,
    &structure::FREE_JOINT_SLIP,
    &structure::FREE_STIFFNESS_ALONG,
    &structure::FREE_MASS,
    &structure::FREE_DRAG,
    &driver::TIME_DELAY,
    &driver::SATURATION,
    &driver::SLEW_LIMIT,
    &driver::DRIVER_LAG,
    &driver::FREE_DRIVE_FILTER,
    &actuation::GAIN_DRIFT,
    &actuation::REMANENCE,
    &actuation::WAKE_UP,
    &actuation::HYSTERESIS,
    &actuation::CREEP,
    &actuation::FREE_VOLTAGE_PLAYS,
    &actuation::FREE_VOLTAGE_MEMORY,
    &actuation::FIELD_DEPENDENT_GAIN,
    &actuation::FREE_GAIN_ALONG,
    &actuation::FREE_VOLTAGE_CURVE,
    &actuation::POLARITY_ASYMMETRY,
    &actuation::WEAK_ACTUATOR,
    &actuation::PASSIVE_MARGIN,
    &ground::GROUND_FRICTION,
    &ground::STICK_SLIP,
    &ground::FREE_FLOOR_FRICTION,
    &ground::CONTACT_RESTITUTION,
    &ground::GROUND_SLOPE,
    &measurement::SENSOR_SCALE,
    &measurement::SENSOR_OFFSET,
    &measurement::SENSOR_DELAY,
    &measurement::CAMERA_TILT,
    &measurement::FREE_PICTURE,
];

/// The effect with an id; none if there is none.
pub fn find(id: &str) -> Option<&'static Effect> {
    EFFECTS.iter().copied().find(|effect| effect.id == id)
}

/// An effect that cannot be applied.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum EffectError {
    /// No such effect.
    #[error("there is no effect {0:?}{hint}; `sfers effects` lists them", hint = did_you_mean(.0, EFFECTS.iter().map(|effect| effect.id)))]
    Unknown(String),
    /// A key that is no parameter of the effect.
    #[error("effect {id} has no parameter {name:?}; it takes {known}{hint}", hint = did_you_mean(.name, .known.split(", ")))]
    UnknownParameter {
        /// The effect.
        id: &'static str,
        /// The key.
        name: String,
        /// Its parameters.
        known: String,
    },
    /// A required parameter is missing.
    #[error("effect {id} needs {name}")]
    Missing {
        /// The effect.
        id: &'static str,
        /// The parameter.
        name: &'static str,
    },
    /// A list of another length than the group of parameters that it stands for.
    #[error("effect {id}: {name} has {given} numbers, but stands for {needed}: {first} to {last}")]
    Length {
        /// The effect.
        id: &'static str,
        /// The key of the list.
        name: String,
        /// Length of the list.
        given: usize,
        /// Number of parameters.
        needed: usize,
        /// The first of them.
        first: &'static str,
        /// The last of them.
        last: &'static str,
    },
    /// A list for a key that takes one number.
    #[error("effect {id}: {name} takes one number, not a list")]
    OneNumber {
        /// The effect.
        id: &'static str,
        /// The key.
        name: String,
    },
    /// One number for a key that takes a list.
    #[error("effect {id}: {name} takes a list of {needed} numbers")]
    List {
        /// The effect.
        id: &'static str,
        /// The key.
        name: String,
        /// Number of parameters.
        needed: usize,
    },
    /// A parameter that is given by its own key and in a list.
    #[error("effect {id}: {name} is given by its own key and in {list}; keep one of the two")]
    Twice {
        /// The effect.
        id: &'static str,
        /// The parameter.
        name: &'static str,
        /// The key of the list.
        list: String,
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
    /// The description.
    pub effect: &'static Effect,
    /// Values of the parameters, in their order and units.
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

    /// The effect with given values (name, value); the others are at their defaults.
    ///
    /// # Errors
    /// [`EffectError`] if a parameter is unknown, missing or out of range.
    pub fn with<'a>(&'static self, given: impl IntoIterator<Item = (&'a str, f64)>) -> Result<Applied, EffectError> {
        let mut values: Vec<Option<f64>> = self.parameters.iter().map(|p| p.default).collect();
        for (name, value) in given {
            let Some(index) = self.parameters.iter().position(|p| p.name == name) else {
                let known: Vec<_> = self.parameters.iter().map(|p| p.name).collect();
                return Err(EffectError::UnknownParameter { id: self.id, name: name.into(), known: known.join(", ") });
            };
            let p = &self.parameters[index];
            // Infinite off values and defaults lie outside the bounds.
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
    /// True if all parameters with an off value have it.
    pub fn is_off(&self) -> bool {
        self.effect.parameters.iter().zip(&self.values).all(|(p, value)| p.off.is_none_or(|off| *value == off))
    }

    /// The value of a parameter, in its unit; none if the effect has no such parameter.
    pub fn get(&self, name: &str) -> Option<f64> {
        let index = self.effect.parameters.iter().position(|p| p.name == name)?;
        self.values.get(index).copied()
    }

    /// The effect in the run with the place `run` in the order of measurement, from the mean of all; unchanged if it is the same in all runs.
    #[must_use]
    pub fn in_run(mut self, run: f64) -> Self {
        if let Some(index) = self.effect.parameters.iter().position(|p| p.name == "run") {
            self.values[index] = run;
        }
        self
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
        if let (Some(per_run), Some(run)) = (self.get("per_run"), self.get("run"))
            && 1.0 + per_run * run < LEAST_DRIFTED
        {
            let factor = number(1.0 + per_run * run);
            return wrong(format!("the factor in run {} is {factor}, but must be at least {LEAST_DRIFTED}", number(run)));
        }
        Ok(())
    }
}

/// Least factor to which a constant may drift (–).
const LEAST_DRIFTED: f64 = 0.1;

/// Applies effects to a robot and its drive.
///
/// # Errors
/// [`EffectError::Robot`] if an effect does not fit the robot.
pub fn apply(effects: &[Applied], robot: &mut Robot, drive: &mut Drive) -> Result<(), EffectError> {
    effects.iter().try_for_each(|applied| applied.check(robot))?;
    // The number of joints first: some effects have a value per joint.
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
    // The clamp has one law beside linear springs in series.
    let laws = |applied: &Applied| match applied.effect.id {
        "free-clamp" => 1,
        "clamp-compliance" => {
            ["hardening_per_rad", "asymmetry"].into_iter().filter(|name| applied.get(name) != Some(0.0)).count()
        }
        _ => 0,
    };
    if effects.iter().filter(|applied| !applied.is_off()).map(laws).sum::<usize>() > 1 {
        let message = "only one of free-clamp, hardening_per_rad and asymmetry may be given: put them into one free-clamp".into();
        return Err(EffectError::Robot { id: "clamp-compliance", message });
    }
    Ok(())
}

/// Joints per actuator set by effects; none if they set none.
pub fn joints(effects: &[Applied]) -> Option<usize> {
    let joints = effects.iter().filter_map(|applied| applied.get("motors_per_actuator")).find(|joints| *joints > 0.0);
    joints.map(|joints| joints as usize)
}

/// Factor on the time step set by effects.
pub fn time_step_scale(effects: &[Applied]) -> f64 {
    effects.iter().filter_map(|applied| applied.get("time_step_scale")).product()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_head_of_every_file_has_cause_equation_parameters_and_source_of_its_effect() {
        let single_spaced = |text: &str| text.split_whitespace().collect::<Vec<_>>().join(" ");
        for effect in EFFECTS {
            let folder = format!("{:?}", effect.kind).to_lowercase();
            let path = format!("{}/src/effects/{folder}/{}.rs", env!("CARGO_MANIFEST_DIR"), effect.id.replace('-', "_"));
            let text = std::fs::read_to_string(&path).unwrap();
            let lines = text.lines().map_while(|line| line.strip_prefix("//!"));
            let head = single_spaced(&lines.collect::<Vec<_>>().join("\n"));
            let mut rest = head.as_str();
            let parameters = effect.parameters.iter().map(|p| {
                let unit = if p.unit.is_empty() { "–" } else { p.unit };
                format!("* `{}` ({unit}): {}", p.name, p.about)
            });
            let parts =
                [effect.cause.to_owned(), effect.equation.to_owned(), "# Parameters".into()].into_iter().chain(parameters);
            for part in parts.chain([format!("# Source {}", effect.source)]) {
                let at = rest.find(&single_spaced(&part)).unwrap_or_else(|| panic!("{path}: {part:?} is not in {rest:?}"));
                rest = &rest[at..];
            }
        }
    }
}
