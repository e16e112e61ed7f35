//! From places in generated WGSL back to the files it was made of.
//!
//! WESL assembles a syntax tree out of the declarations a kernel needs and
//! prints it. The nodes of that tree know where in the original files they
//! stand; parsing the printed text gives a second tree of the same shape whose
//! nodes know where in the generated text they stand. [`SourceMap`] is the two
//! laid side by side, declaration by declaration. Tokens behind the start of a
//! node, such as the operator of a sum or the type of a variable, are matched
//! one by one for as long as they are the same in both texts.
//!
//! Where the shapes of a declaration differ, which the printer should not let
//! happen, only the declaration as a whole is mapped: a location may become
//! coarser, it is never wrong.
//!
//! The same correspondence puts numbers back as they were written: WESL 0.4
//! takes `0x1p1` to be 16, and every bit of a constant counts.

use std::ops::Range;

use wesl::syntax::TranslationUnit;

use super::assemble::Names;
use super::error::Diagnostic;
use super::files::{GENERATED, SourceFile, SourceFiles, SourceLocation};
use super::library::Text;
use super::scan::{self, Token, TokenKind};
use super::syntax::{self, Node};

/// A node of the generated text and the place it was made from.
#[derive(Clone, Debug)]
struct Mapping {
    generated: Range<usize>,
    /// Global offset of the first byte of the original.
    original: usize,
    /// Index of the innermost mapping around this one.
    parent: Option<usize>,
}

/// A token that stands in both texts.
#[derive(Clone, Debug)]
struct Match {
    generated: Range<usize>,
    /// Global offset of the first byte of the original.
    original: usize,
}

/// The nodes of one declaration in both texts, outermost first.
struct Pair {
    original: Vec<Node>,
    printed: Vec<Node>,
}

impl Pair {
    fn same_shape(&self) -> bool {
        self.original.len() == self.printed.len()
            && self
                .original
                .iter()
                .zip(&self.printed)
                .all(|(original, printed)| original.kind == printed.kind)
    }
}

/// Whether a token names an imported declaration, which the file may call by
/// another name or by a path.
fn imported(token: &Token<'_>, names: &Names) -> bool {
    names.original(token.text) != token.text
}

/// How many tokens the rest `::a::b` of a path takes.
fn path_len(tokens: &[Token<'_>]) -> usize {
    let step = |step: &&[Token<'_>]| matches!(step, [a, b, c] if a.text == ":" && b.text == ":" && c.kind == TokenKind::Word);
    3 * tokens.chunks(3).take_while(step).count()
}

/// Spells the numbers of the printed text as they were written, and moves the
/// spans of the printed nodes accordingly.
fn restore_numbers(files: &SourceFiles, pairs: &mut [Pair], printed: &str) -> String {
    // What is replaced, in order, and how far what is behind it moves: offsets
    // wrap around where it moves forward.
    let mut moves: Vec<(usize, usize)> = Vec::new();
    let mut restored = String::with_capacity(printed.len());
    let mut copied = 0;
    for pair in pairs.iter() {
        for (original, node) in pair.original.iter().zip(&pair.printed) {
            let written = files.text(original.span.clone());
            let (true, Some(written), Some(before)) = (
                node.is_literal(),
                written,
                printed.get(copied..node.span.start),
            ) else {
                continue;
            };
            restored.push_str(before);
            restored.push_str(written);
            copied = node.span.end;
            moves.push((copied, restored.len().wrapping_sub(copied)));
        }
    }
    restored.push_str(printed.get(copied..).unwrap_or_default());
    let moved = |offset: usize| {
        let behind = moves.partition_point(|(end, _)| *end <= offset);
        let by = behind.checked_sub(1).map_or(0, |index| moves[index].1);
        offset.wrapping_add(by)
    };
    for node in pairs.iter_mut().flat_map(|pair| &mut pair.printed) {
        node.span = moved(node.span.start)..moved(node.span.end);
    }
    restored
}

/// A declaration was not printed as it was read, at the given place.
#[derive(Debug)]
pub(crate) struct Misprint(pub(crate) Option<SourceLocation>);

/// Where each part of a kernel's generated WGSL comes from.
#[derive(Clone, Debug)]
pub struct SourceMap {
    files: SourceFiles,
    generated: SourceFile,
    /// In order of start, outer before inner.
    mappings: Vec<Mapping>,
    /// In order of start; they do not overlap.
    matches: Vec<Match>,
}

impl SourceMap {
    /// Lays `assembled`, whose spans are global offsets in `files`, beside the
    /// text printed from it. `names` has the names that assembling changed.
    ///
    /// In the generated text, numbers are spelled as in the files: reading and
    /// printing them is not left to WESL, see [`scan::hide_hex_floats`].
    ///
    /// # Errors
    /// If a declaration has numbers that have to be put back, but is not of
    /// the same shape in both texts.
    pub(crate) fn new(
        files: SourceFiles,
        assembled: &TranslationUnit,
        printed: &str,
        names: &Names,
    ) -> Result<Self, Misprint> {
        let originals = syntax::declarations(assembled);
        let reparsed = printed.parse::<TranslationUnit>().unwrap_or_default();
        let reparsed = syntax::declarations(&reparsed);
        let aligned = originals.len() == reparsed.len();
        let mut pairs = Vec::with_capacity(originals.len());
        for (index, original) in originals.iter().enumerate() {
            let mut pair = Pair {
                original: syntax::nodes(original),
                printed: match reparsed.get(index) {
                    Some(printed) if aligned => syntax::nodes(printed),
                    _ => Vec::new(),
                },
            };
            if !pair.same_shape() {
                let text = files.text(original.span().range());
                if text.is_some_and(scan::has_hex_float) {
                    let place = files.file(original.span().start);
                    return Err(Misprint(place.map(|(file, at)| file.locate(at))));
                }
                pair.original.truncate(1);
                pair.printed.truncate(1);
            }
            pairs.push(pair);
        }
        let generated = restore_numbers(&files, &mut pairs, printed);
        let mut map = Self {
            files,
            generated: SourceFile::new(GENERATED.to_owned(), Text::Added(generated.into())),
            mappings: Vec::new(),
            matches: Vec::new(),
        };
        let first = pairs.iter().find_map(|pair| pair.printed.first());
        map.match_directives(first.map_or(0, |node| node.span.start));
        for pair in &pairs {
            map.add(pair, names);
        }
        Ok(map)
    }

    /// Matches the tokens of `enable`, `requires` and `diagnostic` directives,
    /// which stand before byte `end`. They are no nodes, but printed as they
    /// are written.
    fn match_directives(&mut self, end: usize) {
        let head = self.generated.text().get(..end).unwrap_or_default();
        let tokens: Vec<Token<'_>> = scan::tokens(head).collect();
        let mut matches = Vec::new();
        for directive in tokens.split_inclusive(|token| token.text == ";") {
            let found = self.files.iter().find_map(|(start, file)| {
                let written: Vec<Token<'_>> = scan::tokens(file.text()).collect();
                let same = |window: &&[Token<'_>]| {
                    let pairs = window.iter().zip(directive);
                    pairs.into_iter().all(|(a, b)| a.text == b.text)
                };
                let offsets = |window: &[Token<'_>]| -> Vec<usize> {
                    window.iter().map(|token| start + token.offset).collect()
                };
                written.windows(directive.len()).find(same).map(offsets)
            });
            for (token, original) in directive.iter().zip(found.unwrap_or_default()) {
                matches.push(Match {
                    generated: token.offset..token.offset + token.text.len(),
                    original,
                });
            }
        }
        self.matches.extend(matches);
    }

    /// Adds the nodes of one declaration, outermost first.
    fn add(&mut self, pair: &Pair, names: &Names) {
        let first = self.mappings.len();
        for (original, printed) in pair.original.iter().zip(&pair.printed) {
            // Nodes made by the compiler stand nowhere.
            if original.span.is_empty() || printed.span.is_empty() {
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
        if let (Some(original), Some(printed)) = (pair.original.first(), pair.printed.first()) {
            self.match_tokens(&original.span, &printed.span, first, names);
        }
    }

    /// Matches the tokens of one declaration, whose nodes are the mappings
    /// from index `first` on.
    ///
    /// Nodes are in the same order in both texts, so each tells where the
    /// original goes on. From there tokens are matched until one differs: what
    /// the original has and the generated text has not is comments, which are
    /// no tokens, and conditional parts. Those begin with an `@`, and every
    /// `@` of the generated text begins a node, so neither can be mistaken for
    /// the other.
    fn match_tokens(
        &mut self,
        original: &Range<usize>,
        printed: &Range<usize>,
        first: usize,
        names: &Names,
    ) {
        let Some(text) = self.files.text(original.clone()) else {
            return;
        };
        let originals: Vec<Token<'_>> = scan::tokens(text).collect();
        let Some(generated) = self.generated.text().get(printed.clone()) else {
            return;
        };
        let mut nodes = self.mappings[first..].iter().peekable();
        // Where the original goes on, as long as that is known.
        let mut next: Option<usize> = None;
        let mut matches = Vec::new();
        for token in scan::tokens(generated) {
            let at = printed.start + token.offset;
            while let Some(node) = nodes.next_if(|node| node.generated.start <= at) {
                if node.generated.start == at {
                    let offset = node.original.checked_sub(original.start);
                    next = offset.and_then(|offset| {
                        originals
                            .binary_search_by_key(&offset, |token| token.offset)
                            .ok()
                    });
                }
            }
            // The comma behind the last of a list is not printed.
            if let Some(index) = next
                && let Some([comma, closing]) = originals.get(index..index + 2)
                && comma.text == ","
                && closing.text == token.text
            {
                next = Some(index + 1);
            }
            let found = next.and_then(|index| originals.get(index)).filter(|other| {
                let before_next_node = nodes
                    .peek()
                    .is_none_or(|node| original.start + other.offset < node.original);
                before_next_node
                    && (token.text == other.text
                        || imported(&token, names) && other.kind == TokenKind::Word)
            });
            next = match (next, found) {
                (Some(index), Some(other)) => {
                    matches.push(Match {
                        generated: at..at + token.text.len(),
                        original: original.start + other.offset,
                    });
                    let behind = originals.get(index + 1..).unwrap_or_default();
                    let path = if imported(&token, names) {
                        path_len(behind)
                    } else {
                        0
                    };
                    Some(index + 1 + path)
                }
                _ => None,
            };
        }
        self.matches.extend(matches);
    }

    /// Moves a global offset behind the `@if`, `@elif` and `@else` it stands
    /// at: they are gone from the generated text, and often on another line.
    fn behind_conditions(&self, start: usize) -> usize {
        let Some((file, offset)) = self.files.file(start) else {
            return start;
        };
        let text = file.text().get(offset..).unwrap_or_default();
        start + syntax::conditions_len(text)
    }

    /// The generated WGSL.
    #[must_use]
    pub fn generated(&self) -> &str {
        self.generated.text()
    }

    /// The original place of a span of the generated WGSL.
    #[must_use]
    pub fn locate(&self, span: naga::Span) -> SourceLocation {
        self.locate_offset(span.to_range().map_or(0, |range| range.start))
    }

    /// The original place of a byte of the generated WGSL.
    ///
    /// That of the token it is in; if that is not known, that of the innermost
    /// expression, statement or declaration around it; and outside of all of
    /// them, its place in the generated text.
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
        let matched = self
            .matches
            .partition_point(|it| it.generated.start <= offset)
            .checked_sub(1)
            .map(|index| &self.matches[index])
            .filter(|it| offset < it.generated.end);
        if let Some(found) = matched.and_then(|it| self.files.file(it.original)) {
            return found;
        }
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
