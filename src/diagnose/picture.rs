//! The residual tests of all runs and models as one figure.

use std::fmt::Write;

use super::residual_tests::ResidualTest;
use crate::view::{escape, significant};

/// Side of a test's square and the room between two models (px).
const SIDE: f64 = 16.0;
const GAP: f64 = 14.0;
/// Height of the column names, and width of a character (px).
const HEAD: f64 = 128.0;
const CHARACTER: f64 = 6.3;
/// Fills: passed, and failed by up to twice, five times and more than five times the limit.
const FILLS: [&str; 4] = ["#dce8f0", "#f6b26b", "#d95f0e", "#7f2704"];

fn short(name: &str) -> &str {
    match name {
        "chi-square per value" => "size",
        "correlation of neighbours" => "neighbours",
        "correlation with the input" => "input",
        "correlation with the input's rate" => "input's rate",
        "drift in log time" => "drift in log time",
        "gain against amplitude" => "gain over swing",
        other => other,
    }
}

fn fill(test: &ResidualTest) -> &'static str {
    let ratio = test.statistic.abs() / test.limit;
    match () {
        () if test.passed => FILLS[0],
        () if ratio <= 2.0 => FILLS[1],
        () if ratio <= 5.0 => FILLS[2],
        () => FILLS[3],
    }
}

/// The figure (SVG): a panel for each model, in it a row for each run and a column for each test. Failed tests are crossed.
pub fn residual_tests(models: &[(&str, &[ResidualTest])]) -> String {
    let (mut runs, mut kinds): (Vec<&str>, Vec<&str>) = (Vec::new(), Vec::new());
    for test in models.iter().flat_map(|(_, tests)| *tests) {
        if !runs.contains(&test.run.as_str()) {
            runs.push(&test.run);
        }
        if !kinds.contains(&test.name.as_str()) {
            kinds.push(&test.name);
        }
    }
    let left = 10.0 + CHARACTER * runs.iter().map(|run| run.chars().count()).max().unwrap_or(0).clamp(4, 30) as f64;
    let panel = SIDE * kinds.len() as f64 + GAP;
    let width = left + panel * models.len() as f64;
    let bottom = HEAD + SIDE * runs.len() as f64;
    let height = bottom + 52.0;
    let mut out = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width:.0} {height:.0}\" font-family=\"Helvetica, Arial, sans-serif\" font-size=\"11\" \
         fill=\"#111\" role=\"img\" aria-label=\"residual tests\">\n"
    );
    for (row, run) in runs.iter().enumerate() {
        let shown: String = run.chars().take(30).collect();
        let y = HEAD + SIDE * row as f64 + 12.0;
        let _ = writeln!(out, "<text x=\"{:.1}\" y=\"{y:.1}\" text-anchor=\"end\">{}</text>", left - 6.0, escape(&shown));
    }
    for (index, (model, tests)) in models.iter().enumerate() {
        let x0 = left + panel * index as f64;
        let middle = x0 + 0.5 * (panel - GAP);
        let _ = writeln!(
            out,
            "<text x=\"{middle:.1}\" y=\"14\" text-anchor=\"middle\" font-weight=\"bold\">{}</text>",
            escape(model)
        );
        for (column, kind) in kinds.iter().enumerate() {
            let x = x0 + SIDE * column as f64 + 12.0;
            let y = HEAD - 6.0;
            let _ = writeln!(out, "<text transform=\"translate({x:.1} {y:.1}) rotate(-90)\">{}</text>", escape(short(kind)));
        }
        for test in *tests {
            let at = |of: &[&str], name: &str| of.iter().position(|one| *one == name).unwrap_or(0) as f64;
            let (x, y) = (x0 + SIDE * at(&kinds, &test.name), HEAD + SIDE * at(&runs, &test.run));
            let _ = writeln!(
                out,
                "<g class=\"{}\"><title>{}, {}: {} (limit {}); {}</title><rect x=\"{x:.1}\" y=\"{y:.1}\" width=\"{side:.1}\" height=\"{side:.1}\" fill=\"{}\"/>{}</g>",
                if test.passed { "passed" } else { "failed" },
                escape(&test.run),
                escape(&test.name),
                significant(test.statistic, 3),
                significant(test.limit, 3),
                escape(&test.meaning),
                fill(test),
                if test.passed { String::new() } else { cross(x, y, fill(test) == FILLS[3]) },
                side = SIDE - 1.0,
            );
        }
    }
    let words = ["passed", "failed, up to twice the limit", "up to five times", "more"];
    let mut x = 4.0;
    let y = bottom + 22.0;
    for (k, (word, fill)) in words.iter().zip(FILLS).enumerate() {
        let _ = write!(out, "<rect x=\"{x:.1}\" y=\"{y:.1}\" width=\"12\" height=\"12\" fill=\"{fill}\"/>");
        if k > 0 {
            out += &cross(x - 1.5, y - 1.5, k == 3);
        }
        let _ = writeln!(out, "<text x=\"{:.1}\" y=\"{:.1}\">{word}</text>", x + 17.0, y + 10.0);
        x += 34.0 + 5.6 * word.chars().count() as f64;
    }
    out + "</svg>\n"
}

/// A cross over the square at `x`, `y` (px), so that failures show without colours too.
fn cross(x: f64, y: f64, is_dark: bool) -> String {
    let (a, b) = (3.5, SIDE - 4.5);
    let colour = if is_dark { "#fff" } else { "#111" };
    format!(
        "<path d=\"M{:.1} {:.1}L{:.1} {:.1}M{:.1} {:.1}L{:.1} {:.1}\" stroke=\"{colour}\" stroke-width=\"1.3\"/>",
        x + a,
        y + a,
        x + b,
        y + b,
        x + a,
        y + b,
        x + b,
        y + a
    )
}
