//! Tiles: an effect's heavy kernels run only where the picture needs them.
//!
//! A kernel of the effect marks what the surfaces in each 8 × 8 texels ask for
//! ([`Marks`]); marks may be joined for larger tiles, and spread for kernels that look
//! at neighbours; of the tiles with certain marks a list is made on the device
//! ([`TileList`]), and kernels run on those tiles alone ([`Area`]). No mark leaves the
//! device, and nobody has to know how many tiles there will be.
//!
//! Lists are in row order on every device, so that every pass on tiles writes the same
//! bits everywhere, as full-screen passes do.
//!
//! # What it costs
//! One look at each texel that decides, and some look-ups per tile: see
//! `docs/measurements/economy.md`. [`crossover`](mod@crossover) says from which share of
//! the screen on that is more than what is saved.

pub mod crossover;

use etalon_core::Format;
use etalon_core::graph::{Buffer, ComputePass, Graph, Texture};
use etalon_core::resource::{BufferDesc, TextureDesc};
use glam::IVec2;

use crate::EffectError;
use crate::check::{Settings, size};
use crate::knob::choices;

/// Texels along the side of what a kernel marks, and of the workgroups of kernels that
/// run on tiles.
pub const MARKED_SIDE: u32 = 8;

/// The furthest that marks are spread, in texels.
pub const MOST_RADIUS: u32 = 512;

/// Words of a list before its tiles; `shaders/lib/tiles.wesl` says what they are.
const LIST_HEADER: u64 = 5;

/// How large the tiles are that an effect is divided into.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Tiling {
    /// No tiles: every kernel runs on the whole picture.
    Off,
    /// 8 × 8 texels: the closest fit, and the longest lists.
    #[default]
    Texels8,
    /// 16 × 16 texels.
    Texels16,
    /// 32 × 32 texels.
    Texels32,
    /// 64 × 64 texels.
    Texels64,
}

choices!(Tiling {
    Off => "off",
    Texels8 => "8",
    Texels16 => "16",
    Texels32 => "32",
    Texels64 => "64",
});

impl Tiling {
    /// All there are.
    pub const ALL: [Self; 5] = [
        Self::Off,
        Self::Texels8,
        Self::Texels16,
        Self::Texels32,
        Self::Texels64,
    ];

    /// The size of tiles; `None` without tiles.
    #[must_use]
    pub const fn size(self) -> Option<TileSize> {
        let shift = match self {
            Self::Off => return None,
            Self::Texels8 => 0,
            Self::Texels16 => 1,
            Self::Texels32 => 2,
            Self::Texels64 => 3,
        };
        Some(TileSize { shift })
    }
}

/// The size of tiles.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TileSize {
    /// The side is [`MARKED_SIDE`] times two to this power.
    shift: u32,
}

impl TileSize {
    /// Texels along a side.
    #[must_use]
    pub const fn side(self) -> u32 {
        MARKED_SIDE << self.shift
    }
}

/// An axis of the picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Axis {
    /// Along rows.
    X,
    /// Along columns.
    Y,
}

impl Axis {
    pub(crate) const fn step(self) -> IVec2 {
        match self {
            Self::X => IVec2::X,
            Self::Y => IVec2::Y,
        }
    }
}

/// What each tile of a picture asks for: a `u32`, whose bits the effect gives a meaning.
#[derive(Clone, Copy, Debug)]
pub struct Marks {
    /// `r32uint`, a texel per tile.
    texture: Texture,
    size: TileSize,
}

impl Marks {
    /// A texture for the marks of each [`MARKED_SIDE`]² texels of a picture, for a kernel
    /// to write.
    pub fn texture(graph: &mut Graph, name: &str, picture: Texture) -> Texture {
        let [width, height] = size(graph, picture).map(|side| side.div_ceil(MARKED_SIDE));
        graph.texture(name, TextureDesc::d2(width, height, Format::R32Uint))
    }

    /// The same for a picture of half the size, rounded up.
    pub fn half_texture(graph: &mut Graph, name: &str, picture: Texture) -> Texture {
        let side = 2 * MARKED_SIDE;
        let [width, height] = size(graph, picture).map(|texels| texels.div_ceil(side));
        graph.texture(name, TextureDesc::d2(width, height, Format::R32Uint))
    }

    /// These marks for the picture of twice the size, whose tiles are twice as wide.
    #[must_use]
    pub const fn doubled(self) -> Self {
        let size = TileSize {
            shift: self.size.shift + 1,
        };
        Self { size, ..self }
    }

    /// The marks in a texture that [`Marks::texture`] made and a kernel wrote, joined for
    /// tiles of some size: the larger of two marks is kept.
    ///
    /// # Errors
    /// If the graph refuses the texture.
    pub fn of(graph: &mut Graph, texture: Texture, tiles: TileSize) -> Result<Self, EffectError> {
        let parts = 1 << tiles.shift;
        let mut marks = Self {
            texture,
            size: tiles,
        };
        if parts > 1 {
            let [width, height] = size(graph, texture).map(|side| side.div_ceil(parts));
            let desc = TextureDesc::d2(width, height, Format::R32Uint);
            let result = graph.texture("tiles.marks", desc);
            marks.texture = graph
                .compute("tiles/coarsen")
                .read("marks", texture)
                .write("result", result)
                .set("parts", parts)
                .per_texel("result")?;
        }
        Ok(marks)
    }

    /// Sets the bits `raised` of every tile that holds a texel within `radius` texels
    /// along an axis of a tile that has one of the bits `seen`: where a kernel that looks
    /// so far reads when it runs on the tiles seen. These are exactly the tiles it reads,
    /// since it runs on all texels of a tile.
    ///
    /// # Errors
    /// If the radius is over [`MOST_RADIUS`], or the graph refuses the marks.
    pub fn spread(
        self,
        graph: &mut Graph,
        axis: Axis,
        radius: u32,
        seen: u32,
        raised: u32,
    ) -> Result<Self, EffectError> {
        Settings("tiles").count("radius", radius, 0, MOST_RADIUS)?;
        let reach = radius.div_ceil(self.size.side());
        let [width, height] = size(graph, self.texture);
        let desc = TextureDesc::d2(width, height, Format::R32Uint);
        let result = graph.texture("tiles.spread", desc);
        let texture = graph
            .compute("tiles/spread")
            .read("marks", self.texture)
            .write("result", result)
            .set("axis", axis.step())
            .set("reach", reach as i32)
            .set("seen", seen)
            .set("raised", raised)
            .per_texel("result")?;
        Ok(Self { texture, ..self })
    }

    /// The tiles whose marks have one of the bits `wanted`.
    ///
    /// # Errors
    /// If the graph refuses the marks.
    pub fn with(&self, graph: &mut Graph, wanted: u32) -> Result<TileList, EffectError> {
        self.list(graph, wanted, false)
    }

    /// The tiles whose marks have none of the bits `unwanted`.
    ///
    /// # Errors
    /// If the graph refuses the marks.
    pub fn without(&self, graph: &mut Graph, unwanted: u32) -> Result<TileList, EffectError> {
        self.list(graph, unwanted, true)
    }

    fn list(&self, graph: &mut Graph, bits: u32, others: bool) -> Result<TileList, EffectError> {
        let [width, height] = size(graph, self.texture).map(u64::from);
        // Planning refuses sizes that there cannot be.
        let words = LIST_HEADER.saturating_add(width.saturating_mul(height));
        let desc = BufferDesc {
            bytes: words.saturating_mul(4),
        };
        let list = graph.buffer("tiles.list", desc);
        let written = graph
            .compute("tiles/list")
            .read("marks", self.texture)
            .write_buffer("list", list)
            .set("wanted", bits)
            .set("others", u32::from(others))
            .set("shift", self.size.shift)
            .groups([1, 1, 1])?;
        Ok(TileList(written.buffer("list")?))
    }
}

/// Tiles in row order, on the device.
#[derive(Clone, Copy, Debug)]
pub struct TileList(Buffer);

impl TileList {
    /// The list as kernels see it: `shaders/lib/tiles.wesl` says what is in it.
    #[must_use]
    pub const fn buffer(self) -> Buffer {
        self.0
    }
}

/// Where a pass runs.
#[derive(Clone, Copy, Debug)]
pub enum Area {
    /// On the whole picture.
    Picture,
    /// On the tiles of a list.
    Tiles(TileList),
}

impl Area {
    /// Runs a pass whose kernel imports `lib/tiles` there, and returns what it wrote to
    /// `target`, a texture of the picture's size, as `result`. Beside the tiles of a list
    /// `target` keeps what it held.
    ///
    /// # Errors
    /// If the declaration contradicts the graph or itself.
    pub fn run(self, pass: ComputePass<'_>, target: Texture) -> Result<Texture, EffectError> {
        Ok(match self {
            Self::Picture => pass.write("result", target).per_texel("result")?,
            Self::Tiles(TileList(list)) => pass
                .write_part("result", target)
                .feature("tiled", true)
                .per_tile("tiles", list)?
                .texture("result")?,
        })
    }
}
