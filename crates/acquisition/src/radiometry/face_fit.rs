//! κ of the camera's own face, from a black and a white reference at the same tilts.
//!
//! With q the ratio of the two signals, each over its certified f cos θi, and `A = R S/f` of each: `q = (1 + κ A_b)/(1 + κ A_w)`.

use gonio_brdf::Brdf;
use gonio_instrument::Pose;
use gonio_instrument::radiometry::Known;
use gonio_optics::{Angle, Vec3, quadrature};

use super::face;
use crate::merge::Merged;
use crate::pixel_map::PixelMap;

/// Largest θo of a pixel that takes part, degrees.
const LIMIT_DEG: f64 = 65.0;

/// A pose of a reference with stray light but the face's taken off.
pub struct Seen<'a> {
    /// Pose read back.
    pub pose: Pose,
    /// The picture.
    pub pixels: Vec<Merged>,
    /// What the reference is certified to be.
    pub brdf: &'a dyn Brdf,
    /// Relative standard uncertainty of that.
    pub certificate: f64,
    /// What stray light left, colour by colour, electrons per second.
    pub left: [f64; 3],
    /// Relative scatter of the lamp's monitor, in its session.
    pub lamp: f64,
}

/// Finds κ; `None` where no pose of one stands where one of the other does, or their reflectances are too much alike.
#[must_use]
pub fn find(white: &[Seen<'_>], black: &[Seen<'_>], map: &PixelMap) -> Option<Known> {
    let mut found: Vec<(f64, f64, f64)> = Vec::new();
    for b in black {
        let same = |w: &&Seen<'_>| (w.pose.tilt.degrees() - b.pose.tilt.degrees()).abs() < 0.02;
        let Some(w) = white.iter().find(same) else { continue };
        found.extend(ratio(w, b, map));
    }
    let total: f64 = found.iter().map(|f| f.1.powi(-2)).sum();
    if found.is_empty() || !total.is_finite() {
        return None;
    }
    let kappa = found.iter().map(|f| f.0 * f.1.powi(-2)).sum::<f64>() / total;
    // what is common to all poses does not average out
    let common = found.iter().map(|f| f.2).sum::<f64>() / found.len() as f64;
    Some(Known::new(kappa, total.powf(-0.5).hypot(common)))
}

/// κ of one pair of poses, its own uncertainty and the common one.
fn ratio(w: &Seen<'_>, b: &Seen<'_>, map: &PixelMap) -> Option<(f64, f64, f64)> {
    let view = map.view(b.pose);
    let light = Vec3::from_polar(view.theta_i, Angle::ZERO);
    let lights = quadrature::cone(light, map.description().lamp.half_angle(), 1);
    let limit = LIMIT_DEG.to_radians().cos();
    let mean = |brdf: &dyn Brdf, v: Vec3, c: usize| -> f64 {
        lights.iter().map(|l| brdf.eval(*l, v)[c] * l.z.max(0.0)).sum::<f64>() / lights.len() as f64
    };
    let s = [w, b].map(|x| face::onto_face(x.brdf, map, x.pose).map(|s| s * light.z));
    let r = [w, b].map(|x| face::from_all_around(x.brdf));
    // sums of signal over f cos θi (white, black), of A weighted alike, of variances, of stray light's rest in the black
    let (mut sums, mut a, mut variance, mut left) = ([0.0; 2], [0.0; 2], [0.0; 2], 0.0);
    for p in (0..b.pixels.len()).filter(|&p| view.visible[p]) {
        let v = view.sample_from_lab.apply(map.direction(p));
        let (mw, mb) = (w.pixels[p], b.pixels[p]);
        if v.z < limit || !mw.is_valid() || !mb.is_valid() {
            continue;
        }
        let c = map.channel(p);
        let f = [mean(w.brdf, v, c), mean(b.brdf, v, c)];
        if f.iter().any(|f| *f <= 0.0) {
            continue;
        }
        let level = f64::from(mw.rate) / f[0];
        for (k, m) in [mw, mb].iter().enumerate() {
            sums[k] += f64::from(m.rate) / f[k];
            variance[k] += f64::from(m.shot + m.read + m.dark) / (f[k] * f[k]);
            a[k] += level * s[k][c] * face::at_view(&r[k], v.z)[c] / f[k];
        }
        left += b.left[c] / f[1];
    }
    if sums.iter().any(|s| *s <= 0.0) {
        return None;
    }
    let q = sums[1] / sums[0];
    let a = a.map(|v| v / sums[0]);
    let lever = q * a[0] - a[1];
    let noise = (variance[0].sqrt() / sums[0]).hypot(variance[1].sqrt() / sums[1]);
    let own = noise.hypot(w.lamp).hypot(b.lamp) / lever;
    let common = w.certificate.hypot(b.certificate).hypot(left / sums[1]) / lever;
    (lever > 1e-3).then_some(((1.0 - q) / lever, own.max(1e-12), common))
}
