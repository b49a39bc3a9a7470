//! Help, manual pages, and the words of messages, as a user meets them.

mod common;

use std::fs;
use std::path::Path;

/// Standard output of a command that succeeds.
fn out(arguments: &[&str]) -> String {
    let output = common::sfers(Path::new("."), arguments);
    assert!(output.status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).unwrap()
}

/// The message of a command that ends with a code, beside an experiment `a.toml` and other files.
fn refused(files: &[(&str, &str)], arguments: &[&str], code: i32) -> String {
    let folder = tempfile::tempdir().unwrap();
    for (name, text) in files {
        fs::write(folder.path().join(name), text).unwrap();
    }
    let output = common::sfers(folder.path(), arguments);
    let text = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(code), "{arguments:?}: {text}");
    text
}

const EXPERIMENT: &str = "[robot]\nactuators = 1\nmount = \"clamped\"\n\
    [drive]\nwaveform = \"dc\"\nvoltages_v = [-1000]\n[simulation]\ntime_step_s = 1e-5\nsteps = 2\n";

#[test]
fn the_documents_of_keys_and_measures_are_those_that_the_program_prints() {
    for topic in ["keys", "measures"] {
        let name = format!("docs/{topic}.md");
        let document = fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join(&name)).unwrap();
        let printed = out(&["help", topic, "--markdown"]);
        assert!(document == printed, "{name} is not what the program prints: sfers help {topic} --markdown > {name}");
    }
}

#[test]
fn help_explains_commands_keys_and_measures() {
    let overview = out(&["help"]);
    assert!(overview.contains("crosscheck") && overview.contains("sfers help keys"), "{overview}");
    // The same as --help, but for the line that names the way to the other help.
    assert_eq!(out(&["help", "run"]).trim(), out(&["run", "--help"]).trim());

    let all = out(&["help", "keys"]);
    for word in ["EXPERIMENT FILES", "SWEEP FILES", "DATASET FILES", "collision_thickness_mm", "(mm)", "measures", "role"] {
        assert!(all.contains(word), "{word}");
    }
    let part = out(&["help", "keys", "robot.friction"]);
    assert!(part.contains("film_fraction") && part.contains("default 0.5") && !part.contains("actuators"), "{part}");
    assert!(out(&["help", "keys", "damping"]).contains("damping_time_s"));
    assert!(out(&["help", "measures"]).contains("jump_height_mm"));
    assert!(!out(&["help", "measures", "jump"]).contains("aerial"));

    let keys: serde_json::Value = serde_json::from_str(&out(&["help", "keys", "--json"])).unwrap();
    let experiment = keys["files"][0]["keys"].as_array().unwrap();
    let low = experiment.iter().find(|key| key["key"] == "robot.friction.low").unwrap();
    assert_eq!((&low["default"], &low["range"]), (&"0.2".into(), &"0 or more".into()));
    let measures: serde_json::Value = serde_json::from_str(&out(&["help", "measures", "--json"])).unwrap();
    assert!(measures["measures"].as_array().unwrap().iter().any(|m| m["name"] == "speed_mm_s" && m["unit"] == "mm/s"));

    assert!(refused(&[], &["help", "swep"], 2).contains("did you mean sweep?"));
    assert!(refused(&[], &["help", "keys", "dampnig_eta"], 2).contains("did you mean damping_eta?"));
}

#[test]
fn there_is_a_manual_page_for_every_command_for_keys_and_for_measures() {
    let folder = tempfile::tempdir().unwrap();
    assert!(common::sfers(folder.path(), &["man", "--out", "man"]).status.success());
    let mut pages: Vec<_> =
        fs::read_dir(folder.path().join("man")).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
    pages.sort();
    for page in ["sfers.1", "sfers-run.1", "sfers-diagnose.1", "sfers-keys.5", "sfers-measures.7"] {
        assert!(pages.iter().any(|name| name == page), "{page}: {pages:?}");
    }
    for page in &pages {
        let text = fs::read_to_string(folder.path().join("man").join(page)).unwrap();
        assert!(text.contains(".TH sfers") && text.contains(".SH NAME"), "{page}: {text}");
    }
    assert!(out(&["man"]).contains("sfers\\-crosscheck"));
    assert!(out(&["man", "sfers-keys"]).contains("film_fraction"));
    assert!(refused(&[], &["man", "sfers-rum"], 2).contains("did you mean sfers-run?"));
}

#[test]
fn a_name_that_is_nearly_right_is_suggested_with_its_place() {
    let run = |from: &str, to: &str| {
        assert!(EXPERIMENT.contains(from), "{from}");
        refused(&[("a.toml", &EXPERIMENT.replacen(from, to, 1))], &["run", "a.toml"], 2)
    };
    for (from, to, place, meant) in [
        ("actuators", "actuator", "line 2, column 1", "actuators"),
        ("mount", "mont", "line 3, column 1", "mount"),
        ("[simulation]", "[simulaton]", "line 7", "simulation"),
        ("\"clamped\"", "\"clampd\"", "line 3: robot.mount", "clamped"),
        ("\"dc\"", "\"cd\"", "line 5: drive.waveform", "dc"),
        ("[robot]", "[material]\npreset = \"parameter2\"\n[robot]", "line 2: material.preset", "parameter-2"),
        ("\"dc\"\nvoltages_v = [-1000]", "\"gait\"\ngait = \"crwal\"", "line 6: drive.gait", "crawl"),
        ("steps = 2\n", "steps = 2\n[[effect]]\nid = \"hysteresys\"\n", "line 10", "hysteresis"),
        ("steps = 2\n", "steps = 2\n[[effect]]\nid = \"tip-mass\"\nmas_g = 1\n", "line 10", "mass_g"),
        (
            "1e-5\nsteps = 2\n",
            "\"auto\"\nengine = \"planar\"\nduration_s = 1\nstep_measure = \"tip_deflection\"\n",
            "line 11: simulation.step_measure",
            "tip_deflection_mm",
        ),
    ] {
        let text = run(from, to);
        assert!(text.contains(place) && text.contains(&format!("did you mean {meant}?")), "{to}: {text}");
    }
    let set = refused(&[("a.toml", EXPERIMENT)], &["run", "a.toml", "--set", "robot.dampingeta=1"], 2);
    assert!(set.contains("--set robot.dampingeta=1") && set.contains("did you mean damping_eta?"), "{set}");
    assert!(refused(&[], &["preset", "jmp-14hz"], 2).contains("did you mean jump-14hz?"));
    assert!(refused(&[], &["sweep", "preset:jump-on-time-scna", "--out", "s"], 2).contains("did you mean jump-on-time-scan?"));
    assert!(refused(&[], &["reproduce", "jumphight", "--out", "s"], 2).contains("is not one of"));
    // clap's own.
    assert!(refused(&[], &["swep"], 2).contains("'sweep'"));

    let sweep = |experiment: &str, measure: &str| {
        format!("experiment = \"{experiment}\"\nmeasures = [\"{measure}\"]\n[vary]\n\"robot.damping_eta\" = [1]\n")
    };
    for (text, meant) in [
        (sweep("preset:crwal", "speed_mm_s"), "crawl"),
        (sweep("preset:crawl", "sped_mm_s"), "speed_mm_s"),
        (sweep("preset:crawl", "speed_mm_s").replace("damping_eta", "damping_et"), "damping_eta"),
        (sweep("preset:crawl", "speed_mm_s").replace("measures", "measure"), "measures"),
    ] {
        let said = refused(&[("s.toml", &text)], &["sweep", "s.toml", "--out", "s"], 2);
        assert!(said.contains(&format!("did you mean {meant}?")), "{text}: {said}");
    }
    let dataset = "[dataset]\nname = \"d\"\n[robot]\nactuators = 1\nmount = \"clamped\"\n[[observation]]\nmeasure = \"resonance\"\n\
        value = 20\nsigma = 1\n[observation.drive]\nwaveform = \"dc\"\nvoltages_v = [1]\n";
    let said = refused(&[("d.toml", dataset)], &["diagnose", "d.toml", "--out", "d"], 2);
    assert!(said.contains("line 7") && said.contains("did you mean resonance_hz?"), "{said}");
    let said = refused(&[("d.toml", &dataset.replace("sigma", "sigm"))], &["diagnose", "d.toml", "--out", "d"], 2);
    assert!(said.contains("line 9, column 1") && said.contains("did you mean sigma?"), "{said}");
}

#[test]
fn messages_speak_of_numbers_and_files_and_in_the_units_of_the_keys() {
    for (from, to, words) in [
        ("actuators = 1", "actuators = 1.5", "this is 1.5, but a whole number, 0 or more, is needed"),
        ("actuators = 1", "actuators = -3", "this is -3, but a whole number, 0 or more, is needed"),
        ("actuators = 1", "actuators = 1\ndamping_eta = \"x\"", "this is the text \"x\", but a number is needed"),
        ("actuators = 1", "actuators = 1e300", "this is 1e300, but a whole number"),
        ("[-1000]", "-1000", "this is -1000, but a list in brackets is needed"),
        ("mount = \"clamped\"", "mount = 3", "this is 3, but a text in quotes is needed"),
        (
            "actuators = 1",
            "actuators = 1\ndamping_eta = -1e300",
            "line 3: robot.damping_eta: is -1e300, but must be zero or more",
        ),
        ("[robot]", "[material]\nwidth_mm = -3\n[robot]", "line 2: material.width_mm: is -3, but must be positive"),
        ("[robot]", "[material]\npiezo_thickness_um = -30.7\n[robot]", "is -30.7, but"),
        ("[robot]", "[material]\npiezo_modulus_gpa = -30.336\n[robot]", "is -30.336, but"),
        ("[robot]", "[material]\nd33_pm_per_v = -0.1\n[robot]", "is -0.1, but"),
        ("[robot]", "[material]\ngravity_m_s2 = -9.81\n[robot]", "is -9.81, but"),
        ("actuators = 1", "actuators = 1\ncollision_thickness_mm = -0.7", "is -0.7, but must be positive"),
        ("1e-5", "-1e300", "simulation.time_step_s: is -1e300, but must be positive"),
        ("steps = 2", "duration_s = 1e300", "is 1e305 time steps of 1e-5 s"),
        ("steps = 2\n", "steps = 2\n[[effect]]\nid = \"tip-mass\"\nmass_g = 1e300\n", "mass_g is 1e300, but must lie between"),
    ] {
        assert!(EXPERIMENT.contains(from), "{from}");
        let text = refused(&[("a.toml", &EXPERIMENT.replacen(from, to, 1))], &["run", "a.toml"], 2);
        assert!(text.contains(words), "{to}: {text}");
        for private in ["f64", "usize", "u64", "CGS", "0000000", "struct", "expected"] {
            assert!(!text.contains(private), "{to}: {text}");
        }
    }
    let planar = EXPERIMENT.replace("1e-5", "100\nengine = \"planar\"");
    let said = refused(&[("a.toml", &planar)], &["run", "a.toml"], 4);
    assert!(said.contains("the time step 100 s is too long"), "{said}");
    let said =
        refused(&[("a.toml", EXPERIMENT), ("s.json", "{\"schema\": \"x\"}")], &["run", "a.toml", "--load-state", "s.json"], 3);
    assert!(said.contains("s.json: not a saved state: this is the text \"x\", but a whole number"), "{said}");
    for text in ["", "no archive"] {
        let said = refused(&[("a.toml", EXPERIMENT), ("b.npz", text)], &["crosscheck", "a.toml", "--against", "b.npz"], 3);
        assert!(
            said.contains("not an NPZ file") && said.contains("no zip directory at its end") && !said.contains("EOCD"),
            "{said}"
        );
    }
}
