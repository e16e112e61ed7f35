//! Culling, depth, blending and what part of the targets is drawn to.

use std::hash::{Hash, Hasher};

use serde::{Deserialize, Serialize};
use thiserror::Error;

use crate::resource::Compare;

/// How vertices make triangles.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum Topology {
    /// Three vertices each.
    #[default]
    TriangleList,
    /// Each vertex after the first two makes a triangle with the two before it; of
    /// every second triangle the last two corners are exchanged, so that all face
    /// the same way and the first one stays that of flat inputs (Vulkan 1.3,
    /// §21.1.4). The largest index begins a new strip.
    TriangleStrip,
}

/// Which order of the corners, as seen in the picture, is that of a front.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum FrontFace {
    /// Counter-clockwise.
    #[default]
    CounterClockwise,
    /// Clockwise.
    Clockwise,
}

/// Which triangles are not drawn. Those without area never are.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum CullMode {
    /// All are drawn.
    #[default]
    None,
    /// Front-facing ones are not.
    Front,
    /// Back-facing ones are not.
    Back,
}

/// What is added to depths before they are compared.
///
/// `constant · r + slope · m`, limited to `clamp` away from zero, where `m` is
/// the larger of the depth's derivatives in x and y and `r` the unit in the last
/// place of the triangle's largest depth (of a fixed-point format, of any)
/// (Vulkan 1.3, §28.10.2; WebGPU, §23.2.6).
///
/// Compared and hashed by bits, so that states can be looked up.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub struct DepthBias {
    /// Times the unit in the last place.
    pub constant: i32,
    /// Times the slope.
    pub slope: f32,
    /// Over 0 the most that is added, under 0 the least, 0 no limit.
    pub clamp: f32,
}

impl DepthBias {
    fn bits(&self) -> (i32, u32, u32) {
        (self.constant, self.slope.to_bits(), self.clamp.to_bits())
    }
}

impl PartialEq for DepthBias {
    fn eq(&self, other: &Self) -> bool {
        self.bits() == other.bits()
    }
}

impl Eq for DepthBias {}

impl Hash for DepthBias {
    fn hash<H: Hasher>(&self, state: &mut H) {
        self.bits().hash(state);
    }
}

impl DepthBias {
    /// Whether nothing is added.
    #[must_use]
    pub fn is_none(&self) -> bool {
        self.constant == 0 && self.slope == 0.0
    }
}

/// How fragments are compared with the depth that is there.
///
/// With standard depth, 0 near and 1 far, [`Compare::Less`] draws what is
/// nearer; with reversed depth, 1 near and 0 far or at infinity,
/// [`Compare::Greater`] does.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub struct DepthState {
    /// `fragment OP depth` must hold for a fragment to be drawn.
    pub compare: Compare,
    /// Whether its depth replaces the one that is there.
    pub write: bool,
    /// What is added before.
    pub bias: DepthBias,
}

impl DepthState {
    /// Draws what is nearer, with reversed depth.
    pub const REVERSED: Self = Self {
        compare: Compare::Greater,
        write: true,
        bias: DepthBias {
            constant: 0,
            slope: 0.0,
            clamp: 0.0,
        },
    };

    /// Draws what is nearer, with standard depth.
    pub const STANDARD: Self = Self {
        compare: Compare::Less,
        ..Self::REVERSED
    };
}

/// What colours are multiplied by before they are combined.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum BlendFactor {
    /// 0.
    Zero,
    /// 1.
    One,
    /// The fragment's colour.
    Source,
    /// 1 − the fragment's colour.
    OneMinusSource,
    /// The fragment's alpha.
    SourceAlpha,
    /// 1 − the fragment's alpha.
    OneMinusSourceAlpha,
    /// The colour that is there.
    Target,
    /// 1 − the colour that is there.
    OneMinusTarget,
    /// The alpha that is there.
    TargetAlpha,
    /// 1 − the alpha that is there.
    OneMinusTargetAlpha,
}

/// How the two products are combined.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum BlendOperation {
    /// Fragment + target.
    Add,
    /// Fragment − target.
    Subtract,
    /// Target − fragment.
    ReverseSubtract,
    /// The lesser of the two colours; the factors are taken as 1.
    Min,
    /// The greater of the two colours; the factors are taken as 1.
    Max,
}

/// How one part of a colour is blended.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub struct BlendComponent {
    /// What the fragment is multiplied by.
    pub source: BlendFactor,
    /// What is there is multiplied by.
    pub target: BlendFactor,
    /// How both are combined.
    pub operation: BlendOperation,
}

impl BlendComponent {
    /// The fragment replaces what is there.
    pub const REPLACE: Self = Self {
        source: BlendFactor::One,
        target: BlendFactor::Zero,
        operation: BlendOperation::Add,
    };

    /// The fragment is added.
    pub const ADD: Self = Self {
        source: BlendFactor::One,
        target: BlendFactor::One,
        operation: BlendOperation::Add,
    };

    /// The fragment, already multiplied by its alpha, lies over what is there.
    pub const OVER: Self = Self {
        source: BlendFactor::One,
        target: BlendFactor::OneMinusSourceAlpha,
        operation: BlendOperation::Add,
    };
}

/// How fragments are blended with what is there.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub struct Blend {
    /// Red, green and blue.
    pub colour: BlendComponent,
    /// Alpha.
    pub alpha: BlendComponent,
}

impl Blend {
    /// Adds colour and alpha: light upon light.
    pub const ADD: Self = Self {
        colour: BlendComponent::ADD,
        alpha: BlendComponent::ADD,
    };

    /// Premultiplied colour over what is there.
    pub const OVER: Self = Self {
        colour: BlendComponent::OVER,
        alpha: BlendComponent::OVER,
    };

    /// Colour that is not premultiplied, over what is there.
    pub const ALPHA: Self = Self {
        colour: BlendComponent {
            source: BlendFactor::SourceAlpha,
            ..BlendComponent::OVER
        },
        alpha: BlendComponent::OVER,
    };
}

/// Which channels of a target are written.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub struct ColourWrites {
    /// The first channel.
    pub red: bool,
    /// The second.
    pub green: bool,
    /// The third.
    pub blue: bool,
    /// The fourth.
    pub alpha: bool,
}

impl ColourWrites {
    /// All.
    pub const ALL: Self = Self {
        red: true,
        green: true,
        blue: true,
        alpha: true,
    };

    /// None.
    pub const NONE: Self = Self {
        red: false,
        green: false,
        blue: false,
        alpha: false,
    };
}

impl Default for ColourWrites {
    fn default() -> Self {
        Self::ALL
    }
}

/// How a draw writes one colour target.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub struct TargetState {
    /// How it is blended; without it the fragment replaces what is there.
    pub blend: Option<Blend>,
    /// Which channels are written.
    pub writes: ColourWrites,
}

/// What a draw does beside its kernel.
#[derive(Clone, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub struct RasterState {
    /// How vertices make triangles.
    pub topology: Topology,
    /// Which order of corners is that of a front.
    pub front: FrontFace,
    /// Which triangles are left out.
    pub cull: CullMode,
    /// How depth is compared; without it, it is neither compared nor written.
    pub depth: Option<DepthState>,
    /// One for each colour target of the pass, or none for all as by default.
    pub targets: Vec<TargetState>,
}

/// The part of the targets, in pixels, that clip space is mapped to.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Viewport {
    /// Left edge.
    pub x: f32,
    /// Top edge.
    pub y: f32,
    /// Pixels in x, over 0.
    pub width: f32,
    /// Pixels in y, over 0.
    pub height: f32,
    /// Depth of `z = 0`, from 0 to 1.
    pub near: f32,
    /// Depth of `z = w`, from 0 to 1, not under `near`.
    pub far: f32,
}

impl Hash for Viewport {
    fn hash<H: Hasher>(&self, state: &mut H) {
        [self.x, self.y, self.width, self.height, self.near, self.far]
            .map(f32::to_bits)
            .hash(state);
    }
}

impl Viewport {
    /// All of a target, depth from 0 to 1.
    #[must_use]
    pub fn of(width: u32, height: u32) -> Self {
        Self {
            x: 0.0,
            y: 0.0,
            width: width as f32,
            height: height as f32,
            near: 0.0,
            far: 1.0,
        }
    }
}

/// The part of the targets, in pixels, that is drawn to.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub struct Scissor {
    /// Left edge.
    pub x: u32,
    /// Top edge.
    pub y: u32,
    /// Pixels in x.
    pub width: u32,
    /// Pixels in y.
    pub height: u32,
}

/// Why a state is refused.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum RasterStateError {
    /// More or fewer targets than the pass has.
    #[error(
        "the state has {state} colour targets and the pass {pass}; it must have as many or none"
    )]
    Targets {
        /// Of the state.
        state: usize,
        /// Of the pass.
        pass: usize,
    },
    /// A depth bias that is not a number, or infinite.
    #[error("the depth bias's {what} is {value}; it must be finite")]
    Bias {
        /// Which number.
        what: &'static str,
        /// As given.
        value: f32,
    },
    /// A viewport that is empty, not finite, or reaches out of the targets.
    #[error(
        "the viewport {viewport:?} must be inside of the {width}×{height} pixels of the targets, over 0 pixels large, with 0 ≤ near ≤ far ≤ 1"
    )]
    Viewport {
        /// As given.
        viewport: Viewport,
        /// Of the targets.
        width: u32,
        /// Of the targets.
        height: u32,
    },
    /// A scissor that reaches out of the targets.
    #[error("the scissor {scissor:?} must be inside of the {width}×{height} pixels of the targets")]
    Scissor {
        /// As given.
        scissor: Scissor,
        /// Of the targets.
        width: u32,
        /// Of the targets.
        height: u32,
    },
}

impl RasterState {
    /// The state of one of the pass's targets.
    #[must_use]
    pub fn target(&self, index: usize) -> TargetState {
        self.targets.get(index).copied().unwrap_or_default()
    }

    /// Checks the state for a pass with so many colour targets.
    ///
    /// # Errors
    /// If it has others, or a depth bias that is not finite.
    pub fn validate(&self, targets: usize) -> Result<(), RasterStateError> {
        if !self.targets.is_empty() && self.targets.len() != targets {
            return Err(RasterStateError::Targets {
                state: self.targets.len(),
                pass: targets,
            });
        }
        if let Some(DepthState { bias, .. }) = self.depth {
            for (what, value) in [("slope", bias.slope), ("clamp", bias.clamp)] {
                if !value.is_finite() {
                    return Err(RasterStateError::Bias { what, value });
                }
            }
        }
        Ok(())
    }
}

impl Viewport {
    /// Checks that it lies in targets of so many pixels.
    ///
    /// # Errors
    /// If not, or if it is empty or its depths are not from 0 to 1.
    pub fn validate(&self, width: u32, height: u32) -> Result<(), RasterStateError> {
        // Written so that a NaN fails.
        let inside = |first: f32, size: f32, all: u32| {
            first >= 0.0 && size > 0.0 && f64::from(first) + f64::from(size) <= f64::from(all)
        };
        let fits = inside(self.x, self.width, width)
            && inside(self.y, self.height, height)
            && self.near >= 0.0
            && self.near <= self.far
            && self.far <= 1.0;
        if fits {
            Ok(())
        } else {
            Err(RasterStateError::Viewport {
                viewport: *self,
                width,
                height,
            })
        }
    }
}

impl Scissor {
    /// Checks that it lies in targets of so many pixels.
    ///
    /// # Errors
    /// If not.
    pub fn validate(&self, width: u32, height: u32) -> Result<(), RasterStateError> {
        let inside =
            |first: u32, size: u32, all: u32| first.checked_add(size).is_some_and(|end| end <= all);
        if inside(self.x, self.width, width) && inside(self.y, self.height, height) {
            Ok(())
        } else {
            Err(RasterStateError::Scissor {
                scissor: *self,
                width,
                height,
            })
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_state_has_as_many_targets_as_its_pass_or_none() {
        let mut state = RasterState::default();
        assert_eq!(state.validate(3), Ok(()));
        state.targets = vec![TargetState::default(); 2];
        assert_eq!(state.validate(2), Ok(()));
        assert!(state.validate(3).is_err());
    }

    #[test]
    fn biases_are_finite() {
        let mut depth = DepthState::REVERSED;
        for (slope, clamp, fine) in [
            (1.0, -1.0, true),
            (f32::NAN, 0.0, false),
            (0.0, f32::INFINITY, false),
        ] {
            (depth.bias.slope, depth.bias.clamp) = (slope, clamp);
            let state = RasterState {
                depth: Some(depth),
                ..RasterState::default()
            };
            assert_eq!(state.validate(0).is_ok(), fine);
        }
    }

    #[test]
    fn viewports_and_scissors_lie_in_their_targets() {
        let whole = Viewport::of(640, 360);
        assert_eq!(whole.validate(640, 360), Ok(()));
        let changes: [fn(&mut Viewport); 7] = [
            |view| view.x = 0.5,
            |view| view.y = f32::NAN,
            |view| view.width = 0.0,
            |view| view.height = f32::INFINITY,
            |view| view.near = -0.1,
            |view| view.far = 1.5,
            |view| (view.near, view.far) = (0.7, 0.3),
        ];
        for change in changes {
            let mut view = whole;
            change(&mut view);
            assert!(view.validate(640, 360).is_err(), "{view:?}");
        }
        let scissor = |x, width| Scissor {
            x,
            y: 0,
            width,
            height: 360,
        };
        assert_eq!(scissor(600, 40).validate(640, 360), Ok(()));
        assert_eq!(scissor(640, 0).validate(640, 360), Ok(()));
        assert!(scissor(600, 41).validate(640, 360).is_err());
        assert!(scissor(1, u32::MAX).validate(640, 360).is_err());
    }
}
