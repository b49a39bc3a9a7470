//! The planar engine judged by Bullet, and by the authors' curve. With `-- --nocapture` the figures are printed.

use sfers::engine::{BulletEngine, Engine, PlanarEngine};
use sfers::experiment::{self, Control, Experiment, Source, presets};
use sfers::recording::measures::Measures;

fn preset(name: &str, settings: &[&str]) -> Experiment {
    let mut source = Source::from_text(name, presets::find(name).unwrap().text);
    for setting in settings {
        source.set(setting).unwrap();
    }
    experiment::experiment(&source).unwrap()
}

fn measures(experiment: &Experiment) -> Measures {
    let run = experiment::run(experiment, experiment.engine().unwrap().as_mut(), |_| Control::Continue).unwrap();
    assert!(run.trouble(experiment).is_empty());
    Measures::of(&run.recording, experiment.robot.mount, experiment.drive.period())
}

/// Joint angles every 5 ms under −1500 V from t = 0 on.
fn angles(engine: &mut dyn Engine, h: f64, duration: f64) -> Vec<f64> {
    let every = (5e-3 / h).round() as u64;
    let mut angles = Vec::new();
    for step in 0..=(duration / h).round() as u64 {
        engine.prepare(&[-1500.0]).unwrap();
        if step.is_multiple_of(every) {
            angles.extend_from_slice(&engine.joints().angles);
        }
        engine.advance().unwrap();
    }
    angles
}

fn largest_difference(a: &[f64], b: &[f64]) -> f64 {
    assert_eq!(a.len(), b.len());
    a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

/// Over the step response the planar engine tends with h² to the limit that Bullet tends to with h.
#[test]
#[ignore = "slow: run by scripts/test.sh"]
fn angles_of_the_step_response_converge_to_bullets_limit() {
    let robot = preset("cantilever-step", &[]).robot;
    let duration = 0.5;
    let bullet = |h: f64| angles(&mut BulletEngine::new(&robot, h).unwrap(), h, duration);
    let planar = |h: f64| angles(&mut PlanarEngine::new(&robot, h).unwrap(), h, duration);
    // Bullet's first-order error taken out.
    let (coarse, fine) = (bullet(2e-6), bullet(1e-6));
    let limit: Vec<f64> = coarse.iter().zip(&fine).map(|(a, b)| 2.0 * b - a).collect();
    let own = largest_difference(&fine, &limit);
    let errors = [4e-5, 2e-5, 1e-5].map(|h| largest_difference(&planar(h), &limit));
    let [a, b, c] = errors;
    println!("from Bullet's limit: {a:.1e}, {b:.1e}, {c:.1e} rad at 4e-5, 2e-5, 1e-5 s; Bullet at 1e-6 s {own:.1e} rad");
    // Seen: Bullet's own 1.4e-5; the planar engine 5.9e-6, 1.5e-6, 3.6e-7 rad.
    assert!(errors[2] < 1e-6 && errors[2] < own, "{errors:?}, Bullet at 1e-6 s: {own:e}");
    assert!((3.3..4.7).contains(&(errors[0] / errors[1])), "{errors:?}");
}

#[test]
fn the_static_tip_is_bullets() {
    let settings = ["simulation.duration_s=1.5", "simulation.time_step_s=1e-5", "robot.damping_eta=0.03"];
    let bullet = measures(&preset("cantilever-dc", &settings)).tip_deflection_mm.unwrap();
    let settled = preset(
        "cantilever-dc",
        &["simulation.engine=planar", "simulation.start=settled", "simulation.time_step_s=1e-4", "simulation.duration_s=0.01"],
    );
    let planar = measures(&settled).tip_deflection_mm.unwrap();
    println!("static tip: planar {planar} mm, Bullet {bullet} mm, apart {:.1e}", planar / bullet - 1.0);
    // Seen: 3e-8.
    assert!((planar / bullet - 1.0).abs() < 1e-6, "{planar} {bullet}");
}

#[test]
#[ignore = "slow: run by scripts/test.sh"]
fn the_frequency_response_is_bullets() {
    for frequency in [1.0, 5.0, 10.0, 15.0, 20.0, 25.0, 30.0, 40.0_f64] {
        // Long enough for the transient to die: e^(−ζω t) with ζω = 8/s. Bullet's error is of first order: taken out.
        let duration = 2.0;
        let of = |engine: &str, step: f64| {
            let settings = [
                format!("simulation.engine={engine}"),
                format!("drive.frequency_hz={frequency}"),
                format!("simulation.time_step_s={step}"),
                format!("simulation.duration_s={duration}"),
                "simulation.record_every_s=2e-4".into(),
            ];
            measures(&preset("cantilever-ac", &settings.each_ref().map(String::as_str))).tip_amplitude_mm.unwrap()
        };
        let bullet = 2.0 * of("bullet", 1e-5) - of("bullet", 2e-5);
        let planar = of("planar", 2e-5);
        println!("{frequency} Hz: planar {planar:.5} mm, Bullet {bullet:.5} mm, apart {:.1e}", planar / bullet - 1.0);
        // Seen: at most 6.4e-5, at 40 Hz.
        assert!((planar / bullet - 1.0).abs() < 2e-4, "{frequency} Hz: {planar} {bullet}");
    }
}

#[test]
#[ignore = "slow: run by scripts/test.sh"]
fn jumps_and_strides_are_bullets() {
    let jump = |engine: &str| {
        let settings = [
            format!("simulation.engine={engine}"),
            "simulation.time_step_s=1e-5".into(),
            "simulation.duration_s=1.2".into(),
            "simulation.record_every_s=2e-4".into(),
        ];
        measures(&preset("jump-14hz", &settings.each_ref().map(String::as_str)))
    };
    let (bullet, planar) = (jump("bullet"), jump("planar"));
    let (a, b) = (bullet.jump_height_mm.unwrap(), planar.jump_height_mm.unwrap());
    println!(
        "14 Hz jump: planar {b:.3} mm, Bullet {a:.3} mm; period ratios {:?}, {:?}",
        planar.period_ratio, bullet.period_ratio
    );
    // Seen: 0.007 mm.
    assert!((a - b).abs() < 0.1, "{a} {b}");
    assert_eq!((bullet.period_ratio, planar.period_ratio), (Some(2.0), Some(2.0)));
    for friction in ["0.3", "1.0"] {
        let stride = |engine: &str, step: &str| {
            let settings = [
                format!("simulation.engine={engine}"),
                format!("simulation.time_step_s={step}"),
                "simulation.duration_s=2".into(),
                "robot.friction.film=none".into(),
                format!("robot.friction.low={friction}"),
            ];
            measures(&preset("inchworm", &settings.each_ref().map(String::as_str))).stride_mm.unwrap()
        };
        // Bullet's own scatter by 3 % with the step and with the order of its contacts.
        let bullets = [1e-5, 5e-6].map(|step: f64| stride("bullet", &step.to_string()));
        let (bullet, planar) = (0.5 * (bullets[0] + bullets[1]), stride("planar", "1e-5"));
        let apart = 100.0 * (planar / bullet - 1.0);
        println!("5 Hz inchworm, friction {friction}: stride planar {planar:.4} mm, Bullet {bullets:.4?} mm, apart {apart:.2} %");
        // Seen: 0.6 % and −2.4 %.
        assert!((planar / bullet - 1.0).abs() < 0.03, "friction {friction}: {planar} {bullets:?}");
    }
}

/// With Coulomb's law steps of 10⁻⁴ s do for a gait on films of friction 4, where the convex model needs 10⁻⁶ s.
#[test]
#[ignore = "slow: run by scripts/test.sh"]
fn coulomb_friction_walks_as_bullet_does_at_long_steps() {
    let speed = |engine: &[&str]| {
        let settings = [
            "drive.on_voltages_v=[300,300,-1500,300,300]",
            "robot.positive_gain=1.733",
            "robot.friction.low=0.2",
            "simulation.duration_s=3",
            "simulation.record_every_s=0.01",
        ];
        measures(&preset("full-frictional-inchworm", &[&settings, engine].concat())).speed_mm_s.unwrap()
    };
    let bullet = speed(&["simulation.time_step_s=1e-5"]);
    let planar = ["simulation.engine=planar", "simulation.time_step_s=1e-4"];
    let coulomb = speed(&planar);
    let convex = speed(&[&planar[..], &["simulation.friction=convex"]].concat());
    println!("films of friction 4: Bullet {bullet:.2}, Coulomb {coulomb:.2}, convex {convex:.2} mm/s");
    // Seen: 24.2, 24.0 and 19.9 mm/s.
    assert!((coulomb / bullet - 1.0).abs() < 0.03, "{coulomb} {bullet}");
    assert!((convex / bullet - 1.0).abs() > 0.1, "{convex} {bullet}");
}

/// The height of a jump for how long the middle actuators are on, at the times of the authors' records (every 12,500 of their steps).
#[test]
fn the_authors_curve_is_met() {
    let rows = include_str!("../src/reproduce/jump_height_vs_on_time.csv").lines().filter(|line| line.starts_with("0."));
    let published: Vec<(f64, f64)> =
        rows.map(|row| row.split_once(',').map(|(t, z)| (t.parse().unwrap(), z.parse().unwrap())).unwrap()).collect();
    assert_eq!(published.len(), 11);
    let interval = 12_500.0 * 2e-5 / 240.0;
    let height = |on_time: f64| {
        let settings = [
            "simulation.engine=planar".into(),
            "simulation.time_step_s=1e-4".into(),
            "simulation.duration_s=0.25".into(),
            "simulation.record_every_steps=1".into(),
            format!("drive.on_time_s={on_time}"),
        ];
        let experiment = preset("jump-on-time", &settings.each_ref().map(String::as_str));
        let run = experiment::run(&experiment, experiment.engine().unwrap().as_mut(), |_| Control::Continue).unwrap();
        let r = &run.recording;
        // Between two steps the nodes' heights are linear.
        let lowest = |t: f64| {
            let i = ((t / 1e-4) as usize).min(r.len() - 2);
            let share = (t - r.time[i]) / 1e-4;
            let z = |node: usize| (1.0 - share) * r.node(i, node)[2] + share * r.node(i + 1, node)[2];
            (0..r.nodes()).map(z).fold(f64::INFINITY, f64::min)
        };
        (1..).map(|k| k as f64 * interval).take_while(|t| *t < 0.249).map(|t| 10.0 * lowest(t)).fold(0.0, f64::max)
    };
    let ours: Vec<(f64, f64)> = published.iter().map(|&(t, _)| (t, height(t))).collect();
    let square: f64 = ours.iter().zip(&published).map(|(a, b)| (a.1 - b.1).powi(2)).sum();
    let rms = (square / published.len() as f64).sqrt();
    let best = ours.iter().max_by(|a, b| a.1.total_cmp(&b.1)).unwrap();
    println!("authors' curve: {rms:.4} mm rms apart, highest {:.3} mm at {} s", best.1, best.0);
    // Seen: 0.046 mm.
    assert!(rms < 0.06, "{rms} mm: {ours:?}");
    assert_eq!(best.0, 0.024);
}
