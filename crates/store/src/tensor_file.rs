use crate::atomic::regular;
use crate::{Result, StoreError, write_atomic};
use serde::de::{MapAccess, Visitor};
use serde::{Deserialize, Deserializer, Serialize};
use std::collections::BTreeMap;
use std::fs::File;
use std::io::{Read, Seek, SeekFrom, Write};
use std::ops::Range;
use std::path::{Path, PathBuf};

/// Element types that our files use.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum DType {
    /// 32-bit float.
    F32,
    /// 64-bit float.
    F64,
    /// 16-bit float, kept as raw bits.
    F16,
    /// 32-bit unsigned.
    U32,
    /// 64-bit unsigned.
    U64,
    /// Signed byte.
    I8,
    /// Byte.
    U8,
}

impl DType {
    /// Bytes an element.
    pub fn size(self) -> usize {
        match self {
            Self::F32 | Self::U32 => 4,
            Self::F64 | Self::U64 => 8,
            Self::F16 => 2,
            Self::I8 | Self::U8 => 1,
        }
    }
}

/// What a reader is willing to accept.
#[derive(Clone, Copy, Debug)]
pub struct Limits {
    /// Bytes of the JSON header. Default 8 MiB.
    pub header_bytes: u64,
    /// Bytes of the whole file. Default 64 GiB: tensors are read one by one.
    pub file_bytes: u64,
    /// Number of tensors. Default 4096.
    pub tensors: usize,
}

impl Default for Limits {
    fn default() -> Self {
        Self { header_bytes: 8 << 20, file_bytes: 64 << 30, tensors: 4096 }
    }
}

#[derive(Clone, Debug, Serialize, Deserialize)]
struct Entry {
    dtype: DType,
    shape: Vec<usize>,
    data_offsets: [u64; 2],
}

/// Collects named arrays and writes them as one safetensors file. Names are written in sorted order,
/// so that the same content gives the same bytes.
#[derive(Default)]
pub struct TensorFileWriter<'a> {
    meta: BTreeMap<String, String>,
    tensors: BTreeMap<String, (DType, Vec<usize>, Payload<'a>)>,
}

enum Payload<'a> {
    F32(&'a [f32]),
    Bytes(Vec<u8>),
}

impl<'a> TensorFileWriter<'a> {
    /// An empty file.
    pub fn new() -> Self {
        Self::default()
    }
    /// Adds a text to the header's `__metadata__`.
    pub fn meta(&mut self, key: &str, value: impl Into<String>) -> &mut Self {
        self.meta.insert(key.to_owned(), value.into());
        self
    }
    /// Adds an f32 array. Panics if the shape does not match the length (a programming error).
    pub fn f32(&mut self, name: &str, shape: &[usize], data: &'a [f32]) -> &mut Self {
        assert_eq!(shape.iter().product::<usize>(), data.len(), "shape of {name}");
        self.tensors.insert(name.to_owned(), (DType::F32, shape.to_vec(), Payload::F32(data)));
        self
    }
    /// Adds a u32 array.
    pub fn u32(&mut self, name: &str, shape: &[usize], data: &[u32]) -> &mut Self {
        assert_eq!(shape.iter().product::<usize>(), data.len(), "shape of {name}");
        let bytes = data.iter().flat_map(|x| x.to_le_bytes()).collect();
        self.raw(name, DType::U32, shape, bytes)
    }
    /// Adds an f64 array.
    pub fn f64(&mut self, name: &str, shape: &[usize], data: &[f64]) -> &mut Self {
        assert_eq!(shape.iter().product::<usize>(), data.len(), "shape of {name}");
        let bytes = data.iter().flat_map(|x| x.to_le_bytes()).collect();
        self.raw(name, DType::F64, shape, bytes)
    }
    /// Adds little-endian bytes of any type.
    pub fn raw(&mut self, name: &str, dtype: DType, shape: &[usize], bytes: Vec<u8>) -> &mut Self {
        assert_eq!(shape.iter().product::<usize>() * dtype.size(), bytes.len(), "bytes of {name}");
        self.tensors.insert(name.to_owned(), (dtype, shape.to_vec(), Payload::Bytes(bytes)));
        self
    }
    /// Writes the file atomically.
    pub fn write(&self, path: &Path) -> Result<()> {
        write_atomic(path, |w| self.write_to(w))
    }
    /// The file's bytes.
    pub fn to_bytes(&self) -> Vec<u8> {
        let mut bytes = Vec::new();
        self.write_to(&mut bytes).expect("memory takes everything");
        bytes
    }

    fn write_to(&self, w: &mut dyn Write) -> std::io::Result<()> {
        let mut header = serde_json::Map::new();
        if !self.meta.is_empty() {
            header.insert("__metadata__".into(), serde_json::json!(self.meta));
        }
        let mut offset = 0u64;
        for (name, (dtype, shape, _)) in &self.tensors {
            let bytes = (shape.iter().product::<usize>() * dtype.size()) as u64;
            let entry = Entry { dtype: *dtype, shape: shape.clone(), data_offsets: [offset, offset + bytes] };
            header.insert(name.clone(), serde_json::json!(entry));
            offset += bytes;
        }
        let mut text = serde_json::Value::Object(header).to_string().into_bytes();
        text.resize(text.len().next_multiple_of(8), b' ');
        w.write_all(&(text.len() as u64).to_le_bytes())?;
        w.write_all(&text)?;
        for (_, _, payload) in self.tensors.values() {
            match payload {
                Payload::Bytes(bytes) => w.write_all(bytes)?,
                Payload::F32(data) => {
                    let mut block = Vec::with_capacity(1 << 16);
                    for chunk in data.chunks(1 << 14) {
                        block.clear();
                        block.extend(chunk.iter().flat_map(|x| x.to_le_bytes()));
                        w.write_all(&block)?;
                    }
                }
            }
        }
        Ok(())
    }
}

/// An open safetensors file: the header is checked at once, data is read on demand.
#[derive(Debug)]
pub struct TensorFile {
    path: PathBuf,
    /// The file's bytes, where it lies in memory and not on disk.
    held: Option<Vec<u8>>,
    data_start: u64,
    meta: BTreeMap<String, String>,
    entries: BTreeMap<String, Entry>,
}

impl TensorFile {
    /// Opens with default limits.
    pub fn open(path: &Path) -> Result<Self> {
        Self::open_limited(path, Limits::default())
    }

    /// Opens and checks the header against the file's real length.
    pub fn open_limited(path: &Path, limits: Limits) -> Result<Self> {
        let io = |e| StoreError::io("read", path, e);
        let length = regular(path)?;
        let mut file = File::open(path).map_err(io)?;
        Self::with_header(path, &mut file, length, limits)
    }

    /// A file that lies in memory; errors call it `name`.
    pub fn from_bytes(name: &Path, bytes: Vec<u8>, limits: Limits) -> Result<Self> {
        let mut file = Self::with_header(name, &mut bytes.as_slice(), bytes.len() as u64, limits)?;
        file.held = Some(bytes);
        Ok(file)
    }

    fn with_header(path: &Path, file: &mut impl Read, length: u64, limits: Limits) -> Result<Self> {
        let io = |e| StoreError::io("read", path, e);
        let bad = |reason: String| StoreError::corrupt(path, reason);
        if length > limits.file_bytes {
            return Err(StoreError::Limit {
                path: path.to_owned(),
                reason: format!("{length} bytes, at most {}", limits.file_bytes),
            });
        }
        let mut word = [0u8; 8];
        if length < 8 {
            return Err(bad(format!("{length} bytes are too few for a tensor file; make it again")));
        }
        file.read_exact(&mut word).map_err(io)?;
        let header_bytes = u64::from_le_bytes(word);
        if header_bytes > limits.header_bytes || header_bytes > length - 8 {
            return Err(bad(format!(
                "its header claims {header_bytes} bytes of a {length}-byte file; it is truncated or no tensor file"
            )));
        }
        let mut text = vec![0u8; header_bytes as usize];
        file.read_exact(&mut text).map_err(io)?;
        let header: Header =
            serde_json::from_slice(&text).map_err(|e| bad(format!("its header is broken ({e}); make it again")))?;
        if header.entries.len() > limits.tensors {
            return Err(StoreError::Limit {
                path: path.to_owned(),
                reason: format!("{} tensors, at most {}", header.entries.len(), limits.tensors),
            });
        }
        check_layout(&header.entries, length - 8 - header_bytes).map_err(bad)?;
        let Header { meta, entries } = header;
        Ok(Self { path: path.to_owned(), held: None, data_start: 8 + header_bytes, meta, entries })
    }

    /// Where the file lies.
    pub fn path(&self) -> &Path {
        &self.path
    }
    /// Names in sorted order.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.entries.keys().map(String::as_str)
    }
    /// A text of the header's metadata.
    pub fn meta(&self, key: &str) -> Option<&str> {
        self.meta.get(key).map(String::as_str)
    }
    /// A text that must be there.
    pub fn require_meta(&self, key: &str) -> Result<&str> {
        self.meta(key)
            .ok_or_else(|| StoreError::corrupt(&self.path, format!("metadata {key:?} is missing; make it again")))
    }
    /// Type and shape of a tensor, if it is there.
    pub fn shape(&self, name: &str) -> Option<(DType, &[usize])> {
        self.entries.get(name).map(|e| (e.dtype, e.shape.as_slice()))
    }
    /// Type and shape of a tensor that must be there with `rank` axes.
    pub fn require_shape(&self, name: &str, rank: usize) -> Result<&[usize]> {
        let entry = self.entry(name)?;
        if entry.shape.len() != rank {
            return Err(StoreError::corrupt(
                &self.path,
                format!("tensor {name:?} has shape {:?}, expected {rank} axes", entry.shape),
            ));
        }
        Ok(&entry.shape)
    }
    /// A whole f32 tensor.
    pub fn f32(&self, name: &str) -> Result<Vec<f32>> {
        let rows = self.entry(name)?.shape.first().copied().unwrap_or(1);
        self.f32_rows(name, 0..rows)
    }
    /// Rows (first axis) of an f32 tensor; only these bytes are read.
    pub fn f32_rows(&self, name: &str, rows: Range<usize>) -> Result<Vec<f32>> {
        let bytes = self.bytes(name, DType::F32, Some(rows))?;
        Ok(bytes.as_chunks::<4>().0.iter().map(|b| f32::from_le_bytes(*b)).collect())
    }
    /// A whole f64 tensor.
    pub fn f64(&self, name: &str) -> Result<Vec<f64>> {
        let bytes = self.bytes(name, DType::F64, None)?;
        Ok(bytes.as_chunks::<8>().0.iter().map(|b| f64::from_le_bytes(*b)).collect())
    }
    /// A whole u32 tensor.
    pub fn u32(&self, name: &str) -> Result<Vec<u32>> {
        let bytes = self.bytes(name, DType::U32, None)?;
        Ok(bytes.as_chunks::<4>().0.iter().map(|b| u32::from_le_bytes(*b)).collect())
    }
    /// Raw little-endian bytes of a tensor of the given type, whole or by rows.
    pub fn bytes(&self, name: &str, dtype: DType, rows: Option<Range<usize>>) -> Result<Vec<u8>> {
        let entry = self.entry(name)?;
        if entry.dtype != dtype {
            return Err(StoreError::corrupt(
                &self.path,
                format!("tensor {name:?} holds {:?}, expected {dtype:?}", entry.dtype),
            ));
        }
        let [mut start, mut end] = entry.data_offsets;
        if let (Some(rows), Some(&count)) = (rows, entry.shape.first()) {
            if rows.end > count || rows.start > rows.end {
                return Err(StoreError::corrupt(
                    &self.path,
                    format!("tensor {name:?} has {count} rows, asked for {rows:?}"),
                ));
            }
            let stride = if count == 0 { 0 } else { (end - start) / count as u64 };
            (start, end) = (start + rows.start as u64 * stride, start + rows.end as u64 * stride);
        }
        if let Some(held) = &self.held {
            // The layout was checked against the length.
            return Ok(held[(self.data_start + start) as usize..(self.data_start + end) as usize].to_vec());
        }
        let io = |e| StoreError::io("read", &self.path, e);
        let mut file = File::open(&self.path).map_err(io)?;
        file.seek(SeekFrom::Start(self.data_start + start)).map_err(io)?;
        let mut bytes = vec![0u8; (end - start) as usize];
        file.read_exact(&mut bytes).map_err(io)?;
        Ok(bytes)
    }

    fn entry(&self, name: &str) -> Result<&Entry> {
        self.entries
            .get(name)
            .ok_or_else(|| StoreError::corrupt(&self.path, format!("tensor {name:?} is missing; make it again")))
    }
}

/// Every byte of the data belongs to exactly one tensor.
fn check_layout(entries: &BTreeMap<String, Entry>, data_bytes: u64) -> std::result::Result<(), String> {
    let mut spans = Vec::with_capacity(entries.len());
    for (name, entry) in entries {
        let elements = entry.shape.iter().try_fold(1u64, |n, &d| n.checked_mul(d as u64));
        let bytes = elements.and_then(|n| n.checked_mul(entry.dtype.size() as u64));
        let [start, end] = entry.data_offsets;
        if bytes.is_none() || end < start || Some(end - start) != bytes {
            return Err(format!(
                "tensor {name:?} of shape {:?} claims bytes {start}..{end}; make it again",
                entry.shape
            ));
        }
        spans.push((start, end, name));
    }
    spans.sort_unstable();
    let mut at = 0;
    for (start, end, name) in spans {
        if start != at {
            return Err(format!(
                "tensor {name:?} starts at byte {start}, expected {at}: offsets overlap or leave a gap"
            ));
        }
        at = end;
    }
    if at != data_bytes {
        return Err(format!("its tensors cover {at} bytes of {data_bytes}: truncated, or bytes behind the end"));
    }
    Ok(())
}

struct Header {
    meta: BTreeMap<String, String>,
    entries: BTreeMap<String, Entry>,
}

impl<'de> Deserialize<'de> for Header {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> std::result::Result<Self, D::Error> {
        struct HeaderVisitor;
        impl<'de> Visitor<'de> for HeaderVisitor {
            type Value = Header;
            fn expecting(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
                f.write_str("a tensor file header")
            }
            fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> std::result::Result<Header, A::Error> {
                let mut header = Header { meta: BTreeMap::new(), entries: BTreeMap::new() };
                let mut seen_meta = false;
                while let Some(key) = map.next_key::<String>()? {
                    let duplicate = if key == "__metadata__" {
                        header.meta = map.next_value()?;
                        std::mem::replace(&mut seen_meta, true)
                    } else {
                        header.entries.insert(key.clone(), map.next_value()?).is_some()
                    };
                    if duplicate {
                        return Err(serde::de::Error::custom(format!("key {key:?} stands twice")));
                    }
                }
                Ok(header)
            }
        }
        deserializer.deserialize_map(HeaderVisitor)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sample(dir: &Path) -> PathBuf {
        let path = dir.join("a.safetensors");
        let data: Vec<f32> = (0..6).map(|x| x as f32).collect();
        TensorFileWriter::new()
            .meta("kind", "test")
            .f32("x", &[3, 2], &data)
            .u32("i", &[2], &[7, 8])
            .write(&path)
            .unwrap();
        path
    }

    #[test]
    fn rows_and_metadata_come_back() {
        let dir = tempfile::tempdir().unwrap();
        let file = TensorFile::open(&sample(dir.path())).unwrap();
        assert_eq!(file.require_meta("kind").unwrap(), "test");
        assert_eq!(file.f32_rows("x", 1..3).unwrap(), [2.0, 3.0, 4.0, 5.0]);
        assert_eq!(file.u32("i").unwrap(), [7, 8]);
        assert!(file.f32("i").is_err());
        assert!(file.f32_rows("x", 2..4).is_err());
    }

    #[test]
    fn truncated_and_trailing_bytes_are_refused() {
        let dir = tempfile::tempdir().unwrap();
        let path = sample(dir.path());
        let bytes = std::fs::read(&path).unwrap();
        for n in [0, 4, 12, bytes.len() - 1] {
            std::fs::write(&path, &bytes[..n]).unwrap();
            assert!(matches!(TensorFile::open(&path), Err(StoreError::Corrupt { .. })), "{n} bytes");
        }
        std::fs::write(&path, [&bytes[..], b"x"].concat()).unwrap();
        assert!(TensorFile::open(&path).unwrap_err().to_string().contains("behind the end"));
    }

    #[test]
    fn hostile_headers_are_refused() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("h.safetensors");
        let one = r#""a":{"dtype":"F32","shape":[1],"data_offsets":[0,4]}"#;
        for (header, says) in [
            (format!("{{{one},{one}}}"), "stands twice"),
            (format!(r#"{{{one},"b":{{"dtype":"F32","shape":[1],"data_offsets":[0,4]}}}}"#), "overlap"),
            (
                r#"{"a":{"dtype":"F32","shape":[4294967296,4294967296],"data_offsets":[0,4]}}"#.to_owned(),
                "claims bytes",
            ),
            (r#"{"a":{"dtype":"F99","shape":[1],"data_offsets":[0,4]}}"#.to_owned(), "broken"),
        ] {
            let mut bytes = (header.len() as u64).to_le_bytes().to_vec();
            bytes.extend(header.as_bytes());
            bytes.extend([0; 4]);
            std::fs::write(&path, bytes).unwrap();
            let message = TensorFile::open(&path).unwrap_err().to_string();
            assert!(message.contains(says), "{message}");
        }
    }
}
