use super::*;

#[test]
fn texture_options_are_applied_or_refused_by_name() {
    let mapping = |scale: [f32; 2], offset: [f32; 2], clamp| Mapping {
        scale: scale.into(),
        offset: offset.into(),
        clamp,
    };
    let plain = Mapping::default();
    for (statement, expected, file) in [
        ("wood.png", plain, "wood.png"),
        ("-s 2 3 4 wood floor.png", mapping([2.0, 3.0], [0.0; 2], false), "wood floor.png"),
        ("-s 2 t.png", mapping([2.0, 1.0], [0.0; 2], false), "t.png"),
        ("-s 2 3 t.png", mapping([2.0, 3.0], [0.0; 2], false), "t.png"),
        ("-S 2 2 -o .5 -clamp on t.png", mapping([2.0; 2], [0.5, 0.0], true), "t.png"),
        ("-o -0.5 1e-1 0 \"a b.png\"", mapping([1.0; 2], [-0.5, 0.1], false), "\"a b.png\""),
        ("-s 1 1 1 2.png", plain, "2.png"),
        ("-blendu off -blendv on -cc off -boost 2 -mm 0 1 -t 0 0 0 t.png", plain, "t.png"),
        ("-dash.png", plain, "-dash.png"),
    ] {
        assert_eq!(texture_statement(statement), Ok((expected, file)), "{statement}");
    }
    for (statement, expected) in [
        ("-bm 0.5 t.png", "-bm is not supported"),
        ("-mm 0.1 0.9 t.png", "-mm is not supported"),
        ("-t 1 1 1 t.png", "-t is not supported"),
        ("-imfchan r t.png", "-imfchan is not supported"),
        ("-type sphere t.png", "-type is not supported"),
        ("-texres 512 t.png", "-texres is not supported"),
        ("-cc on t.png", "-cc is not supported"),
        ("-rotate 3 t.png", "-rotate is not supported"),
        ("-clamp t.png", "expected on or off"),
        ("-s t.png", "-s lacks its number"),
        ("-clamp on", "names no file"),
        ("", "names no file"),
    ] {
        let found = texture_statement(statement);
        assert!(found.as_ref().is_err_and(|found| found.contains(expected)), "{found:?}");
    }
}

#[test]
fn colors_are_checked() {
    assert_eq!(color("Kd", "0.5"), Ok(Vec3::splat(0.5)));
    assert_eq!(color("Kd", "1 2 3 # red"), Ok(Vec3::new(1.0, 2.0, 3.0)));
    for wrong in ["", "1 2", "-1 0 0", "nan 0 0", "0 inf 0", "1e39 0 0", "a b c", "spectral f.rfl"]
    {
        assert!(color("Kd", wrong).is_err_and(|error| error.starts_with("Kd ")), "{wrong}");
    }
}
