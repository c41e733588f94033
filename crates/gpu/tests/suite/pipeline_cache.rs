//! Compiled pipelines in a file.

use std::fs;

use stereolux_gpu::{GpuContext, Kernel, ShaderLibrary};

use crate::adapter;

/// A device that keeps its pipelines in `folder`, with one that is compiled and stored.
fn after_a_kernel(folder: &std::path::Path) -> GpuContext {
    let mut context = adapter::context();
    context.keep_pipelines_in(folder);
    let library = ShaderLibrary::embedded();
    Kernel::new(&context, &library, "passes/scan_add", &Default::default()).unwrap();
    context.store_pipelines();
    context
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
