//! Figures as an editor takes them: measured by the geometry of the SVG, and the sizes of PNG and PDF.

mod common;

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Output;

use roxmltree::{Document, Node};
use sfers::view::{Figure, Mark, Size};

/// A box on the page (pt): left, top, right, bottom.
type Area = [f64; 4];

struct Bench(tempfile::TempDir);

impl Bench {
    fn new() -> Self {
        let bench = Self(tempfile::tempdir().unwrap());
        let reference = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/recordings/inchworm-m1.npz");
        fs::copy(reference, bench.path("walk.npz")).unwrap();
        let text = String::from_utf8(bench.sfers(&["preset", "jump-14hz"]).stdout).unwrap();
        fs::write(bench.path("jump.toml"), text).unwrap();
        let run =
            ["run", "jump.toml", "--engine", "planar", "--set", "simulation.time_step_s=1e-4", "--quiet", "--out", "jump.npz"];
        assert!(bench.sfers(&run).status.success());
        // Results as a sweep writes them, with a run that failed.
        for (name, axes) in
            [("one", [1, 1, 9]), ("two", [1, 3, 9]), ("map", [1, 8, 9]), ("three", [4, 5, 9]), ("maps", [3, 7, 9])]
        {
            let mut rows = String::from("robot.friction.low,robot.damping_eta,drive.frequency_hz,robot.m,speed_mm_s,status\n");
            for (a, b, c) in (0..axes[0]).flat_map(|a| (0..axes[1]).flat_map(move |b| (0..axes[2]).map(move |c| (a, b, c)))) {
                let (friction, eta, hz) = (0.2 + 0.4 * f64::from(a), 0.008 + 0.025 * f64::from(b), 4.0 + 4.0 * f64::from(c));
                let speed = 30.0 * (hz / 6.0 + friction).sin() * (1.0 - 3.0 * eta);
                let failed = (a, b, c) == (0, 0, 4);
                let end = if failed { ",failed: no contact".to_owned() } else { format!("{speed},ok") };
                rows += &format!("{friction},{eta},{hz},3,{end}\n");
            }
            fs::create_dir(bench.path(name)).unwrap();
            fs::write(bench.path(name).join("results.csv"), rows).unwrap();
        }
        bench
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    fn sfers(&self, arguments: &[&str]) -> Output {
        common::sfers(self.0.path(), arguments)
    }

    fn plot(&self, arguments: &[&str]) -> String {
        let output = self.sfers(&[&["plot"], arguments, &["--out", "-"]].concat());
        assert!(output.status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&output.stderr));
        String::from_utf8(output.stdout).unwrap()
    }

    /// Every kind of figure, in a size.
    fn all(&self, size: &str) -> Vec<(String, String)> {
        let recordings =
            ["jump.npz", "walk.npz"].into_iter().flat_map(|file| ["shapes", "traces", "spectrum"].map(|kind| (file, kind)));
        let mut figures: Vec<_> = recordings
            .map(|(file, kind)| (format!("{file} {kind} {size}"), self.plot(&[file, "--kind", kind, "--size", size])))
            .collect();
        for name in ["one", "two", "map", "three", "maps"] {
            figures.push((format!("{name} {size}"), self.plot(&[&format!("{name}/results.csv"), "--size", size])));
        }
        figures
    }
}

/// Width of a text (pt), by the font that PNG and PDF embed.
fn width(text: &str, size: f64) -> f64 {
    let face = ttf_parser::Face::parse(dejavu::sans::regular(), 0).unwrap();
    let advance = |c| f64::from(face.glyph_hor_advance(face.glyph_index(c).unwrap()).unwrap());
    text.chars().map(advance).sum::<f64>() * size / f64::from(face.units_per_em())
}

fn number(node: Node, name: &str) -> f64 {
    node.attribute(name).unwrap_or_else(|| panic!("{node:?} has no {name}")).parse().unwrap()
}

/// Where a text stands: 0.72 em above its baseline, the height of capitals and digits, to 0.2 em below.
fn text_area(node: Node) -> Area {
    let text = node.text().unwrap_or_default();
    let size = number(node, "font-size");
    let across = width(text, size);
    let begin = match node.attribute("text-anchor") {
        Some("middle") => -across / 2.0,
        Some("end") => -across,
        _ => 0.0,
    };
    if let Some(transform) = node.attribute("transform") {
        let inner = transform.strip_prefix("translate(").unwrap().split(')').next().unwrap();
        let (x, y) = inner.split_once(' ').unwrap();
        let (x, y): (f64, f64) = (x.parse().unwrap(), y.parse().unwrap());
        return [x - 0.72 * size, y - begin - across, x + 0.2 * size, y - begin];
    }
    let (x, y) = (number(node, "x") + begin, number(node, "y"));
    [x, y - 0.72 * size, x + across, y + 0.2 * size]
}

fn texts<'a>(node: Node<'a, 'a>) -> Vec<(String, Area)> {
    node.descendants().filter(|n| n.has_tag_name("text")).map(|n| (n.text().unwrap_or_default().into(), text_area(n))).collect()
}

fn overlap(a: Area, b: Area) -> bool {
    a[0] < b[2] && b[0] < a[2] && a[1] < b[3] && b[1] < a[3]
}

fn of_class<'a>(document: &'a Document, class: &str) -> Vec<Node<'a, 'a>> {
    document.descendants().filter(|n| n.attribute("class") == Some(class)).collect()
}

/// The boxes of the axes; that of a colour bar is none.
fn frames(document: &Document) -> Vec<Area> {
    let in_key = |n: &Node| n.ancestors().any(|a| a.attribute("class") == Some("key"));
    let area = |n: Node| {
        let (x, y) = (number(n, "x"), number(n, "y"));
        [x, y, x + number(n, "width"), y + number(n, "height")]
    };
    of_class(document, "frame").into_iter().filter(|n| !in_key(n)).map(area).collect()
}

#[test]
fn texts_stay_on_the_page_off_one_another_and_off_the_data_in_every_figure_and_size() {
    let bench = Bench::new();
    for size in ["single", "double", "screen"] {
        for (name, svg) in bench.all(size) {
            let document = Document::parse(&svg).unwrap();
            let root = document.root_element();
            let view: Vec<f64> = root.attribute("viewBox").unwrap().split(' ').map(|v| v.parse().unwrap()).collect();
            let all = texts(root);
            assert!(all.len() > 4, "{name}");
            let axes = frames(&document);
            assert!(!axes.is_empty(), "{name}");
            for (i, (text, area)) in all.iter().enumerate() {
                let inside = area[0] >= 0.0 && area[1] >= 0.0 && area[2] <= view[2] && area[3] <= view[3];
                assert!(inside, "{name}: {text} leaves the page: {area:?} of {view:?}");
                for (other, at) in &all[..i] {
                    assert!(!overlap(*area, *at), "{name}: {text} stands on {other}");
                }
                for frame in &axes {
                    assert!(!overlap(*area, *frame), "{name}: {text} stands on the data");
                }
                let mut before = 'x';
                for c in text.chars() {
                    assert!(
                        !(before == '-' && c.is_ascii_digit() && !text.contains("hz")),
                        "{name}: {text} has a hyphen for a minus"
                    );
                    before = c;
                }
                assert!(!text.contains("−0.00") && text != "−0", "{name}: {text}");
            }
        }
    }
}

#[test]
fn a_figure_is_one_column_wide_with_letters_of_8_points_and_other_widths_on_request() {
    let bench = Bench::new();
    for (arguments, mm, points) in [
        (&["jump.npz"][..], 85.0, 8.0),
        (&["jump.npz", "--size", "double"], 175.0, 8.0),
        (&["jump.npz", "--size", "screen"], 170.0, 9.5),
        (&["jump.npz", "--width-mm", "120"], 120.0, 8.0),
    ] {
        let svg = bench.plot(arguments);
        let document = Document::parse(&svg).unwrap();
        let root = document.root_element();
        let side = |name: &str| root.attribute(name).unwrap().strip_suffix("mm").unwrap().parse::<f64>().unwrap();
        assert_eq!(side("width"), mm);
        let view: Vec<f64> = root.attribute("viewBox").unwrap().split(' ').map(|v| v.parse().unwrap()).collect();
        // Written with three digits: one unit is one point in both directions.
        assert!((view[2] - mm / 25.4 * 72.0).abs() < 1e-3 && (view[3] / 72.0 * 25.4 - side("height")).abs() < 1e-3);
        let sizes: Vec<f64> = document.descendants().filter(|n| n.has_tag_name("text")).map(|n| number(n, "font-size")).collect();
        assert_eq!(sizes.iter().copied().fold(f64::INFINITY, f64::min), points);
    }
    let output = bench.sfers(&["plot", "jump.npz", "--width-mm", "3", "--out", "a.svg"]);
    assert_eq!(output.status.code(), Some(2));
}

/// Dash and marker of each sample of the legend.
fn samples(document: &Document) -> Vec<String> {
    let legend = of_class(document, "legend")[0];
    let mut samples: Vec<String> = Vec::new();
    for node in legend.children().filter(Node::is_element) {
        match node.tag_name().name() {
            "line" => samples.push(node.attribute("stroke-dasharray").unwrap_or("solid").into()),
            "text" => {}
            marker => {
                let form = node.attribute("d").map_or("", |d| d.split_once(['h', 'l']).unwrap().1);
                samples.last_mut().unwrap().push_str(&format!(" {marker} {form}"));
            }
        }
    }
    samples
}

#[test]
fn five_series_differ_in_dash_and_in_marker_and_six_have_labels_at_their_ends() {
    let figure = |count: usize| {
        let mut figure = Figure::new("t", "x (s)", "y (mm)");
        for k in 0..count {
            figure.series(&format!("series {k}"), (0..50).map(|x| (f64::from(x), (1 + k) as f64 * f64::from(x))), Mark::Line);
        }
        figure.size(Size::SINGLE).svg()
    };
    let svg = figure(5);
    let document = Document::parse(&svg).unwrap();
    let found = samples(&document);
    assert_eq!(found.len(), 5);
    let parts =
        |i: usize| found.iter().map(|s| s.split_once(' ').unwrap()).map(|p| if i == 0 { p.0 } else { p.1 }).collect::<Vec<_>>();
    for i in 0..2 {
        let mut distinct = parts(i);
        distinct.sort_unstable();
        distinct.dedup();
        assert_eq!(distinct.len(), 5, "{found:?}");
    }
    // Along the lines there are markers too, not in the legend alone.
    assert!(svg.matches("<circle").count() > 3);
    for count in [6, 14] {
        let svg = figure(count);
        let document = Document::parse(&svg).unwrap();
        assert!(of_class(&document, "legend").is_empty());
        let ends = texts(of_class(&document, "ends")[0]);
        let frame = frames(&document)[0];
        assert_eq!(ends.len(), count);
        for (i, (text, area)) in ends.iter().enumerate() {
            assert!(area[0] > frame[2], "{text} stands on the data");
            assert!(ends[..i].iter().all(|(_, other)| !overlap(*area, *other)), "{text} stands on another label");
        }
    }
}

#[test]
fn robots_stand_on_a_hatched_floor_at_zero() {
    let bench = Bench::new();
    let svg = bench.plot(&["jump.npz", "--kind", "shapes"]);
    let document = Document::parse(&svg).unwrap();
    let (floors, frames) = (of_class(&document, "floor"), frames(&document));
    assert!(floors.len() >= 4 && floors.len() == frames.len());
    let panels = of_class(&document, "panel");
    for ((panel, floor), frame) in panels.iter().zip(&floors).zip(&frames) {
        let line = floor.children().find(|n| n.has_tag_name("line")).unwrap();
        let hatching = floor.children().find(|n| n.has_tag_name("path")).unwrap().attribute("d").unwrap();
        let y = number(line, "y1");
        assert!(hatching.matches('M').count() > 20);
        // The number 0 of the axis stands at the floor, which is the lower end of the axes.
        let zero = panel.descendants().find(|n| n.has_tag_name("text") && n.text() == Some("0")).unwrap();
        assert!((number(zero, "y") - 0.36 * 8.0 - y).abs() < 0.02 && (frame[3] - y).abs() < 0.02);
        let robot = panel.descendants().find(|n| n.has_tag_name("polyline")).unwrap();
        let half = number(robot, "stroke-width") / 2.0;
        let points = robot.attribute("points").unwrap().split(' ').map(|p| p.split_once(',').unwrap());
        let below = points.map(|(_, z)| z.parse::<f64>().unwrap() + half - y).fold(f64::NEG_INFINITY, f64::max);
        // A contact gives way by some hundredths of a millimetre, which is a tenth of a point at this size.
        assert!(half > 1.0 && below < 0.1, "{below}");
    }
}

#[test]
fn axes_of_heights_and_amplitudes_begin_at_zero_and_traces_have_travel_and_voltages() {
    let bench = Bench::new();
    for (kind, label) in [("traces", "height z (mm)"), ("spectrum", "amplitude of z (mm)")] {
        let svg = bench.plot(&["jump.npz", "--kind", kind]);
        let document = Document::parse(&svg).unwrap();
        let frame = frames(&document)[0];
        assert!(texts(document.root_element()).iter().any(|(text, _)| text == label));
        let zero =
            of_class(&document, "panel")[0].descendants().find(|n| n.has_tag_name("text") && n.text() == Some("0")).unwrap();
        assert!((number(zero, "y") - 0.36 * 8.0 - frame[3]).abs() < 0.02, "{kind}");
    }
    let svg = bench.plot(&["jump.npz", "--kind", "traces"]);
    let document = Document::parse(&svg).unwrap();
    let all: Vec<String> = texts(document.root_element()).into_iter().map(|t| t.0).collect();
    for words in ["jump: heights, travel and voltages", "travel", "1, 5", "2, 4", "3", "0 to 520 V", "−1500 to 0 V"] {
        assert!(all.iter().any(|text| text.starts_with(words)), "{words}: {all:?}");
    }
    let frames = frames(&document);
    assert!(frames.len() == 3 && frames.windows(2).all(|w| w[0][3] < w[1][1]), "three panels below one another");
}

#[test]
fn maps_have_no_seams_and_a_labelled_colour_bar() {
    let bench = Bench::new();
    let svg = bench.plot(&["map/results.csv"]);
    let document = Document::parse(&svg).unwrap();
    let frame = frames(&document)[0];
    let cells: Vec<Area> = of_class(&document, "cells")[0]
        .children()
        .filter(|n| n.has_tag_name("rect"))
        .map(|n| (n, number(n, "x"), number(n, "y")))
        .map(|(n, x, y)| [x, y, x + number(n, "width"), y + number(n, "height")])
        .collect();
    assert_eq!(cells.len(), 8 * 9);
    // Every place, the corners of cells too, lies well inside some cell that is painted.
    for i in 0..=180 {
        for j in 0..=160 {
            let x = frame[0] + (frame[2] - frame[0]) * (f64::from(i) / 180.0).clamp(0.001, 0.999);
            let y = frame[1] + (frame[3] - frame[1]) * (f64::from(j) / 160.0).clamp(0.001, 0.999);
            assert!(cells.iter().any(|c| x >= c[0] - 0.002 && y >= c[1] - 0.002 && x <= c[2] + 0.002 && y <= c[3] + 0.002));
        }
    }
    let right_edges =
        cells.iter().filter(|c| cells.iter().any(|d| (c[0] < d[0] - 0.1) && (d[0] < c[2] - 0.5) && (c[1] - d[1]).abs() < 0.01));
    assert!(right_edges.count() > 50, "cells do not reach below their neighbours");
    let key = texts(of_class(&document, "key")[0]);
    let names: Vec<&str> = key.iter().map(|t| t.0.as_str()).collect();
    assert!(names.contains(&"speed (mm/s)") && names.contains(&"no value") && names.contains(&"0"), "{names:?}");
}

#[test]
fn sweeps_over_three_keys_plot_as_small_multiples_and_keys_are_chosen() {
    let bench = Bench::new();
    let titles = |svg: &str| {
        let document = Document::parse(svg).unwrap();
        texts(document.root_element()).into_iter().map(|t| t.0).collect::<Vec<_>>()
    };
    let svg = bench.plot(&["three/results.csv"]);
    let all = titles(&svg);
    assert!(all[0].starts_with("three: speed over frequency, damping eta"), "{all:?}");
    assert!(all.iter().any(|t| t.contains("m = 3") && t.contains("1 of 180 runs without a value")), "{all:?}");
    for friction in ["0.2", "0.6", "1", "1.4"] {
        assert!(all.contains(&format!("friction low = {friction}")), "{all:?}");
    }
    assert_eq!(frames(&Document::parse(&svg).unwrap()).len(), 4);
    let svg = bench.plot(&["three/results.csv", "--by", "robot.damping_eta"]);
    assert!(frames(&Document::parse(&svg).unwrap()).len() == 5 && titles(&svg).contains(&"damping eta = 0.033".into()));
    let svg = bench.plot(&["three/results.csv", "--where", "robot.friction.low=0.6"]);
    assert!(frames(&Document::parse(&svg).unwrap()).len() == 1 && titles(&svg).iter().any(|t| t.contains("friction low = 0.6")));
    let svg = bench.plot(&["three/results.csv", "--where", "friction.low=1", "--where", "damping_eta=0.008"]);
    assert_eq!(svg.matches("<circle").count(), 9);
    for (choice, words) in [
        (["--where", "friction.low=7"], "there are 0.2, 0.6, 1, 1.4"),
        (["--where", "mass=7"], "robot.damping_eta"),
        (["--by", "robot.m"], "one value"),
        (["--where", "friction.low"], "KEY=VALUE"),
    ] {
        let output = bench.sfers(&[&["plot", "three/results.csv", "--out", "x.svg"], &choice[..]].concat());
        let text = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(output.status.code() == Some(2) && text.contains(words), "{choice:?}: {text}");
        assert!(!bench.path("x.svg").exists());
    }
}

#[test]
fn png_and_pdf_have_the_physical_size_of_the_svg() {
    let bench = Bench::new();
    let svg = bench.plot(&["jump.npz", "--kind", "traces"]);
    let document = Document::parse(&svg).unwrap();
    let mm = |name: &str| document.root_element().attribute(name).unwrap().strip_suffix("mm").unwrap().parse::<f64>().unwrap();
    for (arguments, dpi) in [(&[][..], 300.0), (&["--dpi", "150"][..], 150.0)] {
        let plot = [&["plot", "jump.npz", "--kind", "traces", "--out", "a.png"], arguments].concat();
        assert!(bench.sfers(&plot).status.success());
        let decoder = png::Decoder::new(fs::File::open(bench.path("a.png")).unwrap());
        let mut reader = decoder.read_info().unwrap();
        let (width, height) = (reader.info().width, reader.info().height);
        // Whole pixels.
        assert!((f64::from(width) - mm("width") / 25.4 * dpi).abs() <= 1.0, "{width}");
        assert!((f64::from(height) - mm("height") / 25.4 * dpi).abs() <= 1.0, "{height}");
        let dots = reader.info().pixel_dims.unwrap();
        assert!(dots.unit == png::Unit::Meter && (f64::from(dots.xppu) * 0.0254 - dpi).abs() < 0.02);
        let mut pixels = vec![0; reader.output_buffer_size()];
        reader.next_frame(&mut pixels).unwrap();
        let dark = |p: &[u8]| p.iter().all(|c| *c < 100);
        let inked = pixels.chunks_exact(3).filter(|p| dark(p)).count() as f64 / f64::from(width * height);
        assert!(inked > 0.005 && inked < 0.3, "{inked}");
        // The title is drawn: dark pixels in the top strip, where nothing but letters stands.
        let strip = (12.0 / 72.0 * dpi) as usize * width as usize * 3;
        assert!(pixels[..strip].chunks_exact(3).filter(|p| dark(p)).count() > 100);
    }
    assert!(bench.sfers(&["plot", "jump.npz", "--kind", "traces", "--out", "a.pdf"]).status.success());
    let pdf = fs::read(bench.path("a.pdf")).unwrap();
    assert!(pdf.starts_with(b"%PDF-1.") && pdf.trim_ascii_end().ends_with(b"%%EOF"));
    let text = String::from_utf8_lossy(&pdf).into_owned();
    let media = text.split_once("/MediaBox").unwrap().1;
    let media = media.split_once('[').unwrap().1.split_once(']').unwrap().0;
    let sides: Vec<f64> = media.split_whitespace().map(|v| v.parse().unwrap()).collect();
    assert!(
        (sides[2] - mm("width") / 25.4 * 72.0).abs() < 0.1 && (sides[3] - mm("height") / 25.4 * 72.0).abs() < 0.1,
        "{sides:?}"
    );
    assert!(text.contains("DejaVuSans") && text.contains("/FontFile"), "the font is not embedded");
    let output = bench.sfers(&["plot", "jump.npz", "--dpi", "0", "--out", "b.png"]);
    assert_eq!(output.status.code(), Some(2));
}
