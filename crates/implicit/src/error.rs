/// What can go wrong; one sentence each.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum ImplicitError {
    /// A body without texture coordinates.
    #[error("the body has no texture coordinates for its {faces} faces: import it from a file that holds them")]
    NoTexture {
        /// Triangles of the body.
        faces: usize,
    },
    /// An atlas too small to hold anything, or too large for memory.
    #[error("an atlas of {size} texels a side cannot be laid out: give 4 to 4096")]
    AtlasSize {
        /// Texels a side.
        size: usize,
    },
    /// No observer point, or more than there are vertices.
    #[error("{asked} observer points cannot be chosen from {vertices} vertices: give 1 to {vertices}")]
    ObserverCount {
        /// Points asked for.
        asked: usize,
        /// Vertices there are.
        vertices: usize,
    },
    /// A scan that gives no surface.
    #[error("a frame of {points} points with {normals} normals gives no surface: scan it with a normal for each point")]
    NoSurface {
        /// Points of the frame.
        points: usize,
        /// Its normals.
        normals: usize,
    },
    /// A grid that has no cells or too many.
    #[error("a grid of {resolution} cells along {longest} m cannot be laid out: give a box and 4 to 1024 cells")]
    Grid {
        /// Cells along the longest side.
        resolution: usize,
        /// That side, metres.
        longest: f32,
    },
}
