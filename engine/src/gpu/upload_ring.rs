//! The way of data that change often to the device: no allocation, no wait.

use bytemuck::Pod;

use super::{Buffer, Gpu, Recorder, Ticket};
use crate::error::Result;

/// Host memory from which recorded copies read, in pieces that are written again once their copies are done. An upload
/// has one piece: [`UploadRing::begin`], [`UploadRing::write`] for each of its buffers, [`UploadRing::submitted`].
pub struct UploadRing {
    gpu: Gpu,
    name: &'static str,
    pieces: Vec<Piece>,
    /// Piece of the upload being recorded.
    current: usize,
    /// Bytes of it that are taken.
    written: usize,
}

struct Piece {
    memory: Buffer<u32>,
    /// Submission of the copies that read it last.
    reader: Option<Ticket>,
}

impl UploadRing {
    /// Creates a ring of `count` pieces, more than 0, of `bytes` bytes each. For an upload with each of n frames in flight,
    /// n + 1 suffice.
    pub fn new(gpu: &Gpu, name: &'static str, count: usize, bytes: usize) -> Result<Self> {
        let mut ring = UploadRing { gpu: gpu.clone(), name, pieces: Vec::new(), current: 0, written: 0 };
        for _ in 0..count {
            ring.add(bytes)?;
        }
        Ok(ring)
    }

    /// Begins an upload. If the device still reads from every piece, there is one more from now on.
    pub fn begin(&mut self) -> Result<()> {
        let (len, bytes) = (self.pieces.len(), self.pieces[0].memory.bytes());
        self.written = 0;
        for at in (1..=len).map(|n| (self.current + n) % len) {
            if self.pieces[at].reader.map_or(Ok(true), |reader| self.gpu.has_finished(reader))? {
                self.current = at;
                return Ok(());
            }
        }
        self.current = len;
        self.add(bytes as usize)
    }

    /// Records that the first elements of a buffer become `data`.
    ///
    /// # Panics
    /// If the buffer is too small, or the upload is longer than a piece.
    pub fn write<T: Pod>(&mut self, recorder: &mut Recorder, data: &[T], to: &mut Buffer<T>) -> Result<()> {
        assert!(data.len() <= to.len(), "{}: writing behind the end", to.name());
        let bytes = bytemuck::cast_slice::<T, u8>(data);
        let (from, memory) = (self.written, &mut self.pieces[self.current].memory);
        self.written += bytes.len();
        memory.mapped_bytes()?[from..self.written].copy_from_slice(bytes);
        let places = ((memory.handle(), from as u64), (to.handle(), 0));
        recorder.copy_bytes(places.0, places.1, bytes.len() as u64, to.name());
        Ok(())
    }

    /// Notes the submission that reads the upload.
    pub fn submitted(&mut self, ticket: Ticket) {
        self.pieces[self.current].reader = Some(ticket);
    }

    fn add(&mut self, bytes: usize) -> Result<()> {
        let memory = self.gpu.mapped(self.name, "staging", bytes.div_ceil(size_of::<u32>()))?;
        self.pieces.push(Piece { memory, reader: None });
        Ok(())
    }
}
