//! Keys of sweep files.

use super::Default::{Else, Needed};
use super::Value::{Names, Number, Other, Text, Whole};
use super::{File, Range, Section, key};
use crate::recording::definitions;

pub(super) static FILE: File = File {
    name: "sweep",
    about: "Many runs of one experiment over a grid of values. `sfers sweep` reads it.",
    sections: &[TOP, VARY, RANGE],
};

pub(super) const TOP: Section = Section {
    name: "",
    heading: "above all tables",
    about: "Experiment, measures and varied keys.",
    keys: &[
        key("experiment", Text, Needed, "the experiment file, relative to the sweep file, or \"preset:NAME\""),
        key("measures", Names("measure", definitions::names), Needed, "names of the measures, one column each"),
        key("vary", Other("a table"), Needed, "varied keys: [vary]"),
        key(
            "ensemble",
            Other("a table"),
            Else("the experiment's"),
            "perturbations of every point: [ensemble] as in an experiment file",
        ),
    ],
};

const VARY: Section = Section {
    name: "vary",
    heading: "[vary]",
    about: "The grid, the last key fastest; at most 10000000 points. Its keys are those of the experiment file with dots, in quotes: \
            \"robot.damping_eta\" = [0.008, 0.045]. Each has a list of values, or a range:",
    keys: &[],
};

pub(super) const RANGE: Section = Section {
    name: "vary.KEY",
    heading: "\"KEY\" = { from = ..., to = ..., count = ... } of [vary]",
    about: "Evenly spaced values; both ends belong to them.",
    keys: &[
        key("from", Number(Range::Any), Needed, "first value, in the unit of the key"),
        key("to", Number(Range::Any), Needed, "last value"),
        key("count", Whole(Range::Between(1.0, 1e7)), Needed, "number of values"),
    ],
};
