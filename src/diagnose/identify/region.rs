//! Boxes of coordinates.

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::RngCore;

/// A box of coordinates within 0 to 1.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Region {
    pub low: Vec<f64>,
    pub high: Vec<f64>,
}

/// Least half width of a side.
const NARROWEST: f64 = 0.004;

impl Region {
    /// The whole range.
    pub fn whole(constants: usize) -> Self {
        Self { low: vec![0.0; constants], high: vec![1.0; constants] }
    }

    /// The least box around points, each side widened by `share` of itself, at least to a half width of `least`.
    pub fn around<'a>(points: impl Iterator<Item = &'a [f64]>, share: f64, least: f64) -> Option<Self> {
        let mut hull: Option<Self> = None;
        for x in points {
            let hull = hull.get_or_insert_with(|| Self { low: x.to_vec(), high: x.to_vec() });
            for (at, value) in x.iter().enumerate() {
                hull.low[at] = hull.low[at].min(*value);
                hull.high[at] = hull.high[at].max(*value);
            }
        }
        let mut hull = hull?;
        for (low, high) in hull.low.iter_mut().zip(&mut hull.high) {
            let (middle, half) = (0.5 * (*low + *high), (0.5 + share) * (*high - *low));
            let half = half.max(least).max(NARROWEST);
            // A box that leaves the range keeps its width inside.
            let shifted = middle.clamp(half.min(0.5), 1.0 - half.min(0.5));
            (*low, *high) = ((shifted - half).max(0.0), (shifted + half).min(1.0));
        }
        Some(hull)
    }

    pub fn holds(&self, x: &[f64]) -> bool {
        x.iter().zip(self.low.iter().zip(&self.high)).all(|(x, (low, high))| (*low..=*high).contains(x))
    }

    pub fn half_widths(&self) -> Vec<f64> {
        self.low.iter().zip(&self.high).map(|(low, high)| 0.5 * (high - low)).collect()
    }

    /// Coordinates from −1 to 1 within the box.
    pub fn scaled(&self, x: &[f64]) -> Vec<f64> {
        let ends = self.low.iter().zip(&self.high);
        x.iter().zip(ends).map(|(x, (low, high))| (2.0 * x - low - high) / (high - low)).collect()
    }

    pub fn volume(&self) -> f64 {
        self.half_widths().iter().product()
    }

    /// `count` points, one in each of `count` slices of every side (Latin hypercube; McKay et al. 1979).
    pub fn scattered(&self, count: usize, random: &mut ChaCha8Rng) -> Vec<Vec<f64>> {
        let unit = |random: &mut ChaCha8Rng| (random.next_u64() >> 11) as f64 / (1_u64 << 53) as f64;
        let mut points = vec![Vec::with_capacity(self.low.len()); count];
        for (low, high) in self.low.iter().zip(&self.high) {
            let mut slices: Vec<usize> = (0..count).collect();
            for last in (1..count).rev() {
                slices.swap(last, (unit(random) * (last + 1) as f64) as usize);
            }
            for (point, slice) in points.iter_mut().zip(slices) {
                point.push(low + (high - low) * (slice as f64 + unit(random)) / count as f64);
            }
        }
        points
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand_chacha::rand_core::SeedableRng;

    #[test]
    fn points_of_a_latin_hypercube_fill_every_slice_once() {
        let region = Region { low: vec![0.0, 0.5], high: vec![1.0, 0.75] };
        let points = region.scattered(40, &mut ChaCha8Rng::seed_from_u64(1));
        for (side, (low, width)) in [(0.0, 1.0), (0.5, 0.25)].into_iter().enumerate() {
            let mut slices: Vec<usize> = points.iter().map(|x| ((x[side] - low) / width * 40.0) as usize).collect();
            slices.sort_unstable();
            assert_eq!(slices, (0..40).collect::<Vec<_>>());
        }
    }

    #[test]
    fn a_box_stays_within_the_range_and_keeps_its_least_width() {
        let points: [&[f64]; 2] = [&[0.99, 0.4], &[1.0, 0.6]];
        let region = Region::around(points.into_iter(), 0.25, 0.05).unwrap();
        assert!((region.low[0] - 0.9).abs() < 1e-12 && region.high[0] == 1.0, "{region:?}");
        assert!((region.low[1] - 0.35).abs() < 1e-12 && (region.high[1] - 0.65).abs() < 1e-12, "{region:?}");
        assert_eq!(Region::around(std::iter::empty(), 0.1, 0.1), None);
    }
}
