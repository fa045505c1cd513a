//! Pipelines: the fixed part of the shader contract.

use super::made_pipelines::MadeOf;
use super::{COLOR_FORMAT, DEPTH_FORMAT, Gpu, VERTEX_STRIDE};

/// The fragment stage of emitters: plain white.
pub const EMITTER_FS: Stage = Stage { name: "emitter.fs", text: include_str!("emitter.fs.wgsl") };

/// One shader stage of a renderer.
#[derive(Clone, Copy, Debug)]
pub struct Stage<'a> {
    /// The name of its file without `.wgsl`, by which the host can replace its text.
    pub name: &'a str,
    /// Its WGSL text, complete in itself; the entry point is `vs_main` or `fs_main`.
    pub text: &'a str,
}

impl Gpu {
    /// A pipeline that draws color and depth into a [`super::Target`]. All four bind groups must be
    /// set before it draws.
    ///
    /// What is wrong with a stage is reported by [`Gpu::checked`].
    pub fn pipeline(&self, vertex: Stage, fragment: Stage) -> wgpu::RenderPipeline {
        self.made_once(vertex, Some(fragment), || {
            let module = self.module(fragment);
            let fragment_state = wgpu::FragmentState {
                module: &module,
                entry_point: Some("fs_main"),
                compilation_options: wgpu::PipelineCompilationOptions::default(),
                targets: &[Some(COLOR_FORMAT.into())],
            };
            self.make_pipeline(fragment.name, &self.layouts.all, vertex, Some(fragment_state))
        })
    }

    /// A pipeline that draws depth alone, as into a layer of a [`super::ShadowMap`]. Bind groups 0
    /// and 1 must be set before it draws; no others exist for it.
    pub fn depth_pipeline(&self, vertex: Stage) -> wgpu::RenderPipeline {
        self.made_once(vertex, None, || {
            self.make_pipeline(vertex.name, &self.layouts.depth, vertex, None)
        })
    }

    /// A pipeline that was made of the same stages before, or else a new one.
    fn made_once<'a>(
        &'a self,
        vertex: Stage<'a>,
        fragment: Option<Stage<'a>>,
        make: impl FnOnce() -> wgpu::RenderPipeline,
    ) -> wgpu::RenderPipeline {
        let text = |stage: Stage<'a>| self.stage(stage.name, stage.text);
        let (vertex, fragment) = (text(vertex), fragment.map(text));
        let made_of = MadeOf::new(vertex, fragment, self.watch.overrides());
        if let Some(pipeline) = self.pipelines.find(&made_of) {
            self.watch.reuse(vertex, fragment);
            return pipeline;
        }
        let pipeline = make();
        self.pipelines.keep(made_of, &pipeline);
        pipeline
    }

    /// Compiles a stage by itself.
    ///
    /// # Errors
    /// [`crate::Error::Gpu`] where it is no WGSL: file, line and column, what is wrong there, and the
    /// source line on lines of their own.
    pub fn check_stage(&self, stage: Stage) -> crate::Result<()> {
        self.checked(&mut || {
            drop(self.module(stage));
            Ok(())
        })
    }

    fn module(&self, stage: Stage) -> wgpu::ShaderModule {
        self.device.create_shader_module(wgpu::ShaderModuleDescriptor {
            label: Some(&format!("src/shaders/{}.wgsl", stage.name)),
            source: wgpu::ShaderSource::Wgsl(self.stage(stage.name, stage.text).into()),
        })
    }

    fn make_pipeline(
        &self,
        name: &str,
        layout: &wgpu::PipelineLayout,
        vertex: Stage,
        fragment: Option<wgpu::FragmentState>,
    ) -> wgpu::RenderPipeline {
        let attribute = |shader_location, offset| wgpu::VertexAttribute {
            format: wgpu::VertexFormat::Float32x3,
            offset,
            shader_location,
        };
        self.device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
            label: Some(name),
            layout: Some(layout),
            vertex: wgpu::VertexState {
                module: &self.module(vertex),
                entry_point: Some("vs_main"),
                compilation_options: wgpu::PipelineCompilationOptions::default(),
                buffers: &[Some(wgpu::VertexBufferLayout {
                    array_stride: VERTEX_STRIDE,
                    step_mode: wgpu::VertexStepMode::Vertex,
                    attributes: &[attribute(0, 0), attribute(1, VERTEX_STRIDE / 2)],
                })],
            },
            // Triangles, both faces: what is seen from behind is for the fragment stage to decide.
            primitive: wgpu::PrimitiveState::default(),
            depth_stencil: Some(wgpu::DepthStencilState {
                format: DEPTH_FORMAT,
                depth_write_enabled: Some(true),
                depth_compare: Some(wgpu::CompareFunction::Less),
                stencil: wgpu::StencilState::default(),
                bias: wgpu::DepthBiasState::default(),
            }),
            multisample: wgpu::MultisampleState::default(),
            fragment,
            multiview_mask: None,
            cache: None,
        })
    }
}
