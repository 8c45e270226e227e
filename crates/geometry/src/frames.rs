use glam::Vec3;

/// A sequence of `T` frames of `V` points each, stored frame after frame: the `[T, V, 3]` of the papers.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Frames {
    points_per_frame: usize,
    points: Vec<Vec3>,
}

impl Frames {
    /// An empty sequence of frames of `points_per_frame` points.
    pub fn new(points_per_frame: usize) -> Self {
        Self { points_per_frame, points: Vec::new() }
    }
    /// Takes `[T * V]` points. Panics if the length is no multiple of `points_per_frame`.
    pub fn from_points(points_per_frame: usize, points: Vec<Vec3>) -> Self {
        assert!(
            points_per_frame > 0 && points.len().is_multiple_of(points_per_frame),
            "points do not fill whole frames"
        );
        Self { points_per_frame, points }
    }
    /// `T` frames of zeros.
    pub fn zeros(points_per_frame: usize, frames: usize) -> Self {
        Self { points_per_frame, points: vec![Vec3::ZERO; points_per_frame * frames] }
    }
    /// Frames `T`.
    pub fn len(&self) -> usize {
        self.points.len().checked_div(self.points_per_frame).unwrap_or(0)
    }
    /// Whether there is no frame.
    pub fn is_empty(&self) -> bool {
        self.points.is_empty()
    }
    /// Points a frame, `V`.
    pub fn points_per_frame(&self) -> usize {
        self.points_per_frame
    }
    /// Appends a frame of `V` points.
    pub fn push(&mut self, frame: &[Vec3]) {
        assert_eq!(frame.len(), self.points_per_frame, "points in a frame");
        self.points.extend_from_slice(frame);
    }
    /// Frame `t`: `[V]`.
    pub fn frame(&self, t: usize) -> &[Vec3] {
        &self.points[t * self.points_per_frame..(t + 1) * self.points_per_frame]
    }
    /// Frame `t`, to change.
    pub fn frame_mut(&mut self, t: usize) -> &mut [Vec3] {
        &mut self.points[t * self.points_per_frame..(t + 1) * self.points_per_frame]
    }
    /// All frames in order.
    pub fn iter(&self) -> std::slice::ChunksExact<'_, Vec3> {
        self.points.chunks_exact(self.points_per_frame.max(1))
    }
    /// All points, `[T * V]`.
    pub fn points(&self) -> &[Vec3] {
        &self.points
    }
    /// All points, to change.
    pub fn points_mut(&mut self) -> &mut [Vec3] {
        &mut self.points
    }
    /// All numbers, `[T * V * 3]`.
    pub fn to_numbers(&self) -> Vec<f32> {
        self.points.iter().flat_map(|p| p.to_array()).collect()
    }
    /// From `[T * V * 3]` numbers.
    pub fn from_numbers(points_per_frame: usize, numbers: &[f32]) -> Self {
        let points = numbers.as_chunks::<3>().0.iter().map(|p| Vec3::from_array(*p)).collect();
        Self::from_points(points_per_frame, points)
    }
    /// A part of the sequence, `range` in frames.
    pub fn slice(&self, range: std::ops::Range<usize>) -> Self {
        let v = self.points_per_frame;
        Self { points_per_frame: v, points: self.points[range.start * v..range.end * v].to_vec() }
    }
}
