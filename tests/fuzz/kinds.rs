//! The kinds of input, what an input is, and what becomes of one.

use std::path::Path;

use crate::random::Random;
use crate::{command, data, experiments, files, results, settings};

/// One input, as files and as words on a command line.
#[derive(Debug, Clone, Default)]
pub struct Input {
    /// Names and bytes.
    pub files: Vec<(String, Vec<u8>)>,
    /// Settings or arguments.
    pub words: Vec<String>,
}

impl Input {
    pub fn file(name: &str, bytes: impl Into<Vec<u8>>) -> Self {
        Self { files: vec![(name.into(), bytes.into())], words: Vec::new() }
    }

    /// The bytes of the first file.
    pub fn bytes(&self) -> &[u8] {
        &self.files[0].1
    }

    /// The first file as text; what is no UTF-8 is replaced, for the program refuses such files before any parser sees them.
    pub fn text(&self) -> String {
        String::from_utf8_lossy(self.bytes()).into_owned()
    }

    /// Writes all files into a folder.
    pub fn write(&self, folder: &Path) -> Result<(), String> {
        self.files
            .iter()
            .try_for_each(|(name, bytes)| std::fs::write(folder.join(name), bytes).map_err(|e| format!("harness: {e}")))
    }
}

/// What became of an input.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Fate {
    /// It was used, and all output was as it has to be.
    Accepted,
    /// It was refused with a message.
    Refused,
    /// It was taken, but the simulation failed, with a message.
    Failed,
}

/// What became of an input, or what went wrong.
pub type Outcome = Result<Fate, String>;

/// A refusal, which has to say something.
pub fn refused(error: &dyn std::fmt::Display) -> Outcome {
    if error.to_string().trim().is_empty() { Err("refused without a message".into()) } else { Ok(Fate::Refused) }
}

/// A failed simulation, which has to say something.
pub fn failed(error: &dyn std::fmt::Display) -> Outcome {
    refused(error).map(|_| Fate::Failed)
}

/// A kind of input.
pub struct Kind {
    pub name: &'static str,
    /// Its inputs among a thousand.
    pub share: u64,
    /// Makes an input.
    pub make: fn(&mut Random) -> Input,
    /// Gives it to the program, with an empty folder to work in.
    pub give: fn(&Input, &Path, &mut Random) -> Outcome,
}

/// All kinds.
pub static KINDS: &[Kind] = &[
    Kind { name: "experiment", share: 150, make: experiments::make, give: experiments::give },
    Kind { name: "settings", share: 120, make: settings::make, give: experiments::give },
    Kind { name: "sweep", share: 80, make: results::make_sweep, give: results::give_sweep },
    Kind { name: "dataset", share: 80, make: data::make_dataset, give: data::give_dataset },
    Kind { name: "measured-run", share: 120, make: data::make_run, give: data::give_dataset },
    Kind { name: "drive-table", share: 120, make: data::make_drive, give: data::give_drive },
    Kind { name: "recording", share: 110, make: files::make_recording, give: files::give_recording },
    Kind { name: "recording-table", share: 60, make: files::make_table, give: files::give_table },
    Kind { name: "results", share: 80, make: results::make_results, give: results::give_results },
    Kind { name: "urdf", share: 60, make: files::make_urdf, give: files::give_urdf },
    Kind { name: "saved-state", share: 40, make: files::make_state, give: files::give_state },
    Kind { name: "export", share: 20, make: experiments::make, give: experiments::give_export },
    Kind { name: "command", share: 10, make: command::make, give: command::give },
];

/// Inputs that go wrong in a known way each, to see that the supervisor finds them. Every seventh case does.
pub static PLANTED: &[Kind] = &[
    Kind {
        name: "planted-panic",
        share: 0,
        make: planted,
        give: |_, _, r| Ok(if r.once_in(7) { panic!("planted") } else { Fate::Accepted }),
    },
    Kind {
        name: "planted-hang",
        share: 0,
        make: planted,
        give: |_, _, r| {
            while r.once_in(7) {
                std::thread::sleep(std::time::Duration::from_secs(60));
            }
            Ok(Fate::Refused)
        },
    },
    Kind {
        name: "planted-abort",
        share: 0,
        make: planted,
        give: |_, _, r| if r.once_in(7) { std::process::abort() } else { Ok(Fate::Accepted) },
    },
    Kind {
        name: "planted-memory",
        share: 0,
        make: planted,
        give: |_, _, r| {
            if r.once_in(7) {
                std::hint::black_box(vec![1_u8; 3 << 30]);
            }
            Ok(Fate::Accepted)
        },
    },
    Kind {
        name: "planted-number",
        share: 0,
        make: planted,
        give: |_, _, r| crate::outputs::finite("planted", &[if r.once_in(7) { f64::NAN } else { 1.0 }]).map(|()| Fate::Failed),
    },
];

fn planted(_: &mut Random) -> Input {
    Input::file("nothing", "")
}
