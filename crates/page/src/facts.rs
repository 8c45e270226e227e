use serde::Serialize;
use softtissue_body::{BodyBuild, Region};
use softtissue_bundle::Bundle;

/// What the page wants to know beside the bundle's files; `facts.json`.
#[derive(Debug, Serialize)]
pub struct Facts {
    title: String,
    method: String,
    licence: String,
    /// The bundle's files: manifest, body, model.
    bundle: [String; 3],
    motions: Vec<MotionFacts>,
    regions: Vec<RegionFacts>,
    /// Cube root of the weight, kg^(1/3), and height, metres, as affine functions of the shape.
    rooted_weight: Vec<f32>,
    height: Vec<f32>,
    /// Shape coefficients of the people of the training: `[index, least, most]`.
    trained: Vec<(usize, f32, f32)>,
    largest_delta_m: f32,
    /// Of the player and the bundle, which are loaded before anything is shown.
    bytes: usize,
}

/// A motion to choose.
#[derive(Debug, Serialize)]
pub struct MotionFacts {
    /// In words.
    pub name: String,
    /// Address in the folder.
    pub file: String,
}

#[derive(Debug, Serialize)]
struct RegionFacts {
    name: &'static str,
    soft: bool,
}

impl Facts {
    /// Of a bundle, whose files have these addresses.
    pub fn of(
        title: &str,
        bundle: &Bundle,
        files: [String; 3],
        bytes: usize,
        motions: Vec<MotionFacts>,
    ) -> crate::Result<Self> {
        let build = BodyBuild::fit(&bundle.body);
        let present = |region: &Region| bundle.body.regions.0.contains(region);
        let regions = Region::ALL.into_iter().filter(present);
        let trained = bundle.manifest()?["limits"]["beta"].clone();
        Ok(Self {
            title: title.to_owned(),
            method: bundle.info.method.clone(),
            licence: bundle.info.licence.clone(),
            bundle: files,
            motions,
            regions: regions.map(|r| RegionFacts { name: r.name(), soft: r.is_soft() }).collect(),
            rooted_weight: build.rooted_weight,
            height: build.height,
            trained: serde_json::from_value(trained).unwrap_or_default(),
            largest_delta_m: bundle.info.largest_delta_m,
            bytes,
        })
    }
}
