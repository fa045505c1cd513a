//! Builds HTML. Only constants of the program can enter unescaped; text cannot.

use std::fmt::Display;

use serde::Serialize;

use super::super::harmless;

/// An HTML text.
#[derive(Default)]
pub(super) struct Html(String);

impl Html {
    /// Markup. The lifetime keeps out whatever a submission says.
    pub(super) fn raw(&mut self, markup: &'static str) -> &mut Self {
        self.0.push_str(markup);
        self
    }

    /// Text of the program's own that is not known before it runs: a style, a script, made of constants.
    pub(super) fn own(&mut self, text: &str) -> &mut Self {
        self.0.push_str(text);
        self
    }

    /// Data for a script to read, inside `<script type="application/json">`.
    pub(super) fn json(&mut self, data: &impl Serialize) -> &mut Self {
        let text = serde_json::to_string(data).unwrap_or_else(|_| "null".to_owned());
        // Whatever could end the element, or begin another, can only stand in a string.
        self.0.push_str(
            &text.replace('<', "\\u003c").replace('>', "\\u003e").replace('&', "\\u0026"),
        );
        self
    }

    /// Text, made harmless and escaped for content and for quoted attributes.
    pub(super) fn text(&mut self, text: &str) -> &mut Self {
        for c in harmless(text).chars() {
            match c {
                '&' => self.0.push_str("&amp;"),
                '<' => self.0.push_str("&lt;"),
                '>' => self.0.push_str("&gt;"),
                '"' => self.0.push_str("&quot;"),
                '\'' => self.0.push_str("&#39;"),
                other => self.0.push(other),
            }
        }
        self
    }

    /// A value of the program's own.
    pub(super) fn show(&mut self, value: impl Display) -> &mut Self {
        self.text(&value.to_string())
    }

    /// A relative address of a file below the page's folder, percent-encoded, for an attribute.
    pub(super) fn address(&mut self, path: &str) -> &mut Self {
        // Without "./" a colon or a double slash at the beginning could name another place.
        self.0.push_str("./");
        for byte in path.bytes() {
            if byte.is_ascii_alphanumeric() || b"-_.~/".contains(&byte) {
                self.0.push(char::from(byte));
            } else {
                self.0.push_str(&format!("%{byte:02X}"));
            }
        }
        self
    }

    /// A bar that shows `[least, most]` of `out_of`; decoration, the numbers stand beside it.
    pub(super) fn bar(&mut self, least: f64, most: f64, out_of: f64) -> &mut Self {
        let percent = |value: f64| {
            let part = if out_of > 0.0 { value / out_of } else { 0.0 };
            format!("{:.2}", 100.0 * part.clamp(0.0, 1.0))
        };
        // An SVG: its attributes need no style, which the page's policy forbids.
        self.raw("<svg class=\"bar\" aria-hidden=\"true\" viewBox=\"0 0 100 1\" preserveAspectRatio=\"none\">");
        self.raw("<rect class=\"most\" height=\"1\" width=\"").text(&percent(most));
        self.raw("\"/><rect class=\"least\" height=\"1\" width=\"").text(&percent(least));
        self.raw("\"/></svg>")
    }

    /// The whole text.
    pub(super) fn finish(self) -> String {
        self.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn escapes_text_and_addresses() {
        let mut html = Html::default();
        html.raw("<a href=\"").address("//x/j:a\"<山").raw("\" title=\"").text("\"'<&>\u{1b}");
        assert_eq!(
            html.finish(),
            "<a href=\".///x/j%3Aa%22%3C%E5%B1%B1\" title=\"&quot;&#39;&lt;&amp;&gt;\\u{1b}"
        );
    }

    #[test]
    fn a_bar_stays_within_its_frame() {
        for (least, most, out_of, widths) in [
            (5.0, 10.0, 20.0, ["50.00", "25.00"]),
            (95.0, 95.0, 75.0, ["100.00", "100.00"]),
            (0.0, 0.0, 0.0, ["0.00", "0.00"]),
        ] {
            let mut html = Html::default();
            let text = {
                html.bar(least, most, out_of);
                html.finish()
            };
            let found: Vec<&str> =
                text.split("width=\"").skip(1).filter_map(|rest| rest.split('"').next()).collect();
            assert_eq!(found, widths);
        }
    }
}
