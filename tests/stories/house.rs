//! The rules of the house, executed: who may depend on whom, and a map of the code that cannot lie.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("tests/ lies in the workspace").to_path_buf()
}

fn read(path: &Path) -> String {
    std::fs::read_to_string(path).unwrap_or_else(|e| panic!("{}: {e}", path.display()))
}

/// Crate, and the crates of this workspace that it may name. `*`: all.
const MAY_DEPEND_ON: &[(&str, &[&str])] = &[
    ("gonio-protocol", &[]),
    ("gonio-optics", &[]),
    ("gonio-instrument", &["optics"]),
    ("gonio-brdf", &["optics"]),
    ("gonio-fitter", &["brdf", "optics"]),
    ("gonio-driver", &["protocol", "instrument"]),
    ("gonio-recording", &["instrument"]),
    ("gonio-acquisition", &["instrument", "recording", "fitter", "brdf", "optics"]),
    ("gonio-sim", &["protocol", "instrument", "brdf", "optics"]),
    ("gonio-paint", &["fitter", "brdf", "optics"]),
    ("gonio-render", &["paint", "brdf", "optics"]),
    ("gonio-tailor", &["render", "paint", "fitter", "instrument", "brdf", "optics"]),
    ("gonio", &["*"]),
    ("gonio-hil", &["sim", "driver", "instrument", "protocol", "optics"]),
    ("gonio-tests", &["*"]),
];

/// Hardware and other libraries that a room must not know.
const MUST_NOT_KNOW: &[(&str, &[&str])] = &[
    ("gonio-protocol", &["tokio", "rustix", "serialport"]),
    ("gonio-optics", &["tokio", "rustix", "serialport", "mcap"]),
    ("gonio-instrument", &["tokio", "rustix", "serialport", "mcap", "rusb", "v4l"]),
    // hardware is reached through the driver alone
    ("gonio", &["serialport", "rusb", "nokhwa", "v4l", "aravis"]),
    ("gonio-recording", &["serialport", "rusb", "nokhwa", "v4l", "aravis"]),
    ("gonio-acquisition", &["serialport", "rusb", "nokhwa", "v4l", "aravis", "rustix"]),
];

fn manifests() -> BTreeMap<String, toml::Table> {
    let workspace: toml::Table = read(&root().join("Cargo.toml")).parse().expect("workspace manifest");
    let members = workspace["workspace"]["members"].as_array().expect("members").clone();
    members
        .iter()
        .map(|m| {
            let table: toml::Table =
                read(&root().join(m.as_str().expect("a path")).join("Cargo.toml")).parse().expect("manifest");
            (table["package"]["name"].as_str().expect("a name").to_owned(), table)
        })
        .collect()
}

fn dependencies(manifest: &toml::Table, sections: &[&str]) -> BTreeSet<String> {
    sections
        .iter()
        .filter_map(|s| manifest.get(*s).and_then(toml::Value::as_table))
        .flat_map(|t| t.keys().cloned())
        .collect()
}

#[test]
fn every_crate_depends_only_on_the_rooms_the_table_allows() {
    let allowed: BTreeMap<_, _> = MAY_DEPEND_ON.iter().copied().collect();
    for (name, manifest) in manifests() {
        let list =
            allowed.get(name.as_str()).unwrap_or_else(|| panic!("{name} is not in the dependency table"));
        if list.contains(&"*") {
            continue;
        }
        // tests of a room obey the table too: a shared bug must not hide
        let found = dependencies(&manifest, &["dependencies", "dev-dependencies", "build-dependencies"]);
        for dependency in found.iter().filter(|d| *d == "gonio" || d.starts_with("gonio-")) {
            let short = dependency.trim_start_matches("gonio-");
            assert!(list.contains(&short), "{name} depends on {dependency}; it may depend on {list:?}");
        }
    }
}

#[test]
fn no_room_knows_a_library_it_must_not_know() {
    let manifests = manifests();
    for (name, forbidden) in MUST_NOT_KNOW {
        let found = dependencies(&manifests[*name], &["dependencies", "build-dependencies"]);
        for f in *forbidden {
            assert!(!found.contains(*f), "{name} must not know {f}");
        }
    }
}

#[test]
fn every_version_is_pinned_in_one_place() {
    for (name, manifest) in manifests() {
        for section in ["dependencies", "dev-dependencies", "build-dependencies"] {
            for (dependency, value) in
                manifest.get(section).and_then(toml::Value::as_table).into_iter().flatten()
            {
                let from_workspace = value.get("workspace").and_then(toml::Value::as_bool) == Some(true);
                assert!(from_workspace, "{name}: {dependency} must say `workspace = true`");
            }
        }
        let lints = manifest.get("lints").and_then(|l| l.get("workspace")).and_then(toml::Value::as_bool);
        assert_eq!(lints, Some(true), "{name} must take the one lint table of the workspace");
    }
}

#[test]
fn the_architecture_map_names_every_folder_and_only_what_exists() {
    let map = read(&root().join("docs/ARCHITECTURE.md"));
    for member in ["firmware-protocol", "sim", "hil", "tests"].into_iter().map(str::to_owned).chain(
        std::fs::read_dir(root().join("crates"))
            .expect("crates/")
            .map(|e| format!("crates/{}", e.expect("entry").file_name().to_string_lossy())),
    ) {
        assert!(map.contains(&format!("`{member}/")), "docs/ARCHITECTURE.md does not name `{member}/`");
    }
    // every `path/like/this.rs` or `folder/` in backticks must exist
    for quoted in map.split('`').skip(1).step_by(2) {
        let looks_like_path = quoted.contains('/') && !quoted.contains([' ', '<', '*', ':', '{', '$']);
        if looks_like_path {
            assert!(
                root().join(quoted).exists(),
                "docs/ARCHITECTURE.md names `{quoted}`, which does not exist"
            );
        }
    }
}

#[test]
fn every_crate_opens_with_what_it_does() {
    let workspace: toml::Table = read(&root().join("Cargo.toml")).parse().expect("workspace manifest");
    for member in workspace["workspace"]["members"].as_array().expect("members") {
        let lib = root().join(member.as_str().expect("a path")).join("src/lib.rs");
        assert!(read(&lib).starts_with("//!"), "{} does not open with what it does", lib.display());
    }
}
