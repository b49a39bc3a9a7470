//! Other forms of the effects: the same cause by another equation than the library's and than the first one of this simulator.
//!
//! An id is `EFFECT~FORM`. The forms of an effect come in a fixed order, the effects in the order of `FORMS`. Those that limits may be set with: forms
//! 1 and 2 of the effects 1, 3, 5, ... and form 1 of the effects 2, 4, 6, ...; and those whose law is in the library by now (`IN_THE_LIBRARY`). All
//! others are only for judging (`is_for_judging`): do not look at single answers to them while a limit is chosen.

use super::Hidden;
use super::curves::{self, Operator};
use super::effects::Nature;
use super::filters;
use super::memories;
use super::moments::{Air, Moment};
use super::random::Random;

/// Where in the plant a form sits.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Place {
    JointMomentOfAngle,
    JointMomentOfRate,
    JointMemory,
    VoltageCurve,
    VoltageMemory,
    DriveFilter,
    Mounting,
    Air,
}

impl Place {
    pub fn name(self) -> &'static str {
        match self {
            Place::JointMomentOfAngle => "joint-moment-of-angle",
            Place::JointMomentOfRate => "joint-moment-of-rate",
            Place::JointMemory => "joint-memory",
            Place::VoltageCurve => "voltage-curve",
            Place::VoltageMemory => "voltage-memory",
            Place::DriveFilter => "drive-filter",
            Place::Mounting => "mounting",
            Place::Air => "air",
        }
    }
}

/// Makes an operator on the voltage from the size of a form and the first voltage of a run.
type Maker = fn(f64, f64) -> Operator;

/// An operator to be made for each run.
#[derive(Clone, Copy)]
pub struct Stage {
    maker: Maker,
    size: f64,
}

impl Stage {
    pub fn operator(&self, first: f64) -> Operator {
        (self.maker)(self.size, first)
    }
}

/// What the forms change in a plant: operators in the driver and in the actuation, a law of the joints, of the clamp and of the air.
#[derive(Clone, Default)]
pub struct Other {
    pub driver: Vec<Stage>,
    pub actuation: Vec<Stage>,
    pub joint: Option<Moment>,
    pub clamp: Option<Moment>,
    pub air: Option<Air>,
}

#[derive(Clone, Copy)]
enum Law {
    Driver(Maker),
    Actuation(Maker),
    Joint(fn(f64) -> Moment),
    /// A law of the clamp, from its compliance in rad/(N m), which is the size.
    Clamp(fn(f64) -> Moment),
    Air(fn(f64) -> Air),
}

/// A form with its ranges of the size for a small and a large trace (rms 0.2 to 0.4 and 0.6 to 1.5 mm, but
/// for a dead zone, which changes no more than 0.53 mm).
pub struct Form {
    pub id: &'static str,
    pub place: Place,
    pub sizes: [(f64, f64); 2],
    law: Law,
}

impl Form {
    /// The effect of the library that the form belongs to.
    pub fn effect(&self) -> &'static str {
        effect_of(self.id)
    }
}

/// The library's id of an effect or a form.
pub fn effect_of(id: &str) -> &str {
    id.split_once('~').map_or(id, |(effect, _)| effect)
}

pub fn find(id: &str) -> Option<&'static Form> {
    FORMS.iter().find(|form| form.id == id)
}

/// Forms whose law the library has got since they were written.
const IN_THE_LIBRARY: [&str; 2] = ["creep~fourth", "clamp-compliance~fourth"];

/// True for the forms that no limit is set with.
pub fn is_for_judging(id: &str) -> bool {
    if IN_THE_LIBRARY.contains(&id) {
        return false;
    }
    let index = FORMS.iter().position(|form| form.id == id).unwrap_or_else(|| panic!("no form {id}"));
    let (effect, form) = (index / EACH, index % EACH);
    form >= if effect % 2 == 0 { 2 } else { 1 }
}

/// Hides a form of a size, 0 or 1, in a plant.
pub fn hide(form: &Form, size: usize, seed: u64, nature: &mut Nature) -> Hidden {
    let range = *form.sizes.get(size).unwrap_or_else(|| panic!("{} has the sizes 0 and 1", form.id));
    let mut random = Random::with_purpose(seed, &format!("{} {size}", form.id));
    set(form, random.between(range.0, range.1), nature);
    Hidden { id: form.id, parameters: Vec::new() }
}

/// Puts a form of a given value into a plant.
pub fn set(form: &Form, value: f64, nature: &mut Nature) {
    let is_free = match form.law {
        Law::Driver(maker) => {
            nature.other.driver.push(Stage { maker, size: value });
            true
        }
        Law::Actuation(maker) => {
            nature.other.actuation.push(Stage { maker, size: value });
            true
        }
        Law::Joint(law) => nature.other.joint.replace(law(value)).is_none(),
        Law::Clamp(law) => {
            nature.clamp_rad_per_dyn_cm += 1e-7 * value;
            nature.other.clamp.replace(law(value)).is_none()
        }
        Law::Air(law) => nature.other.air.replace(law(value)).is_none(),
    };
    assert!(is_free, "{}: there is another form at this place", form.id);
}

const fn form(id: &'static str, place: Place, sizes: [(f64, f64); 2], law: Law) -> Form {
    Form { id, place, sizes, law }
}

/// Forms of each effect.
const EACH: usize = 5;

/// Five forms of each effect, in order. The ids of the fourth and fifth ones do not say what they are, so that whoever runs them can judge blind.
pub const FORMS: &[Form] = &[
    form(
        "field-dependent-gain~plateaus",
        Place::VoltageCurve,
        [(0.022, 0.0381), (0.0652, 0.136)],
        Law::Actuation(curves::plateaus),
    ),
    form(
        "field-dependent-gain~power",
        Place::VoltageCurve,
        [(0.0378, 0.0652), (0.111, 0.229)],
        Law::Actuation(curves::power_law),
    ),
    form(
        "field-dependent-gain~rational",
        Place::VoltageCurve,
        [(0.0337, 0.0582), (0.0997, 0.208)],
        Law::Actuation(curves::rational_growth),
    ),
    form(
        "field-dependent-gain~fourth",
        Place::VoltageCurve,
        [(0.028, 0.0485), (0.083, 0.173)],
        Law::Actuation(curves::threshold_growth),
    ),
    form(
        "field-dependent-gain~fifth",
        Place::VoltageCurve,
        [(0.0379, 0.0657), (0.112, 0.235)],
        Law::Actuation(curves::nucleated_growth),
    ),
    form(
        "stiffness-softening~strain",
        Place::JointMomentOfAngle,
        [(0.0372, 0.0636), (0.107, 0.217)],
        Law::Joint(Moment::SofteningByStrain),
    ),
    form(
        "stiffness-softening~plateau",
        Place::JointMomentOfAngle,
        [(0.00514, 0.00883), (0.015, 0.0307)],
        Law::Joint(Moment::SofteningToPlateau),
    ),
    form(
        "stiffness-softening~corner",
        Place::JointMomentOfAngle,
        [(0.00556, 0.00954), (0.0162, 0.0332)],
        Law::Joint(Moment::SofteningAtCorner),
    ),
    form(
        "stiffness-softening~fourth",
        Place::JointMomentOfAngle,
        [(0.00536, 0.00921), (0.0156, 0.032)],
        Law::Joint(Moment::SofteningByKraus),
    ),
    form(
        "stiffness-softening~fifth",
        Place::JointMomentOfAngle,
        [(0.0052, 0.00892), (0.0151, 0.0309)],
        Law::Joint(Moment::SofteningByTension),
    ),
    form("dry-friction~dahl", Place::JointMemory, [(1740.0, 3050.0), (5310.0, 11300.0)], Law::Joint(Moment::Dahl)),
    form("dry-friction~stribeck", Place::JointMomentOfRate, [(1670.0, 2950.0), (5150.0, 10900.0)], Law::Joint(Moment::Stribeck)),
    form("dry-friction~iwan", Place::JointMemory, [(1790.0, 3110.0), (5390.0, 11400.0)], Law::Joint(Moment::Iwan)),
    form("dry-friction~fourth", Place::JointMemory, [(1660.0, 2920.0), (5090.0, 10800.0)], Law::Joint(Moment::LuGre)),
    form("dry-friction~fifth", Place::JointMemory, [(1660.0, 2920.0), (5090.0, 10800.0)], Law::Joint(Moment::AgeingContacts)),
    form("creep~stretched", Place::VoltageMemory, [(0.0568, 0.0981), (0.168, 0.349)], Law::Actuation(memories::stretched_creep)),
    form(
        "creep~two-elements",
        Place::VoltageMemory,
        [(0.0452, 0.0781), (0.134, 0.278)],
        Law::Actuation(memories::two_element_creep),
    ),
    form("creep~thresholds", Place::VoltageMemory, [(0.0129, 0.0222), (0.038, 0.079)], Law::Actuation(memories::threshold_creep)),
    form("creep~fourth", Place::VoltageMemory, [(0.0772, 0.133), (0.228, 0.474)], Law::Actuation(memories::activated_creep)),
    form("creep~fifth", Place::VoltageMemory, [(0.0197, 0.0339), (0.0581, 0.121)], Law::Actuation(memories::quadratic_creep)),
    form(
        "structural-damping~fractional",
        Place::JointMemory,
        [(0.00243, 0.00425), (0.00743, 0.0165)],
        Law::Joint(Moment::Fractional),
    ),
    form("structural-damping~zener", Place::JointMemory, [(0.00608, 0.0106), (0.0187, 0.0417)], Law::Joint(Moment::Zener)),
    form("structural-damping~reid", Place::JointMomentOfRate, [(0.0069, 0.0123), (0.0218, 0.0499)], Law::Joint(Moment::Reid)),
    form("structural-damping~fourth", Place::JointMemory, [(0.00817, 0.0143), (0.025, 0.0551)], Law::Joint(Moment::BroadPeak)),
    form(
        "structural-damping~fifth",
        Place::JointMemory,
        [(0.00492, 0.00869), (0.0154, 0.0355)],
        Law::Joint(Moment::HystereticDamper),
    ),
    form("hysteresis~preisach", Place::VoltageMemory, [(0.0728, 0.124), (0.206, 0.402)], Law::Actuation(memories::preisach)),
    form("hysteresis~duhem", Place::VoltageMemory, [(0.0148, 0.0274), (0.0522, 0.143)], Law::Actuation(memories::duhem)),
    form("hysteresis~rayleigh", Place::VoltageMemory, [(0.0363, 0.0626), (0.107, 0.222)], Law::Actuation(memories::rayleigh)),
    form("hysteresis~fourth", Place::VoltageMemory, [(0.103, 0.174), (0.287, 0.547)], Law::Actuation(memories::jiles_atherton)),
    form("hysteresis~fifth", Place::VoltageMemory, [(0.0258, 0.0447), (0.077, 0.163)], Law::Actuation(memories::mapped_branches)),
    form(
        "polarity-asymmetry~smooth",
        Place::VoltageCurve,
        [(0.414, 0.715), (1.22, 2.55)],
        Law::Actuation(curves::smooth_polarity),
    ),
    form(
        "polarity-asymmetry~growing",
        Place::VoltageCurve,
        [(0.335, 0.578), (0.99, 2.06)],
        Law::Actuation(curves::growing_polarity),
    ),
    form(
        "polarity-asymmetry~dead-zone",
        Place::VoltageCurve,
        [(125.0, 240.0), (320.0, 440.0)],
        Law::Actuation(curves::dead_zone),
    ),
    form(
        "polarity-asymmetry~fourth",
        Place::VoltageCurve,
        [(0.7, 1.21), (2.07, 4.31)],
        Law::Actuation(curves::levelling_polarity),
    ),
    form(
        "polarity-asymmetry~fifth",
        Place::VoltageCurve,
        [(170.0, 293.0), (501.0, 1040.0)],
        Law::Actuation(curves::turned_domains),
    ),
    form(
        "clamp-compliance~damper",
        Place::Mounting,
        [(0.026, 0.0449), (0.0771, 0.163)],
        Law::Clamp(|_| Moment::ClampDamper(4e-3)),
    ),
    form(
        "clamp-compliance~hardening",
        Place::Mounting,
        [(0.0333, 0.0573), (0.0972, 0.199)],
        Law::Clamp(|value| Moment::ClampHardening(0.1 * value)),
    ),
    form(
        "clamp-compliance~play",
        Place::Mounting,
        [(0.0232, 0.0397), (0.0672, 0.137)],
        Law::Clamp(|value| Moment::ClampPlay(5e-3 * value)),
    ),
    form(
        "clamp-compliance~fourth",
        Place::Mounting,
        [(0.0189, 0.0324), (0.0549, 0.111)],
        Law::Clamp(|value| Moment::ClampOneSided(2e-3 * value)),
    ),
    form("clamp-compliance~fifth", Place::Mounting, [(0.0485, 0.0834), (0.141, 0.288)], Law::Clamp(|_| Moment::ClampPads(1.0))),
    form("air-drag~power", Place::Air, [(1.19, 2.12), (3.84, 9.33)], Law::Air(Air::Power)),
    form("air-drag~fence", Place::Air, [(0.777, 1.41), (2.6, 6.74)], Law::Air(Air::Fence)),
    form("air-drag~mixed", Place::Air, [(0.459, 0.825), (1.51, 3.81)], Law::Air(Air::Mixed)),
    form("air-drag~fourth", Place::Air, [(0.455, 0.821), (1.51, 3.87)], Law::Air(Air::Reynolds)),
    form("air-drag~fifth", Place::Air, [(1.42, 2.53), (4.57, 11.1)], Law::Air(Air::Bending)),
    form(
        "driver-lag~second-order",
        Place::DriveFilter,
        [(0.000254, 0.000439), (0.00075, 0.00155)],
        Law::Driver(filters::second_order),
    ),
    form(
        "driver-lag~two-resistors",
        Place::DriveFilter,
        [(0.000127, 0.000219), (0.000375, 0.00079)],
        Law::Driver(filters::two_resistors),
    ),
    form("driver-lag~cascade", Place::DriveFilter, [(0.000181, 0.000313), (0.000536, 0.00112)], Law::Driver(filters::cascade)),
    form(
        "driver-lag~fourth",
        Place::DriveFilter,
        [(0.000161, 0.000278), (0.000476, 0.000997)],
        Law::Driver(filters::growing_capacitance),
    ),
    form(
        "driver-lag~fifth",
        Place::DriveFilter,
        [(0.000759, 0.00132), (0.00225, 0.00472)],
        Law::Driver(filters::resistive_electrodes),
    ),
    form("slew-limit~tanh", Place::DriveFilter, [(3.03e5, 1.64e5), (94600.0, 58200.0)], Law::Driver(filters::tanh_rate)),
    form("slew-limit~unequal", Place::DriveFilter, [(2.26e5, 1.3e5), (78400.0, 49200.0)], Law::Driver(filters::unequal_rates)),
    form("slew-limit~droop", Place::DriveFilter, [(3.52e5, 2.03e5), (1.35e5, 82000.0)], Law::Driver(filters::drooping_rate)),
    form("slew-limit~fourth", Place::DriveFilter, [(1.52e5, 93200.0), (72900.0, 50200.0)], Law::Driver(filters::peak_current)),
    form("slew-limit~fifth", Place::DriveFilter, [(1.98e5, 1.15e5), (77300.0, 51900.0)], Law::Driver(filters::equal_pulses)),
    form("saturation~tanh", Place::VoltageCurve, [(1570.0, 1440.0), (1300.0, 1080.0)], Law::Driver(curves::tanh_limit)),
    form("saturation~parabola", Place::VoltageCurve, [(1430.0, 1330.0), (1220.0, 1040.0)], Law::Driver(curves::parabolic_limit)),
    form("saturation~sagging", Place::DriveFilter, [(1510.0, 1420.0), (1310.0, 1110.0)], Law::Driver(filters::sagging_supply)),
    form("saturation~fourth", Place::VoltageCurve, [(1670.0, 1530.0), (1380.0, 1150.0)], Law::Driver(curves::varistor)),
    form("saturation~fifth", Place::VoltageCurve, [(1350.0, 1260.0), (1140.0, 957.0)], Law::Driver(curves::suppressor)),
];
