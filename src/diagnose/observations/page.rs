//! The diagnosis of observations as one self-contained page.

use super::super::dataset::Dataset;
use super::super::diagnosis::Verdict;
use super::super::{names, report};
use super::{EXPLAINED, Found};
use crate::view::page::{Cell, Table, document};
use crate::view::{digits_for, escape, fixed, label_of, signed};

/// The page, laid out like the [`report`]: the verdict, every observation, and the explanations.
pub fn page(found: &Found, dataset: &Dataset, command: &str) -> String {
    let Found { diagnosis: d, numbers, explanations } = found;
    let mut out = report::heading(d);
    out.push_str(
        "<p class=\"small\">Single numbers allow no held-out set: they rule causes out and show which are tied, but identify none. σ is one standard \
         deviation.</p>\n<h2>The numbers</h2>\n",
    );
    let columns = ["number", "under", "#measured", "#± one σ", "#nominal model", "#off by (σ)"];
    let mut table = Table::new(&[&columns[..], &["#with the best below", "#off by (σ)"]].concat()).stacking();
    for number in numbers {
        let digits = digits_for(number.sigma);
        let off = |predicted: f64| (number.value - predicted) / number.sigma;
        let cell = |predicted: f64| Cell::from(signed(-off(predicted), 1)).bad_if(off(predicted).abs() > EXPLAINED.sqrt());
        table.row([
            label_of(&number.measure).into(),
            number.setting.as_str().into(),
            fixed(number.value, digits).into(),
            fixed(number.sigma, digits).into(),
            fixed(number.nominal, digits).into(),
            cell(number.nominal),
            fixed(number.best, digits).into(),
            cell(number.best),
        ]);
    }
    out.push_str(&table.html());
    out.push_str("<h2>Possible explanations</h2>\n");
    if explanations.is_empty() {
        out.push_str(match d.verdict {
            Verdict::None => "<p>None is needed: the nominal model explains the numbers.</p>\n",
            _ => "<p>No single cause and no two constants explain the numbers.</p>\n",
        });
    } else {
        let constants = names::constants(&dataset.robot);
        let mut table =
            Table::new(&["cause, form", "constant", "#value", "#95 % range", "unit", "remark", "#misfit (σ, rms)"]).stacking();
        for explanation in explanations {
            for effect in &explanation.effects {
                for estimate in &effect.parameters {
                    let shown = names::shown(&effect.id, estimate, &constants);
                    table.row([
                        names::with_form(&effect.id, &names::form_of(effect)).into(),
                        shown.name.into(),
                        shown.value.into(),
                        shown.range.into(),
                        shown.unit.into(),
                        Cell::from(shown.note).bad_if(estimate.at_bound),
                        fixed(explanation.misfit, 2).into(),
                    ]);
                }
            }
        }
        out.push_str(&table.html());
        let two = if explanations.iter().any(|explanation| explanation.effects.len() > 1) {
            " Two rows of one misfit belong together."
        } else {
            ""
        };
        out += &format!(
            "<p class=\"small\">Each of them explains the numbers alone; the numbers cannot tell which it is.{two}</p>\n"
        );
    }
    out.push_str("<h2>All causes tried, one at a time</h2>\n");
    let mut table = Table::new(&["cause, form", "#misfit (σ, rms)"]);
    for c in &d.candidates {
        table.row([names::with_form(&c.id, &c.form).into(), fixed(c.rmse_heldout_mm, 2).into()]);
    }
    out.push_str(&table.html());
    if let Some(next) = &d.next_experiment {
        out += &format!("<h2>What to measure next</h2>\n<p>To tell them apart: {}.</p>\n", report::prose(next));
    }
    out += &format!("<h2>How to reproduce</h2>\n<p><code>{}</code></p>\n", escape(command));
    document(&format!("Diagnosis of {}", d.dataset), &out)
}
