//! The element of the region: its bytes, as the other formats have them, too.
//!
//! Files from before there were regions have an element of exceptions, voxels on the other side of the mask than
//! their splats say: each twice the distance from the one before, plus 1 if it is inside, as a LEB128 number (seven
//! bits a byte, the least first; the eighth says that more follow). Voxels count x fastest, and the first distance is
//! from voxel −1.

use std::io::BufRead;

use ply_rs::ply::{ElementDef, PropertyType};

use super::header::{Header, bad};
use super::names::{CODE_PROPERTY, REGION_ELEMENT};
use super::rows::{self, Column};
use crate::Grid;
use crate::region::Exception;
use base::error::Result;

/// Returns the lines of the header for a region of so many bytes.
pub(super) fn declared(bytes: usize) -> String {
    format!("element {REGION_ELEMENT} {bytes}\nproperty uchar {CODE_PROPERTY}\n")
}

/// Reads the bytes of `element`; `source` must be at the first row and is left behind the last. The number of rows was
/// checked against the size of the file.
pub(super) fn read(source: &mut impl BufRead, header: &Header, element: &ElementDef) -> Result<Vec<u8>> {
    let column = element.properties.get_full(CODE_PROPERTY).and_then(|(property, _, definition)| {
        matches!(definition.data_type, PropertyType::Scalar(_)).then_some(Column { property, slot: 0 })
    });
    let column = column.ok_or_else(|| {
        let message = format!("element `{}` has no property `{CODE_PROPERTY}`", element.name);
        bad("VGS-PLY-032", message).help(CHANGED)
    })?;
    let (mut bytes, mut other) = (Vec::new(), false);
    rows::read(source, header, element, &[column], |_, &[value]: &[f32; 1]| {
        other |= f32::from(value as u8) != value;
        bytes.push(value as u8);
    })?;
    match other {
        true => Err(broken(&element.name, "a byte is not from 0 to 255")),
        false => Ok(bytes),
    }
}

/// Returns the error of an element that is not as it was written.
pub(super) fn broken(element: &str, what: &str) -> base::Error {
    bad("VGS-PLY-033", format!("element `{element}`: {what}")).help(
        "another program has changed the file, or a later version has written it; `vgs convert FILE --like ORIGINAL \
         -o OUT.ply` takes what is missing from the original",
    )
}

/// Returns the exceptions of these bytes, or what is wrong with them.
pub(crate) fn exceptions(bytes: &[u8], grid: &Grid) -> std::result::Result<Vec<Exception>, &'static str> {
    let mut reading = Reading::new(grid);
    bytes.iter().for_each(|&byte| reading.take(byte));
    reading.done()
}

const CHANGED: &str = "the file was changed by hand or written by a later version";

/// State between two bytes.
struct Reading<'a> {
    grid: &'a Grid,
    exceptions: Vec<Exception>,
    /// Index behind the last voxel.
    next: u64,
    /// The number so far, and its bits.
    code: u64,
    bits: u32,
    wrong: Option<&'static str>,
}

impl<'a> Reading<'a> {
    fn new(grid: &'a Grid) -> Self {
        Reading { grid, exceptions: Vec::new(), next: 0, code: 0, bits: 0, wrong: None }
    }

    fn done(self) -> std::result::Result<Vec<Exception>, &'static str> {
        match self.wrong {
            Some(what) => Err(what),
            None if self.bits > 0 => Err("the last number has no end"),
            None => Ok(self.exceptions),
        }
    }

    fn take(&mut self, byte: u8) {
        // Nine groups of seven bits count more voxels than a grid can have.
        if self.bits >= 63 {
            self.wrong.get_or_insert("a number is too long");
        }
        if self.wrong.is_some() {
            return;
        }
        self.code |= u64::from(byte & 0x7f) << self.bits;
        self.bits += 7;
        if byte & 0x80 != 0 {
            return;
        }
        let (distance, inside) = (self.code >> 1, self.code & 1 == 1);
        (self.code, self.bits) = (0, 0);
        let index = (self.next + distance).checked_sub(1).filter(|_| distance > 0);
        match index.and_then(|index| Exception::at(index, inside, self.grid)) {
            Some(exception) => {
                self.next += distance;
                self.exceptions.push(exception);
            }
            None => {
                self.wrong.get_or_insert("a voxel is named twice, or lies beyond the grid");
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use glam::DAffine3;

    use super::*;

    #[test]
    fn exceptions_are_read() {
        let grid = Grid { size: [100, 50, 40], world_from_voxel: DAffine3::IDENTITY };
        let read = |bytes: &[u8]| exceptions(bytes, &grid);
        let at = |index, inside| Exception::at(index, inside, &grid).expect("in the grid");
        assert_eq!(read(&[]), Ok(Vec::new()));
        assert_eq!(read(&[2, 3, 124]), Ok(vec![at(0, false), at(1, true), at(63, false)]));
        // 400001: the least seven bits come first.
        assert_eq!(read(&[0x81, 0xb5, 0x18]), Ok(vec![at(199_999, true)]));
        assert_eq!(Exception::at(200_000, true, &grid), None);
        for wrong in [&[0x83, 0xb5, 0x18][..], &[0x80], &[0], &[0xff; 9]] {
            assert!(read(wrong).is_err(), "{wrong:?}");
        }
    }
}
