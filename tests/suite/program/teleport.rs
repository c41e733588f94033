//! An application moves the wearer: along an arc, in the next frame, and again from the recording.

use glam::DVec3;
use stereolux::{App, AppError, FrameInput, Side, World};

use super::application::{run_well, with_trace};
use super::gallery_tour_example::{self as gallery_tour, Tour};
use super::support::Folder;

/// Horizontally from the head, at this speed.
const SPEED_M_PER_S: f64 = 0.5;

/// Goes where the arc lands, in frame 1, and notes where head and hand are.
#[derive(Default)]
struct Teleports {
    heads: Vec<DVec3>,
    hands: Vec<Option<DVec3>>,
    landing: Option<DVec3>,
}

impl App for Teleports {
    fn update(&mut self, frame: &FrameInput, world: &mut World) -> Result<(), AppError> {
        let head = frame.head().position;
        self.heads.push(head);
        let grip = frame.hand(Side::Right).grip;
        self.hands.push(grip.map(|grip| grip.pose.position));
        assert!(world.move_wearer(DVec3::NAN).is_err());
        if frame.frame == 1 {
            let velocity = DVec3::new(SPEED_M_PER_S, 0.0, 0.0);
            assert!(world.cast_arc(head, DVec3::NAN, &[]).is_none());
            let hit = world
                .cast_arc(head, velocity, &[])
                .ok_or("the arc meets nothing")?;
            let floor = hit.node.ok_or("the floor is no node")?;
            let beyond = world.cast_arc(head, velocity, &[floor]);
            assert!(beyond.is_none_or(|beyond| beyond.node != Some(floor)));
            assert!(hit.normal_in_world.y > 0.99);
            assert!(hit.distance_m > head.distance(hit.point_in_world));
            self.landing = Some(hit.point_in_world);
            let way = hit.point_in_world - head;
            world.move_wearer(DVec3::new(way.x, 0.0, way.z))?;
        }
        Ok(())
    }
}

/// Fallen by h, an arc that leaves horizontally has gone v sqrt(2 h / g). Its pieces are chords of 1/64 s: they lie within
/// 0.3 mm under the parabola, so they land at most that much earlier times the slope, well under 1 mm here.
#[test]
fn an_arc_lands_where_a_fall_does_and_the_wearer_is_there_in_the_next_frame() {
    let folder = Folder::new("teleport");
    let trace = folder.join("trace.jsonl");
    let hands = "[[right]]\nat_s = 0.0\noffset_m = [0, 0, 0]\n";
    let hands = folder.write("hands.toml", hands);
    let silent = ["--scene=builtin:gallery", "--set=output.images=false"];
    let mut live = Teleports::default();
    let hands = format!("--set=simulated.hands={}", hands.display());
    let record = with_trace("record", &trace);
    let more = ["--motion=still", "--frames=4", &hands, &record];
    run_well(&mut live, &silent, &folder.join("live"), &more);
    let [start, landing] = [live.heads[0], live.landing.unwrap()];
    let fallen_m = start.y - landing.y;
    let far_m = SPEED_M_PER_S * (2.0 * fallen_m / 9.81).sqrt();
    let off = (landing.x - start.x - far_m).abs();
    assert!(off < 1e-3, "{start} {landing}");
    assert_eq!(live.heads[1], start, "not in the frame that asks for it");
    let moved = DVec3::new(landing.x, start.y, start.z);
    for frame in [2, 3] {
        let off = (live.heads[frame] - moved).length();
        assert!(off < 1e-9, "{:?}", live.heads);
        // Hands go with the head.
        let [before, after] = [live.hands[1], live.hands[frame]].map(Option::unwrap);
        assert!((after - before - (moved - start)).length() < 1e-9);
    }
    let mut again = Teleports::default();
    let traced = with_trace("trace", &trace);
    run_well(&mut again, &silent, &folder.join("again"), &[&traced]);
    assert_eq!((again.heads, again.hands), (live.heads, live.hands));
}

/// The tour's hands press A at 0.22 s, frame 20 at 90 Hz: from frame 21 on the head is elsewhere, at its old height.
#[test]
fn the_tour_of_the_gallery_teleports() {
    struct Followed(Tour, Vec<DVec3>);
    impl App for Followed {
        fn actions(&self) -> Result<stereolux::Actions, AppError> {
            self.0.actions()
        }
        fn start(&mut self, world: &mut World) -> Result<(), AppError> {
            self.0.start(world)
        }
        fn update(&mut self, frame: &FrameInput, world: &mut World) -> Result<(), AppError> {
            self.1.push(frame.head().position);
            self.0.update(frame, world)
        }
    }
    let folder = Folder::new("teleport-tour");
    let mut tour = Followed(Tour::default(), Vec::new());
    let silent = ["--frames=23", "--set=output.images=false"];
    run_well(&mut tour, gallery_tour::DEFAULTS, folder.path(), &silent);
    let way = |frame: usize| tour.1[frame] - tour.1[0];
    assert_eq!(way(20), DVec3::ZERO);
    assert!(way(21).length() > 0.5 && way(21).y == 0.0, "{}", way(21));
    assert_eq!(way(22), way(21));
}
