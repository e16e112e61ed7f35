//! Numbers in buffers: glTF 2.0, section 3.6.

use std::borrow::Cow;

use ::gltf::json::accessor::{ComponentType, IndexComponentType, Type};
use ::gltf::json::buffer::View;
use ::gltf::json::validation::Checked;
use ::gltf::json::{Accessor, Index, Root};

use super::{Budget, Fetch, GltfError, Reader, get, uri};

/// The contents of all buffers.
pub(super) struct Buffers<'a>(Vec<Cow<'a, [u8]>>);

impl<'a> Buffers<'a> {
    pub(super) fn load(
        root: &Root,
        binary: Option<&'a [u8]>,
        fetch: Fetch<'_>,
        budget: &mut Budget,
    ) -> Result<Self, GltfError> {
        let mut buffers = Vec::new();
        for (i, buffer) in root.buffers.iter().enumerate() {
            let place = format!("buffer {i}");
            let bytes: Cow<'a, [u8]> = match (&buffer.uri, binary) {
                (Some(uri), _) => Cow::Owned(match uri::data(uri, &place, budget) {
                    Some(data) => data?,
                    None => fetch(uri, &place, budget)?,
                }),
                (None, Some(binary)) if i == 0 => Cow::Borrowed(binary),
                (None, _) => {
                    return Err(GltfError::Malformed(format!(
                        "{place} has neither a URI nor a binary chunk"
                    )));
                }
            };
            if (bytes.len() as u64) < buffer.byte_length.0 {
                return Err(GltfError::Malformed(format!(
                    "{place} says {} bytes, but there are {}",
                    buffer.byte_length.0,
                    bytes.len()
                )));
            }
            buffers.push(bytes);
        }
        Ok(Self(buffers))
    }

    /// The bytes of a view.
    pub(super) fn view(&self, root: &Root, index: Index<View>) -> Result<&[u8], String> {
        let view = (root.buffer_views.get(index.value())).ok_or_else(|| {
            format!(
                "it refers to buffer view {}, but the file has {}",
                index.value(),
                root.buffer_views.len()
            )
        })?;
        let buffer = (self.0.get(view.buffer.value())).ok_or_else(|| {
            format!(
                "buffer view {} refers to buffer {}, but the file has {}",
                index.value(),
                view.buffer.value(),
                self.0.len()
            )
        })?;
        let offset = view.byte_offset.map_or(0, |offset| offset.0);
        range(buffer, offset, view.byte_length.0).ok_or_else(|| {
            format!(
                "buffer view {} is {} bytes from {offset}, but buffer {} has {}",
                index.value(),
                view.byte_length.0,
                view.buffer.value(),
                buffer.len()
            )
        })
    }
}

fn range(bytes: &[u8], offset: u64, length: u64) -> Option<&[u8]> {
    let start = usize::try_from(offset).ok()?;
    let end = start.checked_add(usize::try_from(length).ok()?)?;
    bytes.get(start..end)
}

/// What an accessor may be for some use.
#[derive(Clone, Copy)]
pub(super) enum Allowed {
    /// Floats only.
    Float,
    /// Floats, or integers that stand for `[0, 1]` or `[−1, 1]`.
    FloatOrNormalized,
    /// Unsigned integers as they are.
    Unsigned,
}

/// Where an accessor's elements lie, checked against the buffer.
struct Layout<'b> {
    /// From the first element on; `None` for zeros.
    bytes: Option<&'b [u8]>,
    stride: usize,
    count: usize,
    component: ComponentType,
    normalized: bool,
}

impl Reader<'_> {
    /// The elements of an accessor, `N` components each, as f32.
    pub(super) fn floats<const N: usize>(
        &mut self,
        index: Index<Accessor>,
        what: &str,
        allowed: Allowed,
    ) -> Result<Vec<[f32; N]>, GltfError> {
        self.read(index, what, allowed, float)
    }

    /// The elements of an accessor of unsigned integers.
    pub(super) fn integers<const N: usize>(
        &mut self,
        index: Index<Accessor>,
        what: &str,
    ) -> Result<Vec<[u32; N]>, GltfError> {
        self.read(
            index,
            what,
            Allowed::Unsigned,
            |component, bytes, _| match component {
                ComponentType::U8 => u32::from(bytes[0]),
                ComponentType::U16 => u32::from(u16::from_le_bytes([bytes[0], bytes[1]])),
                _ => u32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]),
            },
        )
    }

    fn read<T: Copy + Default, const N: usize>(
        &mut self,
        index: Index<Accessor>,
        what: &str,
        allowed: Allowed,
        decode: impl Fn(ComponentType, &[u8], bool) -> T,
    ) -> Result<Vec<[T; N]>, GltfError> {
        let root = self.root;
        let accessor = get(&root.accessors, index, "accessor", || what.into())?;
        let wrong = |problem: String| GltfError::Accessor {
            accessor: index.value(),
            what: what.into(),
            problem,
        };
        let bytes = accessor.count.0.saturating_mul((N * size_of::<T>()) as u64);
        let layout = layout::<N>(&self.buffers, root, accessor, allowed).map_err(wrong)?;
        self.budget
            .take(format!("accessor {}, {what},", index.value()), bytes)?;
        let size = layout.component.size();
        let element = |bytes: &[u8]| {
            std::array::from_fn(|i| {
                decode(
                    layout.component,
                    &bytes[i * size..][..size],
                    layout.normalized,
                )
            })
        };
        let mut values = vec![[T::default(); N]; layout.count];
        if let Some(bytes) = layout.bytes {
            for (value, bytes) in values.iter_mut().zip(bytes.chunks(layout.stride)) {
                *value = element(bytes);
            }
        }
        if let Some(sparse) = &accessor.sparse {
            let indices = (&sparse.indices.component_type, sparse.indices.buffer_view);
            let places = sparse_indices(
                &self.buffers,
                root,
                indices,
                sparse.indices.byte_offset.0,
                sparse.count.0,
            )
            .map_err(wrong)?;
            let view = self
                .buffers
                .view(root, sparse.values.buffer_view)
                .map_err(wrong)?;
            let length = sparse.count.0.saturating_mul((N * size) as u64);
            let bytes = range(view, sparse.values.byte_offset.0, length)
                .ok_or_else(|| wrong("its sparse values are outside of their view".into()))?;
            for (place, bytes) in places.zip(bytes.chunks(N * size)) {
                let count = values.len();
                let value = values.get_mut(place).ok_or_else(|| {
                    wrong(format!(
                        "it replaces element {place}, but there are {count}"
                    ))
                })?;
                *value = element(bytes);
            }
        }
        Ok(values)
    }
}

fn layout<'b, const N: usize>(
    buffers: &'b Buffers<'_>,
    root: &Root,
    accessor: &Accessor,
    allowed: Allowed,
) -> Result<Layout<'b>, String> {
    let Checked::Valid(component) = accessor.component_type else {
        return Err("its component type is none".into());
    };
    let component = component.0;
    let Checked::Valid(kind) = accessor.type_ else {
        return Err("its type is none".into());
    };
    let components = match kind {
        Type::Scalar => 1,
        Type::Vec2 => 2,
        Type::Vec3 => 3,
        Type::Vec4 | Type::Mat2 => 4,
        Type::Mat3 => 9,
        Type::Mat4 => 16,
    };
    if components != N || kind == Type::Mat2 {
        return Err(format!("its type is {kind:?}; it must have {N} components"));
    }
    let unsigned = matches!(
        component,
        ComponentType::U8 | ComponentType::U16 | ComponentType::U32
    );
    let (right, need) = match allowed {
        Allowed::Float => (component == ComponentType::F32, "floats"),
        Allowed::FloatOrNormalized => (
            component == ComponentType::F32
                || (accessor.normalized && component != ComponentType::U32),
            "floats or normalized integers",
        ),
        Allowed::Unsigned => (unsigned, "unsigned integers"),
    };
    if !right {
        return Err(format!(
            "its components are {component:?}; they must be {need}"
        ));
    }
    let count = usize::try_from(accessor.count.0)
        .ok()
        .filter(|&count| count > 0)
        .ok_or_else(|| format!("it has {} elements; there must be some", accessor.count.0))?;
    let size = N * component.size();
    let mut layout = Layout {
        bytes: None,
        stride: size,
        count,
        component,
        normalized: accessor.normalized,
    };
    let Some(index) = accessor.buffer_view else {
        return Ok(layout);
    };
    let view = buffers.view(root, index)?;
    let stride = root.buffer_views[index.value()].byte_stride;
    layout.stride = stride.map_or(size, |stride| stride.0);
    if layout.stride < size {
        return Err(format!(
            "its elements take {size} bytes, but buffer view {} has a stride of {}",
            index.value(),
            layout.stride
        ));
    }
    let offset = accessor.byte_offset.map_or(0, |offset| offset.0);
    let length = (layout.stride as u64)
        .checked_mul(count as u64 - 1)
        .and_then(|length| length.checked_add(size as u64));
    let bytes = length.and_then(|length| range(view, offset, length));
    layout.bytes = Some(bytes.ok_or_else(|| {
        format!(
            "{count} elements at a stride of {} from byte {offset} on do not fit into the {} bytes of buffer view {}",
            layout.stride,
            view.len(),
            index.value()
        )
    })?);
    Ok(layout)
}

fn sparse_indices<'b>(
    buffers: &'b Buffers<'_>,
    root: &Root,
    (component, view): (&Checked<IndexComponentType>, Index<View>),
    offset: u64,
    count: u64,
) -> Result<impl Iterator<Item = usize> + 'b, String> {
    let Checked::Valid(IndexComponentType(component)) = *component else {
        return Err("the component type of its sparse indices is none".into());
    };
    let size = component.size();
    let bytes = range(
        buffers.view(root, view)?,
        offset,
        count.saturating_mul(size as u64),
    )
    .ok_or("its sparse indices are outside of their view")?;
    let index = |bytes: &[u8]| {
        (bytes.iter().rev()).fold(0_usize, |value, &byte| value << 8 | usize::from(byte))
    };
    Ok(bytes.chunks(size).map(index))
}

/// Section 3.6.2.2 for integers that stand for fractions.
fn float(component: ComponentType, bytes: &[u8], normalized: bool) -> f32 {
    let scale = |x: f32, most: f32| if normalized { (x / most).max(-1.0) } else { x };
    match component {
        ComponentType::I8 => scale(f32::from(bytes[0].cast_signed()), 127.0),
        ComponentType::U8 => scale(f32::from(bytes[0]), 255.0),
        ComponentType::I16 => scale(
            f32::from(i16::from_le_bytes([bytes[0], bytes[1]])),
            32_767.0,
        ),
        ComponentType::U16 => scale(
            f32::from(u16::from_le_bytes([bytes[0], bytes[1]])),
            65_535.0,
        ),
        ComponentType::U32 => u32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]) as f32,
        ComponentType::F32 => f32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]),
    }
}
