//! Statistics of all slices of a paint.

use gonio_optics::Angle;
use rayon::prelude::*;

use super::lab::{brdf_from_lab, lab_from_brdf_lanes};
use super::octree::{Cuboids, Octree};
use super::{STEPS, fidelity::mean_colour};
use crate::FlakeBtf;

/// How statistics are taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct StatisticsOptions {
    /// Most boxes of a slice, 1 … 500.
    pub clusters: usize,
    /// How boxes are laid.
    pub cuboids: Cuboids,
}

impl Default for StatisticsOptions {
    fn default() -> Self {
        Self { clusters: 50, cuboids: Cuboids::Moments }
    }
}

/// Why there are no statistics.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum StatisticsError {
    /// Too few or too many boxes.
    #[error("{found} clusters a slice asked for, expected 1 to {STEPS} (50 suffice)")]
    Clusters {
        /// As asked.
        found: usize,
    },
    /// Parts that do not fit together.
    #[error("{what}: found {found}, expected {expected}")]
    Parts {
        /// What it is about.
        what: &'static str,
        /// Found.
        found: String,
        /// Expected.
        expected: String,
    },
}

/// A box of colours and its probability in steps of 1/[`STEPS`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cluster {
    /// Smallest L*, a*, b*.
    pub low: [f32; 3],
    /// Largest L*, a*, b*.
    pub high: [f32; 3],
    /// Probability times [`STEPS`], at least 1.
    pub steps: u16,
}

impl Cluster {
    /// Its centre in Lab.
    #[must_use]
    pub fn centre(&self) -> [f64; 3] {
        [0, 1, 2].map(|c: usize| 0.5 * (f64::from(self.low[c]) + f64::from(self.high[c])))
    }
}

/// Boxes in Lab with probabilities for each pair of angles inside the coat, and what draws colours from them.
#[derive(Clone, Debug, PartialEq)]
pub struct FlakeStatistics {
    half: Vec<Angle>,
    incidence: Vec<Angle>,
    /// First cluster of each slice, and the end.
    first: Vec<u32>,
    clusters: Vec<Cluster>,
    /// Cluster of each step, slice by slice.
    inverse: Vec<u16>,
    /// Mean colour of each slice, 1/sr.
    means: Vec<[f64; 3]>,
}

impl FlakeStatistics {
    /// Statistics of textures, all slices at once on the threads of the pool.
    ///
    /// # Errors
    /// [`StatisticsError::Clusters`] for a number of boxes that is none.
    pub fn of(btf: &FlakeBtf, options: &StatisticsOptions) -> Result<Self, StatisticsError> {
        if !(1..=STEPS).contains(&options.clusters) {
            return Err(StatisticsError::Clusters { found: options.clusters });
        }
        let slices: Vec<&[[f32; 3]]> = btf.slices().collect();
        let leaves: Vec<Vec<Cluster>> = slices
            .par_iter()
            .map_init(Octree::default, |octree, slice| {
                for axis in &mut octree.lab {
                    axis.resize(slice.len(), 0.0);
                }
                let [l, a, b] = &mut octree.lab;
                lab_from_brdf_lanes(slice, [l, a, b]);
                let leaves = octree.leaves(options.clusters, options.cuboids);
                leaves.iter().map(|l| Cluster { low: l.low, high: l.high, steps: l.steps }).collect()
            })
            .collect();
        Self::new(btf.half().to_vec(), btf.incidence().to_vec(), &leaves)
    }

    /// Statistics of given clusters, in order of half angle, then angle of incidence.
    ///
    /// # Errors
    /// [`StatisticsError::Parts`] for another number of slices than angles ask for, steps that do not sum to [`STEPS`], corners that
    /// are not finite.
    pub fn new<S: AsRef<[Cluster]>>(
        half: Vec<Angle>,
        incidence: Vec<Angle>,
        slices: &[S],
    ) -> Result<Self, StatisticsError> {
        let parts = |what, found: String, expected: String| StatisticsError::Parts { what, found, expected };
        for (what, axis) in [("half angles", &half), ("angles of incidence", &incidence)] {
            let rises = axis.windows(2).all(|w| w[0].degrees() < w[1].degrees());
            let inside = axis.iter().all(|a| (-1e-9..=90.0 + 1e-9).contains(&a.degrees()));
            if !rises || !inside {
                let found = axis.iter().map(|a| format!("{:.3}", a.degrees())).collect::<Vec<_>>().join(", ");
                return Err(parts(what, found, "angles that rise within 0° … 90°".to_owned()));
            }
        }
        if slices.len() != half.len() * incidence.len() || slices.is_empty() {
            return Err(parts(
                "slices",
                slices.len().to_string(),
                format!("{} × {}, at least one", half.len(), incidence.len()),
            ));
        }
        let mut made = Self {
            half,
            incidence,
            first: Vec::with_capacity(slices.len() + 1),
            clusters: Vec::new(),
            inverse: Vec::with_capacity(slices.len() * STEPS),
            means: Vec::with_capacity(slices.len()),
        };
        for (k, slice) in slices.iter().enumerate() {
            let slice = slice.as_ref();
            let total: usize = slice.iter().map(|c| usize::from(c.steps)).sum();
            if total != STEPS {
                return Err(parts("steps of a slice", format!("{total} in slice {k}"), STEPS.to_string()));
            }
            if slice.iter().flat_map(|c| c.low.iter().chain(&c.high)).any(|v| !v.is_finite()) {
                return Err(parts(
                    "corners",
                    format!("not a number in slice {k}"),
                    "finite numbers".to_owned(),
                ));
            }
            made.first.push(made.clusters.len() as u32);
            made.clusters.extend_from_slice(slice);
            for (at, c) in slice.iter().enumerate() {
                made.inverse.extend(std::iter::repeat_n(at as u16, usize::from(c.steps)));
            }
        }
        made.first.push(made.clusters.len() as u32);
        made.take_means();
        Ok(made)
    }

    fn take_means(&mut self) {
        self.means = (0..self.first.len() - 1)
            .into_par_iter()
            .map(|k| {
                let mut sum = [0.0; 3];
                for c in self.clusters(k) {
                    let p = f64::from(c.steps) / STEPS as f64;
                    let mean = mean_colour(c);
                    for i in 0..3 {
                        sum[i] += p * mean[i];
                    }
                }
                sum
            })
            .collect();
    }

    /// Half angles θh̄ inside the coat.
    #[must_use]
    pub fn half(&self) -> &[Angle] {
        &self.half
    }

    /// Angles of incidence θī inside the coat.
    #[must_use]
    pub fn incidence(&self) -> &[Angle] {
        &self.incidence
    }

    /// Number of slices.
    #[must_use]
    pub fn slices(&self) -> usize {
        self.means.len()
    }

    /// Clusters of a slice, by rising lightness where they come from textures; none outside.
    #[must_use]
    pub fn clusters(&self, slice: usize) -> &[Cluster] {
        match (self.first.get(slice), self.first.get(slice + 1)) {
            (Some(a), Some(b)) => &self.clusters[*a as usize..*b as usize],
            _ => &[],
        }
    }

    /// All clusters, slice after slice.
    #[must_use]
    pub fn all_clusters(&self) -> &[Cluster] {
        &self.clusters
    }

    /// The inverse distribution function: cluster of each of [`STEPS`] steps of a slice.
    #[must_use]
    pub fn inverse(&self, slice: usize) -> &[u16] {
        self.inverse.get(slice * STEPS..(slice + 1) * STEPS).unwrap_or(&[])
    }

    /// Mean colour of each slice, 1/sr.
    #[must_use]
    pub fn means(&self) -> &[[f64; 3]] {
        &self.means
    }

    /// Mean and standard deviation of L*, a* and b* of a slice.
    #[must_use]
    pub fn moments(&self, slice: usize) -> [[f64; 2]; 3] {
        [0, 1, 2].map(|c: usize| {
            let (mut mean, mut square) = (0.0, 0.0);
            for cluster in self.clusters(slice) {
                let p = f64::from(cluster.steps) / STEPS as f64;
                let width = f64::from(cluster.high[c]) - f64::from(cluster.low[c]);
                let centre = cluster.centre()[c];
                mean += p * centre;
                square += p * (centre * centre + width * width / 12.0);
            }
            [mean, (square - mean * mean).max(0.0).sqrt()]
        })
    }

    /// Bytes of the corners and the inverse distribution function, as a renderer holds them.
    #[must_use]
    pub fn bytes(&self) -> usize {
        self.clusters.len() * 24 + self.inverse.len() * 2
    }

    /// A colour of a box, 1/sr: `r` in [0, 1] on each axis.
    #[must_use]
    pub fn colour(cluster: &Cluster, r: [f32; 3]) -> [f64; 3] {
        let lab =
            [0, 1, 2].map(|c: usize| f64::from(cluster.low[c] + r[c] * (cluster.high[c] - cluster.low[c])));
        brdf_from_lab(lab)
    }
}
