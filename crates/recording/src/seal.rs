//! The seal: a private record behind each pose that closes the holes MCAP's own checksums leave, and by which a reader finds
//! its way again after damage.
//!
//! ```text
//! offset  bytes  field (little-endian)
//!      0     16  mark, fixed
//!     16      1  kind: 0 head of the file, 1 a whole pose, 2 a chunk without a whole pose
//!     17      4  index of the pose
//!     21      4  number of frames
//!     25      8  offset of this record in the file
//!     33      8  offset where the bytes covered begin: the end of the seal before, or 0
//!     41      8  offset of the chunk record (0: none)
//!     49      8  length of the chunk record, head included
//!     57     16  commanded tilt and spin, radians, f64
//!     73     16  first and last log time, ns
//!     89      4  CRC-32 of the bytes covered, up to this record
//!     93      4  CRC-32 of the 93 bytes above
//! ```

use crate::bytes::Bytes;

/// Length of a seal's body.
pub(crate) const BODY: u64 = 97;
/// First bytes of every seal's body: not text, not zeros, unlikely by chance.
pub(crate) const MARK: [u8; 16] = *b"\x8fgonio\xfe\x1aseal\x01\r\n\xf5";

/// What a seal closes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Kind {
    /// Header and attachments.
    Head = 0,
    /// A whole pose.
    Pose = 1,
    /// A chunk without a whole pose: events after the last one, or a pose given up.
    Other = 2,
}

/// A seal. It names the chunk it closes, so that a damaged length field does not hide it.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Seal {
    pub kind: Kind,
    pub pose: u32,
    pub frames: u32,
    pub offset: u64,
    pub covered_from: u64,
    pub chunk_offset: u64,
    pub chunk_length: u64,
    pub commanded_radians: [f64; 2],
    pub first_time: u64,
    pub last_time: u64,
    pub covered_crc: u32,
}

impl Seal {
    /// End of the whole record.
    pub(crate) const fn end(&self) -> u64 {
        self.offset.saturating_add(crate::layout::RECORD_HEAD + BODY)
    }

    pub(crate) fn encode(&self) -> Vec<u8> {
        let mut b = Vec::with_capacity(BODY as usize);
        b.extend_from_slice(&MARK);
        b.push(self.kind as u8);
        b.extend_from_slice(&self.pose.to_le_bytes());
        b.extend_from_slice(&self.frames.to_le_bytes());
        for v in [self.offset, self.covered_from, self.chunk_offset, self.chunk_length] {
            b.extend_from_slice(&v.to_le_bytes());
        }
        for v in self.commanded_radians {
            b.extend_from_slice(&v.to_le_bytes());
        }
        b.extend_from_slice(&self.first_time.to_le_bytes());
        b.extend_from_slice(&self.last_time.to_le_bytes());
        b.extend_from_slice(&self.covered_crc.to_le_bytes());
        let own = crc32fast::hash(&b);
        b.extend_from_slice(&own.to_le_bytes());
        b
    }

    /// Reads a seal's body that stands in the record at `offset`; `None` where it does not verify.
    pub(crate) fn decode(body: &[u8], offset: u64) -> Option<Self> {
        if body.len() as u64 != BODY {
            return None;
        }
        let mut b = Bytes::new(body);
        if b.take(16)? != MARK {
            return None;
        }
        let kind = match b.u8()? {
            0 => Kind::Head,
            1 => Kind::Pose,
            2 => Kind::Other,
            _ => return None,
        };
        let seal = Self {
            kind,
            pose: b.u32()?,
            frames: b.u32()?,
            offset: b.u64()?,
            covered_from: b.u64()?,
            chunk_offset: b.u64()?,
            chunk_length: b.u64()?,
            commanded_radians: [b.f64()?, b.f64()?],
            first_time: b.u64()?,
            last_time: b.u64()?,
            covered_crc: b.u32()?,
        };
        let own = b.u32()?;
        let (checked, _) = body.split_at_checked(body.len() - 4)?;
        let inside = seal.offset == offset
            && seal.covered_from <= offset
            && seal.chunk_offset.checked_add(seal.chunk_length).is_some_and(|end| end <= offset);
        (own == crc32fast::hash(checked) && inside).then_some(seal)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_seal_survives_a_round_trip_and_no_flipped_bit() {
        let seal = Seal {
            kind: Kind::Pose,
            pose: 7,
            frames: 12,
            offset: 5000,
            covered_from: 400,
            chunk_offset: 400,
            chunk_length: 4500,
            commanded_radians: [0.3, -1.5],
            first_time: 1,
            last_time: 2,
            covered_crc: 0xdead_beef,
        };
        let bytes = seal.encode();
        assert_eq!(bytes.len() as u64, BODY);
        assert_eq!(Seal::decode(&bytes, 5000).as_ref(), Some(&seal));
        assert_eq!(Seal::decode(&bytes, 5001), None, "a copy elsewhere is not a seal");
        for bit in 0..bytes.len() * 8 {
            let mut b = bytes.clone();
            b[bit / 8] ^= 1 << (bit % 8);
            assert_eq!(Seal::decode(&b, 5000), None, "bit {bit}");
        }
    }
}
