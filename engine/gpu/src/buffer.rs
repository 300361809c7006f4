//! Typed storage buffers. Every buffer has a name and a purpose; the sum by purpose and the peak are kept, so
//! that a program can say what its memory is used for.

use std::marker::PhantomData;
use std::sync::Arc;

use ash::vk;
use bytemuck::Pod;
use gpu_allocator::MemoryLocation;
use gpu_allocator::vulkan::Allocation;

use super::memory::Dropped;
use super::placement::Placement;
use super::{Context, Gpu, check, lock};
use base::error::{Error, Kind, Result};

/// A storage buffer of `len` elements of `T`, in device memory. The name and the purpose appear in error
/// texts, in debuggers and in the account of bytes.
pub struct Buffer<T> {
    pub(super) gpu: Gpu,
    handle: vk::Buffer,
    /// `None` only inside `Drop`.
    allocation: Option<Allocation>,
    len: usize,
    name: String,
    purpose: &'static str,
    element: PhantomData<T>,
}

impl<T: Pod> Buffer<T> {
    /// Returns the number of elements.
    pub fn len(&self) -> usize {
        self.len
    }

    /// Returns true if there are no elements. (The memory then holds one all the same: Vulkan has no empty
    /// buffers.)
    pub fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// Returns the size of the elements, bytes.
    pub fn bytes(&self) -> u64 {
        (self.len * size_of::<T>()) as u64
    }

    /// Returns the name of the buffer.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Returns the handle.
    pub(super) fn handle(&self) -> vk::Buffer {
        self.handle
    }

    /// Returns the content of a buffer of [`Gpu::readback`], as of the last submission that was waited for.
    pub fn mapped(&self) -> Result<&[T]> {
        let bytes = self.allocation.as_ref().and_then(Allocation::mapped_slice).ok_or_else(|| {
            Error::new(Kind::Internal, "VGS-GPU-025", format!("{}: not a read-back buffer", self.name))
        })?;
        Ok(bytemuck::cast_slice(&bytes[..self.len * size_of::<T>()]))
    }

    /// Returns the content of a buffer of [`Gpu::mapped`]. Changes are seen by the submissions that follow;
    /// none that reads the buffer may be in flight meanwhile.
    pub fn mapped_mut(&mut self) -> Result<&mut [T]> {
        let bytes = self.len * size_of::<T>();
        Ok(bytemuck::cast_slice_mut(&mut self.mapped_bytes()?[..bytes]))
    }

    /// Returns the bytes of memory that the host sees.
    pub(super) fn mapped_bytes(&mut self) -> Result<&mut [u8]> {
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
            lock(&self.gpu.0.memory).delete_after(
                last,
                Dropped::Buffer(self.handle),
                allocation,
                self.purpose,
            );
        }
    }
}

impl Gpu {
    /// Creates a buffer in host memory into which passes are copied, to be read without a submission of its
    /// own.
    pub fn readback<T: Pod>(&self, name: &str, len: usize) -> Result<Buffer<T>> {
        self.raw(name, "staging", len, MemoryLocation::GpuToCpu)
    }

    /// Creates a buffer that the host writes and passes read, without a copy between: for the few data that
    /// change in each frame.
    pub fn mapped<T: Pod>(&self, name: &str, purpose: &'static str, len: usize) -> Result<Buffer<T>> {
        let mut buffer = self.raw::<T>(name, purpose, len, MemoryLocation::CpuToGpu)?;
        buffer.mapped_bytes()?.fill(0);
        Ok(buffer)
    }

    /// Creates a buffer in host memory that holds `data`, to be copied from.
    pub(super) fn staged<T: Pod>(&self, name: &str, data: &[T]) -> Result<Buffer<T>> {
        let bytes = bytemuck::cast_slice::<T, u8>(data);
        let mut staging = self.raw::<T>(name, "staging", data.len(), MemoryLocation::CpuToGpu)?;
        staging.mapped_bytes()?[..bytes.len()].copy_from_slice(bytes);
        Ok(staging)
    }

    /// Creates a buffer with undefined content.
    pub(super) fn raw<T: Pod>(
        &self,
        name: &str,
        purpose: &'static str,
        len: usize,
        location: MemoryLocation,
    ) -> Result<Buffer<T>> {
        let context: &Context = &self.0;
        // The size is rounded up to whole words, which fills need.
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
        let placement = Placement { name, purpose, requirements, location, linear: true };
        let allocation = context.place(&placement, Dropped::Buffer(handle))?;
        // SAFETY: memory and offset are the allocator's answer to this buffer's requirements.
        let bound =
            unsafe { context.device.bind_buffer_memory(handle, allocation.memory(), allocation.offset()) };
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
