//! How long a scan will still take, learnt from its own actions.
//!
//! A pose is a move, its frames, and the rest (shutter, sensors, journal). A move takes a power of its distance, a frame `a + b·exposure`, both fitted to
//! those so far. Of the frames of a pose the longest counts most: its darkest pixels need it, as a power p near 1 of what they would need by geometry
//! alone, up to the longest the camera can; p is fitted as soon as two tilts have been seen, drawn towards 1. What the shorter frames add is in
//! proportion, as the bracketing lays them, and the rest is its mean. Dark frames and time spent waiting, paused or suspended count in none of these.

use std::time::Duration;

use gonio_instrument::Pose;

use super::Action;

/// Power of the exposure by what is needed, before anything is known, and its weight in units of the spread of the logarithm squared.
const BY_NEED: (f64, f64) = (1.0, 0.1);
/// The same of a move's time by its distance: between 1 at full speed and ½ while speeding up.
const BY_DISTANCE: (f64, f64) = (0.7, 0.1);
/// Distance that takes as long as any shorter one, degrees.
const LEAST_DEG: f64 = 0.1;

/// What the actions so far took.
#[derive(Clone, Debug)]
pub(super) struct Timing {
    /// Longest exposure the camera can, s.
    limit_s: f64,
    /// Distance in degrees and seconds of each move.
    moves: Vec<(f64, f64)>,
    /// Exposure and seconds of each frame.
    frames: Vec<(f64, f64)>,
    poses: Vec<Done>,
    at: Option<Pose>,
    under_way: Option<Done>,
}

/// A pose that is done or under way.
#[derive(Clone, Copy, Debug)]
struct Done {
    pose: Pose,
    /// What its darkest pixels need by geometry, relative to other poses.
    need: f64,
    /// What they were found to need, s.
    needed: f64,
    /// Lit frames.
    frames: f64,
    /// Sum of their exposures, s.
    exposures: f64,
    /// The longest of them, s.
    longest: f64,
    /// Seconds that its lit frames took.
    capture: f64,
    /// Seconds of everything else but the move and the dark frames.
    other: f64,
}

impl Timing {
    /// Nothing seen yet of a camera that exposes at most `limit_s` seconds.
    pub(super) const fn new(limit_s: f64) -> Self {
        Self { limit_s, moves: Vec::new(), frames: Vec::new(), poses: Vec::new(), at: None, under_way: None }
    }

    /// A move from where the holder stood to `pose` took so long; it begins the pose, whose darkest pixels need so much.
    pub(super) fn moved(&mut self, pose: Pose, need: f64, took: Duration) {
        if let Some(from) = self.at {
            self.moves.push((distance(from, pose), took.as_secs_f64()));
        }
        self.at = Some(pose);
        self.under_way = Some(Done {
            pose,
            need,
            needed: 0.0,
            frames: 0.0,
            exposures: 0.0,
            longest: 0.0,
            capture: 0.0,
            other: 0.0,
        });
    }

    /// Any other action of a pose took so long.
    pub(super) fn acted(&mut self, action: &Action, took: Duration) {
        let Some(pose) = &mut self.under_way else { return };
        match action {
            Action::Capture { exposure, light: true } => {
                let exposure = exposure.as_secs_f64();
                self.frames.push((exposure, took.as_secs_f64()));
                pose.frames += 1.0;
                pose.exposures += exposure;
                pose.longest = pose.longest.max(exposure);
                pose.capture += took.as_secs_f64();
            }
            // dark frames are taken once; switching the lamp on again and re-arming belong to no pose
            Action::Capture { .. } | Action::Lamp(_) | Action::Rearm | Action::Home => {}
            _ => pose.other += took.as_secs_f64(),
        }
    }

    /// The pose is done; its darkest pixels needed `needed_s`, if that is known.
    pub(super) fn done(&mut self, needed_s: Option<f64>) {
        let done = self.under_way.take();
        self.poses.extend(done.map(|d| Done { needed: needed_s.unwrap_or(d.longest), ..d }));
    }

    /// The pose was given up: what it took teaches nothing.
    pub(super) fn given_up(&mut self) {
        self.under_way = None;
    }

    /// Time for `todo` (poses and what they need by geometry), the pose under way first; `None` before a pose is done.
    pub(super) fn remaining(&self, todo: &[(Pose, f64)]) -> Option<Duration> {
        if self.poses.is_empty() {
            return None;
        }
        let n = self.poses.len() as f64;
        let mean = |of: fn(&Done) -> f64| self.poses.iter().map(of).sum::<f64>() / n;
        let other = mean(|p| p.other);
        let frames = mean(|p| p.frames);
        // what all exposures of a pose are to its longest
        let sum = mean(|p| p.exposures) / mean(|p| p.longest).max(f64::MIN_POSITIVE);
        let needed: Vec<(f64, f64)> = self.poses.iter().map(|p| (p.need, p.needed)).collect();
        let needed = power(&needed, BY_NEED);
        let motion = power(&self.moves, BY_DISTANCE);
        let (read_out, per_second) = line(&self.frames, 1e-6);
        let capture = |need: f64| {
            let longest = (needed.0 * need.powf(needed.1)).min(self.limit_s);
            read_out.max(0.0) * frames + per_second * sum * longest
        };
        let mut seconds = 0.0;
        let mut at = self.at;
        let mut rest = todo;
        if let (Some(done), [first, others @ ..]) = (self.under_way, todo)
            && done.pose == first.0
        {
            seconds += (capture(done.need) - done.capture).max(0.0) + (other - done.other).max(0.0);
            rest = others;
        }
        for &(pose, need) in rest {
            let far = at.map_or(0.0, |from| distance(from, pose));
            seconds += motion.0 * far.powf(motion.1) + capture(need) + other;
            at = Some(pose);
        }
        Duration::try_from_secs_f64(seconds).ok()
    }
}

/// Factor and power of `y = factor·x^power`: the power by least squares in logarithms, drawn towards the prior; the factor so that the sum of all is right,
/// since it is a sum that will be waited for.
fn power(points: &[(f64, f64)], (prior, weight): (f64, f64)) -> (f64, f64) {
    let points = || points.iter().filter(|p| p.0 > 0.0 && p.1 > 0.0);
    let n = points().count() as f64;
    if n == 0.0 {
        return (0.0, prior);
    }
    let (x_mean, y_mean) =
        (points().map(|p| p.0.ln()).sum::<f64>() / n, points().map(|p| p.1.ln()).sum::<f64>() / n);
    let spread: f64 = points().map(|p| (p.0.ln() - x_mean).powi(2)).sum();
    let common: f64 = points().map(|p| (p.0.ln() - x_mean) * (p.1.ln() - y_mean)).sum();
    let power = ((common + weight * prior) / (spread + weight)).clamp(0.0, 3.0);
    let factor = points().map(|p| p.1).sum::<f64>() / points().map(|p| p.0.powf(power)).sum::<f64>();
    (factor, power)
}

/// Least squares `a + b·x` with b not negative; their mean where the x spread less than `least` in square.
fn line(points: &[(f64, f64)], least: f64) -> (f64, f64) {
    if points.is_empty() {
        return (0.0, 0.0);
    }
    let n = points.len() as f64;
    let (x_mean, y_mean) =
        (points.iter().map(|m| m.0).sum::<f64>() / n, points.iter().map(|m| m.1).sum::<f64>() / n);
    let spread: f64 = points.iter().map(|m| (m.0 - x_mean).powi(2)).sum();
    let common: f64 = points.iter().map(|m| (m.0 - x_mean) * (m.1 - y_mean)).sum();
    let b = if spread > least { (common / spread).max(0.0) } else { 0.0 };
    (y_mean - b * x_mean, b)
}

/// Both axes turn at once: the longer way counts.
fn distance(from: Pose, to: Pose) -> f64 {
    let tilt = (from.tilt.degrees() - to.tilt.degrees()).abs();
    let spin = (from.spin.degrees() - to.spin.degrees()).abs();
    tilt.max(spin).max(LEAST_DEG)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A scan whose moves take 0.05 s times the 0.8th power of the degrees, its frames 0.03 s and their exposures, the longest of them 1 s over the cosine up to the limit,
    /// the others a fifth each of the one after; the rest half a second. The first pose takes dark frames as well.
    fn scan(poses: &[Pose], up_to: usize, limit_s: f64) -> (Timing, f64) {
        let mut timing = Timing::new(limit_s);
        let mut left = 0.0;
        for (i, &pose) in poses.iter().enumerate() {
            let far = if i > 0 { distance(poses[i - 1], pose) } else { 50.0 };
            let motion = 0.05 * far.powf(0.8);
            let longest = need(pose).min(limit_s);
            let exposures: Vec<f64> = (0..4).map(|k| longest / 5f64.powi(k)).collect();
            if i >= up_to {
                left += motion + exposures.iter().map(|e| 0.03 + e).sum::<f64>() + 0.5;
                continue;
            }
            timing.moved(pose, need(pose), Duration::from_secs_f64(motion));
            if i == 0 {
                let dark = Action::Capture { exposure: Duration::from_secs(9), light: false };
                timing.acted(&dark, Duration::from_secs(9));
            }
            for e in exposures {
                let frame = Action::Capture { exposure: Duration::from_secs_f64(e), light: true };
                timing.acted(&frame, Duration::from_secs_f64(0.03 + e));
            }
            timing.acted(&Action::EndPose, Duration::from_secs_f64(0.5));
            timing.done(Some(need(pose)));
        }
        (timing, left)
    }

    fn need(pose: Pose) -> f64 {
        1.0 / pose.tilt.radians().cos()
    }

    fn ahead(poses: &[Pose]) -> Vec<(Pose, f64)> {
        poses.iter().map(|p| (*p, need(*p))).collect()
    }

    fn plan() -> Vec<Pose> {
        (0..40).map(|n| Pose::from_degrees(f64::from(n / 4) * 8.0, f64::from(n % 4) * 30.0)).collect()
    }

    #[test]
    fn a_tenth_of_a_scan_tells_the_rest() {
        let poses = plan();
        for limit_s in [100.0, 2.0, 0.5] {
            let (timing, left) = scan(&poses, 4, limit_s);
            let told = timing.remaining(&ahead(&poses[4..])).expect("poses are done").as_secs_f64();
            assert!((told / left - 1.0).abs() < 0.05, "limit {limit_s} s: {told} s told, {left} s left");
        }
    }

    #[test]
    fn nothing_is_told_before_a_pose_is_done_and_nothing_is_left_at_the_end() {
        let poses = [Pose::from_degrees(10.0, 0.0), Pose::from_degrees(20.0, 0.0)];
        assert_eq!(Timing::new(2.0).remaining(&ahead(&poses)), None);
        assert_eq!(scan(&poses, 2, 2.0).0.remaining(&[]), Some(Duration::ZERO));
    }
}
