//! A model written as a renderer's material, with what that costs said on the terminal and in JSON.

use std::path::Path;

use gonio_brdf::ModelFile;
use gonio_brdf::export::{Export, Renderer, export};
use serde_json::{Value, json};

use crate::outcome::Failure;
use crate::output;

/// The renderer by its name, else by the ending of the file; `csv` counts where `csv_is_sopp`.
///
/// # Errors
/// [`Failure::Usage`] for a name that is none.
pub fn renderer(name: Option<&str>, path: &Path, csv_is_sopp: bool) -> Result<Option<Renderer>, Failure> {
    if let Some(name) = name {
        let known: Vec<&str> = Renderer::ALL.iter().map(|r| r.0).collect();
        return match Renderer::ALL.iter().find(|r| r.0 == name) {
            Some(r) => Ok(Some(r.1)),
            None => Err(Failure::usage(format!("--as {name}: use one of {}", known.join(", ")))),
        };
    }
    let ending = path.extension().and_then(|e| e.to_str()).unwrap_or_default();
    if csv_is_sopp && ending.eq_ignore_ascii_case("csv") {
        return Ok(Some(Renderer::Sopp));
    }
    Ok(Renderer::from_ending(ending))
}

/// Makes the material, writes it whole or not at all, and gives the lines and the JSON that tell of it.
///
/// # Errors
/// [`Failure::Usage`] for a model that does not map, [`Failure::Failed`] for a file that cannot be written.
pub fn write(file: &ModelFile, renderer: Renderer, path: &Path) -> Result<(String, Value), Failure> {
    let name = path.file_stem().unwrap_or_default().to_string_lossy();
    let made = export(file, renderer, &name).map_err(Failure::usage)?;
    output::write_whole(path, made.text.as_bytes())?;
    Ok(told(&made, renderer, path))
}

fn told(made: &Export, renderer: Renderer, path: &Path) -> (String, Value) {
    let mut text = format!("{} for {}\n  {}\n", path.display(), renderer.title(), made.loss);
    for note in &made.notes {
        text += &format!("  note: {note}\n");
    }
    let json = json!({
        "output": output::shown(path),
        "renderer": renderer.name(),
        "delta_e": made.loss,
        "notes": made.notes,
    });
    (text, json)
}
