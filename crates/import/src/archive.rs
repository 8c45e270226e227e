use crate::arrays::ArrayLimits;
use crate::place::excerpt;
use crate::{ImportError, Place, Result};
use flate2::read::DeflateDecoder;
use rawzip::{CompressionMethod, ZipArchive, ZipArchiveEntryWayfinder, ZipSliceArchive};
use softtissue_store::read_limited;
use std::collections::BTreeMap;
use std::io::Read;
use std::path::{Path, PathBuf};

/// Members up to this size may inflate at any ratio: zeros compress a thousandfold.
const FREE_RATIO_BYTES: u64 = 16 << 20;
/// Bytes of a member's name at most, as file systems have it.
const NAME_BYTES: usize = 255;

/// A zip archive (an npz file, a Python wheel), read whole into memory and inflated a member at a time.
///
/// Refused on opening: names that stand twice or lead out of the archive. Refused on reading: members that are larger
/// than the limits or than they state, compressed otherwise than by deflate, encrypted, or with a wrong checksum.
pub struct Archive {
    path: PathBuf,
    limits: ArrayLimits,
    zip: ZipSliceArchive<Vec<u8>>,
    members: BTreeMap<String, Member>,
}

struct Member {
    at: ZipArchiveEntryWayfinder,
    method: CompressionMethod,
    encrypted: bool,
    size: u64,
    stored: u64,
}

impl Archive {
    /// Reads an archive's list of members.
    ///
    /// # Errors
    /// No zip archive, a truncated one, too many members, or a name that is refused.
    pub fn open(path: &Path, limits: &ArrayLimits) -> Result<Self> {
        let bytes = read_limited(path, limits.file_bytes)?;
        let broken = |e: rawzip::Error| {
            ImportError::file(path, format!("it is no zip archive, or a truncated one ({e}); get it again"))
        };
        let zip = ZipArchive::from_slice(bytes).map_err(broken)?;
        let mut members = BTreeMap::new();
        for entry in zip.entries() {
            let entry = entry.map_err(broken)?;
            if members.len() == limits.members {
                return Err(ImportError::file(path, format!("it holds more than {} members", limits.members)));
            }
            let name = member_name(entry.file_path().as_ref()).map_err(|reason| ImportError::file(path, reason))?;
            let member = Member {
                at: entry.wayfinder(),
                method: entry.compression_method(),
                encrypted: entry.flags().is_encrypted(),
                size: entry.uncompressed_size_hint(),
                stored: entry.compressed_size_hint(),
            };
            if members.insert(name.clone(), member).is_some() {
                return Err(ImportError::file(path, format!("the member {name:?} stands twice; write the file again")));
            }
        }
        Ok(Self { path: path.to_owned(), limits: *limits, zip, members })
    }

    /// Names of all members, in order of bytes.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.members.keys().map(String::as_str)
    }

    /// Whether there is a member of this name.
    pub fn contains(&self, name: &str) -> bool {
        self.members.contains_key(name)
    }

    /// Where the archive lies.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The content of a member.
    ///
    /// # Errors
    /// No such member, or one that is refused (see [`Archive`]).
    pub fn read(&self, name: &str) -> Result<Vec<u8>> {
        let place = Place::part(&self.path, format!("member {name}"));
        let Some(member) = self.members.get(name) else {
            return Err(place.refuse("it is missing; check that the file is whole and of the right kind"));
        };
        if member.size > self.limits.array_bytes {
            return Err(place.refuse(format!("{} bytes, more than {}", member.size, self.limits.array_bytes)));
        }
        if member.size > FREE_RATIO_BYTES && member.size / self.limits.inflate_ratio > member.stored {
            let ratio = member.size / member.stored.max(1);
            return Err(place.refuse(format!("it would inflate {ratio} times, which no measurement does")));
        }
        if member.encrypted {
            return Err(place.refuse("it is encrypted; write the file again without a password"));
        }
        let broken = |e: &dyn std::fmt::Display| place.refuse(format!("it is damaged ({e}); get the file again"));
        let entry = self.zip.get_entry(member.at).map_err(|e| broken(&e))?;
        let stored = entry.data();
        // One byte more than stated shows a member that states too little.
        let mut bytes = Vec::with_capacity(member.size as usize + 1);
        let outcome = match member.method {
            CompressionMethod::STORE => entry.verifying_reader(stored).take(member.size + 1).read_to_end(&mut bytes),
            CompressionMethod::DEFLATE => {
                entry.verifying_reader(DeflateDecoder::new(stored)).take(member.size + 1).read_to_end(&mut bytes)
            }
            other => return Err(place.refuse(format!("it is compressed by method {other}, only deflate is read"))),
        };
        outcome.map_err(|e| broken(&e))?;
        if bytes.len() as u64 != member.size {
            return Err(place.refuse(format!("it states {} bytes and holds another number", member.size)));
        }
        Ok(bytes)
    }
}

/// The name of a member, where it stays inside the archive.
fn member_name(raw: &[u8]) -> std::result::Result<String, String> {
    let Ok(name) = std::str::from_utf8(raw) else {
        return Err("it holds a member whose name is not UTF-8; write the file again".into());
    };
    if name.len() > NAME_BYTES || name.contains(char::is_control) {
        return Err(format!("the name of its member {:?} is no file's; write the file again", excerpt(name)));
    }
    let steps_out = name.split(['/', '\\']).any(|part| part == "..");
    if name.starts_with(['/', '\\']) || name.contains(':') || steps_out {
        return Err(format!("the name of its member {name:?} leads out of the archive; the file is not trusted"));
    }
    Ok(name.to_owned())
}
