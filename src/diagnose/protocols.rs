//! Choice of the next measurement: tied models are simulated under a list of protocols, and the one that separates them best is proposed.

use super::plant::Model;
use super::robot::{RobotPlant, Scene};
use crate::drive::Table;
use crate::model::Mount;

/// Rows of a simulated protocol, and rows of its voltages.
const ROWS: usize = 400;
const VOLTAGE_ROWS: usize = 2000;
/// Least distance of two models (σ, all rows together) that a measurement can tell.
const LEAST_DISTANCE: f64 = 3.0;

/// An experiment that could be made.
struct Protocol {
    /// Instructions in words.
    text: String,
    scene: Scene,
}

/// Voltages (V) given as a function of time (s) and actuator.
fn table(actuators: usize, duration: f64, volts: impl Fn(f64, usize) -> f64) -> Table {
    let times: Vec<f64> = (0..=VOLTAGE_ROWS).map(|i| duration * i as f64 / VOLTAGE_ROWS as f64).collect();
    let values = times.iter().flat_map(|t| (0..actuators).map(|a| volts(*t, a)).collect::<Vec<_>>()).collect();
    Table::new(times, values, actuators).unwrap_or_else(|_| unreachable!("times rise and values are finite"))
}

/// The protocols for a robot.
fn protocols(plant: &RobotPlant) -> Vec<Protocol> {
    let robot = plant.robot();
    let n = robot.actuators;
    let length = 10.0 * robot.material.actuator_length * n as f64;
    let all = |duration: f64, volts: &dyn Fn(f64) -> f64| table(n, duration, |t, _| volts(t));
    let scene = |drive: Table, duration: f64| Scene {
        drive,
        duration,
        hung: 0.0,
        added: 0.0,
        turned_over: false,
        markers: plant.markers().to_vec(),
    };
    let sine = |amplitude: f64, frequency: f64| {
        move |t: f64| 0.5 * amplitude * (1.0 - (2.0 * std::f64::consts::PI * frequency * t).cos())
    };
    let triangle = |period: f64| {
        move |t: f64| {
            let phase = (t / period).fract();
            -500.0 + 950.0 * (4.0 * (phase - 0.5).abs() - 1.0)
        }
    };
    let step = |t: f64| if t < 0.1 { 0.0 } else { -1000.0 };
    let f1 = crate::analytic::cantilever_frequency(robot) / (n as f64).powi(2);
    let mut list = vec![
        Protocol {
            text: "drive it with slow triangles between -1450 V and 450 V, one of 20 s and one of 2 s".into(),
            scene: scene(all(20.0, &triangle(20.0)), 20.0),
        },
        Protocol { text: "step to -1000 V and hold for 100 s, repeated".into(), scene: scene(all(100.0, &step), 100.0) },
        Protocol {
            text: format!("drive it with a sine at {:.1} Hz, near its resonance, at 200 V and at 1500 V", 0.97 * f1),
            scene: scene(all(2.0, &sine(-1500.0, 0.97 * f1)), 2.0),
        },
        Protocol {
            text: "one actuator at a time, with markers every 25 mm".into(),
            scene: Scene {
                markers: (1..=4 * n).map(|k| 0.1 * length * k as f64 / (4 * n) as f64).collect(),
                ..scene(
                    table(n, 2.0 * n as f64, |t, a| if (t / 2.0) as usize == a { sine(-1000.0, 1.0)(t) } else { 0.0 }),
                    2.0 * n as f64,
                )
            },
        },
    ];
    if robot.mount == Mount::Clamped {
        let half = all(2.0, &sine(-1000.0, 0.8 * f1));
        list.push(Protocol {
            text: "weigh the sheet, or fix a known mass of 0.5 g to its free end and drive it again".into(),
            scene: Scene { added: 0.5, ..scene(half, 2.0) },
        });
        list.push(Protocol {
            text: "hang 2 g from the free end at 0 V and cut it off, filmed on the clock of the other runs: a motion that no voltage makes".into(),
            scene: Scene { hung: 2.0, ..scene(all(1.0, &|_| 0.0), 1.0) },
        });
        list.push(Protocol {
            text:
                "turn the sheet over and film its shape at 0 V, with markers every 25 mm, a plumb line and a ruler in the picture"
                    .into(),
            scene: Scene {
                turned_over: true,
                markers: (1..=4 * n).map(|k| 0.1 * length * k as f64 / (4 * n) as f64).collect(),
                ..scene(all(0.5, &|_| 0.0), 0.5)
            },
        });
    }
    list
}

/// The protocol that separates tied models best, in words, with the distance of the two nearest ones (σ); none for fewer than two models.
pub fn separate(plant: &RobotPlant, models: &[Model]) -> Option<String> {
    let [first, others @ ..] = models else { return None };
    if others.is_empty() {
        return None;
    }
    let noise = plant.noise();
    let mut best: Option<(f64, String)> = None;
    for protocol in protocols(plant) {
        let Ok(first) = plant.simulate(first, &protocol.scene, ROWS) else { continue };
        // The model nearest to the first decides.
        let distances = others.iter().filter_map(|other| {
            let other = plant.simulate(other, &protocol.scene, ROWS).ok()?;
            let sum: f64 = first.iter().zip(&other).map(|(a, b)| ((a - b) / noise).powi(2)).sum();
            Some(sum.sqrt())
        });
        let least = distances.fold(f64::INFINITY, f64::min);
        if least.is_finite() && best.as_ref().is_none_or(|(most, _)| least > *most) {
            best = Some((least, protocol.text));
        }
    }
    let (distance, text) = best?;
    if distance < LEAST_DISTANCE {
        return Some(
            "no experiment of the program's list separates them; log the electrode's voltage on the camera's clock, and measure mass and force directly"
                .into(),
        );
    }
    Some(format!("{text}: the models then differ by {distance:.0} standard deviations"))
}
