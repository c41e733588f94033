//! Panels: what they show is seen in the frame that says so, and hands click what they point at.

use glam::{DAffine3, DQuat, DVec3};
use stereolux::egui::{self, Color32};
use stereolux::{
    App, AppError, Edit, FrameInput, NewContent, NewNode, Panel, PanelSpec, Placement, Pose, Scene,
    World,
};

use super::application::{RAW, left, replays_to_the_bit, run_well};
use super::support::{Folder, assert_begins};

/// The gallery, and more.
fn still<'a>(more: &[&'a str]) -> Vec<&'a str> {
    [&["--scene=builtin:gallery"], &RAW[..], more].concat()
}

/// So far before the head, facing it.
fn before_head(distance_m: f64) -> Pose {
    let start = Scene::builtin("gallery").unwrap().start_pose();
    start.then(&Pose::new(DVec3::NEG_Z * distance_m, DQuat::IDENTITY))
}

/// A panel of one colour that fills the view.
struct Sheet {
    panel: Option<Panel>,
    colors: [Color32; 3],
}

impl App for Sheet {
    fn start(&mut self, world: &mut World) -> Result<(), AppError> {
        let spec = PanelSpec {
            world_from_panel: before_head(0.5),
            width_m: 4.0,
            radiance: 2.0,
            ..PanelSpec::default()
        };
        self.panel = Some(world.add_panel(&spec)?);
        let faults: [fn(&mut PanelSpec); 3] = [
            |spec| spec.pixels = [0, 4],
            |spec| spec.width_m = f64::NAN,
            |spec| spec.radiance = 0.0,
        ];
        for fault in faults {
            let mut bad = spec.clone();
            fault(&mut bad);
            let refused = world.add_panel(&bad).unwrap_err().to_string();
            assert_begins(&refused, "panel: panel: ");
        }
        let spare = world.add_panel(&spec)?;
        world.remove_panel(spare)?;
        assert!(world.panel(spare, |_| {}).is_err());
        // Behind the head, with another node that shows its mesh: it stays.
        let shared = world.add_panel(&PanelSpec {
            world_from_panel: before_head(-0.5),
            ..spec
        })?;
        let root = world.node_of_panel(shared)?;
        let nodes = &world.scene().nodes;
        let mesh = nodes[nodes[root].children[0]].mesh;
        let copy = NewNode {
            name: "copy".to_owned(),
            to: Placement::Matrix(DAffine3::IDENTITY),
            content: NewContent::Mesh(mesh.ok_or("no mesh")?),
        };
        world.edit(Edit::Add {
            parent: None,
            node: copy,
        })?;
        assert!(world.remove_panel(shared).is_err());
        world.panel(shared, |_| {})?;
        Ok(())
    }

    fn update(&mut self, frame: &FrameInput, world: &mut World) -> Result<(), AppError> {
        let color = self.colors[frame.frame as usize % 3];
        world.panel(self.panel.ok_or("no panel")?, |ui| {
            ui.painter()
                .rect_filled(ui.ctx().content_rect(), 0.0, color);
        })?;
        Ok(())
    }
}

/// The panel reflects nothing: its radiance is that of white times the picture's colour, decoded from sRGB (IEC 61966-2-1:
/// 188 of 255 is 0.5029, to four places), in the frame that says so. Floats of 1e-6 round twice on the way.
#[test]
fn a_panel_shines_with_its_picture_in_the_frame_that_drew_it() {
    let folder = Folder::new("panel_colors");
    let mut app = Sheet {
        panel: None,
        colors: [
            Color32::WHITE,
            Color32::from_rgb(188, 0, 255),
            Color32::BLACK,
        ],
    };
    run_well(&mut app, &[], folder.path(), &still(&["--frames=4"]));
    let half = 2.0 * ((188.0_f64 / 255.0 + 0.055) / 1.055).powf(2.4) as f32;
    assert!((half - 1.0058).abs() < 1e-4);
    let expected = [[2.0; 3], [half, 0.0, 2.0], [0.0; 3], [2.0; 3]];
    for (frame, expected) in expected.into_iter().enumerate() {
        for pixel in left(folder.path(), frame) {
            for channel in 0..3 {
                let error = (pixel[channel] - expected[channel]).abs();
                assert!(error < 1e-5, "frame {frame}: {pixel:?}, not {expected:?}");
            }
        }
    }
}

/// A button that counts its clicks.
#[derive(Default)]
pub struct Counter {
    panel: Option<Panel>,
    clicks: u32,
    pub clicked_in: Vec<u32>,
}

impl App for Counter {
    fn start(&mut self, world: &mut World) -> Result<(), AppError> {
        let spec = PanelSpec {
            world_from_panel: before_head(0.6),
            width_m: 0.5,
            pixels: [64, 48],
            ..PanelSpec::default()
        };
        self.panel = Some(world.add_panel(&spec)?);
        Ok(())
    }

    fn update(&mut self, frame: &FrameInput, world: &mut World) -> Result<(), AppError> {
        let label = self.clicks.to_string();
        let mut is_clicked = false;
        world.panel(self.panel.ok_or("no panel")?, |ui| {
            let button = egui::Button::new(&label);
            is_clicked |= ui.add_sized(ui.available_size(), button).clicked();
        })?;
        if is_clicked {
            self.clicks += 1;
            self.clicked_in.push(frame.frame);
        }
        Ok(())
    }
}

/// What the right hand does: from `at`, the trigger goes down in frame 3 (0.0333 s at 90 Hz) and up in frame 6.
fn script(folder: &Folder, at: &Pose) -> String {
    let [x, y, z] = at.position.to_array();
    let turn = at.orientation.to_array();
    let text = format!(
        "[[right]]\nat_s = 0.0\nposition_m = [{x:?}, {y:?}, {z:?}]\norientation = {turn:?}\n\
         [[right]]\nat_s = 0.03\npress = [\"trigger\"]\n[[right]]\nat_s = 0.06\npress = []\n"
    );
    let path = folder.write("hands.toml", text);
    format!("--set=simulated.hands={}", path.display())
}

#[test]
fn a_hand_clicks_what_it_points_at_and_nothing_else() {
    let folder = Folder::new("panel_clicks");
    let away = Pose::new(DVec3::ZERO, DQuat::from_rotation_y(1.0));
    let turned = DQuat::from_rotation_y(std::f64::consts::PI);
    let behind = before_head(0.9).then(&Pose::new(DVec3::ZERO, turned));
    for (at, clicked_in) in [
        (before_head(0.3), vec![6]),
        (before_head(0.3).then(&away), vec![]),
        // The panel's back.
        (behind, vec![]),
    ] {
        let hands = script(&folder, &at);
        let mut app = Counter::default();
        let args = still(&["--frames=8", "--set=output.images=false", &hands]);
        run_well(&mut app, &[], folder.path(), &args);
        assert_eq!(app.clicked_in, clicked_in, "from {at:?}");
    }
}

#[test]
fn clicks_replay_to_the_bit() {
    let folder = Folder::new("panel_script");
    // Beside the line of sight, so that the number is seen.
    let beside = Pose::new(DVec3::new(0.1, 0.05, 0.0), DQuat::IDENTITY);
    let hands = script(&folder, &before_head(0.3).then(&beside));
    replays_to_the_bit::<Counter>("panel_replay", &still(&[&hands]), 10);
}
