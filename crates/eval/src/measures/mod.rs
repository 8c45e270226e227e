//! Measures of deltas against deltas. All take metres and frames a second and know nothing of files.

mod decay;
mod leak;
mod rollout;
mod signal;
mod sums;

pub use decay::{Decay, fit_decay};
pub use leak::{ProbeClip, leak};
pub use rollout::{REST_AFTER_S, RegionPeaks, looped, rest_ratio};
pub use signal::{HIGHEST_HZ, LOWEST_HZ, Spectrum, lag_s, peak_hz, region_mean, spectral_distance, spectrum};
pub use sums::{ErrorSums, Moments, REPORTED, RegionSums, STILL_MM_S, members};
