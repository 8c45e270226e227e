use softtissue_body::{Region, RegionMap};
use softtissue_geometry::Frames;

/// Regional rms speed below which flesh counts as still, so that a ratio of speeds says nothing: 20 mm/s.
pub const STILL_MM_S: f64 = 20.0;

/// Names under which regions are reported: three groups, the single regions that move, and belly and chest together,
/// which Casas and Otaduy (2018) look at (figs. 7b and 7c).
pub const REPORTED: [&str; 10] =
    ["all", "soft", "rigid", "belly", "chest", "buttocks", "thighs", "upper-arms", "calves", "belly-chest"];

/// The single regions a reported name stands for.
pub fn members(name: &str) -> Vec<Region> {
    let take: fn(Region) -> bool = match name {
        "all" => |_| true,
        "soft" => Region::is_soft,
        "rigid" => |r| !r.is_soft() && r != Region::Calves,
        "belly-chest" => |r| matches!(r, Region::Belly | Region::Chest),
        _ => return Region::ALL.into_iter().filter(|r| r.name() == name).collect(),
    };
    Region::ALL.into_iter().filter(|r| take(*r)).collect()
}

/// Running sums of one quantity: enough for its mean and standard deviation.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Moments {
    /// Samples.
    pub count: u64,
    /// Sum.
    pub sum: f64,
    /// Sum of squares.
    pub sum_of_squares: f64,
}

impl Moments {
    /// Adds a sample.
    pub fn add(&mut self, x: f64) {
        self.count += 1;
        self.sum += x;
        self.sum_of_squares += x * x;
    }
    /// Adds another's samples.
    pub fn merge(&mut self, other: &Self) {
        self.count += other.count;
        self.sum += other.sum;
        self.sum_of_squares += other.sum_of_squares;
    }
    /// Mean, where there is a sample.
    pub fn mean(&self) -> Option<f64> {
        (self.count > 0).then(|| self.sum / self.count as f64)
    }
    /// Root mean square, where there is a sample.
    pub fn rms(&self) -> Option<f64> {
        (self.count > 0).then(|| (self.sum_of_squares / self.count as f64).sqrt())
    }
    /// Standard deviation (of the population), where there is a sample.
    pub fn std(&self) -> Option<f64> {
        let mean = self.mean()?;
        Some((self.sum_of_squares / self.count as f64 - mean * mean).max(0.0).sqrt())
    }
}

/// What is summed over the vertices and frames of one region.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct RegionSums {
    /// Distance of predicted from reference deltas, mm.
    pub error: Moments,
    /// Length of the reference deltas, mm: the error of the body alone.
    pub body_alone: Moments,
    /// Speed of predicted deltas, mm/s (backward differences).
    pub speed: Moments,
    /// Speed of reference deltas, mm/s.
    pub reference_speed: Moments,
}

/// [`RegionSums`] of every region, for one method over any number of clips.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ErrorSums {
    regions: [RegionSums; Region::ALL.len()],
    /// Sum of errors of each region in each frame, mm: the clips' frames one after the other.
    frames: Vec<[f32; Region::ALL.len()]>,
}

impl ErrorSums {
    /// Sums over one clip. `predicted` and `reference` are `[T, V, 3]` deltas in metres.
    /// Panics if their sizes differ from each other or from `regions`.
    pub fn of(predicted: &Frames, reference: &Frames, regions: &RegionMap, fps: f32) -> Self {
        assert_eq!(predicted.len(), reference.len(), "frames to compare");
        assert_eq!(predicted.points_per_frame(), regions.0.len(), "vertices of the prediction");
        assert_eq!(reference.points_per_frame(), regions.0.len(), "vertices of the reference");
        let mut sums = Self::default();
        for t in 0..reference.len() {
            let (p, r) = (predicted.frame(t), reference.frame(t));
            let mut errors = [0.0; Region::ALL.len()];
            for (v, region) in regions.0.iter().enumerate() {
                let s = &mut sums.regions[*region as usize];
                let error = f64::from((p[v] - r[v]).length()) * 1e3;
                s.error.add(error);
                errors[*region as usize] += error;
                s.body_alone.add(f64::from(r[v].length()) * 1e3);
                if t > 0 {
                    let (p0, r0) = (predicted.frame(t - 1)[v], reference.frame(t - 1)[v]);
                    s.speed.add(f64::from((p[v] - p0).length() * fps) * 1e3);
                    s.reference_speed.add(f64::from((r[v] - r0).length() * fps) * 1e3);
                }
            }
            sums.frames.push(errors.map(|e| e as f32));
        }
        sums
    }
    /// Adds another clip's sums.
    pub fn merge(&mut self, other: &Self) {
        for (a, b) in self.regions.iter_mut().zip(&other.regions) {
            a.error.merge(&b.error);
            a.body_alone.merge(&b.body_alone);
            a.speed.merge(&b.speed);
            a.reference_speed.merge(&b.reference_speed);
        }
        self.frames.extend_from_slice(&other.frames);
    }
    /// Sums of one region.
    pub fn region(&self, region: Region) -> &RegionSums {
        &self.regions[region as usize]
    }
    /// Mean and standard deviation of the error in mm over a reported name's vertices.
    pub fn error_mm(&self, name: &str) -> Option<(f64, f64)> {
        let total = self.total(&members(name), |s| s.error);
        Some((total.mean()?, total.std()?))
    }
    /// Mean error of a reported name's vertices in each frame, mm; empty where there is no vertex.
    pub fn over_time(&self, name: &str) -> Vec<f32> {
        let members = members(name);
        let samples = self.total(&members, |s| s.error).count;
        let vertices = samples as f32 / self.frames.len().max(1) as f32;
        if vertices == 0.0 {
            return vec![];
        }
        let sum = |frame: &[f32; Region::ALL.len()]| members.iter().map(|r| frame[*r as usize]).sum::<f32>();
        self.frames.iter().map(|frame| sum(frame) / vertices).collect()
    }
    /// Standard deviation over frames of [`ErrorSums::over_time`], mm.
    pub fn frame_std_mm(&self, name: &str) -> Option<f64> {
        let mut moments = Moments::default();
        self.over_time(name).into_iter().for_each(|mm| moments.add(f64::from(mm)));
        moments.std()
    }
    /// Sum of errors over sum of body-alone errors, over all soft vertices and frames.
    pub fn soft_ratio(&self) -> Option<f64> {
        let soft = members("soft");
        let alone = self.total(&soft, |s| s.body_alone).sum;
        (alone > 0.0).then(|| self.total(&soft, |s| s.error).sum / alone)
    }
    /// Rms speed of predicted over reference deltas, over those of a name's regions whose reference moves
    /// faster than [`STILL_MM_S`]; absent if none does.
    pub fn energy_ratio(&self, name: &str) -> Option<f64> {
        let mut moving = members(name);
        moving.retain(|r| self.region(*r).reference_speed.rms().is_some_and(|v| v > STILL_MM_S));
        let reference = self.total(&moving, |s| s.reference_speed).rms()?;
        Some(self.total(&moving, |s| s.speed).rms()? / reference)
    }
    /// Rms speed of the reference in mm/s.
    pub fn reference_speed(&self, name: &str) -> Option<f64> {
        self.total(&members(name), |s| s.reference_speed).rms()
    }
    fn total(&self, regions: &[Region], part: impl Fn(&RegionSums) -> Moments) -> Moments {
        let mut total = Moments::default();
        regions.iter().for_each(|r| total.merge(&part(self.region(*r))));
        total
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;

    fn regions() -> RegionMap {
        RegionMap(vec![Region::Belly, Region::Belly, Region::Thighs, Region::Calves, Region::Head])
    }

    /// Vertex v moves along X as `amplitude[v] * sin(2 pi f t)`.
    fn wave(amplitude_m: [f32; 5], frames: usize, fps: f32) -> Frames {
        let mut clip = Frames::new(5);
        for t in 0..frames {
            let s = (std::f32::consts::TAU * 3.0 * t as f32 / fps).sin();
            clip.push(&amplitude_m.map(|a| Vec3::X * a * s));
        }
        clip
    }

    #[test]
    fn groups_partition_the_body() {
        let mut parts: Vec<Region> = ["soft", "rigid", "calves"].iter().flat_map(|n| members(n)).collect();
        parts.sort();
        assert_eq!(parts, members("all"));
        assert_eq!(members("upper-arms"), [Region::UpperArms]);
        assert!(members("nose").is_empty());
    }

    #[test]
    fn constant_offsets_give_their_own_mean_and_deviation() {
        let reference = wave([0.01; 5], 60, 60.0);
        let mut predicted = reference.clone();
        for t in 0..60 {
            predicted.frame_mut(t)[0] += Vec3::Y * 0.002;
            predicted.frame_mut(t)[1] += Vec3::Z * 0.004;
        }
        let sums = ErrorSums::of(&predicted, &reference, &regions(), 60.0);
        let (mean, std) = sums.error_mm("belly").unwrap();
        assert!((mean - 3.0).abs() < 1e-4 && (std - 1.0).abs() < 1e-4, "{mean} {std}");
        assert!((sums.error_mm("all").unwrap().0 - 6.0 / 5.0).abs() < 1e-4);
        assert_eq!(sums.error_mm("rigid").unwrap().0, 0.0);
        assert!(sums.error_mm("chest").is_none(), "no vertex, no figure");
        assert!((sums.energy_ratio("soft").unwrap() - 1.0).abs() < 1e-4, "an offset does not move");
    }

    #[test]
    fn scaled_signals_give_the_scale() {
        let reference = wave([0.02, 0.01, 0.02, 0.02, 0.02], 120, 60.0);
        let predicted = wave([0.015, 0.0075, 0.015, 0.03, 0.02], 120, 60.0);
        let sums = ErrorSums::of(&predicted, &reference, &regions(), 60.0);
        assert!((sums.soft_ratio().unwrap() - 0.25).abs() < 1e-4);
        assert!((sums.energy_ratio("soft").unwrap() - 0.75).abs() < 1e-4);
        assert!((sums.energy_ratio("calves").unwrap() - 1.5).abs() < 1e-4);
    }

    #[test]
    fn still_regions_have_no_energy() {
        // 0.5 mm at 3 Hz: rms speed 0.5 * 2 pi 3 / sqrt 2 = 6.7 mm/s, below the threshold; the belly moves.
        let reference = wave([0.02, 0.02, 0.0005, 0.0, 0.0], 120, 60.0);
        let predicted = wave([0.01, 0.01, 0.02, 0.0, 0.0], 120, 60.0);
        let sums = ErrorSums::of(&predicted, &reference, &regions(), 60.0);
        assert!(sums.energy_ratio("thighs").is_none());
        assert!((sums.energy_ratio("soft").unwrap() - 0.5).abs() < 1e-4, "only the belly counts");
    }

    #[test]
    fn pooling_clips_weighs_by_samples() {
        let reference = wave([0.0; 5], 10, 60.0);
        let shifted = |mm: f32, frames| {
            let mut f = Frames::zeros(5, frames);
            f.points_mut().fill(Vec3::X * mm * 1e-3);
            f
        };
        let mut sums = ErrorSums::of(&shifted(1.0, 10), &reference, &regions(), 60.0);
        sums.merge(&ErrorSums::of(&shifted(4.0, 5), &wave([0.0; 5], 5, 60.0), &regions(), 60.0));
        assert!((sums.error_mm("all").unwrap().0 - 2.0).abs() < 1e-5);
        assert!(sums.soft_ratio().is_none(), "no truth to divide by");
        let curve = sums.over_time("soft");
        assert_eq!(curve.len(), 15);
        assert!(curve[..10].iter().all(|e| (e - 1.0).abs() < 1e-5) && (curve[14] - 4.0).abs() < 1e-5, "{curve:?}");
        // two thirds of the frames at 1 mm, the others at 4
        assert!((sums.frame_std_mm("all").unwrap() - 2.0f64.sqrt()).abs() < 1e-5);
        assert!(sums.over_time("chest").is_empty() && sums.frame_std_mm("chest").is_none(), "it has no vertex");
    }

    #[test]
    fn a_group_s_curve_is_the_mean_over_its_own_vertices() {
        let reference = wave([0.0; 5], 3, 60.0);
        let mut predicted = reference.clone();
        for t in 0..3 {
            predicted.frame_mut(t)[0] = Vec3::X * 0.001 * t as f32;
            predicted.frame_mut(t)[2] = Vec3::Y * 0.006;
        }
        let sums = ErrorSums::of(&predicted, &reference, &regions(), 60.0);
        let near = |name: &str, expected: [f32; 3]| {
            let curve = sums.over_time(name);
            assert!(curve.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-5), "{name}: {curve:?}");
        };
        near("belly-chest", [0.0, 0.5, 1.0]);
        near("soft", [2.0, 7.0 / 3.0, 8.0 / 3.0]);
        near("all", [1.2, 1.4, 1.6]);
    }
}
