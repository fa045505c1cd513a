//! Readable messages from errors of the graphics library.

/// The library's message without its wrapping. Of a shader: `FILE:LINE:COLUMN: what`, then the
/// source line with its caret, as they came. Of anything else: the causes in one line.
pub(super) fn readable(said: &str) -> String {
    let said = said.trim_end();
    let label = said.split_once("label = '").and_then(|(_, rest)| rest.split_once('\''));
    let file = label.map_or("WGSL", |(label, _)| label);
    let shader = said.split_once("\nShader ").and_then(|(_, rest)| rest.split_once(" error: "));
    let Some((_, shader)) = shader else {
        let causes = said.split_once("Caused by:").map_or(said, |(_, causes)| causes);
        let causes = causes.lines().map(str::trim).filter(|line| !line.is_empty());
        let causes = causes.filter(|line| !line.starts_with("Error matching ShaderStages("));
        return causes.map(in_wgsl).collect::<Vec<_>>().join(": ");
    };
    let (what, source) = shader.split_once('\n').unwrap_or((shader, ""));
    let source = source.replace("─ wgsl:", &format!("─ {file}:"));
    let place = source.split_once("─ ").and_then(|(_, rest)| rest.lines().next());
    format!("{}: {}\n{source}", place.unwrap_or(file), what.trim_end()).trim_end().to_owned()
}

/// What a stage and its pipeline disagree on, in the words of WGSL.
fn in_wgsl(cause: &str) -> String {
    let number = |name: &str| {
        let (_, rest) = cause.split_once(name)?;
        rest.split(|c: char| !c.is_ascii_digit()).next()
    };
    if cause.starts_with("Location[")
        && let (Some(location), Some((_, rest))) = (number("Location["), cause.split_once("] "))
    {
        let of = wgsl_type(rest.split(' ').next().unwrap_or_default());
        return format!(
            "it takes @location({location}) of type {of}, which the vertex stage does not write"
        );
    }
    if let Some(rest) = cause.strip_prefix("Shader global ResourceBinding ")
        && let (Some(group), Some(binding)) = (number("group: "), number("binding: "))
        && let Some((_, rest)) = rest.split_once('}')
    {
        return format!("@group({group}) @binding({binding}){rest}");
    }
    cause.to_owned()
}

/// `Float32x3` in the words of WGSL: `vec3f`.
fn wgsl_type(name: &str) -> String {
    let (scalar, count) =
        name.split_once('x').map_or((name, ""), |(scalar, count)| (scalar, count));
    let (short, long) = match scalar {
        "Float32" => ("f", "f32"),
        "Uint32" => ("u", "u32"),
        "Sint32" => ("i", "i32"),
        _ => return name.to_owned(),
    };
    if count.is_empty() { long.to_owned() } else { format!("vec{count}{short}") }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_shader_error_begins_with_file_line_and_column() {
        let said = "Validation Error\n\nCaused by:\n  In Device::create_shader_module, label = \
                    'src/shaders/phong.fs.wgsl'\n    \nShader 'src/shaders/phong.fs.wgsl' parsing error: \
                    expected `;`, found \"}\"\n   ┌─ wgsl:69:1\n   │\n69 │ }\n   │ ^ expected `;`\n\n";
        let file = "src/shaders/phong.fs.wgsl";
        let expected = format!(
            "{file}:69:1: expected `;`, found \"}}\"\n   ┌─ {file}:69:1\n   │\n69 │ }}\n   │ ^ expected `;`"
        );
        assert_eq!(readable(said), expected);
    }

    #[test]
    fn other_errors_are_one_line() {
        let said = "Validation Error\n\nCaused by:\n  In Device::create_render_pipeline, label = 'phong.fs'\n    \
                    Unable to find entry point 'fs_main'\n";
        let line = "In Device::create_render_pipeline, label = 'phong.fs': Unable to find entry point 'fs_main'";
        assert_eq!(readable(said), line);
        assert_eq!(readable("Out of Memory\n"), "Out of Memory");
    }

    /// The messages are those of wgpu 30.
    #[test]
    fn what_stage_and_pipeline_disagree_on_is_said_in_wgsl() {
        for (cause, expected) in [
            (
                "Location[5] Float32x3 interpolated as Some(Perspective) with sampling Some(Center) is not \
                 provided by the previous stage outputs\n    Input is not provided by the earlier stage in the pipeline",
                "it takes @location(5) of type vec3f, which the vertex stage does not write: Input is not \
                 provided by the earlier stage in the pipeline",
            ),
            (
                "Location[12] Uint32 interpolated as Some(Flat) is not provided by the previous stage outputs",
                "it takes @location(12) of type u32, which the vertex stage does not write",
            ),
            (
                "Shader global ResourceBinding { group: 2, binding: 1 } is not available in the pipeline \
                 layout\n  Binding is missing from the pipeline layout",
                "@group(2) @binding(1) is not available in the pipeline layout: Binding is missing from the pipeline \
                 layout",
            ),
            ("Unable to find entry point 'fs_main'", "Unable to find entry point 'fs_main'"),
        ] {
            let said = format!(
                "Validation Error\n\nCaused by:\n  In Device::create_render_pipeline, label = 'phong.fs'\n    \
                 Error matching ShaderStages(FRAGMENT) shader requirements against the pipeline\n      {cause}\n"
            );
            let line = format!("In Device::create_render_pipeline, label = 'phong.fs': {expected}");
            assert_eq!(readable(&said), line);
        }
    }
}
