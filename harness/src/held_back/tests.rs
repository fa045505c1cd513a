//! Held-back scenes are the same for a seed, other for another, and always worth asking about.

use basecode::{Scene, Vec3};
use rayon::prelude::*;

use super::*;
use crate::expected::regions;
use crate::imaging::reference::RegionMask;

fn assignment() -> Assignment {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap();
    Assignment::load(root).unwrap()
}

/// The scenes of which copies are held back.
fn originals() -> Vec<(SceneEntry, Scene)> {
    let assignment = assignment();
    let held_back = assignment.scenes.iter().filter(|scene| scene.held_back_copies);
    let all = held_back
        .map(|entry| (entry.clone(), load_scene(&assignment.root.join(&entry.offline)).unwrap()));
    let all: Vec<_> = all.collect();
    assert!(all.len() >= 3 && all.iter().filter(|(entry, _)| entry.bonus.is_some()).count() >= 2);
    all
}

#[test]
fn the_same_seed_gives_the_same_bytes_and_another_gives_others() {
    let root = assignment().root;
    for (entry, _) in originals() {
        let files = |seed| scene_files(&root, &entry, seed).unwrap();
        let first = files(u64::MAX);
        assert_eq!(first, files(u64::MAX));
        let folder = root.join(&entry.offline).parent().unwrap().parent().unwrap().to_owned();
        for ((name, bytes), (other_name, other)) in first.iter().zip(files(7)) {
            assert_eq!(*name, other_name);
            assert_ne!(*bytes, other, "{}", name.display());
            // Told of by the names of the original, and nothing of it left as it was.
            let original = std::fs::read(folder.join(name)).unwrap();
            assert_ne!(*bytes, original, "{}", name.display());
            assert_eq!(
                bytes.split(|b| *b == b'\n').count(),
                original.split(|b| *b == b'\n').count()
            );
        }
    }
}

#[test]
fn the_required_bonus_takes_no_wider_frustum_than_the_scenes_to_choose_from() {
    let assignment = assignment();
    let preview = |entry: &SceneEntry| {
        let scene = load_scene(&assignment.root.join(&entry.offline)).unwrap();
        ScenePreview::new(&scene, &ChangedScene::original(&scene)).unwrap()
    };
    let with_bonus = assignment.scenes.iter().filter(|scene| scene.bonus.is_some());
    let (required, free): (Vec<_>, Vec<_>) = with_bonus.partition(|scene| scene.bonus_required);
    assert!(!required.is_empty() && free.len() >= 2);
    for own in required.iter().map(|entry| preview(entry)) {
        for other in free.iter().map(|entry| preview(entry)) {
            assert!(own.shadow_cone <= other.shadow_cone, "{own:?} {other:?}");
            assert!(own.facing_cone <= other.facing_cone, "{own:?} {other:?}");
        }
        assert!(own.shadowed > 0.03 && own.of_model.iter().all(|lit| *lit > 0.1), "{own:?}");
    }
}

#[test]
fn files_say_what_was_drawn() {
    let root = assignment().root;
    for (entry, scene) in originals() {
        let draw = ChangedScene::new(&scene, 99);
        let out = tempfile::tempdir().unwrap();
        let folder = write(out.path(), &files::changed(&root, &entry, &scene, &draw).unwrap());
        let folder = folder.unwrap();
        for toml in [Some(&entry.offline), Some(&entry.realtime), entry.bonus.as_ref()] {
            let Some(toml) = toml else { continue };
            let changed = load_scene(&folder.join(files::below(toml).unwrap())).unwrap();
            assert!(changed.first_light_position().distance(draw.light) < 2e-6);
            assert_eq!(changed.first_light_intensity(), draw.intensity);
            let (config, old) =
                (changed.config(), basecode::scene::SceneConfig::load(&root.join(toml)));
            let old = old.unwrap();
            assert_eq!(config.camera, draw.camera);
            assert_eq!([config.width, config.height], draw.film);
            assert_eq!(
                (config.realtime, config.bonus, config.spp),
                (old.realtime, old.bonus, old.spp)
            );
            for (material, surface) in changed.materials().iter().zip(&draw.surfaces) {
                if !material.is_emitter() {
                    assert_eq!(material.diffuse.average(), surface.diffuse);
                    assert_eq!(material.specular.average(), surface.specular);
                    assert_eq!(material.exponent, surface.exponent);
                }
            }
        }
    }
}

#[test]
fn two_hundred_seeds_give_scenes_that_show_light_shadow_and_highlight() {
    for (entry, scene) in originals() {
        let original = ScenePreview::new(&scene, &ChangedScene::original(&scene)).unwrap();
        (0..200u64).into_par_iter().for_each(|seed| {
            let attempts = (0..TRIES / 2).map(|attempt| {
                ScenePreview::new(
                    &scene,
                    &ChangedScene::new(&scene, sub_seed(seed, &entry.name, attempt)),
                )
                .unwrap()
            });
            let bonus = entry.bonus.is_some();
            let found = attempts.map(|preview| (preview, preview.problem(&original, bonus)));
            let (preview, _) = found
                .into_iter()
                .find(|(_, problem)| problem.is_none())
                .unwrap_or_else(|| panic!("{}: seed {seed} takes half of the tries", entry.name));
            assert!(
                preview.lit > 0.1 && preview.shadowed > 5e-3 && preview.highlight > 5e-4,
                "{preview:?}"
            );
        });
    }
}

/// By the masks that images are judged with, which know nothing of the preview.
#[test]
fn accepted_scenes_have_enough_pixels_away_from_edges() {
    let root = assignment().root;
    for (entry, _) in originals() {
        (0..3u64).into_par_iter().for_each(|seed| {
            let out = tempfile::tempdir().unwrap();
            let folder = write(out.path(), &scene_files(&root, &entry, seed).unwrap()).unwrap();
            let changed = load_scene(&folder.join(files::below(&entry.offline).unwrap())).unwrap();
            let (width, height) = (changed.config().width, changed.config().height);
            let [with, without] = regions(&changed, width, height).unwrap();
            let clear = |value: u16| value & (RegionMask::EDGE | RegionMask::EMITTER) == 0;
            let both = || with.pixels.iter().zip(&without.pixels);
            let lit = both().filter(|(a, _)| with.is_lit_interior(**a)).count();
            let dark = both()
                .filter(|&(&a, &b)| clear(a) && !with.region(a).lit && without.is_lit_interior(b));
            let peak = both().filter(|(a, _)| clear(**a) && **a & RegionMask::HIGHLIGHT != 0);
            let counts = [lit, dark.count(), peak.count()];
            assert!(
                counts[0] > 500 && counts[1] >= 30 && counts[2] >= 4,
                "{} from seed {seed}: {counts:?}",
                entry.name
            );
        });
    }
}

#[test]
fn what_shows_too_little_is_drawn_again() {
    let (_, scene) =
        originals().into_iter().find(|(entry, _)| entry.name == "sphere_phong").unwrap();
    let original = ChangedScene::original(&scene);
    let first = ScenePreview::new(&scene, &original).unwrap();
    let problem = |change: &dyn Fn(&mut ChangedScene)| {
        let mut draw = ChangedScene { film: [96, 96], ..original.clone() };
        change(&mut draw);
        ScenePreview::new(&scene, &draw).unwrap().problem(&first, true)
    };
    let center = Vec3::new(0.0, 0.995, 0.0);
    assert_eq!(problem(&|_| ()), None);
    type Case<'a> = (&'a str, &'a dyn Fn(&mut ChangedScene));
    let cases: [Case; 9] = [
        ("too little is lit", &|draw| draw.light = center),
        ("too little is lit", &|draw| draw.light.y = -9.0),
        ("too little is in shadow", &|draw| draw.light = draw.camera.eye),
        ("no highlight is seen", &|draw| draw.surfaces.iter_mut().for_each(|s| s.exponent = 3e4)),
        ("it is too dark or too bright", &|draw| draw.intensity *= 40.0),
        ("it is too dark or too bright", &|draw| draw.intensity *= 0.01),
        ("the light is too near to a surface", &|draw| draw.light = center + Vec3::Y * 1.05),
        ("the camera is too near to a surface", &|draw| {
            draw.camera.eye = Vec3::new(0.0, 0.01, 4.0)
        }),
        ("the film has the original's shape", &|draw| draw.film = [100, 75]),
    ];
    for (why, change) in cases {
        assert_eq!(problem(change), Some(why));
    }
    // A light that comes near sees the shadow under a wider angle.
    let near = |draw: &mut ChangedScene| {
        draw.light = center + Vec3::new(-0.75, 0.9, 0.9);
        draw.intensity *= 0.1;
    };
    assert_eq!(problem(&near), Some("one frustum does not hold the shadows"));
}

#[test]
fn folders_are_for_their_owner_and_found_again() {
    let out = tempfile::tempdir().unwrap();
    let parent = out.path().join("held_back");
    let files = vec![(PathBuf::from("mesh/a.obj"), b"v 0 0 0\n".to_vec())];
    let folder = write(&parent, &files).unwrap();
    assert_eq!(write(&parent, &files).unwrap(), folder);
    assert_eq!(std::fs::read(folder.join("mesh/a.obj")).unwrap(), files[0].1);
    assert_eq!(parent.read_dir().unwrap().count(), 1, "no draft is left");
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        assert_eq!(parent.metadata().unwrap().permissions().mode() & 0o777, 0o700);
    }
}

#[test]
fn processes_that_ask_at_the_same_time_get_the_same_seed() {
    for _ in 0..20 {
        let place = tempfile::tempdir().unwrap();
        let file = place.path().join("instructor/seed.txt");
        let seeds: Vec<Option<u64>> = std::thread::scope(|scope| {
            let ask = || scope.spawn(|| super::recorded_seed(&file, None).unwrap());
            let threads: Vec<_> = (0..4).map(|_| ask()).collect();
            threads.into_iter().map(|thread| thread.join().unwrap()).collect()
        });
        assert!(seeds.iter().all(|seed| *seed == seeds[0]), "{seeds:?}");
    }
}
