//! Which pixels of a pose are to be well exposed, and how much longer one pose needs than another.

use gonio_instrument::Pose;
use rayon::prelude::*;

use crate::bracket::NEGLIGIBLE;
use crate::pixel_map::PixelMap;
use crate::reference::WHITE_LIMIT_DEG;

/// Every how many columns and rows a pixel is looked at for [`exposure_needs`].
const STRIDE: usize = 3;

/// Pixels that the bracketing of a pose looks at: those that see the sample flatter than what a reference covers are left to chance.
#[must_use]
pub fn interest(map: &PixelMap, readback: Pose) -> Vec<bool> {
    if map.description().textures().is_some() {
        return crate::texture::interest(map.description(), readback);
    }
    let visibility = map.visibility(readback);
    let limit = WHITE_LIMIT_DEG.to_radians().cos();
    (0..map.width() * map.height())
        .into_par_iter()
        .with_min_len(4096)
        .map(|p| visibility.cos_view(p).is_some_and(|c| c > limit))
        .collect()
}

/// How long the darkest pixels of each pose need, relative to a pixel on the axis at normal incidence: by the cosine of θi and the étendue of the pixels
/// that see the sample there, for a sample that looks alike from everywhere. What a real one adds changes slowly from pose to pose.
#[must_use]
pub fn exposure_needs(map: &PixelMap, poses: &[Pose]) -> Vec<f64> {
    let (w, h) = (map.width(), map.height());
    let limit = WHITE_LIMIT_DEG.to_radians().cos();
    let mut known: Vec<(f64, f64)> = Vec::new();
    poses
        .iter()
        .map(|pose| {
            let tilt = pose.tilt.degrees();
            if let Some(same) = known.iter().find(|k| k.0 == tilt) {
                return same.1;
            }
            let visibility = map.visibility(*pose);
            let mut seen: Vec<f64> = (0..h.div_ceil(STRIDE))
                .into_par_iter()
                .flat_map_iter(|j| {
                    let y = j * STRIDE;
                    let visibility = &visibility;
                    (0..w).step_by(STRIDE).filter_map(move |x| {
                        let inside = visibility.cos_view(y * w + x).is_some_and(|c| c > limit);
                        inside.then(|| map.optics().etendue(x as f64, y as f64))
                    })
                })
                .collect();
            seen.sort_unstable_by(f64::total_cmp);
            let darkest = seen.get((NEGLIGIBLE * seen.len() as f64) as usize).copied().unwrap_or(1.0);
            let (_, theta_i) = map.frame(*pose);
            let need = 1.0 / (theta_i.cos().max(gonio_optics::COS_FLOOR) * darkest.max(1e-3));
            known.push((tilt, need));
            need
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use gonio_instrument::builtin;

    #[test]
    fn a_flat_light_needs_longer() {
        let d = builtin::description("tiny").expect("known").expect("readable");
        let map = PixelMap::new(&d);
        let poses = [40.0, 60.0, 75.0, 40.0].map(|t| Pose::from_degrees(t, 30.0));
        let needs = exposure_needs(&map, &poses);
        assert!(needs[0] < needs[1] && needs[1] < needs[2], "{needs:?}");
        assert_eq!(needs[0], needs[3]);
        // the darkest of the pixels of interest, found one by one
        let cos = map.frame(poses[1]).1.cos();
        let w = map.width();
        let mut all: Vec<f64> = interest(&map, poses[1])
            .iter()
            .enumerate()
            .filter(|(_, i)| **i)
            .map(|(p, _)| cos * map.optics().etendue((p % w) as f64, (p / w) as f64))
            .collect();
        all.sort_by(f64::total_cmp);
        let brute = 1.0 / all[(NEGLIGIBLE * all.len() as f64) as usize];
        assert!((needs[1] / brute - 1.0).abs() < 0.03, "{} {brute}", needs[1]);
    }
}
