use super::field::{Waves, rms, smoothed, without_shapes};
use glam::Vec3;
use softtissue_body::{BodyModel, Region};
use softtissue_geometry::{Adjacency, vertex_normals};
use softtissue_random::Draws;

/// Static detail of one person: a smooth displacement of the rest mesh along its normals that no shape coefficient
/// can make, `[V]`, metres, of root mean square length `size`. Hands, feet and face keep little of it.
pub(crate) fn static_detail(body: &BodyModel, draws: &mut Draws, size: f32) -> Vec<Vec3> {
    let normals = vertex_normals(&body.template, &body.topology.faces);
    let waves = Waves::draw(draws, 16, 0.18, 0.6);
    let mask: Vec<f32> = body
        .regions
        .0
        .iter()
        .map(|r| match r {
            Region::Hands | Region::Feet => 0.1,
            Region::Head => 0.4,
            _ => 1.0,
        })
        .collect();
    let mask = smoothed(&Adjacency::new(&body.topology), &mask, 12);
    let mut field: Vec<Vec3> =
        (0..body.vertex_count()).map(|v| normals[v] * (mask[v] * waves.at(body.template[v]))).collect();
    without_shapes(body, &mut field);
    let scale = size / rms(&field).max(1e-9);
    field.iter_mut().for_each(|x| *x *= scale);
    field
}
