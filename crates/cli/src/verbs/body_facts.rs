//! What `inspect` says of a parametric body, ours or foreign.

use anyhow::Result;
use serde_json::{Map, Value, json};
use softtissue_body::procedural::Anatomy;
use softtissue_body::{BodyBuild, BodyModel, Region};
use softtissue_import::arrays::{ArrayLimits, Npz};
use softtissue_import::{ImportedBody, SmplConfig, import_smpl};
use std::path::Path;

/// Whether a file with this ending holds a foreign body rather than something else.
pub fn is_foreign(path: &Path) -> bool {
    match path.extension().and_then(|e| e.to_str()) {
        Some("pkl") => true,
        Some("npz") => Npz::open(path, &ArrayLimits::default()).is_ok_and(|npz| npz.contains("v_template")),
        _ => false,
    }
}

/// Facts of a foreign body file, as it would come in with all its joints.
pub fn foreign(path: &Path) -> Result<Value> {
    let config = SmplConfig { keep_joints: true, shapes: 300, ..SmplConfig::default() };
    let ImportedBody { model, source, notes } = import_smpl(path, &config)?;
    let mut facts = facts(&model);
    facts["what"] = json!(format!("body model {source}, for `softtissue import body`"));
    facts["on import"] = json!(notes);
    Ok(facts)
}

/// Facts of a body of ours.
pub fn facts(body: &BodyModel) -> Value {
    let build = BodyBuild::fit(body);
    let mut problems = Vec::new();
    match body.topology.check_closed_manifold() {
        Ok(0) => {}
        Ok(genus) => problems.push(format!("genus {genus}")),
        Err(e) => problems.push(format!("{e}: its volume and weight mean little")),
    }
    if let Err(e) = Anatomy::of(body) {
        problems.push(format!("no flesh can be put on it: {e}"));
    }
    let count = |r: &Region| (r.name().to_owned(), json!(body.regions.vertices(*r).len()));
    let regions: Map<String, Value> = Region::ALL.iter().map(count).collect();
    let correctives = body.pose_directions.iter().any(|d| d.length_squared() > 0.0);
    json!({
        "what": "parametric body", "vertices": body.vertex_count(), "triangles": body.topology.faces.len(),
        "joints": body.joint_count(), "shape_coefficients": body.shape_count(), "pose_correctives": correctives,
        "texture_coordinates": !body.uv.faces.is_empty(), "height_m": build.height(&[]), "weight_kg": build.weight(&[]),
        "body_mass_index": build.bmi(&[]), "vertices_of_regions": regions, "units": "metres", "up": "Y",
        "problems": problems,
    })
}
