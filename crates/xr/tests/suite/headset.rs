//! Headset profiles: the embedded ones, the user's own, and faults in them.

#![allow(clippy::unwrap_used)]

use glam::{DQuat, DVec3};
use std::path::Path;
use stereolux_xr::{Fov, Headset, Pose};

use crate::folders::Folder;

#[test]
fn the_embedded_profiles_hold_the_published_figures() {
    assert_eq!(Headset::names(), ["quest3", "index", "vive", "symmetric"]);
    for name in Headset::names() {
        let headset = Headset::load(name).unwrap();
        assert_eq!(headset.name, name);
        assert!(!headset.source.is_empty());
        assert_eq!(headset.refresh_hz, 90.0);
    }
    let quest3 = Headset::load("quest3").unwrap();
    assert_eq!(quest3.size, [2064, 2208]);
    assert!(quest3.refresh_rates_hz.contains(&120.0));
    assert_eq!(
        quest3.eyes[0].fov,
        Fov::from_degrees(-54.0, 40.0, 43.98, -54.27)
    );
    // Mirror images of each other.
    assert_eq!(
        quest3.eyes[0].fov.angle_left,
        -quest3.eyes[1].fov.angle_right
    );
    assert_eq!(Headset::load("index").unwrap().size, [1440, 1600]);
    let vive = Headset::load("vive").unwrap();
    assert_eq!(vive.size, [1080, 1200]);
    assert_eq!(
        vive.eyes[1].head_from_eye.position,
        DVec3::new(0.0315, 0.0, 0.015)
    );
    let symmetric = Headset::load("symmetric").unwrap();
    assert_eq!(symmetric.size, [512, 512]);
    assert_eq!(symmetric.ipd_m, 0.063);
    // tan(pi/4) is 1 to one ulp.
    assert!((symmetric.eyes[0].fov.tangents().left + 1.0).abs() < 1e-15);
}

#[test]
fn an_unknown_name_lists_the_known_ones() {
    let error = Headset::load("quest9").unwrap_err();
    assert!(error.is_unusable_input());
    let text = error.to_string();
    for part in ["quest9", "quest3", "index", "vive", "symmetric"] {
        assert!(text.contains(part), "{text}");
    }
}

#[test]
fn overrides_replace_offsets_cant_and_angles() {
    for name in Headset::names() {
        let size = Headset::load(name).unwrap().size;
        let headset = Headset::load(name).unwrap().with_ipd(0.1).unwrap();
        let [left, right] = headset.views_from_head(&Pose::IDENTITY);
        assert_eq!(left.position_in_world, DVec3::new(-0.05, 0.0, 0.0));
        assert_eq!(right.position_in_world, DVec3::new(0.05, 0.0, 0.0));
        assert_eq!(left.orientation, DQuat::IDENTITY);
        assert_eq!(headset.size, size);
        let headset = Headset::load(name)
            .unwrap()
            .with_fov(Fov::from_degrees(-40.0, 50.0, 30.0, -20.0))
            .unwrap();
        assert_eq!(
            headset.eyes[0].fov,
            Fov::from_degrees(-40.0, 50.0, 30.0, -20.0)
        );
        assert_eq!(headset.eyes[0].fov, headset.eyes[1].fov);
        assert_eq!(
            headset.eyes[1].head_from_eye,
            Pose::new(DVec3::new(0.0315, 0.0, 0.0), DQuat::IDENTITY)
        );
    }
}

#[test]
fn at_ipd_zero_and_equal_angles_the_eyes_are_one() {
    let headset = Headset::load("index")
        .unwrap()
        .with_ipd(0.0)
        .unwrap()
        .with_fov(Fov::from_degrees(-45.0, 45.0, 45.0, -45.0))
        .unwrap();
    let head = Pose::new(
        DVec3::new(0.1, 1.7, -123.4),
        DQuat::from_euler(glam::EulerRot::YXZ, 0.3, 0.2, -0.1),
    );
    let bits = |view: stereolux_xr::View| {
        (
            view.position_in_world.to_array().map(f64::to_bits),
            view.orientation.to_array().map(f64::to_bits),
        )
    };
    let [left, right] = headset.views_from_head(&head);
    assert_eq!(bits(left), bits(right));
    assert_eq!(left.position_in_world, head.position);
    // The control.
    let [left, right] = Headset::load("index").unwrap().views_from_head(&head);
    assert_ne!(bits(left), bits(right));
}

#[test]
fn unusable_overrides_are_refused() {
    let headset = || Headset::load("symmetric").unwrap();
    for ipd in [-0.01, 1.01, f64::NAN, f64::INFINITY] {
        assert!(
            headset().with_ipd(ipd).unwrap_err().is_unusable_input(),
            "{ipd}"
        );
    }
    assert!(headset().with_ipd(0.5).is_ok());
    for (angles, fits) in [
        ([45.0, -45.0, 45.0, -45.0], false),
        ([-90.0, 45.0, 45.0, -45.0], false),
        ([-85.0, 85.0, 85.0, -85.0], true),
        ([-0.5, 0.5, 0.5, -0.5], true),
    ] {
        let [left, right, up, down] = angles;
        let fov = Fov::from_degrees(left, right, up, down);
        assert_eq!(headset().with_fov(fov).is_ok(), fits, "{angles:?}");
    }
    assert!(headset().with_refresh_hz(0.0).is_err());
    assert_eq!(headset().with_refresh_hz(72.0).unwrap().refresh_hz, 72.0);
}

/// The symmetric profile with one text replaced.
fn edited(from: &str, to: &str) -> (usize, String, String) {
    let text = include_str!("../../../../config/headsets/symmetric.toml");
    assert!(text.contains(from), "{from}");
    let error = Headset::from_toml("my.toml", &text.replacen(from, to, 1)).unwrap_err();
    assert_eq!(error.file, "my.toml");
    assert!(!error.to_string().contains('\n'), "{error}");
    (
        error.line.unwrap_or_default(),
        error.field.clone().unwrap_or_default(),
        error.to_string(),
    )
}

#[test]
fn faults_name_line_and_field() {
    // Lines as in config/headsets/symmetric.toml: name is on line 3.
    assert_eq!(edited("size = [512, 512]", "size = [0, 512]").0, 5);
    let (line, field, text) = edited("ipd_m = 0.063", "ipd = 0.063");
    assert_eq!((line, field.as_str()), (7, "ipd"), "{text}");
    assert!(
        text.contains("unknown field") && text.contains("ipd_m"),
        "{text}"
    );
    let (line, field, text) = edited("ipd_m = 0.063", "ipd_m = 63");
    assert_eq!((line, field.as_str()), (7, "ipd_m"), "{text}");
    let (line, field, text) = edited("ipd_m = 0.063", "ipd_m = \"63 mm\"");
    assert_eq!((line, field.as_str()), (7, "ipd_m"), "{text}");
    let (line, field, text) = edited("refresh_hz = 90.0", "refresh_hz = nan");
    assert_eq!((line, field.as_str()), (6, "refresh_hz"), "{text}");
    let (line, field, text) = edited("{ left = -45.0,", "{ left = -145.0,");
    assert_eq!((line, field.as_str()), (10, "left.fov_deg.left"), "{text}");
    let (line, field, text) = edited("{ left = -45.0,", "{ left = 50.0,");
    assert_eq!((line, field.as_str()), (10, "left.fov_deg.left"), "{text}");
    let (line, _, text) = edited("{ left = -45.0,", "{");
    assert_eq!(line, 10, "{text}");
    let (line, field, text) = edited("[right]", "cant_deg = { yaw = 100.0 }\n[right]");
    assert_eq!((line, field.as_str()), (12, "left.cant_deg"), "{text}");
    let (line, field, text) = edited("[right]", "offset_m = [0.0, inf, 0.0]\n[right]");
    assert_eq!((line, field.as_str()), (12, "left.offset_m"), "{text}");
    let (line, _, text) = edited("size = [512, 512]", "size = [512, 512");
    assert!((5..=6).contains(&line), "{text}");
    // What is not there lies nowhere.
    let (line, field, text) = edited("ipd_m = 0.063\n", "");
    assert_eq!((line, field.as_str()), (0, ""), "{text}");
    assert!(text.contains("ipd_m"), "{text}");
}

#[test]
fn a_users_own_profile() {
    let folder = Folder::new("own-headset");
    let path = folder.join("own.toml");
    let text = include_str!("../../../../config/headsets/index.toml")
        .replace("\"index\"", "\"mine\"")
        .replace('\n', "\r\n");
    std::fs::write(&path, format!("\u{feff}{text}")).unwrap();
    let headset = Headset::load(path.to_str().unwrap()).unwrap();
    assert_eq!(headset.name, "mine");
    assert_eq!(headset.eyes, Headset::load("index").unwrap().eyes);
}

#[test]
fn unusable_files() {
    let error = Headset::load("/nowhere/none.toml").unwrap_err().to_string();
    assert!(error.contains("/nowhere/none.toml"), "{error}");
    let folder = Folder::new("unusable-headsets");
    let refused = |path: &Path| {
        Headset::load(path.to_str().unwrap())
            .unwrap_err()
            .to_string()
    };
    let error = refused(folder.path());
    assert!(error.contains("directory"), "{error}");
    let huge = folder.join("huge.toml");
    std::fs::File::create(&huge)
        .unwrap()
        .set_len(1 << 40)
        .unwrap();
    let error = refused(&huge);
    assert!(error.contains("1 MiB"), "{error}");
    let empty = folder.join("empty.toml");
    std::fs::write(&empty, "").unwrap();
    let error = refused(&empty);
    assert!(error.contains("missing field"), "{error}");
}
