//! A number that stands for everything a tick said besides its set-point.

use std::io::{self, Write};

use serde::Serialize;

use crate::control::Output;

/// FNV-1a over the MessagePack form of requests, events and what partners are told: no heap, and nothing at all in the
/// ticks that say nothing.
pub(super) fn digest(output: &Output) -> u64 {
    let mut hash = Fnv(0xcbf2_9ce4_8422_2325);
    if let Some(request) = &output.driver_request {
        hash.take(request);
    }
    for event in &output.events {
        hash.take(event);
    }
    for said in &output.group {
        hash.take(said);
    }
    hash.0
}

struct Fnv(u64);

impl Fnv {
    fn take(&mut self, value: &impl Serialize) {
        // Writing into a number cannot fail, and what cannot be encoded would not differ.
        drop(rmp_serde::encode::write(self, value));
    }
}

impl Write for Fnv {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        for byte in bytes {
            self.0 = (self.0 ^ u64::from(*byte)).wrapping_mul(0x0000_0100_0000_01b3);
        }
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}
