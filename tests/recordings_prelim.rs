//! Prelim.
use std::path::Path;
use sfers::experiment::{self, Control, Source};
use sfers::recording::npz;

#[test]
fn all() {
    let dir = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/recordings");
    let only = std::env::var("ONLY").unwrap_or_default();
    let mut names: Vec<_> = std::fs::read_dir(&dir).unwrap().map(|e| e.unwrap().path()).filter(|p| p.extension().is_some_and(|e| e == "toml")).collect();
    names.sort();
    for p in names {
        if !p.to_string_lossy().contains(&only) { continue; }
        let e = experiment::experiment(&Source::from_file(&p).unwrap()).unwrap();
        let theirs = npz::read_file(&p.with_extension("npz")).unwrap();
        let t = std::time::Instant::now();
        let ours = experiment::run(&e, &mut e.engine().unwrap(), |_| Control::Continue).unwrap().recording;
        let dt = t.elapsed().as_secs_f64();
        let diff = |a: &[f64], b: &[f64]| { assert_eq!(a.len(), b.len()); let n = a.iter().zip(b).filter(|(a, b)| a.to_bits() != b.to_bits() && a != b).count();
            let m = a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max); format!("{n}/{} max {m:.1e}", a.len()) };
        if let Some(i) = ours.angles.iter().zip(&theirs.angles).position(|(a, b)| a != b) { let r = i / ours.joints(); eprintln!("first diff record {r} joint {} t {} z {:?}", i % ours.joints(), ours.time[r], (0..ours.nodes()).map(|n| (ours.node(r, n)[2]*1e4).round()/1e4).collect::<Vec<_>>()); }
        eprintln!("{}: theta {} rate {} tor {} mv {} t {} pos {} vel {} [{:.0} steps/s]", p.file_stem().unwrap().to_string_lossy(), diff(&ours.angles, &theirs.angles), diff(&ours.rates, &theirs.rates), diff(&ours.torques, &theirs.torques), diff(&ours.motor_voltages, &theirs.motor_voltages), diff(&ours.time, &theirs.time), diff(&ours.positions, &theirs.positions), diff(&ours.velocities, &theirs.velocities), e.steps as f64 / dt);
    }
}
