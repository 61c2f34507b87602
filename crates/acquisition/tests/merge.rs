//! The exposure merge against its own noise: no bias, and the variance it states is the one it has.

mod forward;

use forward::{Noise, frame};
use gonio_acquisition::dark::{DarkFrames, DarkModel};
use gonio_acquisition::merge::merge;
use gonio_acquisition::sensor::Sensor;
use gonio_acquisition::{AcquisitionError, PixelMap};
use gonio_instrument::{Description, Exposure, Pose, PoseRecord, builtin};

fn tiny() -> (Description, PixelMap, Sensor) {
    let d = builtin::description("tiny").expect("known").expect("readable");
    let map = PixelMap::new(&d);
    let sensor = Sensor::new(&d.camera, 0.9, &[1.0]);
    (d, map, sensor)
}

fn pose(d: &Description, rates: &[f64], times: &[f64], seed: u64) -> PoseRecord {
    let mut noise = Some(Noise(seed));
    let exposures = times
        .iter()
        .enumerate()
        .map(|(k, &t)| Exposure {
            frame: frame(d, rates, t, 1.0 + 0.01 * k as f64, k as u64, &mut noise),
            lamp_monitor: 1.0 + 0.01 * k as f64,
            shutter_open: true,
        })
        .collect();
    PoseRecord { index: 0, commanded: Pose::default(), readback: Pose::default(), exposures }
}

#[test]
fn the_merged_rate_has_no_bias_and_the_variance_it_states() {
    let (d, map, sensor) = tiny();
    let n = d.camera.pixels();
    let times = [0.0008, 0.006, 0.05, 0.4];
    // around the saturation of each exposure, where wrong selection would show, and far from it
    for electrons_at_longest in
        [3.0, 40.0, 900.0, 8_500.0, 8_900.0, 9_050.0, 9_400.0, 60_000.0, 71_000.0, 2e6]
    {
        let rate: f64 = electrons_at_longest / 0.4;
        let rates = vec![rate; n];
        let merged = merge(&pose(&d, &rates, &times, 5), &map, &sensor, &DarkModel::none(n), &vec![true; n])
            .expect("merges");
        let valid: Vec<_> = merged.pixels.iter().filter(|m| m.is_valid()).collect();
        assert_eq!(valid.len(), n, "{electrons_at_longest}");
        let count = n as f64;
        let mean = valid.iter().map(|m| f64::from(m.rate)).sum::<f64>() / count;
        let spread = valid.iter().map(|m| (f64::from(m.rate) - mean).powi(2)).sum::<f64>() / (count - 1.0);
        let stated = valid.iter().map(|m| f64::from(m.shot + m.read)).sum::<f64>() / count;
        let off = (mean - rate) / (spread / count).sqrt();
        assert!(off.abs() < 4.0, "{electrons_at_longest} electrons: {off} standard errors off");
        // the variance of a variance of 20,480 values is 1 %; five of them
        assert!(
            (stated / spread - 1.0).abs() < 0.05,
            "{electrons_at_longest}: {stated} stated, {spread} seen"
        );
    }
}

/// Rates between `from` and `to`, so many to a decade.
fn ladder(from: f64, to: f64, per_decade: f64) -> impl Iterator<Item = f64> {
    let n = ((to / from).log10() * per_decade) as i32;
    (0..=n).map(move |k| from * 10f64.powf(f64::from(k) / per_decade))
}

#[test]
fn what_is_left_unread_costs_less_than_half_a_percent_of_the_variance() {
    let (d, map, sensor) = tiny();
    let n = d.camera.pixels();
    let (gain, read) = (d.camera.electrons_per_count(), sensor.read_variance_e2);
    let top = (f64::from(sensor.saturated) - f64::from(d.camera.black_level)) * gain;
    let brackets: [&[f64]; 3] = [
        &[3e-4, 2e-3, 1.5e-2, 0.1, 0.5],
        &[1e-4, 4.1e-4, 1.7e-3, 6.9e-3, 2.8e-2, 0.116],
        &[0.01, 0.02, 0.04],
    ];
    let mut most = 0.0f64;
    for times in brackets {
        for rate in ladder(1.0, 2e6, 12.0) {
            let mut record = pose(&d, &vec![rate; n], times, 5);
            // information, how it falls with the rate, and Σ w
            let (mut best, mut slope, mut weights) = (0.0, 0.0, 0.0);
            for (k, e) in record.exposures.iter_mut().enumerate() {
                let x = times[k] * e.lamp_monitor;
                // without noise: every pixel the same
                e.frame = frame(&d, &vec![rate; n], times[k], e.lamp_monitor, k as u64, &mut None);
                if rate * x < top {
                    let w = x / (rate * x + read);
                    best += x * w;
                    slope += x * w * w;
                    weights += w;
                }
            }
            let near = times.iter().enumerate().any(|(k, t)| {
                let level = rate * t * (1.0 + 0.01 * k as f64) / top;
                (0.99..1.01).contains(&level)
            });
            if near || best == 0.0 {
                continue;
            }
            let merged = merge(&record, &map, &sensor, &DarkModel::none(n), &vec![true; n]).expect("merges");
            let m = merged.pixels[n / 2 + 80];
            let excess = f64::from(m.shot + m.read) * best - 1.0;
            // the shot noise goes by the rate as it was rounded to counts: half a count a frame
            let rounding = 1.2 * (0.5 * gain * weights / best) * (slope / best);
            assert!(excess > -rounding && excess < 5e-3 + rounding, "{times:?} {rate}: {excess:.2e}");
            most = most.max(excess);
        }
    }
    // and something is left out
    assert!(most > 1e-3, "{most}");
}

#[test]
fn leaving_exposures_unread_draws_the_rate_to_no_side() {
    let (d, map, sensor) = tiny();
    let n = d.camera.pixels();
    let times = [3e-4, 2e-3, 1.5e-2, 0.1];
    let (mut squares, mut total, mut count) = (0.0, 0.0, 0.0);
    for (k, rate) in ladder(10.0, 2e6, 8.0).enumerate() {
        let record = pose(&d, &vec![rate; n], &times, 100 + k as u64);
        let merged = merge(&record, &map, &sensor, &DarkModel::none(n), &vec![true; n]).expect("merges");
        let rates: Vec<f64> = merged.pixels.iter().map(|m| f64::from(m.rate)).collect();
        let mean = rates.iter().sum::<f64>() / n as f64;
        let spread = rates.iter().map(|r| (r - mean).powi(2)).sum::<f64>() / (n - 1) as f64;
        let off = (mean - rate) / (spread / n as f64).sqrt();
        assert!(off.abs() < 4.5, "{rate}: {off} standard errors");
        squares += off * off;
        total += off;
        count += 1.0;
    }
    // as a sample of standard normal deviates would be, within four of its own standard deviations
    assert!((squares / count - 1.0f64).abs() < 4.0 * (2.0f64 / count).sqrt(), "{squares} of {count}");
    assert!((total / count).abs() < 4.0 / f64::sqrt(count), "{total} of {count}");
}

#[test]
fn a_hot_pixel_is_found_in_the_dark_and_taken_from_its_neighbours() {
    let (d, map, sensor) = tiny();
    let n = d.camera.pixels();
    let hot = 64 * 160 + 80;
    let mut noise = Some(Noise(3));
    let mut dark_rates = vec![2.0; n];
    dark_rates[hot] = 900.0;
    let mut dark = DarkFrames::default();
    for (k, t) in [2e-5, 2e-5, 2e-5, 2e-5, 2.0, 2.0, 2.0, 2.0].into_iter().enumerate() {
        dark.add(&frame(&d, &dark_rates, t, 1.0, k as u64, &mut noise), &sensor);
    }
    let model = dark.model(&sensor, n);
    assert!(model.is_hot(hot));
    assert_eq!(model.hot_pixels(), 1);
    let mean = (0..n).filter(|p| *p != hot).map(|p| model.at(p).1).sum::<f64>() / (n - 1) as f64;
    assert!((mean - 2.0).abs() < 0.05, "{mean}");
    // light that rises along the row, on top of the dark signal
    let rates: Vec<f64> = (0..n).map(|p| 2000.0 + 10.0 * (p % 160) as f64 + dark_rates[p]).collect();
    let merged =
        merge(&pose(&d, &rates, &[0.2, 1.0], 9), &map, &sensor, &model, &vec![true; n]).expect("merges");
    let got = f64::from(merged.pixels[hot].rate);
    let want = rates[hot] - dark_rates[hot];
    assert!((got - want).abs() < 4.0 * f64::from(merged.pixels[hot].shot).sqrt() + 1.0, "{got} for {want}");
}

#[test]
fn a_warmer_sensor_has_more_dark_signal_taken_off() {
    let (d, map, sensor) = tiny();
    let n = d.camera.pixels();
    let mut noise = Some(Noise(21));
    let mut dark = DarkFrames::default();
    let at = |rate: f64, t: f64, celsius: f64, noise: &mut Option<Noise>| {
        let mut f = frame(&d, &vec![rate; n], t, 1.0, 0, noise);
        f.sensor_temperature_c = Some(celsius);
        f
    };
    for t in [2e-5, 2e-5, 2e-5, 2e-5, 2.0, 2.0, 2.0, 2.0] {
        dark.add(&at(5.0, t, 30.0, &mut noise), &sensor);
    }
    let model = dark.model(&sensor, n);
    // seven kelvin more double the dark current: 10 e/s beside 40 e/s of light
    let lit = Exposure { frame: at(50.0, 2.0, 37.0, &mut noise), lamp_monitor: 1.0, shutter_open: true };
    let record =
        PoseRecord { index: 0, commanded: Pose::default(), readback: Pose::default(), exposures: vec![lit] };
    let merged = merge(&record, &map, &sensor, &model, &vec![true; n]).expect("merges");
    let mean = merged.pixels.iter().map(|m| f64::from(m.rate)).sum::<f64>() / n as f64;
    assert!((mean - 40.0).abs() < 0.2, "{mean}");
}

#[test]
fn frames_of_another_camera_and_poses_without_light_are_refused() {
    let (d, map, sensor) = tiny();
    let n = d.camera.pixels();
    let none = DarkModel::none(n);
    let mut record = pose(&d, &vec![100.0; n], &[0.1], 1);
    record.exposures[0].shutter_open = false;
    let wanted = vec![true; n];
    assert!(matches!(
        merge(&record, &map, &sensor, &none, &wanted),
        Err(AcquisitionError::NoLight { pose: 0 })
    ));
    record.exposures[0].frame.width = 80;
    assert!(matches!(
        merge(&record, &map, &sensor, &none, &wanted),
        Err(AcquisitionError::FrameSize { found_width: 80, .. })
    ));
    record.exposures[0].frame.width = 160;
    record.exposures[0].frame.pixels.pop();
    assert!(matches!(
        merge(&record, &map, &sensor, &none, &wanted),
        Err(AcquisitionError::FrameLength { .. })
    ));
}

#[test]
fn a_lone_pixel_that_saturates_is_unknown_and_not_what_its_neighbours_show() {
    let (d, map, sensor) = tiny();
    let n = d.camera.pixels();
    let spike = n / 2 + 80;
    let mut rates = vec![1000.0; n];
    rates[spike] = 1e9;
    let r = pose(&d, &rates, &[0.001, 0.1], 3);
    let merged = merge(&r, &map, &sensor, &DarkModel::none(n), &vec![true; n]).expect("merges");
    assert!(!merged.pixels[spike].is_valid(), "{:?}", merged.pixels[spike]);
    assert_eq!(merged.pixels.iter().filter(|m| !m.is_valid()).count(), 1);
    assert!(merged.saturated_share > 0.0);
}

#[test]
fn a_dozen_saturated_pixels_in_a_million_ask_for_a_shorter_exposure() {
    use gonio_acquisition::bracket::{Bracket, FrameSummary};
    let mut bracket = Bracket::new([2e-5, 2.0], 8, std::time::Duration::from_millis(10));
    bracket.add(FrameSummary { exposure_s: 0.01, saturated_share: 1e-5, dim_share: 0.0, dark_level: 0.0 });
    let next = bracket.proposal().expect("one more").as_secs_f64();
    assert!(next < 0.01, "{next}");
}
