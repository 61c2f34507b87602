//! The gloss of one pose: what stands above the base at the mirror direction.
//!
//! A lamp of angular radius α has a mirror image of the same solid angle, so over the image `∫ f_gloss dω = F(θi)/cos θi` whatever the
//! pixels' size: pixels tile the image, each in its own colour, and gloss has none. The base under it is the surface fitted to a
//! ring around ([`super::local_base`]), one for each channel.

use gonio_optics::{Angle, Vec3};

use super::local_base::{LocalBase, Point};
use crate::cells::PixelValue;
use crate::pixel_map::{PixelMap, PoseView};
use crate::sweep::Window;

/// Pixels about the image's rim that its light may reach.
const MARGIN_PIXELS: f64 = 2.0;
/// Width of the ring that the base is fitted to: so many degrees, or pixels where those are coarse.
const RING_DEG: f64 = 3.5;
const RING_PIXELS: f64 = 5.0;
/// How far from its nominal place the gloss is looked for on an instrument that is not aligned, degrees.
const SEARCH_DEG: f64 = 1.0;
/// Excess over its uncertainty from which on the gloss itself says where it is.
const SEEN: f64 = 20.0;
/// Share of the disc's solid angle that its pixels must cover: some of its rim is margin, and a disc of a few dozen pixels is ragged.
const WHOLE: f64 = 0.85;

/// The gloss of a pose.
#[derive(Clone, Debug, PartialEq)]
pub struct Gloss {
    /// Angle of incidence.
    pub theta_i: Angle,
    /// Reflectance F of the surface; `None` where a pixel of the image is saturated or not seen.
    pub reflectance: Option<f64>,
    /// Its standard uncertainty from noise and from the base underneath.
    pub sigma: f64,
    /// Share of the excess that lies outside the image and one pixel about it: none for a smooth coat.
    pub halo: f64,
    /// Where the image was found beside the mirror direction, in and across the plane of incidence.
    pub offset: [Angle; 2],
    /// Pixels of the image that every exposure saturates.
    pub saturated: usize,
    /// f of the base at the mirror direction, 1/sr.
    pub base: [f64; 3],
    /// Its standard uncertainty.
    pub base_sigma: [f64; 3],
}

/// What a gloss hides at a pose.
#[derive(Debug)]
pub(crate) struct Hidden {
    /// What was found; `None` where the mirror direction is not seen or nothing around tells the base.
    pub(crate) gloss: Option<Gloss>,
    /// Pixels whose own light is not taken.
    pub(crate) pixels: Vec<u32>,
    /// f of the base there (NaN where unknown), in the order of `pixels`.
    pub(crate) base: Vec<f32>,
}

/// A pixel near the mirror direction.
#[derive(Clone, Copy)]
struct Near {
    pixel: u32,
    channel: u8,
    x: f64,
    y: f64,
    solid_angle: f64,
    value: PixelValue,
}

/// What of the sensor a gloss may concern at a tilt.
#[derive(Clone, Debug, Default)]
pub(crate) struct Reached {
    /// `None` where nothing of it is seen.
    field: Option<Field>,
    /// Pixels that are looked at.
    pub(crate) near: Vec<u32>,
    /// Pixels that a gloss may hide.
    pub(crate) hidden: Vec<u32>,
}

/// Where a gloss is looked for: the mirror direction (sample frame), directions in and across the plane of incidence, radii.
#[derive(Clone, Debug)]
struct Field {
    mirror: Vec3,
    axes: [Vec3; 2],
    alpha: f64,
    pitch: f64,
    inner: f64,
    ring: f64,
    reach: f64,
}

impl Field {
    /// About the mirror direction of a lamp in direction `light` (sample frame); `None` where nothing of it is seen.
    fn of(map: &PixelMap, view: &PoseView, light: Vec3) -> Option<Self> {
        let alpha = map.description().lamp.half_angle().radians();
        let mirror = Vec3::new(-light.x, -light.y, light.z);
        // in the plane of incidence, away from the normal; across it
        let along = Vec3::new(-light.z, 0.0, -light.x.max(0.0)).normalized();
        let axes = [along, Vec3::new(0.0, 1.0, 0.0)];
        let search = SEARCH_DEG.to_radians();
        let reach = alpha + search + 2.0 * RING_DEG.to_radians();
        let (nearest, _) = around(map, view, 0..view.visible.len(), mirror, reach)
            .map(|p| (p, view.sample_from_lab.apply(map.direction(p))))
            .map(|(p, d)| (p, d.dot(axes[0]).hypot(d.dot(axes[1]))))
            .min_by(|a, b| a.1.total_cmp(&b.1).then(a.0.cmp(&b.0)))?;
        let pitch = map.solid_angle(nearest).sqrt();
        let inner = alpha + MARGIN_PIXELS * pitch;
        let ring = (RING_DEG.to_radians()).max(RING_PIXELS * pitch);
        let reach = reach.max(inner + search + ring);
        Some(Self { mirror, axes, alpha, pitch, inner, ring, reach })
    }
}

/// What of the sensor a gloss may concern at a tilt.
pub(crate) fn reached(map: &PixelMap, view: &PoseView) -> Reached {
    let light = Vec3::from_polar(view.theta_i, Angle::ZERO);
    let Some(field) = Field::of(map, view, light) else { return Reached::default() };
    let near = around(map, view, 0..view.visible.len(), field.mirror, field.reach).map(|p| p as u32);
    // a centroid is at most a pixel beyond where it is looked for
    let most = field.inner + SEARCH_DEG.to_radians() + 2.0 * field.pitch;
    let hidden = around(map, view, 0..view.visible.len(), field.mirror, most).map(|p| p as u32);
    let (near, hidden) = (near.collect(), hidden.collect());
    Reached { field: Some(field), near, hidden }
}

/// Looks for a gloss at a pose; `mean_cos_i` is the mean of cos θ' over the lamp.
pub(crate) fn find(
    map: &PixelMap,
    view: &PoseView,
    window: &Window,
    reached: &Reached,
    mean_cos_i: f64,
) -> Hidden {
    let Some(field) = &reached.field else {
        return Hidden { gloss: None, pixels: Vec::new(), base: Vec::new() };
    };
    let &Field { alpha, pitch, inner, ring, .. } = field;
    let search = SEARCH_DEG.to_radians();
    let near: Vec<Near> = reached
        .near
        .iter()
        .map(|&p| {
            let p = p as usize;
            let d = view.sample_from_lab.apply(map.direction(p));
            Near {
                pixel: p as u32,
                channel: map.channel(p) as u8,
                x: d.dot(field.axes[0]),
                y: d.dot(field.axes[1]),
                solid_angle: map.solid_angle(p),
                value: window.get(p),
            }
        })
        .collect();
    // where it is: first with room for a misaligned instrument, then about the place found
    let mut centre = [0.0; 2];
    let wide = Disc { centre, inner: inner + search, ring };
    if let Some(found) = wide.measure(&near, alpha, pitch)
        && found.excess > SEEN * found.sigma
        && found.centroid[0].hypot(found.centroid[1]) < search + pitch
    {
        centre = found.centroid;
    }
    let disc = Disc { centre, inner, ring };
    let found = disc.measure(&near, alpha, pitch);
    let inside: Vec<&Near> = near.iter().filter(|n| disc.radius(n) <= inner).collect();
    let pixels = inside.iter().map(|n| n.pixel).collect();
    let base = inside
        .iter()
        .map(|n| {
            let place = disc.place(n);
            found.as_ref().map_or(f32::NAN, |f| f.bases[n.channel as usize].at(place[0], place[1]) as f32)
        })
        .collect();
    let gloss = found.map(|f| Gloss {
        theta_i: view.theta_i,
        reflectance: f.whole.then_some(f.excess * mean_cos_i),
        sigma: f.sigma * mean_cos_i,
        halo: f.halo,
        offset: centre.map(Angle::from_radians),
        saturated: f.saturated,
        base: [0, 1, 2].map(|c| f.bases[c].at(0.0, 0.0)),
        base_sigma: [0, 1, 2].map(|c| f.bases[c].variance(0.0, 0.0).sqrt()),
    });
    Hidden { gloss, pixels, base }
}

/// Those of `pixels` that see the sample within `reach` of the mirror direction.
fn around<'a>(
    map: &'a PixelMap,
    view: &'a PoseView,
    pixels: impl Iterator<Item = usize> + 'a,
    mirror: Vec3,
    reach: f64,
) -> impl Iterator<Item = usize> + 'a {
    let low = reach.cos();
    pixels.filter(|&p| view.visible[p]).filter(move |&p| {
        let d = view.sample_from_lab.apply(map.direction(p));
        d.dot(mirror) > low && d.z > 0.0
    })
}

/// A disc about the image, and the ring around it.
#[derive(Clone, Copy)]
struct Disc {
    centre: [f64; 2],
    inner: f64,
    ring: f64,
}

/// What a disc holds.
struct Found {
    bases: [LocalBase; 3],
    /// ∫ (f − base) dω over the disc.
    excess: f64,
    sigma: f64,
    halo: f64,
    centroid: [f64; 2],
    saturated: usize,
    whole: bool,
}

impl Disc {
    fn radius(&self, n: &Near) -> f64 {
        (n.x - self.centre[0]).hypot(n.y - self.centre[1])
    }

    /// From the centre, in units of the outer radius.
    fn place(&self, n: &Near) -> [f64; 2] {
        let unit = self.inner + self.ring;
        [(n.x - self.centre[0]) / unit, (n.y - self.centre[1]) / unit]
    }

    fn measure(&self, near: &[Near], alpha: f64, pitch: f64) -> Option<Found> {
        let outer = self.inner + self.ring;
        let ring = |c: u8| -> Vec<Point> {
            near.iter()
                .filter(|n| n.channel == c && n.value.f.is_finite())
                .filter(|n| (self.inner..=outer).contains(&self.radius(n)))
                .map(|n| {
                    let [x, y] = self.place(n);
                    Point { x, y, f: f64::from(n.value.f), variance: n.value.noise() }
                })
                .collect()
        };
        let bases = [LocalBase::fit(&ring(0))?, LocalBase::fit(&ring(1))?, LocalBase::fit(&ring(2))?];
        let (mut excess, mut variance, mut outside, mut covered, mut seen) = (0.0, 0.0, 0.0, 0.0, 0.0);
        let (mut moment, mut positive, mut saturated) = ([0.0; 2], 0.0, 0);
        let mut channel_sr = [0.0; 3];
        for n in near.iter().filter(|n| self.radius(n) <= self.inner) {
            covered += n.solid_angle;
            if n.value.f == f32::INFINITY {
                saturated += 1;
            }
            if !n.value.f.is_finite() {
                continue;
            }
            seen += n.solid_angle;
            channel_sr[n.channel as usize] += n.solid_angle;
            let [x, y] = self.place(n);
            let part = (f64::from(n.value.f) - bases[n.channel as usize].at(x, y)) * n.solid_angle;
            excess += part;
            variance += n.value.noise() * n.solid_angle * n.solid_angle;
            if self.radius(n) > alpha + pitch {
                outside += part;
            }
            if part > 0.0 {
                positive += part;
                moment[0] += part * n.x;
                moment[1] += part * n.y;
            }
        }
        // the sine coordinates foreshorten nothing at the centre: the disc's solid angle is π r²
        let disc = std::f64::consts::PI * self.inner * self.inner;
        variance += (0..3).map(|c| bases[c].variance(0.0, 0.0) * channel_sr[c].powi(2)).sum::<f64>();
        Some(Found {
            bases,
            excess,
            sigma: variance.sqrt(),
            halo: if excess > 0.0 { outside / excess } else { 0.0 },
            centroid: if positive > 0.0 { moment.map(|m| m / positive) } else { [0.0; 2] },
            saturated,
            whole: seen >= WHOLE * disc && seen >= 0.999 * covered,
        })
    }
}
