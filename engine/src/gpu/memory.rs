//! Typed storage buffers on explicit memory. Every allocation has a name and a purpose; the sum by purpose and the
//! peak are kept, so that a program can say where its bytes are.

use std::collections::BTreeMap;
use std::marker::PhantomData;
use std::sync::Arc;
use std::sync::atomic::Ordering;

use ash::vk;
use bytemuck::Pod;
use gpu_allocator::MemoryLocation;
use gpu_allocator::vulkan::{
    Allocation, AllocationCreateDesc, AllocationScheme, Allocator, AllocatorCreateDesc,
};

use super::{Context, Gpu, Recorder, check, lock};
use crate::error::{Error, Kind, Result};

/// The allocator, what waits to be freed, and the account of bytes.
pub(super) struct Memory {
    /// `None` only while the device is being destroyed.
    allocator: Option<Allocator>,
    /// What was dropped, with the timeline value after which nothing uses it.
    graveyard: Vec<(u64, Remains, Option<Allocation>)>,
    pub(super) by_purpose: BTreeMap<&'static str, u64>,
    pub(super) peak: u64,
}

/// Handles of something dropped.
pub(super) enum Remains {
    Buffer(vk::Buffer),
    Image(vk::Image, vk::ImageView),
    /// Of an image that somebody else owns.
    View(vk::ImageView),
}

impl Memory {
    pub(super) fn new(
        instance: ash::Instance,
        physical: vk::PhysicalDevice,
        device: ash::Device,
    ) -> Result<Self> {
        let allocator = Allocator::new(&AllocatorCreateDesc {
            instance,
            device,
            physical_device: physical,
            debug_settings: gpu_allocator::AllocatorDebugSettings::default(),
            buffer_device_address: false,
            allocation_sizes: gpu_allocator::AllocationSizes::default(),
        })
        .map_err(|e| Error::new(Kind::Internal, "VGS-GPU-020", format!("device memory allocator: {e}")))?;
        Ok(Memory { allocator: Some(allocator), graveyard: Vec::new(), by_purpose: BTreeMap::new(), peak: 0 })
    }

    /// Frees what the device has passed.
    pub(super) fn bury(&mut self, device: &ash::Device, passed: u64) {
        let Some(allocator) = &mut self.allocator else { return };
        for (_, remains, allocation) in self.graveyard.extract_if(.., |(value, ..)| *value <= passed) {
            // SAFETY: the device has passed the last submission made before the handles were dropped; a null view is
            // ignored.
            unsafe {
                match remains {
                    Remains::Buffer(buffer) => device.destroy_buffer(buffer, None),
                    Remains::Image(image, view) => {
                        device.destroy_image_view(view, None);
                        device.destroy_image(image, None);
                    }
                    Remains::View(view) => device.destroy_image_view(view, None),
                }
            }
            if let Some(allocation) = allocation {
                // Freeing what this allocator gave cannot fail.
                let _ = allocator.free(allocation);
            }
        }
    }

    /// Memory for what `desc` says, counted under `purpose`.
    pub(super) fn allocate(
        &mut self,
        desc: &AllocationCreateDesc<'_>,
        purpose: &'static str,
    ) -> Result<Allocation> {
        let Some(allocator) = &mut self.allocator else {
            return Err(Error::new(Kind::Internal, "VGS-GPU-023", "the device is being destroyed"));
        };
        let allocation = allocator.allocate(desc).map_err(|e| {
            let bytes = desc.requirements.size;
            Error::new(
                Kind::Temporary,
                "VGS-GPU-024",
                format!("{}: {bytes} bytes of device memory: {e}", desc.name),
            )
            .help("close other programs that use the GPU, use fewer splats or a smaller ROI")
        })?;
        *self.by_purpose.entry(purpose).or_default() += allocation.size();
        self.peak = self.peak.max(self.by_purpose.values().sum());
        Ok(allocation)
    }

    /// Sends something dropped to the graveyard; `last` is the last submission that may use it.
    pub(super) fn retire(
        &mut self,
        last: u64,
        remains: Remains,
        allocation: Allocation,
        purpose: &'static str,
    ) {
        if let Some(bytes) = self.by_purpose.get_mut(purpose) {
            *bytes -= allocation.size();
        }
        self.graveyard.push((last, remains, Some(allocation)));
    }

    /// Sends the view of somebody else's image to the graveyard.
    pub(super) fn retire_view(&mut self, last: u64, view: vk::ImageView) {
        self.graveyard.push((last, Remains::View(view), None));
    }

    /// # Safety
    /// The device must be idle.
    pub(super) unsafe fn destroy(&mut self, device: &ash::Device) {
        self.bury(device, u64::MAX);
        self.allocator = None;
    }
}

/// A storage buffer of `len` elements of `T`, in device memory. The name and the purpose appear in error texts, in
/// debuggers and in the account of bytes.
pub struct Buffer<T> {
    gpu: Gpu,
    handle: vk::Buffer,
    /// `None` only inside `Drop`.
    allocation: Option<Allocation>,
    len: usize,
    name: String,
    purpose: &'static str,
    element: PhantomData<T>,
}

impl<T: Pod> Buffer<T> {
    /// Number of elements.
    pub fn len(&self) -> usize {
        self.len
    }

    /// Whether there are no elements. (The memory then holds one all the same: Vulkan has no empty buffers.)
    pub fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// Bytes of the elements.
    pub fn bytes(&self) -> u64 {
        (self.len * size_of::<T>()) as u64
    }

    /// Name of the buffer.
    pub fn name(&self) -> &str {
        &self.name
    }

    pub(super) fn handle(&self) -> vk::Buffer {
        self.handle
    }

    /// Reads all elements back. Waits for the device.
    pub fn read(&self) -> Result<Vec<T>> {
        self.read_range(0, self.len)
    }

    /// Reads `len` elements from `start`. Waits for the device.
    pub fn read_range(&self, start: usize, len: usize) -> Result<Vec<T>> {
        assert!(start + len <= self.len, "{}: reading behind the end", self.name);
        if len == 0 {
            return Ok(Vec::new());
        }
        let bytes = (len * size_of::<T>()) as u64;
        let mut staging = self.gpu.raw::<T>(
            &format!("{} read back", self.name),
            "staging",
            len,
            MemoryLocation::GpuToCpu,
        )?;
        let mut recorder = self.gpu.record()?;
        recorder.copy_bytes(
            (self.handle, (start * size_of::<T>()) as u64),
            (staging.handle, 0),
            bytes,
            &self.name,
        );
        let ticket = recorder.submit()?;
        self.gpu.wait(ticket)?;
        let mapped = staging.mapped_bytes()?;
        let mut out = vec![T::zeroed(); len];
        bytemuck::cast_slice_mut::<T, u8>(&mut out).copy_from_slice(&mapped[..bytes as usize]);
        Ok(out)
    }

    /// Overwrites the elements from `start`. Waits for the device.
    pub fn write_range(&mut self, start: usize, data: &[T]) -> Result<()> {
        assert!(start + data.len() <= self.len, "{}: writing behind the end", self.name);
        if data.is_empty() {
            return Ok(());
        }
        let staging = self.gpu.staged(&format!("{} upload", self.name), data)?;
        let mut recorder = self.gpu.record()?;
        recorder.copy_bytes(
            (staging.handle, 0),
            (self.handle, (start * size_of::<T>()) as u64),
            size_of_val(data) as u64,
            &self.name,
        );
        let ticket = recorder.submit()?;
        self.gpu.wait(ticket)
    }

    /// What a buffer of [`Gpu::readback`] holds, as of the last submission that was waited for.
    pub fn mapped(&self) -> Result<&[T]> {
        let bytes = self.allocation.as_ref().and_then(Allocation::mapped_slice).ok_or_else(|| {
            Error::new(Kind::Internal, "VGS-GPU-025", format!("{}: not a read-back buffer", self.name))
        })?;
        Ok(bytemuck::cast_slice(&bytes[..self.len * size_of::<T>()]))
    }

    /// What a buffer of [`Gpu::mapped`] holds. What is written is seen by the submissions that follow; none that reads it
    /// may be in flight meanwhile.
    pub fn mapped_mut(&mut self) -> Result<&mut [T]> {
        let bytes = self.len * size_of::<T>();
        Ok(bytemuck::cast_slice_mut(&mut self.mapped_bytes()?[..bytes]))
    }

    fn mapped_bytes(&mut self) -> Result<&mut [u8]> {
        let name = &self.name;
        self.allocation.as_mut().and_then(Allocation::mapped_slice_mut).ok_or_else(|| {
            Error::new(Kind::Internal, "VGS-GPU-021", format!("{name}: staging memory is not mapped"))
        })
    }
}

impl<T> Drop for Buffer<T> {
    fn drop(&mut self) {
        let last = lock(&self.gpu.0.queue).last_value();
        if let Some(allocation) = self.allocation.take() {
            lock(&self.gpu.0.memory).retire(last, Remains::Buffer(self.handle), allocation, self.purpose);
        }
    }
}

impl Gpu {
    /// A zeroed storage buffer. `purpose` is the row of the account of bytes that it counts under.
    pub fn buffer<T: Pod>(&self, name: &str, purpose: &'static str, len: usize) -> Result<Buffer<T>> {
        let bytes = (len * size_of::<T>()) as u64;
        if bytes > self.0.limits.storage_range {
            return Err(Error::new(
                Kind::Temporary,
                "VGS-GPU-022",
                format!(
                    "{name} needs {bytes} bytes; {} binds at most {}",
                    self.0.description.name, self.0.limits.storage_range
                ),
            )
            .help("use fewer splats or a device with a larger storage-buffer range"));
        }
        let buffer = self.raw(name, purpose, len, MemoryLocation::GpuOnly)?;
        let mut recorder: Recorder = self.record()?;
        recorder.clear(&buffer);
        recorder.submit()?;
        Ok(buffer)
    }

    /// A buffer in host memory that passes are copied into, to be read without a submission of its own.
    pub fn readback<T: Pod>(&self, name: &str, len: usize) -> Result<Buffer<T>> {
        self.raw(name, "staging", len, MemoryLocation::GpuToCpu)
    }

    /// A buffer that the host writes and passes read, without a copy between: for the little that changes in each
    /// frame.
    pub fn mapped<T: Pod>(&self, name: &str, purpose: &'static str, len: usize) -> Result<Buffer<T>> {
        let mut buffer = self.raw::<T>(name, purpose, len, MemoryLocation::CpuToGpu)?;
        buffer.mapped_bytes()?.fill(0);
        Ok(buffer)
    }

    /// A buffer in host memory that holds `data`, to be copied from.
    pub(super) fn staged<T: Pod>(&self, name: &str, data: &[T]) -> Result<Buffer<T>> {
        let bytes = bytemuck::cast_slice::<T, u8>(data);
        let mut staging = self.raw::<T>(name, "staging", data.len(), MemoryLocation::CpuToGpu)?;
        staging.mapped_bytes()?[..bytes.len()].copy_from_slice(bytes);
        Ok(staging)
    }

    /// A storage buffer that holds `data`.
    pub fn upload<T: Pod>(&self, name: &str, purpose: &'static str, data: &[T]) -> Result<Buffer<T>> {
        let mut buffer = self.buffer(name, purpose, data.len())?;
        buffer.write_range(0, data)?;
        Ok(buffer)
    }

    fn raw<T: Pod>(
        &self,
        name: &str,
        purpose: &'static str,
        len: usize,
        location: MemoryLocation,
    ) -> Result<Buffer<T>> {
        let context: &Context = &self.0;
        // Rounded up to whole words, which is what fills need.
        let bytes = ((len.max(1) * size_of::<T>()) as u64).next_multiple_of(4);
        let info = vk::BufferCreateInfo::default()
            .size(bytes)
            .usage(
                vk::BufferUsageFlags::STORAGE_BUFFER
                    | vk::BufferUsageFlags::INDIRECT_BUFFER
                    | vk::BufferUsageFlags::TRANSFER_SRC
                    | vk::BufferUsageFlags::TRANSFER_DST,
            )
            .sharing_mode(vk::SharingMode::EXCLUSIVE);
        // SAFETY: the device is live; the requirements are asked of the buffer just made.
        let (handle, requirements) = unsafe {
            let handle = check(name, context.device.create_buffer(&info, None))?;
            (handle, context.device.get_buffer_memory_requirements(handle))
        };
        context.name(handle, name);
        let made = lock(&context.memory).allocate(
            &AllocationCreateDesc {
                name,
                requirements,
                location,
                linear: true,
                allocation_scheme: AllocationScheme::GpuAllocatorManaged,
            },
            purpose,
        );
        let allocation = match made {
            Ok(allocation) => allocation,
            Err(e) => {
                // SAFETY: the buffer was never used.
                unsafe { context.device.destroy_buffer(handle, None) };
                return Err(e);
            }
        };
        // SAFETY: memory and offset are the allocator's answer to this buffer's requirements.
        let bound =
            unsafe { context.device.bind_buffer_memory(handle, allocation.memory(), allocation.offset()) };
        context.counters.allocations.fetch_add(1, Ordering::Relaxed);
        // From here on `Drop` cleans up.
        let buffer = Buffer {
            gpu: Gpu(Arc::clone(&self.0)),
            handle,
            allocation: Some(allocation),
            len,
            name: name.to_owned(),
            purpose,
            element: PhantomData,
        };
        check(name, bound).map(|()| buffer)
    }
}
