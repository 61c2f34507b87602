//! Reflectance spectra to linear RGB: CIE 1931 2° observer under D65.
//!
//! `X = Σ S(λ) x̄(λ) ρ(λ) / Σ S(λ) ȳ(λ)` over 380–780 nm by 5 nm, ρ linear between its samples and constant beyond the first and the
//! last. Where the samples are given, this is a sum over them with fixed weights, so the weights are made once.
//! XYZ are scaled per component (by less than 3e-4) from the tables' white to that of the Rec. 709 matrix: ρ = 1 is RGB (1, 1, 1) exactly.

use super::cie::{FIRST_NM, STEP_NM, TABLE};
use super::{D65_WHITE, rgb_from_xyz};

/// Weights that turn a spectrum at fixed wavelengths into linear Rec. 709 RGB.
#[derive(Clone, Debug, PartialEq)]
pub struct SpectralWeights {
    weights: Vec<[f64; 3]>,
}

/// Wavelengths that cannot carry a spectrum.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SpectralError {
    /// None given.
    #[error("no wavelength given, expected at least one")]
    Empty,
    /// Out of order, not a number, or not in nanometres.
    #[error(
        "wavelength {found} nm (number {index}), expected numbers from 100 to 3000 nm, each larger than the one before"
    )]
    Wavelength {
        /// Its place.
        index: usize,
        /// Its value, nm.
        found: f64,
    },
}

impl SpectralWeights {
    /// Weights for samples at these wavelengths, nm.
    ///
    /// # Errors
    /// [`SpectralError`] where they are not increasing numbers of nanometres.
    pub fn new(wavelengths_nm: &[f64]) -> Result<Self, SpectralError> {
        if wavelengths_nm.is_empty() {
            return Err(SpectralError::Empty);
        }
        let mut before = f64::NEG_INFINITY;
        for (index, &found) in wavelengths_nm.iter().enumerate() {
            if !(100.0..=3000.0).contains(&found) || found <= before {
                return Err(SpectralError::Wavelength { index, found });
            }
            before = found;
        }
        let white = tristimulus_sums();
        let mut xyz = vec![[0.0; 3]; wavelengths_nm.len()];
        for (k, [x, y, z, power]) in TABLE.iter().enumerate() {
            let (below, above, t) = neighbours(wavelengths_nm, FIRST_NM + STEP_NM * k as f64);
            for (c, response) in [x, y, z].into_iter().enumerate() {
                let part = response * power / white[c] * D65_WHITE[c];
                xyz[below][c] += (1.0 - t) * part;
                xyz[above][c] += t * part;
            }
        }
        Ok(Self { weights: xyz.into_iter().map(rgb_from_xyz).collect() })
    }

    /// Linear RGB of a spectrum; samples beyond the number of wavelengths are not looked at. May leave [0, 1] for strong colours.
    #[must_use]
    pub fn rgb(&self, spectrum: &[f64]) -> [f64; 3] {
        let mut out = [0.0; 3];
        for (w, s) in self.weights.iter().zip(spectrum) {
            for c in 0..3 {
                out[c] += w[c] * s;
            }
        }
        out
    }

    /// Number of samples.
    #[must_use]
    pub fn len(&self) -> usize {
        self.weights.len()
    }

    /// Never true: there is at least one wavelength.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.weights.is_empty()
    }
}

fn tristimulus_sums() -> [f64; 3] {
    let mut sums = [0.0; 3];
    for [x, y, z, power] in TABLE {
        sums[0] += x * power;
        sums[1] += y * power;
        sums[2] += z * power;
    }
    sums
}

/// Indices of the samples around `nm` and the fraction towards the second; the end samples hold beyond the ends.
fn neighbours(samples: &[f64], nm: f64) -> (usize, usize, f64) {
    let above = samples.partition_point(|&s| s <= nm);
    if above == 0 {
        return (0, 0, 0.0);
    }
    if above == samples.len() {
        return (above - 1, above - 1, 0.0);
    }
    (above - 1, above, (nm - samples[above - 1]) / (samples[above] - samples[above - 1]))
}

#[cfg(test)]
mod tests {
    use super::super::xyz_from_rgb;
    use super::*;

    fn visible() -> Vec<f64> {
        (0..31).map(|k| 400.0 + 10.0 * f64::from(k)).collect()
    }

    #[test]
    fn equal_reflectance_is_white_at_any_sampling() {
        for nm in
            [vec![550.0], vec![450.0, 600.0], visible(), (0..401).map(|k| 380.0 + f64::from(k)).collect()]
        {
            let rgb = SpectralWeights::new(&nm).unwrap().rgb(&vec![1.0; nm.len()]);
            assert!(rgb.iter().all(|c| (c - 1.0).abs() < 1e-12), "{rgb:?}");
        }
    }

    #[test]
    fn the_tables_have_the_white_of_the_cie() {
        // CIE 15: D65, 2° observer: x = 0.31272, y = 0.32903
        let [x, y, z] = tristimulus_sums();
        assert!((x / (x + y + z) - 0.31272).abs() < 1e-5 && (y / (x + y + z) - 0.32903).abs() < 1e-5);
    }

    /// Reference: colour-science 0.4.7, `sd_to_XYZ(method="Integration")` over 380–780 nm by 5 nm, the samples interpolated
    /// linearly; the last line of numbers is its white.
    #[test]
    fn spectra_have_the_colours_of_an_independent_program() {
        let ramp = |nm: f64| ((nm - 400.0) / 300.0).clamp(0.0, 1.0);
        let green = |nm: f64| (-((nm - 530.0) / 40.0).powi(2)).exp();
        let w = SpectralWeights::new(&visible()).unwrap();
        let xyz =
            |f: &dyn Fn(f64) -> f64| xyz_from_rgb(w.rgb(&visible().into_iter().map(f).collect::<Vec<_>>()));
        let white = [0.950_429_669_402, 1.0, 1.088_800_547_030];
        for (found, expected) in [
            (xyz(&ramp), [0.528_281_696_786, 0.522_577_255_856, 0.201_870_913_230]),
            (xyz(&green), [0.183_289_515_530, 0.501_495_216_355, 0.109_207_152_956]),
        ] {
            for c in 0..3 {
                let scaled = expected[c] / white[c] * D65_WHITE[c];
                assert!((found[c] - scaled).abs() < 1e-9, "{found:?} {expected:?}");
            }
        }
    }

    #[test]
    fn red_light_is_red() {
        let spectrum: Vec<f64> = visible().into_iter().map(|nm| f64::from(nm > 600.0)).collect();
        let [r, g, b] = SpectralWeights::new(&visible()).unwrap().rgb(&spectrum);
        assert!(r > 0.5 && r > 4.0 * g.abs() && r > 4.0 * b.abs(), "{r} {g} {b}");
    }

    #[test]
    fn wavelengths_that_make_no_sense_are_refused() {
        assert_eq!(SpectralWeights::new(&[]), Err(SpectralError::Empty));
        for bad in [[400.0, 400.0], [400.0, f64::NAN], [0.4, 0.7]] {
            assert!(SpectralWeights::new(&bad).is_err(), "{bad:?}");
        }
    }
}
