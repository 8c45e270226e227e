use super::{ArrayLimits, ElementType};
use crate::place::excerpt;

/// What the head of an npy file says.
#[derive(Debug, PartialEq, Eq)]
pub struct Header {
    pub element: ElementType,
    pub fortran_order: bool,
    pub shape: Vec<usize>,
    /// Where the data begin.
    pub data: usize,
}

/// Longest header that is read: a shape and a type are a line.
const HEADER_BYTES: usize = 1 << 16;

impl Header {
    /// Reads the head of an npy file and holds its shape against the limits.
    pub fn parse(bytes: &[u8], limits: &ArrayLimits) -> Result<Self, String> {
        let cut = || "it is cut off inside its head; get the file again".to_owned();
        if !bytes.starts_with(b"\x93NUMPY") {
            return Err("it does not begin as a NumPy array; is it an .npy or .npz file?".into());
        }
        let (start, length) = match bytes.get(6).ok_or_else(cut)? {
            1 => (10, bytes.get(8..10).map(|b| usize::from(b[0]) | usize::from(b[1]) << 8)),
            2 | 3 => (12, bytes.get(8..12).and_then(|b| b.try_into().ok()).map(|b| u32::from_le_bytes(b) as usize)),
            other => return Err(format!("its NumPy format is version {other}; versions 1 to 3 are read")),
        };
        let length = length.ok_or_else(cut)?;
        if length > HEADER_BYTES {
            return Err(format!("its head states {length} bytes, more than {HEADER_BYTES}"));
        }
        let text = bytes.get(start..start + length).ok_or_else(cut)?;
        let text = std::str::from_utf8(text).map_err(|_| "its head is no text".to_owned())?;
        let header = Literal { rest: text }.header(start + length)?;
        header.check(limits)?;
        Ok(header)
    }

    pub fn check(&self, limits: &ArrayLimits) -> Result<(), String> {
        if self.shape.len() > limits.dimensions {
            return Err(format!("{} dimensions, more than {}", self.shape.len(), limits.dimensions));
        }
        // Elements are counted too, since a text of no characters takes no bytes; and sizes beside one of zero, since
        // rows without an entry are still rows.
        let count = self.shape.iter().try_fold(1u64, |n, d| n.checked_mul(*d.max(&1) as u64));
        let bytes = count.and_then(|n| n.checked_mul(self.element.size.max(1) as u64));
        match bytes {
            Some(bytes) if bytes <= limits.array_bytes => Ok(()),
            _ => Err(format!("its shape {:?} asks for more than {} bytes", self.shape, limits.array_bytes)),
        }
    }
}

/// The Python dictionary of the head, read left to right; only what NumPy writes.
struct Literal<'a> {
    rest: &'a str,
}

impl<'a> Literal<'a> {
    fn header(mut self, data: usize) -> Result<Header, String> {
        let bad = |what: &str| format!("its head {what}; write it with numpy.save");
        let (mut element, mut fortran_order, mut shape) = (None, None, None);
        self.expect("{").ok_or_else(|| bad("is no dictionary"))?;
        while !self.take("}") {
            let key = self.quoted().ok_or_else(|| bad("holds something that is no key"))?;
            self.expect(":").ok_or_else(|| bad("holds a key without a value"))?;
            let twice = match key {
                "descr" => {
                    let text = self.quoted().ok_or_else(|| bad("describes records, which are not read"))?;
                    let parsed = ElementType::parse(text)
                        .ok_or_else(|| format!("its elements are of type {:?}, which is not read", excerpt(text)))?;
                    element.replace(parsed).is_some()
                }
                "fortran_order" => {
                    let value = if self.take("True") { Some(true) } else { self.take("False").then_some(false) };
                    fortran_order.replace(value.ok_or_else(|| bad("has no order"))?).is_some()
                }
                "shape" => {
                    shape.replace(self.shape().ok_or_else(|| bad("has a shape that is no tuple of sizes"))?).is_some()
                }
                _ => return Err(bad(&format!("holds the unknown key {:?}", excerpt(key)))),
            };
            if twice {
                return Err(bad(&format!("states {key} twice")));
            }
            if !self.take(",") {
                self.expect("}").ok_or_else(|| bad("does not end"))?;
                break;
            }
        }
        if !self.rest.trim().is_empty() {
            return Err(bad("goes on after its end"));
        }
        match (element, fortran_order, shape) {
            (Some(element), Some(fortran_order), Some(shape)) => Ok(Header { element, fortran_order, shape, data }),
            _ => Err(bad("lacks descr, fortran_order or shape")),
        }
    }

    fn take(&mut self, token: &str) -> bool {
        let rest = self.rest.trim_start().strip_prefix(token);
        self.rest = rest.unwrap_or(self.rest);
        rest.is_some()
    }

    fn expect(&mut self, token: &str) -> Option<()> {
        self.take(token).then_some(())
    }

    fn quoted(&mut self) -> Option<&'a str> {
        let rest = self.rest.trim_start();
        let quote = rest.chars().next().filter(|c| matches!(c, '\'' | '"'))?;
        let (text, rest) = rest[1..].split_once(quote)?;
        self.rest = rest;
        Some(text)
    }

    /// `()`, `(3,)`, `(3, 4)`; Python 2 wrote `(3L,)`.
    fn shape(&mut self) -> Option<Vec<usize>> {
        let mut shape = Vec::new();
        self.expect("(")?;
        while !self.take(")") {
            let rest = self.rest.trim_start();
            let end = rest.find(|c: char| !c.is_ascii_digit()).unwrap_or(rest.len());
            shape.push(rest[..end].parse().ok()?);
            self.rest = &rest[end..];
            self.take("L");
            if !self.take(",") {
                self.expect(")")?;
                break;
            }
        }
        Some(shape)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn npy(head: &str) -> Vec<u8> {
        let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
        bytes.extend((head.len() as u16).to_le_bytes());
        bytes.extend(head.as_bytes());
        bytes
    }

    #[test]
    fn heads_of_both_pythons() {
        let limits = ArrayLimits::default();
        let parse = |h: &str| Header::parse(&npy(h), &limits);
        let head = "{'descr': '<f8', 'fortran_order': True, 'shape': (3, 4), }   \n";
        let new = parse(head).unwrap();
        assert_eq!((new.shape, new.fortran_order, new.data), (vec![3, 4], true, 10 + head.len()));
        let old = parse("{\"shape\": (7L,), \"fortran_order\": False, \"descr\": \"|S3\"}").unwrap();
        assert_eq!((old.shape, old.element.size), (vec![7], 3));
        assert!(parse("{'descr': '<U4', 'fortran_order': False, 'shape': ()}").unwrap().shape.is_empty());
    }

    #[test]
    fn hostile_heads_are_refused() {
        let limits = ArrayLimits::default();
        let whole = "'fortran_order': False, 'shape': (3,)";
        for (head, says) in [
            (format!("{{'descr': '<c16', {whole}}}"), "not read"),
            (format!("{{'descr': [('a', '<f8')], {whole}}}"), "records"),
            ("{'descr': '<f8', 'fortran_order': False, 'shape': (4294967296, 4294967296)}".into(), "asks for"),
            ("{'descr': '|S0', 'fortran_order': False, 'shape': (99999999999,)}".into(), "asks for"),
            ("{'descr': '<f8', 'fortran_order': False, 'shape': (-1,)}".into(), "tuple"),
            ("{'descr': '<f8', 'fortran_order': False, 'shape': (1,1,1,1,1,1,1,1,1)}".into(), "dimensions"),
            (format!("{{'descr': '<f8', 'descr': '<f8', {whole}}}"), "twice"),
            (format!("{{'descr': '<f8', {whole}"), "does not end"),
            (format!("{{'descr': '<f8', {whole}, 'x': 1}}"), "unknown key"),
            // Neither letters of two bytes nor their number are a fault of their own.
            (format!("{{'x{}': 1}}", "\u{e9}".repeat(100)), "unknown key"),
            ("{'descr': '<f8', 'fortran_order': False, 'shape': (1000000000000000000, 0)}".into(), "asks for"),
            ("{'shape': (3,)}".into(), "lacks"),
        ] {
            let message = Header::parse(&npy(&head), &limits).unwrap_err();
            assert!(message.contains(says), "{head}: {message}");
        }
        let mut huge = b"\x93NUMPY\x02\x00".to_vec();
        huge.extend(u32::MAX.to_le_bytes());
        assert!(Header::parse(&huge, &limits).unwrap_err().contains("states 4294967295"));
        assert!(Header::parse(b"\x93NUMPY\x01", &limits).unwrap_err().contains("cut off"));
        assert!(Header::parse(b"PK", &limits).unwrap_err().contains("does not begin"));
    }
}
