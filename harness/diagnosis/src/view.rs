//! Views: the questions whose answers are compared with those of known mistakes.

use std::collections::BTreeMap;
use std::fmt;

use basecode::Image;

use super::fit::{Bound, Sample, ShadowRay, VertexSeen};
use super::thumbnail::Thumbnail;

/// What was asked.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum ViewKind {
    /// The diffuse BSDF at the probes of part 1.1.
    Diffuse,
    /// The Phong BSDF at the probes of part 1.2.
    Phong,
    /// Radiance without shadows at pixel centers, under a witness BSDF.
    Lit,
    /// Visibility at pixel centers, under a witness BSDF.
    Shadow,
    /// The offline image at one sample per pixel.
    Offline,
    /// The offline image at the scene's own samples per pixel.
    Film,
    /// The realtime image.
    Realtime,
    /// The fragment stages alone, under a right vertex stage.
    Fragment,
    /// The bonus' image over the plain one.
    Bonus,
}

impl ViewKind {
    /// All of them.
    pub const ALL: [Self; 9] = [
        Self::Diffuse,
        Self::Phong,
        Self::Lit,
        Self::Shadow,
        Self::Offline,
        Self::Film,
        Self::Realtime,
        Self::Fragment,
        Self::Bonus,
    ];

    /// Its name in files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Diffuse => "diffuse",
            Self::Phong => "phong",
            Self::Lit => "lit",
            Self::Shadow => "shadow",
            Self::Offline => "offline",
            Self::Film => "film",
            Self::Realtime => "realtime",
            Self::Fragment => "fragment",
            Self::Bonus => "bonus",
        }
    }

    /// Whether its tiles are pictures of the scene.
    pub fn is_picture(self) -> bool {
        matches!(self, Self::Offline | Self::Realtime)
    }
}

/// A question on a scene.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct View {
    /// What is asked.
    pub kind: ViewKind,
    /// Name of the scene; empty for BSDFs given by value.
    pub scene: String,
}

impl View {
    /// A question on a scene.
    pub fn new(kind: ViewKind, scene: &str) -> Self {
        Self { kind, scene: scene.to_owned() }
    }

    /// The view of a name that [`View`] was shown as.
    pub fn named(name: &str) -> Option<Self> {
        let (kind, scene) = name.split_once('-').unwrap_or((name, ""));
        let kind = ViewKind::ALL.into_iter().find(|known| known.name() == kind)?;
        Some(Self::new(kind, scene))
    }
}

impl fmt::Display for View {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        match self.scene.as_str() {
            "" => write!(f, "{}", self.kind.name()),
            scene => write!(f, "{}-{scene}", self.kind.name()),
        }
    }
}

/// What one renderer answered.
#[derive(Clone, Debug, Default)]
pub struct Observations {
    /// The tiles of its answers.
    pub tiles: BTreeMap<View, Thumbnail>,
    /// By scene: radiance along the centers of all pixels, and the image that its own loop made of it.
    pub loops: BTreeMap<String, LoopSeen>,
    /// By part: points that were shaded, and the answers.
    pub shaded: BTreeMap<&'static str, Vec<Sample>>,
    /// Shadow rays with their occluders, where shadows are wrong.
    pub shadow_rays: Vec<ShadowRay>,
    /// What the render pass bound.
    pub bound: Vec<Bound>,
    /// What the vertex stage forwards.
    pub vertices: Vec<VertexSeen>,
}

/// The same pixels twice: along the host's rays, and by the renderer's own loop.
#[derive(Clone, Debug)]
pub struct LoopSeen {
    /// Radiance along the rays.
    pub rays: Image,
    /// The image at one sample per pixel.
    pub image: Image,
}

impl Observations {
    /// Adds what was answered elsewhere, after what is here.
    pub fn absorb(&mut self, other: Self) {
        let Self { tiles, loops, shaded, shadow_rays, bound, vertices } = other;
        for (view, tile) in tiles {
            self.record(view, tile);
        }
        self.loops.extend(loops);
        for (part, samples) in shaded {
            self.shaded.entry(part).or_default().extend(samples);
        }
        self.shadow_rays.extend(shadow_rays);
        self.bound.extend(bound);
        self.vertices.extend(vertices);
    }

    /// Keeps an answer. Answers to the same question fill each other's gaps.
    pub fn record(&mut self, view: View, tile: Thumbnail) {
        if tile.is_empty() {
            return;
        }
        match self.tiles.get_mut(&view) {
            Some(own) => own.fill(&tile),
            None => {
                self.tiles.insert(view, tile);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn views_have_names() {
        for kind in ViewKind::ALL {
            for scene in ["", "cbox", "sphere_phong", "a-b"] {
                let view = View::new(kind, scene);
                assert_eq!(View::named(&view.to_string()), Some(view));
            }
        }
        assert_eq!(View::named("colour-cbox"), None);
    }
}
