//! Numbered parameters as lists: the points of a curve under one key.
//!
//! A parameter whose name has a number between underscores or at its end belongs to a group, whose key is the name without it: `moment_mn_m` stands for
//! `moment_1_mn_m`, `moment_2_mn_m` and so on, in this order.

use super::{Effect, EffectError};

/// What a file gives for a key of an effect.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Given<'a> {
    /// A number.
    Number(f64),
    /// A list of numbers.
    Numbers(&'a [f64]),
}

/// The key of the group that a parameter belongs to; none of a parameter without a number in its name.
fn group_of(name: &str) -> Option<String> {
    let is_number = |part: &&str| !part.is_empty() && part.bytes().all(|byte| byte.is_ascii_digit());
    let parts: Vec<&str> = name.split('_').collect();
    let at = parts.iter().position(is_number)?;
    let others = parts.iter().enumerate().filter(|(k, _)| *k != at).map(|(_, part)| *part);
    Some(others.collect::<Vec<_>>().join("_"))
}

impl Effect {
    /// The keys that take lists, each with its parameters in their order.
    pub fn groups(&self) -> Vec<(String, Vec<&'static str>)> {
        let mut groups: Vec<(String, Vec<&'static str>)> = Vec::new();
        for p in self.parameters {
            let Some(key) = group_of(p.name) else { continue };
            match groups.iter_mut().find(|(other, _)| *other == key) {
                Some((_, names)) => names.push(p.name),
                None => groups.push((key, vec![p.name])),
            }
        }
        groups
    }

    /// The parameters that a key of a file gives.
    ///
    /// # Errors
    /// [`EffectError`] for a list of a wrong length, a list where a number is needed, and the other way round. Unknown keys are left to [`Effect::with`].
    pub fn expanded<'a>(&'static self, name: &'a str, given: Given) -> Result<Vec<(&'a str, f64)>, EffectError> {
        let groups = self.groups();
        let group = groups.into_iter().find(|(key, _)| key == name).map(|(_, names)| names);
        let id = self.id;
        match (given, group) {
            (Given::Number(value), None) => Ok(vec![(name, value)]),
            (Given::Number(_), Some(names)) => Err(EffectError::List { id, name: name.into(), needed: names.len() }),
            (Given::Numbers(values), Some(names)) if values.len() == names.len() => {
                Ok(names.into_iter().zip(values.iter().copied()).collect())
            }
            (Given::Numbers(values), Some(names)) => {
                let (first, last) = (names.first().copied().unwrap_or_default(), names.last().copied().unwrap_or_default());
                Err(EffectError::Length { id, name: name.into(), given: values.len(), needed: names.len(), first, last })
            }
            // Of an unknown key, that it is unknown says more than that it takes no list.
            (Given::Numbers(_), None) if self.parameters.iter().all(|p| p.name != name) => Ok(vec![(name, 0.0)]),
            (Given::Numbers(_), None) => Err(EffectError::OneNumber { id, name: name.into() }),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::{EFFECTS, find};
    use super::*;

    #[test]
    fn numbers_in_names_make_groups_and_numbers_in_units_do_not() {
        for (name, group) in [
            ("moment_1_mn_m", Some("moment_mn_m")),
            ("share_12", Some("share")),
            ("softening_mm2", None),
            ("curvature_per_kv2", None),
            ("scale", None),
        ] {
            assert_eq!(group_of(name).as_deref(), group);
        }
    }

    #[test]
    fn groups_are_numbered_from_1_without_gaps_and_their_keys_are_no_parameters() {
        for effect in EFFECTS {
            for (key, names) in effect.groups() {
                assert!(names.len() > 1 && effect.parameters.iter().all(|p| p.name != key), "{}: {key}", effect.id);
                for (k, name) in names.iter().enumerate() {
                    assert!(name.split('_').any(|part| part == (k + 1).to_string()), "{}: {name} at {k}", effect.id);
                }
            }
        }
        let keys: Vec<String> = find("free-moment-of-deviation").unwrap().groups().into_iter().map(|(key, _)| key).collect();
        assert_eq!(keys, ["below_mn_m", "above_mn_m"]);
    }
}
