//! The scale on which a map is fitted and interpolated.

use serde::{Deserialize, Serialize};

/// Reflectances below this are as dark as anything a map is asked for: R = π f = 1e-4 has L* = 0.09.
pub(super) const DARKEST: f64 = 1e-4 * std::f64::consts::FRAC_1_PI;

/// y(f); its inverse is exact and costs no library call.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Transform {
    /// `y = log2 f`, f not below 1e-4/π: errors count by their ratio to f.
    Log,
    /// `y = f^(1/3)`: errors count as they do in Lab, noise about zero is no trouble, and the inverse is two products. As exact as [`Self::Log`] on
    /// real paints.
    #[default]
    CubeRoot,
}

impl Transform {
    /// y of f in 1/sr.
    #[must_use]
    pub fn forward(self, f: f64) -> f64 {
        match self {
            Self::Log => f.max(DARKEST).log2(),
            Self::CubeRoot => f.cbrt(),
        }
    }

    /// dy/df; that of the darkest f where f is darker.
    #[must_use]
    pub fn slope(self, f: f64) -> f64 {
        let f = f.abs().max(DARKEST);
        match self {
            Self::Log => std::f64::consts::LOG2_E / f,
            Self::CubeRoot => f.cbrt() / (3.0 * f),
        }
    }

    /// f of y.
    #[inline]
    #[must_use]
    pub fn inverse(self, y: f32) -> f32 {
        match self {
            Self::Log => exp2(y),
            Self::CubeRoot => y * y * y,
        }
    }
}

/// 2^x to 3e-7 of its value for −126 ≤ x ≤ 126, held there outside: no branch, no call, so that loops over it become vector code.
#[inline(always)]
pub(super) fn exp2(x: f32) -> f32 {
    // 1.5·2^23: adding it leaves the nearest whole number in the lowest bits
    const ROUND: f32 = 12_582_912.0;
    let x = x.clamp(-126.0, 126.0);
    let shifted = x + ROUND;
    let r = x - (shifted - ROUND);
    // Taylor series of 2^r, |r| ≤ 1/2; the first term left out is 1.2e-7
    let p = 1.0
        + r * (std::f32::consts::LN_2
            + r * (0.240_226_5
                + r * (0.055_504_11 + r * (0.009_618_13 + r * (0.001_333_36 + r * 0.000_154_04)))));
    let whole = shifted.to_bits().wrapping_sub(ROUND.to_bits());
    f32::from_bits(p.to_bits().wrapping_add(whole << 23))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_fast_power_of_two_is_the_power_of_two() {
        for i in -12_500..=12_500 {
            let x = i as f32 * 0.01;
            let exact = f64::from(x).exp2();
            assert!((f64::from(exp2(x)) / exact - 1.0).abs() < 4e-7, "{x}");
        }
        assert!(exp2(f32::INFINITY).is_finite() && exp2(f32::NEG_INFINITY) >= 0.0);
    }

    #[test]
    fn transforms_are_inverted_and_the_dark_stays_dark() {
        for t in [Transform::Log, Transform::CubeRoot] {
            for f in [1e-3, 0.02, 0.3, 4.0] {
                assert!((f64::from(t.inverse(t.forward(f) as f32)) / f - 1.0).abs() < 3e-6);
            }
            assert!(t.inverse(t.forward(-0.01) as f32) <= 4e-5);
        }
    }
}
