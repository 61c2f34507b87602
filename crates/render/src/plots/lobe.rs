//! The lobe in the plane of incidence: f against the signed viewing angle for several angles of incidence, points against curves.
//!
//! θo is positive on the mirror side (φ = 180°) and negative on the light's own side (φ = 0°). Error bars are one standard
//! uncertainty. A fitted curve is averaged over the same bins and the same lamp as the cells it is compared with.

use gonio_brdf::{Brdf, Flag, Grid, Measured, Rgb, average};
use gonio_optics::colour;

use super::axis::{Scale, short};
use super::cells::{nearest, value};
use super::legend::{self, Key};
use super::unfolded::title;
use crate::draw::canvas::{Area, At, Canvas};
use crate::draw::clip::clipped;
use crate::draw::palette::{CATEGORIES, FAINT, INK, MUTED};
use crate::draw::{Anchor, Text};
use crate::picture::{Picture, Srgb};

/// Which number of an RGB value is plotted.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Channel {
    /// Luminance Y; its σ adds the channels as if fully correlated.
    #[default]
    Luminance,
    /// The red channel.
    Red,
    /// The green channel.
    Green,
    /// The blue channel.
    Blue,
}

impl Channel {
    fn of(self, v: Rgb) -> f64 {
        match self {
            Self::Luminance => colour::luminance(v),
            Self::Red => v[0],
            Self::Green => v[1],
            Self::Blue => v[2],
        }
    }

    const fn name(self) -> &'static str {
        match self {
            Self::Luminance => "luminance",
            Self::Red => "red",
            Self::Green => "green",
            Self::Blue => "blue",
        }
    }
}

/// A model drawn through the points: the first solid, further ones dashed.
#[derive(Clone, Copy)]
pub struct Curve<'a> {
    /// Word in the legend.
    pub label: &'a str,
    /// The model.
    pub brdf: &'a dyn Brdf,
}

/// Options of [`lobe`].
#[derive(Clone, Debug, PartialEq)]
pub struct Lobe {
    /// Above the picture; empty for none.
    pub title: String,
    /// Angles of incidence in degrees, the nearest nodes are taken; empty for five spread over the table. At most seven are drawn.
    pub theta_i_deg: Vec<f64>,
    /// What is plotted.
    pub channel: Channel,
    /// Beyond this viewing angle values are extrapolated: shaded.
    pub limit_deg: f64,
}

impl Default for Lobe {
    fn default() -> Self {
        Self { title: String::new(), theta_i_deg: Vec::new(), channel: Channel::Luminance, limit_deg: 75.0 }
    }
}

struct Point {
    x: f64,
    y: f64,
    sigma: f64,
    flag: Flag,
}

struct Series {
    theta_i: f64,
    colour: Srgb,
    points: Vec<Point>,
    curves: Vec<Vec<(f64, f64)>>,
}

/// Draws points and curves. The axis is logarithmic where the values span more than a factor of thirty.
#[must_use]
pub fn lobe(m: &Measured, curves: &[Curve<'_>], options: &Lobe) -> Picture {
    let series: Vec<Series> = chosen(&m.grid, &options.theta_i_deg)
        .into_iter()
        .zip(CATEGORIES)
        .map(|(ti, colour)| Series {
            theta_i: m.grid.theta_i_deg.get(ti).copied().unwrap_or(0.0),
            colour,
            points: points(m, ti, options.channel),
            curves: curves.iter().map(|c| trace(m, ti, c.brdf, options.channel)).collect(),
        })
        .collect();
    let top = if options.title.is_empty() { 6.0 } else { 30.0 };
    let mut canvas = Canvas::new(760.0, top + 470.0);
    title(&mut canvas, &options.title);
    let area = Area::new(74.0, top + 10.0, 670.0, 370.0);
    let (x, y) = (Scale::linear(-90.0, 90.0), range(&series));
    frame(&mut canvas, area, y, options);
    let at = |px: f64, py: f64| (area.x + x.fraction(px) * area.w, area.bottom() - y.fraction(py) * area.h);
    for s in &series {
        for (k, curve) in s.curves.iter().enumerate() {
            let path: Vec<At> = curve.iter().map(|&(px, py)| at(px, py)).collect();
            for run in clipped(&path, area) {
                if k == 0 {
                    canvas.polyline(&run, 1.5, s.colour);
                } else {
                    canvas.dashed(&run, 1.2, 4.0, 2.5 + k as f64, s.colour);
                }
            }
        }
        for p in &s.points {
            mark(&mut canvas, area, p, s.colour, at);
        }
        let (mx, _) = at(s.theta_i, 1.0);
        canvas.polygon(
            &[(mx - 4.0, area.y - 8.0), (mx + 4.0, area.y - 8.0), (mx, area.y - 1.0)],
            s.colour,
            1.0,
        );
    }
    keys(&mut canvas, area, &series, curves);
    canvas.finish()
}

/// Places of the nearest nodes in the table, ascending, each once.
fn chosen(grid: &Grid, wanted: &[f64]) -> Vec<usize> {
    let wanted = if wanted.is_empty() { &[10.0, 25.0, 40.0, 55.0, 70.0] } else { wanted };
    let mut places: Vec<usize> = wanted.iter().filter_map(|&w| nearest(&grid.theta_i_deg, w)).collect();
    places.sort_unstable();
    places.dedup();
    places
}

/// The two azimuths of the plane of incidence with the sign of θo on their side: the nearest nodes, none when they are more than 10° off.
fn sides(grid: &Grid) -> Vec<(f64, usize)> {
    let side = |sign: f64, phi: f64| {
        let k = nearest(&grid.phi_deg, phi)?;
        (grid.phi_deg.get(k)? - phi).abs().le(&10.0).then_some((sign, k))
    };
    [side(-1.0, 0.0), side(1.0, 180.0)].into_iter().flatten().collect()
}

fn points(m: &Measured, ti: usize, channel: Channel) -> Vec<Point> {
    let mut out = Vec::new();
    for (sign, phi) in sides(&m.grid) {
        for (to, theta_o) in m.grid.theta_o_deg.iter().enumerate() {
            let i = m.grid.index(ti, to, phi);
            if *theta_o == 0.0 && sign < 0.0 {
                continue;
            }
            if let (Some(v), Some(s), Some(flag)) = (value(m, i), m.sigma.get(i), m.flag.get(i)) {
                let sigma = channel.of(s.map(f64::from));
                let sigma = if sigma.is_finite() { sigma.abs() } else { 0.0 };
                out.push(Point { x: sign * theta_o, y: channel.of(v), sigma, flag: *flag });
            }
        }
    }
    out
}

/// The model along the plane of incidence every half degree, each value averaged over a bin of the size that the table has there.
fn trace(m: &Measured, ti: usize, brdf: &dyn Brdf, channel: Channel) -> Vec<(f64, f64)> {
    let nodes = &m.grid.theta_o_deg;
    let (Some(&theta_i), Some(&last)) = (m.grid.theta_i_deg.get(ti), nodes.last()) else { return Vec::new() };
    let mut out = Vec::new();
    for (sign, phi) in sides(&m.grid) {
        let (p, q) = m.grid.phi_bounds(phi);
        let (p, q) = (p.degrees(), q.degrees());
        let middle = m.grid.phi_deg.get(phi).copied().unwrap_or(0.0);
        let steps = (last * 2.0).floor().clamp(0.0, 180.0) as u32;
        let side = (0..=steps).filter_map(|k| {
            let theta_o = f64::from(k) * 0.5;
            let above = nodes.partition_point(|&n| n <= theta_o).clamp(1, nodes.len().max(2) - 1);
            let half = match (nodes.get(above - 1), nodes.get(above)) {
                (Some(a), Some(b)) => 0.5 * (b - a),
                _ => 0.0,
            };
            let (low, high) = ((theta_o - half).max(0.0), (theta_o + half).min(last));
            // the cell at θo = 0 is a cap of all azimuths; between it and the first whole bin nothing is averaged like a cell
            if theta_o > 0.0 && theta_o < half {
                return None;
            }
            let (p, q) = if theta_o == 0.0 && half > 0.0 { (0.0, 180.0) } else { (p, q) };
            // bounds lie halfway to the neighbours: choose neighbours that put them where they belong
            let cell = Grid {
                theta_i_deg: vec![theta_i],
                theta_o_deg: vec![2.0 * low - theta_o, theta_o, 2.0 * high - theta_o],
                phi_deg: vec![2.0 * p - middle, middle, 2.0 * q - middle],
            };
            Some((sign * theta_o, channel.of(average::cell_mean(brdf, &cell, m.meaning, [0, 1, 1], 4, 2))))
        });
        let side: Vec<_> = side.collect();
        if sign < 0.0 {
            out.extend(side.into_iter().rev());
        } else {
            out.extend(side);
        }
    }
    out
}

fn range(series: &[Series]) -> Scale {
    let measured = series.iter().flat_map(|s| s.points.iter()).filter(|p| p.flag != Flag::Extrapolated);
    let curves = series.iter().flat_map(|s| s.curves.iter().flatten()).filter(|c| c.0.abs() <= 75.0);
    let all: Vec<f64> = measured.map(|p| p.y).chain(curves.map(|c| c.1)).filter(|y| y.is_finite()).collect();
    let high = all.iter().copied().fold(0.0, f64::max);
    let low = all.iter().copied().filter(|y| *y > 0.0).fold(f64::INFINITY, f64::min);
    if high > 30.0 * low {
        Scale::log((low * 0.8).max(high * 1e-8), high * 1.2)
    } else {
        Scale::linear(0.0, if high > 0.0 { high * 1.08 } else { 1.0 })
    }
}

fn frame(canvas: &mut Canvas, area: Area, y: Scale, options: &Lobe) {
    let x = Scale::linear(-90.0, 90.0);
    let limit = options.limit_deg.clamp(0.0, 90.0);
    if limit < 90.0 {
        let wide = area.w * (90.0 - limit) / 180.0;
        for left in [area.x, area.right() - wide] {
            canvas.fill(Area::new(left, area.y, wide, area.h), [0xee, 0xf0, 0xf3], 1.0);
            let style = Text::new(8.0, MUTED).at(Anchor::Middle, Anchor::Start);
            canvas.text((left + 0.5 * wide, area.y + 6.0), &format!("> {}°", short(limit)), &style);
        }
    }
    let small = Text::new(10.0, INK);
    for k in -6..=6 {
        let deg = f64::from(k) * 15.0;
        let px = area.x + x.fraction(deg) * area.w;
        canvas.line((px, area.y), (px, area.bottom()), 0.5, if k == 0 { MUTED } else { FAINT });
        canvas.line((px, area.bottom()), (px, area.bottom() + 4.0), 0.7, INK);
        let label = super::axis::minus(&format!("{deg:.0}°"));
        canvas.text((px, area.bottom() + 8.0), &label, &small.at(Anchor::Middle, Anchor::Start));
    }
    for tick in y.ticks(8) {
        let f = y.fraction(tick.value);
        if !(-1e-9..=1.0 + 1e-9).contains(&f) {
            continue;
        }
        let py = area.bottom() - f * area.h;
        let length = if tick.label.is_some() { 4.0 } else { 2.0 };
        canvas.line((area.x - length, py), (area.x, py), 0.7, INK);
        if let Some(label) = &tick.label {
            canvas.line((area.x, py), (area.right(), py), 0.5, FAINT);
            canvas.text((area.x - 7.0, py), label, &small.at(Anchor::End, Anchor::Middle));
        }
    }
    canvas.outline(area, 0.8, INK);
    let name = Text::new(10.5, INK).at(Anchor::Middle, Anchor::Start);
    canvas.text(
        (area.centre().0, area.bottom() + 24.0),
        "viewing angle θₒ   (negative: the light's side, φ = 0°;  positive: the mirror side, φ = 180°)",
        &name,
    );
    let upright = Text::new(10.5, INK).upwards().at(Anchor::Middle, Anchor::Middle);
    canvas.text((20.0, area.centre().1), &format!("f, {}   (1/sr)", options.channel.name()), &upright);
}

fn mark(canvas: &mut Canvas, area: Area, p: &Point, colour: Srgb, at: impl Fn(f64, f64) -> At) {
    let here = at(p.x, p.y);
    if !inside(area, here) {
        return;
    }
    let bound = |q: At| if q.1.is_finite() { q.1.clamp(area.y, area.bottom()) } else { area.bottom() };
    let (high, low) = (bound(at(p.x, p.y + p.sigma)), bound(at(p.x, p.y - p.sigma)));
    if low - high > 4.0 {
        canvas.line((here.0, high), (here.0, low), 0.8, colour);
        for y in [high, low] {
            canvas.line((here.0 - 2.0, y), (here.0 + 2.0, y), 0.8, colour);
        }
    }
    match p.flag {
        Flag::Measured => {
            canvas.disc(here, 2.5, [255; 3], 1.0);
            canvas.disc(here, 1.9, colour, 1.0);
        }
        Flag::Filled => {
            canvas.disc(here, 2.0, [255; 3], 1.0);
            canvas.ring(here, 1.9, 0.9, colour);
        }
        Flag::Extrapolated => legend::cross(canvas, here, 1.8, colour),
        Flag::Invalid => {}
    }
}

fn keys(canvas: &mut Canvas, area: Area, series: &[Series], curves: &[Curve<'_>]) {
    let mut first: Vec<(Key, String)> =
        series.iter().map(|s| (Key::Patch(s.colour), format!("θᵢ = {}°", short(s.theta_i)))).collect();
    first.push((Key::Triangle(MUTED), "mirror direction".into()));
    let mut second = vec![(Key::Dot(INK), "measured ± σ".to_owned())];
    let any = |flag: Flag| series.iter().any(|s| s.points.iter().any(|p| p.flag == flag));
    if any(Flag::Filled) {
        second.push((Key::Circle(INK), "filled".into()));
    }
    if any(Flag::Extrapolated) {
        second.push((Key::Cross(INK), "extrapolated".into()));
    }
    for (k, c) in curves.iter().enumerate() {
        second.push((if k == 0 { Key::Line(INK) } else { Key::Dashed(INK) }, c.label.to_owned()));
    }
    let y = area.bottom() + 52.0;
    let used = legend::draw(canvas, (area.x, y), area.w, &first);
    legend::draw(canvas, (area.x, y + used), area.w, &second);
}

fn inside(area: Area, (x, y): At) -> bool {
    (area.x..=area.right()).contains(&x) && (area.y..=area.bottom()).contains(&y)
}

#[cfg(test)]
mod tests {
    use super::*;
    use gonio_brdf::{Meaning, models::AshikhminShirleySimplified};
    use gonio_optics::Angle;

    #[test]
    fn the_curve_meets_the_cell_means_of_its_own_model_at_the_nodes() {
        let model = AshikhminShirleySimplified { diffuse: [0.2; 3], specular: [0.1; 3], exponent: 300.0 };
        let meaning = Meaning::CellMean { lamp_half_angle: Angle::from_degrees(0.5) };
        let m = super::super::cells::model_table(&Measured::empty(Grid::sopp(), meaning), &model, 4, 2);
        let ti = 6;
        let curve = trace(&m, ti, &model, Channel::Green);
        for p in points(&m, ti, Channel::Green) {
            let c = curve.iter().find(|c| c.0 == p.x && (p.x != 0.0 || c.1 > 0.0)).unwrap();
            assert!((c.1 / p.y - 1.0).abs() < 1e-6, "θo {}: {} against {}", p.x, c.1, p.y);
        }
    }
}
