use crate::verbs::contact_sheet::{ContactSheet, Tile};
use glam::Vec3;
use serde::Serialize;
use serde_json::{Map, Value, json};
use softtissue_clips::inspection::{ClipFindings, MeshFacts, Problem};

/// Pixels of a tile.
const TILE: (usize, usize) = (160, 240);

/// What a file or folder is, what is wrong with it, and what to draw of it.
#[derive(Clone, Debug, Default)]
pub struct Facts {
    /// What it is, in a few words.
    pub what: String,
    /// Names and values, in the order in which they are told.
    details: Vec<(&'static str, Value)>,
    /// What is wrong.
    pub problems: Vec<Problem>,
    /// Rows of the picture.
    pub rows: Vec<Vec<Tile>>,
}

impl Facts {
    /// Something, of which nothing else is known yet.
    pub fn new(what: impl Into<String>) -> Self {
        Self { what: what.into(), ..Self::default() }
    }

    /// One fact more; a null is none.
    pub fn with(mut self, name: &'static str, value: impl Serialize) -> Self {
        self.set(name, value);
        self
    }

    /// One fact more; a null is none.
    pub fn set(&mut self, name: &'static str, value: impl Serialize) {
        match serde_json::to_value(value) {
            Ok(Value::Null) | Err(_) => {}
            Ok(value) => self.details.push((name, value)),
        }
    }

    /// Range, mesh, self-intersection, problems and picture of one clip.
    pub fn findings(mut self, found: ClipFindings) -> Self {
        self.set("range_m", found.range.map(range));
        self.mesh(found.mesh.as_ref());
        self.set("self_intersection", self_intersection(&found));
        self.problems.extend(found.problems);
        self.rows.push(Tile::row(&found.samples));
        self
    }

    /// How a mesh hangs together.
    pub fn mesh(&mut self, mesh: Option<&MeshFacts>) {
        self.set("mesh", mesh);
    }

    /// The picture, where there is something to draw.
    pub fn sheet(&self) -> Option<ContactSheet> {
        let rows: Vec<Vec<Tile>> = self.rows.iter().filter(|row| !row.is_empty()).cloned().collect();
        (!rows.is_empty()).then_some(ContactSheet { rows, tile: TILE, centred: true })
    }

    /// One object: `what`, the facts, `problems`.
    pub fn to_json(&self) -> Value {
        let mut object = Map::new();
        object.insert("what".into(), json!(self.what));
        for (name, value) in &self.details {
            object.insert((*name).into(), value.clone());
        }
        object.insert("problems".into(), json!(self.problems));
        Value::Object(object)
    }

    /// For people.
    pub fn print(&self) {
        crate::print_line(&format!("what: {}", self.what));
        for (name, value) in &self.details {
            print_value(name, value, "");
        }
        if self.problems.is_empty() {
            crate::print_line("problems: none found");
            return;
        }
        crate::print_line("problems:");
        self.problems.iter().for_each(|p| crate::print_line(&format!("  {p}")));
    }
}

/// Lowest and highest corner, metres.
pub fn range([low, high]: [Vec3; 2]) -> Value {
    json!({"low": low.to_array(), "high": high.to_array()})
}

/// Faces that cut through others in the sampled frames, as number and share; nothing where none was tested.
pub fn self_intersection(found: &ClipFindings) -> Option<Value> {
    let faces = found.mesh.as_ref().map(|m| m.triangles).filter(|_| !found.cut.is_empty())?;
    let most = found.cut.iter().map(|c| c.1).max()?;
    let share = (1e4 * most as f64 / faces as f64).round() / 1e4;
    let frames: Vec<usize> = found.cut.iter().map(|c| c.0).collect();
    let cut: Vec<usize> = found.cut.iter().map(|c| c.1).collect();
    Some(json!({"frames_tested": frames, "faces_that_cut_others": cut, "largest_share": share}))
}

fn print_value(name: &str, value: &Value, indent: &str) {
    match value {
        Value::Object(inner) => {
            crate::print_line(&format!("{indent}{name}:"));
            inner.iter().for_each(|(name, value)| print_value(name, value, &format!("{indent}  ")));
        }
        Value::Array(items) if !items.is_empty() && items.iter().all(|i| i.is_string() || i.is_object()) => {
            crate::print_line(&format!("{indent}{name}:"));
            for item in items {
                let text = item.as_str().map_or_else(|| one_line(item), str::to_owned);
                crate::print_line(&format!("{indent}  {text}"));
            }
        }
        Value::String(text) => crate::print_line(&format!("{indent}{name}: {text}")),
        other => crate::print_line(&format!("{indent}{name}: {other}")),
    }
}

/// The entries of an object side by side.
fn one_line(item: &Value) -> String {
    let Value::Object(entries) = item else { return item.to_string() };
    let entry = |(name, value): (&String, &Value)| match value {
        Value::String(text) => format!("{name} {text}"),
        other => format!("{name} {other}"),
    };
    entries.iter().map(entry).collect::<Vec<_>>().join(", ")
}
