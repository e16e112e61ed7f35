//! Handlers of filtered reads.
//!
//! Coordinates and weights are `f32` in every number type, as devices' filters
//! are. Levels of detail, texel addresses and weights follow Vulkan 1.3, §16.6
//! to §16.9 (normalised texel coordinates, level of detail, unnormalised
//! coordinates, sample operations), which WGSL §17.7 leaves to the API.

mod axis;
mod bilinear;
mod cube;
mod gather;
mod general;
mod levels;
mod lod;

use etalon_core::Format;
use etalon_core::resource::{Compare, Filter, SamplerDesc};

use self::axis::AxisTexels;
use self::lod::Lod;
use super::image::{texture, wanted};
use super::isa::{Baseline, Isa};
use super::link::Instr;
use super::memory::rounds;
use super::state::{Resource, State};
use super::texels::fetch;
use super::tier::{Handler, Tier, TieredStep};
use crate::code::Slot;
use crate::ir::{ImageAccess, Op};
use crate::memory::{Channels, Level, TextureView};
use crate::num::{Number, mask};
use crate::registers::LANES;

pub(super) fn sample<N: Number>(tier: Tier, varying: bool) -> Handler<N> {
    if varying {
        Handler::tiered::<Sample<LANES>>(tier)
    } else {
        Handler::portable::<Sample<1>>()
    }
}

pub(super) fn gather<N: Number>(tier: Tier, varying: bool) -> Handler<N> {
    if varying {
        Handler::tiered::<gather::Gather<LANES>>(tier)
    } else {
        Handler::portable::<gather::Gather<1>>()
    }
}

/// The first channel of one sample.
pub(super) fn one(
    texture: &TextureView<'_>,
    sampler: SamplerDesc,
    access: ImageAccess,
    at: [f32; 3],
    layer: u32,
    lod: f32,
) -> f32 {
    let request = Request {
        texture,
        sampler,
        wanted: [true, false, false, false],
        axes: usize::from(access.coordinates),
        layered: access.layered,
        cube: access.cube,
        offset: [0; 3],
        compare: None,
    };
    let place = Place {
        at: at.map(|axis| [axis]),
        layer: [layer],
        reference: [0.0],
    };
    request.sample::<Baseline, 1>(&place, &Lod::Same(lod))[0][0]
}

struct Sample<const K: usize>;

impl<N: Number, const K: usize> TieredStep<N> for Sample<K> {
    #[inline(always)]
    fn run<I: Isa>(state: &mut State<'_, N>, instr: &Instr) {
        let inst = state.inst(instr.index);
        let Op::ImageSample {
            access,
            sampler,
            sampling,
        } = inst.op
        else {
            return;
        };
        let Some(request) = Request::new(
            state,
            access,
            sampler,
            wanted(inst),
            sampling.offset.map(i32::from),
            sampling.compare,
        ) else {
            return;
        };
        if K == LANES
            && !sampling.clamp
            && !sampling.gradient
            && bilinear::sample::<I, N>(state, &request, &inst.operands, &inst.results)
        {
            return;
        }
        for chunk in 0..rounds::<N, K>(state) {
            let (mut place, rest) = Place::<K>::read(state, &request, &inst.operands, chunk);
            if sampling.clamp {
                request.clamp_to_edge(&mut place);
            }
            let lod = match *rest {
                [level] if !sampling.gradient => {
                    if level.varying {
                        Lod::Each(state.singles(level, chunk))
                    } else {
                        let [lod] = state.singles::<1>(level, chunk);
                        Lod::Same(lod)
                    }
                }
                _ => {
                    let mut derivatives = [[[0.0; K]; 3]; 2];
                    let (rest, bias) = match rest {
                        [derivatives @ .., bias] if sampling.bias => (derivatives, Some(*bias)),
                        rest => (rest, None),
                    };
                    let each = rest.chunks(request.axes.clamp(1, 3));
                    for (derivative, slots) in derivatives.iter_mut().zip(each) {
                        for (axis, slot) in derivative.iter_mut().zip(slots) {
                            *axis = state.singles(*slot, chunk);
                        }
                    }
                    let [along_x, along_y] = &derivatives;
                    let mut lods = request.gradient(&place, along_x, along_y);
                    if let Some(bias) = bias {
                        let bias: [f32; K] = state.singles(bias, chunk);
                        for k in 0..K {
                            lods[k] += bias[k];
                        }
                    }
                    Lod::Each(lods)
                }
            };
            let channels = request.sample::<I, K>(&place, &lod);
            for (result, channel) in inst.results.iter().zip(&channels) {
                if let Some(to) = *result {
                    let mut bits = [0; K];
                    for k in 0..K {
                        bits[k] = channel[k].to_bits();
                    }
                    state.set_bits(to, chunk, &bits);
                }
            }
        }
    }
}

/// Where lanes read.
struct Place<const K: usize> {
    /// Normalised coordinates; zero along axes that the texture has not.
    at: [[f32; K]; 3],
    /// Layer or cube as given, not yet clamped.
    layer: [u32; K],
    /// What texels are compared with.
    reference: [f32; K],
}

impl<const K: usize> Place<K> {
    /// Takes the operands that all filtered reads begin with; returns the rest.
    #[inline(always)]
    fn read<'o, N: Number>(
        state: &State<'_, N>,
        request: &Request<'_>,
        operands: &'o [Slot],
        chunk: usize,
    ) -> (Self, &'o [Slot]) {
        let (coordinates, mut rest) = operands.split_at(request.axes.min(operands.len()));
        let mut place = Self {
            at: [[0.0; K]; 3],
            layer: [0; K],
            reference: [0.0; K],
        };
        for (at, &slot) in place.at.iter_mut().zip(coordinates) {
            *at = state.singles(slot, chunk);
        }
        if request.layered
            && let [layer, after @ ..] = rest
        {
            place.layer = state.ints(*layer, chunk);
            rest = after;
        }
        if request.compare.is_some()
            && let [reference, after @ ..] = rest
        {
            place.reference = state.singles(*reference, chunk);
            if request.texture.desc().format == Format::Depth16Unorm {
                // Fixed-point depth is compared with what it could hold.
                for reference in &mut place.reference {
                    *reference = Number::min(Number::max(*reference, 0.0), 1.0);
                }
            }
            rest = after;
        }
        (place, rest)
    }
}

/// What is read and how, the same for all lanes.
struct Request<'a> {
    texture: &'a TextureView<'a>,
    sampler: SamplerDesc,
    wanted: [bool; 4],
    /// Number of coordinates.
    axes: usize,
    layered: bool,
    cube: bool,
    /// In texels.
    offset: [i32; 3],
    compare: Option<Compare>,
}

impl<'a> Request<'a> {
    #[inline(always)]
    fn new<N: Number>(
        state: &State<'a, N>,
        access: ImageAccess,
        sampler: u16,
        wanted: [bool; 4],
        offset: [i32; 3],
        compare: bool,
    ) -> Option<Self> {
        let Some(&Resource::Sampler(sampler)) = state.resources.get(usize::from(sampler)) else {
            return None;
        };
        Some(Self {
            texture: texture(state, access.image)?,
            sampler,
            wanted,
            axes: usize::from(access.coordinates),
            layered: access.layered,
            cube: access.cube,
            offset,
            compare: sampler.compare.filter(|_| compare),
        })
    }

    /// WGSL's `textureSampleBaseClampToEdge`: half a texel stays on each side.
    #[inline(always)]
    fn clamp_to_edge<const K: usize>(&self, place: &mut Place<K>) {
        if let Some(level) = self.texture.levels.first() {
            for (at, size) in place.at.iter_mut().zip([level.width, level.height]) {
                let half = 0.5 / size as f32;
                let far = 1.0 - half;
                for k in 0..K {
                    at[k] = Number::min(Number::max(at[k], half), far);
                }
            }
        }
    }

    #[inline(always)]
    fn sample<I: Isa, const K: usize>(&self, place: &Place<K>, lod: &Lod<K>) -> [[f32; K]; 4] {
        let lods = match lod {
            Lod::Same(lod) => [self.clamp_lod(*lod); K],
            Lod::Each(lods) => {
                let mut clamped = [0.0; K];
                for k in 0..K {
                    clamped[k] = self.clamp_lod(lods[k]);
                }
                clamped
            }
        };
        let first = lods[0].to_bits();
        let others = lods
            .iter()
            .fold(0, |all, lod| all | (lod.to_bits() ^ first));
        if others == 0 && self.axes == 2 && !self.cube {
            self.at_level::<I, K>(place, lods[0])
        } else {
            self.at_levels::<I, K>(place, &lods)
        }
    }

    /// All lanes at one level of detail of a flat texture.
    #[inline(always)]
    fn at_level<I: Isa, const K: usize>(&self, place: &Place<K>, lod: f32) -> [[f32; K]; 4] {
        let linear = self.filter(lod) == Filter::Linear;
        let (fine, weight) = self.mips(lod);
        let mut sum = [[0.0; K]; 4];
        for step in 0..if weight > 0.0 { 2 } else { 1 } {
            let scale = if step == 1 { weight } else { 1.0 - weight };
            self.add_flat::<I, K>(self.level(fine + step), linear, scale, place, &mut sum);
        }
        sum
    }

    /// Each lane at a level of detail of its own.
    #[inline(always)]
    fn at_levels<I: Isa, const K: usize>(
        &self,
        place: &Place<K>,
        lods: &[f32; K],
    ) -> [[f32; K]; 4] {
        let (mut fine, mut weight) = ([0; K], [0.0; K]);
        let mut between = false;
        for k in 0..K {
            (fine[k], weight[k]) = self.mips(lods[k]);
            between |= weight[k] > 0.0;
        }
        let steps = if between { 2 } else { 1 };
        let mut result = [[0.0; K]; 4];
        // First with the filter of what is minified, then of what is not.
        for minified in [true, false] {
            let filter = if minified {
                self.sampler.min_filter
            } else if self.sampler.mag_filter == self.sampler.min_filter {
                break;
            } else {
                self.sampler.mag_filter
            };
            let linear = filter == Filter::Linear;
            let mut sum = [[0.0; K]; 4];
            for step in 0..steps {
                let mut levels = [Level::default(); K];
                let mut scale = weight;
                for k in 0..K {
                    levels[k] = self.level(fine[k] + step);
                    if step == 0 {
                        scale[k] = 1.0 - weight[k];
                    }
                }
                let mut both = sum;
                if self.axes == 2 && !self.cube {
                    self.add_levels::<I, K>(&levels, linear, &scale, place, &mut both);
                } else {
                    self.add_general::<I, K>(&levels, linear, &scale, place, &mut both);
                }
                for (sum, both) in sum.iter_mut().zip(&both) {
                    for k in 0..K {
                        // A lane that reads one level only must not see the other.
                        sum[k] = Number::select(mask(scale[k] > 0.0), both[k], sum[k]);
                    }
                }
            }
            for (result, sum) in result.iter_mut().zip(&sum) {
                for k in 0..K {
                    let takes = mask(minified | (lods[k] <= 0.0));
                    result[k] = Number::select(takes, sum[k], result[k]);
                }
            }
        }
        result
    }

    /// Adds what one level of a flat texture has, times `scale`.
    #[inline(always)]
    fn add_flat<I: Isa, const K: usize>(
        &self,
        level: Level,
        linear: bool,
        scale: f32,
        place: &Place<K>,
        sum: &mut [[f32; K]; 4],
    ) {
        let Level {
            width,
            height,
            depth,
            start,
        } = level;
        let [x, y, ..] = &place.at;
        let ([mode_x, mode_y, _], [dx, dy, _]) = (self.sampler.address, self.offset);
        let x = AxisTexels::new(mode_x, x, width, dx, linear);
        let y = AxisTexels::new(mode_y, y, height, dy, linear);
        let mut rows = y.texels;
        if self.layered {
            let last = depth as i32 - 1;
            for k in 0..K {
                let layer = (place.layer[k] as i32).max(0).min(last) as u32;
                let first = start + layer * height * width;
                for row in &mut rows {
                    row[k] = first + row[k] * width;
                }
            }
        } else {
            for row in &mut rows {
                for k in 0..K {
                    row[k] = start + row[k] * width;
                }
            }
        }
        for tap in 0..if linear { 4 } else { 1 } {
            let (dx, dy) = (tap & 1, tap >> 1);
            let (mut index, mut weight) = ([0; K], [scale; K]);
            for k in 0..K {
                index[k] = rows[dy][k] + x.texels[dx][k];
            }
            if linear {
                for k in 0..K {
                    let horizontal = if dx == 1 {
                        x.weight[k]
                    } else {
                        1.0 - x.weight[k]
                    };
                    let vertical = if dy == 1 {
                        y.weight[k]
                    } else {
                        1.0 - y.weight[k]
                    };
                    weight[k] = scale * horizontal * vertical;
                }
            }
            let channels = self.texels::<I, K>(&index, &place.reference);
            self.add_weighted(&channels, &weight, sum);
        }
    }

    /// The wanted channels of texels, or what comparing them gives.
    #[inline(always)]
    fn texels<I: Isa, const K: usize>(
        &self,
        index: &[u32; K],
        reference: &[f32; K],
    ) -> Channels<K> {
        let mut channels = [[0; K]; 4];
        fetch::<I, K>(self.texture, index, self.wanted, &mut channels);
        if let Some(compare) = self.compare {
            channels[0] = compared(compare, reference, &channels[0]);
        }
        channels
    }

    /// Adds texels times their weights.
    #[inline(always)]
    fn add_weighted<const K: usize>(
        &self,
        channels: &Channels<K>,
        weight: &[f32; K],
        sum: &mut [[f32; K]; 4],
    ) {
        for (channel, sum) in sum.iter_mut().enumerate() {
            if self.wanted[channel] {
                for k in 0..K {
                    sum[k] += weight[k] * f32::from_bits(channels[channel][k]);
                }
            }
        }
    }
}

/// 1 where `reference OP texel`, 0 elsewhere.
#[inline(always)]
fn compared<const K: usize>(compare: Compare, reference: &[f32; K], texel: &[u32; K]) -> [u32; K] {
    let one = 1.0_f32.to_bits();
    let mut result = [0; K];
    macro_rules! each {
        ($op:tt) => {
            for k in 0..K {
                result[k] = mask(reference[k] $op f32::from_bits(texel[k])) & one;
            }
        };
    }
    match compare {
        Compare::Never => {}
        Compare::Less => each!(<),
        Compare::Equal => each!(==),
        Compare::LessEqual => each!(<=),
        Compare::Greater => each!(>),
        Compare::NotEqual => each!(!=),
        Compare::GreaterEqual => each!(>=),
        Compare::Always => result = [one; K],
    }
    result
}
