use super::cases::{CORNERS, faces};
use crate::SignedDistance;
use glam::{UVec3, Vec3};

/// Cells along the longest side to start from, at least.
const COARSEST: usize = 8;
/// Corners there may be: four bytes each.
const MOST_CORNERS: u64 = 1 << 28;
/// Points of one call of the field.
const BATCH: usize = 1 << 16;

/// Cubic cells in a box, and the field at those of their corners that were asked for.
pub(super) struct Grid {
    low: Vec3,
    step: f32,
    /// Cells along each axis, multiples of `1 << levels`.
    cells: UVec3,
    /// Times that a coarse cell is halved.
    levels: u32,
    /// At the corners, x fastest; NaN where not asked for.
    values: Vec<f32>,
}

impl Grid {
    /// A box of `resolution` cells along its longest side, widened to whole coarse cells; none if it has too many corners.
    pub fn new(low: Vec3, high: Vec3, resolution: usize) -> Option<Self> {
        let levels = (resolution / COARSEST).max(1).ilog2();
        let coarse = 1u32 << levels;
        let step = (high - low).max_element() / resolution as f32;
        let cells = ((high - low) / (step * coarse as f32) - 1e-3).ceil().max(Vec3::ONE).as_uvec3() * coarse;
        let corners: u64 = cells.to_array().iter().map(|n| u64::from(*n) + 1).product();
        if corners > MOST_CORNERS {
            return None;
        }
        let low = 0.5 * (low + high) - 0.5 * step * cells.as_vec3();
        Some(Self { low, step, cells, levels, values: vec![f32::NAN; corners as usize] })
    }

    /// Side of a cell, metres.
    pub fn step(&self) -> f32 {
        self.step
    }
    pub fn value(&self, corner: usize) -> f32 {
        self.values[corner]
    }
    pub fn position(&self, corner: usize) -> Vec3 {
        self.low + self.step * place(corner, self.cells + 1).as_vec3()
    }
    /// The next corner along an axis.
    pub fn beyond(&self, corner: usize, axis: usize) -> usize {
        let n = self.cells + 1;
        corner + [1, n.x as usize, (n.x * n.y) as usize][axis]
    }
    /// Corner `i` of a cell.
    pub fn corner(&self, cell: usize, i: usize) -> usize {
        let at = place(cell, self.cells) + UVec3::new(i as u32 & 1, i as u32 >> 1 & 1, i as u32 >> 2 & 1);
        number(at, self.cells + 1)
    }
    /// Bit `i` is set where corner `i` is inside.
    pub fn pattern(&self, cell: usize) -> u8 {
        (0..CORNERS).fold(0, |bits, i| bits | u8::from(self.values[self.corner(cell, i)] < 0.0) << i)
    }

    /// The finest cells, ascending, of coarse ones that are `wanted` (by middle and half diagonal) and near the surface by
    /// the value at their middle.
    pub fn candidates(&self, field: &dyn SignedDistance, slack: f32, wanted: impl Fn(Vec3, f32) -> bool) -> Vec<usize> {
        let coarse = self.cells >> self.levels;
        let half = |level: u32| 0.5 * self.step * (1u32 << level) as f32;
        let middle = |cell: &UVec3, level: u32| self.low + half(level) * (2 * *cell + 1).as_vec3();
        let mut open: Vec<UVec3> = (0..coarse.element_product() as usize).map(|i| place(i, coarse)).collect();
        let half_diagonal = |level: u32| 3f32.sqrt() * half(level);
        open.retain(|cell| wanted(middle(cell, self.levels), half_diagonal(self.levels)));
        for level in (1..=self.levels).rev() {
            let middles: Vec<Vec3> = open.iter().map(|cell| middle(cell, level)).collect();
            let values = values_at(field, &middles);
            // a value that is no number says nothing, so that the cell stays open
            let near = |value: f32| value.is_nan() || value.abs() <= slack * half_diagonal(level);
            let kept = open.iter().zip(values).filter(|(_, value)| near(*value)).map(|(cell, _)| *cell);
            open = kept.flat_map(|cell| (0..8).map(move |i| 2 * cell + place(i, UVec3::splat(2)))).collect();
        }
        let mut cells: Vec<usize> = open.into_iter().map(|cell| number(cell, self.cells)).collect();
        cells.sort_unstable();
        cells
    }

    /// Asks the field at the corners of `cells`, and of every neighbour that the surface runs into; all of them, ascending.
    pub fn followed(&mut self, field: &dyn SignedDistance, cells: Vec<usize>) -> Vec<usize> {
        let mut known = vec![false; self.cells.element_product() as usize];
        cells.iter().for_each(|cell| known[*cell] = true);
        let mut all = Vec::with_capacity(cells.len());
        let mut new = cells;
        while !new.is_empty() {
            self.ask(field, &new);
            let mut next = Vec::new();
            for &cell in &new {
                for neighbour in self.crossed_neighbours(cell) {
                    if !std::mem::replace(&mut known[neighbour], true) {
                        next.push(neighbour);
                    }
                }
            }
            all.append(&mut new);
            new = next;
        }
        all.sort_unstable();
        all
    }

    /// Cells beyond faces of a cell that the surface crosses. Never outside the grid: its border is all outside the surface.
    fn crossed_neighbours(&self, cell: usize) -> impl Iterator<Item = usize> + '_ {
        let pattern = self.pattern(cell);
        let at = place(cell, self.cells);
        (0..6).zip(faces()).filter_map(move |(face, corners)| {
            let inside = corners.iter().filter(|c| pattern >> **c & 1 == 1).count();
            if inside == 0 || inside == 4 {
                return None;
            }
            let mut to = at.to_array();
            to[face / 2] = if face % 2 == 1 { to[face / 2] + 1 } else { to[face / 2].checked_sub(1)? };
            let to = UVec3::from_array(to);
            to.cmplt(self.cells).all().then(|| number(to, self.cells))
        })
    }

    fn ask(&mut self, field: &dyn SignedDistance, cells: &[usize]) {
        let corners = cells.iter().flat_map(|cell| (0..CORNERS).map(|i| self.corner(*cell, i)));
        let mut corners: Vec<usize> = corners.filter(|c| self.values[*c].is_nan()).collect();
        corners.sort_unstable();
        corners.dedup();
        let positions: Vec<Vec3> = corners.iter().map(|c| self.position(*c)).collect();
        for (corner, value) in corners.into_iter().zip(values_at(field, &positions)) {
            let at = place(corner, self.cells + 1);
            let border = at.cmpeq(UVec3::ZERO).any() || at.cmpeq(self.cells).any();
            // outside is what is no number, and the border, so that the surface closes there
            let value = if value.is_finite() { value } else { self.step };
            self.values[corner] = if border { value.max(1e-3 * self.step) } else { value };
        }
    }
}

fn values_at(field: &dyn SignedDistance, points: &[Vec3]) -> Vec<f32> {
    let mut values = vec![0.0; points.len()];
    points.chunks(BATCH).zip(values.chunks_mut(BATCH)).for_each(|(p, v)| field.values(p, v));
    values
}

/// Column, row and layer of a number in a block of `n`, x fastest.
fn place(number: usize, n: UVec3) -> UVec3 {
    let (x, y) = (n.x as usize, n.y as usize);
    UVec3::new((number % x) as u32, (number / x % y) as u32, (number / (x * y)) as u32)
}

fn number(at: UVec3, n: UVec3) -> usize {
    (at.z as usize * n.y as usize + at.y as usize) * n.x as usize + at.x as usize
}
