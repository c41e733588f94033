//! Views of intermediate results: the passes of [`passes::INSPECTION`], which run after a frame when they are asked for.
//!
//! They are compiled when they are first needed, and have images of their own; a frame neither compiles, binds nor
//! allocates anything for them. All look through pixels' centres, for either eye alike, at the scene as the last
//! frame showed it, whatever has been moved since.

use std::collections::BTreeMap;

use bytemuck::Zeroable as _;

use super::inspection::{Inspected, InspectedValues, Inspection, SeenSurface};
use super::kernels::{shader_name, specialised};
use super::{Eye, InstanceId, PhotonMap, RenderError, Renderer};
use crate::gpu::buffers::read_buffer;
use crate::gpu::kernel::dispatch_table;
use crate::gpu::shaders::ShaderFeatures;
use crate::gpu::types::frame::Frame;
use crate::gpu::types::reconstruction::Reconstruction as ReconstructionUniform;
use crate::gpu::{
    FrameRecorder, GpuContext, GpuError, Kernel, PassTimes, Resources, ShaderLibrary,
    storage_buffer, uniform_buffer,
};
use crate::passes::{self, Pass};
use crate::settings::RenderSettings;

/// What a pixel that sees nothing has for an instance.
const NONE: u32 = u32::MAX;

/// What `inspect_surfaces` writes: 64 bytes per pixel.
struct Images {
    pixels: usize,
    frame: wgpu::Buffer,
    hits: wgpu::Buffer,
    normals: wgpu::Buffer,
    colors: wgpu::Buffer,
    marks: wgpu::Buffer,
    /// What the other passes write, 16 bytes per pixel.
    result: wgpu::Buffer,
}

impl Images {
    fn new(context: &GpuContext, pixels: usize) -> Result<Self, GpuError> {
        let image = |name: &str| storage_buffer(context, name, pixels as u64 * 16);
        Ok(Self {
            pixels,
            frame: uniform_buffer(context, "inspected frame", size_of::<Frame>() as u64),
            hits: image("inspected hits")?,
            normals: image("inspected normals")?,
            colors: image("inspected colours")?,
            marks: image("inspected marks")?,
            result: image("inspection")?,
        })
    }

    fn resources(&self) -> Resources<'_> {
        Resources::new()
            .with("frame", &self.frame)
            .with("inspected_hits", &self.hits)
            .with("inspected_normals", &self.normals)
            .with("inspected_colors", &self.colors)
            .with("inspected_marks", &self.marks)
    }
}

/// Kernels and images of views, once one has been asked for.
#[derive(Default)]
pub(super) struct Inspector {
    /// The last frame and the one before it.
    frames: [Option<Frame>; 2],
    frame_count: u64,
    kernels: BTreeMap<&'static str, Kernel>,
    /// What they were compiled with.
    features: ShaderFeatures,
    images: Option<Images>,
    /// Frame and eye whose surfaces the images hold.
    traced: Option<(u64, Eye)>,
}

impl Inspector {
    /// A frame has been rendered.
    pub(super) fn note(&mut self, frame: &Frame) {
        self.frames = [Some(*frame), self.frames[0]];
        self.frame_count += 1;
    }

    /// Images have another size from now on: there is no frame to look at until the next one.
    pub(super) fn forget_frames(&mut self) {
        self.frames = [None, None];
        self.images = None;
        self.traced = None;
    }

    /// The next view compiles its passes anew.
    pub(super) fn forget_kernels(&mut self) {
        self.kernels.clear();
        self.traced = None;
    }

    /// Compiles `pass` if that has not been done yet.
    fn kernel(
        &mut self,
        renderer: &Renderer,
        library: &ShaderLibrary,
        pass: &'static Pass,
    ) -> Result<&Kernel, GpuError> {
        if self.features != *renderer.features() {
            self.kernels.clear();
            self.features = renderer.features().clone();
        }
        if !self.kernels.contains_key(pass.name) {
            let mut features = specialised(pass, renderer.features(), false);
            // Motion is looked at; the emission that the filter wants with it is not.
            features.insert("svgf".to_owned(), false);
            let name = shader_name(pass);
            let kernel = Kernel::new(&renderer.context, library, &name, &features)?;
            self.kernels.insert(pass.name, kernel);
        }
        self.kernels.get(pass.name).ok_or_else(|| unbound(pass))
    }

    fn images(&self) -> Result<&Images, GpuError> {
        self.images
            .as_ref()
            .ok_or_else(|| unbound(&passes::inspect_surfaces::PASS))
    }

    /// Runs `pass` in `slices` over all pixels, or over `threads` threads, and waits for it.
    fn run(
        &mut self,
        renderer: &Renderer,
        library: &ShaderLibrary,
        pass: &'static Pass,
        resources: &Resources<'_>,
        eye: Eye,
        (slices, threads): (u32, Option<u32>),
    ) -> Result<(), GpuError> {
        self.kernel(renderer, library, pass)?;
        let kernel = self.kernels.get(pass.name).ok_or_else(|| unbound(pass))?;
        let context = &renderer.context;
        let entries: Vec<[u32; 4]> = (0..slices)
            .map(|slice| [0, eye.index(), slice, slices])
            .collect();
        let dispatch = dispatch_table(context, "inspection", &entries);
        let finished = renderer
            .buffers_of(eye)
            .and_then(|eye| renderer.eyes.finished(eye))
            .unwrap_or_default();
        let all = renderer
            .scene
            .resources()
            .and(&finished)
            .and(&self.images()?.resources())
            .with("dispatch", &dispatch)
            .and(resources);
        let bound = kernel.bind(context, &all)?;
        let groups = match threads {
            Some(threads) => kernel.groups_for(threads),
            None => [renderer.width.div_ceil(8), renderer.height.div_ceil(8), 1],
        };
        let mut recorder = FrameRecorder::new(context, None, "inspection");
        for slice in 0..slices {
            recorder.dispatch(pass.name, kernel, &bound, slice, groups);
        }
        recorder.submit("inspection", &mut PassTimes::default())
    }

    /// Fills the images for an eye of the last frame, unless they hold that already.
    fn trace(
        &mut self,
        renderer: &Renderer,
        library: &ShaderLibrary,
        eye: Eye,
    ) -> Result<(), RenderError> {
        let frame = self.frame()?;
        if self.traced == Some((self.frame_count, eye)) {
            return Ok(());
        }
        let pixels = renderer.width as usize * renderer.height as usize;
        if self.images.is_none() {
            self.images = Some(Images::new(&renderer.context, pixels)?);
        }
        self.traced = None;
        // A frame of one sample looks through the pixels' centres.
        let centered = Frame {
            first_sample: 0,
            sample_count: 1,
            ..frame
        };
        let uniform = &self.images()?.frame;
        let queue = &renderer.context.queue;
        queue.write_buffer(uniform, 0, bytemuck::bytes_of(&centered));
        let pass = &passes::inspect_surfaces::PASS;
        self.run(renderer, library, pass, &Resources::new(), eye, (1, None))?;
        self.traced = Some((self.frame_count, eye));
        Ok(())
    }

    /// The last frame.
    fn frame(&self) -> Result<Frame, RenderError> {
        self.frames[0].ok_or_else(|| {
            RenderError::Settings(
                "there is nothing to look at yet: render a frame of this size first".to_owned(),
            )
        })
    }

    fn surfaces(&self, renderer: &Renderer) -> Result<Vec<SeenSurface>, GpuError> {
        let images = self.images()?;
        let context = &renderer.context;
        let read4 = |buffer| read_buffer::<[f32; 4]>(context, "inspection", buffer, images.pixels);
        let read4u = |buffer| read_buffer::<[u32; 4]>(context, "inspection", buffer, images.pixels);
        let (hits, marks) = (read4u(&images.hits)?, read4u(&images.marks)?);
        let (normals, colors) = (read4(&images.normals)?, read4(&images.colors)?);
        let surface = |pixel: usize| {
            let ([instance, triangle, v, w], [material, nodes, geometric, front]) =
                (hits[pixel], marks[pixel]);
            if instance == NONE {
                return SeenSurface {
                    nodes_visited: nodes,
                    ..SeenSurface::default()
                };
            }
            let ([x, y, z, distance_m], [r, g, b, _]) = (normals[pixel], colors[pixel]);
            SeenSurface {
                instance: Some(InstanceId(instance)),
                node: renderer.scene.shown_node(instance),
                material,
                triangle,
                weights: [f32::from_bits(v), f32::from_bits(w)],
                distance_m,
                normal_in_world: [x, y, z],
                geometric_normal_in_world: unpack_direction(geometric),
                is_front: front != 0,
                albedo: [r, g, b],
                nodes_visited: nodes,
            }
        };
        Ok((0..images.pixels).map(surface).collect())
    }

    /// Which pixels see a surface.
    fn sees_surface(&self, context: &GpuContext) -> Result<Vec<bool>, GpuError> {
        let images = self.images()?;
        let normals: Vec<[f32; 4]> =
            read_buffer(context, "inspection", &images.normals, images.pixels)?;
        Ok(normals.iter().map(|normal| normal[3] > 0.0).collect())
    }

    fn inspect(
        &mut self,
        renderer: &Renderer,
        library: &ShaderLibrary,
        inspection: Inspection,
        eye: Eye,
    ) -> Result<Inspected, RenderError> {
        let context = &renderer.context;
        let settings = &renderer.settings;
        if let Some(missing) = inspection.missing(settings) {
            return Err(lacks(inspection, missing));
        }
        let Some(buffers) = renderer.buffers_of(eye) else {
            return Err(RenderError::Settings(format!(
                "the {} eye is not rendered; there is nothing to look at with it",
                eye.name()
            )));
        };
        let pixels = renderer.width as usize * renderer.height as usize;
        self.frame()?;
        let is_read_back = matches!(
            inspection,
            Inspection::Direct | Inspection::Indirect | Inspection::Provenance
        );
        if !is_read_back {
            self.trace(renderer, library, eye)?;
        }
        let read4 = |buffer| read_buffer::<[f32; 4]>(context, "inspection", buffer, pixels);
        let read4u = |buffer| read_buffer::<[u32; 4]>(context, "inspection", buffer, pixels);
        let rgb = |read: Vec<[f32; 4]>| -> Vec<[f32; 3]> {
            read.iter().map(|v| [v[0], v[1], v[2]]).collect()
        };
        let scalar =
            |read: Vec<u32>| InspectedValues::Scalar(read.iter().map(|&v| v as f32).collect());
        let mut has_value = None;
        let values = match inspection {
            Inspection::Direct | Inspection::Indirect => {
                let parts = renderer
                    .eyes
                    .read_parts(context, buffers, settings.spp)?
                    .ok_or_else(|| lacks(inspection, "output.parts=true"))?;
                InspectedValues::Color(match inspection {
                    Inspection::Direct => parts.direct,
                    _ => parts.indirect,
                })
            }
            Inspection::Albedo => {
                has_value = Some(self.sees_surface(context)?);
                InspectedValues::Color(rgb(read4(&self.images()?.colors)?))
            }
            Inspection::Normal => {
                has_value = Some(self.sees_surface(context)?);
                InspectedValues::Direction(rgb(read4(&self.images()?.normals)?))
            }
            Inspection::Depth => {
                has_value = Some(self.sees_surface(context)?);
                let normals = read4(&self.images()?.normals)?;
                InspectedValues::Scalar(normals.iter().map(|normal| normal[3]).collect())
            }
            Inspection::Instance => {
                has_value = Some(self.sees_surface(context)?);
                let hits = read4u(&self.images()?.hits)?;
                InspectedValues::Labels(hits.iter().map(|hit| hit[0]).collect())
            }
            Inspection::BvhSteps => {
                let marks = read4u(&self.images()?.marks)?;
                scalar(marks.iter().map(|mark| mark[1]).collect())
            }
            Inspection::PhotonDensity | Inspection::GridOccupancy => {
                has_value = Some(self.sees_surface(context)?);
                let around = self.photons_around(renderer, library, eye)?;
                if inspection == Inspection::GridOccupancy {
                    scalar(around.iter().map(|counts| counts[1]).collect())
                } else {
                    let radius_m = f64::from(self.frame()?.photon_radius);
                    let area_m2 = std::f64::consts::PI * radius_m * radius_m;
                    let density = |counts: &[u32; 2]| (f64::from(counts[0]) / area_m2) as f32;
                    InspectedValues::Scalar(around.iter().map(density).collect())
                }
            }
            Inspection::PhotonDots => scalar(self.photon_dots(renderer, library, eye)?),
            Inspection::Caustic => {
                let map = renderer
                    .caustic_map
                    .as_ref()
                    .ok_or_else(|| lacks(inspection, "force.caustics=on"))?;
                let light = self.caustic_light(renderer, library, map, eye)?;
                has_value = Some(light.iter().map(|v| v[3] > 0.0).collect());
                InspectedValues::Color(rgb(light))
            }
            Inspection::Motion => {
                let motion = self.motion(renderer, library, eye)?;
                has_value = Some(motion.iter().map(|moved| moved[3] > 0.0).collect());
                let vector = |moved: &[f32; 4]| {
                    if moved[3] > 0.0 {
                        [moved[0], moved[1]]
                    } else {
                        [0.0; 2]
                    }
                };
                InspectedValues::Vector2(motion.iter().map(vector).collect())
            }
            Inspection::Variance => {
                let variance = match &renderer.reconstruction {
                    Some(own) => own.read_variance(context, buffers, pixels)?,
                    None => None,
                };
                has_value = Some(self.sees_surface(context)?);
                InspectedValues::Scalar(
                    variance.ok_or_else(|| lacks(inspection, "reconstruct.svgf=true"))?,
                )
            }
            Inspection::Provenance => {
                if eye != Eye::Right {
                    return Err(RenderError::Settings(
                        "the left eye has no provenance: it is rendered in full; look at the right eye"
                            .to_owned(),
                    ));
                }
                let read = renderer.eyes.read_provenance(context)?;
                InspectedValues::Labels(read.ok_or_else(|| lacks(inspection, "reuse=lookup"))?)
            }
        };
        Ok(Inspected {
            inspection,
            eye,
            size: renderer.size(),
            values,
            unit: inspection.unit(),
            has_value,
        })
    }

    /// Photons around each pixel's surface: within the radius, and in its cell.
    fn photons_around(
        &mut self,
        renderer: &Renderer,
        library: &ShaderLibrary,
        eye: Eye,
    ) -> Result<Vec<[u32; 2]>, RenderError> {
        let map = traced_map(renderer.photon_map.as_ref())?;
        let result = self.images()?.result.clone();
        let resources = map.resources().with("photons_around", &result);
        let slices = map.gather_slices();
        let pass = &passes::inspect_photons::PASS;
        self.run(renderer, library, pass, &resources, eye, (slices, None))?;
        let pixels = self.images()?.pixels;
        Ok(read_buffer(&renderer.context, pass.name, &result, pixels)?)
    }

    /// Photons of both maps that an eye sees in each pixel.
    fn photon_dots(
        &mut self,
        renderer: &Renderer,
        library: &ShaderLibrary,
        eye: Eye,
    ) -> Result<Vec<u32>, RenderError> {
        let result = self.images()?.result.clone();
        let pass = &passes::inspect_dots::PASS;
        let mut clearing = FrameRecorder::new(&renderer.context, None, pass.name);
        clearing.clear(&result);
        clearing.submit(pass.name, &mut PassTimes::default())?;
        for map in renderer.maps() {
            let stored = traced_map(Some(map))?.counters().stored;
            let resources = map.resources().with("photon_dots", &result);
            if stored > 0 {
                let extent = (1, Some(stored));
                self.run(renderer, library, pass, &resources, eye, extent)?;
            }
        }
        let pixels = self.images()?.pixels;
        Ok(read_buffer(&renderer.context, pass.name, &result, pixels)?)
    }

    fn caustic_light(
        &mut self,
        renderer: &Renderer,
        library: &ShaderLibrary,
        map: &PhotonMap,
        eye: Eye,
    ) -> Result<Vec<[f32; 4]>, RenderError> {
        let result = self.images()?.result.clone();
        let resources = traced_map(Some(map))?
            .resources()
            .with("inspected_light", &result);
        let slices = map.gather_slices();
        let pass = &passes::inspect_caustics::PASS;
        self.run(renderer, library, pass, &resources, eye, (slices, None))?;
        let pixels = self.images()?.pixels;
        Ok(read_buffer(&renderer.context, pass.name, &result, pixels)?)
    }

    /// The pass `motion` over the rays through pixels' centres: displacement in pixels, distance before, whether it is known.
    fn motion(
        &mut self,
        renderer: &Renderer,
        library: &ShaderLibrary,
        eye: Eye,
    ) -> Result<Vec<[f32; 4]>, RenderError> {
        let context = &renderer.context;
        let now = self.frame()?;
        let before = self.frames[1].unwrap_or(now);
        let uniform = ReconstructionUniform {
            previous_left: before.left,
            previous_right: before.right,
            has_history: if self.frames[1].is_some() { 1.0 } else { 0.0 },
            ..ReconstructionUniform::zeroed()
        };
        let buffer = uniform_buffer(
            context,
            "motion between frames",
            size_of::<ReconstructionUniform>() as u64,
        );
        context
            .queue
            .write_buffer(&buffer, 0, bytemuck::bytes_of(&uniform));
        let images = self.images()?;
        let pixels = images.pixels;
        let (hits, normals, result) = (
            images.hits.clone(),
            images.normals.clone(),
            images.result.clone(),
        );
        let seen = storage_buffer(context, "seen surfaces", pixels as u64 * 16)?;
        // Every pixel has a ray of its own here, so nothing is read of what the other eye left.
        let resources = Resources::new()
            .with("reconstruction", &buffer)
            .with("hit_rays", &normals)
            .with("first_surfaces", &hits)
            .with("left_first_surfaces", &hits)
            .with("scatter_winners", &hits)
            .with("provenance", &hits)
            .with("seen_surfaces", &seen)
            .with("motion", &result);
        let pass = &passes::motion::PASS;
        self.run(renderer, library, pass, &resources, eye, (1, None))?;
        Ok(read_buffer(context, pass.name, &result, pixels)?)
    }
}

fn unbound(pass: &Pass) -> GpuError {
    GpuError::Unbound {
        pass: pass.name.to_owned(),
        binding: "any (nothing has been looked at yet)".to_owned(),
    }
}

fn lacks(inspection: Inspection, setting: &str) -> RenderError {
    RenderError::Settings(format!(
        "the view `{}` needs {setting}, which this renderer was not made with",
        inspection.name()
    ))
}

/// The map, if photons have been traced into it.
fn traced_map(map: Option<&PhotonMap>) -> Result<&PhotonMap, RenderError> {
    map.filter(|map| map.traced_at().is_some())
        .ok_or_else(|| RenderError::Settings("no photons have been traced yet".to_owned()))
}

/// Twin of `unpack_direction` in `shaders/shared/photon.wesl`.
fn unpack_direction(bits: u32) -> [f32; 3] {
    let part = |bits: u32| (f32::from(bits as u16 as i16) / 32767.0).max(-1.0);
    let (x, y) = (part(bits), part(bits >> 16));
    let z = 1.0 - x.abs() - y.abs();
    let fold = (-z).max(0.0);
    let folded = |v: f32| if v >= 0.0 { v - fold } else { v + fold };
    glam::Vec3::new(folded(x), folded(y), z).normalize().into()
}

impl Renderer {
    /// What the ray through each pixel's centre meets, row 0 on top, in the last frame as it was shown: for picking, and for
    /// what stands on it. The first call compiles a pass, and each call traces one ray per pixel unless that eye of that
    /// frame has been traced already. The next frame's bits are the same with it and without.
    ///
    /// # Errors
    /// [`RenderError::Settings`] before the first frame (of this size) or for an eye that is not rendered;
    /// [`RenderError::Gpu`], as where `library` holds a broken shader.
    pub fn inspect_surfaces(
        &mut self,
        library: &ShaderLibrary,
        eye: Eye,
    ) -> Result<Vec<SeenSurface>, RenderError> {
        if self.buffers_of(eye).is_none() {
            return Err(RenderError::Settings(format!(
                "the {} eye is not rendered; there is nothing to look at with it",
                eye.name()
            )));
        }
        self.with_inspector(|inspector, renderer| {
            inspector.trace(renderer, library, eye)?;
            Ok(inspector.surfaces(renderer)?)
        })
    }

    /// A view of an eye's intermediate results in the last frame. As [`Renderer::inspect_surfaces`].
    ///
    /// # Errors
    /// [`RenderError::Settings`] naming the setting that is missing ([`Inspection::settings_for`] sets it), before the first
    /// frame (of this size), or for an eye that has no such view; [`RenderError::Gpu`].
    pub fn inspect(
        &mut self,
        library: &ShaderLibrary,
        inspection: Inspection,
        eye: Eye,
    ) -> Result<Inspected, RenderError> {
        self.with_inspector(|inspector, renderer| {
            inspector.inspect(renderer, library, inspection, eye)
        })
    }

    /// Drops the compiled passes of views: the next view compiles its own from the library that it is given. For shaders
    /// that have changed.
    pub fn recompile_views(&mut self) {
        self.inspector.forget_kernels();
    }

    /// Settings that the renderer was made with.
    pub fn settings(&self) -> &RenderSettings {
        &self.settings
    }

    fn with_inspector<R>(&mut self, look: impl FnOnce(&mut Inspector, &Self) -> R) -> R {
        let mut inspector = std::mem::take(&mut self.inspector);
        let found = look(&mut inspector, self);
        self.inspector = inspector;
        found
    }
}
