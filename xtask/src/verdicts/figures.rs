//! The line of figures that ends a run, and the complaints about incomplete ones.

use super::price;
use super::row::Row;

/// Everything that was graded.
pub struct Matrix {
    /// Right renderers.
    pub variants: Vec<Row>,
    /// Renderers with one mistake.
    pub singles: Vec<Row>,
    /// Renderers with two.
    pub pairs: Vec<Row>,
}

/// One figure of the line.
pub struct Figure {
    /// As it is printed: `pairs=24/24`.
    pub text: String,
    /// What is wrong, one line each; empty when the figure is as it must be.
    pub complaints: Vec<String>,
}

impl Figure {
    /// How many of `of` are right: all but one for each complaint.
    pub fn right(name: &str, of: usize, complaints: Vec<String>) -> Self {
        Self { text: format!("{name}={}/{of}", of.saturating_sub(complaints.len())), complaints }
    }
}

/// The figures that follow from the matrix alone, in the order of the line.
pub fn of_matrix(matrix: &Matrix) -> Vec<Figure> {
    let rejected = complaints(&matrix.variants);
    let text = format!("false_rejects={}/{}", rejected.len(), matrix.variants.len());
    vec![
        Figure { text, complaints: rejected },
        singles(&matrix.singles),
        prices(&matrix.singles),
        Figure::right("pairs", matrix.pairs.len(), complaints(&matrix.pairs)),
        diagnosis(matrix),
    ]
}

/// How many single mistakes cost the parts that they belong to, and no other.
pub fn singles(rows: &[Row]) -> Figure {
    Figure::right("singles", rows.len(), complaints(rows))
}

/// How many single mistakes cost what their class says, those aside that nothing tells from another
/// class ([`price::excuse`]): they are printed.
pub fn prices(rows: &[Row]) -> Figure {
    let beside = rows.iter().filter_map(|row| Some((row.subject.name(), price::of_row(row)?)));
    let (excused, complaints): (Vec<_>, Vec<_>) =
        beside.partition(|(name, _)| price::excuse(name).is_some());
    excused.iter().for_each(|(name, said)| println!("price: {name}: {said}"));
    let complaints = complaints.into_iter().map(|(name, said)| format!("{name}: {said}"));
    Figure::right("prices", rows.len(), complaints.collect())
}

/// The least fraction of single mistakes that the diagnosis must say something of: it says nothing
/// rather than something wrong, and of black pictures nothing on purpose.
const NAMED: f64 = 0.85;

/// How many single mistakes are named first. Right renderers must look like nothing.
fn diagnosis(matrix: &Matrix) -> Figure {
    let silent = |rows: &mut dyn Iterator<Item = &Row>| -> Vec<String> {
        rows.filter(|row| !row.well_diagnosed()).map(Row::said).collect()
    };
    let singles = || matrix.singles.iter().filter(|row| row.subject.named);
    let (mut complaints, unnamed) = (silent(&mut matrix.variants.iter()), silent(&mut singles()));
    let of = singles().count();
    let named = of - unnamed.len();
    let text = format!("diagnosis={named}/{of}");
    if (named as f64) < NAMED * of as f64 {
        complaints.extend(unnamed);
    } else {
        unnamed.iter().for_each(|line| println!("not named: {line}"));
    }
    // Two mistakes at once are told apart where they can be: what is said is shown.
    silent(&mut matrix.pairs.iter()).iter().for_each(|line| println!("pair: {line}"));
    Figure { text, complaints }
}

/// Rows that are not as declared, one line each.
fn complaints(rows: &[Row]) -> Vec<String> {
    let wrong = rows.iter().filter(|row| !row.as_declared());
    wrong.map(|row| format!("{}: {}", row.subject.name(), row.complaint())).collect()
}
