//! What a list of files, folders and `FILE#*` asks to be fitted.

use std::path::{Path, PathBuf};

use gonio_brdf::formats::{self, Format, Problem, nbrdf};

use crate::outcome::Failure;

/// Inputs in the order given, folders in the order of their names.
#[derive(Debug, Default, PartialEq, Eq)]
pub struct Inputs {
    /// To be fitted.
    pub wanted: Vec<String>,
    /// Files of a folder that hold no measurement, with why.
    pub skipped: Vec<(String, String)>,
    /// Whether more than one thing was asked for, by number, by a folder or by `#*`.
    pub many: bool,
}

/// Expands folders (not those in them) and all materials of networks.
///
/// # Errors
/// [`Failure::Usage`] for a folder that cannot be listed, or that holds no measurement at all.
pub fn expand(inputs: &[String]) -> Result<Inputs, Failure> {
    let mut out = Inputs { many: inputs.len() > 1, ..Inputs::default() };
    for input in inputs {
        let path = Path::new(input);
        if path.is_dir() {
            out.many = true;
            let before = out.wanted.len();
            for file in files(path)? {
                sort_in(&file, &mut out);
            }
            if out.wanted.len() == before {
                return Err(Failure::usage(format!("{input} holds no file that can be fitted")));
            }
        } else if let Some(file) = input.strip_suffix("#*") {
            out.many = true;
            out.wanted.extend(materials(Path::new(file)).map_err(Failure::usage)?);
        } else {
            out.wanted.push(input.clone());
        }
    }
    Ok(out)
}

fn files(folder: &Path) -> Result<Vec<PathBuf>, Failure> {
    let list = std::fs::read_dir(folder)
        .and_then(|entries| entries.map(|e| e.map(|e| e.path())).collect::<Result<Vec<_>, _>>())
        .map_err(|e| Failure::usage(format!("folder {} cannot be listed: {e}", folder.display())))?;
    let mut files: Vec<PathBuf> = list.into_iter().filter(|p| p.is_file()).collect();
    files.sort();
    Ok(files)
}

/// A file of a folder: its content decides. Damaged files stay in, so that their fit fails and is told.
fn sort_in(file: &Path, out: &mut Inputs) {
    let name = file.to_string_lossy().into_owned();
    match formats::identify(file) {
        Ok(Format::NeuralBrdf) => match materials(file) {
            Ok(all) => out.wanted.extend(all),
            Err(_) => out.wanted.push(name),
        },
        Ok(Format::Model) => out.skipped.push((name, "holds a model already".to_owned())),
        Ok(_) => out.wanted.push(name),
        Err(e) => match e.problem {
            Problem::Unknown { .. } => out.skipped.push((name, "content is not known".to_owned())),
            _ => out.wanted.push(name),
        },
    }
}

/// `FILE#NAME` for every name of the names file beside.
fn materials(file: &Path) -> Result<Vec<String>, String> {
    let names = file.with_extension("names.txt");
    let say = |e: &dyn std::fmt::Display| format!("{}: {e}", names.display());
    let text = formats::read_file(&names).map_err(|e| e.to_string())?;
    let bytes = std::fs::metadata(file).map_err(|e| format!("{}: {e}", file.display()))?.len();
    let names = nbrdf::names(&text, bytes).map_err(|e| say(&e))?;
    Ok(names.iter().map(|n| format!("{}#{n}", file.display())).collect())
}

/// A name for files from an input: letters, digits, `-`, `_`, `.` of its last part; each only once.
#[must_use]
pub fn file_names(inputs: &[String]) -> Vec<String> {
    let mut taken = std::collections::BTreeSet::new();
    inputs
        .iter()
        .map(|input| {
            let (file, material) =
                input.rsplit_once('#').map_or((input.as_str(), None), |(f, m)| (f, Some(m)));
            let stem = Path::new(file).file_stem().unwrap_or_default().to_string_lossy();
            let base: String = material
                .map_or_else(|| stem.clone().into_owned(), str::to_owned)
                .chars()
                .map(|c| if c.is_ascii_alphanumeric() || "-_.".contains(c) { c } else { '_' })
                .collect();
            let mut name = base.clone();
            let mut k = 2;
            while !taken.insert(name.clone()) {
                name = format!("{base}-{k}");
                k += 1;
            }
            name
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_folder_gives_its_measurements_and_says_what_it_left_out() {
        let dir = tempfile::tempdir().expect("a folder");
        let write = |name: &str, text: &str| std::fs::write(dir.path().join(name), text).expect("written");
        write("b.csv", "theta_i_deg,theta_o_deg,phi_deg,r,g,b\n10,10,180,1,1,1\n");
        write("a.json", r#"{"model":"lambert","diffuse":[0.1,0.1,0.1]}"#);
        write("notes.bin", "\u{1}\u{2}nothing that is known");
        let folder = dir.path().to_string_lossy().into_owned();
        let found = expand(std::slice::from_ref(&folder)).expect("a measurement");
        assert_eq!(found.wanted, [format!("{folder}/b.csv")]);
        assert_eq!(found.skipped.len(), 2);
        assert!(found.many);
        std::fs::remove_file(dir.path().join("b.csv")).expect("removed");
        assert!(expand(&[folder]).is_err());
        assert!(!expand(&["x.csv".to_owned()]).expect("one").many);
    }

    #[test]
    fn names_are_kept_apart() {
        let inputs = ["a/x.nc", "b/x.csv", "m.f32#red paint", "m.f32#x"].map(str::to_owned);
        assert_eq!(file_names(&inputs), ["x", "x-2", "red_paint", "x-3"]);
    }
}
