//! States as numbers: saved ones, which outlive the engine, and checkpoints of a run with adaptive steps.

use super::attachment::Attachments;
use super::lanes::Lanes;
use super::quad::Quad;
use super::{EngineError, PlanarEngine, place};

impl PlanarEngine {
    /// All lanes, with the sums for the energy audit.
    pub(super) fn write_checkpoint(&self, into: &mut Vec<f64>) {
        for Quad { angle, posed, along: [x, z], motion: [a, b, c], .. } in &self.quads {
            for lanes in [angle, posed, x, z, a, b, c] {
                into.extend_from_slice(&lanes.to_array());
            }
        }
        into.extend(self.centre.iter().chain(&self.velocity).chain(&self.work_sums));
        into.extend([self.numerical_loss, self.step as f64]);
        into.extend(self.floor.saved());
        into.extend(self.saved_extensions());
    }

    pub(super) fn read_checkpoint(&mut self, checkpoint: &[f64]) -> Result<(), EngineError> {
        let (lanes, rest) = checkpoint.split_at(4 * 7 * self.quads.len());
        let mut lanes = lanes.as_chunks().0.iter().map(|values| Lanes::new(*values));
        for Quad { angle, posed, along: [x, z], motion: [a, b, c], .. } in &mut self.quads {
            for to in [angle, posed, x, z, a, b, c] {
                *to = lanes.next().ok_or(EngineError::State)?;
            }
        }
        let [x, z, vx, vz, volts, squares, loss, step, ref rest @ ..] = *rest else { return Err(EngineError::State) };
        let (corners, memory) = rest.split_at(self.floor.saved().count());
        self.floor.restore(corners);
        self.restore_extensions(memory);
        self.step = step as u64;
        (self.centre, self.velocity, self.work_sums, self.numerical_loss) = ([x, z], [vx, vz], [volts, squares], loss);
        self.finite = true;
        Ok(())
    }

    /// Memory of joint extensions, then of what is fixed to the sheet.
    fn saved_extensions(&self) -> impl Iterator<Item = f64> + '_ {
        let joints = self.extensions.iter().flat_map(|joints| joints.saved());
        joints.chain(self.attachments.iter().flat_map(Attachments::saved))
    }

    fn restore_extensions(&mut self, memory: &[f64]) {
        let (joints, points) = memory.split_at(self.extensions.iter().flat_map(|joints| joints.saved()).count());
        if let Some(extensions) = &mut self.extensions {
            extensions.restore(joints);
        }
        if let Some(attachments) = &mut self.attachments {
            attachments.restore(points);
        }
    }

    /// Angles of the bodies (rad, anticlockwise), then rate (rad/s) and velocity of the centre of mass (cm/s) of each, then centre of mass and
    /// velocity of the robot, then the directions of the last step's middle with their angles, then contact modes, then the memory of joint extensions and of what is fixed to the sheet.
    pub(super) fn state_numbers(&self) -> Vec<f64> {
        let bodies = || 0..self.count;
        let mut state: Vec<f64> = bodies().map(|i| self.of_body(i, |quad| quad.angle)).collect();
        state.extend(bodies().flat_map(|i| [0, 1, 2].map(|k| self.of_body(i, |quad| quad.motion[k]))));
        state.extend(self.centre);
        state.extend(self.velocity);
        state.extend(bodies().flat_map(|i| [0, 1].map(|k| self.of_body(i, |quad| quad.along[k]))));
        state.extend(bodies().map(|i| self.of_body(i, |quad| quad.posed)));
        state.extend(self.floor.saved());
        state.extend(self.saved_extensions());
        state
    }

    pub(super) fn set_state_numbers(&mut self, step: u64, state: &[f64]) -> Result<(), EngineError> {
        let count = self.count;
        let corners = self.floor.saved().count();
        let memory = self.saved_extensions().count();
        if state.len() != 7 * count + 4 + corners + memory || state.iter().any(|value| !value.is_finite()) {
            return Err(EngineError::State);
        }
        let (angles, rest) = state.split_at(count);
        let (motions, rest) = rest.split_at(3 * count);
        let (centre, rest) = rest.split_at(4);
        let (along, rest) = rest.split_at(2 * count);
        let (posed, rest) = rest.split_at(count);
        let (corners, memory) = rest.split_at(corners);
        for i in 0..count {
            let (quad, lane) = place(i, self.root);
            let at = &mut self.quads[quad];
            at.angle.set_lane(lane, angles[i]);
            at.posed.set_lane(lane, posed[i]);
            (0..3).for_each(|k| at.motion[k].set_lane(lane, motions[3 * i + k]));
            (0..2).for_each(|k| at.along[k].set_lane(lane, along[2 * i + k]));
        }
        self.fill_padding();
        (self.centre, self.velocity) = ([centre[0], centre[1]], [centre[2], centre[3]]);
        self.floor.restore(corners);
        self.restore_extensions(memory);
        self.finite = false;
        self.step = step;
        Ok(())
    }

    /// Gives padding lanes the pose and rate of their proximal neighbours, which steps preserve.
    pub(super) fn fill_padding(&mut self) {
        for (k, lane) in (0..self.quads.len()).flat_map(|k| (0..4).map(move |lane| (k, lane))) {
            if self.quads[k].mass.lane(lane) > 0.0 {
                continue;
            }
            let from = match (k, lane) {
                (0, 1) => (0, 0),
                (k, 0 | 1) => (k - 1, lane + 2),
                (k, lane) => (k, lane - 2),
            };
            let Quad { angle, posed, motion: [rate, ..], along: [x, z], .. } = self.quads[from.0];
            let at = &mut self.quads[k];
            let [to_x, to_z] = &mut at.along;
            for (to, number) in [(&mut at.angle, angle), (&mut at.posed, posed), (&mut at.motion[0], rate), (to_x, x), (to_z, z)]
            {
                to.set_lane(lane, number.lane(from.1));
            }
        }
    }
}
