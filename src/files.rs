//! Files that are whole or not there: written beside their place, then renamed.

use std::fs::{self, File};
use std::io::{self, BufWriter, Write as _};
use std::path::Path;

/// Writes a file beside its place and renames it there when it is whole; on failure what was written is removed, and what
/// was there before stays.
///
/// # Errors
/// The first that occurs.
pub(crate) fn write_beside(
    path: &Path,
    write: impl FnOnce(&mut BufWriter<File>) -> io::Result<()>,
) -> io::Result<()> {
    let Some(name) = path.file_name() else {
        return Err(io::Error::other("the path does not name a file"));
    };
    if path.is_dir() {
        return Err(io::Error::other("it is a directory"));
    }
    let mut partial_name = std::ffi::OsString::from(".");
    partial_name.push(name);
    partial_name.push(format!(".{}.partial", std::process::id()));
    let partial = path.with_file_name(partial_name);
    let written = File::create(&partial).and_then(|file| {
        let mut out = BufWriter::new(file);
        write(&mut out)?;
        out.flush()?;
        drop(out);
        fs::rename(&partial, path)
    });
    if written.is_err() {
        // The first error is the one to report; the file may never have been made.
        let _ = fs::remove_file(&partial);
    }
    written
}
