//! The diagnosis as one self-contained page: the verdict first, then its evidence.

use std::fmt::Write;

use super::diagnosis::{Diagnosis, JudgedBy, Part, Stage, Verdict};
use super::fit::sum_of_squares;
use super::names;
use super::picture;
use super::pipeline::Outcome;
use super::plant::{Plant, Signal};
use super::residual_tests::{ResidualTest, rows_by_channel, sum_over};
use super::summary::failing;
use crate::view::page::{Cell, HALF, Table, document, figure};
use crate::view::{Figure, Mark, digits_for, escape, fixed, minus, signed, significant};

/// Runs that are drawn, and most rows of each.
const RUNS: usize = 3;
const ROWS: usize = 700;
/// Most candidates in the table.
const CANDIDATES: usize = 12;
/// Least root mean square residual of a run (σ) that is marked.
const LARGE: f64 = 1.2;

/// The report's inputs other than the outcome.
pub struct Context<'a> {
    /// The plant.
    pub plant: &'a dyn Plant,
    /// Constants of the nominal model that are shown in their own units: id, value, unit, as of [`names::constants`]; none for plants other than robots.
    pub constants: &'a [(&'static str, f64, &'static str)],
    /// The command that reproduces the report.
    pub command: &'a str,
    /// The extended experiment (TOML); none for plants other than robots.
    pub extended: Option<&'a str>,
}

/// A text of the diagnosis as HTML.
pub(super) fn prose(text: &str) -> String {
    escape(&minus(text))
}

/// Title and verdict.
pub(super) fn heading(d: &Diagnosis) -> String {
    let fails = failing(&d.extended.residual_tests).is_some();
    let verdict = match (d.verdict, fails) {
        (Verdict::None, false) => "Nothing missing",
        (Verdict::None, true) => "Nothing named, but tests fail",
        (Verdict::Named, false) => "Named",
        (Verdict::Named, true) => "Named, but tests fail",
        (Verdict::Located, false) => "Located",
        (Verdict::Located, true) => "Located, but tests fail",
        (Verdict::Tied, false) => "Tied",
        (Verdict::Tied, true) => "Tied, and tests fail",
        (Verdict::Unexplained, _) => "Unexplained",
    };
    format!(
        "<h1>Diagnosis of {}</h1>\n<p class=\"verdict\"><strong>{verdict}.</strong> {}</p>\n",
        escape(&d.dataset),
        prose(&d.summary)
    )
}

/// The page (HTML).
pub fn page(outcome: &Outcome, context: &Context) -> String {
    let d = &outcome.diagnosis;
    let unit = context.plant.unit();
    let mut out = heading(d);
    let _ = writeln!(
        out,
        "<p class=\"small\">Noise {} {unit}; of the misfit above it {} % is left. Models were fitted to {} runs, causes were selected on {} \
         others, and the result is judged {}.</p>",
        significant(d.noise_mm, 3),
        fixed(100.0 * d.unexplained_fraction, 1),
        outcome.split.fit.len(),
        outcome.split.select.len(),
        match d.judged_by {
            Some(JudgedBy::JudgeRuns) => format!("on {} that neither saw", outcome.split.judge.len()),
            _ => "by nested cross-validation".into(),
        }
    );
    for line in &d.unexplained {
        let _ = writeln!(out, "<p class=\"bad\">What is left: {}</p>", prose(line));
    }
    curves(&mut out, d);
    gain(&mut out, d, unit);
    let mut order = outcome.split.all();
    let chi2 = |run: &usize| sum_of_squares(&outcome.calibrated.residuals[*run]);
    order.sort_by(|a, b| chi2(b).total_cmp(&chi2(a)));
    order.truncate(RUNS);
    let channels: Vec<usize> = order.iter().map(|run| largest_channel(outcome, context.plant, *run)).collect();
    out.push_str("<h2>Measured and simulated, before and after</h2>\n");
    for (index, (run, &channel)) in order.iter().zip(&channels).enumerate() {
        let signal = &context.plant.signals()[*run];
        let name = context.plant.channels().get(channel).cloned().unwrap_or_default();
        motion(&mut out, outcome, *run, signal, channel, &format!("{} ({unit})", name.replace('_', " ")), index);
    }
    out.push_str("<h2>Residuals, before and after</h2>\n");
    for (index, (run, &channel)) in order.iter().zip(&channels).enumerate() {
        let signal = &context.plant.signals()[*run];
        residuals(&mut out, outcome, *run, signal, channel, index);
    }
    ranking(&mut out, d, unit);
    parameters(&mut out, outcome, context);
    bench(&mut out, d);
    tests(&mut out, d);
    out.push_str("<h2>Data quality</h2>\n");
    list(&mut out, &d.data_quality, "Nothing was noticed.");
    if !d.remarks.is_empty() {
        out.push_str("<h3>Remarks on the analysis</h3>\n");
        list(&mut out, &d.remarks, "");
    }
    out.push_str("<h2>What to measure next</h2>\n");
    let next = d.next_experiment.as_deref().unwrap_or(match d.verdict {
        Verdict::Unexplained => "Repeat the worst runs first: what does not repeat is not the model's.",
        _ => "Nothing is tied: a run at an amplitude and a frequency that no run has yet would test the extended model best.",
    });
    let _ = writeln!(out, "<p>{}</p>", prose(next));
    let _ = write!(out, "<h2>How to reproduce</h2>\n<p><code>{}</code></p>", escape(context.command));
    if let Some(extended) = context.extended {
        let _ = write!(
            out,
            "<p>The extended model, <code>extended.toml</code>; run it with <code>sfers run extended.toml</code>:</p><pre>{}</pre>",
            extended.lines().map(escape).collect::<Vec<_>>().join("\n")
        );
    }
    out.push('\n');
    document(&format!("Diagnosis of {}", d.dataset), &out)
}

/// The curves of free forms with their bands, and the nearest names.
fn curves(out: &mut String, d: &Diagnosis) {
    for (index, effect) in d.effects.iter().enumerate() {
        let Some(curve) = &effect.curve else { continue };
        let label = |name: &str, unit: &str| if unit.is_empty() { name.to_owned() } else { format!("{name} ({unit})") };
        let mut f =
            Figure::new(&names::cause(&effect.id), &label(&curve.x_name, &curve.x_unit), &label(&curve.y_name, &curve.y_unit));
        f.horizontal(0.0).size(HALF);
        let along = |y: &dyn Fn(usize) -> f64| -> Vec<(f64, f64)> { (0..curve.x.len()).map(|k| (curve.x[k], y(k))).collect() };
        f.series("estimate", along(&|k| curve.y[k]), Mark::Line);
        f.series("95 % band", along(&|k| curve.ci95[k][0]), Mark::Line);
        f.series("", along(&|k| curve.ci95[k][1]), Mark::Line);
        out.push_str("<h2>The law that is missing, as a curve</h2>\n");
        out.push_str(&figure(&format!("curve-{index}"), "", &f.svg(), ""));
        if effect.nearest.is_empty() {
            continue;
        }
        let mut table = Table::new(&["named law of the same place", "#leaves of what the curve takes (%)"]);
        for near in &effect.nearest {
            table.row([names::cause(&near.id).into(), fixed(100.0 * near.left, 1).into()]);
        }
        out.push_str(&table.html());
    }
}

fn gain(out: &mut String, d: &Diagnosis, unit: &str) {
    let digits = digits_for(d.noise_mm.max(1e-5)) + 1;
    out.push_str("<h2>The gain, on runs that neither fit nor selection saw</h2>\n");
    let error = format!("#held-out error ({unit})");
    let mut table = Table::new(&["model", &error, "#95 % range", &format!("#all runs ({unit})")]);
    for (name, stage) in [("nominal", &d.baseline), ("re-tuned constants", &d.calibrated), ("extended", &d.extended)] {
        let [low, high] = stage.rmse_heldout_ci95_mm;
        table.row([
            name.into(),
            fixed(stage.rmse_heldout_mm, digits).into(),
            format!("{} to {}", fixed(low, digits), fixed(high, digits)).into(),
            fixed(stage.rmse_mm, digits).into(),
        ]);
    }
    out.push_str(&table.html());
    if let Some(p) = &d.prediction {
        let _ = writeln!(
            out,
            "<p>95 % of the values of a new run like the {} that judge are expected within ±{} {unit} of the extended model: noise of {} {unit}, and \
             {} {unit} (rms) that the model missed in these runs beyond it.</p>",
            p.runs,
            significant(p.half_width_mm, 2),
            significant(p.noise_mm, 2),
            significant(p.discrepancy_mm, 2),
        );
    }
    let columns = ["nominal", "re-tuned", "extended"].map(|model| format!("#{model} ({unit})"));
    let [nominal, tuned, extended] = columns.each_ref().map(String::as_str);
    let mut table = Table::new(&["run", "role", nominal, tuned, extended, "#extended / noise"]);
    for ((nominal, tuned), extended) in d.baseline.runs.iter().zip(&d.calibrated.runs).zip(&d.extended.runs) {
        table.row([
            nominal.id.as_str().into(),
            nominal.role.into(),
            fixed(nominal.rmse_mm, digits).into(),
            fixed(tuned.rmse_mm, digits).into(),
            fixed(extended.rmse_mm, digits).into(),
            Cell::from(fixed(extended.rmse_sigma, 2)).bad_if(extended.rmse_sigma > LARGE),
        ]);
    }
    out.push_str(&table.html());
}

/// The channel of a run with the largest residuals of the nominal model.
fn largest_channel(outcome: &Outcome, plant: &dyn Plant, run: usize) -> usize {
    let rows = rows_by_channel(&plant.signals()[run], &outcome.used[run]);
    let chi2 = |channel: usize| sum_over(&outcome.nominal.residuals[run], &rows[channel]);
    (0..rows.len()).max_by(|a, b| chi2(*a).total_cmp(&chi2(*b))).unwrap_or(0)
}

/// Rows of a channel, at most [`ROWS`].
fn rows(signal: &Signal, channel: usize) -> Vec<usize> {
    let rows: Vec<usize> = (0..signal.values.len()).filter(|i| signal.channels[*i] == channel).collect();
    let every = rows.len().div_ceil(ROWS).max(1);
    rows.into_iter().step_by(every).collect()
}

fn motion(out: &mut String, outcome: &Outcome, run: usize, signal: &Signal, channel: usize, label: &str, index: usize) {
    let rows = rows(signal, channel);
    out.push_str("<div class=\"pair\">\n");
    for (kind, residuals) in [("nominal", &outcome.nominal.plain[run]), ("extended", &outcome.extended.plain[run])] {
        let mut f = Figure::new(&format!("{}: {kind} model", signal.id), "time (s)", label);
        f.size(HALF);
        let used = |i: &&usize| outcome.used[run][**i];
        f.series("measured", rows.iter().filter(used).map(|i| (signal.times[*i], signal.values[*i])), Mark::Line);
        let simulated =
            rows.iter().filter(used).map(|i| (signal.times[*i], signal.values[*i] - residuals[*i] * signal.sigmas[*i]));
        f.series(&format!("{kind} model"), simulated, Mark::Line);
        out.push_str(&figure(&format!("motion-{kind}-{index}"), "", &f.svg(), ""));
    }
    out.push_str("</div>\n");
}

fn residuals(out: &mut String, outcome: &Outcome, run: usize, signal: &Signal, channel: usize, index: usize) {
    let rows = rows(signal, channel);
    out.push_str("<div class=\"pair\">\n");
    for (kind, residuals) in [("re-tuned", &outcome.calibrated.residuals[run]), ("extended", &outcome.extended.residuals[run])] {
        let mut f = Figure::new(&format!("{}: {kind} model", signal.id), "time (s)", "residual / noise");
        f.horizontal(0.0).size(HALF);
        let used = rows.iter().filter(|i| outcome.used[run][**i]);
        f.series("", used.map(|i| (signal.times[*i], residuals[*i])), Mark::Line);
        out.push_str(&figure(&format!("residual-{kind}-{index}"), "", &f.svg(), ""));
    }
    out.push_str("</div>\n");
}

fn ranking(out: &mut String, d: &Diagnosis, unit: &str) {
    out.push_str("<h2>Candidates, on top of re-tuned constants</h2>\n");
    if d.candidates.is_empty() {
        out.push_str("<p>None was tried.</p>\n");
        return;
    }
    let mut table = Table::new(&["cause, form", &format!("#held-out error ({unit})"), "#change of BIC"]);
    for c in d.candidates.iter().take(CANDIDATES) {
        table.row([names::with_form(&c.id, &c.form).into(), fixed(c.rmse_heldout_mm, 4).into(), signed(c.delta_bic, 0).into()]);
    }
    out.push_str(&table.html());
    out.push_str(
        "<p class=\"small\">Those that a linear estimate puts first; the others would do less. A lower BIC (Bayes's information criterion) is \
         better. Forms of one cause exclude one another.</p>\n",
    );
}

fn parameters(out: &mut String, outcome: &Outcome, context: &Context) {
    let d = &outcome.diagnosis;
    out.push_str("<h2>Parameters</h2>\n");
    let columns = ["#value", "#95 % range", "unit", "remark"];
    if d.effects.is_empty() {
        out.push_str("<p>Nothing was added to the nominal model.</p>\n");
    } else {
        let mut table = Table::new(&["cause, form", "constant", columns[0], columns[1], columns[2], columns[3]]).stacking();
        for effect in &d.effects {
            for estimate in &effect.parameters {
                let shown = names::shown(&effect.id, estimate, context.constants);
                let cause = names::with_form(&effect.id, &names::form_of(effect));
                let note = Cell::from(shown.note).bad_if(estimate.at_bound);
                table.row([cause.into(), shown.name.into(), shown.value.into(), shown.range.into(), shown.unit.into(), note]);
            }
        }
        out.push_str(&table.html());
    }
    for effect in &d.effects {
        let others: Vec<String> = effect.tied_with.iter().map(|id| names::cause(id)).collect();
        let tied = if others.is_empty() { String::new() } else { format!(" Tied with {}.", others.join(", ")) };
        let _ = writeln!(
            out,
            "<p class=\"small\"><strong>{}</strong> ({}{}{}; <code>id = \"{}\"</code> in files): {} It takes {} % of the misfit, and removes {} % of \
             the held-out error above the noise.{tied}</p>",
            escape(&names::cause(&effect.id)),
            effect.kind,
            if effect.role == Part::Minor { "; minor" } else { "" },
            effect
                .stability
                .map_or_else(String::new, |share| format!("; chosen in {:.0} % of resamples over runs", 100.0 * share)),
            effect.id,
            prose(&effect.cause),
            fixed(100.0 * effect.share, 1),
            fixed(100.0 * effect.gain_heldout, 1)
        );
    }
    out.push_str("<h3>Constants of the nominal model, re-tuned alone</h3>\n");
    // Estimates are in the order of the model's terms.
    let terms = &outcome.calibrated.model().terms;
    let ids = terms.iter().flat_map(|term| {
        let candidate = &context.plant.candidates()[term.candidate];
        candidate.parameters.iter().map(|_| candidate.id)
    });
    let mut table = Table::new(&["constant", columns[0], columns[1], columns[2], columns[3]]).stacking();
    for (id, estimate) in ids.zip(&d.calibrated.parameters) {
        let shown = names::shown(id, estimate, context.constants);
        let name = if shown.name == names::cause(id) { shown.name } else { format!("{}, {}", names::cause(id), shown.name) };
        let note = Cell::from(shown.note).bad_if(estimate.at_bound);
        table.row([name.into(), shown.value.into(), shown.range.into(), shown.unit.into(), note]);
    }
    if d.calibrated.parameters.is_empty() {
        out.push_str("<p>None had to be.</p>\n");
    } else {
        out.push_str(&table.html());
    }
    for c in &d.correlations {
        let words = |name: &String| {
            name.split_once(' ').map_or_else(
                || name.clone(),
                |(id, name)| {
                    let (cause, number) = (names::cause(id), names::parameter(id, name));
                    if cause == number { cause } else { format!("{cause}: {number}") }
                },
            )
        };
        let [a, b] = c.between.each_ref().map(words);
        let _ = writeln!(
            out,
            "<p class=\"bad\">{} and {} are correlated by {}: the data hardly tell them apart.</p>",
            escape(&a),
            escape(&b),
            fixed(c.coefficient, 3)
        );
    }
    for combination in &d.combinations {
        let words = combination.words();
        let _ = writeln!(out, "<p>{}{}.</p>", escape(&words[..1].to_uppercase()), escape(&words[1..]));
    }
    let _ = writeln!(
        out,
        "<p class=\"small\">Condition of the fit, the ratio of the largest to the smallest eigenvalue of its scaled information: {}.</p>",
        significant(d.condition, 2)
    );
}

fn tests(out: &mut String, d: &Diagnosis) {
    out.push_str("<h2>Tests of the residuals</h2>\n");
    let failed = |stage: &Stage| stage.residual_tests.iter().filter(|test| !test.passed).count();
    let all = d.baseline.residual_tests.len();
    if all == 0 {
        out.push_str("<p>There are too few values for any.</p>\n");
        return;
    }
    let _ = writeln!(
        out,
        "<p>{} of {all} fail for the nominal model, {} with re-tuned constants, {} for the extended one; noise alone would fail about {}.</p>",
        failed(&d.baseline),
        failed(&d.calibrated),
        failed(&d.extended),
        significant(1e-3 * all as f64, 1)
    );
    let models = [("nominal", &d.baseline), ("re-tuned", &d.calibrated), ("extended", &d.extended)];
    let picture = picture::residual_tests(&models.map(|(name, stage)| (name, stage.residual_tests.as_slice())));
    let caption = "A row for each run, a column for each test; crossed where the residuals are not noise. Size: chi-square per value. Neighbours, input, \
                   input's rate: correlation with them. The others are named in full below.";
    out.push_str(&figure("tests", "wide", &picture, caption));
    let mut table =
        Table::new(&["run", "test", "#nominal", "#re-tuned", "#extended", "#limit", "what it means, before and after"]);
    for ((a, b), c) in d.baseline.residual_tests.iter().zip(&d.calibrated.residual_tests).zip(&d.extended.residual_tests) {
        let cell = |test: &ResidualTest| Cell::from(fixed(test.statistic, 3)).bad_if(!test.passed);
        let meaning = if a.meaning == c.meaning { a.meaning.clone() } else { format!("{}; then {}", a.meaning, c.meaning) };
        table.row([
            a.run.as_str().into(),
            a.name.as_str().into(),
            cell(a),
            cell(b),
            cell(c),
            fixed(a.limit, 3).into(),
            meaning.into(),
        ]);
    }
    let _ = writeln!(out, "<details><summary>All statistics</summary>\n{}</details>", table.html());
}

fn bench(out: &mut String, d: &Diagnosis) {
    if d.bench.faults.is_empty() {
        return;
    }
    out.push_str("<h2>Faults of the bench, run by run</h2>\n");
    let mut table = Table::new(&["fault", "run", "channel", "#value", "#standard deviation", "unit"]);
    for fault in &d.bench.faults {
        for run in &fault.runs {
            table.row([
                fault.id.into(),
                run.run.as_str().into(),
                run.channel.as_deref().unwrap_or("all").replace('_', " ").into(),
                significant(run.value, 3).into(),
                significant(run.sd, 2).into(),
                fault.unit.as_str().into(),
            ]);
        }
    }
    let _ = writeln!(
        out,
        "<p>They are nuisance parameters with a normal prior and no causes. {}.</p><details><summary>All values</summary>\n{}</details>",
        d.bench
            .faults
            .iter()
            .map(|fault| {
                let unit = if fault.unit.is_empty() { String::new() } else { format!(" {}", fault.unit) };
                let by = if fault.given { "given" } else { "estimated" };
                format!("Standard deviation between runs of the {}: {}{unit} ({by})", fault.id, significant(fault.spread, 2))
            })
            .collect::<Vec<_>>()
            .join("; "),
        table.html()
    );
}

fn list(out: &mut String, lines: &[String], none: &str) {
    if lines.is_empty() {
        let _ = writeln!(out, "<p>{none}</p>");
        return;
    }
    out.push_str("<ul>");
    for line in lines {
        let _ = write!(out, "<li>{}</li>", prose(line));
    }
    out.push_str("</ul>\n");
}
