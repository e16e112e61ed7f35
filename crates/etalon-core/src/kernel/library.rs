//! The kernels there are, and those compiled so far.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::fmt;
use std::ops::Deref;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use super::compile::{Variant, compile};
use super::{Arithmetic, Kernel, KernelError, KernelRequest};

/// The text of a file.
#[derive(Clone, Debug)]
pub(crate) enum Text {
    Embedded(&'static str),
    Added(Arc<str>),
}

impl Deref for Text {
    type Target = str;

    fn deref(&self) -> &str {
        match self {
            Self::Embedded(text) => text,
            Self::Added(text) => text,
        }
    }
}

/// Every file that can be compiled or imported, by path without extension.
#[derive(Clone, Debug, Default)]
pub(super) struct Sources {
    files: BTreeMap<Cow<'static, str>, Text>,
}

impl Sources {
    /// The file at a path without extension.
    pub(super) fn get(&self, path: &str) -> Option<Text> {
        self.files.get(path).cloned()
    }

    /// All paths, sorted.
    pub(super) fn paths(&self) -> Vec<&str> {
        self.files.keys().map(Cow::as_ref).collect()
    }
}

/// How much work a [`KernelLibrary`] has done.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct KernelStats {
    /// WESL files parsed.
    pub parsed: u64,
    /// Kernels compiled without error.
    pub compiled: u64,
    /// Requests answered with a kernel compiled before, which parses nothing.
    pub cached: u64,
}

/// A place for one variant of a kernel. Locked while it is compiled, so that
/// threads asking for the same variant wait instead of compiling it again.
type Slot = Arc<Mutex<Option<Arc<Kernel>>>>;

#[derive(Default)]
struct State {
    slots: BTreeMap<Variant, Slot>,
    stats: KernelStats,
}

/// Compiles kernels and keeps them.
///
/// Nothing is read or parsed before it is asked for. A library can be shared
/// between threads.
///
/// # Examples
/// ```
/// use etalon_core::kernel::{Arithmetic, KernelLibrary, KernelRequest};
///
/// let mut library = KernelLibrary::new();
/// library.add_source(
///     "example/halve",
///     "@group(0) @binding(0) var<storage, read_write> values: array<f32>;
///      override factor: f32 = 0.5;
///      @compute @workgroup_size(64)
///      fn main(@builtin(global_invocation_id) id: vec3u) {
///          if id.x < arrayLength(&values) { values[id.x] *= factor; }
///      }",
/// );
/// let request = KernelRequest::new("example/halve").constant("factor", 0.25);
/// let kernel = library.get(&request, Arithmetic::Strict)?;
/// assert_eq!(kernel.compute().unwrap().workgroup_size, [64, 1, 1]);
/// assert_eq!(kernel.bindings[0].name, "values");
/// # Ok::<(), etalon_core::kernel::KernelError>(())
/// ```
#[derive(Default)]
pub struct KernelLibrary {
    sources: Sources,
    state: Mutex<State>,
}

impl fmt::Debug for KernelLibrary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("KernelLibrary")
            .field("files", &self.sources.paths())
            .field("stats", &self.stats())
            .finish_non_exhaustive()
    }
}

/// A poisoned lock only says that another thread panicked; what it guards is
/// written whole or not at all.
fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl KernelLibrary {
    /// A library without files. One of the kernels of Etalon's effects is made by
    /// `etalon::effects::kernels()`.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// A library of files that are part of the program, as (path, text). Of two with
    /// one path the later counts.
    #[must_use]
    pub fn of(files: impl IntoIterator<Item = (&'static str, &'static str)>) -> Self {
        let files = files
            .into_iter()
            .map(|(path, text)| (Cow::Borrowed(path), Text::Embedded(text)));
        Self {
            sources: Sources {
                files: files.collect(),
            },
            ..Self::default()
        }
    }

    /// Adds a file, which may be a kernel or be imported by kernels as
    /// `package::my_effect::blur::…` for the path `my_effect/blur`.
    ///
    /// A file of the same path is replaced; kernels compiled before are forgotten,
    /// since they may have imported it.
    pub fn add_source(&mut self, path: &str, wesl: &str) {
        let text = Text::Added(wesl.into());
        self.sources.files.insert(path.to_owned().into(), text);
        lock(&self.state).slots.clear();
    }

    /// The text of a file, if there is one at the path.
    #[must_use]
    pub fn source(&self, path: &str) -> Option<String> {
        self.sources.get(path).map(|text| text.to_string())
    }

    /// The paths of all files, kernels and libraries, sorted.
    #[must_use]
    pub fn paths(&self) -> Vec<&str> {
        self.sources.paths()
    }

    /// Compiles a kernel, or finds it compiled before.
    ///
    /// # Errors
    /// Whatever is wrong with the kernel or the request; see [`KernelError`].
    pub fn get(
        &self,
        request: &KernelRequest,
        arithmetic: Arithmetic,
    ) -> Result<Arc<Kernel>, KernelError> {
        let variant = Variant::new(request, arithmetic);
        let slot = lock(&self.state)
            .slots
            .entry(variant.clone())
            .or_default()
            .clone();
        let mut slot = lock(&slot);
        if let Some(kernel) = &*slot {
            lock(&self.state).stats.cached += 1;
            return Ok(kernel.clone());
        }
        let mut parsed = 0;
        let result = compile(&self.sources, &variant, &mut parsed);
        let mut state = lock(&self.state);
        state.stats.parsed += parsed;
        let kernel = Arc::new(result?);
        state.stats.compiled += 1;
        *slot = Some(kernel.clone());
        Ok(kernel)
    }

    /// How much work has been done so far.
    #[must_use]
    pub fn stats(&self) -> KernelStats {
        lock(&self.state).stats
    }
}
