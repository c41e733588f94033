//! The mean of frames that see the same, and its picture, kept on the device. For who shows a view that stands still.

use super::{Eye, RenderError, Renderer, Stage};
use crate::frame::bind::{Place, Whose};
use crate::frame::passes;
use crate::frame::plan::present;
use crate::gpu::{FrameRecorder, Kernel, PassTimes, ShaderLibrary, Workgroups, uniform_buffer};
use crate::renderer::records::still::Still;
use crate::settings::Tone;

/// How light is shown.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Display {
    /// Factor on radiance before the curve.
    pub exposure: f64,
    /// Curve.
    pub tone: Tone,
}

/// An eye's picture.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct DisplayPixels {
    /// sRGB and an opaque alpha, four bytes per pixel, row 0 on top. Each is what `tone_map_by` of [`crate::tone`] gives,
    /// but one step off where that rounded a value close to the middle between two.
    pub rgba: Vec<u8>,
    /// Pixels whose light was not finite in the last frame, and counted as 0.
    pub non_finite: usize,
}

impl DisplayPixels {
    /// Of what the pass wrote.
    fn new(mut rgba: Vec<u8>) -> Self {
        let mut non_finite = 0;
        for alpha in rgba.iter_mut().skip(3).step_by(4) {
            non_finite += usize::from(*alpha == 0);
            *alpha = 255;
        }
        Self { rgba, non_finite }
    }
}

/// What is averaged.
#[derive(Default)]
pub(super) struct StillView {
    pass: Option<(Kernel, wgpu::Buffer)>,
    pub(super) frames: u32,
    size: [u32; 2],
}

/// As `shaders/shared/tone.wesl` numbers them.
pub(super) fn number(tone: Tone) -> u32 {
    match tone {
        Tone::Aces => 0,
        Tone::Agx => 1,
        Tone::Neutral => 2,
        Tone::Linear => 3,
    }
}

/// What a pass outside the frame's plan writes of an eye.
fn images(buffers: Eye) -> [Place; 2] {
    ["mean_light", "shown_pixels"].map(|name| (Whose::Eye(buffers), name))
}

impl Renderer {
    /// Adds the last frame to the mean of the frames before it since [`Renderer::forget_mean`]; a reconstructed one, which is a
    /// mean already, takes its place. Pixels that are not finite count as 0. Waits for the device, and returns the left and
    /// the right eye's picture of the mean. The first call compiles a pass.
    ///
    /// # Errors
    /// [`RenderError::Gpu`], as where `library` holds a broken shader or the images do not fit.
    #[cfg_attr(not(feature = "internals"), doc(hidden))]
    pub fn average(
        &mut self,
        library: &ShaderLibrary,
        Display { exposure, tone }: Display,
    ) -> Result<[Option<DisplayPixels>; 2], RenderError> {
        let pass = &passes::still_picture;
        let (kernel, uniform) = match self.still.pass.take() {
            Some(known) => known,
            None => {
                let kernel = Kernel::new(
                    &self.context,
                    library,
                    &pass.shader_name(),
                    &Default::default(),
                )?;
                let bytes = size_of::<Still>() as u64;
                (kernel, uniform_buffer(&self.context, &pass.name, bytes))
            }
        };
        let eyes = Eye::ALL.map(|eye| self.buffers_of(eye));
        for buffers in eyes.into_iter().flatten() {
            let held = &mut self.frame.buffers;
            held.hold_images(&self.context, &images(buffers), &self.image)?;
        }
        let [across, down] = self.image.tiles();
        if self.reconstruction.is_some() || self.still.size != self.image.size {
            self.still.frames = 0;
        }
        let still = Still {
            per_sample: 1.0 / self.shown_samples() as f32,
            exposure: exposure as f32,
            frames: self.still.frames + 1,
            tone: number(tone),
        };
        let queue = &self.context.queue;
        queue.write_buffer(&uniform, 0, bytemuck::bytes_of(&still));
        let steps = present(&self.settings, &[pass]).steps;
        let given = self.given().with("still", &uniform);
        let mut recorder = FrameRecorder::new(&self.context, None, Stage::Present.name());
        for buffers in eyes.into_iter().flatten() {
            let step = &steps[buffers.index() as usize];
            // Anew each time: where the frame's images lie may change with its plan.
            let bound = kernel.interface.bind_by(&self.context, |binding| {
                self.frame.resource(step, binding, &given, self.parity())
            })?;
            recorder.dispatch(
                &step.label,
                &kernel,
                &bound,
                0,
                Workgroups::Direct([across, down, 1]),
            );
            let [_, shown] = images(buffers);
            if let Some(shown) = self.frame.buffers.written(shown) {
                recorder.read(&[(shown, 0, 4 * self.image.pixels())]);
            }
        }
        let ticket = recorder.send(Stage::Present.name())?;
        self.context.count_wait();
        let mut read = ticket
            .arrive(&self.context, &mut PassTimes::default())?
            .into_iter();
        self.still = StillView {
            pass: Some((kernel, uniform)),
            frames: still.frames,
            size: self.image.size,
        };
        Ok(eyes.map(|eye| eye.and_then(|_| read.next()).map(DisplayPixels::new)))
    }

    /// The mean begins anew with the next frame.
    #[cfg_attr(not(feature = "internals"), doc(hidden))]
    pub fn forget_mean(&mut self) {
        self.still.frames = 0;
    }

    /// Frames in the mean.
    #[cfg_attr(not(feature = "internals"), doc(hidden))]
    #[must_use]
    pub fn mean_frames(&self) -> u32 {
        self.still.frames
    }

    /// What the device holds of an eye's pixels from `first` on: mean, and the squares' sum of what luminance is off it.
    fn read_still(
        &self,
        eye: Eye,
        [first, count]: [usize; 2],
    ) -> Result<Option<Vec<[f32; 4]>>, RenderError> {
        let is_mean = self.still.frames > 0 && self.still.size == self.image.size;
        let Some(buffers) = self.buffers_of(eye).filter(|_| is_mean) else {
            return Ok(None);
        };
        let [mean, _] = images(buffers);
        let Some(mean) = self.frame.buffers.written(mean) else {
            return Ok(None);
        };
        let mut recorder = FrameRecorder::new(&self.context, None, "mean");
        recorder.read(&[(mean, 16 * first as u64, 16 * count as u64)]);
        let ticket = recorder.send("mean")?;
        self.context.count_wait();
        let read = ticket.arrive(&self.context, &mut PassTimes::default())?;
        Ok(read
            .first()
            .map(|bytes| bytemuck::pod_collect_to_vec(bytes)))
    }

    /// Mean radiance of an eye over frames, W/(m² sr), row 0 on top; `None` before the first frame. Waits for the device.
    ///
    /// # Errors
    /// [`RenderError::Gpu`].
    #[cfg_attr(not(feature = "internals"), doc(hidden))]
    pub fn read_mean(&self, eye: Eye) -> Result<Option<Vec<[f32; 3]>>, RenderError> {
        let read = self.read_still(eye, [0, self.pixels()])?;
        Ok(read.map(|mean| mean.iter().map(|&[r, g, b, _]| [r, g, b]).collect()))
    }

    /// One pixel of [`Renderer::read_mean`]; `None` also outside the image.
    ///
    /// # Errors
    /// [`RenderError::Gpu`].
    #[cfg_attr(not(feature = "internals"), doc(hidden))]
    pub fn read_mean_at(&self, eye: Eye, pixel: usize) -> Result<Option<[f32; 3]>, RenderError> {
        if pixel >= self.pixels() {
            return Ok(None);
        }
        let read = self.read_still(eye, [pixel, 1])?;
        Ok(read.and_then(|mean| mean.first().map(|&[r, g, b, _]| [r, g, b])))
    }

    /// Variance of the mean's luminance in each pixel, (W/(m² sr))²: the sample variance (with n - 1) over n. `None` under two
    /// frames. Waits for the device.
    ///
    /// # Errors
    /// [`RenderError::Gpu`].
    #[cfg_attr(not(feature = "internals"), doc(hidden))]
    pub fn read_mean_variance(&self, eye: Eye) -> Result<Option<Vec<f32>>, RenderError> {
        if self.still.frames < 2 {
            return Ok(None);
        }
        let n = self.still.frames as f32;
        let read = self.read_still(eye, [0, self.pixels()])?;
        let variance = |&[_, _, _, squares]: &[f32; 4]| squares / (n * (n - 1.0));
        Ok(read.map(|mean| mean.iter().map(variance).collect()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gpu::GpuContext;
    use crate::images::{Image, luminance, srgb_encode};
    use crate::renderer::RenderSettings;
    use crate::scene::Scene;
    use crate::settings::{Choice as _, Eyes, Method, Settings};
    use crate::tone::{shown, tone_map_by};
    use crate::xr::{Headset, Pose};

    /// Half of the distance of two f32 about 1: what rounding costs at most, relatively.
    const ROUNDING: f64 = 1.0 / (1 << 24) as f64;

    /// A renderer that has rendered a frame of the left eye, and its shaders.
    fn rendered(size: [u32; 2]) -> (Renderer, ShaderLibrary) {
        let defaults = Settings::default();
        let settings = RenderSettings {
            method: Method::Path,
            ..RenderSettings::default()
        };
        let scene = Scene::builtin("plane").unwrap();
        let library = ShaderLibrary::embedded();
        let context = GpuContext::open(Some(&defaults.adapter)).unwrap();
        let mut renderer =
            Renderer::new(context, &library, &scene, &settings, Eyes::Left, size).unwrap();
        let headset = Headset::load(&defaults.headset).unwrap();
        let views = headset.views_from_head(&Pose::new(glam::DVec3::Y, glam::DQuat::IDENTITY));
        renderer.render_frame(&views, 0, |_| {}).unwrap();
        (renderer, library)
    }

    /// As if the frame had shown this.
    fn show(renderer: &Renderer, light: &[[f32; 3]]) {
        let place = (Whose::Eye(Eye::Left), "radiance_sum");
        let buffer = renderer.frame.buffers.written(place).unwrap();
        let rows: Vec<[f32; 4]> = light.iter().map(|&[r, g, b]| [r, g, b, 0.0]).collect();
        let queue = &renderer.context.queue;
        queue.write_buffer(buffer, 0, bytemuck::cast_slice(&rows));
    }

    /// Numbers from 0 to 1 (PCG, O'Neill 2014).
    fn random(seed: u32) -> f32 {
        let state = seed.wrapping_mul(747_796_405).wrapping_add(2_891_336_453);
        let word = ((state >> ((state >> 28) + 4)) ^ state).wrapping_mul(277_803_737);
        ((word >> 22) ^ word) as f32 / u32::MAX as f32
    }

    /// What pixel `pixel` shows in frame `frame`: dark to bright pixels of little to much noise, every fifth with rare bright
    /// frames, the first among them.
    fn noisy(pixel: u32, frame: u32) -> [f32; 3] {
        let bright = 10.0_f32.powi(pixel as i32 % 9 - 4);
        let noise = 10.0_f32.powi(-(pixel as i32 / 9 % 3));
        let seed = 4 * (pixel + 64 * frame);
        let is_spike = pixel.is_multiple_of(5) && (frame == 0 || random(seed + 3) < 0.01);
        let spike = if is_spike { 1000.0 } else { 1.0 };
        [0, 1, 2].map(|c| bright * spike * (1.0 + noise * (random(seed + c) - 0.5)))
    }

    #[test]
    fn mean_and_variance_of_many_frames_are_those_of_f64() {
        const FRAMES: u32 = 1024;
        let (mut renderer, library) = rendered([8, 8]);
        let display = Display {
            exposure: 1.0,
            tone: Tone::Linear,
        };
        let pixels = 0..64_u32;
        // Mean, squares' sum of what is off it, and how much f32 may be off in both.
        let mut twin = vec![([0.0_f64; 3], 0.0_f64, 0.0_f64); 64];
        for frame in 0..FRAMES {
            let n = f64::from(frame + 1);
            let mut light: Vec<[f32; 3]> = pixels.clone().map(|p| noisy(p, frame)).collect();
            let mut shown = light.clone();
            if frame % 7 == 3 {
                shown[7][1] = f32::NAN;
                shown[8][2] = f32::INFINITY;
                [light[7], light[8]] = [[0.0; 3]; 2];
            }
            show(&renderer, &shown);
            let [left, right] = renderer.average(&library, display).unwrap();
            let non_finite = if frame % 7 == 3 { 2 } else { 0 };
            assert_eq!(left.unwrap().non_finite, non_finite, "frame {frame}");
            assert!(right.is_none());
            for ((mean, squares, slack), light) in twin.iter_mut().zip(&light) {
                let light = light.map(f64::from);
                let before = luminance(*mean);
                let off = luminance(light) - before;
                for (mean, light) in mean.iter_mut().zip(light) {
                    *mean += (light - *mean) / n;
                }
                *squares += off * off * (n - 1.0) / n;
                // The mean's own error, below; the difference is rounded, and so are products and sums of luminance.
                let error = ROUNDING * ((n + 52.0) * before + 6.0 * (luminance(light) + before));
                *slack += 2.0 * off.abs() * error + error * error;
            }
        }
        assert_eq!(renderer.mean_frames(), FRAMES);
        let n = f64::from(FRAMES);
        let means = renderer.read_mean(Eye::Left).unwrap().unwrap();
        let variances = renderer.read_mean_variance(Eye::Left).unwrap().unwrap();
        for (pixel, (mean, squares, slack)) in twin.iter().enumerate() {
            // The k-th frame rounds the mean m_k once, and its step (light - m) / k by a difference and a division (2.5 ulp
            // in WGSL, 5 roundings): 6 roundings of (light + m) / k. Later frames shrink an error to k / n of it, and
            // as no light is negative m_k is at most n m_n / k. All in all n m_n, and 6 (1 + 1 + 1/2 + ... + 1/n) m_n.
            for (read, mean) in means[pixel].iter().zip(mean) {
                let off = (f64::from(*read) - mean).abs();
                let most = (n + 52.0) * ROUNDING * mean;
                assert!(off <= most, "pixel {pixel}: {read} for {mean}");
            }
            // A sum of n numbers that are not negative, each rounded a few times.
            let most = (slack + (n + 16.0) * ROUNDING * squares) / (n * (n - 1.0));
            let (read, variance) = (variances[pixel], squares / (n * (n - 1.0)));
            let off = (f64::from(read) - variance).abs();
            assert!(off <= most, "pixel {pixel}: {read} for {variance}, {most}");
            assert!(most < 0.2 * variance, "pixel {pixel}: {most} says nothing");
            let at = renderer.read_mean_at(Eye::Left, pixel).unwrap();
            assert_eq!(at, Some(means[pixel]));
        }
        assert_eq!(renderer.read_mean_at(Eye::Left, 64).unwrap(), None);
        assert!(renderer.read_mean(Eye::Right).unwrap().is_none());
        renderer.forget_mean();
        assert!(renderer.read_mean(Eye::Left).unwrap().is_none());
        show(&renderer, &[[2.0; 3]; 64]);
        renderer.average(&library, display).unwrap();
        assert_eq!(
            renderer.read_mean(Eye::Left).unwrap(),
            Some(vec![[2.0; 3]; 64])
        );
        assert!(renderer.read_mean_variance(Eye::Left).unwrap().is_none());
    }

    #[test]
    fn pictures_are_the_hosts_but_for_a_step_where_it_nearly_ties() {
        let size = [64, 48];
        let (mut renderer, library) = rendered(size);
        // From black over what every curve bends to what is white; every ninth channel is negative.
        let light: Vec<[f32; 3]> = (0..64 * 48)
            .map(|pixel| {
                [0, 1, 2].map(|c| {
                    let sign = if (3 * pixel + c) % 9 == 8 { -1.0 } else { 1.0 };
                    sign * 10.0_f32.powf(6.0 * random(3 * pixel + c) - 4.0)
                })
            })
            .collect();
        show(&renderer, &light);
        let image = Image::new(size[0], size[1], light.clone()).unwrap();
        let exposure = 1.5;
        for &tone in Tone::ALL {
            renderer.forget_mean();
            let display = Display { exposure, tone };
            let [left, _] = renderer.average(&library, display).unwrap();
            let rgba = left.unwrap().rgba;
            let host = tone_map_by(&image, exposure, tone);
            let mut levels = std::collections::BTreeSet::new();
            for (pixel, (device, host)) in rgba.chunks_exact(4).zip(&host.pixels).enumerate() {
                assert_eq!(device[3], 255);
                let exact = shown(tone, light[pixel].map(|c| c * exposure as f32));
                for c in 0..3 {
                    levels.insert(host[c]);
                    let step = 255.0 * srgb_encode(exact[c]);
                    // AgX is the worst: its polynomial's terms, 95 in all at 1, cancel, which two ways of rounding (with a
                    // fused product and sum, say) leave 2 x 95 x 6e-8 = 1.1e-5 apart; its logarithm's 3 ulp of 12 stops, 2.9e-6
                    // of them, count for less. The matrix makes at most 1.4 of it, 255 steps 0.004. Twice that for
                    // the powers, whose exponents are good to 3 ulp.
                    let from_tie = (step.fract() - 0.5).abs();
                    let off = device[c].abs_diff(host[c]);
                    assert!(
                        off == 0 || (off == 1 && from_tie < 0.01),
                        "{tone}, pixel {pixel}: {} for {step}",
                        device[c]
                    );
                }
            }
            assert!(levels.len() > 200, "{tone}: {} levels", levels.len());
        }
    }
}
