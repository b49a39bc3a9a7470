//! The ranges of voltage, curvature and rate that the data visit: free forms are curves over them. And for how long: a memory has the same time constants in all runs.

use rayon::prelude::*;

use super::dataset::Start;
use super::track::put;
use crate::drive::{Drive, Means, Table, Waveform};
use crate::effects::Effect;
use crate::engine::{Engine, EngineError, PlanarEngine};
use crate::model::{Mount, Robot, VISCOUS_REACH};

/// A range that is not visited is taken for this (1/m, 1/(m·s), mN·m, mm/s).
const LEAST: f64 = 1e-3;
/// The slowest time constant of a memory, in lengths of the longest run: by that a step's response is linear in time during a run, and slower ones do the same.
const TIMES_LONGEST: f64 = 3.0;

/// What the data visit.
#[derive(Debug, Clone, Copy)]
pub(super) struct Visited {
    /// Lowest voltage, 0 at most, and highest, 0 at least (V).
    pub(super) volts: [f64; 2],
    /// Largest elastic curvature of the nominal robot (1/m).
    pub(super) curvature: f64,
    /// Largest curvature of the nominal robot (1/m).
    pub(super) bend: f64,
    /// Largest rate of curvature of the nominal robot (1/(m·s)).
    pub(super) rate: f64,
    /// Largest moment on the root of the nominal robot (mN·m).
    pub(super) root_moment: f64,
    /// Largest slip speed on the floor of the nominal robot (mm/s).
    pub(super) slip_speed: f64,
    /// Largest coordinate of a marker (mm).
    pub(super) coordinate: f64,
    /// Whether x and z are measured.
    pub(super) axes: [bool; 2],
    /// The longest run (s).
    pub(super) longest: f64,
}

impl Visited {
    /// Nothing: without free forms.
    pub(super) const NOTHING: Self = Self {
        volts: [0.0; 2],
        curvature: LEAST,
        bend: LEAST,
        rate: LEAST,
        root_moment: LEAST,
        slip_speed: 1.0,
        coordinate: 1.0,
        axes: [true; 2],
        longest: 0.0,
    };

    /// What the data give of an effect by the name of its parameter, as the range of a free form; none of other parameters.
    pub(super) fn given(&self, name: &str) -> Option<f64> {
        match name {
            "low_v" => Some(self.volts[0]),
            "high_v" => Some(self.volts[1]),
            "span_v" => Some((self.volts[1] - self.volts[0]).max(1.0)),
            "low_per_m" => Some(-self.curvature),
            "high_per_m" | "range_per_m" => Some(self.curvature),
            "bend_range_per_m" => Some(self.bend),
            "range_per_m_s" => Some(self.rate),
            "range_mm_s" => Some(self.slip_speed),
            "range_mm" => Some(self.coordinate),
            "range_mn_m" => Some(self.root_moment),
            "slowest_s" => Some(TIMES_LONGEST * self.longest),
            _ => None,
        }
    }

    /// True if the data do not reach the side of a curve that the parameter `name` belongs to, or do not show the axis.
    pub(super) fn is_beyond(&self, effect: &Effect, name: &str) -> bool {
        let has = |range: &str| effect.parameters.iter().any(|p| p.name == range);
        let is_of_picture = has("x_of_z");
        let is_unseen = |axis: usize, prefix: &str| is_of_picture && !self.axes[axis] && name.starts_with(prefix);
        if is_unseen(0, "x_") || is_unseen(1, "z_") {
            return true;
        }
        has("low_v")
            && ((name.starts_with("below") && self.volts[0] == 0.0) || (name.starts_with("above") && self.volts[1] == 0.0))
    }
}

/// A run of the nominal model.
pub(super) struct Visit<'a> {
    pub robot: &'a Robot,
    pub start: &'a Start,
    pub drive: Table,
    /// Time step (s).
    pub step: f64,
    /// Number of steps.
    pub steps: u64,
}

/// What `runs` visit.
///
/// # Errors
/// [`EngineError`] if a run cannot be simulated.
pub(super) fn visited(runs: &[Visit]) -> Result<Visited, EngineError> {
    let mut volts = [0.0_f64; 2];
    for v in runs.iter().flat_map(|run| run.drive.volts()) {
        volts = [volts[0].min(*v), volts[1].max(*v)];
    }
    let largest = runs.par_iter().map(extremes).collect::<Result<Vec<_>, _>>()?;
    let in_units = [100.0, 100.0, 1e-4, 10.0, 100.0];
    let mut most = [LEAST; 5];
    for of_run in &largest {
        most = [0, 1, 2, 3, 4].map(|k| f64::max(most[k], in_units[k] * of_run[k]));
    }
    let [curvature, rate, root_moment, slip_speed, bend] = most;
    let longest = runs.iter().map(|run| run.step * run.steps as f64).fold(0.0, f64::max);
    Ok(Visited { volts, curvature, bend, rate, root_moment, slip_speed, longest, ..Visited::NOTHING })
}

/// Largest elastic curvature of a joint (1/cm), largest rate of curvature (1/(cm·s)), largest moment on the root (dyn·cm), largest slip speed (cm/s) and
/// largest curvature (1/cm) in a run. Nodes near the floor slip.
fn extremes(run: &Visit) -> Result<[f64; 5], EngineError> {
    let Visit { robot, start, drive, step: h, steps } = run;
    let h = *h;
    let drive = Drive { waveform: Waveform::Table(drive.clone()), positive_gain: 1.0, delay: 0.0 };
    let mut engine = PlanarEngine::new(robot, h)?;
    let mut means = Means::new(&drive, robot.actuators, 0.0);
    let mut volts = vec![0.0; robot.actuators];
    drive.voltages(0.0, &mut volts);
    put(&mut engine, robot, h, start, &volts)?;
    let (link, per_volt) = (robot.link_length(), robot.joint().rest_angle_per_volt);
    // A load that is spread evenly makes this of the first joint's moment at the root, half a link before it.
    let to_root = (1.0 - 0.5 / robot.joints() as f64).powi(-2);
    let mut largest = [0.0_f64; 5];
    let nodes = if robot.mount == Mount::Ground { 3 * (robot.joints() + 2) } else { 0 };
    let (mut positions, mut velocities) = (vec![0.0; nodes], vec![0.0; nodes]);
    for step in 0..*steps {
        means.over(step as f64 * h, (step + 1) as f64 * h, &mut volts);
        engine.prepare(&volts)?;
        engine.advance()?;
        if nodes > 0 {
            engine.nodes(&mut positions, &mut velocities)?;
            let slip = |node: (&[f64], &[f64])| if node.0[2] < VISCOUS_REACH { node.1[0].abs() } else { 0.0 };
            largest[3] = positions.chunks_exact(3).zip(velocities.chunks_exact(3)).map(slip).fold(largest[3], f64::max);
        }
        let joints = engine.joints();
        largest[2] = largest[2].max(to_root * joints.torques[0].abs());
        for ((angle, rate), volts) in joints.angles.iter().zip(&joints.rates).zip(&joints.motor_voltages) {
            largest[0] = largest[0].max((angle - per_volt * volts).abs() / link);
            largest[1] = largest[1].max(rate.abs() / link);
            largest[4] = largest[4].max(angle.abs() / link);
        }
    }
    Ok(largest)
}
