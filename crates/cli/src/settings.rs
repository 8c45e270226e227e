//! From names, files and `--set` to one checked [`Config`].

use crate::args::Settings;
use crate::config::Config;
use crate::exit::{InputError, UsageError};
use anyhow::{Context, Result};
use std::path::Path;
use toml::{Table, Value};

/// The configurations that travel inside the program, by name. A file states only what differs from the default.
pub const EMBEDDED: [(&str, &str); 4] = [
    ("quick", include_str!("../../../configs/quick.toml")),
    ("smoke", include_str!("../../../configs/smoke.toml")),
    ("full", include_str!("../../../configs/full.toml")),
    ("softsmpl-paper", include_str!("../../../configs/softsmpl-paper.toml")),
];

/// A configuration file may be this long.
const LARGEST_FILE: u64 = 1 << 20;

/// Resolves the settings; returns them with the configuration's name.
pub fn resolve(settings: &Settings) -> Result<(String, Config)> {
    let wanted = settings.config.as_deref().unwrap_or("quick");
    let (name, text) = match EMBEDDED.iter().find(|(name, _)| *name == wanted) {
        Some((name, text)) => ((*name).to_owned(), (*text).to_owned()),
        None => read_file(Path::new(wanted))?,
    };
    let mut table: Table = text.parse().map_err(|e: toml::de::Error| usage(format!("{wanted}: {}", one_line(&e))))?;
    for assignment in &settings.set {
        set(&mut table, assignment)?;
    }
    let mut config: Config =
        Value::Table(table).try_into().map_err(|e| usage(format!("{wanted}: {}", one_line(&e))))?;
    if let Some(seed) = settings.seed {
        config.seed = seed;
    }
    if let Some(device) = &settings.device {
        config.device.clone_from(device);
    }
    config.check().map_err(|reason| usage(format!("{wanted}: {reason}")))?;
    Ok((name, config))
}

/// The settings that a run folder keeps.
pub fn stored(path: &Path) -> Result<Config> {
    let (_, text) = read_file(path)?;
    let broken = |e: toml::de::Error| InputError(format!("{} is damaged: {}", path.display(), one_line(&e)));
    Ok(toml::from_str(&text).map_err(broken)?)
}

fn read_file(path: &Path) -> Result<(String, String)> {
    let bytes = softtissue_store::read_limited(path, LARGEST_FILE).with_context(|| {
        format!("--config takes quick, smoke, full, softsmpl-paper or a file, not {}", path.display())
    })?;
    let text = String::from_utf8(bytes).map_err(|_| usage(format!("{} is no UTF-8 text", path.display())))?;
    let name = path.file_stem().map_or_else(|| "run".into(), |s| s.to_string_lossy().into_owned());
    Ok((name, text))
}

/// Applies `a.b=c`: `c` is read as a TOML value, or as a text where it is none.
fn set(table: &mut Table, assignment: &str) -> Result<()> {
    let (key, value) =
        assignment.split_once('=').ok_or_else(|| usage(format!("--set takes KEY=VALUE, not {assignment:?}")))?;
    let value = format!("x = {value}")
        .parse::<Table>()
        .ok()
        .and_then(|mut t| t.remove("x"))
        .unwrap_or_else(|| Value::String(value.to_owned()));
    let mut path: Vec<&str> = key.trim().split('.').collect();
    let last =
        path.pop().filter(|k| !k.is_empty()).ok_or_else(|| usage(format!("--set {assignment:?} names no setting")))?;
    let mut at = table;
    for part in path {
        at = at
            .entry(part)
            .or_insert_with(|| Value::Table(Table::new()))
            .as_table_mut()
            .ok_or_else(|| usage(format!("--set {assignment:?}: {part} is a value, not a section")))?;
    }
    at.insert(last.to_owned(), value);
    Ok(())
}

fn usage(message: String) -> anyhow::Error {
    UsageError(message).into()
}

/// TOML errors span lines; the first says what, the rest draws where.
fn one_line(error: &toml::de::Error) -> String {
    error.message().replace('\n', " ")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn with(set: &[&str]) -> Result<Config> {
        resolve(&Settings { set: set.iter().map(|s| (*s).to_owned()).collect(), ..Settings::default() }).map(|(_, c)| c)
    }

    #[test]
    fn every_embedded_configuration_resolves() {
        for (name, _) in EMBEDDED {
            let settings = Settings { config: Some(name.into()), ..Settings::default() };
            assert_eq!(resolve(&settings).unwrap().0, name);
        }
    }

    #[test]
    fn quick_explains_every_setting_and_is_the_default() {
        assert_eq!(with(&[]).unwrap(), Config::default());
        let written: Table = EMBEDDED[0].1.parse().unwrap();
        let whole = Table::try_from(Config::default()).unwrap();
        assert_eq!(keys("", &written), keys("", &whole), "configs/quick.toml states each setting once");
    }

    fn keys(prefix: &str, table: &Table) -> Vec<String> {
        let mut all: Vec<String> = table
            .iter()
            .flat_map(|(k, v)| match v {
                Value::Table(t) => keys(&format!("{prefix}{k}."), t),
                _ => vec![format!("{prefix}{k}")],
            })
            .collect();
        all.sort();
        all
    }

    #[test]
    fn set_wins_even_with_the_default_value() {
        let settings = Settings { config: Some("smoke".into()), set: vec!["seed=1".into()], ..Settings::default() };
        assert_eq!(resolve(&settings).unwrap().1.seed, 1);
        assert!(with(&["regresor.steps=3"]).unwrap_err().to_string().contains("regresor"));
        assert!(with(&["seed"]).unwrap_err().to_string().contains("KEY=VALUE"));
        assert!(with(&["seed.x=1"]).is_err());
    }
}
