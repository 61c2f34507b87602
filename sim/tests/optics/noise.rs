//! The sensor's noise against its model.

use gonio_sim::optics::Sensor;
use gonio_sim::optics::sensor::{Conditions, DARK_REFERENCE_C, NoiseKey};

use crate::instrument;

fn key(repeat: u64) -> NoiseKey {
    NoiseKey { sample: 0, pose: (30_000_000, 0), exposure_ns: 1_000_000, shutter_open: true, repeat }
}

fn lit(exposure_s: f64) -> Conditions {
    Conditions { exposure_s, lamp: 1.0, temperature_c: DARK_REFERENCE_C }
}

#[test]
fn mean_and_variance_follow_the_photon_transfer_curve() {
    let d = instrument("reference");
    let sensor = Sensor::new(&d, 3);
    let hot = sensor.hot_pixels().to_vec();
    let gain = d.camera.electrons_per_count();
    for mean_e in [0.3, 5.0, 28.0, 32.0, 300.0, 4000.0, 9000.0] {
        // an exposure so short that dark current adds nothing
        let t = 1e-3;
        let rates = vec![(mean_e / t) as f32; d.camera.pixels()];
        let counts = sensor.expose(&rates, lit(t), key(0));
        let mut n = 0.0;
        let (mut sum, mut square) = (0.0, 0.0);
        for (i, &c) in counts.iter().enumerate() {
            if hot.binary_search(&i).is_ok() {
                continue;
            }
            let e = (f64::from(c) - f64::from(d.camera.black_level)) * gain;
            n += 1.0;
            sum += e;
            square += e * e;
        }
        let mean = sum / n;
        let variance = square / n - mean * mean;
        let dark = 3.0 * 0.02f64.exp() * t; // mean of the log-normal with spread 0.2
        let expected_mean = mean_e + dark;
        let expected = expected_mean + d.camera.read_noise_e.powi(2) + gain * gain / 12.0;
        let mean_error = (mean - expected_mean) / (expected / n).sqrt();
        assert!(mean_error.abs() < 5.0, "mean {mean} for {expected_mean}: {mean_error:.1} standard errors");
        // relative standard error of a variance, with the kurtosis of small Poisson numbers
        let kurtosis = (1.0 / expected_mean).min(3.0) + 2.0;
        let variance_error = (variance / expected - 1.0) / (kurtosis / n).sqrt();
        assert!(
            variance_error.abs() < 5.0,
            "variance {variance} for {expected}: {variance_error:.1} standard errors"
        );
    }
}

#[test]
fn dark_current_grows_with_time_and_doubles_every_seven_kelvin() {
    let d = instrument("reference");
    let sensor = Sensor::new(&d, 3);
    let mean = |t: f64, temperature_c: f64, repeat: u64| {
        let conditions = Conditions { exposure_s: t, lamp: 0.0, temperature_c };
        let counts = sensor.expose(&[], conditions, key(repeat));
        let hot = sensor.hot_pixels();
        let (mut n, mut sum) = (0.0, 0.0);
        for (i, &c) in counts.iter().enumerate() {
            if hot.binary_search(&i).is_err() {
                n += 1.0;
                sum += f64::from(c) - f64::from(d.camera.black_level);
            }
        }
        sum / n * d.camera.electrons_per_count()
    };
    let (short, long, warm) = (mean(0.5, 35.0, 0), mean(2.0, 35.0, 1), mean(2.0, 42.0, 2));
    assert!((long / short - 4.0).abs() < 0.06, "{short} {long}");
    assert!((warm / long - 2.0).abs() < 0.02, "{long} {warm}");
}

#[test]
fn hot_pixels_are_few_fixed_and_bright_in_the_dark() {
    let d = instrument("reference");
    let sensor = Sensor::new(&d, 7);
    let hot = sensor.hot_pixels();
    assert!((5..60).contains(&hot.len()), "{}", hot.len());
    assert_eq!(hot, Sensor::new(&d, 7).hot_pixels());
    assert_ne!(hot, Sensor::new(&d, 8).hot_pixels());
    let counts = sensor.expose(&[], Conditions { lamp: 0.0, ..lit(2.0) }, key(0));
    for &i in hot {
        assert!(counts[i] > 200, "hot pixel {i} has {}", counts[i]);
    }
}

#[test]
fn a_full_pixel_reads_the_top_code() {
    let d = instrument("tiny");
    let sensor = Sensor::new(&d, 1);
    let rates = vec![1e9; d.camera.pixels()];
    let top = d.camera.top_code() as u16;
    assert!(sensor.expose(&rates, lit(1.0), key(0)).iter().all(|&c| c == top));
}

#[test]
fn the_same_key_gives_the_same_frame_on_any_number_of_threads_and_another_key_other_noise() {
    let d = instrument("tiny");
    let sensor = Sensor::new(&d, 1);
    let rates = vec![3e5; d.camera.pixels()];
    let with = |n: usize, k: NoiseKey| {
        rayon::ThreadPoolBuilder::new()
            .num_threads(n)
            .build()
            .expect("a pool")
            .install(|| sensor.expose(&rates, lit(1e-3), k))
    };
    let first = with(1, key(0));
    assert_eq!(first, with(3, key(0)));
    let others = [
        key(1),
        NoiseKey { sample: 1, ..key(0) },
        NoiseKey { pose: (30_000_001, 0), ..key(0) },
        NoiseKey { exposure_ns: 1_000_001, ..key(0) },
        NoiseKey { shutter_open: false, ..key(0) },
    ];
    for k in others {
        let same = first.iter().zip(&with(1, k)).filter(|(a, b)| a == b).count();
        // two independent frames agree by chance in about 1/(2 √π σ) of the pixels, σ ≈ 7 counts
        assert!(same < first.len() / 10, "{k:?}: {same} pixels alike");
    }
}

#[test]
fn the_noise_free_image_is_the_mean_of_many_noisy_ones() {
    let d = instrument("tiny");
    let sensor = Sensor::new(&d, 1);
    let rates: Vec<f32> = (0..d.camera.pixels()).map(|i| i as f32 * 20.0).collect();
    let ideal = sensor.noise_free(&rates, lit(5e-3));
    let frames = 64;
    let mut sum = vec![0.0; ideal.len()];
    for repeat in 0..frames {
        for (s, c) in sum.iter_mut().zip(sensor.expose(&rates, lit(5e-3), key(repeat))) {
            *s += f64::from(c);
        }
    }
    let gain = d.camera.electrons_per_count();
    let chi2: f64 = sum
        .iter()
        .zip(&ideal)
        .map(|(s, i)| {
            let electrons = (i - f64::from(d.camera.black_level)) * gain;
            let variance = (electrons + d.camera.read_noise_e.powi(2)) / (gain * gain) + 1.0 / 12.0;
            (s / frames as f64 - i).powi(2) * frames as f64 / variance
        })
        .sum();
    let n = ideal.len() as f64;
    assert!((chi2 / n - 1.0).abs() < 5.0 * (2.0 / n).sqrt(), "reduced chi² {}", chi2 / n);
}
