//! Shards: the fraction of the trials that one of several machines runs.

use std::str::FromStr;

use thiserror::Error;

/// Shard `index` of `count`, from 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub struct Shard {
    /// Index, from 0.
    pub index: u32,
    /// Number of shards.
    pub count: u32,
}

/// An invalid shard.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error("`{0}` is not a shard i/n with 0 <= i < n, such as 0/4")]
pub struct ShardError(pub String);

impl Shard {
    /// The variable with the number of shards on Kubernetes, set in the manifest.
    pub const COUNT_VARIABLE: &'static str = "SPF_SHARDS";

    /// All trials.
    pub const WHOLE: Self = Self { index: 0, count: 1 };

    /// Whether group `number` of [`Plan::draws`](super::Plan::draws) belongs to this shard.
    #[must_use]
    pub fn has(self, number: usize) -> bool {
        number as u64 % u64::from(self.count.max(1)) == u64::from(self.index)
    }

    /// The shard given by Slurm (`SLURM_ARRAY_TASK_ID`, `…_MIN`, `…_COUNT`) or Kubernetes (`JOB_COMPLETION_INDEX` of an
    /// Indexed Job, with [`COUNT_VARIABLE`](Self::COUNT_VARIABLE) in its manifest); `None` outside of both. Slurm
    /// arrays may start at any index but must have step one.
    ///
    /// # Errors
    /// [`ShardError`] for invalid numbers.
    pub fn of_environment(variable: impl Fn(&str) -> Option<String>) -> Result<Option<Self>, ShardError> {
        let number = |name: &str| {
            let text = variable(name);
            text.map(|text| text.parse::<u32>().map_err(|_| ShardError(format!("{name}={text}")))).transpose()
        };
        let shard = if let Some(id) = number("SLURM_ARRAY_TASK_ID")? {
            let Some(count) = number("SLURM_ARRAY_TASK_COUNT")? else { return Ok(None) };
            Self { index: id.saturating_sub(number("SLURM_ARRAY_TASK_MIN")?.unwrap_or(0)), count }
        } else if let (Some(index), Some(count)) = (number("JOB_COMPLETION_INDEX")?, number(Self::COUNT_VARIABLE)?) {
            Self { index, count }
        } else {
            return Ok(None);
        };
        if shard.index < shard.count { Ok(Some(shard)) } else { Err(ShardError(format!("{}/{}", shard.index, shard.count))) }
    }
}

impl FromStr for Shard {
    type Err = ShardError;

    fn from_str(text: &str) -> Result<Self, ShardError> {
        let parts = text.split_once('/').and_then(|(index, count)| Some((index.parse().ok()?, count.parse().ok()?)));
        let shard = parts.map(|(index, count)| Self { index, count });
        shard.filter(|shard| shard.index < shard.count).ok_or_else(|| ShardError(text.to_owned()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn environment(pairs: &[(&str, &str)]) -> Result<Option<Shard>, ShardError> {
        Shard::of_environment(|name| pairs.iter().find(|(key, _)| *key == name).map(|(_, value)| (*value).to_owned()))
    }

    #[test]
    fn a_shard_is_parsed_or_refused() {
        assert_eq!("2/4".parse(), Ok(Shard { index: 2, count: 4 }));
        for bad in ["4/4", "0/0", "1", "-1/4", "1/x", ""] {
            assert!(bad.parse::<Shard>().is_err(), "{bad}");
        }
    }

    #[test]
    fn schedulers_determine_the_shard() {
        let slurm = [("SLURM_ARRAY_TASK_ID", "3"), ("SLURM_ARRAY_TASK_COUNT", "4"), ("SLURM_ARRAY_TASK_MIN", "1")];
        assert_eq!(environment(&slurm), Ok(Some(Shard { index: 2, count: 4 })));
        assert_eq!(environment(&[("JOB_COMPLETION_INDEX", "0"), ("SPF_SHARDS", "8")]), Ok(Some(Shard { index: 0, count: 8 })));
        assert_eq!(environment(&[("JOB_COMPLETION_INDEX", "0")]), Ok(None));
        assert_eq!(environment(&[]), Ok(None));
        assert!(environment(&[("SLURM_ARRAY_TASK_ID", "9"), ("SLURM_ARRAY_TASK_COUNT", "4")]).is_err());
    }

    #[test]
    fn shares_have_everything_once() {
        let shards: Vec<Shard> = (0..3).map(|index| Shard { index, count: 3 }).collect();
        assert!((0..100).all(|number| shards.iter().filter(|shard| shard.has(number)).count() == 1));
    }
}
