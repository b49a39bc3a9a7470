//! The energy audit of a run: where energy came from and where it went.
//!
//! ```text
//! E = Σ (m v²/2 + I ω²/2) + Σ m g z + Σ k θ²/2        kinetic, gravitational, elastic
//! dE/dt = Σ k θ_V θ̇ − Σ k η θ̇² + P                    electrical work in, damping out, P: contact
//! ```
//!
//! The first two powers follow from the torque law, eq. 1, so P is the remainder. Friction and impacts make it negative; whatever the contact account ∫P dt
//! gains above its lowest level so far, nothing supplied: it comes from the contact solver or from too long a time step. Work over a step is torque times the
//! mean of the rates before and after, which is exact for the change of kinetic energy at a fixed pose.
//!
//! The audit is of the plane of motion: displacements along y and turns about x and z, which contact makes by rounding, are left out.

use serde::Serialize;

use super::{Contact, EnergyTerms, Engine, EngineError, JointState};
use crate::actuator::PiezoJoint;
use crate::model::{RigidBody, Robot, Segment};

/// Steps between audit samples of the state functions, of an explicit engine and of one that works at the middle of steps.
/// Work is summed in every step.
const SAMPLE_EVERY: u64 = 8;
const SAMPLE_EVERY_MIDPOINT: u64 = 64;

/// Pose and velocity of the base's centre of mass in the plane of motion.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct PlanarBase {
    /// x and z (cm).
    pub position: [f64; 2],
    /// Turn about +y (rad): positive lowers the far end.
    pub pitch: f64,
    /// x and z (cm/s).
    pub velocity: [f64; 2],
    /// About +y (rad/s).
    pub pitch_rate: f64,
}

/// The balance at the end of a run (erg). Energies are those above the flat robot at rest.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
pub struct EnergyBalance {
    /// Kinetic energy.
    pub kinetic_erg: f64,
    /// Gravitational energy.
    pub gravitational_erg: f64,
    /// Elastic energy of the joints, from flat.
    pub elastic_erg: f64,
    /// Work of the piezo moments k θ_V.
    pub electrical_in_erg: f64,
    /// Heat in the joints.
    pub damping_out_erg: f64,
    /// What the time stepping is known to have dissipated: the planar engine's numerical damping.
    pub numerical_out_erg: f64,
    /// What friction, impacts and the clamp took out: all falls of the contact account.
    pub contact_out_erg: f64,
    /// What contact gave: all rises of the contact account. Time steps and compliant contact make small ones that fall back at once.
    pub contact_in_erg: f64,
    /// Largest sum of kinetic energy, elastic energy and the magnitude of the gravitational one.
    pub largest_erg: f64,
    /// Largest rise of the contact account above its lowest level before: energy that nothing supplied.
    pub unsupplied_erg: f64,
    /// Where that rise first stood out, if it did.
    pub fault: Option<EnergyFault>,
}

impl EnergyBalance {
    /// Energy that nothing supplied, as a fraction of the largest mechanical energy (–).
    pub fn error(&self) -> f64 {
        if self.largest_erg > 0.0 { self.unsupplied_erg / self.largest_erg } else { 0.0 }
    }
}

/// Energy from nowhere: more than [`TOLERANCE`] of the largest mechanical energy.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct EnergyFault {
    /// When (s).
    pub time_s: f64,
    /// Link on which contact did most positive work during that rise, from 0 for the body at the left end; absent without contact.
    pub link: Option<usize>,
}

/// Share of the largest mechanical energy that may appear unsupplied. Measured: all presets at their own steps stay below 0.002, and
/// the kick that Bullet's contact gives the inchworm sequence at 10 Hz makes 0.8.
pub const TOLERANCE: f64 = 0.01;

/// A rise of the contact account; noted when it is twice as high as the last one.
#[derive(Debug, Clone, Copy)]
struct Rise {
    height: f64,
    time: f64,
    link: Option<usize>,
}

/// A body of the chain.
#[derive(Debug, Clone, Copy)]
struct Body {
    length: f64,
    mass: f64,
    /// About y through the centre of mass (g·cm²).
    inertia: f64,
    /// From the middle of its length to the centre of mass (cm).
    off_middle: f64,
}

/// One body's motion in the plane.
#[derive(Debug, Clone, Copy, Default)]
struct Motion {
    centre: [f64; 2],
    velocity: [f64; 2],
    rate: f64,
}

/// The energy audit of one run.
#[derive(Debug)]
pub struct EnergyAudit {
    bodies: Vec<Body>,
    joint: PiezoJoint,
    gravity: f64,
    time_step: f64,
    motions: Vec<Motion>,
    contacts: Vec<Contact>,
    /// Joints of the step before, or of the last sample if the engine works at the middle of steps.
    before: JointState,
    begun: bool,
    /// Steps until the next sample, of an engine that works at the middle of steps.
    pause: u64,
    /// [`EnergyTerms::work_sums`] at the last sample.
    work_sums_before: [f64; 2],
    ground_energy: f64,
    numerical_before: f64,
    account: f64,
    lowest: f64,
    /// Work of contact on each link since the account was lowest, in samples.
    gained: Vec<f64>,
    rises: Vec<Rise>,
    balance: EnergyBalance,
}

impl EnergyAudit {
    /// The audit of a robot that is stepped by `time_step` (s).
    pub fn new(robot: &Robot, time_step: f64) -> Self {
        let of_segment = |(segment, body): (Segment, RigidBody)| Body {
            length: segment.length,
            mass: body.mass,
            inertia: body.inertia,
            off_middle: (body.middle - 0.5) * segment.length,
        };
        let bodies: Vec<Body> = robot.segments().into_iter().zip(robot.rigid_bodies()).map(of_segment).collect();
        let count = bodies.len();
        Self {
            bodies,
            joint: robot.joint(),
            gravity: robot.material.gravity,
            time_step,
            motions: vec![Motion::default(); count],
            contacts: Vec::new(),
            before: JointState::default(),
            begun: false,
            pause: 0,
            work_sums_before: [0.0; 2],
            ground_energy: 0.0,
            numerical_before: 0.0,
            account: 0.0,
            lowest: 0.0,
            gained: vec![0.0; count],
            rises: Vec::new(),
            balance: EnergyBalance::default(),
        }
    }

    /// Takes the state before a step, at `time` (s), after [`Engine::prepare`].
    ///
    /// # Errors
    /// Whatever the engine reports when it is read.
    pub fn take(&mut self, time: f64, engine: &mut dyn Engine) -> Result<(), EngineError> {
        if self.pause > 0 {
            self.pause -= 1;
            return Ok(());
        }
        let terms = engine.energy_terms();
        let [electrical, heat] = self.work(engine, terms.as_ref());
        if self.begun {
            let k = self.joint.stiffness;
            self.balance.electrical_in_erg += k * electrical;
            self.balance.damping_out_erg += k * self.joint.damping_time * heat;
        }
        let every = if terms.is_some() { SAMPLE_EVERY_MIDPOINT } else { SAMPLE_EVERY };
        let since = engine.step() % every;
        if terms.is_some() {
            self.pause = every - since - 1;
        }
        let is_sample = !self.begun || since == 0;
        if is_sample || terms.is_none() {
            self.before.clone_from(engine.joints());
        }
        if is_sample {
            self.sample(time, engine, terms)?;
            self.begun = true;
        }
        Ok(())
    }

    /// Work of the piezo moments since the last call over the stiffness, and heat over stiffness and damping time.
    fn work(&mut self, engine: &mut dyn Engine, terms: Option<&EnergyTerms>) -> [f64; 2] {
        let per_volt = self.joint.rest_angle_per_volt;
        if let Some(terms) = terms {
            // Torques and rates of the middle of the step: the rate is the turn over the step.
            let sums = terms.work_sums;
            let before = std::mem::replace(&mut self.work_sums_before, sums);
            return [(sums[0] - before[0]) * per_volt, sums[1] - before[1]];
        }
        let (joints, b) = (engine.joints(), &self.before);
        let (mut electrical, mut heat) = (0.0, 0.0);
        for i in 0..b.rates.len() {
            let turn = 0.5 * (b.rates[i] + joints.rates[i]) * self.time_step;
            electrical += per_volt * b.motor_voltages[i] * turn;
            heat += b.rates[i] * turn;
        }
        [electrical, heat]
    }

    /// The balance at the last sample.
    pub fn balance(&self) -> EnergyBalance {
        let limit = TOLERANCE * self.balance.largest_erg;
        let first = self.rises.iter().find(|rise| rise.height > limit);
        EnergyBalance { fault: first.map(|rise| EnergyFault { time_s: rise.time, link: rise.link }), ..self.balance }
    }

    fn sample(&mut self, time: f64, engine: &mut dyn Engine, terms: Option<EnergyTerms>) -> Result<(), EngineError> {
        let (kinetic, height) = if let Some(EnergyTerms { kinetic, gravitational: Some(height), .. }) = terms {
            (kinetic, height)
        } else {
            self.move_bodies(&engine.base()?);
            let [kinetic, height] = self.energies();
            (terms.map_or(kinetic, |terms| terms.kinetic), height)
        };
        let numerical_loss = terms.map_or(0.0, |terms| terms.numerical_loss);
        let elastic = 0.5 * self.joint.stiffness * self.before.angles.iter().map(|a| a * a).sum::<f64>();
        if !self.begun {
            self.ground_energy = height;
            self.numerical_before = numerical_loss;
        }
        let b = &mut self.balance;
        b.kinetic_erg = kinetic;
        b.gravitational_erg = height - self.ground_energy;
        b.elastic_erg = elastic;
        let mechanical = kinetic + b.gravitational_erg + elastic;
        // A robot that falls or sags from rest has energies that add up to nothing.
        b.largest_erg = b.largest_erg.max(kinetic + elastic + b.gravitational_erg.abs());
        b.numerical_out_erg = numerical_loss - self.numerical_before;
        let account = mechanical - b.electrical_in_erg + b.damping_out_erg + b.numerical_out_erg;
        if !self.begun {
            (self.account, self.lowest) = (account, account);
            return Ok(());
        }
        let change = account - self.account;
        self.account = account;
        if change > 0.0 {
            b.contact_in_erg += change;
        } else {
            b.contact_out_erg -= change;
        }
        if account <= self.lowest {
            self.lowest = account;
            self.gained.fill(0.0);
            return Ok(());
        }
        self.collect(engine)?;
        let height = account - self.lowest;
        self.balance.unsupplied_erg = self.balance.unsupplied_erg.max(height);
        if height > 2.0 * self.rises.last().map_or(0.0, |rise| rise.height) {
            let most = self.gained.iter().enumerate().max_by(|a, b| a.1.total_cmp(b.1));
            let link = most.filter(|(_, gain)| **gain > 0.0).map(|(link, _)| link);
            self.rises.push(Rise { height, time, link });
        }
        Ok(())
    }

    /// Kinetic and gravitational energy of the bodies as they were last moved (erg).
    fn energies(&self) -> [f64; 2] {
        let sum = |of: &dyn Fn(&Body, &Motion) -> f64| self.bodies.iter().zip(&self.motions).map(|(b, m)| of(b, m)).sum::<f64>();
        [
            sum(&|b, m| 0.5 * (b.mass * (m.velocity[0].powi(2) + m.velocity[1].powi(2)) + b.inertia * m.rate.powi(2))),
            sum(&|b, m| b.mass * self.gravity * m.centre[1]),
        ]
    }

    /// Adds what contact did on each link in the last step, as a sample of the interval.
    fn collect(&mut self, engine: &mut dyn Engine) -> Result<(), EngineError> {
        self.move_bodies(&engine.base()?);
        engine.contacts(&mut self.contacts)?;
        for contact in &self.contacts {
            let m = &self.motions[contact.link];
            let arm = [contact.position[0] - m.centre[0], contact.position[1] - m.centre[1]];
            // A turn about +y takes +x towards −z: v = (ω z, −ω x).
            let velocity = [m.velocity[0] + m.rate * arm[1], m.velocity[1] - m.rate * arm[0]];
            self.gained[contact.link] += contact.force[0] * velocity[0] + contact.force[1] * velocity[1];
        }
        Ok(())
    }

    /// Forward kinematics, from the base to the far end.
    fn move_bodies(&mut self, base: &PlanarBase) {
        let (mut pitch, mut rate) = (base.pitch, base.pitch_rate);
        let (mut end, mut end_velocity) = (base.position, base.velocity);
        for (i, body) in self.bodies.iter().enumerate() {
            if i > 0 {
                pitch += self.before.angles[i - 1];
                rate += self.before.rates[i - 1];
            }
            let (sin, cos) = pitch.sin_cos();
            let half = 0.5 * body.length;
            let along = |from: [f64; 2], by: f64| [from[0] + by * cos, from[1] - by * sin];
            let turned = |from: [f64; 2], by: f64| [from[0] - by * sin * rate, from[1] - by * cos * rate];
            let (centre, velocity) = if i == 0 { (end, end_velocity) } else { (along(end, half), turned(end_velocity, half)) };
            self.motions[i] =
                Motion { centre: along(centre, body.off_middle), velocity: turned(velocity, body.off_middle), rate };
            end = along(centre, half);
            end_velocity = turned(velocity, half);
        }
    }
}
