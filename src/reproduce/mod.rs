//! Reproduction of the paper's results: for each study a table and a figure, on one page.
//!
//! Runs are on the planar engine; every study repeats some of them on Bullet.

mod bench;
mod cantilever;
mod findings;
mod jumping;
mod page;
mod speeds;
mod walking;

pub use bench::Bench;
pub use findings::{Comparison, Findings, Origin, Published};
pub use page::{page, table};

use thiserror::Error;

use crate::engine::EngineError;
use crate::experiment::ConfigError;
use crate::sweep::RowError;
use bench::curve;

/// Accuracy of a study.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Effort {
    /// Results to 1 %.
    Quick,
    /// Results to 0.1 %.
    Full,
}

impl Effort {
    /// Largest relative change of a result with a tighter tolerance of the adaptive steps (–).
    pub const fn step_error(self) -> f64 {
        match self {
            Self::Quick => 1e-2,
            Self::Full => 1e-3,
        }
    }
}

/// A failure of a study.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum StudyError {
    /// A built-in experiment is invalid, which is a fault of this program.
    #[error("{0}; please report this")]
    Config(#[from] ConfigError),
    /// A simulation failed.
    #[error("{0}")]
    Engine(#[from] EngineError),
    /// A run gives no measures.
    #[error("{0}")]
    Trouble(String),
    /// Rows of a sweep could not be read or written.
    #[error("{0}")]
    Rows(#[from] RowError),
    /// The user stopped the study.
    #[error("interrupted")]
    Interrupted,
}

/// One result of the paper.
#[derive(Clone, Copy)]
pub struct Study {
    /// Name on the command line.
    pub id: &'static str,
    /// Title.
    pub title: &'static str,
    /// Section of the paper.
    pub section: &'static str,
    /// Processor time (s) of the quick and of the full study, mostly on Bullet.
    pub cost_s: [f64; 2],
    run: fn(&Bench) -> Result<Findings, StudyError>,
}

impl Study {
    /// Runs the study.
    ///
    /// # Errors
    /// [`StudyError`] if a run or sweep fails, gives no measures or is interrupted.
    pub fn run(&self, bench: &Bench) -> Result<Findings, StudyError> {
        (self.run)(bench)
    }
}

/// All studies, in the paper's order.
pub const STUDIES: [Study; 10] = [
    Study {
        id: "cantilever-shapes",
        title: "Static shapes of the cantilever",
        section: "III-A",
        cost_s: [1.0, 1.0],
        run: cantilever::shapes,
    },
    Study {
        id: "cantilever-response",
        title: "Frequency response of the cantilever",
        section: "III-A",
        cost_s: [8.0, 11.0],
        run: cantilever::response,
    },
    Study {
        id: "cantilever-damping",
        title: "Damping from the step response",
        section: "III-A",
        cost_s: [1.0, 1.0],
        run: cantilever::damping,
    },
    Study {
        id: "robot-shapes",
        title: "Static shapes of the five-actuator robot",
        section: "III-B",
        cost_s: [4.0, 4.0],
        run: walking::shapes,
    },
    Study {
        id: "inchworm",
        title: "Inchworm motion over five cycles",
        section: "III-B",
        cost_s: [27.0, 27.0],
        run: walking::inchworm,
    },
    Study { id: "jump-14hz", title: "In-place jumping at 14 Hz", section: "III-C", cost_s: [3.0, 3.0], run: jumping::at_14_hz },
    Study {
        id: "key-shapes-14hz",
        title: "The three key shapes at 14 Hz",
        section: "III-C",
        cost_s: [3.0, 3.0],
        run: jumping::key_shapes,
    },
    Study {
        id: "jump-frequency",
        title: "Jump height against frequency",
        section: "III-C",
        cost_s: [9.0, 10.0],
        run: jumping::over_frequency,
    },
    Study {
        id: "jump-on-time",
        title: "Jump height against on-time",
        section: "authors' notebook",
        cost_s: [15.0, 15.0],
        run: jumping::over_on_time,
    },
    Study { id: "speed", title: "Speed against frequency", section: "IV", cost_s: [54.0, 58.0], run: speeds::speed },
];
