//! The source's resistance charges the actuator's capacitance.
//!
//! ```text
//! b·T²·d²V_a/dt² + T·dV_a/dt + V_a = V_c,  T = R·C·(1 + g·|V_a|);  r·T where V_c > V_a
//! ```
//!
//! # Parameters
//! * `time_constant_s` (s): time constant T of small voltages
//! * `inertia` (–): b: 0 is a resistance and a capacitance, ¼ two equal ones in a row; above ¼ the amplifier overshoots
//! * `rising` (–): r: time constant of rising voltages over that of falling ones, of a source and a sink of different resistance
//! * `growth_per_kv` (1/kV): g: growth of the capacitance with the voltage
//!
//! # Source
//! Capacitance per area: data sheet of the MFC actuator; derived. Second order: Franklin, Powell, Emami-Naeini, Feedback Control of Dynamic Systems. Growth: Hall, J. Mater. Sci. 36 (2001) 4575.

use super::follower::{Follower, Law};
use crate::effects::{Action, Effect, Fitting, Form, Kind, Parameter, Place, SignalStage, fits};

/// See the file's head.
pub const DRIVER_LAG: Effect = Effect {
    id: "driver-lag",
    kind: Kind::Driver,
    cause: "The source's resistance charges the actuator's capacitance.",
    equation: "b·T²·d²V_a/dt² + T·dV_a/dt + V_a = V_c,  T = R·C·(1 + g·|V_a|);  r·T where V_c > V_a",
    source: "Capacitance per area: data sheet of the MFC actuator; derived. Second order: Franklin, Powell, Emami-Naeini, Feedback Control of Dynamic Systems. Growth: Hall, J. Mater. Sci. 36 (2001) 4575.",
    parameters: &[
        Parameter {
            name: "time_constant_s",
            unit: "s",
            bounds: [0.0, 0.2],
            off: Some(0.0),
            default: None,
            about: "time constant T of small voltages",
        },
        Parameter {
            name: "inertia",
            unit: "",
            bounds: [0.0, 4.0],
            off: None,
            default: Some(0.0),
            about: "b: 0 is a resistance and a capacitance, ¼ two equal ones in a row; above ¼ the amplifier overshoots",
        },
        Parameter {
            name: "rising",
            unit: "",
            bounds: [0.05, 20.0],
            off: None,
            default: Some(1.0),
            about: "r: time constant of rising voltages over that of falling ones, of a source and a sink of different resistance",
        },
        Parameter {
            name: "growth_per_kv",
            unit: "1/kV",
            bounds: [0.0, 10.0],
            off: None,
            default: Some(0.0),
            about: "g: growth of the capacitance with the voltage",
        },
    ],
    places: &[Place::Drive],
    fitting: Fitting::Candidate {
        on: fits::any,
        variants: &[
            Form { fitted: &[("time_constant_s", 0.002), ("inertia", 0.2)], starts: &[&[0.001, 0.3], &[0.005, 0.3]], given: &[] },
            Form {
                fitted: &[("time_constant_s", 0.002), ("rising", 0.3)],
                starts: &[&[0.001, 2.0], &[0.001, 0.5], &[0.005, 2.0], &[0.005, 0.5]],
                given: &[],
            },
            Form {
                fitted: &[("time_constant_s", 0.002), ("growth_per_kv", 0.5)],
                starts: &[&[0.001, 0.5], &[0.005, 0.5]],
                given: &[],
            },
        ],
        forms: &[Form { fitted: &[("time_constant_s", 0.002)], starts: &[&[0.001], &[0.005]], given: &[] }],
    },
    shape: None,
    action: Action::Voltages(|p, n, _| {
        let lag = Lag { time: p[0], rising: p[2], growth: 1e-3 * p[3] };
        match p[1] {
            inertia if inertia > 0.0 => Box::new(SecondOrder { lag, inertia, state: vec![[0.0; 2]; n] }),
            _ => Box::new(Follower::new(lag, n)),
        }
    }),
};

/// The state is the voltage at the end of the last step; exact for voltages that are constant over a step, if T does not grow, otherwise of second order in it.
struct Lag {
    /// T of small voltages (s).
    time: f64,
    /// r.
    rising: f64,
    /// g (1/V).
    growth: f64,
}

impl Lag {
    /// T over that of falling small voltages, at a voltage that is `away` from the commanded one.
    fn ratio(&self, voltage: f64, away: f64) -> f64 {
        (if away < 0.0 { self.rising } else { 1.0 }) * (1.0 + self.growth * voltage.abs())
    }
}

impl Law for Lag {
    fn follow(&self, dt: f64, _since: f64, state: &mut [f64], volts: &mut [f64]) {
        // 1 − exp(−dt/T), and its mean over the step.
        let relaxed = |ratio: f64| {
            let time = ratio * self.time;
            let gone = -(-dt / time).exp_m1();
            [gone, gone * time / dt]
        };
        let (rising, falling) = (relaxed(self.rising), relaxed(1.0));
        for (state, volts) in state.iter_mut().zip(volts) {
            let away = *state - *volts;
            let mut part = if away < 0.0 { rising } else { falling };
            if self.growth != 0.0 {
                // T of the voltage in the middle of the step.
                let [gone, _] = relaxed(self.ratio(*state, away));
                part = relaxed(self.ratio(*state - 0.5 * gone * away, away));
            }
            let [gone, mean] = part;
            *state = *volts + away * (1.0 - gone);
            *volts += away * mean;
        }
    }
}

/// The state is the voltage and T of falling small voltages times its rate (V) at the end of the last step; exact for voltages that are constant over a step and not
/// crossed within it, if T does not grow, otherwise of first order in it.
struct SecondOrder {
    /// T, r and g.
    lag: Lag,
    /// b.
    inertia: f64,
    state: Vec<[f64; 2]>,
}

/// The exponential of the equation's matrix over a step, in units of T.
#[derive(Clone, Copy)]
struct Step {
    /// The step over T.
    length: f64,
    /// Half the decay's rate.
    m: f64,
    /// C and S of exp(A s) = C·1 + S·(A + m·1).
    cosine: f64,
    sine: f64,
}

impl Step {
    fn new(length: f64, b: f64) -> Self {
        // A = [0, 1; −1/b, −1/b] with the mean −m and the squared half distance q² of its eigenvalues.
        let m = 0.5 / b;
        let q2 = m * m - 1.0 / b;
        let q = q2.abs().sqrt();
        let s = length;
        let [cosine, sine] = if q * s < 1e-6 {
            [(-m * s).exp(), s * (-m * s).exp()]
        } else if q2 > 0.0 {
            let [slow, fast] = [((q - m) * s).exp(), ((-q - m) * s).exp()];
            [0.5 * (slow + fast), 0.5 * (slow - fast) / q]
        } else {
            [(-m * s).exp() * (q * s).cos(), (-m * s).exp() * (q * s).sin() / q]
        };
        Self { length, m, cosine, sine }
    }
}

impl SignalStage for SecondOrder {
    fn settle(&mut self, volts: &mut [f64]) {
        self.state.iter_mut().zip(volts).for_each(|(state, volts)| *state = [*volts, 0.0]);
    }

    fn pass(&mut self, dt: f64, volts: &mut [f64]) {
        let b = self.inertia;
        let length = dt / self.lag.time;
        let falling = Step::new(length, b);
        let rising = if self.lag.rising == 1.0 { falling } else { Step::new(length / self.lag.rising, b) };
        for ([voltage, rate], volts) in self.state.iter_mut().zip(volts) {
            let away = *voltage - *volts;
            let ratio = self.lag.ratio(*voltage, away);
            let step = match away < 0.0 {
                _ if self.lag.growth != 0.0 => Step::new(length / ratio, b),
                true => rising,
                false => falling,
            };
            let Step { length, m, cosine, sine } = step;
            let own = ratio * *rate;
            let next = [cosine * away + sine * (m * away + own), cosine * own - sine * (away / b + m * own)];
            // The integral of the equation over the step.
            let mean = -(b * (next[1] - own) + next[0] - away) / length;
            [*voltage, *rate] = [*volts + next[0], next[1] / ratio];
            *volts += mean;
        }
    }

    fn memory(&self) -> Vec<f64> {
        self.state.as_flattened().to_vec()
    }

    fn remember(&mut self, memory: &[f64]) {
        self.state.as_flattened_mut().copy_from_slice(memory);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn constant(time: f64, rising: f64) -> Lag {
        Lag { time, rising, growth: 0.0 }
    }

    #[test]
    fn a_capacitance_that_grows_charges_as_its_equation_says() {
        // From 0 towards u with T (1 + g v): t/T = −(1 + g u) ln(1 − v/u) − g v.
        let [time, growth, u] = [0.01, 1e-3, 800.0];
        let reached = |steps: u32| {
            let mut lag = Follower::new(Lag { growth, ..constant(time, 1.0) }, 1);
            (0..steps).for_each(|_| lag.pass(0.02 / f64::from(steps), &mut [u]));
            lag.state()[0]
        };
        let when = |v: f64| time * (-(1.0 + growth * u) * (-v / u).ln_1p() - growth * v);
        let [coarse, fine] = [20, 40].map(|steps| when(reached(steps)) - 0.02);
        assert!(coarse.abs() < 2e-5 && (3.0..5.0).contains(&(coarse / fine)), "{coarse:e} {fine:e}");
        // With little inertia the second order does the same.
        let mut second = SecondOrder { lag: Lag { growth, ..constant(time, 1.0) }, inertia: 1e-4, state: vec![[0.0; 2]] };
        (0..2_000).for_each(|_| second.pass(1e-5, &mut [u]));
        assert!((when(second.state[0][0]) - 0.02).abs() < 2e-5, "{}", when(second.state[0][0]));
    }

    #[test]
    fn two_equal_lags_in_a_row_are_an_inertia_of_a_quarter() {
        let mut second = SecondOrder { lag: constant(0.02, 1.0), inertia: 0.25, state: vec![[0.0; 2]] };
        let mut sum = 0.0;
        for _ in 0..25 {
            let mut volts = [100.0];
            second.pass(1e-3, &mut volts);
            sum += 1e-3 * volts[0];
        }
        // Of a step of u with two lags of T/2 each: u (1 − (1 + x) e^−x), x = 2 t/T.
        let x = 2.5_f64;
        assert!((second.state[0][0] - 100.0 * (1.0 - (1.0 + x) * (-x).exp())).abs() < 1e-9, "{:?}", second.state);
        let integral = 100.0 * 0.01 * (x - 2.0 + (2.0 + x) * (-x).exp());
        assert!((sum - integral).abs() < 1e-9, "{sum} {integral}");
    }

    #[test]
    fn an_amplifier_that_overshoots_does_so_by_its_damping_ratio() {
        // b T² = 1/ω², T = 2 ζ/ω: b = 1/(4 ζ²).
        let ratio = 0.5_f64;
        let mut second = SecondOrder { lag: constant(0.02, 1.0), inertia: 0.25 / (ratio * ratio), state: vec![[0.0; 2]] };
        let mut largest = 0.0_f64;
        for _ in 0..16_000 {
            second.pass(5e-5, &mut [100.0]);
            largest = largest.max(second.state[0][0]);
        }
        let overshoot = (-std::f64::consts::PI * ratio / (1.0 - ratio * ratio).sqrt()).exp();
        assert!((largest - 100.0 * (1.0 + overshoot)).abs() < 1e-3, "{largest}");
        assert!((second.state[0][0] - 100.0).abs() < 1e-3);
    }

    #[test]
    fn a_source_and_a_sink_may_differ() {
        let mut lag = Follower::new(constant(0.02, 0.5), 1);
        (0..25).for_each(|_| lag.pass(1e-3, &mut [100.0]));
        let risen = 100.0 * (1.0 - (-2.5_f64).exp());
        assert!((lag.state()[0] - risen).abs() < 1e-12);
        (0..25).for_each(|_| lag.pass(1e-3, &mut [0.0]));
        assert!((lag.state()[0] - risen * (-1.25_f64).exp()).abs() < 1e-12);
        let after = |time: f64, rising: f64, from: [f64; 2], to: f64| {
            let mut second = SecondOrder { lag: constant(time, rising), inertia: 0.2, state: vec![from] };
            (0..10).for_each(|_| second.pass(1e-3, &mut [to]));
            second.state[0]
        };
        let same = |a: [f64; 2], b: [f64; 2]| assert!((a[0] - b[0]).abs() + (a[1] - b[1]).abs() < 1e-9, "{a:?} {b:?}");
        // Towards 100 V as with half the time constant, of which the state's rate is a multiple; then down to −100 V as with the whole one.
        let risen = after(0.02, 0.5, [0.0; 2], 100.0);
        let [voltage, rate] = after(0.01, 1.0, [0.0; 2], 100.0);
        assert!(rate > 10.0, "{rate}");
        same(risen, [voltage, 2.0 * rate]);
        same(after(0.02, 0.5, risen, -100.0), after(0.02, 1.0, risen, -100.0));
    }

    #[test]
    fn a_step_response_is_the_exponential() {
        let mut lag = Follower::new(constant(0.01, 1.0), 1);
        for _ in 0..25 {
            lag.pass(1e-3, &mut [100.0]);
        }
        assert!((lag.state()[0] - 100.0 * (1.0 - (-2.5_f64).exp())).abs() < 1e-12);
    }
}
