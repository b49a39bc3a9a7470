//! Long work on threads of its own, which asks the caller's thread for what only Python can do, and ends when that raises an exception.
//!
//! The caller's thread is released from the interpreter while it waits. It alone calls back into Python, unless the work attaches its threads itself, so a
//! plant that keeps to one thread, as many simulators do, is never called from another. Ctrl-C is heard between two calls and within them; the work then
//! ends at its next report or prediction, by unwinding with [`Stopped`]. Every call has a pool of threads of its own, and no thread outlives it, so that a
//! process may fork before and after.

use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{self, RecvTimeoutError, Sender, SyncSender};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread;
use std::time::Duration;

use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

/// Time between two looks for signals (s/1000).
const LOOK_MS: u64 = 50;
/// Most threads of a call.
const MOST_JOBS: usize = 1024;

/// What unwinds work that shall end: no panic, so no message is printed.
pub struct Stopped;

/// The prediction of a run that a plant in Python is asked for.
pub struct Request {
    /// The run's index.
    pub run: usize,
    /// Candidates by index, and the values of their parameters.
    pub terms: Vec<(usize, Vec<f64>)>,
    /// True for half the time step.
    pub fine: bool,
    /// The run's nuisance parameters.
    pub shares: Vec<f64>,
    /// Clock offset (s), clock rate (-) and gain of the inputs less 1 (-).
    pub base: [f64; 3],
}

/// The values that were predicted, or why the model cannot be simulated.
pub type Predicted = Result<Vec<f64>, String>;

/// What the work asks of the caller's thread.
pub enum Call {
    /// A task has begun.
    Progress(String),
    /// A run is to be predicted.
    Predict(Request, SyncSender<Predicted>),
    /// An exception on another thread ends the work.
    Raise(PyErr),
}

/// The work's end of the line to the caller's thread.
pub struct Line {
    calls: Sender<Call>,
    /// True once the work shall end.
    stop: Arc<AtomicBool>,
    /// The task that was told of last.
    task: Mutex<String>,
}

impl Line {
    fn send(&self, call: Call) {
        if self.calls.send(call).is_err() {
            resume_unwind(Box::new(Stopped));
        }
    }

    /// Tells the caller what is being done, once while it lasts. Every call is a place where the work may end.
    pub fn progress(&self, task: &str) {
        if self.stop.load(Ordering::Relaxed) {
            resume_unwind(Box::new(Stopped));
        }
        let mut told = self.task.lock().unwrap_or_else(PoisonError::into_inner);
        if *told != task {
            task.clone_into(&mut told);
            drop(told);
            self.send(Call::Progress(task.to_owned()));
        }
    }

    /// The prediction of a run, by the caller's thread.
    pub fn predict(&self, request: Request) -> Predicted {
        let (reply, answer) = mpsc::sync_channel(1);
        self.send(Call::Predict(request, reply));
        answer.recv().unwrap_or_else(|_| resume_unwind(Box::new(Stopped)))
    }

    /// Ends the work with an exception.
    pub fn raise(&self, error: PyErr) -> ! {
        let _ = self.calls.send(Call::Raise(error));
        resume_unwind(Box::new(Stopped))
    }
}

/// The number of threads from an argument; one per processor by default.
pub fn jobs(given: Option<i64>) -> PyResult<usize> {
    match given {
        None => Ok(thread::available_parallelism().map_or(1, Into::into)),
        Some(jobs) => usize::try_from(jobs)
            .ok()
            .filter(|jobs| (1..=MOST_JOBS).contains(jobs))
            .ok_or_else(|| PyValueError::new_err(format!("jobs must be 1 to {MOST_JOBS}, not {jobs}"))),
    }
}

/// Does `work` on `jobs` threads of its own and answers its calls by `answer` on the caller's thread meanwhile. The first exception, of `answer` or of a
/// signal, ends the work and is returned; `stopped` is called before its threads are waited for.
pub fn serve<T: Send>(
    py: Python<'_>,
    jobs: usize,
    work: impl FnOnce(&Line) -> T + Send,
    mut answer: impl FnMut(Python<'_>, Call) -> PyResult<()>,
    stopped: impl FnOnce(Python<'_>),
) -> PyResult<T> {
    let (calls, asked) = mpsc::channel();
    let stop = Arc::new(AtomicBool::new(false));
    let line = Line { calls, stop: stop.clone(), task: Mutex::default() };
    thread::scope(|scope| {
        let worker = scope.spawn(move || {
            let line = line;
            catch_unwind(AssertUnwindSafe(|| in_pool(jobs, || work(&line))))
        });
        let mut asked = Some(asked);
        let mut error = None;
        while let Some(calls) = asked.take() {
            let (calls, call) = py.detach(move || {
                let call = calls.recv_timeout(Duration::from_millis(LOOK_MS));
                (calls, call)
            });
            let answered = match call {
                Ok(call) => answer(py, call),
                Err(RecvTimeoutError::Timeout) => Ok(()),
                Err(RecvTimeoutError::Disconnected) => break,
            };
            match answered.and_then(|()| py.check_signals()) {
                Ok(()) => asked = Some(calls),
                // The line is closed: whoever asks from now on unwinds.
                Err(raised) => {
                    error = Some(raised);
                    stop.store(true, Ordering::Relaxed);
                }
            }
        }
        if error.is_some() {
            stopped(py);
        }
        let result = py.detach(|| worker.join()).unwrap_or_else(Err);
        match (error, result) {
            (Some(error), _) => Err(error),
            (None, Ok(result)) => result,
            (None, Err(panic)) => resume_unwind(panic),
        }
    })
}

/// Does `work` in a pool of its own, whose threads have ended when this returns.
fn in_pool<T: Send>(jobs: usize, work: impl FnOnce() -> T + Send) -> PyResult<T> {
    rayon::ThreadPoolBuilder::new()
        .num_threads(jobs)
        .build_scoped(|thread| thread.run(), |pool| pool.install(work))
        .map_err(|error| PyValueError::new_err(format!("jobs={jobs}: {error}")))
}
