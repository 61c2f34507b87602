//! One file per paint.
//!
//! The header of the [`Container`] has `name`, `through` (`two-way`: the base's colours, to be multiplied by T(θi)T(θo)/n²; `refracted-only`: colours as seen
//! outside), `lobes` (their number), `normalisation` (`modern`: F·D·G/(4 cos cos)), `flakes` ({kind, size, texel_mm}) where there are any, and `notes`. Sections:
//!
//! ```text
//! parameters        f64  index of the coat (0: none), diffuse r g b, then for each lobe specular r g b, alpha, r0
//! colour_half       f64  half angles of χ, radians           colour_incidence   f64    colour   f32  r g b by half angle, incidence
//! flakes_half       f64  half angles of Ξ, radians           flakes_incidence   f64    texels   f32  r g b by half angle, incidence, row, column
//! flakes_texel_mm   f64  side of a texel
//! ```
//!
//! Flakes of the kind `statistics` have no texels but
//!
//! ```text
//! clusters_of_slice f64  clusters of each slice, by half angle, incidence
//! clusters          f32  for each cluster smallest L* a* b*, largest L* a* b*, probability in steps of 1/500
//! ```

use std::sync::Arc;

use gonio_brdf::{Coat, models::CookTorranceLobe};
use gonio_optics::Angle;
use serde_json::{Map, Value, json};

use super::container::MAGIC;
use super::{
    CarPaint, CarPaintError, CarPaintParts, ColourTable, Container, FlakeDraws, FlakeSlices, Flakes, Section,
    Through,
};
use crate::FlakeBtf;
use crate::statistics::{Cluster, FlakeStatistics};

/// Whether some bytes begin as a car-paint file does.
#[must_use]
pub fn is_paint(bytes: &[u8]) -> bool {
    bytes.starts_with(MAGIC)
}

fn radians(angles: &[Angle]) -> Section {
    Section::F64(angles.iter().map(|a| a.radians()).collect())
}

/// The file of a paint; `notes` are kept beside it (where it comes from, what a fit said).
///
/// # Errors
/// [`CarPaintError::Container`] for notes beyond 4 GiB.
pub fn write_paint(paint: &CarPaint, notes: &Map<String, Value>) -> Result<Vec<u8>, CarPaintError> {
    let p = paint.parts();
    let mut header = Map::new();
    header.insert("name".to_owned(), json!(p.name));
    header.insert("through".to_owned(), json!(p.through.name()));
    header.insert("lobes".to_owned(), json!(p.lobes.len()));
    header.insert("normalisation".to_owned(), json!("modern"));
    if !notes.is_empty() {
        header.insert("notes".to_owned(), Value::Object(notes.clone()));
    }
    let mut parameters = vec![p.coat.map_or(0.0, |c| c.index)];
    parameters.extend(p.diffuse);
    for lobe in &p.lobes {
        parameters.extend(lobe.specular);
        parameters.extend([lobe.alpha, lobe.r0]);
    }
    let mut c = Container::new(header);
    c.put("parameters", Section::F64(parameters));
    if let Some(chi) = &p.colour {
        c.put("colour_half", radians(chi.half().angles()));
        c.put("colour_incidence", radians(chi.incidence().angles()));
        c.put("colour", Section::F32(chi.values().as_flattened().to_vec()));
    }
    if let Some(flakes) = &p.flakes {
        put_flakes(&mut c, flakes);
    }
    Ok(c.to_bytes()?)
}

fn put_flakes(c: &mut Container, flakes: &Flakes) {
    let s = match flakes {
        Flakes::Slices(s) => s,
        Flakes::Statistics(s) => return put_statistics(c, s.statistics(), flakes),
    };
    let btf = s.btf();
    let size = btf.size();
    c.header.insert("flakes".to_owned(), json!({"kind": flakes.name(), "size": size}));
    c.put("flakes_half", radians(btf.half()));
    c.put("flakes_incidence", radians(btf.incidence()));
    c.put("flakes_texel_mm", Section::F64(vec![flakes.texel_mm()]));
    let mut texels = Vec::with_capacity(btf.slices().len() * size[0] * size[1] * 3);
    for slice in btf.slices() {
        texels.extend_from_slice(slice.as_flattened());
    }
    c.put("texels", Section::F32(texels));
}

fn put_statistics(c: &mut Container, s: &FlakeStatistics, flakes: &Flakes) {
    c.header.insert("flakes".to_owned(), json!({"kind": flakes.name()}));
    c.put("flakes_half", radians(s.half()));
    c.put("flakes_incidence", radians(s.incidence()));
    c.put("flakes_texel_mm", Section::F64(vec![flakes.texel_mm()]));
    let counts = (0..s.slices()).map(|k| s.clusters(k).len() as f64).collect();
    c.put("clusters_of_slice", Section::F64(counts));
    let numbers = s.all_clusters().iter().flat_map(|c| {
        let [l, a, b] = c.low;
        let [l1, a1, b1] = c.high;
        [l, a, b, l1, a1, b1, f32::from(c.steps)]
    });
    c.put("clusters", Section::F32(numbers.collect()));
}

fn take_statistics(c: &mut Container, texel_mm: f64) -> Result<Flakes, CarPaintError> {
    let missing = |name: &str, what: &str| CarPaintError::content(name, "missing", what);
    let numbers = c.take_f32s("clusters").ok_or_else(|| missing("clusters", "the clusters"))?;
    let mut all = numbers.as_chunks::<7>().0.iter().map(|&[l, a, b, l1, a1, b1, steps]| Cluster {
        low: [l, a, b],
        high: [l1, a1, b1],
        steps: steps.round() as u16,
    });
    let counts =
        c.f64s("clusters_of_slice").ok_or_else(|| missing("clusters_of_slice", "one number a slice"))?;
    let slices: Vec<Vec<Cluster>> = counts.iter().map(|n| all.by_ref().take(*n as usize).collect()).collect();
    let statistics = FlakeStatistics::new(angles(c, "flakes_half")?, angles(c, "flakes_incidence")?, &slices)
        .map_err(|e| CarPaintError::content("clusters", e, "500 steps in each slice"))?;
    Ok(Flakes::Statistics(FlakeDraws::new(Arc::new(statistics), texel_mm)?))
}

/// Reads a paint and the notes beside it.
///
/// # Errors
/// [`CarPaintError`]: damage, or what was found and what was expected.
pub fn read_paint(bytes: &[u8]) -> Result<(CarPaint, Map<String, Value>), CarPaintError> {
    let mut c = Container::from_bytes(bytes)?;
    let text = |key: &str| c.header.get(key).and_then(Value::as_str).map(str::to_owned);
    let through = text("through").unwrap_or_default();
    let through = Through::from_name(&through)
        .ok_or_else(|| CarPaintError::content("through", through, "two-way or refracted-only"))?;
    let normalisation = text("normalisation").unwrap_or_default();
    if normalisation != "modern" {
        return Err(CarPaintError::content("normalisation", normalisation, "modern"));
    }
    let name = text("name").unwrap_or_default();
    let parameters = c.f64s("parameters").unwrap_or_default();
    let lobes = c.header.get("lobes").and_then(Value::as_u64).unwrap_or_default();
    let expected = 4 + 5 * lobes.min(64) as usize;
    if parameters.len() != expected {
        return Err(CarPaintError::content(
            "parameters",
            parameters.len(),
            format!("{expected} numbers for {lobes} lobes"),
        ));
    }
    let coat = (parameters[0] != 0.0).then_some(Coat { index: parameters[0] });
    let diffuse = [parameters[1], parameters[2], parameters[3]];
    let lobes = parameters[4..]
        .chunks_exact(5)
        .map(|p| CookTorranceLobe { specular: [p[0], p[1], p[2]], alpha: p[3], r0: p[4] })
        .collect();
    let colour = match c.take_f32s("colour") {
        None => None,
        Some(values) => {
            let table = ColourTable::new(
                angles(&c, "colour_half")?,
                angles(&c, "colour_incidence")?,
                triples(&values),
            )?;
            Some(table)
        }
    };
    let flakes = take_flakes(&mut c)?;
    let notes = match c.header.remove("notes") {
        Some(Value::Object(notes)) => notes,
        _ => Map::new(),
    };
    let paint = CarPaint::new(CarPaintParts { name, coat, through, diffuse, lobes, colour, flakes })?;
    Ok((paint, notes))
}

fn take_flakes(c: &mut Container) -> Result<Option<Flakes>, CarPaintError> {
    let Some(flakes) = c.header.get("flakes") else { return Ok(None) };
    let kind = flakes.get("kind").and_then(Value::as_str).unwrap_or_default();
    if kind == "statistics" {
        let texel_mm = texel_side(c)?;
        return take_statistics(c, texel_mm).map(Some);
    }
    if kind != "slices" {
        return Err(CarPaintError::content(
            "kind of flakes",
            kind,
            "slices or statistics (or a newer program)",
        ));
    }
    let side = |k: usize| {
        flakes
            .get("size")
            .and_then(|s| s.get(k))
            .and_then(Value::as_u64)
            .and_then(|n| usize::try_from(n).ok())
    };
    let (Some(w), Some(h)) = (side(0), side(1)) else {
        return Err(CarPaintError::content("size of flakes", "missing", "two numbers of texels"));
    };
    let texel_mm = texel_side(c)?;
    let texels =
        c.take_f32s("texels").ok_or_else(|| CarPaintError::content("texels", "missing", "the textures"))?;
    let btf =
        FlakeBtf::new(angles(c, "flakes_half")?, angles(c, "flakes_incidence")?, [w, h], triples(&texels))?;
    Ok(Some(Flakes::Slices(FlakeSlices::new(Arc::new(btf), texel_mm)?)))
}

fn texel_side(c: &Container) -> Result<f64, CarPaintError> {
    match c.f64s("flakes_texel_mm") {
        Some([mm]) => Ok(*mm),
        _ => Err(CarPaintError::content("flakes_texel_mm", "missing", "one number")),
    }
}

fn angles(c: &Container, name: &str) -> Result<Vec<Angle>, CarPaintError> {
    let list = c.f64s(name).ok_or_else(|| CarPaintError::content(name, "missing", "angles in radians"))?;
    Ok(list.iter().map(|&a| Angle::from_radians(a)).collect())
}

/// Numbers by three; a rest that makes no colour is left out, which the counts of the axes find.
fn triples(values: &[f32]) -> Vec<[f32; 3]> {
    values.as_chunks::<3>().0.to_vec()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::car_paint::laws::sample_paint;

    #[test]
    fn a_paint_comes_back_to_the_bit_with_its_notes() {
        let paint = sample_paint(true);
        let mut notes = Map::new();
        notes.insert("source".to_owned(), json!("by hand"));
        let bytes = write_paint(&paint, &notes).expect("written");
        assert!(is_paint(&bytes));
        let (back, said) = read_paint(&bytes).expect("read");
        assert_eq!(back, paint);
        assert_eq!(said, notes);
        assert_eq!(write_paint(&back, &said).expect("written"), bytes);
        let plain = CarPaint::new(CarPaintParts { name: "plain".to_owned(), ..CarPaintParts::default() })
            .expect("sound");
        let bytes = write_paint(&plain, &Map::new()).expect("written");
        assert_eq!(read_paint(&bytes).expect("read"), (plain, Map::new()));
    }

    #[test]
    fn content_that_is_no_paint_is_told_by_name() {
        let tell = |change: &dyn Fn(&mut Container)| {
            let bytes = write_paint(&sample_paint(true), &Map::new()).expect("written");
            let mut c = Container::from_bytes(&bytes).expect("sound");
            change(&mut c);
            read_paint(&c.to_bytes().expect("written")).expect_err("unsound").to_string()
        };
        let say = |text: String, word: &str| assert!(text.contains(word), "{text}");
        say(tell(&|c| c.put("parameters", Section::F64(vec![1.5]))), "parameters is 1");
        say(tell(&|c| c.put("parameters", Section::F32(vec![]))), "parameters is 0");
        say(tell(&|c| drop(c.header.insert("through".to_owned(), json!("single")))), "single");
        say(tell(&|c| drop(c.header.insert("normalisation".to_owned(), json!("1982")))), "modern");
        say(tell(&|c| c.put("colour", Section::F32(vec![1.0; 4]))), "χ has 1 values");
        say(tell(&|c| c.put("texels", Section::F32(vec![1.0; 4]))), "texels are expected");
        say(tell(&|c| drop(c.header.insert("flakes".to_owned(), json!({"kind": "fog"})))), "fog");
        say(tell(&|c| c.put("flakes_half", Section::F64(vec![f64::NAN]))), "must rise");
    }
}
