use glam::{DQuat, DVec3};

/// What a motion asks of the body at one instant, in a form that blends: the solver turns it into joints.
#[derive(Clone, Debug)]
pub(crate) struct Posture {
    /// Where the pelvis joint should be, world, metres.
    pub pelvis: DVec3,
    /// Where the centre of mass should be, world, metres.
    pub mass: DVec3,
    /// By axis: 0 the pelvis is obeyed, 1 the centre of mass.
    pub mass_rules: DVec3,
    /// Pelvis orientation.
    pub turn: DQuat,
    /// Spine joints relative to their parents, axis-angle.
    pub spine: [DVec3; 3],
    /// Neck and head relative to their parents, axis-angle.
    pub neck: DVec3,
    pub head: DVec3,
    /// Left, right.
    pub arms: [Arm; 2],
    /// Left, right.
    pub legs: [Leg; 2],
}

/// An arm in the chest's frame, as if it were the left one; the right is mirrored.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Arm {
    /// Collar, axis-angle (z lifts the shoulder).
    pub collar: DVec3,
    /// Angle of the upper arm from hanging down, radians.
    pub elevation: f64,
    /// Plane of elevation: 0 sideways, pi/2 forward.
    pub azimuth: f64,
    /// Where the elbow bends to.
    pub bend: DVec3,
    /// Elbow flexion.
    pub elbow: f64,
    /// Wrist, axis-angle.
    pub wrist: DVec3,
}

/// A leg: where its ball of the foot is, or how it is lifted.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Leg {
    /// Ball of the foot: x and z on the ground, y the clearance above it.
    pub ball: DVec3,
    /// Toe-out, radians.
    pub toe_out: f64,
    /// Least heel raise, radians; the solver raises more where the leg is too short.
    pub heel: f64,
    /// Whether the foot bears on the ground: then its ball is not moved for reach.
    pub planted: bool,
    /// Posture of a lifted leg.
    pub lift: Lift,
    /// 0 the foot is where `ball` says, 1 where `lift` says.
    pub lifted: f64,
}

/// A lifted leg in the pelvis' frame, radians.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Lift {
    /// Hip flexion.
    pub hip: f64,
    /// Hip abduction.
    pub out: f64,
    /// Knee flexion.
    pub knee: f64,
    /// Foot pitch, toes down.
    pub foot: f64,
}

impl Posture {
    /// Between two postures, `s` in `[0, 1]`.
    pub fn blend(&self, other: &Self, s: f64) -> Self {
        let v = |a: DVec3, b: DVec3| a.lerp(b, s);
        let arms = std::array::from_fn(|i| self.arms[i].blend(&other.arms[i], s));
        let legs = std::array::from_fn(|i| self.legs[i].blend(&other.legs[i], s));
        Self {
            pelvis: v(self.pelvis, other.pelvis),
            mass: v(self.mass, other.mass),
            mass_rules: v(self.mass_rules, other.mass_rules),
            turn: self.turn.slerp(other.turn, s),
            spine: std::array::from_fn(|i| v(self.spine[i], other.spine[i])),
            neck: v(self.neck, other.neck),
            head: v(self.head, other.head),
            arms,
            legs,
        }
    }

    /// Adds a bend of the whole trunk, shared by the three spine joints: axis-angle in the pelvis' frame.
    pub fn bend_trunk(&mut self, w: DVec3) {
        for (joint, share) in self.spine.iter_mut().zip([0.4, 0.35, 0.25]) {
            *joint += w * share;
        }
    }
}

impl Arm {
    /// Between two arms.
    pub fn blend(&self, other: &Self, s: f64) -> Self {
        let f = |a: f64, b: f64| a + (b - a) * s;
        Self {
            collar: self.collar.lerp(other.collar, s),
            elevation: f(self.elevation, other.elevation),
            azimuth: f(self.azimuth, other.azimuth),
            bend: self.bend.lerp(other.bend, s),
            elbow: f(self.elbow, other.elbow),
            wrist: self.wrist.lerp(other.wrist, s),
        }
    }
}

impl Leg {
    fn blend(&self, other: &Self, s: f64) -> Self {
        let f = |a: f64, b: f64| a + (b - a) * s;
        Self {
            ball: self.ball.lerp(other.ball, s),
            toe_out: f(self.toe_out, other.toe_out),
            heel: f(self.heel, other.heel),
            planted: if s < 0.5 { self.planted } else { other.planted },
            lift: if s < 0.5 && self.lifted > 0.0 { self.lift } else { other.lift },
            lifted: f(self.lifted, other.lifted),
        }
    }
}
