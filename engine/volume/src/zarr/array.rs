//! One resolution of an image, read by boxes.

use std::sync::Arc;

use zarrs::array::{Array, ArrayBytes, ArrayShardedExt, ArraySubset};
use zarrs::plugin::ZarrVersion;

use super::multiscale::{Image, LevelRow};
use super::store::{Store, bad};
use crate::affine::spacing_of;
use crate::elements::{self, Element};
use crate::payload::{Layout, Taken};
use crate::source::reserve_samples;
use crate::voxel_source::{VoxelSource, with_samples, without_voxels};
use crate::{Grid, Level, ReadOptions, Volume};
use base::{Error, Kind, Result};

/// Bytes of voxels that are decoded at a time, unless a row of chunks has more.
const SLAB_BYTES: u64 = 32 << 20;

const TYPES: [(&str, &Element); 12] = [
    ("bool", &elements::UINT8),
    ("int8", &elements::INT8),
    ("uint8", &elements::UINT8),
    ("int16", &elements::INT16),
    ("uint16", &elements::UINT16),
    ("int32", &elements::INT32),
    ("uint32", &elements::UINT32),
    ("int64", &elements::INT64),
    ("uint64", &elements::UINT64),
    ("float16", &elements::FLOAT16),
    ("float32", &elements::FLOAT32),
    ("float64", &elements::FLOAT64),
];

/// An open array of an image.
pub(super) struct Resolution {
    array: Array<Store>,
    /// Which axes of the array are x, y, z.
    space: [usize; 3],
    /// Index along the other axes.
    chosen: Vec<u64>,
    layout: Layout,
    grid: Grid,
    chunk: [usize; 3],
    about: Volume,
    max_bytes: u64,
    /// What to do where memory is short.
    coarser: Option<String>,
}

impl Resolution {
    pub fn open(store: &Arc<Store>, image: &Image, level: &LevelRow, options: &ReadOptions) -> Result<Self> {
        let path = &level.path;
        let wrong = |message: String| {
            bad("VGS-ZAR-004", format!("array '{path}': {message}"))
                .help("copy the store again, or export it again")
        };
        let array = Array::open(Arc::clone(store), &format!("/{path}")).map_err(|e| wrong(e.to_string()))?;
        if array.dimensionality() != image.axes {
            let message = format!("{} axes, and the image has {}", array.dimensionality(), image.axes);
            return Err(wrong(message));
        }
        let name = array.data_type().name(ZarrVersion::V3).unwrap_or_default();
        let Some((_, element)) = TYPES.into_iter().find(|(known, _)| *known == name) else {
            let message = format!("array '{path}' is of type {name}, not of single real numbers");
            return Err(bad("VGS-ZAR-005", message).help("export it as such, as int16 or float32"));
        };
        let shape = array.shape();
        if shape.contains(&0) {
            return Err(wrong(format!("its shape is {shape:?}; no axis may be empty")));
        }
        let size = image.space.map(|axis| usize::try_from(shape[axis]).unwrap_or(usize::MAX));
        let others: Vec<usize> = (0..image.axes).filter(|axis| !image.space.contains(axis)).collect();
        let volumes =
            others.iter().try_fold(1_usize, |n, &axis| n.checked_mul(usize::try_from(shape[axis]).ok()?));
        let volumes =
            volumes.ok_or_else(|| wrong(format!("its shape is {shape:?}, more than there can be")))?;
        let layout = Layout::new(element, cfg!(target_endian = "big"), size, (volumes, usize::MAX), options)?;
        let mut left = layout.chosen as u64;
        let mut chosen = vec![0; image.axes];
        for &axis in others.iter().rev() {
            chosen[axis] = left % shape[axis];
            left /= shape[axis];
        }
        let first = array.chunk_shape(&vec![0; image.axes]).map_err(|e| wrong(e.to_string()))?;
        let bytes_of = |shape: &[std::num::NonZeroU64]| {
            let product = shape.iter().try_fold(element.bytes as u64, |n, side| n.checked_mul(side.get()));
            product.unwrap_or(u64::MAX)
        };
        let inner = array.effective_subchunk_shape().unwrap_or_else(|| first.clone());
        let chunk_bytes = bytes_of(&inner);
        if chunk_bytes > options.max_bytes {
            let message = format!(
                "array '{path}' has chunks of {chunk_bytes} bytes, more than the limit of {}",
                options.max_bytes
            );
            return Err(Error::new(Kind::BadData, "VGS-VOL-005", message)
                .help("if that is right, raise the limit with --max-bytes"));
        }
        store.expect_chunks_of(bytes_of(&first));
        let side = |axis: usize| usize::try_from(inner[axis].get()).unwrap_or(usize::MAX);
        let chunk: [usize; 3] = std::array::from_fn(|k| side(image.space[k]).min(size[k]));
        let about = Volume { oriented: image.oriented, labels: image.labels.clone(), ..without_voxels() };
        let coarser = (image.levels.len() > 1).then(|| {
            format!(
                "read a coarser resolution (--level 1 to {}) or a part (--voxels), or raise the limit with --max-bytes",
                image.levels.len() - 1
            )
        });
        let grid = Grid { size, world_from_voxel: level.world_from_voxel };
        let (space, max_bytes) = (image.space, options.max_bytes);
        Ok(Resolution { array, space, chosen, layout, grid, chunk, about, max_bytes, coarser })
    }

    pub fn summary(&self) -> Level {
        let spacing_mm = spacing_of(&self.grid.world_from_voxel).to_array();
        Level { size: self.grid.size, spacing_mm, chunk: self.chunk, volumes: self.layout.volumes }
    }

    /// Returns a box in the axes of the array.
    fn subset(&self, first: [usize; 3], size: [usize; 3]) -> ArraySubset {
        let mut ranges: Vec<_> = self.chosen.iter().map(|&index| index..index + 1).collect();
        for (k, &axis) in self.space.iter().enumerate() {
            ranges[axis] = first[k] as u64..(first[k] + size[k]) as u64;
        }
        ArraySubset::new_with_ranges(&ranges)
    }

    /// Reads planes `first[2]..` of a box, x fastest, and passes the samples on.
    fn read_slab(
        &self,
        first: [usize; 3],
        size: [usize; 3],
        taken: &mut Taken<impl FnMut(f32)>,
    ) -> Result<()> {
        let failed = |message: String| {
            bad("VGS-ZAR-007", format!("chunks at voxel {first:?} cannot be read: {message}"))
                .help("copy the store again; a chunk that is missing altogether would be no error")
        };
        let subset = self.subset(first, size);
        let bytes: ArrayBytes =
            self.array.retrieve_array_subset(&subset).map_err(|e| failed(e.to_string()))?;
        let bytes = bytes.into_fixed().map_err(|e| failed(e.to_string()))?;
        let Layout { element, big_endian, .. } = self.layout;
        let [x, y, z] = self.space;
        if z < y && y < x {
            (element.decode)(&bytes, big_endian, &mut |stored| taken.take(stored));
        } else {
            let stride =
                |axis: usize| subset.shape()[axis + 1..].iter().map(|&n| n as usize).product::<usize>();
            let [sx, sy, sz] = self.space.map(stride);
            let mut values = Vec::with_capacity(bytes.len() / element.bytes);
            (element.decode)(&bytes, big_endian, &mut |stored| values.push(stored));
            for at in 0..size.iter().product() {
                let (i, j, k) = (at % size[0], at / size[0] % size[1], at / size[0] / size[1]);
                taken.take(values[i * sx + j * sy + k * sz]);
            }
        }
        taken.check()
    }
}

impl VoxelSource for Resolution {
    fn grid(&self) -> Grid {
        self.grid
    }

    fn known(&self, first: [usize; 3], size: [usize; 3]) -> Option<f32> {
        let chunks = self.array.chunks_in_array_subset(&self.subset(first, size)).ok()??;
        let is_missing = |chunk: &[u64]| self.array.storage().is_missing(&self.array.chunk_key(chunk));
        chunks.indices().iter().all(|chunk| is_missing(&chunk)).then_some(())?;
        let Layout { element, big_endian, .. } = self.layout;
        let mut value = None;
        let mut taken = Taken::new(&self.layout, |sample| value = Some(sample));
        (element.decode)(self.array.fill_value().as_ne_bytes(), big_endian, &mut |stored| taken.take(stored));
        taken.check().ok()?;
        value
    }

    fn read_box(&self, first: [usize; 3], size: [usize; 3]) -> Result<Volume> {
        self.grid.check_box(first, size)?;
        let count = size.iter().try_fold(1_usize, |n, &side| n.checked_mul(side)).unwrap_or(usize::MAX / 8);
        let mut samples = reserve_samples(count, self.max_bytes).map_err(|e| match &self.coarser {
            Some(coarser) if e.kind == Kind::BadData => e.help(coarser),
            _ => e,
        })?;
        let mut taken = Taken::new(&self.layout, |sample| samples.push(sample));
        // Slabs end where chunks do, so that no chunk is decoded twice.
        let plane = (size[0] * size[1] * self.layout.element.bytes) as u64;
        let chunk = self.chunk[2];
        let step =
            (usize::try_from(SLAB_BYTES / plane.max(1)).unwrap_or(1) / chunk).max(1).saturating_mul(chunk);
        let end = first[2] + size[2];
        let mut z = first[2];
        while z < end {
            let next = (z - z % chunk).saturating_add(step).min(end);
            self.read_slab([first[0], first[1], z], [size[0], size[1], next - z], &mut taken)?;
            z = next;
        }
        taken.warn_of_precision(self.array.path().as_path());
        Ok(with_samples(self.about.clone(), self.grid.of_box(first, size), samples))
    }
}
