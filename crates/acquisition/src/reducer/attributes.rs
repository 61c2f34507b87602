//! What a table says of itself: the sample, the instrument and its calibration, the coat, the settings and where its uncertainty comes from.

use std::collections::BTreeMap;

use super::Reducer;
use crate::coat::Verdict;
use crate::row::Row;
use crate::table::{Budget, PARTS};

impl Reducer {
    /// What a table says of its coat.
    pub(super) fn coat_attributes(&self) -> BTreeMap<String, String> {
        let mut a = BTreeMap::new();
        let mut put = |k: &str, v: String| a.insert(k.to_owned(), v);
        match self.coat() {
            Verdict::Coat(fit) => {
                put("clear_coat", self.options.clear_coat.separated().to_owned());
                put("coat_index", format!("{}", fit.index));
                put("coat_index_uncertainty", format!("{:.2e}", fit.index_sigma));
                put("coat_r0", format!("{}", fit.r0()));
                put("coat_poses", format!("{}", fit.poses));
                put("coat_gloss_ratio", format!("{:.5}", fit.ratio));
                put("coat_gloss_misfit", format!("{:.2e}", fit.misfit));
                put(
                    "coat_note",
                    "brdf is the total; brdf_base is two-way (divided by T(theta_i) T(theta_o)/n^2), brdf_base_single_pass divided by \
                     1 - F(theta_i). No inter-reflection inside the coat is modelled: pi brdf_base may exceed 1"
                        .to_owned(),
                );
            }
            Verdict::None(why) => {
                put("clear_coat", "none".to_owned());
                put("clear_coat_why", why);
            }
        }
        a
    }

    /// What was measured with what, and whether it looks the same when turned.
    pub(super) fn sample_attributes(&self) -> BTreeMap<String, String> {
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
        if let Some(found) = self.isotropy() {
            put("isotropy", found.verdict.name().to_owned());
            put("isotropy_why", found.sentence());
        }
        a
    }

    /// Units, conventions, and by which calibrations.
    pub(super) fn calibration_attributes(&self) -> BTreeMap<String, String> {
        let mut a = BTreeMap::new();
        let mut put = |k: &str, v: String| a.insert(k.to_owned(), v);
        put("units", "1/sr, without the cosine".to_owned());
        put(
            "conventions",
            match self.map.description().radiometry.as_ref().and_then(|r| r.colour.as_ref()) {
                Some(_) => {
                    "phi = 0 on the light's side, 180 on the mirror side; linear Rec. 709 through a matrix"
                }
                None => {
                    "phi = 0 on the light's side, 180 on the mirror side; linear RGB of the camera's channels"
                }
            }
            .to_owned(),
        );
        if let Some(r) = &self.map.description().radiometry {
            put("radiometry_version", format!("{}", r.version));
            put("radiometry_good", format!("{}", r.good));
            if let Some(c) = &r.colour {
                put("colour_matrix", format!("{:?}", c.matrix));
                put("colour_delta_e_mean", format!("{:.3}", c.delta_e_mean));
                put("colour_delta_e_max", format!("{:.3}", c.delta_e_max));
            }
        }
        if let Some(record) = &self.map.description().calibration_record {
            put("calibration_version", format!("{}", record.version));
            put("calibration_good", format!("{}", record.good));
        }
        a
    }

    pub(super) fn attributes(&self, budget: &Budget, measured: usize) -> BTreeMap<String, String> {
        let o = &self.options;
        let mut a = self.coat_attributes();
        a.append(&mut self.sample_attributes());
        a.append(&mut self.calibration_attributes());
        let mut put = |k: &str, v: String| {
            if !v.is_empty() {
                a.insert(k.to_owned(), v);
            }
        };
        put("common_relative_uncertainty", format!("{}", self.white.certificate_uncertainty));
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
        put("coverage_factor", "1".to_owned());
        let spins = self.rows.iter().map(Row::poses).filter(|n| *n > 0).min().unwrap_or(0);
        let freedom = crate::budget::degrees_of_freedom(&budget.relative, spins, self.lamp().freedom);
        put(
            "degrees_of_freedom",
            if freedom.is_finite() { format!("{freedom:.0}") } else { "infinite".to_owned() },
        );
        a
    }
}
