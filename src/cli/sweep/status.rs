//! `sfers sweep --status` and `--cancel`.

use std::path::Path;
use std::process::ExitCode;

use serde_json::json;

use super::warn;
use crate::cli::submit::counts;
use crate::cli::{Failure, Options, print};
use crate::sweep::status::{State, Status};
use crate::sweep::submit::Submission;

/// Says how far a sweep is, from its files and from the scheduler, if there is one.
pub fn status(folder: &Path, options: Options) -> Result<ExitCode, Failure> {
    let submission = Submission::read(folder)?;
    let status = Status::read(folder, submission.as_ref().map(|submission| submission.shards))?;
    status.warnings.iter().for_each(|warning| warn(warning));
    let queue = submission.as_ref().map(Submission::queue);
    if options.json {
        let queue = queue.and_then(Result::ok);
        let object =
            json!({ "schema": 1, "status": status, "missing": status.missing(), "submission": submission, "queue": queue });
        print(&format!("{object}\n"))?;
        return Ok(ExitCode::SUCCESS);
    }
    let mut text = format!(
        "{} of {} points, {} without measures, {} missing\n",
        status.computed,
        status.points,
        status.failed,
        status.missing()
    );
    if let Some(shards) = status.shards {
        text += &format!("{shards} shards: {} not begun", status.not_begun);
        for (state, word) in
            [(State::Running, "running"), (State::Done, "done"), (State::Stopped, "stopped"), (State::Killed, "killed")]
        {
            text += &format!(", {} {word}", status.count(state));
        }
        text += "\n";
    }
    if let (Some(rate), Some(left_s)) = (status.rate_per_s, status.left_s) {
        text += &format!("{rate:.3} points/s, {} left at this rate\n", duration(left_s));
    }
    let mut active = status.count(State::Running) > 0;
    match (&submission, queue) {
        (Some(submission), Some(Ok(states))) => {
            active |= !states.is_empty();
            let states = if states.is_empty() { "all ended".into() } else { counts(&states) };
            text += &format!("jobs {}: {states}\n", submission.jobs.join(", "));
        }
        (_, Some(Err(error))) => text += &format!("the scheduler cannot be asked: {error}\n"),
        _ => {}
    }
    if !active && status.missing() > 0 {
        text += "nothing is at work; the command that began the sweep computes what is missing\n";
    }
    print(&text)?;
    Ok(ExitCode::SUCCESS)
}

/// Cancels the jobs of a folder.
pub fn cancel(folder: &Path, options: Options) -> Result<ExitCode, Failure> {
    let Some(submission) = Submission::read(folder)? else {
        return Err(Failure::Usage(format!("{}: nothing was submitted for this folder", folder.display())));
    };
    submission.cancel()?;
    options.remark(&format!("jobs {} cancelled; finished points stay", submission.jobs.join(", ")));
    Ok(ExitCode::SUCCESS)
}

/// A time in hours, minutes and seconds.
fn duration(seconds: f64) -> String {
    let seconds = seconds.round() as u64;
    match (seconds / 3600, seconds / 60 % 60, seconds % 60) {
        (0, 0, s) => format!("{s} s"),
        (0, min, s) => format!("{min} min {s} s"),
        (h, min, _) => format!("{h} h {min} min"),
    }
}
