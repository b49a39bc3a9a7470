//! `sfers diagnose --all`: every data set of a folder, divided among processes and machines as a sweep is.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::{Args, Task, one, write};
use crate::cli::output::unwritable;
use crate::cli::submit::{Work, absolute, ended, submit};
use crate::cli::{Failure, Options, say};
use crate::diagnose::dataset::Dataset;
use crate::files;
use crate::sweep::PROGRAM;

/// The file in the folder of a data set's results that says of which data they are; it is written last.
const DONE: &str = "done.json";

/// A finished data set.
#[derive(Debug, PartialEq, Deserialize, Serialize)]
struct Done {
    schema: u32,
    program: String,
    /// Of the description and all files that it names.
    digest: String,
    /// `ok`, or why there is no diagnosis.
    status: String,
}

/// A data set of the folder.
struct Set {
    name: String,
    path: PathBuf,
    out: PathBuf,
    digest: String,
}

impl Set {
    /// What was found, if it is of these data and this program.
    fn done(&self) -> Option<Done> {
        let text = files::read_text(&self.out.join(DONE)).ok()?;
        serde_json::from_str(&text).ok().filter(|done: &Done| done.program == PROGRAM && done.digest == self.digest)
    }

    fn is_done(&self) -> bool {
        self.done().is_some()
    }

    /// Diagnoses it, and notes that it is done unless its files could not be written.
    fn diagnose(&self, threads: usize) -> Result<(), Failure> {
        let task = Task { dataset: &self.path, out: &self.out, require: false, threads };
        let result = match Dataset::read(&self.path).map_err(Failure::from) {
            Ok(_) => one(&task, Options { quiet: true, json: false }),
            // A description with a mistake is no fault of the command.
            Err(Failure::Usage(reason)) => Err(Failure::Data(reason)),
            Err(failure) => Err(failure),
        };
        let status = match result {
            Ok(_) | Err(Failure::ClosedPipe) => "ok".to_owned(),
            Err(Failure::Data(reason) | Failure::Simulation(reason)) => format!("failed: {reason}"),
            Err(failure) => return Err(failure),
        };
        if status != "ok" {
            say(&format!("{}: {status}", self.name));
        }
        let done = Done { schema: 1, program: PROGRAM.into(), digest: self.digest.clone(), status };
        std::fs::create_dir_all(&self.out).map_err(|error| unwritable(&self.out, &error))?;
        write(&self.out, DONE, &format!("{:#}\n", serde_json::json!(done)))
    }

    /// Its line of the table.
    fn row(&self) -> Option<[String; 6]> {
        let status = self.done()?.status;
        let json =
            |name: &str| files::read_text(&self.out.join(name)).ok().and_then(|text| serde_json::from_str::<Value>(&text).ok());
        let found = if status == "ok" { json("diagnosis.json").or_else(|| json("identification.json")) } else { None }
            .unwrap_or_default();
        let text = |key: &str| found[key].as_str().unwrap_or_default().to_owned();
        let causes = found["effects"].as_array().into_iter().flatten().filter(|effect| effect["role"] == "cause");
        let causes: Vec<&str> = causes.filter_map(|effect| effect["id"].as_str()).collect();
        let complete = found["complete"].as_bool().map_or_else(String::new, |complete| complete.to_string());
        Some([self.name.clone(), text("verdict"), complete, causes.join(" "), text("summary"), status])
    }
}

/// The data sets of a folder, by name.
fn sets(folder: &Path, out: &Path) -> Result<Vec<Set>, Failure> {
    let unreadable = |path: &Path, error: &std::io::Error| Failure::Data(format!("{}: {error}", path.display()));
    let mut sets = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(|error| unreadable(folder, &error))? {
        let path = entry.map_err(|error| unreadable(folder, &error))?.path();
        if path.join("dataset.toml").is_file() {
            let name = path.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned());
            let digest = digest(&path).map_err(|error| unreadable(&path, &error))?;
            sets.push(Set { out: out.join(&name), name, path, digest });
        }
    }
    if sets.is_empty() {
        return Err(Failure::Data(format!("{}: none of its folders has a dataset.toml", folder.display())));
    }
    sets.sort_by(|a, b| a.name.cmp(&b.name));
    Ok(sets)
}

/// A digest of a description and of all files that it names.
fn digest(folder: &Path) -> std::io::Result<String> {
    let text = files::read_text(&folder.join("dataset.toml"))?;
    let mut all = files::digest(text.as_bytes());
    // One with a mistake is told where it is read.
    if let Ok(table) = text.parse::<toml::Table>() {
        for name in texts(&toml::Value::Table(table)) {
            let path = folder.join(&name);
            if path.is_file() {
                all += &format!("\n{name}: {}", files::digest(&files::read(&path)?));
            }
        }
    }
    Ok(files::digest(all.as_bytes()))
}

/// All texts in a value, in order.
fn texts(value: &toml::Value) -> Vec<String> {
    match value {
        toml::Value::String(text) => vec![text.clone()],
        toml::Value::Array(list) => list.iter().flat_map(texts).collect(),
        toml::Value::Table(table) => table.values().flat_map(texts).collect(),
        _ => Vec::new(),
    }
}

/// Diagnoses the data sets of this shard that are not done, or hands them to a cluster.
pub fn run(folder: &Path, args: &Args, threads: usize, options: Options) -> Result<ExitCode, Failure> {
    let out = absolute(&args.out)?;
    let sets = sets(folder, &out)?;
    if let Some(scheduler) = args.cluster.submit {
        let earlier = ended(&out)?;
        let missing: Vec<usize> = (0..sets.len()).filter(|&index| !sets[index].is_done()).collect();
        if missing.is_empty() {
            options.remark("all data sets are done: nothing to submit");
            return Ok(ExitCode::SUCCESS);
        }
        let arguments = [
            "diagnose".into(),
            "--all".into(),
            absolute(folder)?.display().to_string(),
            "--out".into(),
            out.display().to_string(),
        ];
        let work = Work {
            name: "diagnose".into(),
            arguments: arguments.into(),
            pieces: sets.len(),
            missing,
            piece_s: None,
            threads: args.jobs.unwrap_or(1),
            folder: out.clone(),
        };
        let claim = || std::fs::create_dir_all(&out).map_err(|error| unwritable(&out, &error));
        return submit(work, &args.cluster, scheduler, earlier.map(|earlier| earlier.shards), claim, options);
    }
    let shard = args.cluster.shard()?;
    let mine: Vec<&Set> = shard.of(sets.len()).map(|index| &sets[index]).collect();
    let todo: Vec<&&Set> = mine.iter().filter(|set| !set.is_done()).collect();
    options.remark(&format!("{} data sets, {} done before", mine.len(), mine.len() - todo.len()));
    let mut failure = None;
    for set in todo {
        options.remark(&set.name);
        match set.diagnose(threads) {
            Ok(()) => {}
            Err(Failure::Usage(reason)) => {
                say(&format!("{}: {reason}", set.name));
                failure = Some(Failure::Usage(format!("{}: not done; the others are", set.name)));
            }
            Err(other) => return Err(other),
        }
    }
    if let Some(rows) = sets.iter().map(Set::row).collect::<Option<Vec<_>>>() {
        write(&out, "diagnoses.csv", &table(&rows).map_err(|error| unwritable(&out, &error))?)?;
        options.remark(&format!("{}", out.join("diagnoses.csv").display()));
    }
    failure.map_or(Ok(ExitCode::SUCCESS), Err)
}

fn table(rows: &[[String; 6]]) -> Result<String, csv::Error> {
    let mut writer = csv::Writer::from_writer(Vec::new());
    writer.write_record(["dataset", "verdict", "complete", "causes", "summary", "status"])?;
    rows.iter().try_for_each(|row| writer.write_record(row))?;
    let bytes = writer.into_inner().map_err(|error| csv::Error::from(error.into_error()))?;
    Ok(String::from_utf8_lossy(&bytes).into_owned())
}
