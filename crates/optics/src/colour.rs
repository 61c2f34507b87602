//! Colour: linear RGB (Rec. 709 primaries, D65), XYZ, CIE Lab and the CIEDE2000 difference.
//!
//! Lab here is computed from the reflectance factor `R = π f`, white being the perfect diffuser; L* above 100 is not clamped.

mod cie;
mod ciede2000;
mod spectral;

pub use ciede2000::ciede2000;
pub use spectral::{SpectralError, SpectralWeights};

/// XYZ of the D65 white (Y = 1) that belongs to the Rec. 709 matrix below.
pub const D65_WHITE: [f64; 3] = [0.950_455_927_051_671_6, 1.0, 1.089_057_750_759_878_4];

/// Linear Rec. 709 RGB to XYZ (Y of white = 1).
const XYZ_FROM_RGB: [[f64; 3]; 3] = [
    [0.412_390_799_265_959_48, 0.357_584_339_383_877_96, 0.180_480_788_401_834_30],
    [0.212_639_005_871_510_36, 0.715_168_678_767_755_92, 0.072_192_315_360_733_71],
    [0.019_330_818_715_591_85, 0.119_194_779_794_625_99, 0.950_532_152_249_660_58],
];

/// XYZ to linear Rec. 709 RGB.
const RGB_FROM_XYZ: [[f64; 3]; 3] = [
    [3.240_969_941_904_521_3, -1.537_383_177_570_093_5, -0.498_610_760_293_003_28],
    [-0.969_243_636_280_879_83, 1.875_967_501_507_720_7, 0.041_555_057_407_175_61],
    [0.055_630_079_696_993_61, -0.203_976_958_888_976_56, 1.056_971_514_242_878_6],
];

/// A colour in CIE Lab (D65).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Lab {
    /// Lightness L*; 100 is the perfect diffuser, gloss exceeds it.
    pub l: f64,
    /// Red–green.
    pub a: f64,
    /// Yellow–blue.
    pub b: f64,
}

fn apply(m: &[[f64; 3]; 3], c: [f64; 3]) -> [f64; 3] {
    [0, 1, 2].map(|i| m[i][0] * c[0] + m[i][1] * c[1] + m[i][2] * c[2])
}

/// XYZ of a linear Rec. 709 colour.
#[must_use]
pub fn xyz_from_rgb(rgb: [f64; 3]) -> [f64; 3] {
    apply(&XYZ_FROM_RGB, rgb)
}

/// Linear Rec. 709 colour of XYZ; may leave [0, 1].
#[must_use]
pub fn rgb_from_xyz(xyz: [f64; 3]) -> [f64; 3] {
    apply(&RGB_FROM_XYZ, xyz)
}

/// Relative luminance Y of a linear Rec. 709 colour.
#[must_use]
pub fn luminance(rgb: [f64; 3]) -> f64 {
    XYZ_FROM_RGB[1][0] * rgb[0] + XYZ_FROM_RGB[1][1] * rgb[1] + XYZ_FROM_RGB[1][2] * rgb[2]
}

/// CIE Lab of XYZ against D65. Negative tristimulus values follow the linear branch.
#[must_use]
pub fn lab_from_xyz(xyz: [f64; 3]) -> Lab {
    const EPSILON: f64 = 216.0 / 24389.0;
    const KAPPA: f64 = 24389.0 / 27.0;
    let f = |t: f64| if t > EPSILON { t.cbrt() } else { (KAPPA * t + 16.0) / 116.0 };
    let [x, y, z] = [0, 1, 2].map(|i| f(xyz[i] / D65_WHITE[i]));
    Lab { l: 116.0 * y - 16.0, a: 500.0 * (x - y), b: 200.0 * (y - z) }
}

/// CIE Lab of a linear Rec. 709 colour.
#[must_use]
pub fn lab_from_rgb(rgb: [f64; 3]) -> Lab {
    lab_from_xyz(xyz_from_rgb(rgb))
}

/// CIE Lab of a BRDF value (1/sr): the colour of `R = π f`.
#[must_use]
pub fn lab_from_brdf(f: [f64; 3]) -> Lab {
    lab_from_rgb(f.map(|v| v * std::f64::consts::PI))
}

/// sRGB transfer curve of one linear value, clamped to [0, 1].
#[must_use]
pub fn srgb_encode(linear: f64) -> f64 {
    let x = linear.clamp(0.0, 1.0);
    if x <= 0.003_130_8 { 12.92 * x } else { 1.055 * x.powf(1.0 / 2.4) - 0.055 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn white_is_l_100_without_hue() {
        let lab = lab_from_rgb([1.0; 3]);
        assert!((lab.l - 100.0).abs() < 1e-9 && lab.a.abs() < 1e-3 && lab.b.abs() < 1e-3, "{lab:?}");
    }

    #[test]
    fn matrices_are_inverse() {
        let c = [0.2, 0.7, 0.1];
        let back = rgb_from_xyz(xyz_from_rgb(c));
        assert!((0..3).all(|i| (back[i] - c[i]).abs() < 1e-12), "{back:?}");
    }
}
