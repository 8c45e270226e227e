use super::FrameMesh;
use crate::place::excerpt;
use crate::{ImportError, ImportLimits, Result};
use glam::Vec3;
use softtissue_store::read_limited;
use std::path::Path;

/// Bytes of a header at most; real ones have a few hundred.
const HEADER_BYTES: usize = 64 << 10;
/// Elements of a file and properties of an element at most.
const HEADER_PARTS: usize = 256;

/// Reads points, normals and faces of a PLY file, in file order: ascii, little- or big-endian, any numeric types,
/// any further elements and properties, which are passed over.
///
/// # Errors
/// A file that declares more than it holds or than the limits allow, or that is damaged; by element and number.
pub fn read_ply(path: &Path, limits: &ImportLimits) -> Result<FrameMesh> {
    let bytes = read_limited(path, limits.file_bytes)?;
    parse(&bytes, limits).map_err(|reason| ImportError::file(path, reason))
}

fn parse(bytes: &[u8], limits: &ImportLimits) -> std::result::Result<FrameMesh, String> {
    let (header, body) = Header::parse(bytes)?;
    header.check(body.len(), limits)?;
    let mut body = Body { bytes: body, encoding: header.encoding };
    let mut mesh = FrameMesh::default();
    for element in &header.elements {
        match element.name.as_str() {
            "vertex" => read_vertices(element, &mut body, &mut mesh)?,
            "face" => read_faces(element, &mut body, &mut mesh, limits)?,
            _ => skip(element, &mut body, limits)?,
        }
    }
    if mesh.positions.is_empty() {
        return Err("it holds no vertex; export the frame again".into());
    }
    mesh.check_faces()?;
    Ok(mesh)
}

/// How the numbers after the header are written.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Encoding {
    Ascii,
    Little,
    Big,
}

/// Type of a property.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Scalar {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    F32,
    F64,
}

impl Scalar {
    fn parse(word: &str) -> std::result::Result<Self, String> {
        Ok(match word {
            "char" | "int8" => Self::I8,
            "uchar" | "uint8" => Self::U8,
            "short" | "int16" => Self::I16,
            "ushort" | "uint16" => Self::U16,
            "int" | "int32" => Self::I32,
            "uint" | "uint32" => Self::U32,
            "float" | "float32" => Self::F32,
            "double" | "float64" => Self::F64,
            other => return Err(format!("its header names the type {:?}, which PLY does not have", excerpt(other))),
        })
    }

    fn size(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::F64 => 8,
        }
    }

    fn decode(self, b: &[u8], big: bool) -> f64 {
        let mut le = [0u8; 8];
        for (i, x) in b.iter().enumerate() {
            le[if big { b.len() - 1 - i } else { i }] = *x;
        }
        let word = u64::from_le_bytes(le);
        match self {
            Self::I8 => f64::from(word as i8),
            Self::U8 => f64::from(word as u8),
            Self::I16 => f64::from(word as i16),
            Self::U16 => f64::from(word as u16),
            Self::I32 => f64::from(word as i32),
            Self::U32 => f64::from(word as u32),
            Self::F32 => f64::from(f32::from_bits(word as u32)),
            Self::F64 => f64::from_bits(word),
        }
    }
}

#[derive(Debug)]
struct Property {
    name: String,
    /// Type of the list's length, if it is a list.
    list: Option<Scalar>,
    scalar: Scalar,
}

#[derive(Debug)]
struct Element {
    name: String,
    count: usize,
    properties: Vec<Property>,
}

struct Header {
    encoding: Encoding,
    elements: Vec<Element>,
}

impl Header {
    /// The header and what follows it.
    fn parse(bytes: &[u8]) -> std::result::Result<(Self, &[u8]), String> {
        let mut rest = bytes;
        if next_line(&mut rest)? != "ply" {
            return Err("it does not begin with `ply`; is it a PLY file?".into());
        }
        let (mut encoding, mut elements) = (None, Vec::<Element>::new());
        loop {
            if bytes.len() - rest.len() > HEADER_BYTES {
                return Err(format!("its header does not end within {HEADER_BYTES} bytes"));
            }
            let line = next_line(&mut rest)?;
            let words: Vec<&str> = line.split_ascii_whitespace().take(6).collect();
            match words[..] {
                ["end_header"] => break,
                ["format", name, "1.0"] => {
                    encoding = Some(match name {
                        "ascii" => Encoding::Ascii,
                        "binary_little_endian" => Encoding::Little,
                        "binary_big_endian" => Encoding::Big,
                        _ => return Err(format!("its format {:?} is none of PLY 1.0", excerpt(name))),
                    });
                }
                ["element", name, count] if elements.len() < HEADER_PARTS => {
                    let count = count
                        .parse()
                        .map_err(|_| format!("its element {:?} has the count {:?}", excerpt(name), excerpt(count)))?;
                    if elements.iter().any(|e| e.name == name) {
                        return Err(format!(
                            "its header has the element {:?} twice; export the file again",
                            excerpt(name)
                        ));
                    }
                    elements.push(Element { name: name.to_owned(), count, properties: vec![] });
                }
                ["property", ref rest @ ..] => {
                    let property =
                        property(rest).ok_or_else(|| format!("its header has the line {:?}", excerpt(line)))??;
                    match elements.last_mut() {
                        Some(element) if element.properties.len() < HEADER_PARTS => element.properties.push(property),
                        _ => return Err(format!("its header has the line {:?} out of place", excerpt(line))),
                    }
                }
                ["comment" | "obj_info", ..] | [] => {}
                _ => return Err(format!("its header has the line {:?}", excerpt(line))),
            }
        }
        let encoding = encoding.ok_or("its header has no line `format`")?;
        Ok((Self { encoding, elements }, rest))
    }

    /// Refuses counts that the body cannot hold, before anything is allocated for them.
    fn check(&self, body: usize, limits: &ImportLimits) -> std::result::Result<(), String> {
        let mut needed = 0usize;
        for element in self.elements.iter().filter(|e| e.count > 0) {
            let limit = if element.name == "vertex" { limits.vertices } else { limits.faces };
            if element.count > limit {
                return Err(format!("{} elements {:?} are more than {limit}", element.count, excerpt(&element.name)));
            }
            if element.properties.is_empty() {
                return Err(format!("its element {:?} has no property; export the file again", excerpt(&element.name)));
            }
            let least = |p: &Property| match self.encoding {
                Encoding::Ascii => 2,
                _ => p.list.unwrap_or(p.scalar).size(),
            };
            needed = needed.saturating_add(element.count * element.properties.iter().map(least).sum::<usize>());
        }
        // the last number of an ascii file needs no line end
        if needed > body + 1 {
            return Err(format!("its header declares at least {needed} bytes, but {body} follow: it is truncated"));
        }
        Ok(())
    }
}

fn property(words: &[&str]) -> Option<std::result::Result<Property, String>> {
    let make = |list: Option<&str>, scalar: &str, name: &str| {
        let list = list.map(Scalar::parse).transpose()?;
        Ok(Property { name: name.to_owned(), list, scalar: Scalar::parse(scalar)? })
    };
    match words {
        ["list", count, scalar, name] => Some(make(Some(count), scalar, name)),
        [scalar, name] => Some(make(None, scalar, name)),
        _ => None,
    }
}

/// Takes a line of the header.
fn next_line<'a>(rest: &mut &'a [u8]) -> std::result::Result<&'a str, String> {
    let head = &rest[..rest.len().min(HEADER_BYTES)];
    let end = head.iter().position(|b| *b == b'\n').ok_or("its header does not end; is it a PLY file?")?;
    *rest = &rest[end + 1..];
    // comments may be in any encoding
    let line = head[..end].trim_ascii();
    std::str::from_utf8(line)
        .or_else(|_| if line.starts_with(b"comment") { Ok("comment") } else { Err(()) })
        .map_err(|()| "its header is no text; is it a PLY file?".into())
}

struct Body<'a> {
    bytes: &'a [u8],
    encoding: Encoding,
}

impl Body<'_> {
    fn number(&mut self, scalar: Scalar) -> std::result::Result<f64, String> {
        if self.encoding == Encoding::Ascii {
            let start = self.bytes.trim_ascii_start();
            let end = start.iter().position(u8::is_ascii_whitespace).unwrap_or(start.len());
            let (word, rest) = start.split_at(end);
            self.bytes = rest;
            if word.is_empty() {
                return Err("the file ends here: it is truncated".into());
            }
            let text = std::str::from_utf8(word).ok().and_then(|w| w.parse().ok());
            return text.ok_or_else(|| {
                let word = String::from_utf8_lossy(&word[..word.len().min(40)]);
                format!("{word:?} is no number (write decimals with a point)")
            });
        }
        let Some((number, rest)) = self.bytes.split_at_checked(scalar.size()) else {
            return Err("the file ends here: it is truncated".into());
        };
        self.bytes = rest;
        Ok(scalar.decode(number, self.encoding == Encoding::Big))
    }

    /// The length of a list.
    fn length(&mut self, scalar: Scalar, limit: usize) -> std::result::Result<usize, String> {
        let length = self.number(scalar)?;
        if length >= 0.0 && length <= limit as f64 && length.fract() == 0.0 {
            Ok(length as usize)
        } else {
            Err(format!("a list of {length} entries, at most {limit} are read"))
        }
    }
}

fn read_vertices(element: &Element, body: &mut Body, mesh: &mut FrameMesh) -> std::result::Result<(), String> {
    let place = |name: &str| element.properties.iter().position(|p| p.name == name && p.list.is_none());
    let axes =
        |names: [&str; 3]| -> Option<[usize; 3]> { Some([place(names[0])?, place(names[1])?, place(names[2])?]) };
    let position = axes(["x", "y", "z"]).ok_or("its vertices have no x, y and z")?;
    let normal = axes(["nx", "ny", "nz"]);
    let mut values = vec![0.0f64; element.properties.len()];
    for v in 0..element.count {
        for (value, property) in values.iter_mut().zip(&element.properties) {
            *value = scalar_or_list(property, body).map_err(|reason| format!("vertex {v}: {reason}"))?;
        }
        let vector = |at: [usize; 3]| Vec3::from_array(at.map(|i| values[i] as f32));
        let p = vector(position);
        if !p.is_finite() {
            let at = position.map(|i| values[i]);
            return Err(format!("vertex {v}: its position {at:?} is not finite; mend or drop the frame"));
        }
        mesh.positions.push(p);
        mesh.normals.extend(normal.map(vector));
    }
    if !mesh.normals.iter().all(|n| n.is_finite()) {
        mesh.normals.clear();
    }
    Ok(())
}

/// A number, or the first of a list that is passed over.
fn scalar_or_list(property: &Property, body: &mut Body) -> std::result::Result<f64, String> {
    let Some(list) = property.list else { return body.number(property.scalar) };
    let length = body.length(list, HEADER_PARTS)?;
    (0..length).try_fold(0.0, |_, _| body.number(property.scalar))
}

fn read_faces(
    element: &Element,
    body: &mut Body,
    mesh: &mut FrameMesh,
    limits: &ImportLimits,
) -> std::result::Result<(), String> {
    let is_corners = |p: &Property| p.list.is_some() && matches!(p.name.as_str(), "vertex_indices" | "vertex_index");
    if !element.properties.iter().any(is_corners) {
        return skip(element, body, limits);
    }
    for f in 0..element.count {
        let place = |reason: String| format!("face {f}: {reason}");
        for property in &element.properties {
            if !is_corners(property) {
                scalar_or_list(property, body).map_err(place)?;
                continue;
            }
            let length = property.list.map_or(Ok(1), |list| body.length(list, limits.face_corners)).map_err(place)?;
            let mut corners = Vec::with_capacity(length);
            for _ in 0..length {
                let index = body.number(property.scalar).map_err(place)?;
                if !(0.0..=f64::from(u32::MAX)).contains(&index) || index.fract() != 0.0 {
                    return Err(place(format!("the vertex index {index} points outside the mesh (they count from 0)")));
                }
                corners.push(index as u32);
            }
            if corners.len() < 3 {
                return Err(place("a face needs at least three corners".into()));
            }
            mesh.faces.push(corners);
        }
    }
    Ok(())
}

fn skip(element: &Element, body: &mut Body, limits: &ImportLimits) -> std::result::Result<(), String> {
    for i in 0..element.count {
        for property in &element.properties {
            let place = |reason: String| format!("{:?} {i}: {reason}", excerpt(&element.name));
            let length = match property.list {
                Some(list) => body.length(list, limits.face_corners).map_err(place)?,
                None => 1,
            };
            for _ in 0..length {
                body.number(property.scalar).map_err(place)?;
            }
        }
    }
    Ok(())
}
