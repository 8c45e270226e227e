use crate::descriptor::Descriptor;
use crate::error::plain;
use crate::manifest::{FileEntry, Manifest};
use crate::{Bundle, BundleError, Result, arrays};
use softtissue_body::BodyModel;
use softtissue_store::{
    Limits, StoreError, TensorFile, create_dir, read_limited, sha256_bytes, sha256_file, write_json_atomic,
};
use std::path::Path;

/// Name of the list of contents, written last: a folder without it is no bundle.
pub const MANIFEST_FILE: &str = "manifest.json";
/// Name of the learned arrays and the self-check.
const MODEL_FILE: &str = "model.safetensors";
/// Name of the body.
const BODY_FILE: &str = "body.safetensors";

/// Largest file of a bundle that is read into memory whole, bytes.
const LARGEST_FILE: u64 = 1 << 30;

/// The files of a bundle, whole.
#[derive(Clone, Debug, Default)]
pub struct BundleFiles {
    /// `manifest.json`.
    pub manifest: Vec<u8>,
    /// `body.safetensors`.
    pub body: Vec<u8>,
    /// `model.safetensors`.
    pub model: Vec<u8>,
}

impl BundleFiles {
    /// Reads the files of a folder as they are; [`Bundle::from_memory`] checks them.
    pub fn read(dir: &Path) -> Result<Self> {
        let read = |name: &str| read_limited(&dir.join(name), LARGEST_FILE);
        Ok(Self { manifest: read(MANIFEST_FILE)?, body: read(BODY_FILE)?, model: read(MODEL_FILE)? })
    }
    /// Their names in a folder and their contents: manifest, body, model.
    pub fn named(&self) -> [(&'static str, &[u8]); 3] {
        [(MANIFEST_FILE, &self.manifest), (BODY_FILE, &self.body), (MODEL_FILE, &self.model)]
    }
}

impl Bundle {
    /// Writes the folder: model and body, then the manifest with a hash of both. An older bundle there loses its manifest
    /// first, so that no moment shows a manifest beside files of another. What would be refused on reading is
    /// not written.
    pub fn write(&self, dir: &Path) -> Result<()> {
        let manifest_path = dir.join(MANIFEST_FILE);
        self.check().map_err(|reason| BundleError::refused(dir, reason))?;
        if !self.info.largest_delta_m.is_finite() {
            return Err(BundleError::refused(dir, "its largest delta is no number; train again"));
        }
        let mut manifest = self.manifest_form()?;
        let model = arrays::collect(self).map_err(|reason| BundleError::refused(dir, reason))?;
        create_dir(dir)?;
        match std::fs::remove_file(&manifest_path) {
            Err(e) if e.kind() != std::io::ErrorKind::NotFound => Err(StoreError::io("replace", &manifest_path, e))?,
            _ => {}
        }
        self.body.write(&dir.join(BODY_FILE))?;
        model.write(&dir.join(MODEL_FILE))?;
        let entry = |name: &str| -> Result<FileEntry> {
            let path = dir.join(name);
            let bytes = std::fs::metadata(&path).map_err(|e| StoreError::io("read", &path, e))?.len();
            Ok(FileEntry { name: name.to_owned(), bytes, sha256: sha256_file(&path)? })
        };
        manifest.files = vec![entry(BODY_FILE)?, entry(MODEL_FILE)?];
        Ok(write_json_atomic(&manifest_path, &manifest)?)
    }

    /// Reads a folder and runs its self-check. Everything that the format forbids is refused: a newer version, a wrong
    /// hash or size, a file outside, arrays that are missing, unknown, of the wrong shape or not finite, a body of
    /// another topology, and an output other than the one recorded.
    pub fn read(dir: &Path) -> Result<Self> {
        let manifest_path = dir.join(MANIFEST_FILE);
        let manifest = Manifest::read(&manifest_path)?;
        check_files(dir, &manifest_path, &manifest.files)?;
        let body = BodyModel::read(&dir.join(BODY_FILE))?;
        let model = TensorFile::open_limited(&dir.join(MODEL_FILE), arrays::LIMITS)?;
        Self::assembled(dir, manifest, body, &model)
    }

    /// The same of a bundle that lies in memory: a page's downloads, or a game's archive. Errors call its files by
    /// their names in a folder.
    pub fn from_memory(files: BundleFiles) -> Result<Self> {
        let dir = Path::new("");
        let manifest = Manifest::parse(Path::new(MANIFEST_FILE), &files.manifest)?;
        check_list(Path::new(MANIFEST_FILE), &manifest.files)?;
        for (entry, bytes) in manifest.files.iter().zip([&files.body, &files.model]) {
            let path = Path::new(&entry.name);
            check_length(path, bytes.len() as u64, entry)?;
            check_hash(path, sha256_bytes(bytes), entry)?;
        }
        let body = TensorFile::from_bytes(Path::new(BODY_FILE), files.body, Limits::default())?;
        let model = TensorFile::from_bytes(Path::new(MODEL_FILE), files.model, arrays::LIMITS)?;
        Self::assembled(dir, manifest, BodyModel::from_file(&body)?, &model)
    }

    fn assembled(dir: &Path, manifest: Manifest, body: BodyModel, model: &TensorFile) -> Result<Self> {
        let manifest_path = dir.join(MANIFEST_FILE);
        let topology = body.topology.hash();
        if topology != manifest.topology {
            let found = plain(&manifest.topology);
            return Err(BundleError::Topology { path: manifest_path, found, expected: topology });
        }
        if body.skeleton.names != manifest.joints {
            return Err(BundleError::refused(
                &manifest_path,
                "its joints are not those of its body, in order; export the bundle again",
            ));
        }
        let model_path = model.path();
        let arrays::Arrays { model: learned, trust, self_check } =
            arrays::read(model, &manifest.model, manifest.fps, manifest.precision)?;
        let Manifest { info, descriptor, .. } = manifest;
        let bundle = Self { info, body, descriptor, model: learned, trust, self_check };
        bundle.check().map_err(|reason| BundleError::refused(model_path, reason))?;
        bundle.run_self_check(dir)?;
        Ok(bundle)
    }

    /// What the manifest says, but for the list of files.
    pub fn manifest(&self) -> Result<serde_json::Value> {
        let mut value = serde_json::json!(self.manifest_form()?);
        value.as_object_mut().expect("a struct is an object").remove("files");
        Ok(value)
    }

    fn manifest_form(&self) -> Result<Manifest> {
        let lag_frames =
            Descriptor::with_parts(&self.descriptor, &self.body, self.model.descriptor_parts(&self.descriptor))?
                .lag_frames();
        Ok(Manifest::of(self, lag_frames))
    }

    /// Refuses a bundle that is not for the mesh of this topology hash.
    pub fn require_topology(&self, dir: &Path, expected: &str) -> Result<()> {
        let found = self.body.topology.hash();
        if found == expected {
            return Ok(());
        }
        Err(BundleError::Topology { path: dir.join(MANIFEST_FILE), found, expected: expected.to_owned() })
    }

    fn run_self_check(&self, dir: &Path) -> Result<()> {
        // A descriptor that does not fit the arrays knows no file.
        let unfit = |e: BundleError| match e {
            BundleError::Descriptor(e) => {
                BundleError::refused(&dir.join(MANIFEST_FILE), format!("{e}; export the bundle again"))
            }
            other => other,
        };
        let (frame, place, difference) = self.self_check.worst(self).map_err(unfit)?;
        let tolerance = self.self_check.tolerance();
        if difference <= tolerance {
            return Ok(());
        }
        Err(BundleError::SelfCheck {
            path: dir.to_owned(),
            frame,
            vertex: self.self_check.vertices[place],
            difference_mm: difference * 1e3,
            tolerance_mm: tolerance * 1e3,
        })
    }
}

/// The list names the two files, each once.
fn check_list(manifest_path: &Path, files: &[FileEntry]) -> Result<()> {
    let names: Vec<&str> = files.iter().map(|f| f.name.as_str()).collect();
    if let Some(name) = names.iter().find(|name| ![BODY_FILE, MODEL_FILE].contains(name)) {
        return Err(BundleError::refused(
            manifest_path,
            format!("it lists {name:?}, which is no file of a bundle; export the bundle again"),
        ));
    }
    if names != [BODY_FILE, MODEL_FILE] {
        return Err(BundleError::refused(
            manifest_path,
            format!("it lists {names:?}, expected {BODY_FILE} and {MODEL_FILE}; export the bundle again"),
        ));
    }
    Ok(())
}

/// The files are what the list says: plain files inside the folder, of that length and hash.
fn check_files(dir: &Path, manifest_path: &Path, files: &[FileEntry]) -> Result<()> {
    check_list(manifest_path, files)?;
    let inside = |path: &Path| std::fs::canonicalize(path).map_err(|e| StoreError::io("read", path, e));
    let root = inside(dir)?;
    for entry in files {
        let path = dir.join(&entry.name);
        if inside(&path)? != root.join(&entry.name) {
            return Err(BundleError::refused(&path, "it leads out of the bundle's folder; copy the file itself"));
        }
        // A pipe or device would be waited for without end.
        let found = std::fs::metadata(&path).map_err(|e| StoreError::io("read", &path, e))?;
        if !found.is_file() {
            return Err(BundleError::refused(&path, "it is no file; copy or export the bundle again"));
        }
        check_length(&path, found.len(), entry)?;
        check_hash(&path, sha256_file(&path)?, entry)?;
    }
    Ok(())
}

fn check_length(path: &Path, found: u64, entry: &FileEntry) -> Result<()> {
    if found == entry.bytes {
        return Ok(());
    }
    let says = entry.bytes;
    let reason = format!("it has {found} bytes, the manifest says {says}; copy or export the bundle again");
    Err(BundleError::refused(path, reason))
}

fn check_hash(path: &Path, found: String, entry: &FileEntry) -> Result<()> {
    if found == entry.sha256 {
        return Ok(());
    }
    Err(BundleError::Hash { path: path.to_owned(), found, expected: plain(&entry.sha256) })
}
