//! A flake map: colours over what the flake sees, θ_inc across and θ_flake down, inside the coat.
//!
//! All geometries have a place here. Left below the line θ_inc + θ_flake = arcsin(1/n) an in-plane geometry shows the same flakes; between that
//! line and the outer curve, cos θ_inc cos θ_flake = √(1 − 1/n²), only geometries out of the plane do: the critical region of colour maps.

use gonio_brdf::Rgb;
use gonio_optics::{Angle, Vec3, flake::FlakeAngles};

use super::axis::{short, step_down};
use super::cells::quantile;
use super::legend::{self, Key, hatch};
use super::unfolded::title;
use crate::draw::canvas::{Area, At, Canvas};
use crate::draw::palette::{INK, MUTED};
use crate::draw::{Anchor, Text};
use crate::picture::Picture;
use crate::sphere::Tone;

const SIDE: f64 = 420.0;

/// What a flake map shows.
pub struct FlakeMapPlot<'a> {
    /// Above the picture; empty for none.
    pub title: String,
    /// f (1/sr) and whether data stood around; `None` for no value.
    pub colour: &'a dyn Fn(FlakeAngles) -> Option<(Rgb, bool)>,
    /// Refractive index of the coat.
    pub index: f64,
    /// Largest polar angle, outside, of the geometries that were fitted.
    pub largest: Angle,
    /// What the measurements saw, drawn as dots; empty for dense data.
    pub measured: &'a [FlakeAngles],
    /// Factor on R = πf; `None` for one that makes the body colour bright.
    pub factor: Option<f64>,
    /// A line under the picture.
    pub note: String,
}

/// Directions outside that see a flake under these angles, the difference of the refracted ones turned by `azimuth` about their half vector from the
/// meridian; `None` where one of them cannot leave the coat upwards.
#[must_use]
pub fn directions(flake: FlakeAngles, azimuth: Angle, index: f64) -> Option<(Vec3, Vec3)> {
    let half = Vec3::from_polar(flake.theta_flake, Angle::ZERO);
    let (across, along) =
        (Vec3::new(0.0, 1.0, 0.0), Vec3::new(flake.theta_flake.cos(), 0.0, -flake.theta_flake.sin()));
    let (s, c) = azimuth.sin_cos();
    let side = along * c + across * s;
    let (si, ci) = flake.theta_inc.sin_cos();
    let outside = |d: Vec3| {
        let (x, y) = (d.x * index, d.y * index);
        let z2 = 1.0 - x * x - y * y;
        (d.z > 0.0 && z2 >= -1e-12).then(|| Vec3::new(x, y, z2.max(0.0).sqrt()))
    };
    outside(half * ci + side * si).zip(outside(half * ci - side * si))
}

/// The largest angle inside the coat for an angle outside.
fn inside(outside: Angle, index: f64) -> f64 {
    (outside.sin() / index).clamp(0.0, 1.0).asin().to_degrees()
}

impl FlakeMapPlot<'_> {
    /// Draws it.
    #[must_use]
    pub fn draw(&self) -> Picture {
        let end = inside(Angle::RIGHT, self.index);
        let at_flake = |u: f64, v: f64| FlakeAngles {
            theta_inc: Angle::from_degrees(u * end),
            theta_flake: Angle::from_degrees(v * end),
        };
        let factor = self.factor.filter(|f| *f > 0.0 && f.is_finite()).unwrap_or_else(|| {
            let places = (0..1600).map(|k| at_flake(f64::from(k % 40) / 40.0, f64::from(k / 40) / 40.0));
            let values = places
                .filter(|a| a.theta_flake.degrees() > 5.0)
                .filter_map(|a| (self.colour)(a))
                .map(|(f, _)| f.into_iter().fold(0.0, f64::max) * std::f64::consts::PI);
            match quantile(values, 0.9) {
                Some(q) if q > 1e-9 => step_down(0.8 / q).max(1.0),
                _ => 1.0,
            }
        });
        let tone = Tone { exposure: factor, ..Tone::default() };
        let top = if self.title.is_empty() { 14.0 } else { 40.0 };
        let area = Area::new(74.0, top, SIDE, SIDE);
        let mut canvas = Canvas::new(area.right() + 40.0, area.bottom() + 124.0);
        title(&mut canvas, &self.title);
        canvas.paint(area, 2, |u, v| {
            let a = at_flake(u, v);
            if !possible(a, end) {
                return None;
            }
            let (x, y) = (u * area.w, v * area.h);
            match (self.colour)(a).filter(|f| f.0.iter().all(|x| x.is_finite())) {
                Some((f, covered)) => {
                    let shown = tone.display(f.map(|x| x * std::f64::consts::PI));
                    Some(if covered || (x + y).rem_euclid(6.0) >= 1.2 { shown } else { [255; 3] })
                }
                None => Some(hatch(x, y)),
            }
        });
        self.lines(&mut canvas, area, end);
        let mut entries = vec![
            (Key::Line(INK), "critical angle: in-plane geometries end here".to_owned()),
            (Key::Dashed(INK), format!("light and view at {}° and less", short(self.largest.degrees()))),
        ];
        if (0..400).any(|k| {
            (self.colour)(at_flake(f64::from(k % 20) / 20.0, f64::from(k / 20) / 20.0)).is_some_and(|c| !c.1)
        }) {
            entries.push((Key::Hatched, "striped: continued, nothing measured near".to_owned()));
        }
        if !self.measured.is_empty() {
            entries.push((Key::Dot(INK), "measured".to_owned()));
        }
        let white = if factor == 1.0 {
            "white: R = πf = 1".to_owned()
        } else {
            format!("brightened × {}", short(factor))
        };
        entries.push((Key::Patch([255; 3]), white));
        let used = legend::draw(&mut canvas, (area.x, area.bottom() + 54.0), area.w, &entries);
        let small = Text::new(9.5, MUTED).at(Anchor::Start, Anchor::Middle);
        canvas.text_within((area.x, area.bottom() + 56.0 + used), &self.note, &small, area.w);
        canvas.finish()
    }

    fn lines(&self, canvas: &mut Canvas, area: Area, end: f64) {
        let at =
            |inc: f64, flake: f64| -> At { (area.x + inc / end * area.w, area.y + flake / end * area.h) };
        let curve = |limit: f64| -> Vec<At> {
            let steepest = limit.to_radians().cos();
            (0..=120)
                .filter_map(|k| {
                    let inc = limit * f64::from(k) / 120.0;
                    let c = steepest / inc.to_radians().cos();
                    (c <= 1.0).then(|| at(inc, c.acos().to_degrees()))
                })
                .collect()
        };
        canvas.polyline(&curve(end), 0.8, INK);
        let fitted = curve(inside(self.largest, self.index));
        canvas.dashed(&fitted, 2.4, 4.0, 2.5, [255; 3]);
        canvas.dashed(&fitted, 1.1, 4.0, 2.5, INK);
        let straight = [at(0.0, end), at(end, 0.0)];
        canvas.polyline(&straight, 2.8, [255; 3]);
        canvas.polyline(&straight, 1.3, INK);
        for f in self.measured {
            let p = at(f.theta_inc.degrees(), f.theta_flake.degrees());
            canvas.disc(p, 2.6, [255; 3], 1.0);
            canvas.disc(p, 1.8, INK, 1.0);
        }
        canvas.outline(area, 0.8, INK);
        let small = Text::new(9.5, INK);
        let step = if end > 60.0 { 15.0 } else { 5.0 };
        let mut deg = 0.0;
        while deg <= end + 1e-9 {
            let label = format!("{deg:.0}°");
            let (x, y) = at(deg, deg);
            canvas.line((x, area.bottom()), (x, area.bottom() + 4.0), 0.7, INK);
            canvas.text((x, area.bottom() + 8.0), &label, &small.at(Anchor::Middle, Anchor::Start));
            canvas.line((area.x - 4.0, y), (area.x, y), 0.7, INK);
            canvas.text((area.x - 7.0, y), &label, &small.at(Anchor::End, Anchor::Middle));
            deg += step;
        }
        let name = Text::new(10.5, INK);
        let words = "angle of incidence on the flake, inside the coat   θ_inc";
        canvas.text((area.centre().0, area.bottom() + 24.0), words, &name.at(Anchor::Middle, Anchor::Start));
        let upright = name.upwards().at(Anchor::Middle, Anchor::Middle);
        canvas.text((20.0, area.centre().1), "tilt of the flake   θ_flake   (0: mirror direction)", &upright);
    }
}

/// Whether any pair of directions outside sees such a flake; `end` is the steepest angle inside, degrees.
fn possible(a: FlakeAngles, end: f64) -> bool {
    a.theta_inc.cos() * a.theta_flake.cos() >= end.to_radians().cos() - 1e-12
}

#[cfg(test)]
mod tests {
    use super::*;
    use gonio_optics::flake::flake_angles;

    #[test]
    fn directions_see_the_flake_they_were_made_for() {
        for (inc, flake, azimuth) in
            [(10.0, 20.0, 0.0), (30.0, 25.0, 90.0), (5.0, 35.0, 60.0), (0.0, 0.0, 10.0)]
        {
            let want =
                FlakeAngles { theta_inc: Angle::from_degrees(inc), theta_flake: Angle::from_degrees(flake) };
            let (l, v) = directions(want, Angle::from_degrees(azimuth), 1.5).unwrap();
            let is = flake_angles(l, v, 1.5);
            assert!((is.theta_inc - want.theta_inc).abs().degrees() < 1e-6, "{is:?}");
            assert!((is.theta_flake - want.theta_flake).abs().degrees() < 1e-6, "{is:?}");
            assert!((l.norm() - 1.0).abs() < 1e-12 && (v.norm() - 1.0).abs() < 1e-12);
        }
        // beyond the critical angle there is no in-plane pair, but one across the meridian
        let beyond =
            FlakeAngles { theta_inc: Angle::from_degrees(28.0), theta_flake: Angle::from_degrees(28.0) };
        assert!(directions(beyond, Angle::ZERO, 1.5).is_none());
        assert!(directions(beyond, Angle::RIGHT, 1.5).is_some());
        assert!(possible(beyond, inside(Angle::RIGHT, 1.5)));
    }

    #[test]
    fn impossible_places_stay_white_and_others_have_their_colour() {
        let plot = FlakeMapPlot {
            title: String::new(),
            colour: &|_| Some(([0.0, 0.1, 0.0], true)),
            index: 1.5,
            largest: Angle::from_degrees(75.0),
            measured: &[],
            factor: Some(1.0),
            note: String::new(),
        };
        let p = plot.draw();
        let at = |u: f64, v: f64| {
            p.get((2.0 * (74.0 + u * SIDE)) as u32, (2.0 * (14.0 + v * SIDE)) as u32).unwrap()
        };
        assert_eq!(at(0.95, 0.95), [255; 3]);
        assert!(at(0.3, 0.3)[1] > 100 && at(0.3, 0.3)[0] == 0);
    }
}
