//! How much of each pixel an ellipse covers: the lamp's image is uniform inside and sharp at its edge, and a few pixels wide only,
//! so that a plain centre of gravity of pixel values would be off by some hundredths of a pixel with the place inside the pixel.

/// An ellipse on the sensor: centre and the images of two radii at right angles, pixels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ellipse {
    /// Centre (column, row).
    pub centre: [f64; 2],
    /// Images of two perpendicular radii of a circle.
    pub radii: [[f64; 2]; 2],
}

/// Lines by which a pixel is cut.
const LINES: usize = 16;

impl Ellipse {
    /// Half width and half height of the box around it.
    #[must_use]
    pub fn reach(&self) -> [f64; 2] {
        [0, 1].map(|k| self.radii[0][k].hypot(self.radii[1][k]))
    }

    /// Area, pixels.
    #[must_use]
    pub fn area(&self) -> f64 {
        let [a, b] = self.radii;
        std::f64::consts::PI * (a[0] * b[1] - a[1] * b[0]).abs()
    }

    /// Share of pixel (`column`, `row`) inside: lines along the row, each cut exactly.
    #[must_use]
    pub fn coverage(&self, column: usize, row: usize) -> f64 {
        let [a, b] = self.radii;
        let det = a[0] * b[1] - a[1] * b[0];
        if det.abs() < 1e-12 {
            return 0.0;
        }
        let x0 = column as f64 - self.centre[0];
        let mut sum = 0.0;
        for i in 0..LINES {
            let y = row as f64 + (i as f64 + 0.5) / LINES as f64 - self.centre[1];
            // unit disc coordinates of (x, y): s = (x b_y − y b_x)/det, t = (y a_x − x a_y)/det; s² + t² ≤ 1
            let qa = (b[1] * b[1] + a[1] * a[1]) / (det * det);
            let qb = -y * (b[1] * b[0] + a[0] * a[1]) / (det * det);
            let qc = y * y * (b[0] * b[0] + a[0] * a[0]) / (det * det) - 1.0;
            let disc = qb * qb - qa * qc;
            if disc <= 0.0 {
                continue;
            }
            let root = disc.sqrt();
            let (low, high) = ((-qb - root) / qa, (-qb + root) / qa);
            sum += (high.min(x0 + 1.0) - low.max(x0)).max(0.0);
        }
        sum / LINES as f64
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_pixels_of_an_ellipse_add_up_to_its_area_about_its_centre() {
        let e = Ellipse { centre: [10.3, 8.8], radii: [[2.1, 0.7], [-0.4, 1.6]] };
        let (mut area, mut moment) = (0.0, [0.0; 2]);
        for row in 0..20 {
            for column in 0..20 {
                let c = e.coverage(column, row);
                assert!((0.0..=1.0 + 1e-12).contains(&c));
                area += c;
                moment = [moment[0] + c * (column as f64 + 0.5), moment[1] + c * (row as f64 + 0.5)];
            }
        }
        assert!((area / e.area() - 1.0).abs() < 2e-3, "{area} {}", e.area());
        // pixel centres stand for pixels: good to a few hundredths only, which is why centres are fitted
        for (m, centre) in moment.iter().zip(e.centre) {
            assert!((m / area - centre).abs() < 0.05);
        }
        assert_eq!(e.coverage(10, 8), 1.0);
        assert_eq!(e.coverage(0, 0), 0.0);
    }
}
