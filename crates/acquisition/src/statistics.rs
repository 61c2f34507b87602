//! What each pose gave: for the report, and for whoever watches the scan.

use gonio_instrument::PoseRecord;
use gonio_optics::Angle;
use serde::Serialize;

use crate::cells::Cell;

use crate::options::Options;
use crate::sweep::Swept;

/// Figures of one pose.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct PoseStatistics {
    /// Place in the plan.
    pub index: u32,
    /// Angle of incidence, degrees.
    pub theta_i_deg: f64,
    /// Spin read back, degrees.
    pub spin_deg: f64,
    /// Exposures used.
    pub exposures: u32,
    /// Shortest and longest exposure, s.
    pub exposure_s: [f64; 2],
    /// Share of the visible pixels that every exposure shows saturated.
    pub saturated_share: f64,
    /// Share of the cells up to the limit that were measured.
    pub coverage: f64,
    /// Median of σ/f of the noise alone (shot, read, dark, reference pixels), green channel.
    pub relative_sigma: f64,
    /// Mean of the lamp monitor.
    pub lamp_monitor: f64,
}

impl PoseStatistics {
    pub(crate) fn new(
        record: &PoseRecord,
        theta_i: Angle,
        swept: &Swept,
        cells: &[Option<Cell>],
        options: &Options,
    ) -> Self {
        let np = options.grid.phi_deg.len();
        let within = |k: usize| options.grid.theta_o_deg[k / np] <= options.limit_deg + 1e-9;
        let wanted = (0..cells.len()).filter(|&k| within(k)).count();
        let seen: Vec<&Cell> =
            (0..cells.len()).filter(|&k| within(k)).filter_map(|k| cells[k].as_ref()).collect();
        let mut relative: Vec<f64> = seen
            .iter()
            .filter(|c| c.value[1] > 0.0)
            .map(|c| (c.shot[1] + c.read[1] + c.dark[1] + c.reference[1]).sqrt() / c.value[1])
            .collect();
        relative.sort_unstable_by(f64::total_cmp);
        let lit: Vec<_> = record.exposures.iter().filter(|e| e.shutter_open).collect();
        let times = lit.iter().map(|e| e.frame.exposure.as_secs_f64());
        Self {
            index: record.index,
            theta_i_deg: theta_i.degrees(),
            spin_deg: record.readback.spin.degrees(),
            exposures: swept.exposures,
            exposure_s: [times.clone().fold(f64::INFINITY, f64::min), times.fold(0.0, f64::max)],
            saturated_share: swept.saturated_share,
            coverage: seen.len() as f64 / wanted.max(1) as f64,
            relative_sigma: relative.get(relative.len() / 2).copied().unwrap_or(0.0),
            lamp_monitor: lit.iter().map(|e| e.lamp_monitor).sum::<f64>() / lit.len().max(1) as f64,
        }
    }
}
