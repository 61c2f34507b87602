use proptest::prelude::*;

use super::*;
use crate::formats::Problem;
use crate::{Flag, Grid, Meaning, Measured};
use gonio_optics::Angle;

fn table() -> Measured {
    let grid = Grid {
        theta_i_deg: vec![0.0, 30.0],
        theta_o_deg: vec![0.0, 2.5, 75.0],
        phi_deg: vec![0.0, 90.0, 170.0, 180.0],
    };
    let mut m = Measured::empty(grid, Meaning::CellMean { lamp_half_angle: Angle::from_degrees(0.5) });
    let n = m.grid.len();
    for i in 0..n {
        m.values[i] = [i as f32 * 0.37, -(i as f32), 1e-20 + i as f32];
        m.sigma[i] = [0.01 * i as f32; 3];
        m.flag[i] = [Flag::Measured, Flag::Filled, Flag::Extrapolated, Flag::Invalid][i % 4];
    }
    m.base = Some(vec![[0.25; 3]; n]);
    m.base_single_pass = Some(vec![[0.125; 3]; n]);
    m.node = Some(vec![[0.5; 3]; n]);
    m.sigma_parts.insert("shot".to_owned(), vec![[0.125; 3]; n]);
    m.attributes.insert("sample_id".to_owned(), "Prüfblech 7".to_owned());
    m.attributes.insert("sample_note".to_owned(), String::new());
    m
}

#[test]
fn a_table_comes_back_as_it_was_and_its_bytes_are_always_the_same() {
    let m = table();
    let bytes = write(&m).unwrap();
    assert_eq!(bytes, write(&m.clone()).unwrap());
    assert_eq!(read(&bytes).unwrap(), m);
    let mut node = m;
    node.meaning = Meaning::Node;
    assert_eq!(read(&write(&node).unwrap()).unwrap(), node);
}

#[test]
fn every_single_flipped_bit_is_found() {
    let bytes = write(&table()).unwrap();
    let mut damaged = bytes.clone();
    for k in 0..bytes.len() * 8 {
        damaged[k / 8] ^= 1 << (k % 8);
        assert!(read(&damaged).is_err(), "bit {} of byte {}", k % 8, k / 8);
        damaged[k / 8] = bytes[k / 8];
    }
}

#[test]
fn every_truncation_is_found() {
    let bytes = write(&table()).unwrap();
    for n in 0..bytes.len() {
        assert!(read(&bytes[..n]).is_err(), "{n} bytes");
    }
}

#[test]
fn what_does_not_belong_into_a_file_is_refused() {
    let refused = |change: &dyn Fn(&mut Measured)| {
        let mut m = table();
        change(&mut m);
        matches!(write(&m), Err(Problem::Unsuitable { .. }))
    };
    assert!(refused(&|m| m.values[0][1] = f32::NAN));
    assert!(refused(&|m| m.sigma.truncate(1)));
    assert!(refused(&|m| m.grid.phi_deg[1] = -1.0));
    assert!(refused(&|m| drop(m.attributes.insert("gonio_digest".to_owned(), String::new()))));
    assert!(refused(&|m| drop(m.attributes.insert("a/b".to_owned(), String::new()))));
    assert!(refused(&|m| drop(m.attributes.insert(String::new(), String::new()))));
}

/// A file as another program writes it: no digest, doubles, other order of dimensions, record dimension, radians.
fn foreign(version: u8) -> Vec<u8> {
    let wide = version == 5;
    let mut b = b"CDF".to_vec();
    b.push(version);
    let count = |b: &mut Vec<u8>, n: u64| {
        if wide { b.extend(n.to_be_bytes()) } else { b.extend((n as u32).to_be_bytes()) }
    };
    let name = |b: &mut Vec<u8>, s: &str| {
        count(b, s.len() as u64);
        b.extend(s.as_bytes());
        b.resize(b.len().div_ceil(4) * 4, 0);
    };
    let list = |b: &mut Vec<u8>, tag: u32, n: u64| {
        b.extend(tag.to_be_bytes());
        count(b, n);
    };
    count(&mut b, 3); // records
    list(&mut b, 10, 4);
    for (dim, len) in [("channel", 3), ("theta_o", 2), ("theta_i", 1), ("phi", 0)] {
        name(&mut b, dim);
        count(&mut b, len);
    }
    list(&mut b, 0, 0);
    // data: theta_i at the end of the header, then theta_o, then records of (phi, brdf)
    let sizes = [8u64, 16, 8, 48];
    let offset_width = if version == 1 { 4 } else { 8 };
    let mut places = Vec::new();
    list(&mut b, 11, 4);
    for (k, (var, dims)) in
        [("theta_i", vec![2u64]), ("theta_o", vec![1]), ("phi", vec![3]), ("brdf", vec![3, 0, 1, 2])]
            .into_iter()
            .enumerate()
    {
        name(&mut b, var);
        count(&mut b, dims.len() as u64);
        dims.iter().for_each(|&d| count(&mut b, d));
        if k < 3 {
            list(&mut b, 12, 1);
            name(&mut b, "units");
            b.extend(2u32.to_be_bytes());
            name(&mut b, if k == 0 { "rad" } else { "degrees" });
        } else {
            list(&mut b, 0, 0);
        }
        b.extend(6u32.to_be_bytes());
        count(&mut b, sizes[k]);
        places.push(b.len());
        b.resize(b.len() + offset_width, 0);
    }
    let mut at = b.len() as u64;
    for (k, place) in places.into_iter().enumerate() {
        let bytes = at.to_be_bytes();
        b[place..place + offset_width].copy_from_slice(&bytes[8 - offset_width..]);
        at += sizes[k];
    }
    b.extend(std::f64::consts::FRAC_PI_6.to_be_bytes());
    [10.0f64, 20.0].iter().for_each(|x| b.extend(x.to_be_bytes()));
    for p in 0..3u32 {
        b.extend((f64::from(p) * 90.0).to_be_bytes());
        for c in 0..3u32 {
            for o in 0..2u32 {
                let x = f64::from(p * 100 + c * 10 + o);
                b.extend(if x == 121.0 { f64::NAN.to_be_bytes() } else { x.to_be_bytes() });
            }
        }
    }
    b
}

#[test]
fn files_of_other_programs_are_read_in_all_three_versions() {
    for version in [1, 2, 5] {
        let m = read(&foreign(version)).unwrap();
        assert!((m.grid.theta_i_deg[0] - 30.0).abs() < 1e-12);
        assert_eq!(m.grid.phi_deg, [0.0, 90.0, 180.0]);
        assert_eq!(m.meaning, Meaning::Node);
        assert_eq!(m.values[m.grid.index(0, 1, 2)], [201.0, 211.0, 221.0]);
        assert_eq!(m.flag[m.grid.index(0, 1, 1)], Flag::Invalid);
        assert_eq!(m.flag.iter().filter(|&&f| f == Flag::Measured).count(), 5);
    }
}

#[test]
fn counts_larger_than_the_file_cost_no_memory() {
    // a grid of 2^20 nodes along each axis would take 2^60 cells
    let mut b = foreign(2);
    let at = b.windows(7).position(|w| w == b"channel").unwrap() + 8;
    b[at..at + 4].copy_from_slice(&0x7fff_ffffu32.to_be_bytes());
    assert!(read(&b).is_err());
    let mut b = foreign(2);
    b[4..8].copy_from_slice(&0x7fff_fff0u32.to_be_bytes());
    assert!(read(&b).is_err());
}

proptest! {
    #[test]
    fn damaged_files_never_panic_and_ours_are_never_read_silently(
        flips in prop::collection::vec((any::<prop::sample::Index>(), 1u8..=255), 1..12),
        cut in any::<prop::sample::Index>(),
        truncate in any::<bool>(),
        version in prop::sample::select(vec![0u8, 1, 2, 5]),
    ) {
        let ours = version == 0;
        let bytes = if ours { write(&table()).unwrap() } else { foreign(version) };
        let mut damaged = bytes.clone();
        for (at, mask) in flips {
            damaged[at.index(bytes.len())] ^= mask;
        }
        if truncate {
            damaged.truncate(cut.index(bytes.len()));
        }
        let read = read(&damaged);
        prop_assert!(!ours || damaged == bytes || read.is_err());
    }

    #[test]
    fn noise_after_the_magic_never_panics(bytes in prop::collection::vec(any::<u8>(), 0..600), version in 0u8..6) {
        let mut file = b"CDF".to_vec();
        file.push(version);
        file.extend(bytes);
        let _ = read(&file);
    }
}
