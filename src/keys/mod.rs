//! Tables of the keys of experiment, sweep and dataset files, for `sfers help keys`, docs/keys.md and the manual page.
//!
//! Tests compare keys, defaults, choices and ranges of the tables with those that the program accepts.

mod dataset;
mod experiment;
mod render;
mod sweep;
#[cfg(test)]
mod tests;

// Tables of files are named in brackets there, which are no links.
#[allow(rustdoc::broken_intra_doc_links)]
#[doc = include_str!("../../docs/keys.md")]
pub mod guide {}

pub(crate) use render::wrapped;
pub use render::{facts, json, markdown, text};

/// A kind of file.
#[derive(Debug)]
pub struct File {
    /// Name: experiment, sweep or dataset.
    pub name: &'static str,
    /// Purpose.
    pub about: &'static str,
    /// Tables, in the order of a file.
    pub sections: &'static [Section],
}

/// A table of a file.
#[derive(Debug)]
pub struct Section {
    /// Name with dots; empty for keys outside of tables.
    pub name: &'static str,
    /// Heading as written in a file.
    pub heading: &'static str,
    /// Contents.
    pub about: &'static str,
    /// Keys.
    pub keys: &'static [Key],
}

/// A key.
#[derive(Debug)]
pub struct Key {
    /// Name with the unit.
    pub name: &'static str,
    /// Kind of value.
    pub value: Value,
    /// Value of an absent key.
    pub default: Default,
    /// Values of other keys that it requires; empty if none.
    pub with: &'static str,
    /// Meaning.
    pub about: &'static str,
}

/// Kinds of values.
#[derive(Debug, Clone, Copy)]
pub enum Value {
    /// A number in a range.
    Number(Range),
    /// A whole number in a range.
    Whole(Range),
    /// One of some words.
    Word(&'static [&'static str]),
    /// A name from a table of the program: the kind of thing, and the names.
    Name(&'static str, fn() -> Vec<&'static str>),
    /// A list of names from a table of the program.
    Names(&'static str, fn() -> Vec<&'static str>),
    /// Any text.
    Text,
    /// The path of a file, relative to the file with the key.
    Path,
    /// A list of numbers.
    Numbers,
    /// Another kind, in words.
    Other(&'static str),
}

/// Ranges of numbers, without infinity and NaN.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Range {
    /// Any.
    Any,
    /// Above 0.
    Positive,
    /// 0 or more.
    NotNegative,
    /// A closed interval.
    Between(f64, f64),
    /// An open interval.
    Inside(f64, f64),
}

/// Value of an absent key.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Default {
    /// The key is required.
    Needed,
    /// A value, as TOML.
    Is(&'static str),
    /// The value of the material's preset: `parameter-2` and `parameter-4`.
    OfPreset(&'static str, &'static str),
    /// The behaviour, in words.
    Else(&'static str),
}

/// All files.
pub static FILES: [&File; 3] = [&experiment::FILE, &sweep::FILE, &dataset::FILE];

/// The unit in a name; empty for dimensionless quantities.
pub fn unit(name: &str) -> &'static str {
    crate::words::split_unit(name).map_or("", |(_, unit)| unit)
}

/// The default of a key of an experiment file, with its table before it, as TOML; of a material the one of either preset. `None` if there is none.
pub(crate) fn default_of(dotted: &str, is_parameter_4: bool) -> Option<&'static str> {
    let (table, name) = dotted.rsplit_once('.')?;
    let sections = experiment::FILE.sections.iter().filter(|section| section.name == table);
    match sections.flat_map(|section| section.keys).find(|key| key.name == name)?.default {
        Default::Is(text) => Some(text),
        Default::OfPreset(two, four) => Some(if is_parameter_4 { four } else { two }),
        Default::Needed | Default::Else(_) => None,
    }
}

impl Section {
    /// The name of a key with its table's.
    pub fn dotted(&self, key: &Key) -> String {
        if self.name.is_empty() { key.name.into() } else { format!("{}.{}", self.name, key.name) }
    }
}

const fn key(name: &'static str, value: Value, default: Default, about: &'static str) -> Key {
    Key { name, value, default, with: "", about }
}

impl Key {
    /// The key with values of other keys that it requires.
    const fn with(self, with: &'static str) -> Self {
        Self { with, ..self }
    }
}
