//! What a path costs: distances of colours, or any matrix.

use super::TransportError;

/// Costs of moving one unit of mass.
#[derive(Clone, Copy, Debug)]
pub enum Costs<'a> {
    /// Euclidean distance of two colours (or places), eq. 8.
    Distances {
        /// Of the sources.
        from: &'a [[f64; 3]],
        /// Of the targets.
        to: &'a [[f64; 3]],
    },
    /// One number a pair, sources in rows.
    Matrix(&'a [f64]),
}

/// Columns a row is padded to: lanes of the pricing loop.
pub(super) const LANES: usize = 8;

/// Rows of equal, padded length for the places that hold mass; a padded column costs too much ever to be priced in.
#[derive(Debug, Default)]
pub(super) struct Table {
    pub values: Vec<f64>,
    pub stride: usize,
    pub largest: f64,
    axes: [Vec<f64>; 3],
}

impl Costs<'_> {
    /// Cost of one pair.
    pub(super) fn one(&self, i: usize, j: usize, targets: usize) -> f64 {
        match self {
            Self::Distances { from, to } => distance(from[i], to[j]),
            Self::Matrix(m) => m[i * targets + j],
        }
    }

    pub(super) fn check(&self, sources: usize, targets: usize) -> Result<(), TransportError> {
        let expected = sources * targets;
        let found = match self {
            Self::Distances { from, to } => from.len() * to.len(),
            Self::Matrix(m) => m.len(),
        };
        let sizes_fit = match self {
            Self::Distances { from, to } => from.len() == sources && to.len() == targets,
            Self::Matrix(_) => found == expected,
        };
        if sizes_fit { Ok(()) } else { Err(TransportError::Size { expected, sources, targets, found }) }
    }
}

#[inline(always)]
fn distance(p: [f64; 3], q: [f64; 3]) -> f64 {
    let d = [p[0] - q[0], p[1] - q[1], p[2] - q[2]];
    (d[0] * d[0] + d[1] * d[1] + d[2] * d[2]).sqrt()
}

impl Table {
    /// Costs between the places `rows` and `columns`.
    #[inline(always)]
    pub fn fill(
        &mut self,
        costs: Costs<'_>,
        targets: usize,
        rows: &[u32],
        columns: &[u32],
    ) -> Result<(), TransportError> {
        let stride = columns.len().next_multiple_of(LANES);
        self.stride = stride;
        self.values.clear();
        self.values.resize(rows.len() * stride, f64::INFINITY);
        match costs {
            Costs::Matrix(m) => {
                for (row, &i) in self.values.chunks_exact_mut(stride).zip(rows) {
                    let given = &m[i as usize * targets..][..targets];
                    for (c, &j) in row.iter_mut().zip(columns) {
                        *c = given[j as usize];
                    }
                }
            }
            Costs::Distances { from, to } => {
                for (k, axis) in self.axes.iter_mut().enumerate() {
                    axis.clear();
                    axis.extend(columns.iter().map(|&j| to[j as usize][k]));
                }
                let [x, y, z] = &self.axes;
                for (row, &i) in self.values.chunks_exact_mut(stride).zip(rows) {
                    let p = from[i as usize];
                    for (((c, x), y), z) in row.iter_mut().zip(x).zip(y).zip(z) {
                        *c = distance(p, [*x, *y, *z]);
                    }
                }
            }
        }
        self.largest = 0.0;
        for (place, row) in self.values.chunks_exact(stride).enumerate() {
            let row = &row[..columns.len()];
            // a sum of magnitudes is not finite where one of them is not
            let mut sum = 0.0;
            let mut largest = self.largest;
            for c in row {
                let size = c.abs();
                sum += size;
                largest = if size > largest { size } else { largest };
            }
            self.largest = largest;
            if !sum.is_finite() {
                let at = row.iter().position(|c| !c.is_finite());
                if let Some(at) = at {
                    return Err(TransportError::Cost {
                        source_place: rows[place] as usize,
                        target_place: columns[at] as usize,
                        found: row[at],
                    });
                }
            }
        }
        Ok(())
    }

    /// Padded costs of one row.
    pub fn row(&self, i: usize) -> &[f64] {
        &self.values[i * self.stride..][..self.stride]
    }
}
