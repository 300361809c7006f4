//! Lists of rows that are stored one behind the other, on the host and in two buffers.

use base::error::Result;
use gpu::{Buffer, Gpu};

/// Lists stored one behind the other.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Lists {
    /// End of each list, where the next one begins.
    pub ends: Vec<u32>,
    /// Rows of all lists.
    pub rows: Vec<u32>,
}

/// [`Lists`] on the device.
pub struct DeviceLists {
    /// End of each list, where the next one begins.
    pub ends: Buffer<u32>,
    /// Rows of all lists.
    pub rows: Buffer<u32>,
}

impl Lists {
    /// Builds `count` lists from pairs of a list and a row; `visit` is called twice and must give the same
    /// pairs in the same order. There must be fewer than 2³² of them.
    pub fn new(count: usize, visit: impl Fn(&mut dyn FnMut(usize, u32))) -> Self {
        let mut ends = vec![0u32; count + 1];
        visit(&mut |list, _| ends[list + 1] += 1);
        for i in 1..=count {
            ends[i] += ends[i - 1];
        }
        let mut rows = vec![0; ends[count] as usize];
        // Each list is filled from its start on, so that its start becomes its end.
        visit(&mut |list, row| {
            rows[ends[list] as usize] = row;
            ends[list] += 1;
        });
        ends.truncate(count);
        Lists { ends, rows }
    }

    /// Returns the number of lists.
    pub fn len(&self) -> usize {
        self.ends.len()
    }

    /// Returns true if there are no lists.
    pub fn is_empty(&self) -> bool {
        self.ends.is_empty()
    }

    /// Returns the rows of a list.
    pub fn of(&self, list: usize) -> &[u32] {
        let start = if list == 0 { 0 } else { self.ends[list - 1] };
        &self.rows[start as usize..self.ends[list] as usize]
    }

    /// Uploads the lists into buffers of this name and purpose.
    pub fn upload(&self, gpu: &Gpu, name: &str, purpose: &'static str) -> Result<DeviceLists> {
        Ok(DeviceLists {
            ends: gpu.upload(&format!("ends of {name}"), purpose, &self.ends)?,
            rows: gpu.upload(name, purpose, &self.rows)?,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lists_keep_the_order_of_their_rows() {
        let pairs = [(2, 7), (0, 1), (2, 5), (4, 9), (0, 3)];
        let lists = Lists::new(5, |take| pairs.iter().for_each(|&(list, row)| take(list, row)));
        let found: Vec<&[u32]> = (0..lists.len()).map(|i| lists.of(i)).collect();
        assert_eq!(found, [&[1, 3][..], &[], &[7, 5], &[], &[9]]);
        assert!(Lists::new(0, |_| ()).is_empty());
    }
}
