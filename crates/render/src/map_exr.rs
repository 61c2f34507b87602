//! A map of f as an OpenEXR file for shaders: linear values in 32 bits, and how to read them written as text attributes.

use std::io::Cursor;

use exr::prelude::{AttributeValue, Image, SpecificChannels, Text, Vec2, WritableImage as _};

use crate::picture::PictureError;

/// Values on a rectangle, rows from the top, with what a reader must know.
#[derive(Clone, Debug, PartialEq)]
pub struct MapImage {
    /// Pixels across.
    pub width: usize,
    /// Pixels down.
    pub height: usize,
    /// f in 1/sr, linear Rec. 709 RGB, row by row.
    pub values: Vec<[f32; 3]>,
    /// Name and text of each attribute; names are kept to 31 signs, texts to Latin-1, as the format asks.
    pub attributes: Vec<(String, String)>,
}

impl MapImage {
    /// The OpenEXR file.
    ///
    /// # Errors
    /// [`PictureError::Encode`] with what the writer said, or for values that do not fill the rectangle.
    pub fn to_exr(&self) -> Result<Vec<u8>, PictureError> {
        let refuse = |reason: String| PictureError::Encode {
            width: u32::try_from(self.width).unwrap_or(u32::MAX),
            height: u32::try_from(self.height).unwrap_or(u32::MAX),
            format: "OpenEXR",
            reason,
        };
        if self.values.is_empty() || self.values.len() != self.width * self.height {
            return Err(refuse(format!("it has {} values", self.values.len())));
        }
        let at = |p: Vec2<usize>| {
            let [r, g, b] = self.values.get(p.y() * self.width + p.x()).copied().unwrap_or([0.0; 3]);
            (r, g, b)
        };
        let mut image = Image::from_channels((self.width, self.height), SpecificChannels::rgb(at));
        for (name, text) in &self.attributes {
            let short: String = name.chars().take(31).collect();
            let latin: String = text.chars().map(|c| if u32::from(c) < 256 { c } else { '?' }).collect();
            if let (Some(name), Some(text)) = (Text::new_or_none(short), Text::new_or_none(latin)) {
                image.layer_data.attributes.other.insert(name, AttributeValue::Text(text));
            }
        }
        let mut out = Cursor::new(Vec::new());
        image.write().to_buffered(&mut out).map_err(|e| refuse(e.to_string()))?;
        Ok(out.into_inner())
    }
}

#[cfg(test)]
mod tests {
    use exr::prelude::{ReadChannels as _, ReadLayers as _};

    use super::*;

    #[test]
    fn values_and_words_come_back() {
        let image = MapImage {
            width: 3,
            height: 2,
            values: (0..6).map(|k| [k as f32 * 0.125, 1e-4, 300.0]).collect(),
            attributes: vec![("gonio_layout".to_owned(), "x = cos, n = 1.5, θ".to_owned())],
        };
        let bytes = image.to_exr().unwrap();
        let read = exr::prelude::read()
            .no_deep_data()
            .largest_resolution_level()
            .rgb_channels(
                |size, _| vec![[0.0f32; 3]; size.area()],
                |p, at, (r, g, b): (f32, f32, f32)| p[at.y() * 3 + at.x()] = [r, g, b],
            )
            .first_valid_layer()
            .all_attributes()
            .from_buffered(Cursor::new(bytes))
            .unwrap();
        assert_eq!(read.layer_data.channel_data.pixels, image.values);
        let words = &read.layer_data.attributes.other[&Text::from("gonio_layout")];
        assert_eq!(*words, AttributeValue::Text(Text::from("x = cos, n = 1.5, ?")));
        assert!(MapImage { width: 2, ..image }.to_exr().is_err());
    }
}
