//! Every preset, class, scan and study runs, if only for a moment.

mod common;

use std::fs;
use std::process::{Command, Output, Stdio};
use std::sync::OnceLock;

use common::pages;
use serde_json::Value;
use sfers::experiment::presets::{CLASSES, PRESETS, SWEEPS};
use sfers::experiment::{self, Control, Experiment, Source};
use sfers::recording::measures::Measures;
use sfers::reproduce::STUDIES;
use sfers::sweep::Sweep;

fn sfers(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_sfers")).args(arguments).stdin(Stdio::null()).output().unwrap()
}

/// Runs the first 200 steps and takes its measures.
fn begins(name: &str, mut experiment: Experiment) {
    experiment.steps = 200;
    (experiment.record_every, experiment.record_from) = (20, 19);
    let run = experiment::run(&experiment, experiment.engine().unwrap().as_mut(), |_| Control::Continue).unwrap();
    assert_eq!(run.recording.len(), 11, "{name}");
    assert!(run.trouble(&experiment).is_empty(), "{name}");
    let measures = Measures::of(&run.recording, experiment.robot.mount, experiment.drive.period());
    assert!(measures.tip_deflection_mm.is_some() != measures.jump_height_mm.is_some(), "{name}");
}

#[test]
fn every_preset_and_every_class_of_the_reference_runs() {
    let experiment = |name: &str, text: &str| experiment::experiment(&Source::from_text(name, text)).unwrap();
    for preset in PRESETS {
        begins(preset.name, experiment(preset.name, preset.text));
    }
    for class in CLASSES {
        begins(class.name, experiment(class.name, &class.text()));
        let shown = sfers(&["preset", class.name]);
        assert_eq!(String::from_utf8(shown.stdout).unwrap(), class.text());
    }
}

#[test]
fn the_first_and_last_point_of_every_sweep_run() {
    for preset in SWEEPS {
        let sweep = Sweep::open(format!("preset:{}", preset.name).as_ref(), &[]).unwrap();
        for index in [0, sweep.len() - 1] {
            let experiment = sweep.experiment(index).unwrap();
            if experiment.accuracy.is_none() {
                begins(preset.name, experiment);
                continue;
            }
            // A promise is one of the whole run.
            let mut engine = experiment.engine().unwrap();
            match experiment::run(&experiment, engine.as_mut(), |_| Control::Continue) {
                Ok(run) => assert!(run.trouble(&experiment).is_empty(), "{}: {:?}", preset.name, run.trouble(&experiment)),
                Err(told) => assert!(told.to_string().contains("not converged to 1e-2"), "{}: {told}", preset.name),
            }
        }
    }
}

#[test]
fn presets_lists_experiments_sweeps_and_classes() {
    let text = String::from_utf8(sfers(&["presets"]).stdout).unwrap();
    assert!(PRESETS.iter().chain(SWEEPS).all(|preset| text.contains(preset.name)));
    let object: serde_json::Value = serde_json::from_slice(&sfers(&["presets", "--json"]).stdout).unwrap();
    assert_eq!(object["reference_classes"].as_array().unwrap().len(), 24);
}

/// `UPDATE=1 cargo test --test presets` writes the table anew.
#[test]
fn the_table_of_classes_in_the_documents_is_current() {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/docs/presets.md");
    let mut text = String::from(
        "# The reference's classes\n\n\
         `sfers preset CLASS` prints an experiment with the class's own settings; the preset beside it has finer chains (m = 3) and the damping of\n\
         the authors' notebooks. `sfers sweep preset:CLASS --out DIR` runs the class's scan with those. The reference runs 125 s of simulated time in\n\
         each; presets run as long as their measures need.\n\n| class | preset | scan | points |\n| --- | --- | --- | --- |\n",
    );
    for class in CLASSES {
        let points = |name: &str| Sweep::open(format!("preset:{name}").as_ref(), &[]).unwrap().len().to_string();
        let (scan, points) = class.sweep.map_or(("–".into(), "–".into()), |name| (format!("`{name}`"), points(name)));
        text.push_str(&format!("| {} | `{}` | {scan} | {points} |\n", class.name, class.preset));
    }
    text.push_str(
        "\nBesides: `model_resonant_frequencies` is `sfers::analytic::cantilever_frequencies`, `get_phase_velocity` is\n\
         `sfers::analytic::phase_velocity`, the centre of mass is `Recording::centre_of_mass`; the recorders' video is `sfers animate FILE.npz`, of this\n\
         program's recordings or the reference's; state is kept with `sfers run --save-state` and taken up with `--load-state`.\n",
    );
    if std::env::var_os("UPDATE").is_some() {
        fs::write(path, &text).unwrap();
    }
    assert_eq!(fs::read_to_string(path).unwrap_or_default(), text, "run UPDATE=1 cargo test --test presets");
}

/// The studies that take seconds; scripts/test.sh --long does all of them.
const SHORT: [&str; 6] =
    ["cantilever-shapes", "cantilever-damping", "robot-shapes", "jump-14hz", "key-shapes-14hz", "jump-frequency"];

/// Their page and their results.json, made once.
fn reproduction() -> &'static (String, Value) {
    static MADE: OnceLock<(String, Value)> = OnceLock::new();
    MADE.get_or_init(|| {
        let folder = tempfile::tempdir().unwrap();
        let out = folder.path().join("paper");
        let arguments = [&["reproduce"], &SHORT[..], &["--quick", "--out", out.to_str().unwrap()]].concat();
        let output = sfers(&arguments);
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        for id in SHORT {
            assert!(roxmltree::Document::parse(&fs::read_to_string(out.join(format!("{id}.svg"))).unwrap()).is_ok());
        }
        assert!(fs::read_to_string(out.join("table.md")).unwrap().contains("jump-14hz"));
        let results = serde_json::from_str(&fs::read_to_string(out.join("results.json")).unwrap()).unwrap();
        (fs::read_to_string(out.join("index.html")).unwrap(), results)
    })
}

fn study<'a>(results: &'a Value, id: &str) -> &'a Value {
    results["results"].as_array().unwrap().iter().find(|study| study["id"] == id).unwrap()
}

/// The number that a text begins with.
fn number(text: &Value) -> f64 {
    let first = text.as_str().unwrap().split(' ').next().unwrap();
    first.replace('−', "-").parse().unwrap_or_else(|_| panic!("{text}"))
}

#[test]
#[ignore = "slow: run by scripts/test.sh"]
fn a_reproduction_makes_its_page_tables_and_figures() {
    let (page, results) = reproduction();
    for (id, result) in SHORT.iter().zip(results["results"].as_array().unwrap()) {
        assert_eq!(result["id"], *id);
        assert!(!result["comparisons"].as_array().unwrap().is_empty());
        assert!(page.contains(&format!("<section id=\"{id}\">")));
    }
    // The paper's numbers for jumping at 14 Hz, with no number fitted: 7.5 to 8.5 mm, twice the drive's period.
    let jump = &study(results, "jump-14hz")["comparisons"];
    assert!((7.5..=8.5).contains(&number(&jump[0]["ours"])), "{jump}");
    assert_eq!((number(&jump[1]["ours"]), number(&jump[1]["bullet"])), (2.0, 2.0), "{jump}");
    let kinds = study(results, "key-shapes-14hz")["comparisons"].as_array().unwrap();
    assert!(kinds.len() == 3 && kinds.iter().all(|c| c["ours"] != "does not occur"), "{kinds:?}");
}

#[test]
#[ignore = "slow: run by scripts/test.sh"]
fn one_experiment_has_one_height_in_all_studies_and_one_on_bullet() {
    let (_, results) = reproduction();
    let rows = results["results"].as_array().unwrap().iter().flat_map(|study| study["comparisons"].as_array().unwrap());
    let heights: Vec<_> = rows.filter(|row| row["quantity"] == "height of the lowest point at 14 Hz").collect();
    assert_eq!(heights.len(), 2, "{heights:?}");
    assert_eq!((&heights[0]["ours"], &heights[0]["bullet"]), (&heights[1]["ours"], &heights[1]["bullet"]));
    assert_eq!(heights[0]["difference"], heights[1]["difference"]);
}

#[test]
#[ignore = "slow: run by scripts/test.sh"]
fn every_published_value_of_a_study_is_drawn_in_its_figure() {
    let (page, results) = reproduction();
    let document = roxmltree::Document::parse(pages::markup(page)).unwrap();
    // What the paper gives in numbers, by study: x and y, x absent where it gives y alone.
    type Given = (&'static str, &'static [(Option<f64>, f64)]);
    let given: [Given; 3] = [
        ("cantilever-shapes", &[(None, -20.0)]),
        ("jump-14hz", &[(None, 7.5), (None, 8.0)]),
        ("jump-frequency", &[(Some(14.0), 7.5), (Some(14.0), 8.0)]),
    ];
    for (id, values) in given {
        let section = document.descendants().find(|n| n.attribute("id") == Some(id)).unwrap();
        let svg = section.descendants().find(|n| n.tag_name().name() == "svg").unwrap();
        let [x, y] = pages::axes(svg);
        let marks = pages::marks(svg);
        let published = study(results, id)["published"].as_array().unwrap();
        assert_eq!(published.len(), values.len(), "{id}: {published:?}");
        for ((at_x, at_y), told) in values.iter().zip(published) {
            assert_eq!(told["y"].as_f64(), Some(*at_y), "{id}");
            if at_x.is_some() {
                assert_eq!(told["x"].as_f64(), *at_x, "{id}: {told}");
            }
            // Within the size of a marker.
            let near = |at: Option<f64>, [offset, scale]: [f64; 2], place: f64| {
                at.is_none_or(|value| (offset + scale * value - place).abs() < 4.0)
            };
            let (at_x, at_y) = (told["x"].as_f64(), told["y"].as_f64());
            let there: Vec<_> = marks.iter().filter(|m| near(at_x, x, m.0) && near(at_y, y, m.1)).collect();
            // A value of y alone is a line across most of the figure.
            let is_line = || there.iter().any(|a| there.iter().any(|b| a.1 == b.1 && b.0 - a.0 > 200.0));
            assert!(
                !there.is_empty() && (at_x.is_some() || is_line()),
                "{id}: {told} is not in the figure: {x:?} {y:?} {marks:?}"
            );
            let words: Vec<String> = svg.descendants().filter(|n| n.tag_name().name() == "text").map(pages::text).collect();
            let label = told["label"].as_str().unwrap();
            assert!(words.join(" ").contains(label), "{label} in {words:?}");
        }
    }
    // An arc of 100 mm that ends 20 mm low is 97.3 mm long along x; the nodes begin half a link, 8.3 mm, left of the clamp's end.
    let tip = &study(results, "cantilever-shapes")["published"][0];
    assert!((tip["x"].as_f64().unwrap() - (97.3 - 8.33)).abs() < 0.1, "{tip}");
}

#[test]
#[ignore = "slow: run by scripts/test.sh"]
fn every_number_of_the_reproduction_says_which_engine_it_is_of() {
    let (page, results) = reproduction();
    let document = roxmltree::Document::parse(pages::markup(page)).unwrap();
    assert_eq!(document.descendants().filter(|n| n.has_tag_name("section")).count(), SHORT.len());
    for section in document.descendants().filter(|n| n.has_tag_name("section")) {
        let heads: Vec<String> = section.descendants().filter(|n| n.has_tag_name("th")).map(pages::text).collect();
        assert_eq!(heads[2..5], ["ours (planar engine)", "difference", "spot check (Bullet)"]);
        let engines = section.descendants().find(|n| pages::has_class(n, "engines")).map(pages::text).unwrap();
        assert!(
            engines.contains("planar engine, steps that adapt to 1 % of the result") && engines.contains("Bullet, time step"),
            "{engines}"
        );
    }
    assert_eq!(results["results"].as_array().unwrap().len(), SHORT.len());
    for result in results["results"].as_array().unwrap() {
        let rows = result["comparisons"].as_array().unwrap();
        assert!(rows.iter().any(|row| row["bullet"] != ""), "{}: no spot check", result["id"]);
        assert!(rows.iter().all(|row| !row["ours"].as_str().unwrap().contains("Bullet")), "{}", result["id"]);
    }
}

#[test]
#[ignore = "slow: run by scripts/test.sh"]
fn the_reproduction_has_true_minus_signs_no_negative_zeros_and_nothing_from_outside() {
    let (page, _) = reproduction();
    let document = roxmltree::Document::parse(pages::markup(page)).unwrap();
    assert_eq!(pages::wrong_numbers(&document), Vec::<String>::new());
    pages::check_self_contained(&document);
    let cells = pages::texts(&document, "td");
    assert!(cells.iter().any(|cell| cell.starts_with("−18.99 mm")), "{cells:?}");
}

#[test]
fn an_unknown_study_is_refused_with_the_list() {
    let output = sfers(&["reproduce", "jump-15hz", "--out", "none"]);
    assert_eq!(output.status.code(), Some(2));
    let text = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(STUDIES.iter().all(|study| text.contains(study.id)), "{text}");
    assert!(!std::path::Path::new("none").exists());
}
