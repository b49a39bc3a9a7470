//! The effects that act on bodies, clamp and floor, on Bullet: as the planar engine has them, and as mechanics says.

mod common;

use common::advance;
use sfers::engine::{BulletEngine, Engine, FrictionModel, PlanarEngine};
use sfers::experiment::{self, Control, Experiment, Source};
use sfers::model::Robot;

const GRAVITY: f64 = 980.0;
/// Of one actuator (g), and of the robot of five.
const ACTUATOR_MASS: f64 = 4.804359999999999;
const ROBOT_MASS: f64 = 5.0 * ACTUATOR_MASS;

fn robot(text: &str, id: &str, values: &[(&str, f64)]) -> Robot {
    let values: String = values.iter().map(|(name, value)| format!("{name} = {value:?}\n")).collect();
    experiment::experiment(&Source::from_text("test", format!("{text}\n[[effect]]\nid = \"{id}\"\n{values}"))).unwrap().robot
}

fn cantilever(damping: f64, id: &str, values: &[(&str, f64)]) -> Robot {
    let text = format!(
        "[robot]\nactuators = 1\nmount = \"clamped\"\ndamping_eta = {damping:?}\n[drive]\nwaveform = \"dc\"\nvoltages_v = [0]\n[simulation]\n\
         time_step_s = 1e-5\nduration_s = 0.1\n"
    );
    robot(&text, id, values)
}

/// A robot of six bodies on the floor, with one coefficient of friction.
fn on_the_floor(friction: f64, id: &str, values: &[(&str, f64)]) -> Robot {
    let text = format!(
        "[robot]\nmotors_per_actuator = 1\n[robot.friction]\nground = 1.0\nlow = {friction:?}\nfilm = \"none\"\n[drive]\nwaveform = \"dc\"\n\
         voltages_v = [0, 0, 0, 0, 0]\n[simulation]\ntime_step_s = 1e-5\nduration_s = 0.1\n"
    );
    robot(&text, id, values)
}

fn step(engine: &mut dyn Engine, volts: &[f64], steps: u64) {
    for _ in 0..steps {
        engine.prepare(volts).unwrap();
        engine.advance().unwrap();
    }
}

/// Joint angles, the root's turn and its height (10 cm) every 5 ms over 0.2 s, from flat, under −600 V.
fn motion(engine: &mut dyn Engine, h: f64) -> Vec<f64> {
    let every = (5e-3 / h).round() as u64;
    let mut angles = Vec::new();
    for _ in 0..=40 {
        engine.prepare(&[-600.0]).unwrap();
        angles.extend_from_slice(&engine.joints().angles);
        let base = engine.base().unwrap();
        angles.extend([base.pitch, 0.1 * base.position[1]]);
        step(engine, &[-600.0], every);
    }
    angles
}

const ON_A_CANTILEVER: [(&str, &[(&str, f64)]); 32] = [
    ("tip-mass", &[("mass_g", 0.2)]),
    ("tip-mass", &[("mass_g", 0.3), ("position_mm", 60.0)]),
    ("tip-mass", &[("mass_g", 0.5), ("position_mm", 4.0)]),
    ("clamp-compliance", &[("compliance_rad_per_n_m", 2.0)]),
    ("clamp-compliance", &[("compliance_rad_per_n_m", 1e-3)]),
    ("clamp-compliance", &[("compliance_rad_per_n_m", 2.0), ("hardening_per_rad", 300.0)]),
    ("clamp-compliance", &[("compliance_rad_per_n_m", 2.0), ("asymmetry", 0.5), ("damping_s", 5e-3)]),
    ("air-drag", &[("drag_coefficient", 40.0)]),
    ("free-joint-memory", &[("share_3", 0.05), ("share_4", 0.1)]),
    ("free-moment-of-deviation", &[("low_per_m", -4.0), ("high_per_m", 4.0), ("above_2_mn_m", 1.0), ("below_3_mn_m", -0.5)]),
    ("free-moment-of-rate", &[("range_per_m_s", 200.0), ("moment_2_mn_m", 0.3), ("moment_5_mn_m", 1.0)]),
    ("free-joint-slip", &[("range_per_m", 2.0), ("moment_4_mn_m", 0.5), ("moment_5_mn_m", 1.0)]),
    ("free-drag", &[("linear", 20.0), ("cubic", 10.0)]),
    ("clamp-compliance", &[("compliance_rad_per_n_m", 2.0), ("damping_s", 5e-3)]),
    ("air-drag", &[("drag_coefficient", 40.0), ("exponent", 1.5)]),
    ("stiffness-softening", &[("softening_mm2", 2000.0), ("exponent", 1.0)]),
    ("structural-damping", &[("loss_factor", 0.05), ("exponent", 0.3)]),
    ("dry-friction", &[("moment_mn_m", 0.3), ("presliding_per_m", 0.5)]),
    ("free-stiffness-along", &[("change_1", -0.4), ("change_3", 0.5), ("change_5", 1.0)]),
    (
        "free-clamp",
        &[
            ("range_mn_m", 4.0),
            ("compliance_2_rad_per_n_m", 0.5),
            ("compliance_4_rad_per_n_m", 2.0),
            ("compliance_6_rad_per_n_m", 0.5),
        ],
    ),
    (
        "free-clamp",
        &[
            ("range_mn_m", 4.0),
            ("compliance_1_rad_per_n_m", 1.0),
            ("compliance_3_rad_per_n_m", 2.0),
            ("compliance_5_rad_per_n_m", 2.0),
            ("compliance_7_rad_per_n_m", 1.0),
        ],
    ),
    (
        "free-clamp",
        &[
            ("compliance_1_rad_per_n_m", 2.0),
            ("compliance_2_rad_per_n_m", 1.5),
            ("compliance_3_rad_per_n_m", 1.2),
            ("compliance_4_rad_per_n_m", 1.0),
            ("compliance_5_rad_per_n_m", 0.8),
            ("compliance_6_rad_per_n_m", 0.6),
            ("compliance_7_rad_per_n_m", 0.5),
            ("damping_s", 5e-3),
        ],
    ),
    ("clamp-shift", &[("compliance_mm_per_n", 20.0)]),
    ("clamp-shift", &[("compliance_mm_per_n", 20.0), ("damping_s", 5e-3)]),
    ("cable-drag", &[("stiffness_n_per_m", 20.0), ("level_mm", -3.0)]),
    ("cable-drag", &[("stiffness_n_per_m", 20.0), ("level_mm", -3.0), ("damping_s", 2e-3)]),
    ("cable-drag", &[("stiffness_n_per_m", 5.0), ("level_mm", 50.0), ("position_mm", 60.0), ("drag_mn", 2.0)]),
    ("cable-drag", &[("stiffness_n_per_m", 5.0), ("level_mm", -50.0), ("below", 0.0), ("position_mm", 60.0)]),
    ("cable-drag", &[("stiffness_n_per_m", 500.0), ("level_mm", 1.0), ("position_mm", 4.0)]),
    // Little, so that Bullet's explicit steps follow the turn of friction within 0.03 rad/s: with 0.02 its error is not yet of first order at 2e-5 s.
    ("structural-damping", &[("bending_loss_factor", 0.001)]),
    (
        "free-joint-friction",
        &[("bend_range_per_m", 4.0), ("moment_1_mn_m", 0.02), ("moment_3_mn_m", 0.1), ("moment_6_mn_m", 0.05)],
    ),
    ("air-drag", &[("drag_coefficient", 40.0), ("linear_m_per_s", 0.5)]),
];

#[test]
fn a_cantilever_moves_as_on_the_planar_engine() {
    for (id, values) in ON_A_CANTILEVER {
        let robot = cantilever(0.008, id, values);
        let bullet = |h: f64| motion(&mut BulletEngine::new(&robot, h).unwrap(), h);
        // Bullet's first-order error taken out.
        let limit: Vec<f64> = bullet(2e-5).iter().zip(bullet(1e-5)).map(|(coarse, fine)| 2.0 * fine - coarse).collect();
        let planar = motion(&mut PlanarEngine::new(&robot, 1e-5).unwrap(), 1e-5);
        let largest = planar.iter().fold(0.0_f64, |largest, angle| largest.max(angle.abs()));
        let apart = planar.iter().zip(&limit).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        // Seen: 1.1e-6 to 7.4e-6 of the largest angle, 1.2e-5 with a curve of the rate, and 3.2e-5 and 3.4e-5 with drag, which the planar engine
        // takes at a step's beginning too.
        let limit = match id {
            "air-drag" | "free-drag" => 1e-4,
            "free-moment-of-rate" => 3e-5,
            // Seen: 1.24e-5 with a damper.
            "clamp-compliance" if values.len() > 1 => 3e-5,
            // Seen: 1.5e-4 and 8.5e-5 where parts of the curve are rigid, so that Bullet's error is not quite of first order; 1.5e-5 with a damper.
            "free-clamp" if values.len() > 5 => 3e-5,
            "free-clamp" => 3e-4,
            _ => 1e-5,
        };
        assert!(apart < limit * largest, "{id} {values:?}: {apart:e} of {largest}");
    }
}

#[test]
fn a_cantilever_rests_as_on_the_planar_engine() {
    for (id, values) in ON_A_CANTILEVER[..7].iter().chain(&ON_A_CANTILEVER[18..21]) {
        let robot = cantilever(0.03, id, values);
        let mut bullet = BulletEngine::new(&robot, 1e-5).unwrap();
        step(&mut bullet, &[-600.0], 150_000);
        let mut planar = PlanarEngine::new(&robot, 1e-4).unwrap();
        planar.settle(&[-600.0]).unwrap();
        let tip = |engine: &mut dyn Engine| {
            engine.prepare(&[-600.0]).unwrap();
            let nodes = 3 * (robot.joints() + 2);
            let (mut positions, mut velocities) = (vec![0.0; nodes], vec![0.0; nodes]);
            engine.nodes(&mut positions, &mut velocities).unwrap();
            positions[nodes - 1]
        };
        let (b, p) = (tip(&mut bullet), tip(&mut planar));
        // Seen: at most 5e-8.
        assert!((b / p - 1.0).abs() < 1e-6, "{id} {values:?}: {b} {p}");
    }
}

#[test]
fn a_cable_lifts_a_robots_end_off_the_floor_as_on_the_planar_engine() {
    // 20 mN at most, a twelfth of the robot's weight.
    let robot = on_the_floor(0.5, "cable-drag", &[("stiffness_n_per_m", 1.0), ("level_mm", 20.0)]);
    let mut bullet = BulletEngine::new(&robot, 1e-5).unwrap();
    step(&mut bullet, &[0.0; 5], 150_000);
    let mut planar = PlanarEngine::new(&robot, 1e-4).unwrap();
    planar.settle(&[0.0; 5]).unwrap();
    let mut moved = PlanarEngine::new(&robot, 1e-4).unwrap();
    step(&mut moved, &[0.0; 5], 15_000);
    let [b, p, m] = [&mut bullet as &mut dyn Engine, &mut planar, &mut moved].map(|engine| {
        let mut nodes = vec![[0.0; 2]; robot.joints() + 2];
        engine.places(&mut nodes).unwrap();
        nodes[robot.joints() + 1][1]
    });
    // Seen: 0.039 cm, 2.4e-4 less on Bullet, and 1e-6 less where the planar engine stepped to rest.
    assert!(p > 0.03 && (b / p - 1.0).abs() < 1e-3 && (m / p - 1.0).abs() < 1e-5, "{b} {p} {m}");
}

#[test]
fn a_clamp_turns_by_its_compliance_times_the_moment() {
    let robot = cantilever(0.03, "clamp-compliance", &[("compliance_rad_per_n_m", 0.5)]);
    let mut engine = BulletEngine::new(&robot, 1e-5).unwrap();
    step(&mut engine, &[0.0], 150_000);
    let moment = ACTUATOR_MASS * GRAVITY * 5.0;
    // The sag shortens the lever. Seen: 6e-5.
    assert!((engine.base().unwrap().pitch / (0.5e-7 * moment) - 1.0).abs() < 2e-4);
}

fn put(engine: &mut BulletEngine, lift: f64, speed: f64) {
    let (world, body) = engine.world();
    let mut base = world.base_state(body).unwrap();
    base.position[2] += lift;
    base.velocity[0] = speed;
    world.set_base_state(body, &base).unwrap();
}

#[test]
fn a_dropped_robot_bounces_to_the_share_of_its_height_that_restitution_says() {
    for share in [0.3, 0.5, 0.8_f64] {
        for h in [2e-5, 1e-5] {
            let robot = on_the_floor(0.5, "contact-restitution", &[("restitution", share)]);
            let mut engine = BulletEngine::new(&robot, h).unwrap();
            put(&mut engine, 0.5, 0.0);
            let (mut peaks, mut before, mut rising) = (Vec::new(), f64::INFINITY, false);
            for _ in 0..(0.15 / h) as u64 {
                step(&mut engine, &[0.0; 5], 1);
                let z = engine.base().unwrap().position[1];
                if rising && z < before {
                    peaks.push(before);
                }
                (rising, before) = (z > before, z);
            }
            // A bounce goes off from within one step's fall of the floor, so a height errs by h v = 6e-4 cm. Seen: at most 4e-4 and
            // 5e-4 cm. Bullet's own rule makes the first 0.019 cm too high at 2e-5 s and a share of 0.8.
            assert!((peaks[0] - share.powi(2) * 0.5).abs() < 1e-3, "{share} at {h}: {peaks:?}");
            assert!((peaks[1] - share.powi(4) * 0.5).abs() < 1.5e-3, "{share} at {h}: {peaks:?}");
        }
    }
}

#[test]
fn what_lies_on_the_floor_does_not_bounce() {
    let robot = on_the_floor(0.5, "contact-restitution", &[("restitution", 0.8)]);
    let mut engine = BulletEngine::new(&robot, 1e-5).unwrap();
    // From 5e-6 cm it comes with 0.1 cm/s, half the threshold.
    put(&mut engine, 5e-6, 0.0);
    for _ in 0..1000 {
        step(&mut engine, &[0.0; 5], 1);
        assert!(engine.base().unwrap().position[1] < 1e-5);
    }
}

/// A robot without drive that is pushed with `speed` (cm/s) on a floor that falls by `slope` (rad): how far and how fast it is after `time` (s), on
/// Bullet and on the planar engine with either model of friction.
fn slide(robot: &Robot, slope: f64, speed: f64, time: f64) -> [[f64; 2]; 3] {
    let h = 1e-5;
    let mut robot = robot.clone();
    robot.extensions.slope = -slope;
    let mut bullet = BulletEngine::new(&robot, h).unwrap();
    put(&mut bullet, 0.0, speed);
    let planar = |friction: FrictionModel| {
        let mut planar = PlanarEngine::new(&robot, h).unwrap();
        planar.set_friction_model(friction);
        let mut state = planar.save().unwrap();
        // Angles of the bodies, then rate and velocity of each, then the centre of mass and its velocity.
        let bodies = robot.joints() + 1;
        (0..bodies).for_each(|i| state[bodies + 3 * i + 1] = speed);
        state[4 * bodies + 2] = speed;
        planar.load(0, &state).unwrap();
        planar
    };
    let (mut convex, mut coulomb) = (planar(FrictionModel::Convex), planar(FrictionModel::Coulomb));
    [&mut bullet as &mut dyn Engine, &mut convex, &mut coulomb].map(|engine| {
        step(engine, &[0.0; 5], (time / h).round() as u64);
        let base = engine.base().unwrap();
        [base.position[0], base.velocity[0]]
    })
}

#[test]
fn static_friction_holds_up_to_its_own_angle_and_sliding_takes_it_away() {
    // Slides from atan 0.7 = 35.0° on; once it slides, from atan 0.5 = 26.6° on.
    let (mu, ratio, speed) = (0.5, 1.4, 1.0);
    let robot = on_the_floor(mu, "stick-slip", &[("static_ratio", ratio), ("stribeck_speed_mm_s", 10.0 * speed)]);
    for degrees in [30.0, 34.5_f64] {
        for [x, v] in slide(&robot, degrees.to_radians(), 0.0, 0.1) {
            // Seen: 7e-6 cm, which Bullet takes to find its contacts.
            assert!(x.abs() < 1e-4 && v.abs() < 1e-6, "{degrees}°: {x} {v}");
        }
    }
    let expected = |slope: f64, start: f64| {
        // Euler's method at a hundredth of the engines' step: errs by 1e-5.
        let (mut x, mut v, dt) = (0.0, start, 1e-7);
        for _ in 0..1_000_000 {
            let mu = mu * (1.0 + (ratio - 1.0) * (-(v / speed) * (v / speed)).exp());
            x += dt * v;
            v += dt * GRAVITY * (slope.sin() - mu * slope.cos());
        }
        [x, v]
    };
    for (degrees, start) in [(36.0_f64, 0.0), (30.0, 5.0)] {
        let slope = degrees.to_radians();
        let [x, v] = expected(slope, start);
        let engines = slide(&robot, slope, start, 0.1);
        for (engine, (share, [at, speed])) in [2e-4, 2e-3, 4e-3].into_iter().zip(engines).enumerate() {
            // Seen: 5e-5, 5e-4 and, where it starts from rest with Coulomb's law, 1.7e-3.
            assert!(
                (at / x - 1.0).abs() < share && (speed / v - 1.0).abs() < share,
                "{degrees}° on {engine}: {at} {speed}, not {x} {v}"
            );
        }
    }
}

/// Speed (cm/s) after `time` (s) of a body that slides with friction μ(v) on a level floor: Runge and Kutta's rule in steps of 1e-6 s.
fn slowed(mu: impl Fn(f64) -> f64, start: f64, time: f64) -> f64 {
    let (mut v, h) = (start, 1e-6);
    for _ in 0..(time / h).round() as u64 {
        let rate = |v: f64| -GRAVITY * mu(v);
        let k1 = rate(v);
        let k2 = rate(v + 0.5 * h * k1);
        let k3 = rate(v + 0.5 * h * k2);
        let k4 = rate(v + h * k3);
        v += h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4);
    }
    v
}

#[test]
fn a_free_curve_of_friction_slows_as_it_says_and_holds_the_named_laws() {
    let (mu, start, time) = (0.2, 20.0, 0.05);
    let changes = |of: &dyn Fn(f64) -> f64| -> Vec<(&'static str, f64)> {
        let speeds = [0.0, 20.0 / 27.0, 20.0 / 9.0, 20.0 / 3.0, 20.0];
        let names = ["change_1", "change_2", "change_3", "change_4", "change_5"];
        names.into_iter().zip(speeds).map(|(name, v)| (name, of(v))).chain([("range_mm_s", 200.0)]).collect()
    };
    let law = |v: f64| 0.5 - 0.06 * v;
    let robot = on_the_floor(mu, "free-floor-friction", &changes(&law));
    let expected = slowed(|v| mu * (1.0 + law(v)), start, time);
    for (engine, [_, v]) in slide(&robot, 0.0, start, time).into_iter().enumerate() {
        // Of first order: both engines take the speed at a step's start. Seen: 2.0e-5 and 1.3e-4.
        assert!((v / expected - 1.0).abs() < 2e-4, "{engine}: {v}, not {expected}");
    }
    let equal = slide(&on_the_floor(mu, "free-floor-friction", &changes(&|_| 0.25)), 0.0, start, time);
    let named = slide(&on_the_floor(mu, "ground-friction", &[("scale", 1.25)]), 0.0, start, time);
    for ([_, a], [_, b]) in equal.into_iter().zip(named) {
        // Seen: equal bits.
        assert!((a / b - 1.0).abs() < 1e-12, "{a} {b}");
    }
    // Stribeck's curve with a speed of 5 cm/s through points of the free one, which a fit need not pass through.
    let stribeck = |v: f64| 0.4 * (-(v / 5.0) * (v / 5.0)).exp();
    let (start, time) = (11.0, 0.04);
    let lines = slide(&on_the_floor(mu, "free-floor-friction", &changes(&stribeck)), 0.0, start, time);
    let named = slide(&on_the_floor(mu, "stick-slip", &[("static_ratio", 1.4), ("stribeck_speed_mm_s", 50.0)]), 0.0, start, time);
    let plain = slowed(|_| mu, start, time);
    for ([_, a], [_, b]) in lines.into_iter().zip(named) {
        // Between points at 2.2, 6.7 and 20 cm/s the lines lie above the curve. Seen: 30 % of what it slows beyond the plain coefficient.
        assert!((a - b).abs() < 0.35 * (b - plain).abs() && b < plain, "{a} {b} {plain}");
    }
}

#[test]
fn viscous_friction_slows_every_link_on_the_floor() {
    // M v' = −μ M g − 6 F v.
    let (start, time, viscous) = (20.0, 0.05, 20.0);
    for mu in [0.0, 0.2] {
        let robot = on_the_floor(mu, "stick-slip", &[("viscous_mn_s_per_m", viscous)]);
        let (rate, dry) = (6.0 * viscous / ROBOT_MASS, mu * GRAVITY);
        let expected = (start + dry / rate) * (-rate * time).exp() - dry / rate;
        for [_, v] in slide(&robot, 0.0, start, time) {
            // Of first order: a step's share of the rate is 5e-5. Seen: 6e-6 without dry friction, at most 5e-5 with it.
            assert!((v / expected - 1.0).abs() < 2e-4, "{mu}: {v}, not {expected}");
        }
    }
}

/// A jump with every effect that the floor and the bodies have.
fn jump(engine: &str) -> Experiment {
    let text = experiment::presets::find("jump-on-time").unwrap().text;
    let effects = "\n[[effect]]\nid = \"contact-restitution\"\nrestitution = 0.3\n[[effect]]\nid = \"stick-slip\"\nstatic_ratio = 1.3\n\
        viscous_mn_s_per_m = 2.0\n[[effect]]\nid = \"tip-mass\"\nmass_g = 0.2\nposition_mm = 270.0\n[[effect]]\nid = \"air-drag\"\n\
        drag_coefficient = 2.0\n";
    let mut source = Source::from_text("jump", text.to_owned() + effects);
    let engine = format!("simulation.engine={engine}");
    for setting in ["drive.on_time_s=0.02", "simulation.duration_s=0.15", "simulation.time_step_s=1e-5", engine.as_str()] {
        source.set(setting).unwrap();
    }
    experiment::experiment(&source).unwrap()
}

#[test]
fn a_jump_with_all_of_them_is_as_high_as_on_the_planar_engine() {
    let height = |engine: &str| {
        let experiment = jump(engine);
        let run = experiment::run(&experiment, experiment.engine().unwrap().as_mut(), |_| Control::Continue).unwrap();
        let r = &run.recording;
        let lowest = |record: usize| (0..r.nodes()).map(|node| r.node(record, node)[2]).fold(f64::INFINITY, f64::min);
        (0..r.len()).map(lowest).fold(0.0, f64::max)
    };
    let (bullet, planar) = (height("bullet"), height("planar"));
    // Seen: 0.774 and 0.770 cm; the plain jump, 0.793 and 0.788 cm, is as far apart.
    assert!((bullet - planar).abs() < 0.01, "{bullet} {planar}");
}

#[test]
fn a_jump_with_all_of_them_goes_on_from_a_saved_state_with_the_same_bits() {
    let experiment = jump("bullet");
    let bits = |engine: &mut dyn Engine, from: u64, to: u64| advance(&experiment, engine, from, to);
    let mut engine = experiment.engine().unwrap();
    let mut from = 0;
    // Before the jump, in the air, and about the landing.
    for at in [1500, 6000, 10_500] {
        bits(engine.as_mut(), from, at);
        from = at;
        let state = engine.save().unwrap();
        let on = bits(engine.as_mut(), at, at + 2000);
        engine.load(at, &state).unwrap();
        assert!(bits(engine.as_mut(), at, at + 2000) == on, "the same engine, step {at}");
        let mut fresh = experiment.engine().unwrap();
        fresh.load(at, &state).unwrap();
        assert!(bits(fresh.as_mut(), at, at + 2000) == on, "a fresh engine, step {at}");
        engine.load(at, &state).unwrap();
    }
}

#[test]
fn a_clamp_that_turns_and_shifts_moves_as_on_the_planar_engine_and_goes_on_from_a_saved_state() {
    let hinge: &[(&str, f64)] = &[("compliance_rad_per_n_m", 2.0), ("damping_s", 1e-3)];
    let curve: &[(&str, f64)] =
        &[("range_mn_m", 4.0), ("compliance_4_rad_per_n_m", 2.0), ("compliance_2_rad_per_n_m", 0.5), ("damping_s", 1e-3)];
    for (id, values, most) in [("clamp-compliance", hinge, 1e-5), ("free-clamp", curve, 5e-5)] {
        let mut robot = cantilever(0.008, id, values);
        robot.extensions.clamp_shift = 2e-5;
        robot.extensions.clamp_shift_damping = 1e-3;
        let bullet = |h: f64| motion(&mut BulletEngine::new(&robot, h).unwrap(), h);
        let limit: Vec<f64> = bullet(2e-5).iter().zip(bullet(1e-5)).map(|(coarse, fine)| 2.0 * fine - coarse).collect();
        let planar = motion(&mut PlanarEngine::new(&robot, 1e-5).unwrap(), 1e-5);
        let largest = planar.iter().fold(0.0_f64, |largest, angle| largest.max(angle.abs()));
        let apart = planar.iter().zip(&limit).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        // Seen: 4.2e-6 and 2.1e-5.
        assert!(apart < most * largest, "{id}: {apart:e} of {largest}");
        let new = |planar: bool| -> Box<dyn Engine> {
            if planar {
                Box::new(PlanarEngine::new(&robot, 1e-4).unwrap())
            } else {
                Box::new(BulletEngine::new(&robot, 1e-5).unwrap())
            }
        };
        for planar in [true, false] {
            let mut engine = new(planar);
            step(engine.as_mut(), &[-600.0], 500);
            let state = engine.save().unwrap();
            step(engine.as_mut(), &[-600.0], 500);
            let mut fresh = new(planar);
            fresh.load(500, &state).unwrap();
            step(fresh.as_mut(), &[-600.0], 500);
            assert_eq!(fresh.save().unwrap(), engine.save().unwrap(), "{id} {planar}");
        }
    }
}

#[test]
fn a_clamp_that_gives_goes_on_from_a_saved_state_with_the_same_bits() {
    let robot = cantilever(0.008, "clamp-compliance", &[("compliance_rad_per_n_m", 2.0)]);
    let new = || BulletEngine::new(&robot, 1e-5).unwrap();
    let mut engine = new();
    step(&mut engine, &[-600.0], 1000);
    let state = engine.save().unwrap();
    step(&mut engine, &[-600.0], 1000);
    let mut fresh = new();
    fresh.load(1000, &state).unwrap();
    step(&mut fresh, &[-600.0], 1000);
    assert_eq!(fresh.save().unwrap(), engine.save().unwrap());
    // A state of a clamp that gives more is of another world.
    let softer = cantilever(0.008, "clamp-compliance", &[("compliance_rad_per_n_m", 3.0)]);
    assert!(BulletEngine::new(&softer, 1e-5).unwrap().load(1000, &state).is_err());
    let harder = cantilever(0.008, "clamp-compliance", &[("compliance_rad_per_n_m", 2.0), ("hardening_per_rad", 300.0)]);
    assert!(BulletEngine::new(&harder, 1e-5).unwrap().load(1000, &state).is_err());
    let curved = cantilever(0.008, "free-clamp", &[("compliance_4_rad_per_n_m", 2.0)]);
    assert!(BulletEngine::new(&curved, 1e-5).unwrap().load(1000, &state).is_err());
    // The planar engine starts its next step from the root's last rate.
    let new = || PlanarEngine::new(&harder, 1e-4).unwrap();
    let mut engine = new();
    step(&mut engine, &[-600.0], 200);
    let state = engine.save().unwrap();
    step(&mut engine, &[-600.0], 200);
    let mut fresh = new();
    fresh.load(200, &state).unwrap();
    step(&mut fresh, &[-600.0], 200);
    assert_eq!(fresh.save().unwrap(), engine.save().unwrap());
}
