//! From a request to a kernel, step by step.

use std::collections::BTreeMap;
use std::panic::{AssertUnwindSafe, catch_unwind};

use naga::valid::{Capabilities, ModuleInfo, ValidationError, ValidationFlags, Validator};
use naga::{Module, WithSpan};

use super::assemble::{self, Assembly, Names};
use super::error::KernelError;
use super::library::Sources;
use super::source_map::{Misprint, SourceMap};
use super::{
    Arithmetic, Kernel, KernelId, KernelRequest, half, lint, need, reflect, scan, specialise, stage,
};

/// What WGSL may use beyond its core: see the documentation of
/// [`kernel`](super).
pub(super) const CAPABILITIES: Capabilities = Capabilities::CUBE_ARRAY_TEXTURES
    .union(Capabilities::SHADER_FLOAT16)
    .union(Capabilities::SHADER_FLOAT16_IN_FLOAT32);

/// A request in the one form that equal requests share.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Variant {
    pub(super) path: String,
    pub(super) features: BTreeMap<String, bool>,
    /// Bits of the `f64`s, which can be compared.
    constants: BTreeMap<String, u64>,
    pub(super) arithmetic: Arithmetic,
}

impl Variant {
    /// Where a name is set twice, the last one counts.
    pub(super) fn new(request: &KernelRequest, arithmetic: Arithmetic) -> Self {
        Self {
            path: request.path.clone().into_owned(),
            features: request
                .features
                .iter()
                .map(|(name, on)| (name.clone().into_owned(), *on))
                .collect(),
            constants: request
                .constants
                .iter()
                .map(|(name, value)| (name.clone().into_owned(), value.to_bits()))
                .collect(),
            arithmetic,
        }
    }

    pub(super) fn constants(&self) -> impl Iterator<Item = (&str, f64)> {
        self.constants
            .iter()
            .map(|(name, bits)| (name.as_str(), f64::from_bits(*bits)))
    }
}

/// What the steps after assembling need to know to explain themselves.
pub(super) struct Origin<'a> {
    pub(super) sources: &'a Sources,
    pub(super) variant: &'a Variant,
    pub(super) names: &'a Names,
    pub(super) map: &'a SourceMap,
}

impl Origin<'_> {
    /// A message about a span of the generated text, with names as written.
    pub(super) fn diagnostic(&self, span: naga::Span, message: &str) -> super::Diagnostic {
        self.map.diagnostic(span, self.names.restore(message))
    }
}

/// Compiles a variant of a kernel. `parsed` is counted up for every file
/// parsed.
pub(super) fn compile(
    sources: &Sources,
    variant: &Variant,
    parsed: &mut u64,
) -> Result<Kernel, KernelError> {
    let Assembly { tree, files, names } = guard(variant, "assembling", || {
        assemble::assemble(sources, variant, parsed)
    })?;
    let texts = files.iter().map(|(_, file)| file.text());
    let declared: Vec<String> = texts
        .flat_map(|text| scan::declared(text).bindings)
        .map(str::to_owned)
        .collect();
    guard(variant, "compiling", || {
        let printed = assemble::print(&tree);
        let map = SourceMap::new(files, &tree, &printed, &names).map_err(|Misprint(place)| {
            let place = place.map_or_else(|| variant.path.clone(), |place| place.to_string());
            KernelError::Internal {
                kernel: variant.path.clone(),
                stage: "printing",
                message: format!("the declaration at {place} changed its shape"),
            }
        })?;
        let wgsl = map.generated().to_owned();
        let origin = Origin {
            sources,
            variant,
            names: &names,
            map: &map,
        };
        let parsed = parse(&wgsl, &origin)?;
        check_entry_point(&parsed, &origin)?;
        reflect::check_places(&parsed, &origin)?;
        half::check(&parsed, &origin)?;
        let info = validate(&parsed, &origin)?;
        let (mut module, constants) = specialise::specialise(&parsed, &info, &origin)?;
        naga::compact::compact(&mut module, naga::compact::KeepUnused::No);
        let info = validate(&module, &origin)?;
        let bindings = reflect::bindings(&module, &info, &origin)?;
        if variant.arithmetic == Arithmetic::Strict {
            let findings = lint::strict(&module, &info, &map);
            if !findings.is_empty() {
                return Err(KernelError::NotStrict {
                    kernel: variant.path.clone(),
                    findings,
                });
            }
        }
        let mut unused = declared;
        unused.retain(|name| !bindings.iter().any(|binding| binding.name == *name));
        unused.sort_unstable();
        unused.dedup();
        let Some(stages) = stage::stages(&module, &origin)? else {
            return Err(no_entry_point(&module, &origin));
        };
        Ok(Kernel {
            id: identify(variant, &wgsl, &constants),
            name: variant.path.clone(),
            arithmetic: variant.arithmetic,
            constants,
            stages,
            needs: need::needs(&module, &info, &bindings),
            bindings,
            unused,
            wgsl,
            info,
            module,
            source_map: map,
        })
    })
}

/// Turns a panic of a compiler into an error: no text may bring down a
/// program that compiles it.
fn guard<T>(
    variant: &Variant,
    stage: &'static str,
    work: impl FnOnce() -> Result<T, KernelError>,
) -> Result<T, KernelError> {
    catch_unwind(AssertUnwindSafe(work)).unwrap_or_else(|panic| {
        let message = panic
            .downcast_ref::<&str>()
            .map(|message| (*message).to_owned())
            .or_else(|| panic.downcast_ref::<String>().cloned())
            .unwrap_or_else(|| "no message".to_owned());
        Err(KernelError::Internal {
            kernel: variant.path.clone(),
            stage,
            message,
        })
    })
}

fn parse(wgsl: &str, origin: &Origin<'_>) -> Result<Module, KernelError> {
    let options = naga::front::wgsl::Options {
        parse_doc_comments: false,
        capabilities: CAPABILITIES,
    };
    let mut frontend = naga::front::wgsl::Frontend::new_with_options(options);
    frontend.parse(wgsl).map_err(|error| {
        let (span, label) = error.labels().next().unwrap_or((naga::Span::UNDEFINED, ""));
        let mut message = error.message().to_owned();
        if !label.is_empty() && !message.contains(label) {
            message = format!("{message} ({label})");
        }
        for note in error.notes() {
            message = format!("{message}; {note}");
        }
        KernelError::Wgsl(origin.diagnostic(span, &message))
    })
}

fn validate(module: &Module, origin: &Origin<'_>) -> Result<ModuleInfo, KernelError> {
    Validator::new(ValidationFlags::all(), CAPABILITIES)
        .validate(module)
        .map_err(|error| invalid(&error, origin))
}

/// Explains a validation error at the innermost place it knows.
pub(super) fn invalid(error: &WithSpan<ValidationError>, origin: &Origin<'_>) -> KernelError {
    // Outer places come first.
    let span = error.spans().last();
    let span = span.map_or(naga::Span::UNDEFINED, |(span, _)| *span);
    let mut message = error.as_inner().to_string();
    let mut source = std::error::Error::source(error.as_inner());
    while let Some(error) = source {
        message = format!("{message}: {error}");
        source = error.source();
    }
    KernelError::Wgsl(origin.diagnostic(span, &message))
}

fn check_entry_point(module: &Module, origin: &Origin<'_>) -> Result<(), KernelError> {
    if stage::are_complete(module) {
        Ok(())
    } else {
        Err(no_entry_point(module, origin))
    }
}

fn no_entry_point(module: &Module, origin: &Origin<'_>) -> KernelError {
    let found = module
        .entry_points
        .iter()
        .map(|entry| {
            let stage = format!("{:?}", entry.stage).to_lowercase();
            let name = origin.names.original(&entry.name);
            // naga does not keep the place of an entry point.
            match scan::find_function(origin.map.generated(), &entry.name) {
                Some(at) => format!("`@{stage} fn {name}` ({})", origin.map.locate_offset(at)),
                None => format!("`@{stage} fn {name}`"),
            }
        })
        .collect();
    KernelError::EntryPoint {
        kernel: origin.variant.path.clone(),
        found,
    }
}

/// FNV-1a, 64 bits (Fowler, Noll, Vo): small, and the same everywhere, unlike
/// the hashers of the standard library.
fn identify(variant: &Variant, wgsl: &str, constants: &[(String, f64)]) -> KernelId {
    let mut hash = 0xcbf2_9ce4_8422_2325_u64;
    let mut feed = |bytes: &[u8]| {
        // The length keeps neighbouring fields apart.
        for byte in bytes
            .iter()
            .copied()
            .chain((bytes.len() as u64).to_le_bytes())
        {
            hash = (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3);
        }
    };
    feed(wgsl.as_bytes());
    feed(variant.arithmetic.to_string().as_bytes());
    for (name, value) in constants {
        feed(name.as_bytes());
        feed(&value.to_bits().to_le_bytes());
    }
    KernelId(hash)
}
