//! Paints made ready to be mixed: statistics, transport slice by slice, corners along all paths.

use std::sync::Arc;

use gonio_optics::Angle;
use rayon::prelude::*;

use super::MixError;
use super::analytic::Analytic;
use crate::car_paint::{CarPaint, Flakes};
use crate::statistics::{Cluster, FlakeStatistics, StatisticsOptions};
use crate::transport::{Costs, Problem, Solver, TransportError};

/// Two or more paints with the paths between their flakes.
#[derive(Clone, Debug)]
pub struct Mixable {
    pub(super) paints: Vec<Arc<CarPaint>>,
    pub(super) analytic: Analytic,
    /// Angles of the slices; none where no paint has flakes.
    pub(super) half: Vec<Angle>,
    pub(super) incidence: Vec<Angle>,
    /// First path of each slice, and the end.
    pub(super) first: Vec<u32>,
    /// Probability of each path in steps of 1/500.
    pub(super) steps: Vec<u16>,
    /// Per paint six planes as long as there are paths: smallest L*, a*, b*, largest L*, a*, b*.
    pub(super) corners: Vec<Vec<f32>>,
}

impl Mixable {
    /// Prepares paints in their order, slices on all threads of the pool.
    ///
    /// # Errors
    /// [`MixError`]: fewer than two, coats or angles that do not agree.
    pub fn new(paints: &[Arc<CarPaint>], options: &StatisticsOptions) -> Result<Self, MixError> {
        if paints.len() < 2 {
            return Err(MixError::TooFew { found: paints.len() });
        }
        agree(paints)?;
        let statistics = statistics_of_all(paints, options)?;
        let mut made = Self {
            paints: paints.to_vec(),
            analytic: Analytic::of(paints),
            half: Vec::new(),
            incidence: Vec::new(),
            first: vec![0],
            steps: Vec::new(),
            corners: vec![Vec::new(); paints.len()],
        };
        if let Some(statistics) = statistics {
            made.half = statistics[0].half().to_vec();
            made.incidence = statistics[0].incidence().to_vec();
            made.join_all(&statistics)?;
        }
        Ok(made)
    }

    /// The paints.
    #[must_use]
    pub fn paints(&self) -> &[Arc<CarPaint>] {
        &self.paints
    }

    /// Paths over all slices.
    #[must_use]
    pub fn paths(&self) -> usize {
        self.steps.len()
    }

    /// Slices, 0 without flakes.
    #[must_use]
    pub fn slices(&self) -> usize {
        self.first.len() - 1
    }

    /// Bytes that a renderer holds: corners of all paints, probabilities, inverse distribution functions.
    #[must_use]
    pub fn bytes(&self) -> usize {
        let corners: usize = self.corners.iter().map(|c| 4 * c.len()).sum();
        corners + 2 * self.steps.len() + 2 * crate::statistics::STEPS * self.slices()
    }

    fn join_all(&mut self, statistics: &[Arc<FlakeStatistics>]) -> Result<(), MixError> {
        let slices = statistics[0].slices();
        let joined: Vec<Vec<(Vec<u16>, u16)>> = (0..slices)
            .into_par_iter()
            .map_init(Solver::new, |solver, slice| {
                let lists: Vec<&[Cluster]> = statistics.iter().map(|s| s.clusters(slice)).collect();
                join_slice(solver, &lists).map_err(|source| MixError::Transport { slice, source })
            })
            .collect::<Result<_, _>>()?;
        for paths in &joined {
            self.steps.extend(paths.iter().map(|p| p.1));
            self.first.push(self.steps.len() as u32);
        }
        let n = self.steps.len();
        for (k, (planes, statistics)) in self.corners.iter_mut().zip(statistics).enumerate() {
            planes.resize(6 * n, 0.0);
            let mut at = 0;
            for (slice, paths) in joined.iter().enumerate() {
                let clusters = statistics.clusters(slice);
                for (members, _) in paths {
                    let c = &clusters[usize::from(members[k])];
                    for axis in 0..3 {
                        planes[axis * n + at] = c.low[axis];
                        planes[(axis + 3) * n + at] = c.high[axis];
                    }
                    at += 1;
                }
            }
        }
        Ok(())
    }
}

/// Paths through one slice of all paints: the cluster of each paint, and steps. Each further paint is joined to the equal mixture of those before.
fn join_slice(solver: &mut Solver, lists: &[&[Cluster]]) -> Result<Vec<(Vec<u16>, u16)>, TransportError> {
    let mut paths: Vec<(Vec<u16>, u16)> =
        lists[0].iter().enumerate().map(|(k, c)| (vec![k as u16], c.steps)).collect();
    for (before, list) in lists.iter().enumerate().skip(1) {
        let supply: Vec<f64> = paths.iter().map(|p| f64::from(p.1)).collect();
        let demand: Vec<f64> = list.iter().map(|c| f64::from(c.steps)).collect();
        let from: Vec<[f64; 3]> = paths
            .iter()
            .map(|(members, _)| {
                let mut sum = [0.0; 3];
                for (list, member) in lists.iter().zip(members) {
                    let centre = list[usize::from(*member)].centre();
                    for c in 0..3 {
                        sum[c] += centre[c] / before as f64;
                    }
                }
                sum
            })
            .collect();
        let to: Vec<[f64; 3]> = list.iter().map(Cluster::centre).collect();
        let problem =
            Problem { supply: &supply, demand: &demand, costs: Costs::Distances { from: &from, to: &to } };
        let plan = solver.solve(&problem)?;
        paths = plan
            .paths
            .iter()
            .filter_map(|p| {
                // whole steps in, whole steps out: a vertex of a transport problem of integers is integer
                let steps = p.mass.round() as u16;
                let mut members = paths[p.source as usize].0.clone();
                members.push(p.target as u16);
                (steps > 0).then_some((members, steps))
            })
            .collect();
    }
    Ok(paths)
}

fn agree(paints: &[Arc<CarPaint>]) -> Result<(), MixError> {
    let first = paints[0].parts();
    for (place, paint) in paints.iter().enumerate().skip(1) {
        let parts = paint.parts();
        let name = parts.name.clone();
        if parts.coat.is_some() != first.coat.is_some() {
            return Err(MixError::Coat { place, name, coated: parts.coat.is_some() });
        }
        if parts.coat.is_some() && parts.through != first.through {
            return Err(MixError::Through { place, name, found: parts.through, expected: first.through });
        }
    }
    Ok(())
}

/// Statistics of each paint's flakes on the same angles; a paint without flakes has black ones. `None` where no paint has any.
fn statistics_of_all(
    paints: &[Arc<CarPaint>],
    options: &StatisticsOptions,
) -> Result<Option<Vec<Arc<FlakeStatistics>>>, MixError> {
    let mut taken = Vec::with_capacity(paints.len());
    for paint in paints {
        taken.push(match &paint.parts().flakes {
            None => None,
            Some(Flakes::Slices(s)) => Some(Arc::new(FlakeStatistics::of(s.btf(), options)?)),
            Some(Flakes::Statistics(s)) => Some(Arc::clone(s.statistics())),
        });
    }
    let Some(first) = taken.iter().flatten().next().cloned() else { return Ok(None) };
    for (place, statistics) in taken.iter().enumerate() {
        if let Some(s) = statistics
            && !(same(s.half(), first.half()) && same(s.incidence(), first.incidence()))
        {
            return Err(MixError::Sampling {
                place,
                name: paints[place].parts().name.clone(),
                found: sampling(s),
                expected: sampling(&first),
            });
        }
    }
    let black = Cluster { low: [0.0; 3], high: [0.0; 3], steps: crate::statistics::STEPS as u16 };
    let none = FlakeStatistics::new(
        first.half().to_vec(),
        first.incidence().to_vec(),
        &vec![[black]; first.slices()],
    )?;
    let none = Arc::new(none);
    Ok(Some(taken.into_iter().map(|s| s.unwrap_or_else(|| Arc::clone(&none))).collect()))
}

/// Equal to a millionth of a degree.
fn same(p: &[Angle], q: &[Angle]) -> bool {
    p.len() == q.len() && p.iter().zip(q).all(|(p, q)| (p.degrees() - q.degrees()).abs() < 1e-6)
}

fn sampling(s: &FlakeStatistics) -> String {
    let axis = |angles: &[Angle]| {
        let end = |a: Option<&Angle>| a.map_or(f64::NAN, |a| a.degrees());
        format!("{} from {:.1}° to {:.1}°", angles.len(), end(angles.first()), end(angles.last()))
    };
    format!("{} half angles and {} angles of incidence", axis(s.half()), axis(s.incidence()))
}
