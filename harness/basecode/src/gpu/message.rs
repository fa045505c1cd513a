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
        return causes.collect::<Vec<_>>().join(": ");
    };
    let (what, source) = shader.split_once('\n').unwrap_or((shader, ""));
    let source = source.replace("─ wgsl:", &format!("─ {file}:"));
    let place = source.split_once("─ ").and_then(|(_, rest)| rest.lines().next());
    format!("{}: {}\n{source}", place.unwrap_or(file), what.trim_end()).trim_end().to_owned()
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
}
