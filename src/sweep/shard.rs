//! A shard of a sweep, and which one a scheduler has given this process.

use std::fmt;
use std::path::Path;
use std::str::FromStr;

/// Every `count`-th point, beginning with the `number`-th.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Shard {
    number: usize,
    count: usize,
}

/// Value of a variable of the environment.
type Environment<'a> = &'a dyn Fn(&str) -> Option<String>;

/// How a scheduler tells a task its number.
struct Scheduler {
    /// Name for messages.
    name: &'static str,
    /// Number of the task.
    task: &'static str,
    /// First number of a task.
    first: usize,
    /// Variables of the first number, the last and the step from one to the next, where they exist.
    range: Option<[&'static str; 3]>,
    /// Number of the job.
    job: &'static str,
}

/// HyperQueue and Kubernetes first: they run inside jobs of the others.
///
/// Slurm: sbatch(1), "JOB ARRAY SUPPORT"; PBS: `qsub -J` of PBS Professional; SGE: qsub(1), `-t`; LSF: "environment variables"; Kubernetes: indexed jobs.
const SCHEDULERS: [Scheduler; 6] = [
    Scheduler { name: "HyperQueue", task: "HQ_TASK_ID", first: 1, range: None, job: "HQ_JOB_ID" },
    Scheduler { name: "Kubernetes", task: "JOB_COMPLETION_INDEX", first: 0, range: None, job: "HOSTNAME" },
    Scheduler {
        name: "Slurm",
        task: "SLURM_ARRAY_TASK_ID",
        first: 1,
        range: Some(["SLURM_ARRAY_TASK_MIN", "SLURM_ARRAY_TASK_MAX", "SLURM_ARRAY_TASK_STEP"]),
        job: "SLURM_ARRAY_JOB_ID",
    },
    Scheduler { name: "PBS", task: "PBS_ARRAY_INDEX", first: 1, range: None, job: "PBS_JOBID" },
    Scheduler {
        name: "SGE",
        task: "SGE_TASK_ID",
        first: 1,
        range: Some(["SGE_TASK_FIRST", "SGE_TASK_LAST", "SGE_TASK_STEPSIZE"]),
        job: "JOB_ID",
    },
    Scheduler {
        name: "LSF",
        task: "LSB_JOBINDEX",
        first: 1,
        range: Some(["LSB_JOBINDEX_START", "LSB_JOBINDEX_END", "LSB_JOBINDEX_STEP"]),
        job: "LSB_JOBID",
    },
];

impl Scheduler {
    /// The task's number, if it is one of an array: SGE gives `undefined` to others, LSF 0.
    fn task(&self, environment: Environment) -> Option<String> {
        let outside = |value: &String| self.first == 1 && self.range.is_some() && (value == "undefined" || value == "0");
        environment(self.task).filter(|value| !value.is_empty()).filter(|value| self.name == "Slurm" || !outside(value))
    }

    /// Number of tasks of the array; `None` unless it runs from 1 by ones to more than 1, since one that is submitted again may run alone.
    fn count(&self, environment: Environment) -> Option<usize> {
        let [first, last, step] = self.range?;
        let number = |name| environment(name).and_then(|value| value.parse::<usize>().ok());
        let from_one = number(first).is_none_or(|first| first == 1) && number(step).is_none_or(|step| step == 1);
        number(last).filter(|&last| from_one && last > 1)
    }
}

impl Shard {
    /// All points.
    pub const ALL: Self = Self { number: 1, count: 1 };

    /// Shard `number` (from 1) of `count`.
    pub fn new(number: usize, count: usize) -> Option<Self> {
        (1..=count).contains(&number).then_some(Self { number, count })
    }

    /// Number of shards.
    pub fn count(self) -> usize {
        self.count
    }

    /// The shard of a task of a job array, of `count` shards, or as many as the scheduler says.
    ///
    /// # Errors
    /// A sentence that says which variable is missing or wrong, and what to do.
    pub fn from_environment(count: Option<usize>, environment: Environment) -> Result<Self, String> {
        let found = SCHEDULERS.iter().find_map(|scheduler| Some((scheduler, scheduler.task(environment)?)));
        let Some((scheduler, task)) = found else {
            let names: Vec<_> = SCHEDULERS.iter().map(|scheduler| scheduler.task).collect();
            return Err(format!("none of {} is set: this is no task of a job array; give --shard K/N", names.join(", ")));
        };
        let Scheduler { name, task: variable, first, .. } = scheduler;
        let Some(count) = count.or_else(|| scheduler.count(environment)) else {
            return Err(format!(
                "{name} does not say reliably how many tasks the array has; give --shards N beside --shard auto"
            ));
        };
        let last = count + first - 1;
        let number = task.parse().ok().and_then(|task: usize| Self::new((task + 1).checked_sub(*first)?, count));
        number.ok_or_else(|| {
            format!("{variable} is {task:?}; with {count} shards the array must be numbered from {first} to {last}")
        })
    }

    /// Its pieces of work among `0..count`.
    pub fn of(self, count: usize) -> impl Iterator<Item = usize> {
        (self.number - 1..count).step_by(self.count)
    }

    /// The shard among `shards` that a piece of work belongs to, from 1.
    pub fn number_of(index: usize, shards: usize) -> usize {
        index % shards + 1
    }

    /// Name of its file of rows.
    pub fn file_name(self) -> String {
        format!("rows-{}-of-{}.csv", self.number, self.count)
    }

    /// The shard that a file belongs to, by its name.
    pub(super) fn of_file(path: &Path) -> Option<Self> {
        let name = path.file_name()?.to_str()?;
        let (number, count) = name.strip_prefix("rows-")?.strip_suffix(".csv")?.split_once("-of-")?;
        Self::new(number.parse().ok()?, count.parse().ok()?)
    }
}

impl fmt::Display for Shard {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        write!(f, "{}/{}", self.number, self.count)
    }
}

impl FromStr for Shard {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let parse = |text: &str| text.parse::<usize>().ok();
        let shard = text.split_once('/').and_then(|(number, count)| Self::new(parse(number)?, parse(count)?));
        shard.ok_or_else(|| "a shard is written K/N with K from 1 to N, for example 1/4".into())
    }
}

/// The scheduler's name of this process's job, as `Slurm 123_4`.
pub(super) fn scheduler_job(environment: Environment) -> Option<String> {
    let found = SCHEDULERS.iter().find_map(|scheduler| Some((scheduler, scheduler.task(environment)?)));
    let (scheduler, task) = found?;
    Some(format!("{} {}_{task}", scheduler.name, environment(scheduler.job).unwrap_or_default()))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn shard(count: Option<usize>, variables: &[(&str, &str)]) -> Result<String, String> {
        let environment = |name: &str| variables.iter().find(|(key, _)| *key == name).map(|(_, value)| (*value).to_owned());
        Shard::from_environment(count, &environment).map(|shard| shard.to_string())
    }

    #[test]
    fn every_scheduler_gives_its_shard() {
        let slurm = |id| [("SLURM_ARRAY_TASK_ID", id), ("SLURM_ARRAY_TASK_MIN", "1"), ("SLURM_ARRAY_TASK_MAX", "64")];
        assert_eq!(shard(None, &slurm("7")).unwrap(), "7/64");
        assert_eq!(shard(Some(80), &slurm("7")).unwrap(), "7/80");
        for (task, of_64) in [
            (("HQ_TASK_ID", "64"), "64/64"),
            (("JOB_COMPLETION_INDEX", "0"), "1/64"),
            (("PBS_ARRAY_INDEX", "2"), "2/64"),
            (("SGE_TASK_ID", "3"), "3/64"),
            (("LSB_JOBINDEX", "4"), "4/64"),
        ] {
            assert_eq!(shard(Some(64), &[task]).unwrap(), of_64);
            assert!(shard(None, &[task]).unwrap_err().contains("--shards N"), "{task:?}");
        }
        let sge = [("SGE_TASK_ID", "3"), ("SGE_TASK_FIRST", "1"), ("SGE_TASK_LAST", "9"), ("SGE_TASK_STEPSIZE", "1")];
        assert_eq!(shard(None, &sge).unwrap(), "3/9");
        assert_eq!(shard(None, &[("LSB_JOBINDEX", "3"), ("LSB_JOBINDEX_END", "9")]).unwrap(), "3/9");
    }

    #[test]
    fn a_task_that_is_submitted_again_alone_does_not_take_itself_for_all() {
        for id in ["1", "5"] {
            let alone = [
                ("SLURM_ARRAY_TASK_ID", id),
                ("SLURM_ARRAY_TASK_MIN", id),
                ("SLURM_ARRAY_TASK_MAX", id),
                ("SLURM_ARRAY_TASK_COUNT", "1"),
            ];
            assert!(shard(None, &alone).unwrap_err().contains("--shards N"));
            assert_eq!(shard(Some(64), &alone).unwrap(), format!("{id}/64"));
        }
        let some = [("SLURM_ARRAY_TASK_ID", "6"), ("SLURM_ARRAY_TASK_MIN", "5"), ("SLURM_ARRAY_TASK_MAX", "8")];
        assert!(shard(None, &some).unwrap_err().contains("--shards N"));
    }

    #[test]
    fn whatever_is_no_task_of_these_shards_is_refused() {
        assert!(shard(Some(4), &[]).unwrap_err().contains("HQ_TASK_ID"));
        assert!(shard(Some(4), &[("SGE_TASK_ID", "undefined")]).unwrap_err().contains("no task"));
        for id in ["0", "5", "-1", "x", "99999999999999999999"] {
            let error = shard(Some(4), &[("SLURM_ARRAY_TASK_ID", id)]).unwrap_err();
            assert!(error.contains("from 1 to 4"), "{id}: {error}");
        }
        assert!(shard(Some(4), &[("JOB_COMPLETION_INDEX", "4")]).unwrap_err().contains("from 0 to 3"));
    }

    #[test]
    fn hyperqueue_inside_a_slurm_array_counts() {
        let both = [("SLURM_ARRAY_TASK_ID", "2"), ("HQ_TASK_ID", "7"), ("HQ_JOB_ID", "3")];
        assert_eq!(shard(Some(8), &both).unwrap(), "7/8");
        let environment = |name: &str| both.iter().find(|(key, _)| *key == name).map(|(_, value)| (*value).to_owned());
        assert_eq!(scheduler_job(&environment).unwrap(), "HyperQueue 3_7");
        assert_eq!(scheduler_job(&|_| None), None);
    }

    #[test]
    fn names_of_files_are_those_of_shards() {
        let shard: Shard = "3/64".parse().unwrap();
        assert_eq!(Shard::of_file(shard.file_name().as_ref()), Some(shard));
        for name in ["rows-0-of-4.csv", "rows-5-of-4.csv", "rows-gathered.csv", "rows-1-of-x.csv", "results.csv"] {
            assert_eq!(Shard::of_file(name.as_ref()), None, "{name}");
        }
        for text in ["0/4", "5/4", "1", "1/0", "a/b", ""] {
            assert!(text.parse::<Shard>().is_err(), "{text}");
        }
        let second = Shard::new(2, 3).unwrap();
        assert_eq!(second.of(8).collect::<Vec<_>>(), [1, 4, 7]);
        assert!(second.of(8).all(|index| Shard::number_of(index, 3) == 2));
        assert_eq!(Shard::new(5, 5).unwrap().of(3).count(), 0);
    }
}
