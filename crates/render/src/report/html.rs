//! The report as HTML text.

use std::fmt::Write as _;

use super::base64::encode_into;
use super::section::{Block, Figure, Section};
use super::style::SHEET;
use super::{Report, Weight};
use crate::draw::canvas::PIXELS_PER_POINT;
use crate::picture::PictureError;

/// Text with the five signs of HTML written as entities; control characters, which HTML forbids, become the replacement sign.
pub(super) fn escaped(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => out.push_str("&amp;"),
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '"' => out.push_str("&quot;"),
            '\'' => out.push_str("&#39;"),
            '\n' | '\t' => out.push(c),
            c if c.is_control() => out.push('\u{fffd}'),
            c => out.push(c),
        }
    }
    out
}

pub(super) fn document(report: &Report) -> Result<String, PictureError> {
    let title = escaped(&report.title);
    let mut out = String::new();
    let _ = write!(
        out,
        "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n<title>{title}</title>\n\
         <style>{SHEET}</style>\n</head>\n<body>\n<main>\n<header>\n<h1>{title}</h1>\n"
    );
    if !report.subtitle.is_empty() {
        let _ = writeln!(out, "<p class=\"subtitle\">{}</p>", escaped(&report.subtitle));
    }
    contents(&mut out, &report.sections);
    out.push_str("</header>\n");
    key_figures(&mut out, report);
    notices(&mut out, report);
    for (k, s) in report.sections.iter().enumerate() {
        section(&mut out, k, s)?;
    }
    if !report.footer.is_empty() {
        let _ = writeln!(out, "<footer>{}</footer>", escaped(&report.footer));
    }
    out.push_str("</main>\n</body>\n</html>\n");
    Ok(out)
}

fn contents(out: &mut String, sections: &[Section]) {
    if sections.len() > 1 {
        out.push_str("<nav aria-label=\"Contents\">");
        for (k, s) in sections.iter().enumerate() {
            let _ = write!(out, "<a href=\"#s{k}\">{}</a> ", escaped(&s.heading));
        }
        out.push_str("</nav>\n");
    }
}

fn key_figures(out: &mut String, report: &Report) {
    if report.key_figures.is_empty() {
        return;
    }
    out.push_str("<dl class=\"figures\">\n");
    for f in &report.key_figures {
        let note =
            if f.note.is_empty() { String::new() } else { format!("<small>{}</small>", escaped(&f.note)) };
        let _ =
            writeln!(out, "<div><dt>{}</dt><dd>{}{note}</dd></div>", escaped(&f.label), escaped(&f.value));
    }
    out.push_str("</dl>\n");
}

fn notices(out: &mut String, report: &Report) {
    if report.notices.is_empty() {
        return;
    }
    let mut ordered: Vec<_> = report.notices.iter().collect();
    ordered.sort_by_key(|n| std::cmp::Reverse(n.weight));
    out.push_str("<ul class=\"notices\" aria-label=\"Warnings and notes\">\n");
    for n in ordered {
        let (class, word) = match n.weight {
            Weight::Note => ("note", "Note"),
            Weight::Warning => ("warning", "Warning"),
            Weight::Failure => ("failure", "Failure"),
        };
        let _ = writeln!(out, "<li class=\"{class}\"><b>{word}</b> {}</li>", escaped(&n.text));
    }
    out.push_str("</ul>\n");
}

fn section(out: &mut String, k: usize, s: &Section) -> Result<(), PictureError> {
    let _ = writeln!(out, "<section id=\"s{k}\">\n<h2>{}</h2>", escaped(&s.heading));
    if !s.intro.is_empty() {
        let _ = writeln!(out, "<p>{}</p>", escaped(&s.intro));
    }
    for block in &s.blocks {
        match block {
            Block::Facts(facts) => {
                out.push_str("<table class=\"facts\"><tbody>\n");
                for f in facts {
                    let (name, value) = (escaped(&f.name), escaped(&f.value));
                    let _ = writeln!(out, "<tr><th scope=\"row\">{name}</th><td>{value}</td></tr>");
                }
                out.push_str("</tbody></table>\n");
            }
            Block::Table { caption, head, rows } => table(out, caption, head, rows),
            Block::Pictures(figures) => {
                for f in figures {
                    figure(out, f)?;
                }
            }
        }
    }
    out.push_str("</section>\n");
    Ok(())
}

fn table(out: &mut String, caption: &str, head: &[String], rows: &[Vec<String>]) {
    out.push_str("<div class=\"wide\"><table>\n");
    if !caption.is_empty() {
        let _ = writeln!(out, "<caption>{}</caption>", escaped(caption));
    }
    out.push_str("<thead><tr>");
    for h in head {
        let _ = write!(out, "<th scope=\"col\">{}</th>", escaped(h));
    }
    out.push_str("</tr></thead>\n<tbody>\n");
    for row in rows {
        out.push_str("<tr>");
        for k in 0..head.len().max(row.len()) {
            let cell = escaped(row.get(k).map_or("", String::as_str));
            let _ = if k == 0 {
                write!(out, "<th scope=\"row\">{cell}</th>")
            } else {
                write!(out, "<td>{cell}</td>")
            };
        }
        out.push_str("</tr>\n");
    }
    out.push_str("</tbody></table></div>\n");
}

fn figure(out: &mut String, f: &Figure) -> Result<(), PictureError> {
    let png = f.picture.to_png()?;
    let points = |pixels: u32| (f64::from(pixels) / PIXELS_PER_POINT).round();
    let _ = write!(
        out,
        "<figure>\n<img alt=\"{}\" width=\"{}\" height=\"{}\" src=\"data:image/png;base64,",
        escaped(&f.alt),
        points(f.picture.width()),
        points(f.picture.height())
    );
    encode_into(out, &png);
    let _ = writeln!(out, "\">\n<figcaption>{}</figcaption>\n</figure>", escaped(&f.caption));
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::super::{Fact, KeyFigure, Notice};
    use super::*;
    use crate::picture::Picture;

    fn report() -> Report {
        let nasty = "<script>alert('x')</script> & \"q\"";
        let picture = Picture::new(4, 2, [1, 2, 3]);
        Report {
            title: format!("Scan {nasty}"),
            subtitle: nasty.into(),
            key_figures: vec![KeyFigure { label: nasty.into(), value: nasty.into(), note: nasty.into() }],
            notices: vec![
                Notice { weight: Weight::Note, text: format!("later {nasty}") },
                Notice { weight: Weight::Failure, text: format!("sooner {nasty}") },
            ],
            sections: vec![
                Section {
                    heading: nasty.into(),
                    intro: nasty.into(),
                    blocks: vec![
                        Block::Facts(vec![Fact::new(nasty, nasty)]),
                        Block::Table {
                            caption: nasty.into(),
                            head: vec![nasty.into(); 2],
                            rows: vec![vec![nasty.into()], vec![nasty.into(); 2]],
                        },
                    ],
                },
                Section {
                    heading: "Pictures".into(),
                    intro: String::new(),
                    blocks: vec![Block::Pictures(vec![Figure {
                        name: "one".into(),
                        picture,
                        caption: nasty.into(),
                        alt: format!("{nasty}\u{0}"),
                    }])],
                },
            ],
            footer: nasty.into(),
        }
    }

    /// Names of the tags in order, without attributes.
    fn tags(html: &str) -> Vec<&str> {
        html.split('<')
            .skip(1)
            .map(|t| t.split(|c: char| c.is_whitespace() || c == '>').next().unwrap_or(""))
            .collect()
    }

    #[test]
    fn nothing_that_was_put_in_becomes_markup() {
        let html = report().to_html().unwrap();
        assert!(!html.contains("<script") && !html.contains('\u{0}'));
        // title twice; subtitle; three of the key figure; two notices; heading twice; intro; two facts; caption;
        // two heads; three cells; alt; figcaption; footer
        assert_eq!(
            html.matches("&lt;script&gt;alert(&#39;x&#39;)&lt;/script&gt; &amp; &quot;q&quot;").count(),
            22
        );
    }

    #[test]
    fn every_tag_that_opens_closes() {
        let html = report().to_html().unwrap();
        let mut open: Vec<&str> = Vec::new();
        for t in tags(&html) {
            if let Some(name) = t.strip_prefix('/') {
                assert_eq!(open.pop(), Some(name));
            } else if !["!DOCTYPE", "meta", "img"].contains(&t) {
                open.push(t);
            }
        }
        assert!(open.is_empty(), "{open:?}");
    }

    #[test]
    fn the_file_asks_for_nothing_from_outside() {
        let html = report().to_html().unwrap();
        for word in ["http:", "https:", "url(", "@import", "<link", "src=\"/"] {
            assert!(!html.contains(word), "{word}");
        }
        assert!(html.contains("src=\"data:image/png;base64,iVBORw0KGgo"));
    }

    #[test]
    fn the_heaviest_notice_comes_first() {
        let html = report().to_html().unwrap();
        assert!(html.find("sooner").unwrap() < html.find("later").unwrap());
    }

    #[test]
    fn the_body_has_the_structure_agreed() {
        let html = report().to_html().unwrap();
        let body = html.split("<body>").nth(1).unwrap();
        let words: Vec<&str> = tags(body).into_iter().filter(|t| !t.starts_with('/')).collect();
        assert_eq!(
            words.join(" "),
            "main header h1 p nav a a dl div dt dd small ul li b li b \
             section h2 p table tbody tr th td div table caption thead tr th th tbody tr th td tr th td \
             section h2 figure img figcaption footer"
        );
    }
}
