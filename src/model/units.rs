//! Units: CGS inside, as in the reference; other units only at the edges, where they stand in the key's name.
//!
//! | quantity | inside | at the edge |
//! | --- | --- | --- |
//! | length | cm | `_mm`, `_um` |
//! | mass, density | g, g/cm³ | `_g`, `_g_cm3` |
//! | modulus | Ba = dyn/cm² | `_gpa` (1 GPa = 10¹⁰ Ba) |
//! | charge constant d33 | cm/V | `_pm_per_v` (1 pm = 10⁻¹⁰ cm) |
//! | acceleration | cm/s² | `_m_s2` |
//! | torque | dyn·cm | `_dyn_cm` |
//! | electric field | V/cm | `_kv_mm` (1 kV/mm = 10⁴ V/cm) |
//! | angle, time, voltage | rad, s, V | `_rad`, `_deg`, `_s`, `_v` |
//!
//! Every conversion is a single rounding: millimetres are divided by 10, because `3.0 / 10.0` is `0.3` and `3.0 * 0.1` is not.

/// Millimetres to centimetres.
pub fn cm_from_mm(mm: f64) -> f64 {
    mm / 10.0
}

/// Centimetres to millimetres.
pub fn mm_from_cm(cm: f64) -> f64 {
    cm * 10.0
}

/// Micrometres to centimetres.
pub fn cm_from_um(um: f64) -> f64 {
    um / 1e4
}

/// Gigapascals to barye (dyn/cm²).
pub fn ba_from_gpa(gpa: f64) -> f64 {
    gpa * 1e10
}

/// Picometres per volt to centimetres per volt.
pub fn cm_per_v_from_pm_per_v(pm_per_v: f64) -> f64 {
    pm_per_v / 1e10
}

/// Kilovolts per millimetre to volts per centimetre.
pub fn v_per_cm_from_kv_per_mm(kv_per_mm: f64) -> f64 {
    kv_per_mm * 1e4
}

/// Metres per second squared to centimetres per second squared.
pub fn cm_s2_from_m_s2(m_s2: f64) -> f64 {
    m_s2 * 100.0
}

/// A CGS value in the unit that the end of a key's name gives, for messages: to 15 digits, since the way back rounds too.
pub(crate) fn in_unit_of(key: &str, cgs: f64) -> f64 {
    let per_unit = [
        ("_pm_per_v", cm_per_v_from_pm_per_v(1.0)),
        ("_m_s2", cm_s2_from_m_s2(1.0)),
        ("_gpa", ba_from_gpa(1.0)),
        ("_kv_mm", v_per_cm_from_kv_per_mm(1.0)),
        ("_um", cm_from_um(1.0)),
        ("_mm", cm_from_mm(1.0)),
    ];
    let factor = per_unit.iter().find(|(end, _)| key.ends_with(end)).map_or(1.0, |(_, factor)| *factor);
    format!("{:.14e}", cgs / factor).parse().unwrap_or(cgs)
}
