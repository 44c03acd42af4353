//! Numbers of any width in bytes: bits from the lowest up, and variable-length integers.

use super::DecodeError;

/// Appends a number, seven bits to a byte, the lowest first; all but the last byte have bit 7 set.
pub fn push_varint(mut value: u64, out: &mut Vec<u8>) {
    while value >= 0x80 {
        out.push(value as u8 | 0x80);
        value >>= 7;
    }
    out.push(value as u8);
}

/// Appends numbers of `width` bits each, the lowest bit first, up to the next whole byte.
pub fn push_bits(values: impl Iterator<Item = u32>, width: u32, out: &mut Vec<u8>) {
    let (mut held, mut count) = (0u64, 0);
    for value in values {
        held |= u64::from(value) << count;
        count += width;
        while count >= 8 {
            out.push(held as u8);
            held >>= 8;
            count -= 8;
        }
    }
    if count > 0 {
        out.push(held as u8);
    }
}

/// What is left to read of a message.
pub struct Reader<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl<'a> Reader<'a> {
    pub fn new(bytes: &'a [u8]) -> Reader<'a> {
        Reader { bytes, at: 0 }
    }

    /// An error at the byte that was read last.
    pub fn wrong(&self, what: &'static str) -> DecodeError {
        DecodeError { at: self.at.saturating_sub(1), what }
    }

    pub fn take(&mut self, count: usize) -> Result<&'a [u8], DecodeError> {
        let left = &self.bytes[self.at..];
        let taken = left
            .get(..count)
            .ok_or(DecodeError { at: self.bytes.len(), what: "the message ends too early" })?;
        self.at += count;
        Ok(taken)
    }

    pub fn byte(&mut self) -> Result<u8, DecodeError> {
        Ok(self.take(1)?[0])
    }

    pub fn rest(&mut self) -> &'a [u8] {
        let rest = &self.bytes[self.at..];
        self.at = self.bytes.len();
        rest
    }

    pub fn varint(&mut self) -> Result<u64, DecodeError> {
        let mut value = 0u64;
        for shift in (0..64).step_by(7) {
            let byte = self.byte()?;
            let bits = u64::from(byte & 0x7f);
            if shift == 63 && bits > 1 {
                break;
            }
            value |= bits << shift;
            if byte & 0x80 == 0 {
                return Ok(value);
            }
        }
        Err(self.wrong("a number has more than 64 bits"))
    }

    pub fn varint_u32(&mut self) -> Result<u32, DecodeError> {
        let value = self.varint()?;
        u32::try_from(value).map_err(|_| self.wrong("a number has more than 32 bits"))
    }

    /// Reads numbers of `width` bits, at most 32, up to the next whole byte.
    pub fn bits(
        &mut self,
        width: u32,
        count: usize,
    ) -> Result<impl Iterator<Item = u32> + use<'a>, DecodeError> {
        let mut bytes = self.take((width as usize * count).div_ceil(8))?.iter();
        let (mut held, mut there) = (0u64, 0);
        Ok((0..count).map(move |_| {
            while there < width {
                held |= u64::from(*bytes.next().expect("as many were taken")) << there;
                there += 8;
            }
            let value = (held & ((1 << width) - 1)) as u32;
            held >>= width;
            there -= width;
            value
        }))
    }
}
