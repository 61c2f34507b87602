//! How long a scan will still take, learnt from its own actions.
//!
//! A pose is a move, its exposures, and the rest (shutter, sensors, journal). A move takes `a + b·distance`, fitted to the moves so far. Exposures of
//! a pose grow with its tilt as `(1/cos θ)^p`: the sample gets less light, and brackets reach further down; p is fitted as soon as
//! two tilts have been seen, from 1 before. The rest is its mean. Time spent waiting, paused or suspended counts in none of them.

use std::time::Duration;

use gonio_instrument::Pose;

use super::Action;

/// Least cosine, so that a grazing tilt does not promise an eternity.
const LEAST_COS: f64 = 0.05;
/// Weight of the exponent before anything is known, in units of the spread of ln(1/cos θ) squared, and its value.
const PRIOR: (f64, f64) = (0.3, 1.0);

/// What the actions so far took.
#[derive(Clone, Debug, Default)]
pub(super) struct Timing {
    /// Distance in degrees and seconds of each move.
    moves: Vec<(f64, f64)>,
    /// Tilt, capture seconds and other seconds of each pose that is done.
    poses: Vec<(Pose, f64, f64)>,
    at: Option<Pose>,
    under_way: Option<(Pose, f64, f64)>,
    moved: bool,
}

impl Timing {
    /// A move from where the holder stood to `pose` took so long; it begins the pose.
    pub(super) fn moved(&mut self, pose: Pose, took: Duration) {
        if let Some(from) = self.at {
            self.moves.push((distance(from, pose), took.as_secs_f64()));
        }
        self.at = Some(pose);
        self.under_way = Some((pose, 0.0, 0.0));
        self.moved = true;
    }

    /// Any other action of a pose took so long.
    pub(super) fn acted(&mut self, action: &Action, took: Duration) {
        let Some((_, capture, other)) = &mut self.under_way else { return };
        match action {
            Action::Capture { .. } => *capture += took.as_secs_f64(),
            // switching the lamp on again and re-arming belong to no pose
            Action::Lamp(_) | Action::Rearm | Action::Home => {}
            _ => *other += took.as_secs_f64(),
        }
    }

    /// The pose is done.
    pub(super) fn done(&mut self) {
        self.poses.extend(self.under_way.take());
        self.moved = false;
    }

    /// The pose was given up: what it took teaches nothing.
    pub(super) fn given_up(&mut self) {
        self.under_way = None;
        self.moved = false;
    }

    /// Time for `todo`, the pose under way first; `None` before a pose is done.
    pub(super) fn remaining(&self, todo: &[Pose]) -> Option<Duration> {
        if self.poses.is_empty() {
            return None;
        }
        let n = self.poses.len() as f64;
        let other = self.poses.iter().map(|p| p.2).sum::<f64>() / n;
        let (scale, exponent) = self.capture();
        let (a, b) = self.motion();
        let capture = |pose: Pose| scale * depth(pose).powf(exponent);
        let mut sum = 0.0;
        let mut at = self.at;
        let mut rest = todo;
        if let (Some((pose, c, o)), [first, others @ ..]) = (self.under_way, todo)
            && pose == *first
        {
            sum += (capture(pose) - c).max(0.0) + (other - o).max(0.0);
            rest = others;
        }
        for &pose in rest {
            let far = at.map_or(0.0, |from| distance(from, pose));
            sum += (a + b * far).max(0.0) + capture(pose) + other;
            at = Some(pose);
        }
        Duration::try_from_secs_f64(sum).ok()
    }

    /// Capture seconds at normal incidence, and the exponent: least squares in logarithms, drawn towards the prior.
    fn capture(&self) -> (f64, f64) {
        // the first pose holds dark frames as well: it counts only while there is no other
        let known = if self.poses.len() > 1 { self.poses.get(1..).unwrap_or(&[]) } else { &self.poses };
        let n = known.len() as f64;
        let xs = || known.iter().map(|p| depth(p.0).ln());
        let ys = || known.iter().map(|p| p.1.max(1e-6).ln());
        let (x_mean, y_mean) = (xs().sum::<f64>() / n, ys().sum::<f64>() / n);
        let spread: f64 = xs().map(|x| (x - x_mean).powi(2)).sum();
        let common: f64 = xs().zip(ys()).map(|(x, y)| (x - x_mean) * (y - y_mean)).sum();
        let (weight, prior) = PRIOR;
        let exponent = ((common + weight * prior) / (spread + weight)).clamp(0.0, 3.0);
        // means, not means of logarithms: it is the sum that will be waited for
        let scale = known.iter().map(|p| p.1).sum::<f64>()
            / known.iter().map(|p| depth(p.0).powf(exponent)).sum::<f64>();
        (scale, exponent)
    }

    /// Least squares of the moves' times over their distances.
    fn motion(&self) -> (f64, f64) {
        let n = self.moves.len() as f64;
        if self.moves.is_empty() {
            return (0.0, 0.0);
        }
        let (x_mean, y_mean) = (
            self.moves.iter().map(|m| m.0).sum::<f64>() / n,
            self.moves.iter().map(|m| m.1).sum::<f64>() / n,
        );
        let spread: f64 = self.moves.iter().map(|m| (m.0 - x_mean).powi(2)).sum();
        let common: f64 = self.moves.iter().map(|m| (m.0 - x_mean) * (m.1 - y_mean)).sum();
        let b = if spread > 1.0 { (common / spread).max(0.0) } else { 0.0 };
        (y_mean - b * x_mean, b)
    }
}

/// Both axes turn at once: the longer way counts.
fn distance(from: Pose, to: Pose) -> f64 {
    let tilt = (from.tilt.degrees() - to.tilt.degrees()).abs();
    let spin = (from.spin.degrees() - to.spin.degrees()).abs();
    tilt.max(spin)
}

fn depth(pose: Pose) -> f64 {
    1.0 / pose.tilt.radians().cos().max(LEAST_COS)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A scan whose moves take 0.3 s and 0.01 s a degree, its exposures 2 s over the cosine, the rest half a second.
    fn scan(poses: &[Pose], up_to: usize) -> (Timing, f64) {
        let mut timing = Timing::default();
        let mut left = 0.0;
        for (i, &pose) in poses.iter().enumerate() {
            let far = if i > 0 { distance(poses[i - 1], pose) } else { 50.0 };
            let (motion, capture, other) = (0.3 + 0.01 * far, 2.0 * depth(pose), 0.5);
            if i >= up_to {
                left += motion + capture + other;
                continue;
            }
            timing.moved(pose, Duration::from_secs_f64(motion));
            let exposure = Action::Capture { exposure: Duration::ZERO, light: true };
            timing.acted(&exposure, Duration::from_secs_f64(capture));
            timing.acted(&Action::EndPose, Duration::from_secs_f64(other));
            timing.done();
        }
        (timing, left)
    }

    #[test]
    fn a_tenth_of_a_scan_tells_the_rest() {
        let poses: Vec<Pose> =
            (0..40).map(|n| Pose::from_degrees(f64::from(n / 4) * 8.0, f64::from(n % 4) * 30.0)).collect();
        let (timing, left) = scan(&poses, 4);
        let told = timing.remaining(&poses[4..]).expect("poses are done").as_secs_f64();
        assert!((told / left - 1.0).abs() < 0.05, "{told} s told, {left} s left");
    }

    #[test]
    fn nothing_is_told_before_a_pose_is_done_and_nothing_is_left_at_the_end() {
        let poses = [Pose::from_degrees(10.0, 0.0), Pose::from_degrees(20.0, 0.0)];
        assert_eq!(Timing::default().remaining(&poses), None);
        assert_eq!(scan(&poses, 2).0.remaining(&[]), Some(Duration::ZERO));
    }
}
