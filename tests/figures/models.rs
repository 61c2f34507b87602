//! The models at the extremes, and the tables computed independently at 50 digits.

use gonio_brdf::models::{AshikhminShirley, AshikhminShirleySimplified};
use gonio_brdf::{Brdf, ModelFile};
use gonio_optics::isoline::{Method, isoline};
use gonio_optics::{Angle, Geometry, Vec3, fresnel};

use crate::Figure;

const EXTREMES: &[&str] = &[
    r#"{"model":"lambert","diffuse":[0.5,0.5,0.5]}"#,
    r#"{"model":"phong","diffuse":[0.2,0.2,0.2],"specular":[0.3,0.3,0.3],"exponent":1000000}"#,
    r#"{"model":"blinn-phong","diffuse":[0.2,0.2,0.2],"specular":[0.3,0.3,0.3],"exponent":1000000}"#,
    r#"{"model":"ashikhmin-shirley-simplified","diffuse":[0.2,0.2,0.2],"specular":[0.3,0.3,0.3],"exponent":1000000}"#,
    r#"{"model":"ashikhmin-shirley-simplified","diffuse":[0.2,0.2,0.2],"specular":[0.3,0.3,0.3],"exponent":0}"#,
    r#"{"model":"lambert-ashikhmin-shirley","diffuse":[0.2,0.2,0.2],"specular":[0.3,0.3,0.3],"exponent":1000000,"r0":0.04}"#,
    r#"{"model":"ashikhmin-shirley","diffuse":[0.2,0.2,0.2],"specular":[0.3,0.3,0.3],"exponent":1000000,"r0":0.04}"#,
    r#"{"model":"cook-torrance","diffuse":[0.2,0.2,0.2],"lobes":[{"specular":[0.3,0.3,0.3],"alpha":0.001,"r0":0.04}]}"#,
    r#"{"model":"ward","diffuse":[0.2,0.2,0.2],"specular":[0.3,0.3,0.3],"alpha":0.0001}"#,
    r#"{"model":"ward","diffuse":[0.2,0.2,0.2],"specular":[0.3,0.3,0.3],"alpha":10}"#,
    r#"{"model":"ward-duer","diffuse":[0.2,0.2,0.2],"specular":[0.3,0.3,0.3],"alpha":0.0001}"#,
    r#"{"model":"ward-duer","diffuse":[0.2,0.2,0.2],"specular":[0.3,0.3,0.3],"alpha":10}"#,
    r#"{"model":"ggx","diffuse":[0.2,0.2,0.2],"lobes":[{"specular":[0.3,0.3,0.3],"alpha":0.0001,"r0":0.04}]}"#,
    r#"{"model":"ggx","diffuse":[0.2,0.2,0.2],"lobes":[{"specular":[0.3,0.3,0.3],"alpha":10,"r0":1}]}"#,
    r#"{"model":"lafortune","diffuse":[0.2,0.2,0.2],"lobes":[{"specular":[0.3,0.3,0.3],"cxy":-1,"cz":1,"exponent":1000000000},{"specular":[0.3,0.3,0.3],"cxy":1,"cz":0,"exponent":0}]}"#,
    r#"{"model":"oren-nayar","diffuse":[0.2,0.2,0.2],"sigma_deg":0}"#,
    r#"{"model":"oren-nayar","diffuse":[0.2,0.2,0.2],"sigma_deg":90}"#,
    r#"{"model":"ashikhmin-shirley-simplified","diffuse":[0.2,0.2,0.2],"specular":[0.3,0.3,0.3],"exponent":1300,"coat":{"index":1.5}}"#,
];

/// Angles that lie on the edges, and a fine ladder between.
fn angles() -> Vec<f64> {
    let mut a: Vec<f64> = (0..=60).map(|k| f64::from(k) * 1.5).collect();
    a.extend([1e-12, 1e-6, 1e-3, 89.9, 89.999, 90.0 - 1e-9]);
    a
}

fn bad_values() -> (usize, usize) {
    let (mut bad, mut count) = (0, 0);
    let phis = [0.0, 1e-9, 30.0, 90.0, 150.0, 180.0 - 1e-9, 180.0];
    for text in EXTREMES {
        let model = ModelFile::from_json(text).expect("a model");
        for &ti in &angles() {
            for &to in &angles() {
                for &phi in &phis {
                    let (l, v) = Geometry::from_degrees(ti, to, phi).directions();
                    // cos 90° rounds to a tiny number of either sign
                    let up = |d: Vec3| Vec3::new(d.x, d.y, d.z.max(0.0));
                    let f = model.eval(up(l), up(v));
                    bad += usize::from(f.iter().any(|x| !x.is_finite() || *x < 0.0));
                    count += 1;
                }
            }
        }
    }
    (bad, count)
}

/// Rows of a golden table as numbers.
fn rows(name: &str) -> Vec<Vec<f64>> {
    let text = std::fs::read_to_string(gonio_tests::golden(name)).expect("golden table");
    text.lines().skip(1).map(|l| l.split(',').map(|x| x.parse().expect("a number")).collect()).collect()
}

fn relative(got: f64, want: f64) -> f64 {
    if want == got { 0.0 } else { (got - want).abs() / want.abs() }
}

/// Largest departure of an isoline angle, degrees; where an angle is at 0° or 90° its cosine (or sine) is compared instead.
fn isolines() -> f64 {
    let off = |got: Angle, want_deg: f64| {
        let by_angle = (got.degrees() - want_deg).abs();
        let by_cosine = (got.cos() - want_deg.to_radians().cos()).abs();
        let edge = want_deg.abs() < 1e-4 || (want_deg - 90.0).abs() < 1e-4;
        if edge { by_angle.min(by_cosine) } else { by_angle }
    };
    rows("isoline.csv")
        .iter()
        .map(|r| {
            let (l, v) = Geometry::from_degrees(r[0], r[1], r[2]).directions();
            let i = isoline(l, v, 1.5, Method::Clip);
            let in_plane =
                if i.theta_det.degrees() < 1e-6 { 0.0 } else { (i.phi_det.degrees() - r[7]).abs() };
            [
                off(i.flake.theta_inc, r[3]),
                off(i.flake.theta_flake, r[4]),
                off(i.theta_ill, r[5]),
                off(i.theta_det, r[6]),
                in_plane,
                (f64::from(u8::from(i.limited)) - r[8]).abs(),
            ]
            .into_iter()
            .fold(0.0, f64::max)
        })
        .fold(0.0, f64::max)
}

/// Both forms, cd = 0.2 and cs = 0.1 as the table was made.
fn ashikhmin() -> f64 {
    let (diffuse, specular) = ([0.2; 3], [0.1; 3]);
    rows("ashikhmin.csv")
        .iter()
        .map(|r| {
            let (l, v) = Geometry::from_degrees(r[0], r[1], r[2]).directions();
            let (exponent, r0) = (r[3], r[4]);
            let simplified = AshikhminShirleySimplified { diffuse, specular, exponent }.eval(l, v)[0];
            let full = AshikhminShirley { diffuse, specular, exponent, r0 }.eval(l, v)[0];
            relative(simplified, r[5]).max(relative(full, r[6]))
        })
        .fold(0.0, f64::max)
}

/// The figures.
pub fn figures() -> Vec<Figure> {
    let (bad, count) = bad_values();
    let fresnel_off = rows("fresnel.csv")
        .iter()
        .map(|r| relative(fresnel::dielectric(r[0].to_radians().cos(), r[1]), r[2]))
        .fold(0.0, f64::max);
    vec![
        Figure::at_most(format!("NaN, infinite or negative values in {count}"), bad as f64, 0.0, None),
        Figure::at_most("fresnel.csv, largest relative error", fresnel_off, 1e-9, None),
        Figure::at_most("ashikhmin.csv, largest relative error", ashikhmin(), 1e-9, None),
        Figure::at_most("isoline.csv, largest error in degrees", isolines(), 1e-9, None),
    ]
}
