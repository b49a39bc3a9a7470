//! Where an effect acts in the equations, and how it is fitted to measured data.

use serde::Serialize;

use crate::model::{Mount, Robot};

/// A part of the equations in which something can be missing. Effects of one place are rivals.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Place {
    /// Number of joints and time step.
    Discretisation,
    /// Mass along the robot.
    Mass,
    /// Stiffness along the robot.
    Stiffness,
    /// The clamp.
    Clamp,
    /// Shape without voltage.
    RestShape,
    /// Moment of a joint as a curve of its elastic deviation.
    JointMomentOfDeviation,
    /// Moment of a joint as a curve of its rate.
    JointMomentOfRate,
    /// Memory of a joint.
    JointMemory,
    /// Effective voltage as a curve of the voltage.
    VoltageCurve,
    /// Memory of the voltage.
    VoltageMemory,
    /// Response of the driver to its command.
    Drive,
    /// Gain along the robot.
    GainAlong,
    /// Force against the sheet's speed.
    Air,
    /// A tape or cable at the robot.
    Attachment,
    /// Friction against slip speed.
    FloorFriction,
    /// Impacts on the floor.
    Impact,
    /// Shape of the floor.
    Floor,
    /// From the robot to its record.
    Picture,
}

impl Place {
    /// All places.
    pub const ALL: [Self; 18] = [
        Self::Discretisation,
        Self::Mass,
        Self::Stiffness,
        Self::Clamp,
        Self::RestShape,
        Self::JointMomentOfDeviation,
        Self::JointMomentOfRate,
        Self::JointMemory,
        Self::VoltageCurve,
        Self::VoltageMemory,
        Self::Drive,
        Self::GainAlong,
        Self::Air,
        Self::Attachment,
        Self::FloorFriction,
        Self::Impact,
        Self::Floor,
        Self::Picture,
    ];

    /// Its name in files: where, and what of it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Discretisation => "numerics/discretisation",
            Self::Mass => "structure/mass",
            Self::Stiffness => "structure/stiffness",
            Self::Clamp => "mounting/clamp",
            Self::RestShape => "structure/rest-shape",
            Self::JointMomentOfDeviation => "joint/moment-of-deviation",
            Self::JointMomentOfRate => "joint/moment-of-rate",
            Self::JointMemory => "joint/memory",
            Self::VoltageCurve => "actuation/curve-of-voltage",
            Self::VoltageMemory => "actuation/memory-of-voltage",
            Self::Drive => "driver/response",
            Self::GainAlong => "actuation/gain-along",
            Self::Air => "air/drag",
            Self::Attachment => "mounting/attachment",
            Self::FloorFriction => "ground/friction",
            Self::Impact => "ground/impact",
            Self::Floor => "ground/shape",
            Self::Picture => "measurement/picture",
        }
    }

    /// Its name in a sentence.
    pub fn words(self) -> &'static str {
        match self {
            Self::Discretisation => "the discretisation",
            Self::Mass => "the mass along the robot",
            Self::Stiffness => "the stiffness along the robot",
            Self::Clamp => "the clamp",
            Self::RestShape => "the shape without voltage",
            Self::JointMomentOfDeviation => "the joints’ moment as a curve of their elastic deviation",
            Self::JointMomentOfRate => "the joints’ moment as a curve of their rate",
            Self::JointMemory => "the joints’ memory of their motion",
            Self::VoltageCurve => "the effective voltage as a curve of the voltage",
            Self::VoltageMemory => "the actuators’ memory of the voltage",
            Self::Drive => "the driver’s response to its command",
            Self::GainAlong => "the gain along the robot",
            Self::Air => "the force of the air on the sheet",
            Self::Attachment => "a tape or cable at the robot",
            Self::FloorFriction => "friction on the floor",
            Self::Impact => "impacts on the floor",
            Self::Floor => "the floor’s slope",
            Self::Picture => "the picture",
        }
    }
}

/// What a candidate needs to know of the data.
#[derive(Debug, Clone, Copy)]
pub struct Bench {
    /// True for a clamped robot.
    pub is_clamped: bool,
    /// True for a robot on the floor.
    pub is_on_floor: bool,
    /// Number of actuators.
    pub actuators: usize,
    /// Number of markers.
    pub markers: usize,
    /// Number of measured runs.
    pub runs: usize,
}

impl Bench {
    /// A robot with a number of `markers` that was measured in a number of `runs`.
    pub fn new(robot: &Robot, markers: usize, runs: usize) -> Self {
        Self {
            is_clamped: robot.mount == Mount::Clamped,
            is_on_floor: robot.mount == Mount::Ground,
            actuators: robot.actuators,
            markers,
            runs,
        }
    }
}

/// Whether an effect is a candidate cause.
#[derive(Debug)]
pub enum Fitting {
    /// It is, on some benches.
    Candidate {
        /// On which.
        on: fn(&Bench) -> bool,
        /// Its forms.
        forms: &'static [Form],
        /// Other laws of the same cause, with a parameter for the shape: tried where a form of its place is found, not in the search.
        variants: &'static [Form],
    },
    /// It is not, for a reason.
    Excluded(&'static str),
}

/// A form of an effect with free parameters. The fit uses a coordinate for each: the value, or its inverse where the effect vanishes at infinity.
#[derive(Debug)]
pub struct Form {
    /// Fitted parameters with typical changes of their coordinates.
    pub fitted: &'static [(&'static str, f64)],
    /// Coordinates to start from, starts × fitted parameters.
    pub starts: &'static [&'static [f64]],
    /// Values of other parameters.
    pub given: &'static [(&'static str, f64)],
}

/// The curve of a free form: an effect that is no law but shows what law is missing.
#[derive(Debug)]
pub struct Shape {
    /// Name of the abscissa.
    pub x: &'static str,
    /// Its unit; empty for dimensionless ones.
    pub x_unit: &'static str,
    /// Name of the ordinate.
    pub y: &'static str,
    /// Its unit; empty for dimensionless ones.
    pub y_unit: &'static str,
    /// Points of the curve of given parameters, in the order and units of [`Effect::parameters`](super::Effect::parameters).
    pub points: fn(&[f64]) -> Vec<[f64; 2]>,
}

/// Benches on which an effect is a candidate.
pub mod fits {
    use super::Bench;

    /// Every one.
    pub fn any(_: &Bench) -> bool {
        true
    }

    /// With a clamped robot.
    pub fn clamped(bench: &Bench) -> bool {
        bench.is_clamped
    }

    /// With a robot on the floor.
    pub fn on_the_floor(bench: &Bench) -> bool {
        bench.is_on_floor
    }

    /// With several actuators: one alone cannot tell the effect from the gain of all.
    pub fn several_actuators(bench: &Bench) -> bool {
        bench.actuators > 1
    }

    /// With more than two runs: any two differ by a drift.
    pub fn several_runs(bench: &Bench) -> bool {
        bench.runs > 2
    }

    /// With a visible shape: the tip alone cannot tell the effect from the gain.
    pub fn shape(bench: &Bench) -> bool {
        bench.actuators > 1 || bench.markers > 1
    }
}
