//! A glTF 2.0 asset with one material: dielectric base with `KHR_materials_ior`, `KHR_materials_specular`, `KHR_materials_clearcoat`.
//!
//! What a renderer computes (glTF 2.0 appendix B, the extensions' texts):
//!
//! ```text
//! f = (1 − clearcoat · S(n·v, 0.04)) [ (1 − max F) baseColor/π + F · D G1(l) G1(v)/(4 (n·l)(n·v)) ]
//! F = f0 + (f90 − f0)(1 − h·v)^5,  f0 = min(r(ior) specularColor, 1) · specular,  f90 = specular,  α = roughness²
//! ```
//!
//! f90 has no colour. A lobe without Fresnel term follows Sopp's rule (f0 is its colour). baseColor is raised by what 1 − max F takes at normal
//! incidence. JSON has no comments: the loss stands in the material's `extras`.

use gonio_optics::{Vec3, fresnel::r0_from_index, fresnel::schlick};
use serde_json::json;

use super::{
    Draft, NotMapped, Renderer,
    layers::{Distribution, Layers, Lobe, largest, nearest_ggx},
    smith,
};
use crate::{Brdf, ModelFile, Rgb};

/// Reflectance of the clear coat at normal incidence, fixed by the extension (index 1.5).
const COAT_R0: f64 = 0.04;
/// f0 of the lobe that an index has to give; the colour factor does the rest.
const MAX_R0: f64 = 0.9;

/// The factors of the material.
#[derive(Clone, Copy)]
struct Material {
    base: Rgb,
    ior: f64,
    specular: f64,
    specular_colour: Rgb,
    alpha: f64,
    clearcoat: f64,
}

pub(super) fn draft(file: &ModelFile) -> Result<Draft, NotMapped> {
    let layers = Layers::of(file, Renderer::Gltf)?.seen_through_coat();
    if layers.lobes.len() > 1 {
        return Err(NotMapped {
            model: file.model.name().to_owned(),
            renderer: Renderer::Gltf.title(),
            why: format!("it has {} lobes and the material one", layers.lobes.len()),
            instead: "fit one lobe, or export to mitsuba".to_owned(),
        });
    }
    let mut notes = Vec::new();
    let material = match layers.lobes.first() {
        None => Material::of(&layers, None),
        Some(lobe) => {
            let (material, note) = nearest_ggx(file, lobe, |l| Material::of(&layers, Some(l)));
            notes.extend(note);
            material
        }
    };
    if largest(material.base) >= 1.0 {
        notes.push("baseColor held to 1".to_owned());
    }
    if layers.coat.is_some_and(|index| (r0_from_index(index) / COAT_R0 - 1.0).abs() > 1e-9) {
        notes.push(
            "glTF's coat has index 1.5; its weight follows the reflectance at normal incidence, at most 1"
                .to_owned(),
        );
    }
    Ok(Draft {
        rendered: Box::new(material),
        notes,
        write: Box::new(move |name, remark| material.text(name, remark)),
    })
}

impl Material {
    /// The factors for a diffuser, a lobe and a coat.
    fn of(layers: &Layers, lobe: Option<&Lobe>) -> Self {
        let mut m = Self {
            base: layers.diffuse.map(|d| d.min(1.0)),
            ior: 1.5,
            specular: 0.0,
            specular_colour: [1.0; 3],
            alpha: 1.0,
            clearcoat: layers.coat.map_or(0.0, |index| (r0_from_index(index) / COAT_R0).min(1.0)),
        };
        if let Some(l) = lobe {
            // f0 is wanted per channel, f90 has no colour
            let (f0, f90) = match l.r0 {
                Some(r0) => (l.colour.map(|c| c * r0), largest(l.colour).min(1.0)),
                None => (l.colour, 1.0),
            };
            let r0 = (largest(f0) / f90).clamp(1e-6, MAX_R0);
            m.ior = (1.0 + r0.sqrt()) / (1.0 - r0.sqrt());
            m.specular = f90;
            m.specular_colour = f0.map(|f| f / (f90 * r0));
            m.alpha = l.alpha.min(1.0);
            let left = (1.0 - largest(f0).min(f90)).max(1e-6);
            m.base = layers.diffuse.map(|d| (d / left).min(1.0));
        }
        m
    }

    fn text(&self, name: &str, remark: &str) -> String {
        // seven digits: what single precision can tell
        let n = |x: f64| number(x);
        let mut extensions = serde_json::Map::new();
        extensions.insert("KHR_materials_ior".to_owned(), json!({ "ior": n(self.ior) }));
        extensions.insert(
            "KHR_materials_specular".to_owned(),
            json!({ "specularFactor": n(self.specular), "specularColorFactor": self.specular_colour.map(n) }),
        );
        if self.clearcoat > 0.0 {
            extensions.insert(
                "KHR_materials_clearcoat".to_owned(),
                json!({ "clearcoatFactor": n(self.clearcoat), "clearcoatRoughnessFactor": 0.0 }),
            );
        }
        let used: Vec<String> = extensions.keys().cloned().collect();
        let [r, g, b] = self.base.map(n);
        let asset = json!({
            "asset": { "version": "2.0", "generator": "gonio" },
            "extensionsUsed": used,
            "materials": [{
                "name": name,
                "pbrMetallicRoughness": {
                    "baseColorFactor": [r, g, b, 1.0],
                    "metallicFactor": 0.0,
                    "roughnessFactor": n(self.alpha.sqrt()),
                },
                "extensions": extensions,
                "extras": { "remark": remark },
            }],
        });
        format!("{asset:#}\n")
    }
}

/// A number as single precision tells it, without the digits that the conversion to f64 would add.
fn number(x: f64) -> f64 {
    super::number(x).parse().unwrap_or(x)
}

impl Brdf for Material {
    fn eval(&self, light: Vec3, view: Vec3) -> Rgb {
        if light.z <= 0.0 || view.z <= 0.0 {
            return [0.0; 3];
        }
        let (c, hv) = smith::half(light, view);
        let m = (1.0 - hv.abs()).clamp(0.0, 1.0).powi(5);
        let r0 = r0_from_index(self.ior);
        let fresnel = self.specular_colour.map(|colour| {
            let f0 = (r0 * colour).min(1.0) * self.specular;
            f0 + (self.specular - f0) * m
        });
        let g1 = |cos: f64| smith::one_way(Distribution::Ggx, self.alpha, cos);
        let lobe = smith::density(Distribution::Ggx, self.alpha, c) * g1(light.z) * g1(view.z)
            / (4.0 * light.z * view.z);
        let left = 1.0 - largest(fresnel);
        let coat = 1.0 - self.clearcoat * schlick(view.z, COAT_R0);
        [0, 1, 2].map(|i| coat * (left * self.base[i] * std::f64::consts::FRAC_1_PI + fresnel[i] * lobe))
    }

    fn sharpness(&self) -> f64 {
        if self.specular > 0.0 { 4.0 / (self.alpha * self.alpha) } else { 0.0 }
    }
}
