//! Kirchner's colour map (his Fig. 2): the colours of all in-plane geometries, and the region of geometries that have none.
//!
//! Across runs c = cos θ'ill, where it is positive; beyond the critical angle the map goes on to c = 1 − n sin θ1' < 0, the coordinate in which fix B
//! walks. Down runs ±(1 − cos θ'det): the half with φ' = 180° (mirror side) above, that with φ' = 0° (light's side) below, so that the halves
//! meet at θ'det = 0 and the gloss line θ'ill = θ'det is the diagonal of the upper half. Angles are labelled in degrees.

use gonio_brdf::Rgb;
use gonio_optics::{Angle, Geometry, flake::FlakeAngles};

use super::axis::{short, step_down};
use super::cells::quantile;
use super::legend::{self, Key, hatch};
use super::unfolded::title;
use crate::draw::canvas::{Area, At, Canvas};
use crate::draw::palette::{FAINT, INK, MUTED};
use crate::draw::{Anchor, Text};
use crate::picture::{Picture, Srgb};
use crate::sphere::Tone;

/// Points for a unit of either cosine.
const UNIT: f64 = 250.0;
/// Where angles are labelled, degrees.
const LABELS: [f64; 9] = [0.0, 20.0, 30.0, 40.0, 50.0, 60.0, 70.0, 80.0, 90.0];
/// Stripes over colours that no in-plane geometry shows.
const STRIPES: Srgb = [0xff, 0xff, 0xff];

/// What a colour map shows.
pub struct ColourMapPlot<'a> {
    /// Above the picture; empty for none.
    pub title: String,
    /// f (1/sr) of in-plane geometries, φ 180° or 0°; `None` where it is not known: hatched.
    pub in_plane: &'a dyn Fn(Geometry) -> Option<Rgb>,
    /// f (1/sr) beyond the critical angle, by what the flake sees; without it the region is striped only.
    pub beyond: Option<&'a dyn Fn(FlakeAngles) -> Option<Rgb>>,
    /// Refractive index of the coat.
    pub index: f64,
    /// Half angle of the cone about the mirror direction whose values are not measured as they stand; drawn dashed beside the gloss line.
    pub cone: Option<Angle>,
    /// In-plane geometries that were measured, drawn as dots; empty for dense data.
    pub measured: &'a [Geometry],
    /// Factor on R = πf; `None` for one that makes the body colour bright.
    pub factor: Option<f64>,
    /// A line under the picture.
    pub note: String,
}

/// A place of the map.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Place {
    /// An in-plane geometry.
    InPlane(Geometry),
    /// Beyond the critical angle, and what the flake sees there.
    Beyond(FlakeAngles),
    /// No geometry is there.
    Nowhere,
}

/// The place at c (across) and w = ±(1 − cos θ'det), + above.
fn place(c: f64, w: f64, index: f64) -> Place {
    let theta_det = Angle::from_radians((1.0 - w.abs()).clamp(0.0, 1.0).acos());
    let phi = if w >= 0.0 { Angle::STRAIGHT } else { Angle::ZERO };
    if c >= 0.0 {
        return Place::InPlane(Geometry {
            theta_i: Angle::from_radians(c.min(1.0).acos()),
            theta_o: theta_det,
            phi,
        });
    }
    let sine = (1.0 - c) / index;
    if sine >= 1.0 {
        return Place::Nowhere;
    }
    let (first, second) = (sine.asin(), (theta_det.sin() / index).asin().copysign(w));
    let (inc, flake) = (0.5 * (first + second), 0.5 * (first - second));
    // both directions of a pair that stands symmetrically about the flake's meridian are steepest at cos θ_inc cos θ_flake
    let steepest = (1.0 - 1.0 / (index * index)).max(0.0).sqrt();
    if inc < 0.0 || flake < 0.0 || inc.cos() * flake.cos() < steepest {
        return Place::Nowhere;
    }
    Place::Beyond(FlakeAngles {
        theta_inc: Angle::from_radians(inc),
        theta_flake: Angle::from_radians(flake),
    })
}

/// How far the map goes beyond the critical angle: 1 − n sin(2 θ), where cos² θ is the cosine of the steepest direction inside.
fn left_end(index: f64) -> f64 {
    let steepest = (1.0 - 1.0 / (index * index)).max(0.0).sqrt();
    let half = steepest.sqrt().acos();
    (1.0 - index * (2.0 * half).sin()).min(0.0)
}

impl ColourMapPlot<'_> {
    fn brightening(&self) -> f64 {
        let mut values = Vec::new();
        for i in 0..30 {
            for o in 0..30 {
                for phi in [0.0, 180.0] {
                    let g = Geometry::from_degrees(2.5 * f64::from(i), 2.5 * f64::from(o), phi);
                    if g.from_mirror().degrees() > 15.0
                        && let Some(f) = (self.in_plane)(g)
                    {
                        values.push(f.into_iter().fold(0.0, f64::max) * std::f64::consts::PI);
                    }
                }
            }
        }
        match quantile(values.into_iter(), 0.9) {
            Some(q) if q > 1e-9 => step_down(0.8 / q).max(1.0),
            _ => 1.0,
        }
    }

    /// Draws it.
    #[must_use]
    pub fn draw(&self) -> Picture {
        let left = left_end(self.index);
        let factor = self.factor.filter(|f| *f > 0.0 && f.is_finite()).unwrap_or_else(|| self.brightening());
        let tone = Tone { exposure: factor, ..Tone::default() };
        let top = if self.title.is_empty() { 10.0 } else { 40.0 };
        let area = Area::new(78.0, top, UNIT * (1.0 - left), 2.0 * UNIT);
        let mut canvas = Canvas::new(area.right() + 96.0, area.bottom() + 132.0);
        title(&mut canvas, &self.title);
        let shown = |f: Option<Rgb>| {
            f.filter(|f| f.iter().all(|x| x.is_finite()))
                .map(|f| tone.display(f.map(|x| x * std::f64::consts::PI)))
        };
        canvas.paint(area, 2, |u, v| {
            let (x, y) = (u * area.w, v * area.h);
            match place(left + u * (1.0 - left), 1.0 - 2.0 * v, self.index) {
                Place::InPlane(g) => Some(shown((self.in_plane)(g)).unwrap_or_else(|| hatch(x, y))),
                Place::Beyond(flake) => {
                    let stripe = (x - y).rem_euclid(7.0) < 1.4;
                    let colour = self.beyond.and_then(|b| shown(b(flake)));
                    Some(match (colour, stripe) {
                        (Some(c), false) => c,
                        (Some(_), true) => STRIPES,
                        (None, s) => {
                            if s {
                                MUTED
                            } else {
                                FAINT
                            }
                        }
                    })
                }
                Place::Nowhere => None,
            }
        });
        self.lines(&mut canvas, area, left);
        axes(&mut canvas, area, left);
        self.keys(&mut canvas, area, left, factor);
        canvas.finish()
    }

    fn lines(&self, canvas: &mut Canvas, area: Area, left: f64) {
        let at = |c: f64, w: f64| -> At {
            (area.x + (c - left) / (1.0 - left) * area.w, area.y + 0.5 * (1.0 - w) * area.h)
        };
        let white = |canvas: &mut Canvas, p: &[At], dashed: bool| {
            if dashed {
                canvas.dashed(p, 2.2, 4.0, 2.5, [255; 3]);
                canvas.dashed(p, 1.0, 4.0, 2.5, INK);
            } else {
                canvas.polyline(p, 2.6, [255; 3]);
                canvas.polyline(p, 1.2, INK);
            }
        };
        // the halves, and the end of what is in the plane
        canvas.line(at(left, 0.0), at(1.0, 0.0), 0.8, MUTED);
        if left < -1e-6 {
            white(canvas, &[at(0.0, -1.0), at(0.0, 1.0)], false);
        }
        white(canvas, &[at(1.0, 0.0), at(0.0, 1.0)], false);
        if let Some(cone) = self.cone.filter(|c| *c > Angle::ZERO) {
            for sign in [-1.0, 1.0] {
                let edge: Vec<At> = (0..=90)
                    .filter_map(|k| {
                        let ill = Angle::from_degrees(f64::from(k));
                        let det = ill + cone * sign;
                        (det.degrees() <= 90.0)
                            .then(|| at(ill.cos(), (1.0 - det.cos()).copysign(det.radians())))
                    })
                    .collect();
                white(canvas, &edge, true);
            }
        }
        for g in self.measured {
            let w = (1.0 - g.theta_o.cos()).copysign(if g.phi > Angle::RIGHT { 1.0 } else { -1.0 });
            let p = at(g.theta_i.cos(), w);
            canvas.disc(p, 2.6, [255; 3], 1.0);
            canvas.disc(p, 1.8, INK, 1.0);
        }
    }

    fn keys(&self, canvas: &mut Canvas, area: Area, left: f64, factor: f64) {
        let mut entries = vec![(Key::Line(INK), "gloss line (θ'ill = θ'det)".to_owned())];
        if let Some(cone) = self.cone.filter(|c| *c > Angle::ZERO) {
            entries.push((Key::Dashed(INK), format!("gloss taken off within {}°", short(cone.degrees()))));
        }
        if left < -1e-6 {
            let words = if self.beyond.is_some() {
                "striped: critical region, colours of the flake map"
            } else {
                "critical region: no in-plane geometry"
            };
            entries
                .push((Key::Patch(if self.beyond.is_some() { [0xc8; 3] } else { FAINT }), words.to_owned()));
        }
        if !self.measured.is_empty() {
            entries.push((Key::Dot(INK), "measured".to_owned()));
        }
        let known = (0..90).all(|k| {
            let g = |phi: f64| Geometry::from_degrees(f64::from(k), 90.0 - f64::from(k), phi);
            (self.in_plane)(g(0.0)).is_some() && (self.in_plane)(g(180.0)).is_some()
        });
        if !known || (self.in_plane)(Geometry::from_degrees(89.9, 89.9, 0.0)).is_none() {
            entries.push((Key::Hatched, "not measured".to_owned()));
        }
        let white = if factor == 1.0 {
            "white: R = πf = 1".to_owned()
        } else {
            format!("brightened × {}", short(factor))
        };
        entries.push((Key::Patch([255; 3]), white));
        let used = legend::draw(canvas, (area.x, area.bottom() + 54.0), area.w + 80.0, &entries);
        let small = Text::new(9.5, MUTED).at(Anchor::Start, Anchor::Middle);
        canvas.text_within((area.x, area.bottom() + 56.0 + used), &self.note, &small, area.w + 80.0);
    }
}

fn axes(canvas: &mut Canvas, area: Area, left: f64) {
    let small = Text::new(9.5, INK);
    canvas.outline(area, 0.8, INK);
    for deg in LABELS {
        let cos = Angle::from_degrees(deg).cos();
        let label = format!("{deg:.0}°");
        let x = area.x + (cos - left) / (1.0 - left) * area.w;
        canvas.line((x, area.bottom()), (x, area.bottom() + 4.0), 0.7, INK);
        // near the normal cosines lie close: 20° has no room between its neighbours
        if deg != 20.0 {
            canvas.text((x, area.bottom() + 8.0), &label, &small.at(Anchor::Middle, Anchor::Start));
        }
        for sign in [-1.0, 1.0] {
            if sign < 0.0 && deg == 0.0 {
                continue;
            }
            let y = area.y + 0.5 * (1.0 - sign * (1.0 - cos)) * area.h;
            canvas.line((area.x - 4.0, y), (area.x, y), 0.7, INK);
            canvas.text((area.x - 7.0, y), &label, &small.at(Anchor::End, Anchor::Middle));
        }
    }
    let name = Text::new(10.5, INK);
    let across = (area.x + (0.5 - left) / (1.0 - left) * area.w, area.bottom() + 24.0);
    canvas.text(across, "θ'ill   (across: cos θ'ill)", &name.at(Anchor::Middle, Anchor::Start));
    if left < -1e-6 {
        let (x, w) = (area.x, -left / (1.0 - left) * area.w);
        canvas.text((x + 0.5 * w, area.bottom() + 24.0), "critical", &name.at(Anchor::Middle, Anchor::Start));
    }
    let upright = name.upwards().at(Anchor::Middle, Anchor::Middle);
    canvas.text((22.0, area.centre().1), "θ'det   (down: cos θ'det)", &upright);
    let side = name.at(Anchor::Start, Anchor::Middle);
    for (y, angle, words) in [(0.25, "φ' = 180°", "mirror side"), (0.75, "φ' = 0°", "light's side")] {
        let y = area.y + y * area.h;
        canvas.text((area.right() + 10.0, y - 7.0), angle, &side);
        canvas.text((area.right() + 10.0, y + 7.0), words, &Text { size: 9.5, colour: MUTED, ..side });
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use gonio_optics::colour;
    use gonio_optics::isoline::{Method, isoline};

    #[test]
    fn every_geometry_has_its_place_and_sees_the_same_flake_there() {
        let mut beyond = 0;
        for (ti, to, phi) in [
            (75.0, 75.0, 110.0),
            (80.0, 60.0, 90.0),
            (60.0, 70.0, 120.0),
            (30.0, 40.0, 20.0),
            (85.0, 85.0, 60.0),
        ] {
            let (l, v) = Geometry::from_degrees(ti, to, phi).directions();
            let line = isoline(l, v, 1.5, Method::Clip);
            let x = 1.5 * (line.flake.theta_inc + line.flake.theta_flake).sin();
            let w = (1.0 - line.theta_det.cos()).copysign(-line.phi_det.cos());
            if line.limited {
                beyond += 1;
                let Place::Beyond(f) = place(1.0 - x, w, 1.5) else { panic!("{ti} {to} {phi} is nowhere") };
                assert!((f.theta_inc - line.flake.theta_inc).abs().degrees() < 1e-9);
                assert!((f.theta_flake - line.flake.theta_flake).abs().degrees() < 1e-9);
                assert!(1.0 - x >= left_end(1.5));
            } else {
                let Place::InPlane(g) = place(line.theta_ill.cos(), w, 1.5) else {
                    panic!("not in the plane")
                };
                assert!((g.theta_o - line.theta_det).abs().degrees() < 1e-5 && g.phi == line.phi_det);
            }
        }
        assert!(beyond >= 3);
        assert_eq!(left_end(1.0), 0.0);
    }

    #[test]
    fn what_is_not_measured_is_hatched_and_the_measured_has_its_colour() {
        let red = |g: Geometry| {
            (g.theta_i.degrees() <= 75.0 && g.theta_o.degrees() <= 75.0).then_some([0.2, 0.0, 0.0])
        };
        let plot = ColourMapPlot {
            title: String::new(),
            in_plane: &red,
            beyond: None,
            index: 1.5,
            cone: None,
            measured: &[],
            factor: Some(1.0),
            note: String::new(),
        };
        let p = plot.draw();
        let left = left_end(1.5);
        let at = |c: f64, w: f64| {
            let x = 78.0 + (c - left) / (1.0 - left) * UNIT * (1.0 - left);
            let y = 10.0 + 0.5 * (1.0 - w) * 2.0 * UNIT;
            p.get((2.0 * x) as u32, (2.0 * y) as u32).unwrap()
        };
        let want = (colour::srgb_encode(0.2 * std::f64::consts::PI) * 255.0).round() as u8;
        assert_eq!(at(0.8, 0.4), [want, 0, 0]);
        assert_eq!(at(0.8, -0.4), [want, 0, 0]);
        let grey = at(0.1, 0.31);
        assert!(grey[0] == grey[1] || grey[0].abs_diff(grey[2]) < 20, "{grey:?}");
        assert_ne!(grey, [want, 0, 0]);
    }
}
