use super::figure::{Figure, JOINTS};
use super::hops::Hopping;
use super::planted;
use super::posture::Posture;
use super::solve::solve;
use super::stage::{A_POSE, REST, Stage};
use super::steps::{Knees, OneLegLoose};
use super::style::{Style, Take};
use crate::{Result, SynthError};
use glam::{DVec2, DVec3};
use softtissue_body::ShapedBody;
use softtissue_clips::{ClipId, MotionClip};
use softtissue_geometry::Frames;

/// The 14 motions of Dyna's protocol. Any of them followed by `_then_stand` stops and stands for the last 2 s;
/// `hop_then_stand` is two hops and then standing.
pub const MOTIONS: [&str; 14] = [
    "chicken_wings",
    "hips",
    "jiggle_on_toes",
    "jumping_jacks",
    "knees",
    "light_hopping_loose",
    "light_hopping_stiff",
    "one_leg_jump",
    "one_leg_loose",
    "punching",
    "running_on_spot",
    "shake_arms",
    "shake_hips",
    "shake_shoulders",
];
/// What ends the name of a motion that comes to rest.
const THEN_STAND: &str = "_then_stand";
/// How long it stands at the end, seconds.
const STANDING: f64 = 2.0;

/// Which clip to make.
#[derive(Clone, Debug)]
pub struct Request<'a> {
    /// Subject's name.
    pub subject: &'a str,
    /// Motion's name.
    pub motion: &'a str,
    /// Take, from 0.
    pub take: u32,
    /// Frames.
    pub frames: usize,
    /// Frames a second.
    pub fps: f32,
    /// Seed of the run.
    pub seed: u64,
}

/// A clip and what only its maker knows.
#[derive(Clone, Debug)]
pub struct Performance {
    /// The motion.
    pub clip: MotionClip,
    /// Whether left and right foot bear on the ground, by frame.
    pub contacts: Vec<[bool; 2]>,
    /// Largest distance by which a bearing foot is missed, metres.
    pub shortfall: f64,
}

/// Whether a motion has this name.
pub fn is_known(motion: &str) -> bool {
    let base = motion.strip_suffix(THEN_STAND).unwrap_or(motion);
    MOTIONS.contains(&base) || motion == "hop_then_stand"
}

/// A motion of a shaped body as a clip; see [`perform`].
pub fn generate(request: &Request, shaped: &ShapedBody, style: &Style) -> Result<MotionClip> {
    Ok(perform(request, &Figure::new(shaped)?, style)?.clip)
}

/// Makes a motion. The same request, figure and style give the same clip.
///
/// # Errors
/// An unknown motion.
pub fn perform(request: &Request, figure: &Figure, style: &Style) -> Result<Performance> {
    if !is_known(request.motion) {
        let known = format!("{}, hop{THEN_STAND}, or one of the others with {THEN_STAND}", MOTIONS.join(", "));
        return Err(SynthError::UnknownMotion { name: request.motion.to_owned(), known });
    }
    let base = request.motion.strip_suffix(THEN_STAND);
    let take = Take::draw(request.seed, request.subject, request.motion, request.take);
    let fps = f64::from(request.fps);
    let duration = request.frames as f64 / fps;
    let stop = base.map(|_| (duration - STANDING - REST).max(A_POSE + 0.6));
    let stage = Stage { figure, style, take: &take, duration, stop };
    let act = Act::new(base.unwrap_or(request.motion), &stage);
    let mut performance = Performance {
        clip: MotionClip {
            id: ClipId::new(request.subject, request.motion, request.take),
            fps: request.fps,
            rotations: Frames::new(JOINTS),
            translations: Vec::with_capacity(request.frames),
        },
        contacts: Vec::with_capacity(request.frames),
        shortfall: 0.0,
    };
    for frame in 0..request.frames {
        let posture = act.posture(&stage, frame as f64 / fps);
        let solved = solve(figure, &posture);
        let rotations = solved.local.map(|q| axis_angle(q).as_vec3());
        performance.clip.rotations.push(&rotations);
        performance.clip.translations.push(solved.translation.as_vec3());
        performance.contacts.push(posture.legs.map(|l| l.planted));
        performance.shortfall = performance.shortfall.max(solved.shortfall);
    }
    Ok(performance)
}

/// The rotation by at most half a turn.
fn axis_angle(q: glam::DQuat) -> DVec3 {
    let q = if q.w < 0.0 { -q } else { q };
    q.to_scaled_axis()
}

/// A planned motion.
enum Act {
    Planted(String, [DVec2; 2]),
    Hopping(Box<Hopping>),
    Knees(Knees),
    OneLegLoose(OneLegLoose),
}

impl Act {
    fn new(name: &str, stage: &Stage) -> Self {
        if let Some(width) = planted::stance_width(name) {
            Self::Planted(name.to_owned(), stage.places(width))
        } else if let Some(hopping) = Hopping::new(name, stage) {
            Self::Hopping(Box::new(hopping))
        } else if name == "knees" {
            Self::Knees(Knees::new(stage))
        } else {
            Self::OneLegLoose(OneLegLoose::new(stage))
        }
    }

    /// The motion blended with the A-pose; the legs follow their own footing throughout.
    fn posture(&self, stage: &Stage, t: f64) -> Posture {
        let (places, active, envelope) = match self {
            Self::Planted(name, places) => (*places, planted::posture(name, stage, *places, t), stage.envelope(t)),
            Self::Hopping(h) => (h.places(), h.posture(stage, t), h.envelope(t)),
            Self::Knees(k) => (k.places(), k.posture(stage, t), stage.envelope(t)),
            Self::OneLegLoose(o) => (o.places(), o.posture(stage, t), stage.envelope(t)),
        };
        let mut start = stage.a_pose(places, t);
        // the A-pose stands by its pelvis: it has no height of the centre of mass of its own to blend from
        start.mass.y = active.mass.y;
        let mut posture = start.blend(&active, envelope);
        posture.legs = active.legs;
        posture
    }
}
