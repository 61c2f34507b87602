//! A 3 × 3 matrix from the camera's linear colours to linear Rec. 709 (D65), from patches whose Lab is known.
//!
//! First by least squares in linear colours, then by Gauss and Newton in Lab, where equal distances look more alike. What is left is told as CIEDE2000:
//! a camera's sensitivities are no sums of the eye's, so something always is.

use gonio_brdf::Measured;
use gonio_instrument::radiometry::ColourCorrection;
use gonio_optics::colour;
use nalgebra::{DMatrix, DVector};

/// Fewest patches: nine numbers from three each, with some to spare.
pub const LEAST_PATCHES: usize = 6;

/// A patch.
#[derive(Clone, Debug, PartialEq)]
pub struct Patch {
    /// Its name.
    pub name: String,
    /// Its certified Lab, D65, white = perfect diffuser.
    pub lab: [f64; 3],
    /// π f as the camera's channels have it.
    pub camera: [f64; 3],
}

/// Why there is no matrix.
#[derive(Debug, thiserror::Error, PartialEq)]
pub enum ChartError {
    /// Too few patches.
    #[error("the chart has {found} usable patches, at least {LEAST_PATCHES} are needed")]
    Few {
        /// Found.
        found: usize,
    },
    /// Patches that are all alike.
    #[error(
        "the chart's patches do not differ enough in colour to tell nine numbers; add saturated ones (red, green, blue)"
    )]
    Alike,
    /// A number that no patch can have.
    #[error(
        "patch {name} has Lab {lab:?} and camera values {camera:?}: expected finite numbers, L* of 0 to 150, camera values above 0"
    )]
    Value {
        /// Which.
        name: String,
        /// Given.
        lab: [f64; 3],
        /// Measured.
        camera: [f64; 3],
    },
}

/// Finds the matrix; `chart` is the name it goes by.
///
/// # Errors
/// [`ChartError`].
pub fn find(patches: &[Patch], chart: &str) -> Result<ColourCorrection, ChartError> {
    for p in patches {
        let finite = p.lab.iter().chain(&p.camera).all(|v| v.is_finite());
        if !finite || !(0.0..=150.0).contains(&p.lab[0]) || p.camera.iter().any(|v| *v <= 0.0) {
            return Err(ChartError::Value { name: p.name.clone(), lab: p.lab, camera: p.camera });
        }
    }
    if patches.len() < LEAST_PATCHES {
        return Err(ChartError::Few { found: patches.len() });
    }
    let camera = DMatrix::from_fn(patches.len(), 3, |r, c| patches[r].camera[c]);
    let wanted = DMatrix::from_fn(patches.len(), 3, |r, c| rgb_from_lab(patches[r].lab)[c]);
    let svd = camera.clone().svd(true, true);
    let values = &svd.singular_values;
    if values.min() < 1e-3 * values.max() {
        return Err(ChartError::Alike);
    }
    let solved = svd.solve(&wanted, 0.0).map_err(|_| ChartError::Alike)?;
    let mut m = [0, 1, 2].map(|r| [0, 1, 2].map(|c| solved[(c, r)]));
    refine(&mut m, patches);
    let differences: Vec<f64> = patches
        .iter()
        .map(|p| colour::ciede2000(colour::lab_from_rgb(apply(&m, p.camera)), lab(p.lab)))
        .collect();
    Ok(ColourCorrection {
        matrix: m,
        chart: chart.to_owned(),
        patches: patches.len() as u32,
        delta_e_mean: differences.iter().sum::<f64>() / differences.len() as f64,
        delta_e_max: differences.iter().copied().fold(0.0, f64::max),
    })
}

/// A colour through the matrix.
#[must_use]
pub fn apply(matrix: &[[f64; 3]; 3], rgb: [f64; 3]) -> [f64; 3] {
    matrix.map(|r| r[0] * rgb[0] + r[1] * rgb[1] + r[2] * rgb[2])
}

fn value(v: &mut [f32; 3], matrix: &[[f64; 3]; 3]) {
    *v = apply(matrix, v.map(f64::from)).map(|x| x as f32);
}

/// Channels err on their own; what errs alike in all of them comes out a little small.
fn sigma(v: &mut [f32; 3], matrix: &[[f64; 3]; 3]) {
    let squares = matrix.map(|r| r.map(|x| x * x));
    *v = apply(&squares, v.map(|x| f64::from(x).powi(2))).map(|x| x.sqrt() as f32);
}

/// Takes values and their σ through the matrix.
pub fn take_cells_through(values: &mut [[f32; 3]], sigmas: &mut [[f32; 3]], matrix: &[[f64; 3]; 3]) {
    values.iter_mut().for_each(|v| value(v, matrix));
    sigmas.iter_mut().for_each(|v| sigma(v, matrix));
}

/// Takes a table through the matrix: values, σ and its parts, bases.
pub fn take_through(m: &mut Measured, matrix: &[[f64; 3]; 3]) {
    take_cells_through(&mut m.values, &mut m.sigma, matrix);
    m.sigma_parts.values_mut().flatten().for_each(|v| sigma(v, matrix));
    m.base.iter_mut().flatten().for_each(|v| value(v, matrix));
    m.base_single_pass.iter_mut().flatten().for_each(|v| value(v, matrix));
}

fn lab([l, a, b]: [f64; 3]) -> colour::Lab {
    colour::Lab { l, a, b }
}

/// Linear Rec. 709 of a Lab.
#[must_use]
pub fn rgb_from_lab([l, a, b]: [f64; 3]) -> [f64; 3] {
    let y = (l + 16.0) / 116.0;
    let back =
        |t: f64| if t > 6.0 / 29.0 { t.powi(3) } else { 3.0 * (6.0f64 / 29.0).powi(2) * (t - 4.0 / 29.0) };
    let f = [y + a / 500.0, y, y - b / 200.0];
    colour::rgb_from_xyz([0, 1, 2].map(|k| back(f[k]) * colour::D65_WHITE[k]))
}

fn residuals(m: &[[f64; 3]; 3], patches: &[Patch]) -> DVector<f64> {
    let each = patches.iter().flat_map(|p| {
        let got = colour::lab_from_rgb(apply(m, p.camera));
        [got.l - p.lab[0], got.a - p.lab[1], got.b - p.lab[2]]
    });
    DVector::from_iterator(3 * patches.len(), each)
}

fn refine(m: &mut [[f64; 3]; 3], patches: &[Patch]) {
    for _ in 0..20 {
        let here = residuals(m, patches);
        let mut jacobian = DMatrix::zeros(here.len(), 9);
        for k in 0..9 {
            let step = 1e-6;
            let (mut up, mut down) = (*m, *m);
            up[k / 3][k % 3] += step;
            down[k / 3][k % 3] -= step;
            jacobian.set_column(k, &((residuals(&up, patches) - residuals(&down, patches)) / (2.0 * step)));
        }
        let Ok(change) = jacobian.svd(true, true).solve(&here, 1e-12) else { return };
        let mut part = 1.0;
        loop {
            let mut trial = *m;
            for k in 0..9 {
                trial[k / 3][k % 3] -= part * change[k];
            }
            if residuals(&trial, patches).norm() < here.norm() {
                *m = trial;
                break;
            }
            part *= 0.5;
            if part < 1e-3 {
                return;
            }
        }
        if change.norm() * part < 1e-10 {
            return;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MIX: [[f64; 3]; 3] = [[0.8, 0.15, 0.05], [0.1, 0.8, 0.1], [0.02, 0.18, 0.8]];

    fn patches() -> Vec<Patch> {
        let labs = [
            [96.0, 0.0, 1.0],
            [65.0, 0.5, -0.5],
            [36.0, 0.0, 0.0],
            [42.0, 40.0, 20.0],
            [55.0, -28.0, 25.0],
            [35.0, 10.0, -35.0],
            [80.0, 0.0, 50.0],
            [52.0, 35.0, -10.0],
            [55.0, -20.0, -15.0],
        ];
        labs.iter()
            .enumerate()
            .map(|(k, &lab)| Patch { name: format!("{k}"), lab, camera: apply(&MIX, rgb_from_lab(lab)) })
            .collect()
    }

    #[test]
    fn a_camera_that_mixes_colours_is_put_right() {
        let found = find(&patches(), "chart").expect("a matrix");
        assert!(found.delta_e_max < 1e-3, "{found:?}");
        // the same patches without the matrix are visibly off
        let off = |p: &Patch| colour::ciede2000(colour::lab_from_rgb(p.camera), lab(p.lab));
        assert!(patches().iter().map(off).fold(0.0, f64::max) > 5.0);
        // a sensitivity that is no sum of the eye's leaves something, and that is told
        let mut other = patches();
        other[4].camera[0] *= 1.3;
        assert!(find(&other, "chart").expect("a matrix").delta_e_max > 1.0);
    }

    #[test]
    fn lab_and_back() {
        for p in patches() {
            let got = colour::lab_from_rgb(rgb_from_lab(p.lab));
            assert!(
                (got.l - p.lab[0]).abs() < 1e-9
                    && (got.a - p.lab[1]).abs() < 1e-8
                    && (got.b - p.lab[2]).abs() < 1e-8
            );
        }
    }

    #[test]
    fn charts_that_cannot_tell_are_refused() {
        assert_eq!(find(&patches()[..3], "c"), Err(ChartError::Few { found: 3 }));
        let grey: Vec<Patch> = (1..9)
            .map(|k| Patch {
                name: String::new(),
                lab: [10.0 * f64::from(k), 0.0, 0.0],
                camera: [0.1 * f64::from(k); 3],
            })
            .collect();
        assert_eq!(find(&grey, "c"), Err(ChartError::Alike));
        let mut bad = patches();
        bad[2].camera[1] = f64::NAN;
        assert!(matches!(find(&bad, "c"), Err(ChartError::Value { .. })));
    }
}
