//! Where the heads look at a pose.

use gonio_instrument::{Description, Pose, TextureCamera};
use gonio_optics::{Angle, Rotation, Vec3};

/// Largest polar angle of light and view at which a picture is used.
pub(super) const STEEPEST: Angle = Angle::from_degrees(80.0);
/// Beyond the lamp's own radius, how far from the mirror direction a head must look.
const GLOSS_MARGIN: Angle = Angle::from_degrees(0.6);

/// One head at a pose.
#[derive(Clone, Copy, Debug)]
pub(super) struct Head {
    /// Its place in the frame, from the top.
    pub number: usize,
    /// Towards the light, sample frame at spin 0.
    pub light: Vec3,
    /// Towards the head, sample frame at spin 0.
    pub view: Vec3,
    /// Columns per mm of the sample's x and y, rows per mm of x and y; x and y are fixed to the sample.
    pub pixel_from_sample: [[f64; 2]; 2],
}

/// The heads that see the sample lit at a pose read back.
pub(super) fn heads(d: &Description, camera: &TextureCamera, pose: Pose) -> Vec<Head> {
    let axis = d.holder.tilt_axis();
    let lamp = d.lamp.direction();
    let normal = Rotation::about_axis(axis, pose.tilt).apply(d.holder.normal_at_zero());
    let x = normal.cross(axis).normalized();
    let y = normal.cross(x);
    let sample = |v: Vec3| Vec3::new(v.dot(x), v.dot(y), v.dot(normal));
    let light = sample(lamp);
    let (sin, cos) = pose.spin.sin_cos();
    // axes fixed to the sample, turned by the spin
    let (turned_x, turned_y) = (x * cos + y * sin, y * cos - x * sin);
    let least = STEEPEST.cos();
    if light.z < least {
        return Vec::new();
    }
    let per_mm = 1.0 / camera.pixel_mm;
    let all = camera.heads_deg.iter().enumerate();
    all.filter_map(|(number, deg)| {
        let to_head = Rotation::about_axis(axis, Angle::from_degrees(*deg)).apply(lamp);
        let view = sample(to_head);
        if view.z < least {
            return None;
        }
        let columns = axis.cross(to_head);
        Some(Head {
            number,
            light,
            view,
            pixel_from_sample: [
                [turned_x.dot(columns) * per_mm, turned_y.dot(columns) * per_mm],
                [turned_x.dot(axis) * per_mm, turned_y.dot(axis) * per_mm],
            ],
        })
    })
    .collect()
}

impl Head {
    /// Whether the head looks into the mirror image of the lamp.
    pub(super) fn in_gloss(&self, lamp_half_angle: Angle) -> bool {
        let mirror = Vec3::new(-self.light.x, -self.light.y, self.light.z);
        self.view.angle_to(mirror) < lamp_half_angle + GLOSS_MARGIN
    }
}

/// Pixels that bracketing cares for: those of heads that see the sample lit, gloss or not.
#[must_use]
pub fn interest(d: &Description, readback: Pose) -> Vec<bool> {
    let mut out = vec![false; d.camera.pixels()];
    let Some(camera) = d.textures() else { return out };
    let picture = (camera.size[0] * camera.size[1]) as usize;
    for head in heads(d, camera, readback) {
        if head.in_gloss(d.lamp.half_angle()) {
            continue;
        }
        if let Some(part) = out.get_mut(head.number * picture..(head.number + 1) * picture) {
            part.fill(true);
        }
    }
    out
}
