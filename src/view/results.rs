//! Figures of a sweep's results.

mod table;

use thiserror::Error;

use super::figure::Figure;
use super::heatmap::Categories;
use super::series::Mark;
use super::text::significant;
use crate::words::split_unit;
use table::{Table, number_in};

/// Results that cannot be drawn.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum ResultsError {
    /// The text is not a table of a sweep.
    #[error("{0}")]
    Table(String),
    /// A choice does not fit the table, or is missing because the table has more than a figure can show.
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
    let short = name.split_once('.').map_or(name, |(_, rest)| rest).replace('.', " ");
    match split_unit(&short) {
        Some((words, unit)) => format!("{} ({unit})", words.replace('_', " ")),
        None => short.replace('_', " "),
    }
}

/// Choice of what is drawn of a sweep's results.
#[derive(Debug, Clone, Default)]
pub struct View {
    /// Name of the sweep, the beginning of the title.
    pub name: String,
    /// Name of a measure; by default the first, and in curves over one key all of its unit.
    pub measure: Option<String>,
    /// Keys and values that select rows.
    pub only: Vec<(String, String)>,
    /// Keys with a panel per value; by default those with the fewest values, until two keys are left.
    pub by: Vec<String>,
}

/// Largest number of curves in a panel; a map shows more.
const CURVES: usize = 5;

/// Draws `results.csv` as [`figure_of_results`] does, with the given measure and no other choice.
///
/// # Errors
/// As [`figure_of_results`].
pub fn results(text: &str, measure: Option<&str>) -> Result<String, ResultsError> {
    let view = View { measure: measure.map(String::from), ..View::default() };
    Ok(figure_of_results(text, &view)?.svg())
}

/// Draws `results.csv`: a curve over one varied key; over two keys a family of curves, or a map if both have more than five values; over
/// more keys one such panel for each value of the others. Keys with a single value do not count.
///
/// # Errors
/// [`ResultsError`] if the text is no such table, or if a choice does not fit it or is missing.
pub fn figure_of_results(text: &str, view: &View) -> Result<Figure, ResultsError> {
    let mut table = Table::read(text)?;
    table.keep(&view.only)?;
    let plot = Plot::choose(&table, view)?;
    let mut figure = plot.empty_figure(&view.name);
    let by = &plot.by;
    let combinations = by.iter().fold(vec![Vec::new()], |all: Vec<Vec<(usize, String)>>, &key| {
        let values = table.values(key);
        all.iter().flat_map(|c| values.iter().map(move |v| c.iter().cloned().chain([(key, v.clone())]).collect())).collect()
    });
    for combination in combinations {
        let rows: Vec<&csv::StringRecord> =
            table.rows.iter().filter(|r| combination.iter().all(|(key, value)| r[*key] == *value)).collect();
        if !combination.is_empty() {
            let parts: Vec<_> = combination.iter().map(|(key, value)| equals(&table.header[*key], value)).collect();
            figure.small_multiple(&parts.join(", "));
        }
        match plot.lines {
            Some(lines) if plot.is_map => plot.add_map(&mut figure, &rows, lines),
            _ => plot.add_curves(&mut figure, &rows),
        }
    }
    Ok(figure)
}

/// The columns of a table that a figure shows, and how.
struct Plot<'a> {
    table: &'a Table,
    /// Key of the x axis.
    x: usize,
    /// Key with a curve, or a row of a map, for each value.
    lines: Option<usize>,
    /// Keys with a panel for each value.
    by: Vec<usize>,
    /// Keys with a single value.
    fixed: Vec<usize>,
    /// Measures drawn, of one unit; more than one only over a single key.
    measures: Vec<usize>,
    is_map: bool,
}

impl<'a> Plot<'a> {
    fn choose(table: &'a Table, view: &View) -> Result<Self, ResultsError> {
        let chosen = table.measure(view.measure.as_deref())?;
        let (varied, fixed): (Vec<usize>, Vec<usize>) = table.keys.iter().partition(|&&key| table.values(key).len() > 1);
        if varied.is_empty() {
            return Err(ResultsError::Choice("nothing varies in these results".into()));
        }
        let by = table.panels(&varied, &view.by)?;
        let axes: Vec<usize> = varied.iter().copied().filter(|key| !by.contains(key)).collect();
        let (x, lines) = match axes[..] {
            [x] => (x, None),
            // A family of few curves is easier to read than a map.
            [a, b] if table.values(a).len() <= CURVES => (b, Some(a)),
            [a, b] if table.values(b).len() <= CURVES => (a, Some(b)),
            [a, b] => (b, Some(a)),
            _ => return Err(ResultsError::Choice("no key is left for the x axis".into())),
        };
        let unit = |m: usize| unit_of(&table.header[m]);
        let measures: Vec<usize> = match (lines, &view.measure) {
            (None, None) if by.is_empty() => table.measures.iter().copied().filter(|&m| unit(m) == unit(chosen)).collect(),
            _ => vec![chosen],
        };
        let is_map = lines.is_some_and(|key| table.values(key).len() > CURVES);
        Ok(Self { table, x, lines, by, fixed, measures, is_map })
    }

    /// The figure with title and labels, without data.
    fn empty_figure(&self, name: &str) -> Figure {
        let Self { table, x, lines, by, measures, is_map, .. } = self;
        let header = &table.header;
        let y_label = match (lines.filter(|_| *is_map), &measures[..]) {
            (Some(rows), _) => label_of(&header[rows]),
            (None, [one]) => label_of(&header[*one]),
            (None, _) => unit_of(&header[measures[0]]).map_or_else(|| "value (–)".into(), |unit| format!("value ({unit})")),
        };
        let shown: Vec<&str> = [*x].into_iter().chain(*lines).chain(by.iter().copied()).map(|key| header[key].as_str()).collect();
        let what = if measures.len() > 1 { "measures".into() } else { words_of(&header[measures[0]]) };
        let mut figure = Figure::new(&title(name, &what, &shown), &label_of(&header[*x]), &y_label);
        figure.setting(&table.setting(&self.fixed, measures));
        if !is_map {
            figure.x_texts(&table.texts(*x));
        }
        figure
    }

    /// Adds a map of the measure, with a row for each value of `lines`.
    fn add_map(&self, figure: &mut Figure, rows: &[&csv::StringRecord], lines: usize) {
        let Self { table, x, measures, .. } = self;
        let (x, measure) = (*x, measures[0]);
        let (columns, values) = (table.values(x), table.values(lines));
        let cell =
            |y: &String, at: &String| rows.iter().find(|r| r[lines] == *y && r[x] == *at).and_then(|r| number_in(r, measure));
        let cells: Vec<_> = values.iter().flat_map(|y| columns.iter().map(move |x| cell(y, x))).collect();
        let axis = |key: usize, texts: &[String]| Categories {
            label: label_of(&table.header[key]),
            texts: texts.iter().map(|t| short(t)).collect(),
        };
        figure.map(&axis(x, &columns), &axis(lines, &values), &cells, &label_of(&table.header[measure]));
    }

    /// Adds a curve for each measure, or for each value of the key of lines.
    fn add_curves(&self, figure: &mut Figure, rows: &[&csv::StringRecord]) {
        let Self { table, x, measures, .. } = self;
        if measures.iter().all(|&m| BEGIN_AT_ZERO.iter().any(|word| table.header[m].contains(word))) {
            figure.from_zero();
        }
        match self.lines {
            None => {
                for &m in measures {
                    let label = if measures.len() > 1 { words_of(&table.header[m]) } else { String::new() };
                    self.add_band(figure, rows, m);
                    figure.series(&label, table.curve(rows, *x, m), Mark::Both);
                }
            }
            Some(key) => {
                for value in table.values(key) {
                    let rows: Vec<_> = rows.iter().copied().filter(|r| r[key] == value).collect();
                    self.add_band(figure, &rows, measures[0]);
                    figure.series(&equals(&table.header[key], &value), table.curve(&rows, *x, measures[0]), Mark::Both);
                }
            }
        }
    }
}

impl Plot<'_> {
    /// Adds the band from 5 to 95 % of an ensemble.
    fn add_band(&self, figure: &mut Figure, rows: &[&csv::StringRecord], measure: usize) {
        if let Some(ends) = self.table.band(measure) {
            let [low, high] = ends.map(|column| self.table.curve(rows, self.x, column));
            figure.band(low.into_iter().zip(high).map(|((x, low), (_, high))| (x, low, high)));
        }
    }
}

/// Words in the names of measures whose axis begins at 0.
const BEGIN_AT_ZERO: [&str; 7] = ["height", "amplitude", "share", "fraction", "aerial", "error", "rmse"];

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

/// A number with at most six significant digits; other texts unchanged.
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
        assert!(results("a.a,m,status\n", None).unwrap_err().to_string().contains("no rows"));
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
