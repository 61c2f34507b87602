//! The camera's own face: it stands about F2, so the mirror lights it with what the sample sends out and throws it back onto the sample.
//!
//! A face of diffuse reflectance ρ_f under the irradiance `E = ρ_m E0 cos θi S` sends ρ_f E/π into all directions, the mirror brings ρ_m of that back, and
//! the sample reflects it:
//!
//! ```text
//! f_seen(v) = f(v) + κ S R(v),   S = ∫ f(l, ω) W(ω) dω,   R(v) = ∫ f(ω, v) cos θ dω,   κ = ρ_m² ρ_f/π
//! W(ω) = cos ψ (|F1 M| / |M F2|)²
//! ```
//!
//! M is the point of the mirror in direction ω from F1, ψ the angle at F2 from the axis. κ is found from the ratio of a black and a white reference,
//! both certified: the white one sees its own light again, the black one does not.

use gonio_brdf::{Brdf, Flag, Measured, Rgb};
use gonio_instrument::{Description, Pose};
use gonio_optics::{Angle, Vec3, fresnel};

use crate::pixel_map::PixelMap;

/// Steps of the integrals in polar angle and azimuth.
const STEPS: [usize; 2] = [60, 72];

/// W of a lab direction from F1; 0 past the rim.
#[must_use]
pub fn weight(d: &Description, direction: Vec3) -> f64 {
    if direction.z < d.mirror.rim_eta_deg.to_radians().cos() {
        return 0.0;
    }
    let (a, c) = (d.mirror.a, d.mirror.c_mm());
    // |F1 M| + |M F2| = 2a and the cosine rule
    let near = (a * a - c * c) / (a + c * direction.z);
    let far = 2.0 * a - near;
    ((near * direction.z + 2.0 * c) / far).max(0.0) * (near / far).powi(2)
}

/// S of a BRDF at a pose.
#[must_use]
pub fn onto_face(brdf: &dyn Brdf, map: &PixelMap, pose: Pose) -> Rgb {
    let (sample_from_lab, theta_i) = map.frame(pose);
    let light = Vec3::from_polar(theta_i, Angle::ZERO);
    let lab_from_sample = sample_from_lab.inverse();
    over_hemisphere(|w| {
        let weight = weight(map.description(), lab_from_sample.apply(w));
        brdf.eval(light, w).map(|f| f * weight)
    })
}

/// R of a BRDF for views from 0° to 90° in even steps.
#[must_use]
pub fn from_all_around(brdf: &dyn Brdf) -> Vec<Rgb> {
    (0..=30)
        .map(|k| {
            let v = Vec3::from_polar(Angle::from_degrees((3.0 * f64::from(k)).min(89.9)), Angle::ZERO);
            over_hemisphere(|w| brdf.eval(w, v).map(|f| f * w.z))
        })
        .collect()
}

/// R S/f of a BRDF seen along the normal at a pose, green: over κ, how much brighter it looks for its own light thrown back.
#[must_use]
pub fn own_light(brdf: &dyn Brdf, map: &PixelMap, pose: Pose) -> f64 {
    let light = Vec3::from_polar(map.frame(pose).1, Angle::ZERO);
    let back = over_hemisphere(|w| brdf.eval(w, Vec3::Z).map(|f| f * w.z));
    let f = brdf.eval(light, Vec3::Z)[1];
    if f > 0.0 { onto_face(brdf, map, pose)[1] * back[1] / f } else { 0.0 }
}

/// R between its steps.
#[must_use]
pub fn at_view(r: &[Rgb], cos_view: f64) -> Rgb {
    let last = r.len().saturating_sub(1);
    let x = cos_view.clamp(0.0, 1.0).acos() / std::f64::consts::FRAC_PI_2 * last as f64;
    let k = (x as usize).min(last.saturating_sub(1));
    let w = x - k as f64;
    [0, 1, 2].map(|c| (1.0 - w) * r[k][c] + w * r[(k + 1).min(last)][c])
}

fn over_hemisphere(f: impl Fn(Vec3) -> Rgb) -> Rgb {
    let [polar, around] = STEPS;
    let mut sum = [0.0; 3];
    for (x, wx) in gonio_optics::quadrature::gauss_legendre(polar) {
        let theta = Angle::from_radians(std::f64::consts::FRAC_PI_2 * x);
        let step = std::f64::consts::FRAC_PI_2 * wx * theta.sin() * std::f64::consts::TAU / around as f64;
        for j in 0..around {
            let phi = Angle::from_radians((j as f64 + 0.5) * std::f64::consts::TAU / around as f64);
            for (s, v) in sum.iter_mut().zip(f(Vec3::from_polar(theta, phi))) {
                *s += v * step;
            }
        }
    }
    sum
}

/// Takes what the face gave back off a table. Returns what was taken off each cell, in the order of the table.
///
/// S is summed over the cells of a row on both sides of the plane of incidence, R is the row's own sum by reciprocity, between the rows that have one;
/// both from the table as corrected so far, twice. `gloss_index` is that of a smooth surface whose mirror image is not in the table.
pub fn take_off(table: &mut Measured, map: &PixelMap, kappa: f64, gloss_index: Option<f64>) -> Vec<Rgb> {
    let grid = table.grid.clone();
    let seen = table.values.clone();
    let mut taken = vec![[0.0; 3]; grid.len()];
    for _ in 0..2 {
        let rows: Vec<Option<(Rgb, Rgb)>> =
            (0..grid.theta_i_deg.len()).map(|ti| integrals(table, map, ti, gloss_index)).collect();
        let known: Vec<(f64, Rgb)> =
            grid.theta_i_deg.iter().zip(&rows).filter_map(|(deg, r)| r.map(|r| (*deg, r.1))).collect();
        for i in 0..grid.len() {
            let [ti, to, _] = grid.coordinates(i);
            let (Some((s, _)), Some(r)) = (rows[ti], between(&known, grid.theta_o_deg[to])) else { continue };
            for c in 0..3 {
                taken[i][c] = kappa * s[c] * r[c];
                table.values[i][c] = (f64::from(seen[i][c]) - taken[i][c]) as f32;
            }
        }
    }
    taken
}

/// S and R of a row; `None` where little of it is known, which tells nothing of all around it.
fn integrals(table: &Measured, map: &PixelMap, ti: usize, gloss_index: Option<f64>) -> Option<(Rgb, Rgb)> {
    let grid = &table.grid;
    let [_, no, np] = grid.shape();
    let tilt = map.optics().tilt_for(Angle::from_degrees(grid.theta_i_deg[ti]));
    let lab_from_sample = map.frame(Pose { tilt, spin: Angle::ZERO }).0.inverse();
    let (mut s, mut r, mut seen) = ([0.0; 3], [0.0; 3], 0.0);
    for to in 0..no {
        let theta = Angle::from_degrees(grid.theta_o_deg[to]);
        for phi in 0..np {
            let i = grid.index(ti, to, phi);
            if table.flag[i] == Flag::Invalid {
                continue;
            }
            let sr = grid.solid_angle(to, phi);
            seen += sr;
            // a cell stands for both sides of the plane of incidence
            let onto: f64 = [1.0, -1.0]
                .map(|side| Vec3::from_polar(theta, Angle::from_degrees(side * grid.phi_deg[phi])))
                .map(|v| weight(map.description(), lab_from_sample.apply(v)))
                .iter()
                .sum();
            for c in 0..3 {
                let f = f64::from(table.values[i][c]);
                s[c] += f * sr * onto;
                r[c] += f * sr * 2.0 * theta.cos();
            }
        }
    }
    if let Some(n) = gloss_index {
        // the whole of the mirror image in one direction: ∫ f dω = F/cos θi
        let theta_i = Angle::from_degrees(grid.theta_i_deg[ti]);
        let (f, cos) = (fresnel::dielectric(theta_i.cos(), n), theta_i.cos().max(gonio_optics::COS_FLOOR));
        let mirrored = lab_from_sample.apply(Vec3::from_polar(theta_i, Angle::from_degrees(180.0)));
        let onto = f / cos * weight(map.description(), mirrored);
        (s, r) = (s.map(|v| v + onto), r.map(|v| v + f));
    }
    (seen > 0.5 * std::f64::consts::PI).then_some((s, r))
}

/// Linear between the nearest known rows, level beyond them.
pub(super) fn between(known: &[(f64, Rgb)], deg: f64) -> Option<Rgb> {
    let above = known.partition_point(|k| k.0 < deg);
    match (above.checked_sub(1).map(|k| known[k]), known.get(above)) {
        (Some(a), Some(b)) => {
            let w = (deg - a.0) / (b.0 - a.0);
            Some([0, 1, 2].map(|c| (1.0 - w) * a.1[c] + w * b.1[c]))
        }
        (Some(a), None) => Some(a.1),
        (None, Some(b)) => Some(b.1),
        (None, None) => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use gonio_brdf::Grid;
    use gonio_brdf::models::Lambert;
    use gonio_instrument::builtin;

    #[test]
    fn a_white_table_with_its_own_light_thrown_back_becomes_white_again() {
        let map = PixelMap::new(&builtin::description("tiny").expect("known").expect("readable"));
        let white = Lambert { diffuse: [0.9; 3] };
        let r = from_all_around(&white);
        assert!((r[0][1] - 0.9).abs() < 1e-3 && (at_view(&r, 0.3)[0] - 0.9).abs() < 1e-3, "{:?}", r[0]);
        let mut table = Measured::sampled(Grid::sopp(), &white);
        table.flag.fill(Flag::Measured);
        let (kappa, plain) = (0.01, 0.9 / std::f64::consts::PI);
        let added: Vec<f64> = table
            .grid
            .theta_i_deg
            .iter()
            .map(|deg| map.optics().tilt_for(Angle::from_degrees(*deg)))
            .map(|tilt| kappa * 0.9 * onto_face(&white, &map, Pose { tilt, spin: Angle::ZERO })[1])
            .collect();
        assert!(added.iter().all(|a| (0.002..0.03).contains(&(a / plain))), "{added:?}");
        for i in 0..table.flag.len() {
            let add = added[table.grid.coordinates(i)[0]] as f32;
            table.values[i] = table.values[i].map(|v| v + add);
        }
        take_off(&mut table, &map, kappa, None);
        let worst = table.values.iter().map(|v| (f64::from(v[1]) / plain - 1.0).abs()).fold(0.0, f64::max);
        // sums over cells of some degrees against the integral
        assert!(worst < 3e-4, "{worst}");
    }
}
