//! The part of the sensor about the mirror direction whose pixels are kept: where a gloss is looked for, and the cells that it reaches.

use std::ops::Range;

use crate::cells::PixelValue;
use crate::merge::Merged;

/// Values of the pixels of a rectangle.
#[derive(Clone, Debug, Default)]
pub(crate) struct Window {
    width: usize,
    columns: Range<usize>,
    rows: Range<usize>,
    values: Vec<PixelValue>,
    /// Relative variances of the white reference's pixels.
    relative: Vec<f32>,
}

impl Window {
    /// The smallest rectangle that holds `pixels` of a sensor `width` pixels wide; `relative` is of the whole sensor.
    pub(crate) fn about(pixels: impl Iterator<Item = usize>, width: usize, relative: &[f32]) -> Self {
        let mut bounds: Option<[usize; 4]> = None;
        for p in pixels {
            let (x, y) = (p % width, p / width);
            let [a, b, c, d] = bounds.unwrap_or([x, x, y, y]);
            bounds = Some([a.min(x), b.max(x), c.min(y), d.max(y)]);
        }
        let Some([a, b, c, d]) = bounds else { return Self { width: width.max(1), ..Self::default() } };
        let (columns, rows) = (a..b + 1, c..d + 1);
        let relative = rows.clone().flat_map(|y| relative[y * width + a..y * width + b + 1].iter().copied());
        let values = vec![PixelValue::UNKNOWN; columns.len() * rows.len()];
        Self { width, relative: relative.collect(), columns, rows, values }
    }

    pub(crate) fn rows(&self) -> Range<usize> {
        self.rows.clone()
    }

    pub(crate) fn columns(&self) -> Range<usize> {
        self.columns.clone()
    }

    fn place(&self, p: usize) -> Option<usize> {
        let (x, y) = (p % self.width, p / self.width);
        (self.columns.contains(&x) && self.rows.contains(&y))
            .then(|| (y - self.rows.start) * self.columns.len() + x - self.columns.start)
    }

    /// The value of a pixel; unknown outside.
    pub(crate) fn get(&self, p: usize) -> PixelValue {
        self.place(p).map_or(PixelValue::UNKNOWN, |k| self.values[k])
    }

    /// Puts a value; nothing happens outside.
    pub(crate) fn set(&mut self, p: usize, value: PixelValue) {
        if let Some(k) = self.place(p) {
            self.values[k] = value;
        }
    }

    /// f of a merged pixel of the rectangle, with its variances.
    pub(crate) fn value(&self, p: usize, per_rate: f32, m: &Merged) -> PixelValue {
        match self.place(p) {
            Some(k) => PixelValue::of(m, per_rate, self.relative[k]),
            None => PixelValue::UNKNOWN,
        }
    }
}
