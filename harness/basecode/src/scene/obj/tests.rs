//! Pieces of a file against the whole.

use std::path::Path;

use super::Obj;

/// Forms that depend on what comes before them, and on being cut.
const TEXTS: [&str; 4] = [
    "mtllib a.mtl\no one\nusemtl red\nv 0 0 0\nv 1 0 0\nv 1 1 0\nf 1 2 3\nf -3 -2 -1\n\nvt 0.5\nvn 0 0 1\n\
     f -3/-1/-1 -2/1/1 3/-1/-1\nusemtl red\no two\nf 1//1 2//1 3//1\nusemtl blue\nf 1 2 \\\n 3\np 1\nl 1 2\n\
     f 1 2\nv 2 2 2 0.5 0.5 0.5\nv 1e-3 -.5 +2 # color\r\nv nan 0 0\rf 4 5 -2\n # end",
    "v 0 0 0\nv 1 0 0\nv 1 1 0\n\n\nf 1 2 3\nf -1 -2 -4\nf 1 2 x\n",
    "usemtl a\nv 0 0 0\nv 1 0 0\nv 1 inf 0\nf 1 2 3\nf 1 2 9\n",
    "v 0 0 0\nv 1 0 0 w\n",
];

#[test]
fn pieces_of_any_size_are_the_whole() {
    for text in TEXTS {
        let read = |bytes| format!("{:?}", Obj::parse_in_pieces(Path::new("a.obj"), text, bytes));
        let whole = read(usize::MAX / 2);
        for bytes in 0..=text.len() {
            assert_eq!(read(bytes), whole, "pieces of {bytes} bytes");
        }
    }
}

#[test]
fn errors_name_the_line_of_the_file() {
    for (text, line) in [(TEXTS[1], ":7"), (TEXTS[2], ":4"), (TEXTS[3], ":2")] {
        let error = Obj::parse_in_pieces(Path::new("a.obj"), text, 4).expect_err("an error");
        assert!(error.to_string().contains(&format!("a.obj{line}: ")), "{error}");
    }
}
