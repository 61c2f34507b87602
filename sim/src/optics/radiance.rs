//! The map of electron rates of a pose: what each pixel collects per second at the lamp's nominal output, without noise.
//!
//! ```text
//! rate(p) = G · k(p) · lit(p) · mean over pixel and lamp of  f cos θ'        (e/s)
//! ```
//!
//! k(p) is the mirror's reflectance times the pixel's étendue relative to the axis (cos⁴ law and distortion); lit(p) the lit share of the
//! pixel's footprint on the sample. G = E0·g is chosen so that a white sample (0.98) in normal light fills half the well of a
//! pixel on the axis in 20 ms. Pixels on an edge (mirror rim, openings, shadow of the holder) are averaged over the places that see the sample.
//! What does not see the sample is dark: the holder is black, and light that meets the mirror twice is left out.

use gonio_instrument::{BayerPattern, Description, Misalignment, Pose};
use gonio_optics::{Geometry, Vec3};
use rayon::prelude::*;

use super::camera::Lens;
use super::footprint::{Footprint, LitZone};
use super::holder::{Holder, Stand};
use super::lamp::Lamp;
use super::mirror::Ellipsoid;
use super::pixel_mean::{Averager, Look, Patch};
use super::sample::Sample;
use super::stray::{Returned, Stray};
use crate::flakes::Field;

/// White albedo and time that fix the scale.
const SCALE_ALBEDO: f64 = 0.98;
const SCALE_TIME_S: f64 = 0.020;
/// Places a side into which a pixel on an edge is cut.
const EDGE_PLACES: u32 = 4;
/// Rows traced by one task.
const BAND_ROWS: usize = 16;

/// The traced instrument: description, errors and radiometric scale.
#[derive(Clone, Debug)]
pub struct VirtualOptics {
    lens: Lens,
    mirror: Ellipsoid,
    lamp: Lamp,
    holder: Holder,
    size: [u32; 2],
    pattern: BayerPattern,
    scale_e_per_s: f64,
    spin_offset_mm: f64,
    stray: Option<Stray>,
}

/// What a place on the sensor sees.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sight {
    /// Unit direction to the centre of the lamp, sample frame.
    pub light: Vec3,
    /// Unit direction to the camera by way of the mirror, sample frame.
    pub view: Vec3,
    /// The same as angles.
    pub geometry: Geometry,
    /// Unit direction from the sample to the mirror, lab frame.
    pub view_lab: Vec3,
    /// Point on the sample relative to its centre, lab axes, mm.
    pub place_mm: Vec3,
    /// k: mirror reflectance times étendue relative to the axis.
    pub k: f64,
    /// Lit share of the footprint, 0…1.
    pub lit: f64,
}

/// Electron rates of a pose, e/s at nominal lamp output, row by row; each pixel in the channel of its filter.
#[derive(Clone, Debug, PartialEq)]
pub struct RateMap {
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// e/s, `width * height` long.
    pub rates: Vec<f32>,
}

/// A pose as the tracer needs it.
struct Scene<'a> {
    stand: Stand,
    zone: LitZone,
    /// The beam reaches every point of its spot.
    beam_free: bool,
    averager: Averager<'a>,
    local: Option<LocalFlakes<'a>>,
    /// What the camera's face gives back, and the cosine of the light it goes with.
    returned: Option<(Returned, f64)>,
}

/// Single flakes under the footprints of a pose.
struct LocalFlakes<'a> {
    field: &'a Field,
    light: Vec3,
    /// F1 in the sample's own plane: the spin axis stands off it, so that spins see different flakes.
    origin: [f64; 2],
}

/// A chief ray that reached the sample.
#[derive(Clone, Copy)]
struct Traced {
    look: Look,
    lit: f64,
    /// On the sample, lab axes, relative to F1, mm.
    place: Vec3,
    radii: [Vec3; 2],
}

impl VirtualOptics {
    /// The optics of an instrument with its errors. What a calibration has found (`description.calibration`) is not applied:
    /// the truth is nominal plus `errors`.
    #[must_use]
    pub fn new(description: &Description, errors: &Misalignment) -> Self {
        let lamp = Lamp::new(description, errors);
        let c = &description.camera;
        let white = SCALE_ALBEDO * std::f64::consts::FRAC_1_PI * description.mirror.reflectance;
        let scale_e_per_s = 0.5 * c.full_well_e / (SCALE_TIME_S * white);
        Self {
            stray: errors
                .radiometry
                .as_ref()
                .and_then(|i| Stray::new(description, i, 0.5 * c.full_well_e / SCALE_TIME_S)),
            lens: Lens::new(description, errors),
            mirror: Ellipsoid::new(description, errors, lamp.direction),
            holder: Holder::new(description, errors),
            lamp,
            size: c.size,
            pattern: c.pattern,
            scale_e_per_s,
            spin_offset_mm: description.holder.spin_offset_mm,
        }
    }

    /// G = E0·g, electrons per second for k = 1 and f cos θ = 1/sr.
    #[must_use]
    pub fn scale_e_per_s(&self) -> f64 {
        self.scale_e_per_s
    }

    /// What goes astray, where anything does.
    #[must_use]
    pub fn stray(&self) -> Option<&Stray> {
        self.stray.as_ref()
    }

    /// The lens.
    #[must_use]
    pub fn lens(&self) -> &Lens {
        &self.lens
    }

    /// The lamp.
    #[must_use]
    pub fn lamp(&self) -> &Lamp {
        &self.lamp
    }

    /// What the centre of pixel (column, row) sees at an actual pose; `None` where it does not see the sample's front.
    #[must_use]
    pub fn trace_pixel(&self, actual: Pose, sample: &Sample, column: u32, row: u32) -> Option<Sight> {
        self.trace_place(actual, 0.0, sample, f64::from(column) + 0.5, f64::from(row) + 0.5)
    }

    /// What a place on the sensor (see [`super::camera`]) sees, with the surface `height_mm` above F1.
    #[must_use]
    pub fn trace_place(
        &self,
        actual: Pose,
        height_mm: f64,
        sample: &Sample,
        column: f64,
        row: f64,
    ) -> Option<Sight> {
        let stand = self.holder.at(actual, height_mm, sample.wedge);
        let zone = self.lit_zone(&stand);
        let (hit, lit) = self.follow(&stand, &zone, column, row)?;
        let light = stand.sample_from_lab(self.lamp.direction);
        let view = stand.sample_from_lab(hit.view_lab);
        Some(Sight {
            light,
            view,
            geometry: Geometry::from_directions(light, view),
            view_lab: hit.view_lab,
            place_mm: hit.place,
            k: hit.k,
            lit,
        })
    }

    /// The electron rates of every pixel, traced on all cores of the current rayon pool. The result does not depend on their number.
    #[must_use]
    pub fn rate_map(&self, actual: Pose, height_mm: f64, sample: &Sample) -> RateMap {
        let scene = self.scene(actual, height_mm, sample);
        let [width, height] = self.size;
        let mut rates = vec![0f32; width as usize * height as usize];
        if scene.averager.lit() {
            rates.par_chunks_mut(width as usize * BAND_ROWS).enumerate().for_each(|(band, out)| {
                self.trace_band(&scene, (band * BAND_ROWS) as u32, out);
            });
        }
        if let Some(stray) = &self.stray {
            stray.spread(&mut rates);
        }
        RateMap { width, height, rates }
    }

    fn scene<'a>(&self, actual: Pose, height_mm: f64, sample: &'a Sample) -> Scene<'a> {
        let stand = self.holder.at(actual, height_mm, sample.wedge);
        let zone = self.lit_zone(&stand);
        let light = stand.sample_from_lab(self.lamp.direction);
        let averager = Averager::new(
            sample.base.as_ref(),
            sample.gloss_index,
            light,
            self.lamp.seen_along(light),
            self.lamp.half_angle_rad,
            self.lamp.omega_sr,
        );
        let beam_free = self.beam_is_free(&stand);
        let (sin, cos) = actual.spin.sin_cos();
        let local = sample.flakes.as_deref().map(|field| LocalFlakes {
            field,
            light,
            origin: [self.spin_offset_mm * cos, -self.spin_offset_mm * sin],
        });
        let returned = self.stray.as_ref().and_then(|stray| {
            let axes = stand.axes;
            let lab = |v: Vec3| axes[0] * v.x + axes[1] * v.y + axes[2] * v.z;
            Some((stray.returned(sample, light, lab)?, light.z))
        });
        Scene { stand, zone, beam_free, averager, local, returned }
    }

    fn lit_zone(&self, stand: &Stand) -> LitZone {
        LitZone {
            beam: self.lamp.direction,
            beam_radius_mm: self.lamp.spot_radius_mm,
            sample_centre: stand.point,
            sample_radius_mm: stand.radius_mm,
        }
    }

    /// Whether nothing of the holder stands in the beam, judged by its axis and 24 lines on its mantle.
    fn beam_is_free(&self, stand: &Stand) -> bool {
        let b = self.lamp.direction;
        let (u, v) = b.orthonormal_basis();
        (0..=24).all(|i| {
            let (s, c) = (std::f64::consts::TAU * f64::from(i) / 24.0).sin_cos();
            let r = if i == 24 { 0.0 } else { self.lamp.spot_radius_mm };
            let from = b * 1e3 + u * (r * c) + v * (r * s);
            match stand.meet(from, -b) {
                // beyond the sample's rim nothing is lit anyway
                Some((t, at)) if at.norm() <= stand.radius_mm => !stand.hides(from, -b, t),
                _ => true,
            }
        })
    }

    /// Follows a chief ray to the sample.
    fn follow(&self, stand: &Stand, zone: &LitZone, column: f64, row: f64) -> Option<(Hit, f64)> {
        let (ray, etendue) = self.lens.ray(column, row);
        let strike = self.mirror.meet(ray)?;
        if !self.mirror.covers(strike.point) {
            return None;
        }
        let (way, place) = stand.meet(strike.point, strike.reflected)?;
        if stand.hides(ray.origin, ray.direction, strike.distance_mm)
            || stand.hides(strike.point, strike.reflected, way)
        {
            return None;
        }
        let footprint = Footprint::new(
            stand.point + place,
            self.lens.pupil_axes(),
            ray.direction,
            strike.normal,
            strike.reflected,
            stand.axes[2],
            way / strike.distance_mm,
        );
        let lit = footprint.lit(zone);
        let hit = Hit {
            view_lab: -strike.reflected,
            place,
            radii: footprint.radii,
            k: etendue * self.mirror.reflectance,
        };
        (lit > 0.0).then_some((hit, lit))
    }

    fn trace(&self, scene: &Scene<'_>, column: f64, row: f64) -> Option<Traced> {
        let (hit, lit) = self.follow(&scene.stand, &scene.zone, column, row)?;
        if !scene.beam_free {
            let at = scene.stand.point + hit.place;
            let b = self.lamp.direction;
            if scene.stand.hides(at + b * 1e3, -b, 1e3 - 1e-6) {
                return None;
            }
        }
        Some(Traced {
            look: Look { view: scene.stand.sample_from_lab(hit.view_lab), k: hit.k },
            lit,
            place: hit.place,
            radii: hit.radii,
        })
    }

    fn trace_band(&self, scene: &Scene<'_>, first_row: u32, out: &mut [f32]) {
        let width = self.size[0];
        let corner_row = |row: u32| -> Vec<Option<Traced>> {
            (0..=width).map(|c| self.trace(scene, f64::from(c), f64::from(row))).collect()
        };
        let mut above = corner_row(first_row);
        for (line, row) in out.chunks_mut(width as usize).zip(first_row..) {
            let below = corner_row(row + 1);
            let corners = above.windows(2).zip(below.windows(2));
            for ((pixel, (top, bottom)), column) in line.iter_mut().zip(corners).zip(0u32..) {
                let channel = self.pattern.channel(column, row) as usize;
                let value = match (top, bottom) {
                    ([None, None], [None, None]) => continue,
                    ([Some(a), Some(b)], [Some(c), Some(d)]) => {
                        let patch = Patch([a.look, b.look, c.look, d.look]);
                        let lit = 0.25 * (a.lit + b.lit + c.lit + d.lit);
                        let smooth =
                            scene.averager.smooth_part(&patch, channel) * scene.flakes([a, b, c, d], channel);
                        let returned =
                            [a, b, c, d].iter().map(|t| scene.returned(t.look, channel)).sum::<f64>();
                        lit * (smooth + scene.averager.gloss_part(&patch) + 0.25 * returned)
                    }
                    _ => self.edge_pixel(scene, column, row, channel),
                };
                *pixel = (self.scale_e_per_s * value) as f32;
            }
            above = below;
        }
    }

    /// Mean over a pixel of which a part does not see the sample.
    fn edge_pixel(&self, scene: &Scene<'_>, column: u32, row: u32, channel: usize) -> f64 {
        let step = 1.0 / f64::from(EDGE_PLACES);
        let mut sum = 0.0;
        for j in 0..EDGE_PLACES {
            for i in 0..EDGE_PLACES {
                let c = f64::from(column) + (f64::from(i) + 0.5) * step;
                let r = f64::from(row) + (f64::from(j) + 0.5) * step;
                if let Some(t) = self.trace(scene, c, r) {
                    // the footprint of an edge pixel is as large as any: its own flakes are those of its neighbours
                    sum += t.lit * (scene.averager.place(t.look, channel) + scene.returned(t.look, channel));
                }
            }
        }
        sum * step * step
    }
}

/// Where a chief ray met the sample.
struct Hit {
    view_lab: Vec3,
    place: Vec3,
    radii: [Vec3; 2],
    k: f64,
}

impl Scene<'_> {
    /// What the camera's face adds to f cos θ at a corner, times k.
    fn returned(&self, look: Look, channel: usize) -> f64 {
        self.returned.as_ref().map_or(0.0, |(r, cos)| look.k * cos * r.at(look.view.z, channel))
    }

    /// What the flakes under a pixel send back over what they do on average; 1 for a sample without.
    fn flakes(&self, corners: [&Traced; 4], channel: usize) -> f64 {
        let Some(local) = &self.local else { return 1.0 };
        let sum = |f: fn(&Traced) -> Vec3| corners.iter().fold(Vec3::ZERO, |s, c| s + f(c)) * 0.25;
        let view = sum(|t| t.look.view).normalized();
        let flat = |v: Vec3| {
            let s = self.stand.sample_from_lab(v);
            [s.x, s.y]
        };
        let place = flat(sum(|t| t.place));
        let centre = [place[0] + local.origin[0], place[1] + local.origin[1]];
        let axes = [flat(corners[0].radii[0]), flat(corners[0].radii[1])];
        let own = local.field.over(local.light, view, centre, axes)[channel];
        let mean = local.field.mean_value(local.light, view)[channel];
        if mean > 0.0 { own / mean } else { 1.0 }
    }
}
