//! Flesh fitted to a clip, against clips whose flesh is known.

#[allow(dead_code, reason = "of the bundle's own tests, which need more of it")]
#[path = "../../bundle/tests/bundle/tiny.rs"]
mod tiny;

use glam::Vec3;
use softtissue_body::Region;
use softtissue_bundle::{Bundle, Control, Controls, Player};
use softtissue_clips::{ClipId, DeltaClip, MotionClip};
use softtissue_geometry::Frames;
use softtissue_model::{ModelError, Tuning, TuningConfig, tune_flesh};
use softtissue_monitor::Silent;
use softtissue_random::Draws;

const BETA: [f32; 2] = [0.2, 0.1];
const FRAMES: usize = 180;

fn motion() -> MotionClip {
    let (rotations, translations) = tiny::motion(FRAMES);
    MotionClip { id: ClipId::new("new", "hop", 0), fps: 60.0, rotations, translations }
}

/// What a scanner sees of flesh so controlled: with a shift that does not move, and noise.
fn seen(bundle: &Bundle, controls: &Controls, noise: f64) -> DeltaClip {
    let MotionClip { id, fps, rotations, translations } = motion();
    let mut player = Player::new(bundle, &BETA).unwrap();
    player.set_controls(controls).unwrap();
    let mut deltas = player.rollout(&rotations, &translations).unwrap();
    let mut draws = Draws::new(5, "scanner", 0, 0);
    let mut shake = || Vec3::from_array([0; 3].map(|_| draws.range(-noise, noise) as f32));
    deltas.points_mut().iter_mut().for_each(|d| *d += Vec3::new(0.01, 0.0, -0.02) + shake());
    DeltaClip { id, fps, deltas }
}

fn fitted(bundle: &Bundle, deltas: &DeltaClip) -> Result<Tuning, ModelError> {
    tune_flesh(bundle, &BETA, &motion(), deltas, &TuningConfig::default(), &Silent)
}

fn of(tuning: &Tuning, region: Region) -> Control {
    tuning.regions.iter().find(|r| r.region == region).expect("the region").control
}

#[test]
fn mass_damping_and_gain_of_known_flesh_are_found_again() {
    let bundle = tiny::bundle(tiny::Parts { recurrent: false, ..tiny::Parts::default() });
    for (mass, damping, gain) in [(1.5, 0.5, 1.6), (-1.0, 2.0, 0.7), (0.0, 1.0, 1.0)] {
        let truth = Control { mass, damping, gain, ..Control::default() };
        let everywhere = Controls { everywhere: truth, ..Controls::default() };
        let tuning = fitted(&bundle, &seen(&bundle, &everywhere, 1e-3)).unwrap();
        let belly = of(&tuning, Region::Belly);
        assert_eq!((belly.mass, belly.damping), (mass, damping));
        assert!((belly.gain / gain - 1.0).abs() < 0.05, "{} for {gain}", belly.gain);
        let region = tuning.regions.iter().find(|r| r.region == Region::Belly).unwrap();
        assert!(region.ratio_after < 0.2 && region.ratio_after <= region.ratio_before, "{region:?}");
        // what is played with it is nearer to the flesh that was seen
        let error = |controls: &Controls| {
            let [a, b] = [controls, &everywhere].map(|c| seen(&bundle, c, 0.0).deltas);
            a.points().iter().zip(b.points()).map(|(a, b)| a.distance(*b)).sum::<f32>()
        };
        let (with, without, all) = (error(&tuning.controls), error(&Controls::default()), error(&Controls::gain(0.0)));
        assert!(with <= 0.3 * without + 0.02 * all, "{with} of {without} of {all}");
    }
}

#[test]
fn a_clip_without_flesh_changes_little_and_is_no_reason_to_believe_in_another_mass() {
    let bundle = tiny::bundle(tiny::Parts::default());
    let mut still = seen(&bundle, &Controls::gain(0.0), 0.0);
    let tuning = fitted(&bundle, &still).unwrap();
    let belly = of(&tuning, Region::Belly);
    // nothing moves: the least gain that is believed
    assert!(belly.gain <= 0.25 && belly.gain > 0.0, "{belly:?}");
    // regions of which the body has no vertex stay as learned
    assert_eq!(of(&tuning, Region::Chest), Control::default());
    still.deltas = Frames::zeros(still.deltas.points_per_frame(), 20);
    let short = fitted(&bundle, &still).unwrap_err().to_string();
    assert!(short.contains("new/hop.0"), "{short}");
}

#[test]
fn settings_out_of_range_are_refused_by_name() {
    let bundle = tiny::bundle(tiny::Parts::default());
    let clip = seen(&bundle, &Controls::default(), 0.0);
    let base = TuningConfig::default();
    for (config, name) in [
        (TuningConfig { masses: vec![f32::NAN], ..base.clone() }, "masses"),
        (TuningConfig { dampings: vec![0.0], ..base.clone() }, "dampings"),
        (TuningConfig { settle_s: -1.0, ..base.clone() }, "settle_s"),
        (TuningConfig { gain_prior: f32::INFINITY, ..base }, "gain_prior"),
    ] {
        let error = tune_flesh(&bundle, &BETA, &motion(), &clip, &config, &Silent).unwrap_err().to_string();
        assert!(error.contains(name), "{error}");
    }
}
