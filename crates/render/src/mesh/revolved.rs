//! Bodies of revolution about the vertical: the egg that Sopp's comparisons are shown on and the capsule of Golla's demonstration.
//!
//! Neither paper gives numbers for its shape. Normals are those of the curve, not of the facets.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use gonio_optics::Vec3;

use super::{Mesh, net};

/// Columns around the axis.
const AROUND: usize = 192;
/// Rows from pole to pole.
const ALONG: usize = 161;

/// An egg of height 2, broad end down: r = 0.74 sin t (1 − 0.19 cos t), y = cos t.
#[must_use]
pub fn egg() -> Mesh {
    revolved(|t| (0.74 * t.sin() * (1.0 - 0.19 * t.cos()), t.cos()))
}

/// A standing capsule of height 2 and radius ½.
#[must_use]
pub fn capsule() -> Mesh {
    let (r, half) = (0.5, 0.5);
    let cap = r * FRAC_PI_2;
    let whole = 2.0 * (cap + half);
    revolved(move |t| {
        // along the outline by its length, so that the seams fall between rows smoothly
        let s = t / PI * whole;
        if s < cap {
            (r * (s / r).sin(), half + r * (s / r).cos())
        } else if s < cap + 2.0 * half {
            (r, half - (s - cap))
        } else {
            let a = (s - cap - 2.0 * half) / r;
            (r * a.cos(), -half - r * a.sin())
        }
    })
}

/// `outline(t)` gives (radius, height) from the upper pole (t = 0) to the lower one (t = π).
fn revolved(outline: impl Fn(f64) -> (f64, f64)) -> Mesh {
    let (mut positions, mut normals) = (Vec::new(), Vec::new());
    for c in 0..AROUND {
        let (s, k) = (TAU * c as f64 / AROUND as f64).sin_cos();
        for row in 0..ALONG {
            let t = PI * row as f64 / (ALONG - 1) as f64;
            let (r, y) = outline(t);
            positions.push(Vec3::new(r.max(0.0) * k, y, -r.max(0.0) * s));
            let h = 1e-4;
            let ((r0, y0), (r1, y1)) = (outline((t - h).max(0.0)), outline((t + h).min(PI)));
            // the outline runs downwards: its left side looks outwards
            let (nr, ny) = (y0 - y1, r1 - r0);
            normals.push(match row {
                0 => Vec3::Y,
                _ if row + 1 == ALONG => -Vec3::Y,
                _ => Vec3::new(nr * k, ny, -nr * s).normalized(),
            });
        }
    }
    let triangles = net(AROUND, ALONG, true);
    let all: Vec<[u32; 3]> = triangles
        .into_iter()
        .filter(|t| {
            let [a, b, c] = t.map(|i| positions[i as usize]);
            (b - a).cross(c - a).norm_squared() > 1e-24
        })
        .collect();
    Mesh { positions, normals, triangles: all }
}
