//! From a laminate to a chain of motor-link units.

use super::units::mm_from_cm;
use super::{Extensions, Laminate, Material, ModelError, PointMass};
use crate::actuator::PiezoJoint;
use crate::words::number;

/// How the robot is held.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Mount {
    /// Lying on a floor.
    Ground,
    /// Left end held in the world, no floor.
    Clamped,
    /// Neither held nor supported.
    Free,
}

impl Mount {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::Ground, Self::Clamped, Self::Free];

    /// Name in experiment files.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Ground => "ground",
            Self::Clamped => "clamped",
            Self::Free => "free",
        }
    }
}

/// Where films of high friction are glued under the robot.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Film {
    /// Under both ends.
    BothEnds,
    /// Under the right end.
    RightEnd,
    /// Nowhere.
    None,
}

/// Friction coefficients. Bullet multiplies the floor's with the link's and limits the product to 10.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Friction {
    /// Of the floor (–).
    pub ground: f64,
    /// Of the bare robot (–).
    pub low: f64,
    /// Of the films (–).
    pub high: f64,
    /// Where the films are.
    pub film: Film,
    /// Length of a film as a share of one actuator (–).
    pub film_fraction: f64,
}

/// How much the joints are damped.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Damping {
    /// The reference's `dampingEta` D (–): η = D / (2π · 1 Hz).
    Eta(f64),
    /// η of eq. 1 (s).
    Time(f64),
}

impl Damping {
    /// η of eq. 1 (s).
    pub fn time(self) -> f64 {
        match self {
            Self::Eta(eta) => eta / (2.0 * std::f64::consts::PI * 1.0),
            Self::Time(time) => time,
        }
    }

    /// The reference's `dampingEta` (–).
    pub fn eta(self) -> f64 {
        match self {
            Self::Eta(eta) => eta,
            Self::Time(time) => time * (2.0 * std::f64::consts::PI * 1.0),
        }
    }
}

/// A robot: `actuators` laminates in a row, each made of `motors_per_actuator` motor-link units.
#[derive(Debug, Clone, PartialEq)]
pub struct Robot {
    /// The laminate of every actuator.
    pub material: Material,
    /// Number of actuators, N.
    pub actuators: usize,
    /// Motor-link units per actuator, m.
    pub motors_per_actuator: usize,
    /// How it is held.
    pub mount: Mount,
    /// Damping of the joints.
    pub damping: Damping,
    /// Thickness of the collision boxes (cm). It sets contact and inertia; the laminate itself is thinner.
    pub collision_thickness: f64,
    /// Friction coefficients and films.
    pub friction: Friction,
    /// Payloads.
    pub masses: Vec<PointMass>,
    /// The N·m + 1 bodies, where they were read from a file instead of following from the fields above. They are as the file says: no factor of
    /// [`extensions`](Self::extensions) on masses and frictions applies to them, which an exported file holds already.
    pub bodies: Option<Vec<Segment>>,
    /// What it has beyond the plain model.
    pub extensions: Extensions,
}

/// One body of the chain: a box of `length` × width × thickness.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Segment {
    /// Along x (cm).
    pub length: f64,
    /// Mass (g).
    pub mass: f64,
    /// Friction coefficient of its underside (–).
    pub friction: f64,
}

/// A segment with the masses fixed to it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RigidBody {
    /// Mass (g).
    pub mass: f64,
    /// About y through the centre of mass (g·cm²).
    pub inertia: f64,
    /// Where the centre of mass lies between the left end (0) and the right end (1).
    pub middle: f64,
}

/// Moment of inertia (g·cm²) of a homogeneous box about an axis through its centre along one edge, m (a² + b²)/12, where a and b (cm) are
/// the other two edges.
pub fn box_inertia(mass: f64, a: f64, b: f64) -> f64 {
    mass / 12.0 * (a.powi(2) + b.powi(2))
}

/// Largest number of joints that an experiment may ask for.
pub const MAX_JOINTS: usize = 10_000;

impl Robot {
    /// Number of joints, N·m.
    pub fn joints(&self) -> usize {
        self.actuators * self.motors_per_actuator
    }

    /// Length of a whole link, L/m (cm).
    pub fn link_length(&self) -> f64 {
        self.material.actuator_length / self.motors_per_actuator as f64
    }

    /// Half a link, l = L/(2m) (cm): the length of the first and last body, and of eq. 3.
    pub fn half_link_length(&self) -> f64 {
        0.5 * self.link_length()
    }

    /// The torque law shared by all joints.
    ///
    /// ```text
    /// k = w·(EI/2)/l      θ_V = −β·(V/m)
    /// ```
    pub fn joint(&self) -> PiezoJoint {
        let laminate = Laminate::new(&self.material);
        let scales = &self.extensions;
        PiezoJoint {
            stiffness: self.material.width
                * (laminate.flexural_rigidity / 2.0 / self.half_link_length())
                * scales.stiffness_scale,
            rest_angle_per_volt: -laminate.rotation_per_volt * scales.gain_scale,
            damping_time: self.damping.time() * scales.damping_scale,
        }
    }

    /// The N·m + 1 bodies from left to right. The first and last are half as long and heavy as the others, so that the joints
    /// stand at the middle of the pieces they represent.
    pub fn segments(&self) -> Vec<Segment> {
        if let Some(bodies) = &self.bodies {
            return bodies.clone();
        }
        let Extensions { mass_scale, friction_scale, .. } = self.extensions;
        let m = self.motors_per_actuator as f64;
        let mass = Laminate::new(&self.material).actuator_mass;
        let count = self.joints() + 1;
        let film = self.film_segments();
        let Friction { low, high, film: place, .. } = self.friction;
        (0..count)
            .map(|i| {
                let end = i == 0 || i + 1 == count;
                let on_film = match place {
                    Film::BothEnds => i < film || i + film >= count,
                    Film::RightEnd => i + film >= count,
                    Film::None => false,
                };
                Segment {
                    length: if end { self.half_link_length() } else { self.link_length() },
                    mass: if end { mass / (2.0 * m) } else { mass / m } * mass_scale,
                    friction: if on_film { high } else { low } * friction_scale,
                }
            })
            .collect()
    }

    /// The segments as boxes whose mass is spread evenly, with payloads and the point masses of extensions fixed to them.
    pub fn rigid_bodies(&self) -> Vec<RigidBody> {
        let segments = self.segments();
        let mut left = 0.0;
        let mut bodies = Vec::with_capacity(segments.len());
        for (i, segment) in segments.iter().enumerate() {
            let length = segment.length;
            let last = i + 1 == segments.len();
            let inertia = box_inertia(segment.mass, length, self.collision_thickness);
            let mut body = RigidBody { mass: segment.mass, inertia, middle: 0.5 };
            let here = |point: &&PointMass| point.position >= left && (point.position < left + length || last);
            for point in self.masses.iter().chain(&self.extensions.point_masses).filter(here) {
                let at = ((point.position - left) / length).min(1.0);
                let apart = (at - body.middle) * length;
                let sum = body.mass + point.mass;
                body.inertia += body.mass * point.mass / sum * apart * apart;
                body.middle += point.mass / sum * (at - body.middle);
                body.mass = sum;
            }
            bodies.push(body);
            left += length;
        }
        bodies
    }

    /// The body on which a point stands that lies `position` (cm) along the sheet, and where between its left end (0) and its right end (1).
    pub fn body_at(&self, position: f64) -> (usize, f64) {
        let segments = self.segments();
        let (mut body, mut left) = (0, 0.0);
        while body + 1 < segments.len() && position >= left + segments[body].length {
            left += segments[body].length;
            body += 1;
        }
        (body, ((position - left) / segments[body].length).clamp(0.0, 1.0))
    }

    /// Number of bodies that one film covers: `ceil(m·fraction + 0.5)`, as the reference counts.
    fn film_segments(&self) -> usize {
        (self.motors_per_actuator as f64 * self.friction.film_fraction + 0.5).ceil() as usize
    }

    /// Checks that the material bears a commanded voltage (V) with the factor `positive_gain` (–) on positive ones.
    ///
    /// # Errors
    /// What is wrong with it, as the end of a sentence that begins with the key.
    pub fn check_voltage(&self, voltage: f64, positive_gain: f64) -> Result<(), String> {
        let (applied, gain) = if voltage > 0.0 { (voltage * positive_gain, positive_gain) } else { (voltage, 1.0) };
        let limit = self.material.max_voltage();
        if applied.abs() <= limit {
            return Ok(());
        }
        let times = if gain == 1.0 { String::new() } else { format!(", times positive_gain {} V", number(applied)) };
        Err(format!(
            "is {} V{times}, but the material bears at most {} V, {} kV/mm over the electrode pitch of {} mm; set \
             material.max_field_kv_mm higher if yours bears more",
            number(voltage),
            number(limit),
            number(self.material.max_field / 1e4),
            number(mm_from_cm(self.material.electrode_pitch))
        ))
    }

    /// Checks that the robot can be built.
    ///
    /// # Errors
    /// [`ModelError`] names the key of the experiment file at fault.
    pub fn check(&self) -> Result<(), ModelError> {
        self.material.check()?;
        for (key, value) in [("robot.actuators", self.actuators), ("robot.motors_per_actuator", self.motors_per_actuator)] {
            ModelError::unless((1..=MAX_JOINTS).contains(&value), key, value as f64, "between 1 and 10000")?;
        }
        ModelError::unless(
            self.joints() <= MAX_JOINTS,
            "robot.motors_per_actuator",
            self.motors_per_actuator as f64,
            "such that the robot has at most 10000 joints",
        )?;
        let (damping_key, damping) = match self.damping {
            Damping::Eta(eta) => ("robot.damping_eta", eta),
            Damping::Time(time) => ("robot.damping_time_s", time),
        };
        for (key, value) in [
            (damping_key, damping),
            ("robot.friction.ground", self.friction.ground),
            ("robot.friction.low", self.friction.low),
            ("robot.friction.high", self.friction.high),
        ] {
            ModelError::unless(value.is_finite() && value >= 0.0, key, value, "zero or more")?;
        }
        let thickness = self.collision_thickness;
        ModelError::unless(thickness.is_finite() && thickness > 0.0, "robot.collision_thickness_mm", thickness, "positive")?;
        if let Some(bodies) = &self.bodies {
            let count = bodies.len() as f64;
            ModelError::unless(
                bodies.len() == self.joints() + 1,
                "robot.motors_per_actuator",
                count - 1.0,
                "as many joints as the bodies read",
            )?;
        }
        ModelError::unless(
            self.extensions.clamp_curve.is_rigid() || self.extensions.clamp_hardening == 0.0,
            "effect.hardening_per_rad",
            self.extensions.clamp_hardening,
            "0 beside a clamp whose turn is a curve",
        )?;
        let length = self.material.actuator_length * self.actuators as f64;
        for point in &self.masses {
            let (mass, position) = (point.mass, point.position);
            ModelError::unless(mass.is_finite() && mass >= 0.0, "robot.mass.mass_g", mass, "zero or more")?;
            let on_sheet = (0.0..=length * (1.0 + 1e-12)).contains(&position);
            ModelError::unless(on_sheet, "robot.mass.position_mm", position, "between the ends of the robot")?;
        }
        let fraction = self.friction.film_fraction;
        ModelError::unless(fraction.is_finite() && fraction >= 0.0, "robot.friction.film_fraction", fraction, "zero or more")?;
        let films = match self.friction.film {
            Film::BothEnds => 2 * self.film_segments(),
            Film::RightEnd => self.film_segments(),
            Film::None => 0,
        };
        // The reference lets two films overlap on a very short robot and then breaks on its list of frictions.
        ModelError::unless(
            self.mount != Mount::Ground || films <= self.joints() + 1,
            "robot.friction.film_fraction",
            fraction,
            "such that the films fit under the robot",
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn robot(actuators: usize, motors: usize, film: Film) -> Robot {
        Robot::crawler().with_actuators(actuators).with_motors_per_actuator(motors).with_film(film, 0.5)
    }

    #[test]
    fn segments_carry_the_whole_length_and_mass() {
        let robot = robot(5, 3, Film::BothEnds);
        let segments = robot.segments();
        assert_eq!(segments.len(), 16);
        let laminate = Laminate::new(&robot.material);
        // Sums of 16 rounded terms: a few units in the last place.
        assert!((segments.iter().map(|s| s.length).sum::<f64>() - 50.0).abs() < 1e-13);
        assert!((segments.iter().map(|s| s.mass).sum::<f64>() / laminate.actuator_mass - 5.0).abs() < 1e-14);
    }

    #[test]
    fn points_along_the_sheet_stand_on_their_bodies() {
        // Bodies from 0 to 1.25, 3.75, 6.25, 8.75 and 10 cm.
        let robot = robot(1, 4, Film::None);
        for (position, body, share) in
            [(0.0, 0, 0.0), (1.25, 1, 0.0), (5.0, 2, 0.5), (9.375, 4, 0.5), (10.0, 4, 1.0), (99.0, 4, 1.0)]
        {
            assert_eq!(robot.body_at(position), (body, share), "{position}");
        }
    }

    #[test]
    fn films_cover_as_many_segments_as_in_the_reference() {
        let high = |robot: Robot| robot.segments().iter().map(|s| s.friction == 4.0).collect::<Vec<_>>();
        // m = 1, fraction 0.5: ceil(1.0) = 1; m = 3: ceil(2.0) = 2; m = 4: ceil(2.5) = 3.
        assert_eq!(high(robot(2, 1, Film::BothEnds)), [true, false, true]);
        assert_eq!(high(robot(1, 4, Film::RightEnd)), [false, false, true, true, true]);
        assert_eq!(high(robot(5, 3, Film::BothEnds)).iter().filter(|&&h| h).count(), 4);
        assert_eq!(high(robot(2, 1, Film::None)), [false; 3]);
    }

    #[test]
    fn constants_of_a_size_that_cannot_be_computed_with_are_refused_by_their_key() {
        for size in [1e-300, 1e-21, 1e21, 1e185, 1e308] {
            let mut robot = robot(2, 1, Film::None);
            robot.material.width = size;
            let error = robot.check().unwrap_err().to_string();
            assert!(error.contains("material.width_mm") && error.contains("between 1e-20 and 1e20"), "{error}");
        }
        let mut still = robot(2, 1, Film::None);
        still.material.gravity = 0.0;
        still.friction.low = 0.0;
        assert_eq!(still.check(), Ok(()));
    }

    #[test]
    fn damping_keys_convert_into_each_other() {
        let eta = Damping::Eta(0.045);
        assert_eq!(eta.time(), 0.045 / (2.0 * std::f64::consts::PI));
        assert!((Damping::Time(eta.time()).eta() - 0.045).abs() < 1e-17);
    }

    #[test]
    fn robots_that_cannot_be_built_are_refused() {
        for broken in [
            robot(0, 3, Film::None),
            robot(5, 0, Film::None),
            robot(5, 3, Film::None).with_damping_eta(-1.0),
            robot(1, 2, Film::BothEnds),
        ] {
            assert!(broken.check().is_err(), "{broken:?}");
        }
    }
}
