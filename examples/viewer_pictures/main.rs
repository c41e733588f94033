//! Draws the viewer without a window, for the pictures in `docs/viewer/`: every layout, every panel, and every view of
//! intermediate results.
//!
//! `cargo run --release --example viewer_pictures -- docs/viewer`

// What tests read textures back by.
#[allow(clippy::unwrap_used)]
#[path = "../../crates/gpu/tests/shared/textures.rs"]
mod textures;

use std::error::Error;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use egui::{Context, RawInput, Rect, pos2, vec2};
use stereolux::gpu::GpuContext;
use stereolux::images::{Image, ImageRgb8, write_png};
use stereolux::renderer::Inspection;
use stereolux::scene::edit::Document;
use stereolux::settings::Settings;
use stereolux::viewer::app::Tab;
use stereolux::viewer::frames::ViewMode;
use stereolux::viewer::layout::Layout;
use stereolux::viewer::painter::{Painter, Target};
use stereolux::viewer::window_state::WindowState;
use stereolux::viewer::{App, Start, theme};
use stereolux::xr::{Fov, Headset};

type Outcome<T> = Result<T, Box<dyn Error>>;

/// Size of the window, pixels.
const WINDOW: [u32; 2] = [1120, 680];
/// Frames that are averaged before a picture is taken.
const FRAMES: u32 = 4;
const FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Rgba8Unorm;

/// A window that is only a texture.
struct Canvas {
    app: App,
    egui: Context,
    painter: Painter,
    gpu: GpuContext,
    view: wgpu::TextureView,
    began: Instant,
}

impl Canvas {
    fn new(app: App) -> Outcome<Self> {
        let gpu = GpuContext::open(None)?;
        let view = textures::target_texture(&gpu, WINDOW, FORMAT);
        let painter = Painter::new(&gpu, FORMAT)?;
        let egui = Context::default();
        theme::apply(&egui);
        Ok(Self {
            app,
            egui,
            painter,
            gpu,
            view,
            began: Instant::now(),
        })
    }

    /// One pass; the pointer is nowhere.
    fn pass(&mut self) -> Outcome<()> {
        let size = vec2(WINDOW[0] as f32, WINDOW[1] as f32);
        let input = RawInput {
            screen_rect: Some(Rect::from_min_size(pos2(0.0, 0.0), size)),
            time: Some(self.began.elapsed().as_secs_f64()),
            focused: true,
            ..RawInput::default()
        };
        let app = &mut self.app;
        let output = self.egui.run_ui(input, |ui| app.ui(ui));
        let jobs = self.egui.tessellate(output.shapes, output.pixels_per_point);
        let target = Target {
            view: &self.view,
            size: WINDOW,
            pixels_per_point: output.pixels_per_point,
        };
        self.painter
            .paint(&self.gpu, &output.textures_delta, &jobs, Some(&target))?;
        Ok(())
    }

    /// Lets the viewer run until `done`.
    fn until(&mut self, what: &str, done: impl Fn(&App) -> bool) -> Outcome<()> {
        let began = Instant::now();
        loop {
            self.pass()?;
            if done(&self.app) {
                return Ok(());
            }
            if began.elapsed() > Duration::from_secs(600) {
                return Err(format!("{what}: waited in vain").into());
            }
            // On a software adapter drawing takes the time away from rendering.
            std::thread::sleep(Duration::from_millis(250));
        }
    }

    /// Waits for a clean picture of what was just asked for.
    fn settle(&mut self) -> Outcome<()> {
        self.pass()?;
        self.until("a picture", |app| {
            app.is_up_to_date() && app.frame().is_some_and(|frame| frame.frames >= FRAMES)
        })?;
        // Textures of the last report, and widgets that need a second pass for their size.
        self.pass()?;
        self.pass()?;
        Ok(())
    }

    fn image(&self) -> Outcome<ImageRgb8> {
        let bytes = textures::bytes(&self.gpu, &self.view, 4);
        let texels = bytes.chunks_exact(4);
        let pixels = texels.map(|texel| [texel[0], texel[1], texel[2]]).collect();
        Ok(Image::new(WINDOW[0], WINDOW[1], pixels)?)
    }

    /// Windows of egui fade in and out.
    fn fade(&mut self) -> Outcome<()> {
        for _ in 0..3 {
            std::thread::sleep(Duration::from_millis(200));
            self.pass()?;
        }
        Ok(())
    }

    fn save(&mut self, folder: &Path, name: &str) -> Outcome<()> {
        self.fade()?;
        let path = folder.join(format!("{name}.png"));
        write_png(&path, &self.image()?)?;
        println!("{}", path.display());
        Ok(())
    }
}

fn node(app: &App, name: &str) -> Option<usize> {
    let nodes = &app.document().scene().nodes;
    nodes.iter().position(|node| node.name == name)
}

/// A part of an image, each of its pixels the mean of `by` x `by`.
fn cut(image: &ImageRgb8, rect: Rect, by: u32) -> Outcome<ImageRgb8> {
    let [left, top] = [rect.min.x, rect.min.y].map(|edge| edge.max(0.0) as u32);
    let (width, height) = (rect.width() as u32 / by, rect.height() as u32 / by);
    let mut pixels = Vec::new();
    for y in 0..height {
        for x in 0..width {
            let mut sums = [0_u32; 3];
            for tap in 0..by * by {
                let at = (left + by * x + tap % by, top + by * y + tap / by);
                let pixel = image.get(at.0, at.1).unwrap_or_default();
                for (sum, channel) in sums.iter_mut().zip(pixel) {
                    *sum += u32::from(channel);
                }
            }
            pixels.push(sums.map(|sum| (sum / (by * by)) as u8));
        }
    }
    Ok(Image::new(width, height, pixels)?)
}

/// Pictures in rows of `columns`.
fn sheet(pictures: &[ImageRgb8], columns: usize) -> Outcome<ImageRgb8> {
    let first = pictures.first().ok_or("no pictures")?;
    let (width, height) = (first.width as usize, first.height as usize);
    let rows = pictures.len().div_ceil(columns);
    let mut pixels = vec![[0; 3]; columns * width * rows * height];
    for (index, picture) in pictures.iter().enumerate() {
        let (left, top) = (index % columns * width, index / columns * height);
        for y in 0..height.min(picture.height as usize) {
            for x in 0..width.min(picture.width as usize) {
                pixels[(top + y) * columns * width + left + x] =
                    picture.pixels[y * picture.width as usize + x];
            }
        }
    }
    Ok(Image::new(
        (columns * width) as u32,
        (rows * height) as u32,
        pixels,
    )?)
}

fn main() -> Outcome<()> {
    env_logger::init();
    let folder = PathBuf::from(
        std::env::args()
            .nth(1)
            .ok_or("usage: viewer_pictures FOLDER")?,
    );
    std::fs::create_dir_all(&folder)?;
    let settings = Settings {
        scene: "builtin:gallery".to_owned(),
        // One size for all layouts: frames of one serve the next.
        size: Some([216, 192]),
        ..Settings::default()
    };
    let app = App::new(
        Start {
            document: Document::load(&settings.scene)?,
            settings,
            headset: Headset::load("symmetric")?
                .with_fov(Fov::from_degrees(-32.0, 32.0, 28.0, -28.0))?,
            is_auto_lit: false,
            recording: None,
            out: folder.clone(),
            window_state: WindowState::default(),
        },
        || (),
    )?;
    let mut canvas = Canvas::new(app)?;
    for layout in Layout::ALL {
        canvas.app.window_state.layout = layout;
        canvas.settle()?;
        if layout == Layout::Split {
            canvas.until("the other method", |app| {
                app.frame()
                    .is_some_and(|frame| frame.other.is_some() && frame.frames >= FRAMES)
            })?;
            canvas.pass()?;
        }
        let name = layout.name().to_lowercase().replace(' ', "_");
        canvas.save(&folder, &format!("layout_{name}"))?;
    }
    canvas.app.window_state.layout = Layout::SideBySide;
    let vase = node(&canvas.app, "vase").or_else(|| node(&canvas.app, "ball"));
    canvas.app.select(vase.or(Some(0)));
    canvas.settle()?;
    canvas.save(&folder, "panel_inspector")?;
    canvas.app.tab = Tab::Settings;
    canvas.pass()?;
    canvas.settle()?;
    canvas.save(&folder, "panel_settings")?;
    canvas.app.select(None);
    canvas.app.shows_help = true;
    canvas.settle()?;
    canvas.save(&folder, "panel_help")?;
    canvas.app.shows_help = false;
    canvas.fade()?;
    canvas.app.tab = Tab::Inspector;

    // Views: the picture's area alone, a smaller one each, with its legend.
    let shown = &mut canvas.app.window_state;
    shown.layout = Layout::Left;
    shown.hierarchy = false;
    shown.side = false;
    shown.statistics = false;
    let mut views = Vec::new();
    for mode in ViewMode::all() {
        // Provenance is the right eye's.
        let is_right = mode == ViewMode::Inspection(Inspection::Provenance);
        canvas.app.window_state.layout = if is_right {
            Layout::Right
        } else {
            Layout::Left
        };
        canvas.app.view_mode = mode;
        if mode == ViewMode::Error {
            canvas.until("a reference", |app| {
                app.frame()
                    .is_some_and(|f| f.shown.legend.is_some() && f.frames >= FRAMES)
            })?;
        }
        canvas.settle()?;
        let (_, rect) = canvas.app.shown_at[0];
        // The legend lies left of the picture.
        let area = Rect::from_min_max(pos2(0.0, rect.min.y), rect.max);
        views.push(cut(&canvas.image()?, area, 3)?);
        println!("{}", mode.name());
    }
    let path = folder.join("views.png");
    write_png(&path, &sheet(&views, 4)?)?;
    println!("{}", path.display());
    Ok(())
}
