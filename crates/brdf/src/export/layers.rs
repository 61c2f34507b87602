//! What the materials of renderers have in common: a diffuser, microfacet lobes over it, a smooth coat over all.
//!
//! Ashikhmin–Shirley and Ward lobes enter as Beckmann's: `(n·h)^n` has the width of α = √(2/(n + 2)) (Walter et al. 2007, section 5.3), and
//! their denominators (h·v) max(n·l, n·v), √((n·l)(n·v)), (n·l)(n·v) agree with 4 (n·l)(n·v)/G at normal incidence.

use gonio_optics::fresnel::{dielectric, r0_from_index};

use super::{NotMapped, Renderer, loss::on_some};
use crate::{Brdf, Model, ModelFile, Rgb, models::AshikhminShirley};

/// Distribution of the normals of a lobe.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Distribution {
    Beckmann,
    Ggx,
}

/// `colour · F · D G/(4 (n·l)(n·v))`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Lobe {
    pub colour: Rgb,
    /// Schlick's reflectance at normal incidence; `None` where the lobe has no Fresnel term (F = 1).
    pub r0: Option<f64>,
    pub alpha: f64,
    pub distribution: Distribution,
}

/// A model as layers.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Layers {
    pub diffuse: Rgb,
    pub lobes: Vec<Lobe>,
    /// Refractive index of a smooth coat.
    pub coat: Option<f64>,
}

impl Layers {
    /// The layers of a model, lobes without colour left out.
    pub(super) fn of(file: &ModelFile, renderer: Renderer) -> Result<Self, NotMapped> {
        let refuse = |why: &str, instead: &str| NotMapped {
            model: file.model.name().to_owned(),
            renderer: renderer.title(),
            why: why.to_owned(),
            instead: instead.to_owned(),
        };
        let beckmann = |colour, r0, alpha| Lobe { colour, r0, alpha, distribution: Distribution::Beckmann };
        let of_exponent = |n: f64| (2.0 / (n + 2.0)).sqrt();
        let (diffuse, mut lobes) = match &file.model {
            Model::Lambert(m) => (m.diffuse, Vec::new()),
            Model::AshikhminShirleySimplified(m) => {
                (m.diffuse, vec![beckmann(m.specular, None, of_exponent(m.exponent))])
            }
            Model::LambertAshikhminShirley(m) => {
                (m.diffuse, vec![beckmann(m.specular, m.r0, of_exponent(m.exponent))])
            }
            Model::AshikhminShirley(m) => {
                let albedo = diffuse_albedo(m.r0);
                (
                    m.diffuse.map(|d| d * albedo),
                    vec![beckmann(m.specular, Some(m.r0), of_exponent(m.exponent))],
                )
            }
            Model::Ward(m) => (m.diffuse, vec![beckmann(m.specular, None, m.alpha)]),
            Model::WardDuer(m) => (m.diffuse, vec![beckmann(m.specular, None, m.alpha)]),
            Model::CookTorrance(m) => {
                (m.diffuse, m.lobes.iter().map(|l| beckmann(l.specular, Some(l.r0), l.alpha)).collect())
            }
            Model::Ggx(m) => (
                m.diffuse,
                m.lobes
                    .iter()
                    .map(|l| Lobe {
                        colour: l.specular,
                        r0: Some(l.r0),
                        alpha: l.alpha,
                        distribution: Distribution::Ggx,
                    })
                    .collect(),
            ),
            Model::OrenNayar(_) => {
                return Err(refuse(
                    "its rough diffuser has no counterpart there",
                    "fit lambert, or ggx with a wide lobe",
                ));
            }
            Model::AshikhminShirleyAnisotropic(_) => {
                return Err(refuse(
                    "it is anisotropic and the materials written here are not",
                    "fit lambert-ashikhmin-shirley, cook-torrance or ggx",
                ));
            }
            Model::Phong(_) | Model::BlinnPhong(_) | Model::Lafortune(_) => {
                return Err(refuse(
                    "its lobe is not made of microfacets and falls off differently with the angle of incidence",
                    "fit cook-torrance, ggx or lambert-ashikhmin-shirley to the same data and export that",
                ));
            }
        };
        lobes.retain(|l| l.colour.iter().any(|c| *c > 0.0));
        Ok(Self { diffuse, lobes, coat: file.coat.map(|c| c.index) })
    }

    /// The base as it looks through its coat, for materials whose coat darkens by 1 − F(n·v) but neither refracts nor darkens the light's way in.
    ///
    /// The diffuser loses the mean transmittance of the way in and the factor n⁻²; a lobe looks n times as wide (a facet tilted by δ
    /// turns the ray by 2δ inside and 2nδ outside) with the same peak.
    pub(super) fn seen_through_coat(&self) -> Self {
        let Some(index) = self.coat else { return self.clone() };
        let way_in = 1.0 - mean_reflectance(index);
        let straight = 1.0 - r0_from_index(index);
        Self {
            diffuse: self.diffuse.map(|d| d * way_in / (index * index)),
            lobes: self
                .lobes
                .iter()
                .map(|l| Lobe {
                    colour: l.colour.map(|c| c * straight),
                    alpha: (l.alpha * index).min(1.0),
                    ..*l
                })
                .collect(),
            coat: self.coat,
        }
    }
}

/// The material whose GGX lobe looks most like a Beckmann lobe of the model: of several widths and brightnesses the one with the smallest colour
/// difference. A GGX lobe is made as it is. Says what was changed.
pub(super) fn nearest_ggx<M: Brdf>(
    model: &ModelFile,
    lobe: &Lobe,
    make: impl Fn(&Lobe) -> M,
) -> (M, Option<String>) {
    let plain = make(lobe);
    if lobe.distribution == Distribution::Ggx {
        return (plain, None);
    }
    let mut best = (on_some(model, &plain), plain, (1.0, 1.0));
    for width in [0.6, 0.7, 0.8, 0.9, 1.0, 1.1] {
        for bright in [0.6, 0.75, 0.9, 1.0, 1.15, 1.3] {
            let material =
                make(&Lobe { colour: lobe.colour.map(|c| c * bright), alpha: lobe.alpha * width, ..*lobe });
            let off = on_some(model, &material);
            if off < best.0 {
                best = (off, material, (width, bright));
            }
        }
    }
    let (width, bright) = best.2;
    let note = format!(
        "the lobe becomes GGX, which has longer tails: {width} of its width and {bright} of its brightness look most alike"
    );
    (best.1, Some(note))
}

/// The largest channel.
pub(super) fn largest(c: Rgb) -> f64 {
    c.into_iter().fold(0.0, f64::max)
}

/// ∫ g(μ) 2μ dμ over 0…1 by the midpoint rule.
fn cosine_mean(g: impl Fn(f64) -> f64) -> f64 {
    const STEPS: usize = 256;
    let h = 1.0 / STEPS as f64;
    (0..STEPS).map(|k| (k as f64 + 0.5) * h).map(|mu| g(mu) * 2.0 * mu * h).sum()
}

/// Reflectance of a smooth interface for diffuse light from outside.
fn mean_reflectance(index: f64) -> f64 {
    cosine_mean(|mu| dielectric(mu, index))
}

/// Share of diffuse light that the diffuse term of the full Ashikhmin–Shirley form gives back for cd = 1.
fn diffuse_albedo(r0: f64) -> f64 {
    let direction = |mu: f64| {
        let s = (1.0 - mu * mu).max(0.0).sqrt();
        gonio_optics::Vec3::new(s, 0.0, mu)
    };
    // the term is a product of a factor of μi and one of μo
    let straight = AshikhminShirley::diffuse_term(r0, direction(1.0), direction(1.0));
    let side = cosine_mean(|mu| {
        AshikhminShirley::diffuse_term(r0, direction(mu), direction(1.0)) / straight.max(1e-300)
    });
    std::f64::consts::PI * straight * side * side
}
