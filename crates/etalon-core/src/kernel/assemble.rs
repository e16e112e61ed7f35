//! WESL: from a kernel's file and what it imports to one WGSL syntax tree.

use std::borrow::Cow;
use std::cell::{Cell, RefCell};
use std::collections::{BTreeMap, BTreeSet};

use wesl::syntax::{ModulePath, PathOrigin, Span, TranslationUnit};
use wesl::{
    CompileOptions, EscapeMangler, Feature, Features, ImportError, Mangler, ResolveError, Resolver,
};

use super::check;
use super::compile::Variant;
use super::error::KernelError;
use super::files::{SourceFile, SourceFiles};
use super::library::{Sources, Text};
use super::scan;
use super::similar::similar;
use super::{Arithmetic, library};

/// The name of the feature that [`Arithmetic`] sets.
pub(super) const STRICT: &str = "strict";

/// Most bytes of one file. Compilers count in 32 bits and recurse; real
/// kernels are a hundred times smaller.
const MAX_FILE_BYTES: usize = 1 << 20;

/// What assembling a kernel gives.
pub(super) struct Assembly {
    /// The declarations the kernel needs; spans are global offsets in `files`.
    pub(super) tree: TranslationUnit,
    /// The files read, the kernel's own first.
    pub(super) files: SourceFiles,
    /// The original names of what had to be renamed.
    pub(super) names: Names,
}

/// Prints a tree as WGSL.
///
/// WESL 0.4 prints the negation of a negation, `- -x`, as `--x`, which is the
/// token of a decrement. A decrement ends its statement, while a negation is
/// followed by what it negates.
pub(super) fn print(tree: &TranslationUnit) -> String {
    let printed = tree.to_string();
    let mut separated = String::with_capacity(printed.len());
    let mut rest = printed.as_str();
    while let Some(start) = rest.find("--") {
        let (before, from) = rest.split_at(start);
        let count = from.bytes().take_while(|byte| *byte == b'-').count();
        let (minuses, after) = from.split_at(count);
        separated.push_str(before);
        if after.starts_with([';', ')', ' ', '\n']) || after.is_empty() {
            separated.push_str(minuses);
        } else {
            separated.push_str(&vec!["-"; count].join(" "));
        }
        rest = after;
    }
    separated.push_str(rest);
    separated
}

/// The original names of renamed declarations.
///
/// Imported declarations get their module's path into their name, so that
/// those of two files do not clash.
#[derive(Clone, Debug, Default)]
pub(crate) struct Names {
    original: BTreeMap<String, String>,
}

impl Names {
    /// The name as written in the file.
    pub(crate) fn original<'a>(&'a self, name: &'a str) -> &'a str {
        self.original.get(name).map_or(name, String::as_str)
    }

    /// The text with every renamed word as it was written.
    pub(crate) fn restore(&self, text: &str) -> String {
        let mut restored = String::with_capacity(text.len());
        let mut rest = text;
        while let Some(start) = rest.find(|c: char| c.is_alphanumeric() || c == '_') {
            let (before, from) = rest.split_at(start);
            let end = from.find(|c: char| !(c.is_alphanumeric() || c == '_'));
            let (word, after) = from.split_at(end.unwrap_or(from.len()));
            restored.push_str(before);
            restored.push_str(self.original(word));
            rest = after;
        }
        restored.push_str(rest);
        restored
    }
}

/// Assembles a variant of a kernel. `parsed` is counted up for every file
/// parsed, also if an error ends it.
///
/// # Errors
/// If a file is not WESL, an import leads nowhere, a condition is malformed,
/// or the request sets a feature there is not.
pub(super) fn assemble(
    sources: &Sources,
    variant: &Variant,
    parsed: &mut u64,
) -> Result<Assembly, KernelError> {
    let root = ModulePath::new(
        PathOrigin::Absolute,
        variant.path.split('/').map(str::to_owned).collect(),
    );
    if sources.get(&variant.path).is_none() {
        return Err(KernelError::UnknownKernel {
            path: variant.path.clone(),
            similar: similar(&variant.path, &sources.paths()),
        });
    }
    if variant.features.contains_key(STRICT) {
        return Err(KernelError::ReservedFeature {
            kernel: variant.path.clone(),
        });
    }
    let flags = variant
        .features
        .iter()
        .map(|(name, on)| (name.clone(), Feature::from(*on)))
        .chain([(
            STRICT.to_owned(),
            Feature::from(variant.arithmetic == Arithmetic::Strict),
        )])
        .collect();
    let options = CompileOptions {
        imports: true,
        condcomp: true,
        strip: true,
        lazy: true,
        lower: false,
        // naga finds the same errors and more, and knows their places.
        validate: false,
        features: Features {
            default: Feature::Disable,
            flags,
        },
        ..CompileOptions::default()
    };

    let modules = Modules::new(sources);
    let result = wesl::compile(&root, &modules, &modules, &options);
    *parsed += modules.parsed.get();
    let files = modules.files.into_inner();
    let names = Names {
        original: modules.renamed.into_inner(),
    };
    let tree = match result {
        Ok(result) => result.syntax,
        Err(error) => return Err(Failure::from(error).explain(&files, &names, &variant.path)),
    };
    check_features(sources, variant, &files)?;
    Ok(Assembly { tree, files, names })
}

/// Checks that something asks for each feature the request sets.
fn check_features(
    sources: &Sources,
    variant: &Variant,
    files: &SourceFiles,
) -> Result<(), KernelError> {
    let mut known: BTreeSet<String> = BTreeSet::new();
    for (_, file) in files.iter() {
        known.extend(scan::features(file.text()).into_iter().map(str::to_owned));
    }
    let missing = |known: &BTreeSet<String>| {
        let mut names = variant.features.keys();
        names.find(|name| !known.contains(*name)).cloned()
    };
    if missing(&known).is_none() {
        return Ok(());
    }
    // It may be in a file that this variant does not get to import.
    for text in reachable(sources, &variant.path) {
        known.extend(scan::features(&text).into_iter().map(str::to_owned));
    }
    match missing(&known) {
        None => Ok(()),
        Some(name) => {
            known.remove(STRICT);
            Err(KernelError::UnknownFeature {
                kernel: variant.path.clone(),
                name,
                known: known.into_iter().collect(),
            })
        }
    }
}

/// Every file a kernel could import under any condition, itself included.
pub(super) fn reachable(sources: &Sources, path: &str) -> Vec<Text> {
    let mut seen = BTreeSet::from([path.to_owned()]);
    let mut open = vec![path.to_owned()];
    let mut texts = Vec::new();
    while let Some(path) = open.pop() {
        let Some(text) = sources.get(&path) else {
            continue;
        };
        for path in sources.paths() {
            // `package::lib::colour::x`, and also `{lib::{colour::x}}`: looking
            // for the last component finds too much rather than too little.
            let last = path.rsplit('/').next().unwrap_or(path);
            if !seen.contains(path) && scan::find_word(&text, last).is_some() {
                seen.insert(path.to_owned());
                open.push(path.to_owned());
            }
        }
        texts.push(text);
    }
    texts
}

/// What is wrong, in the words of WESL, and where as far as it knows.
struct Failure {
    kind: FailureKind,
    message: String,
    span: Option<Span>,
    module: Option<ModulePath>,
    /// A word that the place has, if the span is unknown.
    word: Option<String>,
}

enum FailureKind {
    Syntax,
    Import,
    Condition,
    Other,
}

impl From<wesl::Error> for Failure {
    fn from(error: wesl::Error) -> Self {
        let mut error = error;
        let mut span = None;
        let mut module = None;
        // Inner diagnostics are closer to the place.
        loop {
            let diagnostic = match error {
                wesl::Error::Error(diagnostic)
                | wesl::Error::ResolveError(ResolveError::Error(diagnostic))
                | wesl::Error::ImportError(ImportError::ResolveError(ResolveError::Error(
                    diagnostic,
                ))) => diagnostic,
                other => {
                    error = other;
                    break;
                }
            };
            span = diagnostic.detail.span.or(span);
            module = diagnostic.detail.module_path.or(module);
            error = *diagnostic.error;
        }
        let mut failure = Self {
            kind: FailureKind::Other,
            message: shorten(error.to_string()),
            span,
            module,
            word: None,
        };
        match error {
            wesl::Error::ParseError(parse) => {
                failure.message = shorten(parse.error.to_string());
                failure.kind = FailureKind::Syntax;
                failure.span = Some(parse.span);
            }
            wesl::Error::Custom(_) => failure.kind = FailureKind::Syntax,
            wesl::Error::ResolveError(error)
            | wesl::Error::ImportError(ImportError::ResolveError(error)) => {
                failure.kind = FailureKind::Import;
                if let ResolveError::ModuleNotFound(path, why) = error {
                    failure.message = format!("cannot import from `{path}`: {why}");
                    failure.word = path.components.last().cloned();
                }
            }
            wesl::Error::ImportError(error) => {
                failure.kind = FailureKind::Import;
                if let ImportError::MissingDecl(path, name) = error {
                    failure.message = format!("`{path}` declares no `{name}`");
                    failure.word = Some(name);
                }
            }
            wesl::Error::CondCompError(_) => failure.kind = FailureKind::Condition,
            _ => {}
        }
        failure
    }
}

impl Failure {
    fn explain(self, files: &SourceFiles, names: &Names, kernel: &str) -> KernelError {
        let by_span = self.span.and_then(|span| files.file(span.start));
        let by_module = || {
            let file = files.named(&file_name(&self.module.as_ref()?.components.join("/")))?;
            let word = self.word.as_deref();
            let offset = word.and_then(|word| scan::find_word(file.text(), word));
            Some((file, offset.unwrap_or(0)))
        };
        let root = || Some((files.named(&file_name(kernel))?, 0));
        let message = names.restore(&self.message);
        let Some((file, offset)) = by_span.or_else(by_module).or_else(root) else {
            return KernelError::Internal {
                kernel: kernel.to_owned(),
                stage: "assembling",
                message,
            };
        };
        let diagnostic = file.diagnostic(offset, message);
        match self.kind {
            FailureKind::Syntax => KernelError::Syntax(diagnostic),
            FailureKind::Import => KernelError::Import(diagnostic),
            FailureKind::Condition => KernelError::Condition(diagnostic),
            FailureKind::Other => KernelError::Wgsl(diagnostic),
        }
    }
}

/// Cuts a message that lists every token the grammar would allow.
fn shorten(message: String) -> String {
    const MOST: usize = 160;
    if message.len() <= MOST {
        return message;
    }
    let end = message
        .char_indices()
        .map(|(at, _)| at)
        .take_while(|at| *at <= MOST)
        .last();
    let head = message.get(..end.unwrap_or(0)).unwrap_or_default();
    let head = head.rsplit_once(", ").map_or(head, |(head, _)| head);
    format!("{head}, …`")
}

/// The file name shown for a path.
pub(super) fn file_name(path: &str) -> String {
    format!("{path}.wesl")
}

/// Finds, parses and renames for WESL, and notes down what it did.
struct Modules<'a> {
    sources: &'a Sources,
    files: RefCell<SourceFiles>,
    renamed: RefCell<BTreeMap<String, String>>,
    parsed: Cell<u64>,
}

impl<'a> Modules<'a> {
    fn new(sources: &'a Sources) -> Self {
        Self {
            sources,
            files: RefCell::default(),
            renamed: RefCell::default(),
            parsed: Cell::new(0),
        }
    }

    fn find(&self, path: &ModulePath) -> Result<(String, library::Text), ResolveError> {
        let missing = |why: &str| ResolveError::ModuleNotFound(path.clone(), why.to_owned());
        if path.origin != PathOrigin::Absolute {
            return Err(missing("imports start with `package::` or `super::`"));
        }
        let name = path.components.join("/");
        let text = self.sources.get(&name);
        text.map(|text| (name.clone(), text))
            .ok_or_else(|| missing(&format!("there is no file `{}`", file_name(&name))))
    }
}

impl Resolver for Modules<'_> {
    fn resolve_source<'b>(&'b self, path: &ModulePath) -> Result<Cow<'b, str>, ResolveError> {
        let (_, text) = self.find(path)?;
        Ok(Cow::Owned(text.to_string()))
    }

    fn resolve_module(&self, path: &ModulePath) -> Result<TranslationUnit, ResolveError> {
        let (name, text) = self.find(path)?;
        let file = SourceFile::new(file_name(&name), text.clone());
        let start = self.files.borrow_mut().add(file);
        let refuse = |offset: usize, message: String| {
            let diagnostic = wesl::Diagnostic::from(wesl::Error::Custom(message))
                .with_span(Span::new(start + offset..start + offset + 1));
            ResolveError::Error(diagnostic)
        };
        if text.len() > MAX_FILE_BYTES {
            let message = format!(
                "the file has {} bytes, over the limit of {MAX_FILE_BYTES}",
                text.len()
            );
            return Err(refuse(0, message));
        }
        check::check_tokens(&text).map_err(|(offset, message)| refuse(offset, message))?;
        check::check_nesting(&text).map_err(|(offset, message)| refuse(offset, message))?;
        self.parsed.set(self.parsed.get() + 1);
        // Blanks in front make the spans global offsets.
        let mut placed = " ".repeat(start);
        placed.push_str(&scan::hide_hex_floats(&text));
        placed.parse::<TranslationUnit>().map_err(|error| {
            ResolveError::Error(wesl::Diagnostic::from(wesl::Error::ParseError(error)))
        })
    }

    fn display_name(&self, path: &ModulePath) -> Option<String> {
        Some(file_name(&path.components.join("/")))
    }
}

impl Mangler for Modules<'_> {
    fn mangle(&self, path: &ModulePath, item: &str) -> String {
        let name = EscapeMangler.mangle(path, item);
        self.renamed
            .borrow_mut()
            .insert(name.clone(), item.to_owned());
        name
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_restored_word_by_word() {
        let names = Names {
            original: BTreeMap::from([("package_lib_x".to_owned(), "x".to_owned())]),
        };
        assert_eq!(
            names.restore("no `package_lib_x`, package_lib_xy: package_lib_x"),
            "no `x`, package_lib_xy: x"
        );
        assert_eq!(names.restore(""), "");
    }
}
