//! What came out of a run: every test that was asked for must have said that it passed.

use std::fmt::Write;

use super::machine::Ended;
use crate::line::Figure;

/// A test's result.
#[derive(Clone, Debug)]
struct Told {
    name: String,
    failure: Option<String>,
}

/// What was told so far, and what was asked for.
#[derive(Clone, Debug)]
pub struct Verdict {
    wanted: Vec<String>,
    told: Vec<Told>,
    figures: Vec<Figure>,
}

impl Verdict {
    /// Nothing told yet.
    #[must_use]
    pub fn new(wanted: &[&str]) -> Verdict {
        let wanted = wanted.iter().map(|w| (*w).to_owned()).collect();
        Verdict { wanted, told: vec![], figures: vec![] }
    }

    /// One more test is asked for.
    pub fn want(&mut self, name: &str) {
        self.wanted.push(name.to_owned());
    }

    /// A test has ended.
    pub fn result(&mut self, name: String, seconds: f64, failure: Option<String>) {
        match &failure {
            None => crate::log(&format!("ok      {name} ({seconds:.1} s)")),
            Some(why) => crate::log(&format!("FAILED  {name} ({seconds:.1} s): {why}")),
        }
        self.told.push(Told { name, failure });
    }

    /// Something was measured.
    pub fn figure(&mut self, figure: Figure) {
        self.figures.push(figure);
    }

    /// What is wrong with the run, line by line; nothing if it is good.
    #[must_use]
    pub fn faults(&self, ended: &Ended) -> Vec<String> {
        let mut faults = Vec::new();
        for name in &self.wanted {
            match self.told.iter().find(|t| t.name == *name) {
                None => faults.push(format!("{name} was not run")),
                Some(Told { failure: Some(why), .. }) => faults.push(format!("{name}: {why}")),
                Some(_) => {}
            }
        }
        for f in &self.figures {
            if let Some(bound) = f.bound
                // no number is within no bound
                && f.value.partial_cmp(&bound).is_none_or(std::cmp::Ordering::is_gt)
            {
                faults.push(format!(
                    "{}: {} {u} where at most {bound} {u} are allowed",
                    f.name,
                    f.value,
                    u = f.unit
                ));
            }
        }
        match ended {
            Ended::Status(0) => {}
            Ended::Status(code) => faults.push(format!("the guest ended with exit code {code}")),
            Ended::Silent(why) => faults.push(why.clone()),
            Ended::TooLate(longest) => {
                faults.push(format!("the machine did not end within {longest:.0?} and was switched off"));
            }
        }
        faults
    }

    /// The figures as a table.
    #[must_use]
    pub fn table(&self) -> String {
        let mut text = String::new();
        for f in &self.figures {
            let bound = f.bound.map_or(String::from("-"), |b| format!("<= {b}"));
            let _ = writeln!(text, "{:<58} {:>10.2} {:<6} {bound:<9} {}", f.name, f.value, f.unit, f.from);
        }
        text
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn figure(value: f64) -> Figure {
        Figure { name: "f".into(), value, unit: "ms".into(), bound: Some(100.0), from: String::new() }
    }

    #[test]
    fn what_was_not_run_or_not_said_is_a_fault() {
        let mut v = Verdict::new(&["a", "b"]);
        v.result("a".into(), 1.0, None);
        assert_eq!(v.faults(&Ended::Status(0)), ["b was not run"]);
        v.result("b".into(), 1.0, None);
        assert!(v.faults(&Ended::Status(0)).is_empty());
        assert_eq!(v.faults(&Ended::Status(1)).len(), 1);
        assert_eq!(v.faults(&Ended::Silent("x".into())).len(), 1);
        v.figure(figure(99.0));
        assert!(v.faults(&Ended::Status(0)).is_empty());
        v.figure(figure(101.0));
        v.figure(figure(f64::NAN));
        assert_eq!(v.faults(&Ended::Status(0)).len(), 2);
    }
}
