//! Opens any file that holds a reflectance: the formats of tables and models, car paints, and rows of published car paints (`FILE#NAME`).

use std::collections::BTreeMap;
use std::path::Path;

use gonio_brdf::formats::{self, Format, Function, Loaded};
use gonio_paint::CarPaint;
use gonio_paint::car_paint::{is_guenther, is_paint, read_guenther, read_paint};
use serde_json::{Map, Value};

use crate::outcome::Failure;

/// A file's content, whatever its format; a car paint as the mean over its surface.
///
/// # Errors
/// [`Failure::Usage`] for a file that cannot be read.
pub fn open(input: &str) -> Result<Loaded, Failure> {
    let Some(Stored { paint, .. }) = paint(input)? else {
        return formats::open(Path::new(input)).map_err(Failure::usage);
    };
    let name = paint.parts().name.clone();
    let notes = paint
        .parts()
        .coat
        .map(|c| BTreeMap::from([("coat_index".to_owned(), c.index.to_string())]))
        .unwrap_or_default();
    let format = Format::CarPaint;
    Ok(Loaded::Function(Function { brdf: Box::new(paint), format, name, notes, flake_map: None }))
}

/// A car paint and what its file says of it.
pub struct Stored {
    /// The paint.
    pub paint: CarPaint,
    /// Where it comes from, what a fit said.
    pub notes: Map<String, Value>,
}

/// A car paint with the notes in its file; `None` of anything else.
///
/// # Errors
/// [`Failure::Usage`] for a car paint that cannot be read, or a name that is not in a table of them.
pub fn paint(input: &str) -> Result<Option<Stored>, Failure> {
    let (file, name) = match input.rsplit_once('#') {
        Some((file, name)) if !Path::new(input).exists() => (file, name),
        _ => (input, ""),
    };
    let in_file = |e: gonio_paint::CarPaintError| Failure::usage(format!("{input}: {e}"));
    let begins = beginning(Path::new(file));
    if is_paint(&begins) {
        if !name.is_empty() {
            return Err(Failure::usage(format!(
                "{file} holds one paint without a choice; leave #{name} out"
            )));
        }
        let bytes = formats::read_file(Path::new(file)).map_err(Failure::usage)?;
        return read_paint(&bytes).map(|(paint, notes)| Some(Stored { paint, notes })).map_err(in_file);
    }
    if is_guenther(&String::from_utf8_lossy(&begins)) {
        let text = crate::output::read_text(Path::new(file))?;
        return read_guenther(&text, name)
            .map(|paint| Some(Stored { paint, notes: Map::new() }))
            .map_err(in_file);
    }
    Ok(None)
}

/// Enough of a file to know it by; nothing of what cannot be read, which whoever opens it will tell.
fn beginning(path: &Path) -> Vec<u8> {
    use std::io::Read as _;
    let mut bytes = Vec::new();
    if path.is_file()
        && let Ok(file) = std::fs::File::open(path)
    {
        let _ = file.take(4096).read_to_end(&mut bytes);
    }
    bytes
}
