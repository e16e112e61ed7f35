//! Kernels like those of effects, against plain Rust.

use crate::common;

use common::*;
use etalon_core::Format;
use etalon_cpu::BoundResource;

const BLUR: &str = "
struct Params { radius: i32, sigma: f32 }
@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var source: texture_2d<f32>;
@group(0) @binding(2) var target_image: texture_storage_2d<rgba32float, write>;

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    let size = textureDimensions(target_image);
    if any(id.xy >= size) { return; }
    var sum = vec4<f32>(0.0);
    var weights = 0.0;
    for (var i = -params.radius; i <= params.radius; i++) {
        let x = clamp(i32(id.x) + i, 0, i32(size.x) - 1);
        let weight = 1.0 / (1.0 + params.sigma * f32(i * i));
        sum += weight * textureLoad(source, vec2<i32>(x, i32(id.y)), 0);
        weights += weight;
    }
    textureStore(target_image, id.xy, sum / weights);
}
";

#[test]
fn blur_is_exact() {
    let (width, height) = (37, 21);
    let source_image = image(width, height, Format::Rgba32Float, |x, y| {
        [x as f32 * 0.1, y as f32, (x * y) as f32 / 7.0, 1.0]
    });
    let texel = |x: i32, y: u32| -> [f32; 4] {
        let at = ((y * width) as usize + x as usize) * 16;
        std::array::from_fn(|c| {
            f32::from_le_bytes(
                source_image.bytes[at + c * 4..at + c * 4 + 4]
                    .try_into()
                    .unwrap(),
            )
        })
    };
    let (radius, sigma) = (5_i32, 0.3_f32);
    let mut expected = Vec::new();
    for y in 0..height {
        for x in 0..width as i32 {
            let (mut sum, mut weights) = ([0.0_f32; 4], 0.0_f32);
            for i in -radius..=radius {
                let weight = 1.0 / (1.0 + sigma * (i * i) as f32);
                let t = texel((x + i).clamp(0, width as i32 - 1), y);
                for c in 0..4 {
                    sum[c] += weight * t[c];
                }
                weights += weight;
            }
            expected.extend(
                sum.map(|s| s / weights)
                    .iter()
                    .flat_map(|v| v.to_le_bytes()),
            );
        }
    }
    let program = program(BLUR);
    println!("{program}");
    let source = texture(&source_image);
    let params = buffer(&[radius as u32, sigma.to_bits()]);
    for (name, executor) in executors() {
        let target = empty(width, height, Format::Rgba32Float);
        let bound = [
            BoundResource::Buffer(&params),
            BoundResource::Texture(source.view()),
            BoundResource::Texture(target.view()),
        ];
        program
            .dispatch(
                &executor,
                [width.div_ceil(8), height.div_ceil(8), 1],
                &bound,
            )
            .unwrap();
        assert!(target.to_image().unwrap().bytes == expected, "{name}");
    }
}

const MARCH: &str = "
struct Params { steps: u32, thickness: f32, stride: f32 }
@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var depth: texture_2d<f32>;
@group(0) @binding(2) var target_image: texture_storage_2d<rgba32float, write>;

struct Hit { found: bool, at: vec2<f32>, steps: u32 }

fn sample_depth(at: vec2<f32>) -> f32 {
    return textureLoad(depth, vec2<i32>(floor(at)), 0).x;
}

fn march(origin: vec3<f32>, direction: vec3<f32>) -> Hit {
    var p = origin;
    for (var i = 0u; i < params.steps; i++) {
        p += direction * params.stride;
        if p.x < 0.0 || p.y < 0.0 || p.x >= f32(textureDimensions(depth).x) || p.y >= f32(textureDimensions(depth).y) {
            return Hit(false, p.xy, i);
        }
        let surface = sample_depth(p.xy);
        if surface == 0.0 { continue; }
        if p.z > surface && p.z - surface < params.thickness {
            var low = p - direction * params.stride;
            var high = p;
            for (var j = 0; j < 4; j++) {
                let middle = (low + high) * 0.5;
                if middle.z > sample_depth(middle.xy) { high = middle; } else { low = middle; }
            }
            return Hit(true, high.xy, i);
        }
    }
    return Hit(false, p.xy, params.steps);
}

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    let size = textureDimensions(target_image);
    if id.x >= size.x || id.y >= size.y { return; }
    let start = vec2<f32>(id.xy) + 0.5;
    let z = sample_depth(start);
    if z == 0.0 {
        textureStore(target_image, id.xy, vec4<f32>(-1.0));
        return;
    }
    let direction = vec3<f32>(0.5 + 0.01 * start.y, 0.25 - 0.02 * start.x, 0.05);
    let hit = march(vec3<f32>(start, z + 0.01), direction);
    textureStore(target_image, id.xy, vec4<f32>(hit.at, f32(hit.steps), select(0.0, 1.0, hit.found)));
}
";

/// The kernel above, one invocation after the other.
fn march_reference(
    width: u32,
    height: u32,
    depth: impl Fn(i32, i32) -> f32,
    steps: u32,
    thickness: f32,
    stride: f32,
) -> Vec<[f32; 4]> {
    let sample = |x: f32, y: f32| depth(x.floor() as i32, y.floor() as i32);
    let march = |origin: [f32; 3], d: [f32; 3]| -> (bool, [f32; 2], u32) {
        let mut p = origin;
        for i in 0..steps {
            for c in 0..3 {
                p[c] += d[c] * stride;
            }
            if p[0] < 0.0 || p[1] < 0.0 || p[0] >= width as f32 || p[1] >= height as f32 {
                return (false, [p[0], p[1]], i);
            }
            let surface = sample(p[0], p[1]);
            if surface == 0.0 {
                continue;
            }
            if p[2] > surface && p[2] - surface < thickness {
                let mut low: [f32; 3] = std::array::from_fn(|c| p[c] - d[c] * stride);
                let mut high = p;
                for _ in 0..4 {
                    let middle: [f32; 3] = std::array::from_fn(|c| (low[c] + high[c]) * 0.5);
                    if middle[2] > sample(middle[0], middle[1]) {
                        high = middle
                    } else {
                        low = middle
                    }
                }
                return (true, [high[0], high[1]], i);
            }
        }
        (false, [p[0], p[1]], steps)
    };
    let mut out = Vec::new();
    for y in 0..height {
        for x in 0..width {
            let start = [x as f32 + 0.5, y as f32 + 0.5];
            let z = sample(start[0], start[1]);
            if z == 0.0 {
                out.push([-1.0; 4]);
                continue;
            }
            let d = [0.5 + 0.01 * start[1], 0.25 - 0.02 * start[0], 0.05];
            let (found, at, i) = march([start[0], start[1], z + 0.01], d);
            out.push([at[0], at[1], i as f32, if found { 1.0 } else { 0.0 }]);
        }
    }
    out
}

#[test]
fn march_is_exact() {
    let (width, height) = (53, 40);
    let value = |x: u32, y: u32| {
        if (x * 7 + y * 3).is_multiple_of(11) {
            0.0
        } else {
            1.0 + ((x * 13 + y * 29) % 17) as f32 * 0.05
        }
    };
    let depth_image = image(width, height, Format::R32Float, |x, y| {
        [value(x, y), 0.0, 0.0, 1.0]
    });
    let outside = |x: i32, y: i32| {
        if x < 0 || y < 0 || x >= width as i32 || y >= height as i32 {
            0.0
        } else {
            value(x as u32, y as u32)
        }
    };
    let (steps, thickness, stride) = (40, 0.3_f32, 0.7_f32);
    let expected: Vec<u8> = march_reference(width, height, outside, steps, thickness, stride)
        .iter()
        .flatten()
        .flat_map(|v| v.to_le_bytes())
        .collect();
    let program = program(MARCH);
    println!("{program}");
    let depth = texture(&depth_image);
    let params = buffer(&[steps, thickness.to_bits(), stride.to_bits()]);
    for (name, executor) in executors() {
        let target = empty(width, height, Format::Rgba32Float);
        let bound = [
            BoundResource::Buffer(&params),
            BoundResource::Texture(depth.view()),
            BoundResource::Texture(target.view()),
        ];
        program
            .dispatch(
                &executor,
                [width.div_ceil(8), height.div_ceil(8), 1],
                &bound,
            )
            .unwrap();
        let got = target.to_image().unwrap().bytes;
        for (i, (a, b)) in got.chunks(16).zip(expected.chunks(16)).enumerate() {
            let f = |bytes: &[u8]| -> Vec<f32> {
                bytes
                    .chunks(4)
                    .map(|b| f32::from_le_bytes(b.try_into().unwrap()))
                    .collect()
            };
            assert!(
                a == b,
                "{name}: texel {},{}: {:?}, not {:?}",
                i as u32 % width,
                i as u32 / width,
                f(a),
                f(b)
            );
        }
    }
}
