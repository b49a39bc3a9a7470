//! Names and definitions of the measures, for `sfers help measures` and docs/measures.md.

/// A measure.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Definition {
    /// Name with the unit.
    pub name: &'static str,
    /// Robots and drives to which it applies.
    pub of: &'static str,
    /// Definition.
    pub about: &'static str,
}

const CLAMPED: &str = "clamped robots";
const CLAMPED_PERIODIC: &str = "clamped robots, drives with a period";
const RINGING: &str = "clamped robots, drives without a period";
const MOBILE: &str = "robots on the ground or free";
const MOBILE_PERIODIC: &str = "robots on the ground or free, drives with a period";
const GROUND: &str = "robots on the ground";

/// Conventions common to all definitions.
pub const CONVENTIONS: &str = "x and z are those of the nodes: both ends and the joints, x along the flat robot and z upwards from it. The \
    last period is the last whole period of the drive; the last half of the run, in whole periods, stands for the settled state. Measures \
    are computed from the run's steps, independent of the record interval, except for those named recorded. A measure that does not apply to a run is absent, and a failed simulation has no measures.";

/// All measures, in the order in which they are printed.
pub static DEFINITIONS: &[Definition] = &[
    define("tip_deflection_mm", CLAMPED, "height of the right end above the flat robot in the last record: z of the last node"),
    define(
        "tip_amplitude_mm",
        CLAMPED,
        "half the difference between the largest and smallest height of the right end over the last period, or over the whole run if the drive has none",
    ),
    define(
        "tip_phase_deg",
        CLAMPED_PERIODIC,
        "phase of the right end's height against the voltage of the first actuator, both at the drive's frequency over the last half of the run: 0 for slow drives, negative for a lag",
    ),
    define(
        "resonance_hz",
        RINGING,
        "frequency of the largest response, from the ringing of the right end's height: logarithmic decrement δ and duration Δt of half a period, from its turning points; f = √(1 − 2ζ²) / (2 Δt √(1 − ζ²))",
    ),
    define("damping_ratio", RINGING, "ζ = δ / √(π² + δ²) of that mode"),
    define(
        "half_power_bandwidth_hz",
        RINGING,
        "width of that mode's peak at 1/√2 of its height: 2ζ times its undamped frequency",
    ),
    define("jump_height_mm", MOBILE, "largest height of the lowest point: max over time of min over nodes of z"),
    define(OF_RECORDS, MOBILE, "jump height of the records alone, which may miss the peak, as in the authors' curves"),
    define("stride_mm", MOBILE_PERIODIC, "travel of the nodes' mean x during the last period"),
    define(
        "speed_mm_s",
        MOBILE,
        "mean speed of the nodes' mean x over the last half of the run in whole periods, or over the whole run if the drive has no period",
    ),
    define("displacement_sum_mm", MOBILE, "max over time of the left end's plus the right end's travel along x"),
    define(
        "period_ratio",
        MOBILE_PERIODIC,
        "number of periods of the drive after which the nodes' heights repeat, over the last half of the run: 1, 2, or 0 for neither; in runs of six periods or more",
    ),
    define(
        "mid_end_phase_deg",
        MOBILE_PERIODIC,
        "phase of the middle node's height against the mean height of both ends, at the drive's frequency over the last half of the run",
    ),
    define(
        "body_touching",
        GROUND,
        "share of the time that a node other than the two at each end is less than 0.05 mm above its height on the flat robot",
    ),
    define("end_touching", GROUND, "share of the time that only nodes at the ends are"),
    define("aerial", GROUND, "share of the time that no node is"),
    define(
        "energy_error",
        "runs without [[effect]]",
        "energy that nothing supplied, as a fraction of the largest mechanical energy",
    ),
];

/// The measure that depends on the record interval.
pub(crate) const OF_RECORDS: &str = "recorded_jump_height_mm";

const fn define(name: &'static str, of: &'static str, about: &'static str) -> Definition {
    Definition { name, of, about }
}

/// The names of all measures.
pub fn names() -> Vec<&'static str> {
    DEFINITIONS.iter().map(|definition| definition.name).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::recording::measures::Measures;

    #[test]
    fn every_measure_of_the_program_is_defined_in_its_order_and_no_other() {
        assert_eq!(names(), Measures::names());
    }
}
