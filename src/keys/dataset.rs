//! Keys of dataset files.

use super::Default::{Else, Is, Needed};
use super::Range::{Any, Between, Positive};
use super::Value::{Name, Number, Other, Path, Text, Word};
use super::{File, Key, Section, experiment, key};
use crate::recording::definitions;

pub(super) static FILE: File = File {
    name: "dataset",
    about: "Measured data: the robot, the tracked points, and a file per run or single numbers. `sfers diagnose` reads it.",
    sections: &[DATASET, experiment::MATERIAL, experiment::ROBOT, experiment::FRICTION, MARKERS, NOISE, BENCH, RUN, OBSERVATION],
};

pub(super) const DATASET: Section = Section {
    name: "dataset",
    heading: "[dataset]",
    about: "Name of the data.",
    keys: &[key("name", Text, Else("the file's name"), "name of the data"), key("about", Text, Is("\"\""), "short description")],
};

const MARKERS: Section = Section {
    name: "markers",
    heading: "[markers]",
    about: "The tracked points: any name = distance from the left end along the robot, in mm. A run's columns are NAME_x_mm and NAME_z_mm.",
    keys: &[],
};

const NOISE: Section = Section {
    name: "noise",
    heading: "[noise]",
    about: "One standard deviation of the tracking, estimated from the data where it is absent. For single markers: MARKER_mm.",
    keys: &[DEFAULT_NOISE],
};

pub(super) const DEFAULT_NOISE: Key =
    key("default_mm", Number(Positive), Else("estimated"), "of all markers without a value of their own");

pub(super) const BENCH: Section = Section {
    name: "bench",
    heading: "[bench]",
    about: "How much the bench differs from run to run, one standard deviation each. What is absent is estimated where the data ask for it; 0 means that \
            it does not differ.",
    keys: &[
        key("clock_ms", Number(Between(0.0, 1e3)), Else("estimated"), "offset between the clocks of camera and voltage"),
        key("zero_mm", Number(Between(0.0, 1e3)), Else("estimated"), "zero of every coordinate"),
        key("gain", Number(Between(0.0, 1.0)), Else("estimated"), "gain of the motion, as a share"),
        key("drift_mm_per_s", Number(Between(0.0, 1e3)), Else("estimated"), "drift of every coordinate"),
    ],
};

pub(super) const RUN: Section = Section {
    name: "run",
    heading: "[[run]]",
    about: "One run as measured.",
    keys: &[
        key("id", Text, Needed, "unique name"),
        key(
            "file",
            Path,
            Needed,
            "its CSV: t_s, v1_v, v2_v, ..., and NAME_x_mm or NAME_z_mm of markers; empty cells are missing values",
        ),
        key(
            "role",
            Word(&["auto", "fit", "held-out"]),
            Is("\"auto\""),
            "fit: parameters are fitted to it; held-out: models are judged by it; auto: the program decides",
        ),
    ],
};

pub(super) const OBSERVATION: Section = Section {
    name: "observation",
    heading: "[[observation]]",
    about: "A single measured number instead of a time series.",
    keys: &[
        key("measure", Name("measure", definitions::names), Needed, "name of the measure"),
        key("value", Number(Any), Needed, "its value, in the measure's unit"),
        key("sigma", Number(Positive), Needed, "one standard deviation"),
        key("drive", Other("a table"), Needed, "the drive of the measurement: the keys of [drive] in an experiment file"),
        key("robot", Other("a table"), Else("as above"), "replacements of keys of [robot]"),
        key("material", Other("a table"), Else("as above"), "replacements of keys of [material]"),
        key(
            "simulation",
            Other("a table"),
            Else("2 s on the planar engine in steps of 0.2 ms"),
            "the keys of [simulation] in an experiment file",
        ),
    ],
};
