//! The five-actuator robot at rest and walking: sections III-B and IV.

use super::{Bench, Findings, StudyError, curve};
use crate::model::Mount;
use crate::recording::measures::Measures;
use crate::view::{Figure, Mark, shape};

/// The voltages of the real robot, the gain that turns them into the code's, and films of high friction under a smooth robot. The paper
/// gives no coefficients; 0.2 and 4.0 are those of this program's defaults, not fitted to any result.
const REAL: [&str; 4] = [
    "drive.on_voltages_v=[300,300,-1500,300,300]",
    "robot.positive_gain=1.733",
    "robot.friction.low=0.2",
    "robot.friction.high=4.0",
];

/// Frequencies (Hz) at which Bullet is asked as well.
const SPOTS_HZ: [f64; 5] = [2.0, 5.0, 8.0, 10.0, 14.0];

pub fn shapes(bench: &Bench) -> Result<Findings, StudyError> {
    let mut findings = Findings::default();
    let mut figure = Figure::new("Five actuators at rest on the floor", "x (mm)", "z (mm)");
    figure.horizontal(0.0);
    for volts in ["0,300,-960,300,0", "300,300,-960,300,0"] {
        let settings = [&format!("drive.voltages_v=[{volts}]"), "robot.positive_gain=1.733"];
        let (_, run) = bench.run("static-shape", &settings)?;
        let r = &run.recording;
        let last = r.len() - 1;
        figure.series(&format!("({volts}) V"), shape(r, last), Mark::Both);
        let z = |node: usize| 10.0 * r.node(last, node)[2];
        let highest = (0..r.nodes()).map(z).fold(f64::NEG_INFINITY, f64::max);
        findings.compare(
            &format!("shape at ({volts}) V"),
            "shown, without numbers (measured and simulated)",
            format!("left end {:.1} mm, highest point {highest:.1} mm, right end {:.1} mm", z(0), z(r.nodes() - 1)),
            "",
            "The figure's points are not published as numbers. Positive voltages count 1.733 times, as the authors' constants say of the real piezo.",
        );
        let (_, spot) = bench.run_on_bullet("static-shape", &settings)?;
        let (r, last) = (&spot.recording, spot.recording.len() - 1);
        let bullet = (0..r.nodes()).map(|node| 10.0 * r.node(last, node)[2]).fold(f64::NEG_INFINITY, f64::max);
        findings.check_on_bullet(&format!("highest point at ({volts}) V"), "mm", highest, bullet);
    }
    findings.figure = figure.svg();
    findings.caption = "Settled shapes under constant voltages, gravity and floor; heights are drawn larger than lengths.".into();
    Ok(findings)
}

pub fn inchworm(bench: &Bench) -> Result<Findings, StudyError> {
    let (_, run) = bench.run("inchworm-1hz", &[])?;
    let r = &run.recording;
    let stride = Measures::of(r, Mount::Ground, Some(1.0)).stride_mm.unwrap_or(f64::NAN);
    let mut findings = Findings::default();
    findings.compare(
        "travel per cycle at 1 Hz",
        "1.9 mm (measured)",
        format!("{stride:.2} mm"),
        format!("{:+.0} %", 100.0 * (stride / 1.9 - 1.0)),
        "The friction of film and robot is not given in the paper; ours is 4.0 and 0.2. With the reference's low friction of 2.5 the stride is 1.1 mm.",
    );
    let (_, spot) = bench.run_on_bullet("inchworm-1hz", &[])?;
    let bullet = Measures::of(&spot.recording, Mount::Ground, Some(1.0)).stride_mm.unwrap_or(f64::NAN);
    findings.check_on_bullet("travel per cycle at 1 Hz", "mm", stride, bullet);
    let mut figure = Figure::new("Inchworm motion at 1 Hz", "time (s)", "travel along x (mm)");
    let travel =
        |node: usize| (0..r.len()).map(|i| (r.time[i], 10.0 * (r.node(i, node)[0] - r.node(0, node)[0]))).collect::<Vec<_>>();
    let (left, right) = (travel(0), travel(r.nodes() - 1));
    let sum: Vec<(f64, f64)> = left.iter().zip(&right).map(|(a, b)| (a.0, a.1 + b.1)).collect();
    figure.series("left end", left, Mark::Line);
    figure.series("right end", right, Mark::Line);
    figure.series("sum of both", sum, Mark::Line);
    findings.figure = figure.svg();
    findings.caption = "Both ends and their sum over five cycles of the paper's sequence.".into();
    Ok(findings)
}

pub fn speed(bench: &Bench) -> Result<Findings, StudyError> {
    let (sweep, points) = bench.sweep("speed", "speed-frequency-scan", &REAL)?;
    let speeds = curve(&sweep, &points, sweep.axes.len() - 1, 0);
    let mut findings = Findings::default();
    let at = |f: f64| speeds.iter().find(|p| p.0 == f).map_or(f64::NAN, |p| p.1);
    let told = |speed: f64| {
        if speed.is_finite() { format!("{speed:+.1} mm/s") } else { "none".into() }
    };
    let forward = (1..=20).take_while(|&f| at(f64::from(f)) > 0.0).last().unwrap_or(0);
    findings.compare(
        "inchworm motion goes forward up to",
        "3 Hz (measured)",
        format!("{forward} Hz"),
        format!("{:+} Hz", forward - 3),
        "Forward motion lasts longer here; friction, which decides it, is not specified.",
    );
    for (f, published) in [(8.0, -7.0), (14.0, 12.0)] {
        let ours = at(f);
        let difference = if ours.is_finite() { format!("{:+.1} mm/s", ours - published) } else { String::new() };
        findings.compare(
            &format!("speed at {f} Hz"),
            &format!("{published:+} mm/s (measured)"),
            told(ours),
            difference,
            "Sign and size of the fast speeds follow from friction and from how long contacts last, neither of which the paper specifies.",
        );
    }
    findings.without_result(&speeds);
    let bullet = bench.spots("speed", &sweep, 1e-5, &SPOTS_HZ)?;
    for &(f, speed) in &bullet {
        findings.check_on_bullet(&format!("speed at {f} Hz"), "mm/s", at(f), speed);
    }
    let mut figure = Figure::new("Speed of the inchworm sequence", "frequency (Hz)", "speed (mm/s)");
    figure.horizontal(0.0);
    figure.series("simulated", speeds, Mark::Both);
    figure.series("Bullet", bullet, Mark::Points);
    figure.series("measured", [(8.0, -7.0), (14.0, 12.0)], Mark::Points);
    findings.figure = figure.svg();
    findings.caption = "Mean speed over the second half of 3 s.".into();
    Ok(findings)
}
