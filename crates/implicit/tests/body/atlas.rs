use crate::body;
use glam::Vec2;
use softtissue_body::UvAtlas;
use softtissue_implicit::{Atlas, ImplicitError};

/// A smooth field on the body, of wavelengths of 0.7 and 0.9 m and amplitudes of one.
fn smooth() -> Vec<f32> {
    body().template.iter().map(|p| (9.0 * p.y).sin() + (5.0 * p.x + 5.0 * p.z).cos()).collect()
}

/// Root mean square and largest difference of a field from itself after the way to the atlas and back.
fn round_trip(size: usize) -> (f32, f32) {
    let atlas = Atlas::new(&body().topology, &body().uv, size).unwrap();
    let field = smooth();
    let back = atlas.vertices_from_texels().apply(&atlas.texels_from_vertices().apply(&field, 1), 1);
    let errors: Vec<f32> = back.iter().zip(&field).map(|(a, b)| (a - b).abs()).collect();
    let squares: f32 = errors.iter().map(|e| e * e).sum();
    ((squares / errors.len() as f32).sqrt(), errors.into_iter().fold(0.0, f32::max))
}

#[test]
fn weights_are_a_partition_of_unity() {
    for size in [16, 64] {
        let atlas = Atlas::new(&body().topology, &body().uv, size).unwrap();
        let (scatter, gather) = (atlas.texels_from_vertices(), atlas.vertices_from_texels());
        assert_eq!((scatter.rows(), scatter.sources(), scatter.width()), (size * size, body().vertex_count(), 3));
        assert_eq!((gather.rows(), gather.sources()), (body().vertex_count(), size * size));
        assert!(gather.width() <= 4);
        for map in [scatter, gather] {
            for row in map.weights().chunks_exact(map.width()) {
                assert!((row.iter().sum::<f32>() - 1.0).abs() < 1e-5 && row.iter().all(|w| *w >= 0.0));
            }
        }
    }
}

/// The error goes down with the size of a texel, and no vertex draws from a foreign chart.
#[test]
fn a_smooth_field_comes_back() {
    let errors: Vec<(f32, f32)> = [32, 64, 128].map(round_trip).to_vec();
    println!("rms and largest error at 32, 64, 128 texels: {errors:?}");
    assert!(errors[0].0 < 0.12 && errors[1].0 < 0.05 && errors[2].0 < 0.02, "{errors:?}");
    assert!(errors[0].1 < 1.0 && errors[1].1 < 0.4 && errors[2].1 < 0.2, "{errors:?}");
}

#[test]
fn texels_inside_a_triangle_hold_its_barycentric_mean() {
    // two triangles of a square that fills the picture but for a margin
    let topology = softtissue_geometry::Topology { vertex_count: 4, faces: vec![[0, 1, 2], [0, 2, 3]], quads: vec![] };
    let at = [Vec2::new(0.1, 0.1), Vec2::new(0.9, 0.1), Vec2::new(0.9, 0.9), Vec2::new(0.1, 0.9)];
    let uv = UvAtlas { coordinates: at.to_vec(), faces: topology.faces.clone() };
    let atlas = Atlas::new(&topology, &uv, 20).unwrap();
    // linear on the square: u + 10 v
    let field: Vec<f32> = at.iter().map(|p| p.x + 10.0 * p.y).collect();
    let texels = atlas.texels_from_vertices().apply(&field, 1);
    for (i, (value, covered)) in texels.iter().zip(atlas.covered()).enumerate() {
        let centre = Vec2::new((i % 20) as f32 + 0.5, (i / 20) as f32 + 0.5) / 20.0;
        // outside, the value of the closest point of the square
        let inside = centre.clamp(Vec2::splat(0.1), Vec2::splat(0.9));
        assert_eq!(*covered, inside == centre);
        assert!((value - inside.x - 10.0 * inside.y).abs() < 1e-4, "{value} at {centre}");
    }
    let back = atlas.vertices_from_texels().apply(&texels, 1);
    // a corner of the square lies between four texels of which three are in the gutter
    back.iter().zip(&field).for_each(|(a, b)| assert!((a - b).abs() < 0.3, "{a} and {b}"));
}

#[test]
fn what_cannot_be_laid_out_is_refused() {
    let topology = &body().topology;
    let none = Atlas::new(topology, &UvAtlas::default(), 64).unwrap_err();
    assert_eq!(none, ImplicitError::NoTexture { faces: topology.faces.len() });
    assert_eq!(Atlas::new(topology, &body().uv, 0).unwrap_err(), ImplicitError::AtlasSize { size: 0 });
}
