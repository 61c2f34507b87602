//! A report of a measurement: one HTML file that needs nothing else (no script, no network), and its pictures as PNG files.
//!
//! Numbers and words come in as data; this room only sets them. Every text is escaped.

mod base64;
mod html;
mod number;
mod section;
mod standard;
mod style;

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

pub use number::{plus_minus, significant};
pub use section::{Block, ColourDifference, Estimate, Fact, Figure, Parameter, Section};
pub use standard::{Fit, colour_differences, standard_figures};

use crate::picture::PictureError;

/// How much a notice weighs.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Weight {
    /// Good to know.
    Note,
    /// Read this before you use the numbers.
    Warning,
    /// Something failed.
    Failure,
}

/// A sentence in plain words about the measurement: what happened, what it means for the numbers, what to do.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Notice {
    /// How much it weighs.
    pub weight: Weight,
    /// The sentence.
    pub text: String,
}

/// A number that belongs at the top.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct KeyFigure {
    /// What it is.
    pub label: String,
    /// The number with its unit.
    pub value: String,
    /// Under it in small letters; may be empty.
    pub note: String,
}

/// The whole report, in the order in which it is read.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Report {
    /// Heading and window title.
    pub title: String,
    /// A line under the title; may be empty.
    pub subtitle: String,
    /// Numbers at the top.
    pub key_figures: Vec<KeyFigure>,
    /// Sentences about the measurement; the heaviest come first.
    pub notices: Vec<Notice>,
    /// Tables and pictures.
    pub sections: Vec<Section>,
    /// The last line: which program made this from what.
    pub footer: String,
}

impl Report {
    /// The HTML file. The same report gives the same bytes.
    ///
    /// # Errors
    /// [`PictureError::Encode`] for a picture without pixels.
    pub fn to_html(&self) -> Result<String, PictureError> {
        html::document(self)
    }

    /// Writes the HTML file, replacing what is there.
    ///
    /// # Errors
    /// [`PictureError`]: a picture cannot be encoded, or the file cannot be written.
    pub fn save_html(&self, path: &Path) -> Result<(), PictureError> {
        let text = self.to_html()?;
        std::fs::write(path, text).map_err(|source| PictureError::Write { path: path.to_owned(), source })
    }

    /// Writes every picture as `NAME.png` into a folder that exists, replacing what is there; says what was written, in the order of
    /// the report.
    ///
    /// # Errors
    /// [`PictureError::Name`] before anything is written when a name is empty, given twice or has signs other than letters, digits,
    /// `-` and `_`; otherwise what [`Picture::save_png`](crate::Picture::save_png) says.
    pub fn save_pictures(&self, folder: &Path) -> Result<Vec<PathBuf>, PictureError> {
        let figures: Vec<&Figure> = self.figures().collect();
        let mut seen = BTreeSet::new();
        for f in &figures {
            let fits = |c: char| c.is_ascii_alphanumeric() || c == '-' || c == '_';
            if f.name.is_empty() || !f.name.chars().all(fits) || !seen.insert(&f.name) {
                return Err(PictureError::Name { name: f.name.clone() });
            }
        }
        let save = |f: &&Figure| {
            let path = folder.join(format!("{}.png", f.name));
            f.picture.save_png(&path).map(|()| path)
        };
        figures.iter().map(save).collect()
    }

    /// All pictures in the order of the report.
    pub fn figures(&self) -> impl Iterator<Item = &Figure> {
        self.sections.iter().flat_map(|s| &s.blocks).flat_map(|b| match b {
            Block::Pictures(figures) => figures.as_slice(),
            _ => &[],
        })
    }
}
