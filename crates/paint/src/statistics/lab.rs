//! CIE Lab of many BRDF values at once, in single precision, and back.
//!
//! Cube roots by two Halley steps from a guess out of the exponent bits: within 3e-7 of the exact root, 3e-5 in L*.

use gonio_optics::colour::D65_WHITE;
use pulp::{Arch, Simd, WithSimd};

/// ε and κ of CIE 15, in which the curve is linear below.
const EPSILON: f32 = 216.0 / 24389.0;
const KAPPA: f32 = 24389.0 / 27.0;

/// XYZ over white, times π, from linear Rec. 709.
fn matrix() -> [[f32; 3]; 3] {
    let columns = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]].map(gonio_optics::colour::xyz_from_rgb);
    [0, 1, 2].map(|i| [0, 1, 2].map(|j: usize| (std::f64::consts::PI * columns[j][i] / D65_WHITE[i]) as f32))
}

#[inline(always)]
fn cube_root(x: f32) -> f32 {
    let mut y = f32::from_bits(x.to_bits() / 3 + 0x2a51_4067);
    for _ in 0..2 {
        let cube = y * y * y;
        y *= (cube + 2.0 * x) / (2.0 * cube + x);
    }
    y
}

#[inline(always)]
fn curve(t: f32) -> f32 {
    let root = cube_root(if t > EPSILON { t } else { 1.0 });
    if t > EPSILON { root } else { (KAPPA * t + 16.0) / 116.0 }
}

struct Many<'a> {
    values: &'a [[f32; 3]],
    lab: [&'a mut [f32]; 3],
    matrix: [[f32; 3]; 3],
}

impl WithSimd for Many<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let [l, a, b] = self.lab;
        let m = self.matrix;
        // colours apart first: the curve then runs over whole registers
        for (((f, l), a), b) in self.values.iter().zip(&mut *l).zip(&mut *a).zip(&mut *b) {
            (*l, *a, *b) = (f[0], f[1], f[2]);
        }
        for ((l, a), b) in l.iter_mut().zip(a).zip(b) {
            let (r, g, blue) = (*l, *a, *b);
            let x = curve(m[0][0] * r + m[0][1] * g + m[0][2] * blue);
            let y = curve(m[1][0] * r + m[1][1] * g + m[1][2] * blue);
            let z = curve(m[2][0] * r + m[2][1] * g + m[2][2] * blue);
            *l = 116.0 * y - 16.0;
            *a = 500.0 * (x - y);
            *b = 200.0 * (y - z);
        }
    }
}

/// L*, a* and b* of `π f` of BRDF values (1/sr), into three lists as long as `values`; longer ones keep their rest.
pub fn lab_from_brdf_lanes(values: &[[f32; 3]], lab: [&mut [f32]; 3]) {
    let n = values.len();
    let lab = lab.map(|axis| {
        let length = axis.len().min(n);
        &mut axis[..length]
    });
    Arch::new().dispatch(Many { values, lab, matrix: matrix() });
}

/// BRDF value (1/sr) of a Lab colour; what lies outside of all real colours has a negative channel.
#[must_use]
pub fn brdf_from_lab(lab: [f64; 3]) -> [f64; 3] {
    let y = (lab[0] + 16.0) / 116.0;
    let f = [y + lab[1] / 500.0, y, y - lab[2] / 200.0];
    let inverse = |f: f64| if f > 6.0 / 29.0 { f * f * f } else { (116.0 * f - 16.0) * 27.0 / 24389.0 };
    let xyz = [0, 1, 2].map(|i: usize| inverse(f[i]) * D65_WHITE[i]);
    gonio_optics::colour::rgb_from_xyz(xyz).map(|c| c / std::f64::consts::PI)
}
