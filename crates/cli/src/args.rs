//! What the user typed, before it is checked.

mod import;
mod import_body;

use clap::{Args, Parser, Subcommand, ValueEnum};
pub use import::*;
pub use import_body::*;
use std::path::PathBuf;

/// Learns how flesh moves: from 4D scans of moving people to a small model that adds soft-tissue motion to
/// any skeletal animation.
#[derive(Debug, Parser)]
#[command(name = "softtissue", version, about, long_about = None, propagate_version = true, max_term_width = 100)]
pub struct Cli {
    /// What to do.
    #[command(subcommand)]
    pub verb: Verb,
}

/// The verbs.
#[derive(Debug, Subcommand)]
pub enum Verb {
    /// Make scans, fit, learn, evaluate, and write a bundle, a report and an animation.
    Train(TrainArgs),
    /// Judge a finished run on motions it has never seen.
    Eval(EvalArgs),
    /// Add soft tissue to a motion and write an animated glTF.
    Animate(AnimateArgs),
    /// Write the network of a bundle for other programs, or a web page that plays it.
    Export(ExportArgs),
    /// Look at scans, fits, motions and runs in the browser, or play a bundle there.
    View(ViewArgs),
    /// Make 4D scans with known truth from code alone.
    Synth(SynthArgs),
    /// Fit shape and pose to scans and extract the soft-tissue deltas.
    Fit(FitArgs),
    /// Fit a bundle's flesh to one clip of a person: controls for `animate`.
    Tune(TuneArgs),
    /// Bring other people's data into our form.
    Import(ImportArgs),
    /// Say of a file or folder what it is and what is wrong with it.
    Inspect(InspectArgs),
    /// Print, check or explain every setting.
    Config(ConfigArgs),
    /// Print shell completions.
    Completions {
        /// Which shell.
        shell: clap_complete::Shell,
    },
    /// Print the manual page.
    Man,
}

/// Settings shared by the verbs that read a configuration.
#[derive(Debug, Args, Clone, Default)]
pub struct Settings {
    /// `quick`, `smoke`, `full`, `softsmpl-paper`, `casas-otaduy-paper`, or a TOML file; default `quick`.
    #[arg(long, value_name = "NAME|FILE")]
    pub config: Option<String>,
    /// Override one setting, e.g. `--set regressor.training.steps=500`; always wins; may be repeated.
    #[arg(long = "set", value_name = "KEY=VALUE")]
    pub set: Vec<String>,
    /// Where tensors live: `flex` (CPU), `ndarray`, `wgpu`; the last two need their feature.
    #[arg(long)]
    pub device: Option<String>,
    /// The one number all random draws come from, those of generated scans too unless `synth.seed` is set.
    #[arg(long)]
    pub seed: Option<u64>,
    /// Where generated and imported clips are kept [default: data].
    #[arg(long, value_name = "DIR")]
    pub data_dir: Option<PathBuf>,
    /// Say less.
    #[arg(long, short)]
    pub quiet: bool,
}

/// `train`.
#[derive(Debug, Args)]
pub struct TrainArgs {
    /// Settings.
    #[command(flatten)]
    pub settings: Settings,
    /// Train on these scans and not on generated ones: a folder of ours, or whatever `import scans` takes.
    #[arg(long, value_name = "DIR|FILE")]
    pub data: Option<PathBuf>,
    /// The run folder [default: runs/CONFIG].
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Go on with a run that was stopped.
    #[arg(long)]
    pub resume: bool,
    /// Say what would be done, and do nothing.
    #[arg(long)]
    pub dry_run: bool,
    /// Print the result as JSON.
    #[arg(long)]
    pub json: bool,
    /// Do not evaluate, and write no report.
    #[arg(long)]
    pub no_eval: bool,
}

/// Ways of leaving clips out.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Protocol {
    /// Judge the run on its held-out clips.
    HeldOut,
    /// Train again without each motion in turn.
    #[value(name = "leave-one-sequence-out")]
    Sequences,
    /// Train again without each subject in turn.
    #[value(name = "leave-one-subject-out")]
    Subjects,
    /// Judge one sequence as a new take, a new motion, a new subject, and both new: Dyna's four cases.
    DynaCases,
}

/// `eval`.
#[derive(Debug, Args)]
pub struct EvalArgs {
    /// The run folder.
    pub run: PathBuf,
    /// How clips are left out.
    #[arg(long, value_enum, default_value = "held-out")]
    pub protocol: Protocol,
    /// Other runs or bundles to judge beside this one, on this run's test clips: once for each.
    #[arg(long, value_name = "DIR")]
    pub against: Vec<PathBuf>,
    /// Judge on the test motions of these scans (a set of `softtissue synth`, or whatever `import scans` takes) and not on
    /// the run's own: they are fitted, nothing is trained.
    #[arg(long, value_name = "DIR|FILE")]
    pub on: Option<PathBuf>,
    /// Which folds, by motion, subject or Dyna's case, separated by commas; `all` for every one.
    #[arg(long, value_name = "NAMES")]
    pub folds: Option<String>,
    /// Print the measures as JSON.
    #[arg(long)]
    pub json: bool,
    /// Say less.
    #[arg(long, short)]
    pub quiet: bool,
}

/// Whose body, for the verbs that play a bundle.
#[derive(Debug, Args)]
pub struct ShapeArgs {
    /// Shape coefficients separated by commas; default: the mean shape.
    #[arg(long, value_name = "B0,B1,...", allow_hyphen_values = true)]
    pub shape: Option<String>,
    /// Make the body of --shape heavier or lighter at the same height (Dyna 2015, eq. 26): its body mass index.
    #[arg(long, value_name = "KG/M2", allow_hyphen_values = true)]
    pub bmi: Option<f32>,
}

/// `export`.
#[derive(Debug, Args)]
#[group(id = "written", required = true, multiple = true, args = ["onnx", "plain_onnx", "web", "out"])]
pub struct ExportArgs {
    /// The bundle folder.
    pub bundle: PathBuf,
    /// Whose body.
    #[command(flatten)]
    pub body: ShapeArgs,
    /// Write the network of this body as ONNX: one frame of features in, deltas out.
    #[arg(long, value_name = "FILE.onnx")]
    pub onnx: Option<PathBuf>,
    /// The same without ONNX's recurrent operator: matrix products, sigmoids and hyperbolic tangents in its place.
    #[arg(long, value_name = "FILE.onnx")]
    pub plain_onnx: Option<PathBuf>,
    /// Write a web page that plays the bundle, a folder that any web server can host; needs a build with `--features web`.
    #[arg(long, value_name = "DIR")]
    pub web: Option<PathBuf>,
    /// Write the bundle in fewer bits: `f16`, or `i8` for the least memory. What it loses is measured, printed and kept in the
    /// manifest.
    #[arg(long, requires = "out", value_name = "f16|i8")]
    pub precision: Option<String>,
    /// The folder of that bundle.
    #[arg(long, requires = "precision", value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Motions of the page.
    #[command(flatten)]
    pub motions: PageMotionArgs,
}

/// Which motions a page has.
#[derive(Debug, Args)]
pub struct PageMotionArgs {
    /// A motion of the page: a motion clip, a foreign motion (`.bvh`, `.amc`, `.npz` of AMASS), or `synth:NAME`. May be
    /// repeated [default: six generated ones].
    #[arg(long = "motion", value_name = "MOTION")]
    pub chosen: Vec<String>,
    /// What a foreign motion does not say.
    #[command(flatten)]
    pub foreign: MotionSourceArgs,
    /// Frames of a generated motion [default: 300].
    #[arg(long)]
    pub frames: Option<usize>,
}

/// `view`.
#[derive(Debug, Args)]
pub struct ViewArgs {
    /// A run, a scan or fit set, a clip, a motion, scans that `import` takes: a page in one file. Or a bundle: a page that
    /// plays it with sliders for body and flesh, which needs a build with `--features web`.
    pub path: PathBuf,
    /// A clip to show; may be repeated [default: of runs one that was left out, of sets the first ones that fit].
    #[arg(long = "clip", value_name = "SUBJECT/MOTION.TAKE")]
    pub clips: Vec<String>,
    /// Frames to show, from A up to but not with B, either of which may be left out.
    #[arg(long, value_name = "A..B")]
    pub range: Option<FrameRange>,
    /// Show the scan and what was fitted to it beside truth and prediction of a run.
    #[arg(long)]
    pub fit: bool,
    /// The page to write [default: a temporary one].
    #[arg(long, value_name = "FILE.html")]
    pub out: Option<PathBuf>,
    /// A log for the Rerun viewer to write, in the place of a page unless `--out` names one; needs a build with
    /// `--features rerun`.
    #[arg(long, value_name = "FILE.rrd")]
    pub viz: Option<PathBuf>,
    /// The body that clips of ours were made with, whose triangles and bones they lack; otherwise one that lies near.
    #[arg(long, value_name = "FILE")]
    pub body: Option<PathBuf>,
    /// Where the scans and fits of a run lie now [default: where the run put them].
    #[arg(long, value_name = "DIR")]
    pub data_dir: Option<PathBuf>,
    /// Motions of a bundle's page, and what a foreign motion does not say.
    #[command(flatten)]
    pub motions: PageMotionArgs,
    /// Where the page of a bundle is served on this machine; 0 takes any port that is free [default: 4747].
    #[arg(long)]
    pub port: Option<u16>,
    /// Do not open a browser.
    #[arg(long)]
    pub no_browser: bool,
}

/// Frames from `start` up to but not with `end`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct FrameRange {
    /// The first.
    pub start: usize,
    /// The one after the last; the clip's end where it is not stated.
    pub end: Option<usize>,
}

impl std::str::FromStr for FrameRange {
    type Err = String;
    fn from_str(text: &str) -> Result<Self, String> {
        let number = |t: &str| if t.is_empty() { Some(None) } else { t.parse().ok().map(Some) };
        let parse = || {
            let (start, end) = text.split_once("..")?;
            Some(Self { start: number(start)?.unwrap_or(0), end: number(end)? })
        };
        parse().ok_or_else(|| "write A..B, A.. or ..B with frame numbers from 0".into())
    }
}

/// `animate`.
#[derive(Debug, Args)]
pub struct AnimateArgs {
    /// The bundle folder.
    #[arg(long, value_name = "DIR")]
    pub bundle: PathBuf,
    /// A motion clip, a foreign motion (`.bvh`, `.amc`, `.npz` of AMASS), or `synth:NAME` for a generated motion.
    #[arg(long)]
    pub motion: String,
    /// What a foreign motion does not say.
    #[command(flatten)]
    pub foreign: MotionSourceArgs,
    /// Whose body.
    #[command(flatten)]
    pub body: ShapeArgs,
    /// Shape of the body whose flesh moves, shown on the body of --shape or --mesh; default: that of --shape.
    #[arg(long, value_name = "B0,B1,...", allow_hyphen_values = true)]
    pub flesh: Option<String>,
    /// Show the flesh on this rest mesh, an OBJ file in the body's topology (a stylised body, say).
    #[arg(long, value_name = "FILE")]
    pub mesh: Option<PathBuf>,
    /// Overall gain of the soft-tissue displacement; 0 gives the body alone.
    #[arg(long, default_value_t = 1.0, allow_hyphen_values = true)]
    pub gain: f32,
    /// Change a region, or `everywhere`: `belly:gain=2,softness=1.5,damping=0.5,lag=0.02,mass=1` (factors; lag in seconds;
    /// mass in units of beta[1]). Once for each region.
    #[arg(long, value_name = "REGION:...")]
    pub control: Vec<String>,
    /// The same from a file, a line each, as `tune` writes it.
    #[arg(long, value_name = "FILE")]
    pub controls: Option<PathBuf>,
    /// Paint the gain: an OBJ file in the body's topology with vertex colours; white keeps, black stops the flesh.
    #[arg(long, value_name = "FILE")]
    pub paint: Option<PathBuf>,
    /// Level of detail: make the deltas of so many components of the basis only, the most important first.
    #[arg(long, value_name = "N")]
    pub components: Option<usize>,
    /// Level of detail: leave this region rigid. Once for each region.
    #[arg(long, value_name = "REGION")]
    pub still: Vec<String>,
    /// Stand in the first pose for so long before, seconds: the flesh hangs as it does there, and the first frame makes no
    /// jolt. Without a number 3.
    #[arg(long, value_name = "S", num_args = 0..=1, default_missing_value = "3")]
    pub pre_roll: Option<f32>,
    /// Play the motion round and round until the flesh of its last frame runs into its first, and write one round.
    #[arg(long = "loop", conflicts_with = "pre_roll")]
    pub looped: bool,
    /// Fade the flesh out where the motion is unlike all that the bundle knows, and in again where it is not: below this trust,
    /// 0 to 1. Without a number 0.5.
    #[arg(long, value_name = "TRUST", num_args = 0..=1, default_missing_value = "0.5")]
    pub fade: Option<f32>,
    /// What to write: `.glb` or `.gltf`, `.usda`, a point cache `.pc2` or `.mdd` with its mesh as `.obj` beside it, `.png` (a
    /// picture of some frames), or a folder for an OBJ sequence.
    #[arg(long, value_name = "FILE")]
    pub out: PathBuf,
    /// Frames of a generated motion.
    #[arg(long, default_value_t = 180)]
    pub frames: usize,
}

/// `synth`.
#[derive(Debug, Args)]
pub struct SynthArgs {
    /// Settings.
    #[command(flatten)]
    pub settings: Settings,
    /// The folder to write [default: data/cache/FINGERPRINT].
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
}

/// `fit`.
#[derive(Debug, Args)]
pub struct FitArgs {
    /// Settings.
    #[command(flatten)]
    pub settings: Settings,
    /// A scan set, or whatever `import scans` takes.
    pub scans: PathBuf,
    /// The folder to write.
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,
}

/// `tune`.
#[derive(Debug, Args)]
pub struct TuneArgs {
    /// Settings (of the fit of the scans and of `tuning`).
    #[command(flatten)]
    pub settings: Settings,
    /// The bundle whose flesh is fitted.
    pub bundle: PathBuf,
    /// Scans of the person: a scan set, or whatever `import scans` takes.
    #[arg(long, value_name = "DIR")]
    pub scans: PathBuf,
    /// The clip to go by, SUBJECT/MOTION.TAKE; needed where the scans are of more than one.
    #[arg(long, value_name = "CLIP")]
    pub clip: Option<String>,
    /// The file of controls to write, for `animate --controls`.
    #[arg(long, value_name = "FILE")]
    pub out: PathBuf,
}

/// `inspect`.
#[derive(Debug, Args)]
pub struct InspectArgs {
    /// A clip, a set of clips, a body, a run, a bundle, a mesh, and whatever `import` takes.
    pub path: PathBuf,
    /// The body that clips of ours were made with, whose triangles and bones they lack; otherwise one that lies near.
    #[arg(long, value_name = "FILE")]
    pub body: Option<PathBuf>,
    /// Draw some frames of it.
    #[arg(long, value_name = "FILE.png")]
    pub picture: Option<PathBuf>,
    /// Print JSON.
    #[arg(long)]
    pub json: bool,
}

/// `config`.
#[derive(Debug, Args)]
pub struct ConfigArgs {
    /// Settings.
    #[command(flatten)]
    pub settings: Settings,
    /// What to do with them.
    #[arg(value_enum, default_value = "print")]
    pub action: ConfigAction,
}

/// What `config` does.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum ConfigAction {
    /// Print the resolved settings as TOML.
    Print,
    /// Check them and say nothing if they are fine.
    Check,
    /// Print every setting with its meaning.
    Explain,
}
