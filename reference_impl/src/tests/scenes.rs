//! Compares with the scenes (throw-away).
use std::path::Path;

use basecode::gpu::{AdapterKind, Gpu, Target};
use basecode::{Film, Image, RenderJob, Renderer, Scene, Vec3};

use crate::Reference;

#[test]
fn look() {
    let folder = std::env::var("SCENES").unwrap();
    let t = std::time::Instant::now();
    let gpu = Gpu::open(AdapterKind::Any, "").unwrap();
    println!("{:?} open {:?}", gpu.adapter.name, t.elapsed());
    for (name, toml, bonus) in [
        ("sphere_diffuse", "sphere_diffuse/tinyrender/sphere_diffuse_offline.toml", false),
        ("sphere_phong", "sphere_phong/tinyrender/sphere_phong_offline.toml", false),
        ("teapot", "teapot/tinyrender/teapot_simple_offline.toml", false),
        ("cbox", "cbox/tinyrender/cbox_simple_offline.toml", false),
        ("sphere_phong", "sphere_phong/tinyrender/sphere_phong_offline.toml", true),
        ("teapot", "teapot/tinyrender/teapot_simple_offline.toml", true),
        ("cbox", "cbox/tinyrender/cbox_simple_offline.toml", true),
    ] {
        let renderer = Reference;
        let scene =
            Scene::load(&Path::new(&folder).join(toml), &|material| renderer.bsdf(material))
                .unwrap();
        let (width, height) = (scene.config().width, scene.config().height);
        let t = std::time::Instant::now();
        let target = Target::new(&gpu, width, height).unwrap();
        let mut pass = None;
        gpu.checked(&mut || {
            pass = Some(renderer.render_pass("direct", &gpu, &scene, bonus)?);
            Ok(())
        })
        .unwrap();
        let _ = gpu.device.poll(basecode::wgpu::PollType::wait_indefinitely());
        let open = t.elapsed();
        let t = std::time::Instant::now();
        let camera = scene.camera(width, height).unwrap();
        gpu.checked(&mut || pass.as_mut().unwrap().draw(&gpu, &camera, &target)).unwrap();
        let drawn = target.read_back(&gpu).unwrap();
        println!("{name} bonus {bonus} open {open:?} draw {:?}", t.elapsed());
        let integrator = renderer.integrator("simple", bonus).unwrap();
        let mut offline = Image::new(width, height);
        let job = RenderJob {
            width,
            height,
            spp: 1,
            seed: 1,
            threads: 2,
            progress: &|_, _| {},
            cancelled: &|| false,
        };
        renderer
            .render(&scene, integrator.as_ref(), &job, &mut Film::new(width, &mut offline.pixels))
            .unwrap();
        let mut bad = [0usize; 4];
        let mut diff = Image::new(width, height);
        for ((a, b), d) in drawn.pixels.iter().zip(&offline.pixels).zip(&mut diff.pixels) {
            let e = (*a - *b).abs().max_element();
            let rel = e / b.max_element().max(1e-6);
            for (n, bound) in bad.iter_mut().zip([2e-3, 1e-2, 0.1, 0.5]) {
                if rel > bound && e > 1e-5 {
                    *n += 1;
                }
            }
            *d = if rel > 2e-3 && e > 1e-5 {
                if b.max_element() < a.max_element() {
                    Vec3::new(1.0, 0.1, 0.1)
                } else {
                    Vec3::new(0.1, 0.3, 1.0)
                }
            } else {
                *a * 0.2
            };
        }
        println!("  {width}x{height}: off by 2e-3 1e-2 .1 .5: {bad:?}");
        for (what, image) in [("rt", &drawn), ("off", &offline), ("diff", &diff)] {
            let path = format!("/tmp/rt_{name}_{bonus}_{what}.ppm");
            let mut bytes = format!("P6 {width} {height} 255\n").into_bytes();
            for p in &image.pixels {
                for c in p.to_array() {
                    bytes.push((c.clamp(0.0, 1.0).powf(1.0 / 2.2) * 255.0 + 0.5) as u8);
                }
            }
            std::fs::write(path, bytes).unwrap();
        }
    }
}
