//! The tables of keys as plain text, Markdown and JSON.

use serde_json::json;

use super::{Default, FILES, File, Key, Range, Section, Value, unit};
use crate::effects::EFFECTS;
use crate::words::number;

impl Range {
    /// The range in words, for whole or real numbers.
    pub fn words(self, whole: bool) -> String {
        match self {
            Self::Any => String::new(),
            Self::Positive if whole => "1 or more".into(),
            Self::Positive => "above 0".into(),
            Self::NotNegative => "0 or more".into(),
            Self::Between(low, high) => format!("{} to {}", number(low), number(high)),
            Self::Inside(low, high) => format!("above {}, below {}", number(low), number(high)),
        }
    }
}

impl Value {
    /// The kind of value in words.
    pub fn kind(self) -> String {
        match self {
            Self::Number(_) => "number".into(),
            Self::Whole(_) => "whole number".into(),
            Self::Word(_) | Self::Text => "text".into(),
            Self::Name(what, _) => format!("name of a{} {what}", if what.starts_with('e') { "n" } else { "" }),
            Self::Names(what, _) => format!("list of names of {what}s"),
            Self::Path => "file".into(),
            Self::Numbers => "list of numbers".into(),
            Self::Other(words) => words.into(),
        }
    }

    /// The values allowed; empty if not limited to a list.
    pub fn choices(self) -> Vec<&'static str> {
        match self {
            Self::Word(choices) => choices.to_vec(),
            Self::Name(_, choices) | Self::Names(_, choices) => choices(),
            _ => Vec::new(),
        }
    }

    /// The range of a number in words; empty if there is none.
    pub fn range(self) -> String {
        match self {
            Self::Number(range) => range.words(false),
            Self::Whole(range) => range.words(true),
            _ => String::new(),
        }
    }

    /// Choices or range in words.
    fn allowed(self) -> String {
        match self {
            // Long lists that are documented elsewhere.
            Self::Name(what, _) | Self::Names(what, _) if what != "gait" => String::new(),
            _ if !self.choices().is_empty() => self.choices().join(", "),
            _ => self.range(),
        }
    }
}

impl Default {
    /// The default in words.
    pub fn words(self) -> String {
        match self {
            Self::Needed => "needed".into(),
            Self::Is(value) => value.into(),
            Self::OfPreset(two, four) if two == four => two.into(),
            Self::OfPreset(two, four) => format!("{two}; {four} of parameter-4"),
            Self::Else(words) => words.into(),
        }
    }
}

/// True if `topic` is part of the key's dotted name, or absent.
fn matches(section: &Section, key: &Key, topic: Option<&str>) -> bool {
    topic.is_none_or(|topic| section.dotted(key).contains(topic))
}

/// The keys of a topic, or all, as plain text; empty if no key matches.
pub fn text(topic: Option<&str>) -> String {
    let mut text = String::new();
    for file in FILES {
        let shown = |section: &Section| {
            let keys: Vec<_> = section.keys.iter().filter(|key| matches(section, key, topic)).collect();
            (topic.is_none() || topic == Some(section.name) || !keys.is_empty()).then_some(keys)
        };
        // Tables shared with experiment files are listed once.
        let own = |section: &&Section| file.name == "experiment" || !is_shared(section);
        let sections: Vec<_> = file.sections.iter().filter(own).filter_map(|section| Some((section, shown(section)?))).collect();
        if sections.is_empty() {
            continue;
        }
        text += &format!("{} FILES\n{}", file.name.to_uppercase(), wrapped(file.about, 0));
        for (section, keys) in sections {
            text += &format!("\n{}\n{}", section.heading, wrapped(section.about, 2));
            for key in keys {
                text += &entry(key);
            }
        }
        if topic.is_none() && file.sections.iter().any(is_shared) && file.name != "experiment" {
            text += "\n[material], [robot], [robot.friction]\n  As in experiment files.\n";
        }
        text += "\n";
    }
    text
}

/// True if a table of another file is that of experiment files.
fn is_shared(section: &Section) -> bool {
    ["material", "robot", "robot.friction"].contains(&section.name)
}

/// Kind, unit, range or choices, default and requirements of a key, in words.
pub fn facts(key: &Key) -> String {
    let unit = Some(unit(key.name)).filter(|unit| !unit.is_empty()).map_or_else(String::new, |unit| format!(" ({unit})"));
    let mut facts = vec![format!("{}{unit}", key.value.kind())];
    facts.extend(Some(key.value.allowed()).filter(|allowed| !allowed.is_empty()));
    facts.push(match key.default {
        Default::Needed => "needed".into(),
        Default::Else(words) => format!("if absent: {words}"),
        default => format!("default {}", default.words()),
    });
    facts.extend(Some(key.with).filter(|with| !with.is_empty()).map(|with| format!("with {with}")));
    facts.join("; ")
}

fn entry(key: &Key) -> String {
    format!("  {}\n{}{}", key.name, wrapped(key.about, 6), wrapped(&facts(key), 6))
}

/// An indented paragraph in lines of at most 100 characters.
pub(crate) fn wrapped(text: &str, indent: usize) -> String {
    let mut out = String::new();
    let mut line = String::new();
    for word in text.split_whitespace() {
        if !line.is_empty() && indent + line.chars().count() + 1 + word.chars().count() > 100 {
            out += &format!("{:indent$}{line}\n", "");
            line.clear();
        }
        if !line.is_empty() {
            line.push(' ');
        }
        line += word;
    }
    if line.is_empty() { out } else { out + &format!("{:indent$}{line}\n", "") }
}

/// The keys as Markdown.
pub fn markdown() -> String {
    let mut text = String::from(
        "# Keys of experiment, sweep and dataset files\n\nMade by `sfers help keys --markdown`. Unknown keys are refused, and a unit stands in every key.\n",
    );
    for file in FILES {
        text += &format!("\n## {} files\n\n{}\n", capital(file.name), file.about);
        for section in file.sections {
            text += &format!("\n### `{}`\n\n", section.heading);
            if file.name != "experiment" && is_shared(section) {
                text += "As in [experiment files](#experiment-files).\n";
                continue;
            }
            text += &format!("{}\n", section.about);
            if !section.keys.is_empty() {
                text += "\n| key | kind | unit | default | range or choices | meaning |\n| --- | --- | --- | --- | --- | --- |\n";
                text += &section.keys.iter().map(row).collect::<String>();
            }
            if section.name == "effect" {
                text += &effect_keys();
            }
        }
    }
    text
}

fn row(key: &Key) -> String {
    let code = |words: &str| if words.is_empty() { String::new() } else { format!("`{words}`") };
    let default = match key.default {
        Default::Is(value) => code(value),
        other => other.words(),
    };
    let choices: Vec<_> = if key.value.allowed().is_empty() { Vec::new() } else { key.value.choices() };
    let allowed = if choices.is_empty() {
        key.value.allowed()
    } else {
        choices.iter().map(|choice| code(choice)).collect::<Vec<_>>().join(", ")
    };
    let with = if key.with.is_empty() { String::new() } else { format!(" (with {})", key.with) };
    format!("| `{}` | {} | {} | {default} | {allowed} | {}{with} |\n", key.name, key.value.kind(), unit(key.name), key.about)
}

/// Which keys take lists.
fn lists_of_effects() -> String {
    let mut text = String::from(
        "\nNumbered keys may be given together, as a list under the key without the number, in the order of the numbers:\n\n",
    );
    for effect in EFFECTS {
        let of = |(key, names): &(String, Vec<&str>)| format!("`{key}` ({} numbers)", names.len());
        let lists: Vec<String> = effect.groups().iter().map(of).collect();
        if !lists.is_empty() {
            text += &format!("- `{}`: {}\n", effect.id, lists.join(", "));
        }
    }
    text
}

/// Table of the effects' parameters, keys of `[[effect]]`.
fn effect_keys() -> String {
    let mut text = lists_of_effects();
    text += "\n| `id` | key | unit | default | range | meaning |\n| --- | --- | --- | --- | --- | --- |\n";
    for effect in EFFECTS {
        for p in effect.parameters {
            let default = p.default.map_or_else(|| "needed".to_owned(), number);
            let [low, high] = p.bounds.map(number);
            text += &format!("| `{}` | `{}` | {} | {default} | {low} to {high} | {} |\n", effect.id, p.name, p.unit, p.about);
        }
    }
    text
}

fn capital(word: &str) -> String {
    let mut letters = word.chars();
    letters.next().map_or_else(String::new, |first| first.to_uppercase().chain(letters).collect())
}

/// The keys as one JSON object.
pub fn json() -> serde_json::Value {
    let key = |section: &Section, key: &Key| {
        let default = match key.default {
            Default::Is(_) | Default::OfPreset(..) => json!(key.default.words()),
            _ => serde_json::Value::Null,
        };
        json!({
            "key": section.dotted(key), "kind": key.value.kind(), "unit": unit(key.name), "needed": key.default == Default::Needed,
            "default": default, "choices": key.value.choices(), "range": key.value.range(), "with": key.with, "about": key.about,
        })
    };
    let file = |file: &File| {
        let keys: Vec<_> = file.sections.iter().flat_map(|section| section.keys.iter().map(|k| key(section, k))).collect();
        json!({"file": file.name, "about": file.about, "keys": keys})
    };
    json!({"schema": 1, "files": FILES.iter().map(|f| file(f)).collect::<Vec<_>>()})
}
