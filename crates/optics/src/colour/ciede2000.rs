//! The CIEDE2000 colour difference after Sharma, Wu and Dalal (2005), kL = kC = kH = 1.

use super::Lab;

/// CIEDE2000 difference of two colours.
#[must_use]
pub fn ciede2000(p: Lab, q: Lab) -> f64 {
    const POW25_7: f64 = 6_103_515_625.0;
    let pow7 = |x: f64| x.powi(7);
    let c_mean = 0.5 * (p.a.hypot(p.b) + q.a.hypot(q.b));
    let g = 0.5 * (1.0 - (pow7(c_mean) / (pow7(c_mean) + POW25_7)).sqrt());
    let (a1, a2) = ((1.0 + g) * p.a, (1.0 + g) * q.a);
    let (c1, c2) = (a1.hypot(p.b), a2.hypot(q.b));
    let hue =
        |a: f64, b: f64| if a == 0.0 && b == 0.0 { 0.0 } else { b.atan2(a).to_degrees().rem_euclid(360.0) };
    let (h1, h2) = (hue(a1, p.b), hue(a2, q.b));

    let dl = q.l - p.l;
    let dc = c2 - c1;
    let achromatic = c1 * c2 == 0.0;
    let dh = if achromatic {
        0.0
    } else {
        let d = h2 - h1;
        if d > 180.0 {
            d - 360.0
        } else if d < -180.0 {
            d + 360.0
        } else {
            d
        }
    };
    let d_hue = 2.0 * (c1 * c2).sqrt() * (0.5 * dh).to_radians().sin();

    let l_mean = 0.5 * (p.l + q.l);
    let cm = 0.5 * (c1 + c2);
    let h_mean = if achromatic {
        h1 + h2
    } else if (h1 - h2).abs() <= 180.0 {
        0.5 * (h1 + h2)
    } else if h1 + h2 < 360.0 {
        0.5 * (h1 + h2 + 360.0)
    } else {
        0.5 * (h1 + h2 - 360.0)
    };
    let cosd = |x: f64| x.to_radians().cos();
    let t = 1.0 - 0.17 * cosd(h_mean - 30.0) + 0.24 * cosd(2.0 * h_mean) + 0.32 * cosd(3.0 * h_mean + 6.0)
        - 0.20 * cosd(4.0 * h_mean - 63.0);
    let theta = 30.0 * (-((h_mean - 275.0) / 25.0).powi(2)).exp();
    let rc = 2.0 * (pow7(cm) / (pow7(cm) + POW25_7)).sqrt();
    let l50 = (l_mean - 50.0).powi(2);
    let sl = 1.0 + 0.015 * l50 / (20.0 + l50).sqrt();
    let sc = 1.0 + 0.045 * cm;
    let sh = 1.0 + 0.015 * cm * t;
    let rt = -(2.0 * theta).to_radians().sin() * rc;
    let (x, y, z) = (dl / sl, dc / sc, d_hue / sh);
    (x * x + y * y + z * z + rt * y * z).max(0.0).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Rows of the test table published with the formula (Sharma, Wu, Dalal 2005, table 1).
    #[test]
    fn the_published_test_pairs_are_met() {
        let rows = [
            (50.0, 2.6772, -79.7751, 50.0, 0.0, -82.7485, 2.0425),
            (50.0, 3.1571, -77.2803, 50.0, 0.0, -82.7485, 2.8615),
            (50.0, -1.3802, -84.2814, 50.0, 0.0, -82.7485, 1.0000),
            (50.0, 0.0, 0.0, 50.0, -1.0, 2.0, 2.3669),
            (50.0, 2.49, -0.001, 50.0, -2.49, 0.0009, 7.1792),
            (50.0, 2.49, -0.001, 50.0, -2.49, 0.0011, 7.2195),
            (50.0, 2.5, 0.0, 73.0, 25.0, -18.0, 27.1492),
            (50.0, 2.5, 0.0, 56.0, -27.0, -3.0, 31.9030),
            (60.2574, -34.0099, 36.2677, 60.4626, -34.1751, 39.4387, 1.2644),
            (22.7233, 20.0904, -46.694, 23.0331, 14.973, -42.5619, 2.0373),
            (90.8027, -2.0831, 1.441, 91.1528, -1.6435, 0.0447, 1.4441),
            (2.0776, 0.0795, -1.135, 0.9033, -0.0636, -0.5514, 0.9082),
        ];
        for (l1, a1, b1, l2, a2, b2, want) in rows {
            let (p, q) = (Lab { l: l1, a: a1, b: b1 }, Lab { l: l2, a: a2, b: b2 });
            assert!((ciede2000(p, q) - want).abs() < 5e-5, "{p:?} {q:?}: {}", ciede2000(p, q));
            assert!((ciede2000(q, p) - want).abs() < 5e-5);
        }
    }
}
