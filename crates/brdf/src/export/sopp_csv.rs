//! A CSV row for the Ashikhmin shader of Sopp's thesis, with his conversion.
//!
//! The simplified shader (4.23, 4.24) has `f = (1 − Rs) cd'/π + Rs cs' S(n)`: a gloss slider Rs and two colour pickers. From a fit of (4.28):
//! `Rs = max cs`, `cs' = cs/Rs`, `cd' = cd/(1 − Rs)`, which needs cs < 1 and loses nothing. The full shader (4.17, 4.18) takes the parameters of
//! `ashikhmin-shirley` as they are; the column `fresnel` says which shader is meant, as in table A.8.

use super::{Draft, NotMapped, Renderer, number, numbers};
use crate::{Model, ModelFile, Rgb, models::AshikhminShirley, models::AshikhminShirleySimplified};

/// A row.
#[derive(Clone, Copy)]
struct Row {
    fresnel: bool,
    exponent: f64,
    diffuse: Rgb,
    specular: Rgb,
    rs: f64,
}

pub(super) fn draft(file: &ModelFile) -> Result<Draft, NotMapped> {
    let refuse = |why: &str, instead: &str| NotMapped {
        model: file.model.name().to_owned(),
        renderer: Renderer::Sopp.title(),
        why: why.to_owned(),
        instead: instead.to_owned(),
    };
    if file.coat.is_some() {
        return Err(refuse(
            "the shader adds the reflection of a clear coat by itself and does not refract",
            "leave \"coat\" out and export the base",
        ));
    }
    let simple = |diffuse: Rgb, specular: Rgb, exponent: f64| {
        let rs = specular.into_iter().fold(0.0, f64::max);
        if rs >= 1.0 {
            return Err(refuse(
                &format!("its Rs is the largest of specular, {rs}, and has to be below 1"),
                "fit with fewer cells near the mirror direction or export to mitsuba",
            ));
        }
        Ok(Row {
            fresnel: false,
            exponent,
            diffuse: diffuse.map(|d| d / (1.0 - rs)),
            specular: specular.map(|s| if rs > 0.0 { s / rs } else { 0.0 }),
            rs,
        })
    };
    let row = match &file.model {
        Model::Lambert(m) => simple(m.diffuse, [0.0; 3], 0.0)?,
        Model::AshikhminShirleySimplified(m) => simple(m.diffuse, m.specular, m.exponent)?,
        Model::LambertAshikhminShirley(m) if m.r0.is_none() => simple(m.diffuse, m.specular, m.exponent)?,
        Model::AshikhminShirley(m) => {
            Row { fresnel: true, exponent: m.exponent, diffuse: m.diffuse, specular: m.specular, rs: m.r0 }
        }
        _ => {
            return Err(refuse(
                "the shader is Ashikhmin's alone: Lambert without Fresnel term, or its own diffuse term with it",
                "fit ashikhmin-shirley-simplified or ashikhmin-shirley",
            ));
        }
    };
    Ok(Draft {
        rendered: row.rendered(),
        notes: Vec::new(),
        write: Box::new(move |name, remark| {
            format!(
                "# {remark}\nmaterial,fresnel,n,CdR,CdG,CdB,CsR,CsG,CsB,Rs\n{name},{},{},{},{},{}\n",
                u8::from(row.fresnel),
                number(row.exponent),
                numbers(row.diffuse).replace(' ', ""),
                numbers(row.specular).replace(' ', ""),
                number(row.rs)
            )
        }),
    })
}

impl Row {
    /// What the shader computes from the numbers of the row.
    fn rendered(&self) -> Box<dyn crate::Brdf> {
        let (exponent, rs) = (self.exponent, self.rs);
        if self.fresnel {
            let (diffuse, specular) = (self.diffuse, self.specular);
            return Box::new(AshikhminShirley { diffuse, specular, exponent, r0: rs });
        }
        Box::new(AshikhminShirleySimplified {
            diffuse: self.diffuse.map(|d| d * (1.0 - rs)),
            specular: self.specular.map(|s| s * rs),
            exponent,
        })
    }
}
