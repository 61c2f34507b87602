//! Is there a coat, and what is its index? The gloss of all poses against Fresnel's curve.
//!
//! `Σ ((F_i − F(θi; n))/σ_i)² → min` over n: a log grid brackets, golden sections refine. A narrow lobe of the base also stands above its
//! surroundings, but its `∫ f dω cos θi` does not climb with θi as Fresnel's reflectance does, and it does not end one pixel
//! beyond the lamp's image.

use gonio_optics::fresnel;

use super::Gloss;

/// Range of n searched.
const INDEX: (f64, f64) = (1.01, 3.0);
/// n from which on a surface counts as a coat: F at normal incidence 0.8 %.
const LEAST_INDEX: f64 = 1.2;
/// Largest departure from Fresnel's curve, root mean square, relative.
const LARGEST_MISFIT: f64 = 0.05;
/// Largest share of the excess outside the lamp's image.
const LARGEST_HALO: f64 = 0.2;
/// F over its σ for which a pose sees a gloss.
const SEEN: f64 = 8.0;
/// Error of one pose's F that its noise does not tell (white reference pixel by pixel, edges), relative.
const OWN_ERROR: f64 = 2e-3;

/// A coat as the poses show it.
#[derive(Clone, Debug, PartialEq)]
pub struct CoatFit {
    /// Refractive index.
    pub index: f64,
    /// Its standard uncertainty: noise, and the certificate of the white reference.
    pub index_sigma: f64,
    /// Mean of F measured over F of the index: 1 where the poses agree with Fresnel's curve.
    pub ratio: f64,
    /// Root mean square of F measured / F of the index − 1.
    pub misfit: f64,
    /// Poses that took part.
    pub poses: usize,
}

impl CoatFit {
    /// A coat whose index is given.
    #[must_use]
    pub const fn of_index(index: f64) -> Self {
        Self { index, index_sigma: 0.0, ratio: 1.0, misfit: 0.0, poses: 0 }
    }

    /// Reflectance at normal incidence.
    #[must_use]
    pub fn r0(&self) -> f64 {
        fresnel::r0_from_index(self.index)
    }
}

/// What the poses say.
#[derive(Clone, Debug, PartialEq)]
pub enum Verdict {
    /// A smooth clear coat.
    Coat(CoatFit),
    /// None that can be told, and why.
    None(String),
}

/// Judges the gloss of all poses. `certificate` is the relative standard uncertainty common to all of them.
#[must_use]
pub fn judge(found: &[Gloss], certificate: f64) -> Verdict {
    let all: Vec<&Gloss> = found.iter().filter(|g| g.reflectance.is_some()).collect();
    let seeing: Vec<&Gloss> =
        all.iter().copied().filter(|g| g.reflectance.is_some_and(|f| f > SEEN * g.sigma)).collect();
    if found.is_empty() {
        return Verdict::None("no pose shows the mirror direction".to_owned());
    }
    if seeing.len() < 2 || 2 * seeing.len() < all.len() {
        return Verdict::None(format!(
            "{} of {} poses that show the mirror direction see light standing out there",
            seeing.len(),
            all.len()
        ));
    }
    let fit = fit(&seeing, certificate);
    let total: f64 = seeing.iter().filter_map(|g| g.reflectance).sum();
    let halo = seeing.iter().map(|g| g.halo * g.reflectance.unwrap_or(0.0)).sum::<f64>() / total;
    if fit.index < LEAST_INDEX {
        return Verdict::None(format!(
            "what stands out at the mirror direction is fainter than any coat's gloss (index {:.3})",
            fit.index
        ));
    }
    if halo.abs() > LARGEST_HALO {
        return Verdict::None(format!(
            "{:.0} % of what stands out lies outside the lamp's image: a narrow lobe, not a gloss",
            100.0 * halo
        ));
    }
    if fit.misfit > LARGEST_MISFIT {
        return Verdict::None(format!(
            "what stands out departs from Fresnel's curve by {:.0} % (index {:.3}): a narrow lobe, not a gloss",
            100.0 * fit.misfit,
            fit.index
        ));
    }
    Verdict::Coat(fit)
}

fn fit(found: &[&Gloss], certificate: f64) -> CoatFit {
    let rows: Vec<(f64, f64, f64)> = found
        .iter()
        .filter_map(|g| {
            let f = g.reflectance?;
            Some((g.theta_i.cos(), f, g.sigma.hypot(OWN_ERROR * f)))
        })
        .collect();
    let squares =
        |n: f64| -> f64 { rows.iter().map(|&(c, f, s)| ((f - fresnel::dielectric(c, n)) / s).powi(2)).sum() };
    let step = |k: usize| INDEX.0 * (INDEX.1 / INDEX.0).powf(k as f64 / 200.0);
    let best = (0..=200).min_by(|&a, &b| squares(step(a)).total_cmp(&squares(step(b)))).unwrap_or(0);
    let index = golden(step(best.saturating_sub(1)), step((best + 1).min(200)), squares);
    // curvature by differences; residuals beyond the stated noise widen it
    let slope = |c: f64| (fresnel::dielectric(c, index + 1e-5) - fresnel::dielectric(c, index - 1e-5)) / 2e-5;
    let information: f64 = rows.iter().map(|&(c, _, s)| (slope(c) / s).powi(2)).sum();
    let reduced = (squares(index) / (rows.len().max(2) - 1) as f64).max(1.0);
    // a common factor on F moves n as a whole
    let pull: f64 = rows.iter().map(|&(c, f, s)| slope(c) * f / (s * s)).sum::<f64>() / information;
    let relative = |&(c, f, _): &(f64, f64, f64)| f / fresnel::dielectric(c, index);
    let n = rows.len() as f64;
    CoatFit {
        index,
        index_sigma: (reduced / information).sqrt().hypot(certificate * pull),
        ratio: rows.iter().map(relative).sum::<f64>() / n,
        misfit: (rows.iter().map(|r| (relative(r) - 1.0).powi(2)).sum::<f64>() / n).sqrt(),
        poses: rows.len(),
    }
}

/// The minimum of a function with one minimum between `a` and `b`.
fn golden(mut a: f64, mut b: f64, f: impl Fn(f64) -> f64) -> f64 {
    const G: f64 = 0.618_033_988_749_894_9;
    let (mut c, mut d) = (b - G * (b - a), a + G * (b - a));
    let (mut fc, mut fd) = (f(c), f(d));
    for _ in 0..60 {
        if fc < fd {
            (b, d, fd) = (d, c, fc);
            c = b - G * (b - a);
            fc = f(c);
        } else {
            (a, c, fc) = (c, d, fd);
            d = a + G * (b - a);
            fd = f(d);
        }
    }
    0.5 * (a + b)
}

#[cfg(test)]
mod tests {
    use super::*;
    use gonio_optics::Angle;

    fn poses(reflectance: impl Fn(f64) -> f64, halo: f64) -> Vec<Gloss> {
        (1..14)
            .map(|k| {
                let theta_i = Angle::from_degrees(f64::from(k) * 5.0);
                let f = reflectance(theta_i.cos());
                Gloss {
                    theta_i,
                    reflectance: Some(f),
                    sigma: 1e-3 * f.abs().max(1e-3),
                    halo,
                    offset: [Angle::ZERO; 2],
                    saturated: 0,
                    base: [0.1; 3],
                    base_sigma: [0.0; 3],
                }
            })
            .collect()
    }

    #[test]
    fn the_index_is_found_and_a_common_error_of_the_scale_is_in_its_uncertainty() {
        for index in [1.25, 1.45, 1.5, 1.567, 2.2] {
            let Verdict::Coat(fit) = judge(&poses(|c| fresnel::dielectric(c, index), 0.0), 0.0) else {
                panic!("{index}: no coat")
            };
            assert!((fit.index - index).abs() < 1e-6 && (fit.ratio - 1.0).abs() < 1e-6, "{fit:?}");
        }
        let Verdict::Coat(off) = judge(&poses(|c| 1.01 * fresnel::dielectric(c, 1.5), 0.0), 0.01) else {
            panic!("no coat")
        };
        let error = off.index - 1.5;
        assert!(error > 1e-3 && error < 1.5 * off.index_sigma, "{off:?}");
    }

    #[test]
    fn a_narrow_lobe_is_no_coat() {
        // an Ashikhmin–Shirley lobe reflects the same share at every angle
        assert!(matches!(judge(&poses(|_| 0.05, 0.0), 0.0), Verdict::None(why) if why.contains("Fresnel")));
        let wide = judge(&poses(|c| fresnel::dielectric(c, 1.5), 0.5), 0.0);
        assert!(matches!(wide, Verdict::None(why) if why.contains("outside")));
        assert!(matches!(judge(&poses(|_| 0.0, 0.0), 0.0), Verdict::None(why) if why.contains("0 of 13")));
        assert!(matches!(judge(&[], 0.0), Verdict::None(why) if why.contains("no pose")));
    }
}
