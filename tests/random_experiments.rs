//! `time_step_s = "auto"` on random experiments on the floor, against a tenth of the error.
//!
//! Six of them by default. `SFERS_RANDOM_EXPERIMENTS=200 cargo test --release --test random_experiments -- --nocapture` makes 200 and prints a line
//! for each, which takes a minute; `scripts/test.sh --hidden` makes 200 too.

mod common;

use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

use common::long::long;
use common::random::Random;
use sfers::experiment::{self, Control, Experiment, Source};

/// Another gives other experiments.
const SEED: u64 = 18;
/// What is promised by default.
const PROMISE: f64 = 1e-3;

/// A robot of 1 to 7 actuators with 1 to 5 joints each, on films of friction 0.1 to 5, driven at 2 to 18 Hz by a gait or by random phases: the
/// experiment's text without its step, and the measure to look at.
fn random(case: usize) -> (String, &'static str) {
    let mut random = Random::new(SEED << 32 | case as u64);
    let actuators = 1 + random.below(7);
    let motors = 1 + random.below(5);
    let film = ["both-ends", "right-end", "none"][random.below(3)];
    let (low, high) = (random.scale(0.1, 5.0), random.scale(0.1, 5.0));
    // As large as fits at both ends of one actuator: a film covers ⌈m f + ½⌉ of its m + 1 segments.
    let most = if actuators == 1 && motors.is_multiple_of(2) { 0.5 - 0.5 / motors as f64 } else { 0.5 };
    let fraction = most * random.uniform();
    let damping = random.scale(0.02, 0.1);
    let frequency = 2.0 + 16.0 * random.uniform();
    let drive = if actuators == 5 && random.below(2) == 0 {
        let gaits = ["inchworm", "inchworm-backward", "full-inchworm", "full-frictional-inchworm", "crawl", "frog-v2"];
        format!("waveform = \"gait\"\ngait = \"{}\"\nfrequency_hz = {frequency:.3}", gaits[random.below(gaits.len())])
    } else {
        let phases: Vec<String> = (1..=2 + random.below(4))
            .map(|_| (0..actuators).map(|_| ["0", "520", "-1500"][random.below(3)]).collect::<Vec<_>>().join(", "))
            .collect();
        let count = phases.len();
        let phase =
            |(i, volts): (usize, String)| format!("{{ until = {:.4}, voltages_v = [{volts}] }}", (i + 1) as f64 / count as f64);
        let phases: Vec<String> = phases.into_iter().enumerate().map(phase).collect();
        format!("waveform = \"sequence\"\nfrequency_hz = {frequency:.3}\nphases = [{}]", phases.join(", "))
    };
    let measure = ["jump_height_mm", "displacement_sum_mm", "stride_mm", "speed_mm_s"][random.below(4)];
    let text = format!(
        "[robot]\nactuators = {actuators}\nmotors_per_actuator = {motors}\ndamping_eta = {damping:.4}\n\
         friction = {{ low = {low:.3}, high = {high:.3}, film = \"{film}\", film_fraction = {fraction:.3} }}\n\
         [drive]\n{drive}\n[simulation]\nengine = \"planar\"\nduration_s = {:.4}\nrecord_every_s = 0.01\n",
        2.0 / frequency
    );
    (text, measure)
}

fn read(text: String) -> Experiment {
    experiment::experiment(&Source::from_text("random", &text)).unwrap_or_else(|error| panic!("{error}\n{text}"))
}

#[derive(Debug)]
enum Outcome {
    /// The error of the measure, relative to itself.
    Promised(f64),
    Refused(String),
    /// Promised, but there is no truth to compare with.
    Unknown,
    /// The run has no measures, with any step.
    Trouble,
}

/// The experiment's measure with a promise of `step_error`, or why there is none.
fn promised(text: &str, measure: &str, step_error: f64) -> Result<(f64, Vec<u64>), Outcome> {
    let automatic = read(format!("{text}time_step_s = \"auto\"\nstep_measure = \"{measure}\"\nstep_error = {step_error}\n"));
    let mut engine = automatic.engine().unwrap();
    match experiment::run(&automatic, engine.as_mut(), |_| Control::Continue) {
        Ok(run) if !run.trouble(&automatic).is_empty() => Err(Outcome::Trouble),
        Ok(run) => {
            let steps = run.step_choice.unwrap().trials.iter().map(|trial| trial.steps).collect();
            Ok((run.measures.get(measure).unwrap(), steps))
        }
        Err(error) => {
            let told = error.to_string();
            assert!(told.contains("not converged"), "{told}\n{text}");
            Err(Outcome::Refused(told))
        }
    }
}

fn try_case(case: usize) -> (Outcome, String) {
    let (text, measure) = random(case);
    let (found, steps) = match promised(&text, measure, PROMISE) {
        Ok(found) => found,
        Err(outcome) => {
            let line = format!("{case}: {outcome:?}");
            return (outcome, line);
        }
    };
    // Of some the digits of a tenth of the error cannot be had.
    let truth = promised(&text, measure, 0.1 * PROMISE).or_else(|_| promised(&text, measure, 0.3 * PROMISE));
    let Ok((truth, _)) = truth else {
        return (Outcome::Unknown, format!("{case}: {measure} {found:.6}, which nothing finer confirms"));
    };
    let error = if found.abs().max(truth.abs()) < 1e-6 { 0.0 } else { (found / truth - 1.0).abs() };
    (Outcome::Promised(error), format!("{case}: {measure} {found:.6}, in truth {truth:.6}: {error:.1e}, steps {steps:?}"))
}

#[test]
fn an_automatic_step_keeps_its_promise_on_robots_nobody_chose() {
    let by_default = if long() { 200 } else { 6 };
    let count: usize = std::env::var("SFERS_RANDOM_EXPERIMENTS").map_or(by_default, |count| count.parse().unwrap());
    let next = AtomicUsize::new(0);
    let outcomes = Mutex::new(Vec::new());
    std::thread::scope(|scope| {
        for _ in 0..2 {
            scope.spawn(|| {
                loop {
                    let case = next.fetch_add(1, Ordering::Relaxed);
                    if case >= count {
                        break;
                    }
                    let (outcome, line) = try_case(case);
                    println!("{line}");
                    outcomes.lock().unwrap().push(outcome);
                }
            });
        }
    });
    let outcomes = outcomes.into_inner().unwrap();
    let of = |which: fn(&Outcome) -> bool| outcomes.iter().filter(|outcome| which(outcome)).count();
    let promised = of(|outcome| matches!(outcome, Outcome::Promised(_)));
    let kept = of(|outcome| matches!(outcome, Outcome::Promised(error) if *error <= 3.0 * PROMISE));
    let refused = of(|outcome| matches!(outcome, Outcome::Refused(_)));
    let chaotic = of(|outcome| matches!(outcome, Outcome::Refused(told) if told.contains("chaotic")));
    let unknown = of(|outcome| matches!(outcome, Outcome::Unknown));
    println!(
        "{count} experiments: {promised} promised, of which {kept} kept; {unknown} promised without a truth; {refused} refused, of which {chaotic} chaotic"
    );
    assert!(kept as f64 >= 0.95 * promised as f64, "{kept} of {promised}");
    // Refusing all would keep every promise.
    assert!(2 * promised > count, "{promised} of {count}");
}
