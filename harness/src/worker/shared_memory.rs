//! The worker's side of the shared files: mapped inputs, guarded outputs, the table.

use std::fs::File;
use std::io;
use std::path::Path;

use memmap2::{Mmap, MmapMut, MmapOptions};

use super::table::{SLOT_BYTES, Slot};
use super::wire::OutputRegion;

/// The inputs of all requests.
pub struct Input(Option<Mmap>);

impl Input {
    /// Maps the file.
    ///
    /// # Errors
    /// When it cannot be mapped.
    pub fn open(path: &Path) -> io::Result<Self> {
        let file = File::open(path)?;
        if file.metadata()?.len() == 0 {
            return Ok(Self(None));
        }
        // SAFETY: the parent wrote the file before this process began and does not change it.
        Ok(Self(Some(unsafe { Mmap::map(&file) }?)))
    }

    /// The bytes of one request; empty when they do not lie in the file.
    pub fn bytes(&self, (start, size): (usize, usize)) -> &[u8] {
        let end = start.saturating_add(size);
        self.0.as_ref().and_then(|map| map.get(start..end)).unwrap_or_default()
    }
}

/// The table; see [`Slot`].
pub struct Table(MmapMut);

impl Table {
    /// Maps the table of `requests` requests.
    ///
    /// # Errors
    /// When it cannot be mapped or has another size.
    pub fn open(path: &Path, requests: usize) -> io::Result<Self> {
        let file = File::options().read(true).write(true).open(path)?;
        let size = SLOT_BYTES * (1 + requests);
        if file.metadata()?.len() != size as u64 {
            return Err(io::Error::other(format!("the table is not {size} bytes long")));
        }
        // SAFETY: the parent only reads it; records are seen as atomics below.
        Ok(Self(unsafe { MmapOptions::new().len(size).map_mut(&file) }?))
    }

    /// The record of the plugin's loading.
    pub fn loading(&self) -> &Slot {
        self.record(0)
    }

    /// The record of a request.
    pub fn request(&self, index: usize) -> &Slot {
        self.record(1 + index)
    }

    fn record(&self, index: usize) -> &Slot {
        assert!((index + 1) * SLOT_BYTES <= self.0.len(), "record {index} lies outside the table");
        // SAFETY: inside the mapping, which starts on a page; a record is all atomics, so that
        // any bytes are valid and others may write at the same time.
        unsafe { &*self.0.as_ptr().add(index * SLOT_BYTES).cast::<Slot>() }
    }
}

/// A request's output: the floats end at an inaccessible page, and another lies before the region.
pub struct Output {
    place: OutputRegion,
    #[cfg(unix)]
    map: guarded::Map,
    #[cfg(not(unix))]
    map: MmapMut,
}

impl Output {
    /// Maps one region of the output file.
    ///
    /// # Errors
    /// When it cannot be mapped.
    pub fn open(path: &Path, place: OutputRegion) -> io::Result<Self> {
        let file = File::options().read(true).write(true).open(path)?;
        #[cfg(unix)]
        let map = guarded::Map::new(&file, place.start, place.size)?;
        #[cfg(not(unix))]
        // SAFETY: the parent reads the file only when this process is gone.
        let map = unsafe {
            MmapOptions::new().offset(place.start as u64).len(place.size).map_mut(&file)?
        };
        Ok(Self { place, map })
    }

    /// The floats of the answer.
    pub fn floats(&mut self) -> &mut [f32] {
        let (offset, floats) = (self.place.offset(), self.place.floats);
        #[cfg(unix)]
        let start = self.map.start();
        #[cfg(not(unix))]
        let start = self.map.as_mut_ptr();
        // SAFETY: `offset` and the floats fill the region to its end; both are multiples of four
        // on a page-aligned mapping; any bits are a float; `self` is borrowed meanwhile.
        unsafe { std::slice::from_raw_parts_mut(start.add(offset).cast(), floats) }
    }
}

#[cfg(unix)]
mod guarded {
    use std::fs::File;
    use std::io;
    use std::os::fd::AsRawFd;
    use std::ptr::null_mut;

    use nix::libc;

    use super::super::wire::ALIGN;

    /// A shared mapping between two inaccessible ones. It stays until the process ends: a thread
    /// that a plugin left behind may still write there.
    pub struct Map {
        start: *mut u8,
    }

    impl Map {
        /// Maps `size` bytes of a file from `offset` on.
        ///
        /// # Errors
        /// When the system refuses to map the file.
        pub fn new(file: &File, offset: usize, size: usize) -> io::Result<Self> {
            let reserved = size + 2 * ALIGN;
            let flags = libc::MAP_PRIVATE | libc::MAP_ANONYMOUS | libc::MAP_NORESERVE;
            // SAFETY: a new mapping where the system likes.
            let all = unsafe { libc::mmap(null_mut(), reserved, libc::PROT_NONE, flags, -1, 0) };
            if all == libc::MAP_FAILED {
                return Err(io::Error::last_os_error());
            }
            // SAFETY: inside the reservation.
            let start = unsafe { all.cast::<u8>().add(ALIGN) };
            if size > 0 {
                let access = libc::PROT_READ | libc::PROT_WRITE;
                let flags = libc::MAP_SHARED | libc::MAP_FIXED;
                let (at, offset) = (start.cast(), offset as libc::off_t);
                // SAFETY: replaces pages of the reservation above, which nobody else knows.
                let map = unsafe { libc::mmap(at, size, access, flags, file.as_raw_fd(), offset) };
                if map == libc::MAP_FAILED {
                    return Err(io::Error::last_os_error());
                }
            }
            Ok(Self { start })
        }

        pub fn start(&self) -> *mut u8 {
            self.start
        }
    }
}
