//! Solid angles of scattered views: the Voronoi areas on the hemisphere among the points of one angle of incidence.

use gonio_optics::{Geometry, Vec3};

/// Views that stand for the hemisphere.
const PROBES: usize = 2048;
/// With fewer points a Voronoi area says little.
const FEW: usize = 8;
/// Points of one angle of incidence differ by less than this.
const SAME_INCIDENCE_DEG: f64 = 0.5;

/// The solid angle each geometry stands for, in sr (both sides of the plane of incidence).
pub(crate) fn solid_angles(points: &[Geometry]) -> Vec<f64> {
    let mut order: Vec<usize> = (0..points.len()).collect();
    order.sort_by(|&a, &b| points[a].theta_i.radians().total_cmp(&points[b].theta_i.radians()));
    let mut out = vec![0.0; points.len()];
    let mut at = 0;
    while at < order.len() {
        let first = points[order[at]].theta_i.degrees();
        let group_len = order[at..]
            .iter()
            .take_while(|&&i| points[i].theta_i.degrees() - first < SAME_INCIDENCE_DEG)
            .count()
            .max(1);
        let group = &order[at..at + group_len];
        let hemisphere = std::f64::consts::TAU;
        if group.len() < FEW {
            for &i in group {
                out[i] = hemisphere / group.len() as f64;
            }
        } else {
            let views: Vec<Vec3> = group
                .iter()
                .map(|&i| {
                    let g = points[i];
                    Vec3::from_polar(g.theta_o, g.phi.folded())
                })
                .collect();
            for probe in probes() {
                let nearest = (0..views.len())
                    .max_by(|&a, &b| views[a].dot(probe).total_cmp(&views[b].dot(probe)))
                    .unwrap_or(0);
                out[group[nearest]] += hemisphere / PROBES as f64;
            }
        }
        at += group_len;
    }
    out
}

/// Evenly spread directions of the half hemisphere φ ∈ [0°, 180°] (golden-ratio spiral).
fn probes() -> impl Iterator<Item = Vec3> {
    const GOLDEN: f64 = 0.618_033_988_749_894_9;
    (0..PROBES).map(|k| {
        let z = (k as f64 + 0.5) / PROBES as f64;
        let s = (1.0 - z * z).sqrt();
        let (sp, cp) = (std::f64::consts::PI * (k as f64 * GOLDEN).fract()).sin_cos();
        Vec3::new(s * cp, s * sp, z)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn areas_fill_the_hemisphere_and_follow_the_spacing() {
        // a product grid, ten times denser in θo below 45°
        let mut points = Vec::new();
        for k in 0..30 {
            let theta_o = if k < 20 { 2.25 * f64::from(k) } else { 45.0 + 4.5 * f64::from(k - 20) };
            for j in 0..19 {
                points.push(Geometry::from_degrees(30.0, theta_o, 10.0 * f64::from(j)));
            }
        }
        let areas = solid_angles(&points);
        assert!((areas.iter().sum::<f64>() - std::f64::consts::TAU).abs() < 1e-9);
        // ring at 72° (spacing 4.5°) against ring at 22.5° (spacing 2.25°)
        let ring = |k: usize| areas[k * 19..(k + 1) * 19].iter().sum::<f64>();
        let want = 2.0 * 72f64.to_radians().sin() / 22.5f64.to_radians().sin();
        assert!((ring(26) / ring(10) / want - 1.0).abs() < 0.15, "{} {want}", ring(26) / ring(10));
    }

    #[test]
    fn few_points_share_alike() {
        let points: Vec<_> = (0..3).map(|k| Geometry::from_degrees(0.0, 10.0 * f64::from(k), 0.0)).collect();
        assert_eq!(solid_angles(&points), vec![std::f64::consts::TAU / 3.0; 3]);
        assert!(solid_angles(&[]).is_empty());
    }
}
