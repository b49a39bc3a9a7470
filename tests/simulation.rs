//! The library's front door: the bits of an experiment, step by step, and what it refuses.

use sfers::drive::{Drive, Waveform, gait};
use sfers::engine::{EngineError, JointState};
use sfers::experiment::{self, Control, Experiment, SavedState, Source};
use sfers::model::Robot;
use sfers::simulation::{EngineKind, FrictionModel, Options, Simulation, SimulationError, Start};

const JUMP: &str = "[robot]\nmotors_per_actuator = 2\ndamping_eta = 0.03\n[robot.friction]\nlow = 1.0\nhigh = 1.0\nfilm = \"right-end\"\n\
                    [drive]\nwaveform = \"gait\"\ngait = \"crawl\"\nfrequency_hz = 53\n\
                    [simulation]\ntime_step_s = 1e-4\nduration_s = 0.05\nrecord_every_steps = 1\n";

fn read(text: &str) -> Experiment {
    experiment::experiment(&Source::from_text("test", text)).unwrap_or_else(|error| panic!("{error}"))
}

fn jump(engine: &str) -> Experiment {
    read(&format!("{JUMP}engine = \"{engine}\"\n"))
}

/// The same as a program writes it.
fn jumping(engine: EngineKind) -> Simulation {
    let robot = Robot::crawler()
        .with_motors_per_actuator(2)
        .with_damping_eta(0.03)
        .with_friction(1.0, 1.0)
        .with_film(sfers::model::Film::RightEnd, 0.5);
    Simulation::new(robot, Drive::gait("crawl", 1.0 / 53.0).unwrap(), Options { engine, ..Options::default() }).unwrap()
}

/// Angles, rates, torques, voltages on the joints, then places and velocities of the nodes.
fn state(simulation: &mut Simulation) -> Vec<f64> {
    let JointState { angles, rates, torques, motor_voltages } = simulation.joints().unwrap();
    let mut all = [angles.as_slice(), rates, torques, motor_voltages].concat();
    let nodes = simulation.nodes().unwrap();
    all.extend(nodes.iter().flat_map(|node| node.position).chain(nodes.iter().flat_map(|node| node.velocity)));
    all
}

/// The same of a row of a recording.
fn recorded(run: &experiment::Run, row: usize) -> Vec<f64> {
    let r = &run.recording;
    let (joints, nodes) = (r.joints(), r.nodes());
    let mut all = Vec::new();
    for of_joints in [&r.angles, &r.rates, &r.torques, &r.motor_voltages] {
        all.extend_from_slice(&of_joints[row * joints..(row + 1) * joints]);
    }
    for of_nodes in [&r.positions, &r.node_velocities] {
        let row = &of_nodes[3 * row * nodes..3 * (row + 1) * nodes];
        all.extend(row.chunks_exact(3).flat_map(|node| [node[0], node[2]]));
    }
    all
}

fn bits(values: &[f64]) -> Vec<u64> {
    values.iter().map(|value| value.to_bits()).collect()
}

fn run(experiment: &Experiment) -> experiment::Run {
    experiment::run(experiment, experiment.engine().unwrap().as_mut(), |_| Control::Continue).unwrap()
}

/// Compares all records of a run with a simulation, read at every step.
fn compare(experiment: &Experiment, mut simulation: Simulation) {
    let run = run(experiment);
    assert_eq!(run.recording.len() as u64, experiment.steps);
    for row in 0..run.recording.len() {
        assert_eq!(simulation.time(), run.recording.time[row]);
        assert_eq!(bits(&state(&mut simulation)), bits(&recorded(&run, row)), "step {row}");
        simulation.step().unwrap();
    }
}

#[test]
fn a_simulation_has_the_bits_of_an_experiment_on_both_engines() {
    compare(&jump("bullet"), jumping(EngineKind::Bullet));
    compare(&jump("planar"), jumping(EngineKind::Planar));
}

#[test]
fn reading_changes_nothing_and_running_until_a_time_is_stepping() {
    for engine in [EngineKind::Bullet, EngineKind::Planar] {
        let (mut unseen, mut seen) = (jumping(engine), jumping(engine));
        unseen.run_until(0.02).unwrap();
        let mut touched = false;
        for _ in 0..200 {
            state(&mut seen);
            touched |= !seen.contacts().unwrap().is_empty();
            seen.save().unwrap();
            seen.step().unwrap();
        }
        assert_eq!((unseen.steps(), unseen.time()), (200, 200.0 * 1e-4));
        assert_eq!(bits(&state(&mut unseen)), bits(&state(&mut seen)));
        assert_eq!(unseen.contacts().unwrap(), seen.contacts().unwrap());
        assert!(touched);
    }
}

#[test]
fn an_experiment_with_effects_has_its_bits_however_it_is_read() {
    let effects = "[[effect]]\nid = \"creep\"\nper_decade = 0.1\n[[effect]]\nid = \"time-delay\"\ndelay_s = 0.0021\n";
    for engine in ["bullet", "planar"] {
        let experiment = read(&format!("{JUMP}engine = \"{engine}\"\n{effects}"));
        compare(&experiment, Simulation::of(experiment.clone()).unwrap());
        let mut simulation = Simulation::of(experiment.clone()).unwrap();
        for _ in 0..300 {
            // Voltages that are set, read and taken back leave no trace.
            simulation.joints().unwrap();
            simulation.set_voltages(&[100.0; 5]).unwrap();
            simulation.joints().unwrap();
            simulation.follow_drive().unwrap();
            simulation.nodes().unwrap();
            simulation.save().unwrap();
            simulation.step().unwrap();
        }
        assert_eq!(bits(&state(&mut simulation)), bits(&recorded(&run(&experiment), 300)), "{engine}");
    }
}

#[test]
fn a_saved_state_goes_on_with_the_same_bits() {
    for engine in [EngineKind::Bullet, EngineKind::Planar] {
        let (mut first, mut second) = (jumping(engine), jumping(engine));
        first.run_until(0.0137).unwrap();
        let text = serde_json::to_string(&first.save().unwrap()).unwrap();
        let saved: SavedState = serde_json::from_str(&text).unwrap();
        // Where it stands does not matter.
        second.run_until(0.003).unwrap();
        second.joints().unwrap();
        second.restore(&saved).unwrap();
        assert_eq!((second.steps(), second.time()), (137, first.time()));
        for _ in 0..200 {
            assert_eq!(bits(&state(&mut first)), bits(&state(&mut second)));
            first.step().unwrap();
            second.step().unwrap();
        }
    }
}

#[test]
fn a_state_of_another_robot_engine_or_step_is_refused() {
    let mut simulation = jumping(EngineKind::Planar);
    simulation.run_until(0.01).unwrap();
    let before = state(&mut simulation);
    let other = |robot: Robot, options: Options| {
        let voltages = vec![0.0; robot.actuators];
        Simulation::new(robot, Drive::dc(voltages), options).unwrap().save().unwrap()
    };
    let same = simulation.robot().clone();
    for (saved, word) in [
        (other(Robot::cantilever(), Options::default()), "another actuators"),
        (other(same.clone().with_damping_eta(0.031), Options::default()), "another damping_eta"),
        (other(same.clone(), Options { engine: EngineKind::Bullet, ..Options::default() }), "another engine"),
        (other(same.clone(), Options { time_step: 2e-4, ..Options::default() }), "another time_step"),
    ] {
        let error = simulation.restore(&saved).unwrap_err();
        assert!(matches!(error, SimulationError::State(_)) && error.to_string().contains(word), "{error}");
    }
    assert_eq!(bits(&state(&mut simulation)), bits(&before));
    simulation.restore(&other(same, Options::default())).unwrap();
    assert_eq!(simulation.steps(), 0);
}

#[test]
fn voltages_that_are_set_replace_the_drive() {
    let robot = || Robot::cantilever().with_damping_eta(0.1);
    for engine in [EngineKind::Bullet, EngineKind::Planar] {
        let options = Options { engine, ..Options::default() };
        let mut driven = Simulation::new(robot(), Drive::dc([-1000.0]), options).unwrap();
        let mut set = Simulation::new(robot(), Drive::sine([700.0], 11.0), options).unwrap();
        for _ in 0..300 {
            set.joints().unwrap();
            set.set_voltages(&[-1000.0]).unwrap();
            set.step().unwrap();
            driven.step().unwrap();
        }
        assert_eq!(bits(&state(&mut driven)), bits(&state(&mut set)));
        // From here on the drive again, as from a saved state.
        let mut fresh = Simulation::new(robot(), Drive::sine([700.0], 11.0), options).unwrap();
        fresh.restore(&set.save().unwrap()).unwrap();
        set.follow_drive().unwrap();
        set.run_until(0.05).unwrap();
        fresh.run_until(0.05).unwrap();
        assert_eq!(bits(&state(&mut fresh)), bits(&state(&mut set)));
        assert_ne!(bits(&state(&mut driven)), bits(&state(&mut set)));
    }
}

#[test]
fn a_settled_start_is_that_of_an_experiment() {
    let text = "[robot]\nactuators = 1\nmount = \"clamped\"\n[drive]\nwaveform = \"dc\"\nvoltages_v = [-500]\n\
                [simulation]\nengine = \"planar\"\nstart = \"settled\"\ntime_step_s = 1e-4\nsteps = 50\nrecord_every_steps = 1\n";
    let options = Options { start: Start::Settled, ..Options::default() };
    compare(&read(text), Simulation::new(Robot::cantilever(), Drive::dc([-500.0]), options).unwrap());
}

#[test]
fn what_makes_no_simulation_is_an_error() {
    let one = |drive: Drive, options: Options| Simulation::new(Robot::cantilever(), drive, options).err();
    let (still, planar) = (|| Drive::dc([0.0]), Options::default());
    let bullet = Options { engine: EngineKind::Bullet, ..planar };
    for time_step in [0.0, -1e-4, f64::NAN, f64::INFINITY] {
        for options in [Options { time_step, ..planar }, Options { time_step, ..bullet }] {
            let error = one(still(), options);
            assert!(matches!(error, Some(SimulationError::Engine(EngineError::TimeStep { .. }))), "{time_step}: {error:?}");
        }
    }
    let long = one(still(), Options { time_step: 1.0, ..planar });
    assert!(matches!(long, Some(SimulationError::Engine(EngineError::StepTooLong { .. }))), "{long:?}");
    for voltages in [vec![], vec![1.0, 2.0]] {
        let (given, error) = (voltages.len(), one(Drive::dc(voltages), planar));
        assert_eq!(error, Some(EngineError::Voltages { given, needed: 1 }.into()));
    }
    let crawl = Drive::gait("crawl", 0.1).unwrap();
    assert_eq!(one(crawl.clone(), planar), Some(EngineError::Voltages { given: 5, needed: 1 }.into()));
    let short = Waveform::Gait { gait: gait::find("crawl").unwrap(), parameter: 0.1, on_voltages: vec![1.0] };
    let error = Simulation::new(Robot::crawler(), Drive::new(short), planar).err();
    assert_eq!(error, Some(EngineError::Voltages { given: 1, needed: 5 }.into()));
    for drive in [Drive::dc([f64::NAN]), Drive::dc([1e5]), Drive::sine([1.0], f64::NAN), still().with_positive_gain(0.0)] {
        assert!(matches!(one(drive.clone(), planar), Some(SimulationError::Drive(_))), "{drive:?}");
    }
    for options in [
        Options { start: Start::Settled, ..bullet },
        Options { friction: FrictionModel::Convex, ..bullet },
        Options { numerical_damping: Some(50.0), ..bullet },
        Options { numerical_damping: Some(f64::NAN), ..planar },
        Options { numerical_damping: Some(-1.0), ..planar },
    ] {
        assert!(matches!(one(still(), options), Some(SimulationError::Options(_))), "{options:?}");
    }
    for robot in [
        Robot::cantilever().with_actuators(0),
        Robot::cantilever().with_motors_per_actuator(0),
        Robot::cantilever().with_damping_eta(f64::NAN),
        Robot::cantilever().with_actuator_length_mm(-1.0),
        Robot::cantilever().with_friction(f64::INFINITY, 1.0),
    ] {
        let error = Simulation::new(robot.clone(), Drive::dc(vec![0.0; robot.actuators]), planar).err();
        assert!(matches!(error, Some(SimulationError::Engine(EngineError::Model(_)))), "{robot:?}: {error:?}");
    }
    let adaptive =
        JUMP.replace("time_step_s = 1e-4", "time_step_s = \"auto\"\nengine = \"planar\"").replace("record_every_steps = 1\n", "");
    assert!(matches!(Simulation::of(read(&adaptive)).err(), Some(SimulationError::Options(_))));
}

#[test]
fn times_and_voltages_that_cannot_be_are_refused_and_change_nothing() {
    let mut simulation = jumping(EngineKind::Planar);
    simulation.run_until(0.01).unwrap();
    simulation.run_until(0.01).unwrap();
    let before = state(&mut simulation);
    for time in [0.009, -1.0, f64::NAN, f64::INFINITY, 1e300] {
        let error = simulation.run_until(time).unwrap_err();
        assert!(matches!(error, SimulationError::Time { .. }), "{time}: {error}");
    }
    assert_eq!(simulation.set_voltages(&[0.0; 4]), Err(EngineError::Voltages { given: 4, needed: 5 }.into()));
    for wrong in [f64::NAN, f64::NEG_INFINITY, 2001.0] {
        let error = simulation.set_voltages(&[0.0, wrong, 0.0, 0.0, 0.0]).unwrap_err();
        assert!(matches!(error, SimulationError::Voltage { actuator: 1, .. }), "{error}");
        assert!(error.to_string().starts_with("voltage 2 is "), "{error}");
    }
    assert_eq!(bits(&state(&mut simulation)), bits(&before));
}

#[test]
fn an_experiment_whose_drive_is_of_another_robot_is_an_error_on_both_engines() {
    for engine in ["bullet", "planar"] {
        for drive in [Drive::dc([0.0]), Drive::sine([1.0; 6], 14.0)] {
            let given = if let Waveform::Dc(_) = drive.waveform { 1 } else { 6 };
            let error = Experiment { drive, ..jump(engine) }.engine().err();
            assert_eq!(error, Some(EngineError::Voltages { given, needed: 5 }), "{engine}");
        }
    }
}
