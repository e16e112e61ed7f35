//! Parts of WGSL that effects seldom use: one-dimensional textures, atomics on
//! textures, immediate data, pointers into every address space.

use crate::common;

use common::*;
use etalon_core::Format;
use etalon_core::image::ImageData;
use etalon_core::resource::{Dimension, Extent, TextureDesc};
use etalon_core::texel::Texel;
use etalon_cpu::{BindingKind, BoundResource, RunError, Texture, View};

/// Binds buffers by binding number on every executor, which must agree, and
/// returns the words of the last one.
fn run(wgsl: &str, inputs: &[&[u32]], results: usize, workgroups: u32) -> Vec<u32> {
    let program = program(wgsl);
    let inputs: Vec<_> = inputs.iter().map(|words| buffer(words)).collect();
    let mut first: Option<Vec<u32>> = None;
    for (name, executor) in executors() {
        let result = buffer(&vec![0; results]);
        let bound: Vec<BoundResource<'_>> = program
            .bindings()
            .iter()
            .map(|binding| {
                BoundResource::Buffer(inputs.get(binding.binding as usize).unwrap_or(&result))
            })
            .collect();
        program
            .dispatch(&executor, [workgroups, 1, 1], &bound)
            .unwrap_or_else(|error| panic!("{error}\n{program}"));
        let got = words(&result);
        assert!(
            first.as_ref().is_none_or(|first| *first == got),
            "{name}\n{program}"
        );
        first = Some(got);
    }
    first.unwrap()
}

#[test]
fn one_dimension_is_a_texture_of_height_one() {
    let program = program(
        "@group(0) @binding(0) var source: texture_1d<u32>;
         @group(0) @binding(1) var target_texture: texture_storage_1d<r32uint, read_write>;
         @group(0) @binding(2) var<storage, read_write> result: array<u32>;
         @compute @workgroup_size(64)
         fn main(@builtin(local_invocation_index) i: u32) {
             let x = i32(i) - 3;
             result[i] = textureLoad(source, x, 0).x;
             textureStore(target_texture, x, vec4(100u + i));
             result[64u + i] = textureLoad(target_texture, x).x;
             if i == 0u {
                 result[128] = textureDimensions(source);
                 result[129] = textureDimensions(source, 0);
                 result[130] = textureNumLevels(source);
                 result[131] = textureDimensions(target_texture);
             }
         }",
    );
    assert!(matches!(
        program.bindings()[0].kind,
        BindingKind::Texture { view: View::D1, .. }
    ));
    let bytes: Vec<u8> = (0..50_u32).flat_map(|i| (i * i).to_le_bytes()).collect();
    let image = ImageData::from_bytes(TextureDesc::d2(50, 1, Format::R32Uint), bytes).unwrap();
    let source = texture(&image);
    for (name, executor) in executors() {
        let target = empty(40, 1, Format::R32Uint);
        let result = buffer(&[0; 132]);
        program
            .dispatch(
                &executor,
                [1, 1, 1],
                &[
                    BoundResource::Texture(source.view()),
                    BoundResource::Texture(target.view()),
                    BoundResource::Buffer(&result),
                ],
            )
            .unwrap();
        let got = words(&result);
        for i in 0..64_usize {
            let inside = |size: usize| i.checked_sub(3).filter(|&x| x < size);
            assert_eq!(got[i], inside(50).map_or(0, |x| (x * x) as u32), "{name}");
            assert_eq!(got[64 + i], inside(40).map_or(0, |_| 100 + i as u32));
        }
        assert_eq!(got[128..], [50, 50, 1, 40]);
    }
    // A texture of more rows or layers is none of one dimension.
    let flat = empty(50, 2, Format::R32Uint);
    let layered = Texture::zeroed(TextureDesc {
        dimension: Dimension::D2,
        extent: Extent {
            width: 50,
            height: 1,
            depth_or_layers: 2,
        },
        mips: 1,
        format: Format::R32Uint,
    })
    .unwrap();
    let executor = executors().remove(0).1;
    let (target, result) = (empty(40, 1, Format::R32Uint), buffer(&[0; 132]));
    for wrong in [&flat, &layered] {
        let bound = [
            BoundResource::Texture(wrong.view()),
            BoundResource::Texture(target.view()),
            BoundResource::Buffer(&result),
        ];
        assert!(matches!(
            program.dispatch(&executor, [1, 1, 1], &bound),
            Err(RunError::Binding { .. })
        ));
    }
}

#[test]
fn atomics_on_textures_lose_nothing() {
    for (format, ty) in [(Format::R32Uint, "u32"), (Format::R32Sint, "i32")] {
        let program = program(&format!(
            "@group(0) @binding(0) var t: texture_storage_2d<{format}, atomic>;
             @compute @workgroup_size(8, 8)
             fn main(@builtin(global_invocation_id) id: vec3<u32>) {{
                 let v = {ty}(id.x * 37u + id.y * 101u) - {ty}(900);
                 textureAtomicAdd(t, vec2<i32>(0, 0), v);
                 textureAtomicMin(t, vec2<i32>(1, 0), v);
                 textureAtomicMax(t, vec2<i32>(2, 0), v);
                 textureAtomicAnd(t, vec2<i32>(3, 0), v);
                 textureAtomicOr(t, vec2<i32>(4, 0), v);
                 textureAtomicXor(t, vec2<i32>(5, 0), v);
                 if (id.x & 1u) == 1u {{ textureAtomicAdd(t, vec2<u32>(id.x % 8u, 1u), {ty}(1)); }}
                 textureAtomicAdd(t, vec2<i32>(-1, 0), v);
                 textureAtomicAdd(t, vec2<i32>(0, 2), v);
             }}"
        ));
        let values: Vec<u32> = (0..32_u32)
            .flat_map(|y| (0..24_u32).map(move |x| (x * 37 + y * 101).wrapping_sub(900)))
            .collect();
        let signed = ty == "i32";
        let order = |a: u32, b: u32| {
            if signed {
                (a as i32).cmp(&(b as i32))
            } else {
                a.cmp(&b)
            }
        };
        let fold = |start: u32, f: &dyn Fn(u32, u32) -> u32| values.iter().copied().fold(start, f);
        let start = [7_u32, 5, 9, u32::MAX, 0, 3, 0, 0];
        let want = [
            fold(7, &u32::wrapping_add),
            fold(5, &|a, b| std::cmp::min_by(a, b, |a, b| order(*a, *b))),
            fold(9, &|a, b| std::cmp::max_by(a, b, |a, b| order(*a, *b))),
            fold(u32::MAX, &|a, b| a & b),
            fold(0, &|a, b| a | b),
            fold(3, &|a, b| a ^ b),
            0,
            0,
        ];
        let bytes: Vec<u8> = start
            .into_iter()
            .chain([0; 8])
            .flat_map(u32::to_le_bytes)
            .collect();
        let image = ImageData::from_bytes(TextureDesc::d2(8, 2, format), bytes).unwrap();
        for (name, executor) in executors() {
            let t = texture(&image);
            program
                .dispatch(&executor, [3, 4, 1], &[BoundResource::Texture(t.view())])
                .unwrap();
            let after = t.to_image().unwrap();
            for x in 0..8_u32 {
                let texel = |y| match after.texel(x, y, 0, 0).unwrap() {
                    Texel::Uint(c) => c[0],
                    Texel::Sint(c) => c[0] as u32,
                    Texel::Float(_) => panic!("a float of an integer texture"),
                };
                assert_eq!(texel(0), want[x as usize], "{format} {name} {x}");
                let count = if x % 2 == 1 { 3 * 32 } else { 0 };
                assert_eq!(texel(1), count, "{format} {name} {x}");
            }
        }
    }
}

#[test]
fn immediate_data_is_given_to_the_dispatch() {
    let program = program(
        "struct Push { scale: f32, offset: vec3<u32>, table: array<vec4<f32>, 2> }
         var<immediate> push: Push;
         @group(0) @binding(0) var<storage, read_write> result: array<f32>;
         fn at(i: u32) -> f32 { return push.table[i / 4u % 2u][i % 4u]; }
         @compute @workgroup_size(64)
         fn main(@builtin(local_invocation_index) i: u32) {
             result[i] = push.scale * at(i) + f32(push.offset[i % 3u]);
         }",
    );
    assert_eq!(
        (program.immediate_size(), program.bindings().len()),
        (64, 1)
    );
    let mut bytes = vec![0_u8; 64];
    bytes[..4].copy_from_slice(&2.5_f32.to_le_bytes());
    for (i, offset) in [10_u32, 20, 30].into_iter().enumerate() {
        bytes[16 + 4 * i..20 + 4 * i].copy_from_slice(&offset.to_le_bytes());
    }
    for i in 0..8 {
        bytes[32 + 4 * i..36 + 4 * i].copy_from_slice(&(i as f32 + 0.5).to_le_bytes());
    }
    for (name, executor) in executors() {
        let result = buffer(&[0; 64]);
        let bound = [BoundResource::Buffer(&result)];
        program
            .dispatch_with_immediates(&executor, [1, 1, 1], &bound, &bytes)
            .unwrap();
        for (i, got) in words(&result).into_iter().enumerate() {
            let want = 2.5 * ((i % 8) as f32 + 0.5) + (10 * (i % 3 + 1)) as f32;
            assert_eq!(f32::from_bits(got), want, "{name} {i}");
        }
        for missing in [
            program.dispatch(&executor, [1, 1, 1], &bound),
            program.dispatch_with_immediates(&executor, [1, 1, 1], &bound, &bytes[..63]),
        ] {
            assert!(
                matches!(missing, Err(RunError::Binding { ref binding, .. }) if binding == "var<immediate>"),
                "{missing:?}"
            );
        }
    }
}

#[test]
fn pointers_lead_into_every_address_space() {
    let wgsl = "struct Pair { a: u32, b: array<u32, 3> }
        @group(0) @binding(0) var<storage, read> data: array<Pair>;
        @group(0) @binding(1) var<uniform> u: array<vec4<u32>, 2>;
        @group(0) @binding(2) var<storage, read_write> result: array<u32>;
        var<private> own: Pair;
        var<workgroup> shared_pair: array<Pair, 64>;
        fn of_private(p: ptr<private, Pair>, i: u32) { (*p).b[i % 3u] = i; (*p).a += 1u; }
        fn of_function(p: ptr<function, array<u32, 4>>, i: u32) { let q = &(*p)[i % 4u]; *q += 5u; }
        fn increment(p: ptr<function, u32>) { *p += 1u; }
        @compute @workgroup_size(64)
        fn main(@builtin(local_invocation_index) i: u32) {
            var local = array<u32, 4>(1u, 2u, 3u, 4u);
            of_function(&local, i);
            increment(&local[2]);
            of_private(&own, i);
            of_private(&own, i + 1u);
            let mine = &shared_pair[i];
            (*mine).a = i * 3u;
            (*mine).b[1] = i;
            workgroupBarrier();
            let other = 63u - i;
            let all = &data;
            let pair = &data[i % arrayLength(all)];
            result[i] = (*pair).b[i % 3u] + arrayLength(all);
            let b = &(*pair).b;
            let v = &u[i % 2u];
            result[64u + i] = (*b)[i % 3u] * 2u + (*v)[i % 4u];
            result[128u + i] = own.a * 1000u + own.b[i % 3u] * 10u + own.b[(i + 1u) % 3u];
            result[192u + i] = local[i % 4u] * 100u + local[2];
            result[256u + i] = shared_pair[other].a + shared_pair[other].b[1];
        }";
    let data: Vec<u32> = (0..20).map(|i| i * i + 1).collect();
    let uniform: Vec<u32> = (0..8).map(|i| 1000 * i).collect();
    let got = run(wgsl, &[&data, &uniform], 320, 1);
    for i in 0..64_u32 {
        let b = |pair: u32, j: u32| data[(pair * 4 + 1 + j) as usize];
        assert_eq!(got[i as usize], b(i % 5, i % 3) + 5, "{i}");
        let want = b(i % 5, i % 3) * 2 + uniform[(i % 2 * 4 + i % 4) as usize];
        assert_eq!(got[64 + i as usize], want, "{i}");
        assert_eq!(got[128 + i as usize], 2000 + i * 10 + i + 1, "{i}");
        let mut local = [1, 2, 3, 4];
        local[i as usize % 4] += 5;
        local[2] += 1;
        assert_eq!(
            got[192 + i as usize],
            local[i as usize % 4] * 100 + local[2],
            "{i}"
        );
        assert_eq!(got[256 + i as usize], (63 - i) * 4, "{i}");
    }
}

#[test]
fn composites_and_atomics_are_loaded_uniformly() {
    let wgsl = "struct Inner { v: vec3<f32>, k: array<u32, 4> }
        @group(0) @binding(0) var<storage, read_write> result: array<u32>;
        var<workgroup> inner: Inner;
        var<workgroup> counter: atomic<u32>;
        var<workgroup> flags: array<bool, 3>;
        @compute @workgroup_size(64)
        fn main(@builtin(local_invocation_index) i: u32, @builtin(workgroup_id) w: vec3<u32>) {
            if i == 5u {
                inner.v = vec3(1.0, 2.0, f32(w.x));
                inner.k[w.x % 4u] = 9u;
                flags[1] = true;
            }
            atomicAdd(&counter, i);
            let copy = workgroupUniformLoad(&inner);
            let count = workgroupUniformLoad(&counter);
            let flag = workgroupUniformLoad(&flags)[1];
            // Uniform control flow, so a barrier is allowed in it.
            if copy.k[w.x % 4u] == 9u && flag { workgroupBarrier(); }
            result[w.x * 64u + i] = u32(copy.v.x + copy.v.y + copy.v.z) * 10000u + count;
        }";
    let got = run(wgsl, &[], 192, 3);
    for (i, got) in got.into_iter().enumerate() {
        assert_eq!(got, (3 + i as u32 / 64) * 10000 + 2016, "{i}");
    }
}

#[test]
fn exchanges_say_whether_they_happened() {
    // One invocation of each workgroup wins the exchange; the others see what
    // is there.
    let wgsl = "struct State { owner: atomic<u32>, total: atomic<i32> }
        @group(0) @binding(0) var<storage, read_write> result: array<u32>;
        @group(0) @binding(1) var<storage, read_write> state: State;
        var<workgroup> local: atomic<i32>;
        @compute @workgroup_size(64)
        fn main(@builtin(local_invocation_index) i: u32) {
            let first = atomicCompareExchangeWeak(&local, 0, i32(i) + 1);
            if first.exchanged { atomicAdd(&state.owner, 1u); }
            let again = atomicCompareExchangeWeak(&local, -5, 7);
            result[i] = u32(first.exchanged) * 100u + u32(again.exchanged);
            result[64u + i] = u32(again.old_value);
            let before = atomicExchange(&state.total, -3);
            result[128u + i] = u32(before + 3);
            atomicMin(&state.total, i32(i) - 70);
            atomicMax(&local, 1000);
            workgroupBarrier();
            result[192u + i] = u32(atomicLoad(&local)) + atomicLoad(&state.owner);
        }";
    let program = program(wgsl);
    for (name, executor) in executors() {
        let (result, state) = (buffer(&[0; 256]), buffer(&[0; 2]));
        program
            .dispatch(
                &executor,
                [1, 1, 1],
                &program
                    .bindings()
                    .iter()
                    .map(|binding| {
                        BoundResource::Buffer(if binding.binding == 0 {
                            &result
                        } else {
                            &state
                        })
                    })
                    .collect::<Vec<_>>(),
            )
            .unwrap();
        let got = words(&result);
        let winners: Vec<usize> = (0..64).filter(|&i| got[i] == 100).collect();
        assert_eq!(winners.len(), 1, "{name}");
        for i in 0..64 {
            assert!(got[i] == 0 || got[i] == 100, "{name} {i}");
            assert_eq!(got[64 + i], winners[0] as u32 + 1, "{name} {i}");
            assert_eq!(got[192 + i], 1001, "{name} {i}");
        }
        // The first exchange finds 0, all others -3.
        assert_eq!(
            got[128..192].iter().filter(|&&v| v == 3).count(),
            1,
            "{name}"
        );
        assert_eq!(words(&state), [1, (-70_i32) as u32], "{name}");
    }
}

#[test]
fn every_storage_format_is_read_and_written() {
    // Loads and stores through the same storage texture keep every code that a
    // texel can hold, NaNs apart.
    for &format in Format::ALL {
        if format.storage() == etalon_core::format::StorageSupport::None {
            continue;
        }
        let name = format.name();
        let program = program(&format!(
            "@group(0) @binding(0) var source: texture_storage_2d<{name}, read>;
             @group(0) @binding(1) var target_texture: texture_storage_2d<{name}, write>;
             @group(0) @binding(2) var both: texture_storage_2d<{name}, read_write>;
             @compute @workgroup_size(16, 16)
             fn main(@builtin(global_invocation_id) id: vec3<u32>) {{
                 let texel = textureLoad(source, id.xy);
                 textureStore(target_texture, id.xy, texel);
                 textureStore(both, id.yx, textureLoad(both, id.yx));
             }}"
        ));
        let desc = TextureDesc::d2(16, 16, format);
        let count = desc.bytes().unwrap() as u32;
        // Bytes below 0x78 make neither NaN nor infinity of any float.
        let bytes: Vec<u8> = (0..count)
            .map(|i| (i.wrapping_mul(2_654_435_761) >> 24) as u8 % 0x78)
            .collect();
        let image = ImageData::from_bytes(desc, bytes).unwrap();
        for (executor_name, executor) in executors() {
            let (source, target, both) = (texture(&image), empty(16, 16, format), texture(&image));
            program
                .dispatch(
                    &executor,
                    [1, 1, 1],
                    &[
                        BoundResource::Texture(source.view()),
                        BoundResource::Texture(target.view()),
                        BoundResource::Texture(both.view()),
                    ],
                )
                .unwrap();
            assert_eq!(
                target.to_image().unwrap().bytes,
                image.bytes,
                "{format} {executor_name}"
            );
            assert_eq!(
                both.to_image().unwrap().bytes,
                image.bytes,
                "{format} {executor_name}"
            );
        }
    }
}
