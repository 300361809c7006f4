//! Volumes that are read by boxes, so that a part can be had of what is larger than memory.

use std::io::{Read, Seek, SeekFrom};
use std::path::PathBuf;

use glam::DAffine3;

use super::payload::{Layout, Packing, Payload, Taken};
use super::source::{Source, reserve_samples};
use super::{Grid, ReadOptions, Volume};
use base::input::{Input, open};
use base::{Error, Kind, Result};

/// A volume that is read by boxes.
pub trait VoxelSource: Send + Sync {
    /// Returns the grid of all voxels.
    fn grid(&self) -> Grid;

    /// Reads the box of `size` voxels whose first one is `first`, as a volume that lies where they lie in the patient.
    ///
    /// # Errors
    /// [`Kind::Usage`] if the box reaches beyond the grid or is empty; otherwise those of [`Volume::read`].
    fn read_box(&self, first: [usize; 3], size: [usize; 3]) -> Result<Volume>;

    /// Returns the value that all voxels of a box within the grid have, if that is known without reading them.
    fn known(&self, _first: [usize; 3], _size: [usize; 3]) -> Option<f32> {
        None
    }

    /// Reads all voxels.
    ///
    /// # Errors
    /// Those of [`Volume::read`].
    fn whole(self: Box<Self>) -> Result<Volume> {
        self.read_box([0; 3], self.grid().size)
    }
}

impl VoxelSource for Volume {
    fn grid(&self) -> Grid {
        Grid { size: self.size, world_from_voxel: self.world_from_voxel }
    }

    fn read_box(&self, first: [usize; 3], size: [usize; 3]) -> Result<Volume> {
        self.grid().check_box(first, size)?;
        Ok(self.cropped(first, size))
    }

    fn whole(self: Box<Self>) -> Result<Volume> {
        Ok(*self)
    }
}

/// The voxels of a file that is not compressed.
struct Plain {
    path: PathBuf,
    /// Byte of the first voxel.
    start: u64,
    layout: Layout,
    grid: Grid,
    /// What the header says, without voxels.
    about: Volume,
    options: ReadOptions,
}

/// Returns a volume whose header was read from `input`: `about` has what it says, `payload` the voxels. What is not
/// compressed is left in the file.
pub(super) fn opened(
    input: &Input,
    about: Volume,
    grid: Grid,
    (layout, payload): (Layout, Payload),
    is_text: bool,
    options: &ReadOptions,
) -> Result<Box<dyn VoxelSource>> {
    let row = grid.size[0];
    match payload.plain() {
        // What a reader reads is its own.
        Some((path, start)) if !is_text && input.path().is_some() && layout.place(0, row).is_some() => {
            let path = path.to_owned();
            Ok(Box::new(Plain { path, start, layout, grid, about, options: options.clone() }))
        }
        _ => {
            let samples = payload.samples(&layout, is_text, options)?;
            Ok(Box::new(with_samples(about, grid, samples)))
        }
    }
}

/// Returns a volume that has everything but its voxels.
pub(super) fn without_voxels() -> Volume {
    Volume::new([0; 3], DAffine3::IDENTITY, Vec::new())
}

pub(super) fn with_samples(about: Volume, grid: Grid, samples: Vec<f32>) -> Volume {
    Volume { size: grid.size, world_from_voxel: grid.world_from_voxel, samples, ..about }
}

impl VoxelSource for Plain {
    fn grid(&self) -> Grid {
        self.grid
    }

    fn read_box(&self, first: [usize; 3], size: [usize; 3]) -> Result<Volume> {
        self.grid.check_box(first, size)?;
        let failed = |e: std::io::Error| match e.kind() {
            std::io::ErrorKind::UnexpectedEof => {
                let message = format!("the file ends before voxel {first:?} + {size:?}");
                Error::new(Kind::BadData, "VGS-VOL-006", message)
                    .file(&self.path)
                    .help("the file was cut short; copy it again")
            }
            _ => Error::io(&self.path, "reading", &e),
        };
        let mut file = open(&self.path).map_err(failed)?;
        let mut samples = reserve_samples(size.iter().product(), self.options.max_bytes)?;
        let mut taken = Taken::new(&self.layout, |sample| samples.push(sample));
        let [nx, ny, _] = self.grid.size;
        let element = self.layout.element;
        let mut row = vec![0; size[0] * element.bytes];
        for at in 0..size[1] * size[2] {
            let (y, z) = (first[1] + at % size[1], first[2] + at / size[1]);
            let index = first[0] + nx * (y + ny * z);
            let place = self.layout.place(index, size[0]).expect("a row is in one piece: see `opened`");
            file.seek(SeekFrom::Start(self.start + place * element.bytes as u64)).map_err(failed)?;
            file.read_exact(&mut row).map_err(failed)?;
            (element.decode)(&row, self.layout.big_endian, &mut |stored| taken.take(stored));
        }
        taken.check().map_err(|e| e.file(&self.path))?;
        taken.warn_of_precision(&self.path);
        Ok(with_samples(self.about.clone(), self.grid.of_box(first, size), samples))
    }

    fn whole(self: Box<Self>) -> Result<Volume> {
        let mut source = Source::open(&Input::from(&self.path), self.options.lenient)?;
        source.skip(self.start)?;
        let payload = Payload::new(source, Packing::Plain, self.options.lenient)?;
        let samples = payload.samples(&self.layout, false, &self.options)?;
        Ok(with_samples(self.about, self.grid, samples))
    }
}

#[cfg(test)]
mod tests {
    use std::fs;
    use std::path::Path;

    use glam::DVec3;

    use super::*;
    use crate::nifti;

    const SIZE: [usize; 3] = [5, 4, 3];

    fn ramp() -> Volume {
        let map = DAffine3::from_scale(DVec3::new(1.0, 2.0, 3.0)) * DAffine3::from_rotation_z(0.3);
        Volume::new(SIZE, map, (0..60).map(|i| i as f32 - 20.0).collect())
    }

    /// The files of one volume, in which boxes are read from the file, or from memory.
    fn files(folder: &Path) -> Vec<PathBuf> {
        let ramp = ramp();
        let [nifti, packed, npy, fortran] =
            ["a.nii", "a.nii.gz", "a.npy", "b.npy"].map(|name| folder.join(name));
        nifti::write(&nifti, &ramp, true).unwrap();
        nifti::write(&packed, &ramp, true).unwrap();
        let bytes = |order: &str, samples: Vec<f32>| {
            let mut head = format!("{{'descr': '>f4', 'fortran_order': {order}, 'shape': (3, 4, 5), }}\n");
            head.insert_str(0, &" ".repeat(3));
            let head = head.trim_start().to_owned();
            let mut bytes = [b"\x93NUMPY\x01\x00", &(head.len() as u16).to_le_bytes()[..]].concat();
            bytes.extend(head.as_bytes());
            bytes.extend(samples.iter().flat_map(|v| v.to_be_bytes()));
            bytes
        };
        fs::write(&npy, bytes("False", ramp.samples.clone())).unwrap();
        let [x, y, z] = SIZE;
        let turned = (0..60).map(|i| ramp.samples[i / (y * z) + x * (i / z % y + y * (i % z))]).collect();
        fs::write(&fortran, bytes("True", turned)).unwrap();
        let raw: Vec<u8> = ramp.samples.iter().flat_map(|v| (*v as i16).to_le_bytes()).collect();
        let nrrd = folder.join("a.nrrd");
        // Two volumes whose rows alternate: a list axis behind x.
        let head = "NRRD0004\ntype: short\ndimension: 4\nsizes: 5 2 4 3\nkinds: space list space space\n\
                    endian: little\nencoding: raw\nspacings: 1 nan 1 1\n\n";
        let rows = raw.chunks(10).flat_map(|row| [&[7; 10][..], row].concat());
        fs::write(&nrrd, [head.as_bytes(), &rows.collect::<Vec<u8>>()].concat()).unwrap();
        let meta = folder.join("a.mha");
        let head = "ObjectType = Image\nNDims = 3\nDimSize = 5 4 3\nElementSpacing = 1 1 1\nOffset = 0 0 0\n\
                    ElementType = MET_SHORT\nElementDataFile = LOCAL\n";
        fs::write(&meta, [head.as_bytes(), &raw].concat()).unwrap();
        vec![nifti, packed, npy, fortran, nrrd, meta]
    }

    #[test]
    fn a_box_of_a_file_is_that_box_of_the_volume() {
        let folder = tempfile::tempdir().unwrap();
        let options = ReadOptions { volume_index: Some(0), ..ReadOptions::default() };
        for path in files(folder.path()) {
            let name = path.display();
            let index = usize::from(path.ends_with("a.nrrd"));
            let options = ReadOptions { volume_index: Some(index), ..options.clone() };
            let whole = Volume::read(&path, &options).unwrap();
            assert_eq!((whole.size, &whole.samples), (SIZE, &ramp().samples), "{name}");
            let source = Volume::open(&path, &options).unwrap();
            for (first, size) in [([0; 3], SIZE), ([1, 2, 0], [4, 1, 3]), ([4, 3, 2], [1, 1, 1])] {
                let (part, wanted) = (source.read_box(first, size).unwrap(), whole.cropped(first, size));
                assert_eq!((part.size, &part.samples), (size, &wanted.samples), "{name}");
                assert_eq!(part.world_from_voxel, wanted.world_from_voxel, "{name}");
                assert_eq!(part.oriented, whole.oriented, "{name}");
                let voxels = std::array::from_fn(|axis| [first[axis], first[axis] + size[axis]]);
                let read = Volume::read(&path, &ReadOptions { voxels: Some(voxels), ..options.clone() });
                assert_eq!(read.unwrap().samples, wanted.samples, "{name}");
            }
            for (first, size) in [([0; 3], [6, 4, 3]), ([5, 0, 0], [1; 3]), ([0; 3], [1, 0, 1])] {
                let error = source.read_box(first, size).unwrap_err();
                assert_eq!((error.kind, error.code), (Kind::Usage, "VGS-VOL-026"), "{name}: {error}");
            }
            assert_eq!(source.whole().unwrap().samples, whole.samples, "{name}");
        }
    }

    #[test]
    fn a_part_is_read_of_what_is_larger_than_the_limit() {
        let folder = tempfile::tempdir().unwrap();
        let path = &files(folder.path())[0];
        let options = ReadOptions { max_bytes: 4 * 59, ..ReadOptions::default() };
        assert_eq!(Volume::read(path, &options).unwrap_err().code, "VGS-VOL-005");
        let part = ReadOptions { voxels: Some([[0, 5], [0, 4], [1, 3]]), ..options };
        assert_eq!(Volume::read(path, &part).unwrap().samples, ramp().samples[20..]);
        // A file that ends too early is found where the box reaches there.
        let bytes = fs::read(path).unwrap();
        fs::write(path, &bytes[..bytes.len() - 4]).unwrap();
        assert_eq!(Volume::read(path, &part).unwrap_err().code, "VGS-VOL-006");
    }

    #[test]
    fn a_mask_is_read_in_the_box_of_its_volume() {
        let folder = tempfile::tempdir().unwrap();
        let path = &files(folder.path())[0];
        let options = ReadOptions { voxels: Some([[1, 4], [0, 2], [1, 2]]), ..ReadOptions::default() };
        let volume = Volume::read(path, &options).unwrap();
        let own = folder.path().join("part.nii");
        nifti::write(&own, &volume, true).unwrap();
        for mask in [path, &own] {
            let mask = Volume::read_mask(mask, &options, &crate::LabelChoice::Whole, &volume).unwrap();
            assert_eq!((mask.size, &mask.samples), (volume.size, &volume.samples));
        }
    }
}
