//! Output files as a user meets them: links, pipes, devices, modes, kills, two processes, full disks; and hostile input files.

#![cfg(unix)]

mod common;

use std::fs;
use std::io::Write;
use std::os::unix::fs::{FileTypeExt, PermissionsExt, symlink};
use std::os::unix::net::UnixListener;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

use sfers::recording::npz;

const CANTILEVER: &str = "[robot]\nactuators = 1\nmount = \"clamped\"\ndamping_eta = 0.05\n[drive]\nwaveform = \"dc\"\n\
    voltages_v = [-1000]\n[simulation]\ntime_step_s = 1e-5\nsteps = 200\nrecord_every_steps = 50\n";
/// Settings with which a run does not come back by itself.
const ENDLESS: [&str; 4] = ["--set", "simulation.steps=2000000000", "--set", "simulation.record_every_steps=10000000"];

struct Bench(tempfile::TempDir);

impl Bench {
    fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        fs::write(folder.path().join("a.toml"), CANTILEVER).unwrap();
        Self(folder)
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    fn sfers(&self, arguments: &[&str]) -> Output {
        common::sfers(self.0.path(), arguments)
    }

    fn done(&self, arguments: &[&str]) -> String {
        let output = self.sfers(arguments);
        assert!(output.status.success(), "{arguments:?}: {}", errors(&output));
        String::from_utf8(output.stdout).unwrap()
    }

    fn refuses(&self, arguments: &[&str], code: i32, words: &[&str]) {
        let before = self.files();
        let output = self.sfers(arguments);
        assert_eq!(output.status.code(), Some(code), "{arguments:?}: {}", errors(&output));
        for word in words {
            assert!(errors(&output).contains(word), "{arguments:?}: {word:?} is not in {}", errors(&output));
        }
        assert_eq!(self.files(), before, "{arguments:?}");
    }

    /// Runs a line of bash, in which `sfers` is the command.
    fn bash(&self, line: &str) -> Output {
        let script = format!("sfers() {{ {} \"$@\"; }}; {line}", env!("CARGO_BIN_EXE_sfers"));
        Command::new("bash").args(["-c", &script]).current_dir(self.0.path()).stdin(Stdio::null()).output().unwrap()
    }

    fn spawn(&self, arguments: &[&str]) -> Child {
        let mut command = Command::new(env!("CARGO_BIN_EXE_sfers"));
        command.args(arguments).current_dir(self.0.path()).stdin(Stdio::null());
        command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap()
    }

    fn files(&self) -> Vec<String> {
        let names = fs::read_dir(self.0.path()).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap());
        let mut names: Vec<_> = names.collect();
        names.sort();
        names
    }

    fn mode(&self, name: &str) -> u32 {
        fs::metadata(self.path(name)).unwrap().permissions().mode() & 0o7777
    }
}

fn errors(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

fn until(what: &str, condition: impl Fn() -> bool) {
    let start = Instant::now();
    while !condition() {
        assert!(start.elapsed() < Duration::from_secs(60), "never: {what}");
        std::thread::sleep(Duration::from_millis(5));
    }
}

fn interrupt(child: &Child) {
    assert!(Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap().success());
}

#[test]
fn a_link_stays_and_what_it_leads_to_is_replaced_or_made() {
    let bench = Bench::new();
    fs::create_dir(bench.path("far")).unwrap();
    fs::write(bench.path("far/old.csv"), "old").unwrap();
    symlink("far/old.csv", bench.path("first.csv")).unwrap();
    symlink("first.csv", bench.path("second.csv")).unwrap();
    symlink("far/new.csv", bench.path("dangling.csv")).unwrap();
    bench.done(&["run", "a.toml", "--out", "second.csv"]);
    bench.done(&["run", "a.toml", "--out", "dangling.csv"]);
    for link in ["first.csv", "second.csv", "dangling.csv"] {
        assert!(fs::symlink_metadata(bench.path(link)).unwrap().is_symlink(), "{link}");
    }
    for name in ["far/old.csv", "far/new.csv"] {
        assert!(fs::read_to_string(bench.path(name)).unwrap().starts_with("t_s,theta1_rad"), "{name}");
    }
    assert_eq!(fs::read_dir(bench.path("far")).unwrap().count(), 2);
    symlink("loop.csv", bench.path("loop.csv")).unwrap();
    bench.refuses(&["run", "a.toml", "--out", "loop.csv"], 2, &["loop.csv"]);
}

#[test]
fn a_pipe_gets_the_bytes_and_stays_a_pipe() {
    let bench = Bench::new();
    bench.done(&["run", "a.toml", "--out", "file.csv"]);
    let output = bench.bash("mkfifo p.csv && (cat p.csv > got.csv &) && sfers run a.toml --out p.csv && sleep 0.2");
    assert!(output.status.success(), "{}", errors(&output));
    assert!(fs::symlink_metadata(bench.path("p.csv")).unwrap().file_type().is_fifo());
    until("the reader has all", || fs::read(bench.path("got.csv")).unwrap() == fs::read(bench.path("file.csv")).unwrap());
    assert!(!bench.path("p.csv.manifest.json").exists());
}

#[test]
fn devices_stay_devices_and_folders_and_sockets_are_refused() {
    let bench = Bench::new();
    bench.done(&["urdf", "a.toml", "--out", "/dev/null"]);
    assert!(fs::symlink_metadata("/dev/null").unwrap().file_type().is_char_device());
    assert!(!Path::new("/dev/null.json").exists());
    fs::create_dir(bench.path("folder.csv")).unwrap();
    let _socket = UnixListener::bind(bench.path("socket.csv")).unwrap();
    bench.refuses(&["run", "a.toml", "--out", "folder.csv"], 2, &["folder.csv", "it is a folder"]);
    bench.refuses(&["run", "a.toml", "--out", "socket.csv"], 2, &["socket.csv", "it is a socket"]);
}

#[test]
fn an_existing_file_keeps_its_mode_and_a_new_one_has_that_of_the_umask() {
    let bench = Bench::new();
    for (umask, mode) in [("077", 0o600), ("002", 0o664)] {
        let output = bench.bash(&format!("rm -f a.csv; umask {umask}; sfers run a.toml --out a.csv"));
        assert!(output.status.success(), "{}", errors(&output));
        assert_eq!((bench.mode("a.csv"), bench.mode("a.csv.manifest.json")), (mode, mode), "umask {umask}");
        fs::remove_file(bench.path("a.csv.manifest.json")).unwrap();
    }
    for mode in [0o600, 0o640, 0o755] {
        fs::set_permissions(bench.path("a.csv"), fs::Permissions::from_mode(mode)).unwrap();
        bench.done(&["run", "a.toml", "--out", "a.csv"]);
        assert_eq!(bench.mode("a.csv"), mode);
    }
}

#[test]
fn a_killed_run_leaves_nothing_and_the_rest_of_an_older_one_is_taken_away() {
    let bench = Bench::new();
    fs::write(bench.path(".a.npz.sfers-tmp"), "half a recording").unwrap();
    let mut child = bench.spawn(&[&["run", "a.toml", "--out", "a.npz"][..], &ENDLESS].concat());
    until("the run begins", || !bench.path(".a.npz.sfers-tmp").exists());
    std::thread::sleep(Duration::from_millis(200));
    child.kill().unwrap();
    child.wait().unwrap();
    assert_eq!(bench.files(), ["a.toml"]);
}

#[test]
fn two_processes_that_write_one_file_leave_it_whole() {
    let bench = Bench::new();
    for _ in 0..5 {
        let children = [0, 1, 2].map(|_| bench.spawn(&["run", "a.toml", "--out", "a.npz", "--save-state", "s.json"]));
        for child in children {
            let output = child.wait_with_output().unwrap();
            assert!(output.status.success(), "{}", errors(&output));
        }
        assert_eq!(npz::read_file(&bench.path("a.npz")).unwrap().len(), 5);
        assert_eq!(bench.files(), ["a.npz", "a.npz.manifest.json", "a.toml", "s.json"]);
    }
}

/// The shell limits the size of files to 1 KiB and ignores the signal, so that writing fails as it does on a full disk.
#[test]
fn a_full_disk_is_an_error_and_the_measures_are_printed_before_it() {
    let bench = Bench::new();
    for line in [
        "trap '' XFSZ; ulimit -f 1; sfers run a.toml --set simulation.record_every_steps=1 --out a.npz",
        "sfers run a.toml --save-state /dev/full",
    ] {
        let output = bench.bash(line);
        let text = String::from_utf8_lossy(&output.stdout).into_owned();
        assert_eq!(output.status.code(), Some(2), "{line}: {}", errors(&output));
        assert!(text.contains("tip_deflection_mm = -"), "{line}: {text}");
        assert!(errors(&output).contains("cannot be written"), "{line}: {}", errors(&output));
        assert_eq!(bench.files(), ["a.toml"], "{line}");
    }
    for line in ["sfers --help > /dev/full", "sfers effects > /dev/full"] {
        assert_eq!(bench.bash(line).status.code(), Some(2), "{line}");
    }
    let output = bench.bash("sfers run a.toml --set simulation.time_step_s=1e-3 2> /dev/full");
    assert!(output.status.success(), "messages that cannot be written are no failure: {:?}", output.status);
}

#[test]
fn times_in_manifests_are_iso_8601() {
    let bench = Bench::new();
    bench.done(&["run", "a.toml", "--out", "a.npz"]);
    let manifest: serde_json::Value = serde_json::from_slice(&fs::read(bench.path("a.npz.manifest.json")).unwrap()).unwrap();
    let text = manifest["finished"].as_str().unwrap();
    let shape: String = text.chars().map(|c| if c.is_ascii_digit() { '0' } else { c }).collect();
    assert_eq!(shape, "0000-00-00T00:00:00Z", "{text}");
    assert!(text.starts_with("20"), "{text}");
}

/// An archive of one-element arrays, and `dataTime` with a header that claims `shape` over `data` zeros.
fn archive(path: &Path, shape: &str, data: usize) {
    let mut archive = zip::ZipWriter::new(fs::File::create(path).unwrap());
    let mut add = |key: &str, descr: &str, shape: &str, data: &[u8]| {
        let header = format!("{{'descr': '{descr}', 'fortran_order': False, 'shape': {shape}, }}\n");
        archive.start_file(format!("{key}.npy"), zip::write::SimpleFileOptions::default()).unwrap();
        archive.write_all(b"\x93NUMPY\x01\x00").unwrap();
        archive.write_all(&u16::try_from(header.len()).unwrap().to_le_bytes()).unwrap();
        archive.write_all(header.as_bytes()).unwrap();
        archive.write_all(data).unwrap();
    };
    for key in ["N", "m"] {
        add(key, "<i8", "()", &1_i64.to_le_bytes());
    }
    add("dataTime", "<f8", shape, &vec![0; data]);
    archive.finish().unwrap();
}

#[test]
fn an_archive_that_claims_what_it_does_not_hold_is_input_data_and_does_not_end_the_process() {
    let bench = Bench::new();
    for (shape, data, word) in [
        ("(1000000000000,)", 80, "1000000000000"),
        ("(4000000000000000000, 4)", 80, "4000000000000000000"),
        ("(300000000,)", 80, "cut short"),
        ("(10,)", 50_000_000, "more bytes"),
    ] {
        archive(&bench.path("claim.npz"), shape, data);
        for arguments in [["crosscheck", "a.toml", "--against", "claim.npz"], ["plot", "claim.npz", "--out", "p.svg"]] {
            bench.refuses(&arguments, 3, &["claim.npz", "dataTime", word]);
        }
    }
}

#[test]
fn nested_and_endless_inputs_are_refused() {
    let bench = Bench::new();
    fs::write(bench.path("deep.urdf"), format!("<robot name=\"r\">{}", "<a>".repeat(200_000))).unwrap();
    fs::write(bench.path("deep.json"), "[".repeat(200_000)).unwrap();
    fs::write(bench.path("deep.toml"), format!("a = {}", "[".repeat(200_000))).unwrap();
    bench.refuses(&["run", "a.toml", "--robot", "deep.urdf"], 3, &["deep.urdf"]);
    bench.refuses(&["run", "a.toml", "--load-state", "deep.json"], 3, &["deep.json"]);
    bench.refuses(&["run", "deep.toml"], 2, &["deep.toml"]);
}

#[test]
fn engine_and_setting_that_contradict_each_other_are_refused_and_equal_ones_are_not() {
    let bench = Bench::new();
    bench.refuses(
        &["run", "a.toml", "--engine", "planar", "--set", "simulation.engine=bullet"],
        2,
        &["--engine planar", "--set simulation.engine=bullet", "contradict"],
    );
    bench.done(&["run", "a.toml", "--engine", "planar", "--set", "simulation.engine=planar"]);
}

#[test]
fn built_in_experiments_are_taken_by_name_and_a_file_of_that_name_wins() {
    let bench = Bench::new();
    let short = ["--set", "simulation.duration_s=0.001"];
    let preset = bench.done(&[&["run", "preset:cantilever-dc"][..], &short].concat());
    assert_eq!(bench.done(&[&["run", "cantilever-dc"][..], &short].concat()), preset);
    assert!(bench.done(&["urdf", "cantilever-dc"]).contains("<robot"));
    assert!(bench.done(&["mjcf", "preset:SingleActuatorCantilever"]).contains("<mujoco"));
    fs::write(bench.path("cantilever-dc"), CANTILEVER).unwrap();
    assert_eq!(bench.done(&["run", "cantilever-dc"]), bench.done(&["run", "a.toml"]));
    assert_eq!(bench.done(&[&["run", "preset:cantilever-dc"][..], &short].concat()), preset);
    bench.refuses(&["run", "cantilever"], 2, &["cantilever", "no such file", "sfers presets"]);
    bench.refuses(&["run", "preset:cantilever"], 2, &["no preset", "sfers presets"]);
    bench.refuses(&["sweep", "jump-scan", "--out", "d"], 2, &["jump-scan", "no such file", "sfers presets"]);
    bench.done(&["animate", "jump-14hz", "--speed", "0.5", "--out", "a.gif"]);
    assert!(bench.path("a.gif").exists());
}

/// A checkout has the package in `src`. Modules without content stand for PyBullet and numpy.
#[test]
fn crosscheck_takes_the_root_of_a_checkout() {
    let bench = Bench::new();
    let package = bench.path("checkout/src/sfers/robot_simulation");
    fs::create_dir_all(&package).unwrap();
    for module in ["numpy.py", "pybullet.py", "checkout/src/sfers/__init__.py", "checkout/src/sfers/robot_simulation/__init__.py"]
    {
        fs::write(bench.path(module), "").unwrap();
    }
    fs::write(package.join("inchworm_envs.py"), "found = True\n").unwrap();
    for folder in ["checkout", "checkout/src"] {
        let output = bench.sfers(&["crosscheck", "a.toml", "--sfers", folder]);
        assert!(errors(&output).contains("inchworm_envs has no class SingleActuatorCantilever"), "{folder}: {}", errors(&output));
    }
    let output = bench.sfers(&["crosscheck", "a.toml", "--sfers", "checkout/src/sfers"]);
    assert!(errors(&output).contains("root of a checkout"), "{}", errors(&output));
}

#[test]
fn a_diagnosis_has_its_folder_alone_and_an_interrupt_ends_it_with_nothing_written() {
    let bench = Bench::new();
    let data = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/datasets/sample-hysteresis");
    let arguments = ["diagnose", data.to_str().unwrap(), "--out", "d", "--jobs", "1"];
    let child = bench.spawn(&arguments);
    until("the folder is locked", || bench.path("d/.sfers-lock").exists());
    bench.refuses(&arguments, 2, &["another sfers diagnose"]);
    interrupt(&child);
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(130), "{}", errors(&output));
    assert!(errors(&output).contains("interrupted; nothing was written"), "{}", errors(&output));
    assert_eq!(fs::read_dir(bench.path("d")).unwrap().count(), 0);
}
