//! From places in generated WGSL back to the files it was made of.
//!
//! WESL assembles a syntax tree out of the declarations a kernel needs and
//! prints it. The nodes of that tree know where in the original files they
//! stand; parsing the printed text gives a second tree of the same shape whose
//! nodes know where in the generated text they stand. [`SourceMap`] is the two
//! laid side by side, declaration by declaration. Where the shapes of a
//! declaration differ, which the printer should not let happen, only the
//! declaration as a whole is mapped: a location may become coarser, it is
//! never wrong.

use std::fmt;
use std::ops::Range;

use serde::{Deserialize, Serialize};
use wesl::syntax::TranslationUnit;

use super::error::Diagnostic;
use super::library::Text;
use super::syntax::{self, Node};

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

    /// The file with the given name.
    pub(crate) fn named(&self, name: &str) -> Option<&SourceFile> {
        let (_, file) = self.files.iter().find(|(_, file)| file.name == name)?;
        Some(file)
    }

    /// All files in order of addition.
    pub(crate) fn iter(&self) -> impl Iterator<Item = &SourceFile> {
        self.files.iter().map(|(_, file)| file)
    }
}

/// A stretch of generated text and the place it was made from.
#[derive(Clone, Debug)]
struct Mapping {
    generated: Range<usize>,
    /// Global offset of the first byte of the original.
    original: usize,
    /// Index of the innermost mapping around this one.
    parent: Option<usize>,
}

/// Where each part of a kernel's generated WGSL comes from.
#[derive(Clone, Debug)]
pub struct SourceMap {
    files: SourceFiles,
    generated: SourceFile,
    /// In order of start, outer before inner.
    mappings: Vec<Mapping>,
}

impl SourceMap {
    /// Lays `assembled`, whose spans are global offsets in `files`, beside the
    /// text printed from it.
    pub(crate) fn new(files: SourceFiles, assembled: &TranslationUnit, printed: &str) -> Self {
        let mut map = Self {
            files,
            generated: SourceFile::new(GENERATED.to_owned(), Text::Added(printed.into())),
            mappings: Vec::new(),
        };
        let Ok(reparsed) = map.generated.text.parse::<TranslationUnit>() else {
            return map;
        };
        let originals = syntax::declarations(assembled);
        let printed = syntax::declarations(&reparsed);
        if originals.len() != printed.len() {
            return map;
        }
        for (original, printed) in originals.iter().zip(&printed) {
            map.add(&syntax::nodes(original), &syntax::nodes(printed));
        }
        map
    }

    /// Adds the nodes of one declaration, outermost first.
    fn add(&mut self, original: &[Node], printed: &[Node]) {
        let same = original.len() == printed.len()
            && original.iter().zip(printed).all(|(a, b)| a.kind == b.kind);
        let used = if same { printed.len() } else { 1 };
        for (original, printed) in original.iter().zip(printed).take(used) {
            // Nodes made by the compiler stand nowhere.
            if original.span.is_empty() {
                continue;
            }
            let mut parent = self.mappings.len().checked_sub(1);
            while let Some(index) = parent
                && self.mappings[index].generated.end <= printed.span.start
            {
                parent = self.mappings[index].parent;
            }
            self.mappings.push(Mapping {
                generated: printed.span.clone(),
                original: self.behind_conditions(original.span.start),
                parent,
            });
        }
    }

    /// Moves a global offset behind the `@if`, `@elif` and `@else` it stands
    /// at: they are gone from the generated text, and often on another line.
    fn behind_conditions(&self, start: usize) -> usize {
        let Some((file, offset)) = self.files.file(start) else {
            return start;
        };
        let text = file.text.get(offset..).unwrap_or_default();
        start + syntax::conditions_len(text)
    }

    /// The generated WGSL.
    #[must_use]
    pub fn generated(&self) -> &str {
        &self.generated.text
    }

    /// The original place of a span of the generated WGSL.
    #[must_use]
    pub fn locate(&self, span: naga::Span) -> SourceLocation {
        self.locate_offset(span.to_range().map_or(0, |range| range.start))
    }

    /// The original place of a byte of the generated WGSL.
    ///
    /// The innermost expression, statement or declaration around the byte
    /// decides; a byte outside of all of them is located in the generated
    /// text.
    #[must_use]
    pub fn locate_offset(&self, offset: usize) -> SourceLocation {
        let (file, offset) = self.resolve(offset);
        file.locate(offset)
    }

    /// A message about a span of the generated WGSL.
    pub(crate) fn diagnostic(&self, span: naga::Span, message: String) -> Diagnostic {
        let start = span.to_range().map_or(0, |range| range.start);
        let (file, offset) = self.resolve(start);
        file.diagnostic(offset, message)
    }

    fn resolve(&self, offset: usize) -> (&SourceFile, usize) {
        let mut index = self
            .mappings
            .partition_point(|mapping| mapping.generated.start <= offset)
            .checked_sub(1);
        while let Some(at) = index {
            let mapping = &self.mappings[at];
            if offset < mapping.generated.end
                && let Some(found) = self.files.file(mapping.original)
            {
                return found;
            }
            index = mapping.parent;
        }
        (&self.generated, offset)
    }
}
