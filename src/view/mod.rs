//! Pictures: figures as SVG, animations as HTML and GIF.

mod figure;
mod gif;
mod heatmap;
mod player;
mod recordings;
mod results;

pub(crate) use figure::escape;
pub use figure::{Figure, Mark};
pub use gif::gif;
pub use heatmap::{Categories, colour, heat_map};
pub use player::player;
pub use recordings::{Kind, amplitudes, shape, shapes, spectrum, traces};
pub use results::{ResultsError, label_of, results};
