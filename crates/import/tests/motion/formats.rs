use super::support::{data, degrees, differences, fixture, on_body, posed, read};
use glam::{DVec3, Mat3, Vec3};
use softtissue_import::motion::{MotionConfig, UpAxis, read_motion};

#[test]
fn bvh_joints_are_where_numpy_has_them() {
    let reference: serde_json::Value =
        serde_json::from_slice(&std::fs::read(fixture("reference.json")).unwrap()).unwrap();
    let read = read(&data("cmu_01_01.bvh"));
    assert_eq!(read.motion.len(), 200);
    let step = reference["step"].as_u64().unwrap() as usize;
    // The wrists are put right, so what hangs on them is elsewhere.
    let below_wrists = |name: &str| ["Wrist", "hand", "Fingers", "Thumb"].iter().any(|part| name.contains(part));
    let (mut compared, mut worst) = (0, 0.0f64);
    for (frame, joints) in reference["frames"].as_array().unwrap().iter().zip(reference["metres"].as_array().unwrap()) {
        let pose = read.motion.pose(frame.as_u64().unwrap() as usize * step);
        for (j, at) in joints.as_array().unwrap().iter().enumerate() {
            assert_eq!(reference["names"][j], read.motion.skeleton.names[j].as_str());
            if below_wrists(&read.motion.skeleton.names[j]) {
                continue;
            }
            let at = DVec3::from_array([0, 1, 2].map(|i| at[i].as_f64().unwrap()));
            worst = worst.max(at.distance(pose.positions[j]));
            compared += 1;
        }
    }
    assert_eq!(compared, 3 * 23);
    assert!(worst < 2e-7, "{worst}");
}

/// The acceptance: 1 degree and 5 mm. The files agree to their last digits.
#[test]
fn one_take_is_the_same_from_bvh_and_from_amc() {
    let [bvh, amc] = ["cmu_01_01.bvh", "01_01.amc"].map(|name| read(&data(name)));
    assert_eq!((bvh.facts.fps, amc.facts.fps), (120.0, 120.0));
    let (angle, distance) = differences(&on_body(&bvh).clip, &on_body(&amc).clip);
    assert!(angle < 0.05 && distance < 2e-4, "{angle} degrees, {distance} m");
    assert_eq!(bvh.facts.guessed, ["units", "up"]);
    assert_eq!(amc.facts.guessed, ["up", "rate"]);
    assert!((bvh.facts.metres_per_unit - amc.facts.metres_per_unit).abs() < 1e-12);
}

/// Other names, units, axes, orders of channels, line ends; a T-pose in front.
#[test]
fn one_motion_is_the_same_as_other_programs_write_it() {
    let plain = read(&fixture("plain.bvh"));
    assert_eq!(plain.facts.units, "metres");
    let ours = on_body(&plain).clip;
    for (name, units, up, naming) in [
        ("motion_builder.bvh", "inches", UpAxis::Z, "MotionBuilder names"),
        ("daz.bvh", "centimetres", UpAxis::Y, "Daz names"),
    ] {
        let other = read(&fixture(name));
        assert_eq!((other.facts.units.as_str(), other.facts.up), (units, up), "{name}");
        assert_eq!((other.facts.naming, other.motion.len()), (naming, 30), "{name}");
        let (angle, distance) = differences(&ours, &on_body(&other).clip);
        assert!(angle < 0.02 && distance < 2e-4, "{name}: {angle} degrees, {distance} m");
    }
}

#[test]
fn what_is_guessed_can_be_overridden() {
    let config = MotionConfig { units_m: Some(0.02), up: Some(UpAxis::Z), fps: Some(50.0), ..Default::default() };
    let [guessed, stated] =
        [MotionConfig::default(), config].map(|config| read_motion(&fixture("daz.bvh"), &config).unwrap());
    assert_eq!((stated.facts.up, stated.facts.fps, stated.facts.guessed.len()), (UpAxis::Z, 50.0, 0));
    let (a, b) = (guessed.motion.pose(3).positions[9], stated.motion.pose(3).positions[9]);
    assert!((DVec3::new(2.0 * a.x, 2.0 * a.z, -2.0 * a.y)).distance(b) < 1e-9, "{a} {b}");
}

/// Where the fixture's generator says that limbs point.
#[test]
fn amass_poses_look_as_they_should() {
    let [first, second] = ["amass_1.npz", "amass_2.npz"].map(|name| on_body(&read(&fixture(name))).clip);
    assert_eq!((first.fps, second.fps), (120.0, 120.0));
    let (angle, distance) = differences(&first, &second);
    assert!(angle < 1e-2 && distance < 1e-5, "{angle} {distance}");
    let (start, at) = posed(&first, 0);
    let (end, at_end) = posed(&first, 11);
    let forearm = |at: [Vec3; 24]| (at[20] - at[18]).normalize();
    // Upright, facing forward, arms out to the sides.
    assert!(degrees(start[0], Mat3::IDENTITY) < 1e-2);
    assert!(forearm(at).angle_between(Vec3::X).to_degrees() < 6.0, "{}", forearm(at));
    assert!((at[15] - at[0]).angle_between(Vec3::Y).to_degrees() < 3.0);
    // The left forearm forward, the head to its left, all else as it was.
    assert!(forearm(at_end).angle_between(Vec3::Z).to_degrees() < 6.0, "{}", forearm(at_end));
    assert!((degrees(start[15], end[15]) - 0.5f32.to_degrees()).abs() < 1e-2);
    assert!((end[15] * Vec3::Z).x > 0.4);
    assert!(degrees(start[17], end[17]) < 1e-2);
    // 0.1 m a frame along x, at our size
    let scale = on_body(&read(&fixture("amass_1.npz"))).scale as f32;
    assert!((at_end[0] - at[0]).abs_diff_eq(Vec3::X * 1.1 * scale, 1e-5), "{}", at_end[0] - at[0]);
}
