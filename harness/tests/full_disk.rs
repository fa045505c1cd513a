//! A full disk is nobody's fault: what cannot be written is an error of the machine's, never a verdict.
//!
//! Each test mounts a tiny file system in a mount namespace of its thread alone, which only root may do.

#![cfg(target_os = "linux")]

use std::path::Path;
use std::sync::atomic::AtomicBool;

use basecode::exr_io::{Precision, write_exr};
use basecode::{Image, Vec3};
use nix::mount::{MsFlags, mount};
use nix::sched::{CloneFlags, unshare};
use umbra::assignment::Assignment;
use umbra::build::{Recording, compile};
use umbra::decode::Decoder;
use umbra::worker::{
    Adapter, AdapterKind, Fault, Job, Outcome, Request, SceneRef, Supervisor,
    is_environment_failure,
};

const UMBRA: &str = env!("CARGO_BIN_EXE_umbra");

/// A folder that holds `size` bytes at most, seen by this thread and what it starts; nothing, said so,
/// for whoever may not mount.
fn small_disk(size: &str) -> Option<tempfile::TempDir> {
    let folder = tempfile::tempdir().unwrap();
    let none = None::<&str>;
    let mounted = unshare(CloneFlags::CLONE_NEWNS)
        .and_then(|()| mount(none, "/", none, MsFlags::MS_REC | MsFlags::MS_PRIVATE, none))
        .and_then(|()| {
            let options = format!("size={size}");
            mount(Some("small"), folder.path(), Some("tmpfs"), MsFlags::empty(), Some(&*options))
        });
    match mounted {
        Ok(()) => Some(folder),
        Err(error) => {
            eprintln!("not tested: only root may mount a small disk ({error})");
            None
        }
    }
}

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap()
}

#[test]
fn an_image_that_cannot_be_decoded_for_want_of_space_is_not_refused() {
    let Some(disk) = small_disk("256k") else { return };
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("a.exr");
    let image = Image { width: 300, height: 300, pixels: vec![Vec3::ONE; 90_000] };
    write_exr(&file, &image, Precision::Half, &[]).unwrap();
    let limits = Assignment::load(root()).unwrap().limits.decode;
    let never = AtomicBool::new(false);
    let decoded = |scratch: &Path| {
        let supervisor = Supervisor::new(UMBRA.into(), scratch.to_owned());
        Decoder::new(&supervisor, &limits, &never).image(&file, "a.exr")
    };
    let error = decoded(disk.path()).unwrap_err();
    assert!(error.to_string().contains("No space left on device"), "{error}");
    assert_eq!(decoded(folder.path()).unwrap().unwrap(), image);
}

#[test]
fn a_plugin_that_cannot_be_kept_for_want_of_space_did_build() {
    let Some(disk) = small_disk("128k") else { return };
    let recording = Recording::obtain(root(), Path::new(UMBRA)).unwrap();
    let src = tempfile::tempdir().unwrap();
    std::fs::write(src.path().join("lib.rs"), "").unwrap();
    let limits = Assignment::load(root()).unwrap().limits.build;
    let supervisor = Supervisor::new(UMBRA.into(), src.path().to_owned());
    let never = AtomicBool::new(false);
    let report = compile(&recording, &supervisor, src.path(), disk.path(), &limits, &never);
    let error = report.unwrap_err();
    assert_eq!(error.kind(), std::io::ErrorKind::StorageFull, "{error}");
}

#[test]
fn a_worker_that_cannot_run_for_want_of_space_costs_nothing() {
    let Some(disk) = small_disk("64k") else { return };
    let supervisor = Supervisor::new(UMBRA.into(), disk.path().to_owned());
    let scene = root().join("scenes/a2/cbox/tinyrender/cbox_simple_realtime.toml");
    let request = Request::RenderRealtime {
        scene: SceneRef { path: scene, options: String::new() },
        width: 400,
        height: 300,
        shadow_map: false,
        adapter: Adapter { kind: AdapterKind::Software, name: String::new() },
        stages: Vec::new(),
        cameras: Vec::new(),
    };
    let mut request = request;
    if let Request::RenderRealtime { cameras, .. } = &mut request {
        let (eye, at, up) = ([0.0, 1.0, 5.0], [0.0; 3], [0.0, 1.0, 0.0]);
        cameras.push(umbra::worker::CameraValue {
            eye,
            at,
            up,
            fov_y_deg: 40.0,
            matrices: Default::default(),
        });
    }
    let job = Job { plugin: None, requests: vec![request] };
    let limits = Assignment::load(root()).unwrap().limits.run;
    let report = supervisor.run_job(&job, &limits, &AtomicBool::new(false), &mut |_| {});
    let outcome = &report.outcomes[0];
    assert_eq!(outcome.fault(), Some(Fault::Environment), "{outcome:?}");
    assert!(matches!(outcome, Outcome::NotRun { .. }) && !is_environment_failure(outcome));
}
