//! What mistakes cost: the range of each class, and the table that a teacher looks at.

use std::fmt::Write;

use umbra::diagnosis::{Catalogue, KnownMistake, MistakeClass};

use super::row::Row;

/// The least and the most of its part that a mistake of a class costs.
const RANGES: [(MistakeClass, &str, [f64; 2]); 5] = [
    (MistakeClass::Slip, "slip: one constant, sign, power, index or division", [0.10, 0.25]),
    (
        MistakeClass::Concept,
        "concept: something that the handout asks for is missing",
        [0.40, 0.80],
    ),
    (MistakeClass::Nothing, "nothing: what the part is about is not there", [1.0, 1.0]),
    (MistakeClass::Hidden, "hidden: only probes show it", [1e-6, 0.25]),
    (MistakeClass::Finding, "finding: a remark", [0.0, 0.0]),
];

/// Mistakes that may cost all of their part, whatever their class: nothing that is drawn or traced tells
/// them from having done nothing. And one that may cost less, since it looks like a slip.
const TOLD_APART_BY_NOTHING: [(&str, &str); 14] = [
    ("shadow-no-max-t", "looks like an end somewhere beyond the light"),
    ("shadow-map-empty", "no shadow falls anywhere"),
    ("shadow-map-from-camera", "no shadow falls where one belongs"),
    ("shadow-from-camera", "no shadow falls anywhere"),
    ("shadow-first-shape-only", "no shadow falls anywhere"),
    ("shadow-offset-inward", "everything lies in shadow"),
    ("shadow-hit-reused", "what is lit shades another point"),
    ("phong-fs-camera-at-origin", "most Phong surfaces are black"),
    ("shadow-map-faces-swapped", "no shadow falls where one belongs"),
    ("shadow-map-v-not-flipped", "no shadow falls where one belongs"),
    ("shadow-map-not-halved", "no shadow falls where one belongs"),
    ("shadow-map-no-divide", "no shadow falls where one belongs"),
    ("shadow-map-far-half", "no shadow falls where one belongs"),
    ("shadow-map-first-caster-only", "no shadow falls where one belongs"),
];

/// Why a mistake's price is not that of its class, where nothing can be done about it.
pub fn excuse(name: &str) -> Option<&'static str> {
    TOLD_APART_BY_NOTHING.iter().find(|(own, _)| *own == name).map(|(_, why)| *why)
}

/// Half of the last published digit, as a fraction of the smallest part, 5 points.
const ROUNDING: f64 = 0.005 / 5.0 + 1e-9;

/// What is wrong with a price: the fraction of its part that a mistake of `class` cost.
pub fn complaint(class: MistakeClass, fraction: f64) -> Option<String> {
    let (_, _, [least, most]) = RANGES.iter().find(|(own, ..)| *own == class)?;
    let right = fraction >= least - ROUNDING && fraction <= most + ROUNDING;
    (!right).then(|| {
        let range = format!("{:.0} to {:.0} %", 100.0 * least, 100.0 * most);
        format!("costs {:.0} % of its part, a {class:?} {range}", 100.0 * fraction).to_lowercase()
    })
}

/// What is wrong with what the first part of a row lost, where the scenes show all of it: the range of the
/// mistake's class is another.
pub fn of_row(row: &Row) -> Option<String> {
    let (class, part) = (row.subject.class?, row.subject.parts.first()?);
    let part = row.grade.parts.iter().find(|own| own.id == *part)?;
    // That it loses nothing is another complaint.
    let lost = part.points < part.out_of && row.all_shown;
    let fraction = (part.out_of - part.points) / part.out_of;
    complaint(class, fraction).filter(|_| lost).map(|said| format!("{} {said}", part.id))
}

/// The table mistake, part, points lost, as Markdown.
pub fn table(catalogue: &Catalogue, singles: &[Row]) -> String {
    let mut text = String::from(
        "# What mistakes cost\n\nMade by `xtask verdicts --table docs/points.md`: each known mistake, made by the reference renderer alone,\n\
         on the public scenes. Classes were given before anything was measured (`harness/data/mistakes.json`):\n\n\
         | class | of its part |\n|---|---|\n",
    );
    for (_, words, [least, most]) in RANGES {
        // Writing to a string cannot fail.
        let _ = writeln!(text, "| {words} | {:.0} to {:.0} % |", 100.0 * least, 100.0 * most);
    }
    let mut families: Vec<&str> = Vec::new();
    for mistake in &catalogue.mistakes {
        if !families.contains(&mistake.family.as_str()) {
            families.push(&mistake.family);
        }
    }
    for family in families {
        let own = catalogue.mistakes.iter().filter(|mistake| mistake.family == family);
        let rows: Vec<String> = own.filter_map(|mistake| line(mistake, singles)).collect();
        if !rows.is_empty() {
            let _ = write!(text, "\n## {family}\n{}", rows.concat());
        }
    }
    text
}

/// A mistake's lines of the list; nothing for one that was not graded.
fn line(mistake: &KnownMistake, singles: &[Row]) -> Option<String> {
    let row = singles.iter().find(|row| row.subject.mistakes == [mistake.name.as_str()])?;
    let lost = row.grade.parts.iter().filter(|part| part.points < part.out_of);
    let lost: Vec<String> = lost
        .map(|part| format!("{}: {:.2} of {}", part.id, part.out_of - part.points, part.out_of))
        .collect();
    let mut lost = if lost.is_empty() { "none".to_owned() } else { lost.join(", ") };
    if let (Some(why), true) = (excuse(&mistake.name), of_row(row).is_some()) {
        lost += &format!(" ({why})");
    }
    let class = format!("{:?}", mistake.class).to_lowercase();
    let what = &mistake.looks_like;
    Some(format!("- `{}`, {class}, loses {lost}:\n  {what}\n", mistake.name))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn prices_outside_their_range_are_told() {
        assert_eq!(complaint(MistakeClass::Slip, 0.1), None);
        assert_eq!(complaint(MistakeClass::Slip, 0.2505), None);
        assert!(complaint(MistakeClass::Slip, 0.3).is_some_and(|said| said.contains("30 %")));
        assert!(complaint(MistakeClass::Slip, 0.05).is_some());
        assert!(complaint(MistakeClass::Hidden, 0.0).is_none_or(|said| said.contains("0 %")));
        assert_eq!(complaint(MistakeClass::Nothing, 1.0), None);
        assert!(complaint(MistakeClass::Nothing, 0.99).is_some());
    }

    /// The published table is one of the mistakes that are known.
    #[test]
    fn the_published_table_names_every_mistake() {
        let text = std::fs::read_to_string(crate::root().join("docs/points.md")).unwrap();
        for mistake in Catalogue::known().unwrap().mistakes {
            assert!(text.contains(&format!("- `{}`, ", mistake.name)), "{}", mistake.name);
        }
    }
}
