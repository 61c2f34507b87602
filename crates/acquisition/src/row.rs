//! The poses of one angle of incidence, averaged; their spread over spins is what flakes do.

use gonio_optics::Angle;

use crate::cells::Cell;

/// Sums over the poses of a row θi.
#[derive(Clone, Debug, Default)]
pub struct Row {
    poses: u32,
    sums: Vec<Sums>,
    off_row2: f64,
    lamp2: f64,
}

#[derive(Clone, Copy, Debug, Default)]
struct Sums {
    n: u32,
    value: [f64; 3],
    square: [f64; 3],
    /// Shot and read: independent from pose to pose.
    noise: [[f64; 3]; 2],
    /// Dark, white reference, base under a gloss: the same errors at every pose of the row.
    common: [[f64; 3]; 3],
    off_centre: f64,
}

/// A cell of a finished row; variances in 1/sr².
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct RowCell {
    /// f in 1/sr.
    pub value: [f64; 3],
    /// Shot, read, dark, white reference pixels, flakes, base under a gloss.
    pub parts: [[f64; 3]; 6],
    /// How far the part seen lies from the bin's centroid, radians.
    pub off_centre_rad: f64,
}

impl Row {
    /// Adds a pose: its cells, its distance from the row's θi, and the lamp's relative uncertainty.
    pub fn add(&mut self, cells: &[Option<Cell>], off_row: Angle, lamp_relative: f64) {
        self.sums.resize(cells.len(), Sums::default());
        self.poses += 1;
        self.off_row2 += off_row.radians().powi(2);
        self.lamp2 += lamp_relative * lamp_relative;
        for (s, cell) in self.sums.iter_mut().zip(cells) {
            let Some(c) = cell else { continue };
            s.n += 1;
            s.off_centre += c.off_centre_rad;
            for k in 0..3 {
                s.value[k] += c.value[k];
                s.square[k] += c.value[k] * c.value[k];
                s.noise[0][k] += c.shot[k];
                s.noise[1][k] += c.read[k];
                s.common[0][k] += c.dark[k];
                s.common[1][k] += c.reference[k];
                s.common[2][k] += c.coat[k];
            }
        }
    }

    /// Poses seen.
    #[must_use]
    pub const fn poses(&self) -> u32 {
        self.poses
    }

    /// Root mean square distance of the poses from the row's θi.
    #[must_use]
    pub fn off_row(&self) -> Angle {
        Angle::from_radians((self.off_row2 / f64::from(self.poses.max(1))).sqrt())
    }

    /// Relative standard uncertainty that the lamp brings to the whole row.
    #[must_use]
    pub fn lamp_relative(&self) -> f64 {
        self.lamp2.sqrt() / f64::from(self.poses.max(1))
    }

    /// Mean of a cell over the poses that saw it.
    #[must_use]
    pub fn cell(&self, at: usize) -> Option<RowCell> {
        let s = self.sums.get(at).filter(|s| s.n > 0)?;
        let n = f64::from(s.n);
        let mut out = RowCell { off_centre_rad: s.off_centre / n, ..RowCell::default() };
        for k in 0..3 {
            let mean = s.value[k] / n;
            out.value[k] = mean;
            out.parts[0][k] = s.noise[0][k] / (n * n);
            out.parts[1][k] = s.noise[1][k] / (n * n);
            out.parts[2][k] = s.common[0][k] / n;
            out.parts[3][k] = s.common[1][k] / n;
            out.parts[5][k] = s.common[2][k] / n;
            if s.n > 1 {
                // variance of the mean over spins, beyond what noise explains
                let spread = (s.square[k] - n * mean * mean).max(0.0) / (n - 1.0) / n;
                let noise = out.parts[0][k] + out.parts[1][k];
                // an excess counts where chance does not make it: the variance of n values scatters by sqrt(2/(n − 1))
                if spread > noise * (1.0 + 2.0 * (2.0 / (n - 1.0)).sqrt()) {
                    out.parts[4][k] = spread - noise;
                }
            }
        }
        Some(out)
    }
}
