//! Other memories between voltage and strain: creep and hysteresis.

use super::curves::Operator;
use super::protocol::follow;

/// Linear branches with their weights behind the voltage.
fn branches(first: f64, mut elements: Vec<[f64; 2]>) -> Operator {
    elements.retain(|[_, weight]| weight.abs() > 1e-12);
    let mut states = vec![first; elements.len()];
    let mut before = first;
    Box::new(move |v, dt| {
        let mut sum = v;
        for (state, [time, weight]) in states.iter_mut().zip(&elements) {
            *state = follow(*state, before, v, dt, *time);
            sum += weight * *state;
        }
        before = v;
        sum
    })
}

/// The answer to a step grows by `1 - exp(-sqrt(t / 0.8 s))`: Kohlrausch's law, by its exact density of relaxation times at exponent 1/2.
pub fn stretched_creep(share: f64, first: f64) -> Operator {
    const TIME: f64 = 0.8;
    let step = 10f64.ln() / 5.0;
    let element = |k: i32| {
        let time = 1e-3 * (f64::from(k) * step).exp();
        [time, share * step * (time / TIME).sqrt() * (-time / (4.0 * TIME)).exp() / (2.0 * std::f64::consts::PI.sqrt())]
    };
    branches(first, (0..25).map(element).collect())
}

/// Two Kelvin-Voigt elements, at 0.23 s and 4.1 s; the slower one creeps more.
pub fn two_element_creep(share: f64, first: f64) -> Operator {
    branches(first, vec![[0.23, 0.6 * share], [4.1, share]])
}

/// Creep behind thresholds: Krejci and Kuhnen, IEE Proc. Control Theory Appl. 148 (2001) 185.
pub fn threshold_creep(share: f64, first: f64) -> Operator {
    const ELEMENTS: [[f64; 2]; 6] = [[60.0, 0.3], [60.0, 3.0], [250.0, 0.3], [250.0, 3.0], [600.0, 0.3], [600.0, 3.0]];
    let mut states = [first; ELEMENTS.len()];
    Box::new(move |v, dt| {
        for (state, [threshold, time]) in states.iter_mut().zip(ELEMENTS) {
            let aim = state.clamp(v - threshold, v + threshold);
            *state = follow(*state, aim, aim, dt, time);
        }
        v + share * states.iter().sum::<f64>()
    })
}

/// Creep by thermal activation: its rate is a hyperbolic sine of what is left of it, `(300 V / 6 s) sinh((v - q) / 300 V)` (Eyring, J. Chem. Phys. 4
/// (1936) 283), so that it is fast after large steps and slows down as a logarithm.
pub fn activated_creep(share: f64, first: f64) -> Operator {
    const RANGE: f64 = 300.0;
    const TIME: f64 = 6.0;
    let mut state = first;
    Box::new(move |v, dt| {
        // Exact for a constant voltage.
        let left = (0.5 * (v - state) / RANGE).tanh() * (-dt / TIME).exp();
        if dt > 0.0 {
            state = v - 2.0 * RANGE * left.atanh();
        }
        v + share * state
    })
}

/// The amount of creep grows with the square of the field, which is assumed, as domains switch more readily towards the coercive one (creep of soft PZT:
/// Zhou and Kamlah, 2006). The size is the share of each element at 1000 V.
pub fn quadratic_creep(share: f64, first: f64) -> Operator {
    let amount = |v: f64| v * v.abs() / 1000.0;
    let mut slow = branches(amount(first), [0.2, 1.0, 5.0].map(|time| [time, share]).to_vec());
    Box::new(move |v, dt| v + slow(amount(v), dt) - amount(v))
}

/// Makes the answer to a stroke from 0 to -1500 V as large as the stroke.
fn with_full_stroke(make: impl Fn(f64) -> Operator, first: f64) -> Operator {
    let mut fresh = make(0.0);
    let mut reached = 0.0;
    for v in 0..=1500 {
        reached = fresh(-f64::from(v), 0.0);
    }
    let gain = -1500.0 / reached;
    let mut operator = make(first);
    Box::new(move |v, dt| gain * operator(v, dt))
}

/// Preisach's operator with normal densities of the mean and the half width of its relays, as plays with a curved output (Brokate and Sprekels,
/// Hysteresis and Phase Transitions, 1996).
pub fn preisach(share: f64, first: f64) -> Operator {
    const COUNT: usize = 40;
    const MEAN: f64 = -600.0;
    const SPREAD: f64 = 700.0;
    let envelope = |u: f64| SPREAD * (0.5 * std::f64::consts::PI).sqrt() * erf((u - MEAN) / (SPREAD * std::f64::consts::SQRT_2));
    let radii: [f64; COUNT] = std::array::from_fn(|i| 30.0 * (i as f64 + 0.5));
    let raw = radii.map(|r| (-0.5 * ((r - 250.0) / 220.0).powi(2)).exp());
    let sum: f64 = raw.iter().sum();
    let make = move |first: f64| -> Operator {
        let mut places = [first; COUNT];
        Box::new(move |v, _| {
            let mut switched = 0.0;
            for i in 0..COUNT {
                places[i] = places[i].clamp(v - radii[i], v + radii[i]);
                switched += raw[i] / sum * (envelope(places[i]) - envelope(0.0));
            }
            (1.0 - share) * v + share * switched
        })
    };
    with_full_stroke(make, first)
}

/// Error function: Abramowitz and Stegun, 7.1.26.
fn erf(x: f64) -> f64 {
    let t = 1.0 / (1.0 + 0.327_591_1 * x.abs());
    let series = t * (0.254_829_592 + t * (-0.284_496_736 + t * (1.421_413_741 + t * (-1.453_152_027 + t * 1.061_405_429))));
    (1.0 - series * (-x * x).exp()).copysign(x)
}

/// Duhem's operator with Dahl's exponent 2 (Dahl, 1968) and unlike limits of the two branches; the size is the mean limit over 750 V.
pub fn duhem(width: f64, first: f64) -> Operator {
    const SLOPE: f64 = 0.5;
    let make = move |first: f64| -> Operator {
        let (mut loss, mut before) = (0.0_f64, first);
        Box::new(move |v, _| {
            let sign = (v - before).signum();
            let limit = 750.0 * width * if sign < 0.0 { 1.25 } else { 0.75 };
            let parts = ((v - before).abs() * SLOPE / (0.02 * limit)).ceil().max(1.0);
            let part = (v - before) / parts;
            for _ in 0..parts as usize {
                let left = 1.0 - sign * loss / limit;
                loss += SLOPE * part * left * left.abs();
            }
            before = v;
            v - loss
        })
    };
    with_full_stroke(make, first)
}

/// Adds the point `now` to the turning points, `[volts, answer]`, if `v` lies back from there, and takes out those that are passed: Madelung's rules.
fn turn(turns: &mut Vec<[f64; 2]>, now: [f64; 2], v: f64) {
    let last = turns[turns.len() - 1][0];
    if (v - now[0]) * (now[0] - last) < 0.0 {
        turns.push(now);
    }
    loop {
        let count = turns.len();
        if count >= 3 && (v - turns[count - 2][0]) * (turns[count - 2][0] - turns[count - 1][0]) > 0.0 {
            turns.truncate(count - 2);
        } else if count == 2 && (v - turns[0][0]).abs() > (turns[1][0] - turns[0][0]).abs() {
            turns.pop();
        } else {
            break;
        }
    }
}

/// Rayleigh's law: parabolic branches from the turning points, which are wiped out as they are passed (Madelung's rules; Damjanovic, Rep. Prog.
/// Phys. 61 (1998) 1267). The size is the share of the irreversible part in a stroke of 1500 V.
pub fn rayleigh(share: f64, first: f64) -> Operator {
    let mut turns = vec![[first, first]];
    let mut now = [first, first];
    let branch = move |turns: &[[f64; 2]], v: f64| {
        let [from, base] = turns[turns.len() - 1];
        let part = if turns.len() == 1 { 1.0 } else { 0.5 };
        base + (v - from) * (1.0 - share + part * share * (v - from).abs() / 1500.0)
    };
    Box::new(move |v, _| {
        turn(&mut turns, now, v);
        now = [v, branch(&turns, v)];
        now[1]
    })
}

/// Every branch is the same cubic between the point where it turned and the one before, or the mirror image of a first turn, so that loops of all widths are
/// alike, after the linear mapping of polynomials by Bashash and Jalili (2008); that they are cubic is assumed. The size is half the gain that is lost at a
/// turn.
pub fn mapped_branches(share: f64, first: f64) -> Operator {
    let mut turns = vec![[first, first]];
    let mut now = [first, first];
    let branch = move |turns: &[[f64; 2]], v: f64| {
        let ([from, base], before) = match *turns {
            [.., before, last] if turns.len() > 2 => (last, before),
            [start, last] => (last, [2.0 * start[0] - last[0], 2.0 * start[1] - last[1]]),
            _ => return v,
        };
        let part = (v - from) / (before[0] - from);
        base + (before[1] - base) * part * (1.0 - share * (1.0 - part) * (2.0 - part))
    };
    Box::new(move |v, _| {
        turn(&mut turns, now, v);
        now = [v, branch(&turns, v)];
        now[1]
    })
}

/// Langevin's function.
fn langevin(x: f64) -> f64 {
    if x.abs() < 1e-3 { x / 3.0 } else { 1.0 / x.tanh() - 1.0 / x }
}

/// Jiles and Atherton's model for walls of ferroelectric domains: an anhysteretic curve of Langevin, which the irreversible polarisation follows over the
/// pinning voltage and only towards it, and bowing walls (Smith and Hom, J. Intell. Mater. Syst. Struct. 10 (1999) 195; without the field of the
/// neighbours). The size is the share of domains in the strain.
pub fn jiles_atherton(share: f64, first: f64) -> Operator {
    const SHAPE: f64 = 700.0;
    const PINNING: f64 = 250.0;
    const BOWING: f64 = 0.2;
    let make = move |first: f64| -> Operator {
        let (mut irreversible, mut before) = (langevin(first / SHAPE), first);
        Box::new(move |v, _| {
            let parts = ((v - before).abs() / 5.0).ceil().max(1.0);
            let part = (v - before) / parts;
            for k in 0..parts as usize {
                let lag = langevin((before + (k as f64 + 0.5) * part) / SHAPE) - irreversible;
                if lag * part > 0.0 {
                    irreversible -= lag * (-part.abs() / PINNING).exp_m1();
                }
            }
            before = v;
            let domains = BOWING * langevin(v / SHAPE) + (1.0 - BOWING) * irreversible;
            (1.0 - share) * v + share * 3.0 * SHAPE * domains
        })
    };
    with_full_stroke(make, first)
}
