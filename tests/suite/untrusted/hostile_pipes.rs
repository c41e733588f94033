//! Named pipes where a file is expected: one that nobody writes into is given up, one that brings something is read.
#![cfg(unix)]

use std::path::PathBuf;
use std::process::Command;

use stereolux::images::{ImageRgb, write_exr};

use super::hostile::run;
use crate::suite::support::{Folder, assert_says};

fn pipe(folder: &Folder, name: &str) -> PathBuf {
    let path = folder.join(name);
    let made = Command::new("mkfifo").arg(&path).status();
    assert!(made.unwrap().success());
    path
}

#[test]
fn a_pipe_without_a_writer_is_given_up() {
    let folder = Folder::new("hostile-pipes");
    let path = pipe(&folder, "pipe.toml").display().to_string();
    let out = folder.join("out").display().to_string();
    let lines: Vec<Vec<&str>> = vec![
        vec!["compare", &path, &path],
        vec!["info", "--config", &path],
        vec!["run", "--trace", &path, "--out", &out],
        vec!["run", "--headset", &path, "--out", &out],
    ];
    // Each waits for some seconds: side by side.
    std::thread::scope(|scope| {
        for line in &lines {
            scope.spawn(|| assert_says(run(line).refusal(), &["has brought nothing for"]));
        }
    });
    assert!(!folder.join("out").exists());
    // A scene or an environment from a pipe is no file at all.
    let scene = run(&["info", "--scene", &path]);
    assert_says(scene.refusal(), &["not a regular file"]);
    let setting = format!("environment.path={path}");
    let map = run(&["info", "--scene", "builtin:plane", "--set", &setting]);
    assert_says(map.refusal(), &["not a regular file"]);
}

#[test]
fn what_a_pipe_brings_is_read() {
    let folder = Folder::new("hostile-written-pipes");
    let write = |name: &str, bytes: Vec<u8>| {
        let path = pipe(&folder, name);
        let name = path.display().to_string();
        (
            name,
            std::thread::spawn(move || std::fs::write(path, bytes).unwrap()),
        )
    };
    let text = b"seed = 7\n[photon]\nkernel = \"cone\"\n".to_vec();
    let (config, writer) = write("config", text);
    let outcome = run(&["info", "--config", &config]);
    writer.join().unwrap();
    assert_eq!(outcome.status, Some(0), "{outcome:?}");
    let (config, writer) = write("faulty", b"seed = 7\n[photon]\nkernle = 1\n".to_vec());
    let outcome = run(&["info", "--config", &config]);
    writer.join().unwrap();
    assert_says(outcome.refusal(), &["kernle", "kernel"]);

    let image = folder.join("image.exr");
    write_exr(&image, &ImageRgb::filled(100, 100, [0.5; 3]).unwrap()).unwrap();
    let (piped, writer) = write("image", std::fs::read(&image).unwrap());
    let image = image.to_str().unwrap();
    let outcome = run(&["compare", &piped, image, "--max-rel-mse", "0"]);
    writer.join().unwrap();
    assert_eq!(outcome.status, Some(0), "{outcome:?}");

    // Without an end: no more than there is use for.
    let endless = run(&["info", "--config", "/dev/zero"]);
    assert_says(endless.refusal(), &["longer than"]);
    let endless = run(&["compare", "/dev/zero", "/dev/zero"]);
    assert_says(endless.refusal(), &["64 MiB"]);
    assert!(endless.peak_mib < 512, "{endless:?}");
}
