//! A part of a picture, so that other work finds its turn while a slow one is rendered.

use std::ops::Range;

/// A band of rows of a picture, from one to another 256th of its height from the top. The first part also makes what the
/// others stand on: what an earlier part has prepared holds until the last one is submitted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Part {
    from: u32,
    to: u32,
}

impl Part {
    /// The whole picture.
    pub const WHOLE: Self = Part { from: 0, to: Self::ALL };

    /// Number of bands in a picture.
    pub const ALL: u32 = 256;

    /// Returns the first `bands` bands of a picture, at least one.
    pub fn first(bands: u32) -> Self {
        Part { from: 0, to: bands.clamp(1, Self::ALL) }
    }

    /// Returns the `bands` bands after this part, at least one; `None` if this is the last part.
    pub fn next(self, bands: u32) -> Option<Self> {
        let to = self.to.saturating_add(bands.max(1)).min(Self::ALL);
        (self.to < Self::ALL).then_some(Part { from: self.to, to })
    }

    /// Returns the number of bands.
    pub fn bands(self) -> u32 {
        self.to - self.from
    }

    /// Returns true if it begins the picture.
    pub fn is_first(self) -> bool {
        self.from == 0
    }

    /// Returns the rows of `count` that belong to it; none if there are fewer rows than bands.
    pub fn rows(self, count: u32) -> Range<u32> {
        let row = |band: u32| (u64::from(band) * u64::from(count) / u64::from(Self::ALL)) as u32;
        row(self.from)..row(self.to)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_are_all_of_a_picture_and_nothing_twice() {
        for count in [1, 2, 255, 256, 257, 720, 16384] {
            for bands in [1, 3, 100, 256, u32::MAX] {
                let (mut part, mut next) = (Part::first(bands), 0);
                assert!(part.is_first());
                loop {
                    let rows = part.rows(count);
                    assert_eq!(rows.start, next);
                    next = rows.end;
                    match part.next(bands) {
                        Some(after) => part = after,
                        None => break,
                    }
                    assert!(!part.is_first());
                }
                assert_eq!(next, count);
            }
        }
        assert_eq!(Part::WHOLE, Part::first(Part::ALL));
        assert_eq!(Part::WHOLE.rows(720), 0..720);
    }
}
