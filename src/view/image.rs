//! SVG as PNG and PDF, with one font that is carried along, so that a picture is the same on every machine.

use std::sync::{Arc, OnceLock};

use resvg::usvg::fontdb::Database;
use resvg::usvg::{Options, Tree};
use resvg::{tiny_skia, usvg};

use super::text::font;

/// Resolutions of a PNG (dots per inch).
const DPI: std::ops::RangeInclusive<f64> = 10.0..=2400.0;
/// Pixels of a PNG at most.
const PIXELS: f64 = 2e8;
/// Dots per inch of the CSS pixel, in which `usvg` counts.
const CSS_DPI: f64 = 96.0;

fn tree(svg: &str) -> Result<Tree, String> {
    static FONTS: OnceLock<Arc<Database>> = OnceLock::new();
    let fonts = FONTS.get_or_init(|| {
        let mut fonts = Database::new();
        fonts.load_font_data(font().to_vec());
        Arc::new(fonts)
    });
    let options =
        Options { fontdb: Arc::clone(fonts), dpi: CSS_DPI as f32, font_family: "DejaVu Sans".into(), ..Options::default() };
    Tree::from_str(svg, &options).map_err(|error| error.to_string())
}

/// Pixels of an SVG at a resolution.
pub(super) fn pixels(svg: &str, dpi: f64) -> Result<tiny_skia::Pixmap, String> {
    if !DPI.contains(&dpi) {
        return Err(format!("a resolution of {dpi} dpi is outside {} to {}", DPI.start(), DPI.end()));
    }
    let tree = tree(svg)?;
    let scale = dpi / CSS_DPI;
    let [width, height] = [tree.size().width(), tree.size().height()].map(|side| (f64::from(side) * scale).round().max(1.0));
    if width * height > PIXELS {
        return Err(format!("{width} × {height} pixels are too many; take fewer dpi"));
    }
    let mut map = tiny_skia::Pixmap::new(width as u32, height as u32).ok_or("the picture is too large")?;
    map.fill(tiny_skia::Color::WHITE);
    resvg::render(&tree, usvg::Transform::from_scale(scale as f32, scale as f32), &mut map.as_mut());
    Ok(map)
}

/// An SVG as PNG at a resolution (dots per inch), which the file tells.
///
/// # Errors
/// What is wrong with the SVG, or a picture too large, in words.
pub fn png(svg: &str, dpi: f64) -> Result<Vec<u8>, String> {
    let map = pixels(svg, dpi)?;
    let mut out = Vec::new();
    let mut encoder = png::Encoder::new(&mut out, map.width(), map.height());
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_depth(png::BitDepth::Eight);
    let per_metre = (dpi / 0.0254).round() as u32;
    encoder.set_pixel_dims(Some(png::PixelDimensions { xppu: per_metre, yppu: per_metre, unit: png::Unit::Meter }));
    // The background is white and opaque.
    let rgb: Vec<u8> = map.data().chunks_exact(4).flat_map(|p| [p[0], p[1], p[2]]).collect();
    let mut writer = encoder.write_header().map_err(|error| error.to_string())?;
    writer.write_image_data(&rgb).map_err(|error| error.to_string())?;
    writer.finish().map_err(|error| error.to_string())?;
    Ok(out)
}

/// An SVG as PDF of one page of its physical size, with its font embedded.
///
/// # Errors
/// What is wrong with the SVG, in words.
pub fn pdf(svg: &str) -> Result<Vec<u8>, String> {
    let page = svg2pdf::PageOptions { dpi: CSS_DPI as f32 };
    svg2pdf::to_pdf(&tree(svg)?, svg2pdf::ConversionOptions::default(), page).map_err(|error| format!("{error:?}"))
}
