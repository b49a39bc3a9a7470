use super::*;

fn job() -> Job {
    Job {
        name: "scan".into(),
        folder: "/data/a scan".into(),
        working_directory: "/home/me".into(),
        program: "/opt/sfers".into(),
        arguments: vec!["sweep".into(), "it's.toml".into(), "--out".into(), "/data/a scan".into()],
        shards: 2500,
        tasks: (1..=2500).collect(),
        threads: 2,
        time: Some("30".into()),
        partition: Some("short".into()),
        scheduler_arguments: vec!["--account=robots".into(), "--comment=a scan".into(), "--exclusive".into()],
    }
}

#[test]
fn a_job_script_is_one_that_a_person_would_write() {
    let plan = slurm::plan(&job(), 1000);
    let (name, text) = &plan.scripts[0];
    assert_eq!(*name, "shards.sh");
    for line in [
        "#SBATCH --job-name=scan-shards",
        "#SBATCH --cpus-per-task=2",
        "#SBATCH --time=30",
        "#SBATCH --requeue",
        "#SBATCH --signal=B:TERM@60",
        "#SBATCH --output=\"/data/a scan/slurm-%A_%a.log\"",
        "#SBATCH --partition=short",
        "#SBATCH --account=robots",
        "#SBATCH --comment=\"a scan\"",
        "#SBATCH --exclusive",
        "cd /home/me",
        "exec \"$sfers\" sweep 'it'\\''s.toml' --out '/data/a scan' --jobs 2 --quiet --shard \"$((SLURM_ARRAY_TASK_ID + ${1:-0}))/2500\"",
    ] {
        assert!(text.lines().any(|there| there == line), "{line} is not in\n{text}");
    }
    assert!(plan.scripts[1].1.lines().last().unwrap() == "exec \"$sfers\" sweep 'it'\\''s.toml' --out '/data/a scan' --jobs 2");
}

#[test]
fn arrays_longer_than_the_scheduler_takes_are_cut_and_their_shards_keep_their_numbers() {
    let plan = slurm::plan(&job(), 1000);
    assert_eq!(
        plan.commands,
        [
            "sbatch --parsable --array=1-1000 '/data/a scan/shards.sh' 0",
            "sbatch --parsable --array=1-1000 '/data/a scan/shards.sh' 1000",
            "sbatch --parsable --array=1-500 '/data/a scan/shards.sh' 2000",
            "sbatch --dependency=afterany:JOB1:JOB2:JOB3 '/data/a scan/finish.sh'",
        ]
    );
    let some = Job { tasks: vec![3, 4, 5, 1000, 1001, 2500], ..job() };
    let commands = slurm::plan(&some, 1000).commands;
    assert!(
        commands[0].contains("--array=3-5,1000 ") && commands[1].contains("--array=1 ") && commands[2].contains("--array=500 ")
    );
}

#[test]
fn hyperqueue_gets_an_array_and_its_options_in_the_script() {
    let plan = Scheduler::Hq.plan(&Job { folder: "/data/scan".into(), ..job() }).unwrap();
    assert_eq!(
        plan.commands,
        ["hq --output-mode=quiet submit --array=1-2500 /data/scan/shards.sh", "hq job wait JOB1; bash /data/scan/finish.sh"]
    );
    let text = &plan.scripts[0].1;
    // Its options stand before everything but comments.
    assert!(text.starts_with("#!/bin/bash\n#HQ --name=scan\n#HQ --cpus=2\n"), "{text}");
    assert!(text.contains("--shard \"$HQ_TASK_ID/2500\""), "{text}");
}

#[test]
fn what_a_script_cannot_hold_is_refused() {
    for (folder, name) in [("/a\"b", "scan"), ("/a\nb", "scan"), ("/a\\b", "scan"), ("/a", "s\nrm -r /")] {
        let job = Job { folder: folder.into(), name: name.into(), ..job() };
        assert!(matches!(Scheduler::Slurm.plan(&job), Err(SubmitError::Unusable { .. })), "{folder} {name}");
    }
    assert_eq!(quoted(""), "''");
    assert_eq!(quoted("$(rm x)"), "'$(rm x)'");
}

#[test]
fn numbers_are_ranges() {
    assert_eq!(ranges(&[1, 2, 3, 7, 9, 10]), "1-3,7,9-10");
    assert_eq!(ranges(&[4]), "4");
    assert_eq!(ranges(&[]), "");
}

/// Every word of a quoted command line comes back from a shell as it was.
#[test]
fn a_shell_reads_back_what_is_shown() {
    let words = ["a b", "it's", "$HOME", "`x`", "\"", "*", "\\", ";", "é", "-x=1"].map(String::from);
    let output = Command::new("bash").args(["-c", &shown("printf '%s\\n'", &words)]).output().unwrap();
    let text = String::from_utf8(output.stdout).unwrap();
    assert_eq!(text.lines().collect::<Vec<_>>(), words);
}
