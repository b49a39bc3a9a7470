//! A measured system with its model: parameters in, predicted signals out.

use super::DiagnoseError;
use super::bench::{self, Spread};

/// A fitted parameter. The fit uses a coordinate, the value or its inverse, in which the effect vanishes at a finite point.
#[derive(Debug, Clone, PartialEq)]
pub struct Free {
    /// Its name in reports and files.
    pub name: &'static str,
    /// Unit of the value; empty for dimensionless ones.
    pub unit: &'static str,
    /// Coordinate at which the effect vanishes; none if the parameter cannot switch it off.
    pub off: Option<f64>,
    /// Range of the coordinate.
    pub bounds: [f64; 2],
    /// Typical change of the coordinate, to which the step of finite differences is proportional.
    pub scale: f64,
    /// True if the coordinate is 1/value.
    pub inverse: bool,
}

impl Free {
    /// The value at a coordinate.
    pub fn value(&self, coordinate: f64) -> f64 {
        if !self.inverse {
            coordinate
        } else if coordinate == 0.0 {
            // The sign is that of the bounds, not of the zero.
            if self.bounds[0] < 0.0 { f64::NEG_INFINITY } else { f64::INFINITY }
        } else {
            1.0 / coordinate
        }
    }

    /// True if a coordinate is at an end of its range.
    pub fn is_at_bound(&self, coordinate: f64) -> bool {
        coordinate <= self.bounds[0] || coordinate >= self.bounds[1]
    }
}

/// A cause that may be added to the model.
#[derive(Debug, Clone)]
pub struct Candidate {
    /// Its name, shared by the mutually exclusive forms of a cause.
    pub id: &'static str,
    /// Where it acts.
    pub kind: &'static str,
    /// The cause in a sentence.
    pub cause: &'static str,
    /// Places of the model where it acts, the first one at home: names of one place are rivals.
    pub places: Vec<&'static str>,
    /// True for a free form: no law, but a curve that shows which law is missing at its place. Named candidates of the place are tried in its stead.
    pub is_free_form: bool,
    /// True for another law of a cause, with a parameter for its shape: tried in the stead of what was found at its place, not in the search.
    pub is_variant: bool,
    /// True for a constant of the nominal model, which is fitted before other causes are tried.
    pub is_constant: bool,
    /// Fitted parameters.
    pub parameters: Vec<Free>,
    /// Given parameters: name and value.
    pub fixed: Vec<(&'static str, f64)>,
    /// Starting coordinates, starts × parameters; the fit should converge from one of them.
    pub starts: Vec<Vec<f64>>,
}

/// A candidate with coordinates.
#[derive(Debug, Clone, PartialEq)]
pub struct Term {
    /// Index into [`Plant::candidates`].
    pub candidate: usize,
    /// One coordinate per parameter.
    pub x: Vec<f64>,
}

impl Term {
    /// The bits of all that a prediction depends on in it.
    pub(super) fn bits(&self) -> impl Iterator<Item = u64> {
        [self.candidate as u64, self.x.len() as u64].into_iter().chain(self.x.iter().map(|x| x.to_bits()))
    }
}

/// The curve that a free form stands for.
#[derive(Debug, Clone, PartialEq)]
pub struct FreeCurve {
    /// Name and unit of the abscissa; the unit is empty for dimensionless ones.
    pub x: [&'static str; 2],
    /// Name and unit of the ordinate.
    pub y: [&'static str; 2],
    /// Its points.
    pub points: Vec<[f64; 2]>,
}

/// What differs from run to run and is not part of the model.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Nuisance {
    /// [`Plant::nuisances`] numbers between 0 and 1.
    pub shares: Vec<f64>,
    /// Clock of the signals ahead of that of the inputs (s), rate of the signals' clock over that of the inputs, less 1 (–), and gain of the inputs,
    /// less 1 (–): the kinds of [`bench::BASED`].
    pub base: [f64; bench::BASED],
}

impl Nuisance {
    /// The time (s) at which a value at `t` (s) is predicted.
    pub fn time(&self, t: f64) -> f64 {
        t + self.base[Spread::RATE] * t + self.base[Spread::CLOCK]
    }
}

/// The nominal model with causes added, and its discretisation.
#[derive(Debug, Clone, PartialEq)]
pub struct Model {
    /// Causes added to the nominal model.
    pub terms: Vec<Term>,
    /// One of [`Plant::resolutions`].
    pub resolution: f64,
    /// True for half the time step, as in the final refit.
    pub fine: bool,
    /// Spread of the bench's faults between runs.
    pub spread: Spread,
}

impl Model {
    /// A model without faults of the bench.
    pub fn new(terms: Vec<Term>, resolution: f64, fine: bool) -> Self {
        Self { terms, resolution, fine, spread: Spread::default() }
    }
}

/// A measured run without missing and unusable values.
#[derive(Debug, Clone, Default)]
pub struct Signal {
    /// Its name.
    pub id: String,
    /// Measured values, in the plant's unit, channel after channel.
    pub values: Vec<f64>,
    /// Standard deviation of each value, in the plant's unit.
    pub sigmas: Vec<f64>,
    /// Time of each value (s).
    pub times: Vec<f64>,
    /// Channel of each value.
    pub channels: Vec<usize>,
    /// Input of the first actuator at the time of each value (V for robots).
    pub inputs: Vec<f64>,
    /// True for a frequency response: `times` are frequencies (Hz), and the noise is white, of the given level.
    pub is_spectrum: bool,
}

/// A system that was measured in runs and can be simulated.
pub trait Plant: Sync {
    /// The measured runs.
    fn signals(&self) -> &[Signal];

    /// Names of the channels.
    fn channels(&self) -> Vec<String>;

    /// Unit of all signals.
    fn unit(&self) -> &'static str;

    /// All candidate causes.
    fn candidates(&self) -> &[Candidate];

    /// Discretisations (elements or joints) in rising order, the nominal one first; one where refinement does not matter.
    fn resolutions(&self) -> Vec<f64> {
        vec![1.0]
    }

    /// Number of nuisance parameters of a run, such as times of jumps between two samples. Each lies between 0 and 1.
    fn nuisances(&self, _run: usize) -> usize {
        0
    }

    /// What a prediction of a run by `model` costs, in any unit: a search ends after some thousand times what all runs cost without causes.
    fn work(&self, _model: &Model, _run: usize) -> u64 {
        1
    }

    /// True for a run that moves under a constant input, as one that is released from another shape than its equilibrium.
    fn moves_unaided(&self, _run: usize) -> bool {
        false
    }

    /// Standard deviations of the bench's faults that are known, in the order of [`Spread::of`]; the others are estimated.
    fn bench(&self) -> [Option<f64>; bench::KINDS] {
        [None; bench::KINDS]
    }

    /// True if a run can have faults of a kind, an index of [`Spread::of`]; one without times of its own has no clock and no drift.
    fn has_fault(&self, _run: usize, _kind: usize) -> bool {
        true
    }

    /// True if a term exceeds the error of the discretisation.
    fn is_credible(&self, _term: &Term, _resolution: f64) -> bool {
        true
    }

    /// True if the value of term `index` is a matter of convention beside the others of a model that leaves `left` (χ² per value above 1): it is no cause of
    /// its own then.
    fn is_convention(&self, _terms: &[Term], _index: usize, _left: f64) -> bool {
        false
    }

    /// The curve of a term that is a free form; none of a named cause.
    fn curve(&self, _term: &Term) -> Option<FreeCurve> {
        None
    }

    /// The place of a cause in a sentence.
    fn place_in_words(&self, place: &str) -> String {
        place.replace('-', " ")
    }

    /// The values that `model` predicts for `run`, in the order and unit of [`Signal::values`]. What a plant ignores of
    /// [`Nuisance::base`], such as clocks where the inputs are not known between the rows, is no nuisance parameter of its runs.
    ///
    /// # Errors
    /// [`DiagnoseError`] if the model cannot be simulated; [`DiagnoseError::Plant`] takes any error or text.
    fn predict(&self, model: &Model, run: usize, nuisance: &Nuisance) -> Result<Vec<f64>, DiagnoseError>;
}
