//! Marker positions in a run of the planar engine.

use crate::drive::{Drive, Means};
use crate::effects::SignalChain;
use crate::engine::{Engine, EngineError, PlanarEngine};
use crate::experiment::hermite;
use crate::model::{Mount, PointMass, Robot};

/// Numerical damping of a clamped robot (1/s): a tenth of the engine's default, which at resonance would take 0.2 % of the amplitude.
pub(super) const NUMERICAL_DAMPING: f64 = 5.0;
/// A row this near to a step, as a share of its length, takes the step's state.
pub(super) const ON_STEP: f64 = 1e-6;

/// Positions x and z (cm) of `markers` (cm along the robot), relative to the left end of the flat robot, at rising `times` (s): row after row.
///
/// The robot starts from rest at the drive's first voltages, with a mass `hung` (g) at its right end that is released at t = 0. Rows between two
/// steps of `h` (s) are interpolated by the cubic through positions and velocities.
///
/// # Errors
/// [`EngineError`] if there is no equilibrium to start from, or a step fails.
pub(super) fn track(
    robot: &Robot,
    hung: f64,
    drive: &Drive,
    mut chain: SignalChain,
    h: f64,
    markers: &[f64],
    times: &[f64],
) -> Result<Vec<[f64; 2]>, EngineError> {
    let build = |robot: &Robot| match robot.mount {
        Mount::Clamped => PlanarEngine::with_numerical_damping(robot, h, NUMERICAL_DAMPING),
        _ => PlanarEngine::new(robot, h),
    };
    let mut engine = build(robot)?;
    let n = robot.actuators;
    let mut means = Means::new(drive, n, 0.0);
    let mut volts = vec![0.0; n];
    drive.voltages(0.0, &mut volts);
    chain.settle(&mut volts);
    if hung > 0.0 {
        let mut loaded = robot.clone();
        let position = robot.material.actuator_length * robot.actuators as f64;
        loaded.extensions.point_masses.push(PointMass { mass: hung, position });
        let mut loaded = build(&loaded)?;
        loaded.settle(&volts)?;
        engine.load(0, &loaded.save()?)?;
    } else {
        engine.settle(&volts)?;
    }

    let segments = robot.segments();
    let origin = -0.5 * segments[0].length;
    // Body of each marker, and its position as a share of the body's length.
    let mut places = Vec::new();
    for marker in markers {
        let (mut body, mut left) = (0, 0.0);
        while body + 1 < segments.len() && left + segments[body].length < *marker {
            left += segments[body].length;
            body += 1;
        }
        places.push((body, (marker - left) / segments[body].length));
    }
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
    let (mut before, mut after): (Vec<[f64; 4]>, Vec<[f64; 4]>) = (Vec::new(), Vec::new());
    let mut tracks = Vec::with_capacity(times.len() * markers.len());
    let (parts, mut part_volts) = (chain.parts(), vec![0.0; n]);
    let (mut step, mut next) = (0_u64, 0);
    while next < times.len() {
        let (from, to) = (step as f64 * h, (step + 1) as f64 * h);
        let is_on_step = |t: f64| t <= from + ON_STEP * h;
        if times[next] < to - ON_STEP * h {
            sample(&mut engine, &mut before)?;
            while next < times.len() && is_on_step(times[next]) {
                tracks.extend(before.iter().map(|[x, z, ..]| [*x, *z]));
                next += 1;
            }
            if next == times.len() {
                break;
            }
        }
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
