//! Sweeps and diagnoses on clusters: on a real Slurm and a real HyperQueue, of which parts are killed, and on shards that are killed at random.

#[allow(dead_code)] // Chromium
#[path = "common/tools.rs"]
mod tools;

use std::collections::BTreeSet;
use std::fs;
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::time::{Duration, Instant};

/// A cantilever on the planar engine, some 15 ms a run.
const EXPERIMENT: &str = "[robot]\nactuators = 1\nmount = \"clamped\"\n[drive]\nwaveform = \"dc\"\nvoltages_v = [0]\n\
    [simulation]\ntime_step_s = 1e-5\nsteps = 100000\n";

/// `points` of it.
fn scan(points: usize) -> String {
    format!(
        "experiment = \"a.toml\"\nmeasures = [\"tip_deflection_mm\", \"energy_error\"]\n[vary]\n\
         \"robot.damping_eta\" = {{ from = 0.01, to = 0.04, count = {} }}\n\
         \"drive.voltages_v\" = [{}]\n",
        points / 40,
        (1..=40).map(|i| format!("[-{}]", 10 * i)).collect::<Vec<_>>().join(", ")
    )
}

/// A folder with a scan.
struct Bench(tempfile::TempDir);

impl Bench {
    fn new(points: usize) -> Self {
        let folder = tempfile::tempdir().unwrap();
        fs::write(folder.path().join("a.toml"), EXPERIMENT).unwrap();
        fs::write(folder.path().join("s.toml"), scan(points)).unwrap();
        Self(folder)
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    fn read(&self, name: &str) -> String {
        fs::read_to_string(self.path(name)).unwrap()
    }

    fn command(&self, arguments: &[&str]) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_sfers"));
        command.args(arguments).current_dir(self.0.path()).stdin(Stdio::null());
        command
    }

    /// A program of the scheduler, and sfers, see this environment.
    fn sfers(&self, arguments: &[&str], environment: &[(&str, &str)]) -> Output {
        self.command(arguments).envs(environment.iter().copied()).output().unwrap()
    }

    fn done(&self, arguments: &[&str], environment: &[(&str, &str)]) -> String {
        let output = self.sfers(arguments, environment);
        let text = format!("{}{}", String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
        assert!(output.status.success(), "{arguments:?}: {text}");
        text
    }

    fn refused(&self, arguments: &[&str], environment: &[(&str, &str)], words: &[&str]) {
        let output = self.sfers(arguments, environment);
        let text = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(2), "{arguments:?}: {text}");
        words.iter().for_each(|word| assert!(text.contains(word), "{word:?} is not in {text}"));
    }

    /// The points of all rows in a folder.
    fn points(&self, folder: &str) -> Vec<usize> {
        let Ok(entries) = fs::read_dir(self.path(folder)) else { return Vec::new() };
        let mut points = Vec::new();
        for path in entries.map(|entry| entry.unwrap().path()) {
            if path.file_name().unwrap().to_str().unwrap().starts_with("rows-") {
                let text = fs::read_to_string(path).unwrap();
                let whole = text.rsplit_once('\n').map_or("", |(whole, _)| whole);
                let rows = whole.lines().filter(|line| !line.starts_with('#'));
                points.extend(rows.map(|row| row.split(',').next().unwrap().parse::<usize>().unwrap()));
            }
        }
        points
    }

    /// Every point has one row, and the results are those of one process.
    fn is_whole(&self, folder: &str, points: usize) {
        let rows = self.points(folder);
        assert_eq!((rows.len(), rows.iter().collect::<BTreeSet<_>>().len()), (points, points), "lost or doubled");
        assert!(self.read(&format!("{folder}/results.csv")) == self.read("whole/results.csv"), "other bytes than one process's");
    }
}

fn until(what: &str, limit_s: u64, mut holds: impl FnMut() -> bool) {
    let start = Instant::now();
    while !holds() {
        assert!(start.elapsed() < Duration::from_secs(limit_s), "after {limit_s} s not yet: {what}");
        std::thread::sleep(Duration::from_millis(50));
    }
}

/// A Slurm of two nodes.
struct Slurm {
    folder: tempfile::TempDir,
    config: String,
}

impl Slurm {
    fn start(test: &str) -> Option<Self> {
        if !tools::has_command(test, "sbatch", "slurmctld slurmd slurm-client munge") {
            return None;
        }
        let folder = tempfile::tempdir().unwrap();
        let slurm = Self { config: folder.path().join("slurm.conf").display().to_string(), folder };
        slurm.script("start", &[]);
        Some(slurm)
    }

    fn script(&self, what: &str, more: &[&str]) {
        let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/cluster/slurm.sh");
        let output = Command::new("bash").arg(script).arg(what).arg(self.folder.path()).args(more).output().unwrap();
        assert!(output.status.success(), "{what}: {}", String::from_utf8_lossy(&output.stderr));
    }

    fn environment(&self) -> [(&str, &str); 1] {
        [("SLURM_CONF", &self.config)]
    }

    fn call(&self, program: &str, arguments: &[&str]) -> String {
        let output = Command::new(program).args(arguments).envs(self.environment()).output().unwrap();
        String::from_utf8_lossy(&output.stdout).into_owned()
    }

    /// Names of the running tasks, as `4_17`.
    fn running(&self) -> Vec<String> {
        let text = self.call("squeue", &["--noheader", "--array", "--states=RUNNING", "--format=%F_%K"]);
        text.lines().map(|line| line.trim().to_owned()).filter(|name| !name.is_empty()).collect()
    }
}

impl Drop for Slurm {
    fn drop(&mut self) {
        let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/cluster/slurm.sh");
        let _ = Command::new("bash").arg(script).arg("stop").arg(self.folder.path()).output();
    }
}

/// Stops the process of a shard of 64, if it has begun; false if it had ended before.
fn is_held_in_the_middle(bench: &Bench, shard: &str) -> bool {
    let words = [format!("--shard\0{shard}/64\0"), bench.path("out").display().to_string()];
    let is_it = |process: &Path| {
        let line = fs::read(process.join("cmdline")).unwrap_or_default();
        let line = String::from_utf8_lossy(&line).into_owned();
        words.iter().all(|word| line.contains(word))
    };
    let processes = fs::read_dir("/proc").unwrap().filter_map(|entry| Some(entry.ok()?.path()));
    let Some(process) = processes.into_iter().find(|process| is_it(process)) else { return false };
    let signal = |name: &str| {
        let process = process.file_name().unwrap().to_str().unwrap();
        Command::new("bash").args(["-c", &format!("kill -{name} {process}")]).output().unwrap();
    };
    signal("STOP");
    let rows = fs::read_to_string(bench.path(&format!("out/rows-{shard}-of-64.csv"))).unwrap_or_default();
    let is_in_the_middle = rows.lines().count() > 2 && !rows.contains("end_unix_s");
    if !is_in_the_middle {
        signal("CONT");
    }
    is_in_the_middle
}

const POINTS: usize = 2080;

/// Two arrays, since this Slurm takes indices up to 40. A node loses its power in the middle, a task is killed; Slurm requeues what it may, and the job after the
/// shards computes the rest.
#[test]
#[ignore = "slow: run by scripts/test.sh"]
fn a_scan_on_slurm_survives_a_dead_node_and_a_killed_task() {
    let Some(slurm) = Slurm::start("a_scan_on_slurm_survives_a_dead_node_and_a_killed_task") else { return };
    let environment = slurm.environment();
    let bench = Bench::new(POINTS);
    bench.done(&["sweep", "s.toml", "--out", "whole"], &[]);

    let submit = ["sweep", "s.toml", "--out", "out", "--submit", "slurm", "--shards", "64"];
    bench.refused(
        &[&submit[..], &["--yes", "--partition", "nowhere"]].concat(),
        &environment,
        &["sbatch", "partition", "nothing is submitted", "sinfo"],
    );
    bench.refused(
        &[&submit[..], &["--yes", "--time", "soon"]].concat(),
        &environment,
        &["sbatch", "time", "nothing is submitted"],
    );
    assert!(slurm.call("squeue", &["--noheader"]).is_empty(), "half a submission is none");
    // Both arrays are named, as this Slurm takes them.
    let shown = bench.done(&submit, &environment);
    assert!(
        shown.contains("--array=1-40 ") && shown.contains("--array=1-24 ") && shown.contains("afterany:JOB1:JOB2"),
        "{shown}"
    );
    assert!(bench.points("out").is_empty() && slurm.call("squeue", &["--noheader"]).is_empty(), "submitted without --yes");

    let submitted = bench.done(&[&submit[..], &["--yes"]].concat(), &environment);
    assert!(submitted.contains("submitted: jobs"), "{submitted}");
    until("a sixth of the points", 60, || bench.points("out").len() > POINTS / 6);
    bench.refused(&[&submit[..], &["--yes"]].concat(), &environment, &["are still with the scheduler", "--cancel"]);
    // Between two tasks none is running.
    until("a task that the status calls running", 60, || {
        let status = bench.done(&["sweep", "--status", "out"], &environment);
        status.contains("points/s") && status.contains("RUNNING")
    });
    // In the middle of a shard, which is held there until the node is gone.
    until("work on node2", 60, || {
        let tasks = slurm.call("squeue", &["--noheader", "--array", "--states=RUNNING", "--nodelist=node2", "--format=%K"]);
        tasks.lines().any(|task| is_held_in_the_middle(&bench, task.trim()))
    });
    slurm.script("kill-node", &["node2"]);
    // Slurm would notice by itself, some 15 s later.
    slurm.call("scontrol", &["update", "NodeName=node2", "State=DOWN", "Reason=power"]);
    let mut running = Vec::new();
    until("work on node1", 30, || {
        running = slurm.running();
        !running.is_empty()
    });
    slurm.call("scancel", &["--signal=KILL", &running[0]]);
    slurm.script("start-node", &["node2"]);
    until("the end of all jobs", 120, || slurm.call("squeue", &["--noheader"]).is_empty());

    let logs = || {
        fs::read_dir(bench.path("out"))
            .unwrap()
            .map(|entry| entry.unwrap().path())
            .filter(|path| path.extension().is_some_and(|end| end == "log"))
    };
    let told = || logs().map(|path| format!("{}: {}", path.display(), fs::read_to_string(&path).unwrap())).collect::<String>();
    assert!(bench.path("out/results.csv").exists(), "{}\n{}", bench.done(&["sweep", "--status", "out"], &environment), told());
    bench.is_whole("out", POINTS);
    // The logs of what was killed and of the job after the shards; those of the others are empty and gone.
    assert!(logs().count() < 8 && told().contains("points computed in"), "{}", told());
    let manifest: serde_json::Value = serde_json::from_str(&bench.read("out/manifest.json")).unwrap();
    assert!(manifest["scripts"]["shards.sh"].as_str().unwrap().contains("#SBATCH --requeue"));
    let sessions: Vec<_> =
        manifest["files"].as_array().unwrap().iter().flat_map(|file| file["sessions"].as_array().unwrap()).collect();
    assert!(sessions.iter().any(|session| session["end"].is_null()), "no session was killed");
    assert!(
        sessions.iter().all(|session| session["host"].is_string()
            && session["scheduler_job"].as_str().is_none_or(|job| job.starts_with("Slurm ")))
    );
    // What is done is not submitted again.
    assert!(bench.done(&[&submit[..], &["--yes"]].concat(), &environment).contains("nothing to submit"));
    let status = bench.done(&["sweep", "--status", "out"], &environment);
    assert!(status.contains("2080 of 2080 points, 0 without measures, 0 missing"), "{status}");
    let status: serde_json::Value =
        serde_json::from_str(&bench.done(&["sweep", "--status", "out", "--json"], &environment)).unwrap();
    assert_eq!((&status["status"]["computed"], &status["missing"]), (&2080.into(), &0.into()));
}

#[test]
#[ignore = "slow: run by scripts/test.sh"]
fn a_cancelled_scan_goes_on_and_diagnoses_run_on_slurm() {
    let Some(slurm) = Slurm::start("a_cancelled_scan_goes_on_and_diagnoses_run_on_slurm") else { return };
    let environment = slurm.environment();
    let bench = Bench::new(400);
    bench.done(&["sweep", "s.toml", "--out", "whole"], &[]);
    let submit =
        ["sweep", "s.toml", "--out", "out", "--submit", "slurm", "--shards", "20", "--yes", "--sbatch-arg=--comment=a scan"];
    bench.done(&submit, &environment);
    until("the first points", 60, || bench.points("out").len() > 20);
    bench.done(&["sweep", "--cancel", "out"], &environment);
    until("the end of all jobs", 60, || slurm.call("squeue", &["--noheader"]).is_empty());
    let there = bench.points("out").len();
    assert!(there < 400 && !bench.path("out/results.csv").exists());
    // A changed sweep file is another sweep; the scripts say so too.
    fs::write(bench.path("s.toml"), scan(440)).unwrap();
    bench.refused(&submit, &environment, &["another sweep", "the values of robot.damping_eta"]);
    fs::write(bench.path("s.toml"), scan(400)).unwrap();
    bench.done(&submit, &environment);
    until("the end of all jobs", 60, || slurm.call("squeue", &["--noheader"]).is_empty());
    bench.is_whole("out", 400);

    // Three sound sets and a damaged one.
    let data = bench.path("data");
    let example = Path::new(env!("CARGO_MANIFEST_DIR")).join("examples/released");
    for name in ["a", "b", "c", "damaged"] {
        fs::create_dir_all(data.join(name)).unwrap();
        for entry in fs::read_dir(&example).unwrap().map(|entry| entry.unwrap().path()).filter(|path| path.is_file()) {
            fs::copy(&entry, data.join(name).join(entry.file_name().unwrap())).unwrap();
        }
    }
    fs::write(data.join("damaged/dataset.toml"), "schema = 2\n").unwrap();
    let all = ["diagnose", "--all", "data", "--out", "found"];
    bench.done(&[&all[..], &["--submit", "slurm", "--shards", "2", "--yes"]].concat(), &environment);
    until("the end of all jobs", 120, || slurm.call("squeue", &["--noheader"]).is_empty());
    let table = bench.read("found/diagnoses.csv");
    let mut reader = csv::Reader::from_reader(table.as_bytes());
    let rows: Vec<_> = reader.records().map(Result::unwrap).collect();
    assert_eq!(rows.iter().map(|row| row[0].to_owned()).collect::<Vec<_>>(), ["a", "b", "c", "damaged"]);
    assert!(rows[..3].iter().all(|row| row[1] == rows[0][1] && !row[1].is_empty() && &row[5] == "ok"), "{table}");
    assert!(rows[3][5].starts_with("failed: "), "{table}");
    assert!(bench.done(&[&all[..], &["--submit", "slurm"]].concat(), &environment).contains("nothing to submit"));
}

#[test]
#[ignore = "slow: run by scripts/test.sh"]
fn a_scan_on_hyperqueue_survives_a_killed_worker() {
    let Some(python) = tools::python("a_scan_on_hyperqueue_survives_a_killed_worker", &["hyperqueue"]) else { return };
    let bench = Bench::new(POINTS);
    bench.done(&["sweep", "s.toml", "--out", "whole"], &[]);
    let shown = bench.done(&["sweep", "s.toml", "--out", "out", "--submit", "hq", "--shards", "64"], &[]);
    assert!(
        shown.contains("hq --output-mode=quiet submit --array=1-64 ") && shown.contains("hq job wait JOB1; bash "),
        "{shown}"
    );
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/cluster/hq.py");
    let arguments = [script, bench.path("hq"), bench.path("out/shards.sh"), "64".into()];
    let output = Command::new(python).args(arguments).stdin(Stdio::null()).output().unwrap();
    let told = format!("{}{}", String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
    assert!(output.status.success() && told.contains("\"killed\": true"), "{told}");
    let finish = Command::new("bash").arg(bench.path("out/finish.sh")).output().unwrap();
    assert!(finish.status.success(), "{}", String::from_utf8_lossy(&finish.stderr));
    bench.is_whole("out", POINTS);
}

/// A generator of numbers (Marsaglia 2003, "Xorshift RNGs").
struct Random(u64);

impl Random {
    fn below(&mut self, end: u64) -> u64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        self.0 % end
    }
}

/// 50 processes, shards and merges, each killed at a random moment.
#[test]
#[ignore = "slow: run by scripts/test.sh"]
fn fifty_random_kills_lose_nothing_and_double_nothing() {
    let bench = Bench::new(800);
    bench.done(&["sweep", "s.toml", "--out", "whole"], &[]);
    let mut random = Random(20_261_126);
    let mut killed = 0;
    while killed < 50 {
        let shard = format!("{}/4", 1 + random.below(4));
        let merge = random.below(5) == 0;
        let more: &[&str] = if merge { &["--merge"] } else { &["--jobs", "2", "--shard", &shard] };
        let mut child = bench
            .command(&[&["sweep", "s.toml", "--out", "out", "--quiet"], more].concat())
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .spawn()
            .unwrap();
        std::thread::sleep(Duration::from_millis(1 + random.below(if merge { 30 } else { 120 })));
        // One that has ended by itself, or had nothing to do, is none.
        if child.try_wait().unwrap().is_none() {
            child.kill().unwrap();
            killed += 1;
        }
        child.wait().unwrap();
        let rows = bench.points("out");
        assert_eq!(rows.len(), rows.iter().collect::<BTreeSet<_>>().len(), "doubled after {killed} kills");
        assert!(rows.len() < 800, "all is done after {killed} kills: longer points are needed");
    }
    for shard in ["1/4", "2/4", "3/4", "4/4"] {
        bench.done(&["sweep", "s.toml", "--out", "out", "--shard", shard], &[]);
    }
    bench.is_whole("out", 800);
    let left: Vec<_> = fs::read_dir(bench.path("out")).unwrap().map(|entry| entry.unwrap().file_name()).collect();
    assert!(left.iter().all(|name| !name.to_str().unwrap().contains("tmp")), "{left:?}");
}

/// A folder with programs of a scheduler that print and fail as these scripts say.
fn programs(bench: &Bench, scripts: &[(&str, &str)]) -> String {
    let folder = bench.path("bin");
    fs::create_dir_all(&folder).unwrap();
    for (name, script) in scripts {
        fs::write(folder.join(name), format!("#!/bin/bash\n{script}\n")).unwrap();
        fs::set_permissions(folder.join(name), fs::Permissions::from_mode(0o755)).unwrap();
    }
    format!("{}:/usr/bin:/bin", folder.display())
}

#[test]
fn what_a_scheduler_refuses_is_said_and_nothing_stays_submitted() {
    let bench = Bench::new(40);
    let submit = ["sweep", "s.toml", "--out", "out", "--submit", "slurm", "--shards", "4", "--yes"];
    bench.refused(
        &submit,
        &[("PATH", "/nowhere")],
        &["sbatch cannot be started", "PATH", "run the printed commands where it has"],
    );
    // The second command fails: what the first submitted is cancelled.
    let sbatch =
        "case \"$*\" in *afterany*) echo 'sbatch: error: Job violates accounting/QOS policy' >&2; exit 1;; *) echo 77;; esac";
    let path = programs(&bench, &[("sbatch", sbatch), ("scancel", "echo \"$@\" > cancelled"), ("scontrol", "exit 1")]);
    bench.refused(&submit, &[("PATH", &path)], &["QOS policy", "--dependency=afterany:77", "nothing is submitted"]);
    assert_eq!(bench.read("cancelled").trim(), "77");
    assert!(!bench.path("out/submission.json").exists());
    bench.refused(&["sweep", "--cancel", "out"], &[], &["nothing was submitted"]);
    bench.refused(&["sweep", "--status", "elsewhere"], &[], &["no folder of a sweep"]);
    bench.refused(&["sweep", "s.toml", "--out", "out", "--shards", "4"], &[], &["--submit", "--shard auto"]);
    bench.refused(&["sweep", "s.toml", "--out", "out", "--shard", "auto"], &[], &["SLURM_ARRAY_TASK_ID", "--shard K/N"]);
}

#[test]
fn hyperqueue_is_called_asked_and_told_to_cancel() {
    let bench = Bench::new(40);
    let hq = "echo \"$@\" >> called\ncase \"$*\" in *submit*) echo 5;; *list*) echo '[{\"id\": 5, \"task_stats\": {\"running\": 1, \"waiting\": 2}}, {\"id\": 6, \
              \"task_stats\": {\"running\": 9}}]';; esac";
    let path = programs(&bench, &[("hq", hq)]);
    let environment = [("PATH", path.as_str())];
    let submit = ["sweep", "s.toml", "--out", "out", "--submit", "hq", "--shards", "3", "--yes", "--hq-arg=--crash-limit=9"];
    assert!(bench.done(&submit, &environment).contains("submitted: jobs 5"));
    assert!(bench.read("out/shards.sh").contains("#HQ --crash-limit=9"));
    let status = bench.done(&["sweep", "--status", "out"], &environment);
    assert!(
        status.contains("0 of 40 points")
            && status.contains("3 shards: 3 not begun")
            && status.contains("jobs 5: 1 RUNNING, 2 PENDING"),
        "{status}"
    );
    bench.refused(&submit, &environment, &["jobs 5 are still with the scheduler"]);
    bench.done(&["sweep", "--cancel", "out"], &environment);
    assert!(bench.read("called").contains("job cancel 5"));
}

#[test]
fn status_tells_running_killed_and_interrupted_shards_apart() {
    let bench = Bench::new(4000);
    let begin = |shard: &str| {
        let before = bench.points("out").len();
        let mut command = bench.command(&["sweep", "s.toml", "--out", "out", "--jobs", "1", "--quiet", "--shard", shard]);
        let child = command.stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
        until("some rows", 60, || bench.points("out").len() > before + 3);
        child
    };
    let status = || bench.done(&["sweep", "--status", "out"], &[]);
    let mut child = begin("1/3");
    let text = status();
    assert!(
        text.contains("3 shards: 2 not begun, 1 running, 0 done, 0 stopped, 0 killed") && text.contains("points/s, "),
        "{text}"
    );
    child.kill().unwrap();
    child.wait().unwrap();
    let text = status();
    assert!(
        text.contains("2 not begun, 0 running, 0 done, 0 stopped, 1 killed") && text.contains("nothing is at work"),
        "{text}"
    );
    let mut child = begin("2/3");
    Command::new("bash").args(["-c", &format!("kill -TERM {}", child.id())]).output().unwrap();
    assert_eq!(child.wait().unwrap().code(), Some(130));
    assert!(status().contains("1 not begun, 0 running, 0 done, 1 stopped, 1 killed"), "{}", status());
    // As a network file system may leave it.
    let path = bench.path("out/rows-1-of-3.csv");
    fs::write(&path, bench.read("out/rows-1-of-3.csv") + "\0\0\0\0\n").unwrap();
    let text = status();
    assert!(text.contains("rows-1-of-3.csv: 1 line is damaged") && text.contains("counted as missing"), "{text}");
}

/// As on a node that does not have the program, and in a job whose sweep file was changed after it was submitted.
#[test]
fn a_job_says_what_is_wrong_on_its_machine() {
    let bench = Bench::new(40);
    bench.done(&["sweep", "s.toml", "--out", "out", "--submit", "slurm", "--shards", "4"], &[("PATH", "/usr/bin:/bin")]);
    let script = |edit: &dyn Fn(String) -> String| {
        fs::write(bench.path("job.sh"), edit(bench.read("out/shards.sh"))).unwrap();
        let output = Command::new("bash").arg(bench.path("job.sh")).env("SLURM_ARRAY_TASK_ID", "2").output().unwrap();
        (output.status.code(), String::from_utf8_lossy(&output.stderr).into_owned())
    };
    let (code, text) = script(&|text| text.replace("sfers=", "sfers=/nowhere"));
    assert!(code == Some(127) && text.contains("is not there") && text.contains("all machines see"), "{code:?} {text}");
    fs::write(bench.path("s.toml"), scan(80)).unwrap();
    let (code, text) = script(&|text| text);
    assert!(code == Some(2) && text.contains("another sweep"), "{code:?} {text}");
    fs::write(bench.path("s.toml"), scan(40)).unwrap();
    assert_eq!(script(&|text| text).0, Some(0));
    assert_eq!(bench.points("out").len(), 10);
}

#[test]
fn a_shard_of_a_job_array_finds_its_number() {
    let bench = Bench::new(40);
    bench.done(&["sweep", "s.toml", "--out", "whole"], &[]);
    for id in ["1", "2", "3", "4"] {
        let environment = [("SLURM_ARRAY_TASK_ID", id), ("SLURM_ARRAY_TASK_MIN", "1"), ("SLURM_ARRAY_TASK_MAX", "4")];
        bench.done(&["sweep", "s.toml", "--out", "out", "--shard", "auto"], &environment);
    }
    bench.is_whole("out", 40);
    let alone = [
        ("SLURM_ARRAY_TASK_ID", "1"),
        ("SLURM_ARRAY_TASK_MIN", "1"),
        ("SLURM_ARRAY_TASK_MAX", "1"),
        ("SLURM_ARRAY_TASK_COUNT", "1"),
    ];
    bench.refused(&["sweep", "s.toml", "--out", "out", "--shard", "auto"], &alone, &["--shards N"]);
    bench.done(&["sweep", "s.toml", "--out", "out", "--shard", "auto", "--shards", "4"], &alone);
}

#[test]
fn partial_folders_of_two_clusters_become_one_and_a_copy_goes_on() {
    let bench = Bench::new(80);
    bench.done(&["sweep", "s.toml", "--out", "whole"], &[]);
    // Divided in two ways, some points twice, the last shard nowhere.
    for (folder, shards) in [("here", ["1/4", "2/4"]), ("there", ["1/8", "3/8"])] {
        shards.iter().for_each(|shard| drop(bench.done(&["sweep", "s.toml", "--out", folder, "--shard", shard], &[])));
    }
    let damaged = bench.read("there/rows-3-of-8.csv") + "\0\0\0\0\n";
    fs::write(bench.path("there/rows-3-of-8.csv"), damaged).unwrap();
    let output = bench.sfers(&["sweep", "s.toml", "--out", "here", "--merge", "--from", "there"], &[]);
    let text = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(
        output.status.code() == Some(3)
            && text.contains("10 points taken")
            && text.contains("30 of 80 points are missing")
            && text.contains("rows-3-of-8.csv: 1 line is damaged"),
        "{text}"
    );
    fs::create_dir(bench.path("copy")).unwrap();
    for entry in fs::read_dir(bench.path("here")).unwrap().map(|entry| entry.unwrap()) {
        fs::copy(entry.path(), bench.path("copy").join(entry.file_name())).unwrap();
    }
    let remark = bench.done(&["sweep", "s.toml", "--out", "copy"], &[]);
    assert!(remark.contains("30 points computed") && remark.contains("50 there before"), "{remark}");
    bench.is_whole("copy", 80);
    bench.refused(&["sweep", "s.toml", "--out", "here", "--merge", "--from", "whole/.."], &[], &["no folder of a sweep"]);
}
