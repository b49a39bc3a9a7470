//! Build, drive, step, read: the crawler's gait at 14 Hz, and where its ends are every tenth of a second.
//!
//! cargo run --release --example first_steps

use sfers::drive::Drive;
use sfers::model::Robot;
use sfers::simulation::{Options, Simulation, SimulationError};

fn main() -> Result<(), SimulationError> {
    let robot = Robot::crawler().with_friction(1.0, 1.0);
    let mut simulation = Simulation::new(robot, Drive::gait("crawl", 1.0 / 14.0)?, Options::default())?;
    for tenth in 1..=5 {
        simulation.run_until(0.1 * f64::from(tenth))?;
        let nodes = simulation.nodes()?;
        let [left, right] = [0, nodes.len() - 1].map(|node| nodes[node].position.map(|part| 10.0 * part));
        println!(
            "{:.1} s: ends at x = {:.2} and {:.2} mm, z = {:.2} and {:.2} mm",
            0.1 * f64::from(tenth),
            left[0],
            right[0],
            left[1],
            right[1]
        );
    }
    Ok(())
}
