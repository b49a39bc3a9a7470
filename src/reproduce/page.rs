//! All findings as an HTML page and as a Markdown table.

use std::fmt::Write;

use super::{Comparison, Effort, Findings, Study, StudyError};
use crate::view::escape;
use crate::view::page::{Table, document, figure};

/// Columns of the table; those of numbers name the engine.
const COLUMNS: [&str; 6] =
    ["quantity", "published", "ours (planar engine)", "difference", "spot check (Bullet)", "what explains it"];

/// The findings as a self-contained HTML page, with the reason of each failed study.
pub fn page(effort: Effort, made_by: &str, results: &[(Study, Result<Findings, StudyError>)]) -> String {
    let title = "The paper's results, reproduced";
    let mut out = format!(
        "<h1>{title}</h1>\n<p>Zheng et al., “Scalable Simulation and Demonstration of Jumping Piezoelectric 2-D Soft Robots”, ICRA 2022, beside this \
         program. The numbers under “ours” are the planar engine's, to {} %: steps adapt until a tighter tolerance changes no more; some runs are repeated on Bullet, with its own column. No number was fitted \
         to these results, but for friction and damping of the study of speeds, which are chosen for its curve. Made by <code>{}</code>.</p>\n<nav>",
        100.0 * effort.step_error(),
        escape(made_by)
    );
    for (study, _) in results {
        let _ = write!(out, "<a href=\"#{}\">{}</a> ", study.id, escape(study.title));
    }
    out.push_str("</nav>\n");
    for (study, result) in results {
        let _ = write!(
            out,
            "<section id=\"{0}\"><h2>{1}</h2>\n<p class=\"from\">Paper: {2}. Again: <code>sfers reproduce {0} --out DIR</code></p>\n",
            study.id,
            escape(study.title),
            escape(study.section)
        );
        match result {
            Err(reason) => {
                let _ = writeln!(out, "<p class=\"bad\"><strong>Not reproduced:</strong> {}</p>", escape(&reason.to_string()));
            }
            Ok(findings) => {
                out.push_str(&figure(study.id, "", &findings.figure, &findings.caption));
                let _ = writeln!(out, "<p class=\"engines small\">{}</p>", escape(&findings.engines));
                let mut table = Table::new(&COLUMNS).stacking();
                for c in &findings.comparisons {
                    table.row(cells(c).map(|cell| cell.as_str().into()));
                }
                out.push_str(&table.html());
            }
        }
        out.push_str("</section>\n");
    }
    document(title, &out)
}

fn cells(c: &Comparison) -> [&String; 6] {
    [&c.quantity, &c.published, &c.ours, &c.difference, &c.bullet, &c.explanation]
}

/// All comparisons as one Markdown table.
pub fn table(results: &[(Study, Result<Findings, StudyError>)]) -> String {
    let mut out = format!("| id | {} |\n|{}\n", COLUMNS.join(" | "), " --- |".repeat(COLUMNS.len() + 1));
    for (study, result) in results {
        match result {
            Ok(findings) => {
                for comparison in &findings.comparisons {
                    let _ = writeln!(out, "| {} | {} |", study.id, cells(comparison).map(String::as_str).join(" | "));
                }
            }
            Err(reason) => {
                let _ = writeln!(out, "| {} | not reproduced | | | | | {reason} |", study.id);
            }
        }
    }
    out
}
