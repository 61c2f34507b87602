//! Poses in, a measured table out. A live scan and a replay both call exactly this, pose by pose in the same order, so
//! both give the same bits; one pose's frames are held at a time.

mod attributes;

use std::sync::Arc;

use gonio_brdf::maps::FitError;
use gonio_brdf::models::Coat;
use gonio_brdf::{Anisotropic, Flag, Meaning, Measured};
use gonio_instrument::{PoseRecord, SampleRecord};
use gonio_optics::{Angle, Vec3, quadrature};

use crate::azimuths::{Azimuths, Isotropy};
use crate::cells::{Binning, Cell, PixelValue, cells, cells_over, side_cells};
use crate::closure::{self, Repeated};
use crate::coat::{self, CoatFit, Gloss, Verdict};
use crate::dark::{DarkFrames, DarkModel};
use crate::error::AcquisitionError;
use crate::fill::{Filling, fill, fill_by};
use crate::lamp::Scatter;
use crate::merge::{check_frames, merge};
use crate::options::{ClearCoat, Options};
use crate::pixel_map::{PixelMap, PoseView};
use crate::radiometry::azimuth_part::{self, Corrections};
use crate::radiometry::stray::Stray;
use crate::radiometry::table_part::Returned;
use crate::radiometry::{chart, face, table_part};
use crate::reference::WhiteReference;
use crate::row::Row;
use crate::sensor::Sensor;
use crate::statistics::PoseStatistics;
use crate::sweep::{Sweep, Window};
use crate::table::{Budget, Common, assemble};
use crate::weights::Weights;

/// What the poses of a tilt share.
struct Tilt {
    /// Thousandths of a degree.
    key: i64,
    view: PoseView,
    weights: Weights,
    sweep: Sweep,
    /// Mean of cos θ' over the lamp.
    mean_cos: f64,
}

impl Tilt {
    fn new(key: i64, map: &PixelMap, view: PoseView, white: &WhiteReference, options: &Options) -> Self {
        let light = Vec3::from_polar(view.theta_i, Angle::ZERO);
        let lights = quadrature::cone(light, map.description().lamp.half_angle(), 4);
        let mean_cos = lights.iter().map(|l| l.z.max(0.0)).sum::<f64>() / lights.len() as f64;
        let mean_cos = mean_cos.max(gonio_optics::COS_FLOOR);
        let weights = Weights::new(map, &view, &options.grid);
        let sweep = Sweep::new(map, &view, &weights, white, mean_cos);
        Self { key, view, weights, sweep, mean_cos }
    }
}

/// The first pose.
struct First {
    place: (i64, i64),
    cells: Vec<Option<Cell>>,
}

/// Turns poses into a table, one after the other.
pub struct Reducer {
    map: Arc<PixelMap>,
    white: WhiteReference,
    options: Options,
    sensor: Sensor,
    dark_frames: DarkFrames,
    dark: DarkModel,
    /// Takes stray light off, where the instrument's calibration knows of any.
    stray: Option<Stray>,
    /// What its own uncertainty leaves in f, row by row: sum of squares over poses, and their number.
    stray_rows: Vec<([f64; 3], u32)>,
    rows: Vec<Row>,
    /// What one reading's scatter leaves in the white reference's pixels that a row uses.
    white_shares: Vec<f64>,
    /// `rows` with the pixels of a gloss replaced by the base around it.
    rows_without_gloss: Vec<Row>,
    /// Largest share of a cell's weight that a gloss hid, over the whole grid.
    hidden: Vec<f32>,
    gloss: Vec<Gloss>,
    /// What is kept apart by spin and side, for the test of isotropy.
    azimuths: Azimuths,
    statistics: Vec<PoseStatistics>,
    /// The first pose (tilt and spin, thousandths of a degree) with its cells, and what it gave once more.
    first: Option<First>,
    repeated: Option<Repeated>,
    /// The last tilt: all its spins share what was built for it.
    last: Option<Tilt>,
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
        mut options: Options,
    ) -> Result<Self, AcquisitionError> {
        options.check()?;
        // directions are no better than the calibration says
        if let Some(record) = &map.description().calibration_record {
            options.angle_uncertainty_deg = options.angle_uncertainty_deg.max(record.direction_deg());
        }
        let pixels = map.width() * map.height();
        let sensor = Sensor::of(map.description(), &options);
        Ok(Self {
            dark_frames: DarkFrames::default(),
            dark: DarkFrames::default().model(&sensor, pixels),
            sensor,
            stray: Stray::of(&map),
            stray_rows: vec![([0.0; 3], 0); options.grid.theta_i_deg.len()],
            rows: vec![Row::default(); options.grid.theta_i_deg.len()],
            white_shares: vec![0.0; options.grid.theta_i_deg.len()],
            rows_without_gloss: vec![Row::default(); options.grid.theta_i_deg.len()],
            hidden: vec![0.0; options.grid.len()],
            gloss: Vec::new(),
            azimuths: Azimuths::default(),
            statistics: Vec::new(),
            first: None,
            repeated: None,
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
        if let Some(dark) = self.dark_frames.take(record, &self.sensor) {
            self.dark = dark;
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
        let tilt = match self.last.take().filter(|l| l.key == key) {
            Some(same) => self.last.insert(same),
            None => {
                let tilt = Tilt::new(key, &self.map, self.map.view(pose), &self.white, &self.options);
                let lowest = self.options.limit_deg.to_radians().cos();
                let used = |p: usize| {
                    tilt.view.visible[p] && tilt.view.sample_from_lab.apply(self.map.direction(p)).z > lowest
                };
                self.white_shares[ti] = self.white.share_of_lamp(used);
                self.last.insert(tilt)
            }
        };
        let swept = match &self.stray {
            None => tilt.sweep.pose(record, &self.map, &self.sensor, &self.dark)?,
            // the whole picture first: light comes astray from pixels that do not see the sample, too
            Some(stray) => {
                let all = vec![true; self.map.width() * self.map.height()];
                let mut merged = merge(record, &self.map, &self.sensor, &self.dark, &all)?;
                let left = stray.correct(&mut merged.pixels, &self.map);
                let per_rate =
                    table_part::per_rate(&self.white.scale, &tilt.view.visible, &self.map, tilt.mean_cos);
                let (sum, n) = &mut self.stray_rows[ti];
                for c in 0..3 {
                    sum[c] += (left[c] * per_rate[c]).powi(2);
                }
                *n += 1;
                tilt.sweep.picture(&merged, &tilt.weights, &self.white.relative_variance)
            }
        };
        let bins =
            Binning { azimuths: self.options.grid.phi_deg.len(), min_coverage: self.options.min_coverage };
        let found = cells(&tilt.weights, &swept.sums, &bins);
        let place = (key, (record.readback.spin.degrees() * 1e3).round() as i64);
        match &self.first {
            // the first pose once more is a check, not another spin
            Some(first) if first.place == place => {
                self.repeated = closure::repeated(&first.cells, &found);
                self.statistics.push(PoseStatistics::new(record, theta_i, &swept, &found, &self.options));
                return Ok(self.statistics.last());
            }
            None => self.first = Some(First { place, cells: found.clone() }),
            Some(_) => {}
        }
        // two thousandths of a degree are the encoders' rounding
        let off = Angle::from_degrees(if off < 2e-3 { 0.0 } else { off });
        self.rows[ti].add(&found, off, swept.lamp_relative);
        // spin s turns the sample, so the light goes round it the other way; a tilt to the other side puts it opposite
        let phi_i =
            if record.readback.tilt.degrees() < 0.0 { 180.0 } else { 0.0 } - record.readback.spin.degrees();
        self.azimuths.add(ti, phi_i, &side_cells(&tilt.weights, &swept.sums, &bins));
        self.statistics.push(PoseStatistics::new(record, theta_i, &swept, &found, &self.options));
        if self.options.clear_coat != ClearCoat::None {
            let without = {
                let reached = &tilt.sweep.reached;
                let hidden = coat::gloss::find(&self.map, &tilt.view, &swept.window, reached, tilt.mean_cos);
                let first = self.options.grid.index(ti, 0, 0);
                let share = &mut self.hidden[first..first + found.len()];
                let out = without_gloss(tilt, swept.window, &bins, &hidden, &found, share);
                self.gloss.extend(hidden.gloss);
                out
            };
            self.rows_without_gloss[ti].add(&without, off, swept.lamp_relative);
        }

        Ok(self.statistics.last())
    }

    /// Takes off what the camera's face threw back, and adds the part of σ that stray light leaves. A gloss of this index is not in the table.
    fn take_off_returned(&self, m: &mut Measured, gloss_index: Option<f64>) {
        let Some(stray) = &self.stray else { return };
        let returned = stray.light().face.map(|kappa| Returned {
            taken: face::take_off(m, &self.map, kappa.value, gloss_index),
            kappa,
            white: self.white.own_light,
        });
        table_part::add(m, &self.stray_left(), returned.as_ref(), self.white.stray_relative);
    }

    /// What glare, tails and haze are uncertain by, in f, row by row.
    fn stray_left(&self) -> Vec<[f64; 3]> {
        self.stray_rows.iter().map(|(s, n)| s.map(|v| (v / f64::from((*n).max(1))).sqrt())).collect()
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

    /// What the first pose gave once more at the end, where the plan has it so.
    #[must_use]
    pub const fn repeated(&self) -> Option<Repeated> {
        self.repeated
    }

    /// How much the lamp's monitor scatters from pose to pose, by the readings of the sample and those of the white reference together: a reference of a few
    /// poses tells little of it by itself.
    #[must_use]
    pub fn lamp(&self) -> Scatter {
        let readings: Vec<f64> = self.statistics.iter().map(|s| s.lamp_monitor).collect();
        Scatter::of(&readings).with(self.white.lamp)
    }

    /// The white reference.
    #[must_use]
    pub const fn white(&self) -> &WhiteReference {
        &self.white
    }

    /// Standard uncertainty of a direction.
    #[must_use]
    pub const fn angle_uncertainty(&self) -> Angle {
        Angle::from_degrees(self.options.angle_uncertainty_deg)
    }

    /// What each pose showed at the mirror direction, in the order they came; empty where no coat is looked for.
    #[must_use]
    pub fn gloss(&self) -> &[Gloss] {
        &self.gloss
    }

    /// What turning the sample shows; `None` before a pose.
    #[must_use]
    pub fn isotropy(&self) -> Option<Isotropy> {
        self.azimuths.isotropy(&self.options.grid, self.options.limit_deg)
    }

    /// The table over four angles, corrected like the other one; nothing is filled and no coat taken off.
    #[must_use]
    pub fn azimuth_table(&self) -> Anisotropic {
        let meaning = Meaning::CellMean { lamp_half_angle: self.map.description().lamp.half_angle() };
        let common =
            self.white.certificate_uncertainty.hypot(self.white.share_of_lamp(|_| true) * self.lamp().sigma);
        let o = &self.options;
        let mut t = self.azimuths.table(&o.grid, meaning, o.limit_deg, common);
        let corrections = Corrections {
            rows: &self.stray_left(),
            white: self.white.stray_relative,
            own_light: self.white.own_light,
        };
        azimuth_part::correct(&mut t, &self.map, &corrections);
        t.attributes = self.sample_attributes();
        t.attributes.append(&mut self.calibration_attributes());
        t
    }

    /// Whether there is a coat to separate, as far as the poses tell.
    #[must_use]
    pub fn coat(&self) -> Verdict {
        let found = match self.options.clear_coat {
            ClearCoat::None => return Verdict::None("not looked for".to_owned()),
            _ => coat::index::judge(&self.gloss, self.white.certificate_uncertainty),
        };
        match self.options.coat_index {
            Some(index) => Verdict::Coat(CoatFit {
                index,
                index_sigma: 0.0,
                ..match found {
                    Verdict::Coat(fit) => fit,
                    Verdict::None(_) => CoatFit::of_index(index),
                }
            }),
            None => found,
        }
    }

    /// What is measured so far: holes are invalid, nothing is filled. Cheap enough for every capture.
    #[must_use]
    pub fn snapshot(&self) -> Measured {
        let mut m = self.table(&|_, _| ()).0;
        self.correct_colours(&mut m);
        // parts are for the finished table: a watcher of the scan has no use for megabytes a pose
        m.sigma_parts.clear();
        m.attributes = self.coat_attributes();
        m
    }

    /// The table with holes filled and its attributes. More poses may follow.
    #[must_use]
    pub fn finish(&self) -> Measured {
        let done = std::cell::Cell::new(None);
        let made = self.table(&|m, coat| {
            if self.options.fill {
                done.set(Some(fill(m, coat, self.options.limit_deg)));
            }
        });
        self.completed(made, done.get())
    }

    /// The same with holes and grazing angles filled by a way of one's own choice.
    ///
    /// # Errors
    /// [`FitError`] where flake space is asked for and the measured cells do not make a map.
    pub fn finish_by(&self, how: Filling) -> Result<Measured, FitError> {
        let failed = std::cell::Cell::new(None);
        let made = self.table(&|m, coat| failed.set(fill_by(m, coat, self.options.limit_deg, how).err()));
        match failed.into_inner() {
            Some(e) => Err(e),
            None => Ok(self.completed(made, Some(how))),
        }
    }

    fn completed(
        &self,
        (mut m, budget, measured): (Measured, Budget, usize),
        how: Option<Filling>,
    ) -> Measured {
        crate::budget::complete(&mut m);
        self.correct_colours(&mut m);
        m.attributes = self.attributes(&budget, measured);
        if let Some(how) = how {
            m.attributes.insert("filled_by".to_owned(), how.to_string());
        }
        m
    }

    /// From the camera's channels to linear Rec. 709, where the calibration has a chart.
    fn correct_colours(&self, m: &mut Measured) {
        if let Some(c) = self.map.description().radiometry.as_ref().and_then(|r| r.colour.as_ref()) {
            chart::take_through(m, &c.matrix);
        }
    }

    /// Where the uncertainty of the measured cells comes from.
    #[must_use]
    pub fn budget(&self) -> Budget {
        self.table(&|_, _| ()).1
    }

    /// The table, its budget, and the number of measured cells.
    fn table(&self, filling: &dyn Fn(&mut Measured, Option<&Coat>)) -> (Measured, Budget, usize) {
        let lamp = self.lamp().sigma;
        let common = Common {
            certificate: self.white.certificate_uncertainty,
            lamp,
            white_lamp: self.white_shares.iter().map(|share| share * lamp).collect(),
            angle: Angle::from_degrees(self.options.angle_uncertainty_deg),
            lamp_half_angle: self.map.description().lamp.half_angle(),
        };
        let measured = |m: &Measured| m.flag.iter().filter(|f| **f == Flag::Measured).count();
        let limit = self.options.limit_deg;
        let Verdict::Coat(fit) = self.coat() else {
            let (mut m, budget) = assemble(&self.options.grid, &self.rows, &common, limit);
            let count = measured(&m);
            filling(&mut m, None);
            self.take_off_returned(&mut m, None);
            return (m, budget, count);
        };
        let (mut m, budget) = assemble(&self.options.grid, &self.rows_without_gloss, &common, limit);
        coat::separate::flag_hidden(&mut m, &self.hidden);
        let count = measured(&m);
        let index = Coat { index: fit.index };
        filling(&mut m, Some(&index));
        self.take_off_returned(&mut m, Some(fit.index));
        let [two_way, single_pass] = coat::separate::bases(&m, &index);
        m.base = Some(two_way);
        m.base_single_pass = Some(single_pass);
        coat::separate::add_gloss(&mut m, &fit, common.lamp_half_angle);
        (m, budget, count)
    }
}

/// The cells with the pixels under a gloss replaced by the base around it; `share` takes how much of each cell they were.
fn without_gloss(
    tilt: &Tilt,
    mut pixels: Window,
    bins: &Binning,
    hidden: &coat::gloss::Hidden,
    found: &[Option<Cell>],
    share: &mut [f32],
) -> Vec<Option<Cell>> {
    let mut without = found.to_vec();
    if hidden.pixels.is_empty() {
        return without;
    }
    let mut under = hidden.pixels.clone();
    under.sort_unstable();
    for (&p, &f) in hidden.pixels.iter().zip(&hidden.base) {
        pixels.set(p as usize, PixelValue { f, shot: 0.0, read: 0.0, dark: 0.0, reference: 0.0 });
    }
    let sigma = hidden.gloss.as_ref().map_or([0.0; 3], |g| g.base_sigma);
    for (cell, value, part) in cells_over(
        &tilt.weights,
        &|p| pixels.get(p),
        bins,
        &|p| under.binary_search(&(p as u32)).is_ok(),
        &tilt.sweep.reached_cells,
    ) {
        without[cell] = value.map(|mut v| {
            v.coat = sigma.map(|s| (part * s).powi(2));
            v
        });
        share[cell] = share[cell].max(part as f32);
    }
    without
}
