//! What `train`, `eval` and `animate` do with AutoAvatars.

use crate::args::{AnimateArgs, EvalArgs, Protocol};
use crate::config::Config;
use crate::exit::{InputError, UsageError};
use crate::pipeline::{AvatarFigures, Context, Prepared, judge_avatars, open, open_raw, prepare, train_avatar};
use crate::run_folder::RunFolder;
use crate::signals::Signals;
use crate::terminal::Terminal;
use crate::verbs::animation_format::Format;
use crate::verbs::motion::{Wanted, motion};
use crate::verbs::train::Provenance;
use anyhow::Result;
use burn::tensor::Device;
use glam::Vec3;
use serde_json::json;
use softtissue_avatar::{
    AvatarBody, AvatarField, AvatarModel, Conditioning, Playback, PoseTrack, REACH, ROLLOUTS, RolloutFigures,
};
use softtissue_body::Pose;
use softtissue_export::{ObjFolder, SurfaceFrame};
use softtissue_geometry::{Frames, vertex_normals};
use softtissue_implicit::MarchingCubes;
use softtissue_monitor::Monitor;
use softtissue_store::{read_json, write_json_atomic};
use std::collections::BTreeMap;
use std::path::Path;

/// The measures, in a run's folder.
const FIGURES_FILE: &str = "autoavatar.json";

/// Learns, judges and says where everything lies.
pub fn train(context: &Context, job: &Prepared, data: Option<&Path>, judged: bool, as_json: bool) -> Result<()> {
    let raw = open_raw(context, &job.scans, data)?;
    let model = train_avatar(context, job, &raw)?;
    if judged {
        let figures = context.timed("judgement", || judge_avatars(context, job, &raw, &[(String::new(), model)]))?;
        tell(&figures, context.run.root(), FIGURES_FILE, as_json)?;
    }
    if !as_json {
        crate::print_line(&format!("avatar     {}", context.run.avatar().display()));
    }
    Ok(())
}

/// Judges a run again, others beside it.
pub fn eval(args: &EvalArgs, config: &Config, signals: &Signals) -> Result<()> {
    if args.protocol != Protocol::HeldOut || args.on.is_some() {
        let message = "an avatar is of one person's scans: it has neither protocols nor --on; leave them out";
        return Err(UsageError(message.into()).into());
    }
    let provenance: Provenance = read_json(&args.run.join("provenance.json"))?;
    let terminal = Terminal::new(signals.clone(), args.quiet);
    let folder = RunFolder::take(&args.run, true)?;
    let context = Context::new(config, &terminal, &folder, provenance.data_dir.clone())?;
    let mut models = vec![(String::new(), AvatarModel::read(&folder.avatar(), &context.device)?)];
    for other in &args.against {
        let path = other.join("avatar");
        if !AvatarModel::is_at(&path) {
            let message = format!("{} holds no avatar; an avatar is judged beside avatars alone", other.display());
            return Err(InputError(message).into());
        }
        let name = other.file_name().map_or_else(String::new, |n| format!("{}/", n.to_string_lossy()));
        models.push((name, AvatarModel::read(&path, &context.device)?));
    }
    let opened = open(&context, provenance.data.as_deref())?;
    let job = prepare(&context, opened)?;
    let raw = open_raw(&context, &job.scans, provenance.data.as_deref())?;
    let figures = judge_avatars(&context, &job, &raw, &models)?;
    let place = if args.against.is_empty() { folder.root().to_owned() } else { folder.comparison(None) };
    tell(&figures, &place, FIGURES_FILE, args.json)
}

fn tell(figures: &AvatarFigures, folder: &Path, name: &str, as_json: bool) -> Result<()> {
    softtissue_store::create_dir(folder)?;
    let path = folder.join(name);
    write_json_atomic(&path, figures)?;
    if as_json {
        crate::print_line(&serde_json::to_string(figures)?);
        return Ok(());
    }
    for (set, rows) in [("interpolation", &figures.interpolation), ("extrapolation", &figures.extrapolation)] {
        if !rows.is_empty() {
            crate::print_line(&table(&format!("{set}, {}", figures.subject), rows));
        }
    }
    crate::print_line(&format!("measures   {}", path.display()));
    Ok(())
}

/// The paper's table 1 as text.
fn table(title: &str, rows: &BTreeMap<String, RolloutFigures>) -> String {
    let mut text = format!("\n{title}\n{:<28}", "scan to prediction, mm");
    ROLLOUTS.iter().for_each(|n| text += &format!("{n:>9}"));
    let width = |name: &str| format!("{name:<28}");
    let cell = |x: Option<&f64>, digits: usize| x.map_or_else(|| format!("{:>9}", "-"), |x| format!("{x:>9.digits$}"));
    for (name, row) in rows {
        text += &format!("\n{}", width(name));
        ROLLOUTS.iter().for_each(|n| text += &cell(row.distance_mm.get(n), 3));
    }
    text += &format!("\n{}", width("error of volume change"));
    for (name, row) in rows {
        text += &format!("\n{}", width(name));
        ROLLOUTS.iter().for_each(|n| text += &cell(row.volume_change.get(n), 5));
    }
    text += &format!("\n{}", width("energy of heights"));
    for (name, row) in rows {
        text += &format!("\n{}{}", width(name), cell(row.height_energy.as_ref(), 3));
    }
    text
}

/// Plays an avatar from motion alone: a folder of OBJ files with the surfaces themselves, or the body's own mesh with its
/// vertices moved by their heights where a format wants one topology.
pub fn animate(args: &AnimateArgs, format: Option<Format>, monitor: &dyn Monitor) -> Result<()> {
    let Some(format) = format else {
        return Err(UsageError("--out: an avatar is not drawn; write a folder of OBJ files, or .glb".into()).into());
    };
    let shaped_otherwise = args.body.shape.is_some() || args.body.bmi.is_some() || args.flesh.is_some();
    let played_otherwise = args.fade.is_some() || args.pre_roll.is_some() || args.looped;
    if shaped_otherwise
        || played_otherwise
        || args.mesh.is_some()
        || args.paint.is_some()
        || !args.control.is_empty()
        || args.gain != 1.0
    {
        let message = "an avatar is one person as scanned: leave out --shape, --bmi, --flesh, --mesh, --paint, --control, \
                       --gain, --fade, --pre-roll and --loop";
        return Err(UsageError(message.into()).into());
    }
    let device = Device::flex();
    let model = AvatarModel::read(&args.bundle, &device)?;
    let wanted = Wanted { name: &args.motion, foreign: &args.foreign, frames: args.frames };
    let info = &model.info;
    let motion = motion(&wanted, &model.body, &info.beta, info.fps, monitor)?;
    let avatar = model.avatar_body(&device)?;
    let topology = &model.body.topology;
    let shaped = model.body.shaped(&info.beta);
    let posed = |t: usize| {
        let pose = Pose { rotations: motion.rotations.frame(t), translation: motion.translations[t] };
        model.body.posed(&shaped, pose, None)
    };
    let extras = json!({"licence": info.licence, "provenance": info.provenance});
    monitor.begin("animate", motion.len() as u64, "frames");
    let track = PoseTrack::new(&motion);
    if format == Format::ObjSequence {
        let folder = ObjFolder::create(&args.out, motion.len())?;
        let cubes = MarchingCubes { resolution: info.grid, ..MarchingCubes::default() };
        play(&model, &avatar, &track, &posed, monitor, |t, field, _| {
            let near = &field.observers().positions;
            let surface = cubes.surface_near(field, near, REACH).map_err(|e| InputError(e.to_string()))?;
            let mesh = &surface.mesh;
            let frame = SurfaceFrame {
                name: &info.subject,
                fps: info.fps,
                positions: &mesh.positions,
                normals: &surface.normals,
                faces: &mesh.topology.faces,
            };
            Ok(folder.write(t, &frame)?)
        })?;
        monitor.end();
        crate::print_line(&format!("{}: {} OBJ files", args.out.display(), motion.len()));
        return Ok(());
    }
    let to_vertices = avatar.observers.vertices_from_observers(&model.body.template, topology);
    let mut frames = Frames::new(model.body.vertex_count());
    play(&model, &avatar, &track, &posed, monitor, |_, field, posed| {
        let normals = vertex_normals(posed, topology.faces.as_slice());
        let lowest = avatar.heights.lowest;
        // where the surface is not met the body stays
        let met: Vec<f32> = field.heights().into_iter().map(|h| if h > lowest { h } else { 0.0 }).collect();
        let heights = to_vertices.apply(&met, 1);
        let moved: Vec<Vec3> = (0..posed.len()).map(|v| posed[v] + heights[v] * normals[v]).collect();
        frames.push(&moved);
        Ok(())
    })?;
    monitor.end();
    let line = format.write(&args.out, &info.subject, &model.body, &extras, &frames, info.fps, monitor)?;
    crate::print_line(&line);
    Ok(())
}

/// Shows every frame's field and posed body to `see`. The first frames come from the network that sees poses alone.
fn play(
    model: &AvatarModel,
    avatar: &AvatarBody,
    track: &PoseTrack,
    posed: &dyn Fn(usize) -> Vec<Vec3>,
    monitor: &dyn Monitor,
    mut see: impl FnMut(usize, &AvatarField, &[Vec3]) -> Result<()>,
) -> Result<()> {
    let history = avatar.config.history;
    let main = model.networks.iter().map(|l| l.conditioning).find(|c| c.sees_heights());
    let first = model.networks.iter().map(|l| l.conditioning).find(|c| !c.sees_heights());
    let Some(start) = first else {
        let message = "this avatar has no network to begin with where a motion is all there is: train it with \
                       autoavatar.networks = [\"autoregressive\", \"pose\"]";
        return Err(InputError(message.into()).into());
    };
    let network = |c: Conditioning| model.network(c).expect("it is one of the model's");
    let mut heights = Vec::new();
    let mut playback = Playback::new(avatar, network(start), start, &[])?;
    for t in 0..track.len() {
        if monitor.should_stop() {
            return Err(softtissue_avatar::AvatarError::Stopped.into());
        }
        if let Some(main) = main.filter(|_| t == history) {
            playback = Playback::new(avatar, network(main), main, &heights)?;
        }
        let posed = posed(t);
        let observers = avatar.observers.frame(&posed, &model.body.topology);
        let field = playback.step(track, t, &observers);
        if t < history {
            heights.push(field.heights());
        }
        see(t, &field, &posed)?;
        monitor.advance(1, "");
    }
    Ok(())
}
