//! A draw from beginning to end.

use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};

use etalon_core::Format;
use etalon_core::raster::{IndexFormat, RasterStateError, StepMode};
use etalon_core::resource::{Dimension, TextureDesc};

use super::depth::{TileDepth, is_monotonic};
use super::error::RasterError;
use super::indices::Assembly;
use super::merge::{Merge, Target};
use super::planes::{MAX_TARGET, ViewportMap};
use super::setup::{Chunk, Region, Setup, TILE};
use super::shade::{BatchLanes, Feed, Fill, QUADS, TILE_QUADS, apart};
use super::tile::{EarlyTest, Scan};
use super::vertex::{VertexRun, Vertices};
use super::{DrawCounters, DrawReport, DrawWatch, RasterDraw, RasterProgram, StageProgram};
use crate::error::RunError;
use crate::exec::{Executor, LocalIds, Resource, Stage, StageFailure, StageKernel, work};
use crate::ir::{StageInput, StageOutput};
use crate::memory::{Buffer, TextureView};
use crate::program::{check_binding, note_written};
use crate::registers::LANES;

/// Vertices of the instances that are drawn together, at most, unless one has more.
const MAX_VERTICES: usize = 1 << 20;

/// Triangles that are made ready before tiles are drawn.
const ROUND: usize = 1 << 17;

/// When fragments are tested.
#[derive(Clone, Copy, Debug)]
struct Tests {
    /// Before shading.
    early: Option<EarlyTest>,
    /// After it.
    late: Option<EarlyTest>,
}

/// What the workers of a draw have in common.
struct Shared<'a> {
    executor: &'a Executor,
    resources: &'a [Resource<'a>],
    map: ViewportMap,
    region: Region,
    tests: Tests,
    feeds: &'a [(usize, Feed)],
    targets: &'a [Target<'a>],
    depth: Option<&'a TextureView<'a>>,
    local_ids: &'a LocalIds,
    /// Whether no two fragments of a pixel may be in a batch.
    apart: bool,
    /// Of the targets.
    width: u32,
    watch: &'a DrawWatch,
}

impl RasterProgram {
    /// Draws, and waits until everything is drawn.
    ///
    /// A texture that is drawn to must not be bound as well.
    ///
    /// # Errors
    /// [`RasterError::Draw`] or [`RasterError::State`] for what of `draw` is not as it
    /// must be, [`RunError::Binding`] for resources; nothing is drawn then. Others
    /// for what goes wrong while drawing, after which what is drawn is undefined.
    pub fn draw(
        &self,
        executor: &Executor,
        draw: &RasterDraw<'_>,
    ) -> Result<DrawReport, RasterError> {
        let watch = self.watch(draw);
        let counters = self.draw_watched(executor, draw, &watch)?;
        Ok(DrawReport {
            counters,
            sanitised: self.sanitised(watch),
        })
    }

    /// [`RasterProgram::draw`], of several draws to the same targets.
    pub(crate) fn draw_watched(
        &self,
        executor: &Executor,
        draw: &RasterDraw<'_>,
        watch: &DrawWatch,
    ) -> Result<DrawCounters, RasterError> {
        let (width, height) = self.check_targets(draw)?;
        self.check_ranges(draw)?;
        let state = |error: RasterStateError| RasterError::State {
            name: self.name.clone(),
            error,
        };
        draw.viewport.validate(width, height).map_err(state)?;
        draw.scissor.validate(width, height).map_err(state)?;
        let need = self.immediates as usize;
        if draw.immediates.len() < need {
            return Err(self.refused(
                "`var<immediate>`",
                format!("{need} bytes"),
                format!("{} bytes", draw.immediates.len()),
            ));
        }
        let immediates = Buffer::from_bytes(&draw.immediates[..need])?;
        let mut resources = Vec::with_capacity(self.bindings.len() + 1);
        for (i, binding) in self.bindings.iter().enumerate() {
            resources.push(check_binding(&self.name, binding, draw.resources.get(i))?);
        }
        resources.push(Resource::Buffer(&immediates));

        let region = region(draw);
        let assembly = self.assemble(draw)?;
        let is_empty = region.is_empty() || assembly.triangles() == 0 || draw.range.instances == 0;
        let counters = match is_empty {
            true => DrawCounters::default(),
            false => {
                let shape = (region, width);
                self.draw_instances(executor, draw, &resources, shape, &assembly, watch)?
            }
        };
        note_written(&self.bindings, draw.resources);
        for view in draw.colours.iter().chain(draw.depth) {
            view.note_written();
        }
        Ok(counters)
    }

    fn refused(&self, what: &str, expected: String, found: String) -> RasterError {
        RasterError::Draw {
            name: self.name.clone(),
            what: what.to_owned(),
            expected,
            found,
        }
    }

    /// Checks formats and shapes; returns the size all targets have.
    fn check_targets(&self, draw: &RasterDraw<'_>) -> Result<(u32, u32), RasterError> {
        if draw.colours.len() != self.colours.len() {
            return Err(self.refused(
                "the number of colour targets",
                self.colours.len().to_string(),
                draw.colours.len().to_string(),
            ));
        }
        if draw.depth.is_some() != self.depth.is_some() {
            let there = |is: bool| if is { "given" } else { "missing" }.to_owned();
            let (need, is) = (self.depth.is_some(), draw.depth.is_some());
            return Err(self.refused("the depth target", there(need), there(is)));
        }
        let mut size = None;
        let formats = self.colours.iter().copied().chain(self.depth);
        let views = draw.colours.iter().chain(draw.depth);
        for (i, (view, format)) in views.zip(formats).enumerate() {
            let what = match draw.colours.get(i) {
                Some(_) => format!("colour target {i}"),
                None => "the depth target".to_owned(),
            };
            let desc = view.desc();
            let shape = |desc: &TextureDesc| {
                let extent = desc.extent;
                format!("{}×{}", extent.width, extent.height)
            };
            if desc.format != format {
                let found = desc.format.to_string();
                return Err(self.refused(&what, format!("of format {format}"), found));
            }
            if desc.dimension != Dimension::D2 || desc.layers() != 1 {
                return Err(self.refused(
                    &what,
                    "one layer of a flat texture".to_owned(),
                    format!("{} layers, {:?}", desc.layers(), desc.dimension),
                ));
            }
            let extent = [desc.extent.width, desc.extent.height];
            if extent.iter().any(|size| *size > MAX_TARGET) {
                let limit = format!("at most {MAX_TARGET} pixels wide and high");
                return Err(self.refused(&what, limit, shape(&desc)));
            }
            match size {
                None => size = Some((extent, shape(&desc))),
                Some((first, ref all)) if first != extent => {
                    let like = format!("{all}, as the others are");
                    return Err(self.refused(&what, like, shape(&desc)));
                }
                Some(_) => {}
            }
        }
        let ([width, height], _) = size.unwrap_or_default();
        Ok((width, height))
    }

    /// Checks that the ranges of buffers that the draw itself names are there.
    fn check_ranges(&self, draw: &RasterDraw<'_>) -> Result<(), RasterError> {
        let range = draw.range;
        if draw.vertex_buffers.len() != self.buffers {
            return Err(self.refused(
                "the number of vertex buffers",
                self.buffers.to_string(),
                draw.vertex_buffers.len().to_string(),
            ));
        }
        let end = |what: &str, first: u32, count: u32| {
            first.checked_add(count).ok_or_else(|| {
                let found = format!("{first} and {count}");
                self.refused(what, "below 2^32 in sum".to_owned(), found)
            })
        };
        let last = end(
            "the first and the number of what is drawn",
            range.first,
            range.count,
        )?;
        let instances = "the first and the number of instances";
        let last_instance = end(instances, range.first_instance, range.instances)?;
        if range.count >= 1 << 31 {
            return Err(self.refused(
                "the number of vertices",
                "below 2^31".to_owned(),
                range.count.to_string(),
            ));
        }
        if let Some(indices) = &draw.indices {
            let size = u64::from(indices.format.bytes());
            if !indices.offset.is_multiple_of(size) {
                return Err(self.refused(
                    "the index buffer's offset",
                    format!("a multiple of {size}"),
                    indices.offset.to_string(),
                ));
            }
            let need = indices.offset.saturating_add(u64::from(last) * size);
            if need > indices.buffer.len() && range.count > 0 {
                return Err(self.refused(
                    "the index buffer",
                    format!("at least {need} bytes"),
                    format!("{} bytes", indices.buffer.len()),
                ));
            }
        } else if range.base_vertex != 0 {
            return Err(self.refused(
                "the base vertex of a draw without indices",
                "0".to_owned(),
                range.base_vertex.to_string(),
            ));
        }
        for (i, buffer) in draw.vertex_buffers.iter().enumerate() {
            if !buffer.offset.is_multiple_of(4) {
                return Err(self.refused(
                    &format!("the offset of vertex buffer {i}"),
                    "a multiple of 4".to_owned(),
                    buffer.offset.to_string(),
                ));
            }
        }
        if range.count == 0 || range.instances == 0 {
            return Ok(());
        }
        for attribute in &self.feeds.attributes {
            let Some(buffer) = draw.vertex_buffers.get(attribute.buffer) else {
                continue;
            };
            let elements = match (attribute.step, &draw.indices) {
                // Where indices lead is seen when they are followed.
                (StepMode::Vertex, Some(_)) => continue,
                (StepMode::Vertex, None) => last,
                (StepMode::Instance, _) => last_instance,
            };
            let need = u64::from(elements - 1) * u64::from(attribute.stride)
                + u64::from(attribute.offset + attribute.format.bytes());
            let need = need.saturating_add(buffer.offset);
            if need > buffer.buffer.len() {
                return Err(self.refused(
                    &format!("vertex buffer {}", attribute.buffer),
                    format!("at least {need} bytes for {elements} elements"),
                    format!("{} bytes", buffer.buffer.len()),
                ));
            }
        }
        Ok(())
    }

    fn draw_instances(
        &self,
        executor: &Executor,
        draw: &RasterDraw<'_>,
        resources: &[Resource<'_>],
        (region, width): (Region, u32),
        assembly: &Assembly,
        watch: &DrawWatch,
    ) -> Result<DrawCounters, RasterError> {
        let mut counters = DrawCounters::default();
        let map = ViewportMap::new(&draw.viewport);
        let targets: Vec<Target<'_>> = self.targets(draw);
        let feeds = self.feeds_of_fragments();
        let local_ids = LocalIds::new([executor.stage_lanes(), 1, 1]);
        let shared = Shared {
            executor,
            resources,
            map,
            region,
            tests: self.tests(),
            feeds: &feeds,
            targets: &targets,
            depth: draw.depth,
            local_ids: &local_ids,
            apart: self.tests().late.is_some()
                || targets.iter().any(|target| target.state.blend.is_some()),
            width,
            watch,
        };
        let run = VertexRun {
            executor,
            resources,
            buffers: draw.vertex_buffers,
            range: draw.range,
            assembly,
            map: &map,
            watch: &watch.vertices,
        };
        let each = assembly.vertices().max(1);
        if each > i32::MAX as usize {
            return Err(self.out_of_memory(u64::MAX));
        }
        let together = (MAX_VERTICES / each).max(1) as u32;
        let mut first = 0;
        while first < draw.range.instances {
            let last = draw.range.instances.min(first.saturating_add(together));
            let vertices = self.vertices(&run, first..last)?;
            let setup = Setup {
                executor,
                assembly,
                vertices: &vertices,
                map: &map,
                region,
            };
            let total = assembly.triangles().saturating_mul((last - first) as usize);
            counters.vertices += (vertices.words.len() / vertices.stride) as u64;
            counters.primitives += total as u64;
            let mut start = 0;
            while start < total {
                let end = total.min(start + ROUND);
                let chunks = self.triangles(&setup, start..end)?;
                counters.triangles += chunks
                    .iter()
                    .map(|chunk| chunk.triangles.len() as u64)
                    .sum::<u64>();
                counters.quads += self.tiles(&shared, &chunks, &vertices)?;
                start = end;
            }
            first = last;
        }
        Ok(counters)
    }

    /// When depth is tested: before shading unless the fragment kernel has a say in
    /// it, or is to be run whether or not it passes.
    fn tests(&self) -> Tests {
        let Some(depth) = &self.state.depth else {
            return Tests {
                early: None,
                late: None,
            };
        };
        let fragment = self.fragment.as_ref();
        let gives = |output| fragment.is_some_and(|stage| stage.output(output).is_some());
        let writes_memory = fragment.is_some_and(|fragment| fragment.writes);
        let (discards, gives_depth) = (gives(StageOutput::Alive), gives(StageOutput::Depth));
        if writes_memory || gives_depth {
            return Tests {
                early: None,
                late: Some(EarlyTest::of(depth, true)),
            };
        }
        if discards {
            // What fails now fails later as well.
            return Tests {
                early: is_monotonic(depth.compare).then(|| EarlyTest::of(depth, false)),
                late: Some(EarlyTest::of(depth, true)),
            };
        }
        Tests {
            early: Some(EarlyTest::of(depth, true)),
            late: None,
        }
    }

    fn targets<'a>(&self, draw: &RasterDraw<'a>) -> Vec<Target<'a>> {
        let slot = |target: usize, channel: usize| {
            self.fragment.as_ref()?.output(StageOutput::Colour {
                target: target as u32,
                channel: channel as u8,
            })
        };
        let views = draw.colours.iter().enumerate();
        views
            .map(|(i, view)| Target {
                view,
                state: self.state.target(i),
                slots: [0, 1, 2, 3].map(|channel| slot(i, channel)),
            })
            .collect()
    }

    /// What the inputs of the fragment kernel are filled with.
    fn feeds_of_fragments(&self) -> Vec<(usize, Feed)> {
        let varyings: Vec<StageOutput> = self.varyings().map(|(_, output)| output).collect();
        let inputs = self.fragment.iter().flat_map(|fragment| &fragment.inputs);
        inputs
            .filter_map(|&(slot, input)| {
                let feed = match input {
                    StageInput::Position(axis) => Feed::Position(axis),
                    StageInput::FrontFacing => Feed::FrontFacing,
                    StageInput::Covered => Feed::Covered,
                    StageInput::Varying {
                        location,
                        component,
                        interpolation,
                    } => {
                        let wanted = StageOutput::Varying {
                            location,
                            component,
                        };
                        // Checked when the program was made.
                        let word = varyings.iter().position(|output| *output == wanted)?;
                        Feed::Varying(word, interpolation)
                    }
                    _ => return None,
                };
                Some((slot, feed))
            })
            .collect()
    }

    /// Draws triangles that are ready; returns how many quads were shaded.
    fn tiles(
        &self,
        shared: &Shared<'_>,
        chunks: &[Chunk],
        vertices: &Vertices,
    ) -> Result<u64, RasterError> {
        let count = shared.region.tile_count();
        let next = AtomicUsize::new(0);
        let quads = AtomicUsize::new(0);
        let failure = Mutex::new(None);
        // Which of several fragments writes memory last must not depend on speed.
        let writes = self
            .fragment
            .as_ref()
            .is_some_and(|fragment| fragment.writes);
        let threads = if writes {
            1
        } else {
            shared.executor.threads().min(count)
        };
        shared.executor.everywhere(threads, || {
            let mut worker = None;
            loop {
                let tile = next.fetch_add(1, Ordering::Relaxed);
                if tile >= count {
                    break;
                }
                let is_empty =
                    |chunk: &Chunk| chunk.in_tile(tile).is_empty() && chunk.large.is_empty();
                if chunks.iter().all(is_empty) {
                    continue;
                }
                let ready = match &mut worker {
                    Some(worker) => Ok(worker),
                    none => self
                        .tile_worker(shared, chunks, vertices)
                        .map(|worker| none.insert(worker)),
                };
                let done = ready.and_then(|worker: &mut TileWorker<'_>| worker.tile(tile));
                match done {
                    Ok(drawn) => {
                        quads.fetch_add(drawn, Ordering::Relaxed);
                    }
                    Err(error) => {
                        let mut failure = failure.lock().unwrap_or_else(PoisonError::into_inner);
                        *failure = Some(error);
                        return;
                    }
                }
            }
            if let Some(stage) = worker.and_then(|worker| worker.stage) {
                stage.finish();
            }
        });
        match failure.into_inner().unwrap_or_else(PoisonError::into_inner) {
            Some(error) => match &self.fragment {
                Some(fragment) => Err(self.stage_error(fragment, error, shared.executor)),
                None => Err(self.out_of_memory(0)),
            },
            None => Ok(quads.into_inner() as u64),
        }
    }

    pub(super) fn stage_error(
        &self,
        stage: &StageProgram,
        failure: StageFailure,
        executor: &Executor,
    ) -> RasterError {
        match failure {
            StageFailure::OutOfMemory(bytes) => RunError::OutOfMemory {
                what: format!("the registers of {}", self.name),
                bytes,
            }
            .into(),
            StageFailure::EndlessLoop(counter) => {
                let span = stage.code.loops.get(counter as usize).copied();
                RasterError::EndlessLoop {
                    name: self.name.clone(),
                    location: (self.locate)(span.unwrap_or_default()),
                    limit: executor.max_trips(),
                }
            }
        }
    }

    fn tile_worker<'a>(
        &'a self,
        shared: &'a Shared<'a>,
        chunks: &'a [Chunk],
        vertices: &'a Vertices,
    ) -> Result<TileWorker<'a>, StageFailure> {
        let lanes = shared.executor.stage_lanes() as usize;
        let stage = match &self.fragment {
            Some(fragment) => {
                let kernel = StageKernel {
                    code: &fragment.code,
                    links: &fragment.links,
                    resources: shared.resources,
                    local_ids: shared.local_ids,
                    number_type: shared.executor.number_type(),
                    colours: &self.colours,
                    watch: &shared.watch.fragments,
                };
                Some(Stage::new(&kernel, shared.executor)?)
            }
            None => None,
        };
        let output = |output| {
            self.fragment
                .as_ref()
                .and_then(|stage| stage.output(output))
        };
        Ok(TileWorker {
            shared,
            chunks,
            vertices,
            stage,
            fixed: self.depth == Some(Format::Depth16Unorm),
            alive: output(StageOutput::Alive),
            depth_slot: output(StageOutput::Depth),
            depth: TileDepth::new(),
            lanes: BatchLanes {
                covered: vec![[0; LANES]; lanes / LANES],
                depth: vec![[0.0; LANES]; lanes / LANES],
            },
            planes: Vec::new(),
            quads: Vec::with_capacity(lanes / 4 + TILE_QUADS),
            stamps: vec![0; TILE_QUADS],
            stamp: 0,
        })
    }
}

/// The pixels that a draw may draw to: those whose centres are in the viewport, and
/// of the scissor.
fn region(draw: &RasterDraw<'_>) -> Region {
    let along = |start: f32, size: f32, first: u32, count: u32| {
        // Both are in the targets, which are checked.
        let begin = (f64::from(start) - 0.5).ceil().max(0.0) as u32;
        let end = (f64::from(start) + f64::from(size) - 0.5).ceil().max(0.0) as u32;
        [begin.max(first), end.min(first + count)]
    };
    let (view, scissor) = (draw.viewport, draw.scissor);
    Region {
        x: along(view.x, view.width, scissor.x, scissor.width),
        y: along(view.y, view.height, scissor.y, scissor.height),
    }
}

/// What one worker draws tiles with.
struct TileWorker<'a> {
    shared: &'a Shared<'a>,
    chunks: &'a [Chunk],
    vertices: &'a Vertices,
    stage: Option<Stage<'a>>,
    fixed: bool,
    alive: Option<usize>,
    depth_slot: Option<usize>,
    depth: TileDepth,
    lanes: BatchLanes,
    planes: Vec<super::planes::Plane>,
    quads: Vec<super::tile::Quad>,
    stamps: Vec<u32>,
    stamp: u32,
}

impl TileWorker<'_> {
    /// Draws a tile; returns how many quads were shaded.
    fn tile(&mut self, tile: usize) -> Result<usize, StageFailure> {
        let shared = self.shared;
        let tier = shared.executor.tier();
        let [[first_x, end_x], [first_y, _]] = shared.region.tiles();
        let columns = (end_x - first_x) as usize;
        let x = (first_x + (tile % columns) as u32) * TILE;
        let y = (first_y + (tile / columns) as u32) * TILE;
        let tested = shared.tests.early.is_some() || shared.tests.late.is_some();
        let depth = shared.depth.filter(|_| tested);
        if let Some(view) = depth {
            self.depth.load(view, x, y, &shared.region);
        }
        let most = self.lanes.covered.len() * QUADS;
        let mut quads = std::mem::take(&mut self.quads);
        quads.clear();
        let (mut chunk, mut next, mut next_large) = (0, 0, 0);
        let mut drawn = 0;
        loop {
            let mut scan = Scan {
                chunks: self.chunks,
                tile,
                x,
                y,
                region: shared.region,
                map: &shared.map,
                test: shared.tests.early,
                fixed: self.fixed,
                depth: &mut self.depth.values,
                chunk,
                next,
                next_large,
                enough: most,
                quads,
            };
            work(tier, &mut scan);
            (chunk, next, next_large) = (scan.chunk, scan.next, scan.next_large);
            let is_done = scan.is_done();
            quads = scan.quads;
            let mut start = 0;
            while start < quads.len() && (is_done || quads.len() - start >= most) {
                let mut end = quads.len().min(start + most);
                if shared.apart {
                    self.stamp();
                    end = start + apart(&quads[start..end], most, &mut self.stamps, self.stamp);
                }
                self.batch(&quads[start..end])?;
                start = end;
            }
            drawn += start;
            // What is left is less than a batch.
            quads.copy_within(start.., 0);
            quads.truncate(quads.len() - start);
            if is_done {
                break;
            }
        }
        self.quads = quads;
        let tests = [shared.tests.early, shared.tests.late];
        if let Some(view) = depth
            && tests.iter().flatten().any(|test| test.write)
        {
            self.depth.store(view, x, y, &shared.region);
        }
        self.widen(x, y);
        Ok(drawn)
    }

    /// A number that no stamp has.
    fn stamp(&mut self) {
        self.stamp = self.stamp.wrapping_add(1);
        if self.stamp == 0 {
            self.stamps.fill(0);
            self.stamp = 1;
        }
    }

    fn batch(&mut self, quads: &[super::tile::Quad]) -> Result<(), StageFailure> {
        let shared = self.shared;
        let tier = shared.executor.tier();
        if self.stage.is_none() && shared.tests.late.is_none() {
            return Ok(());
        }
        let mut fill = Fill {
            stage: self.stage.as_mut(),
            feeds: shared.feeds,
            chunks: self.chunks,
            vertices: self.vertices,
            map: &shared.map,
            quads,
            lanes: &mut self.lanes,
            planes: &mut self.planes,
            wants_depth: shared.tests.late.is_some(),
            fixed: self.fixed,
            width: shared.width,
        };
        work(tier, &mut fill);
        if let Some(stage) = &mut self.stage {
            stage.run(quads.len().div_ceil(QUADS))?;
        }
        for (chunk, quads) in quads.chunks(QUADS).enumerate() {
            let mut overlap = false;
            if !shared.apart {
                self.stamp();
                overlap = apart(quads, QUADS, &mut self.stamps, self.stamp) < quads.len();
            }
            let mut merge = Merge {
                stage: self.stage.as_ref(),
                quads,
                chunk,
                lanes: &self.lanes,
                alive: self.alive,
                depth_slot: self.depth_slot,
                map: &shared.map,
                late: shared.tests.late,
                fixed: self.fixed,
                depth: &mut self.depth.values,
                targets: shared.targets,
                overlap,
            };
            work(tier, &mut merge);
        }
        Ok(())
    }

    /// Brings wide planes up to date.
    fn widen(&self, x: u32, y: u32) {
        let targets = self.shared.targets.iter().map(|target| target.view);
        for view in targets.chain(self.shared.depth) {
            let (Some(level), Some(_)) = (view.levels.first(), view.wide) else {
                continue;
            };
            for row in y..(y + TILE).min(level.height) {
                for column in x..(x + TILE).min(level.width) {
                    let index = level.start as usize + (row * level.width + column) as usize;
                    view.widen_texel(index);
                }
            }
        }
    }
}

/// Bytes of an index must divide a word.
const _: () = assert!(IndexFormat::Uint32.bytes() == 4 && IndexFormat::Uint16.bytes() == 2);
