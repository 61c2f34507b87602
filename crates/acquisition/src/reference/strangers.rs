//! Pixels that see something else than the reference.

use rayon::prelude::*;

use crate::pixel_map::PixelMap;

/// Tiles across the sensor in which a pixel's scale is held against its surroundings.
const TILES: usize = 40;
/// Share of the median scale over étendue below which a pixel looks past the reference.
const PAST: f32 = 0.25;
/// Departure from its surroundings from which on a pixel sees something else than the reference, relative.
pub(super) const STRANGE: f32 = 0.07;

/// Takes out pixels whose scale over the lens's étendue departs from that of the same colour around them: at the edges of shadows and openings
/// that are not quite where the description has them, a scale too small would make the values of a sample too large. What is around is a plane
/// through the logarithms, fitted three times to what lies ever nearer to it. The number of pixels taken out.
pub(super) fn drop(map: &PixelMap, scale: &mut [f32], variance: &[f32]) -> usize {
    let (w, h, optics) = (map.width(), map.height(), map.optics());
    let ratio: Vec<f32> = scale
        .par_iter()
        .enumerate()
        .with_min_len(4096)
        .map(|(p, k)| {
            let (u, v) = ((p % w) as f64 + 0.5, (p / w) as f64 + 0.5);
            // NaN stays NaN
            (f64::from(*k) / optics.etendue(u, v).max(1e-9)).ln() as f32
        })
        .collect();
    let mut dropped = 0;
    let mut ratio = ratio;
    for channel in 0..3 {
        let of = |p: &usize| map.channel(*p) == channel;
        let mut known: Vec<f32> =
            (0..ratio.len()).filter(of).map(|p| ratio[p]).filter(|r| !r.is_nan()).collect();
        known.sort_unstable_by(f32::total_cmp);
        let Some(&median) = known.get(known.len() / 2) else { continue };
        for p in (0..ratio.len()).filter(of) {
            // no lens darkens its corners that much beyond the law: these look past the reference
            if ratio[p] < median + PAST.ln() {
                (ratio[p], scale[p]) = (f32::NAN, f32::NAN);
                dropped += 1;
            }
        }
    }
    let tile = (w / TILES).max(4);
    let (across, down) = (w.div_ceil(tile), h.div_ceil(tile));
    let strangers: Vec<Vec<usize>> = (0..across * down)
        .into_par_iter()
        .map(|at| {
            let (x0, y0) = (at % across * tile, at / across * tile);
            // the plane is laid a tile further out on each side: a shadow's edge is no majority there
            let range = |from: usize, reach: usize, n: usize| {
                from.saturating_sub(reach)..(from + tile + reach).min(n)
            };
            let mut around: [Vec<[f64; 3]>; 3] = Default::default();
            for y in range(y0, tile, h) {
                for x in range(x0, tile, w) {
                    let r = f64::from(ratio[y * w + x]);
                    if r.is_finite() {
                        let place = [x as f64 - x0 as f64, y as f64 - y0 as f64];
                        around[map.channel(y * w + x)].push([place[0], place[1], r]);
                    }
                }
            }
            let planes = around.map(|points| robust_plane(&points));
            let mut out = Vec::new();
            for y in range(y0, 0, h) {
                for x in range(x0, 0, w) {
                    let p = y * w + x;
                    if ratio[p].is_nan() {
                        continue;
                    }
                    let Some([a, b, c]) = planes[map.channel(p)] else {
                        // among shadows there is nothing to hold it against
                        out.push(p);
                        continue;
                    };
                    let level = a + b * (x - x0) as f64 + c * (y - y0) as f64;
                    let bound = f64::from(STRANGE.max(5.0 * variance[p].sqrt()));
                    if (f64::from(ratio[p]) - level).exp_m1().abs() > bound {
                        out.push(p);
                    }
                }
            }
            out
        })
        .collect();
    for p in strangers.into_iter().flatten() {
        scale[p] = f32::NAN;
        dropped += 1;
    }
    dropped
}

/// Level and slopes of the plane z = a + b x + c y that most of the points (x, y, z) lie on; `None` for too few.
fn robust_plane(points: &[[f64; 3]]) -> Option<[f64; 3]> {
    let mut heights: Vec<f64> = points.iter().map(|p| p[2]).collect();
    heights.sort_unstable_by(f64::total_cmp);
    let mut plane = [*heights.get(heights.len() / 2)?, 0.0, 0.0];
    for near in [0.3, 0.1, 0.05] {
        let mut m = nalgebra::Matrix3::<f64>::zeros();
        let mut r = nalgebra::Vector3::<f64>::zeros();
        let mut count = 0;
        for [x, y, z] in points {
            let off = z - plane[0] - plane[1] * x - plane[2] * y;
            if off.abs() <= near {
                let j = nalgebra::Vector3::new(1.0, *x, *y);
                m += j * j.transpose();
                r += j * *z;
                count += 1;
            }
        }
        if count < 8 || 2 * count < points.len() {
            return None;
        }
        let solved = m.try_inverse()? * r;
        plane = [solved[0], solved[1], solved[2]];
    }
    Some(plane)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_plane_is_found_past_a_shadow_that_covers_a_third_of_it() {
        let points: Vec<[f64; 3]> = (0..20)
            .flat_map(|y| (0..20).map(move |x| (f64::from(x), f64::from(y))))
            .map(|(x, y)| [x, y, 1.0 + 0.004 * x - 0.003 * y - if x > 13.0 { 1.5 } else { 0.0 }])
            .collect();
        let [a, b, c] = robust_plane(&points).expect("a plane");
        assert!((a - 1.0).abs() < 1e-9 && (b - 0.004).abs() < 1e-9 && (c + 0.003).abs() < 1e-9);
        assert!(robust_plane(&points[..3]).is_none() && robust_plane(&[]).is_none());
    }
}
