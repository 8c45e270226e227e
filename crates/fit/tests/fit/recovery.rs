use crate::figure::smooth_pose;
use crate::scans::{CLEAN, FPS, Recipe, Truth, all_train, joint_errors, mean_distance, median};
use glam::Vec3;
use softtissue_body::{Pose, Region};
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
    // a pull towards the mean shape would show at this accuracy, and so would a template made of rounding
    let config = FitConfig { shape_prior: 1e-12, subject_template: false, tolerance: 1e-4, ..Default::default() };
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
    let recipe = Recipe { frames: 60, pose_size: 0.3, flesh: 0.012, detail: 0.005, noise: 7e-4, still: 15 };
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
    let (with_template, degrees) = error(&FitConfig::default(), "with");
    let (without, _) = error(&FitConfig { subject_template: false, ..Default::default() }, "without");
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

/// Casas-Otaduy 2018, figure 3: an error matched in the posed state turns into garbage when it is unposed.
#[test]
fn the_unposed_objective_gives_the_smaller_deltas_where_bones_meet_at_an_angle() {
    let recipe = Recipe { frames: 20, pose_size: 0.75, flesh: 0.02, ..CLEAN };
    let truth = Truth::new(&recipe);
    let id = ClipId::new("a", "bend", 0);
    let scan = truth.scan(&id, &recipe);
    let packed = Arc::new(PackedBody::new(&truth.body));
    let weights = vec![1.0; truth.body.vertex_count()];
    let shaped = truth.body.shaped(&truth.beta);
    let size = |kind| {
        let objective = Objective::new(WeightedBody::new(packed.clone(), &weights), kind, &shaped, None);
        let motion = fit_motion(&objective, &scan, 1, &FitConfig::default(), &Silent).unwrap().clip(id.clone(), FPS);
        let mut sum = 0.0;
        for t in 0..recipe.frames {
            let pose = Pose { rotations: motion.rotations.frame(t), translation: motion.translations[t] };
            let unposed =
                Objective::new(WeightedBody::new(packed.clone(), &weights), ObjectiveKind::Unposed, &shaped, None);
            sum += unposed.value(pose, scan.vertices.frame(t));
        }
        (sum / recipe.frames as f64).sqrt()
    };
    let (unposed, posed) = (size(ObjectiveKind::Unposed), size(ObjectiveKind::Posed));
    println!("rms delta: {:.3} mm from the unposed objective, {:.3} mm from the posed one", 1e3 * unposed, 1e3 * posed);
    assert!(unposed < 0.99 * posed, "{unposed} m unposed, {posed} m posed");
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
            Objective::new(weighted.clone(), ObjectiveKind::Unposed, &shaped, None).with_smoothness(smoothness);
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
