//! How `umbra-worker` is linked: without the names of its functions, which are of no use to a plugin that reads
//! the program around it, but for the one that takes the place of the C library's.

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    if std::env::var("CARGO_CFG_TARGET_OS").is_ok_and(|os| os == "linux") {
        println!("cargo::rustc-link-arg-bin=umbra-worker=-Wl,--strip-all");
        println!("cargo::rustc-link-arg-bin=umbra-worker=-Wl,--export-dynamic-symbol=flock");
    }
}
