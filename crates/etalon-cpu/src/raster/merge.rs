//! From fragments to targets: the depth test after shading, blending, stores.

use etalon_core::Format;
use etalon_core::format::{Encoding, SampleKind};
use etalon_core::raster::{
    Blend, BlendComponent, BlendFactor, BlendOperation, ColourWrites, TargetState,
};
use etalon_core::resource::Compare;
use etalon_core::texel::Texel;

use super::depth::{PIXELS, compare_lanes, quantised};
use super::planes::ViewportMap;
use super::setup::TILE;
use super::shade::{BatchLanes, QUADS};
use super::tile::{EarlyTest, Quad};
use crate::exec::{Fused, Isa, OUTSIDE, Stage, Work, fetch, put};
use crate::memory::{Channels, TextureView};
use crate::registers::LANES;

/// A colour target of a draw.
pub(super) struct Target<'a> {
    pub(super) view: &'a TextureView<'a>,
    pub(super) state: TargetState,
    /// Slots of the kernel's channels; those it does not give are 0, 0, 0, 1.
    pub(super) slots: [Option<usize>; 4],
}

/// Stores the fragments of a chunk of lanes.
pub(super) struct Merge<'a, 's> {
    pub(super) stage: Option<&'a Stage<'s>>,
    /// The quads of the chunk.
    pub(super) quads: &'a [Quad],
    pub(super) chunk: usize,
    pub(super) lanes: &'a BatchLanes,
    pub(super) alive: Option<usize>,
    pub(super) depth_slot: Option<usize>,
    pub(super) map: &'a ViewportMap,
    /// The test after shading, if it was not before.
    pub(super) late: Option<EarlyTest>,
    /// Depth16Unorm.
    pub(super) fixed: bool,
    pub(super) depth: &'a mut [f32; PIXELS],
    pub(super) targets: &'a [Target<'a>],
    /// Whether several quads may be in the same place, the last of which counts.
    pub(super) overlap: bool,
}

impl Work for Merge<'_, '_> {
    #[inline(always)]
    fn run<I: Isa, F: Fused>(&mut self) {
        let mut written = self.lanes.covered[self.chunk];
        if let (Some(stage), Some(alive)) = (self.stage, self.alive) {
            let alive = stage.output(alive, self.chunk);
            for k in 0..LANES {
                written[k] &= alive[k];
            }
        }
        let (mut x, mut y) = ([0; LANES], [0; LANES]);
        let mut place = [0; LANES];
        for (i, quad) in self.quads.iter().take(QUADS).enumerate() {
            for k in 0..4 {
                x[i * 4 + k] = u32::from(quad.x) + k as u32 % 2;
                y[i * 4 + k] = u32::from(quad.y) + k as u32 / 2;
            }
        }
        for k in 0..LANES {
            let (column, row) = (x[k] % TILE, y[k] % TILE);
            place[k] = (row / 2 * (TILE / 2) + column / 2) * 4 + row % 2 * 2 + column % 2;
        }
        for k in self.quads.len() * 4..LANES {
            written[k] = 0;
        }
        if let Some(test) = self.late {
            self.test(test, &place, &mut written);
        }
        if self.overlap {
            let mut last = [0_u8; PIXELS];
            for k in 0..LANES {
                if written[k] != 0 {
                    last[place[k] as usize % PIXELS] = k as u8;
                }
            }
            for k in 0..LANES {
                let shown = usize::from(last[place[k] as usize % PIXELS]) == k;
                written[k] &= crate::num::mask(shown);
            }
        }
        for target in self.targets {
            self.colour::<I>(target, &x, &y, &written);
        }
    }
}

impl Merge<'_, '_> {
    #[inline(always)]
    fn test(&mut self, test: EarlyTest, place: &[u32; LANES], written: &mut [u32; LANES]) {
        let mut z = self.lanes.depth[self.chunk];
        if let (Some(stage), Some(slot)) = (self.stage, self.depth_slot) {
            let given = stage.output(slot, self.chunk);
            for k in 0..LANES {
                z[k] = self.map.clamp(f32::from_bits(given[k]));
            }
            if self.fixed {
                for k in 0..LANES {
                    z[k] = quantised(z[k]);
                }
            }
        }
        let mut old = [0.0; LANES];
        for k in 0..LANES {
            old[k] = self.depth[place[k] as usize % PIXELS];
        }
        let mut passed = *written;
        compare_lanes!(test.compare, passed, z, old, LANES);
        *written = passed;
        if test.write {
            for k in 0..LANES {
                if passed[k] != 0 {
                    self.depth[place[k] as usize % PIXELS] = z[k];
                }
            }
        }
    }

    #[inline(always)]
    fn colour<I: Isa>(
        &self,
        target: &Target<'_>,
        x: &[u32; LANES],
        y: &[u32; LANES],
        written: &[u32; LANES],
    ) {
        let (Some(stage), Some(level)) = (self.stage, target.view.levels.first()) else {
            return;
        };
        let ColourWrites {
            red,
            green,
            blue,
            alpha,
        } = target.state.writes;
        let writes = [red, green, blue, alpha];
        if writes == [false; 4] {
            return;
        }
        let mut index = [OUTSIDE; LANES];
        for k in 0..LANES {
            let at = level
                .start
                .wrapping_add(y[k].wrapping_mul(level.width))
                .wrapping_add(x[k]);
            index[k] = at | !written[k];
        }
        let format = target.view.desc().format;
        let one = match format.sample_kind() {
            SampleKind::Uint | SampleKind::Sint => 1,
            SampleKind::Float | SampleKind::Depth => 1.0_f32.to_bits(),
        };
        let mut channels: Channels<LANES> = [[0; LANES], [0; LANES], [0; LANES], [one; LANES]];
        for (channel, slot) in channels.iter_mut().zip(target.slots) {
            if let Some(slot) = slot {
                *channel = *stage.output(slot, self.chunk);
            }
        }
        if let Some(state) = target.state.blend {
            let mut there = [[0; LANES]; 4];
            fetch::<I, LANES>(target.view, &index, [true; 4], &mut there);
            blend(&state, format, &mut channels, &there);
        }
        if writes == [true; 4] {
            put::<I, LANES>(target.view, &index, &channels);
        } else {
            put_some(target.view, &index, &channels, writes);
        }
    }
}

/// Writes some channels of texels: the codes of the others stay as they are.
fn put_some(
    view: &TextureView<'_>,
    index: &[u32; LANES],
    channels: &Channels<LANES>,
    writes: [bool; 4],
) {
    let format = view.desc().format;
    for k in 0..LANES {
        let at = index[k] as usize;
        if index[k] == OUTSIDE {
            continue;
        }
        let Some(mut bytes) = view.texel_bytes(at) else {
            continue;
        };
        let bits = channels.map(|channel| channel[k]);
        let texel = match format.sample_kind() {
            SampleKind::Uint => Texel::Uint(bits),
            SampleKind::Sint => Texel::Sint(bits.map(|bits| bits as i32)),
            SampleKind::Float | SampleKind::Depth => Texel::Float(bits.map(f32::from_bits)),
        };
        let (mut codes, new) = (format.codes(&bytes), format.encode_codes(texel));
        for channel in 0..4 {
            if writes[channel] {
                codes.channels[channel] = new.channels[channel];
            }
        }
        format.write_codes(codes, &mut bytes);
        view.set_texel_bytes(at, &bytes);
    }
}

/// Blends `channels` with what is `there` (Vulkan 1.3, §29.1): in `f32`, each product
/// and sum rounded. Of normalised formats the source is limited to their range before.
#[inline(always)]
fn blend(state: &Blend, format: Format, channels: &mut Channels<LANES>, there: &Channels<LANES>) {
    let range = match format.encoding() {
        Encoding::Unorm | Encoding::UnormSrgb => Some(0.0),
        Encoding::Snorm => Some(-1.0),
        _ => None,
    };
    let (mut source, mut old) = ([[0.0; LANES]; 4], [[0.0; LANES]; 4]);
    for c in 0..4 {
        for k in 0..LANES {
            source[c][k] = f32::from_bits(channels[c][k]);
            old[c][k] = f32::from_bits(there[c][k]);
        }
        if let Some(low) = range {
            for k in 0..LANES {
                let value = source[c][k];
                // A NaN becomes 0, as where it is stored.
                let value = if value.is_nan() { 0.0 } else { value };
                let value = if value > low { value } else { low };
                source[c][k] = if value < 1.0 { value } else { 1.0 };
            }
        }
    }
    for c in 0..4 {
        let part = if c == 3 { &state.alpha } else { &state.colour };
        let mut out = [0.0; LANES];
        component(part, c, &source, &old, &mut out);
        for k in 0..LANES {
            channels[c][k] = out[k].to_bits();
        }
    }
}

#[inline(always)]
fn component(
    part: &BlendComponent,
    c: usize,
    source: &[[f32; LANES]; 4],
    old: &[[f32; LANES]; 4],
    out: &mut [f32; LANES],
) {
    let (s, d) = (&source[c], &old[c]);
    match part.operation {
        BlendOperation::Min => {
            for k in 0..LANES {
                out[k] = if s[k] < d[k] { s[k] } else { d[k] };
            }
            return;
        }
        BlendOperation::Max => {
            for k in 0..LANES {
                out[k] = if s[k] > d[k] { s[k] } else { d[k] };
            }
            return;
        }
        _ => {}
    }
    let (mut a, mut b) = ([0.0; LANES], [0.0; LANES]);
    factor(part.source, c, source, old, &mut a);
    factor(part.target, c, source, old, &mut b);
    for k in 0..LANES {
        a[k] *= s[k];
        b[k] *= d[k];
    }
    match part.operation {
        BlendOperation::Subtract => {
            for k in 0..LANES {
                out[k] = a[k] - b[k];
            }
        }
        BlendOperation::ReverseSubtract => {
            for k in 0..LANES {
                out[k] = b[k] - a[k];
            }
        }
        _ => {
            for k in 0..LANES {
                out[k] = a[k] + b[k];
            }
        }
    }
}

#[inline(always)]
fn factor(
    factor: BlendFactor,
    c: usize,
    source: &[[f32; LANES]; 4],
    old: &[[f32; LANES]; 4],
    out: &mut [f32; LANES],
) {
    use BlendFactor as B;
    let (of, inverse) = match factor {
        B::Zero => {
            *out = [0.0; LANES];
            return;
        }
        B::One => {
            *out = [1.0; LANES];
            return;
        }
        B::Source => (&source[c], false),
        B::OneMinusSource => (&source[c], true),
        B::SourceAlpha => (&source[3], false),
        B::OneMinusSourceAlpha => (&source[3], true),
        B::Target => (&old[c], false),
        B::OneMinusTarget => (&old[c], true),
        B::TargetAlpha => (&old[3], false),
        B::OneMinusTargetAlpha => (&old[3], true),
    };
    for k in 0..LANES {
        out[k] = if inverse { 1.0 - of[k] } else { of[k] };
    }
}
