//! Measurements as text.

use crate::clock::median;
use crate::compare::{Row, Times};

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

/// Rows of one arithmetic as a table in Markdown, for keeping: milliseconds on
/// the wall, and ratios to the first column, on the wall and by processor time.
/// Those over their target are bold.
#[must_use]
pub fn markdown(rows: &[Row]) -> String {
    let Some(first) = rows.first() else {
        return String::new();
    };
    let reference = is_reference(first);
    let mut head = "| kernel |".to_owned();
    let mut rule = "|---|".to_owned();
    for (index, column) in first.columns.iter().enumerate() {
        let name = column.executor.split(" (").next().unwrap_or_default();
        if reference && index > 0 {
            head += &format!(" {name} ms | × wall | × cpu |");
            rule += "---|---|---|";
        } else {
            head += &format!(" {name} ms |");
            rule += "---|";
        }
    }
    let mut text = format!("{head}\n{rule}\n");
    for row in rows {
        text += &format!("| {} |", row.kernel);
        for (index, column) in row.columns.iter().enumerate() {
            text += &format!(" {} |", digits(column.median().wall));
            if reference && index > 0 {
                let ratio = column.ratio(&row.columns[0]);
                let target = target(row, &column.executor).unwrap_or(f64::INFINITY);
                for ratio in [ratio.wall, ratio.processor] {
                    let strong = if ratio > target { "**" } else { "" };
                    text += &format!(" {strong}{ratio:.2}{strong} |");
                }
            }
        }
        text.push('\n');
    }
    text
}

/// How much ratios differed between the rounds of a row: the median over rows
/// and tiers, and the worst, on the wall and by processor time.
#[must_use]
pub fn spreads(rows: &[Row]) -> String {
    let of = |get: fn(&Times) -> f64| {
        let spreads: Vec<f64> = rows
            .iter()
            .filter(|row| is_reference(row))
            .flat_map(|row| {
                let others = row.columns.iter().skip(1);
                others.map(|column| get(&column.spread(&row.columns[0])))
            })
            .filter(|spread| spread.is_finite())
            .collect();
        let worst = spreads.iter().copied().fold(0.0, f64::max);
        format!("median {:.2}, worst {worst:.2}", median(&spreads))
    };
    format!(
        "largest over smallest ratio of a row: on the wall {}; by processor time {}",
        of(|times| times.wall),
        of(|times| times.processor)
    )
}

/// Three digits at least, two after the point at most.
fn digits(value: f64) -> String {
    if value >= 10.0 {
        format!("{value:.1}")
    } else {
        format!("{value:.2}")
    }
}

#[cfg(test)]
mod tests {
    use etalon_core::kernel::Arithmetic;

    use super::*;
    use crate::compare::Column;
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
    fn tables_in_markdown_have_the_same_figures() {
        let reference = column("driver (x)", &[(10.0, 20.0), (20.0, 40.0)]);
        let bad = column("avx2", &[(7.0, 12.0), (16.0, 24.0)]);
        let rows = [row(vec![reference, bad])];
        let text = markdown(&rows);
        let lines: Vec<&str> = text.lines().collect();
        assert_eq!(
            lines[0],
            "| kernel | driver ms | avx2 ms | × wall | × cpu |"
        );
        assert_eq!(lines[1].matches('|').count(), lines[0].matches('|').count());
        assert_eq!(lines[2], "| ssr/march | 15.0 | 11.5 | **0.75** | 0.60 |");
        // 0.8 over 0.7, and twice the same.
        assert!(spreads(&rows).contains("wall median 1.14, worst 1.14"));
        assert!(spreads(&rows).contains("processor time median 1.00"));
        assert_eq!(markdown(&[]), "");
    }

    #[test]
    fn without_a_reference_there_are_no_ratios() {
        let row = row(vec![column("avx2", &[(7.0, 12.0)])]);
        assert!(!line(&row).contains('!'));
        assert_eq!(line(&row).split(" | ").count(), 2);
        assert_eq!(heading(&row).lines().count(), 2);
    }
}
