//! A finished picture: sRGB, eight bits a channel, and its way into a PNG file.

use std::io::Cursor;
use std::path::{Path, PathBuf};

/// An sRGB colour as displays take it.
pub type Srgb = [u8; 3];

/// A raster of sRGB pixels, rows from the top, each from the left.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Picture {
    width: u32,
    height: u32,
    pixels: Vec<Srgb>,
}

/// A picture that cannot be encoded or stored.
#[derive(Debug, thiserror::Error)]
pub enum PictureError {
    /// The encoder refused.
    #[error("a picture of {width} × {height} pixels cannot be encoded as {format}: {reason}")]
    Encode {
        /// Width in pixels.
        width: u32,
        /// Height in pixels.
        height: u32,
        /// PNG or OpenEXR.
        format: &'static str,
        /// What the encoder said.
        reason: String,
    },
    /// The file cannot be written.
    #[error("cannot write {path}: {source}; check that the folder exists and may be written to")]
    Write {
        /// Where.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// A name that would leave the folder it is meant for.
    #[error("picture name {name:?} cannot be a file name: use letters, digits, '-' and '_' only")]
    Name {
        /// The name.
        name: String,
    },
}

impl Picture {
    /// A picture of one colour.
    #[must_use]
    pub fn new(width: u32, height: u32, fill: Srgb) -> Self {
        Self { width, height, pixels: vec![fill; width as usize * height as usize] }
    }

    /// A picture from a function of (column, row).
    #[must_use]
    pub fn from_fn(width: u32, height: u32, mut colour: impl FnMut(u32, u32) -> Srgb) -> Self {
        let mut pixels = Vec::with_capacity(width as usize * height as usize);
        for y in 0..height {
            for x in 0..width {
                pixels.push(colour(x, y));
            }
        }
        Self { width, height, pixels }
    }

    /// Pixels across.
    #[must_use]
    pub const fn width(&self) -> u32 {
        self.width
    }

    /// Pixels down.
    #[must_use]
    pub const fn height(&self) -> u32 {
        self.height
    }

    /// All pixels, row by row.
    #[must_use]
    pub fn pixels(&self) -> &[Srgb] {
        &self.pixels
    }

    /// The pixel in column `x` and row `y`, `None` outside.
    #[must_use]
    pub fn get(&self, x: u32, y: u32) -> Option<Srgb> {
        self.place(x, y).and_then(|i| self.pixels.get(i).copied())
    }

    /// Sets a pixel; outside the picture nothing happens.
    pub fn set(&mut self, x: u32, y: u32, colour: Srgb) {
        if let Some(p) = self.place(x, y).and_then(|i| self.pixels.get_mut(i)) {
            *p = colour;
        }
    }

    /// Lays `colour` over a pixel with opacity `alpha` (0…1), in display values.
    pub(crate) fn blend(&mut self, x: u32, y: u32, colour: Srgb, alpha: f32) {
        let Some(p) = self.place(x, y).and_then(|i| self.pixels.get_mut(i)) else { return };
        let a = alpha.clamp(0.0, 1.0);
        for (old, new) in p.iter_mut().zip(colour) {
            *old = (f32::from(*old) + (f32::from(new) - f32::from(*old)) * a).round() as u8;
        }
    }

    fn place(&self, x: u32, y: u32) -> Option<usize> {
        (x < self.width && y < self.height).then_some(y as usize * self.width as usize + x as usize)
    }

    /// The PNG file of this picture; the same picture gives the same bytes.
    ///
    /// # Errors
    /// [`PictureError::Encode`] for a picture without pixels.
    pub fn to_png(&self) -> Result<Vec<u8>, PictureError> {
        let refuse = |reason: String| PictureError::Encode {
            width: self.width,
            height: self.height,
            format: "PNG",
            reason,
        };
        if self.pixels.is_empty() {
            return Err(refuse("it has no pixels".into()));
        }
        let bytes: Vec<u8> = self.pixels.iter().flatten().copied().collect();
        let image = image::RgbImage::from_raw(self.width, self.height, bytes)
            .ok_or_else(|| refuse("its buffer has the wrong length".into()))?;
        let mut out = Cursor::new(Vec::new());
        image.write_to(&mut out, image::ImageFormat::Png).map_err(|e| refuse(e.to_string()))?;
        Ok(out.into_inner())
    }

    /// Writes the PNG file, replacing what is there.
    ///
    /// # Errors
    /// [`PictureError`]: not encodable, or the file cannot be written.
    pub fn save_png(&self, path: &Path) -> Result<(), PictureError> {
        let png = self.to_png()?;
        std::fs::write(path, png).map_err(|source| PictureError::Write { path: path.to_owned(), source })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn png_holds_the_pixels_that_were_put_in() {
        let p = Picture::from_fn(7, 5, |x, y| [x as u8 * 30, y as u8 * 50, 9]);
        let back = image::load_from_memory(&p.to_png().unwrap()).unwrap().to_rgb8();
        assert_eq!((back.width(), back.height()), (7, 5));
        for (x, y, q) in back.enumerate_pixels() {
            assert_eq!(Some(q.0), p.get(x, y));
        }
    }

    #[test]
    fn an_empty_picture_is_refused_and_pixels_outside_do_not_exist() {
        let p = Picture::new(0, 3, [0; 3]);
        assert!(matches!(p.to_png(), Err(PictureError::Encode { .. })));
        assert_eq!(Picture::new(2, 2, [1; 3]).get(2, 0), None);
    }

    #[test]
    fn a_folder_that_is_missing_is_named_in_the_error() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("absent").join("p.png");
        let e = Picture::new(1, 1, [0; 3]).save_png(&path).unwrap_err();
        assert!(e.to_string().contains("absent"), "{e}");
    }
}
