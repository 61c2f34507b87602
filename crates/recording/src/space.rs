//! Is there room for a scan? Asked before it begins, because a full disk in the middle costs a pose.

use std::path::Path;

use gonio_instrument::Plan;
use gonio_instrument::description::CameraGeometry;

use crate::RecordingError;

/// Frames beside the bracket that a pose may hold: dark ones.
const DARK_FRAMES: u64 = 2;
/// Header, wire log and events of a pose, generously.
const NOTES_PER_POSE: u64 = 1 << 20;

/// Most bytes that a session of this plan can take: every pose with its full bracket, incompressible.
#[must_use]
pub fn space_needed(plan: &Plan, camera: &CameraGeometry) -> u64 {
    let poses = plan.tilt_deg.len() as u64 * plan.spin_deg.len() as u64 + u64::from(plan.repeat_first);
    poses.saturating_mul(space_per_pose(plan, camera))
}

/// Most bytes that one pose of this plan can take.
#[must_use]
pub fn space_per_pose(plan: &Plan, camera: &CameraGeometry) -> u64 {
    let frames = u64::from(plan.max_exposures) * u64::from(plan.repeats) + DARK_FRAMES;
    let frame = camera.pixels() as u64 * 2 + 1024;
    frames.saturating_mul(frame).saturating_add(NOTES_PER_POSE)
}

/// Bytes free for this user on the file system that holds `path`, or will hold it.
///
/// # Errors
/// [`RecordingError::Absent`] where not even its folder exists, and what else the system says.
pub fn free_space(path: &Path) -> Result<u64, RecordingError> {
    let folder = path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or_else(|| Path::new("."));
    let asked = if path.exists() { path } else { folder };
    let s = rustix::fs::statvfs(asked).map_err(|e| RecordingError::io("open", asked, 0, &e.into()))?;
    Ok(s.f_bavail.saturating_mul(s.f_frsize))
}

/// Whether the plan fits beside what is on the disk.
///
/// # Errors
/// [`RecordingError::NotEnoughSpace`] with both numbers; those of [`free_space`].
pub fn check_space(path: &Path, plan: &Plan, camera: &CameraGeometry) -> Result<(), RecordingError> {
    let (needed, free) = (space_needed(plan, camera), free_space(path)?);
    if free < needed {
        return Err(RecordingError::NotEnoughSpace { path: path.to_owned(), needed, free });
    }
    Ok(())
}
