//! Folders written, read, and broken.

use std::path::Path;

use gonio_optics::Angle;

use super::{BtfFolderError, INDEX_NAME, SliceFormat, picture, read_btf_folder, write_btf_folder};
use crate::{FlakeBtf, car_paint::Through};

fn angles(n: u32, step: f64) -> Vec<Angle> {
    (0..n).map(|k| Angle::from_degrees(f64::from(k) * step)).collect()
}

fn btf() -> FlakeBtf {
    let texels = (0..2 * 3 * 5 * 4).map(|k| [0.01 * k as f32, 0.5, 1.0 / (1.0 + k as f32)]).collect();
    FlakeBtf::new(angles(2, 5.5), angles(3, 7.25), [5, 4], texels).expect("sound")
}

fn write(folder: &Path, format: SliceFormat) {
    write_btf_folder(folder, &btf(), 0.02, Some(1.5), Through::TwoWay, format, false).expect("written");
}

fn fails(folder: &Path) -> String {
    read_btf_folder(folder).expect_err("unsound").to_string()
}

#[test]
fn slices_come_back_to_the_bit_or_to_the_format() {
    for (format, tolerance) in
        [(SliceFormat::Exr, 0.0), (SliceFormat::ExrHalf, 1.0 / 2048.0), (SliceFormat::Png, 1.0 / 65535.0)]
    {
        let dir = tempfile::tempdir().expect("room");
        write(dir.path(), format);
        let read = read_btf_folder(dir.path()).expect("read");
        assert_eq!((read.btf.size(), read.texel_mm, read.coat_index), ([5, 4], 0.02, Some(1.5)));
        assert_eq!(read.through, Through::TwoWay);
        for (a, b) in read.btf.half().iter().zip(btf().half()) {
            assert!((a.degrees() - b.degrees()).abs() < 1e-12);
        }
        for (a, b) in read.btf.slices().zip(btf().slices()) {
            let top = b.iter().flatten().fold(0.0f32, |m, v| m.max(*v));
            for (a, b) in a.iter().flatten().zip(b.iter().flatten()) {
                assert!((a - b).abs() <= tolerance * top, "{format:?}: {a} {b}");
            }
        }
        // the TOML itself names the folder as well
        assert!(read_btf_folder(&dir.path().join(INDEX_NAME)).is_ok());
        let again = write_btf_folder(dir.path(), &btf(), 0.02, None, Through::TwoWay, format, false);
        assert!(matches!(again, Err(BtfFolderError::Exists(_))));
    }
}

#[test]
fn what_is_wrong_with_a_slice_is_a_sentence_with_its_file() {
    let dir = tempfile::tempdir().expect("room");
    let folder = dir.path();
    write(folder, SliceFormat::Exr);
    let file = folder.join("slice_01_02.exr");
    let sound = std::fs::read(&file).expect("there");
    let put = |texels: &[[f32; 3]], size: [usize; 2]| {
        std::fs::write(&file, picture::encode_exr(texels, size, false).expect("encoded")).expect("written");
        fails(folder)
    };
    let mut texels = vec![[0.5f32; 3]; 20];
    let message = put(&texels[..10], [5, 2]);
    assert!(message.contains("5 × 2 texels, the first slice has 5 × 4"), "{message}");
    texels[7][1] = f32::NAN;
    let message = put(&texels, [5, 4]);
    assert!(message.contains("slice_01_02.exr") && message.contains("x = 2, y = 1"), "{message}");
    let message = put(&[[0.1, -0.2, 0.1]; 20], [5, 4]);
    assert!(message.contains("-2.000e-1 1/sr in channel 1"), "{message}");
    std::fs::write(&file, b"").expect("written");
    assert!(fails(folder).contains("empty"));
    std::fs::write(&file, b"GIF89a").expect("written");
    assert!(fails(folder).contains("neither OpenEXR nor PNG"));
    std::fs::write(&file, &sound[..sound.len() / 2]).expect("written");
    assert!(fails(folder).contains("cannot be read"));
    let eight = image::DynamicImage::ImageRgb8(image::RgbImage::new(5, 4));
    eight.save_with_format(&file, image::ImageFormat::Png).expect("written");
    assert!(fails(folder).contains("8 bits"));
    std::fs::remove_file(&file).expect("removed");
    assert!(fails(folder).contains("slice_01_02.exr"));
}

#[test]
fn lists_that_do_not_fit_are_refused() {
    let dir = tempfile::tempdir().expect("room");
    let folder = dir.path();
    write(folder, SliceFormat::Png);
    let toml = folder.join(INDEX_NAME);
    let text = std::fs::read_to_string(&toml).expect("there");
    let with = |changed: &str| {
        std::fs::write(&toml, changed).expect("written");
        fails(folder)
    };
    let last = text.rfind("[[slice]]").expect("slices");
    let message = with(&text[..last]);
    assert!(
        message.contains("1 of 6 slices are missing") && message.contains("5.5") && message.contains("14.5"),
        "{message}"
    );
    let message = with(&format!("{text}{}", &text[last..]));
    assert!(message.contains("two slices"), "{message}");
    let message = with(&text[..text.find("[[slice]]").expect("slices")]);
    assert!(message.contains("no slice"), "{message}");
    for (from, to, word) in [
        ("texel_mm = 0.02", "texel_mm = -1.0", "texel_mm = -1"),
        ("coat_index = 1.5", "coat_index = 0.9", "coat_index = 0.9"),
        ("two-way", "three-way", "three-way"),
        ("version = 1", "version = 9", "version = 9"),
        ("gonio-flake-btf", "gonio-plan", "gonio-plan"),
        ("half_deg = 5.5", "half_deg = 95.5", "half_deg = 95.5"),
        ("texel_mm", "texel_m", "texel_m"),
    ] {
        let message = with(&text.replacen(from, to, 1));
        assert!(message.contains(word), "{message}");
    }
}

#[test]
fn noise_below_nothing_and_black_slices_are_told() {
    let dir = tempfile::tempdir().expect("room");
    let mut texels: Vec<[f32; 3]> = vec![[0.2; 3]; 24];
    texels[3] = [0.1, -0.01, 0.1];
    texels[12..].fill([0.0; 3]);
    let btf = FlakeBtf::new(angles(1, 1.0), angles(2, 5.0), [4, 3], texels).expect("sound");
    write_btf_folder(dir.path(), &btf, 0.1, None, Through::RefractedOnly, SliceFormat::Exr, false)
        .expect("written");
    let read = read_btf_folder(dir.path()).expect("read");
    assert_eq!((read.through, read.coat_index), (Through::RefractedOnly, None));
    let told = read.notes.join("\n");
    assert!(told.contains("1 texels in 1 slices") && told.contains("slice_00_01.exr"), "{told}");
    let png = dir.path().join("png");
    let refused = write_btf_folder(&png, &btf, 0.1, None, Through::TwoWay, SliceFormat::Png, false)
        .expect_err("below 0")
        .to_string();
    assert!(refused.contains("write OpenEXR"), "{refused}");
}
