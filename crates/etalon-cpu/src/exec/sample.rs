//! Handler of filtered reads.
//!
//! Coordinates and weights are `f32` in every number type, as devices' filters
//! are. Texel addresses follow Vulkan 1.3, §16.8 and §16.9 (image operations,
//! texel selection).

use etalon_core::resource::{AddressMode, Filter, SamplerDesc};

use super::image::{gather, texture, wanted};
use super::link::Instr;
use super::memory::rounds;
use super::state::{Resource, State};
use super::tier::{Handler, Step, Tier};
use crate::ir::{ImageAccess, Op};
use crate::memory::{Level, TextureView, decode};
use crate::num::Number;
use crate::registers::LANES;

pub(super) fn sample<N: Number>(tier: Tier, varying: bool) -> Handler<N> {
    if varying {
        Handler::new::<Sample<LANES>>(tier)
    } else {
        Handler::plain::<Sample<1>>()
    }
}

struct Sample<const K: usize>;

impl<N: Number, const K: usize> Step<N> for Sample<K> {
    #[inline(always)]
    fn run(state: &mut State<'_, N>, instr: &Instr) {
        let inst = state.inst(instr.index);
        let Op::ImageSample { access, sampler } = inst.op else {
            return;
        };
        let Some(texture) = texture(state, access.image) else {
            return;
        };
        let Some(&Resource::Sampler(sampler)) = state.resources.get(usize::from(sampler)) else {
            return;
        };
        let coordinates = usize::from(access.coordinates);
        for chunk in 0..rounds::<N, K>(state) {
            let floats = |i: usize| state.floats::<K>(inst.operands[i], chunk).map(N::to_f32);
            let position = [
                floats(0),
                floats(1),
                if coordinates == 3 {
                    floats(2)
                } else {
                    [0.0; K]
                },
            ];
            let layer = if access.layered {
                state.ints(inst.operands[coordinates], chunk)
            } else {
                [0; K]
            };
            let lod = floats(coordinates + usize::from(access.layered));
            let request = Request {
                texture,
                sampler,
                wanted: wanted(inst),
                layer,
                cube: access.cube,
                volume: coordinates == 3 && !access.cube,
            };
            let channels = request.run(&position, &lod);
            for (result, channel) in inst.results.iter().zip(&channels) {
                if let Some(to) = *result {
                    state.set_bits(to, chunk, &channel.map(f32::to_bits));
                }
            }
        }
    }
}

/// The first channel of one sample.
pub(super) fn one(
    texture: &TextureView<'_>,
    sampler: SamplerDesc,
    access: ImageAccess,
    position: [f32; 3],
    layer: u32,
    lod: f32,
) -> f32 {
    let request = Request {
        texture,
        sampler,
        wanted: [true, false, false, false],
        layer: [layer],
        cube: access.cube,
        volume: access.coordinates == 3 && !access.cube,
    };
    request.run(&position.map(|axis| [axis]), &[lod])[0][0]
}

struct Request<'a, const K: usize> {
    texture: &'a TextureView<'a>,
    sampler: SamplerDesc,
    wanted: [bool; 4],
    /// As given, not yet clamped.
    layer: [u32; K],
    cube: bool,
    volume: bool,
}

impl<const K: usize> Request<'_, K> {
    #[inline(always)]
    fn run(&self, position: &[[f32; K]; 3], lod: &[f32; K]) -> [[f32; K]; 4] {
        let last = self.texture.levels.len() as i32 - 1;
        let top = last as f32;
        // NaN becomes 0.
        let lod = lod.map(|lod| {
            if lod > 0.0 {
                if lod < top { lod } else { top }
            } else {
                0.0
            }
        });
        let (level, weight): ([i32; K], [f32; K]) = match self.sampler.mip_filter {
            // Half way goes to the finer level.
            Filter::Nearest => (
                lod.map(|lod| ((lod + 0.5).ceil() as i32 - 1).clamp(0, last)),
                [0.0; K],
            ),
            Filter::Linear => {
                let fine = lod.map(Number::to_i32);
                (fine, std::array::from_fn(|k| lod[k] - fine[k] as f32))
            }
        };
        let levels = if weight.iter().any(|&weight| weight > 0.0) {
            2
        } else {
            1
        };
        let mut sum = [[0.0; K]; 4];
        for step in 0..levels {
            let scale = weight.map(|weight| if step == 1 { weight } else { 1.0 - weight });
            let level = level.map(|level| (level + step).min(last));
            let flat = !self.cube && !self.volume;
            match self.texture.levels.get(level[0] as usize) {
                Some(&one)
                    if flat && level.iter().fold(0, |all, other| all | (other ^ level[0])) == 0 =>
                {
                    self.add_flat(one, &scale, [&position[0], &position[1]], &mut sum);
                }
                _ => self.add_level(&level, &scale, position, &mut sum),
            }
        }
        sum
    }

    /// Adds what one level of a flat texture has at `position`, times `scale`.
    #[inline(always)]
    fn add_flat(
        &self,
        level: Level,
        scale: &[f32; K],
        position: [&[f32; K]; 2],
        sum: &mut [[f32; K]; 4],
    ) {
        let Level {
            width,
            height,
            depth,
            start,
        } = level;
        let linear = self.sampler.filter == Filter::Linear;
        let (x, fx) = self.axis(position[0], &[width; K]);
        let (y, fy) = self.axis(position[1], &[height; K]);
        let columns = self.columns(&x, width);
        let mut rows = self.columns(&y, height);
        for k in 0..K {
            let layer = (self.layer[k] as i32).clamp(0, depth as i32 - 1) as u32;
            for row in &mut rows {
                row[k] = start + (layer * height + row[k]) * width;
            }
        }
        for tap in 0..if linear { 4 } else { 1 } {
            let (dx, dy) = (tap & 1, tap >> 1);
            let (mut index, mut weight) = ([0; K], *scale);
            for k in 0..K {
                index[k] = rows[dy][k] + columns[dx][k];
            }
            if linear {
                for k in 0..K {
                    let horizontal = if dx == 1 { fx[k] } else { 1.0 - fx[k] };
                    let vertical = if dy == 1 { fy[k] } else { 1.0 - fy[k] };
                    weight[k] = weight[k] * horizontal * vertical;
                }
            }
            self.add_weighted(&index, &weight, sum);
        }
    }

    /// Addresses of the first and second texels along an axis.
    #[inline(always)]
    fn columns(&self, first: &[i32; K], size: u32) -> [[u32; K]; 2] {
        let mut columns = [[0; K]; 2];
        match self.sampler.address {
            AddressMode::ClampToEdge => {
                let last = size as i32 - 1;
                for k in 0..K {
                    columns[0][k] = first[k].max(0).min(last) as u32;
                    columns[1][k] = (first[k].min(last) + 1).max(0).min(last) as u32;
                }
            }
            _ => {
                for k in 0..K {
                    columns[0][k] = self.address(first[k], size);
                    columns[1][k] = self.address(first[k].saturating_add(1), size);
                }
            }
        }
        columns
    }

    /// Adds texels times their weights.
    #[inline(always)]
    fn add_weighted(&self, index: &[u32; K], weight: &[f32; K], sum: &mut [[f32; K]; 4]) {
        let mut words = [[0; K]; 2];
        gather(self.texture.texels, index, &mut words);
        let mut channels = [[0; K]; 4];
        decode(
            self.texture.desc().format,
            &words,
            self.wanted,
            &mut channels,
        );
        for (channel, sum) in sum.iter_mut().enumerate() {
            if self.wanted[channel] {
                for k in 0..K {
                    sum[k] += weight[k] * f32::from_bits(channels[channel][k]);
                }
            }
        }
    }

    /// Adds what a level has at `position`, times `scale`.
    #[inline(always)]
    fn add_level(
        &self,
        level: &[i32; K],
        scale: &[f32; K],
        position: &[[f32; K]; 3],
        sum: &mut [[f32; K]; 4],
    ) {
        let levels: [Level; K] = std::array::from_fn(|k| {
            self.texture
                .levels
                .get(level[k] as usize)
                .copied()
                .unwrap_or(Level {
                    width: 1,
                    height: 1,
                    depth: 1,
                    start: 0,
                })
        });
        let (mut u, mut v, mut face) = (position[0], position[1], [0; K]);
        if self.cube {
            for k in 0..K {
                let (f, [s, t]) = cube_face([position[0][k], position[1][k], position[2][k]]);
                (face[k], u[k], v[k]) = (f, s, t);
            }
        }
        let x = self.axis(&u, &levels.map(|level| level.width));
        let y = self.axis(&v, &levels.map(|level| level.height));
        let z = if self.volume {
            self.axis(&position[2], &levels.map(|level| level.depth))
        } else {
            ([0; K], [0.0; K])
        };
        let taps = if self.sampler.filter == Filter::Linear {
            2
        } else {
            1
        };
        let taps = taps * taps * if self.volume { taps } else { 1 };
        for tap in 0..taps {
            self.add_texels(
                [tap & 1, tap >> 1 & 1, tap >> 2],
                &levels,
                scale,
                [&x, &y, &z],
                &face,
                sum,
            );
        }
    }

    /// First texel and weight of the second along an axis.
    #[inline(always)]
    fn axis(&self, coordinate: &[f32; K], size: &[u32; K]) -> ([i32; K], [f32; K]) {
        let linear = self.sampler.filter == Filter::Linear;
        let (mut first, mut weight) = ([0; K], [0.0; K]);
        for k in 0..K {
            let scaled = coordinate[k] * size[k] as f32 - if linear { 0.5 } else { 0.0 };
            let floor = scaled.floor();
            first[k] = Number::to_i32(floor);
            weight[k] = if linear { scaled - floor } else { 0.0 };
        }
        (first, weight)
    }

    /// Adds one of the texels around the positions, times its weight.
    #[inline(always)]
    fn add_texels(
        &self,
        offset: [i32; 3],
        levels: &[Level; K],
        scale: &[f32; K],
        axes: [&([i32; K], [f32; K]); 3],
        face: &[u32; K],
        sum: &mut [[f32; K]; 4],
    ) {
        let (mut index, mut weight) = ([0; K], *scale);
        for k in 0..K {
            let Level {
                width,
                height,
                depth,
                start,
            } = levels[k];
            let [x, y, z]: [i32; 3] =
                std::array::from_fn(|axis| axes[axis].0[k].saturating_add(offset[axis]));
            let (x, y, layer) = if self.cube {
                let (face, x, y) = cube_texel(face[k], x, y, width as i32);
                let cubes = depth / 6;
                (x, y, self.layer[k].min(cubes.saturating_sub(1)) * 6 + face)
            } else {
                let layer = if self.volume {
                    self.address(z, depth)
                } else {
                    (self.layer[k] as i32).clamp(0, depth as i32 - 1) as u32
                };
                (self.address(x, width), self.address(y, height), layer)
            };
            index[k] = start + (layer * height + y) * width + x;
        }
        for (axis, &offset) in offset.iter().enumerate() {
            if self.sampler.filter == Filter::Linear && (axis < 2 || self.volume) {
                for k in 0..K {
                    let second = axes[axis].1[k];
                    weight[k] *= if offset == 1 { second } else { 1.0 - second };
                }
            }
        }
        self.add_weighted(&index, &weight, sum);
    }

    #[inline(always)]
    fn address(&self, at: i32, size: u32) -> u32 {
        let size = size as i32;
        (match self.sampler.address {
            AddressMode::ClampToEdge => at.clamp(0, size - 1),
            AddressMode::Repeat => at.rem_euclid(size),
            AddressMode::MirrorRepeat => {
                let at = at.rem_euclid(2 * size);
                at.min(2 * size - 1 - at)
            }
        }) as u32
    }
}

/// The face a direction meets and where on it, in [0, 1] (Vulkan 1.3, §16.5.4).
fn cube_face(direction: [f32; 3]) -> (u32, [f32; 2]) {
    let [x, y, z] = direction;
    let (ax, ay, az) = (x.abs(), y.abs(), z.abs());
    let (face, s, t, major) = if az >= ax && az >= ay {
        if z >= 0.0 {
            (4, x, -y, az)
        } else {
            (5, -x, -y, az)
        }
    } else if ay >= ax {
        if y >= 0.0 {
            (2, x, z, ay)
        } else {
            (3, x, -z, ay)
        }
    } else if x >= 0.0 {
        (0, -z, -y, ax)
    } else {
        (1, z, -y, ax)
    };
    (face, [0.5 * (s / major + 1.0), 0.5 * (t / major + 1.0)])
}

/// A direction that meets a face at `s`, `t` in [-1, 1] or beyond.
fn cube_direction(face: u32, s: f32, t: f32) -> [f32; 3] {
    match face {
        0 => [1.0, -t, -s],
        1 => [-1.0, -t, s],
        2 => [s, 1.0, t],
        3 => [s, -1.0, -t],
        4 => [s, -t, 1.0],
        _ => [-s, -t, -1.0],
    }
}

/// The texel next to a face's edge is on the neighbouring face.
fn cube_texel(face: u32, x: i32, y: i32, size: i32) -> (u32, u32, u32) {
    let inside = |at: i32| at.clamp(0, size - 1) as u32;
    if (0..size).contains(&x) && (0..size).contains(&y) {
        return (face, x as u32, y as u32);
    }
    let centre = |at: i32| 2.0 * (at.clamp(-1, size) as f32 + 0.5) / size as f32 - 1.0;
    let (face, [s, t]) = cube_face(cube_direction(face, centre(x), centre(y)));
    let texel = |at: f32| inside((at * size as f32).floor() as i32);
    (face, texel(s), texel(t))
}
