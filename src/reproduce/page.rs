//! All findings as one page, and as a table for documents.

use std::fmt::Write;

use super::{Comparison, Effort, Findings, Study};
use crate::view::escape;

const STYLE: &str = "body{font:15px/1.45 Helvetica,Arial,sans-serif;color:#111;max-width:980px;margin:0 auto;padding:16px}\
h1{font-size:22px}h2{font-size:18px;margin:38px 0 6px}table{border-collapse:collapse;width:100%;font-size:13.5px;margin:10px 0}\
th,td{text-align:left;vertical-align:top;padding:5px 10px 5px 0;border-bottom:1px solid #ddd}th{border-bottom:2px solid #111}\
figure{margin:8px 0}figure svg{width:100%;max-width:720px}figcaption,.from{color:#444;font-size:13.5px}nav a{margin-right:14px}";

/// The findings as a self-contained HTML page. A study that failed stands there with its reason.
pub fn page(effort: Effort, made_by: &str, results: &[(Study, Result<Findings, String>)]) -> String {
    let mut out = format!(
        "<!doctype html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"><title>The paper's results, reproduced</title><style>{STYLE}</style></head><body>\n\
         <h1>The paper's results, reproduced</h1>\n<p>Zheng et al., “Scalable Simulation and Demonstration of Jumping Piezoelectric 2-D Soft Robots”, \
         ICRA 2022, beside this program on Bullet. No number was fitted to these results. Made by <code>{}</code>, {}.</p>\n<nav>",
        escape(made_by),
        match effort {
            Effort::Quick => "at the presets' time steps",
            Effort::Full => "at a fifth of the presets' time steps",
        }
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
                let _ = writeln!(out, "<p><strong>Not reproduced:</strong> {}</p>", escape(reason));
            }
            Ok(findings) => {
                // Every figure names its clipping box alike; on one page the names must differ.
                let figure = findings
                    .figure
                    .replace("\"box\"", &format!("\"box-{}\"", study.id))
                    .replace("#box", &format!("#box-{}", study.id));
                let _ = write!(out, "<figure>{figure}<figcaption>{}</figcaption></figure>\n<table>", escape(&findings.caption));
                out.push_str(
                    "<tr><th>quantity</th><th>published</th><th>ours</th><th>difference</th><th>what explains it</th></tr>\n",
                );
                for c in &findings.comparisons {
                    let cells = [&c.quantity, &c.published, &c.ours, &c.difference, &c.explanation]
                        .map(|cell| format!("<td>{}</td>", escape(cell)));
                    let _ = writeln!(out, "<tr>{}</tr>", cells.concat());
                }
                out.push_str("</table>\n");
            }
        }
        out.push_str("</section>\n");
    }
    out.push_str("</body></html>\n");
    out
}

/// All comparisons as one Markdown table.
pub fn table(results: &[(Study, Result<Findings, String>)]) -> String {
    let mut out = String::from(
        "| id | quantity | published | ours | difference | what explains it |\n| --- | --- | --- | --- | --- | --- |\n",
    );
    for (study, result) in results {
        match result {
            Ok(findings) => {
                for Comparison { quantity, published, ours, difference, explanation } in &findings.comparisons {
                    let _ = writeln!(out, "| {} | {quantity} | {published} | {ours} | {difference} | {explanation} |", study.id);
                }
            }
            Err(reason) => {
                let _ = writeln!(out, "| {} | – | – | not reproduced | – | {reason} |", study.id);
            }
        }
    }
    out
}
