//! The loop over steps allocates nothing, on either engine; what Bullet does inside is its own.

use assert_no_alloc::{AllocDisabler, assert_no_alloc};
use sfers::drive::Means;
use sfers::engine::Engine;
use sfers::experiment::{self, Source, presets};

#[global_allocator]
static ALLOCATOR: AllocDisabler = AllocDisabler;

/// A chain that the planar engine solves in parts; Bullet takes long for it.
fn long() -> String {
    let [off, on] = ["0, 0, 0, 0, 0, ", "0, 520, -1500, 520, 0, "].map(|group| group.repeat(6));
    format!(
        "[robot]\nactuators = 30\n[drive]\nwaveform = \"sequence\"\nperiod_s = 0.05\n\
         phases = [{{ until = 0.5, voltages_v = [{off}] }}, {{ until = 1.0, voltages_v = [{on}] }}]\n\
         [simulation]\ntime_step_s = 1e-4\nduration_s = 1\n"
    )
}

#[test]
fn steps_allocate_nothing() {
    for engine in ["bullet", "planar"] {
        for name in ["cantilever-ac", "jump-14hz", "long"] {
            let text = presets::find(name).map_or_else(long, |preset| preset.text.to_owned());
            if name == "long" && engine == "bullet" {
                continue;
            }
            let mut source = Source::from_text(name, &text);
            source.set(&format!("simulation.engine={engine}")).unwrap();
            let experiment = experiment::experiment(&source).unwrap();
            let mut robot = experiment.engine().unwrap();
            let mut voltages = vec![0.0; experiment.robot.actuators];
            let nodes = 3 * (experiment.robot.joints() + 2);
            let (mut positions, mut velocities) = (vec![0.0; nodes], vec![0.0; nodes]);
            let mut places = vec![[0.0; 2]; nodes / 3];
            let mut steps = |robot: &mut dyn Engine, means: &mut Means, count: u64| {
                for _ in 0..count {
                    let time = robot.step() as f64 * experiment.time_step;
                    means.over(time, time + experiment.time_step, &mut voltages);
                    robot.prepare(&voltages).unwrap();
                    robot.nodes(&mut positions, &mut velocities).unwrap();
                    robot.places(&mut places).unwrap();
                    robot.advance().unwrap();
                }
            };
            let means = |time: f64| Means::new(&experiment.drive, experiment.robot.actuators, time);
            steps(robot.as_mut(), &mut means(0.0), 10);
            // The same steps twice: the first time may set aside what contact needs that is solved along a path.
            let (begin, state) = (robot.step(), robot.save().unwrap());
            let again = || means(begin as f64 * experiment.time_step);
            steps(robot.as_mut(), &mut again(), 5000);
            robot.load(begin, &state).unwrap();
            let mut means = again();
            assert_no_alloc(|| steps(robot.as_mut(), &mut means, 5000));
        }
    }
}
