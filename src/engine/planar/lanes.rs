//! One number of four bodies in SIMD lanes, and this machine's registers for it.
//!
//! The width of the registers is chosen at run time (`dispatch!`); code for them must be inlined there. Products and sums are rounded once ([`fma`]), so the
//! bits are the same at every width. Without such an instruction (x86-64 from before 2013) the C library computes them.

use std::array::from_fn;
use std::ops::{Add, AddAssign, Div, Mul, Neg, Sub};

use fearless_simd::{Simd, prelude::*};
use wide::{f64x2, f64x4};

/// One number of four bodies: left and right arm at one tree level, then left and right arm at the next level.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
#[repr(align(32))]
pub(super) struct Lanes([f64; 4]);

/// Four lanes in a register.
pub(super) type Four<S> = fearless_simd::f64x4<S>;
/// Two lanes in a register: one level.
pub(super) type Two<S> = fearless_simd::f64x2<S>;

impl Lanes {
    pub(super) const ZERO: Self = Self([0.0; 4]);

    #[inline(always)]
    pub(super) fn new(values: [f64; 4]) -> Self {
        Self(values)
    }

    #[inline(always)]
    pub(super) fn splat(value: f64) -> Self {
        Self([value; 4])
    }

    #[inline(always)]
    pub(super) fn on<S: Simd>(&self, simd: S) -> Four<S> {
        Four::simd_from(simd, self.0)
    }

    #[inline(always)]
    pub(super) fn to_array(self) -> [f64; 4] {
        self.0
    }

    #[inline(always)]
    pub(super) fn map(self, of: impl Fn(f64) -> f64) -> Self {
        Self(from_fn(|i| of(self.0[i])))
    }

    /// These lanes where `mask` is positive, `other` elsewhere.
    #[inline(always)]
    pub(super) fn where_positive(self, mask: Self, other: Self) -> Self {
        Self(std::array::from_fn(|lane| if mask.0[lane] > 0.0 { self.0[lane] } else { other.0[lane] }))
    }

    #[inline(always)]
    pub(super) fn abs(self) -> Self {
        self.map(f64::abs)
    }

    /// Powers of positive numbers, to some units in the last place.
    #[inline(always)]
    pub(super) fn powf(self, power: f64) -> Self {
        Self(f64x4::new(self.0).powf_simd(f64x4::splat(power)).to_array())
    }

    /// The larger of each lane and `least`.
    #[inline(always)]
    pub(super) fn at_least(self, least: f64) -> Self {
        self.map(|value| value.max(least))
    }

    /// Hyperbolic tangents, to some units in the last place of 1.
    #[inline(always)]
    pub(super) fn tanh(self) -> Self {
        let one = f64x4::splat(1.0);
        let gone = (f64x4::new(self.abs().0) * f64x4::splat(-2.0)).exp();
        let sizes = ((one - gone) / (one + gone)).to_array();
        Self(from_fn(|i| sizes[i].copysign(self.0[i])))
    }

    /// The sum, in an order that does not depend on the machine.
    #[inline(always)]
    pub(super) fn sum(self) -> f64 {
        let [a, b, c, d] = self.0;
        (a + c) + (b + d)
    }

    #[inline(always)]
    pub(super) fn lane(&self, lane: usize) -> f64 {
        self.0[lane]
    }

    pub(super) fn set_lane(&mut self, lane: usize, to: f64) {
        self.0[lane] = to;
    }

    /// The two bodies of the first (0) or the second (1) of the levels.
    #[inline(always)]
    pub(super) fn level(&self, which: usize) -> f64x2 {
        f64x2::new(self.0.as_chunks().0[which])
    }

    #[inline(always)]
    pub(super) fn set_level(&mut self, which: usize, to: f64x2) {
        self.0.as_chunks_mut().0[which] = to.to_array();
    }

    /// The values one level closer to the root, where `before` precedes the first level.
    pub(super) fn inner(self, before: f64x2) -> Self {
        let ([a, b], [c, d, ..]) = (before.to_array(), self.0);
        Self([a, b, c, d])
    }
}

/// The two bodies of one level, of N numbers.
#[inline(always)]
pub(super) fn pair<const N: usize>(of: &[Lanes; N], level: usize) -> [f64x2; N] {
    from_fn(|k| of[k].level(level))
}

/// N numbers of four bodies, in registers.
#[inline(always)]
pub(super) fn on<const N: usize, S: Simd>(simd: S, of: &[Lanes; N]) -> [Four<S>; N] {
    from_fn(|k| of[k].on(simd))
}

/// [`Lanes::inner`] in registers, and the last level's values for the next call.
#[inline(always)]
pub(super) fn inner<S: Simd>(values: Four<S>, before: Two<S>) -> (Four<S>, Two<S>) {
    let (first, second) = values.split();
    (before.combine(first), second)
}

impl<S: Simd> From<Four<S>> for Lanes {
    #[inline(always)]
    fn from(values: Four<S>) -> Self {
        Self(values.into())
    }
}

macro_rules! in_each_lane {
    ($operation:ident, $name:ident, $sign:tt) => {
        impl $operation for Lanes {
            type Output = Self;

            #[inline(always)]
            fn $name(self, other: Self) -> Self {
                Self(from_fn(|i| self.0[i] $sign other.0[i]))
            }
        }
    };
}
in_each_lane!(Add, add, +);
in_each_lane!(Sub, sub, -);
in_each_lane!(Mul, mul, *);
in_each_lane!(Div, div, /);

impl Neg for Lanes {
    type Output = Self;

    #[inline(always)]
    fn neg(self) -> Self {
        self.map(|value| -value)
    }
}

impl AddAssign for Lanes {
    #[inline(always)]
    fn add_assign(&mut self, other: Self) {
        *self = *self + other;
    }
}

/// Lanes with a fused multiply-add.
pub(super) trait Fused {
    /// self · by + and.
    fn times(self, by: Self, and: Self) -> Self;
}

impl<S: Simd> Fused for Four<S> {
    #[inline(always)]
    fn times(self, by: Self, and: Self) -> Self {
        self.mul_add_precise(by, and)
    }
}

impl Fused for f64x2 {
    /// Compiles to one instruction where there is one.
    #[inline(always)]
    fn times(self, by: Self, and: Self) -> Self {
        let (a, b, c) = (self.to_array(), by.to_array(), and.to_array());
        Self::new([a[0].mul_add(b[0], c[0]), a[1].mul_add(b[1], c[1])])
    }
}

/// a·b + c, rounded once.
#[inline(always)]
pub(super) fn fma<T: Fused>(a: T, b: T, c: T) -> T {
    a.times(b, c)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn hyperbolic_tangents_are_those_of_the_c_library() {
        for size in [0.0, 1e-300, 1e-9, 1e-3, 0.3, 1.0, 3.0, 20.0, 800.0] {
            for (found, x) in
                Lanes::new([size, -size, 1.1 * size, -1.1 * size]).tanh().to_array().into_iter().zip([1.0, -1.0, 1.1, -1.1])
            {
                let expected = (x * size).tanh();
                // Two units in the last place of 1, from the difference of two numbers near 1.
                assert!(
                    (found - expected).abs() <= 2.0 * f64::EPSILON && found.is_sign_negative() == (x < 0.0),
                    "{found} {expected}"
                );
            }
        }
    }

    #[test]
    fn powers_are_those_of_the_c_library() {
        for base in [f64::MIN_POSITIVE, 1e-12, 1e-4, 0.3, 1.0, 7.0, 100.0] {
            for power in [-0.5, 0.3, 1.0, 1.7, 3.0, 6.0] {
                let expected = base.powf(power);
                for found in Lanes::splat(base).powf(power).to_array() {
                    // The logarithm's last place counts as often as the exponent is large: up to 700 · 6.
                    assert!((found - expected).abs() <= 1e-12 * expected, "{base}^{power}: {found} {expected}");
                }
            }
        }
    }
}
