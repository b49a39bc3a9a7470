//! An identification as one self-contained page.

use super::Identification;
use super::results::told;
use crate::view::page::{Cell, Table, WHOLE, document, figure};
use crate::view::{Figure, Mark, digits_for, escape, fixed, label_of, signed};

/// The page: the result, constants, numbers, a curve over frequency for each measure, corners, and what to measure next.
pub fn page(found: &Identification, command: &str) -> String {
    let title = format!("Constants of {}", found.dataset);
    let mut out = format!("<h1>{}</h1>\n<p>{}</p>\n<h2>Constants</h2>\n", escape(&title), escape(&found.summary));
    let mut table = Table::new(&["constant", "#best", "#95 % from", "#to", "tied with (correlation)"]).stacking();
    for c in &found.constants {
        let tied = c.tied_with.iter().map(|(key, r)| format!("{key} ({})", signed(*r, 2))).collect::<Vec<_>>().join(", ");
        let end = |at: usize| match c.range95 {
            Some(range) => Cell::from(told(&c.key, range[at])).bad_if(c.at_bound[at]),
            None => "–".into(),
        };
        table.row([c.key.as_str().into(), told(&c.key, c.value).into(), end(0), end(1), tied.into()]);
    }
    for c in &found.listed {
        let possible = c.possible.iter().map(|value| told(&c.key, *value)).collect::<Vec<_>>().join(", ");
        table.row([c.key.as_str().into(), told(&c.key, c.value).into(), "possible:".into(), possible.into(), "".into()]);
    }
    out.push_str(&table.html());
    out.push_str(
        "<p class=\"small\">Ranges by the profile likelihood; marked ends are those of the search.</p>\n<h2>Numbers</h2>\n",
    );
    let columns = [
        "number",
        "under",
        "#Hz",
        "#measured",
        "#± one σ",
        "#predicted",
        "#± scatter",
        "#off by (σ)",
        "#confirmed, mean",
        "#± sd",
        "#off by (σ)",
        "#the others foretell",
        "#off by (σ)",
        "#decides (×)",
    ];
    let mut table = Table::new(&columns).stacking();
    for fact in &found.facts {
        let digits = digits_for(fact.sigma);
        let off = |off: f64| Cell::from(signed(off, 1)).bad_if(off.abs() > 3.0);
        let role = if fact.is_fitted { "" } else { ", foretold" };
        let others = fact.from_others;
        table.row([
            label_of(&fact.measure).into(),
            format!("{}{role}", fact.setting).into(),
            fact.frequency_hz.map_or_else(String::new, |f| fixed(f, 1)).into(),
            fixed(fact.value, digits).into(),
            fixed(fact.sigma, digits).into(),
            fixed(fact.predicted, digits).into(),
            fixed(fact.scatter, digits).into(),
            off(fact.off_sigma),
            fact.confirmed.map_or_else(String::new, |[mean, ..]| fixed(mean, digits)).into(),
            fact.confirmed.map_or_else(String::new, |[_, sd, _]| fixed(sd, digits)).into(),
            fact.confirmed.map_or_else(|| "".into(), |[.., z]| off(z)),
            others.map_or_else(String::new, |[value, sd, _]| format!("{} ± {}", fixed(value, digits), fixed(sd, digits))).into(),
            others.map_or_else(|| "".into(), |[.., z]| off(z)),
            fixed(fact.decides, 2).into(),
        ]);
    }
    out.push_str(&table.html());
    out.push_str(
        "<p class=\"small\">Scatter is that of the motion, which small changes of the constants do not repeat. Confirmed values are of an ensemble of runs. “Decides” is the factor by which the ranges \
         widen without the number.</p>\n",
    );
    out.push_str(&curves(found));
    if !found.corners.is_empty() {
        out.push_str("<h2>Corners</h2>\n");
        let mut table = Table::new(&["at the", "constants"]);
        for corner in &found.corners {
            let values = corner.values.iter().map(|(key, value)| format!("{key} = {}", told(key, *value))).collect::<Vec<_>>();
            table.row([corner.of.as_str().into(), values.join(", ").into()]);
        }
        out.push_str(&table.html());
    }
    if !found.next.is_empty() {
        out.push_str("<h2>What to measure next</h2>\n");
        let mut table = Table::new(&["measure", "#at (Hz)", "#uncertain by", "#scatter"]);
        for p in found.next.iter().take(5) {
            let digits = digits_for(p.scatter);
            table.row([
                label_of(&p.measure).into(),
                fixed(p.frequency_hz, 0).into(),
                fixed(p.uncertain_by, digits).into(),
                fixed(p.scatter, digits).into(),
            ]);
        }
        out.push_str(&table.html());
        out.push_str(
            "<p class=\"small\">Where the likely constants differ most, over what motion and measurement scatter.</p>\n",
        );
    }
    for remark in &found.remarks {
        out += &format!("<p>{}</p>\n", escape(remark));
    }
    out += &format!("<h2>How to reproduce</h2>\n<p><code>{}</code></p>\n", escape(command));
    document(&title, &out)
}

/// For each measure with three frequencies or more a figure of measured and predicted values.
fn curves(found: &Identification) -> String {
    let mut measures: Vec<&str> = found.facts.iter().map(|fact| fact.measure.as_str()).collect();
    measures.sort_unstable();
    measures.dedup();
    let mut out = String::new();
    for measure in measures {
        let mut points: Vec<(f64, &super::Fact)> = found
            .facts
            .iter()
            .filter(|fact| fact.measure == measure)
            .filter_map(|fact| Some((fact.frequency_hz?, fact)))
            .collect();
        if points.len() < 3 {
            continue;
        }
        points.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut plot = Figure::new(&label_of(measure), "frequency (Hz)", &label_of(measure));
        plot.size(WHOLE);
        plot.band(
            points.iter().map(|(f, fact)| (*f, fact.predicted - 1.96 * fact.scatter, fact.predicted + 1.96 * fact.scatter)),
        );
        plot.series("predicted, 95 %", points.iter().map(|(f, fact)| (*f, fact.predicted)), Mark::Line);
        let of = |is_fitted: bool| {
            points.iter().filter(move |(_, fact)| fact.is_fitted == is_fitted).map(|(f, fact)| (*f, fact.value))
        };
        plot.series("measured", of(true), Mark::Points);
        if of(false).next().is_some() {
            plot.series("measured, foretold", of(false), Mark::Points);
        }
        let caption = "Predictions with the best constants; the band holds 95 % of the scatter of the motion.";
        out.push_str(&figure(measure, "", &plot.svg(), caption));
    }
    out
}
