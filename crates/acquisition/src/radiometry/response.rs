//! What a flat series shows of the sensor: black level, dead pixels, linearity, gain, full well.

use gonio_instrument::PoseRecord;
use gonio_instrument::radiometry::{Known, Radiometry};

use super::RadiometryError;
use super::dark_current::DarkSeries;
use super::defects;
use super::distance;
use super::linearity::{self, Linearity};
use super::photon_transfer::{self, PhotonTransfer};
use super::series::{self, Level};
use crate::pixel_map::PixelMap;

/// Largest θo of a pixel of a flat series, degrees: beyond, footprints reach past the spot.
const FLAT_LIMIT_DEG: f64 = 65.0;
/// Fewest pixels of a flat series.
const FLAT_PIXELS: usize = 1000;
/// Share of a frame's pixels at its largest count from which on that count is where the camera clips.
const CLIPPED_SHARE: f64 = 0.01;

/// What later parts need besides.
pub(super) struct Shown {
    /// The photon-transfer curve.
    pub transfer: PhotonTransfer,
    /// Relative standard deviation of the pixels' sensitivities.
    pub spread: f64,
    /// Relative uncertainty of bright against faint light that the linearisation leaves.
    pub bend: f64,
}

/// Black level, dead pixels, linearity and gain from the flat series.
pub(super) fn find(
    record: &PoseRecord,
    map: &PixelMap,
    dark: &DarkSeries,
    out: &mut Radiometry,
) -> Result<Shown, RadiometryError> {
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
    let (black, current, notes) = dark.find(transfer.mean);
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
    out.full_well_e = full_well(clipped, &line, out, &transfer, map);
    if !reached {
        out.notes.push(format!(
            "no exposure of the flat series saturates: the full well is at least {:.0} electrons; add a longer exposure",
            out.full_well_e.value
        ));
    }
    Ok(Shown { transfer, spread: response.spread.value, bend: line.bend() })
}

/// Pixels that see the sample in even light, some tiles away from every edge.
fn lit_pixels(map: &PixelMap, record: &PoseRecord) -> Vec<bool> {
    let view = map.view(record.readback);
    let limit = FLAT_LIMIT_DEG.to_radians().cos();
    let far = distance::of_pixels(map, |p| !view.visible[p]);
    let margin = distance::margin(map);
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

fn full_well(clipped: u32, line: &Linearity, r: &Radiometry, t: &PhotonTransfer, map: &PixelMap) -> Known {
    let camera = &map.description().camera;
    let range = f64::from(camera.top_code() - camera.black_level);
    let x = (f64::from(clipped) - r.black_level.value) / range;
    let value = t.mean.value * range * line.apply(x);
    // the linearisation bends the level and the gain, partly against each other
    let level = line.apply(x) / x;
    let both = [x / level + t.by_bend[0], x * x / level + t.by_bend[1]];
    let own = (t.mean.sigma / t.mean.value).powi(2) - line.along(t.by_bend).powi(2);
    Known::new(value, value * own.max(0.0).sqrt().hypot(line.along(both)))
}
