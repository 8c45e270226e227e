//! Texts of protocols 0 and 1, which are written in escapes.

/// Python's `raw-unicode-escape`: Latin-1 with `\\uXXXX` and `\\UXXXXXXXX`.
pub fn raw_unicode(line: &[u8]) -> Option<String> {
    let mut text = String::with_capacity(line.len());
    let mut at = 0;
    while let Some(byte) = line.get(at) {
        let digits = match (byte, line.get(at + 1)) {
            (b'\\', Some(b'u')) => 4,
            (b'\\', Some(b'U')) => 8,
            _ => {
                text.push(char::from(*byte));
                at += 1;
                continue;
            }
        };
        let code = std::str::from_utf8(line.get(at + 2..at + 2 + digits)?).ok()?;
        text.push(char::from_u32(u32::from_str_radix(code, 16).ok()?)?);
        at += 2 + digits;
    }
    Some(text)
}

/// The escapes of Python 2's `repr` of a byte string.
pub fn unescape(text: &[u8]) -> Option<Vec<u8>> {
    let mut bytes = Vec::with_capacity(text.len());
    let mut at = 0;
    while let Some(byte) = text.get(at) {
        at += 1;
        if *byte != b'\\' {
            bytes.push(*byte);
            continue;
        }
        at += 1;
        bytes.push(match text.get(at - 1)? {
            b'n' => b'\n',
            b'r' => b'\r',
            b't' => b'\t',
            b'x' => {
                at += 2;
                u8::from_str_radix(std::str::from_utf8(text.get(at - 2..at)?).ok()?, 16).ok()?
            }
            other @ (b'\\' | b'\'' | b'"') => *other,
            _ => return None,
        });
    }
    Some(bytes)
}
