use crate::{Animation, ExportError, Result};
use glam::Vec3;
use softtissue_geometry::vertex_normals;
use softtissue_monitor::Monitor;
use softtissue_store::write_atomic;
use std::io::Write;
use std::path::Path;

/// Writes a USD stage as text (`.usda`): a mesh whose points, normals and extent have a sample a frame. Metres, Y up,
/// triangles without subdivision; time codes are frames at the animation's rate.
pub fn write_usd(path: &Path, animation: &Animation, monitor: &dyn Monitor) -> Result<()> {
    animation.check()?;
    if !path.extension().is_some_and(|e| e.eq_ignore_ascii_case("usda")) {
        let reason = "its name does not end in .usda; name it so".into();
        return Err(ExportError::Target { path: path.to_owned(), reason });
    }
    monitor.begin("USD", 3 * animation.vertices.len() as u64, "samples");
    let mut stopped = false;
    let written = write_atomic(path, |w| {
        let mut stage = Stage { w, animation, monitor, stopped: &mut stopped };
        stage.head()?;
        stage.faces()?;
        stage.samples("float3[] extent", "", extent)?;
        stage.samples("point3f[] points", "", |frame, _| list(frame.iter().copied()))?;
        stage.samples("normal3f[] normals", " (\n            interpolation = \"vertex\"\n        )", |frame, a| {
            list(vertex_normals(frame, &a.topology.faces).into_iter())
        })?;
        stage.tail()
    });
    if stopped {
        return Err(ExportError::Stopped);
    }
    written?;
    monitor.end();
    Ok(())
}

/// A stage on its way into a file.
struct Stage<'a> {
    w: &'a mut dyn Write,
    animation: &'a Animation<'a>,
    monitor: &'a dyn Monitor,
    stopped: &'a mut bool,
}

impl Stage<'_> {
    fn head(&mut self) -> std::io::Result<()> {
        let Animation { name, fps, extras, .. } = *self.animation;
        let end = self.animation.vertices.len() - 1;
        let about = if extras.is_null() { String::new() } else { extras.to_string() };
        write!(
            self.w,
            "#usda 1.0\n(\n    customLayerData = {{\n        string creator = \"softtissue {}\"\n        string about = \
             {}\n    }}\n    defaultPrim = \"Root\"\n    endTimeCode = {end}\n    framesPerSecond = {fps}\n    \
             metersPerUnit = 1\n    startTimeCode = 0\n    timeCodesPerSecond = {fps}\n    upAxis = \"Y\"\n)\n\n\
             def Xform \"Root\" (\n    displayName = {}\n    kind = \"component\"\n)\n{{\n    def Mesh \"Body\"\n    {{\n",
            env!("CARGO_PKG_VERSION"),
            quoted(&about),
            quoted(name),
        )
    }

    /// What does not move.
    fn faces(&mut self) -> std::io::Result<()> {
        let Animation { topology, uv, .. } = *self.animation;
        let counts = vec!["3"; topology.faces.len()].join(", ");
        writeln!(self.w, "        int[] faceVertexCounts = [{counts}]")?;
        writeln!(self.w, "        int[] faceVertexIndices = {}", indices(&topology.faces))?;
        writeln!(self.w, "        uniform token orientation = \"rightHanded\"")?;
        writeln!(self.w, "        uniform token subdivisionScheme = \"none\"")?;
        writeln!(self.w, "        color3f[] primvars:displayColor = [(0.76, 0.55, 0.44)]")?;
        let Some(uv) = uv else { return Ok(()) };
        let coordinates: Vec<String> = uv.coordinates.iter().map(|c| format!("({}, {})", c.x, c.y)).collect();
        writeln!(
            self.w,
            "        texCoord2f[] primvars:st = [{}] (\n            interpolation = \"faceVarying\"\n        )",
            coordinates.join(", ")
        )?;
        writeln!(self.w, "        int[] primvars:st:indices = {}", indices(uv.faces))
    }

    fn samples(
        &mut self,
        attribute: &str,
        metadata: &str,
        value: impl Fn(&[Vec3], &Animation) -> String,
    ) -> std::io::Result<()> {
        if !metadata.is_empty() {
            writeln!(self.w, "        {attribute}{metadata}")?;
        }
        writeln!(self.w, "        {attribute}.timeSamples = {{")?;
        for (t, frame) in self.animation.vertices.iter().enumerate() {
            if self.monitor.should_stop() {
                *self.stopped = true;
                return Err(std::io::ErrorKind::Interrupted.into());
            }
            writeln!(self.w, "            {t}: {},", value(frame, self.animation))?;
            self.monitor.advance(1, "");
        }
        writeln!(self.w, "        }}")
    }

    fn tail(&mut self) -> std::io::Result<()> {
        writeln!(self.w, "    }}\n}}")
    }
}

/// The frame's bounding box.
fn extent(frame: &[Vec3], _: &Animation) -> String {
    let low = frame.iter().copied().fold(Vec3::INFINITY, Vec3::min);
    let high = frame.iter().copied().fold(Vec3::NEG_INFINITY, Vec3::max);
    list([low, high].into_iter())
}

/// The shortest decimals that read back as the same f32.
fn list(points: impl Iterator<Item = Vec3>) -> String {
    let points: Vec<String> = points.map(|p| format!("({}, {}, {})", p.x, p.y, p.z)).collect();
    format!("[{}]", points.join(", "))
}

fn indices(faces: &[[u32; 3]]) -> String {
    let words: Vec<String> = faces.as_flattened().iter().map(u32::to_string).collect();
    format!("[{}]", words.join(", "))
}

/// A string of the text format: quotes and backslashes escaped, control characters as spaces.
fn quoted(text: &str) -> String {
    let clean: String = text.chars().map(|c| if c.is_control() { ' ' } else { c }).collect();
    format!("\"{}\"", clean.replace('\\', "\\\\").replace('"', "\\\""))
}
