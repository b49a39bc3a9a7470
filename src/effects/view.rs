//! The camera's view of positions.

/// How positions are recorded.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct View {
    /// Factor on positions (–).
    pub scale: f64,
    /// Offset of x and z (cm).
    pub offset: [f64; 2],
    /// Roll of the camera (rad).
    pub tilt: f64,
    /// Delay of the record (s).
    pub delay: f64,
    /// What is added to x and to z (cm) per 1, x, z, x², x·z and z² of the position seen (cm).
    pub distortion: [[f64; 6]; 2],
}

impl Default for View {
    fn default() -> Self {
        Self { scale: 1.0, offset: [0.0; 2], tilt: 0.0, delay: 0.0, distortion: [[0.0; 6]; 2] }
    }
}

impl View {
    /// The view under `effects`.
    pub fn new(effects: &[super::Applied]) -> Self {
        let mut view = Self::default();
        for applied in effects.iter().filter(|applied| !applied.is_off()) {
            if let super::Action::View(change) = applied.effect.action {
                change(&applied.values, &mut view);
            }
        }
        view
    }

    /// True if positions are recorded unchanged.
    pub fn is_plain(&self) -> bool {
        *self == Self::default()
    }

    /// True if the view does not depend on where x = 0 is.
    pub fn only_shifts(&self) -> bool {
        self.scale == 1.0 && self.tilt == 0.0 && self.distortion == [[0.0; 6]; 2]
    }

    /// The recorded position (cm) of a point at x, z (cm): rolled, scaled, shifted, then bent.
    pub fn of(&self, [x, z]: [f64; 2]) -> [f64; 2] {
        let [x, z] = if self.tilt == 0.0 {
            [x, z]
        } else {
            let (sin, cos) = self.tilt.sin_cos();
            [x * cos - z * sin, x * sin + z * cos]
        };
        let [x, z] = [self.scale * x + self.offset[0], self.scale * z + self.offset[1]];
        if self.distortion == [[0.0; 6]; 2] {
            return [x, z];
        }
        let terms = [1.0, x, z, x * x, x * z, z * z];
        let added = self.distortion.map(|weights| weights.iter().zip(terms).map(|(weight, term)| weight * term).sum::<f64>());
        [x + added[0], z + added[1]]
    }
}
