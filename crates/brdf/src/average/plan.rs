//! How many quadrature nodes a lobe needs in a cell: as many as its curvature there asks for and no more.
//!
//! Near its peak a lobe (n·h)^n is exp(−n|p|²/2) with p the tangential part of the half vector. Over a box that moves p by ±δ its
//! logarithm changes by k ≈ n p·δ, and a Gauss rule of m nodes integrates exp(kx) with a relative error of C_m k^2m. So each box gets the
//! smallest m that keeps the error below the tolerance and is halved where m would exceed 8. In the tail, where the lobe has
//! fallen to e^(−d²/2) of its peak, an error larger by e^(d²/4) is allowed.

use std::sync::OnceLock;

use gonio_optics::{Angle, Vec3, quadrature::gauss_legendre};

use super::CellBounds;

/// Largest Gauss rule before a box is halved.
const MAX_ORDER: usize = 8;
/// Relative error aimed at.
const TOLERANCE: f64 = 2e-5;
/// A lobe below e^−23 of its peak (1e-10) is nothing.
const NOTHING: f64 = 23.0;
/// Boxes are not halved more often than this.
const MAX_DEPTH: usize = 24;
/// Half widths of a lobe that a cell may hold before a whole grid's worth of nodes stops following it: wide cells under narrow lobes
/// would need millions. Cells of Sopp's grid reach this at exponents near 1e5, cells of 10° near 7e4, of 30° near 8e3.
const WIDEST: f64 = 24.0;
/// The same for whole tables at every sharpness: cells of Sopp's grid reach it at exponents near 7e4, cells of 10° near 4e3.
const WIDEST_IN_TABLES: f64 = 6.0;

/// A quadrature for lobes of a range of exponents.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Plan {
    /// Smallest exponent it serves: decides where the lobe is nothing.
    low: f64,
    /// Largest exponent it serves: decides the number of nodes.
    high: f64,
    /// Leave out boxes where the lobe is nothing.
    lobe_only: bool,
    /// Half widths of a lobe that a cell may hold before the nodes stop following it.
    widest: f64,
    /// Serves every exponent up to `high`: a box far from the peak sees none but wide lobes, for the narrow ones are nothing there.
    every: bool,
}

/// Tangential part of a half vector.
#[derive(Clone, Copy)]
struct Tangent(f64, f64);

impl Tangent {
    fn new(light: Vec3, view: Vec3) -> Self {
        let s = light + view;
        let n = s.norm().max(1e-12);
        Self(s.x / n, s.y / n)
    }
    fn minus(self, o: Self) -> Self {
        Self(self.0 - o.0, self.1 - o.1)
    }
    fn half(self) -> Self {
        Self(0.5 * self.0, 0.5 * self.1)
    }
    fn dot(self, o: Self) -> f64 {
        self.0 * o.0 + self.1 * o.1
    }
    fn norm(self) -> f64 {
        self.0.hypot(self.1)
    }
}

/// A box in (z = cos θo, φ).
#[derive(Clone, Copy)]
struct Box2 {
    z: (f64, f64),
    phi: (f64, f64),
}

impl Box2 {
    fn view(z: f64, phi: f64) -> Vec3 {
        let s = (1.0 - z * z).max(0.0).sqrt();
        let (sp, cp) = phi.sin_cos();
        Vec3::new(s * cp, s * sp, z)
    }
}

/// Extent of a box in half-vector space, for one light.
struct Extent {
    centre: Tangent,
    by_z: Tangent,
    by_phi: Tangent,
    /// Departure from a straight line along φ.
    bend: f64,
}

impl Extent {
    fn new(light: Vec3, b: &Box2) -> Self {
        let (z, phi) = (0.5 * (b.z.0 + b.z.1), 0.5 * (b.phi.0 + b.phi.1));
        let at = |z, phi| Tangent::new(light, Box2::view(z, phi));
        let centre = at(z, phi);
        let (p0, p1) = (at(z, b.phi.0), at(z, b.phi.1));
        let by_z = at(b.z.1, phi).minus(at(b.z.0, phi)).half();
        let by_phi = p1.minus(p0).half();
        let middle = Tangent(0.5 * (p0.0 + p1.0), 0.5 * (p0.1 + p1.1));
        Self { centre, by_z, by_phi, bend: centre.minus(middle).norm() }
    }

    fn radius(&self) -> f64 {
        self.by_z.norm() + self.by_phi.norm() + self.bend
    }

    /// Smallest distance from the peak.
    fn nearest(&self) -> f64 {
        (self.centre.norm() - self.radius()).max(0.0)
    }

    /// Square of the largest change of ln f over a move of ±δ from anywhere in the box, the lobe's own curvature included.
    fn change(&self, exponent: f64, delta: Tangent) -> f64 {
        let reach = self.centre.dot(delta).abs() + self.radius() * delta.norm();
        let slope = exponent * reach / (1.0 - self.centre.dot(self.centre)).max(0.05);
        slope * slope + 4.0 * exponent * delta.dot(delta)
    }
}

impl Plan {
    /// Nodes for a smooth part and lobes up to `sharpness`.
    pub(crate) fn everywhere(sharpness: f64) -> Self {
        let n = if sharpness.is_finite() { sharpness.clamp(4.0, 1e9) } else { 1e9 };
        Self { low: n, high: n, lobe_only: false, widest: f64::INFINITY, every: false }
    }

    /// Nodes for lobes alone, of exponents `low` to `high`.
    pub(crate) fn lobes(low: f64, high: f64) -> Self {
        Self { low, high, lobe_only: true, widest: WIDEST, every: false }
    }

    /// As [`Plan::everywhere`], for whole tables: lobes far narrower than a cell are not followed into it.
    pub(crate) fn table(sharpness: f64) -> Self {
        Self { widest: WIDEST_IN_TABLES, ..Self::everywhere(sharpness) }
    }

    /// Nodes that serve lobes of every exponent up to `high` at once.
    pub(crate) fn every_lobe(high: f64) -> Self {
        Self { low: 0.1, high, lobe_only: true, widest: WIDEST_IN_TABLES, every: true }
    }

    /// Largest exponent whose lobe is something at this distance from its peak.
    fn highest(&self, nearest: f64) -> f64 {
        if self.every { self.high.min((2.0 * NOTHING / (nearest * nearest)).max(4.0)) } else { self.high }
    }

    /// Calls `visit(weight, light, view)` at every node; the weights of a cell sum to 1 (less what was left out).
    pub(crate) fn samples(&self, cell: &CellBounds, visit: &mut impl FnMut(f64, Vec3, Vec3)) {
        let bin = Box2 {
            z: (cell.theta_o.1.cos(), cell.theta_o.0.cos()),
            phi: (cell.phi.0.radians(), cell.phi.1.radians()),
        };
        let axis = Vec3::from_polar(cell.theta_i, Angle::ZERO);
        let extent = Extent::new(axis, &bin);
        let (in_plane, across) = lamp_edges(cell);
        let (v, c) = (Box2::view(0.5 * (bin.z.0 + bin.z.1), 0.5 * (bin.phi.0 + bin.phi.1)), extent.centre);
        let deltas = [in_plane, across].map(|l| Tangent::new(l, v).minus(c));
        if self.widest.is_finite() {
            let widest = extent.by_z.norm().max(extent.by_phi.norm()).max(1e-9);
            let resolved = (self.widest / widest).powi(2);
            if self.high > resolved {
                let (low, high) = (self.low.min(resolved), resolved);
                return Self { low, high, widest: f64::INFINITY, ..*self }.samples(cell, visit);
            }
        }
        let nearest = (extent.nearest() - deltas[0].norm().max(deltas[1].norm())).max(0.0);
        if self.lobe_only && 0.5 * self.low * nearest * nearest > NOTHING {
            return;
        }
        let high = self.highest(nearest);
        let k2 = deltas.map(|d| extent.change(high, d)).into_iter().fold(0.0, f64::max);
        for (light, weight) in lamp_rule(cell, k2 * self.relief(nearest)) {
            // the kink of 1/max(n·l, n·v)
            if light.z > bin.z.0 + 1e-12 && light.z < bin.z.1 - 1e-12 {
                let share = (light.z - bin.z.0) / (bin.z.1 - bin.z.0);
                self.boxed(light, Box2 { z: (bin.z.0, light.z), ..bin }, weight * share, 0, visit);
                self.boxed(light, Box2 { z: (light.z, bin.z.1), ..bin }, weight * (1.0 - share), 0, visit);
            } else {
                self.boxed(light, bin, weight, 0, visit);
            }
        }
    }

    /// Factor on k² that the tail of the lobe allows.
    fn relief(&self, nearest: f64) -> f64 {
        (-self.low * nearest * nearest / 16.0).max(-2.0).exp()
    }

    fn boxed(
        &self,
        light: Vec3,
        b: Box2,
        weight: f64,
        depth: usize,
        visit: &mut impl FnMut(f64, Vec3, Vec3),
    ) {
        let extent = Extent::new(light, &b);
        let nearest = extent.nearest();
        let nothing = 0.5 * self.low * nearest * nearest > NOTHING;
        if nothing && self.lobe_only {
            return;
        }
        let (kz, kp) = if nothing {
            (0.0, 0.0)
        } else {
            let (relief, high) = (self.relief(nearest), self.highest(nearest));
            let bend = 4.0 * high * extent.bend * extent.bend;
            (
                extent.change(high, extent.by_z) * relief,
                (extent.change(high, extent.by_phi) + bend) * relief,
            )
        };
        let (nz, np) = (order(kz), order(kp));
        if depth < MAX_DEPTH && nz.max(np) > MAX_ORDER {
            let halves = if kz > kp {
                let m = 0.5 * (b.z.0 + b.z.1);
                [Box2 { z: (b.z.0, m), ..b }, Box2 { z: (m, b.z.1), ..b }]
            } else {
                let m = 0.5 * (b.phi.0 + b.phi.1);
                [Box2 { phi: (b.phi.0, m), ..b }, Box2 { phi: (m, b.phi.1), ..b }]
            };
            for half in halves {
                self.boxed(light, half, 0.5 * weight, depth + 1, visit);
            }
            return;
        }
        // a wide azimuth turns p through a circle, which two nodes cannot follow
        let np = if b.phi.1 - b.phi.0 > 1.0 { np.max(6) } else { np };
        for &(x, wx) in rule(nz) {
            let z = b.z.0 + (b.z.1 - b.z.0) * x;
            let s = (1.0 - z * z).max(0.0).sqrt();
            for &(y, wy) in rule(np) {
                let (sp, cp) = (b.phi.0 + (b.phi.1 - b.phi.0) * y).sin_cos();
                visit(weight * wx * wy, light, Vec3::new(s * cp, s * sp, z));
            }
        }
    }
}

/// The lamp's edge towards the normal (or away from it at small θi) and across the plane of incidence.
fn lamp_edges(cell: &CellBounds) -> (Vec3, Vec3) {
    let axis = Vec3::from_polar(cell.theta_i, Angle::ZERO);
    let (s, c) = cell.lamp_half_angle.sin_cos();
    (Vec3::from_polar(cell.theta_i + cell.lamp_half_angle, Angle::ZERO), axis * c + Vec3::Y * s)
}

/// Smallest Gauss rule (2 … 9, 9 meaning "halve") that integrates exp(kx) over [−1, 1] within the tolerance: C_m k^2m ≤ tol with
/// C_m = 2^2m (m!)^4 / ((2m + 1) ((2m)!)³), the classical remainder.
fn order(k2: f64) -> usize {
    static LIMITS: OnceLock<[f64; MAX_ORDER - 1]> = OnceLock::new();
    let limits = LIMITS.get_or_init(|| {
        std::array::from_fn(|i| {
            let m = (i + 2) as f64;
            let factorial = |n: f64| (1..=n as u32).map(f64::from).product::<f64>();
            let c = (2.0 * m).exp2() * factorial(m).powi(4) / ((2.0 * m + 1.0) * factorial(2.0 * m).powi(3));
            (TOLERANCE / c).powf(1.0 / m)
        })
    });
    limits.iter().position(|&l| k2 <= l).map_or(MAX_ORDER + 1, |i| i + 2)
}

/// Gauss rules of up to 32 nodes, made once.
fn rule(n: usize) -> &'static [(f64, f64)] {
    static RULES: OnceLock<Vec<Vec<(f64, f64)>>> = OnceLock::new();
    let rules = RULES.get_or_init(|| (0..=32).map(gauss_legendre).collect());
    &rules[n.min(32)]
}

/// Radon's rule of degree 5 on the disc: the centre with weight 1/4, six points at √(2/3) of the radius with 1/8.
fn seven_points(cell: &CellBounds, axis: Vec3) -> Vec<(Vec3, f64)> {
    let (in_plane, across) = (Vec3::from_polar(cell.theta_i + Angle::RIGHT, Angle::ZERO), Vec3::Y);
    let one_minus_cos = 2.0 / 3.0 * 2.0 * (cell.lamp_half_angle * 0.5).sin().powi(2);
    let (c, s) = (1.0 - one_minus_cos, (one_minus_cos * (2.0 - one_minus_cos)).sqrt());
    let ring = (0..6).map(|j| {
        let (sp, cp) = (std::f64::consts::TAU * f64::from(j) / 6.0).sin_cos();
        (in_plane * (s * cp) + across * (s * sp) + axis * c, 0.125)
    });
    std::iter::once((axis, 0.25)).chain(ring).collect()
}

/// Directions over the lamp's disc, weighted with the irradiance cos θ' that each brings, the weights summing to 1.
fn lamp_rule(cell: &CellBounds, k2: f64) -> Vec<(Vec3, f64)> {
    let mut rule = disc_rule(cell, k2);
    for (light, weight) in &mut rule {
        *weight *= light.z.max(0.0);
    }
    let lit: f64 = rule.iter().map(|r| r.1).sum();
    if lit > 0.0 {
        rule.retain(|r| r.1 > 0.0);
        for (_, weight) in &mut rule {
            *weight /= lit;
        }
    }
    rule
}

/// Directions over the lamp's disc with weights summing to 1, uniform in solid angle: Gauss in the squared radius times equal angles, as fine as a change
/// k (squared) of the logarithm over the radius needs. Symmetric about the plane of incidence.
fn disc_rule(cell: &CellBounds, k2: f64) -> Vec<(Vec3, f64)> {
    let axis = Vec3::from_polar(cell.theta_i, Angle::ZERO);
    // light from one side weighs more by α tan θi: at grazing incidence that, too, moves the mean by k α tan θi / 4
    let uneven = cell.lamp_half_angle.radians() * cell.theta_i.tan();
    if cell.lamp_half_angle <= Angle::ZERO || (k2 < 1e-5 && k2 * uneven * uneven < 1e-8) {
        return vec![(axis, 1.0)];
    }
    // errors: (k/2)^4m/((2m)!)² · E[P_m²] radially, I_K(k r) around; both below the tolerance
    if (0.088..0.75).contains(&k2) {
        return seven_points(cell, axis);
    }
    let (radial, angles) = match k2 {
        k if k < 0.0075 => (1, 3),
        k if k < 0.088 => (1, 4),
        k if k < 0.9 => (2, 6),
        k if k < 4.0 => (2, 8),
        k => {
            let m = (2.0 + ((k.sqrt() - 2.0) / 2.4).ceil()).min(32.0) as usize;
            (m, 4 * m)
        }
    };
    let (in_plane, across) = (Vec3::from_polar(cell.theta_i + Angle::RIGHT, Angle::ZERO), Vec3::Y);
    let cap = 2.0 * (cell.lamp_half_angle * 0.5).sin().powi(2);
    let mut out = Vec::with_capacity(radial * angles);
    for &(t, w) in rule(radial) {
        let one_minus_cos = cap * t;
        let (c, s) = (1.0 - one_minus_cos, (one_minus_cos * (2.0 - one_minus_cos)).max(0.0).sqrt());
        for j in 0..angles {
            let (sp, cp) = (std::f64::consts::TAU * (j as f64 + 0.5) / angles as f64).sin_cos();
            out.push((in_plane * (s * cp) + across * (s * sp) + axis * c, w / angles as f64));
        }
    }
    out
}
