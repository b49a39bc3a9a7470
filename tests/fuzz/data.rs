//! Measured data sets and tables of voltages.

use std::fmt::Write;
use std::path::Path;

use sfers::diagnose::dataset::Dataset;
use sfers::diagnose::quality;
use sfers::diagnose::voltage::Command;
use sfers::experiment::{self, Source};

use crate::experiments;
use crate::kinds::{Fate, Input, Outcome, refused};
use crate::outputs;
use crate::random::Random;

/// Description of the sample in tests/datasets, and the first rows of its runs.
const DATASET: &str = include_str!("../datasets/sample-tip-mass/dataset.toml");
const RUNS: [(&str, &str); 3] = [
    ("step-1000v", include_str!("../datasets/sample-tip-mass/step-1000v.csv")),
    ("square-7hz", include_str!("../datasets/sample-tip-mass/square-7hz.csv")),
    ("staircase", include_str!("../datasets/sample-tip-mass/staircase.csv")),
];
const OBSERVED: &str = include_str!("../../src/experiment/presets/datasets/published-cantilever.toml");

fn rows(text: &str, count: usize) -> String {
    text.lines().take(count + 1).flat_map(|line| [line, "\n"]).collect()
}

/// The sample's head with `count` of its runs.
fn description(count: usize) -> String {
    let head = DATASET.find("[[run]]").map_or(DATASET, |at| &DATASET[..at]);
    let runs: String =
        RUNS.iter().take(count).map(|(id, _)| format!("[[run]]\nid = \"{id}\"\nfile = \"{id}.csv\"\n\n")).collect();
    format!("{head}{runs}")
}

/// A damaged description with sound runs.
pub fn make_dataset(random: &mut Random) -> Input {
    let count = 1 + random.below(RUNS.len());
    let text = if random.once_in(4) { OBSERVED.to_owned() } else { description(count) };
    let mut input = Input::file("dataset.toml", experiments::damaged(random, text));
    for (id, text) in RUNS {
        input.files.push((format!("{id}.csv"), rows(text, 5).into_bytes()));
    }
    input
}

/// A sound description with a damaged run.
pub fn make_run(random: &mut Random) -> Input {
    let mut input = Input::file("dataset.toml", description(1));
    let mut bytes = if random.once_in(2) {
        let (_, text) = *random.pick(&RUNS);
        let count = 1 + random.below(40);
        rows(text, count).into_bytes()
    } else {
        run(random).into_bytes()
    };
    if !random.once_in(4) {
        random.damage(&mut bytes);
    }
    input.files.push((format!("{}.csv", RUNS[0].0), bytes));
    input
}

/// A run of random walks with some empty and some extreme cells.
fn run(random: &mut Random) -> String {
    let mut text = String::from("t_s,v1_v,mid_x_mm,mid_z_mm,tip_x_mm,tip_z_mm\n");
    let mut t = random.between(-1.0, 1.0);
    let (usual, odd) = (random.scale(1e-4, 1e-1), 4 + random.below(200));
    for _ in 0..1 + random.below(60) {
        let volts = if random.once_in(3) { 0.0 } else { random.between(-1500.0, 500.0) };
        let _ = write!(text, "{t},{volts}");
        for _ in 0..4 {
            let cell = match random.below(odd) {
                0 => String::new(),
                1 => random.number(),
                _ => format!("{:.4}", random.between(-20.0, 100.0)),
            };
            text = text + "," + &cell;
        }
        text.push('\n');
        t += usual * if random.once_in(20) { random.scale(1.0, 1e3) } else { 1.0 };
    }
    text
}

/// Reads a data set, looks for outliers and noise, and reads the commands between the rows.
pub fn give_dataset(input: &Input, folder: &Path, _: &mut Random) -> Outcome {
    input.write(folder)?;
    let dataset = match Dataset::read(&folder.join("dataset.toml")) {
        Ok(dataset) => dataset,
        Err(error) => return refused(&error),
    };
    for run in &dataset.runs {
        outputs::finite("times", &run.times)?;
        outputs::finite("voltages", &run.voltages)?;
        let known: Vec<f64> = run.channels.iter().flatten().copied().filter(|value| !value.is_nan()).collect();
        outputs::finite("markers", &known)?;
    }
    if dataset.runs.is_empty() {
        return Ok(Fate::Accepted);
    }
    let checked = quality::check(&dataset);
    outputs::finite("noise", &checked.noise)?;
    if let Some(remark) = checked.remarks.iter().find(|remark| remark.contains("NaN") || remark.contains("inf ")) {
        return Err(format!("not finite: {remark}"));
    }
    for run in &dataset.runs {
        let command = Command::new(&run.times, &run.voltages, dataset.robot.actuators);
        let table = command.table(&vec![0.5; command.jumps().len()], 0.0);
        outputs::finite("command", table.times())?;
        (0..table.times().len()).try_for_each(|row| outputs::finite("command", table.row(row)))?;
    }
    Ok(Fate::Accepted)
}

/// A table of voltages, sound or damaged.
pub fn make_drive(random: &mut Random) -> Input {
    let n = 1 + random.below(5);
    let mut text = String::from("t_s");
    for i in 1..=n {
        let _ = write!(text, ",v{i}_v");
    }
    let mut t = random.between(-0.1, 0.1);
    let (rate, odd) = (random.scale(1e-9, 1e1), 4 + random.below(400));
    for _ in 0..random.below(40) {
        let _ = write!(text, "\n{t}");
        for _ in 0..n {
            let cell = if random.once_in(odd) { random.number() } else { format!("{}", random.between(-2000.0, 2000.0)) };
            text = text + "," + &cell;
        }
        t += rate;
    }
    let mut bytes = text.into_bytes();
    if random.once_in(2) {
        random.damage(&mut bytes);
    }
    let engine = random.pick(&["planar", "bullet"]);
    let experiment = format!(
        "[robot]\nactuators = {n}\nmotors_per_actuator = 1\nmount = \"clamped\"\n[drive]\nwaveform = \"csv\"\nfile = \"drive.csv\"\n\
         [simulation]\nengine = \"{engine}\"\ntime_step_s = {:?}\nsteps = 20\n",
        random.scale(1e-6, 1e-3)
    );
    Input { files: vec![("drive.csv".into(), bytes), ("experiment.toml".into(), experiment.into())], words: Vec::new() }
}

/// Runs an experiment on the table.
pub fn give_drive(input: &Input, folder: &Path, random: &mut Random) -> Outcome {
    input.write(folder)?;
    let source = Source::from_file(&folder.join("experiment.toml")).map_err(|error| error.to_string())?;
    match experiment::experiment(&source) {
        Ok(experiment) => experiments::run(&experiment, random),
        Err(error) => refused(&error),
    }
}
