//! Pixel → lab direction at F1, with what of the sensor never sees the sample: beyond the rim, the openings of lamp and shaft.
//!
//! Kept per pixel corner, so that solid angles and the parts of a pixel that fall into a bin follow without tracing again.

use gonio_instrument::{Channel, Description, Pose};
use gonio_optics::{Angle, Rotation, Vec3};
use rayon::prelude::*;

use crate::footprint::Footprint;
use crate::holder::Holder;
use crate::optics::Optics;

/// Directions of a camera, traced once.
#[derive(Clone, Debug)]
pub struct PixelMap {
    description: Description,
    optics: Optics,
    /// (width + 1) × (height + 1) unit directions, lab frame; zero where a ray misses.
    corners: Vec<Vec3>,
    /// Mirror point of each pixel's centre, mm; what the pixel sees at every pose is decided here.
    mirror: Vec<Vec3>,
    /// Whether the pixel looks at the mirror, clear of rim and openings.
    clear: Vec<bool>,
    /// Standard uncertainty of where it is looked at, across the line of sight, mm.
    aim_mm: f64,
}

/// Share of the lit share itself up to which it may be uncertain: a pixel at the edge of the spot that is off by more would stand out of its noise.
const UNSURE: f64 = 0.004;

/// A pose seen by the sensor.
#[derive(Clone, Debug)]
pub struct PoseView {
    /// Sample frame at this pose: z the normal, x towards the light.
    pub sample_from_lab: Rotation,
    /// Angle of incidence.
    pub theta_i: Angle,
    /// Per pixel, whether it sees the sample from above and nothing stands in the way.
    pub visible: Vec<bool>,
}

impl PixelMap {
    /// Traces every pixel corner and centre.
    #[must_use]
    pub fn new(description: &Description) -> Self {
        let optics = Optics::new(description);
        let [w, h] = description.camera.size.map(|n| n as usize);
        let corners: Vec<Vec3> = (0..(w + 1) * (h + 1))
            .into_par_iter()
            .map(|i| {
                let (u, v) = (i % (w + 1), i / (w + 1));
                optics.view(u as f64, v as f64).map_or(Vec3::ZERO, |view| view.direction)
            })
            .collect();
        let pixel_mm = description.camera.pitch_um * 1e-3 / description.camera.f_mm;
        let rim = description.mirror.rim_eta_deg.to_radians();
        let shaft = Vec3::from(description.holder.shaft.direction).normalized();
        let pupil = 0.5 * description.camera.pupil_diameter_mm;
        let (mirror, clear): (Vec<Vec3>, Vec<bool>) = (0..w * h)
            .into_par_iter()
            .map(|i| {
                let Some(view) = optics.view((i % w) as f64 + 0.5, (i / w) as f64 + 0.5) else {
                    return (Vec3::ZERO, false);
                };
                let m = view.mirror_mm;
                // half a pixel's diagonal and the pupil's image on the mirror, generously
                let margin = pixel_mm * (m - optics.pupil_mm()).norm() + pupil;
                let off_axis = |axis: Vec3| (m - axis * m.dot(axis)).norm();
                let behind = |axis: Vec3| m.dot(axis) > 0.0;
                let in_lamp = behind(optics.lamp())
                    && off_axis(optics.lamp()) < description.lamp.opening_radius_mm + margin;
                let in_shaft =
                    behind(shaft) && off_axis(shaft) < description.holder.shaft.opening_radius_mm + margin;
                let inside = view.cos_eta > (rim - margin / m.norm().max(1.0)).cos();
                (m, inside && !in_lamp && !in_shaft)
            })
            .unzip();
        let aim_mm = description.calibration_record.as_ref().and_then(|r| r.aim_mm).unwrap_or(0.0);
        Self { description: description.clone(), optics, corners, mirror, clear, aim_mm }
    }

    /// The description it was traced from.
    #[must_use]
    pub const fn description(&self) -> &Description {
        &self.description
    }

    /// The optics it was traced with.
    #[must_use]
    pub const fn optics(&self) -> &Optics {
        &self.optics
    }

    /// Whether a pixel looks at the mirror, clear of rim and openings.
    #[must_use]
    pub fn is_clear(&self, pixel: usize) -> bool {
        self.clear[pixel]
    }

    /// Columns.
    #[must_use]
    pub const fn width(&self) -> usize {
        self.description.camera.size[0] as usize
    }

    /// Rows.
    #[must_use]
    pub const fn height(&self) -> usize {
        self.description.camera.size[1] as usize
    }

    /// Colour channel of a pixel, 0…2.
    #[must_use]
    pub const fn channel(&self, pixel: usize) -> usize {
        let (w, p) = (self.width(), self.description.camera.pattern);
        match p.channel((pixel % w) as u32, (pixel / w) as u32) {
            Channel::Red => 0,
            Channel::Green => 1,
            Channel::Blue => 2,
        }
    }

    /// Direction of a corner of pixels, lab frame: the one above and left of the pixel in that column and row. Zero where the ray misses.
    pub(crate) fn corner(&self, column: usize, row: usize) -> Vec3 {
        self.corners[row * (self.width() + 1) + column]
    }

    /// Directions of a pixel's corners: top left, top right, bottom left, bottom right.
    #[must_use]
    pub fn corners(&self, pixel: usize) -> [Vec3; 4] {
        let w = self.width();
        let i = pixel / w * (w + 1) + pixel % w;
        [self.corners[i], self.corners[i + 1], self.corners[i + w + 1], self.corners[i + w + 2]]
    }

    /// Direction of a pixel's centre, lab frame.
    #[must_use]
    pub fn direction(&self, pixel: usize) -> Vec3 {
        let [a, b, c, d] = self.corners(pixel);
        (a + b + c + d).normalized()
    }

    /// Solid angle of a pixel seen from the sample, sr: half the product of the diagonals of the flat quadrangle.
    #[must_use]
    pub fn solid_angle(&self, pixel: usize) -> f64 {
        let [a, b, c, d] = self.corners(pixel);
        0.5 * (d - a).cross(c - b).norm()
    }

    /// What a pixel looks at on the sample; `None` below the horizon.
    #[must_use]
    pub fn footprint(&self, pixel: usize, sample_from_lab: &Rotation) -> Option<Footprint> {
        let pupil = 0.5 * self.description.camera.pupil_diameter_mm;
        Footprint::new(&self.optics, pupil, self.mirror[pixel], self.direction(pixel), sample_from_lab)
    }

    /// Share of what a pixel looks at that the lamp's spot covers, 0…1; 0 as well where it is not known to a few thousandths, for what a
    /// calibration leaves open of where mirror and camera look ([`gonio_instrument::calibration::CalibrationRecord::aim_mm`]).
    #[must_use]
    pub fn lit_share(&self, pixel: usize, sample_from_lab: &Rotation, cos_i: f64) -> f64 {
        let spot = self.description.lamp.spot_radius_mm;
        let Some(seen) = self.footprint(pixel, sample_from_lab) else { return 0.0 };
        if seen.reach_mm() + self.aim_mm / seen.view.z < spot {
            return 1.0;
        }
        let here = seen.lit_share(spot, cos_i);
        let sure = self.aim_mm == 0.0
            || [-self.aim_mm, self.aim_mm]
                .iter()
                .all(|by| (seen.moved([*by, 0.0]).lit_share(spot, cos_i) - here).abs() <= UNSURE * here);
        if sure { here } else { 0.0 }
    }

    /// Sample frame and angle of incidence at a pose read back.
    #[must_use]
    pub fn frame(&self, pose: Pose) -> (Rotation, Angle) {
        self.optics.frame(pose.tilt)
    }

    /// What decides at a pose read back which pixels see the sample.
    #[must_use]
    pub fn visibility(&self, pose: Pose) -> Visibility<'_> {
        Visibility {
            map: self,
            holder: Holder::new(&self.description, &self.optics, pose.tilt),
            normal: self.optics.normal(pose.tilt),
        }
    }

    /// What the sensor sees at a pose read back.
    #[must_use]
    pub fn view(&self, pose: Pose) -> PoseView {
        let (sample_from_lab, theta_i) = self.frame(pose);
        let visibility = self.visibility(pose);
        let visible = (0..self.mirror.len())
            .into_par_iter()
            .with_min_len(4096)
            .map(|i| visibility.cos_view(i).is_some_and(|c| c > 0.0))
            .collect();
        PoseView { sample_from_lab, theta_i, visible }
    }
}

/// Which pixels see the sample at one pose.
#[derive(Clone, Debug)]
pub struct Visibility<'a> {
    map: &'a PixelMap,
    holder: Holder,
    normal: Vec3,
}

impl Visibility<'_> {
    /// Cosine of the polar viewing angle of a pixel; `None` where nothing of the sample is seen.
    #[must_use]
    pub fn cos_view(&self, pixel: usize) -> Option<f64> {
        let m = self.map.mirror[pixel];
        let along = m.dot(self.normal);
        (self.map.clear[pixel] && along > 0.0 && !self.holder.hides(m)).then(|| along / m.norm())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use gonio_instrument::builtin;

    #[test]
    fn the_visible_share_of_the_cap_is_as_designed() {
        let d = builtin::description("reference").expect("known").expect("readable");
        let map = PixelMap::new(&d);
        let cap = std::f64::consts::TAU * (1.0 - 75f64.to_radians().cos());
        for tilt in [0.0, 40.0, 75.0] {
            let view = map.view(Pose::from_degrees(tilt, 0.0));
            let seen: f64 = (0..view.visible.len())
                .filter(|&i| view.visible[i])
                .filter(|&i| view.sample_from_lab.apply(map.direction(i)).z > 75f64.to_radians().cos())
                .map(|i| map.solid_angle(i))
                .sum();
            let share = seen / cap;
            assert!((0.85..0.95).contains(&share), "tilt {tilt}: {share}");
        }
    }
}
