//! The neutral figure and how the eight knobs change it: rest joints and implicit surface, A-pose, soles at
//! `y = 0`, facing +Z, metres.

use super::implicit::{Cone, Group, Implicit, Loft, Mirrored, Primitive, Section};
use super::parameters::ShapeParameters;
use super::parts::Landmarks;
use super::skeleton::{JOINTS, joints};
use glam::{Mat3, Vec3};

const fn v(x: f32, y: f32, z: f32) -> Vec3 {
    Vec3::new(x, y, z)
}

/// A body described by its knobs.
#[derive(Clone, Debug)]
pub struct Figure {
    /// The knobs.
    pub parameters: ShapeParameters,
    /// Rest joints `[24]`.
    pub joints: [Vec3; JOINTS],
    /// Size against the neutral body.
    pub scale: f32,
    surface: Implicit,
    near_middle: Implicit,
}

/// A place that wants more vertices.
struct Detail {
    centre: Vec3,
    radius: f32,
    /// Share by which the grid is drawn together at the centre.
    squeeze: f32,
}

impl Detail {
    fn weight(&self, p: Vec3) -> f32 {
        (-p.distance_squared(self.centre) / (self.radius * self.radius)).exp()
    }
}

/// How strongly body mass widens each part: girth is `exp(rate * mass)`.
struct Girth {
    mass: f32,
    muscle: f32,
    pear: f32,
}

impl Girth {
    fn of(&self, p: &ShapeParameters) -> f32 {
        (self.mass * (1.25 + 1.2 * p.mass) + self.muscle * p.muscle + self.pear * p.pear).exp()
    }
}

const fn girth(mass: f32, muscle: f32, pear: f32) -> Girth {
    Girth { mass, muscle, pear }
}

impl Figure {
    /// Builds the body of `parameters`.
    pub fn new(parameters: ShapeParameters) -> Self {
        let scale = parameters.scale();
        let joints = joints(&parameters);
        let mut figure =
            Self { parameters, joints, scale, surface: Implicit::default(), near_middle: Implicit::default() };
        let (arm, leg, foot) = (figure.arm(), figure.leg(), figure.foot());
        let own = [figure.torso(), figure.head(), arm, leg.clone(), foot];
        let k = 0.018 * scale;
        figure.near_middle = Implicit { k, groups: own.iter().cloned().chain([leg.mirrored()]).collect() };
        figure.surface = Implicit { k, groups: own.to_vec() };
        figure
    }

    /// The surface as seen from the left half (`x >= 0`): the right limbs do not exist there, save the right
    /// thigh next to the crotch.
    pub fn surface(&self, p: Vec3) -> &Implicit {
        if p.x < 0.06 * self.scale && p.y > self.joints[4].y { &self.near_middle } else { &self.surface }
    }

    /// Newton projection of a point with `x >= 0`.
    pub fn project(&self, p: Vec3, steps: usize) -> Vec3 {
        self.surface(p).project(p, steps)
    }

    /// Outward normal near the surface.
    pub fn normal(&self, p: Vec3) -> Vec3 {
        self.surface(p).sample(p).1.normalize_or_zero()
    }

    /// How densely vertices are wanted: 1 on plain parts, more at the head, hands, feet and breasts.
    pub fn detail(&self, p: Vec3) -> f32 {
        let p = Vec3::new(p.x.abs(), p.y, p.z);
        1.0 + self.details().iter().map(|d| 1.5 * d.squeeze * d.weight(p)).sum::<f32>()
    }

    /// Pulls a point of the left half towards the nearest details: a grid warped so is denser there.
    pub fn warp(&self, p: Vec3) -> Vec3 {
        p - self.details().iter().map(|d| (p - d.centre) * (d.squeeze * d.weight(p))).sum::<Vec3>()
    }

    fn details(&self) -> [Detail; 4] {
        let s = self.scale;
        let detail = |centre: Vec3, radius: f32, squeeze: f32| Detail { centre, radius: radius * s, squeeze };
        [
            detail(self.joints[15] + v(0.0, 0.06, 0.07) * s, 0.13, 0.45),
            detail(self.joints[22] + v(0.020, -0.022, 0.01) * s, 0.11, 0.50),
            detail(self.joints[10] + v(0.005, 0.0, 0.035) * s, 0.09, 0.32),
            detail(self.breast_extent().0, 0.09, 0.22),
        ]
    }

    /// Where things are on it.
    pub fn landmarks(&self) -> Landmarks {
        Landmarks { joints: self.joints, scale: self.scale, breast: self.breast_extent() }
    }

    /// The whole left half in one implicit, for extraction.
    pub fn left_half(&self) -> &Implicit {
        &self.near_middle
    }

    fn torso(&self) -> Group {
        let p = &self.parameters;
        let s = self.scale;
        let (pelvis, neck) = (self.joints[0], self.joints[12]);
        let crotch = pelvis.y - 0.125 * s;
        let length = neck.y + 0.03 * s - crotch;
        let hip = girth(0.074, 0.010, 0.040).of(p);
        let waist = girth(0.106, 0.005, -0.020).of(p);
        let chest = girth(0.068, 0.022, -0.015).of(p);
        let top = girth(0.030, 0.030, 0.0).of(p);
        let shoulder = self.joints[16].x / (0.168 * s);
        let belly = (1.0 + 0.045 * p.belly) * (1.0 + 0.03 * p.mass.max(-1.0));
        // (fraction of height, half width, front, back, centre z, width factor, depth factor)
        let rows: [(f32, f32, f32, f32, f32, f32, f32); 13] = [
            (0.00, 0.030, 0.030, 0.034, -0.012, 1.0, 1.0),
            (0.06, 0.082, 0.062, 0.060, -0.010, hip, hip),
            (0.13, 0.142, 0.088, 0.082, -0.008, hip, hip),
            (0.21, 0.166, 0.096, 0.086, -0.006, hip, hip),
            (0.29, 0.160, 0.099, 0.082, -0.004, 0.7 * hip + 0.3 * waist, 0.3 * hip + 0.7 * waist * belly),
            (0.38, 0.137, 0.094, 0.076, -0.001, 0.3 * hip + 0.7 * waist, waist * belly),
            (0.47, 0.126, 0.090, 0.075, 0.000, waist, waist * belly),
            (0.56, 0.127, 0.091, 0.081, -0.002, waist, 0.5 * (waist + chest)),
            (0.66, 0.140, 0.098, 0.092, -0.008, chest, chest),
            (0.77, 0.147, 0.096, 0.098, -0.014, chest, chest),
            (0.87, 0.130, 0.072, 0.086, -0.022, chest * shoulder, 0.5 * (chest + top)),
            (0.95, 0.084, 0.048, 0.062, -0.026, top * shoulder, top),
            (1.00, 0.042, 0.036, 0.042, -0.026, top, top),
        ];
        let sections = rows
            .iter()
            .map(|&(at, w, f, b, z, fw, fd)| Section {
                at: at * length,
                width: w * s * fw,
                front: f * s * fd,
                back: b * s * fd,
                x: 0.0,
                z: z * s,
            })
            .collect();
        let loft = Loft::new(v(0.0, crotch, 0.0), Vec3::Y, Vec3::Z, sections, 2.25);
        let mut parts = vec![Primitive::Loft(loft)];
        let mut pair = |cone: Cone| {
            parts.push(Primitive::Cone(cone));
            parts.push(Primitive::Cone(cone.mirrored()));
        };
        pair(self.buttock(hip));
        pair(self.breast(chest));
        pair(self.trapezius(top));
        Group::new(0.022 * s, parts)
    }

    fn buttock(&self, hip: f32) -> Cone {
        let s = self.scale;
        let centre = v(0.072 * hip, 0.0, -0.058 * hip) * s + Vec3::Y * (self.joints[0].y - 0.055 * s);
        Cone::ellipsoid(centre, v(0.070, 0.080, 0.056) * s * hip, Mat3::IDENTITY)
    }

    fn breast(&self, chest: f32) -> Cone {
        let (s, p) = (self.scale, &self.parameters);
        let size = (0.13 * p.breast + 0.085 * p.mass).exp();
        let radius = 0.050 * s * size;
        let sag = 0.012 * s * (size - 1.0).max(-0.3);
        let centre = v(0.076 * s * chest, self.joints[9].y - 0.020 * s - sag, (0.068 * chest + 0.006 * size) * s);
        Cone::ellipsoid(centre, v(1.04, 1.0, 0.98) * radius, Mat3::IDENTITY)
    }

    /// Centre and radius of the left breast.
    pub fn breast_extent(&self) -> (Vec3, f32) {
        let s = self.scale;
        (v(0.076 * s, self.joints[9].y - 0.020 * s, 0.074 * s), 0.050 * s)
    }

    fn trapezius(&self, top: f32) -> Cone {
        let s = self.scale;
        let neck = self.joints[12] + v(0.018, 0.012, -0.012) * s;
        let tip = self.joints[16] + v(-0.012, 0.006, 0.0) * s;
        Cone::new(neck, 0.034 * s * top, tip, 0.036 * s * top)
    }

    fn head(&self) -> Group {
        let (s, p) = (self.scale, &self.parameters);
        let h = self.joints[15];
        let face = girth(0.026, 0.0, 0.0).of(p);
        let at = |x: f32, y: f32, z: f32| h + v(x * face, y, z) * s;
        let ball = |c: Vec3, r: Vec3| Cone::ellipsoid(c, r * s * v(face, 1.0, face), Mat3::IDENTITY);
        let neck_girth = girth(0.055, 0.025, 0.0).of(p);
        let neck = Cone::new(
            self.joints[12] + v(0.0, -0.02, -0.004) * s,
            0.053 * s * neck_girth,
            h + v(0.0, 0.03, -0.006) * s,
            0.047 * s * neck_girth,
        );
        let double_chin = 0.004 * (p.mass + 0.5).max(0.0);
        let mut parts = vec![
            neck,
            ball(at(0.0, 0.120, -0.006), v(0.071, 0.083, 0.088)),
            // cheeks and jaw, chin, lips
            ball(at(0.0, 0.060, 0.026), v(0.055, 0.072, 0.056)),
            ball(at(0.0, 0.010, 0.054 - double_chin), v(0.022, 0.017 + double_chin, 0.022)),
            ball(at(0.0, 0.034, 0.068), v(0.021, 0.012, 0.018)),
            // brow, bridge and tip of the nose
            ball(at(0.0, 0.106, 0.062), v(0.044, 0.011, 0.021)),
            Cone::new(at(0.0, 0.102, 0.077), 0.009 * s, at(0.0, 0.078, 0.089), 0.011 * s),
            ball(at(0.0, 0.069, 0.085), v(0.016, 0.013, 0.021)),
        ];
        let mut hollows = Vec::new();
        for side in [1.0, -1.0] {
            parts.push(ball(at(side * 0.074, 0.076, -0.008), v(0.010, 0.031, 0.019)));
            hollows.push(ball(at(side * 0.031, 0.088, 0.094), v(0.018, 0.012, 0.018)));
        }
        Group::new(0.007 * s, parts.into_iter().map(Primitive::Cone).collect()).without(hollows)
    }

    fn arm(&self) -> Group {
        let (s, p) = (self.scale, &self.parameters);
        let (shoulder, elbow, wrist) = (self.joints[16], self.joints[18], self.joints[20]);
        let upper = girth(0.082, 0.045, 0.0).of(p);
        let lower = girth(0.045, 0.035, 0.0).of(p);
        let thin = girth(0.020, 0.010, 0.0).of(p);
        // (bone, fraction, width, front, back, factor): width is in the plane of the arm
        let rows = [
            (0, -0.06, 0.036, 0.038, 0.040, upper),
            (0, 0.12, 0.048, 0.048, 0.048, upper),
            (0, 0.35, 0.043, 0.045, 0.044, upper),
            (0, 0.65, 0.038, 0.041, 0.039, upper),
            (0, 0.95, 0.033, 0.034, 0.034, 0.5 * (upper + lower)),
            (1, 0.22, 0.036, 0.038, 0.036, lower),
            (1, 0.55, 0.030, 0.032, 0.031, lower),
            (1, 0.88, 0.020, 0.026, 0.025, thin),
            (1, 1.0, 0.018, 0.026, 0.026, thin),
        ];
        let loft = limb_loft([shoulder, elbow, wrist], &rows, s, 2.0);
        let mut parts = vec![Primitive::Loft(loft)];
        let deltoid = girth(0.050, 0.040, 0.0).of(p);
        let along = (elbow - shoulder).normalize();
        parts.push(Primitive::Cone(Cone::new(
            shoulder + v(-0.006, -0.006, 0.0) * s,
            0.046 * s * deltoid,
            shoulder + along * 0.07 * s,
            0.036 * s * deltoid,
        )));
        self.hand(&mut parts, thin);
        Group::new(0.010 * s, parts)
    }

    fn hand(&self, parts: &mut Vec<Primitive>, girth: f32) {
        let s = self.scale;
        let (wrist, knuckle) = (self.joints[20], self.joints[22]);
        let u = (knuckle - wrist).normalize();
        let n = u.cross(Vec3::Z).normalize();
        let w = n.cross(u);
        // palm, then the four fingers together, slightly curled; the thumb points forward
        let at = |along: f32, wide: f32, thick: f32| wrist + (u * along + w * wide + n * thick) * s;
        let g = s * girth;
        let cone = |a: Vec3, ra: f32, b: Vec3, rb: f32| Cone::new(a, ra * g, b, rb * g);
        parts.extend(
            [
                cone(at(0.010, 0.0, 0.0), 0.027, at(0.072, 0.0, 0.0), 0.039).thinner(n, 2.2),
                cone(at(0.080, -0.002, 0.0), 0.036, at(0.158, -0.004, 0.012), 0.029).thinner(n, 2.2),
                cone(at(0.024, 0.016, 0.003), 0.017, at(0.056, 0.050, 0.008), 0.0135),
                cone(at(0.056, 0.050, 0.008), 0.0135, at(0.086, 0.066, 0.012), 0.011),
            ]
            .map(Primitive::Cone),
        );
    }

    fn leg(&self) -> Group {
        let (s, p) = (self.scale, &self.parameters);
        let (hip, knee, ankle) = (self.joints[1], self.joints[4], self.joints[7]);
        let thigh = girth(0.078, 0.028, 0.030).of(p);
        let calf = girth(0.048, 0.030, 0.010).of(p);
        let joint = girth(0.034, 0.008, 0.0).of(p);
        let rows = [
            (0, -0.16, 0.050, 0.054, 0.054, thigh),
            (0, -0.03, 0.077, 0.076, 0.075, thigh),
            (0, 0.12, 0.083, 0.083, 0.083, thigh),
            (0, 0.30, 0.081, 0.083, 0.077, thigh),
            (0, 0.55, 0.069, 0.074, 0.066, thigh),
            (0, 0.82, 0.054, 0.056, 0.054, 0.5 * (thigh + joint)),
            (0, 0.97, 0.049, 0.050, 0.050, joint),
            (1, 0.10, 0.047, 0.044, 0.054, joint),
            (1, 0.30, 0.051, 0.042, 0.066, calf),
            (1, 0.50, 0.045, 0.039, 0.056, calf),
            (1, 0.75, 0.033, 0.034, 0.038, 0.5 * (calf + joint)),
            (1, 0.93, 0.030, 0.034, 0.034, joint),
            (1, 1.04, 0.030, 0.036, 0.036, joint),
        ];
        let loft = limb_loft([hip, knee, ankle], &rows, s, 2.0);
        // thighs may touch at the middle plane, never merge
        Group::new(0.008 * s, vec![Primitive::Loft(loft)]).cut(Vec3::NEG_X, -0.007 * s, 0.006 * s)
    }

    fn foot(&self) -> Group {
        let (s, p) = (self.scale, &self.parameters);
        let g = s * girth(0.018, 0.0, 0.0).of(p);
        let (ankle, ball) = (self.joints[7], self.joints[10]);
        let forward = ((ball - ankle) * v(1.0, 0.0, 1.0)).normalize();
        let side = Vec3::Y.cross(forward);
        let ground = ankle * v(1.0, 0.0, 1.0);
        let at = |along: f32, wide: f32, up: f32| ground + (forward * along + side * wide + Vec3::Y * up) * s;
        let cone = |a: Vec3, ra: f32, b: Vec3, rb: f32| Cone::new(a, ra * g, b, rb * g);
        let parts = vec![
            Primitive::Cone(cone(at(-0.028, 0.0, 0.036), 0.034, at(0.02, 0.0, 0.050), 0.038)),
            Primitive::Cone(cone(at(0.0, 0.0, 0.058), 0.036, at(0.085, 0.0, 0.034), 0.030)),
            Primitive::Cone(cone(at(0.06, 0.002, 0.024), 0.040, at(0.118, 0.004, 0.020), 0.044).thinner(Vec3::Y, 1.55)),
            Primitive::Cone(
                cone(at(0.118, 0.004, 0.018), 0.043, at(0.162, -0.004, 0.016), 0.040).thinner(Vec3::Y, 1.9),
            ),
            Primitive::Cone(cone(at(-0.03, 0.0, 0.02), 0.030, at(0.10, 0.004, 0.015), 0.036)),
        ];
        Group::new(0.010 * s, parts).cut(Vec3::NEG_Y, 0.0, 0.004 * s)
    }
}

/// A limb over two bones: rows of (bone, fraction, width, front, back, girth), neutral metres.
fn limb_loft(joints: [Vec3; 3], rows: &[(usize, f32, f32, f32, f32, f32)], s: f32, exponent: f32) -> Loft {
    let origin = joints[0];
    let axis = (joints[2] - joints[0]).normalize();
    let depth = (Vec3::Z - axis * axis.z).normalize();
    let across = axis.cross(depth);
    let sections = rows
        .iter()
        .map(|&(bone, t, width, front, back, g)| {
            let centre = joints[bone] + (joints[bone + 1] - joints[bone]) * t - origin;
            Section {
                at: centre.dot(axis),
                width: width * s * g,
                front: front * s * g,
                back: back * s * g,
                x: centre.dot(across),
                z: centre.dot(depth),
            }
        })
        .collect();
    Loft::new(origin, axis, depth, sections, exponent)
}
