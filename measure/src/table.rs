//! Measurements as text.

use crate::compare::Row;

/// The heading of a table of rows.
#[must_use]
pub fn heading(row: &Row) -> String {
    let mut line = format!("{:<34}", "kernel (dispatches)");
    let mut under = format!("{:<34}", "");
    for (index, column) in row.columns.iter().enumerate() {
        let name: String = column.executor.chars().take(18).collect();
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
