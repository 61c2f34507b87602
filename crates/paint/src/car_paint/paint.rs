//! A car paint and its values.

use std::f64::consts::FRAC_1_PI;

use gonio_brdf::{Brdf, Coat, Rgb, models::CookTorranceLobe};
use gonio_optics::{Vec3, flake::FlakeVectors, fresnel};

use super::{CarPaintError, ColourTable, FlakePlace, Flakes};

/// Most lobes of a paint; three suffice (Golla & Klein; Günther et al. 2005).
pub const MAX_LOBES: usize = 3;

/// What a coat does to the light on its way to the base and back, besides refracting it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Through {
    /// T(θi) T(θo)/n²: what is not reflected at the surface gets through, and beams widen outside. Colours are those of the base itself.
    #[default]
    TwoWay,
    /// Nothing: directions are refracted, colours are those seen outside (eq. 7 as printed, without T).
    RefractedOnly,
}

impl Through {
    /// Name in files.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::TwoWay => "two-way",
            Self::RefractedOnly => "refracted-only",
        }
    }

    /// The form of a name.
    #[must_use]
    pub fn from_name(name: &str) -> Option<Self> {
        [Self::TwoWay, Self::RefractedOnly].into_iter().find(|t| t.name() == name)
    }
}

/// The parts of a paint, all reachable; [`CarPaint::new`] checks them.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct CarPaintParts {
    /// Name for people.
    pub name: String,
    /// The clear coat; directions stay as they are without one.
    pub coat: Option<Coat>,
    /// What the coat lets through.
    pub through: Through,
    /// a: diffuse albedo of the base per channel.
    pub diffuse: Rgb,
    /// Up to [`MAX_LOBES`] lobes of the base, in the modern normalisation F·D·G/(4 cos cos).
    pub lobes: Vec<CookTorranceLobe>,
    /// χ; 1 everywhere without one.
    pub colour: Option<ColourTable>,
    /// Ξ; nothing without.
    pub flakes: Option<Flakes>,
}

/// A car paint. As a [`Brdf`] it is the mean over the surface, the coat's gloss left out; [`CarPaint::eval_at`] is a place of it.
///
/// Reciprocal; finite and not negative everywhere.
#[derive(Clone, Debug, PartialEq)]
pub struct CarPaint {
    parts: CarPaintParts,
    sharpness: f64,
}

/// Two directions carried into the coat.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Inside {
    /// Towards the light, inside.
    pub light: Vec3,
    /// Towards the viewer, inside.
    pub view: Vec3,
    /// k: what the coat lets through.
    pub factor: f64,
    /// Place in the tables of χ and Ξ.
    pub place: FlakePlace,
}

impl CarPaint {
    /// A paint of its parts.
    ///
    /// # Errors
    /// [`CarPaintError::Value`] with the first part outside its bounds.
    pub fn new(parts: CarPaintParts) -> Result<Self, CarPaintError> {
        let colour = |key: &str, c: Rgb| match c.into_iter().find(|v| !(v.is_finite() && *v >= 0.0)) {
            Some(v) => Err(CarPaintError::value(key, v, "three finite numbers, none below 0")),
            None => Ok(()),
        };
        if let Some(coat) = parts.coat
            && !(coat.index > 1.0 && coat.index <= 4.0)
        {
            return Err(CarPaintError::value(
                "coat.index",
                coat.index,
                "above 1, at most 4 (1.5 for clear coats)",
            ));
        }
        colour("diffuse", parts.diffuse)?;
        if parts.lobes.len() > MAX_LOBES {
            return Err(CarPaintError::value("lobes", parts.lobes.len(), "at most 3 lobes"));
        }
        for (k, lobe) in parts.lobes.iter().enumerate() {
            colour(&format!("lobes[{k}].specular"), lobe.specular)?;
            if !(1e-4..=10.0).contains(&lobe.alpha) {
                return Err(CarPaintError::value(
                    format!("lobes[{k}].alpha"),
                    lobe.alpha,
                    "1e-4 … 10 (the rms slope)",
                ));
            }
            if !(0.0..=1.0).contains(&lobe.r0) {
                return Err(CarPaintError::value(format!("lobes[{k}].r0"), lobe.r0, "0 … 1"));
            }
        }
        // (n·h)^n of the same curvature, as for Cook–Torrance alone
        let sharpness = parts.lobes.iter().map(|l| 2.0 / (l.alpha * l.alpha)).fold(0.0, f64::max);
        Ok(Self { parts, sharpness })
    }

    /// Its parts.
    #[must_use]
    pub const fn parts(&self) -> &CarPaintParts {
        &self.parts
    }

    /// Its parts, to be changed and made a paint again.
    #[must_use]
    pub fn into_parts(self) -> CarPaintParts {
        self.parts
    }

    /// Index of the coat, 1 without one.
    #[must_use]
    pub fn index(&self) -> f64 {
        self.parts.coat.map_or(1.0, |c| c.index)
    }

    /// Unit directions outside carried into the coat; `None` where one is below the horizon.
    #[must_use]
    pub fn inside(&self, light: Vec3, view: Vec3) -> Option<Inside> {
        // not written as z < 0, so that what is not a number falls out
        if !(light.z >= 0.0 && view.z >= 0.0) {
            return None;
        }
        let (l, v, factor) = match self.parts.coat {
            None => (light, view, 1.0),
            Some(coat) => {
                let n = coat.index;
                let factor = match self.parts.through {
                    Through::TwoWay => {
                        (1.0 - coat.reflectance(light.z)) * (1.0 - coat.reflectance(view.z)) / (n * n)
                    }
                    Through::RefractedOnly => 1.0,
                };
                (fresnel::refract(light, n), fresnel::refract(view, n), factor)
            }
        };
        Some(Inside { light: l, view: v, factor, place: FlakePlace::of(FlakeVectors::inside(l, v)) })
    }

    /// χ (a/π + Σ fCT) in 1/sr inside the coat: the base without flakes and without k.
    #[must_use]
    pub fn base(&self, at: &Inside) -> Rgb {
        let p = &self.parts;
        let mut f = p.diffuse.map(|d| d * FRAC_1_PI);
        for lobe in &p.lobes {
            let value = lobe.value(at.light, at.view);
            for (out, s) in f.iter_mut().zip(lobe.specular) {
                *out += s * value;
            }
        }
        match &p.colour {
            None => f,
            Some(chi) => {
                let chi = chi.at(at.place);
                [0, 1, 2].map(|c| chi[c] * f[c])
            }
        }
    }

    /// f in 1/sr at a place of the surface, mm: with its own flakes instead of their mean.
    #[must_use]
    pub fn eval_at(&self, light: Vec3, view: Vec3, position_mm: [f64; 2]) -> Rgb {
        let Some(at) = self.inside(light, view) else { return [0.0; 3] };
        let flakes = self.parts.flakes.as_ref().map_or([0.0; 3], |f| f.at(at.place, position_mm));
        self.sum(&at, flakes)
    }

    fn sum(&self, at: &Inside, flakes: Rgb) -> Rgb {
        let base = self.base(at);
        // noise in measured flakes may be negative, light is not
        [0, 1, 2].map(|c| (at.factor * (base[c] + flakes[c])).max(0.0))
    }
}

impl Brdf for CarPaint {
    fn eval(&self, light: Vec3, view: Vec3) -> Rgb {
        let Some(at) = self.inside(light, view) else { return [0.0; 3] };
        let flakes = self.parts.flakes.as_ref().map_or([0.0; 3], |f| f.mean(at.place));
        self.sum(&at, flakes)
    }

    fn sharpness(&self) -> f64 {
        self.sharpness
    }
}
