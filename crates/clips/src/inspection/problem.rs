use crate::ClipId;
use serde::Serialize;
use std::fmt;

/// Places that a problem lists.
const LISTED: usize = 8;

/// Kinds of problems, as programs name them.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum ProblemKind {
    /// It cannot be read.
    Unreadable,
    /// Numbers that are none.
    NotFinite,
    /// Frames whose number is missing.
    MissingFrames,
    /// Steps as long as two, as if a frame had been lost.
    DroppedFrames,
    /// Frames that repeat the one before.
    RepeatedFrames,
    /// Points or the whole body jump.
    Teleport,
    /// Vertices change places between frames.
    OrderChange,
    /// Left and right exchanged.
    LeftRightSwap,
    /// Vertex count or connectivity changes.
    TopologyChange,
    /// Lower than the ground.
    BelowFloor,
    /// Faces wound against their neighbours.
    FlippedFaces,
    /// Closed surfaces with their outside in.
    InsideOut,
    /// Edges of more than two faces.
    NonManifoldEdges,
    /// Faces without area.
    DegenerateFaces,
    /// Faces that name vertices which are not there.
    StrayFaces,
    /// Surfaces that cut through themselves.
    SelfIntersection,
    /// Where a body should be closed, it is not.
    NotClosed,
    /// Skin weights that do not sum to one, or joints that move nothing.
    SkinWeights,
    /// Something that should be there is not, or is unfinished.
    Incomplete,
}

impl ProblemKind {
    /// In words.
    pub fn words(self) -> &'static str {
        match self {
            Self::Unreadable => "unreadable",
            Self::NotFinite => "not finite",
            Self::MissingFrames => "missing frames",
            Self::DroppedFrames => "dropped frames",
            Self::RepeatedFrames => "repeated frames",
            Self::Teleport => "teleport",
            Self::OrderChange => "change of vertex order",
            Self::LeftRightSwap => "left-right swap",
            Self::TopologyChange => "change of topology",
            Self::BelowFloor => "below the floor",
            Self::FlippedFaces => "flipped faces",
            Self::InsideOut => "inside out",
            Self::NonManifoldEdges => "non-manifold edges",
            Self::DegenerateFaces => "degenerate faces",
            Self::StrayFaces => "stray faces",
            Self::SelfIntersection => "self-intersection",
            Self::NotClosed => "not closed",
            Self::SkinWeights => "skin weights",
            Self::Incomplete => "incomplete",
        }
    }
}

/// Where a problem is; what does not apply is absent. Counts are from 0.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Place {
    /// Frame.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub frame: Option<usize>,
    /// Vertex.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub vertex: Option<u32>,
    /// Triangle.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub face: Option<u32>,
    /// Vertices of an edge.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub edge: Option<[u32; 2]>,
    /// Joint.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub joint: Option<String>,
}

impl Place {
    /// A frame.
    pub fn frame(frame: usize) -> Self {
        Self { frame: Some(frame), ..Self::default() }
    }
    /// A triangle.
    pub fn face(face: u32) -> Self {
        Self { face: Some(face), ..Self::default() }
    }
    /// An edge.
    pub fn edge(edge: [u32; 2]) -> Self {
        Self { edge: Some(edge), ..Self::default() }
    }
    /// A joint.
    pub fn joint(name: impl Into<String>) -> Self {
        Self { joint: Some(name.into()), ..Self::default() }
    }
    /// A vertex.
    pub fn vertex(vertex: u32) -> Self {
        Self { vertex: Some(vertex), ..Self::default() }
    }
    /// The same place in a frame.
    pub fn in_frame(self, frame: usize) -> Self {
        Self { frame: Some(frame), ..self }
    }
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let mut parts = Vec::new();
        self.frame.iter().for_each(|x| parts.push(format!("frame {x}")));
        self.vertex.iter().for_each(|x| parts.push(format!("vertex {x}")));
        self.face.iter().for_each(|x| parts.push(format!("face {x}")));
        self.edge.iter().for_each(|[a, b]| parts.push(format!("edge {a}-{b}")));
        self.joint.iter().for_each(|x| parts.push(format!("joint {x}")));
        f.write_str(&parts.join(", "))
    }
}

/// Something that is wrong.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Problem {
    /// What kind.
    pub kind: ProblemKind,
    /// In which clip, where there are several.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub clip: Option<ClipId>,
    /// What is wrong, in words.
    pub says: String,
    /// How many frames, faces, ... it is about; 0 where that is not the question.
    pub count: usize,
    /// The first places.
    pub first: Vec<Place>,
}

impl Problem {
    /// A problem without a place.
    pub fn new(kind: ProblemKind, says: impl Into<String>) -> Self {
        Self { kind, clip: None, says: says.into(), count: 0, first: vec![] }
    }

    /// A problem at some places, of which the first are kept.
    pub fn at(kind: ProblemKind, says: impl Into<String>, places: impl IntoIterator<Item = Place>) -> Self {
        let mut problem = Self::new(kind, says);
        places.into_iter().for_each(|place| problem.add(place));
        problem
    }

    /// One more place.
    pub fn add(&mut self, place: Place) {
        self.count += 1;
        if self.first.len() < LISTED {
            self.first.push(place);
        }
    }

    /// The problem as one of a clip.
    pub fn of_clip(self, clip: &ClipId) -> Self {
        Self { clip: Some(clip.clone()), ..self }
    }
}

impl fmt::Display for Problem {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        if let Some(clip) = &self.clip {
            write!(f, "{clip}: ")?;
        }
        write!(f, "{}: {}", self.kind.words(), self.says)?;
        if !self.first.is_empty() {
            let places: Vec<String> = self.first.iter().map(Place::to_string).collect();
            let more = if self.count > places.len() { "; ..." } else { "" };
            write!(f, " ({}{more})", places.join("; "))?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_places_are_kept_and_all_are_counted() {
        let places = (0..20).map(|t| Place::vertex(7).in_frame(t));
        let problem = Problem::at(ProblemKind::Teleport, "a point moves at 99 m/s", places);
        assert_eq!((problem.count, problem.first.len()), (20, LISTED));
        let text = problem.of_clip(&ClipId::new("anna", "hips", 0)).to_string();
        assert!(
            text.starts_with("anna/hips.0: teleport: a point moves at 99 m/s (frame 0, vertex 7; frame 1"),
            "{text}"
        );
        assert!(text.ends_with("; ...)"));
        let json = serde_json::to_value(Problem::at(ProblemKind::FlippedFaces, "x", [Place::face(3)])).unwrap();
        assert_eq!(json, serde_json::json!({"kind": "flipped-faces", "says": "x", "count": 1, "first": [{"face": 3}]}));
    }
}
