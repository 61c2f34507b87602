//! An image in linear light, its OpenEXR file and its way to a screen.

use std::path::Path;

use gonio_optics::colour;

use crate::picture::{Picture, PictureError, Srgb};
use crate::plots::hatch_at;

/// Linear Rec. 709 radiance factors, rows from the top.
#[derive(Clone, Debug, PartialEq)]
pub struct LinearImage {
    /// Pixels across.
    pub width: u32,
    /// Pixels down.
    pub height: u32,
    /// Mean over what the object covers of the pixel, not dimmed by its edge; NaN where the reflectance is not known in
    /// all of that.
    pub values: Vec<[f32; 3]>,
    /// Share of the pixel that the object covers, 0…1.
    pub coverage: Vec<f32>,
}

/// From linear light to a screen.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tone {
    /// Factor on all values.
    pub exposure: f64,
    /// Behind the object.
    pub background: Srgb,
}

impl Default for Tone {
    fn default() -> Self {
        // a neutral surround of L* = 50 leaves the eye's judgement of colour alone
        Self { exposure: 1.0, background: [0x77; 3] }
    }
}

/// Values up to this one are shown as they are.
const KNEE: f64 = 0.8;

impl Tone {
    /// Display colour of a linear one: exact up to 0.8, above that rolled off towards 1, channel by channel, so that highlights
    /// keep some drawing and fade to white; then the sRGB curve.
    #[must_use]
    pub fn display(&self, linear: [f64; 3]) -> Srgb {
        linear.map(|v| {
            let x = v * self.exposure;
            let rolled = if x > KNEE {
                let over = (x - KNEE) / (1.0 - KNEE);
                KNEE + (1.0 - KNEE) * if over.is_finite() { over / (1.0 + over) } else { 1.0 }
            } else {
                x
            };
            (colour::srgb_encode(rolled) * 255.0).round() as u8
        })
    }
}

impl LinearImage {
    /// Number of covered pixels whose value is not known.
    #[must_use]
    pub fn missing(&self) -> usize {
        self.values.iter().filter(|v| v.iter().any(|x| x.is_nan())).count()
    }

    /// The image for a screen. Edges blend into the background in linear light; what is not known is hatched.
    #[must_use]
    pub fn to_picture(&self, tone: &Tone) -> Picture {
        Picture::from_fn(self.width, self.height, |x, y| {
            let i = y as usize * self.width as usize + x as usize;
            let (Some(v), Some(&cover)) = (self.values.get(i), self.coverage.get(i)) else {
                return tone.background;
            };
            if cover <= 0.0 {
                return tone.background;
            }
            let shown = if v.iter().all(|c| c.is_finite()) {
                tone.display(v.map(f64::from))
            } else {
                hatch_at(f64::from(x) * 0.5, f64::from(y) * 0.5)
            };
            blend(shown, tone.background, f64::from(cover))
        })
    }

    /// Writes an OpenEXR file: linear R, G, B of 32 bits, premultiplied by A, the coverage. Pixels that are not known are empty (A = 0).
    ///
    /// # Errors
    /// [`PictureError::Encode`] with what the writer said.
    pub fn save_exr(&self, path: &Path) -> Result<(), PictureError> {
        let wide = self.width as usize;
        let at = |x: usize, y: usize| {
            let i = y * wide + x;
            let v = self.values.get(i).copied().unwrap_or([0.0; 3]);
            let a = self.coverage.get(i).copied().unwrap_or(0.0);
            let known = v.iter().all(|c| c.is_finite());
            if known { (v[0] * a, v[1] * a, v[2] * a, a) } else { (0.0, 0.0, 0.0, 0.0) }
        };
        exr::prelude::write_rgba_file(path, wide, self.height as usize, at).map_err(|e| {
            PictureError::Encode {
                width: self.width,
                height: self.height,
                format: "OpenEXR",
                reason: format!("{e} ({})", path.display()),
            }
        })
    }
}

/// Mixes two display colours in linear light.
fn blend(over: Srgb, under: Srgb, alpha: f64) -> Srgb {
    if alpha >= 1.0 {
        return over;
    }
    let linear = |v: u8| {
        let x = f64::from(v) / 255.0;
        if x <= 0.040_45 { x / 12.92 } else { ((x + 0.055) / 1.055).powf(2.4) }
    };
    [0, 1, 2].map(|c| {
        let mixed = linear(over[c]) * alpha + linear(under[c]) * (1.0 - alpha);
        (colour::srgb_encode(mixed) * 255.0).round() as u8
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn known_values_have_known_colours() {
        let tone = Tone::default();
        // 0.5 linear is sRGB 188, 0.18 is 118 (IEC 61966-2-1)
        assert_eq!(tone.display([0.5, 0.18, 0.0]), [188, 118, 0]);
        assert_eq!(tone.display([f64::INFINITY, -1.0, 1e300]), [255, 0, 255]);
        let bright: Vec<u8> = [0.7, 0.8, 0.9, 1.2, 2.0, 10.0].map(|v| tone.display([v; 3])[0]).to_vec();
        assert!(bright.windows(2).all(|w| w[0] < w[1]), "{bright:?}");
    }

    #[test]
    fn an_exr_file_holds_the_linear_values() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("ball.exr");
        let image = LinearImage {
            width: 3,
            height: 1,
            values: vec![[0.25, 4.5, 1e-3], [f32::NAN; 3], [0.5; 3]],
            coverage: vec![1.0, 1.0, 0.5],
        };
        image.save_exr(&path).unwrap();
        let mut seen = vec![[9.0f32; 4]; 3];
        let read = exr::prelude::read_first_rgba_layer_from_file(
            &path,
            |_, _| vec![[9.0f32; 4]; 3],
            |row, at, (r, g, b, a): (f32, f32, f32, f32)| row[at.x()] = [r, g, b, a],
        )
        .unwrap();
        seen.clone_from(&read.layer_data.channel_data.pixels);
        assert_eq!(seen, vec![[0.25, 4.5, 1e-3, 1.0], [0.0; 4], [0.25, 0.25, 0.25, 0.5]]);
    }

    #[test]
    fn a_folder_that_is_missing_is_named_in_the_error() {
        let image = LinearImage { width: 1, height: 1, values: vec![[0.0; 3]], coverage: vec![1.0] };
        let dir = tempfile::tempdir().unwrap();
        let e = image.save_exr(&dir.path().join("absent").join("b.exr")).unwrap_err();
        assert!(e.to_string().contains("absent"), "{e}");
    }
}
