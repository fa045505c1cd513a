//! The price of a wrong image: slips in how a film is written or viewed.

use super::answers::{follows, surely_more_than};
use super::price::{self, Price, PriceClass};
use super::rays::RELATIVE;
use imaging::correlation::Moments;
use imaging::srgb;

/// A slip in how an image is written.
struct Change<'a> {
    name: &'static str,
    /// The largest value that right noise is multiplied by.
    noise: f32,
    /// The least and the largest value that each pixel shows then; nothing where none is known.
    value: Box<dyn Fn(usize) -> Option<[[f32; 3]; 2]> + 'a>,
}

/// What each pixel should be.
#[derive(Clone, Copy)]
struct Film<'a> {
    width: usize,
    height: usize,
    pixels: &'a [[f32; 3]],
    /// Whether an edge runs through a pixel: what lies between it and the next is not known.
    edge: &'a dyn Fn(usize) -> bool,
}

impl<'a> Film<'a> {
    fn at(&self, x: usize, y: usize) -> [f32; 3] {
        self.pixels[y.min(self.height - 1) * self.width + x.min(self.width - 1)]
    }

    /// The least and the largest values of the pixels whose centers are nearest around a place
    /// [pixels]: two each way. Nothing outside the film.
    fn around(&self, x: f64, y: f64) -> Option<[[f32; 3]; 2]> {
        let inside = |v: f64, size: usize| v > -1.0 && v < size as f64;
        if !(inside(x, self.width) && inside(y, self.height)) {
            return None;
        }
        let (mut least, mut most) = ([f32::INFINITY; 3], [f32::NEG_INFINITY; 3]);
        for dy in -1..=1 {
            for dx in -1..=1 {
                let near = |v: f64, d: i32| (v.round() + f64::from(d)).max(0.0);
                let (px, py) = (near(x, dx), near(y, dy));
                if (px - x).abs() > 1.0 || (py - y).abs() > 1.0 {
                    continue;
                }
                let (px, py) = (px as usize, py as usize);
                if (self.edge)(py.min(self.height - 1) * self.width + px.min(self.width - 1)) {
                    return None;
                }
                let value = self.at(px, py);
                for c in 0..3 {
                    least[c] = least[c].min(value[c]);
                    most[c] = most[c].max(value[c]);
                }
            }
        }
        // Between the pixels light may be a little brighter or darker than at each.
        for c in 0..3 {
            let more = BETWEEN * (most[c] - least[c]);
            (least[c], most[c]) = (least[c] - more, most[c] + more);
        }
        Some([least, most])
    }

    /// Each pixel shows what belongs to another place: `from` of its column and row [pixels].
    fn moved(self, name: &'static str, from: impl Fn(f64, f64) -> (f64, f64) + 'a) -> Change<'a> {
        let value = move |index: usize| {
            let (x, y) = from((index % self.width) as f64, (index / self.width) as f64);
            self.around(x, y)
        };
        Change { name, noise: 1.0, value: Box::new(value) }
    }

    /// Each pixel shows a function of what it should be.
    fn changed(
        self,
        name: &'static str,
        noise: f32,
        change: impl Fn([f32; 3]) -> [f32; 3] + 'a,
    ) -> Change<'a> {
        let value = move |index: usize| Some([change(self.pixels[index]); 2]);
        Change { name, noise, value: Box::new(value) }
    }

    /// Each pixel shows the sum of all before it in its row, and its own.
    fn summed(self, name: &'static str) -> Change<'a> {
        let rows = self.pixels.chunks(self.width).flat_map(|row| {
            row.iter().scan([0.0f64; 3], |sum, pixel| {
                *sum = std::array::from_fn(|c| sum[c] + f64::from(pixel[c]));
                Some(sum.map(|v| v as f32))
            })
        });
        let sums: Vec<[f32; 3]> = rows.collect();
        let noise = (self.width as f32).sqrt();
        Change { name, noise, value: Box::new(move |index| Some([sums[index]; 2])) }
    }

    /// Whole rows or columns are black or no numbers where something should be: at most half of the film. Nothing where
    /// none is.
    fn missing(self, image: &[[f32; 3]]) -> Option<Change<'a>> {
        let is_black = |pixels: &[[f32; 3]], index: usize| pixels[index] == [0.0; 3];
        let row = |y: usize| (0..self.width).map(move |x| y * self.width + x).collect::<Vec<_>>();
        let column =
            |x: usize| (0..self.height).map(move |y| y * self.width + x).collect::<Vec<_>>();
        let lines = (0..self.height).map(row).chain((0..self.width).map(column));
        let is_missing = |line: &Vec<usize>| {
            let is_drawn = |index: &usize| {
                !is_black(image, *index) && image[*index].iter().all(|v| v.is_finite())
            };
            !line.iter().any(is_drawn) && line.iter().any(|index| !is_black(self.pixels, *index))
        };
        let mut missing = vec![false; image.len()];
        lines.filter(is_missing).flatten().for_each(|index| missing[index] = true);
        let count = missing.iter().filter(|missing| **missing).count();
        let value = move |index: usize| {
            Some([if missing[index] { [0.0; 3] } else { self.pixels[index] }; 2])
        };
        let name = "some rows or columns are not drawn";
        (count > 0 && 2 * count <= image.len()).then(|| Change {
            name,
            noise: 1.0,
            value: Box::new(value),
        })
    }

    /// The slips that are looked for; `factor` is what most pixels are multiplied by.
    fn changes(self, factor: f32) -> Vec<Change<'a>> {
        let (width, height) = (self.width as f64, self.height as f64);
        let (last_x, last_y) = (width - 1.0, height - 1.0);
        let mut changes = vec![
            self.changed("a constant factor", factor.abs().max(1.0), move |v| {
                v.map(|v| factor * v)
            }),
            self.changed("clamped to 1", 1.0, |v| v.map(|v| v.clamp(0.0, 1.0))),
            self.changed("gamma baked in", 1.0, |v| v.map(|v| v.max(0.0).powf(1.0 / 2.2))),
            self.changed("sRGB baked in", 1.0, |v| v.map(|v| srgb::encode(f64::from(v)) as f32)),
            self.changed("gamma taken out", 1.0, |v| v.map(|v| v.max(0.0).powf(2.2))),
            self.changed("tone mapped", 1.0, |v| v.map(|v| v / (1.0 + v.max(0.0)))),
            self.changed("tone mapped", 1.0, |v| v.map(|v| 1.0 - (-v).exp())),
            self.changed("magnitude", 1.0, |v| v.map(f32::abs)),
            self.moved("rows from bottom to top", move |x, y| (x, last_y - y)),
            self.moved("columns from right to left", move |x, y| (last_x - x, y)),
            self.moved("turned by half", move |x, y| (last_x - x, last_y - y)),
            self.moved("turned by a quarter", move |x, y| (y, last_y - x)),
            self.moved("turned by a quarter the other way", move |x, y| (last_x - y, x)),
            self.moved("rows and columns exchanged", |x, y| (y, x)),
            // Written as rows of the other length.
            self.moved("rows and columns exchanged in memory", move |x, y| {
                let index = y * width + x;
                (index % height, (index / height).floor())
            }),
            self.moved("rows and columns exchanged in memory", move |x, y| {
                let index = y * width + x;
                ((index / height).floor(), index % height)
            }),
        ];
        for [r, g, b] in [[2, 1, 0], [1, 0, 2], [0, 2, 1], [1, 2, 0], [2, 0, 1]] {
            changes.push(self.changed("channels exchanged", 1.0, move |v| [v[r], v[g], v[b]]));
        }
        for (dx, dy) in [(-1.0, 0.0), (1.0, 0.0), (0.0, -1.0), (0.0, 1.0)] {
            changes.push(self.moved("a pixel beside", move |x, y| (x + dx, y + dy)));
        }
        for (dx, dy) in [(-0.5, -0.5), (0.5, -0.5), (-0.5, 0.5), (0.5, 0.5)] {
            changes.push(self.moved("half a pixel beside", move |x, y| (x + dx, y + dy)));
        }
        let (center_x, center_y) = (0.5 * last_x, 0.5 * last_y);
        let zoomed = |name, by_x: f64, by_y: f64| {
            let from = move |x: f64, y: f64| {
                (center_x + by_x * (x - center_x), center_y + by_y * (y - center_y))
            };
            self.moved(name, from)
        };
        let aspect = width / height;
        for by in [aspect, 1.0 / aspect] {
            changes.push(zoomed("the field of view is that of the other axis", by, by));
            changes.push(zoomed("the aspect ratio is missing", by, 1.0));
            changes.push(zoomed("the aspect ratio is missing", 1.0, by));
        }
        // A ray's place on the film by a wrong scale or start of one axis, or of both.
        let axis =
            |by: f64, start: f64, size: f64| move |at: f64| by * (at + 0.5) + start * size - 0.5;
        for (by, start) in [
            (aspect, 0.0),
            (1.0 / aspect, 0.0),
            (0.5, 0.0),
            (2.0, 0.0),
            (0.5, 0.25),
            (2.0, -0.5),
            (1.0, 0.5),
            (1.0, -0.5),
        ] {
            let name = "the camera ray's place on the film is wrong by a factor or a summand";
            let (of_x, of_y) = (axis(by, start, width), axis(by, start, height));
            changes.push(self.moved(name, move |x, y| (of_x(x), y)));
            changes.push(self.moved(name, move |x, y| (x, of_y(y))));
            // About the center it is a field of view, which is known.
            if 2.0 * start + by != 1.0 {
                changes.push(self.moved(name, move |x, y| (of_x(x), of_y(y))));
            }
        }
        // Width and height in each other's place.
        changes.push(self.moved("the film's width and height are exchanged for the camera", {
            let by = height / width;
            move |x, y| (0.5 * width + by * (x + 0.5 - 0.5 * height) - 0.5, by * (y + 0.5) - 0.5)
        }));
        changes.push(self.summed("the sum goes on from pixel to pixel of a row"));
        // Half an angle, a whole one, degrees of another: within an eighth of any.
        changes.extend((-24..=24).filter(|step| *step != 0).map(|step: i32| {
            let by = 2f64.powf(f64::from(step) / 16.0);
            zoomed("another field of view", by, by)
        }));
        changes
    }
}

/// By how much of what pixels around a place differ it may lie outside of them.
const BETWEEN: f32 = 0.25;
/// Least fraction of the film that must be known to tell a slip.
const KNOWN: f64 = 0.1;

/// Fraction of the expected image that a slip may leave unexplained: between pixels, values are known only from
/// neighbors.
const LEFT: f64 = 0.005;

/// Number of pixels that are looked at.
const PRICED: usize = 6000;
/// Every so many of them tell most slips apart.
const FEW: usize = 16;

/// The price of a wrong image: a slip in how it is written explains it, or nothing does. `room` is how far a pixel may
/// be off, where it tells anything.
pub fn film_price(
    (width, height): (usize, usize),
    image: &[[f32; 3]],
    right: &[[f32; 3]],
    room: &dyn Fn(usize) -> Option<f32>,
    raw: f64,
) -> Price {
    // A black image: no slip explains it.
    let Some(factor) = factor(image, right) else { return Price::of_raw(raw) };
    let edge = |index: usize| room(index).is_none();
    let film = Film { width, height, pixels: right, edge: &edge };
    let step = image.len().div_ceil(PRICED).max(1);
    let pairs = image.iter().flatten().zip(right.iter().flatten()).step_by(step);
    let pairs = pairs.map(|(a, b)| (f64::from(*a), f64::from(*b)));
    let likeness = Moments::of(pairs).correlation();
    let start = match likeness >= price::LIKE {
        true => Price::of_raw(raw).or(price::UNKNOWN, PriceClass::Unknown, 0.0),
        false => Price::of_raw(raw),
    };
    let mut changes = film.changes(factor);
    changes.extend(film.missing(image));
    let all: Vec<usize> = (0..image.len()).step_by(step).collect();
    let few: Vec<usize> = all.iter().copied().step_by(FEW).collect();
    let comparison = |change: &Change, pixels: &[usize]| Compared::of(change, image, pixels, room);
    let left = |change: &Change| comparison(change, &few).map_or(0.0, |few| few.left);
    // What a few pixels tell most about comes first: a slip that is found early spares the others.
    let mut changes: Vec<_> = changes.iter().map(|change| (left(change), change)).collect();
    changes.sort_by(|a, b| a.0.total_cmp(&b.0));
    changes.into_iter().fold(start, |price, (left, change)| {
        if price.is_least() || left > surely_more_than(price.error - PriceClass::Slip.price()) {
            return price;
        }
        match comparison(change, &all) {
            Some(all) if follows(&all.pairs) => price.or(change.name, PriceClass::Slip, all.left),
            _ => price,
        }
    })
}

/// An image beside what a slip would have made of the right one.
struct Compared {
    /// The values of both.
    pairs: Moments,
    /// Part of the image that the slip leaves unexplained.
    left: f64,
}

impl Compared {
    /// Nothing where too little is known of what the slip would show.
    fn of(
        change: &Change,
        image: &[[f32; 3]],
        pixels: &[usize],
        room: &dyn Fn(usize) -> Option<f32>,
    ) -> Option<Self> {
        let (mut apart, mut total) = (0.0, 0.0);
        let (mut all, mut known) = (0usize, 0usize);
        let mut pairs = Moments::default();
        for &index in pixels {
            let Some(room) = room(index) else { continue };
            all += 1;
            let Some([least, most]) = (change.value)(index) else { continue };
            known += 1;
            for ((&a, least), most) in image[index].iter().zip(least).zip(most) {
                if !(least.is_finite() && most.is_finite()) {
                    continue;
                }
                if a.is_finite() {
                    pairs.add(1.0, f64::from(a), f64::from(least + most) / 2.0);
                }
                let size = f64::from(least.abs().max(most.abs()));
                total += size;
                let difference = match a.is_finite() {
                    true => f64::from((least - a).max(a - most).max(0.0)),
                    false => size,
                };
                let room = f64::from(change.noise * room) + RELATIVE * size;
                apart += if difference > room { difference } else { 0.0 };
            }
        }
        let left = (apart / total.max(f64::MIN_POSITIVE) - LEFT).max(0.0);
        (known as f64 >= KNOWN * all as f64).then_some(Self { pairs, left })
    }
}

/// The factor that most values share.
fn factor(image: &[[f32; 3]], expected: &[[f32; 3]]) -> Option<f32> {
    let pairs = image.iter().flatten().zip(expected.iter().flatten());
    let mut ratios: Vec<f32> = pairs
        .filter(|(_, b)| **b > 0.0)
        .map(|(a, b)| a / b)
        .filter(|ratio| ratio.is_finite() && *ratio > 1e-3)
        .collect();
    ratios.sort_by(f32::total_cmp);
    ratios.get(ratios.len() / 2).copied()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn slips_of_loop_and_camera_explain_an_image() {
        let (width, height) = (40usize, 30usize);
        let at = |x: f32, y: f32| 3.0 + 2.0 * (0.11 * x).sin() * (0.13 * y + 0.1 * x).cos();
        let film = |of: &dyn Fn(usize, usize) -> f32| -> Vec<[f32; 3]> {
            (0..width * height).map(|index| [of(index % width, index / width); 3]).collect()
        };
        let right = film(&|x, y| at(x as f32 + 0.5, y as f32 + 0.5));
        let price =
            |image: &[[f32; 3]]| film_price((width, height), image, &right, &|_| Some(0.0), 0.9);
        let row = |x: usize, y: usize| (0..=x).map(|x| right[y * width + x][0]).sum::<f32>();
        let exchanged = film(&|x, y| {
            let (x, y, by) = (x as f32 + 0.5, y as f32 + 0.5, 30.0 / 40.0);
            at(20.0 + by * (x - 15.0), by * y)
        });
        let drawn = |wanted: &dyn Fn(usize, usize) -> bool| {
            film(&|x, y| if wanted(x, y) { right[y * width + x][0] } else { 0.0 })
        };
        // 2 x / height - 1, and 2 x / width without the 1.
        let by_height = film(&|x, y| at((x as f32 + 0.5) * 40.0 / 30.0, y as f32 + 0.5));
        let unshifted = film(&|x, y| at(x as f32 + 20.5, y as f32 + 0.5));
        let tiles = drawn(&|x, y| x < 32 && y < 24);
        let broken = film(&|x, y| if y < 16 { right[y * width + x][0] } else { f32::NAN });
        let rows = drawn(&|_, y| y.is_multiple_of(2));
        for (image, what) in [
            (film(&row), "sum"),
            (exchanged, "camera"),
            (by_height, "height for width"),
            (unshifted, "half a film beside"),
            (tiles, "tiles"),
            (broken, "no numbers"),
            (rows, "rows"),
        ] {
            let price = price(&image);
            assert!(price.error < 0.04, "{what}: {} {}", price.error, price.name());
        }
        // Little is drawn, or what is drawn is wrong: no slip.
        assert!(price(&drawn(&|x, _| x < 10)).error > 0.3);
        assert!(
            price(&film(&|x, y| if y < 16 { at(y as f32, x as f32) } else { 0.0 })).error > 0.1
        );
    }

    #[test]
    fn an_image_that_does_not_follow_the_right_one_is_explained_by_no_slip() {
        let (width, height) = (40, 30);
        let at = |x: f32, y: f32| 3.0 + 2.0 * (0.31 * x).sin() * (0.23 * y + 0.1 * x).cos();
        let film = |of: &dyn Fn(f32, f32) -> f32| -> Vec<[f32; 3]> {
            (0..width * height)
                .map(|index| [of((index % width) as f32, (index / width) as f32); 3])
                .collect()
        };
        let right = film(&at);
        let price =
            |image: &[[f32; 3]]| film_price((width, height), image, &right, &|_| Some(0.0), 0.9);
        let doubled = film(&|x, y| 2.0 * at(x, y));
        assert!((price(&doubled).error - PriceClass::Slip.price()).abs() < 1e-6);
        // As bright as the right image is on average, and one that has nothing to do with it.
        let [flat, other] = [film(&|_, _| 3.0), film(&|x, _| 3.0 + 2.0 * (1.7 * x).sin())];
        for (image, what) in [(flat, "flat"), (other, "another"), (film(&|_, _| 0.0), "black")] {
            let price = price(&image);
            assert!(price.error > 0.3, "{what}: {} {}", price.error, price.name());
        }
    }
}
