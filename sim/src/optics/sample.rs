//! What lies on the holder: a truth, or one of the reference samples.

use std::sync::Arc;

use gonio_brdf::{Brdf, Measured, ModelError, ModelFile};
use gonio_instrument::{Certificate, ScanKind};
use gonio_optics::Angle;

use super::holder::Wedge;
use crate::flakes::Field;
use crate::truth::Truth;

/// Refractive index of the black glass.
pub const BLACK_GLASS_INDEX: f64 = 1.567;

/// Albedo of the black reference: what good black paint or a light trap leaves.
pub const BLACK_ALBEDO: f64 = 1e-4;

/// Angle of the wedge under the black glass, which the evaluation must do without knowing.
pub const WEDGE_ANGLE: Angle = Angle::from_degrees(21.3);

/// Azimuth of the wedge's lean in the sample frame.
pub const WEDGE_AZIMUTH: Angle = Angle::from_degrees(180.0);

/// A sample on the holder.
pub struct Sample {
    /// The reflectance without the gloss of a smooth surface.
    pub base: Box<dyn Brdf>,
    /// Refractive index of the smooth surface, where there is one: its gloss is the mirror image of the lamp.
    pub gloss_index: Option<f64>,
    /// How it leans on the holder.
    pub wedge: Option<Wedge>,
    /// Its single flakes, where it has any; `base` is their mean.
    pub flakes: Option<Arc<Field>>,
    /// Number that keys the noise, so that two samples at the same pose and exposure do not share theirs.
    pub noise_key: u64,
}

impl std::fmt::Debug for Sample {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Sample")
            .field("gloss_index", &self.gloss_index)
            .field("wedge", &self.wedge)
            .field("noise_key", &self.noise_key)
            .finish_non_exhaustive()
    }
}

impl Sample {
    /// What lies on the holder in a scan of this kind: the truth, or the reference that the kind asks for. A dark scan leaves the sample where
    /// it is; the shutter is closed. Each kind has noise of its own.
    ///
    /// # Errors
    /// [`ModelError`] if the certificate's BRDF cannot be read.
    pub fn of_kind(kind: ScanKind, truth: &Truth, white: &Certificate) -> Result<Self, ModelError> {
        let sample = match kind {
            ScanKind::Sample | ScanKind::Dark => truth.sample(),
            ScanKind::White | ScanKind::Flat => Self::model(ModelFile::from_json(&white.brdf)?),
            ScanKind::Black => Self::model(ModelFile::from_json(&Certificate::virtual_black().brdf)?),
            ScanKind::Trap => Self::diffuser(0.0),
            ScanKind::BlackGlass => Self::glass(BLACK_GLASS_INDEX),
            ScanKind::BlackGlassWedge => Self::glass(BLACK_GLASS_INDEX).on_wedge(WEDGE_ANGLE, WEDGE_AZIMUTH),
        };
        Ok(sample.with_noise_key(Self::noise_key_of(kind)))
    }

    /// Any BRDF without a smooth surface.
    #[must_use]
    pub fn rough(base: Box<dyn Brdf>) -> Self {
        Self { base, gloss_index: None, wedge: None, flakes: None, noise_key: 0 }
    }

    /// A `model.json`; its coat, if any, is smooth.
    #[must_use]
    pub fn model(file: ModelFile) -> Self {
        let gloss_index = file.coat.as_ref().map(|c| c.index);
        Self { gloss_index, ..Self::rough(Box::new(file)) }
    }

    /// A paint with flakes under a smooth coat.
    #[must_use]
    pub fn flakes(field: &Arc<Field>) -> Self {
        Self {
            gloss_index: Some(field.paint().coat_index),
            flakes: Some(Arc::clone(field)),
            ..Self::rough(Box::new(field.mean()))
        }
    }

    /// A measured table, interpolated between its nodes.
    #[must_use]
    pub fn table(table: Measured) -> Self {
        Self::rough(Box::new(table))
    }

    /// A perfect diffuser of one albedo.
    #[must_use]
    pub fn diffuser(albedo: f64) -> Self {
        Self::rough(Box::new(Diffuser(albedo)))
    }

    /// A smooth glass that swallows whatever enters it.
    #[must_use]
    pub fn glass(index: f64) -> Self {
        Self { gloss_index: Some(index), ..Self::diffuser(0.0) }
    }

    /// The same sample leaning on a wedge.
    #[must_use]
    pub fn on_wedge(mut self, angle: Angle, azimuth: Angle) -> Self {
        self.wedge = Some(Wedge { angle, azimuth });
        self
    }

    /// The same sample with another key for its noise.
    #[must_use]
    pub fn with_noise_key(mut self, key: u64) -> Self {
        self.noise_key = key;
        self
    }

    /// Lambert's law with the albedo of the black reference.
    #[must_use]
    pub fn black() -> Self {
        Self::diffuser(BLACK_ALBEDO)
    }

    /// Key of the noise of a kind of scan.
    #[must_use]
    pub const fn noise_key_of(kind: ScanKind) -> u64 {
        match kind {
            ScanKind::Sample => 0,
            ScanKind::White => 1,
            ScanKind::BlackGlass => 2,
            ScanKind::BlackGlassWedge => 3,
            ScanKind::Dark => 4,
            ScanKind::Flat => 5,
            ScanKind::Black => 6,
            ScanKind::Trap => 7,
        }
    }
}

/// Lambert's law, f = albedo/π, the same in every channel.
struct Diffuser(f64);

impl Brdf for Diffuser {
    fn eval(&self, light: gonio_optics::Vec3, view: gonio_optics::Vec3) -> gonio_brdf::Rgb {
        if light.z <= 0.0 || view.z <= 0.0 { [0.0; 3] } else { [self.0 * std::f64::consts::FRAC_1_PI; 3] }
    }
}
