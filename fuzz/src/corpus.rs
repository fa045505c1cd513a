//! The fuzz targets on their corpus and on what is near it, without a fuzzer: nothing panics, and
//! nothing takes memory out of proportion to what it was given.

use std::alloc::{GlobalAlloc, Layout, System};
use std::path::Path;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering::Relaxed};

use basecode::Sampler;

/// Inputs made from each file of the corpus.
const MUTATIONS: u64 = 60;
/// The most memory that reading one small input may take.
const MEMORY: usize = 64 << 20;

/// The system's allocator, counting what is in use.
struct Counting;

static USED: AtomicUsize = AtomicUsize::new(0);
static PEAK: AtomicUsize = AtomicUsize::new(0);

// SAFETY: everything is the system allocator's; counting touches two atomics.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        let used = USED.fetch_add(layout.size(), Relaxed) + layout.size();
        PEAK.fetch_max(used, Relaxed);
        // SAFETY: the caller's promise.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, place: *mut u8, layout: Layout) {
        USED.fetch_sub(layout.size(), Relaxed);
        // SAFETY: the caller's promise.
        unsafe { System.dealloc(place, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// Memory is counted for one at a time.
static ALONE: Mutex<()> = Mutex::new(());

/// The same sequence in every run.
struct Random(Sampler);

impl Random {
    fn below(&mut self, n: usize) -> usize {
        (f64::from(self.0.next_1d()) * n as f64) as usize
    }
}

/// Cut, overwritten, with pieces of it or of another doubled, or with a number made extreme.
fn mutated(bytes: &[u8], other: &[u8], random: &mut Random) -> Vec<u8> {
    let mut bytes = bytes.to_vec();
    for _ in 0..=random.below(3) {
        let at = random.below(bytes.len());
        match random.below(5) {
            0 => bytes.truncate(at),
            1 if !bytes.is_empty() => bytes[at] ^= 1 << random.below(8),
            2 => {
                let (from, length) = (random.below(other.len()), random.below(40));
                let piece = other[from..(from + length).min(other.len())].to_vec();
                bytes.splice(at..at, piece);
            }
            3 => {
                let end = (at + random.below(8)).min(bytes.len());
                bytes[at..end].fill([0, 0x7f, 0x80, 0xff][random.below(4)]);
            }
            _ => {
                let end = (at + random.below(16)).min(bytes.len());
                let number: &[u8] =
                    [&b"-1"[..], b"4294967296", b"1e39", b"nan", b"18446744073709551616"]
                        [random.below(5)];
                bytes.splice(at..end, number.iter().copied());
            }
        }
    }
    bytes
}

fn replay(name: &str, target: fn(&[u8])) {
    let _alone = ALONE.lock();
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("corpus").join(name);
    let files = folder.read_dir().unwrap_or_else(|e| panic!("{}: {e}", folder.display()));
    let mut corpus: Vec<_> = files.map(|file| file.unwrap().path()).collect();
    corpus.sort();
    assert!(corpus.len() >= 3, "{} holds {} files", folder.display(), corpus.len());
    let corpus: Vec<_> =
        corpus.into_iter().map(|path| (std::fs::read(&path).unwrap(), path)).collect();
    let mut random = Random(Sampler::new(1));
    for (bytes, path) in &corpus {
        for mutation in 0..MUTATIONS {
            let other = &corpus[random.below(corpus.len())].0;
            let input =
                if mutation == 0 { bytes.clone() } else { mutated(bytes, other, &mut random) };
            let before = USED.load(Relaxed);
            PEAK.store(before, Relaxed);
            let result = std::panic::catch_unwind(|| target(&input));
            let taken = PEAK.load(Relaxed).saturating_sub(before);
            let named = || {
                let file = std::env::temp_dir().join(format!("umbra-{name}-input"));
                let _ = std::fs::write(&file, &input);
                format!("{}, mutation {mutation}, kept as {}", path.display(), file.display())
            };
            assert!(result.is_ok(), "{}", named());
            assert!(taken < MEMORY, "{} bytes: {}", taken, named());
        }
    }
}

#[test]
fn archives() {
    replay("archive", crate::archive);
}

#[test]
fn configs() {
    replay("config", crate::config);
}

#[test]
fn images() {
    replay("exr", crate::exr);
}

#[test]
fn submitted_images() {
    replay("judge", crate::judge);
}

#[test]
fn scene_files() {
    replay("toml", crate::toml);
}

#[test]
fn meshes() {
    replay("obj", crate::obj);
}

#[test]
fn materials() {
    replay("mtl", crate::mtl);
}

#[test]
fn answers_of_workers() {
    replay("worker", crate::worker);
}
