//! The vertex kernel over wide lanes.

use std::sync::atomic::{AtomicU32, Ordering};
use std::sync::{Mutex, PoisonError};

use etalon_core::raster::{NumberKind, StepMode, VertexFormat};

use super::clip::PLANES;
use super::error::RasterError;
use super::indices::Assembly;
use super::interface::Attribute;
use super::planes::ViewportMap;
use super::{DrawRange, RasterProgram, VertexBuffer};
use crate::exec::{
    Executor, Fused, Isa, LocalIds, Resource, Stage, StageFailure, StageKernel, StageWatch, Work,
    work,
};
use crate::ir::{StageInput, StageOutput};
use crate::memory::unorm8;
use crate::num::{NumberType, f16_to_f32};
use crate::registers::LANES;

/// Words of a vertex before its varyings: the position in clip space, the corner in
/// the picture, flags.
pub(super) const HEAD: usize = 9;
/// Where the corner is.
pub(super) const CORNER: usize = 4;
/// Where the flags are.
pub(super) const FLAGS: usize = 8;

/// Flag of positions that are not finite. Below it there is a flag for each of
/// [`PLANES`], of positions beyond it.
pub(super) const BAD: u32 = 1 << PLANES.len();

/// What the vertices of some instances came to.
pub(super) struct Vertices {
    /// [`Vertices::stride`] words each, those of an instance after each other.
    pub(super) words: Vec<u32>,
    pub(super) stride: usize,
}

/// What the vertex kernel is run with.
pub(super) struct VertexRun<'a> {
    pub(super) executor: &'a Executor,
    pub(super) resources: &'a [Resource<'a>],
    pub(super) buffers: &'a [VertexBuffer<'a>],
    pub(super) range: DrawRange,
    pub(super) assembly: &'a Assembly,
    pub(super) map: &'a ViewportMap,
    pub(super) watch: &'a StageWatch,
}

impl RasterProgram {
    /// Words of a vertex.
    pub(super) fn vertex_stride(&self) -> usize {
        HEAD + self.varyings().count()
    }

    /// Slots of the vertex kernel's outputs that fragments take, in the order of
    /// their words.
    pub(super) fn varyings(&self) -> impl Iterator<Item = (usize, StageOutput)> + '_ {
        let outputs = self.vertex.code.resources.stage.outputs.iter().copied();
        outputs
            .enumerate()
            .filter(|(_, output)| matches!(output, StageOutput::Varying { .. }))
    }

    /// Runs the vertex kernel for some of the draw's instances, by their number from
    /// the first.
    pub(super) fn vertices(
        &self,
        run: &VertexRun<'_>,
        instances: std::ops::Range<u32>,
    ) -> Result<Vertices, RasterError> {
        let stride = self.vertex_stride();
        let each = run.assembly.vertices();
        let total = each.checked_mul(instances.len());
        let words = total.and_then(|total| total.checked_mul(stride));
        let (Some(total), Some(count)) = (total, words) else {
            return Err(self.out_of_memory(u64::MAX));
        };
        let mut words = Vec::new();
        self.reserve(&mut words, count)?;
        words.resize(count, 0);
        let lanes = run.executor.stage_lanes();
        let local_ids = LocalIds::new([lanes, 1, 1]);
        let chunks = Mutex::new(words.chunks_mut(stride * lanes as usize).enumerate());
        let failure = Mutex::new(None);
        let next = || {
            let mut chunks = chunks.lock().unwrap_or_else(PoisonError::into_inner);
            chunks.next()
        };
        let threads = run
            .executor
            .threads()
            .min(total.div_ceil(lanes as usize).max(1));
        run.executor.everywhere(threads, || {
            let mut worker = None;
            while let Some((batch, words)) = next() {
                let first = batch * lanes as usize;
                let done = match &mut worker {
                    Some(worker) => Ok(worker),
                    none => self
                        .vertex_worker(run, &local_ids)
                        .map(|worker| none.insert(worker)),
                };
                let done = done.and_then(|worker: &mut Worker<'_>| {
                    worker.batch(first, each, instances.start, words)
                });
                if let Err(error) = done {
                    let mut failure = failure.lock().unwrap_or_else(PoisonError::into_inner);
                    *failure = Some(error);
                    return;
                }
            }
            if let Some(worker) = worker {
                worker.stage.finish();
            }
        });
        match failure.into_inner().unwrap_or_else(PoisonError::into_inner) {
            Some(error) => Err(self.stage_error(&self.vertex, error, run.executor)),
            None => Ok(Vertices { words, stride }),
        }
    }

    fn vertex_worker<'a>(
        &'a self,
        run: &'a VertexRun<'a>,
        local_ids: &'a LocalIds,
    ) -> Result<Worker<'a>, StageFailure> {
        let kernel = StageKernel {
            code: &self.vertex.code,
            links: &self.vertex.links,
            resources: run.resources,
            local_ids,
            number_type: match run.executor.number_type() {
                // Positions of another type would cover other pixels.
                NumberType::F64 => NumberType::F32,
                other => other,
            },
            colours: &[],
            watch: run.watch,
        };
        let position = |axis| self.vertex.output(StageOutput::Position(axis));
        Ok(Worker {
            stage: Stage::new(&kernel, run.executor)?,
            run,
            inputs: &self.vertex.inputs,
            attributes: &self.feeds.attributes,
            position: [0, 1, 2, 3].map(|axis| position(axis).unwrap_or(0)),
            varyings: self.varyings().map(|(slot, _)| slot).collect(),
            stride: self.vertex_stride(),
        })
    }
}

/// One worker's vertex kernel.
struct Worker<'a> {
    stage: Stage<'a>,
    run: &'a VertexRun<'a>,
    inputs: &'a [(usize, StageInput)],
    attributes: &'a [Attribute],
    /// Slots of the position.
    position: [usize; 4],
    /// Slots of the varyings.
    varyings: Vec<usize>,
    stride: usize,
}

impl Worker<'_> {
    /// Runs vertices from `first` on, counted over the instances, of which each has
    /// `each`, as many as there is room for.
    fn batch(
        &mut self,
        first: usize,
        each: usize,
        first_instance: u32,
        words: &mut [u32],
    ) -> Result<(), StageFailure> {
        let count = words.len() / self.stride;
        let chunks = count.div_ceil(LANES);
        let range = self.run.range;
        for chunk in 0..chunks {
            let (mut vertex, mut instance) = ([0; LANES], [0; LANES]);
            for k in 0..LANES {
                // Lanes past the end repeat the last vertex.
                let at = first + (chunk * LANES + k).min(count - 1);
                let slot = at % each;
                let number = first_instance.wrapping_add((at / each) as u32);
                instance[k] = range.first_instance.wrapping_add(number);
                vertex[k] = match &self.run.assembly.distinct {
                    Some(distinct) => distinct
                        .get(slot)
                        .map_or(0, |index| index.wrapping_add_signed(range.base_vertex)),
                    None => range.first.wrapping_add(slot as u32),
                };
            }
            if let Some(who) = self.stage.who(chunk) {
                let left = (count - chunk * LANES).min(LANES);
                who.live = u64::MAX >> (LANES - left);
                for k in 0..LANES {
                    let at = first + chunk * LANES + k;
                    who.invocation[k] = (first_instance as usize * each + at) as u32;
                }
            }
            for &(slot, input) in self.inputs {
                let lanes = self.stage.input(slot, chunk);
                match input {
                    StageInput::VertexIndex => *lanes = vertex,
                    StageInput::InstanceIndex => *lanes = instance,
                    StageInput::Attribute {
                        attribute,
                        component,
                    } => {
                        let attribute = &self.attributes[usize::from(attribute)];
                        let elements = match attribute.step {
                            StepMode::Vertex => &vertex,
                            StepMode::Instance => &instance,
                        };
                        let Some(buffer) = self.run.buffers.get(attribute.buffer) else {
                            continue;
                        };
                        let mut fetch = Fetch {
                            words: buffer.buffer.words(),
                            start: buffer.offset + u64::from(attribute.offset),
                            stride: attribute.stride,
                            format: attribute.format,
                            component: u32::from(component),
                            elements,
                            out: lanes,
                        };
                        work(self.run.executor.tier(), &mut fetch);
                    }
                    _ => {}
                }
            }
        }
        self.stage.run(chunks)?;
        for chunk in 0..chunks {
            let first = chunk * LANES;
            let last = (first + LANES).min(count);
            let mut finish = Finish {
                stage: &self.stage,
                chunk,
                map: self.run.map,
                position: self.position,
                varyings: &self.varyings,
                stride: self.stride,
                words: &mut words[first * self.stride..last * self.stride],
            };
            work(self.run.executor.tier(), &mut finish);
        }
        Ok(())
    }
}

/// Reads one component of an attribute.
struct Fetch<'a> {
    words: &'a [AtomicU32],
    /// Bytes to the first element's numbers.
    start: u64,
    stride: u32,
    format: VertexFormat,
    component: u32,
    elements: &'a [u32; LANES],
    out: &'a mut [u32; LANES],
}

impl Work for Fetch<'_> {
    #[inline(always)]
    fn run<I: Isa, F: Fused>(&mut self) {
        let components = self.format.components();
        if self.component >= components {
            // Those that are not there are 0, 0, 1.
            let one = match self.format.kind() {
                NumberKind::Float => 1.0_f32.to_bits(),
                NumberKind::Uint | NumberKind::Sint => 1,
            };
            *self.out = [if self.component == 3 { one } else { 0 }; LANES];
            return;
        }
        let bytes = u64::from(self.format.bytes() / components);
        let at = self.start + u64::from(self.component) * bytes;
        let shift = (at % 4 * 8) as u32;
        let (first, step) = (at / 4, u64::from(self.stride / 4));
        let mut bits = [0; LANES];
        for k in 0..LANES {
            // At most 2^32 times 512, and the size of a buffer.
            let index = first + u64::from(self.elements[k]) * step;
            if let Some(word) = self.words.get(index as usize) {
                bits[k] = word.load(Ordering::Relaxed) >> shift;
            }
        }
        use VertexFormat as V;
        let out = &mut *self.out;
        match self.format {
            V::Float16x2 | V::Float16x4 => {
                for k in 0..LANES {
                    out[k] = f16_to_f32(bits[k] & 0xffff).to_bits();
                }
            }
            V::Unorm8x2 | V::Unorm8x4 => {
                for k in 0..LANES {
                    out[k] = unorm8(bits[k]);
                }
            }
            V::Snorm8x4 => {
                for k in 0..LANES {
                    let value = f32::from(bits[k] as u8 as i8) / 127.0;
                    out[k] = if value > -1.0 { value } else { -1.0 }.to_bits();
                }
            }
            V::Unorm16x2 | V::Unorm16x4 => {
                for k in 0..LANES {
                    out[k] = (f32::from(bits[k] as u16) / 65535.0).to_bits();
                }
            }
            V::Snorm16x2 | V::Snorm16x4 => {
                for k in 0..LANES {
                    let value = f32::from(bits[k] as u16 as i16) / 32767.0;
                    out[k] = if value > -1.0 { value } else { -1.0 }.to_bits();
                }
            }
            V::Uint8x4 => {
                for k in 0..LANES {
                    out[k] = bits[k] & 0xff;
                }
            }
            V::Uint16x2 | V::Uint16x4 => {
                for k in 0..LANES {
                    out[k] = bits[k] & 0xffff;
                }
            }
            // Whole words.
            _ => *out = bits,
        }
    }
}

/// Takes vertices to the picture, and lays out their words.
struct Finish<'a, 's> {
    stage: &'a Stage<'s>,
    chunk: usize,
    map: &'a ViewportMap,
    position: [usize; 4],
    varyings: &'a [usize],
    stride: usize,
    words: &'a mut [u32],
}

impl Work for Finish<'_, '_> {
    #[inline(always)]
    fn run<I: Isa, F: Fused>(&mut self) {
        let mut clip = [[0.0; LANES]; 4];
        for axis in 0..4 {
            let bits = self.stage.output(self.position[axis], self.chunk);
            for k in 0..LANES {
                clip[axis][k] = f32::from_bits(bits[k]);
            }
        }
        let (mut corner, mut flags) = ([[0.0; LANES]; 4], [0; LANES]);
        for k in 0..LANES {
            let [x, y, z, w] = [clip[0][k], clip[1][k], clip[2][k], clip[3][k]];
            let at = self.map.corner::<F>([x, y, z, w]);
            corner[0][k] = at.x;
            corner[1][k] = at.y;
            corner[2][k] = at.z;
            corner[3][k] = at.w;
            let finite = x.is_finite() & y.is_finite() & z.is_finite() & w.is_finite();
            flags[k] = crate::num::mask(x > w) & 1
                | crate::num::mask(x < -w) & 2
                | crate::num::mask(y > w) & 4
                | crate::num::mask(y < -w) & 8
                | crate::num::mask(z < 0.0) & 16
                | crate::num::mask(z > w) & 32
                | crate::num::mask(!finite) & BAD;
        }
        for (k, words) in self.words.chunks_exact_mut(self.stride).enumerate() {
            for axis in 0..4 {
                words[axis] = clip[axis][k].to_bits();
                words[CORNER + axis] = corner[axis][k].to_bits();
            }
            words[FLAGS] = flags[k];
        }
        for (i, &slot) in self.varyings.iter().enumerate() {
            let lanes = self.stage.output(slot, self.chunk);
            for (k, words) in self.words.chunks_exact_mut(self.stride).enumerate() {
                words[HEAD + i] = lanes[k];
            }
        }
    }
}
