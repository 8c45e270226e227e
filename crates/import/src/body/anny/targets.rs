use super::mesh::METRES;
use super::phenotype::{Feature, Phenotype};
use super::source::Source;
use crate::{ImportError, Result};
use glam::Vec3;
use softtissue_monitor::Monitor;

/// A sparse displacement of the base mesh and the features whose product weighs it.
pub struct Target {
    features: Vec<Feature>,
    /// `(vertex, displacement in metres)`.
    moves: Vec<(u32, Vec3)>,
}

/// Folders of targets that the phenotype weighs.
const FOLDERS: [&str; 4] =
    ["targets/macrodetails", "targets/macrodetails/height", "targets/macrodetails/proportions", "targets/breast"];

impl Target {
    /// Reads every target of adults that the phenotype weighs.
    pub fn read_all(source: &Source, vertices: usize, monitor: &dyn Monitor) -> Result<Vec<Self>> {
        let mut targets = Vec::new();
        for folder in FOLDERS {
            for name in source.list(folder)? {
                if monitor.should_stop() {
                    return Err(ImportError::Stopped);
                }
                let Some(features) = name.strip_suffix(".target.gz").and_then(Feature::parse_all) else { continue };
                if features.contains(&Feature::Child) {
                    continue;
                }
                let file = format!("{folder}/{name}");
                let bytes = source.read(&file)?;
                let moves = parse(&String::from_utf8_lossy(&bytes), vertices).map_err(|line| {
                    source.place(&file).refuse(format!("line {line} moves no vertex; get the package again"))
                })?;
                targets.push(Self { features, moves });
            }
        }
        if targets.is_empty() {
            return Err(source.place(FOLDERS[0]).refuse("it holds no target (*.target.gz); get the package again"));
        }
        Ok(targets)
    }

    /// Adds the target to somebody's vertices, as much as the phenotype has it.
    pub fn add(&self, phenotype: &Phenotype, vertices: &mut [Vec3]) {
        let weight: f32 = self.features.iter().map(|f| phenotype.weight(*f)).product();
        if weight != 0.0 {
            self.moves.iter().for_each(|(v, d)| vertices[*v as usize] += *d * weight);
        }
    }
}

/// Lines `vertex dx dy dz`, or the number of the first that is none.
fn parse(text: &str, vertices: usize) -> std::result::Result<Vec<(u32, Vec3)>, usize> {
    let mut moves = Vec::new();
    for (number, line) in text.lines().enumerate() {
        let line = line.trim();
        if line.is_empty() || line.starts_with('#') {
            continue;
        }
        let mut words = line.split_whitespace();
        let vertex = words.next().and_then(|w| w.parse::<u32>().ok()).filter(|v| (*v as usize) < vertices);
        let d: Vec<f32> = words.filter_map(|w| w.parse().ok()).filter(|x: &f32| x.is_finite()).collect();
        match (vertex, &d[..]) {
            (Some(v), [x, y, z]) => moves.push((v, Vec3::new(*x, *y, *z) * METRES)),
            _ => return Err(number + 1),
        }
    }
    Ok(moves)
}
