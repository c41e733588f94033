//! A slice of the mutated inputs of `fuzz/`: seconds here, a million by the example `fuzz`.

use std::time::{Duration, Instant};

use crate::suite::fuzz::parsers::{Feeder, Parser};
use crate::suite::support::Folder;

/// Long enough for a loaded machine.
const PATIENCE: Duration = Duration::from_secs(60);

fn slice(parsers: &[Parser], cases: u64) {
    let folder = Folder::new(&format!("fuzzed-{:?}", parsers[0]));
    for parser in parsers {
        let feeder = Feeder::new(*parser, folder.path());
        let mut accepted = 0;
        for seed in 0..cases {
            let began = Instant::now();
            accepted += u64::from(feeder.feed(seed));
            assert!(began.elapsed() < PATIENCE, "{parser:?}, seed {seed}");
        }
        // Inputs that are never or always accepted test nothing.
        println!("{parser:?}: {accepted} of {cases} accepted");
        let is_part = (1..cases).contains(&accepted) || *parser == Parser::Layout;
        assert!(is_part, "{parser:?}: {accepted}");
    }
}

const TEXT: [Parser; 7] = [
    Parser::Trace,
    Parser::Headset,
    Parser::Actions,
    Parser::Settings,
    Parser::Set,
    Parser::Journal,
    Parser::Layout,
];

#[test]
fn scenes() {
    slice(&[Parser::GltfTree, Parser::GltfText, Parser::Glb], 500);
}

#[test]
fn pictures() {
    let all = [Parser::Textures, Parser::Environment, Parser::Pictures];
    slice(&all, 500);
}

#[test]
fn text() {
    slice(&TEXT, 500);
}

#[test]
fn edits_and_answers_of_a_runtime() {
    slice(&[Parser::Edits, Parser::Runtime], 500);
    // None is forgotten here.
    assert_eq!(Parser::ALL.len(), 3 + 3 + TEXT.len() + 2);
}
