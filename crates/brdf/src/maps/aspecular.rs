//! Colour by the aspecular angle alone, from one illumination angle (Kirchner's refs. 4–6): what the maps are measured against.

use gonio_optics::{Angle, Geometry, Vec3};

use crate::{Brdf, Rgb};

/// f over the angle between the view and the mirror direction, in-plane with light at one angle.
#[derive(Clone, Debug, PartialEq)]
pub struct Aspecular {
    /// At aspecular angles 0, 1, 2 … degrees; the last one counts beyond.
    values: Vec<[f32; 3]>,
}

impl Aspecular {
    /// From f in-plane with light at `theta_ill`, views on the light's side of the mirror direction as far as `largest`.
    #[must_use]
    pub fn from_brdf(brdf: &dyn Brdf, theta_ill: Angle, largest: Angle) -> Self {
        let last = (theta_ill + largest).degrees().max(1.0) as usize;
        let at = |k: usize| {
            let signed = theta_ill.degrees() - k as f64;
            let phi = if signed < 0.0 { 0.0 } else { 180.0 };
            let (l, v) = Geometry::from_degrees(theta_ill.degrees(), signed.abs(), phi).directions();
            brdf.eval(l, v).map(|f| if f.is_finite() { f as f32 } else { 0.0 })
        };
        Self { values: (0..=last).map(at).collect() }
    }

    /// Bytes of the table.
    #[must_use]
    pub fn bytes(&self) -> usize {
        self.values.len() * 12
    }
}

impl Brdf for Aspecular {
    fn eval(&self, light: Vec3, view: Vec3) -> Rgb {
        if light.z < 0.0 || view.z < 0.0 || self.values.len() < 2 {
            return [0.0; 3];
        }
        let x = view.angle_to(Vec3::new(-light.x, -light.y, light.z)).degrees();
        let k = (x as usize).min(self.values.len() - 2);
        let t = (x - k as f64).min(1.0);
        [0, 1, 2].map(|c| (1.0 - t) * f64::from(self.values[k][c]) + t * f64::from(self.values[k + 1][c]))
    }
}
