//! Values of options that several commands share.

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
pub struct HeldBackSeed(pub Option<u64>);

impl FromStr for HeldBackSeed {
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

/// A share of the submissions: every `of`th, from the `index`th on, which is 1 for the first.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Slice {
    /// Which, from 1.
    pub index: usize,
    /// Of how many.
    pub of: usize,
}

impl Slice {
    /// Whether a submission belongs to it, by its place among all.
    pub fn holds(self, at: usize) -> bool {
        at % self.of == self.index - 1
    }
}

impl FromStr for Slice {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let numbers = text.strip_prefix("slice:").and_then(|text| text.split_once('/'));
        let parsed = numbers.and_then(|(index, of)| Some((index.parse().ok()?, of.parse().ok()?)));
        match parsed {
            Some((index, of)) if (1..=of).contains(&index) => Ok(Self { index, of }),
            _ => Err(format!(
                "expected slice:K/N with K from 1 to N, such as slice:2/4, found {text}"
            )),
        }
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
