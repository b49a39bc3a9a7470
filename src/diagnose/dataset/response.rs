//! Reading `[[frequency_response]]` and `[[steady]]` tables.

use std::collections::BTreeMap;
use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};

use super::read::{Reader, value_error};
use super::{AXES, DataError, MeasuredRun, Response, ResponseEntry, Role, Start, Steady};
use crate::model::Mount;
use crate::words::{self, number};

/// Frequencies (Hz) and standard deviations (mm) of a response.
const HERTZ: RangeInclusive<f64> = 1e-3..=1e4;
const SIGMA_MM: RangeInclusive<f64> = 1e-9..=1e5;
/// Largest amplitude (mm): beyond it the column has another unit.
const MOST_MM: f64 = 1e5;

impl Reader<'_> {
    /// A run without rows in time.
    fn without_rows(&self, id: String, path: PathBuf, role: Role) -> MeasuredRun {
        MeasuredRun {
            id,
            path,
            role,
            times: vec![0.0],
            voltages: Vec::new(),
            log: None,
            origin: 0.0,
            start: Start::Settled,
            has_clock: true,
            nominal: self.nominal.clone(),
            robot: self.robot.clone(),
            positions: self.markers.iter().map(|marker| marker.position).collect(),
            sigma: None,
            response: None,
            channels: vec![Vec::new(); 2 * self.markers.len()],
            remarks: Vec::new(),
        }
    }

    /// Columns or keys of the markers' coordinates.
    fn coordinates(&self) -> Vec<String> {
        self.markers.iter().flat_map(|marker| AXES.map(|axis| format!("{}_{axis}", marker.name))).collect()
    }

    /// Checks voltages, and that the robot is clamped, as a response or an equilibrium needs it.
    fn check(&self, voltages: &[f64]) -> Result<(), String> {
        if self.robot.mount != Mount::Clamped {
            return Err("needs a robot with mount = \"clamped\"".into());
        }
        let gain = self.nominal.robot.positive_gain.unwrap_or(1.0);
        for voltage in voltages {
            if !voltage.is_finite() {
                return Err(format!("is {voltage}, but must be a number"));
            }
            self.robot.check_voltage(*voltage, gain)?;
        }
        Ok(())
    }

    /// Reads a frequency response.
    ///
    /// # Errors
    /// [`DataError`] with file and line.
    pub(super) fn response(&self, index: usize, entry: &ResponseEntry) -> Result<MeasuredRun, DataError> {
        let number_of = index.to_string();
        let wrong = |key: &str, message: String| {
            let parts = ["frequency_response", number_of.as_str(), key];
            value_error(self.path, self.text, &parts, &format!("frequency_response {}: {key}", entry.id), message)
        };
        let ResponseEntry { amplitude_v, offset_v, .. } = *entry;
        let coordinates = self.coordinates();
        let names: Vec<&str> = coordinates.iter().map(String::as_str).collect();
        let channel = names.iter().position(|name| *name == entry.coordinate);
        let channel = channel.ok_or_else(|| wrong("coordinate", words::not_one_of(&entry.coordinate, &names)))?;
        if entry.id.trim().is_empty() {
            return Err(wrong("id", "is empty; every run needs a name".into()));
        }
        if amplitude_v.is_nan() || amplitude_v <= 0.0 {
            return Err(wrong(
                "amplitude_v",
                format!("is {}, but must be positive: the phase is that to the voltage", number(amplitude_v)),
            ));
        }
        if !SIGMA_MM.contains(&entry.sigma_mm) {
            return Err(wrong("sigma_mm", format!("is {}, but must be positive", number(entry.sigma_mm))));
        }
        self.check(&[offset_v + amplitude_v, offset_v - amplitude_v]).map_err(|reason| wrong("amplitude_v", reason))?;
        let path = self.path.parent().unwrap_or(Path::new("")).join(&entry.file);
        let bytes =
            crate::files::read(&path).map_err(|error| DataError::Unreadable { path: path.clone(), reason: error.to_string() })?;
        let (frequencies, parts) = parse(&bytes).map_err(|(line, column, reason)| DataError::Content {
            path: path.clone(),
            line: line.max(1),
            column,
            reason,
        })?;
        let mut run = self.without_rows(entry.id.clone(), path, entry.role);
        run.voltages = vec![offset_v; self.robot.actuators];
        run.sigma = Some(entry.sigma_mm);
        run.response = Some(Response { frequencies, channel, amplitude: amplitude_v, offset: offset_v, parts });
        Ok(run)
    }

    /// Reads an equilibrium.
    ///
    /// # Errors
    /// [`DataError`] with the line.
    pub(super) fn steady(&self, index: usize, entry: &Steady) -> Result<MeasuredRun, DataError> {
        let number_of = index.to_string();
        let wrong = |key: &str, message: String| {
            let parts = ["steady", number_of.as_str(), key];
            value_error(self.path, self.text, &parts, &format!("steady {}: {key}", index + 1), message)
        };
        let actuators = self.robot.actuators;
        if entry.voltages_v.len() != actuators {
            return Err(wrong("voltages_v", format!("has {} values for {actuators} actuators", entry.voltages_v.len())));
        }
        self.check(&entry.voltages_v).map_err(|reason| wrong("voltages_v", reason))?;
        if let Some(sigma) = entry.sigma_mm.filter(|sigma| !SIGMA_MM.contains(sigma)) {
            return Err(wrong("sigma_mm", format!("is {}, but must be positive", number(sigma))));
        }
        let coordinates: Vec<String> = self.coordinates().into_iter().map(|name| name + "_mm").collect();
        let mut run = self.without_rows(format!("steady-{}", index + 1), self.path.into(), entry.role);
        run.voltages.clone_from(&entry.voltages_v);
        run.sigma = entry.sigma_mm;
        for (key, value) in &entry.positions {
            let Some(channel) = coordinates.iter().position(|name| name == key) else {
                let names: Vec<&str> = coordinates.iter().map(String::as_str).chain(["voltages_v", "sigma_mm", "role"]).collect();
                return Err(wrong(key, format!("is no key of [[steady]]: {}", names.join(", "))));
            };
            if value.is_nan() || value.abs() > MOST_MM {
                return Err(wrong(key, format!("is {}, but must be within {MOST_MM:.0} mm", number(*value))));
            }
            run.channels[channel] = vec![*value];
        }
        if entry.positions.is_empty() {
            return Err(wrong("voltages_v", format!("stands without a position: add {}", coordinates.join(" or "))));
        }
        Ok(run)
    }
}

/// Frequencies (Hz) and in-phase and quadrature parts (mm) of a CSV of `f_hz`, `amplitude_mm` and `phase_deg` or `phase_rad`.
///
/// # Errors
/// Line and column, from 1, and what is wrong.
#[expect(clippy::type_complexity)]
fn parse(bytes: &[u8]) -> Result<(Vec<f64>, Vec<[f64; 2]>), (u64, usize, String)> {
    let mut reader = csv::ReaderBuilder::new().trim(csv::Trim::All).from_reader(bytes);
    let headers = reader.headers().map_err(|error| (1, 0, error.to_string()))?.clone();
    let mut columns: BTreeMap<&str, usize> = BTreeMap::new();
    for (at, header) in headers.iter().enumerate() {
        if header == "phase" {
            return Err((1, at + 1, "phase has no unit: call it phase_deg or phase_rad".into()));
        }
        if !["f_hz", "amplitude_mm", "phase_deg", "phase_rad"].contains(&header) {
            return Err((1, at + 1, format!("{header:?} is neither f_hz, amplitude_mm, phase_deg nor phase_rad")));
        }
        if columns.insert(header, at).is_some() {
            return Err((1, at + 1, format!("a second column {header}")));
        }
    }
    let needed = |name: &str| columns.get(name).copied().ok_or_else(|| (1, 0, format!("the column {name} is missing")));
    let (f, amplitude) = (needed("f_hz")?, needed("amplitude_mm")?);
    let (phase, unit) = match (columns.get("phase_deg"), columns.get("phase_rad")) {
        (Some(column), None) => (*column, 1.0_f64.to_radians()),
        (None, Some(column)) => (*column, 1.0),
        (None, None) => return Err((1, 0, "the column phase_deg (or phase_rad) is missing".into())),
        (Some(_), Some(column)) => return Err((1, column + 1, "phase_rad stands beside phase_deg: keep one of the two".into())),
    };
    let (mut frequencies, mut parts): (Vec<f64>, Vec<[f64; 2]>) = (Vec::new(), Vec::new());
    for record in reader.records() {
        let record = record.map_err(|error| (error.position().map_or(1, csv::Position::line), 0, error.to_string()))?;
        let line = record.position().map_or(1, csv::Position::line);
        let read = |column: usize| {
            let text = record.get(column).unwrap_or_default();
            let value = text.parse::<f64>().ok().filter(|value| value.is_finite());
            value.ok_or_else(|| (line, column + 1, format!("{}: {text:?} is not a number", &headers[column])))
        };
        let (hertz, size, angle) = (read(f)?, read(amplitude)?, read(phase)? * unit);
        if !HERTZ.contains(&hertz) || frequencies.last().is_some_and(|last| hertz <= *last) {
            let reason = format!("f_hz is {}; frequencies must rise, from 0.001 to 10000 Hz", number(hertz));
            return Err((line, f + 1, reason));
        }
        if !(0.0..=MOST_MM).contains(&size) {
            return Err((line, amplitude + 1, format!("amplitude_mm is {}, but must be 0 or more; is it in mm?", number(size))));
        }
        frequencies.push(hertz);
        parts.push([size * angle.cos(), size * angle.sin()]);
    }
    if frequencies.is_empty() {
        return Err((1, 0, "there are no rows below the header".into()));
    }
    Ok((frequencies, parts))
}
