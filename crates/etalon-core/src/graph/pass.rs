//! Passes: what they run, what they touch, and the builder that declares them.

use std::borrow::Cow;

use crate::graph::handle::{Buffer, GraphId, Subresources, Texture, TextureView};
use crate::graph::raster::RasterWork;
use crate::graph::{ClearValue, Graph, GraphError, ResourceDesc, UniformValue};
use crate::kernel::KernelRequest;
use crate::resource::SamplerDesc;

/// How a pass uses a resource.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum AccessKind {
    Read,
    Write,
    /// Some of it is written; the rest keeps what it held, if it held anything.
    WritePart,
    Update,
    CopySource,
    CopyTarget,
    Indirect,
    /// A colour or depth target that is cleared.
    Target,
    /// One that is drawn over.
    TargetKept,
    /// A depth target that draws are compared with and none changes.
    TargetTested,
    Vertices,
    Indices,
}

impl AccessKind {
    pub(crate) const fn reads(self) -> bool {
        matches!(
            self,
            Self::Read
                | Self::WritePart
                | Self::Update
                | Self::CopySource
                | Self::Indirect
                | Self::TargetKept
                | Self::TargetTested
                | Self::Vertices
                | Self::Indices
        )
    }

    pub(crate) const fn writes(self) -> bool {
        matches!(
            self,
            Self::Write
                | Self::WritePart
                | Self::Update
                | Self::CopyTarget
                | Self::Target
                | Self::TargetKept
        )
    }
}

/// One use of a resource by a pass.
#[derive(Clone, Debug)]
pub(crate) struct Access {
    pub(crate) binding: Cow<'static, str>,
    /// The draw it is of, in raster passes; targets are of all.
    pub(crate) draw: Option<u32>,
    pub(crate) graph: GraphId,
    pub(crate) resource: u32,
    /// The version read or written over.
    pub(crate) version: u32,
    /// Resolved once the pass is declared.
    pub(crate) range: Subresources,
    pub(crate) kind: AccessKind,
    /// The version this access made.
    pub(crate) written: Option<u32>,
}

pub(crate) fn texture(
    binding: impl Into<Cow<'static, str>>,
    view: TextureView,
    kind: AccessKind,
) -> Access {
    let TextureView { texture, range } = view;
    Access {
        binding: binding.into(),
        draw: None,
        graph: texture.graph,
        resource: texture.resource,
        version: texture.version,
        range,
        kind,
        written: None,
    }
}

pub(crate) fn buffer(
    binding: impl Into<Cow<'static, str>>,
    buffer: Buffer,
    kind: AccessKind,
) -> Access {
    Access {
        binding: binding.into(),
        draw: None,
        graph: buffer.graph,
        resource: buffer.resource,
        version: buffer.version,
        range: Subresources::ALL,
        kind,
        written: None,
    }
}

/// How many workgroups a compute pass runs.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Dispatch {
    /// One invocation per texel of the first mip of the named binding.
    PerTexel(Cow<'static, str>),
    /// So many workgroups.
    Fixed([u32; 3]),
    /// Workgroup counts read from the access of kind `Indirect`, at this byte.
    Indirect { offset: u64 },
}

/// A kernel, and what it is given beside resources.
#[derive(Clone, Debug)]
pub(crate) struct KernelCall {
    pub(crate) kernel: KernelRequest,
    pub(crate) uniforms: Vec<(Cow<'static, str>, UniformValue)>,
    pub(crate) samplers: Vec<(Cow<'static, str>, SamplerDesc)>,
}

impl KernelCall {
    pub(crate) fn new(path: impl Into<Cow<'static, str>>) -> Self {
        Self {
            kernel: KernelRequest::new(path),
            uniforms: Vec::new(),
            samplers: Vec::new(),
        }
    }

    /// The call in the one form that equal ones share: a request's identity must
    /// not depend on the order of the calls that made it.
    pub(crate) fn settled(mut self, pass: &str) -> Result<Self, GraphError> {
        if let Some(name) = self.repeated() {
            return Err(GraphError::GivenTwice {
                pass: pass.to_owned(),
                name,
            });
        }
        self.kernel.constants.sort_by(|a, b| a.0.cmp(&b.0));
        self.kernel.features.sort_by(|a, b| a.0.cmp(&b.0));
        Ok(self)
    }

    /// The first name of a uniform member, constant, feature or sampler that is
    /// given twice.
    fn repeated(&self) -> Option<String> {
        fn names<'n, T>(named: &'n [(Cow<'static, str>, T)]) -> Vec<&'n str> {
            named.iter().map(|(name, _)| name.as_ref()).collect()
        }
        [
            names(&self.uniforms),
            names(&self.kernel.constants),
            names(&self.kernel.features),
            names(&self.samplers),
        ]
        .into_iter()
        .find_map(|mut names| {
            names.sort_unstable();
            let pair = names.windows(2).find(|pair| pair[0] == pair[1])?;
            Some(pair[0].to_owned())
        })
    }
}

/// What a pass does.
#[derive(Clone, Debug)]
pub(crate) enum Work {
    Compute {
        call: KernelCall,
        dispatch: Dispatch,
    },
    Raster(RasterWork),
    ClearTexture(ClearValue),
    ClearBuffer,
    CopyTexture,
    CopyBuffer,
}

/// A declared pass.
#[derive(Clone, Debug)]
pub(crate) struct Pass {
    pub(crate) name: String,
    pub(crate) work: Work,
    pub(crate) accesses: Vec<Access>,
}

/// The new versions of what a pass wrote, by binding name.
#[derive(Clone, Debug)]
pub struct Written {
    pass: String,
    textures: Vec<(Cow<'static, str>, Texture)>,
    buffers: Vec<(Cow<'static, str>, Buffer)>,
}

impl Written {
    /// The texture written through `binding`.
    ///
    /// # Errors
    /// If the pass writes no texture of that name.
    pub fn texture(&self, binding: &str) -> Result<Texture, GraphError> {
        find(&self.textures, binding).ok_or_else(|| self.missing("texture", binding))
    }

    /// The buffer written through `binding`.
    ///
    /// # Errors
    /// If the pass writes no buffer of that name.
    pub fn buffer(&self, binding: &str) -> Result<Buffer, GraphError> {
        find(&self.buffers, binding).ok_or_else(|| self.missing("buffer", binding))
    }

    fn missing(&self, what: &'static str, binding: &str) -> GraphError {
        let names = self
            .textures
            .iter()
            .map(|(name, _)| name)
            .chain(self.buffers.iter().map(|(name, _)| name));
        GraphError::NoSuchWrite {
            pass: self.pass.clone(),
            what,
            binding: binding.to_owned(),
            writes: list(names.map(AsRef::as_ref)),
        }
    }
}

fn find<T: Copy>(named: &[(Cow<'static, str>, T)], name: &str) -> Option<T> {
    named
        .iter()
        .find(|(candidate, _)| candidate == name)
        .map(|(_, value)| *value)
}

/// `a`, `b`, or "nothing".
fn list<'a>(names: impl Iterator<Item = &'a str>) -> String {
    let names: Vec<String> = names.map(|name| format!("`{name}`")).collect();
    if names.is_empty() {
        "nothing".to_owned()
    } else {
        names.join(", ")
    }
}

/// Checks one access against the graph, without changing anything, and
/// returns its resolved range.
pub(crate) fn check(
    graph: &Graph,
    pass: &str,
    access: &Access,
) -> Result<Subresources, GraphError> {
    let named = || (pass.to_owned(), access.binding.to_string());
    let resource = match graph.resources.get(access.resource as usize) {
        Some(resource)
            if access.graph == graph.id && (access.version as usize) < resource.versions.len() =>
        {
            resource
        }
        _ => {
            let (pass, binding) = named();
            return Err(GraphError::ForeignHandle { pass, binding });
        }
    };
    let (mips, layers) = resource.desc.subresources();
    let range = access.range.resolve(mips, layers).ok_or_else(|| {
        let (pass, binding) = named();
        GraphError::NoSuchSubresource {
            pass,
            binding,
            resource: resource.name.clone(),
            mips,
            layers,
            first_mip: access.range.mip,
            first_layer: access.range.layer,
        }
    })?;
    // What is written in part may have held nothing so far.
    let needed = access.kind.reads() && access.kind != AccessKind::WritePart;
    if needed && !resource.has_contents() {
        let writers = &resource.versions[access.version as usize];
        if let Some(index) = range
            .indices(layers)
            .find(|&index| writers.get(index).is_some_and(Option::is_none))
        {
            let (pass, binding) = named();
            return Err(GraphError::ReadBeforeWrite {
                pass,
                binding,
                resource: resource.name.clone(),
                mip: index as u32 / layers,
                layer: index as u32 % layers,
            });
        }
    }
    if access.kind.writes() && access.version as usize + 1 != resource.versions.len() {
        // The next version exists, so somebody made it.
        let next = &resource.versions[access.version as usize + 1];
        let this = &resource.versions[access.version as usize];
        let by = next
            .iter()
            .zip(this.iter())
            .find(|(a, b)| a != b)
            .and_then(|(writer, _)| *writer);
        let (pass, binding) = named();
        return Err(GraphError::StaleWrite {
            pass,
            binding,
            resource: resource.name.clone(),
            by: by.map_or_else(
                || "?".to_owned(),
                |by| graph.passes[by as usize].name.clone(),
            ),
        });
    }
    Ok(range)
}

/// Adds a pass: checks every access, then makes the new versions.
pub(crate) fn declare(
    graph: &mut Graph,
    name: String,
    work: Work,
    mut accesses: Vec<Access>,
) -> Result<Written, GraphError> {
    for access in &mut accesses {
        access.range = check(graph, &name, access)?;
    }
    for (index, first) in accesses.iter().enumerate() {
        for second in &accesses[index + 1..] {
            if first.binding == second.binding && first.draw == second.draw {
                return Err(GraphError::GivenTwice {
                    pass: name,
                    name: first.binding.to_string(),
                });
            }
            if first.resource == second.resource
                && (first.kind.writes() || second.kind.writes())
                && first.range.overlaps(second.range)
            {
                return Err(GraphError::Hazard {
                    pass: name,
                    first: first.binding.to_string(),
                    second: second.binding.to_string(),
                    resource: graph.resources[first.resource as usize].name.clone(),
                });
            }
        }
    }
    let name = super::unique(&mut graph.pass_names, name);
    let index = graph.passes.len() as u32;
    let mut written = Written {
        pass: name.clone(),
        textures: Vec::new(),
        buffers: Vec::new(),
    };
    for access in accesses.iter_mut().filter(|access| access.kind.writes()) {
        let resource = &mut graph.resources[access.resource as usize];
        let (_, layers) = resource.desc.subresources();
        // Writes of one pass to several mips of a texture make one version.
        let newest = resource.versions.len() - 1;
        let mut writers = resource.versions[newest].to_vec();
        for subresource in access.range.indices(layers) {
            if let Some(writer) = writers.get_mut(subresource) {
                *writer = Some(index);
            }
        }
        if newest == access.version as usize {
            resource.versions.push(writers.into());
        } else {
            resource.versions[newest] = writers.into();
        }
        let version = access.version + 1;
        access.written = Some(version);
        match resource.desc {
            ResourceDesc::Texture(_) => {
                let handle = Texture {
                    graph: graph.id,
                    resource: access.resource,
                    version,
                };
                written.textures.push((access.binding.clone(), handle));
            }
            ResourceDesc::Buffer(_) => {
                let handle = Buffer {
                    graph: graph.id,
                    resource: access.resource,
                    version,
                };
                written.buffers.push((access.binding.clone(), handle));
            }
        }
    }
    graph.passes.push(Pass {
        name,
        work,
        accesses,
    });
    Ok(written)
}

/// Declares one compute pass; see [`Graph::compute`].
///
/// Bindings, uniform members and constants are given by the names they have in
/// the kernel. Whether they are the ones the kernel has is checked when the
/// graph is planned, since only then is the kernel known to be needed.
#[derive(Debug)]
#[must_use = "a pass is declared by one of the methods that say how much of it to run"]
pub struct ComputePass<'g> {
    graph: &'g mut Graph,
    name: String,
    call: KernelCall,
    accesses: Vec<Access>,
}

impl<'g> ComputePass<'g> {
    pub(crate) fn new(graph: &'g mut Graph, path: Cow<'static, str>) -> Self {
        Self {
            graph,
            name: path.clone().into_owned(),
            call: KernelCall::new(path),
            accesses: Vec::new(),
        }
    }

    /// Names the pass; repeated names are numbered.
    pub fn named(mut self, name: impl Into<String>) -> Self {
        self.name = name.into();
        self
    }

    /// Reads a texture through the kernel's variable `binding`.
    pub fn read(
        mut self,
        binding: impl Into<Cow<'static, str>>,
        source: impl Into<TextureView>,
    ) -> Self {
        self.accesses
            .push(texture(binding, source.into(), AccessKind::Read));
        self
    }

    /// Replaces the contents of a texture through the kernel's variable `binding`.
    pub fn write(
        mut self,
        binding: impl Into<Cow<'static, str>>,
        target: impl Into<TextureView>,
    ) -> Self {
        self.accesses
            .push(texture(binding, target.into(), AccessKind::Write));
        self
    }

    /// Writes some texels of a texture through the kernel's variable `binding`. The
    /// others keep what earlier passes wrote there; where none did they hold nothing
    /// that is defined, and whoever reads the texture must not look at them. Plans that
    /// capture every pass clear such a texture first, so that captures can be compared.
    pub fn write_part(
        mut self,
        binding: impl Into<Cow<'static, str>>,
        target: impl Into<TextureView>,
    ) -> Self {
        self.accesses
            .push(texture(binding, target.into(), AccessKind::WritePart));
        self
    }

    /// Reads and writes a texture in place.
    pub fn update(
        mut self,
        binding: impl Into<Cow<'static, str>>,
        target: impl Into<TextureView>,
    ) -> Self {
        self.accesses
            .push(texture(binding, target.into(), AccessKind::Update));
        self
    }

    /// Reads a buffer.
    pub fn read_buffer(mut self, binding: impl Into<Cow<'static, str>>, source: Buffer) -> Self {
        self.accesses
            .push(buffer(binding, source, AccessKind::Read));
        self
    }

    /// Replaces the contents of a buffer.
    pub fn write_buffer(mut self, binding: impl Into<Cow<'static, str>>, target: Buffer) -> Self {
        self.accesses
            .push(buffer(binding, target, AccessKind::Write));
        self
    }

    /// Reads and writes a buffer in place.
    pub fn update_buffer(mut self, binding: impl Into<Cow<'static, str>>, target: Buffer) -> Self {
        self.accesses
            .push(buffer(binding, target, AccessKind::Update));
        self
    }

    /// Binds a sampler. Strict kernels filter by themselves: where one has no
    /// such sampler, it is left out.
    pub fn sampler(mut self, binding: impl Into<Cow<'static, str>>, sampler: SamplerDesc) -> Self {
        self.call.samplers.push((binding.into(), sampler));
        self
    }

    /// Sets a member of the kernel's uniform block.
    pub fn set(
        mut self,
        member: impl Into<Cow<'static, str>>,
        value: impl Into<UniformValue>,
    ) -> Self {
        self.call.uniforms.push((member.into(), value.into()));
        self
    }

    /// Sets one of the kernel's `override` constants, which makes a kernel of
    /// its own: for choices that rarely change.
    pub fn constant(mut self, name: impl Into<Cow<'static, str>>, value: f64) -> Self {
        self.call.kernel.constants.push((name.into(), value));
        self
    }

    /// Sets a feature that the kernel's `@if` conditions ask for, which makes a
    /// kernel of its own.
    pub fn feature(mut self, name: impl Into<Cow<'static, str>>, enabled: bool) -> Self {
        self.call.kernel.features.push((name.into(), enabled));
        self
    }

    /// Runs one invocation per texel (and layer or slice) of the texture bound
    /// as `binding`, and returns that texture's new version.
    ///
    /// # Errors
    /// If the declaration contradicts the graph or itself; see [`GraphError`].
    pub fn per_texel(self, binding: impl Into<Cow<'static, str>>) -> Result<Texture, GraphError> {
        let binding = binding.into();
        self.per_texel_of(binding.clone())?.texture(&binding)
    }

    /// As [`per_texel`](Self::per_texel), for passes that write several things,
    /// or whose size is that of something they only read.
    ///
    /// # Errors
    /// As for [`per_texel`](Self::per_texel).
    pub fn per_texel_of(
        self,
        binding: impl Into<Cow<'static, str>>,
    ) -> Result<Written, GraphError> {
        let binding = binding.into();
        let is_texture = |access: &Access| {
            matches!(
                self.graph
                    .resources
                    .get(access.resource as usize)
                    .map(|r| r.desc),
                Some(ResourceDesc::Texture(_))
            )
        };
        if !self
            .accesses
            .iter()
            .any(|access| access.binding == binding && is_texture(access))
        {
            return Err(GraphError::NoSuchWrite {
                pass: self.name,
                what: "texture",
                binding: binding.into_owned(),
                writes: list(self.accesses.iter().map(|access| access.binding.as_ref())),
            });
        }
        self.dispatch(Dispatch::PerTexel(binding))
    }

    /// Runs the kernel once for each mip below the first, reading the mip above
    /// as `source` and writing the mip as `target`, one invocation per texel
    /// written. Each mip is a pass of its own, named after it.
    ///
    /// # Errors
    /// As for [`per_texel`](Self::per_texel).
    pub fn per_mip(
        self,
        source: impl Into<Cow<'static, str>>,
        target: impl Into<Cow<'static, str>>,
        texture: Texture,
    ) -> Result<Texture, GraphError> {
        let (source, target) = (source.into(), target.into());
        let mips = self.graph.desc(texture).mips;
        let mut newest = texture;
        for mip in 1..mips {
            let pass = ComputePass {
                graph: &mut *self.graph,
                name: format!("{} mip {mip}", self.name),
                call: self.call.clone(),
                accesses: self.accesses.clone(),
            };
            newest = pass
                .read(source.clone(), newest.mip(mip - 1))
                .write(target.clone(), newest.mip(mip))
                .per_texel(target.clone())?;
        }
        Ok(newest)
    }

    /// Runs so many workgroups in x, y and z.
    ///
    /// # Errors
    /// If the declaration contradicts the graph or itself; see [`GraphError`].
    pub fn groups(self, groups: [u32; 3]) -> Result<Written, GraphError> {
        self.dispatch(Dispatch::Fixed(groups))
    }

    /// Runs as many workgroups as the three `u32` at `offset` of `arguments` say.
    ///
    /// # Errors
    /// If the declaration contradicts the graph or itself; see [`GraphError`].
    pub fn indirect(mut self, arguments: Buffer, offset: u64) -> Result<Written, GraphError> {
        self.accesses.push(buffer(
            "indirect arguments",
            arguments,
            AccessKind::Indirect,
        ));
        self.dispatch(Dispatch::Indirect { offset })
    }

    /// Runs one workgroup per tile of a list bound as `binding`: a buffer whose
    /// first three `u32` are the workgroup counts and whose rest the kernel
    /// that wrote it and this one agree on.
    ///
    /// # Errors
    /// If the declaration contradicts the graph or itself; see [`GraphError`].
    pub fn per_tile(
        self,
        binding: impl Into<Cow<'static, str>>,
        tiles: Buffer,
    ) -> Result<Written, GraphError> {
        self.read_buffer(binding, tiles).indirect(tiles, 0)
    }

    fn dispatch(self, dispatch: Dispatch) -> Result<Written, GraphError> {
        let call = self.call.settled(&self.name)?;
        let work = Work::Compute { call, dispatch };
        declare(self.graph, self.name, work, self.accesses)
    }
}
