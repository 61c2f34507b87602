//! How far tiles of the filter pattern are from pixels of a kind.

use crate::pixel_map::PixelMap;

/// Tiles that lie about an edge of what is seen and belong to neither side.
#[must_use]
pub fn margin(map: &PixelMap) -> usize {
    (map.width() / 200).max(2)
}

/// Distance of each tile from the nearest one with a marked pixel, in tiles (steps along rows, columns and diagonals).
#[must_use]
pub fn of_tiles(map: &PixelMap, marked: impl Fn(usize) -> bool) -> Vec<usize> {
    let (w, h) = (map.width() / 2, map.height() / 2);
    let far = w + h;
    let mut out = vec![far; w * h];
    for p in (0..map.width() * map.height()).filter(|&p| marked(p)) {
        let (x, y) = ((p % map.width() / 2).min(w - 1), (p / map.width() / 2).min(h - 1));
        out[y * w + x] = 0;
    }
    let mut relax = |i: usize, offsets: [(isize, isize); 4]| {
        for (dx, dy) in offsets {
            let (x, y) = ((i % w) as isize + dx, (i / w) as isize + dy);
            if (0..w as isize).contains(&x) && (0..h as isize).contains(&y) {
                out[i] = out[i].min(out[y as usize * w + x as usize] + 1);
            }
        }
    };
    (0..w * h).for_each(|i| relax(i, [(-1, 0), (-1, -1), (0, -1), (1, -1)]));
    (0..w * h).rev().for_each(|i| relax(i, [(1, 0), (1, 1), (0, 1), (-1, 1)]));
    out
}

/// Distance of each pixel from the nearest marked one, in tiles.
#[must_use]
pub fn of_pixels(map: &PixelMap, marked: impl Fn(usize) -> bool) -> Vec<usize> {
    let (w, h) = (map.width() / 2, map.height() / 2);
    let tiles = of_tiles(map, marked);
    (0..map.width() * map.height())
        .map(|p| {
            let (x, y) = (p % map.width() / 2, p / map.width() / 2);
            tiles[y.min(h - 1) * w + x.min(w - 1)]
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use gonio_instrument::builtin;

    #[test]
    fn steps_are_counted_along_rows_columns_and_diagonals() {
        let map = PixelMap::new(&builtin::description("tiny").expect("known").expect("readable"));
        let w = map.width();
        // the tile (10, 20)
        let far = of_tiles(&map, |p| p == 41 * w + 21);
        for (x, y, steps) in [(10, 20, 0), (13, 20, 3), (10, 14, 6), (15, 25, 5), (0, 60, 40)] {
            assert_eq!(far[y * w / 2 + x], steps, "{x} {y}");
        }
        assert_eq!(of_pixels(&map, |p| p == 41 * w + 21)[29 * w + 3], 9);
        assert!(of_tiles(&map, |_| false).iter().all(|d| *d == (w + map.height()) / 2));
    }
}
