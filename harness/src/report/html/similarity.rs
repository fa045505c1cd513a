//! Pairs of submissions whose sources are alike: a list, and a page for each with the two side by side.

use std::collections::BTreeMap;
use std::path::Path;

use super::super::{HTML_FILE, ReportError, put};
use super::begin;
use super::markup::Html;
use crate::class::jplag::SharedPassage;
use crate::columns::count;

/// The folder of these pages, in the instructor's folder.
pub const SIMILARITY: &str = "likeness";

/// Two submissions that are alike.
#[derive(Clone, Debug, Default)]
pub struct SimilarPair {
    /// Their folders in the report.
    pub who: [String; 2],
    /// Their students, where they say so.
    pub names: [String; 2],
    /// Number of files that are equal apart from comments, white space and the template's lines.
    pub same_files: usize,
    /// The share of tokens that match, as JPlag says.
    pub similarity: Option<f64>,
    /// Where they are alike.
    pub matches: Vec<SharedPassage>,
    /// The sources of both, by path.
    pub texts: [BTreeMap<String, String>; 2],
}

/// All pairs of a class.
#[derive(Clone, Debug, Default)]
pub struct SimilarityPage {
    /// The assignment's title.
    pub title: String,
    /// Number of pairs that JPlag compared.
    pub compared: usize,
    /// The share of tokens that match in a pair in the middle of them.
    pub median: Option<f64>,
    /// The pairs to be shown, the clearest first.
    pub pairs: Vec<SimilarPair>,
}

impl SimilarPair {
    fn page(&self) -> String {
        format!("{}--{}.html", self.who[0], self.who[1])
    }

    fn name(&self, at: usize) -> &str {
        let name = &self.names[at];
        if name.is_empty() { &self.who[at] } else { name }
    }
}

/// Writes `report.html` with the list of pairs, and a page for each.
///
/// # Errors
/// When a file cannot be written.
pub fn write_similarity(folder: &Path, page: &SimilarityPage) -> Result<(), ReportError> {
    // Pages of pairs that are alike no more.
    let is_pair = |name: &str| name.contains("--") && name.ends_with(".html");
    for entry in folder.read_dir().into_iter().flatten().flatten() {
        if entry.file_name().to_str().is_some_and(is_pair) {
            let path = entry.path();
            std::fs::remove_file(&path).map_err(|source| ReportError::Write { path, source })?;
        }
    }
    for pair in &page.pairs {
        put(folder, &pair.page(), pair_page(page, pair).as_bytes())?;
    }
    put(folder, HTML_FILE, list(page).as_bytes())
}

fn list(page: &SimilarityPage) -> String {
    let mut html = begin(&format!("Alike - {}", page.title));
    html.raw("<header class=\"top\">\n<nav><a href=\"../../").raw(HTML_FILE);
    html.raw("\">The class</a></nav>\n<p class=\"course\">").text(&page.title);
    html.raw("</p>\n<h1>Sources that are alike</h1>\n</header>\n<main>\n");
    html.raw("<p>It costs nobody anything, and students do not see it. Renderers of one handout are alike in much: ");
    html.raw("look at the two before you think anything of them.</p>\n<p>");
    match page.median {
        Some(median) => {
            html.raw("JPlag compared ").text(&count(page.compared, "pair"));
            html.raw("; in half of them at most ")
                .text(&percent(median))
                .raw(" of the tokens match.");
        }
        None => {
            html.raw(
                "Equal files only: JPlag has not been asked yet (<code>umbra similarity</code>).",
            );
        }
    }
    html.raw("</p>\n");
    if page.pairs.is_empty() {
        html.raw("<p>No pair.</p>\n");
    } else {
        html.raw(
            "<div class=\"scroll\" role=\"region\" aria-label=\"Pairs\" tabindex=\"0\">\n<table>\n",
        );
        html.raw("<thead><tr><th scope=\"col\">Pair</th><th scope=\"col\" class=\"number\">Files that are the same</th>");
        html.raw("<th scope=\"col\" class=\"number\">Tokens that match (JPlag)</th></tr></thead>\n<tbody>\n");
        for pair in &page.pairs {
            html.raw("<tr><th scope=\"row\"><a href=\"").address(&pair.page()).raw("\">");
            html.text(pair.name(0))
                .raw(" and ")
                .text(pair.name(1))
                .raw("</a></th><td class=\"number\">");
            if pair.same_files > 0 {
                html.show(pair.same_files);
            }
            html.raw("</td><td class=\"number\">");
            if let Some(similarity) = pair.similarity {
                html.text(&percent(similarity));
            }
            html.raw("</td></tr>\n");
        }
        html.raw("</tbody>\n</table>\n</div>\n");
    }
    html.raw("</main>\n</body>\n</html>\n");
    html.finish()
}

fn pair_page(page: &SimilarityPage, pair: &SimilarPair) -> String {
    let title = format!("{} and {}", pair.name(0), pair.name(1));
    let mut html = begin(&format!("{title} - {}", page.title));
    html.raw("<header class=\"top\">\n<nav><a href=\"")
        .raw(HTML_FILE)
        .raw("\">All pairs</a></nav>\n");
    html.raw("<h1>").text(&title).raw("</h1>\n<p>");
    let mut words = Vec::new();
    if pair.same_files > 0 {
        let files = count(pair.same_files, "file");
        words.push(format!("{files} the same but for comments, blanks and the template"));
    }
    if let Some(similarity) = pair.similarity {
        words.push(format!("{} of the tokens match (JPlag)", percent(similarity)));
    }
    html.text(&words.join("; "))
        .raw(". A number leads to the same passage on the other side.</p>\n");
    html.raw("</header>\n<main class=\"alike\">\n");
    for at in 0..2 {
        html.raw("<section aria-label=\"").text(pair.name(at)).raw("\" tabindex=\"0\">\n<h2>");
        html.raw("<a href=\"").address(&format!("../{}/{HTML_FILE}", pair.who[at])).raw("\">");
        html.text(pair.name(at)).raw("</a></h2>\n");
        // Files with something alike first.
        let is_alike =
            |path: &&String| pair.matches.iter().any(|own| own.places[at].path == **path);
        let (mut paths, others): (Vec<&String>, Vec<&String>) =
            pair.texts[at].keys().partition(is_alike);
        let alike = paths.len();
        paths.extend(others);
        for (index, path) in paths.into_iter().enumerate() {
            html.raw(if index < alike { "<details open>" } else { "<details>" });
            html.raw("<summary>").text(path).raw("</summary>\n");
            source(&mut html, pair, at, path);
            html.raw("</details>\n");
        }
        html.raw("</section>\n");
    }
    html.raw("</main>\n</body>\n</html>\n");
    html.finish()
}

/// A file with its lines numbered and what the other has too marked.
fn source(html: &mut Html, pair: &SimilarPair, at: usize, path: &str) {
    let (own, other) = if at == 0 { ("a", "b") } else { ("b", "a") };
    let places = pair.matches.iter().map(|passage| &passage.places[at]).enumerate();
    let places: Vec<_> = places.filter(|(_, place)| place.path == path).collect();
    html.raw("<pre>");
    for (index, line) in pair.texts[at][path].lines().enumerate() {
        let number = index + 1;
        let mut inside =
            places.iter().filter(|(_, place)| (place.lines[0]..=place.lines[1]).contains(&number));
        let inside = inside.next();
        for (begins, _) in places.iter().filter(|(_, place)| place.lines[0] == number) {
            html.raw("<a class=\"passage\" id=\"").raw(own).show(begins + 1).raw("\" href=\"#");
            html.raw(other).show(begins + 1).raw("\">").show(begins + 1).raw("</a>");
        }
        html.raw(if inside.is_some() { "<mark>" } else { "<span>" });
        html.raw("<i>").text(&format!("{number:4} ")).raw("</i>").text(line);
        html.raw(if inside.is_some() { "</mark>\n" } else { "</span>\n" });
    }
    html.raw("</pre>\n");
}

fn percent(share: f64) -> String {
    format!("{:.0} %", 100.0 * share)
}
