//! Labels the pixels of a scene: their material, whether they are lit, and whether they can be trusted.

use basecode::{Camera, Frame, MaterialModel, Result, Scene, Vec3};

use super::surface::{Lattice, SurfacePoint, Visibility};
use imaging::reference::{Region, RegionMask};

/// A pixel whose specular lobe exceeds this fraction of its peak belongs to the highlight.
const HIGHLIGHT: f32 = 0.1;
/// Within this cosine of the contour where a direction grazes the surface, pixels are edges.
const GRAZING: f32 = 1e-3;

/// The regions of a scene's image of `width` x `height` pixels: with shadows, and without.
///
/// A pixel is an edge when the nine points on its center, edges and corners, or those of a
/// neighbor, do not see the same shape in the same light.
///
/// # Errors
/// When the film is empty or the scene's camera has no frame.
pub fn regions(scene: &Scene, width: usize, height: usize) -> Result<[RegionMask; 2]> {
    Ok(regions_seen_by(scene, &scene.camera(width, height)?, width, height))
}

/// The same for another camera than the scene's own.
pub fn regions_seen_by(
    scene: &Scene,
    camera: &Camera,
    width: usize,
    height: usize,
) -> [RegionMask; 2] {
    let lattice = Lattice::new(scene, camera, width, height);
    [true, false].map(|shadows| mask(scene, &lattice, width, height, shadows))
}

fn mask(
    scene: &Scene,
    lattice: &Lattice,
    width: usize,
    height: usize,
    shadows: bool,
) -> RegionMask {
    let mut mask = RegionMask::background(width, height);
    mask.regions = table(scene);
    let mut edges = vec![false; width * height];
    for y in 0..height {
        for x in 0..width {
            let around = lattice.around(x, y).map(|point| Seen::of(scene, point.as_ref(), shadows));
            let index = y * width + x;
            edges[index] = around.iter().any(|seen| *seen != around[4] || seen.unsure);
            mask.pixels[index] = around[4].value;
            let highlight = |p: &SurfacePoint| in_highlight(scene, p);
            if around[4].lit && lattice.around(x, y)[4].as_ref().is_some_and(highlight) {
                mask.pixels[index] |= RegionMask::HIGHLIGHT;
            }
        }
    }
    for y in 0..height {
        for x in 0..width {
            let rows = y.saturating_sub(1)..(y + 2).min(height);
            let mut near = rows.flat_map(|j| {
                let columns = x.saturating_sub(1)..(x + 2).min(width);
                columns.map(move |i| j * width + i)
            });
            if near.any(|index| edges[index]) {
                mask.pixels[y * width + x] |= RegionMask::EDGE;
            }
        }
    }
    mask
}

/// The background, and two regions for each material of a scene.
pub fn table(scene: &Scene) -> Vec<Region> {
    let mut regions = RegionMask::background(0, 0).regions;
    for material in scene.materials() {
        let exponent = match material.model {
            MaterialModel::Phong => material.exponent,
            _ => 0.0,
        };
        for light in ["lit", "shadowed"] {
            let name = format!("{}, {light}", material.name);
            regions.push(Region { name, lit: light == "lit", exponent });
        }
    }
    regions
}

/// What one point of the lattice sees.
#[derive(Clone, Copy, PartialEq)]
struct Seen {
    /// Region and emitter bit.
    value: u16,
    /// Shapes meet along edges that the light may cross, even where materials are the same.
    shape: usize,
    lit: bool,
    unsure: bool,
}

impl Seen {
    fn of(scene: &Scene, point: Option<&SurfacePoint>, shadows: bool) -> Self {
        let Some(point) = point else {
            return Self { value: 0, shape: usize::MAX, lit: false, unsure: false };
        };
        let material = scene.shapes()[point.shape].material;
        let emitter = scene.materials()[material].is_emitter();
        let blocked = shadows && point.visibility == Visibility::Blocked;
        // Offline, which has shadows, a mirror is black; realtime draws it as a diffuse color.
        let black = shadows && scene.materials()[material].model == MaterialModel::Mirror;
        let lit = point.faces_both() && !blocked && !emitter && !black;
        let grazes = |w: Vec3| Frame::cos_theta(w).abs() < GRAZING;
        let hangs_on_epsilon =
            shadows && point.visibility == Visibility::Unsure && point.faces_both();
        let flag = if emitter { RegionMask::EMITTER } else { 0 };
        Self {
            value: flag | (1 + 2 * material + usize::from(!lit)) as u16,
            shape: point.shape,
            lit,
            unsure: hangs_on_epsilon || grazes(point.wo) || grazes(point.wi),
        }
    }
}

/// Whether the specular lobe of a Phong material is near its peak.
fn in_highlight(scene: &Scene, point: &SurfacePoint) -> bool {
    let material = scene.material_of(point.shape);
    let mirrored = Vec3::new(-point.wo.x, -point.wo.y, point.wo.z);
    material.model == MaterialModel::Phong
        && point.wi.dot(mirrored).max(0.0).powf(material.exponent) > HIGHLIGHT
}
