//! The built-in experiments and sweeps, and the reference's classes that they stand for.

use toml::Table;

use crate::words::did_you_mean;

/// A built-in experiment or sweep.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Preset {
    /// Name on the command line.
    pub name: &'static str,
    /// The file; its first comment says what it is.
    pub text: &'static str,
}

impl Preset {
    /// What it is: the comment at the top of the file, in one line.
    pub fn summary(&self) -> String {
        let comment = self.text.lines().map_while(|line| line.strip_prefix("# "));
        comment.collect::<Vec<_>>().join(" ")
    }
}

macro_rules! presets {
    ($list:ident $folder:literal $($name:literal)*) => {
        /// All of them, by name.
        pub static $list: &[Preset] = &[$(Preset { name: $name, text: include_str!(concat!("presets/", $folder, $name, ".toml")) },)*];
    };
}

presets! {
    PRESETS ""
    "cantilever-ac"
    "cantilever-dc"
    "cantilever-step"
    "crawl"
    "frog-v2"
    "full-frictional-inchworm"
    "full-inchworm"
    "inchworm"
    "inchworm-1hz"
    "inchworm-backward"
    "inchworm-reversed"
    "jump-14hz"
    "jump-on-time"
    "jumper"
    "jumper-delay"
    "jumper-pulse"
    "mover"
    "mover-delay"
    "mover-three-phase"
    "published-speeds"
    "static-shape"
}

presets! {
    DATASETS "datasets/"
    "published-cantilever"
    "published-robot"
}

presets! {
    SWEEPS "sweeps/"
    "cantilever-frequency-scan"
    "cantilever-voltage-scan"
    "crawl-period-scan"
    "frog-v2-period-damping-friction-scan"
    "frog-v2-period-scan"
    "full-frictional-inchworm-period-damping-friction-scan"
    "full-frictional-inchworm-period-scan"
    "full-inchworm-period-scan"
    "inchworm-backward-period-scan"
    "inchworm-period-scan"
    "inchworm-reversed-period-scan"
    "inchworm-voltage-scan"
    "jump-frequency-scan"
    "jump-on-time-scan"
    "jumper-delay-length-scan"
    "jumper-delay-scan"
    "jumper-length-scan"
    "mover-delay-scan"
    "published-speeds-scan"
    "speed-frequency-scan"
}

/// A class of the reference.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Class {
    /// Its name there.
    pub name: &'static str,
    /// The preset that does the same.
    pub preset: &'static str,
    /// The class's own settings where the preset has others: keys and values.
    pub settings: &'static [&'static [(&'static str, f64)]],
    /// The sweep that is its scan, for classes that have one.
    pub sweep: Option<&'static str>,
}

/// What all of the reference's robots have where our presets have finer chains and the notebooks' damping.
const ROBOT: &[(&str, f64)] =
    &[("robot.motors_per_actuator", 1.0), ("robot.damping_eta", 0.008), ("simulation.time_step_s", 8.333333333333334e-6)];
/// Friction of classes whose constructor sets it (back) to that of the plain inchworm.
const PLAIN: &[(&str, f64)] = &[("robot.friction.low", 2.5), ("robot.friction.high", 2.5)];
/// The cantilever's own settings.
const CANTILEVER: &[(&str, f64)] = &[("robot.motors_per_actuator", 5.0), ("simulation.time_step_s", 8.333333333333334e-8)];
/// Those of its voltage scan.
const CANTILEVER_DC: &[(&str, f64)] = &[("simulation.time_step_s", 8.333333333333334e-8)];

macro_rules! classes {
    ($($name:literal $preset:literal $settings:tt $sweep:expr;)*) => {
        /// The reference's 24 experiment classes.
        pub static CLASSES: &[Class] = &[$(Class { name: $name, preset: $preset, settings: &$settings, sweep: $sweep },)*];
    };
}

classes! {
    "SingleActuatorCantilever" "cantilever-ac" [CANTILEVER] None;
    "SingleActuatorCantileverDCResponseVoltageScan" "cantilever-dc" [CANTILEVER_DC] Some("cantilever-voltage-scan");
    "SingleActuatorCantileverACResponse" "cantilever-ac" [CANTILEVER] Some("cantilever-frequency-scan");
    "Inchworm" "inchworm" [ROBOT] None;
    "InchwormBackward" "inchworm-backward" [ROBOT] None;
    "FullFrictionalInchworm" "full-frictional-inchworm" [ROBOT] None;
    "FrictionalFrogMotionV2" "frog-v2" [ROBOT] None;
    "InchwormCrawl" "crawl" [ROBOT] None;
    "InchwormPeriodScan" "inchworm" [ROBOT] Some("inchworm-period-scan");
    "InchwormDCResponseVoltageScan" "static-shape" [ROBOT] Some("inchworm-voltage-scan");
    "InchwormCrawlPeriodScan" "crawl" [ROBOT] Some("crawl-period-scan");
    "InchwormReversedPeriodScan" "inchworm-reversed" [ROBOT] Some("inchworm-reversed-period-scan");
    "InchwormBackwardPeriodScan" "inchworm-backward" [ROBOT] Some("inchworm-backward-period-scan");
    "FullInchwormPeriodScan" "full-inchworm" [ROBOT] Some("full-inchworm-period-scan");
    "FullFrictionalInchwormPeriodScan" "full-frictional-inchworm" [ROBOT] Some("full-frictional-inchworm-period-scan");
    "FrictionalFrogMotionV2PeriodScan" "frog-v2" [ROBOT, PLAIN] Some("frog-v2-period-scan");
    "FullFrictionalInchwormPeriodDampingFrictionScan" "full-frictional-inchworm" [ROBOT]
        Some("full-frictional-inchworm-period-damping-friction-scan");
    "FrictionalFrogMotionV2PeriodDampingFrictionScan" "frog-v2" [ROBOT] Some("frog-v2-period-damping-friction-scan");
    "EfficientJumper" "jumper" [ROBOT] None;
    "EfficientJumperDelayScan" "jumper-delay" [ROBOT, PLAIN] Some("jumper-delay-scan");
    "EfficientJumperActuatorLengthScan" "jumper-pulse" [ROBOT] Some("jumper-length-scan");
    "EfficientJumperDelayActuatorLengthScan" "jumper-pulse" [ROBOT] Some("jumper-delay-length-scan");
    "EfficientMover" "mover" [ROBOT] None;
    "EfficientMoverDelayScan" "mover-delay" [ROBOT, PLAIN] Some("mover-delay-scan");
}

/// Finds a preset by its name.
pub fn find(name: &str) -> Option<&'static Preset> {
    PRESETS.iter().find(|preset| preset.name == name)
}

/// The text of the built-in experiment of that name, or of the reference's class.
pub fn text_of(name: &str) -> Option<String> {
    find_class(name).map(Class::text).or_else(|| find(name).map(|preset| preset.text.to_owned()))
}

/// The built-in data set of that name: measured numbers for `sfers diagnose`.
pub fn find_dataset(name: &str) -> Option<&'static Preset> {
    DATASETS.iter().find(|preset| preset.name == name)
}

/// Finds a sweep by its name, or by the reference's class whose scan it is.
pub fn find_sweep(name: &str) -> Option<&'static Preset> {
    let name = find_class(name).and_then(|class| class.sweep).unwrap_or(name);
    SWEEPS.iter().find(|preset| preset.name == name)
}

/// Finds a class of the reference by its name.
pub fn find_class(name: &str) -> Option<&'static Class> {
    CLASSES.iter().find(|class| class.name == name)
}

/// The message that there is no preset of that name.
pub(crate) fn unknown(name: &str) -> String {
    let lists = [PRESETS, SWEEPS, DATASETS];
    let known = lists.into_iter().flatten().map(|preset| preset.name).chain(CLASSES.iter().map(|class| class.name));
    format!("there is no preset {name:?}{}; `sfers presets` lists them", did_you_mean(name, known))
}

impl Class {
    /// The experiment file of the class with its own settings: as the reference runs it, for as long as our preset does.
    pub fn text(&self) -> String {
        let mut table: Table = find(self.preset).and_then(|preset| preset.text.parse().ok()).unwrap_or_default();
        for (key, value) in self.settings.iter().copied().flatten() {
            let (tables, key) = key.rsplit_once('.').unwrap_or(("", key));
            let inner = tables.split('.').fold(&mut table, |at, name| {
                let value = at.entry(name).or_insert_with(|| Table::new().into());
                value.as_table_mut().expect("presets have tables where settings need them")
            });
            let whole = key.ends_with("actuator");
            inner.insert(key.into(), if whole { toml::Value::Integer(*value as i64) } else { toml::Value::Float(*value) });
        }
        format!("# The reference's class {} with its own settings.\n{table}", self.name)
    }
}

#[cfg(test)]
mod tests {
    use super::super::{Source, experiment};
    use super::*;

    #[test]
    fn every_preset_is_a_valid_experiment_with_a_summary_and_a_stable_step() {
        for preset in PRESETS {
            let experiment = experiment(&Source::from_text(preset.name, preset.text)).unwrap();
            assert!(!preset.summary().is_empty(), "{}", preset.name);
            assert!(experiment.time_step < crate::analytic::stable_step(&experiment.robot), "{}", preset.name);
        }
    }

    #[test]
    fn every_class_of_the_reference_has_an_experiment_with_its_settings_and_every_scan_a_sweep() {
        assert_eq!(CLASSES.len(), 24);
        for class in CLASSES {
            let experiment = experiment(&Source::from_text(class.name, class.text())).unwrap();
            if class.settings.contains(&ROBOT) {
                assert_eq!(experiment.robot.motors_per_actuator, 1, "{}", class.name);
                assert_eq!(experiment.time_step, 2e-3 / 240.0, "{}", class.name);
            }
            assert_eq!(
                class.name.contains("Scan") || class.name.ends_with("ACResponse"),
                class.sweep.is_some(),
                "{}",
                class.name
            );
            if let Some(sweep) = class.sweep {
                let text = find_sweep(sweep).unwrap().text;
                assert!(text.contains(&format!("preset:{}", class.preset)) && text.contains(class.name), "{sweep}");
            }
        }
    }

    #[test]
    fn every_sweep_is_valid_and_has_as_many_points_as_the_reference() {
        let points = |name: &str| crate::sweep::Sweep::open(format!("preset:{name}").as_ref(), &[]).unwrap().len();
        for sweep in SWEEPS {
            assert!(points(sweep.name) > 2 && !sweep.summary().is_empty(), "{}", sweep.name);
        }
        assert_eq!(points("FullFrictionalInchwormPeriodDampingFrictionScan"), 2080);
        assert_eq!(points("EfficientJumperDelayActuatorLengthScan"), 248);
        assert_eq!(points("SingleActuatorCantileverACResponse"), 120);
    }

    #[test]
    fn every_gait_has_a_preset() {
        for gait in &crate::drive::gait::GAITS {
            let key = format!("gait = \"{}\"", gait.name);
            assert!(PRESETS.iter().any(|preset| preset.text.contains(&key)), "{}", gait.name);
        }
    }
}
