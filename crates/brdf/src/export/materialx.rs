//! A MaterialX document with one `standard_surface` (1.0.1): a diffuser under one GGX lobe, a smooth coat over both.
//!
//! What a renderer computes, after the node graph of the MaterialX library (`bxdf/standard_surface.mtlx`, `pbrlib`):
//!
//! ```text
//! f = (1 − E_coat(n·v)) [ (1 − E(n·v)) base_color/π + specular_color · F D G c/(4 (n·l)(n·v)) ]
//! F exact for specular_IOR, G with correlated heights, D of α = specular_roughness²,
//! E directional albedo of the lobe, c = 1 + F (1 − E₁)/E₁ its compensation for multiple scattering (E₁: E with F = 1)
//! ```
//!
//! A lobe without Fresnel term follows Sopp's rule: F at normal incidence is its largest colour, the colour what remains. base_color is raised by
//! what the lobe takes at 45°.

use gonio_optics::{Vec3, fresnel::dielectric};

use super::{
    Draft, NotMapped, Renderer,
    layers::{Distribution, Layers, Lobe, largest, nearest_ggx},
    number, numbers,
    smith::{self, Albedo},
};
use crate::{Brdf, ModelFile, Rgb};

/// The inputs that are set.
struct Surface {
    base: Rgb,
    lobe: Option<Specular>,
    coat: Option<f64>,
}

struct Specular {
    tint: Rgb,
    index: f64,
    /// Whether the index had to be held.
    held: bool,
    alpha: f64,
    albedo: Albedo,
    /// Albedo for F = 1.
    single: Albedo,
}

pub(super) fn draft(file: &ModelFile) -> Result<Draft, NotMapped> {
    let layers = Layers::of(file, Renderer::MaterialX)?.seen_through_coat();
    if layers.lobes.len() > 1 {
        return Err(NotMapped {
            model: file.model.name().to_owned(),
            renderer: Renderer::MaterialX.title(),
            why: format!("it has {} lobes and the material one", layers.lobes.len()),
            instead: "fit one lobe, or export to mitsuba".to_owned(),
        });
    }
    let mut notes = Vec::new();
    let surface = match layers.lobes.first() {
        None => Surface::of(&layers, None),
        Some(lobe) => {
            let (surface, note) = nearest_ggx(file, lobe, |l| Surface::of(&layers, Some(l)));
            notes.extend(note);
            surface
        }
    };
    if let Some(s) = surface.lobe.as_ref().filter(|s| s.held) {
        notes.push(format!("reflectance at normal incidence held to {MAX_R0} (index {:.1})", s.index));
    }
    if largest(surface.base) >= 1.0 {
        notes.push("base_color held to 1".to_owned());
    }
    let inputs = surface.inputs();
    Ok(Draft {
        rendered: Box::new(surface),
        notes,
        write: Box::new(move |name, remark| {
            let remark = remark.replace("--", "- -");
            format!(
                "<?xml version=\"1.0\"?>\n<materialx version=\"1.38\" colorspace=\"lin_rec709\">\n  <!-- {remark} -->\n  \
                 <standard_surface name=\"SR_{name}\" type=\"surfaceshader\" version=\"1.0.1\">\n{inputs}  </standard_surface>\n  \
                 <surfacematerial name=\"{name}\" type=\"material\">\n    \
                 <input name=\"surfaceshader\" type=\"surfaceshader\" nodename=\"SR_{name}\" />\n  </surfacematerial>\n</materialx>\n"
            )
        }),
    })
}

/// An index beyond which (about 38) nothing but a mirror is meant.
const MAX_R0: f64 = 0.9;

impl Surface {
    /// The inputs for a diffuser, a lobe and a coat.
    fn of(layers: &Layers, lobe: Option<&Lobe>) -> Self {
        let lobe = lobe.map(|l| {
            let top = largest(l.colour);
            // tints end at 1: brighter lobes reflect more at normal incidence and no more at grazing angles
            let (tint, r0) = match l.r0 {
                Some(r0) => (l.colour.map(|c| c / top.max(1.0)), r0 * top.max(1.0)),
                None => (l.colour.map(|c| c / top), top),
            };
            let (held, r0) = (r0 > MAX_R0, r0.min(MAX_R0));
            let alpha = l.alpha.min(1.0);
            Specular {
                tint,
                index: (1.0 + r0.sqrt()) / (1.0 - r0.sqrt()),
                held,
                alpha,
                albedo: Albedo::new(alpha, r0),
                single: Albedo::new(alpha, 1.0),
            }
        });
        let left = lobe.as_ref().map_or(1.0, |s| s.throughput(std::f64::consts::FRAC_1_SQRT_2));
        let base = layers.diffuse.map(|d| (d / left.max(1e-6)).min(1.0));
        Self { base, lobe, coat: layers.coat }
    }

    fn inputs(&self) -> String {
        let float = |key: &str, x: f64| {
            format!("    <input name=\"{key}\" type=\"float\" value=\"{}\" />\n", number(x))
        };
        let colour = |key: &str, c: Rgb| {
            format!("    <input name=\"{key}\" type=\"color3\" value=\"{}\" />\n", numbers(c))
        };
        let mut out = float("base", 1.0) + &colour("base_color", self.base);
        match &self.lobe {
            Some(s) => {
                out += &float("specular", 1.0);
                out += &colour("specular_color", s.tint);
                out += &float("specular_roughness", s.alpha.sqrt());
                out += &float("specular_IOR", s.index);
            }
            None => out += &float("specular", 0.0),
        }
        if let Some(index) = self.coat {
            out += &(float("coat", 1.0) + &float("coat_roughness", 0.0) + &float("coat_IOR", index));
        }
        out
    }
}

impl Specular {
    /// c for a Fresnel reflectance F.
    fn compensation(&self, cos_v: f64, f: f64) -> f64 {
        let single = self.single.at(cos_v).max(1e-3);
        1.0 + f * (1.0 - single) / single
    }

    /// 1 − E(n·v): what the lobe leaves to the diffuser.
    fn throughput(&self, cos_v: f64) -> f64 {
        let f = dielectric(cos_v, self.index);
        (1.0 - self.albedo.at(cos_v) * self.compensation(cos_v, f)).max(0.0)
    }
}

impl Brdf for Surface {
    fn eval(&self, light: Vec3, view: Vec3) -> Rgb {
        if light.z <= 0.0 || view.z <= 0.0 {
            return [0.0; 3];
        }
        let coat = self.coat.map_or(1.0, |index| 1.0 - dielectric(view.z, index));
        let mut f = self.base.map(|b| b * std::f64::consts::FRAC_1_PI);
        if let Some(s) = &self.lobe {
            let (c, hv) = smith::half(light, view);
            let fresnel = dielectric(hv, s.index);
            let value = fresnel
                * smith::density(Distribution::Ggx, s.alpha, c)
                * smith::correlated_visibility(s.alpha, light.z, view.z)
                * s.compensation(view.z, fresnel);
            let left = s.throughput(view.z);
            f = [0, 1, 2].map(|i| f[i] * left + s.tint[i] * value);
        }
        f.map(|x| x * coat)
    }

    fn sharpness(&self) -> f64 {
        self.lobe.as_ref().map_or(0.0, |s| 4.0 / (s.alpha * s.alpha))
    }
}
