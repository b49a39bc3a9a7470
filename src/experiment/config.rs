//! Experiment files: TOML with units in the keys. Unknown keys are refused, with line and column.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use thiserror::Error;
use toml::Table;
use toml::de::{DeTable, DeValue};

use super::ensemble::EnsembleConfig;
use super::presets;
use crate::effects::Effect;
use crate::words;

/// An experiment that cannot be run as it is written.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum ConfigError {
    /// The file cannot be read.
    #[error("{}: {reason}", path.display())]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// Why.
        reason: String,
    },
    /// Not TOML, an unknown key, or a value of the wrong type; the message shows line, column and key.
    #[error("{source_name}: {message}")]
    Syntax {
        /// The file or argument.
        source_name: String,
        /// What the parser found.
        message: String,
    },
    /// A value that makes no experiment.
    #[error("{place}: {key}: {message}")]
    Value {
        /// The file, with the line where the key stands, or the argument that set it.
        place: String,
        /// The key.
        key: String,
        /// What is wrong, and what to try.
        message: String,
    },
    /// A file that the experiment refers to is damaged.
    #[error("{}: {reason}", path.display())]
    Data {
        /// The file.
        path: PathBuf,
        /// What is wrong with it, and in which line.
        reason: String,
    },
}

/// A key and what is wrong with its value, before the place in the file is known.
#[derive(Debug)]
pub(super) struct Fault {
    pub key: String,
    pub message: String,
}

impl From<Fault> for ConfigError {
    fn from(Fault { key, message }: Fault) -> Self {
        Self::Value { place: "the config".into(), key, message }
    }
}

impl Fault {
    pub fn new(key: impl Into<String>, message: impl Into<String>) -> Self {
        Self { key: key.into(), message: message.into() }
    }
}

/// An experiment file as written, every key optional. The keys' meaning: [`keys::guide`](crate::keys::guide).
#[derive(Debug, Clone, Default, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields, default)]
pub struct Config {
    /// `[material]`.
    pub material: MaterialConfig,
    /// `[robot]`.
    pub robot: RobotConfig,
    /// `[drive]`.
    pub drive: DriveConfig,
    /// `[simulation]`.
    pub simulation: SimulationConfig,
    /// `[[effect]]` tables.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub effect: Vec<EffectConfig>,
    /// `[ensemble]`, which [`ensemble::members`](super::ensemble::members) reads; the experiment itself is its first member.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub ensemble: Option<EnsembleConfig>,
}

impl Config {
    /// The files that it refers to, as they are written: a new key that names a file belongs here, or sweeps do not notice its changes.
    pub fn files(&self) -> impl Iterator<Item = &Path> {
        self.drive.file.as_deref().into_iter()
    }
}

/// One `[[effect]]`: its id and its parameters.
#[derive(Debug, Clone, Default, PartialEq, Deserialize, Serialize)]
pub struct EffectConfig {
    /// Name of the effect.
    pub id: String,
    /// Values by parameter or group of numbered parameters.
    #[serde(flatten)]
    pub parameters: BTreeMap<String, EffectValue>,
}

impl EffectConfig {
    /// A table that gives `parameters` (name, value), those of a whole group as a list.
    pub fn new<'a>(effect: &Effect, parameters: impl IntoIterator<Item = (&'a str, f64)>) -> Self {
        let mut parameters: BTreeMap<String, f64> =
            parameters.into_iter().map(|(name, value)| (name.to_owned(), value)).collect();
        let mut values = BTreeMap::new();
        for (key, names) in effect.groups() {
            if names.iter().all(|name| parameters.contains_key(*name)) {
                let list = names.iter().filter_map(|name| parameters.remove(*name)).collect();
                values.insert(key, EffectValue::Numbers(list));
            }
        }
        values.extend(parameters.into_iter().map(|(name, value)| (name, EffectValue::Number(value))));
        Self { id: effect.id.to_owned(), parameters: values }
    }
}

/// The value of a key of an effect.
#[derive(Debug, Clone, PartialEq, Deserialize, Serialize)]
#[serde(untagged)]
pub enum EffectValue {
    /// A parameter.
    Number(f64),
    /// Numbered parameters in their order.
    Numbers(Vec<f64>),
    /// Neither; refused where the experiment is checked, which knows key and line.
    Other(toml::Value),
}

/// `[material]`: a preset and what overrides it.
#[derive(Debug, Clone, Default, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields, default)]
pub struct MaterialConfig {
    /// Which published set of constants: parameter-2 matches the published deflection, parameter-4 the published resonance.
    pub preset: Option<String>,
    /// Length of one actuator (mm).
    pub actuator_length_mm: Option<f64>,
    /// Width (mm).
    pub width_mm: Option<f64>,
    /// Gravity, downwards (m/s²).
    pub gravity_m_s2: Option<f64>,
    /// Young's modulus of the piezo layer (GPa).
    pub piezo_modulus_gpa: Option<f64>,
    /// Poisson's ratio of the piezo layer.
    pub piezo_poisson: Option<f64>,
    /// Thickness of the piezo layer (µm).
    pub piezo_thickness_um: Option<f64>,
    /// Density of the piezo layer (g/cm³).
    pub piezo_density_g_cm3: Option<f64>,
    /// Piezoelectric charge constant d33 (pm/V).
    pub d33_pm_per_v: Option<f64>,
    /// Distance between neighbouring electrodes: field = voltage / pitch (mm).
    pub electrode_pitch_mm: Option<f64>,
    /// Young's modulus of the substrate (GPa).
    pub substrate_modulus_gpa: Option<f64>,
    /// Poisson's ratio of the substrate.
    pub substrate_poisson: Option<f64>,
    /// Thickness of the substrate (µm).
    pub substrate_thickness_um: Option<f64>,
    /// Density of the substrate (g/cm³).
    pub substrate_density_g_cm3: Option<f64>,
    /// Modulus of the adhesive, already that of plane strain (GPa).
    pub adhesive_modulus_gpa: Option<f64>,
    /// Thickness of the adhesive; 0 leaves two layers (µm).
    pub adhesive_thickness_um: Option<f64>,
    /// Density of the adhesive (g/cm³).
    pub adhesive_density_g_cm3: Option<f64>,
    /// Largest field: voltages above this times electrode_pitch_mm are refused (2000 V over 0.5 mm) (kV/mm).
    pub max_field_kv_mm: Option<f64>,
    /// Largest strain of the laminate's outer fibre by bending: above it a run warns, above twice it gives no measures.
    pub max_strain: Option<f64>,
}

/// `[robot]`.
#[derive(Debug, Clone, Default, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields, default)]
pub struct RobotConfig {
    /// Number of actuators N.
    pub actuators: Option<usize>,
    /// Joints per actuator m; the robot has N m joints, at most 10000, and N m + 1 links.
    pub motors_per_actuator: Option<usize>,
    /// Lying on a floor; left end held, no floor; or neither.
    pub mount: Option<String>,
    /// Damping of the joints as the reference's dampingEta; either this or damping_time_s.
    pub damping_eta: Option<f64>,
    /// Damping of the joints as the time η of the torque law: dampingEta = 2π η · 1 Hz (s).
    pub damping_time_s: Option<f64>,
    /// Thickness of the collision boxes; it sets contact and inertia (mm).
    pub collision_thickness_mm: Option<f64>,
    /// Factor on positive voltages before the torque law; 1.733 for the voltages applied to the published robot.
    pub positive_gain: Option<f64>,
    /// Coefficients of friction: [robot.friction].
    pub friction: FrictionConfig,
    /// Payloads: [[robot.mass]].
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub mass: Vec<MassConfig>,
}

/// One `[[robot.mass]]`: a payload fixed to a point of the sheet's centre line.
#[derive(Debug, Clone, Default, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct MassConfig {
    /// Distance from the left end along the sheet (mm).
    pub position_mm: f64,
    /// Mass (g).
    pub mass_g: f64,
}

/// `[robot.friction]`.
#[derive(Debug, Clone, Default, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields, default)]
pub struct FrictionConfig {
    /// Coefficient of the floor.
    pub ground: Option<f64>,
    /// Coefficient of the bare robot.
    pub low: Option<f64>,
    /// Coefficient of the films.
    pub high: Option<f64>,
    /// Where films are glued under the robot.
    pub film: Option<String>,
    /// Length of a film as a share of one actuator.
    pub film_fraction: Option<f64>,
}

/// `[drive]`: exactly one waveform with the keys that belong to it.
#[derive(Debug, Clone, Default, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields, default)]
pub struct DriveConfig {
    /// Gait: a named sequence of five actuators; dc: constant; sine: V = amplitude/2 (1 - cos 2πft); step: 0 V, then constant; sequence: phases of constant voltages; csv: a table, linear between rows.
    pub waveform: Option<String>,
    /// Name of the gait (with waveform gait).
    pub gait: Option<String>,
    /// Period; either this or frequency_hz (with waveform gait, sequence) (s).
    pub period_s: Option<f64>,
    /// Frequency (with waveform gait, sine, sequence) (Hz).
    pub frequency_hz: Option<f64>,
    /// Delay between the parts of gaits that take one; jumper-delay takes negative ones too (with waveform gait) (s).
    pub delay_s: Option<f64>,
    /// How long the voltage is on, for gaits that take it (with waveform gait) (s).
    pub on_time_s: Option<f64>,
    /// Voltage of each actuator when it is on; needed by sequences with masks for robots that have not 5 actuators (with waveform gait, sequence) (V).
    pub on_voltages_v: Option<Vec<f64>>,
    /// Voltage of each actuator (with waveform dc, step) (V).
    pub voltages_v: Option<Vec<f64>>,
    /// Largest voltage, the same for every actuator (with waveform sine) (V).
    pub amplitude_v: Option<f64>,
    /// Largest voltage of each actuator (with waveform sine) (V).
    pub amplitudes_v: Option<Vec<f64>>,
    /// When the step comes; on Bullet not before two time steps, as in the reference (with waveform step) (s).
    pub at_s: Option<f64>,
    /// The phases in order: phases = [{ until_s = 0.01, on = "01110" }, ...] (with waveform sequence).
    pub phases: Option<Vec<PhaseConfig>>,
    /// The table: t_s, v1_v, v2_v, ...; its ends are held (with waveform csv).
    pub file: Option<PathBuf>,
}

/// One phase of a sequence.
#[derive(Debug, Clone, Default, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields, default)]
pub struct PhaseConfig {
    /// End as a share of the period.
    pub until: Option<f64>,
    /// End as a time (s).
    pub until_s: Option<f64>,
    /// A mask of 0 and 1, one per actuator: those of 1 get their on_voltages_v, the others 0 V.
    pub on: Option<String>,
    /// Voltage of each actuator (with waveform dc, step) (V).
    pub voltages_v: Option<Vec<f64>>,
}

/// `[simulation]`.
///
/// `numerical_damping_per_s` (planar engine) is the weight of a step's end over that of its start, per time step: see
/// [`PlanarEngine::with_numerical_damping`](crate::engine::PlanarEngine::with_numerical_damping). `record_from_step` is the step of the first
/// regular record, the state before it: 0 records at whole multiples of the interval; absent, the records are those of the reference, one step earlier.
#[derive(Debug, Clone, Default, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields, default)]
pub struct SimulationConfig {
    /// Bullet: bit for bit the reference; planar: the fast one. In sweeps the default is planar.
    pub engine: Option<String>,
    /// Flat and at rest; or in equilibrium with gravity, floor and first voltages (planar engine).
    pub start: Option<String>,
    /// Coefficients of friction: [robot.friction].
    pub friction: Option<String>,
    /// Weight of a step's end over that of its start, per time step: damps oscillations between steps; less is more accurate without contact (with engine = "planar") (1/s).
    pub numerical_damping_per_s: Option<f64>,
    /// Bullet's limit on every velocity: cm/s of the base, rad/s of base and joints (with engine = "bullet").
    pub velocity_limit: Option<f64>,
    /// Angle of every joint at the beginning, from the left; the robot begins level at its left end and touches the floor with its lowest point (with start = "flat") (rad).
    pub joint_angles_rad: Option<Vec<f64>>,
    /// Time step; "auto": adaptive steps, with tolerances refined until the result changes by less than step_error (s).
    pub time_step_s: Option<StepConfig>,
    /// Relative change of the result that a ten times tighter tolerance may make (with time_step_s = "auto").
    pub step_error: Option<f64>,
    /// Name of the measure that sets the tolerance (with time_step_s = "auto").
    pub step_measure: Option<String>,
    /// Number of steps.
    pub steps: Option<u64>,
    /// Length of the run (s).
    pub duration_s: Option<f64>,
    /// Steps from one record to the next; the first and last step are always recorded.
    pub record_every_steps: Option<u64>,
    /// Time from one record to the next (s).
    pub record_every_s: Option<f64>,
    /// Step before which the first regular record is taken: 0 records at whole multiples of the interval.
    pub record_from_step: Option<u64>,
}

/// A time step: seconds, or the word `auto`.
#[derive(Debug, Clone, PartialEq, Deserialize, Serialize)]
#[serde(untagged, expecting = "time_step_s is a number of seconds or \"auto\"")]
pub enum StepConfig {
    /// A number of seconds.
    Seconds(f64),
    /// `auto`.
    Word(String),
}

/// The text of an experiment with the settings that override it: where every value came from.
#[derive(Debug, Clone)]
pub struct Source {
    /// Name for messages: the file, `-`, or a preset.
    pub name: String,
    /// Folder that relative paths start from.
    pub folder: PathBuf,
    text: String,
    settings: Vec<Setting>,
}

/// A key that overrides the text.
#[derive(Debug, Clone, PartialEq)]
pub struct Setting {
    /// The key, with dots.
    pub key: String,
    /// Its value, in TOML or as a bare word.
    pub value: String,
    /// Where it was given, for messages.
    pub place: String,
}

impl Setting {
    /// Reads `KEY=VALUE`, as given to `--set`.
    ///
    /// # Errors
    /// [`ConfigError::Syntax`] if there is no `=` or no key.
    pub fn parse(assignment: &str) -> Result<Self, ConfigError> {
        match assignment.split_once('=') {
            Some((key, value)) if !key.trim().is_empty() => {
                let (key, value) = (key.trim().to_owned(), value.trim().to_owned());
                Ok(Self { place: format!("--set {key}={value}"), key, value })
            }
            _ => Err(ConfigError::Syntax {
                source_name: format!("--set {assignment}"),
                message: "a setting is written KEY=VALUE, for example robot.damping_eta=0.03".into(),
            }),
        }
    }

    /// The value: TOML if it is that, a string otherwise.
    pub fn toml(&self) -> toml::Value {
        // `v = VALUE` is TOML if VALUE is; a bare word is taken as a string.
        toml::from_str::<Table>(&format!("v = {}", self.value))
            .ok()
            .filter(|table| table.len() == 1)
            .and_then(|mut table| table.remove("v"))
            .unwrap_or_else(|| toml::Value::String(self.value.clone()))
    }
}

impl Source {
    /// An experiment from its text.
    pub fn from_text(name: impl Into<String>, text: impl Into<String>) -> Self {
        Self { name: name.into(), folder: PathBuf::new(), text: text.into(), settings: Vec::new() }
    }

    /// An experiment from a file; its relative paths start from the file's folder.
    ///
    /// # Errors
    /// [`ConfigError::Unreadable`] if the file cannot be read as UTF-8 text.
    pub fn from_file(path: &Path) -> Result<Self, ConfigError> {
        let text = crate::files::read_text(path)
            .map_err(|error| ConfigError::Unreadable { path: path.into(), reason: error.to_string() })?;
        let folder = path.parent().map(PathBuf::from).unwrap_or_default();
        Ok(Self { folder, ..Self::from_text(path.display().to_string(), text) })
    }

    /// An experiment from a file, or a built-in one: `preset:NAME`, or `NAME` where there is no file of that name.
    ///
    /// # Errors
    /// [`ConfigError::Unreadable`] if there is neither.
    pub fn open(path: &Path) -> Result<Self, ConfigError> {
        let name = path.to_str().unwrap_or_default();
        let prefixed = name.strip_prefix("preset:");
        if prefixed.is_none() && path.exists() {
            return Self::from_file(path);
        }
        let preset = prefixed.unwrap_or(name);
        presets::text_of(preset).map(|text| Self::from_text(preset, text)).ok_or_else(|| {
            let file = if prefixed.is_some() { "" } else { "no such file, and " };
            ConfigError::Unreadable { path: path.into(), reason: format!("{file}{}", presets::unknown(preset)) }
        })
    }

    /// Adds a setting `KEY=VALUE`, with the value in TOML or as a bare word.
    ///
    /// # Errors
    /// [`ConfigError::Syntax`] if there is no `=` or no key.
    pub fn set(&mut self, assignment: &str) -> Result<(), ConfigError> {
        self.settings.push(Setting::parse(assignment)?);
        Ok(())
    }

    /// Adds a setting whose place is not `--set`.
    pub fn push(&mut self, setting: Setting) {
        self.settings.push(setting);
    }

    /// The text, without the settings.
    pub fn text(&self) -> &str {
        &self.text
    }

    /// The settings, in the order in which they are applied.
    pub fn settings(&self) -> &[Setting] {
        &self.settings
    }

    /// Parses the text, then applies the settings.
    ///
    /// # Errors
    /// [`ConfigError::Syntax`].
    pub fn parse(&self) -> Result<Config, ConfigError> {
        let syntax =
            |source_name: String, message: String| ConfigError::Syntax { source_name, message: message.trim_end().into() };
        let in_text = |error: toml::de::Error| syntax(self.name.clone(), words::toml_error(&error));
        if self.settings.is_empty() {
            return toml::from_str(&self.text).map_err(in_text);
        }
        let text: Table = toml::from_str(&self.text).map_err(in_text)?;
        let mut table = text.clone();
        for setting in &self.settings {
            assign(&mut table, &setting.key, setting.toml()).map_err(|message| syntax(setting.place.clone(), message))?;
        }
        table.try_into().map_err(|error: toml::de::Error| {
            // Once more, one by one, so that the message names the line or the setting at fault.
            if let Err(error) = toml::from_str::<Config>(&self.text) {
                return in_text(error);
            }
            let mut table = text;
            for setting in &self.settings {
                let assigned = assign(&mut table, &setting.key, setting.toml());
                if let Err(error) = assigned.and_then(|()| table.clone().try_into::<Config>().map_err(|e| words::toml_error(&e)))
                {
                    return syntax(setting.place.clone(), error);
                }
            }
            in_text(error)
        })
    }

    /// Puts the place that a key's value came from into an error about it.
    pub(super) fn locate(&self, error: ConfigError) -> ConfigError {
        let ConfigError::Value { key, message, .. } = error else { return error };
        let set = self.settings.iter().rev().find(|set| set.key == key);
        let place = match (set, line_of(&self.text, key.split('.'))) {
            (Some(set), _) => set.place.clone(),
            (None, Some(line)) => format!("{}, line {line}", self.name),
            (None, None) => self.name.clone(),
        };
        ConfigError::Value { place, key, message }
    }
}

/// Sets a dotted key in a table, making tables on the way.
fn assign(table: &mut Table, key: &str, value: toml::Value) -> Result<(), String> {
    match key.split_once('.') {
        None => {
            table.insert(key.to_owned(), value);
            Ok(())
        }
        Some((head, rest)) => match table.entry(head).or_insert_with(|| toml::Value::Table(Table::new())) {
            toml::Value::Table(inner) => assign(inner, rest, value),
            _ => Err(format!("{head} is not a table")),
        },
    }
}

/// Line (from 1) of the deepest part of a key that the text contains. A part that is a number is an index into an array.
pub(crate) fn line_of<'a>(text: &str, key: impl IntoIterator<Item = &'a str>) -> Option<usize> {
    let parsed = DeTable::parse(text).ok()?;
    let (mut at, mut found): (Option<&DeValue>, _) = (None, None);
    for part in key {
        let table = match at {
            None => Some(parsed.get_ref()),
            Some(DeValue::Table(table)) => Some(table),
            Some(DeValue::Array(array)) => {
                let Some(item) = part.parse().ok().and_then(|index: usize| array.get(index)) else { break };
                (found, at) = (Some(item.span().start), Some(item.get_ref()));
                continue;
            }
            Some(_) => None,
        };
        let next = table.and_then(|table| table.iter().find(|(name, _)| name.get_ref().as_ref() == part));
        let Some((name, value)) = next else { break };
        (found, at) = (Some(name.span().start), Some(value.get_ref()));
    }
    found.map(|offset| text[..offset].matches('\n').count() + 1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const TEXT: &str = "[robot]\nactuators = 5\n\n[robot.friction]\nlow = 0.2\n";

    #[test]
    fn an_unknown_key_and_a_wrong_type_are_shown_with_their_line() {
        for (text, line, word) in
            [("[robot]\nlegs = 4\n", "line 2", "legs"), ("\n[robot]\nactuators = \"x\"\n", "line 3", "actuators")]
        {
            let error = Source::from_text("a.toml", text).parse().unwrap_err().to_string();
            assert!(error.contains("a.toml") && error.contains(line) && error.contains(word), "{error}");
        }
    }

    #[test]
    fn settings_override_the_text_and_are_named_when_they_are_wrong() {
        let mut source = Source::from_text("a.toml", TEXT);
        source.set("robot.actuators=3").unwrap();
        source.set("robot.mount = clamped").unwrap();
        source.set("drive.voltages_v=[1, 2.5]").unwrap();
        let config = source.parse().unwrap();
        assert_eq!(config.robot.actuators, Some(3));
        assert_eq!(config.robot.mount.as_deref(), Some("clamped"));
        assert_eq!(config.drive.voltages_v, Some(vec![1.0, 2.5]));
        source.set("robot.legs=4").unwrap();
        let error = source.parse().unwrap_err().to_string();
        assert!(error.contains("--set robot.legs=4"), "{error}");
        assert!(source.set("nonsense").is_err());
    }

    #[test]
    fn a_fault_is_placed_at_the_key_or_else_at_its_table() {
        let source = Source::from_text("a.toml", TEXT);
        let place = |key: &str| source.locate(Fault::new(key, "wrong").into()).to_string();
        assert_eq!(place("robot.friction.low"), "a.toml, line 5: robot.friction.low: wrong");
        assert_eq!(place("robot.actuators"), "a.toml, line 2: robot.actuators: wrong");
        assert_eq!(place("robot.mount"), "a.toml, line 1: robot.mount: wrong");
        assert_eq!(place("drive.waveform"), "a.toml: drive.waveform: wrong");
    }

    proptest! {
        #[test]
        fn any_text_and_any_setting_is_a_config_or_an_error_but_never_a_panic(text in ".{0,200}", setting in ".{0,40}") {
            let mut source = Source::from_text("fuzz", text);
            let _ = source.parse();
            if source.set(&setting).is_ok() {
                let _ = source.parse();
            }
        }
    }
}
