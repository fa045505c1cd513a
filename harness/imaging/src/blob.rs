//! Contiguous areas of failing pixels.

use super::comparison::FailingArea;

/// The number of 2x2 blocks whose four pixels all fail.
pub fn solid_blocks(failing: &[bool], width: usize) -> usize {
    let rows: Vec<&[bool]> = failing.chunks_exact(width.max(1)).collect();
    rows.windows(2)
        .map(|pair| {
            let both = |x: usize| pair[0][x] && pair[1][x];
            (1..width).filter(|&x| both(x) && both(x - 1)).count()
        })
        .sum()
}

/// The largest area of failing pixels that touch by their sides; of equal ones the first.
pub fn largest_area(failing: &[bool], width: usize) -> Option<FailingArea> {
    let mut seen = vec![false; failing.len()];
    let mut stack = Vec::new();
    let mut largest: Option<FailingArea> = None;
    for start in 0..failing.len() {
        if !failing[start] || seen[start] {
            continue;
        }
        seen[start] = true;
        stack.push(start);
        let (mut left, mut right, mut bottom, mut pixels) = (width, 0, 0, 0);
        while let Some(i) = stack.pop() {
            let x = i % width;
            (left, right, bottom) = (left.min(x), right.max(x), bottom.max(i / width));
            pixels += 1;
            let neighbors = [
                (x > 0).then(|| i - 1),
                (x + 1 < width).then_some(i + 1),
                i.checked_sub(width),
                Some(i + width).filter(|&j| j < failing.len()),
            ];
            for j in neighbors.into_iter().flatten() {
                if failing[j] && !seen[j] {
                    seen[j] = true;
                    stack.push(j);
                }
            }
        }
        if largest.as_ref().is_none_or(|l| pixels > l.pixels) {
            // The scan meets an area first in its top row.
            let y = start / width;
            largest = Some(FailingArea {
                x: left,
                y,
                width: right - left + 1,
                height: bottom - y + 1,
                pixels,
            });
        }
    }
    largest
}

#[cfg(test)]
mod tests {
    use super::*;

    fn map(rows: &[&str]) -> (Vec<bool>, usize) {
        (rows.concat().bytes().map(|b| b == b'#').collect(), rows[0].len())
    }

    #[test]
    fn blocks_are_counted_and_do_not_wrap_around() {
        let count = |rows: &[&str]| {
            let (map, width) = map(rows);
            solid_blocks(&map, width)
        };
        assert_eq!(count(&["##..", "##.."]), 1);
        assert_eq!(count(&["###.", "###."]), 2);
        assert_eq!(count(&["#..#", "#..#"]), 0);
        assert_eq!(count(&["#.#.", ".#.#", "#.#."]), 0);
        assert_eq!(count(&["####"]), 0);
        assert_eq!(count(&["#", "#"]), 0);
        assert_eq!(solid_blocks(&[], 0), 0);
    }

    #[test]
    fn the_largest_area_has_its_box() {
        let (a, width) = map(&["#..#.", "#..##", "...#.", "##..."]);
        let area = largest_area(&a, width).unwrap();
        assert_eq!((area.x, area.y, area.width, area.height, area.pixels), (3, 0, 2, 3, 4));
        let (b, width) = map(&["..#", "#.#", "###"]);
        let area = largest_area(&b, width).unwrap();
        assert_eq!((area.x, area.y, area.width, area.height, area.pixels), (0, 0, 3, 3, 6));
        assert_eq!(largest_area(&[false; 6], 3), None);
    }
}
