//! Models from glTF 2.0 files.
//!
//! [`load_gltf`] reads `.gltf` with its buffers and images, and `.glb`;
//! [`decode_gltf`] reads bytes. What becomes of what:
//!
//! | glTF | becomes |
//! |---|---|
//! | primitive (triangles, strips, fans) | a [`Mesh`](super::Mesh); missing normals by [`flat_normals`](super::flat_normals), missing tangents by [`tangents`](super::tangents) |
//! | material | a [`Material`](super::Material), with `KHR_materials_emissive_strength`, `_ior`, `_transmission`, `_volume`, `KHR_texture_transform` |
//! | image (PNG, JPEG) | an [`Image`](super::Image) of RGBA8; 16-bit ones lose their lower bits |
//! | node, `KHR_lights_punctual` | a [`Node`](super::Node) of the same index, with a [`Light`](super::Light) |
//! | perspective camera at a node | a [`Viewpoint`](super::Viewpoint); the far plane is left out |
//! | skin, animation | [`Skin`](super::Skin), [`Animation`](super::Animation) |
//!
//! Nodes outside of the file's scene stay, as joints may refer to them, but
//! nothing is drawn there. Morph targets, orthographic cameras, sets of texture
//! coordinates after the second and optional extensions not named above are
//! left out; points, lines and more than four joints a vertex are refused.
//!
//! Normals and tangents are made of unit length; normals of length 0 become the
//! mean of the triangles around. Weights are scaled to the sum 1.
//!
//! # Untrusted files
//! Everything in a file is checked before it is used: ranges against buffers,
//! indices against lists, and sizes, together, against
//! [`GltfOptions::max_bytes`] before memory is asked for. Images may not promise
//! more texels than their bytes can hold. Files that a file refers to have to be
//! within its folder.

mod accessor;
mod container;
mod geometry;
mod hierarchy;
mod movement;
mod surface;
mod uri;

use std::path::Path;

use ::gltf::json::{Index, Root};
use thiserror::Error;

use super::error::ModelError;
use super::parts::{Model, ModelParts};
use accessor::Buffers;

/// Why a file is not a model.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum GltfError {
    /// The file system says no.
    #[error("{path}: {source}")]
    Io {
        /// Which file.
        path: String,
        /// What went wrong.
        source: std::io::Error,
    },
    /// The file is no glTF file, ends too early or contradicts itself.
    #[error("not a valid glTF file: {0}")]
    Malformed(String),
    /// The file uses something that is not supported.
    #[error("unsupported glTF file: {0}")]
    Unsupported(String),
    /// The file's contents take more memory than allowed.
    #[error(
        "{what} takes {bytes} bytes; with what was read before it is over the limit of {limit}"
    )]
    TooLarge {
        /// What it is.
        what: String,
        /// As the file says.
        bytes: u64,
        /// [`GltfOptions::max_bytes`].
        limit: u64,
    },
    /// A URI leads nowhere that may be read.
    #[error("the URI of {place}, {uri:?}, is not possible: it must be {need}")]
    Uri {
        /// Which buffer or image.
        place: String,
        /// As given, shortened.
        uri: String,
        /// What would be right.
        need: &'static str,
    },
    /// Something refers to what is not there.
    #[error("{what} is {target} {index}, but the file has {count}")]
    Index {
        /// What refers, and where it is.
        what: String,
        /// What is referred to.
        target: &'static str,
        /// As given.
        index: usize,
        /// How many there are; indices are below.
        count: usize,
    },
    /// An accessor, with its view and buffer, contradicts itself or its use.
    #[error("accessor {accessor}, {what}: {problem}")]
    Accessor {
        /// Which one.
        accessor: usize,
        /// What it is used for.
        what: String,
        /// What is wrong with it, and what would be right.
        problem: String,
    },
    /// An image cannot be decoded.
    #[error("image {image}: {problem}")]
    Image {
        /// Which one.
        image: usize,
        /// What is wrong with it.
        problem: String,
    },
    /// What the file describes is no possible model.
    #[error(transparent)]
    Model(#[from] Box<ModelError>),
}

impl From<ModelError> for GltfError {
    fn from(error: ModelError) -> Self {
        Self::Model(Box::new(error))
    }
}

/// How to read a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct GltfOptions {
    /// Most bytes that everything read and decoded may take together, roughly.
    pub max_bytes: u64,
}

impl Default for GltfOptions {
    /// 1 GiB.
    fn default() -> Self {
        Self { max_bytes: 1 << 30 }
    }
}

/// Reads a `.gltf` or `.glb` file with what it refers to.
///
/// # Errors
/// If a file cannot be read or is outside of the folder, the contents are
/// broken, too large or not supported, or what they describe is no model.
pub fn load_gltf(path: &Path, options: &GltfOptions) -> Result<Model, GltfError> {
    let mut budget = Budget::new(options);
    let bytes = uri::read_file(path, &path.display().to_string(), &mut budget)?;
    let folder = path.parent().unwrap_or(Path::new(""));
    decode(&bytes, budget, &|uri, place, budget| {
        uri::read_beside(folder, uri, place, budget)
    })
}

/// Reads the bytes of a `.gltf` or `.glb` file that refers to no other file.
///
/// # Errors
/// As [`load_gltf`]; a URI that is not of data is an error.
pub fn decode_gltf(bytes: &[u8], options: &GltfOptions) -> Result<Model, GltfError> {
    decode(bytes, Budget::new(options), &|uri, place, _| {
        Err(GltfError::Uri {
            place: place.into(),
            uri: uri::shortened(uri),
            need: "of data, for there is no folder",
        })
    })
}

/// Reads what a URI that is not of data refers to.
type Fetch<'f> = &'f dyn Fn(&str, &str, &mut Budget) -> Result<Vec<u8>, GltfError>;

fn decode(bytes: &[u8], mut budget: Budget, fetch: Fetch<'_>) -> Result<Model, GltfError> {
    let (json, binary) = container::split(bytes)?;
    let root: Root = gltf::json::deserialize::from_slice(json)
        .map_err(|error| GltfError::Malformed(error.to_string()))?;
    check_version(&root)?;
    let buffers = Buffers::load(&root, binary, fetch, &mut budget)?;
    let mut reader = Reader {
        root: &root,
        buffers,
        budget,
    };
    let mut parts = ModelParts::default();
    surface::images(&mut reader, fetch, &mut parts)?;
    surface::textures(&reader, &mut parts)?;
    surface::materials(&reader, &mut parts)?;
    let meshes = geometry::meshes(&mut reader, &mut parts)?;
    hierarchy::lights(&reader, &mut parts)?;
    hierarchy::nodes(&mut reader, &meshes, &mut parts)?;
    movement::skins(&mut reader, &mut parts)?;
    movement::animations(&mut reader, &mut parts)?;
    Ok(Model::new(parts)?)
}

/// Extensions that a file may require.
const EXTENSIONS: [&str; 6] = [
    "KHR_lights_punctual",
    "KHR_materials_emissive_strength",
    "KHR_materials_ior",
    "KHR_materials_transmission",
    "KHR_materials_volume",
    "KHR_texture_transform",
];

fn check_version(root: &Root) -> Result<(), GltfError> {
    let least = root
        .asset
        .min_version
        .as_ref()
        .unwrap_or(&root.asset.version);
    if root.asset.version.split('.').next() != Some("2") || least.as_str() > "2.0" {
        return Err(GltfError::Unsupported(format!(
            "version {least}; it must be 2.0"
        )));
    }
    let mut required = root.extensions_required.iter();
    match required.find(|name| !EXTENSIONS.contains(&name.as_str())) {
        Some(name) => Err(GltfError::Unsupported(format!(
            "it requires the extension {name}; known are {}",
            EXTENSIONS.join(", ")
        ))),
        None => Ok(()),
    }
}

/// A file while it is read.
struct Reader<'a> {
    root: &'a Root,
    buffers: Buffers<'a>,
    budget: Budget,
}

/// Counts what is decoded.
struct Budget {
    left: u64,
    limit: u64,
}

impl Budget {
    const fn new(options: &GltfOptions) -> Self {
        Self {
            left: options.max_bytes,
            limit: options.max_bytes,
        }
    }

    /// Has to be asked before memory is.
    fn take(&mut self, what: impl Into<String>, bytes: u64) -> Result<(), GltfError> {
        match self.left.checked_sub(bytes) {
            Some(left) => {
                self.left = left;
                Ok(())
            }
            None => Err(GltfError::TooLarge {
                what: what.into(),
                bytes,
                limit: self.limit,
            }),
        }
    }
}

/// The element that an index refers to.
fn get<'l, T>(
    list: &'l [T],
    index: Index<T>,
    target: &'static str,
    what: impl FnOnce() -> String,
) -> Result<&'l T, GltfError> {
    list.get(index.value()).ok_or_else(|| GltfError::Index {
        what: what(),
        target,
        index: index.value(),
        count: list.len(),
    })
}

/// A name that may be missing.
fn named(name: Option<&String>) -> String {
    name.cloned().unwrap_or_default()
}
