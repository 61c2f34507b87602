//! The Utah teapot (Martin Newell, 1975): thirty-two bicubic Bézier patches, cut into triangles here.
//!
//! Rim, body, lid and bottom are bodies of revolution: a quarter circle is a cubic with the factor 0.56 of the original, so that their outlines
//! alone are listed. Handle and spout are mirror images about y = 0. In the data z is up; the mesh is turned so that y is.

use gonio_optics::Vec3;

use super::{Mesh, net};

/// A quarter circle as Newell drew it.
const QUARTER: f64 = 0.56;

/// Outlines (radius, height) of the parts of revolution: rim, body above and below, lid's knob, lid, bottom.
const OUTLINES: [[(f64, f64); 4]; 6] = [
    [(1.4, 2.4), (1.3375, 2.53125), (1.4375, 2.53125), (1.5, 2.4)],
    [(1.5, 2.4), (1.75, 1.875), (2.0, 1.35), (2.0, 0.9)],
    [(2.0, 0.9), (2.0, 0.45), (1.5, 0.225), (1.5, 0.15)],
    [(0.0, 3.15), (0.8, 3.15), (0.0, 2.7), (0.2, 2.7)],
    [(0.2, 2.7), (0.4, 2.55), (1.3, 2.55), (1.3, 2.4)],
    [(1.5, 0.15), (1.5, 0.075), (1.425, 0.0), (0.0, 0.0)],
];

/// Half a tube: for each of four stations the inner and the outer line (x, z) and how far the two middle points stand out in y.
type Tube = [((f64, f64), (f64, f64), f64); 4];

/// Handle and spout, from their upper or lower end on.
const TUBES: [Tube; 4] = [
    [
        ((-1.6, 2.025), (-1.5, 2.25), 0.3),
        ((-2.3, 2.025), (-2.5, 2.25), 0.3),
        ((-2.7, 2.025), (-3.0, 2.25), 0.3),
        ((-2.7, 1.8), (-3.0, 1.8), 0.3),
    ],
    [
        ((-2.7, 1.8), (-3.0, 1.8), 0.3),
        ((-2.7, 1.575), (-3.0, 1.35), 0.3),
        ((-2.5, 1.125), (-2.65, 0.9375), 0.3),
        ((-2.0, 0.9), (-1.9, 0.6), 0.3),
    ],
    [
        ((1.7, 1.425), (1.7, 0.6), 0.66),
        ((2.6, 1.425), (3.1, 0.825), 0.66),
        ((2.3, 2.1), (2.4, 2.025), 0.25),
        ((2.7, 2.4), (3.3, 2.4), 0.25),
    ],
    [
        ((2.7, 2.4), (3.3, 2.4), 0.25),
        ((2.8, 2.475), (3.525, 2.49375), 0.25),
        ((2.9, 2.475), (3.45, 2.5125), 0.15),
        ((2.8, 2.4), (3.2, 2.4), 0.15),
    ],
];

type Patch = [[Vec3; 4]; 4];

/// A patch and whether it is half a tube.
type Part = (Patch, bool);

/// The teapot, `cuts` pieces along each side of a patch; height 2, standing on y = −1, the spout towards +x.
#[must_use]
pub fn teapot(cuts: usize) -> Mesh {
    let n = cuts.max(1) + 1;
    let mut mesh = Mesh { positions: Vec::new(), normals: Vec::new(), triangles: Vec::new() };
    for (patch, tube) in patches() {
        let first = mesh.positions.len() as u32;
        for i in 0..n {
            for j in 0..n {
                let (u, v) = (i as f64 / (n - 1) as f64, j as f64 / (n - 1) as f64);
                mesh.positions.push(place(point(&patch, u, v)));
                mesh.normals.push(turned(normal(&patch, tube, u, v)));
            }
        }
        for t in net(n, n, false) {
            let [a, b, c] = t.map(|i| i + first);
            let at = |i: u32| mesh.positions[i as usize];
            let across = (at(b) - at(a)).cross(at(c) - at(a));
            if across.norm_squared() < 1e-18 {
                continue;
            }
            // faces look where their normals look
            let along = mesh.normals[a as usize] + mesh.normals[b as usize] + mesh.normals[c as usize];
            mesh.triangles.push(if across.dot(along) >= 0.0 { [a, b, c] } else { [a, c, b] });
        }
    }
    mesh
}

/// Height 3.15 to 2, z up to y up.
fn place(p: Vec3) -> Vec3 {
    turned(p) * (2.0 / 3.15) - Vec3::Y
}

fn turned(p: Vec3) -> Vec3 {
    Vec3::new(p.x, p.z, -p.y)
}

fn patches() -> Vec<Part> {
    let mut out = Vec::new();
    for outline in OUTLINES {
        for quarter in 0..4 {
            let turn = |x: f64, y: f64| match quarter {
                0 => (x, y),
                1 => (-y, x),
                2 => (-x, -y),
                _ => (y, -x),
            };
            let patch = outline.map(|(r, z)| {
                [(1.0, 0.0), (1.0, QUARTER), (QUARTER, 1.0), (0.0, 1.0)].map(|(x, y)| {
                    let (x, y) = turn(r * x, r * y);
                    Vec3::new(x, y, z)
                })
            });
            out.push((patch, false));
        }
    }
    for tube in TUBES {
        for side in [-1.0, 1.0] {
            let patch = tube.map(|(a, b, out)| {
                [
                    Vec3::new(a.0, 0.0, a.1),
                    Vec3::new(a.0, side * out, a.1),
                    Vec3::new(b.0, side * out, b.1),
                    Vec3::new(b.0, 0.0, b.1),
                ]
            });
            out.push((patch, true));
        }
    }
    out
}

fn bernstein(t: f64) -> [f64; 4] {
    let s = 1.0 - t;
    [s * s * s, 3.0 * t * s * s, 3.0 * t * t * s, t * t * t]
}

fn point(p: &Patch, u: f64, v: f64) -> Vec3 {
    let (bu, bv) = (bernstein(u), bernstein(v));
    let mut sum = Vec3::ZERO;
    for i in 0..4 {
        for j in 0..4 {
            sum = sum + p[i][j] * (bu[i] * bv[j]);
        }
    }
    sum
}

/// Unit normal that looks out of the pot. At poles, where one tangent vanishes, it is taken a little inside the patch.
fn normal(p: &Patch, tube: bool, u: f64, v: f64) -> Vec3 {
    let across = |u: f64, v: f64| {
        let h = 1e-4;
        let (u, v) = (u.clamp(2.0 * h, 1.0 - 2.0 * h), v.clamp(2.0 * h, 1.0 - 2.0 * h));
        (point(p, u + h, v) - point(p, u - h, v)).cross(point(p, u, v + h) - point(p, u, v - h)).normalized()
    };
    let n = across(u, v);
    if !tube {
        // outlines run from the inner lip over the outside to the foot, quarters turn to the left: this is outwards everywhere
        return n;
    }
    // of a tube the middle of the patch tells which side is out; its lip turns inwards
    let mut middle = Vec3::ZERO;
    for (row, w) in p.iter().zip(bernstein(0.5)) {
        middle = middle + (row[0] + row[3]) * (0.5 * w);
    }
    if across(0.5, 0.5).dot(point(p, 0.5, 0.5) - middle) < 0.0 { -n } else { n }
}
