//! Coulomb's friction on the planar engine, as solved in every step: against Bullet, against finer steps, and by the law itself.

use sfers::drive::Means;
use sfers::engine::{Engine, PlanarEngine};
use sfers::experiment::{self, Control, Experiment, Source, presets};

fn preset(name: &str, settings: &[&str]) -> Experiment {
    let mut source = Source::from_text(name, presets::find(name).unwrap().text);
    settings.iter().chain(&["simulation.engine=planar"]).for_each(|setting| source.set(setting).unwrap());
    experiment::experiment(&source).unwrap()
}

/// A mover on films of friction 4 over 0.2.
fn mover(delay_s: f64, time_step_s: f64) -> Experiment {
    let settings = [format!("drive.delay_s={delay_s}"), format!("simulation.time_step_s={time_step_s}")];
    let fixed = ["robot.friction.low=0.2", "robot.friction.film_fraction=0.6666666666666666", "simulation.duration_s=0.833"];
    let settings: Vec<&str> = settings.iter().map(String::as_str).chain(fixed).collect();
    preset("mover-three-phase", &settings)
}

/// `sfers run` of the mover on Bullet at 10⁻⁵ s, which 5·10⁻⁶ s change by 0.01 mm, and on this engine at 2·10⁻⁷ s.
#[test]
fn a_mover_on_rough_films_goes_as_on_bullet_at_every_delay() {
    let known = [
        (0.005, 1.93, 1.9422),
        (0.02, 4.11, 4.1340),
        (0.035, 5.16, 5.1572),
        (0.05, 5.51, 5.5054),
        (0.065, 6.40, 6.5104),
        (0.08, 5.74, 5.9067),
        (0.1, 5.57, 5.5614),
    ];
    let (mut apart, mut paths) = (0.0, 0);
    for (delay, bullet, converged) in known {
        for (step, within) in [(1e-4, 0.03), (1e-5, 0.003)] {
            let experiment = mover(delay, step);
            let mut engine = PlanarEngine::new(&experiment.robot, step).unwrap();
            let run = experiment::run(&experiment, &mut engine, |_| Control::Continue).unwrap();
            let found = run.measures.displacement_sum_mm.unwrap();
            // Seen: at most 2.2 % and 0.08 %.
            assert!((found / converged - 1.0_f64).abs() < within, "{delay} {step}: {found}, {converged}");
            apart += if step == 1e-5 { (found - bullet).powi(2) } else { 0.0 };
            paths += engine.paths();
        }
    }
    // Seen: 0.075 mm.
    let apart = (apart / known.len() as f64).sqrt();
    assert!(apart < 0.1, "{apart} mm (rms) from Bullet");
    assert!(paths > 100, "{paths} paths");
}

/// A robot on which plastic impacts in two stages end elsewhere than in one. Where a corner that lands within a step is stopped over two steps, it goes
/// −43, −58, −50 and −45 mm/s at 10⁻⁴, 10⁻⁵, 10⁻⁶ and 10⁻⁷ s.
#[test]
fn finer_steps_lead_where_adaptive_ones_do() {
    let text = "[robot]\nactuators = 6\nmotors_per_actuator = 1\ndamping_eta = 0.0207\nfriction = { low = 0.547, film = \"none\" }\n\
                [drive]\nwaveform = \"sequence\"\nfrequency_hz = 15.211\nphases = [\
                { until = 0.25, voltages_v = [520, 520, -1500, -1500, -1500, 0] }, \
                { until = 0.5, voltages_v = [0, 520, 0, 520, 520, -1500] }, \
                { until = 0.75, voltages_v = [-1500, 0, 520, 0, 0, 0] }, \
                { until = 1.0, voltages_v = [-1500, 0, -1500, 520, 0, -1500] }]\n\
                [simulation]\nengine = \"planar\"\nduration_s = 0.1315\nrecord_every_s = 0.01\n";
    let speed = |step: &str| {
        let experiment = experiment::experiment(&Source::from_text("lands", format!("{text}{step}"))).unwrap();
        let run = experiment::run(&experiment, experiment.engine().unwrap().as_mut(), |_| Control::Continue).unwrap();
        run.measures.speed_mm_s.unwrap()
    };
    let adaptive = speed("time_step_s = \"auto\"\nstep_measure = \"speed_mm_s\"\n");
    // Seen: 3.9, 0.6, 0.08 and 0.009 %.
    for (step, within) in [("1e-4", 0.06), ("2e-5", 0.01), ("5e-6", 2e-3), ("1e-6", 5e-4)] {
        let found = speed(&format!("time_step_s = {step}\n"));
        assert!((found / adaptive - 1.0).abs() < within, "{step}: {found}, {adaptive}");
    }
}

/// Forces of a floor are in their cone, and what slides is pushed against its motion, whatever the robot and its friction: half of them rough.
#[test]
fn coulombs_law_holds_in_every_step() {
    let (mut touched, mut slid, mut paths) = (0, 0, 0);
    for case in 0..24_u32 {
        // Numbers from 0 to 1 that fill it evenly.
        let share = |k: u32| (0.5 + f64::from(case + 1) * [0.618_034, 0.754_878, 0.569_840, 0.819_173][k as usize]).fract();
        let (low, high) = (0.05 * 100.0_f64.powf(share(0)), 0.1 * 50.0_f64.powf(share(1)));
        let (actuators, motors) = (1 + (7.0 * share(2)) as usize, 1 + (4.0 * share(3)) as usize);
        let volts: Vec<String> =
            (0..actuators).map(|i| if (i + case as usize) % 3 == 1 { "-1500" } else { "520" }.into()).collect();
        let experiment = experiment::experiment(&Source::from_text(
            "rough",
            format!(
                "[robot]\nactuators = {actuators}\nmotors_per_actuator = {motors}\nfriction = {{ low = {low}, high = {high}, film_fraction = 0.25 }}\n\
                 [drive]\nwaveform = \"sequence\"\nfrequency_hz = {}\nphases = [{{ until = 0.5, voltages_v = [{}] }}, \
                 {{ until = 1.0, voltages_v = [{}] }}]\n[simulation]\nengine = \"planar\"\ntime_step_s = 1e-4\nduration_s = 0.3\n",
                2.0 + 16.0 * share(1),
                volts.join(", "),
                vec!["0"; actuators].join(", ")
            ),
        ))
        .unwrap();
        let friction: Vec<f64> = experiment.robot.segments().iter().map(|segment| segment.friction).collect();
        let mut engine = PlanarEngine::new(&experiment.robot, 1e-4).unwrap();
        let (mut voltages, mut contacts) = (vec![0.0; actuators], Vec::new());
        for step in 0..3000 {
            let time = f64::from(step) * 1e-4;
            Means::new(&experiment.drive, actuators, time).over(time, time + 1e-4, &mut voltages);
            engine.prepare(&voltages).unwrap();
            engine.advance().unwrap();
            engine.contacts(&mut contacts).unwrap();
            for contact in &contacts {
                let [x, z] = contact.force;
                let most = friction[contact.link] * z;
                // Of rounding in a stiff contact: a velocity of 10⁻¹² cm/s is 10⁻² dyn at this step.
                assert!(z >= 0.0 && x.abs() <= most + 1e-6 * most + 0.1, "case {case}, step {step}: {contact:?}, {most}");
                touched += 1;
                slid += u32::from(x.abs() > (1.0 - 1e-6) * most);
            }
        }
        paths += engine.paths();
    }
    // All kinds of contact were there. Seen: 300 paths.
    println!("{touched} contacts, {slid} of them slid, {paths} paths");
    assert!(slid > 1000 && touched > slid + 1000 && paths > 50, "{touched} {slid} {paths}");
}
