//! The five-actuator robot at rest and walking: sections III-B and IV.

use super::{Bench, Findings, Origin, StudyError, curve};
use crate::view::page::WHOLE;
use crate::view::{Figure, Mark, fixed, minus, shape, signed};

/// Voltages of the real robot, the gain that converts them to those of the authors' code, and friction. The paper gives no coefficients of friction;
/// these are the defaults of this program, not fitted to any result.
const REAL: [&str; 4] = [
    "drive.on_voltages_v=[300,300,-1500,300,300]",
    "robot.positive_gain=1.733",
    "robot.friction.low=0.2",
    "robot.friction.high=4.0",
];

/// Frequencies (Hz) of the spot checks on Bullet, and their time step (s).
const SPOTS_HZ: [f64; 5] = [2.0, 5.0, 8.0, 10.0, 14.0];
const SPOTS_STEP: f64 = 1e-5;
/// Measured travel per cycle at 1 Hz (mm), and highest frequency with inchworm motion (Hz).
const STRIDE: f64 = 1.9;
const FORWARD_TO_HZ: i32 = 3;
/// Measured speeds: frequency (Hz), speed (mm/s).
const SPEEDS: [(f64, f64); 2] = [(8.0, -7.0), (14.0, 12.0)];

/// Static shapes of the five-actuator robot.
pub fn shapes(bench: &Bench) -> Result<Findings, StudyError> {
    let mut findings = Findings::default();
    let mut figure = Figure::new("Static shapes of the five-actuator robot", "x (mm)", "z (mm)");
    figure.setting("constant voltages, on the floor, m = 3").filled_aspect().floor().size(WHOLE);
    for volts in ["0,300,-960,300,0", "300,300,-960,300,0"] {
        let settings = [&format!("drive.voltages_v=[{volts}]"), "robot.positive_gain=1.733"];
        let (_, run) = bench.run("static-shape", None, &settings)?;
        let volts = minus(volts).replace(',', ", ");
        let r = &run.recording;
        let last = r.len() - 1;
        figure.series(&format!("planar engine, ({volts}) V"), shape(r, last), Mark::Both);
        let z = |node: usize| 10.0 * r.node(last, node)[2];
        let highest = (0..r.nodes()).map(z).fold(f64::NEG_INFINITY, f64::max);
        findings.compare(
            &format!("shape at ({volts}) V"),
            "shown, without numbers (measured and simulated)",
            format!(
                "highest point {} mm, left end {} mm, right end {} mm",
                fixed(highest, 2),
                fixed(z(0), 1),
                fixed(z(r.nodes() - 1), 1)
            ),
            "",
            "The figure's points are not published as numbers. Positive voltages count 1.733 times, as the authors' constants say of the real piezo.",
        );
        let (there, spot) = bench.run_on_bullet("static-shape", &settings)?;
        findings.done_on(bench.effort, there.time_step);
        let (r, last) = (&spot.recording, spot.recording.len() - 1);
        let bullet = (0..r.nodes()).map(|node| 10.0 * r.node(last, node)[2]).fold(f64::NEG_INFINITY, f64::max);
        findings.check_on_bullet("mm", highest, bullet);
    }
    findings.figure = figure.svg();
    findings.caption = "Settled shapes under constant voltages, gravity and floor; heights are drawn larger than lengths.".into();
    Ok(findings)
}

/// Inchworm motion over five cycles.
pub fn inchworm(bench: &Bench) -> Result<Findings, StudyError> {
    let (_, run) = bench.run("inchworm-1hz", Some("stride_mm"), &[])?;
    let r = &run.recording;
    let stride = run.measures.stride_mm.unwrap_or(f64::NAN);
    let mut findings = Findings::default();
    findings.compare(
        "travel per cycle at 1 Hz",
        "1.9 mm (measured)",
        format!("{} mm", fixed(stride, 2)),
        format!("{} %", signed(100.0 * (stride / STRIDE - 1.0), 0)),
        "The friction of film and robot is not given in the paper; ours is 4.0 and 0.2. With the reference's low friction of 2.5 the stride is 1.1 mm.",
    );
    let (there, spot) = bench.run_on_bullet("inchworm-1hz", &[])?;
    findings.done_on(bench.effort, there.time_step);
    let bullet = spot.measures.stride_mm.unwrap_or(f64::NAN);
    findings.check_on_bullet("mm", stride, bullet);
    let mut figure = Figure::new("Inchworm motion", "time (s)", "travel along x (mm)");
    figure.setting("1 Hz, (300, 300, −1500, 300, 300) V, friction 0.2 and 4.0").size(WHOLE);
    let x = |i: usize, node: usize| 10.0 * r.node(i, node)[0];
    let ends = [0, r.nodes() - 1];
    // Travel from the start of the second cycle, because the first begins at rest.
    let from = r.time.partition_point(|&t| t < 1.0 - 1e-9).min(r.len() - 1);
    let travel = |node: usize| (0..r.len()).map(move |i| (r.time[i], x(i, node) - x(from, node))).collect::<Vec<_>>();
    let [left, right] = ends.map(travel);
    let mean: Vec<(f64, f64)> = left.iter().zip(&right).map(|(a, b)| (a.0, 0.5 * (a.1 + b.1))).collect();
    figure.series("planar engine, left end", left, Mark::Line);
    figure.series("planar engine, right end", right, Mark::Line);
    figure.series("planar engine, mean of both", mean, Mark::Line);
    let cycles: Vec<(f64, f64)> = (1..=5).map(|k| (f64::from(k), STRIDE * f64::from(k - 1))).collect();
    findings.publish(&mut figure, "measured, 1.9 mm a cycle", Origin::Measured, &cycles, None);
    findings.figure = figure.svg();
    findings.caption = "Both ends and their mean over five cycles of the paper's sequence, from the end of the first cycle. The paper gives the travel \
                        of a cycle, drawn at the end of each; it gives no accuracy."
        .into();
    Ok(findings)
}

/// Speed against frequency.
pub fn speed(bench: &Bench) -> Result<Findings, StudyError> {
    let (sweep, points) = bench.sweep("speed", "speed-frequency-scan", &REAL)?;
    let speeds = curve(&sweep, &points, sweep.axes.len() - 1, 0);
    let mut findings = Findings::default();
    let at = |f: f64| speeds.iter().find(|p| p.0 == f).map_or(f64::NAN, |p| p.1);
    let told = |speed: f64| {
        if speed.is_finite() { format!("{} mm/s", signed(speed, 2)) } else { "none".into() }
    };
    let forward = (1..=20).take_while(|&f| at(f64::from(f)) > 0.0).last().unwrap_or(0);
    findings.compare(
        "inchworm motion goes forward up to",
        "3 Hz (measured)",
        format!("{forward} Hz"),
        format!("{} Hz", signed(f64::from(forward - FORWARD_TO_HZ), 0)),
        "Forward motion lasts longer here; friction, which decides it, is not specified.",
    );
    let bullet = bench.spots("speed", &sweep, SPOTS_STEP, &SPOTS_HZ)?;
    findings.done_on(bench.effort, SPOTS_STEP);
    for &(f, on_bullet) in &bullet {
        let ours = at(f);
        let published = SPEEDS.iter().find(|(at, _)| *at == f).map(|(_, speed)| *speed);
        let difference = published.map(|speed| format!("{} mm/s", signed(ours - speed, 1))).filter(|_| ours.is_finite());
        let explanation = match published {
            Some(_) => {
                "Sign and size of the fast speeds follow from friction and from how long contacts last, neither of which the paper specifies."
            }
            None => "",
        };
        let published = published.map_or_else(String::new, |speed| format!("{} mm/s (measured)", signed(speed, 0)));
        findings.compare(&format!("speed at {f} Hz"), &published, told(ours), difference.unwrap_or_default(), explanation);
        findings.check_on_bullet("mm/s", ours, on_bullet);
    }
    findings.without_result(&speeds);
    let (low, high) =
        speeds.iter().chain(&bullet).chain(&SPEEDS).map(|p| p.1).fold((0.0, 0.0), |(l, h): (f64, f64), v| (l.min(v), h.max(v)));
    let mut figure = Figure::new("Speed of the inchworm sequence", "frequency (Hz)", "speed (mm/s)");
    figure.setting("(300, 300, −1500, 300, 300) V, friction 0.2 and 4.0").size(WHOLE);
    figure.horizontal(0.0);
    figure.series("planar engine", speeds, Mark::Both);
    figure.series("Bullet", bullet, Mark::Points);
    findings.publish(&mut figure, "measured", Origin::Measured, &SPEEDS, None);
    findings.publish_up(&mut figure, "measured: forward up to 3 Hz", Origin::Measured, f64::from(FORWARD_TO_HZ), [low, high]);
    findings.figure = figure.svg();
    findings.caption = "Mean speed over the second half of 3 s. The paper gives two speeds, without their accuracy, and the frequency up to which the robot goes forward.".into();
    Ok(findings)
}
