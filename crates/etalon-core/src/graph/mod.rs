//! The effect IR: a graph of passes over versioned textures and buffers.
//!
//! A [`Graph`] is a declaration and nothing more. Building one parses no
//! shader and allocates no device memory; that happens for what survives
//! [planning](crate::plan). An effect is a function that takes a graph and
//! input handles and returns output handles:
//!
//! ```
//! use etalon_core::{Format, graph::{Graph, GraphError, Texture}};
//!
//! fn darken(graph: &mut Graph, source: Texture, amount: f32) -> Result<Texture, GraphError> {
//!     let target = graph.texture("darkened", graph.desc(source));
//!     graph
//!         .compute("example/darken")
//!         .read("source", source)
//!         .write("result", target)
//!         .set("amount", amount)
//!         .per_texel("result")
//! }
//! ```
//!
//! # Versions
//! Every write to a resource returns a new handle. A pass that reads a handle
//! runs after the passes that wrote that version and before any pass that
//! writes over it; no other ordering is ever needed. Versions are tracked per
//! mip and layer, so writing one mip leaves the others as they were.
//!
//! # Reads, writes and updates
//! `read` wants the contents. `write` replaces *all* contents of the mips and
//! layers it names: what was there before is not kept, and a texel the kernel
//! does not write is undefined. `update` reads and writes in place.

mod decision;
mod error;
mod handle;
mod pass;
mod raster;
mod uniform;

use std::borrow::Cow;
use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};

use serde::Serialize;

pub use decision::Decision;
pub use error::GraphError;
pub(crate) use handle::GraphId;
pub use handle::{Buffer, Subresources, Texture, TextureView};
pub(crate) use pass::{Access, AccessKind, Dispatch, KernelCall, Pass, Work};
pub use pass::{ComputePass, Written};
pub(crate) use raster::{DeclaredDraw, Extent, RasterWork, Slice};
pub use raster::{Draw, Load, RasterPass};
pub use uniform::UniformValue;

use crate::format::{Format, SampleKind};
use crate::resource::{BufferDesc, MAX_LAYERS, MAX_MIPS, TextureDesc};
use crate::texel::Texel;

/// A texture's or a buffer's description.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize)]
pub enum ResourceDesc {
    /// A texture.
    Texture(TextureDesc),
    /// A buffer.
    Buffer(BufferDesc),
}

impl ResourceDesc {
    /// Mips and layers, each 1 for a buffer.
    ///
    /// Counts that no texture can have are cut to the most one can: planning
    /// refuses such a texture, and until then it must not cost memory.
    pub(crate) fn subresources(&self) -> (u32, u32) {
        match self {
            Self::Texture(desc) => (
                desc.mips.clamp(1, MAX_MIPS),
                desc.layers().clamp(1, MAX_LAYERS),
            ),
            Self::Buffer(_) => (1, 1),
        }
    }
}

/// What every texel of a cleared texture holds.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub enum ClearValue {
    /// For float, normalised and depth formats.
    Float([f32; 4]),
    /// For signed integer formats.
    Sint([i32; 4]),
    /// For unsigned integer formats.
    Uint([u32; 4]),
}

impl ClearValue {
    /// The nearest value that texels of a format hold: drivers round otherwise.
    pub(crate) fn rounded(self, format: Format) -> Self {
        let texel = match self {
            Self::Float(value) => Texel::Float(value),
            Self::Sint(value) => Texel::Sint(value),
            Self::Uint(value) => Texel::Uint(value),
        };
        let held = format.decode_codes(format.encode_codes(texel));
        // Channels that are not there stay as they are.
        let there = 0..format.channels() as usize;
        let mut rounded = self;
        match (&mut rounded, held) {
            (Self::Float(value), Texel::Float(held)) => {
                value[there.clone()].copy_from_slice(&held[there]);
            }
            (Self::Sint(value), Texel::Sint(held)) => {
                value[there.clone()].copy_from_slice(&held[there]);
            }
            (Self::Uint(value), Texel::Uint(held)) => {
                value[there.clone()].copy_from_slice(&held[there]);
            }
            _ => {}
        }
        rounded
    }

    /// All channels zero, in the kind that the format takes.
    #[must_use]
    pub const fn zero(kind: SampleKind) -> Self {
        match kind {
            SampleKind::Float | SampleKind::Depth => Self::Float([0.0; 4]),
            SampleKind::Sint => Self::Sint([0; 4]),
            SampleKind::Uint => Self::Uint([0; 4]),
        }
    }

    const fn fits(&self, kind: SampleKind) -> bool {
        matches!(
            (self, kind),
            (Self::Float(_), SampleKind::Float | SampleKind::Depth)
                | (Self::Sint(_), SampleKind::Sint)
                | (Self::Uint(_), SampleKind::Uint)
        )
    }

    const fn kind(&self) -> &'static str {
        match self {
            Self::Float(_) => "floats",
            Self::Sint(_) => "signed integers",
            Self::Uint(_) => "unsigned integers",
        }
    }
}

impl std::hash::Hash for ClearValue {
    fn hash<H: std::hash::Hasher>(&self, state: &mut H) {
        std::mem::discriminant(self).hash(state);
        match self {
            Self::Float(v) => v.map(f32::to_bits).hash(state),
            Self::Sint(v) => v.hash(state),
            Self::Uint(v) => v.hash(state),
        }
    }
}

/// Where a resource's first contents come from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) enum Origin {
    Transient,
    Import,
    HistoryPrevious(u32),
    HistoryCurrent(u32),
}

/// Who wrote each mip and layer of one version: `None` is nobody in this graph.
pub(crate) type Writers = Arc<[Option<u32>]>;

#[derive(Debug)]
pub(crate) struct Resource {
    pub(crate) name: String,
    pub(crate) desc: ResourceDesc,
    pub(crate) origin: Origin,
    /// Indexed by version.
    pub(crate) versions: Vec<Writers>,
}

impl Resource {
    /// Whether the contents of version 0 are defined.
    pub(crate) fn has_contents(&self) -> bool {
        matches!(self.origin, Origin::Import | Origin::HistoryPrevious(_))
    }
}

/// A texture that lives across frames, as this frame sees it.
///
/// This frame reads what the last one wrote, and writes what the next will
/// read. If `previous` is read by anything that runs, `current` must be
/// written.
#[derive(Clone, Copy, Debug)]
pub struct History {
    /// What the last frame wrote, or the initial value in the first frame.
    pub previous: Texture,
    /// What the next frame will read; nothing is in it yet.
    pub current: Texture,
}

#[derive(Debug)]
pub(crate) struct HistoryPair {
    pub(crate) name: String,
    pub(crate) previous: u32,
    pub(crate) current: u32,
    pub(crate) initial: ClearValue,
}

#[derive(Debug)]
pub(crate) struct Output {
    pub(crate) name: String,
    pub(crate) resource: u32,
    pub(crate) version: u32,
}

/// Passes and the resources they use. See the [module documentation](self).
#[derive(Debug)]
pub struct Graph {
    id: GraphId,
    pub(crate) resources: Vec<Resource>,
    pub(crate) passes: Vec<Pass>,
    pub(crate) outputs: Vec<Output>,
    pub(crate) histories: Vec<HistoryPair>,
    pub(crate) decisions: BTreeMap<String, Decision>,
    imports: BTreeSet<String>,
    pass_names: HashMap<String, u32>,
    resource_names: HashMap<String, u32>,
}

impl Default for Graph {
    fn default() -> Self {
        Self::new()
    }
}

/// Makes a name unique by counting repetitions: `blur`, `blur#2`, `blur#3`.
fn unique(names: &mut HashMap<String, u32>, name: String) -> String {
    let count = names.entry(name.clone()).or_insert(0);
    *count += 1;
    if *count == 1 {
        name
    } else {
        format!("{name}#{count}")
    }
}

impl Graph {
    /// An empty graph.
    #[must_use]
    pub fn new() -> Self {
        static NEXT: AtomicU32 = AtomicU32::new(0);
        Self {
            id: GraphId(NEXT.fetch_add(1, Ordering::Relaxed)),
            resources: Vec::new(),
            passes: Vec::new(),
            outputs: Vec::new(),
            histories: Vec::new(),
            decisions: BTreeMap::new(),
            imports: BTreeSet::new(),
            pass_names: HashMap::new(),
            resource_names: HashMap::new(),
        }
    }

    fn add(&mut self, name: String, desc: ResourceDesc, origin: Origin) -> u32 {
        let name = unique(&mut self.resource_names, name);
        let (mips, layers) = desc.subresources();
        let count = (mips * layers) as usize;
        let index = self.resources.len() as u32;
        self.resources.push(Resource {
            name,
            desc,
            origin,
            versions: vec![vec![None; count].into()],
        });
        index
    }

    fn import(&mut self, name: &str, desc: ResourceDesc) -> Result<u32, GraphError> {
        if !self.imports.insert(name.to_owned()) {
            return Err(GraphError::DuplicateName {
                what: "import",
                name: name.to_owned(),
            });
        }
        Ok(self.add(name.to_owned(), desc, Origin::Import))
    }

    /// A texture that the caller provides under `name` when the plan runs.
    ///
    /// # Errors
    /// If the name is taken by another import.
    pub fn import_texture(&mut self, name: &str, desc: TextureDesc) -> Result<Texture, GraphError> {
        let resource = self.import(name, ResourceDesc::Texture(desc))?;
        Ok(Texture {
            graph: self.id,
            resource,
            version: 0,
        })
    }

    /// A buffer that the caller provides under `name` when the plan runs.
    ///
    /// # Errors
    /// If the name is taken by another import.
    pub fn import_buffer(&mut self, name: &str, desc: BufferDesc) -> Result<Buffer, GraphError> {
        let resource = self.import(name, ResourceDesc::Buffer(desc))?;
        Ok(Buffer {
            graph: self.id,
            resource,
            version: 0,
        })
    }

    /// A texture that lives within the frame and holds nothing yet. Its memory
    /// may be shared with others that live at other times.
    pub fn texture(&mut self, name: impl Into<String>, desc: TextureDesc) -> Texture {
        let resource = self.add(name.into(), ResourceDesc::Texture(desc), Origin::Transient);
        Texture {
            graph: self.id,
            resource,
            version: 0,
        }
    }

    /// A buffer that lives within the frame and holds nothing yet.
    pub fn buffer(&mut self, name: impl Into<String>, desc: BufferDesc) -> Buffer {
        let resource = self.add(name.into(), ResourceDesc::Buffer(desc), Origin::Transient);
        Buffer {
            graph: self.id,
            resource,
            version: 0,
        }
    }

    /// A texture that lives across frames under `name`.
    ///
    /// Its contents last as long as every frame's plan uses a history of this
    /// name and description; otherwise it starts again from `initial`.
    ///
    /// # Errors
    /// If the name is taken by another history, or `initial` does not suit the format.
    pub fn history(
        &mut self,
        name: &str,
        desc: TextureDesc,
        initial: ClearValue,
    ) -> Result<History, GraphError> {
        if self.histories.iter().any(|history| history.name == name) {
            return Err(GraphError::DuplicateName {
                what: "history",
                name: name.to_owned(),
            });
        }
        if !initial.fits(desc.format.sample_kind()) {
            return Err(GraphError::ClearMismatch {
                pass: format!("history `{name}`"),
                format: desc.format.to_string(),
                value: initial.kind(),
            });
        }
        let index = self.histories.len() as u32;
        let desc = ResourceDesc::Texture(desc);
        let previous = self.add(
            format!("{name}.previous"),
            desc,
            Origin::HistoryPrevious(index),
        );
        let current = self.add(
            format!("{name}.current"),
            desc,
            Origin::HistoryCurrent(index),
        );
        self.histories.push(HistoryPair {
            name: name.to_owned(),
            previous,
            current,
            initial,
        });
        let handle = |resource| Texture {
            graph: self.id,
            resource,
            version: 0,
        };
        Ok(History {
            previous: handle(previous),
            current: handle(current),
        })
    }

    /// Notes what was decided of an effect, for the plan to tell. A later decision
    /// takes the place of an earlier one.
    ///
    /// An effect is known by what its passes' names begin with: `ssr` of `ssr/march`.
    /// Of a part of one, such as `forward/glass`, can be decided by itself.
    pub fn decide(&mut self, effect: impl Into<String>, decision: Decision) {
        self.decisions.insert(effect.into(), decision);
    }

    /// The description behind a handle.
    ///
    /// A handle of another graph yields the smallest texture there is; using
    /// such a handle in a pass is a [`GraphError::ForeignHandle`].
    #[must_use]
    pub fn desc(&self, texture: Texture) -> TextureDesc {
        match self
            .resources
            .get(texture.resource as usize)
            .map(|resource| resource.desc)
        {
            Some(ResourceDesc::Texture(desc)) if texture.graph == self.id => desc,
            _ => TextureDesc::d2(1, 1, crate::Format::R8Unorm),
        }
    }

    /// Declares a compute pass with the kernel at `path`, e.g. `bloom/threshold`
    /// for `shaders/bloom/threshold.wesl`. The pass is named like its kernel
    /// unless [`named`](ComputePass::named) otherwise.
    pub fn compute(&mut self, path: impl Into<Cow<'static, str>>) -> ComputePass<'_> {
        ComputePass::new(self, path.into())
    }

    /// Declares a raster pass: draws into colour and depth targets.
    ///
    /// ```
    /// use etalon_core::Format;
    /// use etalon_core::graph::{Buffer, ClearValue, Draw, Graph, GraphError, Load, Texture};
    /// use etalon_core::raster::{DepthState, RasterState, VertexFormat, VertexLayout};
    /// use etalon_core::resource::TextureDesc;
    ///
    /// fn silhouette(graph: &mut Graph, positions: Buffer) -> Result<Texture, GraphError> {
    ///     let colour = graph.texture("colour", TextureDesc::d2(640, 360, Format::Rgba8Unorm));
    ///     let depth = graph.texture("depth", TextureDesc::d2(640, 360, Format::Depth32Float));
    ///     let draw = Draw::new("example/silhouette")
    ///         .vertices(positions, 0, VertexLayout::packed("position", VertexFormat::Float32x3))
    ///         .elements(0..36)
    ///         .state(RasterState {
    ///             depth: Some(DepthState::REVERSED),
    ///             ..RasterState::default()
    ///         })
    ///         .set("tint", glam::Vec4::new(1.0, 0.5, 0.0, 1.0));
    ///     graph
    ///         .raster("silhouette")
    ///         .colour("colour", colour, Load::Clear(ClearValue::Float([0.0; 4])))
    ///         .depth(depth, Load::Clear(ClearValue::Float([0.0; 4])))
    ///         .draw(draw)
    ///         .finish()?
    ///         .texture("colour")
    /// }
    /// ```
    pub fn raster(&mut self, name: impl Into<String>) -> RasterPass<'_> {
        RasterPass::new(self, name.into())
    }

    /// Fills a texture's mips and layers with one value.
    ///
    /// # Errors
    /// If the value does not suit the format or the view is no part of the texture.
    pub fn clear(
        &mut self,
        target: impl Into<TextureView>,
        value: ClearValue,
    ) -> Result<Texture, GraphError> {
        let target = target.into();
        let format = self.desc(target.texture).format;
        let pass = format!(
            "clear {}",
            self.resource_name(target.texture.graph, target.texture.resource)
        );
        if !value.fits(format.sample_kind()) {
            return Err(GraphError::ClearMismatch {
                pass,
                format: format.to_string(),
                value: value.kind(),
            });
        }
        let written = pass::declare(
            self,
            pass,
            Work::ClearTexture(value),
            vec![pass::texture("target", target, AccessKind::CopyTarget)],
        )?;
        written.texture("target")
    }

    /// Copies the mips and layers of one texture to those of another.
    ///
    /// # Errors
    /// If formats or sizes differ or a view is no part of its texture.
    pub fn copy(
        &mut self,
        source: impl Into<TextureView>,
        target: impl Into<TextureView>,
    ) -> Result<Texture, GraphError> {
        let (source, target) = (source.into(), target.into());
        let name =
            |view: TextureView| self.resource_name(view.texture.graph, view.texture.resource);
        let pass = format!("copy {} to {}", name(source), name(target));
        let shape = |view: TextureView| {
            let desc = self.desc(view.texture);
            let range = view.range.resolve(desc.mips, desc.layers());
            let extent = desc.mip_extent(view.range.mip);
            (
                desc.format,
                desc.dimension,
                extent.width,
                extent.height,
                range.map(|range| (range.mips, range.layers)),
            )
        };
        let (from, to) = (shape(source), shape(target));
        if from != to {
            let text = |(format, dimension, width, height, parts): (
                _,
                _,
                u32,
                u32,
                Option<(u32, u32)>,
            )| {
                let (mips, layers) = parts.unwrap_or((0, 0));
                format!("{format} {dimension:?} {width}×{height} ({mips} mips, {layers} layers)")
            };
            return Err(GraphError::CopyMismatch {
                pass,
                source_shape: text(from),
                target_shape: text(to),
            });
        }
        let accesses = vec![
            pass::texture("source", source, AccessKind::CopySource),
            pass::texture("target", target, AccessKind::CopyTarget),
        ];
        pass::declare(self, pass, Work::CopyTexture, accesses)?.texture("target")
    }

    /// Fills a buffer with zeros.
    ///
    /// # Errors
    /// If the handle is foreign or stale.
    pub fn clear_buffer(&mut self, target: Buffer) -> Result<Buffer, GraphError> {
        let pass = format!(
            "clear {}",
            self.resource_name(target.graph, target.resource)
        );
        pass::declare(
            self,
            pass,
            Work::ClearBuffer,
            vec![pass::buffer("target", target, AccessKind::CopyTarget)],
        )?
        .buffer("target")
    }

    /// Copies one buffer to another of the same size.
    ///
    /// # Errors
    /// If the sizes differ or a handle is foreign or stale.
    pub fn copy_buffer(&mut self, source: Buffer, target: Buffer) -> Result<Buffer, GraphError> {
        let name = |buffer: Buffer| self.resource_name(buffer.graph, buffer.resource);
        let size = |buffer: Buffer| match self
            .resources
            .get(buffer.resource as usize)
            .map(|resource| resource.desc)
        {
            Some(ResourceDesc::Buffer(desc)) if buffer.graph == self.id => desc.bytes,
            _ => 0,
        };
        let pass = format!("copy {} to {}", name(source), name(target));
        if size(source) != size(target) {
            return Err(GraphError::CopyMismatch {
                pass,
                source_shape: format!("{} bytes", size(source)),
                target_shape: format!("{} bytes", size(target)),
            });
        }
        let accesses = vec![
            pass::buffer("source", source, AccessKind::CopySource),
            pass::buffer("target", target, AccessKind::CopyTarget),
        ];
        pass::declare(self, pass, Work::CopyBuffer, accesses)?.buffer("target")
    }

    /// Asks for a texture: the passes it needs will run, and it can be fetched
    /// by `name` afterwards.
    ///
    /// An import or a history can be asked for too. It stays what it is, so it
    /// can be captured, but a backend gives an engine no texture for it; copy it
    /// to one first if that is wanted.
    ///
    /// # Errors
    /// If the name is taken by another output, or nothing has written the texture.
    pub fn output(&mut self, name: &str, texture: Texture) -> Result<(), GraphError> {
        self.add_output(name, texture.graph, texture.resource, texture.version)
    }

    /// Asks for a buffer. See [`output`](Self::output).
    ///
    /// # Errors
    /// As for [`output`](Self::output).
    pub fn output_buffer(&mut self, name: &str, buffer: Buffer) -> Result<(), GraphError> {
        self.add_output(name, buffer.graph, buffer.resource, buffer.version)
    }

    fn add_output(
        &mut self,
        name: &str,
        graph: GraphId,
        resource: u32,
        version: u32,
    ) -> Result<(), GraphError> {
        if self.outputs.iter().any(|output| output.name == name) {
            return Err(GraphError::DuplicateName {
                what: "output",
                name: name.to_owned(),
            });
        }
        let access = Access {
            binding: Cow::Owned(name.to_owned()),
            draw: None,
            graph,
            resource,
            version,
            range: Subresources::ALL,
            kind: AccessKind::Read,
            written: None,
        };
        pass::check(self, &format!("output `{name}`"), &access)?;
        self.outputs.push(Output {
            name: name.to_owned(),
            resource,
            version,
        });
        Ok(())
    }

    pub(crate) fn resource_name(&self, graph: GraphId, resource: u32) -> &str {
        match self.resources.get(resource as usize) {
            Some(resource) if graph == self.id => &resource.name,
            _ => "?",
        }
    }
}
