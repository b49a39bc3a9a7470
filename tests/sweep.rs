//! Sweeps as a user runs them: killed, sharded, on any number of threads, on a full disk, in a folder of another sweep.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::time::{Duration, Instant};

/// 24 runs of a cantilever, some tens of milliseconds each.
const SWEEP: &str = "experiment = \"a.toml\"\nmeasures = [\"tip_deflection_mm\", \"energy_error\"]\n[vary]\n\
    \"robot.damping_eta\" = { from = 0.01, to = 0.04, count = 4 }\n\
    \"drive.voltages_v\" = [[-100], [-200], [-300], [-400], [-500], [-600]]\n";
const EXPERIMENT: &str = "[robot]\nactuators = 1\nmount = \"clamped\"\n[drive]\nwaveform = \"dc\"\nvoltages_v = [0]\n\
    [simulation]\ntime_step_s = 1e-5\nsteps = 5000\n";

struct Bench(tempfile::TempDir);

impl Bench {
    fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        fs::write(folder.path().join("a.toml"), EXPERIMENT).unwrap();
        fs::write(folder.path().join("s.toml"), SWEEP).unwrap();
        Self(folder)
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    fn command(&self, arguments: &[&str]) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_sfers"));
        command.arg("sweep").args(arguments).current_dir(self.0.path()).stdin(Stdio::null());
        command
    }

    fn sweep(&self, arguments: &[&str]) -> Output {
        self.command(arguments).output().unwrap()
    }

    fn done(&self, arguments: &[&str]) -> String {
        let output = self.sweep(arguments);
        assert!(output.status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&output.stderr));
        String::from_utf8(output.stderr).unwrap()
    }

    fn refuses(&self, arguments: &[&str], code: i32, words: &[&str]) {
        let output = self.sweep(arguments);
        let text = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(code), "{text}");
        for word in words {
            assert!(text.contains(word), "{word:?} is not in {text}");
        }
        assert!(output.stdout.is_empty());
    }

    fn read(&self, name: &str) -> String {
        fs::read_to_string(self.path(name)).unwrap()
    }
}

fn text_of(path: &Path) -> String {
    fs::read_to_string(path).unwrap_or_default()
}

/// The rows of a file, without the notes between them.
fn rows(text: &str) -> Vec<&str> {
    text.lines().filter(|line| !line.starts_with('#')).collect()
}

/// The points of the rows of a file.
fn points(text: &str) -> Vec<usize> {
    rows(text).iter().map(|row| row.split(',').next().unwrap().parse().unwrap()).collect()
}

#[test]
fn one_and_four_jobs_give_the_same_bytes_in_the_order_of_the_grid() {
    let bench = Bench::new();
    bench.done(&["s.toml", "--out", "one", "--jobs", "1"]);
    bench.done(&["s.toml", "--out", "four", "--jobs", "4"]);
    let results = bench.read("one/results.csv");
    assert_eq!(results, bench.read("four/results.csv"));
    let mut reader = csv::Reader::from_reader(results.as_bytes());
    assert_eq!(
        reader.headers().unwrap(),
        vec!["robot.damping_eta", "drive.voltages_v", "tip_deflection_mm", "energy_error", "status"]
    );
    let records: Vec<_> = reader.records().map(Result::unwrap).collect();
    assert_eq!(records.len(), 24);
    assert_eq!((&records[0][0], &records[0][1]), ("0.01", "[-100]"));
    assert_eq!((&records[23][0], &records[23][1]), ("0.04", "[-600]"));
    assert!(records.iter().all(|record| &record[4] == "ok"));
}

#[test]
fn a_sweep_killed_twice_loses_nothing_and_computes_nothing_twice() {
    let bench = Bench::new();
    bench.done(&["s.toml", "--out", "whole"]);
    let path = bench.path("killed/rows-1-of-1.csv");
    let mut before = String::new();
    for enough in [5, 12] {
        let mut child = bench.command(&["s.toml", "--out", "killed", "--jobs", "2"]).stderr(Stdio::null()).spawn().unwrap();
        let start = Instant::now();
        while rows(&text_of(&path)).len() < enough {
            assert!(start.elapsed() < Duration::from_secs(60), "the sweep makes no rows");
            std::thread::sleep(Duration::from_millis(2));
        }
        child.kill().unwrap();
        child.wait().unwrap();
        // What was finished before the start is still there, at its place.
        let now = text_of(&path);
        assert!(now.starts_with(&before));
        assert!(!bench.path("killed/results.csv").exists(), "the sweep was done before the kill");
        before = now;
    }
    // As a kill in the middle of a write would leave it: a line without its end.
    fs::write(&path, format!("{before}23,-1.5")).unwrap();
    let there = rows(&before).len();
    let remark = bench.done(&["s.toml", "--out", "killed"]);
    assert!(
        remark.contains(&format!("{} points computed", 24 - there)) && remark.contains(&format!("{there} there before")),
        "{remark}"
    );
    let now = text_of(&path);
    assert!(now.starts_with(&before));
    let points = points(&now);
    assert_eq!(points.len(), 24);
    assert_eq!(points.iter().collect::<BTreeSet<_>>().len(), 24);
    assert_eq!(bench.read("killed/results.csv"), bench.read("whole/results.csv"));
}

#[test]
fn shards_are_merged_when_all_are_there_and_not_before() {
    let bench = Bench::new();
    bench.done(&["s.toml", "--out", "whole"]);
    for (folder, shard) in [("a", "1/3"), ("b", "2/3"), ("c", "3/3")] {
        let text = bench.done(&["s.toml", "--out", folder, "--shard", shard]);
        assert!(text.contains("8 points computed") && text.contains("--merge"), "{text}");
        assert!(!bench.path(folder).join("results.csv").exists());
    }
    fs::copy(bench.path("b/rows-2-of-3.csv"), bench.path("a/rows-2-of-3.csv")).unwrap();
    bench.refuses(&["s.toml", "--out", "a", "--merge"], 3, &["8 of 24", "point 2", "drive.voltages_v = [-300]"]);
    assert!(!bench.path("a/results.csv").exists());
    fs::copy(bench.path("c/rows-3-of-3.csv"), bench.path("a/rows-3-of-3.csv")).unwrap();
    bench.done(&["s.toml", "--out", "a", "--merge"]);
    assert_eq!(bench.read("a/results.csv"), bench.read("whole/results.csv"));
}

#[test]
fn bad_sweeps_are_refused_before_anything_runs() {
    let bench = Bench::new();
    for (name, vary, words) in [
        ("unknown.toml", "\"robot.legs\" = [4]", ["legs", "there is no key"]),
        ("empty.toml", "\"robot.damping_eta\" = []", ["robot.damping_eta", "no values"]),
        ("range.toml", "\"robot.damping_eta\" = { from = 0, to = 1, count = 0 }", ["robot.damping_eta", "no values"]),
        ("point.toml", "\"robot.damping_eta\" = [0.01, -0.01]", ["robot.damping_eta", "zero or more"]),
    ] {
        let head = SWEEP.split("[vary]").next().unwrap();
        fs::write(bench.path(name), format!("{head}[vary]\n{vary}\n")).unwrap();
        bench.refuses(&[name, "--out", "out"], 2, &words);
        assert!(!bench.path("out").exists());
    }
    fs::write(bench.path("measure.toml"), SWEEP.replace("tip_deflection_mm", "tip_mm")).unwrap();
    bench.refuses(&["measure.toml", "--out", "out"], 2, &["tip_mm", "tip_deflection_mm"]);
    bench.refuses(&["s.toml", "--out", "out", "--shard", "4/3"], 2, &["K/N"]);
    bench.refuses(&["none.toml", "--out", "out"], 2, &["none.toml"]);
    assert!(!bench.path("out").exists());
}

#[test]
fn the_folder_of_another_sweep_is_left_alone() {
    let bench = Bench::new();
    bench.done(&["s.toml", "--out", "out"]);
    let before = bench.read("out/results.csv");
    fs::write(bench.path("t.toml"), SWEEP.replace("0.04", "0.05")).unwrap();
    bench.refuses(&["t.toml", "--out", "out"], 2, &["another sweep", "the values of robot.damping_eta differ"]);
    bench.refuses(&["s.toml", "--out", "out", "--set", "robot.positive_gain=2"], 2, &["another sweep", "the settings differ"]);
    assert_eq!(bench.read("out/results.csv"), before);
    fs::write(bench.path("out/rows-1-of-1.csv"), "0,1.0\n").unwrap();
    bench.refuses(&["s.toml", "--out", "out"], 2, &["rows-1-of-1.csv", "line 1"]);
}

#[test]
fn a_point_that_fails_is_a_row_with_its_reason() {
    let bench = Bench::new();
    let text = "experiment = \"a.toml\"\nmeasures = [\"tip_deflection_mm\"]\n[vary]\n\"simulation.time_step_s\" = [1e-5, 1e-2]\n";
    fs::write(bench.path("s.toml"), text).unwrap();
    let remark = bench.done(&["s.toml", "--out", "out"]);
    assert!(remark.contains("1 without measures"), "{remark}");
    let results = bench.read("out/results.csv");
    let mut reader = csv::Reader::from_reader(results.as_bytes());
    let records: Vec<_> = reader.records().map(Result::unwrap).collect();
    assert_eq!(&records[0][2], "ok");
    assert!(records[1][1].is_empty() && records[1][2].starts_with("failed: "), "{results}");
}

/// The shell limits the size of files to 4 KiB and ignores the signal, so that writing fails as it does on a full disk.
#[test]
fn a_disk_that_fills_is_an_error_and_the_finished_rows_stay() {
    let bench = Bench::new();
    let many = SWEEP.replace("count = 4", "count = 20");
    fs::write(bench.path("s.toml"), many).unwrap();
    bench.done(&["s.toml", "--out", "whole"]);
    let sfers = env!("CARGO_BIN_EXE_sfers");
    let script = format!("trap '' XFSZ; ulimit -f 4; exec {sfers} sweep s.toml --out out");
    let output = Command::new("bash").args(["-c", &script]).current_dir(bench.0.path()).output().unwrap();
    let text = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(2), "{text}");
    assert!(text.contains("rows-1-of-1.csv") && text.contains("File too large"), "{text}");
    let kept = text_of(&bench.path("out/rows-1-of-1.csv"));
    assert!(kept.ends_with('\n') && rows(&kept).len() > 3, "{kept}");
    let remark = bench.done(&["s.toml", "--out", "out"]);
    assert!(remark.contains(&format!("{} there before", rows(&kept).len())), "{remark}");
    assert_eq!(bench.read("out/results.csv"), bench.read("whole/results.csv"));
}

#[test]
fn two_processes_do_not_work_on_the_same_rows() {
    let bench = Bench::new();
    let slow = SWEEP.replace("count = 4", "count = 4000");
    fs::write(bench.path("s.toml"), slow).unwrap();
    let mut child = bench.command(&["s.toml", "--out", "out", "--jobs", "1"]).stderr(Stdio::null()).spawn().unwrap();
    let start = Instant::now();
    while text_of(&bench.path("out/rows-1-of-1.csv")).is_empty() {
        assert!(start.elapsed() < Duration::from_secs(60), "the sweep makes no rows");
        std::thread::sleep(Duration::from_millis(2));
    }
    bench.refuses(&["s.toml", "--out", "out"], 2, &["another sfers"]);
    child.kill().unwrap();
    child.wait().unwrap();
}

#[test]
fn a_setting_replaces_the_only_value_of_a_key_and_is_refused_for_keys_that_vary() {
    let bench = Bench::new();
    let text = SWEEP.replace("[vary]", "[vary]\n\"simulation.steps\" = [5000]").replace("count = 4", "count = 1");
    fs::write(bench.path("s.toml"), text).unwrap();
    bench.done(&["s.toml", "--out", "long"]);
    bench.done(&["s.toml", "--out", "short", "--set", "simulation.steps=1000"]);
    let cells = |name: &str| -> Vec<(String, String)> {
        let text = bench.read(name);
        let mut reader = csv::Reader::from_reader(text.as_bytes());
        reader.records().map(Result::unwrap).map(|record| (record[0].to_owned(), record[3].to_owned())).collect()
    };
    let (long, short) = (cells("long/results.csv"), cells("short/results.csv"));
    assert_eq!((long.len(), short.len()), (6, 6));
    assert!(long.iter().all(|row| row.0 == "5000") && short.iter().all(|row| row.0 == "1000"), "{short:?}");
    assert!(long.iter().zip(&short).all(|(a, b)| a.1 != b.1), "the setting changes nothing: {short:?}");
    let setting = ["s.toml", "--out", "out", "--set"];
    let refuses = |set: &str, words: &[&str]| bench.refuses(&[&setting[..], &[set]].concat(), 2, words);
    refuses("drive.voltages_v=[-50]", &["--set drive.voltages_v=[-50]", "drive.voltages_v", "s.toml, line 6"]);
    refuses("drive={waveform=\"dc\"}", &["drive.voltages_v", "s.toml, line 6"]);
    refuses("simulation.steps=-1", &["--set simulation.steps=-1"]);
    assert!(!bench.path("out").exists());
}

#[test]
fn what_is_wrong_in_the_sweep_file_is_named_with_its_line() {
    let bench = Bench::new();
    let head = SWEEP.split("[vary]").next().unwrap();
    for (vary, words) in [
        ("\"robot.legs\" = [4]", ["s.toml, line 4, robot.legs = 4", "legs"]),
        ("\"robot.damping_eta\" = [0.01, -0.01]", ["s.toml, line 4, robot.damping_eta = -0.01", "zero or more"]),
        ("\"robot.damping_eta\" = []", ["s.toml, line 4", "no values"]),
        ("\"robot.mount\" = [\"glued\"]", ["s.toml, line 4, robot.mount = \"glued\"", "clamped"]),
    ] {
        fs::write(bench.path("s.toml"), format!("{head}[vary]\n{vary}\n")).unwrap();
        let output = bench.sweep(&["s.toml", "--out", "out"]);
        let text = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.code() == Some(2) && words.iter().all(|word| text.contains(word)), "{text}");
        assert!(!text.contains("--set"), "{text}");
    }
}

#[test]
fn a_drive_that_was_edited_is_another_sweep() {
    let bench = Bench::new();
    let drive = "waveform = \"csv\"\nfile = \"drive.csv\"";
    fs::write(bench.path("a.toml"), EXPERIMENT.replace("waveform = \"dc\"\nvoltages_v = [0]", drive)).unwrap();
    let text = "experiment = \"a.toml\"\nmeasures = [\"tip_deflection_mm\"]\n[vary]\n\"robot.damping_eta\" = [0.01, 0.02]\n";
    fs::write(bench.path("s.toml"), text).unwrap();
    fs::write(bench.path("drive.csv"), "t_s,v1_v\n0,-500\n").unwrap();
    bench.done(&["s.toml", "--out", "out"]);
    assert!(bench.done(&["s.toml", "--out", "out"]).contains("0 points computed"));
    let before = bench.read("out/results.csv");
    fs::write(bench.path("drive.csv"), "t_s,v1_v\n0,-600\n").unwrap();
    for more in [&[][..], &["--keep-rows"], &["--merge"]] {
        bench.refuses(&[&["s.toml", "--out", "out"], more].concat(), 2, &["another sweep", "the contents of drive.csv"]);
    }
    bench.done(&["s.toml", "--out", "other"]);
    assert_ne!(bench.read("other/results.csv"), before);
    assert_eq!(bench.read("out/results.csv"), before);
}

#[test]
fn a_drive_that_is_edited_while_the_sweep_runs_stops_it() {
    let bench = Bench::new();
    let drive = "waveform = \"csv\"\nfile = \"drive.csv\"";
    fs::write(bench.path("a.toml"), EXPERIMENT.replace("waveform = \"dc\"\nvoltages_v = [0]", drive)).unwrap();
    let text = "experiment = \"a.toml\"\nmeasures = [\"tip_deflection_mm\"]\n[vary]\n\
        \"robot.damping_eta\" = { from = 0.01, to = 0.02, count = 400 }\n";
    fs::write(bench.path("s.toml"), text).unwrap();
    fs::write(bench.path("drive.csv"), "t_s,v1_v\n0,-500\n").unwrap();
    let child = bench.command(&["s.toml", "--out", "out", "--jobs", "1"]).stderr(Stdio::piped()).spawn().unwrap();
    let path = bench.path("out/rows-1-of-1.csv");
    let start = Instant::now();
    while rows(&text_of(&path)).len() < 2 {
        assert!(start.elapsed() < Duration::from_secs(60), "the sweep makes no rows");
        std::thread::sleep(Duration::from_millis(1));
    }
    fs::write(bench.path("drive.csv"), "t_s,v1_v\n0,-600\n").unwrap();
    let output = child.wait_with_output().unwrap();
    let text = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(2), "{text}");
    assert!(text.contains("drive.csv: changed while the sweep runs"), "{text}");
    assert!(!text_of(&path).contains("failed") && !bench.path("out/results.csv").exists());
}

#[test]
fn rows_of_another_revision_are_kept_only_if_the_user_says_so() {
    let bench = Bench::new();
    bench.done(&["s.toml", "--out", "out", "--shard", "1/2"]);
    let identity = bench.read("out/sweep.json");
    let mut object: serde_json::Value = serde_json::from_str(&identity).unwrap();
    assert!(object["programs"][0].as_str().unwrap().contains("revision "), "{identity}");
    object["programs"][0] = "sfers 0.0.9, revision 0123abc, Bullet 3.24 double".into();
    let theirs = format!("{object:#}\n");
    fs::write(bench.path("out/sweep.json"), &theirs).unwrap();
    let arguments = ["s.toml", "--out", "out", "--shard", "2/2"];
    bench.refuses(&arguments, 2, &["revision 0123abc", "and this is sfers", "--keep-rows", "another --out"]);
    assert_eq!(bench.read("out/sweep.json"), theirs);
    bench.done(&[&arguments[..], &["--keep-rows"]].concat());
    assert!(bench.path("out/results.csv").exists());
    // From now on the folder is of both.
    assert!(bench.done(&arguments).contains("0 points computed"));
    assert!(bench.read("out/sweep.json").contains("0123abc"));
}
