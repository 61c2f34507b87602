//! Laws of mixtures.

use std::sync::Arc;

use gonio_brdf::{Brdf, Coat, models::CookTorranceLobe};
use gonio_optics::{Angle, Vec3};

use super::*;
use crate::car_paint::{CarPaint, CarPaintParts, ColourTable, FlakeSlices, Flakes};
use crate::statistics::{StatisticsOptions, tests::flaky};

pub(crate) fn paint(name: &str, blue: f64, flakes: Option<u64>) -> Arc<CarPaint> {
    let angles = || vec![Angle::from_degrees(0.0), Angle::from_degrees(30.0)];
    let colour = ColourTable::new(angles(), angles(), vec![[1.0, 0.8, blue as f32]; 4]).expect("sound");
    let flakes = flakes.map(|seed| {
        let btf = flaky([3, 4], 48, seed);
        Flakes::Slices(FlakeSlices::new(Arc::new(btf), 0.1 + 0.01 * blue).expect("sound"))
    });
    let lobe =
        |specular: f64, alpha: f64| CookTorranceLobe { specular: [specular, specular, blue], alpha, r0: 0.3 };
    let parts = CarPaintParts {
        name: name.to_owned(),
        coat: Some(Coat { index: 1.5 }),
        diffuse: [0.1, 0.05, 0.2 * blue],
        lobes: vec![lobe(0.1, 0.1), lobe(0.2, 0.3)],
        colour: Some(colour),
        flakes,
        ..CarPaintParts::default()
    };
    Arc::new(CarPaint::new(parts).expect("sound"))
}

pub(crate) fn pair() -> Mixable {
    let paints = [paint("a", 0.3, Some(1)), paint("b", 1.2, Some(2))];
    Mixable::new(&paints, &StatisticsOptions::default()).expect("mixable")
}

#[test]
fn whole_weights_give_the_paints_themselves() {
    let m = pair();
    for (k, weights) in [[1.0, 0.0], [0.0, 1.0]].iter().enumerate() {
        let mixed = m.mix(weights, Part::Everything).expect("mixed");
        assert!(Arc::ptr_eq(&mixed.paint, &m.paints()[k]));
        assert!(mixed.notes.is_empty());
    }
    // the numbers too: corners to the bit
    let mut r = Realisation::default();
    for k in 0..2 {
        let weights = [1.0 - k as f64, k as f64];
        m.realise(&weights, Part::Everything, &mut r);
        assert_eq!(r.corners, m.corners[k]);
        assert_eq!(r.coefficients, m.analytic.coefficients[k]);
    }
}

#[test]
fn paths_are_few_and_keep_every_step() {
    let paints =
        [paint("a", 0.3, Some(1)), paint("b", 1.2, Some(2)), paint("c", 0.7, Some(3)), paint("d", 0.9, None)];
    for count in 2..=4 {
        let m = Mixable::new(&paints[..count], &StatisticsOptions::default()).expect("mixable");
        for w in m.first.windows(2) {
            let slice = &m.steps[w[0] as usize..w[1] as usize];
            assert_eq!(slice.iter().map(|s| usize::from(*s)).sum::<usize>(), 500);
            assert!(slice.iter().all(|s| *s > 0));
            assert!(slice.len() <= 50 * (count - 1) + 49);
        }
    }
}

#[test]
fn the_mean_lab_of_a_mixture_is_the_mixture_of_the_means() {
    let m = pair();
    let ends: Vec<_> = [[1.0, 0.0], [0.0, 1.0]]
        .iter()
        .map(|w| {
            let mut r = Realisation::default();
            m.realise(w, Part::Everything, &mut r);
            m.statistics(&r).expect("statistics")
        })
        .collect();
    for w in [0.25, 0.5, 0.9, -0.25, 1.3] {
        let mut r = Realisation::default();
        m.realise(&[1.0 - w, w], Part::Everything, &mut r);
        let s = m.statistics(&r).expect("statistics");
        for slice in 0..s.slices() {
            let (mixed, a, b) = (s.moments(slice), ends[0].moments(slice), ends[1].moments(slice));
            for c in 0..3 {
                let wanted = (1.0 - w) * a[c][0] + w * b[c][0];
                assert!((mixed[c][0] - wanted).abs() < 1e-3, "{w} {slice} {c}: {} {wanted}", mixed[c][0]);
            }
        }
    }
}

#[test]
fn a_fine_sweep_has_no_jump() {
    let paints = [paint("a", 0.3, Some(1)), paint("b", 1.2, Some(2)), paint("c", 0.7, Some(3))];
    let m = Mixable::new(&paints, &StatisticsOptions::default()).expect("mixable");
    let mut r = Realisation::default();
    let steps = 400;
    for part in Part::ALL {
        let track: Vec<Vec<f64>> = (0..=steps)
            .map(|k| {
                let w = -0.5 + 2.0 * f64::from(k) / f64::from(steps);
                m.realise(&[1.0 - w, 0.75 * w, 0.25 * w], part, &mut r);
                let s = m.statistics(&r).expect("statistics");
                let moments = (0..s.slices()).flat_map(|k| s.moments(k).into_iter().flatten());
                let chi = r.chi.iter().flatten().map(|v| f64::from(*v));
                let means = s.means().iter().flatten().copied();
                moments.chain(chi).chain(means).chain(r.coefficients.iter().copied()).collect()
            })
            .collect();
        for column in 0..track[0].len() {
            let steps: Vec<f64> = track.windows(2).map(|w| (w[1][column] - w[0][column]).abs()).collect();
            let (least, most) =
                track.iter().fold((f64::MAX, f64::MIN), |(l, m), t| (l.min(t[column]), m.max(t[column])));
            // a jump is a step that takes a good part of the whole way at once
            let largest = steps.iter().copied().fold(0.0, f64::max);
            assert!(
                largest <= 0.05 * (most - least) + 1e-5,
                "{part:?} {column}: {largest} of {}",
                most - least
            );
        }
    }
}

#[test]
fn parts_leave_the_rest_alone() {
    let m = pair();
    let n = m.paths();
    let realised = |part| {
        let mut r = Realisation::default();
        m.realise(&[0.4, 0.6], part, &mut r);
        r
    };
    let (all, light, hue, grey, base) = (
        realised(Part::Everything),
        realised(Part::Lightness),
        realised(Part::Hue),
        realised(Part::GreySparkle),
        realised(Part::Base),
    );
    for plane in 0..6 {
        let of = |r: &Realisation| r.corners[plane * n..(plane + 1) * n].to_vec();
        let own = m.corners[0][plane * n..(plane + 1) * n].to_vec();
        let lightness = plane % 3 == 0;
        assert_eq!(of(&light), if lightness { of(&all) } else { own.clone() });
        assert_eq!(of(&hue), if lightness { own.clone() } else { of(&all) });
        assert_eq!(of(&grey), if lightness { of(&all) } else { vec![0.0; n] });
        assert_eq!(of(&base), own);
    }
    assert_eq!(light.coefficients, m.analytic.coefficients[0]);
    assert_eq!(hue.coefficients, all.coefficients);
    assert_eq!(base.chi, all.chi);
    let grey = m.mix(&[0.4, 0.6], Part::GreySparkle).expect("mixed");
    let Some(Flakes::Statistics(s)) = &grey.paint.parts().flakes else { panic!("no statistics") };
    for [r, g, b] in s.statistics().means() {
        assert!((r / g - 1.0).abs() < 0.01 && (b / g - 1.0).abs() < 0.01, "{r} {g} {b}");
    }
}

#[test]
fn weights_short_of_one_darken_a_paint_and_change_no_index_or_width() {
    let m = pair();
    let whole = m.mix(&[0.5, 0.5], Part::Everything).expect("mixed").paint;
    let short = m.mix(&[0.4, 0.4], Part::Everything).expect("mixed").paint;
    assert!((short.index() - whole.index()).abs() < 1e-12);
    for c in 0..3 {
        assert!((short.parts().diffuse[c] - 0.8 * whole.parts().diffuse[c]).abs() < 1e-12);
    }
    for (a, b) in short.parts().lobes.iter().zip(&whole.parts().lobes) {
        assert!((a.alpha - b.alpha).abs() < 1e-12 && (a.r0 - b.r0).abs() < 1e-12);
        assert!((a.specular[0] - 0.8 * b.specular[0]).abs() < 1e-12);
    }
}

#[test]
fn a_mixture_is_a_paint_with_a_file() {
    let m = pair();
    let mixed = m.mix(&[0.5, 0.5], Part::Everything).expect("mixed").paint;
    let bytes = crate::car_paint::write_paint(&mixed, &serde_json::Map::new()).expect("written");
    let (back, _) = crate::car_paint::read_paint(&bytes).expect("read");
    assert_eq!(back, *mixed);
    let direction = |deg: f64, phi: f64| {
        let (s, c) = deg.to_radians().sin_cos();
        Vec3::new(s * phi.cos(), s * phi.sin(), c)
    };
    let (l, v) = (direction(20.0, 0.0), direction(45.0, 2.0));
    let (f, back) = (mixed.eval(l, v), mixed.eval(v, l));
    assert!((0..3).all(|c| f[c] > 0.0 && (f[c] - back[c]).abs() < 1e-12 * f[c]));
    // the mean over the surface is the mean of its places
    let (mut sum, n) = ([0.0; 3], 128);
    for k in 0..n * n {
        let side = mixed.parts().flakes.as_ref().expect("flakes").texel_mm();
        let at = [((k % n) as f64 + 0.5) * side, ((k / n) as f64 + 0.5) * side];
        let here = mixed.eval_at(l, v, at);
        for c in 0..3 {
            sum[c] += here[c] / (n * n) as f64;
        }
    }
    assert!((0..3).all(|c| (sum[c] / f[c] - 1.0).abs() < 0.05), "{sum:?} {f:?}");
}

#[test]
fn paints_without_flakes_or_colours_mix_too() {
    let plain = Arc::new(
        CarPaint::new(CarPaintParts {
            coat: Some(Coat { index: 1.6 }),
            diffuse: [0.5; 3],
            ..CarPaintParts::default()
        })
        .expect("sound"),
    );
    let m = Mixable::new(&[paint("a", 0.4, Some(1)), Arc::clone(&plain)], &StatisticsOptions::default())
        .expect("mixable");
    let half = m.mix(&[0.5, 0.5], Part::Everything).expect("mixed").paint;
    assert!((half.index() - 1.55).abs() < 1e-12);
    assert_eq!(half.parts().lobes.len(), 2);
    let m = Mixable::new(&[Arc::clone(&plain), plain], &StatisticsOptions::default()).expect("mixable");
    assert_eq!(m.slices(), 0);
    assert!(m.mix(&[0.3, 0.7], Part::Everything).expect("mixed").paint.parts().flakes.is_none());
}

#[test]
fn what_does_not_mix_says_why_and_odd_weights_are_told() {
    let options = StatisticsOptions::default();
    let a = paint("a", 0.4, Some(1));
    assert!(matches!(Mixable::new(&[Arc::clone(&a)], &options), Err(MixError::TooFew { found: 1 })));
    let mut parts = paint("c", 0.4, None).parts().clone();
    parts.flakes = Some(Flakes::Slices(FlakeSlices::new(Arc::new(flaky([2, 4], 8, 3)), 0.1).expect("sound")));
    let other = Arc::new(CarPaint::new(parts.clone()).expect("sound"));
    let message = Mixable::new(&[Arc::clone(&a), other], &options).expect_err("angles").to_string();
    assert!(message.contains("(c)") && message.contains("2 from 0.0° to 3.0°"), "{message}");
    parts.flakes = None;
    parts.coat = None;
    let bare = Arc::new(CarPaint::new(parts).expect("sound"));
    assert!(matches!(Mixable::new(&[a, bare], &options), Err(MixError::Coat { place: 1, .. })));
    let m = pair();
    assert!(matches!(m.mix(&[1.0], Part::Everything), Err(MixError::WeightCount { found: 1, paints: 2 })));
    assert!(matches!(m.mix(&[f64::NAN, 1.0], Part::Everything), Err(MixError::Weight { place: 0, .. })));
    let notes = m.mix(&[0.5, 0.7], Part::Everything).expect("mixed").notes.join("; ");
    assert!(notes.contains("sum to 1.2"), "{notes}");
    let notes = m.mix(&[-3.0, 4.0], Part::Everything).expect("mixed").notes.join("; ");
    assert!(notes.contains("extrapolated"), "{notes}");
}
