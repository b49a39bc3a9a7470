//! HyperQueue: `hq submit`, docs/jobs/ of its documentation. It starts a task of a lost worker on another one by itself.
//!
//! One job of it cannot wait for another, so the job after the shards is a command of its own; the last shard to end collects the results if none is missing.

use super::{FINISH, Job, Plan, SHARDS, Scheduler, SubmitError, call, directives, quoted, ranges, shown};

/// Scripts and commands.
pub(super) fn plan(job: &Job) -> Plan {
    // Options at the top of the script are read because its name ends in .sh and it is the command itself.
    let log = job.folder.join("hq-%{JOB_ID}_%{TASK_ID}.log").display().to_string();
    let mut options = vec![
        format!("--name={}", job.name),
        format!("--cpus={}", job.threads),
        "--stdout=none".into(),
        // Of a shard that ended well no log is kept.
        format!("--stderr={log}:rm-if-finished"),
    ];
    options.extend(job.time.iter().map(|time| format!("--time-limit={time}")));
    options.extend(job.scheduler_arguments.iter().cloned());
    let header = directives("#HQ", &options);
    let shards = format!("#!/bin/bash\n{header}# One shard of {}.\n{}", job.shards, job.shard_command("$HQ_TASK_ID"));
    let finish = format!(
        "#!/bin/bash\n# After the shards: computes what they left and collects the results.\n{}",
        job.finish_command("hq-*_*.log")
    );
    let commands = vec![shown("hq", &arguments(job)), format!("hq job wait JOB1; bash {}", quoted(&job.script(FINISH)))];
    Plan { scripts: vec![(SHARDS, shards), (FINISH, finish)], commands }
}

fn arguments(job: &Job) -> Vec<String> {
    let array = format!("--array={}", ranges(&job.tasks));
    vec!["--output-mode=quiet".into(), "submit".into(), array, job.script(SHARDS)]
}

/// Submits the array; returns its number.
pub(super) fn submit(job: &Job) -> Result<Vec<String>, SubmitError> {
    let refused = "nothing is submitted; see `hq server info` for the server, and `sfers help sweep` for the options";
    Ok(vec![call(Scheduler::Hq, "hq", &arguments(job), refused)?.trim().to_owned()])
}

/// The states of the tasks that have not ended.
pub(super) fn states(jobs: &[String]) -> Result<Vec<String>, SubmitError> {
    let answer = call(Scheduler::Hq, "hq", &["--output-mode=json".into(), "job".into(), "list".into(), "--all".into()], "")?;
    let listed: serde_json::Value = serde_json::from_str(&answer).unwrap_or_default();
    let ids: Vec<u64> = jobs.iter().filter_map(|id| id.parse().ok()).collect();
    let mine = listed.as_array().into_iter().flatten().filter(|job| job["id"].as_u64().is_some_and(|id| ids.contains(&id)));
    let mut states = Vec::new();
    for job in mine {
        for (key, state) in [("running", "RUNNING"), ("waiting", "PENDING")] {
            let count = job["task_stats"][key].as_u64().unwrap_or(0);
            states.extend((0..count).map(|_| state.to_owned()));
        }
    }
    Ok(states)
}

/// Cancels jobs.
pub(super) fn cancel(jobs: &[String]) -> Result<(), SubmitError> {
    let arguments = ["job".into(), "cancel".into(), jobs.join(",")];
    call(Scheduler::Hq, "hq", &arguments, "see `hq job list` for what still runs").map(drop)
}
