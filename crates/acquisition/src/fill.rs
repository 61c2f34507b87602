//! Cells that were not measured: by reciprocity where the swapped geometry was, else smoothly from around; beyond the
//! limit by a guarded continuation. Never negative, without a jump at the limit, σ growing with the distance from data.

mod continuation;
mod membrane;
mod reciprocity;

use gonio_brdf::{Flag, Measured};

/// Fills `m` in place: [`Flag::Filled`] up to `limit_deg` in θo and within the rows measured, [`Flag::Extrapolated`] beyond.
/// A table without a measured cell stays as it is.
pub fn fill(m: &mut Measured, limit_deg: f64) {
    if !m.flag.contains(&Flag::Measured) {
        return;
    }
    reciprocity::fill(m, limit_deg);
    membrane::fill(m, limit_deg);
    continuation::between_rows(m, limit_deg);
    continuation::beyond_limit(m, limit_deg);
    continuation::outer_rows(m);
    for (v, s) in m.values.iter_mut().zip(&m.sigma) {
        for c in 0..3 {
            // noise about zero is kept where measured; what is made up is never negative
            if !v[c].is_finite() || !s[c].is_finite() {
                v[c] = 0.0;
            }
        }
    }
}
