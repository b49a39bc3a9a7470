//! Figures of a sweep's results.

use std::collections::BTreeSet;

use thiserror::Error;

use super::figure::{Figure, Mark};
use super::heatmap::{Categories, heat_map};

/// Results that cannot be drawn.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum ResultsError {
    /// The table is not one that a sweep makes.
    #[error("{0}")]
    Table(String),
    /// The table has more than a figure can show.
    #[error("{0}")]
    Choice(String),
}

/// A key or measure as the label of an axis: its last part in words, its unit in parentheses.
///
/// ```
/// assert_eq!(sfers::view::label_of("drive.on_time_s"), "on time (s)");
/// assert_eq!(sfers::view::label_of("speed_mm_s"), "speed (mm/s)");
/// assert_eq!(sfers::view::label_of("robot.friction.low"), "friction low");
/// ```
pub fn label_of(name: &str) -> String {
    const UNITS: [(&str, &str); 12] = [
        ("_mm_s", "mm/s"),
        ("_m_s2", "m/s²"),
        ("_g_cm3", "g/cm³"),
        ("_pm_per_v", "pm/V"),
        ("_mm", "mm"),
        ("_um", "µm"),
        ("_gpa", "GPa"),
        ("_hz", "Hz"),
        ("_deg", "°"),
        ("_s", "s"),
        ("_v", "V"),
        ("_erg", "erg"),
    ];
    let short = name.split_once('.').map_or(name, |(_, rest)| rest).replace('.', " ");
    let found = UNITS.iter().find_map(|(suffix, unit)| Some((short.strip_suffix(suffix)?, unit)));
    match found {
        Some((words, unit)) => format!("{} ({unit})", words.replace('_', " ")),
        None => short.replace('_', " "),
    }
}

/// Draws `results.csv`: a curve over one varied key, a map over two. Keys that have a single value do not count. `measure` chooses a
/// column; by default curves show all measures of the first one's unit and maps the first one.
///
/// # Errors
/// [`ResultsError`] if the text is no such table, or more than two keys vary.
pub fn results(text: &str, measure: Option<&str>) -> Result<String, ResultsError> {
    let table = |reason: String| ResultsError::Table(reason);
    let mut reader = csv::Reader::from_reader(text.as_bytes());
    let header: Vec<String> = reader.headers().map_err(|error| table(error.to_string()))?.iter().map(String::from).collect();
    if header.last().map(String::as_str) != Some("status") {
        return Err(table("the last column is not `status`: these are not the results of a sweep".into()));
    }
    let records = reader.records().collect::<Result<Vec<_>, _>>().map_err(|error| table(error.to_string()))?;
    if records.is_empty() {
        return Err(table("there are no rows".into()));
    }
    let (keys, measures): (Vec<usize>, Vec<usize>) = (0..header.len() - 1).partition(|&i| header[i].contains('.'));
    let values_of = |column: usize| {
        let mut seen = BTreeSet::new();
        records.iter().map(|r| r[column].to_owned()).filter(|v| seen.insert(v.clone())).collect::<Vec<_>>()
    };
    let varied: Vec<usize> = keys.into_iter().filter(|&key| values_of(key).len() > 1).collect();
    let chosen = match measure {
        None => *measures.first().ok_or_else(|| table("there is no measure".into()))?,
        Some(name) => measures.iter().copied().find(|&i| header[i] == name).ok_or_else(|| {
            let names: Vec<_> = measures.iter().map(|&i| header[i].as_str()).collect();
            ResultsError::Choice(format!("there is no measure {name}; choose from {}", names.join(", ")))
        })?,
    };
    let number = |record: &csv::StringRecord, column: usize| record[column].parse::<f64>().ok();
    let curve = |column: usize, x: usize, of: &dyn Fn(&csv::StringRecord) -> bool| {
        let point =
            |(i, r): (usize, &csv::StringRecord)| (number(r, x).unwrap_or(i as f64), number(r, column).unwrap_or(f64::NAN));
        records.iter().filter(|r| of(r)).enumerate().map(point).collect::<Vec<_>>()
    };
    match varied[..] {
        [] => Err(ResultsError::Choice("nothing varies in these results".into())),
        [x] => {
            let unit = |name: &str| label_of(name).split_once(" (").map(|(_, unit)| unit.to_owned());
            let shown: Vec<usize> = match measure {
                Some(_) => vec![chosen],
                None => measures.into_iter().filter(|&m| unit(&header[m]) == unit(&header[chosen])).collect(),
            };
            let y_label = match shown[..] {
                [one] => label_of(&header[one]),
                _ => format!("({}", unit(&header[chosen]).unwrap_or_else(|| "–)".into())),
            };
            let mut figure = Figure::new(&title(&header[chosen], &[&header[x]]), &label_of(&header[x]), &y_label);
            for &column in &shown {
                let label = if shown.len() > 1 { label_of(&header[column]) } else { String::new() };
                figure.series(&label, curve(column, x, &|_| true), Mark::Both);
            }
            Ok(figure.svg())
        }
        [a, b] if values_of(a).len() <= 5 => {
            // Few enough for a family of curves, which reads better than a map.
            let mut figure = Figure::new(
                &title(&header[chosen], &[&header[b], &header[a]]),
                &label_of(&header[b]),
                &label_of(&header[chosen]),
            );
            for value in values_of(a) {
                figure.series(&format!("{} = {value}", label_of(&header[a])), curve(chosen, b, &|r| r[a] == value), Mark::Both);
            }
            Ok(figure.svg())
        }
        [a, b] => {
            let (rows, columns) = (values_of(a), values_of(b));
            let cell = |y: &String, x: &String| records.iter().find(|r| r[a] == *y && r[b] == *x).and_then(|r| number(r, chosen));
            let cells: Vec<_> = rows.iter().flat_map(|y| columns.iter().map(move |x| cell(y, x))).collect();
            let axis = |key: usize, texts: &[String]| Categories {
                label: label_of(&header[key]),
                texts: texts.iter().map(|t| short(t)).collect(),
            };
            Ok(heat_map(
                &title(&header[chosen], &[&header[b], &header[a]]),
                &label_of(&header[chosen]),
                &axis(b, &columns),
                &axis(a, &rows),
                &cells,
            ))
        }
        _ => {
            let names: Vec<_> = varied.iter().map(|&i| header[i].as_str()).collect();
            Err(ResultsError::Choice(format!(
                "{} keys vary ({}), and a figure shows two; filter the rows first",
                names.len(),
                names.join(", ")
            )))
        }
    }
}

fn title(measure: &str, keys: &[&str]) -> String {
    let plain = |name: &str| label_of(name).split(" (").next().unwrap_or_default().to_owned();
    let mut text = plain(measure);
    if let Some(first) = text.get(..1) {
        text = first.to_uppercase() + &text[1..];
    }
    format!("{text} over {}", keys.iter().map(|key| plain(key)).collect::<Vec<_>>().join(" and "))
}

/// A number as short as it can be told, other texts as they are.
fn short(text: &str) -> String {
    text.parse::<f64>().map_or_else(|_| text.to_owned(), |value| format!("{}", (value * 1e6).round() / 1e6))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const ONE: &str = "robot.x,drive.on_time_s,jump_height_mm,stride_mm,energy_error,status\n3,0.1,1.5,2,0,ok\n3,0.2,,,,failed: it\n3,0.3,2.5,2,0,ok\n";

    #[test]
    fn one_key_makes_curves_of_one_unit_and_two_a_family_or_a_map() {
        let svg = results(ONE, None).unwrap();
        assert!(svg.contains("on time (s)") && svg.contains("jump height (mm)") && svg.contains("stride (mm)"), "{svg}");
        assert!(!svg.contains("energy"));
        assert!(results(ONE, Some("energy_error")).unwrap().contains("energy error"));
        let two = |n: usize| {
            let rows: Vec<String> = (0..n * 3).map(|i| format!("{},{},{},ok", i / 3, i % 3, i)).collect();
            results(&format!("a.b,c.d_hz,m_mm,status\n{}\n", rows.join("\n")), None).unwrap()
        };
        assert!(
            two(2).contains("b = 1") && two(8).contains("url(#none)") != two(8).contains("#440154") || two(8).contains("#440154")
        );
        assert!(roxmltree::Document::parse(&two(8)).is_ok());
    }

    #[test]
    fn what_cannot_be_drawn_is_said() {
        assert!(results("a,b\n1,2\n", None).unwrap_err().to_string().contains("status"));
        assert!(results(ONE, Some("speed")).unwrap_err().to_string().contains("jump_height_mm"));
        let three = "a.a,a.b,a.c,m,status\n1,1,1,1,ok\n2,2,2,2,ok\n";
        assert!(results(three, None).unwrap_err().to_string().contains("3 keys"));
        assert!(results("a.a,m,status\n", None).is_err());
    }

    proptest! {
        #[test]
        fn any_text_is_a_figure_or_an_error(text in ".{0,200}", rows in ".{0,80}") {
            let _ = results(&text, None);
            let _ = results(&format!("a.b,m,status\n{rows}"), Some("m"));
        }
    }
}
