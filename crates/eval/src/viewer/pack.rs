//! Vertex sequences as short text: quantised to 16 bits, second differences over time, deflated, base64.

use base64::Engine;
use base64::prelude::BASE64_STANDARD;
use flate2::{Compression, write::ZlibEncoder};
use serde::Serialize;
use softtissue_geometry::Frames;
use std::io::Write;

/// A packed sequence. A number is `(q + offset) * step`; the tests unpack it byte by byte.
#[derive(Clone, Debug, Serialize)]
pub struct Packed {
    /// Metres a unit.
    pub step: f64,
    /// Added to every point, metres.
    pub centre: [f32; 3],
    /// Zlib stream, base64.
    pub data: String,
}

/// Packs `[T, V, 3]` metres to at least `finest` metres a unit; coarser only where 16 bits do not reach.
pub fn pack(frames: &Frames, finest: f64, centred: bool) -> Packed {
    let (mut low, mut high) = (glam::Vec3::splat(f32::INFINITY), glam::Vec3::splat(f32::NEG_INFINITY));
    for p in frames.points().iter().filter(|p| p.is_finite()) {
        (low, high) = (low.min(*p), high.max(*p));
    }
    let centre = if centred && low.is_finite() { (low + high) * 0.5 } else { glam::Vec3::ZERO };
    let reach = if low.is_finite() { (high - centre).abs().max((low - centre).abs()).max_element() } else { 0.0 };
    let step = finest.max(f64::from(reach) / 32_000.0);
    let (t_count, v_count) = (frames.len(), frames.points_per_frame());
    let quantised = |t: usize, axis: usize, v: usize| {
        let x = f64::from(frames.frame(t)[v][axis] - centre[axis]) / step;
        x.round().clamp(-32_000.0, 32_000.0) as i16
    };
    let count = t_count * v_count * 3;
    let (mut lows, mut highs) = (Vec::with_capacity(count), Vec::with_capacity(count));
    for t in 0..t_count {
        for axis in 0..3 {
            for v in 0..v_count {
                let at = |back: usize| if t >= back { quantised(t - back, axis, v) } else { 0 };
                let residual = match t {
                    0 => at(0),
                    1 => at(0).wrapping_sub(at(1)),
                    _ => at(0).wrapping_sub(at(1).wrapping_mul(2)).wrapping_add(at(2)),
                };
                // zigzag: small numbers of either sign leave the high byte zero
                let z = ((residual << 1) ^ (residual >> 15)) as u16;
                lows.push(z as u8);
                highs.push((z >> 8) as u8);
            }
        }
    }
    lows.extend(highs);
    Packed { step, centre: centre.to_array(), data: BASE64_STANDARD.encode(deflate(&lows)) }
}

/// Little-endian numbers, deflated, base64.
pub fn pack_bytes(bytes: &[u8]) -> String {
    BASE64_STANDARD.encode(deflate(bytes))
}

fn deflate(bytes: &[u8]) -> Vec<u8> {
    let mut encoder = ZlibEncoder::new(Vec::new(), Compression::new(6));
    encoder.write_all(bytes).and_then(|()| encoder.finish()).expect("writing to memory does not fail")
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;
    use std::io::Read;

    fn unpack(p: &Packed, t_count: usize, v_count: usize) -> Frames {
        let mut bytes = Vec::new();
        let zlib = BASE64_STANDARD.decode(&p.data).unwrap();
        flate2::read::ZlibDecoder::new(zlib.as_slice()).read_to_end(&mut bytes).unwrap();
        let count = t_count * v_count * 3;
        assert_eq!(bytes.len(), 2 * count);
        let mut q = vec![0i16; count];
        let stride = v_count * 3;
        for i in 0..count {
            let z = u16::from(bytes[i]) | u16::from(bytes[count + i]) << 8;
            let r = (z >> 1) as i16 ^ -((z & 1) as i16);
            q[i] = match i / stride {
                0 => r,
                1 => r.wrapping_add(q[i - stride]),
                _ => r.wrapping_add(q[i - stride].wrapping_mul(2)).wrapping_sub(q[i - 2 * stride]),
            };
        }
        let mut frames = Frames::zeros(v_count, t_count);
        for t in 0..t_count {
            for v in 0..v_count {
                frames.frame_mut(t)[v] = Vec3::from_array(std::array::from_fn(|axis| {
                    (f64::from(q[t * stride + axis * v_count + v]) * p.step) as f32 + p.centre[axis]
                }));
            }
        }
        frames
    }

    #[test]
    fn sequences_come_back_to_half_a_step() {
        let mut frames = Frames::new(50);
        for t in 0..80 {
            let wave =
                |v: usize| Vec3::new(v as f32 * 0.05, (t as f32 * 0.2).sin() * 3.0, -2.0 + (t * v) as f32 * 1e-3);
            frames.push(&(0..50).map(wave).collect::<Vec<_>>());
        }
        for (finest, centred) in [(1e-4, true), (1e-5, false)] {
            let packed = pack(&frames, finest, centred);
            let back = unpack(&packed, 80, 50);
            for (a, b) in frames.points().iter().zip(back.points()) {
                assert!((*a - *b).abs().max_element() as f64 <= packed.step * 0.51 + 1e-6, "{a} {b}");
            }
            assert!(packed.data.len() < 80 * 50 * 3 * 2, "smooth motion packs to less than its 16 bits a number");
        }
    }

    #[test]
    fn stillness_and_emptiness_pack_to_nearly_nothing() {
        assert!(pack(&Frames::zeros(500, 100), 1e-5, false).data.len() < 1000);
        assert_eq!(unpack(&pack(&Frames::new(3), 1e-5, true), 0, 3).len(), 0);
    }
}
