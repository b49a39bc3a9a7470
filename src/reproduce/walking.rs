//! The five-actuator robot at rest and walking slowly: section III-B.

use super::{Bench, Findings, Origin, StudyError};
use crate::view::page::WHOLE;
use crate::view::{Figure, Mark, fixed, minus, shape, signed};

/// Measured travel per cycle at 1 Hz (mm).
pub(super) const STRIDE: f64 = 1.9;

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
