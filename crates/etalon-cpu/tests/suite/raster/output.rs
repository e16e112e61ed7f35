//! Depth tests, biases, blending and write masks, against code for one fragment.

use crate::common;

use common::raster::*;
use etalon_core::Format;
use etalon_core::format::{Encoding, SampleKind};
use etalon_core::raster::{
    Blend, BlendComponent, BlendFactor, BlendOperation, ColourWrites, DepthBias, DepthState,
    StepMode, TargetState, VertexAttribute, VertexFormat, VertexLayout,
};
use etalon_core::resource::Compare;
use etalon_core::texel::Texel;
use etalon_cpu::RasterError;

const COMPARES: [Compare; 8] = [
    Compare::Never,
    Compare::Less,
    Compare::Equal,
    Compare::LessEqual,
    Compare::Greater,
    Compare::NotEqual,
    Compare::GreaterEqual,
    Compare::Always,
];

fn passes(compare: Compare, new: f32, old: f32) -> bool {
    match compare {
        Compare::Never => false,
        Compare::Less => new < old,
        Compare::Equal => new == old,
        Compare::LessEqual => new <= old,
        Compare::Greater => new > old,
        Compare::NotEqual => new != old,
        Compare::GreaterEqual => new >= old,
        Compare::Always => true,
    }
}

/// A quad over columns `from..to` of a target 16 wide, at a depth.
fn columns(from: f32, to: f32, depth: f32) -> [[f32; 4]; 6] {
    let (left, right) = (from / 8.0 - 1.0, to / 8.0 - 1.0);
    let at = |x, y| [x, y, depth, 1.0];
    let [a, b, c, d] = [
        at(left, 1.0),
        at(right, 1.0),
        at(left, -1.0),
        at(right, -1.0),
    ];
    [a, c, b, b, c, d]
}

const BY_INSTANCE: &str = "
    struct Varyings { @builtin(position) position: vec4<f32>, @location(0) @interpolate(flat) colour: vec4<f32> }
    @vertex fn vertex(@location(0) position: vec4<f32>, @location(1) colour: vec4<f32>) -> Varyings {
        return Varyings(position, colour);
    }
    @fragment fn fragment(in: Varyings) -> @location(0) vec4<f32> { return in.colour; }";

/// Quads with a colour each.
fn coloured(wgsl: &'static str, quads: &[([[f32; 4]; 6], [f32; 4])]) -> Scene<'static> {
    let mut scene = Scene::new(wgsl, [16, 5], &[]);
    let mut numbers = Vec::new();
    for (corners, colour) in quads {
        for corner in corners {
            numbers.extend(corner.iter().chain(colour));
        }
    }
    let attribute = |name: &'static str, offset| VertexAttribute {
        name: name.into(),
        format: VertexFormat::Float32x4,
        offset,
    };
    scene.layouts = vec![VertexLayout {
        stride: 32,
        step: StepMode::Vertex,
        attributes: vec![attribute("position", 0), attribute("colour", 16)],
    }];
    scene.vertices = vec![common::floats(&numbers)];
    scene.range.count = quads.len() as u32 * 6;
    scene
}

#[test]
fn depth_is_compared_and_written() {
    // The same fragment kernel, as early and as late as it can be tested.
    let discarding = "
    struct Varyings { @builtin(position) position: vec4<f32>, @location(0) @interpolate(flat) colour: vec4<f32> }
    @vertex fn vertex(@location(0) position: vec4<f32>, @location(1) colour: vec4<f32>) -> Varyings {
        return Varyings(position, colour);
    }
    @fragment fn fragment(in: Varyings) -> @location(0) vec4<f32> {
        if in.colour.y > 5.0 { discard; }
        return in.colour;
    }";
    let giving = "
    struct Varyings { @builtin(position) position: vec4<f32>, @location(0) @interpolate(flat) colour: vec4<f32> }
    @vertex fn vertex(@location(0) position: vec4<f32>, @location(1) colour: vec4<f32>) -> Varyings {
        return Varyings(vec4(position.xy, 0.5, 1.0), vec4(colour.xyz, position.z));
    }
    struct Result { @location(0) colour: vec4<f32>, @builtin(frag_depth) depth: f32 }
    @fragment fn fragment(in: Varyings) -> Result { return Result(in.colour, in.colour.w); }";
    let mut random = Random(9);
    let levels = [0.0, 0.25, 0.3, 0.5, 0.5000076, 0.75, 1.0];
    for (kernel, wgsl) in [BY_INSTANCE, discarding, giving].into_iter().enumerate() {
        for format in [Format::Depth32Float, Format::Depth16Unorm] {
            for compare in COMPARES {
                for write in [true, false] {
                    let quads: Vec<_> = (0..40)
                        .map(|i| {
                            let from = random.below(14) as f32;
                            let to = from + 1.0 + random.below(3) as f32;
                            let depth = levels[random.below(levels.len())];
                            let colour = [i as f32 + 1.0, 0.0, 0.0, 1.0];
                            (from, to, depth, colour)
                        })
                        .collect();
                    let corners: Vec<_> = quads
                        .iter()
                        .map(|&(from, to, depth, colour)| (columns(from, to, depth), colour))
                        .collect();
                    let mut scene = coloured(wgsl, &corners);
                    scene.depth = Some(format);
                    scene.clear_depth = 0.5;
                    scene.state.depth = Some(DepthState {
                        compare,
                        write,
                        bias: DepthBias::default(),
                    });
                    let targets = scene.draw_once();
                    let stored = |depth: f32| match format {
                        Format::Depth16Unorm => {
                            ((f64::from(depth) * 65535.0).round_ties_even() / 65535.0) as f32
                        }
                        _ => depth,
                    };
                    let (mut want, mut depths) = ([0.0; 16], [stored(0.5); 16]);
                    for &(from, to, depth, colour) in &quads {
                        for x in from as usize..(to as usize).min(16) {
                            if passes(compare, stored(depth), depths[x]) {
                                want[x] = colour[0];
                                if write {
                                    depths[x] = stored(depth);
                                }
                            }
                        }
                    }
                    let (got, got_depth) = (targets.colour(0), targets.depths());
                    for i in 0..80 {
                        let name = format!("kernel {kernel}, {format}, {compare:?}, {write}, {i}");
                        assert_eq!(got[i][0], want[i % 16], "{name}");
                        assert_eq!(got_depth[i], depths[i % 16], "{name}");
                    }
                }
            }
        }
    }
}

/// The plane `z = x · slope + 0.25` and a bias: by the formula of the specification.
#[test]
fn biases_are_what_the_formula_says() {
    for (constant, slope, clamp) in [
        (0, 1.0, 0.0),
        (4096, 0.0, 0.0),
        (-4096, 0.0, 0.0),
        (64, 2.0, 0.0),
        (0, 3.0, 0.01),
        (0, -3.0, -0.01),
        (1 << 20, 1.0, 0.125),
    ] {
        for format in [Format::Depth32Float, Format::Depth16Unorm] {
            for gradient in [0.0, 1.0 / 64.0] {
                let mut quad = columns(0.0, 16.0, 0.25);
                for corner in &mut quad {
                    corner[2] += (corner[0] + 1.0) * 8.0 * gradient;
                }
                let mut scene = coloured(BY_INSTANCE, &[(quad, [1.0; 4])]);
                scene.depth = Some(format);
                scene.state.depth = Some(DepthState {
                    compare: Compare::Always,
                    write: true,
                    bias: DepthBias {
                        constant,
                        slope,
                        clamp,
                    },
                });
                let most = 0.25 + 16.0 * gradient;
                let unit = match format {
                    Format::Depth16Unorm => 1.0 / 65535.0,
                    // 2^(e - 23) for depths from 2^e on.
                    _ => (f64::from(most).log2().floor() - 23.0).exp2(),
                };
                let bias = f64::from(constant) * unit + f64::from(slope) * f64::from(gradient);
                let clamp = f64::from(clamp);
                let bias = if clamp > 0.0 {
                    bias.min(clamp)
                } else if clamp < 0.0 {
                    bias.max(clamp)
                } else {
                    bias
                };
                for (i, got) in scene.draw_once().depths().iter().enumerate() {
                    let x = (i % 16) as f64 + 0.5;
                    let want = (0.25 + x * f64::from(gradient) + bias).clamp(0.0, 1.0);
                    let tolerance = match format {
                        Format::Depth16Unorm => 0.51 / 65535.0,
                        _ => 4.0 * f64::from(f32::EPSILON),
                    };
                    assert!(
                        (f64::from(*got) - want).abs() <= tolerance,
                        "{constant} {slope} {clamp} {format} {gradient}: {got} not {want}"
                    );
                }
            }
        }
    }
}

const FACTORS: [BlendFactor; 10] = [
    BlendFactor::Zero,
    BlendFactor::One,
    BlendFactor::Source,
    BlendFactor::OneMinusSource,
    BlendFactor::SourceAlpha,
    BlendFactor::OneMinusSourceAlpha,
    BlendFactor::Target,
    BlendFactor::OneMinusTarget,
    BlendFactor::TargetAlpha,
    BlendFactor::OneMinusTargetAlpha,
];

const OPERATIONS: [BlendOperation; 5] = [
    BlendOperation::Add,
    BlendOperation::Subtract,
    BlendOperation::ReverseSubtract,
    BlendOperation::Min,
    BlendOperation::Max,
];

fn factor(factor: BlendFactor, s: [f32; 4], d: [f32; 4], c: usize) -> f32 {
    match factor {
        BlendFactor::Zero => 0.0,
        BlendFactor::One => 1.0,
        BlendFactor::Source => s[c],
        BlendFactor::OneMinusSource => 1.0 - s[c],
        BlendFactor::SourceAlpha => s[3],
        BlendFactor::OneMinusSourceAlpha => 1.0 - s[3],
        BlendFactor::Target => d[c],
        BlendFactor::OneMinusTarget => 1.0 - d[c],
        BlendFactor::TargetAlpha => d[3],
        BlendFactor::OneMinusTargetAlpha => 1.0 - d[3],
    }
}

fn blended(part: BlendComponent, s: [f32; 4], d: [f32; 4], c: usize) -> f32 {
    let (a, b) = (
        s[c] * factor(part.source, s, d, c),
        d[c] * factor(part.target, s, d, c),
    );
    match part.operation {
        BlendOperation::Add => a + b,
        BlendOperation::Subtract => a - b,
        BlendOperation::ReverseSubtract => b - a,
        BlendOperation::Min => s[c].min(d[c]),
        BlendOperation::Max => s[c].max(d[c]),
    }
}

fn renderable() -> impl Iterator<Item = Format> {
    Format::ALL.iter().copied().filter(|format| {
        format.sample_kind() != SampleKind::Depth && format.encoding() != Encoding::SharedExponent
    })
}

fn is_float(format: &Format) -> bool {
    format.sample_kind() == SampleKind::Float
}

#[test]
fn every_factor_and_operation_blends_in_order() {
    let mut random = Random(31);
    let formats: Vec<Format> = renderable().filter(is_float).collect();
    for round in 0..120 {
        let format = formats[round % formats.len()];
        let mut part = || BlendComponent {
            source: FACTORS[random.below(10)],
            target: FACTORS[random.below(10)],
            operation: OPERATIONS[random.below(5)],
        };
        let blend = Blend {
            colour: part(),
            alpha: part(),
        };
        let quads: Vec<_> = (0..30)
            .map(|_| {
                let from = random.below(14) as f32;
                let to = from + 1.0 + random.below(3) as f32;
                (from, to, [0; 4].map(|_| random.range(-0.5, 1.5)))
            })
            .collect();
        let corners: Vec<_> = quads
            .iter()
            .map(|&(from, to, colour)| (columns(from, to, 0.5), colour))
            .collect();
        let mut scene = coloured(BY_INSTANCE, &corners);
        scene.colours = vec![format];
        scene.clear = Texel::Float([0.25, 0.5, 0.125, 0.75]);
        scene.state.targets = vec![TargetState {
            blend: Some(blend),
            writes: ColourWrites::ALL,
        }];
        let targets = if round < 10 {
            scene.draw()
        } else {
            scene.draw_once()
        };
        let texel_bytes = format.texel_bytes() as usize;
        let mut want = [[0; 16]; 16];
        for bytes in &mut want {
            format.encode(scene.clear, bytes);
        }
        let low = match format.encoding() {
            Encoding::Unorm | Encoding::UnormSrgb => Some(0.0),
            Encoding::Snorm => Some(-1.0),
            _ => None,
        };
        for &(from, to, colour) in &quads {
            for bytes in &mut want[from as usize..(to as usize).min(16)] {
                let Texel::Float(there) = format.decode(bytes) else {
                    unreachable!()
                };
                let s = colour.map(|channel| low.map_or(channel, |low| channel.clamp(low, 1.0)));
                let new = [0, 1, 2, 3].map(|c| {
                    let part = if c == 3 { blend.alpha } else { blend.colour };
                    blended(part, s, there, c)
                });
                format.encode(Texel::Float(new), bytes);
            }
        }
        let bytes = targets.colours[0].to_image().unwrap().bytes;
        for (i, got) in bytes.chunks_exact(texel_bytes).enumerate() {
            assert_eq!(
                got,
                &want[i % 16][..texel_bytes],
                "{format}, {blend:?}, pixel {i}"
            );
        }
    }
}

#[test]
fn masked_channels_stay() {
    for format in renderable() {
        let kind = match format.sample_kind() {
            SampleKind::Uint => "u32",
            SampleKind::Sint => "i32",
            _ => "f32",
        };
        let wgsl = format!(
            "@vertex fn vertex(@location(0) position: vec4<f32>) -> @builtin(position) vec4<f32> {{ return position; }}
             @fragment fn fragment(@builtin(position) at: vec4<f32>) -> @location(0) vec4<{kind}> {{
                 return vec4<{kind}>(vec4(at.x * 0.1, at.y * 0.2, at.x * 0.05, 0.5) * {});
             }}",
            if kind == "f32" { "1.0" } else { "2.0" }
        );
        for bits in 0..16 {
            let on = |bit: u32| bits >> bit & 1 == 1;
            let writes = ColourWrites {
                red: on(0),
                green: on(1),
                blue: on(2),
                alpha: on(3),
            };
            let mut scene = Scene::new(&wgsl, [16, 5], &columns(2.0, 13.0, 0.5));
            scene.colours = vec![format];
            scene.clear = match format.sample_kind() {
                SampleKind::Uint => Texel::Uint([3, 4, 5, 1]),
                SampleKind::Sint => Texel::Sint([-3, 4, -5, 1]),
                _ => Texel::Float([0.25, 0.5, 0.75, 1.0]),
            };
            let all = scene.draw_once();
            scene.state.targets = vec![TargetState {
                blend: None,
                writes,
            }];
            let masked = scene.draw_once();
            let image = |targets: &Targets| targets.colours[0].to_image().unwrap();
            let (all, masked) = (image(&all), image(&masked));
            for i in 0..80 {
                let (x, y) = (i % 16, i / 16);
                let (full, got) = (all.texel(x, y, 0, 0), masked.texel(x, y, 0, 0));
                let (full, got) = (full.unwrap().to_f32(), got.unwrap().to_f32());
                let mut clear = [0; 16];
                format.encode(scene.clear, &mut clear);
                let clear = format.decode(&clear).to_f32();
                for c in 0..4 {
                    let want = if on(c as u32) { full[c] } else { clear[c] };
                    assert_eq!(got[c], want, "{format} {bits:b} {x} {y} channel {c}");
                }
            }
        }
    }
}

#[test]
fn eight_targets_have_states_of_their_own() {
    let outputs: String = (0..8)
        .map(|i| format!("@location({i}) c{i}: vec4<f32>, "))
        .collect();
    let values: String = (0..8).map(|i| format!("vec4({i}.5), ")).collect();
    let wgsl = format!(
        "@vertex fn vertex(@location(0) position: vec4<f32>) -> @builtin(position) vec4<f32> {{ return position; }}
         struct Colours {{ {outputs} }}
         @fragment fn fragment() -> Colours {{ return Colours({values}); }}"
    );
    let mut scene = Scene::new(&wgsl, [16, 5], &columns(4.0, 9.0, 0.5));
    scene.colours = vec![Format::Rgba32Float; 8];
    scene.clear = Texel::Float([100.0; 4]);
    scene.state.targets = (0..8)
        .map(|i| TargetState {
            blend: (i % 2 == 1).then_some(Blend::ADD),
            writes: ColourWrites {
                green: i != 4,
                ..ColourWrites::ALL
            },
        })
        .collect();
    let targets = scene.draw();
    for i in 0..8 {
        for (at, got) in targets.colour(i).iter().enumerate() {
            let inside = (4..9).contains(&(at % 16));
            let new = i as f32 + 0.5 + if i % 2 == 1 { 100.0 } else { 0.0 };
            let want = if inside { new } else { 100.0 };
            assert_eq!(got[0], want);
            assert_eq!(got[1], if i == 4 { 100.0 } else { want });
        }
    }
}

#[test]
fn what_cannot_be_blended_is_refused() {
    let wgsl = "@vertex fn vertex(@location(0) position: vec4<f32>) -> @builtin(position) vec4<f32> { return position; }
        @fragment fn fragment() -> @location(0) vec4<u32> { return vec4(1u); }";
    let mut scene = Scene::new(wgsl, [4, 4], &[]);
    scene.colours = vec![Format::Rgba8Uint];
    scene.try_program().unwrap();
    scene.state.targets = vec![TargetState {
        blend: Some(Blend::ADD),
        ..TargetState::default()
    }];
    assert!(matches!(
        scene.try_program(),
        Err(RasterError::Format { .. })
    ));
    scene.state.targets.clear();
    for format in [Format::Rgb9e5Ufloat, Format::Depth32Float] {
        scene.colours = vec![format];
        assert!(matches!(
            scene.try_program(),
            Err(RasterError::Format { .. })
        ));
    }
}
