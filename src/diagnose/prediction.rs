//! How far a new run may be from a model that is not quite right: its noise, and what the model missed in the runs that judge it.
//!
//! A measured value of a run r is y = f + δ + ε, with the noise ε ~ N(0, σ²) and the discrepancy δ ~ N(0, δ_r²) of the model in that run (M. C. Kennedy
//! and A. O'Hagan, "Bayesian calibration of computer models", J. R. Stat. Soc. B 63 (2001) 425, with a discrepancy per run instead of a
//! function of the inputs). The δ_r² come from R runs, few as a rule; so the interval of a new run takes Student's quantile t of R degrees of freedom:
//!
//! ```text
//! δ_r² = max(0, ⟨(y − f)²⟩_r − σ_r²)        |y − f| ≤ √((1.96 σ)² + t² ⟨δ_r²⟩)        for 95 % of the values
//! ```

use super::diagnosis::Prediction;
use super::fit::student_95;

/// Mean squares of a run that judges a model.
pub(super) struct Missed {
    /// Of the residuals.
    pub(super) residual: f64,
    /// Of the noise.
    pub(super) noise: f64,
}

/// The 95 % interval of a value of a new run; none with fewer than two runs that judge.
pub(super) fn prediction(runs: &[Missed]) -> Option<Prediction> {
    let mean = |of: &dyn Fn(&Missed) -> f64| runs.iter().map(of).sum::<f64>() / runs.len() as f64;
    let noise = mean(&|run| run.noise);
    let discrepancy = mean(&|run| (run.residual - run.noise).max(0.0));
    (runs.len() >= 2).then(|| Prediction {
        half_width_mm: (1.96_f64.powi(2) * noise + student_95(runs.len()).powi(2) * discrepancy).sqrt(),
        noise_mm: noise.sqrt(),
        discrepancy_mm: discrepancy.sqrt(),
        runs: runs.len(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnose::random::Random;

    /// Values in a run.
    const VALUES: usize = 200;

    /// Residuals of a run with noise of 1 and a discrepancy of a standard deviation.
    fn run(random: &mut Random, discrepancy: f64) -> Vec<f64> {
        let shift = discrepancy * random.normal();
        (0..VALUES).map(|_| shift + random.normal()).collect()
    }

    fn missed(residuals: &[f64]) -> Missed {
        Missed { residual: residuals.iter().map(|r| r * r).sum::<f64>() / residuals.len() as f64, noise: 1.0 }
    }

    #[test]
    fn the_interval_holds_95_percent_of_new_runs_values() {
        let mut random = Random::new(1763);
        for (runs, discrepancy) in [(2, 1.0), (4, 0.5), (4, 3.0), (8, 1.0), (12, 0.0)] {
            let (mut inside, trials) = (0.0, 2000);
            for _ in 0..trials {
                let seen: Vec<Missed> = (0..runs).map(|_| missed(&run(&mut random, discrepancy))).collect();
                let half = prediction(&seen).unwrap().half_width_mm;
                let new = run(&mut random, discrepancy);
                inside += new.iter().filter(|r| r.abs() <= half).count() as f64 / VALUES as f64;
            }
            let share = inside / f64::from(trials);
            // Shares of 2000 runs have a standard error of at most 0.005; a clamp at 0 makes the intervals wider where there is no discrepancy.
            assert!((0.935..0.985).contains(&share), "{runs} runs, {discrepancy}: {share}");
        }
    }

    #[test]
    fn noise_alone_gives_1_96_standard_deviations_and_one_run_nothing() {
        let exact = || Missed { residual: 0.04, noise: 0.04 };
        let Prediction { half_width_mm, noise_mm, discrepancy_mm, runs } = prediction(&[exact(), exact()]).unwrap();
        assert!((half_width_mm - 0.392).abs() < 1e-12 && (noise_mm - 0.2).abs() < 1e-12);
        assert_eq!((discrepancy_mm, runs), (0.0, 2));
        assert_eq!(prediction(&[exact()]), None);
    }
}
