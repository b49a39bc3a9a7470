//! What a robot has beyond the plain model. Everything is off by default, and off costs nothing and changes no bit.

use super::clamp::ClampCurve;
use super::curve::Curve;
use super::friction::FrictionCurve;

/// Additions to the plain robot that both engines know how to step. [`crate::effects`] sets them; the fields are in CGS units.
#[derive(Debug, Clone, PartialEq)]
pub struct Extensions {
    /// Factor on every joint's stiffness (–).
    pub stiffness_scale: f64,
    /// Factor on the curvature per volt (–).
    pub gain_scale: f64,
    /// Factor on the damping time η (–).
    pub damping_scale: f64,
    /// Factor on every body's mass (–).
    pub mass_scale: f64,
    /// Factor on the robot's coefficients of friction (–).
    pub friction_scale: f64,
    /// Turn of a clamped root per moment on it (rad/(dyn·cm)).
    pub clamp_compliance: f64,
    /// Damping of a compliant clamp over its stiffness (s).
    pub clamp_damping: f64,
    /// a of the moment φ (1 + (a φ)²) over the compliance of a compliant clamp that turns by φ (1/rad).
    pub clamp_hardening: f64,
    /// Turn of a clamped root as a curve of the moment, in series with the compliance. Not beside a hardening.
    pub clamp_curve: ClampCurve,
    /// Shift in z of a clamped left end per force on it (cm/dyn).
    pub clamp_shift: f64,
    /// Damping of that shift over its stiffness (s).
    pub clamp_shift_damping: f64,
    /// Masses fixed to the sheet.
    pub point_masses: Vec<PointMass>,
    /// Curvature at 0 V (1/cm), one per actuator, or none.
    pub rest_curvature: Vec<f64>,
    /// Factor on each joint's voltage (–), or none.
    pub joint_gains: Vec<f64>,
    /// Factor on each joint's stiffness (–), or none.
    pub joint_stiffness: Vec<f64>,
    /// a of `k δ (1 − a κ₀² (|δ|/(ℓ κ₀))^p)` (cm²), with κ₀ = `SOFTENING_CURVATURE`.
    pub softening: f64,
    /// p of the same; 2 is the cubic law.
    pub softening_exponent: f64,
    /// Moment of dry friction in every joint (dyn·cm).
    pub dry_friction: f64,
    /// Moment of dry friction (dyn·cm) of a joint against the size of its curvature (1/cm), beside `dry_friction`.
    pub friction_of_curvature: Curve,
    /// The same as a share of the joint's stiffness times its angle (–): Reid's damping.
    pub friction_of_bending: f64,
    /// Moment (dyn·cm) of a joint against its elastic curvature (1/cm), beside the linear one.
    pub moment_of_curvature: Curve,
    /// Moment (dyn·cm) of a joint against the rate of its curvature (1/(cm·s)), beside the linear one.
    pub moment_of_rate: Curve,
    /// Springs with a limit beside every joint.
    pub slips: Vec<Slip>,
    /// ξ_j: stiffness of each unit of the Maxwell chain of [`LOSS_TIMES`], as a share of a joint's (–).
    pub loss: [f64; LOSS_TIMES.len()],
    /// Drag coefficient of the sheet in air at [`DRAG_SPEED`] (–), in parts that depend on the speed by [`DRAG_POWERS`].
    pub drag: [f64; DRAG_POWERS.len()],
    /// Another part of the drag coefficient at [`DRAG_SPEED`] (–), with any power of the speed.
    pub drag_of_power: [f64; 2],
    /// Tapes and cables at the sheet.
    pub attachments: Vec<Attachment>,
    /// Slope of the floor (rad), positive if it rises along +x.
    pub slope: f64,
    /// Share of the approach speed that contact returns (–).
    pub restitution: f64,
    /// How friction depends on the sliding speed.
    pub stick_slip: StickSlip,
    /// Change of the coefficient of friction with the sliding speed, beside `stick_slip`.
    pub friction_of_speed: FrictionCurve,
}

/// A spring that slips at a moment: friction that begins with elastic presliding (Jenkins's element; Iwan 1966).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Slip {
    /// Moment at which it slips (dyn·cm).
    pub moment: f64,
    /// Curvature from rest at which it slips (1/cm).
    pub curvature: f64,
}

/// A mass at a point of the sheet's centre line.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PointMass {
    /// Mass (g).
    pub mass: f64,
    /// Distance from the left end along the sheet (cm).
    pub position: f64,
}

/// A tape or cable from a fixed point to a point of the sheet's centre line, taut on one side of a height: a spring with a damper and dry friction.
///
/// ```text
/// F_z = −side·k·g − e·(k·T·ż + f·tanh(ż/v₀)),  g = max(0, side·(z − level)),  e = min(1, g/g₀)
/// ```
///
/// with v₀ = [`ATTACHMENT_RATE`] and g₀ = `ENGAGEMENT`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Attachment {
    /// Distance from the left end along the sheet (cm).
    pub position: f64,
    /// Height from which on it is taut (cm).
    pub level: f64,
    /// 1 if it is taut above the level, −1 if below.
    pub side: f64,
    /// Stiffness k (dyn/cm).
    pub stiffness: f64,
    /// Damping over stiffness T (s).
    pub damping: f64,
    /// Force f of friction (dyn).
    pub friction: f64,
}

impl Attachment {
    /// How far a point at the height `z` (cm) is beyond the level (cm): g.
    fn stretch(&self, z: f64) -> f64 {
        (self.side * (z - self.level)).max(0.0)
    }

    /// Vertical force of the spring on a point at the height `z` (cm), and its stiffness there (dyn, dyn/cm).
    pub fn spring(&self, z: f64) -> [f64; 2] {
        let stretch = self.stretch(z);
        [-self.side * self.stiffness * stretch, if stretch > 0.0 { self.stiffness } else { 0.0 }]
    }

    /// Force of damper and friction against the vertical velocity `v` (cm/s) of a point at the height `z` (cm), and its derivative (dyn, dyn·s/cm).
    pub fn resistance(&self, z: f64, v: f64) -> [f64; 2] {
        let engaged = (self.stretch(z) / ENGAGEMENT).min(1.0);
        let (damper, share) = (self.stiffness * self.damping, (v / ATTACHMENT_RATE).tanh());
        let slope = damper + self.friction / ATTACHMENT_RATE * (1.0 - share * share);
        [engaged * (damper * v + self.friction * share), engaged * slope]
    }
}

/// Friction that falls from its static to its sliding value: `μ (1 + (ratio − 1) exp(−(v/speed)²))`, and a viscous force beside it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StickSlip {
    /// Static over sliding friction (–).
    pub ratio: f64,
    /// Speed at which the difference has fallen to 1/e (cm/s).
    pub speed: f64,
    /// Force per sliding speed and link on the floor (dyn·s/cm).
    pub viscous: f64,
}

impl StickSlip {
    /// No dependence on speed.
    pub const OFF: Self = Self { ratio: 1.0, speed: 1.0, viscous: 0.0 };

    /// The coefficient of dry friction at the sliding speed `v` (cm/s), from the plain one.
    pub fn friction(&self, plain: f64, v: f64) -> f64 {
        plain * (1.0 + (self.ratio - 1.0) * (-(v / self.speed).powi(2)).exp())
    }
}

impl Default for Extensions {
    fn default() -> Self {
        Self {
            stiffness_scale: 1.0,
            gain_scale: 1.0,
            damping_scale: 1.0,
            mass_scale: 1.0,
            friction_scale: 1.0,
            clamp_compliance: 0.0,
            clamp_damping: 0.0,
            clamp_hardening: 0.0,
            clamp_curve: ClampCurve::RIGID,
            clamp_shift: 0.0,
            clamp_shift_damping: 0.0,
            point_masses: Vec::new(),
            rest_curvature: Vec::new(),
            joint_gains: Vec::new(),
            joint_stiffness: Vec::new(),
            softening: 0.0,
            softening_exponent: 2.0,
            dry_friction: 0.0,
            friction_of_curvature: Curve::ZERO,
            friction_of_bending: 0.0,
            moment_of_curvature: Curve::ZERO,
            moment_of_rate: Curve::ZERO,
            slips: Vec::new(),
            loss: [0.0; LOSS_TIMES.len()],
            drag: [0.0; DRAG_POWERS.len()],
            drag_of_power: [0.0, 2.0],
            attachments: Vec::new(),
            slope: 0.0,
            restitution: 0.0,
            stick_slip: StickSlip::OFF,
            friction_of_speed: FrictionCurve::OFF,
        }
    }
}

/// Rate at which dry friction has 76 % of its moment (rad/s): `τ_c tanh(θ̇/ω)`.
pub const DRY_FRICTION_RATE: f64 = 0.03;
/// Speed at which the friction of an attachment has 76 % of its force (cm/s).
pub const ATTACHMENT_RATE: f64 = 0.1;
/// Stretch with which damper and friction of an attachment have set in (cm).
const ENGAGEMENT: f64 = 0.01;
/// Curvature at which softening of any power is that of the cubic law (1/cm).
pub const SOFTENING_CURVATURE: f64 = 0.02;
/// Softening leaves at least this share of a joint's stiffness.
pub const LEAST_STIFFNESS: f64 = 0.5;
/// Time constants (s) of the loss ladder: a loss factor of about 0.68 ξ that is flat from 0.3 to 500 Hz.
pub const LOSS_TIMES: [f64; 5] = [1e-4, 1e-3, 1e-2, 1e-1, 1.0];
/// Links whose lowest edge is below this height (cm) are on the floor as far as viscous friction goes: Bullet's reach of contacts. The force
/// on a link cannot tell, for a flat robot's weight may rest on some links alone.
pub const VISCOUS_REACH: f64 = 0.02;
/// Powers of the speed in the parts of drag: linear, quadratic, cubic.
pub const DRAG_POWERS: [i32; 3] = [1, 2, 3];
/// Speed at which the parts of drag have their coefficients (cm/s).
pub const DRAG_SPEED: f64 = 100.0;
/// Below this share of [`DRAG_SPEED`] drag of any power is viscous: powers below 1 have no slope at rest.
pub(crate) const LEAST_DRAG_RATIO: f64 = 1e-4;
/// Density of air (g/cm³).
pub const AIR_DENSITY: f64 = 1.2e-3;

impl Extensions {
    /// The turn of a clamped root as a curve of the moment, everything in series; none if it is no curve but linear, hardening or rigid.
    pub fn curved_clamp(&self) -> Option<ClampCurve> {
        (!self.clamp_curve.is_rigid()).then(|| self.clamp_curve.in_series(self.clamp_compliance))
    }

    /// Whether the joints' torque law has terms beyond eq. 1.
    pub fn bends_torque_law(&self) -> bool {
        self.softening != 0.0
            || self.has_dry_friction()
            || self.has_loss()
            || !self.slips.is_empty()
            || !self.moment_of_curvature.is_zero()
            || !self.moment_of_rate.is_zero()
    }

    /// Whether joints have dry friction.
    pub fn has_dry_friction(&self) -> bool {
        self.dry_friction != 0.0 || self.has_friction_of_bending()
    }

    /// Whether the dry friction of a joint depends on its angle.
    pub fn has_friction_of_bending(&self) -> bool {
        self.friction_of_bending != 0.0 || !self.friction_of_curvature.is_zero()
    }

    /// Whether friction depends on the sliding speed.
    pub fn has_friction_of_speed(&self) -> bool {
        self.stick_slip != StickSlip::OFF || !self.friction_of_speed.is_off()
    }

    /// Whether joints have a Maxwell chain.
    pub fn has_loss(&self) -> bool {
        self.loss != [0.0; LOSS_TIMES.len()]
    }

    /// Whether the sheet has drag in air.
    pub fn has_drag(&self) -> bool {
        self.drag != [0.0; DRAG_POWERS.len()] || self.drag_of_power[0] != 0.0
    }

    /// Force against the motion per length of a sheet (dyn/cm) of the given `width` (cm), per normal speed `v` (cm/s): dyn·s/cm².
    pub fn drag_per_speed(&self, width: f64, v: f64) -> f64 {
        let [linear, quadratic, cubic] = self.drag;
        let ratio = v.abs() / DRAG_SPEED;
        let [coefficient, power] = self.drag_of_power;
        let other = if coefficient == 0.0 { 0.0 } else { coefficient * ratio.max(LEAST_DRAG_RATIO).powf(power - 1.0) };
        0.5 * AIR_DENSITY * width * DRAG_SPEED * (linear + ratio * (quadratic + ratio * cubic) + other)
    }

    /// Torque of a joint beyond eq. 1 (dyn·cm) at the angle and the elastic angle `delta` (rad) and the rate (rad/s), for a joint of stiffness `k`
    /// (dyn·cm/rad) that stands for the length `link` (cm): softening, curves and dry friction.
    pub fn torque(&self, k: f64, link: f64, [angle, delta]: [f64; 2], rate: f64) -> f64 {
        let softened = k * delta * self.softened(delta / link).min(1.0 - LEAST_STIFFNESS);
        softened - self.moment_of_curvature.at(delta / link)[0] - self.friction(link, self.dry_moment(k, link, angle), rate)[0]
    }

    /// Moment of dry friction (dyn·cm) of a joint of stiffness `k` (dyn·cm/rad) that stands for the length `link` (cm) at an angle (rad).
    pub fn dry_moment(&self, k: f64, link: f64, angle: f64) -> f64 {
        if !self.has_friction_of_bending() {
            return self.dry_friction;
        }
        let of_curvature = self.friction_of_curvature.at(angle.abs() / link)[0];
        (self.dry_friction + self.friction_of_bending * k * angle.abs() + of_curvature).max(0.0)
    }

    /// The share of a joint's stiffness that softening takes at an elastic curvature (1/cm), before its limit.
    pub fn softened(&self, curvature: f64) -> f64 {
        if self.softening_exponent == 2.0 {
            self.softening * curvature.powi(2)
        } else {
            let unit = SOFTENING_CURVATURE;
            self.softening * unit * unit * (curvature.abs() / unit).powf(self.softening_exponent)
        }
    }

    /// Moment against a joint's rate (rad/s) and its derivative (dyn·cm, dyn·cm·s): dry friction of the moment `dry` and the curve of the rate.
    pub fn friction(&self, link: f64, dry: f64, rate: f64) -> [f64; 2] {
        let [mut moment, mut slope] = [0.0; 2];
        if dry != 0.0 {
            let share = (rate / DRY_FRICTION_RATE).tanh();
            moment = dry * share;
            slope = dry / DRY_FRICTION_RATE * (1.0 - share * share);
        }
        if !self.moment_of_rate.is_zero() {
            let [value, tangent] = self.moment_of_rate.at(rate / link);
            moment += value;
            slope += tangent / link;
        }
        [moment, slope]
    }
}
