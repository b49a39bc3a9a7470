//! A recording as an animated GIF.

use tiny_skia::{Color, LineCap, LineJoin, Paint, PathBuilder, Pixmap, Rect, Stroke, Transform};

use super::player::{on_ground, voltages};
use crate::model::units::mm_from_cm;
use crate::recording::Recording;

/// Width of the picture (px).
const WIDTH: u32 = 640;
/// Frames per second; GIF counts in hundredths of a second.
const FRAMES_PER_S: f64 = 25.0;
/// Frames of a GIF at most.
const FRAMES: usize = 1000;

/// Draws the recording at `speed` (1: real time; by default, some seconds long) and encodes it, repeating for ever.
///
/// # Errors
/// What the encoder reports, in words.
pub fn gif(recording: &Recording, speed: Option<f64>) -> Result<Vec<u8>, String> {
    let duration = recording.time.last().copied().unwrap_or(0.0);
    let speed = speed.unwrap_or(duration / 6.0).max(1e-6);
    let count = ((duration / speed * FRAMES_PER_S).ceil() as usize).clamp(1, FRAMES);
    let view = View::of(recording);
    let mut out = Vec::new();
    let failed = |error: gif::EncodingError| error.to_string();
    let mut encoder = gif::Encoder::new(&mut out, WIDTH as u16, view.height as u16, &[]).map_err(failed)?;
    encoder.set_repeat(gif::Repeat::Infinite).map_err(failed)?;
    for i in 0..count {
        let t = i as f64 * speed / FRAMES_PER_S;
        let record = recording.time.partition_point(|&time| time < t).min(recording.len() - 1);
        let mut pixels = view.draw(recording, record).ok_or("the picture is too large")?.take();
        let mut frame = gif::Frame::from_rgba_speed(WIDTH as u16, view.height as u16, &mut pixels, 20);
        frame.delay = (100.0 / FRAMES_PER_S) as u16;
        encoder.write_frame(&frame).map_err(failed)?;
    }
    drop(encoder);
    Ok(out)
}

/// What part of the plane is shown, and how large.
struct View {
    left: f64,
    bottom: f64,
    scale: f64,
    height: u32,
    largest_voltage: f64,
}

impl View {
    fn of(recording: &Recording) -> Self {
        let nodes = || (0..recording.len()).flat_map(|r| (0..recording.nodes()).map(move |n| (r, n)));
        let range = |axis: usize| {
            nodes()
                .map(|(r, n)| mm_from_cm(recording.node(r, n)[axis]))
                .fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(v), h.max(v)))
        };
        let ((left, right), (bottom, top)) = (range(0), range(2));
        let pad = 0.04 * (right - left) + 2.0;
        let scale = f64::from(WIDTH) / (right - left + 2.0 * pad);
        let height = ((top - bottom + 2.0 * pad) * scale).clamp(90.0, 480.0);
        let largest_voltage = recording.motor_voltages.iter().fold(1e-9_f64, |most, v| most.max(v.abs()));
        Self {
            left: left - pad,
            bottom: bottom - pad,
            scale,
            height: height as u32,
            largest_voltage: largest_voltage * recording.meta.motors_per_actuator as f64,
        }
    }

    fn at(&self, [x, _, z]: [f64; 3]) -> (f32, f32) {
        let px = (mm_from_cm(x) - self.left) * self.scale;
        let py = f64::from(self.height) - (mm_from_cm(z) - self.bottom) * self.scale;
        (px as f32, py as f32)
    }

    fn draw(&self, recording: &Recording, record: usize) -> Option<Pixmap> {
        let mut map = Pixmap::new(WIDTH, self.height)?;
        map.fill(Color::WHITE);
        if on_ground(recording) {
            let (_, floor) = self.at([0.0, 0.0, -0.05]);
            let below = Rect::from_xywh(0.0, floor, WIDTH as f32, (self.height as f32 - floor).max(1.0))?;
            map.fill_rect(below, &paint([225, 225, 225]), Transform::identity(), None);
        }
        let volts = voltages(recording, record);
        let (m, last) = (recording.meta.motors_per_actuator, recording.nodes() - 1);
        let node = |n: usize| self.at(recording.node(record, n));
        let half = |a: usize, b: usize| ((node(a).0 + node(b).0) / 2.0, (node(a).1 + node(b).1) / 2.0);
        let thickness = self.scale.max(3.0) as f32;
        for (extra, coloured) in [(2.0, false), (0.0, true)] {
            for (a, &v) in volts.iter().enumerate() {
                // An actuator reaches from half a link before its first joint to half a link after its last.
                let first = a * m + 1;
                let begin = if a == 0 { node(0) } else { half(first - 1, first) };
                let end = if first + m == last { node(last) } else { half(first + m - 1, first + m) };
                let mut path = PathBuilder::new();
                path.move_to(begin.0, begin.1);
                (first..first + m).map(node).chain([end]).for_each(|(x, y)| path.line_to(x, y));
                let stroke =
                    Stroke { width: thickness + extra, line_cap: LineCap::Butt, line_join: LineJoin::Round, ..Stroke::default() };
                let colour = if coloured { shade(v / self.largest_voltage) } else { [34, 34, 34] };
                map.stroke_path(&path.finish()?, &paint(colour), &stroke, Transform::identity(), None);
            }
        }
        Some(map)
    }
}

fn paint(colour: [u8; 3]) -> Paint<'static> {
    let mut paint = Paint { anti_alias: true, ..Paint::default() };
    paint.set_color_rgba8(colour[0], colour[1], colour[2], 255);
    paint
}

/// Light grey for 0 V, towards blue for negative and red for positive voltages.
fn shade(share: f64) -> [u8; 3] {
    let end = if share < 0.0 { [0.0, 90.0, 190.0] } else { [200.0, 60.0, 0.0] };
    end.map(|end| (225.0 + share.abs().min(1.0) * (end - 225.0)) as u8)
}
