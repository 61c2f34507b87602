//! Adaptive means against a brute-force rule that shares nothing with them but the definition.

use super::lobe::LobeCells;
use super::*;
use crate::models::{AshikhminShirleySimplified, CookTorrance, CookTorranceLobe, Lambert, Model, Phong};

const LAMP: Meaning = Meaning::CellMean { lamp_half_angle: Angle::from_degrees(0.5) };

fn model(exponent: f64) -> AshikhminShirleySimplified {
    AshikhminShirleySimplified { diffuse: [0.1; 3], specular: [0.1; 3], exponent }
}

/// Cells on, beside and away from the mirror direction.
const CELLS: [[usize; 3]; 14] = [
    [0, 0, 0],
    [0, 1, 4],
    [1, 2, 35],
    [1, 2, 34],
    [6, 12, 35],
    [6, 12, 34],
    [6, 11, 33],
    [6, 13, 35],
    [9, 18, 35],
    [12, 24, 35],
    [12, 23, 34],
    [15, 30, 35],
    [15, 30, 34],
    [15, 28, 20],
];

/// 60 midpoints in cos θo, 32 Gauss nodes in φ, 331 lamp directions.
fn brute(brdf: &dyn Brdf, grid: &Grid, cell: [usize; 3]) -> f64 {
    let b = CellBounds::of(grid, Angle::from_degrees(0.5), cell);
    let lights = quadrature::cone(Vec3::from_polar(b.theta_i, Angle::ZERO), b.lamp_half_angle, 10);
    let rule = quadrature::gauss_legendre(32);
    let (ca, cb) = (b.theta_o.0.cos(), b.theta_o.1.cos());
    let mut sum = 0.0;
    for i in 0..60 {
        let z = ca + (cb - ca) * (f64::from(i) + 0.5) / 60.0;
        let s = (1.0 - z * z).sqrt();
        for &(y, w) in &rule {
            let (sp, cp) = (b.phi.0 + (b.phi.1 - b.phi.0) * y).sin_cos();
            for &l in &lights {
                sum += w * brdf.eval(l, Vec3::new(s * cp, s * sp, z))[0] * l.z.max(0.0);
            }
        }
    }
    sum / (60.0 * lights.iter().map(|l| l.z.max(0.0)).sum::<f64>())
}

#[test]
fn adaptive_means_agree_with_brute_force() {
    let grid = Grid::sopp();
    for exponent in [5.0, 21.0, 120.0, 410.0, 1300.0, 5000.0] {
        for cell in CELLS {
            let got = adaptive_cell_mean(&model(exponent), &grid, LAMP, cell)[0];
            let want = brute(&model(exponent), &grid, cell);
            assert!((got / want - 1.0).abs() < 1e-4, "n {exponent} cell {cell:?}: {got} {want}");
        }
    }
}

#[test]
fn the_means_of_the_fast_lobe_are_the_adaptive_means() {
    let grid = Grid::sopp();
    let cells = LobeCells::new(grid.clone(), LAMP, Angle::from_degrees(80.0));
    for exponent in [0.5, 5.0, 21.0, 121.0, 410.0, 1300.0, 5000.0, 60_000.0] {
        let lobe = AshikhminShirleySimplified { diffuse: [0.0; 3], specular: [1.0; 3], exponent };
        for cell in CELLS {
            let row = cells.row(cell[0], exponent);
            let at = cell[1] * 36 + cell[2];
            let (p, _) = row.value(at, exponent);
            let want = adaptive_cell_mean(&lobe, &grid, LAMP, cell)[0];
            assert!((p - want).abs() <= 1e-4 * want + 1e-9, "n {exponent} cell {cell:?}: {p} {want}");
            let (h, v) = (1e-5, row.with_derivative(at, exponent));
            let slope =
                (row.value(at, exponent * (1.0 + h)).0 - row.value(at, exponent * (1.0 - h)).0) / (2.0 * h);
            assert!((v.p - p).abs() <= 1e-12 * p);
            assert!((v.dp - slope).abs() <= 1e-5 * slope.abs() + 1e-9, "{} {slope}", v.dp);
        }
    }
}

#[test]
fn a_lobe_that_is_nearly_a_mirror_is_not_missed() {
    // all of its energy arrives in the cells about the mirror direction, whatever the lobe's width
    let grid = Grid::sopp();
    for exponent in [1e4, 1e6] {
        let lobe = AshikhminShirleySimplified { diffuse: [0.0; 3], specular: [1.0; 3], exponent };
        let mut energy = 0.0;
        for to in 16..21 {
            for phi in 33..36 {
                let f = adaptive_cell_mean(&lobe, &grid, LAMP, [9, to, phi])[0];
                assert!(f.is_finite() && f >= 0.0);
                let (a, b) = grid.theta_o_bounds(to);
                // ∫ cos θ dω over the bin, both sides of the plane of incidence
                let (p, q) = grid.phi_bounds(phi);
                energy += f * (b.sin().powi(2) - a.sin().powi(2)) * (q - p).radians();
            }
        }
        assert!((energy - 1.0).abs() < 0.02, "n {exponent}: {energy}");
    }
}

#[test]
fn smooth_models_and_other_lobes_are_averaged_too() {
    let grid = Grid::sopp();
    let white = adaptive_cell_mean(&Lambert { diffuse: [0.5; 3] }, &grid, LAMP, [3, 4, 5])[0];
    assert!((white * std::f64::consts::PI - 0.5).abs() < 1e-12);
    let phong = Phong { diffuse: [0.1; 3], specular: [0.3; 3], exponent: 200.0 };
    let rough = CookTorrance {
        diffuse: [0.1; 3],
        lobes: vec![CookTorranceLobe { specular: [0.5; 3], alpha: 0.07, r0: 0.1 }],
    };
    for m in [Model::Phong(phong), Model::CookTorrance(rough)] {
        for cell in CELLS {
            let (got, want) =
                (adaptive_cell_mean(m.brdf(), &grid, LAMP, cell)[0], brute(m.brdf(), &grid, cell));
            assert!((got / want - 1.0).abs() < 1e-3, "{} cell {cell:?}: {got} {want}", m.name());
        }
    }
}

#[test]
fn a_node_table_is_evaluated_at_its_nodes() {
    let grid = Grid::sopp();
    let (l, v) = grid.geometry(6, 12, 35).directions();
    let at_node = model(1300.0).eval(l, v);
    assert_eq!(adaptive_cell_mean(&model(1300.0), &grid, Meaning::Node, [6, 12, 35]), at_node);
    let cells = LobeCells::new(grid, Meaning::Node, Angle::RIGHT);
    let p = cells.row(6, 1300.0).value(12 * 36 + 35, 1300.0).0;
    assert!((0.1 * std::f64::consts::FRAC_1_PI + 0.1 * p - at_node[0]).abs() < 1e-9 * at_node[0]);
}

#[test]
fn the_gloss_in_a_cell_is_the_share_of_the_lamps_image() {
    let grid = Grid::sopp();
    let coat = crate::Coat { index: 1.5 };
    let alpha = Angle::from_degrees(0.5);
    for ti in [0, 1, 6, 15] {
        // all of the image lies in the cells around the mirror direction; the rest of the hemisphere gets nothing
        let level = coat.gloss_level(Angle::from_degrees(5.0 * ti as f64).cos(), alpha);
        let mut area = 0.0;
        for to in 0..37 {
            for phi in 0..36 {
                let b = CellBounds::of(&grid, alpha, [ti, to, phi]);
                area += gloss_cell_mean(level, &b) / level * grid.solid_angle(to, phi);
            }
        }
        let half_image = std::f64::consts::TAU * (alpha * 0.5).sin().powi(2);
        assert!((area / half_image - 1.0).abs() < 1e-3, "{ti}: {area} {half_image}");
    }
}

#[test]
fn a_cell_is_what_is_reflected_over_what_arrives() {
    // on the flank of a lobe at grazing incidence the side of the lamp nearer the normal brings more light
    let grid = Grid::sopp();
    let m = model(410.0);
    for cell in [[15, 28, 35], [15, 32, 35], [16, 34, 35], [17, 35, 34]] {
        let want = brute(&m, &grid, cell);
        for got in [adaptive_cell_mean(&m, &grid, LAMP, cell), cell_mean(&m, &grid, LAMP, cell, 16, 6)] {
            assert!((got[0] / want - 1.0).abs() < 1e-4, "cell {cell:?}: {} {want}", got[0]);
        }
    }
    // of a lamp that is half below the horizon the half above it lights the surface: a diffuser stays what it is
    let white = Lambert { diffuse: [0.5; 3] };
    for f in [
        adaptive_cell_mean(&white, &grid, LAMP, [18, 12, 10]),
        cell_mean(&white, &grid, LAMP, [18, 12, 10], 4, 2),
    ] {
        assert!((f[0] * std::f64::consts::PI - 0.5).abs() < 1e-12, "{}", f[0]);
    }
}
