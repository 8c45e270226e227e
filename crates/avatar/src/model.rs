use crate::avatar::AvatarBody;
use crate::config::{Conditioning, PoseSource};
use crate::network::AvatarNetwork;
use crate::{AvatarError, NetworkConfig, Result};
use burn::module::Module;
use burn::tensor::Device;
use serde::{Deserialize, Serialize};
use softtissue_body::BodyModel;
use softtissue_random::Draws;
use softtissue_store::{create_dir, read_json, sha256_file, write_json_atomic};
use softtissue_train::{State, load_module, module_state, read_state, write_state};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// First word of the manifest.
const FORMAT: &str = "softtissue-avatar";
/// Version of the form.
const VERSION: u64 = 2;
const MANIFEST: &str = "manifest.json";
const BODY: &str = "body.safetensors";

/// What an avatar is and where it came from.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct AvatarInfo {
    /// Whose it is.
    pub subject: String,
    /// Their shape.
    pub beta: Vec<f32>,
    /// Frames a second of its motions.
    pub fps: f32,
    /// Which poses it was learned on.
    pub poses: PoseSource,
    /// Cells along the longest side of the grid that its surfaces are drawn from.
    pub grid: usize,
    /// Licence, which follows that of the scans.
    pub licence: String,
    /// Program, seed, scans, clips.
    pub provenance: serde_json::Value,
}

/// A learned network.
#[derive(Clone, Debug)]
pub struct LearnedNetwork {
    /// What it sees.
    pub conditioning: Conditioning,
    /// Its weights, without autodiff.
    pub network: AvatarNetwork,
    /// Distance of scan points from its surface on the clips that selected it, mm.
    pub validation_mm: f64,
}

/// An avatar on disk: a folder with `manifest.json`, `body.safetensors` and the weights of each network. It is run with
/// burn; the player of bundles cannot.
#[derive(Clone, Debug)]
pub struct AvatarModel {
    /// What it is.
    pub info: AvatarInfo,
    /// The networks' size.
    pub config: NetworkConfig,
    /// The body that they stand on.
    pub body: BodyModel,
    /// The networks.
    pub networks: Vec<LearnedNetwork>,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Manifest {
    format: String,
    version: u64,
    units: String,
    up_axis: String,
    info: AvatarInfo,
    network: NetworkConfig,
    topology: String,
    /// Validation error of each network, mm.
    networks: BTreeMap<Conditioning, f64>,
    /// SHA-256 of each file.
    files: BTreeMap<String, String>,
}

fn weights(conditioning: Conditioning) -> String {
    format!("{}.safetensors", conditioning.name())
}

fn refused(path: &Path, reason: impl std::fmt::Display) -> AvatarError {
    AvatarError::Data(format!("{} is no avatar that can be used: {reason}", path.display()))
}

impl AvatarModel {
    /// Whether a folder says of itself that it holds an avatar.
    pub fn is_at(dir: &Path) -> bool {
        let manifest: std::result::Result<serde_json::Value, _> = read_json(&dir.join(MANIFEST));
        manifest.is_ok_and(|m| m.get("format").and_then(serde_json::Value::as_str) == Some(FORMAT))
    }

    /// Writes the folder; the manifest, which names the hash of every other file, comes last.
    ///
    /// # Errors
    /// The disk.
    pub fn write(&self, dir: &Path) -> Result<()> {
        create_dir(dir)?;
        let manifest = dir.join(MANIFEST);
        match std::fs::remove_file(&manifest) {
            Err(e) if e.kind() != std::io::ErrorKind::NotFound => {
                return Err(softtissue_store::StoreError::io("replace", &manifest, e).into());
            }
            _ => {}
        }
        let body = dir.join(BODY);
        self.body.write(&body).map_err(|e| refused(dir, e))?;
        let mut files = BTreeMap::from([(BODY.to_owned(), sha256_file(&body)?)]);
        for learned in &self.networks {
            let name = weights(learned.conditioning);
            let state: State = module_state(&learned.network).into_iter().map(|a| (a.name.clone(), a)).collect();
            let path = dir.join(&name);
            write_state(&path, &state, &[("format", FORMAT.into())])?;
            files.insert(name, sha256_file(&path)?);
        }
        let form = Manifest {
            format: FORMAT.into(),
            version: VERSION,
            units: "metres".into(),
            up_axis: "y".into(),
            info: self.info.clone(),
            network: self.config.clone(),
            topology: self.body.topology.hash(),
            networks: self.networks.iter().map(|l| (l.conditioning, l.validation_mm)).collect(),
            files,
        };
        Ok(write_json_atomic(&manifest, &form)?)
    }

    /// Reads and checks a folder; the networks lie on `device`, which is without autodiff.
    ///
    /// # Errors
    /// Another format or version, a file that is damaged, or weights of another size.
    pub fn read(dir: &Path, device: &Device) -> Result<Self> {
        let path: PathBuf = dir.join(MANIFEST);
        if !Self::is_at(dir) {
            return Err(refused(dir, "its manifest.json is missing or of something else"));
        }
        let head: serde_json::Value = read_json(&path)?;
        if head.get("version").and_then(serde_json::Value::as_u64) != Some(VERSION) {
            return Err(refused(dir, format!("its version is not {VERSION}; use the program that wrote it")));
        }
        let form: Manifest = read_json(&path)?;
        form.network.check().map_err(|e| refused(dir, e))?;
        let AvatarInfo { fps, grid, .. } = form.info;
        if !(fps > 0.0 && fps <= 1000.0 && (4..=1024).contains(&grid)) {
            let reason =
                format!("{fps} frames a second and {grid} cells are none; copy the folder again or train again");
            return Err(refused(dir, reason));
        }
        let expected = form.networks.keys().map(|c| weights(*c)).chain([BODY.to_owned()]);
        for name in expected {
            let file = dir.join(&name);
            if form.files.get(&name) != Some(&sha256_file(&file)?) {
                return Err(refused(&file, "its hash is not the manifest's; copy the folder again or train again"));
            }
        }
        let body = BodyModel::read(&dir.join(BODY)).map_err(|e| refused(dir, e))?;
        if body.topology.hash() != form.topology || form.info.beta.len() > body.shape_count() {
            return Err(refused(dir, "its body is not the one that the manifest speaks of"));
        }
        let mut networks = Vec::new();
        for (conditioning, validation_mm) in form.networks {
            let state = read_state(&dir.join(weights(conditioning)))?;
            let mut draws = Draws::new(0, "autoavatar", 0, 0);
            let (joints, observers) = (body.joint_count(), form.network.observers.min(body.vertex_count()));
            let network = AvatarNetwork::new(&form.network, conditioning, joints, observers, &mut draws, device);
            let network = load_module(network, &state).map_err(|e| refused(dir, e))?.no_grad();
            networks.push(LearnedNetwork { conditioning, network, validation_mm });
        }
        Ok(Self { info: form.info, config: form.network, body, networks })
    }

    /// The network that sees `conditioning`.
    pub fn network(&self, conditioning: Conditioning) -> Option<&AvatarNetwork> {
        self.networks.iter().find(|l| l.conditioning == conditioning).map(|l| &l.network)
    }

    /// What its networks share.
    ///
    /// # Errors
    /// A body without texture coordinates.
    pub fn avatar_body(&self, device: &Device) -> Result<AvatarBody> {
        AvatarBody::new(&self.config, &self.body, device)
    }
}
