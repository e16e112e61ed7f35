//! How triangles become texels: the state of draws beside their kernels.
//!
//! The conventions are WebGPU's, which Vulkan and Direct3D 12 share but for the
//! direction of y:
//!
//! * Clip space is `−w ≤ x ≤ w`, `−w ≤ y ≤ w`, `0 ≤ z ≤ w`, +Y up.
//! * The viewport maps it to pixels with +Y down and the origin at the top left
//!   corner; the centre of pixel `(x, y)` is at `(x + ½, y + ½)`.
//! * A pixel is covered if its centre is inside of the triangle, after corners
//!   were moved to the nearest 1/256 of a pixel; a centre on an edge is inside if
//!   the edge is a top or a left one (Vulkan 1.3, §28.12.1; WebGPU, §23.2.5).
//! * Whether a triangle is front-facing is told by the order of its corners as
//!   seen in the picture.
//!
//! [`VertexLayout`] describes what vertex kernels are fed, [`RasterState`] the rest.

mod state;
mod vertex;

pub use state::{
    Blend, BlendComponent, BlendFactor, BlendOperation, ColourWrites, CullMode, DepthBias,
    DepthState, FrontFace, RasterState, RasterStateError, Scissor, TargetState, Topology, Viewport,
};
pub use vertex::{
    IndexFormat, NumberKind, StepMode, VertexAttribute, VertexFormat, VertexLayout,
    VertexLayoutError,
};

/// Most colour targets of a pass: what every WebGPU device has.
pub const MAX_COLOUR_TARGETS: usize = 8;

/// Bits of a corner's position below the pixel.
pub const SUB_PIXEL_BITS: u32 = 8;
