use glam::Vec3;
use re_chunk::{Chunk, ChunkId, ChunkResult, RowId, TimePoint};
use re_log_encoding::{EncodeError, Encoder, EncodingOptions};
use re_log_types::{LogMsg, SetStoreInfo, StoreId, StoreInfo, StoreSource, TimeCell};
use re_sdk_types::archetypes::{Mesh3D, Scalars, Transform3D, ViewCoordinates};
use re_sdk_types::{AsComponents, components::Color};
use softtissue_eval::EvalError;
use softtissue_eval::viewer::{Layer, View, ViewClip, check};
use softtissue_geometry::vertex_normals;
use softtissue_render::{bytes_of_colour, colours_of_magnitudes};
use softtissue_store::write_atomic;
use std::io::Write;
use std::path::Path;

/// Metres from one layer to the next, and from one clip to the next.
const BESIDE: f32 = 1.2;
const BEHIND: f32 = 2.0;
/// Part of the magnitudes of a clip that the colour scale holds.
const SCALE: f64 = 0.99;
/// A scale never ends below this, metres: where nothing moves all is dark.
const LEAST_SCALE: f32 = 1e-4;

/// Writes a log, atomically. The same view gives the same messages; the order of the index at the end is Rerun's.
///
/// # Errors
/// Those of [`check`], or the disk.
pub fn write(view: &View, path: &Path) -> Result<(), EvalError> {
    check(view)?;
    Ok(write_atomic(path, |out| log(view, out).map_err(std::io::Error::other))?)
}

fn log(view: &View, out: &mut dyn Write) -> Result<(), EncodeError> {
    let mut log = Log::begin(view.title, out)?;
    log.always("/", &ViewCoordinates::RIGHT_HAND_Y_UP())?;
    for (c, clip) in view.clips.iter().enumerate() {
        let shown = Shown::of(clip, view.reference);
        for (l, layer) in clip.layers.iter().enumerate() {
            let place = format!("{}/{}", clip.name, layer.key);
            let aside = [l as f32 * BESIDE, 0.0, c as f32 * -BEHIND];
            log.always(&place, &Transform3D::from_translation(aside))?;
            log.always(&place, &Mesh3D::update_fields().with_triangle_indices(view.surface.faces.iter().copied()))?;
            for t in 0..layer.frames.len() {
                let seconds = clip.start_s + t as f32 / clip.fps;
                let positions = positions(clip, layer, t);
                let normals = vertex_normals(&positions, view.surface.faces);
                let magnitudes = shown.magnitudes(layer, t);
                let mesh = Mesh3D::update_fields()
                    .with_vertex_positions(positions.iter().map(|p| p.to_array()))
                    .with_vertex_normals(normals.iter().map(|n| n.to_array()))
                    .with_vertex_colors(
                        colours_of_magnitudes(&magnitudes, shown.scale)
                            .into_iter()
                            .map(bytes_of_colour)
                            .map(Color::from),
                    );
                log.at(t, seconds, &place, &mesh)?;
                let mean = magnitudes.iter().map(|m| f64::from(*m)).sum::<f64>() / magnitudes.len() as f64;
                log.at(t, seconds, &format!("{place}/mm"), &Scalars::new([1000.0 * mean]))?;
            }
        }
    }
    log.end()
}

/// Where a layer's vertices are, `[V]`, metres.
fn positions(clip: &ViewClip, layer: &Layer, t: usize) -> Vec<Vec3> {
    let own = layer.frames.frame(t);
    match layer.over.and_then(|key| clip.layer(key)) {
        Some(base) => positions(clip, base, t).iter().zip(own).map(|(p, d)| *p + *d).collect(),
        None => own.to_vec(),
    }
}

/// What colours show of a clip: distance from one of its layers, or displacement from the layer below.
struct Shown<'a> {
    clip: &'a ViewClip,
    reference: Option<&'a Layer>,
    /// End of the colour scale, metres.
    scale: f32,
}

impl<'a> Shown<'a> {
    fn of(clip: &'a ViewClip, reference: Option<&str>) -> Self {
        let mut shown = Self { clip, reference: reference.and_then(|key| clip.layer(key)), scale: LEAST_SCALE };
        let each = |layer: &'a Layer| (0..layer.frames.len()).map(move |t| (layer, t));
        let mut all: Vec<f32> = clip.layers.iter().flat_map(each).flat_map(|(l, t)| shown.magnitudes(l, t)).collect();
        all.retain(|m| *m > 0.0);
        if !all.is_empty() {
            let at = (SCALE * (all.len() - 1) as f64) as usize;
            shown.scale = all.select_nth_unstable_by(at, f32::total_cmp).1.max(LEAST_SCALE);
        }
        shown
    }

    /// Of one frame of a layer, `[V]`, metres.
    fn magnitudes(&self, layer: &Layer, t: usize) -> Vec<f32> {
        let own = positions(self.clip, layer, t);
        let from = match self.reference {
            Some(reference) => positions(self.clip, reference, t),
            None => match layer.over.and_then(|key| self.clip.layer(key)) {
                Some(base) => positions(self.clip, base, t),
                None => return vec![0.0; own.len()],
            },
        };
        own.iter().zip(&from).map(|(a, b)| a.distance(*b)).collect()
    }
}

/// A recording that is being written.
struct Log<'a> {
    store: StoreId,
    encoder: Encoder<&'a mut dyn Write>,
    /// Numbers of chunks and rows: counted, where others take the clock's.
    next: u128,
}

impl<'a> Log<'a> {
    fn begin(title: &str, out: &'a mut dyn Write) -> Result<Self, EncodeError> {
        let store = StoreId::recording("softtissue", title);
        let info = StoreInfo::new(store.clone(), StoreSource::Other("softtissue".into()));
        let version = info.store_version.expect("that of the crate");
        let encoder = Encoder::new_eager(version, EncodingOptions::PROTOBUF_COMPRESSED, out)?;
        let mut log = Self { store, encoder, next: 0 };
        let row_id = RowId::from_u128(log.number()).as_tuid();
        log.encoder.append(&LogMsg::SetStoreInfo(SetStoreInfo { row_id, info }))?;
        Ok(log)
    }

    fn number(&mut self) -> u128 {
        self.next += 1;
        self.next
    }

    /// What holds at all times.
    fn always(&mut self, entity: &str, what: &dyn AsComponents) -> Result<(), EncodeError> {
        self.append(entity, TimePoint::default(), what)
    }

    fn at(&mut self, frame: usize, seconds: f32, entity: &str, what: &dyn AsComponents) -> Result<(), EncodeError> {
        let time = TimeCell::from_duration_nanos((1e9 * f64::from(seconds)).round() as i64);
        let point = TimePoint::from([("frame", TimeCell::from_sequence(frame as i64)), ("time", time)]);
        self.append(entity, point, what)
    }

    fn append(&mut self, entity: &str, point: TimePoint, what: &dyn AsComponents) -> Result<(), EncodeError> {
        let (chunk, row) = (ChunkId::from_u128(self.number()), RowId::from_u128(self.number()));
        let message = || -> ChunkResult<LogMsg> {
            let chunk = Chunk::builder_with_id(chunk, entity).with_archetype(row, point, what).build()?;
            Ok(LogMsg::ArrowMsg(self.store.clone(), chunk.to_arrow_msg()?))
        };
        let message = message()?;
        self.encoder.append(&message)?;
        Ok(())
    }

    fn end(mut self) -> Result<(), EncodeError> {
        self.encoder.finish()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use re_log_encoding::Decoder;
    use softtissue_eval::viewer::Surface;
    use softtissue_geometry::Frames;

    const FACES: [[u32; 3]; 1] = [[0, 1, 2]];

    fn frames(points: &[[Vec3; 3]]) -> Frames {
        let mut out = Frames::new(3);
        points.iter().for_each(|frame| out.push(frame));
        out
    }

    /// A triangle that rises, another that stands on it a centimetre to the side, and a third that stays.
    fn clip() -> ViewClip {
        let corners = [Vec3::ZERO, Vec3::X, Vec3::Y];
        let at = |height: f32| corners.map(|c| c + height * Vec3::Y);
        let layer = |key, over, frames| Layer { key, label: key.into(), over, frames };
        ViewClip {
            name: "s00/hips.0".into(),
            fps: 50.0,
            start_s: 1.0,
            layers: vec![
                layer("alone", None, frames(&[at(0.0), at(0.5)])),
                layer("predicted", Some("alone"), frames(&[[0.01 * Vec3::X; 3]; 2])),
                layer("reference", None, frames(&[at(0.0), at(0.0)])),
            ],
        }
    }

    fn written(clips: &[ViewClip], reference: Option<&'static str>) -> Result<Vec<u8>, EvalError> {
        let surface = Surface { faces: &FACES, regions: None };
        let view = View { title: "a run", about: "", notes: &[], surface, reference, clips };
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("run.rrd");
        write(&view, &path)?;
        Ok(std::fs::read(&path).expect("it was written"))
    }

    /// The chunks of a log, as Rerun's own reader finds them.
    fn chunks(log: &[u8]) -> Vec<Chunk> {
        let messages = Decoder::<LogMsg>::decode_eager(log).expect("a log");
        let chunk = |message: Result<LogMsg, _>| match message.expect("a message") {
            LogMsg::ArrowMsg(_, message) => Some(Chunk::from_arrow_msg(&message).expect("a chunk")),
            _ => None,
        };
        messages.filter_map(chunk).collect()
    }

    /// Values of an entity over time: frames, seconds and numbers.
    fn over_time(chunks: &[Chunk], entity: &str, of: impl Fn(&Chunk) -> Vec<f64>) -> Vec<(i64, f64, Vec<f64>)> {
        let own = chunks.iter().filter(|c| c.entity_path().to_string() == entity && !c.is_static());
        let time = |c: &Chunk, name: &'static str| c.timelines()[&name.into()].times_raw()[0];
        own.map(|c| (time(c, "frame"), time(c, "time") as f64 / 1e9, of(c))).collect()
    }

    #[test]
    fn every_layer_is_there_in_every_frame() {
        let log = written(&[clip()], Some("reference")).expect("a log");
        let chunks = chunks(&log);
        let positions = |c: &Chunk| -> Vec<f64> {
            let name = Mesh3D::descriptor_vertex_positions().component;
            c.iter_slices::<[f32; 3]>(name).flatten().flatten().map(|x| f64::from(*x)).collect()
        };
        let found = over_time(&chunks, "/s00/hips.0/predicted", positions);
        let close = |found: &[f64], wanted: &[f64]| found.iter().zip(wanted).all(|(a, b)| (a - b).abs() < 1e-6);
        assert_eq!(found.iter().map(|f| f.0).collect::<Vec<_>>(), [0, 1]);
        assert!(close(&[found[0].1, found[1].1], &[1.0, 1.02]));
        assert!(close(&found[0].2, &[0.01, 0.0, 0.0, 1.01, 0.0, 0.0, 0.01, 1.0, 0.0]), "{found:?}");
        assert!(close(&found[1].2, &[0.01, 0.5, 0.0, 1.01, 0.5, 0.0, 0.01, 1.5, 0.0]), "{found:?}");

        let mm = |c: &Chunk| -> Vec<f64> {
            let name = Scalars::descriptor_scalars().component;
            c.iter_slices::<f64>(name).flatten().copied().collect()
        };
        let from_reference = over_time(&chunks, "/s00/hips.0/predicted/mm", mm);
        assert!((from_reference[0].2[0] - 10.0).abs() < 1e-4, "{from_reference:?}");
        assert!((from_reference[1].2[0] - 1000.0 * 0.5f64.hypot(0.01)).abs() < 1e-3, "{from_reference:?}");
        assert!(over_time(&chunks, "/s00/hips.0/reference/mm", mm).iter().all(|f| f.2 == [0.0]));
        let fixed = chunks.iter().filter(|c| c.is_static()).count();
        assert_eq!(fixed, 1 + 2 * 3);
    }

    #[test]
    fn the_same_view_gives_the_same_chunks_and_a_false_one_a_sentence() {
        let ids =
            |log: Vec<u8>| -> Vec<_> { chunks(&log).iter().map(|c| (c.id(), c.row_ids_slice().to_vec())).collect() };
        let found = ids(written(&[clip()], None).expect("a log"));
        assert_eq!(found, ids(written(&[clip()], None).expect("a log")));
        assert_eq!(found.len(), 1 + 3 * (2 + 2 * 2));
        let mut torn = clip();
        torn.layers[1].frames = frames(&[[Vec3::ZERO; 3]]);
        let refused = written(&[clip(), torn], None).expect_err("layers of other lengths").to_string();
        assert!(refused.contains("1 frames"), "{refused}");
    }

    /// Without a reference the colours show what was added; the scale ends where 99 of 100 vertices lie.
    #[test]
    fn colours_show_what_was_added() {
        let clip = clip();
        let shown = Shown::of(&clip, None);
        assert!((shown.scale - 0.01).abs() < 1e-6);
        assert_eq!(shown.magnitudes(&clip.layers[0], 1), [0.0; 3]);
        assert!(shown.magnitudes(&clip.layers[1], 1).iter().all(|m| (m - 0.01).abs() < 1e-6));
    }
}
