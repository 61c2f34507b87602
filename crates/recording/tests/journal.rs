//! What a journal keeps, and what is left of it after truncation, flipped bits and power failures.

mod made;

use std::time::Duration;

use gonio_instrument::{Camera as _, Cancel, Stage as _};
use gonio_recording::{
    Direction, Level, RecordingError, Session, Writer, WriterOptions, check_space, free_space, replay,
    space_needed,
};
use made::{exposure, header, options, pose, write};

#[test]
fn what_is_written_comes_back_bit_for_bit() {
    let dir = tempfile::tempdir().expect("a folder");
    let path = dir.path().join("s.mcap");
    let h = header();
    let wanted = write(&path, &h, 160, 128, 3);
    let s = Session::open(&path).expect("opens");
    assert!(s.finished());
    assert_eq!(s.findings(), []);
    assert_eq!(s.instrument().expect("instrument"), h.instrument);
    assert_eq!(s.plan().expect("plan"), h.plan);
    assert_eq!(s.sample().expect("sample"), h.sample);
    assert_eq!(s.certificate().expect("certificate"), h.certificate);
    assert_eq!(s.devices().expect("devices"), h.devices);
    assert_eq!(s.provenance().expect("provenance"), h.provenance);
    assert_eq!(s.header().expect("the whole head"), h);
    let got: Vec<_> = s.poses().collect::<Result<_, _>>().expect("whole");
    assert_eq!(got, wanted);
    let events: Vec<_> = s.events().map(|e| (e.level, e.text)).collect();
    assert_eq!(events.len(), 4, "{events:?}");
    assert_eq!(events[0], (Level::Info, "begun".to_owned()));
    let wire: Vec<_> = s.wire().collect();
    assert_eq!(wire.len(), 3);
    assert_eq!(wire[1].direction, Direction::FromDevice);
    assert_eq!(wire[1].bytes, [1, 0, 255]);
}

#[test]
fn an_existing_session_is_not_overwritten_unless_forced() {
    let dir = tempfile::tempdir().expect("a folder");
    let path = dir.path().join("s.mcap");
    write(&path, &header(), 8, 8, 1);
    let before = std::fs::read(&path).expect("readable");
    let e = Writer::create(&path, &header(), WriterOptions::default()).expect_err("refused");
    assert_eq!(e, RecordingError::Exists { path: path.clone() });
    assert_eq!(std::fs::read(&path).expect("readable"), before);
    let forced = WriterOptions { overwrite: true, ..options() };
    Writer::create(&path, &header(), forced).expect("forced").finish().expect("finished");
    assert_eq!(Session::open(&path).expect("opens").pose_indices().count(), 0);
}

#[test]
fn a_session_is_read_while_it_is_written() {
    let dir = tempfile::tempdir().expect("a folder");
    let path = dir.path().join("s.mcap");
    let mut w = Writer::create(&path, &header(), options()).expect("created");
    for i in 0..4 {
        w.begin_pose(i, pose(i), pose(i)).expect("begun");
        w.frame(&exposure(16, 8, i, 0)).expect("taken");
        // in mid-pose: what is done is there, what is not is not
        let s = Session::open(&path).expect("opens");
        let seen: Vec<u32> = s.poses().map(|p| p.expect("whole").index).collect();
        assert_eq!(seen, (0..i).collect::<Vec<_>>());
        assert!(!s.finished());
        w.end_pose().expect("done");
    }
    w.finish().expect("finished");
    assert_eq!(Session::open(&path).expect("opens").poses().count(), 4);
}

#[test]
fn calls_out_of_order_and_frames_of_the_wrong_size_are_refused() {
    let dir = tempfile::tempdir().expect("a folder");
    let mut w = Writer::create(&dir.path().join("s.mcap"), &header(), options()).expect("created");
    assert!(matches!(w.frame(&exposure(8, 8, 0, 0)), Err(RecordingError::Order { .. })));
    assert!(matches!(w.end_pose(), Err(RecordingError::Order { .. })));
    w.begin_pose(0, pose(0), pose(0)).expect("begun");
    assert!(matches!(w.begin_pose(1, pose(1), pose(1)), Err(RecordingError::Order { .. })));
    let mut bad = exposure(8, 8, 0, 0);
    bad.frame.pixels.pop();
    assert_eq!(
        w.frame(&bad).expect_err("63 pixels"),
        RecordingError::BadFrame { width: 8, height: 8, pixels: 63 }
    );
    w.frame(&exposure(8, 8, 0, 0)).expect("a good one after all that");
    w.end_pose().expect("ended");
    w.finish().expect("finished");
}

#[test]
fn a_pose_given_up_is_kept_as_frames_but_not_as_a_pose() {
    let dir = tempfile::tempdir().expect("a folder");
    let path = dir.path().join("s.mcap");
    let mut w = Writer::create(&path, &header(), options()).expect("created");
    w.begin_pose(0, pose(0), pose(0)).expect("begun");
    w.frame(&exposure(8, 8, 0, 0)).expect("taken");
    w.give_up_pose().expect("given up");
    w.begin_pose(1, pose(1), pose(1)).expect("begun");
    w.frame(&exposure(8, 8, 1, 0)).expect("taken");
    w.end_pose().expect("ended");
    w.begin_pose(2, pose(2), pose(2)).expect("begun");
    w.finish().expect("finished in mid-pose");
    let s = Session::open(&path).expect("opens");
    assert_eq!(s.pose_indices().collect::<Vec<_>>(), [1]);
    assert!(matches!(s.pose(0), Err(RecordingError::NoSuchPose { index: 0, .. })));
}

#[test]
fn after_a_power_failure_every_pose_that_was_done_is_there() {
    let dir = tempfile::tempdir().expect("a folder");
    let path = dir.path().join("s.mcap");
    let mut w = Writer::create(&path, &header(), options()).expect("created");
    for i in 0..2 {
        w.begin_pose(i, pose(i), pose(i)).expect("begun");
        w.frame(&exposure(8, 8, i, 0)).expect("taken");
        w.end_pose().expect("done");
    }
    w.begin_pose(2, pose(2), pose(2)).expect("begun");
    w.frame(&exposure(8, 8, 2, 0)).expect("taken");
    w.abandon();
    let s = Session::open(&path).expect("opens");
    assert!(!s.finished());
    assert_eq!(s.poses().filter(Result::is_ok).count(), 2);
}

#[test]
fn a_replay_answers_as_the_devices_did() {
    let dir = tempfile::tempdir().expect("a folder");
    let path = dir.path().join("s.mcap");
    let h = header();
    let wanted = write(&path, &h, 16, 8, 3);
    let (mut stage, mut camera) = replay::replay(Session::open(&path).expect("opens")).expect("replays");
    assert_eq!(stage.identity(), h.devices.stage);
    assert_eq!(camera.info(), h.devices.camera);
    let cancel = Cancel::new();
    stage.home(&cancel).expect("homed");
    for p in &wanted {
        assert_eq!(stage.move_to(p.commanded, &cancel).expect("recorded"), p.readback);
        for e in &p.exposures {
            stage.set_shutter(e.shutter_open).expect("set");
            assert_eq!(camera.capture(e.frame.exposure, &cancel).expect("recorded"), e.frame);
            assert_eq!(stage.sensors().expect("read").lamp_monitor, e.lamp_monitor);
        }
        let more = camera.capture(p.exposures[0].frame.exposure, &cancel).expect_err("each frame once");
        assert!(more.to_string().contains("holds no frame"), "{more}");
    }
    assert!(stage.move_to(pose(7), &cancel).expect_err("not planned").to_string().contains("holds no pose"));
    assert!(camera.capture(Duration::from_secs(9), &cancel).is_err());
}

#[test]
fn an_output_that_cannot_be_written_says_why() {
    let dir = tempfile::tempdir().expect("a folder");
    let path = dir.path().join("no").join("s.mcap");
    let e = Writer::create(&path, &header(), options()).expect_err("no folder");
    assert_eq!(e, RecordingError::NoFolder { path });
    let e = Writer::create(dir.path(), &header(), WriterOptions { overwrite: true, ..options() });
    assert!(matches!(e, Err(RecordingError::Io { .. })), "a folder is no file");
    let camera = header().instrument.camera;
    let plan = header().plan;
    let needed = space_needed(&plan, &camera);
    // 12 poses of 12 exposures of 160 × 128 pixels
    assert!(needed > 12 * 12 * 160 * 128 * 2);
    assert!(free_space(&dir.path().join("s.mcap")).expect("known") > 0);
    let endless = gonio_instrument::Plan { repeats: u32::MAX, ..plan };
    let e = check_space(&dir.path().join("s.mcap"), &endless, &camera).expect_err("no disk is so large");
    assert!(matches!(e, RecordingError::NotEnoughSpace { needed: n, free, .. } if n > free), "{e}");
}
