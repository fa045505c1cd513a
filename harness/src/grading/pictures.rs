//! Pictures of what is wrong, and the images themselves for the viewer.

use std::collections::BTreeMap;
use std::path::Path;

use basecode::Image;

use super::offline::Drawn;
use super::prepared_scene::PreparedScene;
use super::record::{Folders, SceneErrors};
use super::submitted::SubmittedImage;
use crate::evidence::images::{ImageKind, compare_pixels, reference_of};
use crate::evidence::{Check, CheckId, Picture, Verdict};
use crate::imaging::error_map::ErrorMap;
use crate::imaging::pictures::{self, full_scale, signed_error, tone_mapped};
use crate::imaging::tolerances::Tolerances;
use crate::viewer::{
    ImageFile, Layer, LayerKind, ViewedCase, remove_others, write_excess, write_image, write_mask,
    write_shared,
};

/// What the values of renders are.
const UNIT: &str = "radiance L [W m⁻² sr⁻¹]";
/// The median lit value comes to this linear value in the viewer.
const MIDDLE: f32 = 0.18;
/// Relative differences are relative to no less than this fraction of the median lit value.
const DARKEST: f32 = 0.05;
/// The images of one submission for the viewer take so many bytes at most, students' and instructor's together: a
/// folder that is handed back must stay small.
const MOST_BYTES: u64 = 20_000_000;

/// The images of a submission, and what they are compared with.
pub struct Images<'a> {
    /// The scenes.
    pub cases: &'a [PreparedScene],
    /// What its code drew.
    pub drawn: &'a [Drawn],
    /// What it holds.
    pub submitted: &'a [SubmittedImage<'a>],
}

impl Images<'_> {
    /// Draws the pictures of every failed check of images into one of the folders and notes them in the checks.
    ///
    /// # Errors
    /// When a file cannot be written.
    pub fn draw(&self, checks: &mut [Check], out: &Folders) -> anyhow::Result<()> {
        for check in checks.iter_mut().filter(|check| check.verdict == Verdict::Fail) {
            let Some(case) = self.case_of(check) else { continue };
            let out = if check.held_back { &out.instructor } else { &out.student };
            if let Some((kind, actual)) = self.image_of(check, case) {
                check.pictures = triple(check.id, case, kind, actual, out)?;
            }
            let rays = std::mem::take(&mut check.wrong_rays);
            if !rays.is_empty() {
                check.pictures = vec![ray_map(case, &rays, out)?];
            }
        }
        Ok(())
    }

    /// Where the errors lie of those that the code drew wrongly.
    pub fn error_maps(&self, checks: &[Check]) -> Vec<SceneErrors> {
        let failed = checks.iter().filter(|check| check.verdict == Verdict::Fail);
        let map = |check: &Check| {
            let case = self.case_of(check)?;
            let (kind, actual) = self.image_of(check, case)?;
            let own = [ImageKind::Realtime, ImageKind::RealtimeShadows].contains(&kind)
                || check.id == CheckId::ImageOffline;
            let (reference, mask) = reference_of(kind, &case.expected);
            let map = ErrorMap::of(actual, reference, mask, case.expected.offline.median_lit)?;
            let (scene, held_back) = (check.scene.clone(), check.held_back);
            own.then_some(SceneErrors { check: check.id, scene, held_back, map })
        };
        failed.filter_map(map).collect()
    }

    /// Writes the images of each kind of check that failed, on its worst scene, public and held back, for the viewer.
    ///
    /// # Errors
    /// When a file cannot be written.
    pub fn view(
        &self,
        checks: &[Check],
        tolerances: &Tolerances,
        out: &Folders,
    ) -> anyhow::Result<Vec<ViewedCase>> {
        let mut worst: BTreeMap<(bool, CheckId), &Check> = BTreeMap::new();
        let failed = checks.iter().filter(|check| check.verdict == Verdict::Fail);
        for check in failed.filter(|check| !check.pictures.is_empty()) {
            let kept = worst.entry((check.held_back, check.id)).or_insert(check);
            if check.error > kept.error {
                *kept = check;
            }
        }
        let (mut views, mut bytes) = (Vec::new(), 0);
        for check in worst.into_values() {
            let Some(case) = self.case_of(check) else { continue };
            let Some((kind, actual)) = self.image_of(check, case) else { continue };
            let folder = if check.held_back { &out.instructor } else { &out.student };
            let view = view(check, case, kind, actual, tolerances, folder)?;
            let size = |file: &&str| folder.join(file).metadata().map_or(0, |meta| meta.len());
            let own: u64 = view.files().iter().map(size).sum();
            if bytes + own > MOST_BYTES {
                continue;
            }
            bytes += own;
            views.push(view);
        }
        for (held_back, folder) in [(false, &out.student), (true, &out.instructor)] {
            let own = views.iter().filter(|view| view.held_back == held_back);
            remove_others(folder, &own.collect::<Vec<_>>())?;
        }
        Ok(views)
    }

    fn case_of(&self, check: &Check) -> Option<&PreparedScene> {
        self.cases.iter().find(|case| case.entry.name == check.scene)
    }

    /// The image that a check is about, and how it came about.
    fn image_of(&self, check: &Check, case: &PreparedScene) -> Option<(ImageKind, &Image)> {
        let own = |kind: ImageKind| {
            let own = self.drawn.iter().find(|d| d.scene == check.scene && d.kind == kind);
            Some((kind, &own?.image))
        };
        match check.id {
            CheckId::ImageOffline => own(ImageKind::Offline { spp: case.spp }),
            CheckId::ImageRealtime => own(ImageKind::Realtime),
            CheckId::BonusImage | CheckId::BonusProbe => own(ImageKind::RealtimeShadows),
            _ => self.submitted.iter().find_map(|image| image.shown_by(check)),
        }
    }
}

fn triple(
    id: CheckId,
    case: &PreparedScene,
    kind: ImageKind,
    actual: &Image,
    out: &Path,
) -> anyhow::Result<Vec<Picture>> {
    let (reference, mask) = reference_of(kind, &case.expected);
    let scale = case.expected.offline.median_lit;
    let full = full_scale(actual, reference, mask, scale);
    let mut pictures = Vec::new();
    for (title, picture) in [
        ("actual", Some(tone_mapped(actual, scale))),
        ("expected", Some(tone_mapped(reference, scale))),
        ("difference", signed_error(actual, reference, mask, scale, full)),
    ] {
        let Some(picture) = picture else { continue };
        let name = format!("{}-{}-{title}", case.entry.name, id.name().replace('.', "-"));
        pictures.push(write_picture(&picture, title, &name, out)?);
    }
    Ok(pictures)
}

fn write_picture(
    picture: &pictures::Picture,
    title: &str,
    name: &str,
    out: &Path,
) -> anyhow::Result<Picture> {
    std::fs::create_dir_all(out)?;
    let file = format!("{name}.png");
    std::fs::write(out.join(&file), picture.png()?)?;
    let title = format!("{title} ({})", picture.caption);
    Ok(Picture { title, file, width: picture.width, height: picture.height })
}

/// The rays that were judged wrongly, over what the probe film shows.
fn ray_map(case: &PreparedScene, rays: &[(usize, bool)], out: &Path) -> anyhow::Result<Picture> {
    let film = &case.probe_film;
    let picture = pictures::ray_map(&film.unshadowed, rays, case.expected.offline.median_lit);
    write_picture(&picture, "shadow rays", &format!("{}-shadow-rays", case.entry.name), out)
}

/// One case of the viewer, its data written below `folder`.
fn view(
    check: &Check,
    case: &PreparedScene,
    kind: ImageKind,
    actual: &Image,
    tolerances: &Tolerances,
    folder: &Path,
) -> anyhow::Result<ViewedCase> {
    let expected = &case.expected;
    let (reference, mask) = reference_of(kind, expected);
    let median = expected.offline.median_lit;
    let scene = &check.scene;
    let (what, note) = match kind {
        ImageKind::Offline { spp } => ("offline", format!("{spp} samples per pixel")),
        ImageKind::Realtime | ImageKind::SubmittedRealtime => ("realtime", String::new()),
        ImageKind::RealtimeShadows | ImageKind::SubmittedShadows => ("bonus", String::new()),
    };
    let submitted = matches!(kind, ImageKind::SubmittedRealtime | ImageKind::SubmittedShadows)
        || check.id == CheckId::SubmittedOffline;
    let whose = if submitted { "submitted image" } else { "drawn by the code" };
    let mut view = ViewedCase {
        id: check.name(),
        title: format!("{scene}, {what}, {whose}"),
        note,
        held_back: check.held_back,
        exposure: Some(f64::from((MIDDLE / median.max(f32::MIN_POSITIVE)).log2())),
        floor: Some(DARKEST * median),
        unit: UNIT.to_owned(),
        ..ViewedCase::default()
    };
    let mine = write_image(folder, actual)?;
    view.layers = vec![Layer::image("actual", &mine)];
    // An image of another size stands alone.
    let Ok((found, excess)) = compare_pixels(kind, actual, expected, tolerances) else {
        return Ok(view);
    };
    // A student's folder is whole by itself; the instructor's have what all are compared with once.
    let write = |image: &dyn Fn(&Path) -> std::io::Result<ImageFile>| match check.held_back {
        true => write_shared(folder, image),
        false => image(folder),
    };
    let right = write(&|folder| write_image(folder, reference))?;
    view.reference = Some(view.layers.len());
    view.layers.push(Layer::image("expected", &right));
    view.layers.push(Layer::difference("difference", &mine, &right));
    let size = (actual.width, actual.height);
    let layer = |name: &str, kind, image: ImageFile| Layer {
        name: name.into(),
        kind,
        image,
        against: None,
    };
    let excess = write_excess(folder, size, &excess)?;
    view.layers.push(layer("difference over bound", LayerKind::Excess, excess));
    view.layers.push(layer(
        "regions",
        LayerKind::Regions,
        write(&|folder| write_mask(folder, mask))?,
    ));
    view.regions = mask.regions.iter().map(|region| region.name.clone()).collect();
    view.worst = found.worst.map(|worst| [worst.x, worst.y]);
    view.area = found.largest_failing.map(|area| [area.x, area.y, area.width, area.height]);
    Ok(view)
}
