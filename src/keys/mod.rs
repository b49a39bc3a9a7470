//! The keys of experiment, sweep and dataset files, as tables: what `sfers help keys`, docs/keys.md and the manual page show.
//!
//! The tables are held to the program by tests: their keys are those that the parser accepts, their defaults and choices those that the
//! program has, their ranges those that it refuses to leave.

mod dataset;
mod experiment;
mod render;
mod sweep;
#[cfg(test)]
mod tests;

pub(crate) use render::wrapped;
pub use render::{facts, json, markdown, text};

/// A kind of file.
#[derive(Debug)]
pub struct File {
    /// Its name: experiment, sweep or dataset.
    pub name: &'static str,
    /// What it is for.
    pub about: &'static str,
    /// Its tables, in the order of a file.
    pub sections: &'static [Section],
}

/// A table of a file.
#[derive(Debug)]
pub struct Section {
    /// Its name with dots; empty for keys outside of tables.
    pub name: &'static str,
    /// How it is written.
    pub heading: &'static str,
    /// What it describes.
    pub about: &'static str,
    /// Its keys.
    pub keys: &'static [Key],
}

/// A key.
#[derive(Debug)]
pub struct Key {
    /// Its name, with the unit.
    pub name: &'static str,
    /// What kind of value it takes.
    pub value: Value,
    /// The value where the file gives none.
    pub default: Default,
    /// What it goes with: other keys decide whether it may stand there. Empty: it always may.
    pub with: &'static str,
    /// What it means.
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
    /// A name of such a thing, out of a table of the program.
    Name(&'static str, fn() -> Vec<&'static str>),
    /// A list of such names.
    Names(&'static str, fn() -> Vec<&'static str>),
    /// Any text.
    Text,
    /// The name of a file, relative to the file that names it.
    Path,
    /// A list of numbers.
    Numbers,
    /// Something else, in words.
    Other(&'static str),
}

/// Ranges of numbers. Infinity and "not a number" lie in none.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Range {
    /// Any.
    Any,
    /// Above 0.
    Positive,
    /// 0 or more.
    NotNegative,
    /// Both ends belong to it.
    Between(f64, f64),
    /// Neither end belongs to it.
    Inside(f64, f64),
}

/// What holds where a file does not give a key.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Default {
    /// It must be given.
    Needed,
    /// A value, as TOML.
    Is(&'static str),
    /// The value of the material's preset: `parameter-2` and `parameter-4`.
    OfPreset(&'static str, &'static str),
    /// What happens, in words.
    Else(&'static str),
}

/// All files.
pub static FILES: [&File; 3] = [&experiment::FILE, &sweep::FILE, &dataset::FILE];

/// Units by the ends of names, longest first.
const UNITS: [(&str, &str); 14] = [
    ("_mm_per_s", "mm/s"),
    ("_per_s", "1/s"),
    ("_pm_per_v", "pm/V"),
    ("_g_cm3", "g/cm³"),
    ("_mm_s", "mm/s"),
    ("_m_s2", "m/s²"),
    ("_gpa", "GPa"),
    ("_deg", "°"),
    ("_um", "µm"),
    ("_kv_mm", "kV/mm"),
    ("_mm", "mm"),
    ("_hz", "Hz"),
    ("_s", "s"),
    ("_v", "V"),
];

/// The unit that stands in a name; empty for plain numbers.
pub fn unit(name: &str) -> &'static str {
    UNITS.iter().find(|(end, _)| name.ends_with(end)).map_or("", |(_, unit)| unit)
}

impl Section {
    /// A key's name with its table's.
    pub fn dotted(&self, key: &Key) -> String {
        if self.name.is_empty() { key.name.into() } else { format!("{}.{}", self.name, key.name) }
    }
}

const fn key(name: &'static str, value: Value, default: Default, about: &'static str) -> Key {
    Key { name, value, default, with: "", about }
}

impl Key {
    /// The same key, which goes with others only.
    const fn with(self, with: &'static str) -> Self {
        Self { with, ..self }
    }
}
