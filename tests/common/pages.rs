//! What the tests of HTML pages share. The pages are well-formed XML, so they are parsed, not searched.

use roxmltree::{Document, Node};

/// The markup of a page without its document type, for [`Document::parse`].
pub fn markup(page: &str) -> &str {
    page.strip_prefix("<!DOCTYPE html>\n").expect("a page begins with its document type")
}

/// All text within a node.
pub fn text(node: Node) -> String {
    node.descendants().filter(Node::is_text).filter_map(|n| n.text()).collect()
}

pub fn has_class(node: &Node, class: &str) -> bool {
    node.attribute("class").is_some_and(|all| all.split(' ').any(|one| one == class))
}

/// The texts of all nodes of a name.
pub fn texts(document: &Document, name: &str) -> Vec<String> {
    document.descendants().filter(|n| n.has_tag_name(name)).map(text).collect()
}

/// A hyphen in the place of a minus sign, or a zero below zero.
fn is_wrong_number(text: &str) -> bool {
    let chars: Vec<char> = text.chars().collect();
    (0..chars.len()).any(|i| {
        let starts = i == 0 || !(chars[i - 1].is_alphanumeric() || chars[i - 1] == '.');
        let number: String = chars[i + 1..].iter().take_while(|c| c.is_ascii_digit() || **c == '.').collect();
        if number.is_empty() || !starts {
            return false;
        }
        let is_zero = !number.chars().any(|c| ('1'..='9').contains(&c));
        chars[i] == '-' || (chars[i] == '−' && is_zero)
    })
}

/// Texts with a hyphen before a number or with a negative zero, in cells, paragraphs, captions and figures; code is as it is typed.
pub fn wrong_numbers(document: &Document) -> Vec<String> {
    let is_code = |n: &Node| n.ancestors().any(|a| ["code", "pre", "style"].iter().any(|name| a.has_tag_name(*name)));
    let read = document.descendants().filter(|n| n.is_text() && !is_code(n)).filter_map(|n| n.text());
    read.filter(|text| is_wrong_number(text)).map(str::to_owned).collect()
}

/// What a page must be to be read anywhere: nothing from outside, a width for phones, every wide thing in a box that scrolls.
pub fn check_self_contained(document: &Document) {
    let named = |name: &'static str| document.descendants().filter(move |n| n.is_element() && n.tag_name().name() == name);
    assert_eq!(named("script").chain(named("link")).chain(named("img")).chain(named("iframe")).count(), 0);
    for n in document.descendants() {
        for attribute in n.attributes() {
            let (name, value) = (attribute.name(), attribute.value());
            assert!(!["src", "href"].contains(&name) || value.starts_with('#'), "{name}={value}");
        }
    }
    assert!(named("meta").any(|n| n.attribute("name") == Some("viewport")));
    let style = texts(document, "style").concat();
    assert!(style.contains("@media print") && !style.contains("@import") && !style.contains("http"));
    for table in named("table") {
        let parent = table.parent().unwrap();
        assert!(has_class(&parent, "box"), "a table outside a box that scrolls");
    }
    // Ids are those of the page: a figure that repeats one shows another's clipping box.
    let mut ids: Vec<&str> = document.descendants().filter_map(|n| n.attribute("id")).collect();
    let count = ids.len();
    ids.sort_unstable();
    ids.dedup();
    assert_eq!(ids.len(), count, "an id stands twice");
}

/// A figure's map from numbers on its axes to places on the page, from its ticks: `[offset, scale]` of x and of y.
pub fn axes(svg: Node) -> [[f64; 2]; 2] {
    let ticks: Vec<(f64, f64, f64)> = svg
        .descendants()
        .filter(|n| n.has_tag_name(("http://www.w3.org/2000/svg", "text")))
        .filter_map(|n| {
            let place = |name: &str| n.attribute(name)?.parse::<f64>().ok();
            Some((place("x")?, place("y")?, text(n).replace('−', "-").parse().ok()?))
        })
        .collect();
    // Ticks of x stand at one height, those of y at one distance from the left.
    let line = |points: &[(f64, f64)]| {
        let n = points.len() as f64;
        let (mv, mp) = points.iter().fold((0.0, 0.0), |(a, b), (v, p)| (a + v / n, b + p / n));
        let slope = points.iter().map(|(v, p)| (v - mv) * (p - mp)).sum::<f64>()
            / points.iter().map(|(v, _)| (v - mv).powi(2)).sum::<f64>();
        [mp - slope * mv, slope]
    };
    let largest = |groups: Vec<Vec<(f64, f64)>>| groups.into_iter().max_by_key(Vec::len).unwrap();
    let along_x = largest(ticks.iter().map(|a| ticks.iter().filter(|b| b.1 == a.1).map(|b| (b.2, b.0)).collect()).collect());
    let along_y = largest(ticks.iter().map(|a| ticks.iter().filter(|b| b.0 == a.0).map(|b| (b.2, b.1)).collect()).collect());
    assert!(along_x.len() > 1 && along_y.len() > 1, "{ticks:?}");
    [line(&along_x), line(&along_y)]
}

/// All places where a figure has a mark or the corner of a line.
pub fn marks(svg: Node) -> Vec<(f64, f64)> {
    let numbers = |text: &str| -> Vec<f64> {
        text.split(|c: char| !(c.is_ascii_digit() || c == '.' || c == '-')).filter_map(|word| word.parse().ok()).collect()
    };
    let mut places = Vec::new();
    for n in svg.descendants().filter(Node::is_element) {
        let get = |name: &str| n.attribute(name).and_then(|value| value.parse::<f64>().ok());
        match n.tag_name().name() {
            "circle" => places.extend(get("cx").zip(get("cy"))),
            "rect" => {
                if let (Some(x), Some(y), Some(w), Some(h)) = (get("x"), get("y"), get("width"), get("height")) {
                    places.push((x + w / 2.0, y + h / 2.0));
                }
            }
            "polyline" => places.extend(numbers(n.attribute("points").unwrap_or("")).chunks_exact(2).map(|p| (p[0], p[1]))),
            "path" => places.extend(numbers(n.attribute("d").unwrap_or("")).chunks_exact(2).next().map(|p| (p[0], p[1]))),
            _ => {}
        }
    }
    places
}
