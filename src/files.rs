//! File access: reads up to a limit; atomic writes through links; plain writes to streams.
//!
//! A regular file is replaced by renaming a temporary one, `.NAME.sfers-tmp` in the same folder, which is locked while it is written. One that a
//! killed process left is not locked; the next process that writes the same file removes it.

use std::fs::{self, File, OpenOptions, TryLockError};
use std::io::{self, Read, Write};
use std::path::{Path, PathBuf};

/// Largest file that is read (bytes); the program writes smaller ones.
const LARGEST_FILE: u64 = 4 << 30;
/// Largest input from a pipe or a device, which may be endless (bytes).
const LARGEST_STREAM: u64 = 1 << 30;

/// Reads a file or a stream to its end.
///
/// # Errors
/// If it cannot be read, or is larger than the limit.
pub(crate) fn read(path: &Path) -> io::Result<Vec<u8>> {
    let file = File::open(path)?;
    let there = file.metadata()?;
    read_to_limit(file, if there.is_file() { LARGEST_FILE } else { LARGEST_STREAM })
}

/// Reads a file or a stream as UTF-8 text.
///
/// # Errors
/// As [`read`], and with the line if the content is not UTF-8.
pub(crate) fn read_text(path: &Path) -> io::Result<String> {
    text(read(path)?)
}

/// Reads standard input as UTF-8 text.
///
/// # Errors
/// As [`read_text`].
pub(crate) fn read_stdin() -> io::Result<String> {
    text(read_to_limit(io::stdin().lock(), LARGEST_STREAM)?)
}

fn read_to_limit(reader: impl Read, limit: u64) -> io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    if reader.take(limit + 1).read_to_end(&mut bytes)? as u64 > limit {
        return Err(io::Error::new(io::ErrorKind::FileTooLarge, format!("is larger than {limit} bytes")));
    }
    Ok(bytes)
}

fn text(bytes: Vec<u8>) -> io::Result<String> {
    String::from_utf8(bytes).map_err(|error| {
        let line = error.as_bytes()[..error.utf8_error().valid_up_to()].iter().filter(|&&b| b == b'\n').count() + 1;
        io::Error::new(io::ErrorKind::InvalidData, format!("line {line} is not UTF-8 text"))
    })
}

/// 64-bit FNV-1a, to detect changes. It is not cryptographic.
pub(crate) fn fnv1a(bytes: &[u8]) -> u64 {
    bytes.iter().fold(0xcbf2_9ce4_8422_2325, |hash, byte| (hash ^ u64::from(*byte)).wrapping_mul(0x100_0000_01b3))
}

/// A digest to detect changes: [`fnv1a`] and the length.
pub(crate) fn digest(bytes: &[u8]) -> String {
    format!("{:016x}, {} bytes", fnv1a(bytes), bytes.len())
}

/// True if a locking error means that the file system has no locks (ENOTSUP, ENOSYS, ENOLCK), as Lustre without flock.
pub(crate) fn cannot_lock(error: &io::Error) -> bool {
    const ENOLCK: i32 = if cfg!(target_os = "linux") { 37 } else { 77 };
    error.kind() == io::ErrorKind::Unsupported || error.raw_os_error() == Some(ENOLCK)
}

/// The path with a suffix after its extension, as `a.csv.manifest.json`.
pub(crate) fn with_suffix(path: &Path, suffix: &str) -> PathBuf {
    let mut name = path.as_os_str().to_owned();
    name.push(suffix);
    name.into()
}

/// An output that is checked but not yet written.
#[derive(Debug)]
pub(crate) struct Pending {
    path: PathBuf,
    to: To,
}

#[derive(Debug)]
enum To {
    /// A pipe or a character device, open.
    Stream(File),
    /// The regular file to replace, with links resolved.
    File(PathBuf),
}

impl Pending {
    /// Checks that `path` can be written, without changing it. A named pipe is opened, which waits for its reader.
    ///
    /// # Errors
    /// If it is a folder, a socket or a block device, or cannot be written.
    pub(crate) fn open(path: &Path) -> io::Result<Self> {
        let to = match fs::metadata(path) {
            Ok(there) if there.is_file() => To::File(fs::canonicalize(path)?),
            Ok(there) if there.is_dir() => return Err(io::Error::new(io::ErrorKind::IsADirectory, "it is a folder")),
            Ok(there) if is_stream(&there) => To::Stream(OpenOptions::new().write(true).open(path)?),
            Ok(_) => return Err(io::Error::new(io::ErrorKind::InvalidInput, "it is a socket or a block device")),
            Err(error) if error.kind() == io::ErrorKind::NotFound => To::File(end_of_links(path)?),
            Err(error) => return Err(error),
        };
        if let To::File(path) = &to {
            // A process killed during its work leaves no temporary file.
            drop(Temporary::beside(path)?);
        }
        Ok(Self { path: path.into(), to })
    }

    /// The path as it was given.
    pub(crate) fn path(&self) -> &Path {
        &self.path
    }

    /// True if the output is a pipe or a device, beside which no other file is written.
    pub(crate) fn is_stream(&self) -> bool {
        matches!(self.to, To::Stream(_))
    }

    /// Writes all bytes; a regular file replaces the previous one and keeps its mode, otherwise the umask's.
    ///
    /// # Errors
    /// If the bytes cannot be written; the previous file is then unchanged.
    pub(crate) fn finish(self, bytes: &[u8]) -> io::Result<()> {
        let path = match self.to {
            To::Stream(mut stream) => return stream.write_all(bytes).and_then(|()| stream.flush()),
            To::File(path) => path,
        };
        let mut temporary = Temporary::beside(&path)?;
        if let Ok(there) = fs::metadata(&path) {
            keep_owner(&temporary.file, &there);
            temporary.file.set_permissions(there.permissions())?;
        }
        temporary.file.write_all(bytes)?;
        // Some file systems report a full disk only here.
        temporary.file.sync_all()?;
        fs::rename(&temporary.path, &path)?;
        temporary.renamed = true;
        Ok(())
    }
}

/// The end of a chain of links, which need not exist.
fn end_of_links(path: &Path) -> io::Result<PathBuf> {
    let mut path = path.to_owned();
    // Linux follows 40 links; more are a loop.
    for _ in 0..40 {
        match fs::read_link(&path) {
            Ok(target) => path = folder_of(&path).join(target),
            Err(_) => return Ok(path),
        }
    }
    Err(io::Error::new(io::ErrorKind::InvalidInput, "too many links, one to the next"))
}

fn folder_of(path: &Path) -> &Path {
    path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

/// A temporary file of this process, removed unless it was renamed.
#[derive(Debug)]
struct Temporary {
    path: PathBuf,
    file: File,
    renamed: bool,
}

impl Temporary {
    /// Creates a temporary file beside `path`, one per process; removes those of dead processes.
    fn beside(path: &Path) -> io::Result<Self> {
        let mut number = 1;
        // Above the number of processes that write one file at a time.
        for _ in 0..1000 {
            let path = temporary_name(path, number);
            match OpenOptions::new().write(true).create_new(true).open(&path) {
                Ok(file) => match file.try_lock() {
                    Ok(()) if is_at(&file, &path) => return Ok(Self { path, file, renamed: false }),
                    // Another process removed it before it was locked.
                    Ok(()) | Err(TryLockError::WouldBlock) => {}
                    // Without locks no process removes it.
                    Err(TryLockError::Error(error)) if cannot_lock(&error) => return Ok(Self { path, file, renamed: false }),
                    Err(TryLockError::Error(error)) => {
                        let _ = fs::remove_file(&path);
                        return Err(error);
                    }
                },
                Err(error) if error.kind() == io::ErrorKind::AlreadyExists => {
                    if !left_behind(&path) {
                        number += 1;
                    }
                }
                Err(error) => return Err(error),
            }
        }
        let name = temporary_name(path, 1);
        Err(io::Error::other(format!("temporary files like {} are in the way; remove them", name.display())))
    }
}

impl Drop for Temporary {
    fn drop(&mut self) {
        if !self.renamed {
            let _ = fs::remove_file(&self.path);
        }
    }
}

/// Removes a temporary file of a dead process. False if it is in use or cannot be checked.
fn left_behind(path: &Path) -> bool {
    match fs::symlink_metadata(path) {
        Err(_) => return true,
        Ok(there) if !there.is_file() => return false,
        Ok(_) => {}
    }
    let Ok(file) = OpenOptions::new().write(true).open(path) else { return !path.exists() };
    match file.try_lock() {
        // The check protects a file that was just renamed to its place.
        Ok(()) if is_at(&file, path) => fs::remove_file(path).is_ok(),
        Ok(()) => true,
        Err(_) => false,
    }
}

fn temporary_name(path: &Path, number: u32) -> PathBuf {
    let name = path.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned());
    // Names have at most 255 bytes.
    let end = (0..=name.len().min(200)).rev().find(|&end| name.is_char_boundary(end)).unwrap_or(0);
    let number = if number == 1 { String::new() } else { format!("{number}.") };
    folder_of(path).join(format!(".{}.{number}sfers-tmp", &name[..end]))
}

#[cfg(unix)]
mod system {
    use std::fs::{File, Metadata};
    use std::os::unix::fs::{FileTypeExt, MetadataExt, fchown};
    use std::path::Path;

    /// True if a file is a pipe or a character device.
    pub fn is_stream(there: &Metadata) -> bool {
        there.file_type().is_fifo() || there.file_type().is_char_device()
    }

    /// True if an open file is the one at a path.
    pub fn is_at(file: &File, path: &Path) -> bool {
        let identity = |data: Metadata| (data.dev(), data.ino());
        match (file.metadata(), std::fs::symlink_metadata(path)) {
            (Ok(open), Ok(there)) => identity(open) == identity(there),
            _ => false,
        }
    }

    /// Gives a file the owner and group of the one that it replaces, if permitted.
    pub fn keep_owner(file: &File, there: &Metadata) {
        let _ = fchown(file, Some(there.uid()), Some(there.gid()));
    }
}

#[cfg(not(unix))]
mod system {
    use std::fs::{File, Metadata};
    use std::path::Path;

    pub fn is_stream(_: &Metadata) -> bool {
        false
    }

    pub fn is_at(_: &File, path: &Path) -> bool {
        path.exists()
    }

    pub fn keep_owner(_: &File, _: &Metadata) {}
}

use system::{is_at, is_stream, keep_owner};

/// Exclusive access to a folder, by a locked file `.sfers-lock` in it that is removed at the end.
#[derive(Debug)]
pub(crate) struct FolderLock {
    path: PathBuf,
    /// Keeps the lock.
    _file: File,
}

/// Result of locking a folder.
#[derive(Debug)]
pub(crate) enum Locking {
    /// This process has the lock.
    Locked(FolderLock),
    /// Another process has the lock.
    Busy,
    /// The file system has no locks.
    Unsupported,
}

impl FolderLock {
    /// Locks an existing folder.
    ///
    /// # Errors
    /// If the lock file cannot be opened or locked.
    pub(crate) fn take(folder: &Path) -> io::Result<Locking> {
        let path = folder.join(".sfers-lock");
        for _ in 0..1000 {
            let file = OpenOptions::new().write(true).create(true).truncate(false).open(&path)?;
            match file.try_lock() {
                Ok(()) if is_at(&file, &path) => return Ok(Locking::Locked(Self { path, _file: file })),
                // Its process ended and removed it in between.
                Ok(()) => {}
                Err(TryLockError::WouldBlock) => return Ok(Locking::Busy),
                Err(TryLockError::Error(error)) if cannot_lock(&error) => {
                    let _ = fs::remove_file(&path);
                    return Ok(Locking::Unsupported);
                }
                Err(TryLockError::Error(error)) => return Err(error),
            }
        }
        Ok(Locking::Busy)
    }
}

impl Drop for FolderLock {
    fn drop(&mut self) {
        let _ = fs::remove_file(&self.path);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(folder: &Path) -> Vec<String> {
        let mut names: Vec<_> =
            fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
        names.sort();
        names
    }

    #[test]
    fn a_temporary_file_that_a_kill_left_is_taken_away_and_one_in_use_is_not() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.csv");
        fs::write(folder.path().join(".a.csv.sfers-tmp"), "half").unwrap();
        let first = Temporary::beside(&path).unwrap();
        let second = Temporary::beside(&path).unwrap();
        assert_eq!(names(folder.path()), [".a.csv.2.sfers-tmp", ".a.csv.sfers-tmp"]);
        assert_eq!(fs::read(&first.path).unwrap(), b"");
        drop((first, second));
        Pending::open(&path).unwrap().finish(b"whole").unwrap();
        assert_eq!((names(folder.path()), fs::read(&path).unwrap()), (vec!["a.csv".to_owned()], b"whole".to_vec()));
    }

    #[test]
    fn twenty_threads_write_one_file_and_it_is_always_whole() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.csv");
        let text = |i: u8| vec![b'a' + i; 20_000];
        std::thread::scope(|scope| {
            for i in 0..20 {
                let path = &path;
                scope.spawn(move || {
                    for _ in 0..5 {
                        Pending::open(path).unwrap().finish(&text(i)).unwrap();
                        let now = fs::read(path).unwrap();
                        assert!(now.len() == 20_000 && now.iter().all(|b| *b == now[0]));
                    }
                });
            }
        });
        assert_eq!(names(folder.path()), ["a.csv"]);
    }

    #[test]
    fn the_longest_name_can_be_written() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("é".repeat(127));
        Pending::open(&path).unwrap().finish(b"x").unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"x");
    }

    #[test]
    fn a_folder_is_locked_once_and_again_when_the_first_is_done() {
        let folder = tempfile::tempdir().unwrap();
        let Locking::Locked(lock) = FolderLock::take(folder.path()).unwrap() else { panic!() };
        assert!(matches!(FolderLock::take(folder.path()).unwrap(), Locking::Busy));
        drop(lock);
        assert!(matches!(FolderLock::take(folder.path()).unwrap(), Locking::Locked(_)));
        assert!(names(folder.path()).is_empty());
    }

    #[test]
    fn a_stream_without_end_is_refused_at_the_limit_and_text_by_its_line() {
        assert_eq!(read_to_limit(io::repeat(0).take(10), 10).unwrap().len(), 10);
        assert!(read_to_limit(io::repeat(0), 10).unwrap_err().to_string().contains("larger than 10 bytes"));
        let text = text(b"a\nb\xff".to_vec()).unwrap_err().to_string();
        assert!(text.contains("line 2"), "{text}");
    }

    #[test]
    fn digests_differ_where_contents_do() {
        assert_ne!(digest(b"t_s,v1_v\n0,1\n"), digest(b"t_s,v1_v\n0,2\n"));
        // The empty text's FNV-1a is its offset basis, that of "a" is published.
        assert_eq!(digest(b""), "cbf29ce484222325, 0 bytes");
        assert_eq!(digest(b"a"), "af63dc4c8601ec8c, 1 bytes");
    }
}
