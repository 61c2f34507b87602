//! The colour of a thin film between the coat and the flake's core: Airy's sum over wavelengths, both polarisations.
//!
//! ```text
//! r = (r1 + r2 e^{2iβ}) / (1 + r1 r2 e^{2iβ}),   β = 2π n_f d cos θ_f / λ
//! ```
//!
//! Reflectances are tabulated over thickness and angle once and looked up between.

use gonio_optics::colour::SpectralWeights;

/// Refractive index of the core (mica).
const CORE_INDEX: f64 = 1.58;
/// Angles tabulated: equal steps of the sine from 0 to 1.
const ANGLES: usize = 24;
/// Thicknesses tabulated.
const THICKNESSES: usize = 48;

/// Reflectance per channel over thickness and sine of the angle of incidence, both in the coat.
#[derive(Clone, Debug)]
pub(super) struct FilmTable {
    low_nm: f64,
    step_nm: f64,
    /// Over thickness, then angle; one row for a flake without film.
    rows: Vec<[[f32; 3]; ANGLES]>,
}

impl FilmTable {
    /// Of films of `mean_nm` that spread by `spread_nm` (the table covers ±4 of it); thickness 0 is bare metal.
    pub(super) fn new(coat: f64, film: f64, mean_nm: f64, spread_nm: f64, reflectance: [f64; 3]) -> Self {
        if mean_nm <= 0.0 {
            let row = [reflectance.map(|r| r as f32); ANGLES];
            return Self { low_nm: 0.0, step_nm: 1.0, rows: vec![row] };
        }
        let count = if spread_nm > 0.0 { THICKNESSES } else { 1 };
        let low_nm = if count == 1 { mean_nm } else { (mean_nm - 4.0 * spread_nm).max(0.0) };
        let step_nm =
            if count == 1 { 1.0 } else { (mean_nm + 4.0 * spread_nm - low_nm) / (count - 1) as f64 };
        let wavelengths: Vec<f64> = (0..81).map(|k| 380.0 + 5.0 * f64::from(k)).collect();
        let weights = SpectralWeights::new(&wavelengths).ok();
        let rows = (0..count)
            .map(|t| {
                let thickness = low_nm + step_nm * t as f64;
                std::array::from_fn(|a| {
                    let sine = a as f64 / (ANGLES - 1) as f64;
                    let spectrum: Vec<f64> =
                        wavelengths.iter().map(|&nm| airy(coat, film, thickness, sine, nm)).collect();
                    let rgb = weights.as_ref().map_or([0.0; 3], |w| w.rgb(&spectrum));
                    // saturated interference colours leave the gamut
                    [0, 1, 2].map(|c| (rgb[c].max(0.0) * reflectance[c]) as f32)
                })
            })
            .collect();
        Self { low_nm, step_nm, rows }
    }

    /// Reflectance of a film of this thickness at a sine of the angle of incidence.
    pub(super) fn at(&self, thickness_nm: f64, sine: f64) -> [f64; 3] {
        let place = |x: f64, n: usize| {
            let x = x.clamp(0.0, (n - 1) as f64);
            let k = (x as usize).min(n.saturating_sub(2));
            (k, (k + 1).min(n - 1), (x - k as f64).clamp(0.0, 1.0))
        };
        let (t0, t1, t) = place((thickness_nm - self.low_nm) / self.step_nm, self.rows.len());
        let (a0, a1, a) = place(sine * (ANGLES - 1) as f64, ANGLES);
        [0, 1, 2].map(|c| {
            let along = |row: usize| {
                let r = &self.rows[row];
                f64::from(r[a0][c]) * (1.0 - a) + f64::from(r[a1][c]) * a
            };
            along(t0) * (1.0 - t) + along(t1) * t
        })
    }
}

/// Reflectance of a film between the coat and the core, at a sine of the angle in the coat, mean of both polarisations.
fn airy(coat: f64, film: f64, thickness_nm: f64, sine: f64, wavelength_nm: f64) -> f64 {
    let cosine = |n: f64| (1.0 - (sine * coat / n).powi(2)).max(0.0).sqrt();
    let (c0, c1, c2) = (cosine(coat).max(1e-9), cosine(film), cosine(CORE_INDEX));
    let twice_beta = 4.0 * std::f64::consts::PI * film * thickness_nm * c1 / wavelength_nm;
    let sum = |r1: f64, r2: f64| {
        let (a, b) = (r1 * r1 + r2 * r2 + 2.0 * r1 * r2 * twice_beta.cos(), r1 * r2);
        a / (1.0 + b * b + 2.0 * b * twice_beta.cos())
    };
    let s = |n: f64, ca: f64, m: f64, cb: f64| (n * ca - m * cb) / (n * ca + m * cb);
    let p = |n: f64, ca: f64, m: f64, cb: f64| (m * ca - n * cb) / (m * ca + n * cb);
    0.5 * (sum(s(coat, c0, film, c1), s(film, c1, CORE_INDEX, c2))
        + sum(p(coat, c0, film, c1), p(film, c1, CORE_INDEX, c2)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_film_of_no_thickness_is_the_core_alone_and_half_waves_vanish() {
        let bare = ((1.5 - CORE_INDEX) / (1.5 + CORE_INDEX)).powi(2);
        assert!((airy(1.5, 2.4, 0.0, 0.0, 550.0) - bare).abs() < 1e-15);
        // half a wave in the film: as if it were not there; a quarter: brightest
        let half = 550.0 / (2.0 * 2.4);
        assert!((airy(1.5, 2.4, half, 0.0, 550.0) - bare).abs() < 1e-12);
        // quarter-wave: ((n0 n2 − n1²)/(n0 n2 + n1²))²
        let m = (1.5 * CORE_INDEX - 2.4 * 2.4) / (1.5 * CORE_INDEX + 2.4 * 2.4);
        assert!((airy(1.5, 2.4, 0.5 * half, 0.0, 550.0) - m * m).abs() < 1e-12);
    }

    #[test]
    fn the_colour_moves_to_shorter_waves_with_the_angle() {
        let t = FilmTable::new(1.5, 2.4, 120.0, 5.0, [1.0; 3]);
        let (straight, slanting) = (t.at(120.0, 0.0), t.at(120.0, 0.65));
        assert!((0..3).any(|c| (straight[c] - slanting[c]).abs() > 0.02), "{straight:?} {slanting:?}");
        assert!(
            t.at(500.0, 0.2).iter().chain(&t.at(0.0, 2.0)).all(|v| v.is_finite() && (0.0..=1.0).contains(v))
        );
        let bare = FilmTable::new(1.5, 2.4, 0.0, 0.0, [0.8, 0.7, 0.6]);
        assert!((bare.at(0.0, 0.3)[1] - 0.7).abs() < 1e-6);
    }
}
