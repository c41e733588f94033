//! Views that stand at once, from what a frame has brought already.

use egui::Key;
use stereolux::renderer::{Eye, Inspection};
use stereolux::settings::{Method, Reuse};
use stereolux::viewer::App;
use stereolux::viewer::frames::{Seen, ViewMode};

use super::inspect::{SIZE, inspected, surfaces, views};
use super::support::*;
use super::viewer_support::{Viewer, choose, hold, narrow, open, settle, shown, until};
use crate::suite::support::Folder;

fn pixels(app: &App) -> [Vec<egui::Color32>; 2] {
    [0, 1].map(|eye| shown(app).shown.eyes[eye].pixels.clone())
}

fn look(viewer: &mut Viewer, mode: ViewMode) {
    let now = viewer.state().view_mode.name();
    choose(viewer, &now, &mode.name());
    assert_eq!(viewer.state().view_mode, mode);
}

#[test]
fn views_of_surfaces_are_the_renderers_by_what_pixels_see() {
    let scene = builtin("cornell");
    let mut renderer = renderer(&scene, &method(Method::Path, Reuse::Off), SIZE);
    renderer
        .render_frame(&views(&scene, 40.0), 0, |_| {})
        .unwrap();
    for eye in [Eye::Left, Eye::Right] {
        let seen = Seen::of(SIZE, &surfaces(&mut renderer, eye));
        for view in Inspection::ALL {
            let by_seen = seen.inspected(view, eye);
            assert_eq!(by_seen.is_some(), Seen::holds(view), "{view:?}");
            if let Some(by_seen) = by_seen {
                assert_eq!(by_seen, inspected(&mut renderer, view, eye), "{view:?}");
            }
        }
    }
}

#[test]
fn a_view_stands_with_the_next_pass_and_the_frame_of_it_is_no_other() {
    let folder = Folder::new("viewer-views");
    let mut viewer = open("builtin:cornell", &folder, |_| {});
    let picture = pixels(viewer.state());
    let index = shown(viewer.state()).index;
    for inspection in Inspection::ALL
        .into_iter()
        .filter(|view| Seen::holds(*view))
    {
        let mode = ViewMode::Inspection(inspection);
        viewer.state_mut().view_mode = mode;
        viewer.step();
        let frame = shown(viewer.state());
        assert_eq!(frame.view_mode, mode, "no frame was awaited");
        assert!(frame.shown.legend.is_some(), "{inspection:?}");
        let at_once = pixels(viewer.state());
        assert_ne!(at_once, picture, "{inspection:?}");
        settle(&mut viewer);
        assert_eq!(shown(viewer.state()).view_mode, mode);
        assert_eq!(at_once, pixels(viewer.state()), "{inspection:?}");
    }
    let last = shown(viewer.state()).index;
    assert!(last > index, "frames of these views came");
    // The picture too: the frame has it.
    viewer.state_mut().view_mode = ViewMode::Picture;
    viewer.step();
    assert_eq!(shown(viewer.state()).view_mode, ViewMode::Picture);
    assert!(shown(viewer.state()).shown.legend.is_none());
}

#[test]
fn views_that_are_traced_are_in_stock_once_the_view_has_stood_still() {
    let folder = Folder::new("viewer-views-stock");
    let mut viewer = open("builtin:gallery", &folder, |settings| {
        // As `view` has it by default.
        settings.render.reconstruct.svgf = true.into();
        settings.render.reuse = Reuse::Lookup;
    });
    let traced = [
        Inspection::Direct,
        Inspection::Indirect,
        Inspection::Caustic,
        Inspection::PhotonDensity,
        Inspection::PhotonDots,
        Inspection::GridOccupancy,
        Inspection::Motion,
        Inspection::Variance,
        Inspection::Provenance,
    ]
    .map(ViewMode::Inspection);
    until(&mut viewer, "stock", |app| {
        traced.iter().all(|mode| app.is_at_hand(*mode))
    });
    for mode in traced {
        look(&mut viewer, mode);
        let frame = shown(viewer.state());
        assert_eq!(frame.view_mode, mode, "no frame was awaited");
        let at_once = pixels(viewer.state());
        settle(&mut viewer);
        // Noise and history make another one of each frame; it is one of the same thing.
        let frame = shown(viewer.state());
        assert_eq!(frame.view_mode, mode);
        assert_eq!(at_once[0].len(), frame.shown.eyes[0].pixels.len());
    }
    // What was in stock was of the place where the head was.
    let before = viewer.state().head();
    hold(&mut viewer, Key::W, 10);
    let there = narrow().views_from_head(&viewer.state().head())[0];
    assert_ne!(viewer.state().head(), before);
    until(&mut viewer, "a frame from there", |app| {
        shown(app).views[0] == there
    });
    until(&mut viewer, "stock from there", |app| {
        app.is_at_hand(traced[0])
    });
}
