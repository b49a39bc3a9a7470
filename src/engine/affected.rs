//! An engine behind an actuation signal chain.

use super::{ClampHits, Contact, EnergyTerms, Engine, EngineError, JointState, PlanarBase};
use crate::effects::SignalChain;
use crate::model::Robot;

/// Any engine behind a [`SignalChain`].
pub struct AffectedEngine {
    engine: Box<dyn Engine>,
    chain: SignalChain,
    time_step: f64,
    voltages: Vec<f64>,
    /// Voltages of one part of a step (V).
    piece: Vec<f64>,
}

impl AffectedEngine {
    /// `engine`, which steps by `time_step` (s), behind a `chain` in equilibrium with the first voltages.
    pub fn new(engine: Box<dyn Engine>, chain: SignalChain, time_step: f64) -> Self {
        Self { engine, chain, time_step, voltages: Vec::new(), piece: Vec::new() }
    }
}

impl Engine for AffectedEngine {
    /// The signal chain advances with every call, so this is called once before every [`advance`](Engine::advance).
    fn prepare(&mut self, voltages: &[f64]) -> Result<(), EngineError> {
        EngineError::unless_voltages(voltages.len(), self.actuators())?;
        self.voltages.clear();
        self.voltages.extend_from_slice(voltages);
        self.chain.pass(self.time_step, &mut self.voltages);
        self.engine.prepare(&self.voltages)
    }

    fn parts(&self) -> usize {
        self.chain.parts()
    }

    fn parts_of_step(&self, commanded: &[Vec<f64>; 3]) -> usize {
        self.chain.parts_of_step(self.time_step, commanded)
    }

    /// Each part passes the chain on its own; the engine gets the mean of the outputs.
    fn prepare_parts(&mut self, means: &[f64]) -> Result<(), EngineError> {
        let actuators = self.actuators();
        let parts = (means.len() / actuators).max(1);
        EngineError::unless_voltages(means.len(), parts * actuators)?;
        self.voltages.clear();
        self.voltages.resize(actuators, 0.0);
        for mean in means.chunks_exact(actuators) {
            self.piece.clear();
            self.piece.extend_from_slice(mean);
            self.chain.pass(self.time_step / parts as f64, &mut self.piece);
            self.voltages.iter_mut().zip(&self.piece).for_each(|(sum, v)| *sum += v / parts as f64);
        }
        self.engine.prepare(&self.voltages)
    }

    fn joints(&mut self) -> &JointState {
        self.engine.joints()
    }

    fn nodes(&mut self, positions: &mut [f64], velocities: &mut [f64]) -> Result<(), EngineError> {
        self.engine.nodes(positions, velocities)
    }

    fn correct_velocities(&mut self, velocities: &mut [f64]) -> Result<(), EngineError> {
        self.engine.correct_velocities(velocities)
    }

    fn places(&mut self, nodes: &mut [[f64; 2]]) -> Result<(), EngineError> {
        self.engine.places(nodes)
    }

    fn landing(&mut self, least: f64) -> f64 {
        self.engine.landing(least)
    }

    fn motor_voltages(&self) -> &[f64] {
        self.engine.motor_voltages()
    }

    fn base(&mut self) -> Result<PlanarBase, EngineError> {
        self.engine.base()
    }

    fn contacts(&mut self, contacts: &mut Vec<Contact>) -> Result<(), EngineError> {
        self.engine.contacts(contacts)
    }

    fn set_joint_angles(&mut self, robot: &Robot, angles: &[f64]) -> Result<(), EngineError> {
        self.engine.set_joint_angles(robot, angles)
    }

    fn advance(&mut self) -> Result<(), EngineError> {
        self.engine.advance()
    }

    /// The chain's memory, then the engine's state.
    fn save(&self) -> Result<Vec<f64>, EngineError> {
        let mut state = self.chain.save();
        state.extend(self.engine.save()?);
        Ok(state)
    }

    fn load(&mut self, step: u64, state: &[f64]) -> Result<(), EngineError> {
        let held = self.chain.held(state).ok_or(EngineError::State)?;
        let (memory, rest) = state.split_at(held);
        self.engine.load(step, rest)?;
        self.chain.load(memory);
        Ok(())
    }

    fn midpoint(&self) -> bool {
        self.engine.midpoint()
    }

    fn set_time_step(&mut self, time_step: f64, ahead: Option<f64>) -> Result<(), EngineError> {
        self.time_step = time_step;
        self.engine.set_time_step(time_step, ahead)
    }

    fn set_step(&mut self, step: u64) {
        self.engine.set_step(step);
    }

    /// The chain's memory, then the engine's checkpoint.
    fn checkpoint(&self, into: &mut Vec<f64>) -> Result<(), EngineError> {
        into.extend(self.chain.save());
        self.engine.checkpoint(into)
    }

    fn rewind(&mut self, checkpoint: &[f64]) -> Result<(), EngineError> {
        let held = self.chain.held(checkpoint).ok_or(EngineError::State)?;
        let (memory, rest) = checkpoint.split_at(held);
        self.chain.load(memory);
        self.engine.rewind(rest)
    }

    fn energy_terms(&self) -> Option<EnergyTerms> {
        self.engine.energy_terms()
    }

    fn actuators(&self) -> usize {
        self.engine.actuators()
    }

    fn step(&self) -> u64 {
        self.engine.step()
    }

    fn hardening_curvature(&self) -> f64 {
        self.engine.hardening_curvature()
    }

    fn clamp_hits(&self) -> Option<ClampHits> {
        self.engine.clamp_hits()
    }
}
