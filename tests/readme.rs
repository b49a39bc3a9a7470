//! The README as a user follows it: its commands in an empty folder, in order, and its files.

use std::fs;
use std::path::Path;
use std::process::{Command, Stdio};

use sfers::diagnose::dataset::Dataset;
use sfers::experiment::{self, Source};

const README: &str = include_str!("../README.md");

/// Commands that need more than an empty folder, and what runs them instead.
const ELSEWHERE: [(&str, &str); 6] = [
    ("bash scripts/demo.sh", "needs the checkout: by hand, and its commands are among those of this test"),
    ("bash scripts/test.sh", "runs this test"),
    ("sfers crosscheck jump.toml --pybullet .venv/bin/python", "needs PyBullet: tests/live_pybullet.rs"),
    ("sfers crosscheck jump.toml --sfers DIR --pybullet .venv/bin/python", "needs the authors' package: by hand"),
    ("sfers sweep scan.toml --out scan --submit slurm --yes", "needs a cluster: tests/cluster.rs"),
    ("sfers diagnose --all benches --out found --submit slurm", "needs data: tests/cluster.rs"),
];

/// The blocks of a language.
fn blocks(language: &str) -> Vec<&'static str> {
    let start = format!("```{language}\n");
    README.split(&start).skip(1).map(|rest| rest.split_once("```").expect("blocks are closed").0).collect()
}

#[test]
#[ignore = "slow: run by scripts/test.sh"]
fn every_command_of_the_readme_works_as_it_stands_in_an_empty_folder() {
    let folder = tempfile::tempdir().unwrap();
    let sfers = Path::new(env!("CARGO_BIN_EXE_sfers")).parent().unwrap();
    let path = format!("{}:{}", sfers.display(), std::env::var("PATH").unwrap());
    let mut elsewhere = Vec::new();
    let mut run = 0;
    for line in blocks("sh").iter().flat_map(|block| block.lines()) {
        let command = line.split(" #").next().unwrap().trim();
        if let Some((known, _)) = ELSEWHERE.iter().find(|(known, _)| *known == command) {
            elsewhere.push(*known);
            continue;
        }
        if command.is_empty() {
            continue;
        }
        let output = Command::new("bash")
            .args(["-o", "pipefail", "-c", command])
            .current_dir(folder.path())
            .env("PATH", &path)
            .stdin(Stdio::null())
            .output()
            .unwrap();
        assert!(output.status.success(), "{command}: {}", String::from_utf8_lossy(&output.stderr));
        run += 1;
    }
    assert!(run >= 15, "{run} commands");
    assert_eq!(elsewhere, ELSEWHERE.map(|(command, _)| command), "the list of commands run elsewhere is stale");
    for file in
        ["jump.npz", "jump.csv", "jump.html", "jump.svg", "scan/results.csv", "scan.svg", "robot.urdf", "diagnosis/report.html"]
    {
        assert!(fs::metadata(folder.path().join(file)).unwrap().len() > 0, "{file}");
    }
}

#[test]
fn the_files_of_the_readme_are_accepted_as_they_stand() {
    let [experiment, dataset] = blocks("toml")[..] else { panic!("the README shows an experiment and a dataset") };
    let experiment = experiment::experiment(&Source::from_text("README", experiment)).unwrap();
    assert_eq!(experiment.effects.len(), 1);

    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("dataset.toml"), dataset).unwrap();
    let run = "t_s,v1_v,mid_x_mm,mid_z_mm,tip_x_mm,tip_z_mm\n0,0,50,0,100,0\n0.1,0,50,,100,0\n";
    fs::write(folder.path().join("step-1000v.csv"), run).unwrap();
    let read = Dataset::read(folder.path()).unwrap();
    assert_eq!((read.markers.len(), read.runs.len()), (2, 1));
}
