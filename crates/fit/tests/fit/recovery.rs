use crate::figure::smooth_pose;
use crate::scans::{CLEAN, FPS, Recipe, Truth, all_train, joint_errors, mean_distance, median};
use glam::Vec3;
use softtissue_body::{BodyModel, Pose, Region, SkinWeights};
use softtissue_clips::{ClipId, ScanClip};
use softtissue_fit::{
    FitConfig, Objective, ObjectiveKind, PackedBody, WeightedBody, fit_motion, fit_set, region_weights,
};
use softtissue_geometry::Frames;
use softtissue_monitor::Silent;
use std::sync::Arc;

fn clips(names: &[&str]) -> Vec<ClipId> {
    names.iter().map(|n| ClipId::new("a", *n, 0)).collect()
}

/// Clean scans that begin in the middle of a motion, no two alike: shape, poses and deltas come back.
#[test]
fn clean_scans_that_start_in_mid_motion_give_shape_and_pose_back() {
    let truth = Truth::new(&CLEAN);
    let ids = clips(&["walk", "run", "jump"]);
    let dir = tempfile::tempdir().unwrap();
    let scans = truth.write(&dir.path().join("scans"), &ids, &CLEAN);
    // a pull towards the mean shape, the rest pose or the frames around would show at this accuracy, and so would a
    // template made of rounding
    let config = FitConfig {
        shape_prior: 1e-12,
        pose_prior: 0.0,
        smoothness: 0.0,
        limb_hz: 0.0,
        trunk_hz: 0.0,
        root_hz: 0.0,
        subject_template: false,
        tolerance: 1e-4,
        ..Default::default()
    };
    let fit = fit_set(&scans, &all_train(&ids), &truth.body, &config, &dir.path().join("fit"), &Silent).unwrap();
    let subject = fit.subject("a").unwrap();
    for (found, wanted) in subject.beta.iter().zip(&truth.beta) {
        assert!((found - wanted).abs() < 5e-3, "beta {:?} for {:?}", subject.beta, truth.beta);
    }
    for id in &ids {
        let motion = truth.motion(id, &CLEAN);
        let (angles, distances) =
            joint_errors(&truth.body, &subject.beta, &fit.motion(id).unwrap(), &motion, &truth.beta);
        let worst = angles.iter().copied().fold(0.0, f32::max);
        assert!(worst < 1e-3, "{id}: {worst} rad");
        assert!(distances.iter().all(|d| *d < 1e-3), "{id}");
        let deltas = fit.deltas(id).unwrap().deltas;
        let all: Vec<u32> = (0..truth.body.vertex_count() as u32).collect();
        assert!(mean_distance(&deltas, &Frames::zeros(all.len(), CLEAN.frames), &all) < 2e-4);
    }
}

/// Flesh, static detail and noise at once: deltas on soft vertices within what the issue allows, and the template
/// takes the detail out.
#[test]
fn scan_deltas_follow_the_true_ones() {
    let recipe = Recipe { frames: 60, pose_size: 0.3, flesh: 0.012, detail: 0.0025, noise: 7e-4, still: 15 };
    let truth = Truth::new(&recipe);
    let ids = clips(&["walk", "run", "jump", "kick"]);
    let dir = tempfile::tempdir().unwrap();
    let scans = truth.write(&dir.path().join("scans"), &ids, &recipe);
    let soft = truth.body.regions.soft();
    let error = |config: &FitConfig, name: &str| {
        let fit = fit_set(&scans, &all_train(&ids), &truth.body, config, &dir.path().join(name), &Silent).unwrap();
        let subject = fit.subject("a").unwrap();
        let mut degrees = vec![];
        let mut total = 0.0;
        for id in &ids {
            let found = fit.deltas(id).unwrap().deltas;
            total += mean_distance(&found, &truth.deltas(&recipe), &soft) / ids.len() as f32;
            let motion = truth.motion(id, &recipe);
            degrees.extend(joint_errors(&truth.body, &subject.beta, &fit.motion(id).unwrap(), &motion, &truth.beta).0);
        }
        (total, median(degrees).to_degrees())
    };
    // The figure starts within one frame, and its root accelerates by 0.6 degrees a frame squared where people's do by
    // 0.14: what holds a person's trunk would hold its motion (1.5 mm and 1.05 degrees; with a person's motion there is
    // no difference). That solve has its own tests, with a person's motion.
    let free = FitConfig { smoothness: 0.0, limb_hz: 0.0, trunk_hz: 0.0, root_hz: 0.0, ..Default::default() };
    let (with_template, degrees) = error(&free, "with");
    let (without, _) = error(&FitConfig { subject_template: false, ..free }, "without");
    println!(
        "deltas {:.2} mm, {:.2} mm without template; joints {degrees:.2} degrees",
        1e3 * with_template,
        1e3 * without
    );
    // the noise alone is 7e-4 * sqrt(8 / pi) = 1.1 mm away on average
    assert!(with_template < 1.1e-3 + 1e-3, "{with_template}");
    assert!(with_template < 0.6 * without, "{with_template} with the template, {without} without");
    assert!(degrees < 1.0, "{degrees} degrees");
}

/// Casas-Otaduy 2018, figure 3, says that an error matched in the posed state turns into garbage when it is unposed.
/// Knees and elbows are bent by up to 138 degrees, where blended matrices shrink and unposing magnifies threefold. Each
/// objective must win in its own frame. The margin is small (0.2 % here): with every vertex tracked, the pose is
/// so overdetermined that the frame in which it is weighed hardly matters.
#[test]
fn each_objective_is_the_smaller_one_in_its_own_frame() {
    let mut truth = Truth::new(&CLEAN);
    spread_weights(&mut truth.body);
    let shaped = truth.body.shaped(&truth.beta);
    let id = ClipId::new("a", "bend", 0);
    let mut vertices = Frames::new(truth.body.vertex_count());
    for t in 0..20 {
        let (mut rotations, translation) = smooth_pose(9, t as f32 / FPS, 0.2);
        let bend = 138f32.to_radians() * (t as f32 / 19.0);
        (rotations[4], rotations[5]) = (Vec3::X * bend, Vec3::X * bend);
        (rotations[18], rotations[19]) = (Vec3::Y * -bend, Vec3::Y * bend);
        let wave = |p: &Vec3| 0.015 * (40.0 * *p + 20.0 * t as f32 / FPS).map(f32::sin);
        let flesh: Vec<Vec3> = truth.body.template.iter().map(wave).collect();
        vertices.push(&truth.body.posed(&shaped, Pose { rotations: &rotations, translation }, Some(&flesh)));
    }
    let scan = ScanClip { id: id.clone(), fps: FPS, vertices };
    let weights = vec![1.0; truth.body.vertex_count()];
    let weighted = WeightedBody::new(Arc::new(PackedBody::new(&truth.body)), &weights);
    let [unposed, posed] = [ObjectiveKind::Unposed, ObjectiveKind::Posed]
        .map(|kind| Objective::new(weighted.clone(), kind, &shaped, None));
    // rms distance, mm, of the motion that `solved` finds, as `measure` sees it
    let rms = |solved: &Objective, measure: &Objective| {
        let config = FitConfig { tolerance: 1e-5, ..Default::default() };
        let motion = fit_motion(solved, &scan, 1, &config, &Silent).unwrap().clip(id.clone(), FPS);
        let value = |t: usize| {
            let pose = Pose { rotations: motion.rotations.frame(t), translation: motion.translations[t] };
            measure.value(pose, scan.vertices.frame(t))
        };
        1e3 * ((0..20).map(value).sum::<f64>() / 20.0).sqrt()
    };
    let (own, other) = (rms(&unposed, &unposed), rms(&posed, &unposed));
    println!("at rest: {own:.3} mm from the unposed objective, {other:.3} mm from the posed one");
    assert!(own < 0.9995 * other, "{own} and {other}");
    let (own, other) = (rms(&posed, &posed), rms(&unposed, &posed));
    println!("in space: {own:.3} mm from the posed objective, {other:.3} mm from the unposed one");
    assert!(own < 0.9995 * other, "{own} and {other}");
}

/// Blends every vertex between its bone and the nearer neighbour, in equal parts at the joint.
fn spread_weights(body: &mut BodyModel) {
    for (v, skin) in body.skin.iter_mut().enumerate() {
        let (own, ring) = (v / 56, v % 56 / 8);
        let parent = body.skeleton.parents[own].map_or(0, usize::from);
        let child = (0..24).find(|&c| body.skeleton.parents[c] == Some(own as u8)).unwrap_or(own);
        let t = ring as f32 / 6.0;
        let (other, w) = if t < 0.5 { (parent, 0.5 - 0.7 * t) } else { (child, 0.5 - 0.7 * (1.0 - t)) };
        if other != own {
            *skin = SkinWeights { joints: [own as u8, other as u8, 0, 0], weights: [1.0 - w, w, 0.0, 0.0] };
        }
    }
}

/// Frames so far apart that no warm start helps.
#[test]
fn a_jump_between_frames_is_survived() {
    let truth = Truth::new(&CLEAN);
    let shaped = truth.body.shaped(&truth.beta);
    let poses: Vec<(Vec<Vec3>, Vec3)> = (0..6).map(|seed| smooth_pose(100 + seed, 0.0, 0.5)).collect();
    let mut vertices = Frames::new(truth.body.vertex_count());
    for (rotations, translation) in &poses {
        vertices.push(&truth.body.posed(&shaped, Pose { rotations, translation: *translation }, None));
    }
    let id = ClipId::new("a", "cut", 0);
    let weights = region_weights(&truth.body.regions);
    let weighted = WeightedBody::new(Arc::new(PackedBody::new(&truth.body)), &weights);
    let objective = Objective::new(weighted, ObjectiveKind::Unposed, &shaped, None);
    let scan = ScanClip { id: id.clone(), fps: FPS, vertices };
    let motion = fit_motion(&objective, &scan, 1, &FitConfig::default(), &Silent).unwrap().clip(id, FPS);
    for (t, (rotations, _)) in poses.iter().enumerate() {
        for (j, (a, b)) in motion.rotations.frame(t).iter().zip(rotations).enumerate() {
            let angle = glam::Quat::from_scaled_axis(*a).angle_between(glam::Quat::from_scaled_axis(*b));
            assert!(angle < 1e-3, "frame {t}, joint {j}: {angle} rad");
        }
    }
}

#[test]
fn smoothness_steadies_a_noisy_joint() {
    let recipe = Recipe { frames: 20, still: 20, noise: 3e-3, ..CLEAN };
    let truth = Truth::new(&recipe);
    let id = ClipId::new("a", "stand", 0);
    let scan = truth.scan(&id, &recipe);
    let weighted = WeightedBody::new(Arc::new(PackedBody::new(&truth.body)), &region_weights(&truth.body.regions));
    let shaped = truth.body.shaped(&truth.beta);
    let jitter = |smoothness: f64| {
        let objective =
            Objective::new(weighted.clone(), ObjectiveKind::Unposed, &shaped, None).with_priors(0.0, smoothness);
        let motion = fit_motion(&objective, &scan, 1, &FitConfig::default(), &Silent).unwrap().clip(id.clone(), FPS);
        let step = |t: usize| {
            (0..24).map(|j| motion.rotations.frame(t)[j].distance(motion.rotations.frame(t - 1)[j])).sum::<f32>()
        };
        (1..20).map(step).sum::<f32>()
    };
    let (free, held) = (jitter(0.0), jitter(1e-4));
    assert!(held < 0.5 * free, "{held} rad with the prior, {free} without");
}

#[test]
fn weights_are_high_on_rigid_parts_and_eq_7_on_flesh() {
    let recipe = Recipe { frames: 40, flesh: 0.015, noise: 3e-4, ..CLEAN };
    let truth = Truth::new(&recipe);
    let ids = clips(&["walk", "run"]);
    let dir = tempfile::tempdir().unwrap();
    let scans = truth.write(&dir.path().join("scans"), &ids, &recipe);
    let fit = fit_set(&scans, &all_train(&ids), &truth.body, &FitConfig::default(), &dir.path().join("fit"), &Silent)
        .unwrap();
    let subject = fit.subject("a").unwrap();
    let mean = |weights: &[f32], vertices: &[u32]| {
        vertices.iter().map(|v| weights[*v as usize]).sum::<f32>() / vertices.len() as f32
    };
    let (belly, head) = (truth.body.regions.vertices(Region::Belly), truth.body.regions.vertices(Region::Head));
    assert!(mean(&subject.fit_weight, &head) > 20.0 * mean(&subject.fit_weight, &belly));
    assert!(mean(&subject.rigidity_weight, &belly) > 5.0 * mean(&subject.rigidity_weight, &head));
    let all: Vec<u32> = (0..truth.body.vertex_count() as u32).collect();
    assert!((mean(&subject.rigidity_weight, &all) - 1.0).abs() < 1e-4);
    assert!(subject.rigidity_weight.iter().all(|w| *w >= 0.05));
}
