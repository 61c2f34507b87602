//! The page that keeps the figures: each campaign has a section between two marks, which a run replaces; everything else is left as it is.

use std::path::Path;

use super::Figure;

/// Writes the figures of one campaign into the page; a section that is not there yet is added at the end.
///
/// # Errors
/// The system's reason where the page cannot be read or written.
pub fn update(
    page: &Path,
    name: &str,
    about: &str,
    command: &str,
    seed: u64,
    figures: &[Figure],
) -> std::io::Result<()> {
    let text = std::fs::read_to_string(page)?;
    std::fs::write(page, replaced(&text, name, &section(name, about, command, seed, figures)))
}

fn section(name: &str, about: &str, command: &str, seed: u64, figures: &[Figure]) -> String {
    let mut out = format!("### {name}\n\n{}. `{command}`, seed {seed}.\n\n", capital(about));
    out += "| figure | value | bound | met | of |\n|---|---|---|---|---|\n";
    for f in figures {
        let met = match (f.bound.is_empty(), f.met) {
            (true, _) => "",
            (false, true) => "yes",
            (false, false) => "**no**",
        };
        let bound = if f.bound.is_empty() { "–" } else { &f.bound };
        out += &format!("| {} | {} | {bound} | {met} | {} |\n", f.name, f.value, f.size);
    }
    out
}

fn capital(text: &str) -> String {
    let mut characters = text.chars();
    characters.next().map_or_else(String::new, |c| c.to_uppercase().chain(characters).collect())
}

fn replaced(text: &str, name: &str, section: &str) -> String {
    let (begin, end) = (format!("<!-- {name} -->\n"), format!("<!-- end of {name} -->\n"));
    match (text.find(&begin), text.find(&end)) {
        (Some(from), Some(to)) if from < to => {
            format!("{}{begin}{section}{}", &text[..from], &text[to..])
        }
        _ => format!("{text}\n{begin}{section}{end}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_section_is_replaced_and_the_rest_kept() {
        let page = "# Page\n\nwords\n";
        let figure = |value| Figure::exactly("lost", value, 0, "10 of them");
        let once = replaced(page, "link", &section("link", "a link", "make", 7, &[figure(0)]));
        let both = replaced(&once, "kill", &section("kill", "a kill", "make", 7, &[figure(0)]));
        let again = replaced(&both, "link", &section("link", "a link", "make", 7, &[figure(3)]));
        assert!(again.starts_with(page) && again.contains("| lost | 3 | 0 | **no** | 10 of them |"));
        assert!(again.contains("### kill") && again.matches("### link").count() == 1);
        assert_eq!(again.matches("| lost | 0 | 0 | yes |").count(), 1);
    }
}
