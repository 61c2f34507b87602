use super::*;

fn small() -> Measured {
    let grid = Grid {
        theta_i_deg: vec![0.0, 45.0],
        theta_o_deg: vec![0.0, 2.5, 90.0],
        phi_deg: vec![0.0, 180.0 / 35.0, 180.0],
    };
    let mut m = Measured::empty(grid, Meaning::Node);
    for i in 0..m.grid.len() {
        m.values[i] = [0.1 + i as f32 / 3.0, -1e-7 * i as f32, 1234.5678];
        m.sigma[i] = [1e-3 * i as f32; 3];
        m.flag[i] = [Flag::Measured, Flag::Filled, Flag::Extrapolated, Flag::Invalid][i % 4];
    }
    m
}

#[test]
fn a_grid_comes_back_as_it_was() {
    let m = small();
    assert_eq!(read(write(&m).as_bytes()).unwrap(), Contents::Table(Box::new(m)));
}

#[test]
fn rows_of_a_grid_may_come_in_any_order() {
    let m = small();
    let text = write(&m);
    let (header, rows) = text.split_once('\n').unwrap();
    let shuffled = rows.lines().rev().fold(header.to_owned(), |t, l| t + "\n" + l);
    assert_eq!(read(shuffled.as_bytes()).unwrap(), Contents::Table(Box::new(m)));
}

#[test]
fn an_incomplete_grid_is_scattered_and_comes_back() {
    let text = write(&small());
    let short = text.trim_end().rsplit_once('\n').unwrap().0;
    let Contents::Scattered(s) = read(short.as_bytes()).unwrap() else { panic!("taken as a grid") };
    assert_eq!(s.points.len(), small().grid.len() - 1);
    let Contents::Scattered(again) = read(write_scattered(&s).as_bytes()).unwrap() else {
        panic!("taken as a grid")
    };
    assert_eq!(again.points.len(), s.points.len());
    for (a, b) in again.points.iter().zip(&s.points) {
        assert_eq!((a.value, a.sigma, a.flag), (b.value, b.sigma, b.flag));
        assert!((a.geometry.phi - b.geometry.phi).abs().degrees() < 1e-9);
    }
}

#[test]
fn a_repeated_row_or_an_azimuth_beyond_180_makes_the_data_scattered() {
    let rows = ["0,0,0,1,1,1", "0,10,0,1,1,1", "0,10,0,2,2,2", "0,10,180,1,1,1"].join("\n");
    let text = format!("theta_i_deg,theta_o_deg,phi_deg,r,g,b\n{rows}\n");
    assert!(matches!(read(text.as_bytes()), Ok(Contents::Scattered(_))));
    let text = "theta_i_deg,theta_o_deg,phi_deg,r,g,b\n0,0,270,1,1,1\n0,10,270,1,1,1\n";
    assert!(matches!(read(text.as_bytes()), Ok(Contents::Scattered(_))));
}

#[test]
fn bad_fields_are_told_with_their_place() {
    let message = |row: &str| {
        let text = format!("theta_i_deg,theta_o_deg,phi_deg,r,g,b,sigma_r,sigma_g,sigma_b,flag\n{row}\n");
        read(text.as_bytes()).unwrap_err().to_string()
    };
    assert_eq!(message("0,0,0,1,inf,1,0,0,0,0"), "line 2, column g: found \"inf\", expected a finite number");
    assert_eq!(message("0,0,0,1,x,1,0,0,0,0"), "line 2, column g: found \"x\", expected a finite number");
    assert_eq!(
        message("0,0,0,1,1,1,0,-1,0,0"),
        "line 2, column sigma_g: found \"-1\", expected a finite number, not negative"
    );
    assert_eq!(
        message("0,0,0,1,1,1,0,0,0,7"),
        "line 2, column flag: found \"7\", expected 0 measured, 1 filled, 2 extrapolated or 3 invalid"
    );
    assert!(message("").contains("at least one row"));
    let text = "theta_i_deg,theta_o_deg,phi_deg,r,g,b,sigma_r\n0,0,0,1,1,1,0\n";
    assert!(read(text.as_bytes()).unwrap_err().to_string().contains("column sigma_g"));
}

#[test]
fn invalid_cells_may_hold_anything() {
    let text = "theta_i_deg,theta_o_deg,phi_deg,r,g,b,flag\n0,0,0,NaN,,inf,3\n0,10,0,1,1,1,0\n";
    let Contents::Table(m) = read(text.as_bytes()).unwrap() else { panic!("a grid of two") };
    assert!(m.values[0][0].is_nan() && m.flag == [Flag::Invalid, Flag::Measured]);
}
