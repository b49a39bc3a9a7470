//! SVG as PNG and PDF, drawn with an embedded font, so that pictures are the same on every machine.

use std::sync::{Arc, OnceLock};

use resvg::usvg::fontdb::Database;
use resvg::usvg::{Options, Tree};
use resvg::{tiny_skia, usvg};
use thiserror::Error;

use super::text::font;

/// Range of resolutions of a PNG (dots per inch).
const DPI: std::ops::RangeInclusive<f64> = 10.0..=2400.0;
/// Largest number of pixels of a PNG.
const PIXELS: f64 = 2e8;
/// Resolution of the CSS pixel (dots per inch), the unit of `usvg`.
const CSS_DPI: f64 = 96.0;

/// A figure that cannot be converted to an image.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum ImageError {
    /// The resolution is out of range.
    #[error("a resolution of {dpi} dpi is outside {} to {}", DPI.start(), DPI.end())]
    Resolution {
        /// Dots per inch.
        dpi: f64,
    },
    /// The image would have too many pixels.
    #[error("{width} × {height} pixels are too many; take fewer dpi")]
    TooLarge {
        /// Width (pixels).
        width: f64,
        /// Height (pixels).
        height: f64,
    },
    /// The SVG is not valid.
    #[error("{0}")]
    Svg(#[from] usvg::Error),
    /// The encoder failed.
    #[error("{0}")]
    Encoder(String),
}

fn tree(svg: &str) -> Result<Tree, ImageError> {
    static FONTS: OnceLock<Arc<Database>> = OnceLock::new();
    let fonts = FONTS.get_or_init(|| {
        let mut fonts = Database::new();
        fonts.load_font_data(font().to_vec());
        Arc::new(fonts)
    });
    let options =
        Options { fontdb: Arc::clone(fonts), dpi: CSS_DPI as f32, font_family: "DejaVu Sans".into(), ..Options::default() };
    Ok(Tree::from_str(svg, &options)?)
}

/// Renders an SVG at a resolution (dots per inch).
///
/// # Errors
/// [`ImageError`] if the SVG is not valid, or the resolution or the image size is out of range.
pub(super) fn pixels(svg: &str, dpi: f64) -> Result<tiny_skia::Pixmap, ImageError> {
    if !DPI.contains(&dpi) {
        return Err(ImageError::Resolution { dpi });
    }
    let tree = tree(svg)?;
    let scale = dpi / CSS_DPI;
    let [width, height] = [tree.size().width(), tree.size().height()].map(|side| (f64::from(side) * scale).round().max(1.0));
    if width * height > PIXELS {
        return Err(ImageError::TooLarge { width, height });
    }
    let mut map = tiny_skia::Pixmap::new(width as u32, height as u32).ok_or(ImageError::TooLarge { width, height })?;
    map.fill(tiny_skia::Color::WHITE);
    resvg::render(&tree, usvg::Transform::from_scale(scale as f32, scale as f32), &mut map.as_mut());
    Ok(map)
}

/// Converts an SVG to a PNG at a resolution (dots per inch), which the file records.
///
/// # Errors
/// [`ImageError`] if the SVG is not valid, or the resolution or the image size is out of range.
pub fn png(svg: &str, dpi: f64) -> Result<Vec<u8>, ImageError> {
    let failed = |error: png::EncodingError| ImageError::Encoder(error.to_string());
    let map = pixels(svg, dpi)?;
    let mut out = Vec::new();
    let mut encoder = png::Encoder::new(&mut out, map.width(), map.height());
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_depth(png::BitDepth::Eight);
    let per_metre = (dpi / 0.0254).round() as u32;
    encoder.set_pixel_dims(Some(png::PixelDimensions { xppu: per_metre, yppu: per_metre, unit: png::Unit::Meter }));
    // The background is white and opaque.
    let rgb: Vec<u8> = map.data().chunks_exact(4).flat_map(|p| [p[0], p[1], p[2]]).collect();
    let mut writer = encoder.write_header().map_err(failed)?;
    writer.write_image_data(&rgb).map_err(failed)?;
    writer.finish().map_err(failed)?;
    Ok(out)
}

/// Converts an SVG to a PDF of one page of its physical size, with its font embedded.
///
/// # Errors
/// [`ImageError`] if the SVG is not valid.
pub fn pdf(svg: &str) -> Result<Vec<u8>, ImageError> {
    let page = svg2pdf::PageOptions { dpi: CSS_DPI as f32 };
    svg2pdf::to_pdf(&tree(svg)?, svg2pdf::ConversionOptions::default(), page)
        .map_err(|error| ImageError::Encoder(format!("{error:?}")))
}
