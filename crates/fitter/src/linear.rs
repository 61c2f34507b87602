//! The linear part: two coefficients, neither below 0, from sums over the data.

/// Weighted sums of one channel over the data: d the diffuse term, p and q the lobe without and with (1 − h·v)^5, y the value.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Sums {
    pub dd: f64,
    pub dp: f64,
    pub dq: f64,
    pub pp: f64,
    pub pq: f64,
    pub qq: f64,
    pub dy: f64,
    pub py: f64,
    pub qy: f64,
    pub yy: f64,
}

/// Coefficients of diffuse term and lobe, and what is left of the sum of squares.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Solution {
    pub diffuse: f64,
    pub lobe: f64,
    pub squares: f64,
}

impl Sums {
    pub(crate) fn add(&mut self, w: f64, d: f64, (p, q): (f64, f64), y: f64) {
        let (wd, wp, wq) = (w * d, w * p, w * q);
        self.dd += wd * d;
        self.dp += wd * p;
        self.dq += wd * q;
        self.pp += wp * p;
        self.pq += wp * q;
        self.qq += wq * q;
        self.dy += wd * y;
        self.py += wp * y;
        self.qy += wq * y;
        self.yy += w * y * y;
    }

    pub(crate) fn merge(&mut self, o: &Self) {
        self.dd += o.dd;
        self.dp += o.dp;
        self.dq += o.dq;
        self.pp += o.pp;
        self.pq += o.pq;
        self.qq += o.qq;
        self.dy += o.dy;
        self.py += o.py;
        self.qy += o.qy;
        self.yy += o.yy;
    }

    /// Least squares for the lobe `r0 p + (1 − r0) q`, both coefficients ≥ 0.
    pub(crate) fn solve(&self, r0: f64) -> Solution {
        let s = 1.0 - r0;
        let dl = r0 * self.dp + s * self.dq;
        let ll = r0 * r0 * self.pp + 2.0 * r0 * s * self.pq + s * s * self.qq;
        let ly = r0 * self.py + s * self.qy;
        let with = |diffuse: f64, lobe: f64| {
            // x·(A x − b) = 0 at a bounded minimum, so the squares are yy − x·b
            let squares = self.yy - diffuse * self.dy - lobe * ly;
            // rounding below 0 is nothing; not-a-number must stay
            Solution { diffuse, lobe, squares: if squares < 0.0 { 0.0 } else { squares } }
        };
        let det = self.dd * ll - dl * dl;
        if det > 1e-13 * self.dd * ll {
            let (a, b) = ((ll * self.dy - dl * ly) / det, (self.dd * ly - dl * self.dy) / det);
            if a >= 0.0 && b >= 0.0 {
                return with(a, b);
            }
        }
        let alone = |num: f64, den: f64| if den > 0.0 { (num / den).max(0.0) } else { 0.0 };
        let (diffuse, lobe) = (with(alone(self.dy, self.dd), 0.0), with(0.0, alone(ly, ll)));
        if lobe.squares < diffuse.squares { lobe } else { diffuse }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn no_other_coefficients_within_the_bounds_do_better(values in proptest::collection::vec((0.1..1.0f64, 0.0..5.0f64, 0.0..1.0f64, -1.0..2.0f64), 4..30), r0 in 0.0..1.0f64, da in -0.1..0.1f64, db in -0.1..0.1f64) {
            let mut s = Sums::default();
            for &(w, p, q, y) in &values {
                s.add(w, 0.3, (p, q), y);
            }
            let x = s.solve(r0);
            let squares = |a: f64, b: f64| values.iter().map(|&(w, p, q, y)| {
                let r = y - a * 0.3 - b * (r0 * p + (1.0 - r0) * q);
                w * r * r
            }).sum::<f64>();
            prop_assert!(x.diffuse >= 0.0 && x.lobe >= 0.0);
            prop_assert!((squares(x.diffuse, x.lobe) - x.squares).abs() < 1e-9 * s.yy.max(1.0));
            let other = squares((x.diffuse + da).max(0.0), (x.lobe + db).max(0.0));
            prop_assert!(x.squares <= other + 1e-9 * s.yy.max(1.0), "{x:?} {other}");
        }
    }
}
