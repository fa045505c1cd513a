//! The table in which a worker notes how far it came: one record of fixed size for the plugin's
//! loading and one for each request, in a file that both sides know.

use std::sync::atomic::Ordering::{Relaxed, Release};
use std::sync::atomic::{AtomicI32, AtomicU8, AtomicU32, AtomicU64};

use basecode::gpu::Footprint;

use crate::plugin::{MESSAGE_BYTES, WitnessState};

/// Size of a record in bytes.
pub const SLOT_BYTES: usize = 4096;
const MESSAGE_AT: usize = SLOT_BYTES - MESSAGE_BYTES;

/// Besides `renderer_api`'s statuses: the plugin was refused.
pub const STATUS_REJECTED: i32 = -1;
/// Besides `renderer_api`'s statuses: Umbra itself is at fault.
pub const STATUS_OURS: i32 = -2;
/// Besides `renderer_api`'s statuses: a stage that Umbra's own pass was given is no WGSL.
pub const STATUS_STAGE: i32 = -3;

const STARTED: u32 = 1;
const ANSWERED: u32 = 2;

/// A record as the worker writes it, while the parent may look. All zero: not started.
#[repr(C)]
pub struct Slot {
    state: AtomicU32,
    status: AtomicI32,
    seconds: AtomicU64,
    calls: AtomicU64,
    worst_norm_error: AtomicU32,
    length: AtomicU32,
    done: AtomicU32,
    total: AtomicU32,
    /// One more than the bytes, so that 0 is not said.
    uploaded: AtomicU64,
    picture_targets: AtomicU32,
    vertex_pipelines: AtomicU32,
    vertexless_pipelines: AtomicU32,
    maps: AtomicU32,
    _reserved: [AtomicU8; MESSAGE_AT - 64],
    message: [AtomicU8; MESSAGE_BYTES],
}

const _: () = assert!(size_of::<Slot>() == SLOT_BYTES && align_of::<Slot>() == 8);

impl Slot {
    /// Notes that the work begins.
    pub fn start(&self) {
        self.state.store(STARTED, Release);
    }

    /// Notes finished and total rows.
    pub fn progress(&self, done: u32, total: u32) {
        self.done.store(done, Relaxed);
        self.total.store(total, Relaxed);
    }

    /// Notes what a witness saw.
    pub fn witness(&self, witness: &WitnessState) {
        self.calls.store(witness.calls(), Relaxed);
        self.worst_norm_error.store(witness.worst_norm_error().to_bits(), Relaxed);
    }

    /// Notes what a frame took.
    pub fn footprint(&self, footprint: &Footprint) {
        let Footprint { uploaded, picture_targets, vertex_pipelines, vertexless_pipelines, maps } =
            *footprint;
        self.uploaded.store(uploaded.saturating_add(1), Relaxed);
        self.picture_targets.store(picture_targets, Relaxed);
        self.vertex_pipelines.store(vertex_pipelines, Relaxed);
        self.vertexless_pipelines.store(vertexless_pipelines, Relaxed);
        self.maps.store(maps, Relaxed);
    }

    /// Notes the answer, the state last. A message that is too long is cut.
    pub fn answer(&self, status: i32, message: &str, seconds: f64) {
        let length = message.len().min(MESSAGE_BYTES);
        for (to, from) in self.message.iter().zip(message.bytes()) {
            to.store(from, Relaxed);
        }
        self.length.store(length as u32, Relaxed);
        self.seconds.store(seconds.to_bits(), Relaxed);
        self.status.store(status, Relaxed);
        self.state.store(ANSWERED, Release);
    }
}

/// A record as the parent reads it.
#[derive(Clone, Debug, PartialEq)]
pub enum SlotState {
    /// The work did not begin.
    NotStarted,
    /// It began and did not end.
    Started {
        /// Finished and total rows.
        rows: (u32, u32),
    },
    /// It ended.
    Answered {
        /// The status.
        status: i32,
        /// The message that goes with it.
        message: String,
        /// How long it took; 0 when the record holds nonsense.
        seconds: f64,
        /// Calls of the witness.
        calls: u64,
        /// Largest | |w| - 1 |.
        worst_norm_error: f32,
        /// What the last frame took, if it is said.
        footprint: Option<Footprint>,
    },
}

impl SlotState {
    /// Reads a record. Any bytes are possible here: nothing in them is believed beyond its type.
    pub fn parse(record: &[u8; SLOT_BYTES]) -> Self {
        let u32_at = |at: usize| {
            let bytes = record[at..].first_chunk().copied();
            u32::from_ne_bytes(bytes.unwrap_or_default())
        };
        let u64_at = |at: usize| {
            let bytes = record[at..].first_chunk().copied();
            u64::from_ne_bytes(bytes.unwrap_or_default())
        };
        match u32_at(0) {
            STARTED => Self::Started { rows: (u32_at(32), u32_at(36)) },
            ANSWERED => {
                let length = (u32_at(28) as usize).min(MESSAGE_BYTES);
                let message = &record[MESSAGE_AT..MESSAGE_AT + length];
                let seconds = f64::from_bits(u64_at(8));
                Self::Answered {
                    status: u32_at(4) as i32,
                    message: String::from_utf8_lossy(message).into_owned(),
                    seconds: if seconds.is_finite() { seconds.max(0.0) } else { 0.0 },
                    calls: u64_at(16),
                    worst_norm_error: f32::from_bits(u32_at(24)),
                    footprint: u64_at(40).checked_sub(1).map(|uploaded| Footprint {
                        uploaded,
                        picture_targets: u32_at(48),
                        vertex_pipelines: u32_at(52),
                        vertexless_pipelines: u32_at(56),
                        maps: u32_at(60),
                    }),
                }
            }
            _ => Self::NotStarted,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A record's bytes, as the file would hold them.
    fn bytes(record: &Slot) -> [u8; SLOT_BYTES] {
        // SAFETY: a record is 4096 bytes of atomics without padding, and nobody else writes it.
        unsafe { std::ptr::from_ref(record).cast::<[u8; SLOT_BYTES]>().read() }
    }

    fn zero() -> Slot {
        // SAFETY: all-zero is a valid record.
        unsafe { std::mem::zeroed() }
    }

    #[test]
    fn what_is_written_is_read() {
        let record = zero();
        assert_eq!(SlotState::parse(&bytes(&record)), SlotState::NotStarted);
        record.start();
        record.progress(3, 9);
        assert_eq!(SlotState::parse(&bytes(&record)), SlotState::Started { rows: (3, 9) });
        record.answer(2, "task 1.2", 0.25);
        let SlotState::Answered { status, message, seconds, calls, worst_norm_error, footprint } =
            SlotState::parse(&bytes(&record))
        else {
            panic!("answered");
        };
        assert_eq!((status, message.as_str(), seconds), (2, "task 1.2", 0.25));
        assert_eq!((calls, worst_norm_error, footprint), (0, 0.0, None));
        let own = Footprint {
            uploaded: 0,
            picture_targets: 7,
            vertex_pipelines: 8,
            vertexless_pipelines: 9,
            maps: 10,
        };
        record.footprint(&own);
        let noted = SlotState::parse(&bytes(&record));
        assert!(matches!(noted, SlotState::Answered { footprint, .. } if footprint == Some(own)));
    }

    #[test]
    fn long_messages_are_cut_and_nonsense_is_harmless() {
        let record = zero();
        record.answer(1, &"x".repeat(9000), f64::NAN);
        let SlotState::Answered { message, seconds, .. } = SlotState::parse(&bytes(&record)) else {
            panic!("answered");
        };
        assert_eq!((message.len(), seconds), (MESSAGE_BYTES, 0.0));
        let mut nonsense = [0xFF; SLOT_BYTES];
        assert_eq!(SlotState::parse(&nonsense), SlotState::NotStarted);
        nonsense[..4].copy_from_slice(&ANSWERED.to_ne_bytes());
        let SlotState::Answered { status, message, .. } = SlotState::parse(&nonsense) else {
            panic!("answered");
        };
        assert_eq!((status, message.chars().count()), (-1, MESSAGE_BYTES));
    }
}
