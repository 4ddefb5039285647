//! Numbers in MessagePack that are infinite or not a number.
//!
//! JSON has no words for them, MessagePack has. No field of any message means anything by them, and
//! some checks of a range let `NaN` through; so they are looked for once, in the bytes, before a
//! message is made of them, whatever its type. The walk is one pass that takes nothing apart: of
//! numbers it looks at the exponent, over texts it steps. What it cannot follow it leaves to the
//! decoder, which refuses it.
//!
//! Source: MessagePack specification, `spec.md` of msgpack/msgpack, section "Formats".

use std::fmt::Write as _;

/// Deepest nesting that is followed: more than the decoder takes.
const MAX_DEPTH: usize = 1100;

/// The first number in `bytes` that is not finite, with the path of its field, such as
/// `params.trajectory.waypoints[3].joint_position[1]`.
pub(crate) fn first_not_finite(bytes: &[u8]) -> Option<(String, f64)> {
    let mut walk = Walk { rest: bytes, open: Vec::with_capacity(16) };
    walk.run().map(|value| (walk.path(), value))
}

struct Walk<'a> {
    rest: &'a [u8],
    open: Vec<Open<'a>>,
}

/// An array or map whose elements are being looked at.
struct Open<'a> {
    is_map: bool,
    /// Elements that are still to come, keys and values each.
    left: usize,
    /// Elements seen.
    seen: usize,
    /// Bytes of the newest key, if it is a text.
    key: &'a [u8],
}

/// What one element is.
enum Element<'a> {
    Number(f64),
    Text(&'a [u8]),
    /// Of no interest.
    Other,
    Array(usize),
    Map(usize),
}

impl<'a> Walk<'a> {
    /// The first number that is not finite; the way to it is left open.
    fn run(&mut self) -> Option<f64> {
        loop {
            match self.element()? {
                Element::Number(value) if !value.is_finite() => return Some(value),
                Element::Number(_) | Element::Other => {}
                Element::Text(text) => self.note_key(text),
                Element::Array(left) => {
                    self.enter(false, left)?;
                    continue;
                }
                Element::Map(pairs) => {
                    self.enter(true, pairs.checked_mul(2)?)?;
                    continue;
                }
            }
            self.step()?;
        }
    }

    fn enter(&mut self, is_map: bool, left: usize) -> Option<()> {
        if left == 0 {
            return self.step();
        }
        if self.open.len() >= MAX_DEPTH {
            return None;
        }
        self.open.push(Open { is_map, left, seen: 0, key: &[] });
        if !is_map {
            self.pass_finite();
        }
        Some(())
    }

    /// Goes over the finite numbers at the beginning of an array, quickly: most of a large message
    /// is such rows. The last element is left to [`step`](Self::step).
    fn pass_finite(&mut self) {
        let Some(top) = self.open.last_mut() else { return };
        while top.left > 1
            && let Some((&[0xcb, number @ ..], rest)) = self.rest.split_first_chunk::<9>()
            && f64::from_be_bytes(number).is_finite()
        {
            self.rest = rest;
            top.seen += 1;
            top.left -= 1;
        }
    }

    /// An element is over, and with it all that it was the last of; none at the end.
    fn step(&mut self) -> Option<()> {
        loop {
            let top = self.open.last_mut()?;
            top.seen += 1;
            top.left -= 1;
            if top.left > 0 {
                return Some(());
            }
            self.open.pop();
        }
    }

    fn note_key(&mut self, text: &'a [u8]) {
        if let Some(top) = self.open.last_mut().filter(|top| top.is_map && top.seen % 2 == 0) {
            top.key = text;
        }
    }

    fn element(&mut self) -> Option<Element<'a>> {
        let [marker] = self.take()?;
        Some(match marker {
            0xcb => Element::Number(f64::from_be_bytes(self.take()?)),
            0xca => Element::Number(f64::from(f32::from_be_bytes(self.take()?))),
            0x00..=0x7f | 0xc0..=0xc3 | 0xe0..=0xff => Element::Other,
            0x80..=0x8f => Element::Map(usize::from(marker & 0x0f)),
            0x90..=0x9f => Element::Array(usize::from(marker & 0x0f)),
            0xa0..=0xbf => Element::Text(self.skip(usize::from(marker & 0x1f))?),
            // Binary data and extensions, with their length.
            0xc4..=0xc6 => self.other(1 << (marker - 0xc4), 0)?,
            0xc7..=0xc9 => self.other(1 << (marker - 0xc7), 1)?,
            // Integers of 1, 2, 4 and 8 bytes, extensions of 1, 2, 4, 8 and 16 and their kind.
            0xcc..=0xcf => self.skipped(1 << (marker - 0xcc))?,
            0xd0..=0xd3 => self.skipped(1 << (marker - 0xd0))?,
            0xd4..=0xd8 => self.skipped(1 + (1 << (marker - 0xd4)))?,
            0xd9..=0xdb => {
                let len = self.length(1 << (marker - 0xd9))?;
                Element::Text(self.skip(len)?)
            }
            0xdc | 0xdd => Element::Array(self.length(2 << (marker - 0xdc))?),
            0xde | 0xdf => Element::Map(self.length(2 << (marker - 0xde))?),
        })
    }

    fn other(&mut self, width: usize, more: usize) -> Option<Element<'a>> {
        let len = self.length(width)?.checked_add(more)?;
        self.skipped(len)
    }

    fn skipped(&mut self, count: usize) -> Option<Element<'a>> {
        self.skip(count).map(|_| Element::Other)
    }

    /// A length of `width` bytes, the highest first.
    fn length(&mut self, width: usize) -> Option<usize> {
        let bytes = self.skip(width)?;
        Some(bytes.iter().fold(0, |len, &byte| len << 8 | usize::from(byte)))
    }

    fn take<const N: usize>(&mut self) -> Option<[u8; N]> {
        let (taken, rest) = self.rest.split_first_chunk()?;
        self.rest = rest;
        Some(*taken)
    }

    fn skip(&mut self, count: usize) -> Option<&'a [u8]> {
        let (skipped, rest) = self.rest.split_at_checked(count)?;
        self.rest = rest;
        Some(skipped)
    }

    fn path(&self) -> String {
        let mut path = String::new();
        for open in &self.open {
            if open.is_map {
                let dot = if path.is_empty() { "" } else { "." };
                // Writing into a string does not fail.
                let _ = write!(path, "{dot}{}", String::from_utf8_lossy(open.key));
            } else {
                let _ = write!(path, "[{}]", open.seen);
            }
        }
        path
    }
}

#[cfg(test)]
mod tests {
    use super::first_not_finite;

    /// Every kind of element before the number, each of every width.
    #[test]
    fn a_number_is_found_behind_whatever_else_there_is() {
        let elements: [&[u8]; 31] = [
            &[0x07],
            &[0xff],
            &[0xc0],
            &[0xc2],
            &[0xc3],
            &[0xa2, b'a', b'b'],
            &[0x80],
            &[0x81, 0x01, 0x90],
            &[0x90],
            &[0x92, 0x01, 0x02],
            &[0xc4, 2, 0xcb, 0xcb],
            &[0xc5, 0, 1, 0xcb],
            &[0xc6, 0, 0, 0, 1, 0xcb],
            &[0xc7, 1, 5, 0xcb],
            &[0xc8, 0, 1, 5, 0xcb],
            &[0xc9, 0, 0, 0, 1, 5, 0xcb],
            &[0xca, 0x3f, 0x80, 0, 0],
            &[0xcb, 0x3f, 0xf0, 0, 0, 0, 0, 0, 0],
            &[0xcc, 0xcb],
            &[0xcd, 0xcb, 0],
            &[0xce, 0xcb, 0, 0, 0],
            &[0xcf, 0xcb, 0, 0, 0, 0, 0, 0, 0],
            &[0xd0, 0xcb],
            &[0xd3, 0xcb, 0, 0, 0, 0, 0, 0, 0],
            &[0xd4, 0, 0xcb],
            &[0xd8, 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 16],
            &[0xd9, 1, 0xcb],
            &[0xda, 0, 1, 0xcb],
            &[0xdb, 0, 0, 0, 1, 0xcb],
            &[0xdc, 0, 1, 0xc0],
            &[0xdf, 0, 0, 0, 1, 0xa1, b'k', 0xdd, 0, 0, 0, 1, 0xc0],
        ];
        let bad: [(&[u8], f64); 2] = [
            (&[0xca, 0x7f, 0x80, 0, 0], f64::INFINITY),
            (&[0xcb, 0xff, 0xf0, 0, 0, 0, 0, 0, 0], f64::NEG_INFINITY),
        ];
        for (bytes, value) in bad {
            for element in elements {
                // {"x": [element, bad]}
                let whole = [&[0x81, 0xa1, b'x', 0x92], element, bytes].concat();
                assert_eq!(first_not_finite(&whole), Some(("x[1]".to_owned(), value)), "{whole:?}");
                let (_, without) = whole.split_last().expect("bytes");
                assert_eq!(first_not_finite(without), None, "cut off: left to the decoder");
            }
        }
    }

    #[test]
    fn nesting_without_end_is_left_to_the_decoder() {
        assert_eq!(first_not_finite(&[0x91; 5000]), None);
        assert_eq!(first_not_finite(&[]), None);
        assert_eq!(first_not_finite(&[0xdd, 0xff, 0xff, 0xff, 0xff]), None);
    }
}
