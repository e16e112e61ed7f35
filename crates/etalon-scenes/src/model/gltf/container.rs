//! The binary container: glTF 2.0, section 4.
//!
//! The `gltf` crate's own reader subtracts lengths unchecked.

use super::GltfError;

const MAGIC: &[u8] = b"glTF";
const JSON: u32 = 0x4e4f_534a;
const BINARY: u32 = 0x004e_4942;

/// The JSON and, of a binary container that has it, the buffer.
pub(super) fn split(bytes: &[u8]) -> Result<(&[u8], Option<&[u8]>), GltfError> {
    if !bytes.starts_with(MAGIC) {
        return Ok((bytes, None));
    }
    let malformed = |problem: String| GltfError::Malformed(problem);
    let header = |at: usize| {
        let words = bytes.get(at..)?.first_chunk::<8>()?;
        let [a, b] = [0, 4]
            .map(|i| u32::from_le_bytes([words[i], words[i + 1], words[i + 2], words[i + 3]]));
        Some((a, b))
    };
    let (version, length) = header(4).ok_or_else(|| malformed("its header is cut off".into()))?;
    if version != 2 {
        return Err(GltfError::Unsupported(format!(
            "container version {version}; it must be 2"
        )));
    }
    let contents = bytes.get(..length as usize).ok_or_else(|| {
        malformed(format!(
            "its header says {length} bytes, but there are {}",
            bytes.len()
        ))
    })?;
    let (mut json, mut binary) = (None, None);
    let mut at = 12;
    while at < contents.len() {
        let chunk = header(at)
            .and_then(|(length, kind)| {
                let end = (at + 8).checked_add(length as usize)?;
                Some((kind, contents.get(at + 8..end)?, end))
            })
            .ok_or_else(|| malformed(format!("the chunk at byte {at} is cut off")))?;
        let (kind, data, end) = chunk;
        match kind {
            JSON if json.is_none() && at == 12 => json = Some(data),
            BINARY if json.is_some() && binary.is_none() => binary = Some(data),
            JSON | BINARY => {
                return Err(malformed(format!(
                    "the chunk at byte {at} is out of order: JSON comes first, then one of binary data"
                )));
            }
            // Others are to be skipped (section 4.4.1).
            _ => {}
        }
        at = end;
    }
    let json = json.ok_or_else(|| malformed("it has no JSON chunk".into()))?;
    Ok((json, binary))
}
