//! Gaits: sequences in which actuators are switched on, as data.

/// Voltages of the reference's five actuators when they are on (V).
pub const DEFAULT_ON_VOLTAGES: [f64; 5] = [520.0, 520.0, -1500.0, 520.0, 520.0];

/// Where a phase ends.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Bound {
    /// `k/n` of the period.
    Share(f64, f64),
    /// A fixed time (s).
    At(f64),
    /// The gait's delay or on-time d.
    Parameter,
    /// A fixed time plus d (s).
    ParameterPlus(f64),
    /// Never.
    End,
}

impl Bound {
    /// The bound as a time (s), for a period or parameter `p` (s).
    pub fn time(self, p: f64) -> f64 {
        match self {
            // The quotient first, as the reference writes it: (k/n)·p and k·p/n differ in the last bit.
            Self::Share(k, n) => (k / n) * p,
            Self::At(time) => time,
            Self::Parameter => p,
            Self::ParameterPlus(time) => time + p,
            Self::End => f64::INFINITY,
        }
    }
}

/// One phase: until its bound, the actuators marked `1` are on.
pub type Phase = (Bound, &'static str);

/// The number a gait takes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Parameter {
    /// None.
    Nothing,
    /// `period_s` or `frequency_hz`.
    Period,
    /// `delay_s`.
    Delay,
    /// `on_time_s`.
    OnTime,
}

impl Parameter {
    /// The key of the experiment file that holds it.
    pub fn key(self) -> &'static str {
        match self {
            Self::Nothing => "(none)",
            Self::Period => "period_s",
            Self::Delay => "delay_s",
            Self::OnTime => "on_time_s",
        }
    }
}

/// A gait of five actuators.
///
/// The voltages at time t are those of the first phase in `once` that ends after t; when all of these are over, those of the first
/// phase in `cycle` that ends after t modulo the period; otherwise all actuators are off.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Gait {
    /// Name in experiment files.
    pub name: &'static str,
    /// What it does, in a few words.
    pub summary: &'static str,
    /// The number it takes.
    pub parameter: Parameter,
    /// Phases that are passed once, in absolute time.
    pub once: &'static [Phase],
    /// What stands for `once` when the parameter is negative, with its magnitude as the parameter; empty: not allowed.
    pub once_if_negative: &'static [Phase],
    /// Phases that repeat with the period.
    pub cycle: &'static [Phase],
    /// The value that the parameter takes if it is not given.
    pub default_parameter: Option<f64>,
}

/// End of the jumper's second phase (s), a constant of the reference.
const JUMPER_RELEASE: f64 = 0.059309;

use Bound::{At, End, Parameter as D, ParameterPlus, Share};

const NO_GAIT: Gait = Gait {
    name: "",
    summary: "",
    parameter: Parameter::Nothing,
    once: &[],
    once_if_negative: &[],
    cycle: &[],
    default_parameter: None,
};

const fn cyclic(name: &'static str, summary: &'static str, cycle: &'static [Phase]) -> Gait {
    Gait { name, summary, parameter: Parameter::Period, cycle, ..NO_GAIT }
}

/// Every gait of the reference's classes and notebooks.
///
/// # References
/// The published code of Zheng et al., ICRA 2022; "full-frictional-inchworm" is the paper's own sequence.
pub static GAITS: [Gait; 14] = [
    cyclic(
        "inchworm",
        "four phases, forward with a film under the right end",
        &[(Share(1.0, 4.0), "00000"), (Share(1.0, 2.0), "01110"), (Share(3.0, 4.0), "11110"), (End, "10000")],
    ),
    cyclic(
        "inchworm-backward",
        "four phases, backward",
        &[(Share(1.0, 4.0), "00000"), (Share(1.0, 2.0), "01110"), (Share(3.0, 4.0), "01111"), (End, "00001")],
    ),
    cyclic(
        "inchworm-reversed",
        "the inchworm's phases in reversed order",
        &[(Share(1.0, 4.0), "00000"), (Share(1.0, 2.0), "10000"), (Share(3.0, 4.0), "11110"), (End, "01110")],
    ),
    cyclic(
        "full-inchworm",
        "five phases, the right end first",
        &[
            (Share(1.0, 5.0), "00000"),
            (Share(2.0, 5.0), "00001"),
            (Share(3.0, 5.0), "01111"),
            (Share(4.0, 5.0), "11110"),
            (End, "10000"),
        ],
    ),
    cyclic(
        "full-frictional-inchworm",
        "five phases with films under both ends: the paper's sequence",
        &[
            (Share(1.0, 5.0), "00000"),
            (Share(2.0, 5.0), "10000"),
            (Share(3.0, 5.0), "11110"),
            (Share(4.0, 5.0), "01111"),
            (End, "00001"),
        ],
    ),
    Gait {
        once: &[(Share(1.0, 5.0), "00000")],
        ..cyclic(
            "frog-v2",
            "the frictional inchworm, but bent from the first phase on after a flat start",
            &[
                (Share(1.0, 5.0), "01110"),
                (Share(2.0, 5.0), "10000"),
                (Share(3.0, 5.0), "11110"),
                (Share(4.0, 5.0), "01111"),
                (End, "00001"),
            ],
        )
    },
    cyclic("crawl", "middle three off and on: jumping in place", &[(Share(1.0, 2.0), "00000"), (End, "01110")]),
    Gait { name: "jumper", summary: "middle three on for ever", once: &[(End, "01110")], ..NO_GAIT },
    Gait {
        name: "jumper-delay",
        summary: "middle three, after the delay all, then off; a negative delay begins with the ends",
        parameter: Parameter::Delay,
        once: &[(D, "01110"), (At(JUMPER_RELEASE), "11111")],
        once_if_negative: &[(D, "10001"), (ParameterPlus(JUMPER_RELEASE), "11111")],
        ..NO_GAIT
    },
    Gait {
        name: "jumper-pulse",
        summary: "middle three on for half a period, then off",
        parameter: Parameter::Period,
        once: &[(Share(1.0, 2.0), "01110")],
        default_parameter: Some(1.0 / 40.0),
        ..NO_GAIT
    },
    Gait {
        name: "jump-on-time",
        summary: "middle three on until the on-time, then off",
        parameter: Parameter::OnTime,
        once: &[(D, "01110")],
        ..NO_GAIT
    },
    Gait {
        name: "mover",
        summary: "left end on, then the middle three as well",
        once: &[(At(0.03437491666666667), "10000"), (End, "11110")],
        ..NO_GAIT
    },
    Gait {
        name: "mover-delay",
        summary: "left end on, after the delay the middle three as well",
        parameter: Parameter::Delay,
        once: &[(D, "10000"), (End, "11110")],
        ..NO_GAIT
    },
    Gait {
        name: "mover-three-phase",
        summary: "left end, left four, right four until 0.089 s plus the delay, then off",
        parameter: Parameter::Delay,
        once: &[(At(0.024), "10000"), (At(0.089), "11110"), (ParameterPlus(0.089), "01111")],
        ..NO_GAIT
    },
];

/// Finds a gait by its name.
pub fn find(name: &str) -> Option<&'static Gait> {
    GAITS.iter().find(|gait| gait.name == name)
}

impl Gait {
    /// The actuators that are on at time `t` (s), for a period or parameter `p` (s), as a mask of `0` and `1`.
    pub fn mask(&self, t: f64, p: f64) -> &'static str {
        let (once, p_once) = self.once(p);
        let phase =
            |phases: &'static [Phase], t: f64, p: f64| phases.iter().find(|(bound, _)| t < bound.time(p)).map(|&(_, mask)| mask);
        phase(once, t, p_once)
            .or_else(|| if self.cycle.is_empty() { None } else { phase(self.cycle, t % p, p) })
            .unwrap_or("00000")
    }

    /// When the phase of time `t` (s) ends, but for rounding.
    pub(super) fn phase_end(&self, t: f64, p: f64) -> f64 {
        let (once, p_once) = self.once(p);
        let end = |phases: &[Phase], t: f64, p: f64| phases.iter().map(|(bound, _)| bound.time(p)).find(|end| t < *end);
        end(once, t, p_once).unwrap_or_else(|| {
            if self.cycle.is_empty() {
                return f64::INFINITY;
            }
            let within = t % p;
            t + (end(self.cycle, within, p).unwrap_or(p).min(p) - within)
        })
    }

    /// The phases that are passed once, and the number that they take.
    fn once(&self, p: f64) -> (&'static [Phase], f64) {
        if p < 0.0 { (self.once_if_negative, p.abs()) } else { (self.once, p) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn masks(name: &str, p: f64, times: &[f64]) -> Vec<&'static str> {
        times.iter().map(|&t| find(name).unwrap().mask(t, p)).collect()
    }

    #[test]
    fn cyclic_gaits_pass_their_phases_in_equal_parts_and_repeat() {
        assert_eq!(
            masks("inchworm", 1.0, &[0.0, 0.3, 0.6, 0.9, 1.0, 1.3]),
            ["00000", "01110", "11110", "10000", "00000", "01110"]
        );
        assert_eq!(
            masks("full-frictional-inchworm", 0.5, &[0.05, 0.15, 0.25, 0.35, 0.45]),
            ["00000", "10000", "11110", "01111", "00001"]
        );
        assert_eq!(masks("crawl", 0.1, &[0.04, 0.06, 0.14]), ["00000", "01110", "00000"]);
    }

    #[test]
    fn the_frog_is_flat_in_the_first_fifth_of_the_first_period_only() {
        assert_eq!(masks("frog-v2", 1.0, &[0.1, 0.3, 1.1]), ["00000", "10000", "01110"]);
    }

    #[test]
    fn the_delayed_jumper_takes_delays_of_both_signs() {
        assert_eq!(masks("jumper-delay", 0.024, &[0.01, 0.03, 0.06]), ["01110", "11111", "00000"]);
        assert_eq!(masks("jumper-delay", -0.02, &[0.01, 0.03, 0.07, 0.08]), ["10001", "11111", "11111", "00000"]);
    }

    #[test]
    fn single_shot_gaits_end_as_the_reference_ends_them() {
        assert_eq!(masks("jumper", 0.0, &[0.0, 1e3]), ["01110", "01110"]);
        assert_eq!(masks("jumper-pulse", 0.025, &[0.0124, 0.0126, 0.0251]), ["01110", "00000", "00000"]);
        assert_eq!(masks("jump-on-time", 0.012, &[0.0119, 0.0121]), ["01110", "00000"]);
        assert_eq!(masks("mover", 0.0, &[0.03, 0.04, 9.0]), ["10000", "11110", "11110"]);
        assert_eq!(masks("mover-delay", 0.01, &[0.009, 0.011]), ["10000", "11110"]);
        assert_eq!(masks("mover-three-phase", 0.01, &[0.02, 0.05, 0.095, 0.1]), ["10000", "11110", "01111", "00000"]);
    }

    #[test]
    fn every_mask_has_five_actuators_and_every_name_is_unique() {
        for (i, gait) in GAITS.iter().enumerate() {
            for (_, mask) in gait.once.iter().chain(gait.once_if_negative).chain(gait.cycle) {
                assert!(mask.len() == 5 && mask.bytes().all(|b| b == b'0' || b == b'1'), "{}", gait.name);
            }
            assert!(GAITS[..i].iter().all(|other| other.name != gait.name));
        }
    }
}
