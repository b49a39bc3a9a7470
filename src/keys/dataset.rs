//! Keys of dataset files.

use super::Default::{Else, Is, Needed};
use super::Range::{Any, Between, Inside, Positive};
use super::Value::{Name, Number, Numbers, Other, Path, Text, Word};
use super::{File, Key, Section, experiment, key};
use crate::recording::definitions;

pub(super) static FILE: File = File {
    name: "dataset",
    about: "Measured data: the robot, the tracked points, and a file per run or single numbers. `sfers diagnose` reads it.",
    sections: &[
        DATASET,
        experiment::MATERIAL,
        experiment::ROBOT,
        experiment::FRICTION,
        experiment::MASS,
        MARKERS,
        NOISE,
        BENCH,
        CAMERA,
        COLUMNS,
        EFFECT,
        RUN,
        RELEASE,
        FREQUENCY_RESPONSE,
        STEADY,
        OBSERVATION,
        IDENTIFY,
        SEARCHED,
    ],
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

pub(super) const CAMERA: Section = Section {
    name: "camera",
    heading: "[camera]",
    about: "How frames become rows.",
    keys: &[
        key(
            "frame_rate_hz",
            Number(Between(0.0, 1e6)),
            Else("unknown"),
            "frames per second; a run's file may then have the column frame in place of t_s, with frame 0 at 0 s",
        ),
        key(
            "exposure_ms",
            Number(Between(0.0, 1e3)),
            Else("none"),
            "predictions are means over the exposure, in the middle of which t_s lies; at most the time between two frames",
        ),
    ],
};

pub(super) const COLUMNS: Section = Section {
    name: "columns",
    heading: "[columns]",
    about: "Columns that the files call otherwise or give in another unit, as exported by Tracker and the like: t_s = { from = \"t\" }, \
            tip_z_mm = { from = \"y\", factor = 1000 }. The keys of each:",
    keys: &[
        key("from", Text, Needed, "the column's name in the files"),
        key("factor", Number(Any), Is("1.0"), "the value is this, not 0, times the number in the file ..."),
        key("offset", Number(Any), Is("0.0"), "... plus this, in the unit of the key"),
    ],
};

const EFFECT: Section = Section {
    name: "effect",
    heading: "[[effect]]",
    about: "What is known to be there and belongs to the nominal model: an effect of the structure with its parameters, as in an experiment file, for \
            instance a fixed weight: id = \"tip-mass\", mass_g = 1.0, position_mm = 90.",
    keys: experiment::EFFECT.keys,
};

pub(super) const RELEASE: Section = Section {
    name: "run.release",
    heading: "[run.release]",
    about: "The shape that the run is let go from, at rest: one of hung_g, level, and held with held_z_mm. A robot with mount = \"ground\" is dropped from height_mm.",
    keys: &[
        key("hung_g", Number(Inside(0.0, 1e3)), Else("none"), "in equilibrium with a mass at the right end, which is cut off"),
        key("level", Other("true"), Else("none"), "all joints at zero angle ..."),
        key("height_mm", Number(Between(0.0, 1e3)), Is("0.0"), "... this high above the floor")
            .with("level = true and mount = \"ground\""),
        key("held", Text, Else("none"), "in equilibrium with this marker held by a vertical force ..."),
        key("held_z_mm", Number(Any), Else("none"), "... at this height above the left end"),
        key(
            "at_s",
            Number(Any),
            Else("the first row"),
            "when, on the clock of the run's file; rows before are left out, and it may lie before the first row",
        ),
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
            "voltage_file",
            Path,
            Else("in file"),
            "CSV of t_s, v1_v, v2_v, ... in rows of their own, where the voltage was logged apart from the camera; the run starts with it, and rows of the \
             camera outside of it are left out",
        ),
        key(
            "rate_v_per_s",
            Number(Positive),
            Else("needs t_s"),
            "for a slow loop of voltages and positions without t_s: the rate at which the voltage went from row to row; of several actuators, that of the \
             largest change",
        ),
        key(
            "role",
            Word(&["auto", "fit", "held-out"]),
            Is("\"auto\""),
            "fit: parameters are fitted to it; held-out: causes are selected on it, or, of several every other one, the result is judged by it; auto: the \
             program decides",
        ),
        key(
            "start",
            Word(&["settled", "released"]),
            Is("\"settled\""),
            "settled: at rest in equilibrium with gravity and the first voltages; released: at rest in the shape of [run.release], at 0 V if there is no \
             voltage",
        ),
        key("release", Other("a table"), Else("none"), "the shape that it is released from"),
        key(
            "robot",
            Other("a table"),
            Else("as above"),
            "replacements of keys of [robot], not of actuators, motors_per_actuator and mount",
        ),
        key(
            "material",
            Other("a table"),
            Else("as above"),
            "replacements of keys of [material], for instance of actuator_length_mm",
        ),
        key("markers", Other("a table"), Else("as above"), "replacements of positions of [markers]"),
        key("effect", Other("a list of tables"), Else("none"), "more [[effect]] tables, of this run only"),
    ],
};

pub(super) const FREQUENCY_RESPONSE: Section = Section {
    name: "frequency_response",
    heading: "[[frequency_response]]",
    about: "Amplitude and phase of one coordinate of a clamped robot under sines that all actuators share, when the vibration is steady. It counts as a run \
            of two channels, the parts in phase and in quadrature.",
    keys: &[
        key("id", Text, Needed, "unique name"),
        key(
            "file",
            Path,
            Needed,
            "its CSV: f_hz, rising; amplitude_mm, half of peak to peak; phase_deg or phase_rad, by which the coordinate leads the voltage: negative for a lag",
        ),
        key("coordinate", Text, Needed, "NAME_x or NAME_z of a marker"),
        key("amplitude_v", Number(Positive), Needed, "half of the peak-to-peak voltage"),
        key("offset_v", Number(Any), Is("0.0"), "mean voltage"),
        key("sigma_mm", Number(Positive), Needed, "one standard deviation of each part"),
        key("role", Word(&["auto", "fit", "held-out"]), Is("\"auto\""), "as of a run"),
    ],
};

pub(super) const STEADY: Section = Section {
    name: "steady",
    heading: "[[steady]]",
    about: "Markers of a clamped robot at rest under constant voltages: besides the keys below NAME_x_mm or NAME_z_mm = position, one at least. Each counts as \
            a run.",
    keys: &[
        key("voltages_v", Numbers, Needed, "one per actuator"),
        key("sigma_mm", Number(Positive), Else("[noise]"), "one standard deviation"),
        key("role", Word(&["auto", "fit", "held-out"]), Is("\"auto\""), "as of a run"),
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
        key(
            "role",
            Word(&["fit", "foretell"]),
            Is("\"fit\""),
            "with [identify]: constants are fitted to it, or it is foretold from the others",
        ),
    ],
};

pub(super) const IDENTIFY: Section = Section {
    name: "identify",
    heading: "[identify]",
    about: "Constants that are identified from the [[observation]] tables: searched globally, then locally, with ranges, ties and predictions.",
    keys: &[
        key("seed", Other("a whole number from 0 on"), Is("0"), "seed of the search"),
        key("vary", Other("a table"), Needed, "the constants: [identify.vary]"),
    ],
};

pub(super) const SEARCHED: Section = Section {
    name: "identify.vary.KEY",
    heading: "\"KEY\" = { ... } of [identify.vary]",
    about: "How one constant is searched: a key of an experiment file with dots and in quotes, as \"robot.friction.low\", or a parameter of an effect, as \"effect.stiffness.scale\". From and to, or values.",
    keys: &[
        key("from", Number(Any), Else("values"), "least value"),
        key("to", Number(Any), Else("values"), "largest value"),
        key("values", Numbers, Else("from and to"), "the only possible values"),
    ],
};
