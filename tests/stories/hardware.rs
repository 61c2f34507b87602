//! Real devices named on the command line, on a machine that has none: what is missing is told, and looking breaks nothing. What happens where they
//! are plugged in is shown under an emulated machine.

use crate::command::{Bench, until};

#[test]
fn doctor_tells_what_is_there_and_what_is_wrong_on_any_machine() {
    let bench = Bench::new();
    let seen = bench.ok(&["doctor", "--json"]).json();
    for list in ["ports", "stages", "cameras", "genicam", "findings"] {
        assert!(seen[list].is_array(), "{list}: {seen}");
    }
    assert!(seen["udev"]["state"].is_string());
    // every finding says what to do
    for finding in seen["findings"].as_array().expect("findings") {
        let text = finding.as_str().expect("a sentence");
        assert!(text.contains('`') || text.contains("--") || text.contains("/dev"), "{text}");
    }
    let text = bench.ok(&["doctor"]).stdout;
    for port in seen["ports"].as_array().expect("ports") {
        assert!(text.contains(port["path"].as_str().expect("a path")), "{text}");
    }
}

#[test]
fn udev_rules_are_installed_once_and_not_over_others() {
    let bench = Bench::new();
    std::fs::create_dir(bench.path("rules")).expect("a folder");
    let install = ["doctor", "--install-udev", "--rules-folder", "rules"];
    let first = bench.ok(&[&install[..], &["--json"]].concat()).json();
    assert_eq!(first["udev"]["what"], "installed");
    let rules = String::from_utf8(bench.read("rules/70-gonio.rules")).expect("text");
    assert!(rules.contains("*:ff4701:*") && rules.contains("uaccess"));
    assert!(bench.ok(&install).stdout.contains("already"));
    bench.write("rules/70-gonio.rules", "# somebody else's\n");
    let refused = bench.run(&install);
    assert_eq!(refused.code, 2, "{}", refused.stderr);
    assert_eq!(bench.read("rules/70-gonio.rules"), b"# somebody else's\n");
    bench.ok(&[&install[..], &["--force"]].concat());
    assert_eq!(bench.read("rules/70-gonio.rules"), rules.as_bytes());
    let nowhere = bench.run(&["doctor", "--install-udev", "--rules-folder", "no/such/folder"]);
    assert!(nowhere.code == 1 && nowhere.stderr.contains("--rules-folder"), "{}", nowhere.stderr);
}

#[test]
fn absent_stages_and_cameras_are_device_faults_and_leave_nothing_behind() {
    let bench = Bench::new();
    let scan = ["scan", "--instrument", "tiny", "-o", "S.mcap"];
    for (devices, said) in [
        (["--device", "usb:1209:fff7:nobody", "--camera", "v4l:987"], "USB"),
        (["--device", "sim", "--camera", "v4l:987"], "v4l:987 is not there"),
        (["--device", "sim", "--camera", "uvc:no such serial number"], "is not there"),
    ] {
        let ran = bench.run(&[&scan[..], &devices].concat());
        assert_eq!(ran.code, 4, "{devices:?}\n{}", ran.stderr);
        let told = ran.stderr.contains(said) || ran.stderr.contains("usb:1209:fff7:nobody is not there");
        assert!(told && !ran.stderr.contains("panicked"), "{devices:?}\n{}", ran.stderr);
        assert!(!bench.path("S.mcap").exists());
    }
    for devices in [
        ["--device", "usb:1209", "--camera", "v4l:0"],
        ["--device", "usb:1209:1", "--camera", "sim"],
        ["--device", "sim", "--camera", "v4l:"],
        ["--device", "sim", "--camera", "genicam:nobody"],
    ] {
        let ran = bench.run(&[&scan[..], &devices].concat());
        assert_eq!(ran.code, 2, "{devices:?}\n{}", ran.stderr);
    }
}

#[test]
fn preview_shows_what_a_camera_sees() {
    let bench = Bench::new();
    let mut served =
        bench.start(&["sim", "--instrument", "tiny", "--pty", "stage", "--camera-socket", "cam"]);
    until("the camera's socket", || bench.path("cam").exists());
    let look = ["preview", "--camera", "sim:cam", "--instrument", "tiny", "-o", "look.png"];
    let seen = bench.ok(&[&look[..], &["--json"]].concat()).json();
    assert_eq!((seen["width"].as_u64(), seen["height"].as_u64()), (Some(160), Some(128)));
    assert_eq!(&bench.read("look.png")[1..4], b"PNG");
    assert_eq!(bench.run(&look).code, 2, "not written over");
    bench.ok(&[&look[..], &["--force", "--exposure-ms", "1"]].concat());
    let _ = served.kill();
    let _ = served.wait();
    let look = ["preview", "-o", "P.png", "--camera"];
    assert_eq!(bench.run(&[&look[..], &["v4l:987"]].concat()).code, 4);
    assert_eq!(bench.run(&[&look[..], &["sim"]].concat()).code, 2);
    assert!(!bench.path("P.png").exists());
}
