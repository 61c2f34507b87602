//! The texture camera: heads that look straight at the sample and see its single flakes.
//!
//! The heads stand on an arc about the tilt axis, each at its angle from the lamp; they are telecentric, focused on the sample, and expose together: a frame
//! holds their pictures one below the other. Head k looks along −c, c the lamp's direction turned about the tilt axis by its angle; its columns grow along
//! u = tilt axis × c, its rows along the tilt axis, and the middle of its picture is F1. Sensor, filter pattern and exposures are those of the
//! instrument's camera. At a tilt t the light comes in at θi = t and head k sees θo = |t − angle|, so tilts and heads together reach half angles
//! and angles of incidence alike.

use serde::{Deserialize, Serialize};

use crate::{Description, FileError};

/// The texture camera of an instrument.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TextureCamera {
    /// Angle of each head from the lamp, degrees, towards the side that the normal leans to for positive tilts.
    pub heads_deg: Vec<f64>,
    /// Columns and rows of a head's picture; even, as the filter pattern is.
    pub size: [u32; 2],
    /// Side of a pixel on a surface that faces the head, mm.
    pub pixel_mm: f64,
    /// Tilts at which textures are taken where no plan is given, degrees.
    pub tilt_deg: Vec<f64>,
    /// The frames of this description are those of the texture camera.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub active: bool,
}

impl TextureCamera {
    /// The texture camera of an instrument that names none: seventeen heads from 10° to 138°, 2.56 mm of the sample in texels of 0.02 mm.
    #[must_use]
    pub fn standard() -> Self {
        Self {
            heads_deg: (0..17).map(|k| 10.0 + 8.0 * f64::from(k)).collect(),
            size: [256, 256],
            pixel_mm: 0.01,
            tilt_deg: (0..27).map(|k| 3.0 * f64::from(k)).collect(),
            active: false,
        }
    }

    /// Columns and rows of a frame.
    #[must_use]
    pub fn frame_size(&self) -> [u32; 2] {
        [self.size[0], self.size[1].saturating_mul(u32::try_from(self.heads_deg.len()).unwrap_or(u32::MAX))]
    }

    /// Texels along each side: two pixels, one tile of the filter pattern, make one.
    #[must_use]
    pub fn texels(&self) -> [usize; 2] {
        self.size.map(|n| n as usize / 2)
    }

    /// Side of a texel on the sample, mm.
    #[must_use]
    pub fn texel_mm(&self) -> f64 {
        2.0 * self.pixel_mm
    }

    /// Checks every value against its bounds.
    ///
    /// # Errors
    /// [`FileError::Value`] with the first outside them.
    pub fn check(&self) -> Result<(), FileError> {
        if self.heads_deg.is_empty() || self.heads_deg.len() > 64 {
            return Err(FileError::value("texture.heads_deg", self.heads_deg.len(), "1 to 64 heads"));
        }
        if let Some(a) = self.heads_deg.iter().find(|a| !(-170.0..=170.0).contains(*a)) {
            return Err(FileError::value("texture.heads_deg", a, "degrees within ±170"));
        }
        if self.size.iter().any(|n| !(8..=1024).contains(n) || n % 2 != 0) {
            return Err(FileError::value("texture.size", self.size, "even numbers of pixels, 8 to 1024"));
        }
        if self.frame_size()[1] > 16384 {
            return Err(FileError::value(
                "texture.size",
                self.frame_size(),
                "at most 16384 rows over all heads",
            ));
        }
        if !(self.pixel_mm > 0.0 && self.pixel_mm <= 1.0) {
            return Err(FileError::value("texture.pixel_mm", self.pixel_mm, "above 0, at most 1"));
        }
        Ok(())
    }
}

impl Description {
    /// This instrument with its texture camera in place of its camera, and the plan of textures.
    ///
    /// # Errors
    /// [`FileError::Value`] for a texture camera or tilts that cannot be used.
    pub fn for_textures(&self) -> Result<Self, FileError> {
        let mut texture = self.texture.clone().unwrap_or_else(TextureCamera::standard);
        texture.check()?;
        texture.active = true;
        let mut out = self.clone();
        out.camera.size = texture.frame_size();
        if let Some(r) = &mut out.radiometry {
            // places on the instrument's own picture mean nothing on that of the heads
            (r.hot, r.dead, r.stray, r.flat) = (Vec::new(), Vec::new(), None, None);
        }
        let [low, high] = self.holder.tilt_limits_deg;
        out.plan.tilt_deg = texture.tilt_deg.iter().copied().filter(|t| (low..=high).contains(t)).collect();
        out.plan.spin_deg = vec![0.0];
        out.texture = Some(texture);
        out.plan.check(&out)?;
        Ok(out)
    }

    /// The texture camera where the frames are its own.
    #[must_use]
    pub fn textures(&self) -> Option<&TextureCamera> {
        self.texture.as_ref().filter(|t| t.active && t.frame_size() == self.camera.size)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::builtin;

    #[test]
    fn every_instrument_has_a_texture_camera_and_its_description_survives() {
        for name in ["reference", "tiny"] {
            let d = builtin::description(name).expect("known").expect("readable");
            assert!(d.textures().is_none());
            let t = d.for_textures().expect("sound");
            let heads = t.textures().expect("active").heads_deg.len() as u32;
            assert_eq!(t.camera.size[1] % heads, 0);
            assert_eq!(Description::from_toml(&t.to_toml().expect("writable")).expect("readable"), t);
        }
    }

    #[test]
    fn what_no_camera_has_is_named() {
        let good = TextureCamera::standard();
        for (bad, word) in [
            (TextureCamera { heads_deg: vec![], ..good.clone() }, "heads_deg"),
            (TextureCamera { heads_deg: vec![f64::NAN], ..good.clone() }, "heads_deg"),
            (TextureCamera { size: [9, 8], ..good.clone() }, "size"),
            (TextureCamera { pixel_mm: 0.0, ..good.clone() }, "pixel_mm"),
        ] {
            let message = bad.check().expect_err(word).to_string();
            assert!(message.contains(word), "{message}");
        }
    }
}
