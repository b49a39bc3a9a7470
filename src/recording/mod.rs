//! What a run leaves behind: a trajectory with the numbers needed to read it.

pub(crate) mod accumulator;
pub mod csv;
pub mod definitions;
pub mod measures;
mod npy;
pub mod npz;
pub mod signal;

use std::path::PathBuf;

use thiserror::Error;

/// A recording that cannot be read or written.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum RecordingError {
    /// The file is not a readable recording.
    #[error("{}: {reason}", path.display())]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// What is wrong with it, and where.
        reason: String,
    },
    /// The file could not be written.
    #[error("{}: {reason}", path.display())]
    Unwritable {
        /// The file.
        path: PathBuf,
        /// Why.
        reason: String,
    },
}

/// The most numbers that a recording holds (3.2 GB).
pub(crate) const MAX_VALUES: f64 = 4e8;

/// Checks numbers that were read, in CGS units: up to a size of 1e100 their squares and all that is drawn of them are numbers too.
fn check_values(values: &[f64]) -> Result<(), String> {
    match values.iter().position(|value| value.is_nan() || value.abs() > 1e100) {
        Some(at) => Err(format!("number {} of it is {}, which no robot comes to", at + 1, values[at])),
        None => Ok(()),
    }
}

/// Numbers that go with a trajectory.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Meta {
    /// Time step (s).
    pub time_step: f64,
    /// Number of steps that were simulated.
    pub steps: u64,
    /// Every how many steps a record was taken.
    pub record_every: u64,
    /// Number of actuators, N.
    pub actuators: usize,
    /// Motor-link units per actuator, m.
    pub motors_per_actuator: usize,
    /// Length of one actuator (cm).
    pub actuator_length: f64,
    /// Drive frequency (Hz); 1 where the drive has none, as in the reference.
    pub driven_frequency: f64,
    /// The reference's `dampingEta` (–).
    pub damping_eta: f64,
    /// For robots on the ground, as the reference saves them: low and high friction (–), and the gait's period or delay (s).
    pub ground: Option<GroundMeta>,
}

/// What the reference saves of a robot on the ground besides.
#[derive(Debug, Clone, PartialEq)]
pub struct GroundMeta {
    /// Friction of the bare robot (–).
    pub friction_low: f64,
    /// Friction of the films (–).
    pub friction_high: f64,
    /// Period or delay (s); 0 where the drive has none.
    pub period: f64,
    /// Date and time of the run, MM_DD_YYYY_HH_MM.
    pub date_time: String,
}

/// A trajectory: T records of J = N·m joints and J + 2 nodes, each array row after row.
///
/// Every record is the state before a step, with the torques of that step. Nodes are the left end, each joint and the right end, on
/// the centre line; the joints' places lag one step behind the left end's (see [`BulletEngine`](crate::engine::BulletEngine)).
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Recording {
    /// Numbers that go with it.
    pub meta: Meta,
    /// Time (s), T values.
    pub time: Vec<f64>,
    /// Joint angles (rad), T × J.
    pub angles: Vec<f64>,
    /// Joint rates (rad/s), T × J.
    pub rates: Vec<f64>,
    /// Joint torques (dyn·cm), T × J.
    pub torques: Vec<f64>,
    /// Voltage on each joint, the actuator's divided by m (V), T × J.
    pub motor_voltages: Vec<f64>,
    /// Nodes (cm), T × (J + 2) × 3.
    pub positions: Vec<f64>,
    /// Velocities as the reference records them (cm/s), T × (J + 2) × 3. On Bullet: the left end's own, for each joint that of the centre of
    /// mass of the link behind it, one step late, and for the right end that centre's with a whole link as lever. On the planar engine:
    /// the nodes' own.
    pub velocities: Vec<f64>,
    /// Velocities of the nodes themselves at the recorded time, on either engine (cm/s), T × (J + 2) × 3; empty if they are not known, as in
    /// files of the reference.
    pub node_velocities: Vec<f64>,
}

impl Recording {
    /// Number of records, T.
    pub fn len(&self) -> usize {
        self.time.len()
    }

    /// Whether nothing was recorded.
    pub fn is_empty(&self) -> bool {
        self.time.is_empty()
    }

    /// Number of joints, J.
    pub fn joints(&self) -> usize {
        self.meta.actuators * self.meta.motors_per_actuator
    }

    /// Number of nodes, J + 2.
    pub fn nodes(&self) -> usize {
        self.joints() + 2
    }

    /// Centre of mass (cm) in a record, x, y, z: each actuator's mass is spread evenly between the nodes, so links weigh by length.
    ///
    /// ```text
    /// r = (Σ w_i r_i)/(Σ w_i)    w: half the links on either side of a node
    /// ```
    ///
    /// The ends' links are half as long as the others, so the ends weigh a quarter and their neighbours three quarters of an inner node.
    pub fn centre_of_mass(&self, record: usize) -> [f64; 3] {
        let last = self.nodes() - 1;
        let length = |link: usize| if link == 0 || link + 1 == last { 0.5 } else { 1.0 };
        let mut sum = [0.0; 4];
        for link in 0..last {
            let (a, b) = (self.node(record, link), self.node(record, link + 1));
            for axis in 0..3 {
                sum[axis] += length(link) * 0.5 * (a[axis] + b[axis]);
            }
            sum[3] += length(link);
        }
        [sum[0] / sum[3], sum[1] / sum[3], sum[2] / sum[3]]
    }

    /// Position (cm) of a node in a record: x, y, z.
    pub fn node(&self, record: usize, node: usize) -> [f64; 3] {
        let at = 3 * (record * self.nodes() + node);
        [self.positions[at], self.positions[at + 1], self.positions[at + 2]]
    }
}
