//! Whom an instructor's word means among the submissions of a report: one rule for all commands and `overrides.toml`.
//!
//! A word is first a folder of the report, then a student of the class list, and only then what a submission says of
//! itself. The number that a student typed never takes the place of what the class list or the platform says.

use std::collections::BTreeMap;

use super::claim::Claim;
use super::layout::{Label, Platform};
use super::matches::Matches;
use super::matching::{Match, find};
use super::names;
use super::roster::{ListedStudent, Roster};

/// Submissions of a report, with the students that they are matched to.
pub struct Owners<'a> {
    claims: &'a [Claim],
    roster: Option<&'a Roster>,
    /// Of each submission: the student of the class list, by index.
    students: Vec<Option<usize>>,
    /// Of each submission: whom it is told apart by.
    people: Vec<String>,
}

impl<'a> Owners<'a> {
    /// Matches submissions to the students of a class list, if there is one.
    ///
    /// # Errors
    /// When the instructor decided for somebody who is not on the list.
    pub fn of(
        claims: &'a [Claim],
        roster: Option<&'a Roster>,
        matches: &Matches,
    ) -> anyhow::Result<Self> {
        let student = |claim: &Claim| match roster.map(|roster| find(claim, roster, matches)) {
            Some(Ok(Match::Student(at, _))) => Ok(Some(at)),
            Some(Err(error)) => Err(error),
            _ => Ok(None),
        };
        let students = claims.iter().map(student).collect::<anyhow::Result<Vec<_>>>()?;
        let own = people(claims).into_iter().zip(&students);
        let own = own.map(|(own, student)| student.map_or(own, |at| format!("on the list {at}")));
        let people = own.collect();
        Ok(Self { claims, roster, students, people })
    }

    /// The submissions that a word means, by index: of one person, or of several.
    pub fn meant(&self, word: &str) -> Vec<usize> {
        let word = word.trim();
        let of = |wanted: &dyn Fn(usize) -> bool| -> Vec<usize> {
            (0..self.claims.len()).filter(|at| wanted(*at)).collect()
        };
        let folder = word.trim_end_matches('/');
        let in_folder = of(&|at| self.claims[at].slug == folder);
        let listed = self.listed(word);
        let on_list = of(&|at| self.students[at].is_some_and(|own| listed.contains(&own)));
        if !in_folder.is_empty() {
            // A folder that is called like a student is that student's, or it is not certain.
            let both = if folder == word { on_list } else { Vec::new() };
            return of(&|at| in_folder.contains(&at) || both.contains(&at));
        }
        if !listed.is_empty() {
            return on_list;
        }
        let number = names::number(word);
        let is_number = |own: &str| !number.is_empty() && names::number(own) == number;
        let is_name = |own: &str| !own.is_empty() && names::words(own) == names::words(word);
        let is = |own: &str| !own.is_empty() && own.eq_ignore_ascii_case(word);
        let label = |at: usize| self.claims[at].label.as_ref();
        // What is matched has a student already, whatever it says.
        let open = |at: usize| self.students[at].is_none();
        let by_platform = |own: &Label| {
            is_number(&own.number) || is(&own.username) || is(&own.email) || is_name(&own.name)
        };
        let says = [
            of(&|at| open(at) && label(at).is_some_and(by_platform)),
            of(&|at| {
                open(at)
                    && label(at).is_none_or(|own| own.number.is_empty())
                    && is_number(&self.claims[at].number)
            }),
            of(&|at| open(at) && is_name(&self.claims[at].full_name)),
        ];
        says.into_iter().find(|found| !found.is_empty()).unwrap_or_default()
    }

    /// The students of the class list whom a word means, by index.
    fn listed(&self, word: &str) -> Vec<usize> {
        let students = self.roster.map_or(&[][..], |roster| &roster.students);
        let of = |wanted: &dyn Fn(&ListedStudent) -> bool| -> Vec<usize> {
            let own = students.iter().enumerate().filter(|(_, student)| wanted(student));
            own.map(|(at, _)| at).collect()
        };
        let called = of(&|student| student.is_called(word));
        if !called.is_empty() || names::words(word).is_empty() {
            return called;
        }
        of(&|student| names::words(&student.full_name()) == names::words(word))
    }

    /// The students of the class list whom a word means, in words.
    pub fn listed_as(&self, word: &str) -> Option<String> {
        let students = &self.roster?.students;
        let all: Vec<String> = self.listed(word).into_iter().map(|at| students[at].who()).collect();
        (!all.is_empty()).then(|| all.join(" or "))
    }

    /// Whether a word means a student of the class list.
    pub fn listed_is(&self, word: &str, student: &ListedStudent) -> bool {
        let students = self.roster.map_or(&[][..], |roster| &roster.students);
        self.listed(word).into_iter().any(|at| students[at] == *student)
    }

    /// Whether some submissions are of one person.
    pub fn is_one(&self, all: &[usize]) -> bool {
        all.windows(2).all(|pair| self.people[pair[0]] == self.people[pair[1]])
    }

    /// The names of the folders of some submissions.
    pub fn folders(&self, all: &[usize]) -> Vec<&str> {
        all.iter().map(|at| self.claims[*at].slug.as_str()).collect()
    }

    /// The student of the class list.
    pub fn student(&self, at: usize) -> Option<&ListedStudent> {
        Some(&self.roster?.students[self.students[at]?])
    }

    /// The other attempts of a submission's person, and itself.
    pub fn attempts(&self, at: usize) -> Vec<usize> {
        (0..self.claims.len()).filter(|own| self.people[*own] == self.people[at]).collect()
    }

    /// By what a decision on a submission is kept that an instructor's word means: its folder where the word is that,
    /// else what names its student with all attempts, by the class list or the platform. What they typed may be
    /// another's, so where nothing else names them it is the folder, too.
    pub fn key(&self, at: usize, word: &str) -> String {
        let slug = &self.claims[at].slug;
        let named: Vec<&str> = match (self.student(at), &self.claims[at].label) {
            _ if word.trim().trim_end_matches('/') == slug => Vec::new(),
            (Some(own), _) => vec![&own.number, &own.username, &own.email],
            (None, Some(own)) if self.roster.is_none() => {
                vec![&own.number, &own.username, &own.email, &own.name]
            }
            _ => Vec::new(),
        };
        let full_name =
            self.student(at).map(ListedStudent::full_name).filter(|_| !named.is_empty());
        let named = named.into_iter().map(str::to_owned).chain(full_name);
        let all = self.attempts(at);
        let mut keys = named.filter(|own| self.meant(own) == all);
        keys.next().unwrap_or_else(|| {
            if self.meant(slug) == [at] { slug.clone() } else { format!("{slug}/") }
        })
    }
}

/// Whom submissions are told apart by where there is no class list, in their order.
pub fn people(claims: &[Claim]) -> Vec<String> {
    let own = |claim: &Claim| match &claim.label {
        Some(label) => label.person(),
        // One number under one name is one student, with several attempts.
        None if !names::number(&claim.number).is_empty() => {
            format!("number {} {}", names::number(&claim.number), names::words(&claim.full_name))
        }
        None => format!("submission {}", claim.slug),
    };
    let mut people: Vec<String> = claims.iter().map(own).collect();
    // Brightspace's numbers may be those of attempts: one name and one student number are one person.
    let mut known: BTreeMap<(String, String), String> = BTreeMap::new();
    for (at, claim) in claims.iter().enumerate() {
        let number = names::number(&claim.number);
        let label = claim.label.as_ref().filter(|label| label.kind == Platform::Brightspace);
        let Some(label) = label.filter(|_| !number.is_empty()) else { continue };
        let person = people[at].clone();
        let first = known.entry((names::words(&label.name), number)).or_insert(person.clone());
        people.iter_mut().filter(|own| **own == person).for_each(|own| own.clone_from(first));
    }
    people
}

/// The number that a submission is known by before anybody is matched: the platform's, else its own.
pub fn number(claim: &Claim) -> &str {
    let label = claim.label.as_ref().map_or("", |label| &label.number);
    if label.is_empty() { &claim.number } else { label }
}

/// The name that a submission is known by: the platform's, else its own. Canvas runs names together.
pub fn name(claim: &Claim) -> &str {
    let label = claim.label.as_ref().filter(|label| label.kind != Platform::Canvas);
    let name = label.map_or("", |label| &label.name);
    if name.is_empty() { &claim.full_name } else { name }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::class::layout::label_of;

    fn claim(slug: &str, number: &str, full_name: &str) -> Claim {
        Claim {
            name: format!("{slug}.zip"),
            slug: slug.into(),
            label: label_of(Platform::Brightspace, slug),
            number: number.into(),
            full_name: full_name.into(),
            digest: String::new(),
        }
    }

    fn roster() -> Roster {
        let text =
            "Student ID,Last Name,First Name\n104,Lee,Ann\n106,Malone,Mallory\n107,Lefèvre,Zoë\n";
        Roster::parse(text.as_bytes(), Path::new("list.csv")).unwrap()
    }

    fn matched(text: &str) -> Matches {
        Matches::parse(text, Path::new("matches.toml")).unwrap()
    }

    #[test]
    fn a_number_is_its_owner_s_and_never_who_typed_it() {
        let claims = [claim("ann", "104", "Ann Lee"), claim("mal", "104", "Mallory Malone")];
        let list = roster();
        // Before the instructor decides: Ann's number is Ann's, and the other has a folder.
        let open = Owners::of(&claims, Some(&list), &Matches::default()).unwrap();
        for (word, expected) in [
            ("104", &[0][..]),
            ("Lee, Ann", &[0]),
            ("ann", &[0]),
            ("mal", &[1]),
            ("mal/", &[1]),
            // On the list, and without a submission.
            ("106", &[]),
            ("Mallory Malone", &[]),
            ("999", &[]),
            ("", &[]),
        ] {
            assert_eq!(open.meant(word), expected, "{word}");
        }
        assert_eq!([open.key(0, "Ann Lee"), open.key(1, "mal/")], ["104", "mal"]);
        assert_eq!(open.listed_as("106").as_deref(), Some("Mallory Malone (106)"));
        // After it.
        let matches = matched("[[match]]\nsubmission = \"mal\"\nstudent = \"106\"\n");
        let decided = Owners::of(&claims, Some(&list), &matches).unwrap();
        assert_eq!([decided.meant("104"), decided.meant("106")], [[0], [1]]);
        assert_eq!([decided.key(0, "104"), decided.key(1, "106")], ["104", "106"]);
        // Nobody knows whose they are, and nothing is guessed.
        let alone = Owners::of(&claims, None, &Matches::default()).unwrap();
        assert_eq!(alone.meant("#104"), [0, 1]);
        assert!(!alone.is_one(&[0, 1]));
        assert_eq!([alone.key(0, "Ann Lee"), alone.key(1, "mal")], ["ann", "mal"]);
        assert_eq!(alone.meant("lee ann"), [0]);
    }

    #[test]
    fn a_folder_that_is_called_like_another_student_is_not_certain() {
        let claims = [claim("ann", "104", "Ann Lee"), claim("104", "106", "Mallory Malone")];
        let list = roster();
        let owners = Owners::of(&claims, Some(&list), &Matches::default()).unwrap();
        assert_eq!(owners.meant("104"), [0, 1]);
        assert!(!owners.is_one(&[0, 1]));
        assert_eq!(owners.meant("104/"), [1]);
        assert_eq!([owners.key(0, "Ann Lee"), owners.key(1, "106")], ["Ann Lee", "106"]);
        assert_eq!([owners.key(0, "ann"), owners.key(1, "104/")], ["ann", "104/"]);
    }

    #[test]
    fn names_are_read_in_either_order() {
        let zoe = "1-9 - Zoë Lefèvre - Oct 6, 2019 1000 PM";
        let claims = [claim(zoe, "", ""), claim("b", "105", "Zoe Lefevre Roux")];
        for list in [None, Some(roster())] {
            let owners = Owners::of(&claims, list.as_ref(), &Matches::default()).unwrap();
            for word in ["Lefèvre, Zoë", "zoe lefevre", "Lefe\u{300}vre, Zoe\u{308}"] {
                assert_eq!(owners.meant(word), [0], "{word}");
            }
        }
    }

    #[test]
    fn attempts_of_a_student_are_one_person_s() {
        let at = |day: u32| format!("1-9 - Ann Lee - Oct {day}, 2019 1000 PM");
        let claims = [claim(&at(6), "104", ""), claim(&at(7), "104", "")];
        let names = "Last Name,First Name\nLee,Ann\n";
        let names = Roster::parse(names.as_bytes(), Path::new("list.csv")).unwrap();
        for (list, key) in [(None, "Ann Lee"), (Some(roster()), "104"), (Some(names), "Ann Lee")] {
            // What is decided on a student is on each attempt, however many there are by then.
            for claims in [&claims[1..], &claims] {
                let owners = Owners::of(claims, list.as_ref(), &Matches::default()).unwrap();
                let last = claims.len() - 1;
                assert_eq!(owners.meant(key).len(), claims.len());
                assert!(owners.is_one(&owners.meant(key)));
                assert_eq!(owners.key(last, "Lee, Ann"), key);
                // Each can be named by itself.
                assert_eq!(owners.key(last, &format!("{}/", at(7))), at(7));
            }
        }
    }
}
