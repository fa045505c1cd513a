//! Names of functions are of no use to a plugin that reads the program around it.

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    if std::env::var("CARGO_CFG_TARGET_OS").is_ok_and(|os| os == "linux") {
        println!("cargo::rustc-link-arg-bin=umbra-worker=-Wl,--strip-all");
    }
}
