//! What kernels mean: what the interpreter computes for each part of WGSL, and
//! what it does where WGSL leaves a choice.
//!
//! Sections (§) are those of the WebGPU Shading Language specification unless
//! Vulkan is named. All results are the same on every instruction set, at any
//! number of threads and of lanes, save for the payload of NaNs, and save for
//! what a kernel leaves to a race between its invocations.
//!
//! # Scalars and vectors
//!
//! | type | is | section |
//! |---|---|---|
//! | `f32` | IEEE 754 binary32 with subnormals, infinities and NaN | §15.7.2 |
//! | `f16` | binary16: each operation's result is rounded to it, nearest even | §15.7.2 |
//! | `i32`, `u32` | 32 bits, two's complement; all arithmetic wraps | §8.7 |
//! | `bool` | all bits of a lane set or clear | |
//!
//! WGSL lets an implementation flush subnormals and ignore infinities and NaN
//! (§15.7.2); the interpreter keeps all of them.
//!
//! An `f16` is computed in binary32 and rounded. For `+ - * /` and `sqrt` this
//! is the correctly rounded result, because 24 bits of mantissa are at least
//! twice the 11 of binary16 and two more. For other functions it is the
//! binary32 result rounded once more.
//!
//! WGSL has no integers of 16 bits. naga makes the exponent of an `f16`'s `frexp`
//! an `i16`, and its bit casts keep the width, so that `f16` becomes `i16` or
//! `u16`; those can be converted to other numbers, compared, selected, kept in
//! variables and cast back, and nothing else. That is for modules given to
//! [`Program::from_module`](crate::Program::from_module): kernels of a graph can
//! have neither, see [`etalon_core::kernel`].
//!
//! # Operators
//!
//! | operator | result | section |
//! |---|---|---|
//! | `+ - *` on floats | correctly rounded, never fused | §15.7.4 |
//! | `/` on floats | correctly rounded; by zero gives an infinity or NaN | §15.7.4 |
//! | `%` on floats | `x - y * trunc(x / y)`, each step rounded | §8.7 |
//! | `/` on integers | toward zero; `x / 0` is `x`, the least `i32` by -1 is itself | §8.7 |
//! | `%` on integers | sign of the dividend; `x % 0` is 0, the least `i32` by -1 gives 0 | §8.7 |
//! | `<< >>` | the amount is taken modulo 32; `>>` of an `i32` keeps the sign | §8.9 |
//! | comparisons | false with a NaN, except `!=`; `-0.0 == 0.0` | §8.8 |
//! | `&& \|\|` | the right side runs only where it decides | §8.6 |
//! | matrix products | each component summed from the first column on, each product and sum rounded | §8.7 |
//!
//! # Conversions and bits (§8.2, §15.7.6, §17.1, §17.2)
//!
//! * Float to integer truncates; what is out of range gives the nearest number
//!   that the float's type has as well, so from `f32` 2147483520 for `i32` and
//!   4294967040 for `u32` at the upper end, and 65504 from `f16`; NaN gives 0.
//! * Integer to float rounds to nearest even. An integer beyond `f16`'s largest
//!   number becomes an infinity.
//! * `f32` to `f16` rounds to nearest even, with subnormals; from 65520 on the
//!   result is an infinity.
//! * `bitcast` keeps bits, those of NaNs included, between `f32`, `i32` and `u32`,
//!   and between numbers of 16 bits; but a signalling NaN of `f16` is made quiet
//!   where it is loaded.
//!
//! # Numeric built-ins (§17.5)
//!
//! | function | computed as |
//! |---|---|
//! | `abs ceil floor trunc sign` | exactly; `sign` of NaN is 0 |
//! | `round` | to nearest, ties to even |
//! | `min max` | the other operand if one is NaN; of two zeros the second |
//! | `clamp(e, low, high)` | `min(max(e, low), high)`, also where `low > high` |
//! | `saturate` | `clamp(e, 0, 1)`; NaN gives 0 |
//! | `fract` | `e - floor(e)`: may be 1 just below an integer |
//! | `modf` | `trunc(e)` and `e - trunc(e)` |
//! | `frexp` | a fraction in [0.5, 1) and an exponent; zero, infinity and NaN give themselves and 0 |
//! | `ldexp` | one rounding, also into subnormals |
//! | `sqrt` | correctly rounded |
//! | `inverseSqrt` | `1 / sqrt(e)` |
//! | `exp exp2 log log2 sin cos` | the binary64 result rounded to binary32: right but next to half way between two numbers |
//! | `tan asin acos atan atan2 sinh cosh tanh asinh acosh atanh` | the same |
//! | `pow(x, y)` | `exp2(y * log2(x))` in more than binary32; negative `x` gives NaN |
//! | `degrees radians` | one product with the rounded factor |
//! | `fma` | `a * b + c` with two roundings, as §15.7.4 allows; of `f16` the sum is rounded, to binary32 and then to binary16 |
//! | `mix(a, b, t)` | `a * (1 - t) + b * t` |
//! | `step(edge, x)` | 1 where `edge <= x`, else 0, also for NaN |
//! | `smoothstep` | `t * t * (3 - 2 * t)` of `t = clamp((x - low) / (high - low), 0, 1)` |
//! | `dot` | products summed from the first component on, each step rounded |
//! | `length distance` | `sqrt(dot(v, v))`, which may overflow; of a scalar its `abs` |
//! | `normalize` | each component divided by the length; a zero vector gives NaN |
//! | `cross reflect refract faceForward` | as their definitions are written, each step rounded; total internal reflection gives 0 |
//! | `determinant` | by cofactors of the first column |
//! | `transpose` | exactly |
//! | `quantizeToF16` | to nearest even; overflow gives an infinity |
//! | `countOneBits countLeadingZeros countTrailingZeros reverseBits` | exactly; zero has 32 zeros |
//! | `firstLeadingBit firstTrailingBit` | -1 where there is none |
//! | `extractBits insertBits` | offset and count are brought into the 32 bits as the text says |
//! | `dot4I8Packed dot4U8Packed` | the sum wraps |
//! | `pack4x8snorm` and kin | `floor(0.5 + scale * clamp(e))` (§17.9) |
//! | `unpack4x8snorm` and kin | division by the scale, rounded once, at least -1 (§17.10) |
//! | `select` | lane by lane, both sides evaluated |
//!
//! # Memory (§14)
//!
//! Layout is that of §14.4.1: an `f16` takes 2 bytes, vectors are aligned to
//! two or four components, columns of matrices as vectors are. Stores of `f16`
//! leave the other half of a word alone, whoever writes it.
//!
//! An index out of range is brought into it: as an unsigned number, at most
//! the last element's, for values, variables and buffers alike. `arrayLength`
//! is the number of whole elements of the buffer bound. Variables start as zero
//! (§14.3); so does workgroup memory, for every workgroup.
//!
//! Atomic operations (§17.8) are done for one active invocation after the
//! other, in the order of `local_invocation_index`. If a kernel looks at the
//! old value of an atomic operation on a buffer, its workgroups run one after
//! the other, so that its results do not depend on the number of threads.
//! `atomicCompareExchangeWeak` fails only if the values differ.
//!
//! `var<immediate>` is given to
//! [`Program::dispatch_with_immediates`](crate::Program::dispatch_with_immediates)
//! as bytes, laid out as a storage buffer is.
//!
//! # Control flow and synchronisation
//!
//! Invocations of a workgroup run in step, and come together again at the end
//! of the branch, loop or call in which they parted. A barrier that only some
//! invocations of a workgroup reach fails the dispatch with
//! [`RunError::DivergentBarrier`](crate::RunError::DivergentBarrier); so does
//! `workgroupUniformLoad`, which is a load between two barriers (§17.11). A
//! loop that repeats more often than the executor allows fails it with
//! [`RunError::EndlessLoop`](crate::RunError::EndlessLoop). `subgroupBarrier`
//! does nothing, as a subgroup is in step anyway.
//!
//! # Textures (§17.7)
//!
//! | function | inside | outside |
//! |---|---|---|
//! | `textureLoad` | the texel, decoded as [`etalon_core::texel`] does | all channels 0, as also for a level or layer that is not there |
//! | `textureStore` | encoded as [`etalon_core::texel`] does | nothing is written |
//! | `textureAtomic*` | one invocation after the other | nothing is done |
//! | `textureDimensions` | the size of the level | 0 for a level that is not there |
//!
//! Channels that a format has not are 0, 0 and 1. A `texture_1d` is bound to a
//! two-dimensional texture of height 1 and one layer.
//!
//! ## Filtered reads
//!
//! `textureSampleLevel`, `textureSampleGrad`, `textureSampleCompareLevel`,
//! `textureSampleBaseClampToEdge` and the gathers follow Vulkan 1.3, §16.
//! Coordinates, levels and weights are `f32` in every number type; there is no
//! coarser fixed-point weight as in devices.
//!
//! * *Level of detail* (§16.7): the one given, or `log2` of the longer
//!   derivative in texels of the first level, without anisotropy; on cubes
//!   after the derivatives were transformed to the face. It is then clamped to
//!   the sampler's range; NaN becomes the least of it. Up to 0 it selects the
//!   magnifying filter, above it the minifying one.
//! * *Mips*: the nearest one, of two equally near the finer one; or the two
//!   around, by the fraction. A level that has no weight is not read.
//! * *Texels* (§16.8, §16.9): the coordinate times the size, less a half with a
//!   linear filter; its floor, plus the offset, is the first texel and its
//!   fraction the weight of the second. Then each is clamped, repeated or
//!   mirrored. The sum runs over x first, then y, then z. A weight of exactly 0
//!   still multiplies its texel, so that an infinity or NaN next to the place
//!   shows.
//! * *Layers* and cubes are clamped to those there are.
//! * *Cubes*: of equal components z decides before y, y before x. Texels over an
//!   edge are those of the neighbouring face; over a corner, the mean of the
//!   other three, as Vulkan recommends.
//! * *Comparison*: `reference OP texel` gives 1 or 0, which are then filtered. A
//!   reference for `depth16unorm` is first clamped to [0, 1].
//! * *Gathers* read the four texels that a linear filter would read of the first
//!   level, whatever the sampler's filters.
//! * *Offsets* are constants from -8 to 7.
//! * `textureSampleBaseClampToEdge` keeps coordinates half a texel of the first
//!   level from its edges.
//!
//! # Subgroups (§17.12, §17.13)
//!
//! A subgroup is [`Executor::with_subgroup_size`](crate::Executor::with_subgroup_size)
//! invocations in the order of `local_invocation_index`; the last one of a
//! workgroup may have fewer. Only active invocations take part. Sums and
//! products of floats start from the first one and are rounded at each step, those
//! of `f16` to binary32, and once more to binary16 at the end. A
//! shuffle or broadcast from an invocation that is not there or not active
//! gives 0. A quad is four consecutive invocations.
//!
//! # Number types and checks
//!
//! All of this is said of [`NumberType::F32`](crate::NumberType::F32), which
//! computes as devices do; the other types document how they differ. An `f16`
//! is rounded to binary16 in every type.
//!
//! [`Checks`](crate::Checks) report what is defined here but seldom meant: an
//! index that was brought into range, a division by zero, a shift by too much,
//! a race. What is computed is the same with and without them.
//!
//! # What gives a typed error
//!
//! [`TranslateError::Unsupported`](crate::TranslateError::Unsupported), with
//! its place: scalars of 64 bits, arithmetic on integers of 16 bits, conversions to
//! them and buffers of them, multisampled and external textures, arrays of
//! textures, texel formats that [`etalon_core::Format`] has not, ray queries,
//! atomic operations on floats, cooperative matrices, and implicit levels of detail
//! and derivatives, which validation refuses in compute shaders before.
//!
//! [`TranslateError::Invalid`](crate::TranslateError::Invalid): overrides that
//! were not resolved, texel offsets out of range.
//!
//! [`TranslateError::TooLarge`](crate::TranslateError::TooLarge): workgroups of
//! more than 1024 invocations, and what does not fit the bytecode.
