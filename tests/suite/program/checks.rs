//! `docs/checks.md` names tests; they exist.

use std::path::Path;

/// Whether a source holds a test of this name: an attribute above it, a property, or one of `cases!(...)`.
fn holds_test(source: &str, name: &str) -> bool {
    let head = format!("fn {name}(");
    let lines: Vec<&str> = source.lines().map(str::trim).collect();
    let is_test = |index: usize| {
        lines[..index]
            .iter()
            .rev()
            .take_while(|line| line.starts_with("#[") || line.starts_with("//"))
            .any(|line| *line == "#[test]")
    };
    let as_function = (0..lines.len()).any(|at| lines[at].starts_with(&head) && is_test(at));
    let as_case = source.find("\ncases!(").is_some_and(|start| {
        let end = source[start..].find(");").unwrap_or(0);
        source[start..start + end]
            .lines()
            .any(|line| line.trim() == format!("{name},"))
    });
    as_function || as_case
}

/// `(row, place, test)` of every name in backticks with two colons in it.
fn named(text: &str) -> Vec<(usize, &str, &str)> {
    text.lines()
        .enumerate()
        .flat_map(|(row, line)| {
            line.split('`')
                .skip(1)
                .step_by(2)
                .filter_map(move |code| code.split_once("::").map(|(at, name)| (row, at, name)))
        })
        .collect()
}

/// Names in the text that no source holds.
fn missing(text: &str) -> Vec<String> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let folders: Vec<_> = std::fs::read_dir(root.join("tests/suite"))
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .collect();
    named(text)
        .into_iter()
        // The form itself, and code.
        .filter(|(_, place, _)| *place != "module" && !place.contains(' '))
        .filter(|(_, place, name)| {
            let files = match place.ends_with(".rs") {
                true => vec![root.join(place)],
                false => folders
                    .iter()
                    .map(|folder| folder.join(format!("{place}.rs")))
                    .collect(),
            };
            !files.iter().any(|file| {
                std::fs::read_to_string(file).is_ok_and(|source| holds_test(&source, name))
            })
        })
        .map(|(row, place, name)| format!("line {}: {place}::{name}", row + 1))
        .collect()
}

#[test]
fn every_test_that_is_named_exists() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/checks.md");
    let text = std::fs::read_to_string(path).unwrap();
    let absent = missing(&text);
    assert!(absent.is_empty(), "docs/checks.md names {absent:#?}");
    // Every line of a table below its head names a test and says what it asserts.
    let names = named(&text);
    let rows = text.lines().enumerate().filter(|(_, line)| {
        line.starts_with("| ") && !line.starts_with("| case ") && !line.starts_with("|---")
    });
    let mut cases = 0;
    for (row, line) in rows {
        cases += 1;
        assert!(names.iter().any(|(at, ..)| *at == row), "no test: {line}");
        let cells: Vec<&str> = line.trim_matches('|').split('|').map(str::trim).collect();
        assert_eq!(cells.len(), 3, "{line}");
        assert!(cells.iter().all(|cell| !cell.is_empty()), "{line}");
    }
    assert!(cases > 40, "{cases} cases");
    // Negative controls: other names, a helper that is no test, a file that is not there.
    let wrong = "`sphere::no_such_test` `checks::missing` `nowhere::at_all` `reference::teapot` `sphere::view`";
    assert_eq!(missing(wrong).len(), 5);
    assert_eq!(
        missing("`checks::every_test_that_is_named_exists` `reference::glass`").len(),
        0
    );
}
