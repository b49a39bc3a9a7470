//! Gives inputs to worker processes and watches these.
//!
//! A worker is this test program again, with an address space of 2 GB, and has a range of cases of one kind. Before each case it writes
//! the case's number to a file, so that a worker that dies, or stands still, says of which input. Panics and wrong outputs it notes and
//! goes on.

use std::any::Any;
use std::collections::{BTreeMap, VecDeque};
use std::fs::{self, File};
use std::io::Write;
use std::os::unix::fs::FileExt;
use std::os::unix::process::ExitStatusExt;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::Mutex;
use std::time::{Duration, Instant};

use crate::kinds::{Fate, Input, KINDS, Kind, PLANTED};
use crate::random::Random;

/// Longest that an input may take.
pub const LIMIT: Duration = Duration::from_secs(20);
/// Address space of a worker and of what it starts (KB).
const MEMORY_KB: u64 = 2 << 20;
/// Tells a worker what to do: kind, seed, first case, end, file of its progress.
const JOB: &str = "SFERS_FUZZ_JOB";
/// Cases after which a kind is left alone, if so many went wrong.
const ENOUGH: usize = 100;

/// An input that something is wrong with.
#[derive(Debug, Clone)]
pub struct Finding {
    pub kind: &'static str,
    pub case: u64,
    pub symptom: String,
}

/// What became of the inputs of a kind.
#[derive(Debug, Clone, Copy, Default)]
pub struct Tally {
    pub inputs: u64,
    pub accepted: u64,
    pub refused: u64,
    pub failed: u64,
    /// Time of all workers together.
    pub busy: Duration,
    /// Largest resident memory of a worker (KB).
    pub memory_kb: u64,
    /// The input that took longest, and its case.
    pub longest: (Duration, u64),
}

/// How far a worker is: the words of its progress file.
#[derive(Debug, Clone, Copy, Default)]
struct Progress {
    case: u64,
    fates: [u64; 3],
    memory_kb: u64,
    longest: (Duration, u64),
}

impl Progress {
    const NONE: u64 = u64::MAX;

    fn words(&self) -> [u64; 7] {
        let [accepted, refused, failed] = self.fates;
        [self.case, accepted, refused, failed, self.memory_kb, self.longest.0.as_nanos() as u64, self.longest.1]
    }

    fn write(&self, file: &File) {
        let bytes: Vec<u8> = self.words().iter().flat_map(|word| word.to_le_bytes()).collect();
        file.write_all_at(&bytes, 0).expect("the progress file can be written");
    }

    fn read(path: &Path) -> Self {
        let bytes = fs::read(path).unwrap_or_default();
        let word =
            |i: usize| bytes.get(8 * i..8 * i + 8).map_or(Self::NONE, |b| b.try_into().map_or(Self::NONE, u64::from_le_bytes));
        if word(6) == Self::NONE {
            return Self { case: Self::NONE, ..Self::default() };
        }
        Self {
            case: word(0),
            fates: [word(1), word(2), word(3)],
            memory_kb: word(4),
            longest: (Duration::from_nanos(word(5)), word(6)),
        }
    }
}

fn kind_of(name: &str) -> &'static Kind {
    KINDS.iter().chain(PLANTED).find(|kind| kind.name == name).unwrap_or_else(|| panic!("there is no kind {name}"))
}

/// Makes a case's input and gives it to the program.
fn give(kind: &Kind, seed: u64, case: u64, folder: &Path) -> Result<Fate, String> {
    let mut random = Random::new(seed, kind.name, case);
    let input = (kind.make)(&mut random);
    (kind.give)(&input, folder, &mut random)
}

/// The input of a case.
pub fn input(kind: &str, seed: u64, case: u64) -> Input {
    (kind_of(kind).make)(&mut Random::new(seed, kind, case))
}

/// Gives one case to the program in this process, and says what became of it.
pub fn again(kind: &str, seed: u64, case: u64) -> Result<Fate, String> {
    let folder = tempfile::tempdir().map_err(|error| error.to_string())?;
    give(kind_of(kind), seed, case, folder.path())
}

static PANIC: Mutex<String> = Mutex::new(String::new());

fn said(payload: &(dyn Any + Send)) -> &str {
    payload.downcast_ref::<String>().map_or_else(|| payload.downcast_ref::<&str>().copied().unwrap_or("?"), String::as_str)
}

/// The work of a worker process; false if this process is none.
pub fn worker() -> bool {
    let Ok(job) = std::env::var(JOB) else { return false };
    let words: Vec<&str> = job.splitn(5, ' ').collect();
    let [kind, seed, from, to, path] = words[..] else { panic!("{JOB} has five words") };
    let number = |text: &str| text.parse::<u64>().unwrap_or_else(|_| panic!("{text} is no number"));
    let (kind, seed, path) = (kind_of(kind), number(seed), Path::new(path));
    let file = File::create(path).expect("the progress file can be made");
    let mut findings = File::options().append(true).create(true).open(findings_of(path)).expect("findings can be written");
    std::panic::set_hook(Box::new(|info| {
        let place = info.location().map_or_else(String::new, ToString::to_string);
        *PANIC.lock().unwrap_or_else(|poisoned| poisoned.into_inner()) = format!("at {place}: {}", said(info.payload()));
    }));
    let mut progress = Progress::default();
    for case in number(from)..number(to) {
        progress.case = case;
        progress.write(&file);
        let folder = tempfile::tempdir().expect("a folder can be made");
        let start = Instant::now();
        let result = catch_unwind(AssertUnwindSafe(|| give(kind, seed, case, folder.path())))
            .unwrap_or_else(|_| Err(format!("panic {}", PANIC.lock().unwrap_or_else(|poisoned| poisoned.into_inner()))));
        let took = start.elapsed();
        if took > progress.longest.0 {
            progress.longest = (took, case);
        }
        let result = if took > LIMIT { Err(format!("hang: took {took:.1?}")) } else { result };
        match result {
            Ok(fate) => progress.fates[fate as usize] += 1,
            Err(symptom) => writeln!(findings, "{case} {}", symptom.replace('\n', " ")).expect("findings can be written"),
        }
        if case % 64 == 0 {
            progress.memory_kb = memory_kb();
        }
    }
    progress.memory_kb = memory_kb();
    progress.write(&file);
    true
}

/// Largest resident memory of this process so far.
fn memory_kb() -> u64 {
    let status = fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"));
    line.and_then(|rest| rest.trim().trim_end_matches("kB").trim().parse().ok()).unwrap_or(0)
}

fn findings_of(progress: &Path) -> PathBuf {
    progress.with_extension("findings")
}

/// A range of cases of one kind.
struct Batch {
    kind: &'static Kind,
    from: u64,
    to: u64,
}

type Ledger = Mutex<(BTreeMap<&'static str, Tally>, Vec<Finding>)>;

/// Gives `counts` inputs of each kind to workers, as many at a time as there are processors. `limit` is how long an input may take.
pub fn run(counts: &[(&'static Kind, u64)], seed: u64, limit: Duration) -> (BTreeMap<&'static str, Tally>, Vec<Finding>) {
    let mut batches: Vec<Batch> = Vec::new();
    for &(kind, count) in counts {
        let size = (count / 8).clamp(20, 2000);
        batches.extend((0..count).step_by(size as usize).map(|from| Batch { kind, from, to: (from + size).min(count) }));
    }
    // Kinds take turns, so that a long run shows early how each of them does.
    batches.sort_by_key(|batch| {
        batch.from * 1_000_000 / counts.iter().find(|(kind, _)| kind.name == batch.kind.name).map_or(1, |c| c.1)
    });
    let queue = Mutex::new(VecDeque::from(batches));
    let ledger: Ledger = Mutex::default();
    let workers = std::thread::available_parallelism().map_or(1, usize::from);
    let folder = tempfile::tempdir().expect("a folder can be made");
    std::thread::scope(|scope| {
        for number in 0..workers {
            let (queue, ledger, path) = (&queue, &ledger, folder.path().join(format!("worker-{number}")));
            scope.spawn(move || {
                while let Some(batch) = { queue.lock().unwrap().pop_front() } {
                    let found = ledger.lock().unwrap().1.iter().filter(|finding| finding.kind == batch.kind.name).count();
                    if found < ENOUGH {
                        supervise(&batch, seed, limit, &path, ledger);
                    }
                }
            });
        }
    });
    let (tallies, mut findings) = ledger.into_inner().unwrap();
    findings.sort_by_key(|finding| (finding.kind, finding.case));
    (tallies, findings)
}

/// Runs a batch to its end, with a new worker behind every input that ends one.
fn supervise(batch: &Batch, seed: u64, limit: Duration, path: &Path, ledger: &Ledger) {
    let mut from = batch.from;
    while from < batch.to {
        let start = Instant::now();
        let end = work(batch, from, seed, limit, path);
        let progress = Progress::read(path);
        assert!(progress.case != Progress::NONE, "the harness's worker did not begin: {end:?}");
        let mut ledger = ledger.lock().unwrap();
        let tally = ledger.0.entry(batch.kind.name).or_default();
        let done = if end.is_some() { progress.case + 1 } else { batch.to };
        tally.inputs += done - from;
        tally.accepted += progress.fates[0];
        tally.refused += progress.fates[1];
        tally.failed += progress.fates[2];
        tally.busy += start.elapsed();
        tally.memory_kb = tally.memory_kb.max(progress.memory_kb);
        tally.longest = tally.longest.max(progress.longest);
        let noted = fs::read_to_string(findings_of(path)).unwrap_or_default();
        let noted = noted
            .lines()
            .filter_map(|line| line.split_once(' ').and_then(|(case, text)| Some((case.parse().ok()?, text.to_owned()))));
        let found: Vec<(u64, String)> = noted.chain(end.map(|symptom| (progress.case, symptom))).collect();
        ledger.1.extend(found.into_iter().map(|(case, symptom)| Finding { kind: batch.kind.name, case, symptom }));
        let _ = fs::remove_file(findings_of(path));
        from = done;
        if ledger.1.iter().filter(|finding| finding.kind == batch.kind.name).count() >= ENOUGH {
            return;
        }
    }
}

/// Runs one worker from case `from` on; says what ended it before its end.
fn work(batch: &Batch, from: u64, seed: u64, limit: Duration, path: &Path) -> Option<String> {
    let _ = fs::remove_file(path);
    let said = path.with_extension("stderr");
    let program = std::env::current_exe().expect("this program has a path");
    let mut child = Command::new("sh")
        .args(["-c", &format!("ulimit -c 0; ulimit -v {MEMORY_KB} && exec \"$0\" \"$@\"")])
        .arg(program)
        .args(["worker_process", "--exact", "--ignored", "--nocapture"])
        .env(JOB, format!("{} {seed} {from} {} {}", batch.kind.name, batch.to, path.display()))
        .env("RUST_BACKTRACE", "0")
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(File::create(&said).expect("a file can be made"))
        .spawn()
        .expect("a worker can be started");
    let mut seen = (Progress::NONE, Instant::now());
    let status = loop {
        if let Some(status) = child.try_wait().expect("a worker can be waited for") {
            break status;
        }
        let case = Progress::read(path).case;
        if case != seen.0 {
            seen = (case, Instant::now());
        } else if seen.1.elapsed() > limit + Duration::from_secs(1) {
            child.kill().and_then(|()| child.wait()).expect("a worker can be ended");
            return Some(format!("hang: longer than {limit:?}"));
        }
        std::thread::sleep(Duration::from_millis(20));
    };
    if status.success() {
        return None;
    }
    let text = fs::read_to_string(&said).unwrap_or_default();
    let last = text.lines().rfind(|line| !line.trim().is_empty() && !line.starts_with("note: ")).unwrap_or("").to_owned();
    let how = status.signal().map_or_else(|| format!("{status}"), |signal| format!("signal {signal}"));
    Some(format!("abort: {how}: {last}"))
}

/// The table of a campaign, as Markdown.
pub fn table(tallies: &BTreeMap<&'static str, Tally>, kinds: &[(&'static Kind, u64)]) -> String {
    let mut out = String::from(
        "| kind | inputs | accepted | refused | simulation failed | worker seconds | largest memory (MB) | longest input (s) |\n\
         | --- | --- | --- | --- | --- | --- | --- | --- |\n",
    );
    let mut all = Tally::default();
    let row = |name: &str, t: &Tally| {
        format!(
            "| {name} | {} | {} | {} | {} | {:.0} | {:.0} | {:.2} (case {}) |\n",
            t.inputs,
            t.accepted,
            t.refused,
            t.failed,
            t.busy.as_secs_f64(),
            t.memory_kb as f64 / 1024.0,
            t.longest.0.as_secs_f64(),
            t.longest.1
        )
    };
    for tally in kinds.iter().filter_map(|(kind, _)| tallies.get(kind.name).map(|tally| (kind.name, tally))) {
        out += &row(tally.0, tally.1);
        let t = tally.1;
        all.inputs += t.inputs;
        all.accepted += t.accepted;
        all.refused += t.refused;
        all.failed += t.failed;
        all.busy += t.busy;
        all.memory_kb = all.memory_kb.max(t.memory_kb);
        all.longest = all.longest.max(t.longest);
    }
    out + &row("all", &all)
}
