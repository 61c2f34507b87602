//! The reliability campaigns, small: every promise is looked at in every test run. At full size they are `make campaign`.

use gonio_tests::campaign::{CAMPAIGNS, Figure, Settings};

fn small(name: &str) {
    let settings = Settings {
        seed: 1,
        share: 1e-5,
        timed: false,
        threads: 2,
        program: vec![env!("CARGO_BIN_EXE_gonio_under_test").into()],
    };
    let campaign = CAMPAIGNS.iter().find(|c| c.name == name).expect("a campaign");
    let figures = (campaign.run)(&settings);
    let missed: Vec<&Figure> = figures.iter().filter(|f| !f.met).collect();
    assert!(missed.is_empty(), "{name}: {missed:#?}");
}

#[test]
fn no_damaged_frame_is_taken_for_another() {
    small("decoder");
}

#[test]
fn no_command_is_lost_or_executed_twice_on_a_bad_line() {
    small("link");
}

#[test]
fn a_device_whose_host_is_gone_stops_by_itself() {
    small("safety");
}

#[test]
fn a_pulled_plug_costs_a_pose_at_most() {
    small("returning");
}

#[test]
fn a_killed_host_goes_on_to_the_same_result() {
    small("kill");
}

#[test]
fn a_damaged_session_never_lies() {
    small("damage");
}

#[test]
fn no_input_makes_a_reader_panic() {
    small("fuzz");
}

#[test]
fn scan_after_scan_under_faults_loses_no_frame() {
    small("soak");
}

#[test]
fn the_time_left_is_told() {
    small("remaining");
}
