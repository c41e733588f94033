//! What GPU tests share: one adapter, said aloud; renderers, views and scenes that are moved or scaled; the binary.

use std::collections::BTreeMap;
use std::io::Read as _;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output};
use std::time::{Duration, Instant};

use glam::{DAffine3, DQuat, DVec3};
use serde_json::Value;
use stereolux::gpu::ShaderLibrary;
use stereolux::renderer::{Eye, FrameResult, RenderError, Renderer};
use stereolux::scene::Scene;
use stereolux::settings::{Eyes, Kept, Method, RenderSettings, Reuse};
use stereolux::xr::view::RayInWorld;
use stereolux::xr::{Fov, Pose, View};

pub use super::adapter::{adapter_name, context};
pub use super::folders::{Folder, TemporaryFile};

/// Default settings with a small photon map, all of a frame kept, changed by `change`.
pub fn settings(change: impl FnOnce(&mut RenderSettings)) -> RenderSettings {
    let mut settings = RenderSettings::default();
    settings.photon.count = 4096;
    settings.output.kept = Kept::All;
    settings.gpu.timestamps = false.into();
    change(&mut settings);
    settings
}

/// RenderSettings of one method and one kind of reuse.
pub fn method(method: Method, reuse: Reuse) -> RenderSettings {
    settings(|s| {
        s.method = method;
        s.reuse = reuse;
    })
}

/// Two parallel eyes, `ipd_m` apart along the head's x axis.
pub fn parallel_views(head: Pose, ipd_m: f64, fov: Fov) -> [View; 2] {
    [-0.5, 0.5].map(|side| {
        let eye = head.then(&Pose::new(DVec3::X * (side * ipd_m), DQuat::IDENTITY));
        View {
            position_in_world: eye.position,
            orientation: eye.orientation.normalize(),
            fov,
        }
    })
}

/// The same angle in all four directions, degrees.
pub fn square_fov(half_degrees: f64) -> Fov {
    Fov::from_degrees(-half_degrees, half_degrees, half_degrees, -half_degrees)
}

/// Eyes as far apart as people's, where a scene's head starts.
pub fn start_views(scene: &Scene, half_degrees: f64) -> [View; 2] {
    parallel_views(scene.start_pose(), 0.063, square_fov(half_degrees))
}

/// The ray through a pixel's centre.
pub fn pixel_ray(view: &View, pixel: usize, [width, height]: [u32; 2]) -> RayInWorld {
    let (x, y) = (pixel as u32 % width, pixel as u32 / width);
    view.ray_through_pixel(f64::from(x) + 0.5, f64::from(y) + 0.5, width, height)
}

/// An embedded scene.
pub fn builtin(name: &str) -> Scene {
    Scene::builtin(name).unwrap()
}

/// A Cornell box of white walls, which keeps more photons than the first guess of three per path.
pub fn white_box() -> Scene {
    let mut scene = builtin("cornell");
    for material in &mut scene.materials {
        material.base_color = [0.97, 0.97, 0.97, 1.0];
    }
    scene
}

/// The scene under another transform of the world.
pub fn placed(mut scene: Scene, moved_from_world: DAffine3) -> Scene {
    for root in scene.roots.clone() {
        let node = &mut scene.nodes[root];
        node.parent_from_node = moved_from_world * node.parent_from_node;
    }
    scene
}

/// Both eyes of a scene.
pub fn renderer(scene: &Scene, settings: &RenderSettings, size: [u32; 2]) -> Renderer {
    renderer_by(
        &ShaderLibrary::embedded(),
        scene,
        settings,
        Eyes::Both,
        size,
    )
    .unwrap()
}

/// A renderer by shaders and for eyes of a test's own.
pub fn renderer_by(
    library: &ShaderLibrary,
    scene: &Scene,
    settings: &RenderSettings,
    eyes: Eyes,
    size: [u32; 2],
) -> Result<Renderer, RenderError> {
    Renderer::new(context(), library, scene, settings, eyes, size)
}

/// A renderer that has rendered frame 0.
pub fn rendered(
    scene: &Scene,
    settings: &RenderSettings,
    size: [u32; 2],
    views: &[View; 2],
) -> Renderer {
    let mut renderer = renderer(scene, settings, size);
    frame(&mut renderer, views);
    renderer
}

/// Renders frames of these numbers.
pub fn play(renderer: &mut Renderer, views: &[View; 2], frames: Range<u32>) {
    for frame in frames {
        renderer.render_frame(views, frame, |_| {}).unwrap();
    }
}

/// Renders frame 0.
pub fn frame(renderer: &mut Renderer, views: &[View; 2]) -> FrameResult {
    renderer.render_frame(views, 0, |_| {}).unwrap()
}

/// Radiance of an eye.
pub fn radiance(renderer: &Renderer, eye: Eye) -> Vec<[f32; 3]> {
    renderer.read_radiance(eye).unwrap().unwrap()
}

/// The left eye's images in frames of these numbers: streams are keyed by the frame, so they are independent where photons are
/// traced anew.
pub fn images_of(
    renderer: &mut Renderer,
    views: &[View; 2],
    frames: Range<u32>,
) -> Vec<Vec<[f32; 3]>> {
    let of_frame = |frame| {
        renderer.render_frame(views, frame, |_| {}).unwrap();
        let image = radiance(renderer, Eye::Left);
        assert_clean(&image, &format!("frame {frame}"));
        image
    };
    frames.map(of_frame).collect()
}

/// Radiance of both eyes.
pub fn both(renderer: &Renderer) -> [Vec<[f32; 3]>; 2] {
    Eye::ALL.map(|eye| radiance(renderer, eye))
}

/// Bits of both eyes' images.
pub fn both_bits(renderer: &Renderer) -> [Vec<[u32; 3]>; 2] {
    both(renderer).map(|image| bits(&image))
}

/// Bits of an image, for comparisons that forgive nothing.
pub fn bits(image: &[[f32; 3]]) -> Vec<[u32; 3]> {
    image.iter().map(|pixel| pixel.map(f32::to_bits)).collect()
}

/// Mean over pixels and channels.
pub fn mean(image: &[[f32; 3]]) -> f64 {
    let sum: f64 = image
        .iter()
        .flatten()
        .map(|&channel| f64::from(channel))
        .sum();
    sum / (image.len() * 3) as f64
}

/// Mean of independent values, and the square of its standard error.
pub fn statistics(values: &[f64]) -> (f64, f64) {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    let squares = values.iter().map(|value| (value - mean).powi(2));
    (mean, squares.sum::<f64>() / (n - 1.0) / n)
}

/// Pixels that differ in a channel by more than `tolerance` of the larger value, or by no finite number.
pub fn strays(a: &[[f32; 3]], b: &[[f32; 3]], tolerance: f32) -> usize {
    assert_eq!(a.len(), b.len());
    let is_near = |(a, b): (&f32, &f32)| {
        let off = (a - b).abs();
        off.is_finite() && off <= tolerance * a.abs().max(b.abs())
    };
    let pairs = a.iter().zip(b);
    pairs
        .filter(|(a, b)| !a.iter().zip(*b).all(is_near))
        .count()
}

#[test]
fn what_is_not_finite_strays_on_either_side() {
    let one = [[1.0; 3]];
    for (value, due) in [
        (1.0, 0),
        (0.99, 0),
        (1.02, 1),
        (f32::NAN, 1),
        (f32::INFINITY, 1),
    ] {
        let other = [[1.0, 1.0, value]];
        let found = [strays(&one, &other, 0.01), strays(&other, &one, 0.01)];
        assert_eq!(found, [due; 2], "{value}");
    }
}

/// Fails unless every channel is finite and none is negative.
pub fn assert_clean(image: &[[f32; 3]], what: &str) {
    for (pixel, value) in image.iter().enumerate() {
        assert!(
            value.iter().all(|c| c.is_finite() && *c >= 0.0),
            "{what}: pixel {pixel} is {value:?}"
        );
    }
}

/// Direction and distance of every pixel's first hit.
pub fn hit_rays(renderer: &Renderer, eye: Eye) -> Vec<[f32; 4]> {
    renderer.read_hit_rays(eye).unwrap().unwrap()
}

/// World position of a hit, from an eye's own position and the f32 ray, in f64.
pub fn hit_in_world(view: &View, ray: [f32; 4]) -> DVec3 {
    let direction = DVec3::new(f64::from(ray[0]), f64::from(ray[1]), f64::from(ray[2]));
    view.position_in_world + direction * f64::from(ray[3])
}

/// All triangles of a scene in world space, for brute force in f64.
pub struct Triangles {
    corners: Vec<[DVec3; 3]>,
    materials: Vec<u32>,
}

/// Where a line meets a triangle, from either side: how many directions from the origin, and the weights of the second and
/// third corner (Moeller and Trumbore 1997).
pub fn meet(origin: DVec3, direction: DVec3, [a, b, c]: [DVec3; 3]) -> Option<(f64, [f64; 2])> {
    let (e1, e2) = (b - a, c - a);
    let p = direction.cross(e2);
    let determinant = e1.dot(p);
    if determinant == 0.0 {
        return None;
    }
    let s = origin - a;
    let q = s.cross(e1);
    let (v, w) = (s.dot(p) / determinant, direction.dot(q) / determinant);
    let is_inside = v >= 0.0 && w >= 0.0 && v + w <= 1.0;
    is_inside.then(|| (e2.dot(q) / determinant, [v, w]))
}

impl Triangles {
    /// Collects them.
    pub fn of(scene: &Scene) -> Self {
        let mut all = Self {
            corners: Vec::new(),
            materials: Vec::new(),
        };
        for instance in scene.instances() {
            let mesh = &scene.meshes[instance.mesh];
            for triangle in &mesh.triangles {
                let corners = mesh.corners(triangle);
                all.corners.push(
                    corners.map(|corner| instance.world_from_object.transform_point3(corner)),
                );
                all.materials.push(triangle.material);
            }
        }
        all
    }

    /// Distance, normal (as long as twice the triangle's area) and material of the first hit beyond `nearest`.
    pub fn closest(
        &self,
        origin: DVec3,
        direction: DVec3,
        nearest: f64,
    ) -> Option<(f64, DVec3, u32)> {
        let mut best: Option<(f64, DVec3, u32)> = None;
        for ([a, b, c], &material) in self.corners.iter().zip(&self.materials) {
            let Some((t, _)) = meet(origin, direction, [*a, *b, *c]) else {
                continue;
            };
            if t <= nearest || best.is_some_and(|(other, ..)| other <= t) {
                continue;
            }
            best = Some((t, (*b - *a).cross(*c - *a), material));
        }
        best
    }

    /// Whether something stands between two points, each's own surroundings of `margin` (a share of the distance) apart.
    pub fn blocked(&self, from: DVec3, to: DVec3, margin: f64) -> bool {
        self.closest(from, to - from, margin)
            .is_some_and(|(t, ..)| t < 1.0 - margin)
    }
}

/// Flags of a run whose frames stand alone, as those of `render` do.
pub const RAW_FRAMES: [&str; 6] = [
    "--set",
    "reconstruct.svgf=off",
    "--set",
    "reconstruct.taa=off",
    "--set",
    "reconstruct.still=off",
];

/// Runs the program on the tests' adapter (for the commands that take one).
pub fn stereolux<S: AsRef<std::ffi::OsStr>>(args: &[S]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_stereolux"));
    command.args(args).env_remove("RUST_LOG");
    let renders = args.first().is_some_and(|arg| {
        ["run", "render", "bench"]
            .iter()
            .any(|name| arg.as_ref() == *name)
    });
    if renders && !args.iter().any(|arg| arg.as_ref() == "--adapter") {
        command.args(["--adapter", adapter_name()]);
    }
    command.output().expect("the program starts")
}

/// Waits until `ready`; fails after five minutes with `what`, or when `child` has ended.
pub fn wait_until(child: &mut Child, what: &str, mut ready: impl FnMut() -> bool) {
    let began = Instant::now();
    while !ready() {
        if let Some(status) = child.try_wait().unwrap() {
            let mut text = String::new();
            if let Some(mut stderr) = child.stderr.take() {
                let _ = stderr.read_to_string(&mut text);
            }
            panic!("ended ({status}) before {what}: {text}");
        }
        assert!(began.elapsed() < Duration::from_secs(300), "no {what}");
        std::thread::sleep(Duration::from_millis(20));
    }
}

/// Asks a program to end; what it printed.
pub fn interrupt(child: Child) -> Output {
    let asked = Command::new("kill").arg(child.id().to_string()).status();
    assert!(asked.unwrap().success());
    child.wait_with_output().unwrap()
}

/// Lines of a file so far; none if it is not there.
pub fn lines(path: &Path) -> usize {
    std::fs::read(path).map_or(0, |text| text.iter().filter(|&&byte| byte == b'\n').count())
}

/// Runs a command, its words parted by spaces, with `more` arguments behind them, into the folder `out`.
pub fn run_into(out: &Path, command: &str, more: &[&str]) -> Output {
    let mut args = words(command);
    args.extend(["--out", out.to_str().unwrap()]);
    args.extend(more);
    stereolux(&args)
}

/// Parted by spaces.
pub fn words(line: &str) -> Vec<&str> {
    line.split_whitespace().collect()
}

/// Fails unless a text holds all of these.
pub fn assert_says(text: &str, parts: &[&str]) {
    for part in parts {
        assert!(text.contains(part), "no {part:?} in {text:?}");
    }
}

/// Fails unless a text begins so.
pub fn assert_begins(text: &str, start: &str) {
    assert!(text.starts_with(start), "{text:?} does not begin {start:?}");
}

/// Fails with what was printed unless a command succeeded.
pub fn assert_success(output: &Output) {
    assert!(output.status.success(), "{output:?}");
}

/// Standard error as text.
pub fn stderr(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

/// What a command has printed, as JSON.
pub fn printed(output: &Output) -> Value {
    serde_json::from_slice(&output.stdout).unwrap()
}

/// What a file of JSON holds.
pub fn json(path: &Path) -> Value {
    serde_json::from_slice(&std::fs::read(path).unwrap()).unwrap()
}

/// Bytes of every EXR file of a folder, by name.
pub fn exrs(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let files = std::fs::read_dir(folder).unwrap().map(Result::unwrap);
    let exrs = files.filter(|file| file.path().extension().is_some_and(|kind| kind == "exr"));
    let read = |path: PathBuf| std::fs::read(path).unwrap();
    exrs.map(|file| (file.file_name().into_string().unwrap(), read(file.path())))
        .collect()
}

/// Kilobytes of a process (its number, or `self`) that lie in memory.
pub fn resident_kb(process: &str) -> i64 {
    let status = std::fs::read_to_string(format!("/proc/{process}/status")).unwrap();
    let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:"));
    words(line.unwrap())[0].parse().unwrap()
}

/// The lines of `stats.jsonl` in `out`.
pub fn stats(out: &Path) -> Vec<Value> {
    let text = std::fs::read_to_string(out.join("stats.jsonl")).unwrap();
    text.lines()
        .map(|line| serde_json::from_str(line).unwrap())
        .collect()
}
