//! Animated GIFs of recordings: each frame is an SVG with time, scale bar, voltages and their colour bar.

use std::fmt::Write;

use super::axis::ticks;
use super::canvas::{Anchor, Canvas, Size};
use super::image::{ImageError, pixels};
use super::player::{on_ground, voltages};
use super::text::{number, significant, width};
use crate::model::units::mm_from_cm;
use crate::recording::Recording;

/// Frames per second; GIF counts in hundredths of a second.
const FRAMES_PER_S: f64 = 25.0;
/// Largest number of frames of a GIF.
const FRAMES: usize = 1000;
/// Resolution (dots per inch); the image is 640 pixels wide.
const DPI: f64 = 96.0;
const PAGE: Size = Size { width_mm: 640.0 / 96.0 * 25.4, font_pt: 9.0 };
/// Thickness of the robot (pt).
const ROBOT: f64 = 6.0;
/// Heights of the parts above and below the robot (pt).
const HEAD: f64 = 30.0;
const FOOT: f64 = 50.0;

/// Encodes the recording as a GIF in an endless loop, at `speed` (1: real time; by default a duration of six seconds).
///
/// # Errors
/// [`ImageError`] if a frame cannot be drawn or encoded.
pub fn gif(recording: &Recording, speed: Option<f64>) -> Result<Vec<u8>, ImageError> {
    let duration = recording.time.last().copied().unwrap_or(0.0);
    let speed = speed.unwrap_or(duration / 6.0).max(1e-6);
    let count = ((duration / speed * FRAMES_PER_S).ceil() as usize).clamp(1, FRAMES);
    let scene = Scene::of(recording);
    let failed = |error: gif::EncodingError| ImageError::Encoder(error.to_string());
    let first = pixels(&scene.svg(recording, 0), DPI)?;
    let (across, high) = (first.width() as u16, first.height() as u16);
    let mut out = Vec::new();
    let mut encoder = gif::Encoder::new(&mut out, across, high, &[]).map_err(failed)?;
    encoder.set_repeat(gif::Repeat::Infinite).map_err(failed)?;
    for i in 0..count {
        let t = i as f64 * speed / FRAMES_PER_S;
        let record = recording.time.partition_point(|&time| time < t).min(recording.len() - 1);
        let mut pixels = pixels(&scene.svg(recording, record), DPI)?.take();
        let mut frame = gif::Frame::from_rgba_speed(across, high, &mut pixels, 10);
        frame.delay = (100.0 / FRAMES_PER_S) as u16;
        encoder.write_frame(&frame).map_err(failed)?;
    }
    drop(encoder);
    Ok(out)
}

/// The visible part of the plane and its scale.
struct Scene {
    /// Left and lower edge of the plane (mm).
    left: f64,
    bottom: f64,
    /// Scale (pt/mm).
    scale: f64,
    /// Height of the page, and position of the plane's lower edge on it (pt).
    height: f64,
    floor: f64,
    lowest_voltage: f64,
    highest_voltage: f64,
}

impl Scene {
    fn of(recording: &Recording) -> Self {
        let nodes = || (0..recording.len()).flat_map(|r| (0..recording.nodes()).map(move |n| (r, n)));
        let range = |axis: usize| {
            let values = nodes().map(|(r, n)| mm_from_cm(recording.node(r, n)[axis])).filter(|v| v.is_finite());
            let (low, high) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(v), h.max(v)));
            if low > high { (0.0, 1.0) } else { (low, high) }
        };
        let ((left, right), (low, top)) = (range(0), range(2));
        let pad = 0.04 * (right - left) + 2.0;
        let scale = PAGE.width() / (right - left + 2.0 * pad);
        let bottom = if on_ground(recording) { 0.0 } else { low };
        let inner = ((top - bottom) * scale + 2.0 * ROBOT).clamp(30.0, 330.0);
        let m = recording.meta.motors_per_actuator as f64;
        let volts = || recording.motor_voltages.iter().map(|v| v * m).filter(|v| v.is_finite());
        Self {
            left: left - pad,
            bottom,
            scale,
            height: HEAD + inner + FOOT,
            floor: HEAD + inner,
            lowest_voltage: volts().fold(0.0, f64::min),
            highest_voltage: volts().fold(0.0, f64::max),
        }
    }

    /// Position of a point on the page (pt): z is the height of the robot's lower face above the floor.
    fn at(&self, [x, _, z]: [f64; 3]) -> (f64, f64) {
        let px = (mm_from_cm(x) - self.left) * self.scale;
        let pz = self.floor - (mm_from_cm(z) - self.bottom) * self.scale - ROBOT / 2.0;
        (px, pz)
    }

    fn colour(&self, volts: f64) -> String {
        let [r, g, b] = shade(volts / self.highest_voltage.max(-self.lowest_voltage).max(1e-9));
        format!("#{r:02x}{g:02x}{b:02x}")
    }

    fn svg(&self, recording: &Recording, record: usize) -> String {
        let mut canvas = Canvas::default();
        let (size, right) = (PAGE.font_pt, PAGE.width());
        canvas.text(8.0, 12.0, size, Anchor::Start, &format!("time {} ms", number(1e3 * recording.time[record], 1)));
        let bar = [1, 2, 5, 10, 20, 50, 100, 200, 500, 1000].into_iter().find(|mm| f64::from(*mm) * self.scale > 45.0);
        let bar = f64::from(bar.unwrap_or(2000));
        let from = right - 8.0 - bar * self.scale;
        canvas.line((from, 19.0), (right - 8.0, 19.0), "#111", 1.5);
        canvas.text(right - 8.0, 11.0, size, Anchor::End, &format!("{bar} mm"));
        if on_ground(recording) {
            canvas.floor(0.0, right, self.floor);
        }
        let volts = voltages(recording, record);
        self.robot(&mut canvas, recording, record, &volts);
        self.numbers(&mut canvas, recording, record, &volts);
        self.key(&mut canvas);
        canvas.document(PAGE, self.height, "animation")
    }

    fn robot(&self, canvas: &mut Canvas, recording: &Recording, record: usize, volts: &[f64]) {
        let (m, last) = (recording.meta.motors_per_actuator, recording.nodes() - 1);
        let node = |n: usize| self.at(recording.node(record, n));
        let half = |a: usize, b: usize| ((node(a).0 + node(b).0) / 2.0, (node(a).1 + node(b).1) / 2.0);
        for outline in [true, false] {
            for (a, &v) in volts.iter().enumerate() {
                // An actuator reaches from half a link before its first joint to half a link after its last.
                let first = a * m + 1;
                let begin = if a == 0 { node(0) } else { half(first - 1, first) };
                let end = if first + m == last { node(last) } else { half(first + m - 1, first + m) };
                let points = [begin].into_iter().chain((first..first + m).map(node)).chain([end]);
                let points: Vec<String> = points.map(|(x, y)| format!("{x:.2},{y:.2}")).collect();
                let (colour, thick) = if outline { ("#222".into(), ROBOT) } else { (self.colour(v), ROBOT - 1.6) };
                let _ = writeln!(
                    canvas.out,
                    r#"<polyline points="{}" fill="none" stroke="{colour}" stroke-width="{thick}" stroke-linejoin="round"/>"#,
                    points.join(" ")
                );
            }
        }
    }

    /// The voltage below the middle of each actuator, if there is room for all.
    fn numbers(&self, canvas: &mut Canvas, recording: &Recording, record: usize, volts: &[f64]) {
        let m = recording.meta.motors_per_actuator;
        let middle = |a: usize| self.at(recording.node(record, a * m + m.div_ceil(2))).0;
        let texts: Vec<_> =
            volts.iter().enumerate().map(|(a, v)| (middle(a), format!("{} V", significant(v.round(), 6)))).collect();
        let clear =
            |w: &[(f64, String)]| w[1].0 - w[0].0 > (width(&w[0].1, PAGE.font_pt) + width(&w[1].1, PAGE.font_pt)) / 2.0 + 4.0;
        if texts.windows(2).all(clear) {
            for (x, text) in texts {
                canvas.text(x, self.floor + 12.0, PAGE.font_pt, Anchor::Middle, &text);
            }
        }
    }

    /// The colour bar of the voltages.
    fn key(&self, canvas: &mut Canvas) {
        const STEPS: usize = 48;
        let (size, top) = (PAGE.font_pt, self.floor + 22.0);
        let (left, right) = (PAGE.width() * 0.36, PAGE.width() * 0.9);
        canvas.text(left - 8.0, top + 5.0, size, Anchor::End, "colour: voltage (V)");
        let (low, high) = (self.lowest_voltage, self.highest_voltage.max(self.lowest_voltage + 1e-9));
        for step in 0..STEPS {
            let share = step as f64 / STEPS as f64;
            let colour = self.colour(low + (step as f64 + 0.5) / STEPS as f64 * (high - low));
            let x = left + share * (right - left);
            let _ =
                writeln!(canvas.out, r#"<rect x="{x:.2}" y="{top:.2}" width="{:.2}" height="8" fill="{colour}"/>"#, right - x);
        }
        let _ = writeln!(
            canvas.out,
            r##"<rect x="{left:.2}" y="{top:.2}" width="{:.2}" height="8" fill="none" stroke="#111" stroke-width="0.6"/>"##,
            right - left
        );
        if self.highest_voltage > self.lowest_voltage {
            let (values, digits) = ticks(low, high, 5);
            for value in values {
                let x = left + (value - low) / (high - low) * (right - left);
                canvas.text(x, top + 15.0, size, Anchor::Middle, &number(value, digits));
            }
        } else {
            canvas.text((left + right) / 2.0, top + 15.0, size, Anchor::Middle, "0");
        }
    }
}

/// Colour of a voltage as a share of the largest: light grey at 0, blue at −1, red at 1.
fn shade(share: f64) -> [u8; 3] {
    let end = if share < 0.0 { [0.0, 90.0, 190.0] } else { [200.0, 60.0, 0.0] };
    end.map(|end| (225.0 + share.abs().min(1.0) * (end - 225.0)) as u8)
}
