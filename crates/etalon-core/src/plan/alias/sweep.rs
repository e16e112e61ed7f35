//! Placement step by step: memory freed by resources whose last use has passed is
//! given to the next that fits most closely (best fit, neighbours merged); what fits
//! nowhere grows the heap.

use std::collections::{BTreeMap, BTreeSet};

use super::{Item, Layout};

/// Places items that are in the order of their first steps.
pub(super) fn layout(items: &[Item]) -> Layout {
    let mut ends: Vec<usize> = (0..items.len()).collect();
    ends.sort_by_key(|&k| items[k].last);
    let mut ends = ends.into_iter().peekable();
    let mut heap = Heap::default();
    let mut offsets = vec![0; items.len()];
    for (k, item) in items.iter().enumerate() {
        while let Some(ended) = ends.next_if(|&ended| items[ended].last < item.first) {
            heap.free(offsets[ended], items[ended].bytes);
        }
        offsets[k] = heap.allocate(item.bytes);
    }
    Layout {
        offsets,
        size: heap.size,
    }
}

/// A growing range of bytes with free blocks in it.
#[derive(Debug, Default)]
struct Heap {
    size: u64,
    /// Free blocks: bytes by offset.
    blocks: BTreeMap<u64, u64>,
    /// The same blocks as (bytes, offset), for the closest fit.
    by_size: BTreeSet<(u64, u64)>,
}

impl Heap {
    fn allocate(&mut self, bytes: u64) -> u64 {
        if bytes == 0 {
            return 0;
        }
        if let Some(&(size, offset)) = self.by_size.range((bytes, 0)..).next() {
            self.remove(offset);
            if size > bytes {
                self.insert(offset + bytes, size - bytes);
            }
            return offset;
        }
        // Grow, from the last block if that is free.
        let last = self.blocks.last_key_value().map(|(at, size)| (*at, *size));
        let offset = match last {
            Some((offset, size)) if offset + size == self.size => {
                self.remove(offset);
                offset
            }
            _ => self.size,
        };
        self.size = offset + bytes;
        offset
    }

    fn free(&mut self, mut offset: u64, mut bytes: u64) {
        if bytes == 0 {
            return;
        }
        if let Some((&before, &size)) = self.blocks.range(..offset).next_back()
            && before + size == offset
        {
            self.remove(before);
            (offset, bytes) = (before, bytes + size);
        }
        if let Some(size) = self.remove(offset + bytes) {
            bytes += size;
        }
        self.insert(offset, bytes);
    }

    fn insert(&mut self, offset: u64, bytes: u64) {
        self.blocks.insert(offset, bytes);
        self.by_size.insert((bytes, offset));
    }

    fn remove(&mut self, offset: u64) -> Option<u64> {
        let bytes = self.blocks.remove(&offset)?;
        self.by_size.remove(&(bytes, offset));
        Some(bytes)
    }
}
