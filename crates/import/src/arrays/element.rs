/// What the elements of a NumPy array are, and their byte order.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ElementType {
    /// The kind of number or text.
    pub kind: ElementKind,
    /// Bytes of one element (of the pointer, for objects, which take no room in the file).
    pub size: usize,
    /// Whether the most significant byte comes first.
    pub big_endian: bool,
}

/// Kinds of elements that are read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ElementKind {
    /// True or false, one byte.
    Bool,
    /// Signed integers of 1, 2, 4 or 8 bytes.
    Signed,
    /// Unsigned integers of 1, 2, 4 or 8 bytes.
    Unsigned,
    /// IEEE floating point of 2, 4 or 8 bytes.
    Float,
    /// Byte strings, padded with zeros.
    Bytes,
    /// Unicode strings of four bytes a character, padded with zeros.
    Unicode,
    /// Python objects, written as a pickle.
    Object,
}

impl ElementType {
    /// From NumPy's descriptor: `<f8`, `>i4`, `|S6`, `<U4`, `|O`; the byte order may be missing. `None` for what is
    /// not read: complex numbers, dates, records, long doubles.
    pub fn parse(descriptor: &str) -> Option<Self> {
        let (order, rest) = match descriptor.as_bytes().first()? {
            b'<' | b'>' | b'|' | b'=' => descriptor.split_at(1),
            _ => ("<", descriptor),
        };
        let kind = match rest.as_bytes().first()? {
            b'b' | b'?' => ElementKind::Bool,
            b'i' => ElementKind::Signed,
            b'u' => ElementKind::Unsigned,
            b'f' => ElementKind::Float,
            b'S' | b'a' => ElementKind::Bytes,
            b'U' => ElementKind::Unicode,
            b'O' => ElementKind::Object,
            _ => return None,
        };
        let digits = rest.get(1..)?;
        let number = match digits {
            "" if matches!(kind, ElementKind::Object | ElementKind::Bool) => 1,
            _ if digits.bytes().all(|b| b.is_ascii_digit()) => digits.parse::<usize>().ok()?,
            _ => return None,
        };
        let size = match kind {
            ElementKind::Unicode => number.checked_mul(4)?,
            _ => number,
        };
        let fits = match kind {
            ElementKind::Bool => size == 1,
            ElementKind::Signed | ElementKind::Unsigned => [1, 2, 4, 8].contains(&size),
            ElementKind::Float => [2, 4, 8].contains(&size),
            _ => true,
        };
        fits.then_some(Self { kind, size, big_endian: order == ">" })
    }

    /// Whether elements are numbers or truth values.
    pub fn is_numeric(self) -> bool {
        matches!(self.kind, ElementKind::Bool | ElementKind::Signed | ElementKind::Unsigned | ElementKind::Float)
    }

    /// Whether elements are texts.
    pub fn is_text(self) -> bool {
        matches!(self.kind, ElementKind::Bytes | ElementKind::Unicode)
    }

    /// One numeric element. Integers above 2^53 are rounded.
    pub(crate) fn number(self, bytes: &[u8]) -> f64 {
        let bits = self.bits(bytes);
        match (self.kind, self.size) {
            (ElementKind::Float, 8) => f64::from_bits(bits),
            (ElementKind::Float, 4) => f64::from(f32::from_bits(bits as u32)),
            (ElementKind::Float, _) => half(bits as u16),
            (ElementKind::Signed, _) => self.signed(bits) as f64,
            (ElementKind::Bool, _) => f64::from(u8::from(bits != 0)),
            _ => bits as f64,
        }
    }

    /// One element as an exact integer: of an integer type, or a floating-point number without a fraction.
    pub(crate) fn integer(self, bytes: &[u8]) -> Option<i64> {
        let bits = self.bits(bytes);
        match self.kind {
            ElementKind::Bool => Some(i64::from(bits != 0)),
            ElementKind::Signed => Some(self.signed(bits)),
            ElementKind::Unsigned => i64::try_from(bits).ok(),
            _ => {
                let x = self.number(bytes);
                (x.fract() == 0.0 && x.abs() <= 9.0e15).then_some(x as i64)
            }
        }
    }

    /// One text, without its padding.
    pub(crate) fn text(self, bytes: &[u8]) -> Option<String> {
        if self.kind == ElementKind::Bytes {
            let end = bytes.iter().rposition(|b| *b != 0).map_or(0, |at| at + 1);
            return String::from_utf8(bytes[..end].to_vec()).ok();
        }
        let codes = bytes.as_chunks::<4>().0;
        let mut text = codes
            .iter()
            .map(|c| char::from_u32(if self.big_endian { u32::from_be_bytes(*c) } else { u32::from_le_bytes(*c) }))
            .collect::<Option<String>>()?;
        text.truncate(text.trim_end_matches('\0').len());
        Some(text)
    }

    /// The bytes of a number as the low bits of a word.
    fn bits(self, bytes: &[u8]) -> u64 {
        let add = |word: u64, b: &u8| (word << 8) | u64::from(*b);
        if self.big_endian { bytes.iter().fold(0, add) } else { bytes.iter().rev().fold(0, add) }
    }

    fn signed(self, bits: u64) -> i64 {
        let unused = 64 - 8 * self.size as u32;
        ((bits << unused) as i64) >> unused
    }
}

/// IEEE half precision.
fn half(bits: u16) -> f64 {
    let sign = if bits >> 15 == 1 { -1.0 } else { 1.0 };
    let (exponent, fraction) = (i32::from(bits >> 10 & 31), f64::from(bits & 1023));
    sign * match exponent {
        0 => fraction * 2f64.powi(-24),
        31 if fraction == 0.0 => f64::INFINITY,
        31 => f64::NAN,
        _ => (1.0 + fraction / 1024.0) * 2f64.powi(exponent - 15),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn descriptors_and_their_numbers() {
        let read = |d: &str, bytes: &[u8]| ElementType::parse(d).unwrap().number(bytes);
        assert_eq!(read("<i2", &[0xfe, 0xff]), -2.0);
        assert_eq!(read(">i2", &[0xff, 0xfe]), -2.0);
        assert_eq!(read("|u1", &[200]), 200.0);
        assert_eq!(read(">f4", &1.5f32.to_be_bytes()), 1.5);
        assert_eq!(read("<f2", &[0x00, 0xc1]), -2.5);
        assert_eq!(read("<f2", &[0x01, 0x00]), 2f64.powi(-24));
        assert_eq!(read("|b1", &[1]), 1.0);
        assert_eq!(ElementType::parse("<u8").unwrap().integer(&[0xff; 8]), None);
        assert_eq!(ElementType::parse("<f8").unwrap().integer(&3f64.to_le_bytes()), Some(3));
        assert_eq!(ElementType::parse("|S6").unwrap().text(b"male\0\0").unwrap(), "male");
        for refused in ["<c16", "<M8[ns]", "<f16", "<i3", "", "<", "<f", "|V12", "<U99999999999999999999", "<i+4"] {
            assert_eq!(ElementType::parse(refused), None, "{refused}");
        }
    }
}
