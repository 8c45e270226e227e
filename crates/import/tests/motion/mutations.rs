//! Damaged files: an answer, never a panic, and never a number that is not finite.

use super::support::{body, data};
use proptest::prelude::*;
use proptest::test_runner::RngSeed;
use softtissue_body::Skeleton;
use softtissue_clips::ClipId;
use softtissue_import::motion::{MotionConfig, RetargetConfig, examine, read_motion, resample, retarget};
use std::path::Path;
use std::sync::LazyLock;

/// Skeletons and a few frames, so that damage hits every part.
static BVH: LazyLock<Vec<u8>> = LazyLock::new(|| {
    let text = std::fs::read_to_string(data("cmu_01_01.bvh")).unwrap().replace("Frames: 200", "Frames: 4");
    let lines = text.lines().position(|l| l.starts_with("Frame Time")).unwrap() + 5;
    text.lines().take(lines).map(|l| format!("{l}\n")).collect::<String>().into_bytes()
});
static ASF: LazyLock<Vec<u8>> = LazyLock::new(|| std::fs::read(data("01.asf")).unwrap());
static AMC: LazyLock<Vec<u8>> = LazyLock::new(|| {
    let text = std::fs::read_to_string(data("01_01.amc")).unwrap();
    text.lines().take(3 + 4 * 30).map(|l| format!("{l}\n")).collect::<String>().into_bytes()
});

/// Bytes that change what a number or a structure says.
const TELLING: &[u8] = b"0123456789.-+eE{} \n:#XYZRzT\xff\x00nai";

/// Whether a file is taken; panics where something that is taken is not finite.
fn taken(path: &Path) -> bool {
    let Ok(read) = read_motion(path, &MotionConfig::default()) else { return false };
    examine(&read);
    let id = ClipId::new("a", "b", 0);
    match retarget(path, &read, id, &Skeleton::smpl(), &body(), &RetargetConfig::default()) {
        Ok(done) => {
            let clip = resample(&done.clip, 0.7 * done.clip.fps, path).unwrap();
            assert!(clip.rotations.points().iter().chain(&clip.translations).all(|p| p.is_finite()));
            true
        }
        Err(e) => {
            assert!(e.to_string().contains(&path.display().to_string()), "{e}");
            false
        }
    }
}

fn damaged(bytes: &[u8], edits: &[(usize, usize)], cut: Option<usize>) -> Vec<u8> {
    let mut bytes = bytes.to_vec();
    for (at, with) in edits {
        let at = at % bytes.len();
        bytes[at] = TELLING[with % TELLING.len()];
    }
    bytes.truncate(cut.map_or(bytes.len(), |c| c % bytes.len()));
    bytes
}

fn edits() -> impl Strategy<Value = Vec<(usize, usize)>> {
    proptest::collection::vec((any::<usize>(), any::<usize>()), 1..5)
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 200, rng_seed: RngSeed::Fixed(1), failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn damaged_bvh_files(edits in edits(), cut in proptest::option::weighted(0.2, any::<usize>())) {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.bvh");
        std::fs::write(&path, damaged(&BVH, &edits, cut)).unwrap();
        taken(&path);
    }

    #[test]
    fn damaged_acclaim_files(edits in edits(), which in any::<bool>(), cut in proptest::option::weighted(0.2, any::<usize>())) {
        let dir = tempfile::tempdir().unwrap();
        let (asf, amc) = if which {
            (damaged(&ASF, &edits, cut), AMC.clone())
        } else {
            (ASF.clone(), damaged(&AMC, &edits, cut))
        };
        std::fs::write(dir.path().join("a.asf"), asf).unwrap();
        std::fs::write(dir.path().join("a.amc"), amc).unwrap();
        taken(&dir.path().join("a.amc"));
    }
}

/// What is damaged above is fine before: the tests see more than refusals.
#[test]
fn the_files_are_fine_before_they_are_damaged() {
    let dir = tempfile::tempdir().unwrap();
    for (name, bytes) in [("a.bvh", &*BVH), ("a.asf", &*ASF), ("a.amc", &*AMC)] {
        std::fs::write(dir.path().join(name), bytes).unwrap();
    }
    assert!(taken(&dir.path().join("a.bvh")) && taken(&dir.path().join("a.amc")));
}
