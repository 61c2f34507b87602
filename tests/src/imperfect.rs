//! A virtual instrument whose sensor and light depart from its description, scanned without stage and driver, and what a radiometric calibration of it
//! should find: for the stories that look at one instrument and the figures that look at many.

use std::collections::HashMap;
use std::time::Duration;

use gonio_acquisition::radiometry::{Calibrated, Input, Settings, calibrate, plans};
use gonio_acquisition::reference_plan::white_plan;
use gonio_acquisition::{PixelMap, geometry};
use gonio_instrument::radiometry::Known;
use gonio_instrument::{
    Certificate, Description, Exposure, Frame, Imperfections, Misalignment, Plan, PoseRecord, ScanKind,
    builtin,
};
use gonio_sim::Truth;
use gonio_sim::optics::sensor::{Conditions, NoiseKey};
use gonio_sim::optics::{Sample, Sensor, VirtualOptics};

/// The kinds of sessions that serve a radiometric calibration.
pub const KINDS: [ScanKind; 6] =
    [ScanKind::Flat, ScanKind::Dark, ScanKind::White, ScanKind::Black, ScanKind::BlackGlass, ScanKind::Trap];
/// Sensor temperature of the sessions, °C, and that of a second dark one.
const TEMPERATURES_C: [f64; 2] = [35.0, 43.0];

/// The built-in tiny instrument.
///
/// # Panics
/// Where the file shipped is damaged.
#[must_use]
pub fn tiny() -> Description {
    builtin::description("tiny").expect("built in").expect("readable")
}

/// What is wrong with the instrument.
#[must_use]
pub fn wrong() -> Imperfections {
    Imperfections {
        gain_error: 0.05,
        read_noise_error: 0.3,
        black_level_error: 1.6,
        compression: 0.02,
        pixel_response: 0.01,
        dead_pixels: 12,
        dark_current_error: 1.0,
        dark_doubling_k: 6.0,
        veiling_glare: 0.012,
        tail_share: 0.02,
        tail_radius_mm: 0.12,
        face_reflectance: 0.06,
        lamp_haze: 5e-4,
        ..Imperfections::default()
    }
}

/// A number found, and what it should be.
#[derive(Clone, Debug)]
pub struct Compared {
    /// What it is.
    pub name: String,
    /// As found.
    pub found: Known,
    /// As it is.
    pub truth: f64,
}

impl Compared {
    /// Error over its stated uncertainty.
    #[must_use]
    pub fn z(&self) -> f64 {
        (self.found.value - self.truth) / self.found.sigma
    }
}

/// The virtual instrument.
pub struct Instrument {
    /// Its description.
    pub d: Description,
    /// Its errors.
    pub errors: Imperfections,
    /// Its optics.
    pub optics: VirtualOptics,
    /// Its sensor.
    pub sensor: Sensor,
    /// True reflectance over the certified one, of the white and the black reference.
    pub references: [f64; 2],
    /// Standard deviation of the lamp's output from exposure to exposure, which its monitor follows, and of the monitor's own readings; relative.
    pub lamp: [f64; 2],
    seed: u64,
    /// Light does not change with the seed of the noise; poses by tilt and spin, a millionth of a degree.
    rates: HashMap<(&'static str, [i64; 2]), Vec<f32>>,
}

impl Instrument {
    /// The tiny instrument with these errors; `seed` fixes the sensor's pattern and all noise.
    #[must_use]
    pub fn new(errors: Imperfections, seed: u64) -> Self {
        Self::of(tiny(), errors, seed)
    }

    /// The same of another description.
    #[must_use]
    pub fn of(d: Description, errors: Imperfections, seed: u64) -> Self {
        let sensor = Sensor::new(&d, seed).with_imperfections(&errors);
        let misaligned = Misalignment { radiometry: Some(errors.clone()), ..Misalignment::default() };
        Self {
            optics: VirtualOptics::new(&d, &misaligned),
            sensor,
            errors,
            references: [1.0; 2],
            lamp: [0.0; 2],
            seed,
            rates: HashMap::new(),
            d,
        }
    }

    /// Another sensor of the same make, and other noise. What light does stays, unless the references change.
    pub fn reseed(&mut self, seed: u64, references: [f64; 2]) {
        self.sensor = Sensor::new(&self.d, seed).with_imperfections(&self.errors);
        self.seed = seed;
        if references != self.references {
            let seen = |kind: &&str| {
                ![ScanKind::White, ScanKind::Flat, ScanKind::Black].iter().any(|k| k.name() == *kind)
            };
            self.rates.retain(|k, _| seen(&k.0));
            self.references = references;
        }
    }

    fn sample(&self, kind: ScanKind) -> Sample {
        let truth = Truth::from_bytes(br#"{"model":"lambert","diffuse":[0.5,0.5,0.5]}"#).expect("a model");
        let [white, black] = self.references;
        match kind {
            ScanKind::White | ScanKind::Flat => Sample::diffuser(0.98 * white),
            ScanKind::Black => Sample::diffuser(0.03 * black),
            _ => Sample::of_kind(kind, &truth, &Certificate::virtual_white()).expect("a sample"),
        }
        .with_noise_key(Sample::noise_key_of(kind))
    }

    /// The poses of a scan. Without a series of its own the plan's poses get exposures a factor 4 apart over the camera's range.
    ///
    /// # Panics
    /// Never: the built-in samples are readable.
    pub fn scan(&mut self, kind: ScanKind, plan: &Plan, temperature_c: f64) -> Vec<PoseRecord> {
        let sample = self.sample(kind);
        let [shortest, longest] = self.d.camera.exposure_s;
        let series: Vec<f64> = match plan.exposure_s.is_empty() {
            false => plan.exposure_s.clone(),
            true => {
                (0..9).map(|k| shortest * 4f64.powi(k)).chain([longest]).filter(|t| *t <= longest).collect()
            }
        };
        let [width, height] = self.d.camera.size;
        let mut sequence = 0u64;
        let mut out = Vec::new();
        for (index, pose) in plan.poses().into_iter().enumerate() {
            let place = [pose.tilt, pose.spin].map(|a| (a.degrees() * 1e6).round() as i64);
            let optics = &self.optics;
            let rates = self.rates.entry((kind.name(), place)).or_insert_with(|| match kind {
                ScanKind::Dark => Vec::new(),
                _ => optics.rate_map(pose, 0.0, &sample).rates,
            });
            let mut exposures = Vec::new();
            for &exposure_s in &series {
                for lit in [false, true] {
                    let dark_too = kind == ScanKind::Flat || kind == ScanKind::Dark || index == 0;
                    if (lit && kind == ScanKind::Dark) || (!lit && !dark_too) {
                        continue;
                    }
                    for repeat in 0..u64::from(plan.repeats.max(2)) {
                        let key = NoiseKey {
                            sample: sample.noise_key + (temperature_c * 100.0) as u64 * 16,
                            pose: (place[0], index as i64),
                            exposure_ns: (exposure_s * 1e9) as u64,
                            shutter_open: lit,
                            repeat,
                        };
                        sequence += 1;
                        // two sequences that share nothing with the sensor's noise
                        let word = self.seed.wrapping_mul(0x1000).wrapping_add(sample.noise_key) << 24
                            | sequence << 1;
                        let [swing, reading] = self.lamp;
                        let lamp = if lit { 1.0 + swing * normal(word) } else { 0.0 };
                        let monitor = if lit { lamp * (1.0 + reading * normal(word | 1)) } else { 1.0 };
                        let conditions = Conditions { exposure_s, lamp, temperature_c };
                        let pixels = self.sensor.expose(if lit { rates } else { &[] }, conditions, key);
                        let frame = Frame {
                            width,
                            height,
                            pixels,
                            exposure: Duration::from_secs_f64(exposure_s),
                            sequence,
                            stamp: Duration::ZERO,
                            sensor_temperature_c: Some(temperature_c),
                        };
                        exposures.push(Exposure { frame, lamp_monitor: monitor, shutter_open: lit });
                    }
                }
            }
            out.push(PoseRecord { index: index as u32, commanded: pose, readback: pose, exposures });
        }
        out
    }

    /// The plan of a session.
    #[must_use]
    pub fn plan(&self, kind: ScanKind) -> Plan {
        let (d, map) = (&self.d, PixelMap::new(&self.d));
        match kind {
            ScanKind::Flat => plans::flat(&d.plan, d),
            ScanKind::Trap => plans::trap(&d.plan),
            ScanKind::BlackGlass => geometry::plans::flat(&d.plan, d.holder.tilt_limits_deg),
            ScanKind::Dark => Plan { tilt_deg: vec![0.0], repeats: 4, ..d.plan.clone() },
            _ => white_plan(&map, &d.plan),
        }
    }

    /// All sessions, and the calibration that comes of them.
    ///
    /// # Panics
    /// Where the calibration is refused.
    pub fn calibrated(&mut self) -> Calibrated {
        let mut sessions: Vec<(ScanKind, Vec<PoseRecord>)> = Vec::new();
        for (kind, at) in
            KINDS.map(|k| (k, TEMPERATURES_C[0])).into_iter().chain([(ScanKind::Dark, TEMPERATURES_C[1])])
        {
            let plan = self.plan(kind);
            sessions.push((kind, self.scan(kind, &plan, at)));
        }
        let inputs: Vec<Input<'_>> = sessions.iter().map(|(k, p)| input(k.name(), *k, p)).collect();
        calibrate(&self.d, &inputs, &Settings::default()).expect("a calibration")
    }

    /// Count at which a pixel without noise clips, electrons above black.
    fn full_well(&self) -> f64 {
        let c = &self.d.camera;
        let range = f64::from(c.top_code() - c.black_level);
        let x = (f64::from(c.top_code() - c.black_level) - self.errors.black_level_error) / range;
        let a = self.errors.compression;
        let u = if a == 0.0 { x } else { (1.0 - (1.0 - 4.0 * a * x).sqrt()) / (2.0 * a) };
        u * range * self.sensor.electrons_per_count()
    }

    /// Every number of a calibration that the instrument knows the truth of.
    ///
    /// # Panics
    /// Where the calibration lacks a part.
    #[must_use]
    pub fn compared(&self, c: &Calibrated) -> Vec<Compared> {
        let r = c.radiometry();
        let mut out = Vec::new();
        let mut add = |name: &str, found: Known, truth: f64| {
            out.push(Compared { name: name.to_owned(), found, truth });
        };
        for (k, name) in ["gain red", "gain green", "gain blue"].iter().enumerate() {
            add(name, r.electrons_per_count[k], self.sensor.electrons_per_count());
        }
        let w = &self.errors;
        add("read noise", r.read_noise_e, self.sensor.read_noise_e());
        add("black level", r.black_level, f64::from(self.d.camera.black_level) + w.black_level_error);
        let hot = self.sensor.hot_pixels();
        let usual: Vec<f64> = (0..self.sensor.dark_reference().len())
            .filter(|p| hot.binary_search(p).is_err())
            .map(|p| f64::from(self.sensor.dark_reference()[p]))
            .collect();
        add("dark current", r.dark.current_e_s, usual.iter().sum::<f64>() / usual.len() as f64);
        if let (Some(found), true) = (r.dark.doubling_k, w.dark_doubling_k > 0.0) {
            add("doubling", found, w.dark_doubling_k);
        }
        add("full well", r.full_well_e, self.full_well());
        add("pixel response", r.flat.as_ref().expect("a flat field").pixel_response, w.pixel_response);
        add("gloss scale", r.gloss.as_ref().expect("black glass").scale, 1.0);
        let light = r.stray.as_ref().expect("stray light");
        add("glare", light.glare, w.veiling_glare);
        add("tails", light.tail_share, w.tail_share);
        add("tail radius", light.tail_radius_mm, w.tail_radius_mm);
        add("face", light.face.expect("black and white"), self.optics.stray().map_or(0.0, |s| s.kappa));
        out
    }

    /// Haze of the calibration's tiles against the mean of the truth over each, in the three colours.
    ///
    /// # Panics
    /// Where the calibration lacks haze.
    #[must_use]
    pub fn haze(&self, c: &Calibrated) -> [Vec<Compared>; 3] {
        let r = c.radiometry();
        let haze = r.stray.as_ref().and_then(|s| s.haze.as_ref()).expect("a trap");
        // electrons are told by the calibration's own gain
        let gain = r.electrons_per_count.map(|g| g.value / self.sensor.electrons_per_count());
        let gain = gain.iter().sum::<f64>() / 3.0;
        let map = PixelMap::new(&self.d);
        let (w, h) = (map.width(), map.height());
        let [across, down] = haze.tiles.map(|n| n as usize);
        let mut truth = vec![[[0.0; 2]; 3]; across * down];
        for p in 0..w * h {
            let value = self
                .optics
                .stray()
                .map_or(0.0, |s| s.haze((p % w) as f64 / w as f64, (p / w) as f64 / h as f64));
            let tile = (p / w * down / h) * across + p % w * across / w;
            let sum = &mut truth[tile][map.channel(p)];
            *sum = [sum[0] + value, sum[1] + 1.0];
        }
        [0, 1, 2].map(|k| {
            (0..truth.len())
                .map(|tile| Compared {
                    name: format!("haze of tile {tile}"),
                    found: Known::new(f64::from(haze.rates_e_s[tile][k]), haze.sigma_e_s[k]),
                    truth: gain * truth[tile][k][0] / truth[tile][k][1],
                })
                .collect()
        })
    }
}

/// A session of these poses, with the certificate that its kind goes with.
#[must_use]
pub fn input<'a>(name: &str, kind: ScanKind, poses: &'a [PoseRecord]) -> Input<'a> {
    Input {
        name: name.to_owned(),
        kind,
        certificate: match kind {
            ScanKind::White => Some(Certificate::virtual_white()),
            ScanKind::Black => Some(Certificate::virtual_black()),
            _ => None,
        },
        notes: Vec::new(),
        poses: Box::new(|| Box::new(poses.iter().cloned())),
    }
}

/// A normal deviate that is a function of a word: the sum of twelve even ones (splitmix64), less six.
#[must_use]
pub fn normal(word: u64) -> f64 {
    let mut state = word.wrapping_mul(0xd134_2543_de82_ef95) ^ 0x2545_f491_4f6c_dd1d;
    (0..12)
        .map(|_| {
            state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
            let mut z = state;
            z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
            z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
            ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64
        })
        .sum::<f64>()
        - 6.0
}
