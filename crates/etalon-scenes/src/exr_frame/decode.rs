//! From the bytes of a file to planes of `f32`, trusting nothing.

use std::collections::HashSet;
use std::io::Cursor;
use std::panic::{AssertUnwindSafe, catch_unwind};

use exr::block::UncompressedBlock;
use exr::block::chunk::{Chunk, CompressedBlock};
use exr::block::lines::LineRef;
use exr::block::reader::{ChunksReader, Reader};
use exr::compression::Compression;
use exr::meta::BlockDescription;
use exr::meta::MetaData;
use exr::meta::attribute::SampleType;
use exr::meta::header::Header;

use super::ExrError;
use crate::frame::FrameSize;

/// A rectangle of pixels; the corner may be anywhere.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Window {
    pub(super) x: i64,
    pub(super) y: i64,
    pub(super) width: u64,
    pub(super) height: u64,
}

/// One part of a file.
#[derive(Clone, Debug)]
pub(super) struct Part {
    /// Empty if it has none.
    pub(super) name: String,
    pub(super) view: Option<String>,
    /// Views kept apart by channel names, the default one first.
    pub(super) views: Vec<String>,
    /// In the order of the file.
    pub(super) channels: Vec<String>,
}

/// What the headers of a file say, checked.
#[derive(Clone, Debug)]
pub(super) struct File {
    pub(super) size: FrameSize,
    pub(super) parts: Vec<Part>,
    pub(super) screen_window_width: f64,
    pub(super) pixel_aspect: f64,
    display: Window,
}

/// A channel by the indices of its part and its place there.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Place {
    pub(super) part: usize,
    pub(super) channel: usize,
}

/// Reads and checks the headers; allocates no more than they are long.
pub(super) fn read_header(bytes: &[u8], max_bytes: u64) -> Result<File, ExrError> {
    let meta = guarded(|| MetaData::read_from_buffered(Cursor::new(bytes), false))?;
    let first = meta
        .headers
        .first()
        .ok_or_else(|| ExrError::Malformed("it has no parts".into()))?;
    let display = window(first.shared_attributes.display_window);
    let side = |length: u64| u32::try_from(length).unwrap_or(u32::MAX);
    let size = FrameSize::new(side(display.width), side(display.height))?;
    let mut chunks = 0_u64;
    for (index, header) in meta.headers.iter().enumerate() {
        check_part(index, header, max_bytes)?;
        if window(header.shared_attributes.display_window) != display {
            return Err(ExrError::Malformed(format!(
                "part {index} has another display window than part 0"
            )));
        }
        chunks = chunks.saturating_add(header.chunk_count as u64);
    }
    // Each chunk has an offset of 8 bytes and a header of at least 8 more, so
    // this bounds all tables by the length of the file.
    if chunks.saturating_mul(16) > bytes.len() as u64 {
        return Err(ExrError::Malformed(format!(
            "its headers promise {chunks} chunks, which do not fit into {} bytes",
            bytes.len()
        )));
    }
    let text = |text: &exr::meta::attribute::Text| text.to_string();
    Ok(File {
        size,
        parts: (meta.headers.iter())
            .map(|header| Part {
                name: header
                    .own_attributes
                    .layer_name
                    .as_ref()
                    .map(text)
                    .unwrap_or_default(),
                view: header.own_attributes.view_name.as_ref().map(text),
                views: (header.own_attributes.multi_view_names.iter().flatten())
                    .map(text)
                    .collect(),
                channels: header
                    .channels
                    .list
                    .iter()
                    .map(|channel| text(&channel.name))
                    .collect(),
            })
            .collect(),
        screen_window_width: first.own_attributes.screen_window_width.into(),
        pixel_aspect: first.shared_attributes.pixel_aspect.into(),
        display,
    })
}

fn window(bounds: exr::meta::attribute::IntegerBounds) -> Window {
    Window {
        x: bounds.position.x().into(),
        y: bounds.position.y().into(),
        width: bounds.size.width() as u64,
        height: bounds.size.height() as u64,
    }
}

/// Checks what the decoder multiplies and allocates.
fn check_part(index: usize, header: &Header, max_bytes: u64) -> Result<(), ExrError> {
    if header.deep {
        return Err(ExrError::Unsupported(format!("part {index} is deep")));
    }
    if header.channels.list.is_empty() {
        return Err(ExrError::Malformed(format!("part {index} has no channels")));
    }
    let bytes = |width: usize, height: usize| {
        (width as u64)
            .checked_mul(height as u64)
            .and_then(|pixels| pixels.checked_mul(header.channels.bytes_per_pixel as u64))
            .unwrap_or(u64::MAX)
    };
    let (width, height) = (header.layer_size.width(), header.layer_size.height());
    if width == 0 || height == 0 {
        return Err(ExrError::Malformed(format!(
            "the data window of part {index} is empty"
        )));
    }
    let block = match header.blocks {
        BlockDescription::ScanLines => bytes(width, header.compression.scan_lines_per_block()),
        BlockDescription::Tiles(tiles) => bytes(tiles.tile_size.width(), tiles.tile_size.height()),
    };
    for (what, bytes) in [("pixels", bytes(width, height)), ("blocks", block)] {
        if bytes > max_bytes {
            let what = format!("the {what} of part {index}");
            return Err(ExrError::TooLarge {
                what,
                bytes,
                limit: max_bytes,
            });
        }
    }
    Ok(())
}

/// Decodes channels into planes of the frame's size, row by row from the top.
pub(super) fn read_planes(
    bytes: &[u8],
    file: &File,
    places: &[Place],
    max_bytes: u64,
) -> Result<Vec<Vec<f32>>, ExrError> {
    let total = (file.size.pixels() as u64).saturating_mul(4 * places.len() as u64);
    let too_large = || ExrError::TooLarge {
        what: "the frame".into(),
        bytes: total,
        limit: max_bytes,
    };
    if total > max_bytes {
        return Err(too_large());
    }
    let mut planes = Vec::new();
    for _ in places {
        let mut plane = Vec::new();
        plane
            .try_reserve_exact(file.size.pixels())
            .map_err(|_| too_large())?;
        plane.resize(file.size.pixels(), 0.0_f32);
        planes.push(plane);
    }
    let reader = guarded(|| Reader::read_from_buffered(Cursor::new(bytes), false))?;
    for (index, header) in reader.headers().iter().enumerate() {
        let wanted = places.iter().any(|place| place.part == index);
        if wanted
            && header
                .channels
                .list
                .iter()
                .any(|channel| channel.sampling != exr::math::Vec2(1, 1))
        {
            return Err(ExrError::Unsupported(format!(
                "part {index} has subsampled channels"
            )));
        }
    }
    // Chunks are read one after the other to the end, so a file that was cut
    // off is noticed wherever the channels asked for may be, and offset tables,
    // which interrupted writers leave empty, do not matter.
    let mut chunks = guarded(|| reader.all_chunks(false))?;
    let meta = chunks.meta_data().clone();
    let mut seen = HashSet::new();
    while let Some(chunk) = guarded(|| chunks.read_next_chunk().transpose())? {
        if !places.iter().any(|place| place.part == chunk.layer_index) {
            continue;
        }
        if let Some(block) = decompress(chunk, &meta)? {
            let (x, y) = (
                block.index.pixel_position.x(),
                block.index.pixel_position.y(),
            );
            if !seen.insert((block.index.layer, x, y)) {
                return Err(ExrError::Malformed(format!(
                    "part {} has two blocks at {x}, {y}",
                    block.index.layer
                )));
            }
            place_block(&block, &meta, file, places, &mut planes)?;
        }
    }
    for (index, header) in meta.headers.iter().enumerate() {
        let blocks = seen.iter().filter(|(part, ..)| *part == index).count();
        let expected = match header.blocks {
            BlockDescription::ScanLines => header.chunk_count,
            BlockDescription::Tiles(tiles) => {
                header
                    .layer_size
                    .width()
                    .div_ceil(tiles.tile_size.width().max(1))
                    * header
                        .layer_size
                        .height()
                        .div_ceil(tiles.tile_size.height().max(1))
            }
        };
        if places.iter().any(|place| place.part == index) && blocks != expected {
            return Err(ExrError::Malformed(format!(
                "part {index} has {blocks} of its {expected} blocks"
            )));
        }
    }
    Ok(planes)
}

/// The pixels of a chunk; `None` if it is of a smaller mip level.
fn decompress(chunk: Chunk, meta: &MetaData) -> Result<Option<UncompressedBlock>, ExrError> {
    let part = chunk.layer_index;
    let Some(header) = meta.headers.get(part) else {
        return Err(ExrError::Malformed(format!(
            "a chunk of part {part}, which does not exist"
        )));
    };
    let data = match &chunk.compressed_block {
        CompressedBlock::ScanLine(block) => &block.compressed_pixels_le,
        CompressedBlock::Tile(block) => {
            if !block.coordinates.is_largest_resolution_level() {
                return Ok(None);
            }
            &block.compressed_pixels_le
        }
        _ => return Err(ExrError::Unsupported(format!("part {part} is deep"))),
    };
    if matches!(
        header.compression,
        Compression::DWAA(_) | Compression::DWAB(_)
    ) {
        let area = guarded(|| {
            let coordinates = header.get_block_data_indices(&chunk.compressed_block)?;
            Ok(header
                .get_absolute_block_pixel_coordinates(coordinates)?
                .size
                .area())
        })?;
        check_dwa(data, area.saturating_mul(header.channels.bytes_per_pixel))?;
    }
    let block = guarded(|| UncompressedBlock::decompress_chunk(chunk, meta, false))?;
    let expected = block
        .index
        .pixel_size
        .area()
        .saturating_mul(header.channels.bytes_per_pixel);
    if block.data.len() != expected {
        return Err(ExrError::Malformed(format!(
            "a block of part {part} has {} bytes instead of {expected}",
            block.data.len()
        )));
    }
    Ok(Some(block))
}

/// A chunk of the DWA compressions begins with eleven counts that the decoder
/// allocates by: none can be much over the uncompressed size. (Coefficients are
/// in whole blocks of 8 × 8, run lengths at worst double the size.)
fn check_dwa(data: &[u8], block: usize) -> Result<(), ExrError> {
    // Stored raw, a block is as long as its pixels are and has no such counts.
    if data.len() == block {
        return Ok(());
    }
    let limit = (block as u64).saturating_mul(4).saturating_add(1 << 16);
    let counts = data.as_chunks::<8>().0.iter().take(10).skip(1);
    match counts.map(|bytes| u64::from_le_bytes(*bytes)).max() {
        Some(count) if count > limit => Err(ExrError::Malformed(format!(
            "a block of {block} bytes claims to hold {count}"
        ))),
        _ => Ok(()),
    }
}

/// Copies the lines of a block to where they are in the frame.
fn place_block(
    block: &UncompressedBlock,
    meta: &MetaData,
    file: &File,
    places: &[Place],
    planes: &mut [Vec<f32>],
) -> Result<(), ExrError> {
    let part = block.index.layer;
    let Some(header) = meta.headers.get(part) else {
        return Ok(());
    };
    let data = window(header.data_window());
    for line in block.lines(&header.channels) {
        let place = Place {
            part,
            channel: line.location.channel,
        };
        let Some(channel) = header.channels.list.get(place.channel) else {
            continue;
        };
        let y = data.y + line.location.position.y() as i64 - file.display.y;
        if !(0..i64::from(file.size.height())).contains(&y) {
            continue;
        }
        let start = data.x + line.location.position.x() as i64 - file.display.x;
        for (_, plane) in places
            .iter()
            .zip(&mut *planes)
            .filter(|(wanted, _)| **wanted == place)
        {
            let width = file.size.width() as usize;
            let row = plane
                .get_mut(y as usize * width..)
                .and_then(|rest| rest.get_mut(..width));
            if let Some(row) = row {
                place_line(&line, channel.sample_type, start, row);
            }
        }
    }
    Ok(())
}

/// Copies a line whose first sample is at `start` into a row, cropping it.
fn place_line(line: &LineRef<'_>, kind: SampleType, start: i64, row: &mut [f32]) {
    // The decoder hands samples out in the machine's byte order.
    let mut samples: Box<dyn Iterator<Item = f32>> = match kind {
        SampleType::F16 => Box::new(
            line.value
                .as_chunks()
                .0
                .iter()
                .map(|b| half::f16::from_ne_bytes(*b).to_f32()),
        ),
        SampleType::F32 => Box::new(
            line.value
                .as_chunks()
                .0
                .iter()
                .map(|b| f32::from_ne_bytes(*b)),
        ),
        SampleType::U32 => Box::new(
            line.value
                .as_chunks()
                .0
                .iter()
                .map(|b| u32::from_ne_bytes(*b) as f32),
        ),
    };
    let before = usize::try_from(-start).unwrap_or(0);
    let first = usize::try_from(start).unwrap_or(0);
    if before > 0 {
        samples.nth(before - 1);
    }
    for (texel, sample) in row.iter_mut().skip(first).zip(samples) {
        *texel = sample;
    }
}

/// Runs the decoder and turns its errors, and its panics, into ours.
///
/// The decoder is written to return errors, but wrong files find the places
/// where arithmetic overflows or an index is out of range all the same. It has
/// no state outside of what is dropped with the closure.
fn guarded<T>(decode: impl FnOnce() -> exr::error::Result<T>) -> Result<T, ExrError> {
    match catch_unwind(AssertUnwindSafe(decode)) {
        Ok(Ok(value)) => Ok(value),
        Ok(Err(exr::error::Error::NotSupported(what))) => {
            Err(ExrError::Unsupported(what.into_owned()))
        }
        Ok(Err(exr::error::Error::Invalid(what))) => Err(ExrError::Malformed(what.into_owned())),
        Ok(Err(error)) => Err(ExrError::Malformed(error.to_string())),
        Err(_) => Err(ExrError::Malformed("the decoder gave up on it".into())),
    }
}
