//! Effects hidden in data of a robot on the floor, which the Bullet engine makes and the planar engine explains.
//!
//! A sample of it runs by default, `SFERS_LONG=1` runs all; `cargo run --release --example confusability -- 1 5 0.1 floor` prints the matrix of
//! docs/confusability.md.

#[path = "hidden/generator.rs"]
mod generator;
#[path = "hidden/ground.rs"]
mod ground;
#[path = "hidden/judge.rs"]
mod judge;

use generator::random::Random;
use ground::{Film, Floor, INSIDE, ROBOT, film, hide, nominal, trace, write};
use judge::{diagnosed, holds, is_right, long, names};
use sfers::diagnose::diagnosis::Verdict;
use sfers::diagnose::pipeline::Outcome;

const NOISE_MM: f64 = 0.1;

/// Diagnoses films with noise.
fn found(films: &[Film], seed: u64) -> Outcome {
    let folder = tempfile::tempdir().unwrap();
    write(folder.path(), films, NOISE_MM, seed);
    diagnosed(folder.path())
}

#[test]
#[ignore = "slow: run by scripts/test.sh"]
fn hidden_effects_are_named() {
    let chosen = if long() { INSIDE.map(|sizes| sizes.id).to_vec() } else { vec!["ground-friction"] };
    let (mut wrong, mut counted) = (Vec::new(), 0);
    for (index, id) in chosen.iter().enumerate() {
        let (floor, parameters) = hide(id, 1 + index % 2, 11 + index as u64);
        let films = film(&floor);
        let trace = trace(&films, nominal());
        if trace < 3.0 * NOISE_MM {
            continue;
        }
        counted += 1;
        let outcome = found(&films, 11);
        let d = &outcome.diagnosis;
        if is_right(d, id) {
            assert!(d.extended.rmse_heldout_mm < 1.2 * NOISE_MM, "{id}: held-out error {} mm", d.extended.rmse_heldout_mm);
        } else {
            wrong.push(format!("{id} {parameters:?}, {trace:.2} mm: {:?} {:?}", d.verdict, names(d)));
        }
        if *id == "ground-friction" {
            assert_eq!(holds(d, id, parameters[0].0, parameters[0].1), Some(true), "{parameters:?}: {:?}", d.effects);
        }
    }
    assert!(20 * wrong.len() <= counted && counted > 0, "{wrong:?}");
}

#[test]
#[ignore = "slow: run by scripts/test.sh"]
fn nothing_is_found_where_only_the_engines_differ() {
    let outcome = found(nominal(), 1);
    let d = &outcome.diagnosis;
    assert_eq!((d.verdict, names(d)), (Verdict::None, vec![]));
    // Bullet's contact and the planar engine's differ by a fifth of the noise or so.
    assert!(d.baseline.rmse_mm < 1.1 * NOISE_MM, "{}", d.baseline.rmse_mm);
}

/// `examples/dropped` is of a floor that returns something.
#[test]
#[ignore = "slow: run by scripts/test.sh"]
fn nothing_is_found_where_dropped_robots_stay_down() {
    let folder = tempfile::tempdir().unwrap();
    let mut random = Random::with_purpose(2, "camera before drops");
    let mut text = format!("[dataset]\nname = \"drops\"\n{ROBOT}\n[markers]\nmiddle = 150.0\n[noise]\ndefault_mm = {NOISE_MM}\n");
    for mm in [4.0, 6.0, 9.0, 13.0, 16.0, 20.0] {
        text += &format!("\n[[run]]\nid = \"{mm} mm\"\nfile = \"{mm}.csv\"\nstart = \"released\"\n");
        text += &format!("release = {{ level = true, height_mm = {mm} }}\n");
        let mut table = String::from("t_s,middle_z_mm\n");
        for row in 0..80 {
            let t = 2.5e-3 * f64::from(row);
            let z = f64::max(mm - 0.5 * 9800.0 * t * t, 0.0) + NOISE_MM * random.normal();
            table += &format!("{t:.4},{z:.4}\n");
        }
        std::fs::write(folder.path().join(format!("{mm}.csv")), table).unwrap();
    }
    std::fs::write(folder.path().join("dataset.toml"), text).unwrap();
    let d = diagnosed(folder.path()).diagnosis;
    assert_eq!((d.verdict, names(&d)), (Verdict::None, vec![]), "{}", d.summary);
    assert!(d.baseline.rmse_mm < 1.1 * NOISE_MM, "{}", d.baseline.rmse_mm);
}

/// What a robot that nothing keeps in its plane does is an effect of its own.
#[test]
#[ignore = "slow: run by scripts/test.sh"]
fn left_to_itself_bullets_robot_turns() {
    let turning = film(&Floor { in_plane: false, ..Floor::default() });
    let trace = trace(&turning, nominal());
    // Seen: 0.021 mm.
    assert!((0.01..0.04).contains(&trace), "{trace} mm");
}
