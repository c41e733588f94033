//! Text files line by line, with limits: what is read here comes from outside.

use super::InputError;
use std::io::{BufRead, BufReader, Read};
use std::path::Path;
use stereolux_base::files;

/// A frame's line is under 1 KiB as a rule; with a mesh of what each lens hides and the joints of both hands it has 60 KiB.
const MAX_LINE_BYTES: u64 = 256 * 1024;

/// 12 hours at 90 Hz, and about 1 GB of memory when read.
const MAX_LINES: usize = 4_000_000;

/// One line without its line ending.
#[derive(Clone, Debug)]
pub(super) struct Line {
    /// 1-based.
    pub(super) number: usize,
    pub(super) text: String,
}

/// Lines of a text file: LF or CRLF, with or without a byte order mark.
pub(super) struct TextLines<R> {
    pub(super) file: String,
    reader: R,
    number: usize,
    pushed_back: Option<Line>,
}

/// Opens `path`: a file, or a pipe that brings something.
pub(super) fn open(path: &Path) -> Result<TextLines<BufReader<Box<dyn Read + Send>>>, InputError> {
    let name = path.display().to_string();
    let file = files::open(path)
        .map_err(|cause| InputError::file(&name, format!("cannot be read: {cause}")))?;
    Ok(TextLines::new(name, BufReader::new(file)))
}

impl<R: BufRead> TextLines<R> {
    pub(super) fn new(file: String, reader: R) -> Self {
        Self {
            file,
            reader,
            number: 0,
            pushed_back: None,
        }
    }

    /// Makes `line` the next one again.
    pub(super) fn push_back(&mut self, line: Line) {
        self.pushed_back = Some(line);
    }

    /// The next line that is not blank.
    pub(super) fn next_line(&mut self) -> Result<Option<Line>, InputError> {
        if let Some(line) = self.pushed_back.take() {
            return Ok(Some(line));
        }
        loop {
            let mut bytes = Vec::new();
            let read = self
                .reader
                .by_ref()
                .take(MAX_LINE_BYTES + 1)
                .read_until(b'\n', &mut bytes);
            let number = self.number + 1;
            if let Err(cause) = read {
                let what = format!("cannot be read: {cause}");
                return Err(InputError::line(&self.file, number, what));
            }
            if bytes.is_empty() {
                return Ok(None);
            }
            self.number = number;
            let refuse = |what: &str| Err(InputError::line(&self.file, number, what));
            if bytes.len() as u64 > MAX_LINE_BYTES {
                return refuse("longer than 256 KiB; this is not a trace of poses");
            }
            if number > MAX_LINES {
                return refuse(
                    "more than 4,000,000 lines (12 hours at 90 Hz); cut the file into parts",
                );
            }
            let is_cut = bytes.last() != Some(&b'\n');
            let text = match String::from_utf8(bytes) {
                Ok(text) => text,
                // A last line may end anywhere.
                Err(error) if is_cut && error.utf8_error().error_len().is_none() => {
                    let valid = error.utf8_error().valid_up_to();
                    String::from_utf8_lossy(&error.as_bytes()[..valid]).into_owned()
                }
                Err(_) => return refuse("not UTF-8 text; this is not a trace of poses"),
            };
            let text = if number == 1 {
                text.strip_prefix('\u{feff}').unwrap_or(&text)
            } else {
                &text
            };
            let text = text.trim();
            if !text.is_empty() {
                let text = text.to_owned();
                return Ok(Some(Line { number, text }));
            }
        }
    }

    /// The next line that is neither blank nor a `#` comment.
    pub(super) fn next_uncommented(&mut self) -> Result<Option<Line>, InputError> {
        while let Some(line) = self.next_line()? {
            if !line.text.starts_with('#') {
                return Ok(Some(line));
            }
        }
        Ok(None)
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use std::io::Cursor;

    fn lines(bytes: &[u8]) -> Result<Vec<(usize, String)>, InputError> {
        let mut lines = TextLines::new("f".into(), Cursor::new(bytes));
        let mut found = Vec::new();
        while let Some(line) = lines.next_uncommented()? {
            found.push((line.number, line.text));
        }
        Ok(found)
    }

    #[test]
    fn endings_marks_blanks_and_comments() {
        let found = lines("\u{feff}# c\r\na\r\n\r\n \n#x\nb\nc".as_bytes()).unwrap();
        let expected = [(2, "a".into()), (6, "b".into()), (7, "c".into())];
        assert_eq!(found, expected);
    }

    #[test]
    fn an_endless_line_is_refused_before_it_is_read() {
        let mut lines = TextLines::new("f".into(), BufReader::new(std::io::repeat(b'x')));
        let error = lines.next_line().unwrap_err();
        assert_eq!(error.line, Some(1));
        assert!(error.what.contains("256 KiB"), "{error}");
    }

    #[test]
    fn an_endless_file_is_refused() {
        struct Endless;
        impl Read for Endless {
            fn read(&mut self, buffer: &mut [u8]) -> std::io::Result<usize> {
                buffer.fill(b'\n');
                Ok(buffer.len())
            }
        }
        let mut lines = TextLines::new("f".into(), BufReader::new(Endless));
        let error = lines.next_line().unwrap_err();
        assert_eq!(error.line, Some(MAX_LINES + 1));
    }

    #[test]
    fn binary_is_refused() {
        let error = lines(b"a\n\xff\xfe\n").unwrap_err();
        assert_eq!(error.line, Some(2));
    }

    #[test]
    fn a_directory_is_refused() {
        let error = open(&std::env::temp_dir()).err().unwrap();
        assert!(error.what.contains("directory"), "{error}");
    }
}
