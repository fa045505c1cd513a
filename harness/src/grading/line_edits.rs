//! Slips in WGSL, whatever its stages and bind groups are: the host changes one word of one line, and the submission's
//! own pass draws with that.

use std::collections::BTreeSet;
use std::ops::Range;

use basecode::gpu::EDITED_LINE;

use super::stages::Stages;
use crate::worker::StageText;

/// One line of a source with one word of it changed.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LineEdit {
    /// What is wrong with the line if that mends it.
    pub name: &'static str,
    /// Path of the file below `src/`.
    pub file: String,
    /// Number of the line, from 1.
    pub line: usize,
    /// The stages that reach it.
    pub of: Reached,
    from: String,
    to: String,
}

/// The kinds of stages that reach a line.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Reached {
    pub vertex: bool,
    pub fragment: bool,
    /// Whether the line stands in a function that reads a texture.
    pub with_texture: bool,
}

/// Number of edits that the first worker draws with; each later one takes twice as many.
const TRIED_FIRST: usize = 16;
/// So many edits are tried at most.
const MOST: usize = 200;
/// The names of some edits.
const SIGN: &str = "a sign is wrong";
const FACTORS: &str = "the factors of a product are exchanged";
/// Lines that are longer are not looked at, in bytes.
const LONGEST_LINE: usize = 300;
/// Functions of a text that are looked at, the first ones.
const FUNCTIONS: usize = 200;

impl LineEdit {
    /// What the host replaces to have a pass draw with it.
    pub fn stage(&self) -> StageText {
        StageText { name: EDITED_LINE.to_owned(), text: format!("{}\n{}", self.from, self.to) }
    }

    /// Where it is, for reports.
    pub fn place(&self) -> String {
        format!("src/{}:{}", self.file, self.line)
    }
}

/// The edits of all WGSL of a source, of lines that a stage reaches. A line that occurs more than once is edited
/// wherever it stands.
pub fn all(stages: &Stages) -> Vec<LineEdit> {
    let (mut edits, mut seen) = (Vec::<LineEdit>::new(), BTreeSet::new());
    for (path, text) in stages.wgsl() {
        let (functions, loops) = (functions(text), loops(text));
        let mut begin = 0;
        for (index, whole) in text.split_inclusive('\n').enumerate() {
            let from = whole.trim_end();
            let of = reached(&functions, begin);
            let in_loop = loops.iter().any(|range| range.contains(&begin));
            begin += whole.len();
            let is_dead = !of.vertex && !of.fragment;
            if is_dead || in_loop || from.len() > LONGEST_LINE {
                continue;
            }
            for (name, to) in of_line(from) {
                if seen.insert((from.trim().to_owned(), to.clone())) {
                    let (file, line) = (path.to_owned(), index + 1);
                    edits.push(LineEdit { name, file, line, of, from: from.to_owned(), to });
                }
            }
        }
    }
    // The likeliest first: signs. Last what changes matrices alone.
    edits.sort_by_key(|edit| match edit.name {
        SIGN => 0,
        FACTORS => 2,
        _ => 1,
    });
    edits.truncate(MOST);
    edits
}

/// Edits, the likeliest first, by the worker that tries them: starting one costs as much as a few edits.
pub fn batches(edits: &[LineEdit]) -> impl Iterator<Item = &[LineEdit]> {
    let (mut rest, mut count) = (edits, TRIED_FIRST);
    std::iter::from_fn(move || {
        let (batch, later) = rest.split_at(count.min(rest.len()));
        (rest, count) = (later, 2 * count);
        (!batch.is_empty()).then_some(batch)
    })
}

/// A function of WGSL.
struct Function {
    name: String,
    /// Where it stands, from the attributes on.
    range: Range<usize>,
    of: Reached,
    body: String,
}

/// The functions of a text, with the kinds of entry points that call them.
fn functions(text: &str) -> Vec<Function> {
    let mut found: Vec<Function> = Vec::new();
    for (at, _) in text.match_indices("fn ") {
        let before = text[..at].rfind(['}', ';']).map_or(0, |end| end + 1);
        let is_word = |c: char| c.is_alphanumeric() || c == '_';
        let name: String =
            text[at + 3..].trim_start().chars().take_while(|c| is_word(*c)).collect();
        let Some(open) = text[at..].find('{').map(|open| at + open) else { continue };
        let Some(close) = closing(text, open) else { continue };
        let attributes = &text[before.min(at)..at];
        let body = text[open..close].to_owned();
        let of = Reached {
            vertex: attributes.contains("@vertex"),
            fragment: attributes.contains("@fragment"),
            with_texture: body.contains("texture"),
        };
        found.push(Function { name, range: before.min(at)..close, of, body });
        if found.len() == FUNCTIONS {
            break;
        }
    }
    let calls = |caller: &Function| -> Vec<usize> {
        let is_called = |called: &usize| caller.body.contains(&format!("{}(", found[*called].name));
        (0..found.len()).filter(is_called).collect()
    };
    let calls: Vec<Vec<usize>> = found.iter().map(calls).collect();
    // What is called is reached as well, however deep.
    for _ in 0..found.len() {
        for (caller, called) in calls.iter().enumerate() {
            let of = found[caller].of;
            for called in called {
                found[*called].of.vertex |= of.vertex;
                found[*called].of.fragment |= of.fragment;
            }
        }
    }
    found
}

/// Where loops stand, from the line that they begin in: with one word changed they may never end.
fn loops(text: &str) -> Vec<Range<usize>> {
    let begins = ["for ", "for(", "while ", "while(", "loop ", "loop{"].into_iter();
    let found = begins.flat_map(|word| text.match_indices(word)).filter_map(|(at, _)| {
        let line = text[..at].rfind('\n').map_or(0, |end| end + 1);
        let open = at + text[at..].find('{')?;
        Some(line..closing(text, open)?)
    });
    found.collect()
}

/// Of what stands outside of functions, every stage may hang on it.
fn reached(functions: &[Function], at: usize) -> Reached {
    let own = functions.iter().find(|function| function.range.contains(&at));
    own.map_or(Reached { vertex: true, fragment: true, with_texture: false }, |function| {
        function.of
    })
}

/// The end of what a bracket opens.
fn closing(text: &str, open: usize) -> Option<usize> {
    let mut depth = 0usize;
    for (at, c) in text[open..].char_indices() {
        match c {
            '(' | '[' | '{' => depth += 1,
            ')' | ']' | '}' => {
                depth = depth.checked_sub(1)?;
                if depth == 0 {
                    return Some(open + at);
                }
            }
            _ => (),
        }
    }
    None
}

/// The beginning of what a bracket closes.
fn opening(text: &str, close: usize) -> Option<usize> {
    let mut depth = 0usize;
    for (at, c) in text[..=close].char_indices().rev() {
        match c {
            ')' | ']' | '}' => depth += 1,
            '(' | '[' | '{' => {
                depth = depth.checked_sub(1)?;
                if depth == 0 {
                    return Some(at);
                }
            }
            _ => (),
        }
    }
    None
}

fn is_word(c: char) -> bool {
    c.is_alphanumeric() || c == '_' || c == '.'
}

/// What stands in a line before an operator: a name with its fields, calls and indices, or a bracket.
fn operand_before(line: &str, end: usize) -> Option<usize> {
    let mut begin = line[..end].trim_end().len();
    let last = begin;
    while let Some(c) = line[..begin].chars().next_back() {
        begin = match c {
            ')' | ']' => opening(line, begin - 1)?,
            c if is_word(c) => begin - c.len_utf8(),
            _ => break,
        };
    }
    (begin < last).then_some(begin)
}

/// What stands in a line behind an operator.
fn operand_behind(line: &str, begin: usize) -> Option<Range<usize>> {
    let begin = begin + line[begin..].len() - line[begin..].trim_start().len();
    let mut end = begin;
    while let Some(c) = line[end..].chars().next() {
        end = match c {
            '(' | '[' => closing(line, end)? + 1,
            c if is_word(c) => end + c.len_utf8(),
            _ => break,
        };
    }
    (end > begin).then_some(begin..end)
}

/// A line with a range of it replaced.
fn replaced(line: &str, range: Range<usize>, by: &str) -> String {
    format!("{}{by}{}", &line[..range.start], &line[range.end..])
}

/// The arguments of a call whose bracket opens at `open`.
fn arguments(line: &str, open: usize) -> Option<Vec<Range<usize>>> {
    let close = closing(line, open)?;
    let (mut found, mut begin, mut depth) = (Vec::new(), open + 1, 0usize);
    for (at, c) in line[open + 1..close].char_indices() {
        let at = open + 1 + at;
        match c {
            '(' | '[' => depth += 1,
            ')' | ']' => depth = depth.saturating_sub(1),
            ',' if depth == 0 => {
                found.push(begin..at);
                begin = at + 1;
            }
            _ => (),
        }
    }
    found.push(begin..close);
    let trimmed = found.into_iter().map(|range| {
        let text = &line[range.clone()];
        let begin = range.start + text.len() - text.trim_start().len();
        begin..begin + text.trim().len()
    });
    Some(trimmed.collect())
}

/// Calls whose arguments may change places and mean the same.
const SYMMETRIC: [&str; 4] = ["dot", "max", "min", "distance"];

/// A line with two parts of it exchanged.
fn exchanged(line: &str, a: Range<usize>, b: Range<usize>) -> String {
    let (left, between, right) = (&line[a.clone()], &line[a.end..b.start], &line[b.clone()]);
    format!("{}{right}{between}{left}{}", &line[..a.start], &line[b.end..])
}

/// The edits of a line: what each mends, and the line with it.
fn of_line(line: &str) -> Vec<(&'static str, String)> {
    let code = &line[..line.find("//").unwrap_or(line.len())];
    let mut edits = Vec::new();
    calls(code, &mut |name, edited| edits.push((name, edited)));
    words(code, &mut |name, edited| edits.push((name, edited)));
    operators(code, &mut |name, edited| edits.push((name, edited)));
    edits
}

type Push<'a> = &'a mut dyn FnMut(&'static str, String);

/// Arguments of calls exchanged, and what stands for another call.
fn calls(code: &str, push: Push) {
    for (open, _) in code.match_indices('(') {
        let called = operand_before(code, open).map_or("", |begin| &code[begin..open]);
        let begin = open - called.len();
        if called.is_empty() || code[..begin].ends_with('@') {
            continue;
        }
        let Some(arguments) = arguments(code, open) else { continue };
        if let [first, second, ..] = arguments.as_slice()
            && !first.is_empty()
            && !second.is_empty()
            && code[first.clone()] != code[second.clone()]
            && !SYMMETRIC.contains(&called)
            && (arguments.len() == 2 || called == "select" || called == "mix")
        {
            let name = "two arguments of a call are exchanged";
            push(name, exchanged(code, first.clone(), second.clone()));
        }
        // vec4f(clip.xyz, 0.0) loses the fourth component.
        if let [first, second] = arguments.as_slice()
            && called.starts_with("vec4")
            && let Some(whole) = code[first.clone()].strip_suffix(".xyz")
            && code[second.clone()].starts_with(|c: char| c.is_ascii_digit())
        {
            push("w of a vector is lost", replaced(code, begin..second.end + 1, whole));
        }
        match called {
            "normalize" => {
                push("a vector is normalized that must not be", replaced(code, begin..open, ""));
                push(SIGN, replaced(code, begin..open, "-normalize"));
            }
            "reflect" => push(SIGN, replaced(code, begin..open, "-reflect")),
            "max" => push("max and min are exchanged", replaced(code, begin..open, "min")),
            "min" => push("max and min are exchanged", replaced(code, begin..open, "max")),
            _ => (),
        }
    }
    if let Some((_, value)) = code.split_once('=')
        && ["let ", "var "].iter().any(|word| code.trim_start().starts_with(word))
        && let Some(value) = value.trim().strip_suffix(';')
        && let Some(begin) = code.rfind(value)
    {
        let normalized = format!("normalize({value})");
        push("a vector is not normalized", replaced(code, begin..begin + value.len(), &normalized));
    }
}

/// Constants 0 and 1 exchanged, and components in their order.
fn words(code: &str, push: Push) {
    let mut at = 0;
    while let Some(begin) = code[at..].find(is_word).map(|begin| at + begin) {
        let end = code[begin..].find(|c| !is_word(c)).map_or(code.len(), |end| begin + end);
        let word = &code[begin..end];
        at = end;
        let before = &code[..begin];
        let is_index = before.ends_with(['[', '<'])
            || ["location(", "group(", "binding("].iter().any(|of| before.ends_with(of));
        let number = word.trim_end_matches('f').parse::<f64>().ok().filter(|_| !is_index);
        match number {
            Some(0.0) => push("a constant is wrong", replaced(code, begin..end, "1.0")),
            Some(1.0) => push("a constant is wrong", replaced(code, begin..end, "0.0")),
            _ => (),
        }
        let Some((_, components)) = word.rsplit_once('.') else { continue };
        for all in ["xyzw", "rgba"] {
            let right = &all[..components.len().min(4)];
            let is_swizzle = components.len() > 1 && components.chars().all(|c| all.contains(c));
            if is_swizzle && components.len() <= 4 && components != right {
                let name = "components are in another order";
                push(name, replaced(code, end - components.len()..end, right));
            }
        }
    }
}

/// Operators, and what stands on both sides of them.
fn operators(code: &str, push: Push) {
    for (at, operator) in code.match_indices(['*', '/', '+', '-', '<', '>']) {
        let behind = at + 1;
        if ["<", ">"].contains(&operator) && code[behind..].starts_with("= ") {
            let other = if operator == "<" { ">" } else { "<" };
            push("a comparison is the wrong way round", replaced(code, at..behind, other));
        }
        if code[behind..].starts_with(['=', '>', '*', '/']) || code[..at].ends_with(['*', '/', '-'])
        {
            continue;
        }
        let is_spaced = code[..at].ends_with(' ') && code[behind..].starts_with(' ');
        let before = operand_before(code, at).map(|begin| begin..code[..at].trim_end().len());
        let sides = before.zip(operand_behind(code, behind));
        let mut by = |name, other: &str| push(name, replaced(code, at..behind, other));
        match operator {
            "-" if sides.is_none() || !is_spaced => by(SIGN, ""),
            "<" if is_spaced => by("a comparison is the wrong way round", ">"),
            ">" if is_spaced => by("a comparison is the wrong way round", "<"),
            "+" if is_spaced => by(SIGN, "-"),
            "-" if is_spaced => by(SIGN, "+"),
            "*" if is_spaced => by("multiplied in place of divided", "/"),
            "/" if is_spaced => by("divided in place of multiplied", "*"),
            _ => (),
        }
        if let Some((before, behind)) = sides
            && code[before.clone()] != code[behind.clone()]
        {
            let name = match operator {
                "-" => SIGN,
                "*" => FACTORS,
                "/" => "dividend and divisor are exchanged",
                _ => continue,
            };
            push(name, exchanged(code, before, behind));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn holds(line: &str, mended: &str) -> bool {
        of_line(line).iter().any(|(_, edited)| edited == mended)
    }

    #[test]
    fn each_worker_tries_twice_as_many_edits_as_the_one_before() {
        let (name, file, of) = (SIGN, String::new(), Reached::default());
        let (from, to) = (String::new(), String::new());
        let first = LineEdit { name, file, line: 0, of, from, to };
        let edits: Vec<LineEdit> =
            (0..100).map(|line| LineEdit { line, ..first.clone() }).collect();
        let sizes: Vec<usize> = batches(&edits).map(<[LineEdit]>::len).collect();
        assert_eq!(sizes, [16, 32, 52]);
        assert!(batches(&edits).flatten().eq(&edits));
        assert!(batches(&[]).next().is_none());
    }

    #[test]
    fn one_word_of_a_line_is_changed() {
        for (wrong, right) in [
            ("    let p = m * vec4f(position, 0.0);", "    let p = m * vec4f(position, 1.0);"),
            ("out.clip = clip.xyww;", "out.clip = clip.xyzw;"),
            ("out.clip = vec4f(clip.xyz, 0.0);", "out.clip = clip;"),
            ("let s = textureLoad(mask, p.yx, 0);", "let s = textureLoad(mask, p.xy, 0);"),
            ("let f = step(dot(n, l), 0.0);", "let f = step(0.0, dot(n, l));"),
            ("let c = a.view * a.projection * p;", "let c = a.projection * a.view * p;"),
            ("let l = p.world - scene.light.xyz;", "let l = scene.light.xyz - p.world;"),
            ("let wo = eye - p;", "let wo = normalize(eye - p);"),
            ("let r = reflect(wo, n);", "let r = -reflect(wo, n);"),
            ("if dot(n, wo) > 0.0 { discard; }", "if dot(n, wo) < 0.0 { discard; }"),
            ("if a >= 0.0 || b <= 0.0 {", "if a <= 0.0 || b <= 0.0 {"),
            ("return min(dot(n, l), 0.0);", "return max(dot(n, l), 0.0);"),
            ("let e = i * dot(l, l); // r^2", "let e = i / dot(l, l); "),
        ] {
            assert!(holds(wrong, right), "{wrong}: {:#?}", of_line(wrong));
        }
        // Attributes, indices and types stay as they are.
        for line in ["@location(0) p: vec3f,", "@group(1) @binding(0) var<uniform> u: U;"] {
            assert_eq!(of_line(line), []);
        }
    }

    #[test]
    fn a_line_belongs_to_the_stages_that_reach_it() {
        let text = "const A = 1.0;\nfn both() -> f32 { return 0.0; }\nfn one() -> f32 {\n    return 1.0 - both();\n}\n\
                    @vertex\nfn v() -> V {\n    return V(both());\n}\n@fragment fn f() -> F {\n    return F(one());\n}\n";
        let found = functions(text);
        let at = |line: &str| {
            let of = reached(&found, text.find(line).unwrap());
            (of.vertex, of.fragment)
        };
        assert_eq!(at("const A"), (true, true));
        assert_eq!(at("fn both"), (true, true));
        assert_eq!(at("    return 1.0"), (false, true));
        assert_eq!(at("    return V"), (true, false));
        assert_eq!(at("    return F"), (false, true));
    }

    #[test]
    fn lines_of_loops_and_of_what_nobody_calls_stay() {
        let text = "@fragment fn f() -> F {\n    let a = step(b, c);\n    for (var i = 0; i < 4; i++) {\n        d += step(b, d);\n    }\n    \
                    return F(step(d, a));\n}\nfn dead() -> f32 {\n    return step(a, c);\n}\n";
        let mut stages = Stages::default();
        stages.set_text("a.wgsl", text);
        let lines: std::collections::BTreeSet<usize> =
            all(&stages).into_iter().map(|edit| edit.line).collect();
        assert_eq!(lines, [2, 6].into());
    }

    #[test]
    fn signs_are_tried_first_and_exchanged_factors_last() {
        let mut stages = Stages::default();
        let text = "@vertex fn v() -> V {\n    let a = b * step(c, d);\n    return V(a - b);\n}\n";
        stages.set_text("a.wgsl", text);
        let names: Vec<&str> = all(&stages).iter().map(|edit| edit.name).collect();
        let signs = names.iter().take_while(|name| **name == SIGN).count();
        assert!(signs > 0 && !names[signs..].contains(&SIGN), "{names:?}");
        assert_eq!(names.iter().position(|name| *name == FACTORS), Some(names.len() - 1));
    }

    #[test]
    fn lines_of_wgsl_are_found_in_any_file() {
        let rust = "const ALL: &str = r\"\n@vertex fn v() { let a = step(b, c); }\n\";\nfn main() { let b = f(x, y); }";
        let mut stages = Stages::default();
        stages.set_text("main.rs", rust);
        let edits = all(&stages);
        assert!(edits.iter().any(|edit| edit.to.contains("step(c, b)") && edit.line == 2));
        assert!(edits.iter().all(|edit| edit.from.contains("@vertex")), "{edits:#?}");
        assert_eq!(edits[0].place(), "src/main.rs:2");
    }
}
