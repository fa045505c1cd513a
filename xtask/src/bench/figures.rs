//! Medians, spreads and their formatting.

/// Measurements of one thing, in any unit.
#[derive(Clone, Debug, Default)]
pub struct Samples(Vec<f64>);

impl Samples {
    /// Adds one.
    pub fn push(&mut self, value: f64) {
        self.0.push(value);
    }

    /// The middle one; 0 of none.
    pub fn median(&self) -> f64 {
        let mut sorted = self.0.clone();
        sorted.sort_by(f64::total_cmp);
        sorted.get(sorted.len() / 2).copied().unwrap_or_default()
    }

    /// The smallest and the largest.
    pub fn spread(&self) -> [f64; 2] {
        let low = self.0.iter().copied().fold(f64::INFINITY, f64::min);
        [low, self.0.iter().copied().fold(f64::NEG_INFINITY, f64::max)]
    }

    /// How many times smaller these are than `others`, round by round.
    pub fn faster_than(&self, others: &Self) -> Self {
        Self(self.0.iter().zip(&others.0).map(|(own, other)| other / own).collect())
    }

    /// Median and spread of a ratio.
    pub fn ratio(&self) -> String {
        let [low, high] = self.spread();
        format!("{} ({} to {})", rounded(self.median()), rounded(low), rounded(high))
    }
}

/// A ratio with as many digits as it deserves.
fn rounded(value: f64) -> String {
    match value {
        10.0.. => format!("{value:.0}"),
        _ => format!("{value:.2}"),
    }
}

/// Seconds in a readable unit.
pub fn seconds(value: f64) -> String {
    match value {
        1.0.. => format!("{value:.2} s"),
        0.1.. => format!("{:.0} ms", 1e3 * value),
        _ => format!("{:.1} ms", 1e3 * value),
    }
}

/// A row of the table: what, anchor's name and figure, ours, and how many times faster we are.
pub struct Line {
    /// The work.
    pub work: String,
    /// Whom we are compared with.
    pub anchor: String,
    /// Its figure.
    pub theirs: String,
    /// Umbra's.
    pub ours: String,
    /// How many times smaller ours is: median and spread.
    pub ratio: String,
}

impl Line {
    /// Times of the same work, in seconds.
    pub fn of_times(work: String, anchor: &str, theirs: &Samples, ours: &Samples) -> Self {
        Self {
            work,
            anchor: anchor.to_owned(),
            theirs: seconds(theirs.median()),
            ours: seconds(ours.median()),
            ratio: ours.faster_than(theirs).ratio(),
        }
    }
}
