use super::support::{body, data, degrees, fixture, on_body, posed, read};
use glam::Vec3;
use softtissue_clips::inspection::ProblemKind;
use softtissue_import::motion::examine;

/// Directions of bones are the source's, so a picture of both would be the same person at another size.
#[test]
fn limbs_point_where_the_source_has_them() {
    let source = read(&data("cmu_01_01.bvh"));
    let ours = on_body(&source).clip;
    let mut worst = 0.0f32;
    for t in (0..source.motion.len()).step_by(10) {
        let theirs = source.motion.pose(t).positions;
        let (_, at) = posed(&ours, t);
        for side in 0..2 {
            let arm = source.person.arms[side];
            for (a, b, from, to) in [(16, 18, arm.shoulder, arm.elbow), (18, 20, arm.elbow, arm.wrist.unwrap())] {
                let wanted = (theirs[to] - theirs[from]).as_vec3();
                worst = worst.max((at[b + side] - at[a + side]).angle_between(wanted).to_degrees());
            }
        }
    }
    assert!(worst < 0.05, "{worst} degrees");
}

#[test]
fn feet_stand_on_the_floor_and_bear_where_the_source_bears() {
    let source = read(&data("cmu_01_01.bvh"));
    let retargeted = on_body(&source);
    let ours = &retargeted.clip;
    assert!(retargeted.contact_frames.iter().all(|n| (60..190).contains(n)), "{:?}", retargeted.contact_frames);
    let rest = body().joints;
    let mut low = f32::MAX;
    let mut jump = 0.0f32;
    // Where the source's ball joint is still, so is ours: the foot does not skate.
    let (mut skated, mut frames) = (0.0f32, 0);
    for t in 1..ours.len() {
        let (before, now) = (posed(ours, t - 1).1, posed(ours, t).1);
        for side in 0..2 {
            let toe = source.person.legs[side].toe.unwrap();
            let theirs = [t - 1, t].map(|t| source.motion.pose(t).positions[toe].as_vec3());
            low = low.min(now[10 + side].y - rest[10].y).min(now[7 + side].y - rest[7].y);
            jump = jump.max(now[10 + side].y);
            if theirs[0].distance(theirs[1]) * 120.0 < 0.1 && now[10 + side].y < rest[10].y + 0.02 {
                skated += (now[10 + side] - before[10 + side]).length() * 120.0;
                frames += 1;
            }
        }
    }
    assert!(low > -0.004, "{low} m into the floor");
    assert!(jump > 0.2, "a jump of {jump} m");
    let skated = skated / frames as f32;
    assert!(frames > 60 && skated < 0.1, "{skated} m/s over {frames} frames");
    assert!(retargeted.worst_contact_m < 0.02, "{} m", retargeted.worst_contact_m);
}

#[test]
fn the_root_moves_as_far_as_the_legs_are_long() {
    let source = read(&data("cmu_01_01.bvh"));
    let retargeted = on_body(&source);
    let hips = |t: usize| source.person.hips(&source.motion.pose(t)).as_vec3();
    let ours = |t: usize| {
        let at = posed(&retargeted.clip, t).1;
        0.5 * (at[1] + at[2])
    };
    for t in [40, 100, 199] {
        let (a, b): (Vec3, Vec3) = (ours(t) - ours(0), (hips(t) - hips(0)) * retargeted.scale as f32);
        assert!(a.distance(b) < 1e-4, "{a} {b}");
    }
}

#[test]
fn problems_are_found_and_a_good_clip_has_none() {
    for path in ["plain.bvh", "daz.bvh", "motion_builder.bvh", "folded.bvh", "amass_1.npz", "amass_2.npz"].map(fixture)
    {
        assert_eq!(examine(&read(&path)).problems, [], "{}", path.display());
    }
    assert_eq!(examine(&read(&data("01_01.amc"))).problems, []);
    let good = read(&data("cmu_01_01.bvh"));
    assert_eq!(examine(&good).problems, []);
    let joints = good.motion.skeleton.len();
    let mut bad = good.clone();
    bad.motion.positions[50].x += 3.0;
    let (before, after) = bad.motion.rotations.split_at_mut(80 * joints);
    after[..joints].copy_from_slice(&before[79 * joints..]);
    bad.motion.positions[80] = bad.motion.positions[79];
    // three frames lost while the person still moves
    bad.motion.positions.drain(100..103);
    bad.motion.rotations.drain(100 * joints..103 * joints);
    bad.person.legs.swap(0, 1);
    let found: Vec<(ProblemKind, Vec<usize>)> = examine(&bad)
        .problems
        .into_iter()
        .map(|p| (p.kind, p.first.iter().filter_map(|p| p.frame).collect()))
        .collect();
    let frames = |kind: ProblemKind| found.iter().find(|f| f.0 == kind).map(|f| f.1.as_slice());
    assert_eq!(frames(ProblemKind::LeftRightSwap), Some(&[][..]));
    assert_eq!(frames(ProblemKind::Teleport), Some(&[50, 51][..]));
    assert_eq!(frames(ProblemKind::RepeatedFrames), Some(&[80][..]));
    assert_eq!(frames(ProblemKind::DroppedFrames), Some(&[100][..]), "{found:?}");
}

/// The rest pose of this file is no person, so a frame stands in for it: limbs still point where they should, and the
/// trunk is off by no more than that frame is from standing straight.
#[test]
fn a_skeleton_that_is_folded_at_rest_is_unfolded_by_a_frame() {
    let [plain, folded] = ["plain.bvh", "folded.bvh"].map(|name| on_body(&read(&fixture(name))));
    assert_eq!(plain.notes, Vec::<String>::new());
    assert!(folded.notes[0].contains("stands in"), "{:?}", folded.notes);
    let (mut limbs, mut trunk) = (0.0f32, 0.0f32);
    for t in 0..plain.clip.len() {
        let ((turn_a, a), (turn_b, b)) = (posed(&plain.clip, t), posed(&folded.clip, t));
        for (from, to) in [(16, 18), (17, 19), (18, 20), (19, 21)] {
            limbs = limbs.max((a[to] - a[from]).angle_between(b[to] - b[from]).to_degrees());
        }
        trunk = [0, 9, 15].into_iter().map(|j| degrees(turn_a[j], turn_b[j])).fold(trunk, f32::max);
    }
    assert!(limbs < 0.1, "{limbs} degrees");
    assert!(trunk < 30.0, "{trunk} degrees");
}
