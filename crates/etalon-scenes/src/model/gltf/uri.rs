//! URIs: data, and files beside the one that is read (glTF 2.0, section 2.8).

use std::fs::File;
use std::io::Read;
use std::path::{Component, Path, PathBuf};

use super::{Budget, GltfError};

/// The data in a data URI (RFC 2397); `None` if it is no data URI.
pub(super) fn data(
    uri: &str,
    place: &str,
    budget: &mut Budget,
) -> Option<Result<Vec<u8>, GltfError>> {
    let rest = uri
        .get(..5)
        .filter(|scheme| scheme.eq_ignore_ascii_case("data:"))
        .map(|_| &uri[5..])?;
    Some(
        budget
            .take(format!("the data of {place}"), rest.len() as u64)
            .and_then(|()| {
                let decoded = match rest.split_once(',') {
                    Some((kind, text)) if kind.ends_with(";base64") => base64(text.as_bytes()),
                    Some((_, text)) => percent(text),
                    None => None,
                };
                decoded.ok_or_else(|| GltfError::Uri {
                    place: place.into(),
                    uri: shortened(uri),
                    need: "data in base64 or percent encoding",
                })
            }),
    )
}

/// RFC 4648, section 4; padding may be missing.
fn base64(text: &[u8]) -> Option<Vec<u8>> {
    let end = text
        .iter()
        .rposition(|&byte| byte != b'=')
        .map_or(0, |i| i + 1);
    let (text, padding) = text.split_at(end);
    if padding.len() > 2 || text.len() % 4 == 1 {
        return None;
    }
    let mut bytes = Vec::with_capacity(text.len() / 4 * 3 + 2);
    for group in text.chunks(4) {
        let mut bits = 0_u32;
        for &byte in group {
            let value = match byte {
                b'A'..=b'Z' => byte - b'A',
                b'a'..=b'z' => byte - b'a' + 26,
                b'0'..=b'9' => byte - b'0' + 52,
                b'+' => 62,
                b'/' => 63,
                _ => return None,
            };
            bits = bits << 6 | u32::from(value);
        }
        bits <<= 6 * (4 - group.len());
        bytes.extend_from_slice(&bits.to_be_bytes()[1..group.len()]);
    }
    Some(bytes)
}

fn percent(text: &str) -> Option<Vec<u8>> {
    let mut bytes = Vec::with_capacity(text.len());
    let mut rest = text.as_bytes().iter();
    while let Some(&byte) = rest.next() {
        if byte == b'%' {
            let mut digit = || char::from(*rest.next()?).to_digit(16);
            let (high, low) = (digit()?, digit()?);
            bytes.push((high * 16 + low) as u8);
        } else {
            bytes.push(byte);
        }
    }
    Some(bytes)
}

/// Reads the file of a relative URI, which may not leave the folder.
pub(super) fn read_beside(
    folder: &Path,
    uri: &str,
    place: &str,
    budget: &mut Budget,
) -> Result<Vec<u8>, GltfError> {
    let refused = || GltfError::Uri {
        place: place.into(),
        uri: shortened(uri),
        need: "a relative path within the folder of the file",
    };
    let path = relative(uri).ok_or_else(refused)?;
    let folder = if folder.as_os_str().is_empty() {
        Path::new(".")
    } else {
        folder
    };
    let path = folder.join(path);
    let failed = |source| GltfError::Io {
        path: path.display().to_string(),
        source,
    };
    // Links may lead elsewhere.
    let real = path.canonicalize().map_err(failed)?;
    if !real.starts_with(folder.canonicalize().map_err(failed)?) {
        return Err(refused());
    }
    read_file(&real, place, budget)
}

/// The path of a URI without scheme, if it stays below where it starts.
fn relative(uri: &str) -> Option<PathBuf> {
    let text = String::from_utf8(percent(uri)?).ok()?;
    // On some systems these are separators, drives or streams.
    if text.is_empty() || text.contains(['\\', ':', '\0']) {
        return None;
    }
    let path = PathBuf::from(text);
    let inside = |part: Component<'_>| matches!(part, Component::Normal(_) | Component::CurDir);
    path.components().all(inside).then_some(path)
}

/// Reads a file, but not one that is no file or too large.
pub(super) fn read_file(
    path: &Path,
    what: &str,
    budget: &mut Budget,
) -> Result<Vec<u8>, GltfError> {
    let failed = |source| GltfError::Io {
        path: path.display().to_string(),
        source,
    };
    // Before opening: that may wait for ever for a pipe's other end.
    let length = std::fs::metadata(path)
        .and_then(|meta| {
            if meta.is_file() {
                Ok(meta.len())
            } else {
                Err(std::io::Error::other("it is not a file"))
            }
        })
        .map_err(failed)?;
    budget.take(what, length)?;
    let file = File::open(path).map_err(failed)?;
    let mut bytes = Vec::new();
    // It may have grown since.
    file.take(length).read_to_end(&mut bytes).map_err(failed)?;
    Ok(bytes)
}

/// The beginning of a URI, for messages.
pub(super) fn shortened(uri: &str) -> String {
    let mut text: String = uri.chars().take(80).collect();
    if text.len() < uri.len() {
        text.push('…');
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn base64_is_decoded() {
        for (text, bytes) in [
            ("", &b""[..]),
            ("Zg==", b"f"),
            ("Zm8=", b"fo"),
            ("Zm8", b"fo"),
            ("Zm9vYmFy", b"foobar"),
            ("+/+/", &[0xfb, 0xff, 0xbf]),
        ] {
            assert_eq!(base64(text.as_bytes()).as_deref(), Some(bytes), "{text}");
        }
        for bad in ["Z", "Zm9v Zm9v", "Zg=f", "Zg===", "Zm9vY", "é"] {
            assert_eq!(base64(bad.as_bytes()), None, "{bad}");
        }
    }

    #[test]
    fn only_paths_inside_are_paths() {
        for (uri, path) in [
            ("a.bin", "a.bin"),
            ("maps/a%20b.png", "maps/a b.png"),
            ("./a..b", "./a..b"),
            ("%C3%A9", "é"),
        ] {
            assert_eq!(relative(uri), Some(PathBuf::from(path)));
        }
        for bad in [
            "",
            "..",
            "../a",
            "a/../../b",
            "a/..",
            "/etc/passwd",
            "%2e%2e/a",
            "%2Fetc",
            "C:\\a",
            "C:a",
            "..\\a",
            "http://a/b",
            "file:///a",
            "a%00b",
            "%",
            "%4",
            "%zz",
            "%FF",
        ] {
            assert_eq!(relative(bad), None, "{bad}");
        }
    }
}
