//! What a frame holds, and what that calls for.
//!
//! An engine, or a scene, says what is on the screen: [`Demands`]. Each effect says
//! what calls for it, in a `demand` module of its own that the
//! [registry](crate::registry) knows: [`EffectEntry::decide`](crate::EffectEntry::decide).
//! [`frame`](mod@crate::frame) declares what is called for and nothing else, and notes
//! the reason of every decision in the graph, which the plan then tells.
//!
//! # Conservative
//! Demands may say more than there is, and never less: bounds that are too large cost
//! time, bounds that are too small cost the picture. Whoever does not know something
//! says [everything](Demands::everything) of it.
//!
//! # Exact
//! With the thresholds at their defaults an effect is absent only if its result could
//! not change one bit of the picture: no surface mirrors, no light passes the bloom's
//! threshold. [`Thresholds`] trade that for time.

mod region;

use etalon_core::graph::Decision;

pub use region::Region;
pub(crate) use region::either;

use crate::check::Settings;
use crate::tiles::crossover::Cost;
use crate::{ChainSettings, SettingError};

/// Surfaces that mirror.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reflective {
    /// Where they are.
    pub region: Region,
    /// Roughness of the smoothest and of the roughest of them, each in `[0, 1]`.
    pub roughness: [f32; 2],
    /// The largest share of a colour that one of them mirrors at normal incidence, in
    /// `[0, 1]`.
    pub specular: f32,
    /// Distance of the nearest of them from the plane of the eye along the view axis,
    /// in view units, at least 0.
    pub nearest: f32,
}

impl Reflective {
    /// Both.
    #[must_use]
    pub fn union(self, other: Self) -> Self {
        Self {
            region: self.region.union(other.region),
            roughness: [
                self.roughness[0].min(other.roughness[0]),
                self.roughness[1].max(other.roughness[1]),
            ],
            specular: self.specular.max(other.specular),
            nearest: self.nearest.min(other.nearest),
        }
    }
}

/// How bright the light is, before reflections and exposure.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bright {
    /// The largest channel of any texel, in `[0, 65504]`.
    pub peak: f32,
    /// The largest channel outside of the region, in `[0, peak]`.
    pub floor: f32,
    /// Where texels are that are brighter than `floor`.
    pub region: Region,
}

impl Bright {
    /// Both.
    #[must_use]
    pub fn union(self, other: Self) -> Self {
        Self {
            peak: self.peak.max(other.peak),
            floor: self.floor.max(other.floor),
            region: self.region.union(other.region),
        }
    }
}

/// What is elsewhere on the screen than it was one frame earlier.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Moving {
    /// Whether the camera moved or turned, which moves all of the screen.
    pub camera: bool,
    /// Where things are that moved by themselves, skinned ones among them, or were.
    pub objects: Option<Region>,
}

impl Moving {
    /// Where anything moves.
    #[must_use]
    pub fn region(&self) -> Option<Region> {
        if self.camera {
            Some(Region::FULL)
        } else {
            self.objects
        }
    }
}

/// What a frame holds. `None` is that there is no such thing on the screen.
///
/// ```
/// use etalon_effects::demand::{Demands, Moving, Reflective, Region};
///
/// // A puddle in the lower half of the screen, seen by a camera that moves.
/// let half = Region::new([0.0, 0.5], [1.0, 1.0]);
/// let demands = Demands::default()
///     .with_surfaces(Region::FULL)
///     .with_moving(Moving { camera: true, objects: None });
/// let demands = match half {
///     Some(region) => demands.with_reflective(Reflective {
///         region,
///         roughness: [0.02, 0.1],
///         specular: 0.05,
///         nearest: 1.5,
///     }),
///     None => demands,
/// };
/// assert_eq!(demands.reflective.map(|puddle| puddle.region.coverage()), Some(0.5));
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct Demands {
    /// Where opaque surfaces are: what geometry passes draw.
    pub surfaces: Option<Region>,
    /// Surfaces that mirror: what calls for reflections.
    pub reflective: Option<Reflective>,
    /// Where light passes through surfaces, or they are blended: what calls for the
    /// pass of glass.
    pub transparent: Option<Region>,
    /// How bright it gets: what calls for bloom. `None` is that all is black.
    pub bright: Option<Bright>,
    /// What moves: what calls for velocity.
    pub moving: Option<Moving>,
}

impl Demands {
    /// All there can be, everywhere: what who knows nothing says.
    #[must_use]
    pub const fn everything() -> Self {
        Self {
            surfaces: Some(Region::FULL),
            reflective: Some(Reflective {
                region: Region::FULL,
                roughness: [0.0, 1.0],
                specular: 1.0,
                nearest: 0.0,
            }),
            transparent: Some(Region::FULL),
            bright: Some(Bright {
                peak: 65_504.0,
                floor: 65_504.0,
                region: Region::FULL,
            }),
            moving: Some(Moving {
                camera: true,
                objects: Some(Region::FULL),
            }),
        }
    }

    /// Adds opaque surfaces.
    #[must_use]
    pub fn with_surfaces(mut self, region: Region) -> Self {
        self.surfaces = either(self.surfaces, Some(region));
        self
    }

    /// Adds surfaces that mirror.
    #[must_use]
    pub fn with_reflective(mut self, reflective: Reflective) -> Self {
        self.reflective = Some(match self.reflective {
            Some(known) => known.union(reflective),
            None => reflective,
        });
        self
    }

    /// Adds what light passes through.
    #[must_use]
    pub fn with_transparent(mut self, region: Region) -> Self {
        self.transparent = either(self.transparent, Some(region));
        self
    }

    /// Adds light.
    #[must_use]
    pub fn with_bright(mut self, bright: Bright) -> Self {
        self.bright = Some(match self.bright {
            Some(known) => known.union(bright),
            None => bright,
        });
        self
    }

    /// Adds what moves.
    #[must_use]
    pub fn with_moving(mut self, moving: Moving) -> Self {
        let known = self.moving.unwrap_or_default();
        let both = Moving {
            camera: known.camera || moving.camera,
            objects: either(known.objects, moving.objects),
        };
        self.moving = both.region().map(|_| both);
        self
    }

    /// All that is in either: of several cameras into one picture, say, or of parts of
    /// a scene.
    #[must_use]
    pub fn union(self, other: Self) -> Self {
        let mut both = self;
        if let Some(region) = other.surfaces {
            both = both.with_surfaces(region);
        }
        if let Some(reflective) = other.reflective {
            both = both.with_reflective(reflective);
        }
        if let Some(region) = other.transparent {
            both = both.with_transparent(region);
        }
        if let Some(bright) = other.bright {
            both = both.with_bright(bright);
        }
        if let Some(moving) = other.moving {
            both = both.with_moving(moving);
        }
        both
    }

    /// Checks every number against its range.
    ///
    /// # Errors
    /// The first outside of it: nothing may be decided by NaN.
    pub fn validate(&self) -> Result<(), SettingError> {
        let check = Settings("demands");
        if let Some(reflective) = &self.reflective {
            let [smoothest, roughest] = reflective.roughness;
            check.range("roughness of the smoothest", smoothest, 0.0, 1.0)?;
            check.range("roughness of the roughest", roughest, smoothest, 1.0)?;
            check.range("specular", reflective.specular, 0.0, 1.0)?;
            check.range("nearest", reflective.nearest, 0.0, f32::INFINITY)?;
        }
        if let Some(bright) = &self.bright {
            check.range("peak", bright.peak, 0.0, 65_504.0)?;
            check.range("floor", bright.floor, 0.0, bright.peak)?;
        }
        Ok(())
    }
}

/// From where on something is worth an effect. The defaults change no bit of any
/// picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Thresholds {
    /// Roughness of the roughest surface that is given reflections if it is the
    /// smoothest there is, in `[0, 1]`; 1 gives them to all.
    pub max_roughness: f32,
    /// Share of a colour up to which mirroring is not worth it, in `[0, 1]`; 0 leaves
    /// out only what does not mirror.
    pub min_specular: f32,
    /// Share of a colour up to which reflections are faint, in `[0, 1]`: if no surface
    /// mirrors more, one texel in four is marched. 0 does that to none.
    pub faint_specular: f32,
    /// Distance in view units from which reflections are distant, at least 0: if no
    /// surface that mirrors is nearer, one texel in four is marched. Infinity, the
    /// default, does that to none.
    pub distant: f32,
    /// What reflections take on the device, on tiles and without, as `cargo xtask
    /// economy` measures it: where what mirrors covers more of the screen than tiles
    /// are worth, they are off. For bounds that are tight; `None` leaves it to
    /// [`Ssr::tiles`](crate::ssr::Ssr::tiles), as loose bounds say nothing of how much
    /// there is.
    pub tiles: Option<Cost>,
}

impl Default for Thresholds {
    fn default() -> Self {
        Self {
            max_roughness: 1.0,
            min_specular: 0.0,
            faint_specular: 0.0,
            distant: f32::INFINITY,
            tiles: None,
        }
    }
}

impl Thresholds {
    /// Checks every number against its range.
    ///
    /// # Errors
    /// The first outside of it.
    pub fn validate(&self) -> Result<(), SettingError> {
        let check = Settings("thresholds");
        check.range("max_roughness", self.max_roughness, 0.0, 1.0)?;
        check.range("min_specular", self.min_specular, 0.0, 1.0)?;
        check.range("faint_specular", self.faint_specular, 0.0, 1.0)?;
        check.range("distant", self.distant, 0.0, f32::INFINITY)
    }
}

/// What of a frame is asked for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct Outputs {
    /// What the display shows.
    pub picture: bool,
    /// Linear light with reflections, before exposure.
    pub light: bool,
    /// Device depth.
    pub depth: bool,
    /// Normals in view space.
    pub normal: bool,
    /// What is mirrored, and 1 − roughness.
    pub specular: bool,
    /// Screen position now less that one frame earlier.
    pub velocity: bool,
}

impl Outputs {
    /// The picture alone.
    pub const PICTURE: Self = Self {
        picture: true,
        ..Self::NONE
    };

    /// Nothing yet, for the struct's fields to be set.
    pub const NONE: Self = Self {
        picture: false,
        light: false,
        depth: false,
        normal: false,
        specular: false,
        velocity: false,
    };

    /// Everything there is.
    pub const ALL: Self = Self {
        picture: true,
        light: true,
        depth: true,
        normal: true,
        specular: true,
        velocity: true,
    };

    /// Whether light is needed for any of them.
    #[must_use]
    pub const fn lit(&self) -> bool {
        self.picture || self.light
    }
}

/// An image of the frame that an effect reads beside the light.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Need {
    /// Device depth.
    Depth,
    /// Normals in view space.
    Normal,
    /// What is mirrored, and 1 − roughness.
    Specular,
}

/// What effects decide by.
#[derive(Clone, Copy, Debug)]
pub struct Calls<'a> {
    /// What the frame holds.
    pub demands: &'a Demands,
    /// What of it is asked for.
    pub outputs: &'a Outputs,
    /// The effects that are on.
    pub settings: &'a ChainSettings,
    /// What is worth an effect.
    pub thresholds: &'a Thresholds,
}

/// That an effect is off.
pub(crate) fn off() -> Decision {
    Decision::absent("the settings have it off")
}

/// That nobody would see an effect on the light.
pub(crate) fn unseen(output: &str) -> Decision {
    Decision::absent(format!("the {output} is not asked for"))
}
