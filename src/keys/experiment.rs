//! Keys of experiment files.

use super::Default::{Else, Is, Needed, OfPreset};
use super::Range::{Any, Between, Inside, NotNegative, Positive};
use super::Value::{Name, Number, Numbers, Other, Path, Text, Whole, Word};
use super::{File, Section, key};
use crate::drive::gait::GAITS;
use crate::effects::EFFECTS;
use crate::recording::definitions;

pub(super) static FILE: File = File {
    name: "experiment",
    about: "One robot, its drive and its simulation. `sfers run`, `animate`, `urdf`, `mjcf` and `crosscheck` read it.",
    sections: &[MATERIAL, ROBOT, FRICTION, MASS, DRIVE, PHASES, SIMULATION, EFFECT, ENSEMBLE, PERTURBATION],
};

pub(super) const MATERIAL: Section = Section {
    name: "material",
    heading: "[material]",
    about: "One actuator: a piezo layer glued onto a substrate. The preset gives every constant, and each key replaces one of them.",
    keys: &[
        key(
            "preset",
            Word(&["parameter-2", "parameter-4"]),
            Is("\"parameter-2\""),
            "which published set of constants: parameter-2 matches the published deflection, parameter-4 the published resonance",
        ),
        key("actuator_length_mm", Number(Positive), OfPreset("100", "100"), "length of one actuator"),
        key("width_mm", Number(Positive), OfPreset("20", "20"), "width"),
        key("gravity_m_s2", Number(NotNegative), OfPreset("9.8", "9.8"), "gravity, downwards"),
        key("piezo_modulus_gpa", Number(Positive), OfPreset("30", "30.336"), "Young's modulus of the piezo layer"),
        key("piezo_poisson", Number(Between(0.0, 0.5)), OfPreset("0.31", "0.31"), "Poisson's ratio of the piezo layer"),
        key("piezo_thickness_um", Number(Positive), OfPreset("300", "294"), "thickness of the piezo layer"),
        key("piezo_density_g_cm3", Number(Positive), OfPreset("6.6", "3.2"), "density of the piezo layer"),
        key("d33_pm_per_v", Number(NotNegative), OfPreset("370", "460"), "piezoelectric charge constant d33"),
        key(
            "electrode_pitch_mm",
            Number(Positive),
            OfPreset("0.5", "0.5"),
            "distance between neighbouring electrodes: field = voltage / pitch",
        ),
        key("substrate_modulus_gpa", Number(Positive), OfPreset("190", "203"), "Young's modulus of the substrate"),
        key("substrate_poisson", Number(Between(0.0, 0.5)), OfPreset("0.27", "0.27"), "Poisson's ratio of the substrate"),
        key("substrate_thickness_um", Number(Positive), OfPreset("50.8", "50.8"), "thickness of the substrate"),
        key("substrate_density_g_cm3", Number(Positive), OfPreset("8.1", "7.85"), "density of the substrate"),
        key(
            "adhesive_modulus_gpa",
            Number(NotNegative),
            OfPreset("1.489", "1.489"),
            "modulus of the adhesive, already that of plane strain",
        ),
        key("adhesive_thickness_um", Number(NotNegative), OfPreset("10", "10"), "thickness of the adhesive; 0 leaves two layers"),
        key("adhesive_density_g_cm3", Number(NotNegative), OfPreset("1.07", "1.07"), "density of the adhesive"),
        key(
            "max_field_kv_mm",
            Number(Positive),
            OfPreset("4", "4"),
            "largest field: voltages above this times electrode_pitch_mm are refused (2000 V over 0.5 mm)",
        ),
        key(
            "max_strain",
            Number(Positive),
            OfPreset("0.006", "0.006"),
            "largest strain of the laminate's outer fibre by bending: above it a run warns, above twice it gives no measures",
        ),
    ],
};

pub(super) const ROBOT: Section = Section {
    name: "robot",
    heading: "[robot]",
    about: "Actuators in a row, each made of motor-link units.",
    keys: &[
        key("actuators", Whole(Between(1.0, 10_000.0)), Is("5"), "number of actuators N"),
        key(
            "motors_per_actuator",
            Whole(Between(1.0, 10_000.0)),
            Is("3"),
            "joints per actuator m; the robot has N m joints, at most 10000, and N m + 1 links",
        ),
        key(
            "mount",
            Word(&["ground", "clamped", "free"]),
            Is("\"ground\""),
            "lying on a floor; left end held, no floor; or neither",
        ),
        key(
            "damping_eta",
            Number(NotNegative),
            Is("0.045"),
            "damping of the joints as the reference's dampingEta; either this or damping_time_s",
        ),
        key(
            "damping_time_s",
            Number(NotNegative),
            Else("from damping_eta"),
            "damping of the joints as the time η of the torque law: dampingEta = 2π η · 1 Hz",
        ),
        key(
            "collision_thickness_mm",
            Number(Positive),
            Is("1.0"),
            "thickness of the collision boxes; it sets contact and inertia",
        ),
        key(
            "positive_gain",
            Number(Positive),
            Is("1.0"),
            "factor on positive voltages before the torque law; 1.733 for the voltages applied to the published robot",
        ),
        key("friction", Other("a table"), Else("see below"), "coefficients of friction: [robot.friction]"),
        key("mass", Other("a list of tables"), Else("no payload"), "payloads: [[robot.mass]]"),
    ],
};

pub(super) const MASS: Section = Section {
    name: "robot.mass",
    heading: "[[robot.mass]]",
    about: "Zero or more payloads, each a mass at a point of the sheet's centre line.",
    keys: &[
        key("position_mm", Number(NotNegative), Needed, "distance from the left end along the sheet"),
        key("mass_g", Number(NotNegative), Needed, "mass"),
    ],
};

pub(super) const FRICTION: Section = Section {
    name: "robot.friction",
    heading: "[robot.friction]",
    about: "Coefficients of friction. A contact has the floor's times the link's.",
    keys: &[
        key("ground", Number(NotNegative), Is("1.0"), "coefficient of the floor"),
        key("low", Number(NotNegative), Is("0.2"), "coefficient of the bare robot"),
        key("high", Number(NotNegative), Is("4.0"), "coefficient of the films"),
        key("film", Word(&["both-ends", "right-end", "none"]), Is("\"both-ends\""), "where films are glued under the robot"),
        key("film_fraction", Number(NotNegative), Is("0.5"), "length of a film as a share of one actuator"),
    ],
};

pub(super) const DRIVE: Section = Section {
    name: "drive",
    heading: "[drive]",
    about: "The voltages: one waveform with the keys that belong to it. A positive voltage bends an actuator's right end up.",
    keys: &[
        key(
            "waveform",
            Word(&["gait", "dc", "sine", "step", "sequence", "csv"]),
            Needed,
            "gait: a named sequence of five actuators; dc: constant; sine: V = amplitude/2 (1 - cos 2πft); step: 0 V, then constant; sequence: phases of constant voltages; csv: a table, linear between rows",
        ),
        key("gait", Name("gait", gaits), Needed, "name of the gait").with("waveform gait"),
        key(
            "period_s",
            Number(Positive),
            Else("gait: needed by gaits with a period; sequence: the phases are passed once"),
            "period; either this or frequency_hz",
        )
        .with("waveform gait, sequence"),
        key("frequency_hz", Number(Positive), Else("sine: needed; gait, sequence: from period_s"), "frequency")
            .with("waveform gait, sine, sequence"),
        key(
            "delay_s",
            Number(Any),
            Else("the gait's own, if it has one"),
            "delay between the parts of gaits that take one; jumper-delay takes negative ones too",
        )
        .with("waveform gait"),
        key(
            "on_time_s",
            Number(NotNegative),
            Else("the gait's own, if it has one"),
            "how long the voltage is on, for gaits that take it",
        )
        .with("waveform gait"),
        key(
            "on_voltages_v",
            Numbers,
            Is("[520.0, 520.0, -1500.0, 520.0, 520.0]"),
            "voltage of each actuator when it is on; needed by sequences with masks for robots that have not 5 actuators",
        )
        .with("waveform gait, sequence"),
        key("voltages_v", Numbers, Needed, "voltage of each actuator").with("waveform dc, step"),
        key("amplitude_v", Number(Any), Else("amplitudes_v is needed"), "largest voltage, the same for every actuator")
            .with("waveform sine"),
        key("amplitudes_v", Numbers, Else("amplitude_v is needed"), "largest voltage of each actuator").with("waveform sine"),
        key("at_s", Number(Any), Is("0.0"), "when the step comes; on Bullet not before two time steps, as in the reference")
            .with("waveform step"),
        key(
            "phases",
            Other("a list of tables"),
            Needed,
            "the phases in order: phases = [{ until_s = 0.01, on = \"01110\" }, ...]",
        )
        .with("waveform sequence"),
        key("file", Path, Needed, "the table: t_s, v1_v, v2_v, ...; its ends are held").with("waveform csv"),
    ],
};

fn gaits() -> Vec<&'static str> {
    GAITS.iter().map(|gait| gait.name).collect()
}

fn effects() -> Vec<&'static str> {
    EFFECTS.iter().map(|effect| effect.id).collect()
}

pub(super) const PHASES: Section = Section {
    name: "drive.phases",
    heading: "phases = [{ ... }] of [drive]",
    about: "One phase of a sequence. The last one may go without an end: its voltages hold.",
    keys: &[
        key("until", Number(Positive), Else("until_s, or the end"), "end as a share of the period"),
        key("until_s", Number(Positive), Else("until, or the end"), "end as a time"),
        key(
            "on",
            Text,
            Else("voltages_v is needed"),
            "a mask of 0 and 1, one per actuator: those of 1 get their on_voltages_v, the others 0 V",
        ),
        key("voltages_v", Numbers, Else("on is needed"), "voltage of each actuator"),
    ],
};

pub(super) const SIMULATION: Section = Section {
    name: "simulation",
    heading: "[simulation]",
    about: "Engine, time steps, duration and records.",
    keys: &[
        key("engine", Word(&["bullet", "planar"]), Is("\"bullet\""), "bullet: bit for bit the reference; planar: the fast one. In sweeps the default is planar"),
        key("start", Word(&["flat", "settled"]), Is("\"flat\""), "flat and at rest; or in equilibrium with gravity, floor and first voltages (planar engine)"),
        key("friction", Word(&["coulomb", "convex"]), Is("\"coulomb\""), "law of friction: coulomb is solved in every step; convex, a relaxation, lifts sliding contacts by friction times speed times time step").with("engine = \"planar\""),
        key("numerical_damping_per_s", Number(NotNegative), Else("50"), "weight of a step's end over that of its start, per time step: damps oscillations between steps; less is more accurate without contact").with("engine = \"planar\""),
        key("velocity_limit", Number(Positive), Is("100.0"), "Bullet's limit on every velocity: cm/s of the base, rad/s of base and joints").with("engine = \"bullet\""),
        key("joint_angles_rad", Numbers, Else("0 for every joint"), "angle of every joint at the beginning, from the left; the robot begins level at its left end and touches the floor with its lowest point; with start = \"flat\""),
        key("time_step_s", Other("a number from 1e-12 to 1000, or \"auto\" on the planar engine"), Needed, "time step; \"auto\": adaptive steps, with tolerances refined until the result changes by less than step_error"),
        key("step_error", Number(Inside(0.0, 1.0)), Is("0.001"), "relative change of the result that a ten times tighter tolerance may make").with("time_step_s = \"auto\""),
        key("step_measure", Name("measure", definitions::names), Else("the path of all nodes"), "name of the measure that sets the tolerance").with("time_step_s = \"auto\""),
        key("steps", Whole(Positive), Else("duration_s is needed"), "number of steps"),
        key("duration_s", Number(Positive), Else("steps is needed"), "length of the run"),
        key("record_every_steps", Whole(Positive), Else("about a thousand records"), "steps from one record to the next; the first and last step are always recorded"),
        key("record_every_s", Number(Positive), Else("from record_every_steps"), "time from one record to the next"),
        key("record_from_step", Other("a whole number from 0 on"), Else("one less than the steps between records"), "step before which the first regular record is taken: 0 records at whole multiples of the interval"),
    ],
};

/// The other keys are the parameters of the effects.
pub(super) const EFFECT: Section = Section {
    name: "effect",
    heading: "[[effect]]",
    about: "Zero or more extensions of the model, each with its parameters as further keys: `sfers effects` lists them with units, ranges and defaults; numbered ones, as moment_1_mn_m to moment_5_mn_m, may be given as a list under the key without the number, moment_mn_m = [0.1, 0.2, 0.2, 0.1, 0]. At most 100.",
    keys: &[key("id", Name("effect", effects), Needed, "name of the effect")],
};

pub(super) const ENSEMBLE: Section = Section {
    name: "ensemble",
    heading: "[ensemble]",
    about: "The experiment run many times with small perturbations. `sfers run` prints mean, standard deviation and quantiles of every measure, a sweep has a column for each; other commands take the experiment as it is written.",
    keys: &[
        key("members", Whole(Between(2.0, 10_000.0)), Needed, "number of runs; the first is the experiment as it is written"),
        key("seed", Other("a whole number from 0 on"), Is("0"), "seed of the perturbations"),
        key("vary", Other("a table"), Needed, "perturbed keys: [ensemble.vary]"),
    ],
};

pub(super) const PERTURBATION: Section = Section {
    name: "ensemble.vary.KEY",
    heading: "\"KEY\" = { ... } of [ensemble.vary]",
    about: "How one key of the experiment, with dots and in quotes as \"robot.friction.low\", differs from member to member: exactly one of these. A list of numbers is perturbed number by number.",
    keys: &[
        key(
            "sd",
            Number(NotNegative),
            Else("relative or values"),
            "standard deviation of a normal distribution, in the unit of the key",
        ),
        key("relative", Number(NotNegative), Else("sd or values"), "standard deviation as a share of the value"),
        key("values", Other("a list of values"), Else("sd or relative"), "values that the members take by turns"),
    ],
};
