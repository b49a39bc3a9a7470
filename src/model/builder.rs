//! Standard robots and the changes to them: the defaults of experiment files.

use super::units::cm_from_mm;
use super::{Damping, Extensions, Film, Friction, Material, Mount, PointMass, Robot};

impl Robot {
    /// One clamped actuator of three joints.
    ///
    /// # Examples
    /// ```
    /// use sfers::model::Robot;
    /// let robot = Robot::cantilever().with_motors_per_actuator(8).with_damping_eta(0.008);
    /// assert_eq!(robot.joints(), 8);
    /// assert_eq!(robot.check(), Ok(()));
    /// ```
    pub fn cantilever() -> Self {
        Self::crawler().with_actuators(1).with_mount(Mount::Clamped)
    }

    /// Five actuators of three joints each on the ground, with films of high friction at both ends: the robot of an experiment file that
    /// says nothing else.
    pub fn crawler() -> Self {
        Self {
            material: Material::PARAMETER_2,
            actuators: 5,
            motors_per_actuator: 3,
            mount: Mount::Ground,
            damping: Damping::Eta(0.045),
            collision_thickness: 0.1,
            friction: Friction { ground: 1.0, low: 0.2, high: 4.0, film: Film::BothEnds, film_fraction: 0.5 },
            masses: Vec::new(),
            bodies: None,
            extensions: Extensions::default(),
        }
    }

    /// With the laminate of every actuator.
    #[must_use]
    pub fn with_material(self, material: Material) -> Self {
        Self { material, ..self }
    }

    /// With the length of every actuator (mm).
    #[must_use]
    pub fn with_actuator_length_mm(mut self, length: f64) -> Self {
        self.material.actuator_length = cm_from_mm(length);
        self
    }

    /// With the width of the sheet (mm).
    #[must_use]
    pub fn with_width_mm(mut self, width: f64) -> Self {
        self.material.width = cm_from_mm(width);
        self
    }

    /// With the number of actuators, N.
    #[must_use]
    pub fn with_actuators(self, actuators: usize) -> Self {
        Self { actuators, ..self }
    }

    /// With the number of motor-link units per actuator, m.
    #[must_use]
    pub fn with_motors_per_actuator(self, motors_per_actuator: usize) -> Self {
        Self { motors_per_actuator, ..self }
    }

    /// With another mount.
    #[must_use]
    pub fn with_mount(self, mount: Mount) -> Self {
        Self { mount, ..self }
    }

    /// With the reference's `dampingEta` (–).
    #[must_use]
    pub fn with_damping_eta(self, eta: f64) -> Self {
        Self { damping: Damping::Eta(eta), ..self }
    }

    /// With the damping time η of eq. 1 (s).
    #[must_use]
    pub fn with_damping_time_s(self, time: f64) -> Self {
        Self { damping: Damping::Time(time), ..self }
    }

    /// With the thickness of the collision boxes (mm).
    #[must_use]
    pub fn with_collision_thickness_mm(self, thickness: f64) -> Self {
        Self { collision_thickness: cm_from_mm(thickness), ..self }
    }

    /// With the coefficients of friction of the bare robot and of its films (–).
    #[must_use]
    pub fn with_friction(mut self, low: f64, high: f64) -> Self {
        (self.friction.low, self.friction.high) = (low, high);
        self
    }

    /// With the coefficient of friction of the floor (–).
    #[must_use]
    pub fn with_ground_friction(mut self, ground: f64) -> Self {
        self.friction.ground = ground;
        self
    }

    /// With a payload (g) at a distance (mm) from the left end along the sheet.
    #[must_use]
    pub fn with_payload(mut self, mass_g: f64, position_mm: f64) -> Self {
        self.masses.push(PointMass { mass: mass_g, position: cm_from_mm(position_mm) });
        self
    }

    /// With films at `place`, each as long as the share `fraction` of one actuator (–).
    #[must_use]
    pub fn with_film(mut self, place: Film, fraction: f64) -> Self {
        (self.friction.film, self.friction.film_fraction) = (place, fraction);
        self
    }
}
