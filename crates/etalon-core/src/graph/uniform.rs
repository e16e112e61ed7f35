//! Values of uniform block members, given by name.

use glam::{IVec2, IVec4, Mat3, Mat4, UVec2, UVec4, Vec2, Vec3, Vec4};

use crate::kernel::{UniformScalar, UniformType};

/// A value for one member of a kernel's uniform block.
///
/// Members are matched by name and type against the kernel's reflection, so
/// neither the order of members nor their padding concerns the caller.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum UniformValue {
    /// `f32`
    F32(f32),
    /// `i32`
    I32(i32),
    /// `u32`
    U32(u32),
    /// `vec2<f32>`
    Vec2(Vec2),
    /// `vec3<f32>`
    Vec3(Vec3),
    /// `vec4<f32>`
    Vec4(Vec4),
    /// `vec2<i32>`
    IVec2(IVec2),
    /// `vec4<i32>`
    IVec4(IVec4),
    /// `vec2<u32>`
    UVec2(UVec2),
    /// `vec4<u32>`
    UVec4(UVec4),
    /// `mat3x3<f32>`
    Mat3(Mat3),
    /// `mat4x4<f32>`
    Mat4(Mat4),
}

impl UniformValue {
    /// The WGSL type this value fits.
    #[must_use]
    pub const fn wgsl_type(&self) -> &'static str {
        match self {
            Self::F32(_) => "f32",
            Self::I32(_) => "i32",
            Self::U32(_) => "u32",
            Self::Vec2(_) => "vec2<f32>",
            Self::Vec3(_) => "vec3<f32>",
            Self::Vec4(_) => "vec4<f32>",
            Self::IVec2(_) => "vec2<i32>",
            Self::IVec4(_) => "vec4<i32>",
            Self::UVec2(_) => "vec2<u32>",
            Self::UVec4(_) => "vec4<u32>",
            Self::Mat3(_) => "mat3x3<f32>",
            Self::Mat4(_) => "mat4x4<f32>",
        }
    }

    /// Whether the value has the type of a member.
    pub(crate) fn fits(&self, ty: &UniformType) -> bool {
        use UniformScalar::{F32, I32, U32};
        matches!(
            (self, ty),
            (Self::F32(_), UniformType::Scalar(F32))
                | (Self::I32(_), UniformType::Scalar(I32))
                | (Self::U32(_), UniformType::Scalar(U32))
                | (
                    Self::Vec2(_),
                    UniformType::Vector {
                        scalar: F32,
                        size: 2,
                    },
                )
                | (
                    Self::Vec3(_),
                    UniformType::Vector {
                        scalar: F32,
                        size: 3,
                    },
                )
                | (
                    Self::Vec4(_),
                    UniformType::Vector {
                        scalar: F32,
                        size: 4,
                    },
                )
                | (
                    Self::IVec2(_),
                    UniformType::Vector {
                        scalar: I32,
                        size: 2,
                    },
                )
                | (
                    Self::IVec4(_),
                    UniformType::Vector {
                        scalar: I32,
                        size: 4,
                    },
                )
                | (
                    Self::UVec2(_),
                    UniformType::Vector {
                        scalar: U32,
                        size: 2,
                    },
                )
                | (
                    Self::UVec4(_),
                    UniformType::Vector {
                        scalar: U32,
                        size: 4,
                    },
                )
                | (
                    Self::Mat3(_),
                    UniformType::Matrix {
                        columns: 3,
                        rows: 3,
                        ..
                    },
                )
                | (
                    Self::Mat4(_),
                    UniformType::Matrix {
                        columns: 4,
                        rows: 4,
                        ..
                    },
                )
        )
    }

    /// Writes the value's bytes as WGSL lays them out (WGSL §14.4.1: columns of
    /// a three-row matrix are 16 bytes apart), at most 64, and returns how many.
    pub(crate) fn write(&self, out: &mut [u8; 64]) -> usize {
        fn put<T: bytemuck::Pod>(out: &mut [u8; 64], values: &[T]) -> usize {
            let bytes: &[u8] = bytemuck::cast_slice(values);
            out[..bytes.len()].copy_from_slice(bytes);
            bytes.len()
        }
        match self {
            Self::F32(v) => put(out, &[*v]),
            Self::I32(v) => put(out, &[*v]),
            Self::U32(v) => put(out, &[*v]),
            Self::Vec2(v) => put(out, &v.to_array()),
            Self::Vec3(v) => put(out, &v.to_array()),
            Self::Vec4(v) => put(out, &v.to_array()),
            Self::IVec2(v) => put(out, &v.to_array()),
            Self::IVec4(v) => put(out, &v.to_array()),
            Self::UVec2(v) => put(out, &v.to_array()),
            Self::UVec4(v) => put(out, &v.to_array()),
            Self::Mat3(v) => {
                let [x, y, z] = v.to_cols_array_2d();
                put(
                    out,
                    &[
                        [x[0], x[1], x[2], 0.0],
                        [y[0], y[1], y[2], 0.0],
                        [z[0], z[1], z[2], 0.0],
                    ],
                )
            }
            Self::Mat4(v) => put(out, &v.to_cols_array()),
        }
    }
}

macro_rules! from {
    ($($type:ty => $variant:ident),*) => {
        $(impl From<$type> for UniformValue {
            fn from(value: $type) -> Self {
                Self::$variant(value)
            }
        })*
    };
}

from!(f32 => F32, i32 => I32, u32 => U32, Vec2 => Vec2, Vec3 => Vec3, Vec4 => Vec4, IVec2 => IVec2,
      IVec4 => IVec4, UVec2 => UVec2, UVec4 => UVec4, Mat3 => Mat3, Mat4 => Mat4);

impl From<bool> for UniformValue {
    /// WGSL has no host-shareable `bool`; kernels use `u32`.
    fn from(value: bool) -> Self {
        Self::U32(value.into())
    }
}
