//! Texel loads and stores, queries and filtered reads.

use crate::common;

use common::*;
use etalon_core::Format;
use etalon_core::format::SampleKind;
use etalon_core::graph::Subresources;
use etalon_core::image::ImageData;
use etalon_core::resource::{AddressMode, Dimension, Extent, Filter, SamplerDesc, TextureDesc};
use etalon_core::texel::Texel;
use etalon_cpu::{BoundResource, Texture};

/// An image of arbitrary bytes.
fn noise(desc: TextureDesc) -> ImageData {
    let count = desc.bytes().unwrap() as usize;
    let bytes = (0..count as u32)
        .map(|i| (i.wrapping_mul(2_654_435_761) >> 21) as u8)
        .collect();
    ImageData::from_bytes(desc, bytes).unwrap()
}

fn bits(texel: Texel) -> [u32; 4] {
    match texel {
        Texel::Float(c) => c.map(f32::to_bits),
        Texel::Sint(c) => c.map(|c| c as u32),
        Texel::Uint(c) => c,
    }
}

fn wgsl_type(format: Format) -> &'static str {
    match format.sample_kind() {
        SampleKind::Sint => "i32",
        SampleKind::Uint => "u32",
        SampleKind::Float | SampleKind::Depth => "f32",
    }
}

#[test]
fn loads_of_every_format_are_the_codec_inside_and_zero_outside() {
    for &format in Format::ALL {
        let desc = TextureDesc {
            dimension: Dimension::D2,
            extent: Extent {
                width: 13,
                height: 7,
                depth_or_layers: 3,
            },
            mips: 3,
            format,
        };
        let image = noise(desc);
        let texture = texture(&image);
        let wgsl = format!(
            "@group(0) @binding(0) var t: texture_2d_array<{}>;
             @group(0) @binding(1) var<storage, read_write> result: array<vec4<u32>>;
             @compute @workgroup_size(16, 4)
             fn main(@builtin(global_invocation_id) id: vec3<u32>) {{
                 let at = vec2<i32>(id.xy) - 2;
                 let layer = i32(id.z) % 5 - 1;
                 let level = i32(id.z) / 5;
                 result[(id.z * 12u + id.y) * 16u + id.x] = bitcast<vec4<u32>>(textureLoad(t, at, layer, level));
             }}",
            wgsl_type(format)
        );
        let program = program(&wgsl);
        for (name, executor) in executors() {
            let result = buffer(&vec![0xdead_beef; 16 * 12 * 25 * 4]);
            program
                .dispatch(
                    &executor,
                    [1, 3, 25],
                    &[
                        BoundResource::Texture(texture.view()),
                        BoundResource::Buffer(&result),
                    ],
                )
                .unwrap();
            let words = words(&result);
            for (i, got) in words.chunks(4).enumerate() {
                let (x, y, z) = (
                    i as i32 % 16 - 2,
                    i as i32 / 16 % 12 - 2,
                    i as i32 / (16 * 12),
                );
                let (layer, level) = (z % 5 - 1, z / 5);
                let at = [x, y, layer, level].map(u32::try_from);
                let inside = match at {
                    [Ok(x), Ok(y), Ok(layer), Ok(level)] => image.texel(x, y, layer, level),
                    _ => None,
                };
                // Where there is no texel, the channels the format has not are zero as well.
                let want = inside.map_or([0; 4], bits);
                // The payload of a NaN is nobody's promise.
                let same = got.iter().zip(want).all(|(&got, want)| {
                    let nans = [got, want].map(|bits| f32::from_bits(bits).is_nan());
                    got == want || format.sample_kind() == SampleKind::Float && nans == [true; 2]
                });
                assert!(
                    same,
                    "{format}, {name}, {x},{y} layer {layer} level {level}: {got:x?}, not {want:x?}"
                );
            }
        }
    }
}

/// Blocks of lanes that read rows, every other texel, texels twice and texels in any
/// order, wholly inside; and with some outside.
#[test]
fn loads_along_rows_and_in_any_order_are_the_codec() {
    type Place = fn(u32, u32) -> [u32; 2];
    let places: [(&str, Place); 6] = [
        ("id.xy", |x, y| [x, y]),
        ("id.xy * 2u", |x, y| [2 * x, 2 * y]),
        ("id.xy * 2u + 1u", |x, y| [2 * x + 1, 2 * y + 1]),
        ("(id.xy + 1u) / 2u", |x, y| [x.div_ceil(2), y.div_ceil(2)]),
        ("(id.xy * vec2<u32>(7u, 5u)) % 32u", |x, y| {
            [x * 7 % 32, y * 5 % 32]
        }),
        ("id.yx * 3u", |x, y| [y * 3, x * 3]),
    ];
    for format in [
        Format::Rgba16Float,
        Format::Rgba8Unorm,
        Format::R32Float,
        Format::Rg16Float,
    ] {
        let image = noise(TextureDesc::d2(32, 32, format));
        let texture = texture(&image);
        for (at, place) in places {
            for (channels, count) in [("texel", 4), ("vec4<f32>(texel.xyz, 7.0)", 3)] {
                let program = program(&format!(
                    "@group(0) @binding(0) var t: texture_2d<f32>;
                     @group(0) @binding(1) var<storage, read_write> result: array<vec4<u32>>;
                     @compute @workgroup_size(8, 8)
                     fn main(@builtin(global_invocation_id) id: vec3<u32>) {{
                         let texel = textureLoad(t, {at}, 0);
                         result[id.y * 16u + id.x] = bitcast<vec4<u32>>({channels});
                     }}"
                ));
                for (name, executor) in executors() {
                    let result = buffer(&vec![0; 16 * 16 * 4]);
                    let bound = [
                        BoundResource::Texture(texture.view()),
                        BoundResource::Buffer(&result),
                    ];
                    program.dispatch(&executor, [2, 2, 1], &bound).unwrap();
                    for (i, got) in words(&result).chunks(4).enumerate() {
                        let [x, y] = place(i as u32 % 16, i as u32 / 16);
                        let want = image.texel(x, y, 0, 0).map_or([0; 4], bits);
                        for (got, want) in got.iter().zip(want).take(count) {
                            let nans = [*got, want].map(|bits| f32::from_bits(bits).is_nan());
                            assert!(
                                *got == want || nans == [true; 2],
                                "{format}, {name}, {at}: {got:x} at {x},{y}, not {want:x}"
                            );
                        }
                    }
                }
            }
        }
    }
}

#[test]
fn stores_of_every_storage_format_are_the_codec_and_skip_outside() {
    let formats = [
        Format::R32Float,
        Format::Rg32Float,
        Format::Rgba32Float,
        Format::R16Float,
        Format::Rg16Float,
        Format::Rgba16Float,
        Format::R8Unorm,
        Format::Rg8Unorm,
        Format::Rgba8Unorm,
        Format::Rgba8Snorm,
        Format::Rg11b10Ufloat,
        Format::Rgb10a2Unorm,
        Format::R32Uint,
        Format::R32Sint,
        Format::Rgba32Uint,
        Format::Rgba16Sint,
        Format::Rgba8Uint,
        Format::R8Sint,
        Format::R16Uint,
        Format::Bgra8Unorm,
    ];
    let value =
        |x: u32, y: u32, c: u32| (x as f32 - 3.0) * 0.37 + y as f32 * 0.0113 * (c + 1) as f32;
    for format in formats {
        let ty = wgsl_type(format);
        let wgsl = format!(
            "@group(0) @binding(0) var t: texture_storage_2d<{format}, write>;
             @group(0) @binding(1) var<storage, read> values: array<f32>;
             @compute @workgroup_size(8, 8)
             fn main(@builtin(global_invocation_id) id: vec3<u32>) {{
                 let i = (id.y * 16u + id.x) * 4u;
                 let v = vec4<f32>(values[i], values[i + 1u], values[i + 2u], values[i + 3u]);
                 if (id.x & 3u) != 2u {{ textureStore(t, vec2<i32>(id.xy) - 1, vec4<{ty}>(v * {scale})); }}
             }}",
            scale = if ty == "f32" { "1.0" } else { "40.0" },
        );
        let values: Vec<f32> = (0..16 * 16 * 4)
            .map(|i| value(i / 4 % 16, i / 64, i % 4))
            .collect();
        let program = program(&wgsl);
        let values_buffer = floats(&values);
        for (name, executor) in executors() {
            let target = empty(11, 9, format);
            program
                .dispatch(
                    &executor,
                    [2, 2, 1],
                    &[
                        BoundResource::Texture(target.view()),
                        BoundResource::Buffer(&values_buffer),
                    ],
                )
                .unwrap();
            let image = target.to_image().unwrap();
            for (x, y) in (0..9).flat_map(|y| (0..11).map(move |x| (x, y))) {
                let (ix, iy) = (x + 1, y + 1);
                let v: [f32; 4] =
                    std::array::from_fn(|c| values[((iy * 16 + ix) * 4) as usize + c]);
                let mut want = vec![0; format.texel_bytes() as usize];
                if ix & 3 != 2 {
                    let texel = match ty {
                        "i32" => Texel::Sint(v.map(|v| (v * 40.0) as i32)),
                        "u32" => Texel::Uint(v.map(|v| (v * 40.0) as u32)),
                        _ => Texel::Float(v),
                    };
                    format.encode(texel, &mut want);
                }
                assert_eq!(
                    image.texel_bytes(x, y, 0, 0).unwrap(),
                    want,
                    "{format}, {name}, {x},{y}"
                );
            }
        }
    }
}

#[test]
fn read_write_textures_are_read_as_they_were_written() {
    let program = program(
        "@group(0) @binding(0) var t: texture_storage_2d<r32float, read_write>;
         @compute @workgroup_size(8, 8)
         fn main(@builtin(global_invocation_id) id: vec3<u32>) {
             for (var i = 0; i < 3; i++) {
                 let value = textureLoad(t, id.xy).x;
                 textureStore(t, id.xy, vec4<f32>(value * 2.0 + 1.0));
             }
         }",
    );
    let source = image(9, 9, Format::R32Float, |x, y| {
        [(x * 10 + y) as f32, 0.0, 0.0, 1.0]
    });
    for (name, executor) in executors() {
        let target = texture(&source);
        program
            .dispatch(
                &executor,
                [2, 2, 1],
                &[BoundResource::Texture(target.view())],
            )
            .unwrap();
        let expected: Vec<[f32; 4]> = source
            .to_rgba_f32()
            .unwrap()
            .iter()
            .map(|v| [v[0] * 8.0 + 7.0, 0.0, 0.0, 1.0])
            .collect();
        assert_eq!(
            target.to_image().unwrap().to_rgba_f32().unwrap(),
            expected,
            "{name}"
        );
    }
}

#[test]
fn volumes_and_views_are_addressed() {
    let desc = TextureDesc {
        dimension: Dimension::D3,
        extent: Extent {
            width: 5,
            height: 4,
            depth_or_layers: 6,
        },
        mips: 2,
        format: Format::R32Float,
    };
    let volume = noise(desc);
    let layered = noise(TextureDesc {
        dimension: Dimension::D2,
        extent: Extent {
            width: 8,
            height: 8,
            depth_or_layers: 4,
        },
        mips: 3,
        format: Format::R32Float,
    });
    let program = program(
        "@group(0) @binding(0) var v: texture_3d<f32>;
         @group(0) @binding(1) var p: texture_2d<f32>;
         @group(0) @binding(2) var<storage, read_write> result: array<u32>;
         @compute @workgroup_size(64)
         fn main(@builtin(local_invocation_index) i: u32) {
             result[i] = bitcast<u32>(textureLoad(v, vec3<u32>(i % 2u, i / 2u % 2u, i / 4u), 1).x);
             result[64u + i] = bitcast<u32>(textureLoad(p, vec2<u32>(i % 4u, i / 4u), 0).x);
             let size = textureDimensions(v, 1);
             let flat = textureDimensions(p, i32(i & 1u));
             result[128u + i] = size.x + 10u * size.y + 100u * size.z + 1000u * textureNumLevels(v) + 10000u * flat.x;
         }",
    );
    let (v, p) = (texture(&volume), texture(&layered));
    let part = p
        .part(Subresources {
            mip: 1,
            mips: 2,
            layer: 2,
            layers: 1,
        })
        .unwrap();
    assert!(
        p.part(Subresources {
            mip: 1,
            mips: 3,
            layer: 2,
            layers: 1
        })
        .is_none()
    );
    for (name, executor) in executors() {
        let result = buffer(&[0; 192]);
        program
            .dispatch(
                &executor,
                [1, 1, 1],
                &[
                    BoundResource::Texture(v.view()),
                    BoundResource::Texture(part.clone()),
                    BoundResource::Buffer(&result),
                ],
            )
            .unwrap();
        let got = words(&result);
        for i in 0..64_u32 {
            let texel = |image: &ImageData, x, y, layer, mip| {
                image
                    .texel(x, y, layer, mip)
                    .map_or(0, |texel| bits(texel)[0])
            };
            assert_eq!(
                got[i as usize],
                texel(&volume, i % 2, i / 2 % 2, i / 4, 1),
                "{name} {i}"
            );
            let want = if i / 4 < 4 {
                texel(&layered, i % 4, i / 4, 2, 1)
            } else {
                0
            };
            assert_eq!(got[64 + i as usize], want, "{name} {i}");
            assert_eq!(
                got[128 + i as usize],
                2 + 20 + 300 + 2000 + if i & 1 == 1 { 20000 } else { 40000 },
                "{name} {i}"
            );
        }
    }
}

/// Reference filtering of one level, in f64.
fn filtered(image: &ImageData, mip: u32, sampler: SamplerDesc, u: f32, v: f32) -> f64 {
    let extent = image.desc.mip_extent(mip);
    let address = |at: i64, size: u32| {
        let size = i64::from(size);
        (match sampler.address[0] {
            AddressMode::ClampToEdge => at.clamp(0, size - 1),
            AddressMode::Repeat => at.rem_euclid(size),
            AddressMode::MirrorRepeat => {
                let at = at.rem_euclid(2 * size);
                if at < size { at } else { 2 * size - 1 - at }
            }
        }) as u32
    };
    let texel = |x: i64, y: i64| {
        image
            .texel(address(x, extent.width), address(y, extent.height), 0, mip)
            .unwrap()
            .to_f64()[0]
    };
    // As the texel is chosen in f32, so is it here.
    let (x, y) = (u * extent.width as f32, v * extent.height as f32);
    match sampler.mag_filter {
        Filter::Nearest => texel(x.floor() as i64, y.floor() as i64),
        Filter::Linear => {
            let (x, y) = (x - 0.5, y - 0.5);
            let (ix, iy) = (x.floor(), y.floor());
            let (fx, fy) = (f64::from(x - ix), f64::from(y - iy));
            let (ix, iy) = (ix as i64, iy as i64);
            let row = |y| texel(ix, y) * (1.0 - fx) + texel(ix + 1, y) * fx;
            row(iy) * (1.0 - fy) + row(iy + 1) * fy
        }
    }
}

#[test]
fn samples_are_filtered_addressed_and_mipped() {
    let desc = TextureDesc::d2(11, 6, Format::Rgba16Float).with_mips(3);
    let texels: Vec<[f32; 4]> = (0..desc.bytes().unwrap() / 8)
        .map(|i| [((i * 37) % 101) as f32 * 0.01, 0.5, -1.0, 1.0])
        .collect();
    let image = ImageData::from_rgba_f32(desc, &texels).unwrap();
    let texture = texture(&image);
    let program = program(
        "@group(0) @binding(0) var t: texture_2d<f32>;
         @group(0) @binding(1) var s: sampler;
         @group(0) @binding(2) var<storage, read> data: array<f32>;
         @group(0) @binding(3) var<storage, read_write> result: array<f32>;
         @compute @workgroup_size(64)
         fn main(@builtin(global_invocation_id) id: vec3<u32>) {
             let i = 3u * id.x;
             let c = textureSampleLevel(t, s, vec2<f32>(data[i], data[i + 1u]), data[i + 2u]);
             result[id.x] = c.x;
             if abs(c.y - 0.5) + abs(c.z + 1.0) + abs(c.w - 1.0) > 1e-6 { result[id.x] = -100.0; }
         }",
    );
    let count = 64 * 20_u32;
    let random = |i: u32| (i.wrapping_mul(2_654_435_761) >> 8) as f32 / 16_777_216.0;
    let data: Vec<f32> = (0..count)
        .flat_map(|i| {
            [
                random(3 * i) * 5.0 - 2.0,
                random(3 * i + 1) * 5.0 - 2.0,
                [0.0, 1.0, random(i) * 4.0 - 1.0][i as usize % 3],
            ]
        })
        .collect();
    let input = floats(&data);
    for address in [
        AddressMode::ClampToEdge,
        AddressMode::Repeat,
        AddressMode::MirrorRepeat,
    ] {
        for filter in [Filter::Nearest, Filter::Linear] {
            for mip_filter in [Filter::Nearest, Filter::Linear] {
                let sampler = SamplerDesc::new(address, filter, mip_filter);
                let mut first: Option<Vec<u32>> = None;
                for (name, executor) in executors() {
                    let result = buffer(&vec![0; count as usize]);
                    let bound = [
                        BoundResource::Texture(texture.view()),
                        BoundResource::Sampler(sampler),
                        BoundResource::Buffer(&input),
                        BoundResource::Buffer(&result),
                    ];
                    program
                        .dispatch(&executor, [count / 64, 1, 1], &bound)
                        .unwrap();
                    let got = words(&result);
                    assert!(first.as_ref().is_none_or(|first| *first == got), "{name}");
                    first = Some(got);
                }
                for (i, (got, at)) in first.unwrap().into_iter().zip(data.chunks(3)).enumerate() {
                    let lod = at[2].clamp(0.0, 2.0);
                    let level = |mip: u32| filtered(&image, mip, sampler, at[0], at[1]);
                    let want = match mip_filter {
                        Filter::Nearest => {
                            level(((lod + 0.5).ceil() as u32).saturating_sub(1).min(2))
                        }
                        Filter::Linear => {
                            let fine = lod.floor();
                            let weight = f64::from(lod - fine);
                            level(fine as u32) * (1.0 - weight)
                                + if weight > 0.0 {
                                    level((fine as u32 + 1).min(2)) * weight
                                } else {
                                    0.0
                                }
                        }
                    };
                    // Eight products of values below 1.01, each rounded thrice,
                    // and their sum: below 40 units of 2^-24.
                    let got = f64::from(f32::from_bits(got));
                    assert!(
                        (got - want).abs() < 40.0 * 2.0_f64.powi(-24),
                        "{sampler:?} {i} {at:?}: {got}, not {want}"
                    );
                }
            }
        }
    }
}

#[test]
fn cubes_are_seamless() {
    // Each texel holds its own direction: filtered reads give back about the
    // direction asked for, across edges as well.
    let size = 32;
    let direction = |face: u32, x: u32, y: u32| -> [f32; 3] {
        let (s, t) = (
            2.0 * (x as f32 + 0.5) / size as f32 - 1.0,
            2.0 * (y as f32 + 0.5) / size as f32 - 1.0,
        );
        let d = match face {
            0 => [1.0, -t, -s],
            1 => [-1.0, -t, s],
            2 => [s, 1.0, t],
            3 => [s, -1.0, -t],
            4 => [s, -t, 1.0],
            _ => [-s, -t, -1.0],
        };
        let length = (d[0] * d[0] + d[1] * d[1] + d[2] * d[2]).sqrt();
        d.map(|c| c / length)
    };
    let texels: Vec<[f32; 4]> = (0..6 * size * size)
        .map(|i| {
            let [x, y, z] = direction(i / (size * size), i % size, i / size % size);
            [x, y, z, 1.0]
        })
        .collect();
    let image =
        ImageData::from_rgba_f32(TextureDesc::cube(size, Format::Rgba32Float), &texels).unwrap();
    let cube = Texture::from_image(&image).unwrap();
    let program = program(
        "@group(0) @binding(0) var t: texture_cube<f32>;
         @group(0) @binding(1) var s: sampler;
         @group(0) @binding(2) var<storage, read> data: array<vec4<f32>>;
         @group(0) @binding(3) var<storage, read_write> result: array<vec4<f32>>;
         @compute @workgroup_size(64)
         fn main(@builtin(global_invocation_id) id: vec3<u32>) {
             result[id.x] = textureSampleLevel(t, s, data[id.x].xyz, 0.0);
         }",
    );
    let count = 64 * 64_u32;
    let random = |i: u32| (i.wrapping_mul(2_654_435_761) >> 8) as f32 / 8_388_608.0 - 1.0;
    let data: Vec<f32> = (0..count)
        .flat_map(|i| [random(3 * i + 7), random(3 * i + 8), random(3 * i + 9), 0.0])
        .collect();
    let (input, result) = (floats(&data), buffer(&vec![0; count as usize * 4]));
    let executor = executors().pop().unwrap().1;
    let bound = [
        BoundResource::Texture(cube.view()),
        BoundResource::Sampler(SamplerDesc::LINEAR_CLAMP),
        BoundResource::Buffer(&input),
        BoundResource::Buffer(&result),
    ];
    program
        .dispatch(&executor, [count / 64, 1, 1], &bound)
        .unwrap();
    for (got, want) in words(&result).chunks(4).zip(data.chunks(4)) {
        let length = (want[0] * want[0] + want[1] * want[1] + want[2] * want[2]).sqrt();
        for c in 0..3 {
            // A texel spans at most 2/32 of the unit cube; bilinear interpolation
            // of a smooth map errs by its square over eight, more at the corners.
            let error = (f32::from_bits(got[c]) - want[c] / length).abs();
            assert!(error < 0.02, "{want:?}: {error}");
        }
    }
}
