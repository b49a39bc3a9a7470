//! Every statement of the tables is compared with the program.

use std::collections::BTreeSet;
use std::path::Path;

use super::{Default, Key, Range, Section, Value, dataset, experiment, markdown, sweep};
use crate::diagnose::dataset::Description;
use crate::drive::gait::GAITS;
use crate::experiment::{
    Config, ConfigError, DriveConfig, EffectConfig, EnsembleConfig, Experiment, FrictionConfig, MassConfig, MaterialConfig,
    PerturbationConfig, PhaseConfig, RobotConfig, SimulationConfig, Source,
};
use crate::sweep::Sweep;

/// The keys that serde accepts for a type, from its message about an unknown one.
fn accepted<T: serde::de::DeserializeOwned>(needed: &str) -> BTreeSet<String> {
    let error = toml::from_str::<T>(&format!("{needed}\nno-such-key = 1")).err().unwrap();
    let message = error.message();
    assert!(message.starts_with("unknown field `no-such-key`, expected "), "{message}");
    message.split('`').skip(3).step_by(2).map(str::to_owned).collect()
}

fn listed(section: &Section) -> BTreeSet<String> {
    section.keys.iter().map(|key| key.name.to_owned()).collect()
}

#[test]
fn the_tables_have_the_keys_that_the_parser_accepts_and_no_others() {
    assert_eq!(
        accepted::<Config>(""),
        ["material", "robot", "drive", "simulation", "effect", "ensemble"].map(String::from).into()
    );
    assert_eq!(listed(&experiment::MATERIAL), accepted::<MaterialConfig>(""));
    assert_eq!(listed(&experiment::ROBOT), accepted::<RobotConfig>(""));
    assert_eq!(listed(&experiment::FRICTION), accepted::<FrictionConfig>(""));
    assert_eq!(listed(&experiment::MASS), accepted::<MassConfig>("position_mm = 1\nmass_g = 1"));
    assert_eq!(listed(&experiment::ENSEMBLE), accepted::<EnsembleConfig>("members = 2\nvary = {}"));
    assert_eq!(listed(&experiment::PERTURBATION), accepted::<PerturbationConfig>(""));
    assert_eq!(listed(&experiment::DRIVE), accepted::<DriveConfig>(""));
    assert_eq!(listed(&experiment::PHASES), accepted::<PhaseConfig>(""));
    assert_eq!(listed(&experiment::SIMULATION), accepted::<SimulationConfig>(""));
    // Its other keys are numbers of any name, the effects' parameters.
    let other: EffectConfig = toml::from_str("id = \"x\"\nany = 1.0").unwrap();
    assert_eq!((listed(&experiment::EFFECT), other.parameters.len()), (["id".to_owned()].into(), 1));

    assert_eq!(listed(&sweep::TOP), accepted::<crate::sweep::File>(""));
    assert_eq!(listed(&sweep::RANGE), accepted::<crate::sweep::Range>(""));

    let tables = [
        "dataset",
        "material",
        "robot",
        "markers",
        "noise",
        "bench",
        "camera",
        "columns",
        "effect",
        "run",
        "frequency_response",
        "steady",
        "observation",
        "identify",
    ];
    assert_eq!(accepted::<Description>(""), tables.map(String::from).into());
    let sections: BTreeSet<_> = super::FILES[2].sections.iter().map(|section| section.name).collect();
    assert_eq!(
        sections,
        tables.into_iter().chain(["robot.friction", "robot.mass", "run.release", "identify.vary.KEY"]).collect()
    );
    assert_eq!(listed(&dataset::DATASET), accepted::<crate::diagnose::dataset::About>(""));
    assert_eq!(listed(&dataset::BENCH), accepted::<crate::diagnose::dataset::Bench>(""));
    assert_eq!(listed(&dataset::RUN), accepted::<crate::diagnose::dataset::RunEntry>(""));
    assert_eq!(listed(&dataset::RELEASE), accepted::<crate::diagnose::dataset::Release>(""));
    assert_eq!(listed(&dataset::COLUMNS), accepted::<crate::diagnose::dataset::Column>(""));
    assert_eq!(listed(&dataset::CAMERA), accepted::<crate::diagnose::dataset::Camera>(""));
    assert_eq!(listed(&dataset::FREQUENCY_RESPONSE), accepted::<crate::diagnose::dataset::ResponseEntry>(""));
    assert_eq!(listed(&dataset::IDENTIFY), accepted::<crate::diagnose::identify::Identify>("vary = {}"));
    assert_eq!(listed(&dataset::SEARCHED), accepted::<crate::diagnose::identify::Searched>(""));
    assert_eq!(listed(&dataset::OBSERVATION), accepted::<crate::diagnose::dataset::Observation>(""));
}

/// Experiments in which every key is allowed in one: the waveforms, the gaits with their numbers, and both engines.
fn bases() -> Vec<(String, String)> {
    let simulation = "[simulation]\ntime_step_s = 1e-5\nduration_s = 0.01\n";
    let planar = "[simulation]\nengine = \"planar\"\ntime_step_s = 1e-5\nduration_s = 0.01\n";
    let mut bases = Vec::new();
    for (name, keys) in [
        // Voltages that any field above 0 bears in the tests of ranges.
        ("dc", "voltages_v = [0.1, 0.2, 0.3, 0.4, 0.5]"),
        ("sine", "amplitude_v = 5\nfrequency_hz = 2"),
        ("step", "voltages_v = [1, 2, 3, 4, 5]"),
        ("sequence", "period_s = 1\nphases = [{ until = 0.5, on = \"00000\" }, { on = \"01110\" }]"),
    ] {
        bases.push((name.to_owned(), format!("[drive]\nwaveform = \"{name}\"\n{keys}\n{simulation}")));
    }
    for gait in &GAITS {
        let key = gait.parameter.key();
        let number = if key.starts_with('(') { String::new() } else { format!("{key} = 0.1") };
        bases
            .push(("gait".to_owned(), format!("[drive]\nwaveform = \"gait\"\ngait = \"{}\"\n{number}\n{simulation}", gait.name)));
    }
    bases.push(("planar".to_owned(), format!("[drive]\nwaveform = \"dc\"\nvoltages_v = [1, 2, 3, 4, 5]\n{planar}")));
    bases
}

/// The experiment of a base with a setting, without the key that contradicts it.
fn with(base: &str, key: &str, value: &str) -> Result<Experiment, ConfigError> {
    let rival = match key {
        "drive.frequency_hz" => "period_s",
        "drive.period_s" => "frequency_hz",
        "drive.amplitudes_v" => "amplitude_v",
        "simulation.steps" => "duration_s",
        _ => "",
    };
    let keep = |line: &&str| rival.is_empty() || !line.starts_with(&format!("{rival} ="));
    let mut source = Source::from_text("base", base.lines().filter(keep).collect::<Vec<_>>().join("\n"));
    if key.starts_with("simulation.step_") {
        source.set("simulation.time_step_s=auto").unwrap();
    }
    source.set(&format!("{key}={value}")).unwrap();
    crate::experiment::experiment(&source)
}

fn same(a: &Experiment, b: &Experiment) -> bool {
    let spec = |e: &Experiment| serde_json::to_value(e.spec()).unwrap();
    spec(a) == spec(b)
}

/// Tables of experiment files with a fixed path.
const PLACED: [&Section; 5] =
    [&experiment::MATERIAL, &experiment::ROBOT, &experiment::FRICTION, &experiment::DRIVE, &experiment::SIMULATION];

fn placed() -> impl Iterator<Item = (String, &'static Key)> {
    PLACED.into_iter().flat_map(|section| section.keys.iter().map(|key| (section.dotted(key), key)))
}

#[test]
fn the_defaults_stated_are_the_programs() {
    let mut tried = 0;
    for (name, key) in placed() {
        match key.default {
            Default::Is(value) => {
                // Every base that takes the key at all must not change by being given its default.
                if name == "simulation.step_error" {
                    assert_eq!(value.parse(), Ok(crate::experiment::DEFAULT_STEP_ERROR));
                    continue;
                }
                let mut changed_nothing = 0;
                let silent = |base: &String| !base.lines().any(|line| line.starts_with(&format!("{} =", key.name)));
                for base in bases().into_iter().map(|(_, base)| base).filter(silent) {
                    let Ok(plain) = crate::experiment::experiment(&Source::from_text("base", base.as_str())) else {
                        panic!("{base}")
                    };
                    if let Ok(given) = with(&base, &name, value) {
                        assert!(same(&plain, &given), "{name} = {value} is not the default");
                        changed_nothing += 1;
                    }
                }
                assert!(changed_nothing > 0, "{name} = {value} is accepted nowhere");
                tried += 1;
            }
            Default::OfPreset(two, four) => {
                for (preset, value) in [("parameter-2", two), ("parameter-4", four)] {
                    let base = format!("[material]\npreset = \"{preset}\"\n{}", bases()[0].1);
                    let plain = serde_json::to_string(
                        &crate::experiment::experiment(&Source::from_text("base", base.as_str())).unwrap().spec(),
                    )
                    .unwrap();
                    let given = serde_json::to_string(&with(&base, &name, value).unwrap().spec()).unwrap();
                    // The constants are written in CGS units, so the last digit may differ.
                    let numbers = |text: &str| {
                        text.split(|c: char| !"0123456789.eE+-".contains(c))
                            .filter_map(|n| n.parse::<f64>().ok())
                            .collect::<Vec<_>>()
                    };
                    let (plain, given) = (numbers(&plain), numbers(&given));
                    let near = |(a, b): (&f64, &f64)| (a - b).abs() <= 1e-12 * a.abs();
                    assert!(
                        plain.len() == given.len() && plain.iter().zip(&given).all(near),
                        "{name} of {preset} is not {value}"
                    );
                    // The comparison sees the key.
                    let other = serde_json::to_string(&with(&base, &name, "0.4321").unwrap().spec()).unwrap();
                    assert!(!plain.iter().zip(&numbers(&other)).all(near), "{name} does nothing");
                }
                tried += 1;
            }
            _ => {}
        }
    }
    assert!(tried > 30, "{tried}");
}

#[test]
fn a_needed_key_that_is_absent_is_named() {
    let mut tried = BTreeSet::new();
    for (waveform, base) in bases().iter().filter(|(name, _)| name != "planar") {
        for (name, key) in placed().filter(|(name, _)| name.starts_with("drive.")) {
            let without: Vec<_> = base.lines().filter(|line| !line.starts_with(&format!("{} =", key.name))).collect();
            let without = without.join("\n");
            if without.len() + 1 >= base.len() || without == base.trim_end() {
                continue;
            }
            let result = crate::experiment::experiment(&Source::from_text("base", without));
            if key.default == Default::Needed {
                let error = result.unwrap_err().to_string();
                assert!(error.contains(&name) && error.contains("is missing"), "{waveform}: {error}");
                tried.insert(key.name);
            }
        }
    }
    assert!(["waveform", "gait", "voltages_v", "phases"].iter().all(|key| tried.contains(key)), "{tried:?}");
}

#[test]
fn the_choices_listed_are_those_accepted() {
    let mut tried = 0;
    for (name, key) in placed() {
        let choices = key.value.choices();
        if choices.is_empty() {
            continue;
        }
        // A base that gets as far as the word.
        let refusal =
            |base: &str| with(base, &name, "\"no-such-word\"").err().map_or_else(String::new, |error| error.to_string());
        let (_, base) = bases()
            .into_iter()
            .find(|(_, base)| refusal(base).contains("no-such-word\" is"))
            .unwrap_or_else(|| panic!("{name} takes any word"));
        let refused = refusal(&base);
        let said = refused.rsplit_once("is not one of ").unwrap_or_else(|| panic!("{refused}")).1;
        assert_eq!(said.split(", ").collect::<Vec<_>>(), choices, "{name}");
        for choice in choices {
            if let Err(error) = with(&base, &name, &format!("\"{choice}\"")) {
                assert!(!error.to_string().contains("is not one of"), "{error}");
            }
        }
        tried += 1;
    }
    assert!(tried >= 9, "{tried}");
}

#[test]
fn the_ranges_stated_are_those_that_the_program_keeps_to() {
    // Inside and outside of each range; a value inside may still be refused in combination with others.
    let numbers = |range: Range| -> (Vec<f64>, Vec<f64>) {
        match range {
            Range::Any => (vec![0.0, 3.0, -3.0], vec![]),
            Range::Positive => (vec![0.003], vec![0.0, -1.0]),
            Range::NotNegative => (vec![0.0, 0.3], vec![-1e-9, -1.0]),
            Range::Between(low, high) => (vec![low, high], vec![low - 1e-6, high + 1e-6]),
            Range::Inside(low, high) => (vec![low + 1e-6, high - 1e-6], vec![low, high]),
        }
    };
    for (name, key) in placed() {
        let (inside, mut outside, whole) = match key.value {
            Value::Number(range) => (numbers(range).0, numbers(range).1, false),
            Value::Whole(Range::Between(low, high)) => (vec![low], vec![low - 1.0, high + 1.0], true),
            Value::Whole(_) => (vec![1.0], vec![0.0], true),
            _ => continue,
        };
        if !whole {
            outside.push(f64::NAN);
            // Of a limit it is none.
            if !["max_field_kv_mm", "max_strain"].contains(&key.name) {
                outside.push(f64::INFINITY);
            }
        }
        let text = |value: f64| if whole { format!("{value:.0}") } else { format!("{value:?}").replace("NaN", "nan") };
        // The bases that know the key: those that take a value inside.
        let mut known = 0;
        for (_, base) in bases() {
            let takes = |value: &f64| with(&base, &name, &text(*value)).is_ok();
            if !inside.iter().any(takes) {
                continue;
            }
            known += 1;
            let negative_delay = key.name == "delay_s";
            for value in inside.iter().filter(|value| !(negative_delay && **value < 0.0)) {
                assert!(takes(value), "{name} = {value} is refused");
            }
            for value in &outside {
                let error = with(&base, &name, &text(*value)).err().unwrap_or_else(|| panic!("{name} = {value} is accepted"));
                assert!(error.to_string().contains(key.name), "{name} = {value}: {error}");
            }
        }
        assert!(known > 0, "{name} is accepted nowhere");
    }
}

#[test]
fn what_a_key_goes_with_is_what_the_program_lets_it_go_with() {
    for (name, key) in placed() {
        let value = match key.value {
            Value::Numbers => "[1, 2, 3, 4, 5]".to_owned(),
            Value::Name("measure", _) => "\"speed_mm_s\"".into(),
            Value::Name("gait", _) => "\"crawl\"".into(),
            Value::Word(words) => format!("{:?}", words[0]),
            Value::Path => "\"none.csv\"".into(),
            Value::Other("a list of tables") => "[{ on = \"01110\" }]".into(),
            Value::Other(_) => continue,
            _ => "0.1".into(),
        };
        if name.starts_with("drive.") {
            let mut takes = Vec::new();
            for (waveform, base) in bases().iter().filter(|(waveform, _)| waveform != "planar") {
                let refused = with(base, &name, &value).err().map_or_else(String::new, |error| error.to_string());
                if !refused.contains("does not belong to") && !takes.contains(waveform) {
                    takes.push(waveform.clone());
                }
            }
            if key.name == "file" {
                assert_eq!((takes.len(), key.with), (0, "waveform csv"));
                continue;
            }
            let stated: Vec<_> = key.with.strip_prefix("waveform ").unwrap_or_default().split(", ").collect();
            takes.sort();
            if key.name == "waveform" {
                assert_eq!(key.with, "");
            } else {
                assert_eq!(takes, stated.iter().copied().collect::<BTreeSet<_>>().into_iter().collect::<Vec<_>>(), "{name}");
            }
        } else if name.starts_with("simulation.") {
            let (bullet, planar) = (bases().remove(0).1, bases().pop().unwrap().1);
            let other = if key.with.contains("bullet") { planar } else { bullet };
            let mut source = Source::from_text("base", other);
            source.set(&format!("{name}={value}")).unwrap();
            let refused = crate::experiment::experiment(&source).err().map_or_else(String::new, |error| error.to_string());
            assert_eq!(refused.contains("belongs to"), !key.with.is_empty(), "{name}: {refused}");
            assert!(key.with.is_empty() || refused.contains(key.with), "{name}: {refused}");
        } else {
            assert_eq!(key.with, "", "{name}");
        }
    }
}

#[test]
fn the_keys_of_sweeps_and_datasets_that_are_needed_are_missed() {
    let text = [("experiment", "\"preset:crawl\""), ("measures", "[\"speed_mm_s\"]")];
    for (left_out, _) in text {
        let some: String =
            text.iter().filter(|(key, _)| *key != left_out).map(|(key, value)| format!("{key} = {value}\n")).collect();
        let error = Sweep::from_text("s", &format!("{some}[vary]\n\"robot.damping_eta\" = [1]"), Path::new("")).unwrap_err();
        assert!(error.to_string().contains(&format!("the key {left_out} is missing")), "{error}");
    }
    let refuses = |sections: &[&Section], entry: &str, parse: &dyn Fn(&str) -> bool| {
        for key in sections.iter().flat_map(|section| section.keys) {
            let without: Vec<_> = entry.lines().filter(|line| !line.starts_with(&format!("{} =", key.name))).collect();
            assert_eq!(parse(&without.join("\n")), key.default != Default::Needed, "{}", key.name);
        }
    };
    refuses(&[&sweep::RANGE], "from = 1\nto = 2\ncount = 3", &|text| toml::from_str::<crate::sweep::Range>(text).is_ok());
    refuses(&[&dataset::RUN], "id = \"a\"\nfile = \"b\"", &|text| {
        toml::from_str::<crate::diagnose::dataset::RunEntry>(text).is_ok()
    });
    let observation = "measure = \"speed_mm_s\"\nvalue = 1\nsigma = 1\ndrive = {}";
    refuses(&[&dataset::OBSERVATION], observation, &|text| toml::from_str::<crate::diagnose::dataset::Observation>(text).is_ok());
    let response = "id = \"a\"\nfile = \"b\"\ncoordinate = \"tip_z\"\namplitude_v = 1\nsigma_mm = 1";
    refuses(&[&dataset::FREQUENCY_RESPONSE], response, &|text| {
        toml::from_str::<crate::diagnose::dataset::ResponseEntry>(text).is_ok()
    });
    refuses(&[&dataset::STEADY], "voltages_v = [1]\ntip_z_mm = 1", &|text| {
        toml::from_str::<crate::diagnose::dataset::Steady>(text).is_ok()
    });
    refuses(&[&dataset::COLUMNS], "from = \"t\"", &|text| toml::from_str::<crate::diagnose::dataset::Column>(text).is_ok());
    refuses(&[&dataset::DATASET], "name = \"a\"", &|text| toml::from_str::<crate::diagnose::dataset::About>(text).is_ok());
}

#[test]
fn units_stand_in_the_names_and_nothing_breaks_the_tables_of_markdown() {
    for (name, unit) in [
        ("width_mm", "mm"),
        ("gravity_m_s2", "m/s²"),
        ("max_field_kv_mm", "kV/mm"),
        ("delay_s", "s"),
        ("speed_mm_s", "mm/s"),
        ("steps", ""),
        ("damping_eta", ""),
    ] {
        assert_eq!(super::unit(name), unit, "{name}");
    }
    for line in markdown().lines().filter(|line| line.starts_with("| ")) {
        assert_eq!(line.matches('|').count(), 7, "{line}");
    }
}
