//! The diagnosis as one self-contained page, read from the verdict down.

use std::fmt::Write;

use super::diagnosis::{Diagnosis, Estimate, Stage, Verdict};
use super::fit::Residuals;
use super::plant::{Plant, Signal};
use super::verdict::Outcome;
use crate::view::{Figure, Mark, escape};

const STYLE: &str = "body{font:15px/1.5 Helvetica,Arial,sans-serif;color:#111;max-width:1020px;margin:0 auto;padding:18px}\
h1{font-size:21px}h2{font-size:17px;margin:34px 0 6px}.verdict{font-size:19px;border-left:6px solid #0072b2;padding:8px 14px;background:#f3f7fa}\
table{border-collapse:collapse;font-size:13.5px;margin:8px 0;min-width:60%}th,td{text-align:left;padding:4px 14px 4px 0;border-bottom:1px solid #ddd;\
vertical-align:top}th{border-bottom:2px solid #111}td.n{text-align:right;font-variant-numeric:tabular-nums}figure{margin:10px 0;display:inline-block;\
width:49%;min-width:420px}figure svg{width:100%}figcaption,.small{color:#444;font-size:13px}.bad{color:#b33c00}code,pre{background:#f4f4f4;\
font-size:13px}pre{padding:10px;overflow:auto}";
/// Runs that are drawn, and rows of each at most.
const RUNS: usize = 3;
const ROWS: usize = 700;
/// Candidates that are listed.
const CANDIDATES: usize = 12;

/// What a report needs beside the outcome.
pub struct Context<'a> {
    /// The plant.
    pub plant: &'a dyn Plant,
    /// The command that makes it again.
    pub command: &'a str,
    /// The extended experiment, as text.
    pub extended: &'a str,
}

/// The page.
pub fn page(outcome: &Outcome, context: &Context) -> String {
    let d = &outcome.diagnosis;
    let unit = context.plant.unit();
    let mut out = format!(
        "<!doctype html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"><title>Diagnosis of {0}</title><style>{STYLE}</style></head><body>\n\
         <h1>Diagnosis of {0}</h1>\n<p class=\"verdict\"><strong>{1}.</strong> {2}</p>\n",
        escape(&d.dataset),
        match d.verdict {
            Verdict::None => "Nothing missing",
            Verdict::Named => "Named",
            Verdict::Tied => "Tied",
            Verdict::Unexplained => "Unexplained",
        },
        escape(&d.summary)
    );
    let _ = writeln!(
        out,
        "<p class=\"small\">Noise {:.3} {unit}; of the misfit above it {:.1} % is left. Models were fitted to {} runs and judged on {} others.</p>",
        d.noise_mm,
        100.0 * d.unexplained_fraction,
        outcome.split.fit.len(),
        outcome.split.held.len()
    );
    for line in &d.unexplained {
        let _ = writeln!(out, "<p class=\"bad\">What is left: {}</p>", escape(line));
    }
    gain(&mut out, d, unit);
    let mut order = outcome.split.all();
    let square = |residuals: &[Residuals], run: usize| residuals[run].iter().map(|r| r * r).sum::<f64>();
    order.sort_by(|a, b| square(&outcome.calibrated.residuals, *b).total_cmp(&square(&outcome.calibrated.residuals, *a)));
    order.truncate(RUNS);
    out.push_str("<h2>Measured and simulated, before and after</h2>\n");
    for (index, run) in order.iter().enumerate() {
        let signal = &context.plant.signals()[*run];
        let channel = loudest(signal, &outcome.nominal.residuals[*run]);
        let name = context.plant.channels().get(channel).cloned().unwrap_or_default();
        motion(&mut out, outcome, *run, signal, channel, &format!("{name} ({unit})"), index);
    }
    out.push_str("<h2>Residuals, before and after</h2>\n");
    for (index, run) in order.iter().enumerate() {
        let signal = &context.plant.signals()[*run];
        let channel = loudest(signal, &outcome.nominal.residuals[*run]);
        residuals(&mut out, outcome, *run, signal, channel, index);
    }
    ranking(&mut out, d, unit);
    parameters(&mut out, d);
    tests(&mut out, d);
    out.push_str("<h2>Data quality</h2>\n");
    list(&mut out, &d.data_quality, "Nothing was noticed.");
    list(&mut out, &d.remarks, "");
    out.push_str("<h2>What to measure next</h2>\n");
    let next = d.next_experiment.as_deref().unwrap_or(match d.verdict {
        Verdict::Unexplained => "Repeat the worst runs first: what does not repeat is not the robot's.",
        _ => "Nothing is tied: a run at an amplitude and a frequency that no run has yet would test the extended model best.",
    });
    let _ = writeln!(out, "<p>{}</p>", escape(next));
    let _ = write!(
        out,
        "<h2>How to reproduce</h2>\n<p><code>{}</code></p><p>The extended model, <code>extended.toml</code>; run it with \
         <code>sfers run extended.toml</code>:</p><pre>{}</pre>\n</body></html>\n",
        escape(context.command),
        escape(context.extended)
    );
    out
}

fn gain(out: &mut String, d: &Diagnosis, unit: &str) {
    let _ = writeln!(
        out,
        "<h2>The gain, on runs that no fit saw</h2>\n<table><tr><th>model</th><th>held-out error ({unit})</th><th>range</th><th>all runs ({unit})</th></tr>"
    );
    for (name, stage) in [("nominal", &d.baseline), ("re-tuned constants", &d.calibrated), ("extended", &d.extended)] {
        let [low, high] = stage.rmse_heldout_ci95_mm;
        let _ = writeln!(
            out,
            "<tr><td>{name}</td><td class=\"n\">{:.4}</td><td class=\"n\">{low:.4} to {high:.4}</td><td class=\"n\">{:.4}</td></tr>",
            stage.rmse_heldout_mm, stage.rmse_mm
        );
    }
    out.push_str("</table>\n");
    let _ = writeln!(
        out,
        "<table><tr><th>run</th><th>role</th><th>nominal ({unit})</th><th>re-tuned</th><th>extended</th><th>in noises</th></tr>"
    );
    for ((nominal, tuned), extended) in d.baseline.runs.iter().zip(&d.calibrated.runs).zip(&d.extended.runs) {
        let class = if extended.rmse_noises > 1.2 { " bad" } else { "" };
        let _ = writeln!(
            out,
            "<tr><td>{}</td><td>{}</td><td class=\"n\">{:.4}</td><td class=\"n\">{:.4}</td><td class=\"n\">{:.4}</td><td class=\"n{class}\">{:.2}</td></tr>",
            escape(&nominal.id),
            nominal.role,
            nominal.rmse_mm,
            tuned.rmse_mm,
            extended.rmse_mm,
            extended.rmse_noises
        );
    }
    out.push_str("</table>\n");
}

/// The channel with the largest residual.
fn loudest(signal: &Signal, residuals: &[f64]) -> usize {
    let channels = signal.channels.iter().copied().max().unwrap_or(0) + 1;
    let size = |channel: usize| -> f64 {
        residuals.iter().zip(&signal.channels).filter(|(_, c)| **c == channel).map(|(r, _)| r * r).sum()
    };
    (0..channels).max_by(|a, b| size(*a).total_cmp(&size(*b))).unwrap_or(0)
}

/// Rows of a channel, thinned out.
fn rows(signal: &Signal, channel: usize) -> Vec<usize> {
    let rows: Vec<usize> = (0..signal.values.len()).filter(|i| signal.channels[*i] == channel).collect();
    let every = rows.len().div_ceil(ROWS).max(1);
    rows.into_iter().step_by(every).collect()
}

fn figure(out: &mut String, name: &str, figure: &Figure) {
    // Every figure names its clipping box alike; on one page the names must differ.
    let svg = figure.svg().replace("\"box\"", &format!("\"box-{name}\"")).replace("#box", &format!("#box-{name}"));
    let _ = writeln!(out, "<figure>{svg}</figure>");
}

fn motion(out: &mut String, outcome: &Outcome, run: usize, signal: &Signal, channel: usize, label: &str, index: usize) {
    let rows = rows(signal, channel);
    for (kind, residuals) in [("nominal", &outcome.nominal.residuals[run]), ("extended", &outcome.extended.residuals[run])] {
        let mut f = Figure::new(&format!("{}: {kind} model", signal.id), "time (s)", label);
        let used = |i: &&usize| outcome.used[run][**i];
        f.series("measured", rows.iter().filter(used).map(|i| (signal.times[*i], signal.values[*i])), Mark::Line);
        let simulated =
            rows.iter().filter(used).map(|i| (signal.times[*i], signal.values[*i] - residuals[*i] * signal.sigmas[*i]));
        f.series(kind, simulated, Mark::Line);
        figure(out, &format!("motion-{kind}-{index}"), &f);
    }
}

fn residuals(out: &mut String, outcome: &Outcome, run: usize, signal: &Signal, channel: usize, index: usize) {
    let rows = rows(signal, channel);
    for (kind, residuals) in [("re-tuned", &outcome.calibrated.residuals[run]), ("extended", &outcome.extended.residuals[run])] {
        let mut f = Figure::new(&format!("{}: {kind} model", signal.id), "time (s)", "residual (noises)");
        f.horizontal(0.0);
        let used = rows.iter().filter(|i| outcome.used[run][**i]);
        f.series("", used.map(|i| (signal.times[*i], residuals[*i])), Mark::Line);
        figure(out, &format!("residual-{kind}-{index}"), &f);
    }
}

fn ranking(out: &mut String, d: &Diagnosis, unit: &str) {
    let _ = writeln!(
        out,
        "<h2>Candidates, on top of re-tuned constants</h2>\n<table><tr><th>cause</th><th>held-out error ({unit})</th><th>change of BIC</th></tr>"
    );
    for c in d.candidates.iter().take(CANDIDATES) {
        let _ = writeln!(
            out,
            "<tr><td>{}</td><td class=\"n\">{:.4}</td><td class=\"n\">{:.0}</td></tr>",
            c.id, c.rmse_heldout_mm, c.delta_bic
        );
    }
    out.push_str("</table>\n<p class=\"small\">Those that a linear estimate puts first; the others would do less.</p>\n");
}

fn estimate(e: &Estimate) -> String {
    let end = |end: Option<f64>| end.map_or_else(|| "open".into(), |v| format!("{v:.5}"));
    format!(
        "<td>{}</td><td class=\"n\">{:.5}</td><td class=\"n\">{} to {}</td><td>{}</td><td>{}</td>",
        e.name,
        e.value,
        end(e.ci95[0]),
        end(e.ci95[1]),
        escape(&e.unit),
        if e.at_bound { "at the end of its range" } else { "" }
    )
}

fn parameters(out: &mut String, d: &Diagnosis) {
    out.push_str("<h2>Parameters</h2>\n<table><tr><th>cause</th><th>parameter</th><th>value</th><th>95 % range</th><th>unit</th><th></th></tr>\n");
    for effect in &d.effects {
        for e in &effect.parameters {
            let _ = writeln!(out, "<tr><td>{}</td>{}</tr>", effect.id, estimate(e));
        }
    }
    out.push_str("</table>\n");
    for effect in &d.effects {
        let tied =
            if effect.tied_with.is_empty() { String::new() } else { format!(" Tied with {}.", effect.tied_with.join(", ")) };
        let _ = writeln!(
            out,
            "<p class=\"small\"><strong>{}</strong> ({}): {} It removes {:.1} % of the held-out error above the noise.{tied}</p>",
            effect.id,
            effect.kind,
            escape(&effect.cause),
            100.0 * effect.gain_heldout
        );
    }
    out.push_str("<p class=\"small\">Constants of the nominal model, re-tuned alone:</p><table>\n");
    for e in &d.calibrated.parameters {
        let _ = writeln!(out, "<tr>{}</tr>", estimate(e));
    }
    out.push_str("</table>\n");
    for c in &d.correlations {
        let _ =
            writeln!(out, "<p class=\"bad\">{} and {} are correlated by {:.3}.</p>", c.between[0], c.between[1], c.coefficient);
    }
    let _ = writeln!(out, "<p class=\"small\">Condition of the fit: {:.1e}.</p>", d.condition);
}

fn tests(out: &mut String, d: &Diagnosis) {
    out.push_str("<h2>Tests of the residuals</h2>\n");
    let failed = |stage: &Stage| stage.residual_tests.iter().filter(|test| !test.passed).count();
    let _ = writeln!(
        out,
        "<p>{} of {} fail for the nominal model, {} with re-tuned constants, {} for the extended one.</p>",
        failed(&d.baseline),
        d.baseline.residual_tests.len(),
        failed(&d.calibrated),
        failed(&d.extended)
    );
    out.push_str("<table><tr><th>run</th><th>test</th><th>nominal</th><th>re-tuned</th><th>extended</th><th>limit</th><th>what it means, before and after</th></tr>\n");
    for ((a, b), c) in d.baseline.residual_tests.iter().zip(&d.calibrated.residual_tests).zip(&d.extended.residual_tests) {
        let cell =
            |passed: bool, statistic: f64| format!("<td class=\"n{}\">{statistic:.3}</td>", if passed { "" } else { " bad" });
        let _ = writeln!(
            out,
            "<tr><td>{}</td><td>{}</td>{}{}{}<td class=\"n\">{:.3}</td><td>{}; {}</td></tr>",
            escape(&a.run),
            a.name,
            cell(a.passed, a.statistic),
            cell(b.passed, b.statistic),
            cell(c.passed, c.statistic),
            a.limit,
            a.meaning,
            c.meaning
        );
    }
    out.push_str("</table>\n");
}

fn list(out: &mut String, lines: &[String], none: &str) {
    if lines.is_empty() {
        let _ = writeln!(out, "<p>{none}</p>");
        return;
    }
    out.push_str("<ul>");
    for line in lines {
        let _ = write!(out, "<li>{}</li>", escape(line));
    }
    out.push_str("</ul>\n");
}
