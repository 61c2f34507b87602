//! The analytic part and χ of several paints, blended linearly.

use std::sync::Arc;

use gonio_brdf::{Coat, models::CookTorranceLobe};
use gonio_optics::Angle;
use gonio_optics::colour::lab_from_rgb;

use crate::car_paint::{CarPaint, CarPaintParts, ColourTable, FlakePlace};
use crate::statistics::brdf_from_lab;

/// Coefficients of all paints side by side, and χ in Lab.
#[derive(Clone, Debug)]
pub(super) struct Analytic {
    /// Per paint: index of the coat, diffuse r g b, then for each lobe specular r g b, alpha, r0; then the side of a texel.
    pub coefficients: Vec<Vec<f64>>,
    coated: bool,
    chi: Option<Chi>,
}

/// χ of each paint on the angles of the first that has one.
#[derive(Clone, Debug)]
struct Chi {
    half: Vec<Angle>,
    incidence: Vec<Angle>,
    /// Per paint, L*, a*, b* of each node.
    lab: Vec<Vec<[f32; 3]>>,
}

impl Analytic {
    /// Of paints whose coats agree.
    pub fn of(paints: &[Arc<CarPaint>]) -> Self {
        let lobes = paints.iter().map(|p| p.parts().lobes.len()).max().unwrap_or(0);
        let sorted: Vec<Vec<CookTorranceLobe>> = paints
            .iter()
            .map(|p| {
                // widest first: lobes that do the same job meet
                let mut lobes = p.parts().lobes.clone();
                lobes.sort_by(|a, b| b.alpha.total_cmp(&a.alpha));
                lobes
            })
            .collect();
        let coefficients = paints
            .iter()
            .enumerate()
            .map(|(k, p)| {
                let parts = p.parts();
                let mut list = vec![parts.coat.map_or(0.0, |c| c.index)];
                list.extend(parts.diffuse);
                for place in 0..lobes {
                    match sorted[k].get(place) {
                        Some(lobe) => {
                            list.extend(lobe.specular);
                            list.extend([lobe.alpha, lobe.r0]);
                        }
                        // a lobe that only others have is there with no strength, in their shape
                        None => {
                            let shape = sorted.iter().find_map(|l| l.get(place));
                            list.extend([0.0; 3]);
                            list.extend(shape.map_or([1.0, 0.0], |l| [l.alpha, l.r0]));
                        }
                    }
                }
                list.push(parts.flakes.as_ref().map_or(f64::NAN, |f| f.texel_mm()));
                list
            })
            .collect::<Vec<_>>();
        let mut made = Self {
            coefficients,
            coated: paints.first().is_some_and(|p| p.parts().coat.is_some()),
            chi: Chi::of(paints),
        };
        made.fill_texels();
        made
    }

    /// A paint without flakes takes the texels of the first that has some.
    fn fill_texels(&mut self) {
        let last = |list: &Vec<f64>| list.last().copied().unwrap_or(f64::NAN);
        let side = self.coefficients.iter().map(last).find(|s| !s.is_nan()).unwrap_or(1.0);
        for list in &mut self.coefficients {
            if let Some(s) = list.last_mut()
                && s.is_nan()
            {
                *s = side;
            }
        }
    }

    /// Nodes of χ, 0 without one.
    pub fn nodes(&self) -> usize {
        self.chi.as_ref().map_or(0, |c| c.lab[0].len())
    }

    /// Blends coefficients and χ (factors per channel, not below 0) into lists of the right length. Weights that do not sum to 1 make a paint darker or brighter;
    /// what is no strength (index, widths, r0, the side of a texel) lies between the paints all the same.
    pub fn blend(&self, weights: &[f64], coefficients: &mut [f64], chi: &mut [[f32; 3]]) {
        let total: f64 = weights.iter().sum();
        let whole = if total.abs() > 1e-9 { total.recip() } else { 1.0 };
        let texel = coefficients.len().saturating_sub(1);
        for (k, out) in coefficients.iter_mut().enumerate() {
            let sum: f64 = self.coefficients.iter().zip(weights).map(|(list, w)| w * list[k]).sum();
            let strength = (1..4).contains(&k) || (k >= 4 && k < texel && (k - 4) % 5 < 3);
            *out = if strength { sum } else { whole * sum };
        }
        let Some(table) = &self.chi else { return };
        for (k, out) in chi.iter_mut().enumerate() {
            let mut lab = [0.0; 3];
            for (values, w) in table.lab.iter().zip(weights) {
                for c in 0..3 {
                    lab[c] += w * f64::from(values[k][c]);
                }
            }
            *out = brdf_from_lab(lab).map(|f| (std::f64::consts::PI * f).max(0.0) as f32);
        }
    }

    /// A paint of blended numbers, its flakes still missing, and what had to be held within bounds.
    pub fn parts(
        &self,
        coefficients: &[f64],
        chi: &[[f32; 3]],
        held: &mut Vec<String>,
    ) -> Result<CarPaintParts, super::MixError> {
        let mut hold = |what: String, value: f64, low: f64, high: f64| {
            let kept = value.clamp(low, high);
            if (kept - value).abs() > 1e-12 {
                held.push(format!("{what} would be {value:.4}, held at {kept}"));
            }
            kept
        };
        let coat = self
            .coated
            .then(|| Coat { index: hold("index of the coat".to_owned(), coefficients[0], 1.000_001, 4.0) });
        let most = f64::MAX;
        let diffuse = [1, 2, 3].map(|k: usize| hold("diffuse".to_owned(), coefficients[k], 0.0, most));
        let numbers = &coefficients[4..coefficients.len() - 1];
        let lobes = numbers
            .chunks_exact(5)
            .enumerate()
            .map(|(k, n)| CookTorranceLobe {
                specular: [0, 1, 2].map(|c: usize| hold(format!("lobes[{k}].specular"), n[c], 0.0, most)),
                alpha: hold(format!("lobes[{k}].alpha"), n[3], 1e-4, 10.0),
                r0: hold(format!("lobes[{k}].r0"), n[4], 0.0, 1.0),
            })
            .collect();
        let colour = match &self.chi {
            None => None,
            Some(table) => Some(ColourTable::new(table.half.clone(), table.incidence.clone(), chi.to_vec())?),
        };
        Ok(CarPaintParts { coat, diffuse, lobes, colour, ..CarPaintParts::default() })
    }
}

impl Chi {
    fn of(paints: &[Arc<CarPaint>]) -> Option<Self> {
        let first = paints.iter().find_map(|p| p.parts().colour.as_ref())?;
        let (half, incidence) = (first.half().angles().to_vec(), first.incidence().angles().to_vec());
        let lab = paints
            .iter()
            .map(|p| {
                let mut list = Vec::with_capacity(half.len() * incidence.len());
                for h in &half {
                    for i in &incidence {
                        let place = FlakePlace { sin_half: h.sin(), sin_incidence: i.sin() };
                        // a paint without χ has 1 everywhere
                        let factors = p.parts().colour.as_ref().map_or([1.0; 3], |c| c.at(place));
                        let lab = lab_from_rgb(factors);
                        list.push([lab.l, lab.a, lab.b].map(|v| v as f32));
                    }
                }
                list
            })
            .collect();
        Some(Self { half, incidence, lab })
    }
}
