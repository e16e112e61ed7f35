//! From indices to triangles.

use etalon_core::raster::{IndexFormat, Topology};

use super::error::RasterError;
use super::{IndexBuffer, RasterDraw, RasterProgram};

/// The vertices of a draw and how they make triangles.
#[derive(Debug, Default)]
pub(super) struct Assembly {
    /// Distinct indices by slot, without the base; `None` if vertices are drawn in
    /// their order.
    pub(super) distinct: Option<Vec<u32>>,
    /// The slot of each index; slots are numbered in the order of first use.
    slots: Option<Vec<u32>>,
    /// Of strips: where each triangle begins, and whether its order is turned.
    strips: Option<Vec<(u32, bool)>>,
    /// Vertices, or indices.
    count: u32,
}

impl Assembly {
    /// Triangles of one instance.
    pub(super) fn triangles(&self) -> usize {
        match &self.strips {
            Some(strips) => strips.len(),
            None => self.count as usize / 3,
        }
    }

    /// Distinct vertices of one instance.
    pub(super) fn vertices(&self) -> usize {
        match &self.distinct {
            Some(distinct) => distinct.len(),
            None => self.count as usize,
        }
    }

    /// The slots of a triangle's corners.
    #[inline]
    pub(super) fn corners(&self, triangle: usize) -> [u32; 3] {
        let places = match &self.strips {
            Some(strips) => match strips.get(triangle) {
                // Of every second one the last two corners are exchanged, so that
                // the first stays the one that flat inputs are of.
                Some(&(first, true)) => [first, first + 2, first + 1],
                Some(&(first, false)) => [first, first + 1, first + 2],
                None => [0; 3],
            },
            None => {
                let first = triangle as u32 * 3;
                [first, first + 1, first + 2]
            }
        };
        match &self.slots {
            Some(slots) => places.map(|place| slots.get(place as usize).copied().unwrap_or(0)),
            None => places,
        }
    }
}

/// Marks an index that no slot has yet.
const NONE: u32 = u32::MAX;

impl RasterProgram {
    /// Reads the indices of a draw, whose ranges were checked.
    pub(super) fn assemble(&self, draw: &RasterDraw<'_>) -> Result<Assembly, RasterError> {
        let mut assembly = Assembly {
            count: draw.range.count,
            ..Assembly::default()
        };
        let mut indices = match &draw.indices {
            Some(indices) => Some(self.read(indices, draw.range.first, draw.range.count)?),
            None => None,
        };
        let mut restart = None;
        if self.state.topology == Topology::TriangleStrip {
            restart = draw.indices.map(|indices| indices.format.restart());
            assembly.strips = Some(self.strips(indices.as_deref(), draw.range.count, restart)?);
        }
        if let (Some(indices), Some(restart)) = (&mut indices, restart) {
            // No triangle has it, and no vertex should be fetched for it.
            let other = indices.iter().copied().find(|index| *index != restart);
            for index in indices.iter_mut().filter(|index| **index == restart) {
                *index = other.unwrap_or(0);
            }
        }
        if let Some(indices) = &mut indices {
            assembly.distinct = Some(self.number(indices)?);
        }
        assembly.slots = indices;
        Ok(assembly)
    }

    fn read(
        &self,
        indices: &IndexBuffer<'_>,
        first: u32,
        count: u32,
    ) -> Result<Vec<u32>, RasterError> {
        let mut list = Vec::new();
        self.reserve(&mut list, count as usize)?;
        let buffer = indices.buffer;
        let size = u64::from(indices.format.bytes());
        let start = indices.offset + u64::from(first) * size;
        list.extend((0..u64::from(count)).map(|i| {
            let at = start + i * size;
            let word = buffer.word(at).unwrap_or(0);
            match indices.format {
                IndexFormat::Uint32 => word,
                IndexFormat::Uint16 if at.is_multiple_of(4) => word & 0xffff,
                IndexFormat::Uint16 => word >> 16,
            }
        }));
        Ok(list)
    }

    fn strips(
        &self,
        indices: Option<&[u32]>,
        count: u32,
        restart: Option<u32>,
    ) -> Result<Vec<(u32, bool)>, RasterError> {
        let mut strips = Vec::new();
        self.reserve(&mut strips, count.saturating_sub(2) as usize)?;
        // Vertices of the strip so far.
        let mut length = 0_u32;
        for i in 0..count {
            let index = indices.and_then(|indices| indices.get(i as usize));
            if restart.is_some() && index.copied() == restart {
                length = 0;
                continue;
            }
            length += 1;
            if length >= 3 {
                strips.push((i - 2, length.is_multiple_of(2)));
            }
        }
        Ok(strips)
    }

    /// Turns indices into slots; returns the index of each slot.
    fn number(&self, indices: &mut [u32]) -> Result<Vec<u32>, RasterError> {
        let low = indices.iter().copied().min().unwrap_or(0);
        let high = indices.iter().copied().max().unwrap_or(0);
        let mut distinct = Vec::new();
        self.reserve(&mut distinct, indices.len())?;
        let range = (high - low) as usize;
        if range / 8 <= indices.len() {
            let mut table = Vec::new();
            self.reserve(&mut table, range + 1)?;
            table.resize(range + 1, NONE);
            for index in indices {
                let slot = &mut table[(*index - low) as usize];
                if *slot == NONE {
                    *slot = distinct.len() as u32;
                    distinct.push(*index);
                }
                *index = *slot;
            }
            return Ok(distinct);
        }
        // Few indices far apart.
        distinct.extend_from_slice(indices);
        distinct.sort_unstable();
        distinct.dedup();
        for index in indices {
            // It is there.
            *index = distinct.binary_search(index).unwrap_or(0) as u32;
        }
        Ok(distinct)
    }
}
