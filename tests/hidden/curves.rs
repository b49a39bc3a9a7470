//! Other curves from voltage to voltage: gains that follow the field, polarity and amplifiers that saturate softly.
//!
//! Each function takes the size of the form and the first voltage of a run, and makes an operator of `(voltage, time since the one before)`.

/// Turns voltages into voltages, in order of time (V, s).
pub type Operator = Box<dyn FnMut(f64, f64) -> f64>;

fn curve(change: impl Fn(f64) -> f64 + 'static) -> Operator {
    Box::new(move |v, _| change(v))
}

/// `ln(1 + exp(x))` without overflow.
fn softplus(x: f64) -> f64 {
    if x > 30.0 { x } else { x.exp().ln_1p() }
}

/// The charge constant goes from one plateau to another about 1 kV/mm, 500 V: Smart Material data sheet of the MFC (400 and 460 pm/V).
pub fn plateaus(share: f64, _: f64) -> Operator {
    curve(move |v| v * (1.0 + 0.5 * share * (1.0 + ((v.abs() - 500.0) / 160.0).tanh())))
}

/// The strain is a power of the field; for the nonlinear strain of soft ceramics see Hall, J. Mater. Sci. 36 (2001) 4575.
pub fn power_law(exponent: f64, _: f64) -> Operator {
    curve(move |v| v * (v.abs() / 700.0).powf(exponent))
}

/// Growth with the square of the field that levels off as a rational function.
pub fn rational_growth(share: f64, _: f64) -> Operator {
    curve(move |v| v * (1.0 + share * v * v / (v * v + 640_000.0)))
}

/// The charge constant is that of small signals up to a threshold of 0.7 kV/mm, 350 V, and grows with the field beyond it: domain walls move irreversibly
/// from there on (Hall, J. Mater. Sci. 36 (2001) 4575). The size is the growth per kV.
pub fn threshold_growth(slope: f64, _: f64) -> Operator {
    curve(move |v| v * (1.0 + 1e-3 * slope * (v.abs() - 350.0).max(0.0)))
}

/// The charge constant grows as domains nucleate, with `exp(-600 V / |V|)` of the size, the law of their rate: Merz, Phys. Rev. 95 (1954) 690.
pub fn nucleated_growth(share: f64, _: f64) -> Operator {
    curve(move |v| v * (1.0 + share * (-600.0 / v.abs()).exp()))
}

/// The gain of positive voltages sets in over 60 V instead of at once.
pub fn smooth_polarity(excess: f64, _: f64) -> Operator {
    curve(move |v| v * (1.0 + 0.5 * excess * (1.0 + (v / 60.0).tanh())))
}

/// The gain of positive voltages grows with them, as on the way to depoling (Damjanovic, Rep. Prog. Phys. 61 (1998) 1267).
pub fn growing_polarity(excess: f64, _: f64) -> Operator {
    curve(move |v| if v > 0.0 { v * (1.0 + excess * v / 300.0) } else { v })
}

/// What positive voltages do more levels off over 300 V, as the domains that they turn run out. The size is the excess of the gain at small ones.
pub fn levelling_polarity(excess: f64, _: f64) -> Operator {
    const RANGE: f64 = 300.0;
    curve(move |v| if v > 0.0 { v - excess * RANGE * (-v / RANGE).exp_m1() } else { v })
}

/// Positive voltages act only beyond a dead zone, rounded over 8 V.
pub fn dead_zone(volts: f64, _: f64) -> Operator {
    const ROUND: f64 = 8.0;
    let passed = move |v: f64| ROUND * (softplus((v - volts) / ROUND) - softplus(-volts / ROUND));
    curve(move |v| if v > 0.0 { passed(v) } else { v })
}

/// Positive voltages turn domains back, each at its own voltage about 230 V, as grains of unlike directions switch one by one (Hwang, Lynch and
/// McMeeking, 1995); the logistic course is assumed. The size is the stroke of all of them in V.
pub fn turned_domains(stroke: f64, _: f64) -> Operator {
    let turned = |v: f64| 1.0 / (1.0 + (-(v - 230.0) / 40.0).exp());
    curve(move |v| if v > 0.0 { v + stroke * (turned(v) - turned(0.0)) } else { v })
}

/// Straight up to 0.6 of the limit, then a hyperbolic tangent towards it: soft clipping.
pub fn tanh_limit(limit: f64, _: f64) -> Operator {
    let (knee, rest) = (0.6 * limit, 0.4 * limit);
    curve(move |v| if -v > knee { -knee - rest * ((-v - knee) / rest).tanh() } else { v })
}

/// A parabola from 300 V before the limit to 300 V behind it.
pub fn parabolic_limit(limit: f64, _: f64) -> Operator {
    const HALF: f64 = 300.0;
    curve(move |v| {
        let inside = -v - (limit - HALF);
        if inside <= 0.0 {
            v
        } else if inside < 2.0 * HALF {
            v + inside * inside / (4.0 * HALF)
        } else {
            -limit
        }
    })
}

/// A varistor across the output, behind a resistor: its current grows with the power 15 of the voltage `x`, so `v = x + limit (x / limit)^15`
/// (Levinson and Philipp, J. Appl. Phys. 46 (1975) 1332). At the size as much voltage drops in the resistor as is left.
pub fn varistor(limit: f64, _: f64) -> Operator {
    const POWER: i32 = 15;
    curve(move |v| {
        let aim = v.abs() / limit;
        // Newton's method from above, where the curve bends upwards.
        let mut left = aim.min(aim.powf(1.0 / f64::from(POWER)));
        for _ in 0..40 {
            let excess = left + left.powi(POWER) - aim;
            let slope = 1.0 + f64::from(POWER) * left.powi(POWER - 1);
            left -= excess / slope;
            if excess < 1e-13 {
                break;
            }
        }
        limit * left.copysign(v)
    })
}

/// A suppressor diode behind a resistor: beyond its breakdown, which is the size, its own resistance lets a fifth of the excess through (clamping voltage
/// against current in data sheets of such diodes).
pub fn suppressor(limit: f64, _: f64) -> Operator {
    curve(move |v| if v.abs() > limit { (limit + 0.2 * (v.abs() - limit)).copysign(v) } else { v })
}
