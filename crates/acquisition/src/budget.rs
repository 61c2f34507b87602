//! Where a table's uncertainty comes from: nine parts per cell, who shares an error with whom, degrees of freedom.
//!
//! The parts stand in the table (`sigma_PART` in files) and their squares add up to `sigma²` in every cell. Gain has no part of its own: sample and
//! white reference are read by the same converter at the same settings, and it cancels.

use gonio_brdf::{Flag, Measured};

use crate::table::PARTS;

/// Name of the part that holds what filling and extrapolation bring; measured cells have none.
pub const FILLING: &str = "filling";

/// Which cells err together.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sharing {
    /// Every cell errs for itself.
    Independent,
    /// Cells of other rows that use the same pixels err alike.
    Pixels,
    /// All cells of one θi err by the same factor.
    Row,
    /// All cells err by the same factor.
    Table,
    /// All cells err by the same turn, each by its own slope.
    Directions,
}

impl Sharing {
    /// In words.
    #[must_use]
    pub const fn words(self) -> &'static str {
        match self {
            Self::Independent => "independent from cell to cell",
            Self::Pixels => "shared by rows that use the same pixels",
            Self::Row => "one factor for all cells of an angle of incidence",
            Self::Table => "one factor for the whole table",
            Self::Directions => "one turn for the whole table, each cell by its slope",
        }
    }

    /// Whether it stays when cells of a row are averaged.
    #[must_use]
    pub const fn is_common(self) -> bool {
        matches!(self, Self::Row | Self::Table | Self::Directions)
    }
}

/// Who shares a part; parts of other programs count as independent.
#[must_use]
pub fn sharing(part: &str) -> Sharing {
    match part {
        "dark" | "reference" => Sharing::Pixels,
        "certificate" => Sharing::Table,
        "lamp" | "stray" => Sharing::Row,
        "angle" => Sharing::Directions,
        _ => Sharing::Independent,
    }
}

/// A part over the measured cells.
#[derive(Clone, Debug, PartialEq)]
pub struct Line {
    /// Name.
    pub part: String,
    /// Who shares it.
    pub sharing: Sharing,
    /// Root mean square of σ_part/f over measured cells with f > 0, all channels.
    pub relative_rms: f64,
    /// Median of the same.
    pub relative_median: f64,
}

/// The budget of a table, the largest part first.
#[derive(Clone, Debug, PartialEq)]
pub struct Summary {
    /// Parts; those that are nowhere above zero are left out.
    pub lines: Vec<Line>,
    /// Root mean square of what is independent, pixels' parts included, over f.
    pub independent: f64,
    /// Of what is common.
    pub common: f64,
    /// Of everything.
    pub total: f64,
    /// Values counted.
    pub values: usize,
}

/// The budget of a table that holds its parts; `None` for one that does not.
#[must_use]
pub fn summary(table: &Measured) -> Option<Summary> {
    if table.sigma_parts.is_empty() {
        return None;
    }
    let cells: Vec<usize> = (0..table.flag.len()).filter(|&i| table.flag[i] == Flag::Measured).collect();
    let mut out = Summary { lines: Vec::new(), independent: 0.0, common: 0.0, total: 0.0, values: 0 };
    for (part, sigma) in &table.sigma_parts {
        let mut relative: Vec<f64> = cells
            .iter()
            .flat_map(|&i| (0..3).map(move |c| (i, c)))
            .filter(|&(i, c)| table.values[i][c] > 0.0)
            .map(|(i, c)| f64::from(sigma[i][c]) / f64::from(table.values[i][c]))
            .collect();
        out.values = relative.len();
        let mean_square = relative.iter().map(|r| r * r).sum::<f64>() / relative.len().max(1) as f64;
        relative.sort_unstable_by(f64::total_cmp);
        let sharing = sharing(part);
        *(if sharing.is_common() { &mut out.common } else { &mut out.independent }) += mean_square;
        out.total += mean_square;
        if mean_square > 0.0 {
            out.lines.push(Line {
                part: part.clone(),
                sharing,
                relative_rms: mean_square.sqrt(),
                relative_median: relative.get(relative.len() / 2).copied().unwrap_or(0.0),
            });
        }
    }
    out.lines.sort_by(|a, b| b.relative_rms.total_cmp(&a.relative_rms));
    (out.independent, out.common, out.total) = (out.independent.sqrt(), out.common.sqrt(), out.total.sqrt());
    Some(out)
}

/// Effective degrees of freedom after Welch and Satterthwaite, `u⁴ / Σ uᵢ⁴/νᵢ`, from relative parts as [`PARTS`] names them: flakes are known from
/// `spins` values, the lamp with as many as are given, everything else counts as known. Infinite where nothing is limited.
#[must_use]
pub fn degrees_of_freedom(relative: &[f64; 9], spins: u32, lamp: f64) -> f64 {
    let total: f64 = relative.iter().map(|u| u * u).sum();
    let limited: f64 = PARTS
        .iter()
        .zip(relative)
        .map(|(part, u)| {
            let freedom = match *part {
                "flakes" => f64::from(spins.saturating_sub(1)),
                "lamp" => lamp,
                _ => return 0.0,
            };
            if *u == 0.0 { 0.0 } else { u.powi(4) / freedom.max(1.0) }
        })
        .sum();
    if limited > 0.0 { total * total / limited } else { f64::INFINITY }
}

/// Makes the parts add up to σ: what later steps added goes to the coat in measured cells and to [`FILLING`] in others; parts that are
/// zero everywhere are dropped.
pub(crate) fn complete(table: &mut Measured) {
    let mut rest = vec![[0.0f32; 3]; table.flag.len()];
    for (i, rest) in rest.iter_mut().enumerate() {
        for (c, rest) in rest.iter_mut().enumerate() {
            let sum: f64 = table.sigma_parts.values().map(|p| f64::from(p[i][c]).powi(2)).sum();
            *rest = (f64::from(table.sigma[i][c]).powi(2) - sum).max(0.0).sqrt() as f32;
        }
    }
    let mut filling = vec![[0.0f32; 3]; table.flag.len()];
    let coat = table.sigma_parts.entry("coat".to_owned()).or_insert_with(|| vec![[0.0; 3]; rest.len()]);
    for (i, rest) in rest.iter().enumerate() {
        for (c, rest) in rest.iter().enumerate() {
            // what rounding to single precision leaves is no part
            let noteworthy = *rest > 1e-3 * table.sigma[i][c];
            match table.flag[i] {
                Flag::Measured if noteworthy => coat[i][c] = coat[i][c].hypot(*rest),
                Flag::Measured | Flag::Invalid => {}
                Flag::Filled | Flag::Extrapolated => filling[i][c] = *rest,
            }
        }
    }
    table.sigma_parts.insert(FILLING.to_owned(), filling);
    table.sigma_parts.retain(|_, p| p.iter().flatten().any(|v| *v > 0.0));
}

#[cfg(test)]
mod tests {
    use super::*;
    use gonio_brdf::{Grid, Meaning};

    #[test]
    fn parts_add_up_to_sigma_whatever_came_later() {
        let mut t = Measured::empty(Grid::sopp(), Meaning::Node);
        let n = t.flag.len();
        let mut shot = vec![[0.0; 3]; n];
        (t.flag[7], t.flag[8]) = (Flag::Measured, Flag::Extrapolated);
        (t.values[7], t.sigma[7], shot[7]) = ([1.0; 3], [0.05; 3], [0.03; 3]);
        (t.values[8], t.sigma[8]) = ([1.0; 3], [0.2; 3]);
        t.sigma_parts.insert("shot".to_owned(), shot);
        t.sigma_parts.insert("read".to_owned(), vec![[0.0; 3]; n]);
        complete(&mut t);
        let names: Vec<&str> = t.sigma_parts.keys().map(String::as_str).collect();
        assert_eq!(names, ["coat", "filling", "shot"]);
        for i in [7, 8] {
            let sum: f32 = t.sigma_parts.values().map(|p| p[i][0] * p[i][0]).sum();
            assert!((sum.sqrt() / t.sigma[i][0] - 1.0).abs() < 1e-6);
        }
        let s = summary(&t).expect("parts");
        assert_eq!((s.lines[0].part.as_str(), s.values), ("coat", 3));
        assert!((s.total - 0.05).abs() < 1e-6 && s.common == 0.0);
        assert!(summary(&Measured::empty(Grid::sopp(), Meaning::Node)).is_none());
    }

    #[test]
    fn few_spins_leave_few_degrees_of_freedom() {
        let mut u = [0.0; 9];
        assert_eq!(degrees_of_freedom(&u, 1, 1.0), f64::INFINITY);
        u[4] = 0.01;
        assert!((degrees_of_freedom(&u, 4, 9.0) - 3.0).abs() < 1e-9);
        // a part of the same size that is known doubles the variance: four times the freedom
        u[0] = 0.01;
        assert!((degrees_of_freedom(&u, 4, 9.0) - 12.0).abs() < 1e-9);
    }
}
