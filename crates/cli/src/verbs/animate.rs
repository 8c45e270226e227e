//! `animate`: a bundle and a motion to an animated mesh.

use crate::args::AnimateArgs;
use crate::exit::UsageError;
use crate::signals::Signals;
use crate::terminal::Terminal;
use crate::verbs::animation_format::Format;
use crate::verbs::avatar;
use crate::verbs::body_shape;
use crate::verbs::contact_sheet::ContactSheet;
use crate::verbs::controls::{controls, detail, rest_mesh};
use crate::verbs::motion::{Wanted, motion};
use anyhow::Result;
use serde_json::json;
use softtissue_avatar::AvatarModel;
use softtissue_bundle::{Bundle, BundleError, Controls, Player};
use softtissue_clips::MotionClip;
use softtissue_geometry::Frames;
use softtissue_monitor::Monitor;

/// Largest gain that is not a slip of the finger.
const LARGEST_GAIN: f32 = 100.0;

/// Runs the verb.
pub fn run(args: &AnimateArgs, signals: &Signals) -> Result<()> {
    let terminal = Terminal::new(signals.clone(), false);
    if !(args.gain.is_finite() && args.gain.abs() <= LARGEST_GAIN) {
        return Err(UsageError(format!("--gain is {}; write a number between -100 and 100", args.gain)).into());
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
    let wanted = Wanted { name: &args.motion, foreign: &args.foreign, frames: args.frames };
    let motion = motion(&wanted, &bundle.body, &beta, bundle.descriptor.fps, &terminal)?;
    let frames = play(&mut player, &motion, &terminal)?;
    let Some(format) = format else {
        player.set_controls(&Controls::gain(0.0))?;
        let alone = play(&mut player, &motion, &terminal)?;
        ContactSheet::of_animation(&bundle.body.topology, &alone, &frames).write(&args.out)?;
        crate::print_line(&args.out.display().to_string());
        return Ok(());
    };
    let name = args.bundle.file_name().map_or_else(|| "softtissue".into(), |n| n.to_string_lossy().into_owned());
    let extras = json!({"licence": bundle.info.licence, "provenance": bundle.info.provenance});
    format.write(&args.out, &name, &bundle.body, &extras, &frames, motion.fps, &terminal)
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

/// Posed vertices `[T, V]` of a whole motion.
fn play(player: &mut Player<&Bundle>, motion: &MotionClip, monitor: &dyn Monitor) -> Result<Frames> {
    let mut frames = Frames::new(player.bundle().body.vertex_count());
    monitor.begin("animate", motion.len() as u64, "frames");
    player.play(&motion.rotations, &motion.translations, |_, player| {
        frames.push(player.vertices());
        monitor.advance(1, "");
    })?;
    monitor.end();
    Ok(frames)
}

/// What the player refuses, the command line asked for.
fn asked(error: BundleError) -> anyhow::Error {
    match error {
        BundleError::Input(_) => UsageError(error.to_string()).into(),
        other => other.into(),
    }
}
