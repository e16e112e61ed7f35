//! Filtered reads, gathers and comparisons against a scalar reference that
//! filters in f64.

// Axes and texels index several arrays alike.
#![allow(clippy::needless_range_loop)]

use crate::common;

use common::*;
use etalon_core::Format;
use etalon_core::image::ImageData;
use etalon_core::resource::{
    AddressMode, Compare, Dimension, Extent, Filter, LodRange, SamplerDesc, TextureDesc,
};
use etalon_cpu::{BoundResource, Program, RunError, Texture};

/// A generator of numbers in [0, 1).
struct Random(u64);

impl Random {
    fn next(&mut self) -> f32 {
        self.0 = self
            .0
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 40) as f32 / 16_777_216.0
    }

    fn range(&mut self, low: f32, high: f32) -> f32 {
        low + (high - low) * self.next()
    }

    fn pick<T: Copy>(&mut self, of: &[T]) -> T {
        of[(self.next() * of.len() as f32) as usize % of.len()]
    }
}

const ADDRESSES: [AddressMode; 3] = [
    AddressMode::ClampToEdge,
    AddressMode::Repeat,
    AddressMode::MirrorRepeat,
];
const FILTERS: [Filter; 2] = [Filter::Nearest, Filter::Linear];

/// Numbers in [0, 1] in every texel.
fn filled(desc: TextureDesc, seed: u64) -> ImageData {
    let mut random = Random(seed);
    let count = desc.bytes().unwrap() / u64::from(desc.format.texel_bytes());
    let texels: Vec<[f32; 4]> = (0..count)
        .map(|_| std::array::from_fn(|_| random.next()))
        .collect();
    ImageData::from_rgba_f32(desc, &texels).unwrap()
}

fn wrap(mode: AddressMode, at: i64, size: u32) -> u32 {
    let size = i64::from(size);
    (match mode {
        AddressMode::ClampToEdge => at.clamp(0, size - 1),
        AddressMode::Repeat => at.rem_euclid(size),
        AddressMode::MirrorRepeat => {
            let at = at.rem_euclid(2 * size);
            if at < size { at } else { 2 * size - 1 - at }
        }
    }) as u32
}

/// What a read asks for.
#[derive(Clone, Copy, Debug)]
struct Ask {
    axes: usize,
    at: [f32; 3],
    layer: i64,
    offset: [i64; 3],
    lod: f64,
    /// Compared with the texels.
    reference: Option<(Compare, f32)>,
}

fn holds(compare: Compare, reference: f32, texel: f32) -> bool {
    match compare {
        Compare::Never => false,
        Compare::Less => reference < texel,
        Compare::Equal => reference == texel,
        Compare::LessEqual => reference <= texel,
        Compare::Greater => reference > texel,
        Compare::NotEqual => reference != texel,
        Compare::GreaterEqual => reference >= texel,
        Compare::Always => true,
    }
}

/// One channel of one texel that is already inside, or its comparison.
fn texel(image: &ImageData, ask: &Ask, [x, y, z]: [u32; 3], mip: u32, channel: usize) -> f64 {
    let value = image.texel(x, y, z, mip).unwrap().to_f64()[channel];
    match ask.reference {
        Some((compare, reference)) => f64::from(u8::from(holds(compare, reference, value as f32))),
        None => value,
    }
}

/// First texel along an axis and the weight of the second; selected in f32, as
/// coordinates are f32.
fn along(coordinate: f32, size: u32, linear: bool) -> (i64, f64) {
    let scaled = coordinate * size as f32 - if linear { 0.5 } else { 0.0 };
    let first = scaled.floor();
    (
        first as i64,
        if linear {
            f64::from(scaled - first)
        } else {
            0.0
        },
    )
}

fn one_level(
    image: &ImageData,
    sampler: &SamplerDesc,
    ask: &Ask,
    filter: Filter,
    mip: u32,
    channel: usize,
) -> f64 {
    let extent = image.desc.mip_extent(mip);
    let size = [extent.width, extent.height, extent.depth_or_layers];
    let linear = filter == Filter::Linear;
    let mut sum = 0.0;
    for tap in 0..1_usize << ask.axes {
        let (mut position, mut weight) = ([0_u32; 3], 1.0);
        for axis in 0..ask.axes {
            let (first, second) = along(ask.at[axis], size[axis], linear);
            let bit = (tap >> axis & 1) as i64;
            position[axis] = wrap(
                sampler.address[axis],
                first + bit + ask.offset[axis],
                size[axis],
            );
            weight *= if bit == 1 { second } else { 1.0 - second };
        }
        if ask.axes < 3 {
            position[2] = ask.layer.clamp(0, i64::from(size[2]) - 1) as u32;
        }
        if weight > 0.0 {
            sum += weight * texel(image, ask, position, mip, channel);
        }
    }
    sum
}

/// A filtered read as Vulkan 1.3, §16, defines it.
fn sampled(image: &ImageData, sampler: &SamplerDesc, ask: &Ask, channel: usize) -> f64 {
    let lod = ask
        .lod
        .max(f64::from(sampler.lod.min) / 256.0)
        .min(f64::from(sampler.lod.max) / 256.0);
    let filter = if lod <= 0.0 {
        sampler.mag_filter
    } else {
        sampler.min_filter
    };
    let last = image.desc.mips - 1;
    let lod = lod.clamp(0.0, f64::from(last));
    let level = |mip: u32| one_level(image, sampler, ask, filter, mip.min(last), channel);
    match sampler.mip_filter {
        Filter::Nearest => level(((lod + 0.5).ceil() as u32).saturating_sub(1)),
        Filter::Linear => {
            let fine = lod.floor();
            let weight = lod - fine;
            let first = level(fine as u32) * (1.0 - weight);
            if weight > 0.0 {
                first + level(fine as u32 + 1) * weight
            } else {
                first
            }
        }
    }
}

/// Runs on every executor, which must agree, with texture, sampler, data and
/// result as bindings 0 to 3.
fn run(
    program: &Program,
    texture: &Texture,
    sampler: SamplerDesc,
    data: &[f32],
    invocations: u32,
    results: usize,
) -> Vec<u32> {
    let input = floats(data);
    let mut first: Option<Vec<u32>> = None;
    for (name, executor) in executors() {
        let result = buffer(&vec![0; results]);
        let bound: Vec<BoundResource<'_>> = program
            .bindings()
            .iter()
            .map(|binding| match binding.binding {
                0 => BoundResource::Texture(texture.view()),
                1 => BoundResource::Sampler(sampler),
                2 => BoundResource::Buffer(&input),
                _ => BoundResource::Buffer(&result),
            })
            .collect();
        program
            .dispatch(&executor, [invocations / 64, 1, 1], &bound)
            .unwrap();
        let got = words(&result);
        assert!(
            first.as_ref().is_none_or(|first| *first == got),
            "{name} differs"
        );
        first = Some(got);
    }
    first.unwrap()
}

/// A kernel that stores `value`, a vec4, for each of its invocations; `d(i)` is
/// the `i`th of the eight numbers of an invocation.
fn kernel(texture: &str, sampler: &str, value: &str) -> Program {
    program(&format!(
        "@group(0) @binding(0) var t: {texture};
         @group(0) @binding(1) var s: {sampler};
         @group(0) @binding(2) var<storage, read> data: array<f32>;
         @group(0) @binding(3) var<storage, read_write> result: array<vec4<f32>>;
         var<private> first: u32;
         fn d(i: u32) -> f32 {{ return data[first + i]; }}
         @compute @workgroup_size(64)
         fn main(@builtin(global_invocation_id) id: vec3<u32>) {{
             first = id.x * 8u;
             result[id.x] = {value};
         }}"
    ))
}

const COUNT: u32 = 192;

/// Coordinates around and in the texture, layer, level, reference.
fn asks(random: &mut Random, mips: u32) -> Vec<f32> {
    (0..COUNT)
        .flat_map(|i| {
            let lod = match i % 4 {
                0 => 0.0,
                1 => random.range(-1.0, 1.0),
                _ => random.range(-0.5, mips as f32),
            };
            [
                random.range(-1.5, 2.5),
                random.range(-1.5, 2.5),
                random.range(-1.5, 2.5),
                (random.next() * 6.0).floor() - 1.0,
                lod,
                random.next(),
                0.0,
                0.0,
            ]
        })
        .collect()
}

/// Shapes with their WGSL type, coordinates and layer.
fn shapes() -> [(&'static str, &'static str, &'static str, usize, TextureDesc); 4] {
    let desc = |dimension, width, height, depth_or_layers, mips| TextureDesc {
        dimension,
        extent: Extent {
            width,
            height,
            depth_or_layers,
        },
        mips,
        format: Format::R32Float,
    };
    [
        (
            "texture_1d<f32>",
            "d(0u)",
            "",
            1,
            desc(Dimension::D2, 13, 1, 1, 3),
        ),
        (
            "texture_2d<f32>",
            "vec2(d(0u), d(1u))",
            "",
            2,
            desc(Dimension::D2, 11, 6, 1, 3),
        ),
        (
            "texture_2d_array<f32>",
            "vec2(d(0u), d(1u))",
            ", i32(d(3u))",
            2,
            desc(Dimension::D2, 7, 9, 4, 2),
        ),
        (
            "texture_3d<f32>",
            "vec3(d(0u), d(1u), d(2u))",
            "",
            3,
            desc(Dimension::D3, 6, 5, 7, 3),
        ),
    ]
}

/// 32 products of numbers up to 1, each rounded up to five times, and their sum.
const TOLERANCE: f64 = 192.0 / 16_777_216.0;

#[test]
fn every_shape_filter_address_and_level_is_the_reference() {
    let formats = [
        Format::R32Float,
        Format::Rgba32Float,
        Format::Rgba16Float,
        Format::Rg16Float,
        Format::R16Float,
        Format::Rgba8Unorm,
        Format::Rgba8UnormSrgb,
        Format::Rg11b10Ufloat,
        Format::R8Unorm,
        Format::Rgb9e5Ufloat,
    ];
    let mut random = Random(1);
    for (wgsl, at, layer, axes, desc) in shapes() {
        for offset in [[0_i64; 3], [3, -8, 7]] {
            let text = match (axes, offset) {
                (1, [0, ..]) | (2, [0, ..]) | (3, [0, ..]) => String::new(),
                // naga has no offsets in one dimension.
                (1, _) => continue,
                (2, [x, y, _]) => format!(", vec2<i32>({x}, {y})"),
                (_, [x, y, z]) => format!(", vec3<i32>({x}, {y}, {z})"),
            };
            let program = kernel(
                wgsl,
                "sampler",
                &format!("textureSampleLevel(t, s, {at}{layer}, d(4u){text})"),
            );
            for round in 0..12_usize {
                let image = filled(desc.with_format(formats[round % formats.len()]), 7);
                let texture = texture(&image);
                let sampler = SamplerDesc {
                    address: std::array::from_fn(|_| random.pick(&ADDRESSES)),
                    mag_filter: random.pick(&FILTERS),
                    min_filter: random.pick(&FILTERS),
                    mip_filter: random.pick(&FILTERS),
                    lod: random.pick(&[
                        LodRange::ALL,
                        LodRange { min: 64, max: 300 },
                        LodRange { min: 0, max: 128 },
                    ]),
                    compare: None,
                };
                let data = asks(&mut random, desc.mips);
                let got = run(
                    &program,
                    &texture,
                    sampler,
                    &data,
                    COUNT,
                    COUNT as usize * 4,
                );
                for (got, d) in got.chunks(4).zip(data.chunks(8)) {
                    let ask = Ask {
                        axes,
                        at: [d[0], d[1], d[2]],
                        layer: d[3] as i64,
                        offset,
                        lod: f64::from(d[4]),
                        reference: None,
                    };
                    for (channel, &got) in got.iter().enumerate() {
                        let want = sampled(&image, &sampler, &ask, channel);
                        let got = f64::from(f32::from_bits(got));
                        assert!(
                            (got - want).abs() <= TOLERANCE,
                            "{wgsl} {} {sampler:?} {ask:?} {channel}: {got}, not {want}",
                            image.desc.format
                        );
                    }
                }
            }
        }
    }
}

/// Where all lanes name one level by a literal, texels are read block by block; where
/// each has a level of its own, they are not. The same bits, inside and outside.
#[test]
fn plain_bilinear_reads_are_those_of_the_general_way() {
    let desc = shapes()[1].4;
    let mut random = Random(11);
    for format in [
        Format::Rgba16Float,
        Format::Rgba8Unorm,
        Format::R32Float,
        Format::Rg16Float,
    ] {
        let image = filled(desc.with_format(format), 3);
        let texture = texture(&image);
        for (lod, offset) in [(0.0_f32, ""), (1.0, ""), (0.0, ", vec2<i32>(3, -8)")] {
            let sampled = |level: &str| {
                let at = "vec2<f32>(d(0u), d(1u))";
                let value = format!("textureSampleLevel(t, s, {at}, {level}{offset})");
                kernel("texture_2d<f32>", "sampler", &value)
            };
            let (together, each) = (sampled(&format!("{lod:?}")), sampled("d(4u)"));
            for address in [AddressMode::ClampToEdge, AddressMode::Repeat] {
                let sampler = SamplerDesc {
                    address: [address, AddressMode::ClampToEdge, address],
                    ..SamplerDesc::LINEAR_CLAMP
                };
                let mut data = asks(&mut random, desc.mips);
                for ask in data.chunks_mut(8) {
                    ask[4] = lod;
                }
                // Far outside, and no number.
                for (at, special) in [f32::INFINITY, -1e30, f32::NAN, -0.0]
                    .into_iter()
                    .enumerate()
                {
                    data[8 * at] = special;
                }
                let run = |program: &Program| {
                    run(program, &texture, sampler, &data, COUNT, COUNT as usize * 4)
                };
                for (i, (got, want)) in run(&together).iter().zip(run(&each)).enumerate() {
                    let nans = [*got, want].map(|bits| f32::from_bits(bits).is_nan());
                    assert!(
                        *got == want || nans == [true; 2],
                        "{format}, level {lod}{offset}, {sampler:?}, {i}: {got:x}, not {want:x}"
                    );
                }
            }
        }
    }
}

#[test]
fn the_reference_notices_a_wrong_mode() {
    // What the comparison above stands on: another address mode, filter or
    // level range is told apart.
    let (wgsl, at, _, axes, desc) = shapes()[1];
    let image = filled(desc, 7);
    let program = kernel(
        wgsl,
        "sampler",
        &format!("textureSampleLevel(t, s, {at}, d(4u))"),
    );
    let data = asks(&mut Random(5), desc.mips);
    let right = SamplerDesc::LINEAR_CLAMP;
    let got = run(
        &program,
        &texture(&image),
        right,
        &data,
        COUNT,
        COUNT as usize * 4,
    );
    let worst = |sampler: SamplerDesc| {
        got.chunks(4)
            .zip(data.chunks(8))
            .map(|(got, d)| {
                let ask = Ask {
                    axes,
                    at: [d[0], d[1], 0.0],
                    layer: 0,
                    offset: [0; 3],
                    lod: f64::from(d[4]),
                    reference: None,
                };
                (f64::from(f32::from_bits(got[0])) - sampled(&image, &sampler, &ask, 0)).abs()
            })
            .fold(0.0, f64::max)
    };
    assert!(worst(right) <= TOLERANCE);
    let mut wrong = [right; 5];
    wrong[0].address[1] = AddressMode::Repeat;
    wrong[1].mag_filter = Filter::Nearest;
    wrong[2].min_filter = Filter::Nearest;
    wrong[3].mip_filter = Filter::Nearest;
    wrong[4].lod.max = 200;
    for wrong in wrong {
        assert!(worst(wrong) > 0.01, "{wrong:?}");
    }
}

#[test]
fn derivatives_choose_the_level() {
    for (wgsl, at, layer, axes, desc) in shapes() {
        if axes == 1 {
            continue;
        }
        let image = filled(desc.with_format(Format::Rgba16Float), 9);
        let vector = |a: u32| {
            let part: Vec<String> = (0..axes as u32)
                .map(|i| format!("d({}u)", (a + i) % 8))
                .collect();
            format!("vec{axes}({})", part.join(", "))
        };
        // Derivatives come from other numbers of the invocation, scaled.
        let program = kernel(
            wgsl,
            "sampler",
            &format!(
                "textureSampleGrad(t, s, {at}{layer}, 0.1 * {}, 0.1 * {})",
                vector(4),
                vector(5)
            ),
        );
        let sampler = SamplerDesc::LINEAR_CLAMP;
        let mut random = Random(11);
        let mut data = asks(&mut random, desc.mips);
        for d in data.chunks_mut(8) {
            d[6] = random.range(-2.0, 2.0);
            d[7] = random.range(-2.0, 2.0);
        }
        // A derivative of zero magnifies.
        for index in [4, 5, 6, 7, 0] {
            data[index] = 0.0;
        }
        let got = run(
            &program,
            &texture(&image),
            sampler,
            &data,
            COUNT,
            COUNT as usize * 4,
        );
        let extent = desc.mip_extent(0);
        let size = [extent.width, extent.height, extent.depth_or_layers].map(f64::from);
        for (got, d) in got.chunks(4).zip(data.chunks(8)) {
            let length = |first: usize| {
                (0..axes)
                    .map(|axis| 0.1 * f64::from(d[(first + axis) % 8]) * size[axis])
                    .map(|texels| texels * texels)
                    .sum::<f64>()
                    .sqrt()
            };
            let ask = Ask {
                axes,
                at: [d[0], d[1], d[2]],
                layer: d[3] as i64,
                offset: [0; 3],
                lod: length(4).max(length(5)).log2(),
                reference: None,
            };
            let want = sampled(&image, &sampler, &ask, 1);
            let got = f64::from(f32::from_bits(got[1]));
            // The squares, their sum and the logarithm are each rounded: the
            // level is within 2^-20, and moves the result by less than that.
            assert!(
                (got - want).abs() <= TOLERANCE + 1.0 / 1_048_576.0,
                "{wgsl} {ask:?}: {got}, not {want}"
            );
        }
    }
}

#[test]
fn comparisons_are_made_before_filtering() {
    let all = [
        Compare::Never,
        Compare::Less,
        Compare::Equal,
        Compare::LessEqual,
        Compare::Greater,
        Compare::NotEqual,
        Compare::GreaterEqual,
        Compare::Always,
    ];
    let mut random = Random(21);
    for (format, quantum) in [(Format::Depth32Float, 0.25), (Format::Depth16Unorm, 1.0)] {
        for (wgsl, layer, layers) in [
            ("texture_depth_2d", "", 1),
            ("texture_depth_2d_array", ", i32(d(3u))", 4),
        ] {
            let desc = TextureDesc {
                dimension: Dimension::D2,
                extent: Extent {
                    width: 9,
                    height: 5,
                    depth_or_layers: layers,
                },
                mips: 2,
                format,
            };
            // Few values, so that some are equal to the reference.
            let count = (desc.bytes().unwrap() / u64::from(format.texel_bytes())) as usize;
            let texels: Vec<[f32; 4]> = (0..count)
                .map(|_| {
                    [
                        (random.next() * 5.0).floor() * quantum / 4.0_f32.max(quantum),
                        0.0,
                        0.0,
                        1.0,
                    ]
                })
                .collect();
            let image = ImageData::from_rgba_f32(desc, &texels).unwrap();
            let program = kernel(
                wgsl,
                "sampler_comparison",
                &format!(
                    "vec4(textureSampleCompareLevel(t, s, vec2(d(0u), d(1u)){layer}, d(5u)),
                          textureSampleCompareLevel(t, s, vec2(d(0u), d(1u)){layer}, d(5u), vec2<i32>(1, -2)),
                          0.0, 0.0)"
                ),
            );
            for compare in all {
                for filter in FILTERS {
                    let sampler = SamplerDesc::new(AddressMode::Repeat, filter, Filter::Nearest)
                        .comparing(compare);
                    let mut data = asks(&mut random, 1);
                    for d in data.chunks_mut(8) {
                        d[5] = random.pick(&[0.0, 0.0625, 0.1, 0.25, 0.5, -2.0, 3.0, 1.0]);
                    }
                    let got = run(
                        &program,
                        &texture(&image),
                        sampler,
                        &data,
                        COUNT,
                        COUNT as usize * 4,
                    );
                    for (got, d) in got.chunks(4).zip(data.chunks(8)) {
                        let reference = if format == Format::Depth16Unorm {
                            d[5].clamp(0.0, 1.0)
                        } else {
                            d[5]
                        };
                        for (i, offset) in [[0; 3], [1, -2, 0]].into_iter().enumerate() {
                            let ask = Ask {
                                axes: 2,
                                at: [d[0], d[1], 0.0],
                                layer: d[3] as i64,
                                offset,
                                lod: 0.0,
                                reference: Some((compare, reference)),
                            };
                            let want = sampled(&image, &sampler, &ask, 0);
                            let got = f64::from(f32::from_bits(got[i]));
                            assert!(
                                (got - want).abs() <= TOLERANCE,
                                "{format} {sampler:?} {ask:?}: {got}, not {want}"
                            );
                        }
                    }
                }
            }
        }
    }
}

#[test]
fn depth_textures_are_sampled_and_gathered_as_one_number() {
    let desc = TextureDesc::d2(9, 5, Format::Depth32Float).with_mips(3);
    let image = filled(desc, 3);
    let program = kernel(
        "texture_depth_2d",
        "sampler",
        "vec4(textureSampleLevel(t, s, vec2(d(0u), d(1u)), 1),
              textureSampleLevel(t, s, vec2(d(0u), d(1u)), i32(d(4u))),
              textureGather(t, s, vec2(d(0u), d(1u))).x,
              textureLoad(t, vec2<i32>(vec2(d(0u), d(1u)) * 4.0), 0))",
    );
    let sampler = SamplerDesc::LINEAR_CLAMP;
    let data = asks(&mut Random(31), 3);
    let got = run(
        &program,
        &texture(&image),
        sampler,
        &data,
        COUNT,
        COUNT as usize * 4,
    );
    for (got, d) in got.chunks(4).zip(data.chunks(8)) {
        let at = |lod: f64| Ask {
            axes: 2,
            at: [d[0], d[1], 0.0],
            layer: 0,
            offset: [0; 3],
            lod,
            reference: None,
        };
        let (x, _) = along(d[0], 9, true);
        let (y, _) = along(d[1], 5, true);
        let position = [
            wrap(AddressMode::ClampToEdge, x, 9),
            wrap(AddressMode::ClampToEdge, y + 1, 5),
            0,
        ];
        let loaded = (
            u32::try_from((d[0] * 4.0) as i32),
            u32::try_from((d[1] * 4.0) as i32),
        );
        let loaded = match loaded {
            (Ok(x), Ok(y)) => image
                .texel(x, y, 0, 0)
                .map_or(0.0, |texel| texel.to_f64()[0]),
            _ => 0.0,
        };
        let want = [
            sampled(&image, &sampler, &at(1.0), 0),
            sampled(&image, &sampler, &at(f64::from(d[4].trunc())), 0),
            texel(&image, &at(0.0), position, 0, 0),
            loaded,
        ];
        for (got, want) in got.iter().zip(want) {
            let got = f64::from(f32::from_bits(*got));
            assert!((got - want).abs() <= TOLERANCE, "{d:?}: {got}, not {want}");
        }
    }
}

/// The four texels of a gather, in WGSL's order.
fn gathered(image: &ImageData, sampler: &SamplerDesc, ask: &Ask, channel: usize) -> [f64; 4] {
    let extent = image.desc.mip_extent(0);
    let (x, _) = along(ask.at[0], extent.width, true);
    let (y, _) = along(ask.at[1], extent.height, true);
    let layer = ask.layer.clamp(0, i64::from(extent.depth_or_layers) - 1) as u32;
    // textureGather's order: (umin, vmax), (umax, vmax), (umax, vmin), (umin, vmin).
    [(0, 1), (1, 1), (1, 0), (0, 0)].map(|(dx, dy)| {
        let position = [
            wrap(sampler.address[0], x + dx + ask.offset[0], extent.width),
            wrap(sampler.address[1], y + dy + ask.offset[1], extent.height),
            layer,
        ];
        texel(image, ask, position, 0, channel)
    })
}

#[test]
fn gathers_are_the_four_texels_around() {
    let mut random = Random(41);
    for (scalar, format) in [
        ("f32", Format::Rgba16Float),
        ("f32", Format::R32Float),
        ("i32", Format::Rgba8Sint),
        ("u32", Format::Rgba16Uint),
    ] {
        for (shape, layer, layers) in [
            ("texture_2d", "", 1),
            ("texture_2d_array", ", u32(max(d(3u), 0.0))", 3),
        ] {
            for channel in 0..4 {
                for offset in [[0_i64, 0, 0], [-3, 7, 0]] {
                    let desc = TextureDesc {
                        dimension: Dimension::D2,
                        extent: Extent {
                            width: 8,
                            height: 5,
                            depth_or_layers: layers,
                        },
                        mips: 2,
                        format,
                    };
                    let image = if scalar == "f32" {
                        filled(desc, 5)
                    } else {
                        let bytes = (0..desc.bytes().unwrap()).map(|i| (i * 37 % 251) as u8);
                        ImageData::from_bytes(desc, bytes.collect()).unwrap()
                    };
                    let text = match offset {
                        [0, ..] => String::new(),
                        [x, y, _] => format!(", vec2<i32>({x}, {y})"),
                    };
                    let program = kernel(
                        &format!("{shape}<{scalar}>"),
                        "sampler",
                        &format!(
                            "vec4<f32>(textureGather({channel}, t, s, vec2(d(0u), d(1u)){layer}{text}))"
                        ),
                    );
                    let sampler = SamplerDesc {
                        address: std::array::from_fn(|_| random.pick(&ADDRESSES)),
                        ..SamplerDesc::default()
                    };
                    let data = asks(&mut random, 1);
                    let got = run(
                        &program,
                        &texture(&image),
                        sampler,
                        &data,
                        COUNT,
                        COUNT as usize * 4,
                    );
                    for (got, d) in got.chunks(4).zip(data.chunks(8)) {
                        let ask = Ask {
                            axes: 2,
                            at: [d[0], d[1], 0.0],
                            layer: d[3].max(0.0) as i64,
                            offset,
                            lod: 0.0,
                            reference: None,
                        };
                        let want = gathered(&image, &sampler, &ask, channel).map(|v| v as f32);
                        let got: Vec<f32> = got.iter().map(|&bits| f32::from_bits(bits)).collect();
                        assert_eq!(got, want, "{format} {shape} {channel} {sampler:?} {ask:?}");
                    }
                }
            }
        }
    }
}

#[test]
fn compared_gathers_are_ones_and_zeros() {
    let image = filled(TextureDesc::d2(7, 6, Format::Depth32Float), 51);
    let program = kernel(
        "texture_depth_2d",
        "sampler_comparison",
        "textureGatherCompare(t, s, vec2(d(0u), d(1u)), d(5u), vec2<i32>(2, 0))",
    );
    let sampler = SamplerDesc::default().comparing(Compare::GreaterEqual);
    let data = asks(&mut Random(52), 1);
    let got = run(
        &program,
        &texture(&image),
        sampler,
        &data,
        COUNT,
        COUNT as usize * 4,
    );
    for (got, d) in got.chunks(4).zip(data.chunks(8)) {
        let ask = Ask {
            axes: 2,
            at: [d[0], d[1], 0.0],
            layer: 0,
            offset: [2, 0, 0],
            lod: 0.0,
            reference: Some((Compare::GreaterEqual, d[5])),
        };
        let want = gathered(&image, &sampler, &ask, 0).map(|v| v as f32);
        assert_eq!(
            got.iter().map(|&b| f32::from_bits(b)).collect::<Vec<_>>(),
            want
        );
    }
}

#[test]
fn the_base_level_is_clamped_half_a_texel_from_the_edge() {
    let desc = TextureDesc::d2(10, 6, Format::Rgba8Unorm).with_mips(3);
    let image = filled(desc, 61);
    let program = kernel(
        "texture_2d<f32>",
        "sampler",
        "textureSampleBaseClampToEdge(t, s, vec2(d(0u), d(1u)))",
    );
    // The address mode no longer matters.
    let sampler = SamplerDesc::new(AddressMode::Repeat, Filter::Linear, Filter::Linear);
    let data = asks(&mut Random(62), 1);
    let got = run(
        &program,
        &texture(&image),
        sampler,
        &data,
        COUNT,
        COUNT as usize * 4,
    );
    for (got, d) in got.chunks(4).zip(data.chunks(8)) {
        let clamped = |at: f32, size: f32| at.max(0.5 / size).min(1.0 - 0.5 / size);
        let ask = Ask {
            axes: 2,
            at: [clamped(d[0], 10.0), clamped(d[1], 6.0), 0.0],
            layer: 0,
            offset: [0; 3],
            lod: 0.0,
            reference: None,
        };
        for (channel, &got) in got.iter().enumerate() {
            let want = sampled(&image, &SamplerDesc::LINEAR_CLAMP, &ask, channel);
            let got = f64::from(f32::from_bits(got));
            // A rounded coordinate may be one rounding past the texel's centre.
            assert!(
                (got - want).abs() <= 2.0 * TOLERANCE,
                "{d:?}: {got}, not {want}"
            );
        }
    }
}

/// Vulkan 1.3, §16.5.4, as its table is written.
fn face([x, y, z]: [f64; 3]) -> (u32, f64, f64) {
    let (face, s, t, r) = if z.abs() >= x.abs() && z.abs() >= y.abs() {
        if z >= 0.0 {
            (4, x, -y, z)
        } else {
            (5, -x, -y, z)
        }
    } else if y.abs() >= x.abs() {
        if y >= 0.0 {
            (2, x, z, y)
        } else {
            (3, x, -z, y)
        }
    } else if x >= 0.0 {
        (0, -z, -y, x)
    } else {
        (1, z, -y, x)
    };
    (face, 0.5 * (s / r.abs() + 1.0), 0.5 * (t / r.abs() + 1.0))
}

/// The direction through a place on a face.
fn through(face: u32, u: f64, v: f64) -> [f64; 3] {
    let (s, t) = (2.0 * u - 1.0, 2.0 * v - 1.0);
    match face {
        0 => [1.0, -t, -s],
        1 => [-1.0, -t, s],
        2 => [s, 1.0, t],
        3 => [s, -1.0, -t],
        4 => [s, -t, 1.0],
        _ => [-s, -t, -1.0],
    }
}

/// The four texels around a place on a cube: over an edge, those of the face
/// next to it; over a corner, the mean of the other three.
fn around(image: &ImageData, cube: u32, face_at: u32, x: i64, y: i64) -> [f64; 4] {
    let size = i64::from(image.desc.extent.width);
    let inside = |at: i64| (0..size).contains(&at);
    let mut corner = None;
    let mut texels = [0.0; 4];
    for tap in 0..4 {
        let (x, y) = (x + (tap as i64 & 1), y + (tap as i64 >> 1));
        if !inside(x) && !inside(y) {
            corner = Some(tap);
            continue;
        }
        let centre = |at: i64| (at as f64 + 0.5) / size as f64;
        let (on, u, v) = face(through(face_at, centre(x), centre(y)));
        let at = |u: f64| ((u * size as f64).floor() as i64).clamp(0, size - 1) as u32;
        texels[tap] = image
            .texel(at(u), at(v), cube * 6 + on, 0)
            .unwrap()
            .to_f64()[0];
    }
    if let Some(corner) = corner {
        texels[corner] = texels.iter().sum::<f64>() / 3.0;
    }
    texels
}

#[test]
fn cubes_are_read_across_edges_and_corners() {
    let desc = TextureDesc {
        extent: Extent {
            width: 4,
            height: 4,
            depth_or_layers: 12,
        },
        ..TextureDesc::cube(4, Format::R32Float)
    };
    let image = filled(desc, 71);
    let sample = kernel(
        "texture_cube_array<f32>",
        "sampler",
        "textureSampleLevel(t, s, vec3(d(0u), d(1u), d(2u)), i32(d(3u)), 0.0)",
    );
    let gather = kernel(
        "texture_cube_array<f32>",
        "sampler",
        "textureGather(0, t, s, vec3(d(0u), d(1u), d(2u)), i32(d(3u)))",
    );
    let mut random = Random(72);
    let mut data = Vec::new();
    while data.len() < 8 * 1536 {
        let on = (random.next() * 6.0) as u32;
        // A third near corners, all away from where rounding decides the texel.
        let mut place = || {
            if random.next() < 0.4 {
                random.pick(&[0.02, 0.06, 0.95, 0.99])
            } else {
                random.range(0.001, 0.999)
            }
        };
        let (u, v) = (f64::from(place()), f64::from(place()));
        let near = |u: f64| ((u * 4.0 - 0.5) - (u * 4.0 - 0.5).round()).abs() < 1e-4;
        if near(u) || near(v) {
            continue;
        }
        let direction = through(on, u, v).map(|c| c as f32 * 3.0);
        let cube = (random.next() * 4.0).floor() - 1.0;
        data.extend([
            direction[0],
            direction[1],
            direction[2],
            cube,
            0.0,
            0.0,
            0.0,
            0.0,
        ]);
    }
    let texture = texture(&image);
    let linear = run(
        &sample,
        &texture,
        SamplerDesc::LINEAR_CLAMP,
        &data,
        1536,
        1536 * 4,
    );
    let nearest = run(
        &sample,
        &texture,
        SamplerDesc::default(),
        &data,
        1536,
        1536 * 4,
    );
    let four = run(
        &gather,
        &texture,
        SamplerDesc::default(),
        &data,
        1536,
        1536 * 4,
    );
    let mut corners = 0;
    for (i, d) in data.chunks(8).enumerate() {
        let cube = d[3].clamp(0.0, 1.0) as u32;
        let (on, u, v) = face([d[0], d[1], d[2]].map(f64::from));
        let (x, y) = (u * 4.0 - 0.5, v * 4.0 - 0.5);
        let (fx, fy) = (x - x.floor(), y - y.floor());
        let texels = around(&image, cube, on, x.floor() as i64, y.floor() as i64);
        corners += u32::from(!(0.0..=3.0).contains(&x) && !(0.0..=3.0).contains(&y));
        let want = (texels[0] * (1.0 - fx) + texels[1] * fx) * (1.0 - fy)
            + (texels[2] * (1.0 - fx) + texels[3] * fx) * fy;
        let got = f64::from(f32::from_bits(linear[4 * i]));
        // The place on the face is rounded: 4 texels across, to 2^-22 of one.
        assert!(
            (got - want).abs() < TOLERANCE + 1e-6,
            "{d:?}: {got}, not {want}"
        );
        let order = [texels[2], texels[3], texels[1], texels[0]];
        for (got, want) in four[4 * i..4 * i + 4].iter().zip(order) {
            let got = f64::from(f32::from_bits(*got));
            assert!((got - want).abs() < 1e-6, "{d:?}: {got}, not {want}");
        }
        let at = |u: f64| (u * 4.0) as u32;
        if (u * 4.0 - (u * 4.0).round()).abs() > 1e-4 && (v * 4.0 - (v * 4.0).round()).abs() > 1e-4
        {
            let want = image
                .texel(at(u), at(v), cube * 6 + on, 0)
                .unwrap()
                .to_f64()[0];
            assert_eq!(f64::from(f32::from_bits(nearest[4 * i])), want, "{d:?}");
        }
    }
    assert!(corners > 50, "{corners}");
}

#[test]
fn derivatives_on_a_cube_are_those_of_the_face() {
    let desc = TextureDesc::cube(32, Format::R32Float).with_mips(6);
    // Each level is its own number, so that what is read is the level.
    let texels: Vec<[f32; 4]> = (0..6)
        .flat_map(|mip| vec![[mip as f32, 0.0, 0.0, 1.0]; 6 * (32_usize >> mip).pow(2)])
        .collect();
    let image = ImageData::from_rgba_f32(desc, &texels).unwrap();
    let program = kernel(
        "texture_cube<f32>",
        "sampler",
        "textureSampleGrad(t, s, vec3(d(0u), d(1u), d(2u)), vec3(d(3u), d(4u), d(5u)), vec3(d(6u), d(7u), d(3u)))",
    );
    let mut random = Random(81);
    let data: Vec<f32> = (0..COUNT)
        .flat_map(|_| {
            let mut d: [f32; 8] = std::array::from_fn(|_| random.range(-0.3, 0.3));
            for c in &mut d[..3] {
                *c = random.range(-1.0, 1.0);
            }
            d
        })
        .collect();
    let got = run(
        &program,
        &texture(&image),
        SamplerDesc::LINEAR_CLAMP,
        &data,
        COUNT,
        COUNT as usize * 4,
    );
    for (got, d) in got.chunks(4).zip(data.chunks(8)) {
        let d: Vec<f64> = d.iter().map(|&v| f64::from(v)).collect();
        let (at, dx, dy) = ([d[0], d[1], d[2]], [d[3], d[4], d[5]], [d[6], d[7], d[3]]);
        // By differences: on which face, and how fast the place moves there.
        let speed = |change: [f64; 3]| {
            let step = 1e-6;
            let moved = |sign: f64| std::array::from_fn(|i| at[i] + sign * step * change[i]);
            let ((a, u0, v0), (b, u1, v1)) = (face(moved(-1.0)), face(moved(1.0)));
            (a == b).then(|| ((u1 - u0).hypot(v1 - v0) / (2.0 * step)) * 32.0)
        };
        if let (Some(x), Some(y)) = (speed(dx), speed(dy)) {
            let want = x.max(y).log2().clamp(0.0, 5.0);
            let got = f64::from(f32::from_bits(got[0]));
            assert!((got - want).abs() < 1e-3, "{d:?}: {got}, not {want}");
        }
    }
}

#[test]
fn samplers_must_fit() {
    let image = filled(TextureDesc::d2(2, 2, Format::Depth32Float), 1);
    let texture = texture(&image);
    let (input, result) = (floats(&[0.0; 8 * 64]), buffer(&[0; 64 * 4]));
    let executor = executors().remove(0).1;
    let dispatch = |program: &Program, sampler| {
        program.dispatch(
            &executor,
            [1, 1, 1],
            &[
                BoundResource::Texture(texture.view()),
                BoundResource::Sampler(sampler),
                BoundResource::Buffer(&input),
                BoundResource::Buffer(&result),
            ],
        )
    };
    let compare = kernel(
        "texture_depth_2d",
        "sampler_comparison",
        "vec4(textureSampleCompareLevel(t, s, vec2(d(0u), d(1u)), 0.5))",
    );
    let plain = kernel(
        "texture_depth_2d",
        "sampler",
        "vec4(textureSampleLevel(t, s, vec2(d(0u), d(1u)), 0))",
    );
    let comparing = SamplerDesc::default().comparing(Compare::Less);
    dispatch(&compare, comparing).unwrap();
    dispatch(&plain, SamplerDesc::default()).unwrap();
    let upside_down = SamplerDesc {
        lod: LodRange { min: 2, max: 1 },
        ..SamplerDesc::default()
    };
    for (program, sampler, expected) in [
        (&compare, SamplerDesc::default(), "a comparison sampler"),
        (&plain, comparing, "a filtering sampler"),
        (
            &plain,
            upside_down,
            "a sampler whose least level is not above the greatest",
        ),
    ] {
        match dispatch(program, sampler) {
            Err(RunError::Binding {
                expected: found, ..
            }) => assert_eq!(found, expected),
            other => panic!("{other:?}"),
        }
    }
}
