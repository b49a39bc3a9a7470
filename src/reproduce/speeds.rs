//! Speed against frequency: section IV.
//!
//! The motion is chaotic from about 4 Hz on, so every point is an ensemble. On Bullet some runs are repeated without its limit on velocities, which the ends of
//! the robot exceed from about 5 Hz on.

use super::walking::STRIDE;
use super::{Bench, Findings, Origin, StudyError};
use crate::sweep::{Row, Sweep};
use crate::view::page::WHOLE;
use crate::view::{Figure, Mark, fixed, signed};

/// Frequencies (Hz) of the runs on Bullet, their time step (s), and their number of joints per actuator.
const SPOTS_HZ: [f64; 5] = [1.0, 3.0, 6.0, 8.0, 14.0];
const SPOTS_STEP: f64 = 1e-5;
const SPOTS_MOTORS: i64 = 3;
/// Highest frequency with measured forward motion (Hz).
const FORWARD_TO_HZ: f64 = 3.0;
/// Measured speeds: frequency (Hz), speed (mm/s). They are the paper's fastest backward and its fastest forward.
const SPEEDS: [(f64, f64); 2] = [(8.0, -7.0), (14.0, 12.0)];
/// Columns of the ensemble's mean and of its quantiles of 5 and 95 %.
const MEAN_AND_BAND: [usize; 3] = [0, 2, 4];

/// The curve of one chain at one time step.
struct Curve {
    motors: i64,
    step: f64,
    /// Frequency (Hz); mean speed and both quantiles (mm/s), NaN where there are none.
    points: Vec<(f64, [f64; 3])>,
}

impl Curve {
    /// All curves of the sweep, whose axes are the joints per actuator, the time step and the frequency.
    fn all(sweep: &Sweep, rows: &[Row]) -> Vec<Self> {
        let setting = |row: &Row| {
            let values = sweep.point(row.index);
            let number =
                |at: usize| values[at].as_float().or_else(|| values[at].as_integer().map(|i| i as f64)).unwrap_or(f64::NAN);
            (values[0].as_integer().unwrap_or_default(), number(1), number(2))
        };
        let is_same = |a: &Row, b: &Row| (setting(a).0, setting(a).1) == (setting(b).0, setting(b).1);
        let point = |row: &Row| (setting(row).2, MEAN_AND_BAND.map(|column| row.measures[column].unwrap_or(f64::NAN)));
        rows.chunk_by(is_same)
            .map(|rows| Self { motors: setting(&rows[0]).0, step: setting(&rows[0]).1, points: rows.iter().map(point).collect() })
            .collect()
    }

    fn at(&self, frequency: f64) -> [f64; 3] {
        self.points.iter().find(|point| point.0 == frequency).map_or([f64::NAN; 3], |point| point.1)
    }

    /// Highest frequency (Hz) up to which all means go forward.
    fn forward_to(&self) -> f64 {
        self.points.iter().take_while(|point| point.1[0] > 0.0).last().map_or(0.0, |point| point.0)
    }

    /// Frequency (Hz) and mean (mm/s) of the largest speed backward (−1) or forward (1).
    fn fastest(&self, direction: f64) -> (f64, f64) {
        let finite = self.points.iter().filter(|point| point.1[0].is_finite());
        let best = finite.max_by(|a, b| (direction * a.1[0]).total_cmp(&(direction * b.1[0])));
        best.map_or((f64::NAN, f64::NAN), |point| (point.0, point.1[0]))
    }
}

/// Speed against frequency.
pub fn speed(bench: &Bench) -> Result<Findings, StudyError> {
    let (sweep, rows) = bench.sweep("speed", "published-speeds-scan", &[])?;
    let curves = Curve::all(&sweep, &rows);
    let mut findings = Findings::default();
    compare(&mut findings, &curves);
    let spots = bench.spots("speed", &alone(&sweep)?, SPOTS_STEP, &SPOTS_HZ)?;
    findings.engines = format!(
        "Ours: planar engine, {} runs a point at time steps of 100 and 20 µs, friction ±2 % and joint angles ±1 mrad (one standard deviation). Spot checks: \
         Bullet without its limit on velocities, the unperturbed run of m = {SPOTS_MOTORS}, time step {} µs.",
        sweep.members(0)?.len(),
        fixed(1e6 * SPOTS_STEP, 0)
    );
    let finest = |motors: i64| curves.iter().filter(move |curve| curve.motors == motors).min_by(|a, b| a.step.total_cmp(&b.step));
    if let Some(curve) = finest(SPOTS_MOTORS) {
        for &(f, on_bullet) in &spots {
            let [mean, low, high] = curve.at(f);
            let inside = (low..=high).contains(&on_bullet);
            findings.compare(
                &format!("speed at {f} Hz, m = {SPOTS_MOTORS}, on both engines"),
                "",
                format!("{} mm/s ({} to {})", signed(mean, 2), signed(low, 2), signed(high, 2)),
                "",
                if inside {
                    "Bullet lies within the band from 5 to 95 %."
                } else {
                    "Bullet lies beside the band from 5 to 95 %."
                },
            );
            findings.check_on_bullet("mm/s", mean, on_bullet);
        }
    }
    draw(&mut findings, [3, 5].into_iter().filter_map(finest), spots);
    findings.caption = "Mean speed over the second half of 3 s; bands from 5 to 95 % of the runs, at a time step of 20 µs. The paper gives two speeds, without \
                        their accuracy, and the frequency up to which the robot goes forward."
        .into();
    Ok(findings)
}

/// The sweep for Bullet: one chain, nothing perturbed, no limit on velocities.
fn alone(sweep: &Sweep) -> Result<Sweep, StudyError> {
    let mut sweep = sweep.clone();
    sweep.source.set("simulation.velocity_limit=1e6")?;
    sweep.axes[0].values = vec![SPOTS_MOTORS.into()];
    Ok(sweep.without_ensemble())
}

/// Compares what the paper says of its curve with that of every chain and time step.
fn compare(findings: &mut Findings, curves: &[Curve]) {
    let told = |value: &dyn Fn(&Curve) -> String| {
        let of = |curve: &Curve| format!("m = {}, {} µs: {}", curve.motors, fixed(1e6 * curve.step, 0), value(curve));
        curves.iter().map(of).collect::<Vec<_>>().join("; ")
    };
    let chosen = "Friction and damping are chosen for these facts; the paper gives neither.";
    findings.compare(
        "travel per cycle at 1 Hz",
        "1.9 mm (measured)",
        told(&|curve| format!("{} mm", fixed(curve.at(1.0)[0], 2))),
        told(&|curve| format!("{} %", signed(100.0 * (curve.at(1.0)[0] / STRIDE - 1.0), 0))),
        chosen,
    );
    findings.compare(
        "forward up to",
        "3 Hz (measured)",
        told(&|curve| format!("{} Hz", fixed(curve.forward_to(), 0))),
        told(&|curve| format!("{} Hz", signed(curve.forward_to() - FORWARD_TO_HZ, 0))),
        "From 4 to 7 Hz the simulated speeds change their sign from one frequency to the next.",
    );
    for (quantity, (f, speed), explanation) in [
        ("fastest backward", SPEEDS[0], "The simulated curve has its minimum earlier, and is slower at 7 Hz."),
        ("fastest forward", SPEEDS[1], "The simulated curve has its maximum later."),
    ] {
        let fastest = |curve: &Curve| curve.fastest(f64::signum(speed));
        findings.compare(
            quantity,
            &format!("{} mm/s at {f} Hz (measured)", signed(speed, 0)),
            told(&|curve| format!("{} mm/s at {} Hz", signed(fastest(curve).1, 1), fixed(fastest(curve).0, 0))),
            told(&|curve| format!("{} Hz", signed(fastest(curve).0 - f, 0))),
            explanation,
        );
    }
    for (f, speed) in SPEEDS {
        findings.compare(
            &format!("speed at {f} Hz"),
            &format!("{} mm/s (measured)", signed(speed, 0)),
            told(&|curve| {
                let [mean, low, high] = curve.at(f);
                format!("{} mm/s ({} to {})", signed(mean, 1), signed(low, 1), signed(high, 1))
            }),
            told(&|curve| format!("{} mm/s", signed(curve.at(f)[0] - speed, 1))),
            "In brackets from 5 to 95 % of the runs.",
        );
    }
    let means: Vec<(f64, f64)> = curves.iter().flat_map(|curve| curve.points.iter().map(|point| (point.0, point.1[0]))).collect();
    findings.without_result(&means);
}

fn draw<'a>(findings: &mut Findings, curves: impl Iterator<Item = &'a Curve>, spots: Vec<(f64, f64)>) {
    let mut figure = Figure::new("Speed of the inchworm sequence", "frequency (Hz)", "speed (mm/s)");
    figure.setting("(300, 300, −1500, 300, 300) V, constants of the preset published-speeds").size(WHOLE);
    figure.horizontal(0.0);
    let mut range = SPEEDS.iter().chain(&spots).map(|point| point.1).fold([0.0, 0.0], |[l, h]: [f64; 2], v| [l.min(v), h.max(v)]);
    for curve in curves {
        for point in curve.points.iter().filter(|point| point.1[0].is_finite()) {
            range = [range[0].min(point.1[1]), range[1].max(point.1[2])];
        }
        figure.band(curve.points.iter().map(|(f, [_, low, high])| (*f, *low, *high)));
        let label = format!("planar engine, m = {}", curve.motors);
        figure.series(&label, curve.points.iter().map(|(f, [mean, ..])| (*f, *mean)), Mark::Both);
    }
    figure.series("Bullet, m = 3", spots, Mark::Points);
    findings.publish(&mut figure, "measured", Origin::Measured, &SPEEDS, None);
    findings.publish_up(&mut figure, "measured: forward up to 3 Hz", Origin::Measured, FORWARD_TO_HZ, range);
    findings.figure = figure.svg();
}
