use softtissue_body::BodyError;
use softtissue_clips::{ClipError, ClipId};
use softtissue_store::StoreError;

/// What can go wrong in a fit; one sentence each.
#[derive(Debug, thiserror::Error)]
pub enum FitError {
    /// A clip or a set of clips.
    #[error(transparent)]
    Clip(#[from] ClipError),
    /// The body.
    #[error(transparent)]
    Body(#[from] BodyError),
    /// The disk.
    #[error(transparent)]
    Store(#[from] StoreError),
    /// The scans are not in the body's template topology.
    #[error(
        "the scans have {scans} vertices a frame and the body has {body}: fit them with the body whose template they are registered to"
    )]
    VertexCount {
        /// Vertices of the scans.
        scans: usize,
        /// Vertices of the body.
        body: usize,
    },
    /// Equal counts, other connectivity.
    #[error(
        "the scans' topology is {scans}, the body's is {body}: equal vertex counts, but other vertices; fit them with the body whose template they are registered to"
    )]
    Topology {
        /// Hash of the scans' topology.
        scans: String,
        /// Hash of the body's topology.
        body: String,
    },
    /// A number that is none.
    #[error("clip {clip}, frame {frame}, vertex {vertex} is not finite; mend the scan or leave the clip out")]
    NotFinite {
        /// Which clip.
        clip: String,
        /// Which frame.
        frame: usize,
        /// Which vertex.
        vertex: usize,
    },
    /// A clip without a frame.
    #[error("clip {0} has no frame; leave it out")]
    Empty(ClipId),
    /// A training clip that the body cannot be brought near.
    #[error(
        "clip {clip}: after the fit its vertices still lie {distance_m:.3} m from the body; are its units metres, is Y up, and is its vertex order the template's?"
    )]
    NotThisBody {
        /// Which clip.
        clip: ClipId,
        /// Weighted rms distance, metres.
        distance_m: f64,
    },
    /// A setting outside its range.
    #[error("fit.{field} = {value}: {remedy}")]
    Config {
        /// Which setting.
        field: &'static str,
        /// Its value.
        value: String,
        /// What it may be.
        remedy: &'static str,
    },
    /// A setting of the registration outside its range.
    #[error("registration.{field} = {value}: {remedy}")]
    Registration {
        /// Which setting.
        field: &'static str,
        /// Its value.
        value: String,
        /// What it may be.
        remedy: &'static str,
    },
    /// A raw scan that the body cannot be brought near.
    #[error(
        "clip {clip}, frame {frame}: half of its points lie farther than {distance_m:.3} m from the body after registration; is it one whole person, are its units metres, and is Y up?"
    )]
    Lost {
        /// Which clip.
        clip: ClipId,
        /// Which frame.
        frame: usize,
        /// Median distance, metres.
        distance_m: f32,
    },
    /// A raw scan with hardly a point.
    #[error("clip {clip}, frame {frame} has {points} points, too few for a body; leave it out")]
    Sparse {
        /// Which clip.
        clip: ClipId,
        /// Which frame.
        frame: usize,
        /// Its points.
        points: usize,
    },
    /// A template whose triangles cannot hold deltas.
    #[error("the body's mesh has no triangle form: {reason}")]
    Mesh {
        /// What is wrong with it.
        reason: &'static str,
    },
    /// A solver's own failure.
    #[error("clip {clip}: {reason}")]
    Solver {
        /// Which clip.
        clip: ClipId,
        /// What happened, and what to do.
        reason: String,
    },
    /// The user asked to stop; nothing is finished, and the same command starts the fit again.
    #[error("the fit was stopped before it finished")]
    Stopped,
}
