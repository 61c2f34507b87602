//! A car-like body: long, flat flanks, a bonnet, a cabin; enough of the directions that a car shows, and no file needed.

use std::f64::consts::{PI, TAU};

use gonio_optics::Vec3;

use super::{Mesh, net};

/// Columns around a section and sections along the body.
const AROUND: usize = 256;
const ALONG: usize = 301;

/// A body 4.2 long (x), 1.7 wide (z) and 1.15 high, its underside flat at y = 0.
#[must_use]
pub fn car() -> Mesh {
    let mut positions = Vec::with_capacity(AROUND * ALONG);
    for c in 0..AROUND {
        let around = TAU * c as f64 / AROUND as f64;
        for s in 0..ALONG {
            // sections stand closer at the ends, which are round
            let x = -2.1 * (PI * s as f64 / (ALONG - 1) as f64).cos();
            positions.push(section(x, around));
        }
    }
    let faces = net(AROUND, ALONG, true);
    let shape = |t: &[u32; 3]| {
        let [a, b, c] = t.map(|i: u32| positions[i as usize]);
        (b - a).cross(c - a)
    };
    let triangles: Vec<[u32; 3]> = faces.into_iter().filter(|t| shape(t).norm_squared() > 1e-24).collect();
    let mut normals = vec![Vec3::ZERO; positions.len()];
    for t in &triangles {
        let n = shape(t);
        t.iter().for_each(|&i| normals[i as usize] = normals[i as usize] + n);
    }
    // all columns meet in one point at both ends
    for (i, n) in normals.iter_mut().enumerate() {
        *n = match i % ALONG {
            0 => -Vec3::X,
            s if s + 1 == ALONG => Vec3::X,
            _ => n.normalized(),
        };
    }
    Mesh { positions, normals, triangles }
}

fn smooth(x: f64, from: f64, to: f64) -> f64 {
    let t = ((x - from) / (to - from)).clamp(0.0, 1.0);
    t * t * t * (t * (6.0 * t - 15.0) + 10.0)
}

/// Point of the outline at station `x`, `around` from the left flank over the roof.
fn section(x: f64, around: f64) -> Vec3 {
    let end = (1.0 - (x / 2.1).abs().powf(3.5)).max(0.0);
    let round = end.powf(0.45);
    let (s, c) = around.sin_cos();
    let power = |v: f64, p: f64| v.signum() * v.abs().powf(p);
    // the shoulder: a rounded box
    let (across, up) = (power(c, 0.55), power(s, 0.6));
    let width = 0.85 * round;
    let belt = 0.36 * end.powf(0.35);
    let middle = 0.40;
    let cabin = smooth(x, -1.75, -0.75) * (1.0 - smooth(x, 0.25, 1.15));
    // the cabin stands on the inner part of the roof alone
    let inside = (1.0 - smooth(across.abs(), 0.35, 1.0)) * smooth(s, 0.0, 0.75);
    let y = if s >= 0.0 {
        middle + belt * up + 0.39 * cabin * inside
    } else {
        middle + 0.32 * round * power(s, 0.35)
    };
    Vec3::new(x, y, width * across * (1.0 - 0.10 * cabin * inside))
}
