//! What the loop knows of the thing that was measured: parameters and conditions in, predicted signals out.

/// A number that a fit may change. Internally it is a coordinate in which the effect vanishes at a finite value.
#[derive(Debug, Clone, PartialEq)]
pub struct Free {
    /// Its name in reports and files.
    pub name: &'static str,
    /// Unit, empty for plain numbers.
    pub unit: &'static str,
    /// Coordinate at which it does nothing; none if it cannot switch its effect off.
    pub off: Option<f64>,
    /// Range of the coordinate.
    pub bounds: [f64; 2],
    /// A usual size of a change of the coordinate: the step of finite differences is a part of it.
    pub scale: f64,
    /// Whether the coordinate is 1/value.
    pub inverse: bool,
}

impl Free {
    /// The value that a coordinate stands for.
    pub fn value(&self, coordinate: f64) -> f64 {
        if !self.inverse {
            coordinate
        } else if coordinate == 0.0 {
            // Whatever the sign of zero: the side on which the bounds lie.
            if self.bounds[0] < 0.0 { f64::NEG_INFINITY } else { f64::INFINITY }
        } else {
            1.0 / coordinate
        }
    }
}

/// A cause that may be added to the model.
#[derive(Debug, Clone)]
pub struct Candidate {
    /// Its name. Forms of one cause, which exclude one another, share it.
    pub id: &'static str,
    /// Where it acts.
    pub kind: &'static str,
    /// The cause in a sentence.
    pub cause: &'static str,
    /// A constant of the nominal model: fitted before physics is blamed.
    pub is_constant: bool,
    /// What is fitted.
    pub parameters: Vec<Free>,
    /// Parameters that are given.
    pub fixed: Vec<(&'static str, f64)>,
    /// Coordinates to start from: one of them should be near enough.
    pub starts: Vec<Vec<f64>>,
}

/// A cause with coordinates.
#[derive(Debug, Clone, PartialEq)]
pub struct Term {
    /// Index of the candidate.
    pub candidate: usize,
    /// One coordinate per parameter.
    pub x: Vec<f64>,
}

/// A model: the nominal one with causes added, and its discretisation.
#[derive(Debug, Clone, PartialEq)]
pub struct Model {
    /// Causes beside the nominal model.
    pub terms: Vec<Term>,
    /// As in [`Plant::resolutions`].
    pub resolution: f64,
    /// Whether numbers are to be trusted to the last: half the time step.
    pub fine: bool,
}

/// One run as measured, without what is missing or was found to be damaged.
#[derive(Debug, Clone)]
pub struct Signal {
    /// Its name.
    pub id: String,
    /// Measured values, channel after channel.
    pub values: Vec<f64>,
    /// One standard deviation of each.
    pub sigmas: Vec<f64>,
    /// When (s).
    pub times: Vec<f64>,
    /// Which channel.
    pub channels: Vec<usize>,
    /// The input at that time, of the plant's first actuator.
    pub inputs: Vec<f64>,
}

/// A thing whose behaviour was measured in runs and can be predicted.
pub trait Plant: Sync {
    /// The measured runs.
    fn signals(&self) -> &[Signal];

    /// Names of the channels.
    fn channels(&self) -> Vec<String>;

    /// Unit of the signals.
    fn unit(&self) -> &'static str;

    /// All causes that may be tried.
    fn candidates(&self) -> &[Candidate];

    /// Discretisations from the nominal one (first) on, finer and finer; more than one if refining can matter.
    fn resolutions(&self) -> Vec<f64> {
        vec![1.0]
    }

    /// Number of nuisances that belong to a run and not to the model, such as moments of jumps between two samples. They lie between 0 and 1.
    fn nuisances(&self, _run: usize) -> usize {
        0
    }

    /// Whether a cause does more than what the discretisation leaves open.
    fn is_credible(&self, _term: &Term, _resolution: f64) -> bool {
        true
    }

    /// The signal of `run` as predicted by `model`, at the times and channels of the measured one.
    ///
    /// # Errors
    /// Why it cannot be predicted, in words.
    fn predict(&self, model: &Model, run: usize, nuisances: &[f64]) -> Result<Vec<f64>, String>;
}
