//! A native file is opened by other programs, and what these write is read.

use std::path::{Path, PathBuf};
use std::process::Command;

use gonio_brdf::formats::{self, Loaded, Target};
use gonio_brdf::models::Lambert;
use gonio_brdf::{Flag, Grid, Meaning, Measured};
use gonio_optics::Angle;

fn table() -> Measured {
    let mut table = Measured::sampled(Grid::sopp(), &Lambert { diffuse: [0.3, 0.2, 0.1] });
    table.meaning = Meaning::CellMean { lamp_half_angle: Angle::from_degrees(0.5) };
    table.sigma.fill([1e-3; 3]);
    for (i, value) in table.values.iter_mut().enumerate() {
        value[0] += i as f32 * 1e-6;
    }
    table.flag[5] = Flag::Extrapolated;
    table.attributes.insert("sample_name".to_owned(), "grün".to_owned());
    table
}

/// The interpreter that `GONIO_PYTHON` names, else `python3`.
fn python(script: &str, arguments: &[&Path]) -> Option<std::process::Output> {
    let interpreter = std::env::var_os("GONIO_PYTHON").unwrap_or_else(|| "python3".into());
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("python").join(script);
    Command::new(interpreter).arg(script).args(arguments).output().ok()
}

#[test]
fn xarray_opens_a_native_file_as_it_is_and_what_it_writes_is_read() {
    let folder = tempfile::tempdir().unwrap();
    let [native, rewritten]: [PathBuf; 2] = ["native.nc", "rewritten.nc"].map(|n| folder.path().join(n));
    let table = table();
    let saved =
        formats::save(&native, &Loaded::Table(Box::new(table.clone())), Target::Netcdf, false).unwrap();
    assert!(saved.losses.is_empty());

    let output = match python("open_native_file.py", &[&native, &rewritten]) {
        Some(o) if o.status.code() != Some(77) => o,
        _ => {
            gonio_tests::say(
                "xarray did not run: set GONIO_PYTHON to an interpreter that has xarray and scipy",
            );
            return;
        }
    };
    gonio_tests::say("xarray ran");
    let text = String::from_utf8_lossy(&output.stdout);
    assert!(output.status.success(), "{text}{}", String::from_utf8_lossy(&output.stderr));
    let found: serde_json::Value = serde_json::from_str(&text).unwrap();
    assert_eq!(found["brdf_dims"], serde_json::json!(["theta_i", "theta_o", "phi", "channel"]));
    assert_eq!((&found["value"], &found["units"]), (&"cell_mean".into(), &"degree".into()));
    assert_eq!(found["flags"], serde_json::json!([0, 2]));
    assert_eq!(found["channels"], serde_json::json!(["red", "green", "blue"]));
    let sum: f64 = table.values.iter().flatten().map(|&x| f64::from(x)).sum();
    assert!((found["brdf_sum"].as_f64().unwrap() / sum - 1.0).abs() < 1e-12);
    let here = table.values[table.grid.index(9, 18, 35)];
    for c in 0..3 {
        assert_eq!(found["brdf_at"][c].as_f64().unwrap() as f32, here[c]);
    }

    // xarray wrote it back with its dimensions in another order and without our digest
    let Loaded::Table(again) = formats::open(&rewritten).unwrap() else { panic!("not a table") };
    assert_eq!(again.values, table.values);
    assert_eq!(again.sigma, table.sigma);
    assert_eq!(again.flag, table.flag);
    assert_eq!((&again.grid, again.meaning), (&table.grid, table.meaning));
    assert_eq!(again.attributes.get("sample_name").map(String::as_str), Some("grün"));
}

#[test]
fn a_damaged_native_file_is_named_and_not_read() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scan.nc");
    let _ = formats::save(&path, &Loaded::Table(Box::new(table())), Target::Netcdf, false).unwrap();
    let mut bytes = std::fs::read(&path).unwrap();
    let middle = bytes.len() / 2;
    bytes[middle] ^= 1;
    std::fs::write(&path, bytes).unwrap();
    let message = formats::open(&path).unwrap_err().to_string();
    assert!(message.contains("scan.nc") && message.contains("digest"), "{message}");
}
