//! Solver settings of a world.

/// Settings of Bullet's multibody solver and broadphase. CGS units.
///
/// Bullet's own defaults differ from PyBullet's in almost every field, so there is no `Default`: take
/// [`pybullet`](Self::pybullet) and change what you mean to change.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SolverSettings {
    /// Gravity along x, y, z (cm/s²).
    pub gravity: [f64; 3],
    /// Share of a contact's penetration that one step removes (–). Higher pushes apart faster and adds more energy.
    pub erp2: f64,
    /// Error reduction of friction constraints (–).
    pub friction_erp: f64,
    /// Penetration that is left alone (cm).
    pub linear_slop: f64,
    /// Share of the last step's contact impulses that the next step starts from (–).
    pub warmstarting_factor: f64,
    /// The iteration stops when the largest squared change of a velocity in one sweep falls below this (cm²/s² or rad²/s²).
    pub least_squares_residual_threshold: f64,
    /// How far the broadphase looks ahead along the velocity (–); 0 keeps the tightest boxes.
    pub broadphase_velocity_prediction: f64,
    /// Largest number of Gauss-Seidel sweeps per step. Higher converges further and costs more in contact.
    pub solver_iterations: u32,
    /// Islands are solved together until they hold this many constraints; 0 solves each by itself.
    pub minimum_solver_batch_size: u32,
    /// Whether the boxes of sleeping bodies are updated as well.
    pub force_update_all_aabbs: bool,
}

impl SolverSettings {
    /// The values that PyBullet 3.2.7 sets in its world, with the given gravity along −z (cm/s²).
    ///
    /// # References
    /// `PhysicsServerCommandProcessor::createEmptyDynamicsWorld` in Bullet's sources. The process-wide `gDbvtMargin = 0`
    /// goes with them and is set by the first world.
    pub fn pybullet(gravity_down: f64) -> Self {
        Self {
            gravity: [0.0, 0.0, -gravity_down],
            erp2: 0.08,
            friction_erp: 0.2,
            linear_slop: 1e-5,
            warmstarting_factor: 0.1,
            least_squares_residual_threshold: 1e-7,
            broadphase_velocity_prediction: 0.0,
            solver_iterations: 50,
            minimum_solver_batch_size: 0,
            force_update_all_aabbs: false,
        }
    }
}
