//! What the columns of rows.csv hold: columns.csv beside this file, for columns.json and for who reads it there.

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

    #[test]
    fn every_line_can_be_read() {
        assert_eq!(known().len() + 1, COLUMNS.lines().count());
    }
}
