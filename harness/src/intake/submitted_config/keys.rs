//! What students call the keys of their `config.json`.

use unicode_normalization::UnicodeNormalization as _;

/// A key that means something here.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Key {
    First,
    Last,
    Full,
    Id,
    Email,
    Renders,
}

impl Key {
    /// As the template writes it.
    pub(super) fn written(self) -> &'static str {
        match self {
            Self::First => "firstName",
            Self::Last => "lastName",
            Self::Full => "firstlast",
            Self::Id => "studentID",
            Self::Email => "email",
            Self::Renders => "renders",
        }
    }
}

/// What keys are called, in lower case without signs: the template's names, those of other years (`firstlast`)
/// and what students write.
const KEYS: [(Key, &[&str]); 6] = [
    (
        Key::First,
        &[
            "firstname",
            "first",
            "givenname",
            "given",
            "givennames",
            "forename",
            "fname",
            "fn",
            "preferredname",
            "prenom",
            "prenoms",
            "vorname",
            "nombre",
            "nome",
            "\u{540d}",
        ],
    ),
    (
        Key::Last,
        &[
            "lastname",
            "last",
            "surname",
            "familyname",
            "family",
            "familynames",
            "lname",
            "ln",
            "nom",
            "nomdefamille",
            "nachname",
            "apellido",
            "apellidos",
            "cognome",
            "\u{59d3}",
        ],
    ),
    (
        Key::Full,
        &[
            "firstlast",
            "name",
            "names",
            "fullname",
            "studentname",
            "yourname",
            "firstlastname",
            "student",
            "students",
            "credentials",
            "author",
            "authors",
            "user",
            "group",
            "members",
            "nomcomplet",
            "\u{59d3}\u{540d}",
        ],
    ),
    (
        Key::Id,
        &[
            "studentid",
            "id",
            "studentnumber",
            "studentnum",
            "mcgillid",
            "mcgillidnumber",
            "mcgillnumber",
            "mcgill",
            "studentno",
            "studentnr",
            "number",
            "no",
            "nr",
            "sid",
            "uid",
            "idnumber",
            "idnum",
            "studentidnumber",
            "matricule",
            "matricola",
            "matricula",
            "matrikelnummer",
            "matrikelnr",
            "numero",
            "numerodetudiant",
            "numeroetudiant",
            "\u{5b66}\u{53f7}",
        ],
    ),
    (Key::Email, &["email", "mail", "emailaddress"]),
    (Key::Renders, &["renders", "render", "images"]),
];

/// What a key means, and whether it is a slip of the pen: `studentID`, `student_id` and `Student-Id` are one
/// key, `studnetID` is one that nearly is.
pub(super) fn known_key(key: &str) -> Option<(Key, bool)> {
    /// Shorter names are too near to each other.
    const LONG: usize = 7;
    // Accents fall away with the signs.
    let plain: String =
        key.nfd().filter(|c| c.is_alphanumeric()).flat_map(char::to_lowercase).collect();
    let plain = ["your", "my"].iter().find_map(|own| plain.strip_prefix(own)).unwrap_or(&plain);
    let names = || KEYS.iter().flat_map(|(key, names)| names.iter().map(move |name| (*key, *name)));
    if let Some((key, _)) = names().find(|(_, name)| *name == plain) {
        return Some((key, false));
    }
    // Distances of endless keys are endless work.
    if !(LONG - 1..=24).contains(&plain.len()) {
        return None;
    }
    let long = names().filter(|(_, name)| name.len() >= LONG);
    let near = long.map(|(key, name)| (strsim::osa_distance(plain, name), key));
    let (distance, key) = near.min_by_key(|(distance, _)| *distance)?;
    // `username` is two letters from `surname`.
    (distance <= 1 || distance == 2 && plain.len() > LONG + 1).then_some((key, true))
}
