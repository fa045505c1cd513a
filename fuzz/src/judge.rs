//! From a submitted EXR to its checks: whatever bits its pixels hold.

use std::fs;
use std::sync::{LazyLock, OnceLock};

use basecode::exr_io::{Precision, decode_exr, write_exr};
use basecode::{Image, Matrices, Vec3};
use umbra::assignment::SceneEntry;
use umbra::evidence::images::{self, ImageKind};
use umbra::evidence::stage_film::StageFilm;
use umbra::evidence::stages::{BoundValue, judge_pass};
use umbra::evidence::vertex::judge_vertex;
use umbra::evidence::{Check, CheckId};
use umbra::expected::{Expected, SurfaceBuffer, load_scene, regions};
use umbra::grading::submitted::{SubmittedImage, judge as judge_submitted};
use umbra::grading::{Drawn, ImageDigest, PreparedScene, ProbeFilm};
use umbra::imaging::metrics::Metrics;
use umbra::imaging::noise::NoisyPixels;
use umbra::imaging::pictures::{signed_error, tone_mapped};
use umbra::imaging::reference::{ReferenceImage, RegionMask};
use umbra::imaging::tolerances::Tolerances;
use umbra::worker::CameraValue;

const WIDTH: usize = 48;
const HEIGHT: usize = 36;

const TOML: &str = "[input]\nobjfile = \"a.obj\"\n[camera]\neye = [0.0, 3.0, 5.0]\nat = [0.0, 0.5, 0.0]\nfov = 50.0\n";
const MTL: &str = "newmtl grey\nKd 0.5 0.5 0.5\nillum 7\nnewmtl shiny\nKd 0.2 0.2 0.2\nKs 0.6 0.6 0.6\n\
    Ns 30\nillum 3\nnewmtl lamp\nKd 0 0 0\nKe 9 9 9\nillum 7\n";

/// A floor, some Phong blades over it, and a lamp.
fn obj() -> String {
    let mut text =
        "mtllib a.mtl\no floor\nusemtl grey\nv -4 0 -4\nv 4 0 -4\nv 4 0 4\nv -4 0 4\nf 4 3 2 1\n\
         o lamp\nusemtl lamp\nv 0 4 0\nv 0.01 4 0\nv 0 4 0.01\nf 5 6 7\n"
            .to_owned();
    for blade in 0..6 {
        let (x, first) = (f64::from(blade) - 2.5, 8 + 3 * blade);
        text.push_str(&format!(
            "o blade{blade}\nusemtl shiny\nv {x} 1 -1\nv {} 1 -1\nv {x} 1.2 1\nf {} {} {first}\n",
            x + 0.5,
            first + 2,
            first + 1,
        ));
    }
    text
}

/// A scene of this file's own, made ready.
static CASE: LazyLock<PreparedScene> = LazyLock::new(|| {
    let folder = tempfile::tempdir().expect("a folder");
    for (name, text) in [("a.toml", TOML), ("a.obj", &obj()), ("a.mtl", MTL)] {
        fs::write(folder.path().join(name), text).expect("our own folder");
    }
    let toml = folder.path().join("a.toml");
    let scene = load_scene(&toml).expect("a scene of ours");
    let [shadowed, unshadowed_mask] = regions(&scene, WIDTH, HEIGHT).expect("a camera");
    let mean = right(&shadowed);
    let noisy = |flags: &u16| Vec3::splat(if flags & RegionMask::EDGE == 0 { 1e-4 } else { 0.2 });
    let variance = shadowed.pixels.iter().map(noisy).collect();
    let variance = Image { width: WIDTH, height: HEIGHT, pixels: variance };
    let offline = ReferenceImage::new(mean.clone(), variance, 256, mean, shadowed.clone());
    let offline = offline.expect("something is lit");
    NoisyPixels::new(&offline).expect("edges enough to tell noise by");
    let unshadowed = right(&unshadowed_mask);
    let surface = SurfaceBuffer::new(&scene, WIDTH, HEIGHT).expect("a camera");
    let probe_film = ProbeFilm {
        width: WIDTH as u32,
        height: HEIGHT as u32,
        surface,
        mask: shadowed,
        unshadowed_mask: unshadowed_mask.clone(),
        unshadowed: unshadowed.clone(),
        interpolated_normals: None,
        sampled: None,
    };
    let expected = Expected {
        scene,
        offline,
        interpolated_normals: Some(unshadowed.clone()),
        unshadowed,
        unshadowed_mask,
    };
    let camera = CameraValue {
        eye: [0.0, 3.0, 5.0],
        at: [0.0; 3],
        up: [0.0, 1.0, 0.0],
        fov_y_deg: 50.0,
        matrices: Matrices::Usual,
    };
    PreparedScene {
        entry: SceneEntry {
            name: "a".into(),
            offline: toml.clone(),
            realtime: toml.clone(),
            bonus: None,
            bonus_required: false,
            weight: 1.0,
            film: None,
            stored: false,
            held_back_copies: false,
            submitted: None,
        },
        held_back: false,
        offline: toml.clone(),
        realtime: toml,
        bonus: None,
        spp: 16,
        camera,
        expected,
        first: None,
        probe_film,
        batch: OnceLock::new(),
    }
});

/// Lit surfaces are bright, all else is black.
fn right(mask: &RegionMask) -> Image {
    let value = |flags: &u16| Vec3::splat(if mask.region(*flags).lit { 0.5 } else { 0.0 });
    Image { width: WIDTH, height: HEIGHT, pixels: mask.pixels.iter().map(value).collect() }
}

/// A submitted image: the first byte says how the others are to be read, as the pixels' bits in half or
/// single precision; what is missing at the end is right. Its checks are made, none twice different, and
/// every measure and picture can be shown.
pub fn judge(bytes: &[u8]) {
    let Some((how, bits)) = bytes.split_first() else { return };
    let precision = if how & 1 == 0 { Precision::Half } else { Precision::Float };
    let image = through_a_file(bits, precision);
    let case = &*CASE;
    let tolerances = Tolerances::default();
    for kind in [
        ImageKind::Offline { spp: case.spp },
        ImageKind::SubmittedRealtime,
        ImageKind::SubmittedShadows,
    ] {
        for drawn_as in
            [ImageKind::Offline { spp: case.spp }, ImageKind::Realtime, ImageKind::RealtimeShadows]
        {
            let submitted = SubmittedImage::new(case, "a.exr", kind, Ok(image.clone()));
            let own = Image { pixels: image.pixels.iter().rev().copied().collect(), ..image };
            let drawn = [Drawn { scene: "a".into(), kind: drawn_as, image: own }];
            check(&judge_submitted(&submitted, &drawn, &[], &tolerances).0);
        }
    }
    // The same bits may come from the code itself.
    for kind in [ImageKind::Offline { spp: 1 }, ImageKind::Realtime, ImageKind::RealtimeShadows] {
        let expected = &case.expected;
        check(&[images::judge(
            CheckId::ImageOffline,
            "a",
            kind,
            &image,
            expected,
            &|_| true,
            &tolerances,
        )]);
    }
    let ProbeFilm { surface, mask, .. } = &case.probe_film;
    let camera = case.expected.scene.camera(WIDTH, HEIGHT).expect("a camera");
    let film = StageFilm { scene: &case.expected.scene, camera, surface, mask };
    check(&[judge_vertex("a", &film, [[&image, &image]; Matrices::ALL.len()])]);
    let frames = BoundValue::ALL.map(|bound| (bound, image.clone()));
    check(&[judge_pass("a", &film, &frames, &image, &|_, _| true)]);
    ImageDigest::new("a", "a.exr", &image);
    let (reference, mask) = (&case.expected.offline.mean, &case.expected.offline.mask);
    let scale = case.expected.offline.median_lit;
    let pictures =
        [Some(tone_mapped(&image, scale)), signed_error(&image, reference, mask, scale, 0.1)];
    for picture in pictures {
        picture.expect("of one size").png().expect("a picture");
    }
    Metrics::measure(&image, reference).expect("of one size");
}

/// An EXR whose pixels begin with these bits, written and read.
fn through_a_file(bits: &[u8], precision: Precision) -> Image {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("a.exr");
    write_exr(&path, &CASE.expected.offline.mean, precision, &[]).expect("our own folder");
    let mut file = fs::read(&path).expect("our own file");
    // Each line: its number and its size, four bytes each, then its channels.
    let line = 8 + 3 * WIDTH * if precision == Precision::Half { 2 } else { 4 };
    let first = file.len() - HEIGHT * line;
    for (line, bits) in file[first..].chunks_mut(line).zip(bits.chunks(line - 8)) {
        line[8..8 + bits.len()].copy_from_slice(bits);
    }
    let mut content = decode_exr(&file, &path).expect("any bits are pixels");
    content.layers.pop_first().expect("one layer").1
}

fn check(checks: &[Check]) {
    assert!(!checks.is_empty());
    for check in checks {
        assert!(!check.summary.is_empty() && check.error >= 0.0, "{check:?}");
        // What JSON cannot hold comes back as NaN, and everything else as it was.
        let text = serde_json::to_string(check).expect("plain data");
        let back: Check = serde_json::from_str(&text).expect("plain data");
        assert_eq!(serde_json::to_string(&back).expect("plain data"), text);
    }
}
