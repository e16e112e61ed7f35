//! What tests that draw share: kernels, meshes in pixels, and graphs with the
//! buffers they import.

use etalon_ash::AshBackend;
use etalon_core::Format;
use etalon_core::backend::{Execution, Inputs};
use etalon_core::graph::{Buffer, ClearValue, Draw, Graph, Load, RasterPass, Texture};
use etalon_core::image::ImageData;
use etalon_core::raster::{RasterState, VertexFormat, VertexLayout};
use etalon_core::resource::{BufferDesc, TextureDesc};

pub(crate) const ZERO: Load = Load::Clear(ClearValue::Float([0.0; 4]));

/// A graph and the contents of its imports.
pub(crate) struct Scene {
    pub(crate) graph: Graph,
    buffers: Vec<(String, Vec<u8>)>,
}

impl Scene {
    pub(crate) fn new() -> Self {
        Self {
            graph: Graph::new(),
            buffers: Vec::new(),
        }
    }

    /// Imports a buffer.
    pub(crate) fn bytes(&mut self, name: &str, bytes: Vec<u8>) -> Buffer {
        let desc = BufferDesc {
            bytes: bytes.len() as u64,
        };
        self.buffers.push((name.to_owned(), bytes));
        self.graph.import_buffer(name, desc).unwrap()
    }

    /// Imports a buffer of floats.
    pub(crate) fn floats(&mut self, name: &str, values: &[f32]) -> Buffer {
        self.bytes(name, values.iter().flat_map(|v| v.to_le_bytes()).collect())
    }

    /// Imports a buffer of words.
    pub(crate) fn words(&mut self, name: &str, values: &[u32]) -> Buffer {
        self.bytes(name, values.iter().flat_map(|v| v.to_le_bytes()).collect())
    }

    /// Imports a buffer of halves of words, padded to whole ones.
    pub(crate) fn shorts(&mut self, name: &str, values: &[u16]) -> Buffer {
        let mut bytes: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
        bytes.resize(bytes.len().next_multiple_of(4), 0);
        self.bytes(name, bytes)
    }

    /// A texture to draw to.
    pub(crate) fn target(&mut self, name: &str, size: [u32; 2], format: Format) -> Texture {
        self.graph
            .texture(name, TextureDesc::d2(size[0], size[1], format))
    }

    pub(crate) fn inputs(&self) -> Inputs<'_> {
        self.buffers
            .iter()
            .fold(Inputs::new(), |inputs, (name, bytes)| {
                inputs.buffer(name.as_str(), bytes)
            })
    }

    pub(crate) fn run(&self, backend: &mut AshBackend) -> Execution {
        super::execute(backend, &self.graph, &self.inputs())
    }

    /// Draws to one target of this format and size in a pass, and runs it.
    pub(crate) fn one(
        mut self,
        backend: &mut AshBackend,
        size: [u32; 2],
        format: Format,
        clear: ClearValue,
        pass: impl FnOnce(RasterPass<'_>) -> RasterPass<'_>,
    ) -> ImageData {
        let target = self.target("target", size, format);
        let declared = self
            .graph
            .raster("pass")
            .colour("colour", target, Load::Clear(clear));
        let written = pass(declared).finish().unwrap();
        self.graph
            .output("colour", written.texture("colour").unwrap())
            .unwrap();
        self.run(backend).output("colour").unwrap().clone()
    }
}

/// Two triangles that cover pixels from one corner to another, in targets of a
/// size: corners of four floats, counter-clockwise.
pub(crate) fn quad(size: [u32; 2], from: [f32; 2], to: [f32; 2], depth: f32) -> Vec<f32> {
    let ([x0, y0], [x1, y1]) = (clip(size, from), clip(size, to));
    [(x0, y0), (x0, y1), (x1, y1), (x0, y0), (x1, y1), (x1, y0)]
        .into_iter()
        .flat_map(|(x, y)| [x, y, depth, 1.0])
        .collect()
}

/// Where in clip space a place in pixels is.
pub(crate) fn clip(size: [u32; 2], at: [f32; 2]) -> [f32; 2] {
    [
        at[0] * 2.0 / size[0] as f32 - 1.0,
        1.0 - at[1] * 2.0 / size[1] as f32,
    ]
}

/// Corners of four floats.
pub(crate) fn corners() -> VertexLayout {
    VertexLayout::packed("position", VertexFormat::Float32x4)
}

/// Draws corners in one colour.
pub(crate) fn tinted(corners_of: Buffer, tint: [f32; 4]) -> Draw {
    Draw::new("draw/tint")
        .vertices(corners_of, 0, corners())
        .set("red", tint[0])
        .set("green", tint[1])
        .set("blue", tint[2])
        .set("alpha", tint[3])
}

/// A state that only says how to cull or the like.
pub(crate) fn state(change: impl FnOnce(&mut RasterState)) -> RasterState {
    let mut state = RasterState::default();
    change(&mut state);
    state
}

pub(crate) const KERNELS: &[(&str, &str)] = &[
    // Corners as they are, in one colour.
    (
        "draw/tint",
        "struct Params { red: f32, green: f32, blue: f32, alpha: f32 }
         @group(0) @binding(0) var<uniform> params: Params;
         @vertex fn vertex(@location(0) position: vec4f) -> @builtin(position) vec4f {
             return position;
         }
         @fragment fn fragment() -> @location(0) vec4f {
             return vec4f(params.red, params.green, params.blue, params.alpha);
         }",
    ),
    // Corners as they are, for depth.
    (
        "draw/depth",
        "@vertex fn vertex(@location(0) position: vec4f) -> @builtin(position) vec4f {
             return position;
         }",
    ),
    // A triangle over everything: where each pixel is.
    (
        "draw/full",
        "@vertex fn vertex(@builtin(vertex_index) index: u32) -> @builtin(position) vec4f {
             let corner = vec2f(vec2u(index & 1u, index >> 1u)) * 4.0 - 1.0;
             return vec4f(corner, 0.5, 1.0);
         }
         @fragment fn fragment(@builtin(position) at: vec4f) -> @location(0) vec4f {
             return vec4f(at.xyz, 1.0);
         }",
    ),
    // A triangle over everything, with a texture's texels.
    (
        "draw/copy",
        "@group(0) @binding(0) var source: texture_2d<f32>;
         @vertex fn vertex(@builtin(vertex_index) index: u32) -> @builtin(position) vec4f {
             let corner = vec2f(vec2u(index & 1u, index >> 1u)) * 4.0 - 1.0;
             return vec4f(corner, 0.5, 1.0);
         }
         @fragment fn fragment(@builtin(position) at: vec4f) -> @location(0) vec4f {
             return textureLoad(source, vec2u(at.xy), 0);
         }",
    ),
    // More than devices have to pass on.
    (
        "draw/too_much",
        "struct Corner { @builtin(position) clip: vec4f, @location(5000) uv: vec2f }
         @vertex fn vertex(@builtin(vertex_index) index: u32) -> Corner {
             return Corner(vec4f(f32(index)), vec2f());
         }
         @fragment fn fragment(corner: Corner) -> @location(0) vec4f {
             return vec4f(corner.uv, corner.uv);
         }",
    ),
    // Three targets of different kinds.
    (
        "draw/targets",
        "struct Corner { @builtin(position) clip: vec4f, @location(0) uv: vec2f }
         @vertex fn vertex(@builtin(vertex_index) index: u32) -> Corner {
             let corner = vec2f(vec2u(index & 1u, index >> 1u)) * 4.0 - 1.0;
             return Corner(vec4f(corner, 0.5, 1.0), corner);
         }
         struct Targets {
             @location(0) colour: vec4f, @location(1) id: u32, @location(2) motion: vec2f
         }
         @fragment fn fragment(corner: Corner) -> Targets {
             let at = vec2u(corner.clip.xy);
             return Targets(vec4f(1.0, 0.0, 1.0, 0.0), at.x + 100u * at.y, corner.uv);
         }",
    ),
    // Corners moved and numbered by instance.
    (
        "draw/instances",
        "struct Corner {
             @builtin(position) clip: vec4f,
             @location(0) @interpolate(flat) id: u32,
         }
         @vertex fn vertex(
             @location(0) position: vec4f, @location(1) offset: vec2f, @location(2) id: u32,
             @builtin(instance_index) instance: u32
         ) -> Corner {
             return Corner(position + vec4f(offset, 0.0, 0.0), id + instance);
         }
         @fragment fn fragment(corner: Corner) -> @location(0) u32 { return corner.id; }",
    ),
    // Pixels of a row by vertex number, counted by instance: three corners each.
    (
        "draw/pixels",
        "struct Corner {
             @builtin(position) clip: vec4f,
             @location(0) @interpolate(flat) value: f32,
         }
         @vertex fn vertex(
             @location(0) position: vec4f, @builtin(instance_index) instance: u32
         ) -> Corner {
             return Corner(position, f32(instance + 1u));
         }
         @fragment fn fragment(corner: Corner) -> @location(0) vec4f {
             return vec4f(corner.value, 0.0, 0.0, 1.0);
         }",
    ),
    // Corners of a quad, as a compute kernel makes them.
    (
        "draw/make_corners",
        "@group(0) @binding(0) var<storage, read_write> corners: array<vec4f>;
         @compute @workgroup_size(8)
         fn main(@builtin(global_invocation_id) id: vec3<u32>) {
             if (id.x >= arrayLength(&corners)) { return; }
             var index = id.x;
             if (index >= 3u) { index = 6u - index; }
             let corner = vec2f(vec2u(index & 1u, index >> 1u)) * 4.0 - 1.0;
             corners[id.x] = vec4f(corner, 0.5, 1.0);
         }",
    ),
    // Corners as the vertex kernel itself finds them in a buffer.
    (
        "draw/pulled",
        "@group(0) @binding(0) var<storage, read> corners: array<vec4f>;
         @group(0) @binding(1) var depths: texture_depth_2d;
         @vertex fn vertex(@builtin(vertex_index) index: u32) -> @builtin(position) vec4f {
             return corners[index];
         }
         @fragment fn fragment(@builtin(position) at: vec4f) -> @location(0) vec4f {
             return vec4f(textureLoad(depths, vec2u(at.xy), 0), 0.0, 0.0, 1.0);
         }",
    ),
    // result = depths
    (
        "draw/read_depth",
        "@group(0) @binding(0) var depths: texture_depth_2d;
         @group(0) @binding(1) var result: texture_storage_2d<r32float, write>;
         @compute @workgroup_size(8, 8)
         fn main(@builtin(global_invocation_id) id: vec3<u32>) {
             let size = textureDimensions(result);
             if (id.x >= size.x || id.y >= size.y) { return; }
             let value = textureLoad(depths, id.xy, 0);
             textureStore(result, id.xy, vec4f(value, 0.0, 0.0, 1.0));
         }",
    ),
    // Records of draws, as a compute kernel makes them: one instance of three
    // vertices, from the first on.
    (
        "draw/make_records",
        "@group(0) @binding(0) var<storage, read_write> records: array<u32>;
         @compute @workgroup_size(1)
         fn main() {
             records[0] = 3u;
             records[1] = 1u;
             records[2] = 0u;
             records[3] = 0u;
         }",
    ),
];
