//! The half vector of two directions, in the quantities that keep their digits near the mirror direction and at grazing angles.

use gonio_optics::{COS_FLOOR, Vec3};

/// Half vector h = (l + v)/|l + v| as lobes need it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Half {
    /// sin² of its polar angle, 1 − (n·h)², computed without the subtraction.
    pub sin2: f64,
    /// h·v = h·l, floored at 1e-6.
    pub hv: f64,
}

impl Half {
    /// Of two unit directions. `l = −v` (both at 90°, opposite) takes h = n and h·v = 1e-6.
    pub(crate) fn new(light: Vec3, view: Vec3) -> Self {
        let s = light + view;
        let norm2 = s.norm_squared();
        if norm2 > 1e-24 {
            Self { sin2: ((s.x * s.x + s.y * s.y) / norm2).min(1.0), hv: (0.5 * norm2.sqrt()).max(COS_FLOOR) }
        } else {
            Self { sin2: 0.0, hv: COS_FLOOR }
        }
    }

    /// (n·h)^exponent as exp(exponent/2 · ln(1 − sin²)); 1 for exponent 0 everywhere.
    pub(crate) fn power(self, exponent: f64) -> f64 {
        cosine_power(self.sin2, exponent)
    }
}

/// cos^exponent from sin²: exact near 1, 0 at 90° for a positive exponent and 1 for exponent 0.
pub(crate) fn cosine_power(sin2: f64, exponent: f64) -> f64 {
    if exponent == 0.0 { 1.0 } else { (0.5 * exponent * (-sin2.min(1.0)).ln_1p()).exp() }
}

/// The larger of n·l and n·v, floored.
pub(crate) fn larger_cos(light: Vec3, view: Vec3) -> f64 {
    light.z.max(view.z).max(COS_FLOOR)
}
