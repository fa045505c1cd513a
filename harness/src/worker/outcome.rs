//! The outcome of a request, and whose fault it is.

use std::fmt;

use basecode::gpu::Footprint;
use serde::{Deserialize, Serialize};

use crate::process::ChildOutcome;

/// Whose fault an outcome is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Fault {
    /// The submission's: it costs points.
    Submission,
    /// The environment's, to be believed only when the reference fails likewise in a fresh worker.
    Environment,
    /// A bug of Umbra's, to be said so. A plugin can forge it, so it too needs the reference's word.
    Internal,
}

/// What became of one request.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum Outcome {
    /// Answered, rightly or not.
    Done(Answer),
    /// A part of the assignment is not implemented yet; names the task.
    NotImplemented(String),
    /// The renderer reported an error.
    Failed(String),
    /// A stage that Umbra's own pass was given does not compile: file, line and column, what is wrong
    /// there, and the source line on lines of their own.
    StageRefused(String),
    /// The renderer panicked and said so.
    Panicked(String),
    /// The plugin cannot be used: not loadable, wrong magic, version or size, a write outside
    /// its buffer.
    Rejected(String),
    /// A signal ended the worker; its name, and what is known of the cause.
    CrashedBySignal(String),
    /// The worker exited by itself, with this code, before it answered.
    ExitedEarly(i32),
    /// Out of time.
    TimedOut(Timeout),
    /// It ended at its memory limit.
    OutOfMemory,
    /// It wrote a larger file than allowed. Limits that only refuse (scratch, tasks, open files) end
    /// nobody: the renderer is told, and answers for what it makes of that.
    FileTooLarge,
    /// No graphics adapter fits, by the plugin's word.
    NoAdapter(String),
    /// Never asked.
    NotRun {
        /// Why.
        reason: String,
        /// Whose matter that is.
        fault: Fault,
    },
}

impl fmt::Display for Outcome {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Done(_) => f.write_str("answered"),
            Self::NotImplemented(task) => write!(f, "not implemented yet: {task}"),
            Self::Failed(message) => write!(f, "the renderer reports an error: {message}"),
            Self::StageRefused(message) => f.write_str(message),
            Self::Panicked(message) => write!(f, "the renderer panicked: {message}"),
            Self::Rejected(message) => write!(f, "the plugin was rejected: {message}"),
            Self::CrashedBySignal(signal) => write!(f, "the renderer crashed: {signal}"),
            Self::ExitedEarly(code) => {
                write!(f, "the renderer exited early, with code {code} and no answer")
            }
            Self::TimedOut(late) => write!(f, "{late}"),
            Self::OutOfMemory => f.write_str("the renderer ran out of memory"),
            Self::FileTooLarge => f.write_str("the renderer wrote a larger file than is allowed"),
            Self::NoAdapter(message) => write!(f, "not run here: {message}"),
            Self::NotRun { reason, fault: Fault::Submission } => f.write_str(reason),
            Self::NotRun { reason, .. } => write!(f, "not run here: {reason}"),
        }
    }
}

impl Outcome {
    /// Whose fault this is, unless it is an answer.
    pub fn fault(&self) -> Option<Fault> {
        match self {
            Self::Done(_) => None,
            Self::NoAdapter(_) => Some(Fault::Environment),
            Self::NotRun { fault, .. } => Some(*fault),
            _ => Some(Fault::Submission),
        }
    }

    /// The answer, when there is one.
    pub fn answer(&self) -> Option<&Answer> {
        match self {
            Self::Done(answer) => Some(answer),
            _ => None,
        }
    }
}

/// How a renderer ran out of time.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Timeout {
    /// Whether it computed until it was out of CPU time; otherwise it stood still.
    pub computing: bool,
    /// The limit in seconds, of CPU time or of standing still.
    pub limit_s: f64,
    /// CPU seconds that the reference renderer takes for the same, where it was measured.
    pub reference_s: Option<f64>,
}

impl Timeout {
    /// What it looks like, in two words.
    pub fn what(&self) -> &'static str {
        if self.computing { "endless loop" } else { "stuck" }
    }
}

impl fmt::Display for Timeout {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let limit_s = (10.0 * self.limit_s).round() / 10.0;
        if !self.computing {
            return write!(f, "no answer, and nothing done for {limit_s} s: a deadlock or a sleep");
        }
        write!(f, "no answer within {limit_s} s of CPU time")?;
        match self.reference_s {
            Some(cpu_s) => write!(f, " (the reference renderer takes {cpu_s:.2} s)"),
            None => Ok(()),
        }
    }
}

/// What a renderer answered.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Answer {
    /// The floats, as many as [`super::Request::answer_floats`] says; NaN where nothing was
    /// written. Any value may be there.
    #[serde(with = "as_base64")]
    pub values: Vec<f32>,
    /// What the witness saw, if there was one.
    pub witness: Option<WitnessUse>,
    /// What the last frame took, by the plugin's word.
    #[serde(default)]
    pub footprint: Option<Footprint>,
    /// Seconds it took by the worker's clock: for information, a plugin can forge it.
    pub seconds: f64,
    /// What Umbra's own pass drew with: adapter and driver. Of a plugin's answer it tells nothing.
    #[serde(default)]
    pub adapter: String,
}

/// What a witness BSDF saw of its calls.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct WitnessUse {
    /// How often it was called.
    pub calls: u64,
    /// The largest | |w| - 1 | among all directions; none when one was not finite.
    pub worst_norm_error: Option<f32>,
}

/// What became of a job.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct JobReport {
    /// One for each request.
    pub outcomes: Vec<Outcome>,
    /// Name and version of the renderer by its own word, when it was loaded.
    pub renderer: Option<String>,
    /// The workers that it took.
    pub runs: Vec<WorkerRun>,
}

/// One worker's life.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct WorkerRun {
    /// Indices of the requests that it was given.
    pub requests: Vec<usize>,
    /// Its end, output and timings.
    pub ended: ChildOutcome,
}

/// Floats as base64 of their little-endian bytes: exact, and it keeps what JSON cannot (NaN).
mod as_base64 {
    use base64::Engine;
    use base64::engine::general_purpose::STANDARD;
    use serde::de::Error;
    use serde::{Deserialize, Deserializer, Serializer};

    pub fn serialize<S: Serializer>(values: &[f32], serializer: S) -> Result<S::Ok, S::Error> {
        let bytes: Vec<u8> = values.iter().flat_map(|value| value.to_le_bytes()).collect();
        serializer.serialize_str(&STANDARD.encode(bytes))
    }

    pub fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Vec<f32>, D::Error> {
        let text = String::deserialize(deserializer)?;
        let bytes = STANDARD.decode(text).map_err(D::Error::custom)?;
        if bytes.len() % 4 != 0 {
            let length = bytes.len();
            return Err(D::Error::custom(format!("{length} bytes are no whole floats")));
        }
        let word = |word: &[u8]| [word[0], word[1], word[2], word[3]];
        Ok(bytes.chunks_exact(4).map(|bytes| f32::from_le_bytes(word(bytes))).collect())
    }

    #[cfg(test)]
    mod tests {
        use super::super::*;

        #[test]
        fn answers_survive_json_with_nan_and_infinity() {
            let values = vec![1.5, f32::NAN, f32::NEG_INFINITY, -0.0];
            let answer = Answer { values: values.clone(), seconds: 0.5, ..Answer::default() };
            let text = serde_json::to_string(&answer).unwrap();
            let back: Answer = serde_json::from_str(&text).unwrap();
            let bits = |values: &[f32]| values.iter().map(|v| v.to_bits()).collect::<Vec<_>>();
            assert_eq!(bits(&back.values), bits(&values));
            let broken = text.replace(r#""values":""#, r#""values":"AA"#);
            assert!(serde_json::from_str::<Answer>(&broken).is_err());
        }
    }
}
