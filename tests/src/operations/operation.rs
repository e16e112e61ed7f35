//! What an operation is: its kernel, its inputs, and what its results may be.

use super::accuracy::Table;
use super::exact::Exact;
use super::float::FloatType;
use super::interval::Interval;

/// A scalar type of WGSL. Every scalar travels in a word of its own: an `f16`
/// in the low half, a `bool` as 0 or 1.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Scalar {
    /// `f32`.
    F32,
    /// `f16`.
    F16,
    /// `i32`.
    I32,
    /// `u32`.
    U32,
    /// `bool`.
    Bool,
}

impl Scalar {
    /// As WGSL spells it.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::F32 => "f32",
            Self::F16 => "f16",
            Self::I32 => "i32",
            Self::U32 => "u32",
            Self::Bool => "bool",
        }
    }

    /// The floating-point type it is.
    #[must_use]
    pub const fn float(self) -> Option<FloatType> {
        match self {
            Self::F32 => Some(FloatType::F32),
            Self::F16 => Some(FloatType::F16),
            _ => None,
        }
    }

    /// A word as a person reads it: hexadecimal bits and the value.
    #[must_use]
    pub fn show(self, word: u32) -> String {
        match self {
            Self::F32 => format!("{word:#010x} ({:e})", f32::from_bits(word)),
            Self::F16 => format!("{word:#06x} ({:e})", FloatType::F16.decode(word)),
            Self::I32 => format!("{word:#x} ({})", word as i32),
            Self::U32 => format!("{word:#x} ({word})"),
            Self::Bool => (word != 0).to_string(),
        }
    }

    /// Whether two words are the same value; NaNs are all alike.
    #[must_use]
    pub fn same(self, a: u32, b: u32) -> bool {
        a == b
            || self
                .float()
                .is_some_and(|ty| ty.decode(a).is_nan() && ty.decode(b).is_nan())
    }

    /// Whether two words are zeros of different sign.
    #[must_use]
    pub fn differ_in_sign_of_zero(self, a: u32, b: u32) -> bool {
        self.float()
            .is_some_and(|ty| a != b && ty.decode(a) == 0.0 && ty.decode(b) == 0.0)
    }
}

impl From<FloatType> for Scalar {
    fn from(ty: FloatType) -> Self {
        match ty {
            FloatType::F32 => Self::F32,
            FloatType::F16 => Self::F16,
        }
    }
}

/// Scalars put together.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Shape {
    /// One.
    Scalar,
    /// A vector of so many.
    Vector(usize),
    /// A matrix of so many columns and rows.
    Matrix(usize, usize),
}

impl Shape {
    /// How many scalars there are.
    #[must_use]
    pub const fn count(self) -> usize {
        match self {
            Self::Scalar => 1,
            Self::Vector(count) => count,
            Self::Matrix(columns, rows) => columns * rows,
        }
    }

    /// The WGSL type.
    #[must_use]
    pub fn of(self, scalar: Scalar) -> String {
        let scalar = scalar.name();
        match self {
            Self::Scalar => scalar.to_owned(),
            Self::Vector(count) => format!("vec{count}<{scalar}>"),
            Self::Matrix(columns, rows) => format!("mat{columns}x{rows}<{scalar}>"),
        }
    }
}

/// How an operation is called.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Form {
    /// On scalars, and on four at a time in vectors: parameters and results are
    /// scalars. In the results' code `$i32` stands for `i32` or `vec4<i32>`,
    /// and so for every scalar.
    Componentwise,
    /// As it stands.
    Whole,
}

/// One result of an operation.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Output {
    /// WGSL of the parameters `a`, `b`, `c` and so on.
    pub code: String,
    /// Its shape.
    pub shape: Shape,
    /// Of what.
    pub scalar: Scalar,
}

/// What a result may be by the specification.
#[derive(Clone, Debug, PartialEq)]
pub enum Allowed {
    /// The specification leaves it open.
    Anything,
    /// A number in one of these intervals.
    Numbers(Vec<Interval>),
    /// One of these words.
    Words(Vec<u32>),
}

impl Allowed {
    /// Whether a word is allowed as a result.
    #[must_use]
    pub fn contains(&self, scalar: Scalar, word: u32) -> bool {
        match self {
            Self::Anything => true,
            Self::Words(words) => words.iter().any(|&other| scalar.same(word, other)),
            Self::Numbers(intervals) => match scalar.float() {
                Some(ty) => {
                    let value = ty.decode(word);
                    intervals.iter().any(|interval| interval.contains(value))
                }
                None => false,
            },
        }
    }

    /// In words, for a report.
    #[must_use]
    pub fn show(&self, scalar: Scalar) -> String {
        match self {
            Self::Anything => "anything".to_owned(),
            Self::Words(words) => {
                let shown: Vec<String> = words.iter().map(|&word| scalar.show(word)).collect();
                shown.join(" or ")
            }
            Self::Numbers(intervals) => {
                let shown: Vec<String> = intervals
                    .iter()
                    .map(|interval| format!("[{:e}, {:e}]", interval.low, interval.high))
                    .collect();
                shown.join(" or ")
            }
        }
    }
}

/// What is known about one result of one case.
#[derive(Clone, Debug, PartialEq)]
pub struct Expectation {
    /// What WGSL allows.
    pub allowed: Allowed,
    /// What the interpreter's result must be, bit for bit, if its semantics say
    /// so: IEEE 754 with rounding to the nearest even, nothing flushed. NaNs
    /// are all alike.
    pub bits: Option<u32>,
    /// What strict arithmetic allows besides that: results with subnormal
    /// inputs or outputs flushed to zero.
    pub flushed: Vec<u32>,
    /// The exact value, where errors can be measured in ULP: finite inputs, a
    /// normal result, nothing to flush.
    pub exact: Option<f64>,
    /// Whether NaN or infinity goes in or comes out, where WGSL promises
    /// nothing.
    pub special: bool,
}

/// Says what the results of a case are, in the order of the outputs' scalars.
pub type Rule = Box<dyn Fn(&[u32]) -> Vec<Expectation> + Send + Sync>;

/// One operation of WGSL on one choice of types.
pub struct Operation {
    /// Unique, like `x / y, f32`.
    pub name: String,
    /// Where WGSL says what is allowed, and what.
    pub accuracy: String,
    /// Shape and type of each parameter.
    pub parameters: Vec<(Shape, Scalar)>,
    /// What is computed.
    pub outputs: Vec<Output>,
    /// How it is called.
    pub form: Form,
    /// Whether strict kernels may have it.
    pub strict: bool,
    /// How many ULP the interpreter's own semantics allow, where that is less
    /// than WGSL does.
    pub own_ulps: Option<f64>,
    /// Inputs: for each case the words of all parameters.
    pub cases: Vec<Vec<u32>>,
    /// What the results may be.
    pub rule: Rule,
}

impl std::fmt::Debug for Operation {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Operation")
            .field("name", &self.name)
            .field("cases", &self.cases.len())
            .finish_non_exhaustive()
    }
}

impl Operation {
    /// The scalars of a case, in order.
    pub fn input_scalars(&self) -> impl Iterator<Item = Scalar> + '_ {
        self.parameters
            .iter()
            .flat_map(|&(shape, scalar)| std::iter::repeat_n(scalar, shape.count()))
    }

    /// The scalars of a result, in order.
    pub fn output_scalars(&self) -> impl Iterator<Item = Scalar> + '_ {
        self.outputs
            .iter()
            .flat_map(|output| std::iter::repeat_n(output.scalar, output.shape.count()))
    }

    /// How often each result is computed: componentwise operations twice.
    #[must_use]
    pub fn forms(&self) -> &'static [&'static str] {
        match self.form {
            Form::Componentwise => &["scalar", "vector"],
            Form::Whole => &["whole"],
        }
    }

    /// The inputs of a case as a person reads them.
    #[must_use]
    pub fn show_case(&self, case: &[u32]) -> String {
        let shown: Vec<String> = self
            .input_scalars()
            .zip(case)
            .map(|(scalar, &word)| scalar.show(word))
            .collect();
        shown.join(", ")
    }
}

/// The cases that a case may become by flushing subnormal inputs, itself first.
pub(crate) fn flushings(scalars: &[Scalar], case: &[u32]) -> Vec<Vec<u32>> {
    let mut all = vec![case.to_vec()];
    for (index, (&scalar, &word)) in scalars.iter().zip(case).enumerate() {
        if scalar
            .float()
            .is_some_and(|ty| ty.is_subnormal(ty.decode(word)))
        {
            for flushed in all.clone() {
                all.push(with(&flushed, index, flush(scalar, word)));
            }
        }
    }
    all
}

fn with(case: &[u32], index: usize, word: u32) -> Vec<u32> {
    let mut case = case.to_vec();
    case[index] = word;
    case
}

/// Zero with the sign of a float.
fn flush(scalar: Scalar, word: u32) -> u32 {
    match scalar {
        Scalar::F16 => word & 0x8000,
        _ => word & 0x8000_0000,
    }
}

/// What words mean to a result.
type WordsOf = dyn Fn(&[u32]) -> Words + Send + Sync;
/// What the table makes of numbers.
type TableOf = dyn Fn(Table, &[f64]) -> Vec<Interval> + Send + Sync;
/// What real arithmetic makes of numbers.
type ExactOf = dyn Fn(&[Exact]) -> Exact + Send + Sync;
/// What IEEE 754 makes of numbers.
type IeeeOf = dyn Fn(&[f32]) -> f32 + Send + Sync;

/// What a result means.
pub(crate) enum Meaning {
    /// A floating-point result.
    Float(Float),
    /// A result that is exactly one word, or one of several.
    Words(Box<WordsOf>),
}

/// A floating-point result of floating-point parameters.
pub(crate) struct Float {
    pub(crate) ty: FloatType,
    /// What the table allows for finite parameters: one of these intervals.
    pub(crate) table: Box<TableOf>,
    /// The exact value for finite parameters.
    pub(crate) exact: Box<ExactOf>,
    /// IEEE 754's result where it is not the exact one rounded: zeros, infinity
    /// and NaN. `None` where the interpreter's semantics promise no more than
    /// the table.
    pub(crate) ieee: Option<Box<IeeeOf>>,
}

/// What a result that is no number may be.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Words {
    /// By WGSL; `None` for anything.
    pub(crate) allowed: Option<Vec<u32>>,
    /// By the interpreter's semantics; `None` where those leave it open too.
    pub(crate) own: Option<u32>,
}

impl Words {
    /// The one right result.
    pub(crate) fn exactly(word: u32) -> Self {
        Self {
            allowed: Some(vec![word]),
            own: Some(word),
        }
    }

    /// Left open by WGSL, but not by the interpreter.
    pub(crate) fn open(own: u32) -> Self {
        Self {
            allowed: None,
            own: Some(own),
        }
    }

    /// Left open by both, as the payload of a NaN is.
    pub(crate) const ANYTHING: Self = Self {
        allowed: None,
        own: None,
    };
}

/// The rule of a componentwise operation with one meaning per output.
pub(crate) fn rule(scalars: Vec<Scalar>, outputs: Vec<(Scalar, Meaning)>) -> Rule {
    Box::new(move |case| {
        let alternatives = flushings(&scalars, case);
        outputs
            .iter()
            .map(|(scalar, meaning)| match meaning {
                Meaning::Float(float) => float.expect(&scalars, &alternatives),
                Meaning::Words(words) => expect_words(*scalar, &scalars, &alternatives, words),
            })
            .collect()
    })
}

/// The values of the floating-point scalars of a case; integers as they are.
fn values(scalars: &[Scalar], case: &[u32]) -> Vec<f64> {
    scalars
        .iter()
        .zip(case)
        .map(|(scalar, &word)| match scalar {
            Scalar::F32 | Scalar::F16 => scalar.float().map_or(0.0, |ty| ty.decode(word)),
            Scalar::I32 => f64::from(word as i32),
            Scalar::U32 | Scalar::Bool => f64::from(word),
        })
        .collect()
}

impl Float {
    fn expect(&self, scalars: &[Scalar], alternatives: &[Vec<u32>]) -> Expectation {
        let scalar = Scalar::from(self.ty);
        let all: Vec<Vec<f64>> = alternatives
            .iter()
            .map(|case| values(scalars, case))
            .collect();
        let first = &all[0];
        let finite = first.iter().all(|value| value.is_finite());
        let intervals: Vec<Interval> = all
            .iter()
            .flat_map(|values| {
                if finite {
                    (self.table)(Table(self.ty), values)
                } else {
                    vec![Interval::ANY]
                }
            })
            .collect();
        let allowed = if intervals.iter().any(|interval| interval.is_any()) {
            Allowed::Anything
        } else {
            Allowed::Numbers(intervals)
        };
        let bits = self.bits(first);
        let mut flushed: Vec<u32> = Vec::new();
        if let Some(bits) = bits {
            for values in &all {
                flushed.extend(self.bits(values));
                // Processors flush what is subnormal before it is rounded.
                if self.ty.is_subnormal(self.exact(values).head()) {
                    flushed.push(0);
                }
            }
            flushed.push(bits);
            for index in 0..flushed.len() {
                let value = self.ty.decode(flushed[index]);
                if self.ty.is_subnormal(value) {
                    flushed.push(flush(scalar, flushed[index]));
                }
            }
            // Once something was flushed, the sign of the zero is nobody's promise.
            if flushed.iter().any(|&word| word != bits) {
                for index in 0..flushed.len() {
                    if self.ty.decode(flushed[index]) == 0.0 {
                        flushed.push(flush(scalar, u32::MAX));
                        flushed.push(0);
                    }
                }
            }
            flushed.sort_unstable();
            flushed.dedup();
        }
        let exact = (finite && all.len() == 1)
            .then(|| self.exact(first).head())
            .filter(|exact| {
                exact.abs() <= self.ty.largest() && exact.abs() >= self.ty.smallest_normal()
            });
        let comes_out = bits.is_some_and(|bits| !self.ty.decode(bits).is_finite());
        Expectation {
            allowed,
            bits,
            flushed,
            exact,
            special: !finite || comes_out,
        }
    }

    fn exact(&self, values: &[f64]) -> Exact {
        let exact: Vec<Exact> = values.iter().map(|&value| Exact::new(value)).collect();
        (self.exact)(&exact)
    }

    /// IEEE 754's result, rounded to the nearest even.
    fn bits(&self, values: &[f64]) -> Option<u32> {
        let ieee = self.ieee.as_ref()?;
        if values.iter().all(|value| value.is_finite()) {
            let exact = self.exact(values);
            if exact.is_finite() && exact.head() != 0.0 {
                return Some(self.ty.encode(self.ty.nearest(exact)));
            }
        }
        // Parameters of either type are exact in f32.
        let parameters: Vec<f32> = values.iter().map(|&value| value as f32).collect();
        let value = f64::from(ieee(&parameters));
        Some(self.ty.encode(if value.is_finite() {
            self.ty.nearest(Exact::new(value))
        } else {
            value
        }))
    }
}

fn expect_words(
    scalar: Scalar,
    scalars: &[Scalar],
    alternatives: &[Vec<u32>],
    words: &WordsOf,
) -> Expectation {
    let all: Vec<Words> = alternatives.iter().map(|case| words(case)).collect();
    let mut allowed = Some(Vec::new());
    for one in &all {
        match (&mut allowed, &one.allowed) {
            (Some(allowed), Some(more)) => allowed.extend_from_slice(more),
            _ => allowed = None,
        }
    }
    let is_non_finite = |ty: FloatType, word: u32| !ty.decode(word).is_finite();
    let special = scalars
        .iter()
        .zip(&alternatives[0])
        .chain(all[0].own.iter().map(|own| (&scalar, own)))
        .any(|(scalar, &word)| scalar.float().is_some_and(|ty| is_non_finite(ty, word)));
    Expectation {
        allowed: allowed.map_or(Allowed::Anything, |mut words| {
            words.sort_unstable();
            words.dedup();
            Allowed::Words(words)
        }),
        bits: all[0].own,
        flushed: all.iter().filter_map(|words| words.own).collect(),
        exact: None,
        special,
    }
}
