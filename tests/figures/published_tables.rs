//! Published parameters of measured materials (tables of the benchmark `bsdfbenchmark/bbm`), read as our models. Needs `GONIO_DATA`.
//!
//! A line is `NAME = Aggregate(Lambertian(albedo = […]), MODEL(key = value, …))`. Conventions (Ngan et al. 2005, as that benchmark states them):
//!
//! | model | ours |
//! |---|---|
//! | `NganAshikhminShirley` | albedo, sharpness, fresnelReflectance → specular, exponent, r0 |
//! | `NganWard`, `NganWardDuer` | albedo, roughness → specular, alpha |
//! | `NganCookTorrance` | D with 1/π, the whole over π: specular = 4 albedo/π; roughness, eta → alpha, r0 |

use std::collections::BTreeMap;

use gonio_brdf::Model;
use gonio_brdf::models::{CookTorrance, CookTorranceLobe, LambertAshikhminShirley, Ward};

/// The tables compared.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Table {
    AshikhminShirley,
    CookTorrance,
    Ward,
}

impl Table {
    pub const fn file(self) -> &'static str {
        match self {
            Self::AshikhminShirley => "published-fits/ngan_ashikhminshirley.fit",
            Self::CookTorrance => "published-fits/ngan_cooktorrance.fit",
            Self::Ward => "published-fits/ngan_ward.fit",
        }
    }
}

/// Numbers after `key = ` in a part of a line: one, or three in brackets.
fn numbers(text: &str, key: &str) -> Option<Vec<f64>> {
    let after = text.split(&format!("{key} = ")).nth(1)?;
    let list = match after.strip_prefix('[') {
        Some(rest) => rest.split(']').next()?,
        None => after.split([',', ')']).next()?,
    };
    list.split(',').map(|x| x.trim().parse().ok()).collect()
}

/// The materials of a table as models; `normalisation` is what the albedo of a Cook–Torrance lobe is multiplied by.
///
/// # Panics
/// Where a line is not of that form: a table that is read in part must not pass.
pub fn models(text: &str, table: Table, normalisation: f64) -> BTreeMap<String, Model> {
    text.lines()
        .filter(|l| !l.starts_with('#') && !l.trim().is_empty())
        .map(|line| {
            model(line, table, normalisation).unwrap_or_else(|| panic!("{table:?} cannot be read: {line}"))
        })
        .collect()
}

fn model(line: &str, table: Table, normalisation: f64) -> Option<(String, Model)> {
    let (name, rest) = line.split_once(" = Aggregate(Lambertian(")?;
    let (lambert, lobe) = rest.split_once("), ")?;
    let diffuse: [f64; 3] = numbers(lambert, "albedo")?.try_into().ok()?;
    let specular: [f64; 3] = numbers(lobe, "albedo")?.try_into().ok()?;
    let one = |key: &str| numbers(lobe, key).and_then(|n| n.first().copied());
    let model = match table {
        Table::AshikhminShirley => Model::LambertAshikhminShirley(LambertAshikhminShirley {
            diffuse,
            specular,
            exponent: one("sharpness")?,
            r0: Some(one("fresnelReflectance")?),
        }),
        Table::CookTorrance => Model::CookTorrance(CookTorrance {
            diffuse,
            lobes: vec![CookTorranceLobe {
                specular: specular.map(|s| s * normalisation),
                alpha: one("roughness")?,
                r0: one("eta")?,
            }],
        }),
        Table::Ward => Model::Ward(Ward { diffuse, specular, alpha: one("roughness")? }),
    };
    Some((name.trim().to_owned(), model))
}

/// The nonlinear parameters of a model by the names of its fit.
pub fn nonlinear(model: &Model) -> Vec<(&'static str, f64)> {
    match model {
        Model::LambertAshikhminShirley(m) => vec![("exponent", m.exponent), ("r0", m.r0.unwrap_or(1.0))],
        Model::CookTorrance(m) => m.lobes.iter().flat_map(|l| [("alpha", l.alpha), ("r0", l.r0)]).collect(),
        Model::Ward(m) => vec![("alpha", m.alpha)],
        _ => Vec::new(),
    }
}
