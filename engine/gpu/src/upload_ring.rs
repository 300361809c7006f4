//! The way of data that change often to the device: no allocation, no wait.

use ash::vk;
use bytemuck::Pod;

use super::{Buffer, Gpu, Image, Recorder, Ticket, lock};
use base::error::Result;

/// Host memory from which recorded copies read, in pieces that are written again once their copies are done. A recorder's
/// uploads share one piece: after [`UploadRing::begin`], [`UploadRing::write`] and [`UploadRing::write_rectangle`]
/// take room in it.
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
    reader: Reader,
}

/// What reads a piece.
#[derive(Clone, Copy)]
enum Reader {
    Nothing,
    /// A recorder that was not submitted when the piece was written.
    Recorder,
    /// Nothing behind this submission.
    Until(Ticket),
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

    /// Begins the uploads of a recorder; the one of the uploads before has been submitted or dropped. If the device still
    /// reads from every piece, there is one more from now on.
    pub fn begin(&mut self) -> Result<()> {
        if let reader @ Reader::Recorder = &mut self.pieces[self.current].reader {
            *reader = Reader::Until(Ticket(lock(&self.gpu.0.queue).last_value()));
        }
        let (len, bytes) = (self.pieces.len(), self.pieces[0].memory.bytes());
        self.written = 0;
        for at in (1..=len).map(|n| (self.current + n) % len) {
            let is_free = match self.pieces[at].reader {
                Reader::Nothing => true,
                Reader::Recorder => false,
                Reader::Until(ticket) => self.gpu.has_finished(ticket)?,
            };
            if is_free {
                self.pieces[at].reader = Reader::Nothing;
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
        let from = self.put(data)?;
        let memory = self.pieces[self.current].memory.handle();
        recorder.copy_bytes((memory, from), (to.handle(), 0), size_of_val(data) as u64, to.name());
        Ok(())
    }

    /// Records that a rectangle of a picture of one layer, from `corner` on, becomes `texels`, rows from the top. What a
    /// piece has no room for gets memory of its own.
    ///
    /// # Panics
    /// If the rectangle is not inside the picture, or `texels` is not one `T` of a texel's size, whole words, for each of its
    /// texels.
    pub fn write_rectangle<T: Pod>(
        &mut self,
        recorder: &mut Recorder,
        texels: &[T],
        image: &mut Image,
        corner: [u32; 2],
        size: [u32; 2],
    ) -> Result<()> {
        let name = image.name();
        assert_eq!(size_of::<T>(), image.format().bytes(), "{name}: texels differ in size");
        assert_eq!(size_of::<T>() % 4, 0, "{name}: texels of whole words");
        assert_eq!(texels.len(), (size[0] * size[1]) as usize, "{name}: number of texels");
        assert!(
            (0..2).all(|i| corner[i] + size[i] <= image.size()[i]) && image.layers() == 1,
            "{name}: a rectangle outside"
        );
        let region = image
            .region()
            .image_offset(vk::Offset3D { x: corner[0] as i32, y: corner[1] as i32, z: 0 })
            .image_extent(vk::Extent3D { width: size[0], height: size[1], depth: 1 });
        if (self.written + size_of_val(texels)) as u64 <= self.pieces[self.current].memory.bytes() {
            let from = self.put(texels)?;
            recorder.fill_image(&self.pieces[self.current].memory, image, region.buffer_offset(from));
        } else {
            let staging = self.gpu.staged(&format!("{name} upload"), texels)?;
            recorder.fill_image(&staging, image, region);
            recorder.keep(staging);
        }
        Ok(())
    }

    /// Copies data into the piece. Returns the byte at which they begin.
    fn put<T: Pod>(&mut self, data: &[T]) -> Result<u64> {
        let bytes = bytemuck::cast_slice::<T, u8>(data);
        let (from, piece) = (self.written, &mut self.pieces[self.current]);
        self.written += bytes.len();
        piece.memory.mapped_bytes()?[from..self.written].copy_from_slice(bytes);
        piece.reader = Reader::Recorder;
        Ok(from as u64)
    }

    fn add(&mut self, bytes: usize) -> Result<()> {
        let memory = self.gpu.mapped(self.name, "staging", bytes.div_ceil(size_of::<u32>()))?;
        self.pieces.push(Piece { memory, reader: Reader::Nothing });
        Ok(())
    }
}
