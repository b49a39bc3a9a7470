//! `sfers man`: manual pages, from the definitions of the help.

use std::path::PathBuf;
use std::process::ExitCode;

use clap::CommandFactory;
use clap_mangen::Man;
use clap_mangen::roff::{Roff, bold, roman};

use super::output::{finish, pending, unwritable};
use super::{Cli, Failure, Options, print};
use crate::keys::{self, FILES};
use crate::recording::definitions::{CONVENTIONS, DEFINITIONS};
use crate::words::did_you_mean;

/// Print a manual page, or write all of them to a folder.
///
/// The pages are sfers(1), sfers-run(1) and so on for every command, sfers-keys(5) and sfers-measures(7). Packagers install those of
/// `sfers man --out DIR` under share/man/man1, man5 and man7.
///
/// Example: sfers man sfers-run | man -l -
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Which page.
    #[arg(default_value = "sfers")]
    page: String,
    /// Write all pages to this folder.
    #[arg(long, value_name = "DIR", conflicts_with = "page")]
    out: Option<PathBuf>,
}

pub fn run(args: &Args, options: Options) -> Result<ExitCode, Failure> {
    let pages = pages()?;
    let Some(folder) = &args.out else {
        let name = args.page.as_str();
        let known = pages.iter().map(|(name, _, _)| name.as_str());
        let unknown = || Failure::Usage(format!("there is no page {name:?}{}", did_you_mean(name, known)));
        let (_, _, text) = pages.iter().find(|(page, _, _)| page == name).ok_or_else(unknown)?;
        print(text)?;
        return Ok(ExitCode::SUCCESS);
    };
    std::fs::create_dir_all(folder).map_err(|error| unwritable(folder, &error))?;
    for (name, section, text) in &pages {
        finish(pending(&folder.join(format!("{name}.{section}")))?, text.as_bytes())?;
    }
    options.remark(&format!("{} pages in {}", pages.len(), folder.display()));
    Ok(ExitCode::SUCCESS)
}

/// Name, section and text of all pages.
fn pages() -> Result<Vec<(String, u8, String)>, Failure> {
    let mut all = Cli::command();
    all.build();
    let mut commands = vec![("sfers".to_owned(), all.clone())];
    for command in all.get_subcommands() {
        let name = format!("sfers-{}", command.get_name());
        commands.push((name.clone(), command.clone().display_name(name)));
    }
    let mut pages = Vec::new();
    for (name, command) in commands {
        let mut text = Vec::new();
        Man::new(command).render(&mut text)?;
        pages.push((name, 1, String::from_utf8_lossy(&text).into_owned()));
    }
    pages.push(("sfers-keys".into(), 5, key_page()));
    pages.push(("sfers-measures".into(), 7, measure_page()));
    Ok(pages)
}

/// The beginning of a page: title, name and summary.
fn page(name: &str, section: &str, summary: &str) -> Roff {
    let mut page = Roff::new();
    page.control("TH", [name, section, "", concat!("sfers ", env!("CARGO_PKG_VERSION"))]);
    page.control("SH", ["NAME"]).text([roman(format!("{name} - {summary}"))]);
    page
}

fn key_page() -> String {
    let mut page = page("sfers-keys", "5", "keys of experiment, sweep and dataset files");
    for file in FILES {
        page.control("SH", [format!("{} files", file.name).as_str()]).text([roman(file.about)]);
        for section in file.sections {
            page.control("SS", [section.heading]).text([roman(section.about)]);
            for key in section.keys {
                page.control("TP", []).text([bold(key.name)]);
                page.text([roman(format!("{} ({})", key.about, keys::facts(key)))]);
            }
        }
    }
    page.to_roff()
}

fn measure_page() -> String {
    let mut page = page("sfers-measures", "7", "measures of runs");
    page.control("SH", ["CONVENTIONS"]).text([roman(CONVENTIONS)]).control("SH", ["MEASURES"]);
    for definition in DEFINITIONS {
        page.control("TP", []).text([bold(definition.name)]);
        page.text([roman(format!("{} (for {})", definition.about, definition.of))]);
    }
    page.to_roff()
}
