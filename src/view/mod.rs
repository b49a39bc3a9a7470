//! Figures as SVG, PNG and PDF, animations as HTML and GIF, parts of HTML pages, and formatted numbers.

mod axis;
mod canvas;
mod figure;
mod gif;
mod heatmap;
mod image;
pub(crate) mod page;
mod panel;
mod player;
mod recordings;
mod results;
mod series;
mod text;

pub use crate::number::{NONE, digits_for, fixed, minus, signed, significant};
pub use canvas::Size;
pub use figure::{Figure, heat_map};
pub use gif::gif;
pub use heatmap::{Categories, colour};
pub use image::{ImageError, pdf, png};
pub use player::player;
pub use recordings::{Kind, aliased, amplitudes, shape, shapes, spectrum, traces};
pub use results::{ResultsError, View, figure_of_results, label_of, results};
pub use series::Mark;
pub(crate) use text::escape;
