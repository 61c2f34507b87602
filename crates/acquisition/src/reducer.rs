//! Poses in, a measured table out. A live scan and a replay both call exactly this, pose by pose in the same order, so
//! both give the same bits; one pose's frames are held at a time.

use std::collections::BTreeMap;
use std::sync::Arc;

use gonio_brdf::{Flag, Measured};
use gonio_instrument::{PoseRecord, SampleRecord};
use gonio_optics::{Angle, Vec3, quadrature};

use crate::cells::{Binning, cells};
use crate::dark::{DarkFrames, DarkModel};
use crate::error::AcquisitionError;
use crate::fill::fill;
use crate::merge::{check_frames, merge};
use crate::options::Options;
use crate::pixel_map::{PixelMap, PoseView};
use crate::reference::WhiteReference;
use crate::row::Row;
use crate::sensor::Sensor;
use crate::statistics::PoseStatistics;
use crate::table::{Budget, Common, PARTS, assemble};
use crate::weights::Weights;

/// Turns poses into a table, one after the other.
pub struct Reducer {
    map: Arc<PixelMap>,
    white: WhiteReference,
    options: Options,
    sensor: Sensor,
    dark_frames: DarkFrames,
    dark: DarkModel,
    rows: Vec<Row>,
    statistics: Vec<PoseStatistics>,
    /// View and weights of the last tilt: all its spins share them.
    last: Option<(i64, PoseView, Weights)>,
    sample: SampleRecord,
}

impl Reducer {
    /// A reducer that has seen nothing.
    ///
    /// # Errors
    /// [`AcquisitionError::Setting`] for settings outside their range.
    pub fn new(
        map: Arc<PixelMap>,
        white: WhiteReference,
        sample: SampleRecord,
        options: Options,
    ) -> Result<Self, AcquisitionError> {
        options.check()?;
        let pixels = map.width() * map.height();
        Ok(Self {
            sensor: Sensor::new(&map.description().camera, options.saturation, &options.linearity),
            dark_frames: DarkFrames::default(),
            dark: DarkModel::none(pixels),
            rows: vec![Row::default(); options.grid.theta_i_deg.len()],
            statistics: Vec::new(),
            last: None,
            map,
            white,
            options,
            sample,
        })
    }

    /// Uses the dark frames of a record (those taken with the shutter closed) from here on.
    ///
    /// # Errors
    /// [`AcquisitionError`] for frames of the wrong size.
    pub fn add_dark(&mut self, record: &PoseRecord) -> Result<(), AcquisitionError> {
        check_frames(record, &self.map)?;
        let mut fresh = false;
        for e in record.exposures.iter().filter(|e| !e.shutter_open) {
            self.dark_frames.add(&e.frame, &self.sensor);
            fresh = true;
        }
        if fresh {
            self.dark = self.dark_frames.model(&self.sensor, self.map.width() * self.map.height());
        }
        Ok(())
    }

    /// Adds a pose: its dark frames, then its light. A record of dark frames alone is no error.
    ///
    /// # Errors
    /// [`AcquisitionError`] for frames of the wrong size, or a θi that no row stands for; the pose then counts for nothing.
    pub fn add_pose(&mut self, record: &PoseRecord) -> Result<Option<&PoseStatistics>, AcquisitionError> {
        self.add_dark(record)?;
        if record.exposures.iter().all(|e| !e.shutter_open) {
            return Ok(None);
        }
        // a thousandth of a degree: what the encoders tell, and the same for every spin of a tilt
        let key = (record.readback.tilt.degrees() * 1e3).round() as i64;
        let mut pose = record.readback;
        pose.tilt = Angle::from_degrees(key as f64 * 1e-3);
        let (_, theta_i) = self.map.frame(pose);
        let (ti, off) = self.nearest_row(theta_i);
        if off > self.options.row_tolerance_deg {
            return Err(AcquisitionError::OffGrid {
                pose: record.index,
                theta_i_deg: theta_i.degrees(),
                off_deg: off,
                limit_deg: self.options.row_tolerance_deg,
            });
        }
        let (_, view, weights) = match self.last.take().filter(|l| l.0 == key) {
            Some(same) => self.last.insert(same),
            None => {
                let view = self.map.view(pose);
                let weights = Weights::new(&self.map, &view, &self.options.grid);
                self.last.insert((key, view, weights))
            }
        };
        let merged = merge(record, &self.map, &self.sensor, &self.dark, &view.visible)?;
        let light = Vec3::from_polar(view.theta_i, Angle::ZERO);
        let lights = quadrature::cone(light, self.map.description().lamp.half_angle(), 4);
        let mean_cos = lights.iter().map(|l| l.z.max(0.0)).sum::<f64>() / lights.len() as f64;
        let found = cells(
            &self.map,
            view,
            weights,
            &merged,
            &self.white,
            &Binning {
                mean_cos_i: mean_cos.max(gonio_optics::COS_FLOOR),
                azimuths: self.options.grid.phi_deg.len(),
                min_coverage: self.options.min_coverage,
            },
        );
        // two thousandths of a degree are the encoders' rounding
        self.rows[ti].add(
            &found,
            Angle::from_degrees(if off < 2e-3 { 0.0 } else { off }),
            merged.lamp_relative,
        );
        self.statistics.push(PoseStatistics::new(record, theta_i, &merged, &found, &self.options));
        Ok(self.statistics.last())
    }

    fn nearest_row(&self, theta_i: Angle) -> (usize, f64) {
        let mut best = (0, f64::INFINITY);
        for (k, deg) in self.options.grid.theta_i_deg.iter().enumerate() {
            let off = (deg - theta_i.degrees()).abs();
            if off < best.1 {
                best = (k, off);
            }
        }
        best
    }

    /// What each pose gave, in the order they came.
    #[must_use]
    pub fn statistics(&self) -> &[PoseStatistics] {
        &self.statistics
    }

    /// What is measured so far: holes are invalid, nothing is filled. Cheap enough for every capture.
    #[must_use]
    pub fn snapshot(&self) -> Measured {
        self.table().0
    }

    /// The table with holes filled and its attributes. More poses may follow.
    #[must_use]
    pub fn finish(&self) -> Measured {
        let (mut m, budget) = self.table();
        let measured = m.flag.iter().filter(|f| **f == Flag::Measured).count();
        if self.options.fill {
            fill(&mut m, self.options.limit_deg);
        }
        m.attributes = self.attributes(&budget, measured);
        m
    }

    /// Where the uncertainty of the measured cells comes from.
    #[must_use]
    pub fn budget(&self) -> Budget {
        self.table().1
    }

    fn table(&self) -> (Measured, Budget) {
        let common = Common {
            certificate: self.white.certificate_uncertainty,
            angle: Angle::from_degrees(self.options.angle_uncertainty_deg),
            lamp_half_angle: self.map.description().lamp.half_angle(),
        };
        assemble(&self.options.grid, &self.rows, &common, self.options.limit_deg)
    }

    fn attributes(&self, budget: &Budget, measured: usize) -> BTreeMap<String, String> {
        let o = &self.options;
        let mut a = BTreeMap::new();
        let mut put = |k: &str, v: String| {
            if !v.is_empty() {
                a.insert(k.to_owned(), v);
            }
        };
        put("instrument", self.map.description().name.clone());
        put("sample_kind", self.sample.kind.name().to_owned());
        put("sample_id", self.sample.id.clone());
        put("sample_name", self.sample.name.clone());
        put("sample_batch", self.sample.batch.clone());
        put("sample_operator", self.sample.operator.clone());
        put("sample_note", self.sample.note.clone());
        put("reference_serial", self.white.serial.clone());
        put("reference_notes", self.white.notes.join("; "));
        put("common_relative_uncertainty", format!("{}", self.white.certificate_uncertainty));
        put("units", "1/sr, without the cosine".to_owned());
        put(
            "conventions",
            "phi = 0 on the light's side, 180 on the mirror side; linear RGB of the camera's channels"
                .to_owned(),
        );
        put("clear_coat", "none".to_owned());
        put("limit_deg", format!("{}", o.limit_deg));
        put("angle_uncertainty_deg", format!("{}", o.angle_uncertainty_deg));
        put("min_coverage", format!("{}", o.min_coverage));
        put("saturation", format!("{}", o.saturation));
        put("linearity", format!("{:?}", o.linearity));
        put("row_tolerance_deg", format!("{}", o.row_tolerance_deg));
        put("filled", format!("{}", o.fill));
        put("poses", format!("{}", self.statistics.len()));
        put("measured_cells", format!("{measured}"));
        put("dark_frames", format!("{}", self.dark_frames.frames()));
        put("hot_pixels", format!("{}", self.dark.hot_pixels()));
        let parts: Vec<String> =
            PARTS.iter().zip(budget.relative).map(|(n, v)| format!("{n} {v:.3e}")).collect();
        put("uncertainty_budget_relative_rms", parts.join(", "));
        a
    }
}
