//! Places, boxes and outlines in points.

/// A position in points: x to the right, y down, from the upper left corner.
pub(crate) type At = (f64, f64);

/// An axis-parallel box in points.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Area {
    pub x: f64,
    pub y: f64,
    pub w: f64,
    pub h: f64,
}

impl Area {
    pub(crate) const fn new(x: f64, y: f64, w: f64, h: f64) -> Self {
        Self { x, y, w, h }
    }

    pub(crate) const fn right(self) -> f64 {
        self.x + self.w
    }

    pub(crate) const fn bottom(self) -> f64 {
        self.y + self.h
    }

    pub(crate) const fn centre(self) -> At {
        (self.x + 0.5 * self.w, self.y + 0.5 * self.h)
    }
}

/// A circle as a polygon that stays within a hundredth of a pixel of it for radii up to some hundred points.
pub(super) fn circle(centre: At, radius: f64) -> Vec<At> {
    let n = (12.0 + 4.0 * radius.max(0.0)).min(256.0) as u32;
    (0..n)
        .map(|k| {
            let (s, c) = (std::f64::consts::TAU * f64::from(k) / f64::from(n)).sin_cos();
            (centre.0 + radius * c, centre.1 + radius * s)
        })
        .collect()
}

/// The box around a line, always wound like [`circle`], so that joints add up.
pub(super) fn thick(a: At, b: At, half: f64) -> Option<Vec<At>> {
    let (dx, dy) = (b.0 - a.0, b.1 - a.1);
    let length = dx.hypot(dy);
    if !(length > 0.0 && length.is_finite()) {
        return None;
    }
    let (nx, ny) = (-dy / length * half, dx / length * half);
    Some(vec![(a.0 - nx, a.1 - ny), (b.0 - nx, b.1 - ny), (b.0 + nx, b.1 + ny), (a.0 + nx, a.1 + ny)])
}
