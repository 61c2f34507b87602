//! From sessions to a radiometric calibration, each part from those that come before it.

use std::sync::Arc;

use gonio_brdf::Brdf;
use gonio_instrument::radiometry::{FlatField, Haze, Known, LampStability, Radiometry, StrayLight};
use gonio_instrument::{Certificate, Description, PoseRecord, ScanKind};

use super::RadiometryError;
use super::dark_current::DarkSeries;
use super::defects;
use super::face_fit::{self, Seen};
use super::gloss_scale::{self, GlossSeries};
use super::linearity::{self, Linearity};
use super::photon_transfer::{self, PhotonTransfer};
use super::series::{self, Level};
use super::stray::Stray;
use super::stray_fit::{self, Evidence};
use crate::error::AcquisitionError;
use crate::lamp;
use crate::merge::{MergedPose, check_frames};
use crate::merge_white::Merger;
use crate::options::Options;
use crate::pixel_map::PixelMap;
use crate::reference::{WhiteBuilder, WhiteReference, certified};
use crate::sensor::Sensor;

/// Largest θo of a pixel of a flat series, degrees: beyond, footprints reach past the spot.
const FLAT_LIMIT_DEG: f64 = 65.0;
/// Fewest pixels of a flat series.
const FLAT_PIXELS: usize = 1000;
/// Share of a frame's pixels at its largest count from which on that count is where the camera clips.
const CLIPPED_SHARE: f64 = 0.01;
/// Poses of black glass looked at for tails.
const GLOSS_POSES: usize = 12;
/// Gain uncertainty above which a calibration is not good, relative.
const GOOD_GAIN: f64 = 0.03;
/// Misfit of the photon-transfer curve above which it is not.
const GOOD_CHI2: f64 = 4.0;

/// A session that a calibration is made from.
pub struct Input<'a> {
    /// Its file name.
    pub name: String,
    /// What it is of.
    pub kind: ScanKind,
    /// Certificate of its reference sample.
    pub certificate: Option<Certificate>,
    /// What was accepted of it though it should not have been.
    pub notes: Vec<String>,
    /// Its poses, from the first each time.
    #[allow(clippy::type_complexity)] // an iterator that can be begun again
    pub poses: Box<dyn Fn() -> Box<dyn Iterator<Item = PoseRecord> + 'a> + 'a>,
}

/// Settings of a calibration.
#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    /// Refractive index of the black glass.
    pub index: f64,
}

impl Default for Settings {
    fn default() -> Self {
        Self { index: 1.567 }
    }
}

/// A calibration, with what its pictures show.
pub struct Calibrated {
    /// The description with the calibration in it.
    pub description: Description,
    /// The photon-transfer curve.
    pub transfer: PhotonTransfer,
    /// Dark current of each pixel, electrons per second.
    pub dark_map: Vec<f32>,
    /// Stray light as it was found.
    pub stray: Option<stray_fit::Found>,
    /// Gloss over Fresnel's reflectance: θi in degrees, ratio, relative uncertainty.
    pub gloss: Vec<[f64; 3]>,
}

impl Calibrated {
    /// The calibration itself.
    #[must_use]
    pub fn radiometry(&self) -> Radiometry {
        self.description.radiometry.clone().unwrap_or_default()
    }
}

/// Calibrates an instrument. A radiometric calibration that the description already holds takes no part, but for its version.
///
/// # Errors
/// [`RadiometryError`].
pub fn calibrate(
    description: &Description,
    inputs: &[Input<'_>],
    settings: &Settings,
) -> Result<Calibrated, RadiometryError> {
    let version = description.radiometry.as_ref().map_or(0, |r| r.version) + 1;
    let plain = Description { radiometry: None, ..description.clone() };
    let map = Arc::new(PixelMap::new(&plain));
    for input in inputs {
        // frames of another camera are told before anything is made of them
        if let Some(record) = (input.poses)().next() {
            check_frames(&record, &map).map_err(|e| in_session(input, e))?;
        }
    }
    let flat = inputs.iter().find(|i| i.kind == ScanKind::Flat).ok_or(RadiometryError::NoFlat)?;
    let nominal = Sensor::of(&plain, &Options::default());
    let mut dark = DarkSeries::default();
    for input in inputs {
        dark.add(&mut (input.poses)(), &nominal);
    }
    if dark.is_empty() {
        return Err(RadiometryError::NoDark);
    }
    let record = (flat.poses)().next().ok_or(RadiometryError::NoFlat)?;
    let mut radiometry = Radiometry {
        version,
        sessions: inputs.iter().map(|i| i.name.clone()).collect(),
        notes: inputs.iter().flat_map(|i| i.notes.iter().map(|n| format!("{}: {n}", i.name))).collect(),
        lamp: inputs.iter().filter_map(stability).collect(),
        hot: dark.hot(&nominal, map.width() * map.height()),
        ..Radiometry::default()
    };
    let transfer = sensor(&record, &map, &dark, &mut radiometry)?;
    let mut described = Description { radiometry: Some(radiometry), ..description.clone() };
    let stray = stray_light(&mut described, inputs)?;
    let gloss = references(&mut described, inputs, settings)?;
    let r = described.radiometry.get_or_insert_default();
    let gain_relative = r.electrons_per_count.iter().map(|g| g.sigma / g.value).fold(0.0, f64::max);
    r.good = gain_relative < GOOD_GAIN && transfer.reduced_chi2 < GOOD_CHI2;
    if !r.good {
        r.notes.push(format!(
            "not good: gain uncertain by {:.1} % (at most {} %), misfit of the photon-transfer curve {:.1} (at most {GOOD_CHI2})",
            100.0 * gain_relative,
            100.0 * GOOD_GAIN,
            transfer.reduced_chi2
        ));
    }
    let dark_map = dark.map(&Sensor::of(&described, &Options::default()), map.width() * map.height());
    Ok(Calibrated { description: described, transfer, dark_map, stray, gloss })
}

fn in_session(input: &Input<'_>, source: AcquisitionError) -> RadiometryError {
    RadiometryError::Session { session: input.name.clone(), source }
}

/// The lamp's monitor over a session.
fn stability(input: &Input<'_>) -> Option<LampStability> {
    let (mut means, mut within) = (Vec::new(), Vec::new());
    for record in (input.poses)() {
        let lit: Vec<f64> =
            record.exposures.iter().filter(|e| e.shutter_open).map(|e| e.lamp_monitor).collect();
        if lit.is_empty() {
            continue;
        }
        means.push(lit.iter().sum::<f64>() / lit.len() as f64);
        within.push(lamp::scatter(&lit));
    }
    (!means.is_empty()).then(|| LampStability {
        session: input.name.clone(),
        poses: means.len() as u32,
        drift: lamp::drift(&means),
        scatter: lamp::scatter(&means),
        within: (within.iter().map(|w| w * w).sum::<f64>() / within.len() as f64).sqrt(),
    })
}

/// Black level, dead pixels, linearity and gain from the flat series.
fn sensor(
    record: &PoseRecord,
    map: &PixelMap,
    dark: &DarkSeries,
    out: &mut Radiometry,
) -> Result<PhotonTransfer, RadiometryError> {
    let levels = series::levels(record)?;
    let camera = &map.description().camera;
    let rough_gain = camera.electrons_per_count();
    let (black, _, _) = dark.find(Known::new(rough_gain, 0.0));
    let mut usable = lit_pixels(map, record);
    let seen = usable.iter().filter(|u| **u).count();
    if seen < FLAT_PIXELS {
        return Err(RadiometryError::NoLight { found: seen, needed: FLAT_PIXELS });
    }
    out.hot.iter().for_each(|&p| usable[p as usize] = false);
    let response = respond(&levels, map, &usable, black.value, rough_gain)?;
    response.dead.iter().for_each(|&p| usable[p as usize] = false);
    let line = linearity::find(&levels, map, &usable, black.value, rough_gain)?;
    let transfer = photon_transfer::find(&levels, map, &usable, black.value, &line)
        .filter(|t| t.electrons_per_count.iter().all(|g| g.value.is_finite() && g.value < 1e6))
        .ok_or_else(|| RadiometryError::NoGain {
            reason: format!("{} levels are of use, and their variance does not grow with them", levels.len()),
        })?;
    let gain = transfer.electrons_per_count.iter().map(|g| g.value).sum::<f64>() / 3.0;
    let gain_sigma = transfer.electrons_per_count.iter().map(|g| g.sigma.powi(2)).sum::<f64>().sqrt() / 3.0;
    let (black, current, notes) = dark.find(Known::new(gain, gain_sigma));
    out.notes.extend(notes);
    out.black_level = black;
    out.dark = current;
    out.dead.clone_from(&response.dead);
    out.linearity = line.coefficients.to_vec();
    out.linearity_sigma =
        vec![0.0, line.covariance[0][0].max(0.0).sqrt(), line.covariance[1][1].max(0.0).sqrt()];
    out.linearity_levels.clone_from(&line.levels);
    out.electrons_per_count = transfer.electrons_per_count;
    out.read_noise_e = transfer.read_noise_e;
    let (clipped, reached) = clip(&levels, camera.top_code());
    (out.clipped_at, out.full_well_reached) = (clipped, reached);
    out.full_well_e = full_well(clipped, &line, out, map);
    if !reached {
        out.notes.push(format!(
            "no exposure of the flat series saturates: the full well is at least {:.0} electrons; add a longer exposure",
            out.full_well_e.value
        ));
    }
    Ok(transfer)
}

/// Pixels that see the sample in even light, some tiles away from every edge.
fn lit_pixels(map: &PixelMap, record: &PoseRecord) -> Vec<bool> {
    let view = map.view(record.readback);
    let limit = FLAT_LIMIT_DEG.to_radians().cos();
    let far = stray_fit::pixels_from(map, |p| !view.visible[p]);
    let margin = (map.width() / 200).max(2);
    (0..view.visible.len())
        .map(|p| {
            far[p] >= margin && view.visible[p] && view.sample_from_lab.apply(map.direction(p)).z > limit
        })
        .collect()
}

/// Dead pixels and the spread of sensitivities, from the brightest exposures that do not saturate.
fn respond(
    levels: &[Level<'_>],
    map: &PixelMap,
    usable: &[bool],
    black: f64,
    electrons_per_count: f64,
) -> Result<defects::Response, RadiometryError> {
    let camera = &map.description().camera;
    let range = f64::from(camera.top_code() - camera.black_level);
    let bright = levels.iter().rev().find_map(|l| {
        let mean = series::mean(&l.lit, usable.len());
        let mut of: Vec<f32> = (0..usable.len()).filter(|&p| usable[p]).map(|p| mean[p]).collect();
        of.sort_unstable_by(f32::total_cmp);
        let high = (f64::from(*of.get(of.len() * 99 / 100)?) - black) / range;
        ((0.02..linearity::USED).contains(&high)).then_some((l, mean))
    });
    let Some((level, mean)) = bright else {
        return Err(RadiometryError::Saturated { exposures: levels.len(), usable: 0 });
    };
    let signal: Vec<f32> =
        mean.iter().zip(usable).map(|(m, u)| if *u { m - black as f32 } else { f32::NAN }).collect();
    let per_signal = 1.0 / (electrons_per_count * level.lit.len() as f64);
    Ok(defects::find(&signal, map, |p| per_signal / f64::from(signal[p]).max(1.0)))
}

/// The count at which the camera clips, and whether it was seen to.
fn clip(levels: &[Level<'_>], top: u32) -> (u32, bool) {
    for e in levels.iter().flat_map(|l| &l.lit) {
        let largest = e.frame.pixels.iter().copied().max().unwrap_or(0);
        let n = e.frame.pixels.iter().filter(|v| **v == largest).count();
        if n as f64 > CLIPPED_SHARE * e.frame.pixels.len() as f64 && u32::from(largest) > top / 4 {
            return (u32::from(largest), true);
        }
    }
    // never clipped: only the converter's end is known
    (top, false)
}

fn full_well(clipped: u32, line: &Linearity, r: &Radiometry, map: &PixelMap) -> Known {
    let camera = &map.description().camera;
    let range = f64::from(camera.top_code() - camera.black_level);
    let x = (f64::from(clipped) - r.black_level.value) / range;
    let gain = r.electrons_per_count.iter().map(|g| g.value).sum::<f64>() / 3.0;
    let relative = r.electrons_per_count.iter().map(|g| g.sigma / g.value).fold(0.0, f64::max);
    let value = gain * range * line.apply(x);
    let [[a, b], [_, c]] = line.covariance;
    let bend = (a * x.powi(4) + 2.0 * b * x.powi(5) + c * x.powi(6)).max(0.0).sqrt() * gain * range;
    Known::new(value, (value * relative).hypot(bend))
}

/// Merged poses of a session, each with everything in the picture.
fn merged<'a>(
    input: &'a Input<'_>,
    map: &Arc<PixelMap>,
) -> impl Iterator<Item = Result<(PoseRecord, MergedPose), RadiometryError>> + 'a {
    let all = vec![true; map.width() * map.height()];
    let mut merger = Merger::new(map.clone(), &Options::default());
    (input.poses)().filter_map(move |mut record| match merger.add(&record, &all) {
        Ok(Some((merged, _))) => {
            record.exposures.clear();
            Some(Ok((record, merged)))
        }
        Ok(None) => None,
        Err(e) => Some(Err(in_session(input, e))),
    })
}

/// A pose with its picture, what stray light left colour by colour, the lamp's scatter.
type Corrected = (PoseRecord, MergedPose, [f64; 3], f64);

/// Haze, glare, tails and the camera's own face; they are set in the description.
fn stray_light(
    d: &mut Description,
    inputs: &[Input<'_>],
) -> Result<Option<stray_fit::Found>, RadiometryError> {
    let map = Arc::new(PixelMap::new(d));
    let of = |kinds: &'static [ScanKind]| inputs.iter().filter(move |i| kinds.contains(&i.kind));
    let mut notes = Vec::new();
    let mut light = StrayLight::default();
    let mut hazes: Vec<Haze> = Vec::new();
    for input in of(&[ScanKind::Trap]) {
        for pose in merged(input, &map) {
            hazes.push(stray_fit::haze(&pose?.1.pixels, &map));
        }
    }
    light.haze = stray_fit::mean_haze(&hazes);
    if hazes.is_empty() {
        notes.push("light that comes past the sample is not known: add a session of --kind trap".to_owned());
    }
    let without_haze = Stray::new(&map, light.clone());
    let mut evidence = Vec::new();
    // a black sample sends too little: what haze is uncertain by would count
    for input in of(&[ScanKind::White]) {
        for pose in merged(input, &map) {
            let (record, mut m) = pose?;
            without_haze.correct(&mut m.pixels, &map);
            evidence.push(Evidence::of_blind(&m.pixels, &map.view(record.readback), &map));
        }
    }
    for input in of(&[ScanKind::BlackGlass, ScanKind::BlackGlassWedge]) {
        let step = (input.poses)().count().div_ceil(GLOSS_POSES).max(1);
        for (k, pose) in merged(input, &map).enumerate() {
            let (_, mut m) = pose?;
            if k % step == 0 {
                without_haze.correct(&mut m.pixels, &map);
                evidence.extend(Evidence::of_gloss(&m.pixels, &map));
            }
        }
    }
    let found = stray_fit::find(&evidence, &map);
    match &found {
        Some(f) => {
            (light.glare, light.tail_share, light.tail_radius_mm) = (f.glare, f.tail_share, f.tail_radius_mm);
            if !f.from_gloss {
                notes.push(
                    "tails of the point image come from the edges of light alone: add a session of --kind black-glass".to_owned(),
                );
            }
        }
        None => notes.push(
            "veiling glare and tails are not known: add sessions of --kind white and --kind black-glass"
                .to_owned(),
        ),
    }
    let spread = Stray::new(&map, light.clone());
    let kinds = [ScanKind::White, ScanKind::Black];
    let mut brdfs: [Option<(Box<dyn Brdf>, f64)>; 2] = [None, None];
    for (slot, kind) in brdfs.iter_mut().zip(kinds) {
        if let Some((input, c)) =
            inputs.iter().filter(|i| i.kind == kind).find_map(|i| Some((i, i.certificate.as_ref()?)))
        {
            *slot = Some((certified(c).map_err(|e| in_session(input, e))?, c.relative_uncertainty));
        }
    }
    if let [Some((white, white_u)), Some((black, black_u))] = &brdfs {
        let see = |kind: ScanKind| -> Result<Vec<Corrected>, RadiometryError> {
            let Some(input) = inputs.iter().find(|i| i.kind == kind && i.certificate.is_some()) else {
                return Ok(Vec::new());
            };
            let lamp = stability(input).map_or(0.0, |s| s.scatter);
            merged(input, &map)
                .map(|pose| {
                    let (record, mut m) = pose?;
                    let left = spread.correct(&mut m.pixels, &map);
                    Ok((record, m, left, lamp))
                })
                .collect()
        };
        let as_seen = |poses: Vec<Corrected>, brdf, certificate| -> Vec<Seen<'_>> {
            poses
                .into_iter()
                .map(|(record, m, left, lamp)| Seen {
                    pose: record.readback,
                    pixels: m.pixels,
                    brdf,
                    certificate,
                    left,
                    lamp,
                })
                .collect()
        };
        let white = as_seen(see(kinds[0])?, white.as_ref(), *white_u);
        let black = as_seen(see(kinds[1])?, black.as_ref(), *black_u);
        light.face = face_fit::find(&white, &black, &map);
        if light.face.is_none() {
            notes.push(
                "what the camera's face throws back is not known: the black and the white session share no tilt"
                    .to_owned(),
            );
        }
    } else {
        notes.push(
            "what the camera's face throws back is not known: add sessions of --kind white and --kind black, both certified"
                .to_owned(),
        );
    }
    let r = d.radiometry.get_or_insert_default();
    r.notes.extend(notes);
    if light != StrayLight::default() {
        r.stray = Some(light);
    }
    Ok(found)
}

/// Flat field and gloss scale, with stray light taken off; they are set in the description.
fn references(
    d: &mut Description,
    inputs: &[Input<'_>],
    settings: &Settings,
) -> Result<Vec<[f64; 3]>, RadiometryError> {
    let map = Arc::new(PixelMap::new(d));
    let mut notes = Vec::new();
    let white =
        inputs.iter().filter(|i| i.kind == ScanKind::White).find_map(|i| Some((i, i.certificate.as_ref()?)));
    let Some((input, certificate)) = white else {
        d.radiometry.get_or_insert_default().notes.push(
            "flat field and gloss scale are not known: add a session of --kind white with its certificate"
                .to_owned(),
        );
        return Ok(Vec::new());
    };
    let told = |e: AcquisitionError| in_session(input, e);
    let mut builder = WhiteBuilder::new(map.clone(), certificate, input.notes.clone(), &Options::default())
        .map_err(told)?;
    for record in (input.poses)() {
        builder.add_pose(&record).map_err(told)?;
    }
    let white = builder.finish().map_err(told)?;
    let mut gloss = GlossSeries::default();
    for input in inputs.iter().filter(|i| i.kind == ScanKind::BlackGlass) {
        let mut poses = (input.poses)();
        gloss_scale::seen(&mut poses, &map, &white, &mut |g, values, view, mean_cos| {
            gloss.add(g, values, &map, view, settings.index, mean_cos);
        })
        .map_err(|e| in_session(input, e))?;
    }
    let common = white.certificate_uncertainty.hypot(white.lamp_relative).hypot(white.stray_relative);
    let scale = gloss.finish(settings.index, common, d.lamp.half_angle_deg);
    if scale.is_none() {
        notes.push("the scale of a gloss is not known: add a session of --kind black-glass".to_owned());
    } else if scale.as_ref().is_some_and(|s| s.half_angle_deg.is_none()) {
        notes.push("the camera's pixels are too coarse to show the lamp's profile".to_owned());
    }
    let flat = flat_field(&white, &map);
    let r = d.radiometry.get_or_insert_default();
    r.flat = Some(flat);
    r.gloss = scale;
    r.notes.extend(notes);
    Ok(gloss.points.iter().map(|p| [p.0.degrees(), p.1, p.2]).collect())
}

fn flat_field(white: &WhiteReference, map: &PixelMap) -> FlatField {
    let w = map.width();
    let mut of: [Vec<f64>; 3] = Default::default();
    let (mut signal, mut noise) = (vec![f32::NAN; white.scale.len()], (0.0, 0.0));
    for (p, k) in white.scale.iter().enumerate().filter(|(_, k)| k.is_finite()) {
        let etendue = map.optics().etendue((p % w) as f64 + 0.5, (p / w) as f64 + 0.5);
        of[map.channel(p)].push(f64::from(*k) / etendue.max(1e-9));
        signal[p] = *k;
        noise.0 += f64::from(white.relative_variance[p]);
        noise.1 += 1.0;
    }
    let covered = noise.1 / white.scale.len().max(1) as f64;
    let relative = noise.0 / f64::max(noise.1, 1.0);
    let scale = of.map(|mut v| {
        v.sort_unstable_by(f64::total_cmp);
        v.get(v.len() / 2).copied().unwrap_or(0.0)
    });
    let response = defects::find(&signal, map, |p| f64::from(white.relative_variance[p]));
    FlatField {
        serial: white.serial.clone(),
        scale,
        pixel_sigma: relative.sqrt(),
        certificate: white.certificate_uncertainty,
        covered,
        pixel_response: response.spread,
    }
}
