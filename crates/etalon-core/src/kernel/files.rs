//! The files of a kernel, and places in them.

use std::fmt;
use std::ops::Range;

use serde::{Deserialize, Serialize};

use super::error::Diagnostic;
use super::library::Text;

/// The file name of places that only exist in generated text.
pub const GENERATED: &str = "generated WGSL";

/// A place in a kernel's source, shown as `ssr/march.wesl:41:17`.
#[derive(Clone, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
pub struct SourceLocation {
    /// The kernel's path with extension, or [`GENERATED`].
    pub file: String,
    /// Line, from 1.
    pub line: u32,
    /// Column in characters, from 1.
    pub column: u32,
}

impl fmt::Display for SourceLocation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}:{}:{}", self.file, self.line, self.column)
    }
}

/// A named text whose lines are known.
#[derive(Clone, Debug)]
pub(crate) struct SourceFile {
    name: String,
    text: Text,
    /// Offset of the first byte of each line; never empty.
    lines: Vec<usize>,
}

impl SourceFile {
    pub(crate) fn new(name: String, text: Text) -> Self {
        let lines = std::iter::once(0)
            .chain(text.match_indices('\n').map(|(at, _)| at + 1))
            .collect();
        Self { name, text, lines }
    }

    pub(crate) fn text(&self) -> &str {
        &self.text
    }

    /// The number of the line `offset` is in, from 0, and that line's bytes.
    fn line(&self, offset: usize) -> (usize, Range<usize>) {
        let index = self.lines.partition_point(|&start| start <= offset) - 1;
        let start = self.lines[index];
        let end = self
            .lines
            .get(index + 1)
            .map_or(self.text.len(), |next| next - 1);
        (index, start..end)
    }

    /// The place of a byte; behind the end counts as the end.
    pub(crate) fn locate(&self, offset: usize) -> SourceLocation {
        let offset = offset.min(self.text.len());
        let (index, line) = self.line(offset);
        let before = self.text.as_bytes().get(line.start..offset);
        // Counting the bytes that begin a character works inside of one, too.
        let column = before.map_or(0, |bytes| {
            bytes.iter().filter(|&&byte| byte & 0xc0 != 0x80).count()
        });
        let number = |n: usize| u32::try_from(n + 1).unwrap_or(u32::MAX);
        SourceLocation {
            file: self.name.clone(),
            line: number(index),
            column: number(column),
        }
    }

    /// A message about a byte of this file.
    pub(crate) fn diagnostic(&self, offset: usize, message: String) -> Diagnostic {
        let offset = offset.min(self.text.len());
        let (_, line) = self.line(offset);
        Diagnostic {
            location: self.locate(offset),
            message,
            line: self
                .text
                .get(line)
                .unwrap_or_default()
                .trim_end()
                .to_owned(),
        }
    }
}

/// The files of one kernel, laid end to end: a byte of any of them has one
/// number, its global offset.
///
/// Giving the parser each file at its global offset makes every span of the
/// assembled tree say which file it is from.
#[derive(Clone, Debug, Default)]
pub(crate) struct SourceFiles {
    /// Each file with the global offset of its first byte, ascending.
    files: Vec<(usize, SourceFile)>,
}

impl SourceFiles {
    /// Adds a file and returns the global offset of its first byte.
    pub(crate) fn add(&mut self, file: SourceFile) -> usize {
        // One byte apart, so that the end of a file is not the start of the
        // next.
        let start = self
            .files
            .last()
            .map_or(0, |(start, last)| start + last.text.len() + 1);
        self.files.push((start, file));
        start
    }

    /// The file a global offset is in, and the offset in the file.
    pub(crate) fn file(&self, offset: usize) -> Option<(&SourceFile, usize)> {
        let index = self
            .files
            .partition_point(|(start, _)| *start <= offset)
            .checked_sub(1)?;
        let (start, file) = self.files.get(index)?;
        (offset - start <= file.text.len()).then_some((file, offset - start))
    }

    /// The text of a range of global offsets, which is within one file.
    pub(crate) fn text(&self, range: Range<usize>) -> Option<&str> {
        let (file, start) = self.file(range.start)?;
        file.text.get(start..start + range.len())
    }

    /// The file with the given name.
    pub(crate) fn named(&self, name: &str) -> Option<&SourceFile> {
        let (_, file) = self.files.iter().find(|(_, file)| file.name == name)?;
        Some(file)
    }

    /// All files with the global offsets of their first bytes, in order.
    pub(crate) fn iter(&self) -> impl Iterator<Item = (usize, &SourceFile)> {
        self.files.iter().map(|(start, file)| (*start, file))
    }
}
