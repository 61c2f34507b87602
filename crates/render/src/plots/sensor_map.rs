//! A number for each pixel of a sensor, as a picture: the dark current, a flat field.

use super::axis::Scale;
use super::cells::quantile;
use super::colorbar::ColourBar;
use super::unfolded::title;
use crate::draw::canvas::{Area, Canvas};
use crate::draw::palette::{ColourMap, INK};
use crate::picture::Picture;

/// The map.
#[derive(Clone, Debug, PartialEq)]
pub struct SensorMap {
    /// Above the picture; empty for none.
    pub title: String,
    /// What the colours mean, with the unit.
    pub label: String,
    /// Columns and rows.
    pub size: [u32; 2],
    /// Row by row; what is not finite stays white.
    pub values: Vec<f32>,
    /// Pixels to ring, by their place row by row.
    pub marked: Vec<u32>,
}

impl SensorMap {
    /// Draws it; colours run from the 1st to the 99th percentile.
    #[must_use]
    pub fn draw(&self) -> Picture {
        let top = if self.title.is_empty() { 8.0 } else { 32.0 };
        let [columns, rows] = self.size.map(|n| n.max(1));
        let wide = 640.0;
        let high = (wide * f64::from(rows) / f64::from(columns)).clamp(80.0, 1200.0);
        let mut canvas = Canvas::new(wide + 40.0, top + high + 70.0);
        title(&mut canvas, &self.title);
        let finite = || self.values.iter().map(|v| f64::from(*v)).filter(|v| v.is_finite());
        let (low, high_value) =
            (quantile(finite(), 0.01).unwrap_or(0.0), quantile(finite(), 0.99).unwrap_or(1.0));
        let bar = ColourBar {
            map: ColourMap::Viridis,
            scale: Scale::linear(low, if high_value > low { high_value } else { low + 1.0 }),
            label: self.label.clone(),
            beyond: [finite().any(|v| v < low), finite().any(|v| v > high_value)],
        };
        let area = Area::new(20.0, top, wide, high);
        canvas.paint(area, 1, |u, v| {
            let x = ((u * f64::from(columns)) as usize).min(columns as usize - 1);
            let y = ((v * f64::from(rows)) as usize).min(rows as usize - 1);
            let value = f64::from(*self.values.get(y * columns as usize + x)?);
            value.is_finite().then(|| bar.colour(value))
        });
        canvas.outline(area, 0.8, INK);
        for &p in &self.marked {
            let at = (
                area.x + (f64::from(p % columns) + 0.5) / f64::from(columns) * area.w,
                area.y + (f64::from(p / columns) + 0.5) / f64::from(rows) * area.h,
            );
            canvas.ring(at, 4.0, 1.2, INK);
        }
        bar.draw_lying(&mut canvas, Area::new(60.0, area.bottom() + 14.0, wide - 80.0, 10.0));
        canvas.finish()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_leave_colour_and_what_is_not_a_number_does_not() {
        let map = |v: f32| SensorMap {
            title: String::new(),
            label: "e/s".into(),
            size: [8, 4],
            values: vec![v; 32],
            marked: vec![],
        };
        let white = |p: &Picture| p.pixels().iter().filter(|c| **c == [255; 3]).count();
        assert!(white(&map(f32::NAN).draw()) > white(&map(1.0).draw()) + 10_000);
    }
}
