//! What the sanitiser looks at: see [`crate::sanitise`].

use naga::Span;

use super::{Arith, ImageAccess};

/// Something that a kernel computes or writes and a probe follows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Probed {
    /// Operands: the result, then what it is made of.
    Arith(Arith),
    /// A texel that is written. Operands: its four channels.
    Texel(ImageAccess),
    /// What a fragment gives for a target. Operands: its channels.
    Colour(u32),
    /// A word of a buffer that is written. Operand: the number.
    Word,
}

/// A probe of a program.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Probe {
    pub(crate) probed: Probed,
    pub(crate) span: Span,
}

/// A result that is moved within what WGSL allows. Operands: the result, what it is
/// made of, and the factors of the product among that, if any.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) struct Perturbed {
    pub(crate) op: Arith,
    /// Which one of the program it is.
    pub(crate) site: u32,
    /// Which operand of a sum or difference is a product.
    pub(crate) product: Option<u8>,
}

impl Arith {
    /// Whether the sanitiser has something to say of it: what rounds, what throws
    /// digits away on purpose, what decides, and what may make a NaN vanish.
    pub(crate) fn is_probed(self) -> bool {
        self.decides() || self.indexes() || self.may_round() || self.drops_digits()
    }

    /// A comparison of numbers.
    pub(crate) fn decides(self) -> bool {
        matches!(self, Self::EqF | Self::NeF | Self::LtF | Self::LeF)
    }

    /// A conversion to an integer.
    pub(crate) fn indexes(self) -> bool {
        matches!(self, Self::FToS | Self::FToU)
    }

    /// Rounding to an integer that stays a number, or to a sign.
    pub(crate) fn drops_digits(self) -> bool {
        matches!(
            self,
            Self::FloorF | Self::CeilF | Self::TruncF | Self::RoundF | Self::SignF
        )
    }

    /// Gives one of its operands, whichever.
    pub(crate) fn chooses(self) -> bool {
        matches!(
            self,
            Self::MinF | Self::MaxF | Self::AtMostF | Self::AtLeastF | Self::SelectF
        )
    }

    /// Whether the result may be another number than that of exact arithmetic, or
    /// one of several operands.
    fn may_round(self) -> bool {
        self.chooses()
            || matches!(
                self,
                Self::AddF
                    | Self::SubF
                    | Self::MulF
                    | Self::DivF
                    | Self::RemF
                    | Self::PowF
                    | Self::Atan2F
                    | Self::LdexpF
                    | Self::MulAddF
                    | Self::MulSubF
                    | Self::SubMulF
                    | Self::SqrtF
                    | Self::ExpF
                    | Self::Exp2F
                    | Self::LogF
                    | Self::Log2F
                    | Self::SinF
                    | Self::CosF
                    | Self::TanF
                    | Self::AsinF
                    | Self::AcosF
                    | Self::AtanF
                    | Self::SinhF
                    | Self::CoshF
                    | Self::TanhF
                    | Self::AsinhF
                    | Self::AcoshF
                    | Self::AtanhF
                    | Self::SToF
                    | Self::UToF
            )
    }
}
