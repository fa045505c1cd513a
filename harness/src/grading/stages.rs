//! The shader stages of a submission: their texts, and whether there are any but the template's.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use basecode::gpu::{MATRICES, NEGATED_NORMALS, NOTHING_UNSET};
use basecode::{Image, Matrices, Vec3, Vec4};

use crate::evidence::stages::{bare, is_template};
use crate::files::files_below;
use crate::intake::Finding;
use crate::worker::{STAGES, StageText};

/// The stage texts of a submission, and of the template.
#[derive(Clone)]
pub struct Stages {
    /// `simple.vs`, `diffuse.fs`, `phong.fs` of the submission; absent where the file is.
    pub own: [Option<String>; 3],
    /// The same of the template.
    pub template: [String; 3],
    /// Whether anything of the source names the file.
    named: [bool; 3],
    /// Whether there is a vertex stage, and a fragment stage, that is not the template's.
    written: Written,
    /// The WGSL of the source, by path below `src/`; lines that are none are blank.
    wgsl: BTreeMap<String, String>,
}

/// Texts that are longer are no stages that somebody wrote, in bytes.
const LONGEST_TEXT: usize = 64 << 10;

/// Which kinds of stages a source holds besides the template's.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Written {
    vertex: bool,
    fragment: bool,
}

/// Those of a renderer whose source nobody looks at: nothing is claimed of it.
impl Default for Stages {
    fn default() -> Self {
        Self {
            own: Default::default(),
            template: Default::default(),
            named: [false; 3],
            written: Written { vertex: true, fragment: true },
            wgsl: BTreeMap::new(),
        }
    }
}

impl Stages {
    /// Reads the stages below a submission's and the template's `src` folder. A file that is no text
    /// counts as absent.
    pub fn read(src: &Path, template: &Path) -> Self {
        let stage =
            |src: &Path, name| std::fs::read_to_string(src.join(format!("shaders/{name}.wgsl")));
        let (found, template_texts) = (texts(src), texts(template));
        let mut stages = Self {
            own: STAGES.map(|name| stage(src, name).ok()),
            template: STAGES.map(|name| stage(template, name).unwrap_or_default()),
            named: STAGES
                .map(|name| found.values().any(|text| text.contains(&format!("{name}.wgsl")))),
            written: written(&found, &template_texts),
            wgsl: BTreeMap::new(),
        };
        for (path, text) in &found {
            if template_texts.get(path).is_none_or(|template| !is_template(text, template)) {
                stages.set_text(&path.to_string_lossy(), text);
            }
        }
        stages
    }

    /// Keeps the WGSL of a file of the source.
    pub fn set_text(&mut self, path: &str, text: &str) {
        if text.len() > LONGEST_TEXT {
            return;
        }
        let is_rust = Path::new(path).extension().is_some_and(|ending| ending == "rs");
        let wgsl = if is_rust { strings_of_stages(text) } else { text.to_owned() };
        if ["@vertex", "@fragment"].iter().any(|word| wgsl.contains(word)) {
            self.wgsl.insert(path.to_owned(), wgsl);
        }
    }

    /// The WGSL of the source: paths below `src/`, and texts.
    pub fn wgsl(&self) -> impl Iterator<Item = (&str, &str)> {
        self.wgsl.iter().map(|(path, text)| (path.as_str(), text.as_str()))
    }

    /// All three, when none is missing or the template's.
    pub fn all_own(&self) -> Option<Vec<StageText>> {
        let own = |index: usize| self.own[index].clone().filter(|_| !self.is_template(index));
        Some(named([own(0)?, own(1)?, own(2)?]))
    }

    /// Whether a stage is the template's still.
    pub fn is_template(&self, index: usize) -> bool {
        self.own[index].as_ref().is_some_and(|own| is_template(own, &self.template[index]))
    }

    /// Whether the source names the stage's file, as `include_str!` does.
    pub fn is_named(&self, index: usize) -> bool {
        self.named[index]
    }

    /// Whether the source holds a stage of this kind that is not the template's, in whatever file.
    pub fn is_elsewhere(&self, index: usize) -> bool {
        if index == 0 { self.written.vertex } else { self.written.fragment }
    }

    /// Stages that begin with a byte-order mark, which the base code leaves out.
    pub fn findings(&self) -> Vec<Finding> {
        let marked = |(name, text): (&&str, &Option<String>)| {
            let marked = text.as_ref().is_some_and(|text| text.starts_with('\u{feff}'));
            marked.then(|| {
                let message =
                    "begins with a byte-order mark (BOM), which is left out: WGSL has none";
                Finding::note("stage_bom", message)
                    .at(format!("src/shaders/{name}.wgsl"))
                    .hint("save it as UTF-8 without BOM")
            })
        };
        STAGES.iter().zip(&self.own).filter_map(marked).collect()
    }

    /// Why no frame can be drawn by the submission's own shaders, if so.
    pub fn nothing_draws(&self) -> Option<&'static str> {
        match self.written {
            Written { vertex: true, fragment: true } => None,
            Written { vertex: false, fragment: false } => {
                Some("the source holds no shader but the template's")
            }
            Written { vertex: false, .. } => {
                Some("the source holds no vertex shader but the template's")
            }
            Written { .. } => Some("the source holds no fragment shader but the template's"),
        }
    }
}

/// All texts below a folder, by their path in it; what is no text is left out.
fn texts(folder: &Path) -> BTreeMap<PathBuf, String> {
    let files = files_below(folder).unwrap_or_default();
    let text = |file: PathBuf| {
        let text = std::fs::read_to_string(&file).ok()?;
        Some((file.strip_prefix(folder).ok()?.to_owned(), text))
    };
    files.into_iter().filter_map(text).collect()
}

/// What stands in those strings of a Rust source that hold an entry point; all else is blank.
fn strings_of_stages(rust: &str) -> String {
    let (mut strings, mut end) = (Vec::new(), 0);
    for (at, _) in rust.match_indices("@vertex").chain(rust.match_indices("@fragment")) {
        let begin = rust[..at].rfind('"').map_or(0, |quote| quote + 1);
        let length = rust[at..].find('"').unwrap_or(rust.len() - at);
        strings.push(begin..at + length);
    }
    strings.sort_by_key(|range| range.start);
    let mut text = String::with_capacity(rust.len());
    let blank = |text: &mut String, from: &str| {
        text.extend(from.chars().map(|c| if c == '\n' { '\n' } else { ' ' }));
    };
    for range in strings {
        if range.start >= end {
            blank(&mut text, &rust[end..range.start]);
            text.push_str(&rust[range.clone()]);
            end = range.end;
        }
    }
    blank(&mut text, &rust[end..]);
    text
}

/// Looks through texts of any kind: WGSL may stand in a Rust string, or be put together by code. A file
/// that equals the template's, apart from comments and white space, does not count.
fn written(texts: &BTreeMap<PathBuf, String>, template: &BTreeMap<PathBuf, String>) -> Written {
    let mut found = Written::default();
    for (path, text) in texts {
        if template.get(path).is_some_and(|template| is_template(text, template)) {
            continue;
        }
        let bare = bare(text);
        let holds = |word: &str| bare.contains(word) || text.contains(word);
        let made_by_code = holds("ShaderSource") || holds("include_wgsl!");
        found.vertex |= made_by_code || holds("@vertex");
        found.fragment |= made_by_code || holds("@fragment");
    }
    found
}

/// What the host replaces to have a pass draw a scene whose normals are negated.
pub fn negated_normals() -> StageText {
    StageText { name: NEGATED_NORMALS.to_owned(), text: NEGATED_NORMALS.to_owned() }
}

/// What the host replaces to have a pass draw with these in turn where it sets nothing, or with ones where there are
/// none, and with the light in its place.
pub fn nothing_unset(light: Vec3, in_turn: &[Vec4]) -> StageText {
    let numbers = light.to_array().into_iter().chain(in_turn.iter().flat_map(|v| v.to_array()));
    let text = numbers.map(|number| number.to_string()).collect::<Vec<_>>().join(" ");
    StageText { name: NOTHING_UNSET.to_owned(), text }
}

/// What the host replaces to have a pass draw under other matrices.
pub fn matrices(which: Matrices) -> StageText {
    StageText { name: MATRICES.to_owned(), text: format!("{which:?}") }
}

/// A picture that is moved as a whole: what it is then, and the picture as it should be.
pub type Moved = (&'static str, fn(&Image) -> Image);

/// The ways that a picture may be moved as a whole.
pub const MOVED: [Moved; 3] = [
    ("the picture is upside down", |image| {
        let rows = image.pixels.chunks(image.width).rev();
        Image { pixels: rows.flatten().copied().collect(), ..*image }
    }),
    ("the picture is mirrored", |image| {
        let rows = image.pixels.chunks(image.width);
        Image { pixels: rows.flat_map(|row| row.iter().rev()).copied().collect(), ..*image }
    }),
    ("the picture is turned by half", |image| Image {
        pixels: image.pixels.iter().rev().copied().collect(),
        ..*image
    }),
];

/// Texts under the names of the stages.
pub fn named(texts: [String; 3]) -> Vec<StageText> {
    let named = STAGES.iter().zip(texts);
    named.map(|(&name, text)| StageText { name: name.to_owned(), text }).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const VERTEX: &str = "@vertex fn vs_main() -> V { /* TODO */ }";
    const FRAGMENT: &str = "@fragment fn fs_main() -> F { return F(); }";
    const MAIN: &str = "fn main() {}";

    /// Of a source with these texts in place of `a.vs`, `a.fs` and `main.rs` of the template.
    fn of(texts: [&str; 3]) -> (bool, bool) {
        let source = |texts: [&str; 3]| {
            let files = ["a.vs", "a.fs", "main.rs"].into_iter().zip(texts);
            files.map(|(file, text)| (file.into(), text.to_owned())).collect()
        };
        let found = written(&source(texts), &source([VERTEX, FRAGMENT, MAIN]));
        (found.vertex, found.fragment)
    }

    #[test]
    fn the_templates_stages_are_nobodys_work() {
        assert_eq!(of([VERTEX, FRAGMENT, MAIN]), (false, false));
        assert_eq!(of(["", "", "fn main() { draw() } // mine"]), (false, false));
        assert_eq!(of(["@vertex\nfn vs_main()->V{} // mine", FRAGMENT, MAIN]), (false, false));
        // One other word makes it a stage of one's own; so does another's place.
        let other = "@fragment fn fs_main() -> F { return F(1); }";
        assert_eq!(of([VERTEX, other, MAIN]), (false, true));
        assert_eq!(of([FRAGMENT, FRAGMENT, MAIN]), (false, true));
    }

    #[test]
    fn stages_count_wherever_they_stand() {
        let main = |text| of(["", "", text]);
        assert_eq!(
            main("const ALL: &str = \"@vertex fn v() {} @fragment fn f() {}\";"),
            (true, true)
        );
        assert_eq!(main("@ fragment fn mine() {}"), (false, true));
        assert_eq!(main("let source = wgpu::ShaderSource::Wgsl(made().into());"), (true, true));
        assert_eq!(main("device.create_shader_module(wgpu::include_wgsl!(\"a\"))"), (true, true));
    }
}
