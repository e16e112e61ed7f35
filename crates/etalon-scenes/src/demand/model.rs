//! The demands of models: the bounds of parts, and what they are made of.

use std::collections::HashMap;

use etalon_effects::demand::{Bright, Demands, Moving, Reflective, Region};
use etalon_effects::environment::Surroundings;
use etalon_effects::geometry::View;
use glam::{DMat4, DVec3, Vec3};

use super::DIM;
use super::light::{MOST, brightest};
use super::projected::{self, Seen};
use crate::camera::CameraError;
use crate::frame::FrameSize;
use crate::model::{Instance, Material, Model, Shot, TextureUse, is_blended, view};

/// One step of an 8-bit channel, which what surfaces mirror is stored in.
const STEP: f32 = 1.0 / 255.0;

impl Shot {
    /// What it calls for in a picture of a size, before anything is drawn.
    ///
    /// Bounds are those of whole meshes: a floor that reaches below the camera covers
    /// half of the screen, whatever stands on it. Skinned meshes can be anywhere.
    ///
    /// # Errors
    /// If the camera has no projection for the size.
    pub fn demands(
        &self,
        size: FrameSize,
        surroundings: &Surroundings,
    ) -> Result<Demands, CameraError> {
        let view = view(self.camera(), size)?;
        let mut parts = Parts {
            shot: self,
            view,
            size: [size.width(), size.height()],
            surroundings,
            ranges: HashMap::new(),
        };
        let mut demands = Demands::default();
        if view.view != view.previous {
            demands = demands.with_moving(Moving {
                camera: true,
                objects: None,
            });
        }
        let background = surroundings.background.max_element().min(MOST);
        let mut light = Lit {
            peak: background,
            floor: background.max(DIM),
            ..Lit::default()
        };
        for instance in self.snapshot().instances.all() {
            if let Some(seen) = parts.seen(instance) {
                demands = parts.add(demands, &mut light, instance, seen);
            }
        }
        Ok(match light.bright() {
            Some(bright) => demands.with_bright(bright),
            None => demands,
        })
    }
}

/// Light, part by part.
#[derive(Default)]
struct Lit {
    /// The largest of what is opaque.
    peak: f32,
    /// Not worth a region.
    floor: f32,
    /// What all blended parts can add.
    blended: f32,
    region: Option<Region>,
}

impl Lit {
    fn add(&mut self, brightest: f32, region: Region, blended: bool) {
        if blended {
            // Both of its sides.
            self.blended += 2.0 * brightest;
        } else {
            self.peak = self.peak.max(brightest);
        }
        if blended || brightest > self.floor {
            self.region = Some(self.region.map_or(region, |known| known.union(region)));
        }
    }

    fn bright(&self) -> Option<Bright> {
        let peak = (self.peak + self.blended).min(MOST);
        (peak > 0.0).then(|| Bright {
            peak,
            floor: self.floor.min(peak),
            region: self.region.unwrap_or(Region::FULL),
        })
    }
}

/// What parts are looked at by.
struct Parts<'a> {
    shot: &'a Shot,
    view: View,
    size: [u32; 2],
    surroundings: &'a Surroundings,
    /// By image, its smallest and largest channels.
    ranges: HashMap<usize, [[f32; 3]; 2]>,
}

impl Parts<'_> {
    fn model(&self) -> &Model {
        self.shot.model()
    }

    fn bounds(&self, instance: &Instance) -> [DVec3; 2] {
        let bounds = self.model().parts().meshes[instance.mesh].bounds();
        bounds.map(|corner| DVec3::from(corner.map(f64::from)))
    }

    /// Where an instance is on the screen, if it is.
    fn seen(&self, instance: &Instance) -> Option<Seen> {
        if instance.skin.is_some() {
            return Some(Seen::FULL);
        }
        let world = instance.world.as_dmat4();
        projected::seen(self.bounds(instance), world, &self.view, self.size)
    }

    fn add(
        &mut self,
        mut demands: Demands,
        light: &mut Lit,
        instance: &Instance,
        Seen { region, nearest }: Seen,
    ) -> Demands {
        let material = self.model().parts().materials[instance.material].clone();
        let blended = is_blended(self.model(), instance);
        let [smoothest, roughest] = self.roughness(&material);
        if blended {
            demands = demands.with_transparent(region);
        } else {
            demands = demands.with_surfaces(region);
            let specular = mirrored(&material);
            if specular > 0.0 {
                demands = demands.with_reflective(Reflective {
                    region,
                    roughness: [(smoothest - STEP).max(0.0), (roughest + STEP).min(1.0)],
                    specular: (specular + STEP).min(1.0),
                    nearest,
                });
            }
            if instance.skin.is_some() || instance.world != instance.previous {
                demands = demands.with_moving(Moving {
                    camera: false,
                    objects: Some(region),
                });
            }
        }
        let emission = Vec3::from(material.emissive) * material.emissive_strength;
        let brightest = if instance.skin.is_some() {
            MOST
        } else {
            brightest(
                placed(self.bounds(instance), instance.world.as_dmat4()),
                smoothest,
                emission,
                self.shot.lights(),
                self.surroundings,
            )
        };
        light.add(brightest, region, blended);
        demands
    }

    /// The least and the largest roughness of a material.
    fn roughness(&mut self, material: &Material) -> [f32; 2] {
        let [low, high] = match material.metallic_roughness_texture {
            Some(used) => self.range(used).map(|channels| channels[1]),
            None => [1.0; 2],
        };
        [low, high].map(|map| material.roughness * map)
    }

    /// The smallest and the largest red, green and blue of a texture's image, which no
    /// filter leaves.
    fn range(&mut self, used: TextureUse) -> [[f32; 3]; 2] {
        let parts = self.shot.model().parts();
        let image = parts.textures[used.texture].image;
        *self.ranges.entry(image).or_insert_with(|| {
            let (mut low, mut high) = ([255_u8; 3], [0_u8; 3]);
            for texel in parts.images[image].rgba().chunks_exact(4) {
                for channel in 0..3 {
                    low[channel] = low[channel].min(texel[channel]);
                    high[channel] = high[channel].max(texel[channel]);
                }
            }
            [low, high].map(|channels| channels.map(|value| f32::from(value) * STEP))
        })
    }
}

/// The largest share of a colour that a material mirrors at normal incidence: what
/// dielectrics do, or, where it can be metal, what its colour is.
fn mirrored(material: &Material) -> f32 {
    let f0 = ((material.ior - 1.0) / (material.ior + 1.0)).powi(2);
    if material.metallic > 0.0 {
        let [r, g, b, _] = material.base_colour;
        f0.max(r).max(g).max(b)
    } else {
        f0
    }
}

/// A box around a box that is somewhere in the world.
fn placed(bounds: [DVec3; 2], world: DMat4) -> [DVec3; 2] {
    let mut placed = [DVec3::INFINITY, DVec3::NEG_INFINITY];
    for corner in 0..8_usize {
        let pick = |axis: usize| bounds[corner >> axis & 1][axis];
        let at = world.transform_point3(DVec3::new(pick(0), pick(1), pick(2)));
        placed = [placed[0].min(at), placed[1].max(at)];
    }
    placed
}
