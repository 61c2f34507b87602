//! What most models are: a Lambert term with lobes over it, `f = cd/π + Σ_k s_k S_k(l, v)`, nothing below the horizon.

use std::f64::consts::FRAC_1_PI;

use gonio_optics::Vec3;

use crate::Rgb;

/// `cd/π + Σ s S` for pairs of a colour s and the value S of its lobe at (l, v); zero where light or view is below the horizon.
pub(super) fn over_lambert(
    light: Vec3,
    view: Vec3,
    diffuse: Rgb,
    lobes: impl IntoIterator<Item = (Rgb, f64)>,
) -> Rgb {
    if light.z < 0.0 || view.z < 0.0 {
        return [0.0; 3];
    }
    let mut f = diffuse.map(|d| d * FRAC_1_PI);
    for (colour, value) in lobes {
        for (out, s) in f.iter_mut().zip(colour) {
            *out += s * value;
        }
    }
    f
}
