//! Ξ(x, θh̄, θī) as a paint holds it: what flakes add at a place of the surface, and on average.

use std::sync::Arc;

use gonio_brdf::Rgb;
use gonio_optics::flake::FlakeVectors;

use super::{AngleAxis, CarPaintError, colour_table::bilinear};
use crate::FlakeBtf;
use crate::statistics::{FlakeStatistics, RandomTexture};

/// Where in the tables two directions inside the coat fall.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FlakePlace {
    /// sin θh̄ of the half angle.
    pub sin_half: f64,
    /// sin θī of the angle of incidence on a flake that mirrors one into the other.
    pub sin_incidence: f64,
}

impl FlakePlace {
    /// Of two directions inside the coat.
    #[must_use]
    pub fn of(v: FlakeVectors) -> Self {
        // light and view opposite along the surface: the flake lies flat
        let sin_half = if v.sum > 0.0 { (v.sum_xy / v.sum).min(1.0) } else { 0.0 };
        Self { sin_half, sin_incidence: (0.5 * v.difference).min(1.0) }
    }
}

/// What the flakes of a paint are told by.
#[derive(Clone, Debug, PartialEq)]
pub enum Flakes {
    /// The textures themselves.
    Slices(FlakeSlices),
    /// Statistics, drawn from a fixed random texture.
    Statistics(FlakeDraws),
}

/// Statistics with the size of a texel.
#[derive(Clone, Debug, PartialEq)]
pub struct FlakeDraws {
    statistics: Arc<FlakeStatistics>,
    texel_mm: f64,
    half: AngleAxis,
    incidence: AngleAxis,
}

/// Textures with the size of a texel and their means.
#[derive(Clone, Debug, PartialEq)]
pub struct FlakeSlices {
    btf: Arc<FlakeBtf>,
    texel_mm: f64,
    half: AngleAxis,
    incidence: AngleAxis,
    means: Vec<Rgb>,
}

impl Flakes {
    /// Name in files.
    #[must_use]
    pub const fn name(&self) -> &'static str {
        match self {
            Self::Slices(_) => "slices",
            Self::Statistics(_) => "statistics",
        }
    }

    /// Side of a texel on the surface, mm.
    #[must_use]
    pub fn texel_mm(&self) -> f64 {
        match self {
            Self::Slices(s) => s.texel_mm,
            Self::Statistics(s) => s.texel_mm,
        }
    }

    /// The mean over the surface, 1/sr.
    #[must_use]
    pub fn mean(&self, place: FlakePlace) -> Rgb {
        match self {
            Self::Slices(s) => s.mean(place),
            Self::Statistics(s) => s.mean(place),
        }
    }

    /// At a place of the surface, mm; the textures repeat. 1/sr.
    #[must_use]
    pub fn at(&self, place: FlakePlace, position_mm: [f64; 2]) -> Rgb {
        match self {
            Self::Slices(s) => s.at(place, position_mm),
            Self::Statistics(s) => s.at(place, position_mm),
        }
    }
}

impl FlakeDraws {
    /// Statistics drawn in texels whose side is `texel_mm` on the surface.
    ///
    /// # Errors
    /// [`CarPaintError`] for a side that is not above 0, angles that make no axis.
    pub fn new(statistics: Arc<FlakeStatistics>, texel_mm: f64) -> Result<Self, CarPaintError> {
        if !(texel_mm > 0.0 && texel_mm.is_finite()) {
            return Err(CarPaintError::value("texel_mm", texel_mm, "a length above 0, in mm"));
        }
        let half = AngleAxis::new("flake half", statistics.half().to_vec())?;
        let incidence = AngleAxis::new("flake incidence", statistics.incidence().to_vec())?;
        Ok(Self { statistics, texel_mm, half, incidence })
    }

    /// The statistics.
    #[must_use]
    pub fn statistics(&self) -> &Arc<FlakeStatistics> {
        &self.statistics
    }

    /// The mean at a place, bilinear between slices.
    #[must_use]
    pub fn mean(&self, place: FlakePlace) -> Rgb {
        bilinear(&self.half, &self.incidence, place, |k| self.statistics.means()[k])
    }

    /// What the texel under a position shows: each texel changes over from slice to slice at an angle of its own.
    #[must_use]
    pub fn at(&self, place: FlakePlace, position_mm: [f64; 2]) -> Rgb {
        // a position that is not a number falls on texel 0
        let [x, y] = position_mm.map(|p| (p / self.texel_mm).floor() as i64);
        let numbers = RandomTexture::shared().at(x, y);
        let (half, incidence) =
            (self.half.locate(place.sin_half), self.incidence.locate(place.sin_incidence));
        self.statistics.draw(self.statistics.chosen(half, incidence, numbers), numbers).1
    }
}

impl FlakeSlices {
    /// Textures whose texels have a side of `texel_mm` on the surface.
    ///
    /// # Errors
    /// [`CarPaintError::Value`] for a side that is not above 0.
    pub fn new(btf: Arc<FlakeBtf>, texel_mm: f64) -> Result<Self, CarPaintError> {
        if !(texel_mm > 0.0 && texel_mm.is_finite()) {
            return Err(CarPaintError::value("texel_mm", texel_mm, "a length above 0, in mm"));
        }
        let half = AngleAxis::new("flake half", btf.half().to_vec())?;
        let incidence = AngleAxis::new("flake incidence", btf.incidence().to_vec())?;
        let means = btf
            .slices()
            .map(|texels| {
                let mut sum = [0.0; 3];
                for t in texels {
                    for c in 0..3 {
                        sum[c] += f64::from(t[c]);
                    }
                }
                sum.map(|s| s / texels.len() as f64)
            })
            .collect();
        Ok(Self { btf, texel_mm, half, incidence, means })
    }

    /// The textures.
    #[must_use]
    pub fn btf(&self) -> &Arc<FlakeBtf> {
        &self.btf
    }

    /// Mean of each slice, in order of half angle, then angle of incidence, 1/sr.
    #[must_use]
    pub fn means(&self) -> &[Rgb] {
        &self.means
    }

    /// The mean at a place, bilinear between slices.
    #[must_use]
    pub fn mean(&self, place: FlakePlace) -> Rgb {
        bilinear(&self.half, &self.incidence, place, |k| self.means[k])
    }

    /// The texel under a position, bilinear between slices; the texture repeats over the surface.
    #[must_use]
    pub fn at(&self, place: FlakePlace, position_mm: [f64; 2]) -> Rgb {
        let [w, h] = self.btf.size();
        let cell = |p: f64, n: usize| {
            let k = (p / self.texel_mm).floor().rem_euclid(n as f64);
            // a position that is not a number falls on the first texel
            (k as usize).min(n - 1)
        };
        let texel = cell(position_mm[1], h) * w + cell(position_mm[0], w);
        let n = self.incidence.len();
        bilinear(&self.half, &self.incidence, place, |k| {
            self.btf.slice(k / n, k % n).map_or([0.0; 3], |s| s[texel].map(f64::from))
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use gonio_optics::Angle;

    #[test]
    fn textures_repeat_and_their_mean_is_that_of_their_texels() {
        let texels = vec![[1.0, 0.0, 0.0], [3.0, 0.0, 0.0], [0.0; 3], [0.0, 8.0, 0.0]];
        let btf =
            FlakeBtf::new(vec![Angle::from_degrees(0.0)], vec![Angle::from_degrees(0.0)], [2, 2], texels)
                .expect("sound");
        let s = FlakeSlices::new(Arc::new(btf), 0.1).expect("sound");
        let p = FlakePlace::default();
        assert_eq!(s.mean(p), [1.0, 2.0, 0.0]);
        for (at, expected) in
            [([0.05, 0.05], 1.0), ([0.15, 0.05], 3.0), ([-0.05, 0.01], 3.0), ([0.25, 0.41], 1.0)]
        {
            assert_eq!(s.at(p, at)[0], expected, "{at:?}");
        }
        assert_eq!(s.at(p, [f64::NAN, f64::INFINITY])[0], 1.0);
        let message = FlakeSlices::new(Arc::clone(s.btf()), 0.0).expect_err("no side").to_string();
        assert!(message.contains("texel_mm = 0"), "{message}");
    }
}
