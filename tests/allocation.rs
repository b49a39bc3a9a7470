//! The loop over steps allocates nothing, on either engine; what Bullet does inside is its own.

use assert_no_alloc::{AllocDisabler, assert_no_alloc};
use sfers::drive::Means;
use sfers::experiment::{self, Source, presets};

#[global_allocator]
static ALLOCATOR: AllocDisabler = AllocDisabler;

#[test]
fn steps_allocate_nothing() {
    for engine in ["bullet", "planar"] {
        for name in ["cantilever-ac", "jump-14hz"] {
            let mut source = Source::from_text(name, presets::find(name).unwrap().text);
            source.set(&format!("simulation.engine={engine}")).unwrap();
            let experiment = experiment::experiment(&source).unwrap();
            let mut robot = experiment.engine().unwrap();
            let mut voltages = vec![0.0; experiment.robot.actuators];
            let mut means = Means::new(&experiment.drive, experiment.robot.actuators, 0.0);
            let nodes = 3 * (experiment.robot.joints() + 2);
            let (mut positions, mut velocities) = (vec![0.0; nodes], vec![0.0; nodes]);
            let mut steps = |count: u64| {
                for _ in 0..count {
                    let time = robot.step() as f64 * experiment.time_step;
                    means.over(time, time + experiment.time_step, &mut voltages);
                    robot.prepare(&voltages).unwrap();
                    robot.nodes(&mut positions, &mut velocities).unwrap();
                    robot.advance().unwrap();
                }
            };
            // The first steps may set aside what later ones use.
            steps(10);
            assert_no_alloc(|| steps(5000));
        }
    }
}
