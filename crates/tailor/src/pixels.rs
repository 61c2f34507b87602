//! How far pictures are off: CIEDE2000 pixel by pixel between two pictures of one scene.

use gonio_optics::colour;
use gonio_render::sphere::LinearImage;
use gonio_render::trace::Gathered;

use crate::ColourSpread;

/// ΔE of every pixel of all views; `None` beside the object, at its edge and where no light comes from.
#[must_use]
pub fn pixel_differences(
    scene: &Gathered,
    reference: &[LinearImage],
    other: &[LinearImage],
) -> Vec<Option<f64>> {
    // white is a perfect diffuser in the scene's best light; L* above 100 is not clamped
    let lab = |v: &[f32; 3]| colour::lab_from_rgb(v.map(|x| f64::from(x) / scene.white));
    let values = |list: &[LinearImage]| -> Vec<[f32; 3]> {
        list.iter().flat_map(|i| i.values.iter().copied()).collect()
    };
    let (a, b) = (values(reference), values(other));
    (0..scene.coverage.len())
        .map(|p| {
            let lit = scene.starts[p + 1] > scene.starts[p];
            let (x, y) = (a.get(p)?, b.get(p)?);
            (lit && scene.coverage[p] > 0.999)
                .then(|| colour::ciede2000(lab(x), lab(y)))
                .filter(|d| d.is_finite())
        })
        .collect()
}

/// Mean, 95th percentile and maximum over the pixels.
#[must_use]
pub fn spread(differences: &[Option<f64>]) -> Option<ColourSpread> {
    ColourSpread::of(differences.iter().flatten().map(|d| (*d, 1.0)).collect())
}
