//! A `<bsdf>` for Mitsuba 3: `diffuse` and `roughconductor` in nested `blendbsdf`, or `plastic` for a coat over a diffuser.
//!
//! ```text
//! f = Σ_k w_k · b_k,  Σ w = 1                                   blendbsdf, so b = layer/w must not exceed 1
//! b = colour · F(h·v; η, k) D(h) G1(l) G1(v)/(4 (n·l)(n·v))     roughconductor, beckmann or ggx
//! ```
//!
//! Mitsuba has no Schlick term for coloured lobes: (η, k) is the conductor of the same reflectance at normal incidence that comes closest to
//! Schlick's curve; a lobe without Fresnel term takes the material `none` (F = 1). Its G1 is Smith's (Beckmann's by a rational function).

use gonio_optics::{Vec3, fresnel::schlick};

use super::{
    Draft, NotMapped, Renderer,
    layers::{Distribution, Layers, Lobe, largest},
    number, numbers, smith,
};
use crate::{Brdf, ModelFile, Rgb};

/// One BSDF of the blend, for weight 1.
#[derive(Clone, Copy)]
enum Part {
    Diffuse(Rgb),
    Conductor {
        colour: Rgb,
        metal: Option<(f64, f64)>,
        alpha: f64,
        distribution: Distribution,
    },
    /// `plastic` without its gloss: reflectance of the file, index.
    Coated(Rgb, f64),
}

/// Parts with their weights, which add up to 1.
#[derive(Clone)]
struct Blend(Vec<(f64, Part)>);

pub(super) fn draft(file: &ModelFile) -> Result<Draft, NotMapped> {
    let refuse = |why: String, instead: &str| NotMapped {
        model: file.model.name().to_owned(),
        renderer: Renderer::Mitsuba.title(),
        why,
        instead: instead.to_owned(),
    };
    let layers = Layers::of(file, Renderer::Mitsuba)?;
    let mut notes = Vec::new();
    let blend = match layers.coat {
        Some(index) if layers.lobes.is_empty() => {
            // plastic divides by 1 − the reflectance met from inside; our coat has no inter-reflection
            let reflectance = layers.diffuse.map(|d| d * (1.0 - inner_reflectance(index)));
            if largest(reflectance) > 1.0 {
                return Err(refuse(
                    format!("its diffuse is above 1: {}", largest(layers.diffuse)),
                    "lower it",
                ));
            }
            Blend(vec![(1.0, Part::Coated(reflectance, index))])
        }
        Some(_) => {
            return Err(refuse(
                "Mitsuba has no coat over a rough lobe".to_owned(),
                "export to materialx or gltf, or leave \"coat\" out and export the base",
            ));
        }
        None => {
            let lobes = within_one(&layers, &mut notes).ok_or_else(|| {
                let total =
                    largest(layers.diffuse) + layers.lobes.iter().map(|l| largest(l.colour)).sum::<f64>();
                refuse(
                    format!("its colours add up to {total:.3} and reflectances in Mitsuba end at 1"),
                    "fit a model with a Fresnel term (cook-torrance, ggx), or lower specular",
                )
            })?;
            Blend::of(layers.diffuse, &lobes)
        }
    };
    let rendered = Box::new(blend.clone());
    Ok(Draft {
        rendered,
        notes,
        write: Box::new(move |name, remark| {
            // a comment must not hold two hyphens
            let remark = remark.replace("--", "- -");
            format!("<?xml version=\"1.0\" encoding=\"utf-8\"?>\n<!-- {remark} -->\n{}", blend.xml(name))
        }),
    })
}

/// The lobes, dimmed at grazing angles where all colours together exceed 1: a lobe with Schlick's term keeps its value at normal incidence when
/// colour falls by q and r0 rises by 1/q. `None` where that is not enough.
fn within_one(layers: &Layers, notes: &mut Vec<String>) -> Option<Vec<Lobe>> {
    let sum = |fresnel: bool| -> f64 {
        layers.lobes.iter().filter(|l| l.r0.is_some() == fresnel).map(|l| largest(l.colour)).sum()
    };
    let room = 1.0 - largest(layers.diffuse) - sum(false);
    let flexible = sum(true);
    if room < -1e-12 || (room <= 0.0 && flexible > 0.0) {
        return None;
    }
    if flexible <= room {
        return Some(layers.lobes.clone());
    }
    let q = room / flexible;
    let lobes = layers
        .lobes
        .iter()
        .map(|l| match l.r0 {
            Some(r0) if r0 <= q => {
                Some(Lobe { colour: l.colour.map(|c| c * q), r0: Some((r0 / q).min(1.0)), ..*l })
            }
            Some(_) => None,
            None => Some(*l),
        })
        .collect::<Option<Vec<Lobe>>>()?;
    notes.push(format!(
        "colours add up to more than 1, so the lobes are dimmed by {q:.3} at grazing angles and kept at normal incidence"
    ));
    Some(lobes)
}

impl Blend {
    fn of(diffuse: Rgb, lobes: &[Lobe]) -> Self {
        let mut parts = Vec::new();
        if largest(diffuse) > 0.0 || lobes.is_empty() {
            parts.push((largest(diffuse), Part::Diffuse(diffuse)));
        }
        for l in lobes {
            let metal = l.r0.filter(|r| *r < 0.9999).map(metal_like_schlick);
            let part =
                Part::Conductor { colour: l.colour, metal, alpha: l.alpha, distribution: l.distribution };
            parts.push((largest(l.colour), part));
        }
        let total: f64 = parts.iter().map(|p| p.0).sum();
        let count = parts.len() as f64;
        for (weight, part) in &mut parts {
            *weight = if total > 0.0 { *weight / total } else { 1.0 / count };
            let share = *weight;
            match part {
                Part::Diffuse(c) | Part::Conductor { colour: c, .. } => *c = c.map(|x| (x / share).min(1.0)),
                Part::Coated(..) => {}
            }
        }
        Self(parts)
    }

    fn xml(&self, name: &str) -> String {
        let mut out = String::new();
        nest(&self.0, 0, Some(name), &mut out);
        out
    }
}

/// `blendbsdf` of the first part and the rest; its weight is the share of the second.
fn nest(parts: &[(f64, Part)], depth: usize, name: Option<&str>, out: &mut String) {
    let pad = "    ".repeat(depth);
    let head = name.map_or_else(String::new, |n| format!(" version=\"3.0.0\" id=\"{n}\""));
    let Some(((first, part), rest)) = parts.split_first() else { return };
    if rest.is_empty() {
        *out += &part.xml(&pad, &head);
        return;
    }
    let others: f64 = rest.iter().map(|p| p.0).sum();
    *out += &format!(
        "{pad}<bsdf type=\"blendbsdf\"{head}>\n{pad}    <float name=\"weight\" value=\"{}\"/>\n",
        number(others / (first + others))
    );
    *out += &part.xml(&format!("{pad}    "), "");
    nest(rest, depth + 1, None, out);
    *out += &format!("{pad}</bsdf>\n");
}

impl Part {
    fn xml(&self, pad: &str, head: &str) -> String {
        let rgb = |key: &str, c: Rgb| format!("{pad}    <rgb name=\"{key}\" value=\"{}\"/>\n", numbers(c));
        let float = |key: &str, x: f64| format!("{pad}    <float name=\"{key}\" value=\"{}\"/>\n", number(x));
        let (kind, inside) = match *self {
            Self::Diffuse(c) => ("diffuse", rgb("reflectance", c)),
            Self::Coated(c, index) => (
                "plastic",
                rgb("diffuse_reflectance", c)
                    + &float("int_ior", index)
                    + &float("ext_ior", 1.0)
                    + &format!("{pad}    <boolean name=\"nonlinear\" value=\"false\"/>\n"),
            ),
            Self::Conductor { colour, metal, alpha, distribution } => {
                let named = match distribution {
                    Distribution::Beckmann => "beckmann",
                    Distribution::Ggx => "ggx",
                };
                let text = format!("{pad}    <string name=\"distribution\" value=\"{named}\"/>\n");
                let fresnel = match metal {
                    Some((eta, k)) => float("eta", eta) + &float("k", k),
                    None => format!("{pad}    <string name=\"material\" value=\"none\"/>\n"),
                };
                (
                    "roughconductor",
                    text + &float("alpha", alpha) + &fresnel + &rgb("specular_reflectance", colour),
                )
            }
        };
        format!("{pad}<bsdf type=\"{kind}\"{head}>\n{inside}{pad}</bsdf>\n")
    }

    fn eval(&self, light: Vec3, view: Vec3) -> Rgb {
        match *self {
            Self::Diffuse(c) => c.map(|x| x * std::f64::consts::FRAC_1_PI),
            Self::Coated(c, index) => {
                let t = |cos: f64| 1.0 - gonio_optics::fresnel::dielectric(cos, index);
                let k = t(light.z) * t(view.z) / (index * index * (1.0 - inner_reflectance(index)));
                c.map(|x| x * k * std::f64::consts::FRAC_1_PI)
            }
            Self::Conductor { colour, metal, alpha, distribution } => {
                let (c, hv) = smith::half(light, view);
                if c <= 0.0 || light.z <= 0.0 || view.z <= 0.0 {
                    return [0.0; 3];
                }
                let d = smith::density(distribution, alpha, c);
                let g = smith::one_way(distribution, alpha, light.z)
                    * smith::one_way(distribution, alpha, view.z);
                let f = metal.map_or(1.0, |(eta, k)| conductor(hv, eta, k));
                // Mitsuba drops densities that single precision cannot weigh
                let value = if d * c > 1e-20 { f * d * g / (4.0 * light.z * view.z) } else { 0.0 };
                colour.map(|x| x * value)
            }
        }
    }
}

impl Brdf for Blend {
    fn eval(&self, light: Vec3, view: Vec3) -> Rgb {
        let mut f = [0.0; 3];
        if light.z < 0.0 || view.z < 0.0 {
            return f;
        }
        for (weight, part) in &self.0 {
            for (out, x) in f.iter_mut().zip(part.eval(light, view)) {
                *out += weight * x;
            }
        }
        f
    }
}

/// Unpolarised reflectance of a conductor with index η + ik.
fn conductor(cos: f64, eta: f64, k: f64) -> f64 {
    let c2 = cos * cos;
    let s2 = 1.0 - c2;
    let t0 = eta * eta - k * k - s2;
    let sum = (t0 * t0 + 4.0 * k * k * eta * eta).sqrt();
    let a = (0.5 * (sum + t0)).max(0.0).sqrt();
    let (t1, t2) = (sum + c2, 2.0 * cos * a);
    let rs = (t1 - t2) / (t1 + t2);
    let (t3, t4) = (sum * c2 + s2 * s2, t2 * s2);
    let rp = rs * (t3 - t4) / (t3 + t4);
    0.5 * (rs + rp)
}

/// The conductor of normal reflectance `r0` nearest to Schlick's curve: all of them are a family from (1 − r)/(1 + r) to (1 + √r)/(1 − √r) in η.
fn metal_like_schlick(r0: f64) -> (f64, f64) {
    const STEPS: i32 = 200;
    let r = r0.max(1e-6);
    let (low, high) = ((1.0 - r) / (1.0 + r), (1.0 + r.sqrt()) / (1.0 - r.sqrt()));
    let candidates = (0..=STEPS).map(|i| {
        let eta = low + (high - low) * f64::from(i) / f64::from(STEPS);
        let k2 = (r * (eta + 1.0) * (eta + 1.0) - (eta - 1.0) * (eta - 1.0)) / (1.0 - r);
        (eta, k2.max(0.0).sqrt())
    });
    let off = |(eta, k): (f64, f64)| -> f64 {
        // up to 80° at the facet
        (0..40)
            .map(|j| 0.17 + 0.83 * f64::from(j) / 39.0)
            .map(|cos| (conductor(cos, eta, k) - schlick(cos, r0)).powi(2))
            .sum()
    };
    candidates.min_by(|a, b| off(*a).total_cmp(&off(*b))).unwrap_or((high, 0.0))
}

/// Reflectance for diffuse light from inside, by the polynomial that `plastic` uses.
fn inner_reflectance(index: f64) -> f64 {
    let e = 1.0 / index;
    -1.4399 * e * e + 0.7099 * e + 0.6681 + 0.0636 / e
}
