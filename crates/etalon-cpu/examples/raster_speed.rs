//! How long drawing a sphere of 100,352 triangles at 1280×720 takes: milliseconds,
//! and nanoseconds for each triangle given and each fragment shaded, of the fastest
//! of some rounds.
//!
//! `cargo run --release -p etalon-cpu --example raster_speed [ROUNDS]`

use std::time::Instant;

use etalon_core::Format;
use etalon_core::image::ImageData;
use etalon_core::raster::{
    CullMode, DepthState, IndexFormat, RasterState, Scissor, StepMode, VertexAttribute,
    VertexFormat, VertexLayout, Viewport,
};
use etalon_core::resource::{AddressMode, Filter, SamplerDesc, TextureDesc};
use etalon_core::texel::Texel;
use etalon_cpu::{
    BindingKind, BoundResource, Buffer, DrawRange, Executor, IndexBuffer, RasterDesc, RasterDraw,
    RasterProgram, Texture, VertexBuffer,
};

const KERNELS: &str = "
struct Varyings {
    @builtin(position) position: vec4<f32>,
    @location(0) normal: vec3<f32>,
    @location(1) uv: vec2<f32>,
}
@group(0) @binding(0) var<uniform> view: mat4x4<f32>;
@group(0) @binding(1) var colours: texture_2d<f32>;
@group(0) @binding(2) var filtering: sampler;
@vertex fn vertex(
    @location(0) position: vec3<f32>,
    @location(1) normal: vec3<f32>,
    @location(2) uv: vec2<f32>,
) -> Varyings {
    return Varyings(view * vec4(position, 1.0), normal, uv);
}
fn light(normal: vec3<f32>) -> f32 {
    return 0.2 + max(dot(normalize(normal), normalize(vec3(0.3, 0.5, -0.8))), 0.0);
}
@fragment fn plain(in: Varyings) -> @location(0) vec4<f32> {
    return vec4(vec3(light(in.normal)), 1.0);
}
@fragment fn sampled(in: Varyings) -> @location(0) vec4<f32> {
    return vec4(textureSampleLevel(colours, filtering, in.uv, 0.0).xyz * light(in.normal), 1.0);
}
@fragment fn textured(in: Varyings) -> @location(0) vec4<f32> {
    return vec4(textureSample(colours, filtering, in.uv).xyz * light(in.normal), 1.0);
}";

const SIZE: [u32; 2] = [1280, 720];
const CELLS: u32 = 224;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let rounds = std::env::args()
        .nth(1)
        .map_or(Ok(20), |rounds| rounds.parse())?;
    let (mut vertices, mut indices) = (Vec::<f32>::new(), Vec::<u32>::new());
    for y in 0..=CELLS {
        for x in 0..=CELLS {
            let (u, v) = (x as f32 / CELLS as f32, y as f32 / CELLS as f32);
            let (turn, tilt) = (u * std::f32::consts::TAU, v * std::f32::consts::PI);
            let normal = [tilt.sin() * turn.cos(), tilt.cos(), tilt.sin() * turn.sin()];
            vertices.extend(normal);
            vertices.extend(normal);
            vertices.extend([u * 4.0, v * 2.0]);
        }
    }
    for y in 0..CELLS {
        for x in 0..CELLS {
            let a = y * (CELLS + 1) + x;
            let [b, c, d] = [a + 1, a + CELLS + 1, a + CELLS + 2];
            indices.extend([a, c, b, b, c, d]);
        }
    }
    let bytes = |words: &mut dyn Iterator<Item = u32>| -> Vec<u8> {
        words.flat_map(u32::to_le_bytes).collect()
    };
    let vertex_buffer = Buffer::from_bytes(&bytes(&mut vertices.iter().map(|v| v.to_bits())))?;
    let index_buffer = Buffer::from_bytes(&bytes(&mut indices.iter().copied()))?;
    // Perspective with reversed depth, from 2.6 away: columns.
    let (scale, aspect) = (2.2_f32, SIZE[0] as f32 / SIZE[1] as f32);
    let view: [f32; 16] = [
        scale / aspect,
        0.0,
        0.0,
        0.0, //
        0.0,
        scale,
        0.0,
        0.0, //
        0.0,
        0.0,
        0.0,
        1.0, //
        0.0,
        0.0,
        0.1,
        2.6,
    ];
    let uniform = Buffer::from_bytes(&bytes(&mut view.iter().map(|v| v.to_bits())))?;
    let desc = TextureDesc {
        mips: 11,
        ..TextureDesc::d2(1024, 1024, Format::Rgba8Unorm)
    };
    let count = desc.bytes().unwrap_or(0);
    let noise = (0..count)
        .map(|i| (i.wrapping_mul(2_654_435_761) >> 13) as u8)
        .collect();
    let texture = Texture::from_image(&ImageData::from_bytes(desc, noise)?)?;
    let sampler = SamplerDesc::new(AddressMode::Repeat, Filter::Linear, Filter::Linear);

    let module = naga::front::wgsl::parse_str(KERNELS)?;
    let info = naga::valid::Validator::new(
        naga::valid::ValidationFlags::all(),
        naga::valid::Capabilities::all(),
    )
    .validate(&module)?;
    let attribute = |name: &'static str, format, offset| VertexAttribute {
        name: name.into(),
        format,
        offset,
    };
    let layouts = [VertexLayout {
        stride: 32,
        step: StepMode::Vertex,
        attributes: vec![
            attribute("position", VertexFormat::Float32x3, 0),
            attribute("normal", VertexFormat::Float32x3, 12),
            attribute("uv", VertexFormat::Float32x2, 24),
        ],
    }];
    let state = RasterState {
        cull: CullMode::Back,
        depth: Some(DepthState::REVERSED),
        ..RasterState::default()
    };
    for (fragment, format) in [
        (None, Format::Rgba8Unorm),
        (Some("plain"), Format::Rgba8Unorm),
        (Some("plain"), Format::Rgba16Float),
        (Some("plain"), Format::Rgba8UnormSrgb),
        (Some("sampled"), Format::Rgba8Unorm),
        (Some("textured"), Format::Rgba8Unorm),
    ] {
        let formats = [format];
        let colours: &[Format] = if fragment.is_some() { &formats } else { &[] };
        let desc = RasterDesc {
            vertex: "vertex",
            fragment,
            layouts: &layouts,
            state: &state,
            colours,
            depth: Some(Format::Depth32Float),
            sanitise: false,
        };
        let program = RasterProgram::from_module("sphere", KERNELS, &module, &info, &desc)?;
        let resources: Vec<BoundResource<'_>> = program
            .bindings()
            .iter()
            .map(|binding| match binding.kind {
                BindingKind::Uniform { .. } => BoundResource::Buffer(&uniform),
                BindingKind::Sampler { .. } => BoundResource::Sampler(sampler),
                _ => BoundResource::Texture(texture.view()),
            })
            .collect();
        for threads in [1, 2] {
            let executor = Executor::new(threads)?;
            let colour = Texture::zeroed(TextureDesc::d2(SIZE[0], SIZE[1], format))?;
            let depth = Texture::zeroed(TextureDesc::d2(SIZE[0], SIZE[1], Format::Depth32Float))?;
            let (colour_views, depth_view) = ([colour.view()], depth.view());
            let draw = RasterDraw {
                vertex_buffers: &[VertexBuffer {
                    buffer: &vertex_buffer,
                    offset: 0,
                }],
                indices: Some(IndexBuffer {
                    buffer: &index_buffer,
                    offset: 0,
                    format: IndexFormat::Uint32,
                }),
                range: DrawRange::of(indices.len() as u32),
                viewport: Viewport::of(SIZE[0], SIZE[1]),
                scissor: Scissor {
                    x: 0,
                    y: 0,
                    width: SIZE[0],
                    height: SIZE[1],
                },
                resources: &resources,
                immediates: &[],
                colours: if fragment.is_some() {
                    &colour_views
                } else {
                    &[]
                },
                depth: Some(&depth_view),
            };
            let mut best = f64::INFINITY;
            let mut counters = Default::default();
            for _ in 0..rounds {
                depth_view.fill(Texel::Float([0.0; 4]));
                let start = Instant::now();
                counters = program.draw(&executor, &draw)?.counters;
                best = best.min(start.elapsed().as_secs_f64());
            }
            let triangles = counters.primitives as f64;
            let fragments = counters.quads as f64 * 4.0;
            println!(
                "{:9} {format:15} {threads} threads: {:7.2} ms, {:6.1} ns a triangle, {:5.1} ns a lane ({} quads, {} triangles left)",
                fragment.unwrap_or("depth"),
                best * 1e3,
                best * 1e9 / triangles,
                best * 1e9 / fragments.max(1.0),
                counters.quads,
                counters.triangles,
            );
        }
    }
    Ok(())
}
