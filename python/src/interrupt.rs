//! Long work that Ctrl-C can end.

use std::panic::resume_unwind;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::Duration;

use pyo3::prelude::*;

/// Time between two looks for signals (s/1000).
const LOOK_MS: u64 = 50;

/// Does `work` on a thread of its own, with the interpreter released, and looks for signals meanwhile. After one the flag that `work` gets is true, and it should end soon; the
/// signal's exception is returned. No thread is left behind.
pub fn interruptible<T: Send>(py: Python<'_>, work: impl FnOnce(&AtomicBool) -> T + Send) -> PyResult<T> {
    let stop = AtomicBool::new(false);
    thread::scope(|scope| {
        let caller = thread::current();
        let stop = &stop;
        let worker = scope.spawn(move || {
            let result = work(stop);
            caller.unpark();
            result
        });
        let mut signal = Ok(());
        while !worker.is_finished() {
            py.detach(|| thread::park_timeout(Duration::from_millis(LOOK_MS)));
            if signal.is_ok() {
                signal = py.check_signals();
                stop.store(signal.is_err(), Ordering::Relaxed);
            }
        }
        let result = py.detach(|| worker.join()).unwrap_or_else(|panic| resume_unwind(panic));
        signal.map(|()| result)
    })
}
