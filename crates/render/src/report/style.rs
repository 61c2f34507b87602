//! The style sheet of the report: light, readable from a phone to a sheet of paper.

pub(super) const SHEET: &str = r#"
:root { color-scheme: light; --ink: #22262b; --muted: #5d6670; --line: #dde1e6; --wash: #f6f7f9; --accent: #0072b2; }
* { box-sizing: border-box; }
html { font-size: 16px; -webkit-text-size-adjust: 100%; }
body { margin: 0; color: var(--ink); background: #fff; font-family: system-ui, "Segoe UI", Roboto, "Helvetica Neue", "Noto Sans", "DejaVu Sans", Arial, sans-serif; line-height: 1.5; }
main { max-width: 58rem; margin: 0 auto; padding: 2.5rem 1.25rem 3rem; }
header { border-bottom: 2px solid var(--ink); padding-bottom: 1.25rem; margin-bottom: 1.5rem; }
h1 { font-size: 2rem; line-height: 1.2; margin: 0; letter-spacing: -0.01em; overflow-wrap: anywhere; }
.subtitle { color: var(--muted); margin: .4rem 0 0; font-size: 1.05rem; overflow-wrap: anywhere; }
h2 { font-size: 1.3rem; line-height: 1.3; margin: 2.5rem 0 .6rem; padding-top: .2rem; }
p { margin: .5rem 0 .9rem; max-width: 46rem; }
.figures { display: grid; grid-template-columns: repeat(auto-fit, minmax(10rem, 1fr)); gap: .75rem; margin: 1.5rem 0; }
.figures div { background: var(--wash); border: 1px solid var(--line); border-radius: 6px; padding: .7rem .9rem; }
.figures dt { color: var(--muted); font-size: .85rem; }
.figures dd { margin: 0; font-size: 1.35rem; font-weight: 600; font-variant-numeric: tabular-nums; }
.figures dd small { display: block; font-size: .8rem; font-weight: 400; color: var(--muted); }
.notices { list-style: none; padding: 0; margin: 1.25rem 0; }
.notices li { border-left: 4px solid var(--accent); background: #eef5fa; padding: .55rem .9rem; margin: .5rem 0; border-radius: 0 4px 4px 0; }
.notices li.warning { border-color: #b87d00; background: #fdf5e3; }
.notices li.failure { border-color: #b3261e; background: #fcecea; }
.notices b { margin-right: .4rem; }
nav { font-size: .95rem; margin: 1rem 0 0; }
nav a { color: var(--accent); margin-right: 1.1rem; white-space: nowrap; text-decoration: none; }
nav a:hover { text-decoration: underline; }
.wide { overflow-x: auto; }
table { border-collapse: collapse; margin: .6rem 0 1.2rem; font-size: .95rem; font-variant-numeric: tabular-nums; }
caption { text-align: left; color: var(--muted); font-size: .88rem; padding-bottom: .35rem; }
th, td { padding: .34rem 1.4rem .34rem 0; border-bottom: 1px solid var(--line); text-align: right; vertical-align: baseline; white-space: nowrap; }
th:first-child, td:first-child { text-align: left; white-space: normal; min-width: 7rem; }
thead th { border-bottom: 1.5px solid var(--ink); font-weight: 600; }
tbody th { font-weight: 400; }
table.facts { width: 100%; }
table.facts th { width: 15rem; color: var(--muted); vertical-align: top; }
table.facts td { text-align: left; white-space: normal; overflow-wrap: anywhere; }
figure { margin: 1.4rem 0 2rem; break-inside: avoid; }
figure img { display: block; max-width: 100%; height: auto; border: 1px solid var(--line); border-radius: 4px; background: #fff; }
figcaption { color: var(--muted); font-size: .92rem; margin-top: .5rem; max-width: 46rem; }
footer { border-top: 1px solid var(--line); margin-top: 3rem; padding-top: .8rem; color: var(--muted); font-size: .88rem; overflow-wrap: anywhere; }
@media (max-width: 34rem) { h1 { font-size: 1.55rem; } table.facts th { width: 8.5rem; } th, td { padding-right: .8rem; } }
@media print {
  @page { margin: 16mm 15mm; }
  html { font-size: 10.5pt; }
  main { max-width: none; padding: 0; }
  nav { display: none; }
  .wide { overflow: visible; }
  h2 { break-after: avoid; }
  tr, .figures div, .notices li { break-inside: avoid; }
  figure img { max-height: 235mm; width: auto; border: 0; }
  .figures div, .notices li { -webkit-print-color-adjust: exact; print-color-adjust: exact; }
}
"#;
