//! Pictures: figures as SVG, PNG and PDF, animations as HTML and GIF.

mod axis;
mod canvas;
mod figure;
mod gif;
mod heatmap;
mod image;
mod panel;
mod player;
mod recordings;
mod results;
mod series;
mod text;

pub use canvas::Size;
pub use figure::Figure;
pub use gif::gif;
pub use heatmap::{Categories, colour, heat_map};
pub use image::{pdf, png};
pub use player::player;
pub use recordings::{Kind, amplitudes, shape, shapes, spectrum, traces};
pub use results::{ResultsError, View, figure_of_results, label_of, results};
pub use series::Mark;
pub(crate) use text::escape;
