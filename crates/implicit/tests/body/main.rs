//! On the procedural body: observers, atlas, raw scans, meshes.

mod atlas;
mod observers;
mod scans;

use softtissue_body::BodyModel;
use softtissue_body::procedural::{ProceduralConfig, generate};
use std::sync::OnceLock;

/// The coarse body, from few people: its rest mesh is what counts.
fn body() -> &'static BodyModel {
    static BODY: OnceLock<BodyModel> = OnceLock::new();
    BODY.get_or_init(|| {
        generate(&ProceduralConfig { level: 1, people: 16, shapes: 2, ..Default::default() }).expect("a body").model
    })
}
