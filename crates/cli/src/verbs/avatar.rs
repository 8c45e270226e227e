//! What `train`, `eval` and `animate` do with AutoAvatars.

use crate::args::{AnimateArgs, EvalArgs, Protocol};
use crate::config::Config;
use crate::exit::{InputError, UsageError};
use crate::pipeline::{
    AvatarScene, Context, Prepared, Rivals, judge_avatars, open, open_others, open_raw, prepare, train_avatar,
    write_avatar_report,
};
use crate::run_folder::{REPORT_FILE, RunFolder};
use crate::signals::Signals;
use crate::terminal::Terminal;
use crate::verbs::animation_format::Format;
use crate::verbs::contact_sheet::{ContactSheet, Tile};
use crate::verbs::motion::{Wanted, motion};
use crate::verbs::train::Provenance;
use anyhow::Result;
use burn::tensor::Device;
use glam::Vec3;
use serde_json::json;
use softtissue_avatar::{AvatarBody, AvatarField, AvatarModel, Conditioning, Playback, PoseTrack, REACH};
use softtissue_body::Pose;
use softtissue_clips::RawScans;
use softtissue_eval::report::surface_tables;
use softtissue_eval::viewer::{Layer, ViewClip};
use softtissue_export::{ObjFolder, SurfaceFrame};
use softtissue_geometry::Frames;
use softtissue_implicit::{MarchingCubes, drawn_over};
use softtissue_monitor::Monitor;
use softtissue_store::read_json;
use std::path::Path;

/// The measures and a picture of truth and prediction, in a run's folder.
const FIGURES_FILE: &str = "autoavatar.json";
const PICTURE_FILE: &str = "autoavatar.png";
/// Frames of a picture, its tiles' size in pixels, and the distance that is fully red, metres.
const PICTURE_FRAMES: usize = 6;
const TILE: (usize, usize) = (110, 200);
const BRIGHT_M: f32 = 0.02;

/// Learns, judges and says where everything lies.
pub fn train(
    context: &Context,
    title: &str,
    job: &Prepared,
    data: Option<&Path>,
    judged: bool,
    as_json: bool,
) -> Result<()> {
    let raw = open_raw(context.config, &job.scans, data)?;
    if judged {
        let scene = AvatarScene::of(context, job, &raw);
        scene.judged(&scene.subject()?)?;
    }
    let model = train_avatar(context, job, &raw)?;
    if judged {
        let rivals = Rivals { avatars: &[(String::new(), model)], bundles: &[] };
        finish(context, title, job, &raw, &rivals, context.run.root(), as_json)?;
    }
    if !as_json {
        crate::print_line(&format!("avatar     {}", context.run.avatar().display()));
    }
    Ok(())
}

/// Judges a run again, others beside it: avatars, and bundles of the methods that learn registered meshes.
pub fn eval(args: &EvalArgs, config: &Config, signals: &Signals) -> Result<()> {
    if args.protocol != Protocol::HeldOut || args.on.is_some() {
        let message = "an avatar is of one person's scans: it has neither protocols nor --on; leave them out";
        return Err(UsageError(message.into()).into());
    }
    let provenance: Provenance = read_json(&args.run.join("provenance.json"))?;
    let terminal = Terminal::new(signals.clone(), args.quiet);
    let folder = RunFolder::take(&args.run, true)?;
    let context = Context::new(config, &terminal, &folder, provenance.data_dir.clone())?;
    let mut avatars = vec![(String::new(), AvatarModel::read(&folder.avatar(), &context.device)?)];
    let mut meshes = Vec::new();
    for other in &args.against {
        let path = other.join("avatar");
        if AvatarModel::is_at(&path) {
            let prefix = free_prefix(other, &avatars);
            avatars.push((prefix, AvatarModel::read(&path, &context.device)?));
        } else {
            meshes.push(other.clone());
        }
    }
    let opened = open(&context, provenance.data.as_deref())?;
    let job = prepare(&context, opened)?;
    let bundles = open_others(&meshes, &job, &["body".into()])?;
    let raw = open_raw(config, &job.scans, provenance.data.as_deref())?;
    let rivals = Rivals { avatars: &avatars, bundles: &bundles };
    let place = if args.against.is_empty() { folder.root().to_owned() } else { folder.comparison(None) };
    finish(&context, &provenance.configuration, &job, &raw, &rivals, &place, args.json)
}

/// What stands before the names of another run's networks: its folder and a slash, a number where that is taken.
fn free_prefix(run: &Path, taken: &[(String, AvatarModel)]) -> String {
    let whole = run.canonicalize().unwrap_or_else(|_| run.to_owned());
    let folder = whole.file_name().map_or_else(|| "other".into(), |n| n.to_string_lossy().into_owned());
    let numbered = (2..).map(|i| format!("{folder}-{i}/"));
    let is_free = |prefix: &String| taken.iter().all(|(other, _)| other != prefix);
    std::iter::once(format!("{folder}/")).chain(numbered).find(is_free).expect("numbers do not end")
}

/// Judges, and writes measures, report and picture into `folder`.
fn finish(
    context: &Context,
    title: &str,
    job: &Prepared,
    raw: &dyn RawScans,
    rivals: &Rivals,
    folder: &Path,
    as_json: bool,
) -> Result<()> {
    let scene = AvatarScene::of(context, job, raw);
    let judgement = context.timed("judgement", || judge_avatars(&scene, rivals, &context.device))?;
    let (figures, report) = (folder.join(FIGURES_FILE), folder.join(REPORT_FILE));
    softtissue_store::create_dir(folder)?;
    judgement.metrics.write(&figures)?;
    let own = &rivals.avatars[0].1;
    context.timed("report", || write_avatar_report(context, title, job, own, &judgement, &report))?;
    let first = judgement.shown.first();
    let picture = first.map(|shown| (picture(shown, &job.body.topology.faces), folder.join(PICTURE_FILE)));
    picture.iter().try_for_each(|(sheet, path)| sheet.write(path))?;
    if as_json {
        crate::print_line(&serde_json::to_string(&judgement.metrics)?);
        return Ok(());
    }
    crate::print_line(surface_tables(&judgement.metrics).trim_end());
    crate::print_line(&format!("measures   {}", figures.display()));
    crate::print_line(&format!("report     {}", report.display()));
    picture.iter().for_each(|(_, path)| crate::print_line(&format!("picture    {}", path.display())));
    Ok(())
}

/// Rows of a few frames, one for each layer: scan and truth plain, predictions coloured by their distance from the scan.
fn picture(shown: &ViewClip, faces: &[[u32; 3]]) -> ContactSheet {
    let layers = &shown.layers;
    let count = layers.first().map_or(0, |l| l.frames.len());
    let tiles = PICTURE_FRAMES.min(count);
    let frames: Vec<usize> = (0..tiles).map(|i| (2 * i + 1) * count / (2 * tiles)).collect();
    let row = |layer: &Layer| -> Vec<Tile> {
        let tile = |t: &usize| match layer.key {
            "reference" | "surface" => Tile::new(layer.frames.frame(*t), faces),
            _ => Tile::displaced(layer.frames.frame(*t), faces, layers[0].frames.frame(*t), BRIGHT_M),
        };
        frames.iter().map(tile).collect()
    };
    ContactSheet { rows: layers.iter().map(row).collect(), tile: TILE, centred: true }
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
        frames.push(&drawn_over(posed, topology, &to_vertices, field.heights(), &avatar.heights));
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
            heights.push(field.heights().to_vec());
        }
        see(t, &field, &posed)?;
        monitor.advance(1, "");
    }
    Ok(())
}
