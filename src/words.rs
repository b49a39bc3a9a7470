//! Texts of messages: numbers, units of names, suggestions for unknown names, and parser errors in plain English.

/// Suffixes of names and their units; a longer suffix precedes those that it ends in.
const UNITS: [(&str, &str); 16] = [
    ("_mm_per_s", "mm/s"),
    ("_v_per_s", "V/s"),
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
    ("_erg", "erg"),
    ("_s", "s"),
    ("_v", "V"),
];

/// A name without its suffix, and the unit of the suffix; `None` for dimensionless quantities.
pub(crate) fn split_unit(name: &str) -> Option<(&str, &'static str)> {
    UNITS.iter().find_map(|(suffix, unit)| Some((name.strip_suffix(suffix)?, *unit)))
}

/// The shortest notation of a number: `1e300` without three hundred digits; `5` without `.0`.
pub(crate) fn number(value: f64) -> String {
    let text = format!("{value:?}");
    text.strip_suffix(".0").map_or(text.clone(), str::to_owned)
}

/// The known name with the fewest edits from `name`, if they are few or only the unit is missing.
fn nearest<'a>(name: &str, known: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    let plain = |name: &str| name.to_lowercase().replace('-', "_");
    let wanted = plain(name);
    let allowed = 1 + wanted.chars().count() / 5;
    let distance = |known: &str| {
        let known = plain(known);
        let without_unit = !wanted.is_empty() && known.strip_prefix(&wanted).is_some_and(|rest| rest.starts_with('_'));
        if without_unit { 1 } else { strsim::osa_distance(&wanted, &known) }
    };
    let near = |known: &'a str| Some((distance(known), known)).filter(|(distance, _)| *distance <= allowed);
    known.into_iter().filter_map(near).min_by_key(|(distance, _)| *distance).map(|(_, known)| known)
}

/// `; did you mean X?`; empty if no known name is near.
pub(crate) fn did_you_mean<'a>(name: &str, known: impl IntoIterator<Item = &'a str>) -> String {
    nearest(name, known).map_or_else(String::new, |known| format!("; did you mean {known}?"))
}

/// The message for a value that is not among the choices.
pub(crate) fn not_one_of(value: &str, choices: &[&str]) -> String {
    format!("{value:?} is not one of {}{}", choices.join(", "), did_you_mean(value, choices.iter().copied()))
}

/// The TOML parser's error with line, column and text, without names of Rust types.
pub(crate) fn toml_error(error: &toml::de::Error) -> String {
    let whole = error.to_string();
    let (whole, message) = (whole.trim_end(), error.message());
    match whole.rfind(message).filter(|_| !message.is_empty()) {
        Some(at) => format!("{}{}{}", &whole[..at], plain(message), &whole[at + message.len()..]),
        None => whole.to_owned(),
    }
}

/// The JSON parser's error with line and column, without names of Rust types.
pub(crate) fn json_error(error: &serde_json::Error) -> String {
    let text = error.to_string();
    match text.rsplit_once(" at line ") {
        Some((message, place)) => format!("{}, at line {place}", plain(message)),
        None => plain(&text),
    }
}

/// A message of serde in plain words; unknown forms are left unchanged.
fn plain(message: &str) -> String {
    if let Some((name, known)) = named(message, "unknown field `") {
        let hint = did_you_mean(name, known.iter().copied());
        return if hint.is_empty() {
            format!("there is no key {name} here; the keys are {}", known.join(", "))
        } else {
            format!("there is no key {name} here{hint} (`sfers help keys` lists all)")
        };
    }
    if let Some((name, known)) = named(message, "unknown variant `") {
        return not_one_of(name, &known);
    }
    if let Some((name, _)) = named(message, "missing field `") {
        return format!("the key {name} is missing");
    }
    let rest = message.strip_prefix("invalid type: ").or_else(|| message.strip_prefix("invalid value: "));
    match rest.and_then(|rest| rest.rsplit_once(", expected ")) {
        Some((found, expected)) => format!("this is {}, but {} is needed", kind_found(found), kind_needed(expected)),
        None => message.to_owned(),
    }
}

/// The name after `start`, and the names in backticks after "expected".
fn named<'a>(message: &'a str, start: &str) -> Option<(&'a str, Vec<&'a str>)> {
    let rest = message.strip_prefix(start)?;
    // A quoted key may contain backticks; the text after the name is serde's.
    let end = rest.rfind("`, expected ").or_else(|| rest.rfind("`, there are no")).or_else(|| rest.rfind('`'))?;
    let known = rest[end + 1..].split('`').skip(1).step_by(2).collect();
    Some((&rest[..end], known))
}

/// The value that serde found (`floating point `1.5``, `string "x"`, `map`) in plain words.
fn kind_found(found: &str) -> String {
    let inner = |start: &str| found.strip_prefix(start).and_then(|rest| rest.strip_suffix('`'));
    if let Some(value) = inner("floating point `") {
        return value.parse().map_or_else(|_| value.to_owned(), number);
    }
    if let Some(value) = inner("integer `").or_else(|| inner("boolean `")) {
        return value.to_owned();
    }
    match found {
        "sequence" => "a list".into(),
        "map" => "a table".into(),
        _ => found.strip_prefix("string ").map_or_else(|| found.to_owned(), |text| format!("the text {text}")),
    }
}

/// The kind of value that serde expected, from the name of the Rust type.
fn kind_needed(expected: &str) -> &str {
    match expected {
        "f64" => "a number",
        "usize" | "u64" | "u32" | "u16" | "u8" => "a whole number, 0 or more,",
        "a string" | "path string" => "a text in quotes",
        "a boolean" => "true or false",
        "a sequence" => "a list in brackets",
        "a map" => "a table of keys",
        other if other.starts_with("struct ") => "a table of keys",
        other => other,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_unit_is_that_of_the_longest_suffix() {
        for (name, split) in [
            ("width_mm", Some(("width", "mm"))),
            ("max_field_kv_mm", Some(("max_field", "kV/mm"))),
            ("rate_v_per_s", Some(("rate", "V/s"))),
            ("speed_mm_s", Some(("speed", "mm/s"))),
            ("steps", None),
        ] {
            assert_eq!(split_unit(name), split);
        }
        for (i, (suffix, _)) in UNITS.iter().enumerate() {
            assert!(UNITS[..i].iter().all(|(earlier, _)| !suffix.ends_with(earlier)), "{suffix} is never found");
        }
    }

    #[test]
    fn numbers_are_written_as_people_write_them() {
        for (value, text) in [
            (1e300, "1e300"),
            (5.0, "5"),
            (-0.25, "-0.25"),
            (1e-9, "1e-9"),
            (f64::NAN, "NaN"),
            (f64::MAX, "1.7976931348623157e308"),
        ] {
            assert_eq!(number(value), text);
        }
    }

    #[test]
    fn a_name_a_few_letters_off_is_suggested_and_another_word_is_not() {
        let known = ["actuators", "damping_eta", "duration_s", "jump-14hz", "low", "steps"];
        for (name, meant) in [
            ("actuator", "actuators"),
            ("dampnig_eta", "damping_eta"),
            ("Damping-Eta", "damping_eta"),
            ("duration", "duration_s"),
            ("duration_ms", "duration_s"),
            ("jump_14hz", "jump-14hz"),
            ("lwo", "low"),
        ] {
            assert_eq!(did_you_mean(name, known), format!("; did you mean {meant}?"));
        }
        for name in ["legs", "", "wavelength", "jumps-with-both-legs"] {
            assert_eq!(did_you_mean(name, known), "", "{name}");
        }
    }

    #[test]
    fn what_serde_says_is_said_without_rusts_types() {
        for (message, words) in [
            ("invalid type: string \"x\", expected f64", "this is the text \"x\", but a number is needed"),
            (
                "invalid type: string \"a, expected b\", expected usize",
                "this is the text \"a, expected b\", but a whole number, 0 or more, is needed",
            ),
            ("invalid value: integer `-3`, expected usize", "this is -3, but a whole number, 0 or more, is needed"),
            ("invalid type: map, expected a sequence", "this is a table, but a list in brackets is needed"),
            ("invalid type: integer `5`, expected struct RobotConfig", "this is 5, but a table of keys is needed"),
            (
                "unknown field `lenght`, expected `length` or `width`",
                "there is no key lenght here; did you mean length? (`sfers help keys` lists all)",
            ),
            ("unknown field `legs`, expected one of `low`, `high`", "there is no key legs here; the keys are low, high"),
            ("unknown variant `fitt`, expected one of `auto`, `fit`", "\"fitt\" is not one of auto, fit; did you mean fit?"),
            ("missing field `experiment`", "the key experiment is missing"),
            ("something else", "something else"),
        ] {
            assert_eq!(plain(message), words);
        }
        let huge = format!("invalid type: floating point `1{}.0`, expected usize", "0".repeat(300));
        assert_eq!(plain(&huge), "this is 1e300, but a whole number, 0 or more, is needed");
    }

    #[test]
    fn json_is_refused_with_its_line_in_plain_words() {
        let said = json_error(&serde_json::from_str::<Vec<f64>>("[1.0,\n\"x\"]").unwrap_err());
        assert_eq!(said, "this is the text \"x\", but a number is needed, at line 2 column 3");
    }

    #[test]
    fn the_parsers_line_column_and_text_stay() {
        #[derive(Debug, serde::Deserialize)]
        #[serde(deny_unknown_fields)]
        #[allow(dead_code)]
        struct File {
            length: f64,
        }
        let text = toml_error(&toml::from_str::<File>("# a\nlength = \"expected f64\"").unwrap_err());
        assert!(text.contains("line 2, column 10") && text.contains("length = \"expected f64\"\n"), "{text}");
        assert!(text.ends_with("this is the text \"expected f64\", but a number is needed"), "{text}");
    }
}
