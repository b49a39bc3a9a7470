//! Marker positions in a run of the planar engine.

use super::dataset::Start;
use crate::drive::{Drive, Means};
use crate::effects::SignalChain;
use crate::engine::{Engine, EngineError, PlanarEngine};
use crate::experiment::hermite;
use crate::model::{Mount, PointMass, Robot};

/// Numerical damping of a clamped robot (1/s): a tenth of the engine's default, which at resonance would take 0.2 % of the amplitude.
pub(super) const NUMERICAL_DAMPING: f64 = 5.0;
/// A row this near to a step, as a share of its length, takes the step's state.
pub(super) const ON_STEP: f64 = 1e-6;
/// Error of a held point's height (cm).
const HEIGHT_ERROR: f64 = 1e-8;
/// Most equilibria on the way to it.
const MOST_EQUILIBRIA: usize = 100;

/// Positions x and z (cm) of `markers` (cm along the robot), relative to the left end of the flat robot, at rising `times` (s): row after row.
///
/// The robot starts from rest in the state `start`, under the drive's first voltages. Rows between two steps of `h` (s) are interpolated by the cubic
/// through positions and velocities.
///
/// # Errors
/// [`EngineError`] if there is no equilibrium to start from, or a step fails.
pub(super) fn track(
    robot: &Robot,
    start: &Start,
    drive: &Drive,
    mut chain: SignalChain,
    h: f64,
    markers: &[f64],
    times: &[f64],
) -> Result<Vec<[f64; 2]>, EngineError> {
    let mut engine = build(robot, h)?;
    let n = robot.actuators;
    let mut means = Means::new(drive, n, 0.0);
    let mut volts = vec![0.0; n];
    drive.voltages(0.0, &mut volts);
    chain.settle(&mut volts);
    put(&mut engine, robot, h, start, &volts)?;

    let origin = -0.5 * robot.segments()[0].length;
    let places = places(robot, markers);
    let nodes = robot.joints() + 2;
    let (mut positions, mut velocities) = (vec![0.0; 3 * nodes], vec![0.0; 3 * nodes]);
    // x, z (cm) and their rates (cm/s) of every marker.
    let mut sample = |engine: &mut PlanarEngine, out: &mut Vec<[f64; 4]>| -> Result<(), EngineError> {
        engine.nodes(&mut positions, &mut velocities)?;
        out.clear();
        for (body, share) in &places {
            let between = |of: &[f64], axis: usize| {
                let (a, b) = (of[3 * body + axis], of[3 * body + 3 + axis]);
                a + share * (b - a)
            };
            out.push([between(&positions, 0) - origin, between(&positions, 2), between(&velocities, 0), between(&velocities, 2)]);
        }
        Ok(())
    };
    // Markers at the beginning and at the end of a step, and the step at whose beginning the latter are.
    let (mut before, mut after): (Vec<[f64; 4]>, Vec<[f64; 4]>) = (Vec::new(), Vec::new());
    let mut sampled = None;
    let mut tracks = Vec::with_capacity(times.len() * markers.len());
    let (is_divided, mut part_volts) = (chain.parts() > 1, vec![0.0; n]);
    let mut commanded = [vec![0.0; n], vec![0.0; n], vec![0.0; n]];
    let (mut step, mut next) = (0_u64, 0);
    while next < times.len() {
        let (from, to) = (step as f64 * h, (step + 1) as f64 * h);
        let is_on_step = |t: f64| t <= from + ON_STEP * h;
        if times[next] < to - ON_STEP * h {
            if sampled == Some(step) {
                std::mem::swap(&mut before, &mut after);
            } else {
                sample(&mut engine, &mut before)?;
            }
            while next < times.len() && is_on_step(times[next]) {
                tracks.extend(before.iter().map(|[x, z, ..]| [*x, *z]));
                next += 1;
            }
            if next == times.len() {
                break;
            }
        }
        let parts = if is_divided {
            drive.ahead(step, h, &mut commanded);
            chain.parts_of_step(h, &commanded)
        } else {
            1
        };
        if parts == 1 {
            means.over(from, to, &mut volts);
            chain.pass(h, &mut volts);
        } else {
            volts.fill(0.0);
            for part in 0..parts {
                let [a, b] = [part, part + 1].map(|k| from + h * k as f64 / parts as f64);
                means.over(a, b, &mut part_volts);
                chain.pass(h / parts as f64, &mut part_volts);
                volts.iter_mut().zip(&part_volts).for_each(|(sum, v)| *sum += v / parts as f64);
            }
        }
        engine.prepare(&volts)?;
        engine.advance()?;
        step += 1;
        if times[next] < to - ON_STEP * h {
            sample(&mut engine, &mut after)?;
            sampled = Some(step);
            while next < times.len() && times[next] < to - ON_STEP * h {
                let t = times[next];
                tracks.extend(before.iter().zip(&after).map(|([x0, z0, u0, w0], [x1, z1, u1, w1])| {
                    [hermite(t, [from, to], [*x0, *u0], [*x1, *u1]), hermite(t, [from, to], [*z0, *w0], [*z1, *w1])]
                }));
                next += 1;
            }
        }
    }
    if tracks.iter().flatten().all(|value| value.is_finite()) {
        Ok(tracks)
    } else {
        Err(EngineError::NotFinite { what: "a marker".into(), value: f64::NAN, step, time: step as f64 * h, stable_step: None })
    }
}

/// Puts an engine of `robot`, as it was built with steps of `h` (s), into the state `start` under constant `volts` (V).
///
/// # Errors
/// [`EngineError`] if there is no such equilibrium.
pub(super) fn put(engine: &mut PlanarEngine, robot: &Robot, h: f64, start: &Start, volts: &[f64]) -> Result<(), EngineError> {
    match *start {
        Start::Level { height } => {
            engine.raise(height);
            Ok(())
        }
        Start::Settled => engine.settle(volts),
        Start::Hung(mass) => {
            let position = robot.material.actuator_length * robot.actuators as f64;
            engine.load(0, &weighed(robot, h, volts, PointMass { mass, position })?.save()?)
        }
        Start::Held { position, z } => engine.load(0, &held(robot, h, volts, position, z)?.save()?),
    }
}

fn build(robot: &Robot, h: f64) -> Result<PlanarEngine, EngineError> {
    match robot.mount {
        Mount::Clamped => PlanarEngine::with_numerical_damping(robot, h, NUMERICAL_DAMPING),
        _ => PlanarEngine::new(robot, h),
    }
}

/// Body of each marker (cm along the robot), and its position as a share of the body's length.
fn places(robot: &Robot, markers: &[f64]) -> Vec<(usize, f64)> {
    let segments = robot.segments();
    let place = |marker: &f64| {
        let (mut body, mut left) = (0, 0.0);
        while body + 1 < segments.len() && left + segments[body].length < *marker {
            left += segments[body].length;
            body += 1;
        }
        (body, (marker - left) / segments[body].length)
    };
    markers.iter().map(place).collect()
}

/// The robot in equilibrium under constant `volts` (V) with another mass fixed to it.
fn weighed(robot: &Robot, h: f64, volts: &[f64], mass: PointMass) -> Result<PlanarEngine, EngineError> {
    let mut robot = robot.clone();
    robot.extensions.point_masses.push(mass);
    let mut engine = build(&robot, h)?;
    engine.settle(volts)?;
    Ok(engine)
}

/// The robot in equilibrium under constant `volts` (V) with the point at `position` (cm along it) at the height `z` (cm). The force that holds it is the
/// weight of a mass, negative if it points upwards, found by the Illinois variant of false position.
fn held(robot: &Robot, h: f64, volts: &[f64], position: f64, z: f64) -> Result<PlanarEngine, EngineError> {
    let none = |reason: &str| EngineError::NoEquilibrium { reason: reason.into() };
    let gravity = robot.material.gravity;
    if gravity == 0.0 {
        return Err(none("a point is held by a weight, and there is no gravity"));
    }
    let (body, share) = places(robot, &[position])[0];
    let mut nodes = vec![[0.0; 2]; robot.joints() + 2];
    let mut with = |mass: f64| -> Result<(f64, PlanarEngine), EngineError> {
        let mut engine = weighed(robot, h, volts, PointMass { mass, position })?;
        engine.places(&mut nodes)?;
        let [below, above] = [body, body + 1].map(|node| nodes[node][1]);
        Ok((below + share * (above - below) - z, engine))
    };
    let (mut too_high, engine) = with(0.0)?;
    if too_high.abs() < HEIGHT_ERROR {
        return Ok(engine);
    }
    // Away from 0 in steps that double, and halve where there is no equilibrium, until the point is on the other side of its height.
    let whole: f64 = robot.rigid_bodies().iter().map(|body| body.mass).sum();
    let mut step = 0.1 * whole * (too_high * gravity).signum();
    let (mut from, mut to, mut other) = (0.0, 0.0, too_high);
    let mut tries = 0;
    while other * too_high > 0.0 {
        tries += 1;
        if tries > MOST_EQUILIBRIA / 2 {
            return Err(none("no vertical force holds the released point at its height"));
        }
        match with(to + step) {
            Ok((height, engine)) if height.abs() < HEIGHT_ERROR => return Ok(engine),
            Ok((height, _)) => {
                (from, too_high) = (to, other);
                (to, other, step) = (to + step, height, 1.5 * step);
            }
            Err(EngineError::NoEquilibrium { .. }) => step *= 0.3,
            Err(error) => return Err(error),
        }
    }
    for _ in 0..MOST_EQUILIBRIA {
        let mass = (from * other - to * too_high) / (other - too_high);
        let (height, engine) = with(mass)?;
        if height.abs() < HEIGHT_ERROR {
            return Ok(engine);
        }
        if height * other < 0.0 {
            (from, too_high) = (to, other);
        } else {
            too_high *= 0.5;
        }
        (to, other) = (mass, height);
    }
    Err(none("the search for the force that holds the released point does not end"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::drive::{Table, Waveform};
    use crate::model::{Damping, Material};

    fn clamped() -> Robot {
        let mut robot = Robot::crawler().with_actuators(1).with_motors_per_actuator(10).with_damping_eta(0.008);
        robot.mount = Mount::Clamped;
        robot
    }

    /// A strip of cardstock with a weight of 1 g, which bends it by a right angle.
    fn cardstock() -> Robot {
        let mut robot = clamped();
        robot.material = Material {
            actuator_length: 21.6,
            width: 5.08,
            piezo_modulus: 3e10,
            piezo_poisson: 0.0,
            piezo_thickness: 0.008,
            piezo_density: 0.875,
            substrate_modulus: 3e10,
            substrate_poisson: 0.0,
            substrate_thickness: 0.008,
            substrate_density: 0.875,
            adhesive_thickness: 0.0,
            ..Material::PARAMETER_2
        };
        robot.damping = Damping::Time(0.05);
        robot.extensions.point_masses.push(PointMass { mass: 1.0, position: 18.7 });
        robot
    }

    /// Heights (cm) of a point of a robot without voltage.
    fn heights(robot: &Robot, start: Start, position: f64, times: &[f64]) -> Vec<f64> {
        let table = Table::new(vec![0.0, 1.0], vec![0.0, 0.0], 1).unwrap();
        let drive = Drive { waveform: Waveform::Table(table), positive_gain: 1.0, delay: 0.0 };
        let chain = SignalChain::new(&[], 1, 1.0);
        track(robot, &start, &drive, chain, 1e-3, &[position], times).unwrap().iter().map(|at| at[1]).collect()
    }

    #[test]
    fn a_released_robot_starts_from_its_shape_and_comes_to_its_equilibrium() {
        for (robot, position, z) in [(clamped(), 10.0, 0.4), (cardstock(), 18.7, -4.25), (cardstock(), 18.7, 2.0)] {
            let settled = heights(&robot, Start::Settled, position, &[0.0, 0.1]);
            assert!((settled[0] - settled[1]).abs() < 1e-8, "{settled:?}");
            assert_eq!(heights(&robot, Start::Level { height: 0.0 }, position, &[0.0]), [0.0]);
            for start in [Start::Level { height: 0.0 }, Start::Held { position, z }, Start::Hung(2.0)] {
                let seen = heights(&robot, start, position, &[0.0, 0.02, 40.0]);
                assert!((seen[0] - seen[1]).abs() > 1e-3 && (seen[2] - settled[0]).abs() < 1e-3, "{start:?}: {seen:?}");
            }
            let held = heights(&robot, Start::Held { position, z }, position, &[0.0])[0];
            assert!((held - z).abs() < 1e-7, "{held}");
        }
    }

    #[test]
    fn a_weight_that_holds_a_point_where_it_hangs_is_the_hung_one() {
        let robot = clamped();
        let z = heights(&robot, Start::Hung(3.0), 10.0, &[0.0])[0];
        let times: Vec<f64> = (0..20).map(|row| 5e-3 * f64::from(row)).collect();
        let [hung, held] =
            [Start::Hung(3.0), Start::Held { position: 10.0, z }].map(|start| heights(&robot, start, 10.0, &times));
        assert!(hung.iter().zip(&held).all(|(a, b)| (a - b).abs() < 1e-6), "{hung:?} {held:?}");
    }
}
