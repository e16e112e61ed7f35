//! Measurements as text.

use crate::compare::Row;

/// The heading of a table of rows.
#[must_use]
pub fn heading(row: &Row) -> String {
    let mut line = format!("{:<34}", "kernel (dispatches)");
    let mut under = format!("{:<34}", "");
    for (index, column) in row.columns.iter().enumerate() {
        // Devices have long names: "llvmpipe (LLVM 15.0.6, 256 bits)".
        let name = column.executor.split(" (").next().unwrap_or_default();
        let name: String = name.chars().take(18).collect();
        if index == 0 && is_reference(row) {
            line += &format!(" | {name:<18}");
            under += &format!(" | {:>8} {:>9}", "wall", "cpu ms");
        } else {
            line += &format!(" | {name:<31}");
            under += &format!(
                " | {:>8} {:>8} {:>6} {:>6}",
                "wall", "cpu ms", "×wall", "×cpu"
            );
        }
    }
    format!("{line}\n{under}")
}

/// Whether the first column is what the others are held against.
fn is_reference(row: &Row) -> bool {
    row.columns
        .first()
        .is_some_and(|column| target(row, &column.executor).is_none())
}

fn target(row: &Row, executor: &str) -> Option<f64> {
    match executor {
        "baseline" => Some(row.targets.baseline),
        "avx2" => Some(row.targets.avx2),
        "avx512" => Some(row.targets.avx512),
        _ => None,
    }
}

/// A row: ratios over their target are marked.
#[must_use]
pub fn line(row: &Row) -> String {
    let name = format!("{} {} ({})", row.arithmetic, row.kernel, row.dispatches);
    let mut line = format!("{name:<34}");
    let reference = row.columns.first().filter(|_| is_reference(row));
    for column in &row.columns {
        let median = column.median();
        let Some(target) = target(row, &column.executor) else {
            line += &format!(" | {:>8.3} {:>9.3}", median.wall, median.processor);
            continue;
        };
        line += &format!(" | {:>8.3} {:>8.3}", median.wall, median.processor);
        match reference {
            Some(reference) => {
                let ratio = column.ratio(reference);
                let mark = |ratio: f64| if ratio > target { '!' } else { ' ' };
                line += &format!(
                    " {:>5.2}{} {:>5.2}{}",
                    ratio.wall,
                    mark(ratio.wall),
                    ratio.processor,
                    mark(ratio.processor)
                );
            }
            None => line += &format!(" {:>6} {:>6}", "", ""),
        }
    }
    line
}

#[cfg(test)]
mod tests {
    use etalon_core::kernel::Arithmetic;

    use super::*;
    use crate::compare::{Column, Times};
    use crate::subjects::Targets;

    fn column(executor: &str, rounds: &[(f64, f64)]) -> Column {
        Column {
            executor: executor.to_owned(),
            rounds: rounds
                .iter()
                .map(|&(wall, processor)| Times { wall, processor })
                .collect(),
        }
    }

    fn row(columns: Vec<Column>) -> Row {
        Row {
            subject: "ssr".to_owned(),
            kernel: "ssr/march".to_owned(),
            dispatches: 1,
            arithmetic: Arithmetic::Strict,
            targets: Targets {
                baseline: 1.1,
                avx2: 0.65,
                avx512: 0.5,
            },
            repetitions: 1,
            columns,
        }
    }

    #[test]
    fn ratios_are_of_rounds_and_marked_over_their_target() {
        // The third round met something else on both.
        let reference = column("driver", &[(10.0, 20.0), (10.0, 20.0), (40.0, 80.0)]);
        let good = column("avx512", &[(4.0, 8.0), (5.0, 10.0), (19.0, 38.0)]);
        let bad = column("avx2", &[(7.0, 12.0), (7.0, 12.0), (28.0, 48.0)]);
        assert_eq!(good.median().wall, 5.0);
        assert!((good.ratio(&reference).wall - 0.475).abs() < 1e-12);
        let row = row(vec![reference, bad, good]);
        let line = line(&row);
        let cells: Vec<&str> = line.split(" | ").collect();
        assert_eq!(cells.len(), 4);
        assert_eq!(cells[0].trim(), "strict ssr/march (1)");
        assert_eq!(
            cells[2].split_whitespace().collect::<Vec<_>>(),
            ["7.000", "12.000", "0.70!", "0.60"]
        );
        assert_eq!(
            cells[3].split_whitespace().collect::<Vec<_>>(),
            ["5.000", "10.000", "0.47", "0.47"]
        );
        assert!(heading(&row).contains("driver"));
    }

    #[test]
    fn without_a_reference_there_are_no_ratios() {
        let row = row(vec![column("avx2", &[(7.0, 12.0)])]);
        assert!(!line(&row).contains('!'));
        assert_eq!(line(&row).split(" | ").count(), 2);
        assert_eq!(heading(&row).lines().count(), 2);
    }
}
