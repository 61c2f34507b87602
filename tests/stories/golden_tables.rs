//! Numbers computed independently at 50 digits are met: 1e-9 relative, angles to 1e-9 degrees (their cosines where an angle is at 0° or 90°).

use gonio_brdf::{
    Brdf,
    models::{AshikhminShirley, AshikhminShirleySimplified},
};
use gonio_optics::{
    Angle, Geometry, fresnel,
    isoline::{Method, isoline},
};

/// Rows of a golden table by column name.
fn rows(name: &str, columns: &[&str]) -> Vec<Vec<f64>> {
    let path = format!("{}/golden/{name}", env!("CARGO_MANIFEST_DIR"));
    let text = std::fs::read_to_string(&path).unwrap_or_else(|e| panic!("{path}: {e}"));
    let mut lines = text.lines();
    let header: Vec<&str> = lines.next().unwrap().split(',').collect();
    assert_eq!(header, columns, "columns of {name}");
    let rows: Vec<Vec<f64>> = lines.map(|l| l.split(',').map(|x| x.parse().unwrap()).collect()).collect();
    assert!(rows.len() >= 200, "{name} has {} rows", rows.len());
    rows
}

fn close(what: &str, got: f64, want: f64) {
    assert!((got - want).abs() <= 1e-9 * want.abs(), "{what}: {got:e}, table {want:e}");
}

#[test]
fn fresnel_reflectance_meets_the_table() {
    for r in rows("fresnel.csv", &["theta_deg", "index", "reflectance"]) {
        close(&format!("{r:?}"), fresnel::dielectric(Angle::from_degrees(r[0]).cos(), r[1]), r[2]);
    }
}

/// The table holds cd = 0.2 and cs = 0.1; `full` is (4.17) + (4.18) with the diffuse term of (4.11) corrected (not squared).
#[test]
fn ashikhmin_shirley_meets_the_table_in_both_forms() {
    let columns = ["theta_i_deg", "theta_o_deg", "phi_deg", "exponent", "r0", "simplified", "full"];
    let (diffuse, specular) = ([0.2; 3], [0.1; 3]);
    for r in rows("ashikhmin.csv", &columns) {
        let (l, v) = Geometry::from_degrees(r[0], r[1], r[2]).directions();
        let (exponent, r0) = (r[3], r[4]);
        let simplified = AshikhminShirleySimplified { diffuse, specular, exponent };
        close(&format!("simplified {r:?}"), simplified.eval(l, v)[0], r[5]);
        close(
            &format!("full {r:?}"),
            AshikhminShirley { diffuse, specular, exponent, r0 }.eval(l, v)[0],
            r[6],
        );
    }
}

/// An angle to 1e-9°, or its cosine (near 0° and 90°, where the angle is the worse variable) to 1e-9 of a degree's radian.
fn angle(what: &str, got: Angle, want_deg: f64) {
    let want = Angle::from_degrees(want_deg);
    let edge = !(1e-6..=90.0 - 1e-6).contains(&want_deg);
    let off = if edge { (got.cos() - want.cos()).abs().to_degrees() } else { (got - want).degrees().abs() };
    assert!(off <= 1e-9, "{what}: {got}, table {want_deg}");
}

/// The table holds method A, clipped at 90°, for an index of 1.5.
#[test]
fn isolines_meet_the_table() {
    let columns = [
        "theta_i_deg",
        "theta_o_deg",
        "phi_deg",
        "theta_inc_deg",
        "theta_flake_deg",
        "theta_ill_deg",
        "theta_det_deg",
        "phi_det_deg",
        "limited",
    ];
    for r in rows("isoline.csv", &columns) {
        let (l, v) = Geometry::from_degrees(r[0], r[1], r[2]).directions();
        let i = isoline(l, v, 1.5, Method::Clip);
        angle(&format!("theta_inc {r:?}"), i.flake.theta_inc, r[3]);
        angle(&format!("theta_flake {r:?}"), i.flake.theta_flake, r[4]);
        angle(&format!("theta_ill {r:?}"), i.theta_ill, r[5]);
        angle(&format!("theta_det {r:?}"), i.theta_det, r[6]);
        assert_eq!(i.limited, r[8] == 1.0, "limited {r:?}");
        // where θ'det = 0 both sides meet
        if r[6] > 1e-6 {
            assert!((i.phi_det.degrees() - r[7]).abs() < 1e-9, "side {r:?}");
        }
    }
}
