//! A volume as a folder of DICOM slices.

#[path = "../../../../engine/volume/src/dicom/tests/writer.rs"]
mod writer;

use engine::volume::Volume;
use glam::DVec3;
pub use writer::Dicom;
use writer::words;

use crate::support::Folder;

/// Writes a volume as two series of one folder, the second one described as "Bone kernel".
pub fn write_two_series(folder: &Folder, name: &str, volume: &Volume) {
    write_series(folder, name, volume, |_, _| ());
    write_series(folder, &format!("{name}/sharp"), volume, |z, file| {
        file.text((0x0020, 0x000e), b"UI", "1.2.9");
        file.text((0x0020, 0x0011), b"IS", "7");
        file.text((0x0008, 0x0018), b"UI", &format!("1.2.9.{z}"));
        file.text((0x0008, 0x103e), b"LO", "Bone kernel");
    });
}

/// Writes a volume whose axes are those of the world as slices, into a folder of the test's.
pub fn write_series(folder: &Folder, name: &str, volume: &Volume, change: impl Fn(usize, &mut Dicom)) {
    std::fs::create_dir(folder.path(name)).expect("a folder");
    let [columns, rows, slices] = volume.size;
    let spacing = volume.spacing_mm();
    for z in 0..slices {
        let at = volume.world_from_voxel.transform_point3(DVec3::new(0.0, 0.0, z as f64));
        let mut file = Dicom::slice(z as u16, DVec3::new(-at.x, -at.y, at.z));
        // The phantom's axes point to the right, front and head.
        file.text((0x0020, 0x0037), b"DS", "-1\\0\\0\\0\\-1\\0");
        file.text((0x0028, 0x0030), b"DS", &format!("{}\\{}", spacing.y, spacing.x));
        file.text((0x0028, 0x1053), b"DS", "1");
        file.text((0x0028, 0x1052), b"DS", "-2048");
        file.put((0x0028, 0x0010), b"US", words(&[rows as u16]));
        file.put((0x0028, 0x0011), b"US", words(&[columns as u16]));
        let plane = &volume.samples[z * columns * rows..][..columns * rows];
        let stored: Vec<u16> = plane.iter().map(|&hu| (hu + 2048.0).round() as u16).collect();
        file.put((0x7fe0, 0x0010), b"OW", words(&stored));
        change(z, &mut file);
        // Names that say nothing of the order.
        folder.write(&format!("{name}/{:04x}", (z * 7919) % 65521), file.bytes());
    }
}
