//! What maps are fitted to: directions, f and its weight, from tables, scattered measurements and functions.

use gonio_optics::{Angle, Geometry, Vec3};

use crate::{Brdf, Flag, Measured, Rgb, Scattered};

/// One value of f.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample {
    /// Unit direction towards the light.
    pub light: Vec3,
    /// Unit direction towards the viewer.
    pub view: Vec3,
    /// f in 1/sr.
    pub value: Rgb,
    /// Standard uncertainty in 1/sr, zero where it is not known.
    pub sigma: Rgb,
    /// Solid angle of light and view it stands for, in any unit.
    pub weight: f64,
}

/// The geometries that take part.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Region {
    /// Largest polar angle of light and view.
    pub largest: Angle,
    /// Half angle of the cone about the mirror direction that is left out, for the gloss.
    pub from_mirror: Angle,
}

impl Default for Region {
    /// To 75°, the limit of Sopp's data; 15° about the mirror direction.
    fn default() -> Self {
        Self { largest: Angle::from_degrees(75.0), from_mirror: Angle::from_degrees(15.0) }
    }
}

impl Region {
    /// Whether a pair of directions takes part.
    #[must_use]
    pub fn contains(&self, light: Vec3, view: Vec3) -> bool {
        // rounding of a cosine must not lose the cells that stand on the limit
        let low = self.largest.cos() - 1e-9;
        light.z >= low
            && view.z >= low
            && view.angle_to(Vec3::new(-light.x, -light.y, light.z)) > self.from_mirror
    }

    /// `count` pairs of directions, uniform by the solid angle of light and view, the same ones for the same `seed`.
    ///
    /// A Kronecker sequence with the three-dimensional golden ratio, so every part of the region is met evenly.
    pub fn directions(self, count: usize, seed: u32) -> impl Iterator<Item = (Vec3, Vec3)> {
        const G: f64 = 1.220_744_084_605_759_5;
        let low = self.largest.cos();
        let start = f64::from(seed) * 0.618_033_988_749_894_9;
        (0u32..)
            .map(move |i| {
                let at = |step: f64| (start + f64::from(i) * step).fract();
                let (a, b, c) = (at(1.0 / G), at(1.0 / (G * G)), at(1.0 / (G * G * G)));
                let polar = |u: f64| Angle::from_radians((low + (1.0 - low) * u).acos());
                Geometry { theta_i: polar(a), theta_o: polar(b), phi: Angle::STRAIGHT * c }.directions()
            })
            .filter(move |&(l, v)| self.contains(l, v))
            .take(if self.from_mirror < Angle::RIGHT { count } else { 0 })
    }

    /// f of a function at `count` geometries of equal weight.
    #[must_use]
    pub fn of_brdf(self, brdf: &dyn Brdf, count: usize, seed: u32) -> Vec<Sample> {
        self.directions(count, seed)
            .map(|(light, view)| Sample {
                light,
                view,
                value: brdf.eval(light, view),
                sigma: [0.0; 3],
                weight: 1.0,
            })
            .filter(usable)
            .collect()
    }

    /// The measured cells of a table (filled and extrapolated ones are left out), weighted by the solid angle of light and view.
    #[must_use]
    pub fn of_table(self, table: &Measured) -> Vec<Sample> {
        (0..table.values.len())
            .filter(|i| table.flag.get(*i) == Some(&Flag::Measured))
            .filter_map(|i| self.of_cell(table, i))
            .collect()
    }

    /// Cell `i` of a table, where its middle lies within the region and its value is a number.
    pub(super) fn of_cell(self, table: &Measured, i: usize) -> Option<Sample> {
        let grid = &table.grid;
        let [ti, to, phi] = grid.coordinates(i);
        let geometry = grid.geometry(ti, to, phi);
        let (light, view) = geometry.directions();
        if !self.contains(light, view) {
            return None;
        }
        // the axis of incidence has no bins: a step of half a degree keeps the pole from weighing nothing
        let ring = geometry.theta_i.sin().max(Angle::from_degrees(0.5).sin());
        let sample = Sample {
            light,
            view,
            value: table.values.get(i)?.map(f64::from),
            sigma: table.sigma.get(i).map_or([0.0; 3], |s| s.map(f64::from)),
            weight: grid.solid_angle(to, phi) * ring,
        };
        usable(&sample).then_some(sample)
    }

    /// Scattered measurements, of equal weight.
    #[must_use]
    pub fn of_scattered(self, points: &Scattered) -> Vec<Sample> {
        let take = |p: &crate::ScatteredPoint| {
            let (light, view) = p.geometry.directions();
            (p.flag == Flag::Measured && self.contains(light, view)).then_some(Sample {
                light,
                view,
                value: p.value,
                sigma: p.sigma.unwrap_or_default(),
                weight: 1.0,
            })
        };
        points.points.iter().filter_map(take).filter(usable).collect()
    }
}

fn usable(s: &Sample) -> bool {
    s.value.iter().chain(&s.sigma).all(|x| x.is_finite()) && s.weight.is_finite() && s.weight > 0.0
}
