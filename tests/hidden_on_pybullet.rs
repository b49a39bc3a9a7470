//! Effects hidden in data of a robot on the floor, which the authors' recipe makes on a live PyBullet, free to turn, and the planar engine explains.
//!
//! Nothing and a weak actuator by default, `SFERS_LONG=1` runs all five. Needs a Python with pybullet and numpy (`common/tools.rs`).

#[path = "hidden/generator.rs"]
mod generator;
#[path = "hidden/ground.rs"]
mod ground;
#[path = "hidden/judge.rs"]
mod judge;
#[path = "hidden/pybullet.rs"]
mod pybullet;
#[allow(dead_code)] // Chromium
#[path = "common/tools.rs"]
mod tools;

use ground::{Floor, hide, trace, write};
use judge::{diagnosed, is_right, long, names};
use sfers::diagnose::diagnosis::Verdict;

const NOISE_MM: f64 = 0.1;
const SEED: u64 = 31;

#[test]
#[ignore = "slow: run by scripts/test.sh"]
fn what_is_hidden_in_the_authors_recipe_is_named_and_nothing_else() {
    let test = "what_is_hidden_in_the_authors_recipe_is_named_and_nothing_else";
    let Some(python) = tools::python(test, &["pybullet", "numpy"]) else { return };
    let chosen: &[&str] =
        if long() { &["weak-actuator", "ground-friction", "ground-slope", "hysteresis"] } else { &["weak-actuator"] };
    let found = |films: &[ground::Film]| {
        let folder = tempfile::tempdir().unwrap();
        write(folder.path(), films, NOISE_MM, SEED);
        diagnosed(folder.path()).diagnosis
    };
    let nominal = pybullet::film(&python, &Floor::default());
    let nothing = found(&nominal);
    eprintln!("nothing: {}", nothing.summary);
    assert_eq!((nothing.verdict, names(&nothing)), (Verdict::None, vec![]), "{}", nothing.summary);
    for id in chosen {
        let (floor, parameters) = hide(id, 1, SEED);
        let films = pybullet::film(&python, &floor);
        let trace = trace(&films, &nominal);
        let d = found(&films);
        eprintln!("{id} {parameters:?}, {trace:.2} mm: {}", d.summary);
        assert!(trace > 3.0 * NOISE_MM, "{id}: {trace} mm");
        assert!(is_right(&d, id), "{id} {parameters:?}, {trace:.2} mm: {:?} {:?}", d.verdict, names(&d));
    }
}
