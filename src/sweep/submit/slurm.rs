//! Slurm: sbatch(1), squeue(1), scancel(1).

use super::{FINISH, Job, Plan, SHARDS, Scheduler, SubmitError, call, directives, quoted, ranges, shown};

/// Names of the shards' logs; of a shard that ended well none is kept.
const LOGS: &str = "slurm-*_*.log";

/// Largest index of an array where Slurm does not say (its default `MaxArraySize` is 1001, which the index must stay below).
const LARGEST_INDEX: usize = 1000;

/// Scripts and commands, with indices of at most `largest`.
pub(super) fn plan(job: &Job, largest: usize) -> Plan {
    let arrays = arrays(job, largest);
    let mut commands: Vec<String> = arrays.iter().map(|array| shown("sbatch", array)).collect();
    let after: Vec<String> = (1..=arrays.len()).map(|number| format!(":JOB{number}")).collect();
    commands.push(format!("sbatch --dependency=afterany{} {}", after.concat(), quoted(&job.script(FINISH))));
    let shards = format!(
        "#!/bin/bash\n\
         # One shard of {}; the argument is added to the task's number.\n\
         {}{}",
        job.shards,
        header(job, "shards", "%A_%a"),
        job.shard_command("$((SLURM_ARRAY_TASK_ID + ${1:-0}))")
    );
    let finish = format!(
        "#!/bin/bash\n\
         # After the shards: computes what they left and collects the results.\n\
         {}{}",
        header(job, "finish", "%j"),
        job.finish_command(LOGS)
    );
    Plan { scripts: vec![(SHARDS, shards), (FINISH, finish)], commands }
}

/// The options in a script. 60 seconds before the time limit the program hears SIGTERM and ends; its rows stay.
fn header(job: &Job, part: &str, number: &str) -> String {
    // The folder's own per cents are no patterns.
    let log = format!("{}/slurm-{number}.log", job.folder.display().to_string().replace('%', "%%"));
    let mut options = vec![
        format!("--job-name={}-{part}", job.name),
        "--ntasks=1".into(),
        format!("--cpus-per-task={}", job.threads),
        "--requeue".into(),
        "--signal=B:TERM@60".into(),
        "--open-mode=append".into(),
        format!("--output={log}"),
    ];
    options.extend(job.time.iter().map(|time| format!("--time={time}")));
    options.extend(job.partition.iter().map(|partition| format!("--partition={partition}")));
    options.extend(job.scheduler_arguments.iter().cloned());
    directives("#SBATCH", &options)
}

/// The arguments of sbatch for arrays whose indices are at most `largest`, each with what is added to them.
fn arrays(job: &Job, largest: usize) -> Vec<Vec<String>> {
    let block = |task: &usize| (task - 1) / largest;
    job.tasks
        .chunk_by(|a, b| block(a) == block(b))
        .map(|tasks| {
            let offset = block(&tasks[0]) * largest;
            let indices: Vec<usize> = tasks.iter().map(|task| task - offset).collect();
            vec!["--parsable".into(), format!("--array={}", ranges(&indices)), job.script(SHARDS), offset.to_string()]
        })
        .collect()
}

/// Submits the arrays and the job after them; returns their numbers.
pub(super) fn submit(job: &Job) -> Result<Vec<String>, SubmitError> {
    let mut numbers = Vec::new();
    let refused = "nothing is submitted; see `sinfo` for partitions and their limits, and `sfers help sweep` for the options";
    let mut one = |arguments: &[String]| {
        let answer = call(Scheduler::Slurm, "sbatch", arguments, refused).inspect_err(|_| {
            // Half a submission is none.
            let _ = cancel(&numbers);
        })?;
        // Behind a semicolon: the cluster.
        numbers.push(answer.trim().split(';').next().unwrap_or_default().to_owned());
        Ok::<_, SubmitError>(numbers.join(":"))
    };
    let mut after = String::new();
    for array in arrays(job, largest_index()) {
        after = one(&array)?;
    }
    one(&["--parsable".into(), format!("--dependency=afterany:{after}"), job.script(FINISH)])?;
    Ok(numbers)
}

/// Largest index that this cluster takes.
pub(super) fn largest_index() -> usize {
    let config = call(Scheduler::Slurm, "scontrol", &["show".into(), "config".into()], "").unwrap_or_default();
    let line = config.lines().find_map(|line| line.trim().strip_prefix("MaxArraySize"));
    let size = line.and_then(|rest| rest.trim_start().strip_prefix('=')?.trim().parse::<usize>().ok());
    size.map_or(LARGEST_INDEX, |size| size.saturating_sub(1).max(1))
}

/// The states of the tasks that have not ended.
pub(super) fn states(jobs: &[String]) -> Result<Vec<String>, SubmitError> {
    let arguments = ["--noheader".into(), "--array".into(), "--format=%T".into(), format!("--jobs={}", jobs.join(","))];
    match call(Scheduler::Slurm, "squeue", &arguments, "") {
        Ok(answer) => Ok(answer.lines().map(|line| line.trim().to_owned()).filter(|line| !line.is_empty()).collect()),
        // Slurm forgets jobs some minutes after their end.
        Err(SubmitError::Refused { answer, .. }) if answer.contains("Invalid job id") => Ok(Vec::new()),
        Err(error) => Err(error),
    }
}

/// Cancels jobs.
pub(super) fn cancel(jobs: &[String]) -> Result<(), SubmitError> {
    if jobs.is_empty() {
        return Ok(());
    }
    call(Scheduler::Slurm, "scancel", jobs, "see `squeue --me` for what still runs").map(drop)
}
