//! Which shapes show wrong values, and the slips with materials that explain them.

use std::collections::BTreeMap;

use basecode::{Camera, Image, MaterialModel, Scene, Vec3};

use super::{BoundValue, STRAY_FRACTION, is_close};
use crate::price::{Price, PriceClass};
use crate::stage_film::StageFilm;

/// What is wrong with the shapes of a pass whose values are wrong.
pub(super) struct WrongShapes {
    /// Shapes in view.
    pub shapes: usize,
    /// Those that show a wrong value.
    pub wrong: usize,
    /// The slips that explain each of those.
    slips: Vec<&'static str>,
}

impl WrongShapes {
    pub fn price(&self, price: Price) -> Price {
        let explained =
            self.slips.iter().fold(price, |price, name| price.or(name, PriceClass::Slip, 0.0));
        match self.wrong == 1 && self.shapes > 1 {
            true => explained.or("one shape is wrong or missing", PriceClass::Slip, 0.0),
            false => explained,
        }
    }
}

/// The slip that diffuse shapes are drawn by the Phong pipeline, and the reverse.
const EXCHANGED: &str = "diffuse and Phong pipeline are exchanged";
/// The slip that a shape shows what belongs to another.
const ANOTHERS: &str = "a shape has another's material";

/// What a shape shows of a value, if a pass makes a slip: nothing where it is left open.
type Slip<'a> = (&'static str, Box<dyn Fn(BoundValue, usize) -> Option<Vec3> + 'a>);

/// The slips of a pass that concern materials.
fn slips<'a>(scene: &'a Scene, camera: &'a Camera) -> Vec<Slip<'a>> {
    let right = move |bound: BoundValue, shape| bound.expected(scene, camera, shape);
    let phong = move |shape| scene.material_of(shape).model == MaterialModel::Phong;
    let count = scene.shapes().len();
    let mut slips: Vec<Slip> = vec![
        (
            "albedos without the energy scale",
            Box::new(move |bound, shape| {
                let expected = right(bound, shape)?;
                let scaled = matches!(bound, BoundValue::RhoD | BoundValue::RhoS);
                let scale = scene.material_of(shape).energy_scale();
                Some(if scaled { expected / scale } else { expected })
            }),
        ),
        (
            "the energy scale twice",
            Box::new(move |bound, shape| {
                let expected = right(bound, shape)?;
                let scaled = matches!(bound, BoundValue::RhoD | BoundValue::RhoS);
                let scale = scene.material_of(shape).energy_scale();
                Some(if scaled { expected * scale } else { expected })
            }),
        ),
        (
            "albedos are grey",
            Box::new(move |bound, shape| {
                let expected = right(bound, shape)?;
                let scaled = matches!(bound, BoundValue::RhoD | BoundValue::RhoS);
                Some(if scaled { Vec3::splat(expected.x) } else { expected })
            }),
        ),
        (
            "rho_d and rho_s are exchanged",
            Box::new(move |bound, shape| {
                let scale = scene.material_of(shape).energy_scale();
                match bound {
                    BoundValue::RhoD => Some(scale * scene.material_of(shape).specular.average()),
                    BoundValue::RhoS if phong(shape) => {
                        Some(scale * scene.material_of(shape).diffuse.average())
                    }
                    _ => right(bound, shape),
                }
            }),
        ),
        (
            EXCHANGED,
            Box::new(move |bound, shape| match bound {
                BoundValue::RhoD | BoundValue::RhoS => bound.bound(scene, shape, !phong(shape)),
                // What the other pipeline shows: blue tells.
                BoundValue::Exponent if phong(shape) => {
                    Some(Vec3::new(scene.material_of(shape).exponent, 0.0, 0.0))
                }
                _ => right(bound, shape),
            }),
        ),
    ];
    // Another's material, with the other's pipeline or one's own.
    let of_index = |shape: usize| {
        let with_material = scene.shapes().iter().position(|other| other.material == shape);
        with_material.unwrap_or(shape)
    };
    let mut whose: Vec<Vec<usize>> = (0..count).map(|other| vec![other; count]).collect();
    whose.push((0..count).map(|shape| shape.saturating_sub(1)).collect());
    whose.push((0..count).map(|shape| (shape + 1).min(count - 1)).collect());
    whose.push((0..count).map(of_index).collect());
    for whose in whose {
        let own_pipeline = whose.clone();
        let own_pipeline = move |bound: BoundValue, shape: usize| match bound {
            BoundValue::RhoD | BoundValue::RhoS | BoundValue::Exponent => {
                bound.bound(scene, own_pipeline[shape], phong(shape))
            }
            _ => right(bound, shape),
        };
        slips.push((ANOTHERS, Box::new(own_pipeline)));
        slips.push((ANOTHERS, Box::new(move |bound, shape| right(bound, whose[shape]))));
    }
    slips
}

pub(super) fn wrong_shapes(film: &StageFilm, frames: &[(BoundValue, Image)]) -> WrongShapes {
    let (scene, camera) = (film.scene, &film.camera);
    let mut pixels: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
    for (index, shape) in film.interior() {
        pixels.entry(shape).or_default().push(index);
    }
    let shows = |shape: usize, expected: &dyn Fn(BoundValue) -> Option<Vec3>| {
        let pixels = &pixels[&shape];
        frames.iter().all(|(bound, frame)| {
            let Some(expected) = expected(*bound) else { return true };
            let wrong =
                pixels.iter().filter(|index| !is_close(frame.pixels[**index], expected)).count();
            wrong as f64 <= STRAY_FRACTION * pixels.len() as f64
        })
    };
    let right = |shape: usize| shows(shape, &|bound| bound.expected(scene, camera, shape));
    let wrong: Vec<usize> = pixels.keys().copied().filter(|shape| !right(*shape)).collect();
    // One shape may have another's material while the others have their own.
    // The blue of the exponent's frame: which pipeline draws.
    let by_phong = |shape: usize| {
        let exponents = frames.iter().find(|(bound, _)| *bound == BoundValue::Exponent);
        exponents.is_none_or(|(_, frame)| {
            let pixels = &pixels[&shape];
            2 * pixels.iter().filter(|index| frame.pixels[**index].z != 0.0).count() > pixels.len()
        })
    };
    let is_phong = |shape: usize| scene.material_of(shape).model == MaterialModel::Phong;
    let explains = |(name, value): &Slip| {
        if *name == EXCHANGED && !pixels.keys().all(|&shape| is_phong(shape) || by_phong(shape)) {
            return false;
        }
        let all = pixels.keys().copied().filter(|shape| *name != ANOTHERS || wrong.contains(shape));
        all.into_iter().all(|shape| shows(shape, &|bound| value(bound, shape)))
    };
    let slips = slips(scene, camera);
    let slips = slips.iter().filter(|slip| explains(slip)).map(|(name, _)| *name).collect();
    WrongShapes { shapes: pixels.len(), wrong: wrong.len(), slips }
}
