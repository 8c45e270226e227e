//! The package's people rest with their forearms held forward. Motions count from arms that hang straight, so that such a
//! person's hands would end inside the chest: the rest pose is ours, with straight arms.

use super::bones::JOINTS;
use glam::{Quat, Vec3};

/// Shoulders, elbows, wrists and hands, left and right.
const ARMS: [[usize; 4]; 2] = [[16, 18, 20, 22], [17, 19, 21, 23]];

/// Turns both forearms about their elbows until each goes on where its upper arm points. A vertex turns by the share of
/// the angle that its skin weights `[V]` give to forearm and hand.
pub fn straighten(vertices: &mut [Vec3], joints: &mut [Vec3; JOINTS], weights: &[[f32; JOINTS]]) {
    for [shoulder, elbow, wrist, hand] in ARMS {
        let centre = joints[elbow];
        let (upper, fore) = (centre - joints[shoulder], joints[wrist] - centre);
        let (Some(upper), Some(fore)) = (upper.try_normalize(), fore.try_normalize()) else { continue };
        let straight_from_bent = Quat::from_rotation_arc(fore, upper);
        for (p, w) in vertices.iter_mut().zip(weights) {
            let share = (w[elbow] + w[wrist] + w[hand]).min(1.0);
            if share > 0.0 {
                *p = centre + Quat::IDENTITY.slerp(straight_from_bent, share) * (*p - centre);
            }
        }
        for joint in [wrist, hand] {
            joints[joint] = centre + straight_from_bent * (joints[joint] - centre);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn forearms_go_on_where_upper_arms_point() {
        let mut joints = [Vec3::ZERO; JOINTS];
        for (arm, side) in ARMS.iter().zip([1.0, -1.0]) {
            let points = [[0.2, 1.4, 0.0], [0.4, 1.1, 0.0], [0.5, 1.0, 0.2], [0.55, 0.95, 0.25]];
            arm.iter().zip(points).for_each(|(j, [x, y, z])| joints[*j] = Vec3::new(side * x, y, z));
        }
        let bent = joints;
        let weight = |joint: usize, w: f32| {
            let mut row = [0.0; JOINTS];
            (row[joint], row[0]) = (w, 1.0 - w);
            row
        };
        let mut vertices = vec![bent[20], bent[20], Vec3::Y];
        straighten(&mut vertices, &mut joints, &[weight(18, 1.0), weight(18, 0.5), weight(0, 1.0)]);
        for [shoulder, elbow, wrist, hand] in ARMS {
            let along = (joints[elbow] - joints[shoulder]).normalize();
            assert!((joints[wrist] - joints[elbow]).normalize().dot(along) > 0.9999);
            assert!((joints[hand].distance(joints[wrist]) - bent[hand].distance(bent[wrist])).abs() < 1e-5);
        }
        assert!(vertices[0].distance(joints[20]) < 1e-5 && vertices[2] == Vec3::Y);
        let (before, half, after) = (bent[20] - bent[18], vertices[1] - bent[18], joints[20] - bent[18]);
        assert!((half.angle_between(before) - half.angle_between(after)).abs() < 1e-3);
    }
}
