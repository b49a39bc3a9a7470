//! Arguments from Python. Every refusal names the argument.

use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;
use pyo3::types::PyFloat;
use sfers::bullet::Pose;

use super::refuse;

/// A finite number.
pub fn number(name: &str, value: &Bound<'_, PyAny>) -> PyResult<f64> {
    let number = match value.cast_exact::<PyFloat>() {
        Ok(float) => float.value(),
        Err(_) => {
            value.extract::<f64>().map_err(|_| PyTypeError::new_err(format!("{name} must be a number, not {}", kind(value))))?
        }
    };
    if number.is_finite() { Ok(number) } else { Err(refuse(format!("{name} is {number}, but must be finite"))) }
}

/// A number of zero or more.
pub fn not_negative(name: &str, value: &Bound<'_, PyAny>) -> PyResult<f64> {
    let number = number(name, value)?;
    if number >= 0.0 { Ok(number) } else { Err(refuse(format!("{name} is {number}, but must not be negative"))) }
}

/// A number above zero.
pub fn positive(name: &str, value: &Bound<'_, PyAny>) -> PyResult<f64> {
    let number = number(name, value)?;
    if number > 0.0 { Ok(number) } else { Err(refuse(format!("{name} is {number}, but must be positive"))) }
}

/// A whole number.
pub fn integer(name: &str, value: &Bound<'_, PyAny>) -> PyResult<i32> {
    value.extract::<i32>().map_err(|cause| {
        if value.extract::<f64>().is_err() || value.is_instance_of::<PyFloat>() {
            PyTypeError::new_err(format!("{name} must be an integer, not {}", kind(value)))
        } else {
            refuse(format!("{name}: {cause}"))
        }
    })
}

/// The items of a sequence, of a NumPy array or of any other iterable.
pub fn items<'py>(name: &str, value: &Bound<'py, PyAny>) -> PyResult<Vec<Bound<'py, PyAny>>> {
    const LARGEST: usize = 1 << 16;
    let refusal = |_| PyTypeError::new_err(format!("{name} must be a sequence, not {}", kind(value)));
    let length = value.len().map_err(refusal)?;
    if length > LARGEST {
        return Err(refuse(format!("{name} has {length} values, which is too many")));
    }
    value.try_iter().map_err(refusal)?.take(LARGEST).collect()
}

/// As many numbers as the array has, all finite.
pub fn numbers<const N: usize>(name: &str, value: &Bound<'_, PyAny>) -> PyResult<[f64; N]> {
    let values = items(name, value)?;
    if values.len() != N {
        return Err(refuse(format!("{name} has {} values, but must have {N}", values.len())));
    }
    let mut out = [0.0; N];
    for (out, value) in out.iter_mut().zip(&values) {
        *out = number(name, value)?;
    }
    Ok(out)
}

/// The same if the argument is given, else `default`.
pub fn numbers_or<const N: usize>(name: &str, value: Option<&Bound<'_, PyAny>>, default: [f64; N]) -> PyResult<[f64; N]> {
    value.map_or(Ok(default), |value| numbers(name, value))
}

/// Numbers that may be neither NaN nor infinite, one per item.
pub fn number_list(name: &str, value: &Bound<'_, PyAny>) -> PyResult<Vec<f64>> {
    items(name, value)?.iter().map(|value| number(name, value)).collect()
}

/// Whole numbers, one per item.
pub fn integer_list(name: &str, value: &Bound<'_, PyAny>) -> PyResult<Vec<i32>> {
    items(name, value)?.iter().map(|value| integer(name, value)).collect()
}

/// A quaternion x, y, z, w that is not zero.
pub fn quaternion(name: &str, q: [f64; 4]) -> PyResult<[f64; 4]> {
    let square: f64 = q.iter().map(|v| v * v).sum();
    if square > 1e-12 && square.is_finite() { Ok(q) } else { Err(refuse(format!("{name} is no rotation: {q:?}"))) }
}

/// Position and orientation, where given.
pub fn pose(names: [&str; 2], position: Option<&Bound<'_, PyAny>>, orientation: Option<&Bound<'_, PyAny>>) -> PyResult<Pose> {
    let Pose { position: origin, orientation: unit } = Pose::IDENTITY;
    Ok(Pose {
        position: numbers_or(names[0], position, origin)?,
        orientation: quaternion(names[1], numbers_or(names[1], orientation, unit)?)?,
    })
}

fn kind(value: &Bound<'_, PyAny>) -> String {
    value.get_type().name().map_or_else(|_| "this".into(), |name| name.to_string())
}
