use glam::{Mat3, Quat, Vec3};

/// Rodrigues' formula: `R = I + a [w] + b [w]^2` with `a = sin|w|/|w|`, `b = (1 - cos|w|)/|w|^2`,
/// by series near zero, so that no epsilon shortens the axis.
pub fn rotation_from_axis_angle(w: Vec3) -> Mat3 {
    let (a, b) = rodrigues_coefficients(w.length_squared());
    let k = cross_matrix(w);
    Mat3::IDENTITY + k * a + (k * k) * b
}

/// The axis-angle vector of a rotation, angle in `[0, pi]`.
pub fn axis_angle_from_rotation(r: Mat3) -> Vec3 {
    let q = Quat::from_mat3(&r).normalize();
    let q = if q.w < 0.0 { -q } else { q };
    let v = Vec3::new(q.x, q.y, q.z);
    let s = v.length();
    // angle / sin(angle/2) -> 2 as the angle vanishes
    if s < 1e-6 { v * 2.0 } else { v * (2.0 * s.atan2(q.w) / s) }
}

/// The left Jacobian of SO(3): `exp(w + dw) = exp(J(w) dw) exp(w)` to first order, so that the velocity
/// of a point rotated by `exp(w)` about the origin is `(J dw) x (R p)`.
pub fn left_jacobian(w: Vec3) -> Mat3 {
    let t2 = w.length_squared();
    let (_, b) = rodrigues_coefficients(t2);
    // c = (|w| - sin|w|) / |w|^3
    let c = if t2 < 1e-4 { 1.0 / 6.0 - t2 / 120.0 } else { (t2.sqrt() - t2.sqrt().sin()) / (t2 * t2.sqrt()) };
    let k = cross_matrix(w);
    Mat3::IDENTITY + k * b + (k * k) * c
}

/// `dR/dw_i` for the three components of an axis-angle vector.
pub fn rotation_derivatives(w: Vec3) -> [Mat3; 3] {
    let r = rotation_from_axis_angle(w);
    let j = left_jacobian(w);
    [cross_matrix(j.x_axis) * r, cross_matrix(j.y_axis) * r, cross_matrix(j.z_axis) * r]
}

/// An axis-angle vector seen in the mirror `x -> -x`.
pub fn reflect_axis_angle_x(w: Vec3) -> Vec3 {
    Vec3::new(w.x, -w.y, -w.z)
}

fn rodrigues_coefficients(t2: f32) -> (f32, f32) {
    if t2 < 1e-4 {
        (1.0 - t2 / 6.0 + t2 * t2 / 120.0, 0.5 - t2 / 24.0 + t2 * t2 / 720.0)
    } else {
        let t = t2.sqrt();
        let half = (t * 0.5).sin();
        (t.sin() / t, 2.0 * half * half / t2)
    }
}

fn cross_matrix(w: Vec3) -> Mat3 {
    Mat3::from_cols(Vec3::new(0.0, w.z, -w.y), Vec3::new(-w.z, 0.0, w.x), Vec3::new(w.y, -w.x, 0.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn axis_angles_round_trip() {
        for w in [Vec3::ZERO, Vec3::new(1e-5, 0.0, 2e-5), Vec3::new(0.3, -1.2, 0.5), Vec3::new(0.0, 3.1, 0.0)] {
            let r = rotation_from_axis_angle(w);
            assert!((r * r.transpose()).abs_diff_eq(Mat3::IDENTITY, 2e-6));
            assert!(axis_angle_from_rotation(r).abs_diff_eq(w, 2e-5), "{w} {}", axis_angle_from_rotation(r));
            assert!(r.abs_diff_eq(Mat3::from_quat(Quat::from_scaled_axis(w)), 2e-6));
        }
    }

    #[test]
    fn derivatives_match_finite_differences() {
        for w in [Vec3::new(1e-3, 2e-3, -1e-3), Vec3::new(0.4, -0.9, 0.7), Vec3::new(-1.5, 1.0, 1.2)] {
            let d = rotation_derivatives(w);
            for i in 0..3 {
                let h = 1e-2;
                let mut e = Vec3::ZERO;
                e[i] = h;
                let numeric = (rotation_from_axis_angle(w + e) - rotation_from_axis_angle(w - e)) * (0.5 / h);
                assert!(d[i].abs_diff_eq(numeric, 1e-4), "{w} {i}");
            }
        }
    }
}
