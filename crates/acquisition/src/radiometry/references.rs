//! What sessions of the white reference and of black glass show once stray light is taken off: flat field and gloss scale.

use std::sync::Arc;

use gonio_instrument::radiometry::{FlatField, Known};
use gonio_instrument::{Description, ScanKind};

use super::RadiometryError;
use super::calibrate::{Input, Settings, in_session};
use super::defects;
use super::gloss_scale::{self, GlossSeries};
use crate::error::AcquisitionError;
use crate::options::Options;
use crate::pixel_map::PixelMap;
use crate::reference::{WhiteBuilder, WhiteReference};

/// Flat field and gloss scale, with stray light taken off; they are set in the description.
pub(super) fn find(
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
    let see = |map: &Arc<PixelMap>| -> Result<WhiteReference, RadiometryError> {
        let mut builder =
            WhiteBuilder::new(map.clone(), certificate, input.notes.clone(), &Options::default())
                .map_err(told)?;
        for record in (input.poses)() {
            builder.add_pose(&record).map_err(told)?;
        }
        builder.finish().map_err(told)
    };
    let white = see(&map)?;
    let mut gloss = GlossSeries::default();
    for input in inputs.iter().filter(|i| i.kind == ScanKind::BlackGlass) {
        let mut poses = (input.poses)();
        gloss_scale::seen(&mut poses, &map, &white, &mut |g, values, view, mean_cos| {
            gloss.add(g, values, &map, view, settings.index, mean_cos);
        })
        .map_err(|e| in_session(input, e))?;
    }
    let scale = gloss.finish(settings.index, white.common_relative(d, white.lamp), d.lamp.half_angle_deg);
    if scale.is_none() {
        notes.push("the scale of a gloss is not known: add a session of --kind black-glass".to_owned());
    } else if scale.as_ref().is_some_and(|s| s.half_angle_deg.is_none()) {
        notes.push("the camera's pixels are too coarse to show the lamp's profile".to_owned());
    }
    // pixels answer to all light that reaches them; without what went astray they would seem to differ by more
    let mut bare = d.clone();
    let astray = bare.radiometry.as_mut().and_then(|r| r.stray.take()).is_some();
    let seen = if astray { Some(see(&Arc::new(PixelMap::new(&bare)))?) } else { None };
    let seen = seen.as_ref().unwrap_or(&white);
    let response = defects::find(&seen.scale, &map, |p| f64::from(seen.relative_variance[p])).spread;
    let flat = flat_field(&white, &map, response);
    let r = d.radiometry.get_or_insert_default();
    r.flat = Some(flat);
    r.gloss = scale;
    r.notes.extend(notes);
    Ok(gloss.points.iter().map(|p| [p.0.degrees(), p.1, p.2]).collect())
}

fn flat_field(white: &WhiteReference, map: &PixelMap, pixel_response: Known) -> FlatField {
    let w = map.width();
    let mut of: [Vec<f64>; 3] = Default::default();
    let mut noise = (0.0, 0.0);
    for (p, k) in white.scale.iter().enumerate().filter(|(_, k)| k.is_finite()) {
        let etendue = map.optics().etendue((p % w) as f64 + 0.5, (p / w) as f64 + 0.5);
        of[map.channel(p)].push(f64::from(*k) / etendue.max(1e-9));
        noise.0 += f64::from(white.relative_variance[p]);
        noise.1 += 1.0;
    }
    let covered = noise.1 / white.scale.len().max(1) as f64;
    let relative = noise.0 / f64::max(noise.1, 1.0);
    let scale = of.map(|mut v| {
        v.sort_unstable_by(f64::total_cmp);
        v.get(v.len() / 2).copied().unwrap_or(0.0)
    });
    FlatField {
        serial: white.serial.clone(),
        scale,
        pixel_sigma: relative.sqrt(),
        certificate: white.certificate_uncertainty,
        covered,
        pixel_response,
    }
}
