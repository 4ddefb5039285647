//! What a measurement found, as a table for people and as one JSON object for scripts.

use std::fmt;

use serde::Serialize;
use serde_json::Value;

use super::figures::Spread;
use super::machine::Machine;
use crate::table::Table;

/// What a measurement found.
#[derive(Debug, Serialize)]
pub(super) struct Report {
    /// Name of the measurement.
    bench: &'static str,
    /// What it was asked to do.
    settings: Value,
    machine: Machine,
    sections: Vec<Section>,
    /// What a reader must know.
    notes: Vec<String>,
}

impl Report {
    /// A report without figures yet.
    pub(super) const fn new(bench: &'static str, settings: Value, machine: Machine) -> Self {
        Self { bench, settings, machine, sections: Vec::new(), notes: Vec::new() }
    }

    /// Adds figures.
    pub(super) fn section(&mut self, section: Section) {
        self.sections.push(section);
    }

    /// Adds something that a reader must know.
    pub(super) fn note(&mut self, note: impl Into<String>) {
        self.notes.push(note.into());
    }
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "armada bench {}", self.bench)?;
        writeln!(f, "{}", self.machine)?;
        for section in &self.sections {
            writeln!(f, "\n{section}")?;
        }
        if !self.notes.is_empty() {
            writeln!(f)?;
        }
        let notes: Vec<_> = self.notes.iter().map(|note| format!("- {note}")).collect();
        f.write_str(&notes.join("\n"))
    }
}

/// Figures of one kind: rows of what was measured, columns of what was looked at.
#[derive(Debug, Serialize)]
pub(super) struct Section {
    title: String,
    columns: Vec<String>,
    rows: Vec<Row>,
}

#[derive(Debug, Serialize)]
struct Row {
    name: String,
    cells: Vec<Cell>,
}

/// A figure over the pairs.
#[derive(Debug, Serialize)]
struct Cell {
    #[serde(flatten)]
    spread: Option<Spread>,
    /// In the order of the pairs.
    values: Vec<f64>,
}

impl Section {
    /// Figures with the unit in the title or in the names of the columns.
    pub(super) fn new(
        title: impl Into<String>,
        columns: impl IntoIterator<Item: Into<String>>,
    ) -> Self {
        let columns = columns.into_iter().map(Into::into).collect();
        Self { title: title.into(), columns, rows: Vec::new() }
    }

    /// Adds what was measured: for each pair, the figures in the order of the columns. What is not
    /// a number is left out.
    #[must_use]
    pub(super) fn row<C: AsRef<[f64]>>(mut self, name: impl Into<String>, pairs: &[C]) -> Self {
        let column = |column| pairs.iter().filter_map(move |p| p.as_ref().get(column).copied());
        let numbers = |index| column(index).filter(|value: &f64| !value.is_nan()).collect();
        let cells = (0..self.columns.len()).map(|index| Cell::of(numbers(index)));
        let row = Row { name: name.into(), cells: cells.collect() };
        self.rows.push(row);
        self
    }

    /// Adds the ratios, pair by pair, of the two rows that were added last. A pair whose
    /// reference is zero has none.
    #[must_use]
    pub(super) fn ratio(mut self) -> Self {
        let cells = match self.rows.as_slice() {
            [.., ours, reference] => {
                ours.cells.iter().zip(&reference.cells).map(|(a, b)| a.over(b)).collect()
            }
            _ => Vec::new(),
        };
        self.rows.push(Row { name: "ratio".to_owned(), cells });
        self
    }
}

impl Cell {
    fn of(values: Vec<f64>) -> Self {
        Self { spread: Spread::of(&values), values }
    }

    fn over(&self, reference: &Self) -> Self {
        let pairs = self.values.iter().zip(&reference.values);
        Self::of(pairs.filter(|(_, below)| **below > 0.0).map(|(a, b)| a / b).collect())
    }
}

impl fmt::Display for Section {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "{}", self.title)?;
        let mut titles = vec![""];
        titles.extend(self.columns.iter().map(String::as_str));
        let mut table = Table::new(&titles);
        for row in &self.rows {
            let mut cells = vec![format!("  {}", row.name)];
            cells.extend(row.cells.iter().map(ToString::to_string));
            table.row(cells);
        }
        table.fmt(f)
    }
}

impl fmt::Display for Cell {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.spread {
            None => f.write_str("-"),
            Some(Spread { median, .. }) if self.values.len() == 1 => f.write_str(&short(median)),
            Some(Spread { median, min, max }) => {
                write!(f, "{} ({}..{})", short(median), short(min), short(max))
            }
        }
    }
}

/// Three digits, more only before the point.
fn short(value: f64) -> String {
    let decimals = match value.abs() {
        0.0 => 0,
        size if size < 9.995 => 2,
        size if size < 99.95 => 1,
        _ => 0,
    };
    format!("{value:.decimals$}")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn section() -> Section {
        Section::new("time, µs", ["p50", "missed"])
            .row("ours", &[[3.0, 0.0], [2.0, 1.0], [4.0, 0.0]])
            .row("reference", &[[2.0, 0.0], [4.0, 0.0], [4.0, 0.0]])
            .ratio()
    }

    #[test]
    fn ratios_are_of_pairs_and_then_their_median() {
        let section = section();
        let ratio = &section.rows[2];
        assert_eq!(ratio.cells[0].values, [1.5, 0.5, 1.0]);
        let spread = ratio.cells[0].spread.expect("three pairs");
        assert_eq!((spread.median, spread.min, spread.max), (1.0, 0.5, 1.5));
        assert_eq!(ratio.cells[1].values, [0.0; 0], "nothing is a multiple of zero");
    }

    #[test]
    fn a_section_is_a_table_with_spreads() {
        let lines: Vec<_> = section().to_string().lines().map(str::to_owned).collect();
        assert_eq!(lines[0], "time, µs");
        assert_eq!(lines[1], "             p50                missed");
        assert_eq!(lines[2], "  ours       3.00 (2.00..4.00)  0 (0..1.00)");
        assert_eq!(lines[4], "  ratio      1.00 (0.50..1.50)  -");
    }

    #[test]
    fn numbers_have_three_digits() {
        let shown = [0.0, 0.123, 9.999, 12.345, 123.4, 12345.6].map(short);
        assert_eq!(shown, ["0", "0.12", "10.0", "12.3", "123", "12346"]);
    }
}
