//! What a pass binds, checked against what reflection found in its shaders.

use ash::vk;
use bytemuck::Pod;
use shaders_glsl::{Access, Resource, Shader};

use super::hazards::Resident;
use super::{Buffer, Context, Image};

/// A resource bound to the next place in the shader.
#[derive(Clone, Copy)]
pub(super) enum Bound {
    Buffer(vk::Buffer),
    Texture(vk::ImageView),
    Image(vk::ImageView),
}

/// What a pass binds. A mismatch is a bug of the caller and panics with the name of shader and binding.
#[derive(Default)]
pub(super) struct Bindings {
    pub(super) bound: Vec<Bound>,
    pub(super) accesses: Vec<(Resident, bool)>,
}

impl Bindings {
    /// Returns the next place of `shader`, which must have this access.
    fn next(&self, shader: &Shader, bindings: &[shaders_glsl::Binding], name: &str, write: bool) -> Resource {
        let Some(binding) = bindings.get(self.bound.len()) else {
            panic!("{} has {} bindings; {name} is one too many", shader.name, bindings.len())
        };
        assert_eq!(
            binding.access != Access::Read,
            write,
            "{}: {} is {:?} in the shader, {name} is bound otherwise",
            shader.name,
            binding.name,
            binding.access,
        );
        binding.resource
    }

    /// Binds a buffer to the next place. `stride` is what the elements of the shader's array must measure,
    /// bytes.
    pub(super) fn buffer<T: Pod>(
        &mut self,
        shader: &Shader,
        bindings: &[shaders_glsl::Binding],
        buffer: &Buffer<T>,
        stride: usize,
        write: bool,
    ) {
        let resource = self.next(shader, bindings, buffer.name(), write);
        assert_eq!(
            resource,
            Resource::Buffer { stride },
            "{}: {} is not what the shader has there, or its elements differ in size",
            shader.name,
            buffer.name()
        );
        self.bound.push(Bound::Buffer(buffer.handle()));
        self.accesses.push((Resident::Buffer(buffer.handle()), write));
    }

    /// Binds an image to the next place, to be sampled or to be written.
    pub(super) fn image(
        &mut self,
        shader: &Shader,
        bindings: &[shaders_glsl::Binding],
        image: &Image,
        write: bool,
    ) {
        let resource = self.next(shader, bindings, image.name(), write);
        let (expected, bound) = match write {
            false => (Resource::Texture, Bound::Texture(image.view)),
            true => (Resource::Image, Bound::Image(image.view)),
        };
        assert_eq!(resource, expected, "{}: {} is not what the shader has there", shader.name, image.name());
        self.bound.push(bound);
        self.accesses.push((Resident::Image(image.handle()), write));
    }

    /// Pushes the descriptors.
    ///
    /// # Safety
    /// `commands` is recording, and `layout` is what the shader of these bindings was made with.
    pub(super) unsafe fn push(
        &self,
        context: &Context,
        commands: vk::CommandBuffer,
        point: vk::PipelineBindPoint,
        layout: vk::PipelineLayout,
    ) {
        let general = vk::ImageLayout::GENERAL;
        let mut buffers = Vec::with_capacity(self.bound.len());
        let mut images = Vec::with_capacity(self.bound.len());
        for bound in &self.bound {
            let (mut buffer, mut image) = (
                vk::DescriptorBufferInfo::default(),
                vk::DescriptorImageInfo::default().image_layout(general),
            );
            match *bound {
                Bound::Buffer(handle) => buffer = buffer.buffer(handle).range(vk::WHOLE_SIZE),
                Bound::Texture(view) => image = image.image_view(view).sampler(context.sampler),
                Bound::Image(view) => image = image.image_view(view),
            }
            buffers.push([buffer]);
            images.push([image]);
        }
        let writes: Vec<_> = (0u32..)
            .zip(&self.bound)
            .zip(buffers.iter().zip(&images))
            .map(|((number, bound), (buffer, image))| {
                let write = vk::WriteDescriptorSet::default().dst_binding(number);
                match bound {
                    Bound::Buffer(_) => {
                        write.descriptor_type(vk::DescriptorType::STORAGE_BUFFER).buffer_info(buffer)
                    }
                    Bound::Texture(_) => {
                        write.descriptor_type(vk::DescriptorType::COMBINED_IMAGE_SAMPLER).image_info(image)
                    }
                    Bound::Image(_) => {
                        write.descriptor_type(vk::DescriptorType::STORAGE_IMAGE).image_info(image)
                    }
                }
            })
            .collect();
        if !writes.is_empty() {
            // SAFETY: as the caller promises; what is bound is alive and of the kinds of the layout.
            unsafe { context.push_descriptor.cmd_push_descriptor_set(commands, point, layout, 0, &writes) };
        }
    }
}
