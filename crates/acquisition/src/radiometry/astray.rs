//! Light that goes astray, from sessions of a trap, of a white and a black reference and of black glass.

use std::sync::Arc;

use gonio_brdf::Brdf;
use gonio_instrument::radiometry::StrayLight;
use gonio_instrument::{Description, PoseRecord, ScanKind};

use super::RadiometryError;
use super::calibrate::{Input, in_session, stability};
use super::evidence::Evidence;
use super::face_fit::{self, Seen};
use super::haze;
use super::stray::Stray;
use super::stray_fit;
use crate::merge::MergedPose;
use crate::merge_white::Merger;
use crate::options::Options;
use crate::pixel_map::PixelMap;
use crate::reference::certified;

/// Poses of black glass looked at for tails.
const GLOSS_POSES: usize = 12;
/// Misfit of glare and tails from which it is told.
const GOOD_MISFIT: f64 = 4.0;

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

/// Haze, glare, tails and the camera's own face; they are set in the description. `index` is that of the black glass, `response` the relative standard
/// deviation of the pixels' sensitivities, `bend` the relative uncertainty of bright against faint light.
pub(super) fn find(
    d: &mut Description,
    inputs: &[Input<'_>],
    index: f64,
    [response, bend]: [f64; 2],
) -> Result<Option<stray_fit::Found>, RadiometryError> {
    let map = Arc::new(PixelMap::new(d));
    let of = |kinds: &'static [ScanKind]| inputs.iter().filter(move |i| kinds.contains(&i.kind));
    let mut notes = Vec::new();
    let mut light = StrayLight::default();
    let mut hazes = Vec::new();
    for input in of(&[ScanKind::Trap]) {
        for pose in merged(input, &map) {
            hazes.push(haze::of_trap(&pose?.1.pixels, &map, response));
        }
    }
    light.haze = haze::mean(&hazes);
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
            evidence.push(Evidence::of_blind(&m.pixels, &map.view(record.readback), &map, response));
        }
    }
    for input in of(&[ScanKind::BlackGlass, ScanKind::BlackGlassWedge]) {
        let step = (input.poses)().count().div_ceil(GLOSS_POSES).max(1);
        for (k, pose) in merged(input, &map).enumerate() {
            let (record, mut m) = pose?;
            if k % step == 0 {
                without_haze.correct(&mut m.pixels, &map);
                let view = map.view(record.readback);
                evidence.extend(Evidence::of_gloss(&m.pixels, &view, &map, response, index));
            }
        }
    }
    let found = stray_fit::find(&evidence, &map, bend);
    match &found {
        Some(f) => {
            (light.glare, light.tail_share, light.tail_radius_mm) = (f.glare, f.tail_share, f.tail_radius_mm);
            if f.misfit > GOOD_MISFIT {
                notes.push(format!(
                    "glare and tails are not quite of the shape that is assumed: misfit {:.1} (docs/calibration.md); their uncertainties hold it",
                    f.misfit
                ));
            }
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
