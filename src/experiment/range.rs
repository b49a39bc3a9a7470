//! The range in which the model and the engines are right: steps that are stable, bending that a laminate bears, friction that is solved for.

use super::{EngineKind, Experiment};
use crate::analytic;
use crate::model::Robot;
use crate::recording::accumulator::SAMPLES_OF_A_PERIOD;

/// Times the strain that the material bears at which a result is clearly outside the model's range.
pub(super) const CLEARLY: f64 = 2.0;
/// The largest joint angle of a run.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Bending {
    /// Its magnitude (rad).
    pub angle: f64,
    /// The joint, from 0.
    pub joint: usize,
    /// When (s).
    pub time: f64,
}

impl Bending {
    pub(super) fn take(&mut self, angles: &[f64], time: f64) {
        let largest = angles.iter().fold(0.0_f64, |largest, angle| largest.max(angle.abs()));
        if largest > self.angle {
            let joint = angles.iter().position(|angle| angle.abs() == largest).unwrap_or(0);
            *self = Self { angle: largest, joint, time };
        }
    }

    /// What is wrong with it, if the laminate was strained by more than `times` what it bears, or neighbouring links were turned by more than
    /// `times` a right angle: a coarse chain at resonance comes to one, and twice that folds a link onto its neighbour.
    pub(super) fn beyond(self, robot: &Robot, times: f64) -> Option<String> {
        let Self { angle, joint, time } = self;
        let strain = angle / robot.link_length() * robot.material.outer_fibre();
        let place = format!("joint {} is bent by {angle:.3} rad at t = {time:.6} s", joint + 1);
        if angle > times * std::f64::consts::FRAC_PI_2 {
            return Some(format!(
                "{place}, more than a right angle between neighbouring links, which are then no beam: the result is outside the model's \
                 range; try a weaker drive, a smaller time step, or more motors_per_actuator"
            ));
        }
        let limit = robot.material.max_strain;
        (strain > times * limit).then(|| {
            format!(
                "{place}, a strain of {strain:.2e} in the laminate's outer fibre, above material.max_strain = {limit:e}: the result is \
                 outside the model's range; try a weaker drive or a smaller time step, or set material.max_strain higher if yours bears more"
            )
        })
    }
}

/// What is wrong with a time step on Bullet that is longer than the largest stable one (s), and which to take.
pub(crate) fn step_too_long(time_step: f64, stable: f64) -> String {
    // Rounded down to two digits, so that what is read is stable.
    let digit = 10_f64.powf(stable.log10().floor() - 1.0);
    let advised = (stable / digit).floor() * digit;
    format!(
        "the time step {time_step:e} s is above the largest one that is stable on Bullet, {stable:.3e} s; set simulation.time_step_s to \
         {advised:.1e} or less"
    )
}

/// What is wrong with a drive that repeats in fewer steps than [`SAMPLES_OF_A_PERIOD`].
pub(super) fn aliased(experiment: &Experiment) -> Option<String> {
    let period = experiment.drive.period().filter(|period| *period < SAMPLES_OF_A_PERIOD * experiment.time_step)?;
    Some(format!(
        "the drive's period of {period:e} s is shorter than {SAMPLES_OF_A_PERIOD} time steps of {:e} s, which cannot follow it; try a smaller time step",
        experiment.time_step
    ))
}

/// The largest stable step (s), if the experiment's is longer and its engine explicit, whose joints were bent by up to `curvature` (1/cm).
pub(crate) fn unstable(experiment: &Experiment, curvature: f64) -> Option<f64> {
    let explicit = experiment.engine == EngineKind::Bullet;
    explicit.then(|| analytic::stable_step_at(&experiment.robot, curvature)).filter(|stable| experiment.time_step > *stable)
}
