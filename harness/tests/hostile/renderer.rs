//! A submission whose code misbehaves as only Rust or a graphics device lets it: the scene's options
//! say how. Without options it draws black. Everything is bounded in memory.

use basecode::gpu::{Gpu, RenderPass, Stage, Target};
use basecode::{
    Bsdf, Camera, Film, Integrator, Material, Ray, RenderJob, Renderer, Result, Sampler, Scene,
    ShadingKind, SurfaceInteraction, Vec3, wgpu,
};

struct Hostile {
    action: String,
}

struct Black;

impl Bsdf for Black {
    fn eval(&self, _: &SurfaceInteraction) -> Vec3 {
        Vec3::ZERO
    }
}

impl Integrator for Black {
    fn radiance(&self, _: &Scene, _: &Ray, _: &Sampler) -> Vec3 {
        Vec3::ZERO
    }
}

impl RenderPass for Black {
    fn draw(&mut self, gpu: &Gpu, _: &Camera, target: &Target) -> Result<()> {
        let mut encoder = gpu.encoder();
        drop(target.begin(&mut encoder));
        gpu.submit(encoder);
        Ok(())
    }
}

impl Hostile {
    fn act(&self) {
        match self.action.as_str() {
            "panic" => panic!("on purpose"),
            "todo" => todo!(),
            "panic_in_thread" => {
                std::thread::spawn(|| panic!("in a thread")).join().expect("a good thread");
            }
            "panic_in_a_lost_thread" => {
                // Nobody asks how it ended.
                let _ = std::thread::spawn(|| panic!("in a thread")).join();
            }
            "panic_in_drop" => {
                struct Bomb;
                impl Drop for Bomb {
                    fn drop(&mut self) {
                        panic!("while panicking");
                    }
                }
                let _bomb = Bomb;
                panic!("first");
            }
            "panic_with_a_bomb" => {
                struct Bomb;
                impl Drop for Bomb {
                    fn drop(&mut self) {
                        panic!("when nobody expects it");
                    }
                }
                std::panic::panic_any(Bomb);
            }
            "overflow" => {
                println!("{}", deeper(1));
            }
            "huge" => {
                println!("{}", std::hint::black_box(vec![1u8; 1 << 40]).len());
            }
            "abort" => std::process::abort(),
            _ => {}
        }
    }

    fn act_on(&self, gpu: &Gpu) {
        match self.action.as_str() {
            "shader" => {
                let broken = Stage { name: "own.fs", text: "@fragment fn fs_main( { nonsense" };
                gpu.pipeline(broken, broken);
            }
            "device_memory" => {
                // 16 GiB at most; they are freed with the device.
                let usage = wgpu::BufferUsages::COPY_DST;
                let buffer = wgpu::BufferDescriptor {
                    label: None,
                    size: 128 << 20,
                    usage,
                    mapped_at_creation: false,
                };
                std::mem::forget(
                    (0..128).map(|_| gpu.device.create_buffer(&buffer)).collect::<Vec<_>>(),
                );
            }
            "device_loop" => self.loop_on(gpu),
            _ => {}
        }
    }

    fn loop_on(&self, gpu: &Gpu) {
        // Mesa's software adapter leaves a loop after 65,535 rounds: as many calls as there may be.
        let text = "@group(0) @binding(0) var<storage, read_write> n: atomic<u32>;
            @compute @workgroup_size(64) fn main() {
                while (atomicAdd(&n, 2u) != 7u) {}
            }";
        let module = gpu.device.create_shader_module(wgpu::ShaderModuleDescriptor {
            label: None,
            source: wgpu::ShaderSource::Wgsl(text.into()),
        });
        let pipeline = gpu.device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label: None,
            layout: None,
            module: &module,
            entry_point: None,
            compilation_options: Default::default(),
            cache: None,
        });
        let buffer = gpu.device.create_buffer(&wgpu::BufferDescriptor {
            label: None,
            size: 16,
            usage: wgpu::BufferUsages::STORAGE,
            mapped_at_creation: false,
        });
        let group = gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: None,
            layout: &pipeline.get_bind_group_layout(0),
            entries: &[wgpu::BindGroupEntry { binding: 0, resource: buffer.as_entire_binding() }],
        });
        let mut encoder = gpu.encoder();
        let mut pass = encoder.begin_compute_pass(&Default::default());
        pass.set_pipeline(&pipeline);
        pass.set_bind_group(0, &group, &[]);
        pass.dispatch_workgroups(65_535, 65_535, 1);
        drop(pass);
        gpu.submit(encoder);
        let _ = gpu.device.poll(wgpu::PollType::wait_indefinitely());
    }
}

#[inline(never)]
fn deeper(depth: u64) -> u64 {
    let here = std::hint::black_box([depth; 128]);
    deeper(here[0] + 1) + here[127]
}

impl Renderer for Hostile {
    fn new(options: &str) -> Result<Self> {
        Ok(Self { action: options.to_owned() })
    }

    fn bsdf(&self, _: &Material) -> Box<dyn Bsdf> {
        Box::new(Black)
    }

    fn integrator(&self, _: ShadingKind, _: bool) -> Result<Box<dyn Integrator>> {
        self.act();
        Ok(Box::new(Black))
    }

    fn render(&self, _: &Scene, _: &dyn Integrator, _: &RenderJob, film: &mut Film) -> Result<()> {
        film.pixels_mut().fill(Vec3::ZERO);
        Ok(())
    }

    fn render_pass(
        &self,
        _: ShadingKind,
        gpu: &Gpu,
        _: &Scene,
        _: bool,
    ) -> Result<Box<dyn RenderPass>> {
        self.act();
        self.act_on(gpu);
        Ok(Box::new(Black))
    }
}

basecode::export_renderer!(Hostile, "hostile", "1.0");
