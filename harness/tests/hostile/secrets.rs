//! What must not come out: every place of the host that a submission could want to read, and the look
//! for its bytes in everything that a submission can say.

use std::path::Path;

use umbra::build::{BuildOutcome, BuildReport};
use umbra::worker::JobReport;

/// Bytes of a file that a thief takes, from its middle: `LOOT` in actions.c.
const LOOT: usize = 32;

/// A file that a submission must not read.
pub struct Secret {
    /// Bytes from its middle; empty when the suite's own user cannot read it.
    bytes: Vec<u8>,
}

impl Secret {
    pub fn of(path: impl AsRef<Path>) -> Self {
        let content = std::fs::read(path).unwrap_or_default();
        let middle = content.len() / 2;
        let bytes = content.into_iter().skip(middle).take(LOOT).collect();
        Self { bytes }
    }

    /// Text that is found again wherever it is cut.
    pub fn write(path: &Path, token: &str) {
        std::fs::write(path, token.repeat(16)).expect("our own folder");
    }

    /// Whether some channel carries it, as bytes or as hexadecimal text.
    fn is_in(&self, channel: &[u8]) -> bool {
        let hex: String = self.bytes.iter().map(|byte| format!("{byte:02x}")).collect();
        let holds = |wanted: &[u8]| channel.windows(wanted.len().max(1)).any(|w| w == wanted);
        self.bytes.len() > 8 && (holds(&self.bytes) || holds(hex.as_bytes()))
    }
}

/// How many secrets came out of a job.
pub fn leaks(secrets: &[Secret], report: &JobReport) -> usize {
    let mut channels = vec![format!("{report:?}").into_bytes()];
    for outcome in &report.outcomes {
        if let Some(answer) = outcome.answer() {
            channels.push(answer.values.iter().flat_map(|value| value.to_ne_bytes()).collect());
        }
    }
    let out = |secret: &&Secret| channels.iter().any(|channel| secret.is_in(channel));
    secrets.iter().filter(out).count()
}

/// How many secrets came out of a compiler call: in its messages or in the library.
pub fn leaks_of_build(secrets: &[Secret], report: &BuildReport) -> usize {
    let mut channels = vec![format!("{report:?}").into_bytes()];
    if let BuildOutcome::Built { library } = &report.outcome {
        channels.push(std::fs::read(library).expect("the library"));
    }
    let out = |secret: &&Secret| channels.iter().any(|channel| secret.is_in(channel));
    secrets.iter().filter(out).count()
}
