//! Images, textures and materials: glTF 2.0, sections 3.8 and 3.9.

use std::borrow::Cow;
use std::io::Cursor;
use std::panic::{AssertUnwindSafe, catch_unwind};

use ::gltf::json::Value;
use ::gltf::json::deserialize::from_value;
use ::gltf::json::extensions::texture::TextureTransform;
use ::gltf::json::material::AlphaMode as Mode;
use ::gltf::json::texture::{Info, MagFilter, MinFilter, Sampler as JsonSampler, WrappingMode};
use ::gltf::json::validation::Checked;
use image::{DynamicImage, ImageDecoder, ImageError, ImageFormat, ImageReader, Limits};

use super::{Budget, Fetch, GltfError, Reader, get, named, uri};
use crate::model::material::{AlphaMode, Material, TextureUse, UvTransform, Volume};
use crate::model::parts::ModelParts;
use crate::model::texture::{Filter, Image, MAX_IMAGE_SIDE, Sampler, Texture, Wrap};

/// More texels than this for each byte of a file are a lie: deflate makes at
/// most 1032 bytes of one, and JPEG at least some bits for each 64 texels.
const TEXELS_PER_BYTE: u64 = 4096;

const TRANSFORM: &str = "KHR_texture_transform";

pub(super) fn images(
    reader: &mut Reader<'_>,
    fetch: Fetch<'_>,
    parts: &mut ModelParts,
) -> Result<(), GltfError> {
    let root = reader.root;
    for (i, image) in root.images.iter().enumerate() {
        let place = format!("image {i}");
        let wrong = |problem: String| GltfError::Image { image: i, problem };
        let bytes: Cow<'_, [u8]> = match (&image.uri, image.buffer_view) {
            (Some(uri), _) => Cow::Owned(match uri::data(uri, &place, &mut reader.budget) {
                Some(data) => data?,
                None => fetch(uri, &place, &mut reader.budget)?,
            }),
            (None, Some(view)) => Cow::Borrowed(reader.buffers.view(root, view).map_err(wrong)?),
            (None, None) => return Err(wrong("it has neither a URI nor a buffer view".into())),
        };
        let format = match image::guess_format(&bytes) {
            Ok(format @ (ImageFormat::Png | ImageFormat::Jpeg)) => format,
            _ => return Err(wrong("it is neither PNG nor JPEG".into())),
        };
        let (width, height, rgba) = decode(&bytes, format, &place, &mut reader.budget).map_err(
            |failure| match failure {
                Failure::TooLarge(error) => error,
                Failure::Image(problem) => wrong(problem),
            },
        )?;
        let name = named(image.name.as_ref().or(image.uri.as_ref()));
        let name = uri::shortened(&name);
        parts.images.push(Image::new(name, width, height, rgba)?);
    }
    Ok(())
}

enum Failure {
    TooLarge(GltfError),
    Image(String),
}

impl From<ImageError> for Failure {
    fn from(error: ImageError) -> Self {
        Self::Image(error.to_string())
    }
}

/// Width, height and RGBA8 of an image. The decoders' panics, if any are left,
/// become errors.
fn decode(
    bytes: &[u8],
    format: ImageFormat,
    place: &str,
    budget: &mut Budget,
) -> Result<(u32, u32, Vec<u8>), Failure> {
    catch_unwind(AssertUnwindSafe(|| {
        let mut decoder = ImageReader::with_format(Cursor::new(bytes), format).into_decoder()?;
        let (width, height) = decoder.dimensions();
        if width > MAX_IMAGE_SIDE || height > MAX_IMAGE_SIDE {
            return Err(Failure::Image(format!(
                "it is {width}×{height}; no side may be over {MAX_IMAGE_SIDE}"
            )));
        }
        let texels = u64::from(width) * u64::from(height);
        if texels > TEXELS_PER_BYTE * bytes.len() as u64 {
            return Err(Failure::Image(format!(
                "it promises {width}×{height} texels in {} bytes",
                bytes.len()
            )));
        }
        // As decoded, and as RGBA.
        let needed = decoder.total_bytes().saturating_add(4 * texels);
        budget.take(place, needed).map_err(Failure::TooLarge)?;
        let mut limits = Limits::default();
        // What decoders need beside the result are rows.
        limits.max_alloc = Some(needed.saturating_add(1 << 26));
        decoder.set_limits(limits)?;
        let decoded = DynamicImage::from_decoder(decoder)?;
        Ok((width, height, decoded.into_rgba8().into_raw()))
    }))
    .unwrap_or_else(|_| Err(Failure::Image("its decoder fails".into())))
}

pub(super) fn textures(reader: &Reader<'_>, parts: &mut ModelParts) -> Result<(), GltfError> {
    let root = reader.root;
    for (i, texture) in root.textures.iter().enumerate() {
        let what = || format!("the image of texture {i}");
        get(&root.images, texture.source, "image", what)?;
        let sampler = match texture.sampler {
            Some(index) => {
                let what = || format!("the sampler of texture {i}");
                let json = get(&root.samplers, index, "sampler", what)?;
                sampler(json).ok_or_else(|| {
                    GltfError::Malformed(format!(
                        "sampler {} has no valid filter or wrapping mode",
                        index.value()
                    ))
                })?
            }
            None => Sampler::default(),
        };
        parts.textures.push(Texture {
            image: texture.source.value(),
            sampler,
        });
    }
    Ok(())
}

/// Filters that a file leaves open are linear.
fn sampler(json: &JsonSampler) -> Option<Sampler> {
    let wrap = |mode: Checked<WrappingMode>| match mode {
        Checked::Valid(WrappingMode::ClampToEdge) => Some(Wrap::Clamp),
        Checked::Valid(WrappingMode::MirroredRepeat) => Some(Wrap::Mirror),
        Checked::Valid(WrappingMode::Repeat) => Some(Wrap::Repeat),
        Checked::Invalid => None,
    };
    let magnify = match json.mag_filter {
        Some(Checked::Valid(MagFilter::Nearest)) => Filter::Nearest,
        Some(Checked::Valid(MagFilter::Linear)) | None => Filter::Linear,
        Some(Checked::Invalid) => return None,
    };
    let (near, linear) = (Filter::Nearest, Filter::Linear);
    let (minify, mip) = match json.min_filter {
        Some(Checked::Valid(filter)) => match filter {
            MinFilter::Nearest => (near, None),
            MinFilter::Linear => (linear, None),
            MinFilter::NearestMipmapNearest => (near, Some(near)),
            MinFilter::LinearMipmapNearest => (linear, Some(near)),
            MinFilter::NearestMipmapLinear => (near, Some(linear)),
            MinFilter::LinearMipmapLinear => (linear, Some(linear)),
        },
        None => (linear, Some(linear)),
        Some(Checked::Invalid) => return None,
    };
    Some(Sampler {
        wrap_u: wrap(json.wrap_s)?,
        wrap_v: wrap(json.wrap_t)?,
        magnify,
        minify,
        mip,
    })
}

pub(super) fn materials(reader: &Reader<'_>, parts: &mut ModelParts) -> Result<(), GltfError> {
    for (i, json) in reader.root.materials.iter().enumerate() {
        let normal = json.normal_texture.as_ref();
        let occlusion = json.occlusion_texture.as_ref();
        let normal_texture = normal.map(|texture| {
            let others = texture.extensions.as_ref().map(|e| &e.others);
            let others = others.and_then(|others| others.get(TRANSFORM));
            let transform = transform(others, || format!("the normal texture of material {i}"))?;
            let index = texture.index.value();
            Ok::<_, GltfError>(texture_use(index, texture.tex_coord, transform.as_ref()))
        });
        let occlusion_texture = occlusion.map(|texture| {
            let others = texture.extensions.as_ref().map(|e| &e.others);
            let others = others.and_then(|others| others.get(TRANSFORM));
            let transform = transform(others, || format!("the occlusion texture of material {i}"))?;
            let index = texture.index.value();
            Ok::<_, GltfError>(texture_use(index, texture.tex_coord, transform.as_ref()))
        });
        let pbr = &json.pbr_metallic_roughness;
        let extensions = json.extensions.as_ref();
        let transmission = extensions.and_then(|extensions| extensions.transmission.as_ref());
        let volume = extensions.and_then(|extensions| extensions.volume.as_ref());
        let alpha = match json.alpha_mode {
            Checked::Valid(Mode::Opaque) => AlphaMode::Opaque,
            Checked::Valid(Mode::Mask) => AlphaMode::Mask {
                cutoff: json.alpha_cutoff.map_or(0.5, |cutoff| cutoff.0),
            },
            Checked::Valid(Mode::Blend) => AlphaMode::Blend,
            Checked::Invalid => {
                return Err(GltfError::Malformed(format!(
                    "material {i} has no valid alpha mode"
                )));
            }
        };
        parts.material(Material {
            name: named(json.name.as_ref()),
            base_colour: pbr.base_color_factor.0,
            base_colour_texture: pbr.base_color_texture.as_ref().map(texture),
            metallic: pbr.metallic_factor.0,
            roughness: pbr.roughness_factor.0,
            metallic_roughness_texture: pbr.metallic_roughness_texture.as_ref().map(texture),
            normal_texture: normal_texture.transpose()?,
            normal_scale: normal.map_or(1.0, |texture| texture.scale),
            occlusion_texture: occlusion_texture.transpose()?,
            occlusion_strength: occlusion.map_or(1.0, |texture| texture.strength.0),
            emissive: json.emissive_factor.0,
            emissive_texture: json.emissive_texture.as_ref().map(texture),
            emissive_strength: extensions
                .and_then(|extensions| extensions.emissive_strength.as_ref())
                .map_or(1.0, |strength| strength.emissive_strength.0),
            alpha,
            double_sided: json.double_sided,
            transmission: transmission.map_or(0.0, |t| t.transmission_factor.0),
            transmission_texture: transmission
                .and_then(|t| t.transmission_texture.as_ref())
                .map(texture),
            ior: extensions
                .and_then(|extensions| extensions.ior.as_ref())
                .map_or(1.5, |ior| ior.ior.0),
            volume: volume.map_or_else(Volume::default, |volume| Volume {
                thickness: volume.thickness_factor.0,
                thickness_texture: volume.thickness_texture.as_ref().map(texture),
                attenuation_distance: volume.attenuation_distance.0,
                attenuation_colour: volume.attenuation_color.0,
            }),
        });
    }
    Ok(())
}

/// The transform of a normal or occlusion texture, which the crate leaves as JSON.
fn transform(
    json: Option<&Value>,
    what: impl FnOnce() -> String,
) -> Result<Option<TextureTransform>, GltfError> {
    let Some(json) = json else {
        return Ok(None);
    };
    from_value(json.clone())
        .map(Some)
        .map_err(|error| GltfError::Malformed(format!("the transform of {}: {error}", what())))
}

fn texture(info: &Info) -> TextureUse {
    let extensions = info.extensions.as_ref();
    let transform = extensions.and_then(|extensions| extensions.texture_transform.as_ref());
    texture_use(info.index.value(), info.tex_coord, transform)
}

fn texture_use(texture: usize, set: u32, transform: Option<&TextureTransform>) -> TextureUse {
    let set = transform
        .and_then(|transform| transform.tex_coord)
        .unwrap_or(set);
    TextureUse {
        texture,
        // What does not fit is refused as the set that it becomes.
        set: u8::try_from(set).unwrap_or(u8::MAX),
        transform: transform.map_or_else(UvTransform::default, |transform| UvTransform {
            offset: transform.offset.0,
            rotation: transform.rotation.0,
            scale: transform.scale.0,
        }),
    }
}
