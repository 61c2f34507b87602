//! Models as materials of renderers: Sopp's CSV, Mitsuba 3, MaterialX, glTF.
//!
//! No renderer has exactly our models. An export therefore says three things: the file, the BRDF which that renderer computes from it
//! (its documented formula, evaluated here), and the colour difference between that BRDF and the model ([`Loss`]). The same loss stands as a
//! comment in the file. A model whose shape a renderer cannot follow is refused with what would map ([`NotMapped`]).

mod gltf;
mod layers;
mod loss;
mod materialx;
mod mitsuba;
mod smith;
mod sopp_csv;

pub use loss::{Loss, Spread};

use crate::{Brdf, ModelFile};

/// A file that renderers read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Renderer {
    /// CSV row for the Ashikhmin shader of Sopp's thesis (4.23, 4.24), with his conversion to R_s.
    Sopp,
    /// A `<bsdf>` of Mitsuba 3.
    Mitsuba,
    /// A MaterialX document with `standard_surface`.
    MaterialX,
    /// A glTF 2.0 asset with one material: `KHR_materials_specular`, `KHR_materials_ior`, `KHR_materials_clearcoat`.
    Gltf,
}

/// A model as a renderer's material.
pub struct Export {
    /// The file.
    pub text: String,
    /// What the renderer computes from it, by its documented formula, without the gloss of a smooth coat (which has no value without a lamp).
    pub rendered: Box<dyn Brdf>,
    /// Colour difference between the model and `rendered`.
    pub loss: Loss,
    /// What was changed on the way, one sentence each.
    pub notes: Vec<String>,
}

impl std::fmt::Debug for Export {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Export")
            .field("text", &self.text)
            .field("loss", &self.loss)
            .field("notes", &self.notes)
            .finish_non_exhaustive()
    }
}

/// A model that a renderer's material cannot follow.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("model \"{model}\" does not map to {renderer}: {why}; {instead}")]
pub struct NotMapped {
    /// Name of the model.
    pub model: String,
    /// Name of the renderer's material.
    pub renderer: &'static str,
    /// Why not.
    pub why: String,
    /// What would map.
    pub instead: String,
}

impl Renderer {
    /// All with the names that the command line takes.
    pub const ALL: [(&'static str, Self); 4] = [
        ("sopp", Self::Sopp),
        ("mitsuba", Self::Mitsuba),
        ("materialx", Self::MaterialX),
        ("gltf", Self::Gltf),
    ];

    /// Name on the command line.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Sopp => "sopp",
            Self::Mitsuba => "mitsuba",
            Self::MaterialX => "materialx",
            Self::Gltf => "gltf",
        }
    }

    /// Name of the material in messages.
    #[must_use]
    pub const fn title(self) -> &'static str {
        match self {
            Self::Sopp => "Sopp's shader",
            Self::Mitsuba => "Mitsuba 3",
            Self::MaterialX => "MaterialX standard_surface",
            Self::Gltf => "glTF",
        }
    }

    /// The renderer whose files usually end so: `xml`, `mtlx`, `gltf`. CSV has other uses and is asked for by name.
    #[must_use]
    pub fn from_ending(ending: &str) -> Option<Self> {
        match ending.to_ascii_lowercase().as_str() {
            "xml" => Some(Self::Mitsuba),
            "mtlx" => Some(Self::MaterialX),
            "gltf" => Some(Self::Gltf),
            _ => None,
        }
    }
}

/// The model as a material called `name` (letters, digits and `_` are kept, anything else becomes `_`).
///
/// # Errors
/// [`NotMapped`] where the material cannot follow the model's shape, with what would map.
pub fn export(file: &ModelFile, renderer: Renderer, name: &str) -> Result<Export, NotMapped> {
    let mut clean: String = name.chars().map(|c| if c.is_ascii_alphanumeric() { c } else { '_' }).collect();
    if !clean.starts_with(|c: char| c.is_ascii_alphabetic()) {
        clean.insert_str(0, "m_");
    }
    let draft = match renderer {
        Renderer::Sopp => sopp_csv::draft(file)?,
        Renderer::Mitsuba => mitsuba::draft(file)?,
        Renderer::MaterialX => materialx::draft(file)?,
        Renderer::Gltf => gltf::draft(file)?,
    };
    let loss = Loss::between(file, draft.rendered.as_ref());
    let told = draft.notes.iter().fold(loss.to_string(), |text, note| text + "; " + note);
    let text = (draft.write)(&clean, &format!("{} by gonio. {told}", file.model.name()));
    Ok(Export { text, rendered: draft.rendered, loss, notes: draft.notes })
}

/// Writes a material by its name and the comment that goes into the file.
type Writer = Box<dyn Fn(&str, &str) -> String>;

/// A material before its loss is known, which its file has to say.
struct Draft {
    rendered: Box<dyn Brdf>,
    notes: Vec<String>,
    /// The file from the material's name and the remark it carries.
    write: Writer,
}

/// A number as files hold it: what single precision can tell.
fn number(x: f64) -> String {
    format!("{}", x as f32)
}

/// Three numbers with `, ` between.
fn numbers(c: crate::Rgb) -> String {
    c.map(number).join(", ")
}

#[cfg(test)]
mod tests;
