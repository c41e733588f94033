//! What the columns of rows.csv hold: columns.csv beside this file, for columns.json and the table in docs/benchmarks.md.

use serde_json::{Map, Value};

const COLUMNS: &str = include_str!("columns.csv");

/// Columns and what they hold, in the order of the table. A `*` stands for a part of a name between dots, or for all that
/// follows at its end.
fn known() -> Vec<(String, String)> {
    let mut reader = csv::Reader::from_reader(COLUMNS.as_bytes());
    let rows = reader.deserialize();
    // The file is part of the program, and a test reads all of it.
    rows.filter_map(Result::ok).collect()
}

fn fits(pattern: &str, column: &str) -> bool {
    let (mut wanted, mut parts) = (pattern.split('.').peekable(), column.split('.'));
    while let Some(word) = wanted.next() {
        match parts.next() {
            Some(_) if word == "*" && wanted.peek().is_none() => return true,
            Some(part) if word == "*" || word == part => {}
            _ => return false,
        }
    }
    parts.next().is_none()
}

/// What each of some columns holds, in their order; `null` for one that nothing is known of.
pub fn explained<'a>(columns: impl Iterator<Item = &'a str>) -> Value {
    let known = known();
    let explain = |column: &str| {
        let found = known.iter().find(|(pattern, _)| fits(pattern, column));
        found.map_or(Value::Null, |(_, holds)| Value::from(holds.as_str()))
    };
    let fields: Map<String, Value> = columns
        .map(|column| (column.to_owned(), explain(column)))
        .collect();
    Value::Object(fields)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn patterns_stand_for_what_they_say() {
        for (pattern, column, expected) in [
            ("suite", "suite", true),
            ("suite", "suite.x", false),
            ("a.*", "a.b", true),
            ("a.*", "a.b.c", true),
            ("a.*", "a", false),
            ("a.*.c", "a.b.c", true),
            ("a.*.c", "a.b.d", false),
            ("a.*.c.*", "a.b.c.d", true),
        ] {
            assert_eq!(fits(pattern, column), expected, "{pattern}, {column}");
        }
    }

    /// The document's table is this file's; `STEREOLUX_WRITE_COLUMNS=1` writes it again.
    #[test]
    fn the_document_has_the_table() {
        let lines = COLUMNS.lines().count();
        assert_eq!(known().len() + 1, lines, "a line that cannot be read");
        let rows = known();
        let table: Vec<String> = rows
            .iter()
            .map(|(column, holds)| format!("| `{column}` | {holds} |\n"))
            .collect();
        let table = format!("| column | holds |\n|---|---|\n{}", table.concat());
        let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs/benchmarks.md");
        let document = std::fs::read_to_string(path).unwrap();
        let (before, rest) = document.split_once("| column | holds |").unwrap();
        let after = rest.split_once("\n\n").unwrap().1;
        let written = format!("{before}{table}\n{after}");
        if std::env::var_os("STEREOLUX_WRITE_COLUMNS").is_some() {
            std::fs::write(path, written).unwrap();
            return;
        }
        assert!(
            document == written,
            "docs/benchmarks.md differs from columns.csv: STEREOLUX_WRITE_COLUMNS=1 writes it again"
        );
    }
}
