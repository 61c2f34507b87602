//! Isochromatic lines against numbers computed at 50 digits, and at every extreme.

use gonio_optics::{Angle, Geometry, Vec3, isoline, isoline::Method, isoline_single};
use gonio_tests::golden;

use crate::Figure;

/// Random geometries.
const RANDOM: usize = 10_000_000;

fn single(d: Vec3) -> [f32; 3] {
    d.to_array().map(|x| x as f32)
}

/// Rows (θi, θo, φ, θ'ill, θ'det, φ'), degrees.
fn table() -> Vec<[f64; 6]> {
    let text = std::fs::read_to_string(golden("isoline.csv")).expect("golden table");
    let row = |line: &str| {
        let x: Vec<f64> = line.split(',').map(|x| x.parse().expect("a number")).collect();
        [x[0], x[1], x[2], x[5], x[6], x[7]]
    };
    text.lines().skip(1).map(row).collect()
}

/// All figures of isolines.
pub fn figures() -> Vec<Figure> {
    let (mut double, mut float, mut rows) = (0.0f64, 0.0f64, 0);
    for [ti, to, phi, ill, det, side] in table() {
        let (l, v) = Geometry::from_degrees(ti, to, phi).directions();
        let i = isoline(l, v, 1.5, Method::Clip);
        for (got, want) in [(i.theta_ill, ill), (i.theta_det, det)] {
            let exact = Angle::from_degrees(want);
            let edge = !(1e-6..=90.0 - 1e-6).contains(&want);
            let off = if edge {
                (got.cos() - exact.cos()).abs().to_degrees()
            } else {
                (got - exact).degrees().abs()
            };
            double = double.max(off);
        }
        if ti <= 89.9 && to <= 89.9 {
            rows += 1;
            let s = isoline_single(single(l), single(v), 1.5, Method::Clip);
            let signed = |cos: f64, mirror: bool| (1.0 - cos).copysign(if mirror { 1.0 } else { -1.0 });
            let exact = signed(Angle::from_degrees(det).cos(), side > 90.0);
            let off = (f64::from(s.cos_ill) - Angle::from_degrees(ill).cos())
                .abs()
                .max((signed(f64::from(s.cos_det), s.mirror_side) - exact).abs());
            float = float.max(off);
        }
    }
    let (mut bad, mut own, mut apart) = (0usize, 0.0f64, 0.0f64);
    for k in 0..RANDOM {
        let at = |step: f64| (k as f64 * step).fract();
        let (a, b, c) =
            (at(0.819_172_513_396_164_4), at(0.671_043_606_703_789_3), at(0.549_700_477_901_970_3));
        let g = Geometry::from_degrees(90.0 * a, 90.0 * b, 180.0 * c);
        let method = Method::ALL[k % 4].1;
        bad += usize::from(!answers(g, method));
        if k % 16 == 0 {
            let plane = Geometry { phi: if c < 0.5 { Angle::ZERO } else { Angle::STRAIGHT }, ..g };
            let (l, v) = plane.directions();
            let i = isoline(l, v, 1.5, Method::Clip);
            let (high, low) = (g.theta_i.max(g.theta_o), g.theta_i.min(g.theta_o));
            own = own.max((i.theta_ill.cos() - high.cos()).abs()).max((i.theta_det.cos() - low.cos()).abs());
            let (l, v) = g.directions();
            let (s, d) = (isoline_single(single(l), single(v), 1.5, method), isoline(l, v, 1.5, method));
            // of an in-plane light within 0.6° of the horizon its square alone is known from directions in single precision
            if !d.limited && d.theta_ill.cos() > 0.01 {
                apart = apart.max((f64::from(s.cos_ill) - d.theta_ill.cos()).abs());
            }
        }
    }
    let edges = [0.0, 1e-12, 1e-6, 1e-3, 41.810_314_895_778_6, 45.0, 89.9, 89.999_999, 90.0];
    for ti in edges {
        for to in edges {
            for phi in [0.0, 1e-12, 1e-6, 90.0, 179.999_999, 180.0] {
                for (_, method) in Method::ALL {
                    bad += usize::from(!answers(Geometry::from_degrees(ti, to, phi), method));
                }
            }
        }
    }
    vec![
        Figure::at_most("f64 against the table, degrees", double, 1e-9, None),
        Figure::at_most(format!("f32 against the table to 89.9°, cosines, {rows} rows"), float, 1e-5, None),
        Figure::at_most("f32 against f64, θ'ill ≤ 89.4°, cosines", apart, 1e-5, None),
        Figure::at_most("in-plane geometries against themselves, cosines", own, 1e-12, None),
        Figure::at_most("answers that are none, of 10⁷ random and all extreme", bad as f64, 0.0, None),
    ]
}

/// Whether both precisions give cosines.
fn answers(g: Geometry, method: Method) -> bool {
    let (l, v) = g.directions();
    let d = isoline(l, v, 1.5, method);
    let s = isoline_single(single(l), single(v), 1.5, method);
    let angle = |a: Angle| (-1e-12..=90.0 + 1e-9).contains(&a.degrees());
    let cosine = |c: f32| (0.0..=1.0).contains(&c);
    angle(d.theta_ill) && angle(d.theta_det) && cosine(s.cos_ill) && cosine(s.cos_det)
}
