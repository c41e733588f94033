//! Compiled pipelines in a file.

use std::fs;
use std::hash::{DefaultHasher, Hasher as _};
use std::path::{Path, PathBuf};

use stereolux_gpu::{GpuContext, Kernel, ShaderLibrary};

use crate::adapter;

/// A device that keeps its pipelines in `folder`, with those of `passes` compiled and stored.
fn after_kernels(folder: &Path, passes: &[&str]) -> GpuContext {
    let mut context = adapter::context();
    context.keep_pipelines_in(folder);
    let library = ShaderLibrary::embedded();
    for pass in passes {
        Kernel::new(&context, &library, pass, &Default::default()).unwrap();
    }
    context.store_pipelines();
    context
}

fn after_a_kernel(folder: &Path) -> GpuContext {
    after_kernels(folder, &["passes/scan_add"])
}

/// The only file in a folder.
fn file_in(folder: &Path) -> PathBuf {
    let mut files = fs::read_dir(folder).unwrap().map(Result::unwrap);
    files.next().unwrap().path()
}

#[test]
fn a_driver_is_given_what_it_wrote_and_nothing_of_another_adapter() {
    let folder =
        std::env::temp_dir().join(format!("stereolux-pipelines-given-{}", std::process::id()));
    let _ = fs::remove_dir_all(&folder);
    let [first, second, both] = ["first", "second", "both"].map(|name| folder.join(name));
    let passes = ["passes/scan_add", "passes/scan_blocks"];
    after_kernels(&first, &passes[..1]);
    after_kernels(&second, &passes[1..]);
    after_kernels(&both, &passes);
    let length = |folder: &Path| fs::metadata(file_in(folder)).unwrap().len();
    let alone = length(&first).max(length(&second));
    // A driver that keeps what it compiles (Mesa's llvmpipe keeps none of it here) has the first pipeline beside the second.
    let keeps = length(&both) > alone;
    after_kernels(&first, &passes[1..]);
    assert_eq!(length(&first) > alone, keeps);
    // With any driver: the file's adapter, in wgpu's header, is made another's under a right checksum. So the file is refused and
    // stays; had it not been read, a new one would be written.
    let file = file_in(&both);
    let mut bytes = fs::read(&file).unwrap();
    bytes[8 + 20] ^= 1;
    let mut hasher = DefaultHasher::new();
    hasher.write(&bytes[8..]);
    let sum = hasher.finish().to_le_bytes();
    bytes[..8].copy_from_slice(&sum);
    fs::write(&file, &bytes).unwrap();
    after_kernels(&both, &passes);
    assert!(fs::read(&file).unwrap() == bytes);
    fs::remove_dir_all(&folder).unwrap();
}

#[test]
fn what_is_kept_is_taken_up_and_what_is_damaged_replaced() {
    let folder = std::env::temp_dir().join(format!("stereolux-pipelines-{}", std::process::id()));
    let _ = fs::remove_dir_all(&folder);
    after_a_kernel(&folder);
    let files: Vec<_> = fs::read_dir(&folder).unwrap().map(Result::unwrap).collect();
    let [file] = &files[..] else {
        panic!("one file, and nothing half written: {files:?}");
    };
    let whole = fs::read(file.path()).unwrap();
    let written = || fs::metadata(file.path()).unwrap().modified().unwrap();
    let first = written();
    // A driver that has nothing to add leaves the file alone.
    after_a_kernel(&folder);
    let again = fs::read(file.path()).unwrap();
    assert_eq!(again == whole, written() == first);
    // In the checksum, in wgpu's header, in the driver's data; less, more, nothing.
    let mut damaged: Vec<Vec<u8>> = [0, 8, 20, whole.len() - 1]
        .map(|at| {
            let mut bytes = whole.clone();
            bytes[at] ^= 1;
            bytes
        })
        .into();
    damaged.extend([
        whole[..whole.len() - 1].to_vec(),
        [&whole[..], b"x"].concat(),
        Vec::new(),
    ]);
    for bytes in damaged {
        fs::write(file.path(), &bytes).unwrap();
        after_a_kernel(&folder);
        assert_eq!(fs::read(file.path()).unwrap().len(), whole.len());
        assert_ne!(fs::read(file.path()).unwrap(), bytes);
    }
    fs::remove_dir_all(&folder).unwrap();
    // A folder that cannot be made stops nothing.
    fs::write(&folder, "a file").unwrap();
    after_a_kernel(&folder);
    fs::remove_file(&folder).unwrap();
}
