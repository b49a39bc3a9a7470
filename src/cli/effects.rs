//! `sfers effects`: the extensions of the model.

use std::process::ExitCode;

use serde_json::json;

use super::{Failure, Options, print};
use crate::effects::EFFECTS;

pub fn run(options: Options) -> Result<ExitCode, Failure> {
    if options.json {
        // JSON has no infinity; such values are strings.
        let number = |value: f64| if value.is_finite() { json!(value) } else { json!(value.to_string()) };
        let effects: Vec<_> = EFFECTS
            .iter()
            .map(|effect| {
                let parameters: Vec<_> = effect
                    .parameters
                    .iter()
                    .map(|p| {
                        json!({"name": p.name, "unit": p.unit, "bounds": p.bounds, "off": p.off.map(number), "default": p.default.map(number), "about": p.about})
                    })
                    .collect();
                let lists: Vec<_> = effect.groups().into_iter().map(|(key, names)| json!({"key": key, "parameters": names})).collect();
                json!({"id": effect.id, "kind": effect.kind, "cause": effect.cause, "equation": effect.equation, "source": effect.source, "parameters": parameters, "lists": lists})
            })
            .collect();
        print(&format!("{}\n", json!({"schema": 1, "effects": effects})))?;
        return Ok(ExitCode::SUCCESS);
    }
    let mut text = String::new();
    for effect in EFFECTS {
        text += &format!("{} ({})\n    {}\n    {}\n", effect.id, effect.kind.name(), effect.cause, effect.equation);
        for (key, names) in effect.groups() {
            let (first, last) = (names[0], names[names.len() - 1]);
            text += &format!("        {key} = [{} numbers]: {first} to {last}\n", names.len());
        }
        for p in effect.parameters {
            let unit = if p.unit.is_empty() { String::new() } else { format!(" ({})", p.unit) };
            let off = p.off.map_or_else(String::new, |off| format!(", off {off}"));
            let default = p.default.map_or_else(|| ", needed".to_owned(), |value| format!(", default {value}"));
            text += &format!("        {}{unit}: {}; {} to {}{off}{default}\n", p.name, p.about, p.bounds[0], p.bounds[1]);
        }
    }
    print(&text)?;
    Ok(ExitCode::SUCCESS)
}
