//! Recordings: trajectories with their metadata, their files and their measures.

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

/// Largest number of values in a recording (3.2 GB).
pub(crate) const MAX_VALUES: f64 = 4e8;

/// Checks values that were read: below 1e100 their squares are finite.
fn check_values(values: &[f64]) -> Result<(), String> {
    match values.iter().position(|value| value.is_nan() || value.abs() > 1e100) {
        Some(at) => Err(format!("value {} is {}, which is out of range", at + 1, values[at])),
        None => Ok(()),
    }
}

/// Metadata of a trajectory.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Meta {
    /// Time step (s).
    pub time_step: f64,
    /// Number of steps that were simulated.
    pub steps: u64,
    /// Steps between records.
    pub record_every: u64,
    /// Number of actuators, N.
    pub actuators: usize,
    /// Motor-link units per actuator, m.
    pub motors_per_actuator: usize,
    /// Length of one actuator (cm).
    pub actuator_length: f64,
    /// Drive frequency (Hz); 1 for drives without one, as in the reference.
    pub driven_frequency: f64,
    /// The reference's `dampingEta` (–).
    pub damping_eta: f64,
    /// Further metadata of robots on the ground.
    pub ground: Option<GroundMeta>,
}

/// Metadata that the reference saves for robots on the ground.
#[derive(Debug, Clone, PartialEq)]
pub struct GroundMeta {
    /// Friction of the bare robot (–).
    pub friction_low: f64,
    /// Friction of the films (–).
    pub friction_high: f64,
    /// Period or delay of the gait (s); 0 for drives without one.
    pub period: f64,
    /// Date and time of the run, MM_DD_YYYY_HH_MM.
    pub date_time: String,
}

/// A trajectory: T records of J = N·m joints and J + 2 nodes, each array row after row.
///
/// A record is the state before a step, with the torques of that step. Nodes are the left end, each joint and the right end, on the centre line; the
/// positions of joints lag one step behind that of the left end (see [`BulletEngine`](crate::engine::BulletEngine)).
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Recording {
    /// Metadata.
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
    /// Positions of the nodes (cm), T × (J + 2) × 3.
    pub positions: Vec<f64>,
    /// Velocities as in the reference (cm/s), T × (J + 2) × 3. On Bullet: of the left end; for each joint, of the centre of mass of the next link
    /// one step late; for the right end, of that centre with a whole link as lever. On the planar engine: of the nodes.
    pub velocities: Vec<f64>,
    /// Velocities of the nodes at the recorded time (cm/s), T × (J + 2) × 3; empty if unknown, as in files of the reference.
    pub node_velocities: Vec<f64>,
}

impl Recording {
    /// Number of records, T.
    pub fn len(&self) -> usize {
        self.time.len()
    }

    /// True if there are no records.
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

    /// Centre of mass x, y, z (cm) in a record, with the mass spread evenly along the links.
    ///
    /// ```text
    /// r = (Σ w_i r_i)/(Σ w_i)    w: half the links on either side of a node
    /// ```
    ///
    /// The end links are half as long as the others, so the end nodes have a quarter and their neighbours three quarters of an inner node's weight.
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

    /// Position x, y, z (cm) of a node in a record.
    pub fn node(&self, record: usize, node: usize) -> [f64; 3] {
        let at = 3 * (record * self.nodes() + node);
        [self.positions[at], self.positions[at + 1], self.positions[at + 2]]
    }
}
