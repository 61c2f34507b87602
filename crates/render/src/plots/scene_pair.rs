//! Pictures of a scene side by side, and where an eye would tell the first two apart.

use super::axis::{Scale, step_up};
use super::cells::quantile;
use super::colorbar::ColourBar;
use super::unfolded::title;
use crate::draw::canvas::{Area, Canvas, PIXELS_PER_POINT};
use crate::draw::palette::{ColourMap, INK, MUTED};
use crate::draw::{Anchor, Text};
use crate::picture::Picture;
use crate::sphere::{LinearImage, Tone};

/// A row of pictures with captions, a difference at its end where there is one.
#[derive(Clone, Debug, PartialEq)]
pub struct SceneRow<'a> {
    /// Above the picture; empty for none.
    pub title: String,
    /// Caption, picture, and what is hatched over it (share of each pixel, 0…1; empty for nothing).
    pub pictures: Vec<(String, &'a LinearImage, Vec<f64>)>,
    /// Radiance that is shown as white.
    pub white: f64,
    /// ΔE of each pixel between the first two; empty for no such picture.
    pub differences: &'a [Option<f64>],
    /// Under the pictures.
    pub note: String,
}

const GAP: f64 = 12.0;
/// Pixels that the longer side of a picture has at least, if whole numbers allow it.
const SMALLEST: u32 = 400;

fn enlarged(picture: &Picture, times: u32) -> Picture {
    if times == 1 {
        return picture.clone();
    }
    let (w, h) = (picture.width() * times, picture.height() * times);
    Picture::from_fn(w, h, |x, y| picture.get(x / times, y / times).unwrap_or([255; 3]))
}

impl SceneRow<'_> {
    /// Draws it.
    #[must_use]
    pub fn draw(&self) -> Picture {
        let (w, h) = self.pictures.first().map_or((1, 1), |p| (p.1.width, p.1.height));
        // small pictures are enlarged, a whole number of times, so that captions have room
        let times = (SMALLEST / w.max(h).max(1)).max(1);
        let (pw, ph) = (f64::from(w * times) / PIXELS_PER_POINT, f64::from(h * times) / PIXELS_PER_POINT);
        let columns = self.pictures.len() + usize::from(!self.differences.is_empty());
        let top = if self.title.is_empty() { 26.0 } else { 50.0 };
        let bar_room: f64 = if self.differences.is_empty() { 0.0 } else { 40.0 };
        let mut canvas = Canvas::new(
            GAP + columns as f64 * (pw + GAP),
            top + ph + bar_room.max(8.0) + if self.note.is_empty() { 0.0 } else { 20.0 },
        );
        title(&mut canvas, &self.title);
        let tone = Tone { exposure: 1.0 / self.white, ..Tone::default() };
        let heading = Text::new(11.0, INK).bold().at(Anchor::Middle, Anchor::End);
        for (k, (caption, image, marked)) in self.pictures.iter().enumerate() {
            let x = GAP + k as f64 * (pw + GAP);
            canvas.text_within((x + 0.5 * pw, top - 8.0), caption, &heading, pw);
            let mut shown = image.to_picture(&tone);
            for (i, share) in marked.iter().enumerate() {
                let (px, py) = (i as u32 % w.max(1), i as u32 / w.max(1));
                // slanted lines, two pixels in eight
                if *share > 0.5 && (px + py) % 8 < 2 {
                    shown.set(px, py, [255, 0, 160]);
                }
            }
            canvas.place((x, top), &enlarged(&shown, times));
        }
        if !self.differences.is_empty() {
            let x = GAP + self.pictures.len() as f64 * (pw + GAP);
            let known = || self.differences.iter().flatten().copied();
            let full = step_up(quantile(known(), 0.98).unwrap_or(1.0).clamp(0.5, 50.0));
            let bar = ColourBar {
                map: ColourMap::Viridis,
                scale: Scale::linear(0.0, full),
                label: "ΔE₀₀".into(),
                beyond: [false, known().any(|d| d > full)],
            };
            canvas.text_within((x + 0.5 * pw, top - 8.0), "difference (CIEDE2000)", &heading, pw);
            let map = Picture::from_fn(w, h, |px, py| {
                let i = py as usize * w as usize + px as usize;
                self.differences.get(i).copied().flatten().map_or([255; 3], |d| bar.colour(d))
            });
            canvas.place((x, top), &enlarged(&map, times));
            bar.draw_lying(&mut canvas, Area::new(x + 6.0, top + ph + 8.0, pw - 12.0, 9.0));
        }
        if !self.note.is_empty() {
            let y = top + ph + bar_room.max(8.0);
            canvas.text((GAP, y), &self.note, &Text::new(9.5, MUTED).at(Anchor::Start, Anchor::Start));
        }
        canvas.finish()
    }
}
