//! `sfers reproduce`: reproduction of the paper's results.

use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

use serde_json::json;

use super::output::{finish, pending, unwritable};
use super::{Failure, INTERRUPTED, Options, print, say};
use crate::reproduce::{Bench, Effort, Findings, STUDIES, Study, StudyError, page, table};
use crate::words;

/// Reproduce the paper's results: DIR/index.html, with a figure and a table for each.
///
/// Without IDs all of them. The same command resumes an interrupted reproduction.
///
/// Example: sfers reproduce --quick --out paper
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Which results; `--list` names them.
    ids: Vec<String>,
    /// Folder of the results.
    #[arg(long, value_name = "DIR", required_unless_present = "list")]
    out: Option<PathBuf>,
    /// Results to 1 % instead of 0.1 %.
    #[arg(long)]
    quick: bool,
    /// Number of runs at a time; by default one per processor.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    jobs: Option<u16>,
    /// List the ids.
    #[arg(long)]
    list: bool,
}

static INTERRUPT: AtomicBool = AtomicBool::new(false);

fn choose(ids: &[String]) -> Result<Vec<Study>, Failure> {
    if ids.is_empty() {
        return Ok(STUDIES.to_vec());
    }
    let find = |id: &String| STUDIES.iter().find(|study| study.id == id).copied();
    let unknown = |id: &String| {
        let known: Vec<_> = STUDIES.iter().map(|study| study.id).collect();
        Failure::Usage(words::not_one_of(id, &known))
    };
    ids.iter().map(|id| find(id).ok_or_else(|| unknown(id))).collect()
}

fn write(path: &Path, text: &str) -> Result<(), Failure> {
    finish(pending(path)?, text.as_bytes())
}

pub fn run(args: &Args, options: Options) -> Result<ExitCode, Failure> {
    let studies = choose(&args.ids)?;
    let Some(folder) = args.out.as_deref().filter(|_| !args.list) else {
        let lines = STUDIES.iter().map(|study| format!("{:20} {} ({})\n", study.id, study.title, study.section));
        print(&lines.collect::<String>())?;
        return Ok(ExitCode::SUCCESS);
    };
    std::fs::create_dir_all(folder).map_err(|error| unwritable(folder, &error))?;
    drop(pending(&folder.join("index.html"))?);
    let _ = ctrlc::set_handler(|| INTERRUPT.store(true, Ordering::Relaxed));
    let jobs = args.jobs.map_or_else(|| std::thread::available_parallelism().map_or(1, Into::into), usize::from);
    let effort = if args.quick { Effort::Quick } else { Effort::Full };
    let rows = folder.join(if args.quick { "rows-quick" } else { "rows-full" });
    let cost: f64 = studies.iter().map(|study| study.cost_s[usize::from(!args.quick)]).sum();
    options.remark(&format!("{} results, about {:.0} min on {jobs} threads", studies.len(), (cost / jobs as f64 / 60.0).ceil()));

    let bench = Bench::new(effort, jobs, &rows, &INTERRUPT);
    let mut results: Vec<(Study, Result<Findings, StudyError>)> = Vec::new();
    for study in studies {
        let start = Instant::now();
        let result = match study.run(&bench) {
            Err(StudyError::Interrupted) => {
                say("interrupted; the same command resumes the reproduction");
                return Ok(ExitCode::from(INTERRUPTED));
            }
            Err(StudyError::Rows(error)) => return Err(error.into()),
            result => result,
        };
        if let Ok(findings) = &result {
            write(&folder.join(format!("{}.svg", study.id)), &findings.figure)?;
        }
        options.remark(&format!("{}: {:.0} s", study.id, start.elapsed().as_secs_f64()));
        results.push((study, result));
    }
    let ids: String = args.ids.iter().map(|id| format!(" {id}")).collect();
    let made_by = format!("sfers reproduce{ids}{}", if args.quick { " --quick" } else { "" });
    write(&folder.join("index.html"), &page(effort, &made_by, &results))?;
    write(&folder.join("table.md"), &table(&results))?;
    let entries: Vec<_> = results
        .iter()
        .map(|(study, result)| match result {
            Ok(findings) => json!({
                "id": study.id, "title": study.title, "engines": findings.engines,
                "published": findings.published, "comparisons": findings.comparisons,
            }),
            Err(reason) => json!({"id": study.id, "title": study.title, "failed": reason.to_string()}),
        })
        .collect();
    let object = json!({"schema": 2, "made_by": made_by, "results": entries});
    write(&folder.join("results.json"), &format!("{object:#}\n"))?;
    if options.json {
        print(&format!("{object}\n"))?;
    } else {
        print(&format!("{}\n", folder.join("index.html").display()))?;
    }
    let failed = results.iter().any(|(_, result)| result.is_err());
    Ok(if failed { ExitCode::from(1) } else { ExitCode::SUCCESS })
}
