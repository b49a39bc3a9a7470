//! Other filters between the commanded voltage and that at the electrodes: lags, limits of the rate, and a limit of the level with memory.

use super::curves::Operator;
use super::protocol::follow;

/// Steps into which an interval of the drive is cut where a filter has no closed solution.
const PARTS: usize = 10;

/// Calls `step` with the voltage in the middle of each part of an interval, and the part's length.
fn in_parts(before: f64, after: f64, dt: f64, mut step: impl FnMut(f64, f64)) {
    if dt > 0.0 {
        for part in 0..PARTS {
            step(before + (after - before) * (part as f64 + 0.5) / PARTS as f64, dt / PARTS as f64);
        }
    }
}

/// An amplifier of second order with the damping ratio 0.7 (a power stage behind an inductor); the size is its delay of slow signals, s.
pub fn second_order(delay: f64, first: f64) -> Operator {
    const RATIO: f64 = 0.7;
    let pulse = 2.0 * RATIO / delay;
    let (mut now, mut rate, mut before) = (first, 0.0, first);
    Box::new(move |v, dt| {
        in_parts(before, v, dt, |middle, part| {
            // The trapezoidal rule, solved for the new rate.
            let pull = pulse * pulse * (middle - now) - 2.0 * RATIO * pulse * rate;
            let stiff = 1.0 + RATIO * pulse * part + 0.25 * pulse * pulse * part * part;
            let change = part * (pull - 0.5 * part * pulse * pulse * rate) / stiff;
            now += part * (rate + 0.5 * change);
            rate += change;
        });
        before = v;
        now
    })
}

/// Charging through one resistor and discharging through another of three times the size (a driver with a bleeder).
pub fn two_resistors(time: f64, first: f64) -> Operator {
    let (mut now, mut before) = (first, first);
    Box::new(move |v, dt| {
        in_parts(before, v, dt, |middle, part| {
            let is_charging = (middle - now) * now >= 0.0;
            now = follow(now, middle, middle, part, if is_charging { time } else { 3.0 * time });
        });
        before = v;
        now
    })
}

/// Two RC stages in a row, of unlike times: a filter before the amplifier and the capacitance behind it.
pub fn cascade(time: f64, first: f64) -> Operator {
    let (mut middle, mut now, mut before) = (first, first, first);
    Box::new(move |v, dt| {
        let was = middle;
        middle = follow(middle, before, v, dt, time);
        now = follow(now, was, middle, dt, 0.4 * time);
        before = v;
        now
    })
}

/// A resistor before a capacitance that grows by its small-signal value per kV, with the irreversible part of the permittivity (Hall, J. Mater. Sci. 36
/// (2001) 4575); the size is the time constant of small signals, s.
pub fn growing_capacitance(time: f64, first: f64) -> Operator {
    let (mut now, mut before) = (first, first);
    Box::new(move |v, dt| {
        in_parts(before, v, dt, |middle, part| now = follow(now, middle, middle, part, time * (1.0 + 1e-3 * now.abs())));
        before = v;
        now
    })
}

/// Electrodes of poor conductance over the capacitance, fed at one end: the mean voltage of a line without inductance, `tanh(sqrt(s T)) / sqrt(s T)` (Ghausi and
/// Kelly, Introduction to Distributed-Parameter Networks, 1968). The size is the resistance times the capacitance of the whole line, s.
pub fn resistive_electrodes(time: f64, first: f64) -> Operator {
    const MODES: usize = 8;
    let root = |k: usize| (k as f64 + 0.5) * std::f64::consts::PI;
    let (mut states, mut before) = ([first; MODES], first);
    Box::new(move |v, dt| {
        let mut now = v;
        for (k, state) in states.iter_mut().enumerate() {
            *state = follow(*state, before, v, dt, time / root(k).powi(2));
            now += 2.0 / root(k).powi(2) * (*state - v);
        }
        before = v;
        now
    })
}

/// The current of a differential pair, a hyperbolic tangent of its input (Gray and Meyer), charges the load; the size is the limit in V/s.
pub fn tanh_rate(limit: f64, first: f64) -> Operator {
    const TIME: f64 = 1e-4;
    let (mut now, mut before) = (first, first);
    Box::new(move |v, dt| {
        in_parts(before, v, dt, |middle, part| now += part * limit * ((middle - now) / (limit * TIME)).tanh());
        before = v;
        now
    })
}

/// The rate towards negative voltages is limited to the size, that back to 2.5 times as much: unlike sources and sinks.
pub fn unequal_rates(limit: f64, first: f64) -> Operator {
    let mut now = first;
    Box::new(move |v, dt| {
        now += (v - now).clamp(-limit * dt, 2.5 * limit * dt);
        now
    })
}

/// The limit of the current droops as the voltage rises: a converter of constant power.
pub fn drooping_rate(limit: f64, first: f64) -> Operator {
    let mut now = first;
    Box::new(move |v, dt| {
        let most = limit * (1.0 - now.abs() / 2200.0).max(0.1) * dt;
        now += (v - now).clamp(-most, most);
        now
    })
}

/// Twice the lasting current for a short time: the limit falls from the peak's to the lasting one's as the mean over 10 ms of the current grows (peak and average
/// current in data sheets of piezo amplifiers). The size is the lasting limit in V/s.
pub fn peak_current(limit: f64, first: f64) -> Operator {
    let (mut now, mut load) = (first, 0.0);
    Box::new(move |v, dt| {
        if dt > 0.0 {
            let most = limit * (2.0 - load) * dt;
            let change = (v - now).clamp(-most, most);
            now += change;
            let used = change.abs() / (limit * dt);
            load = follow(load, used, used, dt, 0.01);
        }
        now
    })
}

/// A flyback converter that charges by pulses of the same energy, of which as many are assumed to come at any voltage: the rate is inversely proportional to the
/// voltage and at most three times the size, which is the rate at 750 V and that of a sink of constant current, V/s.
pub fn equal_pulses(limit: f64, first: f64) -> Operator {
    let mut now = first;
    Box::new(move |v, dt| {
        let is_charging = (v - now) * now >= 0.0;
        let most = limit * dt * if is_charging { (750.0 / now.abs()).min(3.0) } else { 1.0 };
        now += (v - now).clamp(-most, most);
        now
    })
}

/// The supply sags under load and recovers in 0.15 s: the limit falls by up to 15 % with the mean of the output.
pub fn sagging_supply(limit: f64, first: f64) -> Operator {
    let mut load = (first.abs() / limit).min(1.0);
    Box::new(move |v, dt| {
        let now = v.max(-limit * (1.0 - 0.15 * load));
        load = follow(load, now.abs() / limit, now.abs() / limit, dt, 0.15);
        now
    })
}
