//! Gzip data: a series of members (RFC 1952, 2.2), which hold a tar.

use std::io::{self, Read};

use flate2::bufread::GzDecoder;

use super::copy::{PrivateCopy, Stop};
use super::finding::Finding;
use super::limits::{ArchiveLimits, mib};
use super::tar::{self, AGAIN, BLOCK, PADDING, Refused};
use crate::columns::count;

/// Members of gzip data; programs that pack in pieces take 64 KiB or more for each.
const MAX_MEMBERS: u64 = 1 << 14;
const FEWER: &str = "submit only the files of the tree";
/// How a member begins: deflate is gzip's only method.
const MEMBER: &[u8] = b"\x1f\x8b\x08";

/// Reads a gzipped tar.
pub(super) fn read(bytes: &[u8], copy: &mut PrivateCopy<'_>) -> Result<(), Stop> {
    let mut gz = Gz {
        packed: bytes.len(),
        member: GzDecoder::new(bytes),
        members: 1,
        rest: None,
        unpacked: 0,
        limits: copy.limits,
    };
    tar::read(&mut gz, copy)?;
    match gz.rest {
        None => Ok(()),
        Some(rest) if rest.iter().all(|byte| *byte == 0) => {
            let message = format!("{} after the gzip data", count(rest.len(), "zero"));
            copy.findings.push(Finding::note("gz_padding", message));
            Ok(())
        }
        Some(rest) => {
            let message =
                format!("{} after the gzip data: no part of it", count(rest.len(), "byte"));
            copy.findings.push(Finding::warning("gz_data_after", message).hint(AGAIN));
            Ok(())
        }
    }
}

/// What gzip data hold when it is no tar but another archive: some browsers and servers pack what is packed already.
/// Nothing where it is a tar, or cannot be read.
pub(super) fn packed_again(bytes: &[u8], limits: &ArchiveLimits) -> Option<Vec<u8>> {
    let mut gz = GzDecoder::new(bytes);
    let mut unpacked = Vec::new();
    gz.by_ref().take(4).read_to_end(&mut unpacked).ok()?;
    if !unpacked.starts_with(MEMBER) && !unpacked.starts_with(b"PK\x03\x04") {
        return None;
    }
    let most = mib(limits.max_file_mib);
    gz.by_ref().take(most).read_to_end(&mut unpacked).ok()?;
    (unpacked.len() as u64 <= most && gz.get_ref().is_empty()).then_some(unpacked)
}

/// Gzip data under the limits: a series of members (RFC 1952, 2.2), one after the other.
struct Gz<'a> {
    member: GzDecoder<&'a [u8]>,
    members: u64,
    /// What follows the last member, if anything.
    rest: Option<&'a [u8]>,
    packed: usize,
    unpacked: u64,
    limits: &'a ArchiveLimits,
}

impl Read for Gz<'_> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        if buffer.is_empty() || self.rest.is_some() {
            return Ok(0);
        }
        let n = loop {
            let n = self.member.read(buffer)?;
            let rest = *self.member.get_ref();
            if n > 0 || rest.is_empty() {
                break n;
            }
            if !rest.starts_with(b"\x1f\x8b") {
                // Some programs go on with a member behind zeros, others do not.
                if rest.windows(3).any(|bytes| bytes == MEMBER) {
                    let zeros = rest.iter().take_while(|byte| **byte == 0).count();
                    let between = match zeros {
                        0 => "other bytes".to_owned(),
                        _ => count(zeros, "zero"),
                    };
                    let message = format!(
                        "the gzip data end, and more of it follows behind {between}: this can be read in two ways"
                    );
                    return Err(refused("gz_data_after", message, AGAIN));
                }
                self.rest = Some(rest);
                break 0;
            }
            self.members += 1;
            // Each costs more than it weighs.
            if self.members > MAX_MEMBERS {
                return Err(refused(
                    "limit_members",
                    format!("more than {MAX_MEMBERS} pieces of gzip data"),
                    AGAIN,
                ));
            }
            self.member = GzDecoder::new(rest);
        };
        self.unpacked += n as u64;
        let consumed = self.packed - self.member.get_ref().len();
        if self.limits.ratio_exceeded(self.unpacked, consumed as u64) {
            return Err(refused(
                "limit_ratio",
                format!("unpacks to more than {} times its packed size", self.limits.max_ratio),
                FEWER,
            ));
        }
        // Headers and padding come on top of the contents: at most two blocks an entry.
        let overhead = self.limits.most_headers().saturating_mul(2 * BLOCK as u64) + 2 * PADDING;
        if self.unpacked > mib(self.limits.max_total_mib).saturating_add(overhead) {
            return Err(refused(
                "limit_total",
                format!("unpacks to more than the limit of {} MiB", self.limits.max_total_mib),
                FEWER,
            ));
        }
        Ok(n)
    }
}

fn refused(code: &'static str, message: String, hint: &str) -> io::Error {
    io::Error::other(Refused(Finding::error(code, message).hint(hint)))
}
