//! What buffers hold: zeros or data at first, then what the host writes and reads back.

use bytemuck::Pod;
use gpu_allocator::MemoryLocation;

use super::{Buffer, Gpu, Recorder};
use base::error::{Error, Kind, Result};

impl<T: Pod> Buffer<T> {
    /// Reads all elements back. Waits for the device.
    pub fn read(&self) -> Result<Vec<T>> {
        self.read_range(0, self.len())
    }

    /// Reads `len` elements from `start`. Waits for the device.
    pub fn read_range(&self, start: usize, len: usize) -> Result<Vec<T>> {
        assert!(start + len <= self.len(), "{}: reading behind the end", self.name());
        if len == 0 {
            return Ok(Vec::new());
        }
        let bytes = (len * size_of::<T>()) as u64;
        let mut staging = self.gpu.raw::<T>(
            &format!("{} read back", self.name()),
            "staging",
            len,
            MemoryLocation::GpuToCpu,
        )?;
        let mut recorder = self.gpu.record()?;
        recorder.copy_bytes(
            (self.handle(), (start * size_of::<T>()) as u64),
            (staging.handle(), 0),
            bytes,
            self.name(),
        );
        let ticket = recorder.submit()?;
        self.gpu.wait(ticket)?;
        let mapped = staging.mapped_bytes()?;
        let mut out = vec![T::zeroed(); len];
        bytemuck::cast_slice_mut::<T, u8>(&mut out).copy_from_slice(&mapped[..bytes as usize]);
        Ok(out)
    }

    /// Overwrites the elements from `start`. Waits for the device if there is so much that the memory on the way should
    /// be free again before more follows.
    pub fn write_range(&mut self, start: usize, data: &[T]) -> Result<()> {
        assert!(start + data.len() <= self.len(), "{}: writing behind the end", self.name());
        if data.is_empty() {
            return Ok(());
        }
        let staging = self.gpu.staged(&format!("{} upload", self.name()), data)?;
        let mut recorder = self.gpu.record()?;
        recorder.copy_bytes(
            (staging.handle(), 0),
            (self.handle(), (start * size_of::<T>()) as u64),
            size_of_val(data) as u64,
            self.name(),
        );
        let bytes = staging.bytes();
        recorder.keep(staging);
        let ticket = recorder.submit()?;
        if bytes > UNAWAITED { self.gpu.wait(ticket) } else { Ok(()) }
    }
}

/// Most bytes of an upload that is not waited for.
const UNAWAITED: u64 = 1 << 20;

impl Gpu {
    /// Creates a zeroed storage buffer. `purpose` is the row of the account of bytes under which it is
    /// counted.
    pub fn buffer<T: Pod>(&self, name: &str, purpose: &'static str, len: usize) -> Result<Buffer<T>> {
        let buffer = self.uninitialised(name, purpose, len)?;
        let mut recorder: Recorder = self.record()?;
        recorder.clear(&buffer);
        recorder.submit()?;
        Ok(buffer)
    }

    /// Creates a storage buffer that holds `data`.
    pub fn upload<T: Pod>(&self, name: &str, purpose: &'static str, data: &[T]) -> Result<Buffer<T>> {
        if data.is_empty() {
            // Its memory has one element all the same.
            return self.buffer(name, purpose, 0);
        }
        let mut buffer = self.uninitialised(name, purpose, data.len())?;
        buffer.write_range(0, data)?;
        Ok(buffer)
    }

    /// Creates a storage buffer with undefined content.
    fn uninitialised<T: Pod>(&self, name: &str, purpose: &'static str, len: usize) -> Result<Buffer<T>> {
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
            .help(
                "use fewer splats (--splat-budget), 16 bytes for each (--precision packed), or a device with a \
                 larger storage-buffer range",
            ));
        }
        self.raw(name, purpose, len, MemoryLocation::GpuOnly)
    }
}
