use crate::motion::FittedMotion;
use crate::objective::Objective;
use crate::packed::PackedBody;
use crate::solver::{LevenbergMarquardt, PoseProblem, PoseSolver};
use crate::subject::{SubjectModel, fit_subject};
use crate::taken::TakenPeople;
use crate::weights::{VelocityChange, mean_weights, rigidity_weights};
use crate::{DeltaForm, FitConfig, FitError, Result, Solver, TriangleForm};
use glam::Vec3;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use softtissue_body::BodyModel;
use softtissue_clips::{ClipEntry, ClipId, DeltaClip, FitSet, FittedSubject, Part, ScanSet, Split};
use softtissue_geometry::{Adjacency, Frames};
use softtissue_monitor::Monitor;
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// How well a clip was fitted; one line of `quality.json`.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct ClipQuality {
    /// Which clip.
    pub id: ClipId,
    /// Median over frames of the weighted rms distance, mm.
    pub distance_mm: f64,
    /// Mean trips over the vertices a frame while frames were solved one by one.
    pub evaluations: f64,
    /// The same while they were solved together; 0 where they were not.
    pub smoothing_evaluations: f64,
    /// Vertices, summed over frames, that the pose folds; their deltas are their neighbours' mean.
    pub folded: usize,
    /// Whether the distance lies beyond `fit.refuse_beyond`: the clip is of no use (for a training clip an error).
    pub refused: bool,
}

/// People whose fit a finished set already holds, by name: the folder of a set that was fitted to the same scans of the
/// person, with the same training clips of theirs, on the same body, with the same settings and solver. The caller vouches
/// for that.
pub type FittedPeople = BTreeMap<String, PathBuf>;

/// [`fit_set_with`] this crate's own solver, which `fit.solver` must name.
pub fn fit_set(
    scans: &ScanSet,
    split: &Split,
    body: &BodyModel,
    config: &FitConfig,
    out: &Path,
    monitor: &dyn Monitor,
) -> Result<FitSet> {
    if config.solver != Solver::LevenbergMarquardt {
        let remedy = "write \"levenberg-marquardt\" where no other solver is at hand";
        return Err(FitError::Config { field: "solver", value: "\"adam\"".into(), remedy });
    }
    fit_set_with(&LevenbergMarquardt(config), scans, split, body, config, &FittedPeople::new(), out, monitor)
}

/// Fits all clips of a split and writes the fit set: `motions/`, `deltas/`, `subjects/`, `quality.json` and, last,
/// `index.json`.
///
/// What a subject is (shape, subject template, weights) comes from its training clips only. A subject without any
/// gets shape and template from the first `fit.new_subject_frames` frames of each of its own clips and weights from
/// the mean over training subjects. So nothing of a left-out clip reaches another clip of a subject that trains. A
/// left-out clip that cannot be fitted is reported, not an error; a training clip is an error.
///
/// `solver` finds the clips' poses. What a subject is comes from this crate's own, whichever it is: it needs a few
/// frames only. People of `fitted` who train are taken from there as they are, since nobody else's clips reach them.
#[expect(clippy::too_many_arguments, reason = "a fit's whole context, used in one place")]
pub fn fit_set_with(
    solver: &dyn PoseSolver,
    scans: &ScanSet,
    split: &Split,
    body: &BodyModel,
    config: &FitConfig,
    fitted: &FittedPeople,
    out: &Path,
    monitor: &dyn Monitor,
) -> Result<FitSet> {
    config.check()?;
    split.check()?;
    check_body(scans, body)?;
    let ids: BTreeSet<&ClipId> = split.train.iter().chain(&split.validation).chain(&split.test).collect();
    let taken = TakenPeople::read(fitted, split, &ids)?;
    let ids: Vec<&ClipId> = ids.into_iter().filter(|id| !taken.holds(&id.subject)).collect();
    let packed = Arc::new(PackedBody::new(body));
    let subjects = fit_subjects(scans, split, body, &packed, &taken, config, monitor)?;

    let frames: usize = scans.clips().iter().filter(|c| ids.contains(&&c.id)).map(|c| c.frames).sum();
    monitor.begin("fit: poses and deltas", frames as u64, "frames");
    let adjacency = Adjacency::new(&body.topology);
    let triangles = match config.delta_form {
        DeltaForm::Vertices => None,
        DeltaForm::Triangles => Some(TriangleForm::new(&body.template, &body.topology, config.triangle_smoothness)?),
    };
    let surface = Surface { adjacency: &adjacency, triangles: triangles.as_ref() };
    let fit_one = |id: &&ClipId| {
        let subject = subjects.iter().find(|s| s.name == id.subject).expect("every subject of the split is fitted");
        let training = split.part(id) == Some(Part::Train);
        fit_clip(solver, scans, body, id, subject, training, surface, config, out, monitor)
    };
    let clips: Vec<ClipResult> = ids.par_iter().map(fit_one).collect::<Result<_>>()?;
    monitor.end();
    write_subjects(&subjects, &clips, &taken, split, out)?;
    taken.copy(out)?;
    let mut quality: Vec<&ClipQuality> = clips.iter().map(|c| &c.quality).chain(taken.quality()).collect();
    quality.sort_by_key(|q| &q.id);
    softtissue_store::write_json_atomic(&out.join("quality.json"), &quality)?;
    let provenance =
        serde_json::json!({ "stage": "fit", "config": config, "split": split, "scans": scans.provenance() });
    let entries = clips.into_iter().map(|c| c.entry).chain(taken.clips()).collect();
    Ok(FitSet::finish(out, body.vertex_count(), &body.topology.hash(), provenance, entries)?)
}

fn check_body(scans: &ScanSet, body: &BodyModel) -> Result<()> {
    let topology = body.topology.hash();
    if scans.vertex_count() != body.vertex_count() {
        Err(FitError::VertexCount { scans: scans.vertex_count(), body: body.vertex_count() })
    } else if scans.topology() != topology {
        Err(FitError::Topology { scans: scans.topology().to_owned(), body: topology })
    } else {
        Ok(())
    }
}

/// Subjects with training clips first, then the others, which borrow the former's mean weights.
fn fit_subjects(
    scans: &ScanSet,
    split: &Split,
    body: &BodyModel,
    packed: &Arc<PackedBody>,
    taken: &TakenPeople,
    config: &FitConfig,
    monitor: &dyn Monitor,
) -> Result<Vec<SubjectModel>> {
    let of = |ids: &[ClipId], name: &str| ids.iter().filter(|id| id.subject == name).cloned().collect::<Vec<_>>();
    let left_out: Vec<ClipId> = split.validation.iter().chain(&split.test).cloned().collect();
    let names: BTreeSet<&str> = split.train.iter().map(|id| id.subject.as_str()).collect();
    let new_names: BTreeSet<&str> =
        left_out.iter().map(|id| id.subject.as_str()).filter(|n| !names.contains(n)).collect();
    let names: Vec<&str> = names.into_iter().filter(|name| !taken.holds(name)).collect();
    monitor.begin("fit: subjects", (names.len() + new_names.len()) as u64, "subjects");
    let mut subjects = Vec::new();
    for name in names {
        subjects.push(fit_subject(scans, name, &of(&split.train, name), None, body, packed, config, monitor)?);
        monitor.advance(1, name);
    }
    let own = subjects.iter().map(|s: &SubjectModel| (s.name.as_str(), s.fit_weight.as_slice()));
    let theirs = taken.subjects().map(|s| (s.subject.as_str(), s.fit_weight.as_slice()));
    let shared = mean_weights(by_name(own.chain(theirs)));
    for name in new_names {
        subjects.push(fit_subject(
            scans,
            name,
            &of(&left_out, name),
            shared.as_deref(),
            body,
            packed,
            config,
            monitor,
        )?);
        monitor.advance(1, name);
    }
    monitor.end();
    Ok(subjects)
}

/// What a clip's deltas lie on.
#[derive(Clone, Copy)]
struct Surface<'a> {
    adjacency: &'a Adjacency,
    triangles: Option<&'a TriangleForm>,
}

struct ClipResult {
    entry: ClipEntry,
    quality: ClipQuality,
    /// Of training clips only.
    change: Option<VelocityChange>,
}

#[expect(clippy::too_many_arguments, reason = "one clip's whole context, used in one place")]
fn fit_clip(
    solver: &dyn PoseSolver,
    scans: &ScanSet,
    body: &BodyModel,
    id: &ClipId,
    subject: &SubjectModel,
    training: bool,
    surface: Surface,
    config: &FitConfig,
    out: &Path,
    monitor: &dyn Monitor,
) -> Result<ClipResult> {
    let scan = scans.scan(id)?;
    let SubjectModel { template, fit_weight, objective, .. } = subject;
    let shaped = body.shaped(&subject.beta);
    let problem = PoseProblem { body, shaped: &shaped, template, fit_weight, objective };
    let mut fitted = solver.solve_clip(&problem, &scan, monitor)?;
    let smoothing = objective.smooth(&mut fitted, &scan, config, monitor)?;
    let distance_m = fitted.median_distance();
    let refused = distance_m > config.refuse_beyond;
    if refused && training {
        return Err(FitError::NotThisBody { clip: id.clone(), distance_m });
    }
    let (mut deltas, folded) = clip_deltas(&subject.objective, &fitted, &scan.vertices, 1, surface.adjacency);
    if let Some(triangles) = surface.triangles {
        for t in 0..deltas.len() {
            let whole = triangles.round_trip(deltas.frame(t));
            deltas.frame_mut(t).copy_from_slice(&whole);
        }
    }
    if refused {
        monitor
            .say(&format!("clip {id} is left out and lies {distance_m:.3} m from the body: its deltas are of no use"));
    }
    if folded > 0 {
        monitor.say(&format!(
            "clip {id}: {folded} vertices of {} frames fold; their neighbours' deltas stand in",
            scan.vertices.len()
        ));
    }
    fitted.clip(id.clone(), scan.fps).write(&FitSet::motion_path(out, id))?;
    let change = training.then(|| VelocityChange::of(&deltas, scan.fps));
    DeltaClip { id: id.clone(), fps: scan.fps, deltas }.write(&FitSet::delta_path(out, id))?;
    let a_frame = |trips: usize| trips as f64 / scan.vertices.len() as f64;
    let quality = ClipQuality {
        id: id.clone(),
        distance_mm: 1e3 * distance_m,
        evaluations: a_frame(fitted.evaluations.iter().sum()),
        smoothing_evaluations: a_frame(smoothing),
        folded,
        refused,
    };
    Ok(ClipResult { entry: ClipEntry { id: id.clone(), frames: scan.vertices.len(), fps: scan.fps }, quality, change })
}

/// Deltas of the fitted frames `[frames, V]`, and how many vertices were folded.
pub(crate) fn clip_deltas(
    objective: &Objective,
    fitted: &FittedMotion,
    scan: &Frames,
    stride: usize,
    adjacency: &Adjacency,
) -> (Frames, usize) {
    let mut deltas = Frames::new(scan.points_per_frame());
    let mut count = 0;
    for (i, state) in fitted.states.iter().enumerate() {
        let sorted = objective.body.packed.sorted(scan.frame(i * stride));
        let (mut frame, folded) = objective.deltas(state, &sorted);
        count += folded.len();
        let whole: BTreeSet<u32> = folded.iter().copied().collect();
        let stand_in = |v: u32| {
            let near = adjacency.neighbours(v as usize).iter().filter(|n| !whole.contains(n));
            let (sum, n) = near.fold((Vec3::ZERO, 0), |(sum, n), i| (sum + frame[*i as usize], n + 1));
            if n == 0 { Vec3::ZERO } else { sum / n as f32 }
        };
        let replaced: Vec<Vec3> = folded.iter().map(|v| stand_in(*v)).collect();
        folded.iter().zip(replaced).for_each(|(v, d)| frame[*v as usize] = d);
        deltas.push(&frame);
    }
    (deltas, count)
}

/// In the order of their names, so that sums do not depend on who was taken from where.
fn by_name<'a>(weights: impl Iterator<Item = (&'a str, &'a [f32])>) -> impl Iterator<Item = &'a [f32]> {
    weights.collect::<BTreeMap<_, _>>().into_values()
}

fn write_subjects(
    subjects: &[SubjectModel],
    clips: &[ClipResult],
    taken: &TakenPeople,
    split: &Split,
    out: &Path,
) -> Result<()> {
    let trains = |name: &str| split.train.iter().any(|id| id.subject == name);
    let vertex_count = subjects.first().map_or(0, |s| s.fit_weight.len());
    let own = |name: &str| {
        let changes = clips.iter().filter(|c| c.entry.id.subject == name).filter_map(|c| c.change.as_ref());
        rigidity_weights(changes, vertex_count)
    };
    let of_training: Vec<(&str, Vec<f32>)> =
        subjects.iter().filter(|s| trains(&s.name)).map(|s| (s.name.as_str(), own(&s.name))).collect();
    let theirs = taken.subjects().map(|s| (s.subject.as_str(), s.rigidity_weight.as_slice()));
    let shared = mean_weights(by_name(of_training.iter().map(|(name, w)| (*name, w.as_slice())).chain(theirs)));
    for subject in subjects {
        let rigidity_weight = match &shared {
            Some(shared) if !trains(&subject.name) => shared.clone(),
            _ => own(&subject.name),
        };
        let fitted = FittedSubject {
            subject: subject.name.clone(),
            beta: subject.beta.clone(),
            template: subject.template.clone(),
            fit_weight: subject.fit_weight.clone(),
            rigidity_weight,
        };
        fitted.write(&FitSet::subject_path(out, &subject.name))?;
    }
    Ok(())
}
