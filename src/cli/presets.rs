//! `sfers presets` and `sfers preset NAME`.

use std::process::ExitCode;

use serde_json::json;

use super::{Failure, Options, print};
use crate::experiment::presets::{PRESETS, find};

pub fn list(options: Options) -> Result<ExitCode, Failure> {
    if options.json {
        let presets: Vec<_> = PRESETS.iter().map(|p| json!({"name": p.name, "summary": p.summary()})).collect();
        print(&format!("{}\n", json!({"schema": 1, "presets": presets})))?;
    } else {
        let width = PRESETS.iter().map(|preset| preset.name.len()).max().unwrap_or(0);
        let lines = PRESETS.iter().map(|preset| format!("{:width$}  {}\n", preset.name, preset.summary()));
        print(&lines.collect::<String>())?;
    }
    Ok(ExitCode::SUCCESS)
}

pub fn show(name: &str) -> Result<ExitCode, Failure> {
    let preset = find(name).ok_or_else(|| Failure::Usage(format!("there is no preset {name:?}; sfers presets lists them")))?;
    print(preset.text)?;
    Ok(ExitCode::SUCCESS)
}
