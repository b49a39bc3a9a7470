//! Adaptive steps of the planar engine: against solutions in closed form, against fixed steps, and by what must not change them.

use sfers::engine::{Engine, PlanarEngine};
use sfers::experiment::{self, Control, Experiment, Run, Source, presets};

fn read(text: &str) -> Experiment {
    experiment::experiment(&Source::from_text("test", text)).unwrap_or_else(|error| panic!("{error}"))
}

fn preset(name: &str, settings: &[&str]) -> Experiment {
    let mut source = Source::from_text(name, presets::find(name).unwrap().text);
    let always = ["simulation.engine=planar", "simulation.time_step_s=auto"];
    settings.iter().chain(&always).for_each(|setting| source.set(setting).unwrap());
    experiment::experiment(&source).unwrap_or_else(|error| panic!("{error}"))
}

fn try_run(experiment: &Experiment) -> Result<Run, String> {
    let mut engine = experiment.engine().unwrap();
    experiment::run(experiment, engine.as_mut(), |_| Control::Continue).map_err(|error| error.to_string())
}

fn run(experiment: &Experiment) -> Run {
    try_run(experiment).unwrap()
}

/// A mover on films of friction 4 over 0.2.
fn mover(delay_s: f64, more: &[&str]) -> Experiment {
    let delay = format!("drive.delay_s={delay_s}");
    let fixed = [
        &delay,
        "robot.friction.low=0.2",
        "robot.friction.film_fraction=0.6666666666666666",
        "simulation.duration_s=0.833",
        "simulation.step_measure=displacement_sum_mm",
    ];
    preset("mover-three-phase", &fixed.iter().chain(more).copied().collect::<Vec<_>>())
}

/// Fixed steps of 2·10⁻⁷ s gave these; the delays of 20, 50 and 80 ms were not looked at when the tolerances were chosen.
#[test]
fn a_mover_on_rough_films_is_within_a_percent_of_very_short_steps_at_every_delay() {
    let known =
        [(0.005, 1.9422), (0.02, 4.1340), (0.035, 5.1572), (0.05, 5.5054), (0.065, 6.5104), (0.08, 5.9067), (0.1, 5.5614)];
    for (delay_s, converged) in known {
        let found = run(&mover(delay_s, &[]));
        let choice = found.step_choice.unwrap();
        assert!(choice.change <= 1e-3 && choice.measure == "displacement_sum_mm", "{choice:?}");
        let sum = found.measures.displacement_sum_mm.unwrap();
        // Seen: at most 3·10⁻⁴.
        assert!((sum / converged - 1.0).abs() < 2e-3, "{delay_s}: {sum}, {converged}, {choice:?}");
        assert!(found.measures.energy_error.unwrap() < 1e-6, "{:?}", found.energy);
        let steps: u64 = choice.trials.iter().map(|trial| trial.steps).sum();
        assert!(steps < 833_000 / 4, "{steps} steps are no gain over fixed ones");
    }
}

/// Against fixed steps of 5·10⁻⁶ s, where a robot jumps on friction 1 and where a clamped one swings.
#[test]
fn the_automatic_step_keeps_its_promise() {
    let jumping = ["drive.frequency_hz=20", "simulation.duration_s=1.2"];
    for (name, of, measure, error) in [
        ("jump-14hz", jumping, "jump_height_mm", 0.01),
        ("jump-14hz", jumping, "jump_height_mm", 0.001),
        ("cantilever-step", ["simulation.duration_s=0.2"; 2], "tip_amplitude_mm", 0.001),
    ] {
        let settings = [format!("simulation.step_error={error}"), format!("simulation.step_measure={measure}")];
        let automatic = run(&preset(name, &[of[0], of[1], &settings[0], &settings[1]]));
        assert!(automatic.step_choice.as_ref().unwrap().change <= error);
        let mut fixed = Source::from_text(name, presets::find(name).unwrap().text);
        for setting in ["simulation.engine=planar", "simulation.time_step_s=5e-6", of[0], of[1]] {
            fixed.set(setting).unwrap();
        }
        let fine = run(&experiment::experiment(&fixed).unwrap());
        let (a, b) = (automatic.measures.get(measure).unwrap(), fine.measures.get(measure).unwrap());
        assert!((a / b - 1.0).abs() < 2.0 * error, "{name}: {a} {b}");
    }
}

/// With fixed steps from 10⁻³ to 6·10⁻⁵ s the sum of displacements stays at half of what it comes to: a loose promise is one, too.
#[test]
fn no_step_is_promised_on_a_false_plateau() {
    for (delay_s, converged) in [(0.08, 5.9067), (0.065, 6.5104)] {
        for error in [0.05, 0.02, 0.001] {
            let found = run(&mover(delay_s, &[&format!("simulation.step_error={error}")])).measures.displacement_sum_mm.unwrap();
            assert!((found / converged - 1.0).abs() < 2.0 * error, "{delay_s} {error}: {found}");
        }
    }
}

/// With local errors of 10⁻⁷ and 10⁻⁸ cm the stride is −2.311 and −2.309 mm, after −2.367 mm: two runs that agree by chance. Fixed steps from 10⁻⁴ to
/// 5·10⁻⁷ s give −2.346 to −2.354 mm.
#[test]
fn agreement_after_a_large_change_is_confirmed() {
    let found = run(&preset("inchworm", &["simulation.step_measure=stride_mm"]));
    let stride = found.measures.stride_mm.unwrap();
    assert!((-2.36..-2.34).contains(&stride), "{stride}: {:?}", found.step_choice);
}

/// A flat robot without voltages on a slope α slides by ½ g (sin α − μ cos α) t² if that is steeper than the friction angle, and stays otherwise.
#[test]
fn a_robot_slides_down_a_slope_as_a_block_does() {
    let cases = [(20.0, 0.2, true), (30.0, 0.0, true), (20.0, 0.5, false), (20.0, 5.0, false)];
    // By default steps of 1 ms, whose numerical damping shows: 2.4·10⁻⁵ cm.
    for ((degrees, friction, slides), (step_error, allowed)) in
        cases.into_iter().flat_map(|case| [(1e-3, 1e-5), (1e-4, 2e-6)].map(|promise| (case, promise)))
    {
        let text = format!(
            "[robot]\nactuators = 2\nfriction = {{ low = {friction}, film = \"none\" }}\n[[effect]]\nid = \"ground-slope\"\nangle_deg = {degrees}\n\
             [drive]\nwaveform = \"dc\"\nvoltages_v = [0, 0]\n[simulation]\nengine = \"planar\"\nstart = \"settled\"\ntime_step_s = \"auto\"\n\
             step_error = {step_error}\nduration_s = 0.2\nrecord_every_s = 0.01\n"
        );
        let found = run(&read(&text)).recording;
        let (rows, width) = (found.time.len(), 3 * found.nodes());
        let time = found.time[rows - 1];
        let moved = found.positions[(rows - 1) * width] - found.positions[0];
        let angle = f64::to_radians(degrees);
        let expected = if slides { -0.5 * 980.0 * (angle.sin() - friction * angle.cos()) * time * time } else { 0.0 };
        assert!(
            (moved - expected).abs() < allowed * (1.0 + expected.abs()),
            "{degrees} {friction} {step_error}: {moved}, {expected}"
        );
    }
}

/// Records are taken aside: the motion and its measures are the same however many there are, and each lies on the path of the others.
#[test]
fn records_change_nothing() {
    let with = |every: &str| run(&mover(0.035, &[&format!("simulation.record_every_s={every}"), "simulation.duration_s=0.1"]));
    let (dense, sparse) = (with("1e-4"), with("1e-2"));
    assert_eq!(dense.step_choice, sparse.step_choice);
    assert_eq!(dense.measures.displacement_sum_mm, sparse.measures.displacement_sum_mm);
    assert_eq!(dense.measures.aerial, sparse.measures.aerial);
    let (a, b) = (&dense.recording, &sparse.recording);
    let mut same = 0;
    for (row, time) in b.time.iter().enumerate() {
        let Some(at) = a.time.iter().position(|other| (other - time).abs() < 1e-9) else { continue };
        let width = 3 * a.nodes();
        assert_eq!(a.positions[at * width..(at + 1) * width], b.positions[row * width..(row + 1) * width], "at {time} s");
        same += 1;
    }
    assert!(same >= 10, "{same}");
}

/// Measures of whole periods are over the same periods however long the steps, also where the run's half is a whole number of them.
#[test]
fn measures_of_periods_do_not_depend_on_how_a_run_is_stepped() {
    let settings = ["drive.frequency_hz=14", "simulation.duration_s=3", "simulation.step_measure=speed_mm_s"];
    let adaptive = run(&preset("full-frictional-inchworm", &settings)).measures;
    let mut source = Source::from_text("fixed", presets::find("full-frictional-inchworm").unwrap().text);
    for setting in [&settings[..2], &["simulation.engine=planar", "simulation.time_step_s=2e-5"]].concat() {
        source.set(setting).unwrap();
    }
    let fixed = run(&experiment::experiment(&source).unwrap()).measures;
    let [speeds, strides] = [adaptive.speed_mm_s.zip(fixed.speed_mm_s), adaptive.stride_mm.zip(fixed.stride_mm)];
    for (a, b) in [speeds.unwrap(), strides.unwrap()] {
        // Steps of 2e-5 s err by half a percent.
        assert!((a / b - 1.0).abs() < 1e-2, "{a} {b}");
    }
    assert_eq!((adaptive.period_ratio, fixed.period_ratio), (Some(2.0), Some(2.0)));
}

#[test]
fn records_are_as_far_apart_as_record_every_s_says() {
    let every = 2.0 / 1920.0;
    let spaced = |duration: &str| {
        let settings = [&format!("simulation.record_every_s={every}"), duration, "simulation.step_measure=jump_height_mm"];
        run(&preset("jump-on-time", &settings))
    };
    let run = spaced("simulation.duration_s=0.2");
    let times = &run.recording.time;
    let regular = &times[..times.len() - 1];
    assert!(regular.len() >= 190, "{}", regular.len());
    assert!(regular.iter().enumerate().all(|(k, time)| (time - k as f64 * every).abs() < 1e-12), "{times:?}");
    // Where the spacing does not go into the duration, the duration counts, and records are as near as a tenth of a millisecond allows.
    let times = spaced("simulation.duration_s=0.0503").recording.time;
    assert!((times[2] - times[1] - every).abs() < 5e-5, "{times:?}");
}

#[test]
fn bits_do_not_depend_on_threads_and_a_run_goes_on_from_a_saved_state() {
    let experiment = preset("jump-14hz", &["simulation.duration_s=0.2", "simulation.step_measure=jump_height_mm"]);
    let whole = run(&experiment);
    std::thread::scope(|scope| {
        let runs: Vec<_> = (0..2).map(|_| scope.spawn(|| run(&experiment))).collect();
        assert!(runs.into_iter().all(|thread| thread.join().unwrap() == whole));
    });
    // Cut in the middle: both halves keep the promise on what they see, and so does the end.
    let mut half = experiment.clone();
    half.steps /= 2;
    let mut first = half.engine().unwrap();
    experiment::run(&half, first.as_mut(), |_| Control::Continue).unwrap();
    let mut second = experiment.engine().unwrap();
    second.load(first.step(), &first.save().unwrap()).unwrap();
    let rest = experiment::run(&experiment, second.as_mut(), |_| Control::Continue).unwrap();
    assert_eq!(rest.recording.time.last(), whole.recording.time.last());
    let last = |run: &Run| run.recording.positions[run.recording.positions.len() - 1];
    assert!((last(&rest) - last(&whole)).abs() < 1e-3, "{} {}", last(&rest), last(&whole));
}

/// Of second order where nothing happens: a tolerance of a thousandth takes ten times as many steps, and a clamped robot's error falls with it.
#[test]
fn a_robot_that_touches_nothing_needs_steps_as_a_method_of_second_order_does() {
    let with = |error: &str| {
        let settings = ["simulation.duration_s=0.3", "simulation.step_measure=tip_amplitude_mm"];
        run(&preset("cantilever-step", &[&settings[..], &[&format!("simulation.step_error={error}")]].concat()))
    };
    let (coarse, fine) = (with("1e-2"), with("1e-5"));
    let trial = |run: &Run| run.step_choice.as_ref().unwrap().trials[1].clone();
    let (a, b) = (trial(&coarse), trial(&fine));
    let order = (b.steps as f64 / a.steps as f64).ln() / (a.tolerance_cm / b.tolerance_cm).ln();
    // A local error of third order. Steps of 1 ms are no longer for all that.
    assert!((0.28..0.38).contains(&order), "{order}: {a:?} {b:?}");
    let of = |run: &Run| run.measures.tip_amplitude_mm.unwrap();
    assert!((of(&coarse) / of(&fine) - 1.0).abs() < 1e-2, "{} {}", of(&coarse), of(&fine));
}

/// A measure that cannot be had, a result that finer steps go on changing, and input that nobody means: told, or a result; energy from nowhere never.
#[test]
fn what_cannot_be_promised_is_told() {
    let missing = preset("jump-14hz", &["simulation.step_measure=tip_deflection_mm", "simulation.duration_s=0.05"]);
    let told = try_run(&missing).unwrap_err();
    assert!(told.contains("simulation.step_measure") && told.contains("tip_deflection_mm"), "{told}");
    let chaotic =
        preset("jump-14hz", &["simulation.step_measure=speed_mm_s", "simulation.step_error=1e-9", "simulation.duration_s=0.1"]);
    let told = try_run(&chaotic).unwrap_err();
    assert!(told.contains("not converged to 1e-9") && told.contains("speed_mm_s") && told.contains(" cm "), "{told}");
}

#[test]
fn extreme_friction_and_slopes_make_no_energy() {
    for (low, high, more) in
        [(1e6, 1e6, ""), (0.0, 0.0, ""), (0.0, 1e6, ""), (0.3, 4.0, "[[effect]]\nid = \"ground-slope\"\nangle_deg = 25\n")]
    {
        let text = format!(
            "[robot]\nfriction = {{ low = {low}, high = {high} }}\n{more}[drive]\nwaveform = \"gait\"\ngait = \"full-frictional-inchworm\"\n\
             frequency_hz = 9\n[simulation]\nengine = \"planar\"\ntime_step_s = \"auto\"\nstep_error = 0.05\n\
             step_measure = \"jump_height_mm\"\nduration_s = 0.15\n"
        );
        match try_run(&read(&text)) {
            Ok(found) => {
                if found.audited {
                    assert!(found.measures.energy_error.unwrap() < 1e-5, "{low} {high}: {:?}", found.energy);
                }
                assert!(found.recording.positions.iter().all(|place| place.is_finite()));
                // No corner passes the floor: nodes are half the thickness above it, less where the box is turned.
                let lowest = found.recording.positions.iter().skip(2).step_by(3).fold(f64::INFINITY, |low, z| low.min(*z));
                assert!(lowest > -1e-3, "{low} {high}: {lowest}");
            }
            Err(told) => assert!(told.contains("not converged"), "{told}"),
        }
    }
}

/// A robot at any height is the engine's to say when it lands: at a constant speed it is the height over it.
#[test]
fn landings_are_foreseen() {
    let experiment = read(
        "[robot]\nactuators = 1\nmotors_per_actuator = 1\n[drive]\nwaveform = \"dc\"\nvoltages_v = [0]\n[simulation]\nengine = \"planar\"\n\
         time_step_s = 1e-4\nduration_s = 1e-3\n",
    );
    let mut engine = PlanarEngine::new(&experiment.robot, 1e-4).unwrap();
    assert!(engine.landing(1e-3).is_infinite(), "it rests");
    let mut state = engine.save().unwrap();
    let bodies = 2;
    // After angles and motions: the centre of mass and its velocity. Each body falls as fast.
    let centre = 4 * bodies;
    (state[centre + 1], state[centre + 3]) = (state[centre + 1] + 0.02, -5.0);
    (0..bodies).for_each(|i| state[bodies + 3 * i + 2] = -5.0);
    engine.load(0, &state).unwrap();
    let landing = engine.landing(1e-3);
    assert!((landing - 0.02 / 5.0).abs() < 1e-12, "{landing}");
    assert!(engine.landing(6.0).is_infinite(), "slower than asked");
}
