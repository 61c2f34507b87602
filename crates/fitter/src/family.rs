//! A model as the solver sees it: terms that are linear in their colours, nonlinear parameters with bounds, perhaps a coat over all.

use gonio_brdf::{
    Coat, Model, ModelFile,
    models::{
        AshikhminShirley, AshikhminShirleyAnisotropic, AshikhminShirleySimplified, BlinnPhong, CookTorrance,
        CookTorranceLobe, Ggx, GgxLobe, Lafortune, LafortuneLobe, Lambert, LambertAshikhminShirley,
        OrenNayar, Phong, Ward, WardDuer,
    },
};

use crate::{
    CoatChoice, ModelChoice, Options,
    choice::MAX_LOBES,
    names,
    term::{Term, lafortune_weights},
};

/// How the solver walks along a parameter.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Scale {
    /// In its logarithm.
    Log,
    /// As it is.
    Linear,
}

/// A nonlinear parameter.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Nonlinear {
    pub name: &'static str,
    /// Bounds of the parameter itself.
    pub bounds: (f64, f64),
    pub scale: Scale,
    /// Number of values the global search tries.
    pub knots: usize,
}

impl Nonlinear {
    const fn log(name: &'static str, bounds: (f64, f64), knots: usize) -> Self {
        Self { name, bounds, scale: Scale::Log, knots }
    }

    /// Bounds on the scale the solver walks on.
    pub(crate) fn walked(&self) -> (f64, f64) {
        match self.scale {
            Scale::Log => (self.bounds.0.ln(), self.bounds.1.ln()),
            Scale::Linear => self.bounds,
        }
    }

    /// The parameter at a place of the walk.
    pub(crate) fn value(&self, q: f64) -> f64 {
        match self.scale {
            Scale::Log => q.exp(),
            Scale::Linear => q,
        }
    }

    /// Where the solver stands at a value of the parameter.
    pub(crate) fn place(&self, value: f64) -> f64 {
        match self.scale {
            Scale::Log => value.max(f64::MIN_POSITIVE).ln(),
            Scale::Linear => value,
        }
    }

    /// d parameter/d q.
    pub(crate) fn slope(&self, q: f64) -> f64 {
        match self.scale {
            Scale::Log => q.exp(),
            Scale::Linear => 1.0,
        }
    }

    /// The values of the global search, in q.
    pub(crate) fn grid(&self) -> Vec<f64> {
        let (low, high) = self.walked();
        let last = self.knots.max(2) - 1;
        (0..=last).map(|k| low + (high - low) * k as f64 / last as f64).collect()
    }
}

/// A term and the places of its parameters among those of the family.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Part {
    pub term: Term,
    /// Places of its parameters; `usize::MAX` where it has none.
    pub uses: [usize; 3],
}

/// The coat of a family.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Coated {
    No,
    /// Of a given index.
    Known(f64),
    /// Its index is this parameter.
    Parameter(usize),
}

/// A model with free parameters.
#[derive(Clone, Debug)]
pub(crate) struct Family {
    pub choice: ModelChoice,
    pub parts: Vec<Part>,
    pub parameters: Vec<Nonlinear>,
    pub coated: Coated,
}

/// Range of r0: below, cs·r0 alone is known.
const R0: (f64, f64) = (0.002, 1.0);
/// In the full Ashikhmin–Shirley form r0 = 1 leaves no diffuse term.
const R0_FULL: (f64, f64) = (0.002, 0.98);
/// Largest width of microfacet lobes: above, it is no lobe. The smallest has the width of the largest exponent.
const WIDEST: f64 = 2.0;
/// Values tried per unit of the logarithm of an exponent or, twice as many, a width.
const PER_UNIT: f64 = 2.1;
/// Index of a fitted coat.
const INDEX: (f64, f64) = (1.05, 2.5);
/// Leans of a Lafortune lobe: −90° looks back along the surface, 45° is Phong, 90° mirrors along the surface.
const LEAN_DEG: (f64, f64) = (-89.0, 89.0);

impl Family {
    /// The family of a choice.
    pub(crate) fn new(options: &Options, choice: ModelChoice) -> Self {
        let mut f = Self { choice, parts: Vec::new(), parameters: Vec::new(), coated: Coated::No };
        let (low, high) = options.exponents();
        let knots = |ratio: f64, per_unit: f64| (ratio.ln() * per_unit).ceil().max(3.0) as usize;
        let exponent = Nonlinear::log("exponent", (low, high), knots(high / low, PER_UNIT));
        let narrowest = (2.0 / (high + 2.0)).sqrt();
        let alpha = Nonlinear::log("alpha", (narrowest, WIDEST), knots(WIDEST / narrowest, 1.75 * PER_UNIT));
        let r0 = Nonlinear::log("r0", R0, 5);
        match choice {
            ModelChoice::Lambert => f.part(Term::Lambert, &[]),
            ModelChoice::OrenNayar => {
                let sigma =
                    Nonlinear { name: "sigma_deg", bounds: (0.0, 90.0), scale: Scale::Linear, knots: 10 };
                f.own(Term::OrenNayar, &[sigma]);
            }
            ModelChoice::AshikhminShirley => {
                let r0 = f.parameter(Nonlinear::log("r0", R0_FULL, 9));
                let n = f.parameter(exponent);
                f.parts.push(Part { term: Term::AshikhminDiffuse, uses: [r0, usize::MAX, usize::MAX] });
                f.parts.push(Part { term: Term::AshikhminFresnel, uses: [n, r0, usize::MAX] });
            }
            ModelChoice::AshikhminShirleyAnisotropic => {
                f.part(Term::Lambert, &[]);
                let along = |name| Nonlinear { name, knots: 12, ..exponent };
                f.own(Term::AshikhminAnisotropic, &[along("exponent_u"), along("exponent_v"), r0]);
            }
            ModelChoice::AshikhminShirleySimplified | ModelChoice::Auto => {
                f.over_lambert(Term::Ashikhmin, &[exponent]);
            }
            ModelChoice::LambertAshikhminShirley => f.over_lambert(Term::AshikhminFresnel, &[exponent, r0]),
            ModelChoice::Phong => f.over_lambert(Term::Phong, &[exponent]),
            ModelChoice::BlinnPhong => f.over_lambert(Term::BlinnPhong, &[exponent]),
            ModelChoice::Ward => f.over_lambert(Term::Ward, &[alpha]),
            ModelChoice::WardDuer => f.over_lambert(Term::WardDuer, &[alpha]),
            ModelChoice::CookTorrance(n) => f.lobes(Term::CookTorrance, n, &[alpha, r0]),
            ModelChoice::Ggx(n) => f.lobes(Term::Ggx, n, &[alpha, r0]),
            ModelChoice::Lafortune(n) => {
                let lean = Nonlinear { name: "lean_deg", bounds: LEAN_DEG, scale: Scale::Linear, knots: 13 };
                f.lobes(Term::Lafortune, n, &[Nonlinear { knots: 12, ..exponent }, lean]);
            }
        }
        match options.coat {
            CoatChoice::None => {}
            CoatChoice::Index(n) => f.coated = Coated::Known(n),
            CoatChoice::Fitted => {
                // of node values the sum of squares has minima at two indices half a unit apart
                f.coated = Coated::Parameter(f.parameter(Nonlinear::log("coat_index", INDEX, 17)));
            }
        }
        f
    }

    fn parameter(&mut self, p: Nonlinear) -> usize {
        self.parameters.push(p);
        self.parameters.len() - 1
    }

    fn part(&mut self, term: Term, uses: &[usize]) {
        let mut all = [usize::MAX; 3];
        for (a, u) in all.iter_mut().zip(uses) {
            *a = *u;
        }
        self.parts.push(Part { term, uses: all });
    }

    /// A term with parameters of its own.
    fn own(&mut self, term: Term, parameters: &[Nonlinear]) {
        let places: Vec<usize> = parameters.iter().map(|p| self.parameter(*p)).collect();
        self.part(term, &places);
    }

    fn over_lambert(&mut self, term: Term, parameters: &[Nonlinear]) {
        self.part(Term::Lambert, &[]);
        self.own(term, parameters);
    }

    fn lobes(&mut self, term: Term, n: u8, parameters: &[Nonlinear]) {
        self.part(Term::Lambert, &[]);
        let n = n.clamp(1, MAX_LOBES);
        for lobe in 0..n {
            let named: Vec<Nonlinear> = parameters
                .iter()
                .map(|p| Nonlinear { name: names::of_lobe(p.name, lobe, n), ..*p })
                .collect();
            self.own(term, &named);
        }
    }

    /// Values of the nonlinear parameters at a place of the walk.
    pub(crate) fn values(&self, q: &[f64]) -> Vec<f64> {
        self.parameters.iter().zip(q).map(|(p, &q)| p.value(q)).collect()
    }

    /// The parameters of a part, out of all values.
    pub(crate) fn of_part(part: &Part, values: &[f64]) -> [f64; 3] {
        part.uses.map(|u| values.get(u).copied().unwrap_or(0.0))
    }

    /// The sharpest lobe at given values ([`Term::sharpness`]); a coat narrows no lobe.
    pub(crate) fn sharpness(&self, values: &[f64]) -> f64 {
        self.parts.iter().map(|p| p.term.sharpness(&Self::of_part(p, values))).fold(0.0, f64::max)
    }

    /// Index of the coat at given values.
    pub(crate) fn index(&self, values: &[f64]) -> Option<f64> {
        match self.coated {
            Coated::No => None,
            Coated::Known(n) => Some(n),
            Coated::Parameter(p) => values.get(p).copied(),
        }
    }

    /// Names of the linear coefficients: those of a part, channel by channel.
    pub(crate) fn colour_names(&self, part: usize) -> [&'static str; 3] {
        names::colours(part, self.parts.len(), self.choice == ModelChoice::Lambert || self.parts.len() == 1)
    }

    /// The model of these values and colours (one per part).
    pub(crate) fn model(&self, values: &[f64], colours: &[[f64; 3]]) -> ModelFile {
        let colour = |k: usize| colours.get(k).copied().unwrap_or([0.0; 3]);
        let x = |k: usize| self.parts.get(k).map_or([0.0; 3], |p| Self::of_part(p, values));
        let (diffuse, specular, lobe) = (colour(0), colour(1), x(1));
        let lobes = 1..self.parts.len();
        let model = match self.choice {
            ModelChoice::Lambert => Model::Lambert(Lambert { diffuse }),
            ModelChoice::OrenNayar => Model::OrenNayar(OrenNayar { diffuse, sigma_deg: x(0)[0] }),
            ModelChoice::Phong => Model::Phong(Phong { diffuse, specular, exponent: lobe[0] }),
            ModelChoice::BlinnPhong => Model::BlinnPhong(BlinnPhong { diffuse, specular, exponent: lobe[0] }),
            ModelChoice::AshikhminShirleySimplified | ModelChoice::Auto => {
                Model::AshikhminShirleySimplified(AshikhminShirleySimplified {
                    diffuse,
                    specular,
                    exponent: lobe[0],
                })
            }
            ModelChoice::LambertAshikhminShirley => Model::LambertAshikhminShirley(LambertAshikhminShirley {
                diffuse,
                specular,
                exponent: lobe[0],
                r0: Some(lobe[1]),
            }),
            ModelChoice::AshikhminShirley => Model::AshikhminShirley(AshikhminShirley {
                diffuse,
                specular,
                exponent: lobe[0],
                r0: lobe[1],
            }),
            ModelChoice::AshikhminShirleyAnisotropic => {
                Model::AshikhminShirleyAnisotropic(AshikhminShirleyAnisotropic {
                    diffuse,
                    specular,
                    exponent_u: lobe[0],
                    exponent_v: lobe[1],
                    r0: lobe[2],
                })
            }
            ModelChoice::Ward => Model::Ward(Ward { diffuse, specular, alpha: lobe[0] }),
            ModelChoice::WardDuer => Model::WardDuer(WardDuer { diffuse, specular, alpha: lobe[0] }),
            ModelChoice::CookTorrance(_) => Model::CookTorrance(CookTorrance {
                diffuse,
                lobes: lobes
                    .map(|k| CookTorranceLobe { specular: colour(k), alpha: x(k)[0], r0: x(k)[1] })
                    .collect(),
            }),
            ModelChoice::Ggx(_) => Model::Ggx(Ggx {
                diffuse,
                lobes: lobes.map(|k| GgxLobe { specular: colour(k), alpha: x(k)[0], r0: x(k)[1] }).collect(),
            }),
            ModelChoice::Lafortune(_) => Model::Lafortune(Lafortune {
                diffuse,
                lobes: lobes
                    .map(|k| {
                        let (cxy, cz) = lafortune_weights(x(k)[1]);
                        LafortuneLobe { specular: colour(k), cxy, cz, exponent: x(k)[0] }
                    })
                    .collect(),
            }),
        };
        ModelFile { model, coat: self.index(values).map(|index| Coat { index }), fit: None }
    }
}
