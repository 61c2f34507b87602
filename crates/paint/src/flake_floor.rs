//! What lies between the flakes belongs to the base: a texture of a whole paint split into the floor under it and the flakes above.

use gonio_brdf::Rgb;
use rayon::prelude::*;

use crate::{FlakeBtf, FlakeBtfError};

/// The flakes above the floor of each slice, nothing below 0, and the floors (1/sr) in order of half angle, then angle of incidence.
///
/// The floor is the value below which a share `quantile` of the texels of a slice lies, channel by channel. Flakes and floor add up to the
/// texture wherever it is not below its floor.
///
/// # Errors
/// [`FlakeBtfError`] as [`FlakeBtf::new`]; it cannot come of a sound BTF.
pub fn above_floor(btf: &FlakeBtf, quantile: f64) -> Result<(FlakeBtf, Vec<Rgb>), FlakeBtfError> {
    let [w, h] = btf.size();
    let rank = ((w * h) as f64 * quantile.clamp(0.0, 1.0)) as usize;
    let slices: Vec<&[[f32; 3]]> = btf.slices().collect();
    let parts: Vec<(Vec<[f32; 3]>, [f32; 3])> = slices
        .par_iter()
        .map(|texels| {
            let floor = [0, 1, 2].map(|c| {
                let mut values: Vec<f32> = texels.iter().map(|t| t[c]).collect();
                let at = rank.min(values.len().saturating_sub(1));
                *values.select_nth_unstable_by(at, f32::total_cmp).1
            });
            let floor = floor.map(|f| f.max(0.0));
            (texels.iter().map(|t| [0, 1, 2].map(|c| (t[c] - floor[c]).max(0.0))).collect(), floor)
        })
        .collect();
    let mut texels = Vec::with_capacity(parts.len() * w * h);
    let mut floors = Vec::with_capacity(parts.len());
    for (part, floor) in parts {
        texels.extend(part);
        floors.push(floor.map(f64::from));
    }
    Ok((FlakeBtf::new(btf.half().to_vec(), btf.incidence().to_vec(), [w, h], texels)?, floors))
}

#[cfg(test)]
mod tests {
    use super::*;
    use gonio_optics::Angle;

    #[test]
    fn flakes_and_floor_add_up() {
        // a ground of 0.1 ± 0.01 with a bright texel in ten
        let texels: Vec<[f32; 3]> = (0..200)
            .map(|k| {
                let ground = 0.1 + 0.01 * ((k * 37 % 20) as f32 / 10.0 - 1.0);
                let flake = if k % 10 == 3 { 2.0 } else { 0.0 };
                [ground + flake, 2.0 * ground, 0.0]
            })
            .collect();
        let axis = || vec![Angle::from_degrees(0.0)];
        let btf = FlakeBtf::new(axis(), axis(), [20, 10], texels.clone()).expect("sound");
        let (flakes, floors) = above_floor(&btf, 0.05).expect("sound");
        assert!((floors[0][0] - 0.091).abs() < 0.002 && floors[0][2] == 0.0, "{floors:?}");
        for (a, b) in flakes.slice(0, 0).expect("one").iter().zip(&texels) {
            let sum = f64::from(a[0]) + floors[0][0];
            assert!(sum >= f64::from(b[0]) - 1e-6 && sum < f64::from(b[0]) + 0.012);
            assert!(a.iter().all(|v| *v >= 0.0));
        }
    }
}
