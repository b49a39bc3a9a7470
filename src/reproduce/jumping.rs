//! Jumping in place: section III-C.

use super::{Bench, Findings, Origin, StudyError, curve};
use crate::experiment::Experiment;
use crate::recording::Recording;
use crate::recording::measures::{ContactState, Measures, contact_states};
use crate::sweep::Sweep;
use crate::view::page::WHOLE;
use crate::view::{Figure, Mark, fixed, shape, signed};

/// The authors' own simulated curve, read off their published plot to ±0.03 mm.
const ON_TIME: &str = include_str!("jump_height_vs_on_time.csv");
/// Voltages of the real robot, and the gain that converts them to those of the authors' code.
const REAL: [&str; 2] = ["drive.on_voltages_v=[300,300,-1500,300,300]", "robot.positive_gain=1.733"];
const PERIOD: f64 = 1.0 / 14.0;
/// Measured height at 14 Hz (mm): "at least" and "as high as about".
const MEASURED: [f64; 2] = [7.5, 8.0];
/// Record interval of the runs at these frequencies.
const RECORDS: &str = "simulation.record_every_s=5e-4";
/// Frequencies (Hz) of the spot checks on Bullet, and their time step (s), the preset's.
const SPOTS_HZ: [f64; 3] = [7.0, 14.0, 20.0];
const SPOTS_STEP: f64 = 1e-5;
/// Reading error of the authors' plot (mm).
const READ_OFF: f64 = 0.03;
/// Time step on Bullet for the authors' curve (s): a hundred of the authors' steps.
const ON_TIME_STEP: f64 = 2e-3 / 240.0;
/// The authors' record interval (s): 12,500 of their steps. It is not published; with it Bullet's heights agree with all of their points within
/// the reading error.
const ON_TIME_RECORDS: &str = "simulation.record_every_s=1.0416666666666667e-3";

/// A run of 1.2 s at 14 Hz with its measures.
fn jump(bench: &Bench, bullet: bool) -> Result<(Experiment, Recording, Measures), StudyError> {
    let settings = [REAL[0], REAL[1], "simulation.duration_s=1.2", RECORDS];
    let (experiment, run) = if bullet {
        bench.run_on_bullet("jump-14hz", &settings)?
    } else {
        bench.run("jump-14hz", Some("jump_height_mm"), &settings)?
    };
    Ok((experiment, run.recording, run.measures))
}

/// Sequence of contact states over the last two periods, with their durations (s). States shorter than 2 ms are rebounds and join the
/// previous one.
fn steps(recording: &Recording) -> Vec<(ContactState, f64)> {
    let end = recording.time[recording.len() - 1];
    let from = recording.time.partition_point(|&t| t < end - 2.0 * PERIOD).max(1);
    let lengths = recording.time.windows(2).map(|pair| pair[1] - pair[0]);
    let samples = contact_states(recording).into_iter().skip(1).zip(lengths).skip(from - 1);
    let join = |steps: &mut Vec<(ContactState, f64)>, state: ContactState, length: f64, shortest: f64| match steps.last_mut() {
        Some((last, whole)) if *last == state || length < shortest => *whole += length,
        _ => steps.push((state, length)),
    };
    let mut all: Vec<(ContactState, f64)> = Vec::new();
    samples.for_each(|(state, length)| join(&mut all, state, length, 0.0));
    let mut steps = Vec::new();
    // A shorter state at the cut is left out.
    all.into_iter().skip_while(|step| step.1 < 2e-3).for_each(|(state, length)| join(&mut steps, state, length, 2e-3));
    steps
}

/// The quantity of the measured height, and its published value.
const HEIGHT: &str = "height of the lowest point at 14 Hz";
const HEIGHT_MEASURED: &str = "at least 7.5 mm, about 8 mm (measured)";

fn name(state: ContactState) -> &'static str {
    match state {
        ContactState::BodyTouching => "body touching",
        ContactState::EndTouching => "end touching",
        ContactState::Aerial => "aerial",
    }
}

/// Difference of a height at 14 Hz (mm) from the measured range, in words.
fn beside_measured(height: f64) -> String {
    if (MEASURED[0]..=MEASURED[1]).contains(&height) {
        return "within".into();
    }
    if height > MEASURED[1] {
        format!("{} mm above {} mm", fixed(height - MEASURED[1], 2), MEASURED[1])
    } else {
        format!("{} mm below {} mm", fixed(MEASURED[0] - height, 2), MEASURED[0])
    }
}

/// In-place jumping at 14 Hz.
pub fn at_14_hz(bench: &Bench) -> Result<Findings, StudyError> {
    let (_, recording, measures) = jump(bench, false)?;
    let (there, spot_recording, spot) = jump(bench, true)?;
    let mut findings = Findings::default();
    findings.done_on(bench.effort, there.time_step);
    let height = measures.jump_height_mm.unwrap_or(f64::NAN);
    findings.compare(
        HEIGHT,
        HEIGHT_MEASURED,
        format!("{} mm", fixed(height, 2)),
        beside_measured(height),
        "Friction of the film and damping are those of the authors' notebooks (1.0, dampingEta 0.045).",
    );
    findings.check_on_bullet("mm", height, spot.jump_height_mm.unwrap_or(f64::NAN));
    let ratio = measures.period_ratio.unwrap_or(f64::NAN);
    findings.compare(
        "period of the motion over that of the voltage",
        "2 (measured)",
        fixed(ratio, 0),
        if ratio == 2.0 { "none" } else { "differs" },
        "0 would stand for no period.",
    );
    findings.check_on_bullet("", ratio, spot.period_ratio.unwrap_or(f64::NAN));
    let phase = |measures: &Measures| measures.mid_end_phase_deg.unwrap_or(f64::NAN);
    findings.compare("midpoint against ends at 14 Hz", "out of phase (measured)", format!("{}°", fixed(phase(&measures), 0)), "", "The paper gives no number. Heights above the floor are compared; the flight of the whole robot, which moves both alike, takes part in them.");
    findings.check_on_bullet("°", phase(&measures), phase(&spot));
    let list = |recording: &Recording| {
        let told = |(state, length): (ContactState, f64)| format!("{} {:.0} ms", name(state), 1e3 * length);
        steps(recording).into_iter().map(told).collect::<Vec<_>>().join(", ")
    };
    findings.compare(
        "steps of one motion (two periods)",
        "four steps, of body touching, end touching and aerial shapes",
        list(&recording),
        "",
        "Where the motion is cut open is arbitrary, so the first and last may be parts of one.",
    );
    if let Some(last) = findings.comparisons.last_mut() {
        last.bullet = list(&spot_recording);
    }
    draw_jump(&mut findings, &recording);
    Ok(findings)
}

/// Draws heights and voltage over the last four periods.
fn draw_jump(findings: &mut Findings, recording: &Recording) {
    let end = recording.time[recording.len() - 1];
    let from = recording.time.partition_point(|&t| t < end - 4.0 * PERIOD);
    let mut figure = Figure::new("In-place jumping at 14 Hz", "time (ms)", "height z (mm)");
    figure.setting("(300, 300, −1500, 300, 300) V, friction 1.0, dampingEta 0.045").from_zero().size(WHOLE);
    let node = |node: usize| {
        (from..recording.len()).map(|i| (1e3 * recording.time[i], 10.0 * recording.node(i, node)[2])).collect::<Vec<_>>()
    };
    figure.series("planar engine, midpoint", node(recording.nodes() / 2), Mark::Line);
    figure.series("planar engine, left end", node(0), Mark::Line);
    figure.series(
        "planar engine, lowest point",
        (from..recording.len()).map(|i| (1e3 * recording.time[i], 10.0 * lowest(recording, i))),
        Mark::Line,
    );
    let times = [1e3 * recording.time[from], 1e3 * end];
    findings.publish_across(&mut figure, "measured, lowest point: 7.5 to about 8 mm", Origin::Measured, &MEASURED, times);
    let volts = |i: usize| recording.motor_voltages[i * recording.joints() + recording.joints() / 2];
    let drive = (from..recording.len()).map(|i| (1e3 * recording.time[i], volts(i)));
    figure.panel("voltage").share(0.1).strip("middle", "0 to −1500 V", drive);
    findings.figure = figure.svg();
    findings.caption = "The last four periods of 1.2 s. The robot repeats its motion after two periods of the voltage. The lines across are the \
                        measured height of the lowest point."
        .into();
}

/// The three key shapes at 14 Hz.
pub fn key_shapes(bench: &Bench) -> Result<Findings, StudyError> {
    let (_, recording, _) = jump(bench, false)?;
    let (there, spot_recording, _) = jump(bench, true)?;
    let mut findings = Findings::default();
    findings.done_on(bench.effort, there.time_step);
    let (found, on_bullet) = (best_moments(&recording), best_moments(&spot_recording));
    let mut figure = Figure::new("Key shapes of in-place jumping at 14 Hz", "x (mm)", "z (mm)");
    figure.setting("planar engine, (300, 300, −1500, 300, 300) V").size(WHOLE);
    let told = |recording: &Recording, moment: Option<usize>| {
        let Some(i) = moment else { return "does not occur".to_owned() };
        let middle = fixed(10.0 * recording.node(i, recording.nodes() / 2)[2], 1);
        let [end, low] = [recording.node(i, 0)[2], lowest(recording, i)].map(|z| fixed(10.0 * z, 1));
        format!("ends {end} mm, midpoint {middle} mm, lowest {low} mm")
    };
    for (row, ((state, moment), (_, spot))) in found.into_iter().zip(on_bullet).enumerate() {
        if row > 0 {
            figure.panel("z (mm)");
        }
        figure.filled_aspect().floor().panel_title(name(state));
        if let Some(i) = moment {
            figure.panel_title(&format!("{}, {} ms", name(state), fixed(1e3 * recording.time[i], 1)));
            figure.robot("", shape(&recording, i), "#0072b2");
        }
        let difference = if moment.is_none() { "differs" } else { "" };
        let explanation = "The figure's points are not published as numbers.";
        findings.compare(name(state), "shown, without numbers", told(&recording, moment), difference, explanation);
        if let Some(last) = findings.comparisons.last_mut() {
            last.bullet = told(&spot_recording, spot);
        }
    }
    findings.figure = figure.svg();
    findings.caption = "Planar engine. Of each kind the moment in the last two periods that shows it best.".into();
    Ok(findings)
}

/// Height of the lowest node in a record (cm).
fn lowest(recording: &Recording, i: usize) -> f64 {
    (0..recording.nodes()).map(|n| recording.node(i, n)[2]).fold(f64::INFINITY, f64::min)
}

/// For each contact state the record of the last two periods with the highest ends, middle and lowest point, respectively.
fn best_moments(recording: &Recording) -> [(ContactState, Option<usize>); 3] {
    let states = contact_states(recording);
    let end = recording.time[recording.len() - 1];
    let from = recording.time.partition_point(|&t| t < end - 2.0 * PERIOD);
    let z = |i: usize, node: usize| recording.node(i, node)[2];
    let best = |state: ContactState, score: &dyn Fn(usize) -> f64| {
        (from..recording.len()).filter(|&i| states[i] == state).max_by(|&a, &b| score(a).total_cmp(&score(b)))
    };
    [
        (ContactState::BodyTouching, best(ContactState::BodyTouching, &|i| z(i, 0))),
        (ContactState::EndTouching, best(ContactState::EndTouching, &|i| z(i, recording.nodes() / 2))),
        (ContactState::Aerial, best(ContactState::Aerial, &|i| lowest(recording, i))),
    ]
}

/// Jump height against frequency.
pub fn over_frequency(bench: &Bench) -> Result<Findings, StudyError> {
    let settings = [REAL[0], REAL[1], RECORDS];
    let (sweep, points) = bench.sweep("jump-frequency", "jump-frequency-scan", &settings)?;
    let heights = curve(&sweep, &points, sweep.axes.len() - 1, 0);
    let bullet = bench.spots("jump-frequency", &sweep, SPOTS_STEP, &SPOTS_HZ)?;
    let mut findings = Findings::default();
    findings.done_on(bench.effort, SPOTS_STEP);
    let best = top(&heights);
    findings.compare(
        "frequency of the highest jump",
        "14 Hz (chosen for the measurements)",
        format!("{} Hz, {} mm", fixed(best.0, 0), fixed(best.1, 2)),
        format!("{} Hz", signed(best.0 - 14.0, 0)),
        "The paper does not say that 14 Hz is the optimum of the height.",
    );
    for &(f, on_bullet) in &bullet {
        let ours = heights.iter().find(|p| p.0 == f).map_or(f64::NAN, |p| p.1);
        let told = format!("{} mm", fixed(ours, 2));
        if f == 14.0 {
            findings.compare(HEIGHT, HEIGHT_MEASURED, told, beside_measured(ours), "");
        } else {
            findings.compare(&format!("height of the lowest point at {f} Hz"), "", told, "", "");
        }
        findings.check_on_bullet("mm", ours, on_bullet);
    }
    findings.without_result(&heights);
    let mut figure = Figure::new("In-place jumping against frequency", "frequency (Hz)", "jump height (mm)");
    figure.setting("(300, 300, −1500, 300, 300) V, friction 1.0, dampingEta 0.045").from_zero().size(WHOLE);
    figure.series("planar engine", heights, Mark::Both);
    figure.series("Bullet", bullet, Mark::Points);
    findings.publish(&mut figure, "measured at 14 Hz: 7.5 to about 8 mm", Origin::Measured, &MEASURED.map(|z| (14.0, z)), None);
    findings.figure = figure.svg();
    findings.caption =
        "Largest height of the lowest point in 1.2 s. The paper says at least 7.5 mm and as high as about 8 mm.".into();
    Ok(findings)
}

/// The point of the largest finite y; NaN if there is none.
fn top(points: &[(f64, f64)]) -> (f64, f64) {
    points.iter().copied().filter(|p| p.1.is_finite()).max_by(|a, b| a.1.total_cmp(&b.1)).unwrap_or((f64::NAN, f64::NAN))
}

/// Compares the best on-times (s) and heights (mm): the authors', ours at their points, and ours on the finer grid.
fn compare_tops(findings: &mut Findings, theirs: &[(f64, f64)], common: &[(f64, f64)], ours: &[(f64, f64)]) {
    let [their_top, our_top, fine_top] = [theirs, common, ours].map(top);
    findings.compare(
        "best on-time on the authors' points",
        &format!("{} ms, {} mm (authors' simulation)", fixed(1e3 * their_top.0, 0), fixed(their_top.1, 2)),
        format!("{} ms, {} mm", fixed(1e3 * our_top.0, 0), fixed(our_top.1, 2)),
        format!("{} ms, {} mm", signed(1e3 * (our_top.0 - their_top.0), 0), signed(our_top.1 - their_top.1, 2)),
        &format!(
            "On our finer grid the best is {} ms with {} mm; the authors have no point between 24 and 32 ms.",
            fixed(1e3 * fine_top.0, 0),
            fixed(fine_top.1, 2)
        ),
    );
}

/// Jump height against on-time.
pub fn over_on_time(bench: &Bench) -> Result<Findings, StudyError> {
    let mut sweep = Sweep::open("preset:jump-on-time-scan".as_ref(), &[ON_TIME_RECORDS.into()])?;
    sweep.measures = vec!["recorded_jump_height_mm".into(), "jump_height_mm".into()];
    let (sweep, points) = bench.points("jump-on-time", sweep)?;
    let [ours, dense] = [0, 1].map(|measure| curve(&sweep, &points, sweep.axes.len() - 1, measure));
    let theirs: Vec<(f64, f64)> = ON_TIME
        .lines()
        .filter_map(|line| line.split_once(','))
        .filter_map(|(t, z)| Some((t.parse().ok()?, z.parse().ok()?)))
        .collect();
    let times: Vec<f64> = theirs.iter().map(|p| p.0).collect();
    let bullet = bench.spots("jump-on-time", &sweep, ON_TIME_STEP, &times)?;
    let beside = |curve: &[(f64, f64)]| -> Vec<(f64, f64, f64)> {
        theirs.iter().filter_map(|&(t, z)| curve.iter().find(|p| (p.0 - t).abs() < 1e-9).map(|p| (t, z, p.1))).collect()
    };
    let rms = |curve: &[(f64, f64)]| {
        let pairs = beside(curve);
        (pairs.iter().map(|(_, a, b)| (a - b).powi(2)).sum::<f64>() / pairs.len() as f64).sqrt()
    };
    let common = beside(&ours);
    let worst = common.iter().copied().max_by(|a, b| (a.1 - a.2).abs().total_cmp(&(b.1 - b.2).abs())).unwrap_or_default();
    let mut findings = Findings::default();
    findings.done_on(bench.effort, ON_TIME_STEP);
    findings.compare(
        &format!("height over on-time, {} of {} points", common.len(), theirs.len()),
        "the authors' simulated curve, read off to ±0.03 mm",
        format!("{} mm rms apart", fixed(rms(&ours), 3)),
        format!("largest {} mm at {} ms", signed(worst.2 - worst.1, 2), fixed(1e3 * worst.0, 0)),
        "Records every 1.04 ms, which is 12,500 of the authors' steps: the lowest point of a vibrating robot peaks sharply, and their curve carries the gaps between their records.",
    );
    if let Some(last) = findings.comparisons.last_mut() {
        last.bullet = format!("{} mm rms apart", fixed(rms(&bullet), 3));
    }
    findings.compare(
        "the same without gaps between records",
        "",
        format!("{} mm rms apart", fixed(rms(&dense), 3)),
        "",
        "What is seen if every peak is caught.",
    );
    let ours_at_theirs: Vec<(f64, f64)> = common.iter().map(|&(t, _, z)| (t, z)).collect();
    compare_tops(&mut findings, &theirs, &ours_at_theirs, &ours);
    let ms = |points: &[(f64, f64)]| points.iter().map(|p| (1e3 * p.0, p.1)).collect::<Vec<_>>();
    let mut figure = Figure::new("A single jump against on-time", "on-time (ms)", "jump height (mm)");
    figure.setting("(520, 520, −1500, 520, 520) V, the middle three until the on-time").from_zero().size(WHOLE);
    figure.series("planar engine", ms(&ours), Mark::Both);
    figure.series("Bullet", ms(&bullet), Mark::Points);
    findings.publish(&mut figure, "authors' simulation, ±0.03 mm", Origin::Simulated, &ms(&theirs), Some(READ_OFF));
    findings.figure = figure.svg();
    findings.caption = "The middle three actuators are on until the on-time, then all are off. All heights are those of records every 1.04 ms. The \
                        bars are what the authors' plot can be read to."
        .into();
    Ok(findings)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_authors_curve_is_there() {
        assert_eq!(ON_TIME.lines().filter(|line| line.starts_with("0.")).count(), 11);
    }
}
