//! Recording and submitting passes. A pass is a sentence: kernel, reads, writes, constants, dispatch.
//! The recorder places the barriers, opens a debug label and takes two timestamps per pass.

use std::any::Any;
use std::collections::HashMap;
use std::sync::Arc;

use ash::vk;
use ash::vk::Handle as _;
use bytemuck::Pod;
use shaders_glsl::{Access, Resource, Shader};

use super::submissions::{Flight, QUERIES, Slot, new_slot};
use super::{Buffer, Context, Gpu, Image, Kernel, Ticket, boot, check, image, lock};
use crate::error::{Error, Kind, Result};

impl Gpu {
    /// Starts recording.
    pub fn record(&self) -> Result<Recorder> {
        let context = &self.0;
        let reused = lock(&context.queue).free.pop();
        let slot = match reused {
            Some(slot) => slot,
            None => new_slot(context)?,
        };
        let begin = vk::CommandBufferBeginInfo::default().flags(vk::CommandBufferUsageFlags::ONE_TIME_SUBMIT);
        // SAFETY: the slot is not in flight: it is new, or `wait` saw its submission finished.
        unsafe {
            let reset = context.device.reset_command_pool(slot.pool, vk::CommandPoolResetFlags::empty());
            check("resetting commands", reset)?;
            check("recording", context.device.begin_command_buffer(slot.commands, &begin))?;
            context.device.cmd_reset_query_pool(slot.commands, slot.queries, 0, QUERIES);
        }
        let mut recorder = Recorder {
            gpu: self.clone(),
            slot: Some(slot),
            passes: Vec::new(),
            touched: HashMap::new(),
            wide: true,
            kept: Vec::new(),
        };
        // Whatever earlier submissions wrote, drawings too, is visible to this one.
        recorder.barrier();
        recorder.wide = false;
        Ok(recorder)
    }
}

/// One submission being recorded.
pub struct Recorder {
    pub(super) gpu: Gpu,
    /// `None` once submitted.
    slot: Option<Slot>,
    passes: Vec<String>,
    /// What was touched since the last barrier, and whether it was written.
    touched: HashMap<Resident, bool>,
    /// Whether barriers reach the graphics stages and indirect arguments, too; they need it from the first use on.
    pub(super) wide: bool,
    /// Staging buffers that the recorded copies read.
    kept: Vec<Box<dyn Any>>,
}

/// Where drawings write depth.
const DEPTH_TESTS: vk::PipelineStageFlags2 = vk::PipelineStageFlags2::from_raw(
    vk::PipelineStageFlags2::EARLY_FRAGMENT_TESTS.as_raw()
        | vk::PipelineStageFlags2::LATE_FRAGMENT_TESTS.as_raw(),
);

/// At which stages drawings have an image attached, and how they read and write it there.
fn attached(image: &Image) -> (vk::PipelineStageFlags2, vk::AccessFlags2, vk::AccessFlags2) {
    use vk::AccessFlags2 as Access;
    match image.format().is_depth() {
        true => (DEPTH_TESTS, Access::DEPTH_STENCIL_ATTACHMENT_READ, Access::DEPTH_STENCIL_ATTACHMENT_WRITE),
        false => (
            vk::PipelineStageFlags2::COLOR_ATTACHMENT_OUTPUT,
            Access::COLOR_ATTACHMENT_READ,
            Access::COLOR_ATTACHMENT_WRITE,
        ),
    }
}

/// A resource as hazards are tracked: by its handle, which is unique only within its kind.
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
pub(super) enum Resident {
    Buffer(vk::Buffer),
    Image(vk::Image),
}

/// A resource bound to the next place in the shader.
#[derive(Clone, Copy)]
enum Bound {
    Buffer(vk::Buffer),
    Texture(vk::ImageView),
    Image(vk::ImageView),
}

impl Recorder {
    pub(super) fn commands(&self) -> vk::CommandBuffer {
        self.slot.as_ref().map_or(vk::CommandBuffer::null(), |s| s.commands)
    }

    /// Makes all earlier writes visible to all that follows. One memory barrier for all buffers: on the devices we
    /// know, a list of buffer barriers costs more than it saves.
    fn barrier(&mut self) {
        self.touched.clear();
        let mut stages = vk::PipelineStageFlags2::COMPUTE_SHADER | vk::PipelineStageFlags2::ALL_TRANSFER;
        let mut writes = vk::AccessFlags2::SHADER_STORAGE_WRITE | vk::AccessFlags2::TRANSFER_WRITE;
        let mut reads = vk::AccessFlags2::SHADER_STORAGE_READ
            | vk::AccessFlags2::SHADER_SAMPLED_READ
            | vk::AccessFlags2::TRANSFER_READ;
        if self.wide {
            stages |= vk::PipelineStageFlags2::VERTEX_SHADER
                | vk::PipelineStageFlags2::FRAGMENT_SHADER
                | vk::PipelineStageFlags2::COLOR_ATTACHMENT_OUTPUT
                | DEPTH_TESTS
                | vk::PipelineStageFlags2::DRAW_INDIRECT;
            writes |=
                vk::AccessFlags2::COLOR_ATTACHMENT_WRITE | vk::AccessFlags2::DEPTH_STENCIL_ATTACHMENT_WRITE;
            reads |= vk::AccessFlags2::COLOR_ATTACHMENT_READ
                | vk::AccessFlags2::DEPTH_STENCIL_ATTACHMENT_READ
                | vk::AccessFlags2::INDIRECT_COMMAND_READ;
        }
        let barrier = [vk::MemoryBarrier2::default()
            .src_stage_mask(stages)
            .src_access_mask(writes)
            .dst_stage_mask(stages)
            .dst_access_mask(reads | writes)];
        let info = vk::DependencyInfo::default().memory_barriers(&barrier);
        // SAFETY: the command buffer is recording.
        unsafe { self.gpu.0.device.cmd_pipeline_barrier2(self.commands(), &info) };
    }

    /// Places a barrier if one of the coming accesses meets an earlier one and either writes.
    pub(super) fn touch(&mut self, accesses: &[(Resident, bool)]) {
        let hazard = accesses
            .iter()
            .any(|(resident, write)| self.touched.get(resident).is_some_and(|written| *write || *written));
        if hazard {
            self.barrier();
        }
        for (resident, write) in accesses {
            *self.touched.entry(*resident).or_default() |= write;
        }
    }

    /// Starts a pass of `kernel`.
    pub fn pass<'a>(&'a mut self, kernel: &'a Kernel) -> Pass<'a> {
        Pass { recorder: self, kernel, bindings: Bindings::default(), push: Vec::new() }
    }

    /// Fills a buffer with zeros.
    pub fn clear<T: Pod>(&mut self, buffer: &Buffer<T>) {
        self.touch(&[(Resident::Buffer(buffer.handle()), true)]);
        // SAFETY: recording; buffers are made with TRANSFER_DST and whole words.
        unsafe {
            self.gpu.0.device.cmd_fill_buffer(self.commands(), buffer.handle(), 0, vk::WHOLE_SIZE, 0);
        }
    }

    /// Copies `len` elements from `from[from_start..]` to `to[to_start..]`.
    pub fn copy<T: Pod>(
        &mut self,
        from: &Buffer<T>,
        from_start: usize,
        to: &mut Buffer<T>,
        to_start: usize,
        len: usize,
    ) {
        assert!(
            from_start + len <= from.len() && to_start + len <= to.len(),
            "{}: copy behind the end",
            to.name()
        );
        let size = size_of::<T>() as u64;
        self.copy_bytes(
            (from.handle(), from_start as u64 * size),
            (to.handle(), to_start as u64 * size),
            len as u64 * size,
            to.name(),
        );
    }

    pub(super) fn copy_bytes(
        &mut self,
        (from, from_offset): (vk::Buffer, u64),
        (to, to_offset): (vk::Buffer, u64),
        bytes: u64,
        name: &str,
    ) {
        self.touch(&[(Resident::Buffer(from), false), (Resident::Buffer(to), true)]);
        let region = [vk::BufferCopy { src_offset: from_offset, dst_offset: to_offset, size: bytes }];
        self.label(name, |gpu, commands| {
            // SAFETY: recording; ranges were checked by the callers; usage has both transfer bits.
            unsafe { gpu.0.device.cmd_copy_buffer(commands, from, to, &region) };
        });
    }

    /// Takes a foreign picture over from its owner; what it held is gone.
    pub fn borrow_image(&mut self, image: &Image) {
        assert!(image.lent_in.is_some(), "{} is not a foreign picture", image.name());
        let (stage, read, write) = attached(image);
        let layout = vk::ImageMemoryBarrier2::default()
            // What the wait for the owner's semaphore holds back.
            .src_stage_mask(stage)
            .dst_stage_mask(stage)
            .dst_access_mask(read | write)
            .old_layout(vk::ImageLayout::UNDEFINED)
            .new_layout(vk::ImageLayout::GENERAL);
        self.change_layout(image, layout);
    }

    /// Gives a foreign picture back; drawings are all that wrote it.
    pub fn return_image(&mut self, image: &Image) {
        let Some(lent_in) = image.lent_in else { panic!("{} is not a foreign picture", image.name()) };
        let (stage, _, write) = attached(image);
        let layout = vk::ImageMemoryBarrier2::default()
            .src_stage_mask(stage)
            .src_access_mask(write)
            .dst_stage_mask(stage)
            .old_layout(vk::ImageLayout::GENERAL)
            .new_layout(lent_in);
        self.change_layout(image, layout);
    }

    fn change_layout(&mut self, image: &Image, barrier: vk::ImageMemoryBarrier2<'_>) {
        let barrier = [barrier.image(image.handle()).subresource_range(image::whole(image.format()))];
        let info = vk::DependencyInfo::default().image_memory_barriers(&barrier);
        // SAFETY: recording; the picture is lent to us for this frame.
        unsafe { self.gpu.0.device.cmd_pipeline_barrier2(self.commands(), &info) };
    }

    /// Brings a new image into the layout that it keeps, and clears it.
    pub(super) fn begin_image(&mut self, image: &Image) {
        let layout = [vk::ImageMemoryBarrier2::default()
            .dst_stage_mask(vk::PipelineStageFlags2::ALL_TRANSFER)
            .dst_access_mask(vk::AccessFlags2::TRANSFER_WRITE)
            .old_layout(vk::ImageLayout::UNDEFINED)
            .new_layout(vk::ImageLayout::GENERAL)
            .image(image.handle())
            .subresource_range(image::whole(image.format()))];
        let info = vk::DependencyInfo::default().image_memory_barriers(&layout);
        // SAFETY: recording; the image is new, nothing else uses it.
        unsafe { self.gpu.0.device.cmd_pipeline_barrier2(self.commands(), &info) };
        self.clear_image(image, [0.0; 4]);
    }

    /// Fills an image with one colour, or with a depth, the first of the four numbers.
    pub fn clear_image(&mut self, image: &Image, colour: [f32; 4]) {
        self.touch(&[(Resident::Image(image.handle()), true)]);
        let (commands, handle, layout) = (self.commands(), image.handle(), vk::ImageLayout::GENERAL);
        let (device, range) = (&self.gpu.0.device, [image::whole(image.format())]);
        // SAFETY: recording; images have TRANSFER_DST and stay in the general layout.
        unsafe {
            if image.format().is_depth() {
                let depth = vk::ClearDepthStencilValue { depth: colour[0], stencil: 0 };
                device.cmd_clear_depth_stencil_image(commands, handle, layout, &depth, &range);
            } else {
                let colour = vk::ClearColorValue { float32: colour };
                device.cmd_clear_color_image(commands, handle, layout, &colour, &range);
            }
        }
    }

    pub(super) fn copy_image<T: Pod>(&mut self, from: &Image, to: &Buffer<T>, region: vk::BufferImageCopy) {
        self.touch(&[(Resident::Image(from.handle()), false), (Resident::Buffer(to.handle()), true)]);
        self.label(from.name(), |gpu, commands| {
            // SAFETY: recording; the caller made the buffer as large as the image.
            unsafe {
                gpu.0.device.cmd_copy_image_to_buffer(
                    commands,
                    from.handle(),
                    vk::ImageLayout::GENERAL,
                    to.handle(),
                    &[region],
                );
            }
        });
    }

    pub(super) fn fill_image<T: Pod>(&mut self, from: &Buffer<T>, to: &Image, region: vk::BufferImageCopy) {
        self.touch(&[(Resident::Buffer(from.handle()), false), (Resident::Image(to.handle()), true)]);
        self.label(to.name(), |gpu, commands| {
            // SAFETY: recording; the caller made the buffer as large as the image.
            unsafe {
                gpu.0.device.cmd_copy_buffer_to_image(
                    commands,
                    from.handle(),
                    to.handle(),
                    vk::ImageLayout::GENERAL,
                    &[region],
                );
            }
        });
    }

    /// Runs `record` inside a debug label and, as far as there are queries, between two timestamps at `stage`.
    pub(super) fn timed(
        &mut self,
        name: &str,
        stage: vk::PipelineStageFlags2,
        record: impl FnOnce(&Context, vk::CommandBuffer),
    ) {
        let query = self.passes.len() as u32 * 2;
        let queries = self.slot.as_ref().map_or(vk::QueryPool::null(), |s| s.queries);
        let timed = query + 2 <= QUERIES && !queries.is_null();
        self.label(name, |gpu, commands| {
            let context: &Arc<Context> = &gpu.0;
            // SAFETY: recording; the two queries were reset when recording began.
            unsafe {
                if timed {
                    context.device.cmd_write_timestamp2(commands, stage, queries, query);
                }
                record(context, commands);
                if timed {
                    context.device.cmd_write_timestamp2(commands, stage, queries, query + 1);
                }
            }
        });
        if timed {
            self.passes.push(name.to_owned());
        }
    }

    fn label(&self, name: &str, record: impl FnOnce(&Gpu, vk::CommandBuffer)) {
        let commands = self.commands();
        if let Some(debug) = &self.gpu.0.debug_utils {
            let name = boot::c_name(name);
            let label = vk::DebugUtilsLabelEXT::default().label_name(&name);
            // SAFETY: recording; begin and end are paired.
            unsafe { debug.cmd_begin_debug_utils_label(commands, &label) };
            record(&self.gpu, commands);
            // SAFETY: as above.
            unsafe { debug.cmd_end_debug_utils_label(commands) };
        } else {
            record(&self.gpu, commands);
        }
    }

    /// Hands what was recorded so far to the device and goes on in a new submission, which follows it.
    pub fn split(&mut self) -> Result<Ticket> {
        let gpu = self.gpu.clone();
        std::mem::replace(self, gpu.record()?).submit()
    }

    /// Keeps a staging buffer until this is submitted: only then does its end know what it must wait for.
    pub(super) fn keep<T: Pod>(&mut self, staging: Buffer<T>) {
        self.kept.push(Box::new(staging));
    }

    /// Ends recording and hands the work to the device.
    pub fn submit(self) -> Result<Ticket> {
        self.submit_between(None, None)
    }

    /// The same after `wait` was signalled, as far as colour is written, and signalling `signal` at the end.
    pub(super) fn submit_between(
        mut self,
        wait: Option<vk::Semaphore>,
        signal: Option<vk::Semaphore>,
    ) -> Result<Ticket> {
        let Some(slot) = self.slot.take() else {
            return Err(Error::new(Kind::Internal, "VGS-GPU-040", "submitted twice"));
        };
        let context = &self.gpu.0;
        // A host read after the wait must see what the device wrote.
        let to_host = [vk::MemoryBarrier2::default()
            .src_stage_mask(vk::PipelineStageFlags2::ALL_TRANSFER | vk::PipelineStageFlags2::COMPUTE_SHADER)
            .src_access_mask(vk::AccessFlags2::TRANSFER_WRITE | vk::AccessFlags2::SHADER_STORAGE_WRITE)
            .dst_stage_mask(vk::PipelineStageFlags2::HOST)
            .dst_access_mask(vk::AccessFlags2::HOST_READ)];
        let dependency = vk::DependencyInfo::default().memory_barriers(&to_host);
        let mut queue = lock(&context.queue);
        let value = queue.last + 1;
        let commands = [vk::CommandBufferSubmitInfo::default().command_buffer(slot.commands)];
        let at_end = |semaphore| {
            vk::SemaphoreSubmitInfo::default()
                .semaphore(semaphore)
                .stage_mask(vk::PipelineStageFlags2::ALL_COMMANDS)
        };
        let mut signals = vec![at_end(context.timeline).value(value)];
        signals.extend(signal.map(at_end));
        let waits: Vec<_> = wait
            .map(|semaphore| {
                vk::SemaphoreSubmitInfo::default()
                    .semaphore(semaphore)
                    .stage_mask(vk::PipelineStageFlags2::COLOR_ATTACHMENT_OUTPUT)
            })
            .into_iter()
            .collect();
        let submit = [vk::SubmitInfo2::default()
            .wait_semaphore_infos(&waits)
            .command_buffer_infos(&commands)
            .signal_semaphore_infos(&signals)];
        if queue.is_lost() {
            queue.free.push(slot);
            return check("submitting", Err(vk::Result::ERROR_DEVICE_LOST));
        }
        // SAFETY: the queue is ours alone while locked; the command buffer is complete.
        let submitted = unsafe {
            context.device.cmd_pipeline_barrier2(slot.commands, &dependency);
            context
                .device
                .end_command_buffer(slot.commands)
                .and_then(|()| context.device.queue_submit2(queue.queue, &submit, vk::Fence::null()))
        };
        if let Err(e) = submitted {
            queue.free.push(slot);
            return check("submitting", Err(e));
        }
        queue.last = value;
        queue.flying.push(Flight { value, slot, passes: std::mem::take(&mut self.passes) });
        // What was kept is dropped after this, with a submission to wait for.
        drop(queue);
        Ok(Ticket(value))
    }
}

impl Drop for Recorder {
    fn drop(&mut self) {
        // Recorded but never submitted: the slot goes back, its pool is reset before the next use.
        if let Some(slot) = self.slot.take() {
            lock(&self.gpu.0.queue).free.push(slot);
        }
    }
}

/// What a pass binds, checked against its shaders. A mismatch is a bug of the caller and panics with the name of shader
/// and binding.
#[derive(Default)]
pub(super) struct Bindings {
    bound: Vec<Bound>,
    pub(super) accesses: Vec<(Resident, bool)>,
}

impl Bindings {
    /// The next place of `shader`, which must have this access.
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

    /// `stride` is what the elements of the shader's array must measure, bytes.
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

/// One pass being described. The order in which resources are bound is the order of the bindings in the shader.
pub struct Pass<'a> {
    recorder: &'a mut Recorder,
    kernel: &'a Kernel,
    bindings: Bindings,
    push: Vec<u8>,
}

/// How many workgroups.
enum Groups {
    Of([u32; 3]),
    /// Read from a buffer at this byte.
    From(vk::Buffer, u64),
}

impl<'a> Pass<'a> {
    /// Binds the next buffer for reading.
    #[must_use]
    pub fn read<T: Pod>(self, buffer: &'a Buffer<T>) -> Self {
        self.bind(buffer, size_of::<T>(), false)
    }

    /// Binds the next buffer for writing (or reading and writing).
    #[must_use]
    pub fn write<T: Pod>(self, buffer: &'a mut Buffer<T>) -> Self {
        self.bind(buffer, size_of::<T>(), true)
    }

    /// Binds the next buffer for reading where the shader sees rows of any type as plain words.
    #[must_use]
    pub fn read_words<T: Pod>(self, buffer: &'a Buffer<T>) -> Self {
        self.bind(buffer, size_of::<u32>(), false)
    }

    /// Binds the next buffer for writing where the shader sees rows of any type as plain words.
    #[must_use]
    pub fn write_words<T: Pod>(self, buffer: &'a mut Buffer<T>) -> Self {
        self.bind(buffer, size_of::<u32>(), true)
    }

    /// Binds the next image, to be sampled.
    #[must_use]
    pub fn sample(mut self, image: &'a Image) -> Self {
        let shader = self.kernel.shader;
        self.bindings.image(shader, shader.bindings, image, false);
        self
    }

    /// Binds the next image, to be written.
    #[must_use]
    pub fn write_image(mut self, image: &'a mut Image) -> Self {
        let shader = self.kernel.shader;
        self.bindings.image(shader, shader.bindings, image, true);
        self
    }

    fn bind<T: Pod>(mut self, buffer: &Buffer<T>, stride: usize, write: bool) -> Self {
        let shader = self.kernel.shader;
        self.bindings.buffer(shader, shader.bindings, buffer, stride, write);
        self
    }

    /// Sets the push constants.
    #[must_use]
    pub fn push<P: Pod>(mut self, params: &P) -> Self {
        self.push = bytemuck::bytes_of(params).to_vec();
        self
    }

    /// Records the pass over `x` workgroups; none at all for 0.
    pub fn dispatch(self, x: u32) {
        self.dispatch_3d([x, 1, 1]);
    }

    /// Records the pass over so many workgroups along x, y and z; none at all where one is 0.
    pub fn dispatch_3d(self, groups: [u32; 3]) {
        let most = self.recorder.gpu.0.limits.workgroups;
        let name = self.kernel.shader.name;
        // Every device allows 65535 along y and z.
        assert!(
            groups[0] <= most && groups[1].max(groups[2]) <= 65535,
            "{name}: {groups:?} workgroups are too many"
        );
        if !groups.contains(&0) {
            self.record(Groups::Of(groups));
        }
    }

    /// Records the pass over as many workgroups as `counts[index]` says when it runs.
    pub fn dispatch_indirect(self, counts: &Buffer<[u32; 3]>, index: usize) {
        assert!(index < counts.len(), "{}: no such row", counts.name());
        let handle = counts.handle();
        self.record(Groups::From(handle, (index * size_of::<[u32; 3]>()) as u64));
    }

    fn record(self, groups: Groups) {
        let Pass { recorder, kernel, mut bindings, push } = self;
        let shader = kernel.shader;
        assert_eq!(bindings.bound.len(), shader.bindings.len(), "{}: a resource is missing", shader.name);
        assert_eq!(push.len(), shader.push_bytes, "{}: push constants differ in size", shader.name);
        if let Groups::From(buffer, _) = groups {
            recorder.wide = true;
            bindings.accesses.push((Resident::Buffer(buffer), false));
        }
        recorder.touch(&bindings.accesses);
        recorder.timed(shader.name, vk::PipelineStageFlags2::COMPUTE_SHADER, |context, commands| {
            let device = &context.device;
            // SAFETY: recording; pipeline, layout and resources are live, the reflected layout matches what is pushed,
            // and indirect counts lie in a buffer made for them.
            unsafe {
                device.cmd_bind_pipeline(commands, vk::PipelineBindPoint::COMPUTE, kernel.pipeline);
                bindings.push(context, commands, vk::PipelineBindPoint::COMPUTE, kernel.layout);
                if !push.is_empty() {
                    let stages = vk::ShaderStageFlags::COMPUTE;
                    device.cmd_push_constants(commands, kernel.layout, stages, 0, &push);
                }
                match groups {
                    Groups::Of([x, y, z]) => device.cmd_dispatch(commands, x, y, z),
                    Groups::From(buffer, offset) => device.cmd_dispatch_indirect(commands, buffer, offset),
                }
            }
        });
    }
}
