//! Phase 3: kernels are compiled, and what they declare is held against what
//! the passes declare.

use crate::format::{SampleKind, StorageSupport};
use crate::graph::{
    Access, AccessKind, Dispatch, Graph, KernelCall, Pass, Resource, ResourceDesc, Subresources,
    UniformValue, Work,
};
use crate::kernel::{self, BindingKind, Kernel, KernelLibrary, UniformLayout, ViewDimension};
use crate::plan::cull::Live;
use crate::plan::error::Mismatch;
use crate::plan::{
    Bound, Groups, KernelRef, PlanError, PlanOptions, Step, UniformSlice, Usage, raster,
};
use crate::resource::Dimension;
use std::borrow::Cow;

/// How a step uses part of a resource.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Use {
    pub(crate) resource: u32,
    pub(crate) range: Subresources,
    pub(crate) usage: Usage,
    /// Whether the contents before the step matter.
    pub(crate) keeps: bool,
}

/// A live pass as a step. Resources are still numbered as in the graph.
#[derive(Debug)]
pub(crate) struct BoundPass {
    pub(crate) step: Step,
    pub(crate) uses: Vec<Use>,
}

/// The live passes, bound, and the contents of their uniform blocks.
#[derive(Debug)]
pub(crate) struct BoundPasses {
    /// In the order they run.
    pub(crate) passes: Vec<BoundPass>,
    pub(crate) uniforms: Vec<u8>,
}

/// Binds the live passes, whose indices are given in the order they run.
pub(crate) fn bind(
    graph: &Graph,
    live: &Live,
    order: &[u32],
    kernels: &KernelLibrary,
    options: &PlanOptions<'_>,
) -> Result<BoundPasses, PlanError> {
    check_resources(graph, live, options)?;
    let mut uniforms = Vec::new();
    let passes = order
        .iter()
        .map(|&index| {
            let pass = &graph.passes[index as usize];
            bind_pass(graph, pass, kernels, options, &mut uniforms)
        })
        .collect::<Result<_, _>>()?;
    Ok(BoundPasses { passes, uniforms })
}

/// Checks the description of everything that is used, before anything is sized by it.
fn check_resources(graph: &Graph, live: &Live, options: &PlanOptions<'_>) -> Result<(), PlanError> {
    let mut used = vec![false; graph.resources.len()];
    for (pass, _) in graph
        .passes
        .iter()
        .zip(&live.needs)
        .filter(|(_, need)| need.is_some())
    {
        for access in &pass.accesses {
            used[access.resource as usize] = true;
        }
    }
    for output in &graph.outputs {
        used[output.resource as usize] = true;
    }
    for (resource, _) in graph.resources.iter().zip(used).filter(|(_, used)| *used) {
        let checked = match &resource.desc {
            ResourceDesc::Texture(desc) => desc.validate(&options.limits),
            ResourceDesc::Buffer(desc) => desc.validate(&options.limits),
        };
        checked.map_err(|error| PlanError::Resource {
            resource: resource.name.clone(),
            error,
        })?;
    }
    Ok(())
}

fn bind_pass(
    graph: &Graph,
    pass: &Pass,
    kernels: &KernelLibrary,
    options: &PlanOptions<'_>,
    uniforms: &mut Vec<u8>,
) -> Result<BoundPass, PlanError> {
    // A copy or clear has its target last and, if any, its source first.
    let simple = |kind: AccessKind| {
        pass.accesses
            .iter()
            .find(|access| access.kind == kind)
            .map_or((0, Subresources::ALL), |a| (a.resource, a.range))
    };
    let source = simple(AccessKind::CopySource);
    let target = simple(AccessKind::CopyTarget);
    let step = match &pass.work {
        Work::Compute { call, dispatch } => {
            let kernel = kernels
                .get(&call.kernel, options.arithmetic)
                .map_err(|error| PlanError::Kernel {
                    pass: pass.name.clone(),
                    error: Box::new(error),
                })?;
            let binder = Binder {
                graph,
                pass,
                accesses: &pass.accesses,
                kernel: &kernel,
                options,
            };
            let Some(stage) = kernel.compute() else {
                return Err(binder.differs(
                    &kernel.name,
                    "a dispatch",
                    "a draw: it is a raster kernel",
                ));
            };
            let (bindings, uses) = binder.bindings(call, uniforms)?;
            binder.layouts(&uses)?;
            let groups = binder.groups(dispatch, stage.workgroup_size)?;
            return Ok(BoundPass {
                step: Step::Dispatch {
                    bindings,
                    groups,
                    kernel: KernelRef(kernel),
                },
                uses,
            });
        }
        Work::Raster(work) => {
            return raster::bind_raster(graph, pass, work, kernels, options, uniforms);
        }
        Work::ClearTexture(value) => Step::ClearTexture {
            resource: target.0,
            range: target.1,
            value: *value,
        },
        Work::ClearBuffer => Step::ClearBuffer { resource: target.0 },
        Work::CopyTexture => Step::CopyTexture { source, target },
        Work::CopyBuffer => Step::CopyBuffer {
            source: source.0,
            target: target.0,
        },
    };
    let uses = pass.accesses.iter().map(|access| {
        let usage = if access.kind == AccessKind::CopySource {
            Usage::CopySource
        } else {
            Usage::CopyTarget
        };
        Use {
            resource: access.resource,
            range: access.range,
            usage,
            keeps: access.kind.reads(),
        }
    });
    Ok(BoundPass {
        step,
        uses: uses.collect(),
    })
}

/// A texture of which the same part would have two layouts in one step, and the
/// usages that ask for them.
pub(crate) fn layout_conflict<'g>(
    graph: &'g Graph,
    uses: &[Use],
) -> Option<(&'g str, Usage, Usage)> {
    let textures: Vec<&Use> = uses
        .iter()
        .filter(|one| {
            let resource = &graph.resources[one.resource as usize];
            matches!(resource.desc, ResourceDesc::Texture(_))
        })
        .collect();
    textures.iter().enumerate().find_map(|(index, first)| {
        let second = textures[index + 1..].iter().find(|second| {
            first.resource == second.resource
                && first.range.overlaps(second.range)
                && !first.usage.same_layout(second.usage)
        })?;
        let name = graph.resources[first.resource as usize].name.as_str();
        Some((name, first.usage, second.usage))
    })
}

/// Holds a compute pass, or one draw of a raster pass, against its kernel.
pub(crate) struct Binder<'a> {
    pub(crate) graph: &'a Graph,
    pub(crate) pass: &'a Pass,
    /// What is bound: all of the pass, or what the draw has of it.
    pub(crate) accesses: &'a [Access],
    pub(crate) kernel: &'a Kernel,
    pub(crate) options: &'a PlanOptions<'a>,
}

impl Binder<'_> {
    fn mismatch(&self, mismatch: Mismatch) -> PlanError {
        PlanError::Mismatch {
            pass: self.pass.name.clone(),
            kernel: self.kernel.name.clone(),
            mismatch,
        }
    }

    pub(crate) fn differs(
        &self,
        name: &str,
        given: impl Into<String>,
        wanted: impl Into<String>,
    ) -> PlanError {
        self.mismatch(Mismatch::Differs {
            name: name.to_owned(),
            given: given.into(),
            wanted: wanted.into(),
        })
    }

    fn not_in_kernel<'n>(
        &self,
        what: &'static str,
        name: &str,
        has: impl Iterator<Item = &'n str>,
    ) -> PlanError {
        let has: Vec<String> = has.map(|name| format!("`{name}`")).collect();
        let has = if has.is_empty() {
            "none".to_owned()
        } else {
            has.join(", ")
        };
        self.mismatch(Mismatch::NotInKernel {
            what,
            name: name.to_owned(),
            has,
        })
    }

    /// Finds what every binding of the kernel is given, and complains about
    /// whatever is given besides.
    pub(crate) fn bindings(
        &self,
        call: &KernelCall,
        uniforms: &mut Vec<u8>,
    ) -> Result<(Vec<Bound>, Vec<Use>), PlanError> {
        let mut bound = Vec::with_capacity(self.kernel.bindings.len());
        let mut uses = Vec::with_capacity(self.accesses.len());
        let mut block = false;
        for binding in &self.kernel.bindings {
            let name = &binding.name;
            bound.push(match &binding.kind {
                BindingKind::Uniform(layout) => {
                    block = true;
                    Bound::Uniform(self.uniforms(layout, &call.uniforms, uniforms)?)
                }
                BindingKind::Sampler { comparison } => {
                    let given = call
                        .samplers
                        .iter()
                        .find(|(candidate, _)| candidate == name);
                    let (_, sampler) = given.ok_or_else(|| self.missing("sampler", name))?;
                    let kind = |comparison| {
                        if comparison {
                            "a comparison sampler"
                        } else {
                            "a filtering sampler"
                        }
                    };
                    if sampler.compare.is_some() != *comparison {
                        return Err(self.differs(
                            name,
                            kind(sampler.compare.is_some()),
                            kind(*comparison),
                        ));
                    }
                    if !sampler.lod.is_valid() {
                        return Err(self.differs(
                            name,
                            format!("a sampler of the levels {}", sampler.lod),
                            "one whose least level is not above the greatest",
                        ));
                    }
                    Bound::Sampler(*sampler)
                }
                kind => {
                    let access = self.accesses.iter().find(|access| access.binding == *name);
                    let access = access.ok_or_else(|| self.missing("resource", name))?;
                    let resource = &self.graph.resources[access.resource as usize];
                    let usage = self.usage(name, kind, access, resource)?;
                    uses.push(Use {
                        resource: access.resource,
                        range: access.range,
                        usage,
                        keeps: access.kind.reads(),
                    });
                    match resource.desc {
                        ResourceDesc::Texture(_) => Bound::Texture {
                            resource: access.resource,
                            range: access.range,
                        },
                        ResourceDesc::Buffer(_) => Bound::Buffer {
                            resource: access.resource,
                        },
                    }
                }
            });
        }
        self.nothing_left(call, block)?;
        for access in self
            .accesses
            .iter()
            .filter(|access| access.kind == AccessKind::Indirect)
        {
            uses.push(Use {
                resource: access.resource,
                range: access.range,
                usage: Usage::Indirect,
                keeps: true,
            });
        }
        Ok((bound, uses))
    }

    /// One texture has one layout at a time, also within a pass.
    fn layouts(&self, uses: &[Use]) -> Result<(), PlanError> {
        match layout_conflict(self.graph, uses) {
            None => Ok(()),
            Some((name, first, second)) => {
                Err(self.differs(name, format!("{first:?}"), format!("{second:?} too")))
            }
        }
    }

    pub(crate) fn missing(&self, what: &'static str, name: &str) -> PlanError {
        self.mismatch(Mismatch::NotInPass {
            what,
            name: name.to_owned(),
        })
    }

    /// Everything the pass gives must be wanted.
    fn nothing_left(&self, call: &KernelCall, block: bool) -> Result<(), PlanError> {
        let bindings = &self.kernel.bindings;
        let named = |name: &str| {
            bindings
                .iter()
                .find(|binding| binding.name == name)
                .map(|binding| &binding.kind)
        };
        let of = |wanted: fn(&BindingKind) -> bool| {
            bindings
                .iter()
                .filter(move |binding| wanted(&binding.kind))
                .map(|binding| binding.name.as_str())
        };
        let is_resource: fn(&BindingKind) -> bool =
            |kind| !matches!(kind, BindingKind::Uniform(_) | BindingKind::Sampler { .. });
        for access in self
            .accesses
            .iter()
            .filter(|access| access.kind != AccessKind::Indirect)
        {
            let unused = !access.kind.writes() && self.unused(&access.binding);
            if !named(&access.binding).is_some_and(is_resource) && !unused {
                return Err(self.not_in_kernel("resource", &access.binding, of(is_resource)));
            }
        }
        let is_sampler: fn(&BindingKind) -> bool =
            |kind| matches!(kind, BindingKind::Sampler { .. });
        for (name, _) in &call.samplers {
            if !named(name).is_some_and(is_sampler) && !self.unused(name) {
                return Err(self.not_in_kernel("sampler", name, of(is_sampler)));
            }
        }
        match call.uniforms.first() {
            Some((name, _)) if !block => {
                Err(self.not_in_kernel("uniform", name, std::iter::empty()))
            }
            _ => Ok(()),
        }
    }

    /// Whether the kernel's file declares a resource that this variant of it
    /// does without: a strict kernel filters by itself and wants no sampler.
    fn unused(&self, name: &str) -> bool {
        self.kernel.unused.iter().any(|unused| unused == name)
    }

    /// Packs the uniform block; its place in the plan's bytes is returned.
    fn uniforms(
        &self,
        layout: &UniformLayout,
        values: &[(Cow<'static, str>, UniformValue)],
        uniforms: &mut Vec<u8>,
    ) -> Result<UniformSlice, PlanError> {
        for (name, _) in values {
            if layout.member(name).is_none() {
                let has = layout.members.iter().map(|member| member.name.as_str());
                return Err(self.not_in_kernel("uniform", name, has));
            }
        }
        let start = uniforms
            .len()
            .next_multiple_of(self.options.limits.uniform_alignment.max(16) as usize);
        uniforms.resize(start + layout.size as usize, 0);
        for member in &layout.members {
            let given = values.iter().find(|(name, _)| *name == member.name);
            let (name, value) = given.ok_or_else(|| self.missing("uniform", &member.name))?;
            if !value.fits(&member.ty) {
                return Err(self.differs(name, value.wgsl_type(), member.ty.to_string()));
            }
            let mut bytes = [0; 64];
            let size = value.write(&mut bytes);
            let at = start + member.offset as usize;
            uniforms[at..at + size].copy_from_slice(&bytes[..size]);
        }
        Ok(UniformSlice {
            offset: start as u32,
            size: layout.size,
        })
    }

    /// What use of its resource a binding makes, if the two go together.
    fn usage(
        &self,
        name: &str,
        kind: &BindingKind,
        access: &Access,
        resource: &Resource,
    ) -> Result<Usage, PlanError> {
        let desc = match (&resource.desc, kind) {
            (
                ResourceDesc::Buffer(desc),
                BindingKind::StorageBuffer {
                    access: wanted,
                    min_size,
                },
            ) => {
                if desc.bytes < *min_size {
                    let given = format!("{} bytes", desc.bytes);
                    return Err(self.differs(name, given, format!("at least {min_size}")));
                }
                return self.storage_usage(name, access.kind, *wanted);
            }
            (
                ResourceDesc::Texture(desc),
                BindingKind::Texture { .. } | BindingKind::StorageTexture { .. },
            ) => desc,
            (ResourceDesc::Buffer(_), _) => {
                return Err(self.differs(name, "a buffer", "a texture"));
            }
            (ResourceDesc::Texture(_), _) => {
                return Err(self.differs(name, "a texture", "a buffer"));
            }
        };
        let (dimension, layers) = (desc.dimension, access.range.layers);
        let wanted = match kind {
            BindingKind::Texture { dimension, .. }
            | BindingKind::StorageTexture { dimension, .. } => *dimension,
            _ => ViewDimension::D2,
        };
        let suits = match wanted {
            ViewDimension::D2 => dimension != Dimension::D3 && layers == 1,
            ViewDimension::D2Array => dimension != Dimension::D3,
            ViewDimension::Cube => dimension == Dimension::Cube && layers == 6,
            ViewDimension::CubeArray => dimension == Dimension::Cube && layers % 6 == 0,
            ViewDimension::D3 => dimension == Dimension::D3,
        };
        if !suits {
            let given = format!("a {dimension:?} texture with {layers} layers");
            return Err(self.differs(name, given, format!("a {wanted} view")));
        }
        match kind {
            BindingKind::StorageTexture {
                format,
                access: wanted,
                ..
            } => {
                if desc.format != *format {
                    return Err(self.differs(name, desc.format.name(), format.name()));
                }
                if access.range.mips != 1 {
                    return Err(self.differs(
                        name,
                        format!("{} mips", access.range.mips),
                        "one mip",
                    ));
                }
                let extended = self.options.limits.extended_storage_formats;
                if format.storage() == StorageSupport::Extended && !extended {
                    return Err(self.differs(
                        name,
                        format.name(),
                        "a format that this device can store to",
                    ));
                }
                self.storage_usage(name, access.kind, *wanted)
            }
            BindingKind::Texture { kind, filtered, .. } => {
                let given = desc.format.sample_kind();
                // A depth texture may be loaded as plain floats.
                let loads = given == *kind
                    || (given == SampleKind::Depth && *kind == SampleKind::Float && !filtered);
                if !loads {
                    return Err(self.differs(
                        name,
                        format!("{} ({given})", desc.format),
                        format!("{kind} texels"),
                    ));
                }
                if *filtered && !desc.format.filterable() {
                    return Err(self.differs(
                        name,
                        desc.format.name(),
                        "a format that can be filtered",
                    ));
                }
                match access.kind {
                    AccessKind::Read => Ok(Usage::Sampled),
                    _ => Err(self.differs(name, "a write", "a read")),
                }
            }
            _ => Err(self.differs(name, "a texture", "a buffer")),
        }
    }

    fn storage_usage(
        &self,
        name: &str,
        given: AccessKind,
        wanted: kernel::Access,
    ) -> Result<Usage, PlanError> {
        match (given, wanted) {
            (AccessKind::Read, kernel::Access::Read) => Ok(Usage::StorageRead),
            (
                AccessKind::Write | AccessKind::WritePart,
                kernel::Access::Write | kernel::Access::ReadWrite,
            ) => Ok(Usage::StorageWrite),
            (AccessKind::Update, kernel::Access::ReadWrite) => Ok(Usage::StorageUpdate),
            (given, wanted) => Err(self.differs(
                name,
                format!("{given:?}").to_lowercase(),
                format!("access `{wanted}`"),
            )),
        }
    }

    /// How many workgroups cover the dispatch.
    fn groups(&self, dispatch: &Dispatch, workgroup_size: [u32; 3]) -> Result<Groups, PlanError> {
        let groups = match dispatch {
            Dispatch::Fixed(groups) => *groups,
            Dispatch::PerTexel(name) => {
                let access = self.accesses.iter().find(|access| access.binding == *name);
                let access = access.ok_or_else(|| self.missing("resource", name))?;
                let ResourceDesc::Texture(desc) =
                    self.graph.resources[access.resource as usize].desc
                else {
                    return Err(self.differs(name, "a buffer", "a texture to count the texels of"));
                };
                let extent = desc.mip_extent(access.range.mip);
                let depth = if desc.dimension == Dimension::D3 {
                    extent.depth_or_layers
                } else {
                    access.range.layers
                };
                let [x, y, z] = workgroup_size.map(|size| size.max(1));
                [
                    extent.width.div_ceil(x),
                    extent.height.div_ceil(y),
                    depth.div_ceil(z),
                ]
            }
            Dispatch::Indirect { offset } => {
                let access = self
                    .accesses
                    .iter()
                    .find(|access| access.kind == AccessKind::Indirect);
                let access =
                    access.ok_or_else(|| self.missing("resource", "indirect arguments"))?;
                let resource = &self.graph.resources[access.resource as usize];
                match resource.desc {
                    ResourceDesc::Buffer(desc)
                        if offset % 4 == 0
                            && offset.checked_add(12).is_some_and(|end| end <= desc.bytes) =>
                    {
                        return Ok(Groups::Indirect {
                            buffer: access.resource,
                            offset: *offset,
                        });
                    }
                    ResourceDesc::Buffer(desc) => {
                        let given = format!("byte {offset} of {}", desc.bytes);
                        return Err(self.differs(
                            &access.binding,
                            given,
                            "12 bytes at a multiple of 4",
                        ));
                    }
                    ResourceDesc::Texture(_) => {
                        return Err(self.differs(&access.binding, "a texture", "a buffer"));
                    }
                }
            }
        };
        let limit = self.options.limits.max_workgroups;
        if groups.iter().any(|count| *count > limit) {
            return Err(PlanError::TooManyGroups {
                pass: self.pass.name.clone(),
                groups,
                limit,
            });
        }
        Ok(Groups::Direct(groups))
    }
}
