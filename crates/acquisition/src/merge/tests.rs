//! One after the other and eight at a time give the same bits, whatever the frames hold.

use std::time::Duration;

use gonio_instrument::{Exposure, Frame, Pose, PoseRecord, builtin};
use proptest::prelude::*;

use super::lanes::{BLOCK, Row};
use super::shots::Shots;
use super::wide::{Plain, Task};
use super::{OneRow, wide};
use crate::dark::DarkFrames;
use crate::sensor::Sensor;

/// Frames of some light: a spot on a slope, with noise by place and now and then a value out of all order.
#[derive(Clone, Debug)]
struct Scene {
    width: usize,
    height: usize,
    /// Electrons per second in the middle of the spot, and beside it.
    peak: f64,
    base: f64,
    /// Radius of the spot, pixels.
    radius: f64,
    times: Vec<f64>,
    linearity: Vec<f64>,
    seed: u64,
}

impl Scene {
    fn chance(&self, p: usize, k: usize) -> f64 {
        let mut z = self.seed ^ ((p as u64) << 20) ^ (k as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15);
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64
    }

    fn frame(&self, rate: &dyn Fn(usize) -> f64, t: f64, k: usize) -> Frame {
        let c = builtin::description("tiny").expect("known").expect("readable").camera;
        let pixels = (0..self.width * self.height)
            .map(|p| {
                if self.chance(p, 1000 + k) < 0.003 {
                    return (self.chance(p, 2000 + k) * 65_535.0) as u16;
                }
                let e = rate(p) * t;
                let noise = (self.chance(p, k) - 0.5) * (12.0 * (e + 9.0)).sqrt();
                let raw = f64::from(c.black_level) + (e + noise) / c.electrons_per_count();
                raw.round().clamp(0.0, f64::from(c.top_code())) as u16
            })
            .collect();
        Frame {
            width: self.width as u32,
            height: self.height as u32,
            pixels,
            exposure: Duration::from_secs_f64(t),
            sequence: k as u64,
            stamp: Duration::ZERO,
            sensor_temperature_c: None,
        }
    }

    fn record(&self) -> PoseRecord {
        let middle = [0.4 * self.width as f64, 0.5 * self.height as f64];
        let rate = |p: usize| {
            let (x, y) = ((p % self.width) as f64 - middle[0], (p / self.width) as f64 - middle[1]);
            self.base * (1.0 + x / self.width as f64)
                + self.peak * (-(x * x + y * y) / (self.radius * self.radius)).exp()
        };
        let exposures = self.times.iter().enumerate().map(|(k, &t)| Exposure {
            frame: self.frame(&rate, t, k),
            lamp_monitor: 1.0 + 0.01 * k as f64,
            shutter_open: true,
        });
        let exposures = exposures.collect();
        PoseRecord { index: 0, commanded: Pose::default(), readback: Pose::default(), exposures }
    }
}

prop_compose! {
    fn scene()(
        width in 1usize..150, height in 1usize..9,
        peak in 2.0f64..7.0, base in 0.0f64..5.0, radius in 1.0f64..80.0,
        times in proptest::collection::vec(-4.5f64..0.0, 1..7),
        linear in any::<bool>(), seed in any::<u64>()
    ) -> Scene {
        Scene {
            width, height, radius, seed,
            peak: 10f64.powf(peak),
            base: 10f64.powf(base),
            times: times.iter().map(|t| 10f64.powf(*t)).collect(),
            linearity: if linear { vec![1.0] } else { vec![0.97, 0.03] },
        }
    }
}

proptest! {
    #[test]
    fn eight_at_a_time_give_the_bits_of_one_after_the_other(scene in scene()) {
        let camera = builtin::description("tiny").expect("known").expect("readable").camera;
        let sensor = Sensor::new(&camera, 0.9, &scene.linearity);
        let mut dark = DarkFrames::default();
        for (k, t) in [2e-5, 0.5].into_iter().enumerate() {
            dark.add(&scene.frame(&|p| if p % 97 == 5 { 4e3 } else { 3.0 }, t, 500 + k), &sensor);
        }
        let dark = dark.model(&sensor, scene.width * scene.height);
        let record = scene.record();
        let shots = Shots::of(&record, scene.width, &sensor, &dark).expect("light");
        let blocks: Vec<u32> = (0..scene.width.div_ceil(BLOCK) as u32).collect();
        let (mut wide_row, mut plain_row) = (Row::of(scene.width), Row::of(scene.width));
        for y in 0..scene.height {
            wide::run(OneRow { row: &mut wide_row, shots: &shots, y, blocks: &blocks });
            OneRow { row: &mut plain_row, shots: &shots, y, blocks: &blocks }.run(Plain);
            prop_assert_eq!(&wide_row.lost, &plain_row.lost);
            for x in 0..scene.width {
                let bits = |row: &Row| {
                    [row.rate[x], row.shot[x], row.read[x], row.dark[x], row.exposure[x]].map(f32::to_bits)
                };
                prop_assert_eq!(bits(&wide_row), bits(&plain_row), "{} {}: {:?} {:?}", x, y, wide_row.pixel(x), plain_row.pixel(x));
            }
        }
    }
}
