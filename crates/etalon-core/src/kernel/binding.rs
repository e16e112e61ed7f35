//! What a kernel binds: resources by name, and the layout of its uniform block.

use std::fmt;

use serde::{Deserialize, Serialize};

use crate::Format;
use crate::format::SampleKind;

/// One resource a kernel uses.
///
/// Passes name resources; the group and binding numbers are for backends.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Binding {
    /// Name of the module-scope variable in the kernel.
    pub name: String,
    /// `@group`, always 0 for a kernel of a [`KernelLibrary`](super::KernelLibrary).
    pub group: u32,
    /// `@binding`, unique within the kernel.
    pub binding: u32,
    /// What has to be bound.
    pub kind: BindingKind,
}

/// What has to be bound to a [`Binding`].
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum BindingKind {
    /// The uniform block, filled by member name.
    Uniform(UniformLayout),
    /// A texture that is loaded from, sampled or gathered.
    Texture {
        /// Shape of the view.
        dimension: ViewDimension,
        /// What loads return.
        kind: SampleKind,
        /// Whether some `textureSample*` or `textureGather*` reads it through
        /// a sampler, so that its format has to allow filtering if the sampler
        /// filters.
        filtered: bool,
    },
    /// A texture that is stored to, loaded without a sampler, or both.
    StorageTexture {
        /// Shape of the view.
        dimension: ViewDimension,
        /// Format the shader states; the texture must have it.
        format: Format,
        /// What the shader may do.
        access: Access,
    },
    /// A buffer in the `storage` address space.
    StorageBuffer {
        /// What the shader may do.
        access: Access,
        /// Bytes the shader's type needs, with one element in a runtime-sized
        /// array at its end.
        min_size: u64,
    },
    /// A sampler.
    Sampler {
        /// Whether it compares depth.
        comparison: bool,
    },
}

/// The shape of a texture view as the shader declares it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum ViewDimension {
    /// `texture_2d` and its storage and depth kin.
    D2,
    /// `texture_2d_array`.
    D2Array,
    /// `texture_cube`.
    Cube,
    /// `texture_cube_array`.
    CubeArray,
    /// `texture_3d`.
    D3,
}

impl fmt::Display for ViewDimension {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::D2 => "2d",
            Self::D2Array => "2d array",
            Self::Cube => "cube",
            Self::CubeArray => "cube array",
            Self::D3 => "3d",
        })
    }
}

/// What a shader may do with a storage resource.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum Access {
    /// Only read.
    Read,
    /// Only write.
    Write,
    /// Both.
    ReadWrite,
}

impl Access {
    /// Whether reading is allowed.
    #[must_use]
    pub const fn reads(self) -> bool {
        matches!(self, Self::Read | Self::ReadWrite)
    }

    /// Whether writing is allowed.
    #[must_use]
    pub const fn writes(self) -> bool {
        matches!(self, Self::Write | Self::ReadWrite)
    }
}

impl fmt::Display for Access {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Read => "read",
            Self::Write => "write",
            Self::ReadWrite => "read_write",
        })
    }
}

/// The layout of a kernel's `var<uniform>` structure, as WGSL §14.4.4 lays it
/// out for the uniform address space.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct UniformLayout {
    /// Bytes of the whole block, a multiple of 4.
    pub size: u32,
    /// Members in order of declaration, which is also order of offset.
    pub members: Vec<UniformMember>,
}

impl UniformLayout {
    /// The member with the given name.
    #[must_use]
    pub fn member(&self, name: &str) -> Option<&UniformMember> {
        self.members.iter().find(|member| member.name == name)
    }
}

/// One member of a uniform block.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct UniformMember {
    /// Name in the WGSL structure.
    pub name: String,
    /// Bytes from the start of the block.
    pub offset: u32,
    /// Type.
    pub ty: UniformType,
}

/// The scalar a uniform is made of. Each takes 4 bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum UniformScalar {
    /// `f32`.
    F32,
    /// `i32`.
    I32,
    /// `u32`.
    U32,
}

impl fmt::Display for UniformScalar {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::F32 => "f32",
            Self::I32 => "i32",
            Self::U32 => "u32",
        })
    }
}

/// The type of a uniform member.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum UniformType {
    /// One scalar.
    Scalar(UniformScalar),
    /// A vector, components tightly packed.
    Vector {
        /// Component type.
        scalar: UniformScalar,
        /// 2, 3 or 4.
        size: u32,
    },
    /// A matrix of `f32`, stored as `columns` vectors.
    Matrix {
        /// Number of columns: 2, 3 or 4.
        columns: u32,
        /// Components of each column: 2, 3 or 4.
        rows: u32,
        /// Bytes from one column to the next: 8 for two rows, otherwise 16.
        stride: u32,
    },
    /// A fixed-size array of any of the others.
    Array {
        /// Type of each element; never an array.
        element: Box<UniformType>,
        /// Number of elements.
        count: u32,
        /// Bytes from one element to the next.
        stride: u32,
    },
}

impl UniformType {
    /// Bytes from the first byte of the value to behind its last one; padding
    /// after the last column or element counts only where WGSL counts it.
    #[must_use]
    pub fn size(&self) -> u32 {
        match *self {
            Self::Scalar(_) => 4,
            Self::Vector { size, .. } => 4 * size,
            Self::Matrix {
                columns, stride, ..
            } => columns * stride,
            Self::Array { count, stride, .. } => count.saturating_mul(stride),
        }
    }
}

impl fmt::Display for UniformType {
    /// The WGSL spelling, e.g. `vec3<f32>`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Scalar(scalar) => write!(f, "{scalar}"),
            Self::Vector { scalar, size } => write!(f, "vec{size}<{scalar}>"),
            Self::Matrix { columns, rows, .. } => write!(f, "mat{columns}x{rows}<f32>"),
            Self::Array { element, count, .. } => write!(f, "array<{element}, {count}>"),
        }
    }
}
