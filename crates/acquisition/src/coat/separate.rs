//! The coat divided out, cell by cell, and the gloss put back as the lamp makes it.
//!
//! A table reduced with the pixels of the gloss replaced by the base around them holds `T(θi) T(θo)/n² f_base` everywhere. Two forms of the
//! base come out of it, both in 1/sr: *two-way*, divided by the mean of T(θi) T(θo)/n² over the bin, is reciprocal; *single-pass* (Sopp 4.20),
//! divided by 1 − F(θi), is not. The total is the base seen through the coat plus the share of the bin that the lamp's mirror image covers.

use gonio_brdf::average::{CellBounds, gloss_cell_mean, is_cap};
use gonio_brdf::models::Coat;
use gonio_brdf::{Flag, Grid, Measured};
use gonio_optics::{Angle, COS_FLOOR, quadrature};

use super::CoatFit;

/// Share of a cell's weight that the gloss may hide before the cell counts as filled.
const LARGEST_HIDDEN: f64 = 0.02;
/// Uncertainty of the image's place against the cells' bounds, degrees.
const PLACE_DEG: f64 = 0.01;

/// Mean of T(θi) T(θo)/n² over a bin.
#[must_use]
pub fn transmission(grid: &Grid, coat: &Coat, ti: usize, to: usize) -> f64 {
    let t = |cos: f64| 1.0 - coat.reflectance(cos);
    let (a, b) = grid.theta_o_bounds(to);
    let (low, high) = (a.cos(), b.cos());
    let over: f64 = quadrature::gauss_legendre(4).iter().map(|&(x, w)| w * t(low + (high - low) * x)).sum();
    t(Angle::from_degrees(grid.theta_i_deg[ti]).cos().max(COS_FLOOR)) * over / (coat.index * coat.index)
}

/// The two forms of the base for a table that holds the base seen through the coat.
#[must_use]
pub fn bases(through: &Measured, coat: &Coat) -> [Vec<[f32; 3]>; 2] {
    let grid = &through.grid;
    let [ni, no, np] = grid.shape();
    let (mut two_way, mut single_pass) = (Vec::with_capacity(grid.len()), Vec::with_capacity(grid.len()));
    for ti in 0..ni {
        let cos_i = Angle::from_degrees(grid.theta_i_deg[ti]).cos();
        // at θi = 90° no light enters the coat: the limit stands there, held by the floor of the cosine
        let once = 1.0 - coat.reflectance(cos_i.max(COS_FLOOR));
        for to in 0..no {
            let both = transmission(grid, coat, ti, to);
            for phi in 0..np {
                let f = through.values[grid.index(ti, to, phi)].map(f64::from);
                two_way.push(f.map(|f| (f / both) as f32));
                single_pass.push(f.map(|f| (f / once) as f32));
            }
        }
    }
    [two_way, single_pass]
}

/// Flags the cells that the gloss hid as filled: `hidden` is the share of each cell's weight.
pub fn flag_hidden(through: &mut Measured, hidden: &[f32]) {
    for (flag, share) in through.flag.iter_mut().zip(hidden) {
        if *flag == Flag::Measured && f64::from(*share) > LARGEST_HIDDEN {
            *flag = Flag::Filled;
        }
    }
}

/// Adds the gloss to a table that holds the base seen through the coat; `lamp_half_angle` is α.
pub fn add_gloss(m: &mut Measured, coat: &CoatFit, lamp_half_angle: Angle) {
    let grid = m.grid.clone();
    let [ni, no, np] = grid.shape();
    let index = Coat { index: coat.index };
    for ti in 0..ni {
        let cos_i = Angle::from_degrees(grid.theta_i_deg[ti]).cos();
        if cos_i < 1e-9 {
            // at grazing incidence the image lies on the horizon and its level has no bound
            continue;
        }
        let level = index.gloss_level(cos_i, lamp_half_angle);
        // dF/dn by a difference
        let step = 1e-4;
        let by_index = (Coat { index: coat.index + step }.gloss_level(cos_i, lamp_half_angle) - level) / step;
        let relative = by_index * coat.index_sigma / level;
        for to in 0..no {
            for phi in 0..np {
                let at = grid.index(ti, to, phi);
                let bounds = CellBounds::of(&grid, lamp_half_angle, [ti, to, phi]);
                let gloss = gloss_cell_mean(level, &bounds);
                if gloss <= 0.0 || m.flag[at] == Flag::Invalid {
                    continue;
                }
                let image = std::f64::consts::PI * lamp_half_angle.sin().powi(2);
                let bin = bin_solid_angle(&grid, to, phi);
                // a bin that holds the whole image does not care where in it the image lies
                let inside = gloss * bin / (level * image);
                let edge = if inside < 0.499 {
                    level * 2.0 * lamp_half_angle.radians() * PLACE_DEG.to_radians() / bin
                } else {
                    0.0
                };
                let own = (relative * gloss).hypot(edge);
                for c in 0..3 {
                    m.values[at][c] += gloss as f32;
                    m.sigma[at][c] = f64::from(m.sigma[at][c]).hypot(own) as f32;
                }
            }
        }
    }
}

fn bin_solid_angle(grid: &Grid, to: usize, phi: usize) -> f64 {
    if is_cap(grid, to) {
        let (a, b) = grid.theta_o_bounds(to);
        return (a.cos() - b.cos()) * std::f64::consts::PI;
    }
    grid.solid_angle(to, phi)
}
