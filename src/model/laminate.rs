//! From layers to a beam: flexural rigidity, curvature per volt and mass of one actuator.

use super::ModelError;

/// Constants of one actuator's laminate: a piezo layer glued onto a substrate. CGS units.
///
/// The adhesive may have thickness 0, which leaves a two-layer laminate.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Material {
    /// Length of one actuator along x (cm).
    pub actuator_length: f64,
    /// Width along y (cm).
    pub width: f64,
    /// Gravity (cm/s²).
    pub gravity: f64,
    /// Young's modulus of the piezo layer (Ba).
    pub piezo_modulus: f64,
    /// Poisson's ratio of the piezo layer (–).
    pub piezo_poisson: f64,
    /// Thickness of the piezo layer (cm).
    pub piezo_thickness: f64,
    /// Density of the piezo layer (g/cm³).
    pub piezo_density: f64,
    /// Charge constant d33 (cm/V).
    pub d33: f64,
    /// Distance between neighbouring electrodes (cm).
    pub electrode_pitch: f64,
    /// Young's modulus of the substrate (Ba).
    pub substrate_modulus: f64,
    /// Poisson's ratio of the substrate (–).
    pub substrate_poisson: f64,
    /// Thickness of the substrate (cm).
    pub substrate_thickness: f64,
    /// Density of the substrate (g/cm³).
    pub substrate_density: f64,
    /// Young's modulus of the adhesive, already that of plane strain (Ba).
    pub adhesive_modulus: f64,
    /// Thickness of the adhesive (cm).
    pub adhesive_thickness: f64,
    /// Density of the adhesive (g/cm³).
    pub adhesive_density: f64,
    /// Largest electric field between neighbouring electrodes (V/cm).
    pub max_field: f64,
    /// Largest strain of the laminate's outer fibre (–) for which a result is given.
    pub max_strain: f64,
}

/// Field of 2000 V over 0.5 mm (V/cm): the reference goes to 1500 V, and soft PZT breaks down at some 4 kV/mm.
const MAX_FIELD: f64 = 4e4;
/// The presets reach 5.15e-3, cantilevers at resonance under 1500 V; the data sheet of the MFC actuator allows 4.5e-3 in tension.
const MAX_STRAIN: f64 = 6e-3;

impl Material {
    /// The reference's default set: it matches the published deflection.
    pub const PARAMETER_2: Self = Self {
        actuator_length: 10.0,
        width: 2.0,
        gravity: 980.0,
        piezo_modulus: 3.0e11,
        piezo_poisson: 0.31,
        piezo_thickness: 300.0e-4,
        piezo_density: 6.6,
        d33: 370.0e-10,
        electrode_pitch: 5.0e-2,
        substrate_modulus: 1.9e12,
        substrate_poisson: 0.27,
        substrate_thickness: 50.8e-4,
        substrate_density: 8.1,
        adhesive_modulus: 1.489e10,
        adhesive_thickness: 10.0e-4,
        adhesive_density: 1.07,
        max_field: MAX_FIELD,
        max_strain: MAX_STRAIN,
    };

    /// The reference's other set: it matches the published resonance. No set matches both.
    pub const PARAMETER_4: Self = Self {
        piezo_modulus: 3.0336e11,
        piezo_thickness: 294.0e-4,
        piezo_density: 3.20,
        d33: 460.0e-10,
        substrate_modulus: 2.03e12,
        substrate_density: 7.85,
        ..Self::PARAMETER_2
    };

    /// Checks that the constants describe a laminate.
    ///
    /// # Errors
    /// [`ModelError::Value`] names the key of the experiment file that is out of range.
    pub fn check(&self) -> Result<(), ModelError> {
        for (key, value) in [
            ("material.actuator_length_mm", self.actuator_length),
            ("material.width_mm", self.width),
            ("material.piezo_modulus_gpa", self.piezo_modulus),
            ("material.piezo_thickness_um", self.piezo_thickness),
            ("material.piezo_density_g_cm3", self.piezo_density),
            ("material.electrode_pitch_mm", self.electrode_pitch),
            ("material.substrate_modulus_gpa", self.substrate_modulus),
            ("material.substrate_thickness_um", self.substrate_thickness),
            ("material.substrate_density_g_cm3", self.substrate_density),
        ] {
            ModelError::unless(value.is_finite() && value > 0.0, key, value, "positive")?;
        }
        for (key, value) in [
            ("material.gravity_m_s2", self.gravity),
            ("material.d33_pm_per_v", self.d33),
            ("material.adhesive_modulus_gpa", self.adhesive_modulus),
            ("material.adhesive_thickness_um", self.adhesive_thickness),
            ("material.adhesive_density_g_cm3", self.adhesive_density),
        ] {
            ModelError::unless(value.is_finite() && value >= 0.0, key, value, "zero or more")?;
        }
        // Infinity is no limit.
        for (key, value) in [("material.max_field_kv_mm", self.max_field), ("material.max_strain", self.max_strain)] {
            ModelError::unless(value > 0.0, key, value, "positive")?;
        }
        for (key, value) in
            [("material.piezo_poisson", self.piezo_poisson), ("material.substrate_poisson", self.substrate_poisson)]
        {
            ModelError::unless(value.is_finite() && (0.0..=0.5).contains(&value), key, value, "between 0 and 0.5")?;
        }
        Ok(())
    }
}

impl Material {
    /// Largest voltage between neighbouring electrodes (V).
    pub fn max_voltage(&self) -> f64 {
        self.max_field * self.electrode_pitch
    }

    /// Distance of the outer fibre from the neutral axis (cm): the strain there is this times the curvature.
    pub fn outer_fibre(&self) -> f64 {
        let above = self.adhesive_thickness + self.piezo_thickness;
        let axis = Laminate::new(self).neutral_axis;
        (above - axis).max(axis + self.substrate_thickness)
    }
}

/// What the torque law needs to know of a laminate, derived from its [`Material`].
///
/// Bending a wide thin sheet strains it in one direction only, so the layers' moduli are those of plane strain. With layers
/// i of modulus Eᵢ and thickness hᵢ, and zᵢ the height of a layer's centre above the neutral axis:
///
/// ```text
/// E_piezo = E/(1 − ν²)      E_substrate = E/(1 − ν²)      E_adhesive as given
/// EI = Σ Eᵢ (hᵢ³/12 + hᵢ zᵢ²)                               per unit width
/// γ  = (d33 (1 + ν_p) / pitch) · z_p E_p h_p / EI           curvature per volt
/// β  = γ L                                                  rotation of one actuator per volt
/// μ  = Σ ρᵢ hᵢ                                              mass per area
/// ```
///
/// The neutral axis is where a pure bending moment causes no axial force, Σ Eᵢ hᵢ zᵢ = 0.
///
/// Valid for small strain and perfect bonding; shear in the adhesive is not modelled.
///
/// # Examples
/// ```
/// use sfers::model::{Laminate, Material};
/// let laminate = Laminate::new(&Material::PARAMETER_2);
/// assert_eq!(laminate.flexural_rigidity, 2519089.378622151);
/// assert_eq!(laminate.rotation_per_volt, 3.6327811654911875e-4);
/// assert_eq!(laminate.actuator_mass, 4.804359999999999);
/// ```
///
/// # References
/// Zheng et al., ICRA 2022, eqs. 2 to 5. The sums run in the order of the authors' code, so the results have its bits.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Laminate {
    /// EI, flexural rigidity per unit width (dyn·cm²/cm).
    pub flexural_rigidity: f64,
    /// Height of the neutral axis above the substrate's upper face (cm).
    pub neutral_axis: f64,
    /// γ, curvature per volt (1/(cm·V)).
    pub curvature_per_volt: f64,
    /// β, rotation between the ends of one actuator per volt (rad/V).
    pub rotation_per_volt: f64,
    /// μ, mass per area (g/cm²).
    pub areal_density: f64,
    /// Mass of one actuator (g).
    pub actuator_mass: f64,
}

impl Laminate {
    /// Derives the beam from its layers.
    pub fn new(m: &Material) -> Self {
        // pow, not a product: the reference's language calls the C library's pow, and the last bit may differ.
        let cube = |h: f64| 1.0 / 12.0 * h.powf(3.0);
        let (h_p, h_a, h_s) = (m.piezo_thickness, m.adhesive_thickness, m.substrate_thickness);
        let e_p = m.piezo_modulus / (1.0 - m.piezo_poisson.powf(2.0));
        let e_s = m.substrate_modulus / (1.0 - m.substrate_poisson.powf(2.0));
        let e_a = m.adhesive_modulus;

        let moment = e_p * h_p * (0.5 * h_p + h_a) + e_a * h_a * 0.5 * h_a - e_s * h_s * 0.5 * h_s;
        let neutral_axis = moment / (e_p * h_p + e_a * h_a + e_s * h_s);
        let z_p = 0.5 * h_p + h_a - neutral_axis;
        let z_a = 0.5 * h_a - neutral_axis;
        let z_s = -0.5 * h_s - neutral_axis;

        let own = e_p * cube(h_p) + e_a * cube(h_a) + e_s * cube(h_s);
        let flexural_rigidity = own + e_p * h_p * z_p.powf(2.0) + e_a * h_a * z_a.powf(2.0) + e_s * h_s * z_s.powf(2.0);

        let strain_per_volt = m.d33 * (1.0 + m.piezo_poisson) / m.electrode_pitch;
        let curvature_per_volt = strain_per_volt * z_p * e_p * h_p / flexural_rigidity;
        let areal_density = m.substrate_density * h_s + m.piezo_density * h_p + m.adhesive_density * h_a;
        Self {
            flexural_rigidity,
            neutral_axis,
            curvature_per_volt,
            rotation_per_volt: curvature_per_volt * m.actuator_length,
            areal_density,
            actuator_mass: areal_density * m.width * m.actuator_length,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_published_parameter_sets_give_the_published_constants() {
        let two = Laminate::new(&Material::PARAMETER_2);
        assert_eq!(two.flexural_rigidity, 2519089.378622151);
        assert_eq!(two.rotation_per_volt, 3.6327811654911875e-4);
        assert_eq!(two.actuator_mass, 4.804359999999999);
        let four = Laminate::new(&Material::PARAMETER_4);
        // Published to 8 digits.
        assert!((four.flexural_rigidity / 2474699.2 - 1.0).abs() < 5e-8, "{}", four.flexural_rigidity);
        assert!((four.rotation_per_volt / 4.6466264e-4 - 1.0).abs() < 5e-8, "{}", four.rotation_per_volt);
        assert!((four.actuator_mass - 2.70056).abs() < 1e-12, "{}", four.actuator_mass);
    }

    #[test]
    fn a_homogeneous_sheet_has_the_textbook_rigidity() {
        // Three layers of the same plane-strain modulus are one plate: E h³ / (12 (1 − ν²)), neutral axis in the middle.
        let e = 1e12 / (1.0 - 0.3 * 0.3);
        let sheet = Material {
            piezo_modulus: 1e12,
            substrate_modulus: 1e12,
            adhesive_modulus: e,
            piezo_poisson: 0.3,
            substrate_poisson: 0.3,
            piezo_thickness: 0.02,
            adhesive_thickness: 0.01,
            substrate_thickness: 0.03,
            ..Material::PARAMETER_2
        };
        let laminate = Laminate::new(&sheet);
        let h: f64 = 0.06;
        assert!((laminate.flexural_rigidity / (e * h.powi(3) / 12.0) - 1.0).abs() < 1e-14);
        assert!(laminate.neutral_axis.abs() < 1e-17);
        assert!((sheet.outer_fibre() - 0.5 * h).abs() < 1e-16);
    }

    #[test]
    fn a_value_out_of_range_is_named_by_its_key() {
        let bad = Material { width: f64::NAN, ..Material::PARAMETER_2 };
        assert!(bad.check().unwrap_err().to_string().contains("material.width_mm"));
        assert!(Material { piezo_poisson: 0.6, ..Material::PARAMETER_2 }.check().is_err());
        assert!(Material { adhesive_thickness: 0.0, ..Material::PARAMETER_2 }.check().is_ok());
        assert!(Material::PARAMETER_4.check().is_ok());
    }
}
