use super::*;

fn parse(text: &str) -> Result<SceneConfig> {
    SceneConfig::parse(Path::new("a/tinyrender/b.toml"), text.as_bytes())
}

#[test]
fn defaults_are_the_original_course_ones() {
    let config = parse("[input]\nobjfile = \"../mesh/b.obj\"\n").unwrap();
    assert_eq!((config.width, config.height, config.spp), (768, 576, 1));
    assert_eq!(config.mesh, Path::new("a/tinyrender/../mesh/b.obj"));
    assert_eq!(config.camera, CameraConfig::default());
    let found = (config.realtime, config.kind, config.bonus);
    assert_eq!(found, (false, ShadingKind::Simple, false));
}

#[test]
fn simple_and_direct_are_the_same_kind_on_both_paths() {
    let base = "[input]\nobjfile = \"b.obj\"\n[renderer]\n";
    for realtime in ["", "realtime = true\n"] {
        for (line, expected) in [
            ("", ShadingKind::Simple),
            ("type = \"simple\"", ShadingKind::Simple),
            ("type = 'direct'", ShadingKind::Simple),
            ("type = \"normal\"", ShadingKind::Normal),
        ] {
            let config = parse(&format!("{base}{realtime}{line}\n")).unwrap();
            assert_eq!(config.kind, expected, "{realtime}{line}");
        }
    }
}

#[test]
fn mistakes_name_file_line_and_key() {
    let base = "[input]\nobjfile = \"b.obj\"\n";
    for (text, expected) in [
        ("[input\n", "b.toml:1"),
        ("[camera]\nfov = 30\n", "missing field `input`"),
        (
            "[[input]]\nobjfile = \"b.obj\"\n",
            "b.toml:1: input is of type array, expected a section [input]",
        ),
        (
            &format!("film = 3\n{base}"),
            "b.toml:1: film is of type integer, expected a section [film]",
        ),
        (&format!("{base}[[camera]]\nfov = 3\n"), "b.toml:3: camera is of type array"),
        (&format!("{base}[camera]\nup = [1, 1, 0]\n"), "b.toml:4: camera eye"),
        (&format!("{base}[camera]\nat = [1, 1, 0]\n"), "b.toml:4: camera eye"),
        (&format!("film = {{ width = 9,\n height = 0 }}\n{base}"), "b.toml:2: film.height is 0"),
        (&format!("film.width = 0\n{base}"), "b.toml:1: film.width is 0"),
        (&format!("{base}[film]\n\"width\" = 0\n"), "b.toml:4: film.width is 0"),
        (&format!("{base}[film]\nwidth = 0\n"), "b.toml:4: film.width is 0"),
        (&format!("{base}[film]\nheight = 99999\n"), "b.toml:4: film.height is 99999"),
        (
            &format!("{base}[film]\nwidth = 16384\nheight = 4097\n"),
            "b.toml:4: film has 67125248 pixels but must have at most 67108864",
        ),
        (&format!("{base}[renderer]\nspp = -1\n"), "b.toml:4: renderer.spp is -1"),
        (
            &format!("{base}[renderer]\nspp = 4\ntype = \"glass\"\n"),
            "b.toml:5: renderer.type is \"glass\" but must be \"simple\", \"direct\" or \"normal\"",
        ),
        (&format!("{base}[renderer]\ntype = \"Simple\"\n"), "b.toml:4: renderer.type is"),
        (&format!("{base}[renderer]\ntype = \"\"\n"), "b.toml:4: renderer.type is \"\""),
        (&format!("{base}[renderer]\ntype = 1\n"), "b.toml:4: type: invalid type: integer"),
        (&format!("{base}[camera]\neye = [0, nan, 0]\n"), "b.toml:4: camera.eye"),
        (
            &format!("{base}[camera]\nfov = \"wide\"\n"),
            "b.toml:4: fov: invalid type: string \"wide\", expected a number",
        ),
        (&format!("{base}[film]\nwidth = \"7\"\n"), "expected a whole number"),
        (&format!("{base}[film]\nwidth = \"7\"\n"), "b.toml:4: width: invalid type"),
        (
            &format!("{base}[film]\nwidth = 99999999999999999999\n"),
            "b.toml:4: width: out of range: integer",
        ),
        (&format!("{base}[camera]\nfov = 50,0\n"), "write a point in a number"),
        (&format!("{base}[camera]\neye = (0, 3, 4)\n"), "in square brackets: [x, y, z]"),
        (&format!("{base}[camera]\neye = [(0, 3, 4)]\n"), "in square brackets: [x, y, z]"),
        (&format!("{base}[camera]\neye = 0, 3.5, -4 # m\n"), "in square brackets: [x, y, z]"),
        (&format!("{base}[camera]\neye = 0 3 4\n"), "in square brackets: [x, y, z]"),
        (&format!("{base}[camera]\neye = [0 3 4]\n"), "commas between numbers: [x, y, z]"),
        (&format!("{base}[camera]\neye = [0, \u{2212}3, 4]\n"), "write a minus sign as -"),
        (&format!("{base}[camera]\neye = [0,\n \u{2013}3, 4]\n"), "write a minus sign as -"),
        (&format!("{base}[camera]\neye = [0.0f, 3, 4]\n"), "without letters or signs behind"),
        (&format!("{base}[camera]\nfov = 30deg\n"), "without letters or signs behind"),
        (&format!("{base}[camera]\nfov = 50.0 deg\n"), "without letters or signs behind"),
        (&format!("{base}[camera]\neye = [.5, 3, 4]\n"), "on both sides of a point"),
        (&format!("{base}[camera]\neye = [0, 3., 4]\n"), "on both sides of a point"),
        (&format!("{base}[renderer]\nbonus = True\n"), "hint: write true"),
        ("[input]\nobjfile = \"..\\s.obj\"\n", "hint: write / in a path"),
        ("[input]\nobjfile = \"..\\bunny.obj\"\n", "hint: write / in a path"),
        ("[input]\nobjfile = \"C:\\Users\\a.obj\"\n", "hint: write / in a path"),
        (&format!("{base}[camera]\nfov = 50.0;\n"), "a line ends without ;"),
        (&format!("{base}[camera]\nfov = 50.0 // deg\n"), "a comment begins with #"),
        ("[input]\nobjfile = \u{201c}b.obj\u{201d}\n", "write straight quotes"),
        (&format!("{base}[camera]\nfov = 180\n"), "b.toml:4: camera.fov is 180"),
        (&format!("{base}[camera]\nfov = nan\n"), "b.toml:4: camera.fov is NaN"),
        ("[input]\nobjfile = \"\"\n", "b.toml:2: input.objfile names no file"),
        (
            "[input]\nobjfile = \"/m/b.obj\"\n",
            "b.toml:2: input.objfile is /m/b.obj but must be relative",
        ),
    ] {
        let message = parse(text).unwrap_err().to_string();
        assert!(message.contains(expected), "{text:?} gave {message:?}");
    }
    for text in ["[film]\nsize = {{ width = 9, }, }\n", "[film\nwidth = 9\n", "fov = -\n"] {
        let message = parse(&format!("{base}{text}")).unwrap_err().to_string();
        assert!(!message.contains("hint"), "{text:?} gave {message:?}");
    }
}

#[test]
fn what_is_no_toml_file_is_said_to_be_none() {
    let error = SceneConfig::parse(Path::new("s.obj"), b"v 0 0 0\n").unwrap_err().to_string();
    assert!(error.starts_with("s.obj:1: expected a scene's TOML file: "), "{error}");
}

#[test]
fn every_encoding_and_line_end_is_read() {
    let plain = "# gr\u{fc}n\n[input]\nobjfile = '..\\mesh\\b.obj'\n[film]\nwidth = 7\n";
    let latin: Vec<u8> = plain.chars().map(|c| c as u8).collect();
    let utf16 = |text: &str| text.encode_utf16().flat_map(u16::to_le_bytes).collect::<Vec<_>>();
    for bytes in [
        plain.as_bytes().to_vec(),
        format!("\u{feff}{plain}").into_bytes(),
        utf16(&format!("\u{feff}{plain}")),
        latin,
        plain.replace('\n', "\r\n").into_bytes(),
        plain.replace('\n', "\r").into_bytes(),
    ] {
        let config = SceneConfig::parse(Path::new("a/b.toml"), &bytes).unwrap();
        let found = (config.width, config.mesh);
        assert_eq!(found, (7, PathBuf::from("a/../mesh/b.obj")), "{bytes:?}");
    }
}

#[test]
fn unknown_keys_are_listed_not_refused() {
    let config = parse("title = 1\n[input]\nobjfile = \"b.obj\"\n[film]\nwdth = 3\n").unwrap();
    let path = "a/tinyrender/b.toml";
    let expected = ["5: unknown key film.wdth", "1: unknown key title"];
    assert_eq!(config.remarks, expected.map(|expected| format!("{path}:{expected}")));
}
