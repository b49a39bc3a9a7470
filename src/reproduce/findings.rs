//! What a study found: comparisons with published values, a figure and its caption.

use serde::Serialize;

use super::Effort;
use crate::view::{Figure, Mark, fixed, signed};

/// Colour of lines for published values.
const PUBLISHED: &str = "#777777";

/// A published result and ours.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize)]
pub struct Comparison {
    /// Name of the quantity.
    pub quantity: String,
    /// The published value and its origin; empty if none was published.
    pub published: String,
    /// The value simulated here, on the planar engine.
    pub ours: String,
    /// Difference of ours from the published value.
    pub difference: String,
    /// Spot check: the value on Bullet and the planar engine's difference from it; empty if none was made.
    pub bullet: String,
    /// Explanation of the difference, or what the paper does not specify.
    pub explanation: String,
}

/// Origin of a published value.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Origin {
    /// Measured in an experiment.
    Measured,
    /// Computed by the authors' simulation.
    Simulated,
}

/// A published value in a study's figure, in the units of its axes.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Published {
    /// Name in the legend.
    pub label: String,
    /// Measured or simulated.
    pub origin: Origin,
    /// x; absent for a value of y alone, drawn as a horizontal line.
    pub x: Option<f64>,
    /// y; absent for a value of x alone, drawn as a vertical line.
    pub y: Option<f64>,
    /// Half-width of the error bar of y, if the source gives one.
    pub plus_minus: Option<f64>,
}

/// The results of a study.
#[derive(Debug, Clone, Default)]
pub struct Findings {
    /// Rows of the table.
    pub comparisons: Vec<Comparison>,
    /// Published values in the figure.
    pub published: Vec<Published>,
    /// Engines and their time steps, in words.
    pub engines: String,
    /// The figure, as SVG.
    pub figure: String,
    /// Caption of the figure.
    pub caption: String,
}

impl Findings {
    /// Adds a comparison, without a value on Bullet.
    pub(super) fn compare(
        &mut self,
        quantity: &str,
        published: &str,
        ours: impl Into<String>,
        difference: impl Into<String>,
        explanation: &str,
    ) {
        self.comparisons.push(Comparison {
            quantity: quantity.into(),
            published: published.into(),
            ours: ours.into(),
            difference: difference.into(),
            bullet: String::new(),
            explanation: explanation.into(),
        });
    }

    /// Adds the spot check of the last comparison: its value on the planar engine and on Bullet.
    pub(super) fn check_on_bullet(&mut self, unit: &str, planar: f64, bullet: f64) {
        let Some(last) = self.comparisons.last_mut() else { return };
        let (digits, unit) = match unit {
            "" | "°" => (0, unit.to_owned()),
            _ => (2, format!(" {unit}")),
        };
        last.bullet = match (bullet.is_finite(), planar.is_finite()) {
            (true, true) => format!("{}{unit} (planar {})", fixed(bullet, digits), signed(planar - bullet, digits)),
            (true, false) => format!("{}{unit}", fixed(bullet, digits)),
            (false, _) => "none: its contact makes energy, or it limits a velocity".into(),
        };
    }

    /// Lists the frequencies (Hz) of a scan that gave no result.
    pub(super) fn without_result(&mut self, points: &[(f64, f64)]) {
        let lost: Vec<String> = points.iter().filter(|p| !p.1.is_finite()).map(|p| format!("{}", p.0)).collect();
        if !lost.is_empty() {
            self.compare("frequencies without a result", "", format!("{} Hz", lost.join(", ")), "", "The rows on disk say why.");
        }
    }

    /// Draws published points with their error bars.
    pub(super) fn publish(
        &mut self,
        figure: &mut Figure,
        label: &str,
        origin: Origin,
        points: &[(f64, f64)],
        plus_minus: Option<f64>,
    ) {
        figure.series(label, points.iter().copied(), Mark::Points);
        for &(x, y) in points {
            if let Some(spread) = plus_minus {
                figure.line("", [(x, y - spread), (x, y + spread)], PUBLISHED, 1.0);
            }
            self.published.push(Published { label: label.into(), origin, x: Some(x), y: Some(y), plus_minus });
        }
    }

    /// Draws published values of y as horizontal lines between two x.
    pub(super) fn publish_across(
        &mut self,
        figure: &mut Figure,
        label: &str,
        origin: Origin,
        values: &[f64],
        [from, to]: [f64; 2],
    ) {
        for (index, &y) in values.iter().enumerate() {
            figure.line(if index == 0 { label } else { "" }, [(from, y), (to, y)], PUBLISHED, 1.0);
            self.published.push(Published { label: label.into(), origin, x: None, y: Some(y), plus_minus: None });
        }
    }

    /// Draws a published value of x as a vertical line between two y.
    pub(super) fn publish_up(&mut self, figure: &mut Figure, label: &str, origin: Origin, x: f64, [from, to]: [f64; 2]) {
        figure.line("", [(x, from), (x, to)], PUBLISHED, 1.0).note(x, to, label);
        self.published.push(Published { label: label.into(), origin, x: Some(x), y: None, plus_minus: None });
    }

    /// Sets the engines: planar with adaptive steps, Bullet with a time step (s).
    pub(super) fn done_on(&mut self, effort: Effort, bullet: f64) {
        let micros = 1e6 * bullet;
        let digits = if (micros - micros.round()).abs() < 1e-6 { 0 } else { 2 };
        self.engines = format!(
            "Ours: planar engine, steps that adapt to {} % of the result. Spot checks: Bullet, time step {} µs.",
            100.0 * effort.step_error(),
            fixed(micros, digits)
        );
    }
}
