//! Drawing in tests.

use etalon_core::Format;
use etalon_core::raster::{RasterState, Scissor, VertexFormat, VertexLayout, Viewport};
use etalon_core::texel::Texel;
use etalon_cpu::{
    BoundResource, Buffer, DrawRange, Executor, IndexBuffer, RasterDesc, RasterDraw, RasterError,
    RasterProgram, Texture, Tier, VertexBuffer,
};

/// What a scene is drawn with; entry points are `vertex` and `fragment`.
pub(crate) struct Scene<'a> {
    pub(crate) wgsl: &'a str,
    pub(crate) layouts: Vec<VertexLayout>,
    pub(crate) state: RasterState,
    pub(crate) colours: Vec<Format>,
    pub(crate) depth: Option<Format>,
    pub(crate) size: [u32; 2],
    /// By layout.
    pub(crate) vertices: Vec<Buffer>,
    pub(crate) indices: Option<(Buffer, etalon_core::raster::IndexFormat)>,
    pub(crate) range: DrawRange,
    pub(crate) viewport: Option<Viewport>,
    pub(crate) scissor: Option<Scissor>,
    pub(crate) clear: Texel,
    pub(crate) clear_depth: f32,
    pub(crate) sanitise: bool,
}

/// Draws positions in clip space, with varyings from the same buffer.
pub(crate) const PLAIN: &str = "
    @vertex fn vertex(@location(0) position: vec4<f32>) -> @builtin(position) vec4<f32> {
        return position;
    }
    @fragment fn fragment() -> @location(0) vec4<f32> { return vec4(1.0); }";

impl<'a> Scene<'a> {
    /// Triangles by their corners in clip space, which are the input `position`.
    pub(crate) fn new(wgsl: &'a str, size: [u32; 2], positions: &[[f32; 4]]) -> Self {
        let flat: Vec<f32> = positions.iter().flatten().copied().collect();
        Self {
            wgsl,
            layouts: vec![VertexLayout::packed("position", VertexFormat::Float32x4)],
            state: RasterState::default(),
            colours: vec![Format::Rgba32Float],
            depth: None,
            size,
            vertices: vec![super::floats(&flat)],
            indices: None,
            range: DrawRange::of(positions.len() as u32),
            viewport: None,
            scissor: None,
            clear: Texel::Float([0.0; 4]),
            clear_depth: 1.0,
            sanitise: false,
        }
    }

    pub(crate) fn try_program(&self) -> Result<RasterProgram, RasterError> {
        let module = naga::front::wgsl::parse_str(self.wgsl)
            .unwrap_or_else(|error| panic!("{}", error.emit_to_string(self.wgsl)));
        let info = naga::valid::Validator::new(
            naga::valid::ValidationFlags::all(),
            naga::valid::Capabilities::all(),
        )
        .validate(&module)
        .unwrap_or_else(|error| panic!("{}", error.emit_to_string(self.wgsl)));
        let has_fragment = module
            .entry_points
            .iter()
            .any(|entry| entry.name == "fragment");
        let desc = RasterDesc {
            vertex: "vertex",
            fragment: has_fragment.then_some("fragment"),
            layouts: &self.layouts,
            state: &self.state,
            colours: &self.colours,
            depth: self.depth,
            sanitise: self.sanitise,
        };
        RasterProgram::from_module("test", self.wgsl, &module, &info, &desc)
    }

    pub(crate) fn program(&self) -> RasterProgram {
        self.try_program().unwrap_or_else(|error| panic!("{error}"))
    }

    pub(crate) fn targets(&self) -> Targets {
        let [width, height] = self.size;
        let targets = Targets {
            colours: self
                .colours
                .iter()
                .map(|&format| super::empty(width, height, format))
                .collect(),
            depth: self.depth.map(|format| super::empty(width, height, format)),
        };
        for colour in &targets.colours {
            colour.view().fill(self.clear);
        }
        if let Some(depth) = &targets.depth {
            depth
                .view()
                .fill(Texel::Float([self.clear_depth, 0.0, 0.0, 1.0]));
        }
        targets
    }

    pub(crate) fn try_draw(
        &self,
        program: &RasterProgram,
        executor: &Executor,
        targets: &Targets,
        resources: &[BoundResource<'_>],
    ) -> Result<etalon_cpu::DrawReport, RasterError> {
        let [width, height] = self.size;
        let buffers: Vec<VertexBuffer<'_>> = self
            .vertices
            .iter()
            .map(|buffer| VertexBuffer { buffer, offset: 0 })
            .collect();
        let colours: Vec<_> = targets.colours.iter().map(Texture::view).collect();
        let depth = targets.depth.as_ref().map(Texture::view);
        let draw = RasterDraw {
            vertex_buffers: &buffers,
            indices: self.indices.as_ref().map(|(buffer, format)| IndexBuffer {
                buffer,
                offset: 0,
                format: *format,
            }),
            range: self.range,
            viewport: self.viewport.unwrap_or(Viewport::of(width, height)),
            scissor: self.scissor.unwrap_or(Scissor {
                x: 0,
                y: 0,
                width,
                height,
            }),
            resources,
            immediates: &[],
            colours: &colours,
            depth: depth.as_ref(),
        };
        program.draw(executor, &draw)
    }

    /// Draws in every way, which must agree, and returns the targets.
    pub(crate) fn draw(&self) -> Targets {
        self.draw_with(&[])
    }

    pub(crate) fn draw_with(&self, resources: &[BoundResource<'_>]) -> Targets {
        let program = self.program();
        let mut first: Option<Targets> = None;
        for (name, executor) in ways() {
            let targets = self.targets();
            self.try_draw(&program, &executor, &targets, resources)
                .unwrap_or_else(|error| panic!("{error}\n{program}"));
            match &first {
                None => first = Some(targets),
                Some(first) => assert!(first.bytes() == targets.bytes(), "{name}"),
            }
        }
        first.unwrap()
    }

    /// Draws once, on the best tier.
    pub(crate) fn draw_once(&self) -> Targets {
        let targets = self.targets();
        let executor = Executor::new(2).unwrap();
        self.try_draw(&self.program(), &executor, &targets, &[])
            .unwrap_or_else(|error| panic!("{error}"));
        targets
    }
}

/// What is drawn to.
pub(crate) struct Targets {
    pub(crate) colours: Vec<Texture>,
    pub(crate) depth: Option<Texture>,
}

impl Targets {
    pub(crate) fn bytes(&self) -> Vec<Vec<u8>> {
        self.colours
            .iter()
            .chain(&self.depth)
            .map(|texture| texture.to_image().unwrap().bytes)
            .collect()
    }

    /// Red, green, blue, alpha of a colour target, row by row.
    pub(crate) fn colour(&self, target: usize) -> Vec<[f32; 4]> {
        let image = self.colours[target].to_image().unwrap();
        image.to_rgba_f32().unwrap()
    }

    pub(crate) fn depths(&self) -> Vec<f32> {
        let image = self.depth.as_ref().unwrap().to_image().unwrap();
        let texels = image.to_rgba_f32().unwrap();
        texels.into_iter().map(|texel| texel[0]).collect()
    }
}

/// Every way of running that must give the same bits.
pub(crate) fn ways() -> Vec<(String, Executor)> {
    let mut all = Vec::new();
    for tier in Tier::ALL.into_iter().filter(|tier| tier.is_available()) {
        for (threads, lanes) in [(1, 256), (2, 64), (3, 128)] {
            let executor = Executor::new(threads)
                .unwrap()
                .with_tier(tier)
                .with_lanes(lanes);
            all.push((
                format!("{tier}, {threads} threads, {lanes} lanes"),
                executor,
            ));
        }
    }
    all
}

/// Numbers without a pattern.
pub(crate) struct Random(pub(crate) u64);

impl Random {
    pub(crate) fn next(&mut self) -> u64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        self.0.wrapping_mul(0x2545_f491_4f6c_dd1d)
    }

    /// From 0 to below 1.
    pub(crate) fn unit(&mut self) -> f32 {
        (self.next() >> 40) as f32 / (1 << 24) as f32
    }

    pub(crate) fn range(&mut self, low: f32, high: f32) -> f32 {
        low + (high - low) * self.unit()
    }

    pub(crate) fn below(&mut self, count: usize) -> usize {
        (self.next() % count as u64) as usize
    }
}
