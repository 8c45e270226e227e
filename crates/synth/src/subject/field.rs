use glam::Vec3;
use softtissue_body::BodyModel;
use softtissue_geometry::Adjacency;
use softtissue_random::Draws;

/// A smooth scalar field in space: cosines of random directions, wavelengths and phases, about unit rms.
#[derive(Clone, Debug)]
pub(crate) struct Waves(Vec<(Vec3, f32)>);

impl Waves {
    /// `count` waves of wavelengths between `shortest` and `longest` metres.
    pub fn draw(draws: &mut Draws, count: usize, shortest: f64, longest: f64) -> Self {
        let waves = (0..count).map(|_| {
            let direction = Vec3::from_array(std::array::from_fn(|_| draws.normal() as f32)).normalize_or(Vec3::Y);
            let wavelength = draws.range(shortest, longest);
            let phase = draws.range(0.0, std::f64::consts::TAU);
            (direction * (std::f64::consts::TAU / wavelength) as f32, phase as f32)
        });
        Self(waves.collect())
    }

    /// Value at a point.
    pub fn at(&self, p: Vec3) -> f32 {
        let sum: f32 = self.0.iter().map(|(k, phase)| (k.dot(p) + phase).cos()).sum();
        sum * (2.0 / self.0.len() as f32).sqrt()
    }
}

/// A vertex mask smoothed over the mesh, `[V]`.
pub(crate) fn smoothed(adjacency: &Adjacency, mask: &[f32], rounds: usize) -> Vec<f32> {
    let mut mask = mask.to_vec();
    for _ in 0..rounds {
        mask = (0..mask.len())
            .map(|v| {
                let around = adjacency.neighbours(v);
                let mean = around.iter().map(|&n| mask[n as usize]).sum::<f32>() / around.len().max(1) as f32;
                0.5 * (mask[v] + mean)
            })
            .collect();
    }
    mask
}

/// Takes out of a displacement what the body's shape directions can make (least squares).
pub(crate) fn without_shapes(body: &BodyModel, field: &mut [Vec3]) {
    let v = body.vertex_count();
    let mut basis: Vec<Vec<Vec3>> = Vec::new();
    for direction in body.shape_directions.chunks_exact(v) {
        let mut b = direction.to_vec();
        for other in &basis {
            let along = dot(&b, other);
            b.iter_mut().zip(other).for_each(|(x, o)| *x -= *o * along);
        }
        let length = dot(&b, &b).sqrt();
        if length > 1e-6 {
            b.iter_mut().for_each(|x| *x /= length);
            basis.push(b);
        }
    }
    for b in &basis {
        let along = dot(field, b);
        field.iter_mut().zip(b).for_each(|(x, o)| *x -= *o * along);
    }
}

fn dot(a: &[Vec3], b: &[Vec3]) -> f32 {
    a.iter().zip(b).map(|(x, y)| f64::from(x.dot(*y))).sum::<f64>() as f32
}

/// Root mean square length.
pub(crate) fn rms(field: &[Vec3]) -> f32 {
    let sum: f64 = field.iter().map(|x| f64::from(x.length_squared())).sum();
    (sum / field.len().max(1) as f64).sqrt() as f32
}
