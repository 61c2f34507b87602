//! Our files in the hands of others: MCAP's own Rust reader, and the Python one where it is installed.

mod made;

use std::path::PathBuf;
use std::process::Command;

use made::{header, write};
use sha2::{Digest as _, Sha256};

#[test]
fn the_stock_rust_reader_with_every_check_on_reads_every_message() {
    let dir = tempfile::tempdir().expect("a folder");
    let path = dir.path().join("s.mcap");
    write(&path, &header(), 160, 128, 3);
    let bytes = std::fs::read(&path).expect("readable");
    let options = mcap::sans_io::LinearReaderOptions::default()
        .with_prevalidate_chunk_crcs(true)
        .with_validate_data_section_crc(true)
        .with_validate_summary_section_crc(true);
    let mut reader = mcap::sans_io::LinearReader::new_with_options(options);
    let mut rest = &bytes[..];
    let mut counts = std::collections::BTreeMap::<u8, u32>::new();
    while let Some(event) = reader.next_event() {
        match event.expect("every CRC holds") {
            mcap::sans_io::LinearReadEvent::ReadRequest(n) => {
                let n = n.min(rest.len());
                reader.insert(n).copy_from_slice(&rest[..n]);
                reader.notify_read(n);
                rest = &rest[n..];
            }
            mcap::sans_io::LinearReadEvent::Record { opcode, data } => {
                mcap::parse_record(opcode, data).expect("well formed");
                *counts.entry(opcode).or_default() += 1;
            }
        }
    }
    // 3 poses with 3 images and 3 records, a begin, an end, an event and wire bytes each, and the opening event
    assert_eq!(counts[&mcap::records::op::MESSAGE], 3 * (3 + 3 + 2 + 1 + 1) + 1);
    assert_eq!(counts[&0x80], 4, "a seal for the head and for each pose");
    let summary = mcap::Summary::read(&bytes).expect("readable").expect("there");
    let stats = summary.stats.as_ref().expect("there");
    assert_eq!((stats.chunk_count, stats.message_count, stats.attachment_count), (3, 31, 8));
    for a in &summary.attachment_indexes {
        mcap::read::attachment(&bytes, a).expect("its CRC holds");
    }
    for c in &summary.chunk_indexes {
        for (channel, entries) in summary.read_message_indexes(&bytes, c).expect("indexed") {
            for e in entries {
                let m = summary.seek_message(&bytes, c, &e).expect("where the index says");
                assert_eq!(m.channel.id, channel.id);
            }
        }
    }
}

/// The interpreter to try: `GONIO_PYTHON`, else `python3`.
fn python() -> String {
    std::env::var("GONIO_PYTHON").unwrap_or_else(|_| "python3".to_owned())
}

#[test]
fn the_python_reader_decodes_every_frame() {
    let python = python();
    let importable = Command::new(&python)
        .args(["-c", "import mcap, mcap_protobuf"])
        .output()
        .is_ok_and(|o| o.status.success());
    if !importable {
        assert!(std::env::var_os("GONIO_PYTHON").is_none(), "{python} cannot import mcap and mcap_protobuf");
        eprintln!("did not run: {python} has no packages mcap and mcap-protobuf-support");
        return;
    }
    let dir = tempfile::tempdir().expect("a folder");
    let path = dir.path().join("s.mcap");
    let wanted = write(&path, &header(), 160, 128, 2);
    let script = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("tests/python/read_session.py");
    let out = Command::new(&python).arg(script).arg(&path).output().expect("runs");
    assert!(out.status.success(), "{}", String::from_utf8_lossy(&out.stderr));
    let got: serde_json::Value = serde_json::from_slice(&out.stdout).expect("one JSON object");
    let digests: Vec<String> = wanted
        .iter()
        .flat_map(|p| &p.exposures)
        .map(|e| {
            let bytes: Vec<u8> = e.frame.pixels.iter().flat_map(|p| p.to_le_bytes()).collect();
            Sha256::digest(bytes).iter().map(|b| format!("{b:02x}")).collect()
        })
        .collect();
    assert_eq!(got["image_sha256"], serde_json::json!(digests));
    assert_eq!(got["stated_sha256"], serde_json::json!(digests));
    assert_eq!(got["size"], serde_json::json!([160, 128]));
    assert_eq!(got["encoding"], "mono16");
    assert_eq!(got["events"], serde_json::json!(["begun", "µ", "µ"]));
    assert_eq!(got["poses_done"], serde_json::json!([0, 1]));
    assert_eq!(got["lamp_monitor"], wanted[1].exposures[2].lamp_monitor);
    assert_eq!(
        got["temperatures"],
        serde_json::json!([21.7, null, 21.7 + 2.0 / 3.0, 21.7, null, 21.7 + 2.0 / 3.0])
    );
    let names = got["attachments"].as_array().expect("a list");
    assert!(names.iter().any(|n| n == "instrument.toml") && names.iter().any(|n| n == "certificate.json"));
}
