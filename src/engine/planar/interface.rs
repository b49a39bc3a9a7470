//! The planar engine as an [`Engine`].

use fearless_simd::dispatch;

use super::lanes::Lanes;
use super::law::Ahead;
use super::quad::Quad;
use super::{ClampHits, Contact, EnergyTerms, Engine, EngineError, JointState, PlanarBase, PlanarEngine, Posed, landing, place};
use crate::model::{Mount, Robot};

impl Engine for PlanarEngine {
    fn prepare(&mut self, voltages: &[f64]) -> Result<(), EngineError> {
        // Without the division by the motors of an actuator, in every step.
        if voltages.len() * self.motors_per_actuator + 1 != self.count {
            return Err(EngineError::Voltages { given: voltages.len(), needed: self.actuators() });
        }
        self.apply(voltages);
        if self.finite { Ok(()) } else { self.check_finite() }
    }

    fn joints(&mut self) -> &JointState {
        self.read_joints();
        &self.state
    }

    /// Positions and velocities of the same time, unlike the reference's.
    fn nodes(&mut self, positions: &mut [f64], velocities: &mut [f64]) -> Result<(), EngineError> {
        for (what, given) in [("the nodes' positions", positions.len()), ("the nodes' velocities", velocities.len())] {
            EngineError::unless_length(what, given, 3 * (self.count + 1))?;
        }
        self.with_present_pose(|engine| {
            let (mut position, mut velocity) = engine.left_end();
            let rows = positions.chunks_exact_mut(3).zip(velocities.chunks_exact_mut(3));
            for (i, (node, node_velocity)) in rows.enumerate() {
                node.copy_from_slice(&[position[0], 0.0, position[1]]);
                node_velocity.copy_from_slice(&[velocity[0], 0.0, velocity[1]]);
                if i < engine.count {
                    let [x, z] = engine.body_vector(i);
                    let rate = engine.of_body(i, |quad| quad.motion[0]);
                    position = [position[0] + x, position[1] + z];
                    velocity = [velocity[0] - rate * z, velocity[1] + rate * x];
                }
            }
        });
        Ok(())
    }

    fn places(&mut self, nodes: &mut [[f64; 2]]) -> Result<(), EngineError> {
        EngineError::unless_length("the nodes' places", nodes.len(), self.count + 1)?;
        dispatch!(self.level, simd => self.places_here(simd, nodes));
        Ok(())
    }

    fn landing(&mut self, least: f64) -> f64 {
        if self.mount == Mount::Ground { dispatch!(self.level, simd => self.landing_here(simd, least)) } else { f64::INFINITY }
    }

    fn motor_voltages(&self) -> &[f64] {
        &self.state.motor_voltages
    }

    fn base(&mut self) -> Result<PlanarBase, EngineError> {
        Ok(self.with_present_pose(|engine| {
            let (position, velocity) = engine.left_end();
            let [x, z] = engine.body_vector(0).map(|part| 0.5 * part);
            let rate = engine.of_body(0, |quad| quad.motion[0]);
            PlanarBase {
                position: [position[0] + x, position[1] + z],
                pitch: -engine.of_body(0, |quad| quad.angle),
                velocity: [velocity[0] - rate * z, velocity[1] + rate * x],
                pitch_rate: -rate,
            }
        }))
    }

    fn contacts(&mut self, contacts: &mut Vec<Contact>) -> Result<(), EngineError> {
        contacts.clear();
        self.with_present_pose(|engine| {
            if engine.mount != Mount::Ground {
                return;
            }
            let (mut left, _) = engine.left_end();
            for i in 0..engine.count {
                let vector = engine.body_vector(i);
                let right = [left[0] + vector[0], left[1] + vector[1]];
                let (quad, lane) = place(i, engine.root);
                let ends = if i < engine.root { [right, left] } else { [left, right] };
                // The side of the box that looks down.
                let [cos, sin] = vector.map(|part| part / engine.lengths[i]);
                let down = engine.floor.half_thickness().copysign(cos);
                let impulses = engine.floor.impulses_on(2 * quad + lane / 2, lane % 2, &engine.law);
                for (end, impulse) in ends.into_iter().zip(impulses) {
                    if impulse[1] > 0.0 {
                        let position = [end[0] + down * sin, end[1] - down * cos];
                        contacts.push(Contact { link: i, position, force: impulse.map(|part| part / engine.time_step) });
                    }
                }
                left = right;
            }
        });
        Ok(())
    }

    fn set_joint_angles(&mut self, robot: &Robot, angles: &[f64]) -> Result<(), EngineError> {
        let posed = Posed::new(robot, angles)?;
        for (i, angle) in posed.directions.iter().enumerate() {
            let (quad, lane) = place(i, self.root);
            let at = &mut self.quads[quad];
            at.angle.set_lane(lane, *angle);
            at.posed.set_lane(lane, *angle);
            at.along.iter_mut().zip([angle.cos(), angle.sin()]).for_each(|(to, value)| to.set_lane(lane, value));
        }
        self.fill_padding();
        if self.mount != Mount::Clamped {
            self.centre = [posed.centre[0], posed.centre[1] + posed.lift];
        }
        self.finite = false;
        Ok(())
    }

    fn advance(&mut self) -> Result<(), EngineError> {
        dispatch!(self.level, simd => self.advance_here(simd))
    }

    fn midpoint(&self) -> bool {
        true
    }

    fn energy_terms(&self) -> Option<EnergyTerms> {
        let twice = |quad: &Quad| {
            let [rate, x, z] = quad.motion;
            quad.mass * (x * x + z * z) + quad.inertia * rate * rate
        };
        Some(EnergyTerms {
            kinetic: 0.5 * self.quads.iter().map(twice).fold(Lanes::ZERO, |a, b| a + b).sum(),
            gravitational: (!self.clamped()).then(|| self.mass * self.gravity * self.centre[1]),
            work_sums: self.work_sums,
            numerical_loss: self.numerical_loss,
        })
    }

    fn set_time_step(&mut self, time_step: f64, ahead: Option<f64>) -> Result<(), EngineError> {
        EngineError::unless_step(time_step)?;
        self.set_length(time_step, ahead.map_or_else(|| landing::ahead(time_step), Ahead::all));
        self.law.at_once = time_step;
        self.law.landing_speed = if ahead.is_none() { self.landing_speed() } else { f64::INFINITY };
        Ok(())
    }

    fn set_step(&mut self, step: u64) {
        self.step = step;
    }

    fn checkpoint(&self, into: &mut Vec<f64>) -> Result<(), EngineError> {
        self.write_checkpoint(into);
        Ok(())
    }

    fn rewind(&mut self, checkpoint: &[f64]) -> Result<(), EngineError> {
        self.read_checkpoint(checkpoint)
    }

    fn save(&self) -> Result<Vec<f64>, EngineError> {
        Ok(self.state_numbers())
    }

    fn load(&mut self, step: u64, state: &[f64]) -> Result<(), EngineError> {
        self.set_state_numbers(step, state)
    }

    fn actuators(&self) -> usize {
        (self.count - 1) / self.motors_per_actuator
    }

    fn step(&self) -> u64 {
        self.step
    }

    fn clamp_hits(&self) -> Option<ClampHits> {
        None
    }
}
