//! TOML files that come from outside: read with a limit, faults named by line.

use super::InputError;
use std::path::Path;
use stereolux_base::files;

/// No profile, script or declaration comes near it.
const MAX_BYTES: u64 = 1 << 20;

/// A file's name for errors, and its text without the byte order mark. `kind` says what it should be: "headset profile".
pub(super) fn read(path: &Path, kind: &str) -> Result<(String, String), InputError> {
    let file = path.display().to_string();
    let bytes = files::read_at_most(path, MAX_BYTES)
        .map_err(|cause| InputError::file(&file, format!("cannot be read: {cause}")))?
        .ok_or_else(|| {
            InputError::file(&file, format!("larger than 1 MiB; this is not a {kind}"))
        })?;
    let text = std::str::from_utf8(&bytes)
        .map_err(|_| InputError::file(&file, format!("not UTF-8 text; this is not a {kind}")))?;
    let text = text.strip_prefix('\u{feff}').unwrap_or(text).to_owned();
    Ok((file, text))
}

/// What the text says; a fault with its line, where TOML knows it. `file` names it in errors.
pub(super) fn parsed<T: serde::de::DeserializeOwned>(
    file: &str,
    text: &str,
) -> Result<T, InputError> {
    toml::from_str(text).map_err(|error| {
        let what = error.message().replace('\n', " ");
        match error.span() {
            // Of the whole file.
            Some(span) if span.start == 0 && what.starts_with("missing field") => {
                InputError::file(file, what)
            }
            Some(span) => {
                let (line, field) = locate(text, span.start);
                InputError {
                    field,
                    ..InputError::line(file, line, what)
                }
            }
            None => InputError::file(file, what),
        }
    })
}

/// The 1-based line of a byte.
pub(super) fn line_at(text: &str, byte: usize) -> usize {
    locate(text, byte).0
}

/// The 1-based line of byte `offset`, and the key that is set there, with its table.
fn locate(text: &str, offset: usize) -> (usize, Option<String>) {
    let (mut table, mut key) = (String::new(), None);
    let mut line = 0;
    let mut start = 0;
    for (index, content) in text.split_inclusive('\n').enumerate() {
        line = index + 1;
        let trimmed = content.trim();
        if let Some(header) = trimmed
            .strip_prefix('[')
            .map(|rest| rest.trim_start_matches('['))
        {
            table = header.split(']').next().unwrap_or("").trim().to_owned();
            key = (!table.is_empty()).then(|| table.clone());
        } else if !trimmed.starts_with('#')
            && let Some((name, _)) = trimmed.split_once('=')
        {
            let name = name.trim();
            key = Some(if table.is_empty() {
                name.to_owned()
            } else {
                format!("{table}.{name}")
            });
        }
        start += content.len();
        if start > offset {
            break;
        }
    }
    (line.max(1), key)
}

#[cfg(test)]
mod tests {
    use super::locate;

    #[test]
    fn bytes_are_located_by_line_and_key() {
        let text = "a = 1\n# b = 2\n[left]\nfov = { left = 1,\n right = 2 }\n";
        let at = |needle: &str| locate(text, text.find(needle).unwrap_or(0));
        assert_eq!(at("a ="), (1, Some("a".into())));
        assert_eq!(at("[left"), (3, Some("left".into())));
        assert_eq!(at("fov"), (4, Some("left.fov".into())));
        assert_eq!(locate("", 0), (1, None));
        let text = "[[right]]\nat_s = 0\n";
        assert_eq!(locate(text, 12), (2, Some("right.at_s".into())));
    }
}
