//! A pair of directions (light, view) in the quantities that the models are written in, bare or seen through a coat.

use gonio_optics::{COS_FLOOR, Vec3};

use crate::number::Number;

/// A pair of directions outside the coat, with the weight it has in the mean of its cell.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Sample {
    pub weight: f64,
    /// n·l and n·v.
    pub cos: [f64; 2],
    /// sin² of both polar angles.
    pub sin2: [f64; 2],
    /// |l + v|² in the surface's plane.
    pub half_xy2: f64,
    /// Share of x in it, h_x²/(h_x² + h_y²): the direction of the half vector's tangent on an anisotropic sample.
    pub share_x: f64,
}

impl Sample {
    /// Of two unit directions; `None` where one is below the horizon.
    pub(crate) fn new(weight: f64, light: Vec3, view: Vec3) -> Option<Self> {
        if light.z < 0.0 || view.z < 0.0 {
            return None;
        }
        let (x, y) = (light.x + view.x, light.y + view.y);
        let half_xy2 = x * x + y * y;
        Some(Self {
            weight,
            cos: [light.z, view.z],
            sin2: [light, view].map(|d| d.x * d.x + d.y * d.y),
            half_xy2,
            share_x: if half_xy2 > 0.0 { x * x / half_xy2 } else { 0.5 },
        })
    }

    /// The pair as the base sees it: without a coat, or refracted into one of `index`.
    pub(crate) fn ray<T: Number>(&self, index: Option<T>) -> Ray<T> {
        let k = T::constant;
        let Some(n) = index else {
            return self.seen(k(1.0), self.cos.map(k), k(1.0));
        };
        let shrink = k(1.0) / n.squared();
        // Snell: sin² shrinks by n²
        let cos = [0, 1].map(|i| (k(1.0) - shrink.times(self.sin2[i])).at_least(0.0).sqrt());
        let through = |i: usize| k(1.0) - reflectance(self.cos[i], n);
        self.seen(shrink, cos, through(0) * through(1) * shrink)
    }

    fn seen<T: Number>(&self, shrink: T, cos: [T; 2], throughput: T) -> Ray<T> {
        let k = T::constant;
        let half_xy2 = shrink.times(self.half_xy2);
        let (sum, difference) = (cos[0] + cos[1], cos[0] - cos[1]);
        let norm2 = half_xy2 + sum.squared();
        // l = −v (both at 90°): h = n, h·v floored
        let (sin2, hv) = if norm2.value() > 1e-24 {
            ((half_xy2 / norm2).smaller(k(1.0)), norm2.sqrt().times(0.5).at_least(COS_FLOOR))
        } else {
            (k(0.0), k(COS_FLOOR))
        };
        let m = k(1.0) - hv.smaller(k(1.0));
        let m2 = m.squared();
        Ray {
            throughput,
            cos: cos.map(|c| c.at_least(COS_FLOOR)),
            sin2,
            hv,
            rise: m2.squared() * m,
            below: (half_xy2 + difference.squared()).times(0.5),
            tangent: shrink.times(0.5 * (self.half_xy2 - self.sin2[0] - self.sin2[1])),
            share_x: self.share_x,
        }
    }
}

/// What the terms of the models are functions of.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Ray<T> {
    /// T(θi) T(θo)/n² of a coat, 1 without.
    pub throughput: T,
    /// n·l and n·v, floored at 1e-6.
    pub cos: [T; 2],
    /// sin² of the half vector's polar angle.
    pub sin2: T,
    /// h·v.
    pub hv: T,
    /// (1 − h·v)^5, what Schlick's term rises with.
    pub rise: T,
    /// 1 − r·v, r the mirror direction of the light.
    pub below: T,
    /// l_x v_x + l_y v_y.
    pub tangent: T,
    /// h_x²/(h_x² + h_y²).
    pub share_x: f64,
}

impl Ray<f64> {
    /// The same with numbers that carry derivatives.
    pub(crate) fn lifted<T: Number>(&self) -> Ray<T> {
        let k = T::constant;
        Ray {
            throughput: k(self.throughput),
            cos: self.cos.map(k),
            sin2: k(self.sin2),
            hv: k(self.hv),
            rise: k(self.rise),
            below: k(self.below),
            tangent: k(self.tangent),
            share_x: self.share_x,
        }
    }
}

/// Unpolarised Fresnel reflectance from air into `index`, as [`gonio_optics::fresnel::dielectric`], for numbers with derivatives.
pub(crate) fn reflectance<T: Number>(cos: f64, index: T) -> T {
    let c = cos.clamp(0.0, 1.0);
    let n2m1 = index.plus(-1.0) * index.plus(1.0);
    let g2 = n2m1.plus(c * c);
    if g2.value() <= 0.0 {
        return T::constant(1.0);
    }
    let sum = g2.sqrt().plus(c);
    let (rs, difference) = (n2m1 / sum.squared(), n2m1 / sum);
    let ratio = sum.times(c).plus(-1.0) / difference.times(c).plus(1.0);
    (rs.squared() * ratio.squared().plus(1.0)).times(0.5)
}

#[cfg(test)]
mod tests {
    use super::*;
    use gonio_optics::{Geometry, fresnel};

    #[test]
    fn a_ray_through_a_coat_is_that_of_the_refracted_directions() {
        for (ti, to, phi) in [(0.0, 0.0, 0.0), (30.0, 31.0, 179.0), (70.0, 65.0, 40.0), (89.0, 10.0, 90.0)] {
            let (l, v) = Geometry::from_degrees(ti, to, phi).directions();
            let ray = Sample::new(1.0, l, v).unwrap().ray(Some(1.5));
            let (a, b) = (fresnel::refract(l, 1.5), fresnel::refract(v, 1.5));
            let plain = Sample::new(1.0, a, b).unwrap().ray::<f64>(None);
            for (x, y) in [
                (ray.sin2, plain.sin2),
                (ray.hv, plain.hv),
                (ray.below, plain.below),
                (ray.tangent, plain.tangent),
                (ray.cos[0], plain.cos[0]),
                (ray.cos[1], plain.cos[1]),
            ] {
                assert!((x - y).abs() < 1e-14, "{ti} {to} {phi}: {x} {y}");
            }
            let t = |d: Vec3| 1.0 - fresnel::dielectric(d.z, 1.5);
            assert!((ray.throughput - t(l) * t(v) / 2.25).abs() < 1e-14);
        }
    }
}
