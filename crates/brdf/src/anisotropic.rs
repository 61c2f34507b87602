//! A measured BRDF of a sample that looks different when it is turned: four angles.
//!
//! The azimuth φi of the light on the sample is counted from the sample's x axis, right-handedly about its normal; φ = φo − φi runs over the whole circle, since a
//! turned sample need not be symmetric about the plane of incidence. Everything else is as in [`crate::Measured`].

use std::collections::BTreeMap;

use gonio_optics::{Geometry, Vec3};

use crate::{Brdf, Flag, Grid, Meaning, Rgb};

/// A measured table over (φi, θi, θo, φ); φ runs fastest, φi slowest.
#[derive(Clone, Debug, PartialEq)]
pub struct Anisotropic {
    /// Azimuths of the light on the sample, degrees, rising within 0 … 360 (360 not included).
    pub phi_i_deg: Vec<f64>,
    /// θi, θo as ever; φ rising within 0 … 360 (360 not included).
    pub grid: Grid,
    /// Node values or cell means.
    pub meaning: Meaning,
    /// f in 1/sr.
    pub values: Vec<[f32; 3]>,
    /// Standard uncertainty (k = 1) in 1/sr.
    pub sigma: Vec<[f32; 3]>,
    /// What is known of the cell.
    pub flag: Vec<Flag>,
    /// As [`crate::Measured::attributes`].
    pub attributes: BTreeMap<String, String>,
}

impl Anisotropic {
    /// A table of invalid cells.
    #[must_use]
    pub fn empty(phi_i_deg: Vec<f64>, grid: Grid, meaning: Meaning) -> Self {
        let n = phi_i_deg.len() * grid.len();
        Self {
            phi_i_deg,
            grid,
            meaning,
            values: vec![[0.0; 3]; n],
            sigma: vec![[0.0; 3]; n],
            flag: vec![Flag::Invalid; n],
            attributes: BTreeMap::new(),
        }
    }

    /// Whether axes and arrays fit each other.
    ///
    /// # Errors
    /// What does not.
    pub fn check(&self) -> Result<(), String> {
        self.grid.check_within(360.0)?;
        // a full turn is its beginning
        for (name, nodes) in [("phi_i", &self.phi_i_deg), ("phi", &self.grid.phi_deg)] {
            if nodes.is_empty() {
                return Err(format!("{name} without a node"));
            }
            if let Some(x) = nodes.iter().find(|x| !(0.0..360.0).contains(*x)) {
                return Err(format!("{name} with a node at {x} degrees, outside 0 to 360"));
            }
            if let Some(w) = nodes.windows(2).find(|w| w[0] >= w[1]) {
                return Err(format!("{name} with a node at {} degrees after one at {}", w[1], w[0]));
            }
        }
        let n = self.phi_i_deg.len() * self.grid.len();
        for (name, found) in
            [("brdf", self.values.len()), ("sigma", self.sigma.len()), ("flag", self.flag.len())]
        {
            if found != n {
                return Err(format!("{name} with {found} cells instead of {n}"));
            }
        }
        Ok(())
    }

    /// The (θi, θo, φ) table of one azimuth of the light.
    fn start(&self, phi_i: usize) -> usize {
        phi_i * self.grid.len()
    }

    /// f by linear interpolation in all four angles, both azimuths round the circle. Invalid cells do not take part; where none of the sixteen is valid f is 0.
    #[must_use]
    pub fn interpolate(&self, light: Vec3, view: Vec3) -> Rgb {
        let g = Geometry::from_directions(light, view);
        let turn = |x: f64| x.to_degrees().rem_euclid(360.0);
        let phi_i = turn(light.y.atan2(light.x));
        let phi = turn(view.y.atan2(view.x)) - phi_i;
        if ![g.theta_i.radians(), g.theta_o.radians(), phi].iter().all(|x| x.is_finite()) {
            return [f64::NAN; 3];
        }
        let lines = [
            crate::measured::locate(&self.grid.theta_i_deg, g.theta_i.degrees()),
            crate::measured::locate(&self.grid.theta_o_deg, g.theta_o.degrees()),
        ];
        let circles = [around(&self.phi_i_deg, phi_i), around(&self.grid.phi_deg, phi.rem_euclid(360.0))];
        let (mut out, mut total) = ([0.0; 3], 0.0);
        for corner in 0..16usize {
            let up = |axis: usize| corner >> axis & 1 == 1;
            let on_line = |a: usize| {
                let (k, t) = lines[a];
                if up(a) { (k + 1, t) } else { (k, 1.0 - t) }
            };
            let on_circle = |a: usize| {
                let (k, next, t) = circles[a];
                if up(2 + a) { (next, t) } else { (k, 1.0 - t) }
            };
            let (ti, to, pi, p) = (on_line(0), on_line(1), on_circle(0), on_circle(1));
            let w = ti.1 * to.1 * pi.1 * p.1;
            if w <= 0.0 {
                continue;
            }
            let at = self.start(pi.0) + self.grid.index(ti.0, to.0, p.0);
            if let (Some(v), Some(true)) =
                (self.values.get(at), self.flag.get(at).map(|&f| f != Flag::Invalid))
            {
                total += w;
                for c in 0..3 {
                    out[c] += w * f64::from(v[c]);
                }
            }
        }
        if total > 0.0 { out.map(|v| v / total) } else { out }
    }
}

/// The node below, the one after it round the circle, and how far between them.
fn around(nodes: &[f64], x: f64) -> (usize, usize, f64) {
    let n = nodes.len();
    if n < 2 {
        return (0, 0, 0.0);
    }
    let after = nodes.partition_point(|&k| k <= x);
    let (low, high) = ((after + n - 1) % n, after % n);
    let gap = (nodes[high] - nodes[low]).rem_euclid(360.0);
    let along = (x - nodes[low]).rem_euclid(360.0);
    (low, high, if gap > 0.0 { (along / gap).clamp(0.0, 1.0) } else { 0.0 })
}

/// φ of the whole circle from one side: the nodes 0 … 180 of a folded grid, then their mirror images.
#[must_use]
pub fn both_sides(folded_phi_deg: &[f64]) -> Vec<f64> {
    let inside = folded_phi_deg.iter().rev().filter(|p| **p > 0.0 && **p < 180.0).map(|p| 360.0 - p);
    folded_phi_deg.iter().copied().chain(inside).collect()
}

impl Brdf for Anisotropic {
    fn eval(&self, light: Vec3, view: Vec3) -> Rgb {
        if light.z < 0.0 || view.z < 0.0 {
            return [0.0; 3];
        }
        self.interpolate(light, view)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::models::AshikhminShirleyAnisotropic;

    fn brushed() -> AshikhminShirleyAnisotropic {
        AshikhminShirleyAnisotropic {
            diffuse: [0.1, 0.2, 0.3],
            specular: [0.5, 0.5, 0.4],
            exponent_u: 8.0,
            exponent_v: 3.0,
            r0: 0.3,
        }
    }

    /// The model on nodes.
    fn table() -> Anisotropic {
        let grid = Grid {
            theta_i_deg: (0..16).map(|k| 5.0 * f64::from(k)).collect(),
            theta_o_deg: (0..16).map(|k| 5.0 * f64::from(k)).collect(),
            phi_deg: both_sides(&(0..19).map(|k| 10.0 * f64::from(k)).collect::<Vec<_>>()),
        };
        let mut t = Anisotropic::empty((0..24).map(|k| 15.0 * f64::from(k)).collect(), grid, Meaning::Node);
        for at in 0..t.values.len() {
            let (pi, rest) = (at / t.grid.len(), at % t.grid.len());
            let [ti, to, p] = t.grid.coordinates(rest);
            let (l, v) = turned(&t, pi, [ti, to, p]);
            t.values[at] = brushed().eval(l, v).map(|x| x as f32);
            t.flag[at] = Flag::Measured;
        }
        t
    }

    fn turned(t: &Anisotropic, pi: usize, [ti, to, p]: [usize; 3]) -> (Vec3, Vec3) {
        let (i, o) = (t.grid.theta_i_deg[ti].to_radians(), t.grid.theta_o_deg[to].to_radians());
        let (a, b) = (t.phi_i_deg[pi].to_radians(), (t.phi_i_deg[pi] + t.grid.phi_deg[p]).to_radians());
        let at =
            |theta: f64, phi: f64| Vec3::new(theta.sin() * phi.cos(), theta.sin() * phi.sin(), theta.cos());
        (at(i, a), at(o, b))
    }

    #[test]
    fn nodes_come_back_and_between_them_the_model_is_close() {
        let t = table();
        t.check().expect("sound");
        assert_eq!(t.grid.phi_deg.len(), 36);
        for (pi, cell) in [(0, [3, 4, 0]), (23, [7, 2, 35]), (11, [15, 15, 18])] {
            let (l, v) = turned(&t, pi, cell);
            let (have, want) = (t.eval(l, v), brushed().eval(l, v));
            assert!((0..3).all(|c| (have[c] - want[c]).abs() < 1e-6), "{pi} {cell:?}: {have:?} {want:?}");
        }
        let mut worst = 0.0f64;
        for k in 0..500u32 {
            let u = |base: f64| (f64::from(k) * base).fract();
            let (i, o) = (70.0 * u(0.754_877_666), 70.0 * u(0.569_840_29));
            let (a, b) = (std::f64::consts::TAU * u(0.381_966_011), std::f64::consts::TAU * u(0.618_033_988));
            let at = |deg: f64, phi: f64| {
                let theta = deg.to_radians();
                Vec3::new(theta.sin() * phi.cos(), theta.sin() * phi.sin(), theta.cos())
            };
            let (l, v) = (at(i, a), at(o, b));
            let (have, want) = (t.eval(l, v), brushed().eval(l, v));
            worst = worst.max((have[1] / want[1] - 1.0).abs());
        }
        assert!(worst < 0.05, "{worst}");
    }

    #[test]
    fn what_does_not_fit_is_told() {
        let mut t = table();
        t.phi_i_deg[3] = 360.0;
        assert!(t.check().expect_err("a full turn").contains("phi_i"));
        let mut t = table();
        t.sigma.pop();
        assert!(t.check().expect_err("short").contains("sigma"));
        assert!(table().eval(Vec3::new(f64::NAN, 0.0, 0.5), Vec3::Z)[0].is_nan());
    }
}
