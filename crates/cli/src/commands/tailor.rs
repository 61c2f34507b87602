//! `gonio tailor`: the cheapest representation that keeps a bound for a scene, written out, with the evidence.

use std::fmt::Write;
use std::path::{Path, PathBuf};

use gonio_brdf::formats::{self, Loaded, Target};
use gonio_brdf::{Grid, Measured};
use gonio_optics::isoline::Method;
use gonio_render::Report;
use gonio_render::plots::pareto::size_in_words;
use gonio_render::plots::{Pareto, ParetoPoint, SceneRow, scene_geometries};
use gonio_render::report::{Block, Fact, Figure, KeyFigure, Notice, Section, Weight, significant};
use gonio_render::trace::Gathered;
use gonio_tailor::{
    Choice, ChoiceOptions, Material, Representation, SceneCandidate, Statistic, body_of, choose,
    pixel_differences,
};
use serde_json::{Value, json};

use super::colormap::Drawn;
use super::trade::{GROUPS, candidates, group};
use crate::arguments::scene::{StatisticName, TailorArguments};
use crate::outcome::{Failure, Outcome};
use crate::output::{self, Printer, shown};
use crate::{effect, report, scenes};

/// Files in the folder, beside the pictures and the representation.
const FILES: [&str; 2] = ["tailor.json", "report.html"];

/// Everything a report needs.
struct Told<'a> {
    a: &'a TailorArguments,
    scene_name: &'a str,
    scene: &'a Gathered,
    material: &'a Material,
    choice: &'a Choice,
    statistic: Statistic,
}

/// Chooses, prints, writes the folder where asked.
///
/// # Errors
/// [`Failure::Usage`] for input that cannot be read or judged; [`Failure::Failed`] where no representation keeps the bound (the evidence is written all the same).
pub fn run(a: &TailorArguments, printer: Printer) -> Result<Outcome, Failure> {
    if !(a.max_delta_e.is_finite() && a.max_delta_e > 0.0) {
        return Err(Failure::usage(format!("--max-delta-e {}: expected a number above 0", a.max_delta_e)));
    }
    if let Some(folder) = &a.output {
        super::trade::check_folder(folder, &FILES, a.force)?;
    }
    let material = effect::material(&a.input)?;
    let options = ChoiceOptions {
        build: effect::options(&a.map, &material)?,
        candidates: candidates(&a.only)?,
        bound: a.max_delta_e,
        statistic: match a.statistic {
            StatisticName::Mean => Statistic::Mean,
            StatisticName::P95 => Statistic::P95,
            StatisticName::Max => Statistic::Max,
        },
    };
    let sharpness = scenes::sharpness(material.brdf());
    let (scene_name, scene) = scenes::gathered(scenes::open(&a.scene)?, a.side, a.samples, sharpness)?;
    let choice =
        choose(&material, &scene, &options).map_err(|e| Failure::usage(format!("{}: {e}", a.input)))?;
    effect::say(&choice.findings);
    let told = Told {
        a,
        scene_name: &scene_name,
        scene: &scene,
        material: &material,
        choice: &choice,
        statistic: options.statistic,
    };
    let mut json = told.json();
    let mut text = told.table();
    if let Some(folder) = &a.output {
        let files = told.write(folder, &options, &mut json)?;
        let _ = write!(text, "\n{} and {} more files", files[0].display(), files.len() - 1);
    }
    if choice.chosen.is_some() {
        printer.result(&text, &json);
        return Ok(Outcome::Done);
    }
    printer.result(&text, &json);
    let nearest = choice.nearest(options.statistic);
    Err(Failure::Failed(format!(
        "no representation keeps a {} ΔE of {} for {scene_name}: {}; raise --max-delta-e, give the table and the maps more nodes (--nodes), or measure closer rows",
        options.statistic.name(),
        a.max_delta_e,
        nearest.map_or_else(
            || "none could be built".to_owned(),
            |c| format!(
                "the nearest is {} with {:.2}",
                c.built.representation,
                options.statistic.of(&c.pixels)
            )
        )
    )))
}

impl Told<'_> {
    fn chosen(&self) -> Option<&SceneCandidate> {
        self.choice.chosen.and_then(|k| self.choice.candidates.get(k))
    }

    fn table(&self) -> String {
        let mut out = format!(
            "{} in {}: {} pixels, {} local geometries; ΔE (CIEDE2000) of the pixels against the full table, bound {} ({})\n\n{:<28} {:>9} {:>9}   {:>6} {:>6} {:>6}\n",
            self.material.name,
            self.scene_name,
            self.scene.coverage.iter().filter(|c| **c > 0.999).count(),
            self.scene.lights.len(),
            self.a.max_delta_e,
            self.statistic.name(),
            "",
            "ns each",
            "size",
            "mean",
            "95 %",
            "max"
        );
        for (k, c) in self.choice.candidates.iter().enumerate() {
            let mark = if Some(k) == self.choice.chosen {
                "▸"
            } else if c.on_front {
                "*"
            } else {
                " "
            };
            let _ = writeln!(
                out,
                "{mark} {:<26} {:>9.1} {:>9}   {:>6.2} {:>6.2} {:>6.2}{}",
                c.built.representation.to_string(),
                c.cost.median_ns,
                size_in_words(c.built.bytes()),
                c.pixels.mean,
                c.pixels.p95,
                c.pixels.max,
                if c.keeps { "" } else { "   above the bound" }
            );
        }
        out += "\n▸ chosen: the cheapest within the bound; * on the front\n";
        if let Some(c) = self.chosen() {
            let _ = writeln!(
                out,
                "{}: {:.2} of the full table's time ({:.1} of {:.1} ns), {:.3} of its size ({} of {})",
                c.built.representation,
                c.cost.median_ns / self.choice.table_ns,
                c.cost.median_ns,
                self.choice.table_ns,
                c.built.bytes() as f64 / self.choice.table_bytes.max(1) as f64,
                size_in_words(c.built.bytes()),
                size_in_words(self.choice.table_bytes)
            );
        }
        for l in &self.choice.left_out {
            let _ = writeln!(out, "left out: {}: {}", l.representation, l.reason);
        }
        if let Some(g) = self.choice.gloss {
            let _ = writeln!(out, "gloss: {g}");
        }
        if cfg!(debug_assertions) {
            out += "built without optimisation: these times are not those of a release\n";
        }
        out
    }

    fn json(&self) -> Value {
        let candidate = |(k, c): (usize, &SceneCandidate)| {
            json!({
                "name": c.built.representation.to_string(), "ns": c.cost.median_ns, "bytes": c.built.bytes(), "delta_e": c.pixels,
                "keeps": c.keeps, "chosen": Some(k) == self.choice.chosen, "on_front": c.on_front,
            })
        };
        json!({
            "input": self.a.input, "name": self.material.name, "scene": self.scene_name, "bound": self.a.max_delta_e,
            "statistic": self.statistic.name(), "geometries": self.scene.lights.len(), "optimised": !cfg!(debug_assertions),
            "chosen": self.chosen().map(|c| c.built.representation.to_string()),
            "table_ns": self.choice.table_ns, "table_bytes": self.choice.table_bytes,
            "cost_ratio": self.chosen().map(|c| c.cost.median_ns / self.choice.table_ns),
            "size_ratio": self.chosen().map(|c| c.built.bytes() as f64 / self.choice.table_bytes.max(1) as f64),
            "gloss": self.choice.gloss, "candidates": self.choice.candidates.iter().enumerate().map(candidate).collect::<Vec<_>>(),
            "left_out": self.choice.left_out.iter().map(|l| json!({ "name": l.representation.to_string(), "reason": l.reason })).collect::<Vec<_>>(),
            "findings": effect::findings_json(&self.choice.findings), "files": [],
        })
    }

    fn write(
        &self,
        folder: &Path,
        options: &ChoiceOptions,
        json: &mut Value,
    ) -> Result<Vec<PathBuf>, Failure> {
        std::fs::create_dir_all(folder)
            .map_err(|e| Failure::usage(format!("folder {} cannot be made: {e}", folder.display())))?;
        let mut files = Vec::new();
        if let Some(c) = self.chosen() {
            files.push(self.representation(folder, c, options)?);
        }
        let [told, html] = FILES.map(|f| folder.join(f));
        let pictures = report::save(&self.report(), &html, Some(folder))?;
        files.extend([html, told.clone()]);
        files.extend(pictures);
        json["files"] = files.iter().map(|p| shown(p)).collect();
        output::write_whole(&told, format!("{json:#}\n").as_bytes())?;
        Ok(files)
    }

    /// The chosen representation in the file that renderers and `gonio` read.
    fn representation(
        &self,
        folder: &Path,
        c: &SceneCandidate,
        options: &ChoiceOptions,
    ) -> Result<PathBuf, Failure> {
        let (body, _) = body_of(self.material, &options.build).map_err(Failure::usage)?;
        let judged = body.as_ref().unwrap_or(self.material);
        let written = |name: &str, bytes: &[u8]| {
            let path = folder.join(name);
            output::write_whole(&path, bytes).map(|()| path)
        };
        let fail = |e: String| Failure::failed("the representation cannot be written", e);
        match c.built.representation {
            Representation::FlakeMap(_) => {
                let map = c.built.flake_map().ok_or_else(|| fail("no flake map".to_owned()))?;
                written("paint.flake-map.json", map.to_json().map_err(|e| fail(e.to_string()))?.as_bytes())
            }
            Representation::ColourMap(_) | Representation::Aspecular => {
                let method = match c.built.representation {
                    Representation::ColourMap(m) => m,
                    _ => Method::Clip,
                };
                let drawn = Drawn::new(judged, c.built.representation, options.build)?;
                written("paint.map.exr", &drawn.image(method).to_exr().map_err(|e| fail(e.to_string()))?)
            }
            Representation::Table => {
                let table = match (judged.table(), judged.brdf()) {
                    (Some(t), _) => t.clone(),
                    (None, Some(f)) => Measured::sampled(Grid::sopp(), f),
                    (None, None) => return Err(fail("nothing between the measurements".to_owned())),
                };
                let path = folder.join("paint.nc");
                let _ = formats::save(&path, &Loaded::Table(Box::new(table)), Target::Netcdf, true)
                    .map_err(|e| fail(e.to_string()))?;
                Ok(path)
            }
            Representation::Model(model) => {
                let observations = judged.observations().ok_or_else(|| fail("nothing to fit".to_owned()))?;
                let wanted =
                    gonio_fitter::Options { model, max_angle: options.build.largest, ..Default::default() };
                let file = gonio_fitter::fit(&observations, &wanted).to_model_file();
                written("paint.model.json", file.to_json().map_err(|e| fail(e.to_string()))?.as_bytes())
            }
        }
    }

    fn report(&self) -> Report {
        let mut notices: Vec<Notice> = self
            .choice
            .findings
            .iter()
            .map(|f| Notice { weight: Weight::Warning, text: f.to_string() })
            .collect();
        if self.choice.chosen.is_none() {
            notices.push(Notice {
                weight: Weight::Failure,
                text: "No representation keeps the bound.".to_owned(),
            });
        }
        let geometries = self.scene.geometries();
        let mut figures = vec![Figure {
            name: "pareto".to_owned(),
            picture: self.pareto().draw(),
            caption: "Colour difference of the rendered pixels over cost; the area of a mark grows with the size of what a look-up reads.".to_owned(),
            alt: "Colour difference over ns per evaluation".to_owned(),
        }];
        if let Some(c) = self.chosen().or_else(|| self.choice.nearest(self.statistic)) {
            figures.push(self.difference(c));
        }
        figures.push(Figure {
            name: "geometries".to_owned(),
            picture: scene_geometries(&geometries, "What the scene looks at", Some(75.0)),
            caption:
                "Weight of the local geometries: every lit pixel counts alike, its lights by their share."
                    .to_owned(),
            alt: "Distribution of local angles".to_owned(),
        });
        let row = |c: &SceneCandidate| {
            vec![
                c.built.representation.to_string(),
                significant(c.cost.median_ns, 3),
                size_in_words(c.built.bytes()),
                significant(c.pixels.mean, 3),
                significant(c.pixels.p95, 3),
                significant(c.pixels.max, 3),
                if c.keeps { "yes" } else { "" }.to_owned(),
            ]
        };
        let head = ["Representation", "ns", "size", "mean ΔE", "95 %", "max", "keeps the bound"];
        Report {
            title: format!("{} for {}", self.material.name, self.scene_name),
            subtitle: format!("bound: {} ΔE {}", self.statistic.name(), self.a.max_delta_e),
            key_figures: self
                .chosen()
                .map(|c| KeyFigure {
                    label: "chosen".to_owned(),
                    value: c.built.representation.to_string(),
                    note: format!("{} ns, the table takes {}", significant(c.cost.median_ns, 3), significant(self.choice.table_ns, 3)),
                })
                .into_iter()
                .collect(),
            notices,
            sections: vec![
                Section {
                    heading: "Candidates".to_owned(),
                    intro: "Every candidate renders the same picture from the same rays; ΔE (CIEDE2000) of each pixel against the full table.".to_owned(),
                    blocks: vec![
                        Block::Table {
                            caption: "Cost, size and CIEDE2000 of the pixels".to_owned(),
                            head: head.map(str::to_owned).to_vec(),
                            rows: self.choice.candidates.iter().map(row).collect(),
                        },
                        Block::Facts(vec![
                            Fact::new("geometries", self.scene.lights.len().to_string()),
                            Fact::new("gloss", self.choice.gloss.map_or_else(String::new, |g| g.to_string())),
                        ]),
                    ],
                },
                Section { heading: "Pictures".to_owned(), intro: String::new(), blocks: vec![Block::Pictures(figures)] },
            ],
            footer: format!("gonio {}", env!("CARGO_PKG_VERSION")),
        }
    }

    fn pareto(&self) -> Pareto {
        let point = |c: &SceneCandidate| ParetoPoint {
            name: c.built.representation.to_string(),
            cost: c.cost.median_ns,
            error: self.statistic.of(&c.pixels),
            bytes: c.built.bytes(),
            on_front: c.on_front,
            group: group(c.built.representation),
        };
        Pareto {
            title: format!("{} for {}", self.material.name, self.scene_name),
            cost_label: "ns per evaluation from vectors, one thread".to_owned(),
            error_label: format!("{} CIEDE2000 of the pixels", self.statistic.name()),
            groups: GROUPS.map(str::to_owned).to_vec(),
            points: self.choice.candidates.iter().map(point).collect(),
        }
    }

    fn difference(&self, c: &SceneCandidate) -> Figure {
        let made = self.scene.pictures(&|l, v, out| c.built.eval_many(l, v, out));
        let differences = pixel_differences(self.scene, &self.choice.reference, &made);
        let pixels = self.scene.size[0] as usize * self.scene.size[1] as usize;
        let name = c.built.representation.to_string();
        let picture = match (self.choice.reference.first(), made.first()) {
            (Some(table), Some(other)) => SceneRow {
                title: format!("{} in {}", self.material.name, self.scene_name),
                pictures: vec![("full table".to_owned(), table, vec![]), (name.clone(), other, vec![])],
                white: self.scene.white,
                differences: &differences[..pixels.min(differences.len())],
                note: format!(
                    "ΔE mean {:.2}, 95th percentile {:.2}, max {:.2}",
                    c.pixels.mean, c.pixels.p95, c.pixels.max
                ),
            }
            .draw(),
            _ => gonio_render::Picture::new(1, 1, [255; 3]),
        };
        Figure {
            name: "difference".to_owned(),
            picture,
            caption: format!("The first view with the full table, with {name}, and their difference."),
            alt: "Two pictures and their colour difference".to_owned(),
        }
    }
}
