//! Varyings of a student's own: a fragment stage may take more from its vertex stage than the contract forwards, such
//! as the position in the light's view.

use std::collections::BTreeMap;

use super::stages::{VERTEX, bare};

/// The first location that the contract leaves open.
const FIRST_OPEN: u32 = 2;

/// Umbra's vertex stage for a student's fragment stage: it forwards zeros for what the stage takes beyond the contract.
pub fn vertex_for(fragment: &str) -> String {
    let taken = open_varyings(fragment);
    let members: String = taken
        .iter()
        .map(|(at, own)| format!("    {} own_{at}: {},\n", own.attributes, own.of))
        .collect();
    let zeros: String = taken.values().map(|own| format!(", {}()", own.of)).collect();
    VERTEX
        .replace(
            "    @location(1) normal: vec3f,\n}",
            &format!("    @location(1) normal: vec3f,\n{members}}}"),
        )
        .replace("turned.xyz);", &format!("turned.xyz{zeros});"))
}

/// A varying as it is declared.
struct Varying {
    /// `@location(2)` and the like.
    attributes: String,
    /// Its type.
    of: String,
}

/// The declared varyings at open locations. What is no varying does no harm: a vertex stage may forward what nobody
/// takes.
fn open_varyings(fragment: &str) -> BTreeMap<u32, Varying> {
    let text = bare(fragment);
    let mut found = BTreeMap::new();
    for (begin, mark) in text.match_indices("@location(") {
        let Some((location, rest)) = text[begin + mark.len()..].split_once(')') else { continue };
        let Ok(location) = location.trim_end_matches(['u', 'i', ',']).parse::<u32>() else {
            continue;
        };
        let (after, rest) = interpolation(rest);
        let before = text[..begin].rfind("@interpolate(").map(|at| interpolation(&text[at..begin]));
        let before = before.and_then(|(own, rest)| own.filter(|_| rest.is_empty()));
        // A declared varying has a name and a type; a result has a type alone.
        let word = |c: char| c.is_alphanumeric() || c == '_';
        let Some(of) = rest.trim_start_matches(word).strip_prefix(':') else { continue };
        let of = of.split([',', ')', '}', ';', '{', '@']).next().unwrap_or_default();
        let interpolated = before.or(after).unwrap_or_default();
        // Whole numbers are never interpolated.
        if location < FIRST_OPEN
            || !is_varying(of)
            || (!of.contains('f') && interpolated.is_empty())
        {
            continue;
        }
        let attributes = format!("@location({location}){interpolated}");
        found.entry(location).or_insert(Varying { attributes, of: of.to_owned() });
    }
    found
}

/// Whether a type is a scalar or vector that a stage can forward, by its own name.
fn is_varying(of: &str) -> bool {
    let scalars = ["f32", "u32", "i32"];
    scalars.contains(&of)
        || of.strip_prefix("vec").is_some_and(|vector| {
            let of = vector.trim_start_matches(['2', '3', '4']);
            vector.len() == of.len() + 1
                && (["f", "u", "i"].contains(&of)
                    || scalars.iter().any(|scalar| of == format!("<{scalar}>")))
        })
}

/// The attribute that a text begins with, if it says how to interpolate, and the rest.
fn interpolation(text: &str) -> (Option<&str>, &str) {
    match text.starts_with("@interpolate(").then(|| text.find(')')).flatten() {
        Some(end) => (Some(&text[..=end]), &text[end + 1..]),
        None => (None, text),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_a_stage_takes_beyond_the_contract_is_forwarded() {
        assert_eq!(
            vertex_for(
                "fn fs_main(@location(0) p: vec3f, @location(1) n: vec3f) -> @location(0) vec4f {"
            ),
            VERTEX
        );
        let text =
            "struct In { @location(0) p: vec3f, @location(1) n: vec3f, // @location(9) no: f32\n
            @location(2) in_map : vec4<f32>, @location(3) @interpolate(flat) kind: u32,
            @interpolate(flat, first) @location( 4 ) shape: vec2u,
            @location(5) kind_of_vertex: u32, @location(6) named: Own, @location(7) wide: vec44f }
            struct Out { @location(0) color: vec4f }";
        let vertex = vertex_for(text);
        assert!(vertex.contains(
            "    @location(1) normal: vec3f,\n    @location(2) own_2: vec4<f32>,\n    @location(3)@interpolate(flat) own_3: \
             u32,\n    @location(4)@interpolate(flat,first) own_4: vec2u,\n}"
        ), "{vertex}");
        assert!(vertex.contains("turned.xyz, vec4<f32>(), u32(), vec2u());"), "{vertex}");
        assert!(
            [0, 5, 6, 7, 9].iter().all(|at| !vertex.contains(&format!("own_{at}"))),
            "{vertex}"
        );
    }
}
