//! Which functions there are.

mod images;
mod numbers;
mod rooms;

/// What a function is given beside numbers.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(in crate::functions) enum Given {
    Nothing,
    /// [`PICTURE`], as `picture`.
    Picture,
    /// [`camera`], in `params`.
    Camera,
}

impl Given {
    /// What the kernel declares of it.
    pub(in crate::functions) const fn declared(self) -> &'static str {
        match self {
            Self::Nothing => "",
            Self::Picture => "@group(0) @binding(2) var picture: texture_2d<f32>;",
            Self::Camera => {
                "import package::lib::camera::Camera;

struct Params {
    scale: vec2<f32>,
    centre: vec2<f32>,
    depth: vec2<f32>,
    range: vec2<f32>,
}
@group(0) @binding(2) var<uniform> params: Params;"
            }
        }
    }
}

/// A function of the library.
pub(in crate::functions) struct Function {
    pub(in crate::functions) name: &'static str,
    /// Where it is, below `lib`.
    pub(in crate::functions) module: &'static str,
    /// What makes four numbers of `v`, four numbers that are given.
    pub(in crate::functions) call: &'static str,
    /// What it promises, and of what.
    pub(in crate::functions) reason: &'static str,
    /// What it is given beside numbers.
    pub(in crate::functions) given: Given,
    /// Which arguments it takes.
    pub(in crate::functions) takes: fn([f32; 4]) -> bool,
    pub(in crate::functions) truth: fn([f64; 4]) -> [f64; 4],
    /// Largest error in units in the last place of the exact number,
    pub(in crate::functions) ulps: f64,
    /// or of this number, if that is more.
    pub(in crate::functions) scale: f64,
}

pub(in crate::functions) fn finite(v: [f32; 4]) -> bool {
    v[0].is_finite()
}

pub(in crate::functions) fn any(_: [f32; 4]) -> bool {
    true
}

/// All of them.
pub(in crate::functions) fn functions() -> impl Iterator<Item = &'static Function> {
    [numbers::FUNCTIONS, images::FUNCTIONS, rooms::FUNCTIONS]
        .into_iter()
        .flatten()
}
