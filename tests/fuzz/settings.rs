//! Assignments `KEY=VALUE` for `--set`.

use crate::experiments::{sample, volts};
use crate::kinds::Input;
use crate::random::Random;

/// A preset with one to three settings.
pub fn make(random: &mut Random) -> Input {
    let mut input = Input::file("experiment.toml", sample(random));
    for _ in 0..1 + random.below(3) {
        let sound = !random.once_in(3);
        input.words.push(if sound { sound_setting(random) } else { setting(random) });
    }
    input
}

/// An assignment `KEY=VALUE`, more or less.
pub fn setting(random: &mut Random) -> String {
    let key = *random.pick(&[
        "robot.actuators",
        "robot.motors_per_actuator",
        "robot.mount",
        "robot.damping_eta",
        "robot.damping_time_s",
        "robot.collision_thickness_mm",
        "robot.positive_gain",
        "robot.friction",
        "robot.friction.low",
        "robot.friction.high",
        "robot.friction.film_fraction",
        "material.preset",
        "material.actuator_length_mm",
        "material.width_mm",
        "material.gravity_m_s2",
        "material.piezo_modulus_gpa",
        "material.piezo_poisson",
        "material.piezo_thickness_um",
        "material.piezo_density_g_cm3",
        "material.electrode_pitch_mm",
        "material.adhesive_thickness_um",
        "drive",
        "drive.waveform",
        "drive.period_s",
        "drive.frequency_hz",
        "drive.on_time_s",
        "drive.delay_s",
        "drive.voltages_v",
        "drive.on_voltages_v",
        "drive.phases",
        "drive.file",
        "simulation.engine",
        "simulation.start",
        "simulation.friction",
        "simulation.time_step_s",
        "simulation.step_error",
        "simulation.steps",
        "simulation.duration_s",
        "simulation.record_every_steps",
        "simulation.record_every_s",
        "effect",
        "a",
        ".",
    ]);
    let value = match random.below(6) {
        0 => volts(random, 5),
        1 => (*random.pick(&[
            "clamped",
            "planar",
            "bullet",
            "free",
            "settled",
            "coulomb",
            "auto",
            "sine",
            "{}",
            "[]",
            "\"\"",
            "[{id=\"hysteresis\",width=0.2}]",
            "{a.b=1}",
            "1\nb=2",
            "'''",
        ]))
        .to_owned(),
        _ => random.number(),
    };
    let mut text = format!("{key}={value}").into_bytes();
    if random.once_in(6) {
        random.damage(&mut text);
    }
    String::from_utf8_lossy(&text).into_owned()
}

/// A setting that makes sense.
fn sound_setting(random: &mut Random) -> String {
    let (key, low, high) = *random.pick(&[
        ("robot.damping_eta", 1e-3, 0.1),
        ("robot.collision_thickness_mm", 0.1, 2.0),
        ("robot.positive_gain", 0.5, 2.0),
        ("robot.friction.low", 0.01, 4.0),
        ("robot.friction.film_fraction", 0.1, 0.5),
        ("material.width_mm", 1.0, 100.0),
        ("material.gravity_m_s2", 0.1, 20.0),
        ("material.piezo_thickness_um", 10.0, 1000.0),
        ("material.piezo_modulus_gpa", 1.0, 100.0),
        ("material.electrode_pitch_mm", 0.1, 2.0),
        ("simulation.time_step_s", 1e-7, 1e-3),
    ]);
    let value = random.scale(low, high);
    format!("{key} = {:?}", random.wild(value))
}
