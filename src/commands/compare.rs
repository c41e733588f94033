//! `compare`: one JSON object on stdout, and a page to look at.

mod page;

use std::fs;
use std::io::Write as _;
use std::path::Path;

use super::{Failure, print_line};
use crate::images::write_atomically;
use crate::metrics::{FlipView, compare_and_keep};
use crate::options::CompareOptions;

/// Compares two images; 1 if the relative MSE exceeds the limit.
pub fn compare(options: &CompareOptions) -> Result<u8, Failure> {
    let view = FlipView {
        exposure: options.exposure,
        pixels_per_degree: options.pixels_per_degree,
    };
    let (image, reference) = (&options.image, &options.reference);
    let compared = compare_and_keep(
        image,
        reference,
        options.mask.as_deref(),
        view,
        options.limits.load(),
        options.report.as_ref().map_or(0, |_| page::BYTES),
    )?;
    if let Some(folder) = &options.report {
        let names = [image, reference].map(|path| path.display().to_string());
        let page = page::page(names, &compared, options.exposure).map_err(Failure::failed)?;
        write_page(folder, &page)?;
    }
    let comparison = compared.comparison;
    let text = serde_json::to_string_pretty(&comparison).map_err(Failure::failed)?;
    print_line(&text)?;
    let exceeds = options
        .max_rel_mse
        .is_some_and(|limit| comparison.exceeds(limit));
    Ok(u8::from(exceeds))
}

fn write_page(folder: &Path, page: &str) -> Result<(), Failure> {
    let unusable = |reason: String| {
        Failure::unusable(format!(
            "--report {}: {reason}; choose a folder that can be written to",
            folder.display()
        ))
    };
    fs::create_dir_all(folder).map_err(|error| unusable(error.to_string()))?;
    let path = folder.join("report.html");
    // A suite's report has the same name.
    if fs::read_to_string(&path).is_ok_and(|there| !there.contains(page::TITLE)) {
        let there = "report.html there is no comparison's, and stays".to_owned();
        return Err(unusable(there));
    }
    write_atomically(&path, |out| out.write_all(page.as_bytes()))
        .map_err(|error| unusable(error.to_string()))
}
