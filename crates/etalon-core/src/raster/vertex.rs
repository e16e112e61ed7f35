//! What vertex kernels are fed: numbers from buffers, by vertex or by instance.

use std::borrow::Cow;

use serde::{Deserialize, Serialize};
use thiserror::Error;

/// What the numbers of an attribute are in a kernel.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum NumberKind {
    /// `f32`.
    Float,
    /// `u32`.
    Uint,
    /// `i32`.
    Sint,
}

macro_rules! vertex_formats {
    ($($(#[$doc:meta])* $variant:ident, $components:literal, $bytes:literal, $kind:ident;)*) => {
        /// How the numbers of an attribute are stored.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
        #[non_exhaustive]
        pub enum VertexFormat {
            $($(#[$doc])* $variant,)*
        }

        impl VertexFormat {
            /// Every format.
            pub const ALL: &'static [Self] = &[$(Self::$variant,)*];

            /// How many numbers there are, 1 to 4. A kernel may take fewer, or
            /// more: those that are not there are 0, 0, 1.
            #[must_use]
            pub const fn components(self) -> u32 {
                match self { $(Self::$variant => $components,)* }
            }

            /// Bytes of all of them.
            #[must_use]
            pub const fn bytes(self) -> u32 {
                match self { $(Self::$variant => $bytes,)* }
            }

            /// What they are in a kernel.
            #[must_use]
            pub const fn kind(self) -> NumberKind {
                match self { $(Self::$variant => NumberKind::$kind,)* }
            }
        }
    };
}

vertex_formats! {
    /// One binary32.
    Float32, 1, 4, Float;
    /// Two binary32.
    Float32x2, 2, 8, Float;
    /// Three binary32.
    Float32x3, 3, 12, Float;
    /// Four binary32.
    Float32x4, 4, 16, Float;
    /// Two binary16.
    Float16x2, 2, 4, Float;
    /// Four binary16.
    Float16x4, 4, 8, Float;
    /// Two bytes, `k / 255`.
    Unorm8x2, 2, 2, Float;
    /// Four bytes, `k / 255`.
    Unorm8x4, 4, 4, Float;
    /// Four bytes, `max(k / 127, −1)`.
    Snorm8x4, 4, 4, Float;
    /// Two 16-bit integers, `k / 65535`.
    Unorm16x2, 2, 4, Float;
    /// Four 16-bit integers, `k / 65535`.
    Unorm16x4, 4, 8, Float;
    /// Two 16-bit integers, `max(k / 32767, −1)`.
    Snorm16x2, 2, 4, Float;
    /// Four 16-bit integers, `max(k / 32767, −1)`.
    Snorm16x4, 4, 8, Float;
    /// Four bytes.
    Uint8x4, 4, 4, Uint;
    /// Two 16-bit integers.
    Uint16x2, 2, 4, Uint;
    /// Four 16-bit integers.
    Uint16x4, 4, 8, Uint;
    /// One 32-bit integer.
    Uint32, 1, 4, Uint;
    /// Two 32-bit integers.
    Uint32x2, 2, 8, Uint;
    /// Four 32-bit integers.
    Uint32x4, 4, 16, Uint;
    /// One signed 32-bit integer.
    Sint32, 1, 4, Sint;
    /// Four signed 32-bit integers.
    Sint32x4, 4, 16, Sint;
}

/// When a vertex kernel is fed the next element of a buffer.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum StepMode {
    /// For each vertex.
    #[default]
    Vertex,
    /// For each instance.
    Instance,
}

/// Numbers for one of a vertex kernel's inputs.
#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub struct VertexAttribute {
    /// The name of the kernel's input.
    pub name: Cow<'static, str>,
    /// How the numbers are stored.
    pub format: VertexFormat,
    /// Bytes from the beginning of an element: a multiple of 4, or of the
    /// format's bytes if those are fewer.
    pub offset: u32,
}

/// The elements of a vertex buffer.
#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub struct VertexLayout {
    /// Bytes from one element to the next: a multiple of 4, at most
    /// [`VertexLayout::MAX_STRIDE`].
    pub stride: u32,
    /// When the next one is taken.
    pub step: StepMode,
    /// What an element holds.
    pub attributes: Vec<VertexAttribute>,
}

/// Why a vertex layout is refused.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum VertexLayoutError {
    /// Elements that devices cannot step through.
    #[error("a stride of {stride} bytes; it must be a multiple of 4 from 4 to {most}")]
    Stride {
        /// As given.
        stride: u32,
        /// The largest that is possible.
        most: u32,
    },
    /// An attribute that is not aligned.
    #[error("`{name}` is {offset} bytes into its element; that must be a multiple of {alignment}")]
    Alignment {
        /// The attribute's name.
        name: String,
        /// As given.
        offset: u32,
        /// What it must be a multiple of.
        alignment: u32,
    },
    /// An attribute that reaches out of its element.
    #[error("`{name}` ends {end} bytes into its element, which has {stride}")]
    OutOfElement {
        /// The attribute's name.
        name: String,
        /// Where it ends.
        end: u64,
        /// Bytes of an element.
        stride: u32,
    },
}

impl VertexLayout {
    /// The largest stride that every device has.
    pub const MAX_STRIDE: u32 = 2048;

    /// One attribute alone, packed.
    #[must_use]
    pub fn packed(name: impl Into<Cow<'static, str>>, format: VertexFormat) -> Self {
        Self {
            stride: format.bytes().next_multiple_of(4),
            step: StepMode::Vertex,
            attributes: vec![VertexAttribute {
                name: name.into(),
                format,
                offset: 0,
            }],
        }
    }

    /// Checks stride, alignment and extent of every attribute.
    ///
    /// # Errors
    /// At the first that devices cannot read.
    pub fn validate(&self) -> Result<(), VertexLayoutError> {
        let stride = self.stride;
        if stride == 0 || !stride.is_multiple_of(4) || stride > Self::MAX_STRIDE {
            return Err(VertexLayoutError::Stride {
                stride,
                most: Self::MAX_STRIDE,
            });
        }
        for VertexAttribute {
            name,
            format,
            offset,
        } in &self.attributes
        {
            let alignment = format.bytes().min(4);
            if !offset.is_multiple_of(alignment) {
                return Err(VertexLayoutError::Alignment {
                    name: name.to_string(),
                    offset: *offset,
                    alignment,
                });
            }
            let end = u64::from(*offset) + u64::from(format.bytes());
            if end > u64::from(stride) {
                return Err(VertexLayoutError::OutOfElement {
                    name: name.to_string(),
                    end,
                    stride,
                });
            }
        }
        Ok(())
    }
}

/// How indices of vertices are stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum IndexFormat {
    /// 16 bits each.
    Uint16,
    /// 32 bits each.
    Uint32,
}

impl IndexFormat {
    /// Bytes of an index.
    #[must_use]
    pub const fn bytes(self) -> u32 {
        match self {
            Self::Uint16 => 2,
            Self::Uint32 => 4,
        }
    }

    /// The index that begins a new strip.
    #[must_use]
    pub const fn restart(self) -> u32 {
        match self {
            Self::Uint16 => 0xffff,
            Self::Uint32 => u32::MAX,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn layout(stride: u32, format: VertexFormat, offset: u32) -> VertexLayout {
        VertexLayout {
            stride,
            step: StepMode::Vertex,
            attributes: vec![VertexAttribute {
                name: "position".into(),
                format,
                offset,
            }],
        }
    }

    #[test]
    fn every_format_packed_is_valid() {
        for &format in VertexFormat::ALL {
            assert_eq!(VertexLayout::packed("a", format).validate(), Ok(()));
            assert!(format.bytes() >= format.components());
        }
    }

    #[test]
    fn what_devices_cannot_read_is_refused() {
        use VertexFormat::{Float32x3, Unorm8x2};
        assert_eq!(layout(12, Float32x3, 0).validate(), Ok(()));
        assert_eq!(layout(16, Unorm8x2, 14).validate(), Ok(()));
        for stride in [0, 2, 13, VertexLayout::MAX_STRIDE + 4, u32::MAX] {
            let refused = layout(stride, Float32x3, 0).validate();
            assert!(matches!(refused, Err(VertexLayoutError::Stride { .. })));
        }
        for (format, offset) in [(Float32x3, 2), (Unorm8x2, 1)] {
            let refused = layout(64, format, offset).validate();
            assert!(matches!(refused, Err(VertexLayoutError::Alignment { .. })));
        }
        for offset in [4, u32::MAX - 3] {
            let refused = layout(12, Float32x3, offset).validate();
            assert!(matches!(
                refused,
                Err(VertexLayoutError::OutOfElement { .. })
            ));
        }
    }
}
