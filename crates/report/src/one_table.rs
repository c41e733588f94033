//! Reports of one table: report.md, rows.csv and columns.json.

use std::collections::BTreeMap;

use serde_json::{Map, Value, json};

use crate::records::Machine;
use crate::{ReportError, ReportFile};

/// Where and how all rows of a table were measured.
#[derive(Clone, Debug)]
pub struct Circumstances {
    /// Adapter and driver.
    pub machine: Machine,
    /// Settings that differ from the defaults, by key.
    pub settings: BTreeMap<String, Value>,
}

/// A column of rows.csv.
pub(crate) struct Column<'a, R> {
    name: String,
    holds: String,
    cell: Box<dyn Fn(&R) -> String + 'a>,
}

/// A column by its name, what it holds, and what a row has there.
pub(crate) fn column<'a, R>(
    name: impl Into<String>,
    holds: impl Into<String>,
    cell: impl Fn(&R) -> String + 'a,
) -> Column<'a, R> {
    Column {
        name: name.into(),
        holds: holds.into(),
        cell: Box::new(cell),
    }
}

/// A row whose fields are columns of the same names; what a column holds is the field's documentation.
/// `besides`: fields that are no columns.
macro_rules! table_row {
    (
        $(#[$about:meta])*
        $Row:ident {
            words { $($word:ident: $word_holds:literal,)+ }
            figures { $($figure:ident: $holds:literal,)+ }
            besides { $($(#[$doc:meta])* $besides:ident: $Besides:ty,)* }
        }
    ) => {
        $(#[$about])*
        #[derive(Clone, Debug, Default, PartialEq)]
        pub struct $Row {
            $(#[doc = $word_holds] pub $word: String,)+
            $(#[doc = $holds] pub $figure: f64,)+
            $($(#[$doc])* pub $besides: $Besides,)*
        }

        impl $Row {
            /// Its fields' columns, figures with so many decimals.
            fn columns<'a>(decimals: usize) -> Vec<$crate::one_table::Column<'a, Self>> {
                use $crate::one_table::column;
                vec![
                    $(column(stringify!($word), $word_holds, |row: &Self| row.$word.clone()),)+
                    $(column(stringify!($figure), $holds, move |row: &Self| {
                        format!("{:.*}", decimals, row.$figure)
                    }),)+
                ]
            }
        }
    };
}
pub(crate) use table_row;

/// The files of a table.
///
/// # Errors
/// [`ReportError::Format`].
pub(crate) fn one_table<R>(
    mut columns: Vec<Column<'_, R>>,
    rows: &[R],
    about: &Circumstances,
    markdown: String,
) -> Result<Vec<ReportFile>, ReportError> {
    let Circumstances { machine, settings } = about;
    let all_have =
        |name: &str, holds: &str, cell: String| column(name, holds, move |_: &R| cell.clone());
    columns.extend([
        all_have("adapter", "the adapter", machine.adapter.clone()),
        all_have("driver", "its driver", machine.driver.clone()),
        all_have(
            "software_adapter",
            "true where the adapter computes on the CPU: such times say nothing about a GPU",
            machine.software_adapter.to_string(),
        ),
        all_have(
            "settings",
            "settings that differ from the defaults, as JSON",
            json!(settings).to_string(),
        ),
    ]);
    let format = |name, reason: String| ReportError::Format { name, reason };
    let csv = |error: csv::Error| format("rows.csv", error.to_string());
    let mut writer = csv::Writer::from_writer(Vec::new());
    let names = columns.iter().map(|column| &column.name);
    writer.write_record(names).map_err(csv)?;
    for row in rows {
        let cells = columns.iter().map(|column| (column.cell)(row));
        writer.write_record(cells).map_err(csv)?;
    }
    let table = writer.into_inner();
    let table = table.map_err(|error| format("rows.csv", error.to_string()))?;
    let explained: Map<String, Value> = columns
        .into_iter()
        .map(|column| (column.name, column.holds.into()))
        .collect();
    let explained = serde_json::to_string_pretty(&Value::Object(explained))
        .map_err(|error| format("columns.json", error.to_string()))?;
    let files = [
        ("rows.csv", table),
        ("columns.json", format!("{explained}\n").into_bytes()),
        ("report.md", markdown.into_bytes()),
    ];
    let file = |(name, bytes): (&str, Vec<u8>)| ReportFile {
        path: name.into(),
        bytes,
    };
    Ok(files.map(file).into())
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    /// An adapter with a comma in its name, and a setting.
    pub(crate) fn circumstances() -> Circumstances {
        Circumstances {
            machine: Machine {
                adapter: "one, two".to_owned(),
                kind: String::new(),
                backend: String::new(),
                driver: "driver 3".to_owned(),
                software_adapter: true,
            },
            settings: BTreeMap::from([("spp".to_owned(), json!(4))]),
        }
    }

    /// The table of `files`, cells by column, after checking that every column is explained.
    pub(crate) fn table(files: &[ReportFile]) -> Vec<BTreeMap<String, String>> {
        let csv = text(files, "rows.csv");
        let mut reader = csv::Reader::from_reader(csv.as_bytes());
        let rows: Vec<BTreeMap<String, String>> =
            reader.deserialize().map(Result::unwrap).collect();
        let columns: BTreeMap<String, String> =
            serde_json::from_str(&text(files, "columns.json")).unwrap();
        for row in &rows {
            assert!(row.keys().eq(columns.keys()));
            assert_eq!(row["adapter"], "one, two");
            assert_eq!(row["settings"], r#"{"spp":4}"#);
        }
        rows
    }

    pub(crate) fn text(files: &[ReportFile], name: &str) -> String {
        let file = files.iter().find(|file| file.path.ends_with(name)).unwrap();
        String::from_utf8(file.bytes.clone()).unwrap()
    }
}
