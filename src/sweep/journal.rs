//! Who computed the rows of a file, where and in what time: a line when a process begins with the file and one when it ends, between the rows.

use std::time::Instant;

use serde::{Deserialize, Serialize};

use super::shard;
use crate::date;

/// This program: results may change with its revision and with Bullet's version.
pub const PROGRAM: &str =
    concat!("sfers ", env!("CARGO_PKG_VERSION"), ", revision ", env!("SFERS_GIT_REVISION"), ", Bullet ", env!("SFERS_BULLET"));

/// The beginning of a process's work.
#[derive(Debug, Clone, PartialEq, Deserialize, Serialize)]
pub struct Begin {
    /// Time since 1970 (s).
    pub begin_unix_s: u64,
    /// Name of the machine.
    pub host: String,
    /// Version, revision and Bullet of the program.
    pub program: String,
    /// Number of threads.
    pub jobs: usize,
    /// The scheduler's name of the job, as `slurm 123_4`; `None` outside one.
    pub scheduler_job: Option<String>,
}

/// Its end, unless it was killed.
#[derive(Debug, Clone, PartialEq, Deserialize, Serialize)]
pub struct End {
    /// Time since 1970 (s).
    pub end_unix_s: u64,
    /// Number of rows that it wrote.
    pub computed: usize,
    /// Time from beginning to end (s).
    pub wall_s: f64,
    /// Processor time of the process in between, all threads (s); `None` where the system does not tell.
    pub core_s: Option<f64>,
}

/// A line between rows.
#[derive(Debug, Clone, PartialEq, Deserialize, Serialize)]
#[serde(untagged)]
pub enum Note {
    /// `Begin`.
    Begin(Begin),
    /// `End`.
    End(End),
}

impl Note {
    /// The line, with its end.
    pub(super) fn line(&self) -> String {
        format!("# {}\n", serde_json::json!(self))
    }

    /// Reads a line without its end; `None` if it is none.
    pub(super) fn parse(line: &[u8]) -> Option<Self> {
        serde_json::from_slice(line.strip_prefix(b"# ")?).ok()
    }
}

/// One process's work on a file, from now on.
#[derive(Debug)]
pub(super) struct Session {
    start: Instant,
    core_s: Option<f64>,
}

impl Session {
    /// Begins now.
    pub(super) fn begin(jobs: usize) -> (Self, Note) {
        let note = Begin {
            begin_unix_s: date::now().seconds,
            host: host(),
            program: PROGRAM.into(),
            jobs,
            scheduler_job: shard::scheduler_job(&|name| std::env::var(name).ok()),
        };
        (Self { start: Instant::now(), core_s: core_s() }, Note::Begin(note))
    }

    /// Ends now, after `computed` rows.
    pub(super) fn end(&self, computed: usize) -> Note {
        Note::End(End {
            end_unix_s: date::now().seconds,
            computed,
            wall_s: self.start.elapsed().as_secs_f64(),
            core_s: core_s().zip(self.core_s).map(|(now, before)| now - before),
        })
    }
}

/// Name of this machine.
#[cfg(unix)]
pub(super) fn host() -> String {
    rustix::system::uname().nodename().to_string_lossy().into_owned()
}

/// Processor time of this process (s).
#[cfg(unix)]
fn core_s() -> Option<f64> {
    let time = rustix::time::clock_gettime(rustix::time::ClockId::ProcessCPUTime);
    Some(time.tv_sec as f64 + 1e-9 * time.tv_nsec as f64)
}

#[cfg(not(unix))]
pub(super) fn host() -> String {
    std::env::var("COMPUTERNAME").unwrap_or_default()
}

#[cfg(not(unix))]
fn core_s() -> Option<f64> {
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_is_read_as_it_was_written_and_nothing_else_is_a_note() {
        let (session, begin) = Session::begin(3);
        let end = session.end(7);
        for note in [begin, end] {
            let line = note.line();
            assert_eq!(Note::parse(line.trim_end().as_bytes()), Some(note));
        }
        for line in ["", "#", "# {}", "1,2,ok,00000000", "# {\"begin_unix_s\": 1}"] {
            assert_eq!(Note::parse(line.as_bytes()), None, "{line}");
        }
    }
}
