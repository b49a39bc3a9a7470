//! Arrays of numpy's NPY format from untrusted files: the header is checked against the content.
//!
//! Format: <https://numpy.org/doc/stable/reference/generated/numpy.lib.format.html>. Memory grows with the data read, up to the size in the header.

use std::io::Read;

use ndarray::{ArrayD, IxDyn, ShapeBuilder};
use py_literal::Value;

/// Longest header that is read (bytes); numpy writes 128 for arrays of numbers.
const LONGEST_HEADER: usize = 4096;

/// An array of numbers, in C order.
#[derive(Debug)]
pub struct Array {
    pub shape: Vec<usize>,
    pub values: Vec<f64>,
}

/// The fields of a header.
struct Header {
    descr: String,
    fortran_order: bool,
    shape: Vec<usize>,
}

/// Reads an array of floats or integers of at most `most` numbers.
///
/// # Errors
/// A message, if the header or the content is not that of such an array.
pub fn read(mut reader: impl Read, most: usize) -> Result<Array, String> {
    let Header { descr, fortran_order, shape } = header(&mut reader)?;
    let size = element_size(&descr)?;
    let count = shape.iter().try_fold(1_usize, |count, axis| count.checked_mul(*axis)).filter(|count| *count <= most);
    let count = count.ok_or_else(|| format!("the shape is {shape:?}: more numbers than {most}, the most that are read"))?;
    let mut bytes = Vec::new();
    reader.take(count as u64 * size as u64 + 1).read_to_end(&mut bytes).map_err(|error| error.to_string())?;
    let excess = match bytes.len().cmp(&(count * size)) {
        std::cmp::Ordering::Less => "is cut short",
        std::cmp::Ordering::Equal => "",
        std::cmp::Ordering::Greater => "holds more bytes",
    };
    if !excess.is_empty() {
        return Err(format!("the shape is {shape:?} of {descr}, and the array {excess}"));
    }
    let values: Vec<f64> = bytes.chunks_exact(size).map(|bytes| number(&descr, bytes)).collect();
    if !fortran_order {
        return Ok(Array { shape, values });
    }
    let array = ArrayD::from_shape_vec(IxDyn(&shape).f(), values).map_err(|error| error.to_string())?;
    Ok(Array { shape, values: array.iter().copied().collect() })
}

fn header(reader: &mut impl Read) -> Result<Header, String> {
    let mut read = |bytes: &mut [u8]| reader.read_exact(bytes).map_err(|error| format!("not an NPY array: {error}"));
    let mut start = [0; 8];
    read(&mut start)?;
    if start[..6] != *b"\x93NUMPY" {
        return Err("not an NPY array".into());
    }
    let length = match start[6] {
        1 => {
            let mut length = [0; 2];
            read(&mut length)?;
            usize::from(u16::from_le_bytes(length))
        }
        2 | 3 => {
            let mut length = [0; 4];
            read(&mut length)?;
            u32::from_le_bytes(length) as usize
        }
        other => return Err(format!("NPY version {other} is not known")),
    };
    if length > LONGEST_HEADER {
        return Err(format!("its header claims {length} bytes; at most {LONGEST_HEADER} are read"));
    }
    let mut text = vec![0; length];
    read(&mut text)?;
    let text = String::from_utf8(text).map_err(|_| "its header is not text")?;
    // The parser of literals recurses at every bracket.
    if text.bytes().filter(|b| b"([{".contains(b)).count() > 8 {
        return Err("its header is not that of an array of numbers".into());
    }
    let Ok(Value::Dict(fields)) = text.trim().parse::<Value>() else { return Err("its header is not a dictionary".into()) };
    let field =
        |name: &str| fields.iter().find(|(key, _)| key.as_string().is_some_and(|key| key == name)).map(|(_, value)| value);
    match (field("descr"), field("fortran_order"), field("shape").and_then(Value::as_tuple)) {
        (Some(Value::String(descr)), Some(Value::Boolean(fortran_order)), Some(shape)) => {
            let axis = |value: &Value| value.as_integer().and_then(|axis| usize::try_from(axis).ok());
            let shape = shape.iter().map(axis).collect::<Option<_>>().ok_or("its shape is not one of an array in memory")?;
            Ok(Header { descr: descr.clone(), fortran_order: *fortran_order, shape })
        }
        _ => Err("its header lacks descr, fortran_order or shape, or is not that of an array of numbers".into()),
    }
}

fn element_size(descr: &str) -> Result<usize, String> {
    match descr {
        "<f8" | ">f8" | "<i8" | ">i8" => Ok(8),
        "<f4" | ">f4" | "<i4" | ">i4" => Ok(4),
        _ => Err(format!("numbers of type {descr:?} are not read, only floats and integers of 4 or 8 bytes")),
    }
}

/// One number from [`element_size`] bytes.
fn number(descr: &str, bytes: &[u8]) -> f64 {
    let mut little = [0; 8];
    little[..bytes.len()].copy_from_slice(bytes);
    if descr.starts_with('>') {
        little[..bytes.len()].reverse();
    }
    let half = [little[0], little[1], little[2], little[3]];
    match &descr[1..] {
        "f8" => f64::from_le_bytes(little),
        "i8" => i64::from_le_bytes(little) as f64,
        "f4" => f32::from_le_bytes(half).into(),
        _ => i32::from_le_bytes(half).into(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn npy(header: &str, data: &[u8]) -> Vec<u8> {
        let length = u16::try_from(header.len()).unwrap().to_le_bytes();
        [b"\x93NUMPY\x01\x00", &length[..], header.as_bytes(), data].concat()
    }

    #[test]
    fn numbers_of_either_order_and_size_come_out_in_the_order_of_c() {
        let header =
            |descr: &str, fortran: &str| format!("{{'descr': '{descr}', 'fortran_order': {fortran}, 'shape': (2, 3), }}\n");
        let data = |numbers: [i32; 6]| numbers.iter().flat_map(|n| f64::from(*n).to_be_bytes()).collect::<Vec<_>>();
        let array = read(&npy(&header(">f8", "False"), &data([1, 2, 3, 4, 5, 6]))[..], 6).unwrap();
        assert_eq!((array.shape, array.values), (vec![2, 3], vec![1.0, 2.0, 3.0, 4.0, 5.0, 6.0]));
        let array = read(&npy(&header(">f8", "True"), &data([1, 4, 2, 5, 3, 6]))[..], 6).unwrap();
        assert_eq!(array.values, [1.0, 2.0, 3.0, 4.0, 5.0, 6.0]);
        let integers: Vec<u8> = [-1, 2, 3, 4, 5, 6].iter().flat_map(|n: &i32| n.to_le_bytes()).collect();
        assert_eq!(read(&npy(&header("<i4", "False"), &integers)[..], 6).unwrap().values[..2], [-1.0, 2.0]);
        assert!(read(&npy(&header("<i4", "False"), &integers)[..], 5).unwrap_err().contains("more numbers"));
    }

    #[test]
    fn brackets_without_end_and_long_headers_are_refused() {
        assert!(read(&npy(&"(".repeat(4000), &[])[..], 9).unwrap_err().contains("not that of an array"));
        assert!(read(&npy(&" ".repeat(5000), &[])[..], 9).unwrap_err().contains("claims 5000 bytes"));
        assert!(read(&b"\x93NUMPY\x02\x00\xff\xff\xff\xff"[..], 9).unwrap_err().contains("claims 4294967295 bytes"));
    }
}
