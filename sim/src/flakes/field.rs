//! The flakes of a tile: made from the description and its seed, asked texel by texel or on average.

use std::f64::consts::{FRAC_1_PI, PI};
use std::sync::{Arc, OnceLock};

use gonio_brdf::{Brdf, Rgb};
use gonio_optics::{Vec3, flake::FlakeVectors, fresnel};
use rand::RngExt;
use rand_distr::{Distribution, StandardNormal};

use super::{FlakePaint, Population, film::FilmTable};
use crate::optics::sensor::stream;

/// Classes of depth for the mean.
const DEPTHS: usize = 8;
/// Classes of film thickness for the mean.
const FILMS: usize = 12;
/// Points a side at which a texel is held against a flake.
const POINTS: usize = 4;
/// Beyond so many widths a flake is dark.
const DARK: f64 = 4.5;

/// A flake.
#[derive(Clone, Copy, Debug)]
pub(super) struct Flake {
    pub population: u16,
    /// Centre in the tile, mm.
    pub at: [f32; 2],
    pub radius: f32,
    /// Slope of its facet, −n_xy/n_z.
    pub slope: [f32; 2],
    pub depth: f32,
    pub film: f32,
    /// Share of its disc that no flake above it hides.
    pub visible: f32,
}

/// A flake's share of a texel.
#[derive(Clone, Copy, Debug)]
struct Share {
    flake: u32,
    share: f32,
}

/// What is the same for all flakes of a kind.
#[derive(Clone, Debug)]
pub(super) struct Kind {
    /// Width b of a flake in slopes.
    pub width: f64,
    /// Variance of the slope of half vector and flakes together, along either axis.
    variance: f64,
    film: FilmTable,
    /// Visible share of the surface by class of depth and film: (depth mm, film nm, share).
    classes: Vec<(f64, f64, f64)>,
}

/// A tile of flakes.
#[derive(Clone, Debug)]
pub struct Field {
    paint: FlakePaint,
    pub(super) kinds: Vec<Kind>,
    pub(super) flakes: Vec<Flake>,
    /// Texels along the tile.
    side: usize,
    /// Where each texel's shares begin, one more than texels.
    starts: Vec<u32>,
    shares: Vec<Share>,
    /// Mean share of the surface that no flake covers.
    bare: f64,
    /// Flakes by cells for footprints, made when the first is asked for.
    cells: OnceLock<super::footprint::Cells>,
}

/// Light and view inside the coat with all that flakes need of them.
#[derive(Clone, Copy, Debug)]
pub(super) struct Seen {
    /// k: what the coat lets through.
    pub factor: f64,
    /// Slope of the half vector.
    pub slope: [f64; 2],
    /// 1/(cos⁴θh̄ · 4 cos ī cos ō).
    pub scale: f64,
    /// sin θī.
    pub sine: f64,
    /// 1/cos ī + 1/cos ō: way in the coat per depth.
    pub way: f64,
}

impl Seen {
    /// Of two unit directions inside the coat, both above the surface.
    pub(super) fn inside(l: Vec3, v: Vec3, factor: f64) -> Self {
        let h = l + v;
        let flake = FlakeVectors::inside(l, v);
        let cos_h = flake.sum_z / flake.sum;
        Self {
            factor,
            slope: [-h.x / h.z, -h.y / h.z],
            scale: 1.0 / (cos_h.powi(4) * 4.0 * l.z * v.z),
            sine: 0.5 * flake.difference,
            way: 1.0 / l.z + 1.0 / v.z,
        }
    }
}

impl Field {
    /// The tile of a paint.
    ///
    /// # Errors
    /// As [`FlakePaint::check`].
    pub fn new(paint: FlakePaint) -> Result<Self, super::FlakePaintError> {
        paint.check()?;
        let mut flakes: Vec<Flake> = Vec::new();
        for (k, p) in paint.flakes.iter().enumerate() {
            scatter(&paint, p, k, &mut flakes);
        }
        // the highest first: it hides what lies below
        flakes.sort_by(|a, b| a.depth.total_cmp(&b.depth));
        let side = ((paint.tile_mm / paint.texel_mm).round() as usize).max(1);
        let (starts, shares, bare) = cover(&paint, side, &mut flakes);
        let kinds = paint.flakes.iter().enumerate().map(|(k, p)| kind(&paint, p, k, &flakes)).collect();
        Ok(Self { paint, kinds, flakes, side, starts, shares, bare, cells: OnceLock::new() })
    }

    /// What it is made from.
    #[must_use]
    pub fn paint(&self) -> &FlakePaint {
        &self.paint
    }

    /// Texels along the tile.
    #[must_use]
    pub fn side(&self) -> usize {
        self.side
    }

    /// Number of flakes in the tile.
    #[must_use]
    pub fn len(&self) -> usize {
        self.flakes.len()
    }

    /// Whether there is none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.flakes.is_empty()
    }

    /// Mean share of the surface that flakes cover.
    #[must_use]
    pub fn coverage(&self) -> f64 {
        1.0 - self.bare
    }

    /// The mean over the surface, as a BRDF without the coat's gloss.
    #[must_use]
    pub fn mean(self: &Arc<Self>) -> MeanPaint {
        MeanPaint(Arc::clone(self))
    }

    /// f of a texel, 1/sr, for unit directions outside; column and row repeat.
    #[must_use]
    pub fn texel(&self, column: usize, row: usize, light: Vec3, view: Vec3) -> Rgb {
        self.seen(light, view).map_or([0.0; 3], |s| self.texel_seen(column, row, &s))
    }

    /// f of a rectangle of texels from `first`, row by row.
    #[must_use]
    pub fn texels(
        &self,
        first: [usize; 2],
        [width, height]: [usize; 2],
        light: Vec3,
        view: Vec3,
    ) -> Vec<[f32; 3]> {
        let seen = self.seen(light, view);
        let mut out = vec![[0.0f32; 3]; width * height];
        if let Some(s) = seen {
            for (k, t) in out.iter_mut().enumerate() {
                let rgb = self.texel_seen(first[0] + k % width, first[1] + k / width, &s);
                *t = rgb.map(|v| v as f32);
            }
        }
        out
    }

    /// A pair of directions, to be asked at many places.
    pub(crate) fn prepared(&self, light: Vec3, view: Vec3) -> Prepared<'_> {
        Prepared { field: self, seen: self.seen(light, view) }
    }

    pub(super) fn texel_seen(&self, column: usize, row: usize, s: &Seen) -> Rgb {
        let t = (row % self.side) * self.side + column % self.side;
        let range = self.starts[t] as usize..self.starts[t + 1] as usize;
        let mut covered = 0.0;
        let mut sum = [0.0; 3];
        for share in &self.shares[range] {
            let weight = f64::from(share.share);
            covered += weight;
            self.add(&self.flakes[share.flake as usize], weight, s, &mut sum);
        }
        let under = (1.0 - covered).max(0.0);
        [0, 1, 2].map(|c| s.factor * (sum[c] + under * self.paint.diffuse[c] * FRAC_1_PI))
    }

    /// Adds what a flake sends back with this weight.
    pub(super) fn add(&self, flake: &Flake, weight: f64, s: &Seen, sum: &mut Rgb) {
        let kind = &self.kinds[usize::from(flake.population)];
        let b2 = kind.width * kind.width;
        let (dx, dy) = (s.slope[0] - f64::from(flake.slope[0]), s.slope[1] - f64::from(flake.slope[1]));
        let off = (dx * dx + dy * dy) / b2;
        if off > DARK * DARK {
            return;
        }
        let level = weight * s.scale * (-0.5 * off).exp() / (2.0 * PI * b2);
        let r = kind.film.at(f64::from(flake.film), s.sine);
        let depth = f64::from(flake.depth);
        for c in 0..3 {
            sum[c] += level * r[c] * self.tint(depth, s, c);
        }
    }

    fn tint(&self, depth: f64, s: &Seen, channel: usize) -> f64 {
        let mu = self.paint.absorption_per_mm[channel];
        if mu == 0.0 { 1.0 } else { (-mu * depth * s.way).exp() }
    }

    /// Directions outside carried into the coat; `None` below the horizon.
    pub(super) fn seen(&self, light: Vec3, view: Vec3) -> Option<Seen> {
        if !(light.z >= 0.0 && view.z >= 0.0) {
            return None;
        }
        let n = self.paint.coat_index;
        let t = |cos: f64| 1.0 - fresnel::dielectric(cos, n);
        let (l, v) = (fresnel::refract(light, n), fresnel::refract(view, n));
        Some(Seen::inside(l, v, t(light.z) * t(view.z) / (n * n)))
    }

    /// The mean over the surface and over the tilts flakes are drawn from, 1/sr.
    #[must_use]
    pub fn mean_value(&self, light: Vec3, view: Vec3) -> Rgb {
        self.seen(light, view).map_or([0.0; 3], |s| self.mean_at(&s))
    }

    fn mean_at(&self, s: &Seen) -> Rgb {
        let mut sum = self.paint.diffuse.map(|d| self.bare * d * FRAC_1_PI);
        let slope2 = s.slope[0] * s.slope[0] + s.slope[1] * s.slope[1];
        for kind in &self.kinds {
            let level = s.scale * (-0.5 * slope2 / kind.variance).exp() / (2.0 * PI * kind.variance);
            for &(depth, film, share) in &kind.classes {
                let r = kind.film.at(film, s.sine);
                for c in 0..3 {
                    sum[c] += share * level * r[c] * self.tint(depth, s, c);
                }
            }
        }
        sum.map(|v| s.factor * v)
    }

    /// Flakes by cells.
    pub(super) fn cells(&self) -> &super::footprint::Cells {
        self.cells.get_or_init(|| super::footprint::Cells::new(self.paint.tile_mm, &self.kinds, &self.flakes))
    }

    /// Mean reflectance of a kind's flakes, the coat over them included.
    pub(super) fn kind_colour(&self, kind: &Kind, s: &Seen) -> Rgb {
        let (mut sum, mut total) = ([0.0; 3], 0.0);
        for &(depth, film, share) in &kind.classes {
            let r = kind.film.at(film, s.sine);
            total += share;
            for c in 0..3 {
                sum[c] += share * r[c] * self.tint(depth, s, c);
            }
        }
        sum.map(|v| v / f64::max(total, f64::MIN_POSITIVE))
    }

    /// What lies between the flakes, without the coat's factor.
    pub(super) fn under(&self) -> Rgb {
        self.paint.diffuse.map(|d| self.bare * d * FRAC_1_PI)
    }
}

/// A tile under one light, seen from one side.
pub(crate) struct Prepared<'a> {
    field: &'a Field,
    seen: Option<Seen>,
}

impl Prepared<'_> {
    /// f of the texel at a place in the tile's plane, mm.
    pub(crate) fn at(&self, place_mm: [f64; 2]) -> Rgb {
        let f = self.field;
        let along = |x: f64| {
            let texels = (x / f.paint.tile_mm * f.side as f64).floor().rem_euclid(f.side as f64);
            (texels as usize).min(f.side - 1)
        };
        self.seen.as_ref().map_or([0.0; 3], |s| f.texel_seen(along(place_mm[0]), along(place_mm[1]), s))
    }
}

/// The mean of a flake paint over its surface and over the tilts that its flakes are drawn from.
#[derive(Clone, Debug)]
pub struct MeanPaint(Arc<Field>);

impl Brdf for MeanPaint {
    fn eval(&self, light: Vec3, view: Vec3) -> Rgb {
        self.0.mean_value(light, view)
    }

    // Beckmann's α² is twice the variance of the slope, and 2/α² the exponent of the same curvature
    fn sharpness(&self) -> f64 {
        self.0.kinds.iter().map(|k| 1.0 / k.variance).fold(0.0, f64::max)
    }
}

/// Draws the flakes of one kind.
fn scatter(paint: &FlakePaint, p: &Population, kind: usize, out: &mut Vec<Flake>) {
    let mut rng = stream(&[paint.seed, 0xf1a4e5, kind as u64], 0);
    let count = (p.density_per_mm2 * paint.tile_mm * paint.tile_mm).round() as usize;
    let slope = p.spread_deg.to_radians().tan();
    let mut normal = || -> f64 { StandardNormal.sample(&mut rng) };
    let drawn: Vec<[f64; 4]> = (0..count).map(|_| [normal(), normal(), normal(), normal()]).collect();
    for z in drawn {
        let mut even = || rng.random::<f64>();
        let (x, y, depth) = (even(), even(), even());
        out.push(Flake {
            population: kind as u16,
            at: [(x * paint.tile_mm) as f32, (y * paint.tile_mm) as f32],
            radius: (0.5 * p.size_mm * (p.size_spread * z[0].clamp(-3.0, 3.0)).exp()) as f32,
            slope: [(slope * z[1]) as f32, (slope * z[2]) as f32],
            depth: (p.depth_mm[0] + depth * (p.depth_mm[1] - p.depth_mm[0])) as f32,
            film: (p.film_nm + p.film_spread_nm * z[3].clamp(-4.0, 4.0)).max(0.0) as f32,
            visible: 1.0,
        });
    }
}

/// Which share of each texel belongs to which flake, from the top down; sets what of each flake is visible. Returns starts, shares and the bare share.
fn cover(paint: &FlakePaint, side: usize, flakes: &mut [Flake]) -> (Vec<u32>, Vec<Share>, f64) {
    let texel = paint.tile_mm / side as f64;
    let points = side * POINTS;
    let step = texel / POINTS as f64;
    // each point of a fine raster belongs to the highest flake over it
    let mut owner = vec![u32::MAX; points * points];
    for (k, f) in flakes.iter_mut().enumerate() {
        let (r, x, y) = (f64::from(f.radius), f64::from(f.at[0]), f64::from(f.at[1]));
        let span = |c: f64| (((c - r) / step - 0.5).ceil() as i64, ((c + r) / step - 0.5).floor() as i64);
        let ((x0, x1), (y0, y1)) = (span(x), span(y));
        let (mut all, mut own) = (0u32, 0u32);
        for j in y0..=y1 {
            for i in x0..=x1 {
                let (dx, dy) = ((i as f64 + 0.5) * step - x, (j as f64 + 0.5) * step - y);
                if dx * dx + dy * dy > r * r {
                    continue;
                }
                all += 1;
                let at = j.rem_euclid(points as i64) as usize * points + i.rem_euclid(points as i64) as usize;
                if owner[at] == u32::MAX {
                    owner[at] = k as u32;
                    own += 1;
                }
            }
        }
        // its visible area by the raster, over the area of its disc; a flake between the points is not seen by the texture camera either
        let area = f64::from(own) * step * step;
        f.visible = if all == 0 { 0.0 } else { (area / (PI * r * r)) as f32 };
    }
    let mut starts = Vec::with_capacity(side * side + 1);
    let mut shares: Vec<Share> = Vec::new();
    let mut bare = 0usize;
    let one = 1.0 / (POINTS * POINTS) as f32;
    for row in 0..side {
        for column in 0..side {
            starts.push(shares.len() as u32);
            let first = shares.len();
            for j in 0..POINTS {
                for i in 0..POINTS {
                    let flake = owner[(row * POINTS + j) * points + column * POINTS + i];
                    if flake == u32::MAX {
                        bare += 1;
                        continue;
                    }
                    match shares[first..].iter_mut().find(|s| s.flake == flake) {
                        Some(s) => s.share += one,
                        None => shares.push(Share { flake, share: one }),
                    }
                }
            }
        }
    }
    starts.push(shares.len() as u32);
    (starts, shares, bare as f64 / owner.len() as f64)
}

fn kind(paint: &FlakePaint, p: &Population, k: usize, flakes: &[Flake]) -> Kind {
    // full width at half height of a Gaussian, from angle to slope about the normal
    let width = p.life_deg.to_radians().tan() / (8.0 * 2f64.ln()).sqrt();
    let spread = p.spread_deg.to_radians().tan();
    let [low, high] = p.depth_mm;
    let films = if p.film_nm > 0.0 && p.film_spread_nm > 0.0 { FILMS } else { 1 };
    let depths = if high > low && paint.absorption_per_mm != [0.0; 3] { DEPTHS } else { 1 };
    let mut sums = vec![(0.0, 0.0, 0.0); depths * films];
    for f in flakes.iter().filter(|f| usize::from(f.population) == k) {
        let d = ((f64::from(f.depth) - low) / (high - low).max(1e-12) * depths as f64) as usize;
        let t = ((f64::from(f.film) - p.film_nm) / p.film_spread_nm.max(1e-12) / 6.0 + 0.5) * films as f64;
        let class = &mut sums[d.min(depths - 1) * films + (t.max(0.0) as usize).min(films - 1)];
        let r = f64::from(f.radius);
        let share = PI * r * r * f64::from(f.visible) / (paint.tile_mm * paint.tile_mm);
        class.0 += share * f64::from(f.depth);
        class.1 += share * f64::from(f.film);
        class.2 += share;
    }
    let classes =
        sums.into_iter().filter(|s| s.2 > 0.0).map(|(d, t, share)| (d / share, t / share, share)).collect();
    Kind {
        width,
        variance: width * width + spread * spread,
        film: FilmTable::new(paint.coat_index, p.film_index, p.film_nm, p.film_spread_nm, p.reflectance),
        classes,
    }
}
