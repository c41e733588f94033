//! Settings written as TOML and changed by key: both by the registry's own checks.

use std::path::Path;

use serde_json::{Value, json};
use stereolux::options::layers::Layers;
use stereolux::options::{Extent, changed, example_toml, save, to_toml, with_paths_in};
use stereolux::settings::registry::{self, sections};
use stereolux::settings::{Kind, Settings, UserDomain, UserPass};

use super::support::{Folder, assert_says, assert_success, stereolux};
use super::trace_probe::Random;

fn from_toml(text: &str) -> Settings {
    let mut layers = Layers::default();
    layers.add_toml(text, "saved.toml").unwrap();
    layers.finish().unwrap()
}

/// A value that the setting takes.
fn random_value(random: &mut Random, kind: Kind) -> Value {
    match kind {
        Kind::Bool => json!(random.below(2) == 0),
        Kind::Whole { min, max } => match random.below(4) {
            0 => json!(min),
            1 => json!(max),
            _ => json!(min + random.bits() % (max - min + 1)),
        },
        Kind::Real {
            min,
            max,
            inclusive,
        } => match random.below(4) {
            0 if inclusive => json!(min),
            1 if inclusive => json!(max),
            2 => json!(min + (max - min) * 1e-7 * (0.1 + random.unit())),
            _ => json!(min + (max - min) * (0.001 + 0.998 * random.unit())),
        },
        Kind::Choice { words, .. } => json!(words[random.below(words.len())]),
        Kind::Text { .. } => {
            let parts = [
                "a", "ü", "\"", "\\", "#", "'", " b", "\t", "\n", "=", "]", "builtin:",
            ];
            let mut text = String::from("x");
            for _ in 0..random.below(6) {
                text.push_str(parts[random.below(parts.len())]);
            }
            json!(text)
        }
        Kind::List { words } => {
            let listed = words.iter().filter(|_| random.below(2) == 0);
            json!(listed.copied().collect::<Vec<_>>().join(","))
        }
        Kind::Size { max } => {
            let mut side = || 1 + random.bits() % u64::from(max);
            json!([side(), side()])
        }
    }
}

#[test]
fn random_settings_survive_writing_and_reading() {
    let mut random = Random(3);
    let mut taken = 0;
    for _ in 0..300 {
        let mut settings = Settings::default();
        for setting in registry::all() {
            if random.below(3) == 0 {
                let value = random_value(&mut random, setting.kind);
                // Ways to gather that do not go together are refused, and the settings stay.
                if let Ok(other) = changed(&settings, setting.key, &value) {
                    settings = other;
                    taken += 1;
                }
            }
        }
        for extent in [Extent::Changed, Extent::All] {
            let text = to_toml(&settings, extent);
            assert_eq!(from_toml(&text), settings, "{text}");
        }
    }
    assert!(taken > 300 * registry::all().count() / 4, "{taken}");
}

#[test]
fn only_what_differs_is_written_with_its_explanation() {
    let plain = Settings::default();
    assert_eq!(to_toml(&plain, Extent::Changed).lines().count(), 1);
    let once = changed(&plain, "photon.count", &json!(1000)).unwrap();
    let twice = changed(&once, "spp", &json!(4)).unwrap();
    let text = to_toml(&twice, Extent::Changed);
    let expected = "
# samples per pixel and frame, averaged (samples per pixel, a whole number from 1 to 1048576)
spp = 4

[photon]
# photons emitted per frame (photons, a whole number from 0 to 67108864)
count = 1000";
    assert!(text.lines().skip(1).eq(expected.lines()), "{text}");
    let all = to_toml(&plain, Extent::All);
    for setting in registry::all() {
        let key = setting.key.rsplit('.').next().unwrap();
        let unset = setting.default_value().is_null();
        assert_eq!(all.contains(&format!("\n{key} = ")), !unset, "{key}");
        assert!(all.contains(setting.doc) != unset);
    }
}

#[test]
fn settings_are_changed_by_key_with_the_checks_of_set() {
    let plain = Settings::default();
    for (key, value, argument) in [
        ("photon.count", json!(-1), "photon.count=-1"),
        ("photon.radius_m", json!("wide"), "photon.radius_m=\"wide\""),
        ("method", json!("raster"), "method=\"raster\""),
        (
            "photon.progressive_alpha",
            json!(1),
            "photon.progressive_alpha=1",
        ),
        ("photon.cuont", json!(1), "photon.cuont=1"),
        ("size", json!([0, 5]), "size=[0,5]"),
        ("scene", json!(""), "scene=\"\""),
    ] {
        let mut layers = Layers::default();
        let by_set = layers.add_set(argument).unwrap_err();
        assert_eq!(changed(&plain, key, &value).unwrap_err(), by_set);
    }
    let fused = changed(&plain, "photon.schedule", &json!("fused")).unwrap();
    let error = changed(&fused, "photon.search", &json!("kd-tree")).unwrap_err();
    assert!(error.to_string().contains(" needs "), "{error}");

    let sized = changed(&plain, "size", &json!([640, 480])).unwrap();
    assert_eq!(sized.value("size"), json!([640, 480]));
    assert_eq!(changed(&sized, "size", &Value::Null).unwrap(), plain);
    assert!(changed(&plain, "spp", &Value::Null).is_err());
    for setting in registry::all() {
        let value = plain.value(setting.key);
        assert_eq!(value, setting.default_value());
        assert_eq!(changed(&plain, setting.key, &value).unwrap(), plain);
    }
}

#[test]
fn the_sections_of_the_listing_are_those_of_the_keys() {
    let mut seen = Vec::new();
    for section in sections() {
        assert_ne!(section.title, section.name(), "no heading");
        assert!(!seen.contains(&section.name()), "{}", section.name());
        seen.push(section.name());
        for setting in section.settings() {
            assert_eq!(registry::section_of(setting.key), section.name());
            assert_eq!(registry::find(setting.key).unwrap().doc, setting.doc);
            assert!(!setting.doc.is_empty(), "{}", setting.key);
        }
    }
}

#[test]
fn the_example_is_what_the_table_gives_and_holds_the_defaults() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("config/example.toml");
    if std::env::var_os("STEREOLUX_WRITE_EXAMPLE").is_some() {
        std::fs::write(&path, example_toml()).unwrap();
    }
    let example = std::fs::read_to_string(&path).unwrap();
    assert!(
        example == example_toml(),
        "{} differs from the table of settings: STEREOLUX_WRITE_EXAMPLE=1 writes it again",
        path.display()
    );
    assert_eq!(from_toml(&example), Settings::default());
    // Uncommented, every line is taken, and changes nothing but what has no default.
    let mut uncommented = String::new();
    let mut settings = 0;
    for line in example.lines() {
        match line.strip_prefix('#') {
            Some(setting) if !setting.starts_with(' ') => {
                uncommented += setting;
                settings += 1;
            }
            _ => uncommented += line,
        }
        uncommented.push('\n');
    }
    assert_eq!(settings, registry::all().count());
    let taken = from_toml(&uncommented);
    assert!(taken.size.is_some());
    let unsized_again = changed(&taken, "size", &Value::Null).unwrap();
    assert_eq!(unsized_again, Settings::default());
}

#[test]
fn a_saved_file_works_from_another_folder() {
    let mut settings = Settings {
        scene: "scenes/room.glb".to_owned(),
        headset: "mine.toml".to_owned(),
        ..Settings::default()
    };
    settings.environment.path = "/absolute/sky.hdr".to_owned();
    settings.simulated.hands = "hands.toml".to_owned();
    settings.gpu.shader_folder = "shaders".to_owned();
    settings.render.user_passes = vec![UserPass {
        file: "passes/glow.wesl".into(),
        name: "glow".to_owned(),
        after: "taa".to_owned(),
        over: UserDomain::default(),
    }];
    let placed = with_paths_in(&settings, Path::new("/home/me"));
    assert_eq!(placed.scene, "/home/me/scenes/room.glb");
    assert_eq!(placed.headset, "/home/me/mine.toml");
    assert_eq!(placed.environment.path, "/absolute/sky.hdr");
    assert_eq!(placed.simulated.hands, "/home/me/hands.toml");
    assert_eq!(placed.gpu.shader_folder, "/home/me/shaders");
    let passes = &placed.render.user_passes;
    assert_eq!(passes[0].file, Path::new("/home/me/passes/glow.wesl"));
    // What names no file stays empty.
    let names = Settings::default();
    assert_eq!(with_paths_in(&names, Path::new("/home/me")), names);

    let folder = Folder::new("options-saving");
    let path = folder.join("mine.toml");
    let saved = changed(&names, "photon.count", &json!(777)).unwrap();
    save(&saved, &path, Extent::Changed).unwrap();
    assert_eq!(from_toml(&std::fs::read_to_string(&path).unwrap()), saved);
    assert_success(&stereolux(&["info", "--config", path.to_str().unwrap()]));
    let error = save(&saved, folder.path(), Extent::All).unwrap_err();
    let error = error.to_string();
    assert_says(&error, &["settings cannot be written"]);
    assert!(!error.contains('\n'), "{error}");
    assert_eq!(folder.files(), ["mine.toml"]);
}
