//! A suite in parts: each of several machines measures some of its groups, and [`join`] makes one report of theirs.

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use serde_json::json;

use crate::ReportError;
use crate::records::{Machine, Row};

/// Which part of a suite one machine measures.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Shard {
    /// From 1.
    pub number: u32,
    /// All parts.
    pub of: u32,
}

impl Shard {
    /// Whether a group is in this part, by its place in the suite from 0. Groups are dealt out in turn, so that parts take
    /// about as long. Variants of a group are measured against each other and stay together.
    #[must_use]
    pub fn has(self, group: usize) -> bool {
        group % self.of as usize + 1 == self.number as usize
    }
}

/// What a report says of the suite that it is a part of.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Part {
    /// Which part.
    #[serde(flatten)]
    pub shard: Shard,
    /// All groups of the suite in their order: suite, name.
    pub groups: Vec<[String; 2]>,
}

/// What report.json says of the suite, the same in all its parts.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Head {
    /// [`FORMAT`].
    pub format: String,
    /// Version of the program that measured.
    pub version: String,
    /// The suite.
    pub suite: String,
    /// Fingerprint of the code that decides pixels.
    pub render_code: String,
    /// Fingerprint of that and of the code that measures.
    pub bench_code: String,
    /// Most samples per pixel of a reference.
    pub reference_samples: u32,
    /// Samples per pixel of one batch of a reference that is filtered over the pixel.
    pub samples_per_batch: u32,
    /// Where this ran.
    pub machine: Machine,
}

/// report.json as it is read, without what is computed from it.
#[derive(Deserialize)]
struct Saved {
    #[serde(flatten)]
    head: Head,
    part: Option<Part>,
    unfinished: Option<[usize; 2]>,
    rows: Vec<Row>,
}

/// The `format` of report.json.
pub const FORMAT: &str = "stereolux-bench";

/// Joins the parts of a suite: the texts of their report.json, by folder. Returns what the report of all of them has: its head,
/// and the rows in the suite's order.
///
/// # Errors
/// [`ReportError::Part`]: what is no part of a suite, or not of the same one, or is there twice, or is missing.
pub fn join(texts: &[(PathBuf, String)]) -> Result<(Head, Vec<Row>), ReportError> {
    let mut parts = Vec::new();
    for (folder, text) in texts {
        let (saved, part) = saved(folder, text)?;
        let same = json!({"head": saved.head, "parts": part.shard.of, "groups": part.groups});
        parts.push((folder.as_path(), saved, part, same));
    }
    let Some((first_folder, first, first_part, first_same)) = parts.first() else {
        return Err(fault(Path::new("."), "there is nothing to join"));
    };
    let mut found: HashMap<u32, &Path> = HashMap::new();
    for (folder, _, part, same) in &parts {
        let pairs = [[&first_same["head"], &same["head"]], [first_same, same]];
        let differing = pairs.into_iter().find_map(|[one, other]| {
            let key = differing(one, other)?;
            Some(format!(
                "{key} is {} there and {} here",
                one[&key], other[&key]
            ))
        });
        if let Some(differing) = differing {
            let reason = format!(
                "is not of the suite that {} is of: {differing}",
                first_folder.display()
            );
            return Err(fault(folder, &reason));
        }
        if let Some(before) = found.insert(part.shard.number, folder) {
            let reason = format!(
                "part {} is in {} too; leave one out",
                part.shard.number,
                before.display()
            );
            return Err(fault(folder, &reason));
        }
    }
    if let Some(missing) = (1..=first_part.shard.of).find(|number| !found.contains_key(number)) {
        let reason = format!(
            "part {missing} of {} is in none of the folders; measure it with --shard {missing}/{0}",
            first_part.shard.of
        );
        return Err(fault(first_folder, &reason));
    }
    let places: HashMap<[&str; 2], usize> = (0..)
        .zip(&first_part.groups)
        .map(|(place, [suite, group])| ([suite.as_str(), group.as_str()], place))
        .collect();
    let place = |row: &Row| {
        places
            .get(&[row.suite.as_str(), row.group.as_str()])
            .copied()
    };
    let mut rows: Vec<Row> = parts
        .iter()
        .flat_map(|(_, saved, ..)| saved.rows.clone())
        .collect();
    // Stable: a group's variants keep their order.
    rows.sort_by_key(|row| place(row).unwrap_or(usize::MAX));
    Ok((first.head.clone(), rows))
}

fn fault(folder: &Path, reason: &str) -> ReportError {
    ReportError::Part {
        folder: folder.to_owned(),
        reason: reason.to_owned(),
    }
}

fn saved(folder: &Path, text: &str) -> Result<(Saved, Part), ReportError> {
    let saved: Saved = serde_json::from_str(text)
        .map_err(|error| fault(folder, &format!("report.json: {error}; give folders that `bench --shard` of this version has written")))?;
    if saved.head.format != FORMAT {
        return Err(fault(folder, "report.json is not one of `bench`"));
    }
    if let Some([done, all]) = saved.unfinished {
        let reason = format!("has {done} of {all} groups; run its `bench` command again to go on");
        return Err(fault(folder, &reason));
    }
    match saved.part.clone() {
        Some(part) => Ok((saved, part)),
        None => Err(fault(
            folder,
            "holds a whole suite; give folders that `bench --shard I/N` has written",
        )),
    }
}

/// The first key under which two objects differ.
fn differing(one: &serde_json::Value, other: &serde_json::Value) -> Option<String> {
    let keys = one.as_object()?.keys();
    keys.into_iter()
        .find(|key| one[*key] != other[*key])
        .cloned()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Report;
    use crate::analysis::tests::row;

    /// Rows of three groups, the middle one of two variants.
    fn rows() -> Vec<Row> {
        let mut rows = [("a", "x"), ("b", "x"), ("b", "y"), ("c", "x")].map(|(group, variant)| {
            let mut row = row("pareto", variant, json!({"spp": 1}), 2.5, 0.25);
            row.group = group.to_owned();
            row.key = format!("{group} {variant}");
            row
        });
        rows[3].timing.rounds = 7;
        rows.to_vec()
    }

    fn groups() -> Vec<[String; 2]> {
        ["a", "b", "c"]
            .map(|group| ["pareto".to_owned(), group.to_owned()])
            .to_vec()
    }

    fn files(rows: &[Row], part: Option<&Part>, version: &str) -> Vec<crate::ReportFile> {
        let report = Report {
            head: Head {
                format: FORMAT.to_owned(),
                version: version.to_owned(),
                suite: "pareto".to_owned(),
                render_code: "r".to_owned(),
                bench_code: "b".to_owned(),
                reference_samples: 16,
                samples_per_batch: 4,
                machine: Machine::default(),
            },
            part,
            unfinished: None,
            rows,
        };
        report.files().unwrap()
    }

    /// The report.json of part `number` of two.
    fn part(number: u32, version: &str) -> (PathBuf, String) {
        let shard = Shard { number, of: 2 };
        let groups = groups();
        let own: Vec<Row> = rows()
            .into_iter()
            .filter(|row| {
                shard.has(
                    groups
                        .iter()
                        .position(|[_, group]| *group == row.group)
                        .unwrap(),
                )
            })
            .collect();
        let files = files(&own, Some(&Part { shard, groups }), version);
        let json = files
            .into_iter()
            .find(|file| file.path == Path::new("report.json"));
        (
            PathBuf::from(format!("part{number}")),
            String::from_utf8(json.unwrap().bytes).unwrap(),
        )
    }

    #[test]
    fn two_halves_make_the_report_of_one_run_byte_by_byte() {
        let whole = files(&rows(), None, "1");
        for order in [[1, 2], [2, 1]] {
            let (head, rows) = join(&order.map(|number| part(number, "1"))).unwrap();
            let joined = Report {
                head,
                part: None,
                unfinished: None,
                rows: &rows,
            };
            assert_eq!(joined.files().unwrap(), whole);
        }
    }

    #[test]
    fn what_is_not_all_of_one_suite_is_refused() {
        let whole =
            String::from_utf8(files(&rows(), None, "1").swap_remove(0).bytes).unwrap_or_default();
        let (folder, json) = part(1, "1");
        let mut saved: serde_json::Value = serde_json::from_str(&json).unwrap();
        saved["unfinished"] = json!([1, 3]);
        let half_done = (folder.with_file_name("half"), saved.to_string());
        let message = |parts: &[(PathBuf, String)]| join(parts).unwrap_err().to_string();
        for (parts, words) in [
            (vec![part(1, "1")], "part 2 of 2 is in none"),
            (vec![part(1, "1"), part(1, "1")], "part 1 is in part1 too"),
            (
                vec![part(1, "1"), part(2, "2")],
                "version is \"1\" there and \"2\" here",
            ),
            (vec![("other".into(), whole)], "other: report.json"),
            (vec![half_done], "half: has 1 of 3 groups"),
            (vec![], "nothing to join"),
        ] {
            let told = message(&parts);
            assert!(told.contains(words), "{told}");
            assert_eq!(told.lines().count(), 1);
        }
    }

    #[test]
    fn every_group_is_in_one_part() {
        for group in 0..9 {
            let holders = (1..=4).filter(|&number| Shard { number, of: 4 }.has(group));
            assert_eq!(holders.count(), 1);
        }
    }
}
