//! The white reference: what a pixel gives for a known reflectance, `k(p) · E0 · g` in electrons per second · sr.
//!
//! rate = k E0 g · ∫_lamp f cos θ' dω'/Ω_lamp. Every white pose in which a pixel sees the reference steeply enough
//! contributes; poses are put together as Poisson counts are, `Σ X rate / Σ X a` with the effective exposure X and
//! a the lamp's mean of f cos θ'. The relative variance of k stays with the pixel, the certificate's with the table.

mod strangers;

use std::sync::Arc;

use gonio_brdf::formats::measured_csv;
use gonio_brdf::{Brdf, Flag, ModelFile, Rgb};
use gonio_instrument::{Certificate, Description, PoseRecord};
use gonio_optics::{Vec3, quadrature};
use rayon::prelude::*;

use crate::dark::{DarkFrames, DarkModel};
use crate::error::AcquisitionError;
use crate::lamp::Scatter;
use crate::merge::merge;
use crate::options::Options;
use crate::pixel_map::PixelMap;
use crate::radiometry::{face, stray::Stray};
use crate::sensor::Sensor;

/// Largest θo at which a white pixel is trusted, degrees: beyond, footprint and certificate both grow uncertain.
pub const WHITE_LIMIT_DEG: f64 = 77.0;

/// Smallest lit share of a footprint at which a white pixel is trusted.
const LEAST_LIT: f64 = 0.5;

/// Every so many pixels one is held against the law of cos θi; no multiple of a row, so that all colours take part.
const LAW_STRIDE: usize = 7;

/// The calibration of every pixel.
#[derive(Clone, Debug)]
pub struct WhiteReference {
    /// k E0 g, electrons/s · sr; NaN where no white pose shows the pixel the reference.
    pub scale: Vec<f32>,
    /// Relative variance of `scale`.
    pub relative_variance: Vec<f32>,
    /// Relative standard uncertainty of the certificate, common to everything.
    pub certificate_uncertainty: f64,
    /// How much the lamp's monitor scattered from pose to pose.
    pub lamp: Scatter,
    /// Per pixel what is left of one reading's scatter in `scale`: one over the root of the poses that it is known from. 0 where it is not known.
    pub lamp_share: Vec<f32>,
    /// Serial number of the reference.
    pub serial: String,
    /// What was accepted though it should not have been; stands in the attributes.
    pub notes: Vec<String>,
    /// Relative standard uncertainty that stray light left, common to everything.
    pub stray_relative: f64,
    /// Over κ of the camera's face, how much brighter the reference looks for its own light thrown back: what κ is uncertain by, its scale errs by. 0 where
    /// no calibration tells κ.
    pub own_light: f64,
    /// How each pose's light compares with that of all: the law of cos θi.
    pub law: Vec<LawPoint>,
}

impl WhiteReference {
    /// What is left of one reading's scatter over the pixels that are `used`, root mean square: they share most of it.
    #[must_use]
    pub fn share_of_lamp(&self, used: impl Fn(usize) -> bool) -> f64 {
        let known = self.lamp_share.iter().enumerate().filter(|(p, s)| **s > 0.0 && used(*p));
        let (sum, n) = known.fold((0.0, 0.0f64), |(sum, n), (_, s)| (sum + f64::from(*s).powi(2), n + 1.0));
        (sum / n.max(1.0)).sqrt()
    }

    /// Relative standard uncertainty that all cells share by this reference: certificate, lamp, stray light, and what a description's κ leaves of the
    /// light that the reference sent back to itself. `lamp` is how much the lamp's monitor scatters from pose to pose.
    #[must_use]
    pub fn common_relative(&self, description: &Description, lamp: Scatter) -> f64 {
        let stray = description.radiometry.as_ref().and_then(|r| r.stray.as_ref());
        let kappa = stray.and_then(|s| s.face).map_or(0.0, |k| k.sigma);
        self.certificate_uncertainty
            .hypot(self.share_of_lamp(|_| true) * lamp.sigma)
            .hypot(self.stray_relative)
            .hypot(kappa * self.own_light)
    }
}

/// What a pose of the white reference gives against what all of them together give, by pixels that others see too.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LawPoint {
    /// Angle of incidence, degrees.
    pub theta_i_deg: f64,
    /// Median over the pixels of measured over expected, less 1.
    pub departure: f64,
    /// Its standard uncertainty from noise.
    pub sigma: f64,
}

/// The BRDF of a certificate.
///
/// # Errors
/// [`AcquisitionError::Certificate`] for a model that cannot be read, [`AcquisitionError::CertificateTable`] for a table that cannot.
pub fn certified(certificate: &Certificate) -> Result<Box<dyn Brdf>, AcquisitionError> {
    let text = certificate.brdf.trim_start();
    if !text.starts_with("theta_i_deg") {
        let model = ModelFile::from_json(&certificate.brdf)
            .map_err(|source| AcquisitionError::Certificate { serial: certificate.serial.clone(), source })?;
        return Ok(Box::new(model));
    }
    let refused =
        |reason: String| AcquisitionError::CertificateTable { serial: certificate.serial.clone(), reason };
    match measured_csv::read(text.as_bytes()).map_err(|e| refused(e.to_string()))? {
        measured_csv::Contents::Scattered(_) => Err(refused(
            "it holds scattered points, which have no value in between; give a product grid".into(),
        )),
        measured_csv::Contents::Table(t) if t.flag.contains(&Flag::Invalid) => {
            Err(refused("cells of it have no value; give a complete grid".into()))
        }
        measured_csv::Contents::Table(t) => Ok(t),
    }
}

/// Sums over white poses.
pub struct WhiteBuilder {
    map: Arc<PixelMap>,
    sensor: Sensor,
    brdf: Box<dyn Brdf>,
    /// Takes stray light off, where the instrument's calibration knows of any.
    stray: Option<Stray>,
    /// What the reference sends back of light from all around, where the camera's face throws light back.
    returned: Option<(f64, Vec<Rgb>)>,
    /// Relative uncertainty that stray light leaves, pose by pose.
    stray_relative: Vec<f64>,
    /// [`WhiteReference::own_light`] pose by pose.
    own_light: Vec<f64>,
    law: Vec<(f64, Vec<(u32, f32)>)>,
    certificate: Certificate,
    notes: Vec<String>,
    dark_frames: DarkFrames,
    dark: DarkModel,
    sums: Vec<Sums>,
    /// Mean lamp monitor of each pose.
    monitors: Vec<f64>,
    poses: u32,
}

#[derive(Clone, Copy, Default)]
struct Sums {
    rate: f64,
    expected: f64,
    /// Of the poses' shares in `expected`: how few poses a pixel stands on.
    expected2: f64,
    variance: f64,
    dark_sigma: f64,
}

/// Holds a reference against the instrument in use and the day. Returns what was accepted in spite of a finding.
///
/// # Errors
/// [`AcquisitionError::Expired`], [`AcquisitionError::OtherInstrument`] unless `accept_stale`.
pub fn validate(
    certificate: &Certificate,
    measured_on: &Description,
    instrument: &Description,
    today: &str,
    accept_stale: bool,
) -> Result<Vec<String>, AcquisitionError> {
    let mut findings = Vec::new();
    if certificate.expired(today) {
        findings.push(AcquisitionError::Expired {
            serial: certificate.serial.clone(),
            expires: certificate.expires.clone(),
            today: today.to_owned(),
        });
    }
    let differs = if measured_on.name != instrument.name {
        Some("name")
    } else if measured_on.camera != instrument.camera {
        Some("camera")
    } else if measured_on.mirror != instrument.mirror {
        Some("mirror")
    } else if measured_on.lamp != instrument.lamp {
        Some("lamp")
    } else if measured_on.holder != instrument.holder {
        Some("holder")
    } else {
        None
    };
    if let Some(part) = differs {
        findings.push(AcquisitionError::OtherInstrument {
            found: measured_on.name.clone(),
            expected: instrument.name.clone(),
            part,
        });
    }
    let mut notes = Vec::new();
    for f in findings {
        if !accept_stale {
            return Err(f);
        }
        // no clock in the attributes: the finding without the day it was made
        notes.push(match &f {
            AcquisitionError::Expired { serial, expires, .. } => {
                format!("accepted though stale: certificate of {serial} expired on {expires}")
            }
            AcquisitionError::OtherInstrument { found, part, .. } => {
                format!("accepted though stale: reference measured on instrument {found}, {part} differs")
            }
            other => other.to_string(),
        });
    }
    Ok(notes)
}

impl WhiteBuilder {
    /// Nothing seen yet. `notes` come from [`validate`].
    ///
    /// # Errors
    /// [`AcquisitionError::Certificate`] when the certified BRDF cannot be read.
    pub fn new(
        map: Arc<PixelMap>,
        certificate: &Certificate,
        notes: Vec<String>,
        options: &Options,
    ) -> Result<Self, AcquisitionError> {
        let brdf = certified(certificate)?;
        let pixels = map.width() * map.height();
        let stray = Stray::of(&map);
        let kappa = stray.as_ref().and_then(|s| s.light().face).map(|k| k.value);
        let sensor = Sensor::of(map.description(), options);
        Ok(Self {
            returned: kappa.map(|k| (k, face::from_all_around(brdf.as_ref()))),
            stray,
            stray_relative: Vec::new(),
            own_light: Vec::new(),
            law: Vec::new(),
            dark: DarkFrames::default().model(&sensor, pixels),
            sensor,
            map,
            brdf,
            certificate: certificate.clone(),
            notes,
            dark_frames: DarkFrames::default(),
            sums: vec![Sums::default(); pixels],
            monitors: Vec::new(),
            poses: 0,
        })
    }

    /// Adds a pose; its dark frames serve from here on. Poses without light (dark ones) only bring those.
    ///
    /// # Errors
    /// [`AcquisitionError`] for frames of the wrong size.
    pub fn add_pose(&mut self, record: &PoseRecord) -> Result<(), AcquisitionError> {
        crate::merge::check_frames(record, &self.map)?;
        let mut fresh = false;
        for e in record.exposures.iter().filter(|e| !e.shutter_open) {
            self.dark_frames.add(&e.frame, &self.sensor);
            fresh = true;
        }
        if fresh {
            self.dark = self.dark_frames.model(&self.sensor, self.sums.len());
        }
        if record.exposures.iter().all(|e| !e.shutter_open) {
            return Ok(());
        }
        let view = self.map.view(record.readback);
        let cos_limit = WHITE_LIMIT_DEG.to_radians().cos();
        let wanted: Vec<bool> = (0..self.sums.len())
            .into_par_iter()
            .map(|p| view.visible[p] && view.sample_from_lab.apply(self.map.direction(p)).z > cos_limit)
            .collect();
        let mut merged = match &self.stray {
            // the whole picture: light comes astray from pixels that are not asked for, too
            Some(_) => merge(record, &self.map, &self.sensor, &self.dark, &vec![true; self.sums.len()])?,
            None => merge(record, &self.map, &self.sensor, &self.dark, &wanted)?,
        };
        let left = self.stray.as_ref().map(|s| s.correct(&mut merged.pixels, &self.map));
        let d = self.map.description();
        let light = Vec3::from_polar(view.theta_i, gonio_optics::Angle::ZERO);
        let lights = quadrature::cone(light, d.lamp.half_angle(), 1);
        let (map, brdf) = (&self.map, &self.brdf);
        let returned = self
            .returned
            .as_ref()
            .map(|(k, r)| (face::onto_face(brdf.as_ref(), map, record.readback).map(|s| k * s * light.z), r));
        if self.returned.is_some() {
            self.own_light.push(face::own_light(brdf.as_ref(), map, record.readback));
        }
        let expected_at = |p: usize| -> Option<f64> {
            let v = view.sample_from_lab.apply(map.direction(p));
            let channel = map.channel(p);
            let mut mean: f64 = lights.iter().map(|l| brdf.eval(*l, v)[channel] * l.z.max(0.0)).sum::<f64>()
                / lights.len() as f64;
            if let Some((s, r)) = &returned {
                mean += s[channel] * face::at_view(r, v.z)[channel];
            }
            let lit = map.lit_share(p, &view.sample_from_lab, light.z);
            (lit >= LEAST_LIT).then_some(mean * lit)
        };
        let mut law = Vec::new();
        let mut brightest = 0.0f64;
        for p in (0..merged.pixels.len()).step_by(LAW_STRIDE).filter(|&p| wanted[p]) {
            let m = merged.pixels[p];
            if let Some(a) = expected_at(p).filter(|a| m.is_valid() && *a > 0.0) {
                law.push((p as u32, (f64::from(m.rate) / a) as f32));
                brightest = brightest.max(f64::from(m.rate));
            }
        }
        self.law.push((view.theta_i.degrees(), law));
        if let Some(left) = left {
            self.stray_relative.push(left.iter().fold(0.0, |a: f64, b| a.max(*b)) / brightest.max(1e-9));
        }
        self.sums.par_iter_mut().enumerate().with_min_len(4096).for_each(|(p, sum)| {
            let m = merged.pixels[p];
            if !m.is_valid() || !wanted[p] {
                return;
            }
            let Some(a) = expected_at(p) else { return };
            let x = f64::from(m.exposure);
            sum.rate += x * f64::from(m.rate);
            sum.expected += x * a;
            sum.expected2 += (x * a).powi(2);
            sum.variance += x * x * f64::from(m.shot + m.read);
            // the dark signal is one and the same in every pose
            sum.dark_sigma += x * f64::from(m.dark).sqrt();
        });
        let lit: Vec<f64> =
            record.exposures.iter().filter(|e| e.shutter_open).map(|e| e.lamp_monitor).collect();
        self.monitors.push(lit.iter().sum::<f64>() / lit.len().max(1) as f64);
        self.poses += 1;
        Ok(())
    }

    /// The calibration.
    ///
    /// # Errors
    /// [`AcquisitionError::EmptyReference`] when no pixel ever saw the reference.
    pub fn finish(self) -> Result<WhiteReference, AcquisitionError> {
        let (scale, relative_variance): (Vec<f32>, Vec<f32>) = self
            .sums
            .iter()
            .map(|s| {
                if s.expected > 0.0 && s.rate > 0.0 {
                    let variance = (s.variance + s.dark_sigma * s.dark_sigma) / (s.rate * s.rate);
                    ((s.rate / s.expected) as f32, variance as f32)
                } else {
                    (f32::NAN, 0.0)
                }
            })
            .unzip();
        if scale.iter().all(|k| k.is_nan()) {
            return Err(AcquisitionError::EmptyReference);
        }
        let lamp_share = self
            .sums
            .iter()
            .map(|s| if s.expected > 0.0 { (s.expected2.sqrt() / s.expected) as f32 } else { 0.0 })
            .collect();
        let mut scale = scale;
        let law = self.law(&scale);
        let stray_relative =
            self.stray_relative.iter().sum::<f64>() / self.stray_relative.len().max(1) as f64;
        let strangers = strangers::drop(&self.map, &mut scale, &relative_variance);
        let mut notes = self.notes;
        if strangers > 0 {
            notes.push(format!(
                "{strangers} pixels see the reference darker or brighter than those around them by more than {} %: not used",
                strangers::STRANGE * 100.0
            ));
        }
        Ok(WhiteReference {
            scale,
            relative_variance,
            certificate_uncertainty: self.certificate.relative_uncertainty,
            lamp: Scatter::of(&self.monitors),
            lamp_share,
            serial: self.certificate.serial,
            notes,
            law,
            stray_relative,
            own_light: self.own_light.iter().sum::<f64>() / self.own_light.len().max(1) as f64,
        })
    }

    /// Each pose against all.
    fn law(&self, scale: &[f32]) -> Vec<LawPoint> {
        let shared = |p: usize| {
            let s = &self.sums[p];
            s.expected > 0.0 && s.expected2 < 0.98 * s.expected * s.expected
        };
        self.law
            .iter()
            .filter_map(|(theta_i_deg, pixels)| {
                let mut ratios: Vec<f64> = pixels
                    .iter()
                    .filter(|(p, _)| shared(*p as usize) && scale[*p as usize].is_finite())
                    .map(|(p, r)| f64::from(*r) / f64::from(scale[*p as usize]))
                    .collect();
                ratios.sort_unstable_by(f64::total_cmp);
                let n = ratios.len();
                let median = *ratios.get(n / 2)?;
                let spread = 0.5 * (ratios[n - 1 - n / 6] - ratios[n / 6]);
                (n >= 20).then(|| LawPoint {
                    theta_i_deg: *theta_i_deg,
                    departure: median - 1.0,
                    sigma: 1.25 * spread / (n as f64).sqrt(),
                })
            })
            .collect()
    }
}
