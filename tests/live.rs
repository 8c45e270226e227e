//! A learned bundle on motions at any rate, unknown to it, from their middle, and round and round.

use crate::support::{Said, folder, softtissue, tiny_run, tiny_scans};
use glam::Vec3;
use softtissue_body::Pose;
use softtissue_bundle::{Bundle, Player};
use softtissue_clips::{ClipId, MotionClip, TruthSet};
use softtissue_geometry::Frames;
use softtissue_random::Draws;
use softtissue_synth::motion::{Request, Style, generate};
use std::path::Path;

const HEAVY: [f32; 2] = [0.0, -2.0];

fn learned() -> Bundle {
    Bundle::read(&tiny_run().path.join("bundle")).expect("a bundle")
}

/// A motion at 120 frames a second on a heavy body.
fn fine(bundle: &Bundle, motion: &str, frames: usize) -> MotionClip {
    let request = Request { subject: "anybody", motion, take: 0, frames, fps: 120.0, seed: 1 };
    generate(&request, &bundle.body.shaped(&HEAVY), &Style::neutral()).expect("a motion")
}

/// Three running means of a twelfth of a second of a motion at 120 frames a second: nothing is left at 12 Hz, which is as
/// much as 24 frames a second can carry.
fn smooth(mut clip: MotionClip) -> MotionClip {
    let frames = clip.len() as i64;
    let set = |frames: &mut Frames, t: i64, to: Vec<Vec3>| frames.frame_mut(t as usize).copy_from_slice(&to);
    for _ in 0..3 {
        let (rotations, translations) = (clip.rotations.clone(), clip.translations.clone());
        for t in 0..frames {
            let near = |d: i64| (t + d).clamp(0, frames - 1) as usize;
            let weight = |d: i64| if d.abs() == 5 { 0.05 } else { 0.1 };
            let mean = |j: usize| (-5..=5).map(|d| weight(d) * rotations.frame(near(d))[j]).sum();
            set(&mut clip.rotations, t, (0..rotations.points_per_frame()).map(mean).collect());
            clip.translations[t as usize] = (-5..=5).map(|d| weight(d) * translations[near(d)]).sum();
        }
    }
    clip
}

fn rms(points: &[Vec3]) -> f32 {
    (points.iter().map(|d| d.length_squared()).sum::<f32>() / points.len() as f32).sqrt()
}

#[test]
fn frame_rates_from_24_to_120_give_the_same_motion() {
    let bundle = learned();
    let mut player = Player::new(&bundle, &HEAVY).expect("a player");
    for name in ["running_on_spot", "shake_hips"] {
        let clip = smooth(fine(&bundle, name, 360));
        let pose = |i: usize| Pose { rotations: clip.rotations.frame(i), translation: clip.translations[i] };
        // Frames of 120 a second at which all meet.
        let mut played = |every: usize| {
            let mut common = Frames::new(bundle.body.vertex_count());
            player.pre_roll(pose(0), 3.0);
            for i in (0..360).step_by(every) {
                player.advance(pose(i), every as f32 / 120.0);
                if i % 20 == 0 && i >= 60 {
                    common.push(player.deltas());
                }
            }
            common
        };
        let native = played(2);
        for (every, fps) in [(5, 24), (4, 30), (1, 120)] {
            let common = played(every);
            let errors: Vec<Vec3> = common.points().iter().zip(native.points()).map(|(a, b)| *a - *b).collect();
            let ratio = rms(&errors) / rms(native.points());
            // 24 frames a second see four poses of a step.
            assert!(ratio < if fps == 24 { 0.1 } else { 0.05 }, "{name} at {fps} frames a second: {ratio}");
        }
    }
}

/// The clip that the tiny run keeps for its judgement.
fn unseen() -> MotionClip {
    let truth = tiny_scans().with_file_name("truth");
    MotionClip::read(&TruthSet::motion_path(&truth, &ClipId::new("s01", "one_leg_jump", 0))).expect("a motion")
}

/// The same person's clip with every joint turned at random, frame by frame.
fn nonsense() -> MotionClip {
    let mut clip = unseen();
    let mut draws = Draws::new(5, "nonsense", 0, 0);
    for t in 0..clip.len() {
        for w in clip.rotations.frame_mut(t) {
            *w = Vec3::from_array([0; 3].map(|_| draws.range(-1.5, 1.5) as f32));
        }
    }
    clip
}

#[test]
fn nobody_trusts_nonsense() {
    let bundle = learned();
    let mut player = Player::new(&bundle, &[]).expect("a player");
    let mut trust = |clip: &MotionClip, every: usize| {
        player.reset();
        let step = |i: usize| {
            player.step(Pose { rotations: clip.rotations.frame(i), translation: clip.translations[i] }).trust
        };
        let found: Vec<f32> = (0..clip.len()).step_by(every).map(step).collect();
        found.iter().sum::<f32>() / found.len() as f32
    };
    let (whole, fast, wild) = (trust(&unseen(), 1), trust(&unseen(), 3), trust(&nonsense(), 1));
    assert!(whole > 0.8, "an unseen motion of a kind with the training's: {whole}");
    assert!(fast < whole - 0.1, "three times as fast: {fast}, else {whole}");
    assert!(wild < 0.05, "{wild}");
}

fn animate(motion: &str, out: &Path, more: &[&str]) -> Said {
    let (bundle, out) = (tiny_run().path.join("bundle").display().to_string(), out.display().to_string());
    let always = ["animate", "--bundle", &bundle, "--motion", motion, "--shape", "0,-2", "--out", &out];
    softtissue(&[&always[..], more].concat())
}

#[test]
fn animate_fades_what_it_cannot_know_and_says_whom_it_trusts() {
    let home = folder("faded");
    let motion = home.join("nonsense.safetensors");
    nonsense().write(&motion).expect("a motion");
    let motion = motion.display().to_string();
    let last = |name: &str, more: &[&str]| {
        let said = animate(&motion, &home.join(name), more);
        assert!(said.fine().out.contains("least trust 0.00 at"), "{}", said.out);
        std::fs::read(home.join(name).join("frame_00047.obj")).expect("a frame")
    };
    let (plain, still) = (last("plain", &[]), last("still", &["--gain", "0"]));
    assert!(
        plain != still && last("faded", &["--fade", "0.4"]) == still,
        "patience and fading take 0.7 of 0.8 seconds"
    );
    animate(&motion, &home.join("a.glb"), &["--fade", "3"]).refused(2, &["trust", "0 to 1"]);
}

#[test]
fn animate_begins_without_a_jolt_and_closes_loops() {
    let home = folder("looped");
    let first = |name: &str, more: &[&str]| {
        let more = [&["--frames", "120"], more].concat();
        let said = animate("synth:shake_hips", &home.join(name), &more);
        let frame = std::fs::read(home.join(name).join("frame_00000.obj")).expect("a frame");
        (said.fine().out.clone(), frame)
    };
    let (cold, rolled, longer) = (first("a", &[]), first("b", &["--pre-roll"]), first("c", &["--pre-roll", "6"]));
    assert!(cold.1 != rolled.1, "flesh hangs before it moves");
    assert!(rolled.0.contains("trust") && longer.0.contains("trust"), "{}", rolled.0);
    animate("synth:shake_hips", &home.join("d.glb"), &["--pre-roll", "99"]).refused(2, &["--pre-roll", "60"]);
    let looped = first("e", &["--loop"]);
    let open: f32 =
        looped.0.split(" mm open").next().and_then(|l| l.rsplit(' ').next()?.parse().ok()).expect("a number");
    assert!(looped.0.contains("a loop after ") && open <= 0.1, "{}", looped.0);
}
