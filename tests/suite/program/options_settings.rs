//! Settings in layers: defaults, file, `--set`; what each refuses and where it says the fault is.

use std::path::Path;

use stereolux::options::layers::Layers;
use stereolux::settings::{Kernel, Kind, Settings, registry};

use super::support::{Folder, assert_begins, assert_says, words};

fn from_toml(text: &str) -> Result<Settings, String> {
    let mut layers = Layers::default();
    layers
        .add_toml(text, "c.toml")
        .map_err(|error| error.to_string())?;
    layers.finish().map_err(|error| error.to_string())
}

fn from_set(arguments: &[&str]) -> Result<Settings, String> {
    let mut layers = Layers::default();
    for argument in arguments {
        let added = layers.add_set(argument);
        added.map_err(|error| error.to_string())?;
    }
    layers.finish().map_err(|error| error.to_string())
}

#[test]
fn each_default_is_in_its_own_range_and_each_bound_is_taken() {
    for setting in registry::all() {
        let default = setting.default_value();
        if default.is_null() {
            continue;
        }
        let set = format!("{}={default}", setting.key);
        assert_eq!(from_set(&[&set]), Ok(Settings::default()), "{set}");
    }
    for setting in registry::all() {
        let owned = |line: &str| -> Vec<String> {
            let words = words(line).into_iter();
            words.map(str::to_owned).collect()
        };
        let (inside, outside) = match setting.kind {
            Kind::Whole { min, max } => (
                owned(&format!("{min} {max}")),
                owned(&format!("{} -1 1.5", max + 1)),
            ),
            Kind::Real {
                min,
                max,
                inclusive,
            } => {
                let bounds = owned(&format!("{min} {max}"));
                let beyond = owned(&format!("{} {} nan inf x", min - 0.5, max * 2.0));
                if inclusive {
                    (bounds, beyond)
                } else {
                    (vec![], [bounds, beyond].concat())
                }
            }
            Kind::Bool => (owned("true false"), owned("1 yes")),
            // What has the word on may be true.
            Kind::Choice { words, .. } => match words.contains(&"on") {
                true => (owned(&words.join(" ")), owned("other 1")),
                false => (owned(&words.join(" ")), owned("other true false")),
            },
            Kind::List { words } => (
                vec![words.join(" , "), words[0].to_owned(), String::new()],
                owned(&format!("{},other 1", words[0])),
            ),
            Kind::Text { .. } => (vec!["some text".into()], vec![]),
            Kind::Size { max } => {
                let beyond = format!("[1, {}]", max + 1);
                let inside = vec!["[1, 1]".into(), format!("{max}x{max}")];
                (inside, [owned("0x1 [1] 7"), vec![beyond]].concat())
            }
        };
        for value in inside {
            let set = format!("{}={value}", setting.key);
            assert!(from_set(&[&set]).is_ok(), "{set}: {:?}", from_set(&[&set]));
        }
        for value in outside {
            let set = format!("{}={value}", setting.key);
            let message = from_set(&[&set]).expect_err(&set);
            assert_says(&message, &[setting.key, &value, &setting.kind.allowed()]);
        }
    }
}

#[test]
fn later_layers_win() {
    let mut layers = Layers::default();
    let file = "spp = 2\nseed = 5\n[photon]\ncount = 10\nkernel = 'cone'\n";
    layers.add_toml(file, "c.toml").unwrap();
    layers.add_set("photon.count = 20").unwrap();
    layers.add_set("spp=3").unwrap();
    layers.add_flag("--spp", "spp", "4").unwrap();
    assert!(layers.is_set("seed") && !layers.is_set("scene"));
    let render = layers.finish().unwrap().render;
    assert_eq!((render.spp, render.seed), (4, 5));
    let photon = render.photon;
    assert_eq!((photon.count, photon.kernel), (20, Kernel::Cone));
    let default = Settings::default().render.photon.max_depth;
    assert_eq!(photon.max_depth, default);
}

#[test]
fn ways_to_gather_that_do_not_go_together_are_one_clear_error() {
    let all = |search, estimate, schedule, loads| {
        from_set(&[
            &format!("photon.search={search}"),
            &format!("photon.estimate={estimate}"),
            &format!("photon.schedule={schedule}"),
            &format!("photon.loads={loads}"),
        ])
    };
    let mut taken = 0;
    for search in ["grid", "kd-tree"] {
        for estimate in ["radius", "nearest"] {
            for schedule in ["split", "fused"] {
                for loads in ["direct", "cooperative"] {
                    let plain = search == "grid" && estimate == "radius";
                    let fits = match (schedule, loads) {
                        ("split", "direct") => true,
                        ("fused", "cooperative") => false,
                        _ => plain,
                    };
                    match all(search, estimate, schedule, loads) {
                        Ok(_) => taken += 1,
                        Err(message) => {
                            assert!(!fits, "{message}");
                            assert!(!message.contains('\n') && message.contains(" needs "));
                            let is_fused = usize::from(schedule == "fused");
                            let odd = ["photon.loads", "photon.schedule"][is_fused];
                            assert_says(&message, &[odd]);
                        }
                    }
                }
            }
        }
    }
    // Four searches and estimates, and the two others alone.
    assert_eq!(taken, 6);
}

#[test]
fn toml_and_bare_values() {
    let settings = from_set(&[
        "photon.radius_m=.05",
        "photon.count=0x10",
        "photon.capacity=1_000",
        "environment.path=/a dir/b=c.hdr",
        "scene=\"quoted.glb\"",
        "environment.strength=2",
        "size=64x32",
    ])
    .unwrap();
    let photon = settings.render.photon;
    assert_eq!((photon.radius_m, photon.count), (0.05, 16));
    assert_eq!(photon.capacity, 1000);
    assert_eq!(settings.environment.path, "/a dir/b=c.hdr");
    assert_eq!(settings.environment.strength, 2.0);
    assert_eq!(settings.scene, "quoted.glb");
    assert_eq!(settings.size, Some([64, 32]));
    let dotted = from_toml("size = [64, 32]\nphoton.count = 3").unwrap();
    assert_eq!(dotted.render.photon.count, 3);
}

#[test]
fn faults_in_a_file_name_line_key_value_and_remedy() {
    let radius = "`photon.raduis_m`; the nearest known one is `photon.radius_m`";
    let photon = "nearest known one is `photon`";
    let many_nines = format!("seed = {}\n", "9".repeat(44));
    for (text, line, says) in [
        ("spp = 2\n[photon]\nraduis_m = 1\n", 3, radius),
        ("# c\n\n[photons]\ncount = 3\n", 3, photon),
        ("photons.count = 3", 1, photon),
        ("spp = 2\nspp = 3\n", 2, "duplicate"),
        (
            "\nspp = 0\n",
            2,
            "spp = 0: must be a whole number from 1 to 1048576",
        ),
        ("spp = \"two\"", 1, "spp = \"two\": must be"),
        (
            "\n\n[photon]\n\nkernel = \"box\"\n",
            5,
            "must be constant, epanechnikov or cone",
        ),
        ("photon = 3\n", 1, "is a section"),
        ("[spp]\nx = 1\n", 1, "spp"),
        ("spp = \n", 1, "TOML"),
        ("spp = 1\nsize = [64,\n", 2, "TOML"),
        ("scene = 1979-05-27\n", 1, "must be text"),
        (&many_nines, 1, "seed"),
        ("size = [64]\n", 1, "[width, height]"),
        ("gpu.timestamps = 1\n", 1, "must be auto, on, stages or off"),
        ("photon.every_frame = 1\n", 1, "true or false"),
    ] {
        let message = from_toml(text).expect_err(text);
        assert_begins(&message, &format!("c.toml:{line}: "));
        assert_says(&message, &[says]);
        assert!(!message.contains('\n'), "{message}");
    }
    // Negative control: the same file without its fault is taken.
    assert!(from_toml("spp = 2\n[photon]\nradius_m = 1\n").is_ok());
    assert!(from_toml("").is_ok());
}

#[test]
fn unknown_keys_find_their_nearest() {
    for (key, nearest) in [
        ("photon.radius", "photon.radius_m"),
        ("radius_m", "photon.radius_m"),
        ("Method", "method"),
        ("SPP", "spp"),
        ("max_deph", "path.max_depth"),
        ("force.gloss", "force.glossy"),
        ("output.exposur", "output.exposure"),
    ] {
        let message = from_set(&[&format!("{key}=1")]).expect_err(key);
        assert!(message.ends_with(&format!("is `{nearest}`")), "{message}");
    }
    assert!(from_set(&["no-equals"]).unwrap_err().contains("key=value"));
    assert!(from_set(&["=3"]).is_err());
    assert!(!from_set(&["a\nb=3"]).unwrap_err().contains('\n'));
}

#[test]
fn config_files_that_cannot_be_read() {
    let directory = Folder::new("config-files");
    let refused = |path: &Path| Layers::default().add_file(path).unwrap_err().to_string();
    assert!(refused(directory.path()).contains("directory"));
    assert!(refused(&directory.join("missing.toml")).contains("cannot be read"));
    let binary = directory.write("binary.toml", b"spp = 1\n\xff\xfe");
    assert_says(&refused(&binary), &["binary.toml:2: "]);
    let huge = directory.write("huge.toml", vec![b'#'; (1 << 20) + 1]);
    assert!(refused(&huge).contains("longer than"));
    let fine = directory.write("fine.toml", "spp = 9\r\n");
    let mut layers = Layers::default();
    layers.add_file(&fine).unwrap();
    assert_eq!(layers.finish().unwrap().render.spp, 9);
}
