//! An adaptive scan: after each pose the next one is that which the uncertainty of a scene's pictures asks for most, until a bound is kept.

use std::cell::RefCell;
use std::path::Path;

use gonio_acquisition::engine::Choice;
use gonio_acquisition::{PixelMap, Reducer};
use gonio_instrument::Cancel;
use gonio_render::trace::Gathered;
use gonio_tailor::next_pose;

use crate::control::Control;
use crate::outcome::Failure;
use crate::reduction;
use crate::rig::Rig;
use crate::scanning::{self, Job, Recorded};
use crate::scenes;

/// Pixels along the longer side of the pictures that are compared.
const SIDE: u32 = 96;

/// The scene that asks, and the bound.
pub struct Asking {
    /// Its name.
    pub name: String,
    scene: Gathered,
    /// Mean ΔE over its pixels that will do.
    pub bound: f64,
}

impl Asking {
    /// Opens a scene.
    ///
    /// # Errors
    /// [`Failure::Usage`] for a scene that cannot be used or a bound that cannot be.
    pub fn open(path: &Path, bound: f64) -> Result<Self, Failure> {
        if !(bound.is_finite() && bound > 0.0) {
            return Err(Failure::usage(format!("--max-delta-e {bound}: expected a number above 0")));
        }
        let (name, scene) = scenes::gathered(scenes::open(path)?, SIDE, 4, 60.0)?;
        Ok(Self { name, scene, bound })
    }
}

/// Records; every pose is reduced before the next is chosen, the shutter closed meanwhile.
///
/// # Errors
/// As [`scanning::record`].
#[allow(clippy::too_many_arguments)] // one call, all of it needed
pub fn record(
    job: &Job<'_>,
    rig: &mut Rig,
    map: &PixelMap,
    cancel: &Cancel,
    control: Option<&Control>,
    reducer: &mut Reducer,
    lost: &mut Vec<String>,
    asking: &Asking,
) -> Result<Recorded, Failure> {
    let poses = job.plan.poses();
    let tilt = |index: u32| poses.get(index as usize).map(|p| p.tilt.degrees());
    let state = RefCell::new((reducer, lost));
    scanning::record_choosing(
        job,
        rig,
        map,
        cancel,
        control,
        &mut |pose| {
            let (reducer, lost) = &mut *state.borrow_mut();
            reduction::add(reducer, &pose, lost);
        },
        &mut |ahead| {
            let measured = scenes::measured_body(&state.borrow().0.snapshot());
            let left: Vec<f64> = ahead.iter().filter_map(|i| tilt(*i)).collect();
            let said = next_pose(&asking.scene, &measured, &left, &scenes::fill_as_a_scan);
            tracing::info!("{}: expected mean ΔE {:.3}, bound {}", asking.name, said.expected, asking.bound);
            if said.expected <= asking.bound {
                return Choice::Enough;
            }
            let wanted = said
                .tilt_deg
                .and_then(|t| ahead.iter().find(|i| tilt(**i).is_some_and(|x| (x - t).abs() < 1e-9)));
            wanted.map_or(Choice::AsPlanned, |i| Choice::This(*i))
        },
    )
}
