//! Products of vectors and matrices, and functions of matrices.

use super::super::accuracy::{Reals, Table};
use super::super::exact::Exact;
use super::super::float::{FloatType, power_of_two};
use super::super::interval::Interval;
use super::super::operation::{Meaning, Operation, Scalar, Shape, rule};
use super::super::{formulas, inputs};
use super::vector::inherited;
use super::{rounded, whole, word};

const PRODUCT: &str = "§8.7: each element is the dot product of a row and a column; §15.7.4.1: inherited from the sum of products, in any order";

/// Adds all of them for a type.
pub(super) fn add(all: &mut Vec<Operation>, ty: FloatType) {
    products(all, ty);
    elementwise(all, ty);
    for n in 2..=4 {
        determinant(all, ty, n);
    }
    for (columns, rows) in [(2, 2), (2, 3), (4, 2), (3, 3), (4, 4)] {
        transpose(all, ty, columns, rows);
    }
}

/// The element of a product: the dot product of row `row` of a matrix of
/// `columns` columns with `vector`.
fn row<T: Copy>(matrix: &[T], rows: usize, row: usize) -> Vec<T> {
    matrix.iter().skip(row).step_by(rows).copied().collect()
}

fn products(all: &mut Vec<Operation>, ty: FloatType) {
    let s = Scalar::from(ty);
    // Matrices of `columns` and `rows` times `right` columns; 0 is a vector.
    for (columns, rows, right) in [
        (2, 2, 0),
        (3, 3, 0),
        (4, 4, 0),
        (2, 3, 0),
        (4, 2, 0),
        (2, 2, 2),
        (3, 3, 3),
        (4, 4, 4),
        (3, 2, 2),
        (2, 4, 3),
    ] {
        let matrix = Shape::Matrix(columns, rows);
        let (second, result) = match right {
            0 => (Shape::Vector(columns), Shape::Vector(rows)),
            _ => (Shape::Matrix(right, columns), Shape::Matrix(right, rows)),
        };
        let split = matrix.count();
        fn product<A: super::super::accuracy::Arithmetic>(
            a: &A,
            x: &[A::Value],
            split: usize,
            columns: usize,
            rows: usize,
        ) -> Vec<A::Value> {
            let (left, right) = x.split_at(split);
            right
                .chunks(columns)
                .flat_map(|column| {
                    (0..rows).map(|index| formulas::dot(a, &row(left, rows, index), column))
                })
                .collect()
        }
        all.push(whole(
            format!("a * b, {} and {}", matrix.of(s), second.of(s)),
            PRODUCT,
            vec![(matrix, s), (second, s)],
            vec![("a * b", result, s)],
            inputs::mostly_ordinary(ty, split + second.count(), 51),
            inherited(
                ty,
                move |t, x| product(&t, x, split, columns, rows),
                move |x| product(&Reals, x, split, columns, rows),
            ),
        ));
    }
    for (columns, rows) in [(2, 2), (3, 3), (4, 4), (3, 2)] {
        let matrix = Shape::Matrix(columns, rows);
        all.push(whole(
            format!("a * b, vec{rows}<{}> and {}", s.name(), matrix.of(s)),
            PRODUCT,
            vec![(Shape::Vector(rows), s), (matrix, s)],
            vec![("a * b", Shape::Vector(columns), s)],
            inputs::mostly_ordinary(ty, rows + matrix.count(), 52),
            inherited(
                ty,
                move |t, x| {
                    let (vector, matrix) = x.split_at(rows);
                    let columns = matrix.chunks(rows);
                    columns
                        .map(|column| formulas::dot(&t, vector, column))
                        .collect()
                },
                move |x| {
                    let (vector, matrix) = x.split_at(rows);
                    let columns = matrix.chunks(rows);
                    columns
                        .map(|column| formulas::dot(&Reals, vector, column))
                        .collect()
                },
            ),
        ));
    }
}

/// Operators that work element by element.
fn elementwise(all: &mut Vec<Operation>, ty: FloatType) {
    let s = Scalar::from(ty);
    let accuracy = "§8.7: element by element; §15.7.4.1: correctly rounded";
    for shape in [
        Shape::Vector(2),
        Shape::Vector(3),
        Shape::Vector(4),
        Shape::Matrix(2, 3),
        Shape::Matrix(4, 4),
    ] {
        let count = shape.count();
        let scaled = |first: usize, scalar: usize| -> Vec<(Scalar, Meaning)> {
            (0..count)
                .map(|i| {
                    let i = i + first;
                    let meaning = rounded(
                        ty,
                        move |x: &[Exact]| x[i] * x[scalar],
                        move |x: &[f32]| x[i] * x[scalar],
                    );
                    (s, meaning)
                })
                .collect()
        };
        for (name, parameters, meanings) in [
            (
                format!("a * b, {} and {}", shape.of(s), s.name()),
                vec![(shape, s), (Shape::Scalar, s)],
                scaled(0, count),
            ),
            (
                format!("a * b, {} and {}", s.name(), shape.of(s)),
                vec![(Shape::Scalar, s), (shape, s)],
                scaled(1, 0),
            ),
        ] {
            all.push(
                whole(
                    name,
                    accuracy,
                    parameters,
                    vec![("a * b", shape, s)],
                    inputs::mostly_ordinary(ty, count + 1, 53),
                    rule(vec![s; count + 1], meanings),
                )
                .strict(),
            );
        }
    }
    for shape in [Shape::Matrix(3, 2), Shape::Matrix(4, 4)] {
        let count = shape.count();
        let sum = (0..count).map(|i| {
            let meaning = rounded(
                ty,
                move |x: &[Exact]| x[i] + x[count + i],
                move |x: &[f32]| x[i] + x[count + i],
            );
            (s, meaning)
        });
        let difference = (0..count).map(|i| {
            let meaning = rounded(
                ty,
                move |x: &[Exact]| x[i] - x[count + i],
                move |x: &[f32]| x[i] - x[count + i],
            );
            (s, meaning)
        });
        for (code, meanings) in [
            ("a + b", sum.collect::<Vec<_>>()),
            ("a - b", difference.collect()),
        ] {
            all.push(
                whole(
                    format!("{code}, {}", shape.of(s)),
                    accuracy,
                    vec![(shape, s), (shape, s)],
                    vec![(code, shape, s)],
                    inputs::mostly_ordinary(ty, 2 * count, 54),
                    rule(vec![s; 2 * count], meanings),
                )
                .strict(),
            );
        }
    }
}

/// All permutations of 0 to n - 1 with their signs.
fn permutations(n: usize) -> Vec<(Vec<usize>, f64)> {
    if n == 0 {
        return vec![(Vec::new(), 1.0)];
    }
    permutations(n - 1)
        .into_iter()
        .flat_map(|(shorter, sign)| {
            (0..n).map(move |place| {
                let mut longer = shorter.clone();
                longer.insert(place, n - 1);
                let crossed = n - 1 - place;
                (
                    longer,
                    if crossed.is_multiple_of(2) {
                        sign
                    } else {
                        -sign
                    },
                )
            })
        })
        .collect()
}

/// WGSL bounds no error of determinants. What a sum of products gives in any
/// order is nevertheless known (Higham 2002, §3.1): with `k` roundings on the
/// way of each product of elements, each of at most a relative u, the error is
/// at most γ_k = k u / (1 - k u) times the sum of the products' magnitudes.
fn determinant(all: &mut Vec<Operation>, ty: FloatType, n: usize) {
    let s = Scalar::from(ty);
    let terms = permutations(n);
    let leibniz = {
        let terms = terms.clone();
        move |x: &[Exact]| {
            terms
                .iter()
                .fold(Exact::new(0.0), |sum, (permutation, sign)| {
                    let product = permutation
                        .iter()
                        .enumerate()
                        .fold(Exact::new(*sign), |product, (column, row)| {
                            product * x[column * n + row]
                        });
                    sum + product
                })
        }
    };
    let exact = leibniz.clone();
    let bound = move |table: Table, x: &[Interval]| {
        let products = terms.iter().map(|(permutation, _)| {
            permutation
                .iter()
                .enumerate()
                .map(|(column, row)| x[column * n + row].magnitude())
                .product::<f64>()
        });
        let magnitude: f64 = products.sum();
        let roundings = (2 * n + terms.len()) as f64;
        let unit = table.of(power_of_two(-23), power_of_two(-10)) * roundings;
        // Each operation may also lose what is subnormal, times the elements.
        let largest = x
            .iter()
            .fold(1.0, |largest: f64, x| largest.max(x.magnitude()));
        let lost = roundings * ty.smallest_normal() * largest.powi(n as i32) * terms.len() as f64;
        if largest.powi(n as i32) * terms.len() as f64 > ty.largest() {
            return vec![Interval::ANY];
        }
        let value = leibniz(&x.iter().map(|x| Exact::new(x.high)).collect::<Vec<_>>());
        vec![table.absolute(value, value, unit / (1.0 - unit) * magnitude + lost)]
    };
    all.push(whole(
        format!("determinant(a), {}", Shape::Matrix(n, n).of(s)),
        "§15.7.4.1: infinite ULP; held to the error bound of sums of products",
        vec![(Shape::Matrix(n, n), s)],
        vec![("determinant(a)", Shape::Scalar, s)],
        inputs::mostly_ordinary(ty, n * n, 55),
        inherited(ty, bound, move |x| vec![exact(x)]),
    ));
}

fn transpose(all: &mut Vec<Operation>, ty: FloatType, columns: usize, rows: usize) {
    let s = Scalar::from(ty);
    let count = columns * rows;
    let meanings = (0..count)
        .map(|i| {
            // The result has `rows` columns of `columns` elements.
            let (column, element) = (i / columns, i % columns);
            (s, word(move |x| x[element * rows + column]))
        })
        .collect();
    let shape = Shape::Matrix(columns, rows);
    all.push(
        whole(
            format!("transpose(a), {}", shape.of(s)),
            "§15.7.4.1: correctly rounded",
            vec![(shape, s)],
            vec![("transpose(a)", Shape::Matrix(rows, columns), s)],
            inputs::mostly_ordinary(ty, count, 56),
            rule(vec![s; count], meanings),
        )
        .strict(),
    );
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn permutations_have_their_signs() {
        let all = permutations(3);
        assert_eq!(all.len(), 6);
        let sign = |wanted: [usize; 3]| {
            all.iter()
                .find(|(permutation, _)| permutation[..] == wanted)
                .map(|(_, sign)| *sign)
        };
        assert_eq!(sign([0, 1, 2]), Some(1.0));
        assert_eq!(sign([1, 0, 2]), Some(-1.0));
        assert_eq!(sign([1, 2, 0]), Some(1.0));
        assert_eq!(sign([2, 1, 0]), Some(-1.0));
    }
}
