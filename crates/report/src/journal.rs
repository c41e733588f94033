//! The journal: every finished row at once on disk, so that a run that was killed goes on where it stopped.
//!
//! `journal.jsonl` holds one row per line, each with its key. A row is used again only under the very same key, which
//! covers settings, views, scene, adapter and code; rows under other keys stay in the file and out of the report.

use std::collections::HashMap;
use std::fs::{self, File, OpenOptions, TryLockError};
use std::io::{Read as _, Seek as _, SeekFrom, Write as _};
use std::path::{Path, PathBuf};

use crate::ReportError;
use crate::records::Row;

/// Largest journal that is read, bytes: a hundred thousand rows.
const MAX_BYTES: u64 = 1 << 28;

/// An open journal.
#[derive(Debug)]
pub struct Journal {
    path: PathBuf,
    file: File,
    rows: HashMap<String, Row>,
}

impl Journal {
    /// Opens or starts the journal at `path`, for this process alone. A last line that was cut off is removed; a broken line
    /// further up is left alone, and its row measured anew.
    ///
    /// # Errors
    /// [`ReportError::File`].
    pub fn open(path: &Path) -> Result<Self, ReportError> {
        let fail = |error: std::io::Error| ReportError::file(path, error);
        if let Ok(found) = fs::metadata(path) {
            // Opening a pipe would wait for whoever writes to it.
            if !found.is_file() {
                let reason = "it is not a regular file; give --out another folder";
                return Err(ReportError::file(path, reason));
            }
            if found.len() > MAX_BYTES {
                let reason = format!("is longer than {MAX_BYTES} bytes; give --out another folder");
                return Err(ReportError::file(path, reason));
            }
        }
        let mut file = OpenOptions::new()
            .read(true)
            .write(true)
            .create(true)
            .truncate(false)
            .open(path)
            .map_err(fail)?;
        if cfg!(unix) && matches!(file.try_lock(), Err(TryLockError::WouldBlock)) {
            let reason = "another suite writes to it; give --out another folder";
            return Err(ReportError::file(path, reason));
        }
        let mut bytes = Vec::new();
        (&mut file)
            .take(MAX_BYTES)
            .read_to_end(&mut bytes)
            .map_err(fail)?;
        let whole = bytes
            .iter()
            .rposition(|&byte| byte == b'\n')
            .map_or(0, |last| last + 1);
        if whole < bytes.len() {
            file.set_len(whole as u64).map_err(fail)?;
        }
        file.seek(SeekFrom::End(0)).map_err(fail)?;
        let mut rows = HashMap::new();
        for (index, line) in bytes[..whole].split(|&byte| byte == b'\n').enumerate() {
            if line.is_empty() {
                continue;
            }
            match serde_json::from_slice::<Row>(line) {
                Ok(row) => {
                    rows.insert(row.key.clone(), row);
                }
                // Written by another version, or damaged: not usable either way.
                Err(_) => log::warn!(
                    "{}: line {}: not a row of this version, ignored",
                    path.display(),
                    index + 1
                ),
            }
        }
        Ok(Self {
            path: path.to_owned(),
            file,
            rows,
        })
    }

    /// Rows known, whatever their key.
    #[must_use]
    pub fn len(&self) -> usize {
        self.rows.len()
    }

    /// Whether no row is known.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.rows.is_empty()
    }

    /// The rows under these keys, if all of them are there.
    #[must_use]
    pub fn all(&self, keys: &[String]) -> Option<Vec<Row>> {
        keys.iter().map(|key| self.rows.get(key).cloned()).collect()
    }

    /// Appends rows that were measured together: all lines in one write, handed to the disk before this returns.
    ///
    /// # Errors
    /// [`ReportError::File`].
    pub fn append(&mut self, rows: &[Row]) -> Result<(), ReportError> {
        let mut text = Vec::new();
        for row in rows {
            serde_json::to_writer(&mut text, row)
                .map_err(|error| ReportError::file(&self.path, error))?;
            text.push(b'\n');
        }
        self.file
            .write_all(&text)
            .and_then(|()| self.file.sync_data())
            .map_err(|error| ReportError::file(&self.path, error))?;
        for row in rows {
            self.rows.insert(row.key.clone(), row.clone());
        }
        Ok(())
    }
}

#[cfg(test)]
#[allow(dead_code)]
#[path = "../../base/tests/shared/folders.rs"]
mod folders;

#[cfg(test)]
mod tests {
    use super::folders::Folder;
    use super::*;

    fn keys(names: &[&str]) -> Vec<String> {
        names.iter().map(|&name| name.to_owned()).collect()
    }

    #[test]
    fn a_cut_off_line_costs_that_row_alone() {
        let folder = Folder::new("journal");
        let path = folder.join("journal.jsonl");
        let mut journal = Journal::open(&path).unwrap();
        assert!(journal.is_empty());
        journal
            .append(&[Row::imagined("a"), Row::imagined("b")])
            .unwrap();
        journal.append(&[Row::imagined("c")]).unwrap();
        drop(journal);

        // Killed in the middle of writing c.
        let bytes = fs::read(&path).unwrap();
        fs::write(&path, &bytes[..bytes.len() - 9]).unwrap();
        let mut journal = Journal::open(&path).unwrap();
        assert_eq!(journal.len(), 2);
        assert_eq!(
            journal.all(&keys(&["b", "a"])).unwrap(),
            [Row::imagined("b"), Row::imagined("a")]
        );
        assert_eq!(journal.all(&keys(&["a", "c"])), None);
        // What is appended now stands on a line of its own.
        journal.append(&[Row::imagined("c")]).unwrap();
        if cfg!(unix) {
            let taken = Journal::open(&path).unwrap_err().to_string();
            assert!(taken.contains("another suite writes to it"), "{taken}");
        }
        drop(journal);
        let journal = Journal::open(&path).unwrap();
        assert_eq!(journal.all(&keys(&["a", "b", "c"])).unwrap().len(), 3);
    }

    #[test]
    fn broken_lines_and_other_keys_are_not_used() {
        let folder = Folder::new("journal-broken");
        let path = folder.join("journal.jsonl");
        let good = serde_json::to_string(&Row::imagined("a")).unwrap();
        fs::write(&path, format!("{{\"key\":\"x\"}}\n{good}\nnonsense\n")).unwrap();
        let journal = Journal::open(&path).unwrap();
        assert_eq!(journal.len(), 1);
        assert!(journal.all(&keys(&["a"])).is_some());
        assert!(journal.all(&keys(&["x"])).is_none());
        assert!(journal.all(&keys(&["another"])).is_none());
    }
}
