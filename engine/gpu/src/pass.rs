//! The description of a pass: kernel, reads, writes, constants, dispatch.

use ash::vk;
use bytemuck::Pod;
use shaders_glsl::Shader;

use super::bindings::Bindings;
use super::{Buffer, Image, Kernel, Recorder};

impl Recorder {
    /// Starts a pass of `kernel`.
    pub fn pass<'a>(&'a mut self, kernel: &'a Kernel) -> Pass<'a> {
        Pass { recorder: self, kernel, bindings: Bindings::default(), push: Vec::new() }
    }
}

/// One pass being described. Resources are bound in the order of the bindings in the shader, each by its name
/// there.
///
/// # Panics
/// If a bound resource is not the shader's next one: its name, access, element size or kind differs.
pub struct Pass<'a> {
    recorder: &'a mut Recorder,
    kernel: &'a Kernel,
    bindings: Bindings,
    push: Vec<u8>,
}

impl<'a> Pass<'a> {
    /// Binds the next buffer, which the shader calls `name`, for reading.
    #[must_use]
    pub fn read<T: Pod>(self, name: &str, buffer: &'a Buffer<T>) -> Self {
        self.bind(name, buffer, size_of::<T>(), false)
    }

    /// Binds the next buffer for writing (or reading and writing).
    #[must_use]
    pub fn write<T: Pod>(self, name: &str, buffer: &'a mut Buffer<T>) -> Self {
        self.bind(name, buffer, size_of::<T>(), true)
    }

    /// Binds the next buffer, of rows of any type, for reading; the shader sees it as plain words.
    #[must_use]
    pub fn read_words<T: Pod>(self, name: &str, buffer: &'a Buffer<T>) -> Self {
        self.bind(name, buffer, size_of::<u32>(), false)
    }

    /// Binds the next buffer, of rows of any type, for writing; the shader sees it as plain words.
    #[must_use]
    pub fn write_words<T: Pod>(self, name: &str, buffer: &'a mut Buffer<T>) -> Self {
        self.bind(name, buffer, size_of::<u32>(), true)
    }

    /// Binds the next image, which the shader calls `name`, to be sampled.
    #[must_use]
    pub fn sample(mut self, name: &str, image: &'a Image) -> Self {
        self.bindings.image(&self.kernel.place(name, false), image);
        self
    }

    /// Binds the next image for writing.
    #[must_use]
    pub fn write_image(mut self, name: &str, image: &'a mut Image) -> Self {
        self.bindings.image(&self.kernel.place(name, true), image);
        self
    }

    /// Binds the next buffer.
    fn bind<T: Pod>(mut self, name: &str, buffer: &Buffer<T>, stride: usize, write: bool) -> Self {
        self.bindings.buffer(&self.kernel.place(name, write), buffer, stride);
        self
    }

    /// Sets the push constants.
    #[must_use]
    pub fn push<P: Pod>(mut self, params: &P) -> Self {
        self.push = bytemuck::bytes_of(params).to_vec();
        self
    }

    /// Records the pass over `x` workgroups; records nothing for 0.
    pub fn dispatch(self, x: u32) {
        self.dispatch_3d([x, 1, 1]);
    }

    /// Records the pass over as many workgroups as `x` invocations fill.
    ///
    /// # Panics
    /// If a specialisation constant says how wide workgroups are.
    pub fn dispatch_over(self, x: u32) {
        self.dispatch_over_3d([x, 1, 1]);
    }

    /// Records the pass over as many workgroups as `invocations` along x, y and z fill.
    ///
    /// # Panics
    /// Under the same conditions as [`Pass::dispatch_over`].
    pub fn dispatch_over_3d(self, invocations: [u32; 3]) {
        let Shader { workgroup: Some(workgroup), .. } = self.kernel.shader else {
            panic!("{}: a specialisation constant says how wide workgroups are", self.kernel.shader.name)
        };
        let groups = std::array::from_fn(|i| invocations[i].div_ceil(workgroup[i]));
        self.dispatch_3d(groups);
    }

    /// Records the pass over `groups` workgroups along x, y and z; records nothing if one number is 0.
    pub fn dispatch_3d(self, groups: [u32; 3]) {
        let most = self.recorder.gpu.0.limits.workgroups;
        let name = self.kernel.shader.name;
        // Every device allows 65535 along y and z.
        assert!(
            groups[0] <= most && groups[1].max(groups[2]) <= 65535,
            "{name}: {groups:?} workgroups are too many"
        );
        if !groups.contains(&0) {
            self.record(groups);
        }
    }

    /// Checks that everything is bound, and records the pass.
    fn record(self, groups: [u32; 3]) {
        let Pass { recorder, kernel, bindings, push } = self;
        let shader = kernel.shader;
        assert_eq!(bindings.bound.len(), shader.bindings.len(), "{}: a resource is missing", shader.name);
        assert_eq!(push.len(), shader.push_bytes, "{}: push constants differ in size", shader.name);
        let Some(way) = recorder.way(kernel.pipeline.set_layout) else { return };
        recorder.touch(&bindings.accesses);
        recorder.timed(shader.name, vk::PipelineStageFlags2::COMPUTE_SHADER, |context, commands| {
            let device = &context.device;
            // SAFETY: recording; pipeline, layout and resources are live, the reflected layout matches what
            // is pushed.
            unsafe {
                device.cmd_bind_pipeline(commands, vk::PipelineBindPoint::COMPUTE, kernel.pipeline.handle);
                bindings.record(
                    context,
                    commands,
                    vk::PipelineBindPoint::COMPUTE,
                    kernel.pipeline.layout,
                    way,
                );
                if !push.is_empty() {
                    let stages = vk::ShaderStageFlags::COMPUTE;
                    device.cmd_push_constants(commands, kernel.pipeline.layout, stages, 0, &push);
                }
                let [x, y, z] = groups;
                device.cmd_dispatch(commands, x, y, z);
            }
        });
    }
}
