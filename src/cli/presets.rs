//! `sfers presets` and `sfers preset NAME`.

use std::process::ExitCode;

use serde_json::json;

use super::{Failure, Options, print};
use crate::experiment::presets::{
    CLASSES, DATASETS, PRESETS, Preset, SWEEPS, find, find_class, find_dataset, find_sweep, unknown,
};

pub fn list(options: Options) -> Result<ExitCode, Failure> {
    if options.json {
        let objects = |list: &[Preset]| list.iter().map(|p| json!({"name": p.name, "summary": p.summary()})).collect::<Vec<_>>();
        let classes: Vec<_> = CLASSES.iter().map(|c| json!({"class": c.name, "preset": c.preset, "sweep": c.sweep})).collect();
        print(&format!(
            "{}\n",
            json!({"schema": 1, "presets": objects(PRESETS), "sweeps": objects(SWEEPS), "datasets": objects(DATASETS), "reference_classes": classes})
        ))?;
        return Ok(ExitCode::SUCCESS);
    }
    let width = PRESETS.iter().chain(SWEEPS).chain(DATASETS).map(|preset| preset.name.len()).max().unwrap_or(0);
    let lines = |list: &[Preset]| list.iter().map(|p| format!("  {:width$}  {}\n", p.name, p.summary())).collect::<String>();
    print(&format!(
        "experiments (sfers preset NAME | sfers run -)\n{}\nsweeps (sfers sweep preset:NAME --out DIR)\n{}\n\
         published numbers (sfers diagnose preset:NAME --out DIR)\n{}\n\
         The reference's class names are presets too, with the class's own settings: sfers preset InchwormCrawl\n",
        lines(PRESETS),
        lines(SWEEPS),
        lines(DATASETS)
    ))?;
    Ok(ExitCode::SUCCESS)
}

pub fn show(name: &str) -> Result<ExitCode, Failure> {
    let text = match find_class(name) {
        Some(class) => class.text(),
        None => {
            let refuse = || Failure::Usage(unknown(name));
            find(name).or_else(|| find_sweep(name)).or_else(|| find_dataset(name)).ok_or_else(refuse)?.text.to_owned()
        }
    };
    print(&text)?;
    Ok(ExitCode::SUCCESS)
}
