//! The command `sfers` itself, with files and arguments as a user gives them.

use std::collections::BTreeSet;
use std::fs::{self, File};
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use serde_json::Value;
use sfers::diagnose::dataset::Dataset;
use sfers::experiment::{self, Source};
use sfers::sweep::Sweep;

use crate::experiments;
use crate::kinds::{Fate, Input, Outcome};
use crate::outputs;
use crate::random::Random;
use crate::supervise::LIMIT;
use crate::{data, files, results, settings};

/// Keys of the commands' JSON that are null where they do not apply.
const OPTIONAL: &[&str] = &[
    "energy",
    "step_choice",
    "out",
    "fault",
    "link",
    "results",
    "difference",
    "default",
    "off",
    "parting",
    "sweep",
    "largest_ulp",
];

/// Most steps times joints of an experiment that is run here.
const WORK: f64 = 2e4;

/// A command line with the files that it names; half of them are sound.
pub fn make(random: &mut Random) -> Input {
    let mut words: Vec<String> = Vec::new();
    let mut say = |text: &str| words.extend(text.split(' ').map(String::from));
    let mut input = Input::default();
    let out = |random: &mut Random, names: &[&str]| (*random.pick(names)).to_owned();
    match random.below(12) {
        0..=3 => {
            input = if random.once_in(2) {
                experiments::make(random)
            } else {
                Input::file("experiment.toml", experiments::sensible(random))
            };
            say("run experiment.toml");
            if random.once_in(2) {
                say(&format!("--out {}", out(random, &["a.npz", "a.csv", "-", "a.txt", "no/a.npz", "."])));
            }
            if random.once_in(4) {
                say("--save-state s.json");
            }
            if random.once_in(6) {
                let state = files::make_state(random);
                input.files.extend(state.files);
                say("--load-state state.json");
            }
            if random.once_in(6) {
                input.files.extend(files::make_urdf(random).files);
                say("--robot robot.urdf");
            }
            if random.once_in(4) {
                say(&format!("--engine {}", random.pick(&["planar", "bullet", "other", ""])));
            }
        }
        4 => {
            input = experiments::make(random);
            say(random.pick::<&str>(&["urdf experiment.toml", "mjcf experiment.toml"]));
            if random.once_in(2) {
                say(&format!("--out {}", out(random, &["a.urdf", "a.xml", "-", "no/a"])));
            }
        }
        5 | 6 => {
            input = match random.below(4) {
                0 => files::make_table(random),
                1 => files::make_recording(random),
                _ => results::make_results(random),
            };
            input.words.clear();
            say(&format!("plot {} --out {}", input.files[0].0, out(random, &["a.svg", "a.svg", "-", "a.png"])));
            if random.once_in(2) {
                say(&format!("--kind {}", random.pick(&["shapes", "traces", "spectrum", "x"])));
            }
        }
        7 => {
            input = files::make_recording(random);
            say(&format!("animate recording.npz --out {} --speed 1e9", out(random, &["a.html", "a.gif", "a.mp4"])));
        }
        8 => {
            input = files::make_recording(random);
            input.files.extend(experiments::make(random).files);
            say("crosscheck experiment.toml --against recording.npz");
        }
        9 => {
            input = results::make_sweep(random);
            say("sweep sweep.toml --out out --jobs 1");
            if random.once_in(4) {
                say(&format!("--shard {}", random.pick(&["1/1", "1/2", "0/1", "2/1", "9/99999999999999999999"])));
            }
        }
        10 => {
            input = if random.once_in(2) { data::make_dataset(random) } else { data::make_run(random) };
            say("diagnose dataset.toml --out out --jobs 1");
        }
        _ => say(random.pick::<&str>(&[
            "presets",
            "effects",
            "preset jump-14hz",
            "preset x",
            "completions bash",
            "--version",
            "help",
            "run --help",
            "run",
            "",
        ])),
    }
    if random.once_in(3) {
        say("--json");
    }
    if random.once_in(4) {
        say("--quiet");
    }
    if ["run", "urdf", "mjcf"].contains(&words[0].as_str()) {
        for _ in 0..random.below(3) {
            words.push("--set".into());
            words.push(settings::setting(random));
        }
    }
    if random.once_in(4) {
        let at = random.below(words.len());
        let mut bytes = std::mem::take(&mut words[at]).into_bytes();
        random.damage(&mut bytes);
        // The system allows no null character in an argument, and no argument of any length.
        words[at] = String::from_utf8_lossy(&bytes).replace('\0', "").chars().take(4000).collect();
    }
    words.iter_mut().for_each(|word| *word = word.replace('\0', ""));
    input.words = words;
    input
}

/// True if the command ends soon, which its arguments decide, not the program.
fn soon(input: &Input, folder: &Path) -> bool {
    let words: Vec<&str> = input.words.iter().map(String::as_str).collect();
    let small = |source: &Source| match experiment::experiment(source) {
        Err(_) => true,
        Ok(e) => !experiments::is_auto(&e) && e.steps as f64 * (4 + e.robot.joints()) as f64 <= WORK && e.robot.joints() <= 100,
    };
    match words.first() {
        Some(&("run" | "crosscheck")) => {
            let Ok(mut source) = Source::from_file(&folder.join("experiment.toml")) else { return true };
            for pair in words.windows(2) {
                let setting = match pair[0] {
                    "--set" => pair[1].to_owned(),
                    "--engine" => format!("simulation.engine={}", pair[1]),
                    _ => continue,
                };
                if source.set(&setting).is_err() {
                    return true;
                }
            }
            small(&source)
        }
        Some(&"sweep") => Sweep::open(&folder.join("sweep.toml"), &[]).map_or(true, |sweep| {
            sweep.len() <= 4
                && (0..sweep.len())
                    .all(|i| sweep.experiment(i).is_ok_and(|e| e.steps as f64 * (4 + e.robot.joints()) as f64 <= WORK))
        }),
        // A diagnosis takes minutes; only what it refuses is given to it.
        Some(&"diagnose") => Dataset::read(&folder.join("dataset.toml")).is_err(),
        // Without its arguments it compares all of the built-in recordings.
        Some(word) => !["reproduce", "-q"].contains(word),
        None => true,
    }
}

fn names(folder: &Path) -> BTreeSet<String> {
    let entries = fs::read_dir(folder).into_iter().flatten().flatten();
    entries.map(|entry| entry.file_name().to_string_lossy().into_owned()).collect()
}

/// Runs the command and looks at exit code, messages, result and files.
pub fn give(input: &Input, folder: &Path, _: &mut Random) -> Outcome {
    input.write(folder)?;
    if !soon(input, folder) {
        return Ok(Fate::Accepted);
    }
    let harness = |error: std::io::Error| format!("harness: {error}");
    let beside = tempfile::tempdir().map_err(harness)?;
    let (out, err) = (beside.path().join("stdout"), beside.path().join("stderr"));
    let before = names(folder);
    let mut child = Command::new(env!("CARGO_BIN_EXE_sfers"))
        .args(&input.words)
        .current_dir(folder)
        .stdin(Stdio::null())
        .stdout(File::create(&out).map_err(harness)?)
        .stderr(File::create(&err).map_err(harness)?)
        .spawn()
        .map_err(harness)?;
    let start = Instant::now();
    let status = loop {
        if let Some(status) = child.try_wait().map_err(harness)? {
            break status;
        }
        if start.elapsed() > LIMIT {
            child.kill().and_then(|()| child.wait().map(drop)).map_err(harness)?;
            return Err(format!("hang: the command took longer than {LIMIT:?}"));
        }
        std::thread::sleep(Duration::from_millis(1));
    };
    let read = |path: &Path| fs::read(path).map(|bytes| String::from_utf8_lossy(&bytes).into_owned()).map_err(harness);
    let (stdout, stderr) = (read(&out)?, read(&err)?);
    let last = stderr.trim_end().lines().last().unwrap_or_default();
    if stderr.contains("panicked") {
        let place = stderr.lines().find(|line| line.contains("panicked")).unwrap_or_default();
        return Err(format!("panic in the command: {place}"));
    }
    let Some(code) = status.code().filter(|code| (0..=4).contains(code)) else {
        return Err(format!("the command ended with {status}: {last:.200}"));
    };
    let new: Vec<String> = names(folder).difference(&before).cloned().collect();
    let leaves = ["sweep", "diagnose"].contains(&input.words[0].as_str());
    if code >= 2 && stderr.trim().is_empty() {
        return Err(format!("exit code {code} without a message"));
    }
    if (code >= 2 && !leaves && !new.is_empty()) || new.iter().any(|name| name.starts_with(".tmp")) {
        return Err(format!("exit code {code}, but there are new files: {new:?}"));
    }
    if code <= 1 && stdout.trim_start().starts_with('{') && input.words.iter().any(|word| word == "--json") {
        let value: Value = serde_json::from_str(&stdout).map_err(|error| format!("--json is no JSON: {error}"))?;
        outputs::json("--json", &value, OPTIONAL)?;
    }
    for name in new.iter().filter(|name| name.ends_with(".csv")) {
        outputs::table(name, &fs::read(folder.join(name)).map_err(harness)?, false)?;
    }
    Ok(match code {
        0 | 1 => Fate::Accepted,
        4 => Fate::Failed,
        _ => Fate::Refused,
    })
}
