//! The built-in experiments.

/// A built-in experiment.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Preset {
    /// Name on the command line.
    pub name: &'static str,
    /// The experiment file; its first comment says what it is.
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
    ($($name:literal)*) => {
        /// All of them, by name.
        pub static PRESETS: &[Preset] = &[$(Preset { name: $name, text: include_str!(concat!("presets/", $name, ".toml")) },)*];
    };
}

presets! {
    "cantilever-ac"
    "cantilever-dc"
    "cantilever-step"
    "crawl"
    "frog-v2"
    "full-frictional-inchworm"
    "full-inchworm"
    "inchworm"
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
    "static-shape"
}

/// Finds a preset by its name.
pub fn find(name: &str) -> Option<&'static Preset> {
    PRESETS.iter().find(|preset| preset.name == name)
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
    fn every_gait_has_a_preset() {
        for gait in &crate::drive::gait::GAITS {
            let key = format!("gait = \"{}\"", gait.name);
            assert!(PRESETS.iter().any(|preset| preset.text.contains(&key)), "{}", gait.name);
        }
    }
}
