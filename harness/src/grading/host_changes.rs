//! What the host may change of what a pass is given: a pass that draws rightly then is wrong in that.

use basecode::{Matrices, Vec4};

use super::prepared_scene::PreparedScene;
use super::stages::{matrices, negated_normals, nothing_unset};
use super::usual_pipelines;
use crate::evidence::CheckId;
use crate::evidence::price::PriceClass;
use crate::worker::StageText;

/// What has a pass draw the right pictures.
#[derive(Clone)]
pub enum MendedBy {
    /// The same on every scene.
    Stage(StageText),
    /// The light in the place of one that is not set.
    Light(UnsetLight),
}

impl MendedBy {
    /// What the host replaces to have the pass draw a scene.
    pub fn stage(&self, case: &PreparedScene) -> StageText {
        match self {
            Self::Stage(stage) => stage.clone(),
            Self::Light(unset) => unset.stage(case),
        }
    }
}

/// What the host may change of what a pass is given.
#[derive(Clone)]
pub enum HostChange {
    /// How pipelines are made; mends a slip of this name.
    Pipelines(&'static str, StageText),
    /// The scene's normals, which are negated.
    Normals,
    /// The matrices of the camera.
    Matrices(Matrices),
}

impl HostChange {
    /// Those of pipelines.
    pub fn of_pipelines() -> Vec<Self> {
        usual_pipelines::slips().map(|(name, stage)| Self::Pipelines(name, stage)).collect()
    }

    /// All, the likeliest first.
    pub fn all() -> Vec<Self> {
        let under = [Matrices::InView, Matrices::InProjection, Matrices::Transposed];
        let of_vertices = std::iter::once(Self::Normals).chain(under.map(Self::Matrices));
        Self::of_pipelines().into_iter().chain(of_vertices).collect()
    }

    /// The part that is wrong where it mends all frames.
    pub fn part(&self) -> CheckId {
        match self {
            Self::Pipelines(..) => CheckId::PassUniforms,
            Self::Normals | Self::Matrices(_) => CheckId::StageVertex,
        }
    }

    /// What the host replaces.
    pub fn stage(&self) -> StageText {
        match self {
            Self::Pipelines(_, stage) => stage.clone(),
            Self::Normals => negated_normals(),
            Self::Matrices(which) => matrices(*which),
        }
    }
}

/// What of the light is not set, and how a pass holds it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum UnsetLight {
    /// Its intensity alone.
    Intensity,
    /// Its position and its intensity.
    Both {
        /// Whether the intensity comes first.
        intensity_first: bool,
        /// Whether the position is in view space, not in world space.
        in_view: bool,
        /// The fourth component of the position.
        w: f32,
    },
}

impl UnsetLight {
    /// All, the likeliest first.
    pub const ALL: [Self; 9] = [
        Self::Intensity,
        Self::both(false, false, 1.0),
        Self::both(false, true, 1.0),
        Self::both(true, false, 1.0),
        Self::both(true, true, 1.0),
        Self::both(false, false, 0.0),
        Self::both(false, true, 0.0),
        Self::both(true, false, 0.0),
        Self::both(true, true, 0.0),
    ];

    const fn both(intensity_first: bool, in_view: bool, w: f32) -> Self {
        Self::Both { intensity_first, in_view, w }
    }

    /// What is wrong, and what it is worth.
    pub fn slip(self) -> (&'static str, PriceClass) {
        match self {
            Self::Intensity => ("the light's intensity is not set", PriceClass::Slip),
            Self::Both { .. } => ("the light is not set", PriceClass::Concept),
        }
    }

    /// What the host replaces to have a pass draw a scene with its light.
    pub fn stage(self, case: &PreparedScene) -> StageText {
        let (scene, (width, height)) = (&case.expected.scene, case.film());
        let light = scene.first_light_position();
        let intensity = scene.first_light_intensity().extend(0.0);
        let position = |in_view: bool| {
            let camera = scene.camera(width as usize, height as usize).ok().filter(|_| in_view);
            camera.map_or(light, |camera| camera.view().transform_point3(light))
        };
        let in_turn: Vec<Vec4> = match self {
            Self::Intensity => vec![intensity],
            Self::Both { intensity_first, in_view, w } => {
                let position = position(in_view).extend(w);
                if intensity_first { vec![intensity, position] } else { vec![position, intensity] }
            }
        };
        nothing_unset(light, &in_turn)
    }
}

/// What is wrong with the matrices of a pass that is right under other ones, and which these are.
pub fn slip_of_matrices(
    is_right: &dyn Fn(Matrices) -> bool,
) -> Option<((&'static str, PriceClass), Matrices)> {
    use Matrices::{InProjection, InView, Transposed};
    let exchanged = ("view and projection are exchanged", PriceClass::Slip);
    Some(match (is_right(InView), is_right(InProjection)) {
        (true, true) => (exchanged, InView),
        (true, false) => (("the projection is missing", PriceClass::Concept), InView),
        (false, true) => (("the view matrix is missing", PriceClass::Concept), InProjection),
        (false, false) if is_right(Transposed) => {
            (("the position stands on the left of the matrices", PriceClass::Slip), Transposed)
        }
        (false, false) => return None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_matrices_mend_is_told_by_which_do() {
        let of = |right: &[Matrices]| slip_of_matrices(&|which| right.contains(&which));
        use Matrices::{InProjection, InView, Transposed};
        assert_eq!(of(&[]), None);
        let class = |right: &[Matrices]| of(right).map(|((_, class), _)| class);
        assert_eq!(class(&[InView, InProjection]), Some(PriceClass::Slip));
        assert_eq!(class(&[InView]), Some(PriceClass::Concept));
        assert_eq!(class(&[InProjection]), Some(PriceClass::Concept));
        assert_eq!(class(&[Transposed]), Some(PriceClass::Slip));
    }
}
