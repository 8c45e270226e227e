//! `animate`: a bundle and a motion to an animated mesh.

use crate::args::AnimateArgs;
use crate::exit::{InputError, UsageError};
use crate::signals::Signals;
use crate::terminal::Terminal;
use crate::verbs::contact_sheet;
use anyhow::Result;
use softtissue_body::Pose;
use softtissue_bundle::{Bundle, Player};
use softtissue_clips::MotionClip;
use softtissue_export::{Animation, GltfConfig, write_gltf, write_obj_sequence};
use softtissue_geometry::Frames;
use softtissue_monitor::Monitor;
use softtissue_synth::motion::{Request, Style, generate};
use std::path::Path;

/// What a motion is generated with where only its name is given.
const GENERATOR_SEED: u64 = 1;
/// Largest gain that is not a slip of the finger.
const LARGEST_GAIN: f32 = 100.0;

/// Runs the verb.
pub fn run(args: &AnimateArgs, signals: &Signals) -> Result<()> {
    let terminal = Terminal::new(signals.clone(), false);
    if !(args.gain.is_finite() && args.gain.abs() <= LARGEST_GAIN) {
        return Err(UsageError(format!("--gain is {}; write a number between -100 and 100", args.gain)).into());
    }
    let bundle = Bundle::read(&args.bundle)?;
    let beta = shape(args, &bundle)?;
    let motion = motion(args, &bundle, &beta)?;
    let frames = play(&bundle, &beta, &motion, args.gain, &terminal)?;
    if args.out.extension().is_some_and(|e| e.eq_ignore_ascii_case("png")) {
        let alone = play(&bundle, &beta, &motion, 0.0, &terminal)?;
        contact_sheet::write(&args.out, &bundle.body.topology, &alone, &frames)?;
        crate::print_line(&args.out.display().to_string());
        return Ok(());
    }
    let name = args.bundle.file_name().map_or_else(|| "softtissue".into(), |n| n.to_string_lossy().into_owned());
    write(&args.out, &name, &bundle, &frames, motion.fps, &terminal)
}

fn shape(args: &AnimateArgs, bundle: &Bundle) -> Result<Vec<f32>> {
    let Some(text) = &args.shape else { return Ok(vec![0.0; bundle.body.shape_count()]) };
    let beta = text
        .split(',')
        .map(|b| b.trim().parse::<f32>().ok().filter(|b| b.is_finite() && b.abs() <= 10.0))
        .collect::<Option<Vec<f32>>>()
        .ok_or_else(|| {
            UsageError(format!("--shape {text:?}: write numbers between -10 and 10, separated by commas"))
        })?;
    if beta.len() > bundle.body.shape_count() {
        let (given, has) = (beta.len(), bundle.body.shape_count());
        return Err(UsageError(format!("--shape has {given} numbers, but the body has {has}; leave some out")).into());
    }
    Ok(beta)
}

fn motion(args: &AnimateArgs, bundle: &Bundle, beta: &[f32]) -> Result<MotionClip> {
    let fps = bundle.descriptor.fps;
    if let Some(name) = args.motion.strip_prefix("synth:") {
        if !(2..=36_000).contains(&args.frames) {
            return Err(UsageError(format!("--frames is {}; write 2 to 36000", args.frames)).into());
        }
        let request =
            Request { subject: "anybody", motion: name, take: 0, frames: args.frames, fps, seed: GENERATOR_SEED };
        return Ok(generate(&request, &bundle.body.shaped(beta), &Style::neutral())?);
    }
    let path = Path::new(&args.motion);
    let clip = MotionClip::read(path)?;
    let (found, expected) = (clip.rotations.points_per_frame(), bundle.body.joint_count());
    if found != expected {
        let message = format!("{}: {found} joints, but the bundle's body has {expected}; retarget it", path.display());
        return Err(InputError(message).into());
    }
    if clip.fps != fps {
        let message =
            format!("{}: {} frames a second, but the bundle is for {fps}; resample it", path.display(), clip.fps);
        return Err(InputError(message).into());
    }
    Ok(clip)
}

/// Posed vertices `[T, V]` of the body with `gain` times the predicted deltas.
fn play(bundle: &Bundle, beta: &[f32], motion: &MotionClip, gain: f32, monitor: &dyn Monitor) -> Result<Frames> {
    let mut player = Player::new(bundle, beta)?;
    let mut frames = Frames::new(bundle.body.vertex_count());
    monitor.begin("animate", motion.len() as u64, "frames");
    let shaped = bundle.body.shaped(beta);
    player.play(&motion.rotations, &motion.translations, |t, player| {
        let deltas: Vec<_> = player.deltas().iter().map(|d| *d * gain).collect();
        let pose = Pose { rotations: motion.rotations.frame(t), translation: motion.translations[t] };
        frames.push(&bundle.body.posed(&shaped, pose, Some(&deltas)));
        monitor.advance(1, "");
    })?;
    monitor.end();
    Ok(frames)
}

/// Writes a `.glb`/`.gltf` file, or an OBJ sequence where `out` has no such ending.
fn write(out: &Path, name: &str, bundle: &Bundle, frames: &Frames, fps: f32, monitor: &dyn Monitor) -> Result<()> {
    let extras = serde_json::json!({"licence": bundle.info.licence, "provenance": bundle.info.provenance});
    let animation = Animation { name, topology: &bundle.body.topology, fps, vertices: frames, extras: &extras };
    let is_gltf = out.extension().is_some_and(|e| e.eq_ignore_ascii_case("glb") || e.eq_ignore_ascii_case("gltf"));
    if is_gltf {
        let report = write_gltf(out, &animation, &GltfConfig::default(), monitor)?;
        crate::print_line(&format!(
            "{}: {} frames, {} morph targets, at most {:.2} mm off, {:.1} MB",
            out.display(),
            frames.len(),
            report.targets,
            report.max_error_m * 1e3,
            report.bytes as f64 / 1e6
        ));
    } else {
        write_obj_sequence(out, &animation, monitor)?;
        crate::print_line(&format!("{}: {} OBJ files", out.display(), frames.len()));
    }
    Ok(())
}
