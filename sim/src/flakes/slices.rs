//! Slices of a tile at given angles inside the coat, without a camera: what a perfect texture camera would record, for comparisons; and two paints in one.

use gonio_optics::{Angle, Vec3};

use super::field::{Field, Seen};
use super::{FlakePaint, FlakePaintError, Population};

impl Field {
    /// f of the base (the coat's factor left out), 1/sr, of a rectangle of texels from `first`, for the half angle and the angle of incidence inside the coat; light,
    /// view and the half vector lie in the plane of x and z, the half vector towards +x. Pairs of angles that no light from outside reaches have a slice as well.
    #[must_use]
    pub fn slice(
        &self,
        half: Angle,
        incidence: Angle,
        first: [usize; 2],
        [width, height]: [usize; 2],
    ) -> Vec<[f32; 3]> {
        let at = |a: Angle| Vec3::new(a.sin(), 0.0, a.cos());
        let (l, v) = (at(half + incidence), at(half - incidence));
        if l.z <= 0.0 || v.z <= 0.0 {
            return vec![[0.0; 3]; width * height];
        }
        let seen = Seen::inside(l, v, 1.0);
        (0..width * height)
            .map(|k| self.texel_seen(first[0] + k % width, first[1] + k / width, &seen).map(|f| f as f32))
            .collect()
    }
}

impl FlakePaint {
    /// A paint with the flakes of both at their share of the density: `weight` of `b`, the rest of `a`, and what lies under them mixed alike. Coat, tile and seed are those of `a`.
    ///
    /// # Errors
    /// [`FlakePaintError::Value`] for a weight outside 0…1.
    pub fn mixed(a: &Self, b: &Self, weight: f64) -> Result<Self, FlakePaintError> {
        if !(0.0..=1.0).contains(&weight) {
            return Err(FlakePaintError::Value {
                key: "weight".to_owned(),
                found: weight.to_string(),
                expected: "a share within 0 … 1",
            });
        }
        let share =
            |p: &Population, w: f64| Population { density_per_mm2: p.density_per_mm2 * w, ..p.clone() };
        let flakes = a
            .flakes
            .iter()
            .map(|p| share(p, 1.0 - weight))
            .chain(b.flakes.iter().map(|p| share(p, weight)))
            .filter(|p| p.density_per_mm2 > 0.0)
            .collect();
        let blend = |x: [f64; 3], y: [f64; 3]| [0, 1, 2].map(|c| (1.0 - weight) * x[c] + weight * y[c]);
        Ok(Self {
            name: format!(
                "{:.0} % {} with {:.0} % {}",
                100.0 * (1.0 - weight),
                a.name,
                100.0 * weight,
                b.name
            ),
            diffuse: blend(a.diffuse, b.diffuse),
            absorption_per_mm: blend(a.absorption_per_mm, b.absorption_per_mm),
            flakes,
            ..a.clone()
        })
    }
}
