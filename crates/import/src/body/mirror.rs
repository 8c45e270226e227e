//! Left-right symmetry of a mesh that may not be quite symmetric.

use crate::Result;
use crate::arrays::Array;
use glam::Vec3;
use std::collections::HashMap;

/// Partners farther apart than this are none, metres.
const REACH: f32 = 0.02;
/// Pairs that are looked at, at most: SMPL has three million, a heap of points at one place any number.
const COMPARISONS: usize = 100_000_000;

/// The symmetry that a file states.
///
/// # Errors
/// Another length, a vertex past the last, or a map that does not lead back.
pub fn stated(array: &Array, vertices: usize) -> Result<Vec<u32>> {
    array.expect_shape(&[Some(vertices)])?;
    let index = |i: i64| u32::try_from(i).ok().filter(|i| (*i as usize) < vertices);
    let map: Option<Vec<u32>> = array.integers()?.into_iter().map(index).collect();
    let map = map.filter(|m| (0..vertices).all(|v| m[m[v] as usize] as usize == v));
    map.ok_or_else(|| array.refuse("it is no symmetry: it names a vertex past the last or does not lead back"))
}

/// Pairs each vertex with the one nearest to its mirror image under `x -> -x`, and the largest distance between
/// partner and image, metres. Where two want one partner the nearer gets it and the other takes what is left.
///
/// # Errors
/// A vertex without a partner within 2 cm.
pub fn by_geometry(template: &[Vec3]) -> std::result::Result<(Vec<u32>, f32), String> {
    let image = |v: u32| template[v as usize] * Vec3::new(-1.0, 1.0, 1.0);
    let cell = |p: Vec3| (p / REACH).floor().as_ivec3().to_array();
    let mut grid: HashMap<[i32; 3], Vec<u32>> = HashMap::new();
    for (v, p) in template.iter().enumerate() {
        grid.entry(cell(*p)).or_default().push(v as u32);
    }
    let (mut pairs, mut compared) = (Vec::<(f32, u32, u32)>::new(), 0);
    for v in 0..template.len() as u32 {
        let [x, y, z] = cell(image(v));
        let beside = |at: i32| (-1..=1).map(move |step| at.saturating_add(step));
        let around = beside(x).flat_map(|x| beside(y).flat_map(move |y| beside(z).map(move |z| [x, y, z])));
        let cells: Vec<&Vec<u32>> = around.filter_map(|c| grid.get(&c)).collect();
        compared += cells.iter().map(|c| c.len()).sum::<usize>();
        if compared > COMPARISONS {
            return Err(format!("its vertices crowd near vertex {v}, as no body's do; check its units"));
        }
        let mut near: Vec<(f32, u32)> = cells
            .into_iter()
            .flatten()
            .map(|&w| (image(v).distance(template[w as usize]), w))
            .filter(|(d, _)| *d <= REACH)
            .collect();
        near.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        // Each pair is met from both its ends; a dozen candidates leave room for second choices.
        pairs.extend(near.iter().take(12).map(|(d, w)| (*d, v.min(*w), v.max(*w))));
    }
    pairs.sort_by(|a, b| a.0.total_cmp(&b.0).then((a.1, a.2).cmp(&(b.1, b.2))));
    let mut partner = vec![u32::MAX; template.len()];
    let mut worst = 0.0;
    for (d, a, b) in pairs {
        if partner[a as usize] == u32::MAX && partner[b as usize] == u32::MAX {
            (partner[a as usize], partner[b as usize], worst) = (b, a, d);
        }
    }
    match partner.iter().position(|p| *p == u32::MAX) {
        Some(v) => Err(format!(
            "its mesh is not symmetric about x = 0: vertex {v} has no partner within {:.0} mm; add vert_sym_idxs",
            1e3 * REACH
        )),
        None => Ok((partner, worst)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nearly_symmetric_points_pair_up_and_others_are_refused() {
        let mut points = vec![
            Vec3::new(0.1, 0.0, 0.0),
            Vec3::new(0.11, 0.0, 0.0),
            Vec3::new(-0.101, 0.001, 0.0),
            Vec3::new(-0.109, 0.0, 0.001),
            Vec3::new(0.001, 1.0, 0.0),
        ];
        let (pairs, worst) = by_geometry(&points).unwrap();
        assert_eq!(pairs, [2, 3, 0, 1, 4]);
        assert!((worst - 0.002).abs() < 1e-6, "{worst}");
        // farther out than the grid has numbers
        assert_eq!(by_geometry(&[Vec3::new(1e9, 0.0, 1e9), Vec3::new(-1e9, 0.0, 1e9)]).unwrap().0, [1, 0]);
        assert!(by_geometry(&[Vec3::Y; 30_000]).unwrap_err().contains("crowd"));
        points.push(Vec3::new(0.5, 0.0, 0.0));
        assert!(by_geometry(&points).unwrap_err().contains("vertex 5 has no partner"));
    }
}
