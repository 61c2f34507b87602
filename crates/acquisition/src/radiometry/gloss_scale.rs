//! Black glass against Fresnel's reflectance: the scale of a gloss, and the lamp's profile across its mirror image.

use std::collections::BTreeMap;
use std::sync::Arc;

use gonio_instrument::PoseRecord;
use gonio_instrument::radiometry::{GlossScale, Known};
use gonio_optics::{Angle, Vec3, fresnel, quadrature};

use super::stray::Stray;
use crate::cells::{PixelValue, per_rate};
use crate::coat::{self, Gloss};
use crate::error::AcquisitionError;
use crate::merge_white::Merger;
use crate::options::Options;
use crate::pixel_map::{PixelMap, PoseView};
use crate::reference::WhiteReference;
use crate::sweep::Window;

/// Steps of the profile in units of α.
const STEP: f64 = 0.1;
/// Steps of the profile.
const STEPS: usize = 20;
/// Pixels larger than this part of α show no profile.
const COARSE: f64 = 0.7;
/// Poses whose reflectance is below this are left out: their noise is all there is.
const LEAST_OVER_SIGMA: f64 = 8.0;

/// Sums over the poses of black glass.
#[derive(Debug, Default)]
pub struct GlossSeries {
    /// (θi, measured over expected, relative uncertainty).
    pub points: Vec<(Angle, f64, f64)>,
    profile: Vec<[f64; 3]>,
}

impl GlossSeries {
    /// Adds what [`crate::coat::gloss`] found at a pose. Where pixels are fine enough, the profile too.
    pub(crate) fn add(
        &mut self,
        gloss: &Gloss,
        values: &[PixelValue],
        map: &PixelMap,
        view: &PoseView,
        index: f64,
        mean_cos_i: f64,
    ) {
        let Some(reflectance) = gloss.reflectance else { return };
        if reflectance < LEAST_OVER_SIGMA * gloss.sigma {
            return;
        }
        let expected = fresnel::dielectric(gloss.theta_i.cos(), index);
        self.points.push((gloss.theta_i, reflectance / expected, gloss.sigma / expected));
        let alpha = map.description().lamp.half_angle().radians();
        let light = Vec3::from_polar(gloss.theta_i, Angle::ZERO);
        let along = Vec3::new(-light.z, 0.0, -light.x.max(0.0)).normalized();
        let level = reflectance / (mean_cos_i * std::f64::consts::PI * alpha.sin().powi(2));
        self.profile.resize(STEPS, [0.0; 3]);
        for (p, v) in values.iter().enumerate().filter(|(p, v)| view.visible[*p] && v.f.is_finite()) {
            let d = view.sample_from_lab.apply(map.direction(p));
            let (x, y) = (d.dot(along) - gloss.offset[0].radians(), d.y - gloss.offset[1].radians());
            let r = x.hypot(y) / alpha;
            let bin = (r / STEP) as usize;
            if bin >= STEPS || d.z <= 0.0 || map.solid_angle(p).sqrt() > COARSE * alpha {
                continue;
            }
            let own = (f64::from(v.f) - gloss.base[map.channel(p)]) / level;
            for (s, t) in self.profile[bin].iter_mut().zip([1.0, r, own]) {
                *s += t;
            }
        }
    }

    /// The scale; `common` is the relative uncertainty that all poses share (the white reference). `None` without poses.
    #[must_use]
    pub fn finish(&self, index: f64, common: f64, alpha_deg: f64) -> Option<GlossScale> {
        if self.points.is_empty() {
            return None;
        }
        let weight = |p: &(Angle, f64, f64)| p.2.powi(2).recip();
        let total: f64 = self.points.iter().map(weight).sum();
        let scale = self.points.iter().map(|p| weight(p) * p.1).sum::<f64>() / total;
        // poses of one tilt show the gloss in the same pixels, whose white reference errs alike: tilts scatter on their own
        let mut tilts: BTreeMap<i64, f64> = BTreeMap::new();
        for p in &self.points {
            *tilts.entry((p.0.degrees() * 1e2).round() as i64).or_default() += weight(p) * (p.1 - scale);
        }
        let n = tilts.len() as f64;
        let between =
            tilts.values().map(|s| s * s).sum::<f64>().sqrt() / total * (n / (n - 1.0).max(1.0)).sqrt();
        let sigma = between.max(total.sqrt().recip()).hypot(common * scale);
        let profile: Vec<[f64; 2]> =
            self.profile.iter().filter(|b| b[0] >= 4.0).map(|b| [b[1] / b[0], b[2] / b[0]]).collect();
        Some(GlossScale {
            index,
            scale: Known::new(scale, sigma),
            poses: self.points.len() as u32,
            half_angle_deg: half_level(&profile).map(|r| Known::new(r * alpha_deg, 0.5 * STEP * alpha_deg)),
            profile,
        })
    }
}

/// What the poses of black glass show at the mirror direction, stray light taken off.
///
/// # Errors
/// [`AcquisitionError`] for frames of another camera or a pose without light.
pub fn glosses(
    poses: &mut dyn Iterator<Item = PoseRecord>,
    map: &Arc<PixelMap>,
    white: &WhiteReference,
) -> Result<Vec<Gloss>, AcquisitionError> {
    let mut out = Vec::new();
    seen(poses, map, white, &mut |g, _, _, _| out.push(g.clone()))?;
    Ok(out)
}

/// Takes a gloss, the values of all pixels, the view, the mean of cos θ' over the lamp.
type Listener<'a> = dyn FnMut(&Gloss, &[PixelValue], &PoseView, f64) + 'a;

/// Calls `found` with the gloss of each pose, the values of its pixels, its view and the mean of cos θ' over the lamp.
pub(crate) fn seen(
    poses: &mut dyn Iterator<Item = PoseRecord>,
    map: &Arc<PixelMap>,
    white: &WhiteReference,
    found: &mut Listener<'_>,
) -> Result<(), AcquisitionError> {
    let stray = Stray::of(map);
    let all = vec![true; map.width() * map.height()];
    let mut merger = Merger::new(map.clone(), &Options::default());
    for record in poses {
        let Some((mut m, _)) = merger.add(&record, &all)? else { continue };
        if let Some(s) = &stray {
            s.correct(&mut m.pixels, map);
        }
        let view = map.view(record.readback);
        let light = Vec3::from_polar(view.theta_i, Angle::ZERO);
        let lights = quadrature::cone(light, map.description().lamp.half_angle(), 4);
        let mean_cos = lights.iter().map(|l| l.z.max(0.0)).sum::<f64>() / lights.len() as f64;
        let mean_cos = mean_cos.max(gonio_optics::COS_FLOOR);
        let per_rate = per_rate(map, &view, white, mean_cos);
        let values: Vec<PixelValue> = (0..m.pixels.len())
            .map(|p| match view.visible[p] {
                true => PixelValue::of(&m.pixels[p], per_rate[p], white.relative_variance[p]),
                false => PixelValue::UNKNOWN,
            })
            .collect();
        let reached = coat::gloss::reached(map, &view);
        let near = reached.near.iter().map(|p| *p as usize);
        let mut window = Window::about(near.clone(), map.width(), &white.relative_variance);
        near.for_each(|p| window.set(p, values[p]));
        if let Some(g) = coat::gloss::find(map, &view, &window, &reached, mean_cos).gloss {
            found(&g, &values, &view, mean_cos);
        }
    }
    Ok(())
}

/// Where the profile falls through half of its inner level, in units of α.
fn half_level(profile: &[[f64; 2]]) -> Option<f64> {
    let inner: Vec<f64> = profile.iter().filter(|p| p[0] < 0.5).map(|p| p[1]).collect();
    let half = 0.5 * inner.iter().sum::<f64>() / inner.len().max(1) as f64;
    let k = profile.windows(2).position(|w| w[0][0] > 0.4 && w[0][1] >= half && w[1][1] < half)?;
    let ([r0, a], [r1, b]) = (profile[k], profile[k + 1]);
    (!inner.is_empty() && a > b).then(|| r0 + (r1 - r0) * (a - half) / (a - b))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_edge_of_a_disc_is_at_half_its_level() {
        let profile: Vec<[f64; 2]> = (0..20)
            .map(|k| 0.1 * f64::from(k) + 0.05)
            .map(|r| [r, ((1.1 - r) / 0.2).clamp(0.0, 1.0)])
            .collect();
        assert!((half_level(&profile).expect("an edge") - 1.0).abs() < 1e-9);
        assert!(half_level(&profile[..5]).is_none() && half_level(&[]).is_none());
    }

    #[test]
    fn poses_that_read_two_per_cent_high_give_that_scale() {
        let points = (1..10).map(|k| (Angle::from_degrees(f64::from(7 * k)), 1.02, 0.001)).collect();
        let s = GlossSeries { points, profile: Vec::new() }.finish(1.567, 0.005, 0.5).expect("a scale");
        assert!((s.scale.value - 1.02).abs() < 1e-12 && (s.scale.sigma - 0.0051).abs() < 2e-4, "{s:?}");
        assert!(s.half_angle_deg.is_none());
    }
}
