//! What options of several commands may be.

use std::str::FromStr;

/// How much time a submission has in all.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum BudgetChoice {
    /// As config.json says
    Config,
    /// No limit
    None,
}

/// A seed of held-back scenes, or none of them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Perturb(pub Option<u64>);

impl FromStr for Perturb {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        if text == "off" {
            return Ok(Self(None));
        }
        let seed = text.parse().map_err(|_| {
            format!("expected off or a whole number from 0 to {}, found {text}", u64::MAX)
        })?;
        Ok(Self(Some(seed)))
    }
}

/// How much isolation is demanded.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum IsolationChoice {
    /// Every layer
    Full,
    /// Whatever this machine has
    Reduced,
}
