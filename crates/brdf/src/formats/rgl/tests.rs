use super::*;
use gonio_optics::Geometry;

/// A small material: uniform vndf, D = d everywhere, σ = s, rgb = cos θo-free constants.
pub(crate) fn file() -> Vec<u8> {
    let fields: [(&str, u8, Vec<u64>, Vec<f32>); 6] = [
        ("phi_i", 10, vec![1], vec![0.0]),
        ("theta_i", 10, vec![2], vec![0.0, 1.2]),
        ("sigma", 10, vec![2, 2], vec![0.5; 4]),
        ("ndf", 10, vec![2, 2], vec![0.8; 4]),
        ("vndf", 10, vec![1, 2, 3, 4], vec![1.0; 24]),
        // channel c of slice t: c + 1 + 10 t
        ("rgb", 10, vec![1, 2, 3, 2, 2], (0..24).map(|i| (i / 4 % 3 + 1 + 10 * (i / 12)) as f32).collect()),
    ];
    let description = b"made up";
    let mut head = MAGIC.to_vec();
    head.extend([1, 0]);
    head.extend((fields.len() as u32 + 1).to_le_bytes());
    let length: usize = head.len()
        + fields.iter().map(|f| 2 + f.0.len() + 11 + 8 * f.2.len()).sum::<usize>()
        + 2
        + "description".len()
        + 11
        + 8;
    let mut data = Vec::new();
    let mut describe = |name: &str, kind: u8, shape: &[u64], bytes: &[u8]| {
        head.extend((name.len() as u16).to_le_bytes());
        head.extend(name.as_bytes());
        head.extend((shape.len() as u16).to_le_bytes());
        head.push(kind);
        head.extend(((length + data.len()) as u64).to_le_bytes());
        shape.iter().for_each(|s| head.extend(s.to_le_bytes()));
        data.extend(bytes);
    };
    describe("description", 1, &[description.len() as u64], description);
    for (name, kind, shape, values) in &fields {
        describe(name, *kind, shape, &values.iter().flat_map(|v| v.to_le_bytes()).collect::<Vec<_>>());
    }
    [head, data].concat()
}

#[test]
fn a_material_is_evaluated_by_its_formula() {
    let m = read(&file()).unwrap();
    assert_eq!(m.description(), "made up");
    assert!(m.is_isotropic());
    for (theta_i_deg, part) in [(0.0, 0.0), (0.6f64.to_degrees(), 0.5), (80.0, 1.0)] {
        let (l, v) = Geometry::from_degrees(theta_i_deg, 50.0, 130.0).directions();
        let f = m.eval(l, v);
        for (c, value) in f.into_iter().enumerate() {
            let expected = (c as f64 + 1.0 + 10.0 * part) * 0.8 / (4.0 * 0.5 * 50f64.to_radians().cos());
            assert!((value / expected - 1.0).abs() < 1e-6, "{theta_i_deg} {f:?}");
        }
    }
    let (l, v) = Geometry::from_degrees(30.0, 90.0, 0.0).directions();
    assert!(m.eval(l, Vec3::new(v.x, v.y, -0.1)) == [0.0; 3]);
}

#[test]
fn grazing_views_do_not_blow_up() {
    let m = read(&file()).unwrap();
    let at = |theta_o_deg: f64| {
        let (l, v) = Geometry::from_degrees(30.0, theta_o_deg, 170.0).directions();
        m.eval(l, v)[0]
    };
    assert!((at(85.0) / at(60.0) - 0.5 / 85f64.to_radians().cos()).abs() < 1e-6);
    assert!((at(90.0) / at(85.0) - 1.0).abs() < 1e-6);
}

#[test]
fn the_azimuth_of_the_light_is_of_no_account() {
    let m = read(&file()).unwrap();
    let (l, v) = Geometry::from_degrees(40.0, 60.0, 100.0).directions();
    let turn = gonio_optics::Rotation::about_axis(Vec3::Z, gonio_optics::Angle::from_degrees(77.0));
    let (a, b) = (m.eval(l, v), m.eval(turn.apply(l), turn.apply(v)));
    assert!((0..3).all(|c| (a[c] - b[c]).abs() < 1e-9));
}

#[test]
fn fields_that_do_not_fit_are_refused() {
    let good = file();
    let replaced = |from: &[u8], at: usize, to: &[u8]| {
        let mut b = good.clone();
        let k = b.windows(from.len()).position(|w| w == from).unwrap() + from.len() + at;
        b[k..k + to.len()].copy_from_slice(to);
        read(&b)
    };
    // huge sizes, a place beyond the end, another type
    assert!(replaced(b"vndf", 11, &u64::MAX.to_le_bytes()).is_err());
    assert!(replaced(b"ndf", 3, &u64::MAX.to_le_bytes()).is_err());
    assert!(replaced(b"sigma", 2, &[11]).is_err());
    assert!(replaced(b"tensor_file\0", 2, &u32::MAX.to_le_bytes()).is_err());
    for n in 0..good.len() {
        assert!(read(&good[..n]).is_err(), "{n}");
    }
}
