//! What a data set is asked, answered: the result, the page and the files beside it, whatever the data are.

use super::dataset::Dataset;
use super::diagnosis::Diagnosis;
use super::identify::{self, Identification};
use super::plant::Model;
use super::robot::RobotPlant;
use super::{DiagnoseError, extended, names, observations, pipeline, protocols, quality, report};

/// The result of [`answer`].
#[derive(Debug)]
pub enum Answer {
    /// Causes of model error.
    Diagnosed {
        /// The result.
        diagnosis: Box<Diagnosis>,
        /// The extended model's files; none for a data set of single numbers.
        files: Option<extended::Files>,
        /// The report, an HTML page.
        page: String,
    },
    /// Constants, of a data set with `[identify]`.
    Identified {
        /// The result.
        identification: Box<Identification>,
        /// The report, an HTML page.
        page: String,
    },
}

/// Answers what a data set asks. `command` is shown in the report as what made it; `progress` hears of stages. Parallel on the caller's rayon pool.
///
/// # Errors
/// [`DiagnoseError`] if the data allow no answer.
pub fn answer(dataset: &Dataset, command: &str, progress: &(dyn Fn(&str) + Sync)) -> Result<Answer, DiagnoseError> {
    if dataset.is_identification() {
        let identification = Box::new(identify::identify(dataset, progress)?);
        let page = identify::page(&identification, command);
        return Ok(Answer::Identified { identification, page });
    }
    if dataset.runs.is_empty() {
        let found = observations::diagnose(dataset, progress)?;
        let page = observations::page(&found, dataset, command);
        return Ok(Answer::Diagnosed { diagnosis: Box::new(found.diagnosis), files: None, page });
    }
    let checked = quality::check(dataset);
    let plant = RobotPlant::new(dataset, &checked);
    let roles: Vec<_> = dataset.runs.iter().map(|run| run.role).collect();
    let separate = |models: &[Model]| protocols::separate(&plant, models);
    let outcome = pipeline::diagnose(&plant, &dataset.name, &roles, checked.remarks.clone(), progress, &separate)?;
    let files = extended::Files::new(dataset, &plant, &outcome);
    let constants = names::constants(&dataset.robot);
    let context = report::Context { plant: &plant, constants: &constants, command, extended: Some(&files.experiment) };
    let page = report::page(&outcome, &context);
    Ok(Answer::Diagnosed { diagnosis: Box::new(outcome.diagnosis), files: Some(files), page })
}
