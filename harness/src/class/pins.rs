//! The rules and decisions that settle the grades of a report, pinned in it. Every applied change is one more numbered
//! file, and the last one counts.

use std::fs::File;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

use anyhow::{Context as _, anyhow, bail};
use serde::{Deserialize, Serialize};

use super::late::LatePolicy;
use super::matches::{MATCHES, Matches};
use super::overrides::{OVERRIDES, Overrides};
use super::standing::Attempt;
use crate::files::write_new;
use crate::intake::text_of;
use crate::rubric::Rules;

/// The folder of the files, in the instructor's folder.
pub const FOLDER: &str = "settled";

/// Everything besides the evidence that settles grades.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Decisions {
    /// What the assignment says.
    pub assignment: Stated,
    /// Which attempt counts.
    pub attempt: Attempt,
    /// The text of `matches.toml`; empty where there is none.
    pub matches: String,
    /// The text of `overrides.toml`; empty where there is none.
    pub overrides: String,
}

/// What `config.json` says that settles grades.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Stated {
    /// Short name of the assignment.
    pub name: String,
    /// Its title.
    pub title: String,
    /// Its course.
    pub course: String,
    /// When it was due, RFC 3339 with offset.
    pub due: String,
    /// What a late submission costs, if anything.
    pub late: Option<LatePolicy>,
    /// How evidence becomes points.
    pub rules: Rules,
}

/// One applied change.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Pin {
    /// Its number, from 1.
    pub number: u32,
    /// The one that it follows; `--undo` returns there.
    pub before: Option<u32>,
    /// When it was applied, RFC 3339.
    pub when: String,
    /// Why.
    pub reason: String,
    /// The points that it changed.
    pub changes: Vec<Change>,
    /// What holds from then on.
    pub decided: Decisions,
}

/// Points that an applied change made others.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Change {
    /// The submission's folder in the report.
    pub slug: String,
    /// Who.
    pub who: String,
    /// The part; empty for the whole.
    pub part: String,
    /// Points before, least and most; nothing where the submission did not count.
    pub before: Option<[f64; 2]>,
    /// Points after.
    pub after: Option<[f64; 2]>,
}

impl Stated {
    /// The keys that differ.
    pub fn differs(&self, other: &Self) -> Vec<&'static str> {
        let keys = [
            ("title", self.title != other.title),
            ("course", self.course != other.course),
            ("due", self.due != other.due),
            ("late", self.late != other.late),
            ("rules", self.rules != other.rules),
        ];
        keys.into_iter().filter(|(_, differs)| *differs).map(|(key, _)| key).collect()
    }
}

impl Decisions {
    /// The instructor's decisions in the files of a report, and what the assignment says.
    ///
    /// # Errors
    /// When a file cannot be read, or says what means nothing; names the file and line.
    pub fn read(output: &Path, assignment: Stated, attempt: Attempt) -> anyhow::Result<Self> {
        let text = |name: &str| {
            let file = output.join(name);
            match std::fs::read(&file) {
                Err(error) if error.kind() == ErrorKind::NotFound => Ok(String::new()),
                bytes => {
                    let bytes = bytes.with_context(|| format!("cannot read {}", file.display()))?;
                    // As editors save it.
                    Ok::<_, anyhow::Error>(text_of(&bytes))
                }
            }
        };
        let (matches, overrides) = (text(MATCHES)?, text(OVERRIDES)?);
        let decided = Self { assignment, attempt, matches, overrides };
        decided.matches(output)?;
        decided.overrides(output)?;
        Ok(decided)
    }

    /// Whose submissions are, as decided.
    ///
    /// # Errors
    /// When the text says what means nothing.
    pub fn matches(&self, output: &Path) -> anyhow::Result<Matches> {
        Matches::parse(&self.matches, &output.join(MATCHES))
    }

    /// Points, as decided.
    ///
    /// # Errors
    /// When the text says what means nothing.
    pub fn overrides(&self, output: &Path) -> anyhow::Result<Overrides> {
        Overrides::parse(&self.overrides, &output.join(OVERRIDES))
    }

    /// Makes sure that decisions on points fit the rules.
    ///
    /// # Errors
    /// When one does not; names the file and line.
    pub fn check(&self, output: &Path) -> anyhow::Result<()> {
        self.overrides(output)?.check(&self.assignment.rules, &output.join(OVERRIDES))
    }

    /// What differs, in words; comments in the files do not.
    ///
    /// # Errors
    /// When a text says what means nothing.
    pub fn differs(&self, other: &Self, output: &Path) -> anyhow::Result<Vec<String>> {
        let keys = self.assignment.differs(&other.assignment);
        let mut differs: Vec<String> =
            keys.into_iter().map(|key| format!("{key} of config.json")).collect();
        if self.attempt != other.attempt {
            differs.push("--attempt".to_owned());
        }
        if self.matches(output)?.says() != other.matches(output)?.says() {
            differs.push(MATCHES.to_owned());
        }
        if self.overrides(output)?.says() != other.overrides(output)?.says() {
            differs.push(OVERRIDES.to_owned());
        }
        Ok(differs)
    }
}

/// The applied changes of a report.
#[derive(Debug)]
pub struct Pins {
    folder: PathBuf,
    all: Vec<Pin>,
}

impl Pins {
    /// Reads those in an instructor's folder.
    ///
    /// # Errors
    /// When a file cannot be read, or is not one of this version.
    pub fn read(instructor: &Path) -> anyhow::Result<Self> {
        let folder = instructor.join(FOLDER);
        let mut all: Vec<Pin> = Vec::new();
        loop {
            let path = file(&folder, all.len() as u32 + 1);
            let bytes = match std::fs::read(&path) {
                Err(error) if error.kind() == ErrorKind::NotFound => break,
                bytes => bytes.with_context(|| format!("cannot read {}", path.display()))?,
            };
            all.push(serde_json::from_slice(&bytes).with_context(|| {
                format!(
                    "{}: not of this version of Umbra; grade into another --report",
                    path.display()
                )
            })?);
        }
        Ok(Self { folder, all })
    }

    /// Waits until nobody else changes what a report is settled by; nobody does as long as the answer lives.
    ///
    /// # Errors
    /// When the file of the lock cannot be made.
    pub fn lock(instructor: &Path) -> anyhow::Result<File> {
        let path = instructor.join(FOLDER).join("lock");
        let file =
            File::create(&path).with_context(|| format!("cannot write {}", path.display()))?;
        // A file system that locks nothing is used by one process at a time, as before there were locks.
        match file.lock() {
            Err(error) if error.kind() != ErrorKind::Unsupported => {
                Err(error).with_context(|| format!("cannot lock {}", path.display()))
            }
            _ => Ok(file),
        }
    }

    /// The one that counts.
    pub fn current(&self) -> Option<&Pin> {
        self.all.last()
    }

    /// What `--undo` returns to.
    ///
    /// # Errors
    /// When nothing was changed.
    pub fn before(&self) -> anyhow::Result<&Pin> {
        let before = self.current().and_then(|pin| pin.before);
        let before = before.and_then(|number| self.all.iter().find(|pin| pin.number == number));
        before.context("there is nothing to undo: the report is settled as it was at first")
    }

    /// The change that `--undo` takes back: the first one that followed what it returns to. Later ones that did are
    /// returns to it.
    pub fn undone(&self) -> Option<&Pin> {
        let before = self.current()?.before;
        self.all.iter().find(|pin| before.is_some() && pin.before == before)
    }

    /// Applies a change; an undo follows what its source follows.
    ///
    /// # Errors
    /// When it cannot be written, or another process applied one meanwhile.
    pub fn apply(
        &mut self,
        decided: Decisions,
        reason: &str,
        changes: Vec<Change>,
        undoes: bool,
    ) -> anyhow::Result<()> {
        let current = self.current().map(|pin| pin.number);
        let before = if undoes { self.before()?.before } else { current };
        let path = file(&self.folder, current.unwrap_or_default() + 1);
        self.add(decided, reason, changes, before).map_err(|error| match error.kind() {
            ErrorKind::AlreadyExists => anyhow!(
                "{}: another process changed meanwhile what the report is settled by; run the same command again",
                path.display()
            ),
            _ => anyhow::Error::from(error).context(format!("cannot write {}", path.display())),
        })
    }

    fn add(
        &mut self,
        decided: Decisions,
        reason: &str,
        changes: Vec<Change>,
        before: Option<u32>,
    ) -> std::io::Result<()> {
        let number = self.current().map_or(1, |pin| pin.number + 1);
        let now = jiff::Timestamp::now();
        let when = now.round(jiff::Unit::Second).unwrap_or(now).to_string();
        let pin = Pin { number, before, when, reason: reason.to_owned(), changes, decided };
        write_new(&file(&self.folder, number), &serde_json::to_vec_pretty(&pin)?)?;
        self.all.push(pin);
        Ok(())
    }

    /// What a batch is settled by from its beginning: what is pinned, else `decided`, which is pinned now. Processes
    /// that begin at the same time agree.
    ///
    /// # Errors
    /// When it cannot be read or written, or the report is of another assignment.
    pub fn begin(instructor: &Path, decided: &Decisions) -> anyhow::Result<Self> {
        let mut pins = Self::read(instructor)?;
        if pins.all.is_empty() {
            match pins.add(decided.clone(), "graded first", Vec::new(), None) {
                Err(error) if error.kind() == ErrorKind::AlreadyExists => {
                    pins = Self::read(instructor)?;
                }
                added => {
                    added.with_context(|| format!("cannot write to {}", pins.folder.display()))?;
                }
            }
        }
        let name = pins.current().map(|pin| &pin.decided.assignment.name);
        if let Some(name) = name.filter(|name| **name != decided.assignment.name) {
            bail!(
                "{} is a report of assignment \"{name}\", not \"{}\"; grade into another --report",
                instructor.parent().unwrap_or(instructor).display(),
                decided.assignment.name
            );
        }
        Ok(pins)
    }
}

fn file(folder: &Path, number: u32) -> PathBuf {
    folder.join(format!("{number:04}.json"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::sample;

    fn decided(overrides: &str) -> Decisions {
        let report = sample::report();
        let assignment = Stated {
            name: report.assignment,
            title: report.title,
            course: report.course,
            due: report.due,
            late: None,
            rules: report.rules,
        };
        let (attempt, matches) = (Attempt::Latest, String::new());
        Decisions { assignment, attempt, matches, overrides: overrides.to_owned() }
    }

    #[test]
    fn changes_are_kept_and_undone_one_by_one() {
        let place = tempfile::tempdir().unwrap();
        let mut pins = Pins::begin(place.path(), &decided("")).unwrap();
        pins.before().unwrap_err();
        for text in ["# one", "# two"] {
            pins.apply(decided(text), text, Vec::new(), false).unwrap();
        }
        for (text, undone) in [("# one", "# two"), ("", "# one")] {
            let before = pins.before().unwrap().decided.clone();
            assert_eq!(before.overrides, text);
            assert_eq!(pins.undone().unwrap().reason, undone);
            pins.apply(before, "undone", Vec::new(), true).unwrap();
        }
        assert!(pins.before().unwrap_err().to_string().contains("nothing to undo"));
        assert_eq!(pins.undone(), None);
        // A change after an undo follows it.
        pins.apply(decided("# three"), "why", Vec::new(), false).unwrap();
        assert_eq!(pins.before().unwrap().decided.overrides, "");
        assert_eq!(pins.undone().unwrap().reason, "why");
        let read = Pins::read(place.path()).unwrap();
        assert_eq!((read.all.len(), &read.all), (6, &pins.all));
        // What is pinned wins over what begins later.
        let later = Pins::begin(place.path(), &decided("# four")).unwrap();
        assert_eq!(later.current().unwrap().decided.overrides, "# three");
        let mut other = decided("");
        other.assignment.name = "a3".into();
        let error = Pins::begin(place.path(), &other).unwrap_err().to_string();
        assert!(error.contains("is a report of assignment \"a2\", not \"a3\""), "{error}");
    }

    #[test]
    fn files_are_read_as_editors_save_them() {
        let place = tempfile::tempdir().unwrap();
        let text = "# Zo\u{eb}\n[[match]]\nsubmission = \"a2.zip\"\nstudent = \"none\"\n";
        let wide: Vec<u8> = text.encode_utf16().flat_map(u16::to_le_bytes).collect();
        let western = text.replace('\u{eb}', "?").into_bytes();
        let western: Vec<u8> =
            western.into_iter().map(|byte| if byte == b'?' { 0xeb } else { byte }).collect();
        let bom = [b"\xef\xbb\xbf", text.as_bytes()].concat();
        for bytes in [bom, [&[0xff, 0xfe][..], &wide].concat(), western] {
            std::fs::write(place.path().join(MATCHES), bytes).unwrap();
            let Decisions { assignment, attempt, .. } = decided("");
            assert_eq!(Decisions::read(place.path(), assignment, attempt).unwrap().matches, text);
        }
    }

    #[test]
    fn two_processes_do_not_change_the_same() {
        let place = tempfile::tempdir().unwrap();
        let mut first = Pins::begin(place.path(), &decided("")).unwrap();
        let mut second = Pins::read(place.path()).unwrap();
        first.apply(decided("# one"), "why", Vec::new(), false).unwrap();
        let error = second.apply(decided("# two"), "why", Vec::new(), false).unwrap_err();
        assert!(error.to_string().contains("another process changed meanwhile"), "{error}");
        assert_eq!(Pins::read(place.path()).unwrap().all, first.all);
    }

    #[test]
    fn what_differs_is_named_and_comments_do_not() {
        let place = Path::new("out");
        let old = decided("");
        let mut new = decided("# a comment\n");
        assert_eq!(new.differs(&old, place).unwrap(), [""; 0]);
        new.assignment.rules.images_only_ceiling = 0.25;
        new.overrides = "[[confirm]]\nstudent = \"1\"\nreason = \"seen\"\n".into();
        new.matches = "[[match]]\nsubmission = \"a\"\nstudent = \"1\"\n".into();
        assert_eq!(
            new.differs(&old, place).unwrap(),
            ["rules of config.json", "matches.toml", "overrides.toml"]
        );
    }
}
