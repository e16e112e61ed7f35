//! What is drawn: triangles, where they are, and what they are made of.

use std::ops::Range;

use etalon_core::graph::{Buffer, Draw, Texture};
use etalon_core::raster::{IndexFormat, VertexLayout};
use etalon_core::resource::SamplerDesc;
use glam::{DMat4, Vec3, Vec4};

use crate::SettingError;
use crate::check::Settings;

/// When in a frame something is drawn.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum DrawClass {
    /// First: held by the viewer, near the camera and over much of the picture.
    Weapon,
    /// Then what stands still, so that its velocity is that of the camera.
    #[default]
    Static,
    /// Last what moves, with a velocity of its own.
    Dynamic,
}

/// Textures that a surface's numbers are multiplied by, by texture coordinates
/// `uv`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Maps {
    /// rgb: colour, in a format that gives linear values; a: opacity.
    pub base: Option<Texture>,
    /// g: roughness; b: metalness.
    pub surface: Option<Texture>,
    /// Normals in tangent space, `2 rgb − 1`; asks for tangents.
    pub normal: Option<Texture>,
    /// rgb: emission, in a format that gives linear values.
    pub emission: Option<Texture>,
}

impl Maps {
    fn any(&self) -> bool {
        [self.base, self.surface, self.normal, self.emission]
            .iter()
            .any(Option::is_some)
    }
}

/// What a surface is made of: the metallic-roughness model of glTF 2.0,
/// section 3.9.2 and appendix B.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Surface {
    /// rgb: base colour, linear, in `[0, 1]`; a: opacity, in `[0, 1]`.
    pub base: Vec4,
    /// Nothing is drawn where opacity is less, in `[0, 1]`; 0 draws all.
    pub cutoff: f32,
    /// 0 for plastics, 1 for metals, in `[0, 1]`.
    pub metalness: f32,
    /// 0 mirrors sharply, 1 not at all, in `[0, 1]`.
    pub roughness: f32,
    /// Mirrored by other than metals at normal incidence, in `[0, 1]`: 0.04 for
    /// an index of refraction of 1.5.
    pub mirrored: f32,
    /// Radiance that it gives, in `[0, 65504]`.
    pub emission: Vec3,
    /// How far the normal map bends normals, in `[0, 16]`.
    pub bend: f32,
    /// Whether back faces are drawn, lit from behind.
    pub two_sided: bool,
    /// Each map costs its texels, and a kernel of its own.
    pub maps: Maps,
    /// How the maps are filtered. Strict kernels interpolate the largest mip's
    /// texels, repeating the texture.
    pub sampler: SamplerDesc,
}

impl Default for Surface {
    /// White, half rough plastic.
    fn default() -> Self {
        Self {
            base: Vec4::ONE,
            cutoff: 0.0,
            metalness: 0.0,
            roughness: 0.5,
            mirrored: 0.04,
            emission: Vec3::ZERO,
            bend: 1.0,
            two_sided: false,
            maps: Maps::default(),
            sampler: SamplerDesc::default(),
        }
    }
}

impl Surface {
    /// Checks every number against its range.
    ///
    /// # Errors
    /// The first outside of it.
    pub fn validate(&self) -> Result<(), SettingError> {
        let check = Settings("geometry");
        for value in self.base.to_array() {
            check.range("base", value, 0.0, 1.0)?;
        }
        check.range("cutoff", self.cutoff, 0.0, 1.0)?;
        check.range("metalness", self.metalness, 0.0, 1.0)?;
        check.range("roughness", self.roughness, 0.0, 1.0)?;
        check.range("mirrored", self.mirrored, 0.0, 1.0)?;
        for value in self.emission.to_array() {
            check.range("emission", value, 0.0, 65504.0)?;
        }
        check.range("bend", self.bend, 0.0, 16.0)
    }

    /// Sets what the prepass asks for: parts that are not opaque are cut out of it
    /// as well.
    pub(super) fn cut(&self, draw: Draw) -> Draw {
        match self.maps.base {
            Some(map) if self.cutoff > 0.0 => draw
                .feature("masked", true)
                .read("base_map", map)
                .sampler("linear", self.sampler)
                .set("opacity", self.base.w)
                .set("cutoff", self.cutoff),
            _ => draw,
        }
    }

    /// Whether nothing of it is opaque enough to be drawn.
    pub(super) fn is_cut_out(&self) -> bool {
        self.base.w < self.cutoff
    }

    /// Sets what `lib/surface` asks for.
    pub(crate) fn set(&self, draw: Draw) -> Draw {
        let mut draw = draw
            .set("base", self.base)
            .set("cutoff", self.cutoff)
            .set("metalness", self.metalness)
            .set("roughness", self.roughness)
            .set("mirrored", self.mirrored)
            .set("emission", self.emission)
            .set("bend", self.bend);
        let maps = &self.maps;
        for (feature, map) in [
            ("base_map", maps.base),
            ("surface_map", maps.surface),
            ("normal_map", maps.normal),
            ("emission_map", maps.emission),
        ] {
            if let Some(map) = map {
                draw = draw.feature(feature, true).read(feature, map);
            }
        }
        if maps.any() {
            draw = draw.feature("mapped", true).sampler("linear", self.sampler);
        }
        draw
    }
}

/// Triangles of one surface.
#[derive(Clone, Debug, PartialEq)]
pub struct Item {
    /// Where vertices are: `position` and `normal`; `uv` if the surface has maps;
    /// `tangent`, whose w is the sign of the bitangent, if one is of normals.
    pub vertices: Vec<(Buffer, u64, VertexLayout)>,
    /// In which order; in theirs without.
    pub indices: Option<(Buffer, u64, IndexFormat)>,
    /// Which of the indices, or vertices.
    pub elements: Range<u32>,
    /// From the mesh's space to the world: affine. Where it mirrors, front faces
    /// wind clockwise.
    pub world: DMat4,
    /// The same one frame earlier.
    pub previous: DMat4,
    /// When it is drawn.
    pub class: DrawClass,
    /// What it is made of.
    pub surface: Surface,
}

impl Item {
    /// Checks the surface, and that the matrices are finite.
    ///
    /// # Errors
    /// The first number that cannot be.
    pub fn validate(&self) -> Result<(), SettingError> {
        let check = Settings("geometry");
        for (field, matrix) in [("world", self.world), ("previous world", self.previous)] {
            for value in matrix.to_cols_array() {
                check.range(field, value as f32, -1e12, 1e12)?;
            }
        }
        self.surface.validate()
    }
}
