//! The expressions that accuracies are inherited from, word for word from the
//! table in WGSL §15.7.4.1.

use super::accuracy::Arithmetic;

/// `x - y * trunc(x / y)`.
pub fn remainder<A: Arithmetic>(a: &A, x: A::Value, y: A::Value) -> A::Value {
    a.sub(x, a.mul(y, a.trunc(a.div(x, y))))
}

/// `x * y + z`.
pub fn fma<A: Arithmetic>(a: &A, x: A::Value, y: A::Value, z: A::Value) -> A::Value {
    a.add(a.mul(x, y), z)
}

/// `x - floor(x)`.
pub fn fract<A: Arithmetic>(a: &A, x: A::Value) -> A::Value {
    a.sub(x, a.floor(x))
}

/// `x * 57.295779513082322865`.
pub fn degrees<A: Arithmetic>(a: &A, x: A::Value) -> A::Value {
    a.mul(x, a.constant(57.295_779_513_082_32))
}

/// `x * 0.017453292519943295474`.
pub fn radians<A: Arithmetic>(a: &A, x: A::Value) -> A::Value {
    a.mul(x, a.constant(0.017_453_292_519_943_295))
}

/// `x * (1.0 - z) + y * z`.
pub fn mix<A: Arithmetic>(a: &A, x: A::Value, y: A::Value, z: A::Value) -> A::Value {
    let rest = a.sub(a.constant(1.0), z);
    a.add(a.mul(x, rest), a.mul(y, z))
}

/// `t * t * (3.0 - 2.0 * t)`, where `t = clamp((x - edge0) / (edge1 - edge0), 0.0, 1.0)`.
pub fn smoothstep<A: Arithmetic>(a: &A, edge0: A::Value, edge1: A::Value, x: A::Value) -> A::Value {
    let t = a.saturate(a.div(a.sub(x, edge0), a.sub(edge1, edge0)));
    let slope = a.sub(a.constant(3.0), a.mul(a.constant(2.0), t));
    a.mul(a.mul(t, t), slope)
}

/// `exp2(y * log2(x))`.
pub fn pow<A: Arithmetic>(a: &A, x: A::Value, y: A::Value) -> A::Value {
    a.exp2(a.mul(y, a.log2(x)))
}

/// `sin(x) / cos(x)`.
pub fn tan<A: Arithmetic>(a: &A, x: A::Value) -> A::Value {
    a.div(a.sin(x), a.cos(x))
}

/// `sqrt(1.0 - x * x)`.
fn complement<A: Arithmetic>(a: &A, x: A::Value) -> A::Value {
    a.sqrt(a.sub(a.constant(1.0), a.mul(x, x)))
}

/// `atan2(x, sqrt(1.0 - x * x))`.
pub fn asin<A: Arithmetic>(a: &A, x: A::Value) -> A::Value {
    a.atan2(x, complement(a, x))
}

/// `atan2(sqrt(1.0 - x * x), x)`.
pub fn acos<A: Arithmetic>(a: &A, x: A::Value) -> A::Value {
    a.atan2(complement(a, x), x)
}

/// `(exp(x) - exp(-x)) * 0.5`.
pub fn sinh<A: Arithmetic>(a: &A, x: A::Value) -> A::Value {
    a.mul(a.sub(a.exp(x), a.exp(a.neg(x))), a.constant(0.5))
}

/// `(exp(x) + exp(-x)) * 0.5`.
pub fn cosh<A: Arithmetic>(a: &A, x: A::Value) -> A::Value {
    a.mul(a.add(a.exp(x), a.exp(a.neg(x))), a.constant(0.5))
}

/// `sinh(x) / cosh(x)`.
pub fn tanh<A: Arithmetic>(a: &A, x: A::Value) -> A::Value {
    a.div(sinh(a, x), cosh(a, x))
}

/// `log(x + sqrt(x * x + 1.0))`.
pub fn asinh<A: Arithmetic>(a: &A, x: A::Value) -> A::Value {
    a.log(a.add(x, a.sqrt(a.add(a.mul(x, x), a.constant(1.0)))))
}

/// `log(x + sqrt(x * x - 1.0))`.
pub fn acosh<A: Arithmetic>(a: &A, x: A::Value) -> A::Value {
    a.log(a.add(x, a.sqrt(a.sub(a.mul(x, x), a.constant(1.0)))))
}

/// `log((1.0 + x) / (1.0 - x)) * 0.5`.
pub fn atanh<A: Arithmetic>(a: &A, x: A::Value) -> A::Value {
    let one = a.constant(1.0);
    a.mul(a.log(a.div(a.add(one, x), a.sub(one, x))), a.constant(0.5))
}

/// The sum of `x[i] * y[i]`.
pub fn dot<A: Arithmetic>(a: &A, x: &[A::Value], y: &[A::Value]) -> A::Value {
    let products: Vec<A::Value> = x.iter().zip(y).map(|(&x, &y)| a.mul(x, y)).collect();
    a.sum(&products)
}

/// `sqrt(dot(x, x))`, and of a scalar `sqrt(x * x)`.
pub fn length<A: Arithmetic>(a: &A, x: &[A::Value]) -> A::Value {
    a.sqrt(dot(a, x, x))
}

/// `length(x - y)`.
pub fn distance<A: Arithmetic>(a: &A, x: &[A::Value], y: &[A::Value]) -> A::Value {
    let difference: Vec<A::Value> = x.iter().zip(y).map(|(&x, &y)| a.sub(x, y)).collect();
    length(a, &difference)
}

/// `x / length(x)`.
pub fn normalize<A: Arithmetic>(a: &A, x: &[A::Value]) -> Vec<A::Value> {
    let length = length(a, x);
    x.iter().map(|&x| a.div(x, length)).collect()
}

/// `x[i] * y[j] - x[j] * y[i]`.
pub fn cross<A: Arithmetic>(a: &A, x: &[A::Value], y: &[A::Value]) -> Vec<A::Value> {
    [(1, 2), (2, 0), (0, 1)]
        .iter()
        .map(|&(i, j)| a.sub(a.mul(x[i], y[j]), a.mul(x[j], y[i])))
        .collect()
}

/// `select(-x, x, dot(z, y) < 0.0)`.
pub fn face_forward<A: Arithmetic>(
    a: &A,
    x: &[A::Value],
    y: &[A::Value],
    z: &[A::Value],
) -> Vec<A::Value> {
    let facing = dot(a, z, y);
    x.iter()
        .map(|&x| a.if_negative(facing, x, a.neg(x)))
        .collect()
}

/// `x - 2.0 * dot(x, y) * y`.
pub fn reflect<A: Arithmetic>(a: &A, x: &[A::Value], y: &[A::Value]) -> Vec<A::Value> {
    let twice = a.mul(a.constant(2.0), dot(a, x, y));
    x.iter()
        .zip(y)
        .map(|(&x, &y)| a.sub(x, a.mul(twice, y)))
        .collect()
}

/// `z * x - (z * dot(y, x) + sqrt(k)) * y`, where
/// `k = 1.0 - z * z * (1.0 - dot(y, x) * dot(y, x))`; "if `k < 0.0` the result
/// is precisely 0.0".
pub fn refract<A: Arithmetic>(a: &A, x: &[A::Value], y: &[A::Value], z: A::Value) -> Vec<A::Value> {
    let (zero, one) = (a.constant(0.0), a.constant(1.0));
    let along = dot(a, y, x);
    let k = a.sub(one, a.mul(a.mul(z, z), a.sub(one, a.mul(along, along))));
    let factor = a.add(a.mul(z, along), a.sqrt(k));
    x.iter()
        .zip(y)
        .map(|(&x, &y)| {
            let bent = a.sub(a.mul(z, x), a.mul(factor, y));
            a.if_negative(k, zero, bent)
        })
        .collect()
}
