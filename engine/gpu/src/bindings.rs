//! The resources that a pass binds, checked against what reflection found in its shaders.

use ash::vk;
use bytemuck::Pod;
use shaders_glsl::{Access, Binding, Resource};

use super::descriptors::Way;
use super::hazards::Resident;
use super::{Buffer, Context, Image};

/// A resource bound to the next place in the shader.
#[derive(Clone, Copy)]
pub(super) enum Bound {
    Buffer(vk::Buffer),
    Texture(vk::ImageView),
    Image(vk::ImageView),
}

/// The resources that a pass binds. A mismatch is a bug of the caller and panics with the name of shader and
/// binding.
#[derive(Default)]
pub(super) struct Bindings {
    pub(super) bound: Vec<Bound>,
    pub(super) accesses: Vec<(Resident, bool)>,
}

/// The place that a resource is bound to, as the caller says and as reflection found it.
pub(super) struct Place<'a> {
    /// Name of the shader.
    pub(super) shader: &'static str,
    /// All places of the shader or of the pair of shaders.
    pub(super) bindings: &'a [Binding],
    /// Name of the binding.
    pub(super) name: &'a str,
    /// True if the shader writes there.
    pub(super) write: bool,
}

impl Place<'_> {
    /// Checks the place with this number against the shader and returns the kind of resource there.
    fn check(&self, number: usize, given: &str) -> Resource {
        let &Place { shader, bindings, name, write } = self;
        let Some(binding) = bindings.get(number) else {
            panic!("{shader} has {} bindings; {name} ({given}) is one too many", bindings.len())
        };
        assert_eq!(
            binding.name, name,
            "{shader}: binding {number} is {}, but {given} is bound as {name}",
            binding.name
        );
        assert_eq!(
            binding.access != Access::Read,
            write,
            "{shader}: {name} is {:?} in the shader, {given} is bound otherwise",
            binding.access
        );
        binding.resource
    }
}

impl Bindings {
    /// Binds a buffer to the next place. `stride` is the size that the elements of the shader's array must
    /// have, bytes.
    pub(super) fn buffer<T: Pod>(&mut self, place: &Place<'_>, buffer: &Buffer<T>, stride: usize) {
        let resource = place.check(self.bound.len(), buffer.name());
        assert_eq!(
            resource,
            Resource::Buffer { stride },
            "{}: {} is not what the shader has as {}, or its elements differ in size",
            place.shader,
            buffer.name(),
            place.name
        );
        self.bound.push(Bound::Buffer(buffer.handle()));
        self.accesses.push((Resident::Buffer(buffer.handle()), place.write));
    }

    /// Binds an image to the next place, to be sampled or to be written.
    pub(super) fn image(&mut self, place: &Place<'_>, image: &Image) {
        let resource = place.check(self.bound.len(), image.name());
        let (expected, bound) = match place.write {
            false => (Resource::Texture, Bound::Texture(image.view)),
            true => (Resource::Image, Bound::Image(image.view)),
        };
        assert_eq!(
            resource,
            expected,
            "{}: {} is not what the shader has as {}",
            place.shader,
            image.name(),
            place.name
        );
        self.bound.push(bound);
        self.accesses.push((Resident::Image(image.handle()), place.write));
    }

    /// Binds the resources.
    ///
    /// # Safety
    /// `commands` is recording, and `layout` is the one that the pipeline of these bindings was created with; a set is
    /// of its layout and was not written yet.
    pub(super) unsafe fn record(
        &self,
        context: &Context,
        commands: vk::CommandBuffer,
        point: vk::PipelineBindPoint,
        layout: vk::PipelineLayout,
        way: Way,
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
        if writes.is_empty() {
            return;
        }
        match (way, &context.push_descriptor) {
            (Way::Set(set), _) => {
                let writes: Vec<_> = writes.into_iter().map(|write| write.dst_set(set)).collect();
                // SAFETY: as the caller promises; what is bound is alive and of the kinds of the layout.
                unsafe {
                    context.device.update_descriptor_sets(&writes, &[]);
                    context.device.cmd_bind_descriptor_sets(commands, point, layout, 0, &[set], &[]);
                }
            }
            // SAFETY: as above.
            (Way::Pushed, Some(pushing)) => unsafe {
                pushing.cmd_push_descriptor_set(commands, point, layout, 0, &writes);
            },
            (Way::Pushed, None) => panic!("this device takes no pushed descriptors"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const BINDINGS: &[Binding] = &[
        Binding { number: 0, name: "starts", access: Access::Read, resource: Resource::Buffer { stride: 4 } },
        Binding { number: 1, name: "pairs", access: Access::Write, resource: Resource::Buffer { stride: 4 } },
    ];

    fn check(number: usize, name: &str, write: bool) -> Resource {
        Place { shader: "slab", bindings: BINDINGS, name, write }.check(number, "pair starts")
    }

    #[test]
    fn the_name_of_the_next_binding_is_accepted() {
        assert_eq!(check(0, "starts", false), Resource::Buffer { stride: 4 });
        assert_eq!(check(1, "pairs", true), Resource::Buffer { stride: 4 });
    }

    #[test]
    #[should_panic(expected = "slab: binding 1 is pairs, but pair starts is bound as starts")]
    fn a_wrong_name_panics() {
        check(1, "starts", true);
    }

    #[test]
    #[should_panic(expected = "slab: pairs is Write in the shader")]
    fn a_wrong_access_panics() {
        check(1, "pairs", false);
    }

    #[test]
    #[should_panic(expected = "one too many")]
    fn one_binding_too_many_panics() {
        check(2, "pairs", true);
    }
}
