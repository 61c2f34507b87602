//! `gonio plan`: the poses that a scene needs, as a plan that `gonio scan` takes; or the next pose of an adaptive scan.

use gonio_brdf::{Measured, ModelFile};
use gonio_instrument::Plan;
use gonio_tailor::{LikelyMaterial, Material, PlanOptions, next_pose, plan, reach};
use serde_json::json;

use crate::arguments::scene::PlanArguments;
use crate::outcome::{Failure, Outcome};
use crate::output::{self, Printer, shown};
use crate::{effect, rig, scenes};

/// Paints that a sample is likely to resemble where nothing is said: a silver metallic, a deep colour with flakes, a matt solid.
const LIKELY: [&str; 3] = [
    r#"{"model":"ggx","diffuse":[0.10,0.10,0.11],"lobes":[{"specular":[0.55,0.56,0.58],"alpha":0.30,"r0":0.6}],"coat":{"index":1.5}}"#,
    r#"{"model":"ggx","diffuse":[0.02,0.05,0.16],"lobes":[{"specular":[0.10,0.20,0.45],"alpha":0.24,"r0":0.5}],"coat":{"index":1.5}}"#,
    r#"{"model":"ggx","diffuse":[0.35,0.12,0.06],"lobes":[{"specular":[0.6,0.6,0.6],"alpha":0.45,"r0":0.04}]}"#,
];

/// Plans and writes.
///
/// # Errors
/// [`Failure::Usage`] for input that cannot be read, a scene that shows nothing or asks for what the instrument cannot reach; [`Failure::Failed`] where no plan of
/// the instrument keeps the bound.
pub fn run(a: &PlanArguments, printer: Printer) -> Result<Outcome, Failure> {
    output::check_free(&a.output, a.force)?;
    if let Some(bound) = a.max_delta_e.filter(|b| !(b.is_finite() && *b > 0.0)) {
        return Err(Failure::usage(format!("--max-delta-e {bound}: expected a number above 0")));
    }
    let instrument = rig::instrument(&a.instrument)?;
    if a.after.is_some() {
        return next(a, &instrument, printer);
    }
    let like = materials(a)?;
    let list: Vec<LikelyMaterial<'_>> = like
        .iter()
        .filter_map(|m| Some(LikelyMaterial { brdf: m.brdf()?, index: m.stated_index().unwrap_or(1.0) }))
        .collect();
    let sharpest = list.iter().map(|m| m.brdf.sharpness()).fold(60.0, f64::max);
    let (name, scene) = scenes::gathered(scenes::open(&a.scene)?, a.side, 4, sharpest)?;
    let options = PlanOptions { fill: &scenes::fill_as_a_scan, bound: a.max_delta_e };
    let found =
        plan(&scene, &instrument, &list, options).map_err(|e| Failure::usage(format!("{name}: {e}")))?;
    let spins = instrument.plan.spin_deg.len();
    let poses = |tilts: usize| tilts * spins;
    if !found.kept {
        return Err(Failure::Failed(format!(
            "{name}: even all {} poses of the instrument are expected to leave a mean ΔE of {:.2}, above the bound of {:.2}: rows 5° apart do not hold so sharp a lobe; raise \
             --max-delta-e to {:.2}, give the instrument a plan with closer tilts, or fit a model instead of using the table",
            poses(found.full.tilt_deg.len()),
            found.full.delta_e,
            found.bound,
            (100.0 * found.full.delta_e).ceil() / 100.0
        )));
    }
    write(a, &found.plan)?;
    let (few, all) = (poses(found.expected.tilt_deg.len()), poses(found.full.tilt_deg.len()));
    let mut text = format!(
        "{name}: {few} of {all} poses, up to {} exposures each, tilts {}\n  expected mean ΔE of the pictures {:.3}, with the full plan {:.3} (bound {:.3})\n  of the scene's light {:.1} % is measured as it is, {:.1} % with light and view \
         exchanged, {:.1} % is continued beyond 75°\n  written to {}",
        found.plan.max_exposures,
        found.expected.tilt_deg.iter().map(|t| format!("{t}°")).collect::<Vec<_>>().join(", "),
        found.expected.delta_e,
        found.full.delta_e,
        found.bound,
        100.0 * found.reach.measured,
        100.0 * found.reach.exchanged,
        100.0 * found.reach.beyond,
        a.output.display()
    );
    if found.reach.beyond > 0.05 {
        text += "\n  note: light beyond 75° is a continuation, not a measurement; a camera or a light that shows less of the rim would need less of it";
    }
    printer.result(
        &text,
        &json!({
            "scene": name, "instrument": instrument.name, "output": shown(&a.output), "adaptive": false,
            "tilt_deg": found.expected.tilt_deg, "poses": few, "full_poses": all,
            "max_exposures": found.plan.max_exposures, "saving": 1.0 - few as f64 / all.max(1) as f64,
            "expected_delta_e": found.expected.delta_e, "full_delta_e": found.full.delta_e, "bound": found.bound,
            "steps": found.steps.iter().map(|(t, e)| json!({ "tilt_deg": t, "expected_delta_e": e })).collect::<Vec<_>>(),
            "reach": { "measured": found.reach.measured, "exchanged": found.reach.exchanged, "beyond": found.reach.beyond },
        }),
    );
    Ok(Outcome::Done)
}

fn materials(a: &PlanArguments) -> Result<Vec<Material>, Failure> {
    if !a.like.is_empty() {
        return a
            .like
            .iter()
            .map(|m| {
                let material = effect::material(m)?;
                if material.brdf().is_none() {
                    return Err(Failure::usage(format!("--like {m}: scattered geometries say nothing in between; name a model, a table or a flake map")));
                }
                Ok(material)
            })
            .collect();
    }
    LIKELY
        .iter()
        .map(|text| {
            let file = ModelFile::from_json(text).map_err(|e| Failure::failed("built-in paint", e))?;
            Ok(Material::new("likely", gonio_brdf::formats::Loaded::Model(Box::new(file))))
        })
        .collect()
}

fn write(a: &PlanArguments, plan: &Plan) -> Result<(), Failure> {
    let text = plan.to_toml().map_err(|e| Failure::failed("the plan cannot be written", e))?;
    let head = if text.contains("format") {
        String::new()
    } else {
        format!("format = \"{}\"\n", gonio_instrument::plan::FORMAT)
    };
    output::write_whole(&a.output, format!("{head}{text}").as_bytes())
}

/// The next pose after what was measured.
fn next(
    a: &PlanArguments,
    instrument: &gonio_instrument::Description,
    printer: Printer,
) -> Result<Outcome, Failure> {
    let path = a.after.as_deref().unwrap_or(&a.scene);
    let material = effect::material(&path.to_string_lossy())?;
    let table: &Measured = material.table().ok_or_else(|| {
        Failure::usage(format!(
            "--after {}: expected a measured table (.nc), whose flags tell which rows were visited",
            path.display()
        ))
    })?;
    let (name, scene) = scenes::gathered(scenes::open(&a.scene)?, a.side, 4, 60.0)?;
    let visited = |t: f64| {
        table.grid.theta_i_deg.iter().position(|r| (r - t).abs() < 1e-6).is_some_and(|ti| {
            let first = table.grid.index(ti, 0, 0);
            let one = table.grid.theta_o_deg.len() * table.grid.phi_deg.len();
            table.flag[first..first + one].contains(&gonio_brdf::Flag::Measured)
        })
    };
    let left: Vec<f64> = instrument.plan.tilt_deg.iter().copied().filter(|t| !visited(*t)).collect();
    let said = next_pose(&scene, &scenes::measured_body(table), &left, &scenes::fill_as_a_scan);
    let bound = a.max_delta_e.unwrap_or(1.0);
    let enough = said.expected <= bound;
    let seen = reach(&scene, instrument);
    let (text, written) = match said.tilt_deg {
        Some(tilt) if !enough => {
            write(a, &Plan { tilt_deg: vec![tilt], ..instrument.plan.clone() })?;
            (
                format!(
                    "{name}: expected mean ΔE {:.3}, above the bound of {bound}: next tilt {tilt}°, written to {}",
                    said.expected,
                    a.output.display()
                ),
                true,
            )
        }
        None if !enough => (
            format!(
                "{name}: expected mean ΔE {:.3}, above the bound of {bound}, and no pose is left: every row of the plan is measured",
                said.expected
            ),
            false,
        ),
        _ => (
            format!(
                "{name}: expected mean ΔE {:.3}, within the bound of {bound}: no further pose is needed, no plan was written",
                said.expected
            ),
            false,
        ),
    };
    printer.result(
        &text,
        &json!({
            "scene": name, "instrument": instrument.name, "adaptive": true, "expected_delta_e": said.expected, "bound": bound,
            "enough": enough, "tilt_deg": if enough { None } else { said.tilt_deg },
            "output": written.then(|| shown(&a.output)),
            "reach": { "measured": seen.measured, "exchanged": seen.exchanged, "beyond": seen.beyond },
        }),
    );
    Ok(Outcome::Done)
}
