//! `animate`: a bundle and a motion to an animated mesh.

use crate::args::AnimateArgs;
use crate::exit::{InputError, UsageError};
use crate::memory::available_memory_bytes;
use crate::signals::Signals;
use crate::terminal::Terminal;
use crate::verbs::animation_format::Format;
use crate::verbs::avatar;
use crate::verbs::body_shape;
use crate::verbs::contact_sheet::ContactSheet;
use crate::verbs::controls::{controls, detail, rest_mesh};
use crate::verbs::motion::{Wanted, motion};
use anyhow::Result;
use glam::Vec3;
use serde_json::json;
use softtissue_avatar::AvatarModel;
use softtissue_body::Pose;
use softtissue_bundle::{Bundle, BundleError, Controls, Fade, LoopReport, Player, RolloutReport};
use softtissue_clips::MotionClip;
use softtissue_geometry::Frames;
use softtissue_monitor::Monitor;

/// Largest gain that is not a slip of the finger.
const LARGEST_GAIN: f32 = 100.0;
/// Longest time in the first pose, seconds.
const LONGEST_PRE_ROLL: f32 = 60.0;

/// Runs the verb.
pub fn run(args: &AnimateArgs, signals: &Signals) -> Result<()> {
    let terminal = Terminal::new(signals.clone(), false);
    if !(args.gain.is_finite() && args.gain.abs() <= LARGEST_GAIN) {
        return Err(UsageError(format!("--gain is {}; write a number between -100 and 100", args.gain)).into());
    }
    if let Some(seconds) = args.pre_roll.filter(|s| !(0.0..=LONGEST_PRE_ROLL).contains(s)) {
        return Err(UsageError(format!("--pre-roll is {seconds}; write 0 to {LONGEST_PRE_ROLL} seconds")).into());
    }
    let is_picture = args.out.extension().is_some_and(|e| e.eq_ignore_ascii_case("png"));
    let format = if is_picture { None } else { Some(Format::of(&args.out)?) };
    if AvatarModel::is_at(&args.bundle) {
        return avatar::animate(args, format, &terminal);
    }
    let bundle = Bundle::read(&args.bundle)?;
    let beta = body_shape::of(&args.body, &bundle)?;
    let flesh = match &args.flesh {
        Some(text) => body_shape::parse("--flesh", text, &bundle)?,
        None => beta.clone(),
    };
    let shown = match &args.mesh {
        Some(path) => Some(rest_mesh(path, &bundle.body)?),
        None => args.flesh.as_ref().map(|_| bundle.body.shaped(&beta).vertices),
    };
    say_where_it_lies(&bundle, &flesh, &terminal);
    let mut player = Player::new(&bundle, &flesh)?;
    player.set_controls(&controls(args, &bundle.body)?).map_err(asked)?;
    player.set_detail(&detail(args)?).map_err(asked)?;
    player.show_on(shown).map_err(asked)?;
    if let Some(below) = args.fade {
        player.set_fade(Some(Fade { below, ..Fade::default() })).map_err(asked)?;
    }
    let wanted = Wanted { name: &args.motion, foreign: &args.foreign, frames: args.frames };
    let motion = motion(&wanted, &bundle.body, &beta, bundle.descriptor.fps, &terminal)?;
    if let Some(free) = available_memory_bytes() {
        fits(motion.len(), bundle.body.vertex_count(), free)?;
    }
    let (frames, facts) = play(args, &mut player, &motion, &terminal)?;
    let Some(format) = format else {
        player.set_controls(&Controls::gain(0.0))?;
        let (alone, _) = play(args, &mut player, &motion, &terminal)?;
        ContactSheet::of_animation(&bundle.body.topology, &alone, &frames).write(&args.out)?;
        crate::print_line(&format!("{}; {facts}", args.out.display()));
        return Ok(());
    };
    let name = args.bundle.file_name().map_or_else(|| "softtissue".into(), |n| n.to_string_lossy().into_owned());
    let extras = json!({"licence": bundle.info.licence, "provenance": bundle.info.provenance});
    let line = format.write(&args.out, &name, &bundle.body, &extras, &frames, motion.fps, &terminal)?;
    crate::print_line(&format!("{line}; {facts}"));
    Ok(())
}

/// Whether the posed vertices of all frames, which are held until they are written, fit into `free` bytes.
fn fits(frames: usize, vertices: usize, free: u64) -> Result<()> {
    let needed = (frames * vertices * size_of::<Vec3>()) as u64;
    if needed <= free {
        return Ok(());
    }
    let gb = |bytes: u64| bytes as f64 / 1e9;
    Err(InputError(format!(
        "{frames} frames of {vertices} vertices need {:.1} GB of memory, of which {:.1} GB are free; cut the motion",
        gb(needed),
        gb(free)
    ))
    .into())
}

/// Whom a mixture of people does not reach, it cannot move.
fn say_where_it_lies(bundle: &Bundle, beta: &[f32], monitor: &dyn Monitor) {
    let Some(model) = bundle.model.autoregressive() else { return };
    let (bmi, (low, high)) = (model.build.bmi(beta), model.bmi_range());
    if !(low..=high).contains(&bmi) {
        monitor.say(&format!(
            "a body mass index of {bmi:.1} lies outside the {low:.1} to {high:.1} of the people that the bundle knows: its \
             flesh moves like theirs at the nearer end"
        ));
    }
}

/// Posed vertices `[T, V]` of a whole motion, and what is to be said of it.
fn play(
    args: &AnimateArgs,
    player: &mut Player<&Bundle>,
    motion: &MotionClip,
    monitor: &dyn Monitor,
) -> Result<(Frames, String)> {
    let MotionClip { rotations, translations, fps, .. } = motion;
    let mut frames = Frames::new(player.bundle().body.vertex_count());
    monitor.begin("animate", motion.len() as u64, "frames");
    let show = |_, player: &mut Player<&Bundle>| {
        if monitor.should_stop() {
            return Err(BundleError::Stopped);
        }
        frames.push(player.vertices());
        monitor.advance(1, "");
        Ok(())
    };
    let facts = if args.looped {
        let report = player.play_loop(rotations, translations, show)?;
        say_whether_it_loops(&report, motion.len(), monitor);
        let (rounds, mismatch) = (report.rounds, 1e3 * report.mismatch_m);
        format!("a loop after {rounds} rounds, {mismatch:.3} mm open; {}", trust_of(&report.rollout, *fps))
    } else {
        let first = || Pose { rotations: rotations.frame(0), translation: translations[0] };
        match args.pre_roll.filter(|_| !motion.is_empty()) {
            Some(seconds) => {
                player.pre_roll(first(), seconds);
            }
            None => player.reset(),
        }
        trust_of(&player.play_on(rotations, translations, show)?, *fps)
    };
    monitor.end();
    Ok((frames, facts))
}

fn trust_of(report: &RolloutReport, fps: f32) -> String {
    let (least, seconds) = (report.least_trust, report.least_trust_frame as f32 / fps);
    match least < 1.0 {
        true => format!("least trust {least:.2} at {seconds:.2} s"),
        false => "trust 1 throughout".into(),
    }
}

fn say_whether_it_loops(report: &LoopReport, frames: usize, monitor: &dyn Monitor) {
    if report.frames < frames {
        monitor.say("the last pose repeats the first one and is left out of the loop");
    }
    if !report.is_cyclic() {
        monitor.say(&format!(
            "the motion is no loop: a joint turns by {:.0} degrees from its last pose to its first, and by {:.0} at most \
             from any other frame to the next",
            report.seam.to_degrees(),
            report.largest_turn.to_degrees()
        ));
    }
    if !report.is_closed() {
        monitor.say(&format!(
            "after {} rounds the flesh still differs by {:.2} mm from one to the next",
            report.rounds,
            1e3 * report.mismatch_m
        ));
    }
}

/// What the player refuses, the command line asked for.
fn asked(error: BundleError) -> anyhow::Error {
    match error {
        BundleError::Input(_) => UsageError(error.to_string()).into(),
        other => other.into(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_motion_beyond_the_memory_is_refused_before_it_is_played() {
        assert!(fits(1000, 100, 1_200_000).is_ok());
        let said = fits(1000, 100, 1_199_999).unwrap_err().to_string();
        assert!(said.contains("1000 frames of 100 vertices"), "{said}");
    }
}
