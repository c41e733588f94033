//! Opening files that others may have made, and writing files that are whole or not there.
//!
//! A file that another file names is read only if it is a regular one, below the folder that it may reach, and no longer
//! than the system says it is: what stands in `/proc` has no length and is endless. A file that the user names may also be
//! a pipe, which must not keep the program waiting without a word.

use std::fs::{self, File};
use std::hash::{DefaultHasher, Hasher as _};
use std::io::{self, BufRead as _, BufReader, BufWriter, Read, Write as _};
use std::path::{Component, Path, PathBuf};
use std::sync::mpsc::{Receiver, RecvTimeoutError, sync_channel};
use std::time::{Duration, SystemTime};

use crate::limits::LoadBudget;

/// The most that is read from a pipe at once, bytes.
const MOST_OF_A_PIPE: u64 = 64 << 20;
/// How long a pipe may bring nothing.
const PATIENCE: Duration = Duration::from_secs(10);
/// Bytes that are handed over at once.
const CHUNK: usize = 1 << 16;

/// Length of a regular file, bytes. Directories, devices and pipes are refused, so that nothing blocks.
///
/// # Errors
/// One line, to follow the file's name.
pub fn length(path: &Path) -> Result<u64, String> {
    let metadata = fs::metadata(path).map_err(|error| error.to_string())?;
    if metadata.is_dir() {
        return Err("it is a directory; name a file".to_owned());
    }
    if !metadata.is_file() {
        return Err("it is not a regular file; save it to one first".to_owned());
    }
    Ok(metadata.len())
}

/// Reads a regular file from its beginning, at most `most` bytes and no more than it is long.
///
/// # Errors
/// As [`length`].
pub fn read_regular(path: &Path, most: u64) -> Result<Vec<u8>, String> {
    let wanted = length(path)?.min(most);
    let mut bytes = Vec::with_capacity(usize::try_from(wanted).map_err(|error| error.to_string())?);
    File::open(path)
        .and_then(|file| file.take(wanted).read_to_end(&mut bytes))
        .map_err(|error| error.to_string())?;
    Ok(bytes)
}

/// Reads a whole regular file, once `budget` allows it.
///
/// # Errors
/// As [`length`].
pub fn load_regular(path: &Path, budget: &LoadBudget) -> Result<Vec<u8>, String> {
    let length = length(path)?;
    budget
        .take(length, "the file's bytes")
        .map_err(|error| error.to_string())?;
    read_regular(path, length)
}

/// Reads a whole file that the user names: a regular one, once `budget` allows it, or up to 64 MiB from a pipe.
///
/// # Errors
/// As [`open`].
pub fn load(path: &Path, budget: &LoadBudget) -> Result<Vec<u8>, String> {
    if fs::metadata(path).is_ok_and(|found| found.is_file()) {
        return load_regular(path, budget);
    }
    let _held = budget
        .hold(2 * MOST_OF_A_PIPE, "what comes from a pipe")
        .map_err(|error| error.to_string())?;
    read_at_most(path, MOST_OF_A_PIPE)?
        .ok_or_else(|| "more than 64 MiB come from the pipe; save them to a file first".to_owned())
}

/// Opens a file that the user names: a regular one, or a pipe or device that brings something.
///
/// # Errors
/// One line, to follow the file's name.
pub fn open(path: &Path) -> Result<Box<dyn Read + Send>, String> {
    let metadata = fs::metadata(path).map_err(|error| error.to_string())?;
    if metadata.is_dir() {
        return Err("it is a directory; name a file in it".to_owned());
    }
    if metadata.is_file() {
        return match File::open(path) {
            Ok(file) => Ok(Box::new(file)),
            Err(error) => Err(error.to_string()),
        };
    }
    Ok(Box::new(Stream::open(path.to_owned(), PATIENCE)?))
}

/// Reads a file that the user names, at most `most` bytes; `None` if it is longer.
///
/// # Errors
/// As [`open`].
pub fn read_at_most(path: &Path, most: u64) -> Result<Option<Vec<u8>>, String> {
    let mut bytes = Vec::new();
    let wanted = most.saturating_add(1);
    open(path)?
        .take(wanted)
        .read_to_end(&mut bytes)
        .map_err(|error| error.to_string())?;
    Ok((bytes.len() as u64 <= most).then_some(bytes))
}

/// A pipe or device, read on a thread of its own: opening and reading one may block for ever. The thread ends with the
/// program, or when it finds nobody listening.
struct Stream {
    chunks: Receiver<io::Result<Vec<u8>>>,
    chunk: io::Cursor<Vec<u8>>,
    patience: Duration,
}

impl Stream {
    fn open(path: PathBuf, patience: Duration) -> Result<Self, String> {
        let (sender, chunks) = sync_channel(4);
        std::thread::Builder::new()
            .name("reading a pipe".to_owned())
            .spawn(move || {
                let mut file = match File::open(path) {
                    Ok(file) => file,
                    Err(error) => {
                        let _ = sender.send(Err(error));
                        return;
                    }
                };
                loop {
                    let mut chunk = vec![0; CHUNK];
                    let read = file.read(&mut chunk).map(|count| {
                        chunk.truncate(count);
                        chunk
                    });
                    let is_last = read.as_ref().map_or(true, Vec::is_empty);
                    if sender.send(read).is_err() || is_last {
                        return;
                    }
                }
            })
            .map_err(|error| error.to_string())?;
        Ok(Self {
            chunks,
            chunk: io::Cursor::default(),
            patience,
        })
    }
}

impl Read for Stream {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let count = self.chunk.read(buffer)?;
        if count > 0 || buffer.is_empty() {
            return Ok(count);
        }
        match self.chunks.recv_timeout(self.patience) {
            Ok(chunk) => {
                self.chunk = io::Cursor::new(chunk?);
                self.chunk.read(buffer)
            }
            // The last chunk was empty.
            Err(RecvTimeoutError::Disconnected) => Ok(0),
            Err(RecvTimeoutError::Timeout) => Err(io::Error::new(
                io::ErrorKind::TimedOut,
                format!(
                    "it is a pipe or device that has brought nothing for {} s",
                    self.patience.as_secs_f64()
                ),
            )),
        }
    }
}

/// Why a file that another file names may not be read.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Unreachable {
    /// It is not below the folder, or a link leads out of it.
    Outside,
    /// The system cannot find it, in its words.
    Missing(String),
}

/// The file that `name` names below `folder`, all links resolved. Nothing is looked up for a name that leads outside by
/// its words alone, and a link that leads there is refused whether or not its end exists.
///
/// # Errors
/// [`Unreachable`].
pub fn below(folder: &Path, name: &Path) -> Result<PathBuf, Unreachable> {
    let mut depth = 0_usize;
    for component in name.components() {
        match component {
            Component::Normal(_) => depth += 1,
            Component::CurDir => {}
            Component::ParentDir => depth = depth.checked_sub(1).ok_or(Unreachable::Outside)?,
            // Absolute, a drive, or a share of another machine.
            Component::RootDir | Component::Prefix(_) => return Err(Unreachable::Outside),
        }
    }
    let missing = |error: io::Error| Unreachable::Missing(error.to_string());
    let folder = if folder.as_os_str().is_empty() {
        Path::new(".")
    } else {
        folder
    };
    let root = folder.canonicalize().map_err(missing)?;
    // From the folder down, so that the first link that leads out ends the search.
    let mut place = root.clone();
    for component in name.components() {
        place.push(component);
        let is_link = fs::symlink_metadata(&place).is_ok_and(|found| found.is_symlink());
        place = match place.canonicalize() {
            Ok(found) if found.starts_with(&root) => found,
            Ok(_) => return Err(Unreachable::Outside),
            Err(_) if is_link => return Err(Unreachable::Outside),
            Err(error) => return Err(missing(error)),
        };
    }
    Ok(place)
}

/// Writes a file beside its place and renames it there when it is whole; on failure what was written is removed, and what
/// was there before stays.
///
/// # Errors
/// The first that occurs.
pub fn write_beside(
    path: &Path,
    write: impl FnOnce(&mut BufWriter<File>) -> io::Result<()>,
) -> io::Result<()> {
    let mut file = Beside::create(path)?;
    write(&mut file.out)?;
    file.finish()
}

/// By what a file is known to be as it was left: another program that writes it changes one or the other.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Stamp {
    bytes: u64,
    modified: SystemTime,
}

impl Stamp {
    /// `None` if the system does not tell.
    #[must_use]
    pub fn of(path: &Path) -> Option<Self> {
        let about = fs::metadata(path).ok()?;
        Some(Self {
            bytes: about.len(),
            modified: about.modified().ok()?,
        })
    }
}

/// A file as it was when it was read.
#[derive(Clone, Debug)]
pub struct KnownFile {
    /// Where it lies.
    pub path: PathBuf,
    stamp: Option<Stamp>,
    contents: Option<u64>,
}

impl KnownFile {
    /// Reads it once.
    #[must_use]
    pub fn new(path: PathBuf) -> Self {
        Self {
            stamp: Stamp::of(&path),
            contents: contents_of(&path),
            path,
        }
    }

    /// Whether it is the same still; what has only a new time, as after a copy, is.
    #[must_use]
    pub fn is_unchanged(&self) -> bool {
        let is_untouched = self.stamp.is_some() && Stamp::of(&self.path) == self.stamp;
        is_untouched || self.contents.is_some() && contents_of(&self.path) == self.contents
    }
}

/// A hash of a file's bytes; `None` for what is no file that can be read.
fn contents_of(path: &Path) -> Option<u64> {
    let about = fs::metadata(path).ok().filter(fs::Metadata::is_file)?;
    let file = File::open(path).ok()?.take(about.len());
    let mut reader = BufReader::with_capacity(CHUNK, file);
    let mut hasher = DefaultHasher::new();
    loop {
        let bytes = reader.fill_buf().ok()?;
        if bytes.is_empty() {
            return Some(hasher.finish());
        }
        hasher.write(bytes);
        let count = bytes.len();
        reader.consume(count);
    }
}

/// A file that is being written beside its place; dropped before [`Beside::finish`], it is removed.
pub struct Beside {
    /// Takes the file's bytes.
    pub out: BufWriter<File>,
    partial: PathBuf,
    path: PathBuf,
}

impl Beside {
    /// Begins to write what will be `path`.
    ///
    /// # Errors
    /// The path names no file, or none can be made beside it.
    pub fn create(path: &Path) -> io::Result<Self> {
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
        Ok(Self {
            out: BufWriter::new(File::create(&partial)?),
            partial,
            path: path.to_owned(),
        })
    }

    /// Puts the file in its place.
    ///
    /// # Errors
    /// The first that occurs; what was there before stays.
    pub fn finish(mut self) -> io::Result<()> {
        self.out.flush()?;
        fs::rename(&self.partial, &self.path)
    }
}

impl Drop for Beside {
    fn drop(&mut self) {
        // Gone once it is finished.
        let _ = fs::remove_file(&self.partial);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn folder(name: &str) -> PathBuf {
        let path =
            std::env::temp_dir().join(format!("stereolux-files-{}-{name}", std::process::id()));
        let _ = fs::remove_dir_all(&path);
        fs::create_dir_all(path.join("scene/textures")).unwrap();
        fs::write(path.join("secret"), "secret").unwrap();
        fs::write(path.join("scene/textures/a.png"), "picture").unwrap();
        path
    }

    #[test]
    fn only_what_lies_below_is_reached() {
        let folder = folder("below");
        let scene = folder.join("scene");
        let find = |name: &str| below(&scene, Path::new(name));
        let picture = scene.join("textures/a.png").canonicalize().unwrap();
        for name in [
            "textures/a.png",
            "./textures/./a.png",
            "textures/../textures/a.png",
        ] {
            assert_eq!(find(name), Ok(picture.clone()), "{name}");
        }
        let absolute = folder.join("secret");
        for name in [
            "../secret",
            "textures/../../secret",
            "../scene/textures/a.png",
            absolute.to_str().unwrap(),
            "/nonexistent",
            "//server/share/x",
        ] {
            assert_eq!(find(name), Err(Unreachable::Outside), "{name}");
        }
        assert!(matches!(
            find("textures/b.png"),
            Err(Unreachable::Missing(_))
        ));
        fs::remove_dir_all(folder).unwrap();
    }

    #[cfg(unix)]
    #[test]
    fn links_are_followed_inside_alone() {
        use std::os::unix::fs::symlink;
        let folder = folder("links");
        let scene = folder.join("scene");
        symlink("textures/a.png", scene.join("inside")).unwrap();
        symlink("../secret", scene.join("outside")).unwrap();
        symlink(&folder, scene.join("up")).unwrap();
        symlink("/nonexistent/file", scene.join("dangling")).unwrap();
        symlink("loop", scene.join("loop")).unwrap();
        let find = |name: &str| below(&scene, Path::new(name));
        assert!(find("inside").is_ok());
        for name in [
            "outside",
            "up/secret",
            "up/none",
            "up/scene/textures/a.png",
            "dangling",
            "loop",
        ] {
            assert_eq!(find(name), Err(Unreachable::Outside), "{name}");
        }
        fs::remove_dir_all(folder).unwrap();
    }

    #[test]
    fn no_more_is_read_than_asked_for() {
        let folder = folder("length");
        let secret = folder.join("secret");
        assert_eq!(read_regular(&secret, u64::MAX).unwrap(), b"secret");
        assert_eq!(read_regular(&secret, 3).unwrap(), b"sec");
        assert_eq!(read_at_most(&secret, 6).unwrap().unwrap(), b"secret");
        assert_eq!(read_at_most(&secret, 5).unwrap(), None);
        assert!(read_regular(&folder, 1).unwrap_err().contains("directory"));
        assert!(read_at_most(&folder, 1).unwrap_err().contains("directory"));
        fs::remove_dir_all(folder).unwrap();
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn what_has_no_length_or_no_end_is_not_read_for_ever() {
        assert_eq!(
            read_regular(Path::new("/proc/self/maps"), u64::MAX).unwrap(),
            b""
        );
        assert!(read_regular(Path::new("/dev/zero"), 10).is_err());
        assert_eq!(read_at_most(Path::new("/dev/zero"), 1000).unwrap(), None);
    }

    #[cfg(unix)]
    #[test]
    fn a_pipe_is_read_and_one_without_a_writer_is_given_up() {
        let folder = folder("pipe");
        let pipe = |name: &str| {
            let path = folder.join(name);
            let made = std::process::Command::new("mkfifo").arg(&path).status();
            assert!(made.unwrap().success());
            path
        };
        let read = |path: PathBuf, patience| {
            let mut bytes = Vec::new();
            let mut stream = Stream::open(path, patience).unwrap();
            stream.read_to_end(&mut bytes).map(|_| bytes)
        };
        let error = read(pipe("silent"), Duration::from_millis(50)).unwrap_err();
        assert!(error.to_string().contains("brought nothing"), "{error}");
        let path = pipe("written");
        let writer = {
            let path = path.clone();
            std::thread::spawn(move || fs::write(path, vec![7; 200_000]).unwrap())
        };
        let bytes = read(path, Duration::from_secs(20)).unwrap();
        writer.join().unwrap();
        assert_eq!(bytes, vec![7; 200_000]);
        fs::remove_dir_all(folder).unwrap();
    }
}
