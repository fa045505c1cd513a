//! The stack of children that a traversal has yet to visit. It neither zeroes nor allocates memory.

use std::mem::MaybeUninit;

/// A list of fixed room, filled and emptied at its end.
pub struct Stack {
    slots: [MaybeUninit<u64>; Self::ROOM],
    /// All slots below have been written.
    len: usize,
}

impl Stack {
    /// The most that it holds.
    pub const ROOM: usize = 256;

    #[inline(always)]
    pub fn new() -> Self {
        Self { slots: [const { MaybeUninit::uninit() }; Self::ROOM], len: 0 }
    }

    #[inline(always)]
    pub fn len(&self) -> usize {
        self.len
    }

    #[inline(always)]
    pub fn push(&mut self, value: u64) {
        self.slots[self.len].write(value);
        self.len += 1;
    }

    #[inline(always)]
    pub fn pop(&mut self) -> Option<u64> {
        self.len = self.len.checked_sub(1)?;
        // SAFETY: all slots below the old length have been written.
        Some(unsafe { self.slots[self.len].assume_init() })
    }

    /// Puts a value in its place among those from `bottom` on, of which the last is the least.
    #[inline(always)]
    pub fn insert(&mut self, bottom: usize, value: u64) {
        let mut at = self.len;
        while at > bottom {
            // SAFETY: `at` is at most the length.
            let below = unsafe { self.slots[at - 1].assume_init() };
            if below >= value {
                break;
            }
            self.slots[at].write(below);
            at -= 1;
        }
        self.slots[at].write(value);
        self.len += 1;
    }
}
