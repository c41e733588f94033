//! Views of intermediate results, which run after a frame when they are asked for: [`crate::frame::plan::inspect`].
//!
//! Their passes are compiled when they are first needed, and have images of their own; a frame neither compiles, binds nor
//! allocates anything for them. All look through pixels' centres, for either eye alike, at the scene as the last
//! frame showed it, whatever has been moved since.

use bytemuck::{Pod, Zeroable as _};
use glam::DVec3;

use super::inspection::{Inspected, InspectedValues, Inspection, SeenSurface};
use super::{Eye, InstanceId, MapKind, PhotonMap, RenderError, Renderer, Stage};
use crate::frame::bind::Whose;
use crate::frame::plan::{View, inspect, inspection};
use crate::frame::step::Owner;
use crate::frame::{FrameRun, Play};
use crate::gpu::{FrameRecorder, GpuError, PassTimes, ShaderLibrary, uniform_buffer};
use crate::renderer::records::frame::Frame;
use crate::renderer::records::reconstruction::{
    Reconstruction as ReconstructionUniform, unpack_motion,
};

/// What a pixel that sees nothing has for an instance.
const NONE: u32 = u32::MAX;
/// What views read of a photon map.
const MAP_BUFFERS: [&str; 4] = [
    "photon_grid",
    "cell_starts",
    "sorted_photons",
    "photon_counters",
];

/// Values of a view, and which pixels have one.
type Values = (InspectedValues, Option<Vec<bool>>);

/// Kernels and images of views, once one has been asked for.
#[derive(Default)]
pub(super) struct Inspector {
    /// The last frame and the one before it, and where their origins lie in the world.
    frames: [Option<(Frame, DVec3)>; 2],
    frame_count: u64,
    /// With kernels and images of its own.
    run: FrameRun,
    /// Frame and eye whose surfaces the images hold.
    traced: Option<(u64, Eye)>,
}

impl Inspector {
    /// A frame has been rendered.
    pub(super) fn note(&mut self, frame: &Frame, origin_in_world: DVec3) {
        self.frames = [Some((*frame, origin_in_world)), self.frames[0]];
        self.frame_count += 1;
    }

    /// Images have another size from now on: there is no frame to look at until the next one.
    pub(super) fn forget_frames(&mut self) {
        self.frames = [None, None];
        self.run.buffers.forget_images();
        self.traced = None;
    }

    /// The next view compiles its passes anew.
    pub(super) fn forget_kernels(&mut self) {
        self.run = FrameRun::default();
        self.traced = None;
    }

    /// The last frame.
    fn frame(&self) -> Result<(Frame, DVec3), RenderError> {
        self.frames[0].ok_or_else(|| {
            RenderError::Settings(
                "there is nothing to look at yet: render a frame of this size first".to_owned(),
            )
        })
    }
}

/// An eye that looks.
struct Look<'a> {
    inspector: &'a mut Inspector,
    renderer: &'a Renderer,
    library: &'a ShaderLibrary,
    eye: Eye,
}

impl Look<'_> {
    /// Runs the passes of a view and waits for them.
    fn run(&mut self, view: View) -> Result<(), RenderError> {
        let (renderer, eye) = (self.renderer, self.eye);
        let (now, origin) = self.inspector.frame()?;
        let previous = self.inspector.frames[1];
        let (before, origin_before) = previous.unwrap_or((now, origin));
        // A frame of one sample looks through the pixels' centres.
        let centered = Frame {
            first_sample: 0,
            sample_count: 1,
            ..now
        };
        let motion = ReconstructionUniform {
            left: now.left,
            right: now.right,
            previous_left: before.left,
            previous_right: before.right,
            has_history: if previous.is_some() { 1.0 } else { 0.0 },
            origin_moved: (origin - origin_before).as_vec3().to_array(),
            ..ReconstructionUniform::zeroed()
        };
        let context = &renderer.context;
        let frame = filled_uniform(renderer, "inspected frame", &centered);
        let motion = filled_uniform(renderer, "motion between frames", &motion);
        let buffers = renderer.buffers_of(eye).unwrap_or(Eye::Left);
        let steps = inspect(view, eye, buffers);
        let owner = steps.first().map_or(
            Owner {
                eye: buffers,
                map: MapKind::Photons,
                batch: 0,
            },
            |step| step.owner,
        );
        let scene = renderer.scene.resources();
        let of_frame = &renderer.frame.buffers;
        let given = of_frame
            .give(scene, owner, &MAP_BUFFERS)
            .with("frame", &frame)
            .with("reconstruction", &motion);
        let given = of_frame.give(given, owner, &["hidden_pixels"]);
        let stage = Stage::Inspect;
        let run = &mut self.inspector.run;
        if run.features() != renderer.features() {
            *run = FrameRun::new(*renderer.features());
        }
        run.compile(context, self.library, &steps)?;
        run.bind(context, &[inspection(steps)], &given, &renderer.image, &[])?;
        let mut recorder = FrameRecorder::new(context, None, stage.name());
        run.play(&mut recorder, stage, &Play::default())?;
        Ok(recorder.submit(stage.name(), &mut PassTimes::default())?)
    }

    /// Fills the images for an eye of the last frame, unless they hold that already.
    fn trace(&mut self) -> Result<(), RenderError> {
        self.inspector.frame()?;
        let traced = Some((self.inspector.frame_count, self.eye));
        if self.inspector.traced != traced {
            self.inspector.traced = None;
            self.run(View::Surfaces)?;
            self.inspector.traced = traced;
        }
        Ok(())
    }

    /// One element per pixel of an image that views have filled.
    fn image<T: Pod>(&self, name: &'static str) -> Result<Vec<T>, GpuError> {
        let (renderer, buffers) = (self.renderer, &self.inspector.run.buffers);
        let place = (Whose::Frame, name);
        let read = buffers.read(&renderer.context, place, 0, renderer.pixels())?;
        read.ok_or_else(|| GpuError::Unbound {
            pass: "inspect_surfaces".to_owned(),
            binding: format!("{name} (nothing has been looked at yet)"),
        })
    }

    fn surfaces(&self) -> Result<Vec<SeenSurface>, GpuError> {
        let hits: Vec<[u32; 4]> = self.image("inspected_hits")?;
        let marks: Vec<[u32; 4]> = self.image("inspected_marks")?;
        let normals: Vec<[f32; 4]> = self.image("inspected_normals")?;
        let colors: Vec<[f32; 4]> = self.image("inspected_colors")?;
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
                node: self.renderer.scene.shown_node(instance),
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
        Ok((0..self.renderer.pixels()).map(surface).collect())
    }

    /// Which pixels see a surface.
    fn sees_surface(&self) -> Result<Option<Vec<bool>>, GpuError> {
        let normals: Vec<[f32; 4]> = self.image("inspected_normals")?;
        Ok(Some(normals.iter().map(|normal| normal[3] > 0.0).collect()))
    }

    fn inspect(&mut self, inspection: Inspection) -> Result<Inspected, RenderError> {
        let (renderer, eye) = (self.renderer, self.eye);
        if let Some(missing) = inspection.missing(&renderer.settings) {
            return Err(lacks(inspection, missing));
        }
        let buffers = renderer.buffers_of(eye).ok_or_else(|| not_rendered(eye))?;
        self.inspector.frame()?;
        let (values, has_value) = match inspection {
            Inspection::Direct | Inspection::Indirect | Inspection::Provenance => {
                (of_frame(renderer, inspection, eye, buffers)?, None)
            }
            _ => {
                self.trace()?;
                match inspection {
                    Inspection::PhotonDensity
                    | Inspection::GridOccupancy
                    | Inspection::PhotonDots
                    | Inspection::Caustic => self.of_photons(inspection)?,
                    Inspection::Motion => self.motion()?,
                    Inspection::Variance => {
                        let variance = renderer.read_variance(buffers)?;
                        let lacking = || lacks(inspection, "reconstruct.svgf=true");
                        let variance = InspectedValues::Scalar(variance.ok_or_else(lacking)?);
                        (variance, self.sees_surface()?)
                    }
                    _ => self.of_surfaces(inspection)?,
                }
            }
        };
        Ok(Inspected {
            inspection,
            eye,
            size: renderer.size(),
            values,
            has_value,
        })
    }

    /// Views of what the rays through pixels' centres meet.
    fn of_surfaces(&self, inspection: Inspection) -> Result<Values, RenderError> {
        let image = |name| self.image::<[f32; 4]>(name);
        let words = |name| self.image::<[u32; 4]>(name);
        let values = match inspection {
            Inspection::Albedo => InspectedValues::Color(rgb(&image("inspected_colors")?)),
            Inspection::Normal => InspectedValues::Direction(rgb(&image("inspected_normals")?)),
            Inspection::Depth => {
                let normals = image("inspected_normals")?;
                InspectedValues::Scalar(normals.iter().map(|normal| normal[3]).collect())
            }
            Inspection::Instance => {
                let hits = words("inspected_hits")?;
                InspectedValues::Labels(hits.iter().map(|hit| hit[0]).collect())
            }
            // Nodes are visited also where a ray meets nothing.
            _ => {
                let marks = words("inspected_marks")?;
                return Ok((scalar(marks.iter().map(|mark| mark[1])), None));
            }
        };
        Ok((values, self.sees_surface()?))
    }

    /// Views of what the photon maps hold.
    fn of_photons(&mut self, inspection: Inspection) -> Result<Values, RenderError> {
        if inspection == Inspection::PhotonDots {
            return Ok((self.photon_dots()?, None));
        }
        if inspection == Inspection::Caustic {
            let lacking = || lacks(inspection, "force.caustics=on");
            let map = traced(self.renderer.caustic_map().ok_or_else(lacking)?)?;
            let view = View::CausticLight(map.gather_slices());
            self.run(view)?;
            let light: Vec<[f32; 4]> = self.image("inspection")?;
            let has_value = light.iter().map(|v| v[3] > 0.0).collect();
            return Ok((InspectedValues::Color(rgb(&light)), Some(has_value)));
        }
        let map = self.renderer.photon_map().ok_or_else(no_photons)?;
        let view = View::PhotonsAround(traced(map)?.gather_slices());
        self.run(view)?;
        // Within the radius, and in the point's cell.
        let around: Vec<[u32; 2]> = self.image("inspection")?;
        let values = if inspection == Inspection::GridOccupancy {
            scalar(around.iter().map(|counts| counts[1]))
        } else {
            let radius_m = f64::from(self.inspector.frame()?.0.photon_radius);
            let area_m2 = std::f64::consts::PI * radius_m * radius_m;
            let density = |counts: &[u32; 2]| (f64::from(counts[0]) / area_m2) as f32;
            InspectedValues::Scalar(around.iter().map(density).collect())
        };
        Ok((values, self.sees_surface()?))
    }

    /// Photons of both maps that an eye sees in each pixel.
    fn photon_dots(&mut self) -> Result<InspectedValues, RenderError> {
        let mut clears = true;
        for map in &self.renderer.maps {
            let stored = traced(map)?.counters().stored;
            if stored > 0 || clears {
                let map = map.kind();
                let view = View::PhotonDots {
                    map,
                    stored,
                    clears,
                };
                self.run(view)?;
            }
            clears = false;
        }
        let dots: Vec<u32> = self.image("inspection")?;
        Ok(scalar(dots.into_iter()))
    }

    /// Displacement between the last two frames of what is seen through pixels' centres, pixels.
    fn motion(&mut self) -> Result<Values, RenderError> {
        self.run(View::Motion)?;
        let words: Vec<[u32; 2]> = self.image("inspection")?;
        let vector = |words| match unpack_motion(words) {
            [x, y, _, known] if known > 0.0 => ([x, y], true),
            _ => ([0.0; 2], false),
        };
        let (vectors, has_value) = words.into_iter().map(vector).unzip();
        Ok((InspectedValues::Vector2(vectors), Some(has_value)))
    }
}

/// Views of what the frame itself has left; `buffers` are those of the eye that looks.
fn of_frame(
    renderer: &Renderer,
    inspection: Inspection,
    eye: Eye,
    buffers: Eye,
) -> Result<InspectedValues, RenderError> {
    if inspection == Inspection::Provenance {
        if eye != Eye::Right {
            return Err(RenderError::Settings(
                "the left eye has no provenance: it is rendered in full; look at the right eye"
                    .to_owned(),
            ));
        }
        let read = renderer.read_provenance()?;
        let lacking = || lacks(inspection, "reuse=lookup");
        return Ok(InspectedValues::Labels(read.ok_or_else(lacking)?));
    }
    let parts = renderer.read_direct_and_indirect(buffers)?;
    let [direct, indirect] = parts.ok_or_else(|| lacks(inspection, "output.parts=true"))?;
    Ok(InspectedValues::Color(match inspection {
        Inspection::Direct => direct,
        _ => indirect,
    }))
}

fn rgb(read: &[[f32; 4]]) -> Vec<[f32; 3]> {
    read.iter().map(|v| [v[0], v[1], v[2]]).collect()
}

fn scalar(read: impl Iterator<Item = u32>) -> InspectedValues {
    InspectedValues::Scalar(read.map(|value| value as f32).collect())
}

fn filled_uniform<T: Pod>(renderer: &Renderer, label: &str, value: &T) -> wgpu::Buffer {
    let buffer = uniform_buffer(&renderer.context, label, size_of::<T>() as u64);
    let queue = &renderer.context.queue;
    queue.write_buffer(&buffer, 0, bytemuck::bytes_of(value));
    buffer
}

fn lacks(inspection: Inspection, setting: &str) -> RenderError {
    RenderError::Settings(format!(
        "the view `{}` needs {setting}, which this renderer was not made with",
        inspection.name()
    ))
}

fn not_rendered(eye: Eye) -> RenderError {
    RenderError::Settings(format!(
        "the {} eye is not rendered; there is nothing to look at with it",
        eye.name()
    ))
}

fn no_photons() -> RenderError {
    RenderError::Settings("no photons have been traced yet".to_owned())
}

/// The map, if photons have been traced into it.
fn traced(map: &PhotonMap) -> Result<&PhotonMap, RenderError> {
    let is_traced = map.traced_at().is_some();
    is_traced.then_some(map).ok_or_else(no_photons)
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
            return Err(not_rendered(eye));
        }
        self.look(library, eye, |mut look| {
            look.trace()?;
            Ok(look.surfaces()?)
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
        self.look(library, eye, |mut look| look.inspect(inspection))
    }

    /// Drops the compiled passes of views: the next view compiles its own from the library that it is given. For shaders
    /// that have changed.
    #[cfg(feature = "internals")]
    pub fn recompile_views(&mut self) {
        self.inspector.forget_kernels();
    }

    fn look<R>(
        &mut self,
        library: &ShaderLibrary,
        eye: Eye,
        with: impl FnOnce(Look<'_>) -> R,
    ) -> R {
        let mut inspector = std::mem::take(&mut self.inspector);
        let found = with(Look {
            inspector: &mut inspector,
            renderer: self,
            library,
            eye,
        });
        self.inspector = inspector;
        found
    }
}
