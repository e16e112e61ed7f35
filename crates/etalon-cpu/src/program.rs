//! Programs: kernels made ready to run.

use std::fmt;
use std::sync::{Arc, Mutex, PoisonError};

use etalon_core::kernel::Kernel;
use etalon_core::resource::{Dimension, SamplerDesc, TextureDesc};
use naga::valid::ModuleInfo;
use naga::{Module, ShaderStage, Span};

use crate::binding::{BindingInfo, BindingKind, ChannelKind, View};
use crate::code::Code;
use crate::error::{Location, RunError, TranslateError};
use crate::exec::{DispatchCounters, Executor, Linked, Links, Profile, Recording, Resource};
use crate::finding::{Checks, Finding};
use crate::memory::{Buffer, TextureView, written};
use crate::num::{Number, NumberType};
use crate::report::workgroup_id;
use crate::sanitise::Sanitised;
use crate::translate::{self, Fail};
use crate::{exec, lower};

/// A kernel as bytecode.
///
/// [`Display`](fmt::Display) lists the code.
pub struct Program {
    name: String,
    pub(crate) workgroup_size: [u32; 3],
    pub(crate) bindings: Vec<BindingInfo>,
    immediates: Option<u32>,
    pub(crate) code: Code,
    local_ids: exec::LocalIds,
    links: Links,
    recording: Mutex<Recording>,
    pub(crate) locate: Box<dyn Fn(Span) -> Location + Send + Sync>,
}

/// How a kernel is made into a program.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct TranslateOptions {
    /// What the program watches for while it runs. Without checks there is no
    /// trace of them in its code.
    pub checks: Checks,
    /// Whether the numerical [sanitiser](crate::sanitise) follows what it computes, in
    /// executions of [`NumberType::Shadow`]. They take some hundreds of times as long.
    pub sanitise: bool,
    /// Whether results can be moved within what WGSL allows, see
    /// [`Executor::with_perturbation`].
    pub perturb: bool,
}

/// What a dispatch did.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct DispatchReport {
    /// How much was run.
    pub counters: DispatchCounters,
    /// What the program's checks found: one entry for each kind and place, in the
    /// order of the source. The same at any number of threads and lanes and on any
    /// instruction set.
    pub findings: Vec<Finding>,
    /// What the sanitiser found; nothing unless [`TranslateOptions::sanitise`] was set.
    pub sanitised: Sanitised,
}

/// What a binding is given.
#[derive(Clone, Debug)]
pub enum BoundResource<'a> {
    /// For uniform blocks and storage buffers.
    Buffer(&'a Buffer),
    /// For textures and storage textures.
    Texture(TextureView<'a>),
    /// For samplers.
    Sampler(SamplerDesc),
}

/// Where a kernel's spans are in the files that it was made of.
pub(crate) fn locate_of(kernel: &Arc<Kernel>) -> impl Fn(Span) -> Location + Send + Sync + use<> {
    let kernel = Arc::clone(kernel);
    move |span| {
        let place = kernel.source_map.locate(span);
        Location {
            file: place.file,
            line: place.line,
            column: place.column,
        }
    }
}

/// Where a module's spans are in the source.
pub(crate) fn locate_in(name: String, source: String) -> impl Fn(Span) -> Location + Send + Sync {
    move |span| match span.to_range() {
        Some(range) if range.start <= source.len() && source.is_char_boundary(range.start) => {
            let place = span.location(&source);
            Location {
                file: name.clone(),
                line: place.line_number,
                column: place.line_position,
            }
        }
        _ => Location {
            file: name.clone(),
            line: 0,
            column: 0,
        },
    }
}

impl Program {
    /// Translates a compute entry point of a validated module, whose overrides
    /// are resolved. `source` is the WGSL it was parsed from, for error messages.
    ///
    /// # Errors
    /// [`TranslateError`] if the kernel uses what the interpreter does not have.
    pub fn from_module(
        name: &str,
        source: &str,
        module: &Module,
        info: &ModuleInfo,
        entry_point: &str,
    ) -> Result<Self, TranslateError> {
        let options = TranslateOptions::default();
        Self::from_module_with(name, source, module, info, entry_point, &options)
    }

    /// [`Program::from_module`] with options.
    ///
    /// # Errors
    /// As [`Program::from_module`].
    pub fn from_module_with(
        name: &str,
        source: &str,
        module: &Module,
        info: &ModuleInfo,
        entry_point: &str,
        options: &TranslateOptions,
    ) -> Result<Self, TranslateError> {
        Self::new(
            name.to_owned(),
            Box::new(locate_in(name.to_owned(), source.to_owned())),
            module,
            info,
            entry_point,
            options,
        )
    }

    /// Translates a kernel.
    ///
    /// # Errors
    /// [`TranslateError`] if the kernel uses what the interpreter does not have.
    pub fn translate(kernel: &Arc<Kernel>) -> Result<Self, TranslateError> {
        Self::translate_with(kernel, &TranslateOptions::default())
    }

    /// [`Program::translate`] with options.
    ///
    /// # Errors
    /// As [`Program::translate`].
    pub fn translate_with(
        kernel: &Arc<Kernel>,
        options: &TranslateOptions,
    ) -> Result<Self, TranslateError> {
        Self::new(
            kernel.name.clone(),
            Box::new(locate_of(kernel)),
            &kernel.module,
            &kernel.info,
            kernel
                .compute()
                .map_or("main", |stage| stage.entry_point.as_str()),
            options,
        )
    }

    fn new(
        name: String,
        locate: Box<dyn Fn(Span) -> Location + Send + Sync>,
        module: &Module,
        info: &ModuleInfo,
        entry_point: &str,
        options: &TranslateOptions,
    ) -> Result<Self, TranslateError> {
        let Some(index) = module
            .entry_points
            .iter()
            .position(|entry| entry.name == entry_point && entry.stage == ShaderStage::Compute)
        else {
            return Err(TranslateError::NoEntryPoint {
                name,
                entry_point: entry_point.to_owned(),
            });
        };
        let workgroup_size = module.entry_points[index].workgroup_size;
        let explain = |(fail, span): (Fail, Span)| explain_fail(&name, &*locate, fail, span);
        let overridden = module.entry_points[index]
            .workgroup_size_overrides
            .and_then(|sizes| sizes.into_iter().flatten().next());
        if let Some(expression) = overridden {
            let fail = Fail::invalid("the workgroup size is an override that was not resolved");
            let span = module.global_expressions.get_span(expression);
            return Err(explain((fail, span)));
        }
        let invocations = workgroup_size
            .iter()
            .try_fold(1_u32, |total, &size| total.checked_mul(size))
            .filter(|&total| total <= MAX_INVOCATIONS && total > 0);
        let Some(invocations) = invocations else {
            let size = workgroup_size
                .iter()
                .fold(1_u64, |total, &size| total.saturating_mul(size.into()));
            return Err(TranslateError::TooLarge {
                name,
                what: "number of invocations in a workgroup",
                size,
                limit: MAX_INVOCATIONS.into(),
            });
        };
        let translation = translate::translate(module, info, index, options).map_err(&explain)?;
        let partial = invocations % crate::registers::LANES as u32 != 0;
        let flat = lower::lower(translation.tree, partial);
        let code = Code::new(&flat, &lower::allocate(&flat))
            .map_err(|fail| explain((fail, Span::default())))?;
        Ok(Self {
            name,
            workgroup_size,
            bindings: translation.bindings,
            immediates: translation.immediates,
            code,
            local_ids: exec::LocalIds::new(workgroup_size),
            links: Links::default(),
            recording: Mutex::default(),
            locate,
        })
    }

    /// The kernel's name.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }

    /// What must be bound, in the order [`Program::dispatch`] takes it.
    #[must_use]
    pub fn bindings(&self) -> &[BindingInfo] {
        &self.bindings
    }

    /// Invocations of a workgroup along each axis.
    #[must_use]
    pub fn workgroup_size(&self) -> [u32; 3] {
        self.workgroup_size
    }

    /// Bytes of the kernel's `var<immediate>`, 0 without one.
    #[must_use]
    pub fn immediate_size(&self) -> u32 {
        self.immediates.unwrap_or(0)
    }

    /// What the program watches for.
    #[must_use]
    pub fn checks(&self) -> Checks {
        self.code.resources.checks
    }

    /// Runs a number of workgroups along each axis and waits for them.
    /// `resources` are in the order of [`Program::bindings`]. For kernels that
    /// have no immediate data.
    ///
    /// # Errors
    /// [`RunError::Binding`] if resources are missing or of the wrong kind; the
    /// other variants for what goes wrong while running, after which what the
    /// kernel writes is undefined.
    pub fn dispatch(
        &self,
        executor: &Executor,
        workgroups: [u32; 3],
        resources: &[BoundResource<'_>],
    ) -> Result<DispatchReport, RunError> {
        self.dispatch_with_immediates(executor, workgroups, resources, &[])
    }

    /// Like [`Program::dispatch`], for kernels with a `var<immediate>`: its
    /// bytes, laid out as in a storage buffer, of which there must be at least
    /// [`Program::immediate_size`].
    ///
    /// # Errors
    /// As [`Program::dispatch`]; [`RunError::Binding`] if bytes are missing.
    pub fn dispatch_with_immediates(
        &self,
        executor: &Executor,
        workgroups: [u32; 3],
        resources: &[BoundResource<'_>],
        immediates: &[u8],
    ) -> Result<DispatchReport, RunError> {
        let need = self.immediate_size();
        if immediates.len() < need as usize {
            return Err(RunError::Binding {
                kernel: self.name.clone(),
                binding: "var<immediate>".to_owned(),
                expected: format!("{need} bytes"),
                found: format!("immediate data of {} bytes", immediates.len()),
            });
        }
        let immediates = Buffer::from_bytes(&immediates[..need as usize])?;
        let mut bound = Vec::with_capacity(self.bindings.len() + 1);
        for (i, binding) in self.bindings.iter().enumerate() {
            bound.push(check_binding(&self.name, binding, resources.get(i))?);
        }
        // Where translation has put it.
        bound.push(Resource::Buffer(&immediates));
        let (links, code, tier) = (&self.links, &self.code, executor.tier());
        match executor.number_type() {
            NumberType::F32 => {
                let linked = links.singles(code, tier);
                self.run(executor, workgroups, resources, &bound, linked)
            }
            NumberType::F64 => {
                let linked = links.doubles(code, tier);
                self.run(executor, workgroups, resources, &bound, linked)
            }
            NumberType::Shadow => {
                let linked = links.shadowed(code, tier);
                self.run(executor, workgroups, resources, &bound, linked)
            }
        }
    }

    fn run<N: Number>(
        &self,
        executor: &Executor,
        workgroups: [u32; 3],
        bound: &[BoundResource<'_>],
        resources: &[Resource<'_>],
        linked: &Linked<N>,
    ) -> Result<DispatchReport, RunError> {
        let shadows = self.shadows(bound);
        let heat = self.heat(workgroups);
        let job = exec::Job {
            code: &self.code,
            linked,
            resources,
            local_ids: &self.local_ids,
            invocations: self.workgroup_size.iter().product(),
            recording: executor.profiles().then_some(&self.recording),
            shadows: &shadows,
            heat: Some(&heat),
            workgroup_size: self.workgroup_size,
        };
        let (counters, found) = job
            .run(executor, workgroups)
            .map_err(|failure| self.explain(failure, workgroups))?;
        let sanitised = self.sanitised(&found.tallies, &heat, workgroups);
        let findings = self.findings(found.checks.finish(&shadows), workgroups);
        self.settle(&shadows, bound);
        Ok(DispatchReport {
            counters,
            findings,
            sanitised,
        })
    }

    /// What its instructions have cost in dispatches by executors that
    /// [profile](Executor::with_profile).
    #[must_use]
    pub fn profile(&self) -> Profile {
        let recording = self.recording.lock();
        let recording = recording.unwrap_or_else(PoisonError::into_inner);
        recording.profile(&self.name, &self.code, &*self.locate)
    }

    /// The shadows of what is bound.
    fn shadows<'a>(&self, resources: &'a [BoundResource<'a>]) -> Vec<exec::Shadow<'a>> {
        if !self.checks().any() {
            return Vec::new();
        }
        self.bindings
            .iter()
            .zip(resources)
            .map(|(binding, resource)| {
                let (words, view) = match resource {
                    BoundResource::Buffer(buffer) => (buffer.shadow(), None),
                    BoundResource::Texture(texture) => (texture.shadow(), texture.shadow_view()),
                    BoundResource::Sampler(_) => (None, None),
                };
                exec::Shadow {
                    words,
                    view,
                    writable: binding.is_writable(),
                }
            })
            .collect()
    }

    /// After a dispatch: what it wrote is written. A program that did not watch may
    /// have written all that it can write.
    fn settle(&self, shadows: &[exec::Shadow<'_>], resources: &[BoundResource<'_>]) {
        if self.checks().uninitialised {
            for shadow in shadows.iter().filter(|shadow| shadow.writable) {
                shadow.words.into_iter().for_each(written::settle);
            }
            return;
        }
        note_written(&self.bindings, resources);
    }

    fn explain(&self, failure: exec::DispatchFailure, workgroups: [u32; 3]) -> RunError {
        let kernel = self.name.clone();
        match failure {
            exec::DispatchFailure::Failed(
                exec::Failure::EndlessLoop {
                    counter,
                    invocation,
                    ..
                },
                workgroup,
                limit,
            ) => RunError::EndlessLoop {
                kernel,
                location: (self.locate)(self.span(exec::Site::Loop(counter))),
                limit,
                workgroup: workgroup_id(workgroup, workgroups),
                invocation: self.invocation_id(invocation),
            },
            exec::DispatchFailure::Failed(
                exec::Failure::DivergentBarrier { inst, invocation },
                workgroup,
                _,
            ) => RunError::DivergentBarrier {
                kernel,
                location: (self.locate)(self.span(exec::Site::Inst(inst))),
                workgroup: workgroup_id(workgroup, workgroups),
                invocation: self.invocation_id(invocation),
            },
            exec::DispatchFailure::TooManyWorkgroups => {
                let [x, y, z] = workgroups;
                RunError::TooManyWorkgroups { kernel, x, y, z }
            }
            exec::DispatchFailure::OutOfMemory(bytes) => RunError::OutOfMemory {
                what: format!("the registers of kernel {kernel}"),
                bytes,
            },
        }
    }
}

/// Notes that all that a program may write is written.
pub(crate) fn note_written(bindings: &[BindingInfo], resources: &[BoundResource<'_>]) {
    for (binding, resource) in bindings.iter().zip(resources) {
        if binding.is_writable() {
            match resource {
                BoundResource::Buffer(buffer) => {
                    buffer.shadow().into_iter().for_each(written::write);
                }
                BoundResource::Texture(texture) => texture.note_written(),
                BoundResource::Sampler(_) => {}
            }
        }
    }
}

/// A failed translation with names and places.
pub(crate) fn explain_fail(
    name: &str,
    locate: &dyn Fn(Span) -> Location,
    fail: Fail,
    span: Span,
) -> TranslateError {
    match fail {
        Fail::Unsupported(construct) => TranslateError::Unsupported {
            construct,
            location: locate(span),
        },
        Fail::Invalid(what) => TranslateError::Invalid {
            what,
            location: locate(span),
        },
        Fail::TooLarge { what, size, limit } => TranslateError::TooLarge {
            name: name.to_owned(),
            what,
            size,
            limit,
        },
    }
}

/// What a kernel is given for a binding, if it is of the right kind.
pub(crate) fn check_binding<'a>(
    kernel: &str,
    binding: &BindingInfo,
    resource: Option<&'a BoundResource<'a>>,
) -> Result<Resource<'a>, RunError> {
    let mismatch = |expected: String, found: String| RunError::Binding {
        kernel: kernel.to_owned(),
        binding: binding.name.clone(),
        expected,
        found,
    };
    match (binding.kind, resource) {
        (
            BindingKind::Uniform { size: need } | BindingKind::Storage { min_size: need, .. },
            Some(BoundResource::Buffer(buffer)),
        ) => {
            if buffer.len() < need.into() {
                return Err(mismatch(
                    format!("a buffer of at least {need} bytes"),
                    format!("one of {} bytes", buffer.len()),
                ));
            }
            Ok(Resource::Buffer(buffer))
        }
        (BindingKind::Texture { view, kind }, Some(BoundResource::Texture(texture))) => {
            let desc = texture.desc();
            let found = match desc.format.sample_kind() {
                etalon_core::format::SampleKind::Sint => ChannelKind::Sint,
                etalon_core::format::SampleKind::Uint => ChannelKind::Uint,
                _ => ChannelKind::Float,
            };
            if !fits(view, &desc) || found != kind {
                return Err(mismatch(
                    format!("a {view:?} texture of kind {kind:?}"),
                    describe(&desc),
                ));
            }
            Ok(Resource::Texture(texture))
        }
        (
            BindingKind::StorageTexture { view, format, .. },
            Some(BoundResource::Texture(texture)),
        ) => {
            let desc = texture.desc();
            if !fits(view, &desc) || desc.format != format {
                return Err(mismatch(
                    format!("a {view:?} texture of format {format}"),
                    describe(&desc),
                ));
            }
            Ok(Resource::Texture(texture))
        }
        (BindingKind::Sampler { comparison }, Some(BoundResource::Sampler(sampler))) => {
            let kind = |comparison| {
                if comparison {
                    "a comparison sampler"
                } else {
                    "a filtering sampler"
                }
            };
            if sampler.compare.is_some() != comparison {
                return Err(mismatch(
                    kind(comparison).to_owned(),
                    kind(!comparison).to_owned(),
                ));
            }
            if !sampler.lod.is_valid() {
                return Err(mismatch(
                    "a sampler whose least level is not above the greatest".to_owned(),
                    format!("one of the levels {}", sampler.lod),
                ));
            }
            Ok(Resource::Sampler(*sampler))
        }
        (kind, found) => {
            let expected = match kind {
                BindingKind::Uniform { .. } | BindingKind::Storage { .. } => "a buffer",
                BindingKind::Texture { .. } | BindingKind::StorageTexture { .. } => "a texture",
                BindingKind::Sampler { .. } => "a sampler",
            };
            let found = match found {
                None => "nothing",
                Some(BoundResource::Buffer(_)) => "a buffer",
                Some(BoundResource::Texture(_)) => "a texture",
                Some(BoundResource::Sampler(_)) => "a sampler",
            };
            Err(mismatch(expected.to_owned(), found.to_owned()))
        }
    }
}

/// Most invocations of a workgroup.
const MAX_INVOCATIONS: u32 = 1024;

fn fits(view: View, desc: &TextureDesc) -> bool {
    match view {
        View::D1 => {
            desc.dimension == Dimension::D2 && desc.extent.height == 1 && desc.layers() == 1
        }
        // The faces of a cube can be read and written as layers.
        View::D2 | View::D2Array => desc.dimension != Dimension::D3,
        View::D3 => desc.dimension == Dimension::D3,
        View::Cube | View::CubeArray => desc.dimension == Dimension::Cube,
    }
}

fn describe(desc: &TextureDesc) -> String {
    let extent = desc.extent;
    format!(
        "a {:?} texture of {}×{}×{} and format {}",
        desc.dimension, extent.width, extent.height, extent.depth_or_layers, desc.format
    )
}

impl fmt::Display for Program {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [x, y, z] = self.workgroup_size;
        writeln!(f, "; {} ({x}×{y}×{z})", self.name)?;
        for (i, binding) in self.bindings.iter().enumerate() {
            writeln!(f, "; b{i} = {} {:?}", binding.name, binding.kind)?;
        }
        write!(f, "{}", self.code)
    }
}

impl fmt::Debug for Program {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Program")
            .field("name", &self.name)
            .field("instructions", &self.code.insts.len())
            .finish_non_exhaustive()
    }
}
