//! How much a submission may hold.

use serde::{Deserialize, Serialize};

/// Limits on a submission, counted on real bytes while they stream; headers are never believed.
///
/// The defaults leave a tenfold margin over the largest submission of the original course (six
/// EXRs of 3 MB and a few dozen source files).
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ArchiveLimits {
    /// Entries in the archive or folder, folders included, besides ignored ones (`ArchiveLimits::most_headers`).
    pub max_entries: u64,
    /// Size of the archive itself, and of all its contents together (MiB).
    pub max_total_mib: u64,
    /// Size of one file (MiB).
    pub max_file_mib: u64,
    /// Unpacked over packed size, of one entry and of a whole `.tar.gz`.
    pub max_ratio: u64,
    /// The ratio counts from this unpacked size on (MiB): an honest black image packs 1000 to 1.
    pub ratio_from_mib: u64,
    /// Components of a path.
    pub max_depth: u64,
    /// Bytes of a path.
    pub max_path_bytes: u64,
}

impl Default for ArchiveLimits {
    fn default() -> Self {
        Self {
            max_entries: 4000,
            max_total_mib: 256,
            max_file_mib: 64,
            max_ratio: 200,
            ratio_from_mib: 32,
            max_depth: 16,
            max_path_bytes: 240,
        }
    }
}

/// Bytes in `mib` mebibytes.
pub(super) fn mib(mib: u64) -> u64 {
    mib.saturating_mul(1 << 20)
}

impl ArchiveLimits {
    /// Entries of all kinds: ignored ones, whose content is not looked at, are a build folder's thousands.
    pub(super) fn most_headers(&self) -> u64 {
        self.max_entries.saturating_mul(25)
    }

    /// Whether `unpacked` bytes out of `packed` exceed the ratio.
    pub(super) fn ratio_exceeded(&self, unpacked: u64, packed: u64) -> bool {
        unpacked > mib(self.ratio_from_mib)
            && unpacked > packed.max(1).saturating_mul(self.max_ratio)
    }
}
