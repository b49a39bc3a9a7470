//! Figures and animations as a user makes them, from this program's recordings and the reference's, and the page in a browser.

mod common;

use std::fs;
use std::io::{BufRead, BufReader};
use std::net::TcpStream;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

use common::tools;
use serde_json::{Value, json};
use tungstenite::stream::MaybeTlsStream;
use tungstenite::{Message, WebSocket};

const JUMP: &str = "[robot]\nmotors_per_actuator = 1\ndamping_eta = 0.045\n[drive]\nwaveform = \"gait\"\ngait = \"crawl\"\n\
    frequency_hz = 14\n[simulation]\ntime_step_s = 2e-5\nduration_s = 0.2\nrecord_every_steps = 100\n";

struct Bench(tempfile::TempDir);

impl Bench {
    fn new() -> Self {
        let bench = Self(tempfile::tempdir().unwrap());
        fs::write(bench.path("a.toml"), JUMP).unwrap();
        bench.done(&["run", "a.toml", "--out", "a.npz"]);
        let reference = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/recordings/inchworm-m1.npz");
        fs::copy(reference, bench.path("reference.npz")).unwrap();
        bench
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    fn sfers(&self, arguments: &[&str]) -> Output {
        common::sfers(self.0.path(), arguments)
    }

    fn done(&self, arguments: &[&str]) -> String {
        let output = self.sfers(arguments);
        assert!(output.status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&output.stderr));
        String::from_utf8(output.stdout).unwrap()
    }

    fn refuses(&self, arguments: &[&str], code: i32, word: &str) {
        let files = || fs::read_dir(self.0.path()).unwrap().count();
        let before = files();
        let output = self.sfers(arguments);
        let text = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(code), "{arguments:?}: {text}");
        assert!(text.contains(word), "{arguments:?}: {word} is not in {text}");
        assert_eq!(files(), before, "{arguments:?} left a file");
    }
}

#[test]
fn every_kind_of_figure_is_xml_with_units_for_own_and_foreign_recordings() {
    let bench = Bench::new();
    for input in ["a.npz", "reference.npz"] {
        for (kind, labels) in [
            ("shapes", ["x (mm)", "z (mm)"]),
            ("traces", ["time (ms)", "height z (mm)"]),
            ("spectrum", ["frequency (Hz)", "amplitude of z (mm)"]),
        ] {
            let svg = bench.done(&["plot", input, "--kind", kind, "--out", "-"]);
            let document = roxmltree::Document::parse(&svg).unwrap();
            let texts: Vec<&str> = document.descendants().filter_map(|node| node.text()).collect();
            assert!(labels.iter().all(|label| texts.contains(label)), "{input} {kind}: {texts:?}");
            assert!(document.descendants().any(|node| node.has_tag_name("polyline")), "{input} {kind}");
        }
        bench.done(&["plot", input, "--out", "a.svg"]);
        assert!(fs::read_to_string(bench.path("a.svg")).unwrap().starts_with("<svg"));
    }
}

#[test]
fn a_recording_in_csv_is_drawn_and_played_as_the_same_one_in_npz() {
    let bench = Bench::new();
    bench.done(&["run", "a.toml", "--out", "a.csv"]);
    for kind in ["shapes", "traces"] {
        let of = |input: &str| bench.done(&["plot", input, "--kind", kind, "--out", "-"]);
        assert_eq!(of("a.csv"), of("a.npz"), "{kind}");
    }
    for (input, out) in [("a.npz", "n.html"), ("a.csv", "c.html")] {
        bench.done(&["animate", input, "--speed", "0.3", "--out", out]);
    }
    let page = fs::read_to_string(bench.path("c.html")).unwrap();
    assert_eq!(page, fs::read_to_string(bench.path("n.html")).unwrap());
    assert!(page.contains("\"speed\":0.3,"), "the speed is not the one asked for");
    // Without its manifest, a CSV does not say which joints are one actuator's.
    fs::remove_file(bench.path("a.csv.manifest.json")).unwrap();
    let output = bench.sfers(&["animate", "a.csv", "--out", "c.html"]);
    let text = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success() && text.contains("a.csv.manifest.json is missing"), "{text}");
    let table = fs::read_to_string(bench.path("a.csv")).unwrap();
    fs::write(bench.path("a.csv"), table.replacen("node3_x_mm", "node3_x_cm", 1)).unwrap();
    bench.refuses(&["plot", "a.csv", "--out", "b.svg"], 3, "node3_x_mm");
}

#[test]
fn a_sweep_becomes_a_curve() {
    let bench = Bench::new();
    let sweep = "experiment = \"a.toml\"\nmeasures = [\"jump_height_mm\"]\n[vary]\n\"drive.frequency_hz\" = [10, 14, 18]\n";
    fs::write(bench.path("s.toml"), sweep).unwrap();
    bench.done(&["sweep", "s.toml", "--out", "s"]);
    let svg = bench.done(&["plot", "s/results.csv", "--out", "-"]);
    assert!(svg.contains("frequency (Hz)") && svg.contains("jump height (mm)"));
    assert_eq!(svg.matches("<circle").count(), 3);
    bench.refuses(&["plot", "s/results.csv", "--measure", "speed_mm_s", "--out", "-"], 2, "jump_height_mm");
}

#[test]
fn a_gif_has_the_frames_of_its_length() {
    let bench = Bench::new();
    // 0.2 s at a tenth of real time, 25 frames a second.
    bench.done(&["animate", "a.npz", "--speed", "0.1", "--out", "a.gif"]);
    let mut decoder = gif::DecodeOptions::new().read_info(fs::File::open(bench.path("a.gif")).unwrap()).unwrap();
    let mut frames = 0;
    while let Some(frame) = decoder.read_next_frame().unwrap() {
        assert_eq!(frame.delay, 4);
        frames += 1;
    }
    assert_eq!(frames, 50);
    // Of an experiment, which is run first, the film is the same.
    bench.done(&["animate", "a.toml", "--speed", "0.1", "--out", "b.gif"]);
    assert_eq!(fs::read(bench.path("a.gif")).unwrap(), fs::read(bench.path("b.gif")).unwrap());
}

#[test]
fn what_cannot_be_drawn_leaves_no_file() {
    let bench = Bench::new();
    fs::write(bench.path("bad.npz"), b"PK\x03\x04 and no more").unwrap();
    fs::write(bench.path("bad.csv"), "a,b\n1,2\n").unwrap();
    bench.refuses(&["plot", "bad.npz", "--out", "b.svg"], 3, "bad.npz");
    bench.refuses(&["plot", "bad.csv", "--out", "b.svg"], 3, "status");
    bench.refuses(&["plot", "none.npz", "--out", "b.svg"], 3, "none.npz");
    bench.refuses(&["plot", "a.npz", "--out", "b.jpg"], 2, ".png");
    bench.refuses(&["plot", "a.npz", "--out", "none/b.svg"], 2, "none");
    bench.refuses(&["animate", "bad.npz", "--out", "b.gif"], 3, "bad.npz");
    bench.refuses(&["animate", "a.npz", "--out", "b.mp4"], 2, ".html");
    bench.refuses(&["animate", "a.npz", "--speed", "0", "--out", "b.gif"], 2, "positive");
}

/// A headless Chromium, spoken to by its DevTools protocol.
struct Browser {
    process: Child,
    socket: WebSocket<MaybeTlsStream<TcpStream>>,
    session: Option<String>,
    last: u64,
    /// Messages of the page's console and errors that nothing caught.
    complaints: Vec<Value>,
}

impl Browser {
    fn open(mut chromium: Command, page: &Path, profile: &Path) -> Self {
        let mut process = chromium
            .args(["--headless", "--no-sandbox", "--disable-gpu", "--remote-debugging-port=0", "--window-size=1000,480"])
            .arg(format!("--user-data-dir={}", profile.display()))
            .stdout(Stdio::null())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        let lines = BufReader::new(process.stderr.take().unwrap()).lines();
        let address = lines.map_while(Result::ok).find_map(|line| line.strip_prefix("DevTools listening on ").map(String::from));
        let (socket, _) = tungstenite::connect(address.expect("Chromium ended before it listened")).unwrap();
        let mut browser = Self { process, socket, session: None, last: 0, complaints: Vec::new() };
        let target = browser.call("Target.createTarget", json!({"url": "about:blank"}))["targetId"].clone();
        let attached = browser.call("Target.attachToTarget", json!({"targetId": target, "flatten": true}));
        browser.session = attached["sessionId"].as_str().map(String::from);
        for domain in ["Runtime.enable", "Log.enable", "Page.enable"] {
            browser.call(domain, json!({}));
        }
        browser.call("Page.navigate", json!({"url": format!("file://{}", page.display())}));
        browser.until("document.readyState === 'complete' && window.sfers !== undefined");
        browser
    }

    fn call(&mut self, method: &str, parameters: Value) -> Value {
        self.last += 1;
        let mut message = json!({"id": self.last, "method": method, "params": parameters});
        if let Some(session) = &self.session {
            message["sessionId"] = json!(session);
        }
        self.socket.send(Message::text(message.to_string())).unwrap();
        loop {
            let Message::Text(text) = self.socket.read().unwrap() else { continue };
            let answer: Value = serde_json::from_str(&text).unwrap();
            if answer["id"] == self.last {
                assert!(answer["error"].is_null(), "{method}: {answer}");
                return answer["result"].clone();
            }
            if ["Runtime.exceptionThrown", "Runtime.consoleAPICalled", "Log.entryAdded"].iter().any(|m| answer["method"] == *m) {
                self.complaints.push(answer);
            }
        }
    }

    /// The value of a JavaScript expression.
    fn value(&mut self, expression: &str) -> Value {
        let result = self.call("Runtime.evaluate", json!({"expression": expression, "returnByValue": true, "userGesture": true}));
        assert!(result["exceptionDetails"].is_null(), "{expression}: {result}");
        result["result"]["value"].clone()
    }

    fn until(&mut self, condition: &str) {
        let start = Instant::now();
        while self.value(condition) != json!(true) {
            assert!(start.elapsed() < Duration::from_secs(30), "never: {condition}");
            std::thread::sleep(Duration::from_millis(20));
        }
    }
}

impl Drop for Browser {
    fn drop(&mut self) {
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}

#[test]
fn the_page_plays_and_scrubs_in_a_browser_without_an_error() {
    let Some(chromium) = tools::chromium("the_page_plays_and_scrubs_in_a_browser_without_an_error") else { return };
    let bench = Bench::new();
    bench.done(&["animate", "a.npz", "--speed", "0.03", "--out", "a.html"]);
    let page = fs::read_to_string(bench.path("a.html")).unwrap();
    assert!(!page.contains("http://") && !page.contains("https://"), "the page is not self-contained");
    let mut browser = Browser::open(chromium, &bench.path("a.html"), &bench.path("profile"));
    assert_eq!(browser.value("document.getElementById('speed').selectedOptions[0].textContent"), "× 0.03");
    assert_eq!(browser.value("window.sfers.frames"), 101);
    let first = browser.value("window.sfers.nodes");
    assert_eq!(first.as_array().unwrap().len(), 14);
    let scrub = |frame: u32| {
        format!(
            "(() => {{ const s = document.getElementById('scrub'); s.value = {frame}; s.dispatchEvent(new Event('input')); }})()"
        )
    };
    browser.value(&scrub(60));
    assert_eq!(browser.value("window.sfers.frame"), 60);
    assert_ne!(browser.value("window.sfers.nodes"), first, "the scrubber does not move the robot");
    // Record 60 is the state before step 5999, at 120 ms: in the second half of the second period, the middle three are on.
    assert_eq!(browser.value("document.getElementById('time').textContent"), "120.0 ms");
    let volts = browser.value("[...document.querySelectorAll('#volts span')].map((chip) => chip.textContent)");
    assert_eq!(volts, json!(["0 V", "520 V", "−1500 V", "520 V", "0 V"]));
    // The robot is drawn: a few thousand pixels of the canvas are neither white nor transparent.
    let inked = "(() => { const c = document.getElementById('view'); \
        const p = c.getContext('2d').getImageData(0, 0, c.width, c.height).data; \
        let n = 0; for (let i = 0; i < p.length; i += 4) if (p[i + 3] > 0 && p[i] < 250) n++; return n; })()";
    assert!(browser.value(inked).as_u64().unwrap() > 3000);
    let picture = browser.call("Page.captureScreenshot", json!({}))["data"].as_str().unwrap().to_owned();
    let path = Path::new(env!("CARGO_TARGET_TMPDIR")).join("player.png.base64");
    fs::write(path, picture).unwrap();

    browser.value("document.getElementById('play').click()");
    browser.until("window.sfers.frame > 62");
    browser.value("document.getElementById('play').click()");
    let paused = browser.value("window.sfers.frame");
    std::thread::sleep(Duration::from_millis(100));
    assert_eq!((browser.value("window.sfers.playing"), browser.value("window.sfers.frame")), (json!(false), paused));
    assert!(browser.complaints.is_empty(), "{:?}", browser.complaints);
}
