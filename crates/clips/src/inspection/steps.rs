/// The longest way of a point to each frame, by number; 0 where the frame repeats the one before.
#[derive(Clone, Debug, Default)]
pub(super) struct Steps(Vec<(usize, f32)>);

/// A body that comes to rest or sets off by itself does so gently: the step beside a pause is shorter than this share of
/// the next one. A frozen picture stops and goes at once.
const ABRUPT: f32 = 0.5;

impl Steps {
    /// One frame more.
    pub fn push(&mut self, frame: usize, way: f32) {
        self.0.push((frame, way));
    }

    /// Frames that repeat the one before, pauses that a body makes by itself left out.
    pub fn repeated(&self) -> Vec<usize> {
        let mut found = Vec::new();
        let step = |k: usize, before: usize| self.0.get(k).filter(|s| s.0 == before).map(|s| s.1);
        let mut k = 0;
        while k < self.0.len() {
            let first = k;
            while k < self.0.len() && self.0[k].1 == 0.0 && self.0[k].0 == self.0[first].0 + k - first {
                k += 1;
            }
            if k == first {
                k += 1;
                continue;
            }
            let (start, end) = (self.0[first].0, self.0[k - 1].0);
            let back = |n: usize| step(first.checked_sub(n)?, start.checked_sub(n)?);
            let on = |n: usize| step(k + n - 1, end + n);
            let abrupt = |near: Option<f32>, far: Option<f32>| match (near, far) {
                (Some(near), Some(far)) => near > ABRUPT * far,
                (Some(near), None) => near > 0.0,
                _ => false,
            };
            let still = self.0.iter().all(|s| s.1 == 0.0);
            if still || abrupt(back(1), back(2)) || abrupt(on(1), on(2)) {
                found.extend(self.0[first..k].iter().map(|s| s.0));
            }
        }
        found
    }
}
