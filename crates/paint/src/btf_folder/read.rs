//! Reads a folder of slices, all cores at once.

use std::path::{Path, PathBuf};

use rayon::prelude::*;

use super::{BtfFolderError, INDEX_NAME, index::Index, picture};
use crate::{FlakeBtf, car_paint::Through};

/// What a folder holds.
#[derive(Clone, Debug)]
pub struct BtfFolder {
    /// The textures.
    pub btf: FlakeBtf,
    /// Side of a texel on the surface, mm.
    pub texel_mm: f64,
    /// Index of the coat the angles are inside of.
    pub coat_index: Option<f64>,
    /// Whether the coat's factor is divided out of the texels.
    pub through: Through,
    /// What to know about it, a sentence each.
    pub notes: Vec<String>,
}

/// Most bytes of texels that are read at once.
const MOST_BYTES: usize = 16 << 30;

/// Reads a folder, or its TOML.
///
/// # Errors
/// [`BtfFolderError`]: missing slices, other sizes, values that are not finite, slices below nothing; each with the file.
pub fn read_btf_folder(path: &Path) -> Result<BtfFolder, BtfFolderError> {
    let toml: PathBuf = if path.is_dir() { path.join(INDEX_NAME) } else { path.to_owned() };
    let folder = toml.parent().unwrap_or(Path::new("")).to_owned();
    let io = |path: &Path| {
        let path = path.to_owned();
        move |source| BtfFolderError::Io { path, source }
    };
    let text = std::fs::read_to_string(&toml).map_err(io(&toml))?;
    let index = Index::parse(&toml, &text)?;
    let files: Vec<PathBuf> = index.slices.iter().map(|s| folder.join(&s.file)).collect();
    let refuse = |k: usize, reason: String| BtfFolderError::Picture { path: files[k].clone(), reason };
    let first = std::fs::read(&files[0]).map_err(io(&files[0]))?;
    let size = picture::size(&first).map_err(|reason| refuse(0, reason))?;
    let n = size[0] * size[1];
    if n.saturating_mul(12 * files.len()) > MOST_BYTES {
        return Err(refuse(
            0,
            format!(
                "{} slices of {} × {} texels take more than 16 GiB; cut them smaller",
                files.len(),
                size[0],
                size[1]
            ),
        ));
    }
    let mut texels = vec![[0.0f32; 3]; n * files.len()];
    let told: Vec<Told> = texels
        .par_chunks_exact_mut(n)
        .enumerate()
        .map(|(k, out)| {
            let bytes = std::fs::read(&files[k]).map_err(io(&files[k]))?;
            let found = picture::size(&bytes).map_err(|reason| refuse(k, reason))?;
            if found != size {
                return Err(BtfFolderError::Size { path: files[k].clone(), found, expected: size });
            }
            let scale = index.slices[k].full_scale.unwrap_or(1.0);
            picture::decode(&bytes, scale, out).map_err(|reason| refuse(k, reason))?;
            look(&files[k], out, size[0])
        })
        .collect::<Result<_, _>>()?;
    let btf = FlakeBtf::new(index.half, index.incidence, size, texels)?;
    let notes = notes(&told, &files);
    Ok(BtfFolder {
        btf,
        texel_mm: index.texel_mm,
        coat_index: index.coat_index,
        through: index.through,
        notes,
    })
}

/// What stands out in a slice.
struct Told {
    negative: usize,
    least: f32,
    black: bool,
}

/// Looks a slice over once, while it is in the cache.
fn look(path: &Path, texels: &[[f32; 3]], width: usize) -> Result<Told, BtfFolderError> {
    let mut sum = [0.0f64; 3];
    let mut told = Told { negative: 0, least: 0.0, black: true };
    for (k, t) in texels.iter().enumerate() {
        if !t.iter().all(|v| v.is_finite()) {
            return Err(BtfFolderError::NotFinite { path: path.to_owned(), x: k % width, y: k / width });
        }
        let least = t[0].min(t[1]).min(t[2]);
        told.negative += usize::from(least < 0.0);
        told.least = told.least.min(least);
        told.black &= *t == [0.0; 3];
        for (s, v) in sum.iter_mut().zip(t) {
            *s += f64::from(*v);
        }
    }
    if let Some(channel) = sum.iter().position(|s| *s < 0.0) {
        let mean = sum[channel] / texels.len() as f64;
        return Err(BtfFolderError::Negative { path: path.to_owned(), mean, channel });
    }
    Ok(told)
}

fn notes(told: &[Told], files: &[PathBuf]) -> Vec<String> {
    let mut notes = Vec::new();
    let texels: usize = told.iter().map(|t| t.negative).sum();
    if texels > 0 {
        let slices = told.iter().filter(|t| t.negative > 0).count();
        let least = told.iter().map(|t| t.least).fold(0.0, f32::min);
        notes.push(format!(
            "{texels} texels in {slices} slices are below 0 (the lowest is {least:.3e} 1/sr); they are kept, as noise about nothing is"
        ));
    }
    let black: Vec<usize> = (0..told.len()).filter(|&k| told[k].black).collect();
    if let Some(&first) = black.first() {
        notes.push(format!(
            "{} slices are black throughout, the first is {}; there the paint shows no flakes",
            black.len(),
            files[first].display()
        ));
    }
    notes
}
