//! Figures of a sweep's results.

use std::collections::BTreeSet;

use thiserror::Error;

use super::figure::Figure;
use super::heatmap::Categories;
use super::series::Mark;
use super::text::significant;

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

/// What of a sweep's results is drawn, and how.
#[derive(Debug, Clone, Default)]
pub struct View {
    /// Name of the sweep, which begins the title.
    pub name: String,
    /// A column; by default the first measure, and in curves over one key all of the same unit.
    pub measure: Option<String>,
    /// Only rows with these values of these keys.
    pub only: Vec<(String, String)>,
    /// Keys with a panel per value; by default those with the fewest values, until two are left.
    pub by: Vec<String>,
}

/// Panels of a figure at most.
const PANELS: usize = 20;
/// Curves of a panel at most; a map shows more.
const CURVES: usize = 5;

/// Draws `results.csv` as [`figure_of_results`] does, with the given measure and no other choice.
///
/// # Errors
/// As [`figure_of_results`].
pub fn results(text: &str, measure: Option<&str>) -> Result<String, ResultsError> {
    let view = View { measure: measure.map(String::from), ..View::default() };
    Ok(figure_of_results(text, &view)?.svg())
}

/// Draws `results.csv`: a curve over one varied key; over two a family of curves, or a map where both have more than five values; over
/// more the same once for each value of the others. Keys with a single value do not count.
///
/// # Errors
/// [`ResultsError`] if the text is no such table, or a choice does not fit it or is needed.
pub fn figure_of_results(text: &str, view: &View) -> Result<Figure, ResultsError> {
    let mut table = Table::read(text)?;
    table.keep(&view.only)?;
    let chosen = table.measure(view.measure.as_deref())?;
    let (varied, fixed): (Vec<usize>, Vec<usize>) = table.keys.iter().partition(|&&key| table.values(key).len() > 1);
    if varied.is_empty() {
        return Err(ResultsError::Choice("nothing varies in these results".into()));
    }
    let by = table.panels(&varied, &view.by)?;
    let axes: Vec<usize> = varied.iter().copied().filter(|key| !by.contains(key)).collect();
    let combinations = by.iter().fold(vec![Vec::new()], |all: Vec<Vec<(usize, String)>>, &key| {
        let values = table.values(key);
        all.iter().flat_map(|c| values.iter().map(move |v| c.iter().cloned().chain([(key, v.clone())]).collect())).collect()
    });

    let (x, lines) = match axes[..] {
        [x] => (x, None),
        // Few enough for a family of curves, which reads better than a map.
        [a, b] if table.values(a).len() <= CURVES => (b, Some(a)),
        [a, b] if table.values(b).len() <= CURVES => (a, Some(b)),
        [a, b] => (b, Some(a)),
        _ => return Err(ResultsError::Choice("no key is left for the x axis".into())),
    };
    let map = lines.is_some_and(|key| table.values(key).len() > CURVES);
    let unit = |m: usize| unit_of(&table.header[m]);
    let measures: Vec<usize> = match (lines, &view.measure) {
        (None, None) if by.is_empty() => table.measures.iter().copied().filter(|&m| unit(m) == unit(chosen)).collect(),
        _ => vec![chosen],
    };
    let y_label = match (map.then_some(lines).flatten(), &measures[..]) {
        (Some(rows), _) => label_of(&table.header[rows]),
        (None, [one]) => label_of(&table.header[*one]),
        (None, _) => unit(chosen).map_or_else(|| "value (–)".into(), |unit| format!("value ({unit})")),
    };
    let shown: Vec<&str> = [x].into_iter().chain(lines).chain(by.iter().copied()).map(|key| table.header[key].as_str()).collect();
    let what = if measures.len() > 1 { "measures".into() } else { words_of(&table.header[chosen]) };
    let mut figure = Figure::new(&title(&view.name, &what, &shown), &label_of(&table.header[x]), &y_label);
    figure.setting(&table.setting(&fixed, &measures));
    if !map {
        figure.x_texts(&table.texts(x));
    }
    for combination in combinations {
        let rows: Vec<&csv::StringRecord> =
            table.rows.iter().filter(|r| combination.iter().all(|(key, value)| r[*key] == *value)).collect();
        if !combination.is_empty() {
            let parts: Vec<_> = combination.iter().map(|(key, value)| equals(&table.header[*key], value)).collect();
            figure.small_multiple(&parts.join(", "));
        }
        if map && let Some(key) = lines {
            let (columns, lines) = (table.values(x), table.values(key));
            let cell =
                |y: &String, at: &String| rows.iter().find(|r| r[key] == *y && r[x] == *at).and_then(|r| number_in(r, chosen));
            let cells: Vec<_> = lines.iter().flat_map(|y| columns.iter().map(move |x| cell(y, x))).collect();
            let axis = |key: usize, texts: &[String]| Categories {
                label: label_of(&table.header[key]),
                texts: texts.iter().map(|t| short(t)).collect(),
            };
            figure.map(&axis(x, &columns), &axis(key, &lines), &cells, &label_of(&table.header[chosen]));
            continue;
        }
        if measures.iter().all(|&m| BEGIN_AT_ZERO.iter().any(|word| table.header[m].contains(word))) {
            figure.from_zero();
        }
        match lines {
            None => {
                for &m in &measures {
                    let label = if measures.len() > 1 { words_of(&table.header[m]) } else { String::new() };
                    figure.series(&label, table.curve(&rows, x, m), Mark::Both);
                }
            }
            Some(key) => {
                for value in table.values(key) {
                    let rows: Vec<_> = rows.iter().copied().filter(|r| r[key] == value).collect();
                    figure.series(&equals(&table.header[key], &value), table.curve(&rows, x, chosen), Mark::Both);
                }
            }
        }
    }
    Ok(figure)
}

/// Words in names of measures whose axis begins at 0.
const BEGIN_AT_ZERO: [&str; 7] = ["height", "amplitude", "share", "fraction", "aerial", "error", "rmse"];

/// The rows of `results.csv`, and which columns are keys and measures.
struct Table {
    header: Vec<String>,
    rows: Vec<csv::StringRecord>,
    keys: Vec<usize>,
    measures: Vec<usize>,
}

impl Table {
    fn read(text: &str) -> Result<Self, ResultsError> {
        let wrong = |reason: String| ResultsError::Table(reason);
        let mut reader = csv::Reader::from_reader(text.as_bytes());
        let header: Vec<String> = reader.headers().map_err(|error| wrong(error.to_string()))?.iter().map(String::from).collect();
        if header.last().map(String::as_str) != Some("status") {
            return Err(wrong("the last column is not `status`: these are not the results of a sweep".into()));
        }
        let rows = reader.records().collect::<Result<Vec<_>, _>>().map_err(|error| wrong(error.to_string()))?;
        if rows.is_empty() {
            return Err(wrong("there are no rows".into()));
        }
        let (keys, measures) = (0..header.len() - 1).partition(|&i| header[i].contains('.'));
        Ok(Self { header, rows, keys, measures })
    }

    /// Values of a column, in order: numbers by size, texts as they come.
    fn values(&self, column: usize) -> Vec<String> {
        let mut seen = BTreeSet::new();
        let mut values: Vec<_> = self.rows.iter().map(|r| r[column].to_owned()).filter(|v| seen.insert(v.clone())).collect();
        if self.numeric(column) {
            values.sort_by(|a, b| f64::total_cmp(&a.parse().unwrap_or(f64::NAN), &b.parse().unwrap_or(f64::NAN)));
        }
        values
    }

    fn numeric(&self, column: usize) -> bool {
        self.rows.iter().all(|r| number_in(r, column).is_some())
    }

    /// The texts of a column that holds other things than numbers.
    fn texts(&self, column: usize) -> Vec<String> {
        if self.numeric(column) { Vec::new() } else { self.values(column) }
    }

    /// A key by its name, or by the end of its name where that is enough.
    fn key(&self, name: &str) -> Result<usize, ResultsError> {
        let exact = self.keys.iter().copied().find(|&key| self.header[key] == name);
        let end = format!(".{name}");
        let mut ends = self.keys.iter().copied().filter(|&key| self.header[key].ends_with(&end));
        let only = match (ends.next(), ends.next()) {
            (Some(key), None) => Some(key),
            _ => None,
        };
        exact.or(only).ok_or_else(|| {
            let keys: Vec<_> = self.keys.iter().map(|&key| self.header[key].as_str()).collect();
            ResultsError::Choice(format!("there is no key {name}; choose from {}", keys.join(", ")))
        })
    }

    /// Keeps the rows with these values.
    fn keep(&mut self, only: &[(String, String)]) -> Result<(), ResultsError> {
        for (name, value) in only {
            let key = self.key(name)?;
            let wanted = value.parse::<f64>().ok();
            let same = |r: &csv::StringRecord| {
                r[key] == *value || wanted.zip(number_in(r, key)).is_some_and(|(a, b)| (a - b).abs() <= 1e-9 * a.abs())
            };
            if !self.rows.iter().any(same) {
                let values = listed(&self.values(key));
                return Err(ResultsError::Choice(format!("no row has {} = {value}; there are {values}", self.header[key])));
            }
            self.rows.retain(same);
        }
        Ok(())
    }

    fn measure(&self, name: Option<&str>) -> Result<usize, ResultsError> {
        match name {
            None => self.measures.first().copied().ok_or_else(|| ResultsError::Table("there is no measure".into())),
            Some(name) => self.measures.iter().copied().find(|&i| self.header[i] == name).ok_or_else(|| {
                let names: Vec<_> = self.measures.iter().map(|&i| self.header[i].as_str()).collect();
                ResultsError::Choice(format!("there is no measure {name}; choose from {}", names.join(", ")))
            }),
        }
    }

    /// Keys with a panel for each value: those asked for, and while more than two are left, the one with the fewest values.
    fn panels(&self, varied: &[usize], asked: &[String]) -> Result<Vec<usize>, ResultsError> {
        let mut by = Vec::new();
        for name in asked {
            let key = self.key(name)?;
            if !varied.contains(&key) {
                return Err(ResultsError::Choice(format!("{} has one value only", self.header[key])));
            }
            if !by.contains(&key) {
                by.push(key);
            }
        }
        let left = |by: &[usize]| varied.iter().copied().filter(|key| !by.contains(key)).collect::<Vec<_>>();
        while left(&by).len() > 2 {
            by.extend(left(&by).into_iter().min_by_key(|&key| self.values(key).len()));
        }
        let count: usize = by.iter().map(|&key| self.values(key).len()).product();
        if count > PANELS {
            let axes: Vec<_> =
                varied.iter().map(|&key| format!("{} ({})", self.header[key], listed(&self.values(key)))).collect();
            return Err(ResultsError::Choice(format!(
                "{} keys vary, which takes {count} panels, and a figure has {PANELS} at most: {}; choose rows by --where KEY=VALUE, or \
                 the key of the panels by --by KEY",
                varied.len(),
                axes.join(", ")
            )));
        }
        Ok(by)
    }

    fn curve(&self, rows: &[&csv::StringRecord], x: usize, measure: usize) -> Vec<(f64, f64)> {
        let texts = self.texts(x);
        let place = |r: &csv::StringRecord| {
            let of_text = texts.iter().position(|text| *text == r[x]).map(|i| i as f64);
            of_text.or_else(|| number_in(r, x)).unwrap_or(f64::NAN)
        };
        let mut points: Vec<_> = rows.iter().map(|r| (place(r), number_in(r, measure).unwrap_or(f64::NAN))).collect();
        points.sort_by(|a, b| a.0.total_cmp(&b.0));
        points
    }

    /// What does not vary, and how many values are missing.
    fn setting(&self, fixed: &[usize], measures: &[usize]) -> String {
        let mut parts: Vec<String> = fixed.iter().map(|&key| equals(&self.header[key], &self.rows[0][key])).collect();
        let lacks = |r: &&csv::StringRecord| measures.iter().any(|&m| number_in(r, m).is_none());
        let missing = self.rows.iter().filter(lacks).count();
        if missing > 0 {
            parts.push(format!("{missing} of {} runs without a value", self.rows.len()));
        }
        parts.join(", ")
    }
}

fn number_in(record: &csv::StringRecord, column: usize) -> Option<f64> {
    // Beyond 1e100, as in curves, nothing can be laid over pixels.
    record.get(column).and_then(|text| text.parse::<f64>().ok()).filter(|value| value.abs() < 1e100)
}

fn unit_of(name: &str) -> Option<String> {
    label_of(name).split_once(" (").map(|(_, unit)| unit.trim_end_matches(')').to_owned())
}

fn words_of(name: &str) -> String {
    label_of(name).split(" (").next().unwrap_or_default().to_owned()
}

/// "on time = 0.1 s".
fn equals(name: &str, value: &str) -> String {
    let unit = unit_of(name).map_or_else(String::new, |unit| if unit == "°" { unit } else { format!(" {unit}") });
    format!("{} = {}{unit}", words_of(name), short(value))
}

fn listed(values: &[String]) -> String {
    const MOST: usize = 12;
    let some: Vec<_> = values.iter().take(MOST).map(|v| short(v)).collect();
    if values.len() > MOST { format!("{}, … {} in all", some.join(", "), values.len()) } else { some.join(", ") }
}

fn title(name: &str, measure: &str, keys: &[&str]) -> String {
    let begin = if name.is_empty() { String::new() } else { format!("{name}: ") };
    let keys: Vec<_> = keys.iter().map(|key| words_of(key)).collect();
    let keys = match &keys[..] {
        [first @ .., last] if !first.is_empty() => format!("{} and {last}", first.join(", ")),
        _ => keys.concat(),
    };
    let mut text = format!("{begin}{measure} over {keys}");
    if let Some(first) = text.get(..1).filter(|_| name.is_empty()) {
        text = first.to_uppercase() + &text[1..];
    }
    text
}

/// A number as short as it can be told, other texts as they are.
fn short(text: &str) -> String {
    text.parse::<f64>().ok().filter(|v| v.is_finite()).map_or_else(|| text.to_owned(), |value| significant(value, 6))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const ONE: &str = "robot.x,drive.on_time_s,jump_height_mm,stride_mm,energy_error,status\n3,0.1,1.5,2,0,ok\n3,0.2,,,,failed: it\n3,0.3,2.5,2,0,ok\n";

    #[test]
    fn one_key_makes_curves_of_one_unit_and_two_a_family_or_a_map() {
        let svg = results(ONE, None).unwrap();
        assert!(
            svg.contains("on time (s)")
                && svg.contains("value (mm)")
                && svg.contains(">jump height<")
                && svg.contains(">stride<"),
            "{svg}"
        );
        assert!(!svg.contains("energy"));
        assert!(results(ONE, Some("energy_error")).unwrap().contains("energy error"));
        let two = |n: usize| {
            let rows: Vec<String> = (0..n * n).map(|i| format!("{},{},{},ok", i / n, i % n, i)).collect();
            results(&format!("a.b,c.d_hz,m_mm,status\n{}\n", rows.join("\n")), None).unwrap()
        };
        assert!(two(2).contains("b = 1") && !two(2).contains("class=\"cells\""));
        assert!(two(8).contains("class=\"cells\"") && !two(8).contains("c.d"));
        assert!(roxmltree::Document::parse(&two(8)).is_ok());
    }

    #[test]
    fn what_cannot_be_drawn_is_said() {
        assert!(results("a,b\n1,2\n", None).unwrap_err().to_string().contains("status"));
        assert!(results(ONE, Some("speed")).unwrap_err().to_string().contains("jump_height_mm"));
        let many: String = (0..300).map(|i| format!("{},{},{},{},1,ok\n", i % 20, i % 19, i % 17, i % 15)).collect();
        let error = results(&format!("a.a,a.b,a.c,a.d,m,status\n{many}"), None).unwrap_err().to_string();
        assert!(error.contains("4 keys") && error.contains("a.c (0, 1,") && error.contains("--where"), "{error}");
        assert!(results("a.a,m,status\n", None).is_err());
    }

    #[test]
    fn numbers_that_cannot_be_laid_over_pixels_are_missing_in_a_map() {
        let rows: Vec<String> = (0..36)
            .map(|i| {
                format!(
                    "{},{},{},ok",
                    i / 6,
                    i % 6,
                    if i == 3 {
                        "1e308"
                    } else if i == 9 {
                        "-1e308"
                    } else {
                        "1"
                    }
                )
            })
            .collect();
        let svg = results(&format!("a.b,c.d_hz,m_mm,status\n{}\n", rows.join("\n")), None).unwrap();
        assert!(!svg.contains("NaN") && !svg.contains("inf"), "{svg}");
    }

    proptest! {
        #[test]
        fn any_text_is_a_figure_or_an_error(text in ".{0,200}", rows in ".{0,80}") {
            let _ = results(&text, None);
            let _ = results(&format!("a.b,m,status\n{rows}"), Some("m"));
        }
    }
}
