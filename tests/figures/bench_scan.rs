//! Scans of the virtual instrument without its controller: frames of the simulator straight into the reduction. The truth may be out of alignment,
//! the reduction knows what a calibration found.

use std::collections::HashMap;
use std::sync::Arc;
use std::time::Duration;

use gonio_acquisition::{Options, PixelMap, Reducer, WhiteBuilder, WhiteReference, reference_plan};
use gonio_brdf::Measured;
use gonio_instrument::{
    Certificate, Description, Exposure, Frame, Misalignment, Plan, Pose, PoseRecord, SampleRecord,
};
use gonio_optics::Angle;
use gonio_sim::optics::sensor::{Conditions, NoiseKey};
use gonio_sim::optics::{RateMap, Sample, Sensor, VirtualOptics};

use crate::noise::Noise;

/// Exposures of a sample's pose, s: from the shortest up to what is dim.
const SAMPLE_S: [f64; 6] = [2e-5, 3e-4, 3e-3, 2e-2, 1e-1, 5e-1];
/// The one of a diffuser without noise.
const QUIET_S: [f64; 1] = [2e-2];
/// White poses are taken this often.
const REPEATS: u64 = 3;

/// A virtual instrument and what is known of it.
pub struct BenchScan {
    optics: VirtualOptics,
    sensor: Sensor,
    errors: Misalignment,
    map: Arc<PixelMap>,
    noise: Noise,
    /// Relative standard deviation of the lamp monitor, drawn once a pose.
    pub monitor_noise: f64,
    /// Whether frames come without noise, rounded to counts, and a sample's pose in one exposure: for errors that all pixels share.
    pub quiet: bool,
    /// Traced pictures of a perfect diffuser by tilt: any other diffuser gives so much less.
    diffusers: HashMap<u64, Arc<RateMap>>,
}

/// What lies on the holder.
pub enum OnHolder<'a> {
    /// Anything.
    Sample(&'a Sample),
    /// A diffuser of this reflectance, and the key of its noise.
    Diffuser(f64, u64),
}

impl BenchScan {
    /// An instrument with `errors` that is reduced by the description `known`.
    pub fn new(known: &Description, errors: &Misalignment, seed: u64) -> Self {
        let nominal = Description { calibration: None, calibration_record: None, ..known.clone() };
        Self {
            optics: VirtualOptics::new(&nominal, errors),
            sensor: Sensor::new(&nominal, seed),
            errors: errors.clone(),
            map: Arc::new(PixelMap::new(known)),
            noise: Noise::new(seed),
            monitor_noise: 0.0,
            quiet: false,
            diffusers: HashMap::new(),
        }
    }

    /// All noise from here on from this seed.
    pub fn reseed(&mut self, seed: u64) {
        self.noise = Noise::new(seed);
    }

    fn pose(&mut self, on: &OnHolder<'_>, index: u32, readback: Pose, exposures_s: &[f64]) -> PoseRecord {
        let off = self.errors.tilt_zero_deg + self.errors.tilt_repeatability_deg * self.noise.normal();
        let actual = Pose { tilt: readback.tilt + Angle::from_degrees(off), ..readback };
        let optics = &self.optics;
        let (rates, factor, noise_key) = match on {
            OnHolder::Sample(sample) => {
                (Arc::new(optics.rate_map(actual, 0.0, sample)), 1.0, sample.noise_key)
            }
            OnHolder::Diffuser(reflectance, key) => {
                let perfect = || Arc::new(optics.rate_map(actual, 0.0, &Sample::diffuser(1.0)));
                let tilt = actual.tilt.degrees().to_bits();
                (self.diffusers.entry(tilt).or_insert_with(perfect).clone(), *reflectance, *key)
            }
        };
        let lamp_monitor = 1.0 + self.monitor_noise * self.noise.normal();
        let top = f64::from(self.map.description().camera.top_code());
        let pose = ((readback.tilt.degrees() * 1e6) as i64, (readback.spin.degrees() * 1e6) as i64);
        let exposures = exposures_s
            .iter()
            .enumerate()
            .map(|(k, &exposure_s)| {
                let key = NoiseKey {
                    sample: noise_key,
                    pose,
                    exposure_ns: (exposure_s * 1e9) as u64,
                    shutter_open: true,
                    repeat: k as u64,
                };
                let conditions = Conditions { exposure_s, lamp: factor, temperature_c: 35.0 };
                let pixels = if self.quiet {
                    let counts = self.sensor.noise_free(&rates.rates, conditions);
                    counts.into_iter().map(|c| c.round().clamp(0.0, top) as u16).collect()
                } else {
                    self.sensor.expose(&rates.rates, conditions, key)
                };
                let frame = Frame {
                    width: rates.width,
                    height: rates.height,
                    pixels,
                    exposure: Duration::from_secs_f64(exposure_s),
                    sequence: k as u64,
                    stamp: Duration::ZERO,
                    sensor_temperature_c: Some(35.0),
                };
                Exposure { frame, lamp_monitor, shutter_open: true }
            })
            .collect();
        PoseRecord { index, commanded: readback, readback, exposures }
    }

    fn plan(&self, tilts: &[f64]) -> Plan {
        Plan { tilt_deg: tilts.to_vec(), ..self.map.description().plan.clone() }
    }

    /// The white reference for samples at these angles of incidence.
    pub fn white(&mut self, tilts: &[f64]) -> WhiteReference {
        self.white_of(&OnHolder::Sample(&Sample::diffuser(0.98).with_noise_key(1)), tilts)
    }

    /// The same where the reference is not quite what its certificate says.
    pub fn white_of(&mut self, on: &OnHolder<'_>, tilts: &[f64]) -> WhiteReference {
        let map = self.map.clone();
        let mut builder =
            WhiteBuilder::new(map.clone(), &Certificate::virtual_white(), Vec::new(), &Options::default())
                .expect("the virtual certificate");
        let plan = reference_plan::on_instrument(&map, &reference_plan::white_plan(&map, &self.plan(tilts)));
        let once = plan.tilt_deg.iter().map(|t| Pose::from_degrees(*t, 0.0));
        for (k, pose) in once.enumerate() {
            let t = 0.02 / pose.tilt.cos();
            let times: Vec<f64> = (0..REPEATS).flat_map(|_| [t, 4.0 * t]).collect();
            let record = self.pose(on, k as u32, pose, &times);
            builder.add_pose(&record).expect("frames of this camera");
        }
        builder.finish().expect("the reference is seen")
    }

    /// The table of a sample, and the reducer that made it.
    pub fn table(
        &mut self,
        white: &WhiteReference,
        sample: &Sample,
        tilts: &[f64],
        options: Options,
    ) -> (Measured, Reducer) {
        self.table_of(white, &OnHolder::Sample(sample), [tilts, &[0.0]], options)
    }

    /// The same of whatever lies there, at tilts and spins.
    pub fn table_of(
        &mut self,
        white: &WhiteReference,
        on: &OnHolder<'_>,
        [tilts, spins]: [&[f64]; 2],
        options: Options,
    ) -> (Measured, Reducer) {
        let map = self.map.clone();
        let mut reducer =
            Reducer::new(map.clone(), white.clone(), SampleRecord::default(), options).expect("settings");
        let plan = Plan { spin_deg: spins.to_vec(), ..self.plan(tilts) };
        let poses = reference_plan::on_instrument(&map, &plan).poses();
        for (k, pose) in poses.into_iter().enumerate() {
            let record = self.pose(on, k as u32, pose, if self.quiet { &QUIET_S } else { &SAMPLE_S });
            reducer.add_pose(&record).expect("frames of this camera");
        }
        (reducer.finish(), reducer)
    }
}
