//! The element of exceptions: voxels whose occupancy is not the rounded one. They follow one another closely,
//! so each takes a byte or two: twice the distance from the voxel before, plus 1 if the voxel is inside, as a
//! LEB128 number (seven bits a byte, the least first; the eighth says that more follow). Voxels count x
//! fastest, and the first distance is from voxel −1.

use std::io::BufRead;

use ply_rs::ply::{ElementDef, PropertyType};

use super::header::{Header, bad};
use super::names::{EXCEPTION_ELEMENT, EXCEPTION_PROPERTY};
use super::rows::{self, Column};
use crate::{Exception, Grid};
use base::error::Result;

/// Returns the exceptions, which are in order, as the bytes of a file.
pub(crate) fn bytes(exceptions: &[Exception], grid: Option<&Grid>) -> Vec<u8> {
    let Some(grid) = grid else { return Vec::new() };
    let mut bytes = Vec::new();
    let mut next = 0;
    for exception in exceptions {
        let index = exception.index(grid);
        let mut code = 2 * (index + 1 - next) + u64::from(exception.inside);
        while code >= 0x80 {
            bytes.push(code as u8 | 0x80);
            code >>= 7;
        }
        bytes.push(code as u8);
        next = index + 1;
    }
    bytes
}

/// Returns the lines of the header for this many bytes; none for no bytes.
pub(super) fn declared(bytes: usize) -> String {
    match bytes {
        0 => String::new(),
        _ => format!("element {EXCEPTION_ELEMENT} {bytes}\nproperty uchar {EXCEPTION_PROPERTY}\n"),
    }
}

/// Reads `element`; `source` must be at the first row and is left behind the last. The number of rows was
/// checked against the size of the file.
pub(super) fn read(
    source: &mut impl BufRead,
    header: &Header,
    element: &ElementDef,
    grid: &Grid,
) -> Result<Vec<Exception>> {
    let column = element.properties.get_full(EXCEPTION_PROPERTY).and_then(|(property, _, definition)| {
        matches!(definition.data_type, PropertyType::Scalar(_)).then_some(Column { property, slot: 0 })
    });
    let column = column.ok_or_else(|| {
        let message = format!("element `{EXCEPTION_ELEMENT}` has no property `{EXCEPTION_PROPERTY}`");
        bad("VGS-PLY-032", message).help(CHANGED)
    })?;
    let mut reading = Reading::new(grid);
    rows::read(source, header, element, &[column], |_, &[byte]: &[f32; 1]| reading.take(byte))?;
    let broken =
        |what: &str| bad("VGS-PLY-033", format!("element `{EXCEPTION_ELEMENT}`: {what}")).help(CHANGED);
    reading.done().map_err(broken)
}

/// Returns the exceptions of these bytes, or what is wrong with them.
pub(crate) fn of_bytes(bytes: &[u8], grid: &Grid) -> std::result::Result<Vec<Exception>, &'static str> {
    let mut reading = Reading::new(grid);
    bytes.iter().for_each(|&byte| reading.take(f32::from(byte)));
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

    fn take(&mut self, value: f32) {
        let byte = value as u8;
        if f32::from(byte) != value {
            self.wrong.get_or_insert("a byte is not from 0 to 255");
        }
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
    fn near_voxels_take_a_byte_and_far_ones_more() {
        let grid = Grid { size: [100, 50, 40], world_from_voxel: DAffine3::IDENTITY };
        let code = |all: &[(u64, bool)]| {
            let at =
                |&(index, inside): &(u64, bool)| Exception::at(index, inside, &grid).expect("in the grid");
            bytes(&all.iter().map(at).collect::<Vec<_>>(), Some(&grid))
        };
        assert!(code(&[]).is_empty());
        assert_eq!(code(&[(0, false), (1, true), (63, false)]), [2, 3, 124]);
        // 400001: the least seven bits come first.
        assert_eq!(code(&[(199_999, true)]), [0x81, 0xb5, 0x18]);
        assert_eq!(Exception::at(200_000, true, &grid), None);
    }
}
