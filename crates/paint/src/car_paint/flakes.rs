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

    /// At a place of the surface, mm; the textures cover it tile by tile. 1/sr.
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

    /// Side of a texel on the surface, mm.
    #[must_use]
    pub fn texel_mm(&self) -> f64 {
        self.texel_mm
    }

    /// Half angles of the slices.
    #[must_use]
    pub fn half(&self) -> &AngleAxis {
        &self.half
    }

    /// Angles of incidence of the slices.
    #[must_use]
    pub fn incidence(&self) -> &AngleAxis {
        &self.incidence
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

    /// The texel under a position, bilinear between slices. Tiles of the texture are laid side by side, each shifted and mirrored by chance, so that the eye
    /// finds no pattern; the one at the origin lies as it is. All slices are laid alike: a flake stays where it is.
    #[must_use]
    pub fn at(&self, place: FlakePlace, position_mm: [f64; 2]) -> Rgb {
        let [w, h] = self.btf.size();
        // tile and texel in it; a position that is not a number falls on the first texel
        let cell = |p: f64, n: usize| {
            let k = (p / self.texel_mm).floor();
            let (tile, texel) = ((k / n as f64).floor(), k.rem_euclid(n as f64));
            (tile as i64, (texel as usize).min(n - 1))
        };
        let ((tile_x, x), (tile_y, y)) = (cell(position_mm[0], w), cell(position_mm[1], h));
        let chance = scattered(tile_x, tile_y);
        let laid = |x: usize, n: usize, shift: u64, mirrored: bool| {
            let x = (x + shift as usize % n) % n;
            if mirrored { n - 1 - x } else { x }
        };
        let column = laid(x, w, chance & 0xffff, chance >> 32 & 1 == 1);
        let texel = laid(y, h, chance >> 16 & 0xffff, chance >> 33 & 1 == 1) * w + column;
        let n = self.incidence.len();
        bilinear(&self.half, &self.incidence, place, |k| {
            self.btf.slice(k / n, k % n).map_or([0.0; 3], |s| s[texel].map(f64::from))
        })
    }
}

/// A number by chance for each tile (splitmix64), 0 for the one at the origin.
fn scattered(x: i64, y: i64) -> u64 {
    if x == 0 && y == 0 {
        return 0;
    }
    let mut z =
        (x as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ (y as u64).wrapping_mul(0xc2b2_ae3d_27d4_eb4f);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

#[cfg(test)]
mod tests {
    use super::*;
    use gonio_optics::Angle;

    #[test]
    fn every_tile_holds_each_texel_once_and_the_first_lies_as_it_is() {
        let texels: Vec<[f32; 3]> = (0..12).map(|k| [k as f32, 0.0, 12.0]).collect();
        let axis = || vec![Angle::from_degrees(0.0)];
        let btf = FlakeBtf::new(axis(), axis(), [4, 3], texels).expect("sound");
        let s = FlakeSlices::new(Arc::new(btf), 0.1).expect("sound");
        let p = FlakePlace::default();
        assert_eq!(s.mean(p), [5.5, 0.0, 12.0]);
        let tile = |x0: f64, y0: f64| -> Vec<f64> {
            let at = |k: u32| [x0 + 0.1 * f64::from(k % 4) + 0.05, y0 + 0.1 * f64::from(k / 4) + 0.05];
            (0..12).map(|k| s.at(p, at(k))[0]).collect()
        };
        let straight: Vec<f64> = (0..12).map(f64::from).collect();
        assert_eq!(tile(0.0, 0.0), straight);
        let mut others = 0;
        for (x, y) in [(1, 0), (0, 1), (-1, 0), (-3, 5), (40, -7)] {
            let laid = tile(0.4 * f64::from(x), 0.3 * f64::from(y));
            others += usize::from(laid != straight);
            let mut sorted = laid;
            sorted.sort_by(f64::total_cmp);
            assert_eq!(sorted, straight, "{x} {y}");
        }
        assert!(others >= 4);
        assert!((0.0..12.0).contains(&s.at(p, [f64::NAN, f64::INFINITY])[0]));
        let message = FlakeSlices::new(Arc::clone(s.btf()), 0.0).expect_err("no side").to_string();
        assert!(message.contains("texel_mm = 0"), "{message}");
    }
}
