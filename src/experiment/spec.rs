//! An experiment as a JSON object with every value filled in, in CGS units: for manifests, and for the reference scripts.

use serde_json::{Value, json};

use super::{EngineKind, Experiment, Start};
use crate::drive::Waveform;
use crate::effects::Applied;
use crate::engine::FrictionModel;
use crate::model::{Damping, Film};

impl Experiment {
    /// Everything that decides the result, in CGS units and with no defaults left open.
    pub fn spec(&self) -> Value {
        let m = &self.robot.material;
        let f = &self.robot.friction;
        let (eta, time) = match self.robot.damping {
            Damping::Eta(eta) => (Some(eta), None),
            Damping::Time(time) => (None, Some(time)),
        };
        let mut spec = json!({
            "material": {
                "actuator_length": m.actuator_length, "width": m.width, "gravity": m.gravity,
                "piezo_modulus": m.piezo_modulus, "piezo_poisson": m.piezo_poisson,
                "piezo_thickness": m.piezo_thickness, "piezo_density": m.piezo_density,
                "d33": m.d33, "electrode_pitch": m.electrode_pitch,
                "substrate_modulus": m.substrate_modulus, "substrate_poisson": m.substrate_poisson,
                "substrate_thickness": m.substrate_thickness, "substrate_density": m.substrate_density,
                "adhesive_modulus": m.adhesive_modulus, "adhesive_thickness": m.adhesive_thickness,
                "adhesive_density": m.adhesive_density,
                "max_field": m.max_field.min(f64::MAX), "max_strain": m.max_strain.min(f64::MAX),
            },
            "actuators": self.robot.actuators,
            "motors_per_actuator": self.robot.motors_per_actuator,
            "mount": self.robot.mount.name(),
            "damping_eta": eta,
            "damping_time": time,
            "collision_thickness": self.robot.collision_thickness,
            "positive_gain": self.drive.positive_gain,
            "friction": {
                "ground": f.ground, "low": f.low, "high": f.high,
                "film": match f.film { Film::BothEnds => "both-ends", Film::RightEnd => "right-end", Film::None => "none" },
                "film_fraction": f.film_fraction,
            },
            "engine": match self.engine { EngineKind::Bullet => "bullet", EngineKind::Planar => "planar" },
            "start": match self.start { Start::Flat => "flat", Start::Settled => "settled" },
            "friction_model": match self.friction { FrictionModel::Convex => "convex", FrictionModel::Coulomb => "coulomb" },
            "drive": self.drive_spec(),
            "time_step": self.time_step,
            "steps": self.steps,
            "record_every_steps": self.record_every,
        });
        if let Some(damping) = self.numerical_damping {
            spec["numerical_damping"] = json!(damping);
        }
        if let Some(limit) = self.velocity_limit {
            spec["velocity_limit"] = json!(limit);
        }
        if !self.joint_angles.is_empty() {
            spec["joint_angles"] = json!(self.joint_angles);
        }
        if self.record_from + 1 != self.record_every {
            spec["record_from_step"] = json!(self.record_from);
        }
        if !self.effects.is_empty() {
            let values = |applied: &Applied| {
                let pairs = applied.effect.parameters.iter().zip(&applied.values);
                let fields = pairs.map(|(p, value)| (p.name.to_owned(), json!(value.clamp(f64::MIN, f64::MAX))));
                let id = ("id".to_owned(), json!(applied.effect.id));
                Value::Object(std::iter::once(id).chain(fields).collect())
            };
            spec["effects"] = self.effects.iter().map(values).collect();
        }
        if !self.robot.masses.is_empty() {
            spec["masses"] = self.robot.masses.iter().map(|m| json!({"mass": m.mass, "position": m.position})).collect();
        }
        if let Some(bodies) = &self.robot.bodies {
            spec["bodies"] = bodies.iter().map(|b| json!({"length": b.length, "mass": b.mass, "friction": b.friction})).collect();
        }
        spec
    }

    fn drive_spec(&self) -> Value {
        // JSON has no infinity; a phase that never ends gets the largest number.
        let finite = |t: f64| t.min(f64::MAX);
        match &self.drive.waveform {
            Waveform::Gait { gait, parameter, on_voltages } => {
                json!({"waveform": "gait", "gait": gait.name, "parameter": parameter, "on_voltages": on_voltages})
            }
            Waveform::Dc(voltages) => json!({"waveform": "dc", "voltages": voltages}),
            Waveform::Sine { amplitudes, frequency } => {
                json!({"waveform": "sine", "amplitudes": amplitudes, "frequency": frequency})
            }
            Waveform::Step { voltages, at } => json!({"waveform": "step", "voltages": voltages, "at": at}),
            Waveform::Sequence { period, phases } => {
                let phases: Vec<_> = phases.iter().map(|(until, voltages)| json!([finite(*until), voltages])).collect();
                json!({"waveform": "sequence", "period": period, "phases": phases})
            }
            Waveform::Table(table) => {
                let rows: Vec<_> = (0..table.times().len()).map(|row| table.row(row)).collect();
                json!({"waveform": "table", "times": table.times(), "voltages": rows})
            }
        }
    }
}
