//! Surroundings with all that kernels read.

use etalon_core::graph::{Buffer, ComputePass, Draw, Graph, Texture, UniformValue};
use glam::{DMat3, DMat4, Mat4, Vec3};

use super::{Irradiance, Mirrored, Surroundings, mirroring};
use crate::EffectError;
use crate::bloom::LINEAR;
use crate::probes::Probes;

/// What surroundings are bound to: a draw or a compute pass.
pub(crate) trait Bind: Sized {
    fn texture(self, binding: &'static str, source: Texture) -> Self;
    fn buffer(self, binding: &'static str, source: Buffer) -> Self;
    fn member(self, name: &'static str, value: impl Into<UniformValue>) -> Self;
    fn with(self, feature: &'static str, enabled: bool) -> Self;
}

macro_rules! bind {
    ($($type:ty),*) => {
        $(impl Bind for $type {
            fn texture(self, binding: &'static str, source: Texture) -> Self {
                self.read(binding, source)
            }

            fn buffer(self, binding: &'static str, source: Buffer) -> Self {
                self.read_buffer(binding, source)
            }

            fn member(self, name: &'static str, value: impl Into<UniformValue>) -> Self {
                self.set(name, value)
            }

            fn with(self, feature: &'static str, enabled: bool) -> Self {
                self.feature(feature, enabled)
            }
        })*
    };
}

bind!(Draw, ComputePass<'_>);

/// Surroundings with what is missing of them made.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Around {
    irradiance: Irradiance,
    middle: Vec3,
    slope: Vec3,
    radiance: Option<Texture>,
    probes: Option<Probes>,
    /// None where nothing is to be mirrored.
    mirroring: Option<Texture>,
}

impl Surroundings {
    /// Makes what is missing for passes that light surfaces.
    pub(crate) fn ready(&self, graph: &mut Graph) -> Result<Around, EffectError> {
        let table = match (self.mirrored, self.mirroring) {
            (Mirrored::Reflected, _) => None,
            (Mirrored::Lit, Some(table)) => Some(table),
            (Mirrored::Lit, None) => Some(mirroring(graph)?),
        };
        Ok(Around {
            mirroring: table,
            ..self.radiant()
        })
    }

    /// For passes that ask for light from a direction alone.
    pub(crate) fn radiant(&self) -> Around {
        let gradient = Irradiance::of_gradient(self.above.as_dvec3(), self.below.as_dvec3());
        Around {
            irradiance: match &self.environment {
                Some(environment) => gradient.plus(&environment.irradiance),
                None => gradient,
            },
            middle: 0.5 * (self.above + self.below),
            slope: 0.5 * (self.above - self.below),
            radiance: self.environment.map(|environment| environment.radiance),
            probes: self.probes,
            mirroring: None,
        }
    }
}

impl Around {
    /// Sets what `lib/surroundings` asks for, of a view: from the world to its space.
    pub(crate) fn light(&self, draw: Draw, view: DMat4) -> Draw {
        let factors = self.irradiance.polynomial();
        let columns = |four: [usize; 4]| {
            let [x, y, z, w] = four.map(|of| factors[of].as_vec3().extend(0.0));
            Mat4::from_cols(x, y, z, w)
        };
        let draw = draw
            .feature("surrounded", true)
            .set("irradiance_low", columns([0, 1, 2, 3]))
            .set("irradiance_high", columns([4, 5, 6, 7]))
            .set("irradiance_last", factors[8].as_vec3());
        let draw = match self.probes {
            Some(probes) => draw.read("probe_irradiance", probes.maps.irradiance),
            None => draw,
        };
        match self.mirroring {
            Some(table) => self
                .mirrored(draw, view)
                .read("mirroring", table)
                .sampler("smoothing", LINEAR),
            None => self.world(draw, view).feature("matte", true),
        }
    }

    /// Sets what `lib/around` asks for, of a view: from the world to its space.
    pub(crate) fn reflect<'g>(&self, pass: ComputePass<'g>, view: DMat4) -> ComputePass<'g> {
        let pass = self.mirrored(pass, view).feature("fallback", true);
        match self.radiance.is_some() || self.probes.is_some() {
            true => pass.sampler("smoothing", LINEAR),
            false => pass,
        }
    }

    /// Light from directions.
    fn mirrored<B: Bind>(&self, mut pass: B, view: DMat4) -> B {
        if let Some(map) = self.radiance {
            pass = pass.with("environment", true).texture("radiance_map", map);
        }
        if let Some(probes) = self.probes {
            pass = pass.texture("probe_maps", probes.maps.radiance);
        }
        self.world(pass, view)
    }

    /// The world's numbers, and which probes there are.
    fn world<B: Bind>(&self, mut pass: B, view: DMat4) -> B {
        if let Some(probes) = self.probes {
            pass = pass.with("probes", true).buffer("probe_list", probes.list);
        }
        let to_world = DMat4::from_mat3(DMat3::from_mat4(view).transpose());
        pass.member("to_world", to_world.as_mat4())
            .member("middle", self.middle)
            .member("slope", self.slope)
    }
}
