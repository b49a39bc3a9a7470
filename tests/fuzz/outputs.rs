//! What every output has to be: whole, readable, and without a number that is not finite.

use serde_json::Value;
use sfers::recording::Recording;

/// Nothing, or what is wrong.
pub type Checked = Result<(), String>;

pub fn finite(what: &str, values: &[f64]) -> Checked {
    match values.iter().position(|value| !value.is_finite()) {
        Some(at) => Err(format!("not finite: {what} [{at}] = {}", values[at])),
        None => Ok(()),
    }
}

pub fn recording(r: &Recording) -> Checked {
    let (t, j) = (r.len(), r.joints());
    for (what, values, width) in [
        ("time", &r.time, 1),
        ("angles", &r.angles, j),
        ("rates", &r.rates, j),
        ("torques", &r.torques, j),
        ("motor voltages", &r.motor_voltages, j),
        ("positions", &r.positions, 3 * (j + 2)),
        ("velocities", &r.velocities, 3 * (j + 2)),
    ] {
        if values.len() != t * width {
            return Err(format!("{what}: {} values in {t} records of {width}", values.len()));
        }
        finite(what, values)?;
    }
    Ok(())
}

/// No null in a JSON value but under `optional` keys: that is what a number that is not finite is written as.
pub fn json(what: &str, value: &Value, optional: &[&str]) -> Checked {
    match value {
        Value::Null => Err(format!("not finite: {what} is null")),
        Value::Array(list) => list.iter().try_for_each(|item| json(&format!("{what}[]"), item, optional)),
        Value::Object(fields) => fields.iter().try_for_each(|(key, item)| match item {
            Value::Null if optional.contains(&key.as_str()) => Ok(()),
            _ => json(&format!("{what}.{key}"), item, optional),
        }),
        _ => Ok(()),
    }
}

/// An SVG is XML, and no attribute holds a number that is not finite. Texts are the user's.
pub fn svg(text: &str) -> Checked {
    xml("svg", text, &[]).map(drop)
}

/// XML without such numbers in attributes other than `names`.
pub fn xml<'a>(what: &str, text: &'a str, names: &[&str]) -> Result<roxmltree::Document<'a>, String> {
    let document = roxmltree::Document::parse(text).map_err(|error| format!("{what} is no XML: {error}"))?;
    for attribute in document.descendants().flat_map(|node| node.attributes()) {
        let value = attribute.value();
        if !names.contains(&attribute.name()) && (value.contains("NaN") || value.contains("inf")) {
            return Err(format!("not finite: {what}, attribute {} = {value:.80}", attribute.name()));
        }
    }
    Ok(document)
}

/// Every cell below the header is a finite number; `holes` may be empty.
pub fn table(what: &str, bytes: &[u8], holes: bool) -> Checked {
    let mut reader = csv::Reader::from_reader(bytes);
    for record in reader.records() {
        let record = record.map_err(|error| format!("{what} is no table: {error}"))?;
        for cell in record.iter().filter(|cell| !(holes && cell.is_empty())) {
            if !cell.parse::<f64>().is_ok_and(f64::is_finite) {
                return Err(format!("not finite: {what}: {cell}"));
            }
        }
    }
    Ok(())
}

/// The page's data hold numbers only.
pub fn player(html: &str) -> Checked {
    let at = html.find("{\"actuators\":").ok_or("the page has no data")?;
    let mut values = serde_json::Deserializer::from_str(&html[at..]).into_iter::<Value>();
    let data = values.next().ok_or("the page has no data")?.map_err(|error| format!("the page's data are no JSON: {error}"))?;
    json("page", &data, &[])
}
