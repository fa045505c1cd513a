use std::sync::mpsc::channel;

use super::*;

#[test]
fn only_what_a_check_reads_starts_one() {
    let [watched, written] = [Path::new("/home/a/work"), Path::new("/home/a/work/umbra-report")];
    for (path, counts) in [
        ("/home/a/work/src/bsdfs/phong.rs", true),
        ("/home/a/work/config.json", true),
        ("/home/a/work/umbra-report/work/report.html", false),
        ("/home/a/work/.git/index", false),
        ("/home/a/work/src/.phong.rs.swp", false),
        ("/home/a/work/src/phong.rs~", false),
        ("/home/a/work/target/release/x", false),
        ("/home/a/other/src/lib.rs", false),
    ] {
        assert_eq!(is_source(Path::new(path), watched, written), counts, "{path}");
    }
    assert!(is_shader(Path::new("/home/a/work/src/shaders/phong.fs.wgsl")));
    assert!(!is_shader(Path::new("/home/a/work/src/shaders/phong.rs")));
}

#[test]
fn a_save_of_shaders_alone_is_told_from_others() {
    for (saved, told) in [
        (vec![Change::Shader], Change::Shader),
        (vec![Change::Shader, Change::Shader], Change::Shader),
        (vec![Change::Shader, Change::Other, Change::Shader], Change::Other),
        (vec![Change::Other, Change::Shader], Change::Other),
    ] {
        let (happened, happens) = channel();
        saved.iter().for_each(|&change| happened.send(Happened::Saved(change)).unwrap());
        // What ends meanwhile was about the save before.
        happened.send(Happened::Ended(7)).unwrap();
        assert_eq!(wait(&happens, false), Happened::Saved(told), "{saved:?}");
        happened.send(Happened::Ended(8)).unwrap();
        assert_eq!(wait(&happens, false), Happened::Ended(8));
        happened.send(Happened::Saved(Change::Other)).unwrap();
        happened.send(Happened::Interrupted).unwrap();
        assert_eq!(wait(&happens, false), Happened::Interrupted);
    }
}
