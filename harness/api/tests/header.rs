//! The committed C header is what cbindgen makes of the interface.

use std::path::Path;

#[test]
fn the_c_header_is_up_to_date() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let config = cbindgen::Config::from_file(root.join("cbindgen.toml"))
        .expect("the configuration of cbindgen is valid");
    let bindings = cbindgen::Builder::new()
        .with_config(config)
        .with_src(root.join("src/lib.rs"))
        .generate()
        .expect("cbindgen reads src/lib.rs");
    let mut made = Vec::new();
    bindings.write(&mut made);
    let made = String::from_utf8(made).expect("cbindgen writes UTF-8");
    let path = root.join("include/umbra_renderer.h");
    if std::env::var_os("UMBRA_REWRITE").is_some_and(|value| value == "1") {
        std::fs::write(&path, &made).expect("the header can be written");
    }
    let committed = std::fs::read_to_string(&path).unwrap_or_default();
    similar_asserts::assert_eq!(
        committed,
        made,
        "include/umbra_renderer.h differs from src/lib.rs; UMBRA_REWRITE=1 rewrites it"
    );
}
