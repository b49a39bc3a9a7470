//! The runs of the bench, and the way from the voltage commanded to the voltage that bends the sheet.

use super::effects::{Nature, RADII};
use super::forms::Stage;

/// Longest interval between the points of a drive, s.
const FINE: f64 = 1e-4;
/// Voltage over which the edge of a saturating amplifier is rounded, V.
const KNEE: f64 = 4.0;

#[derive(Clone, Copy)]
pub enum Wave {
    Levels(&'static [f64]),
    Step { at: f64, volts: f64 },
    Sine { hertz: f64, volts: f64 },
    Square { hertz: f64, volts: f64 },
    Triangle { hertz: f64, high: f64, low: f64 },
}

pub struct Run {
    pub id: &'static str,
    pub interval: f64,
    pub duration: f64,
    pub wave: Wave,
}

const STAIRS: [f64; 16] =
    [0.0, -300.0, -600.0, -900.0, -1200.0, -1500.0, -1200.0, -900.0, -600.0, -300.0, 0.0, 150.0, 300.0, 450.0, 300.0, 0.0];

const fn sine(id: &'static str, hertz: f64, volts: f64, duration: f64) -> Run {
    Run { id, interval: 0.002, duration, wave: Wave::Sine { hertz, volts } }
}

pub const RUNS: [Run; 11] = [
    Run { id: "staircase", interval: 0.02, duration: 16.0, wave: Wave::Levels(&STAIRS) },
    Run { id: "step-1000v", interval: 0.001, duration: 1.6, wave: Wave::Step { at: 0.1, volts: -1000.0 } },
    sine("ac-2hz-400v", 2.0, -400.0, 2.0),
    sine("ac-2hz-1500v", 2.0, -1500.0, 2.0),
    sine("ac-12hz-400v", 12.0, -400.0, 1.0),
    sine("ac-12hz-1500v", 12.0, -1500.0, 1.0),
    sine("ac-18hz-400v", 18.0, -400.0, 1.5),
    sine("ac-18hz-1200v", 18.0, -1200.0, 1.5),
    sine("ac-25hz-1500v", 25.0, -1500.0, 1.0),
    Run { id: "triangle-0.25hz", interval: 0.02, duration: 8.0, wave: Wave::Triangle { hertz: 0.25, high: 450.0, low: -1500.0 } },
    Run { id: "square-7hz", interval: 0.002, duration: 1.2, wave: Wave::Square { hertz: 7.0, volts: -900.0 } },
];

impl Run {
    pub fn times(&self) -> Vec<f64> {
        let rows = (self.duration / self.interval).round() as usize;
        (0..=rows).map(|i| i as f64 * self.interval).collect()
    }
}

impl Wave {
    pub fn volts(&self, t: f64) -> f64 {
        let turn = |hertz: f64| (t * hertz + 1e-9).fract();
        match *self {
            Wave::Levels(levels) => levels[((t + 1e-9) as usize).min(levels.len() - 1)],
            Wave::Step { at, volts } if t + 1e-9 >= at => volts,
            Wave::Sine { hertz, volts } => 0.5 * volts * (1.0 - (std::f64::consts::TAU * hertz * t).cos()),
            Wave::Square { hertz, volts } if turn(hertz) >= 0.5 => volts,
            Wave::Step { .. } | Wave::Square { .. } => 0.0,
            Wave::Triangle { hertz, high, low } => low + (high - low) * (1.0 - 2.0 * (t * hertz).fract()).abs(),
        }
    }

    /// Times at which the voltage jumps or bends.
    fn edges(&self, duration: f64) -> Vec<f64> {
        let every =
            |interval: f64| (1..).map(move |i| f64::from(i) * interval).take_while(move |t| *t < duration - 1e-9).collect();
        match *self {
            Wave::Levels(_) => every(1.0),
            Wave::Step { at, .. } => vec![at],
            Wave::Sine { .. } => Vec::new(),
            Wave::Square { hertz, .. } | Wave::Triangle { hertz, .. } => every(0.5 / hertz),
        }
    }
}

/// A stretch of time without a jump, sampled evenly.
#[derive(Clone)]
pub struct Segment {
    pub start: f64,
    interval: f64,
    volts: Vec<f64>,
}

#[derive(Clone)]
pub struct Drive {
    pub segments: Vec<Segment>,
}

impl Segment {
    pub fn end(&self) -> f64 {
        self.start + self.interval * (self.volts.len() - 1) as f64
    }
}

impl Drive {
    /// The voltage commanded; the last value inside a segment is the limit from the left.
    fn commanded(run: &Run) -> Drive {
        let mut edges = vec![0.0];
        edges.extend(run.wave.edges(run.duration));
        edges.push(run.duration);
        let segment = |pair: &[f64]| {
            let pieces = ((pair[1] - pair[0]) / FINE - 1e-6).ceil();
            let interval = (pair[1] - pair[0]) / pieces;
            let shy = |i: usize| if i == pieces as usize { 1e-7 } else { 0.0 };
            let volts = (0..=pieces as usize).map(|i| run.wave.volts(pair[0] + i as f64 * interval - shy(i))).collect();
            Segment { start: pair[0], interval, volts }
        };
        Drive { segments: edges.windows(2).map(segment).collect() }
    }

    /// The voltage that bends the sheet, each of the effects of the driver and of the actuation in its turn.
    pub fn of(run: &Run, nature: &Nature, gain: f64) -> Drive {
        let mut drive = Drive::commanded(run);
        drive.delay(nature.delay_s, run.duration);
        drive.map(|v| soft_max(nature.low_v, v));
        drive.slew(nature.slew_v_per_s);
        drive.lag(nature.lag_s);
        drive.pass(&nature.other.driver);
        let first = drive.first();
        let mut plays = Plays::new(nature.hysteresis, first);
        drive.each(|v, _| plays.follow(v));
        let mut creep = Creep::new(nature.creep, first);
        drive.each(|v, dt| creep.follow(v, dt));
        let mut lowest = first.min(0.0);
        drive.each(|v, _| {
            lowest = lowest.min(v);
            v + nature.remanence * lowest
        });
        drive.map(|v| v * (1.0 + nature.slope_per_v * (v.hypot(15.0) - 15.0)));
        drive.pass(&nature.other.actuation);
        drive.map(|v| gain * if v > 0.0 { nature.ratio * v } else { v });
        drive
    }

    pub fn first(&self) -> f64 {
        self.segments[0].volts[0]
    }

    pub fn at(&self, segment: usize, time: f64) -> f64 {
        let segment = &self.segments[segment];
        let place = ((time - segment.start) / segment.interval).max(0.0);
        let index = (place as usize).min(segment.volts.len() - 2);
        let part = place - index as f64;
        segment.volts[index] * (1.0 - part) + segment.volts[index + 1] * part
    }

    fn map(&mut self, change: impl Fn(f64) -> f64) {
        self.each(|v, _| change(v));
    }

    /// Replaces every value, in order; the second argument is the time since the one before (0 across a jump).
    fn each(&mut self, mut change: impl FnMut(f64, f64) -> f64) {
        for segment in &mut self.segments {
            for (i, value) in segment.volts.iter_mut().enumerate() {
                *value = change(*value, if i > 0 { segment.interval } else { 0.0 });
            }
        }
    }

    /// Other forms of the effects, one after the other.
    fn pass(&mut self, stages: &[Stage]) {
        for stage in stages {
            let operator = stage.operator(self.first());
            self.each(operator);
        }
    }

    fn delay(&mut self, delay: f64, duration: f64) {
        if delay <= 0.0 {
            return;
        }
        let first = self.first();
        self.segments.iter_mut().for_each(|s| s.start += delay);
        self.segments.insert(0, Segment { start: 0.0, interval: delay, volts: vec![first; 2] });
        self.segments.retain(|s| s.start < duration);
    }

    fn slew(&mut self, rate: f64) {
        if rate.is_finite() {
            let mut now = self.first();
            self.each(|v, dt| {
                now += (v - now).clamp(-rate * dt, rate * dt);
                now
            });
        }
    }

    /// A resistor before a capacitor, exact for a voltage that is linear between the points.
    fn lag(&mut self, time: f64) {
        if time > 0.0 {
            let mut now = self.first();
            let mut before = now;
            self.each(|v, dt| {
                now = follow(now, before, v, dt, time);
                before = v;
                now
            });
        }
    }
}

/// First-order response after `dt` to an input that goes evenly from `before` to `after`.
pub fn follow(state: f64, before: f64, after: f64, dt: f64, time: f64) -> f64 {
    if dt <= 0.0 {
        return state;
    }
    let decay = (-dt / time).exp();
    let slope = (after - before) / dt;
    after - slope * time + (state - before + slope * time) * decay
}

/// The larger of two voltages, with a rounded knee.
fn soft_max(low: f64, v: f64) -> f64 {
    if low == f64::NEG_INFINITY {
        return v;
    }
    let depth = (v - low) / KNEE;
    low + KNEE * if depth > 30.0 { depth } else { depth.exp().ln_1p() }
}

/// Radius of a play operator, V: evenly spaced logarithms from 75 to 1500 V.
fn radius(index: usize) -> f64 {
    75.0 * 20f64.powf(index as f64 / (RADII - 1) as f64)
}

/// Play operators in parallel, and a gain that makes up for what they take from a full stroke of 1500 V.
pub struct Plays {
    radii: [f64; RADII],
    weights: [f64; RADII],
    places: [f64; RADII],
    gain: f64,
}

impl Plays {
    pub fn new(share: f64, first: f64) -> Plays {
        let radii: [f64; RADII] = std::array::from_fn(radius);
        let raw: [f64; RADII] = std::array::from_fn(|i| 0.93f64.powi(i as i32));
        let sum: f64 = raw.iter().sum();
        let weights = raw.map(|w| share * w / sum);
        let lost: f64 = weights.iter().zip(radii).map(|(w, r)| w * (2.0 * r / 1500.0).min(1.0)).sum();
        Plays { radii, weights, places: [first; RADII], gain: 1.0 / (1.0 - lost) }
    }

    pub fn follow(&mut self, v: f64) -> f64 {
        let mut loss = 0.0;
        for i in 0..RADII {
            self.places[i] = self.places[i].clamp(v - self.radii[i], v + self.radii[i]);
            loss += self.weights[i] * (v - self.places[i]);
        }
        self.gain * (v - loss)
    }
}

/// Slow branches, half a decade apart from 0.1 s.
pub struct Creep {
    share: f64,
    states: [f64; 6],
    before: f64,
}

impl Creep {
    pub fn new(share: f64, first: f64) -> Creep {
        Creep { share, states: [first; 6], before: first }
    }

    pub fn follow(&mut self, v: f64, dt: f64) -> f64 {
        if self.share > 0.0 {
            for (k, state) in self.states.iter_mut().enumerate() {
                *state = follow(*state, self.before, v, dt, 0.1 * 10f64.powf(0.5 * k as f64));
            }
            self.before = v;
        }
        v + self.share * self.states.iter().sum::<f64>()
    }
}
