//! Figures as text, and Markdown tables of them.

use crate::records::Row;
use crate::statistics::{Estimate, Spread};

/// What a column says of a row.
type Cell<'a, R> = Box<dyn Fn(&R) -> String + 'a>;

/// A Markdown table: its columns with their heads.
pub(crate) struct Table<'a, R> {
    columns: Vec<(String, Cell<'a, R>)>,
}

impl<'a, R> Table<'a, R> {
    pub(crate) fn new() -> Self {
        Self {
            columns: Vec::new(),
        }
    }

    /// A further column on the right.
    pub(crate) fn with(
        mut self,
        head: impl Into<String>,
        cell: impl Fn(&R) -> String + 'a,
    ) -> Self {
        self.columns.push((head.into(), Box::new(cell)));
        self
    }

    /// A further column, of figures with so many decimals.
    pub(crate) fn figures(
        self,
        head: impl Into<String>,
        decimals: usize,
        figure: impl Fn(&R) -> f64 + 'a,
    ) -> Self {
        self.with(head, move |row| format!("{:.decimals$}", figure(row)))
    }

    /// The table of `rows`, in their order.
    pub(crate) fn of(&self, rows: impl IntoIterator<Item = R>) -> String {
        let line = |cells: Vec<String>| format!("| {} |\n", cells.join(" | "));
        let mut text = line(self.columns.iter().map(|(head, _)| head.clone()).collect());
        text.push_str(&format!("|{}\n", "---|".repeat(self.columns.len())));
        for row in rows {
            let cells = self.columns.iter();
            text.push_str(&line(
                cells
                    .map(|(_, cell)| cell(&row).replace('|', "/"))
                    .collect(),
            ));
        }
        text
    }
}

/// Three significant digits.
pub(crate) fn digits(value: f64) -> String {
    if value == 0.0 || !value.is_finite() {
        return format!("{value}");
    }
    let size = value.abs();
    if (1e-3..1e5).contains(&size) {
        let decimals = (2 - size.log10().floor() as i32).max(0) as usize;
        format!("{value:.decimals$}")
    } else {
        format!("{value:.2e}")
    }
}

/// What stands where there is no figure.
pub(crate) fn or_dash(text: Option<String>) -> String {
    text.unwrap_or_else(|| "-".to_owned())
}

pub(crate) fn optional(value: Option<f64>) -> String {
    or_dash(value.map(digits))
}

/// Value and standard error.
pub(crate) fn estimate(value: Option<Estimate>) -> String {
    or_dash(value.map(|estimate| match estimate.standard_error {
        Some(error) => format!("{} ± {}", digits(estimate.value), digits(error)),
        None => digits(estimate.value),
    }))
}

/// A value with its standard error, where there is a value.
pub(crate) fn with_error(value: f64, standard_error: Option<f64>) -> String {
    estimate(Some(Estimate {
        value,
        standard_error,
    }))
}

fn in_quartiles([middle, lower, upper]: [f64; 3]) -> String {
    let [middle, lower, upper] = [middle, lower, upper].map(digits);
    format!("{middle} ({lower} to {upper})")
}

/// Median and quartiles.
pub(crate) fn quartiles(value: Option<&Spread>) -> String {
    or_dash(value.map(|s| in_quartiles([s.median, s.lower_quartile, s.upper_quartile])))
}

/// How many times as fast as the first variant: the inverse of a ratio of times, quartiles swapped.
pub(crate) fn speed_up(ratio: Option<&Spread>) -> String {
    let inverse = |s: &Spread| [s.median, s.upper_quartile, s.lower_quartile].map(|x| 1.0 / x);
    or_dash(ratio.map(|spread| in_quartiles(inverse(spread))))
}

/// Milliseconds of a group of passes.
pub(crate) fn ms(row: &Row, group: &str) -> String {
    quartiles(row.timing.ms.get(group))
}

/// A part's relative MSE, with a mark where the reference is not good enough for it.
pub(crate) fn rel_mse(row: &Row, part: &str) -> String {
    or_dash(row.errors.get(part).map(|errors| {
        let mark = if errors.is_settled() { "" } else { " *" };
        format!("{}{mark}", estimate(errors.rel_mse))
    }))
}

/// A part's relative MSE over that of the group's first variant.
pub(crate) fn rel_mse_ratio(row: &Row, part: &str) -> String {
    let errors = row.errors.get(part);
    quartiles(errors.and_then(|errors| errors.rel_mse_ratio.as_ref()))
}

pub(crate) fn size(row: &Row) -> String {
    format!("{}x{}", row.size[0], row.size[1])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::statistics::spread;

    #[test]
    fn numbers_have_three_digits() {
        for (value, text) in [
            (0.0, "0"),
            (0.012_345, "0.0123"),
            (1.0, "1.00"),
            (123.4, "123"),
            (0.000_012_3, "1.23e-5"),
            (-2.5, "-2.50"),
        ] {
            assert_eq!(digits(value), text);
        }
    }

    #[test]
    fn a_speed_up_is_the_inverse_with_its_quartiles_swapped() {
        let ratio = spread(&[0.4, 0.5, 0.8]).unwrap();
        assert_eq!(speed_up(Some(&ratio)), "2.00 (1.54 to 2.22)");
        assert_eq!(speed_up(None), "-");
    }

    #[test]
    fn a_table_has_a_line_per_row_and_no_bars_in_its_cells() {
        let table = Table::new()
            .with("name", |row: &(&str, u32)| row.0.to_owned())
            .with("number", |row| row.1.to_string());
        assert_eq!(
            table.of([("a|b", 1), ("c", 2)]),
            "| name | number |\n|---|---|\n| a/b | 1 |\n| c | 2 |\n"
        );
    }
}
