//! The single actuator, clamped: section III-A.

use super::{Bench, Findings, Origin, StudyError, curve};
use crate::analytic;
use crate::model::Material;
use crate::model::units::mm_from_cm;
use crate::recording::signal::Mode;
use crate::sweep::Sweep;
use crate::view::page::WHOLE;
use crate::view::{Figure, Mark, fixed, shape, signed};

/// Measured deflection of the tip at −1000 V (mm); resonances (Hz), measured and simulated by the authors.
const DEFLECTION: f64 = -20.0;
const MEASURED_HZ: f64 = 23.0;
const SIMULATED_HZ: f64 = 25.0;

const SETS: [(&str, &str); 2] = [("set 2", "material.preset=parameter-2"), ("set 4", "material.preset=parameter-4")];

/// Frequencies (Hz) of the spot checks on Bullet, and their time step (s).
const SPOTS_HZ: [f64; 4] = [5.0, 15.0, 25.0, 40.0];
const SPOTS_STEP: f64 = 5e-6;

/// Static shapes of the cantilever.
pub fn shapes(bench: &Bench) -> Result<Findings, StudyError> {
    let mut findings = Findings::default();
    let mut figure = Figure::new("Static shapes of the cantilever", "x (mm)", "z (mm)");
    figure.setting("from above: 0, −600, −800 and −1000 V; m = 3").size(WHOLE);
    let mut left = 0.0;
    for (name, set) in SETS {
        // One interrupted line for all voltages, so that a set has one legend entry.
        let mut shapes = Vec::new();
        for volts in [0, -600, -800, -1000] {
            let (_, run) = bench.run("cantilever-dc", None, &[set, &format!("drive.voltages_v=[{volts}]")])?;
            let r = &run.recording;
            shapes.extend(shape(r, r.len() - 1));
            left = shapes[0].0;
            shapes.push((f64::NAN, f64::NAN));
            let tip = run.measures.tip_deflection_mm.unwrap_or(f64::NAN);
            if volts == -1000 {
                findings.compare(
                    &format!("tip at −1000 V, m = 3, {name}"),
                    "−20 mm (measured)",
                    format!("{} mm", fixed(tip, 2)),
                    format!("{} %", signed(100.0 * (tip / DEFLECTION - 1.0), 1)),
                    "No published set of constants matches both this and the resonance: set 2 is nearer here, set 4 there.",
                );
                let (there, spot) = bench.run_on_bullet("cantilever-dc", &[set, "drive.voltages_v=[-1000]"])?;
                let bullet = spot.measures.tip_deflection_mm.unwrap_or(f64::NAN);
                findings.check_on_bullet("mm", tip, bullet);
                findings.done_on(bench.effort, there.time_step);
            }
        }
        figure.series(&format!("planar engine, {name}"), shapes, Mark::Line);
    }
    let tip = [(left + arc_end(DEFLECTION), DEFLECTION)];
    findings.publish(&mut figure, "measured tip, −1000 V", Origin::Measured, &tip, None);
    findings.figure = figure.svg();
    findings.caption =
        "Shapes at rest, gravity included, for both published sets of constants. The paper gives the tip's deflection alone; \
                        its x is that of a circular arc from the left end. It gives no accuracy. Heights are drawn larger than lengths."
            .into();
    Ok(findings)
}

/// x (mm) of the end of a circular arc of the actuator's length with height `deflection` (mm).
fn arc_end(deflection: f64) -> f64 {
    let length = mm_from_cm(Material::PARAMETER_2.actuator_length);
    // z = L (1 − cos φ)/φ is the deflection; φ = 2z/L to begin with.
    let ratio = deflection.abs() / length;
    let angle = (0..30).fold(2.0 * ratio, |angle: f64, _| angle * ratio / ((1.0 - angle.cos()) / angle));
    length * angle.sin() / angle
}

/// Frequency response of the cantilever.
pub fn response(bench: &Bench) -> Result<Findings, StudyError> {
    let mut findings = Findings::default();
    let mut figure = Figure::new("Frequency response of the cantilever", "frequency (Hz)", "tip amplitude (mm)");
    figure.setting("sinusoid between 0 and −1500 V, dampingEta 0.008").from_zero().size(WHOLE);
    let (mut spots, mut highest) = (Vec::new(), 0.0);
    for (name, set) in SETS {
        let id = format!("cantilever-response-{}", name.replace(' ', "-"));
        let mut sweep = Sweep::open("preset:cantilever-frequency-scan".as_ref(), &[set.into()])?;
        let axis = sweep.axes.len() - 1;
        // Set 4 is compared for m = 3 only.
        if name == "set 4" {
            sweep.axes[axis - 1].values.retain(|m| m.as_integer() == Some(3));
        }
        let (sweep, points) = bench.points(&id, sweep)?;
        if name == "set 2" {
            let mut three = sweep.clone();
            three.axes[axis - 1].values.retain(|m| m.as_integer() == Some(3));
            spots = bench.spots(&id, &three, SPOTS_STEP, &SPOTS_HZ)?;
            findings.done_on(bench.effort, SPOTS_STEP);
        }
        let chains: Vec<_> = sweep.axes[axis - 1].values.iter().filter_map(toml::Value::as_integer).collect();
        for (block, m) in points.chunks(sweep.axes[axis].values.len()).zip(chains) {
            let response = curve(&sweep, block, axis, 0);
            let beam = analytic::cantilever_frequency(&sweep.experiment(0)?.robot);
            figure.series(&format!("planar engine, m = {m}, {name}"), response.clone(), Mark::Both);
            highest = response.iter().map(|p| p.1).filter(|amplitude| amplitude.is_finite()).fold(highest, f64::max);
            if (m, name) == (3, "set 2") {
                compare_spots(&mut findings, name, &response, &spots);
            }
            let explanation = match m {
                1 => "One joint is too coarse for the beam, as the paper says too; but with the constants of set 2 it is what gives the paper's simulated 25 Hz.".into(),
                _ => format!(
                    "The beam of {name} has its first frequency at {beam:.1} Hz whatever m is; 25 Hz needs constants that were not published."
                ),
            };
            compare_resonance(&mut findings, &format!("m = {m}, {name}"), &response, &explanation);
        }
    }
    figure.series("Bullet, m = 3, set 2", spots, Mark::Points);
    findings.publish_up(&mut figure, "23 Hz: measured", Origin::Measured, MEASURED_HZ, [0.0, highest]);
    findings.publish_up(&mut figure, "25 Hz: authors' simulation", Origin::Simulated, SIMULATED_HZ, [0.0, 0.93 * highest]);
    findings.figure = figure.svg();
    findings.caption = "Half the swing of the tip over the last period of 2 s; dampingEta 0.008, the classes' value. The upright lines stand at the published resonances, whose amplitudes are not given. The swing is as large as the beam is long near resonance, so the peaks are not those of a linear beam.".into();
    Ok(findings)
}

/// Compares amplitudes (mm) of the planar engine with those on Bullet at the frequencies of the `spots` (Hz).
fn compare_spots(findings: &mut Findings, set: &str, response: &[(f64, f64)], spots: &[(f64, f64)]) {
    for &(f, bullet) in spots {
        let planar = response.iter().find(|p| p.0 == f).map_or(f64::NAN, |p| p.1);
        findings.compare(&format!("amplitude at {f} Hz, m = 3, {set}"), "", format!("{} mm", fixed(planar, 2)), "", "");
        findings.check_on_bullet("mm", planar, bullet);
    }
}

/// Compares the resonance of a response, frequencies (Hz) and amplitudes (mm), with the published ones.
fn compare_resonance(findings: &mut Findings, chain: &str, response: &[(f64, f64)], explanation: &str) {
    let lost: Vec<f64> = response.iter().filter(|p| !p.1.is_finite()).map(|p| p.0).collect();
    let none = match (lost.first(), lost.last()) {
        (Some(low), Some(high)) => format!("lies between {low} and {high} Hz, where runs failed"),
        _ => "no peak below 40 Hz".into(),
    };
    // A gap may hide the peak.
    let (frequencies, amplitudes): (Vec<f64>, Vec<f64>) = response.iter().copied().unzip();
    let peak = if lost.is_empty() { Mode::of_response(&frequencies, &amplitudes) } else { None };
    let (ours, difference) = peak.map_or((none, String::new()), |peak| {
        let beside = |published: f64| signed(100.0 * (peak.resonance_hz / published - 1.0), 0);
        (
            format!("{:.1} Hz, half-power width {:.1} Hz", peak.resonance_hz, peak.half_power_bandwidth_hz),
            format!("{} % of 25 Hz, {} % of 23 Hz", beside(SIMULATED_HZ), beside(MEASURED_HZ)),
        )
    });
    findings.compare(&format!("resonance, {chain}"), "25 Hz (simulated, m ≥ 3), 23 Hz (measured)", ours, difference, explanation);
}

/// Damping from the step response.
pub fn damping(bench: &Bench) -> Result<Findings, StudyError> {
    let mut findings = Findings::default();
    let mut figure = Figure::new("Step response of the cantilever", "time (ms)", "height of the tip (mm)");
    figure.setting("0 to −1500 V at once, m = 3, set 2").size(WHOLE);
    for eta in [0.008, 0.03, 0.045] {
        let (experiment, run) = bench.run("cantilever-step", None, &[&format!("robot.damping_eta={eta}")])?;
        let r = &run.recording;
        let tip = (0..r.len()).map(|i| (1e3 * r.time[i], 10.0 * r.node(i, r.nodes() - 1)[2]));
        figure.series(&format!("planar engine, dampingEta {eta}"), tip, Mark::Line);
        let measures = run.measures;
        let beam = analytic::cantilever_frequency(&experiment.robot);
        // One mode under eq. 1: ζ = π η f with η = dampingEta/(2π).
        let expected = eta * beam / 2.0;
        let (ours, difference) = match (measures.damping_ratio, measures.resonance_hz) {
            (Some(zeta), Some(f)) => (
                format!("ζ = {zeta:.3}, rings at {f:.1} Hz"),
                format!("{} % of π η f = {expected:.3}", signed(100.0 * (zeta / expected - 1.0), 0)),
            ),
            _ => ("too damped to ring".into(), String::new()),
        };
        let published = if eta == 0.03 { "η = 0.03 s (of the simulation)" } else { "" };
        findings.compare(
            &format!("damping ratio, dampingEta = {eta}"),
            published,
            ours,
            difference,
            "Read literally, 0.03 s would overdamp the beam (ζ above 2 at 25 Hz); the code's dampingEta is 2π · 1 Hz times the η of eq. 1, so the paper's number is dampingEta.",
        );
        if eta == 0.008 {
            let (there, spot) = bench.run_on_bullet("cantilever-step", &[&format!("robot.damping_eta={eta}")])?;
            let bullet = spot.measures.resonance_hz.unwrap_or(f64::NAN);
            findings.check_on_bullet("Hz", measures.resonance_hz.unwrap_or(f64::NAN), bullet);
            findings.done_on(bench.effort, there.time_step);
        }
    }
    findings.figure = figure.svg();
    findings.caption =
        "How the tip rings for three values of dampingEta: the classes' 0.008, the paper's 0.03, the notebooks' 0.045.".into();
    Ok(findings)
}
