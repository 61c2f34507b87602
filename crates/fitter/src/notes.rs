//! What is to be said of a fit in plain words: what the model cannot follow, and what the data cannot tell apart.
//!
//! The rules are stated here and apply to every model:
//!
//! - *grazing*: the mean signed residual of the cells with θi or θo above 60° exceeds a tenth of the mean value there, and is at least twice (in
//!   relation to the values) what it is below 60°;
//! - *tails*: the same between 15° and 40° from the mirror direction, against the rest farther out;
//! - *peak*: the same within 5° of the mirror direction;
//! - *hue travel*: the mean CIEDE2000 between measured and fitted colours brought to the same lightness exceeds 2 within 45° of the mirror direction or beyond it;
//! - *pairs*: two parameters whose correlation is beyond ±0.98;
//! - *one incidence*: all cells share one angle of incidence to 0.5°.

use gonio_optics::colour::{Lab, ciede2000, lab_from_brdf};

use crate::{colour_error::Pair, rows::Rows};

/// Share of the value that a mean residual must exceed.
const SHARE: f64 = 0.1;
/// Correlation beyond which two parameters are one.
const CORRELATED: f64 = 0.98;

/// A sum of residuals and values over a region.
#[derive(Clone, Copy, Default)]
struct Region {
    residual: f64,
    value: f64,
    cells: usize,
}

impl Region {
    fn add(&mut self, residual: f64, value: f64) {
        self.residual += residual;
        self.value += value.abs();
        self.cells += 1;
    }

    /// Mean signed residual in relation to the mean value; nothing of fewer than eight cells.
    fn bias(self) -> Option<f64> {
        (self.cells >= 8 && self.value > 0.0).then(|| self.residual / self.value)
    }
}

/// What the residuals say. `pairs`: (degrees from the mirror direction, measured, fitted) in the order of the rows.
pub(crate) fn of_residuals(rows: &Rows, pairs: &[Pair]) -> Vec<String> {
    let mut out = Vec::new();
    let (mut grazing, mut steep, mut tail, mut far, mut peak) = <(Region, Region, Region, Region, Region)>::default();
    for (row, (mirror, y, f)) in rows.rows.iter().zip(pairs) {
        let w = row.datum.solid_angle.max(f64::MIN_POSITIVE);
        let (r, v) = ((0..3).map(|c| y[c] - f[c]).sum::<f64>() * w, y.iter().sum::<f64>() * w);
        let g = row.datum.geometry;
        let high = g.theta_i.degrees().max(g.theta_o.degrees()) > 60.0;
        if high { grazing.add(r, v) } else { steep.add(r, v) }
        match mirror {
            m if *m <= 5.0 => peak.add(r, v),
            m if (15.0..40.0).contains(m) => tail.add(r, v),
            m if *m >= 40.0 => far.add(r, v),
            _ => {}
        }
    }
    let mut say = |region: Region, rest: Region, place: &str, why: &str| {
        if let Some(b) = region.bias()
            && b.abs() > SHARE
            && rest.bias().is_none_or(|r| b.abs() > 2.0 * r.abs())
        {
            let side = if b > 0.0 { "too dark" } else { "too bright" };
            out.push(format!("{place} the model is {side} by {:.0} % on average: {why}", 100.0 * b.abs()));
        }
    };
    say(grazing, steep, "beyond 60° of light or view", "it does not follow the rise towards grazing angles");
    say(tail, far, "15° to 40° from the mirror direction", "its lobe has another tail than the data");
    say(peak, Region::default(), "within 5° of the mirror direction", "its lobe has another peak than the data");
    out.extend(hue(pairs));
    let incidence: Vec<f64> = rows.rows.iter().map(|r| r.datum.geometry.theta_i.degrees()).collect();
    let (low, high) = incidence.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), x| (a.min(*x), b.max(*x)));
    if high - low < 0.5 {
        out.push(format!(
            "all data share one angle of incidence, {low:.1}°: how the model changes with incidence is not tested by them"
        ));
    }
    out
}

/// Whether colours differ once lightness is taken out.
fn hue(pairs: &[Pair]) -> Option<String> {
    let mean = |near: bool| {
        let differences: Vec<f64> = pairs
            .iter()
            .filter(|p| (p.0 <= 45.0) == near)
            .map(|p| {
                let (a, b) = (lab_from_brdf(p.1), lab_from_brdf(p.2));
                // chroma shrinks with lightness: brought to the measured one
                let k = if b.l > 1.0 { a.l.max(0.0) / b.l } else { 1.0 };
                ciede2000(a, Lab { l: a.l, a: k * b.a, b: k * b.b })
            })
            .filter(|d| d.is_finite())
            .collect();
        if differences.len() < 8 { 0.0 } else { differences.iter().sum::<f64>() / differences.len() as f64 }
    };
    let (near, beyond) = (mean(true), mean(false));
    (near.max(beyond) > 2.0).then(|| {
        format!(
            "the colour travels with the angle in a way that one colour per term cannot follow (mean ΔE without lightness {near:.1} within 45° of the mirror direction, {beyond:.1} beyond)"
        )
    })
}

/// Parameters that the data hardly tell apart: pairs by name, with their correlation.
pub(crate) fn inseparable(names: &[&'static str], covariance: &[Vec<f64>]) -> Vec<(&'static str, &'static str, f64)> {
    let mut out = Vec::new();
    for (i, row) in covariance.iter().enumerate() {
        for (j, &c) in row.iter().enumerate().skip(i + 1) {
            let product = covariance[i][i] * covariance[j][j];
            let r = c / product.sqrt();
            if product > 0.0 && r.abs() > CORRELATED {
                out.push((names[i], names[j], r));
            }
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pair_that_moves_as_one_is_named() {
        let found = inseparable(&["r0", "specular_r", "exponent"], &[
            vec![1.0, -1.99, 0.1],
            vec![-1.99, 4.0, 0.0],
            vec![0.1, 0.0, 1.0],
        ]);
        assert_eq!(found.len(), 1);
        assert_eq!((found[0].0, found[0].1), ("r0", "specular_r"));
    }

    #[test]
    fn a_lack_of_cells_says_nothing() {
        assert!(Region { residual: 1.0, value: 1.0, cells: 3 }.bias().is_none());
        assert!(hue(&[]).is_none());
    }
}
