//! TensorBoard event files: TFRecord framing round `Event` protobufs that hold one scalar each.

use crate::Result;
use softtissue_store::{StoreError, create_dir};
use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};
use std::time::{SystemTime, UNIX_EPOCH};

/// Writes one event file.
pub struct EventWriter {
    path: PathBuf,
    file: BufWriter<File>,
}

impl EventWriter {
    /// Starts a new event file in `folder`.
    pub fn create(folder: &Path) -> Result<Self> {
        create_dir(folder)?;
        let path = folder.join(format!("events.out.tfevents.{}.{}", now() as u64, std::process::id()));
        let file = File::create(&path).map_err(|e| StoreError::io("write", &path, e))?;
        let mut writer = Self { path, file: BufWriter::new(file) };
        let mut event = wall_time();
        bytes_field(&mut event, 3, b"brain.Event:2");
        writer.record(&event)?;
        Ok(writer)
    }

    /// Adds a scalar.
    pub fn scalar(&mut self, tag: &str, step: u64, value: f64) -> Result<()> {
        let mut summary_value = Vec::new();
        bytes_field(&mut summary_value, 1, tag.as_bytes());
        summary_value.push(2 << 3 | 5);
        summary_value.extend((value as f32).to_le_bytes());
        let mut summary = Vec::new();
        bytes_field(&mut summary, 1, &summary_value);
        let mut event = wall_time();
        event.push(2 << 3);
        varint(&mut event, step);
        bytes_field(&mut event, 5, &summary);
        self.record(&event)
    }

    fn record(&mut self, data: &[u8]) -> Result<()> {
        let length = (data.len() as u64).to_le_bytes();
        let mut write = || {
            self.file.write_all(&length)?;
            self.file.write_all(&masked_crc(&length).to_le_bytes())?;
            self.file.write_all(data)?;
            self.file.write_all(&masked_crc(data).to_le_bytes())?;
            self.file.flush()
        };
        write().map_err(|e| StoreError::io("write", &self.path, e).into())
    }
}

fn now() -> f64 {
    SystemTime::now().duration_since(UNIX_EPOCH).map_or(0.0, |d| d.as_secs_f64())
}

fn wall_time() -> Vec<u8> {
    let mut event = vec![1 << 3 | 1];
    event.extend(now().to_le_bytes());
    event
}

fn bytes_field(out: &mut Vec<u8>, field: u8, bytes: &[u8]) {
    out.push(field << 3 | 2);
    varint(out, bytes.len() as u64);
    out.extend(bytes);
}

fn varint(out: &mut Vec<u8>, mut x: u64) {
    while x >= 0x80 {
        out.push(x as u8 | 0x80);
        x >>= 7;
    }
    out.push(x as u8);
}

fn masked_crc(data: &[u8]) -> u32 {
    crc32c::crc32c(data).rotate_right(15).wrapping_add(0xa282_ead8)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn records_are_framed_as_tensorboard_reads_them() {
        let dir = tempfile::tempdir().unwrap();
        let mut writer = EventWriter::create(dir.path()).unwrap();
        writer.scalar("regressor/loss", 300, 1.5).unwrap();
        let bytes = std::fs::read(&writer.path).unwrap();
        let first = u64::from_le_bytes(bytes[..8].try_into().unwrap()) as usize;
        let second = &bytes[8 + 4 + first + 4..];
        let length = u64::from_le_bytes(second[..8].try_into().unwrap()) as usize;
        assert_eq!(second.len(), 8 + 4 + length + 4);
        // The empty CRC-32C is 0, masked 0xa282ead8 by TensorFlow's rule.
        assert_eq!(masked_crc(b""), 0xa282_ead8);
        let event = &second[12..12 + length];
        assert_eq!(event[9..12], [16, 0xac, 0x02], "step 300 as a varint in field 2");
        assert!(event.windows(14).any(|w| w == b"regressor/loss"));
        assert_eq!(event[length - 4..], 1.5f32.to_le_bytes());
    }
}
