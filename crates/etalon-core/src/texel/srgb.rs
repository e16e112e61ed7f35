//! The sRGB transfer function, IEC 61966-2-1:1999 with the constants the
//! Khronos Data Format Specification gives.

/// Linear light from an sRGB-encoded value, both in `[0, 1]`. Values outside
/// are clamped, NaN gives NaN.
#[must_use]
pub fn srgb_to_linear(encoded: f64) -> f64 {
    let encoded = encoded.clamp(0.0, 1.0);
    if encoded <= 0.04045 {
        encoded / 12.92
    } else {
        ((encoded + 0.055) / 1.055).powf(2.4)
    }
}

/// The sRGB encoding of linear light, both in `[0, 1]`. Values outside are
/// clamped, NaN gives NaN.
#[must_use]
pub fn linear_to_srgb(linear: f64) -> f64 {
    let linear = linear.clamp(0.0, 1.0);
    if linear <= 0.003_130_8 {
        linear * 12.92
    } else {
        1.055 * linear.powf(1.0 / 2.4) - 0.055
    }
}
