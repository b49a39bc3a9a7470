//! Sweeps and their results.

use std::path::Path;
use std::sync::atomic::AtomicBool;

use sfers::experiment::presets::SWEEPS;
use sfers::recording::measures::Measures;
use sfers::sweep::{self, Shard, Sweep};
use sfers::view;

use crate::experiments;
use crate::kinds::{Fate, Input, Outcome, refused};
use crate::outputs;
use crate::random::Random;

/// A built-in sweep or one of a small experiment, sound or damaged.
pub fn make_sweep(random: &mut Random) -> Input {
    let small = experiments::sensible(random);
    let text = if random.once_in(4) {
        random.pick(SWEEPS).text.to_owned()
    } else {
        let names = Measures::names();
        let axis = |random: &mut Random| {
            let (key, value) = *random.pick(&[
                ("robot.damping_eta", 0.05),
                ("material.width_mm", 20.0),
                ("simulation.steps", 10.0),
                ("robot.friction.low", 1.0),
                ("drive.period_s", 0.1),
                ("robot.actuators", 2.0),
            ]);
            if random.once_in(2) {
                format!("\"{key}\" = [{value:?}, {}]\n", random.number())
            } else {
                format!("\"{key}\" = {{ from = {value:?}, to = {:?}, count = {} }}\n", 2.0 * value, 1 + random.below(4))
            }
        };
        let axes: String = (0..1 + random.below(2)).map(|_| axis(random)).collect();
        format!(
            "experiment = \"small.toml\"\nmeasures = [\"{}\", \"{}\"]\n[vary]\n{axes}",
            random.pick(&names),
            random.pick(&names)
        )
    };
    let mut input = Input::file("sweep.toml", experiments::damaged(random, text));
    input.files.push(("small.toml".into(), small.into_bytes()));
    input
}

/// Reads a sweep; small ones are run and drawn.
pub fn give_sweep(input: &Input, folder: &Path, _: &mut Random) -> Outcome {
    input.write(folder)?;
    let sweep = match Sweep::open(&folder.join("sweep.toml"), &[]) {
        Ok(sweep) => sweep,
        Err(error) => return refused(&error),
    };
    let cheap = |index: usize| {
        let work = |e: sfers::experiment::Experiment| e.steps as f64 * (8 + e.robot.joints()) as f64 <= 3000.0;
        // Not with time_step_s = "auto", whose trials are no cheap look.
        !sweep.source.text().contains("auto") && sweep.experiment(index).is_ok_and(work)
    };
    if sweep.len() > 4 || !(0..sweep.len()).all(cheap) {
        return Ok(Fate::Accepted);
    }
    let out = folder.join("out");
    let outcome =
        sweep::run(&sweep, &out, Shard::ALL, 1, &AtomicBool::new(false), |_, _| {}, |_| {}).map_err(|error| error.to_string())?;
    let path = sweep::merge(&out, &sweep, |_| {}).map_err(|error| error.to_string())?;
    let text = std::fs::read_to_string(&path).map_err(|error| error.to_string())?;
    for record in csv::Reader::from_reader(text.as_bytes()).records() {
        let record = record.map_err(|error| format!("results.csv: {error}"))?;
        for cell in record.iter().skip(sweep.axes.len()).take(sweep.measures.len()).filter(|cell| !cell.is_empty()) {
            outputs::finite("results.csv", &[cell.parse().map_err(|_| format!("results.csv: {cell}"))?])?;
        }
    }
    match view::results(&text, None) {
        Ok(svg) => outputs::svg(&svg)?,
        Err(error) => drop(refused(&error)?),
    }
    Ok(if outcome.failed > 0 { Fate::Failed } else { Fate::Accepted })
}

/// Results of a sweep over one to three keys, sound or damaged.
pub fn make_results(random: &mut Random) -> Input {
    let keys = ["robot.damping_eta", "drive.period_s", "material.width_mm"];
    let names = Measures::names();
    let (k, m) = (1 + random.below(8) / 3, 1 + random.below(3));
    let sizes: Vec<usize> = (0..k).map(|_| 1 + random.below(7)).collect();
    let odd = 4 + random.below(100);
    let mut text = keys[..k].iter().map(|key| format!("{key},")).collect::<String>();
    for _ in 0..m {
        text = text + random.pick(&names).as_str() + ",";
    }
    text.push_str("status\n");
    let scale = random.scale(1e-9, 1e9);
    for row in 0..sizes.iter().product::<usize>() {
        let mut rest = row;
        for size in &sizes {
            text += &format!("{},", 0.1 * (rest % size) as f64);
            rest /= size;
        }
        for _ in 0..m {
            let cell = match random.below(odd) {
                0 => String::new(),
                1 => random.number(),
                _ => format!("{:?}", scale * random.between(-1.0, 1.0)),
            };
            text = text + &cell + ",";
        }
        text.push_str(if random.once_in(9) { "\"failed: it, you see\"\n" } else { "ok\n" });
    }
    let mut bytes = text.into_bytes();
    if !random.once_in(3) {
        random.damage(&mut bytes);
    }
    let mut input = Input::file("results.csv", bytes);
    if random.once_in(5) {
        input.words.push(random.pick(&names).clone());
    }
    input
}

/// Draws results.
pub fn give_results(input: &Input, _: &Path, _: &mut Random) -> Outcome {
    match view::results(&input.text(), input.words.first().map(String::as_str)) {
        Ok(svg) => outputs::svg(&svg).map(|()| Fate::Accepted),
        Err(error) => refused(&error),
    }
}
