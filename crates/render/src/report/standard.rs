//! What every measurement's report shows: the standard pictures with their words, and colour differences by distance from the mirror
//! direction.

use gonio_brdf::{
    Brdf, Coat, Flag, Meaning, Measured,
    average::{CellBounds, gloss_cell_mean},
};
use gonio_optics::colour;

use super::number::significant;
use super::section::{ColourDifference, Figure};
use crate::plots::{
    self, Compare, Curve, Difference, Lobe, Unfolded, brightening, compare_tables, coverage, quantile,
};
use crate::sphere::{KnownCells, Spheres, spheres};

/// A fitted model and its name.
#[derive(Clone, Copy)]
pub struct Fit<'a> {
    /// As legends and captions call it.
    pub name: &'a str,
    /// The model, seen through its coat if it has one.
    pub brdf: &'a dyn Brdf,
    /// The coat, whose gloss depends on the lamp and is no part of `brdf`.
    pub coat: Option<Coat>,
}

/// The standard pictures of a table, and of its fit where there is one, in reading order. Names are the PNG files' names:
/// `lobe`, `spheres`, `compare`, `unfolded`, `coverage`, `sigma` (without a fit: no `spheres` and no `compare`).
#[must_use]
pub fn standard_figures(table: &Measured, fit: Option<Fit<'_>>) -> Vec<Figure> {
    let mut figures = vec![lobe(table, fit)];
    if let Some(f) = fit {
        figures.push(balls(table, f));
        figures.push(compared(table, f));
    }
    figures.push(unfolded(table));
    figures.push(flags(table));
    figures.push(uncertainty(table));
    figures
}

fn lobe(table: &Measured, fit: Option<Fit<'_>>) -> Figure {
    let curves: Vec<Curve<'_>> = fit.iter().map(|f| Curve { label: f.name, brdf: f.brdf }).collect();
    let lines = match fit {
        Some(f) if f.coat.is_some() => {
            format!(" Lines: {}, without the gloss, averaged over the same bins and lamp.", f.name)
        }
        Some(f) => format!(" Lines: {}, averaged over the same bins and lamp.", f.name),
        None => String::new(),
    };
    Figure {
        name: "lobe".into(),
        picture: plots::lobe(table, &curves, &Lobe::default()),
        caption: format!(
            "The lobe in the plane of incidence for several angles of incidence. Points are measured, bars are one standard \
             uncertainty, hollow points are filled and crosses extrapolated; triangles mark the mirror directions.{lines}"
        ),
        alt: "Plot of f in 1/sr against the viewing angle from -90 to 90 degrees, one lobe for each angle of incidence.".into(),
    }
}

fn balls(table: &Measured, fit: Fit<'_>) -> Figure {
    let captions = ["data".to_owned(), fit.name.to_owned()];
    let c = spheres(&KnownCells::new(table), fit.brdf, &Spheres { captions, ..Spheres::default() });
    let said: Vec<String> = c
        .differences
        .iter()
        .map(|d| {
            let [mean, p95, max] = [d.mean, d.p95, d.max].map(|x| significant(x, 2));
            format!("{}: mean {mean}, 95th percentile {p95}, max {max}", d.lighting)
        })
        .collect();
    Figure {
        name: "spheres".into(),
        picture: c.picture,
        caption: format!(
            "A ball rendered from the data and from the fit{}, and their CIEDE2000 over the lit pixels. {}.",
            if fit.coat.is_some() { " (which shows no gloss of the coat)" } else { "" },
            if said.is_empty() { "Nothing could be compared".into() } else { said.join("; ") }
        ),
        alt: format!("Two rendered balls and a map of their colour difference. {}", said.join("; ")),
    }
}

fn compared(table: &Measured, fit: Fit<'_>) -> Figure {
    let mut model = plots::model_table(table, fit.brdf, 4, 2);
    if let Some(coat) = fit.coat {
        add_gloss(&mut model, &coat);
    }
    let options = Compare { difference: Difference::DeltaE, ..Compare::default() };
    Figure {
        name: "compare".into(),
        picture: compare_tables(table, &model, &options),
        caption: format!(
            "Measurement, colour difference and {} side by side, unfolded: angle of incidence down in blocks, viewing angle \
             down within a block, azimuth across.",
            fit.name
        ),
        alt: "Three unfolded maps: measured colours, colour difference, model colours.".into(),
    }
}

/// The gloss of a coat, averaged over bins and lamp; node values have none.
fn add_gloss(table: &mut Measured, coat: &Coat) {
    let Meaning::CellMean { lamp_half_angle } = table.meaning else { return };
    for i in 0..table.values.len() {
        let bounds = CellBounds::of(&table.grid, lamp_half_angle, table.grid.coordinates(i));
        let gloss = gloss_cell_mean(coat.gloss_level(bounds.theta_i.cos(), lamp_half_angle), &bounds);
        for f in &mut table.values[i] {
            *f += gloss as f32;
        }
    }
}

fn unfolded(table: &Measured) -> Figure {
    let k = brightening(table);
    Figure {
        name: "unfolded".into(),
        picture: plots::unfolded(table, &Unfolded::default()),
        caption: "The whole measurement, unfolded, in true colours as it is and brightened: angle of incidence down in blocks, \
                  viewing angle down within a block, azimuth across. A perfect diffuser would be white at × 1."
            .into(),
        alt: format!("Unfolded map of all measured colours; brightening {} makes the body colour bright.", significant(k, 2)),
    }
}

fn flags(table: &Measured) -> Figure {
    let share = |flag| significant(100.0 * coverage::share(table, flag), 3);
    let said = format!(
        "{} % measured, {} % filled, {} % extrapolated, {} % without a value",
        share(Flag::Measured),
        share(Flag::Filled),
        share(Flag::Extrapolated),
        share(Flag::Invalid)
    );
    Figure {
        name: "coverage".into(),
        picture: coverage(table, ""),
        caption: format!("What is known of every cell: {said}."),
        alt: format!("Hemispheres of flags, one for each angle of incidence: {said}."),
    }
}

fn uncertainty(table: &Measured) -> Figure {
    let relative = (0..table.grid.len()).filter_map(|i| plots::relative_sigma(table, i));
    let middle = quantile(relative, 0.5)
        .map_or_else(|| "not known".into(), |q| format!("{} %", significant(100.0 * q, 2)));
    Figure {
        name: "sigma".into(),
        picture: plots::sigma(table, ""),
        caption: format!(
            "Relative standard uncertainty of the luminance of every cell (k = 1). Median: {middle}."
        ),
        alt: format!(
            "Hemispheres of relative uncertainty, one for each angle of incidence; median {middle}."
        ),
    }
}

/// CIEDE2000 (on `π f`) between a table and a model tabulated on its grid, over measured cells with θi and θo up to `limit_deg`:
/// `[within, beyond]` 15° of the mirror direction. `None` where there is no such cell.
#[must_use]
pub fn colour_differences(
    measured: &Measured,
    model: &Measured,
    limit_deg: f64,
) -> [Option<ColourDifference>; 2] {
    let mut sets = [Vec::new(), Vec::new()];
    for i in 0..measured.grid.len() {
        let [ti, to, phi] = measured.grid.coordinates(i);
        let g = measured.grid.geometry(ti, to, phi);
        let limit = limit_deg + 1e-9;
        let chosen = measured.flag.get(i) == Some(&Flag::Measured)
            && g.theta_i.degrees() <= limit
            && g.theta_o.degrees() <= limit;
        if let (true, Some(a), Some(b)) = (chosen, plots::value(measured, i), plots::value(model, i)) {
            let d = colour::ciede2000(colour::lab_from_brdf(a), colour::lab_from_brdf(b));
            sets[usize::from(g.from_mirror().degrees() > 15.0)].push(d);
        }
    }
    sets.map(|d| {
        let all = || d.iter().copied();
        Some(ColourDifference {
            mean: all().sum::<f64>() / d.len().max(1) as f64,
            p95: quantile(all(), 0.95)?,
            max: quantile(all(), 1.0)?,
            cells: d.len(),
        })
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use gonio_brdf::{Grid, models::Lambert};

    #[test]
    fn differences_are_sorted_by_the_distance_from_the_mirror_direction() {
        let grey = |d: f64| Measured::sampled(Grid::sopp(), &Lambert { diffuse: [d; 3] });
        let (mut a, b) = (grey(0.4), grey(0.4));
        let g = a.grid.clone();
        a.values[g.index(8, 16, 35)] = [0.2; 3];
        a.values[g.index(8, 16, 0)] = [f32::NAN; 3];
        a.flag[g.index(8, 16, 1)] = Flag::Extrapolated;
        a.values[g.index(8, 16, 1)] = [9.0; 3];
        let [within, beyond] = colour_differences(&a, &b, 75.0).map(Option::unwrap);
        let f = f64::from(0.2f32);
        let one = colour::ciede2000(colour::lab_from_brdf([f; 3]), colour::lab_from_rgb([0.4; 3]));
        assert!((within.max - one).abs() < 1e-4, "{within:?} {one}");
        assert!(beyond.max == 0.0, "{beyond:?}");
        // 16 angles of incidence, 31 of view, 36 azimuths, less the two that were spoilt
        assert_eq!(within.cells + beyond.cells, 16 * 31 * 36 - 2);
    }

    #[test]
    fn the_gloss_of_a_coat_is_drawn_where_the_lamp_mirrors() {
        let coat = Coat { index: 1.5 };
        let lamp_half_angle = gonio_optics::Angle::from_degrees(0.5);
        let black = Lambert { diffuse: [0.0; 3] };
        let like = Measured::empty(Grid::sopp(), Meaning::CellMean { lamp_half_angle });
        let mut drawn = plots::model_table(&like, &black, 2, 1);
        add_gloss(&mut drawn, &coat);
        let g = &drawn.grid;
        // over the hemisphere the gloss reflects what Fresnel says: Σ f cos θo dω = F(45°)
        let flux: f64 = (0..g.theta_o_deg.len())
            .flat_map(|o| (0..g.phi_deg.len()).map(move |p| (o, p)))
            .map(|(o, p)| {
                let f = f64::from(drawn.values[g.index(9, o, p)][1]);
                // half of the azimuths are in the table
                2.0 * f * g.theta_o_deg[o].to_radians().cos() * g.solid_angle(o, p)
            })
            .sum();
        let fresnel = gonio_optics::fresnel::dielectric(45f64.to_radians().cos(), 1.5);
        assert!((flux / fresnel - 1.0).abs() < 0.03, "{flux} {fresnel}");
        let at = |o: usize, p: usize| drawn.values[g.index(9, o, p)][1];
        assert!(at(18, 35) > 10.0 && at(18, 0) == 0.0 && at(10, 35) == 0.0);
    }

    #[test]
    fn a_table_without_values_has_no_differences() {
        let empty = Measured::empty(Grid::sopp(), Meaning::Node);
        assert_eq!(colour_differences(&empty, &empty, 75.0), [None, None]);
    }
}
