//! Metallic-roughness materials: glTF 2.0, section 3.9, with
//! `KHR_materials_emissive_strength`, `KHR_materials_ior`,
//! `KHR_materials_transmission` and `KHR_materials_volume`.

use super::error::{Check, ModelError, Place, finite};

/// Where a texture is read: `KHR_texture_transform`.
///
/// With `uv` of the set, the place is `offset + R(rotation) · (scale · uv)`,
/// where `R(r) = ((cos r, sin r), (−sin r, cos r))`, rows first: places turn
/// counter-clockwise on the image, whose v grows downward, and so the image
/// turns clockwise on the surface. So say the extension's words and renderers do;
/// its sample code, read by columns, has the opposite sign.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct UvTransform {
    /// In units of the image.
    pub offset: [f32; 2],
    /// In radians.
    pub rotation: f32,
    /// By which texture coordinates are multiplied.
    pub scale: [f32; 2],
}

impl Default for UvTransform {
    fn default() -> Self {
        Self {
            offset: [0.0; 2],
            rotation: 0.0,
            scale: [1.0; 2],
        }
    }
}

impl UvTransform {
    /// The place that a texture coordinate refers to.
    #[must_use]
    pub fn apply(&self, uv: [f32; 2]) -> [f32; 2] {
        let (sin, cos) = self.rotation.sin_cos();
        let (u, v) = (self.scale[0] * uv[0], self.scale[1] * uv[1]);
        [
            self.offset[0] + cos * u + sin * v,
            self.offset[1] - sin * u + cos * v,
        ]
    }
}

/// A texture of a material.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TextureUse {
    /// Index of the model's texture.
    pub texture: usize,
    /// Which of the mesh's sets of texture coordinates: 0 or 1.
    pub set: u8,
    /// What is done to them first.
    pub transform: UvTransform,
}

impl TextureUse {
    /// A texture read at the texture coordinates of set 0 as they are.
    #[must_use]
    pub fn new(texture: usize) -> Self {
        Self {
            texture,
            set: 0,
            transform: UvTransform::default(),
        }
    }
}

/// What alpha means.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum AlphaMode {
    /// Nothing: the surface is opaque.
    #[default]
    Opaque,
    /// Opaque where alpha is at least `cutoff`, not there elsewhere.
    Mask {
        /// Not negative.
        cutoff: f32,
    },
    /// Coverage, blended over what is behind.
    Blend,
}

/// What is below a surface: `KHR_materials_volume`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Volume {
    /// Thickness below the surface in the mesh's space; 0 for a thin wall.
    pub thickness: f32,
    /// Its green channel multiplies the thickness.
    pub thickness_texture: Option<TextureUse>,
    /// Mean distance that light travels before it interacts, over 0; infinite
    /// where nothing is absorbed.
    pub attenuation_distance: f32,
    /// What white light turns to after that distance, each channel in `[0, 1]`.
    pub attenuation_colour: [f32; 3],
}

impl Default for Volume {
    fn default() -> Self {
        Self {
            thickness: 0.0,
            thickness_texture: None,
            attenuation_distance: f32::INFINITY,
            attenuation_colour: [1.0; 3],
        }
    }
}

/// What a surface is made of. Textures multiply the factor they stand beside.
#[derive(Clone, Debug, PartialEq)]
pub struct Material {
    /// May be empty.
    pub name: String,
    /// Linear RGBA, each in `[0, 1]`.
    pub base_colour: [f32; 4],
    /// RGBA; sRGB.
    pub base_colour_texture: Option<TextureUse>,
    /// 0 for dielectrics, 1 for metals.
    pub metallic: f32,
    /// Perceptual roughness in `[0, 1]`: the square root of GGX's α.
    pub roughness: f32,
    /// Green: roughness, blue: metallic; linear.
    pub metallic_roughness_texture: Option<TextureUse>,
    /// Tangent-space normal `2 · rgb − 1`; linear.
    pub normal_texture: Option<TextureUse>,
    /// Multiplies x and y of the normal map's normal.
    pub normal_scale: f32,
    /// Red: occlusion; linear.
    pub occlusion_texture: Option<TextureUse>,
    /// How much of the occlusion is applied, in `[0, 1]`.
    pub occlusion_strength: f32,
    /// Light given off, linear, each in `[0, 1]`.
    pub emissive: [f32; 3],
    /// sRGB.
    pub emissive_texture: Option<TextureUse>,
    /// Multiplies the emission: its luminance in cd/m², not negative.
    pub emissive_strength: f32,
    /// What alpha means.
    pub alpha: AlphaMode,
    /// Whether back faces are drawn, with their normals turned around.
    pub double_sided: bool,
    /// Part of the light that enters the surface and passes it, in `[0, 1]`.
    pub transmission: f32,
    /// Red multiplies the transmission; linear.
    pub transmission_texture: Option<TextureUse>,
    /// Index of refraction: at least 1, or 0 for full reflection at any angle.
    pub ior: f32,
    /// What is below the surface.
    pub volume: Volume,
}

impl Default for Material {
    /// glTF's default: white, metallic and rough.
    fn default() -> Self {
        Self {
            name: String::new(),
            base_colour: [1.0; 4],
            base_colour_texture: None,
            metallic: 1.0,
            roughness: 1.0,
            metallic_roughness_texture: None,
            normal_texture: None,
            normal_scale: 1.0,
            occlusion_texture: None,
            occlusion_strength: 1.0,
            emissive: [0.0; 3],
            emissive_texture: None,
            emissive_strength: 1.0,
            alpha: AlphaMode::Opaque,
            double_sided: false,
            transmission: 0.0,
            transmission_texture: None,
            ior: 1.5,
            volume: Volume::default(),
        }
    }
}

impl Material {
    /// A dielectric.
    #[must_use]
    pub fn dielectric(name: &str, colour: [f32; 3], roughness: f32) -> Self {
        let [r, g, b] = colour;
        Self {
            name: name.into(),
            base_colour: [r, g, b, 1.0],
            metallic: 0.0,
            roughness,
            ..Self::default()
        }
    }

    /// A metal.
    #[must_use]
    pub fn metal(name: &str, colour: [f32; 3], roughness: f32) -> Self {
        Self {
            metallic: 1.0,
            ..Self::dielectric(name, colour, roughness)
        }
    }

    /// Its textures, each with the name of the property.
    pub fn textures(&self) -> impl Iterator<Item = (&'static str, &TextureUse)> {
        [
            ("base colour texture", &self.base_colour_texture),
            (
                "metallic-roughness texture",
                &self.metallic_roughness_texture,
            ),
            ("normal texture", &self.normal_texture),
            ("occlusion texture", &self.occlusion_texture),
            ("emissive texture", &self.emissive_texture),
            ("transmission texture", &self.transmission_texture),
            ("thickness texture", &self.volume.thickness_texture),
        ]
        .into_iter()
        .filter_map(|(what, texture)| Some((what, texture.as_ref()?)))
    }

    pub(super) fn check(&self, index: usize, textures: usize) -> Result<(), ModelError> {
        let place = Place::new("material", index, &self.name);
        let check = Check(&place);
        let within = |values: &[f32]| values.iter().all(|x| (0.0..=1.0).contains(x));
        check.value(
            "base colour",
            self.base_colour,
            "in [0, 1]",
            within(&self.base_colour),
        )?;
        check.value(
            "emissive colour",
            self.emissive,
            "in [0, 1]",
            within(&self.emissive),
        )?;
        let volume = &self.volume;
        let colour = volume.attenuation_colour;
        check.value("attenuation colour", colour, "in [0, 1]", within(&colour))?;
        for (what, value) in [
            ("metallic", self.metallic),
            ("roughness", self.roughness),
            ("occlusion strength", self.occlusion_strength),
            ("transmission", self.transmission),
        ] {
            check.unit(what, value)?;
        }
        check.value(
            "normal scale",
            self.normal_scale,
            "finite",
            self.normal_scale.is_finite(),
        )?;
        check.not_negative("emissive strength", self.emissive_strength)?;
        check.not_negative("thickness", volume.thickness)?;
        check.value(
            "index of refraction",
            self.ior,
            "0, or finite and at least 1",
            self.ior == 0.0 || (self.ior >= 1.0 && self.ior.is_finite()),
        )?;
        let distance = volume.attenuation_distance;
        check.value("attenuation distance", distance, "over 0", distance > 0.0)?;
        if let AlphaMode::Mask { cutoff } = self.alpha {
            check.not_negative("alpha cutoff", cutoff)?;
        }
        for (what, texture) in self.textures() {
            check.index(what, "texture", texture.texture, textures)?;
            check.value(
                format!("texture coordinate set of the {what}"),
                texture.set,
                "0 or 1",
                texture.set < 2,
            )?;
            let UvTransform {
                offset,
                rotation,
                scale,
            } = texture.transform;
            check.value(
                format!("transform of the {what}"),
                texture.transform,
                "finite",
                finite(&offset) && finite(&scale) && rotation.is_finite(),
            )?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_are_scaled_then_turned_then_moved() {
        let transform = UvTransform {
            offset: [0.25, 0.5],
            rotation: std::f32::consts::FRAC_PI_2,
            scale: [2.0, 3.0],
        };
        // To the right becomes up, and down becomes to the right.
        for (uv, expected) in [
            ([0.0, 0.0], [0.25, 0.5]),
            ([1.0, 0.0], [0.25, -1.5]),
            ([0.0, 1.0], [3.25, 0.5]),
        ] {
            let got = transform.apply(uv);
            // The angle and its cosine are off by a rounding each.
            assert!((got[0] - expected[0]).abs() < 1e-6 && (got[1] - expected[1]).abs() < 1e-6);
        }
        assert_eq!(UvTransform::default().apply([0.5, 2.0]), [0.5, 2.0]);
    }
}
