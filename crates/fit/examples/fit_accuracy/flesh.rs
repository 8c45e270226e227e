use glam::Vec3;
use softtissue_body::{BodyModel, Region};
use softtissue_clips::DeltaClip;
use softtissue_geometry::Frames;
use std::collections::BTreeMap;
use std::fmt;

/// What the fit found of each soft region's motion.
#[derive(Default)]
pub struct Flesh(BTreeMap<&'static str, Gains>);

#[derive(Default)]
struct Gains {
    deltas: Products,
    velocities: Products,
}

impl Flesh {
    /// Adds a clip of at least one frame.
    pub fn add(&mut self, body: &BodyModel, found: &DeltaClip, truth: &DeltaClip) {
        for (v, region) in body.regions.0.iter().enumerate().filter(|(_, region)| region.is_soft()) {
            let gains = self.0.entry(Region::name(*region)).or_default();
            let (a, b) = (centred(&found.deltas, v), centred(&truth.deltas, v));
            a.iter().zip(&b).for_each(|(a, b)| gains.deltas.add(*a, *b));
            a.windows(2).zip(b.windows(2)).for_each(|(a, b)| gains.velocities.add(a[1] - a[0], b[1] - b[0]));
        }
    }
}

/// One vertex over time, less its mean.
fn centred(deltas: &Frames, v: usize) -> Vec<Vec3> {
    let series: Vec<Vec3> = deltas.iter().map(|frame| frame[v]).collect();
    let mean = series.iter().sum::<Vec3>() / series.len() as f32;
    series.into_iter().map(|x| x - mean).collect()
}

/// Sums of products of found and true vectors.
#[derive(Default)]
struct Products {
    found: f64,
    truth: f64,
    both: f64,
}

impl Products {
    fn add(&mut self, found: Vec3, truth: Vec3) {
        self.found += f64::from(found.length_squared());
        self.truth += f64::from(truth.length_squared());
        self.both += f64::from(found.dot(truth));
    }
}

impl fmt::Display for Products {
    fn fmt(&self, out: &mut fmt::Formatter) -> fmt::Result {
        let Self { found, truth, both } = self;
        write!(out, "{:5.2} {:5.2} {:5.2}", both / truth, (found / truth).sqrt(), both / (found * truth).sqrt())
    }
}

impl fmt::Display for Flesh {
    fn fmt(&self, out: &mut fmt::Formatter) -> fmt::Result {
        writeln!(out, "region: gain of found on true, rms ratio, correlation; the same of velocities")?;
        self.0.iter().try_for_each(|(name, g)| writeln!(out, "  {name:10} {}   {}", g.deltas, g.velocities))
    }
}
