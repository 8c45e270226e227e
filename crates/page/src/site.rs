use crate::Result;
use crate::facts::{Facts, MotionFacts};
use softtissue_bundle::{Bundle, BundleFiles};
use softtissue_clips::MotionClip;
use softtissue_store::write_atomic;
use std::borrow::Cow;
use std::path::{Path, PathBuf};

/// The page itself, which is the same for every bundle. The first is what a browser opens.
const ASSETS: [(&str, &str); 7] = [
    ("index.html", include_str!("../assets/index.html")),
    ("page.css", include_str!("../assets/page.css")),
    ("main.js", include_str!("../assets/main.js")),
    ("module.js", include_str!("../assets/module.js")),
    ("motion.js", include_str!("../assets/motion.js")),
    ("panel.js", include_str!("../assets/panel.js")),
    ("view.js", include_str!("../assets/view.js")),
];

/// A page and all that it loads: a list of files whose addresses are relative to each other.
#[derive(Clone, Debug)]
pub struct Site {
    files: Vec<SiteFile>,
}

/// One file of a [`Site`].
#[derive(Clone, Debug)]
pub struct SiteFile {
    /// Address, relative: letters, digits, `_`, `-`, `.` and `/`.
    pub name: String,
    /// Its content.
    pub bytes: Cow<'static, [u8]>,
}

impl SiteFile {
    /// What a server says of it.
    pub fn media_type(&self) -> &'static str {
        match self.name.rsplit('.').next() {
            Some("html") => "text/html; charset=utf-8",
            Some("css") => "text/css; charset=utf-8",
            Some("js") => "text/javascript; charset=utf-8",
            Some("json") => "application/json",
            Some("wasm") => "application/wasm",
            _ => "application/octet-stream",
        }
    }
}

impl Site {
    /// The page of a bundle read from `files`, under `title`, with motions on its body to choose from; `player` is the
    /// WebAssembly module ([`crate::player_module`]).
    ///
    /// # Errors
    /// The bundle cannot be described.
    pub fn new(
        title: &str,
        bundle: &Bundle,
        files: &BundleFiles,
        motions: &[MotionClip],
        player: &'static [u8],
    ) -> Result<Self> {
        let mut site: Vec<SiteFile> =
            ASSETS.map(|(name, text)| SiteFile { name: name.into(), bytes: Cow::Borrowed(text.as_bytes()) }).into();
        site.push(SiteFile { name: "player.wasm".into(), bytes: Cow::Borrowed(player) });
        let parts = files.named().map(|(name, bytes)| (format!("bundle/{name}"), bytes));
        let addresses = parts.clone().map(|(name, _)| name);
        site.extend(parts.map(|(name, bytes)| SiteFile { name, bytes: Cow::Owned(bytes.to_vec()) }));
        let bytes = player.len() + files.named().map(|(_, bytes)| bytes.len()).iter().sum::<usize>();
        let mut chosen = Vec::new();
        for (i, clip) in motions.iter().enumerate() {
            let file = format!("motions/{}.safetensors", i + 1);
            chosen.push(MotionFacts { name: clip.id.motion.replace('_', " "), file: file.clone() });
            site.push(SiteFile { name: file, bytes: Cow::Owned(clip.to_bytes()) });
        }
        let facts = serde_json::json!(Facts::of(title, bundle, addresses, bytes, chosen)?).to_string();
        site.push(SiteFile { name: "facts.json".into(), bytes: Cow::Owned(facts.into_bytes()) });
        Ok(Self { files: site })
    }

    /// All files; the first is the page.
    pub fn files(&self) -> &[SiteFile] {
        &self.files
    }

    /// What stands at an address as a browser asks for it: `/`, `/main.js`, `/bundle/manifest.json?x`.
    pub fn at(&self, address: &str) -> Option<&SiteFile> {
        let path = address.split(['?', '#']).next()?.strip_prefix('/')?;
        if path.is_empty() { self.files.first() } else { self.files.iter().find(|file| file.name == path) }
    }

    /// Writes the folder, each file whole or not at all and the page last. Returns the page's path.
    pub fn write(&self, dir: &Path) -> Result<PathBuf> {
        for file in self.files.iter().rev() {
            write_atomic(&dir.join(&file.name), |w| w.write_all(&file.bytes))?;
        }
        Ok(dir.join(&self.files[0].name))
    }
}
