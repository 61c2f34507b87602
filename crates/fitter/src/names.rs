//! Names of fitted parameters: those of the keys in `model.json`, with `_r`, `_g`, `_b` for channels and `lobe1_` … where there are more lobes than one.

const DIFFUSE: [&str; 3] = ["diffuse_r", "diffuse_g", "diffuse_b"];
const SPECULAR: [&str; 3] = ["specular_r", "specular_g", "specular_b"];
const LOBES: [[&str; 3]; 3] = [
    ["lobe1_specular_r", "lobe1_specular_g", "lobe1_specular_b"],
    ["lobe2_specular_r", "lobe2_specular_g", "lobe2_specular_b"],
    ["lobe3_specular_r", "lobe3_specular_g", "lobe3_specular_b"],
];
const OF_LOBES: [(&str, [&str; 3]); 4] = [
    ("alpha", ["lobe1_alpha", "lobe2_alpha", "lobe3_alpha"]),
    ("r0", ["lobe1_r0", "lobe2_r0", "lobe3_r0"]),
    ("exponent", ["lobe1_exponent", "lobe2_exponent", "lobe3_exponent"]),
    ("lean_deg", ["lobe1_lean_deg", "lobe2_lean_deg", "lobe3_lean_deg"]),
];

/// A parameter of one of `count` lobes.
pub(crate) fn of_lobe(name: &'static str, lobe: u8, count: u8) -> &'static str {
    if count < 2 {
        return name;
    }
    OF_LOBES
        .iter()
        .find(|(n, _)| *n == name)
        .and_then(|(_, all)| all.get(lobe as usize))
        .copied()
        .unwrap_or(name)
}

/// The colours of part `part` of `parts`; `alone`: the model has one term.
pub(crate) fn colours(part: usize, parts: usize, alone: bool) -> [&'static str; 3] {
    match part {
        0 => DIFFUSE,
        _ if alone || parts <= 2 => SPECULAR,
        k => LOBES.get(k - 1).copied().unwrap_or(SPECULAR),
    }
}
