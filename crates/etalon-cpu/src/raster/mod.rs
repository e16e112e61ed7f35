//! Drawing triangles: vertex and fragment kernels on the interpreter, and a
//! rasteriser between them.
//!
//! A draw goes through these stages, each on all workers:
//!
//! 1. [`vertex`]: the vertex kernel, once for each distinct index of each instance.
//! 2. [`setup`]: triangles in the order they are given, culled, [clipped](clip)
//!    where they must be, their corners moved to 1/256 of a pixel, sorted into
//!    tiles of 64×64 pixels.
//! 3. [`tile`]: each tile by one worker, its triangles in their order: which
//!    pixels are covered, by exact integers, and their depth test.
//! 4. [`shade`]: the fragment kernel on batches of quads of 2×2 pixels from as many
//!    triangles as it takes to fill them; [`merge`] blends and stores.
//!
//! Conventions are those of [`etalon_core::raster`]. Numbers of vertices, planes and
//! blending are `f32`; [`planes`] says in which order they are computed, and why.
//! Results have the same bits at any number of threads and on every [`Tier`].
//!
//! Where triangles are is computed in `f32`, whatever the executor's
//! [number type](crate::NumberType), or another type would see other pixels covered:
//! so are vertex kernels, and what is interpolated. Fragment kernels compute in the
//! number type, from `f32` inputs, and give the nearest `f32` to blending and stores: a
//! wide plane of a target gets the values of its texels. The
//! [sanitiser](crate::sanitise) follows both kernels; [checks](crate::Checks) and
//! profiles do not watch them.

// Loops over lanes are by index, as in `exec`: what they compile to is what counts.
#![allow(clippy::needless_range_loop)]

mod clip;
mod depth;
mod draw;
mod error;
mod indices;
mod interface;
mod merge;
mod planes;
mod setup;
mod shade;
mod tile;
mod vertex;
mod watch;

use std::fmt;

use etalon_core::Format;
use etalon_core::format::{Encoding, SampleKind};
use etalon_core::raster::{
    BlendFactor, IndexFormat, MAX_COLOUR_TARGETS, RasterState, RasterStateError, Scissor,
    VertexLayout, Viewport,
};
use naga::valid::ModuleInfo;
use naga::{Module, ShaderStage, Span};

pub use error::RasterError;
pub(crate) use watch::DrawWatch;
pub use watch::{DrawReport, DrawSanitised};

use self::interface::Feeds;
use crate::binding::BindingInfo;
use crate::code::Code;
use crate::error::{Location, RunError, TranslateError};
use crate::exec::Links;
use crate::ir::{Input, Op, StageInput, StageOutput};
use crate::lower;
use crate::memory::{Buffer, TextureView};
use crate::program::{BoundResource, TranslateOptions, explain_fail, locate_in};
use crate::translate::{self, Fail, StageKind, Translation};

/// What a raster program is made of beside its module.
#[derive(Clone, Copy, Debug)]
pub struct RasterDesc<'a> {
    /// The `@vertex` entry point.
    pub vertex: &'a str,
    /// The `@fragment` entry point; without one only depth is drawn.
    pub fragment: Option<&'a str>,
    /// What vertex buffers hold. Inputs of the vertex kernel are found by the names
    /// of their attributes.
    pub layouts: &'a [VertexLayout],
    /// Everything else about draws.
    pub state: &'a RasterState,
    /// Formats of the colour targets, by location.
    pub colours: &'a [Format],
    /// Format of the depth target: Depth32Float or Depth16Unorm.
    pub depth: Option<Format>,
    /// Whether the [sanitiser](crate::sanitise) follows what the kernels compute, in
    /// draws of [`NumberType::Shadow`](crate::NumberType::Shadow).
    pub sanitise: bool,
}

/// Two kernels that draw triangles, as bytecode.
///
/// [`Display`](fmt::Display) lists the code.
///
/// * A position that is not finite takes its triangles with it.
/// * Of triangle strips with an odd number the last two corners are exchanged, as
///   Vulkan has it (§21.1.4): the first one, which flat inputs are of, stays.
/// * `dpdx` and `dpdy` are the fine ones, of the two fragments in the same row or
///   column of a quad; the coarse ones are the differences from a quad's upper left
///   fragment, which implicit levels of detail are made of as well.
/// * A vertex beyond the end of a buffer is read as zeros where an index leads there,
///   as robust access has it (WebGPU, §23.2.2): indices are data. A draw whose
///   ranges themselves reach beyond their buffers is refused.
/// * Where a fragment kernel writes memory, tiles are drawn one after the other by
///   one worker, so that the order is always the same.
pub struct RasterProgram {
    name: String,
    bindings: Vec<BindingInfo>,
    immediates: u32,
    feeds: Feeds,
    buffers: usize,
    vertex: StageProgram,
    fragment: Option<StageProgram>,
    state: RasterState,
    colours: Vec<Format>,
    depth: Option<Format>,
    locate: Locate,
}

/// Where a module's spans are in the source.
type Locate = Box<dyn Fn(Span) -> Location + Send + Sync>;

/// A kernel of one stage.
struct StageProgram {
    code: Code,
    links: Links,
    /// Slots of the inputs that the code reads.
    inputs: Vec<(usize, StageInput)>,
    /// Whether it writes memory.
    writes: bool,
}

impl StageProgram {
    fn new(code: Code) -> Self {
        let mut inputs = Vec::new();
        for inst in &code.insts {
            if let Op::Input(Input::Stage(slot)) = inst.op {
                let slot = usize::from(slot);
                if let Some(&input) = code.resources.stage.inputs.get(slot)
                    && !inputs.contains(&(slot, input))
                {
                    inputs.push((slot, input));
                }
            }
        }
        let writes = code.insts.iter().any(|inst| is_write(inst.op));
        Self {
            code,
            links: Links::default(),
            inputs,
            writes,
        }
    }

    fn output(&self, output: StageOutput) -> Option<usize> {
        self.code.resources.stage.output(output)
    }
}

fn is_write(op: Op) -> bool {
    matches!(
        op,
        Op::BufferStore { .. }
            | Op::BufferStoreHalf { .. }
            | Op::BufferAtomic { .. }
            | Op::ImageStore { .. }
            | Op::ImageAtomic { .. }
    )
}

/// A vertex buffer.
#[derive(Clone, Copy, Debug)]
pub struct VertexBuffer<'a> {
    /// The bytes.
    pub buffer: &'a Buffer,
    /// Where the first element is, in bytes: a multiple of 4.
    pub offset: u64,
}

/// An index buffer.
#[derive(Clone, Copy, Debug)]
pub struct IndexBuffer<'a> {
    /// The bytes.
    pub buffer: &'a Buffer,
    /// Where the first index is, in bytes: a multiple of an index's.
    pub offset: u64,
    /// How indices are stored.
    pub format: IndexFormat,
}

/// Which vertices of which instances are drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DrawRange {
    /// The first vertex, or the first index.
    pub first: u32,
    /// How many of them.
    pub count: u32,
    /// Added to indices; 0 without any.
    pub base_vertex: i32,
    /// The first instance.
    pub first_instance: u32,
    /// How many of them.
    pub instances: u32,
}

impl DrawRange {
    /// So many vertices, or indices, once.
    #[must_use]
    pub const fn of(count: u32) -> Self {
        Self {
            first: 0,
            count,
            base_vertex: 0,
            first_instance: 0,
            instances: 1,
        }
    }
}

/// One draw.
#[derive(Clone, Debug)]
pub struct RasterDraw<'a> {
    /// One for each layout.
    pub vertex_buffers: &'a [VertexBuffer<'a>],
    /// Without it vertices are drawn in their order.
    pub indices: Option<IndexBuffer<'a>>,
    /// What is drawn.
    pub range: DrawRange,
    /// Where clip space goes; nothing is drawn outside of it.
    pub viewport: Viewport,
    /// Nothing is drawn outside of it.
    pub scissor: Scissor,
    /// In the order of [`RasterProgram::bindings`].
    pub resources: &'a [BoundResource<'a>],
    /// Bytes of the kernels' `var<immediate>`.
    pub immediates: &'a [u8],
    /// One for each of the program's colour formats: of the first level of one layer.
    pub colours: &'a [TextureView<'a>],
    /// If the program has a depth format.
    pub depth: Option<&'a TextureView<'a>>,
}

/// What a draw did.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct DrawCounters {
    /// Vertices the vertex kernel was run for.
    pub vertices: u64,
    /// Triangles given.
    pub primitives: u64,
    /// Triangles left after culling, and parts of those that were clipped.
    pub triangles: u64,
    /// Quads the fragment kernel was run for.
    pub quads: u64,
}

impl RasterProgram {
    /// Translates the entry points of a validated module, whose overrides are
    /// resolved. `source` is the WGSL it was parsed from, for error messages.
    ///
    /// # Errors
    /// [`RasterError`] if a kernel uses what the interpreter does not have, or
    /// kernels, layouts, state and targets do not fit each other.
    pub fn from_module(
        name: &str,
        source: &str,
        module: &Module,
        info: &ModuleInfo,
        desc: &RasterDesc<'_>,
    ) -> Result<Self, RasterError> {
        let locate = Box::new(locate_in(name.to_owned(), source.to_owned()));
        Self::new(name.to_owned(), locate, module, info, desc)
    }

    /// [`RasterProgram::from_module`] for a module whose spans `locate` knows.
    ///
    /// # Errors
    /// As [`RasterProgram::from_module`].
    pub fn new(
        name: String,
        locate: Box<dyn Fn(Span) -> Location + Send + Sync>,
        module: &Module,
        info: &ModuleInfo,
        desc: &RasterDesc<'_>,
    ) -> Result<Self, RasterError> {
        let vertex = entry_point(&name, module, desc.vertex, ShaderStage::Vertex)?;
        let fragment = desc
            .fragment
            .map(|fragment| entry_point(&name, module, fragment, ShaderStage::Fragment))
            .transpose()?;
        let function = |index: usize| &module.entry_points[index].function;
        let feeds = interface::feeds(&name, module, function(vertex), desc.layouts)?;
        interface::check_position(&name, module, function(vertex))?;
        if let Some(fragment) = fragment {
            interface::check_varyings(&name, module, function(vertex), function(fragment))?;
        }
        check_targets(&name, module, fragment.map(function), desc)?;
        let options = TranslateOptions {
            sanitise: desc.sanitise,
            ..TranslateOptions::default()
        };
        let translate = |entry: usize, other: Option<usize>, kind: StageKind<'_>| {
            let others: Vec<usize> = other.into_iter().collect();
            translate::translate_stage(module, info, entry, &others, kind, &options)
        };
        let explain = |(fail, span): (Fail, Span)| explain_fail(&name, &*locate, fail, span);
        let compile = |translation: Translation| {
            let flat = lower::lower(translation.tree, false);
            let code = Code::new(&flat, &lower::allocate(&flat))
                .map_err(|fail| explain((fail, Span::default())))?;
            Ok::<_, TranslateError>(StageProgram::new(code))
        };
        let (mut bindings, mut immediates) = (Vec::new(), None);
        let mut fragment_program = None;
        if let Some(fragment) = fragment {
            let kind = StageKind::Fragment {
                targets: desc.colours.len() as u32,
            };
            let mut translation = translate(fragment, Some(vertex), kind).map_err(explain)?;
            bindings = std::mem::take(&mut translation.bindings);
            immediates = translation.immediates;
            fragment_program = Some(compile(translation)?);
        }
        let wanted: Vec<StageInput> = fragment_program
            .iter()
            .flat_map(|program: &StageProgram| program.inputs.iter().map(|(_, input)| *input))
            .collect();
        let kind = StageKind::Vertex {
            attributes: &feeds.locations,
            wanted: &wanted,
        };
        let mut translation = translate(vertex, fragment, kind).map_err(explain)?;
        if fragment_program.is_none() {
            bindings = std::mem::take(&mut translation.bindings);
            immediates = translation.immediates;
        }
        let vertex_program = compile(translation)?;
        if let Some(inst) = vertex_program
            .code
            .insts
            .iter()
            .find(|inst| is_write(inst.op))
        {
            let what = "memory that vertex kernels write";
            return Err(explain((Fail::unsupported(what), inst.span)).into());
        }
        Ok(Self {
            name,
            bindings,
            immediates: immediates.unwrap_or(0),
            feeds,
            buffers: desc.layouts.len(),
            vertex: vertex_program,
            fragment: fragment_program,
            state: desc.state.clone(),
            colours: desc.colours.to_vec(),
            depth: desc.depth,
            locate,
        })
    }

    /// The program's name.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }

    /// What must be bound, in the order of [`RasterDraw::resources`]: what either
    /// kernel uses.
    #[must_use]
    pub fn bindings(&self) -> &[BindingInfo] {
        &self.bindings
    }

    /// Bytes of the kernels' `var<immediate>`, 0 without one.
    #[must_use]
    pub fn immediate_size(&self) -> u32 {
        self.immediates
    }

    fn out_of_memory(&self, bytes: u64) -> RasterError {
        RunError::OutOfMemory {
            what: format!("a draw of {}", self.name),
            bytes,
        }
        .into()
    }

    /// So much room in a list, or an error that says how much was wanted.
    fn reserve<T>(&self, list: &mut Vec<T>, more: usize) -> Result<(), RasterError> {
        list.try_reserve(more).map_err(|_| {
            let bytes = (more as u64).saturating_mul(size_of::<T>() as u64);
            self.out_of_memory(bytes)
        })
    }
}

fn entry_point(
    name: &str,
    module: &Module,
    entry_point: &str,
    stage: ShaderStage,
) -> Result<usize, RasterError> {
    let mut entries = module.entry_points.iter();
    let found = entries.position(|entry| entry.name == entry_point && entry.stage == stage);
    found.ok_or_else(|| RasterError::Interface {
        name: name.to_owned(),
        what: format!("the entry point `{entry_point}`"),
        expected: format!("in the module, of the stage {stage:?}"),
        found: "missing".to_owned(),
    })
}

/// Whether a format can be drawn to: all but depth, and those with a shared exponent,
/// whose channels cannot be written one by one (Vulkan 1.3, §48.3).
fn is_colour(format: Format) -> bool {
    format.sample_kind() != SampleKind::Depth && format.encoding() != Encoding::SharedExponent
}

/// Checks the targets and the state against each other and the fragment kernel.
fn check_targets(
    name: &str,
    module: &Module,
    fragment: Option<&naga::Function>,
    desc: &RasterDesc<'_>,
) -> Result<(), RasterError> {
    let state = |error: RasterStateError| RasterError::State {
        name: name.to_owned(),
        error,
    };
    let interface = |what: &str, expected: String, found: String| RasterError::Interface {
        name: name.to_owned(),
        what: what.to_owned(),
        expected,
        found,
    };
    let format = |what: String, format: Format, purpose| RasterError::Format {
        name: name.to_owned(),
        what,
        format,
        purpose,
    };
    desc.state.validate(desc.colours.len()).map_err(state)?;
    if desc.colours.len() > MAX_COLOUR_TARGETS {
        return Err(interface(
            "the number of colour targets",
            format!("at most {MAX_COLOUR_TARGETS}"),
            desc.colours.len().to_string(),
        ));
    }
    if desc.colours.is_empty() && desc.depth.is_none() {
        return Err(interface(
            "the number of targets",
            "at least one, of colour or depth".to_owned(),
            "0".to_owned(),
        ));
    }
    if let Some(depth) = desc.depth
        && !matches!(depth, Format::Depth32Float | Format::Depth16Unorm)
    {
        return Err(format("the depth target".to_owned(), depth, "tested"));
    }
    if desc.depth.is_none() {
        let asks = if desc.state.depth.is_some() {
            Some("the state's depth test")
        } else {
            fragment
                .filter(|fragment| interface::gives_depth(module, fragment))
                .map(|_| "the fragment kernel's `@builtin(frag_depth)`")
        };
        if let Some(what) = asks {
            return Err(interface(
                what,
                "in a pass with a depth target".to_owned(),
                "in one without".to_owned(),
            ));
        }
    }
    for (i, &colour) in desc.colours.iter().enumerate() {
        let what = || format!("colour target {i}");
        let target = desc.state.target(i);
        if !is_colour(colour) {
            return Err(format(what(), colour, "drawn to"));
        }
        let is_integer = matches!(colour.sample_kind(), SampleKind::Uint | SampleKind::Sint);
        if target.blend.is_some() && is_integer {
            return Err(format(what(), colour, "blended"));
        }
        let needs_alpha = target.blend.is_some_and(|blend| {
            [blend.colour, blend.alpha].iter().any(|part| {
                [part.source, part.target].iter().any(|factor| {
                    let of_alpha = [BlendFactor::SourceAlpha, BlendFactor::OneMinusSourceAlpha];
                    of_alpha.contains(factor)
                })
            })
        });
        let writes = target.writes;
        if writes.red || writes.green || writes.blue || writes.alpha {
            interface::check_target(name, module, fragment, i, colour, needs_alpha)?;
        }
    }
    Ok(())
}

impl fmt::Display for RasterProgram {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (i, binding) in self.bindings.iter().enumerate() {
            writeln!(f, "; b{i} = {} {:?}", binding.name, binding.kind)?;
        }
        let stages = [
            ("vertex", Some(&self.vertex)),
            ("fragment", self.fragment.as_ref()),
        ];
        for (stage, program) in stages {
            if let Some(program) = program {
                writeln!(f, "; {} ({stage})", self.name)?;
                let slots = &program.code.resources.stage;
                for (i, input) in slots.inputs.iter().enumerate() {
                    writeln!(f, "; stage.{i} = {input:?}")?;
                }
                for (i, output) in slots.outputs.iter().enumerate() {
                    writeln!(f, "; give.{i} = {output:?}")?;
                }
                write!(f, "{}", program.code)?;
            }
        }
        Ok(())
    }
}

impl fmt::Debug for RasterProgram {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("RasterProgram")
            .field("name", &self.name)
            .finish_non_exhaustive()
    }
}
