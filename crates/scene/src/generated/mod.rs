//! Scenes that are made when they are asked for, as binary glTF, so that they come in as any file does: the terrain, the water
//! and the bottle by which ray tracers are commonly judged. The same bytes every time.

mod bottle;
mod glb;
mod noise;
mod surface;
mod terrain;
mod water;

pub(super) use noise::{fractal, smooth};

pub(super) use bottle::bottle;
pub(super) use terrain::terrain;
pub(super) use water::water;
