//! From names, files and `--set` to one checked [`Config`].

use crate::args::Settings;
use crate::config::{Config, Method};
use crate::exit::{InputError, UsageError};
use anyhow::{Context, Result};
use std::path::Path;
use toml::{Table, Value};

/// The configurations that travel inside the program, by name. A file states only what differs from the default.
pub const EMBEDDED: [(&str, &str); 6] = [
    ("quick", include_str!("../../../configs/quick.toml")),
    ("smoke", include_str!("../../../configs/smoke.toml")),
    ("full", include_str!("../../../configs/full.toml")),
    ("softsmpl-paper", include_str!("../../../configs/softsmpl-paper.toml")),
    ("casas-otaduy-paper", include_str!("../../../configs/casas-otaduy-paper.toml")),
    ("autoavatar-full", include_str!("../../../configs/autoavatar-full.toml")),
];

/// A configuration file may be this long.
const LARGEST_FILE: u64 = 1 << 20;

/// Settings with what they were resolved from.
pub struct Resolved {
    /// Name of the configuration.
    pub name: String,
    /// The settings, checked.
    pub config: Config,
    /// Whether the user named a licence; the default speaks of generated scans only.
    pub licence_stated: bool,
}

/// Resolves the settings.
pub fn resolve(settings: &Settings) -> Result<Resolved> {
    let wanted = settings.config.as_deref().unwrap_or("quick");
    let embedded = EMBEDDED.iter().find(|(name, _)| *name == wanted);
    let (name, text) = match embedded {
        Some((name, text)) => ((*name).to_owned(), (*text).to_owned()),
        None => read_file(Path::new(wanted))?,
    };
    // Read alone first: only then an error has a line.
    let wrong = |e: &toml::de::Error| usage(format!("{wanted}: {}", one_line(&text, e)));
    toml::from_str::<Config>(&text).map_err(|e| wrong(&e))?;
    let mut table: Table = text.parse().map_err(|e| wrong(&e))?;
    if embedded.is_some() {
        // What our own files state in full is not the user's statement.
        table.remove("licence");
        table.get_mut("synth").and_then(Value::as_table_mut).map(|synth| synth.remove("seed"));
    }
    for assignment in &settings.set {
        set(&mut table, assignment)?;
    }
    let licence_stated = table.contains_key("licence");
    let synth_seed_stated = table.get("synth").is_some_and(|synth| synth.get("seed").is_some());
    let mut config: Config = Value::Table(table)
        .try_into()
        .map_err(|e: toml::de::Error| usage(format!("--set: {}", e.to_string().replace('\n', " "))))?;
    if let Some(seed) = settings.seed {
        config.seed = seed;
    }
    if !synth_seed_stated {
        config.synth.seed = config.seed;
    }
    if let Some(device) = &settings.device {
        config.device.clone_from(device);
    }
    if config.method == Method::Autoavatar && config.synth.scanner.raw_points == 0 {
        // it learns from nothing else
        config.synth.scanner.raw_points = config.autoavatar.raw_points;
    }
    config.check().map_err(|reason| usage(format!("{wanted}: {reason}")))?;
    Ok(Resolved { name, config, licence_stated })
}

/// The settings that a run folder keeps.
pub fn stored(path: &Path) -> Result<Config> {
    let (_, text) = read_file(path)?;
    let broken = |reason: String| InputError(format!("{} is damaged: {reason}", path.display()));
    let config: Config = toml::from_str(&text).map_err(|e| broken(one_line(&text, &e)))?;
    config.check().map_err(broken)?;
    Ok(config)
}

fn read_file(path: &Path) -> Result<(String, String)> {
    let bytes = softtissue_store::read_limited(path, LARGEST_FILE).with_context(|| {
        let names = EMBEDDED.map(|(name, _)| name).join(", ");
        format!("--config takes {names} or a file, not {}", path.display())
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

/// TOML errors span lines and draw the place; here it is a number.
fn one_line(text: &str, error: &toml::de::Error) -> String {
    let message = error.message().replace('\n', " ");
    match error.span().and_then(|span| text.get(..span.start)) {
        Some(before) => format!("line {}: {message}", before.matches('\n').count() + 1),
        None => message,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn with(set: &[&str]) -> Result<Config> {
        resolve(&Settings { set: set.iter().map(|s| (*s).to_owned()).collect(), ..Settings::default() })
            .map(|r| r.config)
    }

    #[test]
    fn every_embedded_configuration_resolves() {
        for (name, _) in EMBEDDED {
            let settings = Settings { config: Some(name.into()), ..Settings::default() };
            assert_eq!(resolve(&settings).unwrap().name, name);
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
        assert_eq!(resolve(&settings).unwrap().config.seed, 1);
        assert!(with(&["regresor.steps=3"]).unwrap_err().to_string().contains("regresor"));
        assert!(with(&["seed"]).unwrap_err().to_string().contains("KEY=VALUE"));
        assert!(with(&["seed.x=1"]).is_err());
    }

    #[test]
    fn scans_follow_the_one_seed_unless_they_have_their_own() {
        let seeds = |set: &[&str]| with(set).map(|c| (c.seed, c.synth.seed)).unwrap();
        assert_eq!(seeds(&["seed=7"]), (7, 7));
        assert_eq!(seeds(&["seed=7", "synth.seed=1"]), (7, 1));
    }

    #[test]
    fn a_licence_is_stated_only_by_the_user() {
        let stated = |set: &[&str]| {
            let set = set.iter().map(|s| (*s).to_owned()).collect();
            resolve(&Settings { set, ..Settings::default() }).unwrap().licence_stated
        };
        assert!(!stated(&[]));
        assert!(stated(&["licence=CC0-1.0"]));
    }

    #[test]
    fn an_error_in_a_file_has_its_line() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("wrong.toml");
        std::fs::write(&path, "seed = 1\n[regressor]\nlatents = \"many\"\n").unwrap();
        let settings = Settings { config: Some(path.display().to_string()), ..Settings::default() };
        let message = resolve(&settings).map(|_| ()).unwrap_err().to_string();
        assert!(message.contains("line 3") && message.contains("many"), "{message}");
    }
}
