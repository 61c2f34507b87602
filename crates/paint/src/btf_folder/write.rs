//! Writes a flake BTF as a folder of slices.

use std::path::{Path, PathBuf};

use rayon::prelude::*;

use super::index::{File, Slice};
use super::{BtfFolderError, INDEX_NAME, picture};
use crate::{FlakeBtf, car_paint::Through};

/// How slices are written.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum SliceFormat {
    /// OpenEXR, single precision: to the bit.
    #[default]
    Exr,
    /// OpenEXR, half precision: to 1 part in 2048, half the size.
    ExrHalf,
    /// PNG of 16 bits, each slice scaled to its brightest texel; nothing below 0.
    Png,
}

/// Writes a folder: the pictures, then the TOML that makes them one.
///
/// # Errors
/// [`BtfFolderError::Exists`] for a TOML that is there already and no `force`; what the system says; a slice the format cannot hold.
pub fn write_btf_folder(
    folder: &Path,
    btf: &FlakeBtf,
    texel_mm: f64,
    coat_index: Option<f64>,
    through: Through,
    format: SliceFormat,
    force: bool,
) -> Result<(), BtfFolderError> {
    let io = |path: &Path| {
        let path = path.to_owned();
        move |source| BtfFolderError::Io { path, source }
    };
    let toml = folder.join(INDEX_NAME);
    if !force && toml.symlink_metadata().is_ok() {
        return Err(BtfFolderError::Exists(toml));
    }
    std::fs::create_dir_all(folder).map_err(io(folder))?;
    let n = btf.incidence().len();
    let slices: Vec<&[[f32; 3]]> = btf.slices().collect();
    let list: Vec<Slice> = slices
        .par_iter()
        .enumerate()
        .map(|(k, texels)| {
            let ending = if format == SliceFormat::Png { "png" } else { "exr" };
            let file = format!("slice_{:02}_{:02}.{ending}", k / n, k % n);
            let path: PathBuf = folder.join(&file);
            let brightest = texels.iter().flatten().fold(0.0f32, |a, b| a.max(*b));
            let full_scale = if brightest > 0.0 { f64::from(brightest) } else { 1.0 };
            let bytes = match format {
                SliceFormat::Exr => picture::encode_exr(texels, btf.size(), false),
                SliceFormat::ExrHalf => picture::encode_exr(texels, btf.size(), true),
                SliceFormat::Png => picture::encode_png(texels, btf.size(), full_scale),
            }
            .map_err(|reason| BtfFolderError::Picture { path: path.clone(), reason })?;
            std::fs::write(&path, bytes).map_err(io(&path))?;
            Ok(Slice {
                half_deg: btf.half()[k / n].degrees(),
                incidence_deg: btf.incidence()[k % n].degrees(),
                file,
                full_scale: (format == SliceFormat::Png).then_some(full_scale),
            })
        })
        .collect::<Result<_, BtfFolderError>>()?;
    let text = toml::to_string(&File::new(texel_mm, coat_index, through, list))
        .map_err(|e| BtfFolderError::Index { path: toml.clone(), reason: e.to_string() })?;
    std::fs::write(&toml, text).map_err(io(&toml))
}
