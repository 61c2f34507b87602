//! The reliability campaigns on the command line: `make campaign [ONLY=name] [SHARE=0.1] [SEED=n]`.
//!
//! Prints every figure with value, bound, size and the command that repeats it, and writes them into `docs/reliability.md`, which keeps the figures
//! of campaigns that were not run. Exits 1 on a miss. Called with `gonio` as its first word it is the command line itself: the
//! campaigns that kill a host process start themselves so.

use std::process::ExitCode;

use gonio_tests::campaign::{CAMPAIGNS, Figure, Settings, page};

#[allow(clippy::print_stdout)] // the table is what this program is for
fn main() -> ExitCode {
    let words: Vec<_> = std::env::args_os().skip(1).collect();
    if words.first().is_some_and(|w| w == "gonio") {
        return gonio::run(words);
    }
    let words: Vec<String> = words.into_iter().map(|w| w.to_string_lossy().into_owned()).collect();
    let word = |n: usize| words.get(n).map(String::as_str).filter(|w| !w.is_empty());
    let (only, page) = (word(0), word(3));
    let (share, seed) = (word(1).unwrap_or("1").parse(), word(2).unwrap_or("20261126").parse());
    let (Ok(share), Ok(seed)) = (share, seed) else {
        eprintln!(
            "usage: campaign [NAME [SHARE [SEED [PAGE]]]], SHARE a number above 0, SEED a whole number"
        );
        return ExitCode::from(2);
    };
    let chosen: Vec<_> =
        CAMPAIGNS.iter().filter(|c| only.is_none_or(|o| o == "all" || o == c.name)).collect();
    if chosen.is_empty() {
        let names: Vec<&str> = CAMPAIGNS.iter().map(|c| c.name).collect();
        eprintln!("no campaign {:?}; there are {}", only.unwrap_or_default(), names.join(", "));
        return ExitCode::from(2);
    }
    let Ok(program) = std::env::current_exe() else {
        eprintln!("this program cannot find itself; start it by its path");
        return ExitCode::FAILURE;
    };
    let threads = std::thread::available_parallelism().map_or(1, usize::from);
    let settings =
        Settings { seed, share, timed: true, threads, program: vec![program.into(), "gonio".into()] };
    let mut missed = 0;
    for campaign in chosen {
        let command = repeat(campaign.name, share, seed);
        println!("\n{}: {}   ({command})", campaign.name, campaign.about);
        let figures: Vec<Figure> = (campaign.run)(&settings);
        for f in &figures {
            let mark = if f.met { "ok  " } else { "MISS" };
            println!("  {mark} {:<62} {:<34} bound {:<12} {}  seed {seed}", f.name, f.value, f.bound, f.size);
            missed += usize::from(!f.met);
        }
        if let Some(page) = page
            && let Err(e) =
                page::update(page.as_ref(), campaign.name, campaign.about, &command, seed, &figures)
        {
            eprintln!("{page}: {e}");
            return ExitCode::FAILURE;
        }
    }
    if missed == 0 {
        ExitCode::SUCCESS
    } else {
        println!("\n{missed} figures missed");
        ExitCode::FAILURE
    }
}

fn repeat(name: &str, share: f64, seed: u64) -> String {
    let share = if share == 1.0 { String::new() } else { format!(" SHARE={share}") };
    format!("make campaign ONLY={name}{share} SEED={seed}")
}
